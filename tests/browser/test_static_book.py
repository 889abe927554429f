"""The static book as a reader has it: built with warnings as errors, opened from disk, nothing
asked of another host.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import hydrolab
from hydrolab.course import pages
from hydrolab.course.static_book import NEEDED
from tests.chromium import BROWSER

playwright_api = pytest.importorskip("playwright.sync_api", reason="Playwright is in the extra "
                                     "[test]")

BOOK = Path(__file__).resolve().parents[2] / "book"
CHAPTERS = list(pages.chapters(BOOK))
FLAGS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync"]
MISSING = [name for name in NEEDED if find_spec(name) is None] + (
    [] if shutil.which("npm") else ["npm"]) + ([] if BROWSER else ["Chromium or Chrome"])
PATIENCE = 90_000  # ms
LOADED = "[...document.images].every(image => image.complete)"
TOLD = ("doi.org",)  # hosts that a page may name in a link for the reader to follow

pytestmark = [pytest.mark.browser]
# where it is set, as in CI, what is missing is a fault
if not os.environ.get("HYDROLAB_REQUIRE_BOOK"):
    pytestmark.append(pytest.mark.skipif(bool(MISSING), reason="the static book needs "
                                         f"{', '.join(MISSING)}"))


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The pages, built by the command with the instructor's."""
    out = tmp_path_factory.mktemp("book") / "html"
    done = subprocess.run([sys.executable, "-m", "hydrolab.cli", "book", "--instructor", "--out",
                           str(out)],
                          capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert "TeX" not in done.stdout, "MathJax was not fetched"
    assert list(out.parent.iterdir()) == [out], "something was left beside the pages"
    return out


class Links(HTMLParser):
    """The anchors of a page, what it links to, and what it loads by itself."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.linked: list[str] = []
        self.loaded: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.anchors.update(filter(None, (found.get("id"), found.get("name"))))
        for name in ("href", "src", "data", "poster"):
            if found.get(name):
                (self.linked if tag == "a" else self.loaded).append(found[name])


def test_every_link_leads_somewhere(site):
    found = {path.relative_to(site): Links(path.read_text(encoding="utf-8"))
             for path in site.rglob("*.html")
             if "_static" not in path.parts}  # the theme leaves a template there
    assert {Path(f"{name}.html") for name in CHAPTERS} <= set(found)
    for page, links in found.items():
        for target in links.linked + links.loaded:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                assert parts.scheme in ("data",
                                        "mailto") or (target in links.linked
                                                      and parts.netloc in TOLD), target
                continue
            path = Path(os.path.normpath(page.parent / unquote(parts.path))) if parts.path else page
            assert (site / path).exists(), f"{page} → {target}"
            if parts.fragment and path in found:
                assert unquote(parts.fragment) in found[path].anchors, f"{page} → {target}"


def test_equations_are_linked_and_publications_collected(site):
    for number, name in pages.equations(BOOK).items():
        text = (site / f"{name}.html").read_text(encoding="utf-8")
        assert f'id="{pages.anchor(number)}"' in text
    everything = "".join((site / f"{name}.html").read_text(encoding="utf-8") for name in CHAPTERS)
    assert everything.count('class="eq"') > 20
    bibliography = (site / "bibliography.html").read_text(encoding="utf-8")
    assert bibliography.count("Named in chapter") > 5 and "https://doi.org/10." in bibliography
    library = (site / "api.html").read_text(encoding="utf-8")
    for name in hydrolab.__all__:
        assert f">{name}</span></code>" in library
    assert re.search(r'id="hydrolab\.dynamics\.\w+\.follow"', library)


@pytest.fixture(scope="module")
def reader(site):
    """A browser that reads files and is refused everything else; what it asked for in vain, and
    what went wrong.
    """
    with playwright_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=FLAGS)
        context = browser.new_context(viewport={"width": 1280, "height": 900}, offline=True)
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        page.strangers, page.mistakes = [], []
        page.on("request", lambda request: request.url.startswith(("file:", "data:", "blob:"))
                or page.strangers.append(request.url))
        page.on("pageerror", lambda error: page.mistakes.append(str(error)))
        yield page
        browser.close()


@pytest.mark.parametrize("name", ["index", *CHAPTERS, *pages.PAGES])
def test_a_page_opens_from_disk(site, reader, name):
    reader.goto((site / f"{name}.html").as_uri())
    reader.evaluate("window.MathJax?.startup?.promise")
    formulas = reader.locator("main .math").count()
    assert reader.locator("main mjx-container").count() == formulas
    assert formulas or name in ("index", "bibliography", "api", "card", "extend")
    assert reader.locator("mjx-merror").count() == 0
    reader.wait_for_function(LOADED)
    pictures = reader.evaluate("""
        [...document.querySelectorAll("main .cell_output figure > img")].map(
            image => [image.alt.length, image.complete && image.naturalWidth])""")
    assert all(words > 20 and width > 200 for words, width in pictures)
    assert bool(pictures) == (name in CHAPTERS)
    assert not reader.strangers and not reader.mistakes


def test_recorded_scenes_play(site, reader):
    frames = {}
    for chapter, scenes in pages.SCENES.items():
        name = next(name for name in CHAPTERS if int(name[:2]) == chapter)
        reader.goto((site / f"{name}.html").as_uri())
        titles = [frame.get_attribute("title")
                  for frame in reader.locator("iframe.scene[loading=lazy]").all()]
        for title, (eccentricity, leg) in zip(titles, scenes, strict=True):
            assert f"Leg {leg + 1}, stable. At {100 * eccentricity:g} % static" in title
            assert "smallest gap" in title
            frames[f"{100 * eccentricity:g} % on leg {leg + 1}"] = title
    assert len(frames) == 4 and {"0 % on leg 1", "5 % on leg 1", "8.8 % on leg 1",
                                 "8.8 % on leg 3"} <= set(frames)
    frame = reader.locator("iframe.scene").last  # one: a 3D scene without a graphics card is slow
    playwright_api.expect(frame).not_to_be_visible()  # and none before it is opened
    reader.locator("details.scene summary").last.click()
    frame.content_frame.locator("canvas").first.wait_for()
    assert not reader.strangers


@pytest.mark.parametrize("name", CHAPTERS)
def test_flipbooks_move(site, reader, name):
    reader.goto((site / f"{name}.html").as_uri())
    books, expect = reader.locator(".flipbook"), playwright_api.expect
    stored = (BOOK
              / f"{name}.ipynb").read_text(encoding="utf-8").count('"text/vnd.hydrolab.flipbook"')
    assert books.count() == stored
    for book in books.all():
        slider, caption = book.locator("input"), book.locator("figcaption")
        readings = [frame["reading"] for frame in json.loads(book.locator("script").text_content())]
        still, frame = book.locator("figure > img"), book.locator(".flipbook-frame")
        expect(slider).to_be_visible(timeout=PATIENCE)
        expect(still).to_be_visible(timeout=PATIENCE)
        said, value = caption.inner_text(), book.locator("output").inner_text()
        before = book.screenshot()
        slider.focus()
        for key, end in (("Home", "0"), ("End", slider.get_attribute("max"))):
            reader.keyboard.press(key)
            expect(slider).to_have_value(end, timeout=PATIENCE)
            expect(still).not_to_be_visible(timeout=PATIENCE)
            expect(frame).to_be_visible(timeout=PATIENCE)
            expect(frame).to_have_attribute("aria-label", readings[int(end)], timeout=PATIENCE)
            expect(caption).to_have_text(readings[int(end)], timeout=PATIENCE)
        assert caption.inner_text() != said and book.locator("output").inner_text() != value
        reader.wait_for_function(LOADED)
        assert book.screenshot() != before
    assert not reader.strangers and not reader.mistakes
