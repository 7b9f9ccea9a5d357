"""Nonsense in every argument of every public function: one clear error of taxel's, or Python's own for files.

Each public callable has a sound call in `tests/sound`, by room; each argument in turn is replaced by each piece of
nonsense. A callable without a sound call fails the first test, so that nothing public stays untried.
"""

import functools
import inspect
import json
import math
import re
import shutil
from decimal import Decimal
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from sound import LEFT_OUT, RESULTS, SOUND
from sound.calibration import CALIBRATION
from sound.detect import READOUT, RULE
from sound.things import EVENTS, FOUND, TARE, TICKS, TRAINS

import taxel
from taxel import _core
from taxel._base.saved import Saved
from taxel.information.spiking import NeuronPerClass
from taxel.learn._learner import SpikeLearner

mpl.use("Agg")

#: Phrases of parsers that must not occur in taxel's errors.
PARSERS = r"invalid (type|value|length)|(unknown|missing|duplicate) (variant|field)|, expected |did not match|`"


class Endless:
    """What nobody can show: its representation calls itself."""

    def __repr__(self) -> str:
        return repr(self)


NONSENSE: dict[str, Any] = {
    "None": None,
    "NaN": math.nan,
    "infinity": math.inf,
    "minus infinity": -math.inf,
    "minus zero": -0.0,
    "a tiny float": 1e-300,
    "a large float": 1e300,
    "minus one": -1,
    "zero": 0,
    "a half": 0.5,
    "huge": 10**30,
    "a huge float": 1e308,
    "beyond int64": 2**63,
    "true": True,
    "text": "nonsense",
    "text with a zero": "\0",
    "a number in text": "1_000",
    "a number in Arabic digits": "\u0663",
    "a number in text in an array": np.array("5"),
    "None in an array": np.array(None, dtype=object),
    "a signalling NaN": Decimal("sNaN"),
    "a signalling NaN in a list": [Decimal("sNaN")],
    "this folder": ".",
    "the folder above": "..",
    "the root folder": "/",
    "bytes": b"\x80\xff",
    "an object": object(),
    "a class": int,
    "a class of numbers": np.float64,
    "a class of taxel": taxel.Frames,
    "a module": np,
    "an endless representation": Endless(),
    "a function": len,
    "nothing in a list": [],
    "NaN in a list": [math.nan],
    "infinity in a list": [math.inf],
    "a huge float in a list": [1e308],
    "the least float in a list": [5e-324],
    "a text in a list": ["1.5"],
    "a text in a list in a list": [["1.5"]],
    "endless representations in a list": [Endless()],
    "None in a list": [None],
    "a ragged list": [[1.0, 2.0], [3.0]],
    "three dimensions": np.zeros((2, 3, 4)),
    "falling numbers": np.array([3.0, 2.0, -1.0]),
    "a wrong dtype": np.array(["a", "b"]),
    "complex numbers": np.array([1j, 2j]),
    "an empty dictionary": {},
    "a strange dictionary": {"nonsense": None, 3: object()},
    "a set": {1, 2},
    "another array": taxel.Array(3, 5),
    "other trains": taxel.SpikeTrains.from_lists([[1.0], [2.0]]),
    "the least float": 5e-324,
    "a span of time": np.timedelta64(5),
    "half of a surrogate pair": "\ud800",
    "a masked value": np.ma.masked,
    "an array of which one number is repeated": np.broadcast_to(np.float64(1.0), 10**9),
    "a list that holds itself": [],
}
NONSENSE["a list that holds itself"].append(NONSENSE["a list that holds itself"])

#: Parameters that are callbacks: an error raised in a callback belongs to the caller, and is passed through.
CALLED = {"answer", "begun", "progress", "say", "touched", "watch"}


def modules() -> list[Any]:
    """The package and the rooms that it offers; the command line has exit codes instead, and tests of its own."""
    rooms = [room for name in taxel.__all__ if inspect.ismodule(room := getattr(taxel, name))]
    return [taxel, *rooms, taxel.simulate.circuit]


@functools.cache
def public() -> dict[str, Any]:
    """Every public callable of taxel."""
    return public_of(modules(), SOUND)


def public_of(rooms: list[Any], tried: dict[str, Any]) -> dict[str, Any]:
    """Every public callable once, by its shortest name: functions, classes, methods of these and of private bases."""
    names: dict[int, str] = {}
    found: dict[str, Any] = {}
    for module in rooms:
        for name in getattr(module, "__all__", ()):
            value = getattr(module, name)
            if not callable(value) or id(value) in names:
                continue
            full = f"{module.__name__}.{name}"
            names[id(value)] = full
            found[full] = value
            if inspect.isclass(value) and not issubclass(value, BaseException):
                own = [
                    base
                    for base in reversed(value.__mro__)
                    if base is value or base.__name__.startswith("_") or base in (Saved, NeuronPerClass)
                ]
                members = {part: member for base in own for part, member in vars(base).items()}
                if issubclass(value, SpikeLearner):  # what all learners share is tried with some of them
                    members |= {part: one for part, one in vars(SpikeLearner).items() if f"{full}.{part}" in tried}
                for part, member in members.items():
                    held = member.__func__ if isinstance(member, classmethod | staticmethod) else member
                    if not part.startswith("_") and part != "plot" and inspect.isfunction(held):
                        found[f"{full}.{part}"] = held
    return {name: value for name, value in found.items() if takes(value) or name in tried}


