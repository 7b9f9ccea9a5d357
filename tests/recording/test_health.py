"""Dead, stuck and noisy taxels are found where a recording can show them, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

import taxel
from taxel._core import ProblemError
from taxel.recording.health import _around
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
    told = taxel.wire.decode(stream, 2, array=board.array)
    of_it = (told.x == dead[0]) & (told.y == dead[1])
    assert told.repaired is not None
    assert told.repaired[of_it].tolist() == [True]
    assert taxel.health(told).named() == {"dead": [dead], "stuck": [], "noisy": []}


def noisy_board(version: int, seed: int, dead: np.ndarray, stuck: np.ndarray, noise: float = 0.85) -> list[bytes]:
    """Datagrams of a board in noise near its floor: at rest, pressed as a whole (40 frames), at rest again."""
    rng = np.random.default_rng(seed)
    board = Board(Registers(wire_version=version), version_2=Version2(states_us=20_000))
    rest = 48 + rng.normal(0, 0.5, board.array.shape)
    sent = []
    for frame in range(1600):
        pressed = 3.0 * np.clip([frame - 800, 840 - frame], 0, 20).min()
        ticks = np.rint(rest + pressed + rng.normal(0, noise, rest.shape))
        ticks[dead], ticks[stuck] = 0, 77
        sent.append(b"".join(len(d).to_bytes(2, "little") + d for d in board.frame(ticks.astype(np.uint16))))
    return sent


def heard(version: int, sent: list[bytes]) -> taxel.Events:
    stream = b"".join(sent)
    if version == 2:
        return taxel.wire.decode(stream, 2)
    datagrams, at = [], 0
    while at < len(stream):
        size = int.from_bytes(stream[at : at + 2], "little")
        datagrams.append(stream[at + 2 : at + 2 + size])
        at += 2 + size
    return taxel.wire.decode(b"".join(datagrams))


@pytest.mark.parametrize(("version", "seed"), [(1, 1), (2, 2)])
def test_silence_in_noise_at_the_floor_is_no_death(version: int, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    dead, stuck = rng.random((2, 64, 64)) < 0.003
    stuck &= ~dead
    sent = noisy_board(version, seed, dead, stuck)
    # When the recording starts in mid-stream, some live taxels have as few events as dead ones while all around them
    # have many.
    quiet = heard(version, sent[300:780])
    spoke = np.zeros((64, 64), bool)
    own = np.ones(len(quiet), bool) if quiet.repaired is None else ~quiet.repaired
    spoke[quiet.y[own], quiet.x[own]] = True
    assert np.sum(~spoke & ~dead & ~stuck) > 50
    found = taxel.health(quiet)
    if version == 1:
        assert not found.dead.any(), "nothing shows which"
    else:
        # The board's states reported every taxel's value.
        assert (found.dead == dead).all()
    # A touch reveals dead taxels; with version 1, a taxel that always reads one value cannot be distinguished from a
    # dead one.
    found = taxel.health(heard(version, sent[300:]))
    assert (found.dead == (dead | stuck if version == 1 else dead)).all()
    assert (found.stuck == (stuck & (version == 2))).all()
    # From the start on, every live taxel has had an event.
    found = taxel.health(heard(version, sent))
    assert (found.dead == dead).all()
    assert not found.noisy.any()


def test_noise_that_no_live_taxel_is_silent_in_shows_the_dead_ones() -> None:
    dead = np.random.default_rng(8).random((64, 64)) < 0.003
    sent = noisy_board(1, 8, dead, np.zeros((64, 64), bool), noise=2.5)
    found = taxel.health(heard(1, sent[300:780]))
    assert found.activity[~dead].min() > 10
    assert (found.dead == dead).all()


@pytest.mark.parametrize(("reach", "share"), [(1, 0.5), (2, 0.8), (2, 0.0), (1, 1.0)])
def test_what_lies_around_is_numpys_quantile(reach: int, share: float) -> None:
    rng = np.random.default_rng(7)
    grid = np.where(rng.random((9, 13)) < 0.6, np.nan, rng.integers(0, 50, (9, 13)))
    counts = ~np.isnan(grid)
    found = _around(np.nan_to_num(grid), counts, np.arange(grid.size), reach, share).reshape(grid.shape)
    for y, x in np.ndindex(grid.shape):
        near = grid[max(0, y - reach) : y + reach + 1, max(0, x - reach) : x + reach + 1].ravel().tolist()
        own = grid[y, x]
        near = [v for v in near if not np.isnan(v)]
        if not np.isnan(own):
            near.remove(own)
        assert found[y, x] == pytest.approx(np.quantile(near, share) if near else 0.0)


def test_two_loose_lines_do_not_kill_the_one_between_them() -> None:
    rng, board = np.random.default_rng(5), Board()
    rest = np.rint(48 + rng.normal(0, 2, board.array.shape))
    sent = []
    for frame in range(120):
        ticks = rest.copy()
        if frame % 5 == 0:
            ticks[30], ticks[32] = 0, 0
        sent += board.frame(ticks.astype(np.uint16))[: None if frame else 0]
    found = taxel.health(taxel.wire.decode(b"".join(sent)))
    assert (found.activity[31] == 0).all()
    assert (found.activity[[30, 32]] > 40).all()
    assert not found.dead.any()


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
