"""Laws that every encoder keeps: pieces, shifts, permutations, masks, names. They run over the registry.

`tests/encode/test_NAME.py` has the examples of the encoder NAME, `EXAMPLES`, with the options that hold time back; and
unless each taxel has one train, either `trains_of(encoder, taxels, of)`, the numbers of the trains of some of so many
taxels, or, where no train belongs to one taxel, `turned(encoder)`, the trains as they stand when the array is turned by
half a turn. `REPAIRED` states
what the encoder does with an event that a state repaired: "read" (as any other), "silent" (its reference moves, without
a spike) or "both".
"""

from copy import copy
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusal import refused

import taxel
from taxel import Array, Events, Frames, _core
from taxel.encode import ChangeEvents, ContactArea, Encoder

from .scenes import ARRAY, at_times, ended, frames_of, rest, spikes_of, touch, wander

ROOT = Path(__file__).parents[2]
#: The composite is made of the others, so it is no line of the registry.
NAMES = [*_core.encoder_names(), "composite"]
#: The test module of every encoder by name, with its examples; a missing module fails the first test.
FILES = {
    name: import_module(f".test_{name}", __package__)
    for name in NAMES
    if (ROOT / f"tests/encode/test_{name}.py").exists()
}
ENCODERS = {label: encoder for file in FILES.values() for label, encoder in getattr(file, "EXAMPLES", {}).items()}
each_encoder = pytest.mark.parametrize("encoder", ENCODERS.values(), ids=ENCODERS)
#: Levels of the local load are read at each stamp of events, not once a period.
SAMPLED = {k: one for k, one in ENCODERS.items() if hasattr(one, "period_ms") and k != "local load, levels"}
each_sampled_encoder = pytest.mark.parametrize("encoder", SAMPLED.values(), ids=SAMPLED)
OF_THE_ARRAY = {label: encoder for label, encoder in ENCODERS.items() if hasattr(FILES[encoder.name], "turned")}
BY_TAXEL = {label: one for label, one in ENCODERS.items() if label not in OF_THE_ARRAY and one.name != "composite"}
#: Encoders without the option that encodes the first window only when it is complete, and therefore late.
PROMPT = {name: encoder for name, encoder in ENCODERS.items() if "by itself" not in name}
seeds = st.integers(0, 2**32 - 1)


def named(folder, pattern):
    """What files of a folder are called, less what all of them share."""
    before, _, after = pattern.partition("*")
    return {f.name.removeprefix(before).removesuffix(after) for f in (ROOT / folder).glob(pattern)}


def test_an_encoder_has_a_file_in_each_place_and_nothing_is_left_out():
    assert set(Encoder._by_name) == set(NAMES), "a line in python/taxel/encode/__init__.py"
    wanted = set(NAMES) - {"composite"}
    python = {f for f in named("python/taxel/encode", "*.py") if not f.startswith("_")}
    assert wanted <= named("crates/taxel-core/src/encode", "*.rs"), "crates/taxel-core/src/encode/NAME.rs"
    assert python == wanted, (
        "python/taxel/encode/NAME.py, and a line in the registry of crates/taxel-core/src/encode.rs"
    )
    assert wanted <= named("tests/encode", "test_*.py"), "tests/encode/test_NAME.py"
    measured = (ROOT / "benchmarks/taxel_benchmarks/encode.py").read_text()
    assert all(f'"encode_{name}"' in measured for name in wanted - {"sa1", "sa2", "fa2"}), "a row of BENCHMARKS there"
    for name, file in FILES.items():
        if name == "composite":
            continue
        examples = getattr(file, "EXAMPLES", {})
        assert examples, f"EXAMPLES in tests/encode/test_{name}.py"
        assert getattr(file, "REPAIRED", None) in ("read", "silent", "both"), f"REPAIRED in tests/encode/test_{name}.py"
        assert {example.name for example in examples.values()} == {name}
        ways = [way for way in ("trains_of", "turned", "places") if hasattr(file, way)]
        assert len(ways) <= 1, f"trains_of, turned or places in test_{name}.py"


