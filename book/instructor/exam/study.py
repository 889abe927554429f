"""Problems on chapters 9 to 12: two methods compared, eccentricity, the pull's neighbours, reading
a machine.
"""

import cmath
import math
from dataclasses import replace
from functools import cache
from random import Random

import numpy as np

from hydrolab import HarmonicBalance, ShapedPull, load_machine, rpm
from hydrolab.course.exam import Problem, number, reasons, word
from hydrolab.course.records import FAULTS, condition_of, evidence, healthy, unknown_machine
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.machine.pole_pairs import PolePairPull


@cache
def steady(eccentricity: float, unbalance: float = 1.0, field: float = 1.0) -> PeriodicOrbit:
    """The course's unit at its speed."""
    unit = load_machine("kaplan-150rpm")
    model = unit.model().with_unbalance(unbalance).with_field(field)
    return HarmonicBalance(harmonics=4).solve(model, unit.speed, eccentricity)


def two_steps(draw: Random) -> Problem:
    """Richardson's extrapolation."""
    true, error, order = draw.randint(280, 320) / 1.0, draw.choice((1.6, 2.4, 3.2)), draw.choice(
        (1, 2))
    coarse, middle, fine = (round(true + error / 2**(order * k), 4) for k in range(3))
    return Problem("Three runs", (3, 9), 20, "1X from integrations with 256, 512 and 1024 steps a "
        f"revolution: {coarse}, {middle} and {fine} µm.", (
        number("Which order has the method?", order, "",
               (2, "log₂ of the ratio of the differences"), rtol=0.02),
        number("Which value do the runs tend to?",
               fine + (fine - middle) / (2**order - 1), "µm",
               (2, "the last, and the last difference over 2ᵖ − 1"), rtol=2e-5),
        number("How many steps are needed for an error of 0.01 µm (a power of two)?",
               2**math.ceil(math.log2(1024 * (abs(fine - true) / 0.01)**(1 / order))), "",
               (1, "error with N⁻ᵖ"), rtol=1e-6),
        reasons("Harmonic balance gives the same value to 0.02 µm. What do the two share, so that "
                "their agreement does not prove it right?",
                (1, "the model: matrices, force law, card"))))


def both_wrong(draw: Random) -> Problem:
    """What agreement proves."""
    late, field = draw.choice((0.04, 0.05)), draw.choice((0.97, 1.03))
    true, other = steady(late), steady(late, field=field)
    return Problem("Two methods, one mistake", (9,), 20, "Somebody has typed the field of "
        f"`kaplan-150rpm` as {field} times what it is, and runs harmonic balance and time "
        f"integration at {100 * late:.0f} % eccentricity. They agree to 0.1 µm.", (
        number("1X in x with the right field (4 harmonics).", 1e6 * true.amplitudes[0, 0], "µm",
               (1, "a run"), rtol=0.003),
        number("With the mistyped one.", 1e6 * other.amplitudes[0, 0], "µm", (1, "a run"),
               rtol=0.003),
        number("By which factor is the error of the result, relative, larger than that of the "
               "field?", (other.amplitudes[0, 0] / true.amplitudes[0, 0] - 1) / (field - 1), "",
               (1, "relative over relative"), rtol=0.01),
        reasons("Give two checks that could have found it.",
                (1, "a limit: no field, or the linear pull by hand"),
                (1, "a number from outside: a measured natural frequency with field"))))


def reading_an_orbit(draw: Random) -> Problem:
    """Steady state at an eccentricity."""
    late = draw.choice((0.055, 0.065, 0.075))
    orbit, gap = steady(late), 11.0
    size = 1e6 * orbit.amplitudes
    held = (1 - late) * gap
    return Problem("What is left of the gap", (10,), 20, "Use `kaplan-150rpm` at its speed with 4 "
        f"harmonics and a static eccentricity of {100 * late:.1f} %.", (
        number("How far has the mean moved in x, with its sign?", 1e6 * orbit.mean[0], "µm",
               (1, "negative: towards the small gap")),
        number("1X across the offset, in z.", size[1, 0], "µm", (1, "a reading"), mistakes={
            size[0, 0]: "This is along the offset."}),
        number("The smallest gap.", 1e3 * orbit.smallest_gap, "mm",
               (2, "offset, mean and whirl each take a part"), rtol=0.002,
               mistakes={held: "The rotor follows the pull, and whirls."}),
        number("2X in x as a share of 1X.", 100 * size[0, 1] / size[0, 0], "%", (1, "a ratio")),
        reasons("Which of these would a probe at the guide bearing not show, and why?",
                (1, "gap and mean of the generator: it moves otherwise there"))))


