"""Every command that the README and environment-notes.md show runs: each line of their fenced
blocks is here or with the tools of the work on the code (test_tools.py), and none is that they do
not show. Lines that install are CI's (.ci/run) or a person's.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_tools import TOOLS, environment, ran

ROOT = Path(__file__).resolve().parents[1]
PAGES = ("README.md", "environment-notes.md")
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```", re.DOTALL | re.MULTILINE)
INSTALLS = re.compile(r"(pip install|uv pip) .*-c|uv pip compile")

# The command as shown: what a test adds to it so that it ends soon, and words of its answer.
RUNS = {
    "hydrolab lab --students handout": ([], "without solutions are in handout"),
    "hydrolab study": (["--no-figures"], "claims hold on"),
    "hydrolab study my-unit.toml": (["--no-figures"], "Balance of generator"),
    "hydrolab report my-unit.toml --out my-unit.html": ([], "Written to my-unit.html"),
    "hydrolab show --run-sheet 15-minutes --record fallback.html": ([], "without a network"),
    "hydrolab show --eccentricity 8.8 --orbit 3 --record machine.html": ([], "without a network"),
    "hydrolab book --refresh 1": (["--check"], "passed"),
}
# Servers, stopped by Ctrl-C when they have said where they are.
SERVERS = {
    "hydrolab show": ["--no-browser"],
    "hydrolab show --room --run-sheet 15-minutes": ["--no-browser", "--host", "127.0.0.1"],
}


def shown() -> set[str]:
    """The commands in the pages' blocks for a shell, one by one, without those that install."""
    found = set()
    for page in PAGES:
        for kind, block in BLOCK.findall((ROOT / page).read_text(encoding="utf-8")):
            for line in block.splitlines() if kind == "sh" else ():
                if not INSTALLS.search(line):
                    found.add(line.replace(".venv/bin/", "").strip())
    return found


def test_no_command_is_forgotten():
    assert shown() == set(RUNS) | set(TOOLS) | set(SERVERS)


@pytest.mark.parametrize("command", RUNS)
def test_a_command_runs(command, tmp_path):
    more, answer = RUNS[command]
    card = (ROOT / "hydrolab" / "machine" / "cards" / "jeffcott.toml").read_text(encoding="utf-8")
    (tmp_path / "my-unit.toml").write_text(card, encoding="utf-8")
    assert answer in ran(command, more, tmp_path)


@pytest.mark.skipif(os.name == "nt", reason="sends a POSIX signal")
@pytest.mark.parametrize("command", SERVERS)
def test_a_server_answers_and_stops(command, tmp_path):
    arguments = [sys.executable, "-m", "hydrolab.cli", *command.split()[1:], *SERVERS[command]]
    process = subprocess.Popen(arguments, cwd=tmp_path, env=environment(), stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True, encoding="utf-8")
    said = []
    try:
        for line in process.stdout:
            said.append(line)
            if "Stop with Ctrl-C" in line:
                process.send_signal(signal.SIGINT)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
    assert "http://127.0.0.1:" in "".join(said) and "The 3D view is closed." in said[-1], said


def test_the_python_of_the_readme_runs(capsys):
    """The first page of use, and `show` of what it made."""
    blocks = [block for kind, block in BLOCK.findall((ROOT / "README.md").read_text("utf-8"))
              if kind == "python"]
    names: dict[str, object] = {}
    for block in sorted(blocks, key=lambda block: "show(" in block):
        exec(compile(block, "README.md", "exec"), names)
    assert "1X" in capsys.readouterr().out and names["branch"].folds


def test_the_commit_hooks_are_ci_s():
    hooks = (ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8")
    steps = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    entries = re.findall(r"entry: (.*)", hooks)
    assert entries and all(f".venv/bin/{entry}" in steps for entry in entries)
    if shutil.which("git") and (ROOT / ".git").exists():
        done = subprocess.run([sys.executable, "-m", "pre_commit", "validate-config"], cwd=ROOT,
                              check=False)
        assert done.returncode == 0
