"""The sensor that ``--array`` describes."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from taxel._core import ProblemError

if TYPE_CHECKING:
    from taxel.array import Array

__all__ = ["geometry"]


def geometry(size: str, *, of_wire: bool = True) -> Array:
    """Return the array of a size, rows x columns [x mm]; without mm, the pitch of the board's wire or none."""
    from taxel.array import Array  # noqa: PLC0415  the command line starts quickly

    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})(?:x(\d{1,4}(?:\.\d{1,6})?))?", size, re.ASCII)
    if match is None:
        raise ProblemError(f"--array {size}: must be rows x columns, as 64x64, or with the pitch in mm, as 64x64x2.67")
    thesis = Array.thesis()
    rows, columns, pitch = int(match[1]), int(match[2]), thesis.pitch_mm if of_wire else None
    pitch = float(match[3]) if match[3] else pitch
    same = (rows, columns, pitch) == (*thesis.shape, thesis.pitch_mm)
    try:
        return thesis if same else Array(rows, columns, pitch_mm=pitch, name=size)
    except ProblemError as error:
        raise ProblemError(f"--array {size}: {error}") from None
