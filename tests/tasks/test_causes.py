"""Each situation in which a training misses much: its first advice, carried out as printed, halves missed and false."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shell import call
from tests.detect.test_levels import steps

import taxel
from taxel._base.messages import collected
from taxel._base.progress import Forecast
from taxel.detect import Example, Recipe
from taxel.detect.evidence import Evidence
from taxel.detect.examples import array_of, check_examples
from taxel.detect.floors import measured_floor
from taxel.recording.contents import alone, source_from
from taxel.recording.sections import Origin

Labels = dict[str, np.ndarray]


def table(place: Path, labels: Labels, source: str = "") -> Path:
    """Write labels, of one source if it is named."""
    head, more = ("source,", f"{source},") if source else ("", "")
    rows = [f"{more}{label},{t}\n" for label, times in labels.items() for t in times]
    place.write_text(f"{head}label,t_us\n" + "".join(rows))
    return place


@dataclass
class Situation:
    """The words of a training, and what carries out an advice that is no option."""

    words: list[Any]
    carried: Callable[[], object] = field(default=lambda: None)


def saved(folder: Path, frames: taxel.Frames, labels: Labels, *words: Any) -> list[Any]:
    taxel.convert(frames, folder / "a.npz")
    return [folder / "a.npz", "--labels", table(folder / "a.csv", labels), *words]


def pressed(
    seed: int, count: int = 10, *, begin_s: float = 1.0, kinds: float = 0.0, still: bool = False
) -> tuple[taxel.Frames, Labels]:
    """Return presses on 6 x 6 taxels at 100 Hz, `still` at one place; hard ones are harder by the share `kinds`."""
    random = np.random.default_rng(seed)
    begins = np.rint(100 * (begin_s + np.cumsum(random.uniform(0.6, 1.4, count)))).astype(int)
    ends, values = begins + random.integers(12, 35, count), random.normal(50, 0.5, (int(begins[-1]) + 150, 6, 6))
    hard = np.arange(count) % 2 == 1
    for begin, end, more in zip(begins, ends, kinds * hard, strict=True):
        y, x = (2, 2) if still else random.integers(0, 5, 2)
        values[begin:end, y : y + 2, x : x + 2] += random.uniform(40, 50) * (1 + more)
    t = 10_000 * np.arange(len(values))
    labels = {"soft": t[begins[~hard]], "hard": t[begins[hard]]} if kinds else {"contact": t[begins], "lift": t[ends]}
    return taxel.Frames(values, t, unit="counts", array=taxel.Array(6, 6)), labels


def levels(folder: Path, seed: int) -> Situation:
    """Levels of newtons, readings of less than one."""
    example = steps(1.0, seed=seed)
    words = saved(folder, example.source, example.labels, "--recipe", "gait_insole")
    return Situation([*words, "--set", "encoder.levels=[5.0, 10.0, 20.0, 30.0, 40.0, 50.0]"])


def falling(folder: Path, seed: int) -> Situation:
    """Readings that fall where they are pressed."""
    frames, labels = pressed(seed, kinds=1.0)
    np.save(folder / "a.npy", 200 - frames.values)
    layout = folder / "a.layout.toml"
    layout.write_text("rate_hz = 100\n")
    words = [folder / "a.npy", "--labels", table(folder / "a.csv", labels)]
    return Situation(words, lambda: layout.write_text("rate_hz = 100\nfalls = true\n"))


def strange(folder: Path, seed: int) -> Situation:
    """Labels of another recording."""
    frames, labels = pressed(seed)
    words = saved(folder, frames, pressed(seed + 100)[1])
    return Situation(words, lambda: table(folder / "a.csv", labels))


def feet(folder: Path, seed: int) -> Situation:
    """Two feet, of which one was labelled, in a table without sources."""
    (left, labels), (right, _) = pressed(seed), pressed(seed + 100)
    labels = {"contact": labels["contact"]}
    sources = {name: source_from(each, Origin(folder, label=name)) for name, each in (("left", left), ("right", right))}
    taxel.convert(taxel.Recording(alone(sources)), folder / "both.mcap")
    words = [folder / "both.mcap", "--labels", table(folder / "a.csv", labels)]
    return Situation(words, lambda: table(folder / "a.csv", labels, "left"))


def tare(folder: Path, seed: int) -> Situation:
    """A tare of seconds that ends in the first touch."""
    frames, labels = pressed(seed, begin_s=0.0, still=True)
    end = (labels["contact"][0] + labels["lift"][0]) / 2e6
    return Situation(saved(folder, frames, labels, "--tare", f"{end:.3f}"))


def few(folder: Path, seed: int) -> Situation:
    """Four labels of each kind of press, where kinds differ little."""
    frames, kinds = pressed(seed, 40, kinds=0.3)
    first = {kind: times[:4] for kind, times in kinds.items()}
    words = saved(folder, frames.between(0, max(times[-1] for times in first.values()) + 450_000), first)

    def carried() -> None:
        taxel.convert(frames, folder / "a.npz", overwrite=True)
        table(folder / "a.csv", kinds)

    return Situation(words, carried)


def durations(folder: Path, seed: int) -> Situation:
    """Taps and presses, learnt by a recipe of levels."""
    random = np.random.default_rng(seed)
    lasting = random.permutation([8] * 8 + [80] * 6)
    begins = 150 + np.cumsum([0, *(lasting[:-1] + random.integers(40, 60, 13))])
    values = random.normal(50, 0.5, (int(begins[-1]) + 200, 3, 3))
    for begin, last in zip(begins, lasting, strict=True):
        values[begin : begin + last, :2, :2] += random.uniform(40, 60)
    frames = taxel.Frames(values, 10_000 * np.arange(len(values)), unit="counts", array=taxel.Array(3, 3))
    labels = {"tap": 10_000 * begins[lasting == 8], "press": 10_000 * begins[lasting == 80]}
    return Situation(saved(folder, frames, labels, "--recipe", "gait_channel"))


def shifted(folder: Path, seed: int, shift_ms: int = 300) -> Situation:
    """Labels of a clock that is late."""
    frames, labels = pressed(seed)
    return Situation(saved(folder, frames, {label: t + 1000 * shift_ms for label, t in labels.items()}))


def early(folder: Path, seed: int) -> Situation:
    """Labels of a clock that is early."""
    return shifted(folder, seed, -300)


def by_hand(folder: Path, seed: int) -> Situation:
    """Labels of a key that a hand pressed live, late by a quarter of a second."""
    frames, labels = pressed(seed, 25)
    late = np.random.default_rng(seed).normal(250, 50, 25)
    return Situation(saved(folder, frames, {"contact": labels["contact"] + np.rint(1000 * late).astype(int)}))


def in_pictures(folder: Path, seed: int) -> Situation:
    """Labels at 25 pictures a second, of a camera that was started a little later."""
    frames, labels = pressed(seed, 20)
    return Situation(saved(folder, frames, {label: t // 40_000 * 40_000 - 35_000 for label, t in labels.items()}))


def begun(folder: Path, seed: int) -> Situation:
    """Trials of a plate that begin with the contact."""
    random, trials = np.random.default_rng(seed), []
    for _ in range(10):
        count = int(random.integers(120, 180))
        rise = np.minimum(1.0, 0.2 + np.arange(count) / 40)[:, None, None]
        values, (y, x) = np.zeros((count + 60, 6, 6)), random.integers(0, 3, 2)
        values[:count, y : y + 4, x : x + 3] = np.rint(rise * random.uniform(300, 600, (1, 4, 3)))
        trials.append(values)

    for k, values in enumerate(trials):
        frames = taxel.Frames(values, 2000 * np.arange(len(values)), unit="counts", array=taxel.Array(6, 6))
        taxel.convert(frames, folder / f"t{k}.npz")
    (folder / "labels.csv").write_text("recording,label,t_us\n" + "".join(f"t{k},contact,0\n" for k in range(10)))
    words = [*(folder / f"t{k}.npz" for k in range(10)), "--labels", folder / "labels.csv", "--recipe", "gait_plate"]
    return Situation(words, lambda: (folder / "layout.toml").write_text("zeros_before_s = 0.6\n"))


def window(folder: Path, seed: int) -> Situation:
    """Some labels that are off by little more than the window."""
    frames, labels = pressed(seed, 20)
    off = np.zeros(20, int)
    off[np.random.default_rng(seed).choice(20, 3, replace=False)] = [-62_100, -63_900, -71_000]
    return Situation(saved(folder, frames, {"contact": labels["contact"] + off}))


def released(seed: int) -> tuple[taxel.Frames, Labels]:
    """Return grasps of all forces that are released slowly, from their labels on, so that the end is felt late."""
    random = np.random.default_rng(seed)
    begins = np.rint(100 * (1 + np.cumsum(random.uniform(1.2, 1.8, 25)))).astype(int)
    ends, values = begins + random.integers(20, 60, 25), random.normal(50, 0.5, (int(begins[-1]) + 200, 6, 6))
    for begin, end in zip(begins, ends, strict=True):
        (y, x), load = random.integers(0, 5, 2), 120 * np.exp(random.uniform(-np.log(30), 0))
        lasts = random.integers(3, 9)
        gone = np.clip((np.arange(len(values)) - end) / lasts, 0, 1)
        shape = (np.arange(len(values)) >= begin) * (1 + np.cos(np.pi * gone)) / 2
        shape *= 1 + 0.15 * np.sin(0.25 * (np.arange(len(values)) - begin))
        values[:, y : y + 2, x : x + 2] += load * shape[:, None, None]
    t = 10_000 * np.arange(len(values))
    labels = {"contact": t[begins], "release": t[ends]}
    return taxel.Frames(values, t, unit="counts", array=taxel.Array(6, 6)), labels


def slow(folder: Path, seed: int) -> Situation:
    """Exact labels of releases that are felt late."""
    return Situation(saved(folder, *released(seed)))


def recipe(folder: Path, seed: int) -> Situation:
    """Contact and lift of a mat, learnt by the recipe of insoles."""
    frames, labels = pressed(seed)
    frames = taxel.Frames(np.maximum(frames.values - 50, 0), frames.t, unit="N", array=frames.array)
    return Situation(saved(folder, frames, labels, "--recipe", "gait_insole"))


#: Each situation, and the kind of cause that is to be found first.
SITUATIONS = {
    "levels": levels,
    "falling_values": falling,
    "foreign_labels": strange,
    "unlabelled_source": feet,
    "tare": tare,
    "few_labels": few,
    "begun_loaded": begun,
    "recipe durations": durations,
    "shifted_labels": shifted,
    "shifted_labels early": early,
    "shifted_labels by hand": by_hand,
    "shifted_labels in pictures": in_pictures,
    "window": window,
    "window slow": slow,
    "recipe": recipe,
}


def trained(capsys: Any, folder: Path, words: list[Any]) -> tuple[float, str, str]:
    """Train; return missed and false in shares of the labels, the first advice, and what was printed.

    What is refused counts as all missed.
    """
    code, out, error = call(capsys, "train", *words, "-o", folder / "r.json", "--overwrite")
    found = re.search(r"what may help is (.*?): ", out + error)
    advice = "" if found is None else found[1]
    if code:
        return 1.0, advice, error
    return wrong([line for line in out.splitlines() if ", neuron: " in line]), advice, out + error


def replaced(words: list[Any], more: list[str]) -> list[Any]:
    """Return words with more options, in the place of those that they replace."""
    for option in more:
        if option.startswith("--") and option in words:
            k = words.index(option)
            words = words[:k] + words[k + 2 :]
    return [*words, *more]


def wrong(lines: list[str]) -> float:
    """Return how many are missed and false in lines of labels, in shares of the labels."""
    counts = [int(count) for line in lines for count in re.findall(r"(\d+) (?:missed|false)", line)]
    return sum(counts) / sum(int(count) for line in lines for count in re.findall(r"of (\d+) found", line))


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
@pytest.mark.parametrize("name", SITUATIONS)
def test_the_first_advice_halves_what_is_missed_and_false(name: str, seed: int, tmp_path: Path, capsys: Any) -> None:
    situation = SITUATIONS[name](tmp_path, seed)
    before, advice, printed = trained(capsys, tmp_path, situation.words)
    assert advice, printed
    words = situation.words
    if option := re.search(r"--.*(?=\)|$)", advice):
        words = replaced(words, shlex.split(option[0].replace("FILE", str(tmp_path / "rule.json"))))
    else:
        situation.carried()
    after, _, printed_after = trained(capsys, tmp_path, words)
    if "--rule" in words:
        after = wrong([line for line in printed_after.splitlines() if ", plain rule: " in line])
    assert before > 0.1
    assert 2 * after <= before


def unfelt(folder: Path) -> tuple[Path, Path]:
    """Write a recording, and labels of which none lies near anything felt."""
    frames, labels = pressed(1)
    taxel.convert(frames, folder / "a.npz")
    before = {label: 100_000 * np.arange(1, 7) + k for k, label in enumerate(labels)}
    return folder / "a.npz", table(folder / "a.csv", before)


def test_labels_near_nothing_are_refused_in_one_line_that_names_the_option(tmp_path: Path, capsys: Any) -> None:
    recording, labels = unfelt(tmp_path)
    code, out, error = call(capsys, "train", recording, "--labels", labels, "-o", tmp_path / "r.json")
    assert (code, out, error.count("\n")) == (2, "", 1)
    assert error.startswith(
        "taxel: labels: 0 of 12 labels are within 50 ms of anything that was felt; what may help is "
    )
    assert error.endswith("; to continue anyway, give --labels-as-given\n")
    assert not (tmp_path / "r.json").exists()
    with pytest.raises(taxel.ProblemError, match="to continue anyway, give labels_as_given") as refusal:
        taxel.train(taxel.open(recording), labels)
    assert refusal.value.argument == "labels_as_given"


def test_labels_near_nothing_are_learnt_as_given_where_that_is_asked(tmp_path: Path, capsys: Any) -> None:
    recording, labels = unfelt(tmp_path)
    words = ("train", recording, "--labels", labels, "--tare", "0.5", "--folds", 0, "--labels-as-given")
    code, out, _ = call(capsys, *words, "-o", tmp_path / "r.json")
    assert (code, (tmp_path / "r.json").exists()) == (0, True)
    assert out.startswith("not held out, but scored on its own training data")


@pytest.mark.parametrize("answer", [True, False])
def test_on_a_terminal_it_is_a_question(
    answer: bool, tmp_path: Path, capsys: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording, labels = unfelt(tmp_path)
    asked: list[str] = []
    monkeypatch.setattr("taxel.cli.train._on_terminal", lambda: True)
    monkeypatch.setattr("typer.confirm", lambda question, **_: asked.append(question) or answer)
    words = ("train", recording, "--labels", labels, "--tare", "0.5", "--folds", 0, "-o", tmp_path / "r.json")
    code, _, error = call(capsys, *words)
    assert asked == ["Train on these labels anyway?"]
    assert "0 of 12 labels are within 50 ms of anything that was felt" in error
    assert (code, (tmp_path / "r.json").exists()) == ((0, True) if answer else (2, False))


def test_causes_are_data_and_their_arguments_are_options_of_a_training(tmp_path: Path) -> None:
    frames, labels = pressed(1)
    taxel.convert(frames, tmp_path / "a.npz")
    late = [{label: times + 300_000 for label, times in labels.items()}]
    options = taxel.tasks.TrainOptions(labels_as_given=True)
    training = taxel.train(taxel.open(tmp_path / "a.npz"), late, options)
    cause = training.causes[0]
    assert (cause.kind, set(cause.labels), cause.option) == ("shifted_labels", {"contact", "lift"}, "--shift-ms -300")
    assert training.to_dict()["causes"][0] == json.loads(json.dumps(cause.to_dict()))
    assert training.to_dict()["options"] == ["--shift-ms -300"]
    again = taxel.train(taxel.open(tmp_path / "a.npz"), late, replace(options, **cause.arguments))
    assert (again.score.found, again.score.false, again.causes) == (20, 0, ())
    assert "labels moved by -300 ms before training (--shift-ms)" in again.lines()


def grasped(seed: int) -> tuple[taxel.Frames, Labels]:
    """Return grasps on 8 x 8 taxels at 100 Hz; what is held slips by a taxel while it is touched."""
    random = np.random.default_rng(seed)
    begins = 100 + np.cumsum(random.integers(110, 160, 15))
    slips = begins + random.integers(20, 60, 15)
    ends, values = slips + random.integers(20, 60, 15), random.normal(50, 0.5, (int(begins[-1]) + 200, 8, 8))
    for begin, slip, end in zip(begins, slips, ends, strict=True):
        y, x, load = *random.integers(0, 5, 2), random.uniform(40, 50)
        values[begin:slip, y : y + 3, x : x + 2] += load
        values[slip:end, y : y + 3, x + 1 : x + 3] += load
    t = 10_000 * np.arange(len(values))
    labels = {"onset": t[begins], "release": t[ends], "slip": t[slips]}
    return taxel.Frames(values, t, unit="counts", array=taxel.Array(8, 8)), labels


@pytest.mark.parametrize("later", [0, 300_000])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_happens_while_a_touch_lasts_is_no_label_of_another_recording(seed: int, later: int) -> None:
    frames, labels = grasped(seed)
    if later:  # each at the same time after its onset, which is no late clock
        labels["slip"] = labels["onset"] + later
    example = Example(frames, labels, taxel.Tare.take(frames.between(0, 900_000)))
    plan = Recipe.load("touch", labels=list(labels), noise_floor=measured_floor([example]))
    (cause,) = Evidence([example], check_examples([example]), plan).causes({"slip": 15})
    assert (cause.kind, cause.labels, cause.mistakes) == ("label_name", ("slip",), 15)
    assert (
        "are within touches; labels of onset, release are where touches begin or end; no recipe detects what"
        in cause.measured
    )
    # Where no label fits the touches, labels may be of another recording.
    alone = example._replace(labels={"slip": labels["slip"]})
    causes = Evidence([alone], check_examples([alone]), plan).causes({"slip": 15})
    assert [cause.kind for cause in causes] == ["shifted_labels" if later else "foreign_labels"]


@pytest.mark.parametrize("late_us", [0, 300_000, -300_000])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_labels_of_one_name_are_not_moved_where_others_fit(seed: int, late_us: int) -> None:
    frames, labels = released(seed)
    moved = {label: times + late_us for label, times in labels.items()}
    example = Example(frames, moved, taxel.Tare.take(frames.between(0, 600_000)))
    plan = Recipe.load("touch", labels=list(labels), noise_floor=measured_floor([example]))
    evidence = Evidence([example], check_examples([example]), plan)
    causes = evidence.causes({"contact": 2, "release": 20})
    assert [cause.kind for cause in causes] == (["shifted_labels"] * 2 if late_us else [])
    assert list(evidence.felt_apart) == ([] if late_us else ["release"])


def test_two_feet_are_no_two_sensors_at_different_places() -> None:
    pattern = {"left": taxel.Array(2, 2, pitch_mm=5.0), "right": taxel.Array(2, 2, pitch_mm=6.0)}
    examples = [
        Example(taxel.Frames(np.zeros((2, 2, 2)), [0, 1000], array=array), {}, None, walk, f"{walk}{foot}")
        for walk in ("a ", "b ")
        for foot, array in pattern.items()
    ]
    with collected() as warned:
        array_of(examples)
    assert warned == []
    with collected() as warned:
        array_of([examples[0], examples[1]._replace(group="c ", name="c left")])
    assert len(warned) == 1


def test_a_long_training_says_how_long_before_its_folds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(import_module("taxel.tasks.train"), "_LONG_S", 0.0)
    frames, labels = pressed(1)
    taxel.convert(frames, tmp_path / "a.npz")
    steps: list[str] = []
    taxel.train(taxel.open(tmp_path / "a.npz"), [labels], progress=lambda step, *_: steps.append(step))
    (said,) = [step for step in steps if isinstance(step, Forecast)]
    assert re.match(r"about \d+ min left: one training on all data took [\d.]+ s, and the folds .* 4 of them; ", said)
    assert steps.index(said) < steps.index("fold 1 of 5")


@pytest.mark.parametrize("us_by_unit", [1000, 10_000])
@pytest.mark.parametrize("seed", [1, 2])
def test_labels_in_another_unit_of_time_are_asked_for_their_unit(
    seed: int, us_by_unit: int, tmp_path: Path, capsys: Any
) -> None:
    """In ms, or as numbers of frames of 100 Hz: all lie near the first touch, and no shift mends that."""
    frames, labels = pressed(seed, begin_s=0.7)
    words = saved(tmp_path, frames, {label: t // us_by_unit for label, t in labels.items()})
    code, _, error = call(capsys, "train", *words, "-o", tmp_path / "r.json")
    assert code == 2
    assert "what may help is labels with times in us: the labels are in the first 0.0" in error
    assert "--shift-ms" not in error
    table(tmp_path / "right.csv", labels)
    assert call(capsys, "train", words[0], "--labels", tmp_path / "right.csv", "-o", tmp_path / "r.json")[0] == 0
    score = ("detect", words[0], "--readout", tmp_path / "r.json", "--truth")
    assert ": are their times in us?" in call(capsys, *score, tmp_path / "a.csv")[2]
    assert "in us?" not in call(capsys, *score, tmp_path / "right.csv")[2]


def test_a_label_that_the_readout_spells_otherwise_is_said(tmp_path: Path, capsys: Any) -> None:
    frames, labels = pressed(1)
    words = saved(tmp_path, frames, labels)
    assert call(capsys, "train", *words, "-o", tmp_path / "r.json")[0] == 0
    table(tmp_path / "capitals.csv", {label.capitalize(): t for label, t in labels.items()})
    score = ("detect", words[0], "--readout", tmp_path / "r.json", "--truth")
    assert "must be spelt alike" not in call(capsys, *score, tmp_path / "a.csv")[2]
    said = call(capsys, *score, tmp_path / "capitals.csv")[2]
    for label in labels:
        assert f"truth has {label.capitalize()!r}, the readout {label!r}: must be spelt alike to be scored" in said
