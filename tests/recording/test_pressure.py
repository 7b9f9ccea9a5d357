"""`taxel info` on pressure: contact area, peak, sum and centre over time, as a table."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from shell import run

import taxel

from .making import pressed

ARRAY = taxel.Array(6, 8, 2.0, name="small")


def test_area_peak_sum_and_centre_are_said_and_written(tmp_path: Path) -> None:
    path, table = tmp_path / "a.npz", tmp_path / "a.csv"
    pressed(path)
    said = run("info", path, "--table", table, "--json")
    assert said.returncode == 0, said.stderr
    found = json.loads(said.stdout)["pressure"]
    assert found["area_mm2"] == {"most": 8.0, "t_us": 1_100_000}
    assert (found["peak"]["most"], found["sum"]["most"]) == (30.0, 40.0)
    # (2 * 30 + 4 * 10) / 40 columns of 2 mm
    assert found["centre_mm"] == {"x": pytest.approx([5.0, 5.0]), "y": [6.0, 6.0]}
    rows = list(csv.DictReader(table.open()))
    assert list(rows[0]) == ["t_us", "area_mm2", "peak_ticks", "sum_ticks", "centre_x_mm", "centre_y_mm"]
    for row in rows:
        during = 1_100_000 <= int(row["t_us"]) < 1_200_000
        # Of a load that stays, the tracked rest takes a twentieth a second.
        assert float(row["sum_ticks"]) == pytest.approx(40.0 if during else 0.0, rel=0.006)
        assert (pytest.approx(float(row["centre_x_mm"])) == 5) if during else row["centre_x_mm"] == ""
    assert "contact area        at most 8 mm2, at 1100000 us" in run("info", path).stdout


def test_frames_rest_at_zero_and_events_without_intensities_have_no_pressure(tmp_path: Path) -> None:
    frames = taxel.Frames(np.eye(3)[None] * [[[1.0]], [[2.0]]], [0, 1000], unit="N")
    taxel.convert(frames, tmp_path / "f.npz")
    found = json.loads(run("info", tmp_path / "f.npz", "--json").stdout)["pressure"]
    assert (found["unit"], found["sum"]["most"], found["area_taxels"]["most"]) == ("N", 6.0, 3.0)
    taxel.convert(taxel.Events([0, 5], [1, 2], [1, 2], [1, 0], array=ARRAY), tmp_path / "e.npz")
    assert json.loads(run("info", tmp_path / "e.npz", "--json").stdout)["pressure"] is None
    refused = run("info", tmp_path / "e.npz", "--table", tmp_path / "e.csv")
    assert (refused.returncode, "without intensities" in refused.stderr) == (2, True)
    assert not (tmp_path / "e.csv").exists()
    assert (
        "the name of a table must end in .csv" in run("info", tmp_path / "f.npz", "--table", tmp_path / "f.txt").stderr
    )
