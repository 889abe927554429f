"""Problems on chapters 6 to 8: beams, discs, bearings, damping, the unit."""

import math
from random import Random

import numpy as np

from hydrolab import HarmonicBalance, campbell, load_machine, modes, rpm, vary
from hydrolab.course.exam import Problem, number, reasons, word

STEEL, DENSITY = 210e9, 7850.0


def bar(draw: Random) -> Problem:
    """A shaft on two supports."""
    d, length = draw.choice((0.6, 0.8, 0.9)), draw.choice((5.0, 6.0))
    area, second = math.pi * d**2 / 4, math.pi * d**4 / 64
    shear_modulus, kappa = STEEL / 2.6, 0.9
    bend = length**3 / (48 * STEEL * second)
    shear = length / (4 * kappa * shear_modulus * area)
    first = (math.pi / length)**2 * math.sqrt(STEEL * second / (DENSITY * area)) / (2 * math.pi)
    heavy = 80e3
    return Problem("A shaft on two supports", (6,), 30, f"A solid steel shaft, ⌀ {1e3 * d:.0f} mm, "
        f"{length:.0f} m between two simple supports; E = 210 GPa, ρ = 7850 kg/m³, ν = 0.3, shear "
        "coefficient 0.9.", (
        number("Its static stiffness in the middle, by bending alone.", 1e-6 / bend, "MN/m",
               (2, "48 EI/L³ with I = πd⁴/64")),
        number("By how many per cent does shear lower it?", 100 * shear / (bend + shear), "%",
               (2, "L/(4κGA) added to the flexibility"), rtol=0.02),
        number("First natural frequency of the shaft alone, slender.", first, "Hz",
               (1, "(π/L)² √(EI/ρA)")),
        number("With a disc of 80 t in the middle, the shaft without mass, bending alone.",
               math.sqrt(1 / (bend * heavy)) / (2 * math.pi), "Hz", (1, "√(k/m)")),
        reasons("Two elements give the last number exactly, the one before not. Why?",
                (1, "a cubic is the exact static shape; a free mode of a heavy shaft is no "
                    "cubic"))))


def overhang(draw: Random) -> Problem:
    """A disc beyond its bearing."""
    d, a, span = draw.choice((0.8, 0.9)), draw.choice((1.2, 1.5)), draw.choice((4.0, 5.0))
    near, far = draw.choice((1.2e9, 1.4e9)), 1.6e9
    second = math.pi * d**4 / 64
    shaft = a**2 * (span + a) / (3 * STEEL * second)
    springs = ((span + a) / span)**2 / near + (a / span)**2 / far
    mass = 110e3
    return Problem("Beyond the last bearing", (6, 7), 30, f"A generator of 110 t sits {a} m beyond "
        f"a guide bearing of {near / 1e9:.1f} GN/m; the other bearing, 1.6 GN/m, is {span:.0f} m "
        f"away. Shaft ⌀ {1e3 * d:.0f} mm, E = 210 GPa, without mass. No tilt inertia.", (
        number("Stiffness at the generator with rigid bearings.", 1e-6 / shaft, "MN/m",
               (2, "3EI/(a²(l + a))"), rtol=0.01),
        number("Stiffness with a rigid shaft.", 1e-6 / springs, "MN/m",
               (2, "levers: each bearing's flexibility with the square of its share")),
        number("Natural frequency with both.",
               math.sqrt(1 / ((shaft + springs) * mass)) / (2 * math.pi), "Hz",
               (1, "flexibilities add")),
        reasons("Which part would you stiffen first, and how do you see it in the numbers?",
                (1, "the one with the larger flexibility"))))


def gyroscope(draw: Random) -> Problem:
    """A disc that only tilts."""
    ratio, f = draw.choice((0.6, 0.7, 1.6)), draw.choice((8.0, 9.0))
    n = 200
    w0, half = 2 * math.pi * f, ratio * rpm(n) / 2
    up, down = half + math.hypot(half, w0), math.hypot(half, w0) - half
    back = w0 / math.sqrt(1 + ratio)
    return Problem("A disc that tilts", (7,), 30, "A disc on a weightless shaft can only tilt: "
        f"I_d ψ̈ − i I_p Ω ψ̇ + k ψ = 0, I_p/I_d = {ratio}. At rest it rings at {f:.0f} Hz.", (
        number(f"Forward natural frequency at {n} rpm.", up / (2 * math.pi), "Hz",
               (2, "quadratic for ω: ω² − pΩω − ω₀² = 0")),
        number("Backward one.", down / (2 * math.pi), "Hz", (1, "the other root")),
        number("At which speed does the backward one run with the spin's rate?", back / rpm(1),
               "rpm", (2, "ω = −Ω in the quadratic: Ω = ω₀/√(1 + p)")),
        word("Has the forward one a critical speed at 1X?", "yes" if ratio < 1 else "no",
             ("yes", "no"), (1, "Ω² (1 − p) = ω₀²: only a disc with I_p < I_d")),
        reasons("Does the gyroscopic term take energy out?",
                (1, "no: the moment stands across the angular velocity"))))


