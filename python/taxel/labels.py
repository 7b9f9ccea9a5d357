"""Notes and labels: reference events that people wrote down with their times, and tables of them."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import checked_path, shown, text
from taxel._base.errors import refused, unreadable
from taxel._base.files import beside as beside_file
from taxel._base.files import named
from taxel._base.header_table import HeaderTable, separator_of, text_of
from taxel._base.messages import counted, escaped
from taxel._base.times import SINCE_1970_US
from taxel._core import ProblemError
from taxel._event_table import are_of_bids, is_of_track, track, with_known_columns
from taxel.clock import Clock
from taxel.recorded import Recorded

__all__ = [
    "TURN_US",
    "Labels",
    "Note",
    "ahead_us",
    "beside",
    "by_clock",
    "by_label",
    "is_from_beginning",
    "rows_of",
    "source_of",
    "text_with",
    "trial_of",
]

#: The period after which the board's 16-bit clock of 100 us wraps, us.
TURN_US = 6_553_600

#: The columns of a table, and those that it may have.
_WANTED, _KNOWN = ("label", "t_us"), ("source", "recording", "replaces_us", "host_ns")

#: The columns of times by the board's clock, us.
_TIMES = ("t_us", "replaces_us")


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
        In a table of several recordings (`Labels`) the path, name or stem of the file, or the name of a trial of a file
        with several; else "".
    source : str
        The source of the recording that the event belongs to, for example "left"; "" for all sources.
    replaces : int, us, optional
        Time of the recording's own note that a label replaces; the note then no longer counts.
    lasts : int, us
        How long what it labels lasts, by the columns `stop_us` or `duration` (s); 0 where that is not stated.
    others : tuple of (str, str)
        The columns of its table that taxel does not know, such as `comment`, and their texts.

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
    replaces: int | None = field(default=None, repr=False)
    lasts: int = field(default=0, repr=False)
    others: tuple[tuple[str, str], ...] = field(default=(), repr=False)


def by_label(rows: Iterable[Note]) -> dict[str, NDArray[np.int64]]:
    """Return the times of labels by what they say, us, ascending."""
    times: dict[str, list[int]] = {}
    for row in rows:
        times.setdefault(row.text, []).append(row.t or 0)
    return {label: np.sort(np.array(each, np.int64)) for label, each in times.items()}


class Labels:
    r"""Hold reference events of one recording or several, read from a table.

    Parameters
    ----------
    path : path
        A CSV ``recording,source,label,t_us,host_ns,replaces_us``, with its columns in any order, separated by commas,
        semicolons or tabs; all except `label` and `t_us` may be absent. A label without a source belongs to all sources
        of its recording. A source that was a topic of a ROS bag may have the topic's name; a source of a known side may
        have the name of the side, left or right. A row with `replaces_us` replaces the recording's own note of that
        time; if it has no label, it removes that note. Other columns are kept (`Note.others`). An empty text has no
        labels. Tables of other programs are read too: with times in ms or s (`t_ms`, `t_s`), those of BIDS (`onset`,
        `duration`, `trial_type`) and label tracks of Audacity. Times of the last two count from the beginning of the
        recording, and so does a time before 2001 where the clock of the recording counts from 1970; a label is at the
        begin of its region.

    Attributes
    ----------
    path : Path
    rows : tuple of Note
    removed : tuple of Note
        The rows without a label, each with the time of a note that no longer counts.

    Raises
    ------
    FormatError : a column is missing, or an invalid value (names the line)
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
        file = Path(checked_path("path", path))
        #: The names of the columns as the file has them, and whether times count from the recording's beginning.
        self._columns, table, self._from_beginning = _table(file)
        rows = _rows(table)
        self.path, self.rows = file, tuple(row for row in rows if row.text)
        self.removed = tuple(row for row in rows if not row.text)

    def _with(self, path: Path, rows: Iterable[Note]) -> Labels:
        """Return other labels, of several tables, by the times of their recordings; `path` names the tables."""
        labels = copy(self)
        labels.path, labels.rows, labels.removed, labels._from_beginning = path, tuple(rows), (), False
        return labels

    @property
    def recordings(self) -> tuple[str, ...]:
        """The names of the recordings, in order; empty if the table is of one recording."""
        return tuple(sorted({row.recording for row in self.rows} - {""}))

    def named(self, recording: str | os.PathLike[str], trial: str = "", source: str = "") -> str | None:
        """Return the table's name of a recording: its path, file name or stem; None if the table does not name it.

        Parameters
        ----------
        recording : path
        trial : str
            In a file with several trials, the name of a trial, which the table may have instead.
        source : str
            In a recording with several sources, the name of a source, which the table may have after any of these.

        Raises
        ------
        ProblemError : `recording` is not a path, or `trial` or `source` is not a text
        """
        text("trial", trial)
        text("source", source)
        file = Path(checked_path("recording", recording))
        names = {row.recording for row in (*self.rows, *self.removed)}
        possible = (trial, "", str(recording), file.name, file.stem)
        of_source = [f"{name} {source}" for name in possible if name] if source else []
        return next((name for name in (*of_source, *possible) if name in names), None)

    def times(self, recording: Recorded) -> dict[str, NDArray[np.int64]]:
        """Return the events of a `taxel.Recording` by label, us on its clock; empty if the table does not name it.

        A recording that began in mid-stream counts from its first stamp, which is a whole number of wraps of the
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
            raise refused("recording", f" is {shown(recording)}: must be a taxel.Recording")
        source = getattr(recording, "label", "")
        trial = trial_of(getattr(recording, "name", ""), source)
        side = getattr(recording, "side", "")

        def begin_us() -> int:
            t = recording.events.t if recording.has_events else recording.frames().t
            return int(t.min()) if len(t) else 0

        return by_label(self._of(recording.path, source, trial, side, begin_us, lambda: recording.clock))

    def _of(
        self,
        path: Path,
        source: str,
        trial: str,
        side: str,
        begin_us: Callable[[], int],
        clock_of: Callable[[], Clock | None],
    ) -> list[Note]:
        """Return the labels of a source of the recording at this path, by its clock."""
        rows = self._rows(path, source, trial, side, begin_us)
        clock = clock_of() if any(row.at_ns for row in rows) else None
        return [replace(row, t=(row.t or 0) - ahead_us(row, path, clock, self.path)) for row in rows]

    def _rows(
        self,
        path: Path,
        source: str,
        trial: str,
        side: str,
        begin_us: Callable[[], int],
        among: Sequence[Note] | None = None,
    ) -> list[Note]:
        """Return the labels of a source of a recording, or of its trial: those of all of the file, and its own.

        Their times are the recording's clock's. Labels may name a source by the foot or hand that it is of.
        """
        rows = self.rows if among is None else among
        is_file = trial in ("", path.name, path.stem)
        names = {self.named(path), self.named(path, "" if is_file else trial, source), None if is_file else trial} - {
            None
        }
        found = [row for row in rows if row.recording in names and row.source in ("", source, side)]
        if not found:
            return []
        begin = begin_us()
        return [by_clock(row, begin, stated=self._from_beginning) for row in found]

    def _replaced(self, path: Path, source: str, trial: str, side: str, begin_us: Callable[[], int]) -> set[int | None]:
        """Return the times of the notes of a source of a recording that its labels replace."""
        rows = self._rows(path, source, trial, side, begin_us, (*self.rows, *self.removed))
        return {row.replaces for row in rows} - {None}

    def __repr__(self) -> str:
        recordings = ", ".join(self.recordings) or "one recording"
        return escaped(f"Labels({counted(len(self.rows), 'event')} of {recordings}, {self.path})")


def trial_of(name: str, source: str) -> str:
    """Return the name of a trial from that of its recording, which ends with its source where it is of one foot."""
    return name.removesuffix(f" {source}") if source else name


def source_of(topic: str) -> str:
    """Return the name of the source that a topic of a ROS bag becomes.

    Examples
    --------
    >>> source_of("/palm/left")
    'palm_left'
    """
    # Names that a source in a .mcap may have.
    return re.sub("[^A-Za-z0-9_-]", "_", topic.strip("/"))[-64:]


def is_from_beginning(t_us: int, begin_us: int, *, stated: bool = False) -> bool:
    """Return whether a time in a table of labels counts from the beginning of its recording; else it is its clock's.

    A clock that counts from 1970 has no time before 2001: such a time counts from the beginning. With another clock
    times count from the beginning only where the format of their table states it.

    Parameters
    ----------
    t_us : int, us
    begin_us : int, us
        The first time of the recording, by its clock.
    stated : bool
        Whether the format of the table counts from the beginning (BIDS, label tracks of Audacity).

    Examples
    --------
    >>> is_from_beginning(210_000, 1_741_947_667_480_000), is_from_beginning(210_000, 40_000_000)
    (True, False)
    """
    return stated or t_us < SINCE_1970_US <= begin_us


def by_clock(row: Note, begin_us: int, *, stated: bool = False) -> Note:
    """Return a row of a table of labels with its times by the recording's clock (`is_from_beginning`)."""

    def moved(t: int | None) -> int | None:
        return None if t is None else t + begin_us * is_from_beginning(t, begin_us, stated=stated)

    return replace(row, t=moved(row.t), replaces=moved(row.replaces))


