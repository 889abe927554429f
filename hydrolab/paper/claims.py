"""The paper's claims, each with a numeric criterion, what was measured, and a verdict.

The criteria were fixed before the family of machines was run, and nothing here is tuned to a
machine. Amplitudes are 0-to-peak at the generator centre; "along" is the direction of the static
eccentricity (x), "across" is z. Percentages are the paper's; `Study.eccentricity` says what they
stand for on another machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hydrolab.dynamics.following import Arclength, follow
from hydrolab.dynamics.harmonic_balance import HarmonicBalance
from hydrolab.dynamics.harmonics import PERIOD, ellipse, self_crossings
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.paper.study import REPEATED, REPEATS, Study, stress_fluctuation


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, its criterion, the numbers measured in words, and whether it holds.

    holds: None where an interrupt left nothing to judge it by.
    """

    id: int
    claim: str
    criterion: str
    measured: str
    holds: bool | None

    @property
    def verdict(self) -> str:
        """In words."""
        return {True: "holds", False: "fails", None: "not judged"}[self.holds]


Told = tuple[str, str, str, Any]  # claim, criterion, what was measured, and whether it holds


def _first(orbit: PeriodicOrbit, harmonic: int = 1) -> float:
    """Amplitude of a harmonic along the eccentricity, m."""
    return float(orbit.amplitudes[0, harmonic - 1])


def _agreement(study: Study) -> Told:
    times, path = study.check.last(3)
    orbit = study.orbits[8.8]
    difference = np.abs(path - orbit.positions(study.speed * times)).max(axis=1) / orbit.vibration
    ok = None if study.check.interrupted else study.check.finished and difference.max() <= 0.01
    return (
        "At 8.8 % harmonic balance with four harmonics and direct integration agree, as orbits "
        "and in time.",
        "x(t) and z(t) of the last three periods differ by at most 1 % of the largest vibration",
        f"largest difference {100 * difference[0]:.3f} % in x, {100 * difference[1]:.3f} % in z. "
        f"{study.check.stopped}",
        ok)


def _centre_moves(study: Study) -> Told:
    start, now = study.orbits[0.0], study.orbits[3.0]
    shift = float(np.hypot(*(now.mean - start.mean)))
    change = np.abs(now.amplitudes - start.amplitudes).max()
    growth = abs(_first(now) / _first(start) - 1)
    return (
        "Below 3 to 4 % the static eccentricity mainly shifts the orbit's centre.",
        "from 0 to 3 % the centre moves at least 5 times as far as any harmonic amplitude "
        "changes, 1X changes by at most 10 %, and 2X stays below 5 % of 1X",
        f"the centre moves {1e6 * shift:.0f} µm, no amplitude changes by more than "
        f"{1e6 * change:.1f} µm; 1X along changes by {100 * growth:.1f} %; 2X is "
        f"{100 * now.second_share:.1f} % of 1X",
        shift > 5 * change and growth <= 0.1 and now.second_share < 0.05)


def _becomes_ellipse(study: Study) -> Told:
    early, late = (ellipse(study.orbits[p].coefficients) for p in (1.0, 7.0))
    rest = study.orbits[7.0].second_share
    return (
        "Beyond 3 to 4 % the orbit changes shape; at 7 % it is elliptical.",
        "the 1X ellipse has a ratio of axes of at least 0.98 at 1 % and at most 0.90 at 7 %, with "
        "2X below 10 % of 1X there, so that it is still an ellipse",
        f"ratio of axes {early.ratio:.3f} at 1 %, {late.ratio:.3f} at 7 %; 2X is {100 * rest:.1f} "
        "% of 1X at 7 %",
        early.ratio >= 0.98 and late.ratio <= 0.90 and rest < 0.10)


