"""A disc in a field, as figures that move: response to unbalance, gap and pull, gaps that are not
round.
"""

from __future__ import annotations

import math

import numpy as np

from hydrolab.errors import BadInput
from hydrolab.explorers.widget import KeptFigure
from hydrolab.figures.drawing import MM, REVOLUTION, RPM
from hydrolab.figures.style import COLOURS, house_style, new_figure
from hydrolab.machine.parts import Machine
from hydrolab.machine.pull import CircularPull, ShapedPull

DRAWN_GAP = 1 / 3  # of the rotor's radius, for the eye
SHAPES = {"oval": 2, "three-lobed": 3, "four-lobed": 4}
SAMPLES = 360  # angles around a shaped gap
TURN = np.array([np.sin(REVOLUTION), np.cos(REVOLUTION)])


class JeffcottView:
    """Whirl of a disc on springs by its unbalance, without field: the orbit, its radius and its lag
    over the speed.
    """

    def __init__(self, machine: Machine) -> None:
        if machine.shaft is not None:
            raise BadInput(f"{machine.name} has a shaft; the response of a Jeffcott rotor needs a "
                           "point mass on springs.")
        self.mass = sum(b.mass for b in machine.bodies)
        self.stiffness = sum(float(b.stiffness[0, 0]) for b in machine.bearings)
        self.unbalance = sum(b.unbalance for b in machine.bodies)
        self.natural = math.sqrt(self.stiffness / self.mass)
        self.gap = machine.air_gap.gap if machine.air_gap else math.inf
        self.top = round(2.2 * self.natural / RPM, -1)
        self.speeds = np.linspace(1, self.top, 600)
        with house_style():
            figure = new_figure(11, 5)
            grid = figure.add_gridspec(2, 2, width_ratios=(1, 1.25))
            plan = figure.add_subplot(grid[:, 0])
            size, lag = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
            plan.plot(*TURN, color=COLOURS["rotor"], linewidth=2)
            plan.plot(0, 0, "+", color=COLOURS["axis"], markersize=11)
            self.heavy, = plan.plot([], [], color=COLOURS["1X"], linewidth=5,
                                    label="towards the heavy spot")
            self.centre, = plan.plot([], [], "o", color=COLOURS["rotor"], markersize=12,
                                     label="rotor centre")
            plan.set(aspect="equal", xlim=(-1.9, 1.9), ylim=(-1.9, 1.9), xlabel="x / radius",
                     ylabel="z / radius",
                     title="Orbit, clockwise")
            plan.legend(loc="lower center", ncols=2, fontsize=11)
            self.radius, = size.plot([], [], color=COLOURS["1X"])
            self.here, = size.plot([], [], "o", color=COLOURS["rotor"], markersize=10)
            size.axhline(MM * self.unbalance / self.mass, color=COLOURS["axis"], linestyle=":",
                         label="U/m")
            if math.isfinite(self.gap):
                size.axhline(MM * self.gap, color=COLOURS["stator"], linewidth=3, label="gap")
            size.set(yscale="log", ylim=(1e-3, 40), xlim=(0, self.top),
                     title="Radius, mm (0-to-peak)")
            size.legend(loc="upper left", ncols=2, fontsize=11)
            self.late, = lag.plot([], [], color=COLOURS["1X"])
            self.there, = lag.plot([], [], "o", color=COLOURS["rotor"], markersize=10)
            lag.set(ylim=(0, 180), xlim=(0, self.top), xlabel="speed, rpm",
                    title="Lag behind the heavy spot, °")
            lag.set_yticks([0, 90, 180])
        self.kept = KeptFigure(figure, [self.heavy, self.centre, self.radius, self.here, self.late,
                                        self.there])

    def response(self, rpm: np.ndarray | float, damping_ratio: float) -> np.ndarray:
        """Complex radius z + ix of the whirl, m: U Ω² / (k − m Ω² + i c Ω)."""
        speed = np.asarray(rpm) * RPM
        c = 2 * damping_ratio * math.sqrt(self.stiffness * self.mass)
        return self.unbalance * speed**2 / (self.stiffness - self.mass * speed**2 + 1j * c * speed)

    def __call__(self, speed: float, damping: float) -> str:
        """Show a speed (rpm) and a damping ratio (%); return the reading."""
        now, curve = complex(self.response(speed, damping / 100)), self.response(self.speeds,
                                                                                 damping / 100)
        turned = np.exp(1j * math.radians(60))
        place = now / abs(now) * turned
        tip = place + 0.6 * turned
        self.centre.set_data([place.imag], [place.real])
        self.heavy.set_data([place.imag, tip.imag], [place.real, tip.real])
        self.radius.set_data(self.speeds, MM * np.abs(curve))
        self.late.set_data(self.speeds, -np.degrees(np.angle(curve)))
        late = -math.degrees(np.angle(now))
        self.here.set_data([speed], [MM * abs(now)])
        self.there.set_data([speed], [late])
        fits = "" if math.isinf(self.gap) else (", which fits into the gap" if abs(now) < self.gap
                                                else
                                                ", which does not fit into the gap of "
                                                f"{MM * self.gap:.0f} mm")
        return (f"At {speed:.0f} rpm, {speed * RPM / self.natural:.2f} times the natural "
                "frequency, with a damping ratio of "
                f"{damping:.1f} % the orbit is a circle of {MM * abs(now):.3g} mm "
                f"(0-to-peak){fits}; the rotor centre "
                f"lags the heavy spot by {late:.1f}°.")


