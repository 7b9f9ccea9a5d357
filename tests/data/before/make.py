"""Write the files of this folder anew: `PYTHONPATH=tests python tests/data/before/make.py`, in the empty folder."""

from __future__ import annotations

import json
import os
import pty
import socket
import time
import tty
from pathlib import Path

import numpy as np
from live.boards import LOOPBACK, SMALL, datagrams, play, presses, touch, wait_for
from loopback import until
from test_before import contents

import taxel
from taxel import Calibration, Detections, Frames, Neuron, Readout, Tare, _core
from taxel.calibration import Load
from taxel.detect import Example, PlainRule, Recipe, fit
from taxel.encode import FA1, Composite, ContactArea
from taxel.live import Live
from taxel.simulate import Board, Version2
from taxel.wire import Registers

HERE = Path(__file__).parent
BEGAN = 1_700_000_000_000_000_000


def touches(count: int) -> taxel.Events:
    """Each 40 ms two taxels rise and fall again, one 400 us behind the other."""
    rows = []
    for press in range(count):
        for k in range(20):
            for x, behind in ((1, 0), (2, 400)):
                ticks = 20 + 3 * (k if k < 10 else 19 - k)
                rows.append((press * 40_000 + k * 200 + behind, x, 2, k < 10, ticks))
    t, x, y, p, ticks = zip(*sorted(rows), strict=True)
    return taxel.Events(t, x, y, p, array=SMALL, intensity=np.array(ticks))


def written() -> None:
    """Write what a recording may hold beside its datagrams, by the writer that live recordings use."""
    draw = np.random.default_rng(7)
    array = taxel.Array(8, 10, 2.0, name="mat")
    registers = Registers(array=array, lines=10, line_period=5.0)
    n = 120
    t = np.sort(draw.integers(0, 3000, n)) * 100
    events = taxel.Events(
        t, draw.integers(0, 10, n), draw.integers(0, 8, n), draw.random(n) < 0.5, array=array,
        intensity=draw.integers(0, 400, n), present=draw.random(n) < 0.9,
    )  # fmt: skip
    header = {"array": array._geometry(), "registers": json.loads(registers._json()), "source": "udp 127.0.0.1:5208"}
    writer = _core.RecordingWriter(HERE / "board.mcap", json.dumps(header), "zstd", False)
    held = draw.integers(0, 300, 80).astype(np.uint16)
    held[draw.random(80) < 0.3] = 65_535
    writer.held(BEGAN, None, held)
    times = np.unique(t)
    for k, at in enumerate(times.tolist()):
        writer.datagram(BEGAN + at * 1000, k, taxel.wire.encode(events[events.t == at]))
        if k == len(times) // 3:
            writer.board_change(BEGAN + at * 1000, json.dumps({"t_us": at, "change": "reset"}))
    writer.note(BEGAN + 50_000_000, 50_000, "heel")
    writer.note(BEGAN + 200_000_000, 200_000, "toe")
    writer.note(BEGAN + 1, None, "cough")
    writer.zeroing(BEGAN + 60_000_000, (60_000, 2, 3, 40.0, None))
    writer.zeroing(BEGAN + 220_000_000, (220_000, 7, 1, 41.5, 39.0))
    changed = Registers(array=array, lines=10, line_period=6.0)
    writer.registers(BEGAN + 150_000_000, changed._json())
    writer.detection(BEGAN + 100_000_000, ("contact", 99_000, 100_000, 1.5, False))
    writer.detection(BEGAN + 240_000_000, ("lift", 239_000, 240_000, float("nan"), True))
    writer.finish(json.dumps({"received": len(times), "dropped_by_kernel": 2}))


def live() -> None:
    """Record live: a readout's detections, and a board of version 2 with losses."""
    events = presses(6)
    options = {"array": SMALL, "readout": touch(), "guard_frames": 1e6, "say": lambda found: None}
    with Live(0, host=LOOPBACK, record=HERE / "detected.mcap", compression="zstd", **options) as running:
        play(events, running.address[1], pace=0.001)
        wait_for(running, len(datagrams(events)))
        running.note("standing")
    array = taxel.Array(16, 16, 2.0, name="corner")
    board = Board(Registers(array=array, lines=16, wire_version=2), array=array, version_2=Version2(board=5))
    draw = np.random.default_rng(3)
    with (
        Live(0, host=LOOPBACK, array=array, record=HERE / "version_2.mcap", compression="zstd") as running,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
    ):
        for _ in range(200):
            for one in board.frame((40 + 30 * (draw.random(256) < 0.02)).astype(np.uint16)):
                # Lost, damaged, twice, or as it is.
                fate = draw.choice(4, p=[0.05, 0.05, 0.05, 0.85])
                changed = one[:-1] + bytes([one[-1] ^ 1]) if fate == 1 else one
                for _again in range((0, 1, 2, 1)[fate]):
                    link.sendto(changed, running.address)
                    time.sleep(0.0005)


