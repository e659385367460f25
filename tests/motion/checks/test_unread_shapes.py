"""Shapes that could not be read: no door tells a clearance of them, unless the user lets them touch."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused
from holokin.base.errors import HolokinError, RobotFileError
from holokin.motion.checks import Clearances
from holokin.robot import Box, Capsule

pytest.importorskip("coal")
trimesh = pytest.importorskip("trimesh")

pytestmark = pytest.mark.usefixtures("sketched")

FAULTS: dict[str, Callable[[Path, str], str]] = {
    "missing": lambda folder, name: f'<mesh filename="meshes/no {name}"/>',
    "another case": lambda folder, name: f'<mesh filename="meshes/{name.upper()}"/>',
    "unknown package": lambda folder, name: f'<mesh filename="package://elsewhere/meshes/{name}"/>',
    "empty": lambda folder, name: spoilt(folder, name, b""),
    "no mesh": lambda folder, name: spoilt(folder, name, b"this is no mesh"),
    "no triangles": lambda folder, name: spoilt(folder, name, b"solid x\nendsolid x\n"),
    "unknown geometry": lambda folder, name: '<capsule radius="0.05" length="0.1"/>',
    "no size": lambda folder, name: f'<mesh filename="meshes/{name}" scale="0 0 0"/>',
}
"""What is written in place of a mesh that can be read."""

READ: dict[str, Callable[[str], str]] = {
    "slash": lambda name: f"meshes/{name}",
    "backslash": lambda name: f"meshes\\{name}",
    "package": lambda name: f"package://cell/meshes/{name}",
    "package and backslash": lambda name: f"package://cell\\meshes\\{name}",
    "up and down": lambda name: f"..\\cell\\meshes\\{name}",
}


def spoilt(folder: Path, name: str, content: bytes) -> str:
    (folder / "meshes" / f"bad {name}").write_bytes(content)
    return f'<mesh filename="meshes/bad {name}"/>'


def arm_of(folder: Path, geometries: list[str], visuals: str = "") -> Path:
    """A URDF of an arm in space whose links have these geometries, 0.3 m apart, each a box 0.2 m long."""
    text = '<robot name="cell"><link name="base"/>'
    for i, geometry in enumerate(geometries):
        at = '<origin xyz="0 0 0.15"/>'
        text += f'<link name="l{i}"><collision>{at}<geometry>{geometry}</geometry></collision>{visuals}</link>'
        text += (
            f'<joint name="j{i}" type="revolute"><parent link="{f"l{i - 1}" if i else "base"}"/><child link="l{i}"/>'
        )
        text += f'<origin xyz="0 0 {0.3 if i else 0.0}"/><axis xyz="{"0 1 0" if i % 2 else "1 0 0"}"/>'
        text += '<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>'
    file = folder / "cell.urdf"
    file.write_text(text + "</robot>", "utf-8")
    return file


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A folder with the meshes of an arm of six links."""
    folder = tmp_path / "cell"
    (folder / "meshes").mkdir(parents=True)
    for i in range(6):
        trimesh.creation.box((0.06, 0.08, 0.2)).export(folder / "meshes" / f"l{i}.stl")
    return folder


def meshes(how: Callable[[str], str]) -> list[str]:
    return [f'<mesh filename="{how(f"l{i}.stl")}"/>' for i in range(6)]


