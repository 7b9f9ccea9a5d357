"""Certificates of CONE-X: what proves, what does not, and what they say."""

from __future__ import annotations

import dataclasses
import itertools
import json
import re

import numpy as np
import pytest
from draws import mixed
from making import made
from refusal import refused
from stated import examples, graded

from taxel import Neuron, ProblemError, SpikeTrains, _core
from taxel.learn import Certificate, ConeR, ConeX, ConeXProblem, Row, check_certificate, check_gap
from taxel.learn._statement import pattern_rows


def refuted(seed=0, **options):
    """A problem beyond what its inputs can do."""
    patterns, targets = examples(seed, trains=12, patterns=8, targets=1)
    cone = made(ConeX, lb=-1, ub=1, **options).fit(patterns, targets)
    assert cone.status_ == "infeasible"
    return cone


def test_a_certificate_that_was_touched_is_refused():
    kinds = {"target", "silence"}
    cone = next(c for c in map(refuted, range(99)) if {r.kind for r in c.certificate_.rows} >= kinds)
    proof, problem = cone.certificate_, cone.problem_
    turned = proof.multipliers.copy()
    silent = next(k for k, row in enumerate(proof.rows) if row.kind == "silence")
    turned[silent] *= -1
    assert not check_certificate(problem, dataclasses.replace(proof, multipliers=turned))
    # A multiplier of a silent row may not be negative at all, even where the rest would carry the proof.
    for slight in (0.0, -1e-300, -1e-12):
        more = dataclasses.replace(
            proof,
            rows=[*proof.rows, proof.rows[silent]],
            multipliers=np.append(proof.multipliers, slight),
        )
        assert check_certificate(problem, more) == (slight == 0.0)
    assert not check_certificate(problem, dataclasses.replace(proof, multipliers=0 * proof.multipliers))
    assert not check_certificate(problem, dataclasses.replace(proof, multipliers=-proof.multipliers))
    target = next(k for k, row in enumerate(proof.rows) if row.kind == "target")
    left = [k for k in range(len(proof.rows)) if k != target]
    less = dataclasses.replace(proof, rows=[proof.rows[k] for k in left], multipliers=proof.multipliers[left])
    assert not check_certificate(problem, less)
    # The certificate is not valid for another problem, here one with wider bounds.
    patterns, targets = examples(1, trains=40, patterns=8, targets=1)
    other = ConeX(lb=-3, ub=3).fit(patterns, targets)
    assert other.status_ == "solved"
    strange = [row for row in proof.rows if row.kind != "silence"]
    assert not check_certificate(other.problem_, Certificate(strange, np.ones(len(strange)), 1.0, False, ""))


@pytest.mark.parametrize("options", [{}, {"after_spike": "reset"}, {"first_threshold": "printed"}])
def test_the_same_inputs_asked_to_fire_and_to_be_silent_are_refuted_for_any_margin(options):
    by_them_alone = 0
    for seed in range(6):
        patterns, targets = examples(seed, trains=30, patterns=4, targets=2)
        if seed % 2:  # the same up to its second target, where the first holds; then other inputs
            shared = [train[train <= targets[1][1]] for train in patterns[1]]
            patterns.append(
                SpikeTrains.from_lists([np.append(t, patterns[1].stop) for t in shared], stop=patterns[1].stop)
            )
            targets.append(targets[1][:1])
        else:
            patterns.append(patterns[1])
            targets.append([])
        cone = made(ConeX, lb=-3, ub=3, **options).fit(patterns, targets)
        assert cone.status_ == "infeasible"
        assert check_certificate(cone.problem_, cone.certificate_)
        assert check_certificate(cone.problem_, cone.certificate_, margin=False)
        assert cone.certificate_.at_all
        said = str(cone.certificate_)
        assert "pattern 1 must fire" in said
        assert "Without a margin this is impossible too" in said
        by_them_alone += "pattern 4, whose inputs are the same up to this time, must be silent" in said
        # With another input in time the problem is feasible, because the neuron can distinguish the patterns.
        apart = [*patterns[4]]
        apart[3] = np.sort(np.append(apart[3], targets[1][0] - 6.0))
        patterns[4] = SpikeTrains.from_lists(apart, stop=patterns[4].stop)
        cone = made(ConeX, lb=-3, ub=3, **options).fit(patterns, targets)
        assert cone.status_ != "infeasible" or "whose inputs are the same" not in str(cone.certificate_)
    assert by_them_alone > 1


