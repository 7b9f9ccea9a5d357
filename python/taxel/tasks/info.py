"""Summarise a recording: contents, losses, rates, pressure, and dead, stuck or noisy taxels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taxel._base.arguments import finite, instance, optional, several
from taxel._base.messages import collected, counted
from taxel._core import ProblemError
from taxel.formats.event_camera import are_counts
from taxel.frames import Frames
from taxel.recorded import recorded
from taxel.recording import Recording
from taxel.recording.analysis.health import health
from taxel.recording.analysis.pressure import Series, series
from taxel.recording.analysis.rest import of_frames, rest
from taxel.recording.analysis.summary import summary
from taxel.regions import Region
from taxel.spikes import SpikeTrains
from taxel.tare import GivenTare

#: At most so many frames are looked at for dead, stuck and noisy taxels.
_LOOKS = 2000


@dataclass(frozen=True, eq=False)
class Info:
    """Hold the summary of a recording.

    Attributes
    ----------
    facts : mapping of str to value
        Of several sources those of each, with offset and drift of their clocks against the first one's.
    pressed : taxel.recording.analysis.pressure.Series, optional
        The pressure over time; None of several sources, and without intensities.
    warnings : tuple of str
    """

    facts: dict[str, Any]
    pressed: Series | None
    warnings: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the facts as plain values for JSON."""
        return self.facts | {"warnings": list(self.warnings)}


def info(
    recording: Recording,
    tare: GivenTare | None = None,
    regions: Sequence[Region] = (),
    range_end: float | None = None,
) -> Info:
    """Summarise a recording, or each of its sources.

    ``taxel info`` calls this function.

    Parameters
    ----------
    recording : Recording
    tare : Tare, path or float (s), optional
        The rest of the taxels: a tare, its file, a recording at rest, or the seconds at rest at the beginning.
        Default: that of a quiet stretch.
    regions : sequence of Region
        Those whose load is measured too; of several sensors each on its source.
    range_end : float, in the recording's unit, optional
        The value at which the range of a taxel ends: how many of each region reach it is counted. Default: as stated.

    Raises
    ------
    ProblemError : a tare or a region that does not fit

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import taxel
    >>> frames = taxel.Frames([[[0.0]], [[9.0]], [[0.0]]], [0, 10_000, 20_000], unit="N")
    >>> place = pathlib.Path(tempfile.mkdtemp()) / "press.npz"
    >>> _ = taxel.convert(frames, place)
    >>> info(taxel.open(place)).facts["pressure"]["peak"]
    {'most': 9.0, 't_us': 10000}
    """
    instance("recording", recording, Recording)
    parts = [instance("regions", region, Region) for region in several("regions", regions)]
    end, names = optional(finite, "range_end", range_end), [*recording.sources]
    for region in parts:
        if region.source not in (names if len(names) > 1 else ["", *names]):
            raise ProblemError(
                f"region {region.name}: its source is {region.source!r}: must be one of {', '.join(names)}"
            )
    with collected() as warnings:
        if len(names) > 1:
            found = Info(_sources(recording, tare, parts, end), None)
        else:
            given = None if tare is None else rest(recording, tare)
            pressed = series(recording, given, parts, recording.range_end if end is None else end)
            found = Info(summary(recording, pressed), pressed)
    return replace(found, warnings=tuple(warnings))


def sensor_lines(recording: Recording) -> Iterator[str]:
    """Yield that values fall from their rest, and how many taxels are dead, stuck or noisy, and gaps there are."""
    source, parts = recorded(recording, hold=False), []
    if isinstance(source, Frames) and (taken := of_frames(source)).falls:
        yield f"rest: {taken._text(recording.path, recording._turned)}"
    # Pixels of counts may have no event.
    if not isinstance(source, SpikeTrains) and not (isinstance(source, Frames) and are_counts(source.unit)):
        if isinstance(source, Frames):
            # What is dead or stuck is so in some of many frames too.
            source = source[:: 1 + len(source) // _LOOKS]
        of_taxels = health(source)
        masks = {"dead": of_taxels.dead, "stuck": of_taxels.stuck, "noisy": of_taxels.noisy}
        counts = {word: int(np.count_nonzero(mask)) for word, mask in masks.items()}
        named = ", ".join(f"{count} {word}" for word, count in counts.items() if count)
        parts = [f"{named} of {counted(source.array.taxels, 'taxel')}"] if named else []
    if gaps := recording._gaps:
        parts.append(str(gaps))
    if parts:
        yield f"sensor: {'; '.join(parts)} (taxel info lists them)"


def _sources(
    recording: Recording, tare: GivenTare | None, parts: Sequence[Region], end: float | None
) -> dict[str, Any]:
    """Return the facts of each source of a file, with offset and drift of their clocks against the first one's."""
    name_of_first, first = next(iter(recording.sources.items()))
    ours, sources = first.clock, {}
    for name, source in recording.sources.items():
        given = None if tare is None or source.is_stream else rest(source, tare)
        own = [region for region in parts if region.source == name]
        facts = summary(
            source, None if source.is_stream else series(source, given, own, source.range_end if end is None else end)
        )
        if source.is_stream:
            facts["columns"] = source.columns
        clock = source.clock
        if source is not first and clock and ours and len(clock.board_us) and len(ours.board_us):
            begins = int(clock.board_us.min())
            facts["against"] = {
                "source": name_of_first,
                "offset_us": int(ours.board_us_at(int(clock.host_ns(begins)))) - begins,
                "drift_ppm": clock.drift_ppm - ours.drift_ppm,
            }
        sources[name] = facts
    verdict = recording.verdict
    of_all = {"verdict": verdict, "verdict_details": verdict.to_dict(), "remarks": list(recording.remarks)}
    return {"file": str(recording.path), **of_all, "sources": sources}