def takes(value: Any) -> set[str]:
    """The names of what a callable takes; ``**`` takes names of its own."""
    try:
        parameters = inspect.signature(value).parameters.values()
    except ValueError:  # exceptions that the compiled part makes
        return set()
    named = {p.name for p in parameters if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)}
    return named - {"self", "cls"}


def test_every_public_callable_has_a_sound_call() -> None:
    there = public()
    known = {**SOUND, **RESULTS, **LEFT_OUT}
    assert len(known) == len(SOUND) + len(RESULTS) + len(LEFT_OUT)
    untried, gone = sorted(set(there) - set(known)), sorted(set(known) - set(there))
    assert (untried, gone) == ([], []), "add a sound call to SOUND, of a result to RESULTS; take out what is gone"


@pytest.mark.usefixtures("somewhere")
def test_every_argument_of_a_sound_call_is_there_to_be_tried() -> None:
    there = public()
    for name, sound in SOUND.items():
        assert takes(there[name]) <= set(sound()[1]), name


SCENE_FILE = """
[[bodies]]
shape.sphere.radius_mm = 15
x_mm = 80
y_mm = 80
mass_g = 40
motion.dropped.height_mm = 120
"""


def write_clock(path: Path) -> None:
    """Write a recording with arrival times, a change of the board and a zeroed taxel."""
    writer = _core.RecordingWriter(path, json.dumps({"array": EVENTS.array._geometry()}), "none", True)
    for k, t in enumerate(EVENTS.t.tolist()):
        writer.datagram(10**18 + t * 1000, k, taxel.wire.encode(EVENTS[EVENTS.t == t]))
    writer.board_change(10**18, json.dumps({"t_us": 200, "change": "reset"}))
    writer.zeroing(10**18, 200, 1, 1, 5.0, None)
    writer.finish("{}")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that sound calls read."""
    folder = tmp_path_factory.mktemp("made")
    FOUND.to_csv(folder / "here.csv")
    TRAINS.save(folder / "here.npz")
    TARE.save(folder / "here_tare.json")
    CALIBRATION.save(folder / "here_calibration.json")
    TICKS.save(folder / "here_events.calibration.json")
    READOUT.save(folder / "here_readout.json")
    RULE.save(folder / "here_rule.json")
    TRAINS.to_nwb(folder / "here.nwb")
    taxel.convert(EVENTS, folder / "here_events.npz")
    (folder / "here.toml").write_text('[encoder]\nname = "fa1"\n')
    taxel.convert(EVENTS, folder / "here_panel.mcap")
    write_clock(folder / "here_clock.mcap")
    (folder / "here_scene.toml").write_text(SCENE_FILE)
    (folder / "here_labels.csv").write_text("label,t_us\na,5\n")
    (folder / "here_loads.csv").write_text("load,unit,from_s,to_s\n9,N,0.6,0.7\n")
    (folder / "here_trials.csv").write_text("recording,t_us,label\nhere_events,0,a\n")
    (folder / "pdb").mkdir()
    row = "\t".join(["0"] * 18)
    (folder / "pdb" / "GaCo01_01.txt").write_text("\n".join(f"{k / 100}\t{row}" for k in range(50)) + "\n")
    return folder


@pytest.fixture
def somewhere(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of that folder as the current one."""
    shutil.copytree(made, tmp_path, copy_function=shutil.copyfile, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("somewhere")
@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_what_a_sound_call_returns(name: str) -> None:
    assert isinstance(RESULTS[name](), public()[name])


#: Sound calls that take long, as they start processes, play scenes, train, estimate or draw.
LONG = {
    *("SpikeTrains.to_nwb", "SpikeTrains.from_nwb", "Readout.to_nir", "open_all", "train", "cut"),
    *("simulate.emulate", "simulate.play", "simulate.Scene.motion", "simulate.Silence", "information.answer"),
    *("tasks.InformationOptions", "tasks.information", "tasks.CalibrateOptions", "tasks.KnownLoad", "tasks.calibrate"),
    *("tasks.detect", "tasks.encode", "tasks.rest", "tasks.info", "tasks.TrainOptions", "plot.pressure", "Note"),
}


def tried(name: str, *, every: bool, argument: int) -> list[tuple[str, Any]]:
    """The nonsense for an argument: in a quick run a third of it, or a tenth; other parts in the arguments after it."""
    step = 1 if every else 10 if name.removeprefix("taxel.") in LONG else 3
    return list(NONSENSE.items())[argument % step :: step]


@pytest.mark.usefixtures("somewhere")
@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SOUND)
def test_nonsense_in_each_argument_is_one_clear_error(name: str, every: bool) -> None:
    faults = []
    for k, argument in enumerate(SOUND[name]()[1]):
        for kind, nonsense in tried(name, every=every, argument=k):
            if argument in CALLED and callable(nonsense):
                continue
            function, arguments = SOUND[name]()
            try:
                function(**{**arguments, argument: nonsense})
            except (taxel.Error, OSError) as error:
                said = str(error)
                if not said or "\n" in said or "a bug in taxel" in said or re.search(PARSERS, said):
                    faults.append(f"{argument} = {kind}: {type(error).__name__}: {said!r}")
            except BaseException as error:  # what else comes out is a fault, a panic too
                faults.append(f"{argument} = {kind}: {type(error).__name__}: {error}")
    assert not faults, "\n".join(["", *faults])


