"""Energies of the force laws that have one: V, J, with force = −∂V/∂u at a fixed phase, nan outside
the gap. What a solver never asks for, and a force cannot agree with by accident.
"""

import numpy as np

from hydrolab.machine.bearings import Pads
from hydrolab.machine.pole_pairs import PolePairPull
from hydrolab.machine.pull import CircularPull, LinearPull, ShapedPull, TiltedPull


def potential(law, u, phase=0.0):
    """V of a law at u, (c, …): the shape of u without its first axis."""
    of = {CircularPull: circular, LinearPull: linear, ShapedPull: shaped, PolePairPull: poles,
          TiltedPull: tilted, Pads: pads}
    return of[type(law)](law, u, phase)


def circular(law, u, phase):
    """−k g0² (1 − ε²)^{−1/2}."""
    room = 1 - (u * u).sum(axis=0) / law.gap**2
    return -law.stiffness * law.gap**2 / np.sqrt(np.where(room > 0, room, np.nan))


def linear(law, u, phase):
    """−k |u|²/2."""
    return -law.stiffness / 2 * (u * u).sum(axis=0)


def shaped(law, u, phase):
    """−(k g0³/2π) ∮ 2 f²/g dφ."""
    gap = law.local_gap(u, phase)
    share = 2 * law.field(law.angles, phase) ** 2 if law.waves else 1.0
    return -law.stiffness * law.gap**3 * (share / gap).mean(axis=-1)


def poles(law, u, phase):
    """−k g0² (|c|²/w + Re(c̄² ζ²ᵖ)/(w (1 + w)²ᵖ)), of the whole force."""
    zeta, c, n = (u[1] + 1j * u[0]) / law.gap, law.wave(phase), 2 * law.pole_pairs
    w = np.sqrt(1 - np.abs(zeta) ** 2)
    beat = (c.conj() ** 2 * zeta**n).real / (w * (1 + w) ** n)
    return -law.stiffness * law.gap**2 * (np.abs(c) ** 2 / w + beat)


def tilted(law, u, phase):
    """The mean over the height of what the upright rotor has."""
    s, weight = np.polynomial.legendre.leggauss(40)
    heights = u[:2, ..., None] + u[2:, ..., None] * (law.height / 2 * s)
    return potential(law.upright, heights, phase) @ weight / 2


def pads(law, u, phase):
    """The work of each pad's rounded spring, less that of the linear bearing it takes back."""
    angle = law.angle + 2 * np.pi * np.arange(law.count) / law.count
    beyond = np.stack([np.sin(angle), np.cos(angle)]).T @ u.reshape(2, -1) - law.clearance
    b = law.rounding
    work = (beyond**2 + beyond * np.hypot(beyond, b) + b**2 * np.arcsinh(beyond / b)) / 4
    return (law.stiffness * work.sum(axis=0).reshape(u.shape[1:])
            - law.reference / 2 * (u * u).sum(axis=0))
