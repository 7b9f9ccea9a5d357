"""What is said of labels before they are compared: another spelling, another unit of time."""

from __future__ import annotations

from pathlib import Path

import pytest
from touching import pressed

import taxel
from taxel.detect import PlainRule


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
