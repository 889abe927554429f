"""How many elements a shaft needs, against its exact bending frequencies."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from hydrolab.explorers.legs import machine_with
from hydrolab.explorers.widget import FigureExplorer, View, at_work, whole
from hydrolab.figures.drawing import PALE
from hydrolab.figures.style import COLOURS
from hydrolab.machine import Machine, RadialBearing, Shaft

COLOUR = COLOURS["x"], COLOURS["z"], COLOURS["2X"], COLOURS["3X"]  # of the modes
MOST = 16  # elements


class ElementsView(View):
    """A shaft pinned at both ends in 1 to 16 Timoshenko elements, against its exact bending
    frequencies.

    The exact shapes are sines, and each frequency follows from a quadratic (S. P. Timoshenko,
    1921): E I k⁴ − ω² (ρA + ρI k² + ρ E I k²/(κG)) + ω⁴ ρ² I/(κG) = 0 with k = nπ/L.
    """

    @at_work()
    def __init__(self, shaft: Shaft) -> None:
        self.shaft = _uniform(shaft, 1)
        self.exact = np.array([self._frequency(n) for n in range(1, len(COLOUR) + 1)])
        self.found = [self.modes(count) for count in range(1, MOST + 1)]
        left, right = self.panels(11, 5, 2)
        self.y = np.linspace(0, 1, 201)
        self.sine = self.line(left, color=PALE, linewidth=7, label="exact")
        self.shape = self.line(left, "o-", color=COLOURS["rotor"], label="at the nodes")
        left.set(xlim=(0, 1), ylim=(-1.25, 1.25), xlabel="depth / length", title="Shape")
        left.legend(loc="upper right", ncols=2)
        for n, colour in enumerate(COLOUR):
            known = [(count, 100 * (f[n] / self.exact[n] - 1))
                     for count, (f, _) in enumerate(self.found, 1) if len(f) > n]
            right.plot(*zip(*known, strict=True), color=colour, marker=".", label=f"mode {n + 1}")
        right.set(xscale="log", yscale="log", xlim=(0.9, 18), ylim=(1e-4, 300),
                  xlabel="elements", title="Frequency too high by, %")
        right.set_xticks([1, 2, 3, 4, 6, 8, 12, 16], [1, 2, 3, 4, 6, 8, 12, 16])
        right.minorticks_off()
        right.legend(loc="lower left")
        self.here = self.line(right, "o", markersize=14, fillstyle="none", color=COLOURS["mean"])

    def _frequency(self, n: int) -> float:
        s = self.shaft
        area, second = float(s.area[0]), float(s.second_moment[0])
        shear = s.shear_coefficient * s.young / (2 * (1 + s.poisson))
        k = n * math.pi / s.length
        a, c = s.density**2 * second / shear, s.young * second * k**4
        b = s.density * (area + second * k**2 + s.young * second * k**2 / shear)
        return math.sqrt(2 * c / (b + math.sqrt(b * b - 4 * a * c)))

    def modes(self, count: int) -> tuple[NDArray, NDArray]:
        """Frequencies (rad/s, ascending) and shapes x at the nodes (nodes, modes) of the bending in
        (x, y), in so many elements.
        """
        # a machine needs some; pinned below
        ends = RadialBearing("top", 0, 1.0), RadialBearing("bottom", count, 1.0)
        model = Machine("shaft", 0.0, _uniform(self.shaft, count), (), ends).model()
        # x inside, every θz
        free = [4 * i + dof for i in range(count + 1) for dof in (0, 3) if dof or 0 < i < count]
        squares, vectors = eigh(model.K[np.ix_(free, free)], model.M[np.ix_(free, free)])
        shapes = np.zeros((count + 1, len(free)))
        shapes[1:-1] = vectors[[i for i, dof in enumerate(free) if dof % 4 == 0]]
        return np.sqrt(squares), shapes

    def __call__(self, elements: int, mode: int) -> str:
        """Show a mode of the shaft in so many elements; return the reading."""
        frequencies, shapes = self.found[elements - 1]
        nodes = np.linspace(0, 1, elements + 1)
        sine, at_nodes = (np.sin(mode * math.pi * y) for y in (self.y, nodes))
        self.sine.set_data(self.y, sine)
        with_elements = f"With {elements} element{'s' * (elements > 1)}"
        if len(frequencies) < mode:
            for line in (self.shape, self.here):
                line.set_data([], [])
            return f"{with_elements} there is no mode {mode}."
        # as large as the sine at the nodes; nothing where those are all at rest
        square = at_nodes @ at_nodes
        shape = shapes[:, mode - 1]
        size = shape @ at_nodes / square if square > 1e-9 else math.inf
        self.shape.set_data(nodes, shape / size)
        found, exact = frequencies[mode - 1], self.exact[mode - 1]
        error = 100 * (found / exact - 1)
        self.here.set_data([elements], [error])
        return (f"{with_elements} mode {mode} is at {found / 2 / math.pi:.3f} Hz, {error:.3g} % "
                f"above the exact {exact / 2 / math.pi:.3f} Hz.")


def _uniform(shaft: Shaft, count: int) -> Shaft:
    """A shaft's length in equal Timoshenko elements of its mean diameters and material."""
    mean = {name: float(np.mean(getattr(shaft, name)))
            for name in ("diameter", "inner_diameter", "young", "density", "poisson")}
    return replace(shaft, nodes=np.linspace(0, shaft.length, count + 1), element="timoshenko",
                   lower_diameter=0.0, **mean)


def elements_explorer(machine: Machine | None = None) -> FigureExplorer:
    """A shaft, pinned at both ends, in 1 to 16 elements against its exact bending frequencies.

    machine: whose shaft it is; by default the card "kaplan-150rpm". Raises BadInput for a machine
    without a shaft.
    """
    view = ElementsView(machine_with(machine, "kaplan-150rpm", "shaft").shaft)
    return FigureExplorer(view, {"elements": whole("elements", 2, 1, MOST),
                                 "mode": whole("mode", 1, 1, len(COLOUR))})
