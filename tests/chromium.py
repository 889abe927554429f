"""What the tests in a real browser share: which one, where its pictures go, and the bones of the 3D
machine's shaft.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

BROWSER = next(filter(None, map(shutil.which,
                                ["chromium", "chromium-browser", "google-chrome", "chrome"])), None)
# for 3D where there is no graphics card
WEBGL = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
PICTURES = Path(__file__).resolve().parents[1] / "build" / "pictures"
BONES = """() => {
  const found = [];
  window.__viserMutable?.nodeRefFromName?.['/shaft']?.traverse(
    node => node.type === 'Bone' && found.push(node.position.toArray()));
  return found;
}"""


def keep(page: Any, name: str) -> None:
    """Keep what a page shows, to be looked at."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=PICTURES / f"{name}.png")


def wait_for_bones(page: Any, wanted: list[list[float]]) -> None:
    """Wait until the shaft's bones in a page or a frame are at these places."""
    page.wait_for_function(
        f"wanted => {{ const found = ({BONES})(); return found.length === wanted.length && "
        "wanted.every((place, i) => "
        "place.every((value, k) => Math.abs(value - found[i][k]) < 1e-5)); }", arg=wanted)
