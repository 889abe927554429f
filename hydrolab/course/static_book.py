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

from hydrolab.course.pages import SCENES, scene_name
from hydrolab.errors import BadInput
from hydrolab.live.recording import record_machine
from hydrolab.machine import load_machine

MATHJAX = ("mathjax@3.2.2", "package/es5/tex-svg.js")  # one file of 2 MB that needs no other
NEEDED = ("sphinx", "myst_nb", "sphinx_book_theme")


def build(book: Path, out: Path, *, instructor: bool = False) -> str:
    """Build the pages of `book` into the folder `out` and return one sentence on them.

    instructor: with the instructor's pages. Raises BadInput where the tools are missing, or with
    Sphinx's words where a page has a fault.
    """
    if missing := [name for name in NEEDED if importlib.util.find_spec(name) is None]:
        raise BadInput(f"The static book needs {', '.join(missing)}; install hydrolab with its "
                       'extra: pip install -e ".[book]"')
    with tempfile.TemporaryDirectory(prefix="hydrolab-book-") as work:
        # the notebook reader leaves a folder beside the pages: they are built here and copied
        mathjax, scenes, html = fetch_mathjax(Path(work)), Path(work, "scenes"), Path(work, "html")
        record_scenes(scenes)
        command = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", "-E",
                   "-d", str(Path(work, "doctrees")), "-D", f"scenes={scenes}",
                   *(["-t", "instructor"] if instructor else []), str(book), str(html)]
        path = os.pathsep.join(filter(None, sys.path))
        done = subprocess.run(command, capture_output=True, text=True, check=False,
                              env=os.environ | {"PYTHONPATH": path})
        if done.returncode:
            raise BadInput("The static book was not built:\n"
                           f"{done.stderr.strip()[-4000:] or done.stdout[-2000:]}")
        shutil.copytree(scenes, html / "_static" / "scenes", dirs_exist_ok=True)
        if mathjax is not None:
            shutil.copyfile(mathjax, html / "_static" / "tex-svg.js")
        shutil.copytree(html, out, dirs_exist_ok=True)
    said = f"{len(list(out.glob('*.html')))} pages; open {out / 'index.html'}"
    return said if mathjax is not None else (
        f"{said}. Formulas stand there as TeX: MathJax was not fetched, because npm is missing or "
        "reaches no registry. Install npm and build again.")


def record_scenes(folder: Path) -> None:
    """Record each 3D scene of the chapters into a folder as one HTML file, with its reading as text
    beside it.
    """
    machine = load_machine("kaplan-150rpm")
    folder.mkdir()
    for eccentricity, leg in sorted(set().union(*SCENES.values())):
        name = folder / f"{scene_name(eccentricity, leg)}.html"
        reading = record_machine(machine, name, eccentricity, leg, turns=1)
        name.with_suffix(".txt").write_text(reading, encoding="utf-8")


def fetch_mathjax(folder: Path) -> Path | None:
    """Fetch MathJax with npm into a folder and return its one file; None where npm is missing or
    fails.
    """
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
