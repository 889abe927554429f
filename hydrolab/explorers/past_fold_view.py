"""Past the fold: every orbit at an eccentricity, and where a machine is that was brought there
slowly.
"""

from __future__ import annotations

import math

import numpy as np
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.integrate import CentralDifference, integrate
from hydrolab.dynamics.results import PeriodicOrbit, Trajectory
from hydrolab.explorers.eccentricity_view import STEP, draw_legs
from hydrolab.explorers.legs import legs_of
from hydrolab.explorers.widget import KeptFigure
from hydrolab.figures.drawing import MM, REVOLUTION, draw_axis, nearest
from hydrolab.figures.readings import percent
from hydrolab.figures.style import COLOURS, LINES, PURPLE, house_style, new_figure, plane
from hydrolab.machine.parts import Machine

SEVERAL = 5  # orbits shown at one eccentricity
# that a motion gets to settle: after it has left a leg, and at each step after that
REVOLUTIONS = 250, 60
SLOW = 0.1  # % of eccentricity, the steps of a machine that is on no leg
METHOD = CentralDifference(steps_per_revolution=512)
# a motion whose coefficients are this near to an orbit's, in parts of its vibration, has settled on
# it
SAME = 0.02
TURN = np.array([np.sin(REVOLUTION), np.cos(REVOLUTION)])


