"""The explorers of the machine: elements, modes over the speed, calibration, diagnosis."""

from __future__ import annotations

from hydrolab.errors import BadInput
from hydrolab.explorers.machine_views import CAUSES, CalibrationView, DiagnosisView
from hydrolab.explorers.model_views import MODES, MOST, CampbellView, ElementsView
from hydrolab.explorers.widget import FigureExplorer, choice, slider, whole
from hydrolab.figures.drawing import RPM
from hydrolab.machine.cards import load_machine
from hydrolab.machine.parts import Machine


def elements_explorer(machine: Machine | None = None) -> FigureExplorer:
    """A shaft, pinned at both ends, in 1 to 16 elements against its exact bending frequencies.

    machine: whose shaft it is; by default the card "kaplan-150rpm". Raises BadInput for a machine
    without a shaft.
    """
    machine = machine or load_machine("kaplan-150rpm")
    if machine.shaft is None:
        raise BadInput(f"{machine.name} has no shaft; an explorer of elements needs one.")
    view = ElementsView(machine.shaft)
    return FigureExplorer(view, view.kept, {"elements": whole("elements", 2, 1, MOST),
                                            "mode": whole("mode", 1, 1, MODES)})


def campbell_explorer(machine: Machine | None = None, to: float | None = None) -> FigureExplorer:
    """The Campbell diagram of a machine up to a speed (rpm), with softer or stiffer bearings and
    less gyroscopic effect.

    machine: by default the card "three-disc". to: by default 1.2 times its rated speed.
    """
    machine = machine or load_machine("three-disc")
    end = 1.2 * machine.speed / RPM if to is None else to
    view = CampbellView(machine, end * RPM)
    return FigureExplorer(view, view.kept, {
        "speed": slider("speed, rpm", round(end / 2), 0, round(end), max(round(end / 200), 1), 0),
        "stiffness": slider("bearing stiffness, × the card's", 1.0, 0.1, 5.0, 0.05, 2),
        "gyroscopic": slider("gyroscopic effect, × the card's", 1.0, 0.0, 1.0, 0.05, 2)})


def calibration_explorer(machine: Machine | None = None) -> FigureExplorer:
    """Find the numbers that a paper does not print: 200 µm when centred, and the first fold from
    8.90 to 8.95 %.

    It starts beside the card's values. machine: with a shaft and an air gap; by default the card
    "kaplan-150rpm". Raises BadInput for a machine without them.
    """
    machine = machine or load_machine("kaplan-150rpm")
    if machine.shaft is None or machine.air_gap is None:
        raise BadInput(f"{machine.name} lacks a shaft or an air_gap; an explorer of the "
                       "calibration needs both.")
    view = CalibrationView(machine)
    nodes, mass = machine.shaft.nodes, view.body.mass / 1e3
    depth = float(nodes[view.bearing.node])
    return FigureExplorer(view, view.kept, {
        "depth": slider(f"depth of the {view.bearing.name}, m", round(1.1 * depth, 2),
                        round(0.75 * depth, 2),
                        round(1.35 * depth, 2), 0.002, 3),
        "mass": slider(f"mass of the {view.body.name}, t", round(mass, 1), round(0.5 * mass),
                       round(1.5 * mass), 0.5, 1),
        "unbalance": slider("unbalance, × the card's", 0.7, 0.3, 2.0, 0.01, 2)}, start=view.begin)


def diagnosis_explorer(machine: Machine | None = None) -> FigureExplorer:
    """One cause of a vibration at a time, and what a sensor at the generator reads.

    machine: with an air gap and a bearing; by default the card "kaplan-150rpm". Raises BadInput for
    one without a gap.
    """
    machine = machine or load_machine("kaplan-150rpm")
    if machine.air_gap is None:
        raise BadInput(f"{machine.name} has no air_gap; an explorer of its vibration needs one.")
    view = DiagnosisView(machine)
    return FigureExplorer(view, view.kept, {"cause": choice("cause", CAUSES[0], list(CAUSES)),
                                            "size": slider("size, share of its range", 0.5, 0.0,
                                                           1.0, 0.02, 2)})
