"""`hydrolab show`: the machine in 3D on this computer, before a room, or as a file for later.

card, room, host, port, viewers, browser: what the command's options of these names say.
"""

from __future__ import annotations

import io
import signal
import threading
import webbrowser
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import segno
from rich.markup import escape
from rich.progress import Progress

from hydrolab.errors import BadInput
from hydrolab.live.gate import Pin
from hydrolab.live.panel import Controls
from hydrolab.live.recording import check_steady_state, record_machine, record_sheet
from hydrolab.live.run_sheet import RunSheet, load_run_sheet
from hydrolab.live.scene import MachineScene
from hydrolab.live.server import (
    close_server,
    open_server,
    page_address,
    room_address,
    stop_with_server,
)
from hydrolab.machine.cards import load_machine
from hydrolab.machine.parts import Machine

WILDCARDS = ("0.0.0.0", "::", "")


def show_command(card: str | None, *, room: bool, host: str | None, port: int | None, viewers: int,
                 sheet: Path | None, record: Path | None, browser: bool,
                 eccentricity: float | None = None, orbit: int | None = None) -> int:
    """Show a machine until Ctrl-C, or record it. Returns the exit code.

    eccentricity: of the stator to begin with, % of the gap. orbit: the steady state to begin with,
    1 is the first. Raises BadInput for what does not go together, and where the server cannot
    listen.
    """
    run_sheet = load_run_sheet(sheet) if sheet else None
    if run_sheet and card is not None:
        raise BadInput(f"The run sheet is about {run_sheet.card}; give either --run-sheet or a "
                       "card.")
    if run_sheet and (eccentricity is not None or orbit is not None):
        raise BadInput("A run sheet sets eccentricity and orbit itself; leave out --eccentricity "
                       "and --orbit.")
    begin = {"static_eccentricity": (eccentricity or 0.0) / 100,
             "leg": (1 if orbit is None else orbit) - 1}
    machine = load_machine(run_sheet.card if run_sheet else card or "kaplan-150rpm")
    if record:
        return _record(machine, run_sheet, record, begin)
    address = host or (room_address() if room else "127.0.0.1")
    pin = Pin() if room else None
    server = open_server(address, port, room=room, viewers=viewers, label=machine.name)
    try:
        print(f"{machine.name}: looking for its steady states …", flush=True)
        scene = MachineScene(server, machine)
        check_steady_state(scene, **begin)
        scene.change(**begin)
        stop_with_server(scene.stop)
        Controls(server, scene, pin, run_sheet)
        scene.run()
        page = page_address(server, room_address() if address in WILDCARDS else None)
        print(f"{_welcome(page, pin)}\nStop with Ctrl-C.", flush=True)
        if browser and not room:
            webbrowser.open(page)
        threading.Event().wait()
    except KeyboardInterrupt:
        # closing takes a moment; a second Ctrl-C changes nothing
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        close_server()
        print("\nThe 3D view is closed.")
    finally:
        close_server()
    return 0


def _welcome(page: str, pin: Pin | None) -> str:
    """Where the machine can be seen, and by whom it can be changed."""
    if pin is None:
        return f"The machine in 3D is at {page}"
    return (f"{qr_code(page)}\nEveryone in this network can watch at {page}\nPresenter: open it "
            f"too, unfold \"for the presenter\", and give the PIN {pin.digits}")


def _record(machine: Machine, run_sheet: RunSheet | None, path: Path,
            begin: Mapping[str, Any]) -> int:
    """Write the machine, or each step of a run sheet, as a file."""
    with Progress(transient=True) as progress:
        task = progress.add_task(escape(f"recording {path.name}"))

        def done(part: int, whole: int) -> None:
            progress.update(task, completed=part, total=whole)

        if run_sheet:
            record_sheet(run_sheet, path, progress=done)
        else:
            record_machine(machine, path, **begin, progress=done)
    print(f"{path} plays in a browser without a server, and without a network "
          f"({path.stat().st_size / 1e6:.1f} MB).")
    return 0


def find_run_sheet(name: str, folder: Path) -> Path:
    """The run sheet of this name in a folder, or a file of your own.

    Raises BadInput where there is neither.
    """
    shipped = sorted((path.stem for path in folder.glob("*.toml")),
                     key=lambda stem: (len(stem), stem))
    if name in shipped:
        return folder / f"{name}.toml"
    if name.endswith(".toml") and Path(name).is_file():
        return Path(name)
    raise BadInput(f"--run-sheet is {name!r}; there are {', '.join(shipped) or 'none'}, or give a "
                   "TOML file of your own.")


def qr_code(text: str) -> str:
    """A text as a QR code of half blocks, which a phone reads off a terminal."""
    drawn = io.StringIO()
    segno.make(text, error="m").terminal(drawn, compact=True, border=2)
    return drawn.getvalue()
