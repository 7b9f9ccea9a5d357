"""A full disk, a forbidden folder, a missing one: one clear error, and what was written can be read."""

from __future__ import annotations

import errno
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from draws import mixed

import taxel
from taxel import _core
from taxel.live import Live

from .making import HEADER, some_events


@contextmanager
def no_file_beyond(limit: int) -> Iterator[None]:
    """Let no file of this process grow beyond so many bytes, as on a disk that is full then."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(("compression", "limit"), mixed(["none", "lz4"], [60_000, 1_000_000, 2_345_678]))
def test_a_disk_that_fills_up_is_one_error_and_leaves_a_readable_file(
    tmp_path: Path, compression: str, limit: int
) -> None:
    path, draw, sent = tmp_path / "full.mcap", np.random.default_rng(1), []

    def record() -> None:
        writer = _core.RecordingWriter(path, json.dumps(HEADER), compression, False)
        for k in range(5000):
            writer.datagram(1000 + k, k, draw.bytes(1400))
            sent.append(k)
        writer.finish("{}")

    with no_file_beyond(limit), pytest.raises(OSError, match="File too large") as error:
        record()
    assert (error.value.errno, error.value.filename) == (errno.EFBIG, str(path))
    assert "\n" not in str(error.value)
    rec = taxel.open(path)
    kept = rec.datagrams()
    assert 0 <= len(kept) <= len(sent)
    assert np.array_equal(kept.number, np.arange(len(kept)))
    assert rec.truncated
    assert rec.rebuilt["torn_bytes"] == 0, "what was torn is cut off"
    # What a reader loses is what waited in memory, not what the disk had taken.
    assert path.stat().st_size <= limit


def test_a_full_device_is_an_oserror_that_names_it(full_device: Path) -> None:
    with pytest.raises(OSError, match="No space left on device") as caught:
        _core.RecordingWriter(full_device, json.dumps(HEADER), "none", True)
    assert caught.value.errno == errno.ENOSPC
    assert caught.value.filename == "/dev/full"


@pytest.mark.parametrize("ending", [".mcap", ".lsa", ".npz", ".csv", ".h5"])
def test_an_existing_file_is_never_overwritten_unless_asked(tmp_path: Path, ending: str) -> None:
    path, events = tmp_path / f"a{ending}", some_events(50)
    path.write_bytes(b"precious")
    with pytest.raises(FileExistsError, match=f"a{ending}"):
        taxel.convert(events, path)
    assert path.read_bytes() == b"precious"
    taxel.convert(events, path, overwrite=True)
    assert len(taxel.open(path).events) == 50
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([path.name] + ["a.lss"] * (ending == ".lsa"))


@pytest.mark.parametrize("ending", [".mcap", ".lsa", ".npz", ".csv", ".h5"])
def test_a_missing_folder_is_a_file_not_found(tmp_path: Path, ending: str) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        taxel.convert(some_events(5), tmp_path / "nowhere" / f"a{ending}")


@pytest.mark.parametrize("ending", [".mcap", ".lsa", ".npz", ".csv", ".h5"])
@pytest.mark.parametrize("older", [False, True])
def test_a_conversion_that_fails_leaves_no_file_and_an_older_one_whole(
    tmp_path: Path, ending: str, older: bool
) -> None:
    path = tmp_path / f"a{ending}"
    if older:
        taxel.convert(some_events(50), path)
    before = {one.name: one.read_bytes() for one in tmp_path.iterdir()}
    events = some_events(100_000)
    with no_file_beyond(20_000), pytest.raises(OSError, match="File too large") as error:
        taxel.convert(events, path, overwrite=True)
    assert (error.value.errno, error.value.filename) == (errno.EFBIG, str(path))
    assert {one.name: one.read_bytes() for one in tmp_path.iterdir()} == before


@pytest.mark.parametrize("ending", [".mcap", ".lsa", ".npz", ".csv", ".h5"])
def test_a_write_protected_file_is_never_replaced(tmp_path: Path, ending: str) -> None:
    """A rename asks the folder alone, and the superuser may do all: neither counts."""
    path = tmp_path / f"a{ending}"
    path.write_bytes(b"precious")
    path.chmod(0o444)
    with pytest.raises(PermissionError):
        taxel.convert(some_events(5), path, overwrite=True)
    if ending == ".mcap":
        with pytest.raises(PermissionError):
            Live(port=0, host="127.0.0.1", record=path, overwrite=True)
    assert path.read_bytes() == b"precious"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_a_recording_to_which_nothing_came_leaves_no_file_unless_something_was_noted(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with Live(port=0, host="127.0.0.1", record=path) as live:
        assert live.stop().path is None
    assert list(tmp_path.iterdir()) == []
    with Live(port=0, host="127.0.0.1", record=path) as live:
        live.note("the board is off")
        assert live.stop().path == path
    assert [n.text for n in taxel.open(path).notes] == ["the board is off"]
