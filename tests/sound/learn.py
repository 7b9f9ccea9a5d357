"""Sound calls of `taxel.learn`."""

from collections.abc import Callable
from typing import Any

import taxel
from sound.things import PLAIN, UNSIGNED, Sound, method, plain

CONE_OPTIONS: dict[str, Any] = {
    "kappa": 1.2,
    "delta_t_ms": 1.0,
    "lambdas": [1.0, 1.0, 1.0, 1.0, 1.0],
    "lb": -1.0,
    "ub": 1.0,
    "divide_b_by": "targets",
    "divide_c_by": "targets",
    "divide_d_by": "targets",
    "sides_b": "below",
    "sides_c": "below",
    "norm": "square",
    "margin": 0.01,
    "horizon": 30.0,
    "tolerance": 1e-6,
    "engine": "native",
    "max_seconds": 60.0,
}
CONE = taxel.learn.ConeR(neuron=taxel.Neuron(tau=5.0), ub=1.0)
CONE_X = taxel.learn.ConeX(neuron=taxel.Neuron(tau=5.0), ub=1.0)
FITTED = taxel.learn.ConeR(neuron=taxel.Neuron(tau=5.0), ub=1.0).fit([PLAIN], [[5.0]])
SOLVED = taxel.learn.ConeX(neuron=taxel.Neuron(tau=5.0), lb=-9.0, ub=9.0).fit([PLAIN], [[5.0]])
REFUTED = taxel.learn.ConeX().fit([UNSIGNED], [[0.5]])

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.learn.ConeR": plain(
        taxel.learn.ConeR,
        neuron=taxel.Neuron(tau=5.0),
        **CONE_OPTIONS,
    ),
    "taxel.learn.OnlineConeR": plain(taxel.learn.OnlineConeR, window=3, neuron=taxel.Neuron(tau=5.0), **CONE_OPTIONS),
    "taxel.learn.OnlineConeR.partial_fit": lambda: (
        taxel.learn.OnlineConeR(neuron=taxel.Neuron(tau=5.0), window=3, ub=1.0).partial_fit,
        {"pattern": PLAIN, "targets": [5.0], "silence": [[0.0, 20.0]]},
    ),
    "taxel.learn.OnlineConeR.fit": method(
        taxel.learn.OnlineConeR(neuron=taxel.Neuron(tau=5.0), window=3, ub=1.0),
        "fit",
        patterns=[PLAIN],
        targets=[[5.0]],
        silence=[[[0.0, 20.0]]],
        start=None,
        progress=None,
    ),
    "taxel.learn.ConeR.fit": method(
        CONE,
        "fit",
        patterns=[PLAIN],
        targets=[[5.0]],
        silence=[[[0.0, 20.0]]],
        start=[0.1] * 4,
        progress=lambda *_: None,
    ),
    "taxel.learn.ConeR.prepare": method(CONE, "prepare", patterns=[PLAIN], targets=[[5.0]], silence=[[[0.0, 20.0]]]),
    "taxel.learn.ConeRProblem": plain(
        taxel.learn.ConeRProblem, cone=CONE, patterns=[PLAIN], targets=[[5.0]], silence=[[[0.0, 20.0]]]
    ),
    "taxel.learn.ConeRProblem.fit": method(
        CONE.prepare([PLAIN], [[5.0]]), "fit", cone=CONE, start=[0.1] * 4, progress=lambda *_: None
    ),
    "taxel.learn.ConeX": plain(
        taxel.learn.ConeX,
        neuron=taxel.Neuron(tau=5.0),
        kappa=1.2,
        delta_t_ms=1.0,
        lambdas=[1.0, 1.0, 1.0],
        lb=-1.0,
        ub=[1.0] * 4,
        divide_b_by="targets",
        norm="square",
        margin=0.01,
        slope=0.01,
        horizon=30.0,
        tolerance=1e-6,
        max_seconds=10.0,
    ),
    "taxel.learn.ConeX.fit": method(
        CONE_X, "fit", patterns=[PLAIN], targets=[[5.0]], start=REFUTED, progress=lambda *_: None
    ),
    "taxel.learn.ConeX.predict": method(SOLVED, "predict", patterns=[PLAIN]),
    "taxel.learn.ConeR.predict": method(FITTED, "predict", patterns=[PLAIN]),
    "taxel.learn.ConeXProblem": plain(taxel.learn.ConeXProblem, cone=CONE_X, patterns=[PLAIN], targets=[[5.0]]),
    "taxel.learn.ConeXProblem.row": method(REFUTED.problem_, "row", row=("silence", 0, 5.0), margin=True),
    "taxel.learn.ConeXProblem.target": method(REFUTED.problem_, "target", pattern=0, target=0),
    "taxel.learn.ConeXProblem.silence": method(REFUTED.problem_, "silence", pattern=0, t=5.0, margin=True),
    "taxel.learn.ConeXProblem.slope": method(REFUTED.problem_, "slope", pattern=0, target=0, margin=True),
    "taxel.learn.ConeXProblem.behind": method(REFUTED.problem_, "behind", pattern=0, target=0),
    "taxel.learn.check_certificate": plain(
        taxel.learn.check_certificate, problem=REFUTED.problem_, certificate=REFUTED.certificate_, margin=True
    ),
    "taxel.learn.Certificate.from_dict": plain(taxel.learn.Certificate.from_dict, held=REFUTED.certificate_.to_dict()),
    "taxel.learn.check_solution": plain(taxel.learn.check_solution, cone=FITTED, patterns=[PLAIN], targets=[[5.0]]),
    "taxel.learn.check_gap": plain(
        taxel.learn.check_gap, cone=FITTED, patterns=[PLAIN], targets=[[5.0]], silence=[None]
    ),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {
    "taxel.learn.Certificate": lambda: REFUTED.certificate_,
    "taxel.learn.Checked": lambda: taxel.learn.check_solution(SOLVED, [PLAIN], [[5.0]]),
    "taxel.learn.Margin": lambda: SOLVED.margin_,
    "taxel.learn.Multipliers": lambda: FITTED.multipliers_,
    "taxel.learn.Row": lambda: REFUTED.certificate_.rows[0],
}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
