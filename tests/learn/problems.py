"""Problems of CONE-X, drawn by seed and kind: pauses of an hour, inputs beside targets, grids."""

from __future__ import annotations

import numpy as np
from stated import examples

from taxel import Neuron, SpikeTrains
from taxel.learn import ConeX, ConeXProblem

LAMBDAS = [(0, 1, 0), (1, 0, 0), (2, 2, 200), (0, 0, 1)]


def drawn_neuron(random, **fixed):
    drawn = {
        "tau": float(random.choice([2.0, 5.0, 15.0])),
        "kernel": str(random.choice(["alpha", "double_exponential"])),
        "theta_plus": float(random.choice([0.0, 0.05, 0.2])),
        "tau_rec": random.choice([None, 3.0, 100.0]),
        "after_spike": str(random.choice(["keep", "ignore", "reset"])),
        "first_threshold": str(random.choice(["theta_0", "printed"])),
        "refractory": float(random.choice([1.0, 3.0, 8.0])),
    }
    return Neuron(**(drawn | fixed))


def around(random, neuron, start, near, values=None):
    """One to three patterns; `near` draws inputs beside the targets and the ends of refractory times."""
    trains, lists, wanted = int(random.integers(8, 40)), [], []
    for _ in range(int(random.integers(1, 4))):
        own = start + np.cumsum(random.uniform(12, 40, random.integers(1, 4))) + 10
        stop = float(own[-1]) + 20
        times = [list(random.uniform(start, stop - 10, random.integers(1, 4))) for _ in range(trains)]
        for n in random.choice(trains, random.integers(1, 7), replace=False):
            times[n].append(near(float(random.choice(own))))
        kind = {} if values is None else {"values": [values(len(one)) for one in times], "kind": "graded"}
        lists.append(SpikeTrains.from_lists([sorted(t) for t in times], start=start, stop=stop, **kind))
        wanted.append(own.tolist())
    bound = 2.0 if values is None else float(random.choice([0.3, 2.0, 100.0]))
    return ConeX(neuron=neuron, lambdas=LAMBDAS[random.integers(4)], lb=-bound, ub=bound), lists, wanted


def before(seed):
    """Inputs 1e-10 to 1e-4 ms before targets, where rows of silence are all but the target's own."""
    random = np.random.default_rng([22, seed])
    return around(random, drawn_neuron(random), 0.0, lambda t: t - 10 ** random.uniform(-10, -4))


def close(seed):
    """Inputs 1e-10 to 1e-6 ms apart around targets and the ends of refractory times."""
    random = np.random.default_rng([51, seed])
    neuron = drawn_neuron(random)

    def near(t):
        return t + neuron.refractory * random.integers(2) + random.integers(-5, 6) * 10.0 ** random.integers(-10, -6)

    return around(random, neuron, 0.0, near)


def graded_at(seed):
    """Graded patterns with inputs at targets and up to 1e-8 ms behind them."""
    random = np.random.default_rng([61, seed])
    largest = float(random.choice([0.1, 0.5]))

    def near(t):
        return t + float(random.choice([0.0, 1e-12, 1e-10, 1e-9, 1e-8]))

    def values(n):
        return random.choice([-1, 1], n) * 10 ** random.uniform(-largest, largest, n)

    return around(random, drawn_neuron(random), 0.0, near, values)


def paused(seed):
    """Bursts of inputs with pauses of up to an hour between them, and a target in some of them."""
    random = np.random.default_rng([17, seed])
    tau = float(random.choice([0.5, 2.0, 15.0]))
    trains, lists, wanted = int(random.integers(8, 25)), [], []
    for _ in range(int(random.integers(1, 4))):
        at, times, own = 0.0, [[] for _ in range(trains)], []
        for burst in range(int(random.integers(1, 4))):
            for n in range(trains):
                times[n] += list(at + np.sort(random.uniform(0, 4 * tau, random.integers(0, 3))))
            if random.random() < 0.8 or burst == 0:
                own.append(at + random.uniform(2, 4) * tau)
            at += 4 * tau + 4.0 + float(10 ** random.uniform(0, np.log10(3.6e6)))
        lists.append(SpikeTrains.from_lists([sorted(t) for t in times], stop=at))
        wanted.append(own)
    neuron = drawn_neuron(random, tau=tau, tau_rec=random.choice([None, 0.5, 200.0]), refractory=4.0)
    return ConeX(neuron=neuron, lambdas=LAMBDAS[random.integers(3)], lb=-3, ub=3), lists, wanted


