"""`hydrolab show` without a browser: what it says, what it refuses, and the run sheet that plays
without a server.
"""

import base64
import json
import os
import re
import signal
import subprocess
import sys
import urllib.request

import pytest

from hydrolab.cli import main
from hydrolab.errors import BadInput
from hydrolab.live.command import qr_code
from hydrolab.live.recording import record_sheet, sheet_page
from hydrolab.live.run_sheet import RunSheet, Step
from hydrolab.live.scene import MachineScene
from hydrolab.live.server import current_server, open_server

STATE = {"eccentricity": 0.0, "orbit": 1, "field": 1.0, "unbalance": 1.0, "playing": True}
SHEET = RunSheet("Two </script> steps %DATA%", 2, "jeffcott", (
    Step("First", 1, "machine", STATE, "do 1", "see 1", "why 1?", {}),
    Step("Second", 1, "air gap", STATE | {"eccentricity": 5.0, "dark": True}, "do 2",
         "see </script>", "why 2?", {})))


def test_before_a_room_it_prints_address_qr_code_and_pin(tmp_path):
    command = [sys.executable, "-W", "error", "-m", "hydrolab.cli", "show", "jeffcott", "--room",
               "--host", "127.0.0.1"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               cwd=tmp_path,
                               env=os.environ
                               | {"PYTHONUNBUFFERED": "1", "PYTHONIOENCODING": "utf-8"})
    said = ""
    while "Stop with Ctrl-C" not in said:
        line = process.stdout.readline()
        assert line, process.stderr.read()
        said += line
    address = re.search(r"watch at (http://127\.0\.0\.1:\d+/)", said)[1]
    assert qr_code(address) in said
    assert re.search(r"PIN \d{6}\n", said)
    with urllib.request.urlopen(address, timeout=60) as page:
        assert page.status == 200
    for _ in range(2):
        process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out, err) == (0, "\nThe 3D view is closed.\n", "")


def test_the_qr_code_holds_the_modules_in_half_blocks():
    import segno

    # light letters on dark: a drawn half is light
    halves = {" ": (1, 1), "▀": (0, 1), "▄": (1, 0), "█": (0, 0)}
    lines = qr_code("http://192.0.2.7:8080/").splitlines()
    rows = [[halves[c][part] for c in line] for line in lines for part in (0, 1)]
    size = len(segno.make("http://192.0.2.7:8080/", error="m").matrix)
    inner = [row[2:2 + size] for row in rows[2:2 + size]]
    assert inner == [list(row) for row in segno.make("http://192.0.2.7:8080/", error="m").matrix]
    assert not any(rows[0]) and not any(rows[1]) and not any(row[0] or row[1] or row[-1] or row[-2]
                                                             for row in rows[:-1])


@pytest.mark.parametrize(("arguments", "words"), [
    (["--host", "0.0.0.0"], "which other computers may reach; open it to them with room=True (on "
                            "the command line: --room)"),
    (["--host", "203.0.113.9", "--room"], "it is no address of this computer"),
    (["--run-sheet", "none"], "there are 5-minutes, 15-minutes, 45-minutes, which-fault"),
    (["jeffcott", "--run-sheet", "5-minutes"], "The run sheet is about kaplan-150rpm"),
    (["no-such-card"], "no-such-card"),
    (["--viewers", "0"], "viewers is 0"),
    (["--record", "film.mp4"], "film.mp4"),
    (["--eccentricity", "9.5"], "static eccentricity is 9.5 %; orbit 1 exists from 0 % to 8.9"),
    (["--eccentricity", "nan"], "static eccentricity is nan %"),
    (["--orbit", "7"], "orbit is 7; "),
    (["three-disc", "--eccentricity", "3"], "has no air gap"),
    (["--eccentricity", "3", "--run-sheet", "5-minutes"], "A run sheet sets eccentricity and orbit "
                                                          "itself"),
    (["--record", "film.mp4", "--run-sheet", "5-minutes"], "film.mp4"),
])
def test_what_does_not_go_gets_a_sentence_and_2(arguments, words, capsys):
    assert main(["show", "--no-browser", *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error and error.startswith("hydrolab: ") and error.count("\n") == 1
    assert current_server() is None


def test_the_run_sheets_set_only_what_the_scene_has(make_kaplan):
    from hydrolab import load_machine
    from hydrolab.live.run_sheet import NUMBERS, SWITCHES, VIEWS

    scene = MachineScene(open_server(port=0), load_machine("jeffcott"))
    assert tuple(scene.views) == VIEWS
    assert set(NUMBERS) - {"eccentricity", "orbit"} | {"static_eccentricity"} == set(scene.limits)
    for name in SWITCHES:
        assert isinstance(getattr(scene.settings, name), bool)
    for step in SHEET.steps:
        scene.change(**step.settings)
        assert scene.settings.static_eccentricity == pytest.approx(step.state["eccentricity"] / 100)


def test_a_run_sheet_is_recorded_as_one_file_that_asks_for_nothing(tmp_path):
    path = tmp_path / "sheet.html"
    seen = []
    record_sheet(SHEET, path, turns=1, progress=lambda done, whole: seen.append((done, whole)))
    assert seen == [(1, 2), (2, 2)]
    text = path.read_text(encoding="utf-8")
    data = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text,
                                re.DOTALL)[1])
    assert [step["title"] for step in data["steps"]] == ["First", "Second"]
    assert [step["dark"] for step in data["steps"]] == [False, True]
    assert data["steps"][1]["see"] == "see </script>"
    assert "<h1>Two &lt;/script&gt; steps %DATA%</h1>" in text
    scenes = [base64.b64decode(step["scene"]) for step in data["steps"]]
    assert scenes[0] != scenes[1] and all(len(scene) > 10_000 for scene in scenes)
    player = base64.b64decode(data["player"]).decode()
    assert player.count("</head>") >= 1
    assert "__VISER_EMBED_DATA__=" not in player.split("</head>")[0]
    assert not re.findall(r"""(?:src|href)=["']?https?://""", text.replace(data["player"], ""))
    assert path.stat().st_size < 3_000_000
    assert current_server() is None


def test_a_page_needs_a_recording_for_each_step():
    with pytest.raises(BadInput, match="1 recordings for 2 steps"):
        sheet_page(SHEET, [""])
    with pytest.raises(BadInput, match="not of the form"):
        sheet_page(SHEET, ["<html></html>", ""])
