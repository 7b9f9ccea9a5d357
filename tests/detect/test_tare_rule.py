"""The rest of a recording: nothing is detected in a tare that it was taken from."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from shell import call

import taxel
from taxel import Array, Events, Frames, Tare
from taxel.detect import PlainRule, run


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
    assert run(rule, frames, tare=tare, begin_us=500_000).t.tolist() == [1_000_000, 1_100_000]
    events = Events(
        [0, 0, 600, 600],
        [0, 1, 0, 1],
        [0, 0, 0, 0],
        [1, 1, 1, 1],
        intensity=[50, 50, 99, 99],
        array=Array(1, 2, pitch_mm=1),
    )
    assert len(run(rule, events, tare=Tare.take(events, stop_us=500), begin_us=500)) == 1
    assert len(run(rule, events, tare=Tare.take(events, stop_us=500), begin_us=700)) == 0
