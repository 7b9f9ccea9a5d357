"""Whether the labels of a training are at the times of what the sensor felt, and whether a tare holds a touch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.progress import reporting
from taxel._core import ProblemError
from taxel.detect.alignment import WINDOW_MS
from taxel.detect.examples import Example
from taxel.detect.floors import measured_floor
from taxel.detect.loads import Loads, clock_of, lacks_neighbours
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.tare import Tare

#: The number of loaded taxels of the smallest touch.
TOUCH = 2.0
#: Distances between labels and touches are looked at up to this, ms, and are the same that differ by this.
_FARTHEST_MS, _SAME_MS = 1000.0, 50.0
#: Labels are off where this share of them has the same distance, and so many; of fewer chance may do so. They are not
#: where as many are near.
_SHARE, _LEAST = 0.8, 5
#: Touches that are so many times as many as the labels are at some distance of them by chance.
_MOST_A_LABEL = 4
#: This share of a tare, at its beginning, holds no touch.
_EARLY = 0.25
#: A taxel varies more than its noise at the beginning from so many times that on, and this part of the noise floor.
_TIMES, _OF_FLOOR = 3.0, 6.0


class Off(NamedTuple):
    """By how much labels of one name lie after what was felt, ms; how many lie there, and of how many."""

    ms: float
    alike: int
    labels: int

    def __str__(self) -> str:
        side = "after" if self.ms > 0 else "before"
        return f"{self.alike} of {self.labels} lie {abs(self.ms):.0f} ms {side} what the sensor felt (median)"


def off_by(examples: Sequence[Example], labels: Sequence[str], noise_floor: float) -> dict[str, Off]:
    """Return which labels lie at one distance from what was felt that is too large for them to be aligned.

    What was felt are the begins or the ends of loads on two taxels or more, whichever more labels follow. Loads are
    measured from the beginning of a tare that is of its own recording, as late labels let it end in a touch.

    Parameters
    ----------
    examples : sequence of Example, checked
    labels : sequence of str
    noise_floor : float, in the sensor's unit
        Of a board; that of other sensors is measured.
    """
    sources = [
        example for example in examples if example.tare is not None and not isinstance(example.source, SpikeTrains)
    ]
    if len(sources) < len(examples) or lacks_neighbours(examples):
        return {}
    early = [example if (tare := _early(example)) is None else example._replace(tare=tare) for example in examples]
    floor = measured_floor(early) or noise_floor
    loads = Loads(early, [clock_of(example) for example in early], floor, reporting(None), ("area",))
    felt = [edge.t for edge in loads.edges("area", TOUCH, 1.0, 1)]
    found = {}
    for label in labels:
        times = loads.truth(label, loads.whole_examples)
        steady = [felt_edge for edge in felt for felt_edge in _steady(times, edge)]
        if steady and all(abs(shift.ms) > WINDOW_MS for shift, _ in steady):
            found[label], _ = min(steady, key=lambda found_edge: (-found_edge[0].alike, found_edge[1]))
    return found


def _steady(times: NDArray[np.int64], felt: NDArray[np.int64]) -> Iterator[tuple[Off, float]]:
    """Yield the distances that most labels have from one of these times, each with its spread, ms."""
    least = max(_LEAST, _SHARE * len(times))
    if len(times) < least or len(felt) > _MOST_A_LABEL * len(times):
        return
    far = round(to_us(_FARTHEST_MS))
    reach = np.searchsorted(felt, [times - far, times + far])
    label_index = np.repeat(np.arange(len(times)), reach[1] - reach[0])
    beside = np.concatenate([np.arange(*span) for span in reach.T])
    apart = to_ms(times[label_index] - felt[beside])
    order = np.argsort(apart, kind="stable")
    apart, label_index = apart[order], label_index[order]
    for k, end in enumerate(np.searchsorted(apart, apart + _SAME_MS, side="right")):
        if end - k >= least and (alike := len(np.unique(label_index[k:end]))) >= least:
            yield Off(float(np.median(apart[k:end])), alike, len(times)), float(apart[end - 1] - apart[k])


def unlabelled_us(examples: Sequence[Example], label: str) -> tuple[int, int]:
    """Return how long recordings last further before their first label and behind their last than labels lie apart, us.

    And how long they last. Of an example without the label nothing counts.

    Parameters
    ----------
    examples : sequence of Example, checked
    label : str
    """
    outside = total = 0
    for example in examples:
        times = np.sort(example.labels.get(label, np.empty(0, np.int64)))
        if isinstance(example.source, SpikeTrains):
            first, last = (round(to_us(edge)) for edge in (example.source.start, example.source.stop))
        else:
            t = example.source.t  # type: ignore[union-attr]
            first, last = (int(t[0]), int(t[-1])) if len(t) else (0, 0)
        if len(times):
            apart = int(np.diff(times).max(initial=0))
            outside += max(0, int(times[0]) - first - apart) + max(0, last - int(times[-1]) - apart)
            total += last - first
    return outside, total


def held_by_tare(examples: Sequence[Example], noise_floor: float) -> int:
    """Return how many taxels vary far more in the tare of an example than at its beginning, as a touch is in it.

    Of several examples it is the largest number. A tare that is not of its own recording says nothing: 0.

    Parameters
    ----------
    examples : sequence of Example, checked
    noise_floor : float, in the sensor's unit
        As of `off_by`.
    """
    return max((_held(example, noise_floor) for example in examples), default=0)


def _held(example: Example, noise_floor: float) -> int:
    early = _early(example)
    if early is None or example.tare is None:
        return 0
    floor = measured_floor([example._replace(tare=early)]) or noise_floor
    return int(np.count_nonzero(example.tare.noise > _TIMES * early.noise + floor / _OF_FLOOR))


def _early(example: Example) -> Tare | None:
    """Return the beginning of a tare that is of its own recording; None of another."""
    tare, source = example.tare, example.source
    if tare is None or isinstance(source, SpikeTrains):
        return None
    try:
        tare_again = Tare.take(source, start_us=tare.start_us, stop_us=tare.stop_us)
        early = tare.start_us + round(_EARLY * (tare.stop_us - tare.start_us))
        return (
            Tare.take(source, start_us=tare.start_us, stop_us=early)
            if np.array_equal(tare_again.rest, tare.rest, equal_nan=True)
            else None
        )
    except ProblemError:
        return None
