"""From chapters to pages, and to a copy without solutions: what is added, what is taken away, what
stays.
"""

import itertools
import json
import re
import tomllib
from pathlib import Path

import pytest

from hydrolab.cli import course_files, main
from hydrolab.course import pages, static_book
from hydrolab.course import refresh as notebooks
from hydrolab.course.hand_out import hand_out, without_solutions
from hydrolab.errors import BadInput
from hydrolab.machine import card_keys

BOOK = Path(__file__).resolve().parents[2] / "book"
PLACES = {"2.1": "02-a", "1.3": "01-b"}


def markdown(*texts):
    return {"cells": [{"cell_type": "markdown", "source": text, "metadata": {}, "id": f"c{i}"}
                      for i, text in enumerate(texts)], "metadata": {}, "nbformat": 4,
            "nbformat_minor": 5}


@pytest.mark.parametrize(("text", "page"), [
    ("By (1.3) and (2.1).", 'By <a class="eq" href="01-b.html#eq-1-3">(1.3)</a> and '
                            '<a class="eq" href="02-a.html#eq-2-1">(2.1)</a>.'),
    ("Factor (1.3 times), (9.9), `(1.3)`, $f(1.3)$.", "Factor (1.3 times), (9.9), `(1.3)`, "
                                                      "$f(1.3)$."),
    ("```python\nf(1.3)\n```", "```python\nf(1.3)\n```"),
    ("[Eq. (1.3)](01-b.ipynb)", "[Eq. (1.3)](01-b.ipynb)"),
    ("So\n\n$$ a = b \\tag{2.1} $$", 'So\n\n<span id="eq-2-1"></span>\n\n$$ a = b \\tag{2.1} $$'),
    ("doi:10.1006/jsvi.2001.4088.",
     "[doi:10.1006/jsvi.2001.4088](https://doi.org/10.1006/jsvi.2001.4088)."),
    ("doi:10.1007/s00202-z, 2004",
     "[doi:10.1007/s00202-z](https://doi.org/10.1007/s00202-z), 2004"),
])
def test_running_text_gets_links_and_equations_anchors(text, page):
    assert pages.linked(text, PLACES) == page


def test_a_flipbook_follows_its_still_picture():
    book = {"label": "speed, rpm", "start": 1, "width": 30, "height": 20, "whole": "data:,w",
            "frames": [{"value": "1", "reading": "a </script> b", "picture": "data:,a"},
                       {"value": "2", "reading": "b", "picture": "data:,b"}]}
    output = {"output_type": "display_data", "metadata": {}, "data": {
        "text/html": "<figure><img/></figure>", "text/plain": "b",
        pages.FLIPBOOK: json.dumps(book)}}
    notebook = {"cells": [{"cell_type": "code", "source": "a", "outputs": [output]}]}
    page = json.loads(pages.chapter_page(json.dumps(notebook),
                                         {}))["cells"][0]["outputs"][0]["data"]
    assert set(page) == {"text/html", "text/plain"}
    assert page["text/html"].startswith('<div class="flipbook" data-whole="data:,w" '
                                        'data-width="30"><figure>')
    assert page["text/html"].count("</script>") == 1
    frames = re.search(r'json">(.*)</script>', page["text/html"])[1]
    assert json.loads(frames) == book["frames"]


def test_a_page_leads_to_its_live_chapter_and_says_what_it_lacks():
    notebook = markdown("# 2 · Title", "1. one (2.1)\n2. two\n\n<details>\n\n1. yes\n2. no")
    notebook["cells"][1]["metadata"] = {"tags": ["live-2"]}
    plain = json.loads(pages.chapter_page(json.dumps(notebook), {}))["cells"]
    assert plain[0]["source"] == "# 2 · Title"
    assert plain[1]["source"].split("\n")[:2] == ["1. one (2.1)", f"2. two {pages.LACKS}"]
    assert plain[1]["source"].endswith("1. yes\n2. no")
    live = json.loads(pages.chapter_page(json.dumps(notebook), {}, "../lab?path=2"))["cells"]
    assert '<a class="live" href="../lab?path=2">Open it live</a>' in live[0]["source"]


def test_each_question_that_a_page_cannot_answer_is_one():
    """The tags `live-N` name questions below an explorer that has a flip-book."""
    for name, notebook in pages.chapters(BOOK).items():
        for before, cell in itertools.pairwise(notebook["cells"]):
            numbers = "".join(tag[5:] for tag in cell["metadata"].get("tags", ())
                              if tag.startswith("live-"))
            if numbers:
                assert any(pages.FLIPBOOK in output["data"] for output in before["outputs"]), name
                asked = "".join(cell["source"]).split("<details>")[0]
                assert set(numbers) <= set(re.findall(r"^(\d)\. ", asked, re.MULTILINE)), name


