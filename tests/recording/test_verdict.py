"""A verdict says what was lost, damaged or noted; all else are remarks."""

from __future__ import annotations

import copy
import json
import pickle
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from shell import run

import taxel
from taxel import Verdict, _core
from taxel.live.summary import summary_of
from taxel.reading import Facts, InMemory
from taxel.verdict import in_words

from .making import HEADER, record, some_events

START_NS = HEADER["started_ns"]


@pytest.mark.parametrize(("cause", "kind", "words"), [one[:3] for one in _core.causes() if one[1] != "live"])
def test_each_cause_has_its_place_its_status_and_its_words(cause: str, kind: str, words: tuple[str, str]) -> None:
    for n, said in ((1, words[0]), (2, words[1])):
        verdict = Verdict._of({"counts": {"received": 5, "recorded": 5, "missing": 0, "decoder": {cause: n}}})
        assert {"lost": verdict.lost, "damaged": verdict.damaged, "noted": verdict.noted}[kind] == {cause: n}
        assert len(verdict.lost) + len(verdict.damaged) + len(verdict.noted) == 1
        noted = "complete after arrival" if cause == "resets" else "complete"
        assert verdict.status == {"lost": "lost", "damaged": "damaged", "noted": noted}[kind]
        assert in_words({cause: n}) == f"{n} {said}"
        # The line of the gaps of frames says both numbers of them.
        assert f"{n} {said}" in verdict or cause in ("gaps", "gaps_us")


def test_a_cause_of_a_later_version_is_damage() -> None:
    verdict = Verdict._of({"counts": {"received": 5, "missing": 0, "recorded": 5, "decoder": {"unheard_of": 3}}})
    assert (verdict.status, verdict.damaged) == ("damaged", {"unknown_causes": 3})


def written_anew(of: Path, path: Path, topic: str, keeps: Callable[[int], bool]) -> int:
    """Write a recording by the official library; return how many messages of a topic it leaves out."""
    with of.open("rb") as source, path.open("wb") as file:
        reader, writer, channels, there = make_reader(source), Writer(file), {}, []
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
            if channel.topic == topic:
                there.append(keeps(len(there)))
            if channel.topic != topic or there[-1]:
                times = message.publish_time, message.sequence
                writer.add_message(channels[channel.topic], message.log_time, message.data, *times)
        for one in metadata[1:]:
            writer.add_metadata(*one)
        writer.finish()
    return there.count(False)


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
    left_out = written_anew(tmp_path / "a.mcap", tmp_path / "b.mcap", topic, keeps)
    data = (tmp_path / "b.mcap").read_bytes()
    (tmp_path / "b.mcap").write_bytes(data[: len(data) - cut])
    verdict = taxel.open(tmp_path / "b.mcap").verdict
    assert left_out > 0
    assert verdict.lost == ({cause: left_out} if cause else {})
    assert not cut or "not finished" in verdict
    [received] = [line for line in run("info", tmp_path / "b.mcap").stdout.splitlines() if "  received " in line]
    assert received.endswith(", when counts were last saved") is bool(cut)


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


@pytest.mark.parametrize("seed", range(4))
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
    held = recording.verdict._held | {"doubtful_after_us": None}
    ended: Any = SimpleNamespace(counters={}, verdict=held, path=path, tare=None)
    assert summary_of(ended).verdict.to_dict() == recording.verdict.to_dict()
    # All that are wrong come after that time, and it is no earlier than the datagram before.
    assert recording.events.t[late].min() > after
    assert after >= recording.events.t[10 * (wrong - 1)]


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
    other = tmp_path / "other" / "bad.mcap"
    other.parent.mkdir()
    other.write_bytes((tmp_path / "bad.mcap").read_bytes())
    merged = taxel.merge([bad, taxel.open(other), bad.between(0, middle)], gap_us=10)
    twice = merged.verdict
    assert (twice.lost, list(twice.parts)) == ({"dropped_by_kernel": 4}, ["bad.mcap", "bad.mcap (2)"])
    # So have the counts, which a file keeps.
    taxel.convert(merged, tmp_path / "merged.mcap", overwrite=True)
    for counts in (merged.counts, taxel.open(tmp_path / "merged.mcap").counts):
        assert {name: counts[name]["dropped_by_kernel"] for name in twice.parts} == dict.fromkeys(twice.parts, 2)


def test_a_verdict_is_text_that_cannot_be_changed_and_survives_a_copy() -> None:
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


def test_remarks_and_the_verdict_go_to_a_mcap_and_back(tmp_path: Path) -> None:
    frames = taxel.Frames([[[1.0, 2.0]], [[3.0, 4.0]]], [0, 10_000])
    said = ("the times are those of the bag", "2 messages of another length left out")
    fine = taxel.Verdict._of({"counts": {"received": 5, "recorded": 5, "dropped_by_kernel": 0}})
    facts = Facts(path=tmp_path / "a.bag", array=frames.array, kind="ros", remarks=said)
    taxel.convert(taxel.Recording.of(InMemory(facts, frames, lost=fine)), tmp_path / "a.mcap")
    back = taxel.open(tmp_path / "a.mcap")
    assert (back.verdict, back.remarks) == (fine, (*said, "converted from a.bag"))
    assert back.between(0, 5000).remarks == (*said, "converted from a.bag")
    for kind in ("npz", "h5", "csv"):
        (lost,) = taxel.convert(back, tmp_path / f"a.{kind}")
        assert "the remarks" in lost
    # Through another kind and back, each conversion to .mcap adds its line.
    taxel.convert(back, tmp_path / "b.mcap")
    assert taxel.open(tmp_path / "b.mcap").remarks == (*said, "converted from a.bag", "converted from a.mcap")
