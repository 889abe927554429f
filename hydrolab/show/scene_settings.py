"""What can be set in the 3D machine, and what of it is accepted."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hydrolab.errors import BadInput


@dataclass(frozen=True)
class SceneSettings:
    """What the 3D machine shows.

    static_eccentricity: fraction of the gap. leg: of the branch, 0 is the first. field, unbalance: factors on the card's.
    exaggeration: of displacements and gap. slow_motion: how many times slower than the machine. view: the first view.
    """

    static_eccentricity: float = 0.0
    leg: int = 0
    field: float = 1.0
    unbalance: float = 1.0
    exaggeration: float = 50.0
    slow_motion: float = 8.0
    playing: bool = True
    names: bool = True
    dark: bool = False
    view: str = "machine"

    @property
    def solved_for(self) -> tuple[float, int, float, float]:
        """The settings on which the orbit depends."""
        return self.static_eccentricity, self.leg, self.field, self.unbalance


def changed(settings: SceneSettings, wanted: Mapping[str, Any], limits: Mapping[str, tuple[float, float]],
            views: Collection[str], legs: int) -> SceneSettings:
    """Settings with what is wanted, numbers clamped to their limits and the leg to the `legs` there are.

    Raises BadInput for a name that is no setting or a value of another kind.
    """
    return replace(settings, **{name: _accepted(settings, name, value, limits, views, legs)
                                for name, value in wanted.items()})


def _accepted(settings: SceneSettings, name: str, value: Any, limits: Mapping[str, tuple[float, float]],
              views: Collection[str], legs: int) -> Any:
    own = vars(settings).get(name)
    if own is None:
        raise BadInput(f"{name!r} is no setting of the 3D view; there are {', '.join(vars(settings))}.")
    if isinstance(own, str):
        if not isinstance(value, str) or value not in views:
            raise BadInput(f"{name} is {value!r}; there are {', '.join(views)}.")
        return value
    if isinstance(own, bool):
        if not isinstance(value, bool | np.bool_):
            raise BadInput(f"{name} is {value!r}; it must be true or false.")
        return bool(value)
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | float | np.number) or not math.isfinite(value):
        raise BadInput(f"{name} is {value!r}; it must be a finite number.")
    if isinstance(own, int):
        if value != int(value):
            raise BadInput(f"{name} is {value!r}; it must be a whole number.")
        return int(np.clip(value, 0, max(legs, 1) - 1))
    return float(np.clip(value, *limits[name]))
