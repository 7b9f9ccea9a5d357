"""A readout that detects a label by its neuron or by its plain rule: what runs, its file, and what is better."""

import discs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_rules import ARRAY, FLOOR, clocks, events, in_pieces, tare

import taxel
from taxel import Frames, Neuron, Readout
from taxel.detect import Example, Part, PlainRule, Recipe, judge, run, score
from taxel.detect.choice import chosen
from taxel.detect.fit import Fitter
from taxel.detections import Detections
from taxel.encode import ContactArea, LevelCrossing

NEURON = Neuron(tau=0.5, refractory=1.0, kernel="exponential", after_spike="reset", time="grid", step_ms=0.1)
RULES = {
    "on": PlainRule("count", 3, 0.5, levels=[1.0, 2.5], date=0.75, labels=("on", None), noise_floor=FLOOR),
    "off": PlainRule("area", 2, labels=(None, "off"), noise_floor=FLOOR),
    "small": PlainRule("load", 7.25, age_ms=0.5, labels=("small", "large"), noise_floor=FLOOR),
}


def readout(by=()):
    encoder = ContactArea(levels=[2, 3], noise_floor=FLOOR)
    weights = {"on": [1.0, 0, 0, 0], "off": [0, 0, 1.0, 0], "small": [0, 1.0, 0, 0], "gone": [0, 0, 0, 1.0]}
    neurons = {label: (NEURON, np.array(each), 0.1) for label, each in weights.items()}
    return Readout(encoder, neurons, array=ARRAY, rules=RULES, by_rule=by)


@settings(deadline=None)
@given(events(), st.sets(st.sampled_from(["on", "off", "small", "gone"])), clocks, st.data())
def test_pieces_give_what_the_whole_gives_and_each_label_what_its_way_gives(source, by, clock, data):
    frame_us, version = clock
    how = {"frame_us": frame_us, "wire_version": version, "tare": tare()}
    chosen = readout(sorted(by))
    whole = run(chosen, source, **how)
    alone = [run(chosen.using("neuron"), source, **how)[label] for label in sorted(set(chosen.labels) - by)]
    alone += [run(RULES[label], source, **how)[label] for label in sorted(by & set(RULES))]
    for found in alone:
        for label in found.labels:
            assert whole[label] == found[label]
    assert len(whole) == sum(map(len, alone))
    assert (np.diff(whole.known) >= 0).all()
    parts = in_pieces(chosen.stream(frame_us=frame_us, wire_version=version, tare=tare()), source, data)
    assert [row for part in parts for row in rows(part)][: len(whole)] == rows(whole)


def rows(found):
    """Return detections in their order; a slope that is unknown is None."""
    slopes = [None if np.isnan(slope) else slope for slope in found.slope.tolist()]
    return list(zip(found.label.tolist(), found.t.tolist(), found.known.tolist(), slopes, strict=True))


def pressed_channels():
    """Return examples of two channels that are pressed together, each time as hard."""
    draw, examples = np.random.default_rng(2), []
    for _ in range(4):
        values = np.zeros((600, 1, 2))
        begins = 50 + 60 * np.arange(9) + draw.integers(0, 20, 9)
        for begin in begins:
            values[begin : begin + 20] = 9.0
        frames = Frames(values, 10_000 * np.arange(600), unit="N", array=taxel.Array(1, 2))
        examples.append(Example(frames, {"on": 10_000 * begins}, taxel.Tare.take(frames, stop_us=400_000)))
    return examples


def test_each_fold_is_scored_by_what_is_better_inside_its_training_data():
    examples = pressed_channels()
    # Levels that nothing reaches: its neuron never fires.
    recipe = Recipe(LevelCrossing([5.0]), {"tau": 2.0, "ub": 0.0, "lb": 0.0, "delay_ms": 1.0})
    judged = judge(examples, recipe, 4)
    assert judged.by_rule == ("on",)
    assert (judged.neurons.found, judged.plain.together.found, judged.together.found) == (0, 36, 36)


