"""The sensor that ``--array`` describes."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated

import typer

from taxel._core import ProblemError

if TYPE_CHECKING:
    from taxel.array import Array
    from taxel.recording import Recording

__all__ = ["FileArrayOption", "geometry", "of_array"]

#: Option of the commands that read files; those that receive have `taxel.cli._board.ArrayOption`.
FileArrayOption = Annotated[
    str | None,
    typer.Option(
        "--array",
        metavar="ROWSxCOLUMNS[xMM]",
        help="Rows, columns and pitch of the sensor, as 24x20x5, for files without them (events as .csv, .lsa). "
        "Default: 64x64x2.67, or a larger array if events lie outside it.",
    ),
]


def geometry(size: str) -> Array:
    """Return the array of a size, rows x columns [x pitch in mm]; the default pitch is the thesis'."""
    from taxel.array import Array  # noqa: PLC0415  the command line starts quickly

    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})(?:x(\d{1,4}(?:\.\d{1,6})?))?", size)
    if match is None:
        raise ProblemError(f"--array {size}: must be rows x columns, as 64x64, or with the pitch in mm, as 64x64x2.67")
    thesis = Array.thesis()
    rows, columns, pitch = int(match[1]), int(match[2]), float(match[3] or thesis.pitch_mm)
    same = (rows, columns, pitch) == (*thesis.shape, thesis.pitch_mm)
    return thesis if same else Array(rows, columns, pitch_mm=pitch, name=size)


def of_array(recording: Recording, size: str | None) -> Recording:
    """Return the recording; refuse an ``--array`` that differs from the sensor that it holds."""
    if size is not None and recording.array != geometry(size):
        raise ProblemError(f"--array {size}: {recording.path} holds its own sensor, {recording.array!r}; leave it out")
    return recording
