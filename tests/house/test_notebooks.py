"""Notebooks run, print what is stored in them, and are short."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from printed import assert_alike

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
sys.path.append(str(FOLDER.parent))
NOTEBOOKS = sorted(file.stem for file in FOLDER.glob("*.ipynb"))
MOST_CELLS = 14
NEEDED = {"audit-my-dataset": "pyarrow", "a-proof": "flint"}


def cells(name: str) -> list[dict]:
    return json.loads((FOLDER / f"{name}.ipynb").read_text("utf-8"))["cells"]


def printed(outputs: list[dict]) -> str:
    return "".join("".join(output["text"]) for output in outputs if output["output_type"] == "stream")


def pictures(outputs: list[dict]) -> list[str]:
    return [output["data"]["image/png"] for output in outputs if "image/png" in output.get("data", {})]


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_is_short_and_each_of_its_cells_shows_something(name: str) -> None:
    code = [cell for cell in cells(name) if cell["cell_type"] == "code"]
    assert len(cells(name)) <= MOST_CELLS
    assert all(cell["outputs"] for cell in code)
    assert sum(len(pictures(cell["outputs"])) for cell in code) == 1


@pytest.mark.campaign
@pytest.mark.parametrize("name", NOTEBOOKS)
def test_a_notebook_shows_what_is_stored_in_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from notebook_pages import ran

    pytest.importorskip("matplotlib")
    if name in NEEDED:
        pytest.importorskip(NEEDED[name])
    monkeypatch.chdir(FOLDER)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    scope: dict[str, object] = {}
    for cell in cells(name):
        if cell["cell_type"] == "code":
            shown = ran("".join(cell["source"]), scope)
            assert_alike(printed(shown), printed(cell["outputs"]))
            assert len(pictures(shown)) == len(pictures(cell["outputs"]))
