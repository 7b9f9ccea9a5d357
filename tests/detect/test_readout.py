"""Readouts: what they hold, their files, and what they say, live and from recordings."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel.detect import Example, Readout, Recipe, TrainedNeuron, fit, run, score
from taxel.encode import ChangeEvents, ContactArea, LevelCrossing, ThresholdIzhikevich

ARRAY = taxel.Array(8, 8, pitch_mm=2.67, name="small")
FRAME_US = 192.0


def touches(seed: int, count: int = 6, array: taxel.Array = ARRAY) -> tuple[taxel.Events, dict[str, list[int]]]:
    """Play a disc that grows and shrinks on the array: the board's events with stamps of 100 us, and the truth."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[: array.rows, : array.columns]
    sent = np.full(array.shape, 60, np.int64)
    columns: list[tuple[int, int, int, bool, int]] = []
    columns += [(0, int(c), int(r), True, 60) for r, c in zip(y.ravel(), x.ravel(), strict=True)]
    truth: dict[str, list[int]] = {"contact": [], "lift": []}
    start = 300
    for _ in range(count):
        start += int(random.integers(150, 400))
        length = int(random.integers(150, 300))
        centre = random.uniform(2.5, 4.5, 2)
        truth["contact"].append(int(start * FRAME_US))
        truth["lift"].append(int((start + length) * FRAME_US))
        for k in range(start, start + length + 1):
            near = min(k - start, start + length - k) / 6.0
            radius = min(2.6, near)
            ticks = np.where(np.hypot(y - centre[0], x - centre[1]) < radius, 90, 60) + random.integers(
                -1, 2, array.shape
            )
            for r, c in np.argwhere(np.abs(ticks - sent) > 3):
                new = int(ticks[r, c])
                columns.append((int(k * FRAME_US) // 100 * 100, int(c), int(r), new >= sent[r, c], new))
                sent[r, c] = new
        start += length
    t, cx, cy, p, ticks = map(list, zip(*columns, strict=True))
    return taxel.Events(t, cx, cy, p, array=array, intensity=ticks), truth


def tare() -> taxel.Tare:
    return taxel.Tare.take(taxel.Frames(np.full((2, 8, 8), 60.0), [0, 1000], array=ARRAY))


def recipe() -> Recipe:
    """Contact area, and neurons like the demo's; each is known some frames after the event."""
    return Recipe(
        ContactArea(levels=(2, 4, 8)),
        {"step_ms": 0.192, "lb": -3.0, "ub": 3.0, "refractory": 15.0, "divide_b_by": "targets"},
        {"contact": {"tau": 1.5, "delay_ms": 2.0}, "lift": {"tau": 3.0, "delay_ms": 1.0}},
        run_threshold=0.9,
    )


@pytest.fixture(scope="module")
def readout() -> Readout:
    """Learnt on other seeds than the tests play."""
    return fit([Example(*touches(seed), tare()) for seed in (1, 2, 3)], recipe(), by_rule=())._with_rules({})


def plain(encoder: taxel.encode.Encoder, array: taxel.Array, seed: int = 0, **neuron: object) -> Readout:
    """A readout of random weights, which says much and means nothing."""
    inputs = encoder.trains(array) * (2 if encoder.signed else 1)
    random = np.random.default_rng(seed)
    neurons = {
        label: (taxel.Neuron(tau=3.0, refractory=5.0, **neuron), random.normal(0.1, 0.5, inputs), 0.25 * k)
        for k, label in enumerate(("a", "b", "c"))
    }
    return Readout(encoder, neurons, array=array)


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


def test_weights_must_be_one_a_copy() -> None:
    with pytest.raises(taxel.ProblemError, match=r"8 weights, .* at 2 delays"):
        Readout(LevelCrossing([0.5]), {"a": (taxel.Neuron(), [0.1] * 8)}, array=taxel.Array(2, 2), delays_ms=[0.0, 1.0])


def test_events_that_were_never_seen_are_found_by_what_was_learnt(readout: Readout) -> None:
    for seed in (11, 12):
        events, truth = touches(seed)
        result = score(run(readout, events, tare=tare()), truth, 10.0)
        assert (result["contact"].found, result["contact"].false) == (6, 0)
        assert (result["lift"].found, result["lift"].false) == (6, 0)
        assert np.abs(result.errors_ms).max() < 2.0
        # `known` is not corrected for delays: it is later than t by the delay and at most two frames.
        lead = result["contact"].delays_ms - result["contact"].errors_ms
        assert ((lead >= 2.0) & (lead <= 2.0 + 0.4)).all()


def test_a_file_gives_the_same_readout_back(readout: Readout, tmp_path) -> None:
    path = readout.save(tmp_path / "readout.json")
    again = Readout.load(path)
    assert again == readout
    events, _ = touches(20, count=2)
    assert run(again, events, tare=tare()) == run(readout, events, tare=tare())
    for label, one in again.neurons.items():
        assert one.weights.tobytes() == readout.neurons[label].weights.tobytes()
        assert one.neuron == readout.neurons[label].neuron
    with pytest.raises(FileExistsError):
        readout.save(path)
    readout.save(path, overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == ["readout.json"]


def test_a_readout_holds_what_it_was_given(readout: Readout) -> None:
    assert readout.labels == ("contact", "lift")
    assert (readout.time, readout.after_spike, readout.run_threshold) == ("grid", "keep", 0.9)
    assert (readout.array, readout.encoder) == (ARRAY, ContactArea(levels=[2, 4, 8]))
    assert {label: one.delay_ms for label, one in readout.neurons.items()} == {"contact": 2.0, "lift": 1.0}
    assert repr(readout).startswith("Readout(contact, lift; ContactArea(")
    assert repr(readout).endswith("on 8 x 8 taxels; grid, keep, threshold x 0.9)")
    made = Readout(readout.encoder, readout.neurons, array=ARRAY, unit="ticks", run_threshold=0.9)
    assert made != readout, "what was seen in training belongs to it"
    assert made._with(seen=readout._parts["seen"]) == readout
    assert Readout.from_json(readout.to_json()) == readout
    assert readout != 3


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


def test_detections_in_frames_are_known_when_the_frame_ends() -> None:
    values = np.zeros((40, 8, 8))
    values[10:, 3, 3] = 100.0
    frames = taxel.Frames(values, np.arange(40) * 2000 + 13, array=ARRAY)
    weights = np.zeros(128)
    weights[27] = 2.0
    read = Readout(LevelCrossing([50.0]), {"contact": TrainedNeuron(taxel.Neuron(tau=1.0), weights, 0.1)})
    found = run(read, frames)
    assert found.known.tolist() == [13 + 11 * 2000]
    assert run(read, frames, frame_us=500).known.tolist() == [13 + 10 * 2000 + 500]
    stream = read.stream(frame_us=2000)
    parts = [stream.push(frames[k : k + 3]) for k in range(0, 40, 3)]
    assert together([*parts, stream.advance(10**6)]) == found


def test_a_late_event_is_counted_and_taken_as_coming_now(readout: Readout) -> None:
    events, _ = touches(7, count=1)
    stream = readout.stream(tare=tare())
    stream.push(events[:90])
    stream.advance(int(events.t[89]) + 5000)
    stream.push(events[70:80])
    assert stream.late == 10


def test_a_missing_tare_is_said_and_taken_when_given(readout: Readout) -> None:
    events, _ = touches(8, count=1)
    with pytest.raises(taxel.ProblemError, match="tare"):
        run(readout, events)
    with pytest.raises(taxel.ProblemError, match="tare"):
        readout.stream()
    assert len(run(readout, events, tare=tare())) == 2


def test_another_array_is_refused(readout: Readout) -> None:
    other = taxel.Events([1], [1], [1], [True], array=taxel.Array(9, 8), intensity=[5])
    with pytest.raises(taxel.ProblemError, match="9 x 8 taxels: the readout was trained on 8 x 8"):
        run(readout, other, tare=tare())
    stream = readout.stream(tare=tare())
    with pytest.raises(taxel.ProblemError, match="input from 9 x 8 taxels"):
        stream.push(other)


def test_neurons_trained_otherwise_are_refused() -> None:
    weights = np.ones(6)
    area = ContactArea(levels=(2, 4, 8))
    first = (taxel.Neuron(), weights)
    with pytest.raises(taxel.ProblemError, match='b: the neuron was trained for after_spike "reset", but this'):
        Readout(area, {"a": first, "b": (taxel.Neuron(after_spike="reset"), weights)})
    with pytest.raises(
        taxel.ProblemError, match='b: the neuron was trained for time "grid", but this readout is for time "continuous"'
    ):
        Readout(area, {"a": first, "b": (taxel.Neuron(time="grid"), weights)})
    with pytest.raises(taxel.ProblemError, match=r"c: ConeR.* is not fitted"):
        Readout(area, {"c": taxel.learn.ConeR()})