@pytest.mark.parametrize("seed", range(6))
def test_links_whose_shapes_cannot_be_read_are_all_named_and_no_motion_passes(cell: Path, seed: int) -> None:
    """Random links, each with a random fault. Those that may touch all others are as if they had no shape."""
    rng = np.random.default_rng(seed)
    lost = sorted(rng.choice(6, size=int(rng.integers(1, 7)), replace=False).tolist())
    faults = rng.choice(list(FAULTS), size=6)
    given = meshes(READ["slash"])
    for i in lost:
        given[i] = FAULTS[faults[i]](cell, f"l{i}.stl")
    robot, names = hk.load(arm_of(cell, given)), [f"l{i}" for i in lost]
    Q = rng.uniform(-0.2, 0.2, (3, 6))
    scene = hk.Scene([hk.obstacle("ball", Capsule(0.1), (5, 0, 0))], floor=-1.0)
    report = hk.check(Q, scene, robot=robot)
    assert not report.passed and report.unread == f"cannot tell: the shapes of {', '.join(names)} could not be read"
    assert report.unread in report.table() and "nothing found" not in report.table()
    assert np.isnan(report.clearance) and np.isnan(report.bound) and report.to_dict()["clearance"] is None
    with pytest.raises(RobotFileError, match=f"cannot tell: the shapes of {', '.join(names)} could"):
        Clearances.of(robot, hk.Scene())
    some = [(name, "*") for name in names[1:]]
    assert hk.check(Q, replace(scene, allowed=some), robot=robot).unread.startswith(
        f"cannot tell: the shapes of {names[0]} "
    )
    allowed = hk.check(Q, replace(scene, allowed=[*some, ("*", names[0])]), robot=robot)
    whole = hk.check(Q, scene, robot=hk.load(arm_of(cell, meshes(READ["slash"]))))
    rest = {one.pair: one.least for one in whole.pairs if not set(one.pair) & set(names)}
    assert allowed.passed and {one.pair: one.least for one in allowed.pairs} == pytest.approx(rest)
    assert {one.link for one in allowed.unseen} >= set(names)


@pytest.mark.parametrize("how", list(READ))
def test_the_name_of_a_mesh_is_read_as_windows_writes_it(cell: Path, how: str) -> None:
    wanted = hk.check(np.zeros((1, 6)), robot=hk.load(arm_of(cell, meshes(READ["slash"]))))
    found = hk.check(np.zeros((1, 6)), robot=hk.load(arm_of(cell, meshes(READ[how]))))
    assert found.passed and found.unseen == () and found.pairs == wanted.pairs and len(found.pairs) > 8


def test_a_mesh_that_is_only_drawn_may_be_missing(cell: Path) -> None:
    drawn = '<visual><geometry><mesh filename="meshes/nowhere.stl"/></geometry></visual>'
    assert hk.check(np.zeros((1, 6)), robot=hk.load(arm_of(cell, meshes(READ["slash"]), drawn))).passed


def test_a_capsule_of_a_radius_by_name_stands_for_a_link_that_cannot_be_read(cell: Path) -> None:
    robot = hk.load(arm_of(cell, [*meshes(READ["slash"])[:5], FAULTS["missing"](cell, "l5.stl")]))
    assert not hk.check(np.zeros((1, 6)), robot=hk.robot.with_capsules(robot)).passed, "asked for by name alone"
    inner = hk.load(arm_of(cell, [FAULTS["missing"](cell, "l0.stl"), *meshes(READ["slash"])[1:]]))
    report = hk.check(np.zeros((1, 6)), robot=hk.robot.with_capsules(inner, {"j0": 0.05}))
    assert report.passed and ("l2", "j0") in {one.pair for one in report.pairs}


def test_what_is_left_out_or_not_asked_about_may_be_unread(cell: Path) -> None:
    robot = hk.load(arm_of(cell, [FAULTS["missing"](cell, "l.stl")] * 6))
    assert hk.check(np.zeros((1, 6)), None, robot=robot).passed
    assert not hk.check(np.zeros((1, 6)), hk.Scene(floor=-1.0, self_collision=False), robot=robot).passed
    bad = hk.obstacle("table", hk.robot.Mesh(cell / "nowhere.stl"), (5, 0, 0))
    whole = hk.load(arm_of(cell, meshes(READ["slash"])))
    assert hk.check(np.zeros((1, 6)), hk.Scene(obstacles=[bad]), robot=whole).unread == (
        "cannot tell: the shapes of table could not be read"
    )


