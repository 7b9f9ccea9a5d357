"""Readouts to and from NIR, the exchange format of neuromorphic simulators and chips.

NIR (Pedersen et al. 2024, Nat Commun 15:8122) describes a network by nodes with differential equations, in SI units. A
readout becomes: input -> [a delay ->] weights -> leaky neurons -> output. The kernels are solutions of NIR's equations,
where an input spike adds ``w_in / tau_syn`` to the current times the spike's area (see `_gains`):

- alpha: ``CubaLIF`` with ``tau_syn = tau_mem = tau``, as two leaky integrators of equal time constant in a row give it;
- double exponential: ``CubaLIF`` with ``tau_syn = tau_s``;
- exponential: ``LIF``.

The graph's metadata hold the rest, which NIR cannot express, so that taxel reads back exactly the same readout.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel._base.arguments import checked_path, finite, instance, number, shown
from taxel._base.h5_file import H5File
from taxel._base.h5_writing import write_h5
from taxel._core import FormatError, ProblemError
from taxel.array import Array
from taxel.detect.trained import TrainedNeuron
from taxel.encode import Encoder
from taxel.neuron import Neuron

if TYPE_CHECKING:
    from nir import NIRGraph

#: Where in the graph's metadata the readout itself lies, and the length of a spike in s (0: a Dirac pulse).
READOUT, SPIKE = "taxel_readout", "taxel_spike_s"


@dataclass(frozen=True)
class Parts:
    """Hold the parts of a readout.

    Parameters
    ----------
    encoder : Encoder
    neurons : mapping from label to TrainedNeuron
        With one weight a train of the encoder, also where they receive some of its parts.
    array : Array, optional
    delays_ms : float64, shape (copies,), ms
    unit : str, optional
        Of the values that it was trained on.
    run_threshold : float
    time, after_spike : str
        As its neurons have them.
    text : str
        The readout as JSON; "" of one that is not built yet.
    """

    encoder: Encoder
    neurons: Mapping[str, TrainedNeuron]
    array: Array | None
    delays_ms: Sequence[float] | NDArray[np.float64]
    unit: str | None = None
    run_threshold: float = 1.0
    time: str = ""
    after_spike: str = ""
    text: str = ""


R = TypeVar("R")


def write_nir(readout: Parts, path: str | os.PathLike[str], *, spike_ms: float | None, overwrite: bool) -> list[str]:
    """Write the graph of a readout to a file; return what NIR cannot hold."""
    graph = _graph(readout, _spike(spike_ms))
    write_h5(path, _write, lambda pipe: pickle.dump(graph, pipe), overwrite=overwrite)
    return lost(readout)


def _write(file: BinaryIO, source: BinaryIO) -> None:
    """Write the graph that `write_nir` sends."""
    import nir  # noqa: PLC0415  an extra

    nir.write(file, pickle.load(source))


def _check_ungraded(encoder: Encoder) -> None:
    """Refuse an encoder of graded spikes: the input spikes of a NIR graph have no values."""
    if encoder.kind == "graded":
        raise ProblemError(
            f"NIR takes no graded trains: the input spikes of its graphs have no values, but those of {encoder.name} do"
        )


def lost(readout: Parts) -> list[str]:
    """Return what NIR's nodes cannot hold of a readout, one line each."""
    neurons = [trained.neuron for trained in readout.neurons.values()]
    lines = [
        "the encoder, whose spike trains are the inputs of the graph",
        "labels and trained delays; the outputs have the order of the labels",
    ]
    if any(neuron.refractory > 0 for neuron in neurons):
        lines.append("the refractory time, so a NIR neuron may fire again at once")
    if any(neuron.theta_plus > 0 for neuron in neurons):
        lines.append("the rise of the threshold by a spike")
    lines.append(
        f'after_spike="{readout.after_spike}": after a spike, the potential of a NIR neuron is 0 and its input current '
        "continues, so spikes after the first may differ from those of taxel's neuron"
    )
    if readout.time == "continuous":
        lines.append("continuous time: a simulator has time steps, so its neurons fire up to one step later")
    return lines


