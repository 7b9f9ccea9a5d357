"""Encoders side by side: the spikes of each part as `SpikeTrains.side_by_side` joins them, in the order of names."""

import numpy as np
import pytest

from taxel import Frames, SpikeTrains
from taxel.encode import FA2, ChangeEvents, Composite, ContactArea, Moments, ThresholdIzhikevich

from . import scenes
from .scenes import rest, spikes_of, touch, wander

ARRAY = scenes.ARRAY
TARE = rest(ARRAY)
#: Examples for the laws of all encoders (test_laws.py).
EXAMPLES = {
    "composite": Composite(
        {
            "moments": Moments(levels=2, graded=True, ages_ms=[0.0, 0.4, 2.0], period_ms=0.3, tare=TARE),
            "change": ChangeEvents(),
            "area": ContactArea(levels=[1, 2, 4, 8], tare=TARE),
        }
    ),
    "composite, not graded, one of them late": Composite(
        {"fine": ThresholdIzhikevich([60.0], period_ms=0.3), "area": ContactArea(levels=[2], tare=TARE), "b": FA2()}
    ),
}
each_example = pytest.mark.parametrize("encoder", EXAMPLES.values(), ids=EXAMPLES)


@each_example
@pytest.mark.parametrize("seed", range(3))
def test_the_spikes_are_those_of_the_parts_in_the_order_of_their_names(encoder: Composite, seed: int) -> None:
    events = touch(np.random.default_rng(seed), ARRAY)
    values = wander(np.random.default_rng(seed), 300, 12).reshape(300, 3, 4)
    values[:9] = TARE.rest
    frames = Frames(values, np.arange(300) * 300, array=ARRAY)
    for source in (events, frames):
        each = [encoder.parts[name].encode(source) for name in sorted(encoder.parts)]
        wanted = SpikeTrains.side_by_side(each)
        found = encoder.encode(source)
        assert found.kind == wanted.kind == encoder.kind
        assert (found.start, found.stop, len(found)) == (wanted.start, wanted.stop, encoder.trains(ARRAY))
        assert spikes_of(found) == spikes_of(wanted)
        assert min(len(one.times) for one in each) > 0, "every part has something to say"
    assert encoder.latency_ms == max(part.latency_ms for part in encoder.parts.values())


def test_some_parts_have_the_places_of_their_trains() -> None:
    encoder = EXAMPLES["composite"]
    events = touch(np.random.default_rng(7), ARRAY)
    whole = encoder.encode(events)
    for names in (["change"], ["moments", "area"], ["moments", "change", "area"]):
        part = encoder.only(names)
        assert isinstance(part, Composite) == (len(names) > 1)
        own = part.encode(events)
        own = own.split_by_sign() if own.signed else own
        assert spikes_of(whole.select(encoder.places(names, ARRAY))) == spikes_of(own)
