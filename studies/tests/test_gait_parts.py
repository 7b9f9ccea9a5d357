"""Parts of the gait study: the insole cut, pieces, folds, plain rules."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel import Array, Frames, SpikeTrains
from taxel_studies.datasets import Trial
from taxel_studies.gait import insole, protocols, rules
from taxel_studies.gait.pieces import Piece, joined

# the insole


def footfall(shift: int = 0, late: float = 1.0) -> Trial:
    """A foot 34 sensors long and 14 wide that rolls from heel to toes; `late` scales what comes after mid-stance."""
    rows, columns, t = np.mgrid[0:40, 0:30, 0:60].astype(float)
    inside = (rows >= 2 + shift) & (rows < 36 + shift) & (np.abs(columns - 14) < 7)
    load = 200 * np.exp(-(((rows - shift - 4 - t / 2) / 6) ** 2)) * inside
    load[..., 30:] *= late
    values = np.where(load > 10, load, 0).transpose(2, 0, 1)
    return Trial(
        name="x/1",
        person="x",
        frames=Frames(values, np.arange(60) * 2000, unit="counts", array=Array(40, 30, 5.08)),
        truth={"contact": np.array([0])},
        source="made here",
        about={"row_mm": 7.62, "column_mm": 5.08},
    )


def test_the_insole_has_92_taxels_and_loses_no_load():
    assert insole.TAXELS == 92
    trial = footfall()
    origin, foot = insole.footprint(trial)
    cut = insole.cut(trial, origin, insole.placement([foot]))
    assert cut.values.shape == (60, 1, 92)
    assert np.allclose(cut.total(), trial.frames.total(), rtol=1e-5)
    heel = cut.values[:, 0, insole.HEEL].sum(axis=1)
    toes = cut.values[:, 0, insole.TOES].sum(axis=1)
    assert heel[3] > 0.9 * cut.total()[3]
    assert toes[-3] > 0.9 * cut.total()[-3]


def test_the_cut_moves_with_the_foot():
    near, far = footfall(0), footfall(3)
    (a, foot), (b, other) = insole.footprint(near), insole.footprint(far)
    assert b[1] - a[1] == pytest.approx(3 * 7.62)
    assert other.front_mm == pytest.approx(foot.front_mm)
    size = insole.placement([foot])
    assert np.allclose(insole.cut(near, a, size).values, insole.cut(far, b, size).values)


def test_what_a_footfall_does_later_does_not_move_its_own_taxels():
    other = insole.placement([insole.footprint(footfall())[1]])
    early, changed = footfall(), footfall(late=0.4)
    first = insole.cut(early, insole.footprint(early)[0], other)
    second = insole.cut(changed, insole.footprint(changed)[0], other)
    assert np.array_equal(first.values[:30], second.values[:30])


# pieces


def piece(name: str, on: list[list[float]], off: list[list[float]], truth: list[float], stop: float = 1000.0) -> Piece:
    return Piece(
        name=name,
        unit=name.split("/", maxsplit=1)[0],
        person=name.split("/", maxsplit=1)[0],
        group="patient" if name[0] == "p" else "healthy",
        spikes=SpikeTrains.from_lists([*on, *off], 0.0, stop),
        truth={"contact": np.array(truth)},
        scored=(0.0, stop),
        sums={"total": (np.arange(0.0, stop, 10.0), np.zeros(int(stop) // 10))},
    )


@given(st.lists(st.lists(st.floats(0, 900), max_size=5).map(sorted), min_size=1, max_size=6))
def test_joined_pieces_keep_every_spike_at_its_distance_from_its_event(times):
    pieces = [piece(f"a/{k}", [t], [[]], [500.0]) for k, t in enumerate(times)]
    row = joined(pieces)
    assert row.duration == 1000.0 * len(pieces)
    assert np.allclose(row.truth["contact"], 500.0 + 1000.0 * np.arange(len(pieces)))
    expected = [t + 1000.0 * k for k, train in enumerate(times) for t in train]
    assert np.allclose(row.spikes[0], expected)


def test_a_cut_never_falls_near_an_event():
    whole = piece("a", [[100.0, 480.0, 520.0, 900.0]], [[]], [500.0])
    first, second = whole.between(0.0, 450.0), whole.between(450.0, 1000.0)
    assert first.duration == 600.0
    assert list(first.truth["contact"]) == [500.0]
    assert list(second.truth["contact"]) == []
    assert list(second.spikes[0]) == [300.0]
    assert first.duration + second.duration == whole.duration


# folds


def people(count: int) -> list[Piece]:
    return [piece(f"{'p' if k % 2 else 'h'}{k}/{foot}", [[1.0]], [[]], []) for k in range(count) for foot in (1, 2)]


@given(st.integers(2, 12), st.integers(2, 6))
def test_folds_by_person_part_people_and_spread_patients(count, number):
    pieces = people(count)
    (scope,) = protocols.by_person(pieces, number)
    of = [{pieces[part.example].person for part in group} for group in scope.groups]
    assert sum(len(group) for group in of) == count
    assert set().union(*of) == {p.person for p in pieces}
    patients = [sum(name[0] == "p" for name in group) for group in of]
    assert max(patients) - min(patients) <= 1


def test_footfalls_are_tested_once_a_split():
    pieces = [piece(f"h/{k}", [[1.0]], [[]], []) for k in range(60)]
    (scope,) = protocols.by_footfall(pieces, 3)
    assert [len(g) for g in scope.groups] == [20, 20, 20]
    assert len({part.example for g in scope.groups for part in g}) == 60


def test_folds_by_time_cover_the_recording_without_overlap():
    (scope,) = protocols.by_time([piece("h/1", [[1.0]], [[]], [], stop=4000.0)], 4)
    parts = [part for group in scope.groups for part in group]
    assert parts[0].start == 0.0
    assert parts[-1].stop == 4_000_000.0
    assert all(a.stop == b.start for a, b in pairwise(parts))


# plain rules: two sensors, one level


def walking() -> Piece:
    on = [[100.0, 600.0], [120.0, 610.0]]
    off = [[300.0, 800.0], [350.0, 805.0]]
    return piece("h/1", on, off, [120.0, 610.0])


def counted(count: float, release: float, event: str = "contact") -> list[float]:
    signal = rules.count_of(walking(), np.array([0, 1]))
    return rules.detected(signal, count, release + 1, rising=event == "contact", dead_ms=100.0).tolist()


def test_a_counter_that_remembers_says_when_enough_sensors_are_on():
    assert counted(2, 0) == [120.0, 610.0]
    assert counted(1, 0) == [100.0, 600.0]


def test_a_counter_says_lift_when_enough_sensors_are_off():
    assert counted(2, 0, "foot_off") == [350.0, 805.0]
    assert counted(2, 1, "foot_off") == [300.0, 800.0]


def test_a_sum_has_its_threshold_and_its_release():
    signal = np.arange(0.0, 100.0, 10.0), np.array([0, 6, 9, 12, 9, 12, 4, 0, 20, 0.0])
    assert rules.detected(signal, 10, 5, rising=True, dead_ms=0.0).tolist() == [30.0, 80.0]
    assert rules.detected(signal, 10, 5, rising=False, dead_ms=0.0).tolist() == [60.0, 90.0]
    assert rules.detected(signal, 10, 5, rising=True, dead_ms=60.0).tolist() == [30.0]


def test_every_point_of_a_grid_is_one_that_can_be_said():
    assert [numbers for numbers, *_ in rules.grid("count", 2)] == [
        {"count": 1, "release": 0},
        {"count": 2, "release": 0},
        {"count": 2, "release": 1},
    ]
    for numbers, on, off in rules.grid("labels' own rule", 10.0):
        assert 0 < off <= on <= 2.0
        assert (numbers["threshold"], numbers["release"]) == (on, off)
