"""The wire's bytes and events: vectors, laws, and an obvious decoder as oracle."""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from draws import seeds
from hypothesis import given
from hypothesis import strategies as st

import taxel
from taxel import wire

from . import oracle

DATA = Path(__file__).parent.parent / "data" / "wire"
VECTORS = sorted(DATA.glob("*.json"))


def rows(events):
    """Return events as the oracle has them: [t, x, y, p, intensity or None]."""
    none = np.zeros(len(events), bool)
    intensity, present = (none, none) if events.intensity is None else (events.intensity, events.present)
    columns = (events.t, events.x, events.y, events.p, intensity, present)
    return [[*row[:4], row[4] if row[5] else None] for row in zip(*(c.tolist() for c in columns), strict=True)]


def decode(pieces, *, columns=64, rows=64, differences=False):
    """Decode pieces as the oracle does, by `Decoder`."""
    array = taxel.Array(rows, columns)
    decoder, parts = wire.Decoder(array=array, differences=differences), []
    for data, arrived, end in pieces:
        parts.append(decoder.push(data, arrived))
        if end:
            parts.append(decoder.end_of_datagram())
    parts.append(decoder.finish())
    return meaning(parts, decoder)


def meaning(parts, decoder):
    events = [row for part in parts for row in rows(part)]
    markers = [list(marker) for part in parts for marker in part.markers]
    counts = vars(decoder.counts)
    assert not any(count for name, count in counts.items() if name not in oracle.COUNTS), "causes of version 2"
    return oracle.Meaning(events, markers, {name: counts[name] for name in oracle.COUNTS})


def closes(counts):
    kinds = ("changes", "intensities", "unpaired", "markers", "contradictory", "outside")
    return counts["bytes"] == 5 * counts["words"] + counts["skipped"] and counts["words"] == sum(
        counts[kind] for kind in kinds
    )


@pytest.mark.parametrize("path", VECTORS, ids=lambda path: path.stem)
def test_a_vector_means_what_its_json_says(path):
    said, data, pieces = json.loads(path.read_text()), path.with_suffix(".bin").read_bytes(), []
    for length, arrived, end in said["pieces"]:
        pieces.append((data[:length], arrived, end))
        data = data[length:]
    assert not data
    options = {key: said[key] for key in ("columns", "rows", "differences")}
    expected = oracle.Meaning(said["events"], said["markers"], said["counts"])
    assert decode(pieces, **options) == expected
    assert oracle.decode(pieces, **options) == expected


words = st.builds(
    oracle.word,
    st.sampled_from(["change", "change", "change", "intensity", "intensity", "marker", "contradictory"]),
    st.one_of(st.integers(0, 65_535), st.integers(0, 3)),
    st.integers(0, 63) | st.integers(0, 2),
    st.integers(0, 63) | st.integers(0, 2),
    st.booleans(),
    unused=st.integers(0, 15),
)
streams = st.lists(words | st.binary(max_size=7), max_size=60).map(b"".join)
sensors = st.sampled_from([{}, {"columns": 3, "rows": 2}, {"columns": 40, "rows": 80}])
ways = st.fixed_dictionaries({"differences": st.booleans()})


@given(data=streams, sensor=sensors, way=ways)
def test_any_bytes_mean_what_the_reference_says_and_the_sums_close(data, sensor, way):
    found = decode([(data, None, False)], **sensor, **way)
    assert found == oracle.decode([(data, None, False)], **sensor, **way)
    assert found.counts["bytes"] == len(data)
    assert closes(found.counts)


@given(
    data=streams,
    cuts=st.lists(
        st.tuples(st.integers(0, 300), st.none() | st.integers(0, 10**8), st.booleans()),
        max_size=8,
    ),
    way=ways,
)
def test_datagrams_and_arrivals_mean_what_the_reference_says(data, cuts, way):
    cuts = sorted(cuts, key=lambda cut: cut[0])
    places = [0, *(min(place, len(data)) for place, _, _ in cuts), len(data)]
    ends = [*((arrived, end) for _, arrived, end in cuts), (None, False)]
    pieces = [(data[a:b], *end) for (a, b), end in zip(pairwise(places), ends, strict=True)]
    assert decode(pieces, **way) == oracle.decode(pieces, **way)


