"""One fit of a clock, repeated on what is left, names what labels are off by, and is silent on right ones."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from touching import pressed

import taxel
from taxel import Tare
from taxel.detect import Example, PlainRule
from taxel.detect.clock import ClockFit, explain, off_loads
from taxel.detect.examples import check_examples

Times = NDArray[np.float64]
Kinds = dict[str, tuple[Times, Times]]


def edges(random: np.random.Generator, count: int = 20, hold_ms: tuple[float, float] = (100.0, 300.0)) -> list[Times]:
    """Return when irregular touches begin and end, ms."""
    begins = 2500.0 + np.cumsum(random.uniform(500.0, 1500.0, count))
    return [begins, begins + random.uniform(*hold_ms, count)]


def both(labels: list[Times], found: list[Times]) -> Kinds:
    return dict(zip(("contact", "lift"), zip(labels, found, strict=True), strict=True))


def late(random: np.random.Generator) -> tuple[Kinds, list[tuple[float, float, int]]]:
    true = edges(random)
    return both([t + 320.0 for t in true], true), [(320.0, 1.0, 40)]


def jumped(random: np.random.Generator) -> tuple[Kinds, list[tuple[float, float, int]]]:
    true = edges(random, 24)
    return both([t - 1500.0 * (t >= true[0][14]) for t in true], true), [(-1500.0, 1.0, 20)]


def of_one_name(random: np.random.Generator) -> tuple[Kinds, list[tuple[float, float, int]]]:
    begins, ends = edges(random)
    return both([begins, ends], [begins + 170.0, ends]), [(-170.0, 1.0, 20)]


def of_other_rate(random: np.random.Generator) -> tuple[Kinds, list[tuple[float, float, int]]]:
    """Some touches are detected, and labels are 15 ms off."""
    true = edges(random, 30)
    rate = float(random.choice([50 / 49, 0.96, 1.2]))
    labels = [np.sort(t * rate + random.normal(0.0, 15.0, len(t))) for t in true]
    return both(labels, [t[random.random(len(t)) < 0.6] for t in true]), [(0.0, rate, 20)]


def by_hand(random: np.random.Generator) -> tuple[Kinds, list[tuple[float, float, int]]]:
    begins, _ = edges(random, 30)
    by = random.normal(0.0, 40.0, 30)
    return {"contact": (np.sort(begins + 250.0 + by - np.median(by)), begins)}, [(250.0, 1.0, 20)]


def in_recordings(random: np.random.Generator) -> tuple[Kinds, list[tuple[float, float, int]]]:
    """Trials of one step each, whose labels have one offset."""
    true = random.uniform(300.0, 1500.0, 30)
    return {f"{k}": (np.array([t + 130.0]), np.array([t])) for k, t in enumerate(true)}, [(130.0, 1.0, 30)]


SITUATIONS = (late, jumped, of_one_name, of_other_rate, by_hand, in_recordings)


def off(kinds: Kinds) -> list[ClockFit]:
    return [fit for fit in explain(kinds) if fit.is_off]


@pytest.mark.parametrize("situation", SITUATIONS)
@settings(max_examples=1)
@given(seed=st.integers(0, 10_000))
def test_the_offset_or_the_rate_of_labels_is_found(
    situation: Callable[[np.random.Generator], tuple[Kinds, list[tuple[float, float, int]]]], seed: int
) -> None:
    """In eight of ten recordings, and nearly always in more."""
    named = 0
    for k in range(10):
        kinds, [(shift_ms, rate, count)] = situation(np.random.default_rng([seed, k]))
        for fit in off(kinds)[:1]:
            is_shift = rate == 1.0 and fit.rate == 1.0 and abs(fit.shift_ms - shift_ms) <= 10.0
            is_rate = rate != 1.0 and abs(fit.rate / rate - 1.0) <= 0.002
            named += (is_shift or is_rate) and fit.explained >= 0.25 * count
    assert named >= 8


@given(seed=st.integers(0, 10_000), count=st.sampled_from([4, 12, 24]), share=st.floats(0.3, 1.0))
def test_nothing_is_said_of_labels_that_are_in_place(seed: int, count: int, share: float) -> None:
    random = np.random.default_rng(seed)
    true = edges(random, count)
    labels = [np.sort(t + random.normal(0.0, 20.0, count)) for t in true]
    assert off(both(labels, [t[random.random(count) < share] for t in true])) == []


def test_nothing_is_said_of_labels_of_another_recording_nor_beside_many_detections() -> None:
    for seed in range(6):
        random = np.random.default_rng(seed)
        true, others = edges(random), edges(random)
        assert off(both(others, true)) == []
        anywhere = np.sort(random.uniform(0.0, true[0][-1], 300))
        assert off({"contact": (true[0][:12], anywhere)}) == []


@pytest.mark.parametrize("shift_ms", [300, -150])
def test_labels_are_compared_with_loads_where_nothing_was_detected_yet(shift_ms: int) -> None:
    frames, truth = pressed(4, 20)
    for by, lines in ((1000 * shift_ms, 1), (0, 0)):
        labels = {label: t + by for label, t in truth.items()}
        example = Example(frames, labels, Tare.take(frames, stop_us=900_000), name="a.npz")
        said = off_loads(check_examples([example]))
        assert len(said) == lines
        assert all(f"--shift-ms {-shift_ms}" in line for line in said)


def test_a_training_and_a_detection_warn_of_it(tmp_path: Path) -> None:
    frames, truth = pressed(4, 20)
    taxel.convert(frames, tmp_path / "a.npz")
    recording, rule = taxel.open(tmp_path / "a.npz"), PlainRule("area", 2, noise_floor=5.0)
    late = [{label: t + 300_000 for label, t in truth.items()}]
    training = taxel.train(recording, late, taxel.tasks.TrainOptions(folds=0))
    detected = taxel.tasks.detect(rule, recording, late)
    for warnings in (training.warnings, detected.warnings):
        [line] = [each for each in warnings if "--shift-ms" in each]
        assert int(line.rpartition("--shift-ms ")[2].rstrip(")")) == pytest.approx(-300, abs=10)
    for warnings in (taxel.train(recording, [truth]).warnings, taxel.tasks.detect(rule, recording, [truth]).warnings):
        assert warnings == ()


def test_names_that_are_exchanged_are_said(tmp_path: Path) -> None:
    frames, truth = pressed(4, 20)
    taxel.convert(frames, tmp_path / "a.npz")
    recording, rule = taxel.open(tmp_path / "a.npz"), PlainRule("area", 2, noise_floor=5.0)
    exchanged = [{"contact": truth["lift"], "lift": truth["contact"]}]
    training = taxel.train(recording, exchanged, taxel.tasks.TrainOptions(folds=0))
    for warnings in (training.warnings, taxel.tasks.detect(rule, recording, exchanged).warnings):
        assert (
            "40 of 40 labels are where the other of contact and lift is felt: are the two names exchanged?" in warnings
        )
    assert training.constants_ms == {}


def test_a_label_of_which_most_are_missed_is_not_learnt(tmp_path: Path) -> None:
    """Too few are where something was felt."""
    frames, truth = pressed(4, 20)
    taxel.convert(frames, tmp_path / "a.npz")
    late = np.where(np.arange(20) < 7, truth["lift"], truth["lift"] + 600_000)
    labels = {"contact": truth["contact"], "lift": np.sort(late)}
    training = taxel.train(taxel.open(tmp_path / "a.npz"), [labels], taxel.tasks.TrainOptions(folds=0))
    assert training.score["lift"].found < 10
    assert training.learnt == ("contact",)
    assert any(line.startswith("lift: do not rely on this readout") for line in training.warnings)


@pytest.mark.parametrize("late_ms", [-80, 60, 120])
def test_by_how_much_the_labels_of_one_name_are_off_what_was_felt_is_taken_off(tmp_path: Path, late_ms: int) -> None:
    frames, truth = pressed(4, 20)
    taxel.convert(frames, tmp_path / "a.npz")
    labels = {"contact": truth["contact"] + 1000 * late_ms, "lift": truth["lift"]}
    training = taxel.train(taxel.open(tmp_path / "a.npz"), [labels], taxel.tasks.TrainOptions(folds=0))
    assert training.constants_ms == {"contact": pytest.approx(late_ms, abs=10)}
    assert training.score.rank[0] == 0
    assert any(line.startswith("contact: labels are ") for line in training.lines())
    assert training.to_dict()["constants_ms"] == training.constants_ms


def by_button(seed: int, at: Times, spread_ms: tuple[float, float]) -> Times:
    """Return when a person's button marked events, us: each is late by another time."""
    late_us = 1000.0 * np.random.default_rng(seed).uniform(*spread_ms, len(at))
    return np.sort(at + np.rint(late_us).astype(np.int64))


