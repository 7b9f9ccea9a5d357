"""``taxel demo``: contact and lift-off, detected on an emulated board."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from taxel._base.files import check_writable
from taxel.cli._app import App
from taxel.cli._say import say
from taxel.cli.console import Console
from taxel.demo.script import TRAINING_SEED

app = App()


@app.command()
def demo(
    scenes: Annotated[int, typer.Option(min=1, help="Number of scenes.")] = 12,
    seed: Annotated[
        int | None, typer.Option(min=0, max=TRAINING_SEED - 1, help="Seed of the random numbers. Default: random.")
    ] = None,
    no_clock: Annotated[
        bool, typer.Option("--no-clock", help="Simulate as fast as possible instead of in real time, without a socket.")
    ] = False,
    noise: Annotated[
        float | None, typer.Option(help="Duration of the noise test, s. Default: 60, or 120 with --no-clock.")
    ] = None,
    readout: Annotated[
        Path | None, typer.Option(help="A readout to use instead of the one that comes with taxel.")
    ] = None,
    folder: Annotated[Path | None, typer.Option(help="A new folder for the report.")] = None,
    train_to: Annotated[
        Path | None, typer.Option("--train", help="Train the demo's readout, write it to this file, and end.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON, and nothing else.")] = False,
) -> None:
    """Play scenes on the emulated board, detect contact and lift-off while they run, and write a report.

    A ball falls on foam, is caught in flight, pressed by hand and lifted. The board is a separate process that sends
    real packets over UDP; this process records, encodes and detects contact and lift. A new folder gets report.html and
    report.json.

    Example: taxel demo --seed 1
    Example: taxel demo --scenes 100 --no-clock --folder demo
    """
    console = Console(quiet=as_json)
    if train_to is not None:
        check_writable(train_to)
        _train(console, train_to)
        say(json.dumps({"readout": str(train_to)}) if as_json else f"readout: {train_to.resolve()}")
        return
    from taxel.demo.showing import show  # noqa: PLC0415  pictures load slowly

    values, page = show(
        console,
        scenes=scenes,
        seed=seed,
        live=not no_clock,
        noise_s=noise,
        readout=readout,
        folder=folder,
    )
    # Not wrapped: a path is to be copied.
    say(json.dumps(values | {"report": str(page)}) if as_json else f"report: {page.resolve()}")


def _train(console: Console, file: Path) -> None:
    from taxel.demo.shipped import described, trained  # noqa: PLC0415

    with console.status("training") as status:
        readout = trained(progress=lambda step, *_: status.update(step))
    readout.save(file)
    console.print(described(readout))
