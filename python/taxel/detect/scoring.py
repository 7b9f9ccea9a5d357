"""Detections against reference events: found, missed, false, and how far off."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import add
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel import _core
from taxel._base.arguments import column, finite_numbers, instance, mapping, numbers, shown
from taxel._base.errors import refused
from taxel._base.messages import counted, escaped, plain, three_digits
from taxel._core import ProblemError
from taxel.detections import Detections
from taxel.labels import Note
from taxel.spikes import to_ms, to_us

#: Distance between recordings that are scored together, us: no detection pairs with an event of another recording.
APART_US = 10**12
#: From which share of the events on missed or false ones are many.
_MANY = 0.05


class Spread(NamedTuple):
    """Mean, standard deviation of the sample, median, 2.5th and 97.5th percentile; NaN where there are too few.

    Attributes
    ----------
    mean, sd, median : float, in the unit of the values
        The standard deviation is that of the sample; NaN where there are too few.
    low, high : float, in the unit of the values
        The 2.5th and 97.5th percentile.
    """

    mean: float
    sd: float
    median: float
    low: float
    high: float

    @classmethod
    def from_values(cls, values: ArrayLike) -> Spread:
        """Return the spread of values.

        Parameters
        ----------
        values : float64, shape (n,), any unit

        Returns
        -------
        Spread

        Raises
        ------
        ProblemError : something other than a sequence of numbers

        Examples
        --------
        >>> Spread.from_values([1.0, 2.0, 3.0, 4.0])
        2.5 ± 1.29 (median 2.5, 95 % in 1.07 to 3.92)
        """
        sample = finite_numbers("values", values)
        if sample.ndim != 1:
            raise refused("values", f" has {sample.ndim} dimensions: must have one")
        spread = cls(**_core.spread(sample))
        # The mean of equal values is rounded, so that they seem to vary by some 1e-17.
        return spread._replace(mean=float(sample[0]), sd=0.0) if len(sample) > 1 and np.ptp(sample) == 0.0 else spread

    def __repr__(self) -> str:
        if np.isnan(self.mean):
            return "none"
        mean, sd, median, low, high = map(three_digits, (self.mean, self.sd, self.median, self.low, self.high))
        spread = "" if np.isnan(self.sd) else f" ± {sd}"
        return f"{mean}{spread} (median {median}, 95 % in {low} to {high})"


@dataclass(frozen=True, eq=False, repr=False)
class Score:
    """Hold how detections and reference events fit together, of one label or of all.

    Attributes
    ----------
    label : str
        "all" where it stands for several labels.
    pairs : int64, shape (found, 2), indices
        Which detection belongs to which reference event, by their places in what was scored.
    missed_events, false_detections : int64, shape (n,), indices
        Places of the reference events without a detection, and of the detections without an event.
    false_near : int, 0 or more
        How many of the false ones are within the window of a reference event: the thesis' false positives (6.5.2).
    errors_ms, delays_ms : float64, shape (found,), ms
        `t` minus reference (negative is early) and `known` minus reference.
    by_label : dict of str to Score
        Empty in the score of one label.
    again : int, 0 or more
        How many further detections are within a label that has an end: they are not false.
    """

    label: str
    pairs: NDArray[np.int64]
    missed_events: NDArray[np.int64]
    false_detections: NDArray[np.int64]
    false_near: int
    errors_ms: NDArray[np.float64]
    delays_ms: NDArray[np.float64]
    by_label: Mapping[str, Score] = field(default_factory=dict)
    again: int = 0

    @property
    def events(self) -> int:
        """How many reference events there are."""
        return len(self.pairs) + len(self.missed_events)

    @property
    def found(self) -> int:
        """How many reference events were detected."""
        return len(self.pairs)

    @property
    def missed(self) -> int:
        """How many reference events have no detection."""
        return len(self.missed_events)

    @property
    def false(self) -> int:
        """How many detections belong to no reference event, however near they are."""
        return len(self.false_detections)

    @property
    def rank(self) -> tuple[int, float]:
        """Missed and false together, then the root mean square of `errors_ms` (ms): the less, the better.

        The error is infinite where nothing was found.
        """
        return self.missed + self.false, float(np.sqrt(np.mean(self.errors_ms**2))) if self.found else np.inf

    @property
    def error(self) -> Spread:
        """Spread of `t` minus reference, ms."""
        return Spread.from_values(self.errors_ms)

    @property
    def delay(self) -> Spread:
        """Spread of `known` minus reference, ms."""
        return Spread.from_values(self.delays_ms)

    def __getitem__(self, label: str) -> Score:
        """Return the score of one label."""
        if label not in self.by_label:
            raise ProblemError(f"no label {label!r}: the labels are {', '.join(self.by_label) or 'none'}")
        return self.by_label[label]

    def to_dict(self) -> dict[str, Any]:
        """Return counts and spreads (ms) as plain values, label by label; what is not known is None."""
        plain: dict[str, Any] = {
            name: getattr(self, name) for name in ("events", "found", "missed", "false", "false_near", "again")
        }
        for name, spread in (("error_ms", self.error), ("known_delay_ms", self.delay)):
            plain[name] = {part: None if np.isnan(value) else value for part, value in spread._asdict().items()}
        if self.by_label:
            plain["by_label"] = {label: part.to_dict() for label, part in self.by_label.items()}
        return plain

    def __repr__(self) -> str:
        rows = [*self.by_label.values()] if len(self.by_label) > 1 else []
        scores = [*rows, self]
        counts = [(score.events, score.found, score.missed, score.false, score.false_near) for score in scores]
        table: list[tuple[str, ...]] = [("", "events", "found", "missed", "false", "near")]
        table += [(escaped(score.label), *map(str, row)) for score, row in zip(scores, counts, strict=True)]
        widths = [max(len(row[k]) for row in table) for k in range(len(table[0]))]
        lines = [
            "  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
            for row in table
        ]
        # Spreads are long: each on a line of its own, within the 80 columns of a terminal.
        for title, spread in (("t - event (ms)", "error"), ("known - event (ms)", "delay")):
            lines += [
                title,
                *(f"{escaped(score.label).ljust(widths[0])}  {getattr(score, spread)!r}" for score in scores),
            ]
        return "\n".join(lines)


class Mistake(NamedTuple):
    """A reference event without a detection, or a detection without an event.

    Attributes
    ----------
    recording : int
        The place of the recording among those that were scored.
    label : str
    t : int, us
    is_missed : bool
        Whether the event was missed; otherwise the detection is false.
    """

    recording: int
    label: str
    t: int
    is_missed: bool


def score(
    found: Detections,
    truth: Mapping[str, ArrayLike] | ArrayLike | Sequence[Note],
    window_ms: float | Mapping[str, float | ArrayLike] | ArrayLike = 50.0,
    spans: Mapping[str, ArrayLike] | None = None,
) -> Score:
    """Score detections against reference events, label by label; those of labels that the truth lacks are left out.

    Pairs are made one to one and in the order of time: as many as the window allows, and of all ways to have so many
    the one with the least sum of distances. Every further detection is false, inside the window too.

    Parameters
    ----------
    found : Detections
    truth : mapping of str to int, us; or int, shape (events,), us; or Detections; or notes
        Times of the reference events by label, or notes with times, as those of a recording. Times alone are of the one
        label that `found` has.
    window_ms : float, ms; or shape (events,), one a reference event; or a mapping of str to either
        How far a detection may be from its event, either way, 0 to 3 600 000; a mapping is by label. 50 as in 6.5.
    spans : mapping of str to int, shape (events, 2), us, optional
        Begin and end of events that last: what is detected again within one is not false.

    Returns
    -------
    Score

    Raises
    ------
    ProblemError : times that are not whole us, a window that is invalid, times alone for several labels

    Notes
    -----
    Thesis 6.5.2. Reading: the thesis counts "additional/missing spikes within 50 ms of a gait event"; spikes farther
    away count as false here as well, and `false_near` is the count of the thesis. Time and memory: O(events +
    pairs within windows).

    Examples
    --------
    >>> found = Detections(["contact"] * 3, [1_200, 90_000, 400_100], [1_500, 90_500, 400_500])
    >>> result = score(found, {"contact": [1_000, 400_000, 800_000]})
    >>> result.found, result.missed, result.false
    (2, 1, 1)
    >>> result.errors_ms
    array([0.2, 0.1])
    """
    instance("found", found, Detections)
    labels, times = _truth(found, truth)
    windows = _windows(labels, window_ms)
    known = {*labels, *(truth if isinstance(truth, Mapping) else ())} or {*found.labels}
    tallies = _core.score(found._parts(), labels, times, windows)
    scores = {}
    for tally in (tally for tally in tallies if tally.label in known):
        pairs, lost = np.column_stack([tally.detected, tally.events]), (tally.missed_events, tally.false_detections)
        scores[tally.label] = Score(tally.label, pairs, *lost, tally.false_near, tally.errors_ms, tally.delays_ms)
    for label, each in spans_of("spans", {} if spans is None else spans).items():
        if label in scores:
            scores[label] = _without_again(scores[label], found.t, times, windows, each)
    no_times, ms = np.empty(0, np.int64), np.empty(0)
    parts = [Score("all", np.empty((0, 2), np.int64), no_times, no_times, 0, ms, ms), *scores.values()]
    names = ("pairs", "missed_events", "false_detections", "errors_ms", "delays_ms")
    together: dict[str, Any] = {name: np.concatenate([getattr(score, name) for score in parts]) for name in names}
    near = sum(score.false_near for score in parts)
    again = sum(score.again for score in parts)
    name = parts[-1].label if len(scores) == 1 else "all"
    return Score(name, false_near=near, by_label=scores, again=again, **together)


def _without_again(
    scored: Score, t: NDArray[np.int64], times: NDArray[np.int64], windows: NDArray[np.int64], spans: NDArray[np.int64]
) -> Score:
    """Return the score of a label without the false detections within events that last, which are counted as again."""
    is_false = ~in_spans(t[scored.false_detections], spans)
    false = scored.false_detections[is_false]
    events = np.concatenate([scored.pairs[:, 1], scored.missed_events])
    near = np.abs(t[false][:, None] - times[events]) <= windows[events]
    again = int(np.count_nonzero(~is_false))
    return replace(scored, false_detections=false, false_near=int(near.any(axis=1).sum()), again=again)


def spans_of(name: str, spans: object) -> dict[str, NDArray[np.int64]]:
    """Return begins and ends by label, each of shape (events, 2), us; refuse anything else."""
    each = {label: numbers(f"{name}[{label!r}]", of, np.int64) for label, of in mapping(name, spans).items()}
    for label, of in each.items():
        if of.size and (of.ndim != 2 or of.shape[1] != 2):
            raise refused(name, f"[{label!r}] has shape {of.shape}: must be (events, 2), begin and end of each")
    return each


def in_spans(t: NDArray[np.int64], spans: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which times are within spans of begin and end, of shape (spans, 2)."""
    begun, ended = (np.searchsorted(np.sort(edge), t, side="right") for edge in spans.reshape(-1, 2).T)
    inside: NDArray[np.bool_] = begun > ended
    return inside


