"""What `taxel detect` says of drawn situations: first a verdict, then what is the matter; nothing of a right one."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from shell import call

import taxel
from taxel.detect import Example, Recipe
from taxel.detect.cause import by_option
from taxel.detect.causes import Mistakes, with_settings, without_explained
from taxel.detect.evidence import Evidence
from taxel.detect.examples import Outcome, check_examples
from taxel.detect.fitting import UNLEARNT
from taxel.detect.floors import measured_floor
from taxel.detect.folds import Judged
from taxel.detect.mistakes import causes_of
from taxel.tasks import TrainOptions

Labels = dict[str, NDArray[np.int64]]
SIZES = {"taxel": ((1, 1), 100.0), "channels": ((1, 8), 60.0), "grid": ((16, 16), 50.0)}


def drawn(
    shape: tuple[int, int],
    rate: float,
    seed: int,
    *,
    gain: float = 1.0,
    noise: float = 2.0,
    dead: int = 0,
    rise_s: float = 0.02,
) -> tuple[taxel.Frames, Labels]:
    """Return 25 touches on counts that rest at 500, and when each began and ended; some columns may be dead."""
    random = np.random.default_rng(seed)
    lasting, apart = random.uniform(0.35, 0.8, 25), random.uniform(0.5, 1.0, 25)
    begins = 3 + np.cumsum(apart) + np.append(0, np.cumsum(lasting[:-1]))
    t = np.arange(round((begins[-1] + lasting[-1] + 2) * rate)) / rate
    values = 500 + noise * random.standard_normal((len(t), *shape))
    for begin, end in zip(begins, begins + lasting, strict=True):
        envelope = np.clip((t - begin) / rise_s, 0, 1) * np.clip(1 - (t - end) / 0.01, 0, 1)
        place = np.zeros(shape)
        if shape[0] > 1:
            y, x = random.choice([2, 9], 2)
            place[y : y + 4, x : x + 4] = 1
        else:
            place[:] = np.exp(-((np.arange(shape[1]) - random.uniform(2, 6) * (shape[1] > 1)) ** 2) / 4)
        values += gain * 300 * random.uniform(0.7, 1.3) * envelope[:, None, None] * place
    values[:, :, :dead] = 500
    frames = taxel.Frames(np.round(values), np.rint(1e6 * t).astype(np.int64), unit="counts", array=taxel.Array(*shape))
    us = np.rint(1e6 * (begins + random.normal(0, 0.005, 25))).astype(np.int64)
    return frames, {"contact": us, "lift": us + np.rint(1e6 * lasting).astype(np.int64)}


@dataclass
class Trained:
    """The size that a readout is of, and its file."""

    shape: tuple[int, int]
    rate: float
    file: Path

    def told(self, capsys: Any, place: Path, frames: taxel.Frames, labels: Labels | None, *words: Any) -> list[str]:
        """Return what the command prints, without scores and detections."""
        taxel.convert(frames, place / "a.npz", overwrite=True)
        rows = [f"{label},{t}\n" for label, times in (labels or {}).items() for t in times]
        (place / "a.csv").write_text("label,t_us\n" + "".join(rows))
        truth = [] if labels is None else ["--truth", place / "a.csv"]
        code, out, _ = call(capsys, "detect", place / "a.npz", "--readout", self.file, "--tare", 2.0, *truth, *words)
        assert code == 0
        said = ("do not rely", "what may help", "unlike", "gap", "stuck", "outside", "missed", "false ", "nearest")
        return [
            line
            for line in out.splitlines()
            if any(part in line for part in said) and "events  found" not in line and not line.startswith("against")
        ]


@pytest.fixture(scope="module", params=SIZES)
def trained(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Trained:
    shape, rate = SIZES[request.param]
    place = tmp_path_factory.mktemp(request.param)
    frames, labels = drawn(shape, rate, 1)
    taxel.convert(frames, place / "training.npz")
    training = taxel.train(taxel.open(place / "training.npz"), [labels], TrainOptions(folds=0))
    return Trained(shape, rate, training.readout.save(place / "readout.json"))


def test_nothing_is_said_of_a_right_recording(trained: Trained, tmp_path: Path, capsys: Any) -> None:
    for seed in (1, 2):
        frames, labels = drawn(trained.shape, trained.rate, seed)
        assert trained.told(capsys, tmp_path, frames, labels) == []
        assert trained.told(capsys, tmp_path, frames, None) == []


def asked(frames: taxel.Frames, labels: Labels) -> str:
    """Return the question that a training asks of labels before it begins."""
    example = Example(frames, labels, taxel.Tare.take(frames, stop_us=2_000_000))
    recipe = Recipe.load("touch", labels=list(labels), noise_floor=measured_floor([example]))
    return Evidence([example], check_examples([example]), recipe).question()


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("size", SIZES)
def test_a_training_asks_first_about_labels_that_are_all_off_and_about_no_others(size: str, seed: int) -> None:
    for late_us in (300_000, -200_000):
        frames, labels = drawn(*SIZES[size], seed)
        text = asked(frames, {label: t + late_us for label, t in labels.items()})
        assert text.startswith("what may help is --shift-ms "), text
        assert int(text.split()[5].rstrip(":")) == pytest.approx(-late_us / 1000, abs=30)
        since = labels["contact"][12]
        assert asked(frames, {label: t + late_us * (t >= since) for label, t in labels.items()}) == ""
    for more in ({}, {"gain": 0.05}, {"gain": 0.02}, {"noise": 40.0}):
        assert asked(*drawn(*SIZES[size], seed, **more)) == ""


def test_nothing_is_asked_where_no_label_is_left() -> None:
    frames, labels = drawn(*SIZES["grid"], 1)
    fallen = taxel.Frames(510 - 4 * (frames.values - 510), frames.t, unit=frames.unit, array=frames.array)
    for values in (frames, fallen):
        assert asked(values, {label: t[:0] for label, t in labels.items()}) == ""


@pytest.mark.parametrize("seed", [1, 2])
def test_a_training_asks_first_about_labels_within_touches(seed: int) -> None:
    frames, labels = drawn(*next(iter(SIZES.values())), seed)
    labels["slip"] = (labels["contact"] + labels["lift"]) // 2
    text = asked(frames, labels)
    assert text.startswith("slip: ")
    assert "no recipe detects what happens while a touch lasts" in text


@pytest.mark.parametrize("seed", range(5))
def test_labels_within_holds_are_asked_about_where_those_of_their_edges_are_by_hand(seed: int) -> None:
    random = np.random.default_rng(seed)
    begins = 200 + np.cumsum(random.integers(320, 400, 20))
    ends = begins + random.integers(150, 250, 20)
    values = random.normal(50, 0.5, (int(ends[-1]) + 200, 1, 8))
    for begin, end in zip(begins, ends, strict=True):
        values[begin:end, 0, :4] += random.uniform(40, 60)
    t = 10_000 * np.arange(len(values))
    by_hand = {"grasp": t[begins] - 75_000, "release": t[ends] + 90_000}
    labels = {k: v + np.rint(random.normal(0, 25_000, 20)).astype(int) for k, v in by_hand.items()}
    frames = taxel.Frames(values, t, unit="counts", array=taxel.Array(1, 8))
    slips = t[begins] + random.integers(400_000, 1_100_000, 20)
    assert asked(frames, labels | {"slip": slips}).startswith("slip: 20 of 20 labels are within touches; ")
    # What is near the onset is felt there, and may be learnt as a kind of touch.
    assert asked(frames, labels | {"pinch": t[begins] + random.integers(60_000, 280_000, 20)}) == ""


def test_a_training_names_the_part_of_each_recording_whose_labels_are_off(tmp_path: Path, capsys: Any) -> None:
    folder, rows, begins = tmp_path / "days", ["recording,label,t_us\n"], []
    folder.mkdir()
    for seed in (11, 12):
        frames, labels = drawn(*SIZES["taxel"], seed)
        taxel.convert(frames, folder / f"{seed}.npz")
        since = labels["contact"][12]
        begins.append(np.floor((since + 250_000) / 1e5) / 10)
        rows += [f"{seed}.npz,{label},{t + 250_000 * (t >= since)}\n" for label, t_all in labels.items() for t in t_all]
    (tmp_path / "days.csv").write_text("".join(rows))
    words = ("train", folder, "--labels", tmp_path / "days.csv", "-o", tmp_path / "r.json")
    code, out, error = call(capsys, *words)
    assert code == 0
    assert UNLEARNT not in error
    lines = out.splitlines()
    [cause] = [line for line in lines if line.startswith("contact, lift: what may help is to move the labels of ")]
    for seed, begin_s in zip((11, 12), begins, strict=True):
        assert f"of {folder / f'{seed}.npz'} from {begin_s:.1f} s to the end 2" in cause
    assert not any("the plain rule is better" in line for line in lines), "it learnt wrong labels"
    [last] = [line for line in lines if line.startswith("written to ")]
    assert "; next: follow the advice above, then train again" in last
    assert "taxel detect" not in last


def test_a_window_is_advised_only_with_what_a_trial_of_it_left() -> None:
    times = np.arange(1, 26) * 1_000_000
    late = taxel.Detections(["contact"] * 25, times + 80_000, times + 80_000)
    scores = {ms: taxel.detect.score(late, {"contact": times, "lift": []}, ms) for ms in (50.0, 60.0, 100.0)}
    fact = "25 of 25 missed labels have a false detection 80 ms later"
    cause = by_option("window", "contact", 50, fact, "--window-ms 80", window_ms=80.0)
    for trial_ms, advice in ((None, ""), (60.0, ""), (100.0, "--window-ms 80")):
        tried = None if trial_ms is None else lambda *_, ms=trial_ms: Judged((), scores[ms], "")
        mistakes = Mistakes(None, scores[50.0], scores[50.0], tried=tried)  # type: ignore[arg-type]
        [found] = mistakes._tried_windows([cause])
        assert (found.advice, found.option) == (advice, advice)
        trial = "; tried on the same folds: 0 missed, 0 false, while this training has 25 missed, 25 false"
        assert found.measured == fact + trial * bool(advice)


def test_a_shift_in_a_wider_window_is_advised_only_with_what_a_trial_of_it_left() -> None:
    times = np.arange(1, 26) * 1_000_000
    late = taxel.Detections(["contact"] * 25, times + 80_000, times + 80_000)
    scores = {ms: taxel.detect.score(late, {"contact": times, "lift": []}, ms) for ms in (50.0, 100.0)}
    asked = {"shift_ms": -80.0, "window_ms": 110.0}
    cause = by_option("shifted_labels", "contact", 50, "25 of 25 are", "--shift-ms -80 --window-ms 110", **asked)
    for trial_ms in scores:
        tried = lambda *how, ms=trial_ms: Judged((), scores[ms], str(how))  # noqa: E731
        mistakes = Mistakes(None, scores[50.0], scores[50.0], tried=tried)  # type: ignore[arg-type]
        left = "25 of 25 are; tried on the same folds: 0 missed, 0 false, while this training has 25 missed, 25 false"
        assert [each.measured for each in mistakes._tried_shifts([cause])] == [left] * (trial_ms > 80.0)


def test_few_spikes_are_no_news_where_a_cause_explains_them() -> None:
    lines = [f"{label}: 25 of 25 events {UNLEARNT} (1 ms)" for label in ("contact", "lift")]
    cause = by_option("shifted_labels", "contact", 25, "25 of 25 are late", "--shift-ms -300")
    assert without_explained([*lines, "contact: else"], [cause]) == (lines[1], "contact: else")
    given = {"encoder.name": "contact_area", "learner.refractory": 15.0}
    told = f"{lines[0]}; settings that were given: encoder.name=contact_area, learner.refractory=15.0"
    assert with_settings([lines[0], "contact: else"], given) == (told, "contact: else")
    assert with_settings(lines, {}) == tuple(lines)


@pytest.mark.parametrize("late_ms", [242, -90])
def test_labels_of_another_clock_are_moved_by_the_option_that_is_named(
    trained: Trained, tmp_path: Path, capsys: Any, late_ms: int
) -> None:
    frames, labels = drawn(trained.shape, trained.rate, 4)
    late = {label: t + 1000 * late_ms for label, t in labels.items()}
    *verdicts, cause = trained.told(capsys, tmp_path, frames, late)
    assert [line.partition(", ")[0] for line in verdicts[:2]] == [
        f"{label}: do not rely on this score here: 0 of 25 labels found" for label in labels
    ]
    side = "before" if late_ms > 0 else "after"
    for line, label in zip(verdicts[2:], labels, strict=True):
        said = re.fullmatch(
            rf"{label}: the nearest detection comes ([\d.]+) ms {side} the label, for 25 of 25 labels", line
        )
        assert said, line
        assert float(said[1]) == pytest.approx(abs(late_ms), abs=30)
    assert "contact, lift: what may help is to move the labels by" in cause
    assert "the detections are where loads begin or end, the labels are not" in cause
    option = cause.partition("(")[2].partition(")")[0].split()
    assert float(option[1]) == pytest.approx(-late_ms, abs=30)
    assert trained.told(capsys, tmp_path, frames, late, *option) == []


def test_a_stretch_of_labels_missing_ones_and_those_of_nothing_are_named(
    trained: Trained, tmp_path: Path, capsys: Any
) -> None:
    frames, labels = drawn(trained.shape, trained.rate, 5)
    random, since = np.random.default_rng(5), labels["contact"][15]
    [line] = trained.told(capsys, tmp_path, frames, {k: t - 300_000 * (t >= since) for k, t in labels.items()})
    begin_s = np.floor((since - 300_000) / 1e5) / 10
    assert f"contact, lift: what may help is to move the labels from {begin_s:.1f} s to the end 3" in line
    fewer = {label: np.sort(random.choice(t, 20, replace=False)) for label, t in labels.items()}
    [line] = trained.told(capsys, tmp_path, frames, fewer)
    assert line.startswith("contact, lift: what may help is to label these touches too: ")
    middles = labels["contact"] + (labels["lift"] - labels["contact"]) // 2
    more = labels | {"contact": np.sort(np.append(labels["contact"], middles[::5]))}
    [line] = trained.told(capsys, tmp_path, frames, more)
    assert "5 of 5 missed labels are more than 50 ms from" in line
    assert "what may help" not in line


def test_what_differs_from_the_training_is_said_once_and_is_the_cause(
    trained: Trained, tmp_path: Path, capsys: Any
) -> None:
    frames, labels = drawn(trained.shape, trained.rate, 6, gain=0.3)
    weak = trained.told(capsys, tmp_path, frames, labels)
    assert len([line for line in weak if "touches are 0.3" in line or "touches are 0.2" in line]) >= 1
    assert not any("look at these labels" in line for line in weak)
    if trained.shape == (1, 1):
        return
    dead = 6 if trained.shape[0] > 1 else 3
    frames, labels = drawn(trained.shape, trained.rate, 7, dead=dead)
    lines = trained.told(capsys, tmp_path, frames, labels)
    assert any("that touches of the training loaded are never loaded" in line for line in lines)
    assert not any("look at these labels" in line for line in lines)


def test_a_gap_and_what_it_holds_are_named(trained: Trained, tmp_path: Path, capsys: Any) -> None:
    frames, labels = drawn(trained.shape, trained.rate, 8)
    begin = labels["contact"][8] - 200_000
    end = labels["contact"][9] + 100_000
    kept = (frames.t < begin) | (frames.t >= end)
    cut = taxel.Frames(frames.values[kept], frames.t[kept], unit="counts", array=frames.array)
    lines = trained.told(capsys, tmp_path, cut, labels)
    behind = cut.t[cut.t >= end][0]
    assert "1 gap of " in lines[0]
    assert lines[1].startswith(
        f"may have happened in a gap that ends just before them: contact at {behind / 1e6:.3f}"[:-2]
    )
    assert (
        "missed labels are where the recording has no frames, and 1 of 1 false detection is at the first frames"
        in lines[-1]
    )


def test_stuck_taxels_are_named_also_where_all_is_found(trained: Trained, tmp_path: Path, capsys: Any) -> None:
    if trained.shape[0] == 1:
        return
    frames, labels = drawn(trained.shape, trained.rate, 9)
    values = frames.values.copy()
    values[:, 3, 10] = 1023
    stuck = taxel.Frames(values, frames.t, unit="counts", array=frames.array)
    assert "1 stuck taxel, for example column 10, row 3 (taxel info lists them)" in trained.told(
        capsys, tmp_path, stuck, labels
    )


def test_a_rest_that_moves_is_named_in_the_place_of_weak_touches(trained: Trained, tmp_path: Path, capsys: Any) -> None:
    frames, labels = drawn(trained.shape, trained.rate, 10)
    drift = np.rint(np.linspace(0, 60, len(frames)))[:, None, None]
    moved = taxel.Frames(frames.values + drift, frames.t, unit="counts", array=frames.array)
    lines = trained.told(capsys, tmp_path, moved, labels)
    count = taxel.Array(*trained.shape).taxels
    taxels_have = "1 taxel has" if count == 1 else f"{count} taxels have"
    assert (
        f"unlike the training: {taxels_have} other readings at the end than at the beginning: "
        "a drift, or a load that stays" in lines
    )
    assert not any("times as strong" in line for line in lines)


def test_no_move_is_advised_where_only_a_part_of_the_labels_of_each_recording_is_off(
    trained: Trained, tmp_path: Path, capsys: Any
) -> None:
    folder, rows = tmp_path / "days", ["recording,label,t_us\n"]
    folder.mkdir()
    for seed in (11, 12):
        frames, labels = drawn(trained.shape, trained.rate, seed)
        taxel.convert(frames, folder / f"{seed}.npz")
        since = labels["contact"][12]
        for label, times in labels.items():
            rows += [f"{seed}.npz,{label},{t + 250_000 * (t >= since)}\n" for t in times]
    (tmp_path / "days.csv").write_text("".join(rows))
    _, out, _ = call(
        capsys, "detect", folder, "--readout", trained.file, "--tare", 2.0, "--truth", tmp_path / "days.csv"
    )
    assert "--shift-ms" not in out
    assert "what may help is to move the labels from" in out
    assert "this score" in out


@pytest.mark.parametrize("seed", [13, 14])
def test_touches_that_rise_slowly_are_felt_later_and_no_window_is_advised(
    trained: Trained, tmp_path: Path, capsys: Any, seed: int
) -> None:
    frames, labels = drawn(trained.shape, trained.rate, seed, rise_s=0.34)
    lines = trained.told(capsys, tmp_path, frames, labels)
    if trained.shape[0] > 1:
        # The least of the touch is felt at once.
        assert lines == []
        return
    assert any("ms later, because the load rises slowly: contact is felt later there" in line for line in lines), lines
    assert not any("what may help is" in line for line in lines)


@pytest.mark.parametrize("size", SIZES)
def test_false_detections_inside_loads_are_named(size: str) -> None:
    frames, labels = drawn(*SIZES[size], 15)
    contacts, middles = labels["contact"], (labels["contact"] + labels["lift"]) // 2
    t = np.sort(np.concatenate([contacts, middles]))
    found, truth = taxel.Detections(["contact"] * len(t), t, t), {"contact": contacts}
    example = Example(frames, truth, taxel.Tare.take(frames, stop_us=2_000_000))
    [cause] = causes_of([Outcome("a", example, found, taxel.detect.score(found, truth), None)], 50.0)
    assert (cause.kind, cause.mistakes) == ("unlabelled_loads", 25)
    where = "inside a load, more than 50 ms from its beginning and end, for example at "
    assert cause.measured.startswith(f"25 of 25 false detections are {where}{middles[0] / 1e6:.3f} s, ")


@pytest.mark.parametrize("seed", [16, 17])
def test_noise_of_a_load_that_stays_is_no_touch(trained: Trained, tmp_path: Path, capsys: Any, seed: int) -> None:
    if trained.shape == (1, 1):
        return
    frames, _ = drawn(trained.shape, trained.rate, seed)
    random, values = np.random.default_rng(seed), frames.values.copy()
    stays = frames.t >= 2_500_000
    values[stays, 0, 0] += 900
    values[stays, 0, 1] += np.rint(12 + 6 * random.standard_normal(np.count_nonzero(stays)))
    loaded = taxel.Frames(values, frames.t, unit="counts", array=frames.array)
    assert not any("have no detection" in line for line in trained.told(capsys, tmp_path, loaded, None))


@pytest.mark.parametrize("seed", [18, 19])
def test_noise_alone_is_distinguished_from_loads_where_no_half_second_is_quiet(
    trained: Trained, tmp_path: Path, capsys: Any, seed: int
) -> None:
    frames, _ = drawn(trained.shape, trained.rate, seed)
    random = np.random.default_rng(seed)
    noisy = np.rint(frames.values + random.normal(0, 25, frames.values.shape))
    shaken = frames.values + np.rint(150 * np.sin(frames.t / 7e4))[:, None, None]
    for values, is_noise in ((noisy, True), (shaken, False)):
        place = tmp_path / "a.npz"
        taxel.convert(taxel.Frames(values, frames.t, unit="counts", array=frames.array), place, overwrite=True)
        code, _, error = call(capsys, "detect", place, "--readout", trained.file)
        assert (code, "no half second is quiet with nothing on it" in error) == (2, not is_noise), error
        said = re.search(
            r"quiet: \d+ of \d+ half seconds contain only noise, but the noise has a standard deviation of (\d+)", error
        )
        assert bool(said) == is_noise, error
        assert ("times that of the training" in error) == is_noise
        assert not said or float(said[1]) == pytest.approx(25, abs=3)


@pytest.mark.parametrize("unit", ["counts", "kPa"])
def test_the_quiet_stretch_is_found_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, unit: str) -> None:
    from taxel.recording.analysis import rest

    frames, labels = drawn((16, 16), 50.0, 20)
    values = frames.values - (500 if unit == "kPa" else 0)
    taxel.convert(taxel.Frames(values, frames.t, unit=unit, array=frames.array), tmp_path / "a.npz")
    recording, found, find = taxel.open(tmp_path / "a.npz"), [], rest.find_rest
    monkeypatch.setattr(rest, "find_rest", lambda *words, **named: found.append(1) or find(*words, **named))
    rule = taxel.detect.PlainRule("area", 2, noise_floor=20.0, unit=unit)
    assert len(taxel.tasks.detect(rule, recording, [labels]).outcomes[0].found) == 50
    assert len(found) == 1
