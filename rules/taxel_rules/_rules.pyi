"""The compiled part of taxel_rules: parameters as JSON."""

from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from taxel import SpikeTrains

# what is known of a learner's parameters (defaults, required, ranges); one's, with every default filled in

def parameters(of: str) -> dict[str, Any]: ...
def check_parameters(of: str, parameters: str) -> dict[str, Any]: ...

@final
class Trained:
    """What training found: weights, the share of right patterns by epoch, how it ended, a pending KeyboardInterrupt."""

    weights: Final[NDArray[np.float64]]
    right: Final[NDArray[np.float64]]
    best_epoch: Final[int]
    ended: Final[str]
    raised: Final[BaseException | None]

def rule_names() -> list[str]: ...
def fit_epochs(
    parameters: str,
    patterns: list[SpikeTrains],
    targets: list[NDArray[np.float64]],
    start: NDArray[np.float64] | None,
    progress: Any,
) -> Trained: ...
def change_epochs(
    parameters: str, weights: NDArray[np.float64], pattern: SpikeTrains, targets: NDArray[np.float64]
) -> list[NDArray[np.float64]]: ...
def run_epochs(parameters: str, weights: NDArray[np.float64], pattern: SpikeTrains) -> NDArray[np.float64]: ...
def rows_skim(parameters: str, patterns: list[SpikeTrains], targets: list[NDArray[np.float64]] | None) -> list[int]: ...
def fit_tempotron(
    parameters: str,
    patterns: list[SpikeTrains],
    labels: list[bool],
    start: NDArray[np.float64] | None,
    progress: Any,
) -> Trained: ...
def peak_tempotron(
    parameters: str, weights: NDArray[np.float64], pattern: SpikeTrains
) -> tuple[float, float, float]: ...
def change_tempotron(
    parameters: str, weights: NDArray[np.float64], pattern: SpikeTrains, label: bool
) -> NDArray[np.float64]: ...

@final
class STDP:
    def __new__(cls, parameters: str, trains: int) -> STDP: ...
    @property
    def weights(self) -> NDArray[np.float64]: ...
    def set_weights(self, weights: NDArray[np.float64]) -> None: ...
    def rest(self) -> None: ...
    def push(self, piece: SpikeTrains, learn: bool) -> NDArray[np.float64]: ...
