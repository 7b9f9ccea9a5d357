"""Makes errors whose argument and remedy are data, and the line that shows them.

An error that has an argument (`Error.argument`) names it once: before its text, or, with a remedy (`Error.hint`),
within the remedy. The command line puts its option instead of the argument.
"""

from __future__ import annotations

from typing import TypeVar

from taxel._base.messages import escaped, escaped_lines
from taxel._core import Error, ProblemError

_Error = TypeVar("_Error", bound=Error)

#: What each remedy says, with the reader's name of the argument that helps.
_REMEDIES = {
    "give": "give {}",
    "go_on": "to continue nonetheless, give {}",
    "larger": "a larger {} reads more",
    "lay_out": "give {}, or rows and columns in a layout file, if they are a grid's taxels row by row",
    "pitch": "give {} with the pitch in mm, or pitch_mm in a layout file",
    "unfelt": (
        "either the tare holds a touch, as it ends before the first label, which may be late (give {}), or readings "
        "fall with pressure (falls = true in a layout file), or another source felt it (a column source in the "
        "labels); taxel info shows what was touched"
    ),
}


def _shown(error: Error) -> str:
    """Return the text of an error: one line, and below it the lines that it gives to be copied, if there are any."""
    text, *below = error.args or ("",)
    line, argument = escaped(str(text)), error.argument or ""
    line = f"{argument}{line}" if error.hint is None else f"{line}; {_REMEDIES[error.hint].format(argument)}"
    return "\n".join([line, *map(escaped_lines, below)])


# The class is of the core; it needs Python 3.12 to have methods of its own there.
Error.__str__ = _shown  # type: ignore[method-assign, assignment]
Error.__repr__ = lambda error: f"{type(error).__name__}({str(error)!r})"  # type: ignore[method-assign]


def refused(name: str, text: str) -> ProblemError:
    """Return the error of an argument, or of an entry of it: the text continues after its name, as "lambdas[2]"."""
    argument = name.split("[", maxsplit=1)[0].split(".", maxsplit=1)[0]
    if not argument.isidentifier():
        return ProblemError(f"{name}{text}")
    error = ProblemError(f"{name.removeprefix(argument)}{text}")
    error.argument = argument
    return error


def helped(error: _Error, argument: str, hint: str) -> _Error:
    """Return the same error with a remedy, of which `argument` is what helps."""
    if hint not in _REMEDIES:
        raise refused("hint", f" is {hint!r}: must be one of {', '.join(_REMEDIES)}")
    error.argument, error.hint = argument, hint
    return error
