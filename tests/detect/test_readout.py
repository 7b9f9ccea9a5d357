"""Readouts: what they hold, their files, and what they say, live and from recordings."""

import itertools

import numpy as np
import pytest
from discs import ARRAY, plain, recipe, tare, touches
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel.detect import Example, Readout, fit, run
from taxel.encode import ChangeEvents, ContactArea, LevelCrossing, ThresholdIzhikevich


@pytest.fixture(scope="module")
def readout() -> Readout:
    """Learnt on other seeds than the tests play."""
    return fit([Example(*touches(seed), tare()) for seed in (1, 2, 3)], recipe(), by_rule=())._with_rules({})


@pytest.mark.parametrize("encoder", [ChangeEvents(), ContactArea(levels=(2, 4, 8)).with_tare(tare())])
@pytest.mark.parametrize("time", ["grid", "continuous"])
def test_delayed_copies_are_heard_live_as_a_learner_saw_them(encoder: taxel.encode.Encoder, time: str) -> None:
    delays_ms = [0.0, 3.3, 40.0]
    events, _ = touches(31, count=9)
    trains = encoder.encode(events).split_by_sign().delayed(delays_ms)
    neuron = taxel.Neuron(tau=3.0, refractory=5.0, time=time, step_ms=0.1)
    weights = np.random.default_rng(5).normal(0.0, 1.0, len(trains))
    readout = Readout(encoder, {"a": (neuron, weights)}, array=ARRAY, delays_ms=delays_ms)
    found = run(readout, events)
    assert len(found) > 5, "something must be detected, to compare"
    # A readout's grid begins at the frame of its first spike, which is a multiple of the step, as is the trains' start.
    fired = neuron.run(weights, trains) - encoder.latency_ms
    assert np.abs(found.t[: len(fired)] / 1000.0 - fired).max() < 1e-3
    pieces, stream = [], readout.stream(ARRAY)
    for start in range(0, 4_000_000, 7919):
        pieces += list(stream.push(events.between(start, start + 7919)).t)
    pieces += list(stream.advance(int(events.t[-1]) + 1_100_000).t)
    assert pieces == found.t.tolist()
    assert Readout.from_json(readout.to_json()).delays_ms.tolist() == delays_ms


def pieces_of(events: taxel.Events, cuts: list[int]) -> list[taxel.Events]:
    bounds = [0, *sorted(c % (len(events) + 1) for c in cuts), len(events)]
    return [events[a:b] for a, b in itertools.pairwise(bounds)]


def together(parts: list[taxel.Detections]) -> taxel.Detections:
    columns = [np.concatenate([getattr(p, name) for p in parts]) for name in ("label", "t", "known", "slope")]
    return taxel.Detections(*columns)


@settings(max_examples=settings.default.max_examples // 2, deadline=None)
@given(cuts=st.lists(st.integers(0, 10**6), max_size=12), which=st.integers(0, 3), data=st.data())
def test_cuts_and_moves_of_time_change_nothing_whatever_the_encoder(cuts: list[int], which: int, data) -> None:
    events, _ = touches(5, count=2)
    # At days and at three years from time 0, neighbouring times in ms differ by up to 2e-5 ms.
    events.t = events.t + data.draw(st.sampled_from([0, 432_001_234_567, 94_608_000_000_000]))
    encoder = [
        ContactArea(levels=(2, 4), tare=tare()),
        LevelCrossing([70.0, 80.0], hold_ms=1.0),
        ThresholdIzhikevich([75.0]),
        ChangeEvents(noise_floor=3.0),
    ][which]
    read = plain(encoder, ARRAY, time=data.draw(st.sampled_from(["grid", "continuous"])))
    whole = run(read, events)
    assert len(whole) > 1
    stream = read.stream()
    said, heard = [], 0
    for piece in pieces_of(events, cuts):
        said.append(stream.push(piece))
        heard += len(piece)
        if heard:
            # Before the time of the next event, exclusive, no event will arrive.
            until = int(events.t[heard]) if heard < len(events) else int(events.t[-1]) + 500
            said.append(stream.advance(data.draw(st.integers(int(events.t[heard - 1]), until))))
    said.append(stream.advance(int(events.t[-1]) + 1_000_000))
    assert together(said) == whole
    assert stream.late == 0
    assert set(stream.potentials) == {"a", "b", "c"}


def test_known_is_never_before_the_crossing_and_ends_a_frame() -> None:
    events, _ = touches(6, count=3)
    encoder = LevelCrossing([70.0], hold_ms=1.5)
    for frame_us, wire_version in itertools.product((192.0, 499.84, 48.0), (1, 2)):
        found = run(plain(encoder, ARRAY), events, frame_us=frame_us, wire_version=wire_version)
        offset = 1500 + np.array([{"a": 0, "b": 250, "c": 500}[label] for label in found.label])
        crossing = found.t + offset
        assert (found.known >= crossing).all()
        # A stamp of version 1 may lie 100 us before its frame; `t` is rounded to us.
        assert (found.known <= crossing + frame_us + {1: 102, 2: 3}[wire_version]).all()
        frames = found.known / frame_us
        assert (found.known - np.round(frames) * frame_us < 1.0).all()
