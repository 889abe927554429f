"""Problems on chapters 4 and 5: balance of harmonics, branches, folds, stability."""

import math
from functools import cache
from random import Random

import numpy as np
from scipy.optimize import brentq

from hydrolab import (
    Arclength,
    HarmonicBalance,
    floquet,
    follow,
    load_machine,
    orbits_at,
)
from hydrolab.course.exam import Problem, number, reasons, word
from hydrolab.dynamics.branches import Branch


@cache
def mass_branch(field: float = 1.0) -> Branch:
    """The point mass over the eccentricity, to its first fold."""
    machine = load_machine("jeffcott")
    return follow(machine.model().with_field(field), "static_eccentricity", to=0.2,
                  speed=machine.speed, method=Arclength(max_folds=1))


@cache
def unit_branch(unbalance: float = 1.0) -> Branch:
    """The course's unit over the eccentricity, over its first two folds."""
    machine = load_machine("kaplan-150rpm")
    return follow(machine.model().with_unbalance(unbalance), "static_eccentricity", to=0.12,
                  speed=machine.speed, method=Arclength(max_folds=3))


def aliasing(draw: Random) -> Problem:
    """Samples for a polynomial force."""
    degree, kept = draw.choice(((3, 1), (5, 1), (3, 2)))
    few = degree + 1
    theta = 2 * np.pi * np.arange(few) / few
    folded = 2 / few * float((np.cos(theta)**(degree + 1)).sum())
    true = 2 * math.comb(degree, (degree - 1) // 2) / 2**degree
    return Problem("Samples", (4,), 25, f"A force is f = x^{degree}, and the motion x = cos θ.", (
        number("How large is the force's first harmonic? By hand.", true, "",
               (2, "powers of a cosine as a sum of cosines")),
        number(f"What does AFT give for it with {few} samples in a revolution?", folded, "",
               (2, "the harmonic N − 1 appears as the first"), mistakes={
                   true: "This is the true one: which harmonic is folded onto it?"}),
        number(f"Now x has {kept} harmonics. From which number of samples on is nothing folded "
               "back onto those that are kept?", (degree + 1) * kept + 1, "",
               (1, "N ≥ (d + 1)m + 1"), rtol=1e-6),
        reasons("Why does the magnetic pull need more than such a rule suggests?",
                (1, "it is no polynomial: its harmonics fall off and never end"))))


def one_term(draw: Random) -> Problem:
    """The hardening oscillator with one harmonic."""
    force, omega = draw.choice((0.3, 0.4, 0.5)), draw.choice((1.5, 1.6))
    beta = 1.0

    def lack(a: float) -> float:
        """Undamped: (1 − ω²) a + ¾ β a³ − f."""
        return (1 - omega**2) * a + 0.75 * beta * a**3 - force

    turn = math.sqrt((omega**2 - 1) / (2.25 * beta))
    large = brentq(lack, turn, 10)
    least = (omega**2 - 1) * turn * 2 / 3
    few = [brentq(lack, -turn, turn), brentq(lack, -10, -turn)] if force < least else []
    return Problem("One harmonic by hand", (4,), 30, "ẍ + x + x³ = f cos ωt, without damping, is "
        f"balanced with x = a cos ωt. ω = {omega}.", (
        reasons("Derive the equation for a.", (1, "cos³ = ¾ cos + ¼ cos 3"),
                (1, "(1 − ω²)a + ¾a³ = f")),
        number(f"The largest a > 0 for f = {force}.", large, "", (1, "root of the cubic")),
        number("How many real solutions, of either sign, has it?", 1 + len(few), "",
               (1, "compare f with the cubic's turning value"), rtol=1e-6),
        number("Up to which f are there three?", least, "",
               (2, "where the derivative by a vanishes: a² = 4(ω² − 1)/9"), rtol=0.005),
        reasons("Which of the three is not reached by raising the frequency slowly, and what "
                "would you have to compute to know?",
                (1, "the middle one is unstable: multipliers"))))


def counting_unknowns(draw: Random) -> Problem:
    """Sizes of systems of equations."""
    elements, kept, law = draw.choice((12, 20)), draw.choice((4, 6, 8)), draw.choice((1, 2))
    dofs = 4 * (elements + 1)
    return Problem("How large is the system?", (4,), 15, f"A shaft of {elements} beam elements "
        f"carries a generator with a pull{' and a bearing with clearance' if law == 2 else ''}. "
        f"Its steady state is sought with {kept} harmonics and the mean.", (
        number("How many unknowns are there with all degrees of freedom?", dofs * (2 * kept + 1),
               "", (1, "4 for each node"), (1, "2m + 1 coefficients each"), rtol=1e-6),
        number("How many are left after all linear ones are eliminated?",
               2 * law * (2 * kept + 1), "", (2, "two coordinates for each nonlinear place"),
               rtol=1e-6),
        number("And for a motion that repeats after two revolutions, with as many orders of the "
               "rotation?", 2 * law * (4 * kept + 1), "",
               (1, "harmonics of half the speed: twice as many"), rtol=1e-6),
        reasons("Is the elimination an approximation?",
                (1, "no: exact, once for a speed and each harmonic"))))


def condensed_stiffness(draw: Random) -> Problem:
    """A dynamic stiffness with one degree of freedom eliminated."""
    m1, m2, k1, k2 = draw.choice((100, 120)), draw.choice((30, 40)), draw.choice((0.3, 0.4)), 0.5
    omega, order = 150 * math.pi / 30, draw.choice((2, 3))

    def left(w: float) -> float:
        """Stiffness seen by the rotor, GN/m, at an angular frequency."""
        z22 = k1 + k2 - m2 * 1e-6 * w**2
        return k2 - m1 * 1e-6 * w**2 - k2**2 / z22

    return Problem("One mass eliminated", (4,), 25, f"A rotor of {m1} t hangs by a spring of {k2} "
        f"GN/m on a bearing housing of {m2} t, which stands on {k1} GN/m. 150 rpm, no damping. "
        "Only the rotor feels the pull.", (
        number("The stiffness that the rotor feels at rest.", left(0.0), "GN/m",
               (2, "two springs in series: Z11 − Z12 Z22⁻¹ Z21 at ω = 0"), mistakes={
                   k2: "This is with a housing that does not move."}),
        number("The dynamic stiffness at 1X.", left(omega), "GN/m", (2, "with −mω² in both places"),
               rtol=0.005),
        number(f"At {order}X.", left(order * omega), "GN/m", (1, "with the harmonic's frequency"),
               rtol=0.005),
        reasons("What does a change of sign between two harmonics mean?",
                (1, "a natural frequency lies between them"))))


def enough_harmonics(draw: Random) -> Problem:
    """What a truncated series leaves out."""
    late = draw.choice((0.05, 0.06, 0.07))
    machine = load_machine("jeffcott")
    seconds = {m: HarmonicBalance(harmonics=m).solve(machine.model(), machine.speed, late)
               for m in (1, 2, 12)}
    size = {m: 1e6 * orbit.amplitudes[0] for m, orbit in seconds.items()}
    return Problem("How many harmonics are enough?", (4,), 25, "Use `load_machine(\"jeffcott\")` "
        f"at its speed and a static eccentricity of {100 * late:.0f} %.", (
        number("1X in x with twelve harmonics.", size[12][0], "µm", (1, "a run"), rtol=0.003),
        number("1X in x with one harmonic only.", size[1][0], "µm",
               (1, "a run; the mean is kept too"), rtol=0.001),
        number("2X in x with two harmonics.", size[2][1], "µm", (1, "a run"), rtol=0.003),
        reasons("Give the number of harmonics for an error of 1 µm, and say how you know without "
                "the exact answer.", (1, "a number with the change from one to the next"),
                (1, "the change must be smaller than what is asked, and falling")),
        reasons("The fold lies near 7.8 %. Will more harmonics move it to 9 %?",
                (1, "no: it is a property of the equations"))))


def the_report(draw: Random) -> Problem:
    """What may be written after a solver has stopped."""
    share = draw.choice((0.9, 1.0, 1.1))
    branch = unit_branch(share)
    fold = branch.folds[0].value
    beyond = math.ceil(1e3 * fold) / 1e3
    found = orbits_at(branch, beyond)
    stable = [orbit for orbit in found if floquet(orbit).verdict == "stable"]
    return Problem("The report", (5, 10), 35, "A colleague has raised the eccentricity of "
        f"`kaplan-150rpm`, with {share} times its unbalance, in steps of 0.1 %. The solver stopped "
        f"before {100 * beyond:.1f} %. The draft says: *Beyond this the machine has no steady "
        "state.*", (
        number("Where does the branch turn back?", 100 * fold, "%", (2, "arclength, located fold"),
               rtol=0.001),
        number(f"How many steady states does the branch, followed over its first three folds, have "
               f"at {100 * beyond:.1f} %?", len(found), "", (1, "count the crossings"), rtol=1e-6),
        number("How many of them are stable?", len(stable), "", (1, "multipliers"), rtol=1e-6),
        number("How large is 1X in x on the stable one?", 1e6 * stable[0].amplitudes[0, 0], "µm",
               (1, "a reading of that orbit"), rtol=0.01),
        reasons("Rewrite the sentence so that it says what is known, and add one on what is not.",
                (1, "the branch from the centred machine turns back there; another orbit exists"),
                (1, "not known: the real unit's masses and bearings, hence the number; whether "
                    "the machine arrives there or at the stator depends on the start"))))


def folds_by_hand(draw: Random) -> Problem:
    """Folds of a cubic curve."""
    a, at = draw.choice((3.0, 2.0, 1.5)), 0.2
    fold = 2 * a / 3 * math.sqrt(a / 3)
    roots = np.roots([1, 0, -a, -at])
    return Problem("Two folds by hand", (5,), 20, f"Steady states lie on λ = y³ − {a:g} y.", (
        number("At which positive λ is a fold?", fold, "", (2, "dλ/dy = 0, at y = −√(a/3)")),
        number(f"How many steady states are there at λ = {at}?", int(np.isreal(roots).sum()), "",
               (1, "between the folds three, else one"), rtol=1e-6),
        number(f"Newton's method in y at fixed λ = {at} starts at y = 2. Where is it after one "
               "step?", 2 - (8 - 2 * a - at) / (12 - a), "", (1, "y − F/F'"), rtol=0.003),
        number("The slope dy/dλ at y = 0.", -1 / a, "", (1, "1/(3y² − a)")),
        reasons("ẏ = λ − y³ + ay. Which stretches are stable, and what happens at a fold when λ is "
                "raised slowly beyond?", (1, "outer legs stable, the middle one not"),
                (1, "a jump to the other leg"))))


def multipliers_by_hand(draw: Random) -> Problem:
    """Multipliers of a constant oscillator and their product."""
    zeta, f, n = draw.choice((0.01, 0.02)), draw.choice((6.75, 5.4)), draw.choice((125, 150))
    period = 60 / n
    size = math.exp(-zeta * 2 * math.pi * f * period)
    return Problem("Multipliers by hand", (5,), 20, f"An oscillator of {f} Hz with {100 * zeta:.0f}"
        f" % damping is watched once a revolution, at {n} rpm.", (
        number("How large is the modulus of its Floquet multipliers?", size, "",
               (2, "e^(−ζω₀T): decay over a revolution"), rtol=0.005),
        number("And their product?", size**2, "", (1, "e^(−cT/m)"), rtol=0.005),
        number("How many revolutions until a disturbance is down to a hundredth?",
               math.log(0.01) / math.log(size), "", (1, "logarithms"), rtol=0.02),
        reasons("A branch shows multipliers 1.02; then −1.04; then 0.7 ± 0.75i. Name what has "
                "been passed in each case and what motion begins.",
                (1, "fold or pitchfork at +1: it leaves along the branch's direction"),
                (1, "flip at −1: a motion of two revolutions"),
                (1, "a pair outside the circle: a second frequency"))))


def how_much_field(draw: Random) -> Problem:
    """The fold of the point mass with another field."""
    field, weaker = draw.choice((1.02, 1.04)), draw.choice((0.85, 0.9))
    folds = {f: 100 * mass_branch(f).folds[0].value for f in (1.0, field, weaker)}
    return Problem("What a field costs", (5,), 25, "Use `load_machine(\"jeffcott\")` at its speed "
        "and `model.with_field(…)`.", (
        number(f"First fold with {field} times the field.", folds[field], "% of the gap",
               (1, "follow, located fold"), rtol=0.002, mistakes={
                   folds[1.0]: "This is with the card's field."}),
        number(f"With {weaker} times.", folds[weaker], "% of the gap", (1, "the same"), rtol=0.002),
        number("With which factor on the pull's stiffness does the last go along?", weaker**2, "",
               (1, "the pull goes with the square"), rtol=0.003),
        reasons("Static pull-in comes later than this fold. Why?",
                (2, "the whirl eats into the gap: the nonlinear pull on an orbit is stronger than "
                    "at its mean, and 1X grows as the stiffness falls")),
        reasons("Which margin would you demand, and against what?",
                (1, "a number with uncertainty of stiffness, field, unbalance"))))


def seal_that_drives(draw: Random) -> Problem:
    """Cross-coupled stiffness against damping."""
    f, zeta = draw.choice((5.4, 6.75)), draw.choice((0.01, 0.015))
    c = 2 * zeta * 150e3 * 2 * math.pi * f
    limit = c * 2 * math.pi * f
    forward = draw.random() < 0.5
    push = "F_x = q z, F_z = −q x" if forward else "F_x = −q z, F_z = q x"
    return Problem("A seal that drives", (5, 7), 25, f"A rotor of 150 t rings at {f} Hz with "
        f"{100 * zeta:g} % damping, the same in x and z. A seal pushes it across its displacement: "
        f"{push}, q > 0. The spin turns from z towards x.", (
        number("From which q on does the rotor whirl by itself?", limit / 1e6, "MN/m",
               (2, "with w = z + ix the coupling is ∓iq: it does the damper's work back when "
                   "q = cω"), rtol=0.005),
        number("By which factor does a disturbance grow in a second at twice this q?",
               math.exp(c / 300e3), "", (2, "growth (q − cω)/(2mω)"), rtol=0.02),
        word("In which sense does it whirl?", "with the spin" if forward else "against it",
             ("with the spin", "against it"),
             (1, "the push on w is ±iqw, and a circle e^(iωt) has the velocity iωw: power is put "
                 "in where the signs agree")),
        reasons("Does an unbalance response show this before it happens?",
                (1, "no: 1X need not grow; the damping of the free motion does fall"))))


PROBLEMS = (aliasing, one_term, counting_unknowns, condensed_stiffness, enough_harmonics,
            the_report, folds_by_hand, multipliers_by_hand, how_much_field, seal_that_drives)
