"""Decoding of bytes to events, beside blocked NumPy, expelliarmus and faery (both EVT2).

One thread, 20 million words. Like is compared with like, `fresh` or `file` (`DOES`): from the same place, into new
memory. Ours are the nouns' own columns (t int64, x and y uint16, p bool: 13 bytes an event, and 3 more for values);
NumPy decodes clean changes alone, and writes 11 bytes (x and y uint8), which is its best. The peers on EVT2 read a file
of as many events of their own format, and ours one of our words.

Peer: blocked NumPy, expelliarmus and faery. Unit: million words/s. Goal: not slower than any; from files 2.4 times
expelliarmus and 4.5 times faery.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import taxel
from taxel import wire
from taxel_benchmarks._goals import Goal, at_least, not_slower
from taxel_benchmarks._rounds import measured, missing

WORDS, BLOCK = 20_000_000, 65_536

#: What each row does, by the end of its name.
DOES = {
    "fresh": "words in memory, into columns that are allocated in the call",
    "file": f"a file in the page cache, read and decoded in chunks of {BLOCK} words, each into new columns",
    "EVT2": f"a file in the page cache, read and decoded in chunks ({BLOCK} events by expelliarmus), into new columns",
}

#: Goals of more than the peer's speed.
FASTER = {
    "taxel, clean, file / expelliarmus, EVT2": 2.4,
    "taxel, clean, file / faery, EVT2": 4.5,
}

#: The modules that each peer on EVT2 needs: faery writes the file.
PEERS = {"faery, EVT2": "faery", "expelliarmus, EVT2": "faery expelliarmus"}


def streams(words: int) -> dict[str, bytes]:
    """Return clean changes, changes that alternate with their intensities, and a random mix of kinds."""
    rng = np.random.default_rng(1)
    stamps = np.cumsum(rng.random(words) < 1 / 4096) + 60_000
    x, y, p = rng.integers(0, 64, words), rng.integers(0, 64, words), rng.integers(0, 2, words)
    ticks, alternate, random = rng.integers(0, 150, words), np.arange(words) % 2, rng.integers(0, 2, words)
    twice = [np.repeat(column[::2], 2)[:words] for column in (x, y, p)]

    def pack(intensity: Any, x: Any, y: Any, p: Any) -> bytes:
        value = np.where(intensity, ticks, stamps % 65_536)
        out = np.empty((words, 5), np.uint8)
        out[:, 0] = 0x80 | p << 6 | intensity << 5 | value >> 14
        out[:, 1], out[:, 2], out[:, 3], out[:, 4] = value >> 7 & 127, value & 127, x, y
        return out.tobytes()

    return {"clean": pack(0 * x, x, y, p), "pairs": pack(alternate, *twice), "mix": pack(random, x, y, p)}


def numpy_blocked(data: bytes, columns: tuple[NDArray[Any], ...]) -> None:
    """Decode clean changes in NumPy's fastest way: byte columns of a block, then a pass for each field."""
    raw = np.frombuffer(data, np.uint8).reshape(-1, 5)
    t, x, y, p = columns
    planes, stamp16, high = np.empty((5, BLOCK), np.uint8), np.empty(BLOCK, np.uint16), np.empty(BLOCK, np.uint16)
    latest = None
    for at in range(0, len(raw), BLOCK):
        n = min(BLOCK, len(raw) - at)
        block, s, h, to = planes[:, :n], stamp16[:n], high[:n], slice(at, at + n)
        np.copyto(block, raw[to].T)
        if block[0].min() < 0x80 or (block[0] & 0x28).any() or block[1:].max() > 0x7F:
            raise ValueError("this decoder takes clean changes only")
        np.left_shift(block[0], 14, out=s, dtype=np.uint16)
        np.left_shift(block[1], 7, out=h, dtype=np.uint16)
        s |= h
        s |= block[2]
        latest = int(s[0]) if latest is None else latest
        s -= np.uint16(latest % 65_536)
        np.multiply(s, 100, out=t[to], dtype=np.int64)
        t[to] += 100 * latest
        latest += int(s[-1])
        x[to], y[to] = block[3], block[4]
        np.right_shift(block[0], 6, out=p[to])
        p[to] &= 1


