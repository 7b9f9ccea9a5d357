"""What a .npz or .h5 holds is what was written, or it is refused."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from draws import mixed

import taxel
from taxel._core import FormatError
from taxel.recording.contents import Contents
from taxel.recording.once import known
from taxel.recording.readers.npz import source_of_columns
from taxel.recording.verdict import Verdict
from taxel.recording.writers.npz import columns_of

from .making import record, some_events, some_frames

DAMAGED = "the file is damaged: its content differs from what was written"


def converted(folder: Path, kind: str) -> Path:
    """Write a recording with markers, held values and a verdict that has lost something."""
    record(folder / "a.mcap", some_events(3000))
    contents = taxel.open(folder / "a.mcap")._contents
    lost = Verdict._of({"counts": {"received": 5, "recorded": 5, "dropped_by_kernel": 12345}})
    held = np.full((64, 64), 3, np.uint16)
    path = folder / f"b.{kind}"
    one = replace(contents.main, losses=replace(contents.main.losses, verdict=known(lost)))
    one = replace(one, settings=replace(one.settings, held=known(held)))
    taxel.convert(taxel.Recording(Contents.single(one)), path)
    assert "12345" in taxel.open(path).verdict
    return path


def flipped(path: Path, at: int, bit: int = 1) -> None:
    data = bytearray(path.read_bytes())
    data[at] ^= bit
    path.write_bytes(data)


@pytest.mark.parametrize("column", ["markers", "held", "present", "about"])
def test_a_bit_in_a_name_of_a_zip_directory_hides_no_column(column: str, tmp_path: Path) -> None:
    path = converted(tmp_path, "npz")
    flipped(path, path.read_bytes().rindex(f"{column}.npy".encode()))
    with pytest.raises(FormatError):
        taxel.open(path)


def test_a_bit_in_a_chunk_index_zeroes_no_column(tmp_path: Path) -> None:
    path = converted(tmp_path, "h5")
    data = path.read_bytes()
    # The indices of chunks are the nodes of type 1, with a number of chunks behind level and type: none are left.
    nodes = [found.start() for found in re.finditer(rb"TREE\x01\x00\x01\x00", data)]
    assert len(nodes) > 5
    for node in nodes:
        flipped(path, node + 6)
        with pytest.raises(FormatError, match=f"^{re.escape(str(path))}: ({DAMAGED}$|the HDF5 file is damaged)"):
            taxel.open(path)
        path.write_bytes(data)


def in_npz(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    with zipfile.ZipFile(path) as archive:
        columns = {name[:-4]: np.load(io.BytesIO(archive.read(name))) for name in archive.namelist()}
    change(columns)
    np.savez(path, **columns)


def in_h5(path: Path, change: Callable[[dict[str, Any]], None]) -> None:
    import h5py

    with h5py.File(path, "r+") as h5:
        columns = {name: h5[name].asstr()[()] if name == "about" else h5[name][()] for name in h5}
        change(columns)
        for name in list(h5):
            del h5[name]
        for name, column in columns.items():
            h5[name] = str(column) if name == "about" else column


def fewer_lost(columns: dict[str, Any]) -> None:
    columns["about"] = np.array(str(columns["about"]).replace("12345", "10345"))


def a_tick(columns: dict[str, Any]) -> None:
    columns["intensity"][7] ^= 1


def no_held(columns: dict[str, Any]) -> None:
    del columns["held"]


def another_digest(columns: dict[str, Any]) -> None:
    columns["digest"] = columns["digest"][:8]


@pytest.mark.parametrize(
    ("change", "kept"), mixed([fewer_lost, a_tick, no_held, another_digest], [("npz", in_npz), ("h5", in_h5)])
)
def test_what_is_not_as_written_is_refused_but_opens_without_its_checksum(
    kept: tuple[str, Callable[..., None]], change: Callable[..., None], tmp_path: Path
) -> None:
    kind, within = kept
    path = converted(tmp_path, kind)
    within(path, change)
    with pytest.raises(FormatError, match=f"^{re.escape(str(path))}: {DAMAGED}$"):
        taxel.open(path)
    # As of files that are changed on purpose.
    within(path, lambda columns: columns.pop("digest"))
    assert len(taxel.open(path).events) == 3000


@pytest.mark.parametrize("order", ["C", "F"])
def test_both_formats_have_the_checksum_that_the_page_states(order: Any, tmp_path: Path) -> None:
    import hashlib

    import h5py

    drawn = some_frames(900, (40, 30))
    frames = taxel.Frames(np.asarray(drawn.values, order=order), drawn.t)
    taxel.convert(frames, tmp_path / "a.npz")
    taxel.convert(frames, tmp_path / "a.h5")
    columns = dict(np.load(tmp_path / "a.npz"))
    digest = columns.pop("digest")
    stated = hashlib.blake2b(digest_size=16)
    for name, column in sorted(columns.items()):
        stated.update(json.dumps([name, column.dtype.str, column.shape]).encode() + b"\n" + column.tobytes())
    assert digest.tobytes() == stated.digest()
    with h5py.File(tmp_path / "a.h5") as h5:
        assert h5["digest"][()].tobytes() == stated.digest()
    for kind in ("npz", "h5"):
        assert np.array_equal(taxel.open(tmp_path / f"a.{kind}").frames().values, drawn.values)


def test_rows_without_bytes_take_no_time(tmp_path: Path) -> None:
    columns = columns_of(taxel.open(converted(tmp_path, "npz"))._contents.main) | {
        "held": np.empty((2**60, 0), np.uint16)
    }
    with pytest.raises(FormatError, match=DAMAGED):
        source_of_columns(tmp_path / "b.npz", "npz", columns, None)


def test_merged_recordings_have_their_doubtful_times_by_the_merged_times(tmp_path: Path) -> None:
    parts = []
    for name, after in (("a", None), ("b", 700)):
        record(tmp_path / f"{name}.mcap", some_events(300))
        told = "nothing lost" if after is None else "nothing lost; times after 700 us are doubtful"
        status = "complete" if after is None else "damaged"
        verdict = Verdict.from_dict({"status": status, "text": told, "doubtful_after_us": after})
        one = taxel.open(tmp_path / f"{name}.mcap")._contents.main
        one = replace(one, losses=replace(one.losses, verdict=known(verdict)))
        parts.append(taxel.Recording(Contents.single(one)))
    merged = taxel.merge(parts, gap_us=1000)
    shift = int(merged.events.t[300] - parts[1].events.t[0])
    assert shift > 1000
    of_b = merged.verdict.parts["b.mcap"]
    assert (of_b.doubtful_after_us, merged.verdict.doubtful_after_us) == (700 + shift, 700 + shift)
    assert f"times after {700 + shift} us are doubtful" in of_b
    assert str(of_b) in merged.verdict
    assert Verdict.from_dict(merged.verdict.to_dict()).to_dict() == merged.verdict.to_dict()
