"""CONE-R against 6.12 to 6.14 stated plainly, every row written out, and handed whole to a cone solver."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from draws import seeds
from interrupts import ctrl_c_after
from making import lists, made
from refusal import refused
from relaxed import drawn, examples, fitted, least, shares, sizes, statement, terms

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeR, OnlineConeR

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

#: So many problems are drawn in a part.
DRAWS = 40


@pytest.mark.parametrize("part", seeds(12, quick=1))
def test_whatever_the_options_a_fit_is_the_least_of_what_is_stated(part):
    for seed in range(DRAWS * part, DRAWS * (part + 1)):
        cone, patterns, targets, silence = drawn(seed)
        rows = statement(cone, patterns, targets, silence)
        factors = shares(cone, sizes(cone, patterns, targets, silence, rows))
        ends = (np.clip(w, cone.lb, cone.ub) * np.ones(len(patterns[0])) for w in (0.0, np.inf))
        size = max(factors @ terms(cone, rows, w) for w in ends)
        value = factors * terms(cone, rows, cone.weights_)
        assert cone.silent_rows_ == len(rows[3]), seed
        assert list(cone.parts_.values()) == pytest.approx(list(value), rel=1e-9, abs=1e-12 * size), seed
        assert cone.objective_ == pytest.approx(value.sum(), rel=1e-12), seed
        assert cone.status_ == "solved", seed
        assert cone.gap_ <= cone.tolerance, seed
        assert cone.objective_ == pytest.approx(least(cone, rows, factors), rel=cone.tolerance, abs=1e-9 * size), seed
        assert np.all(cone.weights_ >= cone.lb), seed
        assert np.all(cone.weights_ <= cone.ub), seed


def test_a_fit_to_the_same_rows_hands_on_its_multipliers():
    patterns, targets = examples(6, trains=40, patterns=4, targets=3, duration=300.0)
    rows = ConeR(neuron=Neuron(tau=12.0)).prepare(patterns, targets)
    cold, warm = ConeR(neuron=Neuron(tau=12.0), kappa=1.25), ConeR(neuron=Neuron(tau=12.0), kappa=1.25)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        rows.fit(cold)
        rows.fit(warm, start=rows.fit(ConeR(neuron=Neuron(tau=12.0))))
    assert warm.objective_ == pytest.approx(cold.objective_, rel=1e-6)
    again = rows.fit(ConeR(neuron=Neuron(tau=12.0), kappa=1.25), start=cold)
    assert again.rounds_ < cold.rounds_
    elsewhere = fitted(
        ConeR(neuron=Neuron(tau=12.0), kappa=1.25), patterns[:3], targets[:3], start=cold
    )  # other rows: weights alone
    assert elsewhere.status_ == "solved"
    with refused():
        rows.fit(warm, start=ConeR())


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_what_is_flat_without_l1_and_l2_is_solved_where_bounds_leave_no_weights_of_0():
    """Without l1 and l2 much is flat, and bounds above 0 leave no weights of 0 to fall back on."""
    patterns, targets = examples(24, trains=29, patterns=6)
    options = {"tau": 40.0, "kernel": "double_exponential", "step_ms": 2.5, "after_spike": "reset"}
    options |= {"lambdas": (0, 0, 1, 100, 80), "lb": 0.015, "ub": 0.6}
    cone = made(ConeR, **options).fit(patterns, targets)
    rows = statement(cone, patterns, targets)
    assert cone.status_ == "solved"
    assert cone.objective_ == pytest.approx(least(cone, rows, shares(cone, rows)), rel=1e-6)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("width", [30.0, 300.0, 3000.0])
@pytest.mark.parametrize(
    "options",
    [
        {"tau": 3.0, "kappa": 1.0, "lambdas": (0.1, 1, 100, 1, 80)},
        {"tau": 3.0, "kernel": "double_exponential", "lambdas": (0.1, 1, 100, 1, 80)},
        {"norm": "square", "lambdas": (1, 1, 0, 100, 80)},
        {"after_spike": "reset", "lambdas": (0, 1, 100, 100, 80)},
        {"tau": 40.0, "lambdas": (0.01, 0, 100, 100, 80)},
    ],
)
def test_bounds_far_too_wide_do_not_hinder_a_fit(width, options):
    for seed, shape in enumerate([(14, 2, 2), (36, 6, 2), (8, 4, 3)]):
        patterns, targets = examples(seed, *shape)
        cone = made(ConeR, **{"tau": 12.0} | options, lb=-width, ub=width).fit(patterns, targets)
        assert cone.status_ == "solved"


@pytest.mark.parametrize("options", [{}, {"after_spike": "reset", "margin": 0.05, "norm": "square"}, {"lb": 0.01}])
def test_a_problem_in_another_unit_of_potential_has_the_same_answer_in_that_unit(options):
    patterns, targets = examples(3, trains=20)
    parameters = {"tau": 12.0, "lb": -1.0, "ub": 1.0, **options}
    cone = fitted(made(ConeR, **parameters), patterns, targets)

    def in_units(times, **more):
        of = cone.get_params()
        names = ("neuron__theta_0", "neuron__theta_plus", "lb", "ub", "margin")
        potentials = {name.removeprefix("neuron__"): times * of[name] for name in names}
        return fitted(made(ConeR, **parameters | potentials | more), patterns, targets)

    for times in (2.0**12, 2.0**-9):  # no bit is lost on the way
        other = in_units(times)
        assert list(other.weights_) == list(times * cone.weights_)
        assert (other.objective_, other.gap_) == (cone.objective_, cone.gap_)
        assert in_units(times, max_seconds=60.0).refires_ == cone.refires_
    for times in (50.0, 0.01):
        assert in_units(times).objective_ == pytest.approx(cone.objective_, rel=2e-6)
    # B over the number of targets is a square of potentials, and no ratio.
    printed = fitted(made(ConeR, **parameters, divide_b_by="targets", lambdas=(1, 1, 1, 1, 1)), patterns, targets)
    other = in_units(50.0, divide_b_by="targets", lambdas=(1, 1, 1 / 50**2, 1, 1))
    assert sum(other.lambdas) * other.objective_ == pytest.approx(5 * printed.objective_, rel=2e-6)


def test_the_same_fit_again_gives_the_same_bits():
    patterns, targets = examples(8)
    first, again = (fitted(ConeR(neuron=Neuron(tau=12.0)), patterns, targets).weights_ for _ in range(2))
    assert first.tobytes() == again.tobytes()


def test_a_target_out_of_reach_is_named_and_the_rest_is_fitted():
    trains = SpikeTrains.from_lists([[20.0], [25.0], [80.0], [85.0]], stop=120.0)
    cone = ConeR(lambdas=(0, 1e-3, 0, 100, 1), lb=-1.0, ub=1.0)
    with pytest.warns(UserWarning, match="to the threshold at pattern 0 target 0; the other targets were fitted"):
        cone.fit([trains], [[10.0, 90.0]])
    assert cone.unreachable_ == [(0, 0)]
    assert cone.neuron_.potential(cone.weights_, trains, [90.0]) == pytest.approx(
        0.3 + 0.2 * np.exp(-77 / 30), abs=1e-6
    )


def test_a_neuron_that_refires_on_its_training_data_warns_once_and_names_the_option():
    trains = SpikeTrains.from_lists([[20.0 + n] for n in range(20)], stop=150.0)
    options = {"tau": 30.0, "theta_plus": 0.0, "lambdas": (0, 1, 0, 1000, 0)}
    with pytest.warns(UserWarning, match='after_spike "reset", a refractory above 3 ms') as said:
        cone = made(ConeR, **options).fit([trains], [[45.0]])
    assert len(said) == 1
    assert cone.refires_ == len(cone.neuron_.run(cone.weights_, trains)) - 1 > 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made(ConeR, **options, after_spike="reset").fit([trains], [[45.0]])


def test_progress_is_told_round_by_round_and_may_stop_the_fit_by_raising():
    patterns, targets = examples(12, trains=40, patterns=4, targets=3, duration=300.0)
    told = []
    cone = fitted(ConeR(neuron=Neuron(tau=12.0)), patterns, targets, progress=lambda *round: told.append(round))
    assert [r[0] for r in told] == list(range(1, cone.rounds_ + 1))
    assert told[-1] == (cone.rounds_, cone.rows_, cone.objective_, cone.gap_)
    with pytest.raises(ZeroDivisionError):
        fitted(ConeR(neuron=Neuron(tau=12.0)), patterns, targets, progress=lambda *_: 1 / 0)


LONG = {"tau": 40.0, "tolerance": 1e-9, "lambdas": (4, 0, 100, 100, 80)}


@pytest.fixture(scope="module")
def long_rows():
    """Rows on which a fit takes seconds."""
    return made(ConeR, **LONG).prepare(*examples(13, trains=300, patterns=60, targets=5, duration=2000.0))


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_control_c_stops_a_fit_promptly_and_keeps_the_best_so_far(long_rows):
    cone = None
    with ctrl_c_after(0.5, answered_within=10):
        for k in range(10_000):
            cone = made(ConeR, **LONG, kappa=1.2 + k / 1000)
            long_rows.fit(cone)
    assert cone.status_ == "stopped"
    assert cone.gap_ > cone.tolerance
    assert cone.objective_ == pytest.approx(sum(cone.parts_.values()))


def test_max_seconds_ends_a_fit_with_the_best_so_far_and_a_warning(long_rows):
    cone = made(ConeR, **LONG, max_seconds=0.2)
    with pytest.warns(UserWarning, match="only proven to be within"):
        long_rows.fit(cone)
    assert cone.status_ == "stopped"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ever = long_rows.fit(made(ConeR, **LONG | {"tolerance": 3e-2}))
    assert cone.objective_ * (1 - cone.gap_) <= ever.objective_


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


def test_divided_by_targets_a_row_weighs_the_same_however_long_the_recording():
    (one,), (wanted,) = examples(3, trains=30, patterns=1, targets=2, duration=200.0)
    options = {"tau": 12.0, "lambdas": (0, 0, 0, 1, 1), "divide_c_by": "targets", "divide_d_by": "targets"}
    silent = SpikeTrains.from_lists([[0.0]] + [[]] * 29, stop=2000.0)
    short = made(ConeR, **options).fit([one], [wanted])
    long = made(ConeR, **options).fit([one, silent], [wanted, []])
    assert long.silent_rows_ > 5 * short.silent_rows_
    assert long.objective_ == pytest.approx(short.objective_, rel=1e-5)


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


def test_what_does_not_fit_together_is_one_clear_error():
    for options, argument in (
        ({"lb": 0.31, "ub": 0.3}, None),
        ({"lb": [-1.0, 0.6], "ub": 0.5}, None),
        ({"lb": [-1.0], "ub": [1.0, 1.0]}, "lb"),
        ({"lambdas": (1, 2, 3, 4)}, "lambdas"),
        ({"lambdas": (0, 0, 0, 0, 0)}, "lambdas"),
    ):
        with refused(argument=argument):
            made(ConeR, **options)
    one = [lists([1.0])]
    for patterns, targets, argument in (
        ([], [], "patterns"),
        (one, [], "targets"),
        ([lists([], [])], [[5.0]], None),
        ([*one, lists([1.0], [2.0])], [[5.0], [5.0]], None),
        (one, [[30.0, 31.5]], None),
        (one, [[130.0]], None),
        ([SpikeTrains.from_lists([[1.0]], stop=9.0, values=[[-1.0]])], [[5.0]], None),
    ):
        with refused(argument=argument):
            ConeR().fit(patterns, targets)
    with refused(argument="weights"):
        ConeR().fit(one, [[5.0]], start=[1.0, 2.0])
    with refused():
        ConeR(ub=[1.0, 1.0]).fit(one, [[5.0]])
    with refused():
        ConeR(horizon=50.0).fit(one, [[60.0]])


@pytest.mark.parametrize(
    ("silence", "argument"),
    [
        ([[(20.0, 10.0)]], None),
        ([[(0.0, 5.0), (4.0, 9.0)]], None),
        ([[(0.0, float("nan"))]], None),
        ([[(0.0, 5.0)], []], "silence"),
        (5.0, "silence"),
    ],
)
def test_windows_that_make_no_sense_are_refused(silence, argument):
    for kind in (ConeR, OnlineConeR):
        with refused(argument=argument):
            kind().fit([lists([1.0])], [[5.0]], silence=silence)
