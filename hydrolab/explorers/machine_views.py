"""A machine whose numbers are doubted, as figures that move: calibration to two readings, and
causes of a vibration.
"""

from __future__ import annotations

import math

import numpy as np
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import Arclength, follow
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import ellipse
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.explorers.widget import KeptFigure
from hydrolab.figures.drawing import MM, REVOLUTION, UM
from hydrolab.figures.readings import microns, second_share
from hydrolab.figures.style import COLOURS, house_style, new_figure, plane
from hydrolab.machine.cards import vary
from hydrolab.machine.parts import Machine, RadialBearing

AMPLITUDE = 200.0  # µm, 1X of the centred generator (Villa et al., section 2)
FOLDS = (8.90, 8.95)  # %, an orbit is shown at 8.9 and none found beyond
NEAR = 0.01  # of the amplitude, counted as a hit
TRIES = 30  # of which marks stay
CAUSES = ("more unbalance", "static eccentricity", "stronger field", "softer guide bearing")
SIZES = ("mean", "1X, long axis", "1X, short axis", "2X, long axis")


def guide_bearing(machine: Machine) -> RadialBearing:
    """The radial bearing nearest to the body in the air gap."""
    home = machine.body(machine.air_gap.body).node
    return min(machine.bearings, key=lambda bearing: abs(bearing.node - home))


class CalibrationView:
    """Two readings of a machine as three of its numbers change: 1X when centred, and the first
    fold. Each try is marked.
    """

    def __init__(self, machine: Machine) -> None:
        self.machine, self.bearing = machine, guide_bearing(machine)
        self.body = machine.body(machine.air_gap.body)
        self.tries: list[tuple[float, float]] = []
        with house_style():
            figure = new_figure(11, 5.2)
            left, right = figure.subplots(1, 2)
            left.axvspan(*FOLDS, color=COLOURS["stable"], alpha=0.35, linewidth=0,
                         label="fold wanted")
            self.branch, = left.plot([], [], color=COLOURS["rotor"], label="first leg")
            self.turn, = left.plot([], [], "D", color=COLOURS["fold"])
            left.plot(0, AMPLITUDE, "o", color=COLOURS["stable"], markersize=14, fillstyle="none",
                      markeredgewidth=2.5,
                      label="200 µm wanted")
            left.set(xlim=(0, 12), ylim=(0, 1200), xlabel="static eccentricity, %",
                     title="1X in x, µm (0-to-peak)")
            left.legend(loc="upper left")
            right.axvspan(*FOLDS, color=COLOURS["stable"], alpha=0.35, linewidth=0)
            right.axhspan(AMPLITUDE * (1 - NEAR), AMPLITUDE * (1 + NEAR), color=COLOURS["stable"],
                          alpha=0.35, linewidth=0)
            self.trail, = right.plot([], [], ".-", color="#AAAAAA", linewidth=1)
            self.now, = right.plot([], [], "o", color=COLOURS["rotor"], markersize=11)
            right.set(xlim=(5, 12), ylim=(80, 400), xlabel="first fold, %",
                      ylabel="1X when centred, µm (0-to-peak)",
                      title="Both at once: where the bands cross")
        self.kept = KeptFigure(figure, [self.branch, self.turn, self.trail, self.now])

    def begin(self) -> None:
        """Forget all tries."""
        self.tries = []

    def _varied(self, depth: float, mass: float, unbalance: float) -> Machine:
        nodes = self.machine.shaft.nodes.copy()
        nodes[self.bearing.node] = depth
        return vary(self.machine, {"shaft.nodes": nodes,
                                   f"bodies.{self.body.name}.mass": 1e3 * mass,
                                   "unbalance": unbalance})

    def __call__(self, depth: float, mass: float, unbalance: float) -> str:
        """Show a depth of the guide bearing (m), a generator mass (t) and a factor on all
        unbalances; return the reading.
        """
        with threadpool_limits(1):
            model = self._varied(depth, mass, unbalance).model()
            branch = follow(model, speed=self.machine.speed, to=0.5, method=Arclength(max_folds=1))
        first = UM * np.hypot(*np.moveaxis(branch.coefficients[:, 0, 1:3], -1, 0))
        leg = branch.first_leg
        self.branch.set_data(100 * branch.static_eccentricity[leg], first[leg])
        size = float(first[0])
        said = f"With the {self.bearing.name} at {depth:.3f} m, {mass:.1f} t and {unbalance:.2f} times the unbalance"
        if not branch.folds:
            for artist in (self.turn, self.now):
                artist.set_data([], [])
            return f"{said}, 1X is {size:.1f} µm when centred (0-to-peak) and no fold was met: {branch.stopped}"
        fold, turn = 100 * branch.folds[0].value, branch.at_fold(0)
        self.turn.set_data([fold], [UM * turn.amplitudes[0, 0]])
        if (fold, size) not in self.tries:
            self.tries = [*self.tries, (fold, size)][-TRIES:]
        self.trail.set_data(*zip(*self.tries, strict=True))
        hits = FOLDS[0] <= fold <= FOLDS[1], abs(size / AMPLITUDE - 1) <= NEAR
        self.now.set_data([fold], [size])
        self.now.set_color(COLOURS["stable"] if all(hits) else COLOURS["rotor"])
        verdict = {(True, True): "Both agree with the paper.", (True, False): "The fold agrees "
                   "with the paper, 1X does not.",
                   (False, True): "1X agrees with the paper, the fold does not.",
                   (False, False): "Neither agrees."}[hits]
        return (f"{said}, 1X is {size:.1f} µm when centred (0-to-peak; wanted {AMPLITUDE:.0f}) and "
                "the branch folds at "
                f"{fold:.3f} % (wanted {FOLDS[0]:.2f} to {FOLDS[1]:.2f}). {verdict}")


