"""From a stored chapter to a page of the static book: anchors, links between equations, flip-books,
the bibliography, the keys of a machine card.

Chapters are plain Markdown that JupyterLab shows as it is. What a page can do beyond that is added
here, when Sphinx reads the source; the notebooks stay as they are.
"""

from __future__ import annotations

import html
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path

from hydrolab.course.refresh import Cell, Notebook
from hydrolab.explorers.kept_figure import MIME as FLIPBOOK
from hydrolab.machine.cards import SOURCES, card_keys

DISPLAY = re.compile(r"^\$\$.*?\\tag\{([^}]*)\}\s*\$\$", re.DOTALL | re.MULTILINE)
# What is no running text: fenced and inline code, displayed and inline mathematics, links, tags.
APART = re.compile(r"(```.*?```|`[^`\n]*`|\$\$.*?\$\$|\$[^$\n]*\$|!?\[[^\]]*\]\([^)]*\)|<[^>\n]*>)",
                   re.DOTALL)
NAMED = re.compile(r"\((\d+\.\d+)\)")
DOI = re.compile(r"\bdoi:(10\.\d{4,}/[^\s,;]*[^\s,;.])")
PARTS = {"A rotor in a field": range(0, 4), "Steady states": range(4, 6),
         "The machine": range(6, 9),
         "The study": range(9, 13), "The plant": range(13, 100)}
# static eccentricities and legs, by chapter
SCENES = {0: ((0.088, 0),), 10: ((0.0, 0), (0.05, 0), (0.088, 0), (0.088, 2))}
PICTURE = re.compile(r'<img alt="([^"]*)"[^>]*? src="(data:image/[^"]+)"')
LACKS = "*(This needs a control or a step that this page lacks; the live chapter has it.)*"
PAGES = ("extend", "card", "notation", "glossary", "errata", "bibliography", "api")  # for reference
REFERENCE = re.compile(r"^- (.*?\*(?P<title>[^*\n]+)\*.*)$", re.MULTILINE)


def sources(notebook: Notebook) -> Iterator[str]:
    """The text of each Markdown cell."""
    for cell in notebook["cells"]:
        if cell["cell_type"] == "markdown":
            yield _joined(cell["source"])


def _joined(text: str | list[str]) -> str:
    return text if isinstance(text, str) else "".join(text)


def chapters(book: Path) -> dict[str, Notebook]:
    """Every notebook of the book by the name of its page, in order."""
    return {path.stem: json.loads(path.read_text(encoding="utf-8"))
            for path in sorted(book.glob("[0-9]*.ipynb"))}


def heading_anchor(title: str) -> str:
    """The anchor of a heading, as JupyterLab makes it."""
    return title.replace(" ", "-")


def contents(book: Path, more: Sequence[str] = ()) -> str:
    """The tables of contents of a book: chapters by part, pages for reference, and `more` pages."""
    names = list(chapters(book))
    lists = {part: [name for name in names if int(name[:2]) in numbers]
             for part, numbers in PARTS.items()}
    lists |= {"Reference": list(PAGES), "For instructors": list(more)}
    return "\n".join(line for part, pages in lists.items() if pages
                     for line in ("", "```{toctree}", f":caption: {part}", ":titlesonly:", "",
                                  *pages, "```", ""))


def equations(book: Path) -> dict[str, str]:
    """The page on which each equation stands, by its number."""
    return {tag: name for name, notebook in chapters(book).items() for text in sources(notebook)
            for tag in DISPLAY.findall(text)}


def chapter_page(text: str, places: Mapping[str, str], live: str = "") -> str:
    """The text of a notebook's file as the page's source. places: the page of each equation. live:
    where the chapter runs in the browser, if it does.
    """
    notebook = json.loads(text)
    for cell in notebook["cells"]:
        if cell["cell_type"] == "markdown":
            cell["source"] = _with_lacks(linked(_joined(cell["source"]), places),
                                         cell["metadata"].get("tags", ()))
        else:
            _open_flipbooks(cell, live and f"{live}#cell-id={cell['id']}")
    if live:
        first = notebook["cells"][0]
        first["source"] += (f'\n\n<a class="live" href="{live}">Open it live</a>: Python runs in '
                            "your browser, nothing is installed.")
    return json.dumps(notebook)


def _with_lacks(text: str, tags: Sequence[str]) -> str:
    """Questions for an explorer, with a word at those that its flip-book cannot answer: a tag
    `live-23` of the cell says that the second and the third are such.
    """
    for number in "".join(tag[5:] for tag in tags if tag.startswith("live-")):
        text = re.sub(rf"^{number}\. .*$", rf"\g<0> {LACKS}", text, count=1, flags=re.MULTILINE)
    return text


def scene_name(static_eccentricity: float, leg: int) -> str:
    """The name of a recorded scene's file, without its ending: its static eccentricity in per cent
    of the gap, and the leg as people count.
    """
    return f"{100 * static_eccentricity:g}-{leg + 1}"


def with_scenes(text: str, readings: Mapping[str, str]) -> str:
    """The text of a chapter's file with recorded 3D scenes before its exercises, under a heading;
    each loads when a reader opens it. readings: what each scene shows, by where its file is.
    """
    notebook = json.loads(text)
    heading = "## The machine in 3D\n\n"
    scene = ("Drag to look around. A recording turns in a loop; `hydrolab show` opens the live "
             "machine.")
    if not any(heading in text for text in sources(notebook)):
        scene = heading + scene
    scene += "".join(scene_on_click(*shown) for shown in readings.items())
    at = next(i for i, cell in enumerate(notebook["cells"])
              if "## Exercises" in _joined(cell["source"]).split("\n"))
    notebook["cells"].insert(at, {"cell_type": "markdown", "id": "scene", "metadata": {},
                                  "source": scene})
    return json.dumps(notebook)


