"""Every script of the gallery runs as its reader runs it, in a folder of its own, and ends with
what it found: one number of each is held here, from print or another method where there is one.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = {path.stem: path for path in sorted((ROOT / "book" / "gallery").glob("*.py"))}
MOST = 170  # lines: a page or two of text, a page of code
# By script: where its finding says the number, the number, how far it may be off.
FOUND = {
    "breathing_crack": (r"peaks at ([\d.]+) rpm", 142.5, 0.5),  # half the natural frequency
    "design_practice": (r"fold at ([\d.]+) %", 8.925, 0.01),  # of the branch, chapter 8
    "few_pole_pairs": (r"power [\d.]+, [\d.]+, ([\d.]+)", 5, 0.02),  # 2p − 1
    "field_wave": (r"2.5 X with ([\d.]+)", 8.25, 0.02),  # by integration
    "guide_clearance": (r"2X is ([\d.]+)", 78, 1),
    "journal_film": (r"eccentricity of ([\d.]+)", 0.756, 0.001),  # Holmes 1960
    "loads_that_stand": (r"makes ([\d.]+) µm of 2X", 1.36, 0.01),  # DOP853 does too
    "kaplan_family": (r"are ([\d.]+) µm off their file", 0, 2),
    "rigid_rotor": (r"stands up to ([\d.]+)", 12.3, 0.1),
    "shapes": (r"with ([\d.]+) kN", 0.272, 0.005),  # 3/2 k g0 of 1 % times 1 %
    "tangential_pull": (r"by the formula and ([\d.]+)", 2.0401, 1e-4),  # c ω/k_r
    "three_units": (r"magnetic pull, and ([\d.]+) %", 3.2, 0.05),  # from the modes at each speed
    "two_pole_instability": (r"([\d.]+) rpm by Floquet", 2405.124, 1e-3),  # the turning frame
    "which_fault": (r"([\d.]+) µm with loose pads", 90.2, 0.5),
}


@pytest.mark.parametrize("name", SCRIPTS)
def test_script(name, tmp_path):
    text = SCRIPTS[name].read_text(encoding="utf-8")
    assert re.match(r'r?"""', text) and len(text.splitlines()) <= MOST, f"{name} is no page"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-W", "error", str(SCRIPTS[name])], cwd=tmp_path,
                          env=environment, capture_output=True, text=True, timeout=120,
                          check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    finding, *_, missing = [line for line in done.stdout.splitlines() if line]
    assert finding.startswith("Finding: ")
    where, value, off = FOUND[name]
    assert float(re.search(where, finding)[1]) == pytest.approx(value, abs=off), finding
    assert missing.startswith("Not reproduced: ") and missing.endswith("."), missing
    assert "nan" not in done.stdout.split()


def test_every_script_has_its_number():
    assert set(FOUND) == set(SCRIPTS)
