"""Boards that tests play, what is recorded of them, and how they wait for them."""

import contextlib
import socket
import time
from pathlib import Path

import numpy as np
from loopback import until

import taxel
from taxel import Array, Events, Neuron, Readout, wire
from taxel.encode import ChangeEvents
from taxel.live import Live

LOOPBACK = "127.0.0.1"


SMALL = Array(4, 4, pitch_mm=2.0, name="small")


def presses(presses: int) -> Events:
    """Each 40 ms a taxel rises by 40 ticks in 2 ms and falls again."""
    t, ticks, p = [], [], []
    for press in range(presses):
        for k in range(20):
            t.append(press * 40_000 + k * 200 // 100 * 100)
            ticks.append(60 + 4 * (k if k < 10 else 20 - k))
            p.append(k < 10)
    n = len(t)
    return Events(t, np.full(n, 1), np.full(n, 2), p, array=SMALL, intensity=np.array(ticks))


def datagrams(events: Events) -> list[bytes]:
    return [wire.encode(events[events.t == t]) for t in np.unique(events.t)]


def touch() -> Readout:
    weights = np.where(np.arange(32) < 16, 0.5, 0.0)
    return Readout(ChangeEvents(), {"touch": (Neuron(tau=2.0, refractory=15.0), weights)})


def play(events: Events, port: int, *, pace: float = 0.0) -> int:
    """Send a datagram a stamp; return how many."""
    sent = datagrams(events)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        for one in sent:
            link.sendto(one, (LOOPBACK, port))
            if pace:
                time.sleep(pace)
    return len(sent)


def wait_for(live: Live, decoded: int) -> None:
    until(lambda: live.counters["decoded"] >= decoded)


def held(file: Path) -> int:
    """Return how many events a recording that is being written holds so far."""
    with contextlib.suppress(FileNotFoundError, taxel.FormatError):
        return len(taxel.open(file).events)
    return 0


def above_rest(events: Events) -> np.ndarray:
    """What the taxels hold at last above their first values, which are the rest (more than the noise floor of 3)."""
    held, rest = np.zeros(SMALL.shape, int), np.zeros(SMALL.shape, int)
    for x, y, ticks in zip(events.x, events.y, events.intensity, strict=True):
        rest[y, x] = rest[y, x] or ticks
        held[y, x] = ticks
    above = held - rest
    return np.where(above > 3, above, 0)
