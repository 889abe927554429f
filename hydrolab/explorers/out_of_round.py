"""The pull in a stator that is not round: oval, with three lobes, with four."""

from __future__ import annotations

import math

import numpy as np

from hydrolab.errors import BadInput
from hydrolab.explorers.widget import FigureExplorer, KeptFigure, View, choice, slider
from hydrolab.figures.drawing import MM, REVOLUTION
from hydrolab.figures.style import COLOURS, house_style, new_figure
from hydrolab.machine import Machine, load_machine
from hydrolab.machine.pull import CircularPull, ShapedPull

DRAWN_GAP = 1 / 3  # of the rotor's radius, for the eye
SHAPES = {"oval": 2, "three-lobed": 3, "four-lobed": 4}
SAMPLES = 360  # angles around a shaped gap
TURN = np.array([np.sin(REVOLUTION), np.cos(REVOLUTION)])


class GapShapeView(View):
    """A stator that is not round: the gap around the rotor, and the pull on it against that of a
    round gap.
    """

    @house_style()
    def __init__(self, machine: Machine) -> None:
        if machine.air_gap is None:
            raise BadInput(f"{machine.name} has no air_gap; there is no pull without one.")
        self.gap, self.k = machine.air_gap.gap, machine.air_gap.pull_stiffness
        self.angle = 2 * math.pi * np.arange(SAMPLES) / SAMPLES
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
        right.set(xlim=(0, 360), ylim=(-600, 1600), title="Pull, kN",
                  xlabel="direction of the displacement, ° from z towards x")
        right.set_xticks(range(0, 361, 90))
        right.legend(loc="upper right", ncols=3, fontsize=11)
        self.kept = KeptFigure(figure, [self.stator, self.disc, self.arrow, self.round,
                                        self.radial, self.sideways, self.cursor])

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
        turned = round((turned + 180) % 360 - 180, 1) + 0.0  # not -0.0
        return (f"{'An' if shape == 'oval' else 'A'} {shape} stator, {depth:.0f} % of the gap "
                f"deep, with the rotor {displacement:.0f} % of the gap off in the direction "
                f"{direction:.0f}°: the pull is {size / 1e3:.1f} kN, turned by {turned:.1f}° from "
                f"the displacement; a round gap gives {round_pull / 1e3:.1f} kN. The smallest gap "
                f"is {MM * left:.2f} mm.")


def gap_shape_explorer(machine: Machine | None = None) -> FigureExplorer:
    """The pull in a stator that is not round: oval, with three lobes, with four.

    machine: by default the card "jeffcott". Raises BadInput for a machine without an air gap.
    """
    return FigureExplorer(GapShapeView(machine or load_machine("jeffcott")), {
        "shape": choice("shape of the stator", "oval", list(SHAPES)),
        "depth": slider("depth, % of the gap", 10, 0, 40, 1, 0),
        "displacement": slider("displacement, % of the gap", 20, 0, 60, 1, 0),
        "direction": slider("its direction, °", 45, 0, 360, 5, 0)})
