"""ConeR's divisors, sides and windows of silence, drawn at random, against 6.12 to 6.14 stated plainly."""

from __future__ import annotations

import pickle
import warnings

import numpy as np
import pytest
from draws import seeds
from making import lists, made
from refusal import refused
from test_cone_r import examples, fitted, least, shares, statement, terms

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeR, OnlineConeR


@pytest.fixture(autouse=True)
def _quiet():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def drawn(seed):
    """Patterns, targets, windows of silence and options, over a wide range."""
    random = np.random.default_rng(seed)
    trains = int(random.choice([6, 14, 30]))
    shape = {"patterns": int(random.integers(1, 4)), "targets": int(random.integers(1, 4)), "duration": 140.0}
    patterns, targets = examples(seed, trains, **shape, whole_ms=bool(random.integers(2)))
    if random.random() < 0.3:
        targets[0] = targets[0][:0]
    silence = []
    for _ in patterns:
        ends = np.sort(random.uniform(0.0, 150.0, 2 * int(random.integers(0, 4)))).reshape(-1, 2)
        silence.append(None if random.random() < 0.3 else (ends.round() if random.random() < 0.5 else ends))
    unit = float(random.choice([1.0, 1.0, 0.02, 40.0]))
    bounds = random.choice([0.2, 0.5, 2.0], 2) * unit
    options = {
        "tau": float(random.choice([8.0, 12.0, 30.0])),
        "theta_0": 0.3 * unit,
        "theta_plus": float(random.choice([0.0, 0.2])) * unit,
        "after_spike": str(random.choice(["keep", "ignore", "reset"])),
        "step_ms": float(random.choice([1.0, 1.0, 0.6])),
        "kappa": float(random.choice([1.0, 1.1, 1.5])),
        "lambdas": tuple(
            float(random.choice([0, 1, 4] if k < 2 else [1, 10, 100])) * (k >= 2 or random.random() < 0.8)
            for k in range(5)
        ),
        "lb": -bounds[0] if random.random() < 0.8 else 0.01 * unit,
        "ub": bounds[1],
        "margin": float(random.choice([0.0, 0.01])) * unit,
        "norm": str(random.choice(["norm", "square"])),
        "divide_b_by": str(random.choice(["B_max", "targets"])),
        "divide_c_by": str(random.choice(["C_max", "targets"])),
        "divide_d_by": str(random.choice(["D_max", "targets"])),
        "sides_b": str(random.choice(["both", "below"])),
        "sides_c": str(random.choice(["both", "below"])),
        "engine": str(random.choice(["native", "native", "native", "cone solver"])),
    }
    return patterns, targets, silence if random.random() < 0.7 else None, options


@pytest.mark.parametrize("seed", seeds(60, quick=8))
def test_any_combination_is_the_least_of_what_is_stated(seed):
    patterns, targets, silence, options = drawn(seed)
    cone = made(ConeR, **options).fit(patterns, targets, silence=silence)
    rows = statement(cone, patterns, targets, silence)
    assert cone.silent_rows_ == len(rows[3])
    value = shares(cone, rows) * terms(cone, rows, cone.weights_)
    ends = (np.clip(w, cone.lb, cone.ub) * np.ones(len(patterns[0])) for w in (0.0, np.inf))
    size = max(shares(cone, rows) @ terms(cone, rows, w) for w in ends)
    assert list(cone.parts_.values()) == pytest.approx(list(value), rel=1e-9, abs=1e-12 * size)
    assert cone.status_ == "solved"
    assert cone.gap_ <= 1e-6
    assert cone.objective_ == pytest.approx(least(cone, rows), rel=1e-6, abs=1e-9 * size)


def test_most_draws_need_no_cone_solver_where_the_native_engine_begins():
    engines = []
    for seed in range(20):
        patterns, targets, silence, options = drawn(seed)
        options |= {"engine": "native", "sides_b": "below", "sides_c": "below"}
        engines.append(made(ConeR, **options).fit(patterns, targets, silence=silence).engine_)
    assert engines.count("native") >= 18


