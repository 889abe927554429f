"""All steady states, branches from flips, tori: against shooting, exact counts, brute force."""

import math

import numpy as np
import pytest

from hydrolab import (
    Arclength,
    HarmonicBalance,
    branch_off,
    floquet,
    follow,
    orbits_at,
    poincare,
    steady_states,
)
from hydrolab.dynamics.batch import Outcome, newton_batch, stack
from hydrolab.dynamics.steady_states import deflate
from hydrolab.errors import BadInput
from tests.machines import MACHINES
from tests.reference.shooting import Shooting


@pytest.fixture(scope="module")
def doubled(branch):
    """From the flip at 8.068 %, with its stability."""
    return branch_off(branch, branch.flips[1])


# ------------------------------------------------------------------ from a flip

def test_the_doubled_branch_ends_in_the_other_flip(doubled, branch):
    found, stability = doubled
    assert [p.kind for p in found.special_points] == ["flip", "fold", "flip"]
    assert found.values[0] == found.special_points[0].value == branch.flips[1].value
    assert found.values[-1] == pytest.approx(branch.flips[0].value, abs=1e-8)
    assert found.stopped.startswith("It ends in a flip at 7.764 %")
    assert "folds: 6.9296 %" in str(found)
    (fold,) = found.folds
    verdicts = stability.verdicts
    assert set(verdicts[1:fold.after + 1]) == {"stable"}
    assert set(verdicts[fold.after + 1:-1]) == {"unstable"}
    assert not stability.crossings  # no further doubling
    assert found.smallest_gaps[fold.after] == pytest.approx(5.90e-3, abs=2e-5)
    assert all(o.residual < 1e-3 for o in found)


def test_from_the_other_end_with_few_harmonics(shipped, speed, branch, doubled):
    rough = follow(shipped, speed=speed, to=0.12, method=Arclength(max_folds=2, tail=0))
    back, stability = branch_off(rough, rough.flips[0])
    assert back.folds[0].value == pytest.approx(doubled[0].folds[0].value, abs=2e-6)
    assert back.values[-1] == pytest.approx(branch.flips[1].value, abs=2e-6)
    assert not stability.crossings


def test_folds_and_flips_by_shooting(shipped, branch, doubled, speed):
    """To 1e-6, another method on another basis."""
    once, twice = Shooting(shipped, speed, 1), Shooting(shipped, speed, 2)
    for flip in branch.flips[:2]:
        theirs = once.crossing(branch[flip.after], branch[flip.after + 1], -1.0)
        assert flip.value == pytest.approx(theirs, abs=1e-6)
    (fold,) = doubled[0].folds
    theirs = twice.crossing(doubled[0][fold.after], doubled[0][fold.after + 1], 1.0)
    assert fold.value == pytest.approx(theirs, abs=1e-6)
    assert 100 * fold.value == pytest.approx(6.9295, abs=2e-4)


def test_only_flips_branch_off(branch):
    with pytest.raises(BadInput, match="point is a fold at"):
        branch_off(branch, branch.folds[0])


def test_along_the_field_too(shipped, branch, speed):
    """The same doubled orbit, reached by another parameter."""
    start = orbits_at(branch, 0.082)[2]
    along = follow(shipped, "field", to=0.9, speed=speed, start=start,
                   method=Arclength(HarmonicBalance(8), max_folds=1, tail=0))
    flip = along.flips[0]
    found, stability = branch_off(along, flip)
    assert found.parameter == "field"
    assert found.values[0] == flip.value
    odd = np.hypot(found.local[:, 0, 1], found.local[:, 0, 2])
    assert odd[0] == 0 and (odd[1:5] > 1e-6).all()
    assert {"stable", "unstable"} >= set(stability.verdicts[1:5])


# ------------------------------------------------------------------ a torus

def test_a_torus_beyond_a_neimark_sacker_point(make_jeffcott, speed):
    """Its rotation number begins as the angle of the multipliers, its size as a square root."""
    model = make_jeffcott(stiffness=3.8e8, radius=8e-4).model()
    leg = follow(model, to=0.3, speed=speed, method=Arclength(HarmonicBalance(8), max_folds=2))
    point = leg.neimark_sackers[0]
    angle = float(point.kind.split(",")[1].split("°")[0]) / 360
    below = [o for o in orbits_at(leg, point.value - 1e-4) if floquet(o).verdict == "stable"][-1]
    tori = [poincare(below, point.value + away, revolutions=1500, keep=500)
            for away in (5e-4, 1e-3)]
    assert [t.period[-1] for t in tori] == [0, 0]
    near, far = (t.rotation_number for t in tori)
    assert near == pytest.approx(angle, abs=1e-3)
    assert near - (far - near) == pytest.approx(angle, abs=2e-4)  # at the point itself
    sizes = [np.ptp(t.section[0][:, 0]) for t in tori]
    assert (sizes[1] / sizes[0]) ** 2 == pytest.approx(2, rel=0.15)
    calm = poincare(orbits_at(leg, 0.05)[0], 0.05, revolutions=300, keep=20)
    assert calm.settled[0] and math.isnan(calm.rotation_number)


# ------------------------------------------------------------------ all that can be found

