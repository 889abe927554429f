"""The README's picture: the eccentricity explorer as it stands at 8.8 %, where the orbit has a
loop.

`python -m hydrolab.course.readme_picture [FILE]` draws it and prints the Markdown line that shows
it, with its reading as alt text; FILE is book/images/eccentricity.png by default. No widget and no
browser takes part.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from hydrolab.explorers.eccentricity import EccentricityView
from hydrolab.figures.picture import Picture
from hydrolab.machine.cards import load_machine

ECCENTRICITY = 8.8  # %
FILE = Path("book") / "images" / "eccentricity.png"


def readme_picture() -> Picture:
    """The explorer's figure for the card "kaplan-150rpm", with its reading."""
    view = EccentricityView(load_machine("kaplan-150rpm"))
    reading = view(ECCENTRICITY)
    view.kept.png()  # lays the panels out
    return Picture(view.kept.figure, reading)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the picture and print the line for the README."""
    parser = argparse.ArgumentParser(prog="python -m hydrolab.course.readme_picture",
                                     description=__doc__.split("\n\n")[0])
    parser.add_argument("file", nargs="?", type=Path, default=FILE)
    file = parser.parse_args(arguments).file
    file.parent.mkdir(parents=True, exist_ok=True)
    picture = readme_picture()
    picture.save(file)
    print(f"![The eccentricity explorer. {picture.reading}]({file.as_posix()})")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
