"""``taxel emulate``: the demo's board alone."""

from __future__ import annotations

import json
import secrets
from collections import deque
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Self

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from taxel.cli._app import app
from taxel.demo.script import TRAINING_SEED, script
from taxel.simulate import Contact, EmulatorReport, truth
from taxel.simulate import emulate as run

__all__ = ["emulate"]


@app.command()
def emulate(
    port: Annotated[int, typer.Option(min=1, max=65_535, help="Where the datagrams go.")] = 5208,
    host: Annotated[str, typer.Option(help="To which machine, by name or address.")] = "127.0.0.1",
    scenes: Annotated[int, typer.Option(min=0, help="How many scenes.")] = 10,
    seed: Annotated[int | None, typer.Option(min=0, max=TRAINING_SEED - 1, help="Draws scenes, taxels, noise.")] = None,
    tare: Annotated[
        float, typer.Option(min=0, max=60, help="How long the noise floor is 0 before the start marker, s.")
    ] = 0.05,
    preset: Annotated[str, typer.Option(help='The registers: "5.2 kHz", "2 kHz", "20.8 kHz".')] = "5.2 kHz",
    wire: Annotated[int, typer.Option(min=1, max=2, help="The version of the wire that the board speaks.")] = 1,
    control: Annotated[
        int | None, typer.Option(help="Take commands on this TCP port of loopback; 0 finds one.")
    ] = None,
    rest: Annotated[bool, typer.Option("--rest", help="Nobody catches the ball.")] = False,
    labels: Annotated[
        Path | None,
        typer.Option("--truth", help="Write what really happens when to this CSV, label,t_us,host_ns, as it happens."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the CSV where it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON, and nothing else.")] = False,
) -> None:
    """Play scenes on an emulated board of 64 x 64 taxels that sends its events by UDP, in real time.

    A ball is dropped on foam, caught in flight, pressed by hand and lifted. The board arms after its first frame, is
    tared with a noise floor of 0, then takes the preset's floor and marks the start. --truth is what taxel train learns
    from: contact and lift, by the board's clock (t_us) and by this machine's (host_ns).

    Example: taxel emulate --port 5208 --scenes 5 --seed 1 --truth labels.csv
    """
    seed = secrets.randbelow(TRAINING_SEED) if seed is None else seed
    tare_ms = 1e3 * tare
    acts = script(seed, scenes, tare_ms=tare_ms, left_to_rest=rest)
    # Drawn anew from the seed: what is played can be told before it is.
    contacts, force = truth(acts, preset=preset)
    console = Console(stderr=True, quiet=as_json)
    console.print(f"seed {seed}: {len(contacts)} touches in {scenes} scene(s), to {host}:{port} at {preset}")
    bar = Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[said]}"), TimeRemainingColumn(),
        console=console, transient=True, disable=as_json,
    )  # fmt: skip
    with bar, _Diary(labels, contacts, overwrite) as diary:
        task = bar.add_task("playing", total=len(force), said="")

        def begun(address: str | None) -> None:
            if address is not None:
                console.print(f"commands are taken at {address}")

        def watch(report: EmulatorReport) -> None:
            diary.write(report)
            late = report.late_us["p99"]
            bar.update(task, completed=report.frames, said=f"{report.changes} events, frames late p99 {late:.0f} us")

        listens = None if control is None else f"127.0.0.1:{control}"
        report = run(
            f"[{host}]:{port}" if ":" in host else f"{host}:{port}",
            acts,
            seed=seed,
            preset=preset,
            tare_ms=tare_ms,
            wire=2 if wire == 2 else 1,
            control=listens,
            begun=begun,
            watch=watch,
        )
        diary.write(report)
    if labels is not None:
        console.print(f"truth: {labels}", soft_wrap=True)
    if as_json:
        said = {"seed": seed, "scenes": scenes, "preset": preset, "held": report.held, "verdict": report.verdict}
        said |= {"wanted_hz": report.wanted_hz, "reached_hz": report.reached_hz}
        typer.echo(json.dumps({**said, **asdict(report)}))
    else:
        typer.echo(f"{report.changes} events in {report.datagrams} datagrams, {report.bytes} bytes")
        typer.echo(report.verdict)


class _Diary:
    """Write what happens to a CSV, a line when it has happened."""

    def __init__(self, path: Path | None, contacts: Sequence[Contact], overwrite: bool) -> None:
        happenings = [(c.start_us, "contact") for c in contacts] + [(c.stop_us, "lift") for c in contacts]
        self._left = deque(sorted(happenings))
        # Written as it goes, so not whole or not at all: what was written before Ctrl-C is what happened before it.
        self._file = None if path is None else path.open("w" if overwrite else "x", encoding="utf-8")
        self._put("label,t_us,host_ns")

    def write(self, report: EmulatorReport) -> None:
        """Write what has happened by the board's time."""
        while self._left and self._left[0][0] <= 1e6 * report.board_seconds:
            t, label = self._left.popleft()
            self._put(f"{label},{round(t)},{report.began_ns + round(1e3 * t)}")

    def _put(self, line: str) -> None:
        if self._file is not None:
            self._file.write(f"{line}\n")
            self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()
