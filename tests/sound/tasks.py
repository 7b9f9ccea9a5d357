"""Sound calls of `taxel.tasks`."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import taxel
from sound.information import PRESSES
from sound.things import TARE, Sound, plain
from taxel import tasks

VALUES = np.zeros((150, 4, 4))
BEGINS = range(60, 140, 20)
for _k in BEGINS:
    VALUES[_k : _k + 10, 1:3, 1:3] = 60.0
LABELS = {"a": [10_000 * k for k in BEGINS]}
RULE = taxel.detect.PlainRule("area", 2, noise_floor=20.0)


def pressed(unit: str = "N") -> taxel.Recording:
    """A recording in the current folder, four times pressed."""
    frames = taxel.Frames(VALUES, 10_000 * np.arange(len(VALUES)), unit=unit, array=taxel.Array(4, 4))
    taxel.convert(frames, "pressed.npz", overwrite=True)
    return taxel.open("pressed.npz")


def on(function: Callable[..., Any], unit: str = "N", **arguments: Any) -> Sound:
    """A call of a task on that recording."""
    return lambda: (function, {"recordings": pressed(unit), **arguments})


def one(function: Callable[..., Any], unit: str = "N", **arguments: Any) -> Sound:
    return lambda: (function, {"recording": pressed(unit), **arguments})


def presses() -> taxel.Recording:
    """A recording in the current folder with a table of its trials."""
    taxel.convert(PRESSES, "presses.npz", overwrite=True)
    rows = "".join(f"presses,{10_000 * k},{'ab'[k % 2]}\n" for k in range(8))
    Path("presses.csv").write_text("recording,t_us,label\n" + rows)
    return taxel.open("presses.npz")


def informed(**options: Any) -> Any:
    small = {"window_ms": 5.0, "draws": 1, "folds": 2, "shuffles": 1, **options}
    return tasks.information(presses(), "presses.csv", tasks.InformationOptions(**small))


def information() -> tuple[Callable[..., Any], dict[str, Any]]:
    options = tasks.InformationOptions(window_ms=5.0, draws=1, folds=2, shuffles=1)
    more = {"labels": "presses.csv", "options": options, "progress": lambda *_: None, "watch": lambda *_: None}
    return tasks.information, {"recordings": presses(), **more}


def result(name: str) -> Any:
    function, arguments = SOUND[name]()
    return function(**arguments)


#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.train": on(tasks.train, labels=[LABELS], options=tasks.TrainOptions(folds=2), progress=lambda *_: None),
    "taxel.tasks.TrainOptions": plain(
        tasks.TrainOptions,
        recipe="touch",
        changes={"align": False},
        tare=TARE,
        folds=2,
        search=False,
        window_ms=50.0,
        shift_ms=-20.0,
        labels_as_given=True,
    ),
    "taxel.tasks.Cause": plain(
        tasks.Cause,
        kind="shifted_labels",
        labels=("contact",),
        mistakes=3,
        measured="12 of 12 are 203 ms after what the sensor felt (median)",
        advice="--shift-ms -203",
        option="--shift-ms -203",
        arguments={"shift_ms": -203.0},
    ),
    "taxel.tasks.detect": on(
        lambda **given: tasks.detect(**{"readout": RULE, **given}),
        readout=RULE,
        truth=[LABELS],
        options=tasks.DetectOptions(),
        progress=lambda *_: None,
    ),
    "taxel.tasks.DetectOptions": plain(tasks.DetectOptions, tare=0.3, frame_us=192.0, window_ms=50.0, shift_ms=1.0),
    "taxel.tasks.rest": one(tasks.rest, tare=0.3),
    "taxel.tasks.info": one(tasks.info, tare=0.3),
    "taxel.tasks.encode": one(
        tasks.encode, options=tasks.EncodeOptions("level_crossing", {"levels": [30.0]}), progress=lambda *_: None
    ),
    "taxel.tasks.EncodeOptions": plain(
        tasks.EncodeOptions, encoder="level_crossing", parameters={"levels": [30.0]}, tare=TARE
    ),
    "taxel.tasks.calibrate": one(
        tasks.calibrate, "counts", loads=[tasks.KnownLoad(9.0)], options=tasks.CalibrateOptions(exponent=1.0)
    ),
    "taxel.tasks.Training.command": lambda: (
        RESULTS["taxel.tasks.Training"]().command,
        {"readout": "readout.json", "is_rule": False},
    ),
    "taxel.tasks.read_loads": lambda: (tasks.read_loads, {"path": "here_loads.csv"}),
    "taxel.tasks.CalibrateOptions": plain(
        lambda **given: tasks.calibrate(pressed("counts"), [tasks.KnownLoad(9.0)], tasks.CalibrateOptions(**given)),
        law=False,
        sensor={},
        table=None,
        unit="N",
        each=False,
        exponent=1.0,
        tare=0.3,
        date="2026-11-21",
        note="a weight",
    ),
    "taxel.tasks.KnownLoad": plain(
        lambda **given: tasks.calibrate(
            pressed("counts"), [tasks.KnownLoad(**given)], tasks.CalibrateOptions(exponent=1.0)
        ),
        load=9.0,
        unit="N",
        from_s=0.6,
        to_s=0.7,
        taxel=(1, 1),
        place="load",
    ),
    "taxel.tasks.information": information,
    "taxel.tasks.InformationOptions": plain(
        informed,
        encoder="change_events",
        parameters={},
        window_ms=5.0,
        windows_ms=[5.0],
        periods_ms=[1.0],
        taxels=[1],
        pools=[2],
        draws=1,
        folds=2,
        shuffles=1,
        seed=1,
        classifiers=[],
    ),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.tasks.Training": lambda: tasks.train(pressed(), [LABELS], tasks.TrainOptions(folds=0)),
    "taxel.tasks.Detecting": lambda: tasks.detect(RULE, pressed()),
    "taxel.tasks.Detected": lambda: tasks.detect(RULE, pressed()).each[0],
    "taxel.tasks.TakenRest": lambda: tasks.rest(pressed("counts")),
    "taxel.tasks.Info": lambda: tasks.info(pressed()),
    "taxel.tasks.Encoded": lambda: result("taxel.tasks.encode"),
    "taxel.tasks.Calibrated": lambda: result("taxel.tasks.calibrate"),
    "taxel.tasks.Information": lambda: result("taxel.tasks.information"),
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
