"""A .h5 is read by a child process, which is ended where the HDF5 library hangs or ends."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel._base import h5_file
from taxel._base.h5_file import H5File
from taxel._core import FormatError
from taxel.recording.readers import h5 as read_h5
from taxel.recording.readers.h5 import is_h5_of_taxel

from .making import some_events

#: Says that it runs, leaves its number beside itself, and listens to no signal that can be ignored.
BLOCKED = """
import pathlib, signal, sys, time
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
pathlib.Path(__file__).with_suffix(".pid").write_text(str(__import__("os").getpid()))
print('{"running": true}', flush=True)
while True:
    time.sleep(60)
"""


def gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def test_a_library_that_hangs_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, child = tmp_path / "a.h5", tmp_path / "child.py"
    taxel.convert(some_events(20), path)
    child.write_text(BLOCKED)
    monkeypatch.setattr(h5_file, "_CHILD", child)
    monkeypatch.setattr(h5_file, "PATIENCE_S", 0.5)
    with pytest.raises(
        FormatError, match=r"a\.h5: the HDF5 file is damaged .*\(the library has read nothing for 0\.5 s\)"
    ):
        taxel.open(path)
    assert gone(int((tmp_path / "child.pid").read_text()))


def test_a_library_that_keeps_the_interpreter_ends_with_a_killed_parent(tmp_path: Path) -> None:
    """No thread of the child runs meanwhile, so the system must end it."""
    taxel.convert(some_events(20), tmp_path / "a.h5")
    child, written = tmp_path / "child.py", tmp_path / "child.pid"
    # A function of PyDLL keeps Python's lock.
    child.write_text(BLOCKED.replace("while True:\n    time.sleep(60)", "__import__('ctypes').PyDLL(None).sleep(60)"))
    opening = "import sys, pathlib, taxel; from taxel._base import h5_file; "
    opening += "h5_file._CHILD = pathlib.Path(sys.argv[2]); taxel.open(sys.argv[1])"
    process = subprocess.Popen([sys.executable, "-c", opening, tmp_path / "a.h5", child])
    end = time.monotonic() + 120
    while not (written.exists() and written.read_text()):
        assert time.monotonic() < end
        time.sleep(0.01)
    time.sleep(0.3)  # the child's lines until it sleeps
    process.kill()
    process.wait()
    end = time.monotonic() + 5
    while not gone(int(written.read_text())):
        assert time.monotonic() < end
        time.sleep(0.01)


def test_ctrl_c_ends_a_library_that_hangs(tmp_path: Path) -> None:
    path, child = tmp_path / "a.h5", tmp_path / "child.py"
    taxel.convert(some_events(20), path)
    child.write_text(BLOCKED)
    opening = "import sys, pathlib, taxel; from taxel._base import h5_file; "
    opening += "h5_file._CHILD = pathlib.Path(sys.argv[2]); taxel.open(sys.argv[1])"
    process = subprocess.Popen([sys.executable, "-c", opening, path, child], stderr=subprocess.PIPE)
    written = tmp_path / "child.pid"
    end = time.monotonic() + 120
    while not (written.exists() and written.read_text()):
        assert time.monotonic() < end
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert b"KeyboardInterrupt" in said
    assert gone(int(written.read_text()))


def test_a_library_that_ends_is_said_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, child = tmp_path / "a.h5", tmp_path / "child.py"
    taxel.convert(some_events(20), path)
    child.write_text("import os, signal\nprint('{}', flush=True)\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setattr(h5_file, "_CHILD", child)
    with pytest.raises(FormatError, match="the library crashed while reading it, status -11"):
        taxel.open(path)


def test_numbers_of_every_kind_come_from_the_child_as_they_are(tmp_path: Path) -> None:
    import h5py

    draw = np.random.default_rng(5)
    sets = {
        "large": draw.integers(0, 9, (3000, 700)).astype(np.int32), "one": np.array(7.5), "none": np.zeros((0, 3)),
        "truth": draw.random(50) < 0.5, "big_end": np.arange(9, dtype=">i2"),
    }  # fmt: skip
    with h5py.File(tmp_path / "a.h5", "w") as h5:
        for name, values in sets.items():
            h5[name] = values
        h5.create_dataset("packed", data=sets["large"], chunks=(7, 700), compression="gzip")
        h5["word"] = "five"
        h5.create_group("inner")
        h5.attrs["taxel"] = 1
        h5.attrs["name"] = "none"
    with H5File(tmp_path / "a.h5") as file:
        assert [file.attribute(name) for name in ("taxel", "name", "other")] == [1, "none", None]
        for name, values in {**sets, "packed": sets["large"]}.items():
            read = file.numbers(name)
            assert (read.dtype, read.shape) == (values.dtype, values.shape)
            np.testing.assert_array_equal(read, values)
        assert file.text("word") == "five"
        with pytest.raises(FormatError, match="data set inner: a group"):
            file.numbers("inner")
        with pytest.raises(FormatError, match="must be a text"):
            file.text("one")


def test_data_sets_in_groups_are_listed_by_path_however_they_are_linked(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "a.h5", "w") as h5:
        h5["run1/deep/pressure"] = values = np.arange(24, dtype=np.int16).reshape(4, 2, 3)
        h5["run1/back"] = h5["run1"]
        h5["run1/none"] = h5py.Empty("f")
        h5["run1/lost"] = h5py.SoftLink("/nowhere")
        h5["soft"] = h5py.SoftLink("/run1/deep/pressure")
    with H5File(tmp_path / "a.h5") as file:
        listed = {name: entry.shape for name, entry in file.entries.items() if entry.is_numbers}
        assert listed == {"soft": (4, 2, 3), "run1/deep/pressure": (4, 2, 3)}
        assert set(file.entries) - set(listed) == {"run1", "run1/back", "run1/deep", "run1/none"}
        np.testing.assert_array_equal(file.numbers("run1/deep/pressure"), values)


def test_a_damaged_file_is_one_error_or_reads(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    taxel.convert(some_events(200), path)
    whole, draw = path.read_bytes(), np.random.default_rng(3)
    for _ in range(4):
        data = bytearray(whole)
        for place in draw.integers(8, len(data), 4):
            data[place] = draw.integers(0, 256)
        path.write_bytes(bytes(data[: int(draw.integers(len(data) // 2, len(data)))]))
        with contextlib.suppress(FormatError):
            taxel.open(path)


def test_a_flipped_bit_of_the_values_is_told(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.h5"
    taxel.convert(some_events(3000), path)
    with h5py.File(path) as file:
        chunks = [file[name].id.get_chunk_info(0) for name in file if file[name].chunks and file[name].size]
    whole, draw = path.read_bytes(), np.random.default_rng(5)
    assert len(chunks) >= 4
    for chunk in chunks:
        data = bytearray(whole)
        data[chunk.byte_offset + int(draw.integers(chunk.size))] ^= 1 << int(draw.integers(8))
        path.write_bytes(bytes(data))
        with pytest.raises(FormatError, match=r"a\.h5") as raised:
            taxel.open(path)
        # What the memory of a failed read still holds is no cause.
        assert "exported pointers" not in str(raised.value)


def test_the_library_is_not_asked_whose_a_file_without_our_name_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    h5py = pytest.importorskip("h5py")
    taxel.convert(some_events(), tmp_path / "ours.h5")
    with h5py.File(tmp_path / "subj000.h5", "w") as theirs:
        theirs["img000"] = np.ones((3, 3, 3), np.uint16)
    (tmp_path / "empty.h5").write_bytes(b"")
    assert [is_h5_of_taxel(tmp_path / f"{name}.h5") for name in ("ours", "subj000", "empty", "none")] == [True] + 3 * [
        False
    ]
    asked: list[Path] = []
    monkeypatch.setattr(read_h5, "H5File", lambda path: contextlib.nullcontext(asked.append(path)))
    assert [is_h5_of_taxel(tmp_path / f"{name}.h5") for name in ("subj000", "empty", "none")] == 3 * [False]
    assert not asked
