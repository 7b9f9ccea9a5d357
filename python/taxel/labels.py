"""Notes and labels: reference events that people wrote down with their times, and tables of them."""

from __future__ import annotations

import csv
import os
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import path as checked_path
from taxel._base.arguments import shown
from taxel._base.files import whole_file
from taxel._base.header_table import HeaderTable, text_of
from taxel._base.messages import counted
from taxel._core import FormatError, ProblemError
from taxel.clock import Clock
from taxel.recorded import Recorded

__all__ = ["TURN_US", "Labels", "Note", "ahead_us", "beside", "write_labels"]

#: The period after which the board's 16-bit clock of 100 us wraps, us.
TURN_US = 6_553_600

#: The columns of a table, as an error lists them; those in brackets are optional.
_WANTED, _OTHERS = ("label", "t_us"), ("recording", "source", "host_ns")


@dataclass(frozen=True)
class Note:
    """Hold an event that a person noted: a note in a recording, or a label in a table.

    Parameters
    ----------
    text : str
        The note, or the label.
    t : int, us, optional
        Time by the board's clock, if known.
    at_ns : int, ns since 1970
        Time by the host's clock; 0 if unknown.
    recording : str
        In a table of several recordings (`Labels`) the path, name or stem of the file; else "".
    source : str
        The source of the recording that it is of, as "left"; "" for all of them.

    Examples
    --------
    >>> Note("left heel", 5000)
    Note(text='left heel', t=5000, at_ns=0, recording='', source='')
    """

    text: str
    t: int | None = None
    at_ns: int = 0
    recording: str = ""
    source: str = ""

    def __getattr__(self, name: str) -> Any:
        """Return a field by its old name in `taxel.Label`; this is removed in the next version."""
        if name not in _OF_LABEL:
            raise AttributeError(f"a Note has no {name!r}")
        _warn(f"Label.{name} is Note.{_OF_LABEL[name]} now")
        return getattr(self, _OF_LABEL[name])


#: Fields of `Note` by their old names in `taxel.Label`.
_OF_LABEL = {"label": "text", "t_us": "t", "host_ns": "at_ns"}


def _warn(text: str) -> None:
    warnings.warn(text, DeprecationWarning, stacklevel=3)


def _label(recording: str, label: str, t_us: int, host_ns: int | None = None) -> Note:
    """Return the note that replaces a `taxel.Label`; this is removed in the next version."""
    _warn("taxel.Label is taxel.Note now, whose fields are text, t, at_ns, recording")
    return Note(label, t_us, host_ns or 0, recording)


