"""The library's own tests in a browser's Python, Pyodide, run by Node.

    python -m tests.in_pyodide

Those tests that need no file to write, no process and no browser. Pyodide's NumPy, SciPy,
Matplotlib and Pillow are older than the versions pinned for a computer: they are the lower bounds
of pyproject.toml. With names of test files it runs these.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.pyodide_distribution import distribution

ROOT = Path(__file__).resolve().parents[1]
PURE = ("pytest", "pluggy", "iniconfig", "hypothesis", "sortedcontainers", "sympy", "mpmath",
        "threadpoolctl", "tomlkit", "rich", "markdown-it-py", "mdurl")
TESTS = ("machine/test_elements.py", "machine/test_forces.py", "machine/test_gap_laws.py",
         "machine/test_model.py", "machine/test_parts.py", "machine/test_cards.py",
         "machine/test_model_numbers.py", "dynamics/test_harmonic_balance.py",
         "dynamics/test_continuation.py", "dynamics/test_modes.py", "dynamics/test_equilibrium.py",
         "dynamics/test_parameters.py")
# No processes there, and a time limit of its own.
LEFT_OUT = "not sympy_is_not_loaded and not process"


def copy_pure(target: Path) -> None:
    """Copy the packages in Python alone that the tests need, without what is compiled."""
    for name in PURE:
        for path in importlib.metadata.distribution(name).files or ():
            if ".." not in path.parts and path.suffix not in (".so", ".pyd", ".pyc"):
                (target / path).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path.locate(), target / path)


def script(core: Path, pure: Path, tests: list[str]) -> str:
    """What Node runs: Pyodide from its folder, the sources mounted, pytest."""
    arguments = ["-q", "--capture=sys", "-p", "no:cacheprovider", "-c", "/pure/pytest.ini",
                 "--rootdir=/repo", "--import-mode=importlib", "-k", LEFT_OUT,
                 *(f"/repo/tests/{name}" for name in tests)]
    return f"""
import {{ loadPyodide }} from {json.dumps((core / "pyodide.mjs").as_uri())};
const python = await loadPyodide({{ indexURL: {json.dumps(f"{core}/")} }});
await python.loadPackage(["numpy", "scipy", "matplotlib", "pillow", "packaging", "pygments"],
                         {{ messageCallback: () => {{}} }});
for (const [place, root] of {json.dumps([["/repo", str(ROOT)], ["/pure", str(pure)]])}) {{
  python.FS.mkdirTree(place);
  python.FS.mount(python.FS.filesystems.NODEFS, {{ root }}, place);
}}
process.exitCode = python.runPython(`
import sys
sys.path[:0] = ["/repo", "/pure"]
sys.dont_write_bytecode = True
import pytest
int(pytest.main({json.dumps(arguments)}))
`);
"""


def main(tests: list[str]) -> int:
    """Run the tests; return pytest's exit code, or 0 with a word where there is no Node."""
    node = shutil.which("node")
    if node is None:
        print("Node is not installed: the tests in a browser's Python were not run.")
        return 0
    with tempfile.TemporaryDirectory(prefix="hydrolab-pyodide-") as name:
        pure = Path(name)
        copy_pure(pure)
        (pure / "pytest.ini").write_text(
            "[pytest]\nfilterwarnings = error\nmarkers =\n    slow: slow\n    browser: Chromium\n",
            encoding="utf-8")
        run = pure / "run.mjs"
        run.write_text(script(distribution(), pure, tests or list(TESTS)), encoding="utf-8")
        return subprocess.run([node, str(run)], check=False, env=os.environ).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
