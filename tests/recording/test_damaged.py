"""A file that is cut or damaged anywhere gives what is left, and says what is not."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from shell import call

import taxel
from taxel._core import FormatError

from .making import record, some_events


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("small") / "small.mcap"
    record(path, some_events(200), compression="lz4")
    return path


def begins(whole: bytes) -> list[int]:
    """Return where each record of an .mcap begins: its opcode, then its length in 8 bytes."""
    places = [8]
    while (place := places[-1]) < len(whole) - 8:
        places.append(place + 9 + int.from_bytes(whole[place + 1 : place + 9], "little"))
    return places


@pytest.mark.parametrize("step", [31, pytest.param(1, marks=pytest.mark.slow)])
def test_a_small_file_cut_at_any_byte_gives_what_is_left(step: int, small: Path, tmp_path: Path) -> None:
    whole, all_of_it = small.read_bytes(), taxel.open(small).datagrams()
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole)
    # The magic, the MCAP header, then the metadata record "taxel" (opcode 0x0C, its length in 8 bytes).
    place = whole.index(b"taxel", 40) - 13
    header = place + 9 + int.from_bytes(whole[place + 1 : place + 9], "little")
    before = len(all_of_it)
    # At every byte around the head of a record; elsewhere in steps, as only the whole of a record counts.
    heads = {place + k for place in begins(whole) for k in range(-2, 11)}
    for cut in sorted({*range(len(whole), 0, -step), *(heads & set(range(len(whole))))}, reverse=True):
        os.truncate(path, cut)
        if cut < header:
            # Before the end of the first record no file is readable.
            with pytest.raises(FormatError, match=r"cut\.mcap"):
                taxel.open(path)
            continue
        rec = taxel.open(path)
        left = rec.datagrams()
        assert len(left) <= before, f"more datagrams from fewer bytes, {cut}"
        assert np.array_equal(left.number, all_of_it.number[: len(left)])
        assert np.array_equal(left.payload, all_of_it.payload[: left.payload.size])
        assert rec.rebuilt["bad_chunks"] == 0
        assert cut < len(whole) - 4000 or len(left) == len(all_of_it), "the summary's loss costs nothing"
        before = len(left)
    assert before == 0


def test_a_file_cut_before_its_end_says_that_it_is_truncated(small: Path, tmp_path: Path) -> None:
    whole = small.read_bytes()
    assert not taxel.open(small).truncated
    path = tmp_path / "cut.mcap"
    # Before the last record of data: the summary behind it is the larger half of a small file.
    path.write_bytes(whole[: len(whole) // 4])
    rec = taxel.open(path)
    assert rec.truncated
    assert rec.verdict.status == "unfinished"
    assert rec.rebuilt["torn_bytes"] > 0
    assert taxel.convert(rec, tmp_path / "again.mcap") == []
    assert taxel.open(tmp_path / "again.mcap").verdict == rec.verdict


def test_info_of_a_recording_that_was_cut_off_ends_as_what_lost_data(small: Path, tmp_path: Path, capsys) -> None:
    whole, cut = small.read_bytes(), tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) // 4])
    assert [call(capsys, "info", each)[0] for each in (small, cut)] == [0, 3]


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_damage_anywhere_loses_chunks_but_never_invents_datagrams(tmp_path: Path, compression: str) -> None:
    path = tmp_path / "whole.mcap"
    record(path, some_events(3000), compression=compression)
    whole = path.read_bytes()
    sound = taxel.open(path).datagrams()
    known = {int(n): sound[k] for k, n in enumerate(sound.number)}
    rng = np.random.default_rng(5)
    for place in rng.integers(8, len(whole), 150):
        damaged = bytearray(whole)
        damaged[place] ^= int(rng.integers(1, 256))
        path.write_bytes(damaged)
        rec = taxel.open(path)
        left = rec.datagrams()
        assert all(known[int(n)] == left[k] for k, n in enumerate(left.number))
        if len(left) < len(sound):
            lost = ("bad_chunks", "large_chunks", "gaps", "torn_bytes")
            assert sum(rec.rebuilt[cause] for cause in lost) > 0, f"byte {place}"
            assert rec.verdict.status in ("lost", "unfinished")


def test_a_bad_chunk_is_skipped_counted_and_said(tmp_path: Path) -> None:
    path = tmp_path / "long.mcap"
    writer_events = some_events(1000)
    record(path, writer_events, finish=True)
    damaged = bytearray(path.read_bytes())
    place = damaged.index(taxel.open(path).datagrams()[50])
    damaged[place + 2] ^= 1
    path.write_bytes(damaged)
    rec = taxel.open(path)
    assert rec.rebuilt["bad_chunks"] == 1
    assert rec.verdict.damaged == {"bad_chunks": 1}
    assert rec.verdict.lost["lost_in_file"] == 100 - len(rec.datagrams())
    assert not rec.truncated
    assert len(rec.events) < 1000


def test_random_bytes_behind_the_magic_are_refused_or_empty(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    path = tmp_path / "noise.mcap"
    for size in (0, 1, 9, 100, 10_000, 200_000):
        path.write_bytes(b"\x89MCAP0\r\n" + rng.integers(0, 256, size, dtype=np.uint8).tobytes())
        with pytest.raises(FormatError, match="is not a taxel recording"):
            taxel.open(path)
