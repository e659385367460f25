"""The start page, followed to the letter: its commands run one after the other and print what stands below them."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

import holokin as hk
from conftest import Command
from grammars import krl, rapid
from holokin.export.programs.languages import LANGUAGES
from printed import assert_alike

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "start.md").read_text("utf-8")
ELSEWHERE = ("pip ", "holokin studio", "holokin advise ", "holokin cell ")
"""The first is run by .ci/run; the second serves a page; the last two take long: tests/analysis/design/test_advise.py
and tests/app/cli/test_cell.py run them."""
FRAME = str.maketrans("┏┓┗┛┡┩╇┳┴━─┃│┌┐└┘├┤┬┼╞╡", " " * 23)


@pytest.fixture
def run(holokin: Command, sketched: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A line of a shell in a folder with the page's URDF; holokin within this process. Returns what it prints."""
    (tmp_path / "docs").mkdir()
    shutil.copy(ROOT / "docs" / "arm7.urdf", tmp_path / "docs")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # its functions are long and called a few times

    def line(text: str) -> str:
        words = shlex.split(text, comments=True)
        if words[0] == "holokin":
            done = holokin(*words[1:])
            assert done.code == 0, done.err
            return done.out
        if words[0] == "cd":
            monkeypatch.chdir(words[1])
            return ""
        return subprocess.run(words, check=True, capture_output=True, text=True, timeout=60).stdout

    return line


def words(text: str) -> str:
    """Without the lines of tables and the seconds that a job took."""
    return re.sub(r"^ *[\d.]+ s, report: ", "report: ", text.translate(FRAME), flags=re.MULTILINE)


def followed(page: str, run) -> int:
    """Runs the commands of a page and compares what they print; a "..." stands for lines that are left out.

    Files are written from the blocks that have a title. Returns how many outputs were compared.
    """
    blocks = [(m[1], m[2], m[3]) for m in re.finditer(r"^```(\w+)([^\n]*)\n(.*?)^```", page, re.S | re.M)]
    shown = 0
    for (kind, about, text), (after, _, below) in zip(blocks, [*blocks[1:], ("", "", "")], strict=True):
        if kind != "sh":
            if title := re.search(r'title="(.+?)"', about):
                Path(title[1]).write_text(text, "utf-8")
            continue
        lines = [line for line in text.splitlines() if not line.startswith(ELSEWHERE)]
        printed = "".join(run(line) for line in lines)
        if lines and after == "text":
            shown += 1
            for part in filter(None, below.split("...\n")):
                count = part.count("\n")
                first = part.partition("\n")[0].translate(FRAME).split()
                rows = printed.splitlines(keepends=True)
                found = [k for k, row in enumerate(rows) if row.translate(FRAME).split()[:2] == first[:2]]
                assert found, f"{first} is not printed by {lines}"
                assert_alike(words("".join(rows[found[0] : found[0] + count])), words(part))
    return shown


@pytest.mark.campaign
def test_the_start_page_leads_from_a_urdf_to_a_program_and_its_check(run) -> None:
    assert followed(PAGE, run) >= 5
    assert {file.suffix for file in Path("program").iterdir()} == {".mod", ".src", ".dat", ".LS", ".yaml", ".csv"}

    begun = rapid(Path("program/arm7_swivel_M.mod").read_text("ascii")).axes[0]
    assert begun == pytest.approx([-29.5, 36.6, 90, -27, 64.3, 20.1, 43.3])


CELL = (ROOT / "docs" / "cells.md").read_text("utf-8")


@pytest.mark.campaign
def test_a_seam_leads_from_a_robot_and_points_to_a_program(run) -> None:
    """What the page shows is what is printed; the program can be read."""
    shutil.copy(ROOT / "docs" / "kr6.urdf", ".")
    assert followed(CELL.split("\n## Programs for")[0], run) >= 4
    weld = krl(*(Path(f"program/kr6_wrist.{end}").read_text("ascii") for end in ("src", "dat")))
    assert set(weld.kinds) == {"joint", "linear", "circular"} and len(weld.lines) == 3


@pytest.mark.campaign
def test_the_job_on_the_page_of_paths_prints_its_table(run) -> None:
    page = (ROOT / "docs" / "paths.md").read_text("utf-8")
    assert followed(page.split("\n## The job file")[1].split("\n### ")[0], run) == 1


def test_a_program_takes_at_most_six_commands() -> None:
    commands = re.findall(r"^holokin (\w+)", CELL, re.M)
    assert 3 <= len(commands) <= 6 and {"run", "export"} <= set(commands)


def test_the_page_of_cells_names_every_language() -> None:
    rows = re.findall(r"^\| `(\w+)` \|", CELL.split("\n## Programs for")[1].split("\n## ")[0], re.M)
    assert set(rows) == set(LANGUAGES)


def test_the_arm_of_the_page_has_the_inertias_of_its_cylinders() -> None:
    """m (3 r^2 + l^2) / 12 across and m r^2 / 2 along; each shape lies about its centre of mass."""
    links = ET.parse(ROOT / "docs" / "arm7.urdf").findall("link[inertial]")
    assert len(links) == 8
    for link in links:
        m = float(link.find("inertial/mass").get("value"))
        inertia = {key: float(value) for key, value in link.find("inertial/inertia").items()}
        shape = link.find("collision/geometry/cylinder")
        r, length = float(shape.get("radius")), float(shape.get("length"))
        assert inertia["ixx"] == inertia["iyy"] == pytest.approx(m * (3 * r**2 + length**2) / 12, abs=1e-6)
        assert inertia["izz"] == pytest.approx(m * r**2 / 2, abs=1e-6)
        assert link.find("inertial/origin").attrib == link.find("collision/origin").attrib


# --- `holokin sheets`: a map of a robot's or a job's workspace, written and read again.


JOB = """
title = "a plane"
[robot]
name = "planar-3r"
lower = -2.6
upper = 2.6
[start]
q = [0.3, 0.9, 0.7]
[path]
kind = "circle"
center = [0.1, 0, 0]
relative = true
[workspace]
kind = "box"
center = [1.2, 0.3]
half = [0.3, 0.3, 0]
[sheets]
samples = 32
share = 0.9
[strategies.lock]
kind = "lock"
joints = [1]
"""


def test_the_sheets_of_a_job_are_written_and_answer_when_read(
    holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plane.toml").write_text(JOB, "utf-8")
    run = holokin("sheets", "plane.toml", "--seconds", "5")
    assert run.code == 0, run.err
    assert "serve" in run.out
    assert "the job's path: 1 sheet, 0 changes, 0 divisions" in run.out
    assert (tmp_path / "sheets-plane.png").stat().st_size > 10_000
    arm = hk.with_limits(hk.load("planar-3r"), lower=-2.6, upper=2.6)
    s = hk.read_sheets(tmp_path / "sheets-plane.npz", hk.position(arm))
    assert s.share >= 0.9
    assert abs(arm.pose(s([1.2, 0.3])[1])[:2, 3] - [1.2, 0.3]).max() < 1e-9
    again = holokin("sheets", "plane.toml")
    assert again.code == 2
    assert "exists already" in again.err


def test_what_cannot_be_is_refused_before_the_work(
    holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in (["panda", "--out", "map.csv"], ["panda", "--share", "2"], ["pandaa"]):
        run = holokin("sheets", *words)
        assert run.code == 2
        assert "Traceback" not in run.err
