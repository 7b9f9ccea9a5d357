"""CONE-R against 6.12 to 6.14 stated plainly, every row written out, and handed whole to a cone solver."""

from __future__ import annotations

import itertools
import warnings

import numpy as np
import pytest
import stated
from draws import mixed
from interrupts import ctrl_c_after
from making import lists, made
from refusal import refused
from simulator import kernel

import taxel
from taxel import Neuron, SpikeTrains
from taxel.learn import ConeR, OnlineConeR

clarabel = pytest.importorskip("clarabel")
sparse = pytest.importorskip("scipy.sparse")


def examples(seed, trains=14, *shape, **options):
    return stated.examples(seed, trains, *shape, first=20.0, **options)


def statement(cone, patterns, targets, windows=None):
    """Every coefficient of 6.12 to 6.14, one sum of kernels at a time; silence is asked for in the windows alone."""

    def threshold(t, earlier, start):
        spike = earlier[-1] if len(earlier) else (start if cone.neuron_.first_threshold == "printed" else None)
        since = -np.inf if spike is None else t - spike - cone.neuron_.refractory
        rec = 2 * cone.neuron_.tau if cone.neuron_.tau_rec is None else cone.neuron_.tau_rec
        return cone.neuron_.theta_0 + (cone.neuron_.theta_plus * np.exp(-since / rec) if since >= -1e-9 else 0.0)

    def coefficients(pattern, t, earlier):
        row = np.zeros(len(pattern))
        for n, train in enumerate(pattern):
            for s, value in zip(train, stated.values_of(pattern, n), strict=True):
                if s >= t:
                    break
                if cone.neuron_.after_spike == "reset" and len(earlier) and s <= earlier[-1] + cone.neuron_.refractory:
                    continue
                if cone.neuron_.after_spike == "ignore" and any(e < s <= e + cone.neuron_.refractory for e in earlier):
                    continue
                row[n] += value * kernel(cone.neuron_, t - s)
        return row

    delta = 0.1 * cone.neuron_.tau if cone.delta_t_ms is None else cone.delta_t_ms
    at, behind, theta, silent, limit = [], [], [], [], []
    for p, (pattern, wanted) in enumerate(zip(patterns, targets, strict=True)):
        for k, t in enumerate(wanted):
            at.append(coefficients(pattern, t, wanted[:k]))
            behind.append(coefficients(pattern, t + delta, wanted[:k]))
            theta.append(threshold(t, wanted[:k], pattern.start))
        end = cone.horizon if cone.horizon is not None else max([pattern.stop, *(wanted[-1:] + cone.neuron_.tau)])
        for k in range(int((end - pattern.start) / cone.neuron_.step_ms + 1e-9) + 1):
            t = pattern.start + k * cone.neuron_.step_ms
            if any(e - 1e-9 <= t <= e + cone.neuron_.refractory + 1e-9 for e in wanted):
                continue
            asked = None if windows is None else windows[p]
            if asked is not None and not any(a - 1e-9 <= t <= b + 1e-9 for a, b in asked):
                continue
            earlier = [e for e in wanted if e < t]
            silent.append(coefficients(pattern, t, earlier))
            limit.append(threshold(t, earlier, pattern.start) - cone.margin)
    n = len(patterns[0])
    at, behind, silent = (np.reshape(v, (len(v), n)) for v in (at, behind, silent))
    return at, behind, np.array(theta), silent, np.array(limit)


def short(sides, distances):
    """The distances that count."""
    return distances if sides == "both" else np.minimum(distances, 0.0)


def terms(cone, rows, w):
    at, behind, theta, silent, limit = rows
    return np.array(
        [
            np.abs(w).sum(),
            np.linalg.norm(w) ** (2 if cone.norm == "square" else 1),
            (short(cone.sides_b, behind @ w - cone.kappa * theta) ** 2).sum(),
            np.abs(short(cone.sides_c, at @ w - theta)).sum(),
            np.maximum(silent @ w - limit, 0).sum(),
        ]
    )


def shares(cone, rows):
    """What each term is multiplied with: its lambda over their sum, over its largest value (6.3.2, 6.3.3)."""
    most = np.maximum(np.abs(cone.lb), np.abs(cone.ub)) * np.ones(rows[0].shape[1])
    low, high = terms(cone, rows, -most), terms(cone, rows, most)
    largest = np.array([high[0], high[1], low[2], low[3], high[4]])
    for k, by in enumerate((cone.divide_b_by, cone.divide_c_by, cone.divide_d_by)):
        if by == "targets":
            largest[2 + k] = len(rows[0]) if k < 2 else max(len(rows[0]), 1)
    largest[largest == 0.0] = np.inf
    return np.array(cone.lambdas) / np.sum(cone.lambdas) / largest


