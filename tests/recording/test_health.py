"""Dead, stuck and noisy taxels are found where a recording can show them, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

import taxel
from taxel._core import ProblemError
from taxel.simulate import Board, Version2
from taxel.wire import Registers


def pressed(seed: int = 2) -> dict[str, np.ndarray]:
    """Return columns of events in which every taxel of a 10 x 10 array is pressed 30 times, each a little otherwise."""
    rng = np.random.default_rng(seed)
    y, x = (grid.ravel() for grid in np.mgrid[:10, :10])
    n = 30
    columns = {
        "t": np.repeat(np.arange(n) * 1000, 100),
        "x": np.tile(x, n),
        "y": np.tile(y, n),
        "p": rng.random(100 * n) < 0.5,
        "intensity": rng.integers(5, 150, 100 * n),
    }
    keep = rng.random(100 * n) < 0.8
    return {name: column[keep] for name, column in columns.items()}


def events(columns: dict[str, np.ndarray]) -> taxel.Events:
    return taxel.Events(**columns, array=taxel.Array(10, 10))


def test_a_sound_array_has_no_bad_taxel() -> None:
    assert taxel.health(events(pressed())).named() == {"dead": [], "stuck": [], "noisy": []}


def test_a_silent_taxel_among_speaking_ones_is_dead() -> None:
    columns = pressed()
    keep = (columns["x"] != 4) | (columns["y"] != 7)
    found = taxel.health(events({name: column[keep] for name, column in columns.items()}))
    assert found.named() == {"dead": [(4, 7)], "stuck": [], "noisy": []}
    assert repr(found) == "Health(100 taxels: 1 dead, 0 stuck, 0 noisy)"


def test_a_place_that_was_never_touched_is_not_dead() -> None:
    columns = pressed()
    keep = columns["x"] < 5
    assert taxel.health(events({name: column[keep] for name, column in columns.items()})).named()["dead"] == []


def test_a_taxel_that_does_not_exist_is_not_dead() -> None:
    columns = pressed()
    keep = (columns["x"] != 4) | (columns["y"] != 7)
    exists = np.ones((10, 10), bool)
    exists[7, 4] = False
    array = taxel.Array(10, 10, exists=exists)
    found = taxel.health(taxel.Events(**{name: column[keep] for name, column in columns.items()}, array=array))
    assert found.named()["dead"] == []


def test_what_a_state_tells_of_a_dead_taxel_does_not_make_it_alive() -> None:
    rng, dead = np.random.default_rng(3), (4, 7)
    board = Board(Registers(wire_version=2), version_2=Version2(states_us=2_000))
    sent = []
    for _ in range(60):
        ticks = rng.integers(40, 100, board.array.taxels).astype(np.uint16)
        ticks[board.array.index(*dead)] = 0
        sent += board.frame(ticks)
    stream = b"".join(len(datagram).to_bytes(2, "little") + datagram for datagram in sent)
    told, counts, _ = taxel.wire_v2.decode(stream, array=board.array)
    of_it = (told.x == dead[0]) & (told.y == dead[1])
    assert told.repaired is not None
    assert counts.repaired == 1
    assert told.repaired[of_it].tolist() == [True]
    assert taxel.health(told).named() == {"dead": [dead], "stuck": [], "noisy": []}


def test_a_taxel_that_shows_one_value_only_is_stuck() -> None:
    columns = pressed()
    columns["intensity"][(columns["x"] == 2) & (columns["y"] == 3)] = 150
    assert taxel.health(events(columns)).named() == {"dead": [], "stuck": [(2, 3)], "noisy": []}


def test_a_taxel_that_speaks_far_more_than_its_neighbours_is_noisy() -> None:
    columns = pressed()
    extra = {"t": np.arange(500) * 50, "x": np.full(500, 8), "y": np.full(500, 1), "p": np.arange(500) % 2 > 0}
    extra["intensity"] = np.arange(500) % 7
    noisy = {name: np.concatenate([columns[name], extra[name]]) for name in columns}
    assert taxel.health(events(noisy)).named() == {"dead": [], "stuck": [], "noisy": [(8, 1)]}


def test_pictures_tell_too() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(10, 2, (50, 10, 10))
    values[:, 7, 4] = 0
    values[:, 2, 3] = 99
    found = taxel.health(taxel.Frames(values, np.arange(50) * 1000))
    assert found.named() == {"dead": [(4, 7)], "stuck": [(3, 2)], "noisy": []}


def test_nothing_recorded_shows_nothing_and_draws() -> None:
    found = taxel.health(taxel.Events([], [], [], [], array=taxel.Array(3, 3)))
    assert found.named() == {"dead": [], "stuck": [], "noisy": []}
    found.plot()
    assert taxel.health(taxel.Frames(np.zeros((0, 3, 3)), [])).named()["dead"] == []


@pytest.mark.parametrize("recorded", [None, 3, "events", [1, 2]])
def test_nonsense_is_refused(recorded: object) -> None:
    with pytest.raises(ProblemError, match="recorded is"):
        taxel.health(recorded)
