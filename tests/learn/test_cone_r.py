"""CONE-R against 6.12 to 6.14 stated plainly, every row written out, and handed whole to a cone solver."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from draws import seeds
from making import made
from refusal import refused
from relaxed import drawn, examples, fitted, sizes
from stated import grid_rows, least, shares, terms

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeR

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

#: So many problems are drawn in a part.
DRAWS = 40


@pytest.mark.parametrize("part", seeds(12, quick=1))
def test_whatever_the_options_a_fit_is_the_least_of_what_is_stated(part):
    for seed in range(DRAWS * part, DRAWS * (part + 1)):
        cone, patterns, targets, silence = drawn(seed)
        rows = grid_rows(cone, patterns, targets, silence)
        factors = shares(cone, sizes(cone, patterns, targets, silence, rows))
        ends = (np.clip(w, cone.lb, cone.ub) * np.ones(len(patterns[0])) for w in (0.0, np.inf))
        size = max(factors @ terms(cone, rows, w) for w in ends)
        value = factors * terms(cone, rows, cone.weights_)
        assert np.count_nonzero(np.abs(rows[3]).max(axis=1) > 1e-20) <= cone.silent_rows_ <= len(rows[3]), seed
        assert list(cone.parts_.values()) == pytest.approx(list(value), rel=1e-9, abs=1e-12 * size), seed
        assert cone.objective_ == pytest.approx(value.sum(), rel=1e-12), seed
        assert cone.status_ == "solved", seed
        assert cone.gap_ <= cone.tolerance, seed
        # The solver knows the least to some 1e-8 of the size.
        assert cone.objective_ == pytest.approx(least(cone, rows, factors), rel=cone.tolerance, abs=3e-8 * size), seed
        assert np.all(cone.weights_ >= cone.lb), seed
        assert np.all(cone.weights_ <= cone.ub), seed


@pytest.mark.parametrize("by", ["B_max", "targets"])
def test_with_l1_alone_a_fit_is_solved(by):
    """6.4.7's sparse weights without noise, whose multipliers are a fortieth of their range."""
    for seed in range(4):
        times = np.random.default_rng([seed, 0]).uniform(0.0, 40.0, 200)
        one = [SpikeTrains.from_lists([[t] for t in times], stop=40.0)], [np.array([40.0])]
        options = {"tau": 10.0, "theta_plus": 0.0, "after_spike": "reset", "kappa": 1.08, "delta_t_ms": 1.5}
        cone = made(ConeR, **options, lambdas=(4, 0, 100, 100, 100), divide_b_by=by).fit(*one)
        assert cone.status_ == "solved"
        rows = grid_rows(cone, *one)
        assert cone.objective_ == pytest.approx(least(cone, rows, shares(cone, rows)), rel=3e-6)


@pytest.mark.parametrize(
    "examined", [(1, 300, 10, 6, 1800.0, (0, 0, 1, 1, 1)), (199643, 182, 5, 3, 1200.0, (0, 0, 1, 1, 100))]
)
def test_without_a_norm_a_fit_over_thousands_of_rows_is_solved(examined):
    seed, trains, patterns, targets, duration, lambdas = examined
    by = {f"divide_{term}_by": "targets" for term in "bcd"}
    cone = made(ConeR, lambdas=lambdas, **by)
    assert fitted(cone, *examples(seed, trains, patterns, targets, duration)).status_ == "solved"
    assert cone.silent_rows_ > 5000


def test_a_target_out_of_reach_is_named_and_the_rest_is_fitted():
    trains = SpikeTrains.from_lists([[20.0], [25.0], [80.0], [85.0]], stop=120.0)
    cone = ConeR(lambdas=(0, 1e-3, 0, 100, 1), lb=-1.0, ub=1.0)
    with pytest.warns(UserWarning, match="to the threshold at pattern 0 target 0; the other targets were fitted"):
        cone.fit([trains], [[10.0, 90.0]])
    assert cone.unreachable_ == [(0, 0)]
    assert cone.neuron_.potential(cone.weights_, trains, [90.0]) == pytest.approx(
        0.3 + 0.2 * np.exp(-77 / 30), abs=1e-6
    )


