"""Feet: steps of insoles and footprints, measured as a pressure laboratory does, with every definition named.

It stands beside taxel, uses its public names alone, and brings the commands ``taxel steps`` and ``taxel footprint``.
"""

from taxel_gait.cohort import Cohort, Entry
from taxel_gait.feet import Foot, feet_of
from taxel_gait.footprints import FootprintOptions, Footprints, Person, measure_person, people_of
from taxel_gait.masks import MASKS, Mask, Picture, find_mask, laid_on, mean_picture
from taxel_gait.measuring import Measured, StepOptions, measure
from taxel_gait.prints import Placed, Print, place
from taxel_gait.stances import DEFINITIONS, Definition, Stances, find_stances
from taxel_gait.walk import Step, steps_of

__all__ = [
    "DEFINITIONS",
    "MASKS",
    "Cohort",
    "Definition",
    "Entry",
    "Foot",
    "FootprintOptions",
    "Footprints",
    "Mask",
    "Measured",
    "Person",
    "Picture",
    "Placed",
    "Print",
    "Stances",
    "Step",
    "StepOptions",
    "feet_of",
    "find_mask",
    "find_stances",
    "laid_on",
    "mean_picture",
    "measure",
    "measure_person",
    "people_of",
    "place",
    "steps_of",
]
