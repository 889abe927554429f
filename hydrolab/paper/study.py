"""The paper's study, end to end, on any machine card.

Section 5 of Villa, Carvalho and Salomon: a steady state without eccentricity, then natural
continuation in the static eccentricity until the solver stops; direct integration as a check; and
what the paper could not do, the branch past its folds with its stability. For its conclusion, the
bending stress in the shaft along an orbit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from threadpoolctl import threadpool_limits

from hydrolab.dynamics.branches import Branch, branch_stability, orbits_at
from hydrolab.dynamics.following import Arclength, follow, sweep
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import PERIOD, period_rows
from hydrolab.dynamics.integrate import CentralDifference, integrate
from hydrolab.dynamics.reduction import reduce, truncation_error
from hydrolab.dynamics.results import PeriodicOrbit, Trajectory
from hydrolab.dynamics.solvers import powell_dog_leg
from hydrolab.dynamics.stability import Floquet, floquet_all
from hydrolab.errors import BadInput, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.parts import AirGap, Machine, Shaft
from hydrolab.machine.quantities import require_machine

FAMILY_CARD = "kaplan-150rpm"  # the card that stands for the paper's machine
# the fold the shipped unit is calibrated to; the paper's own percentages lie below it
PAPER_LIMIT = 0.08925
PERCENTAGES = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 8.5, 8.8, 8.9)
VALIDATION = 8.8  # %, the paper's section 5.1
BEYOND = 9.0  # %, just past the last orbit the paper shows
HARMONICS = 4
# the paper's revolutions and ramp; its step is not stated
REVOLUTIONS, RAMP, STEPS = 1000, 400, 512
REVOLUTIONS_BEYOND = 400
REPEATS = 1e-3  # two periods that differ by at most this share of the motion are the same
REPEATED = {1: "one revolution", 2: "two revolutions"}  # periods that are looked for
# of a revolution; a thousand revolutions then take minutes, and their motion 200 MB
MOST_STEPS = 2**13

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, eq=False)
class SteadyStudy:
    """The steady states of the study on one machine, which take a second.

    scale: 1 where the paper's percentages apply, which is where the first fold lies between its
    8.9 and its 9.0 %; otherwise they are stretched by first fold/8.925 %. branch: steady states
    from 0 past up to three folds. orbits: by the paper's percentages, on the first leg. natural:
    the paper's own procedure (dog-leg, each start from the last solution).
    """

    machine: Machine
    model: Model
    speed: float
    scale: float
    branch: Branch
    orbits: dict[float, PeriodicOrbit]
    natural: Branch

    def eccentricity(self, percentage: float) -> float:
        """Fraction of the gap that stands for a percentage of the paper on this machine."""
        return percentage / 100 * self.scale

    @property
    def limit(self) -> float:
        """First fold, or the end of the branch where there is none; fraction of the gap."""
        return _limit(self.branch)

    @cached_property
    def kind(self) -> str:
        """"S-shaped" if the leg after the second fold climbs past the first one, else "plain"."""
        folds = self.branch.folds
        if len(folds) < 2:
            return "plain"
        after = self.branch.static_eccentricity[folds[1].after + 1:]
        return "S-shaped" if len(after) and after.max() > folds[0].value else "plain"


@dataclass(frozen=True, eq=False)
class Study(SteadyStudy):
    """Everything the study computes on one machine.

    stability: of each point of the branch. check: direct integration at 8.8 %. beyond: direct
    integration at 9.0 %, begun on the 8.9 % orbit; None where an interrupt (Ctrl-C) ended the one
    before. beyond_orbits: the steady states of the branch at 9.0 %, each with its stability.
    truncation: relative error of the basis of the integration; see `truncation_error`.
    """

    stability: tuple[Floquet, ...]
    check: Trajectory
    beyond: Trajectory | None
    beyond_orbits: tuple[tuple[PeriodicOrbit, Floquet], ...]
    truncation: float

    @property
    def interrupted(self) -> bool:
        """Whether an interrupt kept one of the integrations from its end."""
        return self.beyond is None or self.beyond.interrupted

    @property
    def first_loss(self) -> float | None:
        """Eccentricity of the first point of the first leg that is unstable, or None."""
        leg = self.branch.first_leg
        points = zip(self.branch.static_eccentricity[leg], self.stability[leg], strict=True)
        return next((float(value) for value, point in points if point.verdict == "unstable"), None)

    @property
    def states_beyond(self) -> list[str]:
        """The verdict on each steady state at 9.0 % and its largest multiplier, in words."""
        sizes = [f"{f.largest:.2f}" if f.largest < 100 else "above 100"
                 for _, f in self.beyond_orbits]
        return [f"{f.verdict} (largest multiplier {size})"
                for (_, f), size in zip(self.beyond_orbits, sizes, strict=True)]

    @property
    def stability_known(self) -> bool:
        """Whether each point of the first leg is known to be stable or not."""
        return all(point.verdict != "unknown" for point in self.stability[self.branch.first_leg])


def _limit(branch: Branch) -> float:
    return branch.folds[0].value if branch.folds else float(branch.static_eccentricity[-1])


def steady_study(machine: Machine, progress: Progress | None = None) -> SteadyStudy:
    """The steady states of a machine's study; progress and errors as of `run_study`."""
    tell = telling(progress)
    air = check_studied(machine)
    with threadpool_limits(1):
        model, speed, balance = machine.model(), machine.speed, HarmonicBalance(HARMONICS)
        tell("steady states")(0, 1)
        begin = balance.solve(model, speed)
        check_begin(begin, air)
        # what the paper could not do: the branch past its folds, as far as a machine can be on it
        branch = follow(model, speed=speed, to=0.9, start=begin,
                        method=Arclength(balance, max_folds=3))
        limit = _limit(branch)
        if limit < 1e-3:
            raise NoConvergence(f"{machine.name} loses its steady state at {100 * limit:.3g} % of "
                                "the gap; there is no range of eccentricity to study. A lower "
                                "field or stiffer bearings would give one.")
        scale = 1.0 if PERCENTAGES[-1] < 100 * limit < BEYOND else limit / PAPER_LIMIT
        orbits = {p: orbits_at(branch, p / 100 * scale)[0] for p in PERCENTAGES}
        # what the paper did: each start from the last solution
        step = 0.001 * scale
        natural = sweep(model, replace(balance, solver=powell_dog_leg),
                        step * np.arange(round(1.2 * limit / step)), speed=speed)
        tell("steady states")(1, 1)
        return SteadyStudy(machine, model, speed, scale, branch, orbits, natural)


