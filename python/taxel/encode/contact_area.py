"""How many taxels are loaded."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Self

from taxel._arguments import parameters
from taxel.encode._encoder import Encoder
from taxel.tare import Tare

__all__ = ["ContactArea"]


class ContactArea(Encoder):
    """Say where the number of loaded taxels rises through levels, and where it falls below them.

    A taxel is loaded while its held value stands above its tared rest by the noise floor and half a tick; it counts if
    one of its 8 neighbours is loaded too. A taxel never heard of, in the tare or since, is unloaded. Reckoned once a
    stamp, after the last event that carries it; spikes have the stamp's time. There is no place in it, so what is
    learnt at one place holds at others.

    Trains, unsigned: rises through each level, then falls below each; ten by default.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit (ticks), 0 or more
        That of the board; 3 in its fast presets.
    levels : sequence of int, ascending
        Numbers of taxels.
    tare : Tare, optional
        The taxels' rest. It belongs to a board and a day, so a saved readout has none; without it nothing is encoded.

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

    def __init__(
        self,
        *,
        noise_floor: float = 3.0,
        levels: Sequence[int] = (2, 4, 8, 16, 32),
        tare: Tare | None = None,
    ) -> None:
        self.noise_floor = noise_floor
        self.levels = levels
        self.tare = tare
        self._check()

    def _json(self) -> str:
        if not isinstance(self.tare, Tare):
            return super()._json()
        # As it stands: a tare of thousands of taxels need not be read to be handed over.
        others = parameters({"name": self.name, "noise_floor": self.noise_floor, "levels": self.levels})
        return f'{others[:-1]}, "tare": {self.tare.to_json()}}}'

    def with_tare(self, tare: Tare) -> ContactArea:
        """Return the same encoder with this tare."""
        super().with_tare(tare)
        return ContactArea(noise_floor=self.noise_floor, levels=self.levels, tare=tare)

    @classmethod
    def _from_parameters(cls, values: dict[str, Any]) -> Self:
        if values.get("tare") is not None:
            values["tare"] = Tare.from_json(json.dumps(values["tare"]))
        return cls(**values)
