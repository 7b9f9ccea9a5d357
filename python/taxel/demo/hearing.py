"""What a readout made of a play, beside what really happened."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.demo.judging import Judged, judge, plain_rule
from taxel.detect import Readout, run
from taxel.detections import Detections
from taxel.encode import ContactArea
from taxel.events import Events
from taxel.simulate import Act, Contact, play, truth
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.tare import Tare
from taxel.wire import FRAME_US

__all__ = ["Hearing", "hear", "listen"]


@dataclass(frozen=True)
class Hearing:
    """One play: events, spikes, what was said by neuron and by plain rule, truth, and how they compare."""

    readout: Readout
    tare: Tare
    events: Events
    """From the start marker on."""
    area: SpikeTrains
    """Contact area of these events."""
    found: Detections
    plain: Detections
    contacts: list[Contact]
    force_n: NDArray[np.float32]
    """By frame, from the board's first."""
    judged: Judged
    judged_plain: Judged

    @property
    def start_us(self) -> int:
        """When the board marked the start."""
        return int(to_us(self.area.start))

    @property
    def stop_us(self) -> float:
        """When the last frame ended."""
        return len(self.force_n) * FRAME_US

    def crossings(self, label: str) -> NDArray[np.float64]:
        """Return when a neuron's potential crossed its threshold, ms."""
        return to_ms(self.found[label].t) + self.readout.neurons[label].delay_ms

    def potential(self, label: str, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a neuron's potential at `times` (ms), mV."""
        one = self.readout.neurons[label]
        return one.neuron.potential(one.weights, self.area, times, spikes=self.crossings(label))

    def first_input(self, contact: Contact, label: str) -> float | None:
        """Return the stamp (us) of the first spike that told of a touch, or of its end; None where none did."""
        begin, end = contact.start_us - FRAME_US, contact.stop_us + 5_000.0
        rises, falls = to_us(self.area[0]), to_us(self.area[5])
        if label == "contact":
            told = rises[(rises >= begin) & (rises < contact.stop_us)]
            return float(told[0]) if len(told) else None
        told = falls[(falls >= contact.start_us) & (falls < end)]
        return float(told[-1]) if len(told) else None


def hear(
    acts: Sequence[Act], readout: Readout, *, seed: int, watch: Callable[[float], object] = lambda _: None
) -> Hearing:
    """Play acts as fast as the board goes, and listen to what a host decodes of its datagrams.

    `watch` is told which share is played.
    """
    return listen(play(acts, seed=seed, watch=watch).events, acts, readout)


def listen(events: Events, acts: Sequence[Act], readout: Readout, found: Detections | None = None) -> Hearing:
    """Listen to a play's events, the tare's among them; or take what was `found` while it ran."""
    start = events.markers[0][0]
    tare = Tare.take(events, stop_us=start)
    if found is None:
        found = run(readout, events, frame_us=FRAME_US, tare=tare)
    # Before the start marker the board tells of every taxel's rest: nothing of it is meant.
    found = found[found.t >= start]
    area = ContactArea(tare=tare).encode(events)
    area = area.between(to_ms(start), area.stop)
    contacts, force = truth(acts)
    plain = plain_rule(area, FRAME_US)
    return Hearing(
        readout=readout,
        tare=tare,
        events=events.between(start, np.inf),
        area=area,
        found=found,
        plain=plain,
        contacts=contacts,
        force_n=force,
        judged=judge(found, contacts),
        judged_plain=judge(plain, contacts),
    )
