"""What a readout holds of each label."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.neuron import Neuron

__all__ = ["TrainedNeuron"]


class TrainedNeuron(NamedTuple):
    """A neuron with the weights (mV) it was trained to, and how much later than the event it fires (ms)."""

    neuron: Neuron
    weights: NDArray[np.float64]
    delay_ms: float = 0.0
