"""Motions advanced as a batch, against DOP853; basins and slow passages built on them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hydrolab import (
    Arclength,
    HarmonicBalance,
    Newmark,
    RungeKutta,
    basins,
    follow,
    integrate,
    load_machine,
    orbits_at,
    poincare,
    stable_orbits_at,
    sweep_in_time,
)
from hydrolab.dynamics.ensemble import (
    CONTACT,
    OTHER,
    Setting,
    advance,
    split,
    split_for,
    starts,
)
from hydrolab.errors import BadInput
from hydrolab.machine.bearings import RadialBearing
from hydrolab.machine.pull import CircularPull
from tests.machines import MACHINES


@pytest.fixture(scope="module")
def branch(shipped, speed):
    return follow(shipped, speed=speed, method=Arclength(max_folds=3))


def place(system, states):
    """The generator's (x, z) of states."""
    return system.watch @ states


def at(orbit):
    """The setting of an orbit."""
    return Setting(orbit.centre[:, None])


# ------------------------------------------------------------------ the integrator

def test_second_order_against_dop853(peer, speed):
    """One revolution far from any orbit: the error falls with the square of the step."""
    orbit = HarmonicBalance().solve(peer, speed, 0.05)
    push = (4e-4, -2e-4)
    exact = integrate(peer, RungeKutta(1e-12, 1e-16, 8), speed=speed, static_eccentricity=0.05,
                      start=orbit,
                      disturbance=push, revolutions=2)
    system = split(peer, speed)
    begin = system.state(orbit)[:, None]
    to_modes = np.linalg.solve(system.model.selection, push)
    begin[:2, 0] += to_modes
    steps = np.array([64, 128, 256, 512])
    errors = []
    for n in steps:
        end, contact, made = advance(system, begin, at(orbit), 2, int(n))
        assert made == 2 and np.isnan(contact).all()
        errors.append(np.hypot(*(place(system, end)[:, 0] - exact.positions[:, -1])))
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(2, abs=0.1)
    assert errors[-1] < 1e-3 * np.hypot(*push)


def test_without_a_pull_it_is_exact(unit, speed):
    """The linear motion has no error at any step, and many members are each their own."""
    free, still = unit.with_field(0.0), Setting(np.zeros((2, 1)))
    system = split(free, speed, 6)
    random = np.random.default_rng(0)
    states = 1e-6 * random.normal(size=(len(system.constant), 5))
    coarse, _, _ = advance(system, states, still, 3, 8)
    fine, _, _ = advance(system, states, still, 3, 200)
    assert coarse == pytest.approx(fine, abs=1e-9 * np.abs(fine).max())
    alone = np.hstack([advance(system, states[:, i:i + 1], still, 3, 8)[0] for i in range(5)])
    assert coarse == pytest.approx(alone, abs=1e-15)


def test_an_orbit_comes_back(shipped, branch):
    """The steady states of harmonic balance are those of the integrator, to its own order."""
    for orbit in stable_orbits_at(branch, 0.088):
        system = split(shipped, orbit.speed, 12)
        begin = system.state(orbit)[:, None]
        miss = [np.abs(place(system, advance(system, begin, at(orbit), 1, n)[0] - begin)).max()
                / shipped.gap
                for n in (128, 256)]
        assert miss[1] < 3e-4
        assert miss[0] / miss[1] == pytest.approx(4, rel=0.2)


def test_contact_time_against_dop853(peer, speed):
    """Beyond the fold the rotor is pulled in; when, agrees to a step."""
    orbit = HarmonicBalance().solve(peer, speed, 0.07)
    system = split(peer, speed)
    centre = peer.centre(0.16)
    start = system.state(orbit)
    end, contact, _ = advance(system, np.stack([start, 0 * start], axis=1),
                              Setting(centre[:, None]), 30, 512)
    motion = integrate(peer, RungeKutta(1e-10, 1e-15, 512), speed=speed, static_eccentricity=0.16,
                       start=orbit,
                       revolutions=30)
    assert "touches the stator" in motion.stopped
    assert contact[0] == pytest.approx(motion.revolutions, abs=2 / 512)
    assert np.isnan(end[:, 0]).all()  # it has no state to go on from