def least(cone, rows):
    """Minimise 6.14 over every row at once: w, |w|, |w|_2, B's and C's and D's images as variables of their own."""
    at, behind, theta, silent, limit = rows
    (k, n), m = at.shape, len(silent)
    c = shares(cone, rows)
    costs = [c @ terms(cone, rows, np.clip(w, cone.lb, cone.ub) * np.ones(n)) for w in (0.0, np.inf)]
    scale = 1 / (costs[0] or costs[1] or 1.0)
    c = c * scale
    # variables: w, a >= |w|, t >= |w|_2, y = behind w - kappa theta, e >= |at w - theta|,
    # h >= max(silent w - limit, 0); where only potentials below count, y >= kappa theta - behind w, e >= theta - at w
    # and 0.
    one_b, one_c = cone.sides_b == "below", cone.sides_c == "below"
    sizes = np.cumsum([0, n, n, 1, k, k, m])
    q = np.zeros(sizes[-1])
    q[sizes[1] : sizes[2]], q[sizes[4] : sizes[5]], q[sizes[5] :] = c[0], c[3], c[4]
    p = np.zeros(sizes[-1])
    p[sizes[3] : sizes[4]] = 2 * c[2]
    if cone.norm == "square":
        p[:n] = 2 * c[1]
    else:
        q[sizes[2]] = c[1]

    def block(rows, **columns):
        row = [sparse.csc_matrix((rows, sizes[i + 1] - sizes[i])) for i in range(6)]
        for name, value in columns.items():
            row["watyeh".index(name)] = sparse.csc_matrix(value)
        return sparse.hstack(row)

    eye = np.eye
    parts = [
        (block(k, w=(-1) ** one_b * behind, y=-eye(k)), (-1) ** one_b * cone.kappa * theta),
        (block(n, w=eye(n), a=-eye(n)), np.zeros(n)),
        (block(n, w=-eye(n), a=-eye(n)), np.zeros(n)),
        (block(n, w=eye(n)), cone.ub * np.ones(n)),
        (block(n, w=-eye(n)), np.multiply(cone.lb, -np.ones(n))),
        (block(k, w=(1 - one_c) * at, e=-eye(k)), (1 - one_c) * theta),
        (block(k, w=-at, e=-eye(k)), -theta),
        (block(m, w=silent, h=-eye(m)), limit),
        (block(m, h=-eye(m)), np.zeros(m)),
        (block(1, t=-eye(1)), np.zeros(1)),
        (block(n, w=-eye(n)), np.zeros(n)),
    ]
    a, b = sparse.vstack([v[0] for v in parts]).tocsc(), np.concatenate([v[1] for v in parts])
    cones = [
        *([clarabel.NonnegativeConeT(k) if one_b else clarabel.ZeroConeT(k)] if k else []),
        clarabel.NonnegativeConeT(4 * n + 2 * k + 2 * m),
        clarabel.SecondOrderConeT(n + 1),
    ]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = 1e-12, 1e-10, 1e-11
    answer = clarabel.DefaultSolver(sparse.diags(p).tocsc(), q, a, b, cones, settings).solve()
    w = np.clip(np.array(answer.x[:n]), cone.lb, cone.ub)
    return (c @ terms(cone, rows, w)) / scale


