"""The command `hydrolab`: `lab` opens the course, `book` builds its pages, `study` repeats the
paper's study, `report` says what an engineer asks of a unit, `show` opens the machine in 3D.
"""

from __future__ import annotations

import argparse
import errno
import importlib.util
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hydrolab import __version__
from hydrolab.addresses import in_words, trouble
from hydrolab.errors import BadInput, Contact, NoConvergence

LEFT_OUT = ("_build", "_static", "instructor", "exercises", "conf.py", "index.md",
            "bibliography.md", "api.md", ".ipynb_checkpoints", "__pycache__")
PAPER_CARD = "kaplan-150rpm"
ANNOUNCEMENTS = "@jupyterlab/apputils-extension:announcements"


def find_book() -> Path:
    """Return the folder of the course: the clone's `book`, or the copy in an installed wheel."""
    package = Path(__file__).resolve().parent
    clone = package.parent / "book"
    for folder in (clone, package / "_book"):
        if folder.is_dir() and (folder != clone or (package.parent / "pyproject.toml").is_file()):
            return folder
    raise BadInput("The course's notebooks are not beside this installation; "
                   "install hydrolab again from its project folder.")


def course_files(book: Path) -> Iterator[Path]:
    """Yield the files a student works with, relative to the book, in order."""
    for path in sorted(book.rglob("*")):
        relative = path.relative_to(book)
        if path.is_file() and not any(part in LEFT_OUT for part in relative.parts):
            yield relative


def copy_new(source: Path, target: Path) -> bool:
    """Copy source to target whole or not at all; False, and nothing is done, if target exists."""
    if target.exists() or target.is_symlink():
        return False
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".copying-{os.getpid()}-{target.name}")
    try:
        shutil.copyfile(source, part)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
    return True


def prepare_folder(folder: Path, book: Path | None = None) -> tuple[list[Path], list[Path]]:
    """Copy into a folder what it lacks of the course in `book` (by default the shipped one). Return
    (copied, kept): a kept file differs from the shipped one.
    """
    book = book or find_book()
    folder = folder.resolve()
    if folder == book or folder.is_relative_to(book):
        raise BadInput(f"--dir is {folder}, inside the shipped course; choose a folder elsewhere.")
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"--dir is {folder}, a file; choose a folder.")
    copied, kept = [], []
    for relative in course_files(book):
        shipped, mine = book / relative, folder / relative
        if copy_new(shipped, mine):
            copied.append(relative)
        elif not mine.is_file() or mine.read_bytes() != shipped.read_bytes():
            kept.append(relative)
    folder.mkdir(parents=True, exist_ok=True)
    return copied, kept


def lab_arguments(folder: Path, *, ip: str, port: int | None, browser: bool) -> list[str]:
    """Return JupyterLab's own arguments for a folder to open, an ip to listen on, a port (None for
    8888 or the next free one) and whether it opens a browser.
    """
    first = next((path.name for path in sorted(folder.glob("00*.ipynb"))), None)
    arguments = [
        f"--ServerApp.root_dir={folder}",
        f"--ServerApp.ip={ip}",
        f"--LabApp.default_url=/lab/tree/{first}" if first else "--LabApp.default_url=/lab",
        # one Ctrl-C is enough; what is open is saved every two minutes
        "--ServerApp.answer_yes=True",
        "--ServerApp.log_level=WARN",  # the address stays in sight
        # no search for editors' servers, which take a second Ctrl-C
        "--LanguageServerManager.autodetect=False",
    ]
    if port is not None:
        arguments += [f"--ServerApp.port={port}", "--ServerApp.port_retries=0"]
    if not browser:
        arguments.append("--no-browser")
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        # a container's only user; the token still guards the server
        arguments.append("--allow-root")
    return arguments


def without_announcements(handler: Any, page: dict[str, Any]) -> dict[str, Any]:
    """Take JupyterLab's question about news, and with it the look for updates, out of the page that
    a handler is about to send.
    """
    return page | {"disabledExtensions": [*page.get("disabledExtensions", ()), ANNOUNCEMENTS]}


def _without_views(model: dict[str, Any], **more: Any) -> None:
    """Before a notebook is saved: an output that has a picture keeps it alone. JupyterLab prefers
    a widget's view, and a reopened notebook has no kernel that knows the widget.
    """
    if model.get("type") != "notebook" or not model.get("content"):
        return
    for cell in model["content"]["cells"]:
        for output in cell.get("outputs", ()):
            if "text/html" in output.get("data", ()):
                output["data"].pop("application/vnd.jupyter.widget-view+json", None)
    model["content"]["metadata"].pop("widgets", None)


