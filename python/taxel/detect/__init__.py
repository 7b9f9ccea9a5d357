"""Spikes to detections, live and from recordings, and their score."""

from taxel.detect.readout import Learner, Readout, ReadoutStream, TrainedNeuron, run
from taxel.detect.scoring import Score, Spread, score

__all__ = ["Learner", "Readout", "ReadoutStream", "Score", "Spread", "TrainedNeuron", "run", "score"]
