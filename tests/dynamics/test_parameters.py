"""Branches along every parameter: derivatives against differences, and rotors whose curve is known
exactly.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from hydrolab import HarmonicBalance, follow, load_machine, orbits_at, rpm, vary
from hydrolab.dynamics.continuation import arclength
from hydrolab.dynamics.following import Arclength
from hydrolab.dynamics.paths import path
from hydrolab.errors import BadInput

PARAMETERS = ("static_eccentricity", "direction", "speed", "field", "unbalance",
              "bearings.guide.stiffness", "bodies.generator.mass", "air_gap.gap", "shaft.diameter")


@pytest.mark.parametrize("parameter", PARAMETERS)
def test_derivative_against_differences(unit, speed, parameter):
    """The scaled residual's slope, away from the solution so that every term counts."""
    orbit = HarmonicBalance().solve(unit, speed, 0.05)
    y = orbit.coefficients.ravel() / orbit.equations.length
    y = y + 1e-3 * np.random.default_rng(0).normal(size=len(y))
    along = path(unit, parameter, HarmonicBalance(), speed, 0.05, 1.2)
    here = along.first / along.scale
    h = 1e-3 * max(abs(here), 0.01)

    def newtons(scaled):  # the force scale itself depends on the parameter, so compare in N
        problem = along.at(scaled * along.scale)
        return problem.equations.residual(y, problem.centre) * problem.equations.force

    slope = along.system()(y, here)[2]
    slope = (slope() if callable(slope) else slope) * along.at(along.first).equations.force
    near, far = (newtons(here + k * h) - newtons(here - k * h) for k in (1, 2))
    difference = (8 * near - far) / (12 * h)  # of fourth order
    assert np.abs(slope).max() > 1e3
    assert slope == pytest.approx(difference, abs=3e-7 * np.abs(difference).max())


@pytest.mark.parametrize("parameter", ["speed", "bearings.guide.stiffness"])
def test_derivative_from_values_before(unit, speed, parameter):
    """Once neighbours are known, no further equations are set up, and the slope is of second order.
    """
    y = HarmonicBalance().solve(unit, speed, 0.05).coefficients.ravel() / unit.gap
    along = path(unit, parameter, HarmonicBalance(), speed, 0.05, 1.2)
    here, errors = along.first / along.scale, []
    exact = along.system()(y, here)[2]()
    for h in (0.04, 0.02):
        system = along.system()
        for near in (2 * h, h, 0):
            slope = system(y, here * (1 - near))[2]
        errors.append(np.abs(slope() - exact).max() / np.abs(exact).max())
    assert errors[0] < 0.02
    assert errors[1] < 0.35 * errors[0] or errors[0] < 1e-9


# ------------------------------------------------------------------ a centred point mass: the
# circle is exact

class Circle:
    """|(k − f² k_m (1 − ρ²)^{−3/2} − mω² + icω) r| = q ω² u for the centred orbit of radius r = ρ
    g0.
    """

    def __init__(self, model):
        self.m, self.c, self.k = model.M[0, 0], model.C[0, 0], model.K[0, 0]
        self.pull, self.gap = model.law.stiffness, model.gap
        self.u = math.hypot(*model.unbalance_cos)

    def unbalance(self, r, speed, field=1.0, stiffness=None):
        """The factor on the unbalance that makes the radius r."""
        soft = field**2 * self.pull * (1 - (r / self.gap) ** 2) ** -1.5
        dynamic = (self.k if stiffness is None else stiffness) - soft - self.m * speed**2
        return math.hypot(dynamic, self.c * speed) * r / (speed**2 * self.u)

    def field(self, r, speed):
        """The factor on the field that makes the radius r, below resonance."""
        rest = math.sqrt((speed**2 * self.u / r) ** 2 - (self.c * speed) ** 2)
        return math.sqrt((self.k - self.m * speed**2 - rest) / self.pull
                         * (1 - (r / self.gap) ** 2) ** 1.5)


@pytest.mark.parametrize(("parameter", "first", "to"), [
    ("speed", rpm(60), rpm(400)), ("field", None, 2.0), ("unbalance", None, 40.0),
    ("bearings.spring.stiffness", None, 1e8), ("bearings.spring.stiffness", None, 9e8)])