@pytest.mark.parametrize(("spread_ms", "least"), [((-70.0, -20.0), 28), ((80.0, 250.0), 10)])
def test_labels_of_the_same_hand_are_found_in_another_recording(
    tmp_path: Path, spread_ms: tuple[float, float], least: int
) -> None:
    """Also where they are less off than the window, and where they vary by more than it."""
    recordings, labels = [], []
    for seed, name in ((4, "a.npz"), (5, "b.npz")):
        frames, truth = pressed(seed, 30)
        taxel.convert(frames, tmp_path / name)
        recordings.append(taxel.open(tmp_path / name))
        labels.append({"contact": by_button(seed, truth["contact"], spread_ms), "lift": truth["lift"]})
    training = taxel.train(recordings[0], labels[:1], taxel.tasks.TrainOptions(folds=0))
    assert training.constants_ms == {"contact": pytest.approx(sum(spread_ms) / 2, abs=25)}
    training.readout.save(tmp_path / "touch.json")
    detected = taxel.tasks.detect(taxel.Readout.load(tmp_path / "touch.json"), recordings[1], labels[1:])
    assert detected.score is not None
    assert detected.score["contact"].found >= least
    [line] = [line for line in detected.warnings if line.startswith("contact: labels are ")]
    assert line.endswith("as in the training: taken off to score")
    right = taxel.tasks.detect(training.readout, recordings[1], [pressed(5, 30)[1]])
    assert not any("taken off" in line for line in right.warnings)