def trains_of(encoder, taxels, of):
    """The numbers of the trains of some taxels."""
    return getattr(FILES[encoder.name], "trains_of", lambda _, taxels, of: taxels)(encoder, taxels, of)


def in_pieces(encoder, pieces, moves):
    """All spikes of a stream, in the order in which they came; `moves` says where time is moved on before a piece."""
    stream, spikes = encoder.stream(), []
    for k, piece in enumerate(pieces):
        if k in moves:
            spikes += spikes_of(stream.advance(moves[k]))
        spikes += spikes_of(stream.push(piece))
    return spikes + spikes_of(stream.finish())


@each_encoder
@settings(max_examples=settings.default.max_examples // 3, deadline=None)
@given(
    seed=seeds,
    cuts=st.sets(st.integers(1, 299), max_size=12),
    late=st.sampled_from([0.0, 0.1]),
    repaired=st.sampled_from([0.0, 0.02, 0.3]),
)
def test_events_in_pieces_give_the_spikes_of_the_whole(encoder, seed, cuts, late, repaired):
    rng = np.random.default_rng(seed)
    events = touch(rng, ARRAY, late=late, repaired=repaired)
    edges = [0, *sorted(cuts), len(events)]
    pieces = [events[a:b] for a, b in pairwise(edges)]
    latest = np.maximum.accumulate(events.t)
    # Time may be advanced up to the next stamp, or up to the latest one if the next event is late.
    moves = {
        k: int(rng.integers(latest[a - 1], max(latest[a - 1], events.t[a]) + 1))
        for k, a in enumerate(edges[:-1])
        if k > 0 and rng.random() < 0.7
    }
    whole = encoder.encode(events)
    assert sorted(in_pieces(encoder, pieces, moves)) == spikes_of(whole)


@each_encoder
@settings(max_examples=settings.default.max_examples // 4, deadline=None)
@given(
    seed=seeds,
    cuts=st.sets(st.integers(1, 299), max_size=8),
    share=st.sampled_from([0.01, 0.2]),
    back=st.sampled_from([1, 300, 99_999, 100_000, 100_001, 10**6]),
)
def test_events_out_of_order_are_heard_as_a_stream_hears_them_or_refused(encoder, seed, cuts, share, back):
    """0.1 s is the farthest that one datagram overtakes another; what is far behind is no recording in order."""
    rng = np.random.default_rng(seed)
    ordered = touch(rng, ARRAY)
    behind = rng.random(len(ordered)) < share
    t = ordered.t - behind * rng.choice([back, rng.integers(0, back + 1)], len(ordered))
    events, heard = at_times(ordered, t), at_times(ordered, np.maximum.accumulate(t))
    far = np.flatnonzero(heard.t - t > 100_000)
    stream, spikes = encoder.stream(), []
    for a, b in pairwise([0, *sorted(cuts), len(t)]):
        spikes += spikes_of(stream.push(events[a:b]))
        assert stream.late == np.count_nonzero(far < b)
    wanted = spikes_of(encoder.encode(heard))
    assert sorted(spikes + spikes_of(stream.finish())) == wanted
    if len(far):
        with refused():
            encoder.encode(events)
    else:
        assert spikes_of(encoder.encode(events)) == wanted
    encoder.encode(events.sorted())


#: Encoders of changes: the time of a change is unknown for a value that a state repaired, so they emit no spike for it.
OF_CHANGE = {label: e for label, e in ENCODERS.items() if getattr(FILES[e.name], "REPAIRED", "") == "silent"}
OF_VALUES = {label: e for label, e in ENCODERS.items() if getattr(FILES[e.name], "REPAIRED", "") == "read"}


@pytest.mark.parametrize("encoder", OF_VALUES.values(), ids=OF_VALUES)
def test_what_reads_values_takes_a_repaired_one_as_any_other(encoder):
    events = ended(touch(np.random.default_rng(5), ARRAY, repaired=0.5))
    assert events.repaired is not None
    plain = Events(
        events.t, events.x, events.y, events.p, array=ARRAY, intensity=events.intensity, present=events.present
    )
    spikes = spikes_of(encoder.encode(plain))
    assert spikes_of(encoder.encode(events)) == spikes
    assert spikes


@pytest.mark.parametrize("encoder", OF_CHANGE.values(), ids=OF_CHANGE)
@settings(max_examples=20, deadline=None)
@given(seed=seeds)
def test_what_tells_changes_tells_none_of_a_repaired_value(encoder, seed):
    rng = np.random.default_rng(seed)
    events = touch(rng, ARRAY, absent=0.0)
    places = events.y * ARRAY.columns + events.x
    # A taxel's first value is not a change; all later values are repaired. The first values have their own stamp, so
    # that they are sampled before.
    first = np.unique(places, return_index=True)[1]
    start = np.zeros(len(first), np.int64)
    t = np.concatenate([start, events.t])
    x, y, p = (np.concatenate([c[first], c]) for c in (events.x, events.y, events.p))
    ticks = np.concatenate([events.intensity[first], events.intensity])
    mask = np.arange(len(t)) >= len(first)
    assert spikes_of(encoder.encode(Events(t, x, y, p, array=ARRAY, intensity=ticks, repaired=mask))) == []
    assert spikes_of(encoder.encode(Events(t, x, y, p, array=ARRAY, intensity=ticks)))


@settings(max_examples=30, deadline=None)
@given(seed=seeds, share=st.sampled_from([0.05, 0.5]))
def test_change_events_after_a_repair_are_those_of_a_way_that_loses_nothing(seed, share):
    """A change is lost, a state tells it 50 us later: its spike is missing, all others are as they would have been."""
    rng = np.random.default_rng(seed)
    n = 200
    t = 1000 + 300 * np.arange(n)
    x, y = rng.integers(0, ARRAY.columns, n), rng.integers(0, ARRAY.rows, n)
    ticks = rng.permutation(np.arange(n)) + 1
    p = np.ones(n, bool)
    encoder = ChangeEvents(noise_floor=0.5, bits=10)
    whole = spikes_of(encoder.encode(Events(t, x, y, p, array=ARRAY, intensity=ticks)))
    lost = rng.random(n) < share
    lost[0] = False
    when = np.where(lost, t + 50, t)
    heard = Events(when, x, y, p, array=ARRAY, intensity=ticks, repaired=lost)
    gone = set(t[lost].tolist())
    assert spikes_of(encoder.encode(heard)) == [s for s in whole if s[0] not in gone]


@each_encoder
def test_events_backwards_are_refused_by_whoever_takes_a_whole_recording(encoder):
    events = touch(np.random.default_rng(18), ARRAY)[::-1]
    readout = taxel.Readout(encoder, {"a": (taxel.Neuron(), np.ones(encoder.trains(ARRAY) * (1 + encoder.signed)))})
    for take in (encoder.encode, taxel.Tare.take, lambda x: taxel.detect.run(readout, x, tare=rest(ARRAY))):
        with refused():
            take(events)
        take(events.sorted())


def test_time_moved_on_makes_what_comes_behind_it_late():
    stream = ENCODERS["change"].stream(ARRAY)
    for t, late in ((0, 0), (900_000, 0), (800_000, 0), (899_999, 1), (1_000_000, 1)):
        stream.push(Events([t], [0], [0], [1], array=ARRAY, intensity=[5]))
        stream.advance(10**6 if t == 800_000 else 0)
        assert stream.late == late


@each_encoder
@settings(max_examples=settings.default.max_examples // 4, deadline=None)
@given(seed=seeds, cuts=st.sets(st.integers(1, 199), max_size=12))
def test_frames_in_pieces_give_the_spikes_of_the_whole(encoder, seed, cuts):
    rng = np.random.default_rng(seed)
    period = round(1000 * getattr(encoder, "period_ms", 0.192))
    frames = Frames(wander(rng, 200, 12).reshape(200, 3, 4), 700 + np.arange(200) * period, unit="ticks", array=ARRAY)
    edges = [0, *sorted(cuts), len(frames)]
    pieces = [frames[a:b] for a, b in pairwise(edges)]
    moves = {
        k: int(frames.t[a - 1] + rng.integers(0, period + 1))
        for k, a in enumerate(edges[:-1])
        if k > 0 and rng.random() < 0.7
    }
    whole = encoder.encode(frames)
    assert sorted(in_pieces(encoder, pieces, moves)) == spikes_of(whole)


@pytest.mark.parametrize("encoder", PROMPT.values(), ids=PROMPT)
@settings(max_examples=10, deadline=None)
@given(seed=seeds)
def test_a_stream_speaks_in_order_and_never_of_what_it_called_over(encoder, seed):
    events, stream = touch(np.random.default_rng(seed), ARRAY), encoder.stream(ARRAY)
    over = -np.inf
    for k in range(0, len(events), 7):
        piece = stream.push(events[k : k + 7])
        assert piece.start <= piece.stop
        assert (piece.times * 1000 >= over - 1e-6).all()
        over = events.t[min(k + 6, len(events) - 1)]
        assert (piece.times * 1000 <= over + 1e-6).all()


@each_encoder
@settings(max_examples=settings.default.max_examples // 6, deadline=None)
@given(seed=seeds, shift=st.sampled_from([-(10**12), -7, 1, 193, 10**9]))
def test_a_shift_in_time_shifts_the_spikes(encoder, seed, shift):
    events = touch(np.random.default_rng(seed), ARRAY)
    shifted = events[:]
    shifted.t = events.t + shift
    wanted = [(t + shift, train, value) for t, train, value in spikes_of(encoder.encode(events))]
    assert spikes_of(encoder.encode(shifted)) == wanted


@each_sampled_encoder
def test_events_read_as_held_values_are_frames_of_these(encoder):
    events = touch(np.random.default_rng(11), ARRAY)
    spikes = encoder.encode(events)
    period = round(encoder.period_ms * 1000)
    frames = Frames.from_events(events, period, stop=int(spikes.stop * 1000 - 1000 * encoder.latency_ms) + 1)
    values = frames.values.copy()
    values[0] = Frames.from_events(events[events.t == events.t[0]], 1).values[0]
    frames = Frames(values, frames.t, unit=frames.unit, array=frames.array)
    assert spikes_of(encoder.encode(frames)) == [
        s for s in spikes_of(spikes) if s[0] <= frames.t[-1] + 1000 * encoder.latency_ms
    ]


@pytest.mark.parametrize("encoder", BY_TAXEL.values(), ids=BY_TAXEL)
def test_permuted_taxels_give_permuted_trains(encoder):
    rng = np.random.default_rng(12)
    period = round(encoder.period_ms * 1000)
    t, values, order = np.arange(300) * period, wander(rng, 300, 130), rng.permutation(130)
    plain, permuted = encoder.encode(frames_of(t, values)), encoder.encode(frames_of(t, values[:, order]))
    trains = trains_of(encoder, order, 130)
    assert spikes_of(permuted) == spikes_of(plain.select(trains.astype(int)))


@pytest.mark.parametrize("encoder", OF_THE_ARRAY.values(), ids=OF_THE_ARRAY)
def test_an_array_that_is_turned_gives_the_same_trains_as_they_stand_then(encoder):
    rng = np.random.default_rng(13)
    frames, t = wander(rng, 200, 12).reshape(200, 3, 4), np.arange(200) * 200
    frames[-10:] = 55  # at rest
    plain, turned = (encoder.encode(Frames(p, t, array=ARRAY)) for p in (frames, frames[:, ::-1, ::-1]))
    assert spikes_of(plain)
    assert spikes_of(turned) == spikes_of(plain.select(FILES[encoder.name].turned(encoder)))


@each_encoder
def test_taxels_that_do_not_exist_have_no_train_and_are_not_heard(encoder):
    rng = np.random.default_rng(14)
    exists = rng.random((3, 4)) < 0.6
    masked = Array(3, 4, pitch_mm=1.0, exists=exists)
    events = touch(rng, ARRAY)
    some = Events(
        events.t, events.x, events.y, events.p, array=masked, intensity=events.intensity, present=events.present
    )
    if encoder.name not in {e.name for e in BY_TAXEL.values()}:
        encoder = encoder.with_tare(rest(masked))
        # The first and the last event stay, because they define the start and the end of time.
        only = some[exists[some.y, some.x] | np.isin(np.arange(len(some)), [0, len(some) - 1])]
        assert spikes_of(encoder.encode(some)) == spikes_of(encoder.encode(only))
        return
    taxels = np.flatnonzero(exists)
    trains = trains_of(encoder, taxels, 12).astype(int)
    assert encoder.trains(masked) == len(trains)
    wanted = encoder.encode(events).select(trains)
    assert spikes_of(encoder.encode(some)) == spikes_of(wanted)


@each_encoder
def test_the_caller_s_arrays_stay_as_they_are(encoder):
    events = touch(np.random.default_rng(15), ARRAY)
    before = events[:].to_numpy().copy()
    encoder.encode(events)
    assert np.array_equal(events.to_numpy(), before)


@each_encoder
def test_an_encoder_comes_back_from_json(encoder):
    again = Encoder.from_json(encoder.to_json())
    assert type(again) is type(encoder)
    assert again == encoder
    assert again.to_json() == encoder.to_json()
    assert again != ChangeEvents(bits=9)
    assert (again == 5) is False


def test_a_tare_given_later_is_as_good_as_one_given_at_once():
    for encoder in ENCODERS.values():
        given = encoder.with_tare(rest(ARRAY))
        # Encoders of sustained pressure measure it from 0 if they have no tare.
        assert given == (copy(encoder).set_params(tare=rest(ARRAY)) if "tare" in encoder.get_params() else encoder)
    assert ContactArea(levels=[1, 2, 4, 8]).with_tare(rest(ARRAY)) == ENCODERS["area"]


@each_encoder
def test_an_encoder_says_its_trains_as_its_spikes_have_them(encoder):
    spikes = encoder.encode(touch(np.random.default_rng(16), ARRAY))
    assert (encoder.trains(ARRAY), encoder.signed) == (len(spikes), spikes.signed)


def test_nothing_in_gives_nothing_out():
    empty = Events([], [], [], [], array=ARRAY, intensity=[])
    for encoder in ENCODERS.values():
        for nothing in (empty, Frames(np.empty((0, 3, 4)), [], array=ARRAY)):
            spikes = encoder.encode(nothing)
            assert (len(spikes), len(spikes.times)) == (encoder.trains(ARRAY), 0)
        stream = encoder.stream()
        assert len(stream.advance(10**9).times) == 0
        assert len(stream.push(empty).times) == 0
        assert len(stream.finish().times) == 0


def test_a_long_silence_costs_no_time_once_nothing_can_come():
    """36 years of silence, which no encoder may step through."""
    year = 365 * 86_400 * 10**6
    for name in ("change", "crossing", "FA-1", "area", "moments, crossings of two"):
        stream = ENCODERS[name].stream(ARRAY)
        stream.push(touch(np.random.default_rng(17), ARRAY))
        stream.advance(36 * year)
        stream.push(Events([36 * year + 5], [0], [0], [1], array=ARRAY, intensity=[150]))
        assert stream.finish().stop >= 36 * year / 1000


@each_encoder
def test_what_cannot_be_encoded_is_refused(encoder):
    def refuses(*pieces):
        stream = encoder.stream(ARRAY)
        for piece in pieces[:-1]:
            stream.push(piece)
        with refused():
            stream.push(pieces[-1])

    heard = Events([5], [0], [0], [1], array=ARRAY, intensity=[5])
    frame = Frames(np.zeros((1, 3, 4)), [0], array=ARRAY)
    refuses(Events([5], [0], [0], [1], array=ARRAY))
    refuses(heard, frame)
    refuses(frame, heard)
    refuses(frame, frame)
    refuses(Events([5], [0], [0], [1], array=Array(4, 4), intensity=[5]))
    refuses(Frames(np.zeros((1, 4, 4)), [0]))
    refuses(Frames(np.full((1, 3, 4), np.nan), [0], array=ARRAY))
    refuses(Events([2**62], [0], [0], [1], array=ARRAY, intensity=[5]))
    refuses(Frames(np.zeros((1, 3, 4)), [-(2**62)], array=ARRAY))
