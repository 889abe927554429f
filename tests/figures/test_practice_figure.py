"""The maps of the practice and of parametric instability: their readings say what the numbers say.
"""

import numpy as np
import pytest

from hydrolab import BadInput
from hydrolab.dynamics.parametric import StabilityChart
from hydrolab.dynamics.practice import practice_errors
from hydrolab.figures.practice_figure import practice_map, practice_reading, stability_map


def test_reading_of_the_practice(peer, speed):
    errors = practice_errors(peer, speed, np.linspace(0, 0.1, 11), [0.5, 1.0])
    picture = practice_map(errors)
    assert len(picture.figure.axes) == 4 and "7.833 %" in picture.reading  # the benchmark's fold
    safe = 100 * errors.safe_to(0.05)[1]
    assert f"within 5 % up to {safe:.3g} %" in picture.reading
    assert f"at {100 * errors.eccentricities[7]:.3g} %, the last point" in picture.reading
    assert f"{100 * errors.amplitude[1, 7]:+.3g} % (1X amplitude)" in picture.reading
    weak = practice_errors(peer, speed, [0.0, 0.01], [0.1])
    assert "fold" not in practice_reading(weak).replace("before the fold", "")
    with pytest.raises(BadInput, match="1 fields"):
        practice_map(weak)


def test_reading_of_the_chart():
    growth = np.array([[-1.0, -1.0, -1.0, -1.0], [-1.0, 2.0, 3.5, -1.0]])
    chart = StabilityChart(np.array([100.0, 200.0, 300.0, 400.0]) * np.pi / 30,
                           np.array([0.5, 1.0]), growth)
    picture = stability_map(chart, ([0.9, 1.0], [15.0, 18.0], [32.0, 35.0]))
    assert "unstable from 200 to 300 rpm" in picture.reading and "3.5 a second" in picture.reading
    assert "25 % of the chart" in picture.reading
    assert picture.png().startswith(b"\x89PNG")
    calm = StabilityChart(chart.speeds, chart.fields, -np.abs(growth))
    assert stability_map(calm).reading.startswith("The rotor is stable at every speed")
