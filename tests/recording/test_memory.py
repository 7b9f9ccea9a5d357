"""The memory of opening a recording: little beside its arrays, and no more than there is, or than a caller allows."""

from __future__ import annotations

import gzip
import json
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import psutil
import pytest
from draws import mixed
from formats import bags
from refusal import refused_saying as refused
from rosbags import rosbag1, rosbag2

import taxel
from taxel import FormatError, ProblemError, formats
from taxel._base import limits
from taxel._base.columns import Growing
from taxel.cli import main

from . import large
from .hostile import KINDS as SMALL
from .making import some_events

MIB = 1 << 20


@pytest.fixture(scope="module")
def opener() -> Iterator[subprocess.Popen[str]]:
    """A process that opens recordings, each in a child of its own."""
    command = [sys.executable, large.__file__]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield process


Opened = Callable[..., dict[str, Any]]


@pytest.fixture
def opened(opener: subprocess.Popen[str]) -> Opened:
    """Opens a recording in a process of its own, within so many bytes of addresses; says what it took of memory."""

    def one(path: Path, *, at_most: int = 0, **how: Any) -> dict[str, Any]:
        assert opener.stdin is not None
        assert opener.stdout is not None
        print(json.dumps([str(path), at_most, how]), file=opener.stdin, flush=True)
        said: dict[str, Any] = json.loads(opener.stdout.readline())
        assert "ended" not in said, f"{path}: its process ended with {said}"
        return said

    return one


@pytest.mark.parametrize("kind", large.QUICK)
def test_little_memory_is_taken_beside_the_arrays(kind: str, tmp_path: Path, opened: Opened) -> None:
    sizes = {}
    for size in (MIB, 24 * MIB):
        (folder := tmp_path / str(size)).mkdir()
        sizes[size] = opened(large.KINDS[kind](folder, size))
    small, whole = sizes.values()
    assert whole["arrays"] > 20 * MIB
    # What a process takes for itself does not count here, so that 24 MiB show the ratio.
    assert whole["peak"] - small["peak"] <= 1.5 * whole["arrays"] + 8 * MIB


@pytest.mark.slow
@pytest.mark.timeout(3000)
@pytest.mark.parametrize("kind", large.KINDS)
def test_at_most_half_of_the_arrays_and_256_mib_are_taken_beside_them(
    kind: str, tmp_path: Path, opened: Opened
) -> None:
    said = opened(large.KINDS[kind](tmp_path, 256 * MIB))
    assert said["arrays"] > 200 * MIB
    assert said["peak"] <= 1.5 * said["arrays"] + 256 * MIB


def test_every_format_of_another_maker_is_among_the_large_files() -> None:
    assert set(formats.FORMATS) <= set(large.KINDS)


# what is larger than may be read


@pytest.mark.parametrize("kind", SMALL)
def test_a_limit_refuses_what_is_larger_and_names_both_sizes(kind: str, tmp_path: Path) -> None:
    path = SMALL[kind](tmp_path)

    def read(limit: int) -> int:
        return large.arrays_of(taxel.open_all(path, limit=limit))

    with refused(r"\d{2,} bytes.* at most 10 .*; a larger limit reads more", FormatError):
        read(10)
    assert read(1 << 40) > 10


@pytest.mark.parametrize("limit", [0, -1, 1.5, "1 GB", True])
def test_a_limit_is_a_number_of_bytes(limit: object, tmp_path: Path) -> None:
    taxel.convert(some_events(), tmp_path / "a.npz")
    with refused("limit is"):
        taxel.open(tmp_path / "a.npz", limit=limit)


def test_the_recordings_of_a_folder_count_together(tmp_path: Path) -> None:
    size = 0
    for k in range(4):
        taxel.convert(some_events(), tmp_path / f"{k}.npz")
        size = large.arrays_of(taxel.open_all(tmp_path / f"{k}.npz"))
    with refused("; a larger limit reads more", FormatError):
        taxel.open_all(tmp_path, limit=3 * size)
    assert len(taxel.open_all(tmp_path, limit=100 * size)) == 4


