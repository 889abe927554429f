"""Harmonics kept and samples taken in harmonic balance, against many of both."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import follow, orbits_at
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.explorers.widget import FigureExplorer, KeptFigure, View, steps, whole
from hydrolab.figures.drawing import REVOLUTION, UM, round_up
from hydrolab.figures.readings import percent
from hydrolab.figures.style import COLOURS, house_style, new_figure, plane
from hydrolab.machine import Machine, load_machine

SAMPLES = [4, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 128]
LEAST = 1e-5  # µm, the lower end of the harmonics' scale


class HarmonicsView(View):
    """An orbit with few harmonics and few samples against the same with `most` and more: its shape
    and its harmonics.
    """

    @house_style()
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
                f"most {_said(error)} off, {_said(self._aliasing(orbit))} of it because of the "
                f"samples; the mean is {_said(wrong[0])} off, 1X {_said(wrong[1])}.")

    def _aliasing(self, orbit: PeriodicOrbit) -> float:
        """How far an orbit is from that of as many harmonics with many samples, µm."""
        fine = HarmonicBalance(harmonics=orbit.harmonics, samples=64 * self.most)
        other = fine.solve(self.model, self.speed, orbit.static_eccentricity, start=orbit)
        return UM * float(np.hypot(*(orbit.positions(REVOLUTION)
                                     - other.positions(REVOLUTION))).max())


def _said(size: float) -> str:
    """A size in µm with two digits, and a bound where it is near rounding."""
    return f"{float(format(size, '.2g')):g} µm" if size >= 1e-4 else "less than 0.0001 µm"


def harmonics_explorer(machine: Machine | None = None, eccentricity: float = 5.0,
                       leg: int = 2) -> FigureExplorer:
    """Harmonics kept and samples taken in harmonic balance, against many of both, at an
    eccentricity (%).

    machine: by default the card "jeffcott". leg: which of the steady states there is, in the order
    in which the branch meets them; the second of that rotor is wide, so that few harmonics are
    visibly too few. Raises BadInput where there is no such steady state.
    """
    view = HarmonicsView(machine or load_machine("jeffcott"), eccentricity / 100, leg)
    return FigureExplorer(view, {"harmonics": whole("harmonics", 2, 1, view.most),
                                 "samples": steps("samples in a revolution", 8, SAMPLES)})
