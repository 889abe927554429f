"""The page of the static book that lists every public name, written from the docstrings."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import hydrolab

PACKAGES = ("machine", "dynamics", "show", "course")
CODE = re.compile(r"(`[^`\n]*`)")
MARKS = re.compile(r"([*_<>$#\[\]~^\\])")


def api_page() -> str:
    """Markdown: the names a chapter imports, then every module with its public functions and classes."""
    names = [f"| `{name}` | {_first_sentence(getattr(hydrolab, name))} |" for name in sorted(hydrolab.__all__)]
    parts = ["# The library", "", "What `from hydrolab import …` gives. Written from the docstrings.", "",
             "| name | what it is |", "|---|---|", *names, ""]
    for module in modules():
        parts += [f"## {module.__name__}", "", _prose(inspect.getdoc(module) or ""), ""]
        for name, value in public_names(module):
            parts += [f"### {name}", "", "```python", _signature(name, value), "```", "",
                      _prose(inspect.getdoc(value) or ""), ""]
            for inner, method in _methods(value):
                parts += [f"**`{inner}`** — {_prose(inspect.getdoc(method) or '')}", ""]
    return "\n".join(parts)


def modules() -> Iterator[ModuleType]:
    """Every module of the library, package by package, then those beside the packages."""
    names = [f"hydrolab.{package}" for package in PACKAGES]
    inner = [found.name for name in names
             for found in pkgutil.walk_packages(importlib.import_module(name).__path__, f"{name}.")
             if not found.ispkg and ".exercises." not in found.name]
    beside = [found.name for found in pkgutil.iter_modules(hydrolab.__path__, "hydrolab.")
              if not found.ispkg and found.name not in ("hydrolab.cli", "hydrolab.__main__")]
    for name in [*inner, *beside]:
        yield importlib.import_module(name)


def public_names(module: ModuleType) -> Iterator[tuple[str, Any]]:
    """The public functions and classes that a module defines itself, in the order of its text."""
    found = [(name, value) for name, value in vars(module).items() if not name.startswith("_")
             and (inspect.isfunction(value) or inspect.isclass(value)) and value.__module__ == module.__name__]
    return iter(sorted(found, key=lambda pair: inspect.getsourcelines(pair[1])[1]))


def _methods(value: Any) -> Iterator[tuple[str, Any]]:
    """The public methods and properties that a class defines and documents itself."""
    for name, member in vars(value).items() if inspect.isclass(value) else ():
        function = getattr(member, "fget", None) or getattr(member, "func", None) or member
        if not name.startswith("_") and inspect.isfunction(function) and function.__doc__:
            yield name, function


def _signature(name: str, value: Any) -> str:
    try:
        found = inspect.signature(value)
    except (TypeError, ValueError):
        return name
    shown = [parameter.replace(annotation=_bare(parameter.annotation)) for parameter in found.parameters.values()]
    return f"{name}{found.replace(parameters=shown, return_annotation=_bare(found.return_annotation))}"


class _Bare(str):
    """An annotation that shows without quotation marks."""

    __repr__ = str.__str__


def _bare(annotation: Any) -> Any:
    return _Bare(annotation) if isinstance(annotation, str) else annotation


def _first_sentence(value: Any) -> str:
    return _prose((inspect.getdoc(value) or "").split("\n\n")[0]).replace("\n", " ").replace("|", "\\|")


def _prose(text: str) -> str:
    """A docstring as Markdown: code stays, other marks are meant as written."""
    return "".join(part if i % 2 else MARKS.sub(r"\\\1", part) for i, part in enumerate(CODE.split(text)))