@pytest.mark.parametrize(
    ("neuron", "rule", "earlier", "better"),
    [
        ([0, 0, 1, 0, 1, 0, 0, 1], [2, 3, 4, 2, 3, 3, 2, 4], False, "neuron"),
        ([3, 2, 3, 2], [0, 0, 1, 0], True, "rule"),
        # One recording shows what may be chance: what knows much earlier runs, else what makes fewer mistakes.
        ([1, 1, 160, 40, 1, 0, 2, 1, 0], [0, 2, 13, 42, 1, 0, 0, 1, 0], True, "neuron"),
        ([0, 2, 13, 42, 1, 0, 0, 1, 0], [1, 1, 160, 40, 1, 0, 2, 1, 0], False, "neuron"),
        ([1, 1, 160, 40, 1, 0, 2, 1, 0], [0, 2, 13, 42, 1, 0, 0, 1, 0], False, "rule"),
        ([1, 0, 2], [1, 0, 2], True, "neuron"),
        ([1, 0, 2], [1, 0, 2], False, "rule"),
        ([1], [2], False, "neuron"),
    ],
)
def test_what_is_better_beyond_chance_runs_else_what_knows_much_earlier(neuron, rule, earlier, better):
    events = 1_000_000 * np.arange(1, 201)
    ways = [
        [score(Detections(["on"] * (200 - n), events[n:], events[n:] + delay), {"on": events}) for n in wrong]
        for wrong, delay in ((neuron, 1_000), (rule, 12_000 if earlier else 1_000))
    ]
    choice = chosen(["on"], 10.0, tuple(ways), {})["on"]
    assert (choice.by_rule, choice.neuron.mistakes, choice.rule.mistakes) == (better == "rule", sum(neuron), sum(rule))


@pytest.mark.parametrize(("found", "better"), [(40, "neuron"), (60, "rule")])
def test_what_finds_nothing_is_not_better_where_noise_is_doubled(found, better):
    events = 1_000_000 * np.arange(1, 101)
    silent, other = (
        [score(Detections(["on"] * len(t), t, t), {"on": events})]
        for t in (events[:0], np.sort(np.concatenate([events[:found], events[:50] + 500_000])))
    )
    noisy = [score(Detections(["on"] * 999, t, t), {"on": events}) for t in [500_000 + 1_000_000 * np.arange(999)]]
    choice = chosen(["on"], 10.0, (silent, other), {"noise x 1.5": (silent, noisy)})["on"]
    assert ("rule" if choice.by_rule else "neuron") == better


@pytest.mark.parametrize(
    ("neuron", "rule", "better", "by_chance"),
    [
        # Missed and late of each of four recordings: (0, 3) is 1.5 mistakes.
        ([(0, 3)] * 4, [(1, 0)] * 4, "rule", False),
        ([(0, 1)] * 4, [(1, 0)] * 4, "neuron", False),
        ([(0, 2)] * 4, [(1, 0)] * 4, "rule", True),
        ([(0, 30)] * 4, [(0, 30)] * 4, "rule", True),
    ],
)
def test_a_detection_that_is_far_off_is_half_a_mistake(neuron, rule, better, by_chance):
    events = 1_000_000 * np.arange(1, 101)
    ways = [
        [
            score(Detections(["on"] * (100 - missed), t[missed:], t[missed:]), {"on": events})
            for missed, late in wrong
            for t in [events + 12_000 * (np.arange(100) >= 100 - late)]
        ]
        for wrong in (neuron, rule)
    ]
    choice = chosen(["on"], 10.0, tuple(ways), {})["on"]
    assert ("rule" if choice.by_rule else "neuron", choice.by_chance) == (better, by_chance)
    assert [each[:2] for each in (choice.neuron, choice.rule)] == [
        tuple(np.sum(wrong, axis=0)) for wrong in (neuron, rule)
    ]


@pytest.mark.filterwarnings("ignore:.*cannot be learnt")
@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("of_frames", [False, True])
def test_what_neurons_detect_in_a_part_is_what_their_readout_detects_there(of_frames, version):
    events, labels = discs.touches(3, 8)
    source, how = events, {"frame_us": discs.FRAME_US, "wire_version": version}
    if of_frames:
        t = np.cumsum(np.random.default_rng(4).integers(600, 800, events.t.max() // 800))
        held = np.array([events.intensity[(events.x == x) & (events.y == y)][
            np.searchsorted(events.t[(events.x == x) & (events.y == y)], t, side="right") - 1
        ] for y in range(8) for x in range(8)])  # fmt: skip
        source, how = Frames(held.T.reshape(-1, 8, 8), t, unit="ticks", array=discs.ARRAY), {}
    example = Example(source, labels, discs.tare())
    fitter = Fitter([example], discs.recipe(), frame_us=how.get("frame_us"))
    fitter.clocks = [(how.get("frame_us"), version)]
    trained = fitter.fit()
    middle = int(np.median(labels["contact"]))
    whole = run(trained.readout.using("neuron"), source, tare=example.tare, **how)
    for start, stop in ((-np.inf, middle), (middle, np.inf)):
        found = fitter.detected(trained, Part(0, start, stop)).by_neurons
        assert sorted(rows(found)) == sorted(rows(whole.between(start, stop)))
        assert len(found)
