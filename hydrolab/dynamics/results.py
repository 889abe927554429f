"""Motions, steady states and branches: frozen results that print as a story.

Amplitudes are 0-to-peak. Coefficients are those of `hydrolab.dynamics.harmonics`.

Here name, value: of an argument.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hydrolab.dynamics.harmonics import (
    PERIOD,
    amplitudes,
    fit,
    from_complex,
    long_axis,
    period_rows,
    rates,
    synthesise,
    to_complex,
)
from hydrolab.errors import BadInput, Contact
from hydrolab.machine.model import Model, rigid_link
from hydrolab.machine.quantities import shown

if TYPE_CHECKING:
    from hydrolab.dynamics.harmonic_balance import Condensed
    from hydrolab.dynamics.integrate import Integrator


HINTS = {  # what was given by mistake, and how to get from it to what is wanted
    "Machine": "a Machine makes a Model by its method model()",
    "Branch": "branch[3] is one steady state of a Branch",
    "PeriodicOrbit": "`follow` makes a Branch that begins at a steady state",
}


def require(name: str, value: object, kind: type) -> None:
    """Raise BadInput, with what to try, where an argument is not of the kind of result wanted."""
    if not isinstance(value, kind):
        own, wanted = type(value).__name__, kind.__name__
        given, hint = (f"a {own}", f" ({HINTS[own]})") if own in HINTS else (shown(value), "")
        article = "an" if wanted[0] in "AEIOU" else "a"
        raise BadInput(f"{name} is {given}; it must be {article} {wanted}{hint}.")


BASIS = 1e-3  # relative error of a basis that `reduce` makes for a known speed


def left_out(model: Model) -> str:
    """What a model that `reduce` made for a known speed leaves out, in words; empty for nothing."""
    every, own = model.shaft_map.shape
    return "" if own >= every else (
        f" On {own} of {every} degrees of freedom: answers up to 4X and the slowest free motions "
        f"are those of all to {100 * BASIS:g} %, what is faster is left out.")


def contact_sentence(phase: float, time: float, angle: float) -> str:
    """When and where the rotor touches: phase of the rotation, rad; time, s; gap angle, rad."""
    return (f"The rotor touches the stator after {phase / (2 * math.pi):.2f} revolutions "
            f"({time:.4g} s), at gap angle {math.degrees(angle) % 360:.0f}° (from z towards x).")


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A motion in time.

    times: s, shape (T,). positions: (x, z) of the generator centre, m, shape (2, T).
    state: displacement and velocity of all DOFs of the integrated model at the end, (2, n), to go
    on from (nan after contact). stopped: why it ends, in words. finished: whether all that was
    asked for was integrated; interrupted: whether it was an interrupt that kept it from that. lead:
    the phase of the rotation beyond Ωt, rad, which another speed before leaves behind.
    """

    model: Model
    speed: float
    static_eccentricity: float
    centre: NDArray
    times: NDArray
    positions: NDArray
    state: NDArray
    stopped: str
    finished: bool
    method: Integrator
    interrupted: bool = False
    lead: float = 0.0

    @property
    def phases(self) -> NDArray:
        """Phase of the rotation at the times, rad, (T,)."""
        return self.speed * self.times + self.lead

    @property
    def revolutions(self) -> float:
        """Revolutions integrated."""
        return float((self.times[-1] - self.times[0]) * self.speed / (2 * math.pi))

    def last(self, revolutions: float) -> tuple[NDArray, NDArray]:
        """Times and positions of the last revolutions."""
        keep = self.times >= self.times[-1] - revolutions * 2 * math.pi / self.speed * (1 + 1e-12)
        return self.times[keep], self.positions[:, keep]

    def coefficients(self, harmonics: int, revolutions: int = 1) -> NDArray:
        """[mean, sin 1, cos 1, …] of the last whole revolutions, m, (2, 2m + 1), in the phase of
        the rotation, by least squares, so that any number of steps in a revolution will do.

        Raises BadInput for a motion that ended before so many revolutions.
        """
        if self.revolutions < revolutions * (1 - 1e-9):
            raise BadInput(f"revolutions is {revolutions}, and the motion has "
                           f"{self.revolutions:.3g}. {self.stopped}")
        times, positions = self.last(revolutions)
        return fit(positions[:, 1:], self.speed * times[1:] + self.lead, harmonics)

    def recurrence(self, revolutions: int = 1) -> float:
        """How far the last revolutions are from as many before, over their size; nan: too short."""
        n = revolutions * self.method.steps_per_revolution
        if self.positions.shape[1] <= 2 * n:
            return math.nan
        last, before = self.positions[:, -n:], self.positions[:, -2 * n:-n]
        size = np.hypot(*(last - last.mean(axis=1)[:, None])).max()
        return float(np.hypot(*(last - before)).max() / size)

    def __str__(self) -> str:
        return (f"Motion of {self.model.name} over {self.revolutions:.4g} revolutions at "
                f"{self.speed * 30 / math.pi:.4g} rpm, static eccentricity "
                f"{100 * self.static_eccentricity:.4g} %. {self.stopped}{left_out(self.model)}")