def gzip_bomb(folder: Path) -> Path:
    """Write a table of 6 MB that unpacks to 1.7 GB."""
    part = gzip.compress((b"0," * 49 + b"0\n") * 100_000)
    with (folder / "a.csv.gz").open("wb") as file:
        for _ in range(170):
            file.write(part)
    (folder / "layout.toml").write_text("rows = 1\ncolumns = 50\nrate_hz = 100\n")
    return folder / "a.csv.gz"


def npz_bomb(folder: Path, pieces: int = 300) -> Path:
    """Write frames of 300 MiB in .3 MB; of the 3 GiB of 3 times 1024 pieces the file holds the description alone."""
    with zipfile.ZipFile(folder / "a.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        n = pieces << 8
        for name, descr, shape in (("values", "<f4", (n, 32, 32)), ("t", "<i8", (n,))):
            with archive.open(f"{name}.npy", "w", force_zip64=True) as file:
                np.lib.format.write_array_header_1_0(file, {"descr": descr, "fortran_order": False, "shape": shape})
                for _ in range(1 if name == "t" or pieces > 1000 else pieces):
                    file.write(bytes(8 * n if name == "t" else 1 << 20))
    return folder / "a.npz"


@pytest.mark.parametrize("write", [gzip_bomb, npz_bomb])
def test_a_small_file_that_unpacks_to_gigabytes_is_refused_before_it_takes_them(
    write: Any, tmp_path: Path, opened: Opened
) -> None:
    path = write(tmp_path)
    assert path.stat().st_size < 8_000_000
    said = opened(path, limit=100_000_000)
    assert "; a larger limit reads more" in said["refused"]
    assert said["peak"] < 256 * MIB


def test_a_recording_that_is_larger_than_what_is_available_is_refused_with_both_sizes(
    tmp_path: Path, opened: Opened
) -> None:
    """A process that may address 2 GiB has less than 1.5 GiB for a recording."""
    said = opened(npz_bomb(tmp_path, 3 << 10), at_most=2048 * MIB)
    assert "would take 3221225472 bytes" in said["refused"]
    assert "(3/4 of the memory that is available); a larger limit" in said["refused"]


@pytest.mark.parametrize("ending", [".bag", ".mcap"])
def test_a_chunk_of_a_bag_that_unpacks_to_too_much_is_refused(ending: str, tmp_path: Path, opened: Opened) -> None:
    """68 MB of zeros are some kilobytes of bz2 and of zstd."""
    path = bags.write(tmp_path / f"a{ending}", [("/hand", bags.HAND, 1.0, 1.0, bags.hand([0.0] * 8_500_000, [1.0]))])
    assert path.stat().st_size > 68_000_000
    write_packed(path)
    assert path.stat().st_size < 200_000
    said = opened(path, topic="/hand", field="thumb")
    assert re.search(r"an unpacked chunk has (more than 67108864|68\d{6}) bytes; must have at most ", said["refused"])
    assert said["peak"] < 256 * MIB


def write_packed(path: Path) -> None:
    """Write a bag anew with its chunks packed."""
    to = path.with_name("packed")
    if path.suffix == ".bag":
        writer: Any = rosbag1.Writer(to)
        writer.set_compression(rosbag1.Writer.CompressionFormat.BZ2)
        reader: Any = rosbag1.Reader(path)
        types = bags.store(bags.Stores.ROS1_NOETIC)
    else:
        writer = rosbag2.Writer(to, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
        writer.set_compression(rosbag2.CompressionMode.STORAGE, rosbag2.CompressionFormat.ZSTD)
        reader, types = rosbag2.Reader(path), bags.store()
    with reader, writer:
        for connection in reader.connections:
            own = writer.add_connection(connection.topic, connection.msgtype, typestore=types)
            for _, at, data in reader.messages([connection]):
                writer.write(own, at, data)
    path.unlink()
    (to if path.suffix == ".bag" else next(to.glob("*.mcap"))).rename(path)


def test_large_frames_of_one_value_open_whatever_they_are_packed_to(tmp_path: Path) -> None:
    """What taxel wrote always opens, though a bomb is packed as well."""
    frames = taxel.Frames(np.zeros((100, 512, 512), np.float32), np.arange(100) * 1000)
    path = tmp_path / "a.mcap"
    taxel.convert(frames, path, compression="zstd")
    assert 2 * frames.values.size > 1000 * path.stat().st_size
    assert taxel.open(path).frames() == frames


def frames(dtype: str, size: int, order: Any = "C") -> np.ndarray[Any, Any]:
    """Return frames that take so many bytes as float32."""
    return np.ones((size // 4 // 4096, 64, 64), dtype, order)


def of_anybody(folder: Path, size: int, kind: str, dtype: str) -> Path:
    """Write frames as people save them, of any dtype and order."""
    values = frames(dtype.removesuffix(" F"), size, "F" if dtype.endswith("F") else "C")
    t = np.arange(len(values))
    path = folder / f"a.{kind.partition(' ')[0]}"
    if kind == "h5":
        with h5py.File(path, "w") as h5:
            h5.attrs["taxel"] = 1
            h5.create_dataset("values", data=values, compression="gzip", compression_opts=1)
            h5["t"] = t
    elif kind == "npz":
        np.savez_compressed(path, values=values, t=t)
    else:
        falls = "falls = 9" if kind.endswith("falls") else ""
        of_array = "" if path.suffix == ".npy" else '[data]\narray = "a"\ntime = "s"\n'
        rate = "rate_hz = 100" if path.suffix == ".npy" else ""
        (folder / "layout.toml").write_text(f"rows = 64\ncolumns = 64\n{rate}\n{falls}\n{of_array}")
        if path.suffix == ".npy":
            np.save(path, values)
        else:
            np.savez(path, a=values, s=t / 100)
    return path


@pytest.mark.parametrize(
    ("kind", "dtype"),
    mixed(
        ["npz", "h5", "npy layout", "npz layout", "npy layout falls"], ["u1", "?", ">f4", "f4 F", ">i2", "f8", "f8 F"]
    ),
)
def test_frames_of_every_dtype_are_in_memory_once(kind: str, dtype: str, tmp_path: Path, opened: Opened) -> None:
    sizes = {}
    for size in (MIB, 16 * MIB):
        (folder := tmp_path / str(size)).mkdir()
        sizes[size] = opened(of_anybody(folder, size, kind, dtype))
    small, whole = sizes.values()
    assert whole["arrays"] > 15 * MIB
    assert whole["peak"] - small["peak"] <= 1.4 * whole["arrays"] + 4 * MIB


def test_a_column_of_times_is_in_memory_once(tmp_path: Path, opened: Opened) -> None:
    (tmp_path / "layout.toml").write_text('[data]\narray = "a"\ntime = "s"\n')
    peaks = {}
    for n in (1000, 2_000_000):
        np.savez(tmp_path / "a.npz", a=np.ones((n, 1), "u1"), s=np.arange(n) / 1000)
        peaks[n] = opened(tmp_path / "a.npz")
    small, whole = peaks.values()
    assert whole["peak"] - small["peak"] <= 1.4 * whole["arrays"] + 4 * MIB


@pytest.mark.parametrize(
    ("kind", "of"),
    mixed(["npy", "own h5", "own npz"], [("numbers", "rate_hz = 100"), ("times", "rate_hz = 100\nfalls = 9")]),
)
def test_what_a_layout_says_of_a_single_taxel_takes_little_memory(
    kind: str, of: tuple[str, str], tmp_path: Path, opened: Opened
) -> None:
    t, says = of
    (tmp_path / "layout.toml").write_text(f"{says}\n")
    path = tmp_path / f"a.{kind.rpartition(' ')[2]}"
    peaks = {}
    for n in (1000, 1_000_000):
        values, times = np.ones((n, 1, 1), "u1"), np.arange(n) * (1 if t == "numbers" else 10_000)
        if kind == "npy":
            np.save(path, values)
        else:
            as_file(path, {"values": values, "t": times})
        peaks[n] = opened(path)
    small, whole = peaks.values()
    assert whole["arrays"] == 12 * 1_000_000
    assert whole["peak"] - small["peak"] <= 1.4 * whole["arrays"] + 4 * MIB


@pytest.mark.parametrize("kind", ["npz", "h5"])
def test_frames_of_taxel_itself_that_fall_are_in_memory_once(kind: str, tmp_path: Path, opened: Opened) -> None:
    (tmp_path / "layout.toml").write_text("falls = 9\n")
    n = 1000
    columns = {"values": np.ones((n, 64, 64), "f4"), "t": np.arange(n) * 1000}
    whole = opened(as_file(tmp_path / f"a.{kind}", columns))
    small = opened(as_file(tmp_path / f"a.{kind}", {name: column[:10] for name, column in columns.items()}))
    assert whole["peak"] - small["peak"] <= 1.4 * whole["arrays"] + 4 * MIB


def events_of_anybody(n: int, dtype: str) -> dict[str, Any]:
    """Columns of events, all of one dtype, as `np.savez(t=t, x=x, y=y, p=p)` writes them."""
    ones = dict.fromkeys(("p", "present", "repaired"), np.ones(n, dtype))
    return {"t": np.arange(n, dtype=dtype), **dict.fromkeys(("x", "y", "intensity"), np.full(n, 7, dtype)), **ones}


def as_file(path: Path, columns: dict[str, Any]) -> Path:
    if path.suffix == ".npz":
        np.savez(path, **columns)
    else:
        with h5py.File(path, "w") as h5:
            h5.attrs["taxel"] = 1
            for name, column in columns.items():
                h5[name] = column
    return path


@pytest.mark.parametrize("dtype", ["i8", ">f8"])
@pytest.mark.parametrize("kind", ["npz", "h5"])
def test_events_of_every_dtype_are_in_memory_once(kind: str, dtype: str, tmp_path: Path, opened: Opened) -> None:
    few, many = (opened(as_file(tmp_path / f"{n}.{kind}", events_of_anybody(n, dtype))) for n in (1000, 1_000_000))
    assert many["arrays"] > 15 * MIB
    assert many["peak"] - few["peak"] <= 1.4 * many["arrays"] + 4 * MIB


@pytest.mark.parametrize(
    ("of", "kind"),
    mixed(
        [
            ("t", 0.5, "a whole number that fits int64"),
            ("x", 65_536, "a whole number that fits uint16"),
            ("y", -1, "a whole number that fits uint16"),
            ("x", np.nan, "a whole number that fits uint16"),
            ("p", 2, "True or False"),
            ("intensity", 1e300, "a whole number that fits uint16"),
        ],
        ["npz", "h5"],
    ),
)
def test_a_value_that_a_column_of_events_does_not_hold_is_refused_with_its_place(
    of: tuple[str, float, str], kind: str, tmp_path: Path
) -> None:
    column, value, why = of
    columns = events_of_anybody(150_000, "f8")
    columns[column] = columns[column].copy()
    columns[column][149_000] = value
    with refused(rf"a.{kind}: {column}\[149000\] is .*: must be {why}", FormatError):
        taxel.open(as_file(tmp_path / f"a.{kind}", columns))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("dtype", "kind"), mixed(["f2", "i1", "u1", ">i4", "f4"], ["npz", "h5"]))
def test_events_of_a_narrow_dtype_open_without_a_warning(dtype: str, kind: str, tmp_path: Path) -> None:
    events = taxel.open(as_file(tmp_path / f"a.{kind}", events_of_anybody(100, dtype))).events
    assert (events.t.dtype, events.x.dtype, events.p.dtype) == (np.int64, np.uint16, np.bool_)
    assert list(events.t) == list(range(100))
    assert set(events.x) == {7}
    assert events.p.all()


def as_events(**more: Any) -> dict[str, Any]:
    few = np.zeros(3, np.uint16)
    return {"t": np.arange(3), "x": few, "y": few, "p": few.astype(bool)} | more


def test_a_table_of_long_numbers_is_in_memory_a_few_lines_at_a_time(tmp_path: Path, opened: Opened) -> None:
    with gzip.open(tmp_path / "a.csv.gz", "wb", compresslevel=1) as file:
        file.write(b"a,b\n")
        for _ in range(30):
            file.write(b"0" * 4_000_000 + b"7,1\n")
    (tmp_path / "layout.toml").write_text("rows = 1\ncolumns = 2\nrate_hz = 10\n")
    said = opened(tmp_path / "a.csv.gz")
    assert said["arrays"] == 30 * 16
    assert said["peak"] < 144 * MIB


#: What a small file may claim, and what the line says; each took hundreds of megabytes.
STRANGE: dict[str, tuple[Callable[[], dict[str, Any]], str]] = {
    "markers": (lambda: as_events(markers=np.zeros((4_000_000, 2), np.int64)), "at most 262144 markers"),
    "lists": (lambda: as_events(about=np.array('{"notes":[' + "[]," * 5_000_000 + "[]]}")), "a larger limit"),
    "a long about": (lambda: as_events(about=np.array('{"a":"' + "x" * 40_000_000 + '"}')), "a larger limit"),
    "a unit": (lambda: of_frames(3, unit=np.array("N" * 40_000_000)), "a larger limit"),
    "times": (lambda: of_frames(3, t=np.zeros(20_000_000, np.int64)), "one time for each of 3 frames"),
    "held": (lambda: as_events(held=np.zeros((9000, 9000), np.uint16)), "at most 4194304"),
    "columns": (lambda: as_events(x=np.zeros(20_000_000)), "as many as in t"),
    "complex frames": (lambda: of_frames(20_000, values=np.zeros((20_000, 8, 64), "c16")), "complex128"),
}


def of_frames(n: int, **more: Any) -> dict[str, Any]:
    return {"values": np.ones((n, 2, 2)), "t": np.arange(n)} | more


@pytest.mark.parametrize(("strange", "kind"), mixed([*STRANGE], ["npz", "h5"]))
def test_columns_that_do_not_fit_are_refused_before_they_are_read(
    kind: str, strange: str, tmp_path: Path, opened: Opened
) -> None:
    make, why = STRANGE[strange]
    columns = make()
    path = tmp_path / f"a.{kind}"
    if kind == "npz":
        np.savez_compressed(path, **columns)
    else:
        with h5py.File(path, "w") as h5:
            h5.attrs["taxel"] = 1
            for name, column in columns.items():
                is_text = column.dtype.kind == "U"
                h5.create_dataset(
                    name, data=str(column) if is_text else column, compression="gzip" if column.ndim else None
                )
    said = opened(path)
    assert why in said["refused"]
    assert said["peak"] < 192 * MIB


def test_entries_that_taxel_does_not_know_are_not_read(tmp_path: Path, opened: Opened) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as h5:
        h5.attrs["taxel"] = 1
        for name, column in as_events().items():
            h5[name] = column
        for k in range(4):
            h5.create_dataset(f"e{k}", (20_000_000,), "f4", chunks=(100_000,))
    assert opened(tmp_path / "a.h5")["peak"] < 192 * MIB


def test_times_that_do_not_fit_are_refused_before_they_are_read(tmp_path: Path, opened: Opened) -> None:
    (tmp_path / "layout.toml").write_text('[data]\narray = "p"\ntime = "t"\n')
    with h5py.File(tmp_path / "a.h5", "w") as h5:
        h5.create_dataset("p", (100, 8), "i1")
        h5.create_dataset("t", (400_000_000,), "i1", chunks=(1_000_000,))
    said = opened(tmp_path / "a.h5")
    assert "400000000 times for 100 frames" in said["refused"]
    assert said["peak"] < 192 * MIB


@pytest.mark.parametrize("name", ["a.npy", "a.npz"])
def test_a_long_description_of_an_array_is_not_read(name: str, tmp_path: Path, opened: Opened) -> None:
    told = b"\x93NUMPY\x02\x00" + (200_000_000).to_bytes(4, "little") + b"{" + b" " * 200_000_000
    (tmp_path / "layout.toml").write_text("rate_hz = 100\n")
    if name == "a.npy":
        (tmp_path / name).write_bytes(told)
    else:
        with zipfile.ZipFile(tmp_path / name, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            archive.writestr("t.npy", told)
    said = opened(tmp_path / name)
    assert "the header has 200000000 bytes; at most 65536 are read" in said["refused"]
    assert said["peak"] < 192 * MIB


def test_what_taxel_would_not_read_again_it_does_not_write(tmp_path: Path) -> None:
    few = np.zeros(3, np.uint16)
    markers = [(k, True) for k in range((1 << 18) + 1)]
    for name in ("a.npz", "a.h5"):
        with refused("262145 markers; must be at most 262144"):
            taxel.convert(
                taxel.Events([0, 1, 2], few, few, few.astype(bool), array=taxel.Array(4, 4), markers=markers),
                tmp_path / name,
            )
        with refused("the unit has 257 characters"):
            taxel.convert(taxel.Frames(np.zeros((1, 2, 2)), [0], unit="N" * 257), tmp_path / name)
        assert not (tmp_path / name).exists()
        most = taxel.Events([0, 1, 2], few, few, few.astype(bool), array=taxel.Array(4, 4), markers=markers[1:])
        taxel.convert(most, tmp_path / name)
        assert taxel.open(tmp_path / name).events == most


def test_the_largest_sensor_with_a_mask_opens_again(tmp_path: Path, opened: Opened) -> None:
    """The description says of each taxel whether it exists."""
    mask = np.ones((2048, 2048), bool)
    mask[:, ::3] = False
    frames = taxel.Frames(np.zeros((1, 2048, 2048)), [0], array=taxel.Array(2048, 2048, exists=mask))
    taxel.convert(frames, tmp_path / "a.npz")
    said = opened(tmp_path / "a.npz")
    assert said["peak"] <= 1.5 * said["arrays"] + 256 * MIB + 64 * MIB


def test_the_memory_of_a_conversion_counts(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "a.npz", values=np.zeros((1000, 32, 32), bool), t=np.arange(1000))
    with refused(r"would take 40\d{5} bytes of memory; at most 3000000 are read; a larger limit", FormatError):
        taxel.open(tmp_path / "a.npz", limit=3_000_000)


def test_memory_that_is_missing_is_said_with_what_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise MemoryError

    taxel.convert(some_events(), tmp_path / "a.npz")
    monkeypatch.setattr("taxel.recording.readers.npz.read_arrays", fail)
    with refused(r"a.npz: needs more memory than is available \(\d+ bytes\); a larger limit", FormatError):
        taxel.open(tmp_path / "a.npz")


# what is available


@pytest.fixture
def small_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    """The machine has 1000 KiB available."""
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=1_024_000))


def in_groups(folder: Path, groups: str) -> None:
    (folder / "proc/self").mkdir(parents=True)
    (folder / "proc/self/cgroup").write_text(groups)


def group(folder: Path, version: int, limit: object, used: int, files: int) -> None:
    names = {1: ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")}
    most, usage, inactive = names.get(version, ("memory.max", "memory.current", "inactive_file"))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / most).write_text(f"{limit}\n")
    (folder / usage).write_text(f"{used}\n")
    (folder / "memory.stat").write_text(f"anon 5\n{inactive} {files}\n")


@pytest.mark.usefixtures("small_machine")
def test_what_is_available_is_that_of_the_machine(tmp_path: Path) -> None:
    assert limits.available(tmp_path) == 1_024_000


@pytest.mark.usefixtures("small_machine")
@pytest.mark.parametrize("inner", ["a/b", ""])
def test_the_limits_of_all_control_groups_above_count(inner: str, tmp_path: Path) -> None:
    in_groups(tmp_path, f"0::/{inner}\n")
    top = tmp_path / "sys/fs/cgroup"
    group(top / inner, 2, "max", 10, 0)
    group(top / "a", 2, 900_000, 500_000, 100_000)
    assert limits.available(tmp_path) == (500_000 if inner else 1_024_000)


@pytest.mark.usefixtures("small_machine")
@pytest.mark.parametrize("place", ["docker/77", ""])
def test_a_control_group_of_version_1_counts_also_from_within_a_container(place: str, tmp_path: Path) -> None:
    in_groups(tmp_path, "4:cpu,cpuacct:/x\n3:memory:/docker/77\n")
    group(tmp_path / "sys/fs/cgroup/memory" / place, 1, 800_000, 700_000, 50_000)
    assert limits.available(tmp_path) == 150_000
    group(tmp_path / "sys/fs/cgroup/memory" / place, 1, 600_000, 700_000, 50_000)
    assert limits.available(tmp_path) == 0


#: What reading tables of labels takes, each in a process of its own, once all that it needs is loaded.
LABELS = """
import os, re, sys, taxel
peak = lambda: int(re.findall(r"VmHWM: *\\t? *(\\d+)", open("/proc/self/status").read())[0]) * 1024
for few, many in zip(sys.argv[1::2], sys.argv[2::2]):
    if not os.fork():
        taxel.Labels(few)
        before = peak()
        taxel.Labels(many)
        print(peak() - before, flush=True)
        os._exit(0)
    os.wait()
"""
#: The head and a row of tables that differ in what a row takes.
TABLES = [
    ("label,t_us", "a,1"),
    ("label,t_us", "heel{k},{k}000"),
    ("recording,label,t_us,source", "g,a{k},{k},palm"),
    ("label,t_us,note,by", "heel,{k},x{k},y{k}"),
    ("label,t_us", "ħēęļ{k},{k}"),
    ("label,t_us,note", "heel,{k}," + "x" * 300),
]


def test_a_table_of_labels_claims_what_it_takes(tmp_path: Path) -> None:
    files = []
    for number, (head, row) in enumerate(TABLES):
        for name, count in (("few", 1), ("many", 60_000)):
            rows = "".join(f"{row.format(k=k)}\n" for k in range(count))
            files.append(tmp_path / f"{name}{number}.csv")
            files[-1].write_text(f"{head}\n{rows}", encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", LABELS, *files], check=True, capture_output=True, text=True)
    for many, taken in zip(files[1::2], done.stdout.split(), strict=True):
        with limits.opening(1), pytest.raises(FormatError, match="bytes of memory") as refusal:
            taxel.Labels(many)
        claimed = int(re.findall(r"would take (\d+) bytes", str(refusal.value))[0])
        assert claimed / 3 <= int(taken) <= 1.05 * claimed, many.read_text()[:50]


# columns that grow


@pytest.mark.parametrize("pieces", [[0], [1] * 50, [7, 0, 300, 2], [10_000]])
def test_columns_that_grow_are_what_was_added(pieces: list[int]) -> None:
    rng = np.random.default_rng(3)
    read = Growing("a", t=((), np.int64), values=((2, 3), np.float32))
    parts = [(rng.integers(0, 9, n), rng.random((n, 2, 3)).astype(np.float32)) for n in pieces]
    for t, values in parts:
        read.add(t=t, values=values)
    assert len(read) == sum(pieces)
    np.testing.assert_array_equal(read.column("t"), np.concatenate([t for t, _ in parts]))
    column = read.column("values")
    np.testing.assert_array_equal(column, np.concatenate([values for _, values in parts]))
    frames = taxel.Frames(column, np.arange(len(column)))
    assert np.shares_memory(frames.values, column) or not len(column)


def test_columns_that_grow_stop_at_the_limit() -> None:
    with limits.opening(1000):
        read = Growing("a.txt", t=((), np.int64))
        read.add(t=np.zeros(125))
        with refused("a.txt: would take 1008 bytes of memory; at most 1000", FormatError):
            read.add(t=[1])
    read.add(t=[1])
    with pytest.raises(ProblemError, match="limit is 0"):
        taxel.open("a.npz", limit=0)


def test_what_no_opening_reads_names_no_option_of_one() -> None:
    with refused(r"a: would take 9 bytes of memory; at most 8 are read$", FormatError):
        limits.unpacked("a", 9, 8)
    with limits.opening(), refused(r"at most 8 are read; a larger limit", FormatError):
        limits.unpacked("a", 9, 8)


@pytest.mark.parametrize(
    ("command", "name"),
    mixed(["info", "convert", "cut", "merge", "encode", "emulate"], ["walk.npz", "walk.mcap", "walk.lsa", "walk.csv"]),
)
def test_a_command_names_its_option_in_one_line(
    command: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    taxel.convert(some_events(), tmp_path / name)
    out = str(tmp_path / "b.npz")
    more = {
        "convert": [out],
        "cut": [out, "--to", "1"],
        "merge": [str(tmp_path / name), "-o", out],
        "encode": [out, "--encoder", "change_events"],
    }
    path = ["--replay", str(tmp_path / name)] if command == "emulate" else [str(tmp_path / name)]
    with pytest.raises(SystemExit) as ended:
        main([command, *path, *more.get(command, []), "--limit", "100"])
    assert ended.value.code == 2
    (said,) = capsys.readouterr().err.strip().splitlines()
    assert re.search(rf"{name}.* \d+ bytes.*at most 100 are read.*; a larger --limit BYTES reads more", said)
