"""``taxel demo``: the main job, shown."""

from __future__ import annotations

import json
import secrets
import time
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.columns import Columns
from rich.console import Console, Group
from rich.live import Live as Drawing
from rich.panel import Panel
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.progress_bar import ProgressBar
from rich.style import Style
from rich.table import Table
from rich.text import Text

from taxel._core import ProblemError
from taxel._files import write_whole
from taxel.cli import app
from taxel.demo.footfalls import NOTE, footfalls
from taxel.demo.hearing import Hearing, hear
from taxel.demo.judging import LABELS
from taxel.demo.playing import play_live
from taxel.demo.report import Material, figures, write
from taxel.demo.script import TRAINING_SEED, script
from taxel.demo.training import describe, shipped, train
from taxel.detect import Readout
from taxel.live import Said
from taxel.simulate import Contact, Silence

__all__ = ["demo"]

#: Of the dashpot, whose 1 ms is a guess: what the delays are shown with as well, ms.
_DASHPOTS = (0.3, 0.0)


@app.command()
def demo(
    scenes: Annotated[int, typer.Option(min=1, help="How many scenes.")] = 12,
    seed: Annotated[int | None, typer.Option(min=0, max=TRAINING_SEED - 1, help="Drawn where it is left out.")] = None,
    no_clock: Annotated[bool, typer.Option("--no-clock", help="Board time as fast as it goes; no socket.")] = False,
    noise: Annotated[float | None, typer.Option(help="Seconds of noise: 60, or 120 without the clock.")] = None,
    data: Annotated[Path | None, typer.Option(help="Recordings: footfalls of DATA/plate are played as well.")] = None,
    readout: Annotated[Path | None, typer.Option(help="Another readout than the one that comes with taxel.")] = None,
    folder: Annotated[Path | None, typer.Option(help="A new folder for the report.")] = None,
    result: Annotated[Path | None, typer.Option("--result", "-o", help="Write the figures there as well.")] = None,
    train_to: Annotated[Path | None, typer.Option("--train", help="Train the readout, write it there, and end.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON, and nothing else.")] = False,
) -> None:
    """Play scenes on the emulated board, find contact and lift-off while they run, and leave a report.

    A ball falls on foam, is caught in flight, pressed by hand and lifted. The board is a process of its own that sends
    real packets over UDP; this one records, encodes and says contact and lift. A new folder gets report.html and
    report.json.

    Examples: taxel demo --seed 1; taxel demo --scenes 100 --no-clock -o benchmarks/results/demo.json
    """
    console = Console(stderr=as_json, quiet=as_json)
    if train_to is not None:
        _train(console, train_to)
        return
    if noise is not None and not 0.5 <= noise <= 86_400:
        raise ProblemError(f"noise is {noise} s: must be 0.5 to 86400")
    if result is not None and not result.parent.is_dir():
        raise ProblemError(f"{result}: there is no folder {result.parent}")
    heard_by = shipped() if readout is None else Readout.load(readout)
    laid = None if data is None else footfalls(data)
    seed = secrets.randbelow(TRAINING_SEED) if seed is None else seed
    if folder is None:
        folder = Path(f"taxel-demo-{datetime.now().astimezone():%Y%m%d-%H%M%S}-{seed}")
    folder.mkdir(parents=True)
    began = time.monotonic()
    console.print(f"[bold]taxel demo[/bold]: {scenes} scenes of seed [bold]{seed}[/bold]")
    counters: dict[str, Any] = {}
    if no_clock:
        hearing = _hear(console, f"playing {scenes} scenes without the clock", script(seed, scenes), heard_by, seed)
    else:
        with Drawing(console=console, refresh_per_second=10, transient=True) as drawing:
            playing = play_live(
                heard_by, folder, seed=seed, scenes=scenes, screen=lambda *told: _Screen(drawing, *told)
            )
        hearing = playing.hearing
        counters = {
            "counters": playing.counters,
            "emulator": playing.emulator,
            "verdicts": playing.verdicts,
            "recording": playing.recording.name,
            "agrees": playing.agrees,
        }
        for verdict in playing.verdicts:
            console.print(f"[dim]{verdict}[/dim]")
    seconds = (120.0 if no_clock else 60.0) if noise is None else noise
    quiet = _hear(console, f"hearing {seconds:g} s of noise without the clock", _noise(seconds), heard_by, seed)
    # In real time there is a minute for all of it: a few scenes show what the dashpot does.
    few = scenes if no_clock else min(scenes, 4)
    dashpots = {
        ms: _hear(console, f"hearing a dashpot of {ms:g} ms", script(seed, few, dashpot_ms=ms), heard_by, seed)
        for ms in _DASHPOTS
    }
    stepped = None if laid is None else _hear(console, "laying footfalls over the array", laid, heard_by, seed)
    with _busy(console, "writing the report"):
        material = Material(
            seed=seed,
            scenes=scenes,
            live=not no_clock,
            hearing=hearing,
            noise=quiet,
            dashpots=dashpots,
            footfalls=stepped,
            footfall_note=NOTE if stepped is not None else "",
            **counters,
        )
        page = write(folder, material)
    values = figures(material)
    if result is not None:
        write_whole(result, lambda file: file.write(json.dumps(values, indent=1).encode() + b"\n"), overwrite=True)
    if as_json:
        typer.echo(json.dumps(values | {"report": str(page)}))
        return
    _say(console, hearing, quiet)
    console.print(f"[dim]{time.monotonic() - began:.0f} s in all[/dim]")
    if result is not None:
        console.print(f"figures: {result}")
    # Not wrapped: a path is to be copied.
    typer.echo(f"report: {page.resolve()}")


