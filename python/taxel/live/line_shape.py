"""What the lines of a live source are, by what is stated and by the first of them: columns, sensor, time and rate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.messages import counted, first_line, plain
from taxel._base.text_lines import ArrivedLine
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.formats.form import Form
from taxel.formats.line_form import form_of_lines, stated_count
from taxel.formats.parts import KEYS, names_of, sensor_of, sensors_in
from taxel.formats.times import FOUND_US, ISO, UNITS_US
from taxel.live.line_frames import LineFrames, array_of, row_of
from taxel.live.stated_source import StatedSource

__all__ = ["LineShape", "numbers_of", "texts_of"]

#: So many stamps show their unit.
_FEW = 5
#: A frame that lasts so long by its stamps, us, and so many times as long as by arrival, has them in another unit: what
#: is replayed arrives at once too, but is seldom so slow.
_SLOW_US, _OTHER_UNIT = 1e6, 100


class LineShape:
    """What the lines of a source are: each is stated, or shown by the first lines.

    Parameters
    ----------
    stated : StatedSource
    place : str
        Where the lines come from, for people.
    name : str
        That of the source.
    is_row : bool
        Whether they are a row of quantities, as of an IMU, whose rate need not be known; else frames of a sensor.
    waited : bool
        Whether the lines waited in a file, so that their arrival is no time.
    readout : Array, optional
        The sensor of the readout.

    Attributes
    ----------
    array : Array or None
    names : tuple of str
        Of its columns, if each is a quantity of its own.
    frame_us : float, us
        Time from one frame to the next; 0 while it is unknown.
    read_as : str
        How the lines are read, for people.
    """

    def __init__(
        self, stated: StatedSource, place: str, name: str, *, is_row: bool, waited: bool, readout: Array | None
    ) -> None:
        self._stated, self._place, self._name = stated, place, name
        self._is_row, self._waited, self._readout = is_row, waited, readout
        self.array = stated.array
        self.names: tuple[str, ...] = ()
        self.frame_us = 0.0 if stated.rate_hz is None else 1e6 / stated.rate_hz
        self.read_as = ""
        _, _, unit = (stated.printed.time or "").partition(":")
        #: The unit of the stamps that are passed on, which stays once the compiled part knows it.
        self._stamp_us = UNITS_US["s" if unit == ISO else unit] if unit in (*UNITS_US, ISO) else 1.0
        self._is_told = False

    @property
    def is_stated(self) -> bool:
        """Whether all of it is stated, so that no line is needed."""
        printed = self._stated.printed
        columns = [*map(str, printed.leave_out), *(printed.time or "1").partition(":")[0].split("+")]
        # The names of columns come with the lines.
        is_named = not printed.columns and not all(map(str.isdecimal, columns))
        has_rate = self._is_row or (self.array is not None and self.frame_us > 0.0)
        return self._stated_count is not None and not is_named and has_rate

    @property
    def _stated_count(self) -> int | None:
        return stated_count(self._stated.printed, None if self.array is None else self.array.taxels)

    def of_program(self) -> LineFrames:
        """Return frames of what a program passes, as they are stated.

        Raises
        ------
        ProblemError : neither columns nor an array, or no rate of an array's frames
        """
        if not self._is_row and self._stated.rate_hz is None:
            raise self._refused(": rate=HZ is missing: it states how many frames per second the program passes")
        return self.of_statement()

    def of_statement(self) -> LineFrames:
        """Return frames of lines as they are stated, without any line.

        Raises
        ------
        ProblemError : it does not say how many numbers a line has
        """
        count = self._stated_count
        if count is None:
            needs = "columns=A:B:C" if self._is_row else "array=ROWSxCOLUMNS or columns=A:B:C"
            raise self._refused(f": needs {needs}")
        form = self.form_of([",".join(["2"] * count)], None)
        if form is None:
            raise self._refused(": what it states makes no line of numbers")
        return self.take(form)

    def of_lines(self, lines: Sequence[ArrivedLine], *, final: bool, has_ended: bool) -> LineFrames | None:
        """Return frames of lines if the first of them show what they are.

        Parameters
        ----------
        lines : sequence of ArrivedLine
        final : bool
            Whether they are the last to show it: others are refused.
        has_ended : bool
            Whether no more can arrive.

        Raises
        ------
        ProblemError : lines that are not what is stated, or that can be read in two ways
        """
        found = texts_of(lines)
        texts = [line.text for line in found]
        form = self.form_of(texts, found)
        if form is None and final and texts and self._is_row and not has_ended:
            # Only the names of columns have arrived.
            separator = next((mark for mark in ";,\t" if mark in texts[-1]), None)
            example = None if separator is None else separator.join("2" * len(texts[-1].split(separator)))
            form = None if example is None else self.form_of([texts[-1], example], None)
        if form is None:
            if final:
                came = [line.text for line in lines if line.text.strip()]
                shown = f"{counted(len(came), 'line')} arrived ({came[0][:60]!r} ...)" if came else "bytes arrived"
                raise ProblemError(f"{self._place}: {shown}, but no line contains only numbers")
            return None
        frames = self.take(form)
        if self.frame_us == 0.0 and not self._is_row:
            self.frame_us = self._period_of(form, frames.size, lines)
            if self.frame_us == 0.0:
                self.array = self._stated.array
                if final:
                    raise ProblemError(f"{self._place}: only 1 frame arrived, so the rate is unknown: add rate=HZ")
                return None
        return frames

    def _period_of(self, form: Form, size: int, lines: Sequence[ArrivedLine]) -> float:
        """Return the time from one frame to the next, us; 0 if there are too few."""
        frames = LineFrames(form, size)
        for line in lines:
            frames.push(line)
        passed = frames.take_passed()
        if len(passed.arrived_ns) < 2:
            return 0.0
        by_arrival = _period(np.array(passed.arrived_ns) / 1e3)
        if not form.clocks:
            return by_arrival
        by_stamps = float(np.median(np.diff(passed.stamps)))
        times = by_stamps / by_arrival
        if not self._waited and by_stamps >= _SLOW_US and times > _OTHER_UNIT:
            near = form.clocks[0][1] / times
            unit = min(FOUND_US, key=lambda unit: max(FOUND_US[unit] / near, near / FOUND_US[unit]))
            raise self._refused(f": a frame lasts {plain(by_stamps / 1e6)} s: is the unit {unit}? (else add rate=HZ)")
        return by_stamps

    def take(self, form: Form) -> LineFrames:
        """Take a form; return what makes frames by it.

        Raises
        ------
        ProblemError : lines do not fill the stated array
        """
        guess = ""
        if self._is_row:
            self.array, self.names = row_of(form, self._name)
        else:
            try:
                self.array, self.names, guess = array_of(form, self.array, self._readout, self._name)
            except ProblemError as error:
                raise self._refused(f": {first_line(error)}") from None
        if guess or not form.clocks:
            rows, columns = self.array.shape
            self.read_as = (
                f"{self._place}: read as {rows} x {columns} taxels: {'; '.join(filter(None, (guess, *form.said)))}"
            )
        if not self._is_told:
            self._stamp_us = form.clocks[0][1] if len(form.clocks) == 1 else 1.0
        return LineFrames(form, self.array.taxels, stamp_us=self._stamp_us)

    def form_of(self, texts: Sequence[str], lines: Sequence[ArrivedLine] | None) -> Form | None:
        """Return what lines are; those of a program have no arrivals."""
        at = [] if lines is None else [line.at_ns for line in lines]

        def unit_of(stamps: NDArray[np.float64], numbers: Sequence[int]) -> str:
            """Return the unit in which stamps pass as lines arrive; before any do, it is not used."""
            if lines is None and self._stated.kind == "lines":
                return "us"
            steps = np.diff(stamps)
            if len(stamps) < _FEW or not at or self._waited or not bool((steps > 0).all()):
                return ""
            passed_s = (at[numbers[-1]] - at[numbers[0]]) * 1e-9
            by_second = (stamps[-1] - stamps[0]) / passed_s if passed_s > 0 else 0.0
            return next((unit for unit, us in FOUND_US.items() if 0.5 <= by_second * us * 1e-6 < 2.0), "")

        size = None if self.array is None or self._is_row else self.array.taxels
        try:
            return form_of_lines(texts, self._stated.printed, size, unit_of, are_taxels=not self._is_row)
        except (ProblemError, FormatError) as error:
            raise self._refused(f": {first_line(error)}") from None

    def sensors_of(self, texts: Sequence[str]) -> tuple[list[str], Callable[[str], str]] | None:
        """Return the sensors that lines name in turn, and a function of a line that returns its sensor; None of one.

        They are named by the column that is stated as `by`, or by the names before numbers.
        """
        if self._stated.printed.by is None:
            named = sensors_in(texts)
            return ([*named], lambda text: sensor_of(text, named) or " ".join(names_of(text))) if named else None
        form = self.form_of(texts, None)
        if form is None or (k := form.columns.by) is None:
            return None

        def key_of(text: str) -> str:
            cells = form.cells(text)[0]
            return cells[k] if len(cells) == len(form.names) else ""

        return [*dict.fromkeys(filter(None, map(key_of, texts)))][:KEYS], key_of

    def layout(self, readout_unit: str | None) -> dict[str, Any]:
        """Return what a frame is, as the compiled part knows it from now on."""
        assert self.array is not None
        self._is_told = True
        return {
            "array": self.array._geometry(),
            "unit": self._stated.unit or ("as sent" if self._is_row else readout_unit or "counts"),
            "unit_is_stated": self._stated.unit is not None,
            "names": list(self.names),
            "turned": self._stated.turned,
            "frame_us": self.frame_us or None,
            "stamp_us": self._stamp_us,
            "waited": self._waited,
        }

    def _refused(self, why: str) -> ProblemError:
        return ProblemError(f"source {self._stated.text!r}{why}")


def texts_of(lines: Sequence[ArrivedLine]) -> list[ArrivedLine]:
    """Return the lines that are text of a length that lines of numbers may have."""
    return [line for line in lines if line.is_text and not line.is_cut]


def numbers_of(lines: Sequence[ArrivedLine]) -> list[ArrivedLine]:
    """Return those that have a digit."""
    return [line for line in texts_of(lines) if any(map(str.isdigit, line.text))]


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
