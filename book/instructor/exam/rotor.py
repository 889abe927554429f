"""Problems on chapters 0 to 3: signs, the rotor on springs, the magnetic pull, steps in time."""

import cmath
import math
from random import Random

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from hydrolab import CircularPull, LinearPull, ShapedPull, ellipse, rpm
from hydrolab.course.exam import Problem, number, reasons, word

MU0 = 4e-7 * math.pi
ONE = CircularPull(1.0, 1.0)  # lengths as shares of the gap, forces in units of k_UMP g0
SENSES = ("forward", "backward")


def pull(eps: float) -> float:
    """The pull at ε, in units of k_UMP g0."""
    return float(ONE.force(np.array([eps, 0.0]))[0])


def slope(eps: float) -> float:
    """Its growth with ε along the displacement, in units of k_UMP."""
    return float(ONE.linearise(np.array([eps, 0.0]))[1][0, 0])


def held(kappa: float) -> tuple[float, float]:
    """The ε and the stator's offset at which springs of κ = k/k_UMP give way, shares of the gap."""
    eps = brentq(lambda e: slope(e) - kappa, 1e-9, 0.97)
    return eps, eps - pull(eps) / kappa


def pull_stiffness(field: float, radius: float, length: float, gap: float) -> float:
    """(2.5), N/m."""
    return math.pi * field**2 * radius * length / (MU0 * gap)


def signs_and_axes(draw: Random) -> Problem:
    """Where the rotor is in the stator."""
    offset, mean, gap = draw.randint(4, 9) / 10, -draw.randint(10, 17) / 10, draw.choice((11, 13))
    inside = mean - offset
    return Problem("Where is the rotor?", (0, 2), 12, f"In a gap of {gap} mm the stator stands "
        f"{offset} mm off the bearing axis, towards +x. The mean of the rotor's orbit is at "
        f"x = {mean} mm, z = 0; the orbit itself is small.", (
        number("How far is the rotor off the stator's centre, in x, with its sign?", inside, "mm",
               (2, "what counts is x − x_E: the stator's offset is subtracted"),
               mistakes={mean: "This is measured from the bearing axis.",
                         mean + offset: "The stator's offset is subtracted, not added."}),
        word("Towards which side does the field pull the rotor?", "-x", ("+x", "-x"),
             (1, "towards the small gap, which is where the rotor stands in the stator")),
        number("How wide is the gap at its narrowest?", gap - abs(inside), "mm",
               (1, "the gap less the distance from the stator's centre")),
        reasons("The operator reads “eccentricity” on a sheet. Which three different lengths of "
                "this machine might be meant, and which of them turns with the rotor?",
                (1, "stator's offset, displacement in the stator, offset of the mass centre"),
                (1, "only the mass centre's offset turns"))))


def heavy_spot(draw: Random) -> Problem:
    """An unbalance as an offset and as a force."""
    mass, grade, speed = draw.choice((90, 119, 180)), draw.choice((2.5, 6.3)), draw.choice(
        (100, 150, 214))
    unbalance = mass * 1e3 * grade * 1e-3 / rpm(speed)
    return Problem("A balancing grade", (0, 1), 15, f"A rotor of {mass} t is balanced to grade "
        f"G {grade}: its mass centre runs around the axis at no more than {grade} mm/s at the "
        f"rated {speed} rpm.", (
        number("How far may the mass centre lie off the axis?", 1e3 * grade / rpm(speed), "µm",
               (2, "velocity over angular speed; rpm become rad/s")),
        number("Which mass on a radius of 2.5 m is as much unbalance?", unbalance / 2.5, "kg",
               (2, "U = m e, and a mass on a radius gives the same product")),
        number("Which force does it make at rated speed?", unbalance * rpm(speed)**2 / 1e3, "kN",
               (1, "U Ω²")),
        reasons("Does the rotor's centre move by the offset found first? Say when it does.",
                (1, "no: the orbit depends on stiffness and speed; far above resonance it does"))))


