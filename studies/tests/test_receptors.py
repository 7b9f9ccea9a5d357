"""The study of receptors: thresholds against a count of spikes, and the published curve of each type."""

from __future__ import annotations

import pytest

from taxel_studies import receptors


@pytest.mark.parametrize(("kind", "best", "others"), [("SA-1", 5, (0.5, 34)), ("FA-2", 225, (50, 800))])
def test_thresholds_are_least_where_they_are_published_to_be(kind: str, best: float, others: tuple[float, ...]) -> None:
    period = 0.1 if kind == "FA-2" else 0.5
    least = receptors.threshold(kind, best, 60, period)
    assert least is not None
    for other in others:
        beside = receptors.threshold(kind, other, 60, period)
        assert beside is None or beside > 1.2 * least
