"""A rest that follows: which trainings state one, and what a readout detects on a sensor that drifts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from refusal import refused
from shell import call
from touching import pressed

import taxel
from taxel import Frames, Tare
from taxel.detect import Example, PlainRule, Recipe, fit, load, run, score
from taxel.detect.readout import run_watched
from taxel.tasks import DetectOptions, TrainOptions, detect

#: Time constant of a rest that follows, s.
NEAR_S = 1.0


def drifting(seed: int, a_minute: float, count: int = 25) -> tuple[Frames, dict[str, np.ndarray]]:
    """Return presses on a sensor whose taxels drift by so many counts a minute."""
    frames, labels = pressed(seed, count)
    drift = a_minute * frames.t / 60e6
    return Frames(frames.values + drift[:, None, None], frames.t, unit=frames.unit, array=frames.array), labels


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drift")
    frames, labels = drifting(1, 0.0)
    taxel.convert(frames, folder / "a.npz")
    training = taxel.train(taxel.open(folder / "a.npz"), [labels], TrainOptions(folds=0))
    assert set(training.readout._parts["training"]) >= {"noise_floor", "error_ms", "period_us"}
    return Path(training.readout.save(folder / "r.json"))


def test_a_training_states_a_rest_that_follows_where_the_unit_has_no_true_zero() -> None:
    frames, labels = pressed(1, 12)
    tare = Tare.take(frames, stop_us=900_000)
    recipe = Recipe.load("touch", labels=tuple(labels))

    def rest(unit: str, absorb_s: float | None = None) -> dict[str, float] | None:
        source = Frames(frames.values, frames.t, unit=unit, array=frames.array)
        fitted = fit([Example(source, labels, tare)], recipe)
        again = fitted.absorbing(absorb_s)
        return json.loads(again.to_json()).get("rest")

    assert [rest(unit)["absorb_s"] for unit in ("counts", "N", "kPa", "events/5 ms")] == [60.0, 0.0, 0.0, 0.0]
    assert rest("ticks") is None
    assert rest("N", 30.0) == {"noise_floor": rest("N")["noise_floor"], "absorb_s": 30.0}


@pytest.mark.parametrize(("a_minute", "what"), [(-40.0, "rule"), (40.0, "rule"), (40.0, "neuron")])
def test_presses_are_found_on_a_sensor_that_drifts_and_missed_where_its_rest_stays(
    trained: Path, a_minute: float, what: str
) -> None:
    readout = load(trained).using("neuron")
    assert readout._parts["rest"]["absorb_s"] == 60.0
    if what == "rule":
        readout = PlainRule("load", 20.0, 0.5, noise_floor=3.5).absorbing(60.0)
    frames, labels = drifting(2, a_minute)
    tare = Tare.take(frames, stop_us=500_000)
    follows, stays = (score(run(each, frames, tare=tare), labels) for each in (readout, readout.absorbing(0.0)))
    assert (follows.missed, follows.false) == (0, 0)
    assert a_minute < 0 or stays.missed > 10
    # Both know that the sensor left its floor. The rest lags by its time constant, and the tare is that of .25 s.
    floor = readout._parts["rest"]["noise_floor"]
    expected_s = 0.25 + 60.0 * floor / abs(a_minute)
    for each in (readout, readout.absorbing(0.0)):
        _, left = run_watched(each, frames, tare=tare)
        assert left is not None
        assert expected_s < left[0] / 1e6 < expected_s + 2 * NEAR_S
        assert left[1] == frames.array.taxels


def test_a_stream_in_pieces_follows_as_the_whole_does(trained: Path) -> None:
    readout, (frames, _) = load(trained), drifting(3, 60.0)
    tare = Tare.take(frames, stop_us=900_000)
    stream = readout.stream(frames.array, frame_us=10_000, tare=tare)
    found = taxel.Detections([], [], [])
    for begin, end in zip([0, 7, 400, 1000], [7, 400, 1000, len(frames)], strict=True):
        found += stream.push(Frames(frames.values[begin:end], frames.t[begin:end], unit="counts", array=frames.array))
    found += stream.advance(int(frames.t[-1]) + 2_000_000)
    whole = run(readout, frames, tare=tare)
    assert _columns(found) == _columns(whole)


def _columns(found: taxel.Detections) -> tuple[list[object], ...]:
    return tuple(np.asarray(each).tolist() for each in (found.label, found.t, found.known))


def test_detect_says_when_the_rest_has_left_the_floor_and_what_it_does(trained: Path, tmp_path: Path, capsys) -> None:
    frames, _ = drifting(4, -30.0)
    taxel.convert(frames, tmp_path / "b.npz")
    still, _ = drifting(4, 0.0)
    taxel.convert(still, tmp_path / "still.npz")
    at_rest = DetectOptions(tare=0.5)
    assert detect(load(trained), taxel.open(tmp_path / "still.npz"), options=at_rest).warnings == ()
    [line] = detect(load(trained), taxel.open(tmp_path / "b.npz"), options=at_rest).warnings
    assert "36 taxels" in line
    assert line.endswith("their rest follows them")
    [line] = detect(
        load(trained), taxel.open(tmp_path / "b.npz"), options=DetectOptions(tare=0.5, absorb_s=0.0)
    ).warnings
    assert "their rest stays" in line
    code, _, error = call(
        capsys, "detect", tmp_path / "b.npz", "--readout", trained, "--tare", "0.5", "--absorb-s", "0"
    )
    assert (code, line in error.replace("taxel: ", "")) == (0, True)


def test_a_time_that_is_none_is_refused() -> None:
    for options in (DetectOptions, TrainOptions):
        for absorb_s in (-1.0, 0.5, 2000.0):
            with refused(argument="absorb_s"):
                options(absorb_s=absorb_s)
    rule = PlainRule("load", 9.0, noise_floor=2.0)
    assert rule.absorbing(60.0)._parts["rest"] == {"noise_floor": 2.0, "absorb_s": 60.0}
    with refused(argument="absorb_s"):
        rule.absorbing(5000.0)
