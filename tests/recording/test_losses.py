"""Law: what was sent is in the file or lost by a cause, or the file is called damaged; never better than the truth."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

import taxel
from taxel import _core

from .making import HEADER, at_least, sent_by_a_board

START_NS = HEADER["started_ns"]


WAYS = ["send"] * 5 + ["lose", "damage", "repeat", "overtake", "queue drops", "counts are saved"]


class Way(RuleBasedStateMachine):
    """A board sends, the network and the recorder lose, the file ends, is spoilt and is carried to others."""

    @initialize(
        version=st.sampled_from([1, 2]),
        compression=st.sampled_from(["none", "lz4", "zstd"]),
        way=st.lists(st.tuples(st.sampled_from(WAYS), st.integers(2, 2**16)), max_size=60),
        finished=st.booleans(),
    )
    def record(self, version: int, compression: str, way: list[tuple[str, int]], finished: bool) -> None:
        self.folder = tempfile.TemporaryDirectory()
        self.path, self.files = Path(self.folder.name) / "0.mcap", 1
        self.version, self.sent = version, iter(enumerate(sent_by_a_board(version)))
        self.writer = _core.RecordingWriter(self.path, json.dumps(HEADER), compression, False)
        self.came: list[bytes] = []
        self.numbers: list[int] = []
        self.damaged = self.repeated = self.dropped = 0
        self.finished, self.spoilt, self.spoilt_before = finished, False, False
        self.lost_before: dict[str, int] = {}
        for how, place in [("send", 2), *way, ("send", 2)]:
            self.on_the_way(how, place)
        if finished:
            self.writer.finish(self.counts())
        del self.writer
        self.there = len(self.came)

    def teardown(self) -> None:
        if hasattr(self, "folder"):
            self.folder.cleanup()

    def arrive(self, datagram: bytes) -> None:
        number = len(self.came) + self.dropped
        self.writer.datagram(START_NS + number * 1_000_000, number, datagram)
        self.came.append(datagram)

    @property
    def missing(self) -> int:
        """The board's numbers that no intact datagram has."""
        return max(self.numbers) + 1 - len(set(self.numbers)) if self.version == 2 else 0

    def counts(self) -> str:
        decoder = {"datagrams_damaged": self.damaged, "datagrams_repeated": self.repeated * (self.version == 2)}
        received = {"received": len(self.came) + self.dropped, "recorded": len(self.came)}
        numbered = {"missing": self.missing} if self.version == 2 else {}
        return json.dumps({**received, "dropped_by_queue": self.dropped, **numbered, "decoder": decoder})

    def on_the_way(self, how: str, place: int) -> None:
        number, datagram = next(self.sent)
        if how == "damage" and self.version == 2:
            bad = bytearray(datagram)
            # Not in the first two bytes, which tell the version of the wire.
            bad[2 + place % (len(bad) - 2)] ^= 1 + place % 255
            self.damaged += 1
            self.arrive(bytes(bad))
        elif how == "queue drops":
            self.dropped += 1
        elif how == "overtake":
            later, other = next(self.sent)
            self.numbers += [later, number]
            self.arrive(other)
            self.arrive(datagram)
        elif how == "repeat":
            self.numbers.append(number)
            self.repeated += 1
            self.arrive(datagram)
            self.arrive(datagram)
        elif how == "send":
            self.numbers.append(number)
            self.arrive(datagram)
        elif how == "counts are saved":
            # This one is lost.
            self.writer.counts(START_NS + len(self.came) * 1_000_000, self.counts())

    @rule(how=st.sampled_from(["flip", "cut", "append"]), share=st.floats(0, 1, exclude_max=True))
    def spoil(self, how: str, share: float) -> None:
        data = bytearray(self.path.read_bytes())
        # Behind the header, without which no file is readable.
        header = data.index(b"taxel", 40) + 3000
        place = header + int(share * (len(data) - header))
        if place >= len(data):
            return
        if how == "flip":
            data[place] ^= 255
        elif how == "cut":
            del data[place:]
        else:
            data += bytes(1 + place % 100)
        self.path.write_bytes(data)
        self.spoilt = True

    @rule(by=st.sampled_from(["convert", "cut and merge", "npz"]))
    def carry(self, by: str) -> None:
        recording = taxel.open(self.path)
        if not len(recording.datagrams()):
            return
        verdict, self.files = recording.verdict, self.files + 1
        path = self.path.with_name(f"{self.files}.mcap")
        if by == "npz":
            table = path.with_suffix(".npz")
            taxel.convert(recording, table)
            told = taxel.open(table).verdict
            assert (told.status, told.lost) == ("unknown", {})
            taxel.convert(table, path)
            assert taxel.open(path).verdict.to_dict() == told.to_dict()
            return
        if by == "cut and merge":
            middle = int(recording.events.t[len(recording.events) // 2]) if len(recording.events) else 0
            recording = taxel.merge([recording.between(-(2**40), middle), recording.between(middle, 2**40)])
        assert recording.verdict == verdict
        taxel.convert(recording, path)
        assert taxel.open(path).verdict.to_dict() == verdict.to_dict()
        if by == "convert":
            self.path, self.there = path, len(taxel.open(path).datagrams())
            self.lost_before, self.spoilt_before = verdict.lost, self.spoilt_before or self.spoilt
            self.spoilt = False

    @invariant()
    def never_better_than_the_truth(self) -> None:
        recording = taxel.open(self.path)
        verdict, left = recording.verdict, recording.datagrams()
        came = iter(self.came)
        assert all(any(datagram == other for other in came) for datagram in left), "no datagram is invented"
        gone = self.there - len(left)
        expected = {"dropped_by_queue": self.dropped, "lost_on_the_way": max(self.missing - self.dropped, 0)}
        expected = {cause: n for cause, n in expected.items() if n}
        if not self.spoilt and not self.spoilt_before:
            assert gone == 0
            if self.finished:
                assert verdict.lost == expected
                assert verdict.damaged.get("datagrams_damaged", 0) == self.damaged
                assert verdict.noted.get("datagrams_repeated", 0) == self.repeated * (self.version == 2)
                least = "complete" if self.version == 2 and not self.damaged else "complete after arrival"
                assert (verdict.status == "complete") == (least == "complete" and not expected)
        if not self.finished:
            assert at_least(verdict, "unfinished")
            assert at_least(
                verdict, "lost" if self.missing and not self.spoilt and not self.spoilt_before else "unfinished"
            )
        if gone:
            assert at_least(verdict, "unfinished")
            if self.finished and not recording.truncated:
                assert verdict.status == "lost"
                assert verdict.lost["lost_in_file"] == gone + self.lost_before.get("lost_in_file", 0)
        # What was told of a file is told of all that were made of it.
        assert all(verdict.lost.get(cause, 0) >= n for cause, n in self.lost_before.items())


TestLosses = Way.TestCase
TestLosses.settings = settings(stateful_step_count=6, deadline=None)
