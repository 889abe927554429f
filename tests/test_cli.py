"""The command line: a student's files stay, mistakes get a sentence, exit codes are as documented.
"""

import os
import re
import signal
import socket
import subprocess
import sys
import time
import types
from pathlib import Path

import pytest

import hydrolab
from hydrolab import cli
from hydrolab.errors import BadInput, Contact, NoConvergence
from hydrolab.figures import study_pictures


@pytest.fixture
def book(tmp_path):
    """A small course with files that a student needs and files that a student does not."""
    folder = tmp_path / "book"
    for name in ["00-start-here.ipynb", "01-jeffcott.ipynb", "images/rotor.png",
                 "conf.py", "instructor/solutions.ipynb", "_build/html/index.html",
                 ".ipynb_checkpoints/00.ipynb"]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(f"shipped {name}")
    return folder


@pytest.fixture
def study(monkeypatch):
    """Stand in for hydrolab.paper.report; the returned list keeps what it was called with."""
    calls = []
    module = types.ModuleType("hydrolab.paper.report")
    module.study_command = lambda *positional, **named: calls.append((positional, named)) or 0
    monkeypatch.setitem(sys.modules, "hydrolab.paper.report", module)
    return calls


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_lab_copies_what_a_student_needs(book, tmp_path):
    copied, kept = cli.prepare_folder(tmp_path / "mine", book)
    assert names(tmp_path / "mine") == {"00-start-here.ipynb", "01-jeffcott.ipynb",
                                        "images/rotor.png"}
    assert {path.as_posix() for path in copied} == names(tmp_path / "mine") and not kept


def test_lab_never_overwrites(book, tmp_path):
    mine = tmp_path / "mine"
    cli.prepare_folder(mine, book)
    (mine / "00-start-here.ipynb").write_text("my answers")
    (mine / "01-jeffcott.ipynb").unlink()
    (mine / "notes.txt").write_text("my notes")
    copied, kept = cli.prepare_folder(mine, book)
    assert [path.name for path in copied] == ["01-jeffcott.ipynb"]
    assert [path.name for path in kept] == ["00-start-here.ipynb"]
    assert (mine / "00-start-here.ipynb").read_text() == "my answers"
    assert (mine / "notes.txt").read_text() == "my notes"
    assert (book / "00-start-here.ipynb").read_text() == "shipped 00-start-here.ipynb"


def test_an_interrupted_copy_leaves_no_half_file(book, tmp_path, monkeypatch):
    def interrupted(source, target):
        Path(target).write_text("ship")
        raise KeyboardInterrupt

    monkeypatch.setattr(cli.shutil, "copyfile", interrupted)
    with pytest.raises(KeyboardInterrupt):
        cli.prepare_folder(tmp_path / "mine", book)
    assert names(tmp_path / "mine") == set()


def test_a_folder_that_cannot_be_written_to_gets_another_one(book, tmp_path, monkeypatch, capsys):
    def refuse(source, target):
        raise OSError(30, "Read-only file system", str(target))

    monkeypatch.setattr(cli, "find_book", lambda: book)
    monkeypatch.setattr(cli, "copy_new", refuse)
    assert cli.main(["lab", "--dir", str(tmp_path / "mine")]) == 2
    assert_one_sentence(capsys, "Name a place that you may write to with --dir.")


@pytest.mark.skipif(os.name == "nt", reason="needs symbolic links")
def test_lab_does_not_write_through_a_link(book, tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "00-start-here.ipynb").symlink_to(tmp_path / "elsewhere.ipynb")
    cli.prepare_folder(mine, book)
    assert not (tmp_path / "elsewhere.ipynb").exists()


@pytest.mark.parametrize("inside", [".", "images"])
def test_lab_leaves_the_shipped_course_alone(book, inside):
    with pytest.raises(BadInput, match="inside the shipped course"):
        cli.prepare_folder(book / inside, book)


def test_lab_says_that_a_file_is_no_folder(book, tmp_path, capsys, monkeypatch):
    (tmp_path / "taken").write_text("")
    monkeypatch.setattr(cli, "find_book", lambda: book)
    assert cli.main(["lab", "--dir", str(tmp_path / "taken")]) == 2
    assert_one_sentence(capsys, "a file; choose a folder")


