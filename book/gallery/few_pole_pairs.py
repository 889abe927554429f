"""A generator with few pole pairs (Guo, Chu and Chen 2002): the pull beats with twice the
electrical frequency.

The field is a wave of p pole pairs, and the pull is the integral of its stress over the gap of an
off-centre rotor. For p = 1 a part of the pull as large as half the mean turns with 2f; for p = 24
nothing is left of it. The published forces expand the permeance to its third order; the whole force
has a closed form, checked here by quadrature. The rotor is a point mass on springs, integrated by
Newmark's method as in the paper, with f = 1.25 times the rotation so that the lines of the field
lie between those of the rotation. For p = 1 the shaft is taken to let the net flux pass that the
wave leaves over in an uneven gap; with that path blocked the pull is half as stiff and does not
beat. For p ≥ 2 the net flux is too small to matter.
"""

import math

import numpy as np

from hydrolab import HarmonicBalance, Newmark, integrate
from hydrolab.machine import (
    AirGap,
    CircularPull,
    Machine,
    Poles,
    RadialBearing,
    RigidBody,
    Wave,
    shaped_law,
    truncated_size,
    whole_size,
)

# rad/s, steps of Newmark in a revolution, f over the rotation
SPEED, STEPS, RATIO = 150.0, 256, 1.25
LINES = (2, 4, 6, 3, 5, 7)  # 1X, 2X, 3X, 2f − X, 2f, 2f + X as multiples of half the rotation
air = AirGap("rotor", 0.5, 0.25, 1.0, 0.005)
mass, stiffness = 1800.0, 1.3e8
spring = RadialBearing("spring", 0, stiffness, 0.1 * math.sqrt(stiffness * mass))
rotor = RigidBody("rotor", 0, mass, 0.0, 0.0, unbalance=0.6)


def model(p: int):
    """The point mass in a field of p pole pairs."""
    poles = Poles(p, electrical_ratio=RATIO)
    return Machine("few poles", SPEED, None, (rotor,), (spring,), air_gap=air, poles=poles).model()


def lines(path) -> np.ndarray:
    """Amplitudes of z + ix at multiples of half the rotation, µm."""
    return 1e6 * np.abs(np.fft.fft(path[1] + 1j * path[0])) / path.shape[1]


def power(p: int) -> float:
    """The power of the eccentricity with which the beat grows, by a fit from 2 to 8 % of the gap to
    the quadrature.
    """
    eps, phases = np.geomspace(0.02, 0.08, 12), 2 * np.pi * np.arange(16) / 16
    e = eps[:, None] * air.gap * np.array([0.6, 0.8])[:, None, None] * np.ones(16)
    wave = shaped_law(air.pull_stiffness, air.gap, waves=(Wave(p),)).force(e, 0 * e, phases, SPEED)
    beat = np.hypot(*(wave - CircularPull(air.pull_stiffness, air.gap).force(e))).max(axis=-1)
    return float(np.polyfit(np.log(eps), np.log(beat), 1)[0])


def series_force(pole_pairs: int, orders: int = 3):
    r"""The truncated force by SymPy: F_z + i F_x over R L F₁²/µ0 as a sum of a^j g^m t^q with
    a-order zero.

    The permeance is Σ Λ_n cos n(φ − γ), n ≤ orders, the magnetomotive force F₁ cos(pφ − θ), the
    stress their squared product over 2µ0. With g = e^{iγ} and t = e^{iθ} the integral over φ keeps
    what does not turn with φ. Returns (force, g, t, Λ): a SymPy expression, its two symbols, and
    the list of Λ_n.
    """
    import sympy as sp

    a, g, t = sp.symbols("a g t")
    permeance = sp.symbols(f"Lambda0:{orders + 1}")
    cosine = [(a**n / g**n + g**n / a**n) / 2 for n in range(orders + 1)]
    field = (a**pole_pairs / t + t / a**pole_pairs) / 2 * sum(
        size * wave for size, wave in zip(permeance, cosine, strict=True))
    high = 2 * (pole_pairs + orders)  # makes a polynomial of what has negative powers of a
    stress = sp.Poly(sp.expand(sp.expand(field**2) * a ** (high + 1) / 2), a)
    return sp.expand(2 * sp.pi * stress.coeff_monomial(a**high)), g, t, list(permeance)


def main() -> None:
    """Print the lines of the spectrum and the published forces beside the whole ones."""
    motion = integrate(model(1), Newmark(STEPS), speed=SPEED, static_eccentricity=0.1,
                       revolutions=26)
    one = lines(motion.positions[:, -2 * STEPS:])
    powers = [power(p) for p in (1, 2, 3, 4)]
    print(f"Finding: with one pole pair the spectrum has lines at 2f and 2f ± X, {one[5]:.3g}, "
          f"{one[3]:.3g} and {one[7]:.2g} µm "
          f"beside {one[2]:.3g} µm of 1X, and the beat grows with the power {powers[0]:.2f}, "
          f"{powers[1]:.2f}, {powers[2]:.2f}, "
          f"{powers[3]:.2f} of the eccentricity for p = 1, 2, 3, 4; theory says 2p − 1.")
    print()
    print("p     1X       2X       3X     2f − X      2f     2f + X   "
          "(µm, static eccentricity 10 %, f = 1.25 X)")
    for p in (1, 2, 3, 4):
        orbit = HarmonicBalance(20, revolutions=2).solve(model(p), SPEED, 0.1)
        found = lines(orbit.positions(4 * np.pi * np.arange(512) / 512))
        print(f"{p}" + "".join(f"{found[k]:9.3g}" for k in LINES) + "   harmonic balance on two "
              "revolutions")
        if p == 1:
            print("1" + "".join(f"{one[k]:9.3g}" for k in LINES)
                  + f"   Newmark, {STEPS} steps in a revolution")
    print()
    print("The published forces for p = 1, derived by SymPy, over R L F₁²/µ₀, with g = e^{iγ} and "
          "t = e^{iθ}:")
    print("  ", series_force(1)[0])
    print("Share of the whole force that the series to third order keeps:")
    print("   ε        mean     e^{3iγ}  e^{5iγ}")
    for eps in (0.1, 0.3, 0.5, 0.7):
        w = np.array(math.sqrt(1 - eps**2))
        print(f"   {eps}  " + "".join(f"{truncated_size(w, n)[0] / whole_size(w, n)[0]:9.4f}"
                                      for n in (1, 3, 5)))
    print()
    print("Not reproduced: the paper's parameters and figures, because its text could not be read; "
          "the machine here has a size that was chosen, and the published forces are derived again "
          "from the same series.")


if __name__ == "__main__":
    main()
