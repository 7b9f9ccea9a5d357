"""The study of receptors: thresholds against a count of spikes, and the published curve of each type."""

from __future__ import annotations

import numpy as np
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


@pytest.mark.parametrize("frequency", [20.0, 50.0])
def test_fa2_s_thresholds_fall_by_12_db_an_octave(frequency: float) -> None:
    """Bolanowski et al. 1988, of the channel that it carries."""
    one, two = (receptors.threshold("FA-2", f, 300, 0.1) for f in (frequency, 1.4 * frequency))
    assert one is not None
    assert two is not None
    assert 20 * np.log10(one / two) == pytest.approx(12 * np.log2(1.4), abs=1.5)


def test_a_threshold_is_where_every_cycle_has_a_spike_and_hardly_moves_with_the_period() -> None:
    found = [receptors.threshold("FA-2", 200, 300, period) for period in (0.05, 0.1, 0.2)]
    assert None not in found
    assert max(found) <= 1.06 * min(found)  # type: ignore[type-var,operator]  # None was excluded


def test_each_type_fires_in_its_phases() -> None:
    summary = {
        kind: [receptors.phases(kind, ramp, 0.2) for ramp in (5.0, 200.0)] for kind in receptors.PARAMETERS["kinds"]
    }
    for kind in ("SA-1", "SA-2"):
        assert all(hold > 5 and before == after == 0 for before, _, hold, _, after in summary[kind])
    # FA-1's raised threshold may hold a change back, and let it fire late.
    assert all(min(rise, fall) > 5 and hold <= 1 for _, rise, hold, fall, _ in summary["FA-1"])
    assert min(summary["FA-2"][0][1], summary["FA-2"][0][3]) > 0
    assert summary["FA-2"][0][2] == 0
    assert sum(summary["FA-2"][1]) == 0
