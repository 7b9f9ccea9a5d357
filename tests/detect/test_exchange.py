"""Readouts to NIR: the right kernels in SI units, first spikes in another simulator."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from draws import mixed
from shell import call

import taxel
from taxel.encode import LevelCrossing

nir = pytest.importorskip("nir")

KERNELS = [
    {"kernel": "alpha"},
    {"kernel": "double_exponential"},
    {"kernel": "double_exponential", "tau_s": 1.7},
    {"kernel": "exponential", "time": "grid"},
]
ENCODER = LevelCrossing([0.5])


def readout(kernel: dict, delays_ms: tuple[float, ...] = (0.0,), **more) -> taxel.Readout:
    rng = np.random.default_rng(7)
    inputs = 8 * len(delays_ms)
    neurons = {
        "contact": (taxel.Neuron(tau=10.0, **kernel), rng.normal(size=inputs)),
        "lift": (taxel.Neuron(tau=21.0, theta_0=0.7, **kernel), rng.normal(size=inputs), 2.5),
    }
    return taxel.Readout(ENCODER, neurons, array=taxel.Array(2, 2), delays_ms=delays_ms, **more)


def response(graph, branch: str, neuron: int, train: int, t_s: np.ndarray, area: float) -> np.ndarray:
    """What NIR's equations make of one spike of this area, V: the solution written down again."""
    weight = graph.nodes[branch].weight[neuron, train]
    node = graph.nodes["neurons"]
    if isinstance(node, nir.LIF):
        return area * weight * node.r[neuron] / node.tau[neuron] * np.exp(-t_s / node.tau[neuron])
    mem, syn = node.tau_mem[neuron], node.tau_syn[neuron]
    jump = area * weight * node.w_in[neuron] / syn * node.r[neuron] / mem
    if mem == syn:
        return jump * t_s * np.exp(-t_s / mem)
    return jump * (np.exp(-t_s / mem) - np.exp(-t_s / syn)) / (1 / syn - 1 / mem)


@pytest.mark.parametrize(("kernel", "spike_ms"), mixed(KERNELS, [None, 0.1]))
def test_the_graph_has_our_kernels_in_si_units(tmp_path: Path, kernel: dict, spike_ms: float | None) -> None:
    one = readout(kernel, (0.0, 5.0), run_threshold=0.9)
    one.to_nir(tmp_path / "one.nir", spike_ms=spike_ms)
    graph = nir.read(tmp_path / "one.nir")
    assert np.allclose(graph.nodes["delay_1"].delay, 0.005)
    t = np.linspace(0.01, 90.0, 200)
    spike = taxel.SpikeTrains.from_lists([[0.0]], stop=100.0)
    for k, trained in enumerate(one.neurons.values()):
        assert graph.nodes["neurons"].v_threshold[k] == pytest.approx(0.9e-3 * trained.neuron.theta_0)
        for train in range(8):
            for branch, weight in (("weights_0", trained.weights[train]), ("weights_1", trained.weights[8 + train])):
                ours = trained.neuron.potential([weight], spike, t)
                theirs = response(graph, branch, k, train, t / 1000.0, 1.0 if spike_ms is None else spike_ms / 1000.0)
                assert np.allclose(1000.0 * theirs, ours, rtol=1e-9, atol=1e-12)


def test_what_nir_cannot_hold_is_said(tmp_path: Path) -> None:
    said = "\n".join(readout({}).to_nir(tmp_path / "a.nir"))
    for word in ("encoder", "refractory", "threshold", 'after_spike="keep"', "continuous", "labels"):
        assert word in said
    bare = {"a": (taxel.Neuron(theta_plus=0.0, refractory=0.0, after_spike="reset", time="grid"), [0.1] * 8)}
    said = "\n".join(taxel.Readout(ENCODER, bare, array=taxel.Array(2, 2)).to_nir(tmp_path / "b.nir"))
    assert "refractory" not in said
    assert "rise" not in said
    assert "continuous" not in said


def test_the_command_writes_the_graph_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    readout({}).save(tmp_path / "a.json")
    code, out, _ = call(capsys, "export", "nir", tmp_path / "a.json", tmp_path / "a.nir")
    assert code == 0
    assert "not in NIR: the refractory time" in out
    assert nir.read(tmp_path / "a.nir").nodes["neurons"].tau_mem == pytest.approx([0.010, 0.021])
    code, _, complaint = call(capsys, "export", "nir", tmp_path / "a.json", tmp_path / "a.nir")
    assert code == 2
    assert "exists already" in complaint
    code, out, _ = call(
        capsys, "export", "nir", tmp_path / "a.json", tmp_path / "a.nir", "--overwrite", "--json", "--spike-ms", "0.1"
    )
    assert code == 0
    assert json.loads(out)["lost"]
