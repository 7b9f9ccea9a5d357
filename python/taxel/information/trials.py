"""Trials: stretches of recordings, each with a label, and what is known of it."""

from __future__ import annotations

import csv
import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from taxel._arguments import instance, mapping, number, path, several, shown, text, whole
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.events import Events
from taxel.frames import Frames
from taxel.recording import Recording
from taxel.spikes import to_ms, to_us

__all__ = ["LabelledTrial", "read_trials", "recordings_as_trials"]

_COLUMNS = ("recording", "t_us", "label")
_KNOWN = (*_COLUMNS, "stop_us", "group", "host_ns")


@dataclass(frozen=True, eq=False)
class LabelledTrial:
    """Hold one trial: where it lies, what it is called, what it belongs to.

    Parameters
    ----------
    source : Events or Frames
        The recording it lies in; trials of one recording share it.
    label : str
    start_us : int, us
        The touch begins at the first event at or after it.
    stop_us : int, us, optional
        The trial's end (exclusive): nothing after it is looked at, and how long the touch was is known.
    group : str
        What must not be split between folds (person, session, pose); every trial by itself where it is empty.
    parameters : mapping of str to str
        What else is known: radius, height, slant ...
    name : str
        Where it lies, for errors.

    Raises
    ------
    ProblemError : a source of another kind, an empty label, or an end that does not lie after the start
    """

    source: Events | Frames
    label: str
    start_us: int
    stop_us: int | None = None
    group: str = ""
    parameters: Mapping[str, str] = field(default_factory=dict)
    name: str = "trial"

    def __post_init__(self) -> None:
        if not isinstance(self.source, Events | Frames):
            raise ProblemError(f"source is {shown(self.source)}: must be taxel.Events or taxel.Frames")
        text("name", self.name)
        if not text("label", self.label):
            raise ProblemError(f"{self.name}: label is empty")
        text("group", self.group)
        mapping("parameters", self.parameters)
        object.__setattr__(self, "start_us", whole("start_us", self.start_us))
        if self.stop_us is not None:
            object.__setattr__(self, "stop_us", whole("stop_us", self.stop_us))
            if not self.stop_us > self.start_us:
                raise ProblemError(f"{self.name}: stop {self.stop_us} us does not lie after start {self.start_us} us")

    @property
    def array(self) -> Array:
        """The sensor."""
        return self.source.array


def read_trials(
    table: str | os.PathLike[str], recordings: Sequence[Recording], *, window_ms: float | None = None
) -> list[LabelledTrial]:
    """Read a table of trials: ``recording,t_us,label[,stop_us][,group]`` and columns of parameters, in any order.

    Parameters
    ----------
    table : path
        A .csv with a header line. A recording is named by its path, file name or stem; ``t_us`` is where to begin to
        look for the touch.
    recordings : sequence of Recording
        All of them must be named, and no other.
    window_ms : float, ms, above 0, optional
        The length of trials without ``stop_us``; needed where there are such.

    Returns
    -------
    list of LabelledTrial, in the order of the table

    Raises
    ------
    FormatError : a column is missing, or a cell that is no number (names file and line)
    ProblemError : recordings and table do not match, a start outside its recording, or trials without an end
    """
    place = Path(path("table", table))
    opened = [instance(f"recordings[{k}]", one, Recording) for k, one in enumerate(several("recordings", recordings))]
    if window_ms is not None and not 0 < number("window_ms", window_ms) < 1e9:
        raise ProblemError(f"window_ms is {shown(window_ms)}: must be above 0")
    by_name = _named(opened)
    rows = _rows(place)
    named = {row["recording"] for _, row in rows}
    strange = sorted(named - set(by_name))
    if strange:
        line = next(line for line, row in rows if row["recording"] == strange[0])
        there = ", ".join(sorted({one.path.name for one in opened})[:5])
        raise ProblemError(f"{place}, line {line}: recording {strange[0]!r} is not among those given: {there} ...")
    unsaid = [one.path for one in opened if not {str(one.path), one.path.name, one.path.stem} & named]
    if unsaid:
        raise ProblemError(f"{place}: says nothing of {unsaid[0]}; name it, or leave the recording out")
    sources = {id(one): one.events if one.has_events else one.frames() for one in opened}
    found = []
    for line, row in rows:
        one = by_name[row["recording"]]
        source = sources[id(one)]
        start = _us(place, line, "t_us", row["t_us"])
        stop = _us(place, line, "stop_us", row["stop_us"]) if row.get("stop_us") else None
        where = f"{place}, line {line}"
        if stop is None and window_ms is None:
            raise ProblemError(f"{where}: has no stop_us; give it, or the trials' length by --window-ms")
        if not row["label"]:
            raise FormatError(f"{where}: label is empty")
        more = {name: cell for name, cell in row.items() if name not in _KNOWN}
        found.append(LabelledTrial(source, row["label"], start, stop, row.get("group", ""), more, where))
        end = start + round(to_us(window_ms or 0.0)) if stop is None else stop
        # Silence before the first event is not recorded, and a touch may be waited for in it.
        if not len(source) or start > source.t.max() or end < source.t.min():
            there = f"{source.t.min()} to {source.t.max()} us" if len(source) else "nothing"
            raise ProblemError(f"{where}: t_us {start} lies outside {one.path.name}, which holds {there}")
    if any(trial.group for trial in found) and not all(trial.group for trial in found):
        nameless = next(trial for trial in found if not trial.group)
        raise ProblemError(f"{nameless.name}: group is empty; give every trial one, or none")
    if window_ms is not None:
        _apart(found, round(to_us(window_ms)))
    return found


