"""What is said of labels before they are compared: another spelling, another unit of time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from touching import pressed

import taxel
from taxel.detect import PlainRule
from taxel.tasks.labels import spans


@pytest.fixture
def recording(tmp_path: Path) -> taxel.Recording:
    taxel.convert(pressed(1, begin_s=0.7)[0], tmp_path / "a.npz")
    return taxel.open(tmp_path / "a.npz")


@pytest.mark.parametrize("us_by_unit", [1, 1000, 10_000])
def test_times_in_another_unit_are_said_to_be_so(us_by_unit: int, recording: taxel.Recording, tmp_path: Path) -> None:
    """In ms, or as numbers of frames of 100 Hz: all lie near the first touch."""
    rows = [f"{label},{t // us_by_unit}\n" for label, times in pressed(1, begin_s=0.7)[1].items() for t in times]
    (tmp_path / "a.csv").write_text("label,t_us\n" + "".join(rows))
    found = taxel.tasks.detect(PlainRule("area", 2, noise_floor=5.0), recording, tmp_path / "a.csv")
    assert any("in us?" in text for text in found.warnings) == (us_by_unit > 1)


def test_a_label_that_the_readout_spells_otherwise_is_said(recording: taxel.Recording) -> None:
    rule = PlainRule("area", 2, noise_floor=5.0)
    labels = pressed(1, begin_s=0.7)[1]
    assert taxel.tasks.detect(rule, recording, [labels]).warnings == ()
    found = taxel.tasks.detect(rule, recording, [{label.capitalize(): t for label, t in labels.items()} | labels])
    assert sum("spelt alike" in text for text in found.warnings) == len(labels)


def test_labels_that_are_listed_twice_are_said(recording: taxel.Recording) -> None:
    rule = PlainRule("area", 2, noise_floor=5.0)
    labels = pressed(1, begin_s=0.7)[1]
    twice = labels | {"lift": np.sort(np.concatenate([labels["lift"], labels["lift"] + 20_000]))}
    [line] = taxel.tasks.detect(rule, recording, [twice]).warnings
    assert "10 of 20 labels 'lift' are less than 50 ms after another: is each listed once?" in line


def test_a_training_says_where_values_fall(tmp_path: Path) -> None:
    """Of channels a few of which rise, so that something is felt; a rule finds falls, so labels are others."""
    (frames, _), (_, labels) = pressed(1, begin_s=0.7), pressed(2, begin_s=0.7)
    values = 50.0 - (frames.values - 50.0).reshape(len(frames), 1, 36)
    values[300::230, 0, 0] += 20.0
    taxel.convert(taxel.Frames(values, frames.t, unit="counts"), tmp_path / "a.npz")
    training = taxel.train(taxel.open(tmp_path / "a.npz"), [labels], taxel.tasks.TrainOptions(folds=0))
    assert any("write falls = true in a layout file" in line for line in training.warnings)


def test_ends_that_a_rule_finds_are_not_said_to_lie_within_touches(tmp_path: Path) -> None:
    """Two taxels keep a load, as foam does, so that touches seem not to end."""
    random = np.random.default_rng(1)
    begins = 100 + 300 * np.arange(12) + random.integers(0, 50, 12)
    ends = begins + random.integers(100, 200, 12)
    values = random.normal(50, 0.5, (3800, 6, 6))
    values[begins[0] :, 0, :2] += 8.0
    for begin, end in zip(begins, ends, strict=True):
        values[begin:end, 2:4, 2:4] += 45.0
    frames = taxel.Frames(values, 10_000 * np.arange(3800), unit="counts", array=taxel.Array(6, 6))
    taxel.convert(frames, tmp_path / "a.npz")
    within = begins + random.integers(40, 60, 12)
    for lift, lines in ((ends, 0), (within, 1)):
        given = {"contact": 10_000 * begins, "lift": 10_000 * lift}
        training = taxel.train(taxel.open(tmp_path / "a.npz"), [given], taxel.tasks.TrainOptions(folds=0))
        assert sum("lie within touches" in line for line in training.warnings) == lines
        assert training.command("foot.json") == "taxel detect RECORDING --readout foot.json"


def test_a_label_may_have_an_end(tmp_path: Path) -> None:
    made = taxel.Frames(np.zeros((300, 1, 2)), 10_000 * np.arange(300), unit="counts", array=taxel.Array(1, 2))
    place = tmp_path / "a.npz"
    taxel.convert(made, place)
    opened = [taxel.open(place)]
    tables = {
        "us.csv": "label,t_us,stop_us\nslip,100000,300000\nlift,500000,\nslip,900000,1000000\n",
        "bids.tsv": "onset\tduration\ttrial_type\n0.1\t0.2\tslip\n0.5\t0\tlift\n0.9\t0.1\tslip\n",
        "track.txt": "0.1\t0.3\tslip\n0.5\t0.5\tlift\n0.9\t1.0\tslip\n",
    }
    for name, text in tables.items():
        (tmp_path / name).write_text(text)
        [found] = spans(tmp_path / name, opened, shift_ms=1.0)
        assert {label: each.tolist() for label, each in found.items()} == {
            "slip": [[101_000, 301_000], [901_000, 1_001_000]]
        }
