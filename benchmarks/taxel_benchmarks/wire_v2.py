"""Size and decoding speed of version 2 of the wire, beside version 1 with the same events.

Bytes an event: the same trip times go through a board of each version at 5208 frames/s (kind S, values included).
The other contents of version 2 (heartbeats, states, totals) are counted apart. Scenes: every taxel in
every frame; a footfall, which is a frame that rolls from heel to toe, drawn by a seed (no recording); a ball
dropped and pressed (the demo's scene of that seed), with a tare.

Decoding: checksums included, beside version 1's pairs of change and intensity; an event is a pair. Version 2 is always
decoded a datagram at a time, each with its length before it; version 1 as one stream without datagrams, and a datagram
at a time as a host receives it, with a list of lengths. In scenes a datagram has few events, so compare with the
second. A call decodes a piece of some 65 536 events into new memory, as a reader of files does. Heartbeats, which
version 1 does not know, are left out of what is decoded (in the drop 94 of 100 datagrams
are empty): their numbers are then missing, which costs version 2 something, most in the drop. What they cost is stated
beside.

Peer: wire version 1. Unit: bytes an event; events/s. Goal: bytes .21, .75 and 1.05 of version 1 (full, footfall, drop;
.8 with a hold of 1 ms); 400, 200 and 130 million events/s decoded, of which a board sends at most 21.3.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from taxel import wire
from taxel.simulate import Board, FrameSequence, Scene, Silence, Version2, play
from taxel.wire import FRAME_US, Registers
from taxel_benchmarks._goals import Goal, at_least, at_most
from taxel_benchmarks._rounds import compared, measure

SEED, TARE_MS = 20_261_121, 50.0

#: Number of events to decode; less for the drop, whose frames are nearly all silent.
DECODED = {"full array": 4_000_000, "footfall": 4_000_000, "drop": 300_000}

#: Number of events that a call decodes, at least.
PIECE = 65_536

#: Bytes of a datagram without events.
EMPTY = 24

#: Goals at most: bytes an event, of version 1's.
BYTES = {"full array, at once": 0.21, "footfall, at once": 0.75, "drop, at once": 1.05, "drop, hold 1 ms": 0.80}
#: Goals at least: events decoded a second, in millions, or of version 1's.
DECODING = {
    "version 2, full array, million events/s": 400.0,
    "version 2, footfall, million events/s": 200.0,
    "version 2, drop, million events/s": 130.0,
}

Frames = list[NDArray[np.uint16]]


def full() -> Frames:
    """Return frames in which every taxel moves beyond the floor."""
    return [np.full(4096, 40 + 60 * (k % 2), np.uint16) for k in range(200)]


def felt(acts: list[Any]) -> Frames:
    """Return the values of the taxels frame by frame, from the start marker on, as a board of version 1 sends them."""
    events = play([Silence(TARE_MS + 50.0), *acts], seed=SEED, tare_ms=TARE_MS).events
    start, stop = (t for t, _ in events.markers)
    held = np.zeros(4096, np.uint16)
    frame = ((events.t + 100) // FRAME_US).astype(int)
    place, first, last = events.y.astype(int) * 64 + events.x, int(start // FRAME_US), int(stop // FRAME_US)
    frames, edges = [], np.searchsorted(frame, np.arange(frame[0], last + 2))
    for k, (a, b) in enumerate(pairwise(edges), int(frame[0])):
        held[place[a:b]] = events.intensity[a:b]
        if k >= first:
            frames.append(held.copy())
    return frames


def footfall() -> Frames:
    """Return a footfall: a loaded patch that rolls from heel to toe, and a toe."""
    draw = np.random.default_rng(SEED)
    y, x = np.mgrid[:64, :64]
    frames = np.zeros((350, 64, 64), np.float32)
    for k in range(1, 349):
        share = k / 349
        centre, load = 10 + 40 * share, np.sin(np.pi * share) ** 0.3
        sole = np.exp(-(((y - centre) / 9) ** 2) - ((x - 32 - 4 * np.sin(3 * share)) / 6) ** 2)
        toe = np.exp(-(((y - 54) / 3) ** 2) - ((x - 36) / 3) ** 2) * max(0.0, share - 0.5)
        frames[k] = load * (sole + 1.5 * toe)
    frames *= np.float32(0.8) / frames.max() * (1 + 0.02 * draw.standard_normal((64, 64)).clip(-2, 2))
    return felt([FrameSequence(frames.clip(0, 1), 2000.0)])


def drop() -> Frames:
    """Return a ball that drops, bounces, is caught and pressed."""
    return felt([Scene.draw(SEED)])


def sent(frames: Frames, registers: Registers, **options: int) -> list[bytes]:
    """Return the datagrams of a board that starts with the values of the first frame."""
    board = Board(registers, version_2=Version2(**options))
    board.frame(frames[0])
    return [datagram for frame in frames[1:] for datagram in board.frame(frame)]


def sizes(frames: Frames) -> dict[str, Any]:
    """Return bytes an event: of version 1, and of version 2 by purpose."""
    one = sent(frames, Registers())
    changes = sum(map(len, one)) // 10
    found: dict[str, Any] = {"events": changes, "frames": len(frames) - 1, "version 1": 10.0}
    for name, hold in (("at once", 0), ("hold 1 ms", 1000)):
        two = sent(frames, Registers(wire_version=2), hold_us=hold)
        kinds = {"events": 0, "heartbeats": 0, "states": 0, "totals": 0}
        for datagram in two:
            kind = datagram[1] & 15
            what = "totals" if kind == 4 else "states" if kind in (6, 7) else "events"
            kinds["heartbeats" if len(datagram) == EMPTY else what] += len(datagram)
        found[name] = {what: total / changes for what, total in kinds.items()}
        found[name]["events against version 1"] = kinds["events"] / changes / 10.0
    return found


@dataclass(frozen=True)
class Stream:
    """Hold pieces of consecutive datagrams with their lengths, the number of events, and the heartbeats left out."""

    pieces: list[tuple[bytes, NDArray[np.int64]]]
    events: int
    heartbeats: bytes

    def decode(self, version: Literal[1, 2], *, by_datagrams: bool = False) -> int:
        """Decode piece after piece; return the number of events."""
        return sum(
            len(wire.decode(data, version, lengths=lengths if by_datagrams else None)) for data, lengths in self.pieces
        )


def stream(frames: Frames, version: int, events: int) -> Stream:
    """Return the datagrams of a board with about this number of events."""
    out: list[list[bytes]] = [[]]
    empty: list[bytes] = []
    count, piece = 0, PIECE
    board = Board(Registers(wire_version=version), version_2=Version2(states_us=0))
    board.frame(frames[0])
    k = 0
    before = board.counts["changes"]
    while count < events:
        k += 1
        made = board.frame(frames[k % len(frames)])
        for datagram in made:
            if version == 1:
                out[-1].append(datagram)
            else:
                (empty if len(datagram) == EMPTY else out[-1]).append(len(datagram).to_bytes(2, "little") + datagram)
        count = board.counts["changes"] - before
        if count >= piece and out[-1]:
            out.append([])
            piece = count + PIECE
    pieces = [(b"".join(some), np.array([len(datagram) for datagram in some])) for some in out if some]
    return Stream(pieces, count, b"".join(empty))


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    size = {f"bytes an event, {name} / version 1": limit for name, limit in BYTES.items()}
    return at_most(size, result["ratios"]) + at_least(DECODING, result["ratios"])


def run(*, quick: bool) -> dict[str, Any]:
    scenes = {"full array": full(), "footfall": footfall(), "drop": drop()}
    bytes_an_event = {name: sizes(frames) for name, frames in scenes.items()}
    share, rounds = (20, 3) if quick else (1, 11)
    data = {(name, v): stream(scenes[name], v, DECODED[name] // share) for name in scenes for v in (1, 2)}
    runs: dict[str, Callable[[], Any]] = {}
    for name in scenes:
        one, two = data[name, 1], data[name, 2]
        runs[f"version 2, {name}"] = partial(two.decode, 2)
        runs[f"version 1, {name}"] = partial(one.decode, 1)
        runs[f"version 1 by datagrams, {name}"] = partial(one.decode, 1, by_datagrams=True)
        assert two.decode(2) == two.events
        assert one.decode(1, by_datagrams=True) == one.events
    results = measure(runs, rounds=rounds)
    for how, result in results.items():
        result["rate"] *= data[how.split(", ")[1], int(how[8])].events
    silent = data["drop", 2].heartbeats
    empty = measure({"heartbeats of the drop": lambda: wire.decode(silent, 2)}, rounds=rounds)
    empty["heartbeats of the drop"]["rate"] *= len(silent) // (EMPTY + 2)
    results |= empty
    ratios: dict[str, Any] = {}
    for name, found in bytes_an_event.items():
        for how in ("at once", "hold 1 ms"):
            ratios[f"bytes an event, {name}, {how} / version 1"] = found[how]["events against version 1"]
    pairs: dict[str, tuple[str, str]] = {}
    for name in scenes:
        for peer, how in (("version 1", "version 1 as one stream"), ("version 1 by datagrams",) * 2):
            pairs[f"decoded, {name}, version 2 / {how}"] = f"version 2, {name}", f"{peer}, {name}"
        ratios[f"version 2, {name}, million events/s"] = results[f"version 2, {name}"]["rate"] / 1e6
    found, spread = compared(results, pairs)
    ratios |= found
    ratios["version 2, a heartbeat, ns"] = 1e9 / results["heartbeats of the drop"]["rate"]
    about = {"seed": SEED, "bytes_an_event": bytes_an_event}
    return about | {"results": results, "ratios": ratios, "spread": spread}