def recordings_as_trials(recordings: Sequence[Recording], *, window_ms: float | None = None) -> list[LabelledTrial]:
    """Take each recording as one trial from its beginning on; its folder's name is the label.

    Parameters
    ----------
    recordings : sequence of Recording
    window_ms : float, ms, above 0, optional
        How long after the first event to look; to the end where it is left out.

    Returns
    -------
    list of LabelledTrial

    Raises
    ------
    ProblemError : a recording without anything in it
    """
    found = []
    for k, given in enumerate(several("recordings", recordings)):
        one = instance(f"recordings[{k}]", given, Recording)
        source = one.events if one.has_events else one.frames()
        if not len(source):
            raise ProblemError(f"{one.path}: holds nothing; leave it out")
        start, stop = int(source.t.min()), int(source.t.max()) + 1
        label = one.path.resolve().parent.name
        found.append(LabelledTrial(source, label, start, None if window_ms is not None else stop, name=str(one.path)))
    return found


def _apart(trials: list[LabelledTrial], window_us: int) -> None:
    """Refuse a trial without an end whose window holds the start of another."""
    for source in {id(trial.source) for trial in trials}:
        mine = sorted((trial for trial in trials if id(trial.source) == source), key=lambda trial: trial.start_us)
        for trial, after in pairwise(mine):
            if trial.stop_us is None and after.start_us < trial.start_us + window_us:
                apart = to_ms(after.start_us - trial.start_us)
                raise ProblemError(
                    f"{after.name}: begins {apart:g} ms after {trial.name.split(', ')[-1]}, inside its window of "
                    f"{to_ms(window_us):g} ms; give stop_us, or a shorter --window-ms"
                )


def _named(recordings: Sequence[Recording]) -> dict[str, Recording]:
    """Return recordings by path, and by file name and stem where only one has it."""
    found: dict[str, Recording] = {}
    for names in ([one.path.stem for one in recordings], [one.path.name for one in recordings]):
        count = Counter(names)
        found |= {name: one for name, one in zip(names, recordings, strict=True) if count[name] == 1}
    return found | {str(one.path): one for one in recordings}


def _rows(place: Path) -> list[tuple[int, dict[str, str]]]:
    try:
        lines = place.read_bytes().decode("utf-8-sig").splitlines()
    except UnicodeDecodeError:
        raise FormatError(f"{place}: is no UTF-8 text; must be a .csv recording,t_us,label") from None
    table = list(csv.reader(lines))
    header = [name.strip() for name in table[0]] if table else []
    missing = [name for name in _COLUMNS if name not in header]
    if missing:
        said = ", ".join(header) or "nothing"
        raise FormatError(
            f"{place}, line 1: no column {missing[0]}; there are {said}; must be {','.join(_COLUMNS)} ..."
        )
    repeated = [name for name in header if header.count(name) > 1]
    if repeated:
        raise FormatError(f"{place}, line 1: column {repeated[0]} stands there twice")
    rows = []
    for line, cells in enumerate(table[1:], start=2):
        if not cells:
            continue
        if len(cells) != len(header):
            raise FormatError(f"{place}, line {line}: {len(cells)} cells, must have {len(header)}")
        rows.append((line, dict(zip(header, (cell.strip() for cell in cells), strict=True))))
    if not rows:
        raise FormatError(f"{place}: names no trial")
    return rows


def _us(place: Path, line: int, column: str, cell: str) -> int:
    try:
        value = float(cell)
    except ValueError:
        value = np.nan
    if not (np.isfinite(value) and value.is_integer()):
        raise FormatError(f"{place}, line {line}: {column} is {cell!r}, must be whole us")
    return int(value)