def test_every_point_is_on_the_exact_curve(peer, speed, parameter, first, to):
    exact = Circle(peer)
    branch = follow(peer, parameter, to=to, speed=first or speed)
    assert len(branch) > 8
    for orbit, value in zip(branch, branch.values, strict=True):
        r = orbit.amplitudes[0, 0]
        assert orbit.amplitudes[1, 0] == pytest.approx(r, rel=1e-8)
        assert np.abs(orbit.mean).max() < 1e-8 * r
        assert orbit.amplitudes[:, 1:].max() < 1e-8 * r
        at = {"speed": (value,), "field": (speed, value), "unbalance": (speed,),
              "bearings.spring.stiffness": (speed, 1.0, value)}[parameter]
        wanted = value if parameter == "unbalance" else 1.0
        assert exact.unbalance(r, *at) == pytest.approx(wanted, rel=1e-7)


def test_folds_where_the_formula_turns(peer, speed):
    exact = Circle(peer)
    for parameter, formula in (("unbalance", lambda r: exact.unbalance(r, speed)),
                               ("field", lambda r: exact.field(r, speed))):
        turn = minimize_scalar(lambda r, f=formula: -f(r), bounds=(3e-4, 5e-3), method="bounded",
                               options={"xatol": 1e-9})
        branch = follow(peer, parameter, to=40.0, speed=speed,
                        method=Arclength(max_folds=1, tail=0))
        assert branch.folds[0].value == pytest.approx(-turn.fun, rel=1e-10)
        assert branch.at_fold(0).amplitudes[0, 0] == pytest.approx(turn.x, rel=1e-4)
        assert branch.folds[0].said.endswith("times its own")


def test_a_resonance_bent_to_the_left(peer):
    """Along speed the pull softens the peak: two folds, each where the exact curve is vertical."""
    exact = Circle(peer)
    branch = follow(peer, "speed", to=rpm(400), speed=rpm(60))
    assert len(branch.folds) == 2
    high, low = (fold.value for fold in branch.folds)
    assert low < high
    for number, fold in enumerate(branch.folds):
        r = branch.at_fold(number).amplitudes[0, 0]
        h = 1e-6 * r  # along speed, ∂(unbalance)/∂r = 0 is where dω/dr = 0
        slope = (exact.unbalance(r + h, fold.value) - exact.unbalance(r - h, fold.value)) / (2 * h)
        assert abs(slope * r) < 1e-5
        assert exact.unbalance(r, fold.value) == pytest.approx(1.0, rel=1e-9)
    assert "reached 41.89 rad/s as asked" in branch.stopped
    assert "rad/s; folds: " in str(branch)


# ------------------------------------------------------------------ directions and ways

def test_once_around_the_stator(peer, unit, speed):
    """Direction is an angle: after a full turn the orbit is back, and the parameter is where it was
    asked to go.
    """
    for model in (peer, unit):
        full = math.pi / 2 + 2 * math.pi
        branch = follow(model, "direction", to=full, speed=speed, static_eccentricity=0.05)
        assert not branch.closed
        assert not branch.folds
        assert "It reached 7.854 rad as asked" in branch.stopped
        assert branch.values[-2] < full <= branch.values[-1]
        last = branch[-1]
        again = HarmonicBalance().solve(model, speed, 0.05,
                                        direction=last_direction(branch) - 2 * math.pi)
        assert np.abs(again.coefficients - last.coefficients).max() < 1e-10 * model.gap
        # bearings are isotropic, so the machine sees the same at every angle: the mean keeps its
        # size and turns along
        turn = branch.coefficients[:, 0, 0] + 1j * branch.coefficients[:, 1, 0]
        assert np.abs(turn) == pytest.approx(np.abs(turn[0]), rel=1e-9)
        assert np.unwrap(np.angle(turn)) == pytest.approx(np.angle(turn[0])
                                                          - (branch.values - branch.values[0]),
                                                          abs=1e-9)
        centres = model.gap * 0.05 * np.stack([np.sin(branch.values), np.cos(branch.values)],
                                              axis=1)
        assert branch.centres == pytest.approx(centres, abs=1e-15)


def last_direction(branch):
    return float(branch.values[-1])


