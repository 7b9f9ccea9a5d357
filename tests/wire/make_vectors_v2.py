"""Write tests/data/wire_v2/NAME.bin and NAME.json: datagrams of version 2, and what they mean.

Run in `tests` as ``python -m wire.make_vectors_v2``. In a .bin each datagram has its length before it (16 bits). The
meaning comes from the slow reader in oracle_v2.py, which knows docs/wire-v2.md alone.
"""

import json
import random
from pathlib import Path

from .oracle_v2 import datagram, decode, markers, word, words

DATA = Path(__file__).parent.parent / "data" / "wire_v2"


def one(kind, events, *, base=0, stride=6, line=None, **rest):
    line = min(events[0][1] if events else 0, 127) if line is None else line
    body = words(kind, events, base=base, stride=stride, line=line)
    return datagram(kind, body, base=base, stride=stride, line=line, **rest)


CORNERS = [(0, 0, 0, 1, 9), (0, 0, 63, 0, 255), (0, 63, 0, 1, 0), (0, 63, 63, 0, 77)]


def everything():
    """Draw datagrams of all kinds; lose, repeat and flip some."""
    draw, out = random.Random(4), []
    for sequence in range(300):
        kind = draw.choice([0, 1, 1, 1, 2, 6, 7, 3, 5, 9])
        base = 200 * sequence
        if kind in (3, 5, 9):
            data = datagram(kind, markers((draw.randrange(100), draw.randrange(4), 7)), sequence=sequence, base=base)
        else:
            places = sorted(draw.sample(range(4096), draw.randrange(40)))
            top = 255 if kind in (1, 6) else 65_535
            events = [
                (base, place >> 6, place & 63, kind < 6 and draw.random() < 0.5, draw.randrange(top + 1) if kind else 0)
                for place in places
            ]
            flags = draw.choice([1, 1, 1, 3, 5, 9]) if kind < 3 else 1
            data = one(kind, events, base=base, sequence=sequence, flags=flags, span=draw.choice([0, 200]))
        fate = draw.randrange(12)
        if fate == 0:
            continue
        if fate == 1:
            data = bytearray(data)
            data[draw.randrange(18, len(data))] ^= 1 << draw.randrange(8)
            data = bytes(data)
        out += [data] * (2 if fate == 2 else 1)
    return out


