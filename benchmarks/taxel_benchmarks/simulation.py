"""CPU time of 10 000 neurons with 1000 inputs of 20 Hz for a second: on a grid, and exact in continuous time.

All are connected to all: 2e8 synaptic events. The neuron is the one that every peer has: SRM0 with alpha kernel (two
leaky integrators of 15 ms in a row), a fixed threshold of 0.3 mV, everything back to 0 at a spike. The peers step a
grid, so an input acts from the next point on; NumPy is the straightforward loop: each step adds the weights of the
inputs that spiked. `continuous` has no grid: it computes each crossing to rounding, which no peer does. The neurons of
the thesis (refractory time, threshold rise, inputs kept) are listed with their additional cost. One thread, CPU time.

Peer: NumPy, Brian2 and snnTorch. Unit: CPU seconds. Goal: at most as long as NumPy on the grid and as Brian2 in
continuous time.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import taxel
from taxel import Neuron, SpikeTrains
from taxel_benchmarks._goals import Goal, not_slower
from taxel_benchmarks._rounds import compared, measure, stamp

TAU_MS, THETA, LENGTH_MS = 15.0, 0.3, 1000.0

Weights = NDArray[np.float32]


def problem(neurons: int, inputs: int, rng: np.random.Generator) -> tuple[Weights, SpikeTrains, SpikeTrains]:
    """Return weights for some 35 output spikes a second, Poisson trains, and these moved to the 1 ms grid."""
    times = [np.sort(rng.uniform(0.0, LENGTH_MS, rng.poisson(20.0))) for _ in range(inputs)]
    # Mean and spread are such that neurons fire some 35 times a second.
    weights = rng.normal(2.0 / inputs, 0.35 / np.sqrt(inputs), (neurons, inputs)).astype(np.float32)
    return (
        weights,
        SpikeTrains.from_lists(times, stop=LENGTH_MS),
        SpikeTrains.from_lists([np.ceil(t) for t in times], stop=LENGTH_MS),
    )


def numpy_loop(weights: Weights, trains: SpikeTrains) -> Callable[[], int]:
    """Return the straightforward loop over points of 1 ms; its state and weights are float32."""
    rows = np.ascontiguousarray(weights.T)
    times, numbers = trains.to_numpy()
    points = [numbers[times == k] for k in range(int(LENGTH_MS) + 1)]
    x, decay, theta = np.float32(1 / TAU_MS), np.float32(np.exp(-1 / TAU_MS)), np.float32(THETA)

    def loop() -> int:
        a, b = np.zeros(len(weights), np.float32), np.zeros(len(weights), np.float32)
        spikes = 0
        for arrived in points:
            b += x * a
            b *= decay
            a *= decay
            for n in arrived:
                a += rows[n]
            fired = b >= theta
            if fired.any():
                spikes += int(np.count_nonzero(fired))
                a[fired] = 0
                b[fired] = 0
        return spikes

    return loop


def brian2_network(weights: Weights, trains: SpikeTrains, step_ms: float) -> tuple[Callable[[], int], float]:
    """Return Brian2's run, set up and compiled, and the seconds that setting it up took."""
    import brian2 as b2  # noqa: PLC0415  a peer need not be there

    begun = time.process_time()
    b2.prefs.codegen.target = "cython"
    ms = b2.ms
    clock = b2.Clock(dt=step_ms * ms)
    times, numbers = trains.to_numpy()
    steps = np.ceil(times / step_ms).astype(int)
    once = np.unique(np.stack([steps, numbers]), axis=1)
    source = b2.SpikeGeneratorGroup(len(trains), once[1], once[0] * step_ms * ms, clock=clock)
    cells = b2.NeuronGroup(
        len(weights),
        f"dv/dt = (x - v) / ({TAU_MS}*ms) : 1\ndx/dt = -x / ({TAU_MS}*ms) : 1",
        threshold=f"v >= {THETA}",
        reset="v = 0; x = 0",
        method="exact",
        clock=clock,
    )
    synapses = b2.Synapses(source, cells, "w : 1", on_pre="x_post += w", clock=clock)
    synapses.connect()
    synapses.w = np.ascontiguousarray(weights.T).ravel()
    monitor = b2.SpikeMonitor(cells, record=False)
    network = b2.Network(source, cells, synapses, monitor)
    network.store()
    network.run(2 * step_ms * ms)

    def once_more() -> int:
        network.restore()
        network.run(LENGTH_MS * ms)
        return int(monitor.num_spikes)

    return once_more, time.process_time() - begun


