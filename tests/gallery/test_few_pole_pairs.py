"""The published forces of few pole pairs: the series by SymPy, against print and the law."""

import math

import numpy as np
import pytest

from hydrolab.machine import PolePairPull

K, G0 = 1.6e8, 0.005


@pytest.mark.parametrize("p", [1, 2, 3, 4])
def test_sympy_derives_the_published_forces(script, p):
    """Exponent algebra against the f₁ … f₄ of the series, and both against the law."""
    import sympy as sp

    force, g, t, (l0, l1, l2, l3) = script.series_force(p)
    quarter = sp.pi / 4  # over R L F₁²/µ0
    f1 = quarter * (2 * l0 * l1 + l1 * l2 + l2 * l3)
    f3, f4 = quarter * (l0 * l3 + l1 * l2 / 2), quarter * l2 * l3 / 2
    beat = {1: f1 / 2 * t**2 / g + f3 * g**3 / t**2, 2: f3 * t**2 / g**3 + f4 * g**5 / t**2,
            3: f4 * t**2 / g**5}
    assert sp.simplify(force - (f1 * g + beat.get(p, 0))) == 0
    eps, gamma, theta = 0.4, 0.7, 1.9
    w = math.sqrt(1 - eps**2)
    permeance = [1 / w] + [2 / w * ((1 - w) / eps) ** n for n in (1, 2, 3)]
    number = complex(force.subs(dict(zip((l0, l1, l2, l3), permeance, strict=True)))
                     .subs({g: sp.exp(sp.I * gamma), t: sp.exp(sp.I * theta)}).evalf())
    law = PolePairPull(K, G0, p, 1.0, truncated=True)
    fx, fz = law.force(eps * G0 * np.array([math.sin(gamma), math.cos(gamma)]), None, theta)
    # k g0 = π R L F₁² µ0/2g0²
    assert complex(fz, fx) == pytest.approx(number * 2 * K * G0 / math.pi, rel=1e-10)