def test_printed_options_and_windows_that_hold_everything_are_the_fit_without_them_bit_for_bit():
    patterns, targets = examples(5)
    plain = fitted(ConeR(neuron=Neuron(tau=12.0)), patterns, targets)
    printed = {"divide_c_by": "C_max", "divide_d_by": "D_max", "sides_b": "both", "sides_c": "both"}
    for cone in (
        fitted(made(ConeR, tau=12.0, **printed), patterns, targets),
        fitted(made(ConeR, tau=12.0), patterns, targets, silence=[[(-10.0, 500.0)], None]),
        fitted(made(ConeR, tau=12.0), patterns, targets, silence=[[(0.0, 20.0), (20.0, 500.0)], [(-1.0, 900.0)]]),
    ):
        assert cone.weights_.tobytes() == plain.weights_.tobytes()
        assert (cone.objective_, cone.gap_, cone.silent_rows_) == (plain.objective_, plain.gap_, plain.silent_rows_)


def test_above_is_free_where_only_a_shortfall_counts():
    """A strong first input lifts the potential of the second target above what C and B would hold it to."""
    trains = SpikeTrains.from_lists([[10.0, 50.0], [50.0]], stop=90.0)
    options = {"tau": 10.0, "lambdas": (0, 0, 1, 1, 0), "lb": [-1.0, 0.5], "ub": [1.0, 1.0], "theta_plus": 0.0}
    both = made(ConeR, **options).fit([trains], [[20.0, 60.0]])
    below = made(ConeR, **options, sides_b="below", sides_c="below").fit([trains], [[20.0, 60.0]])
    assert both.objective_ > 1e-3
    assert below.objective_ < 1e-12
    reached = below.neuron_.potential(below.weights_, trains, [20.0, 60.0], spikes=[20.0])
    assert reached[1] > 0.36


def test_outside_the_windows_the_neuron_may_fire_and_inside_it_may_not():
    (pattern,), targets = examples(11, trains=40, patterns=1, targets=1)
    loud = SpikeTrains.from_lists([0.8 * train for train in pattern], stop=pattern.stop)
    options = {"lambdas": (0, 1, 0, 100, 1000), "lb": -2.0, "ub": 2.0}
    times = np.arange(0.0, loud.stop)

    def highest(silence):
        cone = made(ConeR, **options).fit([pattern, loud], [targets[0], []], silence=silence)
        potential = cone.neuron_.potential(cone.weights_, loud, times)
        return cone, potential

    cone, everywhere = highest(None)
    assert everywhere.max() <= 0.3 + 1e-6
    fired = times[highest([None, []])[1] > 0.3]
    assert len(fired) > 2
    cone, here = highest([None, [(fired[0], fired[0] + 1.0)]])
    inside = (times >= fired[0]) & (times <= fired[0] + 1.0)
    assert here[inside].max() <= 0.3 + 1e-6
    everywhere = made(ConeR, **options).prepare([pattern], targets).silent_rows
    assert cone.silent_rows_ == everywhere + 2


def test_divided_by_targets_a_row_weighs_the_same_however_long_the_recording():
    (one,), (wanted,) = examples(3, trains=30, patterns=1, targets=2, duration=200.0)
    options = {"tau": 12.0, "lambdas": (0, 0, 0, 1, 1), "divide_c_by": "targets", "divide_d_by": "targets"}
    silent = SpikeTrains.from_lists([[0.0]] + [[]] * 29, stop=2000.0)
    short = made(ConeR, **options).fit([one], [wanted])
    long = made(ConeR, **options).fit([one, silent], [wanted, []])
    assert long.silent_rows_ > 5 * short.silent_rows_
    assert long.objective_ == pytest.approx(short.objective_, rel=1e-5)


def test_terms_divided_by_targets_scale_with_the_unit_of_potential():
    patterns, targets = examples(3, trains=20)
    options = {"divide_b_by": "targets", "divide_c_by": "targets", "divide_d_by": "targets", "sides_b": "below"}

    def in_units(unit, lambdas):
        scaled = {"theta_0": 0.3 * unit, "theta_plus": 0.2 * unit, "lb": -0.3 * unit, "ub": 0.3 * unit}
        cone = fitted(made(ConeR, tau=12.0, **scaled, **options, lambdas=lambdas), patterns, targets)
        return sum(lambdas) * cone.objective_

    for unit in (50.0, 0.01):
        lambdas = (1, 1, 1 / unit**2, 1 / unit, 1 / unit)
        assert in_units(unit, lambdas) == pytest.approx(in_units(1.0, (1, 1, 1, 1, 1)), rel=2e-6)


