"""``taxel convert``: from one kind of recording to another."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

import taxel
from taxel._base.files import check_writable
from taxel._base.parallel import Workers
from taxel._core import ProblemError
from taxel.cli.app import App, Flat
from taxel.cli.task import OutArgument, Output, SourceOption, of_source, progress, say_failures
from taxel.options import FullReading

if TYPE_CHECKING:
    from taxel.recording import Recording

app = App(name="convert")


@app.default
def convert(
    source: Path,
    /,
    target: OutArgument,
    *,
    frames_hz: Annotated[float | None, Parameter(name="--frames", metavar="HZ")] = None,
    part: SourceOption = None,
    compression: str = "none",
    workers: Flat[Workers] = Workers(),
    reading: Flat[FullReading] = FullReading(),
    output: Flat[Output] = Output(),
) -> int:
    """Convert recordings to another format, and report what the target cannot hold.

    Both feet of a file become sources of one recording, `left` and `right`. Files of a folder that cannot be converted
    are named at the end, with exit code 2; --jobs converts several at once.

    Example: taxel convert walk.mcap walk.csv
    Example: taxel convert trials/ recordings/

    Parameters
    ----------
    source
        A recording, a file of a sensor's maker, or a folder.
    target
        The new file; its extension gives the format. Without an extension, or for several recordings: a folder, with a
        new .mcap of each recording.
    frames_hz
        Write frames at this rate instead of events (not .lsa).
    compression
        Compression of a .mcap: none, lz4 or zstd.
    """
    from taxel.recording.kinds import is_folder, recordings_in  # noqa: PLC0415  the command line starts quickly

    how: dict[str, Any] = {"frames_hz": frames_hz, "compression": compression, "overwrite": output.overwrite}
    work = partial(_converted, reading, part, how, target)
    files = recordings_in(source, reading.layout) if source.exists() and is_folder(source) else []
    if not target.suffix and len(files) > 1:
        _refuse_twice([file.stem for file in files], target)
        with progress(output.json) as show:
            found = workers.tried(work, files, lambda k, done: show(str(files[k]), done, len(files)))
        written = [one for of_file in found if not of_file.failure for one in of_file.result]
        failed = [{"source": str(f), "error": one.failure} for f, one in zip(files, found, strict=True) if one.failure]
        output.say({"written": written, "failed": failed}, *_lines(written))
        return say_failures(files, found)
    if target.suffix:
        output.check(target)
    with progress(output.json) as show:
        show(f"reading {source}", 0, 0)
        written = work(source)
    output.say({**written[0], "source": str(source)} if target.suffix else {"written": written}, *_lines(written))
    return 0


def _converted(
    reading: FullReading, part: str | None, how: Mapping[str, Any], target: Path, source: Path
) -> list[dict[str, Any]]:
    """Convert the recordings of a file, to a file or into a folder; return places and what the format lacks."""
    opened = [of_source(recording, part) for recording in reading.open_trials(source)]
    if target.suffix and len(opened) > 1:
        raise ProblemError(
            f"{source}: contains {len(opened)} recordings; {target} must be a folder, so its name must have no "
            "extension"
        )
    targets = [target] if target.suffix else _targets(opened, target)
    for file in targets:
        check_writable(file, overwrite=how["overwrite"])
    pairs = zip(opened, targets, strict=True)
    return [
        {"source": each.title, "target": str(file), "lost": taxel.convert(each, file, **how)} for each, file in pairs
    ]


def _lines(written: Sequence[Mapping[str, Any]]) -> list[str]:
    return [line for one in written for line in (f"written to {one['target']}", *_losses(one["lost"]))]


def _losses(lost: Sequence[str]) -> list[str]:
    return [f"  lost: {loss}" for loss in lost]


def _targets(opened: list[Recording], folder: Path) -> list[Path]:
    """Return the new files of recordings in a folder, which is created."""
    folder.mkdir(parents=True, exist_ok=True)
    stems = [Path(each.name).stem if each.path.name == each.name else each.name for each in opened]
    targets = [folder / (re.sub(r"[^\w.-]+", "_", stem) + ".mcap") for stem in stems]
    _refuse_twice([target.stem for target in targets], folder)
    return targets


def _refuse_twice(stems: Sequence[str], folder: Path) -> None:
    """Refuse recordings that would have one name in a folder."""
    twice = next((stem for stem, count in Counter(stems).items() if count > 1), None)
    if twice is not None:
        raise ProblemError(f"{folder / twice}.mcap: two recordings have this name; convert them one by one")
