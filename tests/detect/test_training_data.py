"""What a detection says of a recording that differs from the training: laws on made recordings, with seeds."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import taxel
from taxel.tasks import DetectOptions, TrainOptions

SHAPE = (8, 8)
RATE = 100.0
SEEDS = (1, 2, 3)


def made(
    place: Path,
    seed: int,
    *,
    strength: float = 300.0,
    noise: float = 2.0,
    dead: NDArray[np.bool_] | None = None,
    flicker: bool = False,
    shape: tuple[int, int] = SHAPE,
    touches: int = 30,
    step: float = 1.0,
    hold: int = 1,
    loose: int = 0,
) -> tuple[Path, dict[str, NDArray[np.int64]]]:
    """Write a recording of touches that last .4 s each; return it with the labels.

    Values come in steps, each of them for so many frames; the cable of so many rows is loose for 4 s.
    """
    rng = np.random.default_rng(seed)
    begins = 300 + np.cumsum(rng.integers(90, 130, touches))
    values = 500.0 + noise * rng.standard_normal((int(begins[-1]) + 200, *shape))
    for begin in begins:
        row, column = rng.integers(0, [size - 3 for size in shape])
        force = strength * rng.uniform(0.8, 1.2) * np.ones(40)
        if flicker:
            force[4::8] = force[5::8] = 0.0
        values[begin : begin + 40, row : row + 4, column : column + 4] += force[:, None, None]
    if dead is not None:
        values[:, dead] = 500.0
    t = np.arange(len(values)) * round(1e6 / RATE)
    values = step * np.round(values / step)[np.arange(len(values)) // hold * hold]
    if loose:
        values[600:1000, :loose] = rng.uniform(0.0, 200.0, (400, loose, shape[1])).round()
    frames = taxel.Frames(values, t, unit="counts", array=taxel.Array(*shape))
    path = place / f"{seed}-{len(list(place.iterdir()))}.npz"
    taxel.convert(frames, path)
    return path, {"contact": t[begins], "lift": t[begins + 40]}


@pytest.fixture(scope="module")
def training(tmp_path_factory: pytest.TempPathFactory) -> taxel.tasks.Training:
    path, labels = made(tmp_path_factory.mktemp("training"), 0, touches=40)
    return taxel.train(taxel.open(path), [labels], TrainOptions(folds=0))


def remarks(training: taxel.tasks.Training, path: Path) -> str:
    [found] = taxel.tasks.detect(training.readout, taxel.open(path), options=DetectOptions(tare=2.0)).each
    assert found.to_dict()["remarks"] == list(found.remarks)
    return "\n".join(found.remarks)


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_is_said_of_a_recording_as_in_the_training(
    training: taxel.tasks.Training, tmp_path: Path, seed: int
) -> None:
    assert remarks(training, made(tmp_path, seed)[0]) == ""
    assert remarks(training, made(tmp_path, seed, strength=240.0, noise=2.6, touches=12)[0]) == ""


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_strength_and_taxels_that_differ_are_named(
    training: taxel.tasks.Training, tmp_path: Path, seed: int
) -> None:
    def times(what: str, **how: float) -> float:
        return float(
            re.search(f"{what} ([0-9.]+) times as strong", remarks(training, made(tmp_path, seed, **how)[0]))[1]
        )  # type: ignore[index,arg-type]

    assert times("the noise at rest is", noise=6.0) == pytest.approx(3.0, abs=0.3)
    assert times("touches are", strength=60.0) == pytest.approx(0.2, abs=0.03)
    assert times("touches are", strength=900.0) == pytest.approx(3.0, abs=0.3)
    heel = np.zeros(SHAPE, np.bool_)
    heel[:3] = True
    assert "taxels that touches of the training loaded are never loaded" in remarks(
        training, made(tmp_path, seed, dead=heel)[0]
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_values_in_steps_and_held_ones_and_a_loose_cable_are_named(
    training: taxel.tasks.Training, tmp_path: Path, seed: int
) -> None:
    ending = r"; the noise of the training is [0-9.]+ counts"
    steps = remarks(training, made(tmp_path, seed, step=25.0)[0])
    assert re.match(
        rf"unlike the training: values change in steps of 25 counts, and \d+% of frames equal the one before{ending}",
        steps,
    )
    held = remarks(training, made(tmp_path, seed, hold=20)[0])
    assert re.match(rf"unlike the training: 9\d% of frames equal the one before{ending}", held)
    said = remarks(training, made(tmp_path, seed, loose=3)[0])
    jumps = (
        r"24 taxels jump below the rest in \d+% of the time, for example at [5-9]\.\d s, by more than 5 times the noise"
    )
    assert re.match(f"unlike the training: {jumps}: a loose cable, or interference", said)


@pytest.mark.parametrize("seed", SEEDS)
def test_touches_without_a_detection_and_detections_too_close_are_counted(
    training: taxel.tasks.Training, tmp_path: Path, seed: int
) -> None:
    path, labels = made(tmp_path, seed, flicker=True)
    said = remarks(training, path)
    [found] = taxel.tasks.detect(training.readout, taxel.open(path), labels_of(labels), DetectOptions(tare=2.0)).each
    assert found.outcome.score is not None
    assert found.outcome.score.false > 30
    assert "detections of contact follow another within" in said
    # A threshold of so many taxels is out of reach of small touches.
    rule = taxel.detect.PlainRule("total", 1e5, noise_floor=10.0, unit="counts")
    data = training.readout._parts["training"]
    [missed] = taxel.tasks.detect(rule._with(training=data), taxel.open(path), options=DetectOptions(tare=2.0)).each
    assert "touches have no detection, in the training 0%" in missed.remarks[0]


def labels_of(labels: dict[str, NDArray[np.int64]]) -> list[dict[str, NDArray[np.int64]]]:
    return [labels]


def test_a_rule_says_that_it_was_tuned_on_fewer_taxels(training: taxel.tasks.Training, tmp_path: Path) -> None:
    assert training.scored.plain is not None
    rule = training.scored.plain.rules["contact"]
    assert rule is not None
    path, _ = made(tmp_path, 5, shape=(16, 8))
    [found] = taxel.tasks.detect(rule, taxel.open(path), options=DetectOptions(tare=2.0)).each
    assert "unlike the training: 16 x 8 taxels, where the training had 8 x 8" in found.remarks[0]


def test_a_readout_without_the_summary_says_nothing_and_one_with_it_comes_back(
    training: taxel.tasks.Training, tmp_path: Path
) -> None:
    path, _ = made(tmp_path, 1, noise=6.0)
    saved = training.readout.save(tmp_path / "readout.json")
    again = taxel.detect.load(saved)
    assert again.to_json() == training.readout.to_json()
    bare = training.readout._with(training=None)
    [found] = taxel.tasks.detect(bare, taxel.open(path), options=DetectOptions(tare=2.0)).each
    assert found.remarks == ()


def test_a_gap_is_named_and_a_recording_without_a_rest_stops_no_other(
    training: taxel.tasks.Training, tmp_path: Path
) -> None:
    path, _ = made(tmp_path, 1)
    [recording] = [taxel.open(path)]
    frames = taxel.recorded.recorded(recording)
    assert isinstance(frames, taxel.Frames)
    late = np.where(frames.t >= 6_000_000, frames.t + 3_500_000, frames.t)
    gap = tmp_path / "gap.npz"
    taxel.convert(taxel.Frames(frames.values, late, unit="counts", array=frames.array), gap)
    assert "1 gap of 3.5 s at 6.0 s: nothing is detected there" in remarks(training, gap)
    restless = tmp_path / "restless.npz"
    moving = 500.0 + 200.0 * np.sin(np.arange(len(frames)) * 0.05)[:, None, None] + np.zeros(frames.values.shape)
    taxel.convert(taxel.Frames(moving, frames.t, unit="counts", array=frames.array), restless)
    found = taxel.tasks.detect(training.readout, [taxel.open(restless), recording])
    assert [Path(name).name for name in found.left_out] == ["restless.npz"]
    assert [each.recording.path for each in found.each] == [path]
    unknown = "the values of its taxels at rest are not known"
    assert any("restless.npz" in warning and unknown in warning for warning in found.warnings)
    with pytest.raises(taxel.ProblemError, match=unknown):
        taxel.tasks.detect(training.readout, taxel.open(restless))


@pytest.mark.parametrize("seed", SEEDS)
def test_touches_far_weaker_than_those_of_the_training_are_none(
    training: taxel.tasks.Training, tmp_path: Path, seed: int
) -> None:
    assert "no load reaches 0.1 of the strength of the training's touches" in remarks(
        training, made(tmp_path, seed, strength=12.0)[0]
    )


@pytest.fixture(scope="module")
def of_channels(tmp_path_factory: pytest.TempPathFactory) -> taxel.tasks.Training:
    path, labels = channels(tmp_path_factory.mktemp("channels"), 0)
    return taxel.train(taxel.open(path), [labels], TrainOptions(folds=0))


def channels(place: Path, seed: int, drift: float = 0.0) -> tuple[Path, dict[str, NDArray[np.int64]]]:
    """Write touches on ten channels without places, of which one drifts by so much until the end."""
    rng = np.random.default_rng(seed)
    begins = 300 + np.cumsum(rng.integers(90, 130, 30))
    values = 500.0 + 5.0 * rng.standard_normal((int(begins[-1]) + 200, 1, 10))
    values[:, 0, 4] += drift * np.linspace(0, 1, len(values))
    for begin in begins:
        values[begin : begin + 40, 0] += rng.uniform(0, 1500, 10)
    t = np.arange(len(values)) * round(1e6 / RATE)
    frames = taxel.Frames(np.round(values), t, unit="counts", array=taxel.Array(1, 10))
    taxel.convert(frames, place / f"{seed}.npz", overwrite=True)
    return place / f"{seed}.npz", {"contact": t[begins], "lift": t[begins + 40]}


@pytest.mark.parametrize("seed", SEEDS)
def test_a_single_channel_that_drifts_is_named(of_channels: taxel.tasks.Training, tmp_path: Path, seed: int) -> None:
    assert "reads" not in remarks(of_channels, channels(tmp_path, seed)[0])
    said = remarks(of_channels, channels(tmp_path, seed, drift=80.0)[0])
    assert re.search(r"unlike the training: column 4, row 0 reads \d\d counts more at the end .* 1\d times its", said)
