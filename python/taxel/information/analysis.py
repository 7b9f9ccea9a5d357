"""How many bits a sensor gives about labels (thesis chapter 5): by period, number of taxels, time and cost."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import callback, instance, integer, several
from taxel._base.parallel import HERE, Workers
from taxel.encode import ChangeEvents, Encoder
from taxel.information._threads import threads
from taxel.information.answers import Answer, Control, Point, is_above_chance
from taxel.information.estimate import Estimate, zero_test
from taxel.information.keeping import Keeping, keeps
from taxel.information.nested import WORTH_THREADS, Matrices, predictions
from taxel.information.question import Question
from taxel.information.sampling import SampledEvents
from taxel.information.trials import LabelledTrial
from taxel.information.wire_rate import kilobits_per_second
from taxel.spikes import to_ms

__all__ = ["answer"]


def answer(
    trials: Sequence[LabelledTrial],
    *,
    encoder: Encoder | None = None,
    window_ms: float | None = None,
    windows_ms: Sequence[float] | None = None,
    periods_ms: Sequence[float] | None = None,
    taxels: Sequence[int] | None = None,
    draws: int = 5,
    folds: int = 10,
    shuffles: int = 20,
    seed: int = 0,
    progress: Callable[[str, int, int], object] | None = None,
    workers: Workers = HERE,
) -> Answer:
    """Estimate how many bits the events of labelled trials hold about the labels, by period, time, taxels and cost.

    Parameters
    ----------
    trials : sequence of LabelledTrial
        All of one array.
    encoder : Encoder, optional
        `ChangeEvents` or `FA1`; its period is set. Default: change events of one bit with the floor of `floor_of`.
    window_ms : float, ms, optional
        Longest time after the contact that counts; needed if trials have no end. Default: the length of the shortest
        trial.
    windows_ms, periods_ms : sequence of float, ms, optional
        Default: steps of 1, 2, 5: windows from a fortieth of the longest, periods from the finest that the recordings
        show, or a 500th of the window.
    taxels : sequence of int, optional
        Numbers of taxels that are drawn at random among those that ever send an event, at the finest period. Default:
        10, 30, 100, 300.
    draws : int, 1 or more
        Number of draws of sampling phases and of random taxels; results are means over draws.
    folds : int, 2 or more
    shuffles : int, 1 or more
        Number of shuffles of the labels in the test against zero.
    seed : int, 0 or more
    progress : function of (what, done, all), optional
        Called before each step with its name, the number of steps done and that of all. An exception that it raises
        ends the work.
    workers : Workers, optional
        Who computes the draws of each period; default: this process alone.

    Returns
    -------
    Answer

    Raises
    ------
    ProblemError : as `taxel.information.folds`; a period finer than the recordings; trials of several arrays; no event
        in any trial
    """
    listed = [instance(f"trials[{k}]", trial, LabelledTrial) for k, trial in enumerate(several("trials", trials))]
    if progress is not None:
        callback("progress", progress)
    for name, value, least in (("draws", draws, 1), ("folds", folds, 2), ("shuffles", shuffles, 1), ("seed", seed, 0)):
        integer(name, value, least)
    answering = _Answering(listed, encoder, window_ms, int(draws), int(folds), int(seed))
    answering.set_out(periods_ms, windows_ms, taxels)
    # On small matrices several threads are slower than one, and far slower where other processes compute as well.
    with threads(several=len(listed) >= WORTH_THREADS):
        return answering.answer(int(shuffles), progress, instance("workers", workers, Workers))


class _Answering(Question):
    """Computes the answer to a question, setting by setting."""

    def answer(
        self,
        shuffles: int,
        progress: Callable[[str, int, int], object] | None,
        workers: Workers,
    ) -> Answer:
        """Return the answer for all settings."""
        self._progress, self._done = progress, 0
        self._steps = self.draws * (len(self.periods) + len(self.random_taxels)) + shuffles + 1
        values = isinstance(self.encoder, ChangeEvents) and self.encoder.bits > 1
        responses_at: dict[tuple[int, float], dict[int, Any]] = {}
        about: dict[tuple[int, float], dict[int, tuple[float, float, float]]] = {}
        missing: set[str] = set()
        settings = [(draw, period) for draw in range(self.draws) for period in self.periods]
        alone = copy(self)
        alone._progress = None
        self._begin(_step(*settings[0]))
        for done, (k, found) in enumerate(workers.run(partial(_of_setting, alone, values), settings), 1):
            draw, period = settings[k]
            for window, (responses, counts, lacking) in zip(self.windows, found, strict=True):
                responses_at.setdefault((period, window), {})[draw] = responses
                about.setdefault((period, window), {})[draw] = counts
                missing |= lacking
            if done < len(settings):
                self._begin(_step(*settings[done]))
        self._begin("intervals")
        keys = [(period, window) for period in self.periods for window in self.windows]
        estimates = {key: self.estimate(_in_order(responses_at[key])) for key in keys}
        everything, finest, longest = len(self.active), self.periods[0], self.windows[-1]
        points = []
        for (period, window), bits in estimates.items():
            verdict = None
            if window == longest and period != finest:
                verdict = keeps(bits, estimates[finest, longest], groups=self.groups)
            points.append(_point(period, window, everything, bits, _in_order(about[period, window]), verdict))
        full = next(p for p in points if (p.period_ms, p.window_ms) == (to_ms(finest), to_ms(longest)))
        spikes = self.spikes(finest, 0)
        [matrices] = self.matrices(spikes, [longest])
        zero = zero_test(
            lambda labels: self._shuffled(matrices, labels),
            self.labels,
            full.found.bits,
            groups=self.groups,
            shuffles=shuffles,
            seed=self.seed,
        )
        self._warn(missing)
        taxels = self._by_taxels(values)
        if not is_above_chance(full.found, zero):
            points = [_with_nothing(p) for p in points]
        return Answer(
            labels={str(name): int(n) for name, n in zip(*np.unique(self.labels, return_counts=True), strict=True)},
            groups=0 if self.groups is None else len(np.unique(self.groups)),
            encoder=repr(self.encoder),
            full=full,
            points=tuple(points),
            taxels=taxels,
            control=self._length(spikes),
            zero=zero,
            notes=tuple(self.notes),
            draws=self.draws,
            seed=self.seed,
        )

    def _begin(self, step: str) -> None:
        """Report the step that begins."""
        if self._progress is not None:
            self._progress(step, self._done, self._steps)
        self._done += 1

    def _shuffled(self, matrices: Matrices, labels: Any) -> NDArray[np.generic]:
        self._begin("labels shuffled")
        return predictions(matrices, self.split(labels)).responses

    def _by_taxels(self, values: bool) -> tuple[Point, ...]:
        """Return the points with fewer taxels, at the finest period and to the whole window."""
        period, window = self.periods[0], self.window_us
        responses: dict[int, list[Any]] = {size: [] for size in self.random_taxels}
        about: dict[int, list[Any]] = {size: [] for size in self.random_taxels}
        for draw in range(self.draws):
            all_spikes = self.spikes(period, draw)
            for size in self.random_taxels:
                self._begin(f"{size} taxels at random")
                random = np.random.default_rng([self.seed, draw, size, 1])
                spikes = all_spikes.select(np.sort(random.choice(self.active, size, replace=False)))
                nested = self.nested(self.matrices(spikes, [window])[0], draw)
                responses[size].append(nested.responses)
                about[size].append(_about(spikes, window, values))
        return tuple(
            _point(period, window, size, self.estimate(responses[size]), about[size], None)
            for size in self.random_taxels
        )

    def _length(self, spikes: SampledEvents) -> Control:
        """Return the bits of the time from contact to the trial's end, or to the last event in the window."""
        if self.ended:
            about, length = "from contact to the trial's end", to_ms(spikes.length_us)
        else:
            about, length = "from contact to the last event in the window", np.zeros(len(self.trials))
            np.maximum.at(length, spikes.trial, to_ms(spikes.first_us[spikes.trial] + spikes.bin * spikes.period_us))
        length = np.nan_to_num(length)
        if np.ptp(length) == 0:
            return Control(self.estimate(np.full(len(length), self.labels[0])), about)
        unit = ((length - length.mean()) / length.std())[:, None]
        return Control(self.estimate(self.nested(Matrices([unit @ unit.T], [1])).responses), about)

    def _warn(self, missing: set[str]) -> None:
        self.notes += sorted(missing)[:3]
        if self.groups is None:
            self.notes.append(
                "the trials have no groups: if trials of one person, session or pose resemble each other, this "
                "similarity "
                "counts as information about the label"
            )
        runs = 1 + int(np.count_nonzero(self.labels[1:] != self.labels[:-1]))
        # Recordings with one trial each may be in any order.
        ordered = len({id(trial.source) for trial in self.trials}) < len(self.trials)
        if ordered and runs == len(np.unique(self.labels)) and len(self.labels) > 2 * runs:
            self.notes.append(
                "the trials of each label are recorded together: a drift of the sensor would count as "
                "information about "
                "the label"
            )
        if not self.ended:
            self.notes.append(
                "trials have no stop_us: the length uses the last event in the window instead of the trial's end"
            )


