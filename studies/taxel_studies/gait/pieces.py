"""Pieces of walking as spikes: what a neuron is trained and judged on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.spikes import SpikeTrains

#: What a rule compares with its numbers: times, ms, and the value from each on.
Signal = tuple[NDArray[np.float64], NDArray[np.float64] | NDArray[np.int64]]
#: No piece is cut nearer than this to a reference event, ms: the spikes of an event stay with it.
CLEAR_MS = 100.0


@dataclass(frozen=True)
class Piece:
    """Hold the spikes of one foot for a while, and what happened.

    No `taxel.detect.Example`, which counts labels in whole us of a recording: pieces are put into rows, so their times
    are ms as float64 from their own start, and a plain rule needs a sum over the sensors, which spikes do not hold.

    Attributes
    ----------
    name : str
        Of the footfall or recording: "subj003/17", "GaCo02_01 left".
    person, group : str
    spikes : SpikeTrains
        Unsigned trains; time counts from the piece's start.
    truth : mapping from event to float64 times, ms
        From the piece's start.
    scored : (float, float), ms
        Where the truth is complete.
    load : (times ms, values)
        The sum over the sensors whose threshold the labels are, for the labels' own rule; nothing where there is none.
    speed_m_s : float
        NaN where it is not known.
    """

    name: str
    person: str
    group: str
    spikes: SpikeTrains
    truth: Mapping[str, NDArray[np.float64]]
    scored: tuple[float, float]
    load: Signal = (np.empty(0), np.empty(0))
    speed_m_s: float = np.nan

    @property
    def duration(self) -> float:
        """How long it lasts, ms."""
        return self.spikes.stop - self.spikes.start

    def between(self, start: float, stop: float) -> Piece:
        """Return a part, its time counted from its own start; both ends move on until no event is within 0.1 s."""
        start, stop = (self._clear(t) for t in (max(start, 0.0), min(stop, self.duration)))
        part = self.spikes.between(start, stop)
        t, load = self.load
        inside = (t >= start) & (t < stop)
        return replace(
            self,
            spikes=SpikeTrains(part.times - start, part.offsets, 0.0, stop - start),
            truth={e: t[(t >= start) & (t < stop)] - start for e, t in self.truth.items()},
            scored=(max(self.scored[0] - start, 0.0), min(self.scored[1], stop) - start),
            load=(t[inside] - start, load[inside]),
        )

    def _clear(self, t: float) -> float:
        if not 0 < t < self.duration:
            return t
        for event in np.sort(np.concatenate([np.empty(0), *self.truth.values()])):
            if abs(event - t) < CLEAR_MS:
                t = min(float(event) + CLEAR_MS, self.duration)
        return t


def joined(pieces: Sequence[Piece]) -> Piece:
    """Put pieces of the same sensors into one row, one after the other, with the name of the first one's person.

    Times of spikes, events and loads move on by what lies before; the whole row is scored.
    """
    starts = np.concatenate([[0.0], np.cumsum([p.duration for p in pieces])])
    times = np.concatenate([p.spikes.times + s for p, s in zip(pieces, starts, strict=False)])
    trains = np.concatenate([np.repeat(np.arange(len(p.spikes)), p.spikes.counts) for p in pieces])
    order = np.argsort(trains, kind="stable")
    counts = np.sum([p.spikes.counts for p in pieces], axis=0)
    first = pieces[0]
    return replace(
        first,
        name=first.person,
        spikes=SpikeTrains(times[order], np.concatenate([[0], np.cumsum(counts)]), 0.0, float(starts[-1])),
        truth={e: np.concatenate([p.truth[e] + s for p, s in zip(pieces, starts, strict=False)]) for e in first.truth},
        scored=(0.0, float(starts[-1])),
        load=(
            np.concatenate([p.load[0] + s for p, s in zip(pieces, starts, strict=False)]),
            np.concatenate([p.load[1] for p in pieces]),
        ),
    )
