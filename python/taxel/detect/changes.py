"""Recordings as they might be on another day: other gains, more noise, a touch at the start, drift, bad taxels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel.detect.examples import Example
from taxel.events import Events
from taxel.frames import Frames

#: The largest value of an event, ticks.
_MOST = 65_534

_Values: TypeAlias = NDArray[np.float32]


class Readings(NamedTuple):
    """What taxels read above their rest, one value an event, or one row a frame.

    Attributes
    ----------
    above : float32, shape (events,) or (frames, taxels), in the sensor's unit
    t : int64, shape (events,) or (frames, 1), us
    taxel : int64, shape (events,) or (taxels,)
        Of which taxel each is.
    noise : float32, shape (events,) or (taxels,), in the sensor's unit
        Of that taxel in the tare; NaN where it has none.
    noise_floor : float, in the sensor's unit
    loaded_us : float, us
        When the sensor is loaded; minus infinity where that is not known.
    """

    above: _Values
    t: NDArray[np.int64]
    taxel: NDArray[np.int64]
    noise: _Values
    noise_floor: float
    loaded_us: float

    def gained(self, gain: float) -> _Values:
        """Return what they read with another gain of what is above the noise floor: noise is not the skin's."""
        above = self.above.copy()
        above[np.abs(above) > self.noise_floor] *= gain
        return above

    def noisier(self, times: float) -> _Values:
        """Return what they read with so many times the noise."""
        noise = np.float32((times**2 - 1.0) ** 0.5) * self.noise
        more: _Values = noise * np.random.default_rng(1).standard_normal(self.above.shape, np.float32)
        return self.above + more

    def begun_loaded(self) -> _Values:
        """Return what they read where each is loaded from the beginning as it is when the sensor is."""
        before = self.t < self.loaded_us
        held, earlier = np.zeros(self.taxel.max() + 1, np.float32), self.above[: np.count_nonzero(before)]
        # Of several values of a taxel the last one stays.
        held[np.broadcast_to(self.taxel, self.above.shape)[: len(earlier)]] = earlier
        return np.where(before, held[self.taxel], self.above)

    def drifted(self, floors_a_minute: float) -> _Values:
        """Return what they read where the rest of all drifts by so many noise floors a minute."""
        rate = floors_a_minute * self.noise_floor / 6e7
        return self.above + (rate * (self.t - self.t[:1])).astype(np.float32)

    def bad(self, reads: float) -> _Values:
        """Return what they read where the taxel that is loaded most in all reads always the same."""
        loads = np.nan_to_num(np.maximum(self.above, 0.0))
        sums = loads.sum(axis=0) if loads.ndim > 1 else np.bincount(self.taxel, loads)
        return np.where(self.taxel == sums.argmax(), np.float32(reads), self.above)


#: Labels before the sensor is loaded are left out then.
LOADED = "loaded at the start"
#: What runs is chosen by mistakes in what was recorded and with each of these, in sum.
CHOOSING: dict[str, Callable[[Readings], _Values]] = {
    "gain x 0.8": lambda read: read.gained(0.8),
    "gain x 1.25": lambda read: read.gained(1.25),
    "noise x 1.5": lambda read: read.noisier(1.5),
    LOADED: lambda read: read.begun_loaded(),
}
#: With these mistakes are told, and choose nothing.
TOMORROW: dict[str, Callable[[Readings], _Values]] = {
    "a drift of a noise floor a minute": lambda read: read.drifted(1.0),
    "a dead taxel": lambda read: read.bad(0.0),
    "a stuck taxel": lambda read: read.bad(float(np.nanmax(read.above))),
}
#: These are of frames alone, as a noisy board sends other events too. Of 100 labels on emulated boards with 1.5 times
#: the noise neurons miss or invent 26, rules 56; with that noise on the events of before 1 and 44.
OF_FRAMES = ("noise x 1.5",)


def changed(example: Example, change: str, noise_floor: float, loaded_us: float) -> Example:
    """Return a (checked) example of events or frames with other readings; noise floor and time are of `Readings`."""
    source, tare = example.source, example.tare
    assert isinstance(source, Events | Frames)
    if not len(source.t):
        return example
    values: NDArray[Any]
    if isinstance(source, Frames):
        values, t, taxel = source.values.reshape(len(source), -1), source.t[:, None], np.arange(source.array.taxels)
    else:
        assert source.intensity is not None
        values, t, taxel = source.intensity, source.t, source.y.astype(np.int64) * source.array.columns + source.x
    zeros = np.zeros(source.array.shape)
    tared = (zeros, zeros) if tare is None else (tare.rest, tare.noise)
    rest, noise = (each.ravel().astype(np.float32)[taxel] for each in tared)
    read = Readings(values - rest, t, taxel, noise, noise_floor, loaded_us)
    # A taxel without a rest, as one beyond the edge of a smaller array, reads what it reads.
    other = np.where(np.isnan(rest), values, rest + (CHOOSING | TOMORROW)[change](read))
    if isinstance(source, Frames):
        frames = Frames(other.reshape(source.values.shape), source.t, unit=source.unit, array=source.array)
        return example._replace(source=frames)
    ticks = np.clip(np.rint(other), 0, _MOST).astype(np.uint16) * np.asarray(source.present)
    same = source._columns | {"intensity": ticks}
    return example._replace(source=Events._unchecked(source.array, source.markers, **same))
