"""The part of a recording within an interval of time."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, assert_never

import numpy as np
from numpy.typing import NDArray

from taxel import _core
from taxel._base.files import open_file
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.recording import sections
from taxel.recording.contents import Board, Contents, S, Source, apply_rule, share_clock
from taxel.recording.kinds import verdict_of
from taxel.recording.once import UNKNOWN, Once
from taxel.recording.verdict import Verdict

#: So many bytes at either end of a file name a recording.
_END = 1 << 16


def between(of: Contents, start: float, stop: float) -> Contents:
    """Return the part of ``start <= t < stop`` (us); notes without a time are dropped and listed in its `lost`.

    The held values at its beginning follow from the events before it. Taxels that were zeroed before it stay zeroed.
    """
    every, whole = of.sources, _between(of.main, of.sources, start, stop)
    if len(every) == 1:
        return Contents.single(whole)
    every_part = {name: _between(source, every, start, stop) for name, source in inside(every).items()}
    apart = Once(lambda: len(every) > 1 and of.main.timing.clock_of is None and not share_clock(every))
    return Contents(whole, Slices(every_part, of.main.origin, apart))


def _between(of: S, sources: Mapping[str, Source], start: float, stop: float) -> S:
    """Return a part of a source by time."""
    marks = of.marks

    def rule(part: sections.Section) -> sections.Section:  # noqa: PLR0911  one a type
        match part:
            case sections.Origin() | sections.Sensor() | sections.Wire():
                return part
            case sections.EventTable():
                return sections.EventTable(Once(lambda: part.events().between(start, stop)))
            case sections.FrameTable():
                return replace(part, frames=Once(lambda: part.frames().between(start, stop)))
            case sections.Columns():
                return sections.Columns(
                    part.columns, part.samples.to(lambda samples: samples and samples.between(start, stop))
                )
            case sections.Settings():
                return sections.Settings(Once(lambda: _held_at(of, start)), part.registers, part.register_changes)
            case sections.Timing():
                return sections.Timing(part.clock, part.clock_of, Once(lambda: _stretch(of, start, stop)))
            case sections.Losses():
                return replace(part, verdict=Once(lambda: _verdict(of, sources)))
            case sections.Marks():
                return sections.Marks(
                    board_changes=part.board_changes,
                    notes=Once(lambda: tuple(n for n in part.notes() if n.t is not None and start <= n.t < stop)),
                    detections=Once(lambda: part.detections().between(start, stop)),
                    zeroings=Once(lambda: tuple(z for z in part.zeroings() if z.t < stop)),
                )
            case _:
                assert_never(part)

    def untimed() -> list[str]:
        count = sum(note.t is None for note in marks.notes())
        return [f"{counted(count, 'note')} without a time"] * bool(count)

    return apply_rule(of, rule, untimed)


def _verdict(of: Source, sources: Mapping[str, Source]) -> Verdict | None:
    """Return the verdict of a source as that of one of its stretches, which names the whole.

    The name follows from the file's ends, or else from what there is, so that stretches that were cut at different
    times or of a copy have one; no datagram is read for it.
    """
    if of.losses.verdict() is None:
        return None
    verdict = verdict_of(of)
    if verdict.stretch_of is not None:
        return verdict
    verdicts = [verdict_of(source).to_dict() for source in sources.values()]
    try:
        about = _ends(of.origin.path)
    except OSError:
        about = json.dumps([len(of.table), of.table.t[:1].tolist(), of.table.t[-1:].tolist()]).encode()
    return verdict._as_stretch_of(hashlib.sha256(json.dumps(verdicts).encode() + about).hexdigest()[:16])


def _ends(path: Path) -> bytes:
    """Return a file's size and its first and last bytes, in which times and checksums stand: a copy has the same."""
    with open_file(path) as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - _END, 0))
        last = file.read(_END)
        file.seek(0)
        return b"%d " % size + file.read(_END) + last


class Slices(Mapping[str, Source]):
    """Hold the same part of all sources of a file; refuse access to those whose clock is not that of the interval."""

    def __init__(self, every_part: Mapping[str, Source], origin: sections.Origin, apart: Once[bool]) -> None:
        self._parts, self._origin, self._apart = every_part, origin, apart

    def __getitem__(self, name: str) -> Source:
        part = self._parts[name]
        if self._apart():
            raise ProblemError(
                f"{self._origin.path}: a slice by one clock, and its sources ({', '.join(self)}) have each its own; "
                "say on_clock(name) before between"
            )
        return part

    def __iter__(self) -> Iterator[str]:
        return iter(self._parts)

    def __len__(self) -> int:
        return len(self._parts)

    def but(self, label: str, part: Source) -> Slices:
        """Return the same with another part in the place of one."""
        return Slices({**self._parts, label: part}, self._origin, self._apart)

    def __getstate__(self) -> dict[str, Any]:
        """Return what there is access to, and the names of the others, so that a pickle reads no other source."""
        return vars(self) | {"_parts": dict.fromkeys(self._parts) if self._apart() else self._parts}


def inside(sources: Mapping[str, Source]) -> Mapping[str, Source]:
    """Return all sources, also those of slices by another clock."""
    return sources._parts if isinstance(sources, Slices) else sources


def _stretch(of: Source, start: float, stop: float) -> tuple[int, int]:
    """Return the first time and the end of a part, limited to those of the whole."""
    t = of.table.t
    whole = (int(t.min()), int(t.max()) + 1) if len(t) else (0, 1)
    if of.timing.interval is not None:
        whole = of.timing.interval()
    first, last = max(whole[0], _whole(start)), min(whole[1], _whole(stop))
    return first, max(first, last)


def _whole(value: float) -> int:
    """Return a bound in whole us; an infinite one becomes the largest time."""
    return int(np.ceil(np.clip(value, -(2.0**62), 2.0**62)))


def _held_at(of: Source, start: float) -> NDArray[np.uint16] | None:
    """Return the values that the taxels held at a time, as far as they are known."""
    held, events = of.settings.held(), of.table if isinstance(of, Board) else None
    if events is None or events.intensity is None or events.present is None:
        return held
    earlier = events.between(-np.inf, start)
    if earlier.present is None or not earlier.present.any():
        return held
    begins = np.full(of.sensor.array.shape, UNKNOWN, np.uint16) if held is None else held
    values = _core.HeldValues(earlier._parts(), None, begins.astype(np.float32).reshape(-1))
    return values.at(np.array([earlier.t.max()])).astype(np.uint16).reshape(of.sensor.array.shape)
