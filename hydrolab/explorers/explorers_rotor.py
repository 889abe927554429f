"""The explorers of a disc in a field: response to unbalance, gap and pull, gaps that are not round.
"""

from __future__ import annotations

from hydrolab.explorers.rotor_views import SHAPES, GapShapeView, GapView, JeffcottView
from hydrolab.explorers.widget import FigureExplorer, choice, slider
from hydrolab.figures.drawing import RPM
from hydrolab.machine.cards import load_machine
from hydrolab.machine.parts import Machine


def jeffcott_explorer(machine: Machine | None = None) -> FigureExplorer:
    """The whirl of a Jeffcott rotor over speed and damping, without field.

    machine: a point mass on springs; by default the card "jeffcott". Raises BadInput for a machine
    with a shaft.
    """
    machine = machine or load_machine("jeffcott")
    view = JeffcottView(machine)
    return FigureExplorer(view, view.kept, {"speed": slider("speed, rpm",
                                                            round(machine.speed / RPM), 5,
                                                            view.top, 5, 0),
                                            "damping": slider("damping ratio, %", 1.0, 0.5, 20.0,
                                                              0.5, 1)})


def gap_explorer(machine: Machine | None = None) -> FigureExplorer:
    """A rotor displaced in its gap, the magnetic pressure around it, and the pull.

    machine: by default the card "jeffcott". Raises BadInput for a machine without an air gap.
    """
    machine = machine or load_machine("jeffcott")
    view = GapView(machine)
    field = machine.air_gap.field
    return FigureExplorer(view, view.kept, {
        "displacement": slider("displacement, % of the gap", 20, -70, 70, 1, 0),
        "field": slider("field, T", field, 0.0, round(1.5 * field, 2), 0.01, 2)})


def gap_shape_explorer(machine: Machine | None = None) -> FigureExplorer:
    """The pull in a stator that is not round: oval, with three lobes, with four.

    machine: by default the card "jeffcott". Raises BadInput for a machine without an air gap.
    """
    view = GapShapeView(machine or load_machine("jeffcott"))
    return FigureExplorer(view, view.kept, {"shape": choice("shape of the stator", "oval",
                                                            list(SHAPES)),
                                            "depth": slider("depth, % of the gap", 10, 0, 40, 1, 0),
                                            "displacement": slider("displacement, % of the gap",
                                                                   20, 0, 60, 1, 0),
                                            "direction": slider("its direction, °", 45, 0, 360, 5,
                                                                0)})
