"""Make the records of the unit that nobody knows, chapter 14's capstone:
python -m tests.course.unknown_unit writes them anew; its test compares them with what is shipped.

What the unit is like follows from the seed by a hash, so that no number of it stands anywhere.
"""

from __future__ import annotations

import hashlib
import math
from pathlib import Path

import numpy as np

from hydrolab import HarmonicBalance, load_machine, made_up_record, vary
from hydrolab.dynamics.harmonics import fourier_rows
from hydrolab.dynamics.probes import ProbeRecord

SEED = 1415
FOLDER = Path(__file__).resolve().parents[2] / "hydrolab" / "course" / "unknown-unit"
PLACES = ("generator", "generator guide bearing", "turbine guide bearing")
NOISE = 3e-6  # m rms
RANGES = {"bodies.generator.unbalance": (95.0, 140.0), "bodies.generator.phase": (0.0, 2 * math.pi),
          "static_eccentricity": (0.03, 0.06), "direction": (0.0, 2 * math.pi),
          "bearings.generator guide bearing.stiffness": (1.05e9, 1.2e9)}


def draws(what: str) -> np.ndarray:
    """32 numbers from 0 to 1 of the seed."""
    digest = hashlib.sha256(f"hydrolab {what} {SEED}".encode()).digest()
    return np.frombuffer(digest, dtype=np.uint8) / 255


def truth() -> dict[str, float]:
    """The unit's numbers that differ from those of the card."""
    return {key: low + float(u) * (high - low)
            for (key, (low, high)), u in zip(RANGES.items(), draws("unit"), strict=False)}


def run_out(record: ProbeRecord) -> np.ndarray:
    """What the shaft's surface adds to each probe, m, (probes, N): 1X to 3X of some micrometres."""
    sizes = draws("run-out")[:24].reshape(6, 4) * [12e-6, 6e-6, 2e-6, 0]
    rows = fourier_rows(3, record.phase)
    angle = 2 * math.pi * draws("angles")[:6, None] * np.arange(1, 4)
    return np.cos(angle) * sizes[:, :3] @ rows[2::2] + np.sin(angle) * sizes[:, :3] @ rows[1::2]


def text(record: ProbeRecord, bare: bool) -> str:
    """A record as a CSV of a plant: semicolons, decimal commas, 0.1 µm; bare: run-out alone."""
    readings = 1e6 * (run_out(record) + (0 if bare else 1)
                      * np.array([probe.samples for probe in record.probes]))
    if bare:
        readings += np.random.default_rng(SEED).normal(0, 1e6 * NOISE, readings.shape)
    gaps = 1000 + 200 * draws("gaps")[:6]  # of each probe, µm
    head = ["phase [deg]", "speed [rpm]", *(f"{p.name} [µm]" for p in record.probes)]
    speed = 12 if bare else record.speed * 30 / math.pi
    lines = [";".join(head)]
    for phase, row in zip(np.degrees(record.phase) % 360, readings.T, strict=True):
        cells = [f"{phase:.1f}", f"{speed:.1f}", *(f"{u:.1f}" for u in gaps + row)]
        lines.append(";".join(cells).replace(".", ","))
    return "\n".join(lines) + "\n"


def files() -> dict[str, str]:
    """The three records by name."""
    numbers = truth()
    unit = vary(load_machine("kaplan-150rpm"),
                {key: value for key, value in numbers.items() if "." in key})
    found = {}
    for name, field, revolutions in (("with-field", 1.0, 12), ("without-field", 0.0, 12),
                                     ("slow-roll", 0.0, 6)):
        orbit = HarmonicBalance(6).solve(unit.model().with_field(field), unit.speed,
                                         numbers["static_eccentricity"],
                                         direction=numbers["direction"])
        record = made_up_record(orbit, PLACES, noise=NOISE, seed=SEED + int(field), field=field,
                                revolutions=revolutions, samples=40)
        found[name] = text(record, name == "slow-roll")
    return found


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, content in files().items():
        (FOLDER / f"{name}.csv").write_text(content, encoding="utf-8", newline="\n")