class Tally(NamedTuple):
    """How detections of one label pair with its events: places of both, how many are alone, how far and late, ms."""

    detected: NDArray[np.int64]
    events: NDArray[np.int64]
    wrong: int
    errors_ms: NDArray[np.float64]
    delays_ms: NDArray[np.float64]


def tally(t: NDArray[np.int64], known: NDArray[np.int64], events: NDArray[np.int64], window_us: int) -> Tally | None:
    """Return how detections of one label pair with its events, as `score` pairs them; None without any of both."""
    if not len(t) and not len(events):
        return None
    orders = np.argsort(t, kind="stable"), np.argsort(events, kind="stable")
    pairs = _core.pairs(t[orders[0]], events[orders[1]], window_us)
    detected, met = (order[place] for order, place in zip(orders, pairs, strict=True))
    wrong = len(t) + len(events) - 2 * len(met)
    return Tally(detected, met, wrong, to_ms(t[detected] - events[met]), to_ms(known[detected] - events[met]))


def mistakes_of(
    detections: Sequence[Detections], truths: Sequence[Mapping[str, NDArray[np.int64]]], scores: Sequence[Score]
) -> tuple[Mistake, ...]:
    """Return what the scores of several recordings call missed and false, by recording and time."""
    found: list[Mistake] = []
    for k, (detected, truth, scored) in enumerate(zip(detections, truths, scores, strict=True)):
        _, times = _truth(detected, truth)
        for label, part in (scored.by_label or {scored.label: scored}).items():
            found += [Mistake(k, label, int(t), is_missed=True) for t in times[part.missed_events]]
            found += [Mistake(k, label, int(t), is_missed=False) for t in detected.t[part.false_detections]]
    return tuple(sorted(found, key=lambda mistake: (mistake.recording, mistake.t)))


