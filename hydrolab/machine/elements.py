"""The shaft element, from shape functions to energies to matrices, derived with SymPy.

Axes and degrees of freedom: the shaft axis y points down, the transverse plane is (x, z), and each
node has (x, z, θx, θz) with θx = ∂z/∂y and θz = −∂x/∂y for a slender shaft. An element has two
nodes, so eight degrees of freedom, and obeys M q̈ + (C + Ω G) q̇ + K q = F with the spin Ω positive
from z to x.

Two elements share one set of shape functions with the shear parameter Φ = 12 E I / (κ G A L²):

- "lalanne-ferraris": Φ in the stiffness only; mass and gyroscopic matrices with Φ = 0
  (M. Lalanne and G. Ferraris, Rotordynamics Prediction in Engineering, 1990, chapter 2).
- "timoshenko": Φ everywhere; the rotary inertia is that of the section's own rotation
  (M. I. Friswell et al., Dynamics of Rotating Machines, 2010, section 5.4).

What runs is the function of `element_matrices`, which a script writes from this derivation; SymPy
is loaded where somebody looks at it, and each element is derived once per process.
"""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hydrolab.errors import BadInput
from hydrolab.machine.element_matrices import timoshenko

if TYPE_CHECKING:
    import sympy as sp

ELEMENTS = ("lalanne-ferraris", "timoshenko")


@cache
def symbols() -> SimpleNamespace:
    """The letters of the derivation: s = y/L, L, Phi, E, rho, A, I, Omega and the fields in the
    energies.

    `fields` are x, z, θx, θz; `rates` their time derivatives; `strains` the two curvatures θx', θz'
    and the two shear strains γz = z' − θx and γx = x' + θz.
    """
    import sympy as sp
    s, Omega = sp.symbols("s Omega", real=True)
    L, Phi, E, rho, A, I = sp.symbols("L Phi E rho A I", positive=True)
    fields = sp.Matrix(sp.symbols("x z theta_x theta_z", real=True))
    rates = sp.Matrix(sp.symbols(r"\dot{x} \dot{z} \dot{\theta}_x \dot{\theta}_z", real=True))
    strains = sp.Matrix(sp.symbols(r"\theta'_x \theta'_z gamma_z gamma_x", real=True))
    return SimpleNamespace(s=s, Omega=Omega, L=L, Phi=Phi, E=E, rho=rho, A=A, I=I,
                           fields=fields, rates=rates, strains=strains)


@cache
def shape_functions() -> tuple[sp.Matrix, sp.Matrix]:
    """Deflection w(s) and section rotation θ(s) of a beam in one plane, from its end values.

    Both are rows over (w₁, θ₁, w₂, θ₂), shape (1, 4). The deflection is the cubic that static end
    loads produce; equilibrium, E I θ'' + κ G A (w' − θ) = 0, then fixes θ = w' + (Φ L²/12) w'''.
    Φ = 0 gives the Hermite cubics. Source: J. S. Przemieniecki, Theory of Matrix Structural
    Analysis, 1968, chapter 5 and 11.
    """
    import sympy as sp
    s, L, Phi = symbols().s, symbols().L, symbols().Phi
    cubic = sp.Matrix([[1, s, s**2, s**3]])
    w = cubic
    theta = w.diff(s) / L + Phi * L**2 / 12 * w.diff(s, 3) / L**3
    at_ends = sp.Matrix.vstack(w.subs(s, 0), theta.subs(s, 0), w.subs(s, 1), theta.subs(s, 1))
    coefficients = at_ends.inv()
    return (w * coefficients).applyfunc(sp.factor), (theta * coefficients).applyfunc(sp.factor)


@cache
def interpolation() -> tuple[sp.Matrix, sp.Matrix]:
    """Fields and strains of the element as matrices over its eight degrees of freedom, each (4, 8).

    Rows of the first: x, z, θx, θz. Rows of the second: θx', θz', γz = z' − θx, γx = x' + θz.
    In the (y, z) plane the slope is θx; in the (y, x) plane it is −θz.
    """
    import sympy as sp
    s, L = symbols().s, symbols().L
    w, theta = shape_functions()
    fields = sp.zeros(4, 8)
    for end in (0, 1):
        x, z, tilt_x, tilt_z = range(4 * end, 4 * end + 4)
        fields[1, z], fields[1, tilt_x] = w[2 * end], w[2 * end + 1]
        fields[2, z], fields[2, tilt_x] = theta[2 * end], theta[2 * end + 1]
        fields[0, x], fields[0, tilt_z] = w[2 * end], -w[2 * end + 1]
        fields[3, x], fields[3, tilt_z] = -theta[2 * end], theta[2 * end + 1]
    slopes = fields.diff(s) / L
    strains = sp.Matrix.vstack(slopes[2, :], slopes[3, :], slopes[1, :] - fields[2, :],
                               slopes[0, :] + fields[3, :])
    return fields, strains.applyfunc(sp.factor)


