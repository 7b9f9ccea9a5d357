"""Spoil files of every format, run the commands on them in this process, and say what ended in anything but an answer.

Run as ``python hostile.py KIND[,KIND...] SEED FIRST COUNT FOLDER``. A command may succeed, or end with one of taxel's
exit codes and one line. Memory is bounded by RLIMIT_AS, work by RLIMIT_CPU: seconds of this process, not of the clock
on the wall.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
import resource
import struct
import sys
import tomllib
import traceback
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from formats import bags
from formats import making as other  # the loaders' files
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

import taxel
from recording.making import record, some_events, some_frames
from taxel import formats
from taxel.cli import _recordings, main

#: Limits for a small file: memory beyond the program's own, bytes; processor time for all of a run, s per file.
MEMORY, WORK_S = 3 << 29, 2.0

# On a slow machine a line of progress is no second line of an error.
_recordings._REPORT_S = (600.0,)

#: Every kind of file that taxel.open and the loaders read, with a function that writes a valid one into a folder.
KINDS: dict[str, Callable[[Path], Path]] = {}


def kind(name: str) -> Callable[[Callable[[Path], Path]], Callable[[Path], Path]]:
    def keep(make: Callable[[Path], Path]) -> Callable[[Path], Path]:
        KINDS[name] = make
        return make

    return keep


for _compression in ("none", "lz4", "zstd"):

    @kind(f"mcap-{_compression}")
    def _mcap(folder: Path, compression: str = _compression) -> Path:
        path = folder / "walk.mcap"
        record(path, some_events(), compression=compression)
        return path


@kind("lsa")
def _lsa(folder: Path) -> Path:
    taxel.convert(some_events(), folder / "walk.lsa")
    return folder / "walk.lsa"


@kind("npz")
def _npz(folder: Path) -> Path:
    record(folder / "walk.mcap", some_events())
    taxel.convert(folder / "walk.mcap", folder / "walk.npz")
    return folder / "walk.npz"


@kind("npz-frames")
def _npz_frames(folder: Path) -> Path:
    taxel.convert(some_frames(), folder / "press.npz")
    return folder / "press.npz"


@kind("csv")
def _csv(folder: Path) -> Path:
    taxel.convert(some_events(60), folder / "walk.csv")
    return folder / "walk.csv"


@kind("csv-frames")
def _csv_frames(folder: Path) -> Path:
    taxel.convert(some_frames(), folder / "press.csv")
    return folder / "press.csv"


@kind("h5")
def _h5(folder: Path) -> Path:
    record(folder / "walk.mcap", some_events())
    taxel.convert(folder / "walk.mcap", folder / "walk.h5")
    return folder / "walk.h5"


def _bag(path: Path, pack: str) -> Path:
    """Write a small bag, and the layout file that says its topic."""
    rng = np.random.default_rng(9)
    palms = [("/palm", bags.PALM, 10 * k + 2, 10 * k, bags.palm(rng.integers(0, 99, 768))) for k in range(12)]
    hands = [("/hand", bags.HAND, 10 * k + 3, 10 * k, bags.hand([1, 2, k], [4, 5])) for k in range(12)]
    bags.write(path, sorted([*palms, *hands], key=lambda one: one[2]), pack=pack)
    path.with_name(f"{path.stem}.layout.toml").write_text('rows = 24\ncolumns = 32\n[ros]\ntopic = "/palm"\n')
    return path


for _name, _pack in (
    ("bag", ""), ("bag", "bz2"), ("bag", "lz4"), ("mcap", ""), ("mcap", "storage"), ("db3", ""),
):  # fmt: skip

    @kind(f"bag-{_name}-{_pack or 'none'}")
    def _bags(folder: Path, name: str = _name, pack: str = _pack) -> Path:
        return _bag(folder / f"grasp.{name}", pack)


@kind("bag-mcap-lz4")
def _bag_lz4(folder: Path) -> Path:
    path = _bag(folder / "grasp.mcap", "")
    with path.open("rb") as file:
        every = list(make_reader(file).iter_messages())
    with path.open("wb") as out:
        writer = Writer(out, compression=CompressionType.LZ4)
        writer.start(profile="ros2")
        ids: dict[int, int] = {}
        for schema, channel, message in every:
            if channel.id not in ids:
                made = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.id] = writer.register_channel(channel.topic, "cdr", made, dict(channel.metadata))
            writer.add_message(ids[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    return path


@kind("npy-layout")
def _npy_layout(folder: Path) -> Path:
    np.save(folder / "press.npy", np.random.default_rng(9).integers(0, 99, (50, 4, 5)))
    (folder / "press.layout.toml").write_text("rows = 4\ncolumns = 5\nrate_hz = 100\n")
    return folder / "press.npy"


@kind("npz-layout")
def _npz_layout(folder: Path) -> Path:
    values = np.random.default_rng(9).integers(0, 99, (50, 4, 5))
    np.savez(folder / "press.npz", pressure=values, seconds=np.arange(50) / 100)
    (folder / "press.layout.toml").write_text('[data]\narray = "pressure"\ntime = "seconds"\n')
    return folder / "press.npz"


@kind("table-layout")
def _table_layout(folder: Path) -> Path:
    rows = (f"{k / 100:g};{k % 7};{k % 5}\n" for k in range(50))
    (folder / "press.txt").write_text("time;thumb;index\n" + "".join(rows))
    (folder / "press.layout.toml").write_text('[table]\nseparator = ";"\ntime_column = "time"\n')
    return folder / "press.txt"


for _name in formats.FORMATS:
    KINDS[_name] = getattr(other, f"write_{_name}")


# how files are spoilt

_EXTREMES = [
    b"\xff" * 8,
    b"\x7f" + b"\xff" * 7,
    b"\xff" * 7 + b"\x7f",
    bytes(8),
    b"\x80" + bytes(7),
    bytes(7) + b"\x80",
]
_WORDS = [b"1e308", b"-1", b"nan", b"inf", b"1" * 30, b"", b"x", b"1e-320", b'"', b"0", b"65536", b"9" * 5000, b"\xc3"]
_NONSENSE: list[Any] = [None, -1, 0, 10**30, 1e300, True, "", "x", [], {}, [[]], [0] * 5, 10**12, 2**63, "é" * 300]


def spoil_bytes(rng: np.random.Generator, data: bytes) -> bytes:
    """Flip, cut, put in, take out, repeat, or write an extreme number."""
    data = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        at, n = int(rng.integers(0, len(data) + 1)), int(rng.integers(1, 64))
        way = rng.integers(0, 6)
        if way == 0 and at < len(data):
            data[at] ^= int(rng.integers(1, 256))
        elif way == 1:
            del data[at:]
        elif way == 2:
            data[at:at] = rng.integers(0, 256, n, dtype=np.uint8).tobytes()
        elif way == 3:
            del data[at : at + n * int(rng.integers(1, 20))]
        elif way == 4:
            data[at:at] = data[at : at + n * 20]
        else:
            extreme = _EXTREMES[int(rng.integers(len(_EXTREMES)))][: int(rng.choice([1, 2, 4, 8]))]
            data[at : at + len(extreme)] = extreme
    return bytes(data)


def spoil_text(rng: np.random.Generator, data: bytes) -> bytes:
    """Put something else for a number, or a line or a column twice, or none."""
    lines = data.split(b"\n")
    for _ in range(int(rng.integers(1, 4))):
        k = int(rng.integers(0, min(len(lines), 12) if rng.random() < 0.5 else len(lines)))
        cells = re.split(rb"([,\t ]+)", lines[k])
        c = int(rng.integers(0, len(cells)))
        way = rng.integers(0, 5)
        if way <= 2:
            cells[c] = _WORDS[int(rng.integers(len(_WORDS)))]
            lines[k] = b"".join(cells)
        elif way == 3:
            lines[k:k] = lines[k : k + int(rng.integers(1, 5))]
        else:
            del lines[k : k + int(rng.integers(1, 5))]
        lines = lines or [b""]
    return b"\n".join(lines)


def spoil_json(rng: np.random.Generator, text: str) -> str:
    """Put nonsense in the place of a value, take one out, or nest it deeply."""
    said = json.loads(text)
    places: list[tuple[Any, Any]] = []

    def walk(value: Any) -> None:
        for key in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
            places.append((value, key))
            walk(value[key])

    walk(said)
    if not places or rng.random() < 0.05:
        return ["[" * 100_000, "{}", "7", '"', '{"array": ' * 5000, "null", "1" * 6000][int(rng.integers(7))]
    holder, key = places[int(rng.integers(len(places)))]
    if rng.random() < 0.2:
        del holder[key]
    else:
        holder[key] = _NONSENSE[int(rng.integers(len(_NONSENSE)))]
    return json.dumps(said)


def spoil_npz(rng: np.random.Generator, data: bytes) -> bytes:
    """Spoil what is inside, and pack it soundly again: checksums agree, so what is read is nonsense."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        # By its checksum the file is refused before anything else is looked at.
        members = {name: archive.read(name) for name in archive.namelist() if name != "digest.npy"}
    name = list(members)[int(rng.integers(len(members)))]
    way = rng.integers(0, 6)
    array = np.load(io.BytesIO(members[name]), allow_pickle=False)
    out = io.BytesIO()
    if way == 0 and name == "about.npy":
        np.save(out, np.array(spoil_json(rng, str(array))))
        members[name] = out.getvalue()
    elif way == 1:
        shapes = [f"({10**12},)", "(2, 3, 4)", "()", "(-1,)", f"({2**63},)", "(0,)", f"({2**31}, {2**31})", "(True,)"]
        shape = shapes[int(rng.integers(len(shapes)))]
        members[name] = _header(members[name], shape=shape)
    elif way == 2:
        kinds = ["|O", "<f8", "|b1", "<M8[us]", "|S0", "<U1000000000", "<c16", "[('a', '<i8')]", "|V8", "<i99"]
        members[name] = _header(members[name], descr=kinds[int(rng.integers(len(kinds)))])
    elif way == 3:
        del members[name]
    elif way == 4:
        new = [
            array.astype(np.float64, copy=False) * np.nan if array.dtype.kind in "iufb" else array,
            np.zeros((3, 0)),
            np.full(array.shape, 2**62),
            np.arange(3) * 10**18,
            np.array("x"),
            array[..., None],
        ][int(rng.integers(6))]
        np.save(out, new)
        members[name] = out.getvalue()
    else:
        members[name] = spoil_bytes(rng, members[name])
    with zipfile.ZipFile(out := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    return out.getvalue()


def _header(member: bytes, shape: str | None = None, descr: str | None = None) -> bytes:
    """Write another shape or kind into the description of an array."""
    size = struct.unpack("<H", member[8:10])[0]
    said = member[10 : 10 + size].decode()
    if shape is not None:
        said = re.sub(r"'shape': \(.*?\)", f"'shape': {shape}", said)
    if descr is not None:
        quoted = descr if descr.startswith("[") else f"'{descr}'"
        said = re.sub(r"'descr': '.*?'", lambda _: f"'descr': {quoted}", said)
    return member[:8] + struct.pack("<H", len(said)) + said.encode() + member[10 + size :]


def spoil_npy(rng: np.random.Generator, data: bytes) -> bytes:
    """Write nonsense into the description of an array, whose length stays right."""
    end = 10 + struct.unpack("<H", data[8:10])[0]
    said = spoil_text(rng, spoil_bytes(rng, data[10:end]) if rng.random() < 0.5 else data[10:end])[: end - 10]
    return data[:10] + said.ljust(end - 10) + data[end:]


def spoil_sizes(rng: np.random.Generator, data: bytes) -> bytes:
    """Write other sizes into a .bag, whose records and fields each begin with one of four bytes."""
    spoilt = bytearray(data)
    places = [m.start() - 4 for m in re.finditer(rb"(?:op|conn|time|size|count|compression|chunk_pos|topic)=", data)]
    for at in rng.choice(places, int(rng.integers(1, 4))):
        extreme = int(rng.choice([0, 1, 3, 2**16, 2**30, 2**31 - 1, 2**32 - 1]))
        spoilt[at : at + 4] = struct.pack("<I", extreme)
    return bytes(spoilt)


def spoil_mcap(rng: np.random.Generator, data: bytes) -> bytes:
    """Spoil JSON where it stands, lengths kept, and switch the chunks' checksums off (0: not checked)."""
    data = bytearray(data)
    at = 8
    while at + 9 <= len(data):
        opcode, size = data[at], int.from_bytes(data[at + 1 : at + 9], "little")
        if opcode == 6:
            data[at + 33 : at + 37] = bytes(4)
            if rng.random() < 0.2:
                # The unpacked size that the chunk states.
                data[at + 25 : at + 33] = struct.pack("<Q", int(rng.choice([0, 1, 2**16, 2**26, 2**29, 2**30, 2**60])))
        at += 9 + size
    numbers = list(re.finditer(rb"(?<=[:,\[ ])-?\d+(\.\d+)?(?=[,}\]])", bytes(data)))
    for _ in range(int(rng.integers(1, 4))):
        if numbers:
            m = numbers[int(rng.integers(len(numbers)))]
            n = m.end() - m.start()
            new = [b"9" * n, b"0" * n, b"-" + b"9" * (n - 1), b"1e" + b"9" * (n - 2), b'""' + b" " * (n - 2)]
            chosen = new[int(rng.integers(len(new)))]
            if len(chosen) == n:
                data[m.start() : m.end()] = chosen
    return spoil_bytes(rng, bytes(data)) if rng.random() < 0.3 else bytes(data)


def spoilt(rng: np.random.Generator, name: str, data: bytes) -> bytes:
    """Spoil a file's bytes in one of the ways that its kind knows."""
    ways: list[Callable[[np.random.Generator, bytes], bytes]] = [spoil_bytes]
    if name == "npy-layout":
        ways += [spoil_npy] * 2
    elif name.startswith("npz"):
        ways += [spoil_npz] * 3
    elif "mcap" in name:
        ways += [spoil_mcap] * 2
    elif name.startswith("bag-bag"):
        ways += [spoil_sizes] * 2
    elif b"\0" not in data[:2000]:
        ways += [spoil_text] * 2
    return ways[int(rng.integers(len(ways)))](rng, data)


# what is run on them


def commands(path: Path) -> list[list[str]]:
    """Return the commands that read a recording."""
    out = path.parent / "out"
    return [
        ["info", str(path), "--json"],
        ["info", str(path)],
        *(["convert", str(path), f"{out}{ending}", "--overwrite"] for ending in (".mcap", ".lsa", ".npz", ".csv")),
        ["convert", str(path), f"{out}.npz", "--frames", "100", "--overwrite"],
        ["encode", str(path), f"{out}.npz", "--encoder", "change_events", "--overwrite"],
        ["encode", str(path), f"{out}.npz", "--encoder", "contact_area", "--tare", "0.01", "--overwrite"],
    ]


def run(arguments: list[str]) -> str | None:
    """Run a command; return what is wrong with how it ended."""
    out, err = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main(arguments)
    except SystemExit as ended:
        said = err.getvalue()
        if ended.code in (0, None):
            return None
        if ended.code not in (2, 3):
            return f"exit code {ended.code}: {said}"
        # Of a table that no layout describes the line ends with one, in lines to paste.
        line, _, layout = said.removesuffix("\n").partition(" (docs/files.md):\n")
        tomllib.loads(layout)
        if "\n" in line or "bug in taxel" in said or len(said) > 1000:
            return f"exit code {ended.code} and {said[:2000]!r}"
        return None
    except BaseException:
        return traceback.format_exc()
    return "did not end"


def load(name: str, path: Path) -> str | None:
    """Read a file by its loader; return what is wrong with how it ended."""
    try:
        for trial in formats.trials(path.parent if path.suffix == ".hea" else path, name):
            trial.frames.between(0, 1000)
    except taxel.Error as error:
        return None if "\n" not in str(error) and len(str(error)) < 1000 else f"says {str(error)!r}"
    except BaseException:
        return traceback.format_exc()
    return None


def work(name: str, seed: int, first: int, count: int, folder: Path) -> list[str]:
    """Spoil and read `count` files; return what went wrong."""
    path = KINDS[name](folder)
    files = sorted(p for p in folder.iterdir() if p.stem == path.stem) if name in formats.FORMATS else [path]
    sound = {file: file.read_bytes() for file in files}
    wrong = []
    warnings.simplefilter("error")
    for number in range(first, first + count):
        rng = np.random.default_rng([seed, number])
        for file, data in sound.items():
            file.write_bytes(data)
        file = files[int(rng.integers(len(files)))]
        file.write_bytes(spoilt(rng, name, sound[file]))
        # If the process is killed, the last line names the file.
        print(json.dumps({"at": f"{name} {number}"}), flush=True)
        if name in formats.FORMATS:
            said = load(name, path)
            wrong += [f"{name} {number}: {said}"] * (said is not None)
            continue
        every = commands(path)
        for arguments in [every[0], every[1 + number % (len(every) - 1)]]:
            said = run(arguments)
            wrong += [f"{name} {number} {' '.join(arguments)}: {said}"] * (said is not None)
    return wrong


def bounded(count: int) -> None:
    """Bound what this process may ask for from here on."""
    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (held + MEMORY, resource.RLIM_INFINITY))
    used = resource.getrusage(resource.RUSAGE_SELF)
    seconds = int(used.ru_utime + used.ru_stime + 10 + WORK_S * count)
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))


if __name__ == "__main__":
    _names, _seed, _first, _count, _folder = sys.argv[1:]
    bounded(int(_count) * len(_names.split(",")))
    for _name in _names.split(","):
        (_place := Path(_folder) / _name).mkdir()
        for _said in work(_name, int(_seed), int(_first), int(_count), _place):
            print(json.dumps({"wrong": _said}))
    print(json.dumps({"done": True}))