def _grows_rapidly(study: Study) -> Told:
    o = study.orbits
    rates = []
    for harmonic in (1, 2):
        before = (_first(o[8.0], harmonic) - _first(o[4.0], harmonic)) / 4.0
        beyond = (_first(o[8.9], harmonic) - _first(o[8.0], harmonic)) / 0.9
        rates.append((before, beyond))
    ok = all(beyond > 0 and beyond >= 3 * before for before, beyond in rates)
    words = "; ".join(f"{k}X along grows by {1e6 * a:.1f} µm per % from 4 to 8 % and by "
                      f"{1e6 * b:.1f} from 8 to 8.9 %"
                      for k, (a, b) in enumerate(rates, 1))
    return (
        "Beyond 8 % the amplitudes of the harmonics grow rapidly.",
        "1X and 2X along the eccentricity grow at least 3 times as fast per % from 8 to 8.9 % as "
        "from 4 to 8 %", words, ok)


def _has_loop(study: Study) -> Told:
    crossings = {p: self_crossings(orbit.positions(PERIOD)) for p, orbit in study.orbits.items()}
    last = study.orbits[8.9]
    two = replace(last, local=np.where(np.arange(last.local.shape[1]) <= 4, last.local, 0.0))
    alone = self_crossings(two.positions(PERIOD))
    looped = [f"{p:g} %" for p, n in crossings.items() if n]
    return (
        "As the second harmonic grows the orbit presents a loop.",
        "the orbit at 8.9 % crosses itself, also with mean, 1X and 2X alone, and no orbit below 8 "
        "% does",
        f"crossings at 8.9 %: {crossings[8.9]}, with 1X and 2X alone: {alone}; orbits with a loop: "
        f"{', '.join(looped) or 'none'}; 2X is {100 * last.second_share:.0f} % of 1X at 8.9 %",
        crossings[8.9] > 0 and alone > 0 and not any(n for p, n in crossings.items() if p < 8))


def _motion_beyond(study: Study) -> tuple[str, float | None]:
    """What the motion at 9.0 % does; its size over the 8.9 % orbit's, inf at contact, or None."""
    if study.interrupted or study.beyond is None:
        return "Direct integration at 9.0 % was interrupted.", None
    if not study.beyond.finished:  # contact
        return study.beyond.stopped, math.inf
    path = study.beyond.last(3)[1]
    around = path - path.mean(axis=1)[:, None]
    growth = float(np.hypot(*around).max()) / study.orbits[8.9].vibration
    name = next((f"settles on an orbit of {words}" for n, words in REPEATED.items()
                 if study.beyond.recurrence(n) <= REPEATS), "stays bounded without repeating")
    return (f"Started at 9.0 % on the 8.9 % orbit the motion {name}, {growth:.2f} times as large.",
            growth)


def _leg_in_words(study: Study) -> str:
    """Where the first leg ends, and whether it is stable up to there."""
    limit = f"{100 * study.limit / study.scale:.3f} %"
    turn = f"The branch turns at {limit} (a fold)" if study.branch.folds else (
        "The branch has no fold")
    if study.first_loss is not None:
        return f"{turn}, but is no longer stable from {100 * study.first_loss / study.scale:.2f} %"
    return turn + (", stable up to there" if study.stability_known else
                   "; its stability is not known at every point")


def _states_beyond(study: Study) -> str:
    """The steady states at 9.0 % on the branch, as far as it was followed."""
    if not study.branch.folds:
        end = f"{100 * study.limit / study.scale:.3f} %"
        return f"The branch was followed to {end} and no further."
    there = study.states_beyond
    if not there:
        return "At 9.0 % the branch has no steady state."
    return (f"At 9.0 % the branch, past its folds, has {len(there)} steady "
            f"state{'s' if len(there) > 1 else ''}: {', '.join(there)}; there may be others. That "
            "none was found does not mean that there is none.")


def _nothing_beyond(study: Study) -> Told:
    last = 100 * float(study.natural.static_eccentricity[-1]) / study.scale
    motion, growth = _motion_beyond(study)
    return (
        "Beyond about 8.9 % no steady state is found, and a small increment there means a huge "
        "increase.",
        "the paper's procedure (dog-leg from the last solution, steps of 0.1 %) stops between 8.8 "
        "and 9.0 %, and direct integration at 9.0 % from the 8.9 % orbit ends in contact or in a "
        "vibration at least 1.5 times as large",
        f"the procedure stops after {last:.1f} %. {_leg_in_words(study)}. {motion} "
        f"{_states_beyond(study)}",
        None if growth is None else 8.8 <= round(last, 6) < 9.0 and growth >= 1.5)


