"""How often true values lie within their stated 95 %, in 100 made-up records of a unit, and how
often a right model is rejected: python tests/benchmarks/coverage.py [runs].

Four numbers, then five with a bearing; with 3 µm rms of noise in every sample. Each line should say
90 to 99 of 100; a right model is rejected once in a hundred.
"""

import sys
import time

import numpy as np

from hydrolab import HarmonicBalance, identify, load_machine, made_up_record, vary

GUIDE = "bearings.generator guide bearing.stiffness"
TRUE = {"bodies.generator.unbalance": 61.0, "bodies.generator.phase": 2.1,
        "static_eccentricity": 0.045, "direction": 3.9}
PLACES = ["generator", "generator guide bearing", "turbine guide bearing"]


def measure(card: dict[str, float], runs: int) -> None:
    """Print the counts for a unit with these numbers of its card."""
    unit = load_machine("kaplan-150rpm")
    truth = TRUE | card
    model = vary(unit, {key: v for key, v in truth.items() if "." in key}).model()
    orbits = [HarmonicBalance(6).solve(model.with_field(field), unit.speed, 0.045, direction=3.9)
              for field in (1.0, 0.0)]
    away, rejected, seconds = [], 0, []
    for seed in range(runs):
        records = [made_up_record(orbit, PLACES, noise=3e-6, seed=1000 + 2 * seed + i,
                                  field=1.0 - i)
                   for i, orbit in enumerate(orbits)]
        begin = time.perf_counter()
        found = identify(unit, records, list(truth))
        seconds.append(time.perf_counter() - begin)
        away.append([(found.values[key] - v) / found.errors[key] for key, v in truth.items()])
        rejected += found.rejected
    for key, within in zip(truth, (np.abs(away) < 1.96).sum(axis=0), strict=True):
        print(f"{key:45} {within} of {runs} within the stated 95 %")
    print(f"root mean square of error over standard error {np.sqrt(np.mean(np.square(away))):.3f}; "
          f"right model rejected {rejected} times; {np.median(seconds):.2f} s each")


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    measure({}, count)
    measure({GUIDE: 1.2e9}, count)
