"""How many taxels are loaded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel import _core
from taxel._base.parameters import defaults
from taxel.encode._tared import Tared
from taxel.tare import Tare

__all__ = ["ContactArea"]


_DEFAULT = defaults("contact_area")


@dataclass(kw_only=True, eq=False, repr=False)
class ContactArea(Tared):
    """Give a spike where the number of loaded taxels rises through levels, and where it falls below them.

    A taxel is loaded while its held value stands above its tared rest by the noise floor and half a tick; it counts if
    one of its 8 neighbours is loaded too. A taxel without a value, in the tare or since, is unloaded. The number is
    counted once a stamp, after the last event that carries it; spikes have the stamp's time. Spikes do not depend on
    the place of a touch, so what is learnt at one place holds at others.

    Trains, unsigned: rises through each level, then falls below each; ten by default.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit (ticks), 0 or more
        That of the board; 3 in its fast presets.
    levels : sequence of int, ascending
        Numbers of taxels.
    tare : Tare, or float, s, optional
        The taxels' rest, or how long each recording begins with it. It belongs to a board and a day, so a saved readout
        has none; without it nothing is encoded.

    Raises
    ------
    ProblemError : a parameter that makes no sense; encoding without a tare, or with another array's

    Examples
    --------
    >>> from taxel import Frames
    >>> rest = Frames([[[50.0, 52.0]], [[50.0, 52.0]]], [0, 1000], unit="ticks")
    >>> touch = Frames([[[50.0, 52.0]], [[58.0, 57.0]], [[58.0, 52.0]]], [0, 192, 384], unit="ticks")
    >>> spikes = ContactArea(tare=Tare.take(rest)).encode(touch)
    >>> spikes[0], spikes[5]
    (array([0.192]), array([0.384]))
    """

    name = "contact_area"

    noise_floor: float = _DEFAULT.noise_floor
    levels: Sequence[int] = _DEFAULT.levels
    tare: Tare | float | None = _DEFAULT.tare

    @property
    def above(self) -> float:
        """What a loaded taxel reads above its rest at least, in the sensor's unit: the noise floor and half a tick.

        Examples
        --------
        >>> ContactArea().above
        3.5
        """
        return _core.touched_above(float(self.noise_floor))
