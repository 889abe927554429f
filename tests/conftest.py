"""Machines that several tests share. BLAS runs on one thread: for small matrices two are slower."""

from __future__ import annotations

import math
import signal

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from hydrolab import rpm
from hydrolab.machine.parts import (
    AirGap,
    Machine,
    RadialBearing,
    RayleighDamping,
    RigidBody,
    Shaft,
    ThrustBearing,
)

SPEED = rpm(150)

# in the background of a shell; programs started here would inherit it
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def one_blas_thread():
    with threadpool_limits(1):
        yield


def table_1(body, field=0.5):
    """The paper's air gap."""
    return AirGap(body, field, 2.9945, 0.97, 0.011)


def jeffcott(mass=1.5e5, stiffness=2.7e8, damping_ratio=0.01, radius=200e-6, field=0.5):
    """A point mass in the paper's gap; its unbalance makes the centred orbit a circle of `radius`,
    exactly.
    """
    gap = table_1("disc", field)
    damping = 2 * damping_ratio * math.sqrt(stiffness * mass)
    pull = gap.pull_stiffness * (1 - (radius / gap.gap) ** 2) ** -1.5
    unbalance = math.hypot((stiffness - pull - mass * SPEED**2) * radius,
                           damping * SPEED * radius) / SPEED**2
    return Machine("jeffcott", SPEED, None, (RigidBody("disc", 0, mass, 0.0, 0.0,
                                                       unbalance=unbalance),),
                   (RadialBearing("spring", 0, stiffness, damping),), air_gap=gap)


def kaplan(elements=12, guide=0.92, mass=6e4, field=0.5):
    """A trial unit of the paper's kind: its first leg ends at 10.35 %, 1X grows 3.7 times on it."""
    middle, turbine = 4.5, 8.3
    half = elements // 2 - 1
    nodes = np.concatenate([[0.0], np.linspace(guide, middle, half + 1),
                            np.linspace(middle, turbine, half + 1)[1:],
                            [9.04]])
    shaft = Shaft(nodes, 0.71, 2e11, 7850.0, 0.3, 0.9)
    generator = RigidBody("generator", 0, mass, 2.4 * mass, 3.96 * mass, -0.472, 95.477)
    runner = RigidBody("turbine", len(nodes) - 1, 4e4, 4e4, 6e4, 0.5, 31.826)
    return Machine("trial unit", SPEED, shaft, (generator, runner),
                   (RadialBearing("guide", 1, 1.37e9),
                    RadialBearing("turbine bearing", len(nodes) - 2, 1.64e9)),
                   (ThrustBearing("thrust", half + 1, 5e7),), RayleighDamping((0.01, 0.01)),
                   table_1("generator", field))


@pytest.fixture(scope="session")
def speed():
    return SPEED


@pytest.fixture(scope="session")
def make_jeffcott():
    return jeffcott


@pytest.fixture(scope="session")
def make_kaplan():
    return kaplan


@pytest.fixture(scope="session")
def peer():
    """The 2-DOF benchmark that peers of hydrolab were measured on (fold at 0.078325643)."""
    return jeffcott().model()


@pytest.fixture(scope="session")
def unit():
    """The 12-element trial unit, 52 DOFs."""
    return kaplan().model()


def random_machine(random):
    """Any machine within wide engineering limits, from a numpy Generator: shaft, bodies, bearings,
    gap, unbalance.
    """
    elements = int(random.integers(2, 7))
    length = random.uniform(1, 10)
    nodes = np.concatenate([[0.0], np.cumsum(random.uniform(0.3, 1, elements))])
    nodes *= length / nodes[-1]
    shaft = Shaft(nodes, random.uniform(0.04, 0.12) * length, 2e11, 7850.0, 0.3, 0.9,
                  element=str(random.choice(["lalanne-ferraris", "timoshenko"])))
    shaft_mass = 7850 * float(shaft.area[0]) * length
    bodies = []
    for name in ("rotor", "runner")[:int(random.integers(1, 3))]:
        mass = shaft_mass * random.uniform(0.2, 4)
        Id = mass * length**2 * random.uniform(0.002, 0.05)
        bodies.append(RigidBody(name, int(random.integers(0, elements + 1)), mass, Id,
                                Id * random.uniform(0.1, 2),
                                random.uniform(-0.1, 0.1) * length,
                                mass * 10 ** random.uniform(-5, -2.5),
                                random.uniform(0, 6)))
    stiffness = 3 * 2e11 * float(shaft.second_moment[0]) / length**3
    bearings = []
    for name, node in zip("pqr", random.choice(elements + 1, int(random.integers(2, 4)),
                                               replace=False), strict=False):
        k = stiffness * 10 ** random.uniform(0, 2) * random.uniform(0.7, 1.4, 2)
        bearings.append(RadialBearing(name, int(node), k, 0.002 * k * random.uniform(0, 1)))
    gap = random.uniform(0.002, 0.02)
    radius = random.uniform(0.2, 0.5) * length
    # from hardly felt to more than the shaft can hold
    pull = stiffness * 10 ** random.uniform(-2, 0.5)
    field = math.sqrt(pull * 4e-7 * gap / (radius * length * 0.2))
    return Machine("random", float(random.uniform(5, 150)), shaft, tuple(bodies), tuple(bearings),
                   (),
                   RayleighDamping((0.01, 0.01)), AirGap("rotor", field, radius, 0.2 * length, gap))


@pytest.fixture(scope="session")
def make_random():
    return random_machine