def warned_by_a_root(draw: Random) -> Problem:
    """Estimating a fold from amplitudes."""
    fold, end = draw.choice((7.4, 8.9, 9.6)), draw.choice((820.0, 900.0))
    slope = draw.choice((260.0, 310.0))
    at = [round(fold - d, 2) for d in (0.5, 0.3, 0.2)]
    seen = [round(end - slope * math.sqrt(fold - e), 1) for e in at]
    return Problem("Warned by a root", (5, 10), 30, "Near a fold a reading goes like A = A₀ − "
        "s√(e_f − e). Three readings of 1X: " + ", ".join(
            f"{a} µm at {e} %" for a, e in zip(seen, at, strict=True)) + ".", (
        number("Where is the fold?", fold, "%", (3, "three equations, three unknowns: squares, "
                                                "or a search for e_f"), rtol=0.004),
        number("Which amplitude is reached there?", end, "µm", (1, "A₀"), rtol=0.01),
        number("How fast does 1X grow at the last reading?",
               slope / 2 / math.sqrt(fold - at[-1]), "µm per %", (1, "the derivative"), rtol=0.03),
        reasons("A straight line through the last two readings reaches A₀ where? Is this guess on "
                "the safe side?", (1, "beyond the fold: unsafe, the slope still grows"))))


def up_and_down(draw: Random) -> Problem:
    """Reading a hysteresis."""
    up, down, now = draw.choice((8.9, 7.8)), draw.choice((6.9, 6.2)), draw.choice((7.2, 7.5))
    return Problem("Up and down again", (5, 10), 15, f"A unit's small orbit ends at {up} % "
        f"eccentricity; the large one can be followed down to {down} %. Both are stable in "
        "between.", (
        number(f"The eccentricity was raised slowly from 0 to {now} %. How many stable orbits "
               "are there now?", 2, "", (1, "between the two ends"), rtol=1e-6),
        word("On which is it?", "small", ("small", "large"), (1, "it has not passed the edge")),
        number("It jumps when raised further. Below which eccentricity does it come back?", down,
               "%", (1, "the large orbit's own end"), mistakes={up: "This is where it goes up."}),
        reasons(f"A disturbance hits the machine at {now} %. What decides whether it jumps, and "
                "how does one compute it?", (1, "the basin: whether the state is pushed across"),
                (1, "integrate from many pushes, or `integrity`")),
        reasons("An operator wants to be back on the small orbit. What can they change but the "
                "eccentricity?", (1, "field or unbalance or speed: lower field moves the edges"))))


def shapes_that_pull(draw: Random) -> Problem:
    """The selection rule of orders."""
    n, size = draw.choice((2, 3, 4)), draw.choice((0.08, 0.1))
    phi = 2 * np.pi * np.arange(720) / 720

    def force(a: int, b: int) -> float:
        shape = 0.011 * (1 + size * np.cos(a * phi) + size * np.cos(b * phi))
        return float(np.hypot(*ShapedPull(1.65e8, 0.011, shape).force(np.zeros(2)))) / 1e3

    return Problem("Shapes that pull", (11,), 30, f"The gap with a centred rotor is g₀(1 + {size} "
        f"cos nφ + {size} cos mφ), g₀ = 11 mm; the pull's stiffness is 165 MN/m.", (
        reasons("For which pairs (n, m) is there a force on the centred rotor, to second order?",
                (1, "g⁻² to second order, product of two cosines"),
                (1, "the integral with cos φ: orders that differ by one")),
        number(f"The force for ({n}, {n + 1}).", force(n, n + 1), "kN", (1, "ShapedPull"),
               rtol=0.005),
        number("What does the second order give for it?", 3 / 2 * size**2 * 165e6 * 0.011 / 1e3,
               "kN", (2, "3/2 · a b k g₀ after the integral"), rtol=0.02),
        number(f"The force for ({n}, {n}).", 0.0, "kN", (1, "none")),
        reasons("An inspection finds only an oval, and a rotor that is pulled to one side. What "
                "else must be there?", (1, "an offset (1) or a triangle (3)"))))