def ahead_us(row: Note, recording: Path, clock: Clock | None, table: Path) -> int:
    """Return how far a board is ahead of a recording's time, us, in whole wraps of its clock; 0 if unknown.

    Raises
    ------
    ProblemError : the times by host and board contradict this recording
    """
    if not row.at_ns or row.t is None or clock is None or not len(clock.board_us):
        return 0
    turns = (row.t - clock._about_us(row.at_ns)) / TURN_US
    if abs(turns - round(turns)) > 0.25:
        raise ProblemError(
            f"{table}: {row.text} at {row.t} us and {row.at_ns} ns is from another run than "
            f"{recording}: the board's time and the host's time do not match"
        )
    return int(round(turns) * TURN_US)


def beside(recording: str | os.PathLike[str]) -> Path:
    """Return the path of the labels that people set on a recording: `walk.notes.csv` for `walk.mcap`.

    Examples
    --------
    >>> beside("walk.mcap").name
    'walk.notes.csv'
    """
    file = Path(checked_path("recording", recording))
    return beside_file(file, f"{named(file).stem}.notes.csv")


def rows_of(location: str | Path, lines: Iterable[str]) -> tuple[tuple[Note, ...], tuple[str, ...]]:
    """Return the rows of a table of labels, those without a label too, and the names of its columns in their order.

    Parameters
    ----------
    location : str or Path
        The name of the table in errors.
    lines : iterable of str
        With their ends.

    Raises
    ------
    FormatError : a column is missing, or an invalid value (names the line)

    Examples
    --------
    >>> rows, columns = rows_of("a.csv", ["t_us,label,comment", "400,heel,late"])
    >>> rows[0].t, columns
    (400, ('t_us', 'label', 'comment'))
    """
    table = HeaderTable.read(location, lines)
    return _rows(table), table.header


