"""The static book: Sphinx over the stored chapters, warnings as errors, nothing fetched when a page
is read.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

from hydrolab.course.pages import SCENES, scene_name
from hydrolab.errors import BadInput
from hydrolab.explorers.legs import legs_of
from hydrolab.live.recording import player_and_scene, record_machine
from hydrolab.machine import load_machine

MATHJAX = ("mathjax@3.2.2", "package/es5/tex-svg.js")  # one file of 2 MB that needs no other
PLAYS = ("<head><script>document.write(`<script src="
         "\"${location.hash.slice(1).replace(/[^0-9.-]/g, '')}.js\"><\\/script>`)</script>")
NEEDED = ("sphinx", "myst_nb", "sphinx_book_theme")


def build(book: Path, out: Path, *, instructor: bool = False, live: Path | None = None) -> str:
    """Build the pages of `book` into the folder `out` and return one sentence on them.

    instructor: with the instructor's pages. live: the folder of the live course that `out` is in;
    each chapter then leads to where it runs, and the recorded scenes are there. Raises BadInput
    where the tools are missing, or with Sphinx's words where a page has a fault.
    """
    if missing := [name for name in NEEDED if importlib.util.find_spec(name) is None]:
        raise BadInput(f"The static book needs {', '.join(missing)}; install hydrolab with its "
                       'extra: pip install -e ".[book]"')
    with tempfile.TemporaryDirectory(prefix="hydrolab-book-") as work:
        # the notebook reader leaves a folder beside the pages: they are built here and copied
        mathjax, html = fetch_mathjax(Path(work)), Path(work, "html")
        scenes = live / "scenes" if live else Path(work, "scenes")
        if not live:
            record_scenes(scenes)
        command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", "-E",
                   "-d", str(Path(work, "doctrees")), "-D", f"scenes={scenes}",
                   "-D", f"live={os.path.relpath(live, out) if live else ''}",
                   *(["-t", "instructor"] if instructor else []), str(book), str(html)]
        path = os.pathsep.join(filter(None, sys.path))
        done = subprocess.run(command, capture_output=True, text=True, check=False,
                              env=os.environ | {"PYTHONPATH": path})
        if done.returncode:
            raise BadInput("The static book was not built:\n"
                           f"{done.stderr.strip()[-4000:] or done.stdout[-2000:]}")
        if not live:
            shutil.copytree(scenes, html / "_static" / "scenes", dirs_exist_ok=True)
        if mathjax is not None:
            shutil.copyfile(mathjax, html / "_static" / "tex-svg.js")
        unused = shutil.ignore_patterns("*.map", "locales")  # the theme's words in 60 languages
        shutil.copytree(html, out, dirs_exist_ok=True, ignore=unused)
    said = f"{len(list(out.glob('*.html')))} pages; open {out / 'index.html'}"
    return said if mathjax is not None else (
        f"{said}. Formulas stand there as TeX: MathJax was not fetched, because npm is missing or "
        "reaches no registry. Install npm and build again.")


def record_scenes(folder: Path) -> list[dict[str, Any]]:
    """Record each 3D scene of the chapters into a folder, with its reading as text beside it, for
    one player: `player.html#NAME` plays the scene of that name. Return what each shows.
    """
    machine, shown = load_machine("kaplan-150rpm"), []
    legs = legs_of(machine)
    folder.mkdir()
    for eccentricity, leg in sorted(set().union(*SCENES.values())):
        name = scene_name(eccentricity, leg)
        with tempfile.TemporaryDirectory() as work:
            page = Path(work, "scene.html")
            words = record_machine(machine, page, eccentricity, leg, turns=1)
            player, scene = player_and_scene(page.read_text(encoding="utf-8"))
        data = f'window.__VISER_EMBED_DATA__="{scene}";window.__VISER_EMBED_CONFIG__={{}};'
        (folder / f"{name}.js").write_text(data, encoding="utf-8")
        (folder / f"{name}.txt").write_text(words, encoding="utf-8")
        (folder / "player.html").write_text(player.replace("<head>", PLAYS, 1), encoding="utf-8")
        mean = legs.orbit(eccentricity, leg).mean / machine.air_gap.gap
        shown.append({"name": name, "machine": machine.name, "reading": words,
                      "static_eccentricity": eccentricity, "mean": mean.tolist()})
    return shown


def fetch_mathjax(folder: Path) -> Path | None:
    """Fetch MathJax with npm into a folder: its one file, or None where npm is missing or fails."""
    npm = shutil.which("npm")
    if npm is None:
        return None
    name, member = MATHJAX
    done = subprocess.run([npm, "pack", "--silent", name], cwd=folder, capture_output=True,
                          text=True, timeout=120, check=False)
    archive = folder / done.stdout.strip().split("\n")[-1]
    if done.returncode or not archive.is_file():
        return None
    with tarfile.open(archive) as packed, open(folder / "tex-svg.js", "wb") as file:
        shutil.copyfileobj(packed.extractfile(member), file)
    return folder / "tex-svg.js"
