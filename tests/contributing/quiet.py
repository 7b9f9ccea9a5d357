"""How many input spikes an untrained neuron needs until it fires (after thesis 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from taxel.neuron import Neuron
from taxel.spikes import SpikeTrains
from taxel_studies.study import Judgement, Parameters, Row, Summary, grid, results

WHERE = "after thesis 6.2"
PROTOCOL = "Trains of one random spike each, all of one small weight; output spikes within 200 ms."

PARAMETERS: dict[str, Any] = {"inputs": [10, 100, 1000], "weight": 0.01, "realisations": 100}
SIZES = {"toy": {"realisations": 2}}


#: One realisation for each number of inputs and seed.
tasks = partial(grid, inputs="inputs", seed="realisations")


def realise(params: dict[str, Any], seed: int) -> int:
    """Count the spikes of one neuron whose inputs are random trains of 200 ms."""
    random = np.random.default_rng([seed, params["inputs"]])
    trains = SpikeTrains.from_lists(random.uniform(0, 200, (params["inputs"], 1)), stop=200)
    return len(Neuron().run(np.full(params["inputs"], params["weight"]), trains))


def summarise(p: Parameters, rows: Sequence[Row]) -> Summary:
    """Average over realisations."""
    return {str(n): float(np.mean(results(rows, inputs=n))) for n in p["inputs"]}


def judge(p: Parameters, summary: Summary) -> list[Judgement]:
    """Judge claim 300: few weak inputs do not reach the threshold."""
    least = summary[str(min(p["inputs"]))]
    return [Judgement(300, f"{least:g} spikes", least == 0)]


def draw(p: Parameters, summary: Summary) -> Figure:
    """Draw spikes by inputs."""
    figure = Figure(figsize=(5, 3), layout="constrained")
    axes = figure.subplots()
    axes.plot(p["inputs"], [summary[str(n)] for n in p["inputs"]], marker="o")
    axes.set(xlabel="inputs", ylabel="spikes", xscale="log")
    return figure