def several() -> None:
    """Record several sources live: boards and numbers."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    sources = {
        "left": f"board:{LOOPBACK}:0,array=4x4",
        "imu": f"serial:{os.ttyname(theirs)},columns=t_ms:ax:ay",
        "given": "given,columns=force",
    }
    path = HERE / "sources.mcap"
    with Live(0, host=LOOPBACK, array=SMALL, record=path, compression="zstd", name="right", sources=sources) as running:
        play(presses(2), running.address[1])
        play(presses(1), running.source_address("left")[1])
        os.write(ours, b"".join(f"{10 * k}, {k / 8}, {-k}\r\n".encode() for k in range(20)) + b"nonsense\n")
        for k in range(5):
            running.sample("given", [k + 0.5], arrived_ns=BEGAN + k * 1_000_000)
        until(lambda: running.counters["sources"]["imu"]["lines"]["lines"] == 21)
        until(lambda: running.counters["sources"]["left"]["decoded"] > 0 and running.counters["decoded"] > 0)


def made() -> None:
    """Write what is made from other recordings, and files of frames."""
    board = taxel.open(HERE / "board.mcap")
    for ending in ("csv", "lsa"):
        taxel.convert(board, HERE / f"events.{ending}")
    taxel.convert(board, HERE / "converted.mcap", compression="zstd")
    [part] = taxel.cut(board, start_us=100_000, stop_us=200_000)
    taxel.convert(part, HERE / "cut.mcap", compression="zstd")
    [region] = taxel.cut(board, columns=slice(2, 9), rows=slice(1, 7))
    taxel.convert(region, HERE / "region.mcap")
    both = taxel.merge([board, taxel.open(HERE / "events.csv", array=board.array)])
    taxel.convert(both, HERE / "merged.mcap", compression="zstd")
    values = np.arange(48, dtype=np.float32).reshape(4, 3, 4) / 8
    exists = np.ones((3, 4), bool)
    exists[0, 0] = False
    plate = taxel.Array(3, 4, (7.62, 5.08), exists, "plate")
    for ending in ("mcap", "csv"):
        taxel.convert(Frames(values, [0, 1000, 2500, 4000], unit="kPa", array=plate), HERE / f"frames.{ending}")
    for source, name in (("board", "events"), ("frames", "frames")):
        for ending in ("npz", "h5"):
            taxel.convert(HERE / f"{source}.mcap", HERE / f"{name}.{ending}")
    places = taxel.Places([0.0, 10.0, 4.0], [0.0, 2.0, 8.0], None, "mm")
    insole = taxel.Array(1, 3, name="insole", places=places)
    taxel.convert(Frames(values[:, :1, :3], [0, 1000, 2500, 4000], unit="N", array=insole), HERE / "insole.npz")


def texts() -> None:
    """Write labels, a readout, a plain rule, a tare, a calibration, a recipe, an encoder and a table of detections."""
    (HERE / "walk.notes.csv").write_text(
        "label,t_us,source,recording,replaces_us,host_ns\n"
        "contact,400,left,,,\n"
        "lift,900,,trial 2,800,1700000000900000000\n"
        ",1000,,,1000,\n"
    )
    (HERE / "labels.csv").write_text("recording,label,t_us,comment\nwalk,contact,400,late\nrun,lift,900,\n")
    rest = Frames(np.full((3, 4, 4), 20.0) + np.arange(3)[:, None, None], [0, 500, 1000], unit="ticks", array=SMALL)
    tare = Tare.take(rest, note="board 7, 2026-11-26")
    tare.save(HERE / "tare.json")
    PlainRule("load", 30, 0.5, 5.0, labels=("on", "off")).save(HERE / "rule.json")
    neuron = Neuron(tau=2.0, refractory=15.0)
    encoder = Composite({"area": ContactArea(levels=[2, 4]), "fa1": FA1()})
    neurons = {
        "contact": (neuron, np.linspace(-1, 1, 8), 2.0, ["area"]),
        "lift": (neuron, np.linspace(-1, 1, 72), 1.0, ["area", "fa1"]),
    }
    Readout(encoder, neurons, array=SMALL, run_threshold=0.9, unit="ticks", delays_ms=[0.0, 5.0]).save(
        HERE / "readout.json"
    )
    touch().save(HERE / "touch.json")
    recipe = Recipe(ContactArea(levels=[1]), {"ub": 5.0, "lb": -5.0}, {"touch": {"tau": 5.0, "delay_ms": 2.0}})
    fit([Example(touches(4), {"touch": [k * 40_000 + 2000 for k in range(4)]}, tare)], recipe).save(
        HERE / "trained.json"
    )
    loads = [Load(Frames([[[20.0]], [[20.0]]], [0, 1000]), 5.0), Load(Frames([[[45.0]], [[45.0]]], [0, 1000]), 10.0)]
    Calibration.fit(loads, date="2026-11-26", note="two weights").save(HERE / "fit.calibration.json")
    Calibration.table(
        SMALL, [5.0, 20.0], [1.0, 8.0], unit="kPa", reading_unit="ticks", rest=tare, date="2026-11-26"
    ).save(HERE / "table.calibration.json")
    (HERE / "encoder.json").write_text(encoder.to_json() + "\n")
    (HERE / "recipe.json").write_text(
        '{"run_threshold": 0.9, "encoder": {"name": "contact_area", "levels": [2, 4, 8]},\n'
        ' "learner": {"refractory": 15.0, "step_ms": 0.2}, "neurons": {"contact": {"tau": 3.0, "delay_ms": 3.0}}}\n'
    )
    found = Detections(["a", "b"], [10, 20], [11, 22], [0.5, None], [15, 30], [False, True])
    found.to_csv(HERE / "found.csv")


def pinned() -> None:
    """Write what all of them hold."""
    made = ("contents.json", "events.lss", "make.py", "README.md")
    names = sorted(file.name for file in HERE.iterdir() if file.is_file() and file.name not in made)
    lines = [f"{json.dumps(name)}: {json.dumps(contents(HERE / name), sort_keys=True)}" for name in names]
    (HERE / "contents.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")


if __name__ == "__main__":
    written()
    live()
    several()
    made()
    texts()
    pinned()
