"""One pattern, one neuron, exact targets (thesis 6.4.1 to 6.4.3): what figures 6.1, 6.2 and 6.4 to 6.6 share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.learn import ConeX
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_studies.runner import noted

#: Table 6.1; parameters that it does not name have taxel's defaults.
TABLE: dict[str, Any] = {"tau": 15.0, "theta_0": 0.3, "theta_plus": 0.2, "refractory": 3.0}
LEARN: dict[str, Any] = {"delta_t_ms": 1.5, "lb": -0.3, "ub": 0.3}


def single_spikes(seed: int, inputs: int, stop: float, end: float) -> SpikeTrains:
    """Draw one spike an input, uniform on 0 to `stop` ms; the window ends at `end`."""
    times = np.random.default_rng(seed).uniform(0.0, stop, inputs)
    return SpikeTrains.from_lists([[t] for t in times], 0.0, end)


def poisson(seed: int, inputs: int, stop: float, low_hz: float, high_hz: float) -> SpikeTrains:
    """Draw Poisson trains; each input has a rate of its own, uniform between the two."""
    rng = np.random.default_rng(seed)
    counts = rng.poisson(rng.uniform(low_hz, high_hz, inputs) * stop / 1000.0)
    return SpikeTrains.from_lists([np.sort(rng.uniform(0.0, stop, n)) for n in counts], 0.0, stop)


def thresholds(times: NDArray[np.float64], targets: Sequence[float]) -> NDArray[np.float64]:
    """Return the threshold (6.8, mV) at these times (ms): raised by each spike at the end of its refractory time."""
    values = np.full(len(times), TABLE["theta_0"])
    for target in targets:
        since = times - target - TABLE["refractory"]
        values[since >= 0] = TABLE["theta_0"] + TABLE["theta_plus"] * np.exp(-since[since >= 0] / (2 * TABLE["tau"]))
    return values


def timing(results: Sequence[dict[str, Any]], targets: Sequence[float]) -> dict[str, Any]:
    """Sum up how exactly solutions fire.

    Returns
    -------
    dict
        ``of``, ``solved``; ``exact``: that fire once a target, within 1e-6 ms of it, and never elsewhere;
        ``worst_error_ms`` of those with as many spikes as targets, None without any.
    """
    errors = [
        float(np.max(np.abs(np.subtract(r["spikes"], targets)))) for r in results if len(r["spikes"]) == len(targets)
    ]
    return {
        "of": len(results),
        "solved": sum(r["status"] == "solved" for r in results),
        "exact": sum(error < 1e-6 for error in errors),
        "worst_error_ms": max(errors, default=None),
    }


def exactness(parts: Sequence[dict[str, Any]]) -> tuple[str, bool]:
    """Describe the results of `timing` for several parts, and whether every one of them is exact."""
    exact, of = sum(p["exact"] for p in parts), sum(p["of"] for p in parts)
    errors = [p["worst_error_ms"] for p in parts if p["worst_error_ms"] is not None]
    worst = f"worst error {max(errors):.0e} ms" if errors else "none fires as often as it should"
    return f"{exact} of {of} fire once a target and never elsewhere, in exact simulation; {worst}", exact == of


def fitted(trains: SpikeTrains, targets: Sequence[float], times: Sequence[float], **learn: Any) -> dict[str, Any]:
    """Fit CONE-X to one pattern.

    Parameters
    ----------
    trains : SpikeTrains
    targets : ms
    times : ms
        Where the potential is sampled: without spiking, and between output spikes.
    **learn
        Parameters of `ConeX`.

    Returns
    -------
    dict
        ``status``, ``spikes`` (ms, of the exact neuron), ``weights``, ``at`` (ms, first spike an input), ``potential``
        (mV, without spiking), ``between`` (mV, with it).
    """
    cone = ConeX(neuron=Neuron(**TABLE), **LEARN).set_params(**learn)
    noted(cone.fit([trains], [targets]))
    neuron = cone.neuron_
    return {
        "status": cone.status_,
        "spikes": neuron.run(cone.weights_, trains).tolist(),
        "weights": cone.weights_.round(8).tolist(),
        "at": [round(float(t[0]), 6) if len(t) else None for t in trains],
        "potential": neuron.potential(cone.weights_, trains, times).round(6).tolist(),
        "between": neuron.potential(cone.weights_, trains, times, spikes=targets).round(6).tolist(),
    }
