"""The course in a browser with nothing installed: built by the command, served on this computer,
used as a student does, with every other host refused.
"""

from __future__ import annotations

import datetime
import json
import re
import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

from hydrolab import cli
from hydrolab.course import pages
from hydrolab.course import refresh as notebooks
from tests.chromium import BROWSER, keep
from tests.pyodide_distribution import distribution, missing

if absent := [name for name in ("jupyterlite_core", "playwright") if find_spec(name) is None]:
    pytest.skip(f"the live course needs {absent}, of the extra [test]", allow_module_level=True)
from tests import browser_chapters as live

pytestmark = pytest.mark.browser
MOST = 90e6  # bytes
SCENE = 700e3  # bytes
BOOK = cli.find_book()
CHAPTERS = sorted(BOOK.glob("[0-9]*.ipynb"))
TODAY = datetime.date.today().toordinal()
# Two chapters a day: each is run every eight days, all by `python -m tests.browser_chapters`.
DRAWN = [CHAPTERS[(2 * TODAY + i) % len(CHAPTERS)] for i in range(2)]
TYPED = """async source => {
    const { content } = window.jupyterapp.shell.currentWidget;
    content.activeCellIndex = content.widgets.findIndex(cell => cell.model.type === 'code');
    content.activeCell.model.sharedModel.setSource(source);
    await window.jupyterapp.commands.execute('notebook:run-cell');
}"""
SAVED = """async ([path, text]) => {
    const { contents } = window.jupyterapp.serviceManager;
    while (!JSON.stringify((await contents.get(path, { content: true })).content).includes(text))
        await new Promise(resume => setTimeout(resume, 200));
}"""
STUDENT = "prediction_of_mine = 3.25"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder as the command builds it."""
    if BROWSER is None:
        missing("no Chromium or Chrome on this computer")
    out = tmp_path_factory.mktemp("live") / "site"
    done = subprocess.run([sys.executable, "-m", "hydrolab.cli", "book", "--live", "--pyodide",
                           str(distribution()), "--out", str(out)],
                          capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stderr
    assert "no page asks another computer" in done.stdout
    return out


@pytest.fixture
def visit(site):
    """A page in Chromium that refuses every host but this one."""
    with live.served(site) as address, live.visiting(address) as found:
        yield found


def test_the_folder_is_small_and_complete(site):
    sizes = {path.relative_to(site): path.stat().st_size for path in site.rglob("*")
             if path.is_file()}
    assert sum(sizes.values()) < MOST
    lock = json.loads((site / "pyodide" / "pyodide-lock.json").read_text(encoding="utf-8"))
    assert not {"pandas", "scikit-learn", "pyarrow"} & set(lock["packages"])
    for name, entry in lock["packages"].items():
        assert re.match(r"\d+(\.\d+)+", entry["version"]), name
        assert Path("pyodide", entry["file_name"]) in sizes
    with zipfile.ZipFile(site / "pyodide" / lock["packages"]["hydrolab"]["file_name"]) as wheel:
        assert {"hydrolab/figures/style.py", "hydrolab/figures/__pycache__/style.cpython-312.pyc"
                } <= set(wheel.namelist())
    for chapter in CHAPTERS:
        assert (site / "files" / chapter.name).read_bytes() == chapter.read_bytes()
    for scene in set().union(*pages.SCENES.values()):
        assert sizes[Path("scenes", f"{pages.scene_name(*scene)}.js")] < SCENE


def test_the_front_page_opens_chapter_0(visit):
    visit.page.goto(f"{visit.address}/")
    visit.page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
    visit.page.wait_for_url("**/lab/index.html?path=00-start-here.ipynb")


def test_a_page_leads_to_its_explorer_which_moves_and_3d_plays(visit):
    page = visit.page
    page.goto(f"{visit.address}/pages/00-start-here.html")
    assert page.get_by_role("link", name="Open it live").get_attribute("href") == (
        "../lab/index.html?path=00-start-here.ipynb")
    assert pages.LACKS.strip("*") in page.locator("main").inner_text()
    page.get_by_role("link", name="Move it yourself").click()
    page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
    track, words = page.locator(".noUi-base").first, page.locator(".jp-Cell [role=status]").first
    words.wait_for()  # the page runs the chapter to the explorer
    first, width = words.inner_text(), track.bounding_box()["width"]
    track.click(position={"x": width * 0.2, "y": 3})
    page.wait_for_function("([words, first]) => words.innerText !== first",
                           arg=[words.element_handle(), first])
    keep(page, "live-slider")

    # 3D is a recording there, and says so.
    shown = "from hydrolab.live import show; show(unit)"
    page.evaluate(TYPED, shown)
    scene = visit.show_cell(shown)
    assert "This is a recording" in scene.inner_text()
    player = scene.locator("iframe").element_handle().content_frame()
    player.wait_for_function("window.__viserMutable?.nodeRefFromName?.['/shaft']")
    keep(page, "live-scene")


@pytest.mark.parametrize("chapter", DRAWN, ids=lambda path: path.stem)
def test_a_chapter_says_what_is_stored(visit, chapter, tmp_path):
    live.opened(visit, f"lab/index.html?path={chapter.name}")
    cells = live.run(visit)
    assert not live.differences(chapter, cells)
    keep(visit.page, "live-chapter")
    if chapter != DRAWN[0]:
        return

    # What is typed is there after a reload, and leaves in one click.
    page = visit.page
    visit.show_cell(cells[0]["source"].splitlines()[0]).locator(".cm-content").click()
    page.keyboard.press("Control+a")
    page.keyboard.type(STUDENT)
    page.evaluate(SAVED, [chapter.name, STUDENT])
    page.reload()
    page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
    page.wait_for_function(live.IDLE)
    assert visit.cells()[0]["source"] == STUDENT
    with page.expect_download() as download:
        page.get_by_role("button", name=re.compile("Download")).first.click()
    download.value.save_as(tmp_path / "mine.ipynb")
    mine, book = (notebooks.read(path)["cells"] for path in (tmp_path / "mine.ipynb", chapter))
    changed = [(here["source"], there["source"]) for here, there in zip(mine, book, strict=True)
               if here["source"] != there["source"]]
    assert [here for here, _ in changed] == [STUDENT]


def test_the_students_course_holds_no_answers(monkeypatch, tmp_path, capsys):
    seen = {}

    def build_site(contents, out, pyodide):
        for path in contents.rglob("*"):
            if path.is_file():
                seen[path.name] = path.read_bytes().decode("utf-8", "replace")
        return "built"

    monkeypatch.setattr("hydrolab.course.browser_site.build_site", build_site)
    assert cli.main(["book", "--live", "--students", "--out", str(tmp_path / "site")]) == 0
    assert capsys.readouterr().out == "built\n"  # no pages: they hold the solutions
    assert {path.name for path in CHAPTERS} <= set(seen)
    assert not [name for name, text in seen.items() if name.endswith(".ipynb")
                and re.search(r"<summary>[^<]*([Ss]olution|[Aa]nswer)", text)]
