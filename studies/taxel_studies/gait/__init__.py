"""Gait events from touch: the protocols of thesis 6.5.2 and 6.5.3 on real recordings.

The files in the order of their use: `sources` (recordings, their truth, their spikes), `insole` (the cells of an insole
under a footfall on a plate), `pieces`, `recipes` (all parameters, as data), `rules` (the plain rules beside the
neuron), `search` (the settings around Table 6.2), `protocols` (which folds), `fits` (one fit and its test), `outcomes`
(the fits of a run and their summary), `judgement` (claims and tables) and `pictures`.
"""

from taxel_studies.gait.fits import realise
from taxel_studies.gait.judgement import judge, tables
from taxel_studies.gait.outcomes import PARAMETERS, SIZES, summarise, tasks
from taxel_studies.gait.pictures import draw
from taxel_studies.gait.sources import SOURCES

__all__ = ["PARAMETERS", "SIZES", "draw", "judge", "realise", "summarise", "tables", "tasks"]

WHERE = "thesis 6.5, figures 6.12 to 6.14, Table 6.2"
PROTOCOL = (
    "The protocols of 6.5.2 and 6.5.3 on recordings of other people, as far as each recording's truth allows. "
    "Errors are neuron minus reference (negative: early), window ±50 ms, one to one; every further spike counts as "
    "false, inside the window too. Where parameters are chosen, they are chosen inside each training fold."
)
DATA = tuple(dict.fromkeys(source.folder for source in SOURCES.values()))
