"""Whatever byte of a small recording is damaged, cut, dropped or repeated: the verdict tells what is gone, exactly."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from draws import seeds
from loopback import until

import taxel
from taxel import Recording, _core
from taxel._core import FormatError
from taxel.recording.verdict import STATUSES

from .making import HEADER, some_events

START_NS = 1_700_000_000_000_000_000
#: How verdicts name what a file has lost, and what of a recording it is.
LOST: dict[str, Callable[[Recording], list[Any]]] = {
    "lost_in_file": lambda of: [of.datagrams()[k] for k in range(len(of.datagrams()))],
    "notes_lost_in_file": lambda of: [(n.text, n.at_ns) for n in of.notes] + [(z.x, z.y) for z in of.zeroings],
    "detections_lost_in_file": lambda of: [(d.label, d.t) for d in of.detections],
    "registers_lost_in_file": lambda of: [at for at, _ in of.register_changes],
    "changes_lost_in_file": lambda of: [(c.t, c.change) for c in of.board_changes],
    "held_values_lost_in_file": lambda of: [] if of.held is None else [of.held.tolist()],
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of a few chunks, with a message of every kind that it may lose."""
    path, events = tmp_path_factory.mktemp("whole") / "whole.mcap", some_events(60, intensity=False)
    writer = _core.RecordingWriter(path, json.dumps(HEADER), "none", False)

    def at(k: int) -> int:
        return START_NS + int(events.t[k]) * 1000

    size = 0

    def pause() -> None:
        """Wait until what was written is a chunk."""
        nonlocal size
        until(lambda: path.stat().st_size > size)
        time.sleep(0.1)
        size = path.stat().st_size

    held = np.full(4096, 65_535, np.uint16)
    writer.held(at(0), None, held[:16].repeat(256))
    pause()
    for number in range(6):
        writer.datagram(at(10 * number), number, taxel.wire.encode(events[10 * number : 10 * number + 10]))
        if number == 1:
            pause()
            writer.note(at(10), 5, "heel")
            writer.zeroing(at(10), 6, 2, 3, 40.0, None)
            pause()
        if number == 3:
            writer.note(at(20), 9, "toe")
            writer.detection(at(21), "contact", 10, 20, 1.5, False)
            writer.registers(at(22), json.dumps(_core.registers_preset("5.2 kHz")))
            writer.board_change(at(23), json.dumps({"t_us": 30, "change": "reset"}))
            writer.counts(at(24), json.dumps({"received": 4, "recorded": 4}))
            pause()
    pause()
    writer.finish(json.dumps({"received": 6, "decoder": {"jumps_of_time": 0}}))
    return path


def without_end(data: bytes) -> bytes:
    """Return the recording as a killed recorder leaves it."""
    return data[: data.rindex(b"taxel.end", 0, data.rindex(b"header")) - 13]


def held_by(recording: Recording) -> dict[str, list[Any]]:
    return {cause: of(recording) for cause, of in LOST.items()}


def assert_told(path: Path, data: bytes, of: dict[str, list[Any]], where: str) -> taxel.Verdict | None:
    """Open a damaged recording, and compare its verdict with what is gone; None of a file that is refused."""
    __tracebackhide__ = True
    path.write_bytes(data)
    try:
        recording = taxel.open(path)
        now = held_by(recording)
    except FormatError:
        return None
    verdict: taxel.Verdict = recording.verdict
    where = f"{where}: {verdict!r} {verdict.to_dict()}"
    gone = {cause: sum((Counter(map(repr, of[cause])) - Counter(map(repr, now[cause]))).values()) for cause in of}
    more = {cause: sum((Counter(map(repr, now[cause])) - Counter(map(repr, of[cause]))).values()) for cause in of}
    assert (verdict.status == "lost") == bool(verdict.lost), where
    assert ("LOST" in verdict) == bool(verdict.lost), where
    assert all(verdict.lost.values()), where
    unfinished = "not finished" in verdict
    torn = unfinished and verdict.damaged.get("torn_bytes", 0) > 0
    if "unknown" in verdict or torn or (unfinished and not verdict.damaged):
        assert STATUSES.index(verdict.status) >= STATUSES.index("damaged"), where
        assert all(verdict.lost.get(cause, 0) <= n for cause, n in gone.items()), where
    else:
        lost = {cause: n for cause, n in verdict.lost.items() if cause != "markers_lost_in_file"}
        assert lost == {cause: n for cause, n in gone.items() if n}, where
    if any(gone.values()):
        assert STATUSES.index(verdict.status) >= STATUSES.index("unfinished"), where
    twice = verdict.damaged.get("repeated_in_file", 0)
    if "not finished" in verdict:
        assert twice == more["lost_in_file"], where
    else:
        # Of held values that are there twice one is to be seen.
        assert twice - sum(more.values()) in (0, 1), where
    return verdict