def side_and_size(draw: Random) -> Problem:
    """Unbalance response below and above the resonance; softer springs in z."""
    m, k = draw.choice((80e3, 90e3, 100e3)), draw.choice((1.8e8, 2.0e8, 2.4e8))
    U, zeta, soft = draw.choice((30.0, 40.0)), 0.02, draw.choice((0.75, 0.8))
    low, high = 150, draw.choice((650, 700))
    c = 2 * zeta * math.sqrt(k * m)

    def response(n: float, share: float = 1.0) -> complex:
        return U * rpm(n)**2 / (share * k - m * rpm(n)**2 + 1j * c * rpm(n))

    def forward(n: float) -> float:
        """Forward circle's radius over the backward one's, less one."""
        x, z = response(n), response(n, soft)
        return abs(z + x) - abs(z - x)

    middle = math.sqrt((1 + soft) / 2 * k / m) / rpm(1)
    ends = [brentq(forward, *span) for span in ((0.6 * middle, middle), (middle, 1.5 * middle))]
    return Problem("Which side, how far, who pays", (1,), 35, f"A disc of {m / 1e3:.0f} t on "
        f"springs of {k / 1e8:.1f}·10⁸ N/m with 2 % damping has an unbalance of {U:.0f} kg m. No "
        "field.", (
        number("Natural frequency.", math.sqrt(k / m) / rpm(1), "rpm", (1, "√(k/m) in rpm")),
        number(f"Radius of the orbit at {low} rpm.", 1e6 * abs(response(low)), "µm",
               (1, "(1.5), a radius and no diameter")),
        number(f"By which angle does the centre lag behind the heavy spot at {high} rpm?",
               -math.degrees(cmath.phase(response(high))), "°",
               (1, "it lies nearly opposite: sketch of both")),
        number(f"Power that the shaft supplies at {high} rpm.",
               c * (rpm(high) * abs(response(high)))**2, "W", (1, "c Ω² r²: the damper takes it")),
        number(f"The springs in z are now {100 * (1 - soft):.0f} % softer, the damper stays. From "
               "which speed on does the rotor whirl backward?", ends[0], "rpm",
               (2, "z has turned round and x has not; with damping the sense turns where forward "
                "and backward circle are equal"), rtol=0.003, mistakes={
                   math.sqrt(soft * k / m) / rpm(1): "Without damping it would begin here."}),
        number("Up to which speed?", ends[1], "rpm", (1, "the other such speed"), rtol=0.003,
               mistakes={math.sqrt(k / m) / rpm(1): "Without damping it would end here."})))


def two_probes(draw: Random) -> Problem:
    """An ellipse from two probes."""
    a, b, lag = draw.randint(18, 26) * 10, draw.randint(9, 15) * 10, draw.choice((20, 35, 130, 155))
    turn = math.radians(lag)
    orbit = ellipse(np.array([[0, a, 0], [0, b * math.sin(turn), b * math.cos(turn)]], float))
    return Problem("Two probes, one orbit", (1,), 20, f"Two probes at a right angle show x = {a} "
        f"sin Ωt and z = {b} cos(Ωt − {lag}°), in µm, about the mean.", (
        number("How far does the shaft come from its mean at most?", orbit.major, "µm",
               (2, "split into two circles, and add their radii"),
               mistakes={a: "This is what the larger probe shows; the ellipse lies askew.",
                         math.hypot(a, b): "The two peaks are not reached at the same time."}),
        number("How far at least?", orbit.minor, "µm", (1, "the difference of the radii")),
        word("In which sense does it whirl?", "forward" if orbit.forward else "backward", SENSES,
             (2, "the larger of the two circles decides")),
        reasons("A monitoring system stores each probe's peak only. What cannot be known from it?",
                (1, "the sense, and the largest displacement"))))


