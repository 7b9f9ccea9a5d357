"""The reference, sections 1 and 3, read slowly: an obvious decoder and an obvious board, to judge the fast ones by."""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass, field

WRAP, BACK = 65_536, 1000


def word(kind: str, value: int = 0, x: int = 0, y: int = 0, p: bool = True, *, unused: int = 0) -> bytes:
    """Return one word of Table 5.4; `unused` holds Z1 and the three U bits, which a reader must ignore."""
    z2, z0 = {"change": (0, 0), "intensity": (1, 0), "marker": (0, 1), "contradictory": (1, 1)}[kind]
    u = [unused >> k & 1 for k in range(4)]
    return bytes(
        [
            0x80 | p << 6 | z2 << 5 | u[0] << 4 | z0 << 3 | u[1] << 2 | value >> 14,
            value >> 7 & 0x7F,
            value & 0x7F,
            u[2] << 6 | x,
            u[3] << 6 | y,
        ]
    )


@dataclass
class Meaning:
    """What bytes mean: events as [t, x, y, p, intensity or None], markers as [t, start], counts."""

    events: list[list] = field(default_factory=list)
    markers: list[list] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)


def decode(  # noqa: PLR0912, PLR0915  the reference from top to bottom, in one place
    pieces: list[tuple[bytes, int | None, bool]],
    *,
    columns: int = 64,
    rows: int = 64,
    differences: bool = False,
) -> Meaning:
    """Decode pieces (bytes, arrival in us or None, whether a datagram ends there)."""
    data = b"".join(piece for piece, _, _ in pieces)
    ends, total = [], 0
    for piece, _, _ in pieces:
        total += len(piece)
        ends.append(total)
    datagrams = [end for end, (_, _, last) in zip(ends, pieces, strict=True) if last]
    words = list(re.finditer(rb"[\x80-\xff][\x00-\x7f]{4}", data))
    firsts = sum(byte >= 0x80 for byte in data)

    out, counts = Meaning(), dict.fromkeys(COUNTS, 0)
    counts |= {
        "bytes": len(data),
        "words": len(words),
        "skipped": len(data) - 5 * len(words),
        "short": firsts - len(words),
    }
    latest = heard = None
    held: dict[tuple[int, int], int] = {}
    before = None  # the change directly before, as (event number, taxel, end)
    for match in words:
        b, end = match.group(), match.end()
        arrived = pieces[bisect_left(ends, end)][1]
        value = (b[0] & 3) << 14 | b[1] << 7 | b[2]
        x, y, p = b[3] & 63, b[4] & 63, bool(b[0] & 0x40)
        intensity, marker = bool(b[0] & 0x20), bool(b[0] & 0x08)
        if before and any(before[2] <= datagram < end for datagram in datagrams):
            before = None
        direct, before = before, None
        if intensity and marker:
            counts["contradictory"] += 1
            continue
        if not marker and (x >= columns or y >= rows):
            counts["outside"] += 1
            continue
        if intensity:
            if differences:
                value = held[x, y] = min(max(held.get((x, y), 0) + (value if p else -value), 0), 65_535)
            number = direct[0] if direct and direct[1] == (x, y) else None
            counts["unpaired" if number is None else "intensities"] += 1
            if number is not None:
                out.events[number][4] = value
            continue
        if latest is None:
            time = latest = value
        else:
            time = next(t for t in range(latest - BACK, latest - BACK + WRAP) if t % WRAP == value)
            if arrived is not None and heard is not None:
                silence = max(arrived - heard, 0) // 100
                while time + WRAP // 2 <= latest + silence:
                    time += WRAP
        counts["back"] += time < latest
        latest, heard = max(latest, time), arrived
        if marker:
            counts["markers"] += 1
            out.markers.append([time * 100, p])
        else:
            counts["changes"] += 1
            before = len(out.events), (x, y), end
            out.events.append([time * 100, x, y, p, None])
    out.counts = counts
    return out


COUNTS = (
    "bytes",
    "words",
    "skipped",
    "short",
    "changes",
    "intensities",
    "unpaired",
    "markers",
    "contradictory",
    "outside",
    "back",
)


class Board:
    """Section 3, "What makes an event", one taxel after the other."""

    def __init__(self, registers, *, columns=64, rows=64, previous="last_sent", intensity="value", queue=16_384):
        self.r, self.columns, self.rows = registers, columns, rows
        self.last_sent, self.value, self.queue = previous == "last_sent", intensity == "value", queue
        self.previous: dict[tuple[int, int], int] = {}
        self.time = 0  # 10 ns
        self.lfsr = 0xACE1
        self.dropped = self.not_returned = 0
        self.waiting: list[bytes] = []  # the words of a taxel, or a marker
        self.waiting_datagrams: list[list[bytes]] = []

    def draw(self) -> int:
        for _ in range(16):
            taps = [self.lfsr >> k & 1 for k in (0, 2, 3, 5)]
            self.lfsr = self.lfsr >> 1 | (sum(taps) % 2) << 15
        return self.lfsr

    def lines(self) -> list[int]:
        lines = list(range(self.r.lines))
        if self.r.random_lines:
            for k in range(len(lines) - 1):
                place = k + self.draw() * (len(lines) - k) // 65_536
                lines[k], lines[place] = lines[place], lines[k]
        return lines

    def mark(self, start: bool) -> None:
        self.enqueue(word("marker", self.time // 10_000 % WRAP, p=start))

    def enqueue(self, words: bytes) -> bool:
        held = sum(len(b"".join(d)) for d in self.waiting_datagrams) + len(b"".join(self.waiting))
        if (held + len(words)) // 5 > self.queue:
            self.dropped += 1
            return False
        self.waiting.append(words)
        return True

    def frame(self, ticks, most=10**9) -> list[bytes]:
        out: list[bytes] = []

        def offer() -> None:
            while self.waiting_datagrams and len(out) < most:
                out.append(b"".join(self.waiting_datagrams.pop(0)))

        def close() -> None:
            if self.waiting:
                self.waiting_datagrams.append(self.waiting)
                self.waiting = []
            offer()

        offer()
        steps = 64 // self.r.channels
        for place, x in enumerate(self.lines()):
            for step in range(steps):
                for channel in range(self.r.channels):
                    y = steps * channel + step
                    if y >= self.rows:
                        continue
                    trip = int(ticks[y * self.columns + x])
                    if trip == 65_535:
                        self.not_returned += 1
                        continue
                    new = min(trip, self.r.ramp)
                    old = self.previous.get((x, y), 0)
                    if abs(new - old) > self.r.noise_floor:
                        start = self.time
                        if not self.r.frame_sync:
                            start += place * self.r.row_change_period + step * self.r.col_change_period
                        p, stamp = new >= old, start // 10_000 % WRAP
                        shown = new if self.value else abs(new - old)
                        words = word("change", stamp, x, y, p) + word("intensity", shown, x, y, p)
                        if len(b"".join(self.waiting)) + 10 > 1400:
                            close()
                        if self.enqueue(words) and self.last_sent:
                            self.previous[x, y] = new
                    if not self.last_sent:
                        self.previous[x, y] = new
        close()
        self.time += self.r.lines * self.r.row_change_period
        return out
