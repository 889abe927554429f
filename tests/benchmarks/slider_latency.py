"""How long a key press on a slider takes to a new picture, in JupyterLab in Chromium. It is no
test.

    python -m tests.benchmarks.slider_latency [presses]

Two sliders in one notebook, pressed in turns: `eccentricity_explorer`, and the plain pattern,
`interactive_output` over a function that calls the same view and displays its figure inline. A
press is timed in the page, from its keydown event to the first frame after the new picture has been
painted or loaded. On a busy computer p10 says more than the median.
"""

import json
import os
import statistics
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

from tests.chromium import BROWSER, keep
from tests.jupyter_process import TOKEN, jupyter_process

FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
         "--no-proxy-server"]
CELLS = ['''from hydrolab import load_machine
from hydrolab.explorers import eccentricity_explorer

eccentricity_explorer(load_machine("kaplan-150rpm"), 6.0)''', '''%matplotlib inline
import ipywidgets as widgets
from IPython.display import display
from hydrolab.explorers import slider
from hydrolab.explorers.eccentricity import EccentricityView

view = EccentricityView(load_machine("kaplan-150rpm"))
view(6.0)
view.kept.png()  # margins as they are, as in the explorer; to work them out takes ten times as long

def plain(eccentricity):
    print(view(eccentricity))
    display(view.kept.figure)

where = slider("static eccentricity, %", 6.0, 0.0, 11.0, 0.05, 2)
display(widgets.VBox([where, widgets.interactive_output(plain, {"eccentricity": where})]))''']
PAINTED = """const put = CanvasRenderingContext2D.prototype.putImageData;
CanvasRenderingContext2D.prototype.putImageData = function (...picture) {
  put.apply(this, picture);
  this.canvas.dispatchEvent(new Event('painted', {bubbles: true}));
};"""  # how the explorer's picture comes to be seen, told to who measures
WATCH = """(cell) => {
  const area = document.querySelectorAll('.jp-CodeCell')[cell];
  window.timed = new Promise(done => {
    let start = 0;
    area.addEventListener('keydown', event => { start = performance.now(); },
                          {capture: true, once: true});
    const seen = new Set([...area.querySelectorAll('img')].map(image => image.src));
    const shown = () => {
      observer.disconnect();
      area.removeEventListener('painted', shown);
      requestAnimationFrame(() => done(performance.now() - start));
    };
    const look = () => {
      const image = [...area.querySelectorAll('img')].find(each => each.src && !seen.has(each.src));
      if (start && image) image.decode().then(shown);
    };
    const observer = new MutationObserver(look);
    observer.observe(area, {subtree: true, childList: true, attributes: true,
                            attributeFilter: ['src']});
    area.addEventListener('painted', shown);
    setTimeout(() => done(NaN), 5000);
  });
}"""


def write_notebook(path: Path) -> None:
    """The notebook with both sliders."""
    cells = [{"cell_type": "code", "id": f"cell-{i}", "source": source, "metadata": {},
              "outputs": [],
              "execution_count": None} for i, source in enumerate(CELLS)]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    path.write_text(json.dumps({"cells": cells, "metadata": kernel, "nbformat": 4,
                                "nbformat_minor": 5}))


def press(page: Page, cell: int, key: str) -> float:
    """Milliseconds from a key press on a cell's slider to its new picture."""
    handle = page.locator(".jp-CodeCell").nth(cell).locator(".noUi-handle").first
    handle.focus()
    page.evaluate(WATCH, cell)
    page.keyboard.press(key)
    taken = page.evaluate("window.timed")
    page.wait_for_timeout(60)
    return taken


def main(presses: int = 60) -> None:
    """Measure and print."""
    options = ["--no-browser", "--ip=127.0.0.1", "--allow-root",
               "--LabApp.expose_app_in_browser=True"]
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright, jupyter_process(
            [sys.executable, "-m", "jupyterlab", *options], Path(name),
            r"http://127\.0\.0\.1:\d+/lab\S*") as address:
        write_notebook(Path(name, "latency.ipynb"))
        browser = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        page = browser.new_page(viewport={"width": 1400, "height": 1700})
        page.set_default_timeout(90_000)
        page.add_init_script(PAINTED)
        page.goto(f"{address.split('/lab')[0]}/lab/tree/latency.ipynb?token={TOKEN}")
        page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
        kernel = "window.jupyterapp.shell.currentWidget.sessionContext?.session?.kernel"
        page.wait_for_function(f"{kernel}?.status === 'idle'")
        page.evaluate("window.jupyterapp.commands.execute('notebook:run-all-cells')")
        page.wait_for_timeout(1500)
        times: tuple[list[float], list[float]] = [], []
        for i in range(presses + 5):
            for cell in (0, 1):
                taken = press(page, cell, "ArrowRight" if i % 40 < 20 else "ArrowLeft")
                if i >= 5:  # the first ones warm up
                    times[cell].append(taken)
        keep(page, "slider-latency")
        browser.close()
    medians = []
    for name, found in zip(("eccentricity_explorer", "interactive_output"), times, strict=True):
        medians.append(statistics.median(found))
        tenths = statistics.quantiles(found, n=10)
        print(f"{name:24s} median {medians[-1]:6.1f} ms   p10 {tenths[0]:6.1f} ms   p90 "
              f"{tenths[-1]:6.1f} ms   "
              f"max {max(found):6.1f} ms   ({len(found)} presses)")
    print(f"ratio {medians[1] / medians[0]:.2f}   load {os.getloadavg()[0]:.1f} on "
          f"{os.cpu_count()} cores")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
