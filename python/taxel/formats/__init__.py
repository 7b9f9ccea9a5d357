"""Files of other makers: one module for each format, which reads trials (frames or events, with reference events).

Examples
--------
>>> from taxel import formats
>>> formats.FORMATS["plate"].about
'A footscan-type plate, one barefoot footfall in each trial (jiku-data, SpeedPP2DS; J. Biomech. 41:1987, 2008).'
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from taxel._base.arguments import checked_path
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
        Returns the files of this format in a folder, or the file itself, in order; empty if there are none.
    trials : function
        Yields the trials of a folder or a file; those of an event camera by a `Reduction`.
    labels_of : str
        The quantity of plain rules whose thresholds the reference events are, as they were derived from it; or "".
    """

    about: str
    files: Callable[[Path], list[Path]]
    trials: Callable[..., Iterator[Trial]]
    labels_of: str = ""


def _of(name: str) -> Format:
    """Return the format that a module defines: the first line of its docstring, `files`, `trials`, any `LABELS_OF`."""
    module = import_module(f"taxel.formats.{name}")
    about, labels_of = (module.__doc__ or "").split("\n", maxsplit=1)[0], getattr(module, "LABELS_OF", "")
    return Format(about, module.files, module.trials, labels_of)


#: Every format by name, in the order in which they are tried on a folder. A new format is a module and a name here.
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
        "event_camera",
    )
}


def trials(path: str | Path, format: str | None = None, **how: Any) -> Iterator[Trial]:  # noqa: A002  the usual name
    """Yield the trials of a file or a folder.

    Parameters
    ----------
    path : str or Path
        A file, or a folder of files of one format.
    format : str, optional
        One of `FORMATS`; default: recognised by the files' names and first bytes.
    **how
        Further arguments of the format: the `reduction` of an event camera's files.

    Yields
    ------
    Trial

    Raises
    ------
    FormatError : no format or several formats match, or a file breaks its format (names file and line)
    ProblemError : an unknown format
    FileNotFoundError : no such file or folder

    Examples
    --------
    >>> list(trials("a folder that is not there"))
    Traceback (most recent call last):
    ...
    FileNotFoundError: [Errno 2] No such file or directory: 'a folder that is not there'
    """
    source = Path(checked_path("path", path))
    if not source.exists():
        raise FileNotFoundError(2, "No such file or directory", str(source))
    if format is not None:
        checked_text("format", format, FORMATS)
    names = [format] if format else [name for name, kind in FORMATS.items() if kind.files(source)]
    if len(names) != 1:
        problem = "no known format" if not names else "several formats (" + ", ".join(names) + ")"
        raise FormatError(f"{source}: contains {problem}; set format to one of {', '.join(FORMATS)}")
    try:
        yield from FORMATS[names[0]].trials(source, **how)
    except MemoryError as error:
        raise FormatError(f"{source}: needs more memory than is available ({error})") from None
