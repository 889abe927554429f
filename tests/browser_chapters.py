"""Chapters run as a student runs them in a browser, nothing installed, and compared with what is
stored.

    python -m tests.browser_chapters

It builds the live course, serves it on this computer, refuses every other host, and prints for
each chapter how long its kernel and its cells take and what comes out differently. With numbers of
chapters it runs these; `--site` takes a folder built before. With `--public` the site is built
without a distribution, and what it asks of the public server is answered here.
"""

from __future__ import annotations

import argparse
import re
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil

from hydrolab.cli import prepare_folder
from hydrolab.course import refresh as notebooks
from hydrolab.course.browser_site import PUBLIC, build_site, serve_site
from tests.browser.conftest import FLAGS, KERNEL, Visit, is_local
from tests.chromium import BROWSER
from tests.pyodide_distribution import distribution

ALONE = "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"
IDLE = f"{KERNEL}?.status === 'idle'"
PIXELS = re.compile(r"base64,[A-Za-z0-9+/=]+")  # as in nbval.cfg
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]\d+)?")
WATCH = f"""() => {{
    let start = 0;
    window.took = [];
    {KERNEL}.iopubMessage.connect((_, message) => {{
        if (message.header.msg_type === 'execute_input') start = performance.now();
        if (message.content.execution_state === 'idle' && start) {{
            window.took.push((performance.now() - start) / 1000);
            start = 0;
        }}
    }});
}}"""


def build(out: Path, public: bool = False) -> str:
    """Build the live course into a folder, with a distribution of its own or the public one."""
    with tempfile.TemporaryDirectory() as work:
        prepare_folder(Path(work, "course"))
        return build_site(Path(work, "course"), out, None if public else distribution())


@contextmanager
def served(site: Path) -> Iterator[str]:
    """The address of a built site, served on this computer."""
    server = serve_site(site)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_address[1]}"
    server.shutdown()
    server.server_close()


@contextmanager
def visiting(address: str, public: bool = False) -> Iterator[Visit]:
    """A page in Chromium that refuses every host but this one; that it asked none is checked.

    public: answer for the public server.
    """
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=[*FLAGS, ALONE])
        context = browser.new_context(viewport={"width": 1280, "height": 900},
                                      accept_downloads=True,
                                      service_workers="block" if public else "allow")
        visit = Visit(context.new_page(), address)
        visit.page.set_default_timeout(240_000)
        context.route(lambda address: not is_local(address),
                      lambda route: (visit.strangers.append(route.request.url), route.abort()))
        if public:
            context.route(f"{PUBLIC}*", lambda route: route.fulfill(
                path=distribution() / route.request.url.rsplit("/", 1)[1],
                headers={"access-control-allow-origin": "*"}))
        visit.page.on("pageerror", lambda error: visit.mistakes.append(str(error)))
        yield visit
        browser.close()
    assert not visit.strangers


def opened(visit: Visit, place: str) -> float:
    """Open a place of the site, wait until the kernel has imported the library, and return how many
    seconds that took.
    """
    start = time.monotonic()
    visit.page.goto(f"{visit.address}/{place}")
    visit.page.wait_for_selector(".jp-NotebookPanel .jp-Cell", state="attached")
    visit.page.wait_for_function(IDLE)
    said = visit.run("import hydrolab; print('ready', end='')")
    assert said == "ready", said
    return time.monotonic() - start


def run(visit: Visit) -> list[dict[str, Any]]:
    """Run all cells of the open chapter: source, outputs and seconds of each code cell."""
    visit.page.evaluate(WATCH)
    cells = visit.run_all()
    seconds = visit.page.evaluate("window.took")
    assert len(seconds) == len(cells), "a cell was not run"
    return [cell | {"took": took} for cell, took in zip(cells, seconds, strict=True)]


def processor() -> float:
    """Processor time, s, of the threads in which the open pages' Python runs; 0 where the system
    does not say. On a busy computer it tells what a quiet one would take.
    """
    own, total = {child.pid for child in psutil.Process().children(recursive=True)}, 0.0
    for name in Path("/proc").glob("[0-9]*/task/*/comm"):
        if int(name.parts[2]) in own and name.read_text().strip() == "DedicatedWorker":
            total += int((name.parent / "schedstat").read_text().split()[0]) / 1e9
    return total


