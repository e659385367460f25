"""Pages run: every Python block prints what stands below it, and every public name has its place in the built site."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

import holokin as hk
from conftest import Command, campaign, sampled
from printed import assert_alike

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^```(python|toml|text|sh)\n(.*?)^```", re.DOTALL | re.MULTILINE)
RUN = sorted(
    str(page.relative_to(ROOT))
    for page in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"))
    if "```python" in page.read_text("utf-8")
)
LONG = ("docs/inverse.md", "docs/learning.md", "docs/workspaces.md")
"""Pages that compute for longer than a compiler takes."""
SLOW = tuple(
    f"docs/{name}.md"
    for name in (
        "audit",
        "choose",
        "clearance",
        "concepts",
        "datasets",
        "inverse",
        "learning",
        "libraries",
        "paths",
        "proof",
        "robots",
        "sheets",
        "studio",
        "surveys",
        "workspaces",
    )
)
"""Pages that take longer than a second: of the campaign."""
SHOWN = {name for name in hk.__all__ if not isinstance(getattr(hk, name), ModuleType)}
ROOMS = (
    "analysis.audit", "analysis.audit.logs", "analysis.coverage", "analysis.curvature", "analysis.design",
    "analysis.sheets", "export", "learning", "motion", "motion.checks", "motion.control", "motion.ik", "path",
    "proof", "robot", "strategies", "strategies.constraints", "strategies.tasks",
)  # fmt: skip
"""Folders whose names are on pages of their own."""


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


SETTINGS = (ROOT / "mkdocs.yml").read_text("utf-8")


def tab(name: str) -> str:
    """What stands under a tab of the site."""
    return re.split(r"^(?: {2}- |\S)", SETTINGS.partition(f"\n  - {name}:\n")[2], maxsplit=1, flags=re.MULTILINE)[0]


def pages(name: str) -> list[str]:
    """The pages of a tab of the site."""
    return re.findall(r"^ +- (?:.+: )?(\S+\.md)$", tab(name), re.MULTILINE)


GUIDE = pages("Guide")
HOW_TO = [page for page in pages("How to") if not page.startswith("notebooks/")]
PROMISE = re.compile(
    r"same (?:tool )?pose,? (?:has )?the same joints|(?<!where the )pose decides the joints"
    r"|joints[^.|]{0,40} functions? of the|one (?:smooth )?function of the pose"
)
PLACE = re.compile(r"\bregion\b|\bbox\b|this circle|place on the path|must be a function")
"""What a promise of the same joints must say: of which poses it holds."""


def test_the_guide_has_at_most_fourteen_pages_in_five_groups() -> None:
    assert 10 < len(GUIDE) <= 14 and len(set(GUIDE)) == len(GUIDE)
    assert re.findall(r"^ {6}- (\w+):$", tab("Guide"), re.MULTILINE) == ["Start", "Choose", "Run", "Prove", "Connect"]


def test_the_gallery_has_recordings_alone_and_the_reference_has_names_and_keys() -> None:
    assert len(HOW_TO) > 5 and len(pages("Gallery")) > 5 and len(pages("Reference")) > 10
    assert [page for page in pages("Gallery") if not page.startswith("gallery")] == []
    assert [page for page in pages("Reference") if not page.startswith("api/")] == ["job-keys.md"]


@pytest.mark.parametrize("page", [*GUIDE, *HOW_TO])
def test_a_page_of_the_guide_says_at_once_for_whom_it_is_and_ends_before_its_reader(page: str) -> None:
    lines = (ROOT / "docs" / page).read_text("utf-8").splitlines()
    said = " ".join(lines[2:5])
    assert lines[0].startswith("# ") and said.startswith("For anyone") and re.search(r"\bYou (get|take|keep)\b", said)
    assert len(lines) <= 400


def test_the_readme_is_short_and_has_one_table() -> None:
    lines = (ROOT / "README.md").read_text("utf-8").splitlines()
    rows = [line for line in lines if line.startswith("|")]
    assert len(lines) < 120
    assert sum(line.startswith("|---") for line in rows) == 1 and len(rows) - 2 <= 10


@pytest.mark.parametrize("page", ["README.md", "docs/index.md", "docs/limits.md", *(f"docs/{name}" for name in GUIDE)])
def test_the_same_joints_are_promised_of_a_region_only(page: str) -> None:
    """A leaf may have several postures of one pose, joined by a regular motion; curvature does not show it."""
    parts = (ROOT / page).read_text("utf-8").split("\n\n")
    promises = [part for part in parts if not part.startswith("#") and PROMISE.search(part)]
    assert [part for part in promises if not PLACE.search(part)] == []
    if page in ("README.md", "docs/index.md", "docs/limits.md", "docs/concepts.md", "docs/proof.md", "docs/inverse.md"):
        assert promises and ("certify" in " ".join(parts) or "unique_region" in " ".join(parts))


def test_the_readmes_program_has_twelve_lines() -> None:
    code, *_ = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text("utf-8"), re.DOTALL)
    assert len([line for line in code.splitlines() if line.strip()]) <= 12


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages, built strictly: no broken link, no page outside the contents, no docstring that cannot be read.

    Without an index for the search, and with signatures on one line each: breaking them takes a process for each.
    """
    pytest.importorskip("mkdocs")
    pytest.importorskip("mkdocstrings_handlers.python")
    folder = tmp_path_factory.mktemp("site")
    settings = (ROOT / "mkdocs.yml").read_text("utf-8")
    for whole, short in (("  - search\n", ""), ("line_length: 80\n", "line_length: 9999\n")):
        assert settings.count(whole) == 1
        settings = settings.replace(whole, short)
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder), "--config-file", "-"]
    done = subprocess.run(command, cwd=ROOT, input=settings, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.mark.campaign
def test_every_name_of_every_room_is_on_its_page(site: Path) -> None:
    for room in ROOMS:
        name = room.split(".")[-1]
        page = (site / "api" / name / "index.html").read_text("utf-8")
        exported = importlib.import_module(f"holokin.{room}").__all__
        missing = [name for name in exported if f'id="holokin.{room}.{name}"' not in page]
        assert not missing, f"{room}: {missing}: a docstring is missing, or docs/api/{name}.md leaves it out"


@pytest.mark.campaign
def test_every_core_name_is_in_the_overview_and_leads_somewhere(site: Path) -> None:
    """A cross reference that leads nowhere would have failed the strict build; here it must be one."""
    page = (site / "api" / "index.html").read_text("utf-8")
    linked = set(re.findall(r'href="[^"]+#holokin[^"]+"><code>hk\.(\w+)</code></a>', page))
    assert linked == SHOWN


@pytest.mark.campaign
def test_errors_in_docstrings_become_a_list_of_cross_references(site: Path) -> None:
    page = (site / "api" / "constraints" / "index.html").read_text("utf-8")
    part = page[page.index('id="holokin.strategies.constraints.posture_cost"') :]
    part = part[: part.index('id="holokin.strategies.constraints.stack"')]
    for error in ("NotFiniteError", "ArgumentError", "ShapeError"):
        assert f'href="../errors/#holokin.base.errors.{error}"' in part, error


@pytest.mark.campaign
def test_brackets_of_a_formula_are_no_links(site: Path) -> None:
    """[G v, G e](q(t)) is a vector field at a posture."""
    page = (site / "theory" / "index.html").read_text("utf-8")
    assert "[G v, G e](q(t)) dt" in page
    assert 'href="q(t)' not in page


PICTURES = ROOT / "docs" / "pictures"


@sampled(1, "name", ["self_motion", "planar_loops", "leaves"])
def test_a_picture_of_the_concepts_can_be_drawn_again(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    import pictures

    monkeypatch.setattr(pictures, "OUT", tmp_path)
    getattr(pictures, name)()
    (drawn,) = tmp_path.glob("*.png")
    assert drawn.stat().st_size > 0.5 * (PICTURES / drawn.name).stat().st_size


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


def test_an_excerpt_stands_in_the_tree() -> None:
    found = re.findall(r'```py title="(.+?)"\n(.*?)```', (ROOT / "CONTRIBUTING.md").read_text("utf-8"), re.DOTALL)
    assert found
    for file, text in found:
        assert text.strip() in (ROOT / file).read_text("utf-8"), file
