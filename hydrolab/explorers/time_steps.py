"""A method of time integration and its step, against a known orbit."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.integrate import CentralDifference, Newmark, integrate
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.explorers.widget import FigureExplorer, KeptFigure, View, choice, steps
from hydrolab.figures.drawing import REVOLUTION, UM
from hydrolab.figures.readings import microns, vibration
from hydrolab.figures.style import COLOURS, house_style, new_figure, plane
from hydrolab.machine import Machine, load_machine

METHODS = {"central difference": CentralDifference, "Newmark, γ = 1/2": Newmark,
           "Newmark, γ = 0.6": lambda n: Newmark(n, beta=0.3025, gamma=0.6)}  # β = (γ + 1/2)²/4
MARKS = dict(zip(METHODS, (("o", COLOURS["x"]), ("s", COLOURS["z"]), ("^", COLOURS["2X"])),
                 strict=True))
STEPS = [8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256]
ENDS = np.array([6.0, 340.0])  # of the axis of steps
REVOLUTIONS = 20


class IntegratorView(View):
    """What a method of time integration makes of a known orbit in 20 revolutions, and how its error
    falls with the step.

    The motion starts on the orbit, which harmonic balance with 16 harmonics gives. Every pair of
    method and step that was looked at leaves a mark.
    """

    @house_style()
    def __init__(self, machine: Machine, eccentricity: float = 0.07) -> None:
        self.model, self.speed = machine.model(), machine.speed
        self.orbit = HarmonicBalance(harmonics=16).solve(self.model, self.speed, eccentricity)
        self.size = vibration(self.orbit)
        if not self.size:
            raise BadInput(f"{machine.name} does not vibrate here; an explorer of a method's error "
                           "needs an unbalance.")
        self.errors: dict[tuple[str, int], float] = {}
        figure = new_figure(11, 5)
        left, right = figure.subplots(1, 2)
        plane(left, f"Revolution {REVOLUTIONS} about the mean, µm")
        left.set(xlabel="x, µm", ylabel="z, µm")
        exact = UM * (self.orbit.positions(REVOLUTION) - self.orbit.mean[:, None])
        left.plot(*exact, color="#C8C8C8", linewidth=7, label="the orbit")
        size = 1.5 * float(np.abs(exact).max())
        left.set(adjustable="box", xlim=(-size, size), ylim=(-size, size))
        self.path, = left.plot([], [], label="computed")
        left.legend(loc="upper right")
        right.set(xscale="log", yscale="log", xlim=ENDS, ylim=(1e-2, 1e4),
                  xlabel="steps in a revolution", ylabel="largest distance from the orbit, µm",
                  title="Error, and the slope of the method's order")
        right.set_xticks(STEPS, STEPS, fontsize=10)
        right.minorticks_off()
        self.slope, = right.plot([], [], ":", color=COLOURS["axis"])
        self.seen = {name: right.plot([], [], mark, color=colour, linestyle="none",
                                      label=name)[0]
                     for name, (mark, colour) in MARKS.items()}
        self.here, = right.plot([], [], "o", markersize=15, fillstyle="none",
                                color=COLOURS["mean"])
        right.legend(loc="upper right")
        self.kept = KeptFigure(figure, [self.path, self.slope, self.here, *self.seen.values()])

    def begin(self) -> None:
        """Forget what was looked at."""
        self.errors.clear()

    def __call__(self, method: str, steps: int) -> str:
        """Show a method with a number of steps in a revolution; return the reading."""
        chosen = METHODS[method](steps)
        with threadpool_limits(1):
            motion = integrate(self.model, chosen, speed=self.speed, start=self.orbit, modes=None,
                               static_eccentricity=self.orbit.static_eccentricity,
                               revolutions=REVOLUTIONS)
        if not motion.finished:
            raise NoConvergence(f"{method} with {steps} steps in a revolution does not get "
                                f"through. {motion.stopped}")
        times, path = motion.last(1)
        error = UM * float(np.hypot(*(path - self.orbit.positions(self.speed * times))).max())
        self.errors[method, steps] = error
        self.path.set_data(*(UM * (path - self.orbit.mean[:, None])))
        self.path.set_color(MARKS[method][1])
        for name, line in self.seen.items():
            found = sorted((n, e) for (who, n), e in self.errors.items() if who == name)
            line.set_data(*zip(*found, strict=True) if found else ([], []))
        self.here.set_data([steps], [error])
        self.slope.set_data(ENDS, error * (ENDS / steps) ** -chosen.order)
        return (f"{method} (order {chosen.order}) with {steps} steps in a revolution is "
                f"{error:.3g} µm off after {REVOLUTIONS} revolutions, "
                f"{100 * error / (UM * self.size):.2g} % of the vibration, which reaches "
                f"{microns(self.size)}.")


def integrator_explorer(machine: Machine | None = None,
                        eccentricity: float = 7.0) -> FigureExplorer:
    """A method of time integration and its step, against a known orbit at an eccentricity (%).

    machine: by default the card "jeffcott". Raises NoConvergence where there is no such orbit.
    """
    view = IntegratorView(machine or load_machine("jeffcott"), eccentricity / 100)
    return FigureExplorer(view, {"method": choice("method", "central difference", list(METHODS)),
                                 "steps": steps("steps in a revolution", 32, STEPS)})