def trial_mass(draw: Random) -> Problem:
    """Balancing in one plane by influence coefficient."""
    first, lag = draw.randint(18, 30) * 10, draw.randint(3, 9) * 10
    trial, at = draw.choice((40, 50, 60)), draw.choice((0, 90))
    influence = cmath.rect(draw.randint(22, 30) / 10, -math.radians(draw.randint(10, 40)))  # µm/kg
    r0 = cmath.rect(first, -math.radians(lag))
    r1 = r0 + influence * cmath.rect(trial, math.radians(at))
    mass = -r0 / influence
    return Problem("A trial mass", (1, 12), 30, "Phases are counted from a mark on the rotor, in "
        f"the sense of the spin. At rated speed 1X is {first} µm at −{lag}°. With {trial} kg "
        f"bolted on at {at}° it is {abs(r1):.1f} µm at {math.degrees(cmath.phase(r1)):.1f}°; the "
        "mass is then taken off.", (
        number("How many micrometres does a kilogram make?", abs(influence), "µm/kg",
               (2, "difference of the vectors, not of their lengths, over the mass"), rtol=0.02,
               mistakes={abs(abs(r1) - first) / trial: "Subtract the vectors, not their lengths."}),
        number("Which mass takes the vibration away?", abs(mass), "kg",
               (2, "it must answer the first vector with its opposite"), rtol=0.02),
        number("At which angle, from −180° to 180°?", math.degrees(cmath.phase(mass)), "°",
               (1, "phase of −r₀ over the influence"), rtol=0.03),
        reasons("Which property of the machine does this use, and when does a machine in its field "
                "not have it?",
                (1, "linearity: twice the unbalance, twice the orbit"),
                (1, "near the fold, at large eccentricity, the pull is not linear"))))


def damping_for_a_resonance(draw: Random) -> Problem:
    """Damping from the largest orbit that may be."""
    m, n, U, left = draw.choice((120e3, 150e3)), draw.choice((350, 405)), draw.choice(
        (45.0, 55.0)), draw.choice((4.0, 5.0, 6.0))
    reach = 11.0 - left

    def peak(zeta: float) -> float:
        """Largest radius over all speeds, mm."""
        return 1e3 * U / m / (2 * zeta * math.sqrt(1 - zeta**2))

    zeta = brentq(lambda z: peak(z) - reach, 1e-3, 0.5)
    return Problem("Through the resonance", (1,), 20, f"A rotor of {m / 1e3:.0f} t with an "
        f"unbalance of {U:.0f} kg m has its resonance near {n} rpm and must pass it slowly. The "
        f"gap is 11 mm, and {left:.0f} mm of it must be left. No field.", (
        number("How large is the orbit at the resonance with 1 % damping?", peak(0.01), "mm",
               (1, "U/(2 ζ m), whatever the stiffness"), rtol=0.005),
        number("Which damping ratio is needed?", 100 * zeta, "%", (2, "solve for ζ"), rtol=0.02),
        number("How large is the orbit far above?", 1e6 * U / m, "µm",
               (1, "U/m: the mass centre comes to rest")),
        reasons("Name two other ways to pass with less vibration, and what each costs.",
                (1, "pass quickly: torque; balance better: time"), (1, "costs are named"))))


def pull_and_pull_in(draw: Random) -> Problem:
    """How hard the field pulls, and what springs hold it."""
    gap, radius = draw.choice((12, 14, 16)), draw.choice((3.0, 3.5))
    length = draw.choice((1.1, 1.2))
    field, k = 0.6, draw.choice((6e8, 6.5e8))
    stiff = pull_stiffness(field, radius, length, gap / 1e3)
    (eps, offset), (_, other) = held(k / stiff), held(2 * k / stiff)
    return Problem("Pull and pull-in", (2,), 35, f"A unit has a gap of {gap} mm, a mean radius of "
        f"{radius} m, a length of {length} m and a flux density of {field} T, rms. At the rotor "
        f"its shaft and bearings have a static stiffness of {k / 1e8:.1f}·10⁸ N/m.", (
        reasons("Derive the pull's stiffness at the centre from the pressure B²/2µ₀.",
                (1, "the factor ½ of the pressure"), (1, "the integral over the circumference")),
        number("Compute it.", stiff / 1e6, "MN/m", (1, "k_UMP = π B² R l/(µ₀ g)"),
               mistakes={stiff / 2e6: "An rms value needs no further half."}),
        number("Up to which static eccentricity can the resting rotor be held?", 100 * offset, "%",
               (2, "where the pull's slope equals the stiffness; then the balance of forces"),
               mistakes={100 * eps: "This is where the rotor then is; the stator's offset is "
                         "asked for."}),
        number("How far is it displaced in the stator then?", 100 * eps, "% of the gap",
               (1, "ε from the condition “stiffness used up”")),
        number(f"Somebody claims that {field} T is the peak of the wave. Up to which eccentricity "
               "would the rotor then be held?", 100 * other, "%",
               (1, "half the pull's stiffness"),
               (1, "to take a peak for an rms value overestimates the pull: the safe side"))))


