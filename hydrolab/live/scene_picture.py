"""The README's picture of the 3D machine: the real view in a real browser, at 8.8 % on the far
orbit.

`python -m hydrolab.live.scene_picture [FILE]` draws it with an installed Chromium or Chrome
(Playwright drives it, extra [test]) and prints the Markdown line that shows it, with its reading as
alt text; FILE is book/images/machine-3d.png by default.
"""

from __future__ import annotations

import argparse
import shutil
from collections.abc import Sequence
from pathlib import Path

from hydrolab.errors import BadInput
from hydrolab.live.scene import MachineScene
from hydrolab.live.server import close_server, open_server, page_address
from hydrolab.machine.cards import load_machine

FILE = Path("book") / "images" / "machine-3d.png"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--ignore-gpu-blocklist"]
PANELS = ".mantine-Paper-root, .mantine-Notification-root { display: none !important; }"
IS_DRAWN = "() => Boolean(window.__viserMutable?.nodeRefFromName?.['/shaft'])"


def picture_of(scene: MachineScene, file: Path, width: int = 960, height: int = 720) -> None:
    """Write what a browser shows of a scene, without panels.

    Raises BadInput where there is no browser or nothing to drive it with.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        raise BadInput("Playwright is not installed; install it with: pip install playwright") from None
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise BadInput(f"There is no browser here; install one of {', '.join(BROWSERS)}.")
    file.parent.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=browser, args=FLAGS)
        page = opened.new_page(viewport={"width": width, "height": height})
        page.set_default_timeout(120_000)
        page.goto(page_address(scene.server))
        page.wait_for_function(IS_DRAWN)
        page.add_style_tag(content=PANELS)
        page.wait_for_timeout(7000)  # letters come in after the solids
        page.screenshot(path=file)
        opened.close()


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the picture and print the line for the README."""
    parser = argparse.ArgumentParser(prog="python -m hydrolab.live.scene_picture",
                                     description=__doc__.split("\n\n")[0])
    parser.add_argument("file", nargs="?", type=Path, default=FILE)
    file = parser.parse_args(arguments).file
    try:
        scene = MachineScene(open_server(port=0), load_machine("kaplan-150rpm"),
                             static_eccentricity=0.088, leg=2,
                             playing=False)
        scene.draw(1.0)
        picture_of(scene, file)
        print(f"![The machine in 3D. {scene.reading}]({file.as_posix()})")
    finally:
        close_server()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
