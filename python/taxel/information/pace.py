"""How long each part of an analysis is expected to take, so that its progress is in proportion to time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from taxel.information.question import Question

__all__ = ["Pace", "Work"]


class Work:
    """Expected times of the parts of an analysis, ms of one core; other processors differ by a factor.

    The constants were fitted to measurements of 40 to 800 trials, 8 to 4000 taxels and 100 to 200 bins.

    Parameters
    ----------
    question : Question
        With its settings.
    """

    def __init__(self, question: Question) -> None:
        self._question, self._trials = question, len(question.trials)

    def rasters(self, period: int) -> float:
        """Return the time of all trials' rasters at a period (us), and of their inner products."""
        return self._sampling(period) + self._products(period, len(self._question.active))

    def prediction(self, period: int) -> float:
        """Return the time of nested predictions at a period (us)."""
        return self._predicted(len(self._question.smoothings(period)))

    def frames(self, period: int) -> float:
        """Return the time of frames at a period (us)."""
        return self._products(period, len(self._question.active), smoothings=1) + self._predicted(1)

    def taxels(self, kind: str, size: int) -> float:
        """Return the time of one draw of fewer ("random") or larger ("pooled") taxels."""
        at = self._question.taxels_at
        if kind == "random":
            return self._products(at, size) + self.prediction(at)
        pooled = max(1, len(self._question.active) // size**2)
        return self._sampling(at) + self._products(at, pooled) + self.prediction(at)

    def estimate(self) -> float:
        """Return the time of an estimate with its interval."""
        return self._question.draws * (1 + 0.008 * self._trials)

    def controls(self) -> float:
        """Return the time of the controls."""
        finest = self._question.periods[0]
        return 4 * self.estimate() + self.rasters(finest) + 2 * self.prediction(finest)

    def classifier(self, name: str) -> float:
        """Return the time of a further classifier: "neighbours", or neurons."""
        if name == "neighbours":
            return 4 * self._predicted(5)
        return 6e-3 * self._question.events * len(np.unique(self._question.labels)) * self._question.folds

    def all(self, classifiers: list[str], shuffles: int) -> float:
        """Return the time of all."""
        question = self._question
        columns, windows = len(question.columns), len(question.windows)
        settings = [*(("random", n) for n in question.random_taxels), *(("pooled", n) for n in question.pools)]
        draw = sum(self.taxels(*setting) for setting in settings)
        for period in question.periods:
            draw += self.rasters(period) + (windows + columns) * self.prediction(period) + self.frames(period)
        estimates = len(question.periods) * (windows + columns) * self.estimate()
        further = self.controls() + sum(map(self.classifier, classifiers))
        return question.draws * draw + estimates + (shuffles + 1) * self.prediction(question.periods[0]) + further

    def _sampling(self, period: int) -> float:
        taxels = int(np.prod(self._question.trials[0].array.shape))
        return self._trials * (0.17 + 3e-6 * self._question.window_us / period * taxels)

    def _products(self, period: int, taxels: int, *, smoothings: int | None = None) -> float:
        each = 0.02 + 2e-6 * self._trials * taxels + 1e-8 * self._trials**2 * taxels
        matrices = len(self._question.smoothings(period)) if smoothings is None else smoothings
        return matrices * self._question.window_us / period * each

    def _predicted(self, smoothings: int) -> float:
        return smoothings / 5 * (6 + 1.2e-3 * self._trials**2 + 1.4e-6 * self._trials**3)


class Pace:
    """Report what is computed next, and how much of the expected time has passed.

    Parameters
    ----------
    report : function of (what, done, all), optional
        What it raises ends the work.
    """

    def __init__(self, report: Callable[[str, int, int], object] | None) -> None:
        self._report = report
        self._all, self._done, self._running = 0.0, 0.0, 0.0

    def expect(self, ms: float) -> None:
        """Set how much there is to do."""
        self._all = ms

    def begin(self, step: str, ms: float) -> None:
        """Begin a piece of work; the one before is done."""
        self._done += self._running
        self._running = ms
        if self._report is not None:
            self._report(step, round(min(self._done, self._all)), max(1, round(self._all)))
