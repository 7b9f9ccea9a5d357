"""Feet: steps of insoles and footprints, measured as a pressure laboratory does, with every definition named.

It stands beside taxel, uses its public names alone, and brings the commands ``taxel steps`` and ``taxel footprint``.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

#: The module of each name, which is imported at its first access, so that a command starts quickly.
_MODULES = {
    "cohort": "Cohort Entry",
    "feet": "Foot feet_of",
    "footprints": "FootprintOptions Footprints Person measure_person people_of",
    "masks": "MASKS Mask Picture find_mask laid_on mean_picture",
    "measuring": "Measured StepOptions measure",
    "prints": "Placed Print place",
    "stances": "DEFINITIONS Definition Stances find_stances",
    "walk": "Step steps_of",
}


def __getattr__(name: str) -> Any:
    """Import a name at its first access."""
    for module, names in _MODULES.items():
        if name in names.split():
            return getattr(import_module(f"taxel_gait.{module}"), name)
    raise AttributeError(f"module 'taxel_gait' has no attribute {name!r}")
