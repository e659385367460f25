"""The version stands in one place; a checkout says its commit, too."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import holokin as hk

ROOT = Path(__file__).parents[2]
PACKAGE = Path(hk.__file__).parent


def test_the_version_is_written_in_one_place() -> None:
    wanted = re.compile(rf"(?<![\d.]){re.escape(hk.__version__)}(?![\d.])")
    files = [ROOT / "pyproject.toml", ROOT / "mkdocs.yml", *PACKAGE.rglob("*.py")]
    assert [str(f) for f in files if wanted.search(f.read_text("utf-8"))] == [str(PACKAGE / "version.py")]


def test_the_citation_is_of_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    assert re.findall(r'^version: "(.+)"$', text, re.MULTILINE) == [hk.__version__]


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


def test_the_changelog_begins_with_this_version_and_only_known_sections() -> None:
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    versions = re.findall(r"^## \[(.+?)\] - (\S+)$", text, re.MULTILINE)
    assert versions[0][0] == hk.__version__
    assert re.fullmatch(r"unreleased|\d{4}-\d\d-\d\d", versions[0][1])
    kinds = set(re.findall(r"^### (.+)$", text, re.MULTILINE))
    assert kinds <= {"Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}
