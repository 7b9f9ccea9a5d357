"""Lines of numbers of a live source: read as they arrive, understood as tables are, passed on as frames."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.limits import VALUE
from taxel._base.messages import counted, first_line
from taxel._base.text_lines import ArrivedLine
from taxel._core import Error, ProblemError, now_ns
from taxel.array import Array
from taxel.formats.form import Form
from taxel.formats.line_form import form_of_lines, stated_count
from taxel.formats.lines import is_number
from taxel.formats.times import FOUND_US, ISO, UNITS_US
from taxel.live.line_frames import LineFrames, array_of, row_of
from taxel.live.line_input import LineInput
from taxel.live.stated_source import StatedSource

__all__ = ["Lines", "preview"]

#: So many lines show what they are, or those of so long after the first, s.
_LINES, _MEASURE_S = 33, 1.0
#: How long the columns may be unknown after the first line, and the lines that are kept then.
_WITHIN_S, _KEPT = 3.0, 256
#: So many stamps show their unit.
_FEW = 5
_BETWEEN = re.compile(r"[,;\s]+")


class Lines:
    """Read a source of lines of numbers, or what a program passes.

    Parameters
    ----------
    stated : StatedSource
    is_read_out : bool
        Whether it is the source that is read out and shown; another one is a row of quantities, as of an IMU, if it is
        not stated to be a sensor.
    readout : Array, optional
        The sensor of the readout.

    Raises
    ------
    OSError : it cannot be opened
    ProblemError : it is not a place of lines
    """

    def __init__(self, stated: StatedSource, *, is_read_out: bool, readout: Array | None = None) -> None:
        self.stated, self.name = stated, stated.called
        self._is_row = not (is_read_out or stated.are_frames)
        self._readout = readout
        self._input = None
        if stated.kind == "lines":
            baud = stated.printed.baud
            self._input = LineInput(stated.place if baud is None else f"{stated.place},baud={baud}")
        self.place = "given by a program" if self._input is None else self._input.place
        self.array = stated.array
        self.names: tuple[str, ...] = ()
        self.frame_us = 0.0 if stated.rate_hz is None else 1e6 / stated.rate_hz
        self.waited = self._input is not None and self._input.is_file
        self.form: Form | None = None
        #: How the lines are read, for people.
        self.read_as = ""
        self._frames: LineFrames | None = None
        #: As is stated, before lines have shown their separators.
        self._declared: LineFrames | None = None
        self._waiting: list[ArrivedLine] = []
        #: Bytes in no line, and of unfinished lines, since they were passed on.
        self._left_out = [0, 0]
        #: A first line that may lack its beginning, and whether that is a loss.
        self._cut: tuple[ArrivedLine, bool] | None = None
        self._has_ended = False
        #: Why reading fails, and why it is not clear what the lines are.
        self._trouble: str | None = None
        self._unclear: str | None = None
        self._sink: Callable[..., object] | None = None
        self._thread: threading.Thread | None = None
        self._ends = threading.Event()
        #: Whether reading goes on after its end, so that the line that has begun is not over.
        self._goes_on = False
        #: Whether it has a place that is open.
        self.is_open = self._input is not None
        _, _, unit = (stated.printed.time or "").partition(":")
        #: The unit of the stamps that are passed on.
        self._stamp_us = UNITS_US["s" if unit == ISO else unit] if unit in (*UNITS_US, ISO) else 1.0
        self.failed: Error | OSError | None = None
        self._given = threading.Lock()

    # ------------------------------------------------------------------------------------------- what the lines are

    def find(self, most_s: float) -> None:
        """Find out how the lines are read. What is stated whole need not have sent anything.

        Parameters
        ----------
        most_s : float, s
            How long to wait for the first line.

        Raises
        ------
        ProblemError : nothing came, or lines that are not what is stated, or that can be read in two ways
        """
        if self._input is None:
            self._of_program()
            return
        printed = self.stated.printed
        count = stated_count(printed, self.array.taxels if self.array is not None else None)
        columns = [*map(str, printed.leave_out), *(printed.time or "1").partition(":")[0].split("+")]
        # The names of columns come with the lines.
        is_named = not printed.columns and not all(map(str.isdecimal, columns))
        is_stated = (
            count is not None and not is_named and (self._is_row or (self.array is not None and self.frame_us > 0.0))
        )
        if is_stated:
            self._declared = self._of_statement()
        begun, first = time.monotonic(), None
        while True:
            beyond = self._left_out[0]
            self._read()
            now = time.monotonic()
            # What cannot be a line of numbers is waited out.
            begun = now if self._left_out[0] > beyond else begun
            first = now if first is None and self._texts() else first
            since = 0.0 if first is None else now - first
            enough = len(self._numbers()) >= _LINES or since >= _MEASURE_S or self._has_ended
            if first is not None and (enough or is_stated) and self._understood(final=False):
                return
            if is_stated and (first is None or not self._numbers()):
                # The first lines that come will show it.
                return
            if first is None and (self._has_ended or now - begun >= most_s):
                within = "before the end" if self._has_ended else f"within {now - begun:.0f} s"
                self._input.lines.discard()
                self._leave_out()
                size = sum(self._left_out) + sum(line.size for line in self._waiting)
                came = f"{counted(size, 'byte')} arrived {within}, but no line of text that ends"
                raise ProblemError(f"{self.place}: {came if size else f'no line arrived {within}'}")
            if first is not None and (since >= _WITHIN_S or self._has_ended):
                self._understood(final=True)
                return

    def _of_program(self) -> None:
        """Take what is stated for what a program passes."""
        if not self._is_row and self.stated.rate_hz is None:
            raise ProblemError(
                f"source {self.stated.text!r}: rate=HZ is missing: it states how many frames per second the program "
                "passes"
            )
        self._frames = self._of_statement()

    def _of_statement(self) -> LineFrames:
        """Return frames of lines as they are stated, without any line."""
        printed = self.stated.printed
        size = None if self.array is None else self.array.taxels
        count = stated_count(printed, size)
        if count is None:
            needs = "columns=A:B:C" if self._is_row else "array=ROWSxCOLUMNS or columns=A:B:C"
            raise ProblemError(f"source {self.stated.text!r}: needs {needs}")
        return self._set(self._form_of([",".join(["2"] * count)], None))

    def _texts(self) -> list[ArrivedLine]:
        """Return the lines so far that are text of a length that lines of numbers may have."""
        return [line for line in self._waiting if line.is_text and not line.is_cut]

    def _numbers(self) -> list[ArrivedLine]:
        return [line for line in self._texts() if any(map(str.isdigit, line.text))]

    def _understood(self, *, final: bool) -> bool:
        """Return whether the lines so far show what they are; if they are the last to show it, refuse others."""
        texts = [line.text for line in self._texts()]
        form = self._form_of(texts, self._texts())
        if form is None and final and texts and self._is_row and not self._has_ended:
            # Only the names of columns have arrived.
            separator = next((mark for mark in ";,\t" if mark in texts[-1]), None)
            example = None if separator is None else separator.join("2" * len(texts[-1].split(separator)))
            form = None if example is None else self._form_of([texts[-1], example], None)
        if form is None:
            if final:
                raise ProblemError(f"{self.place}: {self._came()}, but no line contains only numbers")
            return False
        self._frames = self._set(form)
        if self._declared is not None:
            self._frames.unread = self._declared.unread
        if self.frame_us == 0.0 and not self._is_row:
            times = self._times()
            if len(times) < 2:
                self.form, self._frames, self.array = None, None, self.stated.array
                if final:
                    raise ProblemError(f"{self.place}: only 1 frame arrived, so the rate is unknown: add rate=HZ")
                return False
            self.frame_us = float(np.median(np.diff(times))) if form.clocks else _period(times)
        return True

    def _came(self) -> str:
        texts = [line.text for line in self._waiting if line.text.strip()]
        return f"{counted(len(texts), 'line')} arrived ({texts[0][:60]!r} ...)" if texts else "bytes arrived"

    def _form_of(self, texts: Sequence[str], lines: Sequence[ArrivedLine] | None) -> Form | None:
        """Return what lines are; those of a program have no arrivals."""
        at = [] if lines is None else [line.at_ns for line in lines]

        def unit_of(stamps: NDArray[np.float64], numbers: Sequence[int]) -> str:
            """Return the unit in which stamps pass as lines arrive; before any do, it is not used."""
            if lines is None and self._input is not None:
                return "us"
            steps = np.diff(stamps)
            if len(stamps) < _FEW or not at or self.waited or not bool((steps > 0).all()):
                return ""
            passed_s = (at[numbers[-1]] - at[numbers[0]]) * 1e-9
            by_second = (stamps[-1] - stamps[0]) / passed_s if passed_s > 0 else 0.0
            return next((unit for unit, us in FOUND_US.items() if 0.5 <= by_second * us * 1e-6 < 2.0), "")

        size = None if self.array is None or self._is_row else self.array.taxels
        try:
            return form_of_lines(texts, self.stated.printed, size, unit_of, are_taxels=not self._is_row)
        except ProblemError as error:
            raise ProblemError(f"source {self.stated.text!r}: {first_line(error)}") from None

    def _set(self, form: Form | None) -> LineFrames:
        """Take a form; return what makes frames by it."""
        if form is None:
            raise ProblemError(f"source {self.stated.text!r}: what it states makes no line of numbers")
        self.form = form
        guess, said = "", list(form.said)
        if self._is_row:
            self.array, self.names = row_of(form, self.name)
        else:
            try:
                self.array, self.names, guess = array_of(form, self.array, self._readout, self.name)
            except ProblemError as error:
                raise ProblemError(f"source {self.stated.text!r}: {first_line(error)}") from None
        said = [guess, *said] if guess else said
        if not form.clocks:
            said.append("a frame's time is when it arrived")
        if guess or not form.clocks:
            rows, columns = self.array.shape
            self.read_as = f"{self.place}: read as {rows} x {columns} taxels: {'; '.join(said)}"
        if self._sink is None:
            self._stamp_us = form.clocks[0][1] if len(form.clocks) == 1 else 1.0
        return LineFrames(form, self.array.taxels, stamp_us=self._stamp_us)

    def _times(self) -> NDArray[np.float64]:
        """Return the times of the frames so far, us."""
        assert self.form is not None
        assert self.array is not None
        frames = LineFrames(self.form, self.array.taxels)
        for line in self._waiting:
            frames.push(line)
        passed = frames.take_passed()
        return np.array(passed.stamps) if self.form.clocks else np.array(passed.arrived_ns) / 1e3

    # ------------------------------------------------------------------------------------------------- what Rust knows

    def source(self, readout_unit: str | None) -> dict[str, Any]:
        """Return the source as the compiled part knows it."""
        return {"name": self.name, "place": self.place, "kind": {"frames": self.layout(readout_unit)}}

    def layout(self, readout_unit: str | None) -> dict[str, Any]:
        """Return what a frame is, as the compiled part knows it."""
        assert self.array is not None
        return {
            "array": self.array._geometry(),
            "unit": self.stated.unit or ("as sent" if self._is_row else readout_unit or "counts"),
            "unit_is_stated": self.stated.unit is not None,
            "names": list(self.names),
            "turned": self.stated.turned,
            "frame_us": self.frame_us or None,
            "stamp_us": self._stamp_us,
            "waited": self.waited,
        }

    # -------------------------------------------------------------------------------------------------------- reading

    def begin(self, sink: Callable[..., object], end: Callable[[str], object]) -> None:
        """Pass lines on in a separate thread, as `_core.Live.lines` takes them, until they end."""
        self._sink = sink
        if (input_ := self._input) is None:
            return
        self._ends.clear()

        def run() -> None:
            try:
                while not self._ends.is_set():
                    self._pass()
                    if self._has_ended:
                        break
                    self._read()
                if not self._goes_on:
                    input_.lines.discard()
                    self._leave_out()
                self._pass()
                # What follows is no silence.
                end(self.name)
            except (Error, OSError) as error:
                self.failed = None if self._ends.is_set() else error

        self._thread = threading.Thread(target=run, name="taxel-lines", daemon=True)
        self._thread.start()

    def sample(self, values: Sequence[float], at_ns: int) -> None:
        """Pass the numbers of a line on, which a program has.

        Raises
        ------
        ProblemError : another number of them, or lines that taxel reads itself
        """
        if self._input is not None:
            raise ProblemError(
                f"source {self.name!r}: taxel reads its lines itself, so a program cannot give it values"
            )
        assert self._frames is not None
        with self._given:
            try:
                self._frames.push_values(values, at_ns)
            except ProblemError as error:
                raise ProblemError(f"source {self.name}: {error}") from None
            self._pass()

    def pause(self) -> None:
        """End reading until `begin`; what was read is passed on, and the place stays open."""
        self._goes_on = True
        self._end()

    def renew(self) -> None:
        """Count from now on what is in no frame."""
        self._goes_on, self.failed = False, None
        self.unread.clear()

    def close(self) -> None:
        """End reading; what was read is passed on, and the place is closed at once."""
        self._end()
        if self._input is not None:
            self._input.close()
            self.is_open = False

    def _end(self) -> None:
        self._ends.set()
        if self._thread is not None:
            self._thread.join()

    @property
    def unread(self) -> dict[str, dict[str, Any]]:
        """The lines that are in no frame, by kind, with the beginning of the first."""
        frames = self._frames or self._declared
        return {} if frames is None else frames.unread

    def _read(self) -> None:
        """Take the lines that arrive within a short time."""
        assert self._input is not None
        lines: list[ArrivedLine] = []
        try:
            lines = self._input.read()
        except OSError as error:
            self._trouble = str(error) if error.strerror is None else f"{error.filename}: {error.strerror}"
            if self._frames is not None:
                self._frames.restart()
        self._leave_out()
        self._has_ended |= self._input.has_ended
        is_lost = self._input.take_cut() if lines else None
        if is_lost is not None:
            # Of a serial line whose form is not known, the rest of a number is a number too.
            if self._input.is_serial and self._frames is None and self._declared is None:
                del lines[0]
            else:
                self._cut = (lines[0], is_lost)
        self._waiting += lines

    def _leave_out(self) -> None:
        """Count the bytes that are in no line."""
        assert self._input is not None
        in_no_line, unfinished = self._input.lines.take_left_out()
        self._left_out = [self._left_out[0] + in_no_line, self._left_out[1] + unfinished]

    def _leave_out_cut(self, frames: LineFrames) -> None:
        """Leave out a first line that is the rest of one: it does not fit, and ends in a number as lines do."""
        if self._cut is None:
            return
        (line, is_lost), self._cut = self._cut, None
        assert self._input is not None
        is_rest = self._input.is_serial or _ends_in_number(line.text)
        if is_rest and line in self._waiting and not frames.fits(line.text):
            self._waiting.remove(line)
            # Where reading began amid a line, nothing was lost.
            self._left_out[1] += line.size * is_lost

    def _pass(self) -> None:
        """Pass on what the lines so far give; while they do not show what they are, they wait."""
        assert self._sink is not None
        if self._frames is None and self._waiting:
            try:
                self._understood(final=False)
                self._unclear = None
            except ProblemError as error:
                self._unclear = str(error)
        frames = self._frames
        if frames is None and (self._ends.is_set() or self._has_ended or not self._numbers()):
            frames = self._declared
        if frames is None:
            del self._waiting[:-_KEPT]
            return
        self._leave_out_cut(frames)
        waiting, self._waiting = self._waiting, []
        for line in waiting:
            frames.push(line)
        if self._has_ended:
            frames.end()
        passed = frames.take_passed()
        in_no_line, unfinished = self._left_out
        self._left_out = [0, 0]
        trouble, self._trouble = self._trouble or self._unclear, None
        arrived_ns, stamps, values = passed.arrays(self.stated.turned)
        self._sink(
            self.name,
            arrived_ns,
            stamps,
            values,
            passed.lines,
            (passed.strange, in_no_line, unfinished + passed.unfinished),
            passed.unread,
            trouble,
            now_ns(),
        )


def _ends_in_number(text: str) -> bool:
    """Return whether the last cell of a line is a number."""
    last = _BETWEEN.split(text.strip(" \t,;"))[-1]
    return is_number(last) and abs(float(last)) <= VALUE


def _period(times: NDArray[np.float64]) -> float:
    """Return the time from one frame to the next by their arrivals, us.

    Lines arrive in packets, and those that waited until they were read arrive at once: it is that from the second
    packet to the last.

    Examples
    --------
    >>> _period(np.array([0.0, 1, 2, 30_000, 40_000, 50_000]))
    10000.0
    """
    end = len(times) - 1
    at_once = (times[-1] - times[0]) / end / 10
    is_apart = np.flatnonzero(np.diff(times) >= at_once)
    first = int(is_apart[0]) + 1 if len(is_apart) and is_apart[0] > 0 else 0
    last = int(is_apart[-1]) + 1 if len(is_apart) else end
    first, last = (first, last) if first < last else (0, end)
    return max(1.0, float(times[last] - times[first]) / (last - first))


def preview(source: str, most_s: float) -> tuple[list[str], str, str]:
    """Return the last lines that arrive from a source, what they seem to be, and the source with that added.

    Parameters
    ----------
    source : str
    most_s : float, s
        How long to read.

    Raises
    ------
    OSError : it cannot be opened
    """
    lines = Lines(StatedSource.of(source), is_read_out=True)
    until = time.monotonic() + most_s
    try:
        while time.monotonic() < until and not lines._has_ended and len(lines._numbers()) < _KEPT:
            lines._read()
    finally:
        lines.close()
    shown = [line.text[:200] for line in lines._waiting][-12:]
    try:
        form = lines._form_of([line.text for line in lines._texts()], lines._texts())
        lines._frames = lines._set(form)
    except ProblemError as error:
        reason = "Nothing arrived: is the sensor connected and switched on?"
        return shown, str(error) if shown else reason, source
    assert lines.array is not None
    assert lines.form is not None
    keys = {"array": f"{lines.array.rows}x{lines.array.columns}"} if lines.stated.array is None else {}
    keys |= dict(lines.form.keys)
    text = ",".join([source, *(f"{key}={value}" for key, value in keys.items())])
    about = f"{counted(len(lines.form.taxels), 'number')} per line: {lines.array.rows} x {lines.array.columns}"
    return shown, "; ".join([about, *lines.form.said]), text