def test_members_that_touch_do_not_disturb_the_others(shipped, branch):
    (low, _) = stable_orbits_at(branch, 0.088)
    system = split(shipped, low.speed, 6)
    calm = system.state(low)
    wild = calm.copy()
    wild[len(calm) // 2:] *= -40
    lost = np.full_like(calm, 1.0)
    starts = np.stack([wild, calm, lost, calm], axis=1)
    states, contact, made = advance(system, starts, at(low), 4, 64)
    alone, _, _ = advance(system, calm[:, None], at(low), 4, 64)
    assert np.isnan(contact[[1, 3]]).all() and np.isfinite(contact[[0, 2]]).all()
    assert contact[2] < 1  # a metre in every mode
    assert states[:, 1] == pytest.approx(alone[:, 0], rel=1e-11)
    assert made == 4


def test_an_interrupt_returns_whole_revolutions(shipped, branch):
    (low, _) = stable_orbits_at(branch, 0.088)
    system = split(shipped, low.speed, 6)
    begin = system.state(low)[:, None] * np.array([[1.0, 1.01]])

    def stop(done, whole):
        if done == 3:
            raise KeyboardInterrupt
    states, _, made = advance(system, begin, at(low), 10, 32, progress=stop)
    assert made == 3
    assert states == pytest.approx(advance(system, begin, at(low), 3, 32)[0], abs=1e-15)


def test_members_without_a_state_to_go_on_from_end_early(shipped, branch):
    """All in contact: nothing is left to do, and that counts as done."""
    (low, _) = stable_orbits_at(branch, 0.088)
    system = split(shipped, low.speed, 6)
    _, contact, made = advance(system, np.full((len(system.constant), 3), 1.0), at(low), 100, 32)
    assert made == 100
    assert np.isfinite(contact).all()


UNIT = load_machine("kaplan-150rpm")
SEAL = RadialBearing("seal", 10, [[1e8, -3e7], [3e7, 1e8]], [[1e6, 0], [0, 1e6]])
HARD = {  # what a basis of modes at rest and kicks know nothing of
    "pads": MACHINES["pads"], "film": MACHINES["film"], "crack": MACHINES["crack"],
    "dashpots": lambda: replace(UNIT, damping=None, bearings=tuple(
        replace(b, damping=2e7 * np.eye(2)) for b in UNIT.bearings)),
    "seal": lambda: replace(UNIT, damping=None,
                            bearings=(*(replace(b, damping=2e6 * np.eye(2))
                                        for b in UNIT.bearings), SEAL)),
}


@pytest.mark.parametrize("name", HARD)
def test_a_push_against_all_degrees_of_freedom(name):
    """A tenth of a millimetre to the side, two revolutions later: many motions at once and one in
    time on their bases, and Newmark's method in fine steps with all DOFs.
    """
    machine, push = HARD[name](), 1e-4
    model, speed = machine.model(), machine.speed
    orbit = HarmonicBalance(8).solve(model, speed, 0.02)
    system = split_for(orbit, 256, 6)
    assert system.implicit == (name in ("pads", "film", "crack"))
    begin = starts(system, orbit, np.array([push]), np.zeros(1))
    ours = place(system, advance(system, begin, at(orbit), 2, 256).states)[:2, 0]
    options = {"speed": speed, "static_eccentricity": 0.02, "start": orbit, "revolutions": 2,
               "disturbance": (push, 0.0)}
    theirs = integrate(model, Newmark(1024), modes=None, **options).positions[:, -1]
    on_basis = integrate(model, Newmark(512), **options).positions[:, -1]
    assert ours == pytest.approx(theirs, abs=0.02 * push)
    assert on_basis == pytest.approx(theirs, abs=0.01 * push)


def test_steps_that_are_too_few_are_refused():
    machine = MACHINES["pads"]()
    orbit = HarmonicBalance(8).solve(machine.model(), machine.speed, 0.02)
    with pytest.raises(BadInput, match=r"steps is 8; .* over a period of the orbit is then known "
                       r"to [\d.]+ % of the gap, and it takes 0.1 %. Use \d+, or `integrate`"):
        split_for(orbit, 8, 6)


# ------------------------------------------------------------------ basins

@pytest.fixture(scope="module")
def picture(branch):
    orbits = stable_orbits_at(branch, 0.088)
    return basins(orbits, np.linspace(-3e-3, 2e-3, 13), np.linspace(-0.05, 0.05, 13),
                  revolutions=100)


def test_both_orbits_and_contact(picture):
    assert picture.ends.shape == picture.contact.shape == (13, 13)
    assert min(picture.share(end) for end in (0, 1, CONTACT)) > 0.05
    assert picture.share(OTHER) < 0.03
    assert np.isfinite(picture.contact[picture.ends == CONTACT]).all()
    assert np.isnan(picture.contact[picture.ends != CONTACT]).all()
    middle = np.argmin(np.abs(picture.velocity)), np.argmin(np.abs(picture.displacement))
    assert picture.ends[middle] == 0  # hardly a push: it stays on the first orbit
    share = f"{100 * picture.share(0):.1f} % on orbit 0"
    assert str(picture).endswith("A period's steps are known to 0.1 % of the gap.")
    assert f"169 starts after 100 revolutions: {share}" in str(picture)


def test_single_starts_by_dop853(shipped, picture, speed):
    """A few of each end, integrated alone: velocity 0, so that `integrate` can start there too."""
    row = basins(picture.orbits, np.linspace(-3e-3, 2e-3, 121), [0.0], revolutions=100)
    ends = row.ends[0]
    # not next to a boundary
    sure = [i for i in range(1, len(ends) - 1) if (ends[i - 1:i + 2] == ends[i]).all()]
    checked = set()
    for column in sure[::2]:
        if (end := int(ends[column])) not in checked:
            motion = integrate(shipped, RungeKutta(1e-8), speed=speed, static_eccentricity=0.088,
                               modes=6,
                               start=picture.orbits[0],
                               disturbance=(float(row.displacement[column]), 0.0),
                               revolutions=60)
            if end == CONTACT:
                assert "touches" in motion.stopped
            else:
                assert motion.finished
                away = motion.coefficients(4) - picture.orbits[end].coefficients
                assert np.abs(away).max() < 0.01 * shipped.gap
            checked.add(end)
    assert checked == {0, 1, CONTACT}


def test_basins_refuse_what_does_not_belong_together(branch, peer, speed):
    one, other = orbits_at(branch, 0.05)[0], orbits_at(branch, 0.06)[0]
    with pytest.raises(BadInput, match="orbits is empty"):
        basins([], [0.0], [0.0])
    with pytest.raises(BadInput, match="different models, speeds or ecc"):
        basins([one, other], [0.0], [0.0])
    with pytest.raises(BadInput, match="not finite"):
        basins([one], [math.nan], [0.0])


def test_basins_interrupted(branch):
    (orbit,) = orbits_at(branch, 0.05)

    def stop(done, whole):
        if done == 5:
            raise KeyboardInterrupt
    found = basins([orbit], [0.0, 1e-4], [0.0], revolutions=50, progress=stop)
    assert found.revolutions == 5
    assert found.ends.shape == (1, 2)


# ------------------------------------------------------------------ slow passages

class Impatient(CircularPull):
    """Presses Ctrl-C after `left` evaluations."""

    left = 0

    def force(self, e, *rest):
        Impatient.left -= 1
        if Impatient.left < 0:
            raise KeyboardInterrupt
        return super().force(e)


def test_up_and_down_again(shipped, branch, speed):
    """Up: it follows the first leg and jumps to the second at the fold. Down: it stays there until
    the flip.
    """
    fold = branch.folds[0].value
    low, high = stable_orbits_at(branch, 0.0885)
    up = sweep_in_time(low, np.array([0.0885, 0.089, 0.0895, 0.09]), revolutions=120, keep=3,
                       modes=6)
    assert up.stopped == "It passed all the values asked for."
    assert up.section.shape == (4, 3, 2)
    assert str(up).startswith(
        "Motion while static_eccentricity moved: it repeats every revolution from 8.85 % to 9 %. "
        "It passed all the values asked for. How it ends depends on the steps: with half the steps "
        "it touches at 8.95 %. `drift` moves it continuously. On 1")
    there = {e: [o.positions(np.zeros(1))[:, 0] for o in stable_orbits_at(branch, e)]
             for e in up.values}
    for e, section in zip(up.values, up.section, strict=True):
        leg = there[e][0] if e < fold else there[e][-1]
        assert section[-1] == pytest.approx(leg, abs=1e-3 * shipped.gap)
    assert len(there[0.09]) == 1
    assert abs(up.section[3, -1, 0] - up.section[0, -1, 0]) > 0.05 * shipped.gap  # it jumped
    down = sweep_in_time(high, np.array([0.0885, 0.085, 0.082]), revolutions=60, keep=3, modes=6)
    for e, section in zip(down.values, down.section, strict=True):
        leg = stable_orbits_at(branch, e)[-1].positions(np.zeros(1))[:, 0]
        assert section[-1] == pytest.approx(leg, abs=1e-3 * shipped.gap)
    assert up.settled[:2].all()


def test_below_the_flip_it_takes_two_revolutions(branch, shipped):
    """Just below 8.068 % the motion has period two, and its section two points."""
    orbit = stable_orbits_at(branch, 0.0812)[-1]
    found = poincare(orbit, 0.0803, revolutions=700, keep=40, modes=6, steps=128)
    section = found.section[0]
    even, odd = section[::2], section[1::2]
    assert np.abs(even.mean(axis=0) - odd.mean(axis=0)).max() > 20e-6
    assert np.ptp(even, axis=0).max() < 1e-6 > np.ptp(odd, axis=0).max()
    assert not found.settled[0]


def test_a_passage_ends_at_contact(branch):
    start = stable_orbits_at(branch, 0.1)[-1]
    found = sweep_in_time(start, [0.1, 0.13], revolutions=30, keep=2, modes=6)
    assert found.stopped == "The rotor touches the stator at 13 %."
    assert found.values.tolist() == [0.1]
    assert found.section.shape == (1, 2, 2)


def test_a_passage_can_be_interrupted(branch):
    """Ctrl-C in the middle of a value ends the passage; the values before are kept and no later one
    is tried.
    """
    (start,) = orbits_at(branch, 0.05)
    calls = []

    def stop(done, whole):
        calls.append(done)
    whole = sweep_in_time(start, [0.05, 0.051, 0.052], revolutions=4, keep=2, modes=6,
                          progress=stop)
    assert calls == [1, 2, 3]
    # a law that interrupts after some hundred steps stands for the key
    orbit = replace(start, equations=replace(start.equations,
                                             model=replace(start.model, law=Impatient(
        start.model.law.stiffness, start.model.law.gap))))
    Impatient.left = 128 * (3 + 6)  # three for the look at the step
    cut = sweep_in_time(orbit, [0.05, 0.051, 0.052], revolutions=4, keep=2, modes=6)
    assert cut.stopped == "It was interrupted at 5.1 %."
    assert cut.section == pytest.approx(whole.section[:1], abs=1e-15)


def test_a_passage_on_the_other_side(peer, speed):
    """A negative eccentricity is the other side of the stator, also in time."""
    start = HarmonicBalance().solve(peer, speed, -0.05, direction=0.7)
    found = sweep_in_time(start, [-0.05], revolutions=8, keep=4, steps=512)
    assert found.section[0, -1] == pytest.approx(start.positions(np.zeros(1))[:, 0],
                                                 abs=1e-4 * peer.gap)


def test_passages_refuse(branch):
    (start,) = orbits_at(branch, 0.05)
    for values, why in (([], "at least one"), ([math.nan], "finite numbers"),
                        ([1.0], "fractions of the gap")):
        with pytest.raises(BadInput, match=why):
            sweep_in_time(start, values)
    free = HarmonicBalance().solve(load_machine("three-disc").model(), 50.0)
    with pytest.raises(BadInput, match="has no air gap"):
        sweep_in_time(free, [0.0, 0.01])
    with pytest.raises(BadInput, match="between 1 and the 5 revolutions"):
        sweep_in_time(start, [0.05], revolutions=5, keep=6)
