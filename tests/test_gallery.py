"""Every script of the gallery runs as its reader runs it, in a folder of its own, and ends with
what it found.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = sorted((ROOT / "book" / "gallery").glob("*.py"))
MOST = 120  # lines: a page or two


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_script(script, tmp_path):
    text = script.read_text(encoding="utf-8")
    assert text.startswith('"""') and len(text.splitlines()) <= MOST, f"{script.name} is no page with a docstring"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run([sys.executable, "-W", "error", str(script)], cwd=tmp_path,
                          env=environment, capture_output=True,
                          text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    said = [line for line in done.stdout.splitlines() if line]
    finding, *_, missing = said
    assert finding.startswith("Finding: ") and any(c.isdigit() for c in finding), finding
    assert missing.startswith("Not reproduced: ") and missing.endswith("."), missing
    assert "nan" not in done.stdout.split()


def test_there_are_scripts():
    assert SCRIPTS
