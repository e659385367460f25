"""What a release says stands in several files, in each as in the others."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

import holokin as hk

ROOT = Path(__file__).parents[2]
yaml = pytest.importorskip("yaml")
pytestmark = pytest.mark.skipif(not (ROOT / ".github").is_dir(), reason="an sdist has not these files")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]


def read(file: str) -> dict:
    return yaml.safe_load((ROOT / file).read_text("utf-8"))


def names(requirements: list[str]) -> set[str]:
    """Packages with their least versions; matplotlib is matplotlib-base for conda."""
    return {"".join(one.split()).replace("matplotlib-base", "matplotlib") for one in requirements}


def test_the_archive_and_the_citation_say_the_same() -> None:
    archive, citation = json.loads((ROOT / ".zenodo.json").read_text("utf-8")), read("CITATION.cff")
    assert archive["creators"] == citation["authors"] == PROJECT["authors"]
    assert archive["description"] == citation["abstract"].strip()
    assert [archive[key] for key in ("title", "keywords", "license")] == [
        citation[key] for key in ("title", "keywords", "license")
    ]


def test_each_python_that_is_promised_is_tried_before_a_release_and_in_the_hosted_checks() -> None:
    promised = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
    steps = read(".github/workflows/release.yml")["jobs"]["release"]["steps"]
    assert f">={promised[0]}" == PROJECT["requires-python"]
    assert steps[1]["with"]["python-version"].split() == promised
    assert steps[2]["run"].split()[1:] == [f"python{version}" for version in promised]
    assert read(".github/workflows/ci.yml")["jobs"]["run"]["strategy"]["matrix"]["python"] == promised


def test_the_conda_recipe_is_of_this_version_and_needs_what_the_command_line_needs() -> None:
    recipe = read("recipe/recipe.yaml")
    wanted = PROJECT["dependencies"] + PROJECT["optional-dependencies"]["app"]
    assert recipe["context"]["version"] == hk.__version__
    assert names(recipe["requirements"]["run"]) == names(wanted) | {f"python{PROJECT['requires-python']}"}
    assert recipe["build"]["python"]["entry_points"] == [f"{k} = {v}" for k, v in PROJECT["scripts"].items()]