class PastFoldView:
    """All orbits at an eccentricity, stable or not, and the machine that follows the eccentricity.

    While its leg goes on and is stable the machine stays on it. Where the leg ends or is unstable,
    its motion is integrated in time from the last orbit, so that the machine's own motion decides
    where it jumps to: an orbit, a motion that does not repeat every revolution, or the stator. On
    no leg it is integrated on, in steps of 0.1 %.
    """

    def __init__(self, machine: Machine) -> None:
        self.legs, self.model, self.speed = legs_of(machine), machine.model(), machine.speed
        self.gap = self.model.gap
        with house_style():
            figure = new_figure(11.4, 5.5)
            left, right = figure.subplots(1, 2, width_ratios=(1, 1.1))
            plane(left, "All orbits in the gap")
            draw_axis(left)
            reach = 1.12 * MM * self.gap
            left.set(adjustable="box", xlim=(-reach, reach), ylim=(-reach, reach))
            self.circle, = left.plot([], [], color=COLOURS["stator"], linewidth=3.5)
            self.orbits = [left.plot([], [])[0] for _ in range(SEVERAL)]
            self.motion, = left.plot([], [], color=PURPLE, linewidth=1.2)
            self.words = left.annotate("", (0.5, 0.86), xycoords="axes fraction", ha="center",
                                       fontsize=14)
            self.diagram, self.first = right, draw_legs(right, self.legs)
            self.dense = self.legs.dense(self.first)
            self.cursor = right.axvline(0, color=COLOURS["axis"], linewidth=1)
            self.dots, = right.plot([], [], "o", color=COLOURS["axis"], markersize=7,
                                    linestyle="none")
            self.jumps, = right.plot([], [], color=PURPLE, linewidth=2, marker=".")
            self.here, = right.plot([], [], "o", color=COLOURS["rotor"], markersize=15,
                                    fillstyle="none", markeredgewidth=3)
        self.kept = KeptFigure(figure, [self.circle, *self.orbits, self.motion, self.words,
                                        self.cursor, self.dots,
                                        self.jumps, self.here])
        self.begin()

    def begin(self) -> None:
        """Put the machine on the first leg at zero eccentricity, at rest from all jumps."""
        self.at, self.leg = 0.0, 0
        self.off: Trajectory | None = None
        self.story: list[str] = []
        self.jumps.set_data([], [])

    def __call__(self, eccentricity: float) -> str:
        """Bring the machine slowly to an eccentricity (%) and show all there is there; return the
        reading.
        """
        with threadpool_limits(1):
            self._bring(eccentricity / 100)
            there = [(number, orbit) for number in range(len(self.legs.all))
                     if (orbit := self.legs.orbit(eccentricity / 100, number)) is not None]
        self._show(eccentricity, there)
        states = [f"leg {number + 1} {self.legs.verdict(orbit, number)}, smallest gap "
                  f"{MM * orbit.smallest_gap:.2f} mm"
                  for number, orbit in there]
        found = f"{len(there)} steady state{'s' * (len(there) != 1)}" + (f": {'; '.join(states)}"
                                                                         if states else "")
        told = f" {' '.join(self.story[-2:])}" if self.story else ""
        return f"At {percent(eccentricity / 100)} there {'is' if len(there) == 1 else 'are'} {found}. {self._where()}{told}"

    def pick(self, x: float, y: float) -> dict[str, float] | None:
        """Eccentricity (%) of the branch's point nearest to a place in the figure, or None off the
        diagram.

        x, y: shares of the figure's width and height from its lower left corner.
        """
        eccentricity, values, _ = self.dense
        at = nearest(self.diagram, x, y, np.column_stack([eccentricity, values]))
        return None if at is None else {"eccentricity": round(eccentricity[at] / STEP) * STEP}

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
            now = value if abs(value - self.at) <= most else self.at + math.copysign(most,
                                                                                     value
                                                                                     - self.at)
            if self.leg is None:
                self._go_on(self.off, now)
            elif (orbit := self.legs.orbit(now, self.leg)) is None or self.legs.verdict(orbit,
                                                                                        self.leg) == "unstable":
                self._jump(self.legs.orbit(self.at, self.leg), now)
            self.at = now
        self.at = value

    def _jump(self, start: PeriodicOrbit, value: float) -> None:
        left, self.leg = self.leg, None
        how = "has ended" if self.legs.orbit(value, left) is None else "is no longer stable"
        self._go_on(start, value, f"At {percent(value, 4)} leg {left + 1} {how}")
        if self.leg is not None:
            ends = [start, self.legs.orbit(value, self.leg)]
            x, y = self.jumps.get_data()
            new = [self.first(np.empty(0), o.coefficients[None])[0] for o in ends]
            self.jumps.set_data([*x, np.nan, 100 * start.static_eccentricity, 100 * value],
                                [*y, np.nan, *new])

    def _go_on(self, start: PeriodicOrbit | Trajectory, value: float, why: str = "") -> None:
        """Integrate at an eccentricity from an orbit or a motion, and find out what it has come to.
        """
        more = ({"revolutions": REVOLUTIONS[1]} if isinstance(start, Trajectory) else
                {"revolutions": REVOLUTIONS[0], "disturbance": (1e-6, 1e-6)})
        self.off = integrate(self.model, METHOD, speed=self.speed, static_eccentricity=value,
                             start=start,
                             **more)
        if not self.off.finished:
            self.story.append(f"{why or f'At {percent(value, 4)}'}: {_lower(self.off.stopped)}")
            return
        end = self.off.coefficients(self.legs.branch.equations.harmonics)
        for number in range(len(self.legs.all)):
            orbit = self.legs.orbit(value, number)
            if orbit is not None and np.abs(end
                                            - orbit.coefficients).max() < SAME * np.abs(orbit.amplitudes[:, 0]).max():
                self.leg = number
                self.story.append(f"{why or f'At {percent(value, 4)}'}: the motion settles on leg "
                                  f"{number + 1}.")
                return
        if why:
            self.story.append(f"{why}: the motion settles on no orbit.")

    def _show(self, eccentricity: float, there: list[tuple[int, PeriodicOrbit]]) -> None:
        centre = self.model.centre(eccentricity / 100)
        self.circle.set_data(*(MM * (centre[:, None] + self.gap * TURN)))
        self.cursor.set_xdata([eccentricity, eccentricity])
        for line in self.orbits:
            line.set_data([], [])
        values = {number: self.first(np.empty(0), orbit.coefficients[None])[0]
                  for number, orbit in there}
        for line, (number, orbit) in zip(self.orbits, there, strict=False):
            word = self.legs.verdict(orbit, number)
            line.set_data(*(MM * orbit.positions(REVOLUTION)))
            line.set(color=COLOURS[word], linestyle=LINES[word],
                     linewidth=5 if number == self.leg else 2)
        self.dots.set_data([eccentricity] * len(values), list(values.values()))
        self.here.set_data(*([[eccentricity], [values[self.leg]]] if self.leg in values
                             else [[], []]))
        self.motion.set_data([], [])
        if self.leg is None:
            self.motion.set_data(*(MM * self.off.last(min(8.0, self.off.revolutions))[1]))
        self.words.set_text("" if self.leg is not None else "no orbit" if self.off.finished
                            else "contact")
        self.words.set_color(PURPLE if self.leg is None and self.off.finished
                             else COLOURS["unstable"])


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]
