"""The gallery's scripts as modules: what stands above their `main` can be tested by itself."""

import importlib.util
from pathlib import Path

import pytest

GALLERY = Path(__file__).resolve().parents[2] / "book" / "gallery"


@pytest.fixture(scope="module")
def script(request):
    """The script that a test module is named after."""
    name = request.module.__name__.rpartition("test_")[2]
    spec = importlib.util.spec_from_file_location(name, GALLERY / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
