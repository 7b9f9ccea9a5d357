"""What lies beside a recording is found by whatever path leads to it, also one without a name of its own."""

from pathlib import Path

import pytest

import taxel
from taxel.formats.layout import Layout
from taxel.labels import beside as labels_beside

FINDERS = {
    "calibration.json": taxel.Calibration.beside,
    "notes.csv": lambda path: found if (found := labels_beside(path)).is_file() else None,
    "layout.toml": lambda path: Layout.beside(Path(path)),
}


@pytest.mark.parametrize("ending", FINDERS)
@pytest.mark.parametrize("way", [".", "./", "../walks", "inner/..", "inner/../../walks", "{}", "{}/"])
def test_a_folder_has_its_neighbours_by_any_path(tmp_path, monkeypatch, ending, way):
    folder = tmp_path / "walks"
    (folder / "inner").mkdir(parents=True)
    monkeypatch.chdir(folder)
    path = way.format(folder)
    assert FINDERS[ending](path) is None
    beside = tmp_path / f"walks.{ending}"
    beside.write_text("")
    assert FINDERS[ending](path).resolve() == beside


@pytest.mark.parametrize("ending", FINDERS)
@pytest.mark.parametrize("path", ["/", "//", "/..", "..", "a/..", "walk", "not there/.."])
def test_a_path_beside_which_nothing_lies_has_none(tmp_path, monkeypatch, ending, path):
    monkeypatch.chdir(tmp_path)
    assert FINDERS[ending](path) is None
