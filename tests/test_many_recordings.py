"""Commands on many recordings: the same results whoever computes them; what failed is named, with an exit code."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from shell import run

import taxel

#: How the work is spread; a cluster takes ten seconds of processor time to start.
SPREAD = [
    (),
    ("--jobs", "2"),
    pytest.param(("--jobs", "2", "--backend", "dask"), marks=pytest.mark.slow),
    pytest.param(("--jobs", "2", "--backend", "ray"), marks=pytest.mark.slow),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five recordings of which one is damaged."""
    folder = tmp_path_factory.mktemp("many")
    for k in range(5):
        values = np.full((40, 3, 3), 50.0 + k)
        values[20:30, 1:, 1:] += 100
        frames = taxel.Frames(values, 10_000 * np.arange(40), unit="counts", array=taxel.Array(3, 3))
        taxel.convert(frames, folder / f"press{k}.npz")
    (folder / "press2.npz").write_bytes(b"no recording")
    return folder


def test_a_command_with_processes_of_its_own_ends(folder: Path) -> None:
    asked = [sys.executable, "-P", "-m", "taxel", "info", str(folder), "--jobs", "2"]
    assert subprocess.run(asked, capture_output=True, timeout=100, check=False).returncode == 2


@pytest.mark.parametrize("spread", SPREAD)
def test_a_folder_is_converted_but_for_what_failed(folder: Path, tmp_path: Path, spread: tuple[str, ...]) -> None:
    done = run("convert", folder, tmp_path / "new", "--json", *spread)
    result = json.loads(done.stdout)
    assert done.returncode == 2
    assert [Path(one["target"]).name for one in result["written"]] == [f"press{k}.mcap" for k in (0, 1, 3, 4)]
    assert [Path(one["source"]).name for one in result["failed"]] == ["press2.npz"]
    for one in result["written"]:
        before, after = taxel.open(one["source"]).frames(), taxel.open(one["target"]).frames()
        assert np.array_equal(before.values, after.values)
    again = run("convert", folder, tmp_path / "new", *spread)
    assert again.returncode == 2
    assert again.stderr.count("exists already") == 4, "nothing is replaced unasked"


@pytest.mark.parametrize("spread", SPREAD)
def test_detections_do_not_depend_on_who_detects(folder: Path, tmp_path: Path, spread: tuple[str, ...]) -> None:
    taxel.detect.PlainRule("area", 2, noise_floor=40.0).save(tmp_path / "rule.json")
    files = [folder / f"press{k}.npz" for k in (0, 1, 3)]
    words = ("detect", *files, "--readout", tmp_path / "rule.json", "--tare", "0.15", "--json")
    expected = json.loads(run(*words).stdout)
    done = run(*words, *spread)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == expected
    assert [len(one["detections"]) for one in expected["recordings"]] == [2, 2, 2]


@pytest.mark.parametrize("spread", SPREAD[1:])
def test_folds_and_bits_do_not_depend_on_who_computes_them(tmp_path: Path, spread: tuple[str, ...]) -> None:
    rows = ["recording,label,t_us,stop_us"]
    for k in range(2):
        values = np.random.default_rng(k).normal(50, 1, (600, 4, 4))
        for touch in range(8):
            begin = 60 + 60 * touch
            values[begin : begin + 25, 1 : 3 - touch % 2, 1:3] += 100
            label, t = ("ball", "edge")[touch % 2], 10_000 * begin
            rows.append(f"press{k},{label},{t},{t + 250_000}")
        frames = taxel.Frames(np.round(values), 10_000 * np.arange(600), unit="counts", array=taxel.Array(4, 4))
        taxel.convert(frames, tmp_path / f"press{k}.npz")
    (tmp_path / "labels.csv").write_text("\n".join(rows) + "\n")
    files = [tmp_path / f"press{k}.npz" for k in range(2)]
    given = ("--labels", tmp_path / "labels.csv", "--overwrite", "--json")
    for command in (
        ("train", *files, "--recipe", "touch", "--out", tmp_path / "r.json"),
        ("information", *files, "--draws", "2", "--shuffles", "2", "--folds", "2"),
    ):
        alone, spread_out = (run(*command, *given, *how) for how in ((), spread))
        assert spread_out.returncode == 0, spread_out.stderr
        assert json.loads(spread_out.stdout) == json.loads(alone.stdout)
