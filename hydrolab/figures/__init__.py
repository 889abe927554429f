"""What is drawn: a result becomes a picture with one sentence read from the same numbers.

`picture` couples a figure with its reading, `style` is the house's, `drawing` what several figures
share, `readings` the sentences. `orbits` draws orbits and branches, `jumps` what happens past a
fold, `orders` a record beside a model and a start or a stop, `paper_figures` the paper's figures.
"""

from hydrolab.figures.drawing import REVOLUTION, draw_orbit
from hydrolab.figures.jumps import (
    basins_picture,
    hysteresis_picture,
    integrity_picture,
    map_picture,
    multipliers_picture,
)
from hydrolab.figures.orbits import branch_picture, orbit_picture
from hydrolab.figures.orders import record_picture, run_picture, waterfall_picture
from hydrolab.figures.paper_figures import (
    figure_3,
    figure_4,
    figure_5,
    figure_6,
    figure_7,
    study_pictures,
)
from hydrolab.figures.picture import Picture
from hydrolab.figures.rotor import line_picture
from hydrolab.figures.style import COLOURS, house_style, new_figure, plane

__all__ = [
    "COLOURS", "Picture", "REVOLUTION", "basins_picture", "branch_picture", "draw_orbit",
    "figure_3", "figure_4", "figure_5", "figure_6", "figure_7", "house_style",
    "hysteresis_picture", "integrity_picture", "line_picture", "map_picture",
    "multipliers_picture", "new_figure", "orbit_picture", "plane", "record_picture", "run_picture",
    "study_pictures", "waterfall_picture",
]
