"""The slice of a recording over an interval of time."""

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
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.recording import sections
from taxel.recording.contents import BoardSource, Contents, RecordedSource, S, apply_rule, share_clock
from taxel.recording.kinds import verdict_of
from taxel.recording.once import UNKNOWN, Once
from taxel.recording.verdict import Verdict

#: So many bytes at either end of a file name a recording.
_END = 1 << 16


def between(contents: Contents, start: float, stop: float) -> Contents:
    """Return the slice of ``start <= t < stop`` (us); notes without a time are dropped and listed in its `lost`.

    The held values at its beginning follow from the events before it. Taxels that were zeroed before it stay zeroed.
    """
    sources, main = contents.sources, _slice(contents.main, contents.sources, start, stop)
    if len(sources) == 1:
        return Contents.single(main)
    slices = {name: _slice(source, sources, start, stop) for name, source in inside(sources).items()}
    are_apart = Once(lambda: len(sources) > 1 and contents.main.timing.clock_of is None and not share_clock(sources))
    return Contents(main, Slices(slices, contents.main.origin, are_apart))


def _slice(source: S, sources: Mapping[str, RecordedSource], start: float, stop: float) -> S:
    """Return the slice of a source over an interval."""
    marks = source.marks

    def rule(section: sections.Section) -> sections.Section:  # noqa: PLR0911  one a type
        match section:
            case sections.Origin() | sections.Sensor() | sections.Wire():
                return section
            case sections.EventTable():
                return sections.EventTable(Once(lambda: section.events().between(start, stop)))
            case sections.FrameTable():
                return replace(section, frames=Once(lambda: section.frames().between(start, stop)))
            case sections.SampleColumns():
                return sections.SampleColumns(
                    section.columns, section.samples.to(lambda samples: samples and samples.between(start, stop))
                )
            case sections.Settings():
                return sections.Settings(
                    Once(lambda: _held_at(source, start)), section.registers, section.register_changes
                )
            case sections.Timing():
                return sections.Timing(section.clock, section.clock_of, Once(lambda: _interval(source, start, stop)))
            case sections.Losses():
                return replace(section, verdict=Once(lambda: _verdict(source, sources)))
            case sections.Marks():
                return sections.Marks(
                    board_changes=section.board_changes,
                    notes=Once(lambda: tuple(n for n in section.notes() if n.t is not None and start <= n.t < stop)),
                    detections=Once(lambda: section.detections().between(start, stop)),
                    zeroings=Once(lambda: tuple(z for z in section.zeroings() if z.t < stop)),
                )
            case _:
                assert_never(section)

    def untimed() -> list[str]:
        count = sum(note.t is None for note in marks.notes())
        return [f"{counted(count, 'note')} without a time"] * bool(count)

    return apply_rule(source, rule, untimed)


def _verdict(source: RecordedSource, sources: Mapping[str, RecordedSource]) -> Verdict | None:
    """Return the verdict of a source as that of a slice, which names the whole.

    The name follows from the file's ends, or else from what there is, so that slices that were cut at different times,
    or of a copy, have the same; no datagram is read for it.
    """
    if source.losses.verdict() is None:
        return None
    verdict = verdict_of(source)
    if verdict.stretch_of is not None:
        return verdict
    verdicts = [verdict_of(source).to_dict() for source in sources.values()]
    try:
        about = _ends(source.origin.path)
    except OSError:
        about = json.dumps([len(source.table), source.table.t[:1].tolist(), source.table.t[-1:].tolist()]).encode()
    return verdict._as_stretch_of(hashlib.sha256(json.dumps(verdicts).encode() + about).hexdigest()[:16])


def _ends(path: Path) -> bytes:
    """Return a file's size and its first and last bytes, which hold times and checksums: a copy has the same."""
    with open(path, "rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - _END, 0))
        last = file.read(_END)
        file.seek(0)
        return b"%d " % size + file.read(_END) + last


class Slices(Mapping[str, RecordedSource]):
    """Hold the slices of all sources of a file; refuse access to those whose clock is not that of the interval."""

    def __init__(self, slices: Mapping[str, RecordedSource], origin: sections.Origin, apart: Once[bool]) -> None:
        self._slices, self._origin, self._apart = slices, origin, apart

    def __getitem__(self, name: str) -> RecordedSource:
        source = self._slices[name]
        if self._apart():
            raise ProblemError(
                f"{self._origin.path}: the sources ({', '.join(self)}) have different clocks, so one interval "
                f"does not fit "
                "all; call on_clock(name) before between"
            )
        return source

    def __iter__(self) -> Iterator[str]:
        return iter(self._slices)

    def __len__(self) -> int:
        return len(self._slices)

    def but(self, label: str, source: RecordedSource) -> Slices:
        """Return the same with another slice of one source."""
        return Slices({**self._slices, label: source}, self._origin, self._apart)

    def __getstate__(self) -> dict[str, Any]:
        """Return what there is access to, and the names of the others, so that a pickle reads no other source."""
        return vars(self) | {"_slices": dict.fromkeys(self._slices) if self._apart() else self._slices}


def inside(sources: Mapping[str, RecordedSource]) -> Mapping[str, RecordedSource]:
    """Return all sources, also those of slices by another clock."""
    return sources._slices if isinstance(sources, Slices) else sources


def _interval(source: RecordedSource, start: float, stop: float) -> tuple[int, int]:
    """Return the first time and the end of a slice, limited to those of the whole."""
    t = source.table.t
    bounds = (int(t.min()), int(t.max()) + 1) if len(t) else (0, 1)
    if source.timing.interval is not None:
        bounds = source.timing.interval()
    first, last = max(bounds[0], _whole_us(start)), min(bounds[1], _whole_us(stop))
    return first, max(first, last)


def _whole_us(value: float) -> int:
    """Return a bound in whole us; an infinite one becomes the largest time."""
    return int(np.ceil(np.clip(value, -(2.0**62), 2.0**62)))


def _held_at(source: RecordedSource, start: float) -> NDArray[np.uint16] | None:
    """Return the values that the taxels held at a time, as far as they are known."""
    held, events = source.settings.held(), source.table if isinstance(source, BoardSource) else None
    if events is None or events.intensity is None or events.present is None:
        return held
    earlier = events.between(-np.inf, start)
    if earlier.present is None or not earlier.present.any():
        return held
    begins = np.full(source.sensor.array.shape, UNKNOWN, np.uint16) if held is None else held
    values = _core.HeldValues(earlier._parts(), None, begins.astype(np.float32).reshape(-1))
    return values.at(np.array([earlier.t.max()])).astype(np.uint16).reshape(source.sensor.array.shape)
