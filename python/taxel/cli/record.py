"""``taxel record``: record a board's datagrams in a file."""

from __future__ import annotations

import errno
import json
import time
from contextlib import nullcontext, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.live import Live as Display
from rich.text import Text

from taxel._base.messages import counted
from taxel._core import FIREWALL, ProblemError
from taxel.cli._noting import noting
from taxel.cli._say import say
from taxel.cli.app import OUTSIDE, App, Flat, JsonOption, Limits, SecondsOption
from taxel.cli.board import (
    REDRAW_S,
    counters_line,
    doubts,
    exit_code,
    for_live,
    received,
    say_waiting,
    say_wrong,
    with_live_options,
)
from taxel.cli.console import Console
from taxel.cli.task import OutArgument
from taxel.live import Live, Summary

app = App(name="record")

#: With --trials: the number of empty trials in a row that ends the command.
_EMPTY = 3


@dataclass(frozen=True)
class _RecordArguments:
    """Hold for how long, how often and until which mark is recorded.

    Parameters
    ----------
    markers
        End at the board's stop marker.
    length
        Automatic mode: record trials of this length, s.
    countdown
        Automatic mode: countdown before each trial, s.
    start_index
        Automatic mode: the number of the first trial, appended to its name.
    trials
        Automatic mode: number of trials. Default: until Ctrl-C.
    """

    seconds: SecondsOption = None
    markers: bool = False
    length: Annotated[float | None, Parameter(validator=Limits(0.001))] = None
    countdown: Annotated[int, Parameter(validator=Limits(0))] = 3
    start_index: Annotated[int, Parameter(validator=Limits(0))] = 1
    trials: Annotated[int | None, Parameter(validator=Limits(1))] = None
    as_json: JsonOption = False


@app.default
@with_live_options("record")
def record(
    file: OutArgument,
    *,
    options: Any,
    typed: Flat[_RecordArguments] = _RecordArguments(),
) -> int:
    """Record what a board sends by UDP, and report what was lost.

    Ends with Ctrl-C, SIGTERM or SIGHUP, after --seconds, or with the board's stop marker (--markers). With --length
    it records one trial after another, with a number appended to the name and a countdown with beeps before each.
    The board is received during countdowns too, so each trial begins with the values of all taxels; with
    --countdown 0 nothing is lost between two trials. An empty trial is not saved, and its number is used again;
    with --trials, three empty trials in a row end the command with exit code 3. While it records, a line on
    standard input writes a note with that label and the board's time (add < /dev/null if the input
    is not for taxel). --source names what is received, each source with its own clock: frames of numbers, boards,
    lines of numbers. Exit code 3: nothing was received, or data were lost after they had arrived, such as bytes
    outside the lines of a source; 2: the board has more taxels than --array.

    Example: taxel record --port 5208 walk.mcap
    Example: taxel record walk.mcap --port 5208 --source left=board:0.0.0.0:5209 --source imu=serial:COM3
    Example: taxel record mat.mcap --source serial:/dev/ttyACM0,array=16x16,unit=counts

    Parameters
    ----------
    file
        A new .mcap file.
    """
    if typed.length is None and typed.trials is not None:
        raise ProblemError("--trials needs --length, the length of each trial: give both")
    if typed.length is not None and typed.seconds is not None:
        raise ProblemError("--seconds and --length: give --length for automatic mode, --seconds for one recording")
    live = for_live(options, typed.seconds)
    console = Console(stderr=True)
    say_waiting(live, console)
    if typed.length is None:
        summary, code = _one(file, live, typed, console)
        _print(summary, typed.as_json)
    else:
        code = _automatic(file, live, typed, console)
    return code


