"""What one moves: a figure with sliders, the same in a cell, in the static book and in a test.

`widget` holds the base and the controls; each explorer is a view that draws and reads one thing,
and a function that puts sliders on it.
"""

from hydrolab.explorers.explorers import (
    branch_explorer,
    eccentricity_explorer,
    past_fold_explorer,
)
from hydrolab.explorers.explorers_machine import (
    calibration_explorer,
    campbell_explorer,
    diagnosis_explorer,
    elements_explorer,
)
from hydrolab.explorers.explorers_methods import (
    arclength_explorer,
    harmonics_explorer,
    integrator_explorer,
)
from hydrolab.explorers.explorers_rotor import (
    gap_explorer,
    gap_shape_explorer,
    jeffcott_explorer,
)
from hydrolab.explorers.widget import Explorer

__all__ = [
    "Explorer", "arclength_explorer", "branch_explorer", "calibration_explorer",
    "campbell_explorer", "diagnosis_explorer", "eccentricity_explorer", "elements_explorer",
    "gap_explorer", "gap_shape_explorer", "harmonics_explorer", "integrator_explorer",
    "jeffcott_explorer", "past_fold_explorer",
]
