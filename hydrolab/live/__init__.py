"""The machine in 3D, moving with its solved orbit, in the browser or in a notebook's cell.

`scene` holds the machine (`solids`, `bodies`, `surroundings`, the `board` beside it) and moves it
(`poses`, `moving_orbit`); `server` opens it, `gate` lets in a room, `panel` has the controls,
`run_sheet` plays a lecture, `recording` writes a file that plays alone; `command` and `cell` start
it.
"""

import sys

if sys.platform == "emscripten":  # a browser's Python runs no server
    from hydrolab.live.recorded import show
else:
    from hydrolab.live.cell import show

__all__ = ["show"]
