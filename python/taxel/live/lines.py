"""Lines of numbers of a live source: read as they arrive, passed on as frames."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Sequence

from taxel._base.limits import VALUE
from taxel._base.messages import counted
from taxel._base.text_lines import ArrivedLine
from taxel._core import Error, ProblemError, now_ns
from taxel.array import Array
from taxel.formats.lines import is_number
from taxel.labels import source_of
from taxel.live.line_frames import LineFrames
from taxel.live.line_input import LineInput
from taxel.live.line_shape import LineShape, numbers_of, texts_of
from taxel.live.sensor_lines import SensorLines
from taxel.live.stated_source import StatedSource

__all__ = ["Lines", "first_lines"]

#: So many lines show what they are, or those of so long after the first, s.
_LINES, _MEASURE_S = 33, 1.0
#: How long the columns may be unknown after the first line, s, and so many lines are looked at.
_WITHIN_S, _LOOKED_AT = 3.0, 256
_BETWEEN = re.compile(r"[,;\s]+")


class Lines:
    """Read a place of lines of numbers, or what a program passes.

    Parameters
    ----------
    stated : StatedSource
    is_read_out : bool
        Whether it is the source that is read out and shown; another one is a row of quantities, as of an IMU, if it is
        not stated to be a sensor.
    readout : Array, optional
        The sensor of the readout.

    Attributes
    ----------
    sensors : list of SensorLines
        Those that print to the place; once several are found that do so in turn, each of them.

    Raises
    ------
    OSError : it cannot be opened
    ProblemError : it is not a place of lines
    """

    def __init__(self, stated: StatedSource, *, is_read_out: bool, readout: Array | None = None) -> None:
        self.stated, self._readout = stated, readout
        self._is_row = not (is_read_out or stated.are_frames)
        self._input: LineInput | None = None
        if stated.kind == "lines":
            baud = stated.printed.baud
            self._input = LineInput(stated.place if baud is None else f"{stated.place},baud={baud}")
        self.place = "a program" if self._input is None else self._input.place
        self.sensors: list[SensorLines] = []
        self.sensors.append(self._sensor("", stated.called))
        #: Returns the sensor that a line names, "" if none.
        self._sensor_of: Callable[[str], str] = lambda _: ""
        #: Bytes in no line, and of unfinished lines, since they were passed on.
        self._left_out = [0, 0]
        #: A first line that may lack its beginning, and whether that is a loss.
        self._cut: tuple[ArrivedLine, bool] | None = None
        self._sink: Callable[..., object] | None = None
        self._thread: threading.Thread | None = None
        self._ends = threading.Event()
        #: Whether reading goes on after its end, so that the line that has begun is not over.
        self._goes_on = False
        #: Whether it has a place that is open.
        self.is_open = self._input is not None
        self.failed: Error | OSError | None = None
        self._given = threading.Lock()

    def _sensor(self, key: str, name: str) -> SensorLines:
        waited = self._input is not None and self._input.is_file
        # The first has the sensor of the readout.
        readout = None if self.sensors else self._readout
        shape = LineShape(self.stated, self.place, name, is_row=self._is_row, waited=waited, readout=readout)
        return SensorLines(key, name, shape)

    def _split(self) -> None:
        """Let lines that name their sensor in turn be of several sensors."""
        [first, *others] = self.sensors
        found = None if others else first.shape.sensors_of([line.text for line in texts_of(first.waiting)])
        if found is not None:
            keys, self._sensor_of = found
            self.sensors = []
            for key in keys:
                named = source_of(" ".join(filter(None, (self.stated.name, key))))
                self.sensors.append(self._sensor(key, named))
                self.sensors[-1].declare()
            self._give(first.waiting)

    def _give(self, lines: Sequence[ArrivedLine]) -> None:
        """Give each sensor its lines, and all of them empty ones; other lines that name none are the first one's."""
        for line in lines:
            key = self._sensor_of(line.text)
            named = [sensor for sensor in self.sensors if sensor.key == key] if key else self.sensors[:1]
            self._left_out[0] += line.size * (not named)
            for sensor in named if line.text.strip() else self.sensors:
                sensor.waiting.append(line)

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
        self.sensors[0].declare(by_program=self._input is None)
        if self._input is None:
            return
        is_stated = self.sensors[0].shape.is_stated
        begun, first = time.monotonic(), None
        while True:
            beyond = self._left_out[0]
            self._read()
            now = time.monotonic()
            # What cannot be a line of numbers is waited out.
            begun = now if self._left_out[0] > beyond else begun
            waiting = [line for sensor in self.sensors for line in sensor.waiting]
            first = now if first is None and texts_of(waiting) else first
            since, numbers = 0.0 if first is None else now - first, numbers_of(waiting)
            has_ended = self._input.has_ended
            enough = len(numbers) >= _LINES or since >= _MEASURE_S or has_ended
            if enough:
                self._split()
            if first is not None and (enough or is_stated) and self._are_understood(final=False):
                return
            if is_stated and not numbers:
                # The first lines that come will show it.
                return
            if first is None and (has_ended or now - begun >= most_s):
                within = "before the end" if has_ended else f"within {now - begun:.0f} s"
                self._input.discard()
                self._leave_out()
                size = sum(self._left_out) + sum(line.size for line in waiting)
                came = f"{counted(size, 'byte')} arrived {within}, but no line of text that ends"
                raise ProblemError(f"{self.place}: {came if size else f'no line arrived {within}'}")
            if first is not None and (since >= _WITHIN_S or has_ended):
                self._are_understood(final=True)
                return

    def _are_understood(self, *, final: bool) -> bool:
        has_ended = self._input is not None and self._input.has_ended
        return all(each.is_understood(final=final, has_ended=has_ended) for each in self.sensors)

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
                    if input_.has_ended:
                        break
                    self._read()
                if not self._goes_on:
                    input_.discard()
                    self._leave_out()
                self._pass()
                # What follows is no silence.
                for sensor in self.sensors:
                    end(sensor.name)
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
        [sensor, *_] = self.sensors
        if self._input is not None:
            raise ProblemError(
                f"source {sensor.name!r}: taxel reads its lines itself, so a program cannot give it values"
            )
        assert sensor.frames is not None
        with self._given:
            try:
                sensor.frames.push_values(values, at_ns)
            except ProblemError as error:
                raise ProblemError(f"source {sensor.name}: {error}") from None
            self._pass()

    def pause(self) -> None:
        """End reading until `begin`; what was read is passed on, and the place stays open."""
        self._goes_on = True
        self._end()

    def renew(self) -> None:
        """Count from now on what is in no frame."""
        self._goes_on, self.failed = False, None
        for sensor in self.sensors:
            if sensor.frames is not None:
                sensor.frames.unread.clear()

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

    def _read(self) -> None:
        """Take the lines that arrive within a short time."""
        assert self._input is not None
        lines: list[ArrivedLine] = []
        try:
            lines = self._input.read()
        except OSError as error:
            for sensor in self.sensors:
                sensor.interrupt(str(error) if error.strerror is None else f"{error.filename}: {error.strerror}")
        self._leave_out()
        is_lost = self._input.take_cut() if lines else None
        if is_lost is not None:
            # Of a serial line whose form is not known, the rest of a number is a number too.
            if self._input.is_serial and not any(sensor.frames for sensor in self.sensors):
                del lines[0]
            elif self._input.is_serial or _ends_in_number(lines[0].text):
                self._cut = (lines[0], is_lost)
        self._give(lines)

    def _leave_out(self) -> None:
        """Count the bytes that are in no line."""
        assert self._input is not None
        in_no_line, unfinished = self._input.take_left_out()
        self._left_out = [self._left_out[0] + in_no_line, self._left_out[1] + unfinished]

    def _leave_out_cut(self, sensor: SensorLines, frames: LineFrames) -> None:
        """Leave out a first line that is the rest of one: it does not fit, and ends in a number as lines do."""
        if self._cut is None or self._cut[0] not in sensor.waiting:
            return
        (line, is_lost), self._cut = self._cut, None
        if not frames.fits(line.text):
            sensor.waiting.remove(line)
            # Where reading began amid a line, nothing was lost.
            self._left_out[1] += line.size * is_lost

    def _pass(self) -> None:
        """Pass on what the lines so far give; while they do not show what they are, they wait."""
        assert self._sink is not None
        has_ended = self._input is not None and self._input.has_ended
        for sensor in self.sensors:
            frames = sensor.ready(is_over=self._ends.is_set() or has_ended, has_ended=has_ended)
            if frames is None:
                continue
            self._leave_out_cut(sensor, frames)
            passed = sensor.pushed(frames, has_ended=has_ended)
            (in_no_line, unfinished), self._left_out = self._left_out, [0, 0]
            arrived_ns, stamps, values = passed.arrays(self.stated.turned)
            self._sink(
                sensor.name,
                arrived_ns,
                stamps,
                values,
                passed.lines,
                (passed.strange, in_no_line, unfinished + passed.unfinished),
                passed.unread,
                passed.trouble,
                now_ns(),
            )


def _ends_in_number(text: str) -> bool:
    """Return whether the last cell of a line is a number."""
    last = _BETWEEN.split(text.strip(" \t,;"))[-1]
    return is_number(last) and abs(float(last)) <= VALUE


def first_lines(source: str, most_s: float) -> list[str]:
    """Return the first lines that arrive from a source.

    Parameters
    ----------
    source : str
    most_s : float, s
        How long to read.

    Raises
    ------
    OSError : it cannot be opened
    ProblemError : none of numbers arrives
    """
    lines = Lines(StatedSource.of(source), is_read_out=True)
    assert lines._input is not None
    waiting, until = lines.sensors[0].waiting, time.monotonic() + most_s
    try:
        while time.monotonic() < until and not lines._input.has_ended and len(numbers_of(waiting)) < _LOOKED_AT:
            lines._read()
    finally:
        lines.close()
    if not numbers_of(waiting):
        shown = "".join(f"; it prints {line.text[:60]!r}" for line in waiting[-1:])
        raise ProblemError(f"No numbers arrived: is the sensor connected and switched on?{shown}")
    return [line.text for line in texts_of(waiting)]
