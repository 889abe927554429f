"""Past the fold: hysteresis, basins, multipliers and maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.ensemble import CONTACT, OTHER, Basins
from hydrolab.dynamics.escape import Integrity
from hydrolab.dynamics.slow_change import Passage
from hydrolab.dynamics.stability import Floquet
from hydrolab.errors import BadInput
from hydrolab.figures.drawing import MM, UM
from hydrolab.figures.orbits import draw_branch, parameter_axis
from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import followed, listed, percent, said
from hydrolab.figures.style import (
    BLACK,
    BLUE,
    COLOURS,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    YELLOW,
    house_style,
    new_figure,
)

if TYPE_CHECKING:
    import xarray

PASSAGES = (("s", BLUE), ("^", ORANGE), ("v", PURPLE))
REACHED = (SKY, ORANGE, YELLOW, PURPLE, GREEN, BLUE, VERMILLION)


@house_style()
def hysteresis_picture(branch: Branch, stability: Sequence[Floquet],
                       passages: Mapping[str, Passage]) -> Picture:
    """A branch and what a machine does in time while its parameter moves slowly.

    Shown is x at the moment Ωt = 0: one dot a value where the motion repeats every revolution, more
    where it does not. passages: by name, as `sweep_in_time` and `drift` return them, along the
    parameter of the branch; at most three. Raises BadInput for others.
    """
    if len(passages) > len(PASSAGES) or any(passage.parameter != branch.parameter
                                            for passage in passages.values()):
        along = ", ".join(passage.parameter for passage in passages.values())
        raise BadInput(f"passages has {len(passages)}, along {along}; at most {len(PASSAGES)} are "
                       f"drawn, and the branch runs along {branch.parameter}.")
    figure = new_figure(10, 5.6)
    axes = figure.subplots()
    scale, label = parameter_axis(branch)
    # x at Ωt = 0 is the mean and the cosine coefficients.
    draw_branch(axes, branch, lambda c: c[..., 0, 0] + c[..., 0, 2::2].sum(axis=-1), stability)
    words = []
    for (name, passage), (marker, colour) in zip(passages.items(), PASSAGES, strict=False):
        values = np.repeat(scale * passage.values, passage.section.shape[1])
        axes.plot(values, UM * passage.section[:, :, 0].ravel(), marker, color=colour,
                  markersize=4.5, linestyle="none", label=f"{name}, in time")
        words.append(f"{name}: {_passage_words(branch, passage)}")
    axes.set(xlabel=label, ylabel="x at Ωt = 0, µm",
             title="Steady states, and a slow passage in time")
    axes.legend(loc="lower left")
    return Picture(figure, f"The generator's x at Ωt = 0 over the {followed(branch)}. "
                   + " ".join(words))


def _passage_words(branch: Branch, passage: Passage) -> str:
    """What it did on the way, where it jumped, and how it ends."""
    means = passage.section.mean(axis=1)
    jumps = np.abs(np.diff(means, axis=0)).max(axis=1, initial=0.0)
    jump = ""
    if len(jumps) and passage.settled.all() and jumps.max() > max(5 * np.median(jumps), 20e-6):
        jump = (f", with a jump of {MM * jumps.max():.2f} mm at "
                f"{said(branch, passage.values[int(np.argmax(jumps)) + 1])}")
    return f"{passage.told}{jump}. {passage.stopped} {passage.doubt}".strip(" .") + "."


@house_style()
def basins_picture(found: Basins, names: Sequence[str]) -> Picture:
    """Where each start ends; names: of the orbits, in their order, all different.

    Raises BadInput where the names do not fit the orbits, or there are more than can be told apart.
    """
    if len(set(names)) != len(found.orbits) or len(names) > len(REACHED):
        raise BadInput(f"names has {len(names)} for {len(found.orbits)} orbits; give each its own, "
                       f"and at most {len(REACHED)} orbits.")
    kinds = [*range(len(names)), OTHER, CONTACT]
    colours = [*REACHED[:len(names)], "#BBBBBB", BLACK]
    labels = [*names, "anything else", "contact"]
    shown = np.searchsorted(np.array(sorted(kinds)), found.ends)
    order = [kinds.index(kind) for kind in sorted(kinds)]
    figure = new_figure(9, 6.5)
    axes = figure.subplots()
    axes.pcolormesh(MM * found.displacement, MM * found.velocity, shown, shading="nearest",
                    vmin=-0.5, vmax=len(kinds) - 0.5,
                    cmap=ListedColormap([colours[i] for i in order]))
    axes.set(xlabel="starting displacement along x, mm", ylabel="starting velocity along x, mm/s",
             title=f"Where the rotor is after {found.revolutions} revolutions")
    axes.grid(False)
    axes.plot(0, 0, "+", color=BLACK, markersize=12, markeredgewidth=2)
    shares = [found.share(kind) for kind in kinds]
    figure.legend(handles=[Patch(color=colour, label=label) for colour, label, share
                           in zip(colours, labels, shares, strict=True) if share],
                  loc="outside lower center", ncols=4)
    words = listed(f"{100 * share:.0f} % end in {label}"
                   for label, share in zip(labels, shares, strict=True) if share)
    return Picture(figure, f"Of {found.ends.size} starts off {names[0]} (+), at phase 0, {words}.")


@house_style()
def integrity_picture(branch: Branch, found: Integrity,
                      stability: Sequence[Floquet] | None = None) -> Picture:
    """1X in x along a branch; under it the safe part of the basin along its first leg."""
    figure = new_figure(8.4, 5.6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    draw_branch(upper, branch, lambda c: np.hypot(c[..., 0, 1], c[..., 0, 2]), stability)
    upper.set(ylabel="1X, µm 0-to-peak", title="Steady states: 1X of x")
    upper.legend(loc="upper left")
    values = 100 * found.values
    for share, colour, style, label in ((found.safe, BLUE, "-", "do not touch"),
                                        (found.returning, ORANGE, "--", "come back to the orbit")):
        lower.plot(values, 100 * share, style, color=colour, label=label)
    if np.isfinite(found.fold):
        lower.axvline(100 * found.fold, color=COLOURS["fold"], linewidth=1.2, label="fold")
    lower.set(xlabel="static eccentricity, % of the gap", ylim=(0, None), ylabel="safe pushes, %",
              title=f"How much push the first leg stands, {percent(found.values[0])} is 100")
    lower.legend(loc="lower left")
    return Picture(figure, str(found))


@house_style()
def multipliers_picture(branch: Branch, stability: Sequence[Floquet], rows: Sequence[int],
                        count: int = 4) -> Picture:
    """The leading Floquet multipliers, so many as count says, of some rows of a branch, in the
    complex plane with the unit circle.
    """
    figure = new_figure(7.5, 6.5)
    axes = figure.subplots()
    turn = np.linspace(0, 2 * np.pi, 361)
    axes.plot(np.cos(turn), np.sin(turn), color=COLOURS["axis"], linewidth=1.5)
    for row in rows:
        leading = stability[row].multipliers[:count]
        axes.plot(leading.real, leading.imag, "o", color=COLOURS[stability[row].verdict],
                  markersize=6)
    for verdict in ("stable", "unstable", "unknown"):
        if any(stability[row].verdict == verdict for row in rows):
            axes.plot([], [], "o", color=COLOURS[verdict], label=verdict)
    axes.set(xlabel="real part", ylabel="imaginary part", title="Leading Floquet multipliers")
    axes.set_aspect("equal", adjustable="datalim")
    axes.legend(loc="upper right")
    values = [branch.path.say(branch.values[row]) for row in rows]
    outside = [value for value, row in zip(values, rows, strict=True)
               if stability[row].verdict == "unstable"]
    first = f", first at {outside[0]}" if outside else ""
    return Picture(figure, f"Multipliers at {len(rows)} points from {values[0]} to {values[-1]}; "
                           f"outside the unit circle at {len(outside)} of them{first}.")


@house_style()
def map_picture(found: xarray.Dataset, quantity: str = "smallest_gap", *, x_scale: float = 1.0,
                y_scale: float = 1.0, x_label: str = "", y_label: str = "") -> Picture:
    """One quantity of a map, with the line on which the first fold lies.

    x_scale, y_scale: factors on the axes' SI values; x_label, y_label say the unit that results.
    """
    values, unit = found[quantity].values, found[quantity].attrs["units"]
    scale, unit = (MM, "mm") if unit == "m" else (100.0, "%")
    x, y = x_scale * found.x.values, y_scale * found.y.values
    figure = new_figure(9.5, 6)
    axes = figure.subplots()
    mesh = axes.pcolormesh(x, y, scale * values, shading="nearest", cmap="viridis")
    figure.colorbar(mesh, ax=axes, label=f"{found[quantity].attrs['long_name']}, {unit}")
    distance = found["fold_distance"].values
    if np.isfinite(distance).all() and distance.min() < 0 < distance.max():
        axes.contour(x, y, distance, levels=[0.0], colors=[BLACK], linewidths=2.2)
    axes.set(xlabel=x_label or str(found.attrs["x_parameter"]),
             ylabel=y_label or str(found.attrs["y_parameter"]))
    axes.grid(False)
    known = values[np.isfinite(values)]
    share = 100 * len(known) / values.size
    span = (f"from {scale * known.min():.3g} to {scale * known.max():.3g} {unit}" if len(known)
            else "nowhere known")
    name = found[quantity].attrs["long_name"].capitalize()
    return Picture(figure, f"{name}: {span} on {share:.0f} % of the map; the rest has no steady "
                           "state on the first leg, beyond the line of the first fold.")