def read_nir(
    path: str | os.PathLike[str],
    parts_of: Callable[[str], Parts],
    build: Callable[[Parts], R],
    *,
    encoder: Encoder | None,
    neuron: Neuron | None,
    spike_ms: float | None,
) -> R:
    """Read a readout from a file; its nodes take precedence over the metadata.

    Parameters
    ----------
    path : path
    parts_of : function
        Gives the parts of a readout that is JSON.
    build : function
        Makes a readout of its parts.
    encoder, neuron, spike_ms
        As of `Readout.from_nir`.

    Raises
    ------
    FormatError : no NIR graph, or one that no readout can stand for (names file and node)
    ProblemError : no encoder is known
    """
    file, spike_ms = checked_path("path", path), _spike(spike_ms)
    encoder = None if encoder is None else instance("encoder", encoder, Encoder)
    neuron = None if neuron is None else instance("neuron", neuron, Neuron)
    graph = _read_graph(file)
    document = graph.metadata.get(READOUT)
    try:
        if document is not None and not isinstance(document, str):
            raise FormatError(f"{READOUT} in the metadata: must be a text")
        stored = None if document is None else parts_of(document)
        if spike_ms is None and SPIKE in graph.metadata:
            spike_ms = _spike(1000.0 * number(SPIKE, graph.metadata[SPIKE]) or None)
        if stored is not None and encoder is None and neuron is None and _same(graph, _graph(stored, spike_ms)):
            return build(stored)
        return build(_parts(graph, stored, encoder, neuron, spike_ms))
    except (FormatError, ProblemError) as error:
        raise type(error)(f"{file}: {error}") from None


def _read_graph(file: str | os.PathLike[str]) -> NIRGraph:
    """Read the graph of a file, as `nir.read` does, by the process that reads every HDF5 file."""
    import nir  # noqa: PLC0415  an extra

    try:
        tree = _tree(file)
        if "node" not in tree:
            raise FormatError(f"{file}: the group 'node' is missing; must be a file that nir.write has written")
        graph = nir.dict2NIRNode(tree["node"])
        if not isinstance(graph, nir.NIRGraph) or not isinstance(graph.metadata, dict):
            raise FormatError(f"{file}: a {type(graph).__name__}; must be a NIRGraph with its metadata")
    except (FormatError, MemoryError, OSError):
        raise
    except Exception as error:  # nir raises many kinds of errors for what is not a graph
        raise FormatError(
            f"{file}: no NIR graph that can be read: {type(error).__name__} {shown(str(error))}"
        ) from None
    return graph