class GapView:
    """A rotor displaced in a round gap: the gap, the magnetic pressure around it, and the pull that
    this adds up to.
    """

    def __init__(self, machine: Machine) -> None:
        if machine.air_gap is None:
            raise BadInput(f"{machine.name} has no air_gap; there is no pull without one.")
        self.air_gap = machine.air_gap
        self.eps = np.linspace(0, 0.7, 141)
        with house_style():
            figure = new_figure(11, 5)
            left, right = figure.subplots(1, 2, width_ratios=(1, 1.1))
            left.fill(*(1.15 * (1 + DRAWN_GAP) * TURN), color=COLOURS["stator"], alpha=0.5,
                      linewidth=0)
            left.fill(*((1 + DRAWN_GAP) * TURN), color="white", linewidth=0)
            left.plot(0, 0, "x", color=COLOURS["axis"], markersize=9, markeredgewidth=2)
            self.disc, = left.fill(*TURN, color=COLOURS["rotor"], alpha=0.3, linewidth=0)
            self.pressure, = left.plot([], [], color=COLOURS["unstable"], linewidth=1.6)
            self.arrow, = left.plot([], [], color=COLOURS["mean"], linewidth=4)
            left.set(xlim=(-2.1, 2.1), ylim=(-1.65, 1.75), aspect="equal")
            left.set_title("From above; the gap is drawn far too wide", fontsize=13)
            left.set_axis_off()
            self.curve, = right.plot([], [], color=COLOURS["rotor"], linewidth=3, label="pull")
            self.line, = right.plot([], [], ":", color=COLOURS["axis"],
                                    label="its slope at the centre")
            self.here, = right.plot([], [], "o", color=COLOURS["rotor"], markersize=11)
            right.set(xlim=(0, 0.7), ylim=(0, 3000), xlabel="displacement / gap", title="Pull, kN")
            right.legend(loc="upper left")
        self.kept = KeptFigure(figure, [self.disc, self.pressure, self.arrow, self.curve,
                                        self.line, self.here])

    def __call__(self, displacement: float, field: float) -> str:
        """Show a displacement along x (% of the gap) and a field (T); return the reading."""
        eps, gap = displacement / 100, self.air_gap.gap
        k = self.air_gap.pull_stiffness * (field / self.air_gap.field) ** 2
        law = CircularPull(k, gap)
        middle = np.array([[eps * DRAWN_GAP], [0.0]])
        self.disc.set_xy((middle + TURN).T)
        pressure = (1 - eps * TURN[0]) ** -2
        comb = np.stack([middle + TURN, middle + (1 + 0.07 * np.minimum(pressure, 9)) * TURN,
                         middle + TURN], axis=2)
        self.pressure.set_data(*comb[:, ::20].reshape(2, -1))
        force = float(law.force(np.array([eps * gap, 0.0]))[0])
        reach = 0.9 * math.tanh(force / 1e6)
        self.arrow.set_data([middle[0, 0], middle[0, 0] + reach], [0, 0])
        self.curve.set_data(self.eps, law.force(np.array([self.eps * gap, 0 * self.eps]))[0] / 1e3)
        self.line.set_data(self.eps, k * self.eps * gap / 1e3)
        self.here.set_data([abs(eps)], [abs(force) / 1e3])
        ratio = force / (k * eps * gap) if k * eps else 1.0
        pull = (f"the pull is {abs(force) / 1e3:.1f} kN along {'+' if eps > 0 else '−'}x, towards "
                "the small gap, "
                f"{ratio:.3f} times what the slope at the centre gives" if force else "there is no "
                "pull")
        return (f"Displaced by {displacement:.0f} % of the gap along x in a field of {field:.2f} "
                "T: the magnetic pressure "
                f"is {(1 - abs(eps)) ** -2:.2f} times its mean-gap value where the gap is smallest "
                "and "
                f"{(1 + abs(eps)) ** -2:.2f} times where it is largest; {pull}.")


