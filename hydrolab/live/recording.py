"""The 3D machine as one HTML file that plays without a server and asks no other computer for
anything.

A run sheet as one file that plays without a server: each step's recorded scene beside its words.
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
from hydrolab.live.surroundings import fitted
from hydrolab.machine.cards import load_machine
from hydrolab.machine.parts import Machine

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
                       "exists from "
                       f"{percent(legs[leg].low, 4)} to {percent(legs[leg].high, 4)}.")


FRAME = 1.0  # width over height of the scene beside the words
DATA = re.compile(r'<script>window\.__VISER_EMBED_DATA__="([A-Za-z0-9+/=]*)";.*?</script>',
                  re.DOTALL)


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
        found = DATA.search(recording)
        if found is None:
            raise BadInput("A recording is not of the form that viser 1.1 writes.")
        player = recording[:found.start()] + recording[found.end():]
        steps.append({"title": step.title, "cue": step.cue, "see": step.see, "ask": step.ask,
                      "scene": found[1],
                      "dark": bool(step.state.get("dark", False))})
    data = json.dumps({"player": base64.b64encode(player.encode()).decode(),
                       "steps": steps}).replace("</", "<\\/")
    filled = {"%TITLE%": html.escape(sheet.title), "%DATA%": data}
    return re.sub("|".join(filled), lambda mark: filled[mark[0]], PAGE)


def record_sheet(sheet: RunSheet, path: Path, turns: int = 3, *,
                 progress: Callable[[int, int], None] | None = None) -> None:
    """Write a run sheet as one HTML file: every step in its view, turning for some whole turns and
    over again.

    progress: called with how many steps are done, and of how many.
    Raises BadInput for a path that is no .html file.
    """
    if path.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"path is {str(path)!r}; a recording is an .html file.")
    server = open_server(port=0)
    recordings = []
    try:
        scene = MachineScene(server, load_machine(sheet.card))
        with tempfile.TemporaryDirectory() as folder:
            for done, step in enumerate(sheet.steps, 1):
                scene.change(**step.settings)
                camera = server.initial_camera
                camera.position, camera.look_at = fitted(scene.views[step.camera], FRAME)
                part = record_scene(scene, Path(folder) / "step.html", turns)
                recordings.append(part.read_text(encoding="utf-8"))
                if progress:
                    progress(done, len(sheet.steps))
    finally:
        close_server()
    path.write_text(sheet_page(sheet, recordings), encoding="utf-8")


PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>%TITLE%</title>
<style>
html, body { height: 100%; margin: 0; font: 17px/1.45 system-ui, sans-serif; color: #222; background: #fff }
body { display: grid; grid-template-columns: minmax(18em, 30%) 1fr }
section { padding: 1.2em 1.4em 0; overflow: auto; display: flex; flex-direction: column }
h1 { font-size: 1em; font-weight: 600; color: #555; margin: 0 0 1em }
h2 { font-size: 1.5em; line-height: 1.2; margin: 0 0 .6em }
dt { font-weight: 600; color: #0072b2; margin-top: .8em }
dd { margin: 0 }
nav { margin-top: auto; padding: 1em 0; display: flex; gap: .8em; align-items: center }
nav { position: sticky; bottom: 0; background: #fff }
button { font: inherit; padding: .5em 1.1em; border: 1px solid #888; border-radius: 6px; background: #f4f4f4 }
button:disabled { opacity: .4 }
iframe { border: 0; width: 100%; height: 100% }
@media (max-width: 800px) { body { grid-template-columns: 1fr; grid-template-rows: auto 60vh } }
</style>
</head>
<body>
<section>
<h1>%TITLE%</h1>
<div aria-live="polite">
<h2 id="title"></h2>
<dl><dt>Do</dt><dd id="cue"></dd><dt>See</dt><dd id="see"></dd><dt>Ask</dt><dd id="ask"></dd></dl>
</div>
<nav><button id="back">Back</button><span id="place"></span><button id="next">Next</button></nav>
</section>
<iframe id="scene" title="the machine in 3D, recorded"></iframe>
<script id="data" type="application/json">%DATA%</script>
<script>
const { player, steps } = JSON.parse(document.getElementById("data").textContent);
const page = new TextDecoder().decode(Uint8Array.from(atob(player), c => c.charCodeAt(0)));
const part = name => document.getElementById(name);
let here = 0;
function show(step) {
  here = Math.min(Math.max(step, 0), steps.length - 1);
  const { scene, dark, ...words } = steps[here];
  for (const [name, text] of Object.entries(words)) part(name).textContent = text;
  part("place").textContent = `${here + 1} of ${steps.length}`;
  part("back").disabled = here === 0;
  part("next").disabled = here === steps.length - 1;
  const data = `window.__VISER_EMBED_DATA__="${scene}";window.__VISER_EMBED_CONFIG__={darkMode:${dark}};`;
  part("scene").srcdoc = page.replace("</head>", () => `<script>${data}<\\/script></head>`);
}
part("back").onclick = () => show(here - 1);
part("next").onclick = () => show(here + 1);
addEventListener("keydown", event => {
  if (["ArrowRight", "PageDown"].includes(event.key)) show(here + 1);
  if (["ArrowLeft", "PageUp"].includes(event.key)) show(here - 1);
});
show(0);
</script>
</body>
</html>
"""
