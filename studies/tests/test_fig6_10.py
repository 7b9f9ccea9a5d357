"""Figure 6.10: the judgements on dense and sparse weights follow from the curves, whichever way they go."""

from __future__ import annotations

import pytest

from taxel_studies import fig6_10, waves
from taxel_studies.study import Judgement


@pytest.mark.parametrize("sparse_gains", [1.0, -1.0])
def test_the_verdict_is_of_the_levels_asked_about_and_turns_with_the_curves(sparse_gains: float) -> None:
    levels = [0.0, 1.0, 2.0, 3.0]
    dense = [0.0, 1.0, 1.0, 9.0]
    curve = {"levels": levels, "mean": [dense, [d + sparse_gains for d in dense]]}
    summary = fig6_10._compared(82, curve, "ms", True, (0.5, 2.0))
    assert summary.holds is (sparse_gains > 0)
    assert f"1.00 dense (0 : 4), {1 + sparse_gains:.2f} sparse" in summary.ours, "the level of 3 is not asked about"
    assert "do not cross" in summary.ours
    other = fig6_10._compared(83, curve, "ms", False, (0.5, 2.0))
    assert other.holds is (sparse_gains < 0)


def test_a_claim_holds_in_a_reading_of_b_if_it_does_at_every_delta_t() -> None:
    first, second, other = waves.agreed(
        ["sum", "sum, 0.1 tau", "targets"],
        lambda reading: [Judgement(82, "so", True), Judgement(83, reading, reading != "sum")][
            : 1 + (reading != "targets")
        ],
    )
    assert first == Judgement(82, "so", True, "", "B as a sum")
    ours = "delta t 1.5 ms: sum; delta t 1 ms: sum, 0.1 tau"
    assert second == Judgement(83, ours, False, "it does at delta t 1 ms alone", "B as a sum")
    assert other.reading == "B over the number of targets"
