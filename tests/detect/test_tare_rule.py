"""The rest of a recording: nothing is detected in a tare that it was taken from, and a drift off the tare is said."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from shell import call

import taxel
from taxel import Array, Events, Frames, Tare
from taxel.detect import PlainRule, run
from taxel.detect.readout import run_counting
from taxel.detect.tares import count_drifted

FLOOR = 6.0


def touched(seed: int, drift: float = 0.0, stays: float = 0.0) -> Frames:
    """Return a minute of frames of 30 touches on 6 x 6 taxels; a rest that drifts, an object that comes and stays."""
    random = np.random.default_rng(seed)
    values = random.normal(50, 1, (3000, 6, 6)) + drift * np.linspace(0, 1, 3000)[:, None, None]
    values[1200:, 1:5, 1:5] += stays
    for begin in 100 + 90 * np.arange(30) + random.integers(0, 20, 30):
        y, x = random.integers(0, 4, 2)
        values[begin : begin + 40, y : y + 3, x : x + 3] += random.uniform(200, 300)
    return Frames(values, 20_000 * np.arange(3000), unit="counts", array=Array(6, 6))


@pytest.mark.parametrize(
    ("drift", "stays", "said"), [(0.0, 0.0, False), (3.0, 0.0, False), (20.0, 0.0, True), (0.0, 40.0, False)]
)
def test_a_drift_off_the_tare_is_said_and_a_load_that_stays_is_none(drift: float, stays: float, said: bool) -> None:
    for seed in range(5):
        frames = touched(seed, drift, stays)
        count = count_drifted(frames, Tare.take(frames, stop_us=1_000_000), FLOOR)
        assert (30 <= count <= 36) if said else count == 0


@pytest.mark.parametrize("begins", [500, 1600, 2200])
def test_a_rest_that_is_another_after_a_gap_is_said(begins: int) -> None:
    frames = touched(1)
    values, t = frames.values.copy(), frames.t.copy()
    values[begins:] += 32
    shifted = [Frames(values, t + us * (t >= t[begins]), unit="counts", array=frames.array) for us in (0, 2_500_000)]
    counts = [count_drifted(each, Tare.take(each, stop_us=1_000_000), FLOOR) for each in shifted]
    assert counts[0] == 0
    assert counts[1] >= 30


def test_a_slow_press_is_no_drift() -> None:
    values = np.full((3000, 6, 6), 50.0)
    values[500:] += np.linspace(0, 300, 2500)[:, None, None]
    frames = Frames(values, 20_000 * np.arange(3000), unit="counts", array=Array(6, 6))
    assert count_drifted(frames, Tare.take(frames, stop_us=1_000_000), FLOOR) == 0
    assert count_drifted(frames[:60], Tare.take(frames, stop_us=1_000_000), FLOOR) == 0


@pytest.mark.parametrize("seed", range(3))
def test_no_drift_is_said_of_an_emulated_board(seed: int) -> None:
    scenes = [taxel.simulate.Scene.draw(seed=10 * seed + k) for k in range(4)]
    events = taxel.simulate.play(scenes, seed=seed).events
    assert count_drifted(events, Tare.take(events, stop_us=int(events.t[0]) + 20_000), 3.0) == 0


def test_the_command_names_a_drift(tmp_path: Path, capsys) -> None:
    PlainRule("area", 2, noise_floor=FLOOR).save(tmp_path / "rule.json")
    for name, drift, said in (("steady", 0.0, None), ("drifts", 20.0, "rest: 36 taxels drifted above the tare")):
        taxel.convert(touched(1, drift), tmp_path / f"{name}.npz")
        asked = ("detect", tmp_path / f"{name}.npz", "--readout", tmp_path / "rule.json", "--tare", 1)
        code, out, error = call(capsys, *asked)
        assert (code, "drifted" in out) == (0, said is not None), error
        remarks = json.loads(call(capsys, *asked, "--json")[1])["remarks"]
        assert not remarks if said is None else remarks[0].startswith(said)


def test_no_drift_is_said_where_the_labels_are_found(tmp_path: Path) -> None:
    taxel.convert(touched(1, 20.0), tmp_path / "drifts.npz")
    recording, rule = taxel.open(tmp_path / "drifts.npz"), PlainRule("area", 2, noise_floor=FLOOR)
    options = taxel.tasks.DetectOptions(tare=1.0)
    [alone] = taxel.tasks.detect(rule, recording, options=options).each
    found = alone.outcome.found
    assert len(found) > 2
    labels = {label: found.t[found.label == label] for label in rule.labels}
    for by, is_said in ((0, False), (300_000, True)):
        moved = {label: t + by for label, t in labels.items()}
        [each] = taxel.tasks.detect(rule, recording, [moved], options).each
        assert ["this was not tried" in text for text in each.remarks if "drifted" in text] == [True] * is_said


def pressed(begins: list[int]) -> np.ndarray:
    """Return 200 frames of 4 x 4 taxels, ten of them pressed from each of these on."""
    values = np.full((200, 4, 4), 50)
    for begin in begins:
        values[begin : begin + 10, 1:3, 1:3] = 250
    return values


def test_nothing_is_detected_in_the_tare_of_a_recording(tmp_path: Path, capsys) -> None:
    values, rule = pressed([20, 45, 100, 150]), PlainRule("area", 2, noise_floor=40.0)
    rule.save(tmp_path / "rule.json")
    frames = Frames(values, 10_000 * np.arange(200), unit="counts", array=Array(4, 4))
    taxel.convert(frames, tmp_path / "own.npz")
    whole = run(rule, frames, tare=Tare.take(frames, stop_us=500_000))
    assert len(whole) == 8
    asked = ("detect", tmp_path / "own.npz", "--readout", tmp_path / "rule.json", "--json")
    found = json.loads(call(capsys, *asked, "--tare", 0.5)[1])["detections"]
    assert [one["t_us"] for one in found] == [t for t in whole.t.tolist() if t >= 500_000]
    Tare.take(frames, stop_us=500_000).save(tmp_path / "tare.json")
    assert len(json.loads(call(capsys, *asked, "--tare", tmp_path / "tare.json")[1])["detections"]) == 8


def test_what_is_left_out_counts_no_input_as_outside() -> None:
    rule = PlainRule("area", 2, noise_floor=40.0)
    frames = Frames(pressed([20, 100]), 10_000 * np.arange(200), unit="counts", array=Array(4, 4))
    tare = Tare.take(frames, stop_us=500_000)
    assert run_counting(rule, frames, tare=tare, begin_us=500_000)[0].t.tolist() == [1_000_000, 1_100_000]
    events = Events(
        [0, 0, 600, 600],
        [0, 1, 0, 1],
        [0, 0, 0, 0],
        [1, 1, 1, 1],
        intensity=[50, 50, 99, 99],
        array=Array(1, 2, pitch_mm=1),
    )
    assert len(run_counting(rule, events, tare=Tare.take(events, stop_us=500), begin_us=500)[0]) == 1
    assert len(run_counting(rule, events, tare=Tare.take(events, stop_us=500), begin_us=700)[0]) == 0
