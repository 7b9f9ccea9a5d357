"""Folds of labelled examples: which parts train and which parts test."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import integer, several, shown, window
from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.detect.examples import Example

__all__ = ["Fold", "Part", "count_of_folds", "folds_of", "inside", "split", "whole"]

#: Into how many folds examples are split at most by default.
_MOST = 5
#: A recording is cut so long before the end of a pause between its events, if that is at least so long, us.
_CUT_US, _LONG_US = 250_000, 1_000_000


class Part(NamedTuple):
    """A whole example, or a stretch of one.

    Attributes
    ----------
    example : int, 0 or more
        Its place among the examples.
    start, stop : float, us
        The part has what happens in ``start <= t < stop``; all of it where they are left out.

    Raises
    ------
    ProblemError : values that are invalid, when `judge` gets it

    Examples
    --------
    >>> Part(0, stop=1000.0)
    Part(example=0, start=-inf, stop=1000.0)
    """

    example: int
    start: float = -np.inf
    stop: float = np.inf


class Fold(NamedTuple):
    """The parts that train and the parts that test.

    Attributes
    ----------
    train, test : sequence of Part

    Raises
    ------
    ProblemError : values that are invalid, when `judge` gets it

    Examples
    --------
    >>> Fold(train=[Part(0), Part(1)], test=[Part(2, 0, 5_000_000)]).test[0].stop
    5000000
    """

    train: Sequence[Part]
    test: Sequence[Part]


def count_of_folds(examples: Sequence[Example]) -> tuple[int, str]:
    """Return into how many folds (checked) examples are split by default; 0 where they cannot be, and why.

    At most five, not more than half the events of the rarest label, of several examples not more than these. Each
    label must be in the training data of every fold.
    """
    counts = {label: 0 for example in examples for label in example.labels}
    for example in examples:
        for label, times in example.labels.items():
            counts[label] += len(times)
    rarest = min(counts, key=lambda label: counts[label])
    parts = whole(examples)
    recordings = len(_group(examples, parts))
    most = min(_MOST, counts[rarest] // 2, *([recordings] if recordings > 1 else []))
    if most < 2:
        return 0, f"{counted(counts[rarest], 'label')} of {rarest}, but two folds need 4"
    for count in range(most, 1, -1):
        lacking = [_lacks(examples, fold.train, counts) for fold in split(examples, parts, count)]
        if not any(lacking):
            return count, ""
    where = "recording" if recordings > 1 else "stretch of the recording"
    return 0, f"all events {next(filter(None, lacking))} are in the same {where}"


def inside(times: NDArray[np.int64], part: Part) -> NDArray[np.int64]:
    """Return the times in a part of an example, us."""
    return times[(times >= part.start) & (times < part.stop)]


def _lacks(examples: Sequence[Example], parts: Sequence[Part], labels: Iterable[str]) -> str | None:
    """Return a label of which no event is in any of these parts, if there is one."""
    nothing = np.empty(0, np.int64)
    for label in labels:
        if not any(len(inside(examples[part.example].labels.get(label, nothing), part)) for part in parts):
            return label
    return None


def whole(examples: Sequence[Example]) -> list[Part]:
    """Return each example as a part."""
    return [Part(n) for n in range(len(examples))]


def folds_of(examples: Sequence[Example], k: int | Sequence[Fold]) -> tuple[Sequence[Fold], str]:
    """Return folds, made or given, and what they hold out."""
    if isinstance(k, Sequence) and not isinstance(k, str):
        return _check_folds(k, len(examples)), f"{len(k)} given folds"
    count = integer("folds", k, 2, 2**31)
    parts = whole(examples)
    recordings = len(_group(examples, parts))
    what = "groups" if any(example.held_with for example in examples) else "recordings"
    if recordings > 1 and count > recordings:
        raise refused("folds", f" is {count}: must be at most {recordings}, the number of {what}")
    how = f"{count} blocks of time of one recording" if recordings == 1 else f"whole {what}, {count} folds"
    return split(examples, parts, count), how


def _group(examples: Sequence[Example], parts: Sequence[Part]) -> list[list[Part]]:
    """Return the parts of each recording, or of all that are held out with it."""
    groups: dict[object, list[Part]] = {}
    for part in parts:
        example = examples[part.example]
        groups.setdefault(example.held_with or example.group or part.example, []).append(part)
    return list(groups.values())


def _check_folds(folds: Sequence[Fold], examples: int) -> list[Fold]:
    """Return folds with the places of examples as whole numbers; refuse those that make no sense."""
    if not len(folds):
        raise refused("folds", " is empty: must be one Fold or more")
    tested: dict[int, list[Part]] = {}
    sound = []
    for n, fold in enumerate(folds):
        if not isinstance(fold, Fold):
            raise ProblemError(f"fold {n} is {shown(fold)}: must be a Fold")
        train, test = (several(f"fold {n}: {name}", getattr(fold, name)) for name in fold._fields)
        if not train or not test:
            raise ProblemError(f"fold {n} is {shown(fold)}: must be a Fold with parts to train on and parts to test")
        train, test = ([_check_part(f"fold {n}", part, examples) for part in parts] for parts in (train, test))
        for part in test:
            if any(part.start < trained.stop and trained.start < part.stop for trained in tested.get(part.example, ())):
                raise ProblemError(f"fold {n}: {shown(part)} is tested twice")
            tested.setdefault(part.example, []).append(part)
        sound.append(Fold(train, test))
    return sound


def _check_part(where: str, part: object, examples: int) -> Part:
    if not isinstance(part, Part) or not 0 <= (example := integer(f"{where}: example", part.example)) < examples:
        raise ProblemError(f"{where}: {shown(part)} is not a Part of {examples} examples")
    start, stop = window("us", part.start, part.stop)
    if not start < stop:
        raise ProblemError(f"{where}: {shown(part)} must start before it stops")
    return Part(example, start, stop)


def split(examples: Sequence[Example], parts: Sequence[Part], count: int) -> list[Fold]:
    """Return folds that test each part once.

    Of several recordings whole ones are tested; of one alone stretches between its events, with about equally many
    each.
    """
    groups = _group(examples, parts)
    if len(groups) == 1:
        (group,) = groups
        events = np.sort(np.concatenate([_only_inside(examples[part.example], part) for part in group]))
        edges = (-np.inf, *_between_events(events, count), np.inf)
        stretches = [[_within(part, *span) for part in group] for span in pairwise(edges)]
        groups = [filled for each in stretches if (filled := [part for part in each if part.start < part.stop])]
    return _deal(groups, count)


def _within(part: Part, start: float, stop: float) -> Part:
    """Return the part between two times; it does not start before it stops where nothing is between them."""
    return Part(part.example, max(part.start, start), min(part.stop, stop))


def _deal(groups: Sequence[Sequence[Part]], count: int) -> list[Fold]:
    """Return folds that test each group of parts once."""
    count = min(count, len(groups))
    return [
        Fold(
            [part for k, group in enumerate(groups) if k % count != n for part in group],
            [part for group in groups[n::count] for part in group],
        )
        for n in range(count)
    ]


def _only_inside(example: Example, part: Part) -> NDArray[np.int64]:
    """Return the times of all events in a part of an example, ascending."""
    return np.sort(inside(np.concatenate([*example.labels.values(), np.empty(0, np.int64)]), part))


def _between_events(times: NDArray[np.int64], count: int) -> Iterator[float]:
    """Yield where a part is cut: in the longest pause near each share of its events, us."""
    reach = max(1, len(times) // (2 * count))
    if len(times) < 2 * count:
        raise refused(
            "folds",
            f" is {count}: must be at most {len(times) // 2}, because each fold of a recording needs two events, and "
            f"there are {len(times)}",
        )
    for n in range(1, count):
        near = np.arange(max(1, n * len(times) // count - reach + 1), min(len(times), n * len(times) // count + reach))
        before, after = max(((times[k - 1], times[k]) for k in near), key=lambda pause: pause[1] - pause[0])
        # A touch that lasts may fill the most of a long pause, and what it is may be known when it ends.
        yield float(after - _CUT_US if after - before >= _LONG_US else (before + after) / 2)