def _whole_shaft(study: Study) -> Told:
    sentence = ("The whole shaft behaves so: 1 % shifts it, 5 % bends it more, 7 % makes the "
                "orbits elliptical, at 8.9 % the second harmonic shows on a highly bent shaft.")
    if study.machine.shaft is None:
        return (sentence, "the whole shaft",
                "the machine has no shaft, so there is nothing to judge", False)
    nodes = range(len(study.model.depths))
    o = {p: [study.orbits[p].node_coefficients(n) for n in nodes]
         for p in (0.0, 1.0, 5.0, 7.0, 8.9)}

    circles = sum(abs(ellipse(b).major / ellipse(a).major - 1) <= 0.05
                  for a, b in zip(o[0.0], o[1.0], strict=True))
    bend = [float(np.ptp([np.hypot(*c[:, 0]) for c in o[p]])) for p in (1.0, 5.0)]
    ellipses = sum(ellipse(c).ratio <= 0.9 for c in o[7.0])
    seconds = sum(ellipse(c, 2).major >= 0.05 * ellipse(c).major for c in o[8.9])
    most = len(nodes) // 2 + 1
    return (
        sentence,
        f"at most nodes (at least {most} of {len(nodes)}): 1X within 5 % of its value at 0 % when "
        "at 1 %; ratio of axes at most 0.90 at 7 %; 2X at least 5 % of 1X at 8.9 %; and the mean "
        "bend at 5 % at least 3 times that at 1 %",
        f"1X unchanged at 1 % at {circles} nodes; elliptical at 7 % at {ellipses}; 2X visible at "
        f"8.9 % at {seconds}; mean bend {1e6 * bend[0]:.0f} µm at 1 %, {1e6 * bend[1]:.0f} µm at 5 "
        "%",
        min(circles, ellipses, seconds) >= most and bend[1] >= 3 * bend[0])


def _four_are_enough(study: Study) -> Told:
    worst, moved = 0.0, 0.0
    for harmonics in (8, 16):
        balance = HarmonicBalance(harmonics)
        for p in (8.8, 8.9):
            four = study.orbits[p]
            more = balance.solve(study.model, study.speed, four.static_eccentricity, start=four)
            apart = np.abs(more.positions(PERIOD) - four.positions(PERIOD)).max()
            worst = max(worst, float(apart) / four.vibration)
        if study.branch.folds:
            near = Arclength(balance, max_folds=1, tail=0)
            fold = follow(study.model, speed=study.speed, to=0.5, method=near, start=more).folds
            moved = max(moved, abs(fold[0].value - study.limit) if fold else math.inf)
    return (
        "Four harmonics and the mean are enough to describe the dynamics.",
        "with 8 and with 16 harmonics the orbits at 8.8 and 8.9 % change by at most 1 % of the "
        "largest vibration and the first fold moves by at most 0.01 % of the gap",
        f"orbits change by at most {100 * worst:.4f} %; the fold moves by {100 * moved:.6f} % of "
        "the gap",
        worst <= 0.01 and moved <= 1e-4)


def _can_double(study: Study) -> Told:
    o = study.orbits
    ratio = [_first(o[p]) / _first(o[0.0]) for p in (8.0, 8.8, 8.9)]
    return (
        "The amplitude of the vibrations can be doubled.",
        "1X along the eccentricity, 0-to-peak, is at least twice as large at 8.9 % as at 0 %",
        f"it grows by a factor {ratio[0]:.2f} at 8 %, {ratio[1]:.2f} at 8.8 %, {ratio[2]:.2f} at "
        "8.9 %", ratio[-1] >= 2)


