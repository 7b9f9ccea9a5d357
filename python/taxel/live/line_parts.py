"""Lines of several sensors that come from one place in turn: each sensor reads its own."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence

from taxel._base.text_lines import ArrivedLine
from taxel.live.line_input import LineInput

__all__ = ["PartOfInput", "parts_of_input"]


class _Shared:
    """Hold a place of lines, and the lines of each sensor that it has not read yet."""

    def __init__(self, input_: LineInput, names: Sequence[str], sensor_of: Callable[[str], str]) -> None:
        self.input, self.sensor_of, self.lock = input_, sensor_of, threading.Lock()
        self.waiting: dict[str, deque[ArrivedLine]] = {name: deque() for name in names}
        self.errors: dict[str, OSError] = {}
        self.open = {*names}
        #: Bytes of lines that name another sensor.
        self.unknown = 0

    def give(self, lines: Sequence[ArrivedLine]) -> None:
        """Give each sensor its lines, and all of them those that name none, as empty ones do."""
        for line in lines:
            name = self.sensor_of(line.text)
            self.unknown += line.size * (bool(name) and name not in self.waiting)
            for key, waiting in self.waiting.items():
                if name == key or (not name and (key == next(iter(self.waiting)) or not line.text.strip())):
                    waiting.append(line)

    def read(self, name: str) -> list[ArrivedLine]:
        """Return the lines of a sensor; reads more if there are none."""
        with self.lock:
            if (error := self.errors.pop(name, None)) is not None:
                raise error
            if not self.waiting[name] and not self.input.has_ended:
                try:
                    self.give(self.input.read())
                except OSError as failed:
                    self.errors = dict.fromkeys(self.open - {name}, failed)
                    raise
            lines = [*self.waiting[name]]
            self.waiting[name].clear()
            return lines


class PartOfInput:
    """Read the lines of one sensor of a place, as `LineInput` reads all; the first counts what is in no line."""

    def __init__(self, shared: _Shared, name: str) -> None:
        self._shared, self.name = shared, name
        self._is_first = name == next(iter(shared.waiting))
        self.place, self.is_file, self.is_serial = shared.input.place, shared.input.is_file, shared.input.is_serial

    def read(self) -> list[ArrivedLine]:
        """Return the lines that arrive within 50 ms.

        Raises
        ------
        OSError : reading failed
        """
        return self._shared.read(self.name)

    @property
    def has_ended(self) -> bool:
        """Whether no more can arrive."""
        return self._shared.input.has_ended and not self._shared.waiting[self.name]

    def discard(self) -> None:
        """Leave out what is in no line yet."""
        if self._is_first:
            self._shared.input.discard()

    def take_left_out(self) -> tuple[int, int]:
        """Return how many bytes are in no line or in one of no sensor, and in unfinished lines, since the last call."""
        if not self._is_first:
            return 0, 0
        in_no_line, unfinished = self._shared.input.take_left_out()
        unknown, self._shared.unknown = self._shared.unknown, 0
        return in_no_line + unknown, unfinished

    def take_cut(self) -> bool | None:
        """Return what `LineInput.take_cut` does."""
        return self._shared.input.take_cut() if self._is_first else None

    def close(self) -> None:
        """Close the place, if no other sensor is read."""
        self._shared.open.discard(self.name)
        if not self._shared.open:
            self._shared.input.close()


def parts_of_input(
    input_: LineInput, names: Sequence[str], sensor_of: Callable[[str], str], lines: Sequence[ArrivedLine]
) -> list[PartOfInput]:
    """Return what reads the lines of each sensor of a place from now on, and before them those that arrived already.

    Parameters
    ----------
    input_ : LineInput
    names : sequence of str
        Of the sensors.
    sensor_of : function
        Returns the sensor that a line names; "" if none.
    lines : sequence of ArrivedLine
    """
    shared = _Shared(input_, names, sensor_of)
    shared.give(lines)
    return [PartOfInput(shared, name) for name in names]
