"""CPU time of writing a recording, beside the official Python library of MCAP.

Datagrams of 280 words (1400 bytes) as the board sends them, change and intensity alternating, taxels at random (which
compresses badly). CPU time of the whole process, as ours writes in a thread of its own. zstd at level 1 in both: ours
has no other, the library's is 3. "At 107 MB/s" is the sensor's worst case, in real time.

Peer: the official Python library of MCAP. Unit: MB per CPU second. Goal: not slower than the peer.
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from taxel.recording.files.mcap import RecordingWriter
from taxel_benchmarks._goals import Goal, not_slower
from taxel_benchmarks._rounds import measured, missing

PEERS = {"mcap (Python)": "mcap zstandard"}
#: Compressions.
WAYS = ("none", "lz4", "zstd")
WORDS = 280
BYTES = WORDS * 5
#: 21.3 million words/s, the sensor's worst case.
WORST = 107e6


HEADER = json.dumps({"array": {"rows": 64, "columns": 64, "pitch_mm": 2.67, "name": "thesis 64x64"}})


def datagrams(n: int) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return n datagrams, one after the other."""
    rng = np.random.default_rng(1)
    words = np.arange(n * WORDS)
    intensity = words % 2
    value = np.where(intensity, rng.integers(0, 150, len(words)), words // 600 % 65_536)
    taxel = np.repeat(rng.integers(0, 4096, len(words) // 2), 2)
    raw = np.empty((len(words), 5), np.uint8)
    raw[:, 0] = 0x80 | rng.integers(0, 2, len(words)) << 6 | intensity << 5 | value >> 14
    raw[:, 1], raw[:, 2], raw[:, 3], raw[:, 4] = value >> 7 & 127, value & 127, taxel % 64, taxel // 64
    return raw.ravel()


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return not_slower(result, *(f"taxel, {c} / mcap (Python), {c}" for c in WAYS))


def run(*, quick: bool) -> dict[str, Any]:
    n, rounds, seconds = (7_000, 3, 0.5) if quick else (140_000, 7, 5.0)
    raw = datagrams(n)
    arrived, number = np.arange(n, dtype=np.int64) * 13_100, np.arange(n, dtype=np.uint64)
    offsets = np.arange(n + 1, dtype=np.int64) * BYTES
    messages = [raw[k * BYTES : (k + 1) * BYTES].tobytes() for k in range(n)]

    absent = missing(PEERS)
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "a.mcap"

        def ours(compression: str) -> None:
            writer = RecordingWriter(path, HEADER, compression, True)
            writer.datagrams(arrived, number, offsets, raw)
            writer.finish("{}")

        runs: dict[str, Callable[[], Any]] = {}
        for compression in WAYS:
            runs[f"taxel, {compression}"] = lambda c=compression: ours(c)
            if not absent:
                runs[f"mcap (Python), {compression}"] = official(path, messages, compression)
        pairs = {f"taxel, {c} / mcap (Python), {c}": (f"taxel, {c}", f"mcap (Python), {c}") for c in WAYS}
        found = measured(runs, pairs, rounds=rounds, work=raw.size)
        sizes = {}
        for compression in WAYS:
            ours(compression)
            sizes[compression] = path.stat().st_size / raw.size
        cores = {c: paced(path, c, seconds, (arrived, number, offsets, raw)) for c in WAYS}
    found["ratios"] |= {f"taxel, {c}, MB per CPU second": found["results"][f"taxel, {c}"]["rate"] / 1e6 for c in WAYS}
    found["ratios"] |= {f"taxel, {c}, at 107 MB/s, cores": cores[c] for c in WAYS}
    return found | {"bytes": raw.size, "size": sizes}


def official(path: Path, messages: list[bytes], compression: str) -> Callable[[], Any]:
    """Return a run of the official Python library, with zstd at our level."""
    import mcap.writer  # noqa: PLC0415  a peer need not be there
    import zstandard  # noqa: PLC0415
    from mcap.writer import CompressionType, Writer  # noqa: PLC0415

    def level_1(data: bytes) -> bytes:
        return zstandard.ZstdCompressor(level=1).compress(data)

    def write() -> None:
        # The library calls zstandard.compress, whose level is 3.
        with path.open("wb") as file, patch.object(mcap.writer.zstandard, "compress", level_1):
            writer = Writer(file, chunk_size=1 << 20, compression=CompressionType[compression.upper()])
            writer.start()
            channel = writer.register_channel("/datagrams", "taxel.wire.v1", 0)
            for k, message in enumerate(messages):
                writer.add_message(channel, k * 13_100, message, k * 13_100, k)
            writer.finish()

    return write


def paced(path: Path, compression: str, seconds: float, stream: tuple[Any, ...]) -> float:
    """Return the cores that writing needs at the worst case's rate, without those of the pacing loop."""
    arrived, number, offsets, raw = stream
    step = 2 * int(WORST / BYTES / 1000)
    total = min(len(arrived), int(WORST * seconds / BYTES))
    writer = RecordingWriter(path, HEADER, compression, True)

    def pace(write: bool) -> float:
        cpu, began = time.process_time(), time.perf_counter()
        for k in range(0, total, step):
            end = min(k + step, total)
            if write:
                writer.datagrams(arrived[k:end], number[k:end], offsets[k : end + 1], raw)
            time.sleep(max(0.0, began + end * BYTES / WORST - time.perf_counter()))
        if write:
            writer.finish("{}")
        return time.process_time() - cpu

    idle = pace(write=False)
    return (pace(write=True) - idle) / (total * BYTES / WORST)
