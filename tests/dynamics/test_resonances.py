"""No resonance is stepped over, wherever a branch starts: against the exact linear response."""

import numpy as np
import pytest

from hydrolab import HarmonicBalance, follow, rpm
from hydrolab.dynamics.following import Arclength
from hydrolab.machine.model import Model
from hydrolab.machine.pull import CircularPull

GAP = 0.011
SEEDS = 100


def rotor(rng, discs, damping):
    """A rotor of one or two point masses on springs and dashpots, without any pull, that shakes by
    far less than its gap.
    """
    n, one = 2 * discs, np.eye(2)
    masses = rng.uniform(0.2, 2.0, discs)
    coupling = 10 ** rng.uniform(-3, 1) if discs == 2 else 0.0
    stiff = np.diag(rng.uniform(0.5, 20.0, discs)) + coupling * (2 * np.eye(discs) - 1)
    if discs == 1:
        stiff = np.array([[rng.uniform(0.5, 20.0)]])
    M, K = np.kron(np.diag(masses), one), np.kron(stiff, one)
    K = K + np.diag(np.tile([0.0, rng.uniform(0, 0.5)], discs))  # unlike in x and z
    # damping ratio of each mode, by the modes of M and K
    squares, shapes = np.linalg.eigh(np.linalg.solve(np.sqrt(M), K) @ np.linalg.inv(np.sqrt(M)))
    modal = shapes * (2 * damping * np.sqrt(squares)) @ shapes.T
    C = np.sqrt(M) @ modal @ np.sqrt(M)
    G = np.kron(np.diag(rng.uniform(0, 0.2, discs)), np.array([[0.0, 1.0], [-1.0, 0.0]]))
    force = np.kron(rng.normal(size=discs), [0.0, 1.0]), np.kron(rng.normal(size=discs), [1.0, 0.0])
    return Model("random", M, C, G, K, force[1], force[0], np.eye(2, n), CircularPull(0.0, GAP),
                 GAP, np.zeros(discs), np.eye(n))


def response(model, speeds):
    """1X of the first disc in x and z, m, (2, speeds): the linear equations solved directly."""
    w = speeds[:, None, None]
    Z = model.K - w**2 * model.M + 1j * w * (model.C + w * model.G)
    force = speeds[:, None]**2 * (model.unbalance_cos - 1j * model.unbalance_sin)
    return np.abs(np.linalg.solve(Z, force[..., None])[:, :2, 0]).T


def peaks(model, low, high):
    """For each maximum of 1X in x or z between two speeds: where it stands above 95 % of itself.

    On a grid that is fine around every eigenvalue; each is (coordinate, from, to).
    """
    n, grid = model.size, [np.linspace(low, high, 4001)]
    for w in np.linspace(low, high, 100):
        A = np.block([[np.zeros((n, n)), np.eye(n)],
                      [-np.linalg.solve(model.M, model.K),
                       -np.linalg.solve(model.M, model.C + w * model.G)]])
        for value in np.linalg.eigvals(A):
            if abs(value.imag - w) < (high - low) / 50:
                grid.append(value.imag - value.real * np.sinh(np.linspace(-9, 9, 401)))
    speeds = np.unique(np.concatenate(grid))
    speeds = speeds[(speeds > low) & (speeds < high)]
    found = []
    for coordinate, row in enumerate(response(model, speeds)):
        for top in np.flatnonzero((row[1:-1] > row[:-2]) & (row[1:-1] >= row[2:])) + 1:
            below = np.flatnonzero(row < 0.95 * row[top])
            left, right = below[below < top], below[below > top]
            found.append((coordinate, speeds[left[-1]] if len(left) else low,
                          speeds[right[0]] if len(right) else high))
    return found


@pytest.mark.parametrize("seed", range(SEEDS))
def test_no_peak_is_missed(seed):
    rng = np.random.default_rng(seed)
    model = rotor(rng, int(rng.integers(1, 3)), 10 ** rng.uniform(-4, 0.5))
    low = 10 ** rng.uniform(-1, 0.6)
    high = low * rng.uniform(1.2, 6.0)
    found = peaks(model, low, high)
    tallest = max(response(model, np.array([low, high, *(f for p in found for f in p[1:])])).max(),
                  1e-9)
    model = model.with_unbalance(10 ** rng.uniform(-9, -4) / tallest)  # far from contact
    begin, to = (low, high) if rng.random() < 0.5 else (high, low)
    branch = follow(model, "speed", to=to, speed=begin,
                    method=Arclength(HarmonicBalance(1), max_points=20000))
    assert "as asked" in branch.stopped
    exact = response(model, branch.values)
    assert branch.amplitudes[:, :, 0].T == pytest.approx(exact, rel=1e-5, abs=1e-9 * exact.max())
    for _, begin, end in found:
        assert ((branch.values > begin) & (branch.values < end)).any()


@pytest.mark.parametrize(("start", "to"), [(200, 700), (50, 700), (395, 405), (700, 200)])
def test_the_resonance_of_a_point_mass(start, to):
    """Damping of 1 %, a peak of 49.38 µm at 400.2 rpm in a gap of 11 mm; steps of 2 % of the gap
    passed it by and saw 10.2 µm.
    """
    own, size, one, none = rpm(400.16), 49.38e-6, np.eye(2), np.zeros((2, 2))
    model = Model("point mass", 1e3 * one, 20.0 * own * one, none, 1e3 * own**2 * one,
                  np.array([20.0 * size, 0.0]), np.array([0.0, 20.0 * size]), one,
                  CircularPull(0.0, GAP), GAP, np.zeros(1), one)
    branch = follow(model, "speed", to=rpm(to), speed=rpm(start))
    tallest = branch.amplitudes[:, 0, 0].argmax()
    assert branch.amplitudes[tallest, 0, 0] == pytest.approx(size, rel=0.02)
    assert branch.values[tallest] == pytest.approx(rpm(400.2), rel=2e-3)
