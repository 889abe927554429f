"""The course as a JupyterLite site: JupyterLab and Python in the browser, nothing installed.

One folder of files that any web server can serve. Python itself is Pyodide (CPython compiled to
WebAssembly); hydrolab and what it needs become packages of its distribution, so that a notebook's
kernel starts with everything importable and no cell installs anything. With a Pyodide distribution
at hand nothing is fetched when a page is read; without one the large packages come from the public
distribution that `PUBLIC` names, and all else from the folder.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import http.server
import importlib.metadata
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import webbrowser
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from hydrolab import __version__
from hydrolab.addresses import trouble
from hydrolab.course import answers
from hydrolab.course.static_book import record_scenes
from hydrolab.errors import BadInput

CARDS = Path(__file__).resolve().parents[1] / "machine" / "cards"
SCRIPT, BYTECODE = (Path(__file__).with_name(name) for name in ("live_page.js", "bytecode.js"))
PYODIDE = "0.27.7"  # what jupyterlite-pyodide-kernel 0.6 is made for
PUBLIC = f"https://cdn.jsdelivr.net/pyodide/v{PYODIDE}/full/"
PORT = 8010
NEEDED = ("jupyterlite_core", "jupyterlite_pyodide_kernel")
EXTENSIONS = ("anywidget", "@jupyter-widgets/jupyterlab-manager",
              "@jupyterlite/pyodide-kernel-extension")  # of all that JupyterLab has here
CORE = ("pyodide.js", "pyodide.asm.js", "pyodide.asm.wasm", "python_stdlib.zip")
# What the kernel starts with. The first seven it would otherwise look up and install one by one.
KERNEL = ("micropip", "piplite", "ssl", "sqlite3", "ipykernel", "comm", "pyodide-kernel", "jedi",
          "ipython")
COURSE = ("numpy", "scipy", "matplotlib", "pillow", "hydrolab")
# Pure Python packages that the chapters need and Pyodide does not have.
PURE = {"sympy": ("mpmath",), "mpmath": (), "threadpoolctl": (), "tomlkit": (),
        "ipywidgets": ("comm", "jupyterlab-widgets", "traitlets", "ipython"),
        "jupyterlab-widgets": (), "anywidget": ("ipywidgets", "psygnal", "typing-extensions"),
        "psygnal": (), "typing-extensions": (), "comm": ("traitlets",), "traitlets": (),
        "rich": ("markdown-it-py", "pygments"), "markdown-it-py": ("mdurl",), "mdurl": ()}
# What a chapter has imported when it begins: these modules come as bytecode.
FIRST = """import IPython, pyodide_kernel, piplite, ipywidgets, anywidget, matplotlib.pyplot
import matplotlib_inline.backend_inline, hydrolab.figures, hydrolab.explorers"""
# What Pyodide's packages hold or ask for and no chapter uses: 13 MB.
UNUSED = re.compile(r"scipy/misc/.*\.dat|scipy/stats/_sobol.*\.npz|scipy/io/_fast_matrix_market/.*"
                    r"|matplotlib/mpl-data/(sample_data|fonts/(afm|pdfcorefonts))/.*"
                    r"|matplotlib/mpl-data/fonts/ttf/DejaVu(Serif.*|SansMono-.*)\.ttf"
                    r"|jedi/third_party/(django-stubs|typeshed/third_party)/.*")
UNASKED = ("fonttools", "pytz", "openssl")
OLD_FONTS = (".eot", ".svg", ".ttf")  # for browsers that cannot run the course
NEEDS = ("numpy", "scipy", "matplotlib", "pillow", *PURE)  # of hydrolab there
IMPORTS = {"pyodide-kernel": ("pyodide_kernel",), "typing-extensions": ("typing_extensions",),
           "markdown-it-py": ("markdown_it",), "jupyterlab-widgets": ("jupyterlab_widgets",)}
SETTINGS = {  # of JupyterLab: what is typed survives a reload, and leaves in one click
    "@jupyterlab/docmanager-extension:plugin": {"autosaveInterval": 5},
    "@jupyterlab/notebook-extension:panel": {"toolbar": [
        {"name": "download", "command": "docmanager:download", "rank": 11, "label": "Download"}]},
    "@jupyterlab/apputils-extension:notification": {
        "checkForUpdates": False, "fetchNews": "false", "doNotDisturbMode": True},
}
FRONT = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>hydrolab</title>
{forward}
<script id="jupyter-config-data" type="application/json" data-jupyter-lite-root=".">{{}}</script>
</head>
<body><p><a href="lab/index.html?path={first}">Open the course</a>. {where}</p></body></html>
"""
Packed = tuple[str, Path, tuple[str, ...], tuple[str, ...]]  # name, wheel, needs, imports
FONT_FIELDS = ("fname", "name", "style", "variant", "weight", "stretch", "size", "__class__")