def test_what_cancels_in_a_coefficient_is_no_proof() -> None:
    """Values of 1e8 hide one of 1e-8, with which weights within the bounds reach the threshold."""
    values = [[1e8, 1e-8, -1e8], [1.0]]
    trains = SpikeTrains.from_lists([[10.0, 10.0, 10.0], [30.0]], stop=60.0, values=values, kind="graded")
    for most, proven in ((1e9, False), (1e-3, True)):
        cone = ConeX(neuron=Neuron(tau=10.0), lb=-most, ub=most)
        problem = ConeXProblem(cone, [trains], [[20.0]])
        assert problem.target(0, 0)[0][0] == 0.0
        proof = Certificate([Row("target", 0, 0)], np.array([-1.0]), 0.3, False, "")
        assert check_certificate(problem, proof) == proven
    plain = SpikeTrains.from_lists([[10.0], [30.0]], stop=60.0, values=[[1e-8], [1.0]], kind="graded")
    assert Neuron(tau=10.0).potential([1e9, 0.0], plain, [20.0])[0] > 0.3


#: What checks the arguments of a learner, a neuron and trains; it computes nothing of a proof.
OF_ARGUMENTS = {"parameters", "check_parameters", "check_spikes"}


@pytest.mark.parametrize("time", ["grid", "continuous"])
def test_the_checks_of_proofs_need_no_compiled_code(time, monkeypatch):
    """Each function of the compiled part raises, except those that check arguments."""
    refused = refuted(3, time=time)
    trains = SpikeTrains.from_lists([[5.0], [12.0], [30.0]], stop=60.0)
    margin = {"margin": 1e-3} if time == "grid" else {}
    solved = ConeX(neuron=Neuron(tau=10.0, time=time), lb=-1.0, ub=1.0, **margin).fit([trains], [[20.0]])
    relaxed = ConeR(neuron=Neuron(tau=10.0), lb=-1.0, ub=1.0).fit([trains], [[20.0]])

    def none(*_, **__):
        raise AssertionError("compiled code was asked for")

    for name in dir(_core):
        one = getattr(_core, name)
        an_error = isinstance(one, type) and issubclass(one, Exception)
        if callable(one) and not name.startswith("__") and name not in OF_ARGUMENTS and not an_error:
            monkeypatch.setattr(_core, name, none)
    refused.problem_._problem = solved.problem_._problem = None
    with pytest.raises(AssertionError, match="compiled code"):
        solved.predict([trains])
    assert check_certificate(refused.problem_, refused.certificate_)
    assert check_gap(solved, [trains], [[20.0]]) <= 2 * solved.tolerance
    assert check_gap(relaxed, [trains], [[20.0]]) <= 2 * relaxed.tolerance


