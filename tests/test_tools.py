"""The tools of the work on the code that README and environment-notes.md show, each run as it
stands there: whether it runs is asked, on as little as will do.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.chromium import BROWSER

ROOT = Path(__file__).resolve().parents[1]
TO_THE_END = 240  # seconds
# the line of the README's picture, whose words are those of the picture made again
README_PICTURE = next(line.split("](")[0] for line
                      in (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
                      if "eccentricity.png" in line)

# The command as shown: what a test adds to it so that it ends soon, and words of its answer.
TOOLS = {
    "pre-commit install": (["--help"], "install"),  # it would write into .git
    "pytest -n 0 tests/machine -k pads": (["--collect-only", "-q"], "test_"),
    "ruff check": ([], "All checks passed"),
    "mypy": ([], "no issues found"),
    "python -m tests.benchmarks.report": (["--quick", "-k", "test_natural_point or test_arclength"],
                                          "natural point"),
    "python -m tests.benchmarks.slider_latency": (["3"], "ratio"),
    "python -m tests.benchmarks.scene_load --minutes 30": (
        ["--minutes", "0.02", "--viewers", "1", "--seconds", "5"], "soak of 0.02 minutes"),
    "python -m tests.browser_chapters": (["--help"], "--site"),
    "python -m tests.readme_images": (["eccentricity", "--folder", "made"], README_PICTURE),
}
MODULES = {"hydrolab": ["-m", "hydrolab.cli"], "pre-commit": ["-m", "pre_commit"], "python": [],
           **{name: ["-m", name] for name in ("pytest", "ruff", "mypy")}}


def environment() -> dict[str, str]:
    """Of a program that is run: this tree, and one BLAS thread."""
    own = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_XDIST")}
    return own | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "200"}


def ran(command: str, more: list[str], folder: Path) -> str:
    """What a command says, run by this Python, wherever its scripts are; it must succeed."""
    name, *rest = command.split()
    done = subprocess.run([sys.executable, *MODULES[name], *rest, *more], cwd=folder,
                          env=environment(), capture_output=True, text=True, timeout=TO_THE_END,
                          check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return done.stdout + done.stderr


@pytest.mark.parametrize("command", TOOLS)
def test_a_tool_runs(command, tmp_path):
    more, answer = TOOLS[command]
    if "slider_latency" in command and BROWSER is None:
        pytest.skip("no Chromium or Chrome on this computer")
    of_the_tree = command.split()[0] in ("pytest", "ruff", "mypy")
    assert answer in ran(command, more, ROOT if of_the_tree else tmp_path)
