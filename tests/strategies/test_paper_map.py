"""docs/paper.md is what the tags in src/ say, leaves nothing out, and each row's test runs the row's code."""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from holokin.app.job import packaged_jobs
from paper_map import EQUATIONS, PAGE, ROOT, THEOREMS, Tag, function_at, page, tags

ROWS = EQUATIONS | THEOREMS


def test_the_page_is_made_from_the_tags() -> None:
    """When it is not: `python tests/paper_map.py`."""
    assert PAGE.read_text("utf-8") == page()


def test_nothing_of_the_paper_is_left_out() -> None:
    assert list(EQUATIONS) == [*(f"({k})" for k in range(1, 37)), "Table I"]
    assert {tag.item for tag in tags()} == set(ROWS), "every row has a tag, and every tag a row"
    text = PAGE.read_text("utf-8")
    for figure in range(1, 9):
        assert f"| Fig. {figure}:" in text


@pytest.mark.parametrize("tag", tags(), ids=lambda t: f"{t.item} {t.name or t.file}")
def test_the_named_code_can_be_imported_and_holds_its_tag(tag: Tag) -> None:
    if not tag.name:
        assert tag.text in (ROOT / tag.file).read_text("utf-8")
        return
    module = importlib.import_module(".".join(Path(tag.file).with_suffix("").parts[1:]))
    assert Path(module.__file__ or "").samefile(ROOT / tag.file)
    thing: object = module
    for name in tag.name.split("."):
        if inspect.isfunction(thing):
            break  # a function within a function: its source is in there
        thing = inspect.getattr_static(thing, name)
        while not inspect.isclass(thing) and not hasattr(thing, "registry"):
            wrapped = (
                getattr(thing, "__wrapped__", None) or getattr(thing, "fget", None) or getattr(thing, "func", None)
            )
            if wrapped is None:
                break
            thing = wrapped
    kinds = getattr(thing, "registry", {0: thing}).values()
    assert any(tag.text in inspect.getsource(one) for one in kinds)


@pytest.mark.campaign
def test_each_rows_tests_run_the_code_of_the_row(tmp_path: Path) -> None:
    """Every tagged function is called, and every tagged table read, by a test of its row; no test stands idle."""
    names = sorted({test for _, tests in ROWS.values() for test in tests})
    more = {"PAPER_MAP_CALLS": str(tmp_path / "calls.json"), "MPLBACKEND": "Agg"}
    paths = os.pathsep.join([str(ROOT / "src"), str(ROOT / "tests"), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "-n", "0", "-q", "-p", "paper_map", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*command, *(f"tests/{name}" for name in names)],
        cwd=ROOT, env=os.environ | more | {"PYTHONPATH": paths}, capture_output=True, text=True, check=False,
        timeout=280,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    called = {test: set(keys) for test, keys in json.loads((tmp_path / "calls.json").read_text()).items()}
    assert set(called) == set(names)
    for item, (_, tests) in ROWS.items():
        places = {tag.key: tag.place for tag in tags() if tag.item == item}
        missed = places.keys() - set().union(*(called[test] for test in tests))
        assert not missed, f"{item}: {[places[key] for key in missed]} run by none of {tests}"
        for test in tests:
            assert called[test] & places.keys() or not places, f"{item}: {test} runs none of {list(places.values())}"


def test_a_tag_belongs_to_the_innermost_function_around_it() -> None:
    tree = ast.parse(
        "class A:\n    @property\n    def b(self):\n        def c():\n            return 1\n        return c\n"
    )
    assert function_at(tree, 5) == ("A.b.c", 4)
    assert function_at(tree, 6) == ("A.b", 2)
    assert function_at(tree, 1) == ("", 0)
    handler = ast.parse("@f.register\ndef _(x: int):\n    return x\n")
    assert function_at(handler, 3) == ("f", 1)


@cache
def names_in(file: Path) -> set[str]:
    """Every function and class of a Python file."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return {node.name for node in ast.walk(ast.parse(file.read_text("utf-8"))) if isinstance(node, kinds)}


def test_paper_md_names_code_tests_and_jobs_that_exist() -> None:
    text = PAGE.read_text("utf-8")
    found = re.findall(r"`((?:src|tests)/[^`:]+)(?:::([^`]+))?`", text)
    assert len(found) > 60
    for file, name in found:
        assert (ROOT / file).is_file(), file
        if name:
            assert set(name.split(".")) <= names_in(ROOT / file), f"{file}::{name}"
    for job in re.findall(r"`out/([^/`]+)/", text):
        assert job in packaged_jobs()


def test_the_readme_shows_three_columns_of_the_first_of_these_tables() -> None:
    """Title, and of each strategy the name, the verdict and the drift of a cycle."""
    title, *table = PAGE.read_text("utf-8").partition("```text\n")[2].partition("\n\n")[0].splitlines()
    cells = [[cell.strip() for cell in row.split("│")[1:4]] for row in table if row.startswith("│")]
    first, _, *rows = (ROOT / "README.md").read_text("utf-8").partition("```text\n")[2].partition("```")[0].splitlines()
    assert first == title and len(rows) == 3
    assert [re.split(" {2,}", row) for row in rows] == cells
