"""A machine from the side, with what its source states on the left and what was chosen for it on the right."""

from __future__ import annotations

import textwrap
from collections import Counter

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from hydrolab.machine.checks import quantity
from hydrolab.machine.parts import Machine
from hydrolab.show.picture import Picture
from hydrolab.show.readings import listed
from hydrolab.show.style import COLOURS, house_style, new_figure

STATED = ("paper", "Table 1")
WHENCE = {"paper": "stand in the paper's text", "Table 1": "in its Table 1", "calibrated": "are calibrated",
          "assumed": "assumed", "derived": "derived"}
LETTERS = {"young": "E", "density": "ρ", "poisson": "ν", "shear_coefficient": "shear coefficient κ"}
SIDE = 4.6  # m, from the axis to the columns of words
LEFT, RIGHT = COLOURS["x"], COLOURS["z"]


def counts(machine: Machine) -> Counter[str]:
    """How many numbers of the card come from each source."""
    return Counter(entry.source for entry in machine.provenance.values())


def _words(machine: Machine, prefix: str, stated: bool) -> str:
    """The numbers of one part that are stated, or that are not, as "mass 119 t, …"."""
    found = []
    for key, entry in machine.provenance.items():
        name = key.rpartition(".")[2]
        if key.startswith(f"{prefix}.") and (entry.source in STATED) == stated and name != "nodes":
            value = quantity(float(f"{entry.value:.4g}"), entry.unit).replace("^2", "²").replace("^3", "³")
            found.append(f"{LETTERS.get(name, name.replace('_', ' '))} {value}")
    return ", ".join(found)


def _parts(machine: Machine) -> list[tuple[str, str, float, str]]:
    """(name, prefix of its keys, depth in m, what is chosen of its place) of each part that is labelled."""
    nodes = machine.shaft.nodes
    rows = [(b.name, f"bodies.{b.name}", float(nodes[b.node] + b.offset), "") for b in machine.bodies]
    rows += [(b.name, f"bearings.{b.name}", float(nodes[b.node]), f"depth {nodes[b.node]:.3f} m")
             for b in (*machine.bearings, *machine.thrust_bearings)]
    return sorted(rows, key=lambda row: row[2])


def _label(axes: Axes, side: int, depth: float, name: str, words: str) -> None:
    if words:
        axes.text(side * SIDE, depth, textwrap.fill(f"{name}: {words}", 38), ha="right" if side < 0 else "left",
                  va="center", fontsize=12, color=LEFT if side < 0 else RIGHT)
        axes.plot([side * 0.5, side * (SIDE - 0.1)], [depth, depth], color=LEFT if side < 0 else RIGHT, linewidth=0.8)


@house_style()
def sources_picture(machine: Machine) -> Picture:
    """The machine from the side, to scale, each part with its stated numbers (left) and its chosen ones (right)."""
    shaft, gap = machine.shaft, machine.air_gap
    figure = new_figure(12.5, 6.2)
    axes = figure.subplots()
    half = float(shaft.diameter.max()) / 2
    axes.add_patch(Rectangle((-half, 0), 2 * half, shaft.length, color=COLOURS["axis"], alpha=0.45, linewidth=0))
    for name, prefix, depth, place in _parts(machine):
        if prefix.startswith("bodies"):
            wide, tall = (gap.mean_radius - gap.gap / 2, gap.length) if gap and name == gap.body else RUNNER
            axes.add_patch(Rectangle((-wide, depth - tall / 2), 2 * wide, tall, color=COLOURS["rotor"], alpha=0.4,
                                     linewidth=0))
        else:
            for side, marker in ((-1, ">"), (1, "<")):
                axes.plot(side * (half + 0.2), depth, marker, color=COLOURS["axis"], markersize=11)
        _label(axes, -1, depth, name, _words(machine, prefix, True))
        _label(axes, 1, depth, name, ", ".join(filter(None, (place, _words(machine, prefix, False)))))
    _label(axes, -1, 0.72 * shaft.length, "shaft", _words(machine, "shaft", True))
    _label(axes, 1, 0.72 * shaft.length, "shaft", _words(machine, "shaft", False))
    axes.set(ylim=(shaft.length + 1.0, -1.6), xlim=(-12, 12), ylabel="y, m (down)", xticks=[], aspect="equal")
    axes.grid(visible=False)
    for side, title in ((-1, "stated by the paper"), (1, "chosen for this course")):
        axes.text(side * SIDE, -1.35, title, ha="right" if side < 0 else "left", fontsize=14, weight="bold",
                  color=LEFT if side < 0 else RIGHT)
    number = counts(machine)
    words = (f"Of the {number.total()} numbers on the card of {machine.name}, "
             f"{listed(f'{number[source]} {words}' for source, words in WHENCE.items() if source in number)}. "
             "No depth of a bearing is stated.")
    return Picture(figure, words)
