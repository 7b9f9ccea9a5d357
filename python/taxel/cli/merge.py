"""``taxel merge``: several recordings as one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import taxel
from taxel.cli.app import App, Flat, Limits
from taxel.cli.task import Output
from taxel.options import Reading

app = App(name="merge")


@app.default
def merge(
    recordings: list[Path],
    /,
    *,
    out: Annotated[Path, Parameter(name=("--out", "-o"), metavar="FILE")],
    gap: Annotated[float | None, Parameter(metavar="S", validator=Limits(0.0))] = None,
    label: str | None = None,
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> None:
    """Merge recordings: by time, side by side, or the parts around a label in each.

    At the beginning of each recording, a note has the name of its file.

    Example: taxel merge left.mcap right.mcap -o both.mcap

    Parameters
    ----------
    recordings
        Recordings: .mcap, .lsa, .npz, .csv or .h5, a ROS bag or a file of a sensor's maker.
    out
        The new file; its extension gives the format.
    gap
        Put the recordings one after another, with this pause, s. Default: keep their times.
    label
        Merge only the half second before and after each note with this text.
    """
    opened = [reading.open_one(path) for path in recordings]
    parts = opened if label is None else [part for each in opened for part in taxel.cut(each, label=label)]
    merged = taxel.merge(parts, gap_us=None if gap is None else gap * 1e6)
    lost = taxel.convert(merged, out, overwrite=output.overwrite)
    output.say(
        {"recordings": [str(path) for path in recordings], "file": str(out), "lost": lost},
        f"written to {out}: {merged!r}",
        *(f"  lost: {loss}" for loss in lost),
    )
