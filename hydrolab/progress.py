"""Progress bars for what takes its time: an integration, a map, a study."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)


@contextmanager
def progress_bars(console: Console | None = None) -> Iterator[Callable[[str, int, int], None]]:
    """A callback (what, done, all) that draws a bar for each kind of work while it lasts."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
               TimeElapsedColumn())
    threads = sys.platform != "emscripten"  # a browser's Python has none to draw from
    with Progress(*columns, console=console, transient=True, auto_refresh=threads) as bars:
        tasks: dict[str, TaskID] = {}

        def tell(what: str, done: int, of: int) -> None:
            if what not in tasks:
                tasks[what] = bars.add_task(escape(what), total=of)
            bars.update(tasks[what], completed=done)

        yield tell


@contextmanager
def progress_bar(what: str) -> Iterator[Callable[[int, int], None]]:
    """A bar for one piece of work, as its `progress`:

    with progress_bar("map") as bar: steady_map(…, progress=bar)
    """
    with progress_bars() as tell:
        yield partial(tell, what)
