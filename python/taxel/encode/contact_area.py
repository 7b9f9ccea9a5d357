"""Encoder of the contact area: the number of loaded taxels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel import _core
from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

_DEFAULT = defaults("contact_area")


@dataclass(kw_only=True, eq=False, repr=False)
class ContactArea(Tared):
    """Fire when the number of loaded taxels rises to a level, and when it falls below the level.

    A taxel is loaded while its held value exceeds its rest by the noise floor and half a tick (by the floor and half of
    it if the floor is below 1, as for a unit coarser than the values; a floor of 0 is for whole numbers only). It
    counts if one of its 8 neighbours is loaded too; a single taxel counts from the noise floor on, or from six times
    its noise in the tare if that is more, until it is below half of it. A taxel without a value, in the tare or since,
    is unloaded. The number is computed once for each stamp, after the last event with it, and spikes have the time of
    the stamp. Spikes do not depend on the position of a touch, so weights that are learnt at one position apply to
    others.

    Trains are unsigned: rises to each level, then falls below each; ten by default.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit (ticks), 0 or more
        The noise floor of the board; 3 in its fast presets.
    levels : sequence of int, ascending
        Numbers of taxels.
    tare : Tare, or float, s, optional
        The taxels' rest, or the duration of rest at the beginning of each recording. It is valid for one board on one
        day, so a saved readout has no tare; encoding requires one.

    Raises
    ------
    ProblemError : an invalid parameter; encoding without a tare, or with another array's

    Examples
    --------
    >>> from taxel import Array, Frames
    >>> two = Array(1, 2, pitch_mm=2.0)
    >>> rest = Frames([[[50.0, 52.0]], [[50.0, 52.0]]], [0, 1000], unit="ticks", array=two)
    >>> touch = Frames([[[50.0, 52.0]], [[58.0, 57.0]], [[58.0, 52.0]]], [0, 192, 384], unit="ticks", array=two)
    >>> spikes = ContactArea(tare=Tare.take(rest)).encode(touch)
    >>> spikes[0], spikes[5]
    (array([0.192]), array([0.384]))
    """

    name = "contact_area"
    _needs_neighbours = True

    noise_floor: float = _DEFAULT.noise_floor
    levels: Sequence[int] = _DEFAULT.levels
    tare: Tare | float | None = _DEFAULT.tare

    @property
    def above(self) -> float:
        """The least value above its rest at which a taxel is loaded, in the sensor's unit: noise floor and half a tick.

        Examples
        --------
        >>> ContactArea().above
        3.5
        """
        return _core.touched_above(float(self.noise_floor))
