"""A Jupyter server in a process of its own, with settings of its own and a known token."""

from __future__ import annotations

import os
import re
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

TOKEN = "only-for-this-test"
PATIENCE = 120  # s for a server to start, on a computer that does other things too


@contextmanager
def jupyter_process(command: list[str], folder: Path, address: str) -> Iterator[str]:
    """Run a command that starts Jupyter in a folder, and yield the address it prints: what the
    pattern `address` matches.

    It finds none of the reader's own settings, workspaces and kernels, and the token is `TOKEN`.
    """
    own = {f"JUPYTER_{what}_DIR": str(folder / what.lower())
           for what in ("CONFIG", "DATA", "RUNTIME")}
    own |= {"JUPYTERLAB_SETTINGS_DIR": str(folder / "settings"),
            "JUPYTERLAB_WORKSPACES_DIR": str(folder / "spaces"),
            "IPYTHONDIR": str(folder / "ipython"), "JUPYTER_TOKEN": TOKEN}
    log = folder / "jupyter.log"
    with log.open("w") as sink:
        process = subprocess.Popen(command, cwd=folder, env=os.environ | own, stdout=sink,
                                   stderr=subprocess.STDOUT)
    try:
        deadline = time.monotonic() + PATIENCE
        while not (found := re.search(rf"({address})\s", log.read_text(errors="replace"))):
            assert process.poll() is None, f"Jupyter did not start:\n{log.read_text()}"
            assert time.monotonic() < deadline, f"Jupyter takes too long:\n{log.read_text()}"
            time.sleep(0.1)
        yield found[1]
    finally:
        process.terminate()
        try:
            process.wait(30)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