def run_study(machine: Machine, progress: Progress | None = None, *, revolutions: int = REVOLUTIONS,
              ramp: int = RAMP) -> Study:
    """Run the study on a machine at its rated speed.

    It takes some seconds with the pull of a round gap, and minutes with a law by quadrature or a
    stiff part; most of that is direct integration.

    progress: called with (what is being done, done, all). revolutions, ramp: of the direct
    integration, which an interrupt (Ctrl-C) ends early: what was computed until then is returned.
    Raises BadInput for a machine without an air gap, field, unbalance, rotation or damping, or one
    too slow to be integrated; NoConvergence where there is no stable steady state to begin with.
    """
    check_studied(machine)
    tell = telling(progress)
    with threadpool_limits(1):
        method = CentralDifference(stable_steps(machine.model(), machine.speed))
        steady = steady_study(machine, progress)
        model, speed, branch = steady.model, steady.speed, steady.branch
        stability = branch_stability(branch, locate=False).points
        tell("stability")(1, 1)
        # the check, and what happens past the fold
        check = integrate(model, method, speed=speed,
                          static_eccentricity=steady.eccentricity(VALIDATION),
                          revolutions=revolutions, ramp=ramp,
                          progress=tell("direct integration at 8.8 %"))
        past = steady.eccentricity(BEYOND)
        beyond = None if check.interrupted else integrate(
            model, method, speed=speed, static_eccentricity=past,
            revolutions=min(revolutions, REVOLUTIONS_BEYOND), start=steady.orbits[8.9],
            progress=tell("direct integration at 9.0 %"))
        there = orbits_at(branch, past)
        truncation = truncation_error(model, check.model, speed, HARMONICS)
        return Study(machine, model, speed, steady.scale, branch, steady.orbits, steady.natural,
                     stability, check, beyond, tuple(zip(there, floquet_all(there), strict=True)),
                     truncation)


