"""The loads of examples on one clock, each computed once, on which plain rules are tried."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.progress import Progress, reporting
from taxel.detect.detector import tare_text
from taxel.detect.examples import Example, frame_ms, name_of, unit_of
from taxel.detect.floors import TOUCH
from taxel.detect.plain_rule import PlainRule
from taxel.detect.scoring import APART_US
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording import Recording
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.wire import FRAME_US

#: The quantities that are changes of a load: each begins where a load begins, ends, or moves.
CHANGES = ("rise", "fall", "moved", "shear_rise", "shear_fall", "local_rise", "local_fall")
#: Quantities that are measured together.
_TOGETHER = (
    ("load_without_largest", "load"),
    ("rise", "fall", "moved"),
    ("shear_rise", "shear_fall"),
    ("local_load", "local_rise", "local_fall"),
)
#: Of an example so many frames at least are read for the levels of counts, if it has them; at most twice as many.
_READ_FRAMES = 5000

#: How long a frame lasts (us; None: as the source says), and the wire's version.
Clock: TypeAlias = tuple[float | None, int]
#: The levels of a count, and how long the sensor must have been touched, as of `PlainRule`.
_How: TypeAlias = tuple[tuple[float, ...], float | None]
#: An example, by its place, and from when to when, us; as `taxel.detect.Part`.
Stretch: TypeAlias = tuple[int, float, float]


class FoundTimes(NamedTuple):
    """Detections of a rule: times and when they were known (us, on one clock, ascending), and the quantity then."""

    t: NDArray[np.int64]
    known: NDArray[np.int64]
    value: NDArray[np.float64]

    def between(self, windows: NDArray[np.int64]) -> Self:
        """Return what was found in windows, which ascend."""
        inside = within(self.t, windows)
        return type(self)(self.t[inside], self.known[inside], self.value[inside])


def within(t: NDArray[np.int64], windows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which times are in windows, which ascend."""
    inside: NDArray[np.bool_] = np.searchsorted(windows.reshape(-1), t, side="right") % 2 == 1
    return inside


def clock_of(example: object, frame_us: float | None = None) -> Clock:
    """Return the clock of an example as `taxel.detect.run` finds it; frames last as given, if they are."""
    source = example[0] if isinstance(example, tuple) and example else None
    if not isinstance(source, Recording):
        return frame_us, 1
    version = 1 if source.registers is None else source.registers.wire_version
    return source.frame_us if frame_us is None else frame_us, version


class EdgeRule(NamedTuple):
    """The numbers of a rule that finds begins and ends of loads, as of `PlainRule`."""

    quantity: str
    level: float
    release: float = 1.0
    quiet_ms: float = 0.0
    date: float | None = None
    levels: tuple[float, ...] = ()
    touched_ms: float | None = None


