"""``taxel emulate``: an emulated board, which sends its events by UDP."""

from __future__ import annotations

import json
import secrets
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

from cyclopts import Parameter
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from taxel._base.files import check_writable
from taxel._base.messages import counted
from taxel._base.options import about
from taxel._core import ProblemError
from taxel.cli._say import say
from taxel.cli.app import App, Flat, JsonOption, Limits
from taxel.cli.console import Console
from taxel.cli.task import progress
from taxel.demo.script import TRAINING_SEED, endless, script
from taxel.live.sending import PORT
from taxel.options import settings
from taxel.recording.opening import open_one
from taxel.simulate import Act, Contact, EmulatorReport, Faults, Flaws, Replay, Scene, SceneFile, Version2
from taxel.simulate import emulate as run
from taxel.simulate.board import fitting
from taxel.simulate.circuit import Circuit, Converter, VirtualGround
from taxel.simulate.options import EmulateOptions
from taxel.wire.registers import QUOTED_PRESETS

app = App(name="emulate")


#: The parts of the circuit that an option sets.
_LINES, _CONVERTER = ("gain", "switch_ohm", "offset_mv"), ("hysteresis_v", "settle_us", "amplifier_us")
_T = TypeVar("_T")


def _option(name: str, options: type = EmulateOptions) -> Any:
    """Return the option of the command line that sets an option of `emulate`: its text and range."""
    described = about(options, name)
    limits = Limits(described.get("min"), described.get("max"))
    help_ = described["help"].replace("`taxel.wire.PRESETS`", QUOTED_PRESETS)
    return Parameter(help=help_, validator=limits)


def _several(name: str, flag: str, value: str) -> Any:
    """Return the option of the command line that sets the values of an option of `emulate` by their names."""
    return Parameter(
        name=flag,
        help=about(EmulateOptions, name)["help"],
        metavar=f"NAME={value}",
        n_tokens=-1,
        accepts_keys=False,
        converter=settings,
    )


@dataclass(frozen=True)
class _EmulateArguments:
    """Hold the options of the command.

    Parameters
    ----------
    port
        The UDP port to send to.
    host
        The machine to send to, by name or address.
    scenes
        Number of scenes. Default: play until Ctrl-C.
    scene
        Play the scene of this .toml, repeatedly, instead of random scenes.
    replay
        Play a recording instead of scenes.
    tare
        How long the noise floor is 0 before the start marker, s. Default: as in the scene's file, or 0.05.
    session
        Version 2 of the wire: the number of the first session. Default: random.
    labels
        Write the true times of the touches to this CSV, label,t_us,host_ns, as they happen.
    overwrite
        Replace the file of --truth if it exists.
    """

    port: Annotated[int, Parameter(validator=Limits(1, 65_535))] = PORT
    host: str = "127.0.0.1"
    scenes: Annotated[int | None, Parameter(validator=Limits(0))] = None
    scene: Path | None = None
    seed: Annotated[
        int | None, Parameter(help=about(EmulateOptions, "seed")["help"], validator=Limits(0, TRAINING_SEED - 1))
    ] = None
    replay: Path | None = None
    tare: Annotated[float | None, Parameter(metavar="SECONDS", validator=Limits(0, 60))] = None
    preset: Annotated[str | None, _option("preset")] = None
    wire: Annotated[int | None, _option("wire")] = None
    board: Annotated[int, _option("board", options=Version2)] = Version2.board
    session: Annotated[int | None, Parameter(validator=Limits(0, 65_535))] = None
    reset_every: Annotated[float | None, _option("reset_every_s")] = EmulateOptions.reset_every_s
    drift: Annotated[float, _option("drift_ppm")] = EmulateOptions.drift_ppm
    circuit: Annotated[Mapping[str, Any], _several("circuit", "--circuit", "VALUE")] = field(default_factory=dict)
    asynchronous: Annotated[bool, _option("asynchronous")] = EmulateOptions.asynchronous
    flaw: Annotated[Mapping[str, Any], _several("flaws", "--flaw", "SIZE")] = field(default_factory=dict)
    fault: Annotated[Mapping[str, Any], _several("faults", "--fault", "SHARE")] = field(default_factory=dict)
    control: Annotated[int | None, _option("control")] = None
    labels: Annotated[Path | None, Parameter(name="--truth", metavar="FILE")] = None
    overwrite: bool = False
    as_json: JsonOption = False


