"""Labels that are off by a time, and tares that hold a touch: training measures both and says so first."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shell import call

import taxel
from taxel import Array, Frames, Tare
from taxel.detect import Example, score
from taxel.detect.causes import _by_chance
from taxel.detect.examples import check_examples
from taxel.detect.label_times import FeltLoads, Off
from taxel.detect.tares import held_by_tare

ARRAY = Array(6, 6, pitch_mm=5.0)


def touched(
    seed: int, count: int = 12, begin_s: float = 2.5, hold_s: tuple[float, float] = (0.1, 0.3)
) -> tuple[Frames, dict[str, np.ndarray]]:
    """Return frames at 200 Hz of touches that follow each other irregularly, and when each began and ended, us."""
    random = np.random.default_rng(seed)
    begins = begin_s + np.cumsum(random.uniform(0.5, 1.5, count))
    ends = begins + random.uniform(*hold_s, count)
    t = np.arange(0, round(1e6 * (ends[-1] + 2)), 5000)
    values = random.normal(0, 0.002, (len(t), 6, 6))
    for begin, end in zip(begins, ends, strict=True):
        y, x = random.integers(1, 4, 2)
        here = (t >= 1e6 * begin) & (t < 1e6 * end)
        values[here, y : y + 2, x : x + 2] += random.uniform(0.5, 1.0)
    labels = {"contact": np.rint(1e6 * begins).astype(np.int64), "lift": np.rint(1e6 * ends).astype(np.int64)}
    return Frames(values, t, unit="V", array=ARRAY), labels


def example(seed: int, shift_ms: float, **more: Any) -> Example:
    """Return touches with their labels so much too late, and the tare before the first label."""
    frames, truth = touched(seed, **more)
    labels = {label: times + round(1000 * shift_ms) for label, times in truth.items()}
    (one,) = check_examples([Example(frames, labels, Tare.take(frames, stop_us=int(labels["contact"][0]) - 20_000))])
    return one


def far(one: Example, *labels: str) -> dict[str, Off]:
    """Return the distances of labels that are too far off to be aligned."""
    return {label: off for label, off in FeltLoads([one]).distances(labels).items() if off.is_far}


@given(st.integers(0, 1000), st.floats(-900, 900))
def test_labels_that_are_off_are_measured_and_others_are_not_called_so(seed: int, shift_ms: float) -> None:
    found = far(example(seed, shift_ms), "contact", "lift")
    if abs(shift_ms) < 40:
        assert found == {}
    if abs(shift_ms) > 60:
        assert found.keys() == {"contact", "lift"}
        for one in found.values():
            assert abs(one.ms - shift_ms) < 6
            assert one.alike >= 10


@given(st.integers(0, 1000))
def test_labels_of_touches_that_all_last_as_long_are_not_off_by_that(seed: int) -> None:
    assert far(example(seed, 0, hold_s=(0.4, 0.4)), "contact", "lift") == {}


@given(st.integers(0, 1000))
def test_labels_that_nothing_follows_are_not_off(seed: int) -> None:
    frames, _ = touched(seed)
    random = np.random.default_rng(seed)
    labels = {"odd": np.sort(random.integers(3_000_000, int(frames.t[-1]), 12))}
    (one,) = check_examples([Example(frames, labels, Tare.take(frames, stop_us=2_000_000))])
    assert far(one, "odd") == {}


@given(st.integers(0, 1000), st.sampled_from([-300.0, 200.0, 250.0, 350.0]), st.floats(30, 55))
def test_keys_pressed_live_have_a_distance_and_a_window(seed: int, lag_ms: float, spread_ms: float) -> None:
    one, random = example(seed, 0, count=35), np.random.default_rng(seed)
    late = np.rint(1000 * random.normal(lag_ms, spread_ms, 35)).astype(np.int64)
    felt = FeltLoads([one._replace(labels={"contact": one.labels["contact"] + late})])
    off = felt.distances(["contact"])["contact"]
    assert abs(off.ms - lag_ms) < 40
    if off.within_ms:
        assert 1.5 * spread_ms < off.within_ms < 6 * spread_ms
        assert off.alike >= 30


@given(st.integers(0, 1000), st.floats(0, 0.9))
def test_a_tare_that_ends_in_a_touch_holds_it(seed: int, share: float) -> None:
    frames, truth = touched(seed, 5, 0.0)
    begin, end = (int(truth[label][0]) for label in ("contact", "lift"))
    until = int(begin + share * (end - begin))
    (one,) = check_examples([Example(frames, truth, Tare.take(frames, stop_us=until))])
    held = held_by_tare([one])
    assert held == (4 if until - begin > 20_000 else held)
    assert held_by_tare([one._replace(tare=Tare.take(frames, stop_us=begin - 20_000))]) == 0


@pytest.mark.parametrize("shift_ms", [200, pytest.param(-200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_training_says_first_by_how_much_labels_are_off(tmp_path: Path, capsys, seed: int, shift_ms: int) -> None:
    frames, truth = touched(seed)
    taxel.convert(frames, tmp_path / "a.npz")
    rows = [f"{label},{t + 1000 * shift_ms}" for label, times in truth.items() for t in times]
    (tmp_path / "a.csv").write_text("\n".join(["label,t_us", *rows]) + "\n")
    arguments = ("train", tmp_path / "a.npz", "--labels", tmp_path / "a.csv", "--recipe", "touch")
    code, _, error = call(capsys, *arguments, "-o", tmp_path / "r.json")
    assert code == 2
    side = "after" if shift_ms > 0 else "before"
    found = re.search(
        rf"^taxel: labels: what may help is --shift-ms (-?\d+): 1\d of 12 are \d+ ms {side} what the sensor felt.*"
        "; to continue anyway, give --labels-as-given$",
        error,
        re.MULTILINE,
    )
    assert found, error
    assert abs(int(found[1]) + shift_ms) <= 6


def test_where_nothing_can_be_learnt_the_error_says_by_how_much_labels_are_off(tmp_path: Path, capsys) -> None:
    frames, truth = touched(1)
    taxel.convert(frames, tmp_path / "a.npz")
    rows = [f"{label},{t + 200_000}" for label, times in truth.items() for t in times]
    (tmp_path / "a.csv").write_text("\n".join(["label,t_us", *rows]) + "\n")
    in_touch = (truth["contact"][0] + 180_000) / 1e6
    arguments = ("train", tmp_path / "a.npz", "--labels", tmp_path / "a.csv", "--recipe", "touch", "--folds", 2)
    arguments = (*arguments, "--labels-as-given", "--tare", f"{in_touch:.3f}")
    code, _, error = call(capsys, *arguments, "-o", tmp_path / "r.json")
    assert (code, error.count("\n")) == (2, 1)
    assert re.search(
        r"the sensor felt nothing .*; what may help is --shift-ms -\d+: 12 of 12 are \d+ ms after what the sensor felt",
        error,
    ), error


def told(found: int, events: int, false: int, others: int) -> taxel.detect.Score:
    """Return the score of a kind with so many found and false, beside another that is never told."""
    times = np.arange(events + others) * 1_000_000
    named = times[:found].tolist() + times[events : events + false].tolist()
    return score(
        taxel.Detections(["soft"] * len(named), named, named), {"soft": times[:events], "hard": times[events:]}
    )


@pytest.mark.parametrize(
    ("found", "false", "by_chance"), [(6, 6, True), (0, 0, True), (9, 7, True), (10, 2, False), (12, 5, False)]
)
def test_kinds_are_told_by_chance_as_fisher_s_test_has_it(found: int, false: int, by_chance: bool) -> None:
    stats = pytest.importorskip("scipy.stats")
    table = [[found, 12 - found], [false, 12 - false]]
    assert (stats.fisher_exact(table, alternative="greater").pvalue > 0.05) == by_chance
    said = _by_chance("soft", "the neuron", told(found, 12, false, 12))
    assert bool(said) == by_chance
    if by_chance:
        assert said == f"the neuron recognises {found} of 12 and mistakes {false} of 12 others for soft"


def test_contact_and_lift_are_no_kinds() -> None:
    nothing = score(taxel.Detections([], [], []), {"contact": [1000], "lift": [2000]})
    assert _by_chance("contact", "the neuron", nothing) == ""


def test_kinds_that_differ_by_place_are_told_and_of_others_the_advice_says_what_the_inputs_are(
    tmp_path, capsys
) -> None:
    random = np.random.default_rng(1)
    begins = 100 + 60 * np.arange(24) + random.integers(0, 20, 24)
    values = random.normal(50.0, 1.0, (1600, 8, 8))
    left = random.permutation(24) < 12
    y, x = np.mgrid[:8, :8]
    for begin, at in zip(begins, np.where(left, 1.5, 5.5), strict=True):
        values[begin : begin + 30] += random.uniform(60, 120) * np.exp(-((y - 4) ** 2 + (x - at) ** 2) / 2)
    taxel.convert(taxel.Frames(values, 10_000 * np.arange(1600), array=taxel.Array(8, 8)), tmp_path / "own.npz")

    def lines(names: tuple[str, str], first: np.ndarray, folds: int) -> list[str]:
        rows = [f"{names[0] if one else names[1]},{10_000 * t}\n" for t, one in zip(begins, first, strict=True)]
        (tmp_path / "own.notes.csv").write_text("label,t_us\n" + "".join(rows))
        words = ("train", tmp_path / "own.npz", "-o", tmp_path / "readout.json", "--overwrite", "--folds", folds)
        code, out, error = call(capsys, *words)
        assert code == 0, error
        return out.splitlines()

    told = lines(("left", "right"), left, 5)
    for name in ("left", "right"):
        assert any(one.startswith(f"{name}, neuron: 12 of 12 found, 0 missed, 0 false") for one in told), told[:5]
    told = lines(("wet", "dry"), random.permutation(24) < 12, 2)
    (line,) = [one for one in told if "wet" in one.split(": ")[0] and "what may help is other kinds: " in one]
    assert "from moments of the frame, for example area, load and centre, and from how long a touch lasts" in line
    assert "taxel information shows whether the kinds differ otherwise" in line
    assert "no input tells" not in line