def _tree(file: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the groups and data sets of the graph in a file, group within group."""
    root: dict[str, Any] = {}
    with H5File(file) as h5:
        paths = [path for path in h5.entries if path.split("/", maxsplit=1)[0] == "node"]
        h5.check_size(paths)
        for path in paths:
            entry, (*groups, name) = h5.entries[path], path.split("/")
            inner = root
            for group in groups:
                inner = inner[group]
            if not entry.dtype:
                inner[name] = {}
            else:
                inner[name] = (h5.texts(path) if entry.dtype == "text" else h5.numbers(path))[()]
    return root


def _spike(spike_ms: object) -> float | None:
    return None if spike_ms is None else finite("spike_ms", spike_ms, least=1e-6, most=1000.0)


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


def _graph(readout: Parts, spike_ms: float | None) -> NIRGraph:
    import nir  # noqa: PLC0415  an extra

    _check_ungraded(readout.encoder)
    spike_s = None if spike_ms is None else spike_ms / 1000.0
    neurons = list(readout.neurons.values())
    for label, trained in readout.neurons.items():
        if trained.neuron.rearm is not None:
            raise ProblemError(
                f"NIR: rearm of {label!r} is {trained.neuron.rearm}, but NIR neurons have no rearm; set it to None"
            )
    nodes = [_gains(trained.neuron, spike_s) for trained in neurons]
    kinds = sorted({kind for kind, _, _ in nodes})
    if len(kinds) > 1:
        raise ProblemError("NIR: exponential kernels and others need different nodes; export them as separate readouts")
    columns = {name: np.array([node[1][name] for node in nodes]) for name in nodes[0][1]}
    threshold = np.array([trained.neuron.theta_0 * readout.run_threshold / 1000.0 for trained in neurons])
    zero = np.zeros(len(neurons))
    nir_neurons = getattr(nir, kinds[0])(v_leak=zero, v_threshold=threshold, v_reset=zero, **columns)
    weights = np.array([trained.weights / 1000.0 * node[2] for trained, node in zip(neurons, nodes, strict=True)])
    delays = readout.delays_ms
    inputs = weights.shape[1] // len(delays)
    parts: dict[str, Any] = {"input": nir.Input({"input": np.array([inputs])})}
    edges = []
    for k, delay in enumerate(delays):
        name = "weights" if len(delays) == 1 else f"weights_{k}"
        parts[name] = nir.Linear(weight=weights[:, k * inputs : (k + 1) * inputs])
        source = "input"
        if delay > 0:
            source = f"delay_{k}"
            parts[source] = nir.Delay(delay=np.full(inputs, delay / 1000.0))
            edges.append(("input", source))
        edges += [(source, name), (name, "neurons")]
    parts |= {"neurons": nir_neurons, "output": nir.Output({"output": np.array([len(neurons)])})}
    edges.append(("neurons", "output"))
    metadata = {READOUT: readout.text, SPIKE: spike_s or 0.0}
    return nir.NIRGraph(nodes=parts, edges=edges, metadata=metadata)


def _same(a: NIRGraph, b: NIRGraph) -> bool:
    """Whether two graphs hold the same nodes, to the last bit, and edges."""

    def values(node: Any) -> dict[str, Any]:
        return {name: v for name, v in node.to_dict().items() if name != "metadata"}

    def equal(x: Any, y: Any) -> bool:
        if isinstance(x, dict) and isinstance(y, dict):
            return x.keys() == y.keys() and all(equal(x[k], y[k]) for k in x)
        return bool(np.array_equal(x, y))

    return (
        sorted(map(tuple, a.edges)) == sorted(map(tuple, b.edges))
        and a.nodes.keys() == b.nodes.keys()
        and all(equal(values(a.nodes[name]), values(b.nodes[name])) for name in a.nodes)
    )


def _parts(
    graph: NIRGraph,
    stored: Parts | None,
    encoder: Encoder | None,
    neuron: Neuron | None,
    spike_ms: float | None,
) -> Parts:
    """Return a readout's parts from nodes; the rest comes from the caller, the metadata, or by default."""
    encoder = encoder or (stored.encoder if stored is not None else None)
    if encoder is None:
        raise ProblemError("a NIR file contains no encoder: give encoder")
    _check_ungraded(encoder)
    weights, delays_ms, nir_neurons = _layers(graph)
    spike_s = None if spike_ms is None else spike_ms / 1000.0
    templates: list[TrainedNeuron | None] = [None] * len(weights)
    labels = [f"output {k}" for k in range(len(weights))]
    if stored is not None and len(stored.neurons) == len(weights):
        labels, templates = list(stored.neurons), list(stored.neurons.values())
    trained = {}
    for k, (label, template, row) in enumerate(zip(labels, templates, weights, strict=True)):
        rest = neuron or (template.neuron if template is not None else Neuron())
        constants, factor = _kernel(nir_neurons, k, spike_s)
        constants["theta_0"] = _threshold(nir_neurons, k)
        if stored is not None and neuron is None:
            # The nodes' threshold holds the factor already.
            constants["theta_plus"] = rest.theta_plus * stored.run_threshold
        rebuilt = Neuron(**{**rest.get_params(), **constants})
        delay_ms, inputs = (0.0, ()) if template is None else (template.delay_ms, template.inputs)
        trained[label] = TrainedNeuron(rebuilt, 1000.0 * row * factor, delay_ms, inputs)
    array, unit = (None, None) if stored is None else (stored.array, stored.unit)
    return Parts(encoder, trained, array, delays_ms, unit)


def _kernel(neurons: Any, k: int, spike_s: float | None) -> tuple[dict[str, Any], float]:
    """Return the kernel of cell `k` with its constants in ms, and the factor from the graph's weights to V."""

    def value(name: str) -> float:
        return float(getattr(neurons, name)[k])

    constants: dict[str, Any]
    if type(neurons).__name__ == "LIF":
        # Such a potential only jumps, so taxel compares it on a grid.
        tau, constants = value("tau"), {"kernel": "exponential", "tau_s": None, "time": "grid"}
    else:
        tau, tau_syn = value("tau_mem"), value("tau_syn")
        if not (np.isfinite(tau_syn) and 0 < tau_syn <= tau):
            raise FormatError(f"neurons[{k}]: tau_syn is {tau_syn} s: must be above 0 and at most tau_mem, {tau} s")
        constants = {"kernel": "double_exponential", "tau_s": 1000.0 * tau_syn}
        if abs(tau_syn - tau) <= 1e-9 * tau:
            constants = {"kernel": "alpha", "tau_s": None}
    if not (np.isfinite(tau) and tau > 0):
        raise FormatError(f"neurons[{k}]: the time constant is {tau} s: must be above 0")
    constants["tau"] = 1000.0 * tau
    _, ours, gain = _gains(Neuron(**constants), spike_s)
    # `gain` is for taxel's own r and w_in; a graph may split their product otherwise.
    scale = value("r") / ours["r"] * (value("w_in") / ours["w_in"] if "w_in" in ours else 1.0)
    return constants, scale / gain


def _threshold(neurons: Any, k: int) -> float:
    leak, threshold = float(neurons.v_leak[k]), float(neurons.v_threshold[k])
    if not threshold > leak:
        raise FormatError(f"neurons[{k}]: threshold {threshold} V is not above the rest, {leak} V")
    # Potentials count from rest.
    return 1000.0 * (threshold - leak)


def _layers(graph: NIRGraph) -> tuple[NDArray[np.float64], list[float], Any]:
    """Return weights by neuron and input (copy after copy), the copies' delays in ms, and the node of neurons."""
    nodes: dict[str, Any] = graph.nodes
    into: dict[str, list[str]] = {}
    for source, target in graph.edges:
        into.setdefault(target, []).append(source)
    kinds = {name: type(node).__name__ for name, node in nodes.items()}

    def only(kind: str) -> str:
        matches = [name for name, k in kinds.items() if k == kind]
        if len(matches) != 1:
            raise FormatError(f"the graph has {len(matches)} nodes of kind {kind}; must have one")
        return matches[0]

    def alone(name: str) -> str | None:
        return into[name][0] if len(into.get(name, [])) == 1 else None

    source, target = only("Input"), only("Output")
    last = into.get(target, [])
    if len(last) != 1 or kinds[last[0]] not in ("LIF", "CubaLIF"):
        raise FormatError("the output must come from exactly one node, of kind LIF or CubaLIF")
    branches = []
    for name in into.get(last[0], []):
        node, kind = nodes[name], kinds[name]
        if kind not in ("Linear", "Affine") or np.ndim(node.weight) != 2:
            raise FormatError(f"{name}: the node before the neurons is {kind}; must be Linear, or Affine without bias")
        if kind == "Affine" and np.any(node.bias):
            raise FormatError(f"{name}: has a bias; must have none")
        before, delay_ms = alone(name), 0.0
        if before is not None and kinds[before] == "Delay":
            delays = np.unique(np.asarray(nodes[before].delay, np.float64))
            if len(delays) != 1:
                raise FormatError(
                    f"{before}: delays its inputs by different times; must delay all of them by the same time"
                )
            delay_ms = 1000.0 * float(delays[0])
            before = alone(before)
        if before != source:
            raise FormatError(f"{name}: must come from the input, directly or through one Delay")
        branches.append((delay_ms, np.asarray(node.weight, np.float64)))
    if not branches:
        raise FormatError("the neurons have no inputs; must have at least one Linear node before them")
    branches.sort(key=lambda branch: branch[0])
    neurons = nodes[last[0]]
    if any(np.shape(w) != (np.size(neurons.v_threshold), np.shape(branches[0][1])[1]) for _, w in branches):
        raise FormatError(
            "each matrix of weights must have a row for each neuron, and all must have equally many columns"
        )
    return np.hstack([w for _, w in branches]), [delay for delay, _ in branches], neurons
