"""Lines of numbers of a live source: read as they arrive, passed on as frames."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from taxel._base.limits import VALUE
from taxel._base.messages import counted
from taxel._base.text_lines import ArrivedLine
from taxel._core import Error, ProblemError, now_ns
from taxel.array import Array
from taxel.formats.lines import is_number
from taxel.labels import source_of
from taxel.live.line_frames import LineFrames
from taxel.live.line_input import LineInput
from taxel.live.line_parts import PartOfInput, parts_of_input
from taxel.live.line_shape import LineShape, numbers_of, texts_of
from taxel.live.stated_source import StatedSource

__all__ = ["Lines", "first_lines"]

#: So many lines show what they are, or those of so long after the first, s.
_LINES, _MEASURE_S = 33, 1.0
#: How long the columns may be unknown after the first line, and the lines that are kept then.
_WITHIN_S, _KEPT = 3.0, 256
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
    part : PartOfInput, optional
        What reads the lines of one sensor, where several print to one place in turn.

    Attributes
    ----------
    others : list of Lines
        Those of the further sensors that print to its place, once they are found.

    Raises
    ------
    OSError : it cannot be opened
    ProblemError : it is not a place of lines
    """

    def __init__(
        self,
        stated: StatedSource,
        *,
        is_read_out: bool,
        readout: Array | None = None,
        part: PartOfInput | None = None,
    ) -> None:
        self.stated, self.name, self.others = stated, stated.called, list[Lines]()
        self._input: LineInput | PartOfInput | None = part
        if part is not None:
            self._take(part)
        elif stated.kind == "lines":
            baud = stated.printed.baud
            self._input = LineInput(stated.place if baud is None else f"{stated.place},baud={baud}")
        self.place = "a program" if self._input is None else self._input.place
        is_row = not (is_read_out or stated.are_frames)
        waited = self._input is not None and self._input.is_file
        #: What the lines are.
        self.shape = LineShape(stated, self.place, is_row=is_row, waited=waited, readout=readout)
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
        self.failed: Error | OSError | None = None
        self._given = threading.Lock()

    def _take(self, part: PartOfInput) -> None:
        """Read the lines of one sensor alone, by whose name it is called."""
        self._input, self.name = part, source_of(" ".join(filter(None, (self.stated.name, part.name))))

    def _split(self) -> None:
        """Let lines that name their sensor in turn be of several sources, of which this is the first."""
        texts = [line.text for line in texts_of(self._waiting)]
        if not isinstance(self._input, LineInput) or not (found := self.shape.sensors_of(texts)):
            return
        names, sensor_of = found
        first, *others = parts_of_input(self._input, names, sensor_of, self._waiting)
        self._take(first)
        self.others = [Lines(self.stated, is_read_out=True, part=part) for part in others]
        self._waiting = first.read()

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
            self._frames = self.shape.of_program()
            return
        is_stated = self.shape.is_stated
        if is_stated:
            self._declared = self.shape.of_statement()
        begun, first = time.monotonic(), None
        while True:
            beyond = self._left_out[0]
            self._read()
            now = time.monotonic()
            # What cannot be a line of numbers is waited out.
            begun = now if self._left_out[0] > beyond else begun
            first = now if first is None and texts_of(self._waiting) else first
            since = 0.0 if first is None else now - first
            enough = len(numbers_of(self._waiting)) >= _LINES or since >= _MEASURE_S or self._has_ended
            if enough:
                self._split()
            if first is not None and (enough or is_stated) and self._understood(final=False):
                return
            if is_stated and (first is None or not numbers_of(self._waiting)):
                # The first lines that come will show it.
                return
            if first is None and (self._has_ended or now - begun >= most_s):
                within = "before the end" if self._has_ended else f"within {now - begun:.0f} s"
                self._input.discard()
                self._leave_out()
                size = sum(self._left_out) + sum(line.size for line in self._waiting)
                came = f"{counted(size, 'byte')} arrived {within}, but no line of text that ends"
                raise ProblemError(f"{self.place}: {came if size else f'no line arrived {within}'}")
            if first is not None and (since >= _WITHIN_S or self._has_ended):
                self._understood(final=True)
                return

    def _understood(self, *, final: bool) -> bool:
        """Return whether the lines so far show what they are; if they are the last to show it, refuse others."""
        frames = self.shape.of_lines(self._waiting, final=final, has_ended=self._has_ended)
        if frames is not None and self._declared is not None:
            frames.unread = self._declared.unread
        self._frames = frames
        return frames is not None

    def source(self, readout_unit: str | None) -> dict[str, Any]:
        """Return the source as the compiled part knows it."""
        return {"name": self.name, "place": self.place, "kind": {"frames": self.shape.layout(readout_unit)}}

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
                    input_.discard()
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
        in_no_line, unfinished = self._input.take_left_out()
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
        if frames is None and (self._ends.is_set() or self._has_ended or not numbers_of(self._waiting)):
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
    until = time.monotonic() + most_s
    try:
        while time.monotonic() < until and not lines._has_ended and len(numbers_of(lines._waiting)) < _KEPT:
            lines._read()
    finally:
        lines.close()
    if not numbers_of(lines._waiting):
        shown = "".join(f"; it prints {line.text[:60]!r}" for line in lines._waiting[-1:])
        raise ProblemError(f"No numbers arrived: is the sensor connected and switched on?{shown}")
    return [line.text for line in texts_of(lines._waiting)]