def grid(seed):
    """Targets whose quotient with the step rounds either way, stated as products and as sums; inputs beside points."""
    random = np.random.default_rng([53, seed])
    step = float(random.choice([0.1, 0.3, 0.7, 1.0, 0.05, 0.192]))
    start = float(random.choice([0.0, 0.3, -17.1, 1000.1, -1e5, 1e7, 8.64e7]))
    neuron = drawn_neuron(
        random, tau=20 * step, time="grid", step_ms=step, refractory=float(random.choice([3, 8, 50.5])) * step,
        kernel=str(random.choice(["alpha", "double_exponential", "exponential"])),
    )  # fmt: skip
    points = np.cumsum(random.integers(70, 200, random.integers(1, 4)))
    own = [start + k * step if random.random() < 0.5 else start + round(float(k * step), 6) for k in points]
    stop, lists = start + (points[-1] + 60) * step, []
    for _ in range(int(random.integers(8, 30))):
        times = start + (random.choice(points[-1], random.integers(1, 4)) - random.choice([0.0, 0.5, 0.9])) * step
        if random.random() < 0.3:
            times[0] = random.choice(own) + random.choice([-0.9 * step, -1e-10, 0, 1e-10, neuron.refractory])
        lists.append(np.sort(np.clip(times, start, stop)))
    # A margin below the rounding of potentials far from 0 is another test's.
    margin = max(float(random.choice([1e-9, 1e-6, 1e-4])), 1e-14 * start)
    cone = ConeX(neuron=neuron, lambdas=LAMBDAS[random.integers(4)], lb=-5, ub=5, margin=margin)
    return cone, [SpikeTrains.from_lists(lists, start=start, stop=stop)], [own]


def usual(seed):
    """One to five targets a pattern, inputs at any time or at whole ms, margins and norms of every kind."""
    random = np.random.default_rng([6, 11, seed])
    targets = int(random.choice([1, 1, 2, 3, 5]))
    patterns, wanted = examples(
        seed=[1, seed],
        trains=int(random.integers(15, 60)),
        patterns=int(random.integers(1, 6)),
        targets=targets,
        duration=40.0 + 50.0 * targets,
        whole_ms=bool(random.integers(2)),
        apart=12.0,
    )
    neuron = drawn_neuron(
        random, tau=float(random.choice([8.0, 15.0])), tau_s=random.choice([None, 2.0, 5.0]), refractory=3.0
    )
    margin = random.choice([None, None, 1e-2, 1e-4])
    cone = ConeX(
        neuron=neuron, lambdas=LAMBDAS[random.integers(3)], norm=str(random.choice(["norm", "square"])), lb=-2, ub=2,
        margin=margin, slope=margin,
    )  # fmt: skip
    return cone, patterns, wanted


def lifted(seed):
    """B alone."""
    random = np.random.default_rng([19, seed])
    trains, patterns = int(random.integers(10, 60)), int(random.integers(1, 6))
    lists = [
        SpikeTrains.from_lists([np.sort(random.uniform(0, 90, random.integers(1, 4))) for _ in range(trains)], stop=100)
        for _ in range(patterns)
    ]
    wanted = [[float(random.choice([30.0, 70.0, 55.5]))] for _ in range(patterns)]
    wide = float(random.choice([0.3, 1.0, 3.0, 30.0]))
    cone = ConeX(neuron=Neuron(after_spike=str(random.choice(["keep", "reset"]))), lambdas=(0, 0, 1), lb=-wide, ub=wide)
    return cone, lists, wanted


def freed(seed):
    """Silence that ends at the instant at which the refractory time after the last target does."""
    random = np.random.default_rng([78, 1, seed])
    refractory = float(random.choice([0.7, 2.9, 3.0, 8.0]))
    neuron = drawn_neuron(random, tau=refractory, refractory=refractory, theta_plus=float(random.choice([0.0, 0.05])))

    def near(t):
        return t - refractory * random.uniform(0, 2)

    cone, patterns, wanted = around(random, neuron, float(random.choice([0.0, -17.1])), near)
    ends = [own[-1] for own in wanted]
    lists = [[t[t <= end] for t in pattern] for pattern, end in zip(patterns, ends, strict=True)]
    patterns = [
        SpikeTrains.from_lists(one, start=p.start, stop=end + refractory / 2)
        for one, p, end in zip(lists, patterns, ends, strict=True)
    ]
    horizon = None if random.random() < 0.5 else [end + refractory for end in ends]
    return cone.set_params(horizon=horizon), patterns, wanted


def reached(seed):
    """Bounds that just reach the only target, or miss it by roundings."""
    random = np.random.default_rng([78, 2, seed])
    start, step = float(random.choice([0.0, 1000.1])), float(random.choice([0.1, 1.0]))
    time, own = str(random.choice(["grid", "continuous"])), start + step * int(random.integers(5, 40))
    kernels = ["alpha", "double_exponential", "exponential"][: 3 if time == "grid" else 2]
    neuron = drawn_neuron(random, time=time, step_ms=step, kernel=str(random.choice(kernels)))
    first = max(start, own - 6 * neuron.tau)
    lists = [np.sort(random.uniform(first, own, random.integers(1, 3))) for _ in range(random.integers(1, 4))]
    pattern = SpikeTrains.from_lists(lists, start=start, stop=own + step * int(random.choice([1, 20])))
    coefficients, limit = ConeXProblem(ConeX(neuron=neuron, ub=1.0), [pattern], [[own]]).target(0, 0)
    most = float(limit / coefficients.sum() * (1 + 10.0 ** random.integers(-16, -8) * random.integers(-3, 4)))
    margin = 1e-6 if time == "grid" else None
    return ConeX(neuron=neuron, lb=0.0, ub=most, margin=margin), [pattern], [[own]]


KINDS = {kind.__name__: kind for kind in (usual, before, close, graded_at, paused, grid, lifted, freed, reached)}
