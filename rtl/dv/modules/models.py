"""What the documents say that the board does, in plain Python: each part once, for all tests of modules."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

#: A comparator that had not returned as its ramp began.
NOT_RETURNED = 0xFFFF


def crc_32c(data: bytes) -> int:
    """Return the CRC-32C: of "123456789" it is E3069283."""
    crc = 0xFFFF_FFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0x82F6_3B78 * (crc & 1)
    return ~crc & 0xFFFF_FFFF


class Lines:
    """The order of lines, as docs/readings.md has it."""

    def __init__(self) -> None:
        self.word = 0xACE1

    def draw(self) -> int:
        for _ in range(16):
            top = (self.word ^ self.word >> 2 ^ self.word >> 3 ^ self.word >> 5) & 1
            self.word = self.word >> 1 | top << 15
        return self.word

    def order(self, lines: int, shuffled: bool) -> list[int]:
        order = list(range(lines))
        for k in range(lines - 1) if shuffled else ():
            other = k + (self.draw() * (lines - k) >> 16)
            order[k], order[other] = order[other], order[k]
        return order


class Chain:
    """A chain of shift registers, which holds anything at first, between its two pins."""

    def __init__(self, places: list[int]) -> None:
        self.places = places
        self.clock = 0

    def follow(self, clock: int, data: int) -> None:
        if clock and not self.clock:
            self.places = [data, *self.places[:-1]]
        self.clock = clock

    def driven(self, lines: int) -> list[int]:
        """Which of the first lines are driven."""
        return [k for k, driven in enumerate(self.places[:lines]) if driven]


def compressed(ticks: int) -> int:
    """Return ticks after the power law, in 2^-16 (docs/registers.md)."""
    return round(min(ticks, 2047) ** 0.7 * 2**16)


class Afferent:
    """One taxel of FA-1 as docs/registers.md has it, in whole numbers of 2^-16."""

    def __init__(self) -> None:
        self.base: int | None = None
        self.threshold = 0

    def frame(self, ticks: int, rest: int, jump: int, decay: int) -> tuple[int, int] | None:
        """Give a frame's reading; return a spike's polarity and intensity."""
        pressure, theta_0 = compressed(ticks), rest << 6
        if self.base is None:
            self.base, self.threshold = pressure, theta_0
            return None
        integral = pressure - self.base
        if abs(integral) > self.threshold:
            self.base, self.threshold = pressure, self.threshold + jump * theta_0 // 256
            return int(integral >= 0), min(abs(integral) >> 6, 65535)
        self.threshold = self.threshold - decay * theta_0 // 1024 if self.threshold > theta_0 else theta_0
        return None


def words_1(x: int, y: int, more: int, time: int, value: int | None = None, *, marker: bool = False) -> bytes:
    """Return an event of version 1 (docs/wire.md): five bytes, and five more where it has a value."""
    data = b""
    for second, number in ((0, time), (1, value)):
        if number is not None:
            first = 0x80 | more << 6 | second << 5 | marker << 3 | number >> 14
            data += bytes([first, number >> 7 & 0x7F, number & 0x7F, x, y])
    return data


def datagrams_1(frame: list[bytes], most: int = 280) -> list[bytes]:
    """Return the datagrams of a frame's events: one that has no room begins the next."""
    whole: list[bytes] = []
    for event in frame:
        if whole and len(whole[-1]) + len(event) <= 5 * most:
            whole[-1] += event
        else:
            whole.append(event)
    return whole


@dataclass
class Datagram:
    """A datagram of version 2 (docs/wire-v2.md), as its board begins it."""

    kind: int
    base: int
    frame_sync: int = 1
    differences: int = 0
    dropped: int = 0
    line: int = 0
    span: int = 0
    body: bytes = b""
    sequence: int = 0
    # Of the event before: its time and position.
    at: int = 0
    position: int = -1

    def encoded(self, stride: int, board: int, session: int) -> bytes:
        """Return its bytes."""
        flags = self.frame_sync | self.differences << 1 | self.dropped << 2 | self.line >> 3 << 4
        data = bytes([0x54, 2 << 4 | self.kind]) + board.to_bytes(2, "little") + self.sequence.to_bytes(4, "little")
        data += self.base.to_bytes(6, "little") + session.to_bytes(2, "little")
        data += bytes([stride | (self.line & 7) << 5, flags]) + self.body + self.span.to_bytes(2, "little")
        return data + crc_32c(data).to_bytes(4, "little")


