"""Gaps in a recording, where frames are missing or an event camera was silent; and frames that are written twice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.times import beginning_us
from taxel.events import Events
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recording.contents import RecordedSource
from taxel.recording.verdict import Verdict

#: Reading: frames are apart by a gap if by so many median intervals.
_INTERVALS = 2.5
#: Reading: an event camera's silence is a gap if it lasts so many windows of so many us or more, and if in such a time
#: so many events or more were due by the rate. By Poisson none then comes with a chance of exp(-50): not in any
#: recording. The rate is that of the lower quartile of windows, as touches only add events: a file that is silent for
#: a quarter of the time, as one without noise is at rest, has no gap.
_WINDOW_US, _WINDOWS, _DUE, _QUARTILE = 100_000, 5, 50.0, 0.25
#: Reading: frames are written twice if so many or more follow that equal those before them, and no more, where noise
#: changes this share of all frames, and in them this share of the taxels.
_TWICE, _NEW, _CHANGED = 10, 0.4, 0.2
#: A recording of damaged stamps may last for years: at most so many windows.
_MOST_WINDOWS = 1_000_000


@dataclass(frozen=True)
class Gaps:
    """Hold how many gaps there are, and how long.

    Parameters
    ----------
    count : int
    total_us, longest_us : int, us
        From the last frame or event before a gap to the first one after it.
    t_us : int, us
        When the longest begins.
    begin_us : int, us
        The time that text counts from (`taxel._base.times`).
    """

    count: int
    total_us: int
    longest_us: int
    t_us: int
    begin_us: int = 0

    def __str__(self) -> str:
        longest = f"{_time(self.longest_us)} at {(self.t_us - self.begin_us) / 1e6:.1f} s"
        if self.count == 1:
            return f"1 gap of {longest}"
        return f"{self.count} gaps, {_time(self.total_us)} together, the longest {longest}"

    def to_dict(self) -> dict[str, Any]:
        """Return text and numbers as JSON values."""
        numbers = {"count": self.count, "total_us": self.total_us}
        return {"text": str(self)} | numbers | {"longest_us": self.longest_us, "t_us": self.t_us}


def _time(us: int) -> str:
    return f"{us / 1e6:.1f} s" if us >= 1_000_000 else f"{us / 1e3:.3g} ms"


def gaps_of(source: RecordedSource) -> Gaps | None:
    """Return the gaps of frames with times, or of an event camera's events; None without any.

    Silence of a board is none: it sends nothing where nothing changes.
    """
    # A board's recording is not decoded for that.
    if source.untimed or (source.has_events and not _may_be_of_camera(source)):
        return None
    table = source.table
    found = missing_frames(table.t) if isinstance(table, Frames) else None
    if found is None:
        found = _silences(table) if of_camera(source) else None
    if found is None:
        return None
    begins, ends = found
    lengths = ends - begins
    longest = int(lengths.argmax())
    numbers = len(lengths), int(lengths.sum()), int(lengths[longest]), int(begins[longest])
    return Gaps(*numbers, beginning_us(table.t[:1]))


def with_gaps(verdict: Verdict, named: Mapping[str, Gaps | None]) -> Verdict:
    """Return a verdict that notes the gaps of each source, or of the only one, where it does not know what was lost."""
    found: dict[str, tuple[str, Gaps]] = {}
    for name, gaps in named.items():
        if gaps is not None:
            found.setdefault(str(gaps), (name, gaps))
    # A recording that counts what was lost has the verdict that it had live, with its silences.
    if not found or verdict.status != "unknown":
        return verdict
    # Sources of one clock have the same gaps.
    are_alike = len(found) == 1 and all(gaps is not None for gaps in named.values())
    texts = [text if are_alike else f"{name}: {text}" for text, (name, _) in found.items()]
    each = [gaps for _, gaps in found.values()]
    return verdict._noting(
        texts, {"gaps": sum(gaps.count for gaps in each), "gaps_us": sum(gaps.total_us for gaps in each)}
    )


def of_camera(source: RecordedSource) -> bool:
    """Return whether a source is of an event camera, whose pixels have events by noise, too."""
    table = source.table
    if isinstance(table, Frames):
        return are_counts(table.unit)
    return table.intensity is None and _may_be_of_camera(source)


def _may_be_of_camera(source: RecordedSource) -> bool:
    """Return whether events are of an event camera by the file's kind or the sensor's name."""
    return source.origin.kind in ("event_camera", "records") or source.sensor.array.name.startswith("event camera")


def missing_frames(t: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return where frames are missing, as the times of the last before and of the first after."""
    apart = np.diff(t)
    at = np.flatnonzero(apart > _INTERVALS * np.median(apart)) if len(apart) else apart
    return (t[at], t[at + 1]) if len(at) else None


