"""The result of one run of the demo: detections of a readout beside the simulated truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.demo.judging import TouchMatches, judge
from taxel.detect import PlainRule, Readout, run
from taxel.detections import Detections
from taxel.encode import ContactArea
from taxel.events import Events
from taxel.simulate import Act, Contact, play, truth
from taxel.spikes import SpikeTrains, to_ms, to_us
from taxel.tare import Tare
from taxel.wire import FRAME_US

__all__ = ["Evaluation", "evaluate_acts", "evaluate_events"]


@dataclass(frozen=True)
class Evaluation:
    """One run: events, spikes, detections of the neurons and of the plain rule, truth, and how they compare."""

    readout: Readout
    tare: Tare
    events: Events
    """From the start marker on."""
    area: SpikeTrains
    """Contact area of these events."""
    detections: Detections
    contacts: list[Contact]
    force_n: NDArray[np.float32]
    """By frame, from the board's first."""
    judged: TouchMatches
    judged_plain: TouchMatches

    @property
    def start_us(self) -> int:
        """When the board marked the start."""
        return int(to_us(self.area.start))

    @property
    def seconds(self) -> float:
        """How long the board played from the start marker on."""
        return (len(self.force_n) * FRAME_US - self.start_us) * 1e-6

    def potential(self, label: str, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a neuron's potential at `times` (ms), mV."""
        cell = self.readout.neurons[label]
        crossings = to_ms(self.detections[label].t) + cell.delay_ms
        return cell.neuron.potential(cell.weights, self.area, times, spikes=crossings)


def evaluate_acts(
    acts: Sequence[Act], readout: Readout, *, seed: int, watch: Callable[[float], object] = lambda _: None
) -> Evaluation:
    """Simulate acts without waiting for the clock, and run the readout on the events.

    `watch` is called with the share that is done.
    """
    return evaluate_events(play(acts, seed=seed, watch=watch).events, acts, readout)


def evaluate_events(
    events: Events, acts: Sequence[Act], readout: Readout, detections: Detections | None = None
) -> Evaluation:
    """Run the readout on events, those of the tare among them; or judge detections that were reported live."""
    start = events.markers[0][0]
    tare = Tare.take(events, stop_us=start)
    if detections is None:
        detections = run(readout, events, frame_us=FRAME_US, tare=tare)
    # Before the start marker the board sends the rest of every taxel, which is no touch.
    detections = detections[detections.t >= start]
    area = ContactArea(tare=tare).encode(events)
    contacts, force = truth(acts)
    plain = run(PlainRule("area", 2), events, frame_us=FRAME_US, tare=tare)
    return Evaluation(
        readout=readout,
        tare=tare,
        events=events.between(start, np.inf),
        area=area.between(to_ms(start), area.stop),
        detections=detections,
        contacts=contacts,
        force_n=force,
        judged=judge(detections, contacts),
        judged_plain=judge(plain[plain.t >= start], contacts),
    )
