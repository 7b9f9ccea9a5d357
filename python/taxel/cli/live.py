"""``taxel live``: detections in a board's events, as these arrive."""

from __future__ import annotations

import contextlib
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter
from rich.live import Live as Display
from rich.text import Text

from taxel._base.messages import counted, plain
from taxel._base.stopping import asked_to_end
from taxel._core import FIREWALL, DeviceError, ProblemError
from taxel.array import Array
from taxel.cli._paneling import OpenOption, PanelHostOption, PanelPortOption, announce
from taxel.cli._say import say
from taxel.cli.app import App, Flat, SecondsOption
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
from taxel.cli.task import Output
from taxel.detect import PlainRule, Readout
from taxel.detect.board import differences
from taxel.device import Cable
from taxel.live import Live, Summary, delays
from taxel.panel import Panel
from taxel.panel.board import Board
from taxel.spikes import to_ms
from taxel.tare import Tare
from taxel.verdict import in_words
from taxel.wire import Registers

app = App(name="live")

#: How long a board may take to send its first datagram, s.
_FIRST_WITHIN_S = 1.0


@dataclass(frozen=True)
class _LiveArguments:
    """Hold the options of the command.

    Parameters
    ----------
    control
        The board's serial line (COM3, /dev/ttyACM0, host:port), on which the panel sets registers, and taxel sets a
        noise floor of 0 while it takes a tare.
    report
        With --record: write a report to this folder, with potential, weights, errors and the worst events.
    panel
        Show the board in a browser.
    folder
        With --panel: the folder of the recordings. Default: the current folder.
    """

    control: str | None = None
    seconds: SecondsOption = None
    report: Annotated[Path | None, Parameter(metavar="FOLDER")] = None
    panel: bool = False
    panel_host: PanelHostOption = "127.0.0.1"
    panel_port: PanelPortOption = 0
    folder: Annotated[Path | None, Parameter(metavar="FOLDER")] = None
    opens: OpenOption = False


@app.default
@with_live_options("live")
def live(*, options: Any, typed: Flat[_LiveArguments] = _LiveArguments()) -> int:
    """Receive a board's events, or frames of numbers, and print what a readout detects, live; with --panel, show them.

    Prints one line for each detection, and shows rates, losses and latency. With --json each detection is one line of
    JSON, written by the thread that made it: label; t_us, known_us, reported_us by the board's clock; slope_mv_per_ms;
    reported_ns by this computer's clock. --send sends the same lines elsewhere; a reader that is too slow loses lines,
    which are counted. --panel shows the board in a browser; a slow viewer loses frames, never data. If the source is
    the standard input, the command ends with this input. Exit code 3: nothing was received, or data were lost after
    they had arrived; 2: the board has more taxels than the array.

    Example: taxel live --port 5208 --readout ball.json --tare 0.05 --record ball.mcap
    Example: taxel live --readout ball.json --tare 0.05 --send lines+udp:127.0.0.1:9000 --send serial:/dev/ttyACM0
    Example: taxel live --source serial:/dev/ttyACM0,array=16x16 --readout mat.json
    Example: taxel live --panel --control 127.0.0.1:5209
    """
    _check_options(options, typed)
    options = for_live(options, typed.seconds)
    trained, rest, record, lines = (options[name] for name in ("readout", "tare", "record", "lines"))
    if typed.control is not None and not typed.panel and not isinstance(rest, float):
        raise ProblemError("--control needs a fresh tare or the panel: give --tare SECONDS, or --panel")
    if typed.report is not None:
        if record is None:
            raise ProblemError("--report needs a recording: give --record FILE.mcap")
        Output(overwrite=options["overwrite"]).check_report(typed.report)
    console = Console(stderr=True)
    if typed.control is not None and options["registers"] is None:
        sensor = trained.array if options["array"] is None and trained is not None else options["array"]
        options["registers"] = _registers_of(typed.control, Array._of(sensor), console)
    with contextlib.ExitStack() as at_rest:
        if typed.control is not None and isinstance(rest, float):
            at_rest.enter_context(at_rest.enter_context(Cable(typed.control)).floor(0))
        say_waiting(options, console)
        with Live(**options) as pipeline:
            # Detections are printed from here on: what asks to end ends as it does later.
            with asked_to_end() as end_request:
                if trained is not None and pipeline.frame_us is None:
                    _say_of_board(trained, pipeline, console)
                if trained is not None and trained.unit is not None and not pipeline._states_unit:
                    console.print(
                        f"values are assumed to be in {pipeline.unit}, the unit of the readout: --source states no unit"
                    )
                for name in pipeline.counters["sources"]:
                    console.print(
                        f"{name}: this source is recorded, but neither read out nor shown; a second taxel live can "
                        "read it out"
                    )
                last = _show(typed, pipeline, console, at_rest, end_request, fresh=isinstance(rest, float))
            summary = last.stop()
            # Detections that the readout made while `stop` ran.
            _drain(last, None if lines else say)
    if typed.report is not None and trained is not None and summary.path is not None:
        printed = list(_summary_lines(summary))
        given = rest if summary.tare is None else summary.tare
        _report(typed.report, trained, summary, given, printed, overwrite=options["overwrite"])
        console.print(f"report: {typed.report / 'report.html'}")
    _report_unsent(summary)
    say(*_summary_lines(summary), err=lines)
    return exit_code(summary, pipeline.array)


