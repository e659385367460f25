"""Pages run: every Python block prints what stands below it, and every command has the options that it shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from conftest import Command, campaign
from printed import assert_alike

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(python|toml|text|sh)\n(.*?)^```", re.DOTALL | re.MULTILINE)
RUN = sorted(
    str(page.relative_to(ROOT))
    for page in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"))
    if "```python" in page.read_text("utf-8")
)
LONG = ("docs/inverse.md", "docs/learning.md")  # they compute for longer than a compiler takes
SLOW = tuple(f"docs/{name}.md" for name in (
    "audit", "choose", "clearance", "concepts", "datasets", "inverse", "learning", "libraries", "paths", "proof",
    "robots", "studio", "surveys",
))  # fmt: skip
"""Pages that take longer than a second: of the campaign."""


@pytest.mark.parametrize("page", [campaign("page", page) if page in SLOW else page for page in RUN])
def test_the_python_of_a_page_prints_what_stands_below_it(page: str, tmp_path, monkeypatch, capsys) -> None:
    """One block goes on from those before it; a TOML block is the file that the next Python block names.

    Most run on the virtual machine, which prints what native code prints and needs no compiler.
    """
    if page == "docs/learning.md":
        pytest.importorskip("torch")
    monkeypatch.chdir(tmp_path)
    if page not in LONG:
        monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    scope: dict[str, object] = {}
    blocks = [match.groups() for match in BLOCK.finditer((ROOT / page).read_text("utf-8"))]
    for (kind, text), (after, below) in zip(blocks, [*blocks[1:], ("", "")], strict=True):
        if kind == "toml" and (file := re.search(r'"(\w+\.toml)"', below)):
            Path(file[1]).write_text(text, "utf-8")
        if kind == "python":
            exec(compile(text, page, "exec"), scope)
            printed = capsys.readouterr().out
            if after == "text":
                assert_alike(printed, below)


def test_every_command_on_the_pages_exists_with_its_options(holokin: Command, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")]
    blocks = [text for page in pages for text in re.findall(r"^```sh\n(.*?)^```", page.read_text("utf-8"), re.S | re.M)]
    lines = [line for text in blocks for line in re.findall(r"\bholokin [^\n#&|]+", text)]
    assert len(lines) > 10
    helps: dict[tuple[str, ...], str] = {}
    for line in lines:
        words = line.split()[1:]
        command = words[:2] if words[0] == "export" else words[:1]
        if words[0] == "survey":
            command = words[:2] if words[1] in ("report", "case") else ["survey", "run"]
        if (key := tuple(command)) not in helps:
            helps[key] = holokin(*command, "--help").out
        help_text = helps[key]
        assert "Usage" in help_text, line
        for option in re.findall(r"(?<= )--[a-z-]+", line):
            assert option in help_text, line
