"""Chapter 10 in a real browser: every cell runs, and its explorer does what a student expects of
it.
"""

import json
import re

import pytest

from tests.chromium import keep, wait_for_bones

expect = pytest.importorskip("playwright.sync_api",
                             reason="Playwright is in the extra [test]").expect

CHAPTER = "10-static-eccentricity.ipynb"
COUNTED = """
explorer, asked = next(w for w in __import__('ipywidgets').Widget.widgets.values()
                       if getattr(w, 'view', None).__class__.__name__ == 'EccentricityView'), []
inner, show = explorer.view, type(explorer.view).__call__
type(inner).__call__ = lambda view, **values: asked.append(values) or show(view, **values)
"""

PIXELS = """async canvas => {
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  const digest = new Uint8Array(await crypto.subtle.digest('SHA-256', pixels));
  return [...digest].map(byte => byte.toString(16).padStart(2, '0')).join('');
}"""
# the same, of what the kernel drew
DRAWN = "print(__import__('hashlib').sha256(explorer.view.kept._last).hexdigest())"
FROZEN = """
import json
from hydrolab.live import server
from hydrolab.live.poses import positions
scene = next(stop.__self__ for stop in server._open.stops
             if hasattr(stop, '__self__') and hasattr(stop.__self__, 'shown'))
scene.stop()
scene.draw(1.0)
where = scene.where
found = positions(where.depths, scene.lens(where.motion(1.0)))
print(json.dumps(found[:where.nodes].tolist()))
"""

pytestmark = pytest.mark.browser


def test_the_explorer_of_chapter_10(visit):
    page = visit.page
    visit.open(CHAPTER)
    assert not page.locator(".jp-Dialog").all_inner_texts()
    cells = visit.run_all()
    assert cells and all(cell["count"] for cell in cells), "a cell did not run"
    assert not [(cell["source"], output) for cell in cells for output in cell["outputs"]
                if output["output_type"] == "error" or output.get("name") == "stderr"]

    cell = visit.show_cell("eccentricity_explorer(unit")
    picture, words = cell.locator("canvas"), cell.locator("[role=status]")
    picture.wait_for()
    assert words.get_attribute("aria-live") == "polite"
    expect(words).to_contain_text("At 8.8 %", timeout=60_000)
    # the text's content: what is outside the notebook's window has no inner text
    first = words.text_content()
    expect(picture).to_have_attribute("aria-label", first)
    keep(page, "explorer-first")

    def changed(before: str) -> str:
        """The new reading, once there is one."""
        expect(words).not_to_have_text(before)
        expect(words).to_have_text(re.compile("^Leg"))
        return words.text_content()

    def same_picture() -> None:
        """What is seen is what the kernel drew, pixel by pixel."""
        drawn = visit.run(DRAWN).strip()
        page.wait_for_function(f"async ([canvas, drawn]) => await ({PIXELS})(canvas) === drawn",
                               arg=[picture.element_handle(), drawn])

    # A key press moves the slider one step, and picture and reading with it.
    handle = cell.locator(".noUi-handle")
    handle.focus()
    page.keyboard.press("ArrowRight")
    second = changed(first)
    assert "At 8.85 %" in second
    expect(picture).to_have_attribute("aria-label", second)

    # A fast drag skips values and ends where the slider ends.
    visit.run(COUNTED)
    same_picture()
    box = handle.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for i in range(80):
        page.mouse.move(x - 3 * i, y)
    page.mouse.up()
    changed(second)
    readout = cell.locator(".widget-readout")
    page.wait_for_function("([words, readout]) => words.textContent.includes(`At "
                           "${parseFloat(readout.textContent)} %`)",
                           arg=[words.element_handle(), readout.element_handle()])
    asked, last = visit.run("print(len(asked), asked[-1]['eccentricity'])").split()
    assert 2 <= int(asked) < 80
    assert float(last) == pytest.approx(float(readout.text_content()), abs=0.005)
    same_picture()
    keep(page, "explorer-dragged")

    # Where there is no orbit it says so.
    before = words.text_content()
    handle.focus()
    page.keyboard.press("End")
    assert "has no steady state" in changed(before)
    keep(page, "explorer-none")

    # A click on a point of the branch shows that orbit: the place of leg 3 at 9.5 %, as the kernel
    # knows it.
    said = visit.run("d = inner.diagram.axes.transData.transform("
                     "(9.5, 1e6 * inner.legs.orbit(0.095, 2).amplitudes[0, 0]));"
                     "print(*inner.kept.figure.transFigure.inverted().transform(d))")
    right, up = map(float, said.split())
    before, box = words.text_content(), picture.bounding_box()
    picture.click(position={"x": right * box["width"], "y": (1 - up) * box["height"]})
    clicked = changed(before)
    assert clicked.startswith("Leg 3, stable. At 9.")
    assert abs(float(re.search(r"At ([\d.]+) %", clicked)[1]) - 9.5) < 0.11
    keep(page, "explorer-clicked")

    before = clicked
    cell.get_by_role("button", name="Reset").press("Enter")
    assert changed(before) == first
    same_picture()

    # The machine in 3D, in its cell: the shaft's bones are where numpy says.
    view = visit.show_cell("show(there[2])").locator("iframe").element_handle().content_frame()
    bones = json.loads(visit.run(FROZEN))
    assert len(bones) == 13 and max(abs(x) for x, _, _ in bones) > 0.05
    wait_for_bones(view, bones)
    keep(page, "machine-in-a-cell")
    assert not visit.strangers, f"requests that leave this computer: {visit.strangers}"
    assert not visit.mistakes, visit.mistakes
