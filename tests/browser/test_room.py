"""`hydrolab show --room` in a real browser: two pages, one PIN; what the presenter moves, the room
sees.
"""

import os
import re
import signal
import subprocess
import sys
import time

import pytest

from tests.chromium import BROWSER, keep

playwright_api = pytest.importorskip("playwright.sync_api", reason="Playwright is in the extra "
                                     "[test]")

FLAGS = ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-sync",
         "--disable-component-update", "--no-proxy-server", "--use-gl=angle",
         "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", "--disable-renderer-backgrounding",
         "--disable-backgrounding-occluded-windows"]
PATIENCE = 90_000  # ms; a browser without a graphics card draws slowly
STATOR = "window.__viserMutable?.nodeRefFromName?.['/stator']?.position.x"
LABEL = "static eccentricity, %"

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome on this computer"),
]


@pytest.fixture
def hall(tmp_path):
    """The command before a room, on this computer only so that the test needs no network; yields
    address and PIN.
    """
    command = [sys.executable, "-m", "hydrolab.cli", "show", "--room", "--host", "127.0.0.1",
               "--run-sheet", "5-minutes"]
    log = tmp_path / "log"
    with log.open("w") as sink:
        process = subprocess.Popen(command, stdout=sink, stderr=subprocess.STDOUT, cwd=tmp_path,
                                   env=os.environ | {"PYTHONUNBUFFERED": "1"})
    try:
        deadline = time.monotonic() + 120
        while "Stop with Ctrl-C" not in (said := log.read_text()):
            assert process.poll() is None and time.monotonic() < deadline, said
            time.sleep(0.1)
        yield re.search(r"http://\S+", said)[0], re.search(r"PIN (\d{6})", said)[1]
        process.send_signal(signal.SIGINT)
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 0
        assert log.read_text().endswith("The 3D view is closed.\n")
    finally:
        process.kill()
        process.wait()


def field(page, label):
    """The number or text box of a control of the panel."""
    return page.locator(f"label:has-text('{label}')").locator(
        "xpath=ancestor::*[contains(@class, 'Flex-root')][1]").locator("input:not([type=hidden])")


def same_place(*pages):
    """Wait until all pages show the stator at one place; one that is behind another is in no hurry.
    """
    end = time.monotonic() + PATIENCE / 1000
    while (places := [page.evaluate(STATOR) for page in pages]) != pytest.approx([places[0]]
                                                                                 * len(pages),
                                                                                 rel=1e-4):
        assert time.monotonic() < end, places
        for page in pages:
            page.bring_to_front()
            page.wait_for_timeout(200)


def test_the_presenter_moves_the_machine_and_the_room_watches(hall):
    address, pin = hall
    with playwright_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        mistakes, strangers, pages = [], [], []
        for _ in range(2):
            page = browser.new_page(viewport={"width": 640, "height": 400})
            page.set_default_timeout(PATIENCE)
            page.on("pageerror", lambda error: mistakes.append(str(error)))
            page.on("request", lambda request: strangers.append(request.url)
                    if not request.url.startswith(
                (address, "data:", "blob:")) else None)
            page.goto(address)
            page.get_by_text("for the presenter").wait_for()
            pages.append(page)
        presenter, watcher = pages

        presenter.get_by_text("for the presenter").click()
        presenter.get_by_text("take the controls").wait_for()
        field(presenter, "PIN").fill("000000" if pin != "000000" else "111111")
        presenter.get_by_text("take the controls").click()
        presenter.get_by_text("That is not the PIN; 4 more guesses.").wait_for()
        assert presenter.get_by_text(LABEL).count() == 0
        # the server empties it
        playwright_api.expect(field(presenter, "PIN")).to_have_value("", timeout=PATIENCE)
        field(presenter, "PIN").fill(pin)
        presenter.get_by_text("take the controls").click()
        presenter.get_by_text(LABEL).wait_for()

        watcher.wait_for_function(f"Math.abs({STATOR}) < 1e-6")
        slider = field(presenter, LABEL)
        slider.fill("8.8")
        slider.press("Enter")
        watcher.wait_for_function(f"{STATOR} > 1e-2")
        watcher.get_by_text("7.84 mm").first.wait_for()
        presenter.bring_to_front()
        presenter.wait_for_function(f"{STATOR} > 1e-2")
        same_place(presenter, watcher)
        keep(watcher, "room-watcher")
        keep(presenter, "room-presenter")
        assert watcher.get_by_text(LABEL).count() == 0
        assert watcher.get_by_text("next", exact=True).count() == 0

        presenter.get_by_role("button", name="next").click()
        watcher.get_by_text("The stator is off centre").wait_for()
        watcher.get_by_text("9.46 mm").first.wait_for()
        presenter.bring_to_front()  # a page behind another one is in no hurry
        playwright_api.expect(field(presenter, LABEL)).to_have_value(re.compile(r"^5(\.0+)?$"),
                                                                     timeout=PATIENCE)
        browser.close()
    assert not mistakes
    assert not strangers
