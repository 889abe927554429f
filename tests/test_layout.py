"""What the tree promises: imports that point one way, a light import, clean files, documented
names.
"""

import ast
import importlib
import json
import re
import statistics
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "hydrolab"

# A module imports only from its own layer or one before it. The longest matching name decides.
LAYERS = [
    ["hydrolab.errors", "hydrolab.progress", "hydrolab.addresses"],
    ["hydrolab.machine"],
    ["hydrolab.dynamics"],
    ["hydrolab"],  # the names a chapter imports
    ["hydrolab.paper"],
    ["hydrolab.figures"],
    ["hydrolab.explorers", "hydrolab.live"],
    ["hydrolab.course"],
    ["hydrolab.cli"],
]
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}

HEAVY = {"matplotlib", "ipywidgets", "anywidget", "viser", "sympy", "IPython", "jupyterlab",
         "jupyter_server", "xarray", "nbformat", "nbclient", "nbdime", "scipy.stats"}

TOP_LEVEL = {"pyproject.toml", "book", "hydrolab", "tests", "environment-notes.md", "README.md"}
MOST_MODULES, MOST_BYTES = 105, 1_205_400  # of the library, which shall only become smaller
# written by tests/machine/generate_elements.py, whose letters are those of its equations
GENERATED = ("hydrolab.machine.element_matrices",)
# types that say what they are: classes of the library, and of what draws
KNOWN_TYPES = {"Axes", "Figure", "ViserServer", "Dataset"}
# how a docstring may name an argument besides by its name
SYMBOLS = {"speed": ("Ω",), "stiffness": ("k",), "damping": ("c",), "mass": ("m",), "gap": ("g0",),
           "u": ("displacement",), "harmonics": ("m",), "harmonic": ("k",), "phase": ("φ",)}
BUILT = {"hydrolab-book", "hydrolab-study", "build", "dist"}  # made by commands, never committed


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path): path for path in sorted(PACKAGE.rglob("*.py"))
           if "_book" not in path.parts}
PACKAGES = [name for name, path in MODULES.items() if path.name == "__init__.py"]
TREES = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in MODULES.items()}


def rank(module: str) -> int:
    """Return the module's layer."""
    if module == "hydrolab":
        return RANK[module]
    parts = module.split(".")
    for length in range(len(parts), 1, -1):
        if (name := ".".join(parts[:length])) in RANK:
            return RANK[name]
    raise AssertionError(f"{module} belongs to no layer; give its package one in LAYERS")


def is_for_types(node: ast.AST) -> bool:
    """Tell whether a statement is `if TYPE_CHECKING:`, which never runs."""
    return isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING",
                                                                   "typing.TYPE_CHECKING")


def imports(module: str, tree: ast.Module, *, deferred: bool = True) -> set[str]:
    """Return the hydrolab modules that a module imports; deferred adds those that importing it does
    not import.
    """
    found = set()
    nodes = list(tree.body)
    while nodes:
        node = nodes.pop()
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                package = module.split(".")
                if MODULES[module].name != "__init__.py":
                    package.pop()
                base = ".".join([*package[:len(package) - node.level + 1],
                                 *filter(None, [node.module])])
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                found.add(inner if inner in MODULES or (ROOT / inner.replace(".", "/")).is_dir()
                          else base)
        elif not is_for_types(node) and (deferred or not isinstance(
                node, ast.FunctionDef | ast.AsyncFunctionDef)):
            nodes += ast.iter_child_nodes(node)
    return {name for name in found if name.split(".")[0] == "hydrolab"}


def for_types(tree: ast.Module, module: str) -> set[str]:
    """Return the hydrolab modules that a module imports for annotations only."""
    return {name for node in tree.body if is_for_types(node)
            for name in imports(module, ast.Module(node.body, []))}


@pytest.mark.parametrize("module", MODULES)
def test_imports_point_one_way(module):
    for imported in imports(module, TREES[module]):
        assert rank(imported) <= rank(module), f"{module} imports {imported}, which comes after it"


