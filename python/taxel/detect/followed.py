"""Which graded quantity follows the labels of one name, and what a neuron that receives it is trained on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.detect.scoring import APART_US, Score, score
from taxel.detections import Detections
from taxel.spikes import SpikeTrains, to_us

#: How far from its label an onset may be, either way, ms.
FOLLOWED_MS = 50.0
#: Thresholds of a quantity: numbers of taxels, or units of noise.
_THRESHOLDS = (1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0)
#: For so many samples in a row a quantity must be at the threshold, or below it.
_SAMPLES = (1, 4, 8, 16)
#: Onsets that are so many times as many as the labels follow other things.
_MOST_A_LABEL = 2
#: How long after a target no silence is required, ms, unless the quantity ends before; at least `_LEAST_MS`.
_AFTER_MS, _LEAST_MS = 60.0, 3.0
#: The same before a target: a quantity that rises slowly is nearly there.
_BEFORE_MS = 5.0
#: Silence is required at so many samples at most; half of them within `_NEAR_MS` of an edge, where it is hardest.
_MOST_SAMPLES, _NEAR_MS = 8000, 60.0


class _Edges(NamedTuple):
    """When a quantity reached its threshold, and when it fell below it, ms."""

    onsets: NDArray[np.float64]
    ends: NDArray[np.float64]


class Followed(NamedTuple):
    """The quantity that follows the labels, and its onsets and ends in each pattern."""

    train: int
    """The place of the quantity among the trains."""
    edges: tuple[_Edges, ...]
    score: Score
    """The score of these onsets against all labels, of one pattern after the other."""


def follow(
    patterns: Sequence[SpikeTrains],
    label: str,
    given: Sequence[NDArray[np.int64]],
    latency_ms: float,
    quantities: Sequence[int],
) -> list[Followed]:
    """Return the quantities whose onsets follow the labels: first the fewest missed and false, then the nearest.

    Onset is the first of some samples in a row at which the quantity is at a threshold, end the first of as many at
    which it is below. Each quantity comes once, with the best of its thresholds and numbers of samples, of equal ones
    the lowest and fewest. Those that find no label are left out. Ends need not be compared: quantities of what is below
    a running mean begin where a load ends.

    Parameters
    ----------
    patterns : sequence of SpikeTrains, graded
        Logarithms of 1 + quantity; the last train has a spike at every sample.
    label : str
    given : sequence of int64, shape (events,), us
        The labels of each pattern, ascending.
    latency_ms : float, ms
    quantities : sequence of int
        The trains that are compared.
    """
    truth = one_after_another(given, patterns)
    best: dict[int, tuple[tuple[int, float], Followed]] = {}
    for train, edges in _every(patterns, quantities):
        if sum(len(edge.onsets) for edge in edges) > _MOST_A_LABEL * len(truth):
            continue
        each = [np.rint(to_us(edge.onsets - latency_ms)).astype(np.int64) for edge in edges]
        fired = one_after_another(each, patterns)
        scored = score(Detections([label] * len(fired), fired, fired), {label: truth}, FOLLOWED_MS)
        rank = scored.missed + scored.false, off_ms(scored)
        if scored.found and (train not in best or rank < best[train][0]):
            best[train] = rank, Followed(train, edges, scored)
    return [follower for _, follower in sorted(best.values(), key=lambda ranked: ranked[0])]


def one_after_another(times: Sequence[NDArray[np.int64]], patterns: Sequence[SpikeTrains]) -> NDArray[np.int64]:
    """Return the times of all patterns, us, so far apart that nothing of one pairs with another."""
    starts = [round(float(to_us(pattern.start))) for pattern in patterns]
    return np.concatenate([t + (k * APART_US - start) for k, (t, start) in enumerate(zip(times, starts, strict=True))])


def off_ms(scored: Score) -> float:
    """Return the median distance of detections from their labels, ms; infinite without any."""
    return float(np.median(np.abs(scored.errors_ms))) if scored.found else np.inf


def _every(patterns: Sequence[SpikeTrains], quantities: Sequence[int]) -> Iterator[tuple[int, tuple[_Edges, ...]]]:
    """Yield all onsets and ends of each quantity, by threshold and number of samples."""
    for train in quantities:
        sampled = [_samples(pattern, train) for pattern in patterns]
        for threshold, count in product(_THRESHOLDS, _SAMPLES):
            yield train, tuple(_edges(clock, values >= np.log1p(threshold), count) for clock, values in sampled)


def _samples(pattern: SpikeTrains, train: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the times of all samples, ms, and a train's value at each."""
    clock = pattern[len(pattern) - 1]
    values = np.zeros(len(clock))
    spikes = slice(*pattern.offsets[train : train + 2])
    assert pattern.values is not None
    # In single precision, as it is: log(1 + 2) must reach the threshold 2.
    values[np.searchsorted(clock, pattern.times[spikes])] = pattern.values[spikes] + 1e-6
    return clock, values