OPTIONS = [
    {},
    {"after_spike": "reset"},
    {"after_spike": "ignore", "refractory": 6.0},
    {"after_spike": "reset", "divide_b_by": "targets", "kappa": 1.1},
    {"norm": "square", "divide_b_by": "targets", "lambdas": (0, 4, 100, 100, 80)},
    {"lambdas": (4, 0, 100, 100, 80), "step_ms": 0.5},
    {"lambdas": (0, 0, 1, 1, 1), "margin": 0.05},
    {"lambdas": (2, 2, 0, 100, 400), "theta_plus": 3.0, "tau_rec": 100.0},
    {"lb": 0.0, "ub": 1.0, "first_threshold": "printed"},
    {"lb": -1.0, "ub": 0.2, "delta_t_ms": 4.0, "horizon": 150.0},
    {"lambdas": (0, 1, 0, 1, 100), "lb": -3.0, "ub": 3.0, "margin": 0.01, "kappa": 2.0},
    {"lb": [-0.1] * 7 + [-0.6] * 7, "ub": [0.3, 0.05] * 7},
    {"lb": [0.01] * 14, "ub": 0.5, "lambdas": (4, 0, 10, 100, 80)},
    {"kernel": "double_exponential", "tau_s": 3.0, "after_spike": "reset"},
    {"kernel": "double_exponential", "step_ms": 0.4, "norm": "square"},
    {"kernel": "exponential", "after_spike": "ignore", "lambdas": (2, 2, 10, 100, 800)},
    {"divide_c_by": "targets", "divide_d_by": "targets", "lambdas": (0, 1, 1, 10, 1)},
    {"divide_d_by": "targets", "sides_c": "below", "after_spike": "reset", "norm": "square"},
    {"sides_b": "below", "kappa": 1.1, "divide_b_by": "targets"},
    {"sides_b": "below", "sides_c": "below", "lambdas": (0, 2, 200, 10, 100), "norm": "square", "after_spike": "reset"},
    {"sides_b": "below", "sides_c": "below", "lambdas": (4, 0, 50, 100, 800), "lb": -1.0, "ub": 1.0},
    {"sides_b": "below", "sides_c": "below", "engine": "cone solver", "divide_c_by": "targets", "lb": 0.01, "ub": 0.5},
    {"sides_b": "below", "engine": "cone solver", "lambdas": (1, 1, 300, 1, 300), "lb": -1.0, "ub": 1.0},
    {"engine": "cone solver"},
    {"engine": "cone solver", "lb": [-0.1] * 7 + [-0.6] * 7, "ub": 0.2, "norm": "square"},
]


@pytest.mark.parametrize(("options", "seed"), mixed(OPTIONS, [1, 2, 3]))
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_the_objective_is_that_of_every_row_handed_whole_to_a_solver(options, seed):
    patterns, targets = examples(seed, whole_ms=seed == 2)
    silence = [None, [(15.0, 40.0), (40.0, 60.5)]] if seed == 3 else None
    cone = made(ConeR, tau=12.0, **options).fit(patterns, targets, silence=silence)
    rows = statement(cone, patterns, targets, silence)
    value = shares(cone, rows) * terms(cone, rows, cone.weights_)
    assert cone.silent_rows_ == len(rows[3])
    assert list(cone.parts_.values()) == pytest.approx(list(value), rel=1e-9, abs=1e-12)
    assert cone.objective_ == pytest.approx(value.sum(), rel=1e-12)
    assert cone.status_ == "solved"
    assert cone.engine_ == cone.engine
    assert cone.objective_ == pytest.approx(least(cone, rows), rel=1e-6)
    assert np.all(cone.weights_ >= cone.lb)
    assert np.all(cone.weights_ <= cone.ub)


def fitted(cone, *args, **kwargs):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return cone.fit(*args, **kwargs)


@pytest.mark.parametrize(
    "lambdas", [(1, 0, 0, 0, 0), (0, 0, 0, 1, 0), (0, 0, 0, 1, 1), (0, 0, 1, 0, 0), (0, 0, 0, 0, 1)]
)
def test_an_objective_that_can_be_met_whole_is_solved_at_0(lambdas):
    patterns, targets = examples(5, trains=30, targets=1)
    cone = fitted(ConeR(lambdas=lambdas, lb=-3.0, ub=3.0), patterns, targets)
    assert cone.status_ == "solved"
    assert cone.objective_ < 1e-12