def test_labels_that_no_shift_puts_on_loads_are_said_to_be_off(tmp_path: Path) -> None:
    taxel.convert(pressed(4, 20)[0], tmp_path / "a.npz")
    other = pressed(6, 20)[1]
    training = taxel.train(taxel.open(tmp_path / "a.npz"), [other], taxel.tasks.TrainOptions(folds=0))
    said = [line for line in training.warnings if "by no one shift: are they of this recording, and in time?" in line]
    assert [line.partition(":")[0] for line in said] == ["contact", "lift"]


@pytest.mark.parametrize(
    ("chosen", "line"),
    [
        (slice(0, 20), None),
        (slice(2, 20), "contact at {0:.3f} s, {1:.3f} s are false: does each lack a label?"),
    ],
)
def test_times_of_lacking_labels_are_said(tmp_path: Path, chosen: slice, line: str | None) -> None:
    frames, truth = pressed(4, 20)
    taxel.convert(frames, tmp_path / "a.npz")
    labels = truth | {"contact": truth["contact"][chosen]}
    training = taxel.train(taxel.open(tmp_path / "a.npz"), [labels], taxel.tasks.TrainOptions(folds=0))
    expected = () if line is None else (line.format(*truth["contact"][:2] / 1e6),)
    assert training.warnings == expected