def test_one_layout_serves_all_divisors_and_sides_and_a_fit_of_other_sides_is_a_start():
    patterns, targets = examples(7)
    windows = [[(0.0, 60.0)], None]
    rows = ConeR(neuron=Neuron(tau=12.0)).prepare(patterns, targets, silence=windows)
    before = rows.fit(made(ConeR, tau=12.0))
    for options in ({"sides_c": "below"}, {"sides_b": "below", "divide_d_by": "targets"}, {"divide_c_by": "targets"}):
        cold = fitted(made(ConeR, tau=12.0, **options), patterns, targets, silence=windows)
        assert rows.fit(made(ConeR, tau=12.0, **options)).objective_ == cold.objective_
        warm = rows.fit(made(ConeR, tau=12.0, **options), start=before)
        assert warm.status_ == "solved"
        assert warm.objective_ == pytest.approx(cold.objective_, rel=2e-6)


@pytest.mark.parametrize("seed", [61, 62, 63, 64])
def test_a_window_of_patterns_fits_as_from_nothing_and_is_pickled_with_its_windows_of_silence(seed):
    random = np.random.default_rng(seed)
    options = {"tau": 12.0, "tolerance": 3e-7, "divide_c_by": "targets", "divide_d_by": "targets"}
    options |= {"sides_b": "below", "sides_c": "below" if seed % 2 else "both"}
    patterns, targets = examples(seed, 20, patterns=7, targets=2)
    silence = [None if random.random() < 0.3 else [(10.0, 10.0 + random.uniform(1, 100))] for _ in patterns]
    online = made(OnlineConeR, window=3, **options)
    for k, (pattern, wanted, asked) in enumerate(zip(patterns, targets, silence, strict=True)):
        online = pickle.loads(pickle.dumps(online)) if k == 4 else online
        online.partial_fit(pattern, wanted, silence=asked)
        first = max(k - 2, 0)
        here = slice(first, k + 1)
        cold = made(ConeR, **options).fit(patterns[here], targets[here], silence=silence[here])
        assert online.objective_ == pytest.approx(cold.objective_, rel=1e-6, abs=1e-12)
        assert online.silent_rows_ == cold.silent_rows_
    once = made(OnlineConeR, window=3, **options).fit(patterns, targets, silence=silence)
    assert once.objective_ == pytest.approx(online.objective_, rel=1e-6)


@pytest.mark.parametrize(
    ("options", "argument"),
    [
        ({"divide_c_by": "B_max"}, "divide_c_by"),
        ({"divide_d_by": "rows"}, "divide_d_by"),
        ({"sides_b": "above"}, "sides_b"),
        ({"sides_c": True}, "sides_c"),
    ],
)
def test_an_option_that_is_not_known_is_refused(options, argument):
    for kind in (ConeR, OnlineConeR):
        with refused(argument=argument):
            kind(**options)


@pytest.mark.parametrize(
    ("silence", "argument"),
    [
        ([[(20.0, 10.0)]], None),
        ([[(0.0, 5.0), (4.0, 9.0)]], None),
        ([[(0.0, float("nan"))]], None),
        ([[(0.0, float("inf"))]], None),
        ([[(0.0, 5.0)], []], "silence"),
        ([], "silence"),
        ([[0.0, 5.0]], None),
        ([[(0.0, 5.0, 6.0)]], None),
        ([[("a", "b")]], None),
        (5.0, "silence"),
    ],
)
def test_windows_that_make_no_sense_are_refused(silence, argument):
    for kind in (ConeR, OnlineConeR):
        with refused(argument=argument):
            kind().fit([lists([1.0])], [[5.0]], silence=silence)


def test_a_window_that_makes_no_sense_leaves_the_patterns_as_they_were():
    online = OnlineConeR(window=2).partial_fit(lists([1.0]), [5.0])
    with refused():
        online.partial_fit(lists([1.0]), [5.0], silence=[(9.0, 3.0)])
    with refused(argument="silence"):
        online.partial_fit(lists([1.0]), [5.0], silence=[3.0])
    assert online.patterns_ == 1