@cache
def energies() -> tuple[sp.Expr, sp.Expr]:
    """Kinetic and strain energy of the spinning shaft per unit length, J/m, in the letters of
    `symbols`.

    T' = ½ρA(ẋ² + ż²) + ½ρI(θ̇x² + θ̇z²) + 2ρIΩ θ̇z θx,  U' = ½EI(θx'² + θz'²) + ½κGA(γz² + γx²)

    with κGA = 12 E I / (Φ L²); the constant ρIΩ² of the spin is left out. Source: M. Lalanne and
    G. Ferraris, Rotordynamics Prediction in Engineering, 1990, section 1.2 (the shaft).
    """
    c = symbols()
    _, _, tilt_x, _ = c.fields
    vx, vz, rate_x, rate_z = c.rates
    bend_x, bend_z, shear_z, shear_x = c.strains
    kinetic = (c.rho * c.A * (vx**2 + vz**2) / 2 + c.rho * c.I * (rate_x**2 + rate_z**2) / 2
               + 2 * c.rho * c.I * c.Omega * rate_z * tilt_x)
    shear_stiffness = 12 * c.E * c.I / (c.Phi * c.L**2)
    strain = c.E * c.I * (bend_x**2 + bend_z**2) / 2 + shear_stiffness * (shear_z**2
                                                                          + shear_x**2) / 2
    return kinetic, strain


@cache
def element_matrices_symbolic(element: str) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix,
                                                     sp.ImmutableMatrix]:
    """M, G and K of an element as SymPy matrices, each (8, 8), in L, Phi, E, rho, A, I.

    Lagrange's equations on the energies: M = ∂²T/∂q̇∂q̇, Ω G = ∂²T/∂q̇∂q − ∂²T/∂q∂q̇, K = ∂²U/∂q∂q.

    Raises BadInput if `element` is not "lalanne-ferraris" or "timoshenko".
    """
    import sympy as sp
    check_element(element)
    c = symbols()
    fields, strains = interpolation()
    if element == "lalanne-ferraris":
        fields = fields.subs(c.Phi, 0)
    kinetic, strain = energies()
    momentum = sp.Matrix([kinetic]).jacobian(c.rates)
    gyroscopic = momentum.jacobian(c.fields) / c.Omega
    M = _along_element(fields, sp.hessian(kinetic, c.rates))
    G = _along_element(fields, gyroscopic - gyroscopic.T)
    K = _along_element(strains, sp.hessian(strain, c.strains))
    return M, G, K


def _along_element(B: sp.Matrix, density: sp.Matrix) -> sp.ImmutableMatrix:
    """∫ Bᵀ D B dy over the element: (1 + Φ) B is a polynomial in s, which SymPy integrates fast."""
    import sympy as sp
    c = symbols()
    scaled = ((1 + c.Phi) * B).applyfunc(lambda entry: sp.expand(sp.cancel(entry)))
    integrand = c.L * scaled.T * density * scaled

    @cache  # both planes share most entries
    def integral(entry: sp.Expr) -> sp.Expr:
        return sp.factor(sp.Poly(entry, c.s).integrate().eval(1)
                         / (1 + c.Phi) ** 2) if entry else entry

    return sp.ImmutableMatrix(integrand.applyfunc(integral))


def check_element(element: str) -> None:
    """Raise BadInput if `element` is not one of `ELEMENTS`."""
    if element not in ELEMENTS:
        raise BadInput(f"element is {element!r}; it must be one of {', '.join(ELEMENTS)}.")


