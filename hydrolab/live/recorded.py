"""`show` in a browser's Python, where no server can run: the nearest of the scenes that were
recorded when the course was built.
"""

from __future__ import annotations

import html
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.figures.readings import reading
from hydrolab.machine.parts import Machine

RECORDED = Path(__file__).with_name("recorded.json")  # only in a course built for a browser
PLAYER = "/scenes/player.html"  # in the site


@dataclass(frozen=True, repr=False)
class RecordedView:
    """A recorded scene in a cell. Its plain text is the reading of what was asked for."""

    reading: str
    scene: dict[str, Any]
    height: int

    def _repr_html_(self) -> str:
        words = html.escape(self.scene["reading"], quote=True)
        return (f'<iframe src="{_site()}{PLAYER}#{self.scene["name"]}" title="{words}" '
                f'style="width: 100%; height: {self.height}px; border: 0"></iframe>'
                f"<div>This is a recording, the nearest there is: {words} Where Python runs on a "
                "computer, <code>show</code> opens the live machine.</div>")

    def __repr__(self) -> str:
        return self.reading


def show(what: Machine | PeriodicOrbit | Branch, machine: Machine | None = None, *,
         height: int = 560) -> RecordedView:
    """Show the recorded scene that is nearest to a machine at rest in its stator's middle, to an
    orbit, or to a branch's last orbit; the cell says which it is.

    machine: as in the live `show`, and not needed here. height: pixels. Raises BadInput where
    nothing is recorded of that machine.
    """
    if not isinstance(what, Machine | PeriodicOrbit | Branch):
        raise BadInput(f"A {type(what).__name__} cannot be shown in 3D; give a machine, an orbit "
                       "or a branch.")
    name = what.name if isinstance(what, Machine) else what.equations.model.name
    scenes = [scene for scene in json.loads(RECORDED.read_text(encoding="utf-8"))
              if scene["machine"] == name]
    if not scenes:
        raise BadInput(f"No scene of {name} is recorded, and a browser's Python can open none; "
                       "on a computer `show` opens it.")
    if isinstance(what, Machine):
        scene = min(scenes, key=lambda scene: scene["static_eccentricity"])
        return RecordedView(scene["reading"], scene, height)
    return RecordedView(reading(what), nearest(what, scenes), height)


def nearest(what: PeriodicOrbit | Branch, scenes: list[dict[str, Any]]) -> dict[str, Any]:
    """Of some scenes that whose eccentricity and mean place, in gaps, are nearest to an orbit's."""
    orbit = what[-1] if isinstance(what, Branch) else what
    place = np.array([orbit.static_eccentricity, *(orbit.mean / orbit.model.gap)])
    return min(scenes, key=lambda scene: float(np.linalg.norm(
        place - [scene["static_eccentricity"], *scene["mean"]])))


def _site() -> str:
    """Address of the site from which this Python came: a notebook looks for a relative one among
    its own files.
    """
    from js import location
    return str(location.href).partition("/extensions/")[0]
