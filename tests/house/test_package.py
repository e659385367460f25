"""What a package says of itself: its version in one place, that it is typed, a changelog that is ready for a tag."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tomllib
from datetime import date
from pathlib import Path

import pytest

import holokin as hk
from holokin.__main__ import NEEDED

ROOT = Path(__file__).parents[2]
PACKAGE = Path(hk.__file__).parent


def test_the_version_is_written_in_one_place() -> None:
    wanted = re.compile(rf"(?<![\d.]){re.escape(hk.__version__)}(?![\d.])")
    files = [ROOT / "pyproject.toml", ROOT / "mkdocs.yml", *PACKAGE.rglob("*.py")]
    assert [str(f) for f in files if wanted.search(f.read_text("utf-8"))] == [str(PACKAGE / "version.py")]


def test_the_citation_is_of_this_version_with_a_day() -> None:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.findall(r'^version: "(.+)"$', text, re.MULTILINE) == [hk.__version__]
    assert date.fromisoformat(re.findall(r'^date-released: "(.+)"$', text, re.MULTILINE)[0]) >= date(2026, 11, 23)


def _checkout(folder: Path) -> Path:
    """A repository with the package's version file as this one has it, and a commit."""
    for name in ("src/holokin/version.py", "pyproject.toml"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text((ROOT / name).read_text("utf-8"), "utf-8")
    for words in (["init", "-q"], ["add", "-A"], ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "one"]):
        subprocess.run(["git", "-C", str(folder), *words], check=True, capture_output=True)
    return folder / "src" / "holokin" / "version.py"


def _said(version: Path, **environment: str) -> str:
    code = f"import runpy; print(runpy.run_path({str(version)!r})['build']())"
    asked = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=os.environ | environment
    )
    return asked.stdout.strip()


@pytest.mark.skipif(shutil.which("git") is None, reason="there is no git")
def test_a_checkout_says_its_commit_and_an_environment_in_a_strangers_repository_does_not(tmp_path: Path) -> None:
    version = _checkout(tmp_path / "own")
    commit = subprocess.run(
        ["git", "-C", str(tmp_path / "own"), "rev-parse", "--short=12", "HEAD"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout.strip()
    assert _said(version) == f"{hk.__version__} (commit {commit})"
    (tmp_path / "own" / "pyproject.toml").write_text("# changed", "utf-8")
    assert _said(version) == f"{hk.__version__} (commit {commit}+changes)"
    assert _said(version, PATH=str(tmp_path)) == hk.__version__, "without git"
    _checkout(tmp_path / "theirs")
    inside = tmp_path / "theirs" / "venv" / "lib" / "site-packages" / "holokin" / "version.py"
    inside.parent.mkdir(parents=True)
    inside.write_text((PACKAGE / "version.py").read_text("utf-8"), "utf-8")
    assert _said(inside) == hk.__version__


def test_the_package_says_that_it_is_typed() -> None:
    assert (PACKAGE / "py.typed").is_file()


def test_the_changelog_begins_with_this_version_and_only_known_sections() -> None:
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    versions = re.findall(r"^## \[(.+?)\] - (\S+)$", text, re.MULTILINE)
    assert versions[0][0] == hk.__version__
    assert re.fullmatch(r"unreleased|\d{4}-\d\d-\d\d", versions[0][1])
    kinds = set(re.findall(r"^### (.+)$", text, re.MULTILINE))
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def test_the_readme_claims_no_more_than_is_tested() -> None:
    text = (ROOT / "README.md").read_text("utf-8").lower()
    for claim in ("proves", "prove ", "to the last bit", "comes home", "come home", "guarantee"):
        assert claim not in text, claim


def test_no_page_names_an_address_of_a_project_that_does_not_exist_yet() -> None:
    for file in ("pyproject.toml", "mkdocs.yml", "CITATION.cff", "README.md"):
        text = (ROOT / file).read_text("utf-8")
        assert not re.search(r"repo_url|site_url|project\.urls|repository-code|github\.com/\w*holokin", text), file


def test_the_core_needs_three_packages_and_the_app_those_that_the_command_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    names = {extra: [one.split(">")[0] for one in wanted] for extra, wanted in project["optional-dependencies"].items()}
    assert [one.split(">")[0] for one in project["dependencies"]] == ["numpy", "scipy", "casadi"]
    assert tuple(names["app"]) == NEEDED
    assert [
        extra for extra in ("studio", "survey", "cluster") if not re.search(r"\bapp\b", "".join(names[extra]))
    ] == []


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
LEFT_OUT = ["pydantic", "pydantic_core", "typer", "rich", "matplotlib", "yourdfpy", "trimesh", "collada", "lxml", "six"]

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
    text = f"LEFT_OUT = {LEFT_OUT!r}{BARE}{code}"
    return subprocess.run([sys.executable, "-c", text, *map(str, arguments)], capture_output=True, text=True)


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
