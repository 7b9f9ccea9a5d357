"""Spikes to detections, live and from recordings, and their score."""

from taxel.detect.alignment import Alignment as Alignment
from taxel.detect.detector import ReadoutStream as ReadoutStream
from taxel.detect.examples import Example as Example
from taxel.detect.examples import Outcome as Outcome
from taxel.detect.fit import Trained as Trained
from taxel.detect.fit import fit as fit
from taxel.detect.folds import Fold as Fold
from taxel.detect.folds import Part as Part
from taxel.detect.judge import Judged as Judged
from taxel.detect.judge import PlainScore as PlainScore
from taxel.detect.judge import judge as judge
from taxel.detect.plain_rule import PlainRule as PlainRule
from taxel.detect.readout import FittedLearner as FittedLearner
from taxel.detect.readout import Readout as Readout
from taxel.detect.readout import load as load
from taxel.detect.readout import run as run
from taxel.detect.recipe import Recipe as Recipe
from taxel.detect.scoring import Score as Score
from taxel.detect.scoring import Spread as Spread
from taxel.detect.scoring import score as score
from taxel.detect.trained import TrainedNeuron as TrainedNeuron
from taxel.detect.tuning import tune as tune

# The imports above say what is public.
__all__ = [name for name, value in sorted(globals().items()) if callable(value)]
