"""The machine in 3D in a notebook's cell."""

from __future__ import annotations

import os

from viser import ViserServer

from hydrolab.show.server import page_address


def frame_address(server: ViserServer) -> str:
    """Where a notebook's page finds the 3D server: on this computer, or behind a hub through jupyter-server-proxy."""
    prefix = os.environ.get("JUPYTERHUB_SERVICE_PREFIX")
    return f"{prefix.rstrip('/')}/proxy/{server.get_port()}/" if prefix else page_address(server)