def _silences(table: Events | Frames) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
    """Return silences that the rate does not make plausible, as the times of the last event before and the first after.

    Only the windows' ends are looked for, as a camera may have 100 million events.
    """
    t, before = table.t, None
    if isinstance(table, Frames):
        counts = np.asarray(np.nansum(table.values, axis=(1, 2), dtype=np.float64))
        t, before = t[counts > 0], np.concatenate([[0.0], np.cumsum(counts[counts > 0])])
    first, last = (int(t[0]), int(t[-1])) if len(t) else (0, 0)
    if last <= first:
        return None
    window = max(_WINDOW_US, -(-(last - first) // _MOST_WINDOWS))
    ends = np.searchsorted(t, np.arange(first, last + 1, window))
    if len(ends) < 2:
        return None
    rate = float(np.quantile(np.diff(ends if before is None else before[ends]), _QUARTILE)) / window
    # An event that follows an empty window ends a silence.
    after = np.unique(ends[1:][np.diff(ends) == 0])
    begins, ends = t[after - 1], t[after]
    silent = ends - begins
    long = (silent >= _WINDOWS * window) & (silent * rate >= _DUE)
    return (begins[long], ends[long]) if long.any() else None


def written_twice(frames: Frames) -> list[str]:
    """Return which frames, counted from 0, the next ones repeat exactly, as noise never does.

    One that equals the frame before it, as of a slow sensor, and readings that rest at one value are none. Whole
    numbers of a single channel repeat by chance, and are not reported.

    Examples
    --------
    >>> values = np.random.default_rng(1).normal(0, 1, (60, 2, 2))
    >>> values = np.concatenate([values[:40], values[20:]])
    >>> written_twice(Frames(values, 10_000 * np.arange(80)))
    ['frames 20 to 39 (0.200 to 0.390 s) are written twice: what follows them may be 200 ms late']
    """
    keys = np.array([hash(frame.tobytes()) for frame in frames.values], np.int64)
    new = np.flatnonzero(np.diff(keys, prepend=keys[:1] + 1))
    if len(new) < _NEW * len(keys):
        return []
    keys, order = keys[new], np.argsort(keys[new], kind="stable")
    same = keys[order][1:] == keys[order][:-1]
    # How far before each new frame the last one that equals it is.
    back = np.zeros(len(keys) + 1, np.int64)
    back[order[1:][same]] = order[1:][same] - order[:-1][same]
    edges = np.flatnonzero(np.diff(back, prepend=0))
    texts = []
    for first, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        lag = int(back[first])
        if not max(_TWICE, lag) <= end - first < 2 * max(1, lag):
            continue
        values = frames.values[new[first - lag : first]]
        if float(np.mean(values[1:] != values[:-1])) >= _CHANGED:
            begin, copy = int(new[first - lag]), int(new[first])
            times = [(int(frames.t[k]) - beginning_us(frames.t[:1])) / 1e6 for k in (begin, copy - 1)]
            late = _time(int(frames.t[copy] - frames.t[begin]))
            span = f"frames {begin} to {copy - 1} ({times[0]:.3f} to {times[1]:.3f} s)"
            texts.append(f"{span} are written twice: what follows them may be {late} late")
    return texts
