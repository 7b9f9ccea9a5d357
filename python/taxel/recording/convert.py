"""Converts recordings: a .mcap holds everything; other kinds are exports, which say what they leave out."""

from __future__ import annotations

import errno
import os
from dataclasses import replace
from pathlib import Path

from taxel._base.arguments import checked_path, flag, shown, text
from taxel._base.errors import refused
from taxel._base.files import whole_file, write_whole
from taxel._core import ProblemError
from taxel.events import Events
from taxel.formats.layout import Layout
from taxel.frames import Frames
from taxel.reading import ENDINGS, Facts, InMemory
from taxel.recording.files.columns import write_h5, write_npz
from taxel.recording.files.csv import array_in_csv, write_csv
from taxel.recording.files.lsa import write_lsa
from taxel.recording.files.mcap import write_mcap
from taxel.recording.frames import period_us
from taxel.recording.opening import open_one
from taxel.recording.recording import Recording
from taxel.recording.source import SourceView, share_clock

__all__ = ["convert"]


def convert(
    source: Recording | Events | Frames | str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    frames_hz: float | None = None,
    compression: str = "none",
    overwrite: bool = False,
) -> list[str]:
    """Write a recording as the kind of file that the target's ending names.

    Parameters
    ----------
    source : Recording, Events, Frames or path
    target : path ending in .mcap, .lsa, .npz, .csv or .h5
    frames_hz : float, Hz, optional
        Write frames at this rate (.mcap, .npz, .csv, .h5) instead of events.
    compression : {"none", "lz4", "zstd"}
        Compression of a .mcap.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    list of str
        A line for each kind of information that was lost: `Recording.lost` of the source, and one for all that the
        target leaves out; empty if nothing is lost. A .mcap holds everything, a .lsa the bytes of the manual; .npz, .h5
        and .csv are exports of the table, with its times, unit and sensor.

    Raises
    ------
    ProblemError : another ending, or something that the target cannot hold at all (frames in a .lsa)
    FormatError : a source that is not a recording
    OSError : a target that exists, a folder that does not, a full disk ...

    Examples
    --------
    >>> import pathlib, tempfile, taxel
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> events = taxel.Events([0, 192], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    >>> taxel.convert(events, folder / "two.npz")
    []
    >>> taxel.convert(folder / "two.npz", folder / "two.csv")
    ['a .csv holds the table alone: not the sensor']
    >>> taxel.convert(folder / "two.npz", folder / "two.lsa")
    ["a .lsa holds the board's bytes alone: not the sensor, times finer than 100 us"]
    """
    path = Path(checked_path("target", target))
    kind = path.suffix.lower()
    if kind not in ENDINGS:
        raise ProblemError(f"{path}: ends in {kind or 'nothing'!r}; must end in one of {', '.join(ENDINGS)}")
    text("compression", compression, ("none", "lz4", "zstd"))
    if not flag("overwrite", overwrite) and os.path.lexists(path):
        raise FileExistsError(errno.EEXIST, "exists already; give overwrite=True to replace it", str(path))
    if frames_hz is not None:
        period_us("frames_hz", frames_hz)
    recording = _recording(source)
    if frames_hz is not None:
        if isinstance(source, Frames):
            raise refused(
                "frames_hz",
                ": the times of frames are not changed; to resample frames, open the file and call frames(rate_hz)",
            )
        recording = _as_frames(recording, frames_hz)
    sources = recording._sources
    if kind == ".mcap" and recording.is_several and share_clock(sources) and not recording.has_events:
        chosen, others = sources, list[str]()
    else:
        only = recording._only
        chosen = {only.facts.label: only}
        others = [f"the source {name}" for name, each in sources.items() if each is not only]
    if kind == ".mcap":
        with whole_file(path, overwrite=overwrite) as temporary:
            return [*write_mcap(temporary, chosen, compression), *others]
    return _export(path, kind, next(iter(chosen.values())), others, overwrite)