@pytest.mark.parametrize("step", [131, pytest.param(1, marks=(pytest.mark.slow, pytest.mark.timeout(3600)))])
@pytest.mark.parametrize("end", ["finished", "unfinished"])
def test_a_flipped_bit_anywhere_is_told_exactly(whole: Path, tmp_path: Path, end: str, step: int) -> None:
    data = whole.read_bytes() if end == "finished" else without_end(whole.read_bytes())
    path, of = tmp_path / "a.mcap", held_by(taxel.open(whole))
    statuses: Counter[str] = Counter()
    for place in range(0, len(data), step):
        flipped = bytearray(data)
        flipped[place] ^= 1 << place % 8
        verdict = assert_told(path, bytes(flipped), of, f"byte {place}")
        statuses["refused" if verdict is None else verdict.status] += 1
    assert statuses["refused"] <= 8, "the magic alone"
    if end == "finished":
        assert statuses["unfinished"] == 0
        assert statuses["lost"] > 5
        assert statuses["damaged"] > 5


@pytest.mark.parametrize("place", [*range(8, 17), *range(17, 60, 5)])
def test_a_flip_in_the_first_record_hides_nothing_behind_it(whole: Path, tmp_path: Path, place: int) -> None:
    data = bytearray(without_end(whole.read_bytes()))
    data[place] ^= 1 << place % 8
    assert assert_told(tmp_path / "a.mcap", bytes(data), held_by(taxel.open(whole)), f"byte {place}") is not None


def spoilt(data: bytes, draw: np.random.Generator) -> Iterator[tuple[str, bytes]]:
    """Yield the bytes with a part of them cut, dropped, repeated, replaced or set to 0."""
    size = len(data)
    a, b = sorted(draw.integers(60, size, 2).tolist())
    b = min(b, a + int(draw.choice([1, 10, 100, 1000, 4096])))
    yield f"cut at {a}", data[:a]
    yield f"drop {a}:{b}", data[:a] + data[b:]
    yield f"repeat {a}:{b}", data[:b] + data[a:]
    yield f"zero {a}:{b}", data[:a] + bytes(b - a) + data[b:]
    yield f"noise {a}:{b}", data[:a] + draw.integers(0, 256, b - a, np.uint8).tobytes() + data[b:]


@pytest.mark.parametrize("seed", seeds(600, quick=20))
def test_bytes_that_are_cut_dropped_repeated_or_lost_are_told(whole: Path, tmp_path: Path, seed: int) -> None:
    draw, data = np.random.default_rng(seed), whole.read_bytes()
    of = held_by(taxel.open(whole))
    for what, bad in spoilt(data, draw):
        assert_told(tmp_path / "a.mcap", bad, of, what)
    for what, bad in spoilt(without_end(data), draw):
        assert_told(tmp_path / "b.mcap", bad, of, f"unfinished, {what}")


def chunks_of(data: bytes) -> list[tuple[int, int]]:
    """Return where each chunk begins and its message indexes end."""
    at, all_of_them = 8, []
    while data[at] != 0x0F:
        end = at + 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        if data[at] == 0x06:
            all_of_them.append((at, end))
        elif data[at] == 0x07:
            all_of_them[-1] = (all_of_them[-1][0], end)
        at = end
    return all_of_them


@pytest.mark.parametrize("end", ["finished", "unfinished"])
def test_whole_chunks_that_are_dropped_repeated_or_exchanged_are_told(whole: Path, tmp_path: Path, end: str) -> None:
    data = whole.read_bytes()
    chunks, of = chunks_of(data), held_by(taxel.open(whole))
    data = data if end == "finished" else without_end(data)
    assert len(chunks) > 4
    for k, (a, b) in enumerate(chunks):
        twice = assert_told(tmp_path / "a.mcap", data[:b] + data[a:], of, f"chunk {k} repeated")
        assert twice is not None
        if end == "finished":
            less = assert_told(tmp_path / "a.mcap", data[:a] + data[b:], of, f"chunk {k} dropped")
            assert less is not None
    order = data[: chunks[1][0]] + b"".join(data[a:b] for a, b in reversed(chunks[1:])) + data[chunks[-1][1] :]
    verdict = assert_told(tmp_path / "a.mcap", order, of, "chunks in another order")
    assert verdict is not None
    assert verdict.lost == {}