def _table(file: Path) -> tuple[tuple[str, ...], HeaderTable, bool]:
    """Return the columns of a table, it in columns of taxel, and whether its times count from the beginning.

    A table may be in Windows-1252, or in a sheet, too.
    """
    lines = text_of(file)
    names = next((line for line in lines if line.strip()), "")
    if is_of_track(names):
        table = track(str(file), lines)
        return table.header, table, True
    table = HeaderTable.read(file, lines)
    return table.header, with_known_columns(table, separator_of(names)), are_of_bids(table.header)


def _rows(table: HeaderTable) -> tuple[Note, ...]:
    if not table.header:
        # An editor empties a table before it writes it.
        return ()
    table.has(_WANTED)
    return tuple(_row(table.location, line, cells) for line, cells in table)


def text_with(rows: Iterable[Note], columns: Iterable[str] = (), end: str = "\n", separator: str = ",") -> str:
    r"""Return the text of a table with these rows, in the order of time.

    Parameters
    ----------
    rows : iterable of Note
    columns : iterable of str
        The columns of the table so far, which keep their order, also where no row has them: another program may append
        rows by it. New ones follow.
    end : str
        What ends a line.
    separator : str
        Between cells.

    Examples
    --------
    >>> text_with([Note("lift", 900), Note("contact", 400, source="left")], ["t_us", "label"])
    't_us,label,source\n400,contact,left\n900,lift,\n'
    """
    cells = [
        {
            **dict(row.others),
            "label": row.text,
            "t_us": row.t,
            "source": row.source,
            "recording": row.recording,
            "replaces_us": row.replaces,
            "host_ns": row.at_ns or None,
        }
        for row in sorted(rows, key=lambda row: row.t or 0)
    ]
    kept = [name for name in _KNOWN if any(row[name] not in ("", None) for row in cells)]
    others = [name for row in cells for name in row if name not in (*_WANTED, *_KNOWN)]
    there = list(columns)
    header = [*there, *(name for name in dict.fromkeys([*_WANTED, *kept, *others]) if name not in there)]
    text = io.StringIO(newline="")
    table = csv.writer(text, lineterminator=end, delimiter=separator)
    table.writerow(header)
    table.writerows([[row.get(name, "") for name in header] for row in cells])
    return text.getvalue()


def _row(location: str, line: int, cells: Mapping[str, str]) -> Note:
    values = {name: cell.strip() for name, cell in cells.items()}
    times: dict[str, int] = {}
    for name in ("t_us", "host_ns", "replaces_us"):
        written = values.get(name, "")
        if not written and name != "t_us":
            continue
        try:
            times[name] = int(written)
        except ValueError:
            raise unreadable(f"{name} is {shown(written)}; must be whole {name[-2:]}", location, line=line) from None
    replaces = times.get("replaces_us")
    if not (values["label"] or replaces is not None) or any(abs(times.get(name, 0)) > 2**52 for name in _TIMES):
        raise unreadable("must have a label, and a time within 2^52 us", location, line=line)
    if not 0 <= times.get("host_ns", 0) < 2**63:
        raise unreadable("host_ns must be ns since 1970", location, line=line)
    source = values.get("source", "")
    named = values.get("recording", ""), source_of(source) if source.startswith("/") else source
    others = tuple((name, cell) for name, cell in cells.items() if name not in (*_WANTED, *_KNOWN))
    lasts = _lasts(values, times["t_us"])
    return Note(values["label"], times["t_us"], times.get("host_ns", 0), *named, replaces, lasts, others)


def _lasts(values: Mapping[str, str], begin_us: int) -> int:
    """Return how long a label lasts, us; 0 where no end is stated."""
    try:
        stop = float(values.get("stop_us") or begin_us + 1e6 * float(values.get("duration") or 0.0))
    except ValueError:
        return 0
    return round(stop) - begin_us if begin_us < stop < np.inf else 0
