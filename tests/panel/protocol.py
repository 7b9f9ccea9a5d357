"""A client of the panel's server, without the page's code, and what the tests of the server share."""

from __future__ import annotations

import json
import socket
import struct
import time
from contextlib import contextmanager
from types import SimpleNamespace
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from tests.live.emulated import ARRAY, emulated

from taxel.live import Live
from taxel.panel import Panel

websockets = pytest.importorskip("websockets", reason="the test extra brings websockets")


client = pytest.importorskip("websockets.sync.client")


#: Timeout for an event on a busy machine, s.
SOON = 60.0


#: Where a command says that its panel is.
ADDRESS = r"http://127\.0\.0\.1:\d+/#\S+"


def door(address):
    """The place of a panel and its token, which its address holds."""
    url = urlsplit(address)
    return SimpleNamespace(address=(url.hostname, url.port), token=parse_qs(url.fragment)["token"][0])


class Client:
    """Somebody else's page."""

    def __init__(self, panel, **changed):
        self.host, self.token = "{}:{}".format(*panel.address), panel.token
        how = {"origin": f"http://{self.host}", "subprotocols": ["taxel.panel.1", f"token.{panel.token}"], **changed}
        self.door = client.connect(f"ws://{self.host}/socket", max_size=None, open_timeout=SOON, **how)
        self.socket = self.door.__enter__()
        self.frames, self.said, self.ids, self.asked = [], [], 0, 0

    def __enter__(self):
        return self

    def __exit__(self, *raised):
        self.door.__exit__(*raised)

    def send(self, **message):
        self.socket.send(json.dumps(message))

    def next(self):
        message = self.socket.recv(timeout=SOON)
        if isinstance(message, bytes):
            self.frames.append(message)
            self.send(type="credit", n=1)
            return message
        self.said.append(json.loads(message))
        return self.said[-1]

    def until(self, kind, **wanted):
        until = time.monotonic() + SOON
        while time.monotonic() < until:
            message = self.next()
            if isinstance(message, bytes):
                if kind == "frame":
                    return message
            elif message["type"] == kind and all(message[key] == value for key, value in wanted.items()):
                return message
        raise AssertionError(f"no {kind} {wanted}; the last were {[m['type'] for m in self.said[-20:]]}")

    def since_asked(self, kind, **wanted):
        """What may also have been told before the last question was answered."""
        for message in self.said[self.asked :]:
            if message["type"] == kind and all(message[key] == value for key, value in wanted.items()):
                return message
        return self.until(kind, **wanted)

    def ask(self, kind, **message):
        self.ids += 1
        self.asked = len(self.said)
        self.send(type=kind, id=self.ids, **message)
        while True:
            answer = self.next()
            if not isinstance(answer, bytes) and answer["type"] in ("done", "refused") and answer["id"] == self.ids:
                return answer

    def labels(self):
        """The rows of the last message of labels."""
        return next(message["labels"] for message in reversed(self.said) if message["type"] == "labels")

    def mark(self, label, t_us, **more):
        return self.ask("change", changes=[{"new": row(label, t_us, **more)}])

    def alter(self, old, **by):
        return self.ask("change", changes=[{"old": old, "new": {**old, **by}}])

    def remove(self, old):
        return self.ask("change", changes=[{"old": old}])


#: A value that no taxel has: it is missing.
UNKNOWN = 65_535


def row(label, t_us, source="", trial="", replaces_us=None):
    """A label as the page has it."""
    return {"label": label, "t_us": t_us, "source": source, "trial": trial, "replaces_us": replaces_us}


def head(frame):
    names = ("magic", "bytes", "flags", "number", "rows", "columns", "t_us", "made_ns", "events", "watched")
    names += ("column_us", "first", "count", "none")
    values = struct.unpack_from("<4sHHIHHqqQIIqII", frame)
    sections = struct.unpack_from("<18I", frame, 64)
    return dict(zip(names, values, strict=True)), list(zip(sections[::2], sections[1::2], strict=True))


def section(frame, k, dtype):
    start, size = head(frame)[1][k]
    return np.frombuffer(frame, dtype, count=size // np.dtype(dtype).itemsize, offset=start)


#: The curves of a column of time, least and greatest, and those at the time of a frame.
EXTENT = np.dtype([("sum", "<u4", 2), ("area", "<u4", 2), ("x", "<f4", 2), ("y", "<f4", 2)])
CURVE = np.dtype([("sum", "<u4"), ("area", "<u4"), ("x", "<f4"), ("y", "<f4")])


def held_in(t, column, column_us, shown_us):
    """Which of the values from times on are held at any time within a column of time, up to the time shown."""
    begin, end = column * column_us, min((column + 1) * column_us - 1, shown_us)
    first, last = np.searchsorted(t, [begin, end], side="right") - 1
    return range(max(0, first), last + 1)


def word(t_us, x, y, ticks, more=True):
    """A change and its intensity, version 1 of the wire (docs/wire.md)."""
    t = t_us // 100 % 65_536
    first = [0x80 | more << 6, t]
    second = [0xA0 | more << 6, ticks]
    return b"".join(bytes([a | b >> 14, b >> 7 & 127, b & 127, x, y]) for a, b in (first, second))


def say(live, *datagrams):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        for datagram in datagrams:
            board.sendto(datagram, live.address)


def heard(live, events):
    until = time.monotonic() + SOON
    while live.counters["events"] < events:
        assert time.monotonic() < until, live.counters
        time.sleep(0.01)


@contextmanager
def page_of_a_board(folder, **fields):
    """An emulated board, a panel that hears it and holds its serial line, and a client of that."""
    with (
        emulated(**fields) as board,
        Live(board.port, host="127.0.0.1", array=ARRAY) as live,
        Panel(live, control=board.place, folder=folder) as panel,
        Client(panel) as page,
    ):
        yield board, panel, page


def opened(page, name, **more):
    """Open a recording; return what the server said of it, and the frame shown at a time."""
    assert page.ask("open", name=name, **more)["type"] == "done"
    return page.since_asked("opened", name=name)


def values_at(page, about, t_us):
    """Return the values that the client draws at a time, in the unit of the file; NaN where one is missing."""
    assert page.ask("seek", t_us=t_us)["type"] == "done"
    page.send(type="credit", n=2)
    while True:
        frame = page.until("frame")
        found = head(frame)[0]
        if found["t_us"] == t_us:
            break
    ticks = section(frame, 0, "<u2").reshape(found["rows"], found["columns"]).astype(float)
    ticks[ticks == UNKNOWN] = np.nan
    of = about["frames"]
    return (ticks - of["zero"]) * of["step"], frame
