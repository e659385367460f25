"""The house plan: imports downhill, one door to CasADi, extras, a light import, docstrings, errors, references."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import holokin as hk
from holokin.__main__ import NEEDED
from holokin.base import errors

ROOT = Path(hk.__file__).parent
FOLDERS = (
     "base", "symbolic/native", "symbolic", "robot/shapes", "robot", "robot/formats", "robot/closed_form",
    "path", "path/files", "strategies/tasks", "strategies/constraints", "strategies",
    "motion/self_motions", "motion/ik", "motion/control", "motion", "motion/checks", "proof",
    "analysis/curvature", "analysis/coverage", "analysis/design", "analysis/sheets", "analysis/audit/logs",
    "analysis/audit", "analysis", "export/c", "export/programs", "export/ros", "export", "learning",
    "app/report", "app/job", "app/survey", "app/studio", "app/cli", "app",
)  # fmt: skip
"""From the bottom up: a file imports from folders that stand before its own, and from its own."""
APP = ("matplotlib", "pydantic", "pydantic_core", "typer", "rich")
"""Packages of the extra `app`, which the core does without."""
MESHES = ("yourdfpy", "trimesh", "collada", "lxml", "six", "PIL")
"""Those that read meshes, or came with what read URDFs before."""
HEAVY = (*APP, *MESHES, "casadi", "numpy", "scipy", "torch", "jax")
MODULES = sorted(ROOT.rglob("*.py"))


@cache
def parsed(file: Path) -> ast.Module:
    """The tree of a file, which several statements are about."""
    return ast.parse(file.read_text("utf-8"))


def folder_of(module: Path) -> str:
    """The folder of a file below the package, "" for those that lie beside the folders."""
    return "/".join(module.relative_to(ROOT).parts[:-1])


def folder_of_name(name: str) -> str:
    """The folder in which a dotted name, holokin.robot.model.Robot, is defined, or handed on by its `__init__`."""
    parts = name.split(".")[1:]
    return max((f for f in FOLDERS if parts[: f.count("/") + 1] == f.split("/")), key=len, default="")


@cache
def imports(module: Path) -> list[tuple[str, ast.stmt]]:
    """(absolute dotted name, statement) of every import, relative ones resolved."""
    package = list(module.relative_to(ROOT.parent).with_suffix("").parts)[:-1]
    found: list[tuple[str, ast.stmt]] = []
    for node in statements(parsed(module)):
        if isinstance(node, ast.Import):
            found += [(alias.name, node) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            stem = ".".join([*base, *([node.module] if node.module else [])])
            found += [(f"{stem}.{alias.name}", node) for alias in node.names]
    return found


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements under a node, however deep."""
    outer = [node]
    while outer:
        of = vars(outer.pop())
        found = [child for part in ("body", "orelse", "finalbody", "handlers", "cases") for child in of.get(part, ())]
        outer += found
        yield from found


@pytest.mark.parametrize("module", MODULES, ids=lambda m: str(m.relative_to(ROOT)))
def test_imports_run_downhill(module: Path) -> None:
    """Between the folders, and between the parts of one; a folder's `__init__` hands on what its own folders hold."""
    folder = folder_of(module)
    for name, _ in imports(module):
        if name.split(".")[0] == "casadi":
            assert folder.startswith("symbolic"), "only symbolic/ may import CasADi"
        if not name.startswith("holokin.") or not folder:
            continue
        other = folder_of_name(name)
        inside = module.name == "__init__.py" and other.startswith(f"{folder}/")
        assert inside or not other or FOLDERS.index(other) <= FOLDERS.index(folder), f"{folder} imports {other}"
        assert inside or not other.startswith("app") or folder.startswith("app")


def test_the_tree_of_contributing_shows_the_folders() -> None:
    """Its rows, from the bottom up, are the outer folders in the order to which the imports are held."""
    page = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text("utf-8")
    tree = page.split("src/holokin/\n")[1].split("```")[0]
    outer = list(dict.fromkeys(folder.split("/")[0] for folder in FOLDERS))
    assert re.findall(r"^  (\w+)/", tree, re.M) == outer[::-1]
    inner = {folder.split("/")[-1] for folder in FOLDERS if "/" in folder}
    assert inner <= set(re.findall(r"(\w+)/", tree))


def test_every_module_lies_in_a_folder_that_says_what_it_is_for() -> None:
    """`__init__` says what the folder is for, what it uses, what to read first."""
    assert {f.name for f in ROOT.glob("*.py")} == {"__init__.py", "__main__.py", "version.py"}
    assert {folder_of(module) for module in MODULES} == {"", *FOLDERS}
    for folder in FOLDERS:
        words = ast.get_docstring(parsed(ROOT / folder / "__init__.py")) or ""
        assert re.search(r"^Uses ", words, re.M), folder
        assert re.search(r"Read (first|it all)", words), folder
        for name in re.findall(r"`([\w/]+\.py)`", words):
            assert (ROOT / folder / name).is_file(), (folder, name)


