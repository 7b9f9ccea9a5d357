"""Frames of lines of numbers as they arrive, and the lines that are in none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import counted
from taxel._base.text_lines import ArrivedLine
from taxel._core import ProblemError
from taxel.array import Array
from taxel.formats.form import Form
from taxel.formats.lines import is_number, last_number
from taxel.formats.times import UNITS_US

__all__ = ["LineFrames", "PassedLines", "array_of", "row_of"]

#: Length of the first line of a kind, as it is kept, characters.
_SHOWN = 40
#: An array that is not square has at most so many times as many columns as rows.
_FLATTEST = 3


@dataclass
class PassedLines:
    """Hold what lines gave since they were passed on."""

    arrived_ns: list[int] = field(default_factory=list)
    stamps: list[float] = field(default_factory=list)
    values: list[Sequence[float]] = field(default_factory=list)
    lines: int = 0
    strange: int = 0
    unread: list[tuple[int, str]] = field(default_factory=list)
    unfinished: int = 0
    trouble: str | None = None

    def arrays(self, turned: float | None) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Return arrivals, stamps and all values one after the other, those of readings that fall turned."""
        values = np.array(self.values, np.float64).reshape(-1)
        if turned is not None:
            values = (np.float32(turned) - values.astype(np.float32)).astype(np.float64)
        return np.array(self.arrived_ns, np.int64), np.array(self.stamps, np.float64), values


class LineFrames:
    """Make frames of lines as they arrive, and count what is in none.

    Parameters
    ----------
    form : Form
    size : int
        Number of values of a frame.
    stamp_us : float, us
        The unit of the stamps that are passed on.

    Attributes
    ----------
    unread : dict
        By kind the number of lines that are in no frame, and the beginning of the first.
    """

    def __init__(self, form: Form, size: int, *, stamp_us: float = 1.0) -> None:
        self.form = form
        # A counter that wraps is known by its whole numbers: in its own unit they stay as they are.
        self._clocks = tuple((k, unit / stamp_us) for k, unit in form.clocks)
        #: The unit of times in lines that begin frames, 0 without them.
        self._begin_unit = 0.0 if form.table.frame_time is None else UNITS_US[form.table.frame_time] / stamp_us
        #: Number of values of a frame.
        self.size = size
        self._takes_all = form.taxels == tuple(range(len(form.names)))
        self.passed = PassedLines()
        self.unread: dict[str, dict[str, Any]] = {}
        #: The lines of the frame so far, their values, its stamp.
        self._open: list[ArrivedLine] = []
        self._values: list[float] = []
        self._stamp = 0.0
        self._last_stamp: float | None = None
        # Whether the end of a frame was seen since reading began, so that the next one has its beginning.
        self._is_whole = False
        self._was_interrupted = False
        # Whether numbers came since: text before them, as a board prints when it starts, is no fault.
        self._has_begun = False

    def take_passed(self) -> PassedLines:
        """Return what lines gave since the last call."""
        passed, self.passed = self.passed, PassedLines()
        return passed

    def fits(self, text: str) -> bool:
        """Return whether a line has the numbers of a frame's."""
        return not self.form.values(text)[1]

    def push(self, line: ArrivedLine) -> None:
        """Take the next line."""
        text, begin = line.text.strip(), self.form.table.frame_begin
        if begin is not None and text.startswith(begin):
            self._end_at_text()
            self._stamp = self._begin_unit * last_number(text)
            return
        if not text:
            if self.form.table.frame_end:
                self._end_at_text()
            return
        if text.startswith("#"):
            return
        values, odd = self.form.values(text)
        if odd and not self._open and self._names_columns(text):
            return
        self.passed.lines += 1
        if odd or line.is_cut or not line.is_text:
            self._count_odd(line, text)
            self._discard()
            return
        self._push(values, line)

    def push_values(self, values: Sequence[float], at_ns: int) -> None:
        """Take the numbers of a line that a program passes.

        Raises
        ------
        ProblemError : another number of them
        """
        if len(values) != len(self.form.names):
            raise ProblemError(f"{counted(len(values), 'value')}: must be {len(self.form.names)}")
        self.passed.lines += 1
        self._push(values, ArrivedLine("", at_ns))

    def end(self) -> None:
        """End the last frame, which no empty line may follow."""
        if self.form.table.frame_end:
            self._end_at_text()

    def restart(self) -> None:
        """Handle an interruption: the next line begins a frame."""
        self._discard()
        self._is_whole, self._was_interrupted, self._has_begun = False, True, False

    def _push(self, values: Sequence[float], line: ArrivedLine) -> None:
        self._has_begun = True
        row = values if self._takes_all else [values[k] for k in self.form.taxels]
        if self.form.lines == 1:
            self._stamp = sum(values[k] * scale for k, scale in self._clocks)
            self._end_frame(row, line.at_ns)
            return
        if not self._open and self._clocks:
            self._stamp = sum(values[k] * scale for k, scale in self._clocks)
        self._open.append(line)
        self._values += row
        if self.form.table.frame_end:
            if len(self._values) > self.size:
                self._discard()
        elif len(self._values) == self.size:
            self._end_open()

    def _end_open(self) -> None:
        values, at_ns = self._values, self._open[0].at_ns
        self._open, self._values, self._is_whole = [], [], True
        self._end_frame(values, at_ns)

    def _end_at_text(self) -> None:
        """End a frame at an empty line, or at one of text; lines of one that lacks some are counted."""
        if self._open and len(self._values) == self.size:
            self._end_open()
            return
        self._discard()
        self._is_whole = True

    def _end_frame(self, values: Sequence[float], at_ns: int) -> None:
        passed = self.passed
        if self._clocks or self._begin_unit:
            stamp = self._stamp
            if self._last_stamp is not None and stamp <= self._last_stamp:
                columns = "+".join(str(k + 1) for k, _ in self.form.clocks)
                where = f"column {columns}" if columns else f"a line {self.form.table.frame_begin}"
                self._count("repeated_stamps", f"{stamp:.17g} in {where}")
            self._last_stamp = stamp
            passed.stamps.append(stamp)
        passed.arrived_ns.append(at_ns)
        passed.values.append(values)

    def _discard(self) -> None:
        """Leave out an unfinished frame. One that was under way when reading began lost nothing."""
        lines, self._open, self._values = self._open, [], []
        if not lines:
            return
        if self._is_whole:
            self._count("unfinished_frames", "", len(lines))
            self.passed.strange += len(lines)
        elif self._was_interrupted:
            self.passed.unfinished += sum(line.size for line in lines)
        self.passed.unread += [(line.at_ns, line.text) for line in lines]

    def _count_odd(self, line: ArrivedLine, text: str) -> None:
        """Count a line that is no part of a frame."""
        cells, _ = self.form.cells(text)
        numbers = bool(cells) and all(is_number(cell, self.form.table.decimal) for cell in cells)
        self._count("no_text" if not line.is_text else "other_length" if numbers else "text", text)
        # Text before the first numbers is no fault.
        self.passed.strange += self._has_begun or numbers
        self.passed.unread.append((line.at_ns, line.text))

    def _count(self, kind: str, text: str, lines: int = 1) -> None:
        found = self.unread.setdefault(kind, {"lines": 0, "first": text[:_SHOWN]})
        found["lines"] += lines

    def _names_columns(self, text: str) -> bool:
        cells, odd = self.form.cells(text)
        return odd == "of text" and tuple(cells) == self.form.names


