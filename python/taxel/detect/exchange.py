"""Readouts to NIR, the exchange format of neuromorphic simulators and chips.

NIR (Pedersen et al. 2024, Nat Commun 15:8122) describes a network by nodes with differential equations, in SI units. A
readout becomes: input -> [a delay ->] weights -> leaky neurons -> output. The kernels are solutions of NIR's equations,
where an input spike adds ``w_in / tau_syn`` to the current times the spike's area (see `_gains`):

- alpha: ``CubaLIF`` with ``tau_syn = tau_mem = tau``, as two leaky integrators of equal time constant in a row give it;
- double exponential: ``CubaLIF`` with ``tau_syn = tau_s``;
- exponential: ``LIF``.
"""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import finite
from taxel._base.files import write_whole
from taxel._core import ProblemError
from taxel.detect.trained import TrainedNeuron
from taxel.encode import Encoder
from taxel.neuron import Neuron

if TYPE_CHECKING:
    from nir import NIRGraph


def write_nir(
    path: str | os.PathLike[str],
    encoder: Encoder,
    neurons: Mapping[str, TrainedNeuron],
    delays_ms: NDArray[np.float64],
    run_threshold: float,
    *,
    spike_ms: float | None,
    overwrite: bool,
) -> list[str]:
    """Write the graph of a readout to a file; return what NIR cannot hold.

    Each neuron has one weight a train of the encoder at each delay, also where it receives some of its parts.
    """
    import nir  # noqa: PLC0415  an extra

    spike_ms = None if spike_ms is None else finite("spike_ms", spike_ms, least=1e-6, most=1000.0)
    if encoder.kind == "graded":
        raise ProblemError(
            f"NIR takes no graded trains: the input spikes of its graphs have no values, but those of {encoder.name} do"
        )
    graph, buffer = _graph(neurons, delays_ms, run_threshold, spike_ms), io.BytesIO()
    # In memory: the library crashes some time after a write to a full disk.
    nir.write(buffer, graph)
    write_whole(path, lambda file: file.write(buffer.getbuffer()), overwrite=overwrite)
    return lost([trained.neuron for trained in neurons.values()])


def lost(neurons: Sequence[Neuron]) -> list[str]:
    """Return what NIR's nodes cannot hold of the neurons of a readout, one line each."""
    lines = [
        "the encoder, whose spike trains are the inputs of the graph",
        "labels and trained delays; the outputs have the order of the labels",
    ]
    if any(neuron.refractory > 0 for neuron in neurons):
        lines.append("the refractory time, so a NIR neuron may fire again at once")
    if any(neuron.theta_plus > 0 for neuron in neurons):
        lines.append("the rise of the threshold by a spike")
    lines.append(
        f'after_spike="{neurons[0].after_spike}": after a spike, the potential of a NIR neuron is 0 and its input '
        "current continues, so spikes after the first may differ from those of taxel's neuron"
    )
    if neurons[0].time == "continuous":
        lines.append("continuous time: a simulator has time steps, so its neurons fire up to one step later")
    return lines


def _gains(neuron: Neuron, spike_s: float | None) -> tuple[str, dict[str, float], float]:
    """Return a neuron's node, its parameters (SI), and the factor from weights in V to those of the graph.

    A spike of area A (1 for a Dirac pulse, `spike_s` for a value of 1 that lasts so long) through CubaLIF gives
    ``A w_in r (e^{-t/tau_mem} - e^{-t/tau_syn}) / (tau_mem - tau_syn)``, for equal constants
    ``A w_in r t e^{-t/tau} / tau^2``; through LIF ``A r e^{-t/tau} / tau``.
    """
    tau = neuron.tau / 1000.0
    area = 1.0 if spike_s is None else spike_s
    # A simulator with a fixed step adds 1 a step: with r = tau/step its inputs stay unscaled.
    r = tau if spike_s is None else tau / spike_s
    if neuron.kernel == "exponential":
        return "LIF", {"tau": tau, "r": r}, tau / (area * r)
    if neuron.kernel == "alpha":
        tau_syn, height = tau, tau
    else:
        tau_syn = (neuron.tau / 4.0 if neuron.tau_s is None else neuron.tau_s) / 1000.0
        height = _peak_one(tau, tau_syn) * (tau - tau_syn)
    w_in = 1.0 if spike_s is None else tau_syn / spike_s
    return "CubaLIF", {"tau_mem": tau, "tau_syn": tau_syn, "r": r, "w_in": w_in}, height / (area * w_in * r)


def _peak_one(tau: float, tau_s: float) -> float:
    """Return the factor that lifts ``e^{-t/tau} - e^{-t/tau_s}`` to a peak of 1."""
    ratio = tau_s / tau
    return float(1.0 / (ratio ** (ratio / (1.0 - ratio)) - ratio ** (1.0 / (1.0 - ratio))))


def _graph(
    by_label: Mapping[str, TrainedNeuron],
    delays_ms: NDArray[np.float64],
    run_threshold: float,
    spike_ms: float | None,
) -> NIRGraph:
    import nir  # noqa: PLC0415  an extra

    spike_s = None if spike_ms is None else spike_ms / 1000.0
    neurons = list(by_label.values())
    for label, trained in by_label.items():
        if trained.neuron.rearm is not None:
            raise ProblemError(
                f"NIR: rearm of {label!r} is {trained.neuron.rearm}, but NIR neurons have no rearm; set it to None"
            )
    nodes = [_gains(trained.neuron, spike_s) for trained in neurons]
    kinds = sorted({kind for kind, _, _ in nodes})
    if len(kinds) > 1:
        raise ProblemError("NIR: exponential kernels and others need different nodes; export them as separate readouts")
    columns = {name: np.array([node[1][name] for node in nodes]) for name in nodes[0][1]}
    threshold = np.array([trained.neuron.theta_0 * run_threshold / 1000.0 for trained in neurons])
    zero = np.zeros(len(neurons))
    nir_neurons = getattr(nir, kinds[0])(v_leak=zero, v_threshold=threshold, v_reset=zero, **columns)
    weights = np.array([trained.weights / 1000.0 * node[2] for trained, node in zip(neurons, nodes, strict=True)])
    inputs = weights.shape[1] // len(delays_ms)
    parts: dict[str, Any] = {"input": nir.Input({"input": np.array([inputs])})}
    edges = []
    for k, delay in enumerate(delays_ms):
        name = "weights" if len(delays_ms) == 1 else f"weights_{k}"
        parts[name] = nir.Linear(weight=weights[:, k * inputs : (k + 1) * inputs])
        source = "input"
        if delay > 0:
            source = f"delay_{k}"
            parts[source] = nir.Delay(delay=np.full(inputs, delay / 1000.0))
            edges.append(("input", source))
        edges += [(source, name), (name, "neurons")]
    parts |= {"neurons": nir_neurons, "output": nir.Output({"output": np.array([len(neurons)])})}
    edges.append(("neurons", "output"))
    return nir.NIRGraph(nodes=parts, edges=edges)
