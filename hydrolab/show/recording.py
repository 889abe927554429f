"""The 3D machine as one HTML file that plays without a server and asks no other computer for anything."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from hydrolab.errors import BadInput
from hydrolab.machine.parts import Machine
from hydrolab.show.readings import percent
from hydrolab.show.scene import MachineScene
from hydrolab.show.server import close_server, open_server

FRAMES = 30  # a second
TURNS = 6  # whole turns, so that the end meets the beginning and the loop shows no jump


def record_scene(scene: MachineScene, path: str | Path, turns: int = TURNS, *,
                 progress: Callable[[int, int], None] | None = None) -> Path:
    """Write a scene, as it is set, turning at its slow motion, and return where.

    turns: whole turns, of as many frames as the slow motion takes, then it begins again.
    Raises BadInput for a path that is no .html file or fewer turns than one.
    """
    path = Path(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"path is {str(path)!r}; a recording is an .html file.")
    if isinstance(turns, bool) or not isinstance(turns, int) or turns < 1:
        raise BadInput(f"turns is {turns!r}; it must be a whole number of at least 1.")
    seconds = 2 * math.pi * turns * scene.settings.slow_motion / scene.machine.speed
    frames = max(round(FRAMES * seconds), 8)
    with scene.paused():
        scene.draw(0.0)
        recording = scene.server.get_scene_serializer()
        for frame in range(frames):
            scene.draw(2 * math.pi * turns * frame / frames)
            recording.insert_sleep(seconds / frames)
            if progress:
                progress(frame + 1, frames)
        path.write_text(recording.as_html(dark_mode=scene.settings.dark), encoding="utf-8")
    return path


def record_machine(machine: Machine, path: str | Path, static_eccentricity: float = 0.0, leg: int = 0, *, turns: int = TURNS,
                   progress: Callable[[int, int], None] | None = None) -> str:
    """Write a machine at a static eccentricity (fraction of the gap) on a leg of its branch; return its reading.

    Raises BadInput where there is no such steady state.
    """
    server = open_server(port=0)
    try:
        scene = MachineScene(server, machine)
        check_steady_state(scene, static_eccentricity, leg)
        scene.change(static_eccentricity=static_eccentricity, leg=leg)
        record_scene(scene, path, turns, progress=progress)
        return scene.reading
    finally:
        close_server()


def check_steady_state(scene: MachineScene, static_eccentricity: float, leg: int) -> None:
    """Raise BadInput where the machine has no steady state on that leg (0 is the first) at that eccentricity."""
    legs = scene.live.legs.all if scene.live.legs else ()
    if not legs and static_eccentricity == 0 and leg == 0:
        return
    if not legs:
        raise BadInput(f"{scene.machine.name} has no air gap: leave eccentricity and orbit out.")
    if not 0 <= leg < len(legs):
        raise BadInput(f"orbit is {leg + 1}; {scene.machine.name} has {len(legs)} of them, from 1.")
    if not legs[leg].holds(static_eccentricity):
        raise BadInput(f"static eccentricity is {percent(static_eccentricity)}; orbit {leg + 1} exists from "
                       f"{percent(legs[leg].low, 4)} to {percent(legs[leg].high, 4)}.")