@pytest.mark.parametrize(("parameter", "up", "down"), [
    ("speed", rpm(160), rpm(140)), ("field", 1.05, 0.9), ("unbalance", 1.4, 0.2),
    ("bearings.guide.stiffness", 1.6e9, 1.2e9), ("direction", 2.0, 1.0),
    ("static_eccentricity", 0.06, 0.02)])
def test_both_ways(unit, speed, parameter, up, down):
    """One starts up, the other down; each point is what a solver finds alone on a model made anew.
    """
    for to in (up, down):
        branch = follow(unit, parameter, to=to, speed=speed, static_eccentricity=0.04)
        sign = math.copysign(1, to - branch.values[0])
        assert (np.diff(branch.values) * sign > 0).all()
        assert sign * (branch.values[-1] - to) >= 0 > sign * (branch.values[-2] - to)
        value, middle = float(branch.values[-2]), branch[-2]
        arguments = {"speed": speed, "static_eccentricity": 0.04, "direction": math.pi / 2}
        model = unit
        if parameter in arguments:
            arguments[parameter] = value
        elif parameter == "field":
            model = unit.with_field(value)
        elif parameter == "unbalance":
            model = unit.with_unbalance(value)
        else:
            guide = unit.supports["guide"]
            rows = guide.rows
            model = replace(unit, K=unit.K + (value - guide.stiffness[0, 0]) * rows.T
                            @ rows)
        alone = HarmonicBalance().solve(model, arguments["speed"], arguments["static_eccentricity"],
                                        direction=arguments["direction"])
        assert np.abs(alone.coefficients - middle.coefficients).max() < 1e-10 * unit.gap
        assert middle.speed == pytest.approx(arguments["speed"])


def test_stiffness_of_the_card_is_that_of_the_branch(make_kaplan, speed):
    """Following a bearing is what building the machine with another bearing gives, Rayleigh damping
    kept as built.
    """
    stiff = 1.5e9
    soft, hard = make_kaplan(), make_kaplan()
    bearing = hard.bearings[0]
    hard = replace(hard, bearings=(replace(bearing, stiffness=stiff), hard.bearings[1]))
    built = replace(hard.model(), C=soft.model().C)
    branch = follow(soft.model(), f"bearings.{bearing.name}.stiffness", to=1.6e9, speed=speed,
                    static_eccentricity=0.05)
    (on_branch,) = orbits_at(branch, stiff)
    alone = HarmonicBalance().solve(built, speed, 0.05)
    assert np.abs(alone.coefficients - on_branch.coefficients).max() < 1e-10 * built.gap


@pytest.mark.parametrize(("key", "to", "points"), [
    ("bodies.generator.mass", 1.3e5, 20), ("air_gap.gap", 0.0105, 20), ("shaft.diameter", 0.73, 40),
    ("bodies.turbine.unbalance", 20.0, 30), ("air_gap.tangential", 0.004, 20)])
def test_any_number_of_a_card(key, to, points):
    """Each end is what a machine made anew with that number has, but for its Rayleigh damping; also
    from 0, and where the gap, which scales the unknowns, changes on the way.
    """
    machine = load_machine("kaplan-150rpm")
    branch = follow(machine.model(), key, to=to, speed=machine.speed, static_eccentricity=0.03)
    assert branch.stopped.startswith("It reached") and len(branch) < points
    made = vary(machine, {key: to}).model()
    alone = HarmonicBalance().solve(replace(made, C=branch[-1].model.C), machine.speed, 0.03)
    assert alone.local == pytest.approx(branch[-1].local, abs=1e-9 * made.gap)
    assert np.array_equal(branch.local[-1], branch[-1].local)
    assert branch.centres[-1] == pytest.approx([0.03 * made.gap, 0.0], abs=1e-15)
    assert branch.smallest_gaps[-1] == branch[-1].smallest_gap < made.gap


# ------------------------------------------------------------------ closed branches

