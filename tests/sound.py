"""Sound values for the arguments of public callables, and objects whose methods are called, for `test_nonsense.py`."""

import json
import os
import pty
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import taxel
from taxel import _core, detect, information, learn, simulate, tasks, wire
from taxel.simulate import circuit

ARRAY = taxel.Array(4, 4, pitch_mm=2.0, name="small")
EVENTS = taxel.Events(
    [0, 200, 400], [0, 1, 2], [0, 1, 2], [True, False, True], array=ARRAY, intensity=[9, 8, 7], markers=[(0, True)]
)
FRAMES = taxel.Frames(np.ones((3, 4, 4)), [0, 192, 384], array=ARRAY)
TRAINS = taxel.SpikeTrains.from_lists([[1.0, 2.0], [3.0]], 0.0, 20.0, [[1.0, -1.0], [1.0]])
UNSIGNED = taxel.SpikeTrains.from_lists([[1.0, 2.0], [3.0]], 0.0, 20.0)
PLAIN = TRAINS.split_by_sign()
FOUND = taxel.Detections(["a", "b"], [10, 20], [11, 22], [0.5, 0.5])
TARE = taxel.Tare.take(FRAMES)
REGION = taxel.Region("two", taxels=((0, 0), (1, 2)))
CALIBRATION = taxel.Calibration.table(ARRAY, [5.0, 50.0], [1.0, 9.0], unit="N")
LEVELS = taxel.encode.LevelCrossing([0.5])
READOUT = taxel.Readout(LEVELS, {"a": (taxel.Neuron(tau=2.0), [0.5] * 32)}, array=ARRAY)
RULE = detect.PlainRule("area", 2)
RECIPE = detect.Recipe(LEVELS, {"tau": 5.0}, {"a": {"ub": 1.0}})
EXAMPLE = detect.Example(taxel.Frames(np.eye(4)[:, :, None] * np.ones(4), [0, 9000, 18000, 27000]), {"a": [9000]})
SCORE = detect.score(FOUND, {"a": [10], "b": [25]})
CONE = learn.ConeR(neuron=taxel.Neuron(tau=5.0), ub=1.0)
CONE_X = learn.ConeX(neuron=taxel.Neuron(tau=5.0), lb=-9.0, ub=9.0)
REFUTED = learn.ConeX().fit([UNSIGNED], [[0.5]])
BITS = information.estimate(["a", "b"] * 4, ["a", "b"] * 4, redraws=2)
SCENE = simulate.Scene.draw(1)
SILENCE = [simulate.Silence(10.0)]
REGISTERS = wire.Registers()
BYTES = wire.encode(EVENTS)
INFORMED = {"window_ms": 5.0, "draws": 1, "folds": 2, "shuffles": 1}
PRESSES = taxel.Events(
    np.arange(8) * 10_000 + 1000, np.arange(8) % 2, [0] * 8, [True] * 8, array=ARRAY, intensity=np.arange(8) * 50 + 50
)
PRESSED = np.zeros((150, 4, 4))
for _k in range(60, 140, 20):
    PRESSED[_k : _k + 10, 1:3, 1:3] = 60.0


def write_clock(path: Path) -> None:
    """Write a recording with arrival times."""
    writer = _core.RecordingWriter(path, json.dumps({"array": ARRAY._geometry()}), "none", True)
    for k, t in enumerate(EVENTS.t.tolist()):
        writer.datagram(10**18 + t * 1000, k, wire.encode(EVENTS[EVENTS.t == t]))
    writer.finish("{}")


def write_files() -> None:
    """Write the files that sound calls read to the current folder."""
    FOUND.to_csv("here.csv")
    TRAINS.save("here.npz")
    TARE.save("here_tare.json")
    taxel.write_regions("here.regions.json", [REGION])
    CALIBRATION.save("here_calibration.json")
    READOUT.save("here_readout.json")
    RULE.save("here_rule.json")
    taxel.convert(EVENTS, "here_events.npz")
    write_clock(Path("here_panel.mcap"))
    taxel.convert(taxel.Frames(PRESSED, 10_000 * np.arange(150), unit="counts", array=ARRAY), "ticks.npz")
    CALIBRATION.save("ticks.calibration.json")
    taxel.convert(PRESSES, "presses.npz")
    taxel.convert(taxel.Frames(PRESSED, 10_000 * np.arange(150), unit="counts", array=ARRAY), "pressed.npz")
    Path("here.toml").write_text('[encoder]\nname = "fa1"\n')
    scene = "shape.sphere.radius_mm = 15\nx_mm = 80\ny_mm = 80\nmass_g = 40\nmotion.dropped.height_mm = 120\n"
    Path("here_scene.toml").write_text(f"[[bodies]]\n{scene}")
    Path("here_labels.csv").write_text("label,t_us\na,5\n")
    Path("here_loads.csv").write_text("load,unit,from_s,to_s\n9,N,0.6,0.7\n")
    rows = "".join(f"presses,{10_000 * k + 1000},{'ab'[k % 2]}\n" for k in range(8))
    Path("presses.csv").write_text(f"recording,t_us,label\n{rows}")
    Path("pdb").mkdir()
    row = "\t".join(["0"] * 18)
    Path("pdb/GaCo01_01.txt").write_text("\n".join(f"{k / 100}\t{row}" for k in range(50)) + "\n")