def evt2(folder: Path, words: int) -> dict[str, Callable[[], Any]]:
    """Return the peers that read as many events from an EVT2 file; those that are not installed are left out."""
    absent = missing(PEERS)
    if "faery, EVT2" in absent:
        return {}
    import faery  # noqa: PLC0415  a peer need not be there

    rng, path = np.random.default_rng(2), folder / "events.raw"
    events = np.zeros(words, faery.EVENTS_DTYPE)
    events["t"] = np.sort(rng.integers(0, words // 20, words))
    events["x"], events["y"] = rng.integers(0, 64, words), rng.integers(0, 64, words)
    events["on"] = rng.integers(0, 2, words).astype(bool)
    faery.events_stream_from_array(events, dimensions=(64, 64)).to_file(path, version="evt2")

    def by_faery() -> None:
        for packet in faery.events_stream_from_file(path):
            len(packet)

    runs: dict[str, Callable[[], Any]] = {"faery, EVT2": by_faery}
    if absent:
        return runs
    from expelliarmus import Wizard  # noqa: PLC0415  a peer need not be there

    def by_expelliarmus() -> None:
        wizard = Wizard(encoding="evt2", chunk_size=BLOCK)
        wizard.set_file(path)
        for chunk in wizard.read_chunk():
            len(chunk)

    return runs | {"expelliarmus, EVT2": by_expelliarmus}


def pairs() -> dict[str, tuple[str, str]]:
    """Return ours and the peer of each ratio, by its name."""
    both = [("taxel, clean, fresh", "numpy, clean, fresh"), *(("taxel, clean, file", peer) for peer in PEERS)]
    return {f"{ours} / {peer}": (ours, peer) for ours, peer in both}


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return not_slower(result, *(name for name in pairs() if name not in FASTER)) + at_least(FASTER, result["ratios"])


def run(*, quick: bool) -> dict[str, Any]:
    words, rounds = (WORDS // 20, 3) if quick else (WORDS, 11)
    data = streams(words)

    def blocked() -> tuple[NDArray[Any], ...]:
        return np.empty(words, np.int64), *(np.empty(words, np.uint8) for _ in range(3))

    runs: dict[str, Callable[[], Any]] = {
        "numpy, clean, fresh": lambda: numpy_blocked(data["clean"], blocked()),
    }
    for name, stream in data.items():
        runs[f"taxel, {name}, fresh"] = lambda stream=stream: wire.Decoder().push(stream)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / "words").write_bytes(data["clean"])
        runs["taxel, clean, file"] = partial(from_file, folder / "words")
        runs |= evt2(folder, words)
        _agree(data["clean"], blocked())
        # Each peer directly behind ours.
        order = sorted(runs, key=lambda name: (name.partition(", ")[2], not name.startswith("taxel")))
        found = measured({name: runs[name] for name in order}, pairs(), rounds=rounds, work=words)
    for name, row in found["results"].items():
        row["does"] = DOES[name.rpartition(", ")[2]]
    for name in data:
        fresh = f"taxel, {name}, fresh"
        found["ratios"][f"{fresh}, million words/s"] = found["results"][fresh]["rate"] / 1e6
    return found | {"words": words}


def from_file(path: Path) -> None:
    """Read words and decode them, a block at a time, each into new columns."""
    decoder = wire.Decoder()
    with path.open("rb") as file:
        while chunk := file.read(5 * BLOCK):
            len(decoder.push(chunk))


def _agree(clean: bytes, blocked: tuple[NDArray[Any], ...]) -> None:
    """Check that both decode the same, before anything is measured."""
    expected = wire.decode(clean)
    numpy_blocked(clean, blocked)
    for ours, theirs in zip((expected.t, expected.x, expected.y, expected.p), blocked, strict=True):
        if not np.array_equal(ours, theirs):
            raise taxel.Error("the NumPy decoder disagrees with ours")