def snntorch_loop(weights: Weights, trains: SpikeTrains, *, gathered: bool) -> Callable[[], int]:
    """Return snnTorch's Alpha neuron at steps of 1 ms; its two time constants must differ, so 15 and 14 ms."""
    import torch  # noqa: PLC0415  a peer need not be there
    from snntorch import Alpha  # noqa: PLC0415

    torch.set_num_threads(1)
    matrix = torch.from_numpy(np.ascontiguousarray(weights.T))
    cell = Alpha(alpha=np.exp(-1 / TAU_MS), beta=np.exp(-1 / (TAU_MS - 1)), threshold=THETA, reset_mechanism="zero")
    times, numbers = trains.to_numpy()
    dense = torch.zeros(int(LENGTH_MS) + 1, len(trains))
    dense[times.astype(int), numbers] = 1.0
    points = [torch.from_numpy(numbers[times == k]) for k in range(int(LENGTH_MS) + 1)]

    def loop() -> int:
        state, spikes = cell.reset_mem(), 0
        with torch.no_grad():
            for k, arrived in enumerate(points):
                current = matrix[arrived].sum(0) if gathered else dense[k] @ matrix
                fired, *state = cell(current, *state)
                spikes += int(fired.sum())
        return spikes

    return loop


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    return not_slower(result, "taxel, grid / numpy, 1 ms", "taxel, continuous / brian2, 1 ms")


def run(*, quick: bool) -> dict[str, Any]:
    """Measure; return seconds, ratios, and the number of output spikes of each."""
    neurons, inputs, rounds = (500, 100, 2) if quick else (10_000, 1000, 7)
    weights, trains, gridded = problem(neurons, inputs, np.random.default_rng(20))
    plain: dict[str, Any] = {
        "tau": TAU_MS,
        "theta_0": THETA,
        "theta_plus": 0.0,
        "refractory": 0.0,
        "after_spike": "reset",
    }
    grid, exact = Neuron(time="grid", **plain), Neuron(**plain)
    thesis: dict[str, Any] = {"tau": TAU_MS, "theta_0": THETA}
    runs: dict[str, Callable[[], int]] = {
        "taxel, grid": lambda: len(grid.run_many(weights, gridded).times),
        "numpy, 1 ms": numpy_loop(weights, gridded),
        "taxel, grid, inputs between its points": lambda: len(grid.run_many(weights, trains).times),
        "taxel, continuous": lambda: len(exact.run_many(weights, trains).times),
        "taxel, grid, neuron of the thesis": lambda: len(
            Neuron(time="grid", **thesis).run_many(weights, gridded).times
        ),
        "taxel, continuous, neuron of the thesis": lambda: len(Neuron(**thesis).run_many(weights, trains).times),
    }
    absent, setup = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        os.environ.setdefault("XDG_CACHE_HOME", folder)
        for step_ms in (1.0, 0.1):
            try:
                runs[f"brian2, {step_ms:g} ms"], setup[f"brian2, {step_ms:g} ms"] = brian2_network(
                    weights, trains, step_ms
                )
            except (ImportError, AttributeError) as error:  # AttributeError: a NumPy that the peer does not support
                absent[f"brian2, {step_ms:g} ms"] = str(error)
        for name, gathered in (("rows gathered", True), ("dense", False)):
            try:
                runs[f"snntorch, {name}"] = snntorch_loop(weights, gridded, gathered=gathered)
            except ImportError as error:
                absent[f"snntorch, {name}"] = str(error)
        spikes = {name: call() for name, call in runs.items()}
        results = measure(runs, rounds=rounds, work=float(neurons) * len(trains.times))
    apart = abs(spikes["taxel, grid"] / spikes["numpy, 1 ms"] - 1)
    if apart > 1e-3:
        raise taxel.Error(f"spikes on the grid: taxel {spikes['taxel, grid']}, NumPy {spikes['numpy, 1 ms']}")
    pairs = {
        f"{ours} / {peer}": (ours, peer)
        for ours in ("taxel, grid", "taxel, continuous")
        for peer in runs
        if not peer.startswith("taxel")
    }
    ratios, spread = compared(results, pairs)
    return {
        "question": (__doc__ or "").splitlines()[0],
        **stamp("brian2", "snntorch", "torch"),
        "neurons": neurons,
        "inputs": inputs,
        "input spikes": len(trains.times),
        "spikes": spikes,
        "set up and compiled, CPU s": setup,
        "left out": absent,
        "results": results,
        "ratios": ratios,
        "spread": spread,
        "stable": all(result["stable"] for result in results.values()),
    }
