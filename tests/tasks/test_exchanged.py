"""Labels of two sources of a recording that are exchanged are named so, whichever sources were read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel.recording.contents import alone, source_from
from taxel.recording.sections import Origin
from taxel.tasks import detect

RULE = taxel.detect.PlainRule("area", 2, noise_floor=20.0)


def walk(folder: Path, seed: int, *names: str) -> tuple[list[taxel.Recording], dict[str, np.ndarray]]:
    """Return a recording of two sources, which are pressed in turn, and when each begins to be, frames."""
    random = np.random.default_rng(seed)
    begins = 120 + np.cumsum(random.integers(40, 70, 40))
    of_source = {name: begins[k::2] for k, name in enumerate(names)}
    sources = {}
    for name, of_one in of_source.items():
        values = np.full((begins[-1] + 100, 4, 4), 50.0)
        for begin in of_one:
            values[begin : begin + 30, 1:3, 1:3] += 200
        frames = taxel.Frames(values, 10_000 * np.arange(len(values)), unit="counts", array=taxel.Array(4, 4))
        sources[name] = source_from(frames, Origin(folder, label=name))
    taxel.convert(taxel.Recording(alone(sources)), folder / "both.mcap", overwrite=True)
    return taxel.open_all(folder / "both.mcap"), {name: 10_000 * t for name, t in of_source.items()}


def table(place: Path, of_sources: dict[str, np.ndarray]) -> Path:
    late = zip(RULE.labels, (0, 300_000), strict=True)
    rows = [f"{name},{label},{t + by}\n" for label, by in late for name, times in of_sources.items() for t in times]
    place.write_text("source,label,t_us\n" + "".join(rows))
    return place


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("names", [("left", "right"), ("thumb", "finger")])
def test_exchanged_labels_of_two_sources_are_named_first(tmp_path: Path, names: tuple[str, str], seed: int) -> None:
    recordings, begins = walk(tmp_path, seed, *names)
    right = detect(RULE, recordings, table(tmp_path / "right.csv", begins))
    assert right.score is not None
    assert (right.score.found, right.each[0].outcome.causes) == (80, ())
    swapped = dict(zip(names, [*begins.values()][::-1], strict=True))
    found = detect(RULE, recordings, table(tmp_path / "swapped.csv", swapped))
    both = " and ".join(sorted(names))
    said = (
        f"{both} are exchanged, in the labels or in the recording: with the labels exchanged, 80 of 80 events are found"
    )
    for each in found.each:
        assert [str(cause) for cause in each.outcome.causes] == [said]
    assert all("do not rely on this score" in text for text in found.unreliable)
    assert found.unreliable


@pytest.mark.parametrize("seed", [3, 4])
def test_labels_of_the_side_that_was_not_read_are_compared_too(tmp_path: Path, seed: int) -> None:
    recordings, begins = walk(tmp_path, seed, "left", "right")
    swapped = table(tmp_path / "swapped.csv", {"left": begins["right"], "right": begins["left"]})
    (each,) = detect(RULE, recordings[0].sources["left"], swapped).each
    [cause] = each.outcome.causes
    assert str(cause) == (
        "left and right are exchanged, in the labels or in the recording: with the labels exchanged, 40 of 40 events "
        "are found"
    )


@pytest.mark.parametrize("seed", [5, 6])
def test_late_labels_are_not_called_exchanged(tmp_path: Path, seed: int) -> None:
    recordings, begins = walk(tmp_path, seed, "left", "right")
    late = table(tmp_path / "late.csv", {name: times + 200_000 for name, times in begins.items()})
    kinds = [cause.kind for each in detect(RULE, recordings, late).each for cause in each.outcome.causes]
    assert kinds
    assert "exchanged_sources" not in kinds


def one(folder: Path, seed: int, swap: bool, kinds: tuple[str, ...] = RULE.labels) -> list[str]:
    """Return the causes of a recording of which contacts are called releases if they are swapped."""
    recordings, begins = walk(folder, seed, "left", "right")
    names = reversed(RULE.labels) if swap else RULE.labels
    late = {name: begins["left"] + by for name, by in zip(names, (0, 300_000), strict=True)}
    labels = {name: times for name, times in late.items() if name in kinds}
    [each] = detect(RULE, recordings[0].sources["left"], [labels]).each
    return [f"{cause.kind}: {cause}" for cause in each.outcome.causes]


@pytest.mark.parametrize("seed", [7, 8])
def test_exchanged_names_of_labels_are_named_in_the_place_of_all_else(tmp_path: Path, seed: int) -> None:
    assert one(tmp_path, seed, swap=False) == []
    first, second = sorted(RULE.labels)
    assert one(tmp_path, seed, swap=True) == [
        f"exchanged_names: the names {first} and {second} are exchanged, in these labels or in those of the training: "
        "with the names exchanged, 40 of 40 labels are found"
    ]
    # Labels of one name alone show no exchange.
    assert not any("exchanged" in cause for cause in one(tmp_path, seed, swap=True, kinds=RULE.labels[:1]))


@pytest.mark.parametrize("seed", [9, 10])
def test_the_verdict_names_the_recording_in_which_all_mistakes_are(tmp_path: Path, seed: int) -> None:
    sources, labels = [], []
    for k in range(3):
        folder = tmp_path / str(k)
        folder.mkdir()
        recordings, begins = walk(folder, seed + k, "left", "right")
        sources.append(recordings[0].sources["left"])
        names = RULE.labels[::-1] if k == 0 else RULE.labels
        labels.append({name: begins["left"] + by for name, by in zip(names, (0, 300_000), strict=True)})
    found = detect(RULE, sources, labels)
    assert len(found.unreliable) == 2
    assert all("do not rely on this score in " in text and "0 of 20 labels" in text for text in found.unreliable)
    # Where most recordings are bad, the verdict is of all.
    labels[1] = dict(zip(labels[1], list(labels[1].values())[::-1], strict=True))
    assert all("do not rely on this score here" in text for text in detect(RULE, sources, labels).unreliable)