def _registers_of(control: str, array: Array, console: Console) -> Registers | None:
    """Return the registers that a board holds; None, with one line, if they cannot be read."""
    board = Board(Cable(control))
    try:
        board.read()
        return Registers._of(board.registers, array)
    except (DeviceError, OSError) as error:
        console.print(f"the registers of the board are not known: {error}")
        return None
    finally:
        board.close()


def _say_of_board(trained: Readout | PlainRule, pipeline: Live, console: Console) -> None:
    """Say in what the board differs from that of the training, or which frames are assumed."""
    training, registers = trained._parts.get("training") or {}, pipeline._options.registers
    assert isinstance(registers, Registers)
    board = training.get("board") or {}
    if pipeline._registers_stated:
        differing = differences(training, registers)
    elif board.get("frame_us", registers.frame_us) != registers.frame_us:
        differing = (
            f"the readout was trained on frames of {plain(board['frame_us'])} us, and frames of "
            f"{plain(registers.frame_us)} us are assumed: give --preset"
        )
    else:
        differing = ""
    if differing:
        console.print(differing)


def _show(
    typed: _LiveArguments,
    pipeline: Live,
    console: Console,
    at_rest: contextlib.ExitStack,
    end_request: threading.Event,
    *,
    fresh: bool,
) -> Live:
    """Show the board in terminal and panel until the end; return the last receiver."""
    shows: Panel | None = None
    # A serial line has one user at a time: first the tare, then the panel.
    later = typed.control if fresh and typed.panel else None
    # A reader of the lines that ends (BrokenPipeError) ends the command as Ctrl-C does.
    with contextlib.ExitStack() as shown, contextlib.suppress(KeyboardInterrupt, BrokenPipeError):
        if typed.panel:
            control = None if later is not None else typed.control
            try:
                shows = shown.enter_context(
                    Panel(pipeline, control=control, folder=typed.folder, host=typed.panel_host, port=typed.panel_port)
                )
                announce(shows, typed.opens, console)
            except ProblemError:
                if not pipeline.is_over:
                    raise
                console.print("the page was not served: the source ended first")
        _watch(pipeline, shows, typed.seconds, console, at_rest, end_request, fresh=fresh, control=later)
    return pipeline if shows is None or shows.live is None else shows.live


