"""Contact and lift by neurons trained on ten scenes, and by plain rules tuned on the same ten, on unseen scenes.

Ten trainings of ten scenes each, by the recipe `touch` as `taxel train` chooses it, and the rules that
`taxel.detect.tune` finds on the same ten; all are judged on the same unseen scenes: as `taxel emulate` plays them, some
1000 touches; with a noise of the readings of 0.3, 0.6, 1.2 and 2.4 ticks, with a tare 10 minutes old from which taxels
drift by 1 tick a minute (sd), with 3 stuck and 2 flickering taxels and a flickering pair (`taxel.simulate.worn`), and
with balls that come to rest on the array, some 50 touches each, trained and tuned there. One to one, impacts within 10
ms, presses within 50. Trainings have the seeds from 2^32 + 100 on, unseen scenes those from 700 on.

Peer: the tuned plain rule. Unit: touches. Goal: as played, in sum no fewer found and no more false than the rule, the
worst training within 2 % of it, first impacts known within 0.1 ms of it at the median, live the same as offline; with
noise, an old tare and bad taxels together at most 10 more missed and false than the rule; with balls at rest fewer.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from _rounds import stamp

from taxel import Detections, Events, Readout, Tare, detect
from taxel.demo.playing import play_live
from taxel.demo.script import TRAINING_SEED, drawn, left_to_rest, script
from taxel.detect import Example, PlainRule, Recipe, Score, score, train, tune
from taxel.simulate import Contact, play, truth, worn

LABELS = ("contact", "lift")
FRAME_US = 192.0
IMPACT_MS, PRESS_MS = 10.0, 50.0
#: Scenes of a training, and seeds of the unseen scenes.
SCENES, UNSEEN = 10, 700


class Condition(NamedTuple):
    """How scenes are played, and what becomes of the taxels after the tare."""

    draw: Callable[..., Any] = drawn
    sensor: Mapping[str, float] | None = None
    wear: Mapping[str, Any] = {}


CONDITIONS = {
    "as played": Condition(),
    **{f"noise {ticks} ticks": Condition(sensor={"noise_ticks": ticks}) for ticks in (0.3, 0.6, 1.2, 2.4)},
    "tare 10 min old": Condition(wear={"drift": 1.0, "age_min": 10.0}),
    "bad taxels": Condition(wear={"stuck": 3, "flickering": 2, "pairs": 1}),
    "objects that stay": Condition(draw=left_to_rest),
}


class Played(NamedTuple):
    """What a board sent of some scenes, and the truth."""

    events: Events
    tare: Tare
    start_us: int
    contacts: list[Contact]

    @property
    def example(self) -> Example:
        """The scenes with the true times of contact and lift."""
        ends = [[round(one.start_us) for one in self.contacts], [round(one.stop_us) for one in self.contacts]]
        return Example(self.events, dict(zip(LABELS, map(np.sort, ends), strict=True)), self.tare)

    def judged(self, found: Detections) -> Score:
        """Score what was detected in the scenes."""
        windows = {}
        for label, end in zip(LABELS, ("start_us", "stop_us"), strict=True):
            order = np.argsort([round(getattr(one, end)) for one in self.contacts], kind="stable")
            each = [PRESS_MS if one.kind == "hand" else IMPACT_MS for one in self.contacts]
            windows[label] = np.array(each)[order]
        return score(found[found.t >= self.start_us], self.example.labels, windows)

    def first_known_ms(self, found: Detections) -> list[float]:
        """Return how long after first impacts they are known."""
        firsts = {"contact": np.array([round(one.start_us) for one in self.contacts if one.kind == "first"])}
        kept = found[(found.t >= self.start_us)]["contact"]
        return score(kept, firsts, IMPACT_MS).delays_ms.tolist()


def played(condition: Condition, seed: int, scenes: int) -> Played:
    acts = script(seed, scenes, draw=condition.draw)
    events = play(acts, seed=seed % 2**32, sensor=condition.sensor).events
    start = events.markers[0][0]
    tare = Tare.take(events, stop_us=start)
    if condition.wear:
        events = worn(events, start, seed=seed % 2**32, **condition.wear)
    return Played(events, tare, start, truth(acts)[0])


def detected(detector: Readout | Mapping[str, PlainRule | None], one: Played) -> Detections:
    """Return what a readout detects, or the rule of each label."""
    if isinstance(detector, Readout):
        return detect.run(detector, one.events, frame_us=FRAME_US, tare=one.tare)
    found = Detections([], [], [])
    for label, rule in detector.items():
        if rule is not None:
            found += detect.run(rule, one.events, frame_us=FRAME_US, tare=one.tare)[label]
    return found[np.argsort(found.known, kind="stable")]


def of_condition(condition: Condition, trainings: int, unseen: int, scenes: int) -> Iterator[dict[str, Any]]:
    """Yield, of each training, the counts of neuron and rule on the unseen scenes."""
    made = []
    for k in range(trainings):
        example = played(condition, TRAINING_SEED + 100 + k, scenes).example
        with warnings.catch_warnings(action="ignore", category=UserWarning):
            readout = train([example], Recipe.load("touch", labels=LABELS))
        rules = tune([example])
        made.append((readout, {"neuron": readout, "rule": rules}))
    counts: list[dict[str, dict[str, Any]]] = [
        {way: {"found": 0, "missed": 0, "false": 0, "known_ms": []} for way in ("neuron", "rule")} for _ in made
    ]
    for n in range(unseen):
        one = played(condition, UNSEEN + n, scenes)
        for (_, ways), of in zip(made, counts, strict=True):
            for way, detector in ways.items():
                found = detected(detector, one)
                judged = one.judged(found)
                for name in ("found", "missed", "false"):
                    of[way][name] += getattr(judged, name)
                of[way]["known_ms"] += one.first_known_ms(found)
    for (readout, ways), of in zip(made, counts, strict=True):
        for way in of.values():
            way["known_ms"] = float(np.median(way["known_ms"])) if way["known_ms"] else None
        yield {"readout": readout, "rules": {label: repr(rule) for label, rule in ways["rule"].items()}, **of}


def wrong(counts: Mapping[str, Any]) -> int:
    return int(counts["missed"] + counts["false"])


def summed(trainings: list[dict[str, Any]], way: str) -> dict[str, Any]:
    known = [one[way]["known_ms"] for one in trainings if one[way]["known_ms"] is not None]
    sums = {name: sum(one[way][name] for one in trainings) for name in ("found", "missed", "false")}
    return {
        **sums,
        "wrong": wrong(sums),
        "worst training, wrong": max(wrong(one[way]) for one in trainings),
        "first impacts known, ms": float(np.median(known)) if known else None,
    }


class Blank:
    """A screen that stays blank."""

    def draw(self, *_: object) -> None:
        """Draw nothing."""


def lives(readout: Readout, scenes: int) -> bool:
    """Whether a readout detects live what it detects in the recording."""
    with tempfile.TemporaryDirectory() as place:
        return play_live(readout, Path(place), seed=3, scenes=scenes, screen=lambda *_: Blank()).agrees


def goals(results: Mapping[str, Any], live: bool | None) -> dict[str, bool | None]:
    """Return which goals are reached; None where that was not measured."""
    given, trained, hard = results["as played"], ("neuron", "rule"), ("noise", "tare", "bad")
    neuron, rule = (given[way] for way in trained)
    touches = (neuron["found"] + neuron["missed"]) / len(given["trainings"])
    worst = max(wrong(one["neuron"]) - wrong(one["rule"]) for one in given["trainings"])
    sums = [sum(one[way]["wrong"] for name, one in results.items() if name.startswith(hard)) for way in trained]
    stay = results["objects that stay"]
    return {
        "as played: no fewer found": neuron["found"] >= rule["found"],
        "as played: no more false": neuron["false"] <= rule["false"],
        "as played: the worst training within 2 %": worst <= 0.02 * touches,
        "as played: first impacts known within 0.1 ms": bool(
            neuron["first impacts known, ms"] <= rule["first impacts known, ms"] + 0.1
        ),
        "live the same as offline": live,
        "noise, old tare, bad taxels: at most 10 more wrong a training": bool(
            sums[0] <= sums[1] + 10 * len(given["trainings"])
        ),
        "objects that stay: fewer wrong": stay["neuron"]["wrong"] < stay["rule"]["wrong"],
    }


def of_all(trainings: int, unseen: Mapping[str, int], scenes: int) -> tuple[dict[str, Any], Readout]:
    results, first = {}, None
    for name, condition in CONDITIONS.items():
        each = list(of_condition(condition, trainings, unseen.get(name, unseen[""]), scenes))
        readouts = [one.pop("readout") for one in each]
        first = readouts[0] if first is None else first
        results[name] = {way: summed(each, way) for way in ("neuron", "rule")} | {"trainings": each}
    assert first is not None
    return results, first


def run(*, quick: bool) -> dict[str, Any]:
    results, readout = of_all(1, {"": 1}, 2) if quick else of_all(10, {"": 2, "as played": 45}, SCENES)
    live = lives(readout, 1 if quick else 6)
    ratios = {
        f"{name}: missed and false, {way}": float(one[way]["wrong"])
        for name, one in results.items()
        for way in ("neuron", "rule")
    }
    return {
        "question": (__doc__ or "").splitlines()[0],
        **stamp(),
        "scenes of a training": 2 if quick else SCENES,
        "results": results,
        "live the same as offline": live,
        "reached": goals(results, live),
        "ratios": ratios,
    }