def weight_of_the_pull(draw: Random) -> Problem:
    """The pull at a displacement, exact and linear."""
    eps, field = draw.choice((0.2, 0.3, 0.4)), draw.choice((0.5, 0.55))
    stiff, g = pull_stiffness(field, 2.9945, 0.97, 0.011), 0.011
    percent = draw.choice((5, 10))
    limit = brentq(lambda e: 1 - e / pull(e) - percent / 100, 1e-3, 0.9)
    return Problem("As heavy as what?", (2,), 20, f"The course's gap of 11 mm (mean radius "
        f"2.9945 m, length 0.97 m) has a field of {field} T, rms. The rotor stands {100 * eps:.0f} "
        "% of the gap off the stator's centre.", (
        number("How hard is it pulled?", stiff * g * pull(eps) / 1e3, "kN", (2, "(2.4)"),
               mistakes={stiff * g * float(LinearPull(1.0, 1.0).force(np.array([eps, 0.0]))[0])
                         / 1e3: "This is the linear law."}),
        number("Which mass weighs as much?", stiff * g * pull(eps) / 9810, "t", (1, "over g")),
        number(f"Up to which displacement is the linear pull at most {percent} % too small?",
               100 * limit, "% of the gap", (2, "ratio of line and closed form, solved for ε")),
        reasons("Is it safe to take the linear pull for the pull-in?",
                (1, "no: it takes too little, and two straight lines never give way"))))


def growing_rotor(draw: Random) -> Problem:
    """A gap that closes at speed."""
    cold, grows = draw.choice((14.0, 15.0, 16.0)), draw.choice((1.2, 1.5, 1.8))
    kappa = draw.choice((1.5, 1.7))
    warm = kappa * (cold - grows) / cold
    return Problem("A rim that grows", (2,), 25, f"At standstill a gap is {cold:.0f} mm wide and "
        f"the springs are {kappa} times as stiff as the pull. At full speed and warm, the rotor's "
        f"radius has grown by {grows} mm, all around. The flux density stays.", (
        number("By which factor has the pull's stiffness grown?", cold / (cold - grows), "",
               (2, "k_UMP goes with 1/g at the same flux density"),
               mistakes={(cold / (cold - grows))**2: "At the same flux density it goes with 1/g, "
                         "not with its square."}),
        number("Which share of the natural frequency is left of what it was with the cold gap?",
               math.sqrt((1 - 1 / warm) / (1 - 1 / kappa)), "",
               (2, "root of k − k_UMP, before and after"), rtol=0.005),
        number("Which stator offset can the springs hold, warm?", held(warm)[1] * (cold - grows),
               "mm", (2, "pull-in with the new κ, as a length of the new gap")),
        reasons("The stator grows by half as much when the machine is warm. What happens to the "
                "numbers if it grows oval?", (1, "the mean gap widens; an oval softens one "
                "direction, and pulls a centred rotor to no side"))))


def oval_stiffness(draw: Random) -> Problem:
    """Negative stiffness in an oval stator."""
    oval = draw.choice((0.06, 0.08, 0.12))
    phi = 2 * np.pi * np.arange(720) / 720
    law = ShapedPull(165e6, 0.011, 0.011 * (1 + oval * np.cos(2 * phi)))
    soft_x, soft_z = np.diag(law.linearise(np.zeros(2))[1]) / 1e6
    mass, k = 150e3, 270.0
    return Problem("Two stiffnesses from one field", (2, 11), 30, "A stator's gap with a centred "
        f"rotor is g₀(1 + {oval} cos 2φ), φ from z towards x, g₀ = 11 mm. With a round gap the "
        "pull's stiffness is 165 MN/m. The rotor of 150 t stands on 270 MN/m in all directions.", (
        reasons("Derive the pull's stiffness in x and z to first order in the ovality.",
                (1, "pressure with g⁻², derived by the displacement: g⁻³"),
                (1, "the mean and the second harmonic of cos²: the factor 1 ∓ 3a/2")),
        number("Pull's stiffness in x, exactly.", soft_x, "MN/m", (1, "by ShapedPull or the sum"),
               rtol=0.003),
        number("In z.", soft_z, "MN/m", (1, "smaller: the gap is wide there"), rtol=0.003),
        number("The lower of the two natural frequencies.",
               math.sqrt((k - max(soft_x, soft_z)) * 1e6 / mass) / rpm(1), "rpm",
               (1, "stiffness left in x")),
        reasons("Between the two natural frequencies, which sense of whirl has an unbalance "
                "response?", (1, "backward, as on unequal springs"))))


