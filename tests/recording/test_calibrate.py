"""`taxel calibrate`: from a known load, a table or the law, to a file beside the recording that `taxel info` reads."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from shell import run

import taxel

from .making import pressed


def weighed(path: Path) -> None:
    """Frames of a sensor that reads 2 counts a newton: nothing, 3 N in all, 12 N in all, one second each."""
    frame = np.array([[[1.0, 2.0], [3.0, 0.0]]])
    values = np.concatenate([np.repeat(frame * load / 3, 10, axis=0) for load in (0, 3, 12)])
    frames = taxel.Frames(values, np.arange(30) * 100_000, array=taxel.Array(2, 2, 4.0, name="pad"))
    taxel.convert(frames, path)


def test_a_weight_laid_on_the_array_makes_newtons_of_events(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    pressed(path)
    before = json.loads(run("info", path, "--json").stdout)
    assert (before["calibration"], before["pressure"]["unit"]) == (None, "ticks")
    done = run(
        "calibrate", path, "--load", "2", "--from", "1.1", "--to", "1.2", "--date", "2026-11-21", "--note", "scale"
    )
    assert done.returncode == 0, done.stderr
    place = tmp_path / "a.calibration.json"
    assert str(place) in done.stdout
    assert "no residual" in done.stdout
    after = json.loads(run("info", path, "--json").stdout)
    assert after["calibration"] == "ticks to N, power 1, fit to 1 load, 2026-11-21"
    # 40 ticks above rest in all are 2 N; nothing else is loaded.
    assert after["pressure"]["unit"] == "N"
    assert after["pressure"]["sum"]["most"] == pytest.approx(2.0)
    assert after["pressure"]["peak"]["most"] == pytest.approx(1.5)
    assert after["pressure"]["area_mm2"] == before["pressure"]["area_mm2"]
    assert "calibration         ticks to N" in run("info", path).stdout
    # The file is also meant to be read by people.
    said = json.loads(place.read_text())
    assert (said["unit"], said["of"], said["date"], said["note"]) == ("N", "ticks", "2026-11-21", "scale")


def test_loads_in_a_table_have_a_residual_and_find_the_exponent(tmp_path: Path) -> None:
    path, loads = tmp_path / "pad.npz", tmp_path / "loads.csv"
    weighed(path)
    loads.write_text("load,unit,from_s,to_s\n3,N,1,2\n12,N,2,3\n")
    done = run("calibrate", path, "--loads", loads, "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["residual"] is None  # two loads, gain and exponent
    done = run("calibrate", path, "--loads", loads, "--exponent", "1", "--json", "--overwrite")
    said = json.loads(done.stdout)
    assert said["residual"] == pytest.approx(0.0, abs=1e-6)
    recording = taxel.open(path)
    assert recording.calibrated().total()[[0, 15, 25]] == pytest.approx([0.0, 3.0, 12.0])


def test_a_table_needs_no_load(tmp_path: Path) -> None:
    path, table = tmp_path / "a.npz", tmp_path / "table.csv"
    pressed(path)
    table.write_text("reading,value\n10,1\n30,4\n")
    assert run("calibrate", path, "--table", table, "--unit", "kPa").returncode == 0
    pressure = json.loads(run("info", path, "--json").stdout)["pressure"]
    assert (pressure["unit"], pressure["peak"]["most"]) == ("kPa", 4.0)
    newtons = 1e-3 * taxel.open(path).array.pitch_mm ** 2 * pressure["sum"]["most"]
    assert f"  force               at most {newtons:g} N, at " in run("info", path).stdout
