"""Solids of the 3D machine as vertices (V, 3) and triangles (F, 3), Z up, in metres.

Lengths in m, angles in rad. Here height, low, high: along Z. inner, outer, radius: from the axis.
width, thickness: across. angle, start, end: about Z from X. steps, sides: how many faces a curve
has.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Solid = tuple[NDArray, NDArray]


def joined(*solids: Solid) -> Solid:
    """Several solids as one."""
    vertices, faces = zip(*solids, strict=True)
    starts = np.cumsum([0, *map(len, vertices[:-1])])
    return (np.concatenate(vertices),
            np.concatenate([own + start for own, start in zip(faces, starts, strict=True)]))


def raised(solid: Solid, height: float) -> Solid:
    """A solid moved up."""
    return solid[0] + [0.0, 0.0, height], solid[1]


def turned(solid: Solid, angle: float) -> Solid:
    """A solid turned about Z, rad."""
    c, s = math.cos(angle), math.sin(angle)
    return solid[0] @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), solid[1]


def widened(solid: Solid, inner: float, by: Callable[[NDArray], NDArray]) -> Solid:
    """A solid with the radius of what lies at `inner` or beyond larger by `by(angle about Z)`."""
    (x, y, z), faces = solid[0].T, solid[1]
    radius = np.hypot(x, y)
    share = np.where(radius >= inner, 1 + by(np.arctan2(y, x)) / np.maximum(radius, inner), 1.0)
    return np.stack([share * x, share * y, z], axis=1), faces


def swept(outline: NDArray, start: float = 0.0, end: float = 2 * math.pi, steps: int = 72) -> Solid:
    """A closed outline of (radius, height), (N, 2), run counter-clockwise, swept about Z; a sector
    gets flat ends.
    """
    whole = end - start > 2 * math.pi - 1e-9
    count, n = steps + (not whole), len(outline)
    angle = start + (end - start) * np.arange(count) / steps
    vertices = np.stack([outline[None, :, 0] * np.cos(angle)[:, None],
                         outline[None, :, 0] * np.sin(angle)[:, None],
                         np.broadcast_to(outline[None, :, 1], (count, n))], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(steps), np.arange(n), indexing="ij")
    a, b = i * n + j, i * n + (j + 1) % n
    c, d = (i + 1) % count * n + j, (i + 1) % count * n + (j + 1) % n
    faces = np.concatenate([np.stack([a, c, d], -1).reshape(-1, 3),
                            np.stack([a, d, b], -1).reshape(-1, 3)])
    if not whole:
        fan = np.array([[0, k, k + 1] for k in range(1, n - 1)])
        faces = np.concatenate([faces, fan, fan[:, ::-1] + (count - 1) * n])
    return vertices, faces


def ring(inner: float, outer: float, low: float, high: float, start: float = 0.0,
         end: float = 2 * math.pi, steps: int = 72) -> Solid:
    """A ring, or a sector of one, of rectangular section."""
    return swept(np.array([[inner, low], [outer, low], [outer, high], [inner, high]]), start, end,
                 steps)


def box(radius: float, depth: float, width: float, low: float, high: float) -> Solid:
    """A block on the X axis from `radius` outwards by `depth`."""
    x, y, z = [radius, radius + depth], [-width / 2, width / 2], [low, high]
    vertices = np.array([[a, b, c] for a in x for b in y for c in z])
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                      [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    return vertices, faces


def blade(inner: float, outer: float, pitch: float = 0.5, thickness: float = 0.06,
          steps: int = 12) -> Solid:
    """A blade of a Kaplan runner on the X axis: a bent plate whose pitch falls outwards."""
    radius = np.linspace(inner, outer, steps)
    across = np.linspace(-0.5, 0.5, steps)
    r, a = np.meshgrid(radius, across, indexing="ij")
    share = (r - inner) / (outer - inner)
    chord = (0.55 + 0.75 * share) * outer * (1 - 0.35 * np.clip(share - 0.8, 0, 1) / 0.2)
    angle = a * chord / r
    height = pitch * (1.3 - 0.7 * share) * a * chord
    middle = np.stack([r * np.cos(angle), r * np.sin(angle), height], -1)
    up = np.array([0, 0, thickness / 2]) * (1 - 0.8 * np.abs(2 * a))[..., None]
    vertices = np.concatenate([(middle + up).reshape(-1, 3), (middle - up).reshape(-1, 3)])
    i, j = np.meshgrid(np.arange(steps - 1), np.arange(steps - 1), indexing="ij")
    p, q, s, t = (x.ravel() for x in (i * steps + j, (i + 1) * steps + j, (i + 1) * steps + j + 1,
                                      i * steps + j + 1))
    top = np.concatenate([np.stack([p, q, s], -1), np.stack([p, s, t], -1)])
    rim = np.concatenate([np.arange(steps), steps * np.arange(1, steps) + steps - 1,
                          steps * (steps - 1) + np.arange(steps - 2, -1, -1),
                          steps * np.arange(steps - 2, 0, -1)])
    after, below = np.roll(rim, -1), steps * steps
    sides = np.concatenate([np.stack([rim, after + below, rim + below], -1),
                            np.stack([rim, after, after + below], -1)])
    return vertices, np.concatenate([top, top[:, ::-1] + below, sides])


def tube(radius: float, low: float, high: float, rings: int, sides: int = 40) -> Solid:
    """A closed cylinder in many rings, so that bones can bend it."""
    angle, z = 2 * np.pi * np.arange(sides) / sides, np.linspace(low, high, rings)
    zz, aa = np.meshgrid(z, angle, indexing="ij")
    vertices = np.stack([radius * np.cos(aa), radius * np.sin(aa), zz], -1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(sides), indexing="ij")
    p, q = i * sides + j, i * sides + (j + 1) % sides
    faces = np.concatenate([np.stack([p, q, q + sides], -1).reshape(-1, 3),
                            np.stack([p, q + sides, p + sides], -1).reshape(-1, 3)])
    fan = np.array([[0, k + 1, k] for k in range(1, sides - 1)])
    return vertices, np.concatenate([faces, fan, fan[:, ::-1] + (rings - 1) * sides])


def hat_weights(height: NDArray, knots: NDArray) -> NDArray:
    """Weights (V, B) of the bones at `knots` (ascending) for points at `height`: linear between
    neighbours.
    """
    return np.stack([np.interp(height, knots, hat) for hat in np.eye(len(knots))], axis=1)