def test_the_book_is_found_in_a_clone_and_in_a_wheel(tmp_path, monkeypatch):
    package = tmp_path / "hydrolab"
    (package / "_book").mkdir(parents=True)
    monkeypatch.setattr(cli, "__file__", str(package / "cli.py"))
    assert cli.find_book() == package / "_book"
    (tmp_path / "book").mkdir()  # a stranger's folder beside site-packages' hydrolab
    assert cli.find_book() == package / "_book"
    (tmp_path / "pyproject.toml").write_text("")
    assert cli.find_book() == tmp_path / "book"
    monkeypatch.setattr(cli, "__file__", str(tmp_path / "empty" / "hydrolab" / "cli.py"))
    with pytest.raises(BadInput, match="install hydrolab again"):
        cli.find_book()


def test_lab_opens_the_first_chapter(book):
    arguments = cli.lab_arguments(book, ip="127.0.0.1", port=8899, browser=False)
    assert {"--LabApp.default_url=/lab/tree/00-start-here.ipynb", "--ServerApp.ip=127.0.0.1",
            "--ServerApp.port=8899",
            "--ServerApp.port_retries=0", "--no-browser"} <= set(arguments)
    assert not any("port" in argument for argument in cli.lab_arguments(book, ip="127.0.0.1",
                                                                        port=None, browser=True))


def assert_one_sentence(capsys, part: str) -> None:
    captured = capsys.readouterr()
    assert part in captured.err and captured.err.startswith("hydrolab: ")
    assert captured.err.count("\n") == 1
    assert "Traceback" not in captured.err + captured.out


def test_lab_says_that_jupyterlab_is_missing(capsys, monkeypatch):
    monkeypatch.setattr(cli.importlib.util, "find_spec", lambda name: None)
    assert cli.main(["lab"]) == 2
    assert_one_sentence(capsys, "JupyterLab is not installed")


def test_lab_says_that_the_port_is_taken(tmp_path, capsys):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        assert cli.main(["lab", "--port", str(port), "--dir", str(tmp_path / "mine")]) == 2
    assert_one_sentence(capsys, f"Port {port} is taken")
    assert not (tmp_path / "mine").exists()


@pytest.mark.parametrize("ip", ["203.0.113.7", "not an address", "1.2.3.4.5"])
def test_lab_says_that_the_address_is_wrong(tmp_path, capsys, ip):
    assert cli.main(["lab", "--ip", ip, "--dir", str(tmp_path / "mine")]) == 2
    assert_one_sentence(capsys, "--ip is")


@pytest.mark.parametrize("port", ["0", "65536", "-1", "http", "8e3", "٨٨٨٨"])
def test_lab_refuses_what_is_no_port(capsys, port):
    with pytest.raises(SystemExit) as stop:
        cli.main(["lab", f"--port={port}"])
    assert stop.value.code == 2
    assert "a port is a whole number from 1 to 65535" in capsys.readouterr().err


def test_study_gets_what_was_asked(study, tmp_path):
    assert cli.main(["study"]) == 0
    assert cli.main(["study", "--out", str(tmp_path), "--family", "--no-figures"]) == 0
    assert study == [
        ((), {"out": Path("hydrolab-study"), "family": False, "draw": study_pictures}),
        ((), {"out": tmp_path, "family": True, "draw": None}),
    ]


@pytest.mark.parametrize(("error", "code", "part"), [
    (BadInput("air_gap.gap is -1 m; it must be larger than 0 m."), 2, "air_gap.gap is -1 m"),
    (NoConvergence("Newton stopped at 8.9 %; a fold is near."), 2, "a fold is near"),
    (Contact("The rotor touches the stator at 12°."), 2, "touches the stator"),
    (PermissionError(13, "Permission denied", "report.json"), 2, "report.json: Permission denied"),
    (OSError(30, "Read-only file system", "hydrolab-study"), 2, "write to with --out."),
    (OSError(28, "No space left on device", "report.json"), 2, "No space left on device.\n"),
    (KeyboardInterrupt(), 130, "stopped by Ctrl-C"),
])
def test_failures_are_sentences(study, monkeypatch, capsys, error, code, part):
    def fail(*positional, **named):
        raise error

    monkeypatch.setattr(sys.modules["hydrolab.paper.report"], "study_command", fail)
    assert cli.main(["study"]) == code
    assert_one_sentence(capsys, part)


