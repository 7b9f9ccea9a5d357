"""``taxel view``: a recording in the panel."""

from __future__ import annotations

import contextlib
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from taxel._core import ProblemError
from taxel.cli._paneling import OpenOption, PanelHostOption, PanelPortOption, announce
from taxel.cli._say import in_columns, say
from taxel.cli.app import App, Flat, JsonOption, SecondsOption
from taxel.cli.console import Console
from taxel.formats.foreign import is_bag
from taxel.formats.roles import OpenRolesError
from taxel.options import FullReading
from taxel.panel import Panel
from taxel.recording import Recording
from taxel.recording.kinds import is_folder, recordings_in
from taxel.recording.opening import topics_in

app = App(name="view")

#: The system may give Ctrl-C to a thread of the server, which does not wake the main thread: it looks this often, s.
_AWAKE_S = 0.2


@app.default
def view(
    recording: Path,
    /,
    *,
    calibration: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    labels: Annotated[str, Parameter(metavar="WORD")] = "notes",
    panel_host: PanelHostOption = "127.0.0.1",
    panel_port: PanelPortOption = 0,
    opens: OpenOption = True,
    seconds: SecondsOption = None,
    as_json: JsonOption = False,
    reading: Flat[FullReading] = FullReading(),
) -> None:
    """Show a recording in a browser: play, scrub, label, cut.

    Labels are saved beside the recording, in NAME.notes.csv; the recording itself is never changed.

    Example: taxel view walk.mcap
    Example: taxel view grasp.bag --topic /palm --array 24x32
    Example: taxel view press.csv --calibration press.calibration.json

    Parameters
    ----------
    recording
        A recording, a file of a sensor's maker, or a folder. If it is a folder, the options apply to each of its files.
        The page can open the other files of the folder.
    calibration
        Show frames in N or kPa by this calibration (taxel calibrate). Default: the calibration beside the recording.
    labels
        Show and change the labels of NAME.WORD.csv; steps: those that taxel steps wrote.
    """
    console = Console(stderr=True, quiet=as_json)
    opening = _opening(reading, calibration, recording)
    shown = Panel(recording, host=panel_host, port=panel_port, opens=opening, options=reading, labels=labels)
    # Ctrl-C is the end that is awaited from the moment on at which the address is known.
    with shown as panel, contextlib.suppress(KeyboardInterrupt):
        if as_json:
            say(json.dumps({"url": panel.url, "token": panel.token}))
        announce(panel, opens, console)
        console.print("Ctrl-C ends")
        until = math.inf if seconds is None else time.monotonic() + seconds
        while (left := until - time.monotonic()) > 0:
            time.sleep(min(left, _AWAKE_S))


def _opening(
    reading: FullReading, calibration: Path | None, recording: Path
) -> Callable[[Path], list[Recording]] | None:
    """Return how files are opened where options say it, else None; what they do not fit is refused now."""
    recordings = recordings_in(recording, reading.layout) if is_folder(recording) else [recording]
    if not recordings:
        return None
    first = recordings[0]
    if (listed := topics_in(first, reading.topic, reading.ros, reading.layout)) is not None:
        raise ProblemError(listed[0], *(f"  {row}" for row in in_columns(listed[1])))
    if not reading.words() and calibration is None and not is_bag(first):
        return None

    def opens(file: Path) -> list[Recording]:
        opened = reading.open_trials(file)
        if calibration is None:
            return opened
        return [sensor._calibrated_by(calibration) for sensor in opened]

    # The panel asks first for the recording that was opened here, so that errors are those of the command; the page
    # asks for roles that are open.
    opened: dict[Path, list[Recording]] = {}
    with contextlib.suppress(OpenRolesError):
        opened[first.absolute()] = opens(first)
    return lambda file: opened.pop(file.absolute(), None) or opens(file)