def test_a_start_changes_the_way_but_not_the_result():
    patterns, targets = examples(6, trains=40, patterns=4, targets=3, duration=300.0)
    cold = fitted(ConeR(neuron=Neuron(tau=12.0, after_spike="reset")), patterns, targets)
    other = np.random.default_rng(0).uniform(-1, 1, 40)
    for start in (cold.weights_, other, np.zeros(40)):
        warm = fitted(ConeR(neuron=Neuron(tau=12.0, after_spike="reset")), patterns, targets, start=start)
        assert warm.status_ == "solved"
        assert warm.objective_ == pytest.approx(cold.objective_, rel=1e-6)


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
def test_where_the_native_engine_cannot_prove_its_result_the_cone_solver_goes_on_and_the_report_says_so():
    """Without l1 and l2 much is flat, and bounds above 0 leave no weights of 0 to fall back on."""
    patterns, targets = examples(24, trains=29, patterns=6)
    options = {"tau": 40.0, "kernel": "double_exponential", "step_ms": 2.5, "after_spike": "reset"}
    options |= {"lambdas": (0, 0, 1, 100, 80), "lb": 0.015, "ub": 0.6}
    cone, whole = (made(ConeR, **options, engine=engine).fit(patterns, targets) for engine in ("native", "cone solver"))
    assert cone.engine_ == whole.engine_ == "cone solver"
    assert cone.status_ == "solved"
    assert cone.objective_ == pytest.approx(whole.objective_, rel=1e-6)


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
def test_bounds_far_too_wide_neither_hang_the_native_engine_nor_ask_for_the_cone_solver(width, options):
    for seed, shape in enumerate([(14, 2, 2), (36, 6, 2), (8, 4, 3)]):
        patterns, targets = examples(seed, *shape)
        native, whole = (
            made(ConeR, **{"tau": 12.0} | options, lb=-width, ub=width, engine=engine).fit(patterns, targets)
            for engine in ("native", "cone solver")
        )
        assert native.status_ == "solved"
        assert native.engine_ == "native"
        if whole.status_ == "solved":  # it can fail where bounds are that wide
            assert native.objective_ == pytest.approx(whole.objective_, rel=2e-6)
        else:
            assert native.objective_ <= whole.objective_ * (1 + 1e-6)


@pytest.mark.parametrize("engine", ["native", "cone solver"])
@pytest.mark.parametrize("options", [{}, {"after_spike": "reset", "margin": 0.05, "norm": "square"}, {"lb": 0.01}])
def test_a_problem_in_another_unit_of_potential_has_the_same_answer_in_that_unit(engine, options):
    patterns, targets = examples(3, trains=20)
    parameters = {"tau": 12.0, "lb": -1.0, "ub": 1.0, "engine": engine, **options}
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


def test_a_start_in_another_unit_of_potential_is_a_start_too():
    patterns, targets = examples(3, trains=20)
    options = {"tau": 12.0, "theta_0": 15.0, "theta_plus": 10.0, "lb": -15.0, "ub": 15.0}
    cone = fitted(made(ConeR, **options), patterns, targets)
    again = fitted(made(ConeR, **options), patterns, targets, start=cone)
    assert again.rounds_ <= 1
    assert again.objective_ == pytest.approx(cone.objective_, rel=1e-6)


def test_one_layout_serves_many_parameters_and_refuses_those_that_need_other_rows():
    patterns, targets = examples(7)
    rows = ConeR(neuron=Neuron(tau=12.0)).prepare(patterns, targets)
    for options in ({"kappa": 1.4}, {"lambdas": (0, 4, 100, 100, 80)}, {"lb": -1.0, "ub": 2.0}, {"norm": "square"}):
        here = rows.fit(made(ConeR, tau=12.0, **options))
        assert here.objective_ == fitted(made(ConeR, tau=12.0, **options), patterns, targets).objective_
    for options in ({"tau": 13.0}, {"margin": 0.1}, {"delta_t_ms": 3.0}, {"after_spike": "reset"}, {"horizon": 400.0}):
        with refused():
            rows.fit(made(ConeR, **{"tau": 12.0, **options}))


def test_the_same_fit_again_gives_the_same_bits():
    patterns, targets = examples(8)
    first, again = (fitted(ConeR(neuron=Neuron(tau=12.0)), patterns, targets).weights_ for _ in range(2))
    assert first.tobytes() == again.tobytes()


def test_a_shift_in_time_and_another_order_of_trains_change_nothing():
    patterns, targets = examples(9, whole_ms=True)
    here = fitted(ConeR(neuron=Neuron(tau=12.0)), patterns, targets)
    order = np.random.default_rng(1).permutation(len(patterns[0]))
    there = [
        SpikeTrains.from_lists([p[n] + 1000.0 for n in order], start=p.start + 1000.0, stop=p.stop + 1000.0)
        for p in patterns
    ]
    moved = fitted(ConeR(neuron=Neuron(tau=12.0)), there, [t + 1000.0 for t in targets])
    assert moved.objective_ == pytest.approx(here.objective_, rel=1e-6)
    assert moved.weights_ == pytest.approx(here.weights_[order], abs=1e-3)


