"""Ctrl-C ends long calls of neurons soon."""

from __future__ import annotations

import numpy as np
import pytest
from interrupts import ctrl_c_after

from taxel import Neuron, SpikeTrains

TRAINS, SPIKES = 100, 200_000
WEIGHTS = np.full(TRAINS, 1e-3)
CALLS = {
    "run": lambda given: Neuron().run(WEIGHTS, given),
    "run on a grid": lambda given: Neuron(time="grid").run(WEIGHTS, given),
    "run_many": lambda given: Neuron().run_many(np.full((64, TRAINS), 1e-3), given),
    "potential": lambda given: Neuron().potential(WEIGHTS, given, np.linspace(0, SPIKES * 10.0, 20_000_000)),
}


@pytest.fixture(scope="module")
def given() -> SpikeTrains:
    """Every train has a spike in each stretch of 10 ms: sorting them by time is much of the work."""
    return SpikeTrains.from_lists([np.arange(SPIKES) * 10.0 + n * 0.0999 for n in range(TRAINS)], stop=SPIKES * 10.0)


@pytest.mark.parametrize("name", CALLS)
def test_control_c_answers_soon(name: str, given: SpikeTrains) -> None:
    # Half a second is the goal, and .15 to .27 s was measured; a loaded machine needs more.
    with ctrl_c_after(0.3, answered_within=2):
        CALLS[name](given)