def scene_on_click(place: str, reading: str) -> str:
    """A recorded scene, folded: the frame of what is folded is not loaded. place: of its player.
    reading: what it shows.
    """
    words = html.escape(reading, quote=True)
    return (f'\n\n<details class="scene"><summary>Show it in 3D, 1 MB: {words}</summary>'
            f'<iframe class="scene" loading="lazy" title="{words}" src="{place}"></iframe>'
            "</details>")


def linked(text: str, places: Mapping[str, str]) -> str:
    """Markdown text with equations anchored, and linked where named; places: the page of each."""
    text = DISPLAY.sub(lambda found: f'<span id="{anchor(found[1])}"></span>\n\n{found[0]}', text)

    def link(found: re.Match[str]) -> str:
        if found[1] not in places:
            return found[0]
        return f'<a class="eq" href="{places[found[1]]}.html#{anchor(found[1])}">{found[0]}</a>'

    return _in_running_text(text, lambda part: _with_doi(NAMED.sub(link, part)))


def _with_doi(text: str) -> str:
    return DOI.sub(r"[doi:\1](https://doi.org/\1)", text)


def anchor(number: str) -> str:
    """The anchor of an equation."""
    return f"eq-{number.replace('.', '-')}"


def _in_running_text(text: str, change: Callable[[str], str]) -> str:
    return "".join(part if i % 2 else change(part) for i, part in enumerate(APART.split(text)))


def _open_flipbooks(cell: Cell, live: str) -> None:
    """Put the flip-book of each output below its still picture. live: where the cell runs."""
    for output in cell["outputs"]:
        data = output.get("data", {})
        if FLIPBOOK in data:
            data["text/html"] = flipbook_figure(_joined(data["text/html"]),
                                                json.loads(_joined(data.pop(FLIPBOOK))), live)


def flipbook_figure(still: str, book: Mapping, live: str = "") -> str:
    """The still picture with a slider below it for the frames of its book; a page without
    JavaScript shows the still picture alone. live: where the explorer runs, if it does.
    """
    link = f'<a class="live" href="{live}">Move it yourself</a>' if live else ""
    label, start = html.escape(book["label"]), book["start"]
    frames = json.dumps(book["frames"], ensure_ascii=False).replace("</", "<\\/")
    return (f'<div class="flipbook" data-whole="{book["whole"]}" '
            f'data-width="{book["width"]}">{still}'
            f'<label class="flipbook-slider" hidden>{label} <input type="range" min="0" '
            f'max="{len(book["frames"]) - 1}" '
            f'step="1" value="{start}"/> '
            f'<output>{html.escape(book["frames"][start]["value"])}</output></label>'
            f'<script type="application/json">{frames}</script>{link}</div>')


def figures_page(book: Path) -> str:
    """One page that holds the stored figures of every chapter to project: one a screen, with the
    chapter above its caption; arrow keys turn.
    """
    shown = []
    for name, notebook in chapters(book).items():
        title = html.escape(next(sources(notebook)).split("\n")[0].lstrip("# "))
        for cell in notebook["cells"]:
            for output in cell.get("outputs", ()):
                text = _joined(output.get("data", {}).get("text/html", ""))
                for alt, picture in PICTURE.findall(text):
                    shown.append(f'<figure id="{name[:2]}-{len(shown)}"><img alt="{alt}" '
                                 f'src="{picture}"><figcaption><b>{title}</b>{alt}</figcaption>'
                                 "</figure>")
    page = (book / "_static" / "figures.html").read_text(encoding="utf-8")
    return page.replace("FIGURES", "\n".join(shown))


def bibliography_page(book: Path) -> str:
    """Every publication that a chapter names, once, with the chapters that name it."""
    entries: dict[str, tuple[str, list[str]]] = {}
    for name, notebook in chapters(book).items():
        text = "\n\n".join(sources(notebook)).split("\n## References", 1)[-1]
        for found in REFERENCE.finditer(text):
            words, named_in = entries.setdefault(found["title"], (found[1], []))
            if name not in named_in:
                named_in.append(name)
    rows = []
    for words, named_in in sorted(entries.values(), key=lambda entry: entry[0].lower()):
        links = ", ".join(f"[{int(name[:2])}]({name}.ipynb)" for name in named_in)
        rows.append(f"- {_in_running_text(words, _with_doi)} Named in chapter {links}.")
    return "\n".join(["# Bibliography", "", "Collected from the chapters; the note is that of the "
                                            "first chapter that names "
                      "the publication. Some are cited from memory and say so.", "", *rows, ""])


def card_page() -> str:
    """Every key that a machine card may hold, a table a part, from where its numbers are declared.
    """
    lines = ["# The keys of a machine card", "",
             "Written from the declarations in the library by `hydrolab book --refresh`; "
             "`hydrolab.machine.card_keys()` gives the same in Python. A key in bold must be "
             "there. A number states its unit and its source, one of "
             f"{', '.join(SOURCES)}; it may carry a `note`. `…` stands for the name of a part: in "
             "the card each such part is a table of its own, `[[bodies]]`."]
    for part, keys in groupby(card_keys(), key=lambda key: key.part):
        lines += ["", f"## {part[:1].upper()}{part[1:]}", "",
                  "| key | meaning | unit | limits | in a card |", "|---|---|---|---|---|"]
        for key in keys:
            name = f"**`{key.key}`**" if key.needed else f"`{key.key}`"
            lines.append(f"| {name} | {key.meaning} | {key.unit} | {key.limits} | "
                         f"`{key.example}` |")
    return "\n".join([*lines, ""])
