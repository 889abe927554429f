"""Sphinx: the static book from the stored chapters. Build it with `hydrolab book`."""

import pkgutil
import re
from pathlib import Path

import hydrolab
from hydrolab.course.pages import (
    SCENES,
    bibliography_page,
    chapter_page,
    contents,
    equations,
    linked,
    scene_name,
    scene_on_click,
    with_scenes,
)

BOOK = Path(__file__).parent

project = "hydrolab"
author = "the hydrolab authors"
copyright = "2026, the hydrolab authors; text and figures CC BY 4.0, code MIT"
version = release = hydrolab.__version__
language = "en"

INSTRUCTOR = [f"instructor/{path.stem}" for path in sorted(BOOK.glob("instructor/*.md"))
              if tags.has("instructor")]  # noqa: F821

extensions = ["myst_nb", "sphinx.ext.mathjax", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
autodoc_default_options = {"ignore-module-all": True}  # each name where it is defined
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True  # as they are written: some are arrays
autodoc_type_aliases = {name: name for name in ("NDArray", "ArrayLike")}
autosummary_generate = False  # a table, not a page a name
exclude_patterns = ["_build", "**.ipynb_checkpoints", *([] if INSTRUCTOR else ["instructor"])]
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}

nb_execution_mode = "off"  # the stored outputs are the book; nbval proves them
nb_ipywidgets_js = {}  # no widget code: an explorer shows its still picture and its flip-book
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
myst_heading_slug_func = "hydrolab.course.pages.heading_anchor"

mathjax_path = "tex-svg.js"  # beside the pages; `hydrolab book` puts it there
html_theme = "sphinx_book_theme"
html_title = "hydrolab"
html_static_path = ["_static"]
html_css_files = ["book.css"]
html_js_files = ["flipbook.js"]
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_theme_options = {"home_page_in_toc": True, "show_navbar_depth": 1, "show_toc_level": 1,
                      "use_download_button": False, "use_fullscreen_button": False}


def read(app, docname, source):
    """Turn a stored source into the page's: equations that link, flip-books, pages that are written
    from the code.
    """
    if docname == "index":
        if not INSTRUCTOR:
            source[0] = source[0].replace(' href="instructor/syllabus.html"', "")
        shown = "".join(scene_on_click(*scene) for scene in readings(app, ((0.088, 2),)).items())
        source[0] = source[0].replace("SCENE\n", shown) + contents(BOOK, INSTRUCTOR)
    elif docname == "api":
        source[0] += api(whole=not app.config.live)
    elif docname == "bibliography":
        source[0] = bibliography_page(BOOK)
    elif docname.startswith("instructor/"):
        source[0] = linked(source[0], {number: f"../{name}"
                                       for number, name in equations(BOOK).items()})
    elif docname[:1].isdigit():
        live = app.config.live and f"{app.config.live}/lab/index.html?path={docname}.ipynb"
        source[0] = chapter_page(source[0], equations(BOOK), live)
        if shown := readings(app, SCENES.get(int(docname[:2]), ())):
            source[0] = with_scenes(source[0], shown)


def readings(app, wanted):
    """What each of the wanted scenes shows, by where its player is; none where none is recorded."""
    player = f"{app.config.live or '_static'}/scenes/player.html"
    return {f"{player}#{name}": Path(app.config.scenes, f"{name}.txt").read_text("utf-8")
            for name in (scene_name(*scene) for scene in wanted) if app.config.scenes}


def api(whole):
    """The names that `from hydrolab import …` gives, then every module, for autodoc to fill in;
    beside the live course, where a cell can ask for help, the names alone.
    """
    found = [module.name for module in pkgutil.walk_packages(hydrolab.__path__, "hydrolab.")
             if whole and not re.search(r"__main__|_book", module.name)]
    names = "".join(f"   {name}\n" for name in hydrolab.__all__)
    return "\n\n".join([
        f"```{{eval-rst}}\n.. currentmodule:: hydrolab\n\n.. autosummary::\n\n{names}```",
        *(f"## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n   :members:\n```"
          for name in found)])


def as_prose(app, what, name, subject, options, lines):
    """Let a docstring be read as what it is: paragraphs and indented lines, code in backticks, and
    no other mark that reStructuredText would take for one of its own.
    """
    paragraphs = "\n".join(lines).strip().split("\n\n")
    lines[:] = []
    for paragraph in paragraphs:
        parts = re.split(r"`+([^`]*)`+", paragraph)
        parts[0::2] = [re.sub(r"[*_|\\]", r"\\\g<0>", words) for words in parts[0::2]]
        parts[1::2] = [rf"\ ``{code}``\ " for code in parts[1::2]]
        lines += ["".join(parts).replace("\n", " "), ""]


def setup(app):
    """Ask Sphinx to let `read` see each source first, and `as_prose` each docstring."""
    app.connect("autodoc-process-docstring", as_prose)
    # folder of the recorded 3D scenes; `hydrolab book` makes them
    app.add_config_value("scenes", "", "env")
    app.add_config_value("live", "", "env")  # where the live course is from these pages, if it is
    app.connect("source-read", read)
    return {"parallel_read_safe": True}