def lab(options: argparse.Namespace) -> int:
    """Copy the course into a working folder, where files already there stay, and open it in
    JupyterLab.
    """
    if options.students is not None:
        from hydrolab.course.hand_out import hand_out, update

        write = update if options.update else hand_out
        print(write(find_book(), course_files(find_book()), options.students))
        return 0
    if options.update:
        raise BadInput("--update goes with --students: hydrolab lab --students DIR --update.")
    if importlib.util.find_spec("jupyterlab") is None:
        raise BadInput(f"JupyterLab is not installed for {sys.executable}; install it with: pip "
                       "install jupyterlab")
    if options.port is not None or options.ip != "127.0.0.1":
        port = options.port or 0
        if (problem := trouble(options.ip, port)) is not None:
            raise BadInput(in_words(problem, options.ip, port, "--ip", "--port"))
    copied, kept = prepare_folder(options.dir)
    folder = options.dir.resolve()
    print(f"The course is in {folder} ({len(copied)} files copied). It is yours to edit.")
    if kept:
        print(f"Kept as you left them: {', '.join(map(str, kept[:3]))}"
              f"{' …' if len(kept) > 3 else ''}. Move a file away to get the shipped one again.")
    print("Save your notebooks before you stop with Ctrl-C.", flush=True)

    from jupyterlab.labapp import LabApp

    try:
        server = LabApp.initialize_server(
            argv=lab_arguments(folder, ip=options.ip, port=options.port,
                               browser=not options.no_browser))
        server.web_app.settings["page_config_hook"] = without_announcements
        server.contents_manager.register_pre_save_hook(_without_views)
        if not server.identity_provider.token_generated:  # else JupyterLab says it, with the token
            print(f"JupyterLab is at {server.display_url}", flush=True)
        server.start()
    except KeyboardInterrupt:
        pass
    print(f"JupyterLab is closed. Your notebooks are in {folder}.")
    return 0


def study(options: argparse.Namespace) -> int:
    """Repeat the paper's study on its own unit; of the unit of any other card say what an engineer
    asks, and write it as a page.
    """
    if options.card == PAPER_CARD:
        from hydrolab.figures import study_pictures
        from hydrolab.paper.report import study_command

        return study_command(out=options.out, family=options.family,
                             draw=None if options.no_figures else study_pictures)
    from hydrolab.figures.unit_page import study_unit

    if options.family:  # a copy may keep the name and change the numbers
        raise BadInput(f"--family was given with {options.card}; the family is one of the paper's "
                       f"machine, the shipped card {PAPER_CARD}.")
    return study_unit(options.card, out=options.out, draw=not options.no_figures)


def report(options: argparse.Namespace) -> int:
    """Write a report on the unit of a card, as one page that prints to a clean PDF: what an
    engineer asks, each answer beside its limit, and where every number comes from.
    """
    from hydrolab import rpm
    from hydrolab.figures.unit_page import report_command

    speeds = {name: rpm(value) for name in ("overspeed", "runaway")
              if (value := getattr(options, name)) is not None}
    return report_command(options.card, out=options.out, record=options.record, **speeds)


def book(options: argparse.Namespace) -> int:
    """Build the static book from the stored chapters; with --refresh, run the chapters and store
    what comes out; with --live, build the course that runs in a browser.
    """
    folder = find_book()
    if options.live:
        return live_book(folder, options)
    if given := [f"--{name}" for name in ("pyodide", "students", "serve")
                 if getattr(options, name)]:
        raise BadInput(f"{given[0]} goes with --live: hydrolab book --live {given[0]}.")
    if options.refresh is None and options.check:
        raise BadInput("--check goes with --refresh: hydrolab book --refresh --check compares and "
                       "writes nothing.")
    if options.refresh is not None:
        from hydrolab.course.pages import card_page
        from hydrolab.course.refresh import refresh_all

        if not options.check:
            (folder / "card.md").write_text(card_page(), encoding="utf-8", newline="\n")
        return refresh_all(folder, options.refresh, compare=options.check)
    if options.figures:
        from hydrolab.course.pages import figures_page

        options.figures.write_text(figures_page(folder), encoding="utf-8", newline="\n")
        print(f"The chapters' figures are in {options.figures}, one a screen; arrow keys turn.")
        return 0
    from hydrolab.course.static_book import build

    print(build(folder, options.out or folder / "_build" / "html", instructor=options.instructor))
    return 0