def test_hours_of_silence_change_nothing():
    """Points that no input reaches are no rows: their number is bounded, not the time."""
    first, later = ([20.0, 30.0], [22.0, 31.0], [90.0]), ([15.0], [18.0, 40.0], [19.0, 60.0])
    hours = 1e8
    apart = [SpikeTrains.from_lists([list(train) for train in pattern], stop=120.0) for pattern in (first, later)]
    joined = [[*a, *(hours + t for t in b)] for a, b in zip(first, later, strict=True)]
    whole = SpikeTrains.from_lists(joined, stop=hours + 120.0)
    cone = ConeR(lb=-3.0, ub=3.0)
    in_parts = cone.fit(apart, [[35.0], [45.0]])
    fitted_whole = made(ConeR, lb=-3.0, ub=3.0).fit([whole], [[35.0, hours + 45.0]])
    assert fitted_whole.silent_rows_ < 20_000
    assert fitted_whole.weights_ == pytest.approx(in_parts.weights_, abs=1e-5)
    with refused(argument="step_ms"):
        ConeR(neuron=Neuron(tau=1e6)).fit([whole], [[35.0]])


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


def test_a_fit_with_more_coefficients_near_threshold_than_are_written_out_is_solved():
    patterns, targets = examples(14, trains=800, patterns=100, targets=2, duration=1000.0, spikes=2)
    told = []
    cone = made(ConeR, tau=190.0, lambdas=(0, 4, 100, 100, 80), divide_b_by="targets", after_spike="reset")
    fitted(cone, patterns, targets, progress=lambda *round: told.append(round))
    assert told[0][1] * 800 > 4_000_000
    assert cone.status_ == "solved"


LONG = {"tau": 40.0, "tolerance": 1e-9, "lambdas": (4, 0, 100, 100, 80)}


@pytest.fixture(scope="module")
def long_rows():
    """Rows on which a fit takes seconds."""
    return made(ConeR, **LONG).prepare(*examples(13, trains=300, patterns=60, targets=5, duration=2000.0))


def test_max_seconds_ends_a_fit_with_the_best_so_far_and_a_warning(long_rows):
    cone = made(ConeR, **LONG, max_seconds=0.2)
    with pytest.warns(UserWarning, match="only proven to be within"):
        long_rows.fit(cone)
    assert cone.status_ == "stopped"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ever = long_rows.fit(made(ConeR, **LONG | {"tolerance": 3e-2}))
    assert cone.objective_ * (1 - cone.gap_) <= ever.objective_


def test_one_layout_serves_all_divisors_and_sides_and_a_fit_of_other_sides_is_a_start():
    patterns, targets = examples(7)
    windows = [[(0.0, 60.0)], None]
    rows = ConeR(neuron=Neuron(tau=12.0)).prepare(patterns, targets, silence=windows)
    before = rows.fit(made(ConeR, tau=12.0))
    sum_below = {"form_b": "sum", "sides_b": "below"}
    for options in ({"sides_c": "below"}, {"sides_b": "below", "divide_d_by": "targets"}, {"form_b": "sum"}, sum_below):
        cold = fitted(made(ConeR, tau=12.0, **options), patterns, targets, silence=windows)
        assert rows.fit(made(ConeR, tau=12.0, **options)).objective_ == cold.objective_
        warm = rows.fit(made(ConeR, tau=12.0, **options), start=before)
        assert warm.status_ == "solved"
        assert warm.objective_ == pytest.approx(cold.objective_, rel=2e-6)
        assert rows.fit(made(ConeR, tau=12.0, **options), start=warm).rounds_ == 1


def test_a_target_that_only_negative_weights_reach_is_reachable():
    one = SpikeTrains.from_lists([[10.0]], stop=60.0, values=[[-1.0]], kind="graded")
    for lb, ub, unreachable in ((-2.0, 0.0, []), (0.0, 2.0, [(0, 0)])):
        assert made(ConeR, lb=lb, ub=ub, tau=10.0).fit([one], [[18.0]]).unreachable_ == unreachable