class Loads:
    """Hold the quantities of (checked) examples, each computed once when it is asked for.

    The examples are one after the other on one clock, so far apart that nothing of one pairs with another. `read`
    returns an example, by its place, with other readings that are measured instead.
    """

    def __init__(
        self,
        examples: Sequence[Example],
        clocks: Sequence[Clock],
        noise_floor: float,
        report: Progress,
        read: Callable[[int], Example] | None = None,
    ) -> None:
        self.noise_floor, self.unit = noise_floor, unit_of(examples)
        self.names = sorted({name for example in examples for name in example.labels})
        self._examples, self._clocks, self._report = examples, clocks, report
        self._read = examples.__getitem__ if read is None else read
        self._labels = [{name: np.sort(times) for name, times in example.labels.items()} for example in examples]
        self.whole_examples: list[Stretch] = [(k, -np.inf, np.inf) for k in range(len(examples))]
        self._shift = [k * APART_US - _first(example) for k, example in enumerate(examples)]
        self.frame_ms = max(frame_ms(example.source) for example in examples)
        self._curves: dict[tuple[str, *_How], list[_core.LoadCurve]] = {}
        self._changes: dict[tuple[str, *_How], list[tuple[NDArray[np.int64], NDArray[np.float64]]]] = {}
        self._ages: dict[float, FoundTimes] = {}

    @property
    def have_rest(self) -> bool:
        """Whether each example has a tare; without one only the load by running range can be computed."""
        return all(example.tare is not None for example in self._examples)

    @property
    def taxels(self) -> int:
        """The number of taxels."""
        return min(example.source.array.taxels for example in self._examples)  # type: ignore[union-attr]

    @property
    def are_channels(self) -> bool:
        """Whether taxels have no known neighbours."""
        return lacks_neighbours(self._examples)

    @property
    def have_axes(self) -> bool:
        """Whether channels are the axes of taxels with three."""
        return all(example.source.array._has_axes for example in self._examples)  # type: ignore[union-attr]

    @property
    def of_touches(self) -> EdgeRule:
        """The rule of touches: two taxels or more are loaded, or a channel."""
        return EdgeRule("area", 1.0 if self.are_channels else TOUCH)

    @property
    def are_frames(self) -> bool:
        """Whether all examples are frames."""
        return all(isinstance(example.source, Frames) for example in self._examples)

    @property
    def labels_of(self) -> frozenset[str]:
        """The quantities whose thresholds labels are."""
        return frozenset(example.labels_of for example in self._examples) - {""}

    def _curves_of(
        self, quantity: str, levels: tuple[float, ...] = (), touched_ms: float | None = None
    ) -> list[_core.LoadCurve]:
        """Return a quantity of each example; `levels` are those of a count."""
        how = levels, touched_ms
        if (quantity, *how) not in self._curves:
            self._report(f"measuring the {quantity.replace('_', ' ')} for plain rules", 0, 0)
            together = next((names for names in _TOGETHER if quantity in names), (quantity,))
            measured = [
                _curves(together, how, self.noise_floor, self._read(k), *clock) for k, clock in enumerate(self._clocks)
            ]
            self._curves |= {
                (name, *how): list(of) for name, of in zip(together, zip(*measured, strict=True), strict=True)
            }
        return self._curves[quantity, *how]

    @cached_property
    def readings(self) -> NDArray[np.float64]:
        """What loaded taxels read above rest: of events each, of frames those of spaced ones."""
        loaded = [np.empty(0)]
        for source, tare in ((example.source, example.tare) for example in self._examples):
            if tare is None or isinstance(source, SpikeTrains):
                continue
            if isinstance(source, Frames):
                every = slice(None, None, 1 + len(source) // _READ_FRAMES)
                above = source.values[every].astype(np.float64) - tare.rest
            else:
                assert isinstance(source, Events)
                above = np.asarray(source.intensity, np.float64) - tare.rest[source.y, source.x]
            loaded.append(above[above > self.noise_floor])
        return np.concatenate(loaded)

    def edges(self, rule: EdgeRule) -> tuple[FoundTimes, FoundTimes]:
        """Return the begins and the ends of loads."""
        numbers = rule.level, rule.release, rule.quiet_ms, rule.date
        sides = zip(
            *(curve.edges(*numbers) for curve in self._curves_of(rule.quantity, rule.levels, rule.touched_ms)),
            strict=True,
        )
        begins, ends = map(self._together, sides)
        return begins, ends

    def ages_ms(self, ages_ms: Iterable[float]) -> list[float]:
        """Return ages at which something else is read than at those before.

        A frame holds until the next one, so of frames those are 0 for the first of a touch, and for each later one
        the middle of the time for which it holds, as stamps are not regular. The longest frame
        of several examples counts.
        """
        if not self.frame_ms:
            return list(ages_ms)
        holds = sorted({int(age / self.frame_ms + 1e-6) for age in ages_ms})
        return [to_ms(round(to_us((k + 0.5) * self.frame_ms))) if k else 0.0 for k in holds]

    def at_age(self, age_ms: float) -> FoundTimes:
        """Return the area at an age of every touch."""
        if age_ms not in self._ages:
            self._ages[age_ms] = self._together([curve.at_age(age_ms) for curve in self._curves_of("area")])
        return self._ages[age_ms]

    def at_end(self) -> FoundTimes:
        """Return how long every touch lasted, ms, when it ended."""
        return self._together([curve.at_end() for curve in self._curves_of("area")])

    def changes(
        self, quantity: str, k: int, levels: tuple[float, ...] = (), touched_ms: float | None = None
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return when a quantity changes in example k, us by its clock, and what it is after that."""
        key = quantity, levels, touched_ms
        if key not in self._changes:
            self._changes[key] = [curve.changes() for curve in self._curves_of(*key)]
        return self._changes[key][k]

    def values(
        self,
        quantity: str,
        parts: Iterable[Stretch],
        levels: tuple[float, ...] = (),
        touched_ms: float | None = None,
    ) -> NDArray[np.float64]:
        """Return what a quantity is after each of its changes in parts of the examples."""
        inside = [np.empty(0)]
        for k, start, stop in parts:
            t, values = self.changes(quantity, k, levels, touched_ms)
            inside.append(values[(t >= start) & (t < stop)])
        return np.concatenate(inside)

    def truth(self, name: str, parts: Sequence[Stretch]) -> NDArray[np.int64]:
        """Return the labels of a name in parts of the examples, us on the one clock."""
        by_example = [self._labels[k].get(name, np.empty(0, np.int64)) + shift for k, shift in enumerate(self._shift)]
        times = np.concatenate(by_example)
        return FoundTimes(times, times, np.zeros(len(times))).between(self.windows(parts)).t

    def spans(self, name: str) -> NDArray[np.int64]:
        """Return begin and end, us on the one clock, of the labels of a name that have an end, shape (labels, 2)."""
        none = np.empty((0, 2), np.int64)
        each = zip(self._examples, self._shift, strict=True)
        return np.concatenate([none, *(example.spans.get(name, none) + shift for example, shift in each)])

    @cached_property
    def loaded_us(self) -> list[float]:
        """The middle of the first touch of each example that is not short, us by its clock; else minus infinity."""
        if not self.have_rest:
            return [-np.inf] * len(self._examples)
        edges, middles = self.edges(self.of_touches), []
        for k, *_ in self.whole_examples:
            here = self.windows([(k, -np.inf, np.inf)])
            begins, ends = (np.sort(self.off(edge.between(here), k).t) for edge in edges)
            whole = begins[begins < ends.max(initial=-(2**62))]
            lasts = ends[np.searchsorted(ends, whole, side="right")] - whole
            long = np.flatnonzero(2 * lasts >= np.median(lasts)) if len(lasts) else lasts
            middles.append(float(whole[long[0]] + lasts[long[0]] / 2) if len(long) else -np.inf)
        return middles

    def inside(self, name: str, away_us: int) -> int:
        """Return how many labels of a name lie within a load, so far from its begin and its end at least."""
        if not self.have_rest:
            return 0
        begins, ends = (np.sort(edge.t) for edge in self.edges(EdgeRule("area", 1.0)))
        times = self.truth(name, self.whole_examples)
        began, ended = (
            np.append(-(2**62), edge)[np.searchsorted(edge, times - away_us, side="right")] for edge in (begins, ends)
        )
        lasts = np.searchsorted(ends, times + away_us) == np.searchsorted(ends, times - away_us, side="right")
        return int(np.count_nonzero((began > ended) & lasts))

    def detected(self, rule: PlainRule | None, label: str, part: Stretch) -> FoundTimes:
        """Return what the rule of a label detects of it in a part of an example, as `taxel.detect.run` finds it."""
        if rule is None:
            return FoundTimes(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))
        label_index = rule._parts["labels"].index(label)
        if isinstance(rule.age_ms, str):
            edges = self.at_end()
        elif rule.age_ms is None:
            numbers = rule.quantity, rule.level, rule.release, rule.quiet_ms, rule.date, rule.levels
            edges = self.edges(EdgeRule(*numbers, rule.touched_ms))[label_index]
            edges = edges._replace(t=edges.t - round(float(to_us(rule.constant_ms))))
        else:
            edges = self.at_age(rule.age_ms)
        found = self.off(edges.between(self.windows([part])), part[0])
        if rule.age_ms is None:
            return found
        is_label = (found.value >= rule.level) == bool(label_index)
        return found._replace(t=found.t[is_label], known=found.known[is_label])

    def windows(self, parts: Iterable[Stretch]) -> NDArray[np.int64]:
        """Return from when to when parts of the examples last on the one clock, us, ascending."""
        half = APART_US // 2

        def edge(k: int, t: float) -> int:
            return k * APART_US + int(np.ceil(np.clip(t + self._shift[k] - k * APART_US, -half, half)))

        return np.array(sorted((edge(k, start), edge(k, stop)) for k, start, stop in parts), np.int64)

    def off(self, found: FoundTimes, k: int) -> FoundTimes:
        """Return what was found by the clock of example k."""
        return found._replace(t=found.t - self._shift[k], known=found.known - self._shift[k])

    def _together(
        self, found: Iterable[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]]
    ) -> FoundTimes:
        t, known, values = zip(*found, strict=True)
        by = np.repeat(self._shift, list(map(len, t)))
        return FoundTimes(np.concatenate(t) + by, np.concatenate(known) + by, np.concatenate(values))


def touches(examples: Sequence[Example], noise_floor: float) -> tuple[Loads, FoundTimes, FoundTimes] | None:
    """Return the loads of (checked) examples, and the begins and the ends of touches; None where one has no rest.

    A touch loads two taxels or more, or a channel above its noise.
    """
    if not examples or any(example.tare is None or isinstance(example.source, SpikeTrains) for example in examples):
        return None
    loads = Loads(examples, [clock_of(example) for example in examples], noise_floor, reporting(None))
    return loads, *loads.edges(loads.of_touches)


def lacks(examples: Sequence[Example]) -> str:
    """Return what keeps loads of examples from being measured; "" where something can be."""
    for k, example in enumerate(examples):
        if isinstance(example.source, SpikeTrains) or (example.tare is None and not isinstance(example.source, Frames)):
            why = f"{name_of(k, example)} has no tare" if len(examples) > 1 else "there is no tare"
            return f"{why} to measure a load from"
    return ""


def lacks_neighbours(examples: Sequence[Example]) -> bool:
    """Whether taxels of an example have no known neighbours, as channels and a single taxel."""
    arrays = [example.source.array for example in examples if not isinstance(example.source, SpikeTrains)]  # type: ignore[union-attr]
    return any(array.taxels < 2 or not array._has_neighbours for array in arrays)


def _first(example: Example) -> int:
    """Return the time of an example's first event or frame, us."""
    source = example.source
    assert not isinstance(source, SpikeTrains)
    t = source.t  # type: ignore[union-attr]
    return int(t[0]) if len(t) else 0


def _curves(
    quantities: Sequence[str],
    levels_and_touched: _How,
    noise_floor: float,
    example: Example,
    frame_us: float | None,
    wire_version: int,
) -> list[_core.LoadCurve]:
    """Return quantities over an example, each a curve."""
    levels, touched_ms = levels_and_touched
    source, tare, how = example.source, tare_text(example.tare), (list(quantities), list(levels), noise_floor)
    if isinstance(source, Frames):
        return _core.LoadCurve.of_frames(*how, source, frame_us, tare, touched_ms)
    period = FRAME_US if frame_us is None else frame_us
    return _core.LoadCurve.of_events(*how, source, period, wire_version, tare, touched_ms)  # type: ignore[arg-type]