DOORS = ("certify", "certify a path", "unique_region", "design", "advise", "sheets")


def doors(robot: hk.Robot) -> dict[str, Callable[..., Any]]:
    """All that keeps clear of things, with arguments as of `certify`."""
    q0 = np.array([0.3, 0.4, -0.3, 0.5, 0.2, -0.4])
    task = hk.position(robot)
    strategy = hk.holonomic(task, hk.lock("j0", "j1", "j5"))
    at = robot.pose(q0)[:3, 3]
    space = hk.workspace(box=(at, [1e-3] * 3))
    few = {"samples": 8}
    return {
        "certify": lambda **a: hk.certify(strategy, space, q0, **a),
        "certify a path": lambda **a: hk.certify(strategy, hk.line(at, at + [0, 0, 1e-3]), q0, **a),
        "unique_region": lambda **a: hk.unique_region(strategy, q0, space, budget=200, **a),
        "design": lambda **a: hk.design(task, space, q0, degree=1, **few, **a),
        "advise": lambda **a: hk.advise(task, space, q0=q0, **a),
        "sheets": lambda **a: hk.sheets(task, space, **a),
    }


@pytest.mark.parametrize("door", DOORS)
def test_every_door_that_keeps_clear_refuses_shapes_that_could_not_be_read(cell: Path, door: str) -> None:
    robot = hk.load(
        arm_of(cell, [*meshes(READ["slash"])[:4], FAULTS["missing"](cell, "l4.stl"), *meshes(READ["slash"])[5:]])
    )
    with pytest.raises(HolokinError, match=r"cannot tell: the shapes of l4 could not be read .*there is no such mesh"):
        doors(robot)[door](scene=hk.Scene(clearance=0.005))


def test_a_plane_of_mjcf_is_told_by_a_floor_that_is_as_high() -> None:
    pytest.importorskip("mujoco")
    geom = '<geom type="capsule" fromto="0 0 0 1 0 0" size="0.1"/>'
    text = (
        '<mujoco><worldbody><geom name="ground" type="plane" size="1 1 1" pos="0 0 -0.5"/>'
        f'<body name="a"><joint name="j" axis="0 0 1"/>{geom}'
        f'<body name="b" pos="1 0 0"><joint name="k" axis="0 1 0"/>{geom}</body></body></worldbody></mujoco>'
    )
    robot, still = hk.robot.from_mjcf(text), np.zeros((1, 2))
    assert (
        "give its height as floor" in hk.check(still, robot=robot).table() and not hk.check(still, robot=robot).passed
    )
    assert (
        not hk.check(still, hk.Scene(floor=-0.6), robot=robot).passed
        and hk.check(still, hk.Scene(floor=-0.5), robot=robot).passed
    )
    assert hk.check(still, hk.Scene(allowed=[("ground", "*")]), robot=robot).passed


@pytest.mark.parametrize(("kind", "unread"), [("", "a"), ('contype="0" conaffinity="0"', "")])
def test_of_mjcf_only_the_bodies_whose_meshes_are_missing_are_unread(tmp_path: Path, kind: str, unread: str) -> None:
    """Those whose meshes are there, and boxes, keep their shapes; what touches nothing is only drawn."""
    pytest.importorskip("mujoco")
    trimesh.creation.box((0.2, 0.1, 0.1)).export(tmp_path / "there.stl")
    heavy = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    geoms = [
        f'<geom type="mesh" mesh="lost" {kind}/>',
        '<geom type="mesh" mesh="there"/>',
        '<geom type="box" size=".1 .1 .1"/>',
    ]
    bodies = "".join(
        f'<body name="{n}" pos="1 0 0"><joint name="j{n}" axis="0 0 1" range="-2 2"/>{heavy}{g}'
        for n, g in zip("abc", geoms, strict=True)
    )
    (tmp_path / "arm.xml").write_text(
        '<mujoco><asset><mesh name="lost" file="lost.stl"/><mesh file="there.stl"/></asset><worldbody>'
        f"{bodies}</body></body></body></worldbody></mujoco>"
    )
    robot = hk.load(tmp_path / "arm.xml", tip="c")
    report = hk.check(np.zeros((1, 3)), robot=robot)
    assert report.unread == (f"cannot tell: the shapes of {unread} could not be read" if unread else "")
    assert {s.link for s in robot.shapes if not s.shape.fault} == {"b", "c"} and robot.bodies[0].mass == 1.0


