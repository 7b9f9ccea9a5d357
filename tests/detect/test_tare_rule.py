"""The rest of a recording: nothing is detected in a tare that it was taken from."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from shell import call

import taxel
from taxel import Array, Frames, Tare
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
