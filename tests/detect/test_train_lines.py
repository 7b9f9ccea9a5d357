"""``taxel train`` judges itself: the first line says on what, the next ones how well, what was felt."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from discs import ARRAY, tare, touches
from shell import call

import taxel
from taxel.detect.choice import Choice, Made
from taxel.options import TrainOptions

pytestmark = pytest.mark.usefixtures("undrawn")


def recorded(folder: Path, seed: int, count: int = 6, late_us: int = 0, more: str = "") -> tuple[Path, Path]:
    """Write a recording and its labels, each so much too late."""
    events, truth = touches(seed, count)
    taxel.convert(events, folder / f"{seed}.npz")
    rows = [f"{label},{t + late_us}" for label, times in truth.items() for t in times]
    (folder / f"{seed}.csv").write_text("\n".join(["label,t_us", *rows]) + "\n" + more)
    return folder / f"{seed}.npz", folder / f"{seed}.csv"


def test_the_first_line_says_held_out_and_the_next_ones_how_each_label_scored(tmp_path: Path, capsys) -> None:
    recording, labels = recorded(tmp_path, 1, 12, late_us=7_000)
    code, out, _ = call(capsys, "train", recording, "--labels", labels, "-o", tmp_path / "r.json", "--tare", 0.08)
    lines = out.splitlines()
    assert (code, lines[0]) == (0, "held out: 5 blocks of time of one recording (window 50 ms)")
    ways = r"(neuron|rule)"
    for line, label in zip(lines[1:4:2], ("contact", "lift"), strict=True):
        said = rf"{label}: {ways} runs: 0 mistakes of 12 \({ways} 0\); known -[\d.]+ ms after the label, {ways} -[\d.]+"
        (ran,) = re.findall(said, line)
        assert ran[0] != ran[1] == ran[2], line
    for line in lines[2:5:2]:
        assert re.fullmatch("  rule, tuned on all: .* less .* ms.*", line), line
    moved = r"{} by (-\d\S*) ms \(median; largest -\d\S*\)"
    said = re.fullmatch(
        f"labels moved to what the sensor felt: {moved.format('contact')}; {moved.format('lift')}", lines[5]
    )
    assert said, lines[5]
    assert all(-9.0 < float(median) < -4.0 for median in said.groups())
    assert "recipe touch: contact and lift" in out
    before = lines[: lines.index("")]
    assert (len(before) <= 15, max(map(len, before)) <= 160) == (True, True)


def test_a_fold_that_cannot_be_learnt_leaves_the_training_as_it_is(tmp_path: Path, capsys) -> None:
    """Of a second recording nothing was felt: it teaches silence, but not alone."""
    first, labels = recorded(tmp_path, 1)
    events = taxel.Events(
        [0] * 64, np.arange(64) % 8, np.arange(64) // 8, [True] * 64, array=ARRAY, intensity=[60] * 64
    )
    taxel.convert(events, tmp_path / "still.npz")
    lines = [f"1,{line}" for line in labels.read_text().splitlines()[1:]]
    labels.write_text("\n".join(["recording,label,t_us", *lines, "still,contact,50000", "still,lift,90000"]) + "\n")
    tared = ("--tare", tmp_path / "tare.json")
    tare().save(tmp_path / "tare.json")
    arguments = ("train", first, tmp_path / "still.npz", "--labels", labels, *tared, "--overwrite")
    code, out, _ = call(capsys, *arguments, "-o", tmp_path / "r.json")
    assert code == 0
    assert out.startswith(
        "not held out, but scored on its own training data (window 50 ms): a part of the training data cannot"
    )
    assert re.search(r"contact: \w+ runs: 1 mistake of 7 \(", out)
    code, _, error = call(capsys, *arguments, "--folds", 2, "-o", tmp_path / "r.json")
    assert (code, "the sensor felt nothing" in error) == (2, True), "folds that were asked for are not left out"


@pytest.mark.parametrize(
    ("by_chance", "mistakes", "said"),
    [
        (True, {"a dead taxel": (2, 40)}, "0, which may be chance); KNOWN; with a dead taxel 2 (rule 40)"),
        (False, {"gain x 0.8": (1, 9), "gain x 1.25": (2, 7)}, "0; changed 3, rule 16); KNOWN"),
        (
            True,
            {"a dead taxel": (1, 0), "a stuck taxel": (2, 40)},
            "0, which may be chance); KNOWN; with a stuck taxel 2 (rule 40)",
        ),
        (True, {"a dead taxel": (1, 0)}, "0, which may be chance); KNOWN"),
    ],
)
def test_a_line_says_what_decided_and_the_worst_day_of_what_runs(tmp_path: Path, by_chance, mistakes, said) -> None:
    recording, labels = recorded(tmp_path, 1)
    training = taxel.train(taxel.open(recording), labels, TrainOptions(tare=0.08))
    choice = Choice(False, by_chance, 10.0, Made(1, 0, 19.0, 1.0), Made(0, 0, 33.0, 1.0), mistakes)
    made = training.made._replace(readout=training.readout.using("neuron"))
    training = replace(training, scored=replace(training.scored, choices={"contact": choice}), made=made)
    said = said.replace("KNOWN", "known 19 ms after the label, rule 33")
    assert f"contact: neuron runs: 1 mistake of 6 (rule {said}" in training.lines()
