"""``taxel convert``: from one kind of recording to another."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

import taxel
from taxel._core import ProblemError
from taxel.cli._task import FullReading, OutArgument, Output, SourceOption, of_source, progress
from taxel.cli.app import App, Flat

if TYPE_CHECKING:
    from taxel.recording import Recording

app = App(name="convert")


@app.default
def convert(
    source: Path,
    /,
    target: OutArgument,
    *,
    frames: Annotated[float | None, Parameter(metavar="HZ")] = None,
    part: SourceOption = None,
    compression: str = "none",
    reading: Flat[FullReading] = FullReading(),
    output: Flat[Output] = Output(),
) -> None:
    """Convert recordings to another format, and report what the target cannot hold.

    Both feet of a file become sources of one recording, `left` and `right`.

    Example: taxel convert walk.mcap walk.csv
    Example: taxel convert trials/ recordings/

    Parameters
    ----------
    source
        A recording, a file of a sensor's maker, or a folder.
    target
        The new file; its extension gives the format. Without an extension, or for several recordings: a folder, with a
        new .mcap of each recording.
    frames
        Write frames at this rate instead of events (not .lsa).
    compression
        Compression of a .mcap: none, lz4 or zstd.
    """
    if target.suffix:
        output.check(target)
    with progress(output.json) as show:
        show(f"reading {source}", 0, 0)
        opened = [of_source(recording, part) for recording in reading.opener.open_trials(source)]
        if target.suffix and len(opened) > 1:
            raise ProblemError(
                f"{source}: contains {len(opened)} recordings; {target} must be a folder, so its name must have no "
                f"extension"
            )
        targets = [target] if target.suffix else _targets(opened, target)
        if not target.suffix:
            output.check(*targets)
        written = []
        for k, (recording, file) in enumerate(zip(opened, targets, strict=True)):
            show(f"{recording.name} to {file}", k, len(targets) if k else 0)
            how: dict[str, Any] = {"frames_hz": frames, "compression": compression, "overwrite": output.overwrite}
            lost = taxel.convert(recording, file, **how)
            written.append({"source": recording.title, "target": str(file), "lost": lost})
    lines = [line for one in written for line in (f"written to {one['target']}", *_losses(one["lost"]))]
    output.say({**written[0], "source": str(source)} if target.suffix else {"written": written}, *lines)


def _losses(lost: Sequence[str]) -> list[str]:
    return [f"  lost: {loss}" for loss in lost]


def _targets(opened: list[Recording], folder: Path) -> list[Path]:
    """Return the new files of recordings in a folder, which is created."""
    folder.mkdir(parents=True, exist_ok=True)
    stems = [Path(each.name).stem if each.path.name == each.name else each.name for each in opened]
    targets = [folder / (re.sub(r"[^\w.-]+", "_", stem) + ".mcap") for stem in stems]
    twice = next((target for target in targets if targets.count(target) > 1), None)
    if twice is not None:
        raise ProblemError(f"{twice}: two recordings have this name; convert them one by one")
    return targets
