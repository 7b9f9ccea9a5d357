"""Spikes to detections, live and from recordings, and their score."""

from taxel.detect.alignment import Alignment
from taxel.detect.detector import ReadoutStream
from taxel.detect.examples import Example, Outcome
from taxel.detect.folds import Fold, Judged, Part, choose, judge
from taxel.detect.plain_rule import PlainRule
from taxel.detect.plain_score import PlainScore
from taxel.detect.readout import Learner, Readout, load, run
from taxel.detect.recipe import Recipe
from taxel.detect.scoring import Score, Spread, score
from taxel.detect.trained import TrainedNeuron
from taxel.detect.training import Trained, train
from taxel.detect.tuning import tune

__all__ = [
    "Alignment",
    "Example",
    "Fold",
    "Judged",
    "Learner",
    "Outcome",
    "Part",
    "PlainRule",
    "PlainScore",
    "Readout",
    "ReadoutStream",
    "Recipe",
    "Score",
    "Spread",
    "Trained",
    "TrainedNeuron",
    "choose",
    "judge",
    "load",
    "run",
    "score",
    "train",
    "tune",
]