@cache
def serial_line() -> str:
    """Begin to emulate a board, once for all calls; return its serial line, which stays open."""
    board, (end, other) = simulate.Board(), pty.openpty()

    def answer() -> None:
        while data := os.read(end, 5):
            os.write(end, board.command(data).encode())

    threading.Thread(target=answer, daemon=True).start()
    return os.ttyname(other)


@cache
def live() -> Any:
    """Return what has listened live, once for all calls, and has stopped: `next` then returns at once."""
    ended = taxel.live.Live(0, host="127.0.0.1")
    ended.stop()
    return ended


#: By name of a class: makes the object whose methods are called.
OBJECTS: dict[str, Callable[[], Any]] = {
    "AdaptiveRamp": circuit.AdaptiveRamp,
    "Alignment": lambda: detect.Alignment("a", 0, np.zeros(2, np.int64), np.array([0, 9000]), np.array([1.5, np.nan])),
    "Array": lambda: ARRAY,
    "Board": simulate.Board,
    "Cable": lambda: taxel.device.Cable(serial_line(), timeout=30.0),
    "Calibration": lambda: CALIBRATION,
    "Circuit": circuit.Circuit,
    "Clock": lambda: taxel.Clock(np.array([0, 1000]), np.array([5, 1_000_005])),
    "Composite": lambda: taxel.encode.Composite({"a": LEVELS}),
    "ConeR": lambda: learn.ConeR(neuron=taxel.Neuron(tau=5.0), ub=1.0).fit([PLAIN], [[5.0]]),
    "ConeRProblem": lambda: CONE.prepare([PLAIN], [[5.0]]),
    "ConeX": lambda: learn.ConeX(neuron=taxel.Neuron(tau=5.0), lb=-9.0, ub=9.0).fit([PLAIN], [[5.0]]),
    "ConeXProblem": lambda: REFUTED.problem_,
    "Converter": circuit.Converter,
    "Decoder": wire.Decoder,
    "Detections": lambda: FOUND,
    "Device": lambda: taxel.device.Device(serial_line(), timeout=30.0),
    "Divider": circuit.Divider,
    "Encoder": lambda: LEVELS,
    "EncoderStream": lambda: LEVELS.stream(ARRAY),
    "Events": lambda: EVENTS,
    "Fabric": circuit.Fabric,
    "Frames": lambda: FRAMES,
    "Labels": lambda: taxel.Labels("here_labels.csv"),
    "Region": lambda: REGION,
    "Layer": lambda: simulate.Layer(array=ARRAY),
    "Live": live,
    "LocalLoad": lambda: taxel.encode.LocalLoad(tare=TARE),
    "Neuron": taxel.Neuron,
    "OnlineConeR": lambda: learn.OnlineConeR(neuron=taxel.Neuron(tau=5.0), window=3, ub=1.0).fit([PLAIN], [[5.0]]),
    "PlainRule": lambda: RULE,
    "PlainScore": lambda: detect.PlainScore({"a": RULE, "b": None}, SCORE),
    "Readout": lambda: READOUT,
    "ReadoutStream": READOUT.stream,
    "Recipe": lambda: RECIPE,
    "Recording": lambda: taxel.open("here_panel.mcap"),
    "Registers": lambda: REGISTERS,
    "Recording.calibrated": lambda: taxel.open("ticks.npz"),
    "Replay": lambda: simulate.Replay(EVENTS),
    "Scene": lambda: SCENE,
    "SpikeTrains": lambda: TRAINS,
    "StreamReader": wire.StreamReader,
    "Tare": lambda: TARE,
    "VirtualGround": circuit.VirtualGround,
}

