"""Kinds of touch that differ by how long they last: told by the rule when the touch ends."""

from __future__ import annotations

import numpy as np
import pytest
from draws import seeds
from refusal import refused

from taxel import Array, Frames, Readout, Tare
from taxel.detect import Example, PlainRule, Recipe, fit, recipes, run, score, tune
from taxel.detect.floors import measured_floor

HZ = 60


def touches(seed: int, taps: int, presses: int, *, held: bool = False) -> Example:
    """Return taps and presses of the same size and force, of which the last may be held at the end."""
    rng = np.random.default_rng(seed)
    at, begun = 2 * HZ, []
    for kind in rng.permutation(["tap"] * taps + ["press"] * presses):
        last = round(rng.uniform(*((0.1, 0.2) if kind == "tap" else (1.2, 2.2))) * HZ)
        begun.append((kind, at, last))
        at += last + int(rng.integers(HZ // 2, HZ))
    values = rng.normal(20.0, 0.5, (at + HZ, 8, 8))
    for _, begin, last in begun:
        values[begin : begin + last, 2:5, 3:6] += rng.uniform(60.0, 100.0)
    if held:
        values[-HZ // 2 :, 2:5, 3:6] += 80.0
    t = (np.arange(len(values)) * (1e6 / HZ)).astype(np.int64)
    frames = Frames(np.rint(values), t, unit="counts", array=Array(8, 8))
    labels = {kind: t[[begin for of, begin, _ in begun if of == kind]] for kind in ("tap", "press")}
    return Example(frames, labels, Tare.take(frames, stop_us=1_900_000))


def on_channels(seed: int, count: int, taps: int, presses: int, hz: int = HZ, unit: str = "counts") -> Example:
    """Return taps and presses of 8 to 100 times the noise, each on one or two channels."""
    rng = np.random.default_rng(seed)
    at, begun = 2 * hz, []
    for kind in rng.permutation(["tap"] * taps + ["press"] * presses):
        last = round(rng.uniform(*((0.1, 0.2) if kind == "tap" else (1.0, 2.0))) * hz)
        begun.append((kind, at, last))
        at += last + int(rng.integers(hz // 2, hz))
    values = rng.normal(20.0 if unit == "counts" else 0.0, 1.0, (at + hz, 1, count))
    for _, begin, last in begun:
        touched = rng.permutation(count)[: rng.integers(1, 3)]
        values[begin : begin + last, 0, touched] += np.exp(rng.uniform(np.log(8.0), np.log(100.0)))
    t = (np.arange(len(values)) * (1e6 / hz)).astype(np.int64)
    frames = Frames(np.rint(values) if unit == "counts" else values, t, unit=unit, array=Array(1, count))
    labels = {kind: t[[begin for of, begin, _ in begun if of == kind]] for kind in ("tap", "press")}
    return Example(frames, labels, Tare.take(frames, stop_us=1_900_000))


@pytest.mark.parametrize(
    ("count", "hz", "unit"), [(1, 60, "kPa"), pytest.param(2, 250, "counts", marks=pytest.mark.slow), (6, 60, "N")]
)
def test_on_channels_each_counts_alone(count: int, hz: int, unit: str) -> None:
    learnt, unseen = on_channels(1, count, 20, 10, hz, unit), on_channels(2, count, 20, 10, hz, unit)
    recipe = recipes.chosen(learnt.source, ["press", "tap"])[0]
    assert recipe == "touch"
    readout = fit([learnt], Recipe.load(recipe, labels=["press", "tap"], noise_floor=measured_floor([learnt])))
    found = run(readout, unseen.source, tare=unseen.tare)
    assert score(found, unseen.labels, 50.0).rank[0] == 0
    stream = readout.stream(unseen.source.array, frame_us=1e6 / hz, tare=unseen.tare)
    live = []
    for piece in np.array_split(np.arange(len(unseen.source)), 37):
        live += list(stream.push(unseen.source[piece[0] : piece[-1] + 1]))
    live += list(stream.advance(int(unseen.source.t[-1]) + 1_000_000))
    assert [(d.label, d.t, d.known) for d in live] == [(d.label, d.t, d.known) for d in found]
    rule = tune([learnt], ["press", "tap"], noise_floor=measured_floor([learnt]))["tap"]
    assert rule is not None
    assert rule.quantity == "duration"
    assert score(run(rule, unseen.source, tare=unseen.tare), unseen.labels, 50.0).rank[0] == 0


def test_one_kind_of_touch_has_a_floor_of_its_strength_so_that_a_drift_is_no_touch() -> None:
    rng = np.random.default_rng(1)
    begins = 250 + np.cumsum(rng.integers(175, 375, 15))

    def taps(drift: float) -> Example:
        values = 4.0 + rng.normal(0.0, 0.3, begins[-1] + 250) + np.linspace(0.0, drift, begins[-1] + 250)
        for begin in begins:
            values[begin : begin + 15] += rng.uniform(60.0, 100.0) * np.sin(np.linspace(0.0, np.pi, 15))
        frames = Frames(values[:, None, None], 4000 * np.arange(len(values)), unit="V")
        return Example(frames, {"tap": 4000 * begins}, Tare.take(frames, stop_us=1_000_000))

    train, drifted = taps(0.0), taps(1.6)
    recipe = recipes.chosen(train.source, ["tap"])[0]
    readout = fit([train], Recipe.load(recipe, labels=["tap"], noise_floor=measured_floor([train])))
    found = run(readout, drifted.source, tare=drifted.tare)
    result = score(found, drifted.labels, 50.0)
    assert (result.missed, result.false) == (0, 0)


def trained(seed: int = 1) -> Readout:
    return fit([touches(seed, 8, 5)], Recipe.load("touch", labels=["press", "tap"], noise_floor=5.0))


@pytest.mark.parametrize("seed", seeds(3, quick=1))
def test_taps_and_presses_are_told_when_they_end(seed: int) -> None:
    readout, unseen = trained(seed + 1), touches(seed + 11, 12, 8)
    assert readout.by_rule == ("press", "tap")
    found = run(Readout.from_json(readout.to_json()), unseen.source, tare=unseen.tare)
    scored = score(found, unseen.labels, 50.0)
    assert scored.rank[0] == 0
    # The onset is exact, and known is behind the end.
    assert np.abs(scored.errors_ms).max() < 0.01
    lasted = found.known - found.t
    assert (lasted[found.label == "press"] > 1_150_000).all()
    assert (lasted[found.label == "tap"] < 300_000).all()


def test_what_is_still_held_at_the_end_is_not_decided() -> None:
    readout = trained()
    for held in (False, True):
        unseen = touches(30, 6, 4, held=held)
        assert len(run(readout, unseen.source, tare=unseen.tare)) == 10


def test_a_stream_detects_the_same_wherever_it_is_cut() -> None:
    readout, unseen = trained(), touches(40, 6, 4)
    whole = run(readout, unseen.source, tare=unseen.tare)
    stream = readout.stream(unseen.source.array, frame_us=1e6 / HZ, tare=unseen.tare)
    found = []
    for piece in np.array_split(np.arange(len(unseen.source)), 37):
        found += list(stream.push(unseen.source[piece[0] : piece[-1] + 1]))
    found += list(stream.advance(int(unseen.source.t[-1]) + 1_000_000))
    assert [(d.label, d.t) for d in found] == [(d.label, d.t) for d in whole]


def test_a_rule_decides_by_the_duration() -> None:
    learnt, unseen = touches(1, 8, 5), touches(2, 12, 8)
    rules = tune([learnt], ["press", "tap"], noise_floor=5.0)
    rule = rules["tap"]
    assert rule is not None
    assert rule == rules["press"]
    assert (rule.quantity, rule.age_ms) == ("duration", "end")
    assert 200.0 < rule.threshold < 1200.0
    again = PlainRule.from_json(rule.to_json())
    assert again == rule
    assert score(run(again, unseen.source, tare=unseen.tare), unseen.labels, 50.0).rank[0] == 0
    assert repr(rule).startswith("PlainRule(tap, press: one rule for both kinds, the duration (ms) ")
    with refused(argument="age_ms"):
        PlainRule("duration", 500.0, labels=("a", "b"), age_ms=5.0)
    with refused(argument="age_ms"):
        PlainRule("area", 5.0, labels=("a", "b"), age_ms="end")
