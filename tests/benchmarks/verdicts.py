"""Verdicts on random machines, held against the multipliers of all degrees of freedom.

`python -m tests.benchmarks.verdicts 2000` takes about twenty minutes; a smaller number is in the
tests.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from hydrolab import BadInput, Contact, HarmonicBalance, NoConvergence, floquet
from hydrolab.dynamics.stability import Floquet
from tests.reference.any_machine import all_multipliers, any_model

TELLING = 1e-8  # a largest multiplier nearer to the unit circle than this decides nothing
ROUNDED = 1e6  # rounding of a multiplier larger than this covers those that are small


class Verdict(NamedTuple):
    """What `floquet` says of the machine of a seed, and all its multipliers, largest first."""

    seed: int
    found: Floquet
    multipliers: NDArray

    @property
    def wrong(self) -> bool:
        """Whether the verdict is false; "unknown" never is."""
        truth = "stable" if abs(self.multipliers[0]) < 1 else "unstable"
        return self.found.verdict not in (truth, "unknown")

    @property
    def miscounted(self) -> bool:
        """Whether a known verdict has another number outside the unit circle, or another largest
        modulus than its error allows.
        """
        if self.found.verdict == "unknown" or abs(self.multipliers[0]) > ROUNDED:
            return False
        largest, many = abs(self.multipliers[0]), int(np.sum(np.abs(self.multipliers) > 1))
        away = abs(largest - self.found.largest) - 10 * self.found.error
        return away > 1e-5 * max(1, largest) or not (self.found.growth
                                                     or self.found.outside == many)


def verdicts(seeds: Iterable[int]) -> Iterator[Verdict]:
    """For each random machine that has a steady state and is not on the unit circle; its
    multipliers are those of an orbit of four times the harmonics.
    """
    for seed in seeds:
        try:
            model, speed, eccentricity = any_model(np.random.default_rng(seed))
            orbit = HarmonicBalance(6).solve(model, speed, eccentricity)
            fine = HarmonicBalance(24).solve(model, speed, eccentricity, start=orbit)
        except (BadInput, Contact, NoConvergence):
            continue
        values, known = all_multipliers(fine)
        if abs(abs(values[0]) - 1) > max(10 * known, TELLING):
            yield Verdict(seed, floquet(orbit), values)


def main() -> None:
    """Print what is wrong or unknown, and how many."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("machines", type=int, nargs="?", default=2000)
    count = {"stable": 0, "unstable": 0, "unknown": 0, "wrong": 0, "miscounted": 0}
    with threadpool_limits(1):
        for verdict in verdicts(range(parser.parse_args().machines)):
            count[verdict.found.verdict] += 1
            for fault in ("wrong", "miscounted"):
                if getattr(verdict, fault):
                    count[fault] += 1
                    print(f"{fault}: seed {verdict.seed}: {verdict.found}; on all degrees of "
                          f"freedom {np.abs(verdict.multipliers[:4])}", flush=True)
            if verdict.found.verdict == "unknown":
                print(f"unknown: seed {verdict.seed}: {verdict.found}", flush=True)
    print(", ".join(f"{number} {word}" for word, number in count.items()))


if __name__ == "__main__":
    main()
