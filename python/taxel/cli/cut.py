"""``taxel cut``: a part of a recording."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from cyclopts import Parameter

import taxel
from taxel._base.messages import plain
from taxel._base.times import beginning_us
from taxel._core import ProblemError
from taxel.cli.app import App, Flat, Limits
from taxel.cli.task import OutArgument, Output, SourceOption, of_source
from taxel.options import Reading

if TYPE_CHECKING:
    from taxel.recording import Recording

app = App(name="cut")


@app.default
def cut(
    recording: Path,
    /,
    out: OutArgument,
    *,
    start: Annotated[float | None, Parameter(name="--from", metavar="S")] = None,
    stop: Annotated[float | None, Parameter(name="--to", metavar="S")] = None,
    columns: Annotated[str | None, Parameter(metavar="A:B")] = None,
    rows: Annotated[str | None, Parameter(metavar="A:B")] = None,
    label: str | None = None,
    before: Annotated[float, Parameter(metavar="S", validator=Limits(0.0))] = 0.5,
    after: Annotated[float, Parameter(metavar="S", validator=Limits(0.0))] = 0.5,
    source: SourceOption = None,
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> None:
    """Cut a recording by time, by region or by label.

    Times are those of taxel info: the board's time, or, if times count from 1970, the time since the recording's
    beginning.

    Example: taxel cut walk.mcap heel.mcap --from 1.5 --to 3 --rows 0:20

    Parameters
    ----------
    recording
        A recording: .mcap, .lsa, .npz, .csv or .h5, a ROS bag or a file of a sensor's maker.
    out
        The new file; its extension gives the format. With --label a number is appended to the name.
    start
        Start of the part, s, on the time scale of taxel info.
    stop
        End of the part, s, on the time scale of taxel info.
    columns
        Columns A to B - 1, for example 0:32.
    rows
        Rows A to B - 1, for example 10:20.
    label
        Cut a part around each note with this text.
    before
        With --label: start this long before the note, s.
    after
        With --label: end this long after the note, s.
    """
    if start is not None and stop is not None and start > stop:
        raise ProblemError(f"--from {plain(start)} --to {plain(stop)}: the part must not end before it begins")
    source_recording = of_source(reading.open_one(recording), source)
    start_us, stop_us = _stretch_us(source_recording, start, stop)
    parts = taxel.cut(
        source_recording,
        start_us=start_us,
        stop_us=stop_us,
        columns=_range("--columns", columns),
        rows=_range("--rows", rows),
        label=label,
        before_us=before * 1e6,
        after_us=after * 1e6,
    )
    if not parts:
        raise ProblemError(f"{recording}: has no note {label!r} with a time; taxel info --json lists the notes")
    written, lines = [], []
    for k, part in enumerate(parts, start=1):
        file = out if label is None else out.with_stem(f"{out.stem}{k}")
        lost = taxel.convert(part, file, overwrite=output.overwrite)
        written.append({"file": str(file), "lost": lost})
        lines += [f"written to {file}: {part!r}", *(f"  lost: {loss}" for loss in lost)]
    output.say({"recording": str(recording), "written": written}, *lines)


def _stretch_us(recording: Recording, start: float | None, stop: float | None) -> tuple[float, float]:
    """Return from when to when a part lasts, us, by the times of the recording.

    Refused is a part that cuts nothing off, or holds nothing; a silence of a board within its recording is allowed.
    """
    if start is None and stop is None:
        return -np.inf, np.inf
    from taxel.recording.cut import span_us  # noqa: PLC0415  the command line starts quickly

    first, last = span_us(recording)
    begin_us = beginning_us(np.array([first]))
    start_us = -np.inf if start is None else begin_us + start * 1e6
    stop_us = np.inf if stop is None else begin_us + stop * 1e6
    first_s, last_s = ((t - begin_us) / 1e6 for t in (first, last))
    lasting = f"{recording.path}, which lasts from {plain(first_s)} to {plain(last_s)} s"
    if start is not None and start_us > last:
        raise ProblemError(f"--from {plain(start)}: must not be after the end of {lasting}")
    if stop is not None and stop_us <= first:
        raise ProblemError(f"--to {plain(stop)}: must be after the beginning of {lasting}")
    options = {"--from": start, "--to": stop}
    given = " ".join(f"{option} {plain(s)}" for option, s in options.items() if s is not None)
    if start_us <= first and stop_us > last:
        raise ProblemError(f"{given}: cuts nothing off {lasting}")
    if start_us == stop_us or not (recording.has_events or len(recording.frames().between(start_us, stop_us))):
        raise ProblemError(f"{given}: contains nothing of {lasting}")
    return start_us, stop_us


def _range(option: str, text: str | None) -> slice | None:
    if text is None:
        return None
    match = re.fullmatch(r"([0-9]{0,5}):([0-9]{0,5})", text)
    if match is None:
        raise ProblemError(f"{option} is {text!r}: must be A:B, for example 0:32, where B is not included")
    return slice(*(int(n) if n else None for n in match.groups()))
