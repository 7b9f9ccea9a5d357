"""What encoders that read the taxels' rest have in common."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from typing import Any, Self

from taxel._arguments import instance, parameters
from taxel.encode._encoder import Encoder
from taxel.tare import Tare

__all__ = ["Tared"]


class Tared(Encoder):
    """Turn what stands above the taxels' rest into spikes: an encoder with the parameter `tare`.

    A rest belongs to a board and a day, so a saved readout has none and is given one.
    """

    tare: Tare | None

    def _json(self) -> str:
        if self.tare is None:
            return super()._json()
        # As it stands: a tare of thousands of taxels need not be read to be handed over.
        rest = instance("tare", self.tare, Tare).to_json()
        others = {name: value for name, value in self._plain().items() if name != "tare"}
        return f'{parameters(others)[:-1]}, "tare": {rest}}}'

    def with_tare(self, tare: Tare) -> Self:
        """Return the same encoder with this tare."""
        super().with_tare(tare)
        return copy.copy(self).set_params(tare=tare)

    @classmethod
    def _from_values(cls, values: Mapping[str, Any]) -> Self:
        rest = values.get("tare")
        return super()._from_values({**values, "tare": rest and Tare.from_json(json.dumps(rest))})