def score_together(
    detections: Sequence[Detections],
    truths: Sequence[Mapping[str, NDArray[np.int64]]],
    window_ms: float,
    spans: Sequence[Mapping[str, NDArray[np.int64]]] = (),
) -> Score:
    """Score the detections in several recordings as one, with the events of each by the same labels (us)."""
    later = range(0, len(detections) * APART_US, APART_US)
    moved = [
        Detections._of(list(f.label), f.t + by, f.known + by, f.slope) for f, by in zip(detections, later, strict=True)
    ]

    def on_one_clock(each: Sequence[Mapping[str, NDArray[np.int64]]]) -> dict[str, NDArray[np.int64]]:
        return {
            label: np.concatenate([one[label] + by for one, by in zip(each, later, strict=True) if label in one])
            for label in dict.fromkeys(label for one in each for label in one)
        }

    return score(reduce(add, moved), on_one_clock(truths), window_ms, on_one_clock(spans) if spans else None)


def _truth(
    detections: Detections, truth: Mapping[str, ArrayLike] | ArrayLike | Sequence[Note]
) -> tuple[list[str], NDArray[np.int64]]:
    """Return the reference events as labels and times."""
    if isinstance(truth, Detections):
        return truth.label.tolist(), truth.t
    notes = [note for note in truth if isinstance(note, Note)] if isinstance(truth, Sequence) else []
    if notes:
        timed = [(note.text, note.t) for note in notes if note.t is not None]
        return [text for text, _ in timed], np.array([t for _, t in timed], np.int64)
    if isinstance(truth, Mapping):
        wrong = [label for label in truth if not isinstance(label, str)]
        if wrong:
            raise refused("truth", f": the label {shown(wrong[0])} must be a text")
        columns = {label: column(f"truth[{label!r}]", times, np.int64) for label, times in truth.items()}
        labels = [label for label, times in columns.items() for _ in range(len(times))]
        return labels, np.concatenate([*columns.values(), np.empty(0, np.int64)])
    times = column("truth", cast("ArrayLike", truth), np.int64)
    if len(detections.labels) > 1:
        raise refused("truth", f" has no labels, found has {', '.join(detections.labels)}: give times by label")
    return [(detections.labels or ("event",))[0]] * len(times), times


