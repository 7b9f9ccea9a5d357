"""Gaps of time stamps: in the verdict, in info and in the table of a folder."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tests.shell import run

import taxel
from taxel import Array, Events, Frames


def walk(*gaps: tuple[int, int], begin_us: int = 0) -> Frames:
    """Return a minute of frames at 100 Hz without those between the times of gaps, us."""
    t = np.arange(0, 60_000_000, 10_000)
    kept = ~np.any([(t > first) & (t < end) for first, end in gaps], axis=0) if gaps else np.ones(len(t), bool)
    values = np.random.default_rng(1).normal(9.0, 0.1, (int(kept.sum()), 3, 4))
    return Frames(values, t[kept] + begin_us, unit="counts", array=Array(3, 4))


def camera(rate: float, *gaps: tuple[float, float], seconds: float = 30.0, name: str = "event camera") -> Events:
    """Return noise of a camera, whose events come by chance, without those in gaps, s."""
    random = np.random.default_rng(2)
    t = np.sort(random.uniform(0, seconds, int(rate * seconds)))
    kept = ~np.any([(t > first) & (t < end) for first, end in gaps], axis=0) if gaps else np.ones(len(t), bool)
    us = (t[kept] * 1e6).astype(np.int64)
    x, y = (random.integers(0, size, len(us)) for size in (30, 20))
    return Events(us, x, y, random.random(len(us)) < 0.75, array=Array(20, 30, name=name))


def test_a_recording_that_counts_its_losses_has_its_gaps_in_a_line_of_info(tmp_path: Path) -> None:
    taxel.convert(walk((20_000_000, 23_500_000)), tmp_path / "a.mcap")
    assert taxel.open(tmp_path / "a.mcap").verdict == "nothing lost"
    assert "  gaps                1 gap of 3.5 s at 20.0 s\n" in run("info", tmp_path / "a.mcap").stdout


def test_the_table_of_a_folder_has_gaps_and_bad_taxels_and_no_verdict_that_says_nothing(tmp_path: Path) -> None:
    whole = walk()
    values = whole.values.copy()
    # Touches of all taxels but one, which is always at the greatest value.
    values += 20.0 * (np.arange(len(whole)) % 500 > 300)[:, None, None]
    values[:, 1, 2] = 50.0
    taxel.convert(Frames(values, whole.t, unit="counts", array=whole.array), tmp_path / "a.npz")
    taxel.convert(walk(), tmp_path / "b.npz")
    head, first, second, _ = run("info", tmp_path).stdout.splitlines()[1:5]
    assert head.split()[-3:] == ["dead", "stuck", "noisy"]
    assert first.split()[-3:] == ["0", "1", "0"]
    assert second.split()[-3:] == ["0", "0", "0"]
    taxel.convert(walk((20_000_000, 23_500_000)), tmp_path / "c.npz")
    # taxel's own file states what was lost.
    taxel.convert(walk(), tmp_path / "d.mcap")
    head, *rows = run("info", tmp_path).stdout.splitlines()[1:6]
    assert head.split()[-2:] == ["gaps", "verdict"]
    assert rows[2].split()[-4:] == ["1", "(3.5", "s)", "unknown"]
    assert rows[3].split()[-1] == "complete"


def test_info_of_a_camera_has_its_polarities_and_no_untouched_pixels(tmp_path: Path) -> None:
    quiet, burst = camera(1000.0), camera(50_000.0, seconds=0.5)
    table = (quiet + Events(burst.t + 10_000_000, burst.x, burst.y, burst.p, array=burst.array)).sorted()
    taxel.convert(table, tmp_path / "a.npz")
    facts = json.loads(run("info", tmp_path / "a.npz", "--json").stdout)
    assert facts["on_share"] == pytest.approx(0.75, abs=0.01)
    shown = run("info", tmp_path / "a.npz").stdout
    assert "other taxels" not in shown
    assert " % on\n" in shown
    assert "on_share" not in json.loads(run("info", board(tmp_path), "--json").stdout)


def board(folder: Path) -> Path:
    taxel.convert(camera(100.0, name="mat"), folder / "board.npz")
    return folder / "board.npz"
