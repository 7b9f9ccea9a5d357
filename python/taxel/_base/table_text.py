"""The text of a table: of a file in any usual encoding, compressed or not, or of a spreadsheet or Parquet."""

from __future__ import annotations

import gzip
import io
import json
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
from numpy.typing import NDArray

from taxel._base.arrays import ARRAYS, columns_of, read_arrays, records_in
from taxel._base.documents import mark_of
from taxel._base.errors import damaged, unreadable
from taxel._base.messages import first_line, installing

__all__ = ["SHEETS", "TEXTS", "Text", "beginning", "marked", "read_parquet", "values_in"]

#: The endings of tables of text, also compressed by gzip, and of tables that pandas reads as a whole.
TEXTS = (".csv", ".txt", ".tsv", ".dat", ".asc", ".log", ".json", ".jsonl", ".ndjson")
SHEETS = (".xlsx", ".xlsm", ".ods", ".parquet")
#: Characters of the beginning that are looked at, and more if these are few lines.
_HEAD, _MORE = 1 << 16, 1 << 22
_FEW_LINES = 24
#: So many first lines are looked at, and as many over the rest of a file.
_SPREAD = 1000


def beginning(path: Path, count: int = _HEAD) -> bytes:
    """Return the first bytes of a file; none of anything else, as a folder may hold pipes, sockets and folders too."""
    if not path.is_file():
        return b""
    with open(path, "rb") as file:
        return file.read(count)