def _report(
    folder: Path,
    readout: Readout | PlainRule,
    summary: Summary,
    tare: Tare | float | None,
    printed: list[str],
    *,
    overwrite: bool,
) -> None:
    """Write the report on a recording: its events and its detections."""
    import taxel  # noqa: PLC0415
    from taxel.detect import Example, Outcome  # noqa: PLC0415
    from taxel.report import write_detections  # noqa: PLC0415  pictures load slowly

    assert summary.path is not None
    recording = taxel.open(summary.path)
    rest = tare if isinstance(tare, Tare) else None
    outcome = Outcome(str(summary.path), Example(recording, {}, rest), recording.detections)
    title = f"Live detections, recorded to {summary.path}"
    write_detections(folder, readout, [outcome], title=title, printed=printed, overwrite=overwrite)


def _summary_lines(summary: Summary) -> Iterator[str]:
    """Yield what was detected, received and lost."""
    counters = summary.counters
    yield f"{counted(counters['detections'], 'detection')}, {received(counters)} in {counters['seconds']:.1f} s"
    if counters["detections"]:
        yield f"from known to output: {delays(counters['report_latency'])}"
    if counters["wrong"]:
        wrong = counted(counters["wrong"], "detection")
        yield f"{wrong} output too early: events arrived late (--guard-frames waits longer)"
    if counters["late"]:
        yield f"{counted(counters['late'], 'event')} arrived out of order: read out on arrival, and recorded"
    if counters["events_dropped"]:
        yield in_words({"dropped_before_readout": counters["events_dropped"]})
    yield from doubts(counters)
    if summary.path is not None:
        yield f"recorded to {summary.path}"
    yield str(summary.verdict)


def _report_unsent(summary: Summary) -> None:
    """Report lines that did not reach their destination."""
    for line in summary.counters["sent"]:
        if lost := line["lost"]:
            why = line["trouble"] or "the receiver reads too slowly"
            say(f"taxel: {lost} of {line['sent'] + lost} lines not sent to {line['to']}: {why}", err=True)


def _check_options(options: Any, typed: _LiveArguments) -> None:
    """Refuse options that would have no effect."""
    readout, tare = options.readout, options.tare
    if readout is None and not typed.panel:
        raise ProblemError("nothing to do: give --readout FILE to detect, or --panel to show the board")
    if readout is None and (tare or typed.report):
        raise ProblemError("--tare and --report need a readout: give --readout FILE")
    if typed.folder is not None and not typed.panel:
        raise ProblemError("--folder needs the panel: give --panel")


def _warn_of_unknown(tare: Tare) -> None:
    """Warn if a fresh tare has the rest of few taxels: encoders ignore the others."""
    known = int(np.count_nonzero(~np.isnan(tare.rest)))
    if 2 * known < tare.array.taxels:
        say(
            f"taxel: the tare has only the {known} of {tare.array.taxels} taxels that changed while it was taken; "
            "events of the other taxels are ignored. Start taxel live before the board, so that the board sends all "
            "values, or give --tare FILE",
            err=True,
        )


def _echo(pipeline: Live, console: Console) -> Callable[[str], None] | None:
    """Return what prints a detection; None with --json, whose lines another thread writes."""
    if pipeline._options.lines:
        return None
    # If both go to one terminal, detections are printed above the display; else they go to standard output.
    above = console.is_terminal and sys.stdout.isatty()
    return (lambda line: console.print(Text(line))) if above else say


