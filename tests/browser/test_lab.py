"""`hydrolab lab` in a real browser: the first chapter opens, every cell runs, nothing leaves this computer."""

import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import pytest

playwright_api = pytest.importorskip("playwright.sync_api", reason="Playwright is in the extra [test]")

BOOK = Path(__file__).resolve().parents[2] / "book"
CHAPTERS = sorted(BOOK.glob("00*.ipynb"))
BROWSER = next(filter(None, map(shutil.which, ["chromium", "chromium-browser", "google-chrome", "chrome"])), None)
TOKEN = "only-for-this-test"
FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--no-proxy-server"]

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome on this computer"),
]


@pytest.fixture
def lab(tmp_path):
    """Yield the address of a course opened with the command, as a student opens it, but for a known token."""
    (tmp_path / "config").mkdir()
    (tmp_path / "config" / "jupyter_lab_config.json").write_text('{"LabApp": {"expose_app_in_browser": true}}')
    own = {f"JUPYTER_{what}_DIR": str(tmp_path / what.lower()) for what in ("CONFIG", "DATA", "RUNTIME")}
    own |= {"JUPYTERLAB_SETTINGS_DIR": str(tmp_path / "settings"), "IPYTHONDIR": str(tmp_path / "ipython"),
            "JUPYTERLAB_WORKSPACES_DIR": str(tmp_path / "spaces"), "JUPYTER_TOKEN": TOKEN}
    command = [sys.executable, "-m", "hydrolab.cli", "lab", "--no-browser"]
    log = tmp_path / "lab.log"
    with log.open("w") as sink:
        server = subprocess.Popen(command, cwd=tmp_path, env=os.environ | own, stdout=sink, stderr=subprocess.STDOUT)
    try:
        deadline = time.monotonic() + 120
        while not (found := re.search(r"http://127\.0\.0\.1:\d+/lab\S*", log.read_text(errors="replace"))):
            assert server.poll() is None, f"JupyterLab did not start:\n{log.read_text()}"
            assert time.monotonic() < deadline, f"JupyterLab takes too long:\n{log.read_text()}"
            time.sleep(0.2)
        yield found[0].replace("token=...", f"token={TOKEN}")
    finally:
        server.terminate()
        try:
            server.wait(30)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()


def is_local(address: str) -> bool:
    """Tell whether a request stays on this computer."""
    parts = urlsplit(address)
    return parts.scheme in ("data", "blob", "about") or parts.hostname in ("127.0.0.1", "localhost", "::1")


@pytest.mark.skipif(not CHAPTERS, reason="the book has no first chapter")
def test_the_first_chapter_runs_in_jupyterlab(lab, tmp_path):
    chapter = CHAPTERS[0].name
    with playwright_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.set_default_timeout(90_000)
        strangers: list[str] = []
        mistakes: list[str] = []
        page.on("request", lambda request: is_local(request.url) or strangers.append(request.url))
        page.on("websocket", lambda socket: is_local(socket.url) or strangers.append(socket.url))
        page.on("pageerror", lambda error: mistakes.append(str(error)))

        page.goto(lab)
        page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
        assert page.locator(".lm-TabBar-tab.lm-mod-current .lm-TabBar-tabLabel", has_text=chapter).count() == 1
        kernel = "window.jupyterapp.shell.currentWidget.sessionContext?.session?.kernel"
        page.wait_for_function(f"{kernel}?.status === 'idle' || document.querySelector('.jp-Dialog')")
        asked = page.locator(".jp-Dialog").all_inner_texts()
        assert not asked, f"JupyterLab asks before it runs anything: {asked}"
        page.evaluate("window.jupyterapp.commands.execute('notebook:run-all-cells')")
        cells = page.evaluate("""() => window.jupyterapp.shell.currentWidget.content.widgets
            .filter(cell => cell.model.type === 'code' && cell.model.sharedModel.getSource().trim())
            .map(cell => ({source: cell.model.sharedModel.getSource(), count: cell.model.executionCount,
                           outputs: cell.model.outputs.toJSON()}))""")
        questions = page.locator(".Toastify__toast").all_inner_texts()
        screenshot = page.screenshot(path=os.environ.get("HYDROLAB_SCREENSHOT"))
        browser.close()

    assert cells, f"{chapter} has no code"
    assert all(cell["count"] for cell in cells), "a cell did not run"
    errors = [(cell["source"], output) for cell in cells for output in cell["outputs"]
              if output["output_type"] == "error" or output.get("name") == "stderr"]
    assert not errors
    assert not strangers, f"requests that leave this computer: {strangers}"
    assert not mistakes, mistakes
    assert not questions, f"a pop-up in front of the course: {questions}"
    assert len(screenshot) > 10_000
