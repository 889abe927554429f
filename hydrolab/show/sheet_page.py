"""A run sheet as one file that plays without a server: each step's recorded scene beside its words."""

from __future__ import annotations

import base64
import html
import json
import re
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from hydrolab.errors import BadInput
from hydrolab.machine.cards import load_machine
from hydrolab.show.recording import record_scene
from hydrolab.show.run_sheet import RunSheet
from hydrolab.show.scene import MachineScene
from hydrolab.show.scene_around import fitted
from hydrolab.show.server import close_server, open_server

FRAME = 1.0  # width over height of the scene beside the words
DATA = re.compile(r'<script>window\.__VISER_EMBED_DATA__="([A-Za-z0-9+/=]*)";.*?</script>', re.DOTALL)


def sheet_page(sheet: RunSheet, recordings: Sequence[str]) -> str:
    """The page of a run sheet from one recorded scene (viser's HTML) for each step; the player is in it once.

    Raises BadInput where there is not one recording for each step.
    """
    if len(recordings) != len(sheet.steps):
        raise BadInput(f"{len(recordings)} recordings for {len(sheet.steps)} steps; give one for each.")
    player, steps = "", []
    for step, recording in zip(sheet.steps, recordings, strict=True):
        found = DATA.search(recording)
        if found is None:
            raise BadInput("A recording is not of the form that viser 1.1 writes.")
        player = recording[:found.start()] + recording[found.end():]
        steps.append({"title": step.title, "cue": step.cue, "see": step.see, "ask": step.ask, "scene": found[1],
                      "dark": bool(step.state.get("dark", False))})
    data = json.dumps({"player": base64.b64encode(player.encode()).decode(), "steps": steps}).replace("</", "<\\/")
    filled = {"%TITLE%": html.escape(sheet.title), "%DATA%": data}
    return re.sub("|".join(filled), lambda mark: filled[mark[0]], PAGE)


def record_sheet(sheet: RunSheet, path: Path, turns: int = 3, *, progress: Callable[[int, int], None] | None = None) -> None:
    """Write a run sheet as one HTML file: every step in its view, turning for some whole turns and over again.

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