def test_equations_and_publications_of_the_book():
    places = pages.equations(BOOK)
    assert places["2.4"] == "02-magnetic-pull" and next(iter(places)) == "0.1"
    page = pages.bibliography_page(BOOK)
    titles = [line for line in page.splitlines() if line.startswith("- ")]
    assert len(titles) == len({re.search(r"\*([^*]+)\*", line)[1] for line in titles})
    paper = next(line for line in titles if "Hydrogenerator dynamics" in line)
    assert "[0](00-start-here.ipynb), [2](02-magnetic-pull.ipynb)" in paper


def test_every_chapter_stands_in_the_contents():
    contents = pages.contents(BOOK, ["instructor/syllabus"])
    for name in [*pages.chapters(BOOK), *pages.PAGES, "instructor/syllabus"]:
        assert f"\n{name}\n" in contents
    assert all((BOOK / f"{name}.md").is_file() for name in pages.PAGES)


def test_the_card_page_is_stored_as_the_library_declares_it():
    """Every kind of part and number, each example a line that TOML reads."""
    page = pages.card_page()
    assert (BOOK / "card.md").read_text(encoding="utf-8") == page, "run: hydrolab book --refresh"
    for word in ("pad_stiffness", "viscosity", "pole_pairs", "breathing", "inner_diameter"):
        assert f"`{word} = " in page
    examples = re.findall(r"\| `([^`]* = [^`]*)` \|$", page, re.MULTILINE)
    assert len(examples) == len(card_keys())
    assert all(tomllib.loads(example) for example in examples)


SOLVED = """<details><summary>Solution</summary>

```python
answer = 42
```

</details>"""


def test_a_copy_for_students_has_no_solutions():
    bare = without_solutions(markdown("Question", SOLVED,
                                      f"1. Ask\n\n{SOLVED.replace('Solution', 'Answers')}\n\n## "
                                      "Next",
                                      SOLVED.replace("Solution", "One possible answer"),
                                      "<details><summary>More on "
                                      "this</summary>\n\nText\n\n</details>"))
    texts = [cell["source"] for cell in bare["cells"]]
    assert texts[:2] == ["Question",
                         "1. Ask\n\n## Next"] and len(texts) == 3 and "More on this" in texts[2]


def test_the_book_is_handed_out_whole_but_for_solutions(tmp_path, capsys):
    folder = tmp_path / "class"
    assert main(["lab", "--students", str(folder)]) == 0
    assert "without solutions" in capsys.readouterr().out
    assert {path.relative_to(folder) for path in folder.rglob("*")
            if path.is_file()} == set(course_files(BOOK))
    for path in folder.glob("*.ipynb"):
        notebook = notebooks.read(path)
        text = "".join(cell["source"] for cell in notebook["cells"])
        assert not re.search(r"<summary>[^<]*(?:Solution|[Aa]nswer)",
                             text) and "## Exercises" in text
        assert notebooks.clean(notebooks.read(path)) == notebooks.clean(notebook)
        kept = [cell for cell in notebook["cells"] if cell.get("outputs")]
        assert kept and "predict(" in kept[-1]["source"]  # whatever answers it comes later
    assert main(["lab", "--students", str(folder)]) == 2
    assert "not an empty folder" in capsys.readouterr().err
    with pytest.raises(BadInput, match="inside the shipped course"):
        hand_out(BOOK, [], BOOK / "class")


def test_the_command_refreshes_chapters_by_number(monkeypatch, capsys):
    asked = []
    compared = []
    monkeypatch.setattr(notebooks, "refresh", lambda path: (asked.append(path.name[:2]),
                                                            (True, "fine"))[1])
    monkeypatch.setattr(notebooks, "check", lambda paths: compared.extend(paths) or 0)
    assert main(["book", "--refresh", "10", "02", "--check"]) == 0
    assert [path.name[:2] for path in compared] == ["10", "02"] and not asked
    assert main(["book", "--refresh", "3"]) == 0
    assert asked == ["03"]
    assert main(["book", "--refresh"]) == 0
    assert len(asked) == 1 + len(pages.chapters(BOOK))
    assert main(["book", "--refresh", "77"]) == 2
    assert "no chapter 77; it has 0, 1, 2" in capsys.readouterr().err


def test_without_its_tools_the_book_says_what_to_install(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(static_book.importlib.util, "find_spec", lambda name: None)
    assert main(["book", "--out", str(tmp_path)]) == 2
    assert '".[book]"' in capsys.readouterr().err


def test_without_npm_there_is_no_mathjax(monkeypatch, tmp_path):
    monkeypatch.setattr(static_book.shutil, "which", lambda name: None)
    assert static_book.fetch_mathjax(tmp_path) is None


def test_the_figures_to_project(tmp_path):
    assert main(["book", "--figures", str(tmp_path / "figures.html")]) == 0
    text = (tmp_path / "figures.html").read_text(encoding="utf-8")
    stored = sum(path.read_text(encoding="utf-8").count("<figcaption>")
                 for path in BOOK.glob("[0-9]*.ipynb"))
    assert text.count("<figure id=") == stored > 40
    assert all(len(alt) > 20 for alt in re.findall(r'<img alt="([^"]*)"', text))
