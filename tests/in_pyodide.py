"""The library's own tests in a browser's Python, Pyodide, run by Node.

    python -m tests.in_pyodide

Those tests that need no file to write, no process and no browser, with the oldest versions that
pyproject.toml admits: Pyodide's own NumPy, SciPy, Matplotlib and Pillow, which are these bounds,
and the packages in Python alone from the registry. With names of test files it runs these.
"""

from __future__ import annotations

import importlib.metadata
import json
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from packaging.version import Version

from tests.pyodide_distribution import distribution

ROOT = Path(__file__).resolve().parents[1]
COMPILED = ("numpy", "scipy", "matplotlib", "pillow")
OLDEST = ("sympy", "threadpoolctl", "tomlkit", "rich", "hypothesis")
AS_HERE = ("pytest", "pluggy", "iniconfig", "sortedcontainers", "attrs", "mpmath",
           "markdown-it-py", "mdurl")
TESTS = ("machine", *(f"dynamics/test_{name}.py" for name in (
    "continuation", "equilibrium", "harmonic_balance", "integrators", "modes", "parameters",
    "reduction", "resonances", "results", "splitting")))
# No processes there, and another LAPACK, to which a matrix is singular a digit later.
LEFT_OUT = "not sympy_is_not_loaded and not process and not do_not_balance"


def bounds() -> dict[str, str]:
    """The oldest version of each package that pyproject.toml admits."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return dict(re.match(r"([\w-]+)>=([\d.]+)", line).groups()
                for line in project["dependencies"] + project["optional-dependencies"]["test"]
                if ">=" in line)


def check_bounds(core: Path) -> None:
    """Compare the bounds of what is compiled with the distribution's versions."""
    lock = json.loads((core / "pyodide-lock.json").read_text(encoding="utf-8"))["packages"]
    for name in COMPILED:
        found = lock[name]["version"]
        assert Version(bounds()[name]) == Version(found), f"{name} is run as {found} there"


def fetch_pure(target: Path) -> None:
    """Put the packages in Python alone into a folder, without what is compiled."""
    wanted = [f"{name}=={bounds()[name]}" for name in OLDEST]
    subprocess.run([sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-compile",
                    "--target", str(target), *wanted], check=True, timeout=120)
    for name in AS_HERE:
        for path in importlib.metadata.distribution(name).files or ():
            if ".." not in path.parts and path.suffix not in (".so", ".pyd", ".pyc"):
                (target / path).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(path.locate(), target / path)


def script(core: Path, pure: Path, tests: list[str]) -> str:
    """What Node runs: Pyodide from its folder, the sources mounted, pytest."""
    arguments = ["-q", "--durations=12", "--capture=sys", "-p", "no:cacheprovider",
                 "-c", "/pure/pytest.ini", "--rootdir=/repo", "--import-mode=importlib",
                 "-k", LEFT_OUT,
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
try {{
  process.exitCode = python.runPython(`
import sys
sys.path[:0] = ["/repo", "/pure"]
sys.dont_write_bytecode = True
import pytest
int(pytest.main({json.dumps(arguments)}))
`);
}} catch (error) {{
  console.error(error.message);
  process.exitCode = 1;
}}
"""


def main(tests: list[str]) -> int:
    """Run the tests; return pytest's exit code, or 0 with a word where there is no Node."""
    node = shutil.which("node")
    if node is None:
        print("Node is not installed: the tests in a browser's Python were not run.")
        return 0
    core = distribution()
    check_bounds(core)
    with tempfile.TemporaryDirectory(prefix="hydrolab-pyodide-") as name:
        pure = Path(name)
        fetch_pure(pure)
        (pure / "pytest.ini").write_text(
            "[pytest]\nfilterwarnings = error\nmarkers =\n    slow: slow\n    browser: Chromium\n",
            encoding="utf-8")
        run = pure / "run.mjs"
        run.write_text(script(core, pure, tests or list(TESTS)), encoding="utf-8")
        return subprocess.run([node, str(run)], check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