def test_a_mistake_of_the_library_keeps_its_traceback(study, monkeypatch):
    monkeypatch.setattr(sys.modules["hydrolab.paper.report"], "study_command", lambda *a,
                        **k: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        cli.main(["study"])


@pytest.mark.parametrize("arguments", [[], ["fly"], ["study", "--speed"], ["lab", "--port"]])
def test_a_wrong_command_line_exits_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(arguments)
    assert stop.value.code == 2
    assert "usage: hydrolab" in capsys.readouterr().err


def test_check_alone_builds_nothing(capsys, monkeypatch):
    import hydrolab.course.static_book as static_book
    monkeypatch.setattr(static_book, "build", lambda *_, **__: pytest.fail("it builds the book"))
    assert cli.main(["book", "--check"]) == 2
    assert_one_sentence(capsys, "--check goes with --refresh")


def test_version(capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(["--version"])
    assert stop.value.code == 0
    assert capsys.readouterr().out == f"hydrolab {hydrolab.__version__}\n"



@pytest.mark.skipif(os.name == "nt", reason="sends a POSIX signal")
def test_lab_starts_and_ctrl_c_ends_it(book, tmp_path):
    code = ("import sys, pathlib, signal; from hydrolab import cli; cli.find_book = lambda: "
            "pathlib.Path(sys.argv[1]); "
            # a background job starts with it ignored
            "signal.signal(signal.SIGINT, signal.default_int_handler); "
            "sys.exit(cli.main(sys.argv[2:]))")
    process = subprocess.Popen([sys.executable, "-c", code, str(book), "lab", "--no-browser"],
                               cwd=tmp_path, text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8",
                               env=os.environ | {"JUPYTER_CONFIG_DIR": str(tmp_path / "config")})
    try:
        lines = []
        deadline = time.monotonic() + 120
        while not (lines and re.search(r"http://127\.0\.0\.1:\d+/lab",
                                       lines[-1])) and time.monotonic() < deadline:
            line = process.stdout.readline()
            assert line, "".join(lines)
            lines.append(line)
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert process.returncode == 0, rest
    assert "Traceback" not in "".join(lines) + rest
    assert rest.rstrip().endswith(f"Your notebooks are in {tmp_path / 'hydrolab-book'}.")
    assert (tmp_path / "hydrolab-book" / "00-start-here.ipynb").read_text().startswith("shipped")


@pytest.mark.skipif(os.name == "nt", reason="needs a POSIX pipe")
def test_a_closed_pipe_is_no_traceback(tmp_path):
    code = ("import sys, types; m = types.ModuleType('hydrolab.paper.report'); "
            "m.study_command = lambda *a, **k: [print('x' * 1000, flush=True) for _ in "
            "range(1000)] and 0; "
            "sys.modules['hydrolab.paper.report'] = m; from hydrolab.cli import main; "
            "sys.exit(main(['study']))")
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    process.stdout.readline()
    process.stdout.close()
    assert process.stderr.read() == ""
    process.stderr.close()
    assert process.wait(60) == 141


def test_a_saved_notebook_keeps_pictures_and_no_dead_widgets():
    """The hook that JupyterLab calls before each save."""
    view = "application/vnd.jupyter.widget-view+json"
    content = {"metadata": {"widgets": {}, "mine": 1}, "cells": [
        {"outputs": [{"data": {"text/html": "picture", view: {}}}, {"data": {view: {}}},
                     {"output_type": "stream", "text": "words"}]}, {}]}
    cli._without_views({"type": "notebook", "content": content}, path="a.ipynb")
    assert content["cells"][0]["outputs"] == [
        {"data": {"text/html": "picture"}}, {"data": {view: {}}},
        {"output_type": "stream", "text": "words"}]
    assert content["metadata"] == {"mine": 1}
    cli._without_views({"type": "directory", "content": None})
