"""Kinds of touch that differ by how long they last: told by the rule when the touch ends."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from draws import seeds
from refusal import refused

from taxel import Array, Frames, Readout, Tare
from taxel.detect import Example, PlainRule, Recipe, fit, run, score, tune

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


@cache
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
    assert 200.0 < rule.level < 1200.0
    again = PlainRule.from_json(rule.to_json())
    assert again == rule
    assert score(run(again, unseen.source, tare=unseen.tare), unseen.labels, 50.0).rank[0] == 0
    assert repr(rule).startswith("PlainRule(tap, press: one rule for both kinds, the duration (ms) ")
    with refused(argument="age_ms"):
        PlainRule("duration", 500.0, labels=("a", "b"), age_ms=5.0)
    with refused(argument="age_ms"):
        PlainRule("area", 5.0, labels=("a", "b"), age_ms="end")
