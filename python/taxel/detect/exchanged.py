"""Whether the labels of two sources of a recording, as left and right, or the names of two labels are exchanged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from taxel.detect.cause import Cause
from taxel.detect.examples import Outcome
from taxel.detect.scoring import Score, score_together

#: Labels fit the detections of another source or name, which find this share of them, of so many or more, ...
_FITS, _LEAST = 0.8, 8
#: ... with at most this share of the mistakes that the labels as they are make, which find at most this share of them.
_FEWER, _OWN = 0.5, 0.5

_NONE = np.empty(0, np.int64)
#: Times by label, us.
_Labels = Mapping[str, Any]


class Scored(NamedTuple):
    """An outcome with a score, the name of its source, and the labels of the recording's other sources by name."""

    outcome: Outcome
    source: str
    others: Mapping[str, _Labels]


def exchanged(scored: Sequence[Scored], window_ms: float) -> Iterator[tuple[Cause, list[int]]]:
    """Yield the pairs of sources of one recording whose labels are exchanged, with the places of their outcomes.

    The labels of a source that was not read are compared too.
    """
    done: set[int] = set()
    for k, (_, source, others) in enumerate(scored):
        for partner in others:
            places = [k, *(j for j, each in enumerate(scored) if j != k and each.source == partner)]
            if not done.intersection(places) and (cause := _exchanged(scored, places, source, partner, window_ms)):
                done.update(places)
                yield cause, places


def _exchanged(
    scored: Sequence[Scored], places: Sequence[int], source: str, partner: str, window_ms: float
) -> Cause | None:
    """Return that the labels of two sources, whose outcomes are at these places, are exchanged; None if not."""
    outcomes = [scored[place].outcome for place in places]
    swapped: list[_Labels] = []
    for place in places:
        outcome, name, others = scored[place]
        of_other = others.get(partner if name == source else source, {})
        swapped.append({label: of_other.get(label, _NONE) for label in outcome.example.labels})
    fit = _fitting(outcomes, swapped, [outcome.example.labels for outcome in outcomes], window_ms)
    if fit is None:
        return None
    with_swapped, given = fit
    names = " and ".join(sorted((source, partner)))
    measured = (
        f"{names} are exchanged, in the labels or in the recording: with the labels exchanged, "
        f"{with_swapped.found} of {with_swapped.events} events are found"
    )
    labels = [label for label, part in given.by_label.items() if part.events]
    return Cause("exchanged_sources", tuple(labels), given.rank[0], measured, "")


def exchanged_names(outcomes: Sequence[Outcome], window_ms: float) -> Iterator[Cause]:
    """Yield the pairs of labels whose names are exchanged, in the labels or in those of the training."""
    names = sorted({label for outcome in outcomes for label in outcome.example.labels})
    for pair in combinations(names, 2):
        given = [{name: outcome.example.labels.get(name, _NONE) for name in pair} for outcome in outcomes]
        swapped = [dict(zip(pair, reversed(labels.values()), strict=True)) for labels in given]
        fit = _fitting(outcomes, swapped, given, window_ms)
        # Where labels have one of both names only, another fault may bring them to detections of the other.
        if fit is None or any(2 * part.found <= part.events for part in fit[0].by_label.values()):
            continue
        measured = (
            f"the names {' and '.join(pair)} are exchanged, in these labels or in those of the training: with the "
            f"names exchanged, {fit[0].found} of {fit[0].events} labels are found"
        )
        yield Cause("exchanged_names", pair, fit[1].rank[0], measured, "")


def _fitting(
    outcomes: Sequence[Outcome], swapped: Sequence[_Labels], given: Sequence[_Labels], window_ms: float
) -> tuple[Score, Score] | None:
    """Return the scores of swapped labels, which fit, and of the given ones, which do not; else None."""
    detections = []
    for outcome, labels in zip(outcomes, given, strict=True):
        known = outcome.example._known(outcome.found)
        detections.append(known[np.isin(known.label, list(labels))])
    fits, before = (score_together(detections, labels, window_ms) for labels in (swapped, given))
    is_fit = fits.events >= _LEAST and fits.found >= _FITS * fits.events and before.found <= _OWN * before.events
    return (fits, before) if is_fit and fits.rank[0] <= _FEWER * before.rank[0] else None
