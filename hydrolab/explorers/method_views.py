"""Methods against a reference that hardly errs, as figures that move: time steps, and harmonics
with their samples.
"""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import follow, orbits_at
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.integrate import CentralDifference, Newmark, integrate
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.explorers.legs import round_up
from hydrolab.explorers.widget import KeptFigure
from hydrolab.figures.drawing import REVOLUTION, UM
from hydrolab.figures.readings import microns, percent
from hydrolab.figures.style import COLOURS, house_style, new_figure, plane
from hydrolab.machine.parts import Machine

METHODS = {"central difference": CentralDifference, "Newmark, γ = 1/2": Newmark,
           "Newmark, γ = 0.6": lambda n: Newmark(n, beta=0.3025, gamma=0.6)}  # β = (γ + 1/2)²/4
MARKS = dict(zip(METHODS, (("o", COLOURS["x"]), ("s", COLOURS["z"]), ("^", COLOURS["2X"])),
                 strict=True))
STEPS = [8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256]
SAMPLES = [4, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 128]
REVOLUTIONS = 20
LEAST = 1e-5  # µm, the lower end of the harmonics' scale


class IntegratorView:
    """What a method of time integration makes of a known orbit in 20 revolutions, and how its error
    falls with the step.

    The motion starts on the orbit, which harmonic balance with 16 harmonics gives. Every pair of
    method and step that was looked at leaves a mark.
    """

    def __init__(self, machine: Machine, eccentricity: float = 0.07) -> None:
        self.model, self.speed = machine.model(), machine.speed
        self.orbit = HarmonicBalance(harmonics=16).solve(self.model, self.speed, eccentricity)
        self.errors: dict[tuple[str, int], float] = {}
        with house_style():
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
            right.set(xscale="log", yscale="log", xlim=(6, 340), ylim=(1e-2, 1e4),
                      xlabel="steps in a revolution",
                      ylabel="largest distance from the orbit, µm", title="Error, and the slope of "
                      "the method's order")
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
        ends = np.array([6.0, 340.0])
        self.slope.set_data(ends, error * (ends / steps) ** -chosen.order)
        size = float(np.abs(self.orbit.positions(REVOLUTION) - self.orbit.mean[:, None]).max())
        return (f"{method} (order {chosen.order}) with {steps} steps in a revolution is "
                f"{error:.3g} µm off after "
                f"{REVOLUTIONS} revolutions, {100 * error / (UM * size):.2g} % of the vibration, "
                "which reaches "
                f"{microns(size)}.")


class HarmonicsView:
    """An orbit with few harmonics and few samples against the same with many: its shape and its
    harmonics.

    leg: which of the orbits at this eccentricity, in the order in which the branch meets them.
    """

    def __init__(self, machine: Machine, eccentricity: float = 0.05, leg: int = 2,
                 most: int = 12) -> None:
        self.model, self.speed, self.most = machine.model(), machine.speed, most
        with threadpool_limits(1):
            there = orbits_at(follow(self.model, speed=self.speed, to=0.5), eccentricity)
            if not 1 <= leg <= len(there):
                raise BadInput(f"leg is {leg!r}; at {percent(eccentricity)} the branch has "
                               f"{len(there)} orbits.")
            self.exact = HarmonicBalance(harmonics=2 * most, samples=64 * most).solve(
                self.model, self.speed, eccentricity, start=there[leg - 1])
        self.around = UM * (self.exact.positions(REVOLUTION) - self.exact.mean[:, None])
        size = round_up(1.1 * float(np.abs(self.around).max()))
        places = np.arange(most + 1)
        with house_style():
            figure = new_figure(11, 5)
            left, right = figure.subplots(1, 2)
            plane(left, f"Orbit at {percent(eccentricity)}, about its mean")
            left.set(xlabel="x, µm", ylabel="z, µm", adjustable="box", xlim=(-size, size),
                     ylim=(-size, size))
            left.plot(*self.around, color="#C8C8C8", linewidth=7, label=f"{2 * most} harmonics")
            self.path, = left.plot([], [], color=COLOURS["rotor"])
            left.legend(loc="upper right")
            right.set(yscale="log", ylim=(LEAST, 1e4), title="Sizes in x, and the error of each")
            right.set(ylabel="µm (0-to-peak)", xlabel="harmonic")
            right.set_xticks(places, ["mean", *map(str, places[1:])])
            right.grid(axis="x", visible=False)
            right.bar(places, self._sizes(self.exact.coefficients), 0.8, color="#DDDDDD",
                      label=f"{2 * most} harmonics")
            self.bars = right.bar(places, np.full(most + 1, LEAST), 0.4, color=COLOURS["rotor"],
                                  label="computed")
            self.wrong, = right.plot([], [], "X", color=COLOURS["unstable"], label="error")
            right.legend(loc="upper right")
        self.kept = KeptFigure(figure, [self.path, *self.bars, self.wrong])

    def _sizes(self, coefficients: np.ndarray) -> np.ndarray:
        """Sizes of mean and harmonics in x, µm, (most + 1,)."""
        x = UM * coefficients[0, :2 * self.most + 1]
        x = np.pad(x, (0, 2 * self.most + 1 - len(x)))
        return np.append(abs(x[0]), np.hypot(x[1::2], x[2::2]))

    def __call__(self, harmonics: int, samples: int) -> str:
        """Show the orbit with these harmonics and samples in a period; return the reading."""
        method = HarmonicBalance(harmonics=harmonics, samples=samples)
        with threadpool_limits(1):
            orbit = method.solve(self.model, self.speed, self.exact.static_eccentricity,
                                 start=self.exact)
        path = UM * orbit.positions(REVOLUTION)
        self.path.set_data(*(path - UM * self.exact.mean[:, None]))
        sizes = self._sizes(orbit.coefficients)
        for bar, value in zip(self.bars, sizes, strict=True):
            bar.set(y=LEAST, height=max(value - LEAST, 0.0))
        columns = min(orbit.coefficients.shape[1], self.exact.coefficients.shape[1])
        left = self.exact.coefficients.copy()
        left[:, :columns] -= orbit.coefficients[:, :columns]
        wrong = self._sizes(left)
        self.wrong.set_data(np.arange(self.most + 1), np.maximum(wrong, LEAST))
        error = float(np.hypot(*(path - UM * self.exact.positions(REVOLUTION))).max())
        return (f"{harmonics} harmonics and {samples} samples in a revolution: the orbit is at "
                f"most {_said(error)} off, "
                f"{_said(self._aliasing(orbit))} of it because of the samples; the mean is "
                f"{_said(wrong[0])} off, 1X "
                f"{_said(wrong[1])}.")

    def _aliasing(self, orbit: PeriodicOrbit) -> float:
        """How far an orbit is from that of as many harmonics with many samples, µm."""
        fine = HarmonicBalance(harmonics=orbit.harmonics, samples=64 * self.most)
        other = fine.solve(self.model, self.speed, orbit.static_eccentricity, start=orbit)
        return UM * float(np.hypot(*(orbit.positions(REVOLUTION)
                                     - other.positions(REVOLUTION))).max())


def _said(size: float) -> str:
    """A size in µm with two digits, and a bound where it is near rounding."""
    return f"{float(format(size, '.2g')):g} µm" if size >= 1e-4 else "less than 0.0001 µm"