def test_at_8_8_percent_there_are_at_least_four(shipped, speed):
    found = steady_states(shipped, speed=speed, static_eccentricity=0.088)
    means = [round(1e6 * math.hypot(*o.mean)) for o in found.orbits]
    assert means[:4] == [1595, 1753, 1944, 3819]
    assert [f.verdict for f in found.stability][:4] == ["stable", "unstable", "stable", "unstable"]
    assert found.stable == (found[0], found[2])
    assert 1e3 * found[3].smallest_gap == pytest.approx(5.894, abs=1e-3)
    assert 1e6 * found[3].amplitudes[:, 0] == pytest.approx([209, 1790], abs=1)
    assert found.stability[3].largest == pytest.approx(9070, rel=1e-3)
    assert "10 folds" in found.searched and "There may be others." in found.searched
    assert str(found).startswith(f"{len(found)} steady states found. Searched: the branch")
    # each meets its own start when it is shot
    shot = Shooting(shipped, speed, 1)
    for orbit in found.orbits[:3]:
        x = shot.state(orbit)
        end = shot.period(x, 0.088)[0]
        assert np.abs((end - x)[:shot.size // 2]).max() < 1e-5 * np.abs(x).max() * max(
            1.0, floquet(orbit).largest)
    # brute force finds no other
    eq = HarmonicBalance(8).equations(shipped, speed)
    random = np.random.default_rng(2)
    y = np.zeros((400, *eq.linear.shape))
    y[:, :, :3] = random.uniform(-0.5, 0.5, (400, 2, 3)) * random.uniform(0, 1, (400, 1, 1))
    y[:, :, 0] += shipped.centre(0.088) / eq.length
    solved, outcome = newton_batch(stack([eq]).take(np.zeros(400, dtype=int)), y.reshape(400, -1),
                                   np.tile(shipped.centre(0.088), (400, 1)), max_steps=60)
    known = np.array([o.local.ravel() / eq.length for o in found.orbits])
    away = np.abs(solved[outcome == Outcome.CONVERGED][:, None] - known).max(axis=2).min(axis=1)
    assert len(away) > 50 and away.max() < 1e-6


def test_circles_of_a_point_mass_are_counted(make_jeffcott, speed):
    """In a concentric stator a circle of radius r obeys |k − mΩ² + icΩ − k_p(r)| r = m e Ω²."""
    model = make_jeffcott(stiffness=3.8e8, radius=8e-4).model()
    m, k, c = model.M[0, 0], model.K[0, 0], model.C[0, 0]
    load = speed**2 * np.abs(model.unbalance_cos - 1j * model.unbalance_sin).max()
    r = np.linspace(1e-5, 0.999, 200001)
    pull = model.law.stiffness * (1 - r * r) ** -1.5
    miss = np.abs(k - m * speed**2 + 1j * c * speed - pull) * r * model.gap - load
    roots = r[:-1][np.diff(np.sign(miss)) != 0] * model.gap
    found = steady_states(model, speed=speed)
    circles = sorted(o.amplitudes[0, 0] for o in found.orbits
                     if np.ptp(o.amplitudes[:, 0]) < 1e-9 and math.hypot(*o.mean) < 1e-9)
    assert len(roots) == 3
    assert circles == pytest.approx(roots, abs=1e-5 * model.gap)


@pytest.mark.parametrize("name", ["linear", "no gap"])
def test_a_linear_machine_has_one(name):
    machine = MACHINES[name]()
    found = steady_states(machine.model(), speed=machine.speed,
                          static_eccentricity=0.02 * (name == "linear"))
    assert len(found) == 1


def test_motions_of_two_revolutions(shipped, speed, doubled):
    """At 7.5 % the doubled branch has two, one stable; each is counted once, not once a
    revolution.
    """
    found = steady_states(shipped, speed=speed, static_eccentricity=0.075, revolutions=2, starts=5)
    theirs = sorted(math.hypot(*o.mean) for o in orbits_at(doubled[0], 0.075))
    assert [math.hypot(*o.mean) for o in found.orbits] == pytest.approx(theirs, abs=1e-9)
    assert [f.verdict for f in found.stability] == ["unstable", "stable"]
    assert "repeating every 2 revolutions" in str(found[0])
    nothing = steady_states(shipped, speed=speed, static_eccentricity=0.05, revolutions=3, starts=2)
    assert len(nothing) == 0 and "0 steady states found" in str(nothing)


def test_deflation_is_exact():
    """The Jacobian against central differences, and a known root that no longer attracts."""
    def cubic(y):
        return y**3 - y, np.diag(3 * y**2 - 1)

    system = deflate(cubic, [np.array([1.0, 0.0]), np.array([-1.0, 0.0])])
    y, h = np.array([0.3, 0.4]), 1e-6
    numeric = np.stack([(system(y + d)[0] - system(y - d)[0]) / (2 * h) for d in h * np.eye(2)],
                       axis=1)
    assert system(y)[1] == pytest.approx(numeric, abs=1e-7)
    assert np.abs(system(np.array([1.0 + 1e-6, 0.0]))[0]).max() > 1


def test_steady_states_refuse(shipped, speed):
    with pytest.raises(BadInput, match="revolutions"):
        steady_states(shipped, speed=speed, revolutions=0)
    with pytest.raises(BadInput, match="static_eccentricity"):
        steady_states(shipped, speed=speed, static_eccentricity=math.nan)
