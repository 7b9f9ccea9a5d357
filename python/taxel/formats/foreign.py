"""Tables and arrays of other programs, each source of a file as a reader; one line says how it was read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from taxel._base.errors import unreadable
from taxel._base.messages import warn
from taxel._base.table_text import Text
from taxel.array import Array
from taxel.formats.array_file import ARRAYS, look, read_array_file
from taxel.formats.layout import Layout
from taxel.formats.layout_text import of_layout
from taxel.formats.table import read_table
from taxel.formats.table_form import form_of
from taxel.labels import Note, source_of
from taxel.reading import Facts, InMemory, Marks

#: What to save instead of files of other programs that taxel does not read, by their endings.
CONTAINERS = {
    ".xls": "save it as .xlsx or .csv",
    ".pkl": "in Python, save the table with to_csv, or the array with numpy.save",
    ".pickle": "in Python, save the table with to_csv, or the array with numpy.save",
    ".pt": "in Python, save the tensor with numpy.save('FILE.npy', tensor.numpy())",
    ".pth": "in Python, save the tensor with numpy.save('FILE.npy', tensor.numpy())",
    ".joblib": "in Python, save the array with numpy.save",
    ".tdms": "save it as .csv or .xlsx, in LabVIEW or with nptdms' to_hdf",
    ".c3d": "export its analog channels as .csv",
    ".rds": "in R, save the table with write.csv",
    ".rdata": "in R, save the table with write.csv",
    ".sav": "save the table as .csv",
    ".feather": "save the table as .parquet or .csv",
    ".zip": "unpack it first",
    ".7z": "unpack it first",
    ".zst": "unpack it first",
    ".xz": "unpack it first",
    ".bz2": "unpack it first",
    ".pdf": "save the table in it as .csv",
    ".mp4": "taxel reads no films; save the readings as .csv or .npy",
}


def read_foreign(
    path: Path, layout: Layout | None, array: Array | None = None, label_column: str | int | None = None
) -> Sequence[InMemory]:
    """Return a reader of each source of a table or a file of arrays.

    Parameters
    ----------
    path : Path
    layout : Layout, optional
        What it does not say of a table or of axes is found in the file.
    array : Array, optional
        The sensor of events, where the layout does not say it; default: one large enough for them.
    label_column : str or int, optional
        The column of a table whose value becomes a label where it changes.

    Raises
    ------
    FormatError : no table or arrays, other ones than the layout says, or two readings that fit about equally
    """
    how = Layout(path) if layout is None else layout
    is_arrays = path.suffix.lower() in ARRAYS
    found = read_array_file(path, how) if is_arrays else read_table(path, how, array, label_column)
    if found.said:
        warn(found.said, stacklevel=6)
    notes = tuple(Note(label, t, 0) for label, t in found.labels)
    facts = Facts(
        path=path,
        array=Array(1, 1),
        kind="arrays" if is_arrays else "table",
        timed=found.timed,
        lost=found.lost,
        layout=of_layout(found.layout),
    )
    return [
        InMemory(
            replace(
                facts, label=source_of(name) if name else facts.label, side=name if name in ("left", "right") else ""
            ),
            table,
            Marks(notes=notes),
        )
        for name, table in found.sources.items()
    ]


def check_foreign(path: Path, layout: Layout | None) -> None:
    """Refuse a table or arrays that cannot be read, or in two ways, by their beginning.

    Raises
    ------
    FormatError : as of `read_foreign`
    """
    how = Layout(path) if layout is None else layout
    if path.suffix.lower() in ARRAYS:
        look(path, how)
    else:
        form_of(Text(path), how)


def refuse_container(path: Path) -> None:
    """Refuse a file of another program that taxel does not read, by the line that says what to save instead.

    Raises
    ------
    FormatError : it is such a file
    """
    if advice := CONTAINERS.get(path.suffix.lower()):
        raise unreadable(f"taxel does not read {path.suffix.lower()} files; {advice}", path)