def test_a_closed_branch_is_recognised(peer, speed):
    """Past e = 0 the curve is its own mirror image, so it comes back to where it began, with folds
    in pairs ± e.
    """
    options = {"max_folds": 60, "max_points": 3000}
    half = follow(peer, to=0.2, speed=speed, method=Arclength(**options))
    assert not half.closed
    assert "It came back to 0 %" in half.stopped
    whole = follow(peer, to=0.2, speed=speed, method=Arclength(**options, past_start=True))
    assert whole.closed
    assert "It is closed" in whole.stopped
    folds = np.array([fold.value for fold in whole.folds])
    assert len(folds) == 2 * len(half.folds) == 10
    assert folds[:5] == pytest.approx([fold.value for fold in half.folds], abs=1e-10)
    assert folds == pytest.approx(-folds[::-1], abs=1e-10)
    first, last = (np.append(whole.unknowns[i], whole.values[i]) for i in (0, -1))
    step = np.linalg.norm(np.append(whole.unknowns[-2], whole.values[-2]) - last)
    assert np.linalg.norm(first - last) <= step  # the last step passed the first point
    # it is not called closed where it only passes the value of the start
    assert (np.abs(np.diff(np.sign(whole.values[1:-2]))) > 0).sum() >= 1


def test_an_isola(peer):
    """A closed curve in unknowns that no natural path from far away reaches."""
    def ring(y, parameter):
        a, b = y[0] - 0.4, parameter - 2.0
        return (np.array([a * a + b * b - 0.09, y[1] - y[0]]),
                np.array([[2 * a, 0.0], [-1.0, 1.0]]),
                np.array([2 * b, 0.0]))
    steps = list(itertools.islice(arclength(ring, np.array([0.7, 0.7]), 2.0, max_step=0.05), 70))
    angle = np.unwrap([math.atan2(s.parameter - 2.0, s.y[0] - 0.4) for s in steps])
    assert angle[-1] > 2 * math.pi
    assert max(abs((s.y[0] - 0.4) ** 2 + (s.parameter - 2) ** 2 - 0.09) for s in steps) < 1e-12


def test_a_branch_can_be_stepped(peer, speed):
    """The generator inside `follow`, one step at a time, gives the rows of the branch."""
    balance = HarmonicBalance()
    orbit = balance.solve(peer, speed)
    along = path(peer, "static_eccentricity", balance, speed, 0.0, math.pi / 2)
    walk = arclength(along.system(), orbit.coefficients.ravel() / peer.gap, 0.0, step=0.002,
                     max_step=0.02)
    steps = [next(walk) for _ in range(20)]
    branch = follow(peer, to=0.2, speed=speed)
    assert np.array([s.parameter for s in steps]) == pytest.approx(branch.values[:20], abs=1e-13)
    assert steps[0].iterations <= 2
    assert all(s.residual < 1e-10 for s in steps)


# ------------------------------------------------------------------ ends and refusals

def test_it_does_not_step_over_the_edge_of_what_is_allowed(peer, speed):
    """A step that would make the speed negative or put the stator beyond the rotor is taken
    shorter.
    """
    slow = follow(peer, "speed", to=0.3, speed=rpm(20))
    assert 0 < slow.values[-1] <= 0.3
    free = replace(peer, law=peer.law.scaled(0.0))
    far = follow(free, to=0.999, speed=speed)
    assert "No further point was found near 99" in far.stopped
    assert 0.95 < far.values[-1] < 1


def test_negative_eccentricities_keep_their_direction(peer, speed):
    start = HarmonicBalance().solve(peer, speed, -0.03, direction=0.4)
    branch = follow(peer, to=-0.04, speed=speed, start=start)
    assert np.abs(branch[0].coefficients - start.coefficients).max() < 1e-10 * peer.gap
    assert branch.centres[0] == pytest.approx(start.centre, rel=1e-14)


def test_what_a_model_does_not_have(peer, unit, speed):
    with pytest.raises(BadInput, match=r"bearings\.spring\.stiffness"):
        follow(peer, "bearings.guide.stiffness", to=1e9, speed=speed)
    with pytest.raises(BadInput, match="static_eccentricity other than 0"):
        follow(unit, "direction", to=3.0, speed=speed)
    with pytest.raises(BadInput, match=r"to is missing.* from 15\.71 rad/s"):
        follow(unit, "speed", speed=speed)
    with pytest.raises(BadInput, match="to is nan; it must be a finite number"):
        follow(unit, "field", to=math.nan, speed=speed)