@pytest.mark.parametrize("after_spike", ["keep", "ignore", "reset"])
def test_with_a_margin_the_trained_neuron_fires_at_its_targets_and_nowhere_else(after_spike):
    """Learner and neuron mean the same by after_spike, refractory time and thresholds."""
    patterns, targets = examples(10, trains=150, patterns=3, targets=3, duration=200.0, whole_ms=True)
    # A target is reached to rounding, also from below, so the neuron is run slightly below its threshold.
    cone = fitted(
        ConeR(neuron=Neuron(after_spike=after_spike), lambdas=(0, 1e-4, 0, 100, 1e4), lb=-2.0, ub=2.0, margin=0.02),
        patterns,
        targets,
    )
    assert cone.parts_["C"] + cone.parts_["D"] < 1e-8
    assert cone.refires_ == 0
    for pattern, wanted in zip(patterns, targets, strict=True):
        at = cone.neuron_.potential(cone.weights_, pattern, wanted, spikes=wanted)
        assert at[0] == pytest.approx(cone.neuron_.theta_0, abs=1e-6)
        fired = cone.neuron_.run(cone.weights_, pattern, threshold=1 - 1e-5)
        assert list(fired) == list(wanted)


def test_a_pattern_without_targets_teaches_silence():
    (pattern,), targets = examples(11, trains=40, patterns=1, targets=1)
    # The same pattern played faster: its potential is higher, so an untrained neuron fires.
    patterns = [pattern, SpikeTrains.from_lists([0.8 * train for train in pattern], stop=pattern.stop)]
    loud = fitted(ConeR(lambdas=(0, 1, 0, 100, 1000), lb=-2.0, ub=2.0), patterns[:1], targets[:1])
    taught = fitted(ConeR(lambdas=(0, 1, 0, 100, 1000), lb=-2.0, ub=2.0), patterns, [targets[0], []])
    times = np.arange(0.0, patterns[1].stop)
    assert taught.neuron_.potential(taught.weights_, patterns[1], times).max() <= 0.3 + 1e-6
    assert loud.neuron_.potential(loud.weights_, patterns[1], times).max() > 0.3


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


@pytest.mark.parametrize(
    ("options", "argument"),
    [
        ({"tau": 0}, "tau"),
        ({"tau": float("nan")}, "tau"),
        ({"tau": "long"}, "tau"),
        ({"theta_0": -1}, "theta_0"),
        ({"theta_plus": -0.1}, "theta_plus"),
        ({"tau_rec": 0.0}, "tau_rec"),
        ({"refractory": -3}, "refractory"),
        ({"refractory": 0}, "refractory"),
        ({"after_spike": "forget"}, "after_spike"),
        ({"first_threshold": "none"}, "first_threshold"),
        ({"step_ms": 0}, "step_ms"),
        ({"kappa": 0}, "kappa"),
        ({"delta_t_ms": -1}, "delta_t_ms"),
        ({"lambdas": (1, 2, 3, 4)}, "lambdas"),
        ({"lambdas": (1, 2, 3, 4, -5)}, "lambdas"),
        ({"lambdas": (0, 0, 0, 0, 0)}, "lambdas"),
        ({"lb": 0.31, "ub": 0.3}, None),
        ({"ub": float("inf")}, "ub"),
        ({"divide_b_by": "two"}, "divide_b_by"),
        ({"norm": "max"}, "norm"),
        ({"margin": -0.1}, "margin"),
        ({"horizon": float("nan")}, "horizon"),
        ({"tolerance": 0}, "tolerance"),
        ({"lb": [-1.0, 0.6], "ub": 0.5}, None),
        ({"lb": [-1.0], "ub": [1.0, 1.0]}, "lb"),
        ({"lb": []}, None),
        ({"ub": [1.0, float("inf")]}, "ub"),
        ({"ub": "high"}, "ub"),
        ({"engine": "steam"}, "engine"),
        ({"max_seconds": 0}, "max_seconds"),
    ],
)
def test_a_parameter_that_makes_no_sense_is_one_clear_error(options, argument):
    with refused(argument=argument):
        made(ConeR, **options)


@pytest.mark.parametrize(
    ("patterns", "targets", "argument"),
    [
        ([], [], "patterns"),
        ([lists([1.0])], [], "targets"),
        ([lists()], [[5.0]], None),
        ([lists([], [])], [[5.0]], None),
        ([lists([1.0]), lists([1.0], [2.0])], [[5.0], [5.0]], None),
        ([lists([1.0])], [[float("nan")]], None),
        ([lists([1.0])], [[30.0, 20.0]], None),
        (
            [lists([1.0])],
            [[30.0, 31.5]],
            None,
        ),
        ([lists([1.0])], [[130.0]], None),
        ([lists([1.0])], [5.0], None),
        ([lists([1.0])], [["soon"]], None),
        (["spikes"], [[5.0]], None),
        ([SpikeTrains.from_lists([[1.0]], stop=9.0, values=[[-1.0]])], [[5.0]], None),
    ],
)
def test_examples_that_make_no_sense_are_one_clear_error_each(patterns, targets, argument):
    with refused(argument=argument):
        ConeR().fit(patterns, targets)


