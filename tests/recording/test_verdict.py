"""A verdict says what was lost; all else are remarks."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel import _core
from taxel.reading import Facts, InMemory

from .making import record, some_events


def of_counts(counts: dict[str, object]) -> str:
    return _core.recording_verdict(json.dumps({"counts": counts}))["text"]  # type: ignore[no-any-return]


def test_a_verdict_says_what_became_of_a_file(tmp_path: Path) -> None:
    whole = tmp_path / "whole.mcap"
    record(whole, some_events(3000))
    data = whole.read_bytes()
    for share in (0.5, 0.7, 0.9, 0.99):
        (tmp_path / f"cut{share}.mcap").write_bytes(data[: int(len(data) * share)])
    spoilt = bytearray(data)
    middle = slice(len(data) // 2, len(data) // 2 + 40)
    spoilt[middle] = bytes(byte ^ 0xFF for byte in spoilt[middle])  # zeros there would stay zeros
    (tmp_path / "spoilt.mcap").write_bytes(spoilt)
    for ending in (".lsa", ".npz", ".csv", ".h5"):
        taxel.convert(whole, tmp_path / f"of{ending}")
    taxel.convert(tmp_path / "of.lsa", tmp_path / "back.mcap")
    (tmp_path / "noise.lsa").write_bytes(np.random.default_rng(3).integers(0, 256, 999, np.uint8).tobytes())
    verdicts = {path.name: taxel.open(path).verdict for path in sorted(tmp_path.glob("*.*")) if path.suffix != ".lss"}
    assert "in the bytes that arrived" in verdicts["noise.lsa"]
    assert verdicts["noise.lsa"].startswith("not finished: noise.lss is missing")
    assert verdicts["back.mcap"] == "losses unknown: the .lsa does not record them"
    assert verdicts["cut0.5.mcap"].startswith("not finished: the end of the recording is missing")
    assert "LOST in the file" in verdicts["spoilt.mcap"]


@pytest.mark.parametrize("share", [0.02, 0.2, 0.5, 0.9, 0.999])
def test_of_a_file_without_its_end_nothing_is_said_that_no_counts_show(tmp_path: Path, share: float) -> None:
    whole, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    record(whole, some_events(3000))
    data = whole.read_bytes()
    cut.write_bytes(data[: max(3000, int(len(data) * share))])
    recording = taxel.open(cut)
    assert recording.verdict.endswith("no counts were saved yet") == (not recording.counts.get("received"))


@pytest.mark.parametrize("seed", range(20))
def test_a_verdict_says_whether_anything_was_lost(seed: int) -> None:
    draw = np.random.default_rng(seed)
    few = lambda: int(draw.integers(0, 4))  # noqa: E731
    counts = {name: few() for name in ("dropped_by_kernel", "dropped_by_queue", "missing")}
    board = ("times_that_the_board_dropped_events", "resets", "events_repaired")
    counts["decoder"] = {name: few() for name in ("bytes_skipped", "outside_the_array", *board)}
    unrecorded = few()
    counts["recorded"] = 5
    counts["received"] = 5 + counts["dropped_by_queue"] + unrecorded
    # Each alone, else "nothing lost" would hardly ever be drawn.
    if seed % 2:
        (only,) = draw.choice(["dropped_by_kernel", "missing", "board", "none"], 1)
        counts |= {name: 3 * (only == name) for name in ("dropped_by_kernel", "dropped_by_queue", "missing")}
        counts["decoder"][board[0]] = 3 * (only == "board")
        counts["received"] = 5
        unrecorded = 0
    lost = unrecorded + sum(counts[name] for name in ("dropped_by_kernel", "dropped_by_queue", "missing"))
    lost += counts["decoder"][board[0]]
    assert of_counts(counts).startswith("LOST: " if lost else "nothing lost")
    assert ("dropped events" in of_counts(counts)) == (counts["decoder"][board[0]] > 0)


def test_remarks_and_the_verdict_go_to_a_mcap_and_back(tmp_path: Path) -> None:
    frames = taxel.Frames([[[1.0, 2.0]], [[3.0, 4.0]]], [0, 10_000])
    said = ("the times are those of the bag", "2 messages of another length left out")
    fine = taxel.Verdict._of({"counts": {"received": 5, "recorded": 5, "dropped_by_kernel": 0}})
    facts = Facts(path=tmp_path / "a.bag", array=frames.array, kind="ros", remarks=said)
    taxel.convert(taxel.Recording.of(InMemory(facts, frames, lost=fine)), tmp_path / "a.mcap")
    back = taxel.open(tmp_path / "a.mcap")
    assert (back.verdict, back.remarks) == (fine, (*said, "converted from a.bag"))
    assert back.between(0, 5000).remarks == (*said, "converted from a.bag")
    # Through another kind and back, each conversion to .mcap adds its line.
    taxel.convert(back, tmp_path / "b.mcap")
    assert taxel.open(tmp_path / "b.mcap").remarks == (*said, "converted from a.bag", "converted from a.mcap")


def test_merged_recordings_have_the_remarks_and_the_verdict_of_each(tmp_path: Path) -> None:
    events = some_events(50)
    for name in ("a", "b"):
        taxel.convert(events, tmp_path / f"{name}.lsa")
        taxel.convert(tmp_path / f"{name}.lsa", tmp_path / f"{name}.mcap")
    one, two = (taxel.open(tmp_path / f"{name}.mcap") for name in ("a", "b"))
    assert taxel.merge([one, one], gap_us=10).remarks == one.remarks
    both = taxel.merge([one, two], gap_us=10)
    assert {"converted from a.lsa", "converted from b.lsa"} <= set(both.remarks)
    assert both.verdict == "losses unknown: the .lsa does not record them"
    taxel.convert(both, tmp_path / "both.mcap")
    again = taxel.open(tmp_path / "both.mcap")
    assert (again.remarks, again.verdict) == (both.remarks, both.verdict)