def _train(console: Console, place: Path) -> None:
    with _busy(console, "training") as bar:
        readout = train(progress=lambda said: bar.update(bar.task_ids[0], description=said))
    readout.save(place)
    console.print(describe(readout))
    typer.echo(f"readout: {place.resolve()}")


def _noise(seconds: float) -> list[Silence]:
    return [Silence(50.3 + 1000.0 * seconds)]


def _busy(console: Console, said: str) -> Progress:
    bar = Progress(
        SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn(), console=console, transient=True
    )
    bar.add_task(said, total=None)
    return bar


def _hear(console: Console, said: str, acts: list[Any], readout: Readout, seed: int) -> Hearing:
    with _busy(console, said):
        return hear(acts, readout, seed=seed)


def _say(console: Console, hearing: Hearing, quiet: Hearing) -> None:
    table = Table(box=None, pad_edge=False)
    for name in ("touch", "said", "found", "said - true (ms)", "known, median / 95 % (ms)"):
        table.add_column(name, justify="left" if name in ("touch", "said") else "right")
    for row in hearing.judged.rows:
        if not row.touches:
            continue
        error = f"{row.errors_ms.mean():+.2f}" if row.found else "-"
        known = "{:.2f} / {:.2f}".format(*np.percentile(row.delays_ms, [50, 95])) if row.found else "-"
        table.add_row(row.name, row.label, f"{row.found} of {row.touches}", error, known)
    console.print(table)
    false = sum(len(times) for times in hearing.judged.false.values())
    noise_s = (quiet.stop_us - quiet.start_us) * 1e-6
    console.print(f"said of nothing: {false} in the scenes, {len(quiet.found)} in {noise_s:.0f} s of noise")


class _Screen:
    """What is drawn while it runs: the picture, the counters, what was said."""

    _LINES = 9

    def __init__(self, drawing: Drawing, contacts: list[Contact], seconds: float) -> None:
        self._drawing = drawing
        self._seconds = seconds
        self._true = {
            "contact": np.array([c.start_us for c in contacts]),
            "lift": np.array([c.stop_us for c in contacts]),
        }
        self._kinds = [c.kind for c in contacts]
        self._before: tuple[float, int] = (0.0, 0)
        self._rate = 0.0

    def draw(self, counters: dict[str, Any], picture: np.ndarray, said: list[Said]) -> None:
        """Draw what came up to now."""
        now = (counters["board_us"] or 0) * 1e-6
        then, events = self._before
        if now > then:
            self._rate = (counters["events"] - events) / (now - then)
            self._before = (now, counters["events"])
        capture = counters["capture"]
        lost = capture["dropped_by_kernel"] + capture["dropped_by_queue"] + counters["events_dropped"]
        rows = Table.grid(padding=(0, 2))
        for name, value in (
            ("events/s", f"{self._rate:,.0f}"),
            ("on the wire", f"{self._rate * 80 / 1e3:,.0f} kbit/s (frames: 213,000)"),
            ("events", f"{counters['events']:,}"),
            ("datagrams", f"{capture['datagrams']:,}, lost {lost}"),
            ("arrived to decoded", f"{counters['decode_latency']['p50_us']:.0f} us, 99 %: {counters['decode_latency']['p99_us']:.0f}"),
            ("known to said", f"{counters['said_latency']['p50_us'] / 1e3:.2f} ms, 99 %: {counters['said_latency']['p99_us'] / 1e3:.2f}"),
            *((label, str(sum(one.label == label for one in said))) for label in LABELS),
        ):  # fmt: skip
            rows.add_row(Text(name, style="dim"), value)
        state = "taring" if counters["taring"] else f"{min(now, self._seconds):5.1f} of {self._seconds:.1f} s"
        self._drawing.update(
            Group(
                Columns([Panel(_blocks(picture), title="pressure", width=68), Panel(rows, title=state, width=56)]),
                ProgressBar(total=self._seconds, completed=min(now, self._seconds), width=120),
                *[self._line(one) for one in said[-self._LINES :]],
            )
        )

    def _line(self, said: Said) -> Text:
        true = self._true[said.label]
        colour = "red" if said.label == "contact" else "blue"
        line = Text(f"{said.t * 1e-6:8.3f} s  ").append(f"{said.label:<8}", style=f"bold {colour}")
        if len(true):
            nearest = int(np.abs(true - said.t).argmin())
            line.append(f"{self._kinds[nearest]:<7} known {(said.known - true[nearest]) / 1e3:+6.2f} ms, ")
            line.append(f"said {(said.said - true[nearest]) / 1e3:+6.2f} ms after the true moment", style="dim")
        return line


def _blocks(picture: np.ndarray) -> Text:
    """Return a picture of ticks as half blocks: two rows a line, each cell the larger of two columns."""
    rest = np.median(picture)
    above = np.clip(picture.astype(float) - rest - 6.0, 0.0, 80.0) / 80.0
    small = above.reshape(32, 2, 64).max(axis=1)
    text = Text()
    for upper, lower in zip(small[::2], small[1::2], strict=True):
        for a, b in zip(upper, lower, strict=True):
            text.append("▀", Style(color=_colour(a), bgcolor=_colour(b)))
        text.append("\n")
    return text


def _colour(share: float) -> str:
    """Return black to red to yellow to white."""
    red, green, blue = (int(255 * min(1.0, max(0.0, 3.0 * share - k))) for k in range(3))
    return f"#{max(red, 18):02x}{max(green, 16):02x}{max(blue, 24):02x}"
