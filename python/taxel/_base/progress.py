"""The progress of a task: what its callback gets, and about how long all takes."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import TypeAlias

from taxel._base.arguments import callback

#: Called with what is done next, how much of it is done, and all of it (0 if that is not known).
Progress: TypeAlias = Callable[[str, int, int], object]


def reporting(progress: Progress | None) -> Progress:
    """Return a caller's function, which must be one, or for None one that does nothing."""
    return (lambda *_: None) if progress is None else callback("progress", progress)


class Announcement(str):
    """A step that says what is known before the work begins: those who show steps print it as a line."""

    __slots__ = ()


class Steps:
    """Holds the current step of a task, and about how long all of them take by the folds that are done."""

    def __init__(self) -> None:
        self._begun = perf_counter()
        self._step = "starting"
        self._fold: tuple[int, int, float] | None = None
        self._first_fold_s = 0.0

    def update(self, step: str, done: int = 0, total: int = 0) -> None:
        """Take the next step, as `Progress` does."""
        self._step = step
        if total:
            after_s = perf_counter() - self._begun
            self._first_fold_s = after_s if self._fold is None else self._first_fold_s
            self._fold = done + 1, total, after_s

    def __str__(self) -> str:
        """Return the step, how long it is since the beginning, and about how long all take once that is known."""
        after_s, all_s = perf_counter() - self._begun, 0.0
        if self._fold is not None and self._fold[0] > 1:
            number, count, at_s = self._fold
            # The plain rules, or a search on all data, take as long as one more fold.
            all_s = self._first_fold_s + (at_s - self._first_fold_s) / (number - 1) * (count + 1)
        expected = f"; about {all_s:.0f} s in all" if all_s > after_s else ""
        return f"{self._step}, after {after_s:.0f} s{expected}"
