"""Where the rest of other people's recordings is known from."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shell import call

import taxel
from taxel.recording.analysis.pressure import readings
from taxel.recording.analysis.rest import of_frames

from .making import SHARED

#: Where the rest of each shared recording is known from. The plate's footfalls, here of one subject, begin
#: unloaded, as it starts itself; of gaitndd's single channels, which have an offset, some stood still without a load
#: first.
EXPECTED = {
    "plate": {"quiet": 60},
    "insole_gaitpdb": {"unit": 48},
    "insole_moticon": {"unit": 4},
    "insole_fscan": {"unit": 1},
    "pressure_formats/pedar_example.asc": {"unit": 2},
    "pressure_formats/emed_test.lst": {"unit": 1},
    "pressure_formats/iscan_test.csv": {"quiet": 1},
    "touch_icub_grasp": {"none": 131},
    "mat_popu": {"none": 57},
}
#: Channels of gaitndd that begin quiet and without a load; all others begin standing.
UNLOADED = {"als6 left", "als9 right", "hunt1 right", "hunt13 left", "hunt13 right", "park8 left"}


def _each(name: str) -> list[taxel.Recording]:
    place = SHARED / name
    if not place.exists():
        pytest.skip(f"no {name} in {SHARED}: set TAXEL_DATA")
    endings = (".h5", ".txt", ".asf")
    files = sorted(one for one in place.iterdir() if one.suffix in endings) if place.is_dir() else []
    files = files[:1] if name == "plate" else files
    return [one for file in files or [place] for each in taxel.open_all(file) for one in each.sources.values()]


@pytest.mark.parametrize("name", EXPECTED)
def test_the_rest_of_each_shared_recording_is_known_from_where_it_can_be(name: str) -> None:
    found = Counter()
    for recording in _each(name):
        read = readings(recording)
        assert read is not None
        found[read[1].source] += 1
    assert found == EXPECTED[name]


def test_a_channel_that_begins_with_somebody_standing_on_it_has_no_rest() -> None:
    sources = {}
    for recording in _each("insole_gaitndd"):
        read = readings(recording)
        assert read is not None
        frames, rest, _ = read
        sources[recording.name] = rest.source
        if rest.source == "quiet":
            # Nearly nothing reads less than a rest.
            scale = 150 / float(np.ptp(frames.values))
            assert np.mean((frames.values - rest.tare.rest.flat[0]) * scale < -8) <= 0.1
    assert {name for name, source in sources.items() if source == "quiet"} == UNLOADED
    assert len(sources) == 24


#: When a palm's press of two fifths of the time is felt, us.
PRESSED = (("contact", 40_000), ("lift", 220_000))


def palm(seed: int, sign: int, share: float, rebound: float = 0.0) -> taxel.Frames:
    """Frames of a noisy palm with offsets that is pressed twelve times, so long a share of the time.

    After each press it goes so far beyond its rest, as a share of the press.
    """
    random = np.random.default_rng(seed)
    values = random.uniform(2800, 3200, (24, 32)) + random.normal(0, random.uniform(0, 8), (900, 24, 32))
    y, x = np.mgrid[:24, :32]
    for k in range(12):
        long = round(65 * share)
        bump = np.exp(-((y - random.uniform(4, 20)) ** 2 + (x - random.uniform(4, 28)) ** 2) / 18)
        for begin, lasts, size in ((100 + 65 * k, long, 800), (100 + 65 * k + long, 8, -800 * rebound)):
            curve = np.sin(np.linspace(0, np.pi, lasts))[:, None, None]
            values[begin : begin + lasts] += sign * size * curve * bump
    return taxel.Frames(np.round(values), np.arange(900) * 10_000, unit="counts", array=taxel.Array(24, 32))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [0.1, 0.4, 0.8])
def test_values_that_fall_with_pressure_are_said(seed: int, share: float) -> None:
    risen, fallen = (of_frames(palm(seed, sign, share)) for sign in (1, -1))
    assert (risen.source, risen.falls) == ("quiet", False)
    assert fallen.falls
    assert "falls = true in a layout file" in str(fallen)
    assert "falls" not in str(risen)


def test_encode_train_and_detect_hold_missing_values_and_count_them(tmp_path, capsys) -> None:
    rows = [f"{label},{1_000_000 + 650_000 * k + late}\n" for k in range(12) for label, late in PRESSED]
    (tmp_path / "labels.csv").write_text("label,t_us\n" + "".join(rows))
    frames = palm(6, 1, 0.4)
    values = frames.values.copy()
    values[np.random.default_rng(6).random(values.shape) < 0.01] = np.nan
    values[:, 0, 0] = np.nan
    holes = taxel.Frames(values, frames.t, unit=frames.unit, array=frames.array)
    taxel.convert(holes, tmp_path / "palm.npz")
    said = f"{holes.missing} of {values.size} values are missing (NaN): taxel uses the last value"
    at = tmp_path / "palm.npz"
    for command in (
        (
            "encode",
            at,
            tmp_path / "spikes.npz",
            "--encoder",
            "level_crossing",
            "--set",
            "levels=[200]",
            "--tare",
            "0.5",
        ),
        ("train", at, "--labels", tmp_path / "labels.csv", "-o", tmp_path / "touch", "--folds", "0"),
        ("detect", at, "--readout", tmp_path / "touch", "--tare", "0.5", "--json"),
    ):
        code, shown, error = call(capsys, *command)
        assert code == 0, error
        assert error.count(said) == 1
        assert "1 taxel without any value reads 0" in error
    assert len(json.loads(shown)["detections"]) >= 20
    held = taxel.encode.LevelCrossing([200.0]).with_tare(taxel.Tare.take(holes.held(), stop_us=500_000))
    assert taxel.SpikeTrains.load(tmp_path / "spikes.npz") == held.encode(holes.held())


def test_info_counts_missing_values_and_gaps(tmp_path, capsys) -> None:
    frames = palm(7, 1, 0.4)
    flawless = facts_of(frames, tmp_path / "flawless.npz", capsys)
    assert flawless["missing"]["values"] == 0
    assert flawless["gaps"] is None
    values = frames.values.copy()
    values[3:400, 1, 2] = np.nan
    keep = np.ones(len(frames), bool)
    keep[[200, 300, 301, 302, 500, 501]] = False
    flawed = taxel.Frames(values[keep], frames.t[keep], unit="counts", array=frames.array)
    facts = facts_of(flawed, tmp_path / "flawed.npz", capsys)
    assert facts["missing"] == {"values": np.count_nonzero(np.isnan(values[keep])), "of": flawed.values.size}
    # One frame left out is two intervals.
    assert facts["gaps"].pop("text").startswith("2 gaps, ")
    assert facts["gaps"] == {"count": 2, "total_us": 70_000, "longest_us": 40_000, "t_us": 2_990_000}
    code, shown, _ = call(capsys, "info", tmp_path / "flawed.npz")
    assert code == 0
    assert f"  {'missing values':<20}" in shown
    assert "; 2 gaps, 70 ms together, the longest 40 ms at 3.0 s" in shown


def facts_of(frames: taxel.Frames, place: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    taxel.convert(frames, place)
    code, shown, _ = call(capsys, "info", place, "--json")
    assert code == 0
    return json.loads(shown)


def test_where_rebounds_of_values_that_fall_are_detected_what_turns_them_is_said(tmp_path, capsys) -> None:
    """A palm goes a quarter beyond its rest after each press: that is felt and detected, and is no press."""
    taxel.convert(palm(5, -1, 0.4, rebound=0.25), tmp_path / "palm.npz")
    turns = "falls = true in a layout file, palm.layout.toml beside it"
    rule = tmp_path / "rule.json"
    taxel.detect.PlainRule("area", 5, noise_floor=100.0).save(rule)
    command = ("detect", tmp_path / "palm.npz", "--readout", rule, "--tare", "0.9")
    [hint], found = (json.loads(call(capsys, *command, "--json")[1])[name] for name in ("remarks", "detections"))
    assert found
    assert turns in hint
    assert hint in call(capsys, *command)[1]
    (tmp_path / "given.toml").write_text("falls = true\n")
    given = (*command, "--layout", tmp_path / "given.toml", "--json")
    assert json.loads(call(capsys, *given)[1])["remarks"] == []
    taxel.convert(palm(5, 1, 0.4, rebound=0.25), tmp_path / "palm.npz", overwrite=True)
    [hint] = json.loads(call(capsys, *given)[1])["remarks"]
    assert hint.endswith(
        "after a layout inverted them: if the values need no inversion, remove the line 'falls = ...' from it"
    )
    taxel.convert(palm(5, -1, 0.4, rebound=0.25), tmp_path / "palm.npz", overwrite=True)
    (tmp_path / "palm.layout.toml").write_text("falls = true\n")
    assert json.loads(call(capsys, *command, "--json")[1])["remarks"] == []