@dataclass(frozen=True, eq=False, repr=False)
class BearingForce:
    """What a shaft does to one of its radial bearings, by stiffness, damping, pads and film.

    static: mean force on the bearing in x and z, N, (2,). first: long half axis of its 1X, N.
    peak: largest force around the period, N.
    """

    name: str
    static: NDArray
    first: float
    peak: float

    def __str__(self) -> str:
        return (f"{self.name}: static {1e-3 * np.hypot(*self.static):.4g} kN, "
                f"1X {1e-3 * self.first:.4g} kN, peak {1e-3 * self.peak:.4g} kN")

    __repr__ = __str__


@dataclass(frozen=True, eq=False)
class PeriodicOrbit:
    """A steady state with the period of the rotation, or of `revolutions` of them; harmonic k is
    then k/revolutions X.

    static_eccentricity: offset of the stator as a fraction of the gap; centre: (x_E, z_E), m.
    local: [mean, sin 1, cos 1, …] of the c nonlinear coordinates, shape (c, 2m + 1), Eq. (10); the
    generator centre's x and z, m, are first. residual: largest force left over in the harmonic
    balance, N.
    """

    equations: Condensed
    static_eccentricity: float
    centre: NDArray
    local: NDArray
    residual: float

    @property
    def coefficients(self) -> NDArray:
        """[mean, sin 1, cos 1, …] of the generator centre's x and z, m, shape (2, 2m + 1)."""
        return self.local[:2]

    @property
    def revolutions(self) -> int:
        """Revolutions in a period."""
        return self.equations.revolutions

    @property
    def model(self) -> Model:
        """The model this is a steady state of."""
        return self.equations.model

    @property
    def speed(self) -> float:
        """Speed, rad/s."""
        return self.equations.speed

    @property
    def harmonics(self) -> int:
        """Number of harmonics m kept beside the mean."""
        return self.equations.harmonics

    @property
    def mean(self) -> NDArray:
        """Mean position (x, z) of the generator centre, m."""
        return self.coefficients[:, 0]

    @property
    def amplitudes(self) -> NDArray:
        """√(A_k² + B_k²) of x and z for k = 1 … m, m 0-to-peak, (2, m); the paper's section 5.2."""
        return amplitudes(self.coefficients)

    @property
    def vibration(self) -> float:
        """Largest distance from the mean position, m."""
        path = self.positions(self.revolutions * PERIOD)
        return float(np.hypot(*(path - self.mean[:, None])).max())

    @property
    def second_share(self) -> float:
        """2X over 1X, by the long half axes of their ellipses; 0 where there is no 1X or no 2X."""
        first = self.revolutions
        if self.harmonics < 2 * first or not (one := long_axis(self.coefficients, first)):
            return 0.0
        return float(long_axis(self.coefficients, 2 * first) / one)

    def coordinates(self, phase: ArrayLike) -> NDArray:
        """All c nonlinear coordinates at the phases Ωt (rad), shape (c, len(phase))."""
        return synthesise(self.local, np.asarray(phase) / self.revolutions)

    def positions(self, phase: ArrayLike) -> NDArray:
        """Position (x, z) of the generator centre at the phases Ωt (rad), m, shape (2, len(phase)).
        """
        return synthesise(self.coefficients, np.asarray(phase) / self.revolutions)

    def velocities(self, phase: ArrayLike) -> NDArray:
        """Velocity of the generator centre at the phases Ωt (rad), m/s, shape (2, len(phase))."""
        rate = self.speed / self.revolutions
        return synthesise(rate * rates(self.coefficients), np.asarray(phase) / self.revolutions)

    @cached_property
    def shaft(self) -> NDArray:
        """[mean, sin 1, cos 1, …] of every DOF, by back-substitution; (n, 2m + 1), m or rad."""
        eq = self.equations
        away = to_complex(self.local - eq.length * eq.linear)
        return from_complex((eq.shaft_linear + np.einsum("knd,dk->kn", eq.recovery, away)).T)

    def state(self, phase: float = 0.0) -> NDArray:
        """Displacement and velocity of every DOF at a phase Ωt (rad), shape (2, n)."""
        rate, at = self.speed / self.revolutions, [phase / self.revolutions]
        return np.stack([synthesise(self.shaft, at)[:, 0],
                         synthesise(rate * rates(self.shaft), at)[:, 0]])

    def body_coefficients(self, body: Any) -> NDArray:
        """[mean, sin 1, cos 1, …] of x and z at a body's centre, by its link, m, (2, 2m + 1)."""
        node = self.model.at_nodes(self.shaft)[body.node]
        return (rigid_link(body.offset)[:2] if len(node) == 4 else np.eye(2)) @ node

    def node_coefficients(self, place: int | float | str) -> NDArray:
        """[mean, sin 1, cos 1, …] of x and z at a shaft node, m, shape (2, 2m + 1).

        place: its number, its depth in m (a float), or the name of a body or a bearing there.
        """
        return self.model.at_nodes(self.shaft)[self.model.node_at(place), :2]

    @cached_property
    def bearing_forces(self) -> dict[str, BearingForce]:
        """The force of the shaft on each radial bearing, by its name; each prints as a sentence."""
        rate, found = self.speed / self.revolutions, {}
        q, v = self.shaft, rate * rates(self.shaft)
        for name, bearing in self.model.supports.items():
            force = -bearing.force(synthesise(bearing.rows @ q, PERIOD),
                                   synthesise(bearing.rows @ v, PERIOD),
                                   self.revolutions * PERIOD, self.speed)
            first = long_axis(fit(force, PERIOD, self.revolutions), self.revolutions)
            found[name] = BearingForce(name, force.mean(axis=1), float(first),
                                       float(np.hypot(*force).max()))
        return found

    @cached_property
    def smallest_gap(self) -> float:
        """Smallest air gap over the period and the circumference, m (inf where there is no gap)."""
        return float(self._clearances.min())

    @cached_property
    def _clearances(self) -> NDArray:
        """Smallest air gap at the phases `PERIOD`, m, (360,)."""
        return clearances(self.equations, self.local[None], self.centre[None])[0]

    def require_clear(self) -> None:
        """Raise Contact, with the angle and the time, if the rotor touches the stator anywhere on
        this orbit.

        The pull is only evaluated at the AFT samples, so a solver can return an orbit that touches
        between them.
        """
        if self.smallest_gap > 0:
            return
        first = int(np.argmax(self._clearances <= 0))
        phase = self.revolutions * PERIOD[first:first + 1]
        place = self.model.relative(self.coordinates(phase), self.centre[:, None])
        angle = float(self.model.law.gap_angle(place, phase)[0])
        raise Contact(f"The steady state at {100 * self.static_eccentricity:.4g} % would touch the "
                      f"stator: {contact_sentence(phase[0], phase[0] / self.speed, angle)} Lower "
                      "the eccentricity, the unbalance or the field.")

    def __str__(self) -> str:
        mean = 1e6 * np.hypot(*self.mean)
        shares = ", ".join(f"{k / self.revolutions:.3g}X {1e6 * a:.3g}/{1e6 * b:.3g}"
                           for k, (a, b) in enumerate(self.amplitudes.T, 1))
        period = f", repeating every {self.revolutions} revolutions" if self.revolutions > 1 else ""
        gap = (f"smallest gap {1e3 * self.smallest_gap:.3f} mm, "
               if math.isfinite(self.smallest_gap) else "")
        return (f"Steady state of {self.model.name} at {self.speed * 30 / math.pi:.4g} rpm, static "
                f"eccentricity {100 * self.static_eccentricity:.4g} %{period}: mean displacement "
                f"{mean:.4g} µm; x/z amplitudes (µm, 0-to-peak) {shares}; {gap}residual "
                f"{self.residual:.1e} N.")


def clearances(eq: Condensed, local: NDArray, centres: NDArray) -> NDArray:
    """Smallest air gap around the circumference at the phases `PERIOD` of many motions, m, (P,
    360): by the law, on all of its coordinates.

    local: [mean, sin 1, cos 1, …] of the nonlinear coordinates, (P, c, 2m + 1). centres: m, (P, 2).
    """
    place = np.ascontiguousarray((local @ period_rows(eq.harmonics)).transpose(1, 0, 2))
    place = eq.model.relative(place, centres.T[:, :, None])
    return np.broadcast_to(eq.model.law.smallest_gap(place, eq.revolutions * PERIOD),
                           (len(local), len(PERIOD)))