def work_of_the_pull(draw: Random) -> Problem:
    """The pull's potential."""
    near, far = draw.choice(((0.1, 0.4), (0.2, 0.5))), draw.choice((0.6, 0.7))
    scale = 165e6 * 0.011**2  # J
    work = [scale * quad(pull, *span)[0] for span in (near, (0.0, far))]
    return Problem("What the field gives", (2,), 20, "A gap of 11 mm, a pull's stiffness of "
        "165 MN/m at the centre.", (
        number(f"Which work does the field do on the rotor from {100 * near[0]:.0f} to "
               f"{100 * near[1]:.0f} % of the gap?", work[0], "J",
               (2, "the potential's difference: k g² [(1 − ε²)^(−½)]")),
        number(f"And from the centre to {100 * far:.0f} %?", work[1], "J", (1, "the same")),
        number("From there it whirls a full circle about the stator's centre. Which work does the "
               "field do on the way around?", 0.0, "J",
               (1, "none: the force is central and stands across the motion")),
        reasons("A rotor with more vibration in its field: does the field put in the energy?",
                (1, "no net work on a closed orbit; the shaft's torque pays, by the phase lag"),
                (1, "the field moves the resonance"))))


def field_from_frequencies(draw: Random) -> Problem:
    """The field from two natural frequencies."""
    off, share = draw.choice((6.4, 6.75, 7.0)), draw.choice((0.62, 0.66, 0.7))
    mass, gap, radius, length = 150e3, 0.011, 2.9945, 0.97
    stiff = mass * (2 * math.pi * off)**2 * (1 - share**2)
    on = round(share * off, 3)
    stiff = mass * (2 * math.pi)**2 * (off**2 - on**2)
    return Problem("A field measured by a hammer", (2, 14), 25, f"A rotor of 150 t, centred, rings "
        f"at {off} Hz without field and at {on} Hz with it. Gap 11 mm, mean radius 2.9945 m, "
        "length 0.97 m.", (
        number("How large is the pull's stiffness?", stiff / 1e6, "MN/m",
               (2, "difference of the squares of the angular frequencies times the mass")),
        number("Which flux density, rms, is that?",
               math.sqrt(stiff * MU0 * gap / (math.pi * radius * length)), "T",
               (2, "(2.5) solved")),
        number("At which offset of the stator does this rotor fall against it?",
               100 * held((off / on)**2 / ((off / on)**2 - 1))[1], "% of the gap",
               (2, "κ from the two frequencies: no mass is needed"), rtol=0.02),
        reasons("The mass is known to 5 %. Which of the three answers are touched by it?",
                (1, "the first two; κ is a ratio of frequencies"))))


def price_of_a_step(draw: Random) -> Problem:
    """The step limit of central differences."""
    fastest, n, revolutions = draw.choice((2.2e4, 2.6e4, 3.1e4)), draw.choice((125, 150)), 1000
    least = 2 * math.pi / rpm(n) / (2 / fastest)
    return Problem("What a step costs", (3, 6), 25, f"A shaft model's fastest mode has ω = "
        f"{fastest:.1e} rad/s. The unit runs at {n} rpm and is to be integrated for {revolutions} "
        "revolutions with central differences.", (
        number("How many steps in a revolution are needed at least?", least, "",
               (2, "ωΔt ≤ 2, Δt = 2π/(ΩN)"), mistakes={
                   2 * least: "The limit is ωΔt = 2, not 1.",
                   least * math.pi: "The limit is a step of two radians, not two steps a period."}),
        number("How many in all, in millions?", least * revolutions / 1e6, "", (1, "a product")),
        number("All elements are halved in length; the fastest mode becomes four times as fast. "
               "How many times as much work is it, in steps times unknowns?", 8.0, "",
               (1, "four times the steps, twice the unknowns")),
        reasons("Name two ways to need fewer steps, and what each gives up.",
                (1, "an implicit method takes any step and shifts or damps what it cannot resolve"),
                (1, "a reduced basis keeps slow modes and needs the static deflection too"))))


