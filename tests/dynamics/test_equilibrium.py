"""Equilibria against the exact fold of a point mass, a beam's formula, and a motion that settles.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from hydrolab import BadInput, HarmonicBalance, NoConvergence, load_machine, rpm, vary
from hydrolab.dynamics.equilibrium import equilibrium, largest_offset
from hydrolab.machine.crack import Crack
from hydrolab.machine.parts import MU_0, AirGap, Machine, RadialBearing, RigidBody, Shaft

UNIT = load_machine("kaplan-150rpm")


def test_the_largest_offset_of_a_point_mass_is_its_static_fold():
    """e_s = ε − ε/(κ (1 − ε²)^{3/2}) is largest where (1 + 2ε²)/(1 − ε²)^{5/2} = κ."""
    model = load_machine("jeffcott").model()
    kappa = model.K[0, 0] / model.law.stiffness
    fold = brentq(lambda e: (1 + 2 * e * e) / (1 - e * e) ** 2.5 - kappa, 0.01, 0.9)
    exact = fold - fold / (kappa * (1 - fold**2) ** 1.5)
    assert largest_offset(model) == pytest.approx(exact, abs=3e-6)
    assert largest_offset(model, direction=0.3) == pytest.approx(exact, abs=3e-6)
    with pytest.raises(NoConvergence, match="stronger than the shaft"):
        equilibrium(model, 1.01 * exact)


@pytest.mark.parametrize("tilt", [False, True])
def test_it_is_the_steady_state_without_unbalance(tilt):
    model = replace(UNIT, air_gap=replace(UNIT.air_gap, tilt=tilt)).model().with_unbalance(0.0)
    orbit, rest = HarmonicBalance(2).solve(model, rpm(150), 0.06), equilibrium(model, 0.06)
    assert np.abs(orbit.local[:, 0] - rest.local).max() < 1e-12
    assert np.abs(orbit.shaft[:, 0] - rest.displacement).max() < 1e-11
    assert rest.statically_stable and rest.eigenvalues(rpm(150))[0].real < 0


def test_centred_eigenvalues_of_a_point_mass():
    model = load_machine("jeffcott").model()
    m, c, k = model.M[0, 0], model.C[0, 0], model.K[0, 0] - model.law.stiffness
    exact = -c / (2 * m) + 1j * math.sqrt(k / m - (c / (2 * m)) ** 2)
    found = equilibrium(model, 0.0).eigenvalues(10.0)
    assert np.abs(found[:, None] - [exact, exact.conjugate()]).min(axis=1).max() < 1e-6 * abs(exact)


def slender(offset, field, tilt, height=2.0):
    """A rigid rotor a third down a slender shaft between stiff bearings, its rim `offset` below the
    hub.
    """
    shaft = Shaft(np.linspace(0, 9, 10), 0.3, 2e11, 7850.0, 0.3, 0.9)
    body = RigidBody("rotor", 3, 1e5, 3e5, 5e5, offset)
    bearings = (RadialBearing("upper", 0, 1e13), RadialBearing("lower", 9, 1e13))
    return Machine("slender", 10.0, shaft, (body,), bearings,
                   air_gap=AirGap("rotor", field, 3.0, height, 0.02, tilt))


@pytest.mark.parametrize(("offset", "tilt"),
                         [(0.0, False), (0.8, False), (-0.8, True), (0.8, True)])
def test_the_field_that_a_hub_off_the_middle_bears(offset, tilt):
    """det(D − k_m P) = 0 with the stiffness D of a simply supported beam at the hub (Euler and
    Bernoulli).

    P = [[1, ℓ], [ℓ, ℓ² + h²/12]] for a rim ℓ below its hub (Gustavsson and Aidanpää 2006), the last
    term with tilt only.
    """
    a, b, rigidity = 3.0, 6.0, 2e11 * math.pi * 0.3**4 / 64
    flexibility = np.array([[a * a * b * b, a * b * (b - a)],
                            [a * b * (b - a), a * a - a * b + b * b]]) / (3 * rigidity * (a + b))
    pull = np.array([[1, offset], [offset, offset**2 + (4 / 12 if tilt else 0)]])
    critical = 1 / np.linalg.eigvals(flexibility @ pull).real.max()
    field = math.sqrt(critical * MU_0 * 0.02 / (math.pi * 3.0 * 2.0))
    # The element's shear makes it softer by 12 EI/(κ G A L²)-like terms, here below 2 per mille.
    below, above = (equilibrium(slender(offset, share * field, tilt).model(), 0.0)
                    for share in (0.997, 1.001))
    assert below.statically_stable and not above.statically_stable
    # at rest: gyroscopic moments can hold what has no damping
    assert above.eigenvalues(0.0)[0].real > 1e-3


def test_tilt_pull_lowers_the_offset_that_is_borne():
    upright = largest_offset(UNIT.model())
    leaning = largest_offset(replace(UNIT, air_gap=replace(UNIT.air_gap, tilt=True)).model())
    assert leaning < upright - 1e-3
    higher = replace(vary(UNIT, {"bodies.generator.offset": -0.9}),
                     air_gap=replace(UNIT.air_gap, tilt=True))
    assert largest_offset(higher.model()) < leaning


def test_what_moves_does_not_rest():
    with pytest.raises(BadInput, match="does not rest"):
        equilibrium(replace(UNIT, cracks=(Crack("crack", 1, 0.2),)).model(), 0.02)