def build_site(course: Path, out: Path, pyodide: Path | None = None) -> str:
    """Build the site into a folder and return one sentence on it.

    course: a folder with what a student works with. out: the folder; what an earlier build left is
    replaced. pyodide: a Pyodide distribution, a folder or an archive of one; without it its core is
    fetched with npm, and its packages stay on the public server.
    Raises BadInput where the tools are missing, the distribution lacks something, or `out` holds
    anything else.
    """
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise BadInput(f"The live course needs {', '.join(missing)}; install hydrolab with its "
                       'extra: pip install -e ".[live]"')
    ours = (out / "jupyter-lite.json").is_file()
    if out.exists() and not ours and (not out.is_dir() or any(out.iterdir())):
        raise BadInput(f"--out is {out}, which holds something else than an earlier build; name "
                       "an empty folder.")
    with tempfile.TemporaryDirectory(prefix="hydrolab-live-") as name:
        work, made = Path(name), Path(name, "site")
        core = _unpacked(pyodide, work / "core") if pyodide else _from_npm(work / "core")
        _check_version(core)
        shutil.copytree(CARDS, course / "cards", dirs_exist_ok=True)
        (work / "overrides.json").write_text(json.dumps(SETTINGS), encoding="utf-8")
        _jupyterlite(work, course, made)
        scenes = json.dumps(record_scenes(made / "scenes"))
        _distribution(core, made / "pyodide", scenes, public=pyodide is None)
        _configure(made, min(path.name for path in course.glob("*.ipynb")), public=pyodide is None)
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(made, out)
    size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file()) / 1e6
    said = f"{out} holds the live course, {size:.0f} MB"
    return f"{said}; no page asks another computer." if pyodide else (
        f"{said}. Its pages fetch NumPy, SciPy and Matplotlib from {PUBLIC}; with --pyodide and a "
        "Pyodide distribution they ask no other computer.")


def _unpacked(source: Path, target: Path) -> Path:
    """The folder of a distribution that is a folder or an archive: where its lock file lies."""
    if source.is_dir():
        target = source
    elif source.is_file() and tarfile.is_tarfile(source):
        with tarfile.open(source) as archive:
            archive.extractall(target, filter="data")
    elif source.is_file() and zipfile.is_zipfile(source):
        with zipfile.ZipFile(source) as archive:
            archive.extractall(target)
    else:
        raise BadInput(f"--pyodide is {source}; it must be a folder or an archive (tar, zip) of a "
                       f"Pyodide {PYODIDE} distribution.")
    locks = sorted(target.rglob("pyodide-lock.json"), key=lambda path: len(path.parts))
    if not locks:
        raise BadInput(f"--pyodide is {source}, which has no pyodide-lock.json; it must be a "
                       f"Pyodide {PYODIDE} distribution.")
    return locks[0].parent


def _from_npm(target: Path) -> Path:
    """Pyodide's core, which npm has; its packages are not there."""
    npm = shutil.which("npm")
    done = npm and subprocess.run([npm, "pack", "--silent", f"pyodide@{PYODIDE}"], text=True,
                                  cwd=_made(target), capture_output=True, timeout=300, check=False)
    if not done or done.returncode:
        raise BadInput("The live course needs Pyodide: give a distribution with --pyodide, or "
                       "install npm, which fetches its core.")
    return _unpacked(target / done.stdout.strip().split("\n")[-1], target)


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _check_version(core: Path) -> None:
    """Raise BadInput for another version than the kernel is made for."""
    found = json.loads((core / "pyodide-lock.json").read_text(encoding="utf-8"))["info"]["version"]
    if found.rsplit(".", 1)[0] != PYODIDE.rsplit(".", 1)[0]:
        raise BadInput(f"--pyodide is version {found}; the browser's kernel needs {PYODIDE}.")


