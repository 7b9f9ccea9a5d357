"""The base class of encoders that subtract the rest of the taxels."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import finite, integer, parameters, shown
from taxel._base.errors import refused
from taxel._core import ProblemError
from taxel.encode._encoder import Encoder
from taxel.events import Events
from taxel.frames import Frames
from taxel.recorded import Recorded, recorded
from taxel.spikes import SpikeTrains
from taxel.tare import Tare


class Tared(Encoder):
    """Encode the values above the rest of the taxels; the base class of encoders with the parameter `tare`.

    A rest is valid for one board on one day, so a saved readout has no rest and must be given one. If `tare` is a
    number of seconds, the rest is measured at the beginning of each recording, so that recordings of several boards can
    be encoded together.
    """

    tare: Tare | float | None

    def _json(self) -> str:
        if not self._is_rest():
            return super()._json()
        # The tare's JSON is inserted as text, as parsing and writing that of thousands of taxels is slow.
        rest = self.tare.to_json()  # type: ignore[union-attr]
        others = {name: value for name, value in self._plain().items() if name != "tare"}
        return f'{parameters(others)[:-1]}, "tare": {rest}}}'

    def _is_rest(self) -> bool:
        """Return whether `tare` is a `Tare`; otherwise check that it is a valid number of seconds."""
        if self.tare is None or isinstance(self.tare, Tare):
            return self.tare is not None
        try:
            finite("tare", self.tare)
        except ProblemError:
            raise refused("tare", f" is {shown(self.tare)}: must be a taxel.Tare, or a number of seconds") from None
        return False

    def _plain(self) -> dict[str, Any]:
        rest = {} if self._is_rest() else {"tare": None}
        return {name: value for name, value in super()._plain().items() if name not in rest} | rest

    def encode(self, x: Events | Frames | Recorded) -> SpikeTrains:
        encoder, source = self._with_rest_of(x)
        # With a floor of 0 a taxel is loaded from half a tick on; values with fractions have no tick.
        if isinstance(source, Frames) and getattr(self, "noise_floor", None) == 0 and _has_fractions(source.values):
            raise refused(
                "noise_floor",
                f" is 0, but the values are in {source.unit}: must be the noise at rest, for example 0.01; 0 is "
                f"only for "
                "whole numbers",
            )
        return super(Tared, encoder).encode(source)

    def _with_rest_of(self, x: Events | Frames | Recorded) -> tuple[Self, Events | Frames | Recorded]:
        """Return the encoder with its tare, measured at the beginning of `x` if it is a number of seconds, and `x`."""
        if self.tare is None:
            return self, x
        if isinstance(self.tare, Tare):
            source = recorded(x)
            if isinstance(source, Events | Frames):
                self.tare.array._warn_apart(source.array, "the recording", stacklevel=4)
            return self, source
        source = recorded(x)
        if not isinstance(source, Events | Frames) or not len(source.t):
            return self, source
        first, last = int(source.t[0]), int(source.t[-1])
        rest_us = integer("tare, us", round(1e6 * finite("tare", self.tare)), 1, 2**53)
        if 2 * rest_us > last - first:
            lasts = f"the recording lasts {(last - first) / 1e6:g} s"
            raise refused(
                "tare", f" is {self.tare} s, more than half of the recording: must be shorter, because {lasts}"
            )
        return self.with_tare(Tare.take(source, stop_us=first + rest_us)), source

    def __eq__(self, other: object) -> bool:
        same = super().__eq__(other)
        return same if same is not True else self._seconds() == other._seconds()  # type: ignore[attr-defined]

    __hash__ = None  # type: ignore[assignment]

    def _seconds(self) -> object:
        return None if self._is_rest() else self.tare

    def with_tare(self, tare: Tare) -> Self:
        super().with_tare(tare)
        return copy.copy(self).set_params(tare=tare)

    @classmethod
    def _from_values(cls, values: Mapping[str, Any]) -> Self:
        rest = values.get("tare")
        return super()._from_values({**values, "tare": rest and Tare.from_json(json.dumps(rest))})


def _has_fractions(values: NDArray[np.float32]) -> bool:
    return bool((np.nan_to_num(values) % 1).any())
