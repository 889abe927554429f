"""Where the negative stiffness of design tools is safe: the pull as F = k e against the nonlinear
pull.

A tool that knows linear bearings takes the pull as a bearing of negative stiffness. That is right
for small eccentricity and leaves out that the pull grows faster than the eccentricity. What a
designer reads off both is compared on the hydropower unit: critical speed, 1X amplitude, largest
bearing force, static bend, and over eccentricity and field the amplitude and the smallest gap. The
map is solved by two processes; `Client().get_executor()` of Dask in place of the pool solves it on
a cluster.
"""

import math
import multiprocessing
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy.linalg

from hydrolab import HarmonicBalance, ellipse, load_machine, steady_map
from hydrolab.dynamics import PeriodicOrbit, rates, synthesise
from hydrolab.figures import COLOURS, Picture, house_style, new_figure
from hydrolab.machine import Machine

PHASES = np.linspace(0, 2 * np.pi, 360, endpoint=False)
LINEAR, NONLINEAR = HarmonicBalance(1), HarmonicBalance(6)


def practice(machine: Machine) -> Machine:
    """The machine with its pull as design tools take it."""
    return replace(machine, air_gap=replace(machine.air_gap, linear=True))


class DesignNumbers(NamedTuple):
    """What a designer reads off a steady state: rad/s, m (1X, long half axis), N, m."""

    critical_speed: float
    amplitude: float
    bearing_force: float
    bend: float


def design_numbers(machine: Machine, orbit: PeriodicOrbit) -> DesignNumbers:
    """The numbers of a machine's steady state, the pull's slope taken as its mean on the orbit."""
    model = orbit.model
    slope = model.law.linearise(orbit.positions(PHASES) - orbit.centre[:, None])[1].mean(axis=-1)
    stiffness = model.K - model.selection.T @ slope @ model.selection
    return DesignNumbers(forward_critical(model.M, model.G, stiffness),
                         ellipse(orbit.coefficients).major, bearing_force(machine, orbit),
                         float(np.hypot(*orbit.mean)))


def forward_critical(M: np.ndarray, G: np.ndarray, K: np.ndarray) -> float:
    """Lowest ω of K q = ω² (M − iG) q that turns with the spin, rad/s; an unbalance drives it.

    nan where the stiffness holds nothing or no such whirl keeps step with the rotation.
    """
    if scipy.linalg.eigvalsh(K, subset_by_index=[0, 0])[0] <= 0:
        return math.nan
    inverse, q = scipy.linalg.eigh(M - 1j * G, K)  # 1/ω², ascending
    step = 4 if len(K) > 2 else 2  # x, z and, with a shaft, two tilts at each node
    turns = np.imag(np.conj(q[0::step]) * q[1::step]).sum(axis=0)  # z leads x by a quarter turn
    forward = inverse[(turns >= -1e-9 * np.abs(turns).max()) & (inverse > 0)]
    return 1 / math.sqrt(forward[-1]) if len(forward) else math.nan


def bearing_force(machine: Machine, orbit: PeriodicOrbit) -> float:
    """Largest |k u + c u̇| of a radial bearing over a revolution, N."""
    largest = 0.0
    for bearing in machine.bearings:
        u = orbit.node_coefficients(bearing.node)
        force = bearing.stiffness @ u + bearing.damping @ (orbit.speed * rates(u))
        largest = max(largest, float(np.hypot(*synthesise(force, PHASES)).max()))
    return largest


def compare(machine: Machine, eccentricity: float) -> tuple[DesignNumbers, DesignNumbers]:
    """The numbers by the practice and by the nonlinear pull, at the rated speed."""
    simple = practice(machine)
    linear = LINEAR.solve(simple.model(), machine.speed, eccentricity)
    exact = NONLINEAR.solve(machine.model(), machine.speed, eccentricity)
    return design_numbers(simple, linear), design_numbers(machine, exact)


class Errors(NamedTuple):
    """practice/nonlinear − 1 over fields and eccentricities, (f, e); nan past the first fold."""

    amplitude: np.ndarray
    smallest_gap: np.ndarray
    folds: np.ndarray  # fraction of the gap, (f,)

    def safe_to(self, eccentricities: np.ndarray, tolerance: float) -> np.ndarray:
        """Up to which eccentricity both errors stay within a tolerance at each field, (f,)."""
        worst = np.maximum(np.abs(self.amplitude), np.abs(self.smallest_gap))
        inside = np.logical_and.accumulate(worst <= tolerance, axis=1).sum(axis=1)
        return np.where(inside, eccentricities[np.maximum(inside - 1, 0)], np.nan)


