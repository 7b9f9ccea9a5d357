"""Estimate how many bits labelled touches hold, by sampling period, time, number of taxels and data rate."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from taxel._base.arguments import checked_path, instance, integer
from taxel._base.errors import helped, refused
from taxel._base.messages import collected, counted
from taxel._base.parallel import HERE, Workers
from taxel._base.progress import Progress, reporting
from taxel._core import ProblemError
from taxel.information import Answer, LabelledTrial, answer, folds, notes_as_trials, read_trials, recordings_as_trials
from taxel.options import InformationOptions
from taxel.recording import Recording
from taxel.recording.opening import sensors_of


@dataclass(frozen=True, eq=False)
class Information:
    """Hold the answer about labelled touches.

    Attributes
    ----------
    answer : taxel.information.Answer
    warned : tuple of str
        The warnings of the task.
    """

    answer: Answer
    warned: tuple[str, ...] = ()

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of the task, and those of the answer."""
        return (*self.warned, *self.answer.warnings)

    def to_dict(self) -> dict[str, Any]:
        """Return the answer as plain values for JSON."""
        return self.answer.to_dict() | {"warnings": list(self.warnings)}


def information(
    recordings: Recording | Sequence[Recording],
    labels: str | os.PathLike[str] | None = None,
    options: InformationOptions | None = None,
    *,
    progress: Progress | None = None,
    workers: Workers = HERE,
) -> Information:
    """Estimate how many bits labelled touches hold.

    ``taxel information`` calls this function.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
    labels : path or "notes", optional
        A table recording,t_us,label[,stop_us][,group] whose rows are trials; or each note of the recordings is a trial
        that begins at its time. Without either each recording is a trial, and its folder's name is the label.
    options : InformationOptions, optional
    progress : function of (step, done, all), optional
    workers : Workers, optional
        Who computes; default: this process alone.

    Raises
    ------
    ProblemError : labels that make no trials, or too few of them; options that do not fit
    FormatError : a file that is not a table
    """
    options = InformationOptions() if options is None else instance("options", options, InformationOptions)
    show = reporting(progress)
    encoder, opened = options._chosen(), sensors_of(recordings)
    labels = None if labels is None else checked_path("labels", labels)
    with collected() as warnings:
        trials = _trials(labels, opened, options.window_ms)
        if labels is None and len({trial.label for trial in trials}) == 1:
            error = ProblemError(
                f"{trials[0].name}: without a table of trials, each recording is a trial, and its label is the name of "
                f"its folder; must be several folders, but there is only {trials[0].label!r}"
            )
            raise helped(error, "labels", "give")
        _check_folds(trials, str(opened[0].path) if labels in (None, "notes") else str(labels), options)
        show(counted(len(trials), "trial"), 0, 0)
        found = answer(
            trials,
            encoder=encoder,
            window_ms=options.window_ms,
            windows_ms=options.windows_ms,
            periods_ms=options.periods_ms,
            taxels=options.taxels,
            draws=options.draws,
            folds=options.folds,
            shuffles=options.shuffles,
            seed=options.seed,
            progress=show,
            workers=workers,
        )
    return Information(found, tuple(warnings))


def _trials(
    labels: str | os.PathLike[str] | None, opened: list[Recording], window_ms: float | None
) -> list[LabelledTrial]:
    if labels is None:
        return recordings_as_trials(opened, window_ms=window_ms)
    if labels != "notes":
        return read_trials(labels, opened, window_ms=window_ms)
    if window_ms is None:
        raise refused("window_ms", ": must say how long the trials are that notes begin, as notes have no end")
    return notes_as_trials(opened, window_ms=window_ms)


def _check_folds(trials: list[LabelledTrial], location: str, options: InformationOptions) -> None:
    """Refuse labels and groups that cannot be split into folds; the error names their table."""
    count, seed = integer("folds", options.folds, 2), integer("seed", options.seed, 0)
    groups = [trial.group for trial in trials]
    try:
        folds([trial.label for trial in trials], count=count, groups=groups if any(groups) else None, seed=seed)
    except ProblemError as error:
        raise ProblemError(f"{location}: {error}") from None