def said(outputs: list[dict[str, Any]]) -> dict[str, str]:
    """What a cell says, by kind: a stream's name, or a MIME type."""
    found: dict[str, str] = {}
    for output in outputs:
        pieces = output.get("data") or {output.get("name", "error"): output.get("text", "")
                                        or output.get("evalue", "")}
        for kind, text in pieces.items():
            if kind in ("stdout", "stderr", "error", "text/plain", "text/html"):
                text = text if isinstance(text, str) else "".join(text)
                found[kind] = found.get(kind, "") + PIXELS.sub("base64,PIXELS", text)
    return found


def same(new: str, old: str) -> bool:
    """Tell whether two texts are the same to every printed digit; what is rounding error in both,
    below 1e-14 of the largest number of its text, may differ.
    """
    numbers = [[float(number) for number in NUMBER.findall(text)] for text in (new, old)]
    if NUMBER.split(new) != NUMBER.split(old):
        return False
    rounding = 1e-14 * max(map(abs, numbers[1]), default=0)
    return all(a == b or max(abs(a), abs(b)) < rounding for a, b in zip(*numbers, strict=True))


def differences(chapter: Path, cells: list[dict[str, Any]]) -> list[str]:
    """Where the cells that ran say something else than a stored chapter."""
    stored = [cell for cell in notebooks.read(chapter)["cells"]
              if cell["cell_type"] == "code" and "".join(cell["source"]).strip()]
    found = []
    for there, here in zip(stored, cells, strict=True):
        old, new = said(there["outputs"]), said(here["outputs"])
        if "".join(there["source"]) != here["source"]:
            found.append(f"{there['id']}: another source")
        found += [f"{there['id']}, {kind}: {new.get(kind, '')!r} is stored as {text!r}"
                  for kind, text in old.items() if not same(new.get(kind, ""), text)]
        found += [f"{there['id']}, {kind}: {new[kind]!r}" for kind in ("error", "stderr")
                  if kind in new and kind not in old]
    return found


def report(address: str, chapter: Path, public: bool) -> tuple[float, list[str]]:
    """Run one chapter and print what it took; return the seconds of its cells, and differences."""
    with visiting(address, public) as visit:
        start = opened(visit, f"lab/index.html?path={chapter.name}")
        before = processor()
        cells = run(visit)
        used = processor() - before
    found = differences(chapter, cells)
    total = sum(cell["took"] for cell in cells)
    print(f"{chapter.stem}: ready after {start:.1f} s ({before:.1f} s of the processor), cells "
          f"{total:.1f} s ({used:.1f} s), the first {cells[0]['took']:.1f} s; "
          f"{len(found) or 'no'} differences", flush=True)
    for cell in cells:
        if cell["took"] * used > 2 * total:
            print(f"    {cell['took']:5.1f} s ({cell['took'] * used / total:.1f} s)  "
                  f"{cell['source'].strip().splitlines()[-1][:70]}")
    for line in found:
        print(f"    {line}", flush=True)
    return total, found


def main() -> int:
    """Run the chapters that the command line names; 1 where one says something else."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("chapters", nargs="*", metavar="CHAPTER")
    parser.add_argument("--site", type=Path, metavar="DIR")
    parser.add_argument("--public", action="store_true")
    options = parser.parse_args()
    wanted = {f"{int(name):02}" for name in options.chapters}
    with tempfile.TemporaryDirectory() as work:
        site = options.site or Path(work, "site")
        if options.site is None:
            print(build(site, options.public), flush=True)
        chapters = [path for path in sorted((site / "files").glob("[0-9]*.ipynb"))
                    if not wanted or path.stem[:2] in wanted]
        with served(site) as address:
            results = [report(address, chapter, options.public) for chapter in chapters]
    print(f"{len(results)} chapters: {sum(total for total, _ in results):.0f} s")
    return int(any(found for _, found in results))


if __name__ == "__main__":
    sys.exit(main())
