"""CONE-X in continuous time: each problem is solved and exact, or infeasible and proven so."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from stated import counts, examples, threshold

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX, check_certificate

#: Further problems are tried by `pytest -m slow`.
QUICK, ALL, STEPPED_QUICK, STEPPED_ALL = 120, 1000, 12, 100

LAMBDAS = {"l2": (0, 1, 0), "l1": (1, 0, 0), "mixed": (2, 2, 200)}


def draw(seed):
    """A problem of every kind: targets, after_spike, thresholds, times, objective, kernel, and how hard it is."""
    random = np.random.default_rng([6, 11, seed])
    targets = int(random.choice([1, 1, 2, 3, 5]))
    patterns, wanted = examples(
        seed=[1, seed],
        trains=int(random.integers(15, 60)),
        patterns=int(random.integers(1, 6)),
        targets=targets,
        duration=40.0 + 50.0 * targets,
        whole_ms=bool(random.integers(2)),
        apart=12.0,
    )
    kernel = str(random.choice(["alpha", "double_exponential"]))
    cone = ConeX(
        neuron=Neuron(
            kernel=kernel,
            tau=float(random.choice([8.0, 15.0])),
            tau_s=random.choice([None, 2.0, 5.0]),
            tau_rec=random.choice([None, 5.0, 40.0]),
            theta_plus=float(random.choice([0.0, 0.2, 0.5])),
            refractory=float(random.choice([1.0, 3.0, 4.5])),
            after_spike=str(random.choice(["keep", "ignore", "reset"])),
            first_threshold=str(random.choice(["theta_0", "printed"])),
        ),
        lambdas=LAMBDAS[str(random.choice(list(LAMBDAS)))],
        norm=str(random.choice(["norm", "square"])),
        lb=-2.0,
        ub=2.0,
    )
    return cone, patterns, wanted


def outcome(seed):
    """Solve one problem and check what is claimed; give the verdict."""
    cone, patterns, wanted = draw(seed)
    cone.fit(patterns, wanted)
    where = f"seed {seed}: {cone}"
    if cone.status_ == "infeasible":
        assert check_certificate(cone.problem_, cone.certificate_), where
        assert check_certificate(cone.problem_, cone.certificate_, margin=False) == cone.certificate_.at_all, where
        assert ("Without a margin this is impossible too" in str(cone.certificate_)) == cone.certificate_.at_all, where
    else:
        assert cone.status_ == "solved", f"{where}: {cone.gap_}, {cone.violation_}"
        assert cone.gap_ <= 1e-8, where
        assert min(cone.margin_) >= 0.499 * min(cone.problem_.margin), where
        for pattern, times in zip(patterns, wanted, strict=True):
            fired = cone.neuron_.run(cone.weights_, pattern)
            assert len(fired) == len(times), f"{where}: {fired} for {times}"
            assert np.abs(fired - times).max() <= 1e-6, f"{where}: {fired - times}"
    return cone.status_


def shares(seeds):
    """Every verdict and kind comes up; the shares are said."""
    met = Counter((draw(seed)[0].neuron.after_spike, outcome(seed)) for seed in seeds)
    solved = sum(n for (_, status), n in met.items() if status == "solved")
    print(f"{solved} of {len(seeds)} solved and exact, {len(seeds) - solved} infeasible and proven: {dict(met)}")
    assert 0.3 < solved / len(seeds) < 0.9
    assert len(met) == 6


def test_random_problems_are_solved_and_exact_or_infeasible_and_proven():
    shares(range(QUICK))


@pytest.mark.slow
def test_a_thousand_random_problems_are_solved_and_exact_or_infeasible_and_proven():
    shares(range(ALL))


def stepped(cone, pattern, times, k):
    """Where a neuron in steps of 1 us fires first after target k - 1, this and the ones before put at their targets."""
    fired, step = list(times[:k]), 1e-3
    begin = fired[-1] + cone.neuron_.refractory if k else pattern.start
    end = times[k] + 2 * step if k < len(times) else max(pattern.stop, times[-1] + cone.neuron_.tau)
    # The grid has a point at the target (or anywhere, behind the last).
    anchor = times[k] if k < len(times) else begin
    first = np.ceil((begin - anchor) / step - 1e-9)
    t = anchor + step * np.arange(first, np.floor((end - anchor) / step) + 1)
    heard = sorted((s, n) for n, train in enumerate(pattern) for s in train if counts(cone, s, fired))
    s, w = np.array([h[0] for h in heard]), cone.weights_[[h[1] for h in heard]]
    before = np.searchsorted(s, t, side="left")

    def summed(values, tau):
        """The sum of values e^{-(t - s)/tau} over the inputs before t."""
        total = np.concatenate([[0.0], np.cumsum(values * np.exp((s - begin) / tau))])
        return total[before] * np.exp(-(t - begin) / tau)

    if cone.neuron_.kernel == "alpha":
        u = (t - begin) / cone.neuron_.tau * summed(w, cone.neuron_.tau) - summed(
            w * (s - begin) / cone.neuron_.tau, cone.neuron_.tau
        )
    else:
        tau_s = cone.neuron_.tau / 4 if cone.neuron_.tau_s is None else cone.neuron_.tau_s
        top = cone.neuron_.tau * tau_s / (cone.neuron_.tau - tau_s) * np.log(cone.neuron_.tau / tau_s)
        u = (summed(w, cone.neuron_.tau) - summed(w, tau_s)) / (np.exp(-top / cone.neuron_.tau) - np.exp(-top / tau_s))
    last = fired[-1] if fired else (pattern.start if cone.neuron_.first_threshold == "printed" else None)
    theta = np.full(len(t), cone.neuron_.theta_0)
    if last is not None:
        since = t - last - cone.neuron_.refractory
        rec = 2 * cone.neuron_.tau if cone.neuron_.tau_rec is None else cone.neuron_.tau_rec
        theta += np.where(since >= -1e-9, cone.neuron_.theta_plus * np.exp(-since / rec), 0.0)
    assert theta[-1] == pytest.approx(threshold(cone, t[-1], fired, pattern.start), rel=1e-12)
    above = np.flatnonzero(u >= theta - 1e-11)
    return t[above[0]] if len(above) else None


def step_through(seeds):
    seen = 0
    for seed in seeds:
        cone, patterns, wanted = draw(seed)
        if cone.fit(patterns, wanted).status_ != "solved":
            continue
        for pattern, times in zip(patterns, wanted, strict=True):
            for k, target in enumerate(times):
                spike = stepped(cone, pattern, times, k)
                assert spike is not None, f"seed {seed}, target {target}: silent"
                assert -1e-9 <= spike - target <= 1e-3 + 1e-9, f"seed {seed}, target {target}: {spike - target}"
                seen += 1
            assert stepped(cone, pattern, times, len(times)) is None, f"seed {seed}: fires after its last target"
    assert seen >= len(seeds)


def test_steps_of_1_us_fire_within_one_step_of_each_target_and_not_before():
    step_through(range(1000, 1000 + STEPPED_QUICK))


@pytest.mark.slow
def test_steps_of_1_us_fire_within_one_step_of_each_target_in_many_problems():
    step_through(range(1000, 1000 + STEPPED_ALL))


@pytest.mark.parametrize("margin", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("kernel", ["alpha", "double_exponential"])
def test_small_margins_are_exact_too(margin, kernel):
    verdicts = set()
    for seed in range(6):
        patterns, wanted = examples(seed, trains=60, patterns=5, targets=1)
        cone = ConeX(neuron=Neuron(kernel=kernel), margin=margin, slope=margin, lb=-1, ub=1).fit(patterns, wanted)
        verdicts.add(cone.status_)
        if cone.status_ == "solved":
            for pattern, times in zip(patterns, wanted, strict=True):
                assert cone.neuron_.run(cone.weights_, pattern) == pytest.approx(times, abs=1e-6)
    assert "solved" in verdicts
    assert "stopped" not in verdicts


def test_weights_of_the_grid_fire_early_between_its_points_and_those_of_continuous_time_do_not():
    early = exact = 0
    for seed in range(5):
        patterns, wanted = examples(seed, trains=80, patterns=8, targets=1)
        for time in ("grid", "continuous"):
            cone = ConeX(neuron=Neuron(time=time), lb=-1, ub=1).fit(patterns, wanted)
            assert cone.status_ == "solved"
            for pattern, (target,) in zip(patterns, wanted, strict=True):
                spikes = ConeX().fit(patterns, wanted).neuron_.run(cone.weights_, pattern)
                right = len(spikes) == 1 and abs(spikes[0] - target) <= 1e-6
                early += time == "grid" and not right
                exact += time == "continuous" and right
    assert exact == 40
    assert early > 10


def test_an_input_at_the_target_may_turn_the_potential_down_at_once_and_the_neuron_still_fires():
    """A crossing that rounding puts a hair behind an input is at it."""
    random = np.random.default_rng(3)
    turned = 0
    for _ in range(40):
        times = [[float(t)] for t in random.integers(0, 60, 30)]
        trains = SpikeTrains.from_lists([*times, [40.0], [40.0]], stop=90.0)
        # The two inputs at the target itself are held at their least weight.
        cone = ConeX(lb=np.r_[[-1.0] * 30, [-1.0] * 2], ub=np.r_[[1.0] * 30, [-0.9] * 2]).fit([trains], [[40.0]])
        if cone.status_ == "solved":
            turned += 1
            assert cone.neuron_.run(cone.weights_, trains) == pytest.approx([40.0], abs=1e-6)
    assert turned > 20