JOB = """title = "cell"
[robot]
name = "cell.urdf"
[start]
q = [0.3, 0.4, -0.3, 0.5, 0.2, -0.4]
[task]
kind = "position"
[path]
kind = "line"
points = [[0, 0, 0], [0, 0, -0.01]]
relative = true
samples = 10
[checks]
clearance = 0.005
{}
[timing]
acceleration = 10
dt = 0.01
[strategies.mp]
kind = "moore-penrose"
[expect.mp]
clearance = {{ above = 0.0 }}
"""


def test_no_command_passes_a_motion_whose_shapes_could_not_be_read(holokin: Command, cell: Path, out: Path) -> None:
    """`run` and `check` exit 1, `export` writes nothing; with the link ignored all is well."""
    arm_of(cell, [*meshes(READ["slash"])[:4], FAULTS["another case"](cell, "l4.stl"), *meshes(READ["slash"])[5:]])
    job, log = cell / "job.toml", cell / "log.csv"
    job.write_text(JOB.format("").replace("line", "polyline"), "utf-8")
    told = "cannot tell: the shapes of l4 could not be read"
    ran = holokin("run", job, "--out", out)
    assert ran.code == 1 and told in " ".join(ran.out.split()) and "nothing found" not in ran.out
    page = (out / "job" / "report.html").read_text("utf-8")
    assert f"Of the distances the checks {told}." in page and "Clearances are kept" not in page
    facts = json.loads((out / "job" / "result.json").read_text("utf-8"))["strategies"][0]
    assert (
        facts["passed"] is False and facts["motion_check"]["unread"] == told and facts["metrics"]["clearance"] is None
    )
    written = holokin("export", "urscript", job, "--out", cell / "program")
    assert written.code == 1 and told in written.out and not (cell / "program").exists()
    names = ",".join(["t", *(f"j{i}" for i in range(6))])
    rows = np.column_stack([np.arange(3.0), np.tile([0.3, 0.4, -0.3, 0.5, 0.2, -0.4], (3, 1))])
    np.savetxt(log, rows, delimiter=",", header=names, comments="")
    asked = ("check", log, "--robot", cell / "cell.urdf", "--position", "--clearance", "0.005")
    looked = holokin(*asked)
    assert looked.code == 1 and told in looked.out and "one named l4.stl" in looked.out
    assert holokin(*asked, "--allowed", "l4,*").code == 0
    job.write_text(JOB.format('allowed = [["l4", "*"]]').replace("line", "polyline"), "utf-8")
    assert holokin("run", job, "--out", out).code == 0
    assert_refused(holokin(*asked, "--allowed", "l9,*"), "l9")


def test_box_shapes_of_the_same_arm_pass(cell: Path) -> None:
    """The referee of these tests: the meshes are boxes, and are as far apart as boxes are."""
    boxes = hk.check(np.full((1, 6), 0.1), robot=hk.load(arm_of(cell, ['<box size="0.06 0.08 0.2"/>'] * 6)))
    read = hk.check(np.full((1, 6), 0.1), robot=hk.load(arm_of(cell, meshes(READ["slash"]))))
    assert {one.pair: one.least for one in read.pairs} == pytest.approx(
        {p.pair: p.least for p in boxes.pairs}, abs=1e-5
    )
    assert Box([0.06, 0.08, 0.2]).fault == ""
