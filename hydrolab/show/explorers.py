"""Explorers: controls above one kept figure, its reading as text below. What is seen is decided by plain views.

A view takes the controls' values, changes its kept figure and returns the reading; it knows no widget. The browser
holds back a slider's moves while the last one is being drawn and sends the newest afterwards, so a fast drag never
queues up.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping
from typing import Any

import ipywidgets as widgets
import numpy as np

from hydrolab.machine.parts import Machine, RadialBearing
from hydrolab.show.branch_view import BranchView
from hydrolab.show.eccentricity_view import EccentricityView
from hydrolab.show.flipbook import MIME, Frame, flipbook, main_control, shown, slider_values
from hydrolab.show.kept_figure import KeptFigure
from hydrolab.show.picture import Picture


class FigureExplorer(widgets.VBox):
    """Controls, a reset button, a picture and its reading.

    view: from the controls' values, by name, to the reading. kept: the figure that it changes. Where there is no
    kernel, as in a stored notebook, the first picture and its reading stand in its place, and in the static book a
    flip-book along the first slider.
    """

    def __init__(self, view: Callable[..., str], kept: KeptFigure, controls: Mapping[str, Any]) -> None:
        self.view, self.kept, self.controls = view, kept, dict(controls)
        self.initial = {name: control.value for name, control in controls.items()}
        self.image = widgets.Image(format="png", layout={"width": f"{kept.width}px", "max_width": "98%",
                                                         "object_fit": "contain"})
        self.words = widgets.HTML()
        self.reset = widgets.Button(description="Reset", tooltip="Back to the first values", layout={"width": "7em"})
        self.reset.on_click(self._back)
        for control in self.controls.values():
            control.style.description_width = "13em"
            control.observe(self._show, "value")
        self.reading = self._show()
        self._first = Picture(kept.figure, self.reading)._repr_mimebundle_()  # now, while the figure shows it
        self._first |= self._flipbook()
        super().__init__([*self.controls.values(), self.reset, self.image, self.words])

    def _flipbook(self) -> dict[str, str]:
        """What the view shows along the first slider, the other controls as they stand."""
        main = main_control(self.controls.values())
        if main is None:
            return {}
        name = next(name for name, control in self.controls.items() if control is main)
        values, frames = slider_values(main), []
        for value in values:
            said = self.view(**self.initial | {name: value})
            frames.append(Frame(shown(main, value), said, self.kept.pixels().copy()))
        self._show()
        return {MIME: flipbook(main.description, frames, values.index(main.value))}

    def _show(self, change: Any = None) -> str:
        """Ask the view and show its figure and its words."""
        self.reading = self.view(**{name: control.value for name, control in self.controls.items()})
        self.image.value = self.kept.png()
        self.words.value = ('<div role="status" aria-live="polite" style="line-height: 1.5; max-width: 68em">'
                            f"{html.escape(self.reading)}</div>")
        return self.reading

    def _back(self, button: widgets.Button) -> None:
        """Put every control back, and draw once."""
        for control in self.controls.values():
            control.unobserve(self._show, "value")
        for name, control in self.controls.items():
            control.value = self.initial[name]
            control.observe(self._show, "value")
        self._show()

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return super()._repr_mimebundle_(**kwargs) | self._first


def slider(description: str, value: float, low: float, high: float, step: float, digits: int) -> widgets.FloatSlider:
    """A slider in the explorers' layout, sent while it moves."""
    return widgets.FloatSlider(value=value, min=low, max=high, step=step, description=description,
                               readout_format=f".{digits}f", layout={"width": "min(46em, 98%)"})


def eccentricity_explorer(machine: Machine, eccentricity: float | None = None) -> FigureExplorer:
    """The steady state of a machine at any static eccentricity and on any leg of its branch.

    eccentricity: in per cent, to begin with; by default most of the way to the first fold.
    Raises BadInput for a machine without an air gap, NoConvergence where there is no first steady state.
    """
    view = EccentricityView(machine)
    legs = view.legs.all
    start = round(0.9 * 100 * legs[0].high, 1) if eccentricity is None else eccentricity
    controls = {
        "eccentricity": slider("static eccentricity, %", start, 0.0, round(104 * max(leg.high for leg in legs), 1), 0.05, 2),
        "leg": widgets.ToggleButtons(options=view.names, value=1, description="leg of the branch",
                                     style={"button_width": "11em"}),
    }
    return FigureExplorer(view, view.kept, controls)


def guide_bearing(machine: Machine) -> RadialBearing:
    """The radial bearing nearest to the body in the air gap."""
    home = machine.body(machine.air_gap.body).node
    return min(machine.bearings, key=lambda bearing: abs(bearing.node - home))


def branch_explorer(machine: Machine, eccentricity: float | None = None) -> FigureExplorer:
    """The whole branch of a machine while its field, unbalance, rotor mass and guide-bearing stiffness change.

    eccentricity: in per cent, where orbits are shown; by default a little before the first fold.
    Raises BadInput for a machine without an air gap, NoConvergence where there is no first steady state.
    """
    view = BranchView(machine)
    body, bearing = machine.body(machine.air_gap.body), guide_bearing(machine)
    field, mass, stiffness = machine.air_gap.field, body.mass, float(np.abs(bearing.stiffness).max())
    first = 100 * view.card.all[0].high
    controls = {
        "eccentricity": slider("static eccentricity, %", round(0.95 * first, 1), 0.0, round(2 * first, 1), 0.1, 1)
        if eccentricity is None else slider("static eccentricity, %", eccentricity, 0.0, round(2 * first, 1), 0.1, 1),
        "field": slider("field, T", field, 0.8 * field, 1.12 * field, 0.004 * field, 3),
        "unbalance": slider("unbalance, × the card's", 1.0, 0.1, 2.0, 0.02, 2),
        "mass": slider(f"mass of the {body.name}, t", mass / 1e3, 0.6e-3 * mass, 1.5e-3 * mass, 5e-6 * mass, 1),
        "stiffness": slider(f"{bearing.name}, GN/m", stiffness / 1e9, 0.6e-9 * stiffness, 2e-9 * stiffness,
                            5e-12 * stiffness, 3),
    }
    start = {name: control.value for name, control in controls.items()}

    def show(eccentricity: float, **values: float) -> str:
        ratio = {name: value / start[name] for name, value in values.items()}
        numbers = {"field": ("field", field), "unbalance": ("unbalance", 1.0),
                   "mass": (f"bodies.{body.name}.mass", mass),
                   "stiffness": (f"bearings.{bearing.name}.stiffness", bearing.stiffness)}
        changes = {key: ratio[name] * value for name, (key, value) in numbers.items() if abs(ratio[name] - 1) > 1e-9}
        return view(eccentricity, changes)

    return FigureExplorer(show, view.kept, controls)