def _sign_for_diagnosis(study: Study) -> Told:
    centred, late = study.orbits[0.0], study.orbits[8.8]
    shares = {p: study.orbits[p].second_share for p in (3.0, 5.0, 7.0, 8.0, 8.8)}
    ratio = ellipse(centred.coefficients).ratio, ellipse(late.coefficients).ratio
    return (
        "With static eccentricity the orbit becomes anisotropic and 2X appears: a sign for "
        "diagnosis.",
        "at 0 % the ratio of axes is at least 0.999 and 2X below 1e-6 of 1X; at 8.8 % the ratio "
        "is at most 0.90 and 2X at least 5 % of 1X",
        f"ratio of axes {ratio[0]:.4f} at 0 %, {ratio[1]:.3f} at 8.8 %; 2X over 1X "
        + ", ".join(f"{100 * s:.1f} % at {p:g} %" for p, s in shares.items()),
        ratio[0] >= 0.999 and centred.second_share < 1e-6 and ratio[1] <= 0.90
        and shares[8.8] >= 0.05)


def _linear_underestimates(study: Study) -> Told:
    gap = study.machine.air_gap
    assert gap is not None  # a study has one
    round_gap = replace(study.machine, air_gap=replace(gap, linear=True), poles=None, shapes=())
    linear = round_gap.model()
    balance = HarmonicBalance(1)
    rows = {}
    for p in (1.0, 3.0, 5.0, 7.0, 8.0, 8.8):
        exact = study.orbits[p]
        guess = balance.solve(linear, study.speed, exact.static_eccentricity)
        rows[p] = (np.hypot(*guess.mean) / np.hypot(*exact.mean), _first(guess) / _first(exact))
    words = ", ".join(f"{p:g} %: {100 * (1 - a):.1f} and {100 * (1 - b):.1f} %"
                      for p, (a, b) in rows.items())
    ok = all(a < 1 and b < 1 for a, b in rows.values()) and min(1 - r for r in rows[8.8]) >= 0.05
    return (
        "The linear negative stiffness underestimates the effect of the pull.",
        "mean displacement and 1X along are smaller with the negative stiffness at every "
        "eccentricity from 1 to 8.8 %, by at least 5 % at 8.8 %",
        f"it is short by (mean and 1X) {words}; and it knows no fold at all", ok)


def _fluctuating_stress(study: Study) -> Told:
    """The conclusion's sentence, which must mean the opposite (see the errata)."""
    shaft = study.machine.shaft
    about = (
        "'When the system works with axisimmetry, there are fluctuating stresses acting on the "
        "shaft.'",
        "in a fibre that turns with the shaft, the bending stress at 0 % (an axisymmetric machine) "
        "fluctuates by at least a tenth of what it does at 8.8 %")
    if shaft is None:
        return *about, "the machine has no shaft, so there is no stress to judge", False
    centred, late = (stress_fluctuation(shaft, study.orbits[p]) for p in (0.0, 8.8))
    holds = centred >= 0.1 * late
    opposite = "; with 'without axisymmetry' in its place it is true" if late > 0 else ""
    return (
        *about,
        f"fluctuation (0-to-peak) {centred / 1e6:.3f} MPa at 0 %, {late / 1e6:.2f} MPa at 8.8 %: "
        f"the sentence as printed is {'true' if holds else f'false{opposite}'}", holds)


CLAIMS: tuple[Callable[[Study], Told], ...] = (
    _agreement, _centre_moves, _becomes_ellipse, _grows_rapidly, _has_loop, _nothing_beyond,
    _whole_shaft, _four_are_enough, _can_double, _sign_for_diagnosis, _linear_underestimates,
    _fluctuating_stress)


def judge(study: Study) -> tuple[Claim, ...]:
    """All twelve claims on a study."""
    told = enumerate((claim(study) for claim in CLAIMS), 1)
    # plain, so that JSON takes it
    return tuple(Claim(number, claim, criterion, measured, None if holds is None else bool(holds))
                 for number, (claim, criterion, measured, holds) in told)
