"""The pull in a stator that is not round: oval, with three lobes, with four."""

from __future__ import annotations

import math

import numpy as np

from hydrolab.errors import BadInput
from hydrolab.explorers.legs import machine_with
from hydrolab.explorers.widget import FigureExplorer, View, at_work, choice, slider
from hydrolab.figures.drawing import MM
from hydrolab.figures.style import COLOURS
from hydrolab.machine import CircularPull, Machine, ShapedPull

DRAWN_GAP = 1 / 3  # of the rotor's radius, for the eye
SHAPES = {"oval": 2, "three-lobed": 3, "four-lobed": 4}
ANGLE = np.linspace(0, 2 * math.pi, 361)
TURN = np.array([np.sin(ANGLE), np.cos(ANGLE)])


class GapShapeView(View):
    """The gap of a stator that is not round, and the pull in it against that of a round gap."""

    @at_work()
    def __init__(self, machine: Machine) -> None:
        self.gap, self.k = machine.air_gap.gap, machine.air_gap.pull_stiffness
        left, right = self.panels(11, 5, 2, width_ratios=(1, 1.1))
        self.stator = self.line(left, color=COLOURS["stator"], linewidth=5)
        left.plot(*((1 + DRAWN_GAP) * TURN), ":", color=COLOURS["axis"], linewidth=1.2)
        self.disc, = left.fill(*TURN, color=COLOURS["rotor"], alpha=0.3, linewidth=0)
        self.kept.moves(self.disc)
        self.arrow = self.line(left, color=COLOURS["mean"], linewidth=4)
        left.set(xlim=(-2.0, 2.0), ylim=(-1.75, 1.75), aspect="equal")
        left.set_title("From above; dotted: the round gap", fontsize=13)
        left.set_axis_off()
        self.round = self.line(right, ":", color=COLOURS["axis"], label="round gap")
        self.radial = self.line(right, color=COLOURS["x"], label="outwards")
        self.sideways = self.line(right, "--", color=COLOURS["z"], label="sideways")
        self.cursor = self.upright(right)
        right.set(xlim=(0, 360), ylim=(-600, 1600), title="Pull, kN", xticks=range(0, 361, 90),
                  xlabel="direction of the displacement, ° from z towards x")
        right.legend(loc="upper right", ncols=3, fontsize=11)

    def __call__(self, shape: str, depth: float, displacement: float, direction: float) -> str:
        """Show a shape, its depth and the displacement (% of the gap) in a direction (°)."""
        lobed = 1 + depth / 100 * np.cos(SHAPES[shape] * ANGLE)
        law = ShapedPull(self.k, self.gap, self.gap * lobed[:-1])
        toward, e = math.radians(direction), displacement / 100 * self.gap
        here = e * np.array([math.sin(toward), math.cos(toward)])
        left = float(law.smallest_gap(here))
        if left <= 0:
            raise BadInput(f"the rotor, displaced by {displacement:.0f} %, touches the {shape} "
                           "stator; displace it less.")
        force = law.force(here)
        pulls = np.where(law.smallest_gap(e * TURN) > 0, law.force(e * TURN), np.nan) / 1e3
        degrees = np.degrees(ANGLE)
        self.radial.set_data(degrees, (pulls * TURN).sum(axis=0))
        self.sideways.set_data(degrees, pulls[0] * TURN[1] - pulls[1] * TURN[0])
        round_pull = float(CircularPull(self.k, self.gap).force(np.array([e, 0.0]))[0]) / 1e3
        self.round.set_data([0, 360], [round_pull] * 2)
        self.cursor.set_xdata([direction, direction])
        self.stator.set_data(*((1 + DRAWN_GAP * lobed) * TURN))
        middle = DRAWN_GAP * here / self.gap
        self.disc.set_xy((middle[:, None] + TURN).T)
        self.arrow.set_data(*np.column_stack([middle, middle + force / 1e6]))
        size = math.hypot(*force)
        turned = math.degrees(math.atan2(*force)) - direction if size > 1.0 else 0.0
        turned = round((turned + 180) % 360 - 180, 1) + 0.0  # not -0.0
        return (f"{'An' if shape == 'oval' else 'A'} {shape} stator, {depth:.0f} % of the gap "
                f"deep, with the rotor {displacement:.0f} % of the gap off in the direction "
                f"{direction:.0f}°: the pull is {size / 1e3:.1f} kN, turned by {turned:.1f}° from "
                f"the displacement; a round gap gives {round_pull:.1f} kN. The smallest gap is "
                f"{MM * left:.2f} mm.")


def gap_shape_explorer(machine: Machine | None = None) -> FigureExplorer:
    """The pull in a stator that is not round: oval, with three lobes, with four.

    machine: by default the card "jeffcott". Raises BadInput for a machine without an air gap.
    """
    return FigureExplorer(GapShapeView(machine_with(machine, "jeffcott", "air_gap")), {
        "shape": choice("shape of the stator", "oval", list(SHAPES)),
        "depth": slider("depth, % of the gap", 10, 0, 40, 1, 0),
        "displacement": slider("displacement, % of the gap", 20, 0, 60, 1, 0),
        "direction": slider("its direction, °", 45, 0, 360, 5, 0)})
