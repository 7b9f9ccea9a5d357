"""Write tests/data/wire/NAME.bin and NAME.json: bytes, and what they mean to every implementation of version 1.

Run in `tests` as ``python -m wire.make_vectors``. The meaning comes from the slow decoder in oracle.py; each
vector's JSON was read by hand as well. `pieces` says how the bytes came: how many, when (us, or
null), and whether a datagram ended.
"""

import json
import random
from pathlib import Path

from .oracle import decode, word

DATA = Path(__file__).parent.parent / "data" / "wire"


def change(stamp, x, y, p=True, **unused):
    return word("change", stamp, x, y, p, **unused)


def intensity(ticks, x, y, p=True, **unused):
    return word("intensity", ticks, x, y, p, **unused)


def whole(*words):
    return [(b"".join(words), None, False)]


def long_mix():
    """Enough words in a row for every block size: quiet runs, pairs, a mix, some damage."""
    draw, words, stamp = random.Random(5), [], 65_000
    for run in range(24):
        for _ in range(70):
            stamp += draw.random() < 0.2
            x, y, p = draw.randrange(64), draw.randrange(64), draw.random() < 0.5
            words.append(change(stamp % 65_536, x, y, p))
            if run % 3 == 1 or (run % 3 == 2 and draw.random() < 0.5):
                words.append(intensity(draw.randrange(151), x, y, p))
        if run % 6 == 5:
            words.append(bytes(draw.randrange(256) for _ in range(draw.randrange(1, 9))))
    return b"".join(words)


VECTORS = {
    "clean": ("Changes only, on the corners and at stamps with every bit.", {}, whole(
        change(0, 0, 0), change(1, 63, 0, p=False), change(127, 0, 63), change(128, 63, 63, p=False),
        change(16_383, 1, 2), change(16_384, 4, 8), change(49_151, 16, 32), change(65_535, 42, 21),
    )),
    "intensities": ("Changes with their intensity next to them, and one without.", {}, whole(
        change(10, 3, 4), intensity(40, 3, 4), change(10, 5, 6, p=False), intensity(0, 5, 6, p=False),
        change(11, 7, 8), change(12, 9, 10), intensity(65_535, 9, 10),
    )),
    "wrap": ("Time goes on over the wrap of 16 bits.", {}, whole(
        change(65_000, 1, 1), change(65_535, 1, 1), change(0, 1, 1), change(30_000, 1, 1), change(60_000, 1, 1),
        change(20, 1, 1),
    )),
    "steps_back": ("Up to 1000 stamps behind the latest time is a step back; 1001 lies ahead.", {}, whole(
        change(2000, 1, 1), change(1999, 1, 1), change(1000, 1, 1), change(2001, 1, 1), change(1000, 1, 1),
    )),
    "before_the_start": ("A step back from the first stamps is below zero.", {}, whole(
        change(5, 1, 1), change(65_535, 1, 1), change(6, 1, 1),
    )),
    "silence": ("Arrival times say how long a silence was: 3 s, 6.5 s, 20 s, 6.5536 s.", {}, [
        (change(100, 1, 1), 1_000_000, True), (change(30_100, 1, 1), 4_000_100, True),
        (change(95_100 % 65_536, 1, 1), 10_499_900, True), (change(295_100 % 65_536, 1, 1), 30_500_000, True),
        (change(360_636 % 65_536, 1, 1), 37_053_700, True),
    ]),
    "markers": ("Starts and stops; their X and Y are ignored.", {}, whole(
        word("marker", 5, p=True), change(6, 1, 1), word("marker", 7, 63, 63, p=False), change(8, 2, 2),
    )),
    "contradictory": ("Intensity and marker at once has no meaning.", {"columns": 8, "rows": 8}, whole(
        change(1, 1, 1), word("contradictory", 9, 1, 1), intensity(5, 1, 1), word("contradictory", 9, 60, 60),
        change(2, 2, 2),
    )),
    "outside": ("Words outside 8 rows, 4 columns; their stamps do not count.", {"columns": 4, "rows": 8}, whole(
        change(1, 3, 7), change(2, 4, 7), change(3, 3, 8), intensity(9, 4, 0), change(40_000, 63, 63),
        change(4, 0, 0), intensity(7, 0, 0),
    )),
    "unpaired": ("Intensities without a change directly before them on their taxel.", {}, whole(
        intensity(1, 1, 1), change(1, 1, 1), intensity(2, 1, 2), change(2, 1, 1), intensity(3, 1, 1),
        intensity(4, 1, 1), change(3, 2, 2), word("marker", 3), intensity(5, 2, 2), change(4, 2, 2),
        word("contradictory"), intensity(6, 2, 2),
    )),
    "differences": ("Intensities as differences, added up by polarity.", {"differences": True}, whole(
        change(1, 1, 1), intensity(50, 1, 1), change(2, 1, 1, p=False), intensity(20, 1, 1, p=False),
        change(3, 2, 2), intensity(7, 2, 2), change(4, 1, 1, p=False), intensity(40, 1, 1, p=False),
    )),
    "unused_bits": ("Z1 and the U bits are ignored.", {}, whole(
        *(change(k, k, k, unused=k) + intensity(k, k, k, unused=15 - k) for k in range(16)),
    )),
    "damage": ("Short events, stray bytes, a first byte alone, an end in the middle of a word.", {}, whole(
        b"\x00\x7f\x01", change(1, 1, 1), change(2, 2, 2)[:3], change(3, 3, 3), intensity(9, 3, 3)[:4], b"\x80\xff\x90",
        intensity(8, 3, 3), b"\x05", change(4, 4, 4), b"\x11\x22", intensity(7, 4, 4), change(5, 5, 5)[:2],
    )),
    "datagrams": ("A change waits for its datagram's end and no longer; words and pairs cut between pieces.", {}, [
        (change(1, 1, 1), None, True), (intensity(1, 1, 1), None, True), (change(2, 2, 2), None, False),
        (intensity(2, 2, 2), None, True), (change(3, 3, 3)[:2], None, False),
        (change(3, 3, 3)[2:] + intensity(3, 3, 3)[:1], None, False), (intensity(3, 3, 3)[1:], None, True),
        (change(4, 4, 4) + intensity(4, 4, 4)[:3], None, True), (intensity(4, 4, 4)[3:], None, True),
    ]),
    "long_mix": ("Long runs of changes, of pairs, of a mix, with damage between them.", {}, whole(long_mix())),
}  # fmt: skip


def main():
    DATA.mkdir(parents=True, exist_ok=True)
    for name, (about, special, pieces) in VECTORS.items():
        options = {"columns": 64, "rows": 64, "differences": False} | special
        meaning = decode(pieces, **options)
        (DATA / f"{name}.bin").write_bytes(b"".join(piece for piece, _, _ in pieces))
        lines = [f' "about": {json.dumps(about)}']
        lines += [f' "{key}": {json.dumps(value)}' for key, value in options.items()]
        lines.append(f' "pieces": {json.dumps([[len(data), arrived, end] for data, arrived, end in pieces])}')
        lines.append(f' "counts": {json.dumps(meaning.counts)}')
        lines.append(f' "markers": {json.dumps(meaning.markers)}')
        rows = ",\n".join(f"  {json.dumps(event)}" for event in meaning.events)
        lines.append(f' "events": [\n{rows}\n ]')
        (DATA / f"{name}.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    main()
