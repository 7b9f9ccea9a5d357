"""A second of the board's logic, simulated clock by clock: 5208 frames, alone and with its golden model.

The scene of the encoders' benchmarks: a press and its release, and noise in every taxel. *Bench* is Verilator's model
of the logic with the comparators, the link and the serial line around it; *whole* is the bench, the emulated board with
the same trip times, and the decoder of what the logic sent. All datagrams of the two are compared; a difference is an
error. One thread; a third of a second of each build in turn, three times. Where the RTL's tools (`make rtl-tools`)
lack, all of it is left out.

Peer: real time. Unit: CPU seconds a second of board time. Goal: 30 for the bench and 60 for the whole, with 16 channels
and version 1.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import taxel
from taxel.wire import Decoder
from taxel_benchmarks._goals import Goal, at_most
from taxel_benchmarks._rounds import ALL
from taxel_benchmarks.encode import scene

if TYPE_CHECKING:
    from pair import Pair

#: The simulation of the logic, which a checkout of taxel has.
SIMULATION = Path(__file__).parents[2] / "rtl" / "dv"

GOALS = {"16 channels, bench": 30.0, "16 channels, whole": 60.0}


@dataclass(frozen=True)
class Build:
    """A build of the logic, and what its registers are set to before the first frame."""

    channels: int = 16
    preset: str = "5.2 kHz"
    writes: dict[str, int] = field(default_factory=dict)


BUILDS = {
    "16 channels": Build(),
    "64 channels": Build(64, "5.2 kHz, 64 channels"),
    "version 2": Build(writes={"wire_version": 2}),
    "FA-1": Build(preset="5.2 kHz, FA-1"),
}


def begun(build: Build) -> Pair:
    """Return the logic and the emulated board with their registers set."""
    from pair import Pair  # noqa: PLC0415  only a checkout has it

    pair = Pair(64, 64, build.channels, long=True)
    held = pair.board.registers
    pair.write(held.commands_to(held.with_preset(build.preset).replace(**build.writes)))
    return pair


def played(build: Build, ticks: Any, seconds: float) -> dict[str, float]:
    """Play frames to the logic and the emulated board, compare and decode; return what a second of board time takes."""
    pair = begun(build)
    registers = pair.board.registers
    frames = (ticks.astype(np.uint32) * registers.ramp // 150).astype(np.uint16)
    decoder = Decoder(registers.wire_version)
    bench, events, start = 0.0, 0, time.process_time()
    for frame in frames:
        before = time.process_time()
        pair.logic.ticks(frame)
        pair.logic.edge()
        received = pair.logic.datagrams()
        bench += time.process_time() - before
        pair.expected += pair.board.frame(frame)
        pair.received += received
        events += sum(len(decoder.push(datagram)) for datagram in received)
    whole = time.process_time() - start
    if not pair.agrees:
        raise taxel.Error("the logic's datagrams differ from the emulated board's")
    pair.logic.close()
    return {"bench": bench / seconds, "whole": whole / seconds, "events": events}


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return at_most({f"{name}, CPU s a second of board time": one for name, one in GOALS.items()}, result["ratios"])


def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return CPU seconds a second of board time."""
    if not SIMULATION.is_dir():
        return {"left out": {ALL: "no RTL here; run this in a checkout of taxel"}}
    sys.path.append(str(SIMULATION))
    from verilated import missing  # noqa: PLC0415  only a checkout has it

    lacking = missing()
    if lacking is not None:
        return {"left out": {ALL: lacking}}
    seconds, rounds = (0.01, 1) if quick else (1 / 3, 3)
    ticks = np.asarray(scene(seconds).ticks.values)
    turns = [{name: played(build, ticks, seconds) for name, build in BUILDS.items()} for _ in range(rounds)]
    results = {name: {part: [turn[name][part] for turn in turns] for part in turns[0][name]} for name in BUILDS}
    taken = {
        f"{name}, {part}": statistics.median(result[part])
        for name, result in results.items()
        for part in ("bench", "whole")
    }
    return {
        "frames": len(ticks),
        "results": results,
        "ratios": {f"{name}, CPU s a second of board time": one for name, one in taken.items()},
    }
