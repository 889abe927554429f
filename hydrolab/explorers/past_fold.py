"""Past the fold: the orbits at an eccentricity, and where a machine is that was brought there
slowly.
"""

from __future__ import annotations

import math

import numpy as np

from hydrolab.dynamics.integrate import CentralDifference, integrate
from hydrolab.dynamics.results import PeriodicOrbit, Trajectory
from hydrolab.explorers.legs import STEP, Diagram, legs_of
from hydrolab.explorers.widget import FigureExplorer, View, at_work, slider
from hydrolab.figures.drawing import MM, REVOLUTION, contact_line, gap_plane
from hydrolab.figures.readings import percent
from hydrolab.figures.style import COLOURS, LINES, PURPLE
from hydrolab.machine import Machine, load_machine
from hydrolab.paper.study import stable_steps

SEVERAL = 5  # orbits shown at one eccentricity
# that a motion gets to settle: after it has left a leg, and at each step after that
REVOLUTIONS = 250, 8
SLOW = 0.01  # % of eccentricity, the steps of a machine that is on no leg: 0.05 % are a blow
# a motion whose coefficients are this near to an orbit's, in parts of its vibration, has settled on
# it
SAME = 0.02


class PastFoldView(View):
    """The orbits at an eccentricity, stable or not, and the machine that follows the eccentricity.

    While its leg goes on and is stable the machine stays on it. Where the leg ends or is unstable,
    its motion is integrated in time from the last orbit, so that the machine's own motion decides
    where it jumps to: an orbit, a motion that does not repeat every revolution, or the stator. On
    no leg it is integrated on, in steps of 0.01 %: with 0.05 % the steps decide where it ends.
    """

    @at_work()
    def __init__(self, machine: Machine) -> None:
        self.legs, self.model, self.speed = legs_of(machine), machine.model(), machine.speed
        self.contact = contact_line(self.model)
        self.method = CentralDifference(stable_steps(self.model, self.speed))
        left, right = self.panels(11.4, 5.5, 2, width_ratios=(1, 1.1))
        gap_plane(left, "The orbits in the gap", self.model.gap)
        self.circle = self.line(left, color=COLOURS["stator"], linewidth=3.5)
        self.orbits = [self.line(left) for _ in range(SEVERAL)]
        self.motion = self.line(left, color=PURPLE, linewidth=1.2)
        self.words = left.annotate("", (0.5, 0.86), xycoords="axes fraction", ha="center",
                                   fontsize=14)
        self.diagram = Diagram(right, self.legs)
        self.kept.moves(self.words, self.diagram.cursor)
        self.dots = self.line(right, "o", color=COLOURS["axis"], markersize=7)
        self.jumps = self.line(right, color=PURPLE, linewidth=2, marker=".")
        self.here = self.line(right, "o", color=COLOURS["rotor"], markersize=15, fillstyle="none",
                              markeredgewidth=3)
        self.begin()

    def begin(self) -> None:
        """Put the machine on the first leg at zero eccentricity, at rest from all jumps."""
        self.at, self.leg = 0.0, 0
        self.off: Trajectory | None = None
        self.story: list[str] = []
        self.jumps.set_data([], [])

    def __call__(self, eccentricity: float) -> str:
        """Bring the machine slowly to an eccentricity (%) and show all there is there."""
        self._bring(eccentricity / 100)
        there = [(number, orbit) for number in range(len(self.legs.all))
                 if (orbit := self.legs.orbit(eccentricity / 100, number)) is not None]
        self._show(eccentricity, there)
        states = [f"leg {number + 1} {self.legs.verdict(eccentricity / 100, number)}, smallest gap "
                  f"{MM * orbit.smallest_gap:.2f} mm" for number, orbit in there]
        found = f"{len(there)} steady state{'s' * (len(there) != 1)}{self.legs.where}"
        found += f": {'; '.join(states)}" if states else ""
        told = f" {' '.join(self.story[-2:])}" if self.story else ""
        return f"At {percent(eccentricity / 100)} the branch has {found}. {self._where()}{told}"

    def pick(self, x: float, y: float) -> dict[str, float] | None:
        """Eccentricity (%) of the branch's point nearest to x, y in the figure."""
        found = self.diagram.pick(x, y)
        return found and {"eccentricity": found[0]}

    def _where(self) -> str:
        if self.leg is not None:
            return f"The machine is on leg {self.leg + 1}."
        if not self.off.finished:
            return "The rotor has touched the stator: reset to begin again."
        return "The machine moves without repeating every revolution."

    def _bring(self, value: float) -> None:
        """Move the machine in small steps, and let it jump where it must."""
        while self.at != value and (self.leg is not None or self.off.finished):
            most = (STEP if self.leg is not None else SLOW) / 100
            far = value - self.at
            now = value if abs(far) <= most else self.at + math.copysign(most, far)
            if self.leg is None:
                self._go_on(self.off, now)
            elif (orbit := self.legs.orbit(now, self.leg)) is None or (
                    self.legs.verdict(orbit.static_eccentricity, self.leg) == "unstable"):
                self._jump(self.legs.orbit(self.at, self.leg), now)
            self.at = now
        self.at = value

    def _jump(self, start: PeriodicOrbit, value: float) -> None:
        left, self.leg = self.leg, None
        how = "has ended" if self.legs.orbit(value, left) is None else "is no longer stable"
        self._go_on(start, value, f"At {percent(value, 4)} leg {left + 1} {how}")
        if self.leg is not None:
            old = self.jumps.get_data()
            new = self.diagram.place(start, self.legs.orbit(value, self.leg))
            self.jumps.set_data(*([*before, np.nan, *after]
                                  for before, after in zip(old, new, strict=True)))

    def _go_on(self, start: PeriodicOrbit | Trajectory, value: float, why: str = "") -> None:
        """Integrate at an eccentricity from an orbit or a motion, and see where it ends."""
        more = ({"revolutions": REVOLUTIONS[1]} if isinstance(start, Trajectory) else
                {"revolutions": REVOLUTIONS[0], "disturbance": (1e-6, 1e-6)})
        self.off = integrate(self.model, self.method, speed=self.speed, static_eccentricity=value,
                             start=start, **more)
        then = why or f"At {percent(value, 4)}"
        if not self.off.finished:
            self.story.append(f"{then}: {self.off.stopped[:1].lower()}{self.off.stopped[1:]}")
            return
        end = self.off.coefficients(self.legs.branch.equations.harmonics)
        for number in range(len(self.legs.all)):
            orbit = self.legs.orbit(value, number)
            if orbit is not None and (np.abs(end - orbit.coefficients).max()
                                      < SAME * np.abs(orbit.amplitudes[:, 0]).max()):
                self.leg = number
                self.story.append(f"{then}: the motion settles on leg {number + 1}.")
                return
        if why:
            self.story.append(f"{why}: the motion settles on no orbit.")

    def _show(self, eccentricity: float, there: list[tuple[int, PeriodicOrbit]]) -> None:
        centre = self.model.centre(eccentricity / 100)
        self.circle.set_data(*(MM * (centre[:, None] + self.contact)))
        self.diagram.cursor.set_xdata([eccentricity, eccentricity])
        for line in self.orbits:
            line.set_data([], [])
        for line, (number, orbit) in zip(self.orbits, there, strict=False):
            word = self.legs.verdict(orbit.static_eccentricity, number)
            line.set_data(*(MM * orbit.positions(REVOLUTION)))
            line.set(color=COLOURS[word], linestyle=LINES[word],
                     linewidth=5 if number == self.leg else 2)
        self.dots.set_data(*self.diagram.place(*(orbit for _, orbit in there)))
        self.here.set_data(*self.diagram.place(*(o for number, o in there if number == self.leg)))
        self.motion.set_data([], [])
        self.words.set_text("")
        if self.leg is None:
            self.motion.set_data(*(MM * self.off.last(min(8.0, self.off.revolutions))[1]))
            self.words.set(text="no orbit" if self.off.finished else "contact",
                           color=PURPLE if self.off.finished else COLOURS["unstable"])


def past_fold_explorer(machine: Machine | None = None, eccentricity: float = 8.5) -> FigureExplorer:
    """The orbits of the legs at an eccentricity, stable or not, and the jumps of a machine that is
    brought there slowly.

    A click on the branch brings it to that eccentricity.
    machine: by default the card "kaplan-150rpm". eccentricity: in per cent, to begin with.
    Raises BadInput for a machine without an air gap, NoConvergence where there is no first steady
    state.
    """
    view = PastFoldView(machine or load_machine("kaplan-150rpm"))
    where = slider("static eccentricity, %", eccentricity, 0.0, round(104 * view.legs.reach, 1),
                   STEP, 2)
    return FigureExplorer(view, {"eccentricity": where}, frames=3)
