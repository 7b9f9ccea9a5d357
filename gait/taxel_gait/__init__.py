"""Feet: steps of insoles, measured as a pressure laboratory does, with every definition named.

It stands beside taxel, uses its public names alone, and brings the command ``taxel steps``.
"""

from taxel_gait.cohort import Cohort, Entry
from taxel_gait.feet import Foot, feet_of
from taxel_gait.measuring import Measured, StepOptions, measure
from taxel_gait.stances import DEFINITIONS, Definition, Stances, find_stances
from taxel_gait.walk import Step, steps_of

__all__ = [
    "DEFINITIONS",
    "Cohort",
    "Definition",
    "Entry",
    "Foot",
    "Measured",
    "Stances",
    "Step",
    "StepOptions",
    "feet_of",
    "find_stances",
    "measure",
    "steps_of",
]
