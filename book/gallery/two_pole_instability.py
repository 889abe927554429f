r"""Two poles and a flexible rotor (Yang et al. 2004): the pull's stiffness turns with 2f, and a
band of speeds is unstable.

Linearised about the centre the pull of one pole pair is F_z + i F_x = k_m (ζ + ½ e^{2iωt} ζ̄), ω the
electrical frequency. In the frame that turns with ω it is constant, different along and across the
field: the algebra of a shaft that is stiffer across one axis. There a point mass has an exact band
of instability, between the frequencies at which one of the two axes has no stiffness left.
Floquet's multipliers know nothing of that frame. Phases out of balance add a wave that turns
backward.

Assumed throughout: the shaft lets the net flux pass that a wave of one pole pair leaves over in an
uneven gap. That is one end of what can be. At the other the path through shaft, bearings and frame
is blocked: then the pull is half as stiff, does not turn, and there is no band at all. Real
machines lie between; `Poles(1, flux_share=0.3)` is a machine whose way back passes 0.3 of it.
"""

import math
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq

from hydrolab import BadInput, HarmonicBalance, load_machine
from hydrolab.dynamics import floquet_all
from hydrolab.figures import COLOURS, Picture, house_style, new_figure
from hydrolab.machine import AirGap, Machine, Model, Poles, RadialBearing, RigidBody

RPM = 30 / math.pi
AIR = AirGap("rotor", 0.5, 0.25, 1.0, 0.005)
MASS, STIFFNESS, PULL = 1800.0, 1.3e8, AIR.pull_stiffness
DAMPING = 0.02 * math.sqrt(STIFFNESS * MASS)


def two_pole_band(damping: float, pull: float = PULL) -> tuple[float, float] | None:
    """Electrical frequencies between which the point mass is unstable, rad/s; None: nowhere.

    (k − k_m − m ω²)² + (c ω)² = (k_m/2)²; without damping √((k − 3k_m/2)/m) and √((k − k_m/2)/m).
    Raises BadInput for a pull (k_m, N/m) above two thirds of k, with which it is pulled in at rest.
    """
    if pull > 2 / 3 * STIFFNESS:
        raise BadInput(f"pull is {pull:.4g} N/m; above two thirds of the stiffness, "
                       f"{2 / 3 * STIFFNESS:.4g} N/m, the band reaches down to standstill.")
    # a quadratic in ω²: m² ω⁴ − (2 m (k − k_m) − c²) ω² + (k − k_m)² − (k_m/2)² = 0
    rest = STIFFNESS - pull
    half = (2 * MASS * rest - damping**2) / (2 * MASS**2)
    root = half**2 - (rest**2 - pull**2 / 4) / MASS**2
    if root < 0 or half < 0:
        return None
    return math.sqrt(max(0.0, half - math.sqrt(root))), math.sqrt(half + math.sqrt(root))


def two_pole_growth(damping: float, frequency: float, pull: float = PULL) -> float:
    """Largest real part of the eigenvalues in the frame that turns with ω, 1/s, exact.

    m (r̈ + 2iω ṙ − ω² r) + c (ṙ + iω r) + (k − k_m) r − (k_m/2) r̄ = 0 for z + ix = r e^{iωt}.
    """
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])  # i on (Re r, Im r)
    stiff = ((STIFFNESS - pull - MASS * frequency**2) * np.eye(2) + damping * frequency * turn
             - pull / 2 * np.diag([1.0, -1.0]))
    velocity = damping * np.eye(2) + 2 * MASS * frequency * turn
    matrix = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiff / MASS, -velocity / MASS]])
    return float(np.linalg.eigvals(matrix).real.max())


def point_mass(poles: Poles, damping: float = DAMPING) -> Model:
    """A balanced point mass on a spring in this field."""
    return Machine("two poles", 200.0, None, (RigidBody("rotor", 0, MASS, 0.0, 0.0),),
                   (RadialBearing("spring", 0, STIFFNESS, damping),), air_gap=AIR,
                   poles=poles).model()