class Text:
    """The lines of a table.

    Parameters
    ----------
    path : Path

    Raises
    ------
    FormatError : damaged, no text, or a spreadsheet that cannot be read
    ImportError : the extra ``tables`` is not installed
    """

    def __init__(self, path: Path) -> None:
        self.path, self._name = path, ""
        self._takes: Callable[[str], bool] | None = None
        self.is_file = path.suffix.lower() not in (*SHEETS, *ARRAYS) and not self._rows
        self._encoding = ""
        #: Whether the last of the lines that were read has an end, and whether more follow those of the head.
        self.ends_in_line, self.goes_on = True, False

    def of_sheet(self, name: str) -> Text:
        """Return the text of one sheet of a workbook."""
        part = Text(self.path)
        part.sheets, part._name = self.sheets, name
        return part

    def of_lines(self, takes: Callable[[str], bool]) -> Text:
        """Return the text in which all lines are empty but those that it takes."""
        part = Text(self.path)
        part._takes = takes
        return part

    @property
    def encoding(self) -> str:
        """The encoding: by a byte-order mark, else UTF-8, else Windows-1252 or Latin-1 if the beginning is none."""
        if not self._encoding:
            with self._bytes() as file:
                head = file.read(_HEAD)
            self._encoding = _encoding(self.path, head)
        return self._encoding

    def as_latin_1(self, error: UnicodeDecodeError) -> None:
        """Read the text as Latin-1, as a later part of it is not UTF-8.

        Raises
        ------
        FormatError : it is of another encoding
        """
        if not self.encoding.startswith("utf-8"):
            why = f"not text in {self.encoding.upper()} ({error.reason}); save it as UTF-8"
            raise unreadable(why, self.path) from None
        self._encoding = "latin-1"

    def lines(self) -> Iterator[str]:
        """Yield all lines without their ends; of a typed table its cells between tabs, below their names."""
        if self.typed is not None:
            for begin in range(0, max(1, len(self.typed)), _SPREAD):
                part = self.typed[begin : begin + _SPREAD].to_csv(sep="\t", index=False, header=not begin)
                yield from part.splitlines()
            return
        count = 0
        with self.opened() as text:
            try:
                for line in text:
                    self.ends_in_line = line.endswith("\n")
                    bare = line.rstrip("\n")
                    yield bare if self._takes is None or self._takes(bare) else ""
                    count += 1
                return
            except UnicodeDecodeError as error:
                self.as_latin_1(error)
        yield from islice(self.lines(), count, None)

    @cached_property
    def head(self) -> list[str]:
        """The first lines; the last of them is whole, if the text goes on."""
        lines, count = list[str](), 0
        for line in self.lines():
            if count > _MORE or len(lines) >= _SPREAD or (count > _HEAD and len(lines) >= _FEW_LINES):
                self.goes_on = True
                break
            lines.append(line)
            count += len(line) + 1
        return lines

    @cached_property
    def spread(self) -> list[str]:
        """Lines that are spread over the rest of a file of bytes, about a thousand; none of a compressed one."""
        begin = sum(len(line) + 1 for line in self.head)
        if not self.is_file or self.path.suffix.lower() == ".gz" or self.encoding.startswith("utf-16"):
            return []
        rest, longest = self.path.stat().st_size - begin, 2 * max(map(len, self.head), default=0) + 2
        found = list[bytes]()
        with open(self.path, "rb") as file:
            for place in range(0, max(0, rest), max(1, rest // min(_SPREAD, 1 + _MORE // longest))):
                file.seek(begin + place)
                # Those at the ends may be parts.
                found += file.read(longest).split(b"\n")[1:-1][:1]
        lines = (line.decode(self.encoding, "replace").rstrip("\r") for line in found)
        return [line for line in lines if self._takes is None or self._takes(line)]

    @contextmanager
    def opened(self) -> Iterator[IO[str]]:
        """Open the text at its first line; a line feed ends each line."""
        if not self.is_file:
            yield io.StringIO(self._sheet)
            return
        errors = "replace" if self.encoding == "cp1252" else "strict"
        with self._bytes() as file, io.TextIOWrapper(file, self.encoding, errors) as text:
            yield text

    @contextmanager
    def _bytes(self) -> Iterator[IO[bytes]]:
        try:
            if self.path.suffix.lower() == ".gz":
                with gzip.open(self.path, "rb") as unpacked:
                    yield cast("IO[bytes]", unpacked)
            else:
                with open(self.path, "rb") as file:
                    yield file
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise damaged(self.path, "gzip file", first_line(error)) from None

    @cached_property
    def _rows(self) -> list[Any]:
        """The objects or lists of a document of JSON that is a list of them, or has one; none of another file."""
        if self.path.suffix.lower() != ".json":
            return []
        try:
            document = _rows_in(json.loads(self.path.read_bytes()))
        except (ValueError, RecursionError):
            return []
        are_rows = isinstance(document, list) and all(isinstance(row, dict | list) for row in document)
        return document if are_rows and len(document) > 1 else []

    @cached_property
    def typed(self) -> Any:
        """The DataFrame of a table of Parquet, a column for each place in its lists; None of any other file."""
        if self.path.suffix.lower() != ".parquet":
            return None
        import pandas as pd  # noqa: PLC0415  takes long

        table = read_parquet(self.path)
        named = table if type(table.index) is pd.RangeIndex else table.reset_index()
        columns = (each for name in named.columns for each in _columns_in(str(name), named[name]))
        return pd.DataFrame(dict(columns))

    @cached_property
    def _sheet(self) -> str:
        """A table as lines of cells between tabs: a sheet with numbers, one of Parquet, or an array of records."""
        if self._rows:
            return "".join(f"{json.dumps(row)}\n" for row in self._rows)
        import pandas as pd  # noqa: PLC0415  takes long

        if self.path.suffix.lower() in ARRAYS:
            name = records_in(self.path)
            if name is None:
                raise unreadable(
                    "contains no table; must be one array of records, with a field for each column", self.path
                )
            records = read_arrays(self.path, [name])[name].ravel()
            columns = {name: _cells(column) for name, column in columns_of(records)}
            return str(pd.DataFrame(columns).to_csv(sep="\t", index=False))
        return str(
            self.sheets[self._name or next(iter(self.sheets))].map(_cell).to_csv(sep="\t", index=False, header=False)
        )

    @cached_property
    def sheets(self) -> dict[str, Any]:
        """The DataFrames of a workbook's sheets by their names; none of any other file."""
        if self.path.suffix.lower() not in SHEETS or self.typed is not None:
            return {}
        import pandas as pd  # noqa: PLC0415  takes long

        try:
            return dict(pd.read_excel(self.path, sheet_name=None, header=None, dtype=object))
        except Exception as error:  # of zipfile, of XML
            raise _damaged(self.path, error) from None


def read_parquet(path: Path, columns: Sequence[str] | None = None) -> Any:
    """Return the DataFrame of a table of Parquet, of all columns or of some.

    Raises
    ------
    FormatError : damaged, or there is no such column
    ImportError : the extra ``tables`` is not installed
    """
    import pandas as pd  # noqa: PLC0415  takes long

    try:
        return pd.read_parquet(path, columns=columns)
    except OSError:
        raise
    except Exception as error:  # of pyarrow
        raise _damaged(path, error) from None


def _damaged(path: Path, error: Exception) -> Exception:
    """Return the error of a table that pandas does not read."""
    if isinstance(error, ImportError):
        text = f"to read it, taxel needs pandas with openpyxl and pyarrow: {installing('tables')}"
        return ImportError(f"{path}: {text}")
    if path.suffix.lower() != ".parquet" and beginning(path, 4) == b"\xd0\xcf\x11\xe0":
        return unreadable("is encrypted, or of an older kind; save it without a password, as .xlsx or .csv", path)
    return damaged(path, f"{path.suffix} file", first_line(error))


def _columns_in(name: str, column: Any) -> Iterator[tuple[str, Any]]:
    """Yield a column of a DataFrame, or a column for each place in its lists, if all have the same shape.

    Spans of time are numbers of seconds.
    """
    if column.dtype.kind == "m":
        yield f"{name} [s]", column.dt.total_seconds()
        return
    first = column.iloc[0] if len(column) else None
    if column.dtype != object or not isinstance(first, np.ndarray | list):
        yield name, column
        return
    try:
        values = np.stack([values_in(cell) for cell in column])
    except ValueError:
        yield name, column.map(str)
        return
    for place in np.ndindex(values.shape[1:]):
        yield name + "".join(f"[{k}]" for k in place), values[:, *place]


def values_in(cell: Any) -> NDArray[Any]:
    """Return the values of a list in a cell, or of lists in it, as arrays of pyarrow hold them."""
    values = np.asarray(cell)
    return np.stack([values_in(each) for each in cell]) if values.dtype == object and len(values) else values


def _rows_in(document: Any) -> Any:
    """Return the rows of a document of JSON: itself, its only list, or those of its lists, which are columns."""
    lists = {key: value for key, value in document.items() if isinstance(value, list)} if type(document) is dict else {}
    if len(lists) < 2:
        return next(iter(lists.values()), document)
    same = len({*map(len, lists.values())}) == 1
    return [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)] if same else document


def _cells(column: NDArray[Any]) -> NDArray[Any]:
    """Return a column of records as tables of text have it: texts without their bytes, 0 and 1."""
    kinds = {"S": np.str_, "b": np.uint8}
    return column.astype(kinds.get(column.dtype.kind, column.dtype))


def _cell(value: Any) -> Any:
    """Return the cell of a sheet as tables of text have it: dates with times, and times of a day, as of ISO 8601."""
    return str(value) if hasattr(value, "hour") else value


def marked(path: Path, data: bytes) -> tuple[bytes, str]:
    """Return the byte-order mark of a table's bytes, or none, and their encoding, as of `Text`.

    Raises
    ------
    FormatError : no text
    """
    mark, encoding = mark_of(data)
    return (mark, encoding) if mark else (mark, _encoding(path, data).removesuffix("-sig"))


def _encoding(path: Path, head: bytes) -> str:
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if (zero := head.find(b"\0")) >= 0:
        why = "this byte is zero; if the file is UTF-16 without a byte-order mark, save it as UTF-8"
        raise unreadable(why, path, byte=zero)
    try:
        head.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        # The beginning may end within a character.
        if error.start < len(head) - 3 or len(head) < _HEAD:
            return _of_bytes(head)
    return "utf-8-sig"


def _of_bytes(head: bytes) -> str:
    """Return the encoding of a text that is not UTF-8: that of Windows, unless it has no such character."""
    try:
        head.decode("cp1252")
    except UnicodeDecodeError:
        return "latin-1"
    return "cp1252"