def shaft_element(element: str, length: float, young: float, density: float, area: float,
                  second_moment: float,
                  poisson: float, shear_coefficient: float) -> tuple[NDArray, NDArray, NDArray]:
    """M (kg, kg m, kg m²), G (same over s per rad/s) and K (N/m, N, N m) of one element, each (8,
    8).

    element: "lalanne-ferraris" or "timoshenko". length: m. young: Pa. density: kg/m³. area: m².
    second_moment: m⁴. poisson: ν, with G = E / (2(1 + ν)). shear_coefficient: κ of the section.

    Raises BadInput if `element` is not one of the two.
    """
    check_element(element)
    shear_modulus = young / (2 * (1 + poisson))
    phi = 12 * young * second_moment / (shear_coefficient * shear_modulus * area * length**2)
    M, G, K = timoshenko(length, phi, young, density, area, second_moment)
    if element == "lalanne-ferraris":
        M, G, _ = timoshenko(length, 0.0, young, density, area, second_moment)
    return M, G, K


POINTS = 12  # of the quadrature along a tapered element: a cone of 1 : 4 is exact to 1e-10


def tapered_element(element: str, length: float, young: float, density: float, diameter: NDArray,
                    bore: NDArray, poisson: float,
                    shear_coefficient: float) -> tuple[NDArray, NDArray, NDArray]:
    """M, G and K, each (8, 8), of an element whose diameter and bore, m, both (2,) at its ends,
    change along straight lines; length, young, density, poisson and shear_coefficient as
    `shaft_element` takes them.

    K is the inverse of the flexibility of the element held at its upper end, so it is exact within
    Timoshenko's theory for loads at the ends. The motion between them is that of such loads, which
    makes M and G consistent; a uniform element is that of `shaft_element`.

    Raises BadInput as `shaft_element` does.
    """
    check_element(element)
    s, weight = (part * length / 2 for part in np.polynomial.legendre.leggauss(POINTS))
    s, share = s + length / 2, (s + length / 2) / length
    outer, inner = (ends[0] + (ends[1] - ends[0]) * share for ends in (diameter, bore))
    area, second = np.pi / 4 * (outer**2 - inner**2), np.pi / 64 * (outer**4 - inner**4)
    bend = 1 / (young * second)
    shear = 2 * (1 + poisson) / (shear_coefficient * young * area)
    arm = length - s

    def flexibility(shear: NDArray) -> NDArray:
        return np.array([[weight @ (arm * arm * bend + shear), weight @ (arm * bend)],
                         [weight @ (arm * bend), weight @ bend]])

    # what is left of the lower end's (w, θ) after the rigid motion of the upper end
    strained = np.array([[-1, -length, 1, 0], [0, -1, 0, 1]])
    plane_K = strained.T @ np.linalg.solve(flexibility(shear), strained)
    moving = shear if element == "timoshenko" else 0 * shear
    push, moment = np.linalg.solve(flexibility(moving), strained)
    # from the upper end: θ = θ₁ + ∫ (F (L − s) + M)/EI, w = w₁ + ∫ (θ + F/κGA)
    up = integrals(length)
    lean = np.outer(up @ (arm * bend), push) + np.outer(up @ bend, moment) + [0, 1, 0, 0]
    away = up @ (lean + np.outer(moving, push)) + [1, 0, 0, 0]
    # the planes (z, θx) and (x, −θz)
    in_z, in_x = np.zeros((4, 8)), np.zeros((4, 8))
    in_z[range(4), [1, 2, 5, 6]] = 1
    in_x[range(4), [0, 3, 4, 7]] = [1, -1, 1, -1]
    mass = (away.T * (weight * density * area)) @ away
    inertia = (lean.T * (weight * density * second)) @ lean
    M, K = (sum(p.T @ part @ p for p in (in_z, in_x)) for part in (mass + inertia, plane_K))
    turn = -2 * in_x.T @ inertia @ in_z  # 2 ρ I θz θx, with θz = −(its part in the plane of x)
    return M, turn - turn.T, K


def integrals(length: float) -> NDArray:
    """The matrix that takes values at the quadrature's points along an element to their integrals
    from its upper end up to each point.
    """
    legendre = np.polynomial.legendre
    points, _ = legendre.leggauss(POINTS)
    values = np.linalg.inv(legendre.legvander(points, POINTS - 1))
    grown = legendre.legint(np.eye(POINTS), lbnd=-1, axis=0)
    return length / 2 * legendre.legval(points, grown @ values).T
