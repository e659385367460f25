"""The page on datasets: its commands run on the dataset that it makes, and print what stands below them."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from conftest import Command
from printed import assert_alike

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "datasets.md").read_text("utf-8")
BLOCK = re.compile(r"^```(python|sh|text)\n(.*?)^```", re.DOTALL | re.MULTILINE)


@pytest.mark.campaign
def test_its_commands_print_what_stands_below_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], holokin: Command
) -> None:
    monkeypatch.chdir(tmp_path)
    scope: dict[str, object] = {}
    blocks = [match.groups() for match in BLOCK.finditer(PAGE)]
    codes = []
    for (kind, text), (after, below) in zip(blocks, [*blocks[1:], ("", "")], strict=True):
        if kind == "text":
            continue
        if kind == "python":
            exec(compile(text, "datasets.md", "exec"), scope)
            printed = capsys.readouterr().out
        else:
            done = holokin(*shlex.split(text)[1:])
            codes.append(done.code)
            printed = done.out
            assert done.err == ""
        if after == "text":
            assert_alike(printed, below)
    assert codes == [1, 0, 0]
    assert (tmp_path / "demos.png").stat().st_size > 20_000


def test_its_excerpt_stands_in_the_tree() -> None:
    (found,) = re.findall(r'```py title="(.+?)"\n(.*?)```', PAGE, re.DOTALL)
    assert found[1].strip() in (ROOT / found[0]).read_text("utf-8")