def test_a_start_that_does_not_fit_is_one_clear_error():
    for start, argument in (([1.0, 2.0], "weights"), ([float("nan")], "weights")):
        with refused(argument=argument):
            ConeR().fit([lists([1.0])], [[5.0]], start=start)


def test_bounds_for_another_number_of_trains_are_one_clear_error():
    with refused():
        ConeR(ub=[1.0, 1.0]).fit([lists([1.0])], [[5.0]])


def test_a_last_target_behind_the_horizon_is_one_clear_error():
    with refused():
        ConeR(horizon=50.0).fit([lists([1.0])], [[60.0]])


def test_the_defaults_that_python_shows_are_those_of_the_core():
    checked = taxel._core.check_parameters
    assert checked("cone_r", ConeR()._json()) == checked("cone_r", "{}")


@pytest.mark.parametrize("options", list(itertools.product(["keep", "reset"], ["norm", "square"])))
def test_the_gap_is_a_bound_also_where_the_fit_stops_early(options):
    patterns, targets = examples(14, trains=40, patterns=3, targets=2, duration=200.0)
    after_spike, norm = options
    common = {"tau": 12.0, "after_spike": after_spike, "norm": norm}
    rough = fitted(made(ConeR, **common, tolerance=0.1), patterns, targets)
    fine = fitted(made(ConeR, **common, tolerance=1e-8), patterns, targets)
    assert fine.objective_ <= rough.objective_
    assert rough.objective_ * (1 - rough.gap_) <= fine.objective_ * (1 + 1e-12)


def test_trains_without_a_spike_have_weight_0_and_count_in_the_normalisers():
    """A whole array has tens of thousands of trains, of which a touch reaches a few hundred."""
    random = np.random.default_rng(5)
    spoken = np.sort(random.choice(60, 25, replace=False))
    some = [[np.sort(random.uniform(0, 200, 3)) for _ in spoken] for _ in range(3)]
    targets = [[80.0], [120.0, 170.0], []]
    few = [SpikeTrains.from_lists(one, stop=200) for one in some]
    many = [
        SpikeTrains.from_lists([one[list(spoken).index(n)] if n in spoken else [] for n in range(60)], stop=200)
        for one in some
    ]
    bounds = random.uniform(0.2, 0.5, 60)
    alone = ConeR(lb=list(-bounds[spoken]), ub=list(bounds[spoken])).fit(few, targets)
    among = ConeR(lb=list(-bounds), ub=list(bounds)).fit(many, targets)
    assert np.count_nonzero(among.weights_) <= len(spoken)
    assert among.parts_["l1"] < alone.parts_["l1"]
    online = OnlineConeR(window=3, lb=list(-bounds), ub=list(bounds))
    for pattern, wanted in zip(many, targets, strict=True):
        online.partial_fit(pattern, wanted)
    assert among.objective_ == pytest.approx(online.objective_, rel=2e-6)
    again = ConeR(lb=list(-bounds), ub=list(bounds)).fit(many, targets, start=among)
    assert again.objective_ == pytest.approx(among.objective_, rel=1e-5)
    with refused(argument="weights"):
        ConeR().fit(many, targets, start=alone)
    problem = ConeR().prepare(many, targets)
    with refused(argument="lb"):
        problem.fit(ConeR(lb=[-1.0] * 3))
    with refused(argument="lb"):
        problem.fit(ConeR(lb=0.1, ub=0.2))
    held = np.where(np.arange(60) == np.setdiff1d(np.arange(60), spoken)[0], 0.25, 0.3)
    assert ConeR(lb=list(np.where(held == 0.25, 0.25, -0.3)), ub=list(held)).fit(many, targets).weights_.max() >= 0.25


def test_more_trains_than_can_be_weighed_are_refused_before_memory_is_asked_for():
    trains = SpikeTrains.from_lists([[1.0 + n % 50] for n in range(10_001)], stop=100)
    with refused(argument="patterns"):
        ConeR().fit([trains], [[60.0]])
