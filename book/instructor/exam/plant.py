"""Problems on chapters 13 and 14: start, stop and load rejection; from a record to the machine."""

import math
from random import Random

import numpy as np

from hydrolab import rpm
from hydrolab.course.exam import Problem, number, reasons, word


def load_rejection(draw: Random) -> Problem:
    """Overspeed while the gates close."""
    H, closing, n = draw.choice((3.0, 3.5, 4.0)), draw.choice((6.0, 8.0)), draw.choice((125, 150))
    top = math.sqrt(1 + closing / (2 * H))
    return Problem("A breaker opens", (13,), 25, f"A unit at {n} rpm and full power has H = {H} s, "
        f"the stored energy over the power. The breaker opens, and the gates take the water's "
        f"power from full to none in {closing:.0f} s, in a straight line. No losses.", (
        number("At which rate does the speed rise at first?", n / (2 * H), "rpm/s",
               (2, "IΩΩ̇ = P: Ω̇/Ω = 1/2H")),
        number("Which speed is reached?", n * top, "rpm",
               (2, "energy: half of P times the closing time"), mistakes={
                   n * math.sqrt(1 + closing / H): "The power falls on the way: half of it."}),
        number("How much larger is the unbalance force then?", top**2, "", (1, "Ω²")),
        reasons("The field is switched off at once. Which two things change for the rotor?",
                (1, "no pull: its natural frequency rises"),
                (1, "the mean returns to the middle"))))


def slowly_through(draw: Random) -> Problem:
    """Passing a resonance."""
    f, zeta, rate = draw.choice((4.8, 5.5)), draw.choice((0.01, 0.02)), draw.choice((3.0, 6.0))
    width = 2 * zeta * f * 60
    time = width / rate
    decay = 1 / (zeta * 2 * math.pi * f)
    return Problem("Slowly or quickly?", (13,), 20, "A rotor with a critical speed of "
        f"{60 * f:.0f} rpm and {100 * zeta:.0f} % damping is run up by {rate:.0f} rpm a second.", (
        number("How wide is the resonance, between the points of half power?", width, "rpm",
               (2, "2ζ times the critical speed")),
        number("How long is the rotor in it?", time, "s", (1, "width over rate")),
        number("In which time does a disturbance fall to 1/e?", decay, "s", (1, "1/(ζω)")),
        word("Is the peak near the steady one?", "yes" if time > 3 * decay else "no",
             ("yes", "no"), (1, "the stay against the time of build-up: at least three times "
                               "it for “near”")),
        reasons("On the way down the peak is seen at a lower speed than on the way up. Why?",
                (1, "the response lags: it is largest after the critical speed was passed"))))


def two_speeds(draw: Random) -> Problem:
    """Stiffness and unbalance from two speeds."""
    m, k, U = draw.choice((110e3, 150e3)), draw.choice((2.2e8, 2.7e8)), draw.choice((40.0, 55.0))
    r = {n: round(1e6 * U * rpm(n)**2 / (k - m * rpm(n)**2), 2) for n in (100, 200)}
    rows = np.array([[r[n] * 1e-6, -rpm(n)**2] for n in r])
    right = np.array([r[n] * 1e-6 * m * rpm(n)**2 for n in r])
    stiff, found = np.linalg.solve(rows, right)
    return Problem("Two speeds, two unknowns", (1, 14), 30, f"A rotor of {m / 1e3:.0f} t without "
        f"field moves by {r[100]} µm at 100 rpm and by {r[200]} µm at 200 rpm, 1X, 0-to-peak, both "
        "in phase with the heavy spot. Damping may be left out.", (
        number("Its stiffness.", stiff / 1e6, "MN/m",
               (2, "r(k − mΩ²) = UΩ² twice: linear in k and U"), rtol=0.02),
        number("Its unbalance.", found, "kg m", (2, "the other unknown"), rtol=0.02),
        number("Its critical speed.", math.sqrt(stiff / m) / rpm(1), "rpm", (1, "√(k/m)"),
               rtol=0.01),
        reasons("The mass is not known. Can all three be had from a third speed?",
                (1, "no: m, k, U scale together; only ratios"),
                (1, "a known trial mass, or a known force, fixes the scale"))))


def how_sure(draw: Random) -> Problem:
    """Uncertainty of a fit."""
    noise, samples = draw.choice((3.0, 5.0)), draw.choice((2048, 4096))
    amplitude, error = noise * math.sqrt(2 / samples), 0.02
    gain = draw.choice((3.4, 5.0))
    return Problem("How sure is it?", (12, 14), 25, f"A record of {samples} samples has noise of "
        f"{noise:.0f} µm rms, independent from sample to sample.", (
        number("Standard error of a harmonic's sine part from a least-squares fit.", amplitude,
               "µm", (2, "σ√(2/N)"), rtol=0.02),
        number("With four times as long a record?", amplitude / 2, "µm", (1, "root of N")),
        number(f"The model says that 1X changes by {gain} % for each per cent of a stiffness. 1X "
               f"is known to {100 * error:.0f} %. To how many per cent is the stiffness?",
               100 * error / gain, "%", (2, "error over sensitivity"), rtol=0.02),
        reasons("Two parameters change 1X in the same proportion at all speeds. What does a fit of "
                "both give?", (1, "a combination only; a singular sensitivity matrix")),
        reasons("The fit is perfect. Is the model right?",
                (1, "no: another parameter may have taken the part; predict a record that was not "
                    "used"))))


PROBLEMS = (load_rejection, slowly_through, two_speeds, how_sure)
