"""Commands on many recordings: the same results whoever computes them; what failed is named, with an exit code."""

from __future__ import annotations

import json
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


@pytest.mark.parametrize("spread", SPREAD)
def test_info_of_a_folder_lists_what_failed(folder: Path, spread: tuple[str, ...]) -> None:
    done = run("info", folder, "--json", *spread)
    facts = json.loads(done.stdout)
    assert done.returncode == 2
    assert facts == json.loads(run("info", folder, "--json").stdout)
    assert [Path(one["file"]).name for one in facts] == [f"press{k}.npz" for k in (0, 1, 3, 4, 2)]
    assert [one["pressure"]["peak"]["most"] for one in facts[:4]] == [150.0 + k for k in (0, 1, 3, 4)]
    assert "press2.npz" in facts[4]["error"]
    [line] = done.stderr.splitlines()
    assert line.startswith("taxel: ")
    assert "press2.npz" in line


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
