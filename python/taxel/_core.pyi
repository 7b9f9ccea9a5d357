"""The compiled part of taxel."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

class Error(Exception): ...
class FormatError(Error): ...
class ProblemError(Error): ...
class DeviceError(Error): ...
class SceneError(Error): ...

# the door: what it does with a panic, Ctrl-C, each kind of error (for tests)

def knock(what: str) -> None: ...

# nouns: parts as the nouns' `_parts()` give them

def check_spikes(trains: tuple[Any, ...]) -> None: ...
def check_events(events: tuple[Any, ...]) -> None: ...
def split_by_sign(trains: tuple[Any, ...]) -> tuple[Any, ...]: ...

# detect: detections as (labels, t, known, slope); a tally as (label, said, events, missed, false, near, errors, delays)

_Detections = tuple[list[str], NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]
_Tally = tuple[
    str,
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.int64],
    NDArray[np.int64],
    int,
    NDArray[np.float64],
    NDArray[np.float64],
]

def check_detections(detections: _Detections) -> None: ...
def score(found: _Detections, labels: list[str], t: NDArray[np.int64], windows: NDArray[np.int64]) -> list[_Tally]: ...
def spread(values: NDArray[np.float64]) -> tuple[float, float, float, float, float]: ...

# neuron and metrics: parameters as JSON, trains as parts

def check_neuron(parameters: str) -> str: ...
def neuron_run(
    parameters: str, weights: NDArray[np.float64], trains: tuple[Any, ...], threshold: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def neuron_potential(
    parameters: str,
    weights: NDArray[np.float64],
    trains: tuple[Any, ...],
    times: NDArray[np.float64],
    spikes: NDArray[np.float64],
) -> NDArray[np.float64]: ...
def victor_purpura(a: NDArray[np.float64], b: NDArray[np.float64], q: float) -> float: ...