def natural_and_critical(draw: Random) -> Problem:
    """Natural frequencies against critical speeds."""
    heavier = draw.choice((1.0, 1.3, 1.6))
    name = load_machine("three-disc").bodies[1].name
    machine = load_machine("three-disc")
    machine = vary(machine, {f"bodies.{name}.mass": heavier * machine.body(name).mass})
    rest = modes(machine.model()).frequencies[:6] / rpm(1)
    diagram = campbell(machine.model(), rpm(1) * np.linspace(0, 25000, 26), branches=6)
    critical = diagram.critical_speeds / rpm(1)
    return Problem("Natural and critical", (7,), 25, "Take the card `three-disc`, the mass of "
        f"{name!r} {heavier} times its value (`vary`), and speeds from 0 to 25 000 rpm.", (
        number("First natural frequency at rest.", rest[0], "rpm", (1, "modes"), rtol=0.003),
        number("First critical speed of the 1X line.", critical[0], "rpm", (1, "campbell"),
               rtol=0.001),
        number("The sixth natural frequency at rest.", rest[5], "rpm", (1, "modes"), rtol=0.003),
        number("The last critical speed below 25 000 rpm.", critical[-1], "rpm", (1, "campbell"),
               rtol=0.003),
        reasons("Which differ most from rest to crossing, and why?",
                (1, "modes in which discs tilt; forward ones rise, backward ones fall")),
        reasons("At which crossings does an unbalance drive a resonance if all bearings are alike "
                "in both directions?", (1, "forward ones only; unless bearings or the pull "
                                          "differ"))))


def decrement(draw: Random) -> Problem:
    """Damping from a decay."""
    f, cycles, left = draw.choice((5.2, 6.0)), draw.choice((8, 10)), draw.choice((0.3, 0.45))
    delta = -math.log(left) / cycles
    zeta = delta / math.hypot(2 * math.pi, delta)
    return Problem("A blow with a hammer", (7, 14), 20, f"After a blow a rotor of 120 t rings at "
        f"{f} Hz; after {cycles} cycles {100 * left:.0f} % of the amplitude is left.", (
        number("Damping ratio.", 100 * zeta, "%", (2, "logarithmic decrement over 2π"), rtol=0.02),
        number("Damping coefficient.", 2 * zeta * 120e3 * 2 * math.pi * f / 1e3, "kN s/m",
               (1, "2ζmω"), rtol=0.02),
        number("How many times the static deflection is the resonance of a force of fixed size?",
               1 / (2 * zeta), "", (1, "1/2ζ"), rtol=0.02),
        reasons("Is this the damping in service?",
                (1, "no: film, seals, and speed differ; the decay at rest is a first guess"))))


def stored_energy(draw: Random) -> Problem:
    """The inertia constant."""
    mass, radius, rating, n = draw.choice((110, 140)), draw.choice((2.4, 2.6)), draw.choice(
        (50, 65)), 150
    inertia = mass * 1e3 * radius**2
    energy = inertia * rpm(n)**2 / 2
    H = energy / (rating * 1e6)
    return Problem("What turns on", (8, 13), 20, f"A rotor of {mass} t has a radius of gyration of "
        f"{radius} m and turns at {n} rpm. The unit is rated {rating} MVA.", (
        number("Polar moment of inertia.", inertia / 1e3, "t m²", (1, "m i²")),
        number("Stored energy.", energy / 1e6, "MJ", (1, "½ I_p Ω²")),
        number("Inertia constant H.", H, "s", (1, "energy over rating")),
        number("The breaker opens at full power. After which time is the speed a tenth up, if the "
               "gates do nothing?", H * (1.1**2 - 1), "s",
               (2, "energy grows by P t: Ω²/Ω₀² = 1 + t/H"), mistakes={
                   2 * H * 0.1: "At constant torque it is 2H times a tenth; the power is what "
                   "stays here."}),
        reasons("An inertia in a paper gives H = 12 s. What do you do?",
                (1, "ask: usual are 2 to 5 s; diameter for radius, or GD² for I"))))


def one_number_at_a_time(draw: Random) -> Problem:
    """How the centred orbit depends on numbers nobody states."""
    more = draw.choice((1.05, 1.1))
    unit = load_machine("kaplan-150rpm")
    generator, guide = unit.bodies[0], unit.bearings[0]

    def first(changes: dict) -> float:
        """1X of the centred machine, µm."""
        machine = vary(unit, changes)
        return 1e6 * HarmonicBalance(2).solve(machine.model(), unit.speed, 0.0).amplitudes[0, 0]

    heavy = first({f"bodies.{generator.name}.mass": more * generator.mass})
    stiff = first({f"bearings.{guide.name}.stiffness": more * guide.stiffness})
    base = first({})
    percent = round(100 * (more - 1))
    return Problem("One number at a time", (8,), 25, "Use `kaplan-150rpm`, centred, at its speed, "
        f"and `vary`. Each number grows by {percent} %, alone.", (
        number("1X with the generator's mass larger.", heavy, "µm", (1, "vary and solve"),
               rtol=0.003, mistakes={base: "This is the card's machine."}),
        number("1X with the guide bearing stiffer.", stiff, "µm", (1, "vary and solve"),
               rtol=0.001, mistakes={base: "This is the card's machine."}),
        number("How strongly does 1X depend on the mass: per cent for a per cent, over this step?",
               100 * (heavy / base - 1) / percent, "", (1, "relative change over relative change"),
               rtol=0.01),
        reasons("The card was calibrated so that 1X is 200 µm. Which of its numbers are known "
                "thereby?", (1, "none: one reading fixes one combination"),
                (1, "what would: a natural frequency, a weight, a drawing"))))


PROBLEMS = (bar, overhang, gyroscope, natural_and_critical, decrement, stored_energy,
            one_number_at_a_time)