def turning_shapes(draw: Random) -> Problem:
    """Frequencies of the force of two shapes."""
    rotor = draw.choice((3, 4, 5))
    stator = rotor + draw.choice((-1, 1))
    n = draw.choice((125, 150))
    return Problem("A shape that turns", (11,), 20, f"A rotor's outline has order {rotor}, its "
        f"stator's order {stator}. {n} rpm.", (
        number("How often in a revolution does the force turn around?", rotor, "",
               (2, "the rotor's shape passes as many times as it has waves"), rtol=1e-6,
               mistakes={stator: "The stator's order stands still."}),
        number("Which frequency is that?", rotor * n / 60, "Hz", (1, "orders times speed")),
        word("In which sense does it turn?", "with the spin" if stator < rotor else "against it",
             ("with the spin", "against it"),
             (2, "e^{i(rotor − stator)φ}: the sense follows the sign of the difference")),
        reasons("What does a rotor's outline of order 1 amount to?",
                (1, "a rotor off its own axis: an offset that turns, 1X, like an unbalance"))))


def beat_of_the_poles(draw: Random) -> Problem:
    """Twice the line frequency of a one-pole-pair wave."""
    eps, p = draw.choice((0.1, 0.2)), draw.choice((2, 3))
    law = {k: PolePairPull(165e6, 0.011, k, float(k)) for k in (1, p)}
    turn = 2 * np.pi * np.arange(256) / 256

    def around(k: int) -> np.ndarray:
        """Pull along the displacement over a revolution, kN."""
        place = np.stack([np.full(256, eps * 0.011), np.zeros(256)])
        return law[k].linearise(place, None, turn)[0][0] / 1e3

    blocked = replace(law[1], flux_share=0.0)
    mean_blocked = blocked.linearise(np.stack([np.full(256, eps * 0.011), np.zeros(256)]), None,
                                     turn)[0][0].mean() / 1e3
    beat = {k: 2 * abs(np.fft.rfft(around(k))[2 * k]) / 256 for k in (1, p)}
    return Problem("A pull that beats", (3, 11), 25, "A field of one pole pair whose net flux "
        f"finds its way back through shaft and housing acts on a rotor held at {100 * eps:.0f} % "
        "of an 11 mm gap; the stiffness is 165 MN/m. Use `PolePairPull`.", (
        number("Mean pull along the displacement.", around(1).mean(), "kN",
               (1, "mean over a turn"), rtol=0.005),
        number("Size of its pulsation at twice the electrical frequency.", beat[1], "kN",
               (2, "about ½ k d"), rtol=0.01),
        number(f"The same with {p} pole pairs.", beat[p], "kN",
               (1, "of the order ε^(2p − 1): far less"), rtol=0.02),
        number("The one pair again, with its net flux blocked (`flux_share=0.0`): mean pull.",
               mean_blocked, "kN", (1, "about half as much; the beat is nearly gone"), rtol=0.005),
        reasons("What decides which share of the net flux passes in a machine?",
                (1, "the reluctance of its way back, through shaft, bearings and frame"))))


def two_records(draw: Random) -> Problem:
    """Unbalance or offset from two readings."""
    heavy, late = draw.choice((1.8, 2.0, 2.2)), draw.choice((0.075, 0.08))
    a, b = steady(0.0, heavy), steady(late)
    size = {"A": 1e6 * a.amplitudes, "B": 1e6 * b.amplitudes}
    lines = [f"{name}: mean {1e6 * orbit.mean[0] + 0.0:.0f} µm in x; 1X {size[name][0, 0]:.0f} "
             f"and {size[name][1, 0]:.0f} µm; 2X {size[name][0, 1]:.1f} and "
             f"{size[name][1, 1]:.1f} µm" for name, orbit in (("A", a), ("B", b))]
    faults = ("unbalance", "static eccentricity", "oval gap", "soft bearing")
    flip = draw.random() < 0.5
    order = {"A": lines[0], "B": lines[1]} if not flip else {
        "A": lines[1].replace("B:", "A:"), "B": lines[0].replace("A:", "B:")}
    return Problem("Two records", (12,), 30, "At the generators' centres of two machines of one "
        "type, at 150 rpm, x and z, 0-to-peak:\n\n- " + "\n- ".join(order.values()), (
        word("Which fault has A?", faults[flip], faults, (1, "mean, axes and 2X together")),
        word("And B?", faults[not flip], faults, (1, "the same")),
        number("Peak-to-peak of the larger 1X in x.",
               2 * max(size["A"][0, 0], size["B"][0, 0]), "µm", (1, "twice the amplitude"),
               rtol=0.005),
        reasons("Give for each one piece of evidence against each of the other faults.",
                (2, "round and centred: no offset, no oval; a mean and unequal axes: no unbalance; "
                    "a soft bearing moves the bearing's share")),
        reasons("Which further measurement would you ask for, and what would change your mind?",
                (1, "run with less field or none"), (1, "2X alone would not do"))))


