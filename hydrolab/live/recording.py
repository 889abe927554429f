"""The 3D machine as one HTML file that plays without a server and asks no other computer for
anything; a run sheet as such a file, each step's recorded scene beside its words.

Here progress: called with (done, all). turns: how many are recorded. static_eccentricity: a
fraction of the gap. recordings: HTML.
"""

from __future__ import annotations

import base64
import html
import json
import math
import re
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from hydrolab.errors import BadInput
from hydrolab.figures.readings import percent
from hydrolab.live.run_sheet import RunSheet
from hydrolab.live.scene import MachineScene
from hydrolab.live.server import close_server, open_server
from hydrolab.machine.cards import load_machine
from hydrolab.machine.parts import Machine

FRAMES = 30  # a second
TURNS = 3  # whole turns, so that the end meets the beginning and the loop shows no jump
# Where a recording begins again, viser's player lights its own lights until the first messages put
# them out. Those wait for a frame, unless the page is hidden: then the lights are never lit.
STEADY = "<script>Object.defineProperty(document, 'hidden', {get: () => true})</script></head>"
FRAME = 1.0  # width over height of the scene beside the words of a run sheet
DATA = re.compile(r'<script>window\.__VISER_EMBED_DATA__="([A-Za-z0-9+/=]*)";.*?</script>',
                  re.DOTALL)
PAGE = Path(__file__).with_name("sheet.html")


def _checked(path: str | Path) -> Path:
    """The path of a recording. Raises BadInput where it is no .html file."""
    if Path(path).suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"path is {str(path)!r}; a recording is an .html file.")
    return Path(path)


def record_scene(scene: MachineScene, path: str | Path, turns: int = TURNS, *,
                 progress: Callable[[int, int], None] | None = None) -> Path:
    """Write a scene, as it is set, turning at its slow motion, and return where.

    turns: whole turns, of as many frames as the slow motion takes, then it begins again.
    Raises BadInput for a path that is no .html file or fewer turns than one.
    """
    path = _checked(path)
    if isinstance(turns, bool) or not isinstance(turns, int) or turns < 1:
        raise BadInput(f"turns is {turns!r}; it must be a whole number of at least 1.")
    turns *= scene.shown.orbit.revolutions
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
        page = recording.as_html(dark_mode=scene.settings.dark)
        path.write_text(page.replace("</head>", STEADY, 1), encoding="utf-8")
    return path


def record_machine(machine: Machine, path: str | Path, static_eccentricity: float = 0.0,
                   leg: int = 0, *, turns: int = TURNS,
                   progress: Callable[[int, int], None] | None = None) -> str:
    """Write a machine at a static eccentricity (fraction of the gap) on a leg of its branch; return
    its reading.

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
    """Raise BadInput where the machine has no steady state on that leg (0 is the first) at that
    eccentricity.
    """
    legs = scene.live.legs.all if scene.live.legs else ()
    if not legs and static_eccentricity == 0 and leg == 0:
        return
    if not legs:
        raise BadInput(f"{scene.machine.name} has no air gap: leave eccentricity and orbit out.")
    if not 0 <= leg < len(legs):
        raise BadInput(f"orbit is {leg + 1}; {scene.machine.name} has {len(legs)} of them, from 1.")
    if not legs[leg].holds(static_eccentricity):
        raise BadInput(f"static eccentricity is {percent(static_eccentricity)}; orbit {leg + 1} "
                       f"exists from {percent(legs[leg].low, 4)} to {percent(legs[leg].high, 4)}.")


def player_and_scene(recording: str) -> tuple[str, str]:
    """A recorded scene (viser's HTML) as a page that plays nothing yet, and what it plays, base64.

    Raises BadInput where a recording is of another form.
    """
    found = DATA.search(recording)
    if found is None:
        raise BadInput("A recording is not of the form that viser 1.1 writes.")
    return recording[:found.start()] + recording[found.end():], found[1]


def sheet_page(sheet: RunSheet, recordings: Sequence[str]) -> str:
    """The page of a run sheet from one recorded scene (viser's HTML) for each step; the player is
    in it once.

    Raises BadInput where there is not one recording for each step.
    """
    if len(recordings) != len(sheet.steps):
        raise BadInput(f"{len(recordings)} recordings for {len(sheet.steps)} steps; give one for "
                       "each.")
    player, steps = "", []
    for step, recording in zip(sheet.steps, recordings, strict=True):
        player, scene = player_and_scene(recording)
        steps.append({word: getattr(step, word) for word in ("title", "cue", "see", "ask")}
                     | {"scene": scene, "dark": bool(step.state.get("dark", False))})
    data = json.dumps({"player": base64.b64encode(player.encode()).decode(),
                       "steps": steps}).replace("</", "<\\/")
    filled = {"%TITLE%": html.escape(sheet.title), "%DATA%": data}
    return re.sub("|".join(filled), lambda mark: filled[mark[0]], PAGE.read_text(encoding="utf-8"))


def record_sheet(sheet: RunSheet, path: Path, turns: int = 3, *,
                 progress: Callable[[int, int], None] | None = None) -> None:
    """Write a run sheet as one HTML file: every step in its view, turning for some whole turns and
    over again.

    progress: called with how many steps are done, and of how many.
    Raises BadInput for a path that is no .html file.
    """
    _checked(path)
    server = open_server(port=0)
    recordings = []
    try:
        scene = MachineScene(server, load_machine(sheet.card))
        with tempfile.TemporaryDirectory() as folder:
            for done, step in enumerate(sheet.steps, 1):
                scene.change(**step.settings)
                camera = server.initial_camera
                camera.position, camera.look_at = scene.views[step.camera].camera(FRAME)
                part = record_scene(scene, Path(folder) / "step.html", turns)
                recordings.append(part.read_text(encoding="utf-8"))
                if progress:
                    progress(done, len(sheet.steps))
    finally:
        close_server()
    path.write_text(sheet_page(sheet, recordings), encoding="utf-8")
