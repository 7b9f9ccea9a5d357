"""Sound calls of `taxel.learn`."""

from collections.abc import Callable
from typing import Any

import taxel
from sound.things import PLAIN, UNSIGNED, Sound, fresh, method, plain

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
TEMPOTRON = taxel.learn.Tempotron(eta=0.1, epochs=5).fit([PLAIN], [True])
SKIM = taxel.learn.SKIM(tau=5.0).fit([PLAIN], [[5.0]])
EPOCHS = {"eta": 0.1, "initial": (0.0, 1.0), "epochs": 5, "updates": "batch", "step_ms": 0.1, "within_ms": 1.0}
EPOCHS |= {"until_right": True, "seed": 1, "max_seconds": 1.0, "theta_0": 1.0, "after_spike": "reset", "tau": 9.0}
EPOCHS |= {"tau_s": 3.0}
#: The rules that learn by epochs, each with every argument; what they share is tried again in tests/learn.
RIVALS: list[tuple[Any, dict[str, Any]]] = [
    (taxel.learn.INST, EPOCHS),
    (taxel.learn.FILT, {**EPOCHS, "tau_q": 5.0}),
    (taxel.learn.Chronotron, {**EPOCHS, "rule": "E", "tau_q": 5.0, "gamma_r": 5.0}),
    (taxel.learn.ReSuMe, {**EPOCHS, "a": 0.1, "amplitude": 2.0, "tau_w": 5.0}),
    (taxel.learn.SPAN, {**EPOCHS, "tau_a": 5.0}),
    (taxel.learn.PSD, {**EPOCHS, "tau_1": 8.0, "tau_2": 2.0, "refractory": 0.0}),
    (taxel.learn.FP, {**EPOCHS, "window_ms": 1.0}),
    (taxel.learn.HTP, {**EPOCHS, "window_ms": 1.0}),
]

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    **{f"taxel.learn.{rule.__name__}": plain(rule, **arguments) for rule, arguments in RIVALS},
    "taxel.learn.SKIM": plain(
        taxel.learn.SKIM,
        tau=5.0,
        kernel="double_exponential",
        tau_s=2.0,
        step_ms=1.0,
        pulse_ms=3.0,
        ridge=0.1,
        branches=5,
        spread=0.5,
        delay_ms=3.0,
        nonlinearity="tanh",
        thresholds=[0.5],
        within_ms=5.0,
        seed=1,
    ),
    "taxel.learn.SKIM.fit": method(taxel.learn.SKIM(tau=5.0), "fit", patterns=[PLAIN], targets=[[5.0]]),
    "taxel.learn.SKIM.rows": method(SKIM, "rows", pattern=PLAIN),
    "taxel.learn.SKIM.output": method(SKIM, "output", pattern=PLAIN),
    "taxel.learn.SKIM.predict": method(SKIM, "predict", patterns=[PLAIN], threshold=0.5),
    "taxel.learn.Tempotron": plain(
        taxel.learn.Tempotron,
        tau=15.0,
        tau_s=4.0,
        theta_0=1.0,
        eta=0.1,
        momentum=0.5,
        initial_sd=0.1,
        epochs=5,
        seed=1,
        max_seconds=1.0,
    ),
    "taxel.learn.Tempotron.fit": method(
        TEMPOTRON, "fit", patterns=[PLAIN], labels=[True], start=[0.1] * 4, progress=lambda *_: None
    ),
    "taxel.learn.Tempotron.score": method(TEMPOTRON, "score", patterns=[PLAIN], labels=[True]),
    "taxel.learn.Tempotron.predict": method(TEMPOTRON, "predict", patterns=[PLAIN]),
    "taxel.learn.Tempotron.peak": method(TEMPOTRON, "peak", weights=[0.1] * 4, pattern=PLAIN),
    "taxel.learn.Tempotron.change": method(TEMPOTRON, "change", weights=[0.1] * 4, pattern=PLAIN, label=True),
    "taxel.learn.ConeR": plain(
        taxel.learn.ConeR,
        neuron=taxel.Neuron(tau=5.0),
        **CONE_OPTIONS,
    ),
    "taxel.learn.STDP": plain(taxel.learn.STDP, **taxel.learn.STDP().get_params()),
    "taxel.learn.STDP.partial_fit": fresh(taxel.learn.STDP, "partial_fit", piece=PLAIN),
    "taxel.learn.STDP.predict": method(taxel.learn.STDP().fit([PLAIN]), "predict", patterns=[PLAIN]),
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
    "taxel.learn.STDP.fit": fresh(taxel.learn.STDP, "fit", patterns=[PLAIN], targets=None),
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
