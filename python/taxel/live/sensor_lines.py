"""The lines of one sensor as they arrive: they wait until they show what they are, and then become frames."""

from __future__ import annotations

from taxel._base.text_lines import ArrivedLine
from taxel._core import ProblemError
from taxel.live.line_frames import LineFrames, PassedLines
from taxel.live.line_shape import LineShape, numbers_of

__all__ = ["SensorLines"]

#: So many lines are kept that do not show what they are.
_KEPT = 256


class SensorLines:
    """The lines of one sensor, and what they are.

    Parameters
    ----------
    key : str
        By which lines name it, where several sensors print to one place in turn; else "".
    name : str
        That of the source.
    shape : LineShape
        What the lines are.
    """

    def __init__(self, key: str, name: str, shape: LineShape) -> None:
        self.key, self.name, self.shape = key, name, shape
        self.waiting: list[ArrivedLine] = []
        self._frames: LineFrames | None = None
        #: As is stated, before lines have shown their separators.
        self._declared: LineFrames | None = None
        #: Why reading fails, and why it is not clear what the lines are.
        self.trouble: str | None = None
        self._unclear: str | None = None

    @property
    def frames(self) -> LineFrames | None:
        """What makes frames of the lines, as far as that is known."""
        return self._frames or self._declared

    def declare(self, *, by_program: bool = False) -> None:
        """Read lines as they are stated, those of a program for good; a ProblemError says what is not stated."""
        if by_program:
            self._frames = self.shape.of_program()
        elif self.shape.is_stated:
            self._declared = self.shape.of_statement()

    def is_understood(self, *, final: bool, has_ended: bool) -> bool:
        """Return whether the lines so far show what they are; if they are the last to show it, refuse others."""
        if self._frames is None:
            self._frames = self.shape.of_lines(self.waiting, final=final, has_ended=has_ended)
            if self._frames is not None and self._declared is not None:
                self._frames.unread = self._declared.unread
        return self._frames is not None

    def interrupt(self, trouble: str) -> None:
        """Handle that reading failed: the next line begins a frame."""
        self.trouble = trouble
        if self._frames is not None:
            self._frames.restart()

    def ready(self, *, is_over: bool, has_ended: bool) -> LineFrames | None:
        """Return what makes frames of the lines that wait; None while they do not show what they are."""
        if self._frames is None and self.waiting:
            try:
                self.is_understood(final=False, has_ended=has_ended)
                self._unclear = None
            except ProblemError as error:
                self._unclear = str(error)
        if self._frames is None and (is_over or not numbers_of(self.waiting)):
            return self._declared
        if self._frames is None:
            del self.waiting[:-_KEPT]
        return self._frames

    def pushed(self, frames: LineFrames, *, has_ended: bool) -> PassedLines:
        """Return what the lines so far give."""
        waiting, self.waiting = self.waiting, []
        for line in waiting:
            frames.push(line)
        if has_ended:
            frames.end()
        passed = frames.take_passed()
        passed.trouble, self.trouble = self.trouble or self._unclear, None
        return passed
