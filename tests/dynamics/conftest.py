"""The shipped unit and its branch, once for all tests of a process."""

import pytest

from hydrolab import Arclength, HarmonicBalance, follow, load_machine


@pytest.fixture(scope="session")
def shipped():
    return load_machine("kaplan-150rpm").model()


@pytest.fixture(scope="session")
def branch(shipped, speed):
    """From 0 % over its five folds back to 0 %; a file may follow another."""
    return follow(shipped, speed=speed, method=Arclength(HarmonicBalance(8)))
