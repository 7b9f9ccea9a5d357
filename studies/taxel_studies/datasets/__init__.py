"""Published recordings that studies use: a module for each data set, which reads trials with reference times.

Each is a format of taxel too, by an entry point of the group ``taxel.formats``: `taxel.open` and ``taxel train`` read
it.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from taxel import FormatError, Frames, Note
from taxel.reading import Facts, InMemory, Marks

__all__ = ["DataSet", "Trial", "data_set", "files", "numbers", "readers", "scored_around", "stances", "table", "trials"]

#: The errors of pandas, NumPy and gzip at a damaged file. OSError: a place that is not in the file, or no gzip.
DAMAGE = (ValueError, KeyError, EOFError, RuntimeError, OSError, zipfile.BadZipFile, zlib.error)
#: Detections are scored from this time before the first reference event to this time after the last one, us.
MARGIN_US = 100_000


@dataclass(frozen=True, eq=False)
class Trial:
    """Hold one recording of one sensor, with reference times.

    Parameters
    ----------
    name : str
        "subj003/17", "GaCo02_01 left": unique among the trials of a folder.
    person : str
    frames : Frames
        Frames that are missing in the file are missing here too, so times jump there.
    truth : mapping from event to int64, shape (events,), us
        Ascending; "contact", "heel_off", "foot_off", if the data set has them.
    source : str
        The origin of the reference times, in one sentence, which every figure states. "" without reference times.
    foot : str
        "left", "right", or "" if unknown.
    group : str
        "healthy", "patient", or "".
    scored : (int, int), us
        The interval in which reference times are complete; detections outside it are never counted as false.
    series : mapping from name to float64, shape (frames,)
        Further columns of the file, such as the total force computed by the manufacturer.
    about : mapping
        Other information: condition, speed, object ...
    timed : bool
        Whether the recording has times; else its frames are numbered: frame k has the time k us.
    """

    name: str
    person: str
    frames: Frames
    truth: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)
    source: str = ""
    foot: str = ""
    group: str = ""
    scored: tuple[int, int] = (0, 0)
    series: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    about: Mapping[str, str | float] = field(default_factory=dict)
    timed: bool = True


class DataSet(Protocol):
    """Reads the files of a data set: a module of this package."""

    def knows(self, path: Path) -> bool:
        """Return whether a file is one of the data set."""

    def trials(self, path: Path) -> Iterable[Trial]:
        """Return the trials of a file."""


def data_set(name: str) -> DataSet:
    """Return a data set by its name: plate, gaitpdb, gaitndd, icub, popu."""
    return cast("DataSet", import_module(f"taxel_studies.datasets.{name}"))


def files(source: DataSet, folder: Path) -> list[Path]:
    """Return the files of a data set in a folder, in the order of their names."""
    return [file for file in sorted(folder.iterdir()) if source.knows(file)]


def trials(source: DataSet, folder: Path) -> Iterator[Trial]:
    """Yield the trials of all files of a data set in a folder.

    Raises
    ------
    FormatError : there is none, or a file breaks its format
    """
    found = files(source, folder)
    if not found:
        raise FormatError(f"{folder}: contains no file of this data set")
    for file in found:
        yield from source.trials(file)


def readers(path: Path, kind: str, found: Iterable[Trial], labels_of: str = "") -> list[InMemory]:
    """Return a reader of each trial for `taxel.open`, with its reference events as notes; both feet are one recording.

    Parameters
    ----------
    path : Path
    kind : str
        The name of the data set.
    found : iterable of Trial
    labels_of : str
        The quantity of plain rules whose thresholds the reference events are; "" if they are not.
    """
    return [
        InMemory(
            Facts(
                path=path,
                array=trial.frames.array,
                kind=kind,
                name=trial.name.removesuffix(f" {trial.foot}"),
                label=trial.foot or "board",
                source=trial.source,
                side=trial.foot,
                timed=trial.timed,
                labels_of=labels_of,
                lost=(f"columns that are not taxels: {', '.join(trial.series)}",) * bool(trial.series),
            ),
            trial.frames,
            Marks(notes=tuple(sorted(_notes(trial), key=lambda note: note.t or 0))),
        )
        for trial in found
    ]


def _notes(trial: Trial) -> Iterator[Note]:
    return (Note(event, int(t)) for event, times in trial.truth.items() for t in times)


def numbers(path: Path, columns: Sequence[str], separator: str = "\t") -> NDArray[np.float64]:
    """Return the numbers of a table without names, shape (rows, columns).

    Raises
    ------
    FormatError : another number of cells in a line, a cell that is no number, or no line (names the file)
    """
    import pandas as pd  # noqa: PLC0415  takes long

    try:
        read = pd.read_csv(
            path,
            sep=separator,
            header=None,
            names=columns,
            dtype=np.float64,
            index_col=False,
        )
    except DAMAGE as error:
        raise FormatError(f"{path.name}: must be a table of {len(columns)} numbers a line: {error}") from None
    values = read.to_numpy()
    wrong = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(wrong) or not len(values):
        line = wrong[0] + 1 if len(wrong) else 1
        raise FormatError(f"{path.name}, line {line}: must have {len(columns)} finite numbers")
    return cast("NDArray[np.float64]", values)


def table(path: Path) -> Any:
    """Return a table with names beside the recordings as pandas reads it; empty if it is not there."""
    import pandas as pd  # noqa: PLC0415  takes long

    return pd.read_csv(path) if path.exists() else pd.DataFrame()


def whole_us(seconds: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return times in s as whole us."""
    return np.rint(np.asarray(seconds) * 1e6).astype(np.int64)


def stances(ups: NDArray[np.int64], downs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return each beginning of a load with the end that follows it, shape (n, 2); both ascend and alternate."""
    downs = downs[np.searchsorted(downs, ups[0]) :] if len(ups) else downs[:0]
    n = min(len(ups), len(downs))
    return np.stack([ups[:n], downs[:n]], axis=1)


def scored_around(truth: Mapping[str, NDArray[np.int64]]) -> tuple[int, int]:
    """Return the interval from `MARGIN_US` before the first reference event to as long after the last one, us."""
    times = np.concatenate([*truth.values(), np.empty(0, np.int64)])
    return (int(times.min()) - MARGIN_US, int(times.max()) + MARGIN_US) if len(times) else (0, 0)
