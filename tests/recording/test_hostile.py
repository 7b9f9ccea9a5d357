"""Damaged and hostile files of every format: an answer or one line, in bounded memory and work."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from refusal import refused_saying as refused

import taxel
from taxel import formats
from taxel._base import limits
from taxel._core import FormatError, ProblemError
from taxel.cli._recordings import assignments
from taxel.live import Live

from . import hostile
from .making import record, some_events

SCRIPT = Path(hostile.__file__)


def spoil(names: Iterable[str], seed: int, first: int, count: int, folder: Path) -> None:
    """Spoil files in a process of their own, whose memory and work are bounded, and look at how each ended."""
    arguments = [",".join(names), str(seed), str(first), str(count), str(folder)]
    # One thread: a pool of threads asks for memory that the bound would count.
    alone = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, SCRIPT, *arguments], check=False, capture_output=True, text=True, env=alone)
    said = [json.loads(line) for line in done.stdout.splitlines()]
    wrong = [entry["wrong"] for entry in said if "wrong" in entry]
    assert not wrong, f"{len(wrong)} of seed {seed}, first: {wrong[0]}"
    at = [entry["at"] for entry in said if "at" in entry][-1:]
    assert (done.returncode, said[-1:]) == (0, [{"done": True}]), f"{arguments} ended at {at}: {done.stderr[-2000:]}"


def test_every_format_has_files_to_spoil() -> None:
    """A format without a maker of small files cannot be tried: add write_NAME to tests/formats/making.py."""
    assert set(formats.FORMATS) <= set(hostile.KINDS)


def test_a_spoilt_file_is_read_or_refused_in_one_line(tmp_path: Path) -> None:
    """All kinds in one process, which takes longer to begin than to read a few small files."""
    spoil(hostile.KINDS, 1, 0, 2, tmp_path)


@pytest.mark.slow
@pytest.mark.timeout(3000)
@pytest.mark.parametrize("name", hostile.KINDS)
def test_a_thousand_spoilt_files_are_read_or_refused_in_one_line(name: str, tmp_path: Path) -> None:
    spoil([name], 2, 0, 1000, tmp_path)


# files that ask for far more than they hold


def unreadable(path: Path, said: str) -> None:
    with refused(said, FormatError):
        assert taxel.open(path).events is not None


def npz(path: Path, name: str, member: bytes) -> Path:
    """Write events whose array `name` is replaced by other bytes."""
    taxel.convert(some_events(), path, overwrite=True)
    with zipfile.ZipFile(path) as archive:
        members = {n: archive.read(n) for n in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for n, content in {**members, f"{name}.npy": member}.items():
            archive.writestr(n, content)
    return path


def described(descr: str, shape: str) -> bytes:
    text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


def test_a_declared_shape_of_a_million_millions_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    unreadable(
        npz(path, "t", described("<i8", f"({10**12},)")), r"x has shape \(400,\): must be one value for each event"
    )
    with zipfile.ZipFile(path, "w") as archive:
        for name, kind in {"t": "<i8", "x": "<u2", "y": "<u2", "p": "|b1"}.items():
            archive.writestr(f"{name}.npy", described(kind, f"({10**12},)"))
    unreadable(path, "array t: would take 8000000000000 bytes")
    unreadable(npz(path, "t", described("<i8", "(400,)")), r"array t: 0 bytes of values; must be 3200")


def test_a_huge_text_in_a_description_is_refused(tmp_path: Path) -> None:
    huge = described("<U500000000", "()")
    unreadable(npz(tmp_path / "a.npz", "about", huge), "array about: would take 2000000000 .* at most 134217728")
    unreadable(
        npz(tmp_path / "a.npz", "about", described("<U2000000000", "()")), "the .npz file is damaged or not complete"
    )


def test_a_sensor_that_is_too_large_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, t=[0], x=[60_000], y=[60_000], p=[True])
    unreadable(path, f"60001 x 60001 taxels; must have at most {limits.TAXELS}")
    huge = {"rows": 65_535, "columns": 65_535, "pitch_mm": 1.0, "name": ""}
    with pytest.raises(taxel.ProblemError, match="65535 x 65535 taxels; must have at most"):
        record(tmp_path / "a.mcap", some_events(), header={"array": huge})
    packed(tmp_path / "b.mcap", 1, array=huge)
    unreadable(tmp_path / "b.mcap", "65535 x 65535 taxels; must have at most")


def test_a_time_out_of_all_reason_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(f"t_us,x,y,p\n0,1,1,1\n{2**62},1,1,0\n")
    unreadable(path, "time 1: .* must be within .*142 years")


def test_a_table_of_very_many_columns_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t_us" + ",a" * 3_000_000 + "\n")
    unreadable(path, f"line 1: 3000001 columns; must have at most {limits.COLUMNS}")
    path.write_text("t_us,x0y0,x2000y2000\n" + "".join(f"{k},1,1\n" for k in range(1000)))
    unreadable(path, "most are missing")


def say_size(path: Path, chunk: int, size: int) -> None:
    """Write into a chunk what it says that it unpacks to."""
    data = bytearray(path.read_bytes())
    at, number = 8, 0
    while at + 9 <= len(data):
        if data[at] == 6:
            if number == chunk:
                data[at + 25 : at + 33] = struct.pack("<Q", size)
            number += 1
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    assert number > chunk
    path.write_bytes(data)


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
@pytest.mark.parametrize("size", [1 << 30, 1 << 40, 1 << 63])
def test_a_chunk_that_says_it_unpacks_to_more_than_a_chunk_may_is_left_out_and_said(
    tmp_path: Path, compression: str, size: int
) -> None:
    path = tmp_path / "a.mcap"
    record(path, some_events(), compression=compression)
    say_size(path, 0, size)
    rec = taxel.open(path)
    assert rec.rebuilt["large_chunks"] == 1
    assert "1 chunk skipped, because the stated unpacked size is above 64 MiB" in rec.verdict


def packed(path: Path, count: int, **told: object) -> None:
    """Write datagrams that pack by hundreds, by a writer that is not ours, whose header may say otherwise."""
    record(path.with_suffix(".own.mcap"), some_events(40))
    with path.with_suffix(".own.mcap").open("rb") as file:
        header = next(m.metadata for m in make_reader(file).iter_metadata() if m.name == "taxel")
    header["header"] = json.dumps({**json.loads(header["header"]), **told})
    with path.open("wb") as out:
        writer = Writer(out, chunk_size=8 << 20, compression=CompressionType.ZSTD)
        writer.start()
        writer.add_metadata("taxel", header)
        channel = writer.register_channel(topic="/datagrams", message_encoding="taxel.wire.v1", schema_id=0)
        for k in range(count):
            writer.add_message(channel, log_time=k, publish_time=k, data=bytes(65_000), sequence=k)
        writer.finish()


def test_datagrams_that_unpack_to_far_more_than_the_file_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "trap.mcap"
    packed(path, 1500)
    assert path.stat().st_size < 200_000
    unreadable(
        path, r"unpack to \d+ bytes; at most \d+ are read \(100 times the file and 64 MiB\); a larger limit reads more"
    )
    assert len(taxel.open(path, limit=1 << 30).datagrams()) == 1500


def test_what_is_just_within_the_limits_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    packed(path, 900)
    assert len(taxel.open(path).datagrams()) == 900
    table = tmp_path / "a.csv"
    names = ",".join(f"x{k % 256}y{k // 256}" for k in range(limits.COLUMNS - 1))
    table.write_text(f"t_us,{names}\n" + ",".join(["0"] * limits.COLUMNS) + "\n")
    assert taxel.open(table).frames().values.shape == (1, 256, 256)


# what other libraries read for taxel


def named(path: Path) -> bool:
    """Open a damaged file; return whether it was refused, in one line that names it."""
    said = ""
    try:
        taxel.open(path).frames()
    except FormatError as error:
        said = str(error)
    assert not said or (str(path) in said and "\n" not in said)
    return bool(said)


def test_a_damaged_block_of_a_bag_in_bz2_is_refused_by_name(tmp_path: Path) -> None:
    path = hostile.KINDS["bag-bag-bz2"](tmp_path)
    data = path.read_bytes()
    blocks = [at for at in range(len(data)) if data.startswith(b"BZh", at)]
    refused_at = []
    for at in blocks:
        path.write_bytes(data[: at + 40] + bytes([data[at + 40] ^ 0xFF]) + data[at + 41 :])
        refused_at += [at] * named(path)
    assert refused_at == blocks != []


@pytest.mark.parametrize("size", [1 << 40, (1 << 62) + 7])
@pytest.mark.parametrize("kind", ["none", "storage", "lz4"])
def test_a_part_of_a_bag_that_says_it_is_huge_is_refused_by_name(kind: str, size: int, tmp_path: Path) -> None:
    path = hostile.KINDS[f"bag-mcap-{kind}"](tmp_path)
    data, at, count = path.read_bytes(), 8, 0
    while at + 9 <= len(data) - 8:
        path.write_bytes(data[: at + 1] + struct.pack("<Q", size) + data[at + 9 :])
        count += named(path)
        if data[at] == 6:  # a chunk, with the sizes of what it holds
            for field in (at + 25, at + 41):
                path.write_bytes(data[:field] + struct.pack("<Q", size) + data[field + 8 :])
                count += named(path)
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    assert count > 3


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '<i8', 'fortran_order': False, 'shape': (50, 4, 5), ",
        b"{'descr': '<i8', 'fortran_order': False, 'shape': (50, 4, 5), }\x00(",
        b"{'descr': '<i8', 'fortran_order': False, 'shape': (1000000000000, 4, 5), }",
        b"{'descr': '|O', 'fortran_order': False, 'shape': (50, 4, 5), }",
        b"{'descr': '<U9999999999', 'fortran_order': False, 'shape': (50, 4, 5), }",
        b"((((((((((((((((((((((((((((((",
        b"",
    ],
)
@pytest.mark.parametrize("ending", [".npy", ".npz"])
def test_an_array_with_a_damaged_description_beside_a_layout_is_refused_by_name(
    ending: str, header: bytes, tmp_path: Path
) -> None:
    path = hostile.KINDS[f"{ending[1:]}-layout"](tmp_path)
    array = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + bytes(8000)
    if ending == ".npy":
        path.write_bytes(array)
    else:
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("pressure.npy", array)
            archive.writestr("seconds.npy", array)
    assert named(path)


def test_times_that_are_no_numbers_are_refused_by_name(tmp_path: Path) -> None:
    path = hostile.KINDS["npz-layout"](tmp_path)
    for seconds in (np.zeros(50, "V8"), np.full(50, "x"), np.zeros(50, "M8[s]"), np.zeros(50, complex)):
        np.savez(path, pressure=np.zeros((50, 4, 5)), seconds=seconds)
        assert named(path)


# what is write-protected, and what stays empty


@pytest.mark.parametrize("ending", [".mcap", ".lsa", ".npz", ".csv", ".h5"])
def test_a_write_protected_file_is_never_replaced(tmp_path: Path, ending: str) -> None:
    """A rename asks the folder alone, and the superuser may do all: neither counts."""
    path = tmp_path / f"a{ending}"
    path.write_bytes(b"precious")
    path.chmod(0o444)
    with pytest.raises(PermissionError, match=f"a{ending}"):
        taxel.convert(some_events(5), path, overwrite=True)
    if ending in {".mcap", ".lsa"}:
        with pytest.raises(PermissionError, match=f"a{ending}"):
            Live(port=0, host="127.0.0.1", record=path, overwrite=True)
    assert path.read_bytes() == b"precious"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("ending", [".mcap", ".lsa"])
def test_a_recording_to_which_nothing_came_leaves_no_file_unless_something_was_noted(
    tmp_path: Path, ending: str
) -> None:
    path = tmp_path / f"a{ending}"
    with Live(port=0, host="127.0.0.1", record=path) as live:
        assert live.stop().path is None
    assert list(tmp_path.iterdir()) == []
    if ending == ".mcap":
        with Live(port=0, host="127.0.0.1", record=path) as live:
            live.note("the board is off")
            assert live.stop().path == path
        assert [n.text for n in taxel.open(path).notes] == ["the board is off"]


def test_a_long_name_of_a_column_does_not_fill_an_error(tmp_path: Path) -> None:
    (tmp_path / "layout.toml").write_text("rows = 1\ncolumns = 2\nrate_hz = 10\n")
    (path := tmp_path / "a.csv").write_text(f"{'n' * 100_000},b\nx,1\n")
    with pytest.raises(FormatError, match=r"a.csv, line 2: column 'nnn.*is 'x', not a number") as caught:
        taxel.open(path)
    assert len(str(caught.value)) < 300
    with pytest.raises(ProblemError, match="must be KEY=VALUE") as wrong:
        assignments(["[" * 100_000])
    assert len(str(wrong.value)) < 300


@pytest.mark.parametrize("names", ["x{k}y0", "n{k}"])
def test_a_table_of_too_many_columns_is_named(names: str, tmp_path: Path) -> None:
    columns = ",".join(names.format(k=k) for k in range(65_536))
    (path := tmp_path / "a.csv").write_text(f"t_us,{columns}\n0{',1' * 65_536}\n")
    with pytest.raises(FormatError, match=r"a.csv, line 1: columns is 65536: must be"):
        taxel.open(path)
