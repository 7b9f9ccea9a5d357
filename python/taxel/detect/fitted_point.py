"""One point of a label's neuron, fitted to parts of labelled examples."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.errors import helped
from taxel._base.messages import collected, counted
from taxel._base.progress import Progress
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.array import Array
from taxel.detect.ages import ACTS_AFTER_MS, Ages, ages_of, later_us, silent_windows
from taxel.detect.alignment import WINDOW_MS, Alignment, align
from taxel.detect.examples import Example, name_of
from taxel.detect.folds import Part
from taxel.detect.readout import SILENCE_MS
from taxel.detect.recipe import Recipe, learner_from
from taxel.detect.scoring import tally
from taxel.encode import Encoder
from taxel.learn import ConeR
from taxel.spikes import SpikeTrains, to_ms, to_us


class FittedPoint(NamedTuple):
    """One point of a label's neuron, fitted."""

    learner: ConeR
    point: Mapping[str, Any]
    #: How much later than the event it fires, ms, the encoder's latency apart.
    delay_ms: float
    alignment: Alignment | None
    #: How many events it misses or detects falsely in the training data.
    wrong: int
    caught: list[str]


@dataclass(frozen=True)
class Inputs:
    """The trains that a label's neuron receives in parts of the examples, and its labels there."""

    label: str
    received: Encoder
    trains: Sequence[SpikeTrains]
    #: As given, and when a rule felt them, if it did; us.
    given: Sequence[NDArray[np.int64]]
    by_rule: Sequence[NDArray[np.float64]] | None
    parts: Sequence[Part]
    examples: Sequence[Example]
    array: Array | None
    report: Progress

    @property
    def count(self) -> int:
        """The number of events."""
        return sum(map(len, self.given))

    @property
    def names(self) -> list[str]:
        """What errors call each part's example."""
        return [name_of(part.example, self.examples[part.example]) for part in self.parts]

    def fitted(self, plan: Recipe, point: Mapping[str, Any]) -> FittedPoint:
        """Return a point fitted to them.

        Raises
        ------
        ProblemError : no event, one outside its example, events within the refractory time, nothing felt
        """
        learner, delay_ms = learner_from(self.label, {**plan.learner, **point})
        if not self.count:
            raise ProblemError(f"{self.label}: no example has such an event, so it cannot be learnt")
        self._check_inside()
        neuron, ages = learner._on_grid(), ages_of(self.received, self.array)
        alignment = None
        if plan.align:
            # Ages count from the begin of a touch, which the rule of a kind need not tell.
            by_rule = self.by_rule if ages is None else None
            alignment = align(self.trains, self.label, self.given, by_rule, self.received.latency_ms, ages)
        felt = self.given if alignment is None else [alignment.felt(k) for k in range(len(self.given))]
        for name, times in zip(self.names, felt, strict=True):
            _check_apart(self.label, name, times, neuron.refractory)
        # Where an age of the touch begins then, it is later: a spike at that age acts after its time, or at once where
        # the potential jumps.
        more_ms = ACTS_AFTER_MS if neuron.kernel == "exponential" else neuron.step_ms
        shift_ms = self.received.latency_ms + delay_ms + (0.0 if ages is None else more_ms)
        later = self._later(felt, ages, alignment, delay_ms)
        targets = [to_ms(t + more) + shift_ms for t, more in zip(felt, later, strict=True)]
        shift_ms += to_ms(float(np.median(np.concatenate(later))))
        graded = self.received.kind == "graded"
        lasting = _until(self.trains, targets)
        trains = lasting if graded or alignment is None else _until(distinct(self.trains), targets)
        self._check_felt(trains, targets)
        silent = None
        if ages is not None and neuron.kernel == "exponential":
            silent = [silent_windows(train, ages, t, neuron) for train, t in zip(lasting, targets, strict=True)]
        what, report = f"learning {self.label} from {counted(self.count, 'event')}", self.report
        report(what, 0, 0)
        with collected() as caught:
            try:
                cone = learner.prepare(trains, targets, silence=silent).fit(
                    learner,
                    progress=lambda n, _rows, _objective, gap: report(
                        f"{what}, round {n}: weights at most {gap:.2%} from the best", 0, 0
                    ),
                )
            except ProblemError as error:
                raise ProblemError(f"{self.label}: {error}") from None
        found, wrong = self._marks(cone, plan.run_threshold, shift_ms)
        begins = [_begin_ms(train) for train in self.trains]
        remarks = _remarks(cone, targets, self.names, shift_ms, begins, found, caught)
        if alignment is not None:
            places = np.array([part.example for part in self.parts])
            alignment = replace(alignment, example=places[alignment.example])
        return FittedPoint(
            cone,
            point,
            shift_ms - self.received.latency_ms,
            alignment,
            wrong,
            [f"{self.label}: {remark}" for remark in remarks],
        )

    def _later(
        self,
        felt: Sequence[NDArray[np.int64]],
        ages: Ages | None,
        alignment: Alignment | None,
        delay_ms: float,
    ) -> list[NDArray[np.int64]]:
        """Return how much later than the trained delay after what was felt each target is, us."""
        if ages is not None and alignment is not None and alignment.train == ages.trains[0]:
            return [later_us(train, ages, to_ms(t), delay_ms) for train, t in zip(self.trains, felt, strict=True)]
        return [np.zeros(len(times), np.int64) for times in felt]

    def _marks(self, cone: ConeR, run_threshold: float, shift_ms: float) -> tuple[int, int]:
        """Return how many events of the training data a fitted learner finds, and how many are missed or false."""
        neuron = cone._on_grid()
        neuron.set_params(theta_0=run_threshold * neuron.theta_0)
        found = wrong = 0
        for train, times, part in zip(self.trains, self.given, self.parts, strict=True):
            spikes = neuron.run(cone.weights_, train.lasting(train.stop + SILENCE_MS))
            t = np.rint(to_us(spikes - shift_ms)).astype(np.int64)
            t = t[(t >= part.start) & (t < part.stop)]
            if (pairs := tally(t, t, times, round(to_us(WINDOW_MS)))) is not None:
                found += len(pairs.detected)
                wrong += pairs.wrong
        return found, wrong

    def _check_inside(self) -> None:
        """Refuse labels outside their example."""
        for name, trains, times in zip(self.names, self.trains, map(to_ms, self.given), strict=True):
            outside = times[(times < trains.start) | (times > trains.stop + SILENCE_MS)]
            if len(outside):
                at, start, stop = (ms - _begin_ms(trains) for ms in (outside[0], trains.start, trains.stop))
                raise ProblemError(
                    f"{name}: {self.label} at {at:.3f} ms is outside the trains, {start:.3f} to {stop:.3f} ms"
                )

    def _check_felt(self, trains: Sequence[SpikeTrains], targets: Sequence[NDArray[np.float64]]) -> None:
        """Refuse an example with targets and without any spike up to them."""
        for name, train, times in zip(self.names, trains, targets, strict=True):
            if len(times) and not len(train.times):
                where = name if len(trains) > 1 else "the recording"
                events = counted(len(times), "event")
                error = ProblemError(f"{self.label}: the sensor felt nothing in {where} up to the last of its {events}")
                raise helped(error, "tare", "unfelt")


