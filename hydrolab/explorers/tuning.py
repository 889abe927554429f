"""Three numbers that a paper does not print, found by hand from two readings that it does."""

from __future__ import annotations

from hydrolab.dynamics.following import Arclength, follow
from hydrolab.explorers.legs import guide_of, machine_with
from hydrolab.explorers.widget import FigureExplorer, View, at_work, slider
from hydrolab.figures.drawing import UM
from hydrolab.figures.readings import first_along
from hydrolab.figures.style import COLOURS
from hydrolab.machine import Machine, Model, vary

AMPLITUDE = 200.0  # µm, 1X of the centred generator (Villa et al., section 2)
FOLDS = (8.90, 8.95)  # %, an orbit is shown at 8.9 and none found beyond
NEAR = 0.01  # of the amplitude, counted as a hit
TRIES = 30  # of which marks stay
VERDICTS = {(True, True): "Both agree with the paper.",
            (True, False): "The fold agrees with the paper, 1X does not.",
            (False, True): "1X agrees with the paper, the fold does not.",
            (False, False): "Neither agrees."}


class CalibrationView(View):
    """1X when centred and the first fold as three numbers of a machine change, try by try."""

    @at_work()
    def __init__(self, machine: Machine) -> None:
        self.machine, self.guide = machine, guide_of(machine)
        self.body = machine.body(machine.air_gap.body)
        left, right = self.panels(11, 5.2, 2)
        wanted = {"color": COLOURS["stable"], "alpha": 0.35, "linewidth": 0}
        left.axvspan(*FOLDS, label="fold wanted", **wanted)
        self.branch = self.line(left, color=COLOURS["rotor"], label="first leg")
        self.turn = self.line(left, "D", color=COLOURS["fold"])
        left.plot(0, AMPLITUDE, "o", color=COLOURS["stable"], markersize=14, fillstyle="none",
                  markeredgewidth=2.5, label="200 µm wanted")
        left.set(xlim=(0, 12), ylim=(0, 1200), xlabel="static eccentricity, %",
                 title="1X in x, µm (0-to-peak)")
        left.legend(loc="upper left")
        right.axvspan(*FOLDS, **wanted)
        right.axhspan(AMPLITUDE * (1 - NEAR), AMPLITUDE * (1 + NEAR), **wanted)
        self.trail = self.line(right, ".-", color="#AAAAAA", linewidth=1)
        self.now = self.line(right, "o", color=COLOURS["rotor"], markersize=11)
        right.set(xlim=(5, 12), ylim=(80, 400), xlabel="first fold, %",
                  ylabel="1X when centred, µm (0-to-peak)",
                  title="Both at once: where the bands cross")
        self.begin()

    def begin(self) -> None:
        """Forget all tries."""
        self.tries: list[tuple[float, float]] = []

    def _model(self, depth: float, mass: float, unbalance: float) -> Model:
        nodes = self.machine.shaft.nodes.copy()
        nodes[self.guide.node] = depth
        return vary(self.machine, {"shaft.nodes": nodes, "unbalance": unbalance,
                                   f"bodies.{self.body.name}.mass": 1e3 * mass}).model()

    def __call__(self, depth: float, mass: float, unbalance: float) -> str:
        """Show a depth of the guide bearing (m), a mass (t), a factor on the unbalance."""
        branch = follow(self._model(depth, mass, unbalance), speed=self.machine.speed, to=0.5,
                        method=Arclength(max_folds=1))
        first, leg = UM * first_along(branch), branch.first_leg
        self.branch.set_data(100 * branch.static_eccentricity[leg], first[leg])
        size = float(first[0])
        said = (f"With the {self.guide.name} at {depth:.3f} m, {mass:.1f} t and {unbalance:.2f} "
                f"times the unbalance, 1X is {size:.1f} µm when centred")
        if not branch.folds:
            for artist in (self.turn, self.now):
                artist.set_data([], [])
            return f"{said} (0-to-peak) and no fold was met: {branch.stopped}"
        fold = 100 * branch.folds[0].value
        self.turn.set_data([fold], [UM * branch.at_fold(0).amplitudes[0, 0]])
        if (fold, size) not in self.tries:
            self.tries = [*self.tries, (fold, size)][-TRIES:]
        self.trail.set_data(*zip(*self.tries, strict=True))
        hits = FOLDS[0] <= fold <= FOLDS[1], abs(size / AMPLITUDE - 1) <= NEAR
        self.now.set_data([fold], [size])
        self.now.set_color(COLOURS["stable"] if all(hits) else COLOURS["rotor"])
        return (f"{said} (0-to-peak; wanted {AMPLITUDE:.0f}) and the branch folds at {fold:.3f} % "
                f"(wanted {FOLDS[0]:.2f} to {FOLDS[1]:.2f}). {VERDICTS[hits]}")


def calibration_explorer(machine: Machine | None = None) -> FigureExplorer:
    """Find the numbers that a paper does not print: 200 µm when centred, and the first fold from
    8.90 to 8.95 %.

    It starts beside the card's values. machine: with a shaft and an air gap; by default the card
    "kaplan-150rpm". Raises BadInput for a machine without them.
    """
    view = CalibrationView(machine_with(machine, "kaplan-150rpm", "shaft", "air_gap"))
    body, guide = view.body, view.guide
    mass, depth = body.mass / 1e3, float(view.machine.shaft.nodes[guide.node])
    return FigureExplorer(view, {
        "depth": slider(f"depth of the {guide.name}, m", round(1.1 * depth, 2),
                        round(0.75 * depth, 2), round(1.35 * depth, 2), 0.002, 3),
        "mass": slider(f"mass of the {body.name}, t", round(mass, 1), round(0.5 * mass),
                       round(1.5 * mass), 0.5, 1),
        "unbalance": slider("unbalance, × the card's", 0.7, 0.3, 2.0, 0.01, 2)})