COUNTS = [[5, 1], [2, 4]]
LETTERS = ["a", "b"] * 4
CLOUD = np.arange(16.0).reshape(8, 2) % 5
#: By name of an argument, or of a callable and its argument: makes a sound value, for arguments without default.
VALUES: dict[str, Callable[[], Any]] = {
    "a": lambda: [1.0, 2.0],
    "acts": lambda: SILENCE,
    "answer": lambda: lambda labels: labels,
    "array": lambda: ARRAY,
    "b": lambda: [1.5],
    "board_us": lambda: [500],
    "certificate": lambda: REFUTED.certificate_,
    "cheap": lambda: BITS,
    "columns": lambda: 4,
    "command": lambda: wire.Command(4, 140),
    "conductance_us": lambda: [[1.0, 2.0]],
    "cone": lambda: CONE,
    "counts": lambda: COUNTS,
    "data": lambda: BYTES,
    "datagrams": lambda: [BYTES],
    "dear": lambda: BITS,
    "delays_ms": lambda: [0.0, 2.0],
    "detections": lambda: [taxel.Detection("a", 5, 6)],
    "encoder": lambda: LEVELS,
    "events": lambda: EVENTS,
    "example": lambda: 0,
    "examples": lambda: [EXAMPLE, EXAMPLE],
    "features": lambda: [2],
    "force_n": lambda: [0.0, 1.0],
    "found": lambda: FOUND,
    "frame": lambda: 3,
    "frames": lambda: FRAMES,
    "grams": lambda: [CLOUD @ CLOUD.T],
    "health": lambda: taxel.health(EVENTS),
    "held": REFUTED.certificate_.to_dict,
    "host_ns": lambda: [500_000],
    "k": lambda: 2,
    "known": lambda: [2],
    "label": lambda: "a",
    "labels": lambda: LETTERS,
    "level": lambda: 2,
    "levels": lambda: [0.5],
    "line_v": lambda: [1.4, 1.5, 2.0, 2.5],
    "load": lambda: 9.0,
    "loads": lambda: [taxel.Load(FRAMES, 9.81)],
    "ms": lambda: 10.0,
    "name": lambda: "2 kHz",
    "names": lambda: ["a"],
    "neurons": lambda: READOUT.neurons,
    "notes": lambda: [taxel.Note("heel", 100, 0)],
    "offsets": lambda: [0, 1, 2],
    "options": lambda: tasks.EncodeOptions("level_crossing", {"levels": [30.0]}),
    "p": lambda: [True],
    "parameters": lambda: SCENE.parameters,
    "parts": lambda: [TRAINS, TRAINS],
    "path": lambda: "here.file",
    "pattern": lambda: 0,
    "patterns": lambda: [PLAIN],
    "period_us": lambda: 20.0,
    "place": serial_line,
    "preset": lambda: "5.2 kHz",
    "problem": lambda: REFUTED.problem_,
    "q": lambda: 0.1,
    "quantity": lambda: "area",
    "readings": lambda: [5.0, 50.0],
    "readout": lambda: READOUT,
    "recipe": lambda: RECIPE,
    "recorded": lambda: EVENTS,
    "recording": lambda: taxel.open("here_events.npz"),
    "recordings": lambda: [taxel.open("presses.npz")],
    "register": lambda: 4,
    "registers": lambda: REGISTERS,
    "responses": lambda: LETTERS,
    "row": lambda: ("silence", 0, 5.0),
    "rows": lambda: 4,
    "seed": lambda: 1,
    "shows": lambda: "here_panel.mcap",
    "source": lambda: EVENTS,
    "spikes": lambda: [[1.0, 2.0]],
    "start": lambda: 0,
    "start_us": lambda: 0,
    "stop": lambda: 300,
    "sunk_mm": lambda: np.full((4, 4), 0.5),
    "t": lambda: [1],
    "t_us": lambda: 5,
    "table": lambda: "presses.csv",
    "tare": lambda: TARE,
    "target": lambda: 0,
    "targets": lambda: [[5.0]],
    "tau": lambda: 5.0,
    "text": lambda: "heel",
    "threshold": lambda: 2,
    "ticks": lambda: [1.0, 9.0],
    "times": lambda: [1.0, 2.0],
    "to": lambda: "127.0.0.1:9",
    "touch": lambda: SILENCE,
    "trains": lambda: UNSIGNED,
    "trials": lambda: [information.LabelledTrial(PRESSES, "ab"[k % 2], k * 10_000) for k in range(8)],
    "truth": lambda: {"a": [10], "b": [25]},
    "unit": lambda: "N",
    "use": lambda: "better",
    "value": lambda: 300,
    "values": lambda: [1.0, 9.0],
    "volts": lambda: [[1.4, 2.0]],
    "waves": lambda: [0.1],
    "weights": lambda: [1.0, 1.0],
    "window_ms": lambda: 0.1,
    "absorb_s": lambda: None,
    "words": lambda: list(REGISTERS.words),
    "x": lambda: FRAMES,
    "y": lambda: [1],
    "Calibration.from_json.text": CALIBRATION.to_json,
    "Calibration.load.path": lambda: "here_calibration.json",
    "Calibration.beside.recording": lambda: "here_events.npz",
    "Events.x": lambda: [1],
    "Labels.named.recording": lambda: "walk.mcap",
    "Readout.from_json.text": READOUT.to_json,
    "Recording.on_clock.name": lambda: "host",
    "Tare.from_json.text": TARE.to_json,
    "PlainRule.from_json.text": RULE.to_json,
    "Encoder.from_json.text": LEVELS.to_json,
    "notes_as_trials.recordings": lambda: [taxel.open("here_events.npz").with_notes([taxel.Note("ball", 0, 0)])],
    "pairwise.metric": lambda: "victor_purpura",
    "record.start": lambda: True,
    "EncodeOptions.encoder": lambda: "fa1",
    "tune.examples": lambda: [detect.Example(FRAMES, {"a": [1000]}, TARE)],
    "train.recordings": lambda: taxel.open("pressed.npz"),
    "tasks.detect.recordings": lambda: taxel.open("pressed.npz"),
    "check_solution.cone": lambda: CONE_X.fit([PLAIN], [[5.0]]),
    "check_gap.cone": lambda: CONE.fit([PLAIN], [[5.0]]),
    "van_rossum_spatial.a": lambda: UNSIGNED,
    "van_rossum_spatial.array": lambda: taxel.Array(1, 2, 1.0),
    "van_rossum_spatial.b": lambda: UNSIGNED,
    "AdaptiveRamp.convert.volts": lambda: np.full((9, 4, 8), 1.5),
    "Board.command.data": lambda: wire.Command(1, 300).to_bytes(),
    "Board.frame.ticks": lambda: np.zeros(4096, np.uint16),
    "Cable.floor.ticks": lambda: 0,
    "Command.from_bytes.data": lambda: wire.Command(1, 300).to_bytes(),
    "Composite.parts": lambda: {"a": LEVELS},
    "ConeXProblem.cone": lambda: CONE_X,
    "ConeXProblem.silence.t": lambda: 5.0,
    "Detections.from_csv.path": lambda: "here.csv",
    "Detections.label": lambda: ["a"],
    "Events.from_numpy.records": EVENTS.to_numpy,
    "Frames.from_events.period_us": lambda: 100,
    "Frames.t": lambda: [0, 5],
    "Frames.values": lambda: np.ones((2, 4, 4)),
    "FrameSequence.values": lambda: np.zeros((3, 64, 64)),
    "Labels.path": lambda: "here_labels.csv",
    "Neuron.run_many.weights": lambda: [[1.0, 1.0], [0.5, 0.5]],
    "OnlineConeR.partial_fit.pattern": lambda: PLAIN,
    "OnlineConeR.partial_fit.targets": lambda: [5.0],
    "Places.x": lambda: [0.0, 1.0],
    "Places.y": lambda: [0.0, 0.0],
    "Readout.load.path": lambda: "here_readout.json",
    "Recipe.from_dict.values": lambda: {"encoder": {"name": "fa1"}},
    "Recipe.load.recipe": lambda: "here.toml",
    "Registers.commands_to.target": lambda: REGISTERS,
    "SceneFile.open.path": lambda: "here_scene.toml",
    "SpikeTrains.load.path": lambda: "here.npz",
    "SpikeTrains.select.trains": lambda: [1],
    "Tare.load.path": lambda: "here_tare.json",
    "calibrate.recording": lambda: taxel.open("pressed.npz"),
    "convert.target": lambda: "there.npz",
    "detect.readout": lambda: RULE,
    "encode.recording": lambda: taxel.open("pressed.npz"),
    "index.x": lambda: 1,
    "index.y": lambda: 2,
    "info.recording": lambda: taxel.open("pressed.npz"),
    "load.path": lambda: "here_rule.json",
    "nested_predictions.y": lambda: [0, 1] * 4,
    "open.path": lambda: "here_events.npz",
    "open_all.path": lambda: "here_events.npz",
    "pairwise.a": lambda: [[1.0], [2.0]],
    "read_loads.path": lambda: "here_loads.csv",
    "region.x": lambda: slice(0, 2),
    "region.y": lambda: slice(0, 2),
    "Region.name": lambda: "heel",
    "Region.shares.array": lambda: ARRAY,
    "Region.centred.array": lambda: ARRAY,
    "rectangle.name": lambda: "heel",
    "rectangle.left": lambda: 0,
    "rectangle.top": lambda: 0,
    "rectangle.right": lambda: 4,
    "rectangle.bottom": lambda: 4.5,
    "axis.picture": lambda: np.eye(4),
    "axis.array": lambda: ARRAY,
    "read_regions.path": lambda: "here.regions.json",
    "write_regions.path": lambda: "there.regions.json",
    "write_regions.regions": lambda: [REGION],
    "rest.recording": lambda: taxel.open("pressed.npz"),
    "zero_test.found": lambda: 1.0,
}