#: What NaN or infinity means where it is taken as a number, as the docstrings say, and where.
MEANS = [
    ("NaN", "a value is missing", ["Frames(values)", "Frames.from_events(held)", "live.Live.sample(values)"]),
    ("NaN", "there is no taxel", ["Places(x)", "Places(y)", "Places(area)"]),
    ("infinity", "there is no taxel", ["Places(x)", "Places(y)", "Places(area)"]),
    ("infinity", "to the end", ["Events.between(stop)", "Frames.between(stop)", "Detections.between(stop)"]),
    ("infinity", "to the end", ["Recording.between(stop)", "cut(stop_us)", "detect.Part(stop)"]),
    ("infinity", "for ever", ["device.Cable.reopen(within)", "device.Device(patience)"]),
    ("infinity", "no spike is moved", ["metrics.victor_purpura(q)"]),
    ("infinity", "no spike is moved", ["metrics.victor_purpura_multi_unit(q)", "metrics.victor_purpura_multi_unit(k)"]),
    ("NaN", "its reader has checked the row", ["Note(t)", "Note(at_ns)", "Note(replaces)"]),
    ("infinity", "its reader has checked the row", ["Note(t)", "Note(at_ns)", "Note(replaces)"]),
]


def with_number(value: Any, number: float) -> Any:
    """An argument with a number in the place of its first one; None if it holds none."""
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        return number
    if isinstance(value, list) and any(isinstance(entry, list | np.ndarray) for entry in value):
        place, first = next(
            ((k, one) for k, entry in enumerate(value) if (one := with_number(entry, number)) is not None), (0, None)
        )
        return None if first is None else [*value[:place], first, *value[place + 1 :]]
    numbers = isinstance(value, list | tuple) and all(isinstance(one, int | float | np.number) for one in value)
    if numbers or (isinstance(value, np.ndarray) and value.dtype.kind in "iuf"):
        array = np.array(value, np.float64)
        array.flat[:1] = number
        return array if array.size else None
    return None


def nans(value: Any) -> int:
    """The number of NaN in a result of numbers."""
    if isinstance(value, tuple | list):
        return sum(map(nans, value))
    array = value if isinstance(value, np.ndarray) else np.array(value if isinstance(value, float) else 0.0)
    return int(np.isnan(array).sum()) if array.dtype.kind == "f" else 0


@pytest.mark.usefixtures("somewhere")
@pytest.mark.parametrize("name", SOUND)
def test_nan_and_infinity_are_refused_where_they_mean_nothing(name: str) -> None:
    taken = []
    for argument in SOUND[name]()[1]:
        for kind, number in (("NaN", math.nan), ("infinity", math.inf)):
            function, arguments = SOUND[name]()
            wrong = with_number(arguments[argument], number)
            if wrong is None:
                continue
            try:
                function(**{**arguments, argument: wrong})
                taken.append((f"{name}({argument})", kind))
            except (taxel.Error, OSError):
                pass
    meant = [(f"taxel.{place}", kind) for kind, _, places in MEANS for place in places]
    assert sorted(taken) == sorted(one for one in meant if one[0].startswith(f"{name}("))


#: Finite numbers whose squares or quotients are not, and the zero that is below 0.
EXTREME = (1e308, 5e-324, -1e308, 1e-300, 1e200, -0.0)
#: Results that are not a number of sound arguments too, as their docstrings say.
NO_NUMBER = {
    "taxel.Frames.centre": "no taxel counts",
    "taxel.simulate.circuit.Converter.ticks": "a comparator had not returned",
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("somewhere")
@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SOUND)
def test_a_sound_call_is_sound_and_numbers_give_numbers(name: str, every: bool) -> None:
    """Finite arguments, however large or small, are refused or give a result without NaN, where the sound call has.

    A quick run tries a third of the numbers in each argument, another third in the next.
    """
    faults = []
    function, arguments = SOUND[name]()
    found = nans(function(**arguments))
    least = math.inf if name in NO_NUMBER else found
    for k, argument in enumerate(arguments):
        for number in EXTREME if every else EXTREME[k % 3 :: 3]:
            function, arguments = SOUND[name]()
            wrong = with_number(arguments[argument], number)
            if wrong is None:
                continue
            try:
                if nans(function(**{**arguments, argument: wrong})) > least:
                    faults.append(f"{argument} = {number}")
            except (taxel.Error, OSError) as error:
                if len(str(error)) > 400:
                    faults.append(f"{argument} = {number}: {error}")
    assert not faults, faults
