"""A classifier of Tempotrons, one a class."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.information.spiking import NeuronPerClass
from taxel.spikes import SpikeTrains
from taxel_rules.tempotron import Tempotron


class TempotronReadout(NeuronPerClass):
    """Classify by a `Tempotron` a class, taught to fire on its own class and on no other.

    Parameters
    ----------
    tau : float, ms, above 0
    epochs : int, 1 or more
    max_seconds : float, above 0
        Of training a neuron.
    seed : int, 0 or more

    Attributes
    ----------
    classes_ : shape (classes,)
    learners_ : list of Tempotron

    Raises
    ------
    ProblemError : a parameter that is invalid

    Notes
    -----
    Gütig and Sompolinsky (2006), Nature Neuroscience 9:420. The class of the highest peak is predicted.
    """

    learners_: list[Tempotron]

    def __init__(self, *, tau: float = 15.0, epochs: int = 100, max_seconds: float = 10.0, seed: int = 0) -> None:
        self.tau = tau
        self.epochs = epochs
        self.max_seconds = max_seconds
        self.seed = seed
        super().__init__()

    def _check(self) -> None:
        self._learner()

    def _learner(self) -> Tempotron:
        return Tempotron(tau=self.tau, epochs=self.epochs, max_seconds=self.max_seconds, seed=self.seed)

    def _trained(self, trains: list[SpikeTrains], is_of_class: NDArray[np.bool_]) -> Tempotron:
        return self._learner().fit(trains, is_of_class)

    def _potential(self, learner: Tempotron, trains: SpikeTrains) -> float:
        return learner.peak(learner.weights_, trains)[0]
