"""The course in a browser with nothing installed: built, served on this computer, used as a student
does, with every other host refused.
"""

from __future__ import annotations

import json
import re
import threading
import time

import pytest

from hydrolab.cli import find_book, prepare_folder
from hydrolab.course import refresh as notebooks
from tests.browser.conftest import FLAGS, KERNEL, Visit, is_local
from tests.chromium import BROWSER, keep
from tests.pyodide_distribution import distribution, missing

pytest.importorskip("jupyterlite_core", reason="the live course needs the extra `live`")
from hydrolab.course.browser_site import build_site, serve_site

pytestmark = pytest.mark.browser
MOST = 90e6  # bytes
STUDENT = "prediction_of_mine = 3.25\n"


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The built site, and its address."""
    if BROWSER is None:
        missing("no Chromium or Chrome on this computer")
    folder = tmp_path_factory.mktemp("live")
    course, out = folder / "course", folder / "site"
    prepare_folder(course)
    said = build_site(course, out, distribution())
    assert "no page asks another computer" in said
    server = serve_site(out)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield out, f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


@pytest.fixture
def visit(site):
    """A page in Chromium that refuses every host but this one."""
    api = pytest.importorskip("playwright.sync_api", reason="Playwright is in the extra [test]")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        context = browser.new_context(viewport={"width": 1280, "height": 900},
                                      accept_downloads=True)
        page = context.new_page()
        page.set_default_timeout(120_000)
        found = Visit(page, site[1])
        context.route(lambda address: not is_local(address),
                      lambda route: (found.strangers.append(route.request.url), route.abort()))
        yield found
        assert not found.strangers
        browser.close()


def opened(visit: Visit, chapter: str) -> None:
    """Open a chapter and wait until its kernel is idle."""
    visit.page.goto(f"{visit.address}/lab/index.html?path={chapter}")
    visit.page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
    visit.page.wait_for_function(f"{KERNEL}?.status === 'idle'")


def test_the_folder_is_small_and_holds_no_answers_it_should_not(site):
    out, _ = site
    assert sum(path.stat().st_size for path in out.rglob("*") if path.is_file()) < MOST
    lock = json.loads((out / "pyodide" / "pyodide-lock.json").read_text(encoding="utf-8"))
    assert not {"pandas", "scikit-learn", "pyarrow"} & set(lock["packages"])
    assert all((out / "pyodide" / entry["file_name"]).is_file()
               for entry in lock["packages"].values())


def test_a_student_in_a_chapter(visit, tmp_path):
    page, start = visit.page, time.monotonic()
    page.goto(f"{visit.address}/")  # the front page goes to chapter 0
    page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
    page.wait_for_function(f"{KERNEL}?.status === 'idle'")
    said = visit.run("import hydrolab, os; print(os.listdir('.')[:1] and 'ready')")
    assert said.strip() == "ready", said
    print(f"ready after {time.monotonic() - start:.1f} s")

    cells = visit.run_all()
    assert all(cell["count"] for cell in cells)
    assert not [output for cell in cells for output in cell["outputs"]
                if output["output_type"] == "error" or output.get("name") == "stderr"]

    # A slider moves a picture.
    cell = visit.show_cell("_explorer(")
    words, handle = cell.locator("[role=status]"), cell.locator(".noUi-handle").first
    words.wait_for()
    first = words.inner_text()
    handle.press("ArrowRight")  # the notebook takes the focus back
    page.wait_for_function("([words, first]) => words.innerText !== first",
                           arg=[words.element_handle(), first])
    keep(page, "live-course")

    # What is typed is there after a reload, and leaves in one click.
    page.evaluate("""text => window.jupyterapp.shell.currentWidget.content.widgets
        .find(cell => cell.model.type === 'code').model.sharedModel.setSource(text)""", STUDENT)
    page.wait_for_function("!window.jupyterapp.shell.currentWidget.context.model.dirty")
    page.reload()
    page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
    page.wait_for_function(f"{KERNEL}?.status === 'idle'")
    assert visit.cells()[0]["source"] == STUDENT
    with page.expect_download() as download:
        page.get_by_role("button", name=re.compile("Download")).first.click()
    download.value.save_as(tmp_path / "mine.ipynb")
    mine = notebooks.read(tmp_path / "mine.ipynb")
    book = notebooks.read(find_book() / "00-start-here.ipynb")
    assert [cell["source"] for cell in mine["cells"]][2:] == [
        cell["source"] for cell in book["cells"]][2:]
    assert STUDENT.strip() in "".join(cell["source"] for cell in mine["cells"])