class DiagnosisView:
    """One cause at a time, from nothing to much: how it changes the orbit at the generator and what
    a sensor reads.

    The healthy machine stands a little off centre, as every machine does. size 1 of a cause is
    twice the unbalance, 8 % static eccentricity in all, 10 % more field, or half the stiffness of
    the guide bearing.
    """

    HEALTHY = 0.01  # static eccentricity

    def __init__(self, machine: Machine) -> None:
        self.machine, self.bearing = machine, guide_bearing(machine)
        self.healthy = self._orbit(CAUSES[0], 0.0)
        base = self._sizes(self.healthy)
        with house_style():
            figure = new_figure(11, 5)
            left, right = figure.subplots(1, 2, width_ratios=(1, 1.2))
            plane(left, "Orbit at the generator about its mean")
            left.set(xlabel="x, µm", ylabel="z, µm", adjustable="box", xlim=(-1000, 1000),
                     ylim=(-1000, 1000),
                     xticks=range(-1000, 1001, 500), yticks=range(-1000, 1001, 500))
            left.plot(*(UM * (self.healthy.positions(REVOLUTION) - self.healthy.mean[:, None])),
                      color="#C8C8C8",
                      linewidth=6, label="healthy")
            self.path, = left.plot([], [], color=COLOURS["rotor"], label="now")
            left.legend(loc="upper right")
            places = np.arange(len(SIZES))
            right.bar(places, base, 0.8, color="#DDDDDD", label="healthy")
            self.bars = right.bar(places, base, 0.4, color=COLOURS["rotor"], label="now")
            right.set(yscale="log", ylim=(0.01, 1e4), ylabel="µm (0-to-peak)", title="What is read")
            right.set_xticks(places, [name.replace(", ", ",\n") for name in SIZES])
            right.grid(axis="x", visible=False)
            right.legend(loc="upper right")
        self.kept = KeptFigure(figure, [self.path, *self.bars])

    def _orbit(self, cause: str, size: float) -> PeriodicOrbit:
        eccentricity = self.HEALTHY
        changes: dict[str, float] = {}
        if cause == CAUSES[0]:
            changes = {"unbalance": 1 + size}
        elif cause == CAUSES[1]:
            eccentricity += (0.08 - eccentricity) * size
        elif cause == CAUSES[2]:
            changes = {"field": self.machine.air_gap.field * (1 + 0.1 * size)}
        else:
            changes = {f"bearings.{self.bearing.name}.stiffness": self.bearing.stiffness
                       * (1 - 0.5 * size)}
        with threadpool_limits(1):
            return HarmonicBalance(harmonics=8).solve(vary(self.machine, changes).model(),
                                                      self.machine.speed, eccentricity)

    @staticmethod
    def _sizes(orbit: PeriodicOrbit) -> np.ndarray:
        """Mean and half axes, µm, in the order of SIZES."""
        first, second = ellipse(orbit.coefficients, 1), ellipse(orbit.coefficients, 2)
        return UM * np.array([math.hypot(*orbit.mean), first.major, abs(first.minor), second.major])

    def __call__(self, cause: str, size: float) -> str:
        """Show a cause of a size from 0 to 1; return the reading."""
        orbit = self._orbit(cause, size)
        self.path.set_data(*(UM * (orbit.positions(REVOLUTION) - orbit.mean[:, None])))
        sizes, base = self._sizes(orbit), self._sizes(self.healthy)
        for bar, value in zip(self.bars, sizes, strict=True):
            bar.set_height(value)
        mean, major, minor, _ = sizes
        second, before = (100 * second_share(o.coefficients) for o in (orbit, self.healthy))
        return (f"{cause.capitalize()}, {100 * size:.0f} % of its range: the mean is "
                f"{microns(mean / UM)} "
                f"({mean / base[0]:.2f} times the healthy one), 1X is an ellipse of "
                f"{microns(major / UM)} by "
                f"{microns(minor / UM)} (0-to-peak; {major / base[1]:.2f} and "
                f"{minor / base[2]:.2f} times), 2X is "
                f"{second:.2f} % of 1X ({before:.2f} % when healthy), the smallest gap "
                f"{MM * orbit.smallest_gap:.2f} mm.")
