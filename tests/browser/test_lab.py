"""`hydrolab lab` in a real browser: the first chapter opens, every cell runs, nothing leaves this
computer.
"""

import os
from pathlib import Path

import pytest

BOOK = Path(__file__).resolve().parents[2] / "book"
CHAPTERS = sorted(BOOK.glob("00*.ipynb"))

pytestmark = pytest.mark.browser


@pytest.mark.skipif(not CHAPTERS, reason="the book has no first chapter")
def test_the_first_chapter_runs_in_jupyterlab(visit):
    chapter, page = CHAPTERS[0].name, visit.page
    page.goto(visit.address)
    page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
    page.locator(".lm-TabBar-tab.lm-mod-current .lm-TabBar-tabLabel", has_text=chapter).wait_for()
    kernel = "window.jupyterapp.shell.currentWidget.sessionContext?.session?.kernel"
    page.wait_for_function(f"{kernel}?.status === 'idle' || document.querySelector('.jp-Dialog')")
    asked = page.locator(".jp-Dialog").all_inner_texts()
    assert not asked, f"JupyterLab asks before it runs anything: {asked}"
    cells = visit.run_all()
    questions = page.locator(".Toastify__toast").all_inner_texts()
    screenshot = page.screenshot(path=os.environ.get("HYDROLAB_SCREENSHOT"))

    assert cells, f"{chapter} has no code"
    assert all(cell["count"] for cell in cells), "a cell did not run"
    errors = [(cell["source"], output) for cell in cells for output in cell["outputs"]
              if output["output_type"] == "error" or output.get("name") == "stderr"]
    assert not errors
    assert not visit.strangers, f"requests that leave this computer: {visit.strangers}"
    assert not visit.mistakes, visit.mistakes
    assert not questions, f"a pop-up in front of the course: {questions}"
    assert len(screenshot) > 10_000

    page.evaluate("window.jupyterapp.commands.execute('docmanager:save')")  # saved, then reopened
    page.set_viewport_size({"width": 1280, "height": 720})
    page.reload()
    page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
    visit.show_cell("eccentricity_explorer(unit").locator("img").first.wait_for()
    assert page.get_by_text("Error displaying widget").count() == 0
    assert page.get_by_text("model not found").count() == 0
    page.screenshot(path=os.environ.get("HYDROLAB_REOPENED"))