def clock_that_is_wrong(draw: Random) -> Problem:
    """Frequency errors of two methods."""
    steps, turns = draw.choice((20, 25, 40)), draw.choice((10, 20))
    wt = 2 * math.pi / steps
    fast, slow = 2 * math.asin(wt / 2) / wt - 1, 2 * math.atan(wt / 2) / wt - 1
    return Problem("A clock that is wrong", (3,), 30, "An undamped oscillator is integrated with "
        f"{steps} steps in each of its true periods.", (
        number("By how many per cent is the frequency of central differences too high?",
               100 * fast, "%", (2, "q_n = zⁿ in the recursion: sin(ω'Δt/2) = ωΔt/2"), rtol=0.02),
        number("By how many per cent is that of Newmark's average acceleration too low?",
               -100 * slow, "%", (2, "tan(ω'Δt/2) = ωΔt/2"), rtol=0.02),
        number(f"By which angle has the first run ahead of the true motion after {turns} periods?",
               360 * turns * fast, "°", (1, "error a period times periods"), rtol=0.02),
        number("By which factor does this error change with twice the steps?",
               (2 * math.asin(wt / 4) / (wt / 2) - 1) / fast, "", (1, "a quarter, nearly: order "
               "two"), rtol=0.02)))


def line_that_folds(draw: Random) -> Problem:
    """Aliasing of a record."""
    samples, pairs = draw.choice((16, 18, 20)), draw.choice((20, 24, 28))
    order = 2 * pairs
    seen = min(order % samples, samples - order % samples)
    return Problem("A line that is not there", (3, 12), 20, f"A 50 Hz unit with {pairs} pole pairs "
        f"is recorded with {samples} samples a revolution and no filter.", (
        number("At which speed does it run?", 60 * 50 / pairs, "rpm", (1, "f = pn")),
        number("Which order of rotation is twice the line frequency?", order, "",
               (1, "2p"), mistakes={2: "2X is twice the speed; the grid's line is asked for."}),
        number("At which order does it appear in the record?", seen, "",
               (2, "orders that differ by the number of samples cannot be told apart"), rtol=1e-6),
        reasons("How do you find out whether the line there is real?",
                (1, "sample at another rate, or filter first: a folded line moves"))))


def how_long_to_wait(draw: Random) -> Problem:
    """A transient that has to die."""
    zeta, f, n = draw.choice((0.8, 1.0, 1.5)), draw.choice((4.2, 6.1)), 150
    share = draw.choice((1e-3, 1e-4))
    time = -math.log(share) / (zeta / 100 * 2 * math.pi * f)
    return Problem("How long to wait", (3, 9), 20, f"The slowest mode of a unit at {n} rpm has {f} "
        f"Hz and {zeta} % damping. A run starts away from its steady orbit.", (
        number(f"After which time is {share:g} of the start left?", time, "s",
               (2, "e^(−ζωt); cycles per second become rad/s")),
        number("How many revolutions are that?", time * n / 60, "", (1, "times 150/60")),
        number("The field takes away half of the stiffness; the damper stays. How many times as "
               "long does it take now?", 1.0, "",
               (2, "c/2m decides, not ζ: the envelope has not changed"), mistakes={
                   2.0: "ζ has changed with ω; which of m, c, k stands in the envelope?",
                   math.sqrt(2): "ζ has grown as ω has fallen; their product counts."}),
        reasons("Two runs agree to 1 nm. Does this prove that they are steady?",
                (1, "no: they may share a transient or a step error"))))


PROBLEMS = (signs_and_axes, heavy_spot, side_and_size, two_probes, trial_mass,
            damping_for_a_resonance, pull_and_pull_in, weight_of_the_pull, growing_rotor,
            oval_stiffness, work_of_the_pull, field_from_frequencies, price_of_a_step,
            clock_that_is_wrong, line_that_folds, how_long_to_wait)