@pytest.mark.parametrize(
    ("kernel_in_time", "after_spike", "first_threshold"),
    mixed(
        # An exponential kernel crosses no threshold in continuous time.
        [*itertools.product(["alpha", "double_exponential"], ["grid", "continuous"]), ("exponential", "grid")],
        ["keep", "ignore", "reset"],
        ["theta_0", "printed"],
    ),
)
def test_the_rows_of_the_check_are_those_of_the_problem(kernel_in_time, after_spike, first_threshold):
    kernel, time = kernel_in_time
    options = {"kernel": kernel, "time": time, "after_spike": after_spike, "first_threshold": first_threshold}
    for seed in range(3):
        random = np.random.default_rng([44, seed])
        patterns, targets = examples(seed, trains=8, patterns=2, targets=2, whole_ms=time == "grid")
        patterns = graded(patterns, seed) if seed == 2 else patterns
        cone = made(ConeX, **options, theta_plus=1.0, margin=0.05)
        problem = ConeXProblem(cone, patterns, targets)
        stated = pattern_rows(cone, cone.neuron, patterns, problem.targets, margin=problem.margin)
        asked = 0
        for p, rows in enumerate(stated):
            times = random.uniform(rows.start, rows.end, 60)
            times = np.append(times, (targets[p] - 10.0 ** random.uniform(-7, 1, (9, 2))).ravel())
            times = np.unique(times.round() if time == "grid" else times)
            names = [("target", k) for k in range(2)] + [("slope", k) for k in range(2)] * (time == "continuous")
            for t in times:
                try:
                    problem.silence(p, t)
                except ProblemError:
                    assert not rows.is_silent(np.array([t]))[0], t
                    continue
                assert rows.is_silent(np.array([t]))[0], t
                names.append(("silence", t))
                asked += 1
            for kind, at in names:
                for margin in (True, False):
                    coefficients, limit = problem.row((kind, p, at), margin=margin)
                    here, _, its = rows.named(kind, at, "", margin=margin)
                    assert here == pytest.approx(coefficients, rel=1e-9, abs=1e-13), (kind, at)
                    assert its == pytest.approx(limit, rel=1e-9, abs=1e-13), (kind, at)
        assert asked > 40


def test_a_certificate_of_a_row_that_is_not_there_is_one_clear_error():
    cone = refuted()
    for row, argument in (
        (Row("silence", 99, 5.0), "certificate"),
        (Row("target", 0, 7), None),
        (Row("silence", 0, 1e6), None),
        (Row("behind", 0, 0), None),
    ):
        with refused(argument=argument):
            check_certificate(cone.problem_, Certificate([row], np.ones(1), 1.0, False, ""))


def test_a_certificate_goes_through_json_and_proves_the_same():
    cone = refuted()
    text = json.dumps(cone.certificate_.to_dict())
    again = Certificate.from_dict(json.loads(text))
    assert again.rows == cone.certificate_.rows
    assert np.array_equal(again.multipliers, cone.certificate_.multipliers)
    assert again.to_dict() == cone.certificate_.to_dict()
    assert check_certificate(cone.problem_, again)
    held = json.loads(text)
    for wrong, argument in (
        ([], "certificate"),
        ({**held, "more": 1}, "certificate"),
        ({**held, "multipliers": held["multipliers"][1:]}, "certificate"),
        ({**held, "rows": [["target", 0]] * len(held["rows"])}, "row"),
        ({**held, "at_all": "yes"}, "at_all"),
        ({**held, "gap": None}, "gap"),
    ):
        with refused(argument=argument):
            Certificate.from_dict(wrong)


def test_the_repr_of_a_fit_says_how_it_ended() -> None:
    patterns, targets = examples(0, trains=12, patterns=8, targets=1)
    assert repr(ConeX(lb=-1, ub=1)) == "ConeX(lb=-1, ub=1)"
    assert repr(ConeX(lb=-1, ub=1).fit(patterns, targets)) == "<ConeX(lb=-1, ub=1): infeasible>"
    solved = ConeX(lb=-9, ub=9).fit(patterns[:1], targets[:1])
    assert re.fullmatch(r"<ConeX\(lb=-9, ub=9\): solved, gap_ \d\.\de[-+]\d+>", repr(solved))
    more = examples(6, trains=120, patterns=2, targets=2, duration=200.0)
    stopped = ConeX(max_seconds=1e-9).fit(*more)
    assert repr(stopped).startswith("<ConeX(max_seconds=1e-09): stopped, violation_ ")
    soft = ConeR().fit(*more)
    assert re.fullmatch(r"<ConeR\(\): solved, gap_ \d\.\de-\d+, \d of 4 targets fire>", repr(soft))


def test_a_certificate_holds_where_one_bound_is_far():
    trains = SpikeTrains.from_lists([[50.0], [55.0]], stop=100.0)
    cone = ConeX(lb=-100.0, ub=0.05).fit([trains], [[65.0]])
    assert (cone.status_, check_certificate(cone.problem_, cone.certificate_)) == ("infeasible", True)
