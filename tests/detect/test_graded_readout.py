"""Readouts of graded spikes: the same from a recording, from its trains and in pieces, and values multiply weights."""

from __future__ import annotations

import numpy as np
import pytest

from taxel import Array, Detections, Frames, Neuron, Readout, Tare
from taxel.detect import TrainedNeuron, run
from taxel.encode import Moments

ARRAY = Array(4, 5, 2.0)
REST = Tare.take(Frames(np.full((2, 4, 5), 50.0), [0, 1000], unit="ticks", array=ARRAY))
ENCODER = Moments(levels=2, graded=True, ages_ms=[0.0, 1.0, 4.0], period_ms=0.2, displacement_mm=(0.2, 5), tare=REST)


def touch_frames(seed, n=120):
    rng = np.random.default_rng(seed)
    touch = np.repeat(rng.random(n // 10) < 0.6, 10)[:, None, None] * rng.uniform(0, 40, (n, 4, 5))
    touch[-10:] = 0  # what is held at the end causes spikes for as long as the readout runs on
    return Frames(50 + touch, 1000 + 192 * np.arange(n), unit="ticks", array=ARRAY)


def readout(seed, **options):
    rng = np.random.default_rng(seed)
    neurons = {
        label: TrainedNeuron(
            Neuron(**({"tau": 2.0, "refractory": 1.0} | options)), rng.normal(0.05, 0.2, 2 * ENCODER.trains(ARRAY)), 0.5
        )
        for label in ("a", "b")
    }
    return Readout(ENCODER, neurons, array=ARRAY, delays_ms=[0.0, 1.5])


def same(a: Detections, b: Detections):
    assert a.label.tolist() == b.label.tolist()
    assert a.t.tolist() == b.t.tolist()
    assert np.allclose(a.slope, b.slope, rtol=1e-9)


@pytest.mark.parametrize("options", [{}, {"time": "grid", "step_ms": 0.192, "kernel": "exponential"}])
def test_a_readout_multiplies_weights_by_values_in_a_recording_in_trains_and_in_pieces(options):
    for seed in range(3):
        frames, found = touch_frames(seed), readout(seed, **options)
        whole = run(found, frames)
        assert len(whole) > 3
        trains = ENCODER.encode(frames)
        assert trains.kind == "graded"
        if "time" not in options:
            same(run(found, trains), whole)
            one = found.neurons["a"]
            spikes = one.neuron.run(one.weights, trains.delayed([0.0, 1.5]).lasting(trains.stop + 1000.0))
            assert [d.t for d in whole if d.label == "a"] == np.rint(1000 * (spikes - 0.5)).astype(int).tolist()
        for cuts in ([], [17], range(1, len(frames))):
            stream = found.stream(ARRAY)
            detections = []
            for piece in np.split(np.arange(len(frames)), list(cuts)):
                detections += list(stream.push(frames[piece[0] : piece[-1] + 1]))
            detections += list(stream.advance(int(frames.t[-1]) + 3_000_000))
            assert [(d.label, d.t) for d in detections] == list(zip(whole.label, whole.t, strict=True))
        other = Readout.from_json(found.to_json())
        same(run(other, frames, tare=REST), whole)
