"""Spikes to detections, live and from recordings, and their score."""

from taxel.detect.folds import Judged, choose, judge
from taxel.detect.readout import Learner, Readout, ReadoutStream, run
from taxel.detect.scoring import Score, Spread, score
from taxel.detect.trained import TrainedNeuron
from taxel.detect.training import Example, Recipe, train

__all__ = [
    "Example",
    "Judged",
    "Learner",
    "Readout",
    "ReadoutStream",
    "Recipe",
    "Score",
    "Spread",
    "TrainedNeuron",
    "choose",
    "judge",
    "run",
    "score",
    "train",
]
