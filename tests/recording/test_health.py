"""Dead, stuck and noisy taxels are found where a recording can show them, and nowhere else."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from draws import seeds
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel import _core
from taxel.simulate import Board

NOTHING = {"dead": [], "stuck": [], "noisy": []}


class Sensor:
    """A sensor as a board reads it: an event where a value differs by more than 3 ticks from the last one sent.

    Balls of 2 to 4 taxels press it; it may have dead, stuck and noisy taxels.
    """

    def __init__(self, seed: int, shape: tuple[int, int] = (16, 20), noise: float = 0.3) -> None:
        self.random, self.noise, self.array = np.random.default_rng(seed), noise, taxel.Array(*shape)
        self.rest = 48 + self.random.normal(0, 2, shape)
        self.dead, self.stuck, self.noisy = np.zeros((3, *shape), bool)
        self.last = np.full(shape, -10)
        self.frame, self.rows = 0, []

    def plant(self, kinds: dict[str, int]) -> None:
        """Choose bad taxels, no two of which are neighbours."""
        rows, columns = self.array.shape
        free = [(y, x) for y in range(2, rows - 2, 4) for x in range(2, columns - 2, 4)]
        places = iter(self.random.permutation(free).tolist())
        for kind, number in kinds.items():
            for _ in range(number):
                getattr(self, kind)[tuple(next(places))] = True

    @property
    def bad(self) -> dict[str, list[tuple[int, int]]]:
        return {k: [(int(x), int(y)) for y, x in np.argwhere(getattr(self, k))] for k in ("dead", "stuck", "noisy")}

    def play(self, frames: int, load: np.ndarray | float = 0.0) -> None:
        """Play frames of 1 ms under a load that comes and goes."""
        for k in range(frames):
            now = (
                self.rest
                + load * np.sin(np.pi * (k + 1) / (frames + 1))
                + self.random.normal(0, self.noise, self.rest.shape)
            )
            now[self.noisy] += self.random.normal(0, 12, np.count_nonzero(self.noisy))
            now = np.rint(now)
            now[self.dead], now[self.stuck] = 0, 77
            for y, x in np.argwhere(np.abs(now - self.last) > 3):
                self.rows.append((1000 * self.frame, x, y, now[y, x] > self.last[y, x], max(now[y, x], 0)))
                self.last[y, x] = now[y, x]
            self.frame += 1

    def touch(self, y: float, x: float, radius: float = 2.5) -> None:
        rows, columns = np.mgrid[: self.array.rows, : self.array.columns]
        self.play(80, self.random.uniform(40, 80) * np.exp(-((rows - y) ** 2 + (columns - x) ** 2) / (2 * radius**2)))
        self.play(220)

    def events(self, since: int = 0) -> taxel.Events:
        t, x, y, p, ticks = map(np.array, zip(*[row for row in self.rows if row[0] >= since], strict=True))
        return taxel.Events(t, x, y, p, array=self.array, intensity=ticks.astype(int))


@pytest.mark.parametrize("seed", seeds(20, quick=3))
def test_nothing_is_named_on_boards_joined_in_mid_stream(seed: int) -> None:
    sensor = Sensor(seed)
    sensor.play(300)
    for y, x in sensor.random.uniform((0, 0), sensor.array.shape, (8, 2)):
        sensor.touch(y, x, sensor.random.uniform(1, 3))
    found = taxel.health(sensor.events(since=300_000))
    assert found.named() == NOTHING
    assert found.untested.any()
    assert not (found.untested & (found.activity > 10)).any()
    assert taxel.health(sensor.events()).named() == NOTHING


def test_bad_taxels_are_named_within_ten_touches_and_hardly_any_other() -> None:
    planted = named = others = 0
    for seed in range(20):
        sensor = Sensor(100 + seed)
        sensor.plant({"dead": 1, "stuck": 1, "noisy": 1})
        sensor.play(300)
        # Nine touches: three over each.
        for kind in ("dead", "stuck", "noisy"):
            [(x, y)] = sensor.bad[kind]
            for dy, dx in sensor.random.uniform(-0.7, 0.7, (3, 2)):
                sensor.touch(y + dy, x + dx)
        found = taxel.health(sensor.events()).named()
        planted += 3
        named += sum(sensor.bad[kind] == found[kind] for kind in found)
        extra = {place for places in found.values() for place in places}
        extra -= {place for places in sensor.bad.values() for place in places}
        others = max(others, len(extra))
    assert named >= 0.95 * planted
    assert others <= 1


def test_channels_and_single_footfalls_name_nothing() -> None:
    t = np.arange(400) * 10_000
    load = np.clip(np.sin(t / 5e5), 0, None)[:, None] * np.array([400, 0, 250, 30])
    assert taxel.health(taxel.Frames(load[:, None, :], t, unit="N")).named() == NOTHING
    assert taxel.health(taxel.Frames(load[:, None, :1], t, unit="raw")).named() == NOTHING
    # A footfall rolls over a plate once; some taxels beneath the arch stay unloaded.
    rows, columns = np.mgrid[:30, :12]
    heel_to_toe = [80 * np.exp(-((rows - 3 - k / 10) ** 2) / 20 - (columns - 6) ** 2 / 8) for k in range(240)]
    plate = np.rint(heel_to_toe)
    plate[:, 15, 6] = 0
    assert taxel.health(taxel.Frames(plate, np.arange(240) * 2000, unit="counts")).named() == NOTHING


def touched(**bad: tuple[int, int]) -> Sensor:
    """A small sensor that is touched four times all over, with bad taxels by kind (x, y)."""
    sensor = Sensor(5, (10, 10))
    for kind, (x, y) in bad.items():
        getattr(sensor, kind)[y, x] = True
    sensor.play(300)
    for _ in range(4):
        sensor.touch(4.5, 4.5, 20.0)
    return sensor


def test_a_taxel_that_does_not_exist_is_not_dead() -> None:
    events = touched(dead=(4, 7)).events()
    exists = np.ones((10, 10), bool)
    exists[7, 4] = False
    array = taxel.Array(10, 10, exists=exists)
    there = (events.x != 4) | (events.y != 7)
    columns = {name: getattr(events, name)[there] for name in ("t", "x", "y", "p", "intensity")}
    assert taxel.health(taxel.Events(**columns, array=array)).named() == NOTHING


def test_events_without_values_show_touches_too() -> None:
    events = touched(dead=(4, 7)).events()
    columns = {name: getattr(events, name)[1:] for name in ("t", "x", "y", "p")}
    there = (columns["x"] != 4) | (columns["y"] != 7)
    plain = taxel.Events(**{name: column[there] for name, column in columns.items()}, array=events.array)
    assert taxel.health(plain).named() == {**NOTHING, "dead": [(4, 7)]}


def test_what_a_state_tells_of_a_dead_taxel_does_not_make_it_alive() -> None:
    events = touched(dead=(4, 7)).events()
    told = np.arange(0, events.t[-1], 20_000)
    columns = {"t": told, "x": 4, "y": 7, "p": True, "intensity": 0}
    both = {name: np.append(getattr(events, name), np.broadcast_to(each, told.shape)) for name, each in columns.items()}
    order = np.argsort(both["t"], kind="stable")
    repaired = np.append(np.zeros(len(events), bool), np.ones(len(told), bool))[order]
    mixed = taxel.Events(**{name: each[order] for name, each in both.items()}, array=events.array, repaired=repaired)
    assert taxel.health(mixed).named() == {**NOTHING, "dead": [(4, 7)]}


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


@pytest.mark.parametrize("seed", range(20))
def test_changes_of_frames_are_those_of_each_taxel_alone(seed: int) -> None:
    random = np.random.default_rng(seed)
    n, rows, columns = (int(random.integers(*among)) for among in ((0, 40), (1, 4), (1, 5)))
    values = random.integers(0, 3, (n, rows, columns)).astype(np.float32)
    values[random.random(values.shape) < 0.2] = np.nan
    number, on = _core.changes_of_frames(taxel.Frames(values, np.arange(n)))
    for k, of in enumerate(values.reshape(n, rows * columns).T):
        # A NaN has no direction of change.
        ways = [int(b > a) - int(b < a) for a, b in pairwise(of.tolist()) if b > a or b < a]
        assert (number[k], on[k]) == (len(ways), sum(a == b for a, b in pairwise(ways)))


def test_nothing_recorded_shows_nothing_and_draws() -> None:
    found = taxel.health(taxel.Events([], [], [], [], array=taxel.Array(3, 3)))
    assert found.named() == {"dead": [], "stuck": [], "noisy": []}
    found.plot()
    assert taxel.health(taxel.Frames(np.zeros((0, 3, 3)), [])).named()["dead"] == []


def test_a_missing_cell_of_frames_was_not_pressed() -> None:
    touch = np.array([0, 40, 80, 40, 0])[:, None, None] * np.ones((3, 3))
    values = np.concatenate([touch] * 2)
    values[:, 1, 1] = np.nan
    found = taxel.health(taxel.Frames(values, np.arange(10) * 100_000, unit="N"))
    assert found.untested.tolist() == [[False] * 3, [False, True, False], [False] * 3]


@given(st.integers(0, 2**32 - 1), st.sampled_from(["N", "kPa", "V", "counts"]), st.floats(1e-3, 1e3))
@settings(max_examples=20, deadline=None)
def test_a_taxel_is_dead_or_stuck_whatever_its_unit(seed: int, unit: str, gain: float) -> None:
    rng = np.random.default_rng(seed)
    pressed = np.clip(np.sin(np.arange(80) / 3), 0, None)[:, None, None]
    values = pressed * rng.uniform(30, 50, (10, 10)) + rng.normal(0.5, 0.1, (80, 10, 10))
    values[:, 7, 4], values[:, 2, 3] = 0.0, 99.0
    found = taxel.health(taxel.Frames(gain * values, np.arange(80) * 50_000, unit=unit))
    assert found.named() == {"dead": [(4, 7)], "stuck": [(3, 2)], "noisy": []}


def test_a_single_taxel_of_a_board_that_is_touched_is_not_hot() -> None:
    t = np.arange(400) * 1000
    pressed = taxel.Events(t, np.full(400, 4), np.full(400, 4), t // 1000 % 40 < 20, array=taxel.Array(9, 9))
    assert taxel.health(pressed).named()["noisy"] == []


def drifting(seed: int, shape: tuple[int, int], step: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return readings at 90 Hz of taxels that differ in gain, offset and drift, and are touched; and their times."""
    random = np.random.default_rng(seed)
    t, gain = np.arange(1800) / 90, random.uniform(0.8, 1.2, shape)
    drift = random.normal(0, 0.03, shape) + random.normal(0.02, 0.01, shape) * (1 - np.exp(-t / 10))[:, None, None]
    values = drift + gain * random.normal(0, 0.006, (len(t), *shape))
    for begin in np.arange(1, 18, 1.5) + random.uniform(0, 0.5, 12):
        y, x, load = random.uniform(0, shape[0]), random.uniform(0, shape[1]), np.exp(random.uniform(-4, 1))
        held = (t >= begin) & (t < begin + random.uniform(0.2, 1.0))
        rows, columns = np.mgrid[: shape[0], : shape[1]]
        blob = gain * np.exp(-((rows - y) ** 2 + (columns - x) ** 2) / 2)
        values += load * (held * (1 + 0.06 * np.sin(11 * t)))[:, None, None] * blob
    return np.round(values / step) * step if step else values, np.rint(1e6 * t).astype(np.int64)


@pytest.mark.parametrize("unit", ["N", "as sent"])
@given(st.integers(0, 10_000), st.integers(1, 16), st.integers(1, 16), st.sampled_from([0.0, 0.002, 0.01, 0.05]))
def test_clean_taxels_that_drift_are_not_noisy(unit: str, seed: int, rows: int, columns: int, step: float) -> None:
    values, t = drifting(seed, (rows, columns), step)
    assert not taxel.health(taxel.Frames(values, t, unit=unit, array=taxel.Array(rows, columns))).noisy.any()
