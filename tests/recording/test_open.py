"""taxel.open knows its kinds by their bytes, and says of others what they are and what would be right."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from refusal import refused

import taxel
from taxel import Frames
from taxel._core import FormatError, ProblemError
from taxel.options import FullReading

from .making import HEADER, record, some_events

THESIS = taxel.Array.thesis()


def npz(**columns: object) -> bytes:
    file = io.BytesIO()
    np.savez(file, **columns)
    return file.getvalue()


def test_a_missing_file_and_a_folder_are_refused_where_one_recording_is_opened(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        taxel.open(tmp_path / "nothing.mcap")
    for refuse in (taxel.open, lambda path: taxel.convert(path, tmp_path / "a.npz")):
        with pytest.raises(ProblemError, match=r": is a folder; name one of its recordings"):
            refuse(tmp_path)


def test_raw_bytes_need_no_magic_and_say_whether_they_are_complete(tmp_path: Path) -> None:
    events = some_events(100)
    path = tmp_path / "a.lsa"
    taxel.convert(events, path)
    assert (tmp_path / "a.lss").read_bytes() == b""
    rec = taxel.open(path)
    assert not rec.truncated
    assert rec.events == events
    assert rec.verdict == "losses unknown: the .lsa does not record them"
    assert "too early by a multiple of 6.5536 s" in rec.remarks[0]
    (tmp_path / "a.lss").unlink()
    assert taxel.open(path).truncated
    assert "a.lss is missing" in taxel.open(path).verdict
    path.write_bytes(b"\x89MCAP0\r\n")
    assert len(taxel.open(path).events) == 0
    assert "bytes skipped" in taxel.open(path).verdict


def test_a_plain_npz_or_csv_gets_the_thesis_array_or_one_that_fits(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    path.write_bytes(npz(t=[0, 5], x=[1, 2], y=[3, 4], p=[True, False]))
    assert taxel.open(path).array == THESIS
    assert taxel.open(path, array=taxel.Array(8, 8)).array == taxel.Array(8, 8)
    (tmp_path / "b.csv").write_text("t_us,x,y,p\n0,99,3,1\n")
    assert taxel.open(tmp_path / "b.csv").array.shape == (64, 100)
    with pytest.raises(FormatError, match="outside"):
        taxel.open(tmp_path / "b.csv", array=THESIS)


@pytest.mark.parametrize("are_frames", [False, True])
def test_of_a_csv_that_was_cut_off_the_whole_lines_are_read(tmp_path: Path, are_frames: bool) -> None:
    path, random = tmp_path / "a.csv", np.random.default_rng(3)
    frames = Frames(random.normal(size=(40, 2, 3)).astype(np.float32), np.arange(40) * 7, array=taxel.Array(2, 3))
    taxel.convert(frames if are_frames else some_events(50), path)
    whole = taxel.open(path)._main.table
    lines = path.read_bytes().split(b"\n")
    path.write_bytes(b"\r\n".join(lines))
    assert taxel.open(path)._main.table == whole
    path.write_bytes(b"\n".join([*lines[:20], b"", lines[20].rpartition(b",")[0] + b",abc", *lines[21:-2], b"9,1"]))
    cut = taxel.open(path)
    # Of a frame one value is missing; an event is left out.
    assert cut._main.table.t.tolist() == [*whole.t[: 19 + are_frames].tolist(), *whole.t[20:-1].tolist()]
    assert not are_frames or np.isnan(cut.frames().values[19]).sum() == 1
    assert cut.lost == (
        f"1 line with a cell that is no number{', which is missing' * are_frames} (line 22)",
        f"1 line cut off at the end (line {len(lines)})",
    )


def test_a_csv_from_other_programs_is_read_as_it_comes(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"\xef\xbb\xbft_us, x, y, p\r\n0, 1, 2, 1\r\n100, 3, 4, 0\r\n\r\n")
    assert taxel.open(path).events.t.tolist() == [0, 100]
    # A table of others may call its time so too: what its columns are is asked of their names.
    path.write_bytes(b"t_us,left,slipped,right\n0,1,0,2\n10,3,1,4\n")
    recording = taxel.open(path)
    assert (recording.kind, recording.array.names) == ("table", ("left", "right"))
    assert recording.frames().values.tolist() == [[[1, 2]], [[3, 4]]]
    assert recording.frames().t.tolist() == [0, 10]
    assert taxel.open(path, array=taxel.Array(2, 1)).frames().values.tolist() == [[[1], [2]], [[3], [4]]]
    path.write_bytes(b"t_us,x,y,p\n")
    assert len(taxel.open(path).events) == 0


def test_registers_of_a_board_with_other_rules_open(tmp_path: Path) -> None:
    # Of a logic whose shift registers were faster, and whose ramps could be longer.
    old = taxel._core.registers_preset("5.2 kHz") | {"random_lines": True, "ramp": 164}
    record(tmp_path / "old.mcap", some_events(), header={"registers": old})
    file = tmp_path / "again.mcap"
    taxel.convert(tmp_path / "old.mcap", file)
    rec = taxel.open(file)
    assert rec.registers is not None
    assert (rec.registers.random_lines, rec.registers.ramp, rec.registers.warnings != ()) == (True, 164, True)
    assert rec.registers.words == (9, 300, 300, 55 << 16 | 75, 164, 3 << 8 | 63 << 16, 0, 0)
    with pytest.raises(taxel.DeviceError, match="rule 3"):
        rec.registers.replace(lines=8)
    with pytest.raises(taxel.DeviceError, match="rule 3"):
        rec.registers.commands_to(taxel.wire.Registers())


def test_registers_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    for wrong in ({"line_period": 0}, {"lines": 65}, {"channels": 17}):
        header = {"registers": taxel._core.registers_preset("5.2 kHz") | wrong}
        with refused(taxel.DeviceError, argument=next(iter(wrong))):
            record(tmp_path / "no.mcap", some_events(), header=header)


@pytest.fixture
def rec(tmp_path: Path) -> taxel.Recording:
    record(tmp_path / "walk.mcap", some_events(), header={"registers": None})
    return taxel.open(tmp_path / "walk.mcap")


def test_a_recording_gives_all_that_was_recorded(rec: taxel.Recording) -> None:
    assert rec.events == some_events()
    assert rec.array == THESIS
    assert rec.source == HEADER["source"]
    assert rec.kind == "mcap"
    at = HEADER["started_ns"]
    assert rec.notes == (
        taxel.Note("left heel", 5000, at + 5_000_000),
        taxel.Note("somebody coughed", None, at + 6_000_000),
    )
    assert rec.detections == taxel.Detections(["contact"], [6000], [6192], [1.5])
    assert rec.registers == taxel.wire.Registers.preset("5.2 kHz")
    assert [registers for _, registers in rec.register_changes] == [rec.registers]
    assert not rec.truncated
    assert rec.verdict == "nothing lost after arrival (version 1 of the wire cannot show losses before arrival)"
    assert rec.counts["datagrams"] == rec.counts["received"] == 40
    assert rec.counts["decoder"]["changes"] == 400
    assert repr(rec).startswith("Recording(walk.mcap: 400 events, ")
    assert "2 notes, 1 detection" in repr(rec)


def test_frames_of_a_file_of_frames_are_its_own_or_the_last_at_each_time(tmp_path: Path) -> None:
    own = taxel.Frames(np.arange(12, dtype=np.float32).reshape(3, 2, 2), [0, 1000, 2500])
    taxel.convert(own, tmp_path / "a.npz")
    rec = taxel.open(tmp_path / "a.npz")
    assert rec.frames() == own
    held = rec.frames(1000)
    assert held.t.tolist() == [0, 1000, 2000]
    assert held.values[:, 0, 0].tolist() == [0, 4, 4]
    assert rec.between(500, 3000).frames().t.tolist() == [1000, 2500]
    with pytest.raises(ProblemError, match="contains frames and no events"):
        _ = rec.events
    with pytest.raises(ProblemError, match=r"only a \.mcap does"):
        rec.datagrams()
    assert rec.clock is None
    assert "3 frames" in repr(rec)


def test_a_recording_draws_itself(rec: taxel.Recording, tmp_path: Path) -> None:
    figure = rec.plot()
    assert len(figure.axes) >= 2
    frames = taxel.Frames(np.ones((3, 2, 2)), [0, 1, 2])
    taxel.convert(frames, tmp_path / "f.npz")
    taxel.open(tmp_path / "f.npz").plot()
    taxel.convert(taxel.Events([], [], [], [], array=THESIS), tmp_path / "empty.mcap")
    taxel.open(tmp_path / "empty.mcap").plot()


@pytest.mark.parametrize("ending", [".npz", ".h5", ".csv", ".mcap"])
def test_a_row_of_channels_is_laid_out_by_the_array_that_is_given(tmp_path: Path, ending: str) -> None:
    values = np.arange(36, dtype=np.float32).reshape(3, 1, 12)
    taxel.convert(taxel.Frames(values, [0, 10, 20], unit="N"), tmp_path / f"a{ending}")
    [recording] = FullReading(array=["3x4"]).open_trials(tmp_path / f"a{ending}")
    assert recording.frames().values.tolist() == values.reshape(3, 3, 4).tolist()
    if ending != ".mcap":
        assert taxel.open(tmp_path / f"a{ending}", array=taxel.Array(3, 4)).array.shape == (3, 4)
    with pytest.raises(taxel.Error, match=r"5 x 4 taxels|5x4"):
        FullReading(array=["5x4"]).open_trials(tmp_path / f"a{ending}")


def test_a_saved_array_of_events_opens(tmp_path: Path) -> None:
    events = taxel.Events([0, 200, 200], [3, 4, 1], [5, 5, 0], [True, False, True], array=taxel.Array(8, 8))
    np.save(tmp_path / "a.npy", events.to_numpy())
    assert taxel.open(tmp_path / "a.npy", array=taxel.Array(8, 8)).events == events
    assert taxel.open(tmp_path / "a.npy").array == taxel.Array.thesis()
    (tmp_path / "a.npy").write_bytes((tmp_path / "a.npy").read_bytes()[:-4])
    with pytest.raises(FormatError, match=r"a\.npy"):
        taxel.open(tmp_path / "a.npy")