def telling(progress: Progress | None) -> Callable[[str], Callable[[int, int], None]]:
    """For each thing that is being done, what tells (done, all) of it."""
    return lambda what: lambda done, of: progress(what, done, of) if progress else None


def check_studied(machine: Machine) -> AirGap:
    """Return the air gap of a machine; raises BadInput where it has nothing to study."""
    require_machine(machine)
    if machine.air_gap is None:
        raise BadInput(f"{machine.name} has no air_gap; the study is about the pull in the gap, so "
                       "its card needs one.")
    if not machine.air_gap.field > 0:
        raise BadInput("air_gap.field is 0 T; the study is about the pull, so it needs a field.")
    if not any(body.unbalance for body in machine.bodies):
        raise BadInput(f"{machine.name} has no unbalance; the study is about whirl, so a body of "
                       "its card needs one.")
    if not machine.speed > 0:
        raise BadInput("speed is 0 rad/s; the study needs a turning rotor.")
    return machine.air_gap


def check_begin(begin: PeriodicOrbit, air: AirGap) -> None:
    """Raise where the steady state without eccentricity is not there to stay, with what to change.

    Where its stability is not known, the study goes on: that is no verdict.
    """
    model = begin.model
    if not model.C.any() and not model.law.moving:
        raise BadInput(f"{model.name} has no damping, so its motions never settle; add a "
                       "[damping] table with a ratio, or damping to its bearings.")
    if floquet_all([begin])[0].verdict != "unstable":
        return
    # the pull is to blame only where the machine is stable without it
    free = HarmonicBalance(HARMONICS).solve(model.with_field(0), begin.speed)
    if floquet_all([free])[0].verdict == "unstable":
        raise NoConvergence(f"{model.name} has no stable steady state even without field: its "
                            "bearings or films drive a whirl. More damping, or less "
                            "cross-coupling (xz against zx), would give one.")
    raise NoConvergence(f"{model.name} has no stable steady state even without eccentricity: the "
                        f"pull, {air.pull_stiffness:.3g} N/m, is too strong for its "
                        "bearings and shaft. A lower field or stiffer bearings would give one.")


def stable_steps(model: Model, speed: float) -> int:
    """STEPS a revolution at a speed (rad/s), doubled until central differences are stable: a
    bearing or a crack makes a stiffer basis.

    Raises BadInput where that takes more than MOST_STEPS.
    """
    small, steps = reduce(model, speed=speed), STEPS
    fastest = math.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(small.M, small.K))).max())
    while fastest * 2 * math.pi / speed / steps > 2:
        steps *= 2
        if steps > MOST_STEPS:
            raise BadInput(f"speed is {speed * 30 / math.pi:.4g} rpm and the fastest frequency of "
                           f"{model.name} is {fastest:.4g} rad/s: direct integration needs more "
                           f"than {MOST_STEPS} steps in a revolution, too many for {REVOLUTIONS} "
                           "of them. Raise the speed, or check masses and stiffnesses.")
    return steps


def stress_fluctuation(shaft: Shaft, orbit: PeriodicOrbit) -> float:
    """Largest 0-to-peak fluctuation over a revolution of the bending stress in a fibre that turns
    with the shaft, Pa.

    Bending moments are the end moments of the elements, K_e q_e; the fibre is taken at eight angles
    at each end.
    """
    motion = orbit.model.shaft_map @ orbit.shaft @ period_rows(orbit.harmonics)
    worst = 0.0
    for i in range(len(shaft.nodes) - 1):
        ends = shaft.element_matrices(i)[2] @ motion[4 * i:4 * i + 8]
        for mx, mz in (ends[2:4], ends[6:8]):
            for fibre in 2 * np.pi * np.arange(8) / 8:
                # Fibre at angle Ωt + fibre from z towards x; θx bends in the (y, z) plane, −θz in
                # (y, x).
                stress = (mx * np.cos(PERIOD + fibre) - mz * np.sin(PERIOD + fibre)) * (
                    shaft.diameter[i] / 2 / shaft.second_moment[i])
                worst = max(worst, float(np.ptp(stress)) / 2)
    return worst
