"""Tapered elements and two materials: the uniform element, a cone's closed form and the limit of
many steps.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from hydrolab import BadInput, load_machine, modes, vary
from hydrolab.machine.bearings import RadialBearing
from hydrolab.machine.crack import Crack
from hydrolab.machine.elements import ELEMENTS, shaft_element, tapered_element
from hydrolab.machine.parts import Machine, RigidBody, Shaft

E, RHO, NU, KAPPA = 2.11e11, 7810.0, 0.29926, 0.886
MODULUS = E / (2 * (1 + NU))


@pytest.mark.parametrize("element", ELEMENTS)
def test_without_taper_it_is_the_uniform_element(element):
    area, second = math.pi / 4 * (0.25 - 0.01), math.pi / 64 * (0.0625 - 1e-4)
    one = shaft_element(element, 0.7, E, RHO, area, second, NU, KAPPA)
    other = tapered_element(element, 0.7, E, RHO, np.full(2, 0.5), np.full(2, 0.1), NU, KAPPA)
    for mine, its in zip(one, other, strict=True):
        assert its == pytest.approx(mine, rel=1e-12, abs=1e-12 * np.abs(mine).max())


def test_one_element_bends_as_a_cone_exactly():
    """A cone held at its thick end with a force at the thin one, in closed form."""
    thin, thick, length, force = 0.2, 0.5, 3.0, 1e5
    K = tapered_element("timoshenko", length, E, RHO, np.array([thin, thick]), np.zeros(2), NU,
                        KAPPA)[2]
    free = np.linalg.solve(K[:4, :4], [force, 0, 0, 0])
    bending = 64 * force * length**3 / (3 * math.pi * E * thin * thick**3)
    shear = 4 * force * length / (math.pi * KAPPA * MODULUS * thin * thick)
    assert free[0] == pytest.approx(bending + shear, rel=1e-9)


def rotor(count, tapered=True):
    """Example 5.9.10 of Friswell et al. (2010): 25 to 40 mm in so many elements."""
    nodes = np.linspace(0, 1.5, count + 1)
    at = 0.025 + 0.015 * nodes / 1.5
    middles = (at[:-1] + at[1:]) / 2
    shaft = Shaft(nodes, at[:-1] if tapered else middles, E, RHO, NU, KAPPA, "timoshenko",
                  lower_diameter=at[1:] if tapered else 0.0)
    mass = RHO * math.pi / 4 * 0.25**2 * 0.04
    disc = RigidBody("disc", count // 2, mass, mass * (0.25**2 / 16 + 0.04**2 / 12),
                     mass * 0.25**2 / 8)
    ends = [RadialBearing(name, node, 1e7, 1e3) for name, node in (("a", 0), ("b", count))]
    return Machine("5.9.10", 3000 * math.pi / 30, shaft, (disc,), ends)


def test_few_tapered_elements_are_the_limit_of_many_steps():
    speed = 3000 * math.pi / 30
    limit, four = (modes(rotor(n).model(), speed).hertz[:2] for n in (48, 4))
    coarse, fine = (modes(rotor(n, tapered=False).model(), speed).hertz[:2] for n in (24, 48))
    stepped = fine + (fine - coarse) / 3  # steps err with the square of their length
    assert limit == pytest.approx(stepped, rel=2e-6)
    assert four == pytest.approx(limit, rel=1e-4)
    assert np.abs(coarse / limit - 1).max() > 10 * np.abs(four / limit - 1).max()


def test_two_materials_along_a_shaft():
    unit = load_machine("kaplan-150rpm")
    young = [2e11] * 6 + [1e11] * 6
    half = replace(unit, shaft=replace(unit.shaft, young=young, density=[7850.0] * 6 + [2700] * 6))
    soft = vary(unit, {"shaft.young": 1e11, "shaft.density": 2700}).model()
    hard, mixed = unit.model(), half.model()
    assert mixed.K[:20, :20] == pytest.approx(hard.K[:20, :20])
    assert mixed.K[32:, 32:] == pytest.approx(soft.K[32:, 32:])
    assert mixed.M[32:, 32:] == pytest.approx(soft.M[32:, 32:])
    assert "[2e+11, 2e+11" in str(half)


@pytest.mark.parametrize("change, said", [
    ({"lower_diameter": [0.8, 0.7]}, "lower_diameter has 2 entries; give one number or one per"),
    ({"young": [2e11, 2e11]}, "young has 2 entries"),
    ({"inner_diameter": 0.6, "lower_diameter": 0.5}, "must be smaller than shaft.lower_diameter")])
def test_what_cannot_be_is_refused(change, said):
    unit = load_machine("kaplan-150rpm")
    with pytest.raises(BadInput, match=said):
        replace(unit.shaft, **change)
    with pytest.raises(BadInput, match="tapered; the crack's"):
        replace(unit, shaft=replace(unit.shaft, lower_diameter=0.6), cracks=(Crack("c", 1, 0.1),))
