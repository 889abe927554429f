"""What one moves: sliders above a figure and its reading, in a notebook.

A chapter writes `Explorer(view, name=slider, …)` over its own function from values to a `Picture`,
or takes one of the library's, each in a module with its drawing and its reading: `eccentricity`,
`moving_branch` and `past_fold` (steady states and jumps; a branch in `legs`), `arclength`, `aft`
and `time_steps` (methods), `mesh` and `campbell` (the shaft), `tuning` (the calibration) and
`diagnosis`, `out_of_round` (the gap's shape).

`widget` puts controls beside a `View`, `kept_figure` draws quickly what moves and keeps frames for
pages without a kernel. A new explorer is one module like these, and a line here.
"""

from hydrolab.explorers.aft import harmonics_explorer
from hydrolab.explorers.arclength import arclength_explorer
from hydrolab.explorers.campbell import campbell_explorer
from hydrolab.explorers.diagnosis import diagnosis_explorer
from hydrolab.explorers.eccentricity import eccentricity_explorer
from hydrolab.explorers.kept_figure import KeptFigure
from hydrolab.explorers.mesh import elements_explorer
from hydrolab.explorers.moving_branch import branch_explorer
from hydrolab.explorers.out_of_round import gap_shape_explorer
from hydrolab.explorers.past_fold import past_fold_explorer
from hydrolab.explorers.time_steps import integrator_explorer
from hydrolab.explorers.tuning import calibration_explorer
from hydrolab.explorers.widget import Explorer, FigureExplorer, View, choice, slider, steps, whole

__all__ = ["Explorer", "FigureExplorer", "KeptFigure", "View", "arclength_explorer",
           "branch_explorer", "calibration_explorer", "campbell_explorer", "choice",
           "diagnosis_explorer", "eccentricity_explorer", "elements_explorer",
           "gap_shape_explorer", "harmonics_explorer", "integrator_explorer",
           "past_fold_explorer", "slider", "steps", "whole"]
