"""A method of time integration and its step, against a known orbit."""

from __future__ import annotations

import numpy as np

from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.integrate import CentralDifference, Newmark, integrate
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.explorers.widget import FigureExplorer, View, at_work, choice, steps
from hydrolab.figures.drawing import UM, about_mean, close_up
from hydrolab.figures.readings import microns
from hydrolab.figures.style import COLOURS
from hydrolab.machine import Machine, load_machine

METHODS = {
    "central difference": (CentralDifference, "o", COLOURS["x"]),
    "Newmark, γ = 1/2": (Newmark, "s", COLOURS["z"]),
    # β = (γ + 1/2)²/4
    "Newmark, γ = 0.6": (lambda n: Newmark(n, beta=0.3025, gamma=0.6), "^", COLOURS["2X"])}
STEPS = [8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256]
ENDS = np.array([6.0, 340.0])  # of the axis of steps
REVOLUTIONS = 20


class IntegratorView(View):
    """What a method makes of an orbit of harmonic balance with 16 harmonics that it starts on, and
    its error; every pair of method and step that was looked at leaves a mark.
    """

    @at_work()
    def __init__(self, machine: Machine, eccentricity: float) -> None:
        self.model, self.speed = machine.model(), machine.speed
        self.orbit = HarmonicBalance(harmonics=16).solve(self.model, self.speed, eccentricity)
        self.size = self.orbit.vibration
        if not self.size:
            raise BadInput(f"{machine.name} does not vibrate here; an explorer of a method's error "
                           "needs an unbalance.")
        self.errors: dict[tuple[str, int], float] = {}
        left, right = self.panels(11, 5, 2)
        exact = about_mean(self.orbit)
        close_up(left, f"Revolution {REVOLUTIONS} about the mean, µm", exact, "the orbit",
                 1.5 * float(np.abs(exact).max()))
        self.path = self.line(left, label="computed")
        right.set(xscale="log", yscale="log", xlim=ENDS, ylim=(1e-2, 1e4),
                  xlabel="steps in a revolution", ylabel="largest distance from the orbit, µm",
                  title="Error, and the slope of the method's order")
        right.set_xticks(STEPS, STEPS, fontsize=10)
        right.minorticks_off()
        self.slope = self.line(right, ":", color=COLOURS["axis"])
        self.here = self.line(right, "o", markersize=15, fillstyle="none", color=COLOURS["mean"])
        self.seen = {name: self.line(right, mark, color=colour, label=name)
                     for name, (_, mark, colour) in METHODS.items()}
        for axes in (left, right):
            axes.legend(loc="upper right")

    def begin(self) -> None:
        """Forget what was looked at."""
        self.errors.clear()

    def __call__(self, method: str, steps: int) -> str:
        """Show a method with a number of steps in a revolution; return the reading."""
        make, _, colour = METHODS[method]
        chosen = make(steps)
        motion = integrate(self.model, chosen, speed=self.speed, start=self.orbit, modes=None,
                           static_eccentricity=self.orbit.static_eccentricity,
                           revolutions=REVOLUTIONS)
        if not motion.finished:
            raise NoConvergence(f"{method} with {steps} steps in a revolution does not get "
                                f"through. {motion.stopped}")
        times, path = motion.last(1)
        error = UM * float(np.hypot(*(path - self.orbit.positions(self.speed * times))).max())
        self.errors[method, steps] = error
        self.path.set(data=UM * (path - self.orbit.mean[:, None]), color=colour)
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
