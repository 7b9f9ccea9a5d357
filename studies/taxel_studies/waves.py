"""Wave trains and their noises (thesis 6.4.5 to 6.4.7): what figures 6.8 to 6.11 share.

A pattern is one spike a train. A wave train repeats it with random gaps; the neuron shall fire once a repetition.
Every draw comes from its own seed, so all thresholds, lambdas and learners are tested with the same noise.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel import learn
from taxel.metrics import victor_purpura
from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_studies.mapping import LEARN
from taxel_studies.runner import noted
from taxel_studies.study import Judgement, Row, Task

INPUTS, DURATION_MS, REPETITIONS = 200, 40.0, 30
#: Between repetitions, ms; the first and the last have a gap outside too, so that jitter stays inside.
GAP_MS = (50.0, 100.0)
#: Table 6.1 with the changes of 6.4.5; tau_rec is 2 tau in both tables. "reset": figures 6.9 to 6.11 need it.
NEURON: dict[str, Any] = {"tau": 10.0, "theta_0": 0.3, "theta_plus": 0.0, "refractory": 3.0, "after_spike": "reset"}
#: Cost of a millisecond in the distance of Victor and Purpura.
Q = 0.05
#: Units of the noises, and the levels that are tested.
NOISES = {"jitter": "sd, ms", "background": "Hz an input", "shunting": "% of spikes"}
LEVELS: dict[str, tuple[float, ...]] = {
    "jitter": tuple(range(11)),
    "background": (0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30),
    "shunting": (0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30),
}
#: Level of the noise in noisy training.
TRAINED_AT = 3.0


@dataclass(frozen=True)
class Reading:
    """A reading of B: its name in claims, and what the learner is given."""

    name: str
    options: Mapping[str, Any]

    @property
    def title(self) -> str:
        """Its name, and delta t."""
        return f"{self.name}, {self.delta_t}"

    @property
    def delta_t(self) -> str:
        """Delta t, in words."""
        return f"delta t {self.options.get('delta_t_ms', LEARN['delta_t_ms']):g} ms"


READINGS = {
    "sum": Reading("B as a sum", {"form_b": "sum"}),
    "sum, 0.1 tau": Reading("B as a sum", {"form_b": "sum", "delta_t_ms": 0.1 * NEURON["tau"]}),
    "targets": Reading("B over the number of targets", {"divide_b_by": "targets"}),
    "B_max": Reading("B over B_max, as printed", {}),
}

#: Parameters of studies that train and then test under all noises (6.9, 6.10); the same at a size that takes seconds.
TESTED: dict[str, Any] = {
    "realisations": 100,
    "readings": list(READINGS),
    "levels": {noise: list(levels) for noise, levels in LEVELS.items()},
    "repetitions": REPETITIONS,
}
TESTED_TOY: dict[str, Any] = {
    "realisations": 2,
    "levels": {"jitter": [0, 3, 6], "background": [0, 3, 30], "shunting": [0, 3, 30]},
    "repetitions": 5,
}

PROTOCOL = (
    "200 inputs with one spike each, uniform on 0 to 40 ms, target at 40 ms; tau 10 ms, theta+ 0, "
    "bounds ±0.3 mV. Tested on 30 repetitions 50 to 100 ms apart with jitter (normal, sd in ms), background (Poisson, "
    "Hz an input) or shunting (% of the spikes, drawn without replacement). Distance of Victor and Purpura with q = "
    "0.05 a ms over the 30 targets: 30 is as bad as silence. Noisy training: a wave train of 30 repetitions with noise "
    "3 of the same kind, CONE-R. Tested in continuous time. After a spike “reset”, in rows and neuron: with “keep”, as "
    "6.7 prints it, the neuron fires again each 3 ms."
)
READ = (
    " Readings of B: as a sum, at a delta t of 1.5 ms (Table 6.1) and of 1 ms (0.1 tau), as no line decides: "
    "a claim holds if it does at both; over the number of targets, and over B_max as printed, at 1.5 ms."
)


@dataclass(frozen=True)
class Waves:
    """A wave train: ``times`` of shape (repetitions, inputs), ms; ``targets``, ms; ``stop``, ms."""

    times: NDArray[np.float64]
    targets: NDArray[np.float64]
    stop: float

    @property
    def trains(self) -> SpikeTrains:
        """The train without noise."""
        return _trains(self.times.ravel(), np.tile(np.arange(self.times.shape[1]), len(self.times)), self)


def pattern(seed: int, inputs: int = INPUTS) -> NDArray[np.float64]:
    """Return the spike time of each input, ms."""
    return np.random.default_rng([seed, 0]).uniform(0.0, DURATION_MS, inputs)


def waves(times: NDArray[np.float64], rng: np.random.Generator, repetitions: int = REPETITIONS) -> Waves:
    """Repeat a pattern with random gaps."""
    gaps = rng.uniform(*GAP_MS, repetitions + 1)
    starts = np.cumsum(gaps[:-1]) + DURATION_MS * np.arange(repetitions)
    stop = float(starts[-1] + DURATION_MS + gaps[-1])
    return Waves(starts[:, None] + times, starts + DURATION_MS, stop)


def noisy(train: Waves, noise: str, level: float, rng: np.random.Generator) -> SpikeTrains:
    """Corrupt a wave train.

    Parameters
    ----------
    train : Waves
    noise : {"jitter", "background", "shunting"}
    level : float
        Standard deviation in ms, Hz an input, % of the spikes.
    rng : Generator
    """
    repetitions, inputs = train.times.shape
    times, numbers = train.times.ravel(), np.tile(np.arange(inputs), repetitions)
    if noise == "jitter":
        times = np.clip(times + rng.normal(0.0, level, len(times)) if level else times, 0.0, train.stop)
    elif noise == "background":
        counts = rng.poisson(np.full(inputs, level * train.stop / 1000.0))
        times = np.concatenate([times, rng.uniform(0.0, train.stop, counts.sum())])
        numbers = np.concatenate([numbers, np.repeat(np.arange(inputs), counts)])
    else:
        kept = rng.permutation(len(times))[round(level / 100.0 * len(times)) :]
        times, numbers = times[kept], numbers[kept]
    return _trains(times, numbers, train)


def _trains(times: NDArray[np.float64], numbers: NDArray[np.int64], train: Waves) -> SpikeTrains:
    order = np.lexsort((times, numbers))
    offsets = np.searchsorted(numbers[order], np.arange(train.times.shape[1] + 1))
    return SpikeTrains(times[order], offsets, 0.0, train.stop)


def tasks(
    p: Mapping[str, Any], clean: Sequence[Mapping[str, Any]], noisy: Sequence[Mapping[str, Any]], learner: str
) -> list[Task]:
    """List one task a seed, a training and a reading; it runs all settings on the same draws.

    Parameters
    ----------
    p : mapping
        ``readings``, ``levels`` by noise, ``repetitions``, ``realisations``.
    clean, noisy : sequence of mapping
        Settings (kappa, lambdas) of training without noise and with it.
    learner : {"cone_x", "cone_r"}
        Of training without noise.
    """
    listed = []
    for reading in p["readings"]:
        for training in ("clean", *p["levels"]):
            tested = {n: [v for v in p["levels"][n] if training == "clean" or v >= TRAINED_AT] for n in p["levels"]}
            params = {
                "training": training,
                "learner": learner if training == "clean" else "cone_r",
                "settings": [dict(setting) for setting in (clean if training == "clean" else noisy)],
                "reading": reading,
                "levels": tested if training == "clean" else {training: tested[training]},
                "repetitions": p["repetitions"],
            }
            listed += [Task(params, seed) for seed in range(p["realisations"])]
    return listed


def summarise(p: Mapping[str, Any], rows: Sequence[Row]) -> dict[str, Any]:
    """Average distances over realisations.

    Returns
    -------
    dict
        ``curves``: by reading, training ("clean", "noisy") and noise ``levels``, and ``mean`` and ``sem`` (standard
        error), one list a setting.
    """
    averages: dict[str, Any] = {}
    for reading in p["readings"]:
        averages[reading] = {"clean": {}, "noisy": {}}
        for training in ("clean", *p["levels"]):
            here = [r for r in rows if r.params["reading"] == reading and r.params["training"] == training]
            for noise, levels in here[0].params["levels"].items():
                each = np.array([[f["distance"][noise] for f in r.result["found"]] for r in here])
                averages[reading]["clean" if training == "clean" else "noisy"][noise] = {
                    "levels": levels,
                    "mean": each.mean(axis=0).round(3).tolist(),
                    "sem": (each.std(axis=0) / np.sqrt(len(each))).round(3).tolist(),
                }
    return {"curves": averages}


def agreed(readings: Sequence[str], judged: Callable[[str], Iterable[Judgement]]) -> Iterator[Judgement]:
    """Judge in each reading of B: a claim at several delta t once, and it holds if it does at all of them."""
    found: dict[tuple[int, str], dict[str, Judgement]] = {}
    for reading in readings:
        for one in judged(reading):
            found.setdefault((one.claim, READINGS[reading].name), {})[READINGS[reading].delta_t] = one
    for (claim, name), at in found.items():
        ours = _each({delta_t: one.ours for delta_t, one in at.items()})
        held = [delta_t for delta_t, one in at.items() if one.holds]
        why = _each({delta_t: one.why for delta_t, one in at.items()})
        if 0 < len(held) < len(at) and not why:
            why = f"it does at {', '.join(held)} alone"
        yield Judgement(claim, ours, len(held) == len(at), why, name)


def _each(texts: Mapping[str, str]) -> str:
    if len(set(texts.values())) == 1:
        return next(iter(texts.values()))
    return "; ".join(f"{delta_t}: {text}" for delta_t, text in texts.items() if text)


def realise(params: dict[str, Any], seed: int) -> dict[str, Any]:
    """Train on one pattern at several settings, test each under noise.

    Parameters
    ----------
    params : dict
        ``training`` ("clean" or the noise of the training), ``learner`` ("cone_x" or "cone_r"), ``settings`` (dicts
        with kappa and lambdas), ``reading``, ``levels`` by noise, ``repetitions``.
    seed : int
        Of the pattern and everything drawn on it.

    Returns
    -------
    dict
        A setting: ``weights``, and ``distance`` by noise, one value a level.
    """
    times = pattern(seed)
    training = _training(params, times, seed)
    noises = list(params["levels"]) if params["training"] == "clean" else [params["training"]]
    tests = {
        noise: [
            _test(times, noise, level, np.random.default_rng([seed, 2, list(NOISES).index(noise), k]), params)
            for k, level in enumerate(params["levels"][noise])
        ]
        for noise in noises
    }
    results = []
    for setting in params["settings"]:
        cone = _fitted(params, setting, *training)
        neuron = cone.neuron_
        neuron.time = "continuous"
        distance = {
            noise: [
                round(victor_purpura(neuron.run(cone.weights_, trains), targets, q=Q), 4) for trains, targets in tested
            ]
            for noise, tested in tests.items()
        }
        results.append({"weights": [round(float(w), 6) for w in cone.weights_], "distance": distance})
    return {"found": results}


def _training(
    params: Mapping[str, Any], times: NDArray[np.float64], seed: int
) -> tuple[list[SpikeTrains], list[NDArray[np.float64]]]:
    if params["training"] == "clean":
        trains = SpikeTrains.from_lists([[t] for t in times], 0.0, DURATION_MS)
        return [trains], [np.array([DURATION_MS])]
    rng = np.random.default_rng([seed, 1, list(NOISES).index(params["training"])])
    train = waves(times, rng, params["repetitions"])
    return [noisy(train, params["training"], TRAINED_AT, rng)], [train.targets]


def _test(
    times: NDArray[np.float64], noise: str, level: float, rng: np.random.Generator, params: Mapping[str, Any]
) -> tuple[SpikeTrains, NDArray[np.float64]]:
    train = waves(times, rng, params["repetitions"])
    return noisy(train, noise, level, rng), train.targets


def _fitted(
    params: Mapping[str, Any],
    setting: Mapping[str, Any],
    patterns: Sequence[SpikeTrains],
    targets: Sequence[NDArray[np.float64]],
) -> learn.ConeR | learn.ConeX:
    options = {**LEARN, **setting, **READINGS[params["reading"]].options}
    with warnings.catch_warnings():
        # Noise may well take a target out of reach; the distance shows it.
        warnings.simplefilter("ignore", UserWarning)
        learner = learn.ConeX if params["learner"] == "cone_x" else learn.ConeR
        return noted(learner(neuron=Neuron(**NEURON), **options).fit(patterns, targets))
