"""`holokin cell`: one command from a robot and a CAM file to a program, and the commands that make its files again."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from ezdxf.filemanagement import new

import holokin as hk
from conftest import Command, urdf
from holokin.app.job import read_job
from holokin.app.job.cell_job import write_cell
from holokin.base.errors import ArgumentError, FileError, HolokinError, JobError, OutOfReachError
from holokin.export import language_of

APT = """PARTNO BRACKET
UNITS/MM
RAPID
GOTO/0.0,0.0,50.0,0.0,0.0,1.0
FEDRAT/600.0,MMPM
GOTO/0.0,0.0,0.0,0.0,0.0,1.0
GOTO/120.0,0.0,0.0,0.0,0.1736482,0.9848078
GOTO/120.0,80.0,10.0,0.0,0.0,1.0
FINI
"""
SLOTS = "\n".join(
    ["G21 G90 G17", "(SLOT 1)", "G0 X0. Y0. Z20.", "G1 Z-1. F300.", "G1 X60. F900.", "G2 X70. Y10. I0. J10.", "G0 Z20."]
    + ["(SLOT 2)", "G0 X100. Y0.", "G1 Z-1. F300.", "G1 Y60. F900.", "G0 Z20.", "M30", ""]
)
TURNED = "x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n0,0,0,180,0,0\n60,0,0,180,10,0\n60,50,0,180,0,20\n"


@pytest.fixture
def paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with files of paths, in which commands run."""
    for name, text in {"bracket.apt": APT, "slots.nc": SLOTS, "turned.csv": TURNED}.items():
        (tmp_path / name).write_text(text, "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("robot", "file", "rule", "point"),
    [
        ("iiwa14", "bracket.apt", "advised", [0.0, 0.0, 0.05]),
        ("ur10e", "slots.nc", "advised", [0.0, 0.0, 0.02]),
        ("ur10e", "turned.csv", "inverse", [0.0, 0.0, 0.0]),
    ],
)
def test_begins_above_the_path(paths: Path, robot: str, file: str, rule: str, point: list[float]) -> None:
    """The tool begins above the first point of the part, wherever this stands and however it is turned."""
    made = write_cell(robot, Path(file), Path("o"), at="0.5 0.1 0.2 0 0 30")
    job = read_job(made.file)
    assert list(job.strategies) == [rule]
    q = np.deg2rad(job.start.q)
    T = hk.load(robot).pose(q)
    turn = np.deg2rad(30)
    Rz = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    above = np.array(point) + [0, 0, made.retract]
    np.testing.assert_allclose(T[:3, 3], [0.5, 0.1, 0.2] + Rz @ above, atol=1e-8)
    np.testing.assert_allclose(T[:3, 2], [0, 0, -1.0], atol=1e-8)  # into the work
    assert made.retract == 0.05
    if rule == "inverse":  # the file says how the tool is turned, too
        np.testing.assert_allclose(T[:3, 0], Rz @ [1.0, 0, 0], atol=1e-8)


def test_scene(paths: Path) -> None:
    """What stands in the cell is in the job, its meshes by names that count from there; the arm has its tool."""
    shop = paths / "shop"
    shop.mkdir()
    trimesh.creation.box((100, 100, 100)).export(shop / "box.stl")
    (shop / "cell.toml").write_text(
        "[frames.part]\nxyz = [0.5, 0, 0.3]\n[robot]\ntool = { xyz = [0, 0, 0.12] }\n[checks]\nfloor = -0.1\n"
        '[[checks.obstacles]]\nname = "vise"\nkind = "mesh"\nfile = "box.stl"\nscale = 0.001\nxyz = [0, 0.8, 0]\n'
    )
    made = write_cell("iiwa14", Path("bracket.apt"), Path("o"), scene=shop / "cell.toml")
    job = read_job(made.file)
    assert job.scene is not None and job.scene.floor == -0.1
    assert [shape.link for shape in job.scene.obstacles] == ["vise"]
    T = hk.load("iiwa14").pose(np.deg2rad(job.start.q))
    np.testing.assert_allclose(T[:3, 3] + 0.12 * T[:3, 2], [0.5, 0, 0.4], atol=1e-8)
    with pytest.raises(ArgumentError, match="already"):
        write_cell("iiwa14", Path("bracket.apt"), Path("p"), scene=shop / "cell.toml", at="0.5 0 0")