def test_a_damaged_chunk_without_data_has_lost_nothing(whole: Path, tmp_path: Path) -> None:
    """The first chunk holds the channels alone."""
    data = bytearray(whole.read_bytes())
    first, _ = chunks_of(bytes(data))[0]
    data[first + 200] ^= 4
    verdict = assert_told(tmp_path / "a.mcap", bytes(data), held_by(taxel.open(whole)), "the first chunk")
    assert verdict is not None
    assert (verdict.status, verdict.lost, verdict.damaged) == ("damaged", {}, {"bad_chunks": 1})
    assert verdict.startswith("damage in the file: 1 bad chunk skipped; while recording: nothing lost after arrival")


def test_of_a_chunk_without_its_index_and_without_the_end_of_the_file_not_all_is_known(
    whole: Path, tmp_path: Path
) -> None:
    data, of = whole.read_bytes(), held_by(taxel.open(whole))
    # The chunk of the first note; the zeroing stands in it too, unless the writer ended the chunk between them.
    begin, end = next((a, b) for a, b in chunks_of(data) if b"heel" in data[a:b])
    gone = 1 + (b'"rest":40' in data[begin:end])
    spoilt = without_end(data[:begin] + bytes(end - begin) + data[end:])
    verdict = assert_told(tmp_path / "a.mcap", spoilt, of, "a chunk and its index")
    assert verdict is not None
    # The last counts tell of the notes.
    assert (verdict.status, verdict.lost) == ("lost", {"notes_lost_in_file": gone})
    assert "further losses in the file are unknown" in verdict
    # The summary of a finished recording tells.
    verdict = assert_told(tmp_path / "b.mcap", data[:begin] + bytes(end - begin) + data[end:], of, "as finished")
    assert verdict is not None
    assert (verdict.status, verdict.lost) == ("lost", {"notes_lost_in_file": gone})
    assert "unknown" not in verdict


def test_datagrams_that_no_index_lists_are_lost_by_their_numbers_or_the_final_counts(
    whole: Path, tmp_path: Path
) -> None:
    data, all_of_them = whole.read_bytes(), taxel.open(whole).datagrams()
    # A chunk in the middle, with its index.
    begin, end = next((a, b) for a, b in chunks_of(data) if all_of_them[2] in data[a:b])
    gone = sum(all_of_them[k] in data[begin:end] for k in range(len(all_of_them)))
    spoilt = without_end(data[:begin] + bytes(end - begin) + data[end:])
    verdict = assert_told(tmp_path / "a.mcap", spoilt, held_by(taxel.open(whole)), "a chunk and its index")
    assert verdict is not None
    assert 0 < gone < len(all_of_them)
    # How the writer cut chunks decides whether the chunk holds labels and detections too.
    assert (verdict.status, verdict.lost["lost_in_file"]) == ("lost", gone)
    # Where the summary alone is missing, the final counts tell.
    spoilt = data[:begin] + bytes(end - begin) + data[end:-1]
    verdict = assert_told(tmp_path / "b.mcap", spoilt, held_by(taxel.open(whole)), "and the summary")
    assert verdict is not None
    assert verdict.lost["lost_in_file"] == gone


def test_a_chunk_in_the_place_of_another_is_there_twice_and_the_other_lost(whole: Path, tmp_path: Path) -> None:
    data, all_of_them = whole.read_bytes(), taxel.open(whole).datagrams()
    (a, b), (c, d), *_ = [(a, b) for a, b in chunks_of(data) if any(all_of_them[k] in data[a:b] for k in range(6))]
    verdict = assert_told(tmp_path / "a.mcap", data[:a] + data[c:d] + data[b:], held_by(taxel.open(whole)), "instead")
    assert verdict is not None
    assert verdict.status == "lost"
    assert verdict.lost["lost_in_file"] > 0
    assert verdict.damaged["repeated_in_file"] > 0


@pytest.mark.parametrize("cut", [1, 8, 9, 100, 1000, "zeros"])
def test_a_finished_recording_whose_summary_is_damaged_has_lost_nothing(
    whole: Path, tmp_path: Path, cut: int | str
) -> None:
    data = whole.read_bytes()
    data = data[:-cut] if isinstance(cut, int) else data[:-1500] + bytes(1500)
    verdict = assert_told(tmp_path / "a.mcap", data, held_by(taxel.open(whole)), "the end")
    assert verdict is not None
    assert (verdict.status, verdict.lost, verdict.damaged) == ("damaged", {}, {"no_summary": 1})
    assert not taxel.open(tmp_path / "a.mcap").truncated


def test_damaged_final_counts_are_not_believed(whole: Path, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    place = data.rindex(b'"received":6') + len(b'"received":')
    data[place] = ord("9")
    verdict = assert_told(tmp_path / "a.mcap", bytes(data), held_by(taxel.open(whole)), "the counts")
    assert verdict is not None
    assert (verdict.status, verdict.lost, verdict.damaged) == ("damaged", {}, {"no_final_counts": 1})
    assert verdict.startswith("the final counts are damaged: losses since the last intact counts are unknown; ")
