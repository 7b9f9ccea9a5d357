"""Makes errors whose place, argument and remedy are data, and the line that shows them.

The line begins with the place (`Error.place`). An error that has an argument (`Error.argument`) names it once: before
its text, or, with a remedy (`Error.hint`), within the remedy. The command line puts its option instead of the argument.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike, fspath
from typing import TypeVar

from taxel._base.messages import escaped, escaped_lines
from taxel._core import DeviceError, Error, FormatError, NotFittedError, ProblemError, SceneError

_Error = TypeVar("_Error", bound=Error)

#: What each remedy says, with the reader's name of the argument that helps.
_REMEDIES = {
    "give": "give {}",
    "lay_out": "if the taxels are a grid, row by row, give {}, or rows and columns in a layout file",
    "lay_out_camera": "give {}, such as 480x640, or rows and columns in a layout file",
    "pitch": "give {} with the pitch in mm, or pitch_mm in a layout file",
    "unfelt": (
        "possible reasons: the first label is later than its touch, so the tare contains a touch (give {}); "
        "readings fall with pressure (write falls = true in a layout file); or the touch was on another source "
        "(add a column source to the labels); taxel info shows what was touched"
    ),
}


@dataclass(frozen=True)
class Place:
    """A place in a file, or in a text or bytes in memory.

    Parameters
    ----------
    file : str or None
        None in memory.
    line : int or None
        Counted from 1.
    byte : int or None
        Counted from 0.
    """

    file: str | None = None
    line: int | None = None
    byte: int | None = None

    def __str__(self) -> str:
        line = None if self.line is None else f"line {self.line}"
        byte = None if self.byte is None else f"byte {self.byte}"
        return ", ".join(part for part in (self.file, line, byte) if part is not None)


def _shown(error: Error) -> str:
    """Return the text of an error: one line, and below it the lines that it gives to be copied, if there are any."""
    text, *below = error.args or ("",)
    place = "" if error.place is None else f"{error.place}: "
    line, argument = escaped(str(text)), error.argument or ""
    line = f"{argument}{line}" if error.hint is None else f"{line}; {_REMEDIES[error.hint].format(argument)}"
    line = f"{escaped(place)}{line}"
    return "\n".join([line, *map(escaped_lines, below)])


# The class is of the core; it needs Python 3.12 to have methods of its own there.
Error.__str__ = _shown  # type: ignore[method-assign, assignment]
Error.__repr__ = lambda error: f"{type(error).__name__}({str(error)!r})"  # type: ignore[method-assign]

_ATTRIBUTES = """
Attributes
----------
place : Place or None
    The file (None in memory), and the line (from 1) or byte (from 0) in it, where they are known: `place.file`,
    `place.line` and `place.byte`; None if the error concerns no file, text or bytes.
argument : str or None
    The argument that is wrong, or that helps; None if the error concerns no single argument.
hint : str or None
    The remedy that the text ends with, in one word; None if there is none. "give": pass the argument; "lay_out" or
    "lay_out_camera": state rows and columns; "pitch": state the distance of the taxels; "unfelt": check the labels,
    as the sensor felt nothing near them.
"""
_ABOUT = {
    Error: "Base class of all errors of taxel: ``except taxel.Error`` catches each of them.",
    FormatError: "A file, text or bytes cannot be read: it is damaged, or not in the format that it should be in.",
    ProblemError: "An argument is invalid, or arguments, spike trains or a learning problem make no sense together.",
    NotFittedError: "A learner was used before its `fit` was called.",
    DeviceError: "Registers break a rule of the board, the board does not answer, or its answer is wrong.",
    SceneError: "A simulated scene cannot be played: a parameter is invalid, or a body is off the array.",
}
for _kind, _summary in _ABOUT.items():
    _kind.__doc__ = f"{_summary}\n{_ATTRIBUTES}"


def refused(name: str, text: str) -> ProblemError:
    """Return the error of an argument, or of an entry of it: the text continues after its name, as "lambdas[2]"."""
    argument = name.split("[", maxsplit=1)[0].split(".", maxsplit=1)[0]
    if not argument.isidentifier():
        return ProblemError(f"{name}{text}")
    error = ProblemError(f"{name.removeprefix(argument)}{text}")
    error.argument = argument
    return error


def placed(
    error: _Error, file: str | PathLike[str] | None = None, *, line: int | None = None, byte: int | None = None
) -> _Error:
    """Return the same error with its place; what it knows of its place already stays."""
    there = error.place
    known = Place() if there is None else Place(there.file, there.line, there.byte)
    if known.line is None and known.byte is None:
        known = replace(known, line=line, byte=byte)
    if known.file is None and file is not None:
        known = replace(known, file=fspath(file))
    error.place = known
    return error


def unreadable(
    text: str, file: str | PathLike[str] | None = None, *, line: int | None = None, byte: int | None = None
) -> FormatError:
    """Return the error of a file, or of a text or bytes in memory, with the place where it is wrong."""
    return placed(FormatError(text), file, line=line, byte=byte)


def damaged(path: str | PathLike[str], kind: str, why: str) -> FormatError:
    """Return the error of a file that a library cannot read to its end; `kind` names it, as "HDF5 file"."""
    return unreadable(f"the {kind} is damaged or not complete ({why}); copy or write it again", path)


def helped(error: _Error, argument: str, hint: str) -> _Error:
    """Return the same error with a remedy, of which `argument` is what helps."""
    error.argument, error.hint = argument, hint
    return error
