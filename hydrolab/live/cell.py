"""The machine in 3D in a notebook's cell: `show(machine)`, `show(orbit)` or `show(branch)`."""

from __future__ import annotations

import html
import importlib.util
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from viser import ViserServer

from hydrolab.dynamics.branches import Branch
from hydrolab.dynamics.harmonic_balance import Condensed
from hydrolab.dynamics.results import PeriodicOrbit
from hydrolab.errors import BadInput
from hydrolab.figures.readings import reading
from hydrolab.live.panel import Controls
from hydrolab.live.scene import MachineScene
from hydrolab.live.server import open_server, page_address, stop_with_server
from hydrolab.machine.cards import load_machine, vary
from hydrolab.machine.model import ARRAYS
from hydrolab.machine.parts import Machine

NEAR = 2e-3  # of the gap; farther from the steady state of every leg, an orbit is on none
ELSEWHERE = {"COLAB_RELEASE_TAG": "on Google Colab", "KAGGLE_KERNEL_RUN_TYPE": "on Kaggle",
             "CODESPACES": "in a Codespace", "SSH_CONNECTION": "on a computer reached over SSH"}


def frame_address(server: ViserServer) -> str:
    """Where a notebook's page finds the 3D server: on this computer, or behind a hub through
    jupyter-server-proxy.
    """
    prefix = os.environ.get("JUPYTERHUB_SERVICE_PREFIX")
    return f"{prefix.rstrip('/')}/proxy/{server.get_port()}/" if prefix else page_address(server)


@dataclass(frozen=True, repr=False)
class MachineView:
    """A 3D view in a cell. Its plain text is its reading, which a stored notebook keeps; the frame
    lives with the kernel.
    """

    reading: str
    address: str
    height: int

    def _repr_mimebundle_(self, include: Any = None, exclude: Any = None) -> dict[str, Any]:
        from ipywidgets import HTML

        words = html.escape(self.reading, quote=True)
        widget = HTML(f'<iframe src="{html.escape(self.address, quote=True)}" title="{words}" '
                      f'style="width: 100%; height: {self.height}px; border: 0"></iframe>{_hint()}')
        return widget._repr_mimebundle_() | {"text/plain": self.reading}

    def __repr__(self) -> str:
        return self.reading


def _hint() -> str:
    """Where the frame may stay empty, say why and what to do."""
    if "JUPYTERHUB_SERVICE_PREFIX" not in os.environ:
        place = next((name for sign, name in ELSEWHERE.items() if sign in os.environ), None)
        return "" if place is None else (
            f"<div>This Python runs {place}, whose 127.0.0.1 is not your computer's. If the frame "
            "stays empty, write a recording there and download it: <code>!hydrolab show --record "
            "machine.html</code></div>")
    if importlib.util.find_spec("jupyter_server_proxy"):
        return ""
    return ("<div>On a hub the 3D view needs jupyter-server-proxy: pip install 'hydrolab[hub]', "
            "then restart the server.</div>")


def show(what: Machine | PeriodicOrbit | Branch, machine: Machine | None = None, *,
         height: int = 560) -> MachineView:
    """Show a machine, an orbit or a branch in 3D in the cell, with controls. An earlier view of
    this notebook shows it too.

    machine: what the orbit or the branch is of; by default the shipped card of that name. height:
    pixels. Raises BadInput where the machine is not known, the branch is along another parameter,
    or a period is longer than a revolution.
    """
    if isinstance(height, bool) or not isinstance(height, int) or not 100 <= height <= 4000:
        raise BadInput(f"height is {height!r}; give whole pixels from 100 to 4000.")
    if not isinstance(what, Machine | PeriodicOrbit | Branch):
        raise BadInput(f"A {type(what).__name__} cannot be shown in 3D; give a machine, an orbit "
                       "or a branch.")
    if not isinstance(what, Machine):
        machine = _machine_of(what.equations, machine)
    branch, first = None, {}
    if isinstance(what, Machine):
        machine = what
    elif isinstance(what, Branch):
        branch = what
        _check_branch(branch)
    else:
        if abs(what.centre[1]) > 1e-12:
            raise BadInput("The stator of this orbit is not off centre along x; the 3D view shows "
                           "offsets along x.")
        first = {"static_eccentricity": what.static_eccentricity}
    server = open_server(label=machine.name)
    scene = MachineScene(server, machine, branch, **first)
    stop_with_server(scene.stop)
    if isinstance(what, PeriodicOrbit):
        scene.change(leg=_leg_of(what, scene))
    Controls(server, scene)
    scene.run()
    return MachineView(scene.reading if isinstance(what, Machine) else reading(what),
                       frame_address(server), height)


def _check_branch(branch: Branch) -> None:
    """Raise BadInput for a branch that the sliders of the 3D view cannot move along."""
    along = branch.parameter == "static_eccentricity" and abs(branch.direction[1]) < 1e-9
    if not along or branch.values[0] != 0:
        raise BadInput("This branch does not begin at static_eccentricity 0, along x; show one "
                       "that does, or one of its orbits.")


def _machine_of(equations: Condensed, machine: Machine | None) -> Machine:
    """The machine of a result, turning at the result's speed.

    Raises BadInput where it is not the one given, or not the shipped card of that name.
    """
    model = equations.model
    if equations.revolutions > 1:
        raise BadInput(f"This motion repeats every {equations.revolutions} revolutions; the 3D "
                       "view shows motions of one.")
    try:
        machine = machine or load_machine(model.name)
    except BadInput:
        raise BadInput(f"Which machine is {model.name!r}? Give it as well: "
                       "show(result, machine).") from None
    own = machine.model()
    same = all(np.array_equal(getattr(own, name), getattr(model, name))
               for name in ARRAYS)
    if not same or own.gap != model.gap or repr(own.law) != repr(model.law):
        raise BadInput(f"This result is not of {machine.name} as it stands in its card; give the "
                       "machine that it is of: show(result, machine).")
    return vary(machine, {"speed": equations.speed})


def _leg_of(orbit: PeriodicOrbit, scene: MachineScene) -> int:
    """The leg of the branch that an orbit is on: where the steady state at its eccentricity is
    nearest.

    Raises BadInput where none is near.
    """
    legs = scene.live.legs
    if legs is None:
        return 0
    found = {i: there for i in range(len(legs.all))
             if (there := legs.orbit(orbit.static_eccentricity, i)) is not None}
    columns = min(orbit.coefficients.shape[1], 2 * scene.live.balance.harmonics + 1)
    away = {i: np.abs(there.coefficients[:, :columns] - orbit.coefficients[:, :columns]).max()
            for i, there in found.items()}
    leg = min(away, key=away.get, default=0)
    if not away or away[leg] > NEAR * orbit.model.length_scale:
        raise BadInput(f"This steady state at {100 * orbit.static_eccentricity:.4g} % is not on "
                       "the branch that begins at the centre, and the 3D view shows that branch.")
    return leg
