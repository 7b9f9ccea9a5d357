"""Detections as a noun, and their score."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import taxel
from taxel.detect import Spread, score
from taxel.labels import Note

TIMES = st.lists(st.integers(-(10**6), 10**6), max_size=12)


def some() -> taxel.Detections:
    return taxel.Detections(["b", "a", "b"], [3000, 1000, 2000], [3400, 1200, 2100], [0.5, 1.5, None])


def brute_force(found: list[int], truth: list[int], window: int) -> tuple[int, int]:
    """The most pairs, and of those ways the least sum of distances, over all pairings whatever."""
    best = {frozenset(): (0, 0)}
    for t in truth:
        after = dict(best)
        for used, (pairs, cost) in best.items():
            for j, f in enumerate(found):
                if j not in used and abs(f - t) <= window:
                    key, value = used | {j}, (pairs + 1, cost - abs(f - t))
                    after[key] = max(after.get(key, (0, -1)), value)
        best = after
    return max(best.values())


@given(st.lists(st.integers(0, 30), max_size=6), st.lists(st.integers(0, 30), max_size=5), st.integers(0, 10))
def test_no_pairing_finds_more_or_lies_nearer(found: list[int], truth: list[int], window: int) -> None:
    result = score(taxel.Detections(["e"] * len(found), found, found), truth, window / 1000)
    distances = -int(np.rint(np.abs(result.errors_ms).sum() * 1000))
    assert (result.found, distances) == brute_force(found, truth, window)


@given(TIMES, TIMES, st.floats(0, 500))
def test_found_missed_and_false_add_up(found: list[int], truth: list[int], window_ms: float) -> None:
    result = score(taxel.Detections(["e"] * len(found), found, [t + 7 for t in found]), {"e": truth}, window_ms)
    assert result.found + result.missed == len(truth) == result.events
    assert result.found + result.false == len(found)
    assert 0 <= result.false_near <= result.false
    assert (np.abs(result.errors_ms) <= window_ms + 0.001).all()
    assert np.allclose(result.delays_ms - result.errors_ms, 0.007)
    for (j, i), error in zip(result.pairs, result.errors_ms, strict=True):
        assert error == (found[j] - truth[i]) / 1000


def test_labels_are_scored_apart() -> None:
    result = score(some(), {"a": [1000], "b": [2000, 3001], "c": [5]}, 0.5)
    assert {label: one.found for label, one in result.by_label.items()} == {"a": 1, "b": 2, "c": 0}
    assert (result["c"].missed, result.missed, result.false) == (1, 1, 0)
    assert result.to_dict()["by_label"]["b"]["error_ms"]["mean"] == pytest.approx(-0.0005)
    assert result.to_dict()["by_label"]["a"]["error_ms"]["sd"] is None
    assert repr(result).splitlines()[-1].startswith("all")
    with pytest.raises(taxel.ProblemError, match="no label 'd': the labels are a, b, c"):
        result["d"]


def test_each_event_may_have_a_window_of_its_own() -> None:
    found = taxel.Detections(["e"] * 2, [20_000, 140_000], [20_000, 140_000])
    assert score(found, [0, 100_000], [10.0, 50.0]).pairs.tolist() == [[1, 1]]
    assert score(found, {"e": [0, 100_000]}, {"e": 50.0}).found == 2


@given(st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=30))
def test_the_spread_is_numpys(values: list[float]) -> None:
    spread = Spread.from_values(values)
    expected = [np.mean(values), np.std(values, ddof=1), np.median(values), *np.percentile(values, [2.5, 97.5])]
    assert np.allclose(spread, expected, rtol=1e-9, atol=1e-6)


def test_detections_come_back_from_csv(tmp_path) -> None:
    found = some()
    with_reported = taxel.Detections(found.label, found.t, found.known, [0.5, 1.5, None], reported=[9, 8, 7])
    for one in (found, with_reported, found[:0]):
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.csv"
        assert one.to_csv(path) == path
        assert taxel.Detections.from_csv(path) == one
    with pytest.raises(FileExistsError):
        found.to_csv(path)
    found.to_csv(path, overwrite=True)
    assert taxel.Detections.from_csv(path) == found
    assert sorted(p.suffix for p in tmp_path.iterdir()) == [".csv"] * 3, "nothing half-written stays"


def test_detections_are_chosen_by_label_time_and_place() -> None:
    found = some()
    assert found.labels == ("a", "b")
    assert found["b"].t.tolist() == [3000, 2000]
    assert found["c"].t.tolist() == []
    assert found[1:].label.tolist() == ["a", "b"]
    assert found[np.array([True, False, True])] == found["b"]
    assert found[[-1]].t.tolist() == [2000]
    assert found.between(1000, 3000).t.tolist() == [1000, 2000]
    assert repr(found) == "Detections(3: a 1, b 2; 1000 to 3000 us)"
    assert repr(found[:0]) == "Detections(none)"
    assert found != found[:2]
    assert found != 5
    for wrong in (None, [9], [True], 1.5, [[1]], object()):
        with pytest.raises(taxel.ProblemError):
            found[wrong]  # type: ignore[index]
    with pytest.raises(IndexError):
        found[9]
    for start, stop in ((5, 1), (None, 1), ("a", "b"), (math.nan, 1)):
        with pytest.raises(taxel.ProblemError, match="start"):
            found.between(start, stop)  # type: ignore[arg-type]


def test_notes_are_a_truth_and_labels_that_it_lacks_are_left_out() -> None:
    """As the command does: nothing is known of when they happened."""
    found = taxel.Detections(["contact", "contact", "lift"], [1000, 500_000, 2000], [1100, 500_100, 2100])
    notes = [Note("contact", 1200), Note("of the whole"), Note("contact", 900_000)]
    by_notes, by_times = score(found, notes), score(found, {"contact": [1200, 900_000]})
    for scored in (by_notes, by_times):
        assert (scored.found, scored.missed, scored.false, list(scored.by_label)) == (1, 1, 1, ["contact"])
    assert score(found, {"contact": [], "lift": []}).false == 3
    assert score(found["contact"], []).false == 2


@given(TIMES, TIMES, st.lists(st.integers(1, 10**5), min_size=12, max_size=12))
def test_what_is_detected_again_within_an_event_that_lasts_is_not_false(found, truth, lasts) -> None:
    detections, events = taxel.Detections(["e"] * len(found), sorted(found), sorted(found)), sorted(truth)
    spans = [[t, t + by] for t, by in zip(events, lasts, strict=False)]
    plain, with_ends = (score(detections, {"e": events}, 20.0, **how) for how in ({}, {"spans": {"e": spans}}))
    false = [t for t in detections.t[plain.false_detections] if not any(a <= t < b for a, b in spans)]
    assert detections.t[with_ends.false_detections].tolist() == false
    assert with_ends.again == plain.false - len(false)
    assert with_ends.false_near == sum(any(abs(t - e) <= 20_000 for e in events) for t in false)
    assert (with_ends.found, with_ends.missed) == (plain.found, plain.missed)