def row_of(form: Form, name: str) -> tuple[Array, tuple[str, ...]]:
    """Return the row that lines of quantities fill, as of an IMU, and the names of its columns."""
    return Array(1, len(form.taxels), name=name), tuple(form.names[k] or f"column_{k}" for k in form.taxels)


def array_of(form: Form, stated: Array | None, readout: Array | None, name: str) -> tuple[Array, tuple[str, ...], str]:
    """Return the sensor of frames: the stated one, that of the readout if lines fill it, or one that is guessed.

    Returns
    -------
    array : Array
    names : tuple of str
        Of its columns, if each is a quantity of its own.
    guess : str
        What was guessed, for people; "" if nothing.

    Raises
    ------
    ProblemError : lines do not fill the stated array
    """
    count, lines = len(form.taxels), form.lines
    if stated is not None:
        _check_filled(form, stated)
        return stated, (), ""
    if not lines:
        key = "frame_begin" if form.table.frame_begin else "frame_end=blank"
        raise ProblemError(f"{key}: add array=ROWSxCOLUMNS")
    if readout is not None and readout.taxels == lines * count:
        return readout, (), ""
    if lines > 1:
        rows, columns = lines, count
    elif all(form.names[k] for k in form.taxels):
        return *row_of(form, name), f"array=1x{count}, a column each"
    else:
        rows, columns = _sides(count)
    return Array(rows, columns, name=name), (), f"array={rows}x{columns} is guessed"


def _check_filled(form: Form, array: Array) -> None:
    """Refuse lines that do not fill an array: with whole rows, or even parts of one."""
    n, frame, row = len(form.taxels), array.taxels, array.columns
    size = f"array={array.rows}x{array.columns}: lines have {counted(n, 'value')}"
    if form.lines > 1:
        size += f", {form.lines} lines per frame"
    if form.table.frame_end:
        size += ", an empty line after each frame"
    fits = form.lines * n == frame if form.lines else frame % n == 0
    if not fits:
        several = frame // n
        advice = ""
        if form.lines == 1 and several > 1 and several * n == frame:
            advice = f" (or add frame_lines={several}; or add frame_end=blank if an empty line ends each frame)"
        elif several == 0:
            advice = (
                " (state which column contains times, for example time=1:ms, and which columns are not readings, for "
                "example leave_out=1)"
            )
        raise ProblemError(f"{size}: must be {frame} per frame{advice}")
    if n % row and row % n:
        turned = f": is it array={array.columns}x{array.rows}?" * (n == array.rows)
        raise ProblemError(f"{size}: must be rows of {row}{turned}")


def _sides(values: int) -> tuple[int, int]:
    """Return rows and columns of so many values: as square as possible, or one row."""
    rows = next(rows for rows in range(int(values**0.5), 0, -1) if values % rows == 0)
    return (1, values) if values > _FLATTEST * rows * rows else (rows, values // rows)