def test_imports_have_no_cycle():
    """Also none that an import inside a function would hide; a package's list of names aside."""
    graph = {name: {found for found in imports(name, tree) - for_types(tree, name)
                    if found not in PACKAGES}
             for name, tree in TREES.items() if name not in PACKAGES}

    def walk(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, f"imports in a circle: {' → '.join((*path, name))}"
        if name not in done:
            for imported in graph.get(name, ()):
                walk(imported, (*path, name))
            done.add(name)

    done: set[str] = set()
    for name in graph:
        walk(name, ())


def outside(module: str, seen: set[str]) -> set[str]:
    """The packages other than hydrolab that importing a module loads, by its text."""
    if module in seen or module not in TREES:
        return set()
    seen.add(module)
    found = {name.split(".")[0] for node in ast.walk(TREES[module])
             if isinstance(node, ast.Import) for name in [node.names[0].name]}
    found |= {node.module.split(".")[0] for node in TREES[module].body
              if isinstance(node, ast.ImportFrom) and node.module}
    for inner in imports(module, TREES[module], deferred=False):
        found |= outside(inner, seen)
    return found


@pytest.mark.parametrize("module", MODULES)
def test_an_import_waits_only_for_a_heavy_library(module):
    late = imports(module, TREES[module]) - imports(module, TREES[module], deferred=False)
    for imported in late - for_types(TREES[module], module):
        assert outside(imported, set()) & HEAVY, f"{module}: import {imported} at its top"


def test_the_solvers_do_not_know_machines():
    for module, tree in TREES.items():
        if module.startswith("hydrolab.dynamics"):
            known = imports(module, tree)
            assert not known & {"hydrolab.machine.parts",
                                "hydrolab.machine.cards"}, f"{module} knows what a Machine is"


def test_the_layer_test_sees_every_kind_of_import(monkeypatch):
    source = """
import hydrolab.cli
from hydrolab.paper import study
from ..figures import orbits
def f():
    from hydrolab.course.checks import check
"""
    monkeypatch.setitem(MODULES, "hydrolab.paper.study", PACKAGE / "study.py")
    monkeypatch.setitem(MODULES, "hydrolab.figures.orbits", PACKAGE / "show" / "figures.py")
    monkeypatch.setitem(MODULES, "hydrolab.dynamics.modes", PACKAGE / "dynamics" / "modes.py")
    found = imports("hydrolab.dynamics.modes", ast.parse(source))
    assert found == {"hydrolab.cli", "hydrolab.paper.study", "hydrolab.figures.orbits",
                     "hydrolab.course.checks"}
    assert all(rank(name) > rank("hydrolab.dynamics.modes") for name in found)


def loaded_by(statement: str) -> set[str]:
    """Return the modules that a fresh Python holds after a statement."""
    code = f"{statement}\nimport json, sys\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True,
                          timeout=120, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return set(json.loads(done.stdout.splitlines()[-1]))


@pytest.mark.parametrize("statement", ["import hydrolab", "import hydrolab.cli"])
def test_the_import_is_light(statement):
    assert not HEAVY & loaded_by(statement)


def public_definitions(tree: ast.Module):
    """Yield the public functions and classes of a module, and the public methods of its public
    classes.
    """
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef
                      | ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, node
            if isinstance(node, ast.ClassDef):
                for inner in node.body:
                    if isinstance(inner, ast.FunctionDef) and not inner.name.startswith("_"):
                        yield f"{node.name}.{inner.name}", inner


@pytest.mark.parametrize("module", MODULES)
def test_every_public_name_is_documented(module):
    tree = TREES[module]
    assert not tree.body or ast.get_docstring(tree), f"{module} does not say what it is"
    missing = [name for name, node in public_definitions(tree) if not ast.get_docstring(node)]
    assert not missing, f"{module}: no docstring on {', '.join(missing)}"


def is_near(one: str, other: str) -> bool:
    """Tell whether two names are the same or differ by one letter, put in or changed."""
    short, long = sorted((one, other), key=len)
    if len(short) == len(long):
        return sum(a != b for a, b in zip(short, long, strict=True)) <= 1
    return any(long[:i] + long[i + 1:] == short for i in range(len(long)))


def test_no_two_modules_are_taken_for_each_other():
    """`model` and `modes` stay: both are the field's own words."""
    names = sorted(name.rpartition(".")[2] for name in MODULES
                   if name not in PACKAGES and ".exercises." not in name)
    near = {pair for pair in combinations(names, 2) if is_near(*pair)} - {("model", "modes")}
    assert not near


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_says_what_is_in_it(package):
    assert len(ast.get_docstring(TREES[package]).splitlines()) <= 15
    names = importlib.import_module(package).__all__
    assert len(set(names)) == len(names)
    assert all(hasattr(sys.modules[package], name) for name in names)


def functions(tree: ast.AST) -> Iterator[ast.FunctionDef]:
    """Every function of a module, methods and inner ones too."""
    return (node for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def test_the_library_is_small():
    assert len(MODULES) <= MOST_MODULES
    assert sum(path.stat().st_size for path in MODULES.values()) <= MOST_BYTES


def test_functions_are_short():
    lengths = {f"{module}.{node.name}": node.end_lineno - node.lineno + 1
               for module, tree in TREES.items() if module not in GENERATED
               for node in functions(tree)}
    assert statistics.median(lengths.values()) <= 8
    assert not {name: length for name, length in lengths.items() if length > 50}


def arguments(node: ast.FunctionDef) -> list[ast.arg]:
    """A function's arguments, without self and those that begin with an underscore."""
    given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    return [arg for arg in given if arg.arg not in ("self", "cls") and arg.arg[0] != "_"]


def says_itself(arg: ast.arg) -> bool:
    """Tell whether an argument's type is a class that says what it is."""
    words = set(re.findall(r"\w+", ast.unparse(arg.annotation))) if arg.annotation else set()
    return bool(words & (KNOWN_TYPES | set(CLASSES)))


def told_once(module: str) -> set[str]:
    """The arguments that a module's docstring describes for all of its functions: "low, high: …".
    """
    found = re.findall(r"((?:\w+,\s)*\w+):\s", ast.get_docstring(TREES[module]) or "")
    return {name for names in found for name in re.findall(r"\w+", names)}


def is_named(argument: str, words: str) -> bool:
    """Tell whether a docstring names an argument: as it is written, as words, or by its symbol."""
    forms = {argument, argument.replace("_", " "), *SYMBOLS.get(argument, ())}
    return any(re.search(rf"(?<!\w){re.escape(form)}(?!\w)", words) for form in forms)


CLASSES = {node.name: node for tree in TREES.values() for node in tree.body
           if isinstance(node, ast.ClassDef)}


def described(owner: str, method: str) -> str:
    """What a class and those that it derives from say of themselves and of a method."""
    if owner not in CLASSES:
        return ""
    own = [node for node in CLASSES[owner].body
           if isinstance(node, ast.FunctionDef) and node.name == method]
    words = [ast.get_docstring(node) or "" for node in (CLASSES[owner], *own)]
    return " ".join([*words, *(described(ast.unparse(base), method)
                               for base in CLASSES[owner].bases)])


@pytest.mark.parametrize("module", [name for name in MODULES if name not in GENERATED])
def test_every_argument_is_named(module):
    """Of a public function with two or more: in its docstring, its class's or its module's, or by
    its type.
    """
    unnamed = {}
    for name, node in public_definitions(TREES[module]):
        if isinstance(node, ast.ClassDef) or len(arguments(node)) < 2:
            continue
        owner, _, own = name.rpartition(".")
        words = f"{ast.get_docstring(node)} {described(owner, own) if owner else ''}"
        if missing := [arg.arg for arg in arguments(node) if not is_named(arg.arg, words)
                       and not says_itself(arg) and arg.arg not in told_once(module)]:
            unnamed[name] = missing
    assert not unnamed


def project_files() -> list[Path]:
    """Return the project's own files: what git holds or would take, or all that no command made."""
    listed = None
    if (ROOT / ".git").exists():
        listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard", "-z"], cwd=ROOT,
                                capture_output=True,
                                text=True, timeout=60, check=False)
    if listed is not None and listed.returncode == 0:
        return [path for name in listed.stdout.split("\0") if name
                and (path := ROOT / name).is_file()]
    own = [path for path in ROOT.iterdir() if path.name in TOP_LEVEL | {".ci"}]
    files = [path for top in own for path in ([top] if top.is_file() else top.rglob("*"))]
    made = {"__pycache__", "_build", ".ipynb_checkpoints"}
    return [path for path in files if path.is_file() and not made & set(path.parts)]


def test_top_level():
    names = {path.relative_to(ROOT).parts[0] for path in project_files()}
    assert {name for name in names if not name.startswith(".")} <= TOP_LEVEL
    visible = {path.name for path in ROOT.iterdir() if not path.name.startswith(".")}
    assert visible - BUILT - TOP_LEVEL == set()
    assert TOP_LEVEL - visible == set()


# Put together here so that this file does not hold what it looks for.
UNWANTED = {
    "a package registry's host": ["py" + "pi.org", "python" + "hosted.org", "npm" + "js.org",
                                  "npm" + "js.com",
                                  "yarn" + "pkg.com", "deb." + "debian.org",
                                  "conda." + "anaconda.org"],
    "a path of one machine": ["/ro" + "ot/", "/wo" + "rk/", "/ho" + "me/", "/Us" + "ers/",
                              "\\Us" + "ers\\",
                              "/opt/" + "wheels", ".py" + "env/", "/tmp/" + "ipykernel"],
}


@pytest.mark.parametrize("what", UNWANTED)
def test_no_file_names(what):
    pattern = re.compile("|".join(map(re.escape, UNWANTED[what])).encode())
    found = {f"{path.relative_to(ROOT)}: {match[0].decode()}" for path in project_files()
             for match in [pattern.search(path.read_bytes())] if match}
    assert not found, f"{what}: {sorted(found)}"


def test_ci_runs_the_readme_line():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    line = next(line for line in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
                if line.startswith("python3 -m venv") and "pytest" in line)
    assert line in readme.splitlines()


def test_every_dependency_is_pinned_and_explained():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = [*project["dependencies"], *(line
                                         for extra in project["optional-dependencies"].values()
                                         for line in extra)]
    names = {re.match(r"[\w.-]+", line)[0].lower() for line in lines} - {"hydrolab"}
    pinned = {re.match(r"[\w.-]+", line)[0].lower()
              for line
              in (ROOT / ".ci" / "constraints.txt").read_text(encoding="utf-8").splitlines()}
    notes = (ROOT / "environment-notes.md").read_text(encoding="utf-8").lower()
    assert names <= pinned, "make .ci/constraints.txt again (environment-notes.md says how)"
    assert not {name for name in names
                if f"`{name}`" not in notes}, "environment-notes.md says why each one is there"