def _watch(
    pipeline: Live,
    panel: Panel | None,
    seconds: float | None,
    console: Console,
    at_rest: contextlib.ExitStack,
    end_request: threading.Event,
    *,
    fresh: bool,
    control: str | None,
) -> None:
    """Show rates and detections until the time is over, or the end is requested.

    When a `fresh` tare is complete, `at_rest` is closed, and the panel gets the serial line, if `control` names it.
    """
    echo = _echo(pipeline, console)
    for line in filter(None, (f"listening on {pipeline.place}; Ctrl-C ends", pipeline.read_as)):
        console.print(line)
    # Lines that another thread writes would break a display.
    shown = Console(stderr=True, quiet=True) if echo is None else console
    display = Display(console=shown, refresh_per_second=1 / REDRAW_S, transient=True, redirect_stdout=False)
    with display:
        before, silence = None, ""
        told: set[tuple[str, str]] = set()
        while not (end_request.is_set() or _has_ended(pipeline, panel)) and (
            before is None or seconds is None or before["seconds"] < seconds
        ):
            try:
                if panel is not None and panel.live is not None and panel.live is not pipeline:
                    # A client of the panel chose another address.
                    pipeline, before = panel.live, None
                if before is None:
                    before = pipeline.counters
                _drain(pipeline, echo, REDRAW_S)
                now = pipeline.counters
            except ProblemError:
                if panel is None or panel.live is pipeline:
                    raise
                # A client of the panel ended this receiver, to begin another.
                continue
            # Where the display is not shown, each silence is one line.
            is_shown = console.is_terminal and echo is not None
            if not is_shown and bool(now_silent := _silence(now, pipeline.place)) != bool(silence):
                silence = now_silent
                console.print(silence or ("datagrams arrive" if now["lines"] is None else "frames arrive"))
            if not now["taring"]:
                at_rest.close()
                if panel is not None and control is not None:
                    panel._connect(control)
                    control = None
                if fresh and pipeline.tare is not None:
                    fresh = False
                    _warn_of_unknown(pipeline.tare)
            say_wrong(now, pipeline.array, told, pipeline._options.readout)
            if now["seconds"] - before["seconds"] >= REDRAW_S:
                display.update(Text(f"{counters_line(before, now)}\n{_state(now, pipeline.place)}".rstrip()))
                before = now
        if not end_request.is_set() and _has_ended(pipeline, panel):
            console.print(f"{pipeline.place} has ended")


def _has_ended(pipeline: Live, panel: Panel | None) -> bool:
    """Return whether the source has ended, as the standard input does; not where the panel begins another."""
    return pipeline.is_over and (panel is None or panel.live is pipeline)


def _drain(pipeline: Live, echo: Callable[[str], None] | None, wait_s: float = 0.0) -> None:
    """Wait for a detection; print it and all that wait, each with its delay after `known`.

    Without `echo`, as with --json, the readout's thread has written them.
    """
    while (detection := pipeline.next(wait_s)) is not None:
        wait_s = 0.0
        if echo is not None:
            delay = to_ms(detection.latency or 0)
            # A line holds a frame that is over; a recording takes it as known at the time of the next one.
            when = f"{delay:.2f} ms after it was known" if delay >= 0 else f"{-delay:.2f} ms before the next frame"
            echo(f"{detection.t / 1e6:10.4f} s  {detection.label:<16} output {when}")


def _silence(now: dict[str, Any], place: str) -> str:
    """Return a line that says that nothing arrives, since when; "" while it does."""
    arrival = now.get("arrival")
    if arrival is None or arrival["state"] == "arriving":
        return ""
    if arrival["state"] == "nothing":
        if now["seconds"] < _FIRST_WITHIN_S:
            return ""
        check = f"is the board on, and does it send to this address and port?{FIREWALL}"
        if now["lines"] is not None:
            check = "is it connected, and does it print lines of numbers?"
        return f"nothing has arrived on {place} so far: {check}"
    since = f"nothing for {arrival['silent_s']:.1f} s"
    if arrival["state"] == "quiet":
        return f"quiet: {since}"
    within_ms = to_ms(arrival["heartbeat_us"])
    sign = "heartbeat" if now["lines"] is None else "frame"
    return f"silent: {since} from {place}, which sent a {sign} at least every {within_ms:g} ms before"


def _state(now: dict[str, Any], place: str) -> str:
    """Return the lines below the counts: silence, the tare, and losses of lines and events."""
    silence = _silence(now, place)
    if silence:
        return silence
    if now["taring"]:
        return "taking a tare: leave the sensor at rest"
    sent = "".join(
        f"\n{counted(counts['lost'], 'line')} not sent to {counts['to']}" for counts in now["sent"] if counts["lost"]
    )
    return (in_words({"dropped_before_readout": now["events_dropped"]}) + sent).lstrip()
