"""Random machines of every kind, and the multipliers of an orbit on all degrees of freedom.

Nothing here is shared with what it checks but the model's matrices and its laws.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy.linalg

from hydrolab.machine.bearings import JournalFilm, PadBearing, RadialBearing
from hydrolab.machine.parts import AirGap, Machine, RigidBody, Shaft


def shaft_of(random) -> tuple[Shaft, float]:
    """A shaft of 3 to 12 elements, and its bending stiffness between supports, N/m."""
    count, length = int(random.integers(3, 13)), random.uniform(1, 10)
    nodes = np.concatenate([[0.0], np.cumsum(random.uniform(0.5, 1, count))])
    shaft = Shaft(nodes * length / nodes[-1], random.uniform(0.04, 0.1) * length, 2e11, 7850.0, 0.3,
                  0.9, element=str(random.choice(["lalanne-ferraris", "timoshenko"])))
    return shaft, 48 * 2e11 * float(shaft.second_moment[0]) / length**3


def any_machine(random) -> Machine:
    """One or two discs on two or three bearings, with seals, dampers, a film or pads, in a gap."""
    shaft, bend = shaft_of(random)
    length, last = float(shaft.nodes[-1]), len(shaft.nodes) - 1
    weight = 7850 * float(shaft.area[0]) * length
    bodies = []
    for name in ("rotor", "runner")[:int(random.integers(1, 3))]:
        mass = weight * random.uniform(0.3, 4)
        Id = mass * length**2 * random.uniform(0.002, 0.05)
        bodies.append(RigidBody(name, int(random.integers(0, last + 1)), mass, Id,
                                Id * random.uniform(0.1, 2), random.uniform(-0.1, 0.1) * length,
                                mass * 10 ** random.uniform(-5, -2.5), random.uniform(0, 6)))
    slow = math.sqrt(bend / sum(b.mass for b in bodies))
    speed = slow * 10 ** random.uniform(-0.8, 0.4)
    places = random.choice(last + 1, int(random.integers(2, 4)), replace=False)
    bearings = []
    for i, node in enumerate(places):
        k = bend * 10 ** random.uniform(0, 2) * random.uniform(0.7, 1.4, 2)
        bearings.append(RadialBearing(f"bearing {i}", int(node), k,
                                      k / slow * 10 ** random.uniform(-5, 0)))
    for i in range(int(random.integers(0, 3))):
        cross = bend * 10 ** random.uniform(-3, 0) * random.choice([-1, 1])
        direct = abs(cross) * random.uniform(0.1, 2)
        bearings.append(RadialBearing(f"seal {i}", int(random.integers(0, last + 1)),
                                      [[direct, cross], [-cross, direct]],
                                      abs(cross) / slow * random.uniform(0, 2)))
    for i in range(int(random.integers(0, 3))):
        bearings.append(RadialBearing(f"damper {i}", int(random.integers(0, last + 1)),
                                      1e-3 * bend, bend / slow * 10 ** random.uniform(-4, 1.5)))
    gap, radius = random.uniform(0.002, 0.02), random.uniform(0.2, 0.5) * length
    pull = bend * 10 ** random.uniform(-2, 0)
    field = math.sqrt(pull * 4e-7 * gap / (radius * length * 0.2))
    more = {}
    kind = random.integers(0, 6)
    if kind == 0:
        more["pad_bearings"] = (PadBearing("pads", int(places[0]), 8, bend * 10, 0.01 * gap,
                                           rounding=0.005 * gap),)
        bearings = bearings[1:]
    elif kind == 1:
        journal = float(shaft.diameter[0])
        more["films"] = (JournalFilm("film", int(places[0]), 0.03, journal, 1.2 * journal,
                                       2e-3 * journal),)
    return Machine("any", speed, shaft, tuple(bodies), tuple(bearings), (), None,
                   AirGap("rotor", field, radius, 0.2 * length, gap,
                          tangential=float(random.choice([0.0, 0.0, 0.02]))), **more)


def any_model(random):
    """The model of such a machine, with material damping from 1e-5 to 5 % or none, with and without
    the pull; its speed, rad/s, and an eccentricity.
    """
    machine = any_machine(random)
    model = machine.model()
    if random.random() < 0.7:
        ratio, slow = 10 ** random.uniform(-5, -1.3), machine.speed
        stiffness = (model.K + model.K.T) / 2
        model = replace(model, C=model.C + ratio * slow * model.M + ratio / slow * stiffness)
    if random.random() < 0.25:
        model = model.with_field(0.0)
    eccentricity = 0.0
    if random.random() < 0.3:
        model = model.with_unbalance(0.0)
    if random.random() < 0.8:
        eccentricity = random.uniform(0, 0.3)
    return model, machine.speed, eccentricity


def first_order(model, speed, slope=None, damping=None):
    """ẋ = A x for x = (q, q̇), all degrees of freedom, with a slope and damping on S q added."""
    n, inverse = model.size, np.linalg.inv(model.M)
    K, D = model.K, model.C + speed * model.G
    if slope is not None:
        K = K - model.selection.T @ slope @ model.selection
    if damping is not None:
        D = D - model.selection.T @ damping @ model.selection
    return np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, -inverse @ D]])


def derivatives(orbit, phase):
    """∂F/∂u and ∂F/∂u̇ along an orbit, (c, c, N); the second may be None."""
    k = np.arange(1, orbit.harmonics + 1)[:, None]
    turn = k * phase / orbit.revolutions
    sine, cosine = np.sin(turn), np.cos(turn)
    rate = k * orbit.speed / orbit.revolutions
    local = orbit.local
    u = local[:, :1] + local[:, 1::2] @ sine + local[:, 2::2] @ cosine
    v = local[:, 1::2] @ (rate * cosine) - local[:, 2::2] @ (rate * sine)
    u[:2] -= orbit.centre[:, None]
    return orbit.model.law.linearise(u, v, phase, orbit.speed)[1:]


def all_multipliers(orbit, steps=64, most=1024):
    """Floquet multipliers of all degrees of freedom, largest first, and how far the modulus of the
    first is known.

    Each step is the exponential of the matrix in its middle where forces act on velocities, else
    the exponential of the mean matrix with a kick by the rest; extrapolated from steps, twice and
    four times as many, and again with more of them where that is not known to 1e-7.
    """
    model, speed = orbit.model, orbit.speed
    turn = 2 * np.pi * np.arange(256) / 256 * orbit.revolutions
    slope, damping = derivatives(orbit, turn)
    if np.ptp(slope, axis=-1).max() == 0 and damping is None:
        exact = np.linalg.eigvals(first_order(model, speed, slope[..., 0]))
        mu = np.exp(exact * 2 * np.pi * orbit.revolutions / speed)
        return mu[np.argsort(-np.abs(mu))], 1e-12
    mean = slope.mean(axis=-1)
    rest = first_order(model, speed, mean)
    inverse = np.linalg.solve(model.M, model.selection.T)
    push = np.vstack([np.zeros_like(inverse), inverse])
    watch = np.hstack([model.selection, np.zeros_like(model.selection)])

    def product(total):
        h = 2 * np.pi * orbit.revolutions / speed / total
        middle = 2 * np.pi * orbit.revolutions * (np.arange(total) + 0.5) / total
        J, B = derivatives(orbit, middle)
        half = scipy.linalg.expm(rest * h / 2)
        moved = np.eye(len(rest))
        for i in range(total):
            if B is None:
                moved = half @ moved
                moved = half @ (moved + push @ (h * (J[..., i] - mean) @ watch @ moved))
            else:
                moved = scipy.linalg.expm(h * first_order(model, speed, J[..., i],
                                                          B[..., i])) @ moved
        return moved

    while True:
        coarse, middle, fine = (product(k * steps * orbit.revolutions) for k in (1, 2, 4))
        rough, good = (4 * middle - coarse) / 3, (4 * fine - middle) / 3
        best, other = (np.linalg.eigvals(a) for a in (good + (good - rough) / 15, good))
        known = float(abs(np.abs(best).max() - np.abs(other).max()))
        if known < 1e-7 * np.abs(best).max() or steps >= most:
            return best[np.argsort(-np.abs(best))], known
        steps *= 4
