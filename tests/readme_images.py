"""The README's pictures, drawn again: the eccentricity explorer at 8.8 %, where the orbit has a
loop, and the 3D machine there on the far orbit, as a real browser shows it.

`python -m tests.readme_images [NAME …]` draws both or those named and prints the Markdown lines
for them, each with its reading as alt text. The 3D one needs Chromium or Chrome and Playwright.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from hydrolab.explorers.eccentricity import EccentricityView
from hydrolab.figures.picture import Picture
from hydrolab.live.scene import MachineScene
from hydrolab.live.server import close_server, open_server, page_address
from hydrolab.machine.cards import load_machine
from tests.chromium import BROWSER, WEBGL

CARD, ECCENTRICITY = "kaplan-150rpm", 8.8  # %
FOLDER = Path("book") / "images"
PANELS = ".mantine-Paper-root, .mantine-Notification-root { display: none !important; }"
IS_DRAWN = "() => Boolean(window.__viserMutable?.nodeRefFromName?.['/shaft'])"


def explorer(file: Path) -> str:
    """Draw the explorer, without a widget; return the alt text."""
    view = EccentricityView(load_machine(CARD))
    reading = view(ECCENTRICITY)
    view.kept.png()  # lays the panels out
    Picture(view.kept.figure, reading).save(file)
    return f"The eccentricity explorer. {reading}"


def scene(server: Any) -> MachineScene:
    """The 3D machine as the README shows it."""
    shown = MachineScene(server, load_machine(CARD), static_eccentricity=ECCENTRICITY / 100, leg=2,
                         playing=False)
    shown.draw(1.0)
    return shown


def machine(file: Path) -> str:
    """Draw the 3D machine; return the alt text."""
    try:
        shown = scene(open_server(port=0))
        photograph(shown, file)
        return scene_words(shown)
    finally:
        close_server()


def scene_words(shown: MachineScene) -> str:
    """The alt text of a 3D scene."""
    return f"The machine in 3D. {shown.reading}"


def photograph(shown: MachineScene, file: Path, width: int = 960, height: int = 720) -> None:
    """Write what a browser shows of a scene, without panels."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=BROWSER, args=WEBGL)
        page = opened.new_page(viewport={"width": width, "height": height})
        page.set_default_timeout(120_000)
        page.goto(page_address(shown.server))
        page.wait_for_function(IS_DRAWN)
        page.add_style_tag(content=PANELS)
        page.wait_for_timeout(7000)  # letters come in after the solids
        page.screenshot(path=file)
        opened.close()


PICTURES: dict[str, Callable[[Path], str]] = {"eccentricity": explorer, "machine-3d": machine}


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the pictures and print the lines for the README."""
    parser = argparse.ArgumentParser(prog="python -m tests.readme_images",
                                     description=__doc__.split("\n\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=" or ".join(PICTURES))
    parser.add_argument("--folder", type=Path, default=FOLDER)
    chosen = parser.parse_args(arguments)
    if unknown := set(chosen.names) - set(PICTURES):
        parser.error(f"{', '.join(sorted(unknown))}: there are {', '.join(PICTURES)}")
    chosen.folder.mkdir(parents=True, exist_ok=True)
    for name in chosen.names or PICTURES:
        file = chosen.folder / f"{name}.png"
        print(f"![{PICTURES[name](file)}]({file.as_posix()})")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