def practice_errors(machine: Machine, eccentricities: np.ndarray, fields: np.ndarray,
                    executor: Executor | None = None) -> Errors:
    """Map the errors over static eccentricity (fraction of the gap) and field (on the card's)."""
    found = steady_map(machine, "static_eccentricity", eccentricities,
                       "field", fields * machine.air_gap.field, executor=executor)
    linear = practice(machine).model()
    simple = [[LINEAR.solve(linear.with_field(field), machine.speed, e) for e in eccentricities]
              for field in fields]
    # the practice's orbit is a circle, whose size along the eccentricity is its amplitude
    amplitude = np.array([[ellipse(orbit.coefficients).major for orbit in row] for row in simple])
    gap = np.array([[orbit.smallest_gap for orbit in row] for row in simple])
    return Errors(amplitude / found.amplitude.values - 1, gap / found.smallest_gap.values - 1,
                  found.fold_distance.values[:, 0] + abs(eccentricities[0]))


@house_style()
def picture(errors: Errors, eccentricities: np.ndarray, fields: np.ndarray) -> Picture:
    """Both errors over eccentricity and field, with the line of the first folds."""
    figure = new_figure(13, 5.4)
    panels = figure.subplots(1, 2, sharey=True)
    levels = [-50, -20, -10, -5, -2, -1, 1, 2, 5, 10, 20, 50]
    for axes, name in zip(panels, ("amplitude", "smallest_gap"), strict=True):
        lines = axes.contour(100 * eccentricities, fields, 100 * getattr(errors, name),
                             levels=levels, cmap="cividis", linewidths=2.5)
        axes.clabel(lines, fmt="%g %%")
        axes.plot(100 * errors.folds, fields, "D-", color=COLOURS["unstable"], label="first fold")
        axes.set(title=f"{name.replace('_', ' ')}: practice less nonlinear, %",
                 xlabel="static eccentricity, % of the gap", xlim=100 * eccentricities[[0, -1]])
        axes.legend()
    panels[0].set_ylabel("flux density over the card's")
    row = int(np.argmin(np.abs(fields - 1)))
    at = np.flatnonzero(np.isfinite(errors.amplitude[row]))[-1]
    return Picture(figure, f"At {fields[row]:.3g} of the card's field the negative stiffness sees "
                   f"{100 + 100 * errors.amplitude[row, at]:.0f} % of the 1X amplitude and "
                   f"{100 + 100 * errors.smallest_gap[row, at]:.0f} % of the smallest gap at "
                   f"{100 * eccentricities[at]:.3g} %, the last point before the fold at "
                   f"{100 * errors.folds[row]:.4g} %, which has no counterpart in it.")


def main() -> None:
    """Print the finding, both sets of numbers, and how far the practice is safe at each field."""
    unit = load_machine("kaplan-150rpm")
    eccentricities, fields = np.linspace(0, 0.15, 31), np.linspace(0.3, 1.1, 33)
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as pool:
        errors = practice_errors(unit, eccentricities, fields, pool)
    five, ten = (100 * errors.safe_to(eccentricities, tolerance) for tolerance in (0.05, 0.1))
    row = int(np.argmin(np.abs(fields - 1)))
    print(f"Finding: at the card's field the practice keeps 1X and smallest gap within 5 % only up "
          f"to {five[row]:.1f} % static eccentricity, and at 8.5 % it sees "
          f"{100 + 100 * errors.amplitude[row, 17]:.0f} % of the 1X amplitude. The fold at "
          f"{100 * errors.folds[row]:.2f} % has no counterpart in it.\n")
    print("static         critical speed, rpm    1X, µm                bearing force, kN     "
          "static bend, µm")
    print("eccentricity   practice  nonlinear  " + "  practice  nonlinear" * 3)
    for eccentricity in (0.0, 0.02, 0.04, 0.06, 0.08):
        print(f"{100 * eccentricity:6.0f} %    " + "  ".join(
            f"{simple * scale:9.1f} {exact * scale:9.1f}" for simple, exact, scale in
            zip(*compare(unit, eccentricity), (30 / np.pi, 1e6, 1e-3, 1e6), strict=True)))
    print("\nflux density over the card's   within 5 % up to   within 10 % up to   "
          "fold, % of the gap")
    for i in range(0, len(fields), 4):
        print(f"{fields[i]:18.2f} {five[i]:22.1f} % {ten[i]:18.1f} % {100 * errors.folds[i]:18.2f}")
    print(f"\n{picture(errors, eccentricities, fields).reading}")
    picture(errors, eccentricities, fields).save("design_practice.png")
    print("\nNot reproduced: nothing was published to compare with; how far a design tool is off "
          "depends on the unit, so run this with your own machine card.")


if __name__ == "__main__":
    main()