@app.default
def emulate(*, typed: Flat[_EmulateArguments] = _EmulateArguments()) -> None:
    """Emulate a board that sends its events by UDP, in real time, until Ctrl-C.

    In each scene a ball is dropped on foam over 64 x 64 taxels, caught in flight, pressed by hand and lifted. The board
    starts with a noise floor of 0, so that the rest of the taxels can be measured; then it sets the preset's floor and
    marks the start. --truth writes the labels for taxel train: contact and lift, by the board's clock (t_us) and by
    this machine's (host_ns).

    --scene plays a scene from a file instead of random ones. --replay plays a recording.

    Example: taxel emulate --port 5208 --scenes 5 --seed 1 --truth labels.csv
    """
    _check_options(typed)
    if typed.labels is not None:
        check_writable(typed.labels, overwrite=typed.overwrite)
    touch, text, board = _touch_of(typed)
    console = Console(stderr=True, quiet=typed.as_json)
    console.print(f"{text}, to {typed.host}:{typed.port}")
    report = _run(typed, touch, board, console)
    if typed.labels is not None:
        console.print(f"truth: {typed.labels}")
    if typed.as_json:
        summary: dict[str, Any] = {"seed": board["seed"], "scenes": typed.scenes, "preset": board["preset"]}
        summary |= {"held": report.held, "verdict": report.verdict}
        summary |= {"wanted_hz": report.wanted_hz, "reached_hz": report.reached_hz}
        say(json.dumps({**summary, **asdict(report)}))
    else:
        _print(report)


def _check_options(typed: _EmulateArguments) -> None:
    """Refuse options that do not go together."""
    replays = typed.replay is not None
    if typed.scene is not None and replays:
        raise ProblemError("--scene and --replay are both given: give only one of them")
    if replays and (typed.scenes is not None or typed.labels is not None):
        raise ProblemError("--scenes and --truth are for scenes: leave them out with --replay")


def _touch_of(typed: _EmulateArguments) -> tuple[Any, str, dict[str, Any]]:
    """Return the touch that the board plays, its description, and the board as `taxel.simulate.emulate` takes it.

    If the array is known, a wrong preset is refused first.
    """
    with progress(quiet=True):
        scene_file = None if typed.scene is None else SceneFile.open(typed.scene)
    board = scene_file or SceneFile(Scene({}))
    if typed.preset is not None:
        board = replace(board, preset=typed.preset)
    if typed.replay is None:
        fitting(board.preset, board.array)
    tare_ms = board.tare_ms if typed.tare is None else 1e3 * typed.tare
    drawn_seed = secrets.randbelow(TRAINING_SEED) if scene_file is None else scene_file.seed
    seed = drawn_seed if typed.seed is None else typed.seed
    session = secrets.randbelow(65_536) if typed.session is None else typed.session
    options: dict[str, Any] = {
        "seed": seed,
        "preset": board.preset,
        "tare_ms": tare_ms,
        "array": board.array,
        "sensor": board.sensor,
        "wire": (2 if typed.asynchronous else None) if typed.wire is None else 2 if typed.wire == 2 else 1,
        "version_2": Version2(typed.board, session),
        **_trouble(typed, seed),
        "reset_every_s": typed.reset_every,
        "drift_ppm": typed.drift,
        "control": None if typed.control is None else f"127.0.0.1:{typed.control}",
        "asynchronous": typed.asynchronous,
    }
    if typed.replay is not None:
        return Replay(open_one(typed.replay)), f"replay of {typed.replay}", options
    if scene_file is not None:
        return _from_file(scene_file, typed.scenes, tare_ms), f"{typed.scene}, seed {seed}", options
    return *_scenes(seed, typed.scenes, tare_ms), options


def _run(typed: _EmulateArguments, touch: Any, board: dict[str, Any], console: Console) -> EmulatorReport:
    """Run the board until its end or Ctrl-C, and show the progress."""
    bar = Progress(
        TextColumn("{task.description}"), BarColumn(pulse_style="bar.complete"), TextColumn("{task.fields[status]}"),
        TimeElapsedColumn(), console=console, transient=True, disable=typed.as_json,
    )  # fmt: skip
    last: list[EmulatorReport] = []
    address = f"[{typed.host}]:{typed.port}" if ":" in typed.host else f"{typed.host}:{typed.port}"
    with bar, _TruthTable(typed.labels, typed.overwrite) as truth:
        task = bar.add_task("playing", total=None, status="")

        def begun(address: str | None) -> None:
            if address is not None:
                console.print(f"commands are accepted at {address}")

        def watch(report: EmulatorReport) -> None:
            last[:] = [report]
            truth.write(report)
            played_s, late = f"{report.board_seconds:.1f} s", f"late p99 {report.late_us['p99']:.0f} us"
            bar.update(task, status=f"{played_s}, {counted(report.changes, 'event')}, {late}")

        try:
            last[:] = [run(address, touch, **board, begun=begun, watch=watch, touched=truth.add)]
        except KeyboardInterrupt:
            # If scenes repeat without end, Ctrl-C is the regular end; else it interrupts the command.
            if not last or typed.scenes is not None or typed.replay is not None:
                raise
        truth.write(last[0])
    return last[0]