def _windows(labels: Sequence[str], window_ms: Any) -> NDArray[np.int64]:
    """Return the window of each reference event, whole us."""
    windows = np.zeros(len(labels), np.int64)
    if isinstance(window_ms, Mapping):
        for label in dict.fromkeys(labels):
            if label not in window_ms:
                raise refused("window_ms", f": the value for {label!r} is missing")
            of_label = np.array([name == label for name in labels])
            windows[of_label] = _windows([label] * int(of_label.sum()), window_ms[label])
        return windows
    widths = numbers("window_ms", window_ms, np.float64)
    if widths.ndim > 1 or (widths.ndim == 1 and len(widths) != len(labels)):
        raise refused(
            "window_ms",
            f" has shape {widths.shape}: must be one number, or one number for each of {counted(len(labels), 'event')}",
        )
    wrong = ~((widths >= 0) & (widths <= 3_600_000))
    if wrong.any():
        raise refused(
            "window_ms", f" is {plain(np.atleast_1d(widths)[np.atleast_1d(wrong)][0])}: must be from 0 to 3600000"
        )
    windows[:] = np.rint(to_us(widths))
    return windows


def score_rows(named: Iterable[tuple[str, Score | None]]) -> list[str]:
    """Return a table for people with a row for each recording and label: the names of recordings, and their scores."""
    rows: list[tuple[str, ...]] = [("recording", "label", "events", "found", "missed", "false")]
    for name, together in named:
        scores = {} if together is None else together.by_label or {together.label: together}
        for label, score in scores.items():
            rows.append((name, label, *map(str, (score.events, score.found, score.missed, score.false))))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join([*map(str.ljust, row[:2], widths), *map(str.rjust, row[2:], widths[2:])]) for row in rows]


def many_wrong(scored: Score) -> dict[str, int]:
    """Return how many events are missed and false of each label of which more than 5 % are."""
    scores = (scored.by_label or {scored.label: scored}).items()
    return {label: part.rank[0] for label, part in scores if many(max(part.missed, part.false), part.events)}


def many(wrong: int, events: int) -> bool:
    """Whether so many wrong ones of so many events are many: more than 5 %."""
    return wrong > _MANY * events
