"""What the live course refuses, in sentences, and how it is served; tests/browser runs it."""

import json
import threading
import urllib.request
import zipfile

import pytest

from hydrolab.cli import main
from hydrolab.course import browser_site
from hydrolab.errors import BadInput

pytest.importorskip("jupyterlite_core", reason="the live course needs the extra `live`")


def lock(version="0.27.7", **packages):
    return json.dumps({"info": {"version": version}, "packages": packages})


@pytest.mark.parametrize("option", [["--students"], ["--serve"], ["--pyodide", "folder"]])
def test_its_options_go_with_live(option, capsys):
    assert main(["book", *option]) == 2
    assert f"{option[0]} goes with --live" in capsys.readouterr().err


def test_a_folder_with_something_else_is_left_alone(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(BadInput, match="holds something else"):
        browser_site.build_site(tmp_path / "course", tmp_path)
    assert (tmp_path / "thesis.txt").read_text() == "mine"


def test_a_distribution_is_looked_at_before_anything_is_built(tmp_path):
    course, out = tmp_path / "course", tmp_path / "site"
    with pytest.raises(BadInput, match="must be a folder or an archive"):
        browser_site.build_site(course, out, tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadInput, match=r"has no pyodide-lock\.json"):
        browser_site.build_site(course, out, tmp_path / "empty")
    with zipfile.ZipFile(tmp_path / "old.zip", "w") as archive:
        archive.writestr("pyodide/pyodide-lock.json", lock("0.26.1"))
    with pytest.raises(BadInput, match=r"is version 0\.26\.1; .* needs 0\.27\.7"):
        browser_site.build_site(course, out, tmp_path / "old.zip")
    assert not out.exists()


def test_what_a_package_needs_comes_with_it():
    packages = {"a": {"depends": ["B_c"]}, "b-c": {"depends": []}, "d": {"depends": []}}
    assert browser_site._closure(packages, ["a"]) == {"a", "b-c"}
    with pytest.raises(BadInput, match="no package numpy"):
        browser_site._closure(packages, ["numpy"])


@pytest.mark.parametrize(("name", "kind"), [("a.wasm", "application/wasm"),
                                            ("a.mjs", "text/javascript"),
                                            ("a.ipynb", "application/json")])
def test_files_are_served_as_what_they_are(tmp_path, name, kind):
    (tmp_path / name).write_bytes(b"{}")
    with browser_site.serve_site(tmp_path) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_address[1]}/{name}"
        with urllib.request.urlopen(address, timeout=60) as answer:
            assert answer.headers["Content-Type"] == kind
        server.shutdown()
