"""The explorers of a whole machine: its steady states, its branch, and what lies past the fold."""

from __future__ import annotations

import ipywidgets as widgets
import numpy as np

from hydrolab.explorers.branch_view import BranchView
from hydrolab.explorers.eccentricity_view import STEP, EccentricityView
from hydrolab.explorers.machine_views import guide_bearing
from hydrolab.explorers.past_fold_view import PastFoldView
from hydrolab.explorers.widget import FigureExplorer, slider, wide_enough
from hydrolab.machine.cards import load_machine
from hydrolab.machine.parts import Machine

FEW = 7  # frames of a flip-book: these three explorers stand in one notebook


def eccentricity_explorer(machine: Machine | None = None,
                          eccentricity: float | None = None) -> FigureExplorer:
    """The steady state of a machine at any static eccentricity and on any leg of its branch.

    A click on the branch shows the orbit there; slider and buttons reach the same points from the
    keyboard. machine: by default the card "kaplan-150rpm". eccentricity: in per cent, to begin
    with; by default most of the way to the first fold. Raises BadInput for a machine without an air
    gap, NoConvergence where there is no first steady state.
    """
    view = EccentricityView(machine or load_machine("kaplan-150rpm"))
    legs = view.legs.all
    start = round(0.9 * 100 * legs[0].high, 1) if eccentricity is None else eccentricity
    controls = {
        "eccentricity": slider("static eccentricity, %", start, 0.0,
                               round(104 * max(leg.high for leg in legs), 1), STEP, 2),
        "leg": widgets.ToggleButtons(options=view.names, value=1, description="leg of the branch",
                                     style={"button_width": wide_enough((name
                                                                         for name,
                                                                         _ in view.names), 2.0)}),
    }
    return FigureExplorer(view, view.kept, controls, view.pick, frames=FEW)


def branch_explorer(machine: Machine | None = None,
                    eccentricity: float | None = None) -> FigureExplorer:
    """The whole branch of a machine while its field, unbalance, rotor mass and guide-bearing
    stiffness change.

    A click on the branch shows the orbits at that eccentricity.
    machine: by default the card "kaplan-150rpm". eccentricity: in per cent, where orbits are shown;
    by default a little before the first fold. Raises BadInput for a machine without an air gap,
    NoConvergence where there is no first steady state.
    """
    machine = machine or load_machine("kaplan-150rpm")
    view = BranchView(machine)
    body, bearing = machine.body(machine.air_gap.body), guide_bearing(machine)
    field, mass, stiffness = machine.air_gap.field, body.mass, float(np.abs(bearing.stiffness).max())
    first = 100 * view.card.all[0].high
    start_at = round(0.95 * first, 1) if eccentricity is None else eccentricity
    controls = {
        "eccentricity": slider("static eccentricity, %", start_at, 0.0, round(2 * first, 1), 0.1,
                               1),
        "field": slider("field, T", field, 0.8 * field, 1.12 * field, 0.004 * field, 3),
        "unbalance": slider("unbalance, × the card's", 1.0, 0.1, 2.0, 0.02, 2),
        "mass": slider(f"mass of the {body.name}, t", mass / 1e3, 0.6e-3 * mass, 1.5e-3 * mass,
                       5e-6 * mass, 1),
        "stiffness": slider(f"{bearing.name}, GN/m", stiffness / 1e9, 0.6e-9 * stiffness,
                            2e-9 * stiffness,
                            5e-12 * stiffness, 3),
    }
    start = {name: control.value for name, control in controls.items()}

    def show(eccentricity: float, **values: float) -> str:
        ratio = {name: value / start[name] for name, value in values.items()}
        numbers = {"field": ("field", field), "unbalance": ("unbalance", 1.0),
                   "mass": (f"bodies.{body.name}.mass", mass),
                   "stiffness": (f"bearings.{bearing.name}.stiffness", bearing.stiffness)}
        changes = {key: ratio[name] * value for name, (key, value) in numbers.items()
                   if abs(ratio[name] - 1) > 1e-9}
        return view(eccentricity, changes)

    return FigureExplorer(show, view.kept, controls, view.pick, frames=FEW)


def past_fold_explorer(machine: Machine | None = None, eccentricity: float = 8.5) -> FigureExplorer:
    """Every orbit there is at an eccentricity, stable or not, and the jumps of a machine that is
    brought there slowly.

    A click on the branch brings it to that eccentricity.
    machine: by default the card "kaplan-150rpm". eccentricity: in per cent, to begin with.
    Raises BadInput for a machine without an air gap, NoConvergence where there is no first steady
    state.
    """
    view = PastFoldView(machine or load_machine("kaplan-150rpm"))
    top = round(104 * max(leg.high for leg in view.legs.all), 1)
    where = slider("static eccentricity, %", eccentricity, 0.0, top, STEP, 2)
    return FigureExplorer(view, view.kept, {"eccentricity": where}, view.pick, start=view.begin,
                          frames=FEW)