def _export(path: Path, kind: str, source: SourceView, others: list[str], overwrite: bool) -> list[str]:
    """Write the table of a source, and return what was lost."""
    table, facts = source.table, source.facts
    _refuse_turned(path, source)
    left = [*_beside_table(source, kind), *others]
    match kind:
        case ".lsa":
            left = [*write_lsa(path, source, overwrite=overwrite), *left]
        case ".csv":
            left = [*_left_of_csv(source), *left]
            write_whole(path, lambda file: write_csv(file, table), overwrite=overwrite)
        case ".npz":
            write_whole(path, lambda file: write_npz(file, table, timed=facts.timed), overwrite=overwrite)
        case _:
            write_h5(path, table, timed=facts.timed, overwrite=overwrite)
    holds = "the board's bytes" if kind == ".lsa" else "the table"
    return [*source.lost, *[f"a {kind} holds {holds} alone: not {', '.join(left)}"] * bool(left)]


def _beside_table(source: SourceView, kind: str) -> list[str]:
    """Return what a recording has beside its table that a kind of export leaves out."""
    facts, marks, clock, received = source.facts, source.marks, source.clock, source.received
    are_bytes = kind == ".lsa" and received is not None and received.version == 1
    there = {
        "the raw data": received is not None and not are_bytes,
        "arrival times": clock is not None and len(clock.board_us) > 0,
        "notes": bool(marks.notes),
        "detections": len(marks.detections) > 0,
        "zeroed taxels": bool(marks.zeroings),
        "registers": marks.registers is not None or bool(marks.settings),
        "changes of the board": bool(marks.changes),
        "the values at the beginning": marks.held is not None,
        "the side": bool(facts.side),
        "the place of the heel": bool(facts.heel),
        "the end of a taxel's range": facts.range_end is not None,
        "the names of the columns": bool(facts.columns),
        "that readings were inverted": facts.turned is not None,
        "the remarks": bool(facts.remarks),
        "the verdict": facts.kind not in ("events", *ENDINGS.values()) or facts.kind == "mcap",
    }
    return [name for name, is_there in there.items() if is_there]


def _refuse_turned(path: Path, source: SourceView) -> None:
    """Refuse to write readings that a layout beside the file would invert again, as only a .mcap states that."""
    layout = Layout.beside(path)
    if source.facts.turned is not None and layout is not None and Layout.read(layout).turned is not None:
        raise ProblemError(
            f"{path}: the readings were inverted already, which a {path.suffix} cannot state, and {layout} beside it "
            "would invert them again; write the recording to another folder, or as a .mcap"
        )


def _left_of_csv(source: SourceView) -> list[str]:
    """Return what a .csv leaves out of a table."""
    table = source.table
    left = [] if array_in_csv(table) == source.array else ["the sensor"]
    if isinstance(table, Events):
        return left + ["markers of start and stop"] * bool(table.markers)
    unit = [f"the unit ({table.unit})"] * (table.unit != "counts")
    return [*left, *unit, *["that it has no times"] * (not source.facts.timed)]


def _as_frames(recording: Recording, frames_hz: float) -> Recording:
    """Return a recording of frames at a rate."""

    def drawn(source: SourceView) -> SourceView:
        frames = Recording({source.facts.label: source}).frames(frames_hz)
        lost = ("raw datagrams",) * bool(source.facts.raw)
        # The first frame includes the held values.
        marks = replace(source.marks, held=None)
        return SourceView(source.in_memory(frames, marks, lost=tuple(dict.fromkeys((*source.lost, *lost)))))

    if recording.is_several and share_clock(recording._sources):
        return recording._each(drawn)
    only = recording._only
    return Recording({**recording._sources, only.facts.label: drawn(only)})


def _recording(source: object) -> Recording:
    if isinstance(source, str | os.PathLike):
        source = open_one(checked_path("source", source))
    if isinstance(source, Recording):
        return source
    if not isinstance(source, Events | Frames):
        raise refused("source", f" is {shown(source)}: must be a taxel.Recording, taxel.Events, taxel.Frames or a path")
    return Recording.of(InMemory(Facts(array=source.array), source))