VECTORS = {
    "corners": (
        "The four corners in each kind of event.",
        64,
        64,
        [
            one(0, [(0, x, y, p, 0) for _, x, y, p, _ in CORNERS], sequence=0),
            one(1, CORNERS, sequence=1),
            one(2, [(0, x, y, p, 257 * v) for _, x, y, p, v in CORNERS], sequence=2),
        ],
    ),
    "advances": (
        "Gaps around the ends of a skip, and over the largest advance.",
        256,
        256,
        [
            one(
                kind,
                [
                    (0, place >> 8, place & 255, 1, 3 if kind else 0)
                    for place in (0, 126, 253, 381, 445, 509, 16_894, 16_895, 49_664, 65_535)
                ],
                stride=8,
                sequence=kind,
            )
            for kind in (0, 1, 2)
        ],
    ),
    "lines": (
        "Positions that begin in the first event's line, before it, and in the last one that a header names.",
        256,
        256,
        [
            one(kind, [(0, x, y, 1, 3) for x, y in places], stride=8, line=line, sequence=sequence)
            for sequence, (kind, line, places) in enumerate(
                [
                    (1, None, [(40, 126), (40, 200)]),
                    (1, None, [(40, 127), (41, 0)]),
                    (1, 17, [(40, 126), (255, 255)]),
                    (0, 127, [(127, 0), (255, 255)]),
                    (2, None, [(200, 9), (255, 255)]),
                    (6, None, [(40, 126), (90, 0)]),
                    (7, 100, [(100, 0), (227, 255)]),
                ]
            )
        ]
        + [
            one(1, [(0, 90, 5, 1, 4), (100, 3, 5, 1, 5)], stride=8, sequence=7),
            datagram(1, word(1, 0, 0, 9), stride=20, line=127, sequence=8),
        ],
    ),
    "times": (
        "Stamps of their own, lines in any order, the latest offset.",
        64,
        64,
        [
            one(
                1,
                [
                    (1000, 5, 1, 1, 10),
                    (1000, 5, 9, 0, 11),
                    (1003, 2, 4, 1, 12),
                    (1003, 40, 4, 1, 13),
                    (1006, 1, 0, 0, 14),
                    (33_511, 1, 1, 1, 15),
                ],
                base=1000,
                flags=0,
                span=40_000,
            ),
            one(2, [(2**47, 5, 1, 1, 1000), (2**47 + 9, 5, 1, 0, 900)], base=2**47, flags=0, sequence=1),
        ],
    ),
    "heartbeats": (
        "Empty bodies promise and hold nothing.",
        64,
        64,
        [
            datagram(1, b"", span=192),
            datagram(0, b"", sequence=1, base=192, span=65_535),
            datagram(2, b"", sequence=2),
        ],
    ),
    "differences": (
        "Values are differences from the last one sent; one is lost, a state mends it.",
        8,
        8,
        [
            one(1, [(0, 1, 1, 1, 50)], stride=3, flags=3),
            one(1, [(9, 1, 1, 0, 20)], base=9, stride=3, flags=3, sequence=1),
            one(1, [(20, 1, 1, 1, 5)], base=20, stride=3, flags=3, sequence=3),
            one(6, [(30, 1, 1, 0, 40), (30, 2, 2, 0, 0)], base=30, stride=3, flags=1, sequence=4),
            one(6, [(40, 1, 1, 0, 40), (40, 2, 2, 0, 0)], base=40, stride=3, flags=1, sequence=5),
        ],
    ),
    "joined": (
        "Joined in mid-stream: a difference has no value before a state or a value told one.",
        8,
        8,
        [
            one(1, [(0, 1, 1, 1, 50), (0, 2, 2, 1, 7)], stride=3, flags=3, sequence=7),
            one(6, [(10, 1, 1, 0, 40)], base=10, stride=3, flags=1, sequence=8),
            one(1, [(20, 1, 1, 0, 15), (20, 2, 2, 1, 7)], base=20, stride=3, flags=3, sequence=9),
            one(1, [(30, 2, 2, 1, 9)], base=30, stride=3, flags=1, sequence=10),
            one(1, [(40, 2, 2, 0, 10), (40, 3, 3, 1, 1)], base=40, stride=3, flags=3, sequence=11),
        ],
    ),
    "old_states": (
        "A state that comes behind a later event does not undo it.",
        8,
        8,
        [
            one(1, [(500, 1, 1, 1, 50)], base=500, stride=3, sequence=2),
            one(6, [(400, 1, 1, 0, 10), (400, 3, 3, 0, 7)], base=400, stride=3, sequence=1),
        ],
    ),
    "losses": (
        "Lost, repeated, out of order, cut, flipped, of version 1, of another board.",
        64,
        64,
        [
            one(1, CORNERS, sequence=2**32 - 2),
            one(1, CORNERS, sequence=0),
            one(1, CORNERS, sequence=2**32 - 1),
            one(1, CORNERS, sequence=0),
            one(1, CORNERS, sequence=5),
            one(1, CORNERS, sequence=6)[:-1],
            b"",
            b"\x54",
            b"\x54\x21",
            one(1, CORNERS, sequence=7).replace(b"\x09", b"\x08", 1),
            b"\xc0\x00\x05\x03\x04",
            one(1, CORNERS, sequence=8, board=9),
        ],
    ),
    "outside": (
        "Taxels outside 5 rows, 3 columns.",
        5,
        3,
        [
            one(1, [(0, 2, 4, 1, 1), (0, 2, 5, 1, 1), (0, 3, 0, 1, 1), (0, 63, 63, 1, 1)], stride=3),
        ],
    ),
    "unknown": (
        "Kinds and flags that mean nothing yet; a body that ends within a word.",
        64,
        64,
        [
            datagram(5, b"\x01\x02\x03"),
            datagram(15, b"", sequence=1),
            one(1, CORNERS, sequence=2, flags=9),
            datagram(1, word(1, 1, 3, 9) + b"\x07", sequence=3),
            datagram(3, markers((5, 77, 1)), sequence=4),
        ],
    ),
    "markers": (
        "Start and stop, with offsets.",
        64,
        64,
        [
            datagram(3, markers((5, 1, 0), (70_000, 2, 0)), base=100),
        ],
    ),
    "resets": (
        "Two resets: time goes on, a straggler of the first session is still of its time.",
        64,
        64,
        [
            one(1, CORNERS, session=11, sequence=0, span=100),
            one(1, [(5000, x, y, p, v) for _, x, y, p, v in CORNERS], base=5000, session=11, sequence=2),
            one(1, CORNERS, session=12, sequence=0, flags=5),
            one(1, [(700, x, y, p, v) for _, x, y, p, v in CORNERS], base=700, session=11, sequence=1),
            one(1, [(9, 1, 1, 1, 1)], base=9, session=13, sequence=0),
        ],
    ),
    "everything": ("300 drawn datagrams of all kinds, some lost, repeated, flipped.", 64, 64, everything()),
}


def main():
    DATA.mkdir(exist_ok=True)
    for name, (says, rows, columns, datagrams) in VECTORS.items():
        events, marks, counts = decode(datagrams, rows, columns)
        (DATA / f"{name}.bin").write_bytes(b"".join(len(d).to_bytes(2, "little") + d for d in datagrams))
        meaning = {"says": says, "rows": rows, "columns": columns, "events": events, "markers": marks, "counts": counts}
        lines = ",\n ".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in meaning.items())
        (DATA / f"{name}.json").write_text(f"{{{lines}}}\n")


if __name__ == "__main__":
    main()
