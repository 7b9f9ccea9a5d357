"""Parts of the gait study: the insole cut, pieces, folds, plain rules."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from taxel import SpikeTrains
from taxel_studies.gait import protocols, rules
from taxel_studies.gait.pieces import Piece, joined

# the insole


# pieces


def piece(name: str, on: list[list[float]], off: list[list[float]], truth: list[float], stop: float = 1000.0) -> Piece:
    return Piece(
        name=name,
        person=name.split("/", maxsplit=1)[0],
        group="patient" if name[0] == "p" else "healthy",
        spikes=SpikeTrains.from_lists([*on, *off], 0.0, stop),
        truth={"contact": np.array(truth)},
        scored=(0.0, stop),
        load=(np.arange(0.0, stop, 10.0), np.zeros(int(stop) // 10)),
    )


@given(st.lists(st.lists(st.floats(0, 900), max_size=5).map(sorted), min_size=1, max_size=6))
def test_joined_pieces_keep_every_spike_at_its_distance_from_its_event(times):
    pieces = [piece(f"a/{k}", [t], [[]], [500.0]) for k, t in enumerate(times)]
    row = joined(pieces)
    assert row.duration == 1000.0 * len(pieces)
    assert np.allclose(row.truth["contact"], 500.0 + 1000.0 * np.arange(len(pieces)))
    expected = [t + 1000.0 * k for k, train in enumerate(times) for t in train]
    assert np.allclose(row.spikes[0], expected)


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
