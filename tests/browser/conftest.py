"""JupyterLab as a student opens it, and a page in Chromium that notes what should not happen."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from urllib.parse import urlsplit

import pytest

from tests.chromium import BROWSER
from tests.jupyter_process import TOKEN, jupyter_process

FLAGS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-sync",
         "--disable-component-update", "--no-proxy-server", "--use-gl=angle",
         "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader"]
KERNEL = "window.jupyterapp.shell.currentWidget.sessionContext?.session?.kernel"


def is_local(address: str) -> bool:
    """Tell whether a request stays on this computer."""
    parts = urlsplit(address)
    return parts.scheme in ("data", "blob", "about") or parts.hostname in ("127.0.0.1",
                                                                           "localhost", "::1")


@dataclass
class Visit:
    """A page on JupyterLab: requests that leave this computer, errors of the page, and its cells
    once they have run.
    """

    page: object
    address: str
    strangers: list[str] = field(default_factory=list)
    mistakes: list[str] = field(default_factory=list)

    def open(self, chapter: str) -> None:
        """Open a notebook of the course and wait for its kernel."""
        self.page.goto(re.sub(r"/lab[^?]*", f"/lab/tree/{chapter}", self.address))
        self.page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
        self.page.wait_for_function(f"{KERNEL}?.status === 'idle' || "
                                    "document.querySelector('.jp-Dialog')")

    def run_all(self) -> list[dict]:
        """Run every cell; return source, execution count and outputs of those that hold code."""
        self.page.evaluate("window.jupyterapp.commands.execute('notebook:run-all-cells')")
        return self.cells()

    def cells(self) -> list[dict]:
        """Source, execution count and outputs of the cells that hold code."""
        return self.page.evaluate("""() => window.jupyterapp.shell.currentWidget.content.widgets
            .filter(cell => cell.model.type === 'code' && cell.model.sharedModel.getSource().trim())
            .map(cell => ({source: cell.model.sharedModel.getSource(),
                           count: cell.model.executionCount,
                           outputs: cell.model.outputs.toJSON()}))""")

    def run(self, source: str) -> str:
        """What the notebook's kernel prints for some code."""
        return self.page.evaluate("""async code => {
            const context = window.jupyterapp.shell.currentWidget.sessionContext;
            const future = context.session.kernel.requestExecute({code});
            let said = '';
            future.onIOPub = message => {
                said += message.content.text ?? message.content.evalue ?? '';
            };
            await future.done;
            return said;
        }""", source)

    def show_cell(self, text: str) -> object:
        """Scroll to the code cell that holds some text and return it; what is off the screen is not
        rendered.
        """
        at = self.page.evaluate("""text => {
            const content = window.jupyterapp.shell.currentWidget.content;
            const at = content.widgets.findIndex(cell => cell.model.type === 'code' &&
                                                         cell.model.sharedModel.getSource().includes(text));
            content.activeCellIndex = at;
            content.scrollToItem(at, 'start');
            return at;
        }""", text)
        return self.page.locator(f".jp-Cell[data-windowed-list-index='{at}']")


@pytest.fixture
def lab(tmp_path):
    """Yield the address of a course opened with the command, as a student opens it, but for a known
    token.
    """
    if BROWSER is None:
        pytest.skip("no Chromium or Chrome on this computer")
    (tmp_path / "config").mkdir()
    (tmp_path / "config"
     / "jupyter_lab_config.json").write_text('{"LabApp": {"expose_app_in_browser": true}}')
    command = [sys.executable, "-m", "hydrolab.cli", "lab", "--no-browser"]
    with jupyter_process(command, tmp_path, r"http://127\.0\.0\.1:\d+/lab\S*") as address:
        yield address.replace("token=...", f"token={TOKEN}")


@pytest.fixture
def visit(lab):
    """Yield a page in Chromium, on no address yet."""
    api = pytest.importorskip("playwright.sync_api", reason="Playwright is in the extra [test]")
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 1000})
        page.set_default_timeout(90_000)
        found = Visit(page, lab)
        page.on("request", lambda request: is_local(request.url)
                or found.strangers.append(request.url))
        page.on("websocket", lambda socket: is_local(socket.url)
                or found.strangers.append(socket.url))
        page.on("pageerror", lambda error: found.mistakes.append(str(error)))
        yield found
        browser.close()
