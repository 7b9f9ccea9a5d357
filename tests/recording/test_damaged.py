"""A file that is cut or damaged anywhere gives what is left, and says what is not."""

from __future__ import annotations

from pathlib import Path

import pytest

import taxel

from .making import record, some_events


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("small") / "small.mcap"
    record(path, some_events(200), compression="lz4")
    return path


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
