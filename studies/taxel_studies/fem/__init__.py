"""Finite elements: a half disc pressed on silicone (thesis 5.4.1), by a solver of our own on SciPy.

Plane stress, an incompressible Yeoh solid in closed form, large sliding with friction; 75 paths serve the 300
conditions of Table 5.1.
"""

from __future__ import annotations

from taxel_studies.fem.conditions import TABLE_5_1, Condition, conditions, paths
from taxel_studies.fem.grid import SamplingGrid
from taxel_studies.fem.indentation import Course, Indentation, bodies, press
from taxel_studies.fem.material import DRAGON_SKIN_10, Yeoh
from taxel_studies.fem.mesh import Mesh

__all__ = [
    "DRAGON_SKIN_10",
    "TABLE_5_1",
    "Condition",
    "Course",
    "Indentation",
    "Mesh",
    "SamplingGrid",
    "Yeoh",
    "bodies",
    "conditions",
    "paths",
    "press",
]
