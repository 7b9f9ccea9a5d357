"""The plain rule that fits labelled recordings best, by trying a grid of them on the loads of each recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.arguments import finite, number, several, text
from taxel._base.progress import Progress, reporting
from taxel.detect.examples import Example, check_examples
from taxel.detect.loads import FoundTimes, Loads, Stretch, clock_of
from taxel.detect.plain_rule import PlainRule
from taxel.spikes import SpikeTrains, to_us

#: Thresholds of the area, taxels.
AREAS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
#: Thresholds of the total: these quantiles of all its values above 0.
QUANTILES = tuple(np.linspace(0.0, 0.95, 20).tolist())
#: Thresholds of the local load, units of noise.
LOCAL_LOADS = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0)
#: Thresholds of the peak, units of noise.
PEAKS = (4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 24.0, 32.0, 48.0)
#: Parts of the threshold below which a load ends.
RELEASES = (0.5, 1.0)
#: How many frames in a row decide.
FRAMES = (1, 2, 5, 10, 20)
#: Ages at which kinds are decided, ms.
AGES_MS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 16.0, 20.0, 30.0, 50.0)


class _RuleFit(NamedTuple):
    """How a rule does: the less, the better."""

    wrong: int
    """Missed and false."""
    delay_ms: float
    """Median distance of `known` from the label of those that were found; infinite without any."""
    error_ms: float
    """Median distance of a detection from its label; infinite without any."""


class _Best(NamedTuple):
    fit: _RuleFit
    rule: PlainRule


def tune(
    examples: Sequence[Example],
    labels: Sequence[str] | None = None,
    *,
    window_ms: float = 50.0,
    noise_floor: float = 3.0,
    progress: Progress | None = None,
) -> dict[str, PlainRule | None]:
    """Return for each label the plain rule with the fewest missed and false detections, and of these the nearest one.

    Nearest at the median of `known`, before the label as after it: what is known earlier responds to something else.

    Tried are all thresholds of the area (`AREAS`), of the total (`QUANTILES` of its values above 0), of the local load
    (`LOCAL_LOADS`) and of the peak (`PEAKS`), with all numbers of frames (`FRAMES`) and releases (`RELEASES`), at the
    onset and at the end of a load; of channels those of the peak alone. Two labels are kinds where exactly two are
    nearer to onsets than to ends, or where there are only two: then thresholds of the area at each of `AGES_MS` are
    tried too, on a logarithmic scale, and thresholds of the duration as touches end, and hold for both where they are
    better for both together. Each frame that holds at one of these ages counts once.

    Parameters
    ----------
    examples : sequence of Example
        A label that an example lacks is not in it. Sources that are spike trains have no load.
    labels : sequence of str, optional
        Those to find rules for; default: all.
    window_ms : float, ms, 0 or more
        Largest distance of a detection from its label.
    noise_floor : float, 0 or more, in the sensor's unit (ticks)
        The board's.
    progress : function of (step, done, all), optional
        Called before each step; of folds with how many are done, else with 0 of 0.

    Returns
    -------
    dict of str to PlainRule or None
        None where no rule is better than to detect nothing, and where examples are spike trains: "no plain rule for
        NAME". Rules have no tare; each has one label, of kinds both.

    Raises
    ------
    ProblemError : examples that are invalid or without a tare

    Notes
    -----
    If rules are equal, the first counts: area before total before local load before peak, low thresholds before high,
    few frames before many. A rule that misses and invents as many as there are labels is no better than none.

    Examples
    --------
    >>> from taxel import Frames, Tare
    >>> frames = Frames([[[v, v], [0.0, 0.0]] for v in (0.0, 0.0, 9.0, 9.0, 9.0, 0.0, 0.0)], range(0, 70_000, 10_000))
    >>> example = Example(frames, {"touch": [20_000], "removal": [50_000]}, Tare.take(frames, stop_us=20_000))
    >>> rules = tune([example], window_ms=5.0)
    >>> rules["touch"], rules["removal"]
    (PlainRule(area >= 1, release 0.5, 1 frame: onset touch), PlainRule(area >= 1, release 0.5, 1 frame: end removal))
    """
    clocks = [clock_of(example) for example in examples] if isinstance(examples, Sequence) else []
    sound = check_examples(examples)
    report = reporting(progress)
    names = (
        sorted({name for example in sound for name in example.labels}) if labels is None else several("labels", labels)
    )
    names = [text("labels", name) for name in names]
    width_ms = finite("window_ms", window_ms, "ms", least=0.0, most=3.6e6)
    floor = number("noise_floor", noise_floor)
    if any(isinstance(example.source, SpikeTrains) for example in sound):
        return dict.fromkeys(names)
    loads = Loads(sound, clocks, floor, report)
    return best_rules(loads, names, loads.whole_examples, width_ms)


def best_rules(
    loads: Loads, names: Sequence[str], parts: Sequence[Stretch], window_ms: float
) -> dict[str, PlainRule | None]:
    """Return for each label the best rule on parts of the examples, as `tune` does on all of them."""
    width_us = round(float(to_us(window_ms)))
    truth = {name: loads.truth(name, parts) for name in names}
    best = _at_edges(loads, parts, truth, width_us)
    onsets = [name for name, (onset, end) in best.items() if onset.fit.error_ms < end.fit.error_ms]
    single = {name: min(pair, key=lambda tuned: tuned.fit[:2]) for name, pair in best.items()}
    kinds = onsets if len(onsets) == 2 else list(names) if len(names) == 2 else []
    if kinds:
        windows = loads.windows(loads.labelled(kinds, parts))
        touches: dict[float | str, FoundTimes] = {
            age: loads.at_age(age).between(windows) for age in loads.ages_ms(AGES_MS)
        }
        # What is known last is tried last.
        touches["end"] = loads.at_end().between(windows)
        found = _for_kinds(touches, kinds, truth, width_us, loads.noise_floor, loads.unit)
        if found is not None and sum(fit.wrong for fit, _ in found) < sum(single[name].fit.wrong for name in kinds):
            single |= dict(zip(kinds, found, strict=True))
    return {name: tuned.rule if tuned.fit.wrong < len(truth[name]) else None for name, tuned in single.items()}


def _points(loads: Loads, parts: Sequence[Stretch]) -> Iterator[tuple[str, float, float, int]]:
    """Yield the grid: quantity, threshold, release, frames; those that delay least first."""
    totals = loads.values("total", parts) if "total" in loads.quantities else np.empty(0)
    totals = totals[totals > 0.0]
    by_total = np.unique(np.quantile(totals, QUANTILES)).tolist() if len(totals) else []
    thresholds = {"area": AREAS, "total": by_total, "local_load": LOCAL_LOADS, "peak": PEAKS}
    for quantity in loads.quantities:
        for threshold, frames, release in product(thresholds[quantity], FRAMES, RELEASES):
            yield quantity, threshold, release, frames


def _at_edges(
    loads: Loads, parts: Sequence[Stretch], truth: Mapping[str, NDArray[np.int64]], width_us: int
) -> dict[str, tuple[_Best, _Best]]:
    """Return for each label the best rule at onsets and the best at ends."""
    worst = _RuleFit(2**62, np.inf, np.inf)
    fits = {name: [worst, worst] for name in truth}
    points: dict[str, list[tuple[str, float, float, int]]] = {name: [("peak", 4.0, 1.0, 1)] * 2 for name in truth}
    windows: dict[tuple[tuple[int, int], ...], list[str]] = {}
    for name in truth:
        windows.setdefault(tuple(loads.windows(loads.labelled([name], parts))), []).append(name)
    for point, (inside, names) in product(_points(loads, parts), windows.items()):
        for edge, edges in enumerate(loads.edges(*point)):
            found = edges.between(inside)
            for name in names:
                true = truth[name]
                fit = _fit(found, true, width_us, fits[name][edge].wrong)
                if fit is not None and fit[:2] < fits[name][edge][:2]:
                    fits[name][edge] = fit
                    points[name][edge] = point

    def rule(name: str, edge: int) -> _Best:
        labels = [name, None] if edge == 0 else [None, name]
        how: dict[str, Any] = {"labels": labels, "noise_floor": loads.noise_floor, "unit": loads.unit}
        return _Best(fits[name][edge], PlainRule(*points[name][edge], **how))

    return {name: (rule(name, 0), rule(name, 1)) for name in truth}


def _fit(found: FoundTimes, true: NDArray[np.int64], width_us: int, most: int = 2**62) -> _RuleFit | None:
    """Return how detections fit labels; None where more are wrong than `most`, which their number alone may show."""
    t, known, _ = found
    if abs(len(t) - len(true)) > most:
        return None
    label = [""] * len(t)
    parts = (label, t, known, np.full(len(t), np.nan), np.zeros(len(t), bool))
    tallies = _core.score(parts, [""] * len(true), true, np.full(len(true), width_us, np.int64))
    if not tallies:
        return _RuleFit(0, np.inf, np.inf)
    tally = tallies[0]
    wrong = len(tally.missed_events) + len(tally.false_detections)
    if not len(tally.delays_ms):
        return _RuleFit(wrong, np.inf, np.inf)
    return _RuleFit(wrong, float(np.median(np.abs(tally.delays_ms))), float(np.median(np.abs(tally.errors_ms))))


def _for_kinds(
    touches: Mapping[float | str, FoundTimes],
    kinds: Sequence[str],
    truth: Mapping[str, NDArray[np.int64]],
    width_us: int,
    floor: float,
    unit: str | None,
) -> list[_Best] | None:
    """Return the best rule that decides between two kinds by the area at an age, or by the duration, once for each.

    None without any.
    """
    times = np.concatenate([truth[name] for name in kinds])
    order = np.argsort(times, kind="stable")
    is_second = (np.arange(len(times)) >= len(truth[kinds[0]]))[order]
    chosen: tuple[tuple[int, float], list[_Best]] | None = None
    for age, (t, known, areas) in touches.items():
        parts = ([""] * len(t), t, known, np.full(len(t), np.nan), np.zeros(len(t), bool))
        tallies = _core.score(parts, [""] * len(times), times[order], np.full(len(times), width_us, np.int64))
        pairs = (tallies[0].detected, tallies[0].events) if tallies else (np.empty(0, np.int64), np.empty(0, np.int64))
        second = is_second[pairs[1]]
        if second.all() or not second.any():
            continue
        threshold, flipped = _between(areas[pairs[0]], second)
        below, above = reversed(kinds) if flipped else kinds
        fits = {}
        for name, is_kind in ((below, areas < threshold), (above, areas >= threshold)):
            fits[name] = _fit(FoundTimes(t[is_kind], known[is_kind], areas[is_kind]), truth[name], width_us)
        quantity = "duration" if age == "end" else "area"
        rule = PlainRule(quantity, threshold, age_ms=age, labels=(below, above), noise_floor=floor, unit=unit)
        best = [_Best(fit, rule) for name in kinds if (fit := fits[name]) is not None]
        rank = (sum(tuned.fit.wrong for tuned in best), max(tuned.fit.delay_ms for tuned in best))
        if chosen is None or rank < chosen[0]:
            chosen = (rank, best)
    return None if chosen is None else chosen[1]


def _between(areas: NDArray[np.float64], second: NDArray[np.bool_]) -> tuple[float, bool]:
    """Return the threshold on log area with the fewest on its wrong side, and whether the second kind is below it.

    If thresholds are equal, the one in the widest gap counts; an area of 0 counts as .5.
    """
    order = np.argsort(areas, kind="stable")
    logs, ones = np.log(np.maximum(areas[order], 0.5)), second[order]
    # By how many values are below: how many of the first kind are wrong above, and of the second below.
    below_first, below_second = (np.concatenate([[0], np.cumsum(mask)]) for mask in (~ones, ones))
    wrong = below_second + below_first[-1] - below_first
    flipped = len(ones) - wrong
    gaps = np.diff(logs)
    sound = np.flatnonzero(gaps > 0.0)
    if not len(sound):
        return float(np.exp(logs[0])), False
    best, flip = min(
        ((int(counts[k + 1]), -float(gaps[k]), float(np.exp((logs[k] + logs[k + 1]) / 2.0))), over)
        for over, counts in ((False, wrong), (True, flipped))
        for k in sound
    )
    return best[2], flip
