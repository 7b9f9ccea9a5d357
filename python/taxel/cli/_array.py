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
        help="Rows, columns and pitch (mm) of the sensor, as 24x20x5, for files without them (events as .csv, .lsa). "
        "Default: 64x64x2.67, or a larger array if events lie outside it. Without the pitch it is 2.67 mm for events "
        "of the board, else unknown.",
    ),
]


def geometry(size: str, *, of_wire: bool = True) -> Array:
    """Return the array of a size, rows x columns [x mm]; without mm, the pitch of the board's wire or none."""
    from taxel.array import Array  # noqa: PLC0415  the command line starts quickly

    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})(?:x(\d{1,4}(?:\.\d{1,6})?))?", size)
    if match is None:
        raise ProblemError(f"--array {size}: must be rows x columns, as 64x64, or with the pitch in mm, as 64x64x2.67")
    thesis = Array.thesis()
    rows, columns, pitch = int(match[1]), int(match[2]), thesis.pitch_mm if of_wire else None
    pitch = float(match[3]) if match[3] else pitch
    same = (rows, columns, pitch) == (*thesis.shape, thesis.pitch_mm)
    return thesis if same else Array(rows, columns, pitch_mm=pitch, name=size)


def of_array(recording: Recording, size: str | None) -> Recording:
    """Return the recording on the sensor of ``--array``; refuse one that differs from the sensor that it holds.

    A size without a pitch says nothing of it: events without one are of the board's wire, and have that of the thesis.
    """
    if size is None:
        return recording
    from taxel.array import Array  # noqa: PLC0415  the command line starts quickly
    from taxel.recording.layout import on_array  # noqa: PLC0415

    own, given = recording.array, geometry(size, of_wire=False)
    differs = given.pitch_mm is not None and (own.pitch_mm, own.places) != (given.pitch_mm, None)
    if own.shape != given.shape or differs:
        raise ProblemError(f"--array {size}: {recording.path} holds its own sensor, {own!r}; leave it out")
    if not recording.has_events or own._is_measured:
        return recording
    wire = geometry(size)
    return type(recording)(on_array(recording._contents, Array(*own.shape, wire.pitch_mm, own.exists, wire.name)))
