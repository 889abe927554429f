"""The faults' steady states: pads against the bearing they replace and against a motion in time,
what a switched-off field leaves, and a second pair of eyes on each size.
"""

from dataclasses import replace

import numpy as np
import pytest

from hydrolab import BadInput, HarmonicBalance, RungeKutta, integrate, load_machine, reduce
from hydrolab.dynamics import ellipse
from hydrolab.machine import RadialBearing

UNIT = load_machine("kaplan-150rpm")


@pytest.fixture(scope="module")
def orbits(script):
    """Steady states at the rated speed, (field on, field off) by fault."""
    return {fault: [script.steady_state(*case, field, UNIT.speed) for field in (1.0, 0.0)]
            for fault, case in script.typical_faults(UNIT).items()}


def test_sizes_are_those_of_the_path(script, orbits):
    """By a Fourier transform of the path and the singular values of each harmonic's sine and
    cosine.
    """
    phase = 2 * np.pi * np.arange(256) / 256
    for orbit, _ in orbits.values():
        spectrum = np.fft.rfft(orbit.positions(phase), axis=1) / 128
        axes = [np.linalg.svd(np.array([s.real, s.imag]), compute_uv=False)[0]
                for s in spectrum.T[1:4]]
        mean = np.linalg.norm(orbit.positions(phase).mean(axis=1))
        assert script.sizes(orbit) == pytest.approx(1e6 * np.array([mean, *axes]), abs=1e-6)


def test_the_sound_machine_is_the_library_s(script, orbits):
    sound = HarmonicBalance(24).solve(UNIT.model(), UNIT.speed, 0.02)
    assert orbits["none"][0].coefficients == pytest.approx(sound.coefficients, abs=1e-12)


@pytest.mark.parametrize("damping", [0.0, 1e6])
def test_pads_that_all_touch_are_the_bearing_they_replace(script, damping):
    """Eight pads of a quarter of its stiffness each, its own damping and cross stiffness kept."""
    guide = replace(UNIT.bearings[0], damping=damping * np.eye(2),
                    stiffness=UNIT.bearings[0].stiffness + [[2e8, 1e7], [1e7, 0.0]])
    machine = replace(UNIT, bearings=(guide, *UNIT.bearings[1:]))
    tight = script.on_pads(machine, 1e-3)
    assert tight.pad_bearings[0].pad_stiffness == pytest.approx(1.37e9 / 4)
    pads, plain = (HarmonicBalance(6).solve(m.model(), UNIT.speed, 0.02).coefficients
                   for m in (tight, machine))
    # a touching pad is rounded by (1e-5 m / 1e-3 m)² / 4 of its force
    assert pads == pytest.approx(plain, abs=1e-4 * np.abs(plain).max())


def test_pads_that_open_let_the_rotor_swing_further(script, orbits):
    """Less stiffness on the side that opens: 1X and mean grow; they never shrink."""
    sizes = {preload: script.sizes(script.steady_state(script.on_pads(UNIT, preload), 0.02, 1.0,
                                                       UNIT.speed))[:2]
             for preload in (1e-4, 8e-5, 6e-5)}
    sound = script.sizes(orbits["none"][0])[:2]
    rows = np.array([sound, *sizes.values()])
    assert (np.diff(rows, axis=0) > 0).all()


def test_loose_pads_in_time(script, orbits):
    """The orbit that was reached by loosening the pads is where a motion in time stays."""
    machine, eccentricity = script.typical_faults(UNIT)["loose pads"]
    orbit = orbits["loose pads"][0]
    model = reduce(machine.model(), 10)
    richer = HarmonicBalance(32).solve(model, UNIT.speed, eccentricity, start=orbit)
    motion = integrate(model, RungeKutta(1e-8, 1e-11), speed=UNIT.speed,
                       static_eccentricity=eccentricity, revolutions=1, modes=None, start=richer)
    off = np.abs(motion.coefficients(3) - richer.coefficients[:, :7]).max()
    assert off < 2e-5 * richer.amplitudes.max()
    for k in (1, 2, 3):
        assert 1e6 * ellipse(motion.coefficients(3), k).major == pytest.approx(
            script.sizes(orbit)[k], rel=1e-3)


def test_without_the_field_no_fault_of_a_vertical_machine_makes_harmonics(script, orbits):
    for _, off in orbits.values():
        mean, first, second, third = script.sizes(off)
        assert mean + second + third < 1e-3 < first
    assert script.sizes(orbits["breathing crack"][0])[2] > 3 * script.sizes(orbits["none"][0])[2]


def test_picture(script, orbits):
    on, off = ({fault: pair[i] for fault, pair in orbits.items()} for i in (0, 1))
    picture = script.picture(on, off, "what was found")
    upper, lower = picture.figure.subfigs
    assert [axes.get_title() for axes in upper.axes] == list(orbits)
    bars = [bar.get_height() for bar in lower.axes[0].containers[0]]
    assert bars == pytest.approx([script.sizes(orbit)[0] for orbit in on.values()])


def test_a_bearing_softer_one_way_keeps_the_rest_of_its_stiffness(script):
    guide = RadialBearing("guide", 1, [2e9, 1e9])
    loose = script.on_pads(replace(UNIT, bearings=(guide,)), 0.0)
    assert loose.bearings[0].stiffness == pytest.approx(np.diag([1e9, 0.0]))
    assert not script.on_pads(UNIT, 0.0).bearings[1:]  # nothing is left of a round one
    with pytest.raises((BadInput, AttributeError)):
        script.typical_faults(load_machine("jeffcott"))