def _edges(clock: NDArray[np.float64], above: NDArray[np.bool_], count: int) -> _Edges:
    """Return when a quantity came to stay at its threshold for some samples, and when below it; below at first."""
    starts = [_runs(above, count), _runs(~above, count)]
    steps = np.concatenate(starts)
    up = np.repeat([True, False], [len(start) for start in starts])
    order = np.argsort(steps, kind="stable")
    steps, up = steps[order], up[order]
    changed = up != np.concatenate([[False], up[:-1]])
    return _Edges(clock[steps[changed & up]], clock[steps[changed & ~up]])


def _runs(true: NDArray[np.bool_], count: int) -> NDArray[np.int64]:
    """Return where runs of at least so many true values begin."""
    steps = np.diff(np.concatenate([[0], true.view(np.int8), [0]]))
    first = np.flatnonzero(steps == 1)
    return first[np.flatnonzero(steps == -1) - first >= count]


def silence(
    followed: Followed,
    patterns: Sequence[SpikeTrains],
    targets: Sequence[NDArray[np.float64]],
    unpaired: Sequence[NDArray[np.float64]],
    delay_ms: float,
    step_ms: float,
) -> list[NDArray[np.float64]]:
    """Return windows, one a sample, in which a neuron must be silent, shape (windows, 2), ms, of each pattern.

    Silence is not required from 5 ms before the onset that a target belongs to until the quantity ends, at most 60 ms
    after the target: the neuron fires once and is armed again when its potential has fallen. Nor around labels
    without a pair. Where there are more samples than 8000, evenly spaced ones stand for all.

    Parameters
    ----------
    followed : Followed
    patterns : sequence of SpikeTrains, graded
    targets, unpaired : sequence of float64, ms
        Of each pattern; labels without a pair.
    delay_ms : float, ms
        From onset to target.
    step_ms : float, ms
        Of the neuron's grid.
    """
    most = max(1, _MOST_SAMPLES // len(patterns))
    windows = []
    for pattern, edges, times, without in zip(patterns, followed.edges, targets, unpaired, strict=True):
        clock = pattern[len(pattern) - 1]
        free = np.ones(len(clock), np.bool_)
        for target in times:
            after = np.append(edges.ends[edges.ends > target], np.inf)[0]
            stop = max(min(target + _AFTER_MS, after), target + _LEAST_MS)
            free[slice(*np.searchsorted(clock, [target - delay_ms - _BEFORE_MS, stop]))] = False
        for t in without:
            free[slice(*np.searchsorted(clock, [t - _BEFORE_MS, t + _AFTER_MS]))] = False
        edge = np.sort(np.concatenate([edges.onsets, edges.ends, [-np.inf, np.inf]]))
        after_edge = np.searchsorted(edge, clock)
        near = np.minimum(clock - edge[np.maximum(after_edge - 1, 0)], edge[after_edge] - clock) < _NEAR_MS
        chosen = np.sort(np.concatenate([_spaced(np.flatnonzero(free & zone), most // 2) for zone in (near, ~near)]))
        # A window of a step holds one point of the grid, whatever the offset between grid and samples.
        windows.append(np.column_stack([clock[chosen], clock[chosen] + 0.99 * step_ms]))
    return windows


def _spaced(indices: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Return at most so many of the places, evenly spaced."""
    if len(indices) <= most:
        return indices
    return indices[np.linspace(0, len(indices) - 1, most).astype(np.int64)]


def only(trains: SpikeTrains, received: Sequence[int]) -> SpikeTrains:
    """Return trains of which only some have spikes."""
    kept = np.zeros(len(trains), np.bool_)
    kept[list(received)] = True
    spikes = np.repeat(kept, trains.counts)
    offsets = np.concatenate([[0], np.cumsum(np.where(kept, trains.counts, 0))])
    values = None if trains.values is None else trains.values[spikes]
    return SpikeTrains(trains.times[spikes], offsets, trains.start, trains.stop, values, kind=trains.kind)


def distinct(patterns: Sequence[SpikeTrains]) -> list[SpikeTrains]:
    """Return patterns in which, of trains with the same spikes in all of them, only the first has any.

    Weights that equal trains share require all of these to spike at once, as levels do that every touch of the training
    reached in one frame. The first of several levels is the
    lowest, which weaker touches reach as well.
    """
    spikes = [tuple(pattern[train].tobytes() for pattern in patterns) for train in range(len(patterns[0]))]
    first = {key: train for train, key in reversed(list(enumerate(spikes)))}
    return [only(pattern, sorted(first.values())) for pattern in patterns]