#: By name of a callable: more arguments, without which a call takes long.
SMALL: dict[str, dict[str, Any]] = {
    "calibrate": {"loads": [tasks.KnownLoad(9.0)], "options": tasks.CalibrateOptions(exponent=1.0)},
    "answer": {"window_ms": 5.0, "draws": 1, "folds": 2, "shuffles": 1},
    "folds": {"count": 2},
    "pairwise": {"q": 0.1},
    "read_trials": {"window_ms": 0.1},
    "Region": {"taxels": ((0, 0),)},
    "write_regions": {"overwrite": True},
    "to_csv": {"overwrite": True},
    "to_nir": {"overwrite": True},
    "save": {"overwrite": True},
    "taxel.convert": {"overwrite": True},
    "tasks.detect": {"options": tasks.DetectOptions(tare=0.3)},
    "truth": {"array": ARRAY},
    "emulate": {"tare_ms": 1.0},
    "information": {"labels": "presses.csv", "options": tasks.InformationOptions(**INFORMED)},
    "information.estimate": {"redraws": 5},
    "InformationOptions": INFORMED,
    "Live": {"port": 0, "host": "127.0.0.1"},
    "nested_predictions": {"count": 2, "inner": 2, "ridges": [1.0]},
    "Panel": {"port": 0, "host": "127.0.0.1", "folder": None},
    "play": {"tare_ms": 3.0},
    "send": {"host": "127.0.0.1", "port": 9, "seconds": 0.001},
    "train": {"labels": [{"a": [10_000 * k for k in range(60, 140, 20)]}], "options": tasks.TrainOptions(folds=2)},
    "zero_test": {"shuffles": 2},
}