def live_book(folder: Path, options: argparse.Namespace) -> int:
    """Build the course of a folder that runs in a browser, and its pages beside it; the options say
    whether it is served on this computer.
    """
    from hydrolab.course.browser_site import build_site, serve
    from hydrolab.course.hand_out import hand_out
    from hydrolab.course.static_book import build

    out = options.out or folder / "_build" / "live"
    with tempfile.TemporaryDirectory(prefix="hydrolab-course-") as work:
        contents = Path(work, "course")
        if options.students:
            hand_out(folder, course_files(folder), contents)
        else:
            prepare_folder(contents, folder)
        print(build_site(contents, out, options.pyodide), flush=True)
    if not options.students:  # the pages hold the solutions
        print(build(folder, out / "pages", live=out), flush=True)
    if options.serve:
        serve(out, browser=not options.no_browser)
    return 0


def grade(options: argparse.Namespace) -> int:
    """Say what a class has handed in: student by exercise, sums, and mistakes by how often they
    were made; write it as grades.csv too. Nothing of theirs is executed."""
    from hydrolab.course.grade import report

    print(report(options.folder, options.exam, find_book()))
    return 0


def exam(options: argparse.Namespace) -> int:
    """Draw an exam from the bank, with other numbers for each student, statements and solutions
    apart."""
    from hydrolab.course.exam import read_students, write_exam

    students = read_students(options.students, options.count)
    print(write_exam(find_book(), options.out, options.seed, students, options.minutes,
                     options.chapters))
    return 0


def show(options: argparse.Namespace) -> int:
    """Show a machine in 3D in the browser, on this computer alone. With --room everyone in the
    network can watch, and who gives the PIN can change things."""
    from hydrolab.live.command import find_run_sheet, show_command

    sheet = None
    if options.run_sheet:
        sheet = find_run_sheet(options.run_sheet, find_book() / "instructor")
    return show_command(options.card, room=options.room, host=options.host, port=options.port,
                        viewers=options.viewers, sheet=sheet, record=options.record,
                        browser=not options.no_browser, eccentricity=options.eccentricity,
                        orbit=options.orbit)


def port_number(text: str) -> int:
    """Return a port from a command line's text."""
    if not text.isascii() or not text.isdigit() or not 1 <= int(text) <= 65535:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no port; a port is a whole number from 1 to 65535")
    return int(text)


