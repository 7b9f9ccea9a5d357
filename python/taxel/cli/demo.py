"""``taxel demo``: contact and lift-off, detected on an emulated board."""

from __future__ import annotations

import json
import secrets
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from taxel._base.messages import counted
from taxel.cli._say import say
from taxel.cli.app import App, JsonOption, Limits
from taxel.cli.task import progress
from taxel.demo.script import TRAINING_SEED
from taxel.spikes import to_ms

if TYPE_CHECKING:
    from taxel.detections import Detection

app = App(name="demo")


@app.default
def demo(
    *,
    scenes: Annotated[int, Parameter(validator=Limits(1))] = 12,
    seed: Annotated[int | None, Parameter(validator=Limits(0, TRAINING_SEED - 1))] = None,
    no_clock: bool = False,
    readout: Path | None = None,
    folder: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    as_json: JsonOption = False,
) -> None:
    """Play scenes on the emulated board, detect contact and lift-off while they run, and write a report.

    A ball falls on foam, is caught in flight, pressed by hand and lifted. The board is a separate process that sends
    real packets over UDP; this process records, encodes and detects contact and lift. A new folder gets report.html
    and the recording.

    Example: taxel demo --seed 1
    Example: taxel demo --scenes 100 --no-clock --folder demo

    Parameters
    ----------
    scenes
        Number of scenes.
    seed
        Seed of the random numbers. Default: random.
    no_clock
        Simulate as fast as possible instead of in real time, without a socket.
    readout
        A readout to use instead of the one that comes with taxel.
    folder
        A new folder for the report.
    """
    from taxel.demo.playing import play_live, play_simulated, shipped  # noqa: PLC0415  the command line starts quickly
    from taxel.detect import Readout  # noqa: PLC0415
    from taxel.report import write_detections  # noqa: PLC0415  pictures load slowly

    used = shipped() if readout is None else Readout.load(readout)
    seed = secrets.randbelow(TRAINING_SEED) if seed is None else seed
    if folder is None:
        folder = Path(f"taxel-demo-{datetime.now().astimezone():%Y%m%d-%H%M%S}-{seed}")
    folder.mkdir(parents=True)
    title = f"taxel demo: {counted(scenes, 'scene')} of seed {seed}"
    say(*[] if as_json else [title])
    with progress(as_json) as update:
        recording = folder / "recording.mcap"
        if no_clock:
            played = play_simulated(used, recording, seed=seed, scenes=scenes, progress=update)
        else:
            update(f"playing {counted(scenes, 'scene')} in real time", 0, 0)
            played = play_live(
                used, recording, seed=seed, scenes=scenes, said=lambda found: say(*[] if as_json else [_line(found)])
            )
        update("writing the report", 0, 0)
        page = write_detections(
            folder,
            used,
            [played.outcome],
            title=title,
            judged="by the simulated truth, on scenes that the readout was not trained on",
            touch=played.first_us,
            printed=[*played.lines()],
        )
    if as_json:
        paths = {"recording": str(recording), "report": str(page)}
        say(json.dumps({"seed": seed, "scenes": scenes, **played.to_dict(), **paths}))
    else:
        say(*played.lines(), f"recording: {recording.resolve()}", f"report: {page.resolve()}")


def _line(found: Detection) -> str:
    return f"{to_ms(found.t):10.3f} ms  {found.label}"
