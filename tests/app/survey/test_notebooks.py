"""Notebooks: their cells run, with fewer cases than on the page, and what they show is stored in them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[3] / "docs" / "notebooks"


def cells(name: str) -> list[dict[str, object]]:
    return [cell for cell in json.loads((FOLDER / name).read_text("utf-8"))["cells"] if cell["cell_type"] == "code"]


@pytest.mark.campaign
def test_ten_laws_on_a_hundred_circles_and_three_robots_take_less_than_ten_lines(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("pandas")
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    code = ["".join(cell["source"]) for cell in cells("survey.ipynb")]
    asked = [line for line in code[0].splitlines() if line.strip()]
    assert len(asked) < 10
    scope: dict[str, object] = {}
    for many, few in (
        ('"count": 100', '"count": 1'), ('"panda", "iiwa14", "xarm7"', '"panda"'),
        ("samples=60", "samples=12, cycles=2, workers=0"),
    ):  # fmt: skip
        assert many in code[0]
        code[0] = code[0].replace(many, few)
    for text in code:
        exec(compile(text, "survey.ipynb", "exec"), scope)
    found = scope["found"]
    assert len(found) == 10 and len(found.laws) == 10  # type: ignore[arg-type, attr-defined]
    assert set(found.columns["status"]) <= {"complete", "limit"}  # type: ignore[attr-defined]


def test_what_a_notebook_shows_is_stored_and_of_all_cases() -> None:
    shown = cells("survey.ipynb")
    assert all(cell["outputs"] for cell in shown)
    table = json.dumps(shown[0]["outputs"])
    assert table.count("300") >= 10, "run it with jupyter nbconvert --execute --inplace"
