"""Gait events from touch: the protocols of thesis 6.5.2 and 6.5.3 on real recordings.

The files in the order of the way: `sources` (recordings, their truth, their spikes), `insole` (a plate's footfall as an
insole feels it), `pieces`, `folds`, `recipes` (all parameters, as data), `rules` (the plain rules beside the neuron),
`protocols` (in which folds), `realise` (one fit and its test), `plans` (what is run), `outcomes` (what it comes to),
`statements` and `pictures` (what the page shows), `study`.
"""

from taxel_studies.gait.study import STUDY

__all__ = ["STUDY"]
