"""The trained neuron, of which a readout holds one a label."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.neuron import Neuron


class TrainedNeuron(NamedTuple):
    """A trained neuron: what it is, and the weights with which it fires at a label's events.

    Attributes
    ----------
    neuron : Neuron
    weights : float64, shape (trains,), mV
        In the order of the encoder's trains.
    delay_ms : float, ms, 0 or more
        How much later than the event it was trained to fire.
    inputs : tuple of str
        The parts of a `Composite` encoder whose trains it receives; none stands for all trains of the encoder.

    Raises
    ------
    ProblemError : values that are invalid, when `Readout` gets it
    """

    neuron: Neuron
    weights: NDArray[np.float64]
    delay_ms: float = 0.0
    inputs: tuple[str, ...] = ()
