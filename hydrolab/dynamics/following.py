"""Branches followed: in steps of the parameter, past folds, and along with a model that changes."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from hydrolab.dynamics.batch import Batch, stack
from hydrolab.dynamics.branches import Branch, SpecialPoint
from hydrolab.dynamics.continuation import Step, arclength, land, locate_fold
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.paths import Path, foresight, path
from hydrolab.dynamics.results import PeriodicOrbit, require
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.machine.model import Model
from hydrolab.machine.quantities import number, require_model, whole

HELD = 0.3  # share of a parameter in the tangent above which it is held in a step
CLOSED = 1e-3  # a branch that comes this near its first point, in the scaled norm, is closed


# ------------------------------------------------------------------ natural continuation

def sweep(model: Model, method: HarmonicBalance, static_eccentricities: Iterable[float], *,
          speed: float, direction: float = math.pi / 2) -> Branch:
    """Natural continuation (Villa et al., section 5): each steady state starts from the last one.

    static_eccentricities: fractions of the gap. speed: rad/s. direction: gap angle of the offset,
    rad. Ends with the first eccentricity at which the solver stops or the rotor touches; `stopped`
    says so in words. Raises NoConvergence or Contact if there is not even the first.
    """
    require("method", method, HarmonicBalance)
    values = [number("static_eccentricities", v) for v in static_eccentricities]
    if not values:
        raise BadInput("static_eccentricities is empty; give at least one fraction of the gap.")
    orbit = method.solve(model, speed, values[0], direction=direction)
    eq = orbit.equations
    rows, left = [orbit.local.ravel() / eq.length], [orbit.residual]
    stopped = f"It ends as asked at {100 * values[-1]:.4g} %."
    for before, value in pairwise(values):
        solution = method.from_guess(eq, model.centre(value, direction), rows[-1])
        if not solution.converged:
            stopped = (f"Natural continuation stopped between {100 * before:.4g} % and "
                       f"{100 * value:.4g} %; `follow` tells whether the branch turns there.")
            break
        rows.append(solution.y)
        left.append(eq.newtons(solution.residual))
    along = path(model, "static_eccentricity", method, speed, values[0], direction)
    branch = _balanced(Branch(along, np.array(values[:len(rows)]), np.array(rows), np.array(left),
                              (), stopped, method))
    touching = np.flatnonzero(branch.smallest_gaps <= 0)
    if not len(touching):
        return branch
    at = along.say(branch.values[touching[0]])
    return _cut(branch, touching[0], f"The rotor touches the stator at {at}.")


def _cut(branch: Branch, rows: int, stopped: str) -> Branch:
    """The first rows of a branch."""
    return replace(branch, values=branch.values[:rows], unknowns=branch.unknowns[:rows],
                   residuals=branch.residuals[:rows], stopped=stopped, closed=False,
                   special_points=tuple(p for p in branch.special_points if p.after < rows - 1))


def _balanced(branch: Branch) -> Branch:
    """The branch up to the first point where the forces do not balance or do not repeat."""
    problem = branch.path.at(branch.values[0])
    least = problem.equations.small(branch.unknowns[0], problem.centre)
    doubtful = (branch.residuals > least) | problem.equations.model.law.moving
    for k in map(int, np.flatnonzero(doubtful)):
        problem = branch.path.at(branch.values[k])
        try:
            problem.equations.require_balance(branch.unknowns[k], problem.centre,
                                              branch.residuals[k])
        except (NoConvergence, BadInput) as error:
            return _cut(branch, max(k, 1), str(error))
    return branch


# ------------------------------------------------------------------ arclength continuation

@dataclass(frozen=True)
class Arclength:
    """How a branch is followed: harmonic balance, step sizes (scaled by the gap), and when to stop.

    step, max_step: first and longest step. max_turn: of the tangent in a step, rad. max_points: in
    all. max_folds: stop after this many folds and a tail of `tail` points; there may be more orbits
    beyond. smallest_gap: stop when less than this fraction of the nominal gap is left. past_start:
    go on past the start value, to find a branch that closes.
    """

    balance: HarmonicBalance = field(default_factory=HarmonicBalance)
    step: float = 0.002
    max_step: float = 0.02
    max_turn: float = 0.15
    max_points: int = 1000
    max_folds: int = 50
    tail: int = 10
    smallest_gap: float = 0.0
    past_start: bool = False

    def __post_init__(self) -> None:
        require("balance", self.balance, HarmonicBalance)
        for key in ("step", "max_step", "max_turn"):
            if number(key, getattr(self, key), above=0) > 1:
                raise BadInput(f"{key} is {getattr(self, key):g}; at most 1 is allowed, "
                               f"{'a radian' if key == 'max_turn' else 'the whole gap'}, and far "
                               "less is usual.")
        for key, least in (("max_points", 2), ("max_folds", 1), ("tail", 0)):
            whole(key, getattr(self, key), least)
        if not 0 <= number("smallest_gap", self.smallest_gap) < 1:
            raise BadInput(f"smallest_gap is {self.smallest_gap!r}; it is a fraction of the gap, "
                           "from 0 to below 1.")


def follow(model: Model, parameter: str = "static_eccentricity", *, to: float | None = None,
           speed: float, static_eccentricity: float = 0.0, direction: float = math.pi / 2,
           start: PeriodicOrbit | None = None, method: Arclength | None = None) -> Branch:
    """Follow the steady states along a parameter, past folds, in the direction of `to`.

    parameter: "static_eccentricity" (fraction of the gap), "direction" (gap angle of the offset,
    rad), "speed" (rad/s), "field" or "unbalance" (factors on the machine's own), or the key of any
    number on the machine's card, such as "bearings.<name>.stiffness" (SI units). to: value of the
    parameter to end at; half the gap unless given. The branch begins at this speed (rad/s),
    static_eccentricity, direction and the machine's own numbers, or on `start`, an orbit there.
    method: sizes of steps, and when else to end.

    It ends on `to`, at contact, back at the start value, after `max_folds` folds and a short tail,
    or after `max_points`; `branch.stopped` says which. Steps shorten near the resonances of the
    linear machine, so that none is stepped over, but not along the eccentricity, the direction and
    the unbalance, which leave that machine as it is. Raises BadInput, or NoConvergence where there
    is no first steady state.
    """
    method = Arclength() if method is None else method
    require("method", method, Arclength)
    balance = method.balance
    if start is not None:
        require("start", start, PeriodicOrbit)
        if (start.harmonics, start.revolutions) != (balance.harmonics, balance.revolutions):
            raise BadInput(f"start has {start.harmonics} harmonics, the method "
                           f"{balance.harmonics} (in a period of {start.revolutions} and "
                           f"{balance.revolutions} revolutions); they must be the same.")
        if start.static_eccentricity:
            direction = math.atan2(*(start.centre / start.static_eccentricity))
        static_eccentricity = start.static_eccentricity
    along = path(model, parameter, balance, speed, static_eccentricity, direction, to)
    to = _end(along, to)
    origin = start or balance.solve(model, speed, static_eccentricity, direction=direction)
    return _balanced(walk(along, origin, to, method))


def _end(along: Path, to: float | None) -> float:
    """The value up to which a path is followed, or a sentence why it cannot be."""
    if to is None and along.parameter != "static_eccentricity":
        raise BadInput(f"to is missing; say up to which value {along.parameter} is to be followed, "
                       f"from {along.say(along.first)}.")
    to = 0.5 if to is None else number("to", to, unit="" if along.unit == "%" else along.unit)
    if along.unit == "%" and abs(to) >= 1:
        raise BadInput(f"to is {to!r}; it is a fraction of the gap, between -1 and 1 (12 % is "
                       "0.12).")
    if to == along.first:
        raise BadInput(f"to is {to:g}, where the branch starts; give another end.")
    return to


def walk(along: Path, origin: PeriodicOrbit, to: float, method: Arclength,
         until: Callable[[Step, Step], bool] | None = None) -> Branch:
    """Take steps until one of the reasons to stop, or the first two of which `until` is true."""
    system, eq = along.system(), origin.equations
    forward = math.copysign(1.0, to - along.first)
    steps: list[Step] = []
    folds: list[SpecialPoint] = []
    past, stopped, closed = 0, "", False  # past: points after the last fold asked for
    y = origin.local.ravel() / eq.length
    # a motion that is small in its gap is to be known as well as any other
    small = min(1.0, max(100 * float(np.abs(y).max()), 1e-5))
    for point in arclength(system, y, along.first / along.scale, toward=forward, step=method.step,
                           max_step=method.max_step, max_turn=method.max_turn,
                           tolerance=1e-10 * small, longest=foresight(along),
                           held=math.inf if along.moves_stator else HELD):
        if until and steps and until(steps[-1], point):
            steps.append(point)
            break
        # a fold between this point and the last?
        fold = None
        if steps and point.tangent[-1] * steps[-1].tangent[-1] < 0:
            fold = locate_fold(system, steps[-1], point)
        furthest = fold if fold and forward * fold.parameter > forward * point.parameter else point
        reached = forward * (furthest.parameter * along.scale - to) >= 0
        if reached and (landed := land(system, steps[-1], furthest, to / along.scale)):
            point, fold = landed, None  # a fold in this step lies beyond `to`
        if fold:
            value = fold.parameter * along.scale
            folds.append(SpecialPoint("fold", value, len(steps) - 1, fold.y, along.say(value, 8)))
        steps.append(point)
        past += len(folds) >= method.max_folds
        # the end?
        closed = len(steps) > 3 and _comes_back(steps)
        stopped = _reason(along, steps, to, method, closed, reached)
        if not stopped and past > method.tail:
            stopped = f"It passed {len(folds)} folds, as many as were asked for; it goes on."
        if stopped:
            break
    if not steps:
        raise NoConvergence(f"No branch begins at the given start, {along.say(along.first)}: it is "
                            f"no steady state of {origin.model.name} at {origin.speed:.4g} rad/s. "
                            "Solve for one with HarmonicBalance.")
    values = np.array([s.parameter for s in steps]) * along.scale
    stopped = stopped or (f"No further point was found near {along.say(values[-1])}, down to the "
                          f"smallest step.{_refusal(along, steps[-1], method)}")
    return Branch(along, values, np.array([s.y for s in steps]),
                  np.array([s.residual for s in steps]) * eq.force, tuple(folds), stopped, method,
                  closed)


def _reason(along: Path, steps: list[Step], to: float, method: Arclength, closed: bool,
            reached: bool) -> str:
    """Why a branch ends with the last of these points, or "" where it goes on."""
    value, first = steps[-1].parameter * along.scale, along.first
    gap = _room(along, steps[-1].y, value, method)
    if gap <= 0:
        return f"The rotor touches the stator at {along.say(value)}."
    if gap <= method.smallest_gap:
        return (f"The smallest gap is down to {100 * gap:.3g} % of the nominal one at "
                f"{along.say(value)}.")
    if closed:
        return (f"It is closed: it came back to the steady state at {along.say(first)} where it "
                "began.")
    if reached:
        return f"It reached {along.say(to)} as asked."
    turned = math.copysign(1.0, to - first) * (value - first) <= 0
    if turned and len(steps) > 2 and not method.past_start:
        return f"It came back to {along.say(first)}, where it began."
    if len(steps) >= method.max_points:
        return f"It has the {method.max_points} points that were allowed."
    return ""


def _refusal(along: Path, last: Step, method: Arclength) -> str:
    """What a machine says to the parameter a step ahead, as past the end of a bearing's table."""
    ahead = last.parameter + math.copysign(method.step, last.tangent[-1])
    try:
        along.at(ahead * along.scale)
    except BadInput as refused:
        return f" {refused}"
    return ""


def _room(along: Path, y: NDArray, value: float, method: Arclength) -> float:
    """Smallest gap at the AFT samples over the nominal one; inf where it cannot be the end."""
    # no number outside the gap: no point that was found can touch
    if not method.smallest_gap and along.here.equations.model.law.closed_form:
        return math.inf
    problem = along.at(value)
    eq = problem.equations
    gaps = eq.model.law.smallest_gap(eq.position(y, problem.centre), eq.phase)
    return float(np.min(gaps)) / eq.model.length_scale


def _comes_back(steps: list[Step]) -> bool:
    """Whether the last step passed the first point, in its direction and close to it."""
    first, before, last = steps[0], steps[-2], steps[-1]

    def ahead(step: Step) -> float:
        return float(first.tangent[:-1] @ (step.y - first.y)
                     + first.tangent[-1] * (step.parameter - first.parameter))

    if not ahead(before) < 0 <= ahead(last):
        return False
    start, a, b = (np.append(s.y, s.parameter) for s in (first, before, last))
    share = ahead(before) / (ahead(before) - ahead(last))
    # The chord misses the curve by about its square; half the step is far below the distance to
    # another leg.
    away = float(np.linalg.norm(a + share * (b - a) - start))
    return away < max(CLOSED, 0.1 * float(np.linalg.norm(b - a)))


# ------------------------------------------------------------------ moved with its model

MOVED = "It was moved along with the model from a branch followed before."
STRETCH = 3.0  # neighbouring points may come closer or move apart by this factor


def update_branch(branch: Branch, model: Model, speed: float | None = None) -> Branch:
    """The branch of a model near the one it was followed on, by one batched bordered Newton from
    the old points.

    model: the changed one. speed: rad/s; by default that of the branch. Every point is corrected
    within the plane normal to the old branch, the first one at its own eccentricity, and the folds
    are located anew. Where the branch changes its topology, a point is lost or the gap is not
    round, it is followed from scratch, up to half the gap. Raises BadInput for what is no branch
    along the static eccentricity, and what `follow` raises where nothing is left to follow.
    """
    require("branch", branch, Branch)
    require_model(model)
    speed = branch.equations.speed if speed is None else speed
    if branch.parameter != "static_eccentricity":
        raise BadInput(f"the branch runs along {branch.parameter}; only branches along "
                       "static_eccentricity can be moved.")
    if not isinstance(branch.method, Arclength):  # a sweep, which knows no steps along a branch
        branch = replace(branch, method=Arclength(branch.method))
    along = path(model, "static_eccentricity", branch.path.balance, speed, branch.path.first,
                 branch.path.here.direction)
    moved = _moved(branch, along) if model.law.closed_form and len(branch) > 1 else None
    return _afresh(branch, along) if moved is None else moved


def _moved(branch: Branch, along: Path) -> Branch | None:
    """The branch with its points moved onto another path; None where it is another curve there."""
    eq = along.here.equations
    unit = branch.direction * eq.model.gap
    old = np.column_stack([branch.unknowns, branch.static_eccentricity])
    corrected = _correct_together(stack([eq]).take(np.zeros(len(branch), dtype=int)), old,
                                  _normals(old), unit / eq.length, unit)
    if corrected is None:
        return None
    z, tangents, residuals = corrected
    turns = np.flatnonzero(tangents[:-1, -1] * tangents[1:, -1] < 0)
    if not _same_shape(branch, old, z, tangents, turns):
        return None
    system, folds = along.system(), []
    for i in turns:
        before, after = (Step(z[j, :-1], z[j, -1], tangents[j], residuals[j], 0)
                         for j in (i, i + 1))
        fold = locate_fold(system, before, after)
        folds.append(SpecialPoint("fold", fold.parameter, int(i), fold.y,
                                  along.say(fold.parameter, 8)))
    return Branch(along, z[:, -1], z[:, :-1], residuals * eq.force, tuple(folds), MOVED,
                  branch.method, branch.closed)


def _afresh(branch: Branch, along: Path) -> Branch:
    """The branch followed from scratch along another path."""
    eq, first, direction = along.here.equations, along.first, along.here.direction
    start = None
    with contextlib.suppress(NoConvergence, Contact, BadInput):
        start = along.balance.solve(eq.model, eq.speed, first, direction=direction, start=branch[0])
    to = float(np.copysign(0.5, np.diff(branch.values[:2]).sum()))  # also from a lone point
    return follow(eq.model, speed=eq.speed, to=to, method=cast(Arclength, branch.method),
                  static_eccentricity=first, direction=direction, start=start)


def _normals(z: NDArray) -> NDArray:
    """Unit directions along the branch, from the points' neighbours; first the parameter's."""
    along = np.gradient(z, axis=0)
    along[0] = 0.0
    along[0, -1] = 1.0
    return along / np.linalg.norm(along, axis=1)[:, None]


def _correct_together(batch: Batch, old: NDArray, normals: NDArray, offset: NDArray,
                      unit: NDArray) -> tuple[NDArray, NDArray, NDArray] | None:
    """Points on the new branch (P, n + 1), their unit tangents and residuals; None if one does not
    settle.

    unit: change of the stator's centre with the eccentricity, m, (2,); offset: the same, scaled.
    """
    points, n = old.shape[0], old.shape[1] - 1
    z, bordered = old.copy(), np.empty((points, n + 1, n + 1))
    bordered[:, n] = normals
    right = np.zeros((points, n + 1, 2))
    right[:, n, 1] = 1.0
    for _ in range(6):
        residual, bordered[:, :n, :n], pull = batch.linearise(z[:, :n], z[:, n:] * unit)
        # to move the stator is to move the mean the other way, for the pull alone
        bordered[:, :n, n] = pull[:, :, 0] * offset[0] + pull[:, :, n // 2] * offset[1]
        right[:, :n, 0] = residual
        right[:, n, 0] = np.einsum("pi,pi->p", normals, z - old)
        if not np.isfinite(residual).all():
            return None
        answer = np.linalg.solve(bordered, right)
        size = np.linalg.norm(residual, axis=1)
        if size.max() < 1e-9:
            tangents = answer[:, :, 1]
            return z, tangents / np.linalg.norm(tangents, axis=1)[:, None], size
        z -= answer[:, :, 0]
    return None


def _same_shape(branch: Branch, old: NDArray, z: NDArray, tangents: NDArray,
                turns: NDArray) -> bool:
    """Whether the moved points draw the same curve: in order, evenly spaced, with as many folds."""
    before, after = np.diff(old, axis=0), np.diff(z, axis=0)
    stretch = np.linalg.norm(after, axis=1) / np.linalg.norm(before, axis=1)
    same_way = np.sign(np.einsum("pi,pi->p", before, after))
    onward = same_way * np.einsum("pi,pi->p", after, tangents[:-1])
    even = (stretch < STRETCH) & (stretch > 1 / STRETCH) & (onward > 0)
    return len(turns) == len(branch.folds) and bool(even.all())
