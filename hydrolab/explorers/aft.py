"""Harmonics kept and samples taken in harmonic balance, against many of both."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.branches import orbits_at
from hydrolab.dynamics.following import follow
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.errors import BadInput
from hydrolab.explorers.widget import FigureExplorer, View, at_work, steps, whole
from hydrolab.figures.drawing import REVOLUTION, UM, about_mean, close_up, round_up
from hydrolab.figures.readings import percent
from hydrolab.figures.style import COLOURS
from hydrolab.machine import Machine, load_machine

SAMPLES = [4, 6, 8, 10, 12, 16, 20, 24, 32, 48, 64, 128]
MOST = 12  # harmonics
FINE = 64 * MOST  # samples
LEAST = 1e-5  # µm, the lower end of the harmonics' scale


class HarmonicsView(View):
    """An orbit and its harmonics, against the same with more of both."""

    @at_work()
    def __init__(self, machine: Machine, eccentricity: float, leg: int) -> None:
        self.model, self.speed, self.at = machine.model(), machine.speed, eccentricity
        there = orbits_at(follow(self.model, speed=self.speed, to=0.5), eccentricity)
        if not 1 <= leg <= len(there):
            raise BadInput(f"leg is {leg!r}; at {percent(eccentricity)} the branch has "
                           f"{len(there)} orbits.")
        self.exact = HarmonicBalance(2 * MOST, FINE).solve(self.model, self.speed, eccentricity,
                                                           start=there[leg - 1])
        around, many = about_mean(self.exact), f"{2 * MOST} harmonics"
        left, right = self.panels(11, 5, 2)
        close_up(left, f"Orbit at {percent(eccentricity)}, about its mean", around, many,
                 round_up(1.1 * float(np.abs(around).max())))
        self.path = self.line(left, color=COLOURS["rotor"])
        right.set(yscale="log", ylim=(LEAST, 1e4), title="Sizes in x, and the error of each",
                  ylabel="µm (0-to-peak)", xlabel="harmonic")
        places = np.arange(MOST + 1)
        right.set_xticks(places, ["mean", *map(str, places[1:])])
        right.grid(axis="x", visible=False)
        right.bar(places, _sizes(self.exact.coefficients), 0.8, color="#DDDDDD", label=many)
        self.bars = right.bar(places, LEAST, 0.4, color=COLOURS["rotor"], label="computed")
        self.kept.moves(*self.bars)
        self.wrong = self.line(right, "X", color=COLOURS["unstable"], label="error")
        for axes in (left, right):
            axes.legend(loc="upper right")

    def __call__(self, harmonics: int, samples: int) -> str:
        """Show the orbit with these harmonics and samples in a period; return the reading."""
        orbit, fine = (HarmonicBalance(harmonics, n).solve(self.model, self.speed, self.at,
                                                           start=self.exact)
                       for n in (samples, FINE))
        path = orbit.positions(REVOLUTION)
        self.path.set_data(*(UM * (path - self.exact.mean[:, None])))
        for bar, value in zip(self.bars, _sizes(orbit.coefficients), strict=True):
            bar.set(y=LEAST, height=max(value - LEAST, 0.0))
        wrong = np.zeros_like(self.exact.coefficients)
        wrong[:, :2 * harmonics + 1] = orbit.coefficients
        sizes = _sizes(wrong - self.exact.coefficients)
        self.wrong.set_data(np.arange(MOST + 1), np.maximum(sizes, LEAST))
        error, aliasing = (UM * float(np.hypot(*(path - o.positions(REVOLUTION))).max())
                           for o in (self.exact, fine))
        return (f"{harmonics} harmonics and {samples} samples in a revolution: the orbit is at "
                f"most {_said(error)} off, {_said(aliasing)} of it because of the samples; the "
                f"mean is {_said(sizes[0])} off, 1X {_said(sizes[1])}.")


def _sizes(coefficients: NDArray) -> NDArray:
    """Sizes of mean and harmonics in x, µm, (MOST + 1,)."""
    x = np.zeros(2 * MOST + 1)
    known = UM * coefficients[0, :len(x)]
    x[:len(known)] = known
    return np.append(abs(x[0]), np.hypot(x[1::2], x[2::2]))


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
    return FigureExplorer(view, {"harmonics": whole("harmonics", 2, 1, MOST),
                                 "samples": steps("samples in a revolution", 8, SAMPLES)})
