"""The loads of examples on one clock, each computed once, on which plain rules are tried."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.progress import Progress
from taxel.detect.detector import tare_text
from taxel.detect.examples import Example, unit_of
from taxel.detect.scoring import APART_US
from taxel.frames import Frames
from taxel.recording import Recording
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.wire import FRAME_US

#: The peak that noise does not reach.
PEAK = 6.0

#: How long a frame lasts (us; None: as the source says), and the wire's version.
Clock: TypeAlias = tuple[float | None, int]
#: An example, by its place, and from when to when, us; as `taxel.detect.Part`.
Stretch: TypeAlias = tuple[int, float, float]


class FoundTimes(NamedTuple):
    """Detections of a rule: times and when they were known (us, on one clock, ascending), and the quantity then."""

    t: NDArray[np.int64]
    known: NDArray[np.int64]
    value: NDArray[np.float64]

    def between(self, windows: Iterable[tuple[int, int]]) -> Self:
        """Return what was found in windows, which ascend."""
        inside_windows = [np.arange(*np.searchsorted(self.t, window)) for window in windows]
        inside = np.concatenate(inside_windows) if inside_windows else np.empty(0, np.int64)
        return type(self)(self.t[inside], self.known[inside], self.value[inside])


def clock_of(example: object, frame_us: float | None = None) -> Clock:
    """Return the clock of an example as `taxel.detect.run` finds it; frames last as given, if they are."""
    source = example[0] if isinstance(example, tuple) and example else None
    if not isinstance(source, Recording):
        return frame_us, 1
    version = 1 if source.registers is None else source.registers.wire_version
    return source.frame_us if frame_us is None else frame_us, version


class Loads:
    """Hold the quantities of (checked) examples, and what rules found by them.

    The examples are one after the other on one clock, so far apart that nothing of one pairs with another.
    """

    def __init__(
        self,
        examples: Sequence[Example],
        clocks: Sequence[Clock],
        noise_floor: float,
        report: Progress,
        quantities: Sequence[str] | None = None,
    ) -> None:
        self.noise_floor, self.unit = noise_floor, unit_of(examples)
        self.names = sorted({name for example in examples for name in example.labels})
        self._labels = [{name: np.sort(times) for name, times in example.labels.items()} for example in examples]
        self._unlabelled = [frozenset(example.unlabelled) for example in examples]
        self.whole_examples: list[Stretch] = [(k, -np.inf, np.inf) for k in range(len(examples))]
        self._shift = [k * APART_US - _first(example) for k, example in enumerate(examples)]
        self._frame_ms = max(map(frame_ms, examples))
        self._curves: dict[str, list[_core.LoadCurve]] = {}
        self._changes: dict[str, list[tuple[NDArray[np.int64], NDArray[np.float64]]]] = {}
        self._edges: dict[tuple[str, float, float, int], tuple[FoundTimes, FoundTimes]] = {}
        self._ages: dict[float, FoundTimes] = {}
        if quantities is None:
            # Channels have no local load, and their area and total show edges no better than the peak.
            quantities = ("peak",) if lacks_neighbours(examples) else ("area", "total", "local_load", "peak")
            measured = dict.fromkeys(("area", *quantities))  # kinds are decided by the area
        else:
            measured = dict.fromkeys(quantities)
        #: The names of the quantities that rules compare at the edges of loads.
        self.quantities = tuple(quantities)
        for quantity in measured:
            report(f"measuring the {quantity.replace('_', ' ')} for plain rules", 0, 0)
            self._curves[quantity] = [
                _curve(quantity, noise_floor, example, *clock) for example, clock in zip(examples, clocks, strict=True)
            ]

    def edges(self, quantity: str, threshold: float, release: float, frames: int) -> tuple[FoundTimes, FoundTimes]:
        """Return the begins and the ends of loads."""
        point = quantity, threshold, release, frames
        if point not in self._edges:
            sides = zip(*(curve.edges(threshold, release, frames) for curve in self._curves[quantity]), strict=True)
            begins, ends = map(self._together, sides)
            self._edges[point] = begins, ends
        return self._edges[point]

    def ages_ms(self, ages_ms: Iterable[float]) -> list[float]:
        """Return ages at which something else is read than at those before.

        A frame holds until the next one, so of frames those are 0 for the first of a touch, and for each later one
        the middle of the time for which it holds, as stamps are not regular. The longest frame
        of several examples counts.
        """
        if not self._frame_ms:
            return list(ages_ms)
        holds = sorted({int(age / self._frame_ms + 1e-6) for age in ages_ms})
        return [to_ms(round(to_us((k + 0.5) * self._frame_ms))) if k else 0.0 for k in holds]

    def at_age(self, age_ms: float) -> FoundTimes:
        """Return the area at an age of every touch."""
        if age_ms not in self._ages:
            self._ages[age_ms] = self._together([curve.at_age(age_ms) for curve in self._curves["area"]])
        return self._ages[age_ms]

    def at_end(self) -> FoundTimes:
        """Return how long every touch lasted, ms, when it ended."""
        return self._together([curve.at_end() for curve in self._curves["area"]])

    def changes(self, quantity: str, k: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return when a quantity changes in example k, us by its clock, and what it is after that."""
        if quantity not in self._changes:
            self._changes[quantity] = [curve.changes() for curve in self._curves[quantity]]
        return self._changes[quantity][k]

    def largest(self, quantity: str, begins: NDArray[np.int64], ends: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the largest value of a quantity between pairs of times on the one clock, each in one example."""
        values, example = np.zeros(len(begins)), np.rint(begins / APART_US).astype(np.int64)
        for k in np.unique(example).tolist():
            here = example == k
            values[here] = largest(
                *self.changes(quantity, k), *(edge[here] - self._shift[k] for edge in (begins, ends))
            )
        return values

    def values(self, quantity: str, parts: Iterable[Stretch]) -> NDArray[np.float64]:
        """Return what a quantity is after each of its changes in parts of the examples."""
        inside = [np.empty(0)]
        for k, start, stop in parts:
            t, values = self.changes(quantity, k)
            inside.append(values[(t >= start) & (t < stop)])
        return np.concatenate(inside)

    def truth(self, name: str, parts: Sequence[Stretch]) -> NDArray[np.int64]:
        """Return the labels of a name in parts of the examples, us on the one clock."""
        by_example = [self._labels[k].get(name, np.empty(0, np.int64)) + shift for k, shift in enumerate(self._shift)]
        times = np.concatenate(by_example)
        return FoundTimes(times, times, np.zeros(len(times))).between(self.windows(parts)).t

    def labelled(self, names: Iterable[str], parts: Iterable[Stretch]) -> list[Stretch]:
        """Return the parts of which it is known when each of some labels happened."""
        each = frozenset(names)
        return [part for part in parts if not each & self._unlabelled[part[0]]]

    def windows(self, parts: Iterable[Stretch]) -> list[tuple[int, int]]:
        """Return from when to when parts of the examples last on the one clock, us, ascending."""
        half = APART_US // 2

        def edge(k: int, t: float) -> int:
            return k * APART_US + int(np.ceil(np.clip(t + self._shift[k] - k * APART_US, -half, half)))

        return sorted((edge(k, start), edge(k, stop)) for k, start, stop in parts)

    def off(self, found: FoundTimes, k: int) -> FoundTimes:
        """Return what was found by the clock of example k."""
        return found._replace(t=found.t - self._shift[k], known=found.known - self._shift[k])

    def _together(
        self, found: Iterable[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]]
    ) -> FoundTimes:
        t, known, values = zip(*found, strict=True)

        def shifted(times: Iterable[NDArray[np.int64]]) -> NDArray[np.int64]:
            return np.concatenate([t + by for t, by in zip(times, self._shift, strict=True)])

        return FoundTimes(shifted(t), shifted(known), np.concatenate(values))


def largest(
    t: NDArray[np.int64], values: NDArray[np.float64], begin: NDArray[np.int64], end: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Return the largest value, of those that hold from each of some times on, in each touch."""
    if not len(t):
        return np.zeros(len(begin))
    first = np.maximum(np.searchsorted(t, begin, side="right") - 1, 0)
    stop = np.maximum(np.searchsorted(t, end), first + 1)
    return np.array([values[i:k].max() for i, k in zip(first.tolist(), stop.tolist(), strict=True)])


def lacks_neighbours(examples: Sequence[Example]) -> bool:
    """Whether taxels of an example have no known neighbours, as channels and a single taxel."""
    arrays = [example.source.array for example in examples if not isinstance(example.source, SpikeTrains)]  # type: ignore[union-attr]
    return any(array.taxels < 2 or not array._has_neighbours for array in arrays)


def frame_ms(example: Example) -> float:
    """Return the median distance of the frames of a (checked) example, ms; 0 of what has no frames."""
    source = example.source
    return to_ms(float(np.median(np.diff(source.t)))) if isinstance(source, Frames) and len(source) > 1 else 0.0


def _first(example: Example) -> int:
    """Return the time of an example's first event or frame, us."""
    source = example.source
    assert not isinstance(source, SpikeTrains)
    t = source.t  # type: ignore[union-attr]
    return int(t[0]) if len(t) else 0


def _curve(
    quantity: str, noise_floor: float, example: Example, frame_us: float | None, wire_version: int
) -> _core.LoadCurve:
    """Return a quantity over an example."""
    source, tare = example.source, tare_text(example.tare)
    if isinstance(source, Frames):
        return _core.LoadCurve.of_frames(quantity, noise_floor, source._parts(), frame_us, tare)
    period = FRAME_US if frame_us is None else frame_us
    return _core.LoadCurve.of_events(quantity, noise_floor, source._parts(), period, wire_version, tare)  # type: ignore[union-attr]