@dataclass
class Version2:
    """What a board of version 2 sends: "What the board sends" of docs/wire-v2.md."""

    stride: int
    most: int = 1376
    hold: int = 0
    heartbeat: int = 10_000
    sent: list[Datagram] = field(default_factory=list)
    begun: Datagram | None = None
    promised: int = 0
    latest: int | None = None  # time of the last event
    lost: int = 0

    def send(self, datagram: Datagram) -> None:
        datagram.sequence = len(self.sent)
        self.sent.append(datagram)

    def begin(self, **fields: int) -> Datagram:
        """Begin a datagram: events that were dropped before show in it."""
        lost, self.lost = self.lost, 0
        return Datagram(dropped=lost, **fields)

    def close(self, until: int) -> None:
        """Send what was begun, with a promise."""
        now, self.begun = self.begun, None
        if now is None:
            return
        span = until - now.base
        now.span = min(span, 65535)
        self.send(now)
        self.promised = max(self.promised, until)
        if span > 65535:
            form = {"kind": now.kind, "frame_sync": now.frame_sync, "differences": now.differences}
            self.send(self.begin(base=until - 65535, **form))
            self.sent[-1].span = 65535

    def words(self, x: int, y: int, at: int, more: int, value: int) -> bytes:
        """Return the words of an event in the datagram that was begun."""
        now, place = self.begun, x << self.stride | y
        assert now is not None
        skips, values = {0: (15, 0), 1: (7, 8), 2: (15, 16)}[now.kind]
        size, ones = (skips + 1 + values) // 8, (1 << skips) - 1

        def word(top: int, skip: int, low: int) -> bytes:
            return (top << skips + values | skip << values | low).to_bytes(size, "little")

        data, before = b"", now.position
        if at != now.at or place <= before:
            data, before = word(1, ones, 0) + (at - now.base).to_bytes(size, "little"), -1
        gap = place - before - 1
        if gap >= ones:
            count = gap >> skips - 1
            data += word(0, ones, count - 1)
            gap -= count << skips - 1
        return data + word(more, gap, min(value, (1 << values) - 1))

    def event(self, x: int, y: int, at: int, more: int, value: int, **form: int) -> None:
        """Take an event that is sent in a form: kind, frame_sync, differences."""
        now = self.begun
        if now is not None:
            others = any(getattr(now, name) != number for name, number in form.items())
            if others or at - now.base > 32_511 or len(now.body + self.words(x, y, at, more, value)) > self.most:
                self.close(at)
        if self.begun is None:
            self.begun = self.begin(base=at, line=x, at=at, position=(x << self.stride) - 1, **form)
        self.begun.body += self.words(x, y, at, more, value)
        self.begun.at, self.begun.position = at, x << self.stride | y
        self.latest = at

    def marker(self, at: int, start: int, **form: int) -> None:
        self.close(at)
        self.send(self.begin(base=at, **form | {"kind": 3}))
        self.sent[-1].body = bytes([0, 0, 0, 0, 1 if start else 2, 0, 0, 0])

    def frame_end(self, at: int, length: int, also: bool, **form: int) -> None:
        """End a frame of so many us; whether states or totals follow."""
        if self.begun is not None:
            if at + length - self.begun.base > self.hold or also or not self.hold:
                self.close(at)
        elif at > self.promised and (
            (self.latest is not None and at - self.latest <= 100_000) or at - self.promised >= self.heartbeat
        ):
            base = max(self.promised, at - 65535)
            self.send(self.begin(base=base, **form))
            self.sent[-1].span = at - base
            self.promised = at

    def states(self, at: int, line: int, values: list[int], **form: int) -> None:
        size = 2 if form["kind"] == 1 else 4
        limit = 255 if size == 2 else 65535
        self.send(self.begin(base=at, line=line, **form | {"kind": 6 if size == 2 else 7, "differences": 0}))
        self.sent[-1].body = b"".join(min(value, limit).to_bytes(size, "little") for value in values)

    def totals(self, at: int, frames: int, events: int, dropped: int, faults: int, **form: int) -> None:
        counts = [frames, events, dropped, len(self.sent), faults]
        self.send(self.begin(base=at, **form | {"kind": 4}))
        self.sent[-1].body = b"".join(count.to_bytes(8, "little") for count in counts)


