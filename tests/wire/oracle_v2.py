"""A slow reader and writer of version 2, from docs/wire-v2.md alone: the oracle of the fast ones."""

import struct


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    return crc ^ 0xFFFFFFFF


#: kind: bytes of a word, bits of its skip, bits of its value.
LAYOUT = {0: (2, 15, 0), 1: (2, 7, 8), 2: (4, 15, 16), 6: (2, 7, 8), 7: (4, 15, 16)}


def datagram(kind, body, *, sequence=0, base=0, session=1, board=0, stride=6, line=0, flags=1, span=0):
    head = struct.pack("<BBHI", 0x54, 0x20 | kind, board, sequence) + base.to_bytes(6, "little")
    places = bytes([line % 8 << 5 | stride, line // 8 << 4 | flags])
    data = head + struct.pack("<H", session) + places + body + struct.pack("<H", span)
    return data + struct.pack("<I", crc32c(data))


def word(kind, p, skip, value):
    size, s, v = LAYOUT[kind]
    return (int(p) << (s + v) | skip << v | value).to_bytes(size, "little")


def words(kind, events, *, base, stride, line=0):
    """Write (t, x, y, p, value) as words; rows ascend within a line, a position that does not begins again.

    Positions begin in `line`, in which the first event lies or before.
    """
    size, s, v = LAYOUT[kind]
    control, out, at, position = 2**s - 1, b"", base, (line << stride) - 1
    for t, x, y, p, value in events:
        target = (x << stride) + y
        if t != at or target <= position:
            out += word(kind, 1, control, 0) + (t - base).to_bytes(size, "little")
            at, position = t, -1
        gap = target - position - 1
        if gap >= control:
            q = gap >> (s - 1)
            gap -= q << (s - 1)
            while q:
                step = min(q, 2**v)
                out += word(kind, 0, control, step - 1)
                q -= step
        out += word(kind, p, gap, value)
        position = target
    return out


def markers(*given):
    return b"".join(struct.pack("<IHH", offset, code, argument) for offset, code, argument in given)


NAMES = (
    "datagrams intact repeated short long foreign checksum missing unknown_kind unknown_flags malformed events "
    "repaired states stale outside markers unknown_marker dropped resets unknown_value"
)


class Reader:
    """Events (t, x, y, p, value or None, repaired), markers and counts of one board's datagrams, one by one."""

    def __init__(self, rows, columns):
        self.rows, self.columns = rows, columns
        self.counts = dict.fromkeys(NAMES.split(), 0)
        self.events, self.markers = [], []
        self.board, self.seen, self.offset, self.latest = None, {}, {}, 0
        self.sessions = []
        self.held, self.held_at, self.whole = {}, {}, False

    def refused(self, data):
        if data[:1] not in (b"", b"\x54") or (len(data) > 1 and data[1] >> 4 != 2):
            return "foreign"
        if len(data) < 24:
            return "short"
        if len(data) > 1400:
            return "long"
        if crc32c(data[:-4]) != int.from_bytes(data[-4:], "little"):
            return "checksum"
        number = int.from_bytes(data[2:4], "little")
        if self.board is None:
            self.board = number
        return None if number == self.board else "foreign"

    def push(self, data):
        self.counts["datagrams"] += 1
        if cause := self.refused(data):
            self.counts[cause] += 1
            return
        sequence, base = int.from_bytes(data[4:8], "little"), int.from_bytes(data[8:14], "little")
        session, span = (int.from_bytes(data[a:b], "little") for a, b in ((14, 16), (-6, -4)))
        stride, line, flags = data[16] % 32, data[16] // 32 + 8 * (data[17] // 16), data[17] % 16
        if session not in self.sessions:
            self.offset[session] = self.latest - base if self.sessions else 0
            self.counts["resets"] += bool(self.sessions)
            self.sessions = [*self.sessions[-3:], session]
            # After the board's reset every taxel's value is 0; a receiver that joins later must be told the values.
            self.held, self.held_at, self.whole = {}, {}, sequence == 0
            self.seen[session] = {}
        if (came := self.seen[session].setdefault(sequence, data)) is not data:
            self.counts["repeated" if came == data else "foreign"] += 1
            return
        self.counts["intact"] += 1
        self.counts["dropped"] += flags >> 2 & 1
        self.counts["unknown_flags"] += flags > 7
        base += self.offset[session]
        self.latest = max(self.latest, base)
        late = session != self.sessions[-1]
        since = self.held, self.held_at, self.whole
        if late:
            self.held, self.held_at, self.whole = {}, {}, False
        self.body(data[1] & 15, data[18:-6], base, stride, line, flags, late)
        if late:
            self.held, self.held_at, self.whole = since
        self.latest = max(self.latest, base + span if span else base)

    def body(self, kind, body, base, stride, line, flags, late):
        if kind == 3:
            self.marked(body, base)
        elif kind == 4:
            self.counts["malformed"] += len(body) < 40
        elif kind not in LAYOUT:
            self.counts["unknown_kind"] += 1
        else:
            self.words(kind, body, base, stride, line, flags, late)

    def marked(self, body, base):
        self.counts["malformed"] += len(body) % 8 > 0
        for k in range(0, len(body) - 7, 8):
            offset, code, _ = struct.unpack("<IHH", body[k : k + 8])
            if code in (1, 2):
                self.markers.append((base + offset, code == 1))
                self.latest = max(self.latest, base + offset)
            else:
                self.counts["unknown_marker"] += 1

    def words(self, kind, body, base, stride, line, flags, late):
        size, s, v = LAYOUT[kind]
        malformed = len(body) % size > 0
        given = iter(int.from_bytes(body[k : k + size], "little") for k in range(0, len(body) - size + 1, size))
        t, position = base, (line << stride) - 1
        for bits in given:
            p, skip, value = bits >> (s + v), bits >> v & (2**s - 1), bits & (2**v - 1)
            if skip < 2**s - 1:
                position += skip + 1
                self.event(kind, t, position >> stride, position & (2**stride - 1), p, value, flags, late)
            elif p:
                offset = next(given, 2**32)
                if offset > 32_511:
                    malformed = True
                    break
                t, position = base + offset, -1
            else:
                position += (value + 1) << (s - 1)
        self.counts["malformed"] += malformed

    def event(self, kind, t, x, y, p, value, flags, late):
        if x >= self.columns or y >= self.rows:
            self.counts["outside"] += 1
            return
        before, newest = self.held.get((x, y)), t >= self.held_at.get((x, y), t)
        if kind >= 6:
            self.counts["states"] += 1
            if late or not newest:
                self.counts["stale"] += 1
                return
            if before == value:
                return
            self.counts["repaired"] += 1
            p = value >= (before or 0)
        elif flags & 2 and kind and before is None and not self.whole:
            self.counts["unknown_value"] += 1
            self.events.append((t, x, y, bool(p), None, False))
            self.latest = max(self.latest, t)
            return
        elif flags & 2:
            value = max(0, min(65535, (before or 0) + (value if p else -value)))
        if kind and (newest or flags & 2):
            self.held[x, y], self.held_at[x, y] = value, max(t, self.held_at.get((x, y), t))
        self.latest = max(self.latest, t)
        self.events.append((t, x, y, bool(p), value if kind else None, kind >= 6))


def decode(datagrams, rows, columns):
    """Return events, markers and counts of datagrams that come one by one."""
    reader = Reader(rows, columns)
    for data in datagrams:
        reader.push(data)
    for k, numbers in enumerate(reader.seen.values()):
        # Modulo 2^32: numbers that are far apart are on opposite sides of the wrap.
        wrapped = max(numbers) - min(numbers) > 2**31
        line = [n + 2**32 if wrapped and n < 2**31 else n for n in numbers]
        # After a reset the numbers begin at 0.
        first = 0 if k and max(line) < 2**31 else min(line)
        reader.counts["missing"] += max(line) - first + 1 - len(line)
    reader.counts["events"], reader.counts["markers"] = len(reader.events), len(reader.markers)
    return reader.events, reader.markers, reader.counts
