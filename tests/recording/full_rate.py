"""Write a recording at the sensor's full rate until killed; say in a small shared file what was handed over.

Run as ``python full_rate.py RECORDING PROGRESS COMPRESSION``. PROGRESS holds two int64: datagrams, last arrival (ns).
"""

import json
import mmap
import struct
import sys
import time
from pathlib import Path

import numpy as np

from taxel import _core

BYTES = 1400
#: 21.3 million events/s of 5 bytes (thesis 4.4.1): datagrams a ms.
EACH_MS = 76
HEADER = {"array": {"rows": 64, "columns": 64, "pitch_mm": 2.67, "name": "thesis 64x64"}}


def payload(number: int) -> bytes:
    """Return the bytes of a datagram, different for each."""
    seed = np.random.default_rng(number % 1000).integers(0, 128, BYTES, dtype=np.uint8)
    return number.to_bytes(8, "little") + seed[8:].tobytes()


def main(recording: str, progress: str, compression: str) -> None:
    pieces = [np.frombuffer(payload(k), np.uint8) for k in range(1000)]
    writer = _core.RecordingWriter(recording, json.dumps(HEADER), compression, False)
    Path(progress).write_bytes(bytes(16))
    offsets = np.arange(EACH_MS + 1, dtype=np.int64) * BYTES
    with Path(progress).open("r+b") as file, mmap.mmap(file.fileno(), 16) as shared:
        sent, began = 0, time.monotonic()
        while True:
            due = int((time.monotonic() - began) * 1000) * EACH_MS
            while sent < due:
                numbers = np.arange(sent, sent + EACH_MS, dtype=np.uint64)
                rows = np.stack([pieces[int(n) % 1000] for n in numbers])
                rows[:, :8] = numbers.view(np.uint8).reshape(-1, 8)
                now = time.time_ns()
                writer.datagrams(np.full(EACH_MS, now), numbers, offsets, rows.ravel())
                sent += EACH_MS
                shared[:] = struct.pack("<qq", sent, now)
            time.sleep(0.0005)


if __name__ == "__main__":
    main(*sys.argv[1:])
