"""Print what taxel makes of one scene on this system, and write it to files that other systems read (`make platforms`).

Usage: python tools/platforms/results.py FOLDER [NAME=FOLDER...]. Prints a line for each result, its checksum, a tab and its name: decoded
events, the spikes of every encoder's examples, and what was read from files. Writes recordings and a readout into FOLDER and reads them, and
those that other systems wrote into theirs: each of those has a name.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from encode.scenes import ARRAY, touch  # noqa: E402
from encode.test_laws import ENCODERS  # noqa: E402

import taxel  # noqa: E402
from taxel.encode import LevelCrossing  # noqa: E402

ENDINGS = (".mcap", ".npz", ".h5", ".csv")


def checksum(values: Iterable[Any]) -> str:
    """Return a checksum of arrays: their types and bytes."""
    found = hashlib.blake2b(digest_size=12)
    for array in map(np.asarray, values):
        little = array.astype(array.dtype.newbyteorder("<"), copy=False)
        found.update(f"{little.dtype.str} {little.shape}\n".encode() + np.ascontiguousarray(little).tobytes())
    return found.hexdigest()


def of_events(events: taxel.Events) -> str:
    """Return the checksum of events."""
    return checksum((events.t, events.x, events.y, events.p, events.intensity, events.present))


def results() -> Iterator[tuple[str, str]]:
    """Compute: the name and checksum of each result."""
    scene = touch(np.random.default_rng(7), ARRAY, n=3000)
    yield "scene", of_events(scene)
    board = touch(np.random.default_rng(8), taxel.Array.thesis(), n=20_000)
    yield "decoded events", of_events(taxel.wire.decode(taxel.wire.encode(board)))
    for name, encoder in ENCODERS.items():
        spikes = encoder.encode(scene)
        times, trains = spikes.to_numpy()
        yield f"spikes of {name}", checksum((times, trains, () if spikes.values is None else spikes.values))


def write(folder: Path) -> None:
    """Write what other systems read."""
    folder.mkdir(parents=True, exist_ok=True)
    events = touch(np.random.default_rng(9), taxel.Array.thesis(), n=5000, absent=0.0)
    frames = taxel.Frames(np.random.default_rng(9).random((40, 3, 4)), np.arange(40) * 1000, unit="N")
    for ending in ENDINGS:
        taxel.convert(events, folder / f"events{ending}", overwrite=True)
        taxel.convert(frames, folder / f"frames{ending}", overwrite=True)
    neurons = {"ł": (taxel.Neuron(tau=2.0), [0.5, 0.25, 0.1, 0.0])}
    readout = taxel.Readout(LevelCrossing(levels=[50.0]), neurons, array=taxel.Array(1, 2), unit="N")
    readout.save(folder / "readout.json", overwrite=True)


def read(folder: Path) -> Iterator[tuple[str, str]]:
    """Read what some system wrote: the name and checksum of each file's contents."""
    for ending in ENDINGS:
        yield f"file events{ending}", of_events(taxel.open(folder / f"events{ending}").events)
        frames = taxel.open(folder / f"frames{ending}").frames()
        yield f"file frames{ending}", checksum((frames.values, frames.t))
    readout = taxel.Readout.load(folder / "readout.json")
    yield "file readout.json", hashlib.blake2b(repr(readout).encode(), digest_size=12).hexdigest()


def main() -> int:
    """Print the lines."""
    own, *others = sys.argv[1:]
    write(Path(own))
    folders = {"": own} | dict(text.split("=", 1) for text in others)
    lines = [f"{found}\t{name}" for name, found in results()]
    for system, folder in folders.items():
        lines += [f"{found}\t{name}{system and f' of {system}'}" for name, found in read(Path(folder))]
    sys.stdout.buffer.write("\n".join([*lines, ""]).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