class Comparators:
    """Ideal comparators as the logic samples them: each trips within the tick of its taxel, from the ramp's rise on.

    They are asked for once a fast clock, `delay` clocks of which pass from the ramp to the samples taken during it.
    """

    def __init__(self, delay: int) -> None:
        self.late = deque([0] * (delay - 1))
        self.high = self.sample = self.level = self.all = 0
        self.trips: dict[int, int] = {}

    def rise(self, ticks: list[int], inverted: bool) -> None:
        """Begin a ramp: what the comparators of all channels will do."""
        self.sample = 0
        self.all = (1 << 2 * len(ticks)) - 1 if inverted else 0
        self.follow(ticks)

    def follow(self, ticks: list[int]) -> None:
        """Select other taxels while the ramp rises: the comparators show at once what those would have done."""
        self.trips, self.level = {}, 0
        for channel, tick in enumerate(ticks):
            if tick == NOT_RETURNED or tick < self.sample:
                self.level |= 1 << 2 * channel
            else:
                self.trips[tick] = self.trips.get(tick, 0) | 1 << 2 * channel

    def pairs(self) -> int:
        """Return the samples of a clock that are there now: of each channel those of both halves."""
        pairs = 0
        for half in range(2):
            pairs |= self.level << half
            self.level |= self.trips.get(self.sample, 0)
            self.sample += 1
        self.late.append(pairs ^ self.all)
        return self.late.popleft()


class Ball:
    """The pattern, as docs/registers.md has it: frames since it began, and what a taxel reads."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns, self.rows = (1 << (size - 1).bit_length() for size in (columns, rows))
        self.n: int | None = None

    def frame(self, rolls: bool) -> None:
        """Begin a frame of which the pattern is on, or off."""
        self.n = None if not rolls else 0 if self.n is None else (self.n + 1) % 65536

    def value(self, x: int, y: int, ramp: int) -> int:
        """Return what a taxel reads in this frame."""
        assert self.n is not None
        ahead = (self.n // 16 - 16 * x) % (16 * self.columns), (self.n // 2 - 16 * y) % (16 * self.rows)
        a, b = (min(d, 16 * size - d) for d, size in zip(ahead, (self.columns, self.rows), strict=True))
        return max(0, min(128, ramp) - max(a, b) - min(a, b) // 2)


class Scan:
    """The changes and spikes of frames of one array, in the order of the scan (docs/wire.md)."""

    def __init__(self, columns: int, rows: int, channels: int) -> None:
        self.columns, self.rows, self.channels = columns, rows, channels
        self.steps = -(-max(rows, 64) // channels)
        self.held: dict[tuple[int, int], int] = {}
        self.afferents: dict[tuple[int, int], Afferent] = {}

    def taxels(self) -> list[tuple[int, int]]:
        """Return all taxels as they are scanned: line and row."""
        steps = range(self.steps)
        rows = [self.steps * channel + step for step in steps for channel in range(self.channels)]
        return [(x, y) for x in range(self.columns) for y in rows if y < self.rows]

    def frame(
        self, ticks: dict[tuple[int, int], int], ramp: int, floor: int, threshold: tuple[int, int, int] | None = None
    ) -> list[tuple[int, int, int, int]]:
        """Return line, row, polarity and value of each event; with a threshold (rest, jump, decay) those of FA-1."""
        events = []
        if threshold is None:
            self.afferents.clear()
        for taxel in self.taxels():
            value = min(ticks[taxel], ramp)
            if ticks[taxel] == NOT_RETURNED:
                continue
            if threshold:
                spike = self.afferents.setdefault(taxel, Afferent()).frame(value, *threshold)
                if spike:
                    events.append((*taxel, *spike))
            elif abs(value - self.held.get(taxel, 0)) > floor:
                events.append((*taxel, int(value >= self.held.get(taxel, 0)), value))
                self.held[taxel] = value
        return events