def random_stream(rng, words):
    """Long runs of changes, of pairs, of a mix, with rare damage: what the block decoders meet."""
    out, stamp = [], int(rng.integers(65_536))
    while len(out) < words:
        style, rise = rng.integers(4), rng.random() < 0.5
        for _ in range(rng.integers(1, 150)):
            stamp += int(rng.integers(0, 3)) if rise else 0
            if style == 3 and rng.random() < 0.02:
                stamp += int(rng.integers(-1100, 66_000))
            x, y, p = int(rng.integers(64)), int(rng.integers(64)), bool(rng.integers(2))
            out.append(oracle.word("change", stamp % 65_536, x, y, p, unused=int(rng.integers(16))))
            if style == 1 or (style > 1 and rng.random() < 0.5):
                out.append(oracle.word("intensity", int(rng.integers(65_536)), x, y ^ int(rng.random() < 0.02), p))
            if style == 3 and rng.random() < 0.01:
                out.append(rng.bytes(rng.integers(1, 8)))
    return b"".join(out)


@pytest.mark.parametrize("seed", seeds(12, quick=4))
def test_long_streams_mean_what_the_reference_says(seed):
    rng = np.random.default_rng(seed)
    data = random_stream(rng, 4000)
    sensor = {"columns": 64, "rows": int(rng.choice([64, 63, 200]))}
    whole = decode([(data, None, False)], **sensor)
    assert whole == oracle.decode([(data, None, False)], **sensor)
    assert closes(whole.counts)
    decoder = wire.Decoder(array=taxel.Array(sensor["rows"], 64))
    parts, at = [], 0
    while at < len(data):
        step = int(rng.integers(1, 3000))
        pushed = decoder.push(data[at : at + step])
        parts.append(oracle.Meaning(rows(pushed), list(pushed.markers)))
        at += step
    parts.append(oracle.Meaning(rows(decoder.finish())))
    assert [row for part in parts for row in part.events] == whole.events
    assert [list(m) for part in parts for m in part.markers] == whole.markers
    assert meaning([], decoder).counts == whole.counts


events = st.integers(0, 40).flatmap(
    lambda n: st.tuples(
        st.lists(st.integers(0, 64_000), min_size=n, max_size=n),
        st.lists(st.tuples(st.integers(0, 63), st.integers(0, 63), st.booleans()), min_size=n, max_size=n),
        st.lists(st.none() | st.integers(0, 65_535), min_size=n, max_size=n),
        st.lists(st.booleans(), max_size=3),
    )
)


@given(drawn=events)
def test_events_come_back_from_their_bytes(drawn):
    steps, taxels, ticks, marks = drawn
    t = 100 * np.cumsum(np.array(steps, np.int64))
    x, y, p = (list(column) for column in zip(*taxels, strict=True)) if taxels else ([], [], [])
    # Markers have the times of events, so that no silence is longer than the clock can resolve.
    markers = [(int(t[0]) if len(t) else 0, mark) for mark in marks]
    wraps = 6_553_600 * (markers[0][0] // 6_553_600 if markers else (int(t[0]) // 6_553_600 if len(t) else 0))
    pairs = {}
    if any(tick is not None for tick in ticks):
        pairs = {"intensity": [tick or 0 for tick in ticks], "present": [tick is not None for tick in ticks]}
    given_events = taxel.Events(t - wraps, x, y, p, array=taxel.Array(64, 64, name="a"), markers=markers, **pairs)
    given_events.markers = tuple((at - wraps, mark) for at, mark in markers)
    assert wire.decode(wire.encode(given_events), array=given_events.array) == given_events


def test_bytes_come_from_any_buffer_and_stay_as_they_are():
    data = oracle.word("change", 7, 1, 2) * 3
    expected = wire.decode(data)
    mutable = bytearray(data)
    for same in (mutable, memoryview(data), np.frombuffer(data, np.uint8)):
        assert wire.decode(same) == expected
    assert mutable == data
    assert len(wire.decode(b"")) == 0


def test_an_end_of_stream_begins_anew_but_counts_on():
    decoder = wire.Decoder()
    for _ in range(2):
        assert len(decoder.push(oracle.word("change", 60_000, 1, 1))) == 0
        assert decoder.finish().t.tolist() == [6_000_000]
    assert decoder.counts.words == 2


def test_events_hold_no_memory_that_can_change_nor_much_for_few():
    word = bytes.fromhex("c000050304 e000280304")
    for data in (100 * word, word + bytes(10_000)):
        events = wire.decode(data)
        for name in ("t", "x", "y", "p", "intensity", "present"):
            part, held = getattr(events, name), 0
            while isinstance(part, np.ndarray):
                assert not part.flags.writeable, name
                part, held = part.base, part.nbytes
            assert held <= 8 * 16 * 2 * len(events), name
