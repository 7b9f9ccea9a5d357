"""``taxel convert``: from one kind of recording to another."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import taxel
from taxel._base.files import check_writable
from taxel._core import ProblemError
from taxel.cli._app import App, JsonOption, OverwriteOption, with_out
from taxel.cli._bar import bar
from taxel.cli._opening import FileOptions
from taxel.cli._recordings import of_source, progress
from taxel.cli._say import say

if TYPE_CHECKING:
    from taxel.recording import Recording

app = App()


@app.command()
@with_out("target")
def convert(
    source: Annotated[Path, typer.Argument(help="A recording, a file of a sensor's maker, or a folder.")],
    target: Annotated[
        Path,
        typer.Argument(
            help="The new file; its extension gives the format. Without an extension, or for several recordings: a "
            "folder, with a new .mcap of each recording."
        ),
    ],
    files: FileOptions,
    frames: Annotated[
        float | None,
        typer.Option(metavar="HZ", help="Write frames at this rate instead of events (not .lsa)."),
    ] = None,
    part: Annotated[
        str | None,
        typer.Option("--source", metavar="NAME", help="The source to convert, if the recording has several."),
    ] = None,
    compression: Annotated[str, typer.Option(help="Compression of a .mcap: none, lz4 or zstd.")] = "none",
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Convert recordings to another format, and report what the target cannot hold.

    Both feet of a file become sources of one recording, `left` and `right`.

    Example: taxel convert walk.mcap walk.csv
    Example: taxel convert trials/ recordings/
    """
    if target.suffix:
        check_writable(target, overwrite=overwrite)
    with progress(quiet=True), bar(as_json) as show:  # the first prints warnings
        show(f"reading {source}", 0, 0)
        opened = [of_source(recording, part) for recording in files.opener.open_trials(source)]
        if target.suffix and len(opened) > 1:
            raise ProblemError(
                f"{source}: contains {len(opened)} recordings; {target} must be a folder, so its name must have no "
                f"extension"
            )
        targets = [target] if target.suffix else _targets(opened, target)
        for file in targets if not target.suffix else ():
            check_writable(file, overwrite=overwrite)
        written = []
        for k, (recording, file) in enumerate(zip(opened, targets, strict=True)):
            show(f"{recording.name} to {file}", k, len(targets) if k else 0)
            how: dict[str, Any] = {"frames_hz": frames, "compression": compression, "overwrite": overwrite}
            written.append(
                {"source": recording.title, "target": str(file), "lost": taxel.convert(recording, file, **how)}
            )
    if as_json:
        say(json.dumps({**written[0], "source": str(source)} if target.suffix else {"written": written}))
        return
    for entry in written:
        say(f"written to {entry['target']}", *(f"  lost: {loss}" for loss in entry["lost"]))


def _targets(opened: list[Recording], folder: Path) -> list[Path]:
    """Return the new files of recordings in a folder, which is created."""
    folder.mkdir(parents=True, exist_ok=True)
    stems = [Path(each.name).stem if each.path.name == each.name else each.name for each in opened]
    targets = [folder / (re.sub(r"[^\w.-]+", "_", stem) + ".mcap") for stem in stems]
    twice = next((target for target in targets if targets.count(target) > 1), None)
    if twice is not None:
        raise ProblemError(f"{twice}: two recordings have this name; convert them one by one")
    return targets
