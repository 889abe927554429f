"""The 3D view behind a hub: its address found by itself, through a real Jupyter server with
jupyter-server-proxy.
"""

import sys
import urllib.error
import urllib.request
from http.cookiejar import CookieJar
from urllib.parse import urlsplit

import pytest
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from hydrolab.live.cell import frame_address
from hydrolab.live.server import open_server
from tests.jupyter_process import TOKEN, jupyter_process

pytest.importorskip("jupyter_server_proxy", reason="jupyter-server-proxy is in the extra [hub]")

PREFIX = "/user/ada/"


@pytest.fixture(scope="module")
def jupyter(tmp_path_factory):
    """The address of a Jupyter server as a hub would start it, ".../user/ada/", with a known token.
    """
    folder = tmp_path_factory.mktemp("hub")
    command = [sys.executable, "-m", "jupyter_server", "--no-browser", "--allow-root",
               "--ServerApp.ip=127.0.0.1",
               "--ServerApp.port=0", f"--ServerApp.base_url={PREFIX}",
               f"--ServerApp.root_dir={folder}",
               "--ServerApp.jpserver_extensions={'jupyter_server_proxy': True}"]
    with jupyter_process(command, folder, rf"http://127\.0\.0\.1:[1-9]\d*{PREFIX}\S*") as address:
        yield urlsplit(address).netloc


@pytest.fixture
def server(monkeypatch):
    """A 3D server as a kernel on a hub opens it."""
    monkeypatch.setenv("JUPYTERHUB_SERVICE_PREFIX", PREFIX)
    server = open_server(port=0)
    server.scene.add_frame("/here")
    return server


def test_without_a_hub_the_address_is_this_computers(monkeypatch):
    monkeypatch.delenv("JUPYTERHUB_SERVICE_PREFIX", raising=False)
    server = open_server(port=0)
    assert frame_address(server) == f"http://127.0.0.1:{server.get_port()}/"


def test_the_page_comes_through_the_hub_with_its_token(jupyter, server):
    address = frame_address(server)
    assert address == f"{PREFIX}proxy/{server.get_port()}/"
    request = urllib.request.Request(f"http://{jupyter}{address}",
                                     headers={"Authorization": f"token {TOKEN}"})
    with urllib.request.urlopen(request, timeout=60) as page:
        assert page.status == 200
        text = page.read()
    with urllib.request.urlopen(f"http://127.0.0.1:{server.get_port()}/", timeout=60) as own:
        assert text == own.read()


@pytest.mark.parametrize("headers", [{}, {"Authorization": "token wrong"}])
def test_without_the_token_there_is_no_page(jupyter, server, headers):
    class Stay(urllib.request.HTTPRedirectHandler):
        def redirect_request(self, *args):
            return None

    opener = urllib.request.build_opener(Stay)
    with pytest.raises(urllib.error.HTTPError) as refused:
        opener.open(urllib.request.Request(f"http://{jupyter}{frame_address(server)}",
                                           headers=headers), timeout=60)
    refused.value.close()
    assert refused.value.code == 403 or "/login" in refused.value.headers["Location"]


def websocket(jupyter, server, headers):
    """A connection to the 3D server through the hub, as the page in the frame opens it."""
    return connect(f"ws://{jupyter}{frame_address(server).removesuffix('/')}",
                   subprotocols=[f"viser-v{viser.__version__}"],
                   origin=f"http://{jupyter}", additional_headers=headers, compression=None,
                   max_size=None, proxy=None,
                   open_timeout=60)


def test_the_scene_comes_through_the_hub_with_its_cookie(jupyter, server):
    jar = CookieJar()
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(jar))
    opener.open(f"http://{jupyter}{PREFIX}api/status?token={TOKEN}", timeout=60).close()
    cookies = "; ".join(f"{cookie.name}={cookie.value}" for cookie in jar)
    with websocket(jupyter, server, {"Cookie": cookies}) as socket:
        assert len(socket.recv(timeout=60)) > 100


def test_without_the_token_there_is_no_scene(jupyter, server):
    with pytest.raises(InvalidStatus) as refused, websocket(jupyter, server, {}):
        pass
    assert refused.value.response.status_code == 403
    assert not server._websock_server._live_connections
