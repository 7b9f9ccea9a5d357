"""Files of other makers: one module for each format, which reads trials (frames or events, with reference events).

Examples
--------
>>> from taxel import formats
>>> formats.FORMATS["plate"].about
'A footscan-type plate, one barefoot footfall a trial (jiku-data, SpeedPP2DS; J. Biomech. 41:1987, 2008).'
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from taxel._base.arguments import path as checked_path
from taxel._base.arguments import text as checked_text
from taxel._core import FormatError
from taxel.formats.trial import Trial

__all__ = ["FORMATS", "Format", "Trial", "trials"]


@dataclass(frozen=True)
class Format:
    """Describe a format: how to recognise its files, and how to read them.

    Parameters
    ----------
    about : str
        What the recordings are, in one line.
    files : function
        Takes a folder or a file; gives the files of this format in it, in order; none where there are none.
    trials : function
        Takes a folder or a file; gives its trials one after the other.
    """

    about: str
    files: Callable[[Path], list[Path]]
    trials: Callable[[str | Path], Iterator[Trial]]


def _of(name: str) -> Format:
    """Return the format of a module: its first line, `files` and `trials`."""
    module = import_module(f"taxel.formats.{name}")
    return Format((module.__doc__ or "").split("\n", maxsplit=1)[0], module.files, module.trials)


#: Every format by name, in the order in which a folder is tried: a new one is a module of that name, and a name here.
FORMATS = {
    name: _of(name)
    for name in (
        "plate",
        "gaitpdb",
        "gaitndd",
        "moticon",
        "pedar",
        "emed",
        "tekscan",
        "icub",
        "popu",
    )
}


def trials(path: str | Path, format: str | None = None) -> Iterator[Trial]:  # noqa: A002  the word of the field
    """Read the trials of a file or a folder, one after the other.

    Parameters
    ----------
    path : str or Path
        A file, or a folder of files of one format.
    format : str, optional
        One of `FORMATS`; found by the files' names and first bytes where it is left out.

    Yields
    ------
    Trial

    Raises
    ------
    FormatError : no format, or several, or a file that does not hold what it should (names file and line)
    ProblemError : a format that is none
    FileNotFoundError : nothing is there

    Examples
    --------
    >>> list(trials("a folder that is not there"))
    Traceback (most recent call last):
    ...
    FileNotFoundError: [Errno 2] No such file or directory: 'a folder that is not there'
    """
    place = Path(checked_path("path", path))
    if not place.exists():
        raise FileNotFoundError(2, "No such file or directory", str(place))
    if format is not None:
        checked_text("format", format, FORMATS)
    names = [format] if format else [name for name, kind in FORMATS.items() if kind.files(place)]
    if len(names) != 1:
        problem = "no known format" if not names else "several formats (" + ", ".join(names) + ")"
        raise FormatError(f"{place}: holds {problem}; say format= one of {', '.join(FORMATS)}")
    try:
        yield from FORMATS[names[0]].trials(place)
    except MemoryError as error:
        raise FormatError(f"{place}: needs more memory than there is ({error})") from None