class Labels:
    r"""Hold reference events of one recording or several, read from a table.

    Parameters
    ----------
    path : path
        A CSV ``recording,source,label,t_us,host_ns``, its columns in any order; `recording`, `source` and `host_ns` may
        be absent. A label without a source is of all sources of its recording.

    Attributes
    ----------
    path : Path
    rows : tuple of Note

    Raises
    ------
    FormatError : another header, or an invalid value (names the line)
    FileNotFoundError : no such file

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "labels.csv"
    >>> _ = place.write_text("recording,label,t_us\nwalk,contact,400\nwalk,lift,900\nrun,contact,100\n")
    >>> labels = Labels(place)
    >>> labels.recordings
    ('run', 'walk')
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        place = Path(checked_path("path", path))
        table = HeaderTable.read(place, text_of(place))
        table.has(_WANTED, _OTHERS)
        rows = [_row(f"{place}, line {line}", cells) for line, cells in table]
        self.path, self.rows = place, tuple(rows)

    @property
    def recordings(self) -> tuple[str, ...]:
        """The names of the recordings, in order; empty if the table is of one recording."""
        return tuple(sorted({row.recording for row in self.rows} - {""}))

    def named(self, recording: str | os.PathLike[str]) -> str | None:
        """Return the table's name of a recording: its path, file name or stem; None if the table does not name it.

        Parameters
        ----------
        recording : path

        Raises
        ------
        ProblemError : `recording` is not a path
        """
        place = Path(checked_path("recording", recording))
        names = {row.recording for row in self.rows}
        return next((name for name in ("", str(recording), place.name, place.stem) if name in names), None)

    def of(self, recording: Recorded) -> dict[str, NDArray[np.int64]]:
        """Return the events of a `taxel.Recording` by label, us on its own clock; empty if the table does not name it.

        A recording that began in mid-stream counts from its first stamp, which lies a whole number of wraps of the
        board's clock (6.5536 s each) behind the board's time. The number follows from the host's time if both have it.

        Parameters
        ----------
        recording : Recording

        Returns
        -------
        dict from str to int64, shape (events,), us

        Raises
        ------
        ProblemError : an event whose times by host and board contradict this recording
        """
        # The class is checked, not the attribute: reading the clock may take long.
        if isinstance(recording, type) or not (hasattr(recording, "path") and hasattr(type(recording), "clock")):
            raise ProblemError(f"recording is {shown(recording)}: must be a taxel.Recording")
        return self._of(recording.path, lambda: recording.clock, getattr(recording, "label", ""))

    def _of(self, path: Path, clock_of: Callable[[], Clock | None], source: str) -> dict[str, NDArray[np.int64]]:
        """Return the events of a source of the recording at this path; its clock is read only if it is needed."""
        name = self.named(path)
        rows = [row for row in self.rows if row.recording == name and row.source in ("", source)]
        clock = clock_of() if any(row.at_ns for row in rows) else None
        by_label: dict[str, list[int]] = {}
        for row in rows:
            ahead = ahead_us(row, path, clock, self.path)
            by_label.setdefault(row.text, []).append((row.t or 0) - ahead)
        return {label: np.sort(np.array(times, np.int64)) for label, times in by_label.items()}

    def __repr__(self) -> str:
        recordings = ", ".join(self.recordings) or "one recording"
        return f"Labels({counted(len(self.rows), 'event')} of {recordings}, {self.path})"


def ahead_us(row: Note, recording: Path, clock: Clock | None, table: Path) -> int:
    """Return how far a board is ahead of a recording's time, us, in whole wraps of its clock; 0 if unknown.

    Raises
    ------
    ProblemError : the times by host and board contradict this recording
    """
    if not row.at_ns or row.t is None or clock is None or not len(clock.board_us):
        return 0
    turns = (row.t - clock.board_us_at(row.at_ns)) / TURN_US
    if abs(turns - round(turns)) > 0.25:
        raise ProblemError(
            f"{table}: {row.text} at {row.t} us and {row.at_ns} ns is of another run than "
            f"{recording}: board's and host's time do not fit together"
        )
    return int(round(turns) * TURN_US)


def beside(recording: str | os.PathLike[str]) -> Path:
    """Return the path of the labels that people set on a recording: `walk.notes.csv` for `walk.mcap`.

    Examples
    --------
    >>> beside("walk.mcap").name
    'walk.notes.csv'
    """
    place = Path(checked_path("recording", recording))
    return place.with_name(f"{place.stem}.notes.csv")


def write_labels(path: str | os.PathLike[str], labels: Iterable[tuple[str, int] | tuple[str, int, str]]) -> None:
    r"""Write a table `label,t_us` in the order of time; an existing one is replaced atomically.

    Parameters
    ----------
    path : path
    labels : iterable of (label, us) or (label, us, source)
        The table has a column `source` if any label has one that is not "".

    Raises
    ------
    OSError : the disk is full, the table is write-protected

    Examples
    --------
    >>> import tempfile
    >>> place = Path(tempfile.mkdtemp()) / "walk.notes.csv"
    >>> write_labels(place, [("lift", 900), ("contact", 400)])
    >>> place.read_text()
    'label,t_us\ncontact,400\nlift,900\n'
    """
    rows: list[tuple[Any, ...]] = sorted(labels, key=lambda row: row[1])
    of_sources = any(row[2:] > ("",) for row in rows)
    columns = (*_WANTED, "source") if of_sources else _WANTED
    with whole_file(path, overwrite=True) as part, part.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        table.writerows([(*row, "")[: len(columns)] for row in rows])


def _row(place: str, cells: Mapping[str, str]) -> Note:
    values = {name: cell.strip() for name, cell in cells.items()}
    times: dict[str, int] = {}
    for name in ("t_us", "host_ns"):
        written = values.get(name, "")
        if not written and name == "host_ns":
            continue
        try:
            times[name] = int(written)
        except ValueError:
            raise FormatError(f"{place}: {name} is {shown(written)}; must be whole {name[-2:]}") from None
    if not values["label"] or not -(2**52) <= times["t_us"] <= 2**52:
        raise FormatError(f"{place}: must name a label, and a time within 2^52 us")
    if not 0 <= times.get("host_ns", 0) < 2**63:
        raise FormatError(f"{place}: host_ns must be ns since 1970")
    named = values.get("recording", ""), values.get("source", "")
    return Note(values["label"], times["t_us"], times.get("host_ns", 0), *named)