def growth(model: Model, speed: float, *, revolutions: int = 1) -> float:
    """Floquet's growth of a disturbance of the centred rotor at a speed (rad/s), 1/s.

    revolutions: after which the forces repeat.
    """
    balance = HarmonicBalance(2 * revolutions, revolutions=revolutions)
    found = floquet_all([balance.solve(model.with_unbalance(0), speed)], quick=True)[0]
    return math.log(abs(found.multipliers[0])) * speed / (2 * math.pi * revolutions)


@house_style()
def picture(speeds: np.ndarray, fields: np.ndarray, chart: np.ndarray) -> Picture:
    """Growth over speed (rad/s) and field (times 0.5 T), (f, s), with the exact edges."""
    figure = new_figure(10, 6)
    axes, size = figure.subplots(), np.abs(chart).max()
    filled = axes.pcolormesh(speeds * RPM, fields, chart, cmap="RdBu_r", vmin=-size, vmax=size,
                             shading="nearest")
    figure.colorbar(filled, ax=axes, label="growth of a disturbance, 1/s")
    edges = [(f, *b) for f in np.linspace(fields[0], fields[-1], 60)
             if (b := two_pole_band(DAMPING, PULL * f**2))]
    field, low, high = map(np.array, zip(*edges, strict=True))
    axes.plot(low * RPM, field, "--", high * RPM, field, "--", color=COLOURS["fold"])
    axes.set(xlabel="speed, rpm (dashed: exact edges)", ylabel="flux density over 0.5 T")
    unstable = speeds[chart[-1] > 0] * RPM
    return Picture(figure, f"At the full field the centred rotor is unstable from "
                   f"{unstable[0]:.4g} to {unstable[-1]:.4g} rpm, where a disturbance grows by up "
                   f"to {chart[-1].max():.3g} a second in the exponent; "
                   f"{100 * np.mean(chart > 0):.3g} % of the chart is unstable.")


def main() -> None:
    """Print the band by both ways, of the whole machine, with weaker fields and a backward wave."""
    exact, alone = two_pole_band(DAMPING), point_mass(Poles(1))
    found = [brentq(lambda speed: growth(alone, speed), 0.98 * edge, 1.02 * edge, xtol=1e-7)
             for edge in exact]
    print(f"Finding: the centred rotor is unstable from {exact[0] * RPM:.3f} to "
          f"{exact[1] * RPM:.3f} rpm by the frame that turns with the field, and from "
          f"{found[0] * RPM:.3f} to {found[1] * RPM:.3f} rpm by Floquet.\n")
    unit = load_machine("two-pole")
    whole = replace(unit, poles=Poles(1)).model()
    band = [speed for speed in range(1900, 2601, 50) if growth(whole, speed / RPM) > 0]
    print(f"The two-pole machine with its shaft, in steps of 50 rpm: unstable from {band[0]} to "
          f"{band[-1]} rpm; its rated {unit.speed * RPM:.0f} rpm lie above.\n")
    print("flux density   pull over spring   unstable band, rpm (point mass, exact)")
    for field in (0.3, 0.5, 0.7, 0.9, 1.0):
        edges = two_pole_band(DAMPING, PULL * field**2)
        words = " to ".join(f"{edge * RPM:.1f}" for edge in edges) if edges else "none"
        print(f"{field:8.1f}  {PULL * field**2 / STIFFNESS:17.3f}      {words}")
    print("\nbackward wave, % of the forward one   growth at 226 rad/s, 1/s   at 262 rad/s, 1/s")
    for backward in (0.0, 0.1, 0.2, 0.4):
        out_of_balance = point_mass(Poles(1, backward=backward))
        print(f"{100 * backward:20.0f} {growth(out_of_balance, 226.0):32.2f} "
              f"{growth(out_of_balance, 262.0):20.2f}")
    speeds, fields = np.linspace(1900, 2700, 33) / RPM, np.linspace(0.2, 1.0, 9)
    chart = np.array([[growth(alone.with_field(f), speed) for speed in speeds] for f in fields])
    drawn = picture(speeds, fields, chart)
    drawn.save("two_pole_instability.png")
    print(f"\n{drawn.reading}\n\nNot reproduced: the paper's machine, its chart and its response "
          "to unbalance, because the text could not be read; the model here is the linear pull of "
          "one pole pair, of which only the band's exact edges are certain.")


if __name__ == "__main__":
    main()
