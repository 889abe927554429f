"""Pictures of the chapters that show no result: the axes on a machine, the air gap with its
magnetic pressure, a machine with what its source states on the left and what was chosen on the
right.
"""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from hydrolab.figures import COLOURS, Picture, house_style, new_figure
from hydrolab.figures.readings import listed
from hydrolab.machine import Machine
from hydrolab.machine.quantities import quantity

TURN = np.linspace(0.0, 2 * np.pi, 361)
RUNNER = (1.3, 0.8)  # half width and height that are drawn of a turbine, m: no size is known
ARROW = {"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0, "linewidth": 2.0, "mutation_scale": 18}
STATED = ("paper", "Table 1")
WHENCE = {"paper": "stand in the paper's text", "Table 1": "in its Table 1",
          "calibrated": "are calibrated", "assumed": "assumed", "derived": "derived"}
LETTERS = {"young": "E", "density": "ρ", "poisson": "ν", "shear_coefficient": "shear coefficient κ"}
SIDE = 4.6  # m, from the axis to the columns of words


def _arrow(axes: Axes, tail: tuple[float, float], tip: tuple[float, float], colour: str,
           **more: Any) -> None:
    axes.annotate("", xy=tip, xytext=tail, arrowprops=ARROW | {"color": colour} | more)


def _arc(axes: Axes, radius: float, start: float, end: float, colour: str) -> None:
    """An arc with an arrowhead between two gap angles, from z towards x, about the origin."""
    angle = np.linspace(start, end, 60)
    axes.plot(radius * np.sin(angle), radius * np.cos(angle), color=colour, linewidth=2)
    _arrow(axes, *((radius * math.sin(a), radius * math.cos(a)) for a in angle[[-3, -1]]), colour)


def _box(axes: Axes, left: float, top: float, wide: float, tall: float, colour: str,
         alpha: float = 1.0) -> None:
    axes.add_patch(Rectangle((left, top), wide, tall, color=COLOURS[colour], alpha=alpha,
                             linewidth=0))


def _from_the_side(axes: Axes, machine: Machine) -> list[tuple[float, float, str]]:
    """The machine to scale, y down; where to point at each part, m, and what it is and does."""
    shaft, half = machine.shaft, float(machine.shaft.diameter.max()) / 2
    words = [(half, shaft.length * 0.55, f"**shaft** carries the torque: {shaft.length:.2f} m of "
              f"steel, {2e3 * half:.0f} mm thick")]
    _box(axes, -half, 0, 2 * half, shaft.length, "axis", 0.6)
    for body in machine.bodies:
        turns = machine.air_gap is not None and body.name == machine.air_gap.body
        draw = _draw_generator if turns else _draw_runner
        words += draw(axes, machine, _depth(machine, body), f"{body.mass / 1e3:.0f} t")
    for bearing in machine.all_bearings:
        y = _depth(machine, bearing)
        wide = 2.2 * half if "thrust" in bearing.name else half
        for side in (-1, 1):
            _box(axes, side * (wide + 0.25) - 0.25, y - 0.15, 0.5, 0.3, "bearing")
        if wide > half:
            _box(axes, -wide, y - 0.22, 2 * wide, 0.12, "axis", 0.9)  # the collar
        words.append((wide + 0.5, y, f"**{bearing.name}** " + (
            "carries the weight on a film of oil" if wide > half else
            "keeps the shaft in the middle") + _stiffness(bearing)))
    return sorted(words, key=lambda word: word[1])


def _depth(machine: Machine, part: Any) -> float:
    return float(machine.shaft.nodes[part.node]) + getattr(part, "offset", 0.0)


@house_style()
def conventions_picture(machine: Machine) -> Picture:
    """The machine from the side with y pointing down; the plane across it with angle and spin."""
    figure = new_figure(12, 6)
    side, above = figure.subplots(1, 2)
    _draw_side(side, machine)
    _draw_above(above)
    generator = machine.body(machine.air_gap.body)
    depth = f"{_depth(machine, generator):.3f}".replace("-", "−")
    return Picture(figure, f"Left, {machine.name} from the side: y points down from the shaft top, "
                   f"the {generator.name}'s centre lies at y = {depth} m, the shaft ends at "
                   f"{machine.shaft.length:.2f} m. Right, the plane (x, z) from above: the gap "
                   "angle φ runs from z towards x, and so does the spin, clockwise.")


def _draw_side(axes: Axes, machine: Machine) -> None:
    for x, y, text in _from_the_side(axes, machine):
        name = text.split("**")[1]
        if name not in ("shaft", "air gap"):
            place = (0.3 * x, y - 0.3) if "rotor" in name else (x * (1.22 if y < 0 else 1), y)
            axes.annotate(f" {name}", place, va="center", fontsize=12)
    _arrow(axes, (-2.6, 1.2), (-2.6, 4.2), COLOURS["mean"])
    axes.annotate("y", (-2.6, 4.3), ha="center", va="top", fontsize=16)
    axes.set(xlim=(-4.2, 5.4), ylim=(10.6, -1.7), aspect="equal", xlabel="x, m",
             ylabel="depth y, m", title="From the side (the runner's size is a guess)")


@house_style()
def section_picture(machine: Machine) -> Picture:
    """A section through the machine from its card, to scale but for the air gap: what each part is
    called, what it does and how large it is. Outlines without a number on the card are guesses.
    """
    figure = new_figure(12, 8)
    axes = figure.subplots()
    words = _from_the_side(axes, machine)
    _name_parts(axes, words)
    read = "; ".join(text.replace("**", "") for _, _, text in words)
    return Picture(figure, f"Section through {machine.name}, from the top down: {read}.")


def _stiffness(bearing: Any) -> str:
    stiffness = getattr(bearing, "stiffness", None)
    value = 0.0 if stiffness is None else float(np.max(stiffness))
    return f", {value / 1e9:.2f} MN a millimetre" if value else ""


def _draw_generator(axes: Axes, machine: Machine, y: float, mass: str) -> list:
    """Rotor with hub, arms, rim and poles; stator core in its frame."""
    air = machine.air_gap
    radius, tall = air.mean_radius - air.gap / 2, air.length
    _box(axes, -0.16 * radius, y - 0.6 * tall, 0.32 * radius, max(1.2 * tall, 0.6 * tall - y),
         "rotor", 0.9)  # the hub, down to the shaft top
    for side in (-1, 1):
        _box(axes, min(0, side * 0.75 * radius), y - tall / 6, 0.75 * radius, tall / 3, "rotor",
             0.45)
        _box(axes, side * 0.81 * radius - 0.07 * radius, y - tall / 2, 0.14 * radius, tall, "rotor")
        _box(axes, side * 0.94 * radius - 0.06 * radius, y - tall / 2, 0.12 * radius, tall, "1X")
        _box(axes, side * 1.12 * radius - 0.1 * radius, y - tall / 2, 0.2 * radius, tall, "stator")
        _box(axes, side * 1.27 * radius - 0.05 * radius, y - 0.8 * tall, 0.1 * radius, 1.6 * tall,
             "axis", 0.35)
    return [(0.86 * radius, y - tall / 2, f"**generator rotor** {mass}, ⌀ {2 * radius:.2f} m: hub, "
             "arms, rim, and poles with coils"),
            (1.1 * radius, y, "**stator** takes the current: bore ⌀ "
             f"{2 * (radius + air.gap):.2f} m, {tall:.2f} m high"),
            (1.005 * radius, y + tall / 2, f"**air gap** {1e3 * air.gap:.0f} mm all around, a "
             f"{2 * radius / air.gap:.0f}th of the rotor; too thin to be seen here")]


def _draw_runner(axes: Axes, machine: Machine, y: float, mass: str) -> list:
    """A hub with blades, in its throat."""
    wide, tall = RUNNER
    axes.fill([-0.55, 0.55, 0.35, -0.35], [y - tall, y - tall, y + 1.1, y + 1.1],
              color=COLOURS["rotor"], linewidth=0)
    for side in (-1, 1):
        axes.fill(side * np.array([0.5, wide, wide, 0.5]), y + np.array([-0.05, -0.4, -0.1, 0.25]),
                  color=COLOURS["rotor"], alpha=0.6, linewidth=0)
        axes.plot(side * np.array([1.2, 1.08, 1.15]) * wide, y + np.array([-1.2, 0.0, 1.2]),
                  color=COLOURS["axis"], linewidth=3, alpha=0.5)
    return [(wide, y - 0.25, f"**turbine runner** {mass}: its blades turn to follow the water "
             "(size guessed)")]


def _name_parts(axes: Axes, words: list[tuple[float, float, str]]) -> None:
    """Write what each part is beside the drawing, at even heights, with a line to it."""
    low, high = words[0][1] - 0.9, words[-1][1] + 0.6
    for place, (x, y, text) in zip(np.linspace(low, high, len(words)), words, strict=True):
        name, said = text.removeprefix("**").split("**")
        axes.plot([x, 4.3], [y, place], color=COLOURS["axis"], linewidth=0.8)
        axes.annotate(name, (4.4, place), va="bottom", fontsize=13, weight="bold")
        axes.annotate(textwrap.fill(said.lstrip(" ,:"), 46), (4.4, place + 0.08), va="top",
                      fontsize=11)
    axes.set(xlim=(-4.4, 9.4), ylim=(high + 1.2, low - 0.6), aspect="equal", ylabel="depth y, m")
    axes.set_xticks([-3, 0, 3])
    axes.grid(False)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _draw_above(axes: Axes) -> None:
    axes.plot(1.25 * np.sin(TURN), 1.25 * np.cos(TURN), color=COLOURS["stator"], linewidth=6)
    axes.fill(np.sin(TURN), np.cos(TURN), color=COLOURS["rotor"], alpha=0.25, linewidth=0)
    for tip, name, at in (((1.6, 0.0), "x", (1.68, 0.0)), ((0.0, 1.6), "z", (0.0, 1.7))):
        _arrow(axes, (0.0, 0.0), tip, COLOURS["mean"])
        axes.annotate(name, at, ha="center", va="center", fontsize=16)
    _arc(axes, 0.55, 0.0, math.radians(50), COLOURS["1X"])
    axes.plot([0, math.sin(math.radians(50))], [0, math.cos(math.radians(50))],
              color=COLOURS["1X"], linewidth=1.4)
    axes.annotate("φ", (0.27, 0.62), fontsize=16, color=COLOURS["axis"])
    _arc(axes, 0.8, math.radians(130), math.radians(230), COLOURS["rotor"])
    axes.annotate("spin Ω", (0.0, -0.6), ha="center", fontsize=14)
    axes.plot(0.0, 0.88, "o", color=COLOURS["mean"], markersize=11)
    axes.annotate("heavy spot\nat Ωt = 0", (-0.1, 0.83), ha="right", va="top", fontsize=12)
    axes.annotate("air gap, drawn far too wide", (0.0, -1.5), ha="center", fontsize=12)
    axes.set(xlim=(-1.85, 1.85), ylim=(-1.85, 1.85), aspect="equal", title="From above")
    axes.set_axis_off()


@house_style()
def gap_picture(eccentricity: float) -> Picture:
    """The gap around a rotor displaced along x by a fraction of the gap, the magnetic pressure, and
    what it adds up to.

    The gap is drawn as a third of the rotor's radius.
    """
    gap = 1 / 3
    figure = new_figure(6.6, 5.6)
    axes = figure.subplots()
    stator, centre = 1 + gap, eccentricity * gap
    axes.fill(1.18 * stator * np.sin(TURN), 1.18 * stator * np.cos(TURN), color=COLOURS["stator"],
              alpha=0.5, linewidth=0)
    axes.fill(stator * np.sin(TURN), stator * np.cos(TURN), color="white", linewidth=0)
    axes.fill(centre + np.sin(TURN), np.cos(TURN), color=COLOURS["rotor"], alpha=0.3, linewidth=0)
    for angle in np.radians(np.arange(0, 360, 15)):
        pressure = (1 - eccentricity * math.sin(angle)) ** -2
        foot = np.array([centre + math.sin(angle), math.cos(angle)])
        tip = foot + 0.07 * pressure * np.array([math.sin(angle), math.cos(angle)])
        _arrow(axes, tuple(foot), tuple(tip), COLOURS["unstable"], linewidth=1.2, mutation_scale=9)
    axes.plot(0, 0, "x", color=COLOURS["axis"], markersize=9, markeredgewidth=2)
    axes.plot(centre, 0, "o", color=COLOURS["rotor"], markersize=7)
    if eccentricity:
        _arrow(axes, (centre, 0.0), (centre + math.copysign(0.7, eccentricity), 0.0),
               COLOURS["mean"], linewidth=3.5)
        axes.annotate("pull on the rotor", (centre + math.copysign(0.4, eccentricity), 0.06),
                      ha="center", fontsize=13)
    axes.annotate("stator centre", (-0.05, -0.06), ha="right", va="top", fontsize=12)
    axes.annotate("x", (1.72, 0), fontsize=15, va="center")
    axes.annotate("z", (0, 1.68), fontsize=15, ha="center")
    axes.set(xlim=(-1.8, 1.85), ylim=(-1.7, 1.8), aspect="equal")
    axes.set_axis_off()
    strongest, weakest = (1 - abs(eccentricity)) ** -2, (1 + abs(eccentricity)) ** -2
    return Picture(figure, f"The rotor is displaced by {100 * eccentricity:.0f} % of the gap along "
                   f"x (the gap is drawn far too wide): the magnetic pressure is {strongest:.2f} "
                   f"times its mean-gap value where the gap is smallest and {weakest:.2f} times "
                   "where it is largest, so the pull acts along "
                   f"{'+' if eccentricity > 0 else '−'}x, towards the small gap.")


def counts(machine: Machine) -> Counter[str]:
    """How many numbers of the card come from each source."""
    return Counter(entry.source for entry in machine.provenance.values())


def _words(machine: Machine, prefix: str, stated: bool) -> str:
    """The numbers of one part that are stated, or that are not, as "mass 119 t, …"."""
    found = []
    for key, entry in machine.provenance.items():
        name = key.rpartition(".")[2]
        if key.startswith(f"{prefix}.") and (entry.source in STATED) == stated and name != "nodes":
            number, _, unit = quantity(float(f"{entry.value:.4g}"), entry.unit).partition(" ")
            unit = unit.replace("^2", "²").replace("^3", "³")
            found.append(f"{LETTERS.get(name, name.replace('_', ' '))} {number} {unit}".rstrip())
    return ", ".join(found)


def _label(axes: Axes, side: int, depth: float, name: str, words: str) -> None:
    """Words on one side of the machine, −1 or 1, with a line to it; none where there are none."""
    if words:
        colour = COLOURS["x" if side < 0 else "z"]
        axes.text(side * SIDE, depth, textwrap.fill(f"{name}: {words}", 38), va="center",
                  ha="right" if side < 0 else "left", fontsize=12, color=colour)
        axes.plot([side * 0.5, side * (SIDE - 0.1)], [depth, depth], color=colour, linewidth=0.8)


@house_style()
def sources_picture(machine: Machine) -> Picture:
    """The machine from the side, to scale, each part with its stated and its chosen numbers."""
    shaft = machine.shaft
    figure = new_figure(12.5, 6.2)
    axes = figure.subplots()
    _from_the_side(axes, machine)
    rows = [(_depth(machine, body), body, "") for body in machine.bodies]
    rows += [(_depth(machine, bearing), bearing, f"depth {_depth(machine, bearing):.3f} m")
             for bearing in machine.all_bearings]
    rows.append((0.72 * shaft.length, shaft, ""))
    for depth, part, place in rows:
        name = getattr(part, "name", "shaft")
        chosen = ", ".join(filter(None, (place, _words(machine, part.key, False))))
        _label(axes, -1, depth, name, _words(machine, part.key, True))
        _label(axes, 1, depth, name, chosen)
    axes.set(ylim=(shaft.length + 1.0, -1.6), xlim=(-12, 12), ylabel="y, m (down)", xticks=[],
             aspect="equal")
    axes.grid(visible=False)
    for side, title in ((-1, "stated by the paper"), (1, "chosen for this course")):
        axes.text(side * SIDE, -1.35, title, ha="right" if side < 0 else "left", fontsize=14,
                  weight="bold", color=COLOURS["x" if side < 0 else "z"])
    number = counts(machine)
    said = listed(f"{number[source]} {words}" for source, words in WHENCE.items()
                  if source in number)
    return Picture(figure, f"Of the {number.total()} numbers on the card of {machine.name}, "
                   f"{said}. No depth of a bearing is stated.")
