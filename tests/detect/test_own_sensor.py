"""Training on a sensor of one's own: frames of a grid in any unit, with an offset and noise of each taxel."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shell import call

import taxel
from taxel import Array, Frames, Tare
from taxel.detect import Example, Recipe, fit, judge, load, recipes, run, score
from taxel.detect.fit import Fitter
from taxel.detect.floors import measured_floor
from taxel.encode import ContactArea, LocalLoad

LABELS = ("contact", "lift")


def touched(
    shape: tuple[int, int], seed: int, *, gain: float, noise: float, offset: float = 0.0, begin_s: float = 1.0
) -> tuple[Frames, dict[str, np.ndarray]]:
    """Return frames at 100 Hz of 12 touches anywhere, and when they begin and end."""
    random = np.random.default_rng(seed)
    count, period = 12, 100
    first = round(100 * begin_s)
    values = random.normal(offset, offset / 20, shape) + random.normal(0, noise, (first + count * period, *shape))
    y, x = np.mgrid[: shape[0], : shape[1]]
    starts = first + period * np.arange(count) + random.integers(0, 20, count)
    stops = starts + random.integers(30, 60, count)
    for start, stop in zip(starts, stops, strict=True):
        at = [random.uniform(1, side - 2) for side in shape]
        values[start:stop] += gain * random.uniform(0.3, 1) * np.exp(-((y - at[0]) ** 2 + (x - at[1]) ** 2) / 3)
    times = np.arange(len(values)) * 10_000
    return Frames(values, times, unit="counts", array=Array(*shape)), {"contact": times[starts], "lift": times[stops]}


def written(folder: Path, frames: Frames, labels: dict[str, np.ndarray], more: str = "") -> tuple[object, ...]:
    """Write a recording and its labels, and return the arguments of a training."""
    taxel.convert(frames, folder / "own.npz")
    rows = [f"{label},{t}" for label, times in labels.items() for t in times]
    (folder / "labels.csv").write_text("\n".join(["label,t_us", *rows]) + "\n" + more)
    return ("train", folder / "own.npz", "--labels", folder / "labels.csv", "-o", folder / "readout.json")


@pytest.mark.parametrize(
    ("shape", "values"),
    [
        pytest.param((24, 32), {"gain": 1200.0, "noise": 6.0, "offset": 3000.0}, marks=pytest.mark.slow),
        pytest.param((16, 16), {"gain": 0.8, "noise": 0.006, "offset": 0.2}, marks=pytest.mark.slow),
        ((8, 8), {"gain": 200.0, "noise": 1.0, "offset": 10.0}),
    ],
)
def test_a_plain_training_finds_the_touches_of_any_grid(
    tmp_path: Path, capsys, shape: tuple[int, int], values: dict[str, float]
) -> None:
    code, out, error = call(capsys, *written(tmp_path, *touched(shape, 1, **values)))
    assert code == 0, error
    lines = out.splitlines()
    assert lines[0] == "held out: 5 blocks of time (window 50 ms)"
    for line, label in zip(lines[1:5:3], LABELS, strict=True):
        found, missed, false = map(int, re.findall(r"(\d+) (?:of 12 found|missed|false)", line))
        assert (line.startswith(f"{label}, neuron: "), found + missed, missed + false <= 1) == (True, 12, True), line
    assert "recipe touch" in out
    unseen, truth = touched(shape, 2, **values)
    tare = Tare.take(unseen, stop_us=900_000)
    again = score(run(taxel.Readout.load(tmp_path / "readout.json"), unseen, tare=tare), truth)
    assert again.missed + again.false <= 1


def test_the_floor_scales_with_the_unit_and_not_with_a_bad_taxel() -> None:
    frames, labels = touched((6, 6), 3, gain=100.0, noise=1.0)
    values = frames.values.astype(float)
    values[:, 2, 3] *= 40

    def floor(values: np.ndarray, unit: str = "counts") -> float | None:
        frames_of = Frames(values, frames.t, unit=unit, array=frames.array)
        return measured_floor([Example(frames_of, labels, Tare.take(frames_of, stop_us=900_000))])

    alone = floor(frames.values)
    assert alone == pytest.approx(6.0, rel=0.25)
    assert floor(frames.values * 0.001) == pytest.approx(alone / 1000, rel=0.01)
    assert floor(values) < 3 * alone
    assert floor(frames.values, "ticks") is None, "a board's registers state it"
    assert measured_floor([Example(frames, labels)]) is None


def test_a_floor_that_the_recipe_or_the_user_states_stays(tmp_path: Path, capsys) -> None:
    plan = Recipe.load("touch", {"encoders.area.noise_floor": 30.0}, LABELS, 0.5)
    parts = plan.encoder.parts
    assert parts["area"] == ContactArea(noise_floor=30.0)
    assert parts["levels"] == LocalLoad(
        noise_floor=0.5, least_noise=0.05, levels=[3.0, 4.0, 5.0, 6.0, 8.0], release=0.8
    )
    assert Recipe.load("gait_plate", None, None, 0.5).encoder == Recipe.load("gait_plate").encoder
    arguments = written(tmp_path, *touched((6, 6), 3, gain=100.0, noise=1.0))
    assert call(capsys, *arguments, "--folds", 0, "--set", "encoders.levels.noise_floor=9")[0] == 0
    assert taxel.Readout.load(tmp_path / "readout.json").encoder.parts["levels"].noise_floor == 9.0


@pytest.mark.parametrize(
    ("labels", "unit", "shape", "recipe"),
    [
        (("contact", "lift"), "counts", (2, 2), "touch"),
        (("contact",), "V", (2, 2), "touch"),
        (("contact", "foot_off"), "counts", (2, 2), "gait_plate"),
        (("contact", "lift"), "V", (1, 4), "touch"),
        (("press", "release"), "N", (1, 1), "touch"),
        (("contact", "lift", "slip"), "V", (1, 4), "touch"),
        (("press", "tap"), "counts", (1, 1), "touch"),
        (("left foot", "right foot"), "V", (1, 16), "gait_channel"),
        (("soft", "hard"), "V", (3, 11), "touch"),
        (("contact", "lift", "slip"), "counts", (4, 8), "touch"),
        (("tap",), "N", (1, 16), "gait_insole"),
        (("contact", "lift", "soft", "hard"), "N", (4, 8), "touch"),
        (("heel strike", "toe-off"), "counts", (16, 16), "gait_plate"),
        (("footfall",), "counts", (16, 16), "gait_plate"),
        (("soft", "hard"), "V", (1, 64), "touch"),
        (("contact", "foot_off"), "kPa", (16, 16), "touch"),
        (("links Erstkontakt", "links Zehenablösung"), "kPa", (16, 16), "touch"),
        (("Erstkontakt", "Zehenablösung"), "N", (1, 12), "gait_insole"),
        (("contact", "heel_off", "foot_off"), "kPa", (4, 8), "gait_channel"),
        ((), "counts", (2, 2), "gait_plate"),
    ],
)
def test_labels_and_neighbours_choose_the_recipe(
    labels: tuple[str, ...], unit: str, shape: tuple[int, int], recipe: str
) -> None:
    assert recipes.chosen(Frames(np.zeros((1, *shape)), [0], unit=unit, array=Array(*shape)), labels)[0] == recipe


def test_a_refused_training_leaves_no_folder_of_its_report(tmp_path: Path, capsys) -> None:
    arguments = written(tmp_path, *touched((8, 8), 4, gain=200.0, noise=1.0))
    code, _, _ = call(capsys, *arguments, "--recipe", "./none.toml", "--report", tmp_path / "a" / "b")
    assert (code, (tmp_path / "a").exists()) == (2, False)
    (tmp_path / "kept").mkdir()
    assert call(capsys, *arguments, "--recipe", "./none.toml", "--report", tmp_path / "kept")[0] == 2
    assert (tmp_path / "kept").is_dir()


def test_an_end_of_touches_is_learnt_by_any_name() -> None:
    frames, labels = touched((8, 8), 5, gain=200.0, noise=1.0)
    frames = Frames(frames.values, frames.t, unit="V", array=frames.array)
    times = {"contact": labels["contact"], "drop": labels["lift"]}
    example = Example(frames, times, Tare.take(frames, stop_us=900_000))
    readout = fit([example], Recipe.load("touch", None, list(times), measured_floor([example])))
    assert "drop" in readout.by_rule
    assert score(run(readout, frames, tare=example.tare), times).rank[0] == 0


@pytest.mark.parametrize("labels", [("contact", "lift"), ("contact",)])
def test_the_rule_in_a_readout_detects_what_the_training_says(tmp_path: Path, capsys, labels: tuple[str, ...]) -> None:
    frames, truth = touched((6, 6), 1, gain=100.0, noise=1.0, offset=10.0)
    arguments = written(tmp_path, frames, {label: truth[label] for label in labels})
    code, out, error = call(capsys, *arguments, "--folds", "0")
    assert code == 0, error
    tare = Tare.take(frames, stop_us=int(truth["contact"][0]) - 20_000)
    readout = load(tmp_path / "readout.json")
    for label in labels:
        found = score(run(readout.using("rule"), frames, tare=tare)[label], {label: truth[label]})
        counts = f"{found.found} of 12 found, {found.missed} missed, {found.false} false"
        assert any(line.startswith(f"{label}, plain rule") and counts in line for line in out.splitlines())
    asked = ("detect", tmp_path / "own.npz", "--readout", tmp_path / "readout.json", "--tare", "0.5", "--use", "rule")
    code, out, _ = call(capsys, *asked)
    assert (code, "known (ms)" in out, "nan" in out, "slope" in out) == (0, True, False, False)


@pytest.mark.parametrize(
    "unit", ["N", "kPa", *(pytest.param(one, marks=pytest.mark.slow) for one in ("mN", "Pa", "N/cm2"))]
)
def test_a_noisy_mat_in_force_or_pressure_rests_at_0_for_info_train_and_detect(
    tmp_path: Path, capsys, unit: str
) -> None:
    frames, labels = touched((8, 8), 4, gain=60.0, noise=1.0)
    mat = Frames(np.abs(frames.values), frames.t, unit=unit, array=Array(8, 8, pitch_mm=10.0))
    arguments = written(tmp_path, mat, labels)
    code, out, error = call(capsys, "info", tmp_path / "own.npz")
    assert (code, "rest                0, because the values are force or pressure" in out) == (0, True), error
    (area,) = re.findall(r"contact area +at most (\d+) mm2", out)
    assert 100 <= int(area) <= 3200, "the noise of the others is no contact"
    code, out, error = call(capsys, *arguments, "--folds", 0)
    assert (code, "\ntare: " in out) == (0, False), error
    truth = ("--truth", tmp_path / "labels.csv", "--json")
    code, out, error = call(capsys, "detect", tmp_path / "own.npz", "--readout", tmp_path / "readout.json", *truth)
    assert code == 0, error
    assert json.loads(out)["score"]["found"] >= 22, out[:500]


def squares(sides: list[int]) -> tuple[Frames, dict[str, list[int]]]:
    """Return frames at 100 Hz of touches that load squares of so many taxels at once, one per second."""
    values = np.random.default_rng(1).normal(0, 1, (100 * (len(sides) + 2), 12, 12))
    starts = 100 + 100 * np.arange(len(sides))
    for start, side in zip(starts, sides, strict=True):
        values[start : start + 40, 2 : 2 + side, 3 : 3 + side] += 300.0
    frames = Frames(values, np.arange(len(values)) * 10_000, unit="counts")
    return frames, {"contact": (10_000 * starts).tolist(), "lift": (10_000 * (starts + 40)).tolist()}


@settings(max_examples=settings.default.max_examples // 5)
@given(st.lists(st.integers(4, 8), min_size=1, max_size=6), st.integers(2, 3))
def test_a_touch_smaller_than_all_that_were_learnt_is_found(sides: list[int], small: int) -> None:
    frames, labels = squares(sides)
    tare = Tare.take(frames.between(0, 900_000))
    example = Example(frames, labels, tare)
    plan = Recipe.load("touch", labels=LABELS, noise_floor=measured_floor([example]))
    readout = Fitter([example], plan).fit().readout
    others, truth = squares([small] * 3)
    judged = score(run(readout, others, tare=tare), truth)
    assert {label: (one.missed, one.false) for label, one in judged.by_label.items()} == dict.fromkeys(LABELS, (0, 0))


def test_where_the_first_inputs_feel_nothing_others_are_tried() -> None:
    """On a mat that lies full, how many taxels are loaded never changes."""
    frames, labels = squares([4, 3, 5, 4] * 3)
    tare = Tare.take(frames.between(0, 900_000))
    full = Frames(frames.values + 100.0, frames.t, unit=frames.unit, array=frames.array)
    example = Example(full, labels, tare)
    plan = Recipe.load("touch", labels=LABELS, noise_floor=measured_floor([example]))
    judged = judge([example], plan, 2)
    assert {label: one.missed for label, one in judged.together.by_label.items()} == dict.fromkeys(LABELS, 0)
