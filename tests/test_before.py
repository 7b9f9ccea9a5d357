"""Files written before open with equal contents: recordings, labels, readouts and the like."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taxel
from taxel import Calibration, Detections, Labels, Note, Readout, Tare
from taxel.detect import PlainRule, Recipe
from taxel.encode import Encoder

BEFORE = Path(__file__).parent / "data" / "before"


def plain(value: Any) -> Any:
    """Return what JSON holds of a value; a long array by its digest."""
    if isinstance(value, np.ndarray):
        if value.size > 100:
            data = np.ascontiguousarray(value).astype(value.dtype.newbyteorder("<"), copy=False)
            return [value.dtype.str, *value.shape, hashlib.blake2b(data.tobytes(), digest_size=8).hexdigest()]
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, dict):
        return {str(name): plain(one) for name, one in value.items()}
    if isinstance(value, float) and math.isnan(value):
        return "nan"
    return value.item() if isinstance(value, np.generic) else value


def notes(held: tuple[Note, ...]) -> list[list[Any]]:
    return [[n.text, n.t, n.at_ns, n.recording, n.source, n.replaces, n.others] for n in held]


def detections(found: Detections) -> list[Any]:
    return [found.label, found.t, found.known, found.slope, found.reported, found.repaired]


def verdict(of: taxel.Verdict) -> dict[str, Any]:
    """Return the status and the numbers of a verdict; its words may change."""
    held = of.to_dict()
    return {name: value for name, value in held.items() if name not in ("text", "parts")} | {
        "parts": {name: verdict(part) for name, part in of.parts.items()}
    }


def source(recording: taxel.Recording) -> dict[str, Any]:
    held: dict[str, Any] = {
        "array": recording.array._geometry() | {"pitch_mm": recording.array.pitch_mm},
        "source": recording.source,
        "of": [recording.kind, recording.side, recording.heel, recording.timed, recording.truncated],
        "held": recording.held,
        "notes": notes(recording.notes),
        "zeroings": [[z.t, z.x, z.y, z.rest, z.before] for z in recording.zeroings],
        "detections": detections(recording.detections),
        "registers": None if recording.registers is None else json.loads(recording.registers._json()),
        "register_changes": [[at, json.loads(set_._json())] for at, set_ in recording.register_changes],
        "board_changes": [[c.at_ns, c.t, c.change, c.version, c.asked] for c in recording.board_changes],
        "counts": recording.counts,
        "verdict": verdict(recording.verdict),
        "remarks": recording.remarks,
        "lost": recording.lost,
        "rebuilt": recording.rebuilt,
    }
    if recording.clock is not None:
        held["clock"] = recording.clock.board_us
    if recording.has_events:
        e = recording.events
        held["events"] = [e.t, e.x, e.y, e.p, e.intensity, e.present, e.repaired, e.markers]
    else:
        f = recording.frames()
        held["frames"] = [f.t, f.values, f.unit]
        held["columns"] = recording.columns if recording.is_stream else None
    if recording.kind == "mcap" and recording.has_events:
        datagrams = recording.datagrams()
        held["datagrams"] = [datagrams.arrived_ns, datagrams.number, datagrams.offsets, datagrams.payload]
    return held


def recording(path: Path) -> dict[str, Any]:
    held = taxel.open(path)
    every = {name: source(one) for name, one in held.sources.items()}
    return {"sources": every, "verdict": verdict(held.verdict)}


def labels(path: Path) -> list[Any]:
    table = Labels(path)
    return [notes(table.rows), notes(table.removed)]


def readout(path: Path) -> dict[str, Any]:
    held = Readout.load(path)
    return {
        "labels": held.labels,
        "encoder": json.loads(held.encoder.to_json()),
        "array": None if held.array is None else held.array._geometry(),
        "neurons": [[n.neuron.get_params(), n.weights, n.delay_ms, n.inputs] for n in held.neurons.values()],
        "of": [held.time, held.after_spike, held.run_threshold, held.delays_ms, held.unit],
    }


def tare(path: Path) -> list[Any]:
    held = Tare.load(path)
    return [held.array._geometry(), held.rest, held.noise, held.start_us, held.stop_us, held.note]


def calibration(path: Path) -> list[Any]:
    held = Calibration.load(path)
    frames = taxel.Frames(np.full((1, *held.array.shape), 60.0), [0], unit=held.reading_unit, array=held.array)
    values = held.apply(frames).values
    return [held.array._geometry(), held.unit, held.reading_unit, held.gain, held.rest, held.floor, held.date,
            held.residual, held.loads, held.note, held.described(), values.round(4)]  # fmt: skip


def recipe(path: Path) -> list[Any]:
    held = Recipe.load(path)
    learner, delay_ms = held.learner_of("contact")
    given = {name: value for name, value in learner.get_params().items() if name != "neuron"}
    return [json.loads(held.encoder.to_json()), held.run_threshold, given, delay_ms]


def as_json(of: Callable[[Path], Any]) -> Callable[[Path], Any]:
    return lambda path: json.loads(of(path).to_json())


#: The reader of each file whose name does not end as a recording's does.
READERS: dict[str, Callable[[Path], Any]] = {
    "walk.notes.csv": labels,
    "labels.csv": labels,
    "found.csv": lambda path: detections(Detections.from_csv(path)),
    "tare.json": tare,
    "rule.json": as_json(PlainRule.load),
    "recipe.json": recipe,
    "encoder.json": lambda path: json.loads(Encoder.from_json(path.read_text("utf-8")).to_json()),
    "fit.calibration.json": calibration,
    "table.calibration.json": calibration,
    **dict.fromkeys(("readout.json", "touch.json", "trained.json"), readout),
}


def contents(path: Path) -> Any:
    """Return what a file holds, as JSON gives it back."""
    return json.loads(json.dumps(plain(READERS.get(path.name, recording)(path))))


PINNED: dict[str, Any] = (
    json.loads((BEFORE / "contents.json").read_text("utf-8")) if (BEFORE / "contents.json").exists() else {}
)


@pytest.mark.parametrize("name", PINNED)
def test_a_file_opens_with_the_contents_that_it_had(name: str) -> None:
    assert contents(BEFORE / name) == PINNED[name]


def test_every_file_is_pinned() -> None:
    beside = {"make.py", "README.md", "contents.json", "events.lss"}
    assert {file.name for file in BEFORE.iterdir() if file.is_file()} - beside == set(PINNED)


def test_a_readout_detects_in_a_recording_what_it_detected() -> None:
    held = taxel.open(BEFORE / "detected.mcap")
    again = taxel.detect.run(Readout.load(BEFORE / "touch.json"), held)
    assert len(held.detections) >= 5
    assert again[: len(held.detections)].t.tolist() == held.detections.t.tolist()
