"""The 3D machine in a real browser: its bones are numpy's, it follows the settings, and a recording
plays from disk.
"""

import io
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image

from hydrolab import load_machine
from hydrolab.live.poses import positions
from hydrolab.live.recording import record_scene
from hydrolab.live.scene import MachineScene
from tests.chromium import BONES, BROWSER, WEBGL, keep, wait_for_bones

playwright_api = pytest.importorskip("playwright.sync_api", reason="Playwright is in the extra "
                                     "[test]")
viser = pytest.importorskip("viser", reason="viser is in the project's own dependencies")

FLAGS = [*WEBGL, "--disable-background-networking", "--no-first-run", "--no-proxy-server"]
SIZE = {"width": 640, "height": 360}

pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.timeout(300),
    pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome on this computer"),
]


@pytest.fixture(scope="module")
def scene():
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    yield MachineScene(server, load_machine("kaplan-150rpm"), playing=False,
                       static_eccentricity=0.088, leg=2)
    server.stop()


@pytest.fixture(scope="module")
def browser():
    with playwright_api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        yield opened
        opened.close()


def open_page(context, address):
    """A page, with the requests that left this computer and the mistakes it reported."""
    page = context.new_page()
    page.set_default_timeout(90_000)
    strangers, mistakes = [], []
    page.on("request", lambda r: urlsplit(r.url).hostname in (None, "", "127.0.0.1")
            or strangers.append(r.url))
    page.on("pageerror", lambda error: mistakes.append(str(error)))
    page.goto(address)
    page.wait_for_function(f"({BONES})().length === 13")
    return page, strangers, mistakes


def expected(scene, phase):
    """Bone positions by numpy, 13 times (x, y, z)."""
    where = scene.where
    return positions(where.depths, scene.lens(where.motion(phase)))[:where.nodes].tolist()


def test_bones_in_the_browser_are_numpys(browser, scene):
    context = browser.new_context(viewport=SIZE)
    page, strangers, mistakes = open_page(context, f"http://127.0.0.1:{scene.server.get_port()}")
    for phase in (0.4, 2.5):
        scene.draw(phase)
        wait_for_bones(page, expected(scene, phase))
    before = np.array(page.evaluate(BONES))
    keep(page, "machine-3d")
    scene.change(static_eccentricity=0.02, leg=0)
    scene.draw(2.5)
    wait_for_bones(page, expected(scene, 2.5))
    after = np.array(page.evaluate(BONES))
    assert np.abs(after[:, :2] - before[:, :2]).max() > 0.05  # the two are not the same picture
    scene.change(dark=True)
    page.wait_for_function("document.documentElement.getAttribute('data-mantine-color-scheme') === "
                           "'dark'"
                           " || document.querySelector('[data-mantine-color-scheme=dark]')")
    keep(page, "machine-3d-dark")
    scene.change(dark=False)
    context.close()
    assert not strangers and not mistakes


def test_a_recording_plays_from_disk_without_a_network(browser, scene, tmp_path):
    scene.change(static_eccentricity=0.088, leg=2, slow_motion=2.0)
    path = record_scene(scene, tmp_path / "machine.html", turns=2)
    context = browser.new_context(viewport=SIZE, offline=True)
    page, strangers, mistakes = open_page(context, path.as_uri())
    first = page.evaluate(BONES)
    page.wait_for_function(f"first => JSON.stringify(({BONES})()) !== JSON.stringify(first)",
                           arg=first)
    found = np.array(page.evaluate(BONES))[:, :2]
    path_of_all = scene.lens(scene.where.motion(2 * np.pi * np.arange(720) / 720))[:13, :2]
    away = np.abs(found[:, :, None] - path_of_all).max(axis=1)
    assert away.max(axis=0).min() < 5e-3  # all bones are on the orbit, at one and the same phase
    # pause; a page that plays leaves a software renderer no time for a picture
    page.keyboard.press(" ")
    page.wait_for_timeout(1000)
    keep(page, "recording")
    context.close()
    assert not strangers and not mistakes


WATCH = """() => {
  let top = window.__viserMutable.nodeRefFromName['/shaft'], last = 0;
  while (top.parent) top = top.parent;
  window.watched = {lights: 0, loops: 0};
  setInterval(() => {
    let lights = 0;
    top.traverse(node => { lights += Boolean(node.isLight); });
    watched.lights = Math.max(watched.lights, lights);
    const now = parseFloat(document.querySelector('input').value);
    watched.loops += now < last;
    last = now;
  }, 10);
}"""


def colours(page):
    """The colours of a page, (pixels, 3), and which pixels are not of the floor or the paper."""
    seen = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), int).reshape(-1, 3)
    return seen, np.ptp(seen, axis=1) > 30


def test_a_recording_keeps_its_light_when_it_begins_again(browser, scene, tmp_path):
    """viser's player lights lights of its own between two loops: never more lights than the
    scene's five (one sun in three parts), and what stands still keeps its colours.
    """
    scene.change(static_eccentricity=0.088, leg=2, slow_motion=1.5)
    path = record_scene(scene, tmp_path / "machine.html", turns=2)
    context = browser.new_context(viewport={"width": 320, "height": 240}, offline=True)
    page, _, mistakes = open_page(context, path.as_uri())
    # until the sun is up and the panels are there
    page.wait_for_timeout(3000)
    page.evaluate(WATCH)
    page.wait_for_function("watched.lights > 0")
    first, painted = colours(page)
    page.wait_for_function("watched.loops >= 9")
    tenth, still_painted = colours(page)
    assert page.evaluate("watched.lights") == 5
    both = painted & still_painted
    assert both.sum() > 500
    assert np.median(np.abs(tenth[both] - first[both])) <= 2
    context.close()
    assert not mistakes
