"""The part of a recording within an interval of time."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.files import open_file
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.recording.contents import UNKNOWN, Contents, once, together
from taxel.recording.fates import after
from taxel.recording.kinds import verdict_of
from taxel.recording.verdict import Verdict

__all__ = ["Apart", "between"]

#: So many bytes at either end of a file name a recording.
_END = 1 << 16


def between(of: Contents, start: float, stop: float) -> Contents:
    """Return the part of ``start <= t < stop`` (us); notes without a time are dropped and listed in its `lost`.

    The held values at its beginning follow from the events before it. Taxels that were zeroed before it stay zeroed.
    """
    return after(
        "between",
        of,
        lambda: _without_a_time(of),
        events=once(lambda: None if of.events is None else of.events.between(start, stop)) if of.has_events else None,
        frames=None if of.has_events else once(lambda: None if of.frames is None else of.frames.between(start, stop)),
        stretch=once(lambda: _stretch(of, start, stop)),
        held=once(lambda: _held_at(of, start)),
        notes=once(lambda: tuple(n for n in of.notes if n.t is not None and start <= n.t < stop)),
        detections=once(lambda: of.detections.between(start, stop)),
        zeroings=once(lambda: tuple(z for z in of.zeroings if z.t < stop)),
        samples=once(
            lambda: None if of.samples is None else of.samples.between(start, stop), lambda: of.holds("samples")
        ),
        verdict=once(lambda: _verdict(of)),
        sources=once(lambda: _sources(of, start, stop)),
    )


def _verdict(of: Contents) -> Verdict | None:
    """Return the verdict of a recording as that of one of its stretches, which names the whole.

    The name follows from the file's ends, or else from what there is, so that stretches that were cut at different
    times or of a copy have one; no datagram is read for it.
    """
    if of.verdict is None:
        return None
    said = verdict_of(of)
    if said.stretch_of is not None:
        return said
    verdicts = [verdict_of(one).to_dict() for one in (of.sources or {of.label: of}).values()]
    try:
        about = _ends(of.path)
    except OSError:
        about = json.dumps([len(of.table), of.table.t[:1].tolist(), of.table.t[-1:].tolist()]).encode()
    return said._as_stretch_of(hashlib.sha256(json.dumps(verdicts).encode() + about).hexdigest()[:16])


def _ends(path: Path) -> bytes:
    """Return a file's size and its first and last bytes, in which times and checksums stand: a copy has the same."""
    with open_file(path) as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - _END, 0))
        last = file.read(_END)
        file.seek(0)
        return b"%d " % size + file.read(_END) + last


def _without_a_time(of: Contents) -> list[str]:
    count = sum(note.t is None for note in of.notes)
    return [f"{counted(count, 'note')} without a time"] * bool(count)


class Apart(Mapping[str, Contents]):
    """Hold the names of sources with clocks of their own; refuse access, as the interval is by another clock."""

    def __init__(self, path: Path, names: Iterable[str]) -> None:
        self._path, self._names = path, tuple(names)

    def __getitem__(self, name: str) -> Contents:
        raise ProblemError(
            f"{self._path}: a slice by one clock, and its sources ({', '.join(self._names)}) have each its own; say "
            "on_clock(name) before between"
        )

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def _sources(of: Contents, start: float, stop: float) -> Mapping[str, Contents]:
    """Return the same part of all sources of a file if they are on one clock; else refuse access to them."""
    sources = of.sources
    if len(sources) > 1 and of.clock_of is None and not together(sources):
        return Apart(of.path, sources)
    parts: dict[str, Contents] = {}
    for name, one in sources.items():
        alone = one.but(sources={}, verdict=once(partial(_verdict, one)))
        parts[name] = between(alone, start, stop).but(sources=parts)
    return parts


def _stretch(of: Contents, start: float, stop: float) -> tuple[int, int]:
    """Return the first time and the end of a part, limited to those of the whole."""
    t = of.table.t
    whole = of.stretch or ((int(t.min()), int(t.max()) + 1) if len(t) else (0, 1))
    first, last = max(whole[0], _whole(start)), min(whole[1], _whole(stop))
    return first, max(first, last)


def _whole(value: float) -> int:
    """Return a bound in whole us; an infinite one becomes the largest time."""
    return int(np.ceil(np.clip(value, -(2.0**62), 2.0**62)))


def _held_at(of: Contents, start: float) -> NDArray[np.uint16] | None:
    """Return the values that the taxels held at a time, as far as they are known."""
    events = of.events if of.has_events else None
    if events is None or events.intensity is None or events.present is None:
        return of.held
    before = events.between(-np.inf, start)
    if before.present is None or not before.present.any():
        return of.held
    begins = np.full(of.array.shape, UNKNOWN, np.uint16) if of.held is None else of.held
    values = _core.HeldValues(before._parts(), None, begins.astype(np.float32).reshape(-1))
    return values.at(np.array([before.t.max()])).astype(np.uint16).reshape(of.array.shape)
