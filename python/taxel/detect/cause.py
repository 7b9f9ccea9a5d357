"""One cause of missed and false events: what was measured, and what helps; and the order of several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from taxel._base.arguments import integer, mapping, several, shown, text
from taxel._base.errors import refused

#: The kinds of causes. Where two concern equally many mistakes the earlier comes first: the later may follow from it.
KINDS = (
    "falling_values", "exchanged_sources", "exchanged_names", "other_rate", "shifted_labels", "shifted_training",
    "few_labels", "unlabelled_source", "levels", "overlapping_loads", "standing_load", "foreign_labels", "tare",
    "begun_loaded", "durations", "recipe", "window", "gaps", "unlabelled_time", "label_name", "other_name",
    "unlabelled_loads", "unfelt_labels", "unlike_training", "plain_rule", "indistinct_kinds", "overfitting",
    "many_false", "unknown",
)  # fmt: skip

#: Causes in the data: no other recipe helps.
OF_DATA = (
    "falling_values", "exchanged_sources", "exchanged_names", "other_rate", "shifted_labels", "few_labels",
    "unlabelled_source", "overlapping_loads", "standing_load", "foreign_labels", "tare", "begun_loaded", "gaps",
    "unlabelled_time", "unlabelled_loads",
)  # fmt: skip

#: Causes whose advice no trial has measured, nor does it undo a fault that was found.
_UNTRIED = ("levels", "begun_loaded", "unlabelled_time", "unlike_training", "indistinct_kinds", "overfitting")


@dataclass(frozen=True)
class Cause:
    """Hold one cause of missed and false events: what was measured, and what helps.

    Parameters
    ----------
    kind : str
        One of `taxel.detect.cause.KINDS`; see Notes.
    labels : tuple of str
        The labels that it concerns.
    mistakes : int, 0 or more
        How many missed and false events it concerns, at most.
    measured : str
        What was measured.
    advice : str
        What helps: the option of ``taxel train`` or ``taxel detect`` with its value, where there is one; empty where
        nothing is known to.
    option : str
        That option, as it is typed; empty where none helps.
    arguments : mapping of str to value
        The same in Python: fields of `taxel.tasks.TrainOptions` or `taxel.tasks.DetectOptions`. Those of "changes" are
        added to the others.

    Raises
    ------
    ProblemError : another kind, or a value of another type

    Notes
    -----
    What was measured, by kind, and what helps. ``taxel detect --truth`` finds those with an asterisk.

    - ``falling_values``: values fall when touched. ``falls = true`` in a layout file, or remove it.
    - ``exchanged_sources`` (*): the labels of two sources, as left and right, fit the detections of the other.
    - ``exchanged_names`` (*): the labels of two names, as contact and release, fit the detections of the other.
    - ``other_rate`` (*): labels fit the detections if their times are divided by a number that was measured, as those
      of frames counted at another rate. Other times of labels, or the right rate of the recording.
    - ``shifted_labels`` (*): most labels, or those of a part of the recording, are shifted by the same time, more than
      50 ms (another clock, a video, a key press). ``--shift-ms MS``, and ``--window-ms MS`` for labels by hand.
    - ``shifted_training`` (*): labels agree with the felt loads, but all detections are late or early.
      ``taxel train --shift-ms MS`` for the training.
    - ``few_labels``: fewer than four labels.
    - ``unlabelled_source``: one source (a foot) has half the share found of another. A column ``source`` in the labels.
    - ``levels``: loads reach fewer than two levels, as in another unit. ``--set fit_levels=true``.
    - ``overlapping_loads`` (*): one load holds several labels of a name. A source or region for each load.
    - ``standing_load`` (*): while these labels happen, an object is on the array, or a taxel is stuck. ``--tare``,
      where a trial of it helps.
    - ``foreign_labels``: labels are more than 50 ms from any load, or all at the beginning. Labels of this recording;
      times in us.
    - ``tare``: the tare contains a touch, or untouched taxels read above rest, and another was tried. ``--tare``.
    - ``begun_loaded``: labels are in the first two frames, already loaded. ``zeros_before_s`` in a layout file.
    - ``durations``, ``plain_rule``: a rule makes at most half the mistakes. ``--rule FILE`` writes it, for
      ``taxel detect --readout FILE``.
    - ``recipe``: another recipe, tried on the same folds, makes at most half the mistakes. ``--recipe NAME``.
    - ``window`` (*): detections are within twice the window of missed labels (``--window-ms MS``), or later, as the
      load rises or falls slowly.
    - ``gaps`` (*): missed labels are where frames are missing, false detections at the first frames after a gap.
    - ``unlabelled_time``: a quarter of the time is before or after the labels. Label all events, or ``taxel cut``.
    - ``label_name``: labels of a kind are within touches. Labels where touches begin or end.
    - ``other_name`` (*): false detections are at labels of another name.
    - ``unlabelled_loads`` (*): false detections are in loads as strong as labelled loads (label these too), or inside
      a load, as at a partial release.
    - ``unfelt_labels`` (*): missed labels are more than 50 ms from any load: touches are too weak or too slow.
    - ``unlike_training`` (*): noise, strength or loaded taxels differ from the training. Train with such data too.
    - ``indistinct_kinds``: nothing separates the kinds. Other kinds.
    - ``overfitting``: at most half the mistakes on training data. More labels.
    - ``many_false`` (*): more than twice as many false detections as labels.
    - ``unknown``: no cause found.

    Examples
    --------
    >>> cause = Cause("shifted_labels", ("contact",), 12, "12 of 12 are 203 ms late", "--shift-ms -203")
    >>> str(cause)
    'what may help is --shift-ms -203: 12 of 12 are 203 ms late'
    """

    kind: str
    labels: tuple[str, ...]
    mistakes: int
    measured: str
    advice: str
    option: str = ""
    arguments: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if text("kind", self.kind) not in KINDS:
            raise refused("kind", f" is {shown(self.kind)}: must be one of {', '.join(KINDS)}")
        object.__setattr__(self, "labels", tuple(text("labels", label) for label in several("labels", self.labels)))
        integer("mistakes", self.mistakes, 0)
        for name in ("measured", "advice", "option"):
            text(name, getattr(self, name))
        mapping("arguments", self.arguments)

    def __str__(self) -> str:
        untried = "; this was not tried" * (self.kind in _UNTRIED)
        return f"what may help is {self.advice}: {self.measured}{untried}" if self.advice else self.measured

    def to_dict(self) -> dict[str, Any]:
        """Return the cause as plain values for JSON."""
        return {
            "kind": self.kind,
            "labels": list(self.labels),
            "mistakes": self.mistakes,
            "measured": self.measured,
            "advice": self.advice,
            "option": self.option,
            "arguments": dict(self.arguments),
        }


def by_option(kind: str, label: str, mistakes: int, measured: str, option: str, **arguments: Any) -> Cause:
    """Return a cause against which an option of the training helps."""
    return Cause(kind, (label,), mistakes, measured, option, option, arguments)


def ordered(causes: Sequence[Cause]) -> tuple[Cause, ...]:
    """Return causes with the same advice as one, those of most mistakes first.

    What was measured of each of them follows its labels, unless it is the same of all.
    """
    alike: dict[tuple[str, str], dict[tuple[tuple[str, ...], str], Cause]] = {}
    for cause in causes:
        alike.setdefault((cause.kind, cause.advice), {}).setdefault((cause.labels, cause.measured), cause)
    merged = []
    for group in alike.values():
        first, *_ = group.values()
        labels = tuple(dict.fromkeys(label for cause in group.values() for label in cause.labels))
        mistakes = sum(cause.mistakes for cause in group.values())
        merged.append(replace(first, labels=labels, mistakes=mistakes, measured=_together(list(group.values()))))
    return tuple(sorted(merged, key=lambda cause: (-cause.mistakes, KINDS.index(cause.kind))))


def _together(causes: Sequence[Cause]) -> str:
    """Return what was measured of causes: what is the same of all once, all else behind the labels that it is of."""
    parts = [cause.measured.split("; ") for cause in causes]
    same = [part for part in parts[0] if all(part in each for each in parts)]
    apart: dict[str, tuple[str, ...]] = {}
    for cause, each in zip(causes, parts, strict=True):
        text = "; ".join(part for part in each if part not in same)
        apart[text] = tuple(dict.fromkeys((*apart.get(text, ()), *cause.labels)))
    of_labels = {labels: [text for text in apart if apart[text] == labels] for labels in apart.values()}
    before = next((k for k, part in enumerate(parts[0]) if part not in same), len(same))
    texts = [
        f"{', '.join(labels)}: " * (len(of_labels) > 1) + text
        for labels, each_text in of_labels.items()
        if (text := "; ".join(filter(None, each_text)))
    ]
    return "; ".join([*same[:before], *texts, *same[before:]])