def _scenes(seed: int, scenes: int | None, tare_ms: float) -> tuple[Any, str]:
    """Return random scenes as a touch, and their description."""
    if scenes is None:
        return endless(seed, tare_ms=tare_ms), f"seed {seed}: scenes until Ctrl-C"
    return script(seed, scenes, tare_ms=tare_ms), f"seed {seed}: {counted(scenes, 'scene')}"


def _from_file(scene_file: SceneFile, scenes: int | None, tare_ms: float) -> Iterator[Act]:
    """Yield silence for the tare, then the scene of a file repeatedly."""
    before, scene, after = replace(scene_file, tare_ms=tare_ms).acts()
    yield before
    for _ in count() if scenes is None else range(scenes):
        yield scene
        yield after


def _print(report: EmulatorReport) -> None:
    events, datagrams = counted(report.changes, "event"), counted(report.datagrams, "datagram")
    say(f"{events} in {datagrams}, {counted(report.bytes, 'byte')}")
    if report.network is not None:
        say("network: " + ", ".join(f"{n} {name}" for name, n in report.network.items()))
    say(report.verdict)


def _part(option: str, values: Mapping[str, Any], names: Collection[str], make: Callable[..., _T]) -> _T | None:
    """Return what the values of an option make, None of none; an error names the option."""
    wrong = next((name for name in values if name not in names), None)
    if wrong is not None:
        raise ProblemError(f"--{option} {wrong}: must be one of {', '.join(names)}")
    try:
        return make(**values) if values else None
    except ProblemError as error:
        raise ProblemError(f"--{option} {error}") from None


def _trouble(typed: _EmulateArguments, seed: int) -> dict[str, Any]:
    """Return the circuit, the flaws and the faults, all of one seed."""

    def circuit(**values: Any) -> Circuit:
        lines, converter = ({name: values[name] for name in part if name in values} for part in (_LINES, _CONVERTER))
        return Circuit(readout=VirtualGround(**lines, seed=seed), converter=Converter(**converter))

    def flaws(**sizes: Any) -> Flaws:
        return Flaws(**sizes, seeds=dict.fromkeys(sizes, seed))

    return {
        "circuit": _part("circuit", typed.circuit, (*_LINES, *_CONVERTER), circuit),
        "flaws": _part("flaw", typed.flaw, Flaws._names(), flaws),
        "faults": _part("fault", typed.fault, Faults._names(), partial(Faults, seed=seed)),
    }


#: A board that is behind its time by less than this holds its rate, s: threads wake late, and catch up.
_HELD_S = 0.1


class _TruthTable:
    """Write contact and lift-off of the touches to a CSV, each when the board's time has reached it."""

    def __init__(self, path: Path | None, overwrite: bool) -> None:
        self._pending: deque[tuple[float, str]] = deque()
        # Written line by line, not by `write_whole`, so that Ctrl-C leaves the lines of what has happened.
        self._file = None if path is None else path.open("w" if overwrite else "x", encoding="utf-8", newline="\n")
        self._put("label,t_us,host_ns")

    def add(self, contacts: list[Contact]) -> None:
        """Add coming touches, which are later than all that were added before."""
        ends = [(c.start_us, "contact") for c in contacts] + [(c.stop_us, "lift") for c in contacts]
        self._pending.extend(sorted(ends))

    def write(self, report: EmulatorReport) -> None:
        """Write what has happened by the board's time; by the host, which is later where the machine is too slow."""
        behind = report.seconds - report.board_seconds
        behind_ns = 1e9 * behind if behind > _HELD_S else 0.0
        while self._pending and self._pending[0][0] <= 1e6 * report.board_seconds:
            t, label = self._pending.popleft()
            self._put(f"{label},{round(t)},{report.began_ns + round(1e3 * t + behind_ns)}")

    def _put(self, line: str) -> None:
        if self._file is not None:
            self._file.write(f"{line}\n")
            self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()
