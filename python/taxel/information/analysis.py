"""How many bits a sensor gives about labels (thesis chapter 5): by period, number of taxels, time and cost."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import callback, instance, integer, several
from taxel._base.parallel import HERE, Workers
from taxel.encode import ChangeEvents
from taxel.information.answers import Answer, Control, Point, is_above_chance
from taxel.information.estimate import zero_test
from taxel.information.keeping import keeps
from taxel.information.nested import WORTH_THREADS, Matrices, predictions, threads
from taxel.information.question import Question
from taxel.information.sampling import SampledEvents
from taxel.information.trials import LabelledTrial
from taxel.information.wire_rate import kilobits_per_second
from taxel.spikes import to_ms

__all__ = ["answer"]


def answer(
    trials: Sequence[LabelledTrial],
    *,
    encoder: ChangeEvents | None = None,
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
    encoder : ChangeEvents, optional
        Default: of one bit, with the floor of `floor_of`.
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


class _Setting(NamedTuple):
    """A draw of a sampling period, us, with all taxels, or so many at random."""

    draw: int
    period: int
    taxels: int = 0

    def __str__(self) -> str:
        if self.taxels:
            return f"{self.taxels} taxels at random, draw {self.draw + 1}"
        return f"{to_ms(self.period):g} ms, draw {self.draw + 1}"


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
        values = self.encoder is not None and self.encoder.bits > 1
        finest, longest, draws = self.periods[0], self.windows[-1], range(self.draws)
        settings = [_Setting(draw, period) for draw in draws for period in self.periods]
        settings += [_Setting(draw, finest, size) for draw in draws for size in self.random_taxels]
        self._steps = len(settings) + shuffles + 1
        found_at: dict[tuple[int, float, int], dict[int, Any]] = {}
        missing: set[str] = set()
        alone = copy(self)
        alone._progress = None
        self._begin(str(settings[0]))
        for done, (k, found) in enumerate(workers.run(partial(_of_setting, alone, values), settings), 1):
            draw, period, size = settings[k]
            for window, (responses, counts, lacking) in zip(self.windows[-len(found) :], found, strict=True):
                found_at.setdefault((period, window, size), {})[draw] = responses, counts
                missing |= lacking
            if done < len(settings):
                self._begin(str(settings[done]))
        self._begin("intervals")
        keys = [(period, window, 0) for period in self.periods for window in self.windows]
        keys += [(finest, longest, size) for size in self.random_taxels]
        points: dict[tuple[int, float, int], Point] = {}
        for period, window, size in keys:
            of_draws = [found_at[period, window, size][draw] for draw in draws]
            bits = self.estimate([responses for responses, _ in of_draws])
            events, silent, kbps = np.mean([counts for _, counts in of_draws], axis=0).tolist()
            taxels = size or len(self.active)
            points[period, window, size] = Point(to_ms(period), to_ms(window), taxels, bits, events, silent, kbps)
        full = points[finest, longest, 0]
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
        for period in self.periods[1:]:
            point = points[period, longest, 0]
            verdict = keeps(point.found, full.found, groups=self.groups)
            # Where the full setting's bits are not above those of shuffled labels, there is nothing to keep.
            says = verdict.says if is_above_chance(full.found, zero) else "nothing"
            points[period, longest, 0] = replace(point, verdict=replace(verdict, says=says))
        return Answer(
            labels={str(name): int(n) for name, n in zip(*np.unique(self.labels, return_counts=True), strict=True)},
            groups=0 if self.groups is None else len(np.unique(self.groups)),
            encoder=repr(self.encoder),
            full=full,
            points=tuple(point for (_, _, size), point in points.items() if not size),
            taxels=tuple(point for (_, _, size), point in points.items() if size),
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
    question: Question, values: bool, setting: _Setting
) -> list[tuple[Any, tuple[float, float, float], set[str]]]:
    """Return of each window the responses, what is counted, and what is missing, in one draw of a setting.

    Of some taxels the whole window alone counts.
    """
    draw, period, size = setting
    spikes, windows, found = question.spikes(period, draw), question.windows, []
    if size:
        random = np.random.default_rng([question.seed, draw, size, 1])
        spikes = spikes.select(np.sort(random.choice(question.active, size, replace=False)))
        windows = windows[-1:]
    for window, matrices in zip(windows, question.matrices(spikes, windows), strict=True):
        nested, counts = question.nested(matrices, draw), spikes.counts(window)
        missing = {f"fold {fold + 1} has no training trial of {name}" for fold, name in nested.missing}
        rate = kilobits_per_second(spikes, window, values=values)
        found.append((nested.responses, (float(counts.mean()), float(np.mean(counts == 0)), rate), missing))
    return found
