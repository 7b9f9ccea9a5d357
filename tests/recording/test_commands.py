"""`taxel info` and `taxel convert` as a shell sees them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from shell import run

import taxel

from .making import record, some_events


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("walk") / "walk.mcap"
    record(path, some_events())
    return path


def test_info_says_what_is_in_a_recording(walk: Path) -> None:
    said = run("info", walk)
    assert said.returncode == 0
    for words in (
        "walk.mcap: .mcap, from udp 127.0.0.1:5208",
        "64 x 64 taxels",
        "400, ",
        "2 markers",
        "rate, board",
        "rate, host",
        "dead taxels",
        "verdict             nothing lost after arrival",
    ):
        assert words in said.stdout


def test_info_as_json_holds_rates_by_both_clocks_losses_and_taxels(walk: Path) -> None:
    said = json.loads(run("info", walk, "--json").stdout)
    seconds = said["seconds"]
    assert said["events"] == 400
    assert said["events_per_s_board"] == pytest.approx(400 / seconds)
    assert said["events_per_s_host"] == pytest.approx(400 / said["seconds_host"])
    assert said["peak_events_per_s_board"] >= said["events_per_s_board"]
    assert not said["peak_before_start"]
    assert set(said["taxels"]) == {"dead", "stuck", "noisy"}
    assert said["counts"]["decoder"]["skipped"] == 0
    assert said["registers"]["ramp"] == 150
    assert said["notes"][0] == {"t_us": 5000, "text": "left heel"}
    assert said["detections"] == {"contact": 1}
    assert not said["truncated"]


@pytest.mark.parametrize("start", [None, 0, 20_000, 500_000])
def test_a_rate_before_the_start_marker_is_said_to_be_that(tmp_path: Path, start: int | None) -> None:
    """Each of 16 taxels sends its rest every 100 us for 20 ms, and one of them an event every ms from then on."""
    t = np.concatenate([np.repeat(np.arange(0, 20_000, 100), 16), np.arange(20_000, 1_000_000, 1000)])
    place = np.concatenate([np.tile(np.arange(16), 200), np.zeros(980, np.int64)])
    markers = [] if start is None else [(start, True)]
    events = taxel.Events(t, place % 4, place // 4, t * 0 + 1, array=taxel.Array(4, 4), markers=markers)
    taxel.convert(events, tmp_path / "a.npz")
    said = run("info", tmp_path / "a.npz").stdout
    before = start is not None and start > 10_000
    assert "160000 events/s in the busiest 10 ms" in said
    assert (", before the start marker, where a board sends the rest of every taxel" in said) == before


def test_info_writes_its_table_once(walk: Path, tmp_path: Path) -> None:
    table = tmp_path / "walk.csv"
    said = run("info", walk, "--table", table)
    assert (said.returncode, f"table written to {table}" in said.stdout) == (0, True)
    again = run("info", walk, "--table", table)
    assert (again.returncode, again.stderr.count("\n")) == (2, 1)
    assert "exists already" in again.stderr
    assert run("info", walk, "--table", table, "--overwrite").returncode == 0
    assert "the name of a table must end in" in run("info", walk, "--table", tmp_path / "a.txt").stderr


def test_convert_writes_and_says_what_the_target_cannot_hold(walk: Path, tmp_path: Path) -> None:
    said = run("convert", walk, tmp_path / "walk.csv")
    assert said.returncode == 0
    assert said.stdout.startswith(f"written to {tmp_path / 'walk.csv'}\n  lost: ")
    said = run("convert", walk, tmp_path / "walk.npz", "--json")
    [lost] = json.loads(said.stdout)["lost"]
    assert lost.startswith("a .npz holds the table alone: not the raw data, arrival times, ")
    assert run("convert", walk, tmp_path / "p.npz", "--frames", "500").returncode == 0
    frames = taxel.open(tmp_path / "p.npz").frames()
    assert np.array_equal(np.unique(np.diff(frames.t)), [2000])


def test_the_sensor_of_a_table_of_events_is_said_once_and_kept(walk: Path, tmp_path: Path) -> None:
    table, kept = tmp_path / "walk.csv", tmp_path / "walk.npz"
    assert run("convert", walk, table).returncode == 0
    assumed = run("info", table).stdout
    assert (
        "64 x 64 taxels, 2.67 mm apart, thesis 64x64; assumed, because a .csv does not state it: give --array"
        in assumed
    )
    assert "70 x 65 taxels, 5 mm apart\n" in run("info", table, "--array", "70x65x5").stdout
    # Without mm: those of the board's wire.
    assert "70 x 65 taxels, 2.67 mm apart\n" in run("info", table, "--array", "70x65").stdout
    assert run("convert", table, kept, "--array", "70x65x5").returncode == 0
    assert taxel.open(kept).array == taxel.Array(70, 65, pitch_mm=5.0, name="70x65x5")
    assert np.array_equal(taxel.open(kept).events.t, taxel.open(walk).events.t)
    assert json.loads(run("info", table, "--json").stdout)["array_assumed"]
    assert not json.loads(run("info", kept, "--json").stdout)["array_assumed"]
    assert "states its sensor, Array(" in run("info", walk, "--array", "6x6").stderr
