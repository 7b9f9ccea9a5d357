"""A skin: afferents of all four types at random positions on one array."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import instance, shown
from taxel._base.errors import refused
from taxel._base.parameters import defaults
from taxel.array import Array
from taxel.encode._tared import Tared
from taxel.tare import Tare

__all__ = ["Afferents", "Skin"]


_DEFAULT = defaults("skin")
#: The types of afferents, in the order of a skin's trains.
KINDS = ("SA-1", "FA-1", "SA-2", "FA-2")


@dataclass(frozen=True, eq=False)
class Afferents:
    """Hold the type and the position of the afferent of each train of a `Skin`.

    Parameters
    ----------
    kind : array of str, shape (trains,)
        The labels ``"SA-1"``, ``"FA-1"``, ``"SA-2"`` or ``"FA-2"``.
    x_mm, y_mm : array of float, mm, shape (trains,)
        To the right and downwards from the middle of the first taxel.

    Examples
    --------
    >>> afferents = Skin(seed=5).afferents(Array(10, 10, pitch_mm=1.0))
    >>> len(afferents), str(afferents.kind[0])
    (241, 'SA-1')
    """

    kind: NDArray[np.str_]
    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.kind)

    def trains(self, kind: str) -> NDArray[np.int64]:
        """Return the numbers of the trains of one type.

        Parameters
        ----------
        kind : {"SA-1", "FA-1", "SA-2", "FA-2"}

        Returns
        -------
        array of int, shape (trains of this type,)

        Raises
        ------
        ProblemError : no such type

        Examples
        --------
        >>> Skin(seed=5).afferents(Array(10, 10, pitch_mm=1.0)).trains("SA-2")
        array([210, 211, 212, 213, 214, 215])
        """
        if not isinstance(kind, str) or kind not in KINDS:
            raise refused("kind", f" is {shown(kind)}: must be one of {', '.join(KINDS)}")
        return np.flatnonzero(self.kind == kind)


@dataclass(kw_only=True, eq=False, repr=False)
class Skin(Tared):
    """Encode with the afferents of a fingertip: all four types at random positions, each with a receptive field.

    Trains are unsigned, like the spikes of a nerve: all SA-1, then FA-1, SA-2, FA-2, each from the first taxel to the
    last; `afferents` returns the type and position of each. Each type is the encoder of that name with its defaults and
    this `range`; FA-1's threshold decays by the ms (`decay="ms"`).

    Parameters
    ----------
    sa1_per_cm2, fa1_per_cm2, sa2_per_cm2, fa2_per_cm2 : float, 0 or more
        Density of each type, afferents per cm^2 of taxels; 0 excludes a type.
    sa1_field_mm2, fa1_field_mm2, sa2_field_mm2, fa2_field_mm2 : float, mm^2, above 0
        Area of the receptive field of each type: a disc, whose taxels are averaged with Gaussian weights; its edge is
        at two standard deviations. If no centre of a taxel is in it, the field is the taxel at its position.
    range : float, in the sensor's unit, above 0
        The largest pressure; 150 ticks is the ramp of the board's 5.2 kHz preset.
    seed : int, 0 or more
        Seed of the positions.
    period_ms : float, ms, whole us, at most 1
        Sampling period of events; frames must arrive at this period within one half.
    tare : Tare, or float, s, optional
        The taxels' rest, or the duration of rest at the beginning of each recording: pressure is the value above it (0
        if a rest is unknown). Default: a rest of 0. It is valid for one board on one day, so a saved readout has no
        tare.

    Raises
    ------
    ProblemError : an invalid parameter, or more than a million afferents on the array

    Notes
    -----
    Densities for each cm^2 are 70, 140 and 25 of SA-1, FA-1 and FA-2, and for SA-2 the rest of 241 in total: Johansson
    and Vallbo (1979), J. Physiol. 286:283, as cited by Saal et al. (2017), PNAS 114:E5693. Fields are medians of 11.0
    mm^2 (SA-1) and 12.6 (FA-1), some 5 times (SA-2) and 10 times (FA-2) as large (Johansson and Vallbo 1980, Brain Res.
    184:353). Their shape is our choice. On an array as coarse as the thesis' (2.67 mm) each taxel has several
    afferents.

    Examples
    --------
    >>> skin = Skin(seed=5)
    >>> tip = Array(10, 10, pitch_mm=1.0)
    >>> afferents = skin.afferents(tip)
    >>> [len(afferents.trains(kind)) for kind in ("SA-1", "FA-1", "SA-2", "FA-2")]
    [70, 140, 6, 25]
    >>> skin.trains(tip)
    241
    """

    name = "skin"

    sa1_per_cm2: float = _DEFAULT.sa1_per_cm2
    fa1_per_cm2: float = _DEFAULT.fa1_per_cm2
    sa2_per_cm2: float = _DEFAULT.sa2_per_cm2
    fa2_per_cm2: float = _DEFAULT.fa2_per_cm2
    sa1_field_mm2: float = _DEFAULT.sa1_field_mm2
    fa1_field_mm2: float = _DEFAULT.fa1_field_mm2
    sa2_field_mm2: float = _DEFAULT.sa2_field_mm2
    fa2_field_mm2: float = _DEFAULT.fa2_field_mm2
    range: float = _DEFAULT.range
    seed: int = _DEFAULT.seed
    period_ms: float = _DEFAULT.period_ms
    tare: Tare | float | None = _DEFAULT.tare

    def afferents(self, array: Array) -> Afferents:
        """Return the type and the position of each train's afferent on an array.

        Parameters
        ----------
        array : Array
            The sensor; its pitch determines its area in cm^2.

        Returns
        -------
        Afferents

        Raises
        ------
        ProblemError : not an array, or more than a million afferents on it

        Examples
        --------
        >>> len(Skin(fa1_per_cm2=0, seed=5).afferents(Array(10, 10, pitch_mm=1.0)))
        101
        """
        kind, x, y = _core.skin_afferents(self._json(), instance("array", array, Array)._parts())
        return Afferents(np.array(kind, dtype="<U4"), np.array(x, dtype=float), np.array(y, dtype=float))
