"""Spike codes of a population (thesis 2.3.2): rate, first-spike and relative latency; and the drops that they read."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import Frames, SpikeTrains, Tare
from taxel.information import Estimate, estimate, nested_predictions
from taxel.simulate import Act, Scene, Silence, play, truth
from taxel_studies.study import Parameters, Row, Task

__all__ = [
    "PERIOD_US",
    "SIDE",
    "Code",
    "FirstSpikeLatency",
    "RateCode",
    "RelativeLatency",
    "compare_codes",
    "drop",
    "drop_tasks",
    "kinds_of",
    "since_contact",
]

#: Taxels along a side of the region under the impact, and the period of the afferents: whole frames of 192 us.
SIDE = 20
PERIOD_US = 192


@dataclass(frozen=True, kw_only=True)
class Code(ABC):
    """Read values of 0 to 1, one a train, from spikes, as far as the code carries them; 0 is silence in the window.

    Parameters
    ----------
    window_ms : float, ms, above 0
        How long spikes are counted.
    resolution_ms : float, ms, 0 or more
        How finely the reader can tell times; spikes closer than that came together.
    """

    window_ms: float
    resolution_ms: float = 0.0

    @abstractmethod
    def decode(self, trains: SpikeTrains, onset_ms: float) -> NDArray[np.float64]:
        """Return a value a train; spikes count from the onset on (ms), which latencies are measured from."""

    def _first(self, trains: SpikeTrains, onset: float) -> NDArray[np.float64]:
        """Return the latency of each train's first spike at or after the onset, ms; infinite where there is none."""
        first = np.full(len(trains), np.inf)
        times, train = trains.to_numpy()
        later = times >= onset
        np.minimum.at(first, train[later], times[later] - onset)
        return first

    def _rounded(self, latency: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return latencies rounded down to whole steps of the resolution."""
        if not self.resolution_ms:
            return latency
        # 1e-9 keeps a time in its step that is a whole number of steps but for its rounding error.
        return np.asarray(self.resolution_ms * np.floor(latency / self.resolution_ms + 1e-9))


@dataclass(frozen=True, kw_only=True)
class RateCode(Code):
    """Read a value from the number of spikes within the window; ``most_hz`` is the rate of a value of 1.

    Examples
    --------
    >>> code = RateCode(window_ms=100.0, most_hz=100.0)
    >>> code.decode(SpikeTrains.from_lists([[], [10.0, 20.0, 30.0, 40.0, 50.0]], stop=100.0), 0.0)
    array([0. , 0.5])
    """

    most_hz: float = 1000.0

    def decode(self, trains: SpikeTrains, onset_ms: float) -> NDArray[np.float64]:
        """Return one value for each train."""
        counts = trains.between(onset_ms, onset_ms + self.window_ms).counts
        return np.asarray(np.minimum(counts / (self.most_hz * 1e-3 * self.window_ms), 1.0))


@dataclass(frozen=True, kw_only=True)
class FirstSpikeLatency(Code):
    """Read a value from how soon after the onset the first spike comes.

    Examples
    --------
    >>> FirstSpikeLatency(window_ms=10.0).decode(SpikeTrains.from_lists([[3.0], [10.5], []], stop=20.0), 3.0)
    array([1.  , 0.25, 0.  ])
    """

    def decode(self, trains: SpikeTrains, onset_ms: float) -> NDArray[np.float64]:
        """Return one value for each train."""
        latency = self._rounded(self._first(trains, onset_ms))
        return np.asarray(np.where(latency < self.window_ms, 1.0 - latency / self.window_ms, 0.0))


@dataclass(frozen=True, kw_only=True)
class RelativeLatency(Code):
    """Read a value from how long after the population's first spike a train's own first spike comes: no reference.

    What is read is relative to the largest value, which reads 1.

    Examples
    --------
    >>> RelativeLatency(window_ms=10.0).decode(SpikeTrains.from_lists([[5.5], [8.0], []], stop=13.0), 0.0)
    array([1.  , 0.75, 0.  ])
    """

    def decode(self, trains: SpikeTrains, onset_ms: float) -> NDArray[np.float64]:
        """Return one value for each train."""
        since = self._since(trains, onset_ms)
        return np.asarray(np.where(since < self.window_ms, 1.0 - since / self.window_ms, 0.0))

    def _since(self, trains: SpikeTrains, onset: float) -> NDArray[np.float64]:
        """Return how long after the population's first spike each train's own comes, ms."""
        first = self._first(trains, onset)
        return self._rounded(first - first.min()) if np.isfinite(first).any() else first


def compare_codes(
    trials: Sequence[SpikeTrains],
    labels: ArrayLike,
    codes: Mapping[str, Code],
    *,
    onsets_ms: ArrayLike | None = None,
    folds: int = 10,
    seed: int = 0,
) -> dict[str, Estimate]:
    """Estimate how many bits about labels each code carries from the same spikes.

    Linear discriminants classify each trial by its decoded values, trained on the other folds; the bits are those of
    the confusion matrix (`taxel.information.estimate`).

    Parameters
    ----------
    trials : sequence of SpikeTrains, equally many trains each
    labels : labels, shape (trials,)
    codes : mapping from name to Code
    onsets_ms : float64, shape (trials,), ms, optional
        The reference signal of each trial; its start where left out.
    folds : int, 2 or more
    seed : int, 0 or more
    """
    onsets = [trial.start for trial in trials] if onsets_ms is None else np.asarray(onsets_ms, np.float64).tolist()
    estimates = {}
    for name, code in codes.items():
        read = np.array([code.decode(trial, onset) for trial, onset in zip(trials, onsets, strict=True)])
        vary = max(1, int(np.count_nonzero(np.ptp(read, axis=0) > 0)))
        nested = nested_predictions([read @ read.T], [vary], labels, count=folds, seed=seed)
        estimates[name] = estimate(labels, nested.responses, seed=seed)
    return estimates


def drop_tasks(p: Parameters, *, apart: int = 100, **shared: Any) -> list[Task]:
    """List one drop a task; the seeds of two kinds of drop lie this far apart, or a multiple of it."""
    shared |= {"listen_ms": max(p["windows_ms"])}
    return [
        Task({**shared, "radius_mm": r, "drop_mm": d}, 10_000 * p["seed"] + apart * (3 * i + j) + k)
        for i, r in enumerate(p["radii_mm"])
        for j, d in enumerate(p["drops_mm"])
        for k in range(p["trials"])
    ]


def kinds_of(rows: Sequence[Row]) -> list[str]:
    """Return the kind of drop of each realisation: which ball, from which height."""
    return [f"{r.params['radius_mm']:g} mm from {r.params['drop_mm']:g} mm" for r in rows]


def drop(radius_mm: float, drop_mm: float, listen_ms: float, seed: int) -> tuple[Frames, float]:
    """Return what the taxels under an impact read above rest, a frame each 192 us, and when the ball touches, us.

    Frames begin before contact, so that afferents have settled.
    """
    random = np.random.default_rng([seed, 232])
    x, y = (32 * 2.67 + random.uniform(-2.67, 2.67, 2)).tolist()
    ball: dict[str, Any] = {"shape": {"sphere": {"radius_mm": radius_mm}}, "x_mm": x, "y_mm": y}
    scene = Scene.draw(seed).body(**ball, motion={"dropped": {"height_mm": drop_mm}})
    acts: list[Act] = [Silence(60.0), scene]
    contact = truth(acts)[0][0].start_us
    events = play(acts, seed=seed).events
    tare = Tare.take(events, stop_us=events.markers[0][0])
    start = int(contact) - 50 * PERIOD_US
    stop = int(contact + 1000.0 * (listen_ms + 2.0))
    frames = tare.off(Frames.from_events(events, PERIOD_US, start, stop))
    middle = 32 - SIDE // 2
    return frames.region(slice(middle, middle + SIDE), slice(middle, middle + SIDE)), contact


def since_contact(trains: SpikeTrains, contact_us: float, listen_ms: float) -> list[list[float]]:
    """Return the times of each train's spikes within so long after contact, ms."""
    since = [times - contact_us * 1e-3 for times in trains]
    return [[round(float(t), 4) for t in times[(times >= 0) & (times < listen_ms)]] for times in since]
