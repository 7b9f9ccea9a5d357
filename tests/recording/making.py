"""Small recordings for tests, made here."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader

import taxel
from taxel import Verdict, _core
from taxel.simulate import Board, Version2
from taxel.verdict import STATUSES
from taxel.wire import Registers

HEADER = {
    "array": {"rows": 64, "columns": 64, "pitch_mm": 2.67, "name": "thesis 64x64"},
    "source": "udp 127.0.0.1:5208",
    "started_ns": 1_700_000_000_000_000_000,
}


def some_events(n: int = 400, *, seed: int = 1, start: int = 0, intensity: bool = True) -> taxel.Events:
    """Return events as the board would send them: stamps in units of 100 us, mostly ascending."""
    rng = np.random.default_rng(seed)
    t = start + np.cumsum(rng.integers(0, 4, n)) * 100
    x, y, p = rng.integers(0, 64, n), rng.integers(0, 64, n), rng.random(n) < 0.5
    ticks = {"intensity": rng.integers(0, 150, n), "present": rng.random(n) < 0.9} if intensity else {}
    markers = [(int(t[0]), True), (int(t[-1]) + 100, False)]
    return taxel.Events(t, x, y, p, array=taxel.Array.thesis(), markers=markers, **ticks)


def some_frames(n: int = 7, shape: tuple[int, int] = (5, 6)) -> taxel.Frames:
    rng = np.random.default_rng(4)
    return taxel.Frames(rng.normal(size=(n, *shape)).astype(np.float32), np.arange(n) * 1000 - 2000)


def record(
    path: Path,
    events: taxel.Events,
    *,
    compression: str = "none",
    each: int = 10,
    finish: bool = True,
    header: dict[str, object] | None = None,
) -> None:
    """Write events as the live format, `each` a datagram, 1 ms on the way, with one remark of every kind."""
    writer = _core.RecordingWriter(path, json.dumps({**HEADER, **(header or {})}), compression, False)
    at = HEADER["started_ns"]
    assert isinstance(at, int)
    number = 0
    for k in range(0, len(events), each):
        part = events[k : k + each]
        # The first datagram carries the start, the last the stop.
        part.markers = events.markers[:1] * (k == 0) + events.markers[1:] * (k + each >= len(events))
        writer.datagram(at + int(part.t[-1]) * 1000 + 1_000_000, number, taxel.wire.encode(part))
        number += 1
    for t, start in events.markers:
        writer.marker(at + t * 1000, t, start)
    writer.note(at + 5_000_000, 5000, "left heel")
    writer.note(at + 6_000_000, None, "somebody coughed")
    writer.detection(at + 7_000_000, ("contact", 6000, 6192, 1.5, False))
    writer.registers(at, json.dumps(_core.registers_preset("5.2 kHz")))
    writer.preview(at, 0, np.full(4096, 75, np.uint16))
    pressed = np.full(4096, 75, np.uint16)
    pressed[:2] = 135, 105
    writer.preview(at + 100_000_000, 100_000, pressed)
    writer.counts(at, json.dumps({"received": number, "recorded": number}))
    if finish:
        writer.finish(json.dumps({"received": number}))


def images(place: Path, topics: str) -> list[tuple[str, dict[str, str], int, object]]:
    """Return topic, metadata of the channel, time in the file and message of all images of some topics."""
    found = []
    with place.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages():
            if not channel.topic.startswith(topics):
                continue
            assert (schema.name, schema.encoding, channel.message_encoding) == (
                "foxglove.RawImage",
                "protobuf",
                "protobuf",
            )
            files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
            pool = descriptor_pool.DescriptorPool()
            for one in files.file:
                pool.Add(one)
            image = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name)).FromString(message.data)
            found.append((channel.topic, channel.metadata, message.log_time, image))
    return found


@cache
def sent_by_a_board(version: int = 2, frames: int = 400) -> list[bytes]:
    """The datagrams of a board of which some taxels change in each frame, in the order in which it sends them."""
    board = Board(Registers(wire_version=version), version_2=Version2(states_us=0))
    draw, held = np.random.default_rng(3), np.full(4096, 20, np.uint16)
    sent = []
    for _ in range(frames):
        held[draw.integers(0, 4096, 200)] ^= 64
        sent += board.frame(held)
    return sent


def at_least(verdict: Verdict, status: str) -> bool:
    """Whether a status is that one or a worse one."""
    return STATUSES.index(verdict.status) >= STATUSES.index(status)


def pressed(path: Path) -> None:
    """Two taxels that rest at 50 and 40 ticks and are pressed by 30 and 10 from 1.1 s to 1.2 s."""
    rows = [
        (0, 2, 3, 50),
        (0, 4, 3, 40),
        (1_100_000, 2, 3, 80),
        (1_100_000, 4, 3, 50),
        (1_200_000, 2, 3, 50),
        (1_200_000, 4, 3, 40),
    ]
    t, x, y, ticks = zip(*rows, (1_300_000, 2, 3, 50), strict=True)
    taxel.convert(taxel.Events(t, x, y, [1] * 7, array=taxel.Array(6, 8, 2.0, name="small"), intensity=ticks), path)
