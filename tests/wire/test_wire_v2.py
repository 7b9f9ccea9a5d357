"""Version 2 from Python: the shared vectors, any network, two threads, and the slow reader as oracle."""

import json
import random
import struct
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import taxel
from taxel import _core, wire
from taxel.wire import StreamReader, decode

from .oracle_v2 import Reader, datagram, markers, words
from .oracle_v2 import decode as slow

DATA = Path(__file__).parent.parent / "data" / "wire_v2"
VECTORS = sorted(path.stem for path in DATA.glob("*.json"))


def Decoder(**arguments):  # noqa: N802  of this page's version
    return wire.Decoder(2, **arguments)


def rows(heard):
    for e in heard:
        values = [None] * len(e)
        if e.intensity is not None:
            values = [int(ticks) if there else None for ticks, there in zip(e.intensity, e.present, strict=True)]
        repaired = np.zeros(len(e), bool) if e.repaired is None else e.repaired
        yield from zip(e.t.tolist(), e.x.tolist(), e.y.tolist(), e.p.tolist(), values, repaired.tolist(), strict=True)


@pytest.mark.parametrize("name", VECTORS)
def test_a_vector_means_what_its_json_says(name):
    meaning = json.loads((DATA / f"{name}.json").read_text())
    data, given_, at = (DATA / f"{name}.bin").read_bytes(), [], 0
    while at < len(data):
        end = at + 2 + int.from_bytes(data[at : at + 2], "little")
        given_.append(data[at + 2 : end])
        at = end
    decoder = Decoder(array=taxel.Array(meaning["rows"], meaning["columns"]))
    heard = [decoder.push(d) for d in given_]
    assert [list(row) for row in rows(heard)] == meaning["events"]
    assert [list(m) for e in heard for m in e.markers] == meaning["markers"]
    counts = asdict(decoder.counts)
    assert {name: counts[name] for name in meaning["counts"]} == meaning["counts"]
    events, marks, told = slow(given_, meaning["rows"], meaning["columns"])
    assert ([*map(list, events)], [*map(list, marks)]) == (meaning["events"], meaning["markers"])
    assert {name: told[name] for name in meaning["counts"]} == meaning["counts"]


@given(seed=st.integers(0, 2**32 - 1), kind=st.sampled_from([0, 1, 2, 6, 7]), stride=st.integers(0, 9))
def test_any_words_of_the_slow_writer_are_read(seed, kind, stride):
    """Times in any order within the reach of an offset, rows ascending within a line."""
    draw = random.Random(seed)
    columns = min(256, 2 ** (16 - stride))
    base, top = draw.randrange(2**48 - 40_000), (0, 255, 65_535, 0, 0, 0, 255, 65_535)[kind]
    events = []
    for _ in range(draw.randrange(6)):
        t, x = base + draw.choice([0, 0, 1, 192, 32_511]), draw.randrange(columns)
        rows_ = sorted(draw.sample(range(2**stride), draw.randrange(min(2**stride, 8) + 1)))
        events += [(t, x, y, draw.random() < 0.5, draw.randrange(top + 1)) for y in rows_]
    line = draw.randrange(min(events[0][1], 127) + 1) if events else draw.randrange(128)
    body = words(kind, events, base=base, stride=stride, line=line)
    data = datagram(kind, body, base=base, stride=stride, line=line, flags=0)
    decoder, reader = Decoder(array=taxel.Array(2**stride, columns)), Reader(2**stride, columns)
    reader.push(data)
    assert list(rows([decoder.push(data)])) == reader.events
    if kind < 6:
        assert [e[:4] for e in reader.events] == [(t, x, y, bool(p)) for t, x, y, p, _ in events]


@given(seed=st.integers(0, 2**32 - 1), valued_from=st.integers(0, 12), states=st.booleans())
def test_a_whole_stream_says_what_the_slow_reader_hears(seed, valued_from, states):
    """Kinds with values begin somewhere or never, states give rows or none, and between datagrams lies what is none."""
    draw, slow, stream, skipped = random.Random(seed), Reader(16, 16), b"", 0
    for sequence in range(12):
        kind = draw.choice([1, 2, 3, 6 if states else 1]) if sequence >= valued_from else 0
        base = 1000 * sequence
        if kind == 3:
            body = markers((draw.randrange(900), draw.choice([1, 2, 3]), 0))
        else:
            places = sorted(draw.sample([(x, y) for x in range(16) for y in range(16)], draw.randrange(60)))
            events = [(base, x, y, draw.random() < 0.5, draw.randrange(256) if kind else 0) for x, y in places]
            body = words(kind, events, base=base, stride=4)
        sent = datagram(kind, body, sequence=sequence, base=base, stride=4)
        slow.push(sent)
        # Bytes that are not a datagram may state a length beyond the end of the stream, and so delay the decoding.
        noise = draw.choice([b"\xff" * draw.randrange(4), draw.randrange(30, 1400).to_bytes(2, "little") + b"\x54\x21"])
        stream, skipped = stream + noise + len(sent).to_bytes(2, "little") + sent, skipped + len(noise)
    reader = StreamReader()
    pieces = reader.push(stream) + reader.finish()
    assert (len(pieces), reader.skipped) == (12, skipped)
    array, one = taxel.Array(16, 16), Decoder(array=taxel.Array(16, 16))
    events = decode(stream, 2, array=array)
    for sent in pieces:
        one.push(sent)
    counts = one.counts
    ticks = [-1] * len(events)
    if events.intensity is not None:
        ticks = [int(v) if there else -1 for v, there in zip(events.intensity, events.present, strict=True)]
    marked = np.zeros(len(events), bool) if events.repaired is None else events.repaired
    columns = (events.t, events.x, events.y, events.p)
    heard = list(zip(*(c.tolist() for c in columns), ticks, marked.tolist(), strict=True))
    assert heard == [(*e[:4], -1 if e[4] is None else e[4], e[5]) for e in slow.events]
    assert list(events.markers) == slow.markers
    assert (counts.intact, counts.events, counts.repaired) == (12, len(events), int(marked.sum()))
    assert (events.repaired is None) == (not marked.any())
    with pytest.raises(ValueError, match="read-only"):
        events.t[:] = 0


