"""The sources of a table or a file of arrays: frames or events, each as a reader, and the line that says how."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.columns import frozen_whole
from taxel._base.messages import counted, first_line, warn
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.formats.column_names import AXES
from taxel.formats.layout import Layout, of_layout
from taxel.formats.roles import Role
from taxel.frames import Frames
from taxel.labels import Note, source_of
from taxel.reading import Facts, InMemory, Marks


def readers_of(
    path: Path,
    kind: str,
    sources: Mapping[str, Frames | Events],
    layout: Layout,
    said: Sequence[str],
    *,
    timed: bool,
    lost: Sequence[str] = (),
    notes: Mapping[str, Sequence[Note]] | None = None,
    roles: Sequence[Role] = (),
) -> list[InMemory]:
    """Return a reader of each source of a file of another program.

    Parameters
    ----------
    path : Path
    kind : {"table", "arrays"}
    sources : mapping from str to Frames or Events
        By name, "" for the only one.
    layout : Layout
        By which it was read, complete.
    said : sequence of str
        What was understood beyond the given layout, which is warned of in one line.
    timed : bool
        Whether the file has times; else frames are numbered: frame k has the time k us.
    lost : sequence of str
        What was left out, one line each.
    notes : mapping from str to sequence of Note, optional
        Of the column of labels, by source.
    roles : sequence of Role
        What its columns or axes are.
    """
    if said:
        warn(f"{path.name}: read as {_size_of(sources)}: {'; '.join(said)}", stacklevel=6)
    facts = Facts(
        path=path,
        array=Array(1, 1),
        kind=kind,
        timed=timed,
        lost=tuple(lost),
        layout=of_layout(layout),
        roles=tuple(map(asdict, roles)),
    )

    readers = list[InMemory]()
    for name, table in sources.items():
        side = name if name in ("left", "right") else ""
        of_source = replace(facts, label=source_of(name) if name else facts.label, side=side)
        readers.append(InMemory(of_source, table, Marks(notes=tuple((notes or {}).get(name, ())))))
    return readers


def _size_of(sources: Mapping[str, Frames | Events]) -> str:
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
    if layout.axis == "xyz":
        channels = replace(layout, rows=None, columns=None, pitch_mm=None, places=None)
        taxels = names or [f"{row}_{column}" for row, column in np.ndindex(values.shape[1:3])]
        of_axes = [f"{taxel}_{axis}" for taxel in taxels for axis in AXES]
        yield name, _frames(path, channels, values.reshape(len(values), 1, -1), t, of_axes)
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
    taxels = rows * columns
    try:
        # More channels than a sensor may have columns are a grid by the layout.
        stated = layout.grid() if taxels > 65_535 else None
        stated = stated or Array(rows, columns, name=path.stem, names=names if rows == 1 else None)
        array = layout.array(taxels, stated)
        whole = frozen_whole(np.ascontiguousarray(values).reshape(-1, *array.shape))
        return Frames(whole, frozen_whole(t), unit=layout.unit or "counts", array=array)
    except ProblemError as error:
        raise FormatError(f"{layout.path}: {path.name}: {first_line(error)}") from None
