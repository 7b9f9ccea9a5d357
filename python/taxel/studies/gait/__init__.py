"""Gait events from touch: the protocols of thesis 6.5.2 and 6.5.3 on real recordings.

The files in the order of the way: `sources` (recordings, their truth, their spikes), `insole` (a plate's footfall as an
insole feels it), `pieces`, `folds`, `recipes` (all parameters, as data), `realise` (one fit and its test), `rules` (the
plain rules beside it), `protocols` (in which folds), `plans` (what is run), `report`, `section` (its part of the page
of all studies).
"""

from taxel.studies.gait.plans import study
from taxel.studies.gait.section import GaitStudy

__all__ = ["STUDY", "study"]

STUDY = GaitStudy()
