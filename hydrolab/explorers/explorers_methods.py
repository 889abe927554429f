"""The explorers of methods: time steps, harmonics and samples, steps along a curve, elements,
Campbell diagram.
"""

from __future__ import annotations

from hydrolab.explorers.arclength_view import CURVES, WAYS, ArclengthView
from hydrolab.explorers.method_views import METHODS, SAMPLES, STEPS, HarmonicsView, IntegratorView
from hydrolab.explorers.widget import FigureExplorer, choice, slider, steps, whole
from hydrolab.machine.cards import load_machine
from hydrolab.machine.parts import Machine


def integrator_explorer(machine: Machine | None = None,
                        eccentricity: float = 7.0) -> FigureExplorer:
    """A method of time integration and its step, against a known orbit at an eccentricity (%).

    machine: by default the card "jeffcott". Raises NoConvergence where there is no such orbit.
    """
    view = IntegratorView(machine or load_machine("jeffcott"), eccentricity / 100)
    return FigureExplorer(view, view.kept, {"method": choice("method", "central difference",
                                                             list(METHODS)),
                                            "steps": steps("steps in a revolution", 32, STEPS)},
                          start=view.begin)


def harmonics_explorer(machine: Machine | None = None, eccentricity: float = 5.0,
                       leg: int = 2) -> FigureExplorer:
    """Harmonics kept and samples taken in harmonic balance, against many of both, at an
    eccentricity (%).

    machine: by default the card "jeffcott". leg: which of the steady states there is, in the order
    in which the branch meets them; the second of that rotor is wide, so that few harmonics are
    visibly too few. Raises BadInput where there is no such steady state.
    """
    view = HarmonicsView(machine or load_machine("jeffcott"), eccentricity / 100, leg)
    return FigureExplorer(view, view.kept, {"harmonics": whole("harmonics", 2, 1, view.most),
                                            "samples": steps("samples in a revolution", 8,
                                                             SAMPLES)})


def arclength_explorer() -> FigureExplorer:
    """Natural and arclength continuation on a circle, an S and the static pull-in curve, with steps
    of one length.
    """
    view = ArclengthView()
    return FigureExplorer(view, view.kept, {"curve": choice("curve", "circle", list(CURVES)),
                                            "way": choice("continuation", WAYS[0], list(WAYS)),
                                            "step": slider("length of a step", 0.2, 0.02, 0.6,
                                                           0.02, 2),
                                            "count": whole("steps", 12, 1, 60)})