def _jupyterlite(work: Path, contents: Path, made: Path) -> None:
    """Run JupyterLite's own build: JupyterLab, the widgets' extensions, the kernel, the files."""
    share = Path(sys.prefix) / "share" / "jupyter" / "labextensions"
    config = {"contents": [str(contents)], "output_dir": str(made),
              "apps": ["lab", "tree", "notebooks"], "no_sourcemaps": True,
              "no_unused_shared_packages": True, "no_libarchive": True,
              "ignore_sys_prefix": ["federated_extensions"],
              "federated_extensions": [str(share / name) for name in EXTENSIONS]}
    (work / "jupyter_lite_config.json").write_text(json.dumps({"LiteBuildConfig": config}),
                                                   encoding="utf-8")
    command = [sys.executable, "-m", "jupyter", "lite", "build"]
    done = subprocess.run(command, cwd=work, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BadInput(f"The live course was not built:\n{(done.stdout + done.stderr)[-3000:]}")
    for font in made.glob("build/fa-*"):
        if font.suffix in OLD_FONTS:
            font.unlink()


def _distribution(core: Path, target: Path, scenes: str, *, public: bool) -> None:
    """Write the distribution that the kernel starts from; scenes: what is recorded, as JSON."""
    target.mkdir()
    for name in CORE:
        shutil.copyfile(core / name, target / name)
    lock = json.loads((core / "pyodide-lock.json").read_text(encoding="utf-8"))
    packages: dict[str, dict[str, Any]] = lock["packages"]
    more = {"hydrolab/live/recorded.json": scenes}
    if (wheel := core / packages["matplotlib"]["file_name"]).is_file():
        more["matplotlib/fontlist.json"] = _font_list(wheel)
    for name, wheel, needs, imports in _own_wheels(target, more):
        packages[name] = _entry(name, wheel, needs, imports, target)
    for entry in packages.values():
        entry["depends"] = [need for need in entry["depends"] if need not in UNASKED]
    kept = dict(sorted((name, packages[name]) for name in _closure(packages, (*KERNEL, *COURSE))))
    for entry in kept.values():
        if public and not (target / entry["file_name"]).is_file():
            entry["file_name"] = PUBLIC + entry["file_name"]
        elif not public:
            _copy_used(core, target, entry["file_name"])
    _write_lock(target, lock | {"packages": kept})
    if not public:
        for name, code in _bytecode(core, target, kept).items():
            _compile(target / kept[name]["file_name"], code, sources=name == "hydrolab")
        _write_lock(target, lock | {"packages": kept})


def _write_lock(folder: Path, lock: Mapping[str, Any]) -> None:
    """Write a distribution's lock file, with the checksums of the packages that lie beside it."""
    for entry in lock["packages"].values():
        if (path := folder / entry["file_name"]).is_file():
            entry["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    (folder / "pyodide-lock.json").write_text(json.dumps(lock, indent=1), encoding="utf-8")


def _copy_used(core: Path, folder: Path, name: str) -> None:
    """Copy a package of the distribution, a wheel without what no chapter uses, where the folder
    has none.
    """
    source, target = core / name, folder / name
    if target.is_file():
        return
    if not source.is_file():
        raise BadInput(f"--pyodide has no {source.name}, which the course needs; give the full "
                       "distribution.")
    if source.suffix != ".whl":
        shutil.copyfile(source, target)
        return
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for item in old.infolist():
            if not UNUSED.fullmatch(item.filename):
                new.writestr(item, old.read(item), zipfile.ZIP_DEFLATED, 9)


def _bytecode(core: Path, target: Path, packages: Mapping[str, Mapping[str, Any]],
              ) -> dict[str, dict[str, bytes]]:
    """Bytecode of the modules that a chapter imports first, by package and place in its wheel;
    none where there is no Node to run the distribution's Python.
    """
    node = shutil.which("node")
    if node is None or not (core / "pyodide.mjs").is_file():
        return {}
    with tempfile.TemporaryDirectory() as work:
        made = Path(work, "bytecode.zip")
        done = subprocess.run([node, BYTECODE, core, target, " ".join(packages), FIRST, made],
                              capture_output=True, text=True, timeout=300, check=False)
        if done.returncode:
            raise BadInput(f"--pyodide has a Python that Node does not run:\n{done.stderr}")
        with zipfile.ZipFile(made) as archive:
            code = {item.filename: archive.read(item) for item in archive.infolist()}
    found = {}
    for name, entry in packages.items():
        if entry["file_name"].endswith(".whl"):
            with zipfile.ZipFile(target / entry["file_name"]) as wheel:
                found[name] = {place: code[place] for place in wheel.namelist() if place in code}
    return found


def _compile(wheel: Path, bytecode: Mapping[str, bytes], *, sources: bool) -> None:
    """Put bytecode into a wheel, beside the sources or in their place: Python begins a third
    sooner, and the folder stays small. Who looks for a source that is gone sees only its name.
    """
    compiled = wheel.with_suffix(".compiled")
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(compiled, "w") as new:
        for item in old.infolist():
            code, path = bytecode.get(item.filename), PurePosixPath(item.filename)
            if code is None or sources:
                new.writestr(item, old.read(item), zipfile.ZIP_DEFLATED, 9)
            if code is not None:
                beside = path.parent / "__pycache__" / f"{path.stem}.cpython-312.pyc"
                new.writestr(str(beside if sources else path.with_suffix(".pyc")), code,
                             zipfile.ZIP_DEFLATED, 9)
    compiled.replace(wheel)


def _closure(packages: Mapping[str, Mapping[str, Any]], wanted: Iterable[str]) -> set[str]:
    """The packages wanted and all that they need."""
    found: set[str] = set()
    left = [name.lower().replace("_", "-") for name in wanted]
    while left:
        name = left.pop()
        if name not in packages:
            raise BadInput(f"The Pyodide distribution has no package {name}; give the full one.")
        if name not in found:
            found.add(name)
            left += [need.lower().replace("_", "-") for need in packages[name]["depends"]]
    return found


def _entry(name: str, wheel: Path, needs: Iterable[str], imports: Iterable[str],
           target: Path) -> dict[str, Any]:
    """A line of the lock file for a wheel, copied into the distribution."""
    if wheel.parent != target:
        shutil.copyfile(wheel, target / wheel.name)
    return {"depends": list(needs), "file_name": wheel.name, "imports": list(imports),
            "install_dir": "site", "name": name, "package_type": "package",
            "unvendored_tests": False, "version": wheel.name.split("-")[1]}


def _own_wheels(target: Path, more: Mapping[str, str]) -> Iterator[Packed]:
    """Name, wheel, needs and imports of each package that Pyodide does not bring."""
    kernel = target.parent / "extensions" / "@jupyterlite" / "pyodide-kernel-extension"
    for name, needs in (("piplite", ("micropip",)), ("pyodide-kernel", ("ipykernel", "ipython")),
                        ("ipykernel", ("comm", "traitlets"))):
        stem = f"{name.replace('-', '_')}-"
        wheel = next(kernel.rglob(f"{stem}*.whl"))
        yield name, wheel, needs, IMPORTS.get(name, (name,))
    for name, needs in PURE.items():
        yield name, _wheel_of(name, target), needs, IMPORTS.get(name, (name,))
    yield "hydrolab", _wheel_of_hydrolab(target, more), NEEDS, ("hydrolab",)
    yield "ssl", _empty_wheel(target / "ssl-1.0.0-py3-none-any.whl"), (), ()  # the kernel asks


def _empty_wheel(wheel: Path, mode: str = "w") -> Path:
    """A wheel with nothing but what makes it one; mode "a" makes one of the files it has."""
    name, version = wheel.name.split("-")[:2]
    info = f"{name}-{version}.dist-info"
    with zipfile.ZipFile(wheel, mode, zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{info}/METADATA",
                         f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nGenerator: hydrolab\n"
                         "Root-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{info}/RECORD", "")
    return wheel


def _wheel_of(name: str, target: Path) -> Path:
    """A wheel of an installed package in Python alone, without tests and compiled copies."""
    package = importlib.metadata.distribution(name)
    wheel = target / f"{name.replace('-', '_')}-{package.version}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in package.files or ():
            if not ({"..", "tests", "__pycache__"} & set(path.parts)
                    or path.suffix in (".so", ".pyd")):
                archive.write(path.locate(), path.as_posix())
    return wheel


def _wheel_of_hydrolab(target: Path, more: Mapping[str, str]) -> Path:
    """A wheel of the hydrolab that runs this, as it stands, and more files by where they go."""
    package = Path(__file__).resolve().parents[1]
    wheel = target / f"hydrolab-{__version__}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(package.rglob("*")):
            part = path.relative_to(package)
            if path.is_file() and not {"__pycache__", "_book"} & set(part.parts):
                archive.write(path, f"hydrolab/{part.as_posix()}")
        for path in answers.files().values():
            archive.write(path, f"hydrolab/_book/exercises/{path.name}")
        for place, text in more.items():
            archive.writestr(place, text)
    return _empty_wheel(wheel, "a")


def _font_list(wheel: Path) -> str:
    """The list that a wheel of Matplotlib would make of its own fonts at the first picture."""
    import matplotlib.font_manager as here
    with zipfile.ZipFile(wheel) as archive:
        source = archive.read("matplotlib/font_manager.py").decode()
    version = re.search(r"__version__ = (.+)", source)[1].strip("'\"")  # type: ignore[index]
    made = json.loads(json.dumps(here.fontManager, cls=here._JSONEncoder))
    made["_version"] = int(version) if version.isdigit() else version
    for kind in ("ttflist", "afmlist"):  # a newer Matplotlib's entries have more fields
        made[kind] = [{key: value for key, value in entry.items() if key in FONT_FIELDS}
                      for entry in made[kind] if entry["fname"].startswith("fonts/")
                      and not UNUSED.fullmatch(f"matplotlib/mpl-data/{entry['fname']}")]
    return json.dumps(made)


def _configure(made: Path, first: str, *, public: bool) -> None:
    """Tell the kernel where its distribution is and what to start with; begin on a chapter."""
    packages = [*KERNEL, *COURSE, "anywidget", "sympy"]
    kernel = {"pyodideUrl": "./pyodide/pyodide.js", "disablePyPIFallback": True,
              "loadPyodideOptions": {
                  "packages": packages, "lockFileURL": "./pyodide/pyodide-lock.json"}}
    path = made / "jupyter-lite.json"
    config = json.loads(path.read_text(encoding="utf-8"))
    data = config["jupyter-config-data"]
    data |= {"appName": "hydrolab", "exposeAppInBrowser": True}
    where = f"It fetches Python's packages from {PUBLIC}, and asks no other computer."
    forward = f'<meta http-equiv="refresh" content="0; url=lab/index.html?path={first}">'
    page = FRONT.format(first=first, where=where if public else "",
                        forward="" if public else forward)
    (made / "index.html").write_text(page, encoding="utf-8")
    lab = made / "lab" / "index.html"
    lab.write_text(lab.read_text(encoding="utf-8").replace(
        "</head>", f"<script>{SCRIPT.read_text(encoding='utf-8')}</script></head>", 1),
        encoding="utf-8")
    data["litePluginSettings"] = data.get("litePluginSettings", {}) | {
        "@jupyterlite/pyodide-kernel-extension:kernel": kernel}
    path.write_text(json.dumps(config, indent=1), encoding="utf-8")


class Handler(http.server.SimpleHTTPRequestHandler):
    """Serves the site's files with the types that a browser insists on, and says nothing."""

    extensions_map = http.server.SimpleHTTPRequestHandler.extensions_map | {
        ".wasm": "application/wasm", ".mjs": "text/javascript", ".js": "text/javascript",
        ".whl": "application/zip", ".ipynb": "application/json", "": "application/octet-stream"}

    def log_message(self, *args: Any) -> None:
        """Print nothing: what a reader opens is the reader's own business."""

    def handle(self) -> None:
        """Serve, unless the reader has left meanwhile."""
        with contextlib.suppress(ConnectionError):
            super().handle()


def serve_site(folder: Path, port: int = 0) -> http.server.ThreadingHTTPServer:
    """A server of the site in a folder, on this computer alone and not yet running; port 0 takes a
    free one.
    """
    return http.server.ThreadingHTTPServer(("127.0.0.1", port),
                                           functools.partial(Handler, directory=str(folder)))


def serve(folder: Path, *, browser: bool) -> None:
    """Serve the site in a folder on this computer until Ctrl-C; open it in the browser if asked.

    At the same port each time if it is free: a browser keeps what is typed by address and port.
    """
    server = serve_site(folder, PORT if trouble("127.0.0.1", PORT) is None else 0)
    address = f"http://127.0.0.1:{server.server_address[1]}/"
    print(f"The course is at {address}. Stop it with Ctrl-C.", flush=True)
    if browser:
        webbrowser.open(address)
    with server, contextlib.suppress(KeyboardInterrupt):
        server.serve_forever()
    print("The course is closed. What you typed is kept in the browser.")