def distinct(patterns: Sequence[SpikeTrains]) -> list[SpikeTrains]:
    """Return patterns in which, of trains with the same spikes in all of them, only the first has any.

    Weights that equal trains share require all of these to spike at once, as levels do that every touch of the training
    reached in one frame. The first of several levels is the lowest, which weaker touches reach as well.
    """
    spikes = [tuple(pattern[train].tobytes() for pattern in patterns) for train in range(len(patterns[0]))]
    first = {key: train for train, key in reversed(list(enumerate(spikes)))}
    kept = np.zeros(len(spikes), np.bool_)
    kept[list(first.values())] = True

    def alone(trains: SpikeTrains) -> SpikeTrains:
        spikes = np.repeat(kept, trains.counts)
        offsets = np.concatenate([[0], np.cumsum(np.where(kept, trains.counts, 0))])
        return SpikeTrains(trains.times[spikes], offsets, trains.start, trains.stop, None, kind=trains.kind)

    return [alone(pattern) for pattern in patterns]


def _until(trains: Sequence[SpikeTrains], targets: Sequence[NDArray[np.float64]]) -> list[SpikeTrains]:
    """Return trains with an end after the last target, which may come after the last spike."""
    pairs = zip(trains, targets, strict=True)
    return [each.lasting(max(each.stop, *times, each.start)) for each, times in pairs]


def _check_apart(label: str, name: str, times: NDArray[np.int64], refractory_ms: float) -> None:
    """Refuse labels, as they were felt, closer to each other than the neuron can fire."""
    times = np.sort(times)
    for k in np.flatnonzero(np.diff(times) <= to_us(refractory_ms))[:1]:
        before, t = times[k : k + 2].tolist()
        raise ProblemError(
            f"{label}: {name} has a label at {t} us, {t - before} us after the previous label; labels must "
            f"be more than {refractory_ms:g} ms apart, because the neuron fires once in that time: are the times "
            "in us, and is each label listed once?"
        )


def _begin_ms(trains: SpikeTrains) -> float:
    """Return the time that text counts from, ms: the trains' first if they count from 1970, else 0."""
    return to_ms(beginning_us(np.array([round(float(to_us(trains.start)))])))


def _remarks(
    cone: ConeR,
    targets: Sequence[NDArray[np.float64]],
    names: Sequence[str],
    shift_ms: float,
    begins_ms: Sequence[float],
    found: int,
    caught: Sequence[str],
) -> Iterator[str]:
    """Yield the warnings of a fit, which name events and examples; `found`: how many of the events it finds."""
    missed, count = cone.unreachable_, sum(map(len, targets))
    if missed:
        at = [(targets[p][k] - shift_ms - begins_ms[p], f" of {names[p]}" * (len(targets) > 1)) for p, k in missed]
        times_and_names = [f"{ms:.10g} ms{name}" for ms, name in at]
        listed = ", ".join(times_and_names[:3]) + f" and {len(times_and_names) - 3} more" * (len(times_and_names) > 3)
        yield (
            f"{len(missed)} of {counted(count, 'event')} cannot be learnt, because too few input spikes come before "
            f"them ({listed}); the neuron finds {found} of {count}"
        )
    # The learner names unreachable targets, if any, first.
    yield from caught[bool(missed) :]
