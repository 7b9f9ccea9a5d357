"""The numbers of a verdict are the known losses, and its status is never better than the truth, whatever goes wrong."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from draws import seeds
from loopback import until
from mcap.reader import make_reader
from mcap.writer import Writer

import taxel
from taxel import Verdict, _core
from taxel.live.summary import summary_of
from taxel.reading import Facts, InMemory
from taxel.simulate import Board, Version2
from taxel.verdict import STATUSES
from taxel.wire import Registers

from .making import HEADER, record, some_events

START_NS = HEADER["started_ns"]
FINE = Verdict._of({"counts": {"received": 5, "recorded": 5, "dropped_by_kernel": 0, "missing": 0}})


def at_least(verdict: Verdict, status: str) -> bool:
    """Whether a status is that one or a worse one."""
    return STATUSES.index(verdict.status) >= STATUSES.index(status)


@cache
def sent_by_a_board(frames: int = 1500) -> list[bytes]:
    """The datagrams of version 2 of a board of which some taxels change in each frame, by sequence number."""
    board = Board(Registers(wire_version=2), version_2=Version2(states_us=0))
    draw, held = np.random.default_rng(3), np.full(4096, 20, np.uint16)
    sent = []
    for _ in range(frames):
        held[draw.integers(0, 4096, 200)] ^= 64
        sent += board.frame(held)
    return sent


@dataclass
class Told:
    """What is known to have happened on the way to a file."""

    lost: set[int] = field(default_factory=set)
    damaged: int = 0
    repeated: int = 0
    dropped: int = 0
    #: The most datagrams by which one was overtaken.
    overtaken: int = 0


def on_the_way(sent: list[bytes], draw: np.random.Generator, told: Told) -> list[bytes]:
    """The datagrams that arrive: some are lost, damaged, repeated or overtaken; the first and the last arrive whole."""
    share = draw.choice([0.0, 0.02, 0.1], 4)
    came, overtaken = [], 0
    for number, one in enumerate(sent):
        inner = 0 < number < len(sent) - 1
        if inner and draw.random() < share[0]:
            told.lost.add(number)
            continue
        if inner and draw.random() < share[1]:
            bad = bytearray(one)
            # Not in the first two bytes, which tell the version of the wire.
            bad[int(draw.integers(2, len(bad)))] ^= int(draw.integers(1, 256))
            told.lost.add(number)
            told.damaged += 1
            came.append(bytes(bad))
            continue
        came.append(one)
        if inner and draw.random() < share[2]:
            told.repeated += 1
            came.append(one)
        overtakes = len(came) > 2 and inner and draw.random() < share[3]
        if overtakes:
            came[-1], came[-2] = came[-2], came[-1]
        overtaken = overtaken + 1 if overtakes else 0
        told.overtaken = max(told.overtaken, overtaken)
    return came


def write(path: Path, came: list[bytes], draw: np.random.Generator, told: Told, *, finish: bool) -> None:
    """Record as the live pipeline does: what its queue drops has an arrival number, and is missing to the decoder."""
    writer = _core.RecordingWriter(path, json.dumps(HEADER), "none", False)
    decoder = taxel.wire.Decoder(2)
    share, recorded = draw.choice([0.0, 0.05]), 0

    def counts(received: int) -> str:
        found = decoder.counts
        causes = {
            "jumps_of_time": 0,
            "datagrams_damaged": found.checksum + found.short + found.foreign,
            "datagrams_repeated": found.repeated,
            "events_repaired": found.repaired,
        }
        known = {"received": received, "recorded": recorded, "dropped_by_queue": told.dropped}
        return json.dumps({**known, "missing": found.missing, "decoder": causes})

    for number, one in enumerate(came):
        if 0 < number < len(came) - 1 and draw.random() < share:
            told.dropped += 1
            continue
        writer.datagram(START_NS + number * 100_000, number, one)
        decoder.push(one)
        recorded += 1
        if number % 50 == 49:
            writer.counts(START_NS + number * 100_000, counts(number + 1))
    if finish:
        writer.finish(counts(len(came)))


@pytest.mark.parametrize("seed", seeds(40, quick=6))
def test_the_numbers_of_a_verdict_are_the_losses(seed: int, tmp_path: Path) -> None:
    draw, told, path = np.random.default_rng(seed), Told(), tmp_path / "a.mcap"
    finish = bool(draw.random() < 0.6)
    came = on_the_way(sent_by_a_board(), draw, told)
    write(path, came, draw, told, finish=finish)
    whole = taxel.open(path)
    recorded = len(whole.datagrams())
    assert recorded == len(came) - told.dropped
    # Each number that the decoder lacks was lost on the way or dropped here; a repeated one may have been dropped once.
    decoder = taxel.wire.Decoder(2)
    for one in whole.datagrams():
        decoder.push(one)
    missing = decoder.counts.missing
    unclear = bool(missing and told.dropped and decoder.counts.repeated)
    way = {"lost_on_the_way_or_dropped": missing} if unclear else {"lost_on_the_way": max(missing - told.dropped, 0)}
    expected = {"dropped_by_queue": told.dropped, **way}
    # The truth: never fewer than those of which the verdict says that they were lost on the way.
    assert len(told.lost) >= expected.get("lost_on_the_way", 0)
    assert len(told.lost) <= missing
    if finish:
        assert whole.verdict.lost == {cause: n for cause, n in expected.items() if n}
        assert whole.verdict.damaged.get("datagrams_damaged", 0) == decoder.counts.checksum
        assert whole.verdict.noted.get("datagrams_repeated", 0) == decoder.counts.repeated
        assert (whole.verdict.status == "complete") == (not missing and not told.dropped)
    else:
        assert whole.verdict.startswith("not finished: ")
        ways = ("lost_on_the_way", "lost_on_the_way_or_dropped")
        assert sum(whole.verdict.lost.get(way, 0) for way in ways) >= max(missing - told.dropped, 0)
        assert at_least(whole.verdict, "lost" if missing else "unfinished")

    # Then the file is damaged in its middle: what it loses is told apart from what was lost on the way.
    data = bytearray(path.read_bytes())
    place = data.index(whole.datagrams()[recorded // 2])
    data[place + 5] ^= 1
    path.write_bytes(data)
    damaged = taxel.open(path)
    gone = recorded - len(damaged.datagrams())
    assert gone > 0
    assert damaged.verdict.status == "lost"
    if finish:
        assert damaged.verdict.lost == {**whole.verdict.lost, "lost_in_file": gone}
        assert f"{gone} datagrams lost" in damaged.verdict
    left = damaged.datagrams()
    assert damaged.counts["lost_in_file"] == damaged.verdict.lost.get("lost_in_file", 0)
    if finish and len(left):
        # Those of the damaged chunk that overtook the first one that is left look as if lost on the way.
        assert damaged.counts["decoder_version_2"]["missing"] <= len(told.lost) + told.overtaken
    assert damaged.verdict.damaged["bad_chunks"] == 1


@pytest.mark.parametrize("share", [0.3, 0.6, 0.9])
def test_a_cut_file_is_no_better_than_unfinished(share: float, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write(path, sent_by_a_board(), np.random.default_rng(0), Told(), finish=True)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    assert at_least(taxel.open(path).verdict, "unfinished")


def test_loss_in_a_board_s_own_last_second_is_seen_in_a_file_without_its_end(tmp_path: Path) -> None:
    """What comes after the last counts is not in them: decoding finds it."""
    sent = sent_by_a_board()
    came, path = sent[:], tmp_path / "a.mcap"
    del came[-5]
    writer = _core.RecordingWriter(path, json.dumps(HEADER), "none", False)
    for number, one in enumerate(came):
        writer.datagram(START_NS + number, number, one)
        if number == len(came) // 2:
            writer.counts(START_NS + number, json.dumps({"received": number, "recorded": number, "missing": 0}))
    del writer
    verdict = taxel.open(path).verdict
    assert (verdict.status, verdict.lost) == ("lost", {"lost_on_the_way": 1})


def written_anew(
    of: Path,
    path: Path,
    times: Callable[[int], int],
    number: Callable[[int], int],
    topic: str = "/datagrams",
    data: Callable[[int, bytes], bytes] = lambda _, data: data,
) -> list[int]:
    """Write a recording by the official library; return how many of a topic are there 0 times, once and twice."""
    with of.open("rb") as source, path.open("wb") as file:
        reader, writer, channels, there = make_reader(source), Writer(file), {}, [0, 0, 0]
        writer.start("taxel")
        metadata = [(one.name, one.metadata) for one in reader.iter_metadata()]
        for one in metadata[:1]:
            writer.add_metadata(*one)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.topic not in channels:
                known = schema and writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(
                    channel.topic, channel.message_encoding, known or 0, channel.metadata
                )
            copies = 1
            if channel.topic == topic:
                copies = times(message.sequence if topic == "/datagrams" else sum(there))
                there[copies] += 1
            held = data(message.sequence, message.data) if channel.topic == topic else message.data
            said = message.log_time, held, message.publish_time, number(message.sequence)
            for _ in range(copies):
                writer.add_message(channels[channel.topic], *said)
        for one in metadata[1:]:
            writer.add_metadata(*one)
        writer.finish()
    return there


@pytest.mark.parametrize("keeps", [lambda n: True, lambda n: n % 3 != 1, lambda n: n < 12, lambda n: n > 27])
def test_what_another_program_left_out_of_a_finished_file_is_lost(keeps: Callable[[int], bool], tmp_path: Path) -> None:
    """A summary that fits what is there says nothing of what was there."""
    record(tmp_path / "a.mcap", some_events())
    left_out, *_ = written_anew(tmp_path / "a.mcap", tmp_path / "b.mcap", lambda n: int(keeps(n)), lambda n: n)
    verdict = taxel.open(tmp_path / "b.mcap").verdict
    assert verdict.lost == ({"lost_in_file": left_out} if left_out else {})
    assert verdict.status == ("lost" if left_out else "complete after arrival")


@pytest.mark.parametrize("cut", [0, 300])
@pytest.mark.parametrize(
    ("topic", "keeps", "cause"),
    [
        ("/notes", lambda n: n != 0, "notes_lost_in_file"),
        ("/notes", lambda _: False, "notes_lost_in_file"),
        ("/markers", lambda n: n != 1, "markers_lost_in_file"),
        ("/registers", lambda _: False, "registers_lost_in_file"),
        ("/detections", lambda _: False, "detections_lost_in_file"),
        ("/pressure", lambda _: False, None),
    ],
)
def test_small_messages_that_another_program_left_out_are_lost(
    topic: str, keeps: Callable[[int], bool], cause: str | None, cut: int, tmp_path: Path
) -> None:
    record(tmp_path / "a.mcap", some_events(), finish=not cut)
    left_out, *_ = written_anew(tmp_path / "a.mcap", tmp_path / "b.mcap", lambda n: int(keeps(n)), lambda n: n, topic)
    data = (tmp_path / "b.mcap").read_bytes()
    (tmp_path / "b.mcap").write_bytes(data[: len(data) - cut])
    verdict = taxel.open(tmp_path / "b.mcap").verdict
    assert left_out > 0
    assert verdict.lost == ({cause: left_out} if cause else {})
    assert not cut or "not finished" in verdict


def test_small_messages_that_another_program_added_are_not_there_twice(tmp_path: Path) -> None:
    record(tmp_path / "a.mcap", some_events())
    written_anew(tmp_path / "a.mcap", tmp_path / "b.mcap", lambda _: 2, lambda n: n, "/notes")
    verdict = taxel.open(tmp_path / "b.mcap").verdict
    assert (verdict.lost, verdict.damaged) == ({}, {})


@pytest.mark.parametrize(
    ("times", "number"),
    [
        (lambda n: 1 + (n == 5), lambda n: n),
        (lambda _: 2, lambda n: n),
        (lambda _: 1, lambda _: 0),
        (lambda n: int(n % 3 != 1), lambda _: 0),
    ],
)
def test_datagrams_that_are_there_twice_or_without_their_numbers_are_not_lost(
    times: Callable[[int], int], number: Callable[[int], int], tmp_path: Path
) -> None:
    record(tmp_path / "a.mcap", some_events())
    left_out, _, twice = written_anew(tmp_path / "a.mcap", tmp_path / "b.mcap", times, number)
    verdict = taxel.open(tmp_path / "b.mcap").verdict
    assert verdict.lost == ({"lost_in_file": left_out} if left_out else {})
    assert verdict.damaged.get("repeated_in_file", 0) == twice


@pytest.mark.parametrize("lost", [0, 2])
def test_what_was_overtaken_when_the_last_counts_were_saved_is_not_lost(lost: int, tmp_path: Path) -> None:
    sent, path = sent_by_a_board(), tmp_path / "a.mcap"
    came = [*sent[:20], *sent[21:40], sent[20], *sent[40 + lost : 60]]
    writer = _core.RecordingWriter(path, json.dumps(HEADER), "none", False)
    for number, one in enumerate(came):
        writer.datagram(START_NS + number, number, one)
        if number == 30:
            writer.counts(START_NS + number, json.dumps({"received": 31, "recorded": 31, "missing": 1}))
    del writer
    verdict = taxel.open(path).verdict
    assert verdict.lost == ({"lost_on_the_way": lost} if lost else {})
    assert verdict.status == ("lost" if lost else "unfinished")


@pytest.mark.parametrize("then", [1, 2])
def test_of_what_version_1_sent_after_the_last_counts_nothing_is_known_to_be_there(then: int, tmp_path: Path) -> None:
    sent, path = sent_by_a_board(), tmp_path / "a.mcap"
    events = some_events(400, intensity=False)
    later = sent[20:40] if then == 2 else [taxel.wire.encode(events[k : k + 10]) for k in range(0, 400, 10)]
    writer = _core.RecordingWriter(path, json.dumps(HEADER), "none", False)
    for number, one in enumerate([*sent[:20], *later]):
        writer.datagram(START_NS + number * 100_000_000, number, one)
        if number == 19:
            writer.counts(START_NS, json.dumps({"received": 20, "recorded": 20, "missing": 0}))
    del writer
    recording = taxel.open(path)
    assert bool(recording.counts["decoder"]["bytes"]) == (then == 1)
    told = "until then: nothing lost after arrival (version 1" if then == 1 else "until then: nothing lost"
    assert told in recording.verdict
    assert ("version 1" in recording.verdict) == (then == 1)
    # Those of the first second, in which they might have been damaged ones of version 2.
    assert ("bytes_of_version_1_refused" in recording.verdict.damaged) == (then == 1)


def test_datagrams_of_version_1_that_come_again_are_damage_as_their_events_are_there_twice(tmp_path: Path) -> None:
    events = some_events(400, intensity=False)
    events.markers = ()
    sent = [taxel.wire.encode(events[k : k + 10]) for k in range(0, 400, 10)]
    came = [one for k, one in enumerate(sent) for _ in range(2 if k % 8 == 5 else 1)]
    writer = _core.RecordingWriter(tmp_path / "a.mcap", json.dumps(HEADER), "none", False)
    for number, one in enumerate(came):
        writer.datagram(START_NS + number * 1_000_000, number, one)
    del writer
    recording = taxel.open(tmp_path / "a.mcap")
    assert len(recording.events) == 450, "their events are there twice"
    assert (recording.verdict.damaged["datagrams_decoded_again"], recording.verdict.noted) == (5, {})
    assert "5 datagrams decoded again" in recording.verdict


@pytest.mark.parametrize("reordered", [False, True])
def test_what_version_2_lost_right_after_a_reset_is_counted(reordered: bool, tmp_path: Path) -> None:
    board = Board(Registers(wire_version=2), version_2=Version2(states_us=0))
    held, parts = np.full(4096, 20, np.uint16), []
    for _ in range(2):
        part: list[bytes] = []
        for k in range(20):
            held[k * 150 : k * 150 + 150] ^= 64
            part += board.frame(held)
        parts.append(part)
        board.reset()
    first, second = parts
    lost = 3
    came = [*first, *second[lost:]]
    if reordered:
        at = len(first)
        came[at], came[at + 1] = came[at + 1], came[at]
    writer = _core.RecordingWriter(tmp_path / "a.mcap", json.dumps(HEADER), "none", False)
    for number, one in enumerate(came):
        writer.datagram(START_NS + number * 1_000_000, number, one)
    del writer
    verdict = taxel.open(tmp_path / "a.mcap").verdict
    assert (verdict.lost, verdict.noted["resets"]) == ({"lost_on_the_way": lost}, 1)
    assert verdict.status == "lost"


@pytest.mark.parametrize("seed", range(10))
def test_times_after_a_damaged_stamp_are_doubtful(seed: int, tmp_path: Path) -> None:
    draw, path = np.random.default_rng(seed), tmp_path / "a.mcap"
    events = some_events(3000, seed=seed, intensity=False)
    events.markers = ()
    sent = [taxel.wire.encode(events[k : k + 10]) for k in range(0, 3000, 10)]
    arrived = [
        START_NS + int(events.t[min(k + 9, 2999)]) * 1000 + int(draw.integers(0, 40_000_000))
        for k in range(0, 3000, 10)
    ]
    wrong = int(draw.integers(1, 299)) if seed % 3 else None
    if wrong is not None:
        bad = bytearray(sent[wrong])
        place = 5 * int(draw.integers(0, 10))
        # A stamp of 16 bits lies in the first three bytes; this bit is worth 0.8 s or more.
        stamp = taxel.wire.decode(bytes(bad[place : place + 5])).t[0]
        for byte, bit in ((place, 0), (place + 1, 6), (place + 1, 5)):
            flipped = bytearray(bad)
            flipped[byte] ^= 1 << bit
            again = taxel.wire.decode(bytes(flipped[place : place + 5]))
            if len(again) == 1 and abs(int(again.t[0]) - int(stamp)) > 300_000:
                sent[wrong] = bytes(flipped)
                break
        else:
            pytest.fail("no bit of the stamp")
    writer = _core.RecordingWriter(path, json.dumps(HEADER), "none", False)
    for number, (one, at) in enumerate(zip(sent, arrived, strict=True)):
        writer.datagram(at, number, one)
    # As the recorder counts it; only then a finished file is decoded for its verdict.
    writer.finish(json.dumps({"received": len(sent), "decoder": {"jumps_of_time": int(wrong is not None)}}))
    recording = taxel.open(path)
    late = np.flatnonzero(recording.events.t - recording.events.t[0] != events.t - events.t[0])
    if wrong is None:
        assert not len(late)
        assert (recording.verdict.status, recording.verdict.doubtful_after_us) == ("complete after arrival", None)
        return
    assert recording.verdict.status == "damaged"
    after = recording.verdict.doubtful_after_us
    assert after is not None
    assert f"times after {after} us are doubtful" in recording.verdict
    # On another clock it is that of the same moment.
    host = recording.on_clock("host")
    moved = int(recording.clock.host_ns(after) + 500) // 1000
    assert host.verdict.doubtful_after_us == moved
    assert host.verdict == recording.verdict.replace(f"times after {after} us", f"times after {moved} us")
    assert host.events.t[late].min() > moved
    # The recorder does not know the time, and takes the file's verdict.
    held = recording.verdict.to_dict() | {"doubtful_after_us": None, "text": "as recorded", "parts": []}
    ended: Any = SimpleNamespace(counters={}, verdict=held, path=path, tare=None)
    assert summary_of(ended).verdict.to_dict() == recording.verdict.to_dict()
    # All that are wrong come after that time, and it is no earlier than the datagram before.
    assert recording.events.t[late].min() > after
    assert after >= recording.events.t[10 * (wrong - 1)]


@pytest.mark.parametrize("kind", ["mcap", "npz", "csv", "lsa"])
def test_conversions_keep_a_verdict_with_its_numbers(kind: str, tmp_path: Path) -> None:
    draw, told = np.random.default_rng(1), Told()
    came = on_the_way(sent_by_a_board(), draw, told)
    del came[5]
    write(tmp_path / "a.mcap", came, draw, told, finish=True)
    first = taxel.open(tmp_path / "a.mcap").verdict
    assert first.status == "lost"
    taxel.convert(tmp_path / "a.mcap", tmp_path / f"b.{kind}")
    second = taxel.open(tmp_path / f"b.{kind}").verdict
    if kind != "mcap":
        assert second.startswith(f"losses unknown: the .{kind} does not record them")
        # Version 1 cannot tell reordered datagrams from damaged stamps.
        assert second.status == ("damaged" if "events out of order" in second else "unknown")
    else:
        assert second.to_dict() == first.to_dict()
    taxel.convert(tmp_path / f"b.{kind}", tmp_path / "c.mcap")
    assert taxel.open(tmp_path / "c.mcap").verdict.to_dict() == second.to_dict()


@pytest.mark.parametrize("share", [0.05, 0.2, 0.5, 0.8, 0.99])
@pytest.mark.parametrize("of", ["events", "lines", "frames", "two"])
def test_a_converted_file_that_is_cut_says_what_its_source_lost(of: str, share: float, tmp_path: Path) -> None:
    source = tmp_path / "a.mcap"
    if of in ("events", "lines"):
        stream = {"stream": {"columns": ["ax"]}, "array": taxel.Array(1, 1)._geometry()}
        writer = _core.RecordingWriter(source, json.dumps(HEADER | (stream if of == "lines" else {})), "none", False)
        at = START_NS + np.arange(3000) * 1_000_000
        if of == "lines":
            writer.samples(at, np.arange(3000, dtype=np.uint64), np.arange(3000.0))
        else:
            write_all(writer, sent_by_a_board())
        writer.finish(json.dumps({"received": 3, "dropped_by_kernel": 7}))
        first: taxel.Recording = taxel.open(source)
    else:
        frames = taxel.Frames(np.random.default_rng(2).normal(size=(300, 16, 16)).astype(np.float32), np.arange(300))
        verdict = Verdict._of({"counts": {"received": 5, "recorded": 5, "dropped_by_kernel": 7}})
        names = "a" if of == "frames" else "ab"
        facts = [Facts(path=tmp_path, array=frames.array, kind="ros", label=name) for name in names]
        first = taxel.Recording.of(*(InMemory(each, frames, lost=verdict) for each in facts))
    lost = first.verdict.lost
    assert lost == {"dropped_by_kernel": 14 if of == "two" else 7}
    taxel.convert(first, tmp_path / "b.mcap")
    assert taxel.open(tmp_path / "b.mcap").verdict.to_dict() == first.verdict.to_dict()
    data = (tmp_path / "b.mcap").read_bytes()
    # From behind the header on.
    (tmp_path / "b.mcap").write_bytes(data[: 2600 + int((len(data) - 2600) * share)])
    verdict = taxel.open(tmp_path / "b.mcap").verdict
    assert verdict.lost == lost
    assert verdict.status == "lost"
    assert "not finished: " in verdict or share > 0.9, "there the summary is cut"


def write_all(writer: _core.RecordingWriter, sent: list[bytes]) -> None:
    for number, one in enumerate(sent):
        writer.datagram(START_NS + number * 1_000_000, number, one)


@pytest.mark.parametrize("converted", [False, True])
def test_damage_of_a_file_of_two_boards_counts_once(converted: bool, tmp_path: Path) -> None:
    path, sent = tmp_path / "two.mcap", sent_by_a_board()
    writer = _core.RecordingWriter(path, json.dumps(HEADER | {"sources": [HEADER | {"name": "b"}]}), "none", False)
    b = writer.track("b")
    for number, one in enumerate(sent):
        writer.datagram(START_NS + number * 1_000_000, number, one)
        b.datagram(START_NS + number * 1_000_000, number, one)
    b.end(json.dumps({"received": len(sent), "missing": 0}))
    writer.finish(json.dumps({"received": len(sent), "missing": 0}))
    data = bytearray(path.read_bytes())
    data[data.index(sent[len(sent) // 2]) + 5] ^= 1
    path.write_bytes(bytes(data) + b"more")
    whole = taxel.open(path)
    if converted:
        whole = whole.on_clock("b")
    parts = whole.verdict.parts
    assert [one.damaged for one in parts.values()] == 2 * [{"bad_chunks": 1, "bytes_after_end": 4}]
    assert whole.verdict.damaged == {"bad_chunks": 1, "bytes_after_end": 4}
    both = taxel.merge(taxel.open(path).sources.values(), gap_us=10)
    assert both.verdict.damaged == {"bad_chunks": 1, "bytes_after_end": 4}
    gone = [len(sent) - len(one.datagrams()) for one in taxel.open(path).sources.values()]
    assert [one.lost for one in parts.values()] == [{"lost_in_file": n} for n in gone]
    assert whole.verdict.lost == {"lost_in_file": sum(gone)}


def test_a_merged_verdict_is_the_worst_and_keeps_those_of_its_parts(tmp_path: Path) -> None:
    record(tmp_path / "good.mcap", some_events(300))
    for name, lost in (("bad", 2), ("worse", 3)):
        writer = _core.RecordingWriter(tmp_path / f"{name}.mcap", json.dumps(HEADER), "none", False)
        writer.datagram(START_NS, 0, taxel.wire.encode(some_events(20, start=1_000_000)))
        writer.finish(json.dumps({"received": 1, "dropped_by_kernel": lost}))
    good, bad, worse = (taxel.open(tmp_path / f"{name}.mcap") for name in ("good", "bad", "worse"))
    both = taxel.merge([good, bad, worse], gap_us=10)
    verdict = both.verdict
    assert (verdict.status, verdict.lost) == ("lost", {"dropped_by_kernel": 5})
    assert list(verdict.parts) == ["good.mcap", "bad.mcap", "worse.mcap"]
    assert [one.status for one in verdict.parts.values()] == ["complete after arrival", "lost", "lost"]
    assert verdict == "; ".join(f"{name}: {one}" for name, one in verdict.parts.items())
    taxel.convert(both, tmp_path / "both.mcap")
    assert taxel.open(tmp_path / "both.mcap").verdict.to_dict() == verdict.to_dict()
    # Parts of one file have its verdict, which counts once; two files that lost as much have lost twice as much.
    middle = int(bad.events.t[10])
    assert taxel.merge([bad.between(0, middle), bad.between(middle, 2**40)]).verdict.lost == {"dropped_by_kernel": 2}
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "bad.mcap").write_bytes((tmp_path / "bad.mcap").read_bytes())
    twice = taxel.merge([bad, taxel.open(tmp_path / "other" / "bad.mcap")], gap_us=10).verdict
    assert (twice.lost, list(twice.parts)) == ({"dropped_by_kernel": 4}, ["bad.mcap", "bad.mcap (2)"])
    # So have two merged recordings that say the same, but not two parts of one.
    other = taxel.merge([good, taxel.open(tmp_path / "other" / "bad.mcap"), worse], gap_us=10)
    assert other.verdict == verdict
    assert taxel.merge([both, other], gap_us=10).verdict.lost == {"dropped_by_kernel": 10}
    assert taxel.merge([both.between(0, 99), both.between(99, 2**40)]).verdict.lost == {"dropped_by_kernel": 5}


def test_a_lsa_without_its_lss_is_unfinished_and_with_damage_still(tmp_path: Path) -> None:
    taxel.convert(some_events(100), tmp_path / "a.lsa")
    (tmp_path / "a.lss").unlink()
    assert taxel.open(tmp_path / "a.lsa").verdict.status == "unfinished"
    data = (tmp_path / "a.lsa").read_bytes()
    (tmp_path / "b.lsa").write_bytes(data[:100] + b"\x05\x06" + data[100:])
    verdict = taxel.open(tmp_path / "b.lsa").verdict
    assert (verdict.status, verdict.damaged) == ("unfinished", {"bytes_skipped": 2})
    (tmp_path / "b.lss").touch()
    assert taxel.open(tmp_path / "b.lsa").verdict.status == "damaged"


@pytest.mark.parametrize(
    ("decoder", "words"),
    [
        (
            {"short_events": 1, "unpaired_intensities": 1, "outside_the_array": 1},
            "1 outside the array, 1 short event, 1 unpaired intensity",
        ),
        ({"short_events": 2, "unpaired_intensities": 2}, "2 short events, 2 unpaired intensities"),
        ({"events_repaired": 1}, "1 value repaired from the board's refresh"),
        ({"resets": 1}, "1 reset of the board"),
        ({"times_that_the_board_dropped_events": 1}, "LOST: 1 time that the board dropped events"),
        ({"jumps_of_time": 1}, "1 jump of time"),
    ],
)
def test_what_there_is_one_of_is_in_the_singular(decoder: dict[str, int], words: str) -> None:
    assert words in Verdict._of({"counts": {"received": 5, "recorded": 5, "decoder": decoder}})


def test_a_verdict_is_text_that_cannot_be_changed_and_survives_a_copy() -> None:
    import copy
    import pickle

    verdict = Verdict._of({"counts": {"received": 5, "recorded": 5, "dropped_by_kernel": 2}})
    copies = (copy.deepcopy(verdict), pickle.loads(pickle.dumps(verdict)))
    for again in copies:
        assert (again, again.to_dict()) == (verdict, verdict.to_dict())
        assert type(again) is Verdict
    assert json.loads(json.dumps([verdict])) == ["LOST: 2 messages dropped by the kernel"]
    with pytest.raises(taxel.ProblemError, match="take the verdict of a recording"):
        Verdict("nothing lost")
    verdict.lost["dropped_by_kernel"] = 0
    assert verdict.lost == {"dropped_by_kernel": 2}
    with pytest.raises(AttributeError):
        verdict.status = "complete"  # type: ignore[misc]


@pytest.mark.parametrize("appended", [1, 100, "recording"])
def test_what_stands_behind_the_end_of_a_file_is_told(tmp_path: Path, appended: int | str) -> None:
    whole, longer = tmp_path / "whole.mcap", tmp_path / "longer.mcap"
    record(whole, some_events(3000))
    data = whole.read_bytes()
    more = data if appended == "recording" else bytes(int(appended))
    longer.write_bytes(data + more)
    assert taxel.open(whole).verdict.damaged == {}
    recording = taxel.open(longer)
    assert len(recording.events) == 3000
    assert recording.verdict.damaged == {"bytes_after_end": len(more)}
    assert recording.verdict.status == "damaged"
    bytes_ = "1 byte" if len(more) == 1 else f"{len(more)} bytes"
    assert recording.verdict.startswith(
        f"damage in the file: {bytes_} after the end of the recording not read; while recording: "
    )


def test_what_two_generations_of_a_file_lost_adds_up(tmp_path: Path) -> None:
    first, second = tmp_path / "first.mcap", tmp_path / "second.mcap"
    # 5 MB: the writer closes a chunk at 1 MiB at the latest, so that one damage leaves other chunks whole.
    record(first, some_events(500_000), each=100)
    whole = len(taxel.open(first).datagrams())
    assert first.stat().st_size > 4_500_000

    def spoil(path: Path) -> int:
        """Damage a chunk of datagrams in the middle of the file; return how many datagrams are left.

        As much as is longer than the index behind a chunk, which may lie there.
        """
        data = path.read_bytes()
        at, size = len(data) // 2, 30_000
        path.write_bytes(data[:at] + bytes(size) + data[at + size :])
        left = len(taxel.open(path).datagrams())
        assert taxel.open(path).verdict.lost["lost_in_file"] == whole - left
        return left

    left = spoil(first)
    taxel.convert(first, second)
    assert taxel.open(second).verdict.lost == taxel.open(first).verdict.lost
    assert 0 < spoil(second) < left < whole


def test_a_board_that_was_reset_has_not_lost_nothing() -> None:
    counts = {"received": 5, "recorded": 5, "missing": 0, "decoder": {"resets": 2}}
    verdict = Verdict._of({"counts": counts})
    assert verdict == "nothing lost, but losses at resets are unknown; 2 resets of the board"
    assert verdict.status == "complete after arrival"
    assert Verdict._of({"counts": counts | {"decoder": {}}}) == "nothing lost"
    lost = Verdict._of({"counts": counts | {"missing": 3}})
    assert (
        lost == "LOST: 3 datagrams lost or damaged on the way, and losses at resets are unknown; 2 resets of the board"
    )


def test_intact_datagrams_of_another_board_are_no_damaged_ones(tmp_path: Path) -> None:
    boards = [Board(Registers(wire_version=2), version_2=Version2(board=n)) for n in (5, 6)]
    sent = [[one for k in range(3) for one in board.frame(np.full(4096, 40 + 9 * k, np.uint16))] for board in boards]
    writer = _core.RecordingWriter(tmp_path / "a.mcap", json.dumps(HEADER), "none", False)
    other = sent[1][:7]
    for number, one in enumerate([*sent[0], *other, other[0][:30] + bytes([other[0][30] ^ 1]) + other[0][31:]]):
        writer.datagram(START_NS + number * 1_000_000, number, one)
    del writer
    recording = taxel.open(tmp_path / "a.mcap")
    assert recording.verdict.damaged == {"datagrams_of_another_board": 7, "datagrams_damaged": 1}
    assert "7 datagrams of another board" in recording.verdict
    assert len(recording.events) == 3 * 4096


@pytest.mark.parametrize("seed", range(6))
def test_a_second_board_with_the_numbers_of_the_first_is_told(seed: int, tmp_path: Path) -> None:
    """Two emulated boards have one session: what came under a number that another datagram has is left out."""
    draw = np.random.default_rng(seed)
    boards = [Board(Registers(wire_version=2), version_2=Version2(states_us=0)) for _ in range(2)]
    sent: list[tuple[int, bytes]] = []
    for k, board in enumerate(boards):
        held = np.full(4096, 20, np.uint16)
        for _ in range(30):
            held[draw.integers(0, 4096, 20)] ^= 64 + k
            sent += [(k, one) for one in board.frame(held)]
    # In turn, with pauses, one behind the other: of each board in its own order.
    which = draw.permutation([k for k, _ in sent])
    left = [iter([one for k, one in sent if k == board]) for board in range(2)]
    came = [next(left[k]) for k in which]
    came = [bytes(bytearray(one)) for one in came for _ in range(1 + (draw.random() < 0.1))]
    first: dict[bytes, bytes] = {}
    again = [one for one in came if first.setdefault(one[4:8], one) is not one]
    other = sum(first[one[4:8]] != one for one in again)
    assert other > 10
    with (
        taxel.live.Live(0, host="127.0.0.1", record=tmp_path / "a.mcap") as live,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
    ):
        for one in came:
            link.sendto(one, live.address)
        until(lambda: live.counters["decoded"] == len(came))
        told = live.stop().verdict
    data = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "b.mcap").write_bytes(data[: data.index(b"taxel.end") - 13])
    for verdict in (told, *(taxel.open(tmp_path / f"{name}.mcap").verdict for name in "ab")):
        assert verdict.damaged == {"datagrams_of_another_board": other}
        assert verdict.noted.get("datagrams_repeated", 0) == len(again) - other
        assert at_least(verdict, "damaged")
        assert "nothing lost;" not in verdict
    assert told.startswith("nothing lost except datagrams of another board; in the bytes that arrived: ")


def test_a_source_of_which_nothing_arrived_hides_no_loss_of_another() -> None:
    lost = Verdict._of({"counts": {"received": 5, "recorded": 5, "dropped_by_kernel": 2}})
    silent = Verdict._of({"counts": {}})
    assert (silent.status, Verdict._together([("a", silent), ("b", lost)]).status) == ("nothing arrived", "lost")
    assert Verdict._together([("a", silent), ("b", FINE)]).status == "nothing arrived"


def test_datagrams_without_bytes_are_no_recording_of_which_nothing_is_lost(tmp_path: Path) -> None:
    with (
        taxel.live.Live(0, host="127.0.0.1", record=tmp_path / "a.mcap") as live,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link,
    ):
        for _ in range(10):
            link.sendto(b"", live.address)
        until(lambda: live.counters["decoded"] == 10)
        told = live.stop().verdict
    (tmp_path / "b.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:-300])
    for verdict in (told, *(taxel.open(tmp_path / f"{name}.mcap").verdict for name in "ab")):
        assert verdict.damaged["empty_datagrams"] == 10
        assert "10 empty datagrams" in verdict


def test_what_an_error_was_is_no_verdict() -> None:
    why = {"ending": {"stopped": "LOST/a.mcap (disk 3): no space left on device"}}
    stopped = Verdict._of({"file": why | {"so_far": {"received": 5, "recorded": 5}}})
    assert stopped.status == "unfinished"


def test_a_converted_recording_has_no_count_of_what_was_received(tmp_path: Path) -> None:
    taxel.convert(some_events(300), tmp_path / "a.npz")
    taxel.convert(tmp_path / "a.npz", tmp_path / "b.mcap")
    assert taxel.open(tmp_path / "b.mcap").counts["received"] is None
    record(tmp_path / "c.mcap", some_events(300))
    assert taxel.open(tmp_path / "c.mcap").counts["received"] > 0