def three_ways_to_say_it(draw: Random) -> Problem:
    """rms, peak, peak-to-peak; displacement and velocity."""
    p2p, n = draw.randint(18, 30) * 10, draw.choice((125, 150, 214))
    sensor = draw.choice((4, 5))
    return Problem("Three ways to say it", (12,), 15, f"A probe shows a pure 1X of {p2p} µm peak "
        f"to peak at {n} rpm. Its housing has a velocity sensor, good from {sensor} Hz on.", (
        number("Amplitude, 0-to-peak.", p2p / 2, "µm", (1, "a half")),
        number("Its rms value.", p2p / 2 / math.sqrt(2), "µm", (1, "over √2")),
        number("The velocity, rms, if the housing moved as the shaft does.",
               p2p / 2e3 / math.sqrt(2) * rpm(n), "mm/s", (2, "times Ω in rad/s")),
        word("Can the velocity sensor be trusted for 1X?", "yes" if n / 60 > sensor else "no",
             ("yes", "no"), (1, "1X is n/60 Hz, against its limit")),
        reasons("Two reports give 0.15 mm for the same unit; one is right. What do you ask first?",
                (1, "peak, peak-to-peak or rms; where, and over which band"))))


def what_the_field_adds(draw: Random) -> Problem:
    """Vectors with and without field."""
    off, on = draw.randint(8, 14) * 10, draw.randint(18, 26) * 10
    turn = draw.choice((-25, -40))
    change = cmath.rect(on, math.radians(turn)) - off
    late = draw.choice((0.04, 0.06))
    pulled = abs(steady(late).mean[0]) * 1e6
    return Problem("What the field adds", (12,), 25, f"1X of a generator is {off} µm at 0° without "
        f"field and {on} µm at {turn}° with it.", (
        number("How large is what the field adds?", abs(change), "µm",
               (2, "difference of vectors"), mistakes={
                   on - off: "Subtract vectors, not their lengths."}),
        number("At which phase, from −180° to 180°?", math.degrees(cmath.phase(change)), "°",
               (1, "phase of the difference"), rtol=0.02),
        number(f"On `kaplan-150rpm` at {100 * late:.0f} % eccentricity: how far does switching on "
               "the field draw the mean of the generator (4 harmonics)?", pulled, "µm",
               (1, "a run with and without; without field the mean is zero")),
        reasons("May what the field adds be called a magnetic force at 1X?",
                (1, "not by itself: the field also lowers the stiffness, and the same unbalance "
                    "then makes more"), (1, "how to tell: an orbit out of round, a mean"))))


def an_unknown_machine(draw: Random) -> Problem:
    """One of the numbered machines."""
    k = draw.randint(1000, 9999)
    fault, found, before = condition_of(k)[0], evidence(unknown_machine(k)), evidence(healthy())
    return Problem("An unknown machine", (12,), 30, f"Take `unknown_machine({k})`, and `healthy()` "
        "for the same unit as it was put into service.", (
        number("By how much does the field draw the mean?", 1e6 * found.pulled, "µm",
               (1, "difference of the means"), rtol=0.03),
        number("1X at the generator without field, over what it was in service.",
               found.first_off / before.first_off, "", (1, "a ratio"), rtol=0.03),
        number("Ratio of the axes of 1X, with field.", found.roundness, "", (1, "short over long"),
               rtol=0.03),
        word("Which fault is it?", fault, FAULTS, (2, "the rule of chapter 12")),
        reasons("Which other fault comes nearest, and which reading excludes it?",
                (1, "named"), (1, "with the reading's size against its noise"))))


PROBLEMS = (two_steps, both_wrong, reading_an_orbit, warned_by_a_root, up_and_down,
            shapes_that_pull, turning_shapes, beat_of_the_poles, two_records, three_ways_to_say_it,
            what_the_field_adds, an_unknown_machine)