class GapShapeView:
    """A stator that is not round: the gap around the rotor, and the pull on it against that of a
    round gap.
    """

    def __init__(self, machine: Machine) -> None:
        if machine.air_gap is None:
            raise BadInput(f"{machine.name} has no air_gap; there is no pull without one.")
        self.gap, self.k = machine.air_gap.gap, machine.air_gap.pull_stiffness
        self.angle = 2 * math.pi * np.arange(SAMPLES) / SAMPLES
        with house_style():
            figure = new_figure(11, 5)
            left, right = figure.subplots(1, 2, width_ratios=(1, 1.1))
            self.stator, = left.plot([], [], color=COLOURS["stator"], linewidth=5)
            left.plot(*((1 + DRAWN_GAP) * TURN), ":", color=COLOURS["axis"], linewidth=1.2)
            self.disc, = left.fill(*TURN, color=COLOURS["rotor"], alpha=0.3, linewidth=0)
            self.arrow, = left.plot([], [], color=COLOURS["mean"], linewidth=4)
            left.set(xlim=(-2.0, 2.0), ylim=(-1.75, 1.75), aspect="equal")
            left.set_title("From above; dotted: the round gap", fontsize=13)
            left.set_axis_off()
            self.round, = right.plot([], [], ":", color=COLOURS["axis"], label="round gap")
            self.radial, = right.plot([], [], color=COLOURS["x"], label="outwards")
            self.sideways, = right.plot([], [], "--", color=COLOURS["z"], label="sideways")
            self.cursor = right.axvline(0, color=COLOURS["axis"], linewidth=1)
            right.set(xlim=(0, 360), ylim=(-600, 1600), xlabel="direction of the displacement, ° "
                      "from z towards x",
                      title="Pull, kN")
            right.set_xticks(range(0, 361, 90))
            right.legend(loc="upper right", ncols=3, fontsize=11)
        self.kept = KeptFigure(figure, [self.stator, self.disc, self.arrow, self.round,
                                        self.radial, self.sideways,
                                        self.cursor])

    def __call__(self, shape: str, depth: float, displacement: float, direction: float) -> str:
        """Show a shape, its depth and the rotor's displacement (% of the gap), and its direction
        (°); return the reading.
        """
        lobes = SHAPES[shape]
        law = ShapedPull(self.k, self.gap, self.gap
                         * (1 + depth / 100 * np.cos(lobes * self.angle)))
        toward, along = math.radians(direction), np.array([np.sin(self.angle), np.cos(self.angle)])
        here = displacement / 100 * self.gap * np.array([math.sin(toward), math.cos(toward)])
        left = float(law.smallest_gap(here))
        if left <= 0:
            raise BadInput(f"the rotor, displaced by {displacement:.0f} %, touches the {shape} "
                           "stator; displace it less.")
        force = law.force(here)
        e = displacement / 100 * self.gap
        clear = law.smallest_gap(e * along) > 0
        pulls = np.where(clear, law.force(e * along), np.nan) / 1e3
        round_pull = float(CircularPull(self.k, self.gap).force(np.array([e, 0.0]))[0])
        outward = (pulls * along).sum(axis=0)
        aside = pulls[0] * along[1] - pulls[1] * along[0]
        degrees = np.degrees(self.angle)
        self.radial.set_data(degrees, outward)
        self.sideways.set_data(degrees, aside)
        self.round.set_data([0, 360], [round_pull / 1e3] * 2)
        self.cursor.set_xdata([direction, direction])
        radius = 1 + DRAWN_GAP * (1 + depth / 100 * np.cos(lobes * REVOLUTION))
        self.stator.set_data(*(radius * TURN))
        middle = DRAWN_GAP * here / self.gap
        self.disc.set_xy((middle[:, None] + TURN).T)
        tip = middle + force / 1e6
        self.arrow.set_data([middle[0], tip[0]], [middle[1], tip[1]])
        size = math.hypot(*force)
        turned = math.degrees(math.atan2(*force)) - direction if size > 1.0 else 0.0
        turned = (turned + 180) % 360 - 180
        return (f"An {shape}" if shape == "oval" else f"A {shape}") + (
            f" stator, {depth:.0f} % of the gap deep, with the rotor {displacement:.0f} % of the "
            "gap off in the direction "
            f"{direction:.0f}°: the pull is {size / 1e3:.1f} kN, turned by {turned:.1f}° from the "
            "displacement; a round gap "
            f"gives {round_pull / 1e3:.1f} kN. The smallest gap is {MM * left:.2f} mm.")