def _automatic(file: Path, live: dict[str, Any], typed: _RecordArguments, console: Console) -> int:
    """Record trials from one receiver until Ctrl-C, which ends the current one regularly; return an exit code."""
    trials, how = typed.trials, {name: live.pop(name) for name in ("compression", "overwrite")}
    codes: list[int] = []
    empty = 0

    def following(saved: int) -> Path:
        name = file.with_stem(f"{file.stem}{typed.start_index + saved}")
        if name.exists() and not how["overwrite"]:
            raise FileExistsError(errno.EEXIST, "exists already", str(name))
        return name

    def report(ended: Summary | None) -> None:
        """Print how a trial ended; the next trial gets the number of an empty one."""
        nonlocal empty
        if ended is not None and ended.path is not None:
            _print(ended, typed.as_json)
            codes.append(exit_code(ended, receiver.array))
            empty = 0
        else:
            say(f"taxel: {name}: nothing arrived at {receiver.place}{FIREWALL}; not saved", err=True)
            empty += 1

    name = following(0)
    with Live(record_later=True, **live) as receiver:
        notes = noting(receiver.note, console.print) if _takes_notes(live["sources"]) else nullcontext("")
        with notes as keys:
            try:
                while trials is None or (len(codes) < trials and empty < _EMPTY):
                    if not receiver.records:
                        _count_down(name, typed.countdown, console)
                        receiver.record(name, **how)
                    _watch(receiver, name, typed.length, typed.markers, console, keys, trial=True)
                    if typed.countdown or len(codes) + 1 == trials or not receiver.records:
                        report(receiver.end_recording())
                        name = following(len(codes)) if trials is None or len(codes) < trials else name
                    elif receiver.record_again():
                        report(None)
                    else:
                        try:
                            after = following(len(codes) + 1)
                        except FileExistsError:
                            report(receiver.end_recording())
                            raise
                        report(receiver.record(after, **how))
                        name = after
            except KeyboardInterrupt:
                pass
            gave_up = trials is not None and empty >= _EMPTY
            if receiver.records and ((ended := receiver.end_recording()).path is not None or not gave_up):
                report(ended)
    return max([*codes, OUTSIDE if gave_up or not codes else 0])


def _count_down(name: Path, seconds: int, console: Console) -> None:
    for left in range(seconds, 0, -1):
        console.bell()
        console.print(f"{name}: begins in {left} s")
        time.sleep(1.0)
    # The manual's last beep is higher; a terminal has one bell, so it rings twice.
    console.bell()
    console.bell()


def _one(file: Path, options: dict[str, Any], typed: _RecordArguments, console: Console) -> tuple[Summary, int]:
    """Record one file until its time is over, the board marks a stop, or Ctrl-C; return summary and exit code."""
    with Live(record=file, **options) as live:
        notes = noting(live.note, console.print) if _takes_notes(options["sources"]) else nullcontext("")
        with suppress(KeyboardInterrupt), notes as keys:
            _watch(live, file, typed.seconds, typed.markers, console, keys, trial=False)
        summary = live.stop()
        return summary, exit_code(summary, live.array)


def _takes_notes(sources: list[str] | None) -> bool:
    """Return whether typed lines are notes: a source may read the input itself."""
    return not any(source.split(",")[0].endswith("lines:-") for source in sources or ())


def _watch(
    live: Live, file: Path, seconds: float | None, markers: bool, console: Console, keys: str, *, trial: bool
) -> None:
    """Show the counts until the time is over, the board marks a stop (with `markers`), or the recording has failed."""
    console.print(f"listening on {live.place}, recording to {file}; Ctrl-C ends")
    if live.read_as:
        console.print(live.read_as)
    if keys:
        console.print(keys)
    with Display(console=console, refresh_per_second=1 / REDRAW_S, transient=True) as display:
        before = live.counters
        told: set[tuple[str, str]] = set()
        began = before["seconds"]
        if trial:
            # Markers that were received before belong to an earlier trial.
            live.take_markers()
        while seconds is None or before["seconds"] - began < seconds:
            left = REDRAW_S if seconds is None else min(REDRAW_S, seconds - (before["seconds"] - began))
            live.next(left)
            for t, start in live.take_markers():
                console.print(f"{t / 1e6:.4f} s: the board marked a {'start' if start else 'stop'}")
                if markers and not start:
                    return
            now = live.counters
            say_wrong(now, live.array, told)
            display.update(Text(counters_line(before, now)))
            if (trial and not live.records) or live.is_over:
                return
            before = now


def _print(summary: Summary, as_json: bool) -> None:
    if as_json:
        path = None if summary.path is None else str(summary.path)
        say(json.dumps(asdict(summary) | {"path": path, "verdict_details": summary.verdict.to_dict()}))
        return
    counters = summary.counters
    if summary.path is not None:
        what = received(counters)
        if counters["lines"] is None:
            what += f", {counted(counters['capture']['bytes'], 'byte')}, {counted(counters['markers'], 'marker')}"
        say(f"{summary.path}: {what}, received in {counters['seconds']:.1f} s")
    for name, counts in counters["sources"].items():
        say(f"  {name}: {received(counts)}")
    for why in doubts(counters):
        say(why)
    say(summary.verdict)