def calibrated(options: Any = None, load: Any = None) -> Any:
    """Calibrate with these options or this load."""
    loads = [load or tasks.KnownLoad(9.0)]
    return tasks.calibrate(taxel.open("pressed.npz"), loads, options or tasks.CalibrateOptions(exponent=1.0))


def hold(floor: Any) -> None:
    """Hold a floor, and let it go."""
    with floor:
        pass


def judged(fold: Any) -> Any:
    """Train and score on these parts of two examples."""
    return detect.judge([EXAMPLE, EXAMPLE], RECIPE, [fold])


#: By name of a callable: makes use of what it returns, where only that reads the arguments, or ends it.
USES: dict[str, Callable[[Any], Any]] = {
    "at_rate": lambda recording: recording.frames(),
    "Cable": lambda cable: cable.close(),
    "CalibrateOptions": calibrated,
    "Device": lambda device: device.close(),
    "Example": lambda example: detect.fit([example], RECIPE),
    "floor": hold,
    "Fold": judged,
    "InformationOptions": lambda options: tasks.information(taxel.open("presses.npz"), "presses.csv", options),
    "KnownLoad": lambda load: calibrated(load=load),
    "Live": lambda live: live.stop(),
    "Load": lambda load: taxel.Calibration.fit([load]),
    "Note": lambda note: taxel.open("here_events.npz").with_notes([note]),
    "Panel": lambda panel: panel.stop(),
    "Part": lambda part: judged(detect.Fold([detect.Part(0)], [part])),
    "RunningRange": lambda running: taxel.encode.LevelCrossing([0.5], running_range=running),
    "Scene": lambda scene: scene.motion(),
    "Silence": lambda silence: simulate.play([silence], seed=1, tare_ms=3.0),
}

#: What is not called, by name: what only taxel makes, and what needs a live board.
LEFT_OUT = {
    *("BoardChange", "Clock", "Datagrams", "Detection", "Health", "Recording", "Zeroing", "Certificate", "Checked"),
    *("Margin", "Multipliers", "Row", "Summary", "Matching", "Status", "Received"),
    *("BoardCheck", "Finding", "Greeting", "Port", "Training.command"),
    "check_board",
    "Workers.run",
    "Workers.tried",
    *("Device.apply", "Device.record", "Live.source_address", "Live.zero", "Live.record", "Live.sample", "Live.note"),
    *("Live.expect_version", "Recording.at_rate"),
}
