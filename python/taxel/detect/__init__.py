"""Spikes to detections, live and from recordings, and their score."""

from taxel.detect.alignment import Alignment
from taxel.detect.examples import Example, Outcome
from taxel.detect.folds import Fold, Judged, Part, choose, judge
from taxel.detect.readout import Learner, Readout, ReadoutStream, run
from taxel.detect.scoring import Score, Spread, score
from taxel.detect.trained import TrainedNeuron
from taxel.detect.training import Recipe, Trained, train

__all__ = [
    "Alignment",
    "Example",
    "Fold",
    "Judged",
    "Learner",
    "Outcome",
    "Part",
    "Readout",
    "ReadoutStream",
    "Recipe",
    "Score",
    "Spread",
    "Trained",
    "TrainedNeuron",
    "choose",
    "judge",
    "run",
    "score",
    "train",
]
