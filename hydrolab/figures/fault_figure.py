"""What each fault does to orbit and spectrum, with the field on and off, and at other speeds."""

from __future__ import annotations

import math

import numpy as np

from hydrolab.figures.drawing import MM, REVOLUTION, RPM, UM, draw_arrow, draw_axis
from hydrolab.figures.picture import Picture
from hydrolab.figures.readings import listed, microns
from hydrolab.figures.style import COLOURS, house_style, new_figure
from hydrolab.paper.faults import FaultRow, FaultTable

ORDERS = ("mean", "1X", "2X", "3X")
LEAST = 0.1  # µm; what is smaller is not drawn, and said to be nothing


@house_style()
def fault_picture(table: FaultTable) -> Picture:
    """Orbits of each fault at the rated speed, with the field on and off, and their mean, 1X, 2X
    and 3X in bars.

    Marks beside the bars are the same at the table's other speeds, with the field on.
    """
    count = len(table.faults)
    figure = new_figure(2.4 * max(count, 3), 7.2)
    upper, lower = figure.subfigures(2, 1, height_ratios=(1, 1.6))
    _orbits(upper.subplots(1, count, sharex=True, sharey=True, squeeze=False)[0], table)
    _bars(lower.subplots(1, 1), table)
    return Picture(figure, fault_reading(table))


def _orbits(panels: np.ndarray, table: FaultTable) -> None:
    for axes, fault in zip(panels, table.faults, strict=True):
        for field, colour, line in ((0.0, COLOURS["axis"], "--"), (1.0, COLOURS["rotor"], "-")):
            row = table.row(fault, field)
            if row.orbit is None:
                axes.text(0.5, 0.5, "none found", transform=axes.transAxes, ha="center")
                continue
            path = row.orbit.positions(REVOLUTION)
            axes.plot(*(MM * path), line, color=colour, label=f"field {'on' if field else 'off'}")
            draw_arrow(axes, path, colour)
        draw_axis(axes)
        axes.set_aspect("equal", adjustable="box")
        axes.set_title(fault)
        axes.set_xlabel("x, mm")
    panels[0].set_ylabel("z, mm")
    handles, labels = panels[0].get_legend_handles_labels()
    panels[0].figure.legend(handles, labels, ncols=2, loc="outside upper center")


def _bars(axes, table: FaultTable) -> None:
    width = 0.8 / len(ORDERS)
    for i, order in enumerate(ORDERS):
        places = np.arange(len(table.faults)) + (i - 1.5) * width
        for field, fill in ((1.0, True), (0.0, False)):
            heights = [UM * sizes(table.row(fault, field))[i] for fault in table.faults]
            shown = np.where(np.nan_to_num(heights) > LEAST, heights, np.nan)
            axes.bar(places, shown, 0.9 * width, color=COLOURS[order] if fill else "none",
                     alpha=0.75 if fill else 1.0,
                     edgecolor="none" if fill else COLOURS["axis"], linewidth=1.6,
                     label=f"{order}, field on" if fill else "field off" if i == len(ORDERS) - 1
                     else "")
        for speed, mark in zip(other_speeds(table), "DsvP", strict=False):
            heights = np.array([UM * sizes(table.row(fault, 1.0, speed))[i]
                                for fault in table.faults])
            shown = np.where(np.nan_to_num(heights) > LEAST, heights, np.nan)
            axes.plot(places, shown, mark, color="white", markeredgecolor="black", markersize=8,
                      linestyle="none",
                      label=f"at {speed / RPM:.4g} rpm, field on" if i == len(ORDERS) - 1 else "")
    axes.set_yscale("log")
    axes.set_ylim(bottom=LEAST)
    axes.set_xticks(np.arange(len(table.faults)), table.faults)
    axes.set_ylabel("µm (0-to-peak)")
    axes.grid(visible=False, axis="x")
    axes.legend(ncols=len(ORDERS) + 2, loc="lower center", bbox_to_anchor=(0.5, 1.0))


def other_speeds(table: FaultTable) -> list[float]:
    """The table's speeds but the machine's own, rad/s."""
    speeds = dict.fromkeys(row.speed for row in table.rows)
    return [speed for speed in speeds if not math.isclose(speed, table.machine.speed)]


def _speed_words(table: FaultTable, solved: list[FaultRow]) -> str:
    """How the 2X of each fault changes at the other speeds, field on; least and most."""
    said = ""
    for speed in other_speeds(table):
        shares = {row.fault: there.size(2) / row.size(2) for row in solved
                  if (there := table.row(row.fault, 1.0, speed)).orbit is not None
                  and row.size(2) * UM > LEAST}
        if shares:
            least, most = min(shares, key=shares.get), max(shares, key=shares.get)
            said += (f" At {speed / RPM:.4g} rpm with the field on 2X is {shares[least]:.2f} "
                     f"({least}) to "
                     f"{shares[most]:.2f} ({most}) times that at {table.machine.speed / RPM:.4g} "
                     "rpm.")
    return said


def sizes(row: FaultRow) -> tuple[float, ...]:
    """Mean, 1X, 2X and 3X of a row, m."""
    return row.mean, row.size(1), row.size(2), row.size(3)


def fault_reading(table: FaultTable) -> str:
    """What stands out in the table: at the rated speed the largest 2X and 3X, the flattest 1X, what
    is left without the field; and how 2X changes with the speed.
    """
    on = [table.row(fault) for fault in table.faults]
    off = [row for fault in table.faults if (row := table.row(fault, 0.0)).orbit is not None]
    solved = [row for row in on if row.orbit is not None]
    if not solved:
        return "No fault has a steady state with the field on."
    second, third = (max(solved, key=lambda row, k=k: row.size(k)) for k in (2, 3))
    flat = min(solved, key=lambda row: row.shape.ratio)
    left = [row.fault for row in off if max(row.size(2), row.size(3)) * UM > LEAST]
    lost = [row.fault for row in on if row.orbit is None]
    doubtful = [f"{row.fault} ({row.verdict})" for row in solved if row.verdict != "stable"]
    return (f"With the field on 2X is largest with {second.fault}, {microns(second.size(2))} or "
            f"{100 * second.size(2) / second.size(1):.0f} % of 1X, and 3X with {third.fault}, "
            f"{microns(third.size(3))}; the "
            f"1X ellipse is flattest with {flat.fault}, minor over major {flat.shape.ratio:.2f}. "
            + (f"With the field off 2X or 3X above {LEAST:g} µm are left with {listed(left)}."
               if left else
               f"With the field off no fault leaves 2X or 3X above {LEAST:g} µm"
               + (", so switching it off does not tell the faults apart." if len(table.faults) > 1
                  else "."))
            + (f" Not stable: {listed(doubtful)}." if doubtful else "")
            + (f" No steady state was found with {listed(lost)}." if lost else "")
            + (" 1X without the field is " + _span([row.size(1) for row in off]) + "." if off
               else "")
            + _speed_words(table, solved))


def _span(values: list[float]) -> str:
    low, high = min(values), max(values)
    return microns(low) if math.isclose(low, high,
                                        rel_tol=1e-3) else f"{microns(low)} to {microns(high)}"
