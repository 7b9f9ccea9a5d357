"""Other people's files: one module a format, each giving trials (pictures and what happened when).

Examples
--------
>>> from taxel import formats
>>> sorted(formats.FORMATS)
['gaitndd', 'gaitpdb', 'moticon', 'pedar', 'plate']
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from taxel._arguments import path as checked_path
from taxel._arguments import text as checked_text
from taxel._core import FormatError
from taxel.formats import gaitndd, gaitpdb, moticon, pedar, plate
from taxel.formats.trial import Trial

__all__ = ["FORMATS", "Format", "Trial", "gaitndd", "gaitpdb", "moticon", "pedar", "plate", "trials"]


@dataclass(frozen=True)
class Format:
    """Tell one format: how to know its files, and how to read them.

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


#: Every format by name, in the order in which a folder is tried.
FORMATS = {
    "plate": Format("footscan-type plate, barefoot, one footfall a trial (HDF5)", plate.files, plate.trials),
    "gaitpdb": Format("8 + 8 force sensors under the feet (PhysioNet gaitpdb)", gaitpdb.files, gaitpdb.trials),
    "gaitndd": Format("one force channel a foot (PhysioNet gaitndd, WFDB 212)", gaitndd.files, gaitndd.trials),
    "moticon": Format("Moticon OpenGo insoles, 16 + 16 sensors (text export)", moticon.files, moticon.trials),
    "pedar": Format("novel pedar insoles, 99 + 99 sensors (.asc)", pedar.files, pedar.trials),
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
    """
    place = Path(checked_path("path", path))
    if not place.exists():
        raise FileNotFoundError(2, "No such file or directory", str(place))
    if format is not None:
        checked_text("format", format, FORMATS)
    names = [format] if format else [name for name, kind in FORMATS.items() if kind.files(place)]
    if len(names) != 1:
        said = "no known format" if not names else "several formats (" + ", ".join(names) + ")"
        raise FormatError(f"{place}: holds {said}; say format= one of {', '.join(FORMATS)}")
    try:
        yield from FORMATS[names[0]].trials(place)
    except MemoryError as error:
        raise FormatError(f"{place}: needs more memory than there is ({error})") from None
