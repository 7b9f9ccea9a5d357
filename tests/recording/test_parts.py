"""Folders of trials, .h5, and recordings cut and merged again: nothing is lost or made up on the way."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from shell import run

import taxel
from taxel._core import FormatError, ProblemError

from .making import record, some_events, some_frames

# .h5


def test_another_program_reads_a_h5_as_the_layout_says(tmp_path: Path) -> None:
    events = some_events(30)
    taxel.convert(events, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as h5:
        assert h5.attrs["taxel"] == 2
        assert {name: h5[name].dtype for name in "txyp"} == {
            "t": np.int64,
            "x": np.uint16,
            "y": np.uint16,
            "p": np.bool_,
        }
        assert np.array_equal(h5["t"][...], events.t)
        assert h5["markers"].shape == (2, 2)


def test_another_h5_names_its_arrays(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as h5:
        h5["t"] = [1]
    with pytest.raises(FormatError, match=r"contains t \(1\); name the array of frames"):
        taxel.open(tmp_path / "other.h5")


# folders


def test_a_folder_is_a_list_in_the_order_of_the_names_with_its_labels_as_notes(tmp_path: Path) -> None:
    names = ["walk10.npz", "walk2.mcap", "walk1.csv", "a.h5"]
    for k, name in enumerate(names):
        taxel.convert(some_events(40, seed=k), tmp_path / name)
    (tmp_path / "people.csv").write_text("person,age\n1,40\n")
    (tmp_path / "labels.csv").write_text("recording,label,t_us\nwalk2,heel,700\nwalk2,heel,300\na,toe,100\n")
    opened = taxel.open_all(tmp_path)
    assert [rec.name for rec in opened] == ["a.h5", "walk1.csv", "walk2.mcap", "walk10.npz"]
    assert [[(n.text, n.t) for n in rec.notes] for rec in opened] == [
        [("toe", 100)],
        [],
        [("heel", 300), ("heel", 700)],
        [],
    ]
    (tmp_path / "labels.csv").write_text("recording,label,t_us\nrun,heel,700\n")
    with pytest.raises(FormatError, match=r"run is not a recording of this folder; must be one of a\.h5, walk1\.csv"):
        taxel.open_all(tmp_path)


# cut and merge


def opened(table: taxel.Events | taxel.Frames, folder: Path, name: str = "a.npz") -> taxel.Recording:
    taxel.convert(table, folder / name, overwrite=True)
    return taxel.open(folder / name)


def test_a_part_beyond_the_array_is_refused(tmp_path: Path) -> None:
    frames = taxel.Frames(np.zeros((2, 4, 6)), [0, 100])
    rec = opened(frames, tmp_path)
    for columns, rows, said in [
        (slice(3, 99), None, "columns 3 to 99"),
        (slice(7, None), None, "columns 7 to the last"),
        (None, slice(None, 5), "rows 0 to 5"),
        (slice(2, 2), slice(-9, 2), "columns 2 to 2 and rows -9 to 2"),
    ]:
        with pytest.raises(taxel.ProblemError, match=rf"^{said}: must be within"):
            taxel.cut(rec, columns=columns, rows=rows)
    assert taxel.cut(rec, columns=slice(3, 6), rows=slice(-2, None))[0].array.shape == (2, 3)


def test_a_label_is_cut_out_with_what_lies_around_it(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", some_events())
    rec = taxel.open(tmp_path / "a.mcap")
    (part,) = taxel.cut(rec, label="left heel", before_us=1000, after_us=2000)
    assert part.events == rec.events.between(4000, 7000)
    assert taxel.cut(rec, label="nothing") == []
    said = run("cut", tmp_path / "a.mcap", tmp_path / "heel.npz", "--label", "left heel", "--before", ".001")
    assert said.returncode == 0, said.stderr
    assert taxel.open(tmp_path / "heel1.npz").events == rec.events.between(4000, 505_000)
    none = run("cut", tmp_path / "a.mcap", tmp_path / "b.npz", "--label", "x")
    assert (none.returncode, none.stderr.count("\n")) == (2, 1)


def test_merge_refuses_what_does_not_go_together(tmp_path: Path) -> None:
    events, frames = opened(some_events(20), tmp_path), opened(some_frames(), tmp_path, "f.npz")
    small = opened(taxel.Events([0], [0], [0], [True], array=taxel.Array(2, 2)), tmp_path, "s.npz")
    for parts, said in (
        ([events, frames], "contains events, .* contains frames; convert one of them"),
        ([], "one or more"),
        ([events, small], "only recordings of one sensor"),
    ):
        with pytest.raises(ProblemError, match=said):
            taxel.merge(parts)


@pytest.mark.parametrize("begin_us", [0, 5_000_000, 1_795_000_000_000_000])
def test_a_shell_counts_the_seconds_of_a_stretch_as_info_does(begin_us: int, tmp_path: Path) -> None:
    """From the beginning where times count from 1970; else they are the board's."""
    t = begin_us + 10_000 * np.arange(1000)
    frames = taxel.Frames(np.zeros((1000, 2, 2)), t, unit="counts", array=taxel.Array(2, 2))
    taxel.convert(frames, tmp_path / "a.npz")
    first = begin_us / 1e6 if begin_us < 10**15 else 0.0
    said = run("cut", tmp_path / "a.npz", tmp_path / "b.npz", "--from", first + 3.2, "--to", first + 4)
    assert said.returncode == 0, said.stderr
    assert np.array_equal(taxel.open(tmp_path / "b.npz").frames().t, t[320:400])
    lasts = f"a.npz lasts from {first:g} to {first + 9.99:g} s"
    for ends, why in (
        (("--from", first), "cuts nothing off"),
        (("--from", first - 1, "--to", first + 10), "cuts nothing off"),
        (("--from", first + 3, "--to", first + 3), "contains nothing of"),
        (("--from", first + 3.001, "--to", first + 3.009), "contains nothing of"),
        (("--from", first + 20), "must not be after the end of"),
        (("--to", first), "must be after the beginning of"),
    ):
        said = run("cut", tmp_path / "a.npz", tmp_path / "c.npz", *ends)
        assert (said.returncode, said.stderr.count("\n")) == (2, 1)
        assert why in said.stderr
        assert lasts.removeprefix("a.npz ") in said.stderr
    assert not (tmp_path / "c.npz").exists()


# notes while recording


def test_a_line_on_standard_input_is_a_note_of_the_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, typed = tmp_path / "a.mcap", tmp_path / "typed"
    typed.write_text("heel\n\ntoe off\nlast")
    with typed.open() as lines:
        monkeypatch.setattr("sys.stdin", lines)
        said = run("record", path, "--port", 0, "--host", "127.0.0.1", "--seconds", 1)
    assert "each line on standard input is saved as a note" in said.stderr
    assert [n.text for n in taxel.open(path).notes] == ["heel", "toe off", "last"]
