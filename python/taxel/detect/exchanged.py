"""Whether the labels of two sources of a recording, as left and right, are exchanged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from taxel.detect.cause import Cause
from taxel.detect.examples import Outcome
from taxel.detect.scoring import score

#: Labels fit the detections of another source that finds this share of them, of so many or more, ...
_FITS, _LEAST = 0.8, 8
#: ... with at most this share of the mistakes that their own source makes, which finds at most this share of its own.
_FEWER, _OWN = 0.5, 0.5

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
    events = found = left = own_events = own_found = own_left = 0
    labels: dict[str, None] = {}
    for place in places:
        outcome, name, others = scored[place]
        swapped_labels = others.get(partner if name == source else source, {})
        example, before = outcome.example, outcome.score
        assert before is not None
        swapped = {label: swapped_labels.get(label, np.empty(0, np.int64)) for label in example.labels}
        fits = score(example._known(outcome.found), swapped, window_ms)
        events, found, left = events + fits.events, found + fits.found, left + fits.rank[0]
        own_events, own_found, own_left = (
            own_events + before.events,
            own_found + before.found,
            own_left + before.rank[0],
        )
        labels |= dict.fromkeys(label for label, times in example.labels.items() if len(times))
    if events < _LEAST or found < _FITS * events or own_found > _OWN * own_events or left > _FEWER * own_left:
        return None
    names = " and ".join(sorted((source, partner)))
    measured = (
        f"{names} are exchanged, in the labels or in the recording: with the labels exchanged, {found} of {events} "
        "events are found"
    )
    return Cause("exchanged_sources", tuple(labels), own_left, measured, "")