def test_out_of_reach(paths: Path) -> None:
    """The refusal says how far the part is and where it would do, and there it does."""
    with pytest.raises(OutOfReachError, match=r"3\.0\d to 3\.1\d m .* it reaches 1\.\d+ m") as refused:
        write_cell("ur10e", Path("bracket.apt"), Path("o"), at="3 0 0.5")
    there = re.search(r'--at "([^"]+)"', str(refused.value))
    assert there is not None
    assert not Path("o").exists()
    assert not write_cell("ur10e", Path("bracket.apt"), Path("o"), at=there[1]).beyond
    # A path that leads out of reach is begun, and it is said how much of it is.
    Path("long.csv").write_text("x_mm,y_mm,z_mm\n0,0,0\n500,0,0\n1000,0,0\n1500,0,0\n")
    made = write_cell("ur10e", Path("long.csv"), Path("o"), at="0.5 0 0.2")
    assert made.beyond.startswith("2 of 4 points are out of reach: ")


def test_bad_input(paths: Path) -> None:
    """What cannot be used is refused before anything is written."""
    file, out = Path("bracket.apt"), Path("o")
    (paths / "empty.apt").write_text("PARTNO NOTHING\nUNITS/MM\nFINI\n")
    (paths / "no-units.csv").write_text("x,y,z\n0,0,0\n1,0,0\n")
    (paths / "wrong.toml").write_text("[chekcs]\nfloor = 0\n")
    (paths / "whole.toml").write_text('[robot]\nname = "panda"\n')
    arm7 = (Path(__file__).parents[3] / "docs" / "arm7.urdf").read_text("utf-8")
    (paths / "still.urdf").write_text(re.sub(r'velocity="[^"]*"', 'velocity="0"', arm7))
    cases: tuple[tuple[type[Exception], str, str, Path, dict[str, Any]], ...] = (
        (FileError, "no path", "ur10e", Path("empty.apt"), {}),
        (FileError, "unit", "ur10e", Path("no-units.csv"), {}),
        (JobError, "chekcs.* not of a scene", "ur10e", file, {"scene": Path("wrong.toml")}),
        (JobError, "said by the command", "ur10e", file, {"scene": Path("whole.toml")}),
        (ArgumentError, "srdf", "ur10e", file, {"scene": file}),
        (ArgumentError, "ROLL PITCH YAW", "ur10e", file, {"at": "0.5 0"}),
        (JobError, "path.speed", "ur10e", file, {"speed": -1.0}),
        (HolokinError, "speed limit of", "still.urdf", file, {"at": "0.4 0 0.2"}),
    )
    for kind, words, robot, given, options in cases:
        with pytest.raises(kind, match=words):
            write_cell(robot, given, out, **options)
        assert not out.exists()
    out.mkdir()
    (out / "cell.toml").write_text("title = 'mine'\n")
    with pytest.raises(ArgumentError, match="it is yours"):
        write_cell("ur10e", file, out, at="0.5 0 0.2")
    assert (out / "cell.toml").read_text() == "title = 'mine'\n"


def test_language() -> None:
    """The names of arms tell their controllers; those that do not, tell none."""
    names = {
        "ur10e": "urscript", "kuka_lbr_iiwa": "sunrise", "iiwa14": "sunrise", "kr6": "krl", "panda": "franka",
        "xarm7": "xarm", "UF_ROBOT": "xarm", "irb140": "rapid", "motoman_sia20d": "inform", "gen3": "kinova",
        "staubli_rx160": "val3", "fanuc_m10ia": "ls", "baxter": None, "tiago": None, "sawyer": None, "blur3": None,
    }  # fmt: skip
    assert {name: language_of(name) for name in names} == names


def facts(folder: Path) -> dict[str, object]:
    """The files that commands write, without pictures and pages, and without the seconds that they took."""

    def plain(text: str) -> object:
        return json.loads(text, object_hook=lambda known: {k: v for k, v in known.items() if k != "seconds"})

    files = [file for file in sorted(folder.rglob("*")) if file.suffix not in ("", ".png", ".svg", ".html")]
    read = {file: file.read_text("utf-8") for file in files}
    return {str(f.relative_to(folder)): plain(t) if f.suffix == ".json" else t for f, t in read.items()}


def again(printed: str, folder: Path, holokin: Command) -> dict[str, object]:
    """What the commands that were printed make, in another folder beside the first."""
    other = folder.with_name("again")
    other.mkdir()
    if (folder / "draft.toml").exists():
        (other / "draft.toml").write_bytes((folder / "draft.toml").read_bytes())
    else:
        (other / "cell.toml").write_bytes((folder / "cell.toml").read_bytes())
    for line in re.findall(r"^  holokin (.*)$", printed, re.MULTILINE):
        done = holokin(*(word.replace(folder.name, other.name) for word in shlex.split(line)))
        assert done.code == 0, done.err
    return facts(other)