def _add_lab(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("--dir", type=Path, default=Path("hydrolab-book"), metavar="DIR",
        help="working folder for your copy of the course (default: %(default)s)")
    add("--port", type=port_number, help="port to listen on (default: 8888 or the next free one)")
    add("--ip", default="127.0.0.1", help="address to listen on (default: %(default)s)")
    add("--no-browser", action="store_true", help="print the address and open no browser")
    add("--students", type=Path, metavar="DIR",
        help="write a copy without solutions into a new folder, and open nothing")
    add("--update", action="store_true",
        help="with --students: bring a copy up to date, and keep what was written into it")


def _add_book(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("--out", type=Path, metavar="DIR", help="folder for the pages (default: book/_build/html)")
    add("--instructor", action="store_true", help="with the pages for instructors")
    add("--figures", type=Path, metavar="FILE",
        help="write the chapters' figures as one page to project, and nothing else")
    add("--refresh", nargs="*", metavar="CHAPTER",
        help="execute and clean these chapters (numbers, or notebooks; none: all chapters) and "
             "say what changed")
    add("--check", action="store_true",
        help="with --refresh: compare with what is stored, write nothing")
    add("--live", action="store_true",
        help="build the course with Python in the browser instead (default folder: "
             "book/_build/live)")
    add("--pyodide", type=Path, metavar="PATH",
        help="with --live: folder or archive of a Pyodide distribution, so that the pages ask no "
             "other computer")
    add("--students", action="store_true", help="with --live: without solutions")
    add("--serve", action="store_true",
        help="with --live: serve it on this computer and open the browser")
    add("--no-browser", action="store_true", help="with --serve: print the address only")


def _add_study(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("card", nargs="?", default=PAPER_CARD, metavar="CARD",
        help="name of a shipped machine card or path of your own TOML file (default: %(default)s, "
             "the paper's unit)")
    add("--out", type=Path, default=Path("hydrolab-study"), metavar="DIR",
        help="folder for report.json and the figures or the page (default: %(default)s)")
    add("--family", action="store_true",
        help="judge each claim on the whole family of machines too")
    add("--no-figures", action="store_true", help="compute and report, draw nothing")


def _add_report(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("card", metavar="CARD", help="name of a shipped machine card or path of your own TOML file")
    add("--out", type=Path, required=True, metavar="FILE.html", help="the page to write")
    add("--record", type=Path, metavar="CSV", help="a record of probes on the unit, to compare "
        "with the card: time or phase, and two columns a place")
    add("--overspeed", type=float, metavar="RPM", help="of a load rejection (default: 1.4 times "
        "the rated speed)")
    add("--runaway", type=float, metavar="RPM", help="speed without load (default: 2.5 times the "
        "rated speed)")


def _add_grade(command: argparse.ArgumentParser) -> None:
    command.add_argument("folder", type=Path, metavar="FOLDER", help="folder with the returned "
                         "notebooks: a folder or a notebook for each student")
    command.add_argument("--exam", type=Path, metavar="FILE", help="grade the exam of this "
                         "exam.json that `hydrolab exam` wrote")


def _add_exam(command: argparse.ArgumentParser) -> None:
    """Add the options of `hydrolab exam` to its part of the command line."""
    add = command.add_argument
    add("--out", type=Path, required=True, metavar="DIR", help="new folder for the exam")
    add("--seed", type=int, default=1, metavar="N", help="another seed draws another exam "
        "(default: %(default)s)")
    add("--students", type=Path, metavar="FILE", help="names, one a line")
    add("--count", type=int, default=1, metavar="N", help="without --students: how many students")
    add("--minutes", type=int, default=120, metavar="N", help="length (default: %(default)s)")
    add("--chapters", type=int, nargs="*", default=[], metavar="N",
        help="chapters that were taught (default: all)")


def _add_show(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add("card", nargs="?", metavar="CARD",
        help="name of a shipped machine card or path of your own TOML file "
             "(default: kaplan-150rpm)")
    add("--room", action="store_true",
        help="open it to the network: prints address, QR code and PIN")
    add("--host", metavar="ADDRESS",
        help="address to listen on (default: 127.0.0.1, with --room the computer's address in its "
             "network)")
    add("--port", type=port_number, help="port to listen on (default: 8080 or the next free one)")
    add("--viewers", type=int, default=100, metavar="N",
        help="how many may watch at once (default: %(default)s)")
    add("--run-sheet", metavar="NAME",
        help="steps for the presenter: 5-minutes, 15-minutes, 45-minutes or a TOML file of your "
             "own")
    add("--eccentricity", type=float, metavar="PERCENT",
        help="static eccentricity of the stator to begin with, %% of the air gap (default: 0)")
    add("--orbit", type=int, metavar="N",
        help="which steady state to begin with where there are several, counted along the branch "
             "(default: 1)")
    add("--record", type=Path, metavar="FILE.html",
        help="write a file that plays without a server instead")
    add("--no-browser", action="store_true", help="print the address and open no browser")


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    top = argparse.ArgumentParser(prog="hydrolab", description="Hydropower generator rotors under "
                                  "unbalanced magnetic pull: a course and a study.")
    top.add_argument("--version", action="version", version=f"hydrolab {__version__}")
    commands = top.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for run, add, words in ((lab, _add_lab, "open the course in JupyterLab"),
                            (book, _add_book, "build the static book, or refresh the chapters"),
                            (study, _add_study, "repeat the paper's study, or study your unit"),
                            (report, _add_report, "write a report on a unit, as one page"),
                            (exam, _add_exam, "draw an exam, statements and solutions apart"),
                            (grade, _add_grade, "mark what a class has handed in"),
                            (show, _add_show, "open the machine in 3D")):
        command = commands.add_parser(run.__name__, help=words, description=run.__doc__)
        add(command)
        command.set_defaults(run=run)
    return top


def say(sentence: object) -> None:
    """Print one sentence where errors go."""
    print(f"hydrolab: {sentence}", file=sys.stderr)


def elsewhere(error: OSError, options: argparse.Namespace) -> str:
    """What to try where an error refuses a write: the one of the options that names a place."""
    named = [f"--{name}" for name in ("dir", "out", "record") if hasattr(options, name)]
    if error.errno in (errno.EROFS, errno.EACCES, errno.EPERM) and named:
        return f" Name a place that you may write to with {named[0]}."
    return ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line (`arguments`, or what the program was called with). Return 0, 2 for what
    the user can put right, or 130 after Ctrl-C.
    """
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a console without Ω still gets its sentence
    options = argparse.Namespace()
    try:
        options = parser().parse_args(arguments)
        return options.run(options)
    except (BadInput, NoConvergence, Contact) as error:
        say(error)
        return 2
    except BrokenPipeError:  # `hydrolab study | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:
        say(f"{error.filename or 'the system'}: {error.strerror or error}."
            f"{elsewhere(error, options)}")
        return 2
    except KeyboardInterrupt:
        say("stopped by Ctrl-C; nothing more was written.")
        return 130


if __name__ == "__main__":
    sys.exit(main())