@given(data=st.binary(max_size=80), sealed=st.booleans())
def test_any_bytes_are_survived_and_counted(data, sealed):
    if sealed and len(data) >= 20:
        base = int.from_bytes(data[1:7], "little")
        data = datagram(
            data[0] & 15, data[20:], base=base, stride=data[8] & 31, line=data[10] & 127, flags=data[9] & 15
        )
    decoder = Decoder()
    decoder.push(data)
    c = decoder.counts
    assert decoder.last.intact == (c.intact == 1)
    assert c.datagrams == 1 == c.intact + c.repeated + c.old + c.short + c.long + c.foreign + c.checksum


@given(seed=st.integers(0, 2**32 - 1), sessions=st.integers(1, 6), plain=st.booleans())
@settings(max_examples=3 * settings.default.max_examples)
def test_any_order_of_any_sessions_reads_as_the_slow_reader_does(seed, sessions, plain):
    """Late datagrams of earlier sessions, states, first values of 0, and bodies that break the page's rules."""
    draw, sent = random.Random(seed), []
    for session in range(sessions):
        flags = draw.choice([0, 1, 2]) | draw.choice([0, 0, 4, 8])
        for sequence in range(draw.randrange(1, 8)):
            kind = draw.choice([0, 1, 1, 2, 3, 4, 5, 6, 6, 7])
            base, stride = (
                draw.randrange(200),
                4 if plain or draw.random() < 0.8 else draw.choice([0, 3, 9, 16, 17, 31]),
            )
            if kind == 3:
                body = markers(*((draw.choice([0, 5, 2**31]), draw.randrange(4), 9) for _ in range(draw.randrange(4))))
            elif kind in (4, 5):
                body = bytes(draw.choice([0, 39, 40, 48]))
            else:
                times = [0, 0, 1, 50, 32_511] if plain else [0, 1, 50, 32_511, 32_512, 40_000, 65_535]
                events = [
                    (base + t, draw.randrange(17), draw.randrange(16), draw.random() < 0.5, draw.choice([0, 0, 7, 200]))
                    for t in sorted(draw.choice(times) for _ in range(draw.randrange(12)))
                ]
                body = words(kind, events, base=base, stride=min(stride, 4))
            body += b"" if plain else bytes(draw.choice([0, 0, 0, 1, 2, 1400 - 24 - len(body), 1401 - 24 - len(body)]))
            data = datagram(
                kind,
                body,
                session=session,
                sequence=sequence,
                base=base,
                stride=stride,
                flags=flags,
                span=draw.choice([0, 9]),
            )
            # Sessions begin in order; any datagram may be late or lost.
            sent.append((session + (draw.choice([0, 0, 0, 1, 2]) if sequence else 0), draw.random(), data))
    given_ = [data for _, _, data in sorted(sent, key=lambda s: s[:2]) if draw.random() < 0.9]
    decoder, slow = Decoder(array=taxel.Array(16, 16)), Reader(16, 16)
    for data in given_:
        before = len(slow.events), len(slow.markers)
        heard = decoder.push(data)
        slow.push(data)
        assert list(rows([heard])) == slow.events[before[0] :]
        assert list(heard.markers) == slow.markers[before[1] :]
        held = np.full((16, 16), -1)
        for (x, y), value in slow.held.items():
            held[y, x] = value
        assert (decoder.held == held).all()
    counts = asdict(decoder.counts)
    told = {"missing", "events", "markers"}
    assert {name: counts[name] for name in slow.counts if name not in told} == {
        name: count for name, count in slow.counts.items() if name not in told
    }


@pytest.mark.parametrize("first", [0, 5])
def test_what_the_board_counted_as_dropped_is_lost_though_no_flag_came(first, tmp_path):
    """Where datagrams with the flag were lost, or the board sets none; before the first totals nothing is known."""
    sent = []
    for sequence in range(20):
        t, dropped = 200 * sequence, 30 if sequence < 10 else 75
        events = words(1, [(t, 3, 4, sequence % 2 > 0, 40 + sequence)], base=t, stride=6)
        totals = struct.pack("<5Q", sequence, sequence, dropped, sequence, 0)
        is_totals = sequence % 5 == 4
        sent.append(datagram(4 if is_totals else 1, totals if is_totals else events, sequence=sequence, base=t))
    decoder = Decoder()
    for one in sent[first:]:
        decoder.push(one)
    dropped = 45 if first else 75
    assert decoder.counts.events_dropped == dropped
    header = {"array": taxel.Array.thesis()._geometry(), "source": "udp 127.0.0.1:5208", "started_ns": 0}
    writer = _core.RecordingWriter(tmp_path / "a.mcap", json.dumps(header), "none", False)
    for number, one in enumerate(sent[first:]):
        writer.datagram(1_700_000_000_000_000_000 + number * 200_000, number, one)
    del writer
    verdict = taxel.open(tmp_path / "a.mcap").verdict
    assert verdict.lost == {"events_dropped_by_board": dropped}
    assert f"LOST: {dropped} events that the board itself counted as dropped" in verdict