def answered(printed: str) -> list[str]:
    """The six sentences. Their first words are as they should be where all goes well."""
    lines = printed.splitlines()[:6]
    assert [line.partition(":")[0] for line in lines] == ["Yes", "Read", "Clear", "Proven", "Program", "Next"]
    return lines


def test_one_command(holokin: Command, paths: Path, sketched: None) -> None:
    """Three axes for a point, none to spare: six sentences, and all files again by the commands that are printed."""
    kr6 = Path(__file__).parents[3] / "docs" / "kr6.urdf"
    Path("line.csv").write_text("x_mm,y_mm,z_mm\n0,0,0\n0,80,20\n")
    Path("wrist.toml").write_text(
        "[robot]\nlocked = { A4 = 0, A5 = 0.5, A6 = 0 }\n[task]\nkind = 'position'\n[timing]\nprofile = 'quintic'\n"
    )
    given = ("--scene", "wrist.toml", "--at", "0.5 0 0.3", "--speed", "0.05", "--language", "ros", "--out", "first")
    done = holokin("cell", kr6, "line.csv", *given)
    assert done.code == 0, done.out + done.err
    lines = answered(done.out)
    assert "no joint is to spare" in lines[0]
    told = re.search(r"for ROS 2: ([\d.]+) s, the tool at up to ([\d.]+) mm/s", lines[4])
    assert told is not None
    first = facts(Path("first"))
    assert {"cell.toml", "cell/result.json", "cell-proof/result.json", "program/joints.csv"} <= first.keys()
    assert again(done.out, Path("first"), holokin) == first
    # The time and the speed are those of the joints in the file of the program.
    table = np.loadtxt("first/program/joints.csv", delimiter=",", skiprows=1)
    robot = hk.load(kr6, locked={"A4": 0.0, "A5": 0.5, "A6": 0.0})
    points = np.array([robot.pose(np.deg2rad(q))[:3, 3] for q in table[:, 1:4]])
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff(table[:, 0])
    assert float(told[1]) == pytest.approx(table[-1, 0], abs=0.05)
    assert speed.max() == pytest.approx(float(told[2]) / 1e3, rel=6e-3)
    assert speed.max() < 0.0502


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("robot", "file", "at", "language"),
    [
        ("ur10e", "slots.nc", "0.5 0 0.1", "urscript"),
        ("iiwa14", "bracket.apt", "0.5 0 0.3", "sunrise"),
        ("panda", "outline.dxf", "0.4 0 0.2", "franka"),
    ],
)
def test_arms_and_files(
    robot: str, file: str, at: str, language: str, holokin: Command, paths: Path, sketched: None
) -> None:
    """The same of arms with joints to spare, and of files with one path and several."""
    drawing = new(units=4)  # millimetres
    corners = [(0, 0, 0, 0, 0), (150, 0, 0, 0, 0.4), (150, 100, 0, 0, 0), (0, 100, 0, 0, 0)]
    drawing.modelspace().add_lwpolyline(corners, close=True)
    drawing.saveas("outline.dxf")
    done = holokin("cell", robot, file, "--at", at, "--out", "first")
    assert done.code == 0, done.out + done.err
    answered(done.out)
    assert f"export {language} " in done.out
    assert again(done.out, Path("first"), holokin) == facts(Path("first"))


@pytest.mark.campaign
def test_a_urdf_that_nobody_tuned_for(holokin: Command, paths: Path, sketched: None) -> None:
    """Its hulls are nearer than its meshes, so that nothing is proven: that is said, and the program is written."""
    done = holokin("cell", urdf("ur10_robot.urdf"), "bracket.apt", "--at", "0.6 0 0.2", "--out", "first")
    assert done.code == 1, done.out + done.err
    first = [line.partition(":")[0] for line in done.out.splitlines()[:6]]
    assert first == ["Yes", "Read", "Clear", "Not proven", "Program", "Next"]
    assert "but the convex shapes that stand for them" in done.out
    assert list((Path("first") / "program").glob("*.script"))


@pytest.mark.campaign
def test_part_of_it(holokin: Command, paths: Path, sketched: None) -> None:
    """A path out of reach: the others are done, the program is of these, and the exit code tells."""
    text = SLOTS.replace("M30", "(FAR)\nG0 X3000. Y0.\nG1 Z-1. F300.\nG1 Y60. F900.\nG0 Z20.\nM30")
    Path("far.nc").write_text(text)
    done = holokin("cell", "ur10e", "far.nc", "--at", "0.5 0 0.1", "--out", "first")
    assert done.code == 1
    assert done.out.startswith("In part: ur10e goes along 2 of 3 paths, without path 3")
    assert "Next: " in done.out and "out of reach" in done.out
    assert (Path("first") / "program").is_dir()
