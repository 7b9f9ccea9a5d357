"""``taxel cut``: a part of a recording."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import taxel
from taxel import _core
from taxel._base.messages import plain
from taxel._core import ProblemError
from taxel.cli._app import App, JsonOption, OverwriteOption, with_out
from taxel.cli._opening import FileOptions
from taxel.cli._recordings import READ_HELP, of_source
from taxel.cli._say import say

if TYPE_CHECKING:
    from taxel.recording import Recording

app = App()


@app.command()
@with_out("out")
def cut(
    recording: Annotated[Path, typer.Argument(help=f"A recording: {READ_HELP}.")],
    out: Annotated[
        Path,
        typer.Argument(
            help="The new file; its extension gives the format. With --label a number is appended to the name."
        ),
    ],
    files: FileOptions,
    start: Annotated[
        float | None, typer.Option("--from", metavar="S", help="Start of the part, board time, s.")
    ] = None,
    stop: Annotated[float | None, typer.Option("--to", metavar="S", help="End of the part, board time, s.")] = None,
    columns: Annotated[str | None, typer.Option(metavar="A:B", help="Columns A to B - 1, as 0:32.")] = None,
    rows: Annotated[str | None, typer.Option(metavar="A:B", help="Rows A to B - 1, as 10:20.")] = None,
    label: Annotated[str | None, typer.Option(help="Cut a part around each note with this text.")] = None,
    before: Annotated[
        float, typer.Option(min=0.0, metavar="S", help="With --label: start this long before the note, s.")
    ] = 0.5,
    after: Annotated[
        float, typer.Option(min=0.0, metavar="S", help="With --label: end this long after the note, s.")
    ] = 0.5,
    source: Annotated[
        str | None, typer.Option("--source", metavar="NAME", help="The source to cut, of a recording with several.")
    ] = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Cut a recording by time, by region or by label.

    Example: taxel cut walk.mcap heel.mcap --from 1.5 --to 3 --rows 0:20
    """
    if start is not None and stop is not None and start > stop:
        raise ProblemError(f"--from {plain(start)} --to {plain(stop)}: the part must not end before it begins")
    source_recording = of_source(files.opener.open_one(recording), source)
    parts = taxel.cut(
        source_recording,
        start_us=float("-inf") if start is None else start * 1e6,
        stop_us=float("inf") if stop is None else stop * 1e6,
        columns=_range("--columns", columns),
        rows=_range("--rows", rows),
        label=label,
        before_us=before * 1e6,
        after_us=after * 1e6,
    )
    _check_time(source_recording, start, stop)
    if not parts:
        raise ProblemError(f"{recording}: no note {label!r} with a time in it; taxel info --json lists the notes")
    written = []
    for k, part in enumerate(parts, start=1):
        file = out if label is None else Path(_core.numbered_path(out, k))
        lost = taxel.convert(part, file, overwrite=overwrite)
        written.append({"file": str(file), "lost": lost})
        if not as_json:
            say(f"written to {file}: {part!r}", *(f"  lost: {loss}" for loss in lost))
    if as_json:
        say(json.dumps({"recording": str(recording), "written": written}))


def _check_time(recording: Recording, start: float | None, stop: float | None) -> None:
    """Refuse a time before or after the whole recording, as its file would be empty; a silence within it is allowed."""
    if start is None and stop is None:
        return
    from taxel.recording.cut import span_us  # noqa: PLC0415  the command line starts quickly

    first, last = (t / 1e6 for t in span_us(recording))
    lasts = f"{recording.path} lasts from {plain(first)} to {plain(last)} s"
    if start is not None and start > last:
        raise ProblemError(f"--from {plain(start)}: {lasts}; must be at most its end")
    if stop is not None and stop <= first:
        raise ProblemError(f"--to {plain(stop)}: {lasts}; must be above its beginning")


def _range(option: str, text: str | None) -> slice | None:
    if text is None:
        return None
    match = re.fullmatch(r"([0-9]{0,5}):([0-9]{0,5})", text)
    if match is None:
        raise ProblemError(f"{option} is {text!r}: must be A:B, of which B is not included, as 0:32")
    return slice(*(int(n) if n else None for n in match.groups()))