def _of_setting(
    question: Question, values: bool, setting: tuple[int, int]
) -> list[tuple[Any, tuple[float, float, float], set[str]]]:
    """Return of each window the responses, what is counted, and what is missing, in one draw of a period."""
    draw, period = setting
    spikes, found = question.spikes(period, draw), []
    for window, matrices in zip(question.windows, question.matrices(spikes, question.windows), strict=True):
        nested = question.nested(matrices, draw)
        missing = {f"fold {fold + 1} has no training trial of {name}" for fold, name in nested.missing}
        found.append((nested.responses, _about(spikes, window, values), missing))
    return found


def _step(draw: int, period: int) -> str:
    return f"{to_ms(period):g} ms, draw {draw + 1}"


def _in_order(of_draws: dict[int, Any]) -> list[Any]:
    """Return what the draws gave in the order of the draws."""
    return [of_draws[draw] for draw in sorted(of_draws)]


def _about(spikes: SampledEvents, window: float, values: bool) -> tuple[float, float, float]:
    counts = spikes.counts(window)
    return float(counts.mean()), float(np.mean(counts == 0)), kilobits_per_second(spikes, window, values=values)


def _point(
    period: int, window: float, taxels: int, estimated: Estimate, about: list[Any], verdict: Keeping | None
) -> Point:
    events, silent, kbps = np.mean(about, axis=0)
    return Point(to_ms(period), to_ms(window), taxels, estimated, float(events), float(silent), float(kbps), verdict)


def _with_nothing(point: Point) -> Point:
    """Return a point with the verdict "nothing": the full setting's bits are not above those of shuffled labels."""
    return point if point.verdict is None else replace(point, verdict=replace(point.verdict, says="nothing"))
