"""How large a touch is, how hard, and where its centre has gone since it began."""

from __future__ import annotations

import json
from typing import Any, Self

from taxel._arguments import parameters
from taxel.encode._encoder import Encoder
from taxel.tare import Tare

__all__ = ["Moments"]


class Moments(Encoder):
    """Say where area, total, peak and the way of the centre of a touch pass levels that stand in equal ratios.

    Of the taxels that count as `ContactArea` counts them: how many (area), the sum and the largest of their values
    above rest (total, peak), and how far their centre, weighted by these values, has moved to the right and downwards
    since the present touch began. A touch begins where area rises above 0 and ends where it is 0; between touches all
    are 0. A level of the displacement stands on both sides of 0 and is passed outwards. Nothing here depends on where
    on the array the touch began, so what is learnt at one place holds at others.

    Trains, unsigned, one a level in the order area, total, peak, x right, x left, y down, y up, each from its least
    level on: first where each level is reached, then where each is left, then (with `tonic_ms`) one that speaks while
    beyond. It begins settled: the first sample makes no crossing. Reckoned in float64.

    Parameters
    ----------
    noise_floor : float, in the sensor's unit (ticks), 0 or more
        That of the board; 3 in its fast presets.
    levels : int, 1 to 1000
        Levels a moment, for a displacement on each side of 0.
    area : (float, float), taxels, optional
        Least and largest level; None leaves the moment out.
    total, peak : (float, float), in the sensor's unit, optional
        The same of the sum and of the largest value above rest.
    displacement_mm : (float, float), mm, optional
        The same of the centre's way, for x and for y.
    tonic_ms : float, ms, whole us, optional
        While beyond a level: a spike when it is reached, then one every `tonic_ms`. None for crossings alone.
    period_ms : float, ms, whole us
        How often events are sampled; the step of the wire's stamps loses nothing.
    tare : Tare, optional
        The taxels' rest. It belongs to a board and a day, so a saved readout has none; without it nothing is encoded.

    Raises
    ------
    ProblemError : a parameter that makes no sense; encoding without a tare, or with another array's

    Examples
    --------
    A touch of two taxels, then of three; the middle of the largest level, 4, is never reached.

    >>> from taxel import Frames
    >>> rest = Frames([[[50.0, 50.0, 50.0]]] * 2, [0, 1000], unit="ticks")
    >>> frames = Frames([[[50.0, 50, 50]], [[58.0, 58, 50]], [[58.0, 58, 58]]], [0, 200, 400], unit="ticks")
    >>> encoder = Moments(levels=3, area=(1, 4), total=None, peak=None, displacement_mm=(0.3, 5), tonic_ms=None)
    >>> spikes = encoder.with_tare(Tare.take(rest)).encode(frames)
    >>> spikes[0], spikes[1], spikes[2], spikes[3]
    (array([0.2]), array([0.2]), array([]), array([0.4]))
    """

    name = "moments"

    def __init__(
        self,
        *,
        noise_floor: float = 3.0,
        levels: int = 20,
        area: tuple[float, float] | None = (2.0, 500.0),
        total: tuple[float, float] | None = (8.0, 20_000.0),
        peak: tuple[float, float] | None = (4.0, 120.0),
        displacement_mm: tuple[float, float] | None = (0.2, 20.0),
        tonic_ms: float | None = 0.5,
        period_ms: float = 0.1,
        tare: Tare | None = None,
    ) -> None:
        self.noise_floor = noise_floor
        self.levels = levels
        self.area = area
        self.total = total
        self.peak = peak
        self.displacement_mm = displacement_mm
        self.tonic_ms = tonic_ms
        self.period_ms = period_ms
        self.tare = tare
        self._check()

    def _json(self) -> str:
        if not isinstance(self.tare, Tare):
            return super()._json()
        others = parameters({"name": self.name} | {k: v for k, v in self._parameters().items() if k != "tare"})
        return f'{others[:-1]}, "tare": {self.tare.to_json()}}}'

    def with_tare(self, tare: Tare) -> Moments:
        """Return the same encoder with this tare."""
        super().with_tare(tare)
        return Moments(**{**self._parameters(), "tare": tare})

    @classmethod
    def _from_parameters(cls, values: dict[str, Any]) -> Self:
        if values.get("tare") is not None:
            values["tare"] = Tare.from_json(json.dumps(values["tare"]))
        return cls(**values)
