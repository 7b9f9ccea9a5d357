"""The demo from beginning to end."""

from __future__ import annotations

import secrets
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console  # noqa: TID251  the type; the command line makes one
from rich.live import Live as Drawing
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from taxel._base.errors import refused
from taxel._base.messages import counted
from taxel.demo.evaluation import Evaluation, evaluate_acts
from taxel.demo.footfalls import NOTE, footfalls
from taxel.demo.playing import play_live
from taxel.demo.report import Material, figures, write
from taxel.demo.screen import Screen
from taxel.demo.script import TRAINING_SEED, script
from taxel.demo.shipped import shipped
from taxel.detect import Readout
from taxel.simulate import Act, Silence

__all__ = ["show"]

#: Other time constants of the dashpot for which delays are shown as well, ms, as its 1 ms is a guess.
_DASHPOTS = (0.3, 0.0)


def show(
    console: Console,
    *,
    scenes: int,
    seed: int | None = None,
    live: bool = True,
    noise_s: float | None = None,
    data: Path | None = None,
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
    data : Path, optional
        Recordings, whose ``plate/`` gives footfalls.
    readout : Path, optional
        Another readout than the shipped one.
    folder : Path, optional
        A new folder for the report; named by time and seed where it is left out.

    Raises
    ------
    FileExistsError : the folder is there already
    DeviceError : the board's process failed
    """
    if noise_s is not None and not 0.5 <= noise_s <= 86_400:
        raise refused("noise", f" is {noise_s} s: must be 0.5 to 86400")
    used = shipped() if readout is None else Readout.load(readout)
    laid = None if data is None else footfalls(data)
    seed = secrets.randbelow(TRAINING_SEED) if seed is None else seed
    if folder is None:
        folder = Path(f"taxel-demo-{datetime.now().astimezone():%Y%m%d-%H%M%S}-{seed}")
    folder.mkdir(parents=True)
    began = time.monotonic()
    console.print(Text.assemble(("taxel demo", "bold"), f": {counted(scenes, 'scene')} of seed ", (str(seed), "bold")))
    counters: dict[str, Any] = {}
    if not live:
        evaluation = _evaluate(
            console, f"playing {counted(scenes, 'scene')} without the clock", script(seed, scenes), used, seed
        )
    else:
        with Drawing(console=console, refresh_per_second=10, transient=True) as drawing:
            playing = play_live(
                used, folder, seed=seed, scenes=scenes, screen=lambda *arguments: Screen(drawing, *arguments)
            )
        evaluation = playing.evaluation
        counters = {
            "counters": playing.counters,
            "emulator": playing.emulator,
            "verdicts": playing.verdicts,
            "recording": playing.recording.name,
            "agrees": playing.agrees,
        }
        for verdict in playing.verdicts:
            console.print(verdict, style="dim", soft_wrap=not console.is_terminal)
    seconds = (60.0 if live else 120.0) if noise_s is None else noise_s
    quiet = _evaluate(console, f"detecting in {seconds:g} s of noise without the clock", _noise(seconds), used, seed)
    # In real time there is a minute for all of it: a few scenes show what the dashpot does.
    few = min(scenes, 4) if live else scenes
    dashpots = {
        ms: _evaluate(console, f"playing with a dashpot of {ms:g} ms", script(seed, few, dashpot_ms=ms), used, seed)
        for ms in _DASHPOTS
    }
    stepped = None if laid is None else _evaluate(console, "laying footfalls over the array", laid, used, seed)
    with _busy(console, "writing the report"):
        material = Material(
            seed=seed,
            scenes=scenes,
            live=live,
            evaluation=evaluation,
            noise=quiet,
            dashpots=dashpots,
            footfalls=stepped,
            footfall_note=NOTE if stepped is not None else "",
            **counters,
        )
        page = write(folder, material)
    values = figures(material)
    _print_table(console, evaluation, quiet)
    console.print(f"{time.monotonic() - began:.0f} s in all", style="dim")
    return values, page


def _noise(seconds: float) -> list[Act]:
    return [Silence(50.3 + 1000.0 * seconds)]


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


def _print_table(console: Console, evaluation: Evaluation, quiet: Evaluation) -> None:
    table = Table(box=None, pad_edge=False)
    for name in ("touch", "label", "found", "error, ms", "known, ms"):
        table.add_column(name, justify="left" if name in ("touch", "label") else "right", no_wrap=True)
    for row in evaluation.judged.rows:
        if not row.touches:
            continue
        error = f"{row.errors_ms.mean():+.2f}" if row.found else "-"
        known = "{:.2f} / {:.2f}".format(*np.percentile(row.delays_ms, [50, 95])) if row.found else "-"
        table.add_row(row.name, row.label, f"{row.found} of {row.touches}", error, known)
    console.print(table)
    console.print("error: time minus true, mean; known: minus true, median / 95 %", style="dim")
    false = sum(len(times) for times in evaluation.judged.false.values())
    noise_s = (quiet.stop_us - quiet.start_us) * 1e-6
    within = sum(evaluation.judged.false_within.values())
    off = f" ({within} within a press, more than 50 ms off)" if within else ""
    console.print(f"false detections: {false} in the scenes{off}, {len(quiet.detections)} in {noise_s:.0f} s of noise")
