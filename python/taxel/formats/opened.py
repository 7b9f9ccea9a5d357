"""What a table or a file of arrays holds, as sources of frames or events, and how it was read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.columns import frozen_whole
from taxel._base.messages import counted, first_line
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.column_names import AXES
from taxel.formats.layout import Layout
from taxel.frames import Frames


@dataclass(frozen=True, eq=False)
class Opened:
    """Hold what a file of another program says.

    Parameters
    ----------
    sources : mapping from str to Frames or Events
        By name, "" for the only one.
    timed : bool
        Whether the file has times; else frames are numbered: frame k has the time k us.
    layout : Layout
        The layout by which it was read, complete.
    said : str
        How it was read, in one line; "" if the layout says all.
    labels : tuple of (str, int)
        Labels and their times in us, of the column of labels.
    lost : tuple of str
        What was left out, one line each.
    """

    sources: dict[str, Frames | Events]
    timed: bool
    layout: Layout
    said: str = ""
    labels: tuple[tuple[str, int], ...] = ()
    lost: tuple[str, ...] = ()


def size_of(sources: dict[str, Frames | Events]) -> str:
    """Return the number of frames or events of each source, and their sensors."""
    sizes = []
    for table in sources.values():
        rows, columns = table.array.shape
        of = f" of {rows} x {columns} {'taxel' if rows * columns == 1 else 'taxels'}"
        sizes.append(counted(len(table), "event") if isinstance(table, Events) else counted(len(table), "frame") + of)
    return " and ".join(sizes)


def sources_of(
    path: Path,
    layout: Layout,
    name: str,
    values: NDArray[np.float32],
    t: NDArray[np.int64],
    names: Sequence[str] | None = None,
) -> Iterator[tuple[str, Frames]]:
    """Yield the frames of a source by its name, or, if the layout asks for all axes, of each axis.

    Parameters
    ----------
    path : Path
    layout : Layout
    name : str
    values : float32, shape (frames, rows, columns), or (frames, rows, columns, 3) of taxels with three axes
    t : int64, us
    names : sequence of str, optional
        Those of the taxels.

    Raises
    ------
    FormatError : another number of taxels or of axes than the layout states
    """
    if values.ndim == 3:
        yield name, _frames(path, layout, values, t, names)
        return
    if layout.axis is None or values.shape[-1] != len(AXES):
        raise FormatError(f'{layout.path}: {path.name} has taxels with {values.shape[-1]} axes; write axis = "z"')
    if layout.axis == "shear":
        yield name, _frames(path, layout, np.hypot(values[..., 0], values[..., 1]), t, names)
        return
    for k, axis in enumerate(AXES):
        if layout.axis in (axis, "all"):
            label = f"{name} {axis}".strip() if layout.axis == "all" else name
            yield label, _frames(path, layout, values[..., k], t, names)


def _frames(
    path: Path, layout: Layout, values: NDArray[np.float32], t: NDArray[np.int64], names: Sequence[str] | None
) -> Frames:
    """Return the frames of a sensor, in the rows and columns of the layout."""
    rows, columns = values.shape[1:]
    taxels, size = rows * columns, (layout.rows or 0) * (layout.columns or 0)
    if size not in (0, taxels):
        per_frame, left = divmod(size, taxels)
        hint = f"; if {per_frame} lines are a frame, write [table] frame_lines = {per_frame}"
        raise FormatError(
            f"{path}: contains frames of {rows} x {columns} values; {layout.path} states {layout.rows} x "
            f"{layout.columns} taxels{hint if layout.table and rows == 1 and per_frame > 1 and not left else ''}"
        )
    try:
        # More channels than a sensor may have columns are a grid by the layout.
        stated = layout.grid() if taxels > 65_535 else None
        stated = stated or Array(rows, columns, name=path.stem, names=names if rows == 1 else None)
        array = layout.array(taxels, stated)
        whole = frozen_whole(np.ascontiguousarray(values).reshape(-1, *array.shape))
        return Frames(whole, frozen_whole(t), unit=layout.unit or "counts", array=array)
    except ProblemError as error:
        raise FormatError(f"{layout.path}: {path.name}: {first_line(error)}") from None