def test_a_function_that_only_its_own_file_uses_begins_with_an_underscore() -> None:
    """So that the other names of a file are what it is for."""
    top = Path(__file__).parents[2]
    others = [f for folder in ("tests", "docs", "benchmarks", "examples") for f in (top / folder).rglob("*")]
    files = [*MODULES, *(f for f in others if f.suffix in (".py", ".md", ".ipynb"))]
    words = {file: set(re.findall(r"\w+", file.read_text("utf-8"))) for file in files}
    used = Counter(word for found in words.values() for word in found)
    alone = [
        f"{module.relative_to(ROOT)}: {node.name}"
        for module in MODULES
        if folder_of(module) != "app/cli"
        for node in parsed(module).body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
        if used[node.name] == 1  # it stands in its own
    ]
    assert alone == []


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_module_has_the_name_of_what_its_folder_exports(folder: str) -> None:
    """`import holokin.motion.follow_path` must be the module, and `holokin.motion.follow` the function."""
    exported = vars(importlib.import_module("holokin." + folder.replace("/", "."))).get("__all__", ())
    assert not {entry.stem for entry in (ROOT / folder).iterdir()} & set(exported)


def test_there_is_no_import_cycle() -> None:
    names = {".".join(m.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__"): m for m in MODULES}
    graph = {
        name: {
            target
            for wanted, _ in imports(module)
            for target in (wanted, wanted.rpartition(".")[0])
            if target in names and target != name and not name.startswith(target + ".")
        }
        for name, module in names.items()
    }
    TopologicalSorter(graph).prepare()  # it raises CycleError, which names the cycle


def test_importing_holokin_loads_nothing_heavy() -> None:
    """`import holokin` and `holokin --help` load neither CasADi nor NumPy; benchmarks/accuracy.py times them."""
    for words in (["-c", "import holokin"], ["-m", "holokin", "--help"]):
        asked = subprocess.run([sys.executable, "-X", "importtime", *words], capture_output=True, text=True, check=True)
        loaded = {line.rpartition("|")[2].strip() for line in asked.stderr.splitlines()}
        assert loaded & {*HEAVY} <= ({"typer"} if "--help" in words else set())


def test_the_core_imports_no_package_of_the_app_and_no_reader_of_meshes() -> None:
    """But for the progress bar, which appears where rich is installed; no import is hidden in a function either."""
    core = [m for m in MODULES if folder_of(m) and not folder_of(m).startswith("app")]
    found = {
        f"{module.relative_to(ROOT)}: {name}"
        for module in core
        for name, _ in imports(module)
        if name.split(".")[0] in (*APP, *MESHES) and (module.name, name.split(".")[0]) != ("progress.py", "rich")
    }
    assert len(core) > 100 and found == set()


def test_the_names_that_are_loaded_when_used_are_those_that_types_know() -> None:
    """The table of `holokin/__init__.py`, its imports for types and `__all__` have the same names of the same homes."""
    block = next(node for node in parsed(ROOT / "__init__.py").body if isinstance(node, ast.If))
    typed = {
        (f"{node.module or ''}", alias.name)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    table = {(home, name) for home, names in hk._HOMES.items() for name in names.split()}
    assert {(home, name) for home, name in typed if home} == table
    assert sorted([*(name for _, name in typed), "HolokinError"]) == hk.__all__ and {*hk.__all__} <= {*dir(hk)}
    assert all(getattr(hk, name) is not None for name in hk.__all__)


def test_every_public_name_has_a_docstring_with_substance() -> None:
    for name in hk.__all__:
        thing = getattr(hk, name)
        assert thing.__doc__, name
        assert len(thing.__doc__) > 20, name
    for module in MODULES:
        assert ast.get_docstring(parsed(module)), module
        for node in outer_definitions(parsed(module)):
            assert node.name.startswith("_") or ast.get_docstring(node), f"{module}: {node.name}"


def outer_definitions(node: ast.AST) -> Iterator[ast.FunctionDef | ast.ClassDef]:
    """Functions and classes that stand in no function; of an overloaded function the one that is called."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.ClassDef) and not any(
            isinstance(d, ast.Name) and d.id == "overload" for d in child.decorator_list
        ):
            yield child
        if not isinstance(child, ast.FunctionDef | ast.expr):
            yield from outer_definitions(child)


def test_every_source_key_is_on_the_references_page() -> None:
    page = (Path(__file__).parents[2] / "docs" / "references.md").read_text("utf-8")
    used = {key for m in MODULES for key in re.findall(r"\[([A-Z][A-Za-z]*\d\d)(?:,[^\]]*)?\]", m.read_text("utf-8"))}
    assert {"ZR11", "SY88"} <= used
    for key in sorted(used):
        assert f"**[{key}]**" in page, key


SAMPLES = {
    "str": "a word", "object": "a word", "int": 3, "float": 0.5, "float | None": 0.5, "Iterable[float]": [0.1, 0.2],
    "Iterable[str]": ["one", "two"], "Sequence[str]": ["one", "two"],
    "SingularityKind": errors.SingularityKind.ALGORITHMIC,
    "OSError": OSError(28, "full"), "Exception": ValueError("the cause; itself without a cure"), "Any": None,
}  # fmt: skip
"""A value for each annotation of an error's facts."""


@pytest.mark.parametrize("kind", [k for k in vars(errors).values() if isinstance(k, type) and issubclass(k, Exception)])
def test_an_error_is_holokins_and_its_message_names_the_cure(kind: type[Exception]) -> None:
    """After the fact and a semicolon stand three words at least, and the cure that was given, where one is."""
    assert issubclass(kind, hk.HolokinError)
    assert kind.__doc__
    if kind.__init__ is hk.HolokinError.__init__:
        return  # a message of its own: its raisers write the cure
    facts = {
        name: "turn the key first" if name == "cure" else SAMPLES[str(p.annotation)]
        for name, p in inspect.signature(kind.__init__).parameters.items()
        if name == "cure" or (name != "self" and p.default is inspect.Parameter.empty)
    }
    message = str(kind(**facts))
    cure = message.partition("; ")[2]
    assert len(cure.split()) >= 3, message
    assert facts.get("cure", "") in cure


def test_what_is_called_hk_something_can_be_had_of_it() -> None:
    """In the code's own sentences, above all in the cures of its errors."""
    named = {word for module in MODULES for word in re.findall(r"\bhk\.(\w+)", module.read_text("utf-8"))}
    assert len(named) > 10
    assert sorted(word for word in named if not hasattr(hk, word)) == []


def test_the_core_needs_three_packages_and_the_app_those_that_the_command_asks_for() -> None:
    project = tomllib.loads((ROOT.parents[1] / "pyproject.toml").read_text("utf-8"))["project"]
    names = {extra: [one.split(">")[0] for one in wanted] for extra, wanted in project["optional-dependencies"].items()}
    assert [one.split(">")[0] for one in project["dependencies"]] == ["numpy", "scipy", "casadi"]
    assert tuple(names["app"]) == NEEDED
    assert [extra for extra in ("studio", "survey") if not re.search(r"\bapp\b", "".join(names[extra]))] == []


BARE = """
import sys
from importlib.machinery import PathFinder

class Bare(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.partition(".")[0] in LEFT_OUT else super().find_spec(name, path, target)

sys.meta_path[:] = [Bare if finder is PathFinder else finder for finder in sys.meta_path]
"""
"""Begins a program for which packages are not installed, whatever this environment has."""

CORE = """
import numpy as np
import holokin as hk

robot = hk.load(sys.argv[1], tip="tip")
(part,) = robot.shapes
print(part.shape.fault)
print(hk.check([[0.1, 0.2]], hk.Scene(floor=-1.0), robot=robot, limits=False).unread)
q0 = [0.3, 0.8, -0.4]
arm = hk.from_dh([{"a": 0.3}, {"a": 0.3}, {"a": 0.2}])
task = hk.position(arm, rows=[0, 1])
G = hk.holonomic(task, hk.linear([0, 1, -1]))
start = arm.pose(q0)[:3, 3]
print(hk.drift(G, hk.circle(start, center=start - [0.05, 0, 0]), q0, cycles=2).largest.max() < 1e-10)
for function in (hk.studio, hk.survey, hk.read_sheets):
    try:
        function(1)
    except hk.HolokinError as problem:
        print(problem)
help(hk)
"""


def bare(code: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    words = ["-c", f"LEFT_OUT = {[*APP, *MESHES]!r}{BARE}{code}", *map(str, arguments)]
    return subprocess.run([sys.executable, *words], capture_output=True, text=True)


def test_with_numpy_scipy_and_casadi_alone_a_urdf_is_read_and_a_path_followed(tmp_path: Path) -> None:
    """The shape that is a mesh cannot be read, and says by which extra; what the app has says how to install it."""
    file = tmp_path / "arm.urdf"
    (tmp_path / "a.stl").write_text("solid a\nendsolid a\n")
    ends = '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
    file.write_text(
        '<robot name="arm"><link name="base"/><link name="a"><collision><geometry><mesh filename="a.stl"/></geometry>'
        '</collision></link><link name="tip"/><joint name="j1" type="revolute"><parent link="base"/><child link="a"/>'
        f'<axis xyz="0 0 1"/>{ends}<joint name="j2" type="prismatic"><parent link="a"/><child link="tip"/>'
        f'<axis xyz="1 0 0"/>{ends}</robot>'
    )
    done = bare(CORE, file)
    assert done.returncode == 0, done.stderr
    fault, unread, repeats, *needs = done.stdout.splitlines()[:6]
    assert "pip install 'holokin[meshes]'" in fault and unread.startswith("cannot tell: the shapes of a could not")
    assert repeats == "True"
    for extra, line in zip(("studio", "survey", "app"), needs, strict=True):
        assert line == f"this needs pydantic; install it with: pip install 'holokin[{extra}]'"


def test_without_its_packages_the_command_says_in_one_line_how_to_install_them() -> None:
    done = bare(
        "import runpy; sys.argv = ['holokin', 'run', 'paper']; runpy.run_module('holokin', run_name='__main__')"
    )
    assert (done.returncode, done.stdout) == (2, "")
    line = 'error: the command holokin needs typer, rich, pydantic, matplotlib; run: pip install "holokin[app]"\n'
    assert done.stderr == line
