"""Each situation in which a training misses much: its first advice, carried out as printed, halves missed and false."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shell import call
from tests.detect.test_levels import steps

import taxel
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
    "recipe durations": durations,
    "shifted_labels": shifted,
    "shifted_labels early": early,
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
        words = [*words, *shlex.split(option[0].replace("FILE", str(tmp_path / "rule.json")))]
    else:
        situation.carried()
    after, _, printed_after = trained(capsys, tmp_path, words)
    if "--rule" in words:
        after = wrong([line for line in printed_after.splitlines() if ", plain rule: " in line])
    assert before > 0.1
    assert 2 * after <= before
