"""Sound calls of `taxel_rules`, as those of taxel in `tests/sound`."""

from typing import Any

from sound.things import PLAIN, Sound, fresh, method, plain

import taxel_rules

TEMPOTRON = taxel_rules.Tempotron(eta=0.1, epochs=5).fit([PLAIN], [True])
SKIM = taxel_rules.SKIM(tau=5.0).fit([PLAIN], [[5.0]])
EPOCHS = {"eta": 0.1, "initial": (0.0, 1.0), "epochs": 5, "updates": "batch", "step_ms": 0.1, "within_ms": 1.0}
EPOCHS |= {"until_right": True, "seed": 1, "max_seconds": 1.0, "theta_0": 1.0, "after_spike": "reset", "tau": 9.0}
EPOCHS |= {"tau_s": 3.0}
#: The rules that learn by epochs, each with every argument.
RULES: list[tuple[Any, dict[str, Any]]] = [
    (taxel_rules.INST, EPOCHS),
    (taxel_rules.FILT, {**EPOCHS, "tau_q": 5.0}),
    (taxel_rules.Chronotron, {**EPOCHS, "rule": "E", "tau_q": 5.0, "gamma_r": 5.0}),
    (taxel_rules.ReSuMe, {**EPOCHS, "a": 0.1, "amplitude": 2.0, "tau_w": 5.0}),
    (taxel_rules.SPAN, {**EPOCHS, "tau_a": 5.0}),
    (taxel_rules.PSD, {**EPOCHS, "tau_1": 8.0, "tau_2": 2.0, "refractory": 0.0}),
    (taxel_rules.FP, {**EPOCHS, "window_ms": 1.0}),
    (taxel_rules.HTP, {**EPOCHS, "window_ms": 1.0}),
]
READOUT = taxel_rules.TempotronReadout(epochs=3).fit([PLAIN, PLAIN], [0, 1])

#: A valid call of every public class with arguments and of its methods, by its full name.
SOUND: dict[str, Sound] = {
    **{f"taxel_rules.{rule.__name__}": plain(rule, **arguments) for rule, arguments in RULES},
    "taxel_rules.SKIM": plain(
        taxel_rules.SKIM,
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
    "taxel_rules.SKIM.fit": method(taxel_rules.SKIM(tau=5.0), "fit", patterns=[PLAIN], targets=[[5.0]]),
    "taxel_rules.SKIM.rows": method(SKIM, "rows", pattern=PLAIN),
    "taxel_rules.SKIM.output": method(SKIM, "output", pattern=PLAIN),
    "taxel_rules.SKIM.predict": method(SKIM, "predict", patterns=[PLAIN], threshold=0.5),
    "taxel_rules.Tempotron": plain(
        taxel_rules.Tempotron,
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
    "taxel_rules.Tempotron.fit": method(
        TEMPOTRON, "fit", patterns=[PLAIN], labels=[True], start=[0.1] * 4, progress=lambda *_: None
    ),
    "taxel_rules.Tempotron.score": method(TEMPOTRON, "score", patterns=[PLAIN], labels=[True]),
    "taxel_rules.Tempotron.predict": method(TEMPOTRON, "predict", patterns=[PLAIN]),
    "taxel_rules.Tempotron.peak": method(TEMPOTRON, "peak", weights=[0.1] * 4, pattern=PLAIN),
    "taxel_rules.Tempotron.change": method(TEMPOTRON, "change", weights=[0.1] * 4, pattern=PLAIN, label=True),
    "taxel_rules.STDP": plain(taxel_rules.STDP, **taxel_rules.STDP().get_params()),
    "taxel_rules.STDP.partial_fit": fresh(taxel_rules.STDP, "partial_fit", piece=PLAIN),
    "taxel_rules.STDP.predict": method(taxel_rules.STDP().fit([PLAIN]), "predict", patterns=[PLAIN]),
    "taxel_rules.STDP.fit": fresh(taxel_rules.STDP, "fit", patterns=[PLAIN], targets=None),
    "taxel_rules.TempotronReadout": plain(taxel_rules.TempotronReadout, tau=5.0, epochs=3, max_seconds=1.0, seed=1),
    "taxel_rules.TempotronReadout.fit": method(
        taxel_rules.TempotronReadout(epochs=3), "fit", patterns=[PLAIN, PLAIN], y=[0, 1]
    ),
    **{
        f"taxel_rules.TempotronReadout.{name}": method(READOUT, name, patterns=[PLAIN])
        for name in ("predict", "decision_function")
    },
    "taxel_rules.TempotronReadout.score": method(READOUT, "score", patterns=[PLAIN, PLAIN], y=[0, 1]),
}
