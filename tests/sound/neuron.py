"""Sound calls of `taxel.neuron`."""

from collections.abc import Callable
from typing import Any

import taxel
from sound.things import UNSIGNED, Sound, method, plain

#: A valid call of every public function and class with arguments, by its full name.
SOUND: dict[str, Sound] = {
    "taxel.Neuron": plain(
        taxel.Neuron,
        kernel="double_exponential",
        tau=10.0,
        tau_s=2.0,
        rearm=0.5,
        theta_0=0.3,
        theta_plus=0.2,
        tau_rec=20.0,
        refractory=3.0,
        after_spike="keep",
        first_threshold="theta_0",
        time="grid",
        step_ms=0.5,
    ),
    "taxel.Neuron.run": method(taxel.Neuron(), "run", weights=[1.0] * 2, trains=UNSIGNED, threshold=1.0),
    "taxel.Neuron.run_many": method(
        taxel.Neuron(), "run_many", weights=[[1.0] * 2, [0.5] * 2], trains=UNSIGNED, threshold=1.0
    ),
    "taxel.Neuron.potential": method(
        taxel.Neuron(), "potential", weights=[1.0] * 2, trains=UNSIGNED, times=[1.0, 5.0], spikes=[2.0]
    ),
}

#: For each type that only taxel constructs, a call that returns an instance.
RESULTS: dict[str, Callable[[], Any]] = {}

#: Names that are not tested, and the reason.
LEFT_OUT: dict[str, str] = {}
