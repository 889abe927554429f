"""The house style: colours that readers with any colour vision tell apart, sizes that a projector
shows.
"""

import itertools

import numpy as np
import pytest

from hydrolab.figures.style import COLOURS, LINES, STYLE

TOGETHER = [("x", "z"), ("mean", "1X", "2X", "3X", "4X"), ("stable", "unstable", "unknown"),
            ("rotor", "stator")]
# Viénot, Brettel and Mollon (1999): what is left of linear RGB without the long, the middle cones.
SEEN = {"all cones": np.eye(3),
        "no long cones": np.array([[0.11238, 0.88762, 0], [0.11238, 0.88762, 0],
                                   [0.00401, -0.00401, 1]]),
        "no middle cones": np.array([[0.29275, 0.70725, 0], [0.29275, 0.70725, 0],
                                     [-0.02234, 0.02234, 1]])}
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(colour, vision):
    """CIE L*a*b* of "#rrggbb" as an eye with this vision sees it."""
    rgb = np.array([int(colour[i:i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    xyz = TO_XYZ @ np.clip(SEEN[vision] @ linear, 0, 1) / (0.9505, 1, 1.089)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("vision", SEEN)
@pytest.mark.parametrize("names", TOGETHER, ids="-".join)
def test_what_must_not_be_confused_is_seen_apart(names, vision):
    for first, second in itertools.combinations(names, 2):
        apart = np.linalg.norm(lab(COLOURS[first], vision) - lab(COLOURS[second], vision))
        in_line_style = first in LINES and second in LINES and LINES[first] != LINES[second]
        assert apart > (10 if in_line_style else 20), f"{first} and {second}: {apart:.0f}"


def test_the_colours_of_lines_stand_out_on_white():
    for name in LINES:
        assert lab(COLOURS[name], "all cones")[0] < 72, name


def test_letters_are_legible_when_projected():
    """12 pt on a figure of 12 in: letters are 27 of 1920 pixels high where the figure fills the
    wall.
    """
    for name, value in STYLE.items():
        if name.endswith(("size", "labelsize", "titlesize", "fontsize")) and isinstance(value,
                                                                                        int
                                                                                        | float):
            assert value >= (7 if "marker" in name else 12), name
    assert STYLE["lines.linewidth"] >= 2
