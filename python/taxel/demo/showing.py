"""The demo from beginning to end."""

from __future__ import annotations

import secrets
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console  # noqa: TID251  the type; the command line makes one
from rich.live import Live as Drawing
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel.demo.evaluation import Evaluation, evaluate_acts
from taxel.demo.judging import TouchMatches
from taxel.demo.playing import play_live
from taxel.demo.report import figures, lines, write
from taxel.demo.screen import Screen
from taxel.demo.script import TRAINING_SEED, script
from taxel.demo.shipped import shipped
from taxel.detect import Readout
from taxel.simulate import Act, Silence

__all__ = ["show"]


def show(
    console: Console,
    *,
    scenes: int,
    seed: int | None = None,
    live: bool = True,
    noise_s: float | None = None,
    readout: Path | None = None,
    folder: Path | None = None,
) -> tuple[dict[str, Any], Path]:
    """Play, detect, judge, write the report; return its figures and its page.

    Parameters
    ----------
    console : Console
        Where progress and results are printed.
    scenes : int, 1 or more
    seed : int, optional
        Drawn where it is left out.
    live : bool
        In real time over UDP; else board time goes as fast as it can.
    noise_s : float, optional
        60, or 120 where it is not live.
    readout : Path, optional
        Another readout than the shipped one.
    folder : Path, optional
        A new folder for the report; named by time and seed where it is left out.

    Raises
    ------
    FileExistsError : the folder is there already
    DeviceError : the board's process failed
    """
    if noise_s is None:
        noise_s = 60.0 if live else 120.0
    if not 0.5 <= noise_s <= 86_400:
        raise refused("noise", f" is {noise_s} s: must be from 0.5 to 86400")
    used = shipped() if readout is None else Readout.load(readout)
    seed = secrets.randbelow(TRAINING_SEED) if seed is None else seed
    if folder is None:
        folder = Path(f"taxel-demo-{datetime.now().astimezone():%Y%m%d-%H%M%S}-{seed}")
    folder.mkdir(parents=True)
    began, several = time.monotonic(), counted(scenes, "scene")
    console.print(Text.assemble(("taxel demo", "bold"), f": {several} of seed ", (str(seed), "bold")))
    playing = None
    if live:
        with Drawing(console=console, refresh_per_second=10, transient=True) as drawing:
            playing = play_live(
                used, folder, seed=seed, scenes=scenes, screen=lambda *arguments: Screen(drawing, *arguments)
            )
        evaluation = playing.evaluation
        for verdict in playing.verdicts:
            console.print(verdict, style="dim", soft_wrap=not console.is_terminal)
    else:
        evaluation = _evaluate(console, f"playing {several} without the clock", script(seed, scenes), used, seed)
    noise = [Silence(50.3 + 1000.0 * noise_s)]
    quiet = _evaluate(console, f"detecting in {noise_s:g} s of noise without the clock", noise, used, seed)
    with _busy(console, "writing the report"):
        values = figures(evaluation, quiet, playing, seed=seed, scenes=scenes)
        page = write(folder, values, evaluation)
    _print_table(console, evaluation.judged)
    within = sum(evaluation.judged.false_within.values())
    off = f" ({within} of them during a press, but more than 50 ms off)" if within else ""
    console.print(
        f"false detections: {sum(evaluation.judged.false_counts.values())} in the scenes{off}, "
        f"{len(quiet.detections)} in {quiet.seconds:.0f} s of noise"
    )
    console.print(f"{time.monotonic() - began:.0f} s in all", style="dim")
    return values, page


def _busy(console: Console, task: str) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
    bar.add_task(task, total=None)
    return bar


def _evaluate(console: Console, task: str, acts: Sequence[Act], readout: Readout, seed: int) -> Evaluation:
    with _busy(console, task) as bar:
        return evaluate_acts(
            acts, readout, seed=seed, watch=lambda share: bar.update(bar.task_ids[0], completed=share, total=1.0)
        )


def _print_table(console: Console, judged: TouchMatches) -> None:
    table = Table(box=None, pad_edge=False)
    for name in ("touch", "label", "found", "error, ms", "known, ms"):
        table.add_column(name, justify="left" if name in ("touch", "label") else "right", no_wrap=True)
    for line in lines(judged):
        table.add_row(line["touch"], line["label"], line["found"], line["error"], f"{line['p50']} / {line['p95']}")
    console.print(table)
    console.print("error: mean of time minus true time; known: median / 95 % of known minus true time", style="dim")
