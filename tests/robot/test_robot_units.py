"""A robot in millimetres or degrees: every reader has the same verdict, and brings it where it is overruled."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused, write_job
from holokin.base.errors import HolokinError
from holokin.base.poses import pose_from
from holokin.robot.chains import longest_reach
from holokin.robot.joints import Tip

Row = Mapping[str, Any]
Reader = Callable[[list[Row], Path, bool], hk.Robot]


def from_table(rows: list[Row], _folder: Path, trust: bool) -> hk.Robot:
    return hk.from_dh(rows, trust_units=trust)


def from_toml(rows: list[Row], folder: Path, trust: bool) -> hk.Robot:
    lines = ['source = "a test"', 'tip = "tool"']
    for row in rows:
        turned = {f"{key}_deg": float(np.rad2deg(row[key])) for key in ("alpha", "theta")}
        kept = {key: row[key] for key in ("kind", "a", "d", "lower", "upper")}
        lines += ["[[joints]]", *(f"{k} = {v!r}" for k, v in (kept | turned).items())]
    (folder / "table.toml").write_text("\n".join(lines))
    return hk.load(folder / "table.toml", trust_units=trust)


def from_urdf(rows: list[Row], folder: Path, trust: bool) -> hk.Robot:
    text = hk.robot.to_urdf(hk.from_dh(rows, trust_units=True))
    ball = '<collision><origin xyz="0.1 0.2 0.3"/><geometry><sphere radius="0.01"/></geometry></collision>'
    (folder / "arm.urdf").write_text(text.replace("</link>", f"{ball}</link>"))
    return hk.load(folder / "arm.urdf", trust_units=trust)


def from_parts(rows: list[Row], folder: Path, trust: bool) -> hk.Robot:
    """Two of them: the second stands beside the first."""
    (folder / "arm.urdf").write_text(hk.robot.to_urdf(hk.from_dh(rows, trust_units=True)))
    parts = '[[parts]]\nname = "arm.urdf"\n[[parts]]\nname = "arm.urdf"\nprefix = "r_"\non = "base"\nxyz = [0, 1, 0]\n'
    (folder / "two.toml").write_text(f'source = "a test"\n{parts}')
    return hk.load(folder / "two.toml", trust_units=trust)


def from_mjcf(rows: list[Row], _folder: Path, trust: bool) -> hk.Robot:
    pytest.importorskip("mujoco")
    return hk.robot.from_mjcf(hk.robot.to_mjcf(hk.from_dh(rows, trust_units=True)), trust_units=trust)


def from_pinocchio(rows: list[Row], _folder: Path, trust: bool) -> hk.Robot:
    pinocchio = pytest.importorskip("pinocchio")
    model = pinocchio.buildModelFromXML(hk.robot.to_urdf(hk.from_dh(rows, trust_units=True)))
    return hk.robot.from_pinocchio(model, tip="tool", base="base", trust_units=trust)


READERS: list[Reader] = [from_table, from_toml, from_urdf, from_parts, from_mjcf, from_pinocchio]


def drawn_table(rng: np.random.Generator) -> list[Row]:
    """An arm of 3 to 7 joints, hinges but for a slide in some: a link, but that to a slide, has 0.1 m or more."""
    rows = []
    slide = int(rng.integers(0, 12))
    for i in range(int(rng.integers(3, 8))):
        row = {"a": rng.uniform(0.1, 0.6), "d": rng.uniform(-0.3, 0.3), "alpha": rng.choice([-1, 0, 1]) * np.pi / 2}
        limits = {"lower": -rng.uniform(0.5, 3), "upper": rng.uniform(0.5, 6)}
        rows.append(row | {"theta": rng.uniform(-3, 3), "kind": "prismatic" if i == slide else "revolute"} | limits)
    return [{key: v if isinstance(v, str) else float(v) for key, v in row.items()} for row in rows]


def in_millimetres(row: Row) -> Row:
    lengths = ("a", "d", *(("lower", "upper") if row["kind"] == "prismatic" else ()))
    return {**row, **{key: 1e3 * row[key] for key in lengths}}


def in_degrees(row: Row) -> Row:
    turns = ("lower", "upper") if row["kind"] == "revolute" else ()
    return {**row, **{key: float(np.rad2deg(row[key])) for key in turns}}


def check_one_verdict(seed: int, folder: Path) -> None:
    rng = np.random.default_rng(seed)
    rows = drawn_table(rng)
    q = rng.uniform([row["lower"] for row in rows], [row["upper"] for row in rows])
    tool = hk.from_dh(rows).pose(q)
    for reader in READERS:
        plain = reader(rows, folder, False)
        number = 2 if reader is from_parts else 1
        assert plain.pose(np.tile(q, number), plain.tips[0].name) == pytest.approx(tool, abs=1e-7)
        for spoil, word in ((in_millimetres, "millimetres"), (in_degrees, "degrees")):
            spoilt = [spoil(row) for row in rows]
            with pytest.raises(HolokinError, match=f"looks like {word}: give .* or trust_units=True"):
                reader(spoilt, folder, False)
            believed = reader(spoilt, folder, True)
            assert believed.upper == pytest.approx(np.tile([row["upper"] for row in spoilt], number))


@pytest.mark.parametrize("seed", range(1))
def test_every_reader_has_the_same_doubt_and_believes_who_says_so(seed: int, tmp_path: Path) -> None:
    check_one_verdict(seed, tmp_path)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(1, 60))
def test_more_robots_have_one_verdict(seed: int, tmp_path: Path) -> None:
    check_one_verdict(seed, tmp_path)


def masses(robot: hk.Robot) -> list[tuple[int, np.ndarray]]:
    return [(body.joint, pose_from(body.center)) for body in robot.bodies]


def visible(robot: hk.Robot) -> list[tuple[int, np.ndarray]]:
    return [(visual.joint, visual.placement) for visual in robot.visuals]


def solid(robot: hk.Robot) -> list[tuple[int, np.ndarray]]:
    return [(shape.joint, shape.placement) for shape in robot.shapes]


def seen_at(robot: hk.Robot, q: np.ndarray, joint: int, T: np.ndarray) -> np.ndarray:
    """Where what is fixed to a joint at T is at q, in the base frame."""
    return replace(robot, tips=(Tip("it", joint, T),)).pose(q)


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("seed", range(2))
def test_calibrated_axes_nearly_parallel_are_in_metres_however_far_their_frames_stand(
    reader: Reader, seed: int, tmp_path: Path
) -> None:
    """An angle e between axes puts the frames as far away as a / e along them; behind them the arm comes back."""
    rng = np.random.default_rng(seed)
    rows = [dict(row, kind="revolute") for row in drawn_table(rng)]
    first, far, e = int(rng.integers(0, len(rows) - 1)), rng.uniform(100, 900), rng.uniform(1e-6, 1e-5)
    rows[first] |= {"alpha": float(e), "d": float(far)}
    rows[first + 1] |= {"d": float(rng.uniform(-0.2, 0.2) - far)}
    robot = reader([{**row, "theta": 0.0} for row in rows], tmp_path, False)
    trusted = reader([{**row, "theta": 0.0} for row in rows], tmp_path, True)  # its frames stay where they are
    Q = rng.uniform(-3, 3, (2, robot.n))
    for q in Q:
        for tip in robot.tips:
            assert robot.pose(q, tip.name) == pytest.approx(trusted.pose(q, tip.name), abs=1e-9)
            assert robot.jacobian(q, tip.name) == pytest.approx(trusted.jacobian(q, tip.name), abs=1e-9)
        assert max(np.abs(line).max() for line in robot.skeleton(q)) < 15 < np.abs(trusted.skeleton(q)[0]).max()
    if reader is from_urdf:
        for placed in (masses, visible, solid):
            for (i, T), (k, other) in list(zip(placed(robot), placed(trusted), strict=True))[::3]:
                assert seen_at(robot, Q[0], i, T) == pytest.approx(seen_at(trusted, Q[0], k, other), abs=1e-9)
    assert longest_reach(robot) < 10
    with pytest.raises(HolokinError, match="millimetres"):
        hk.with_tool(robot, [0, 0, 150])
    if reader is from_table:  # its capsules are those of an arm, too
        assert hk.check(np.zeros((2, robot.n)), hk.Scene(floor=-20.0, self_collision=False), robot=robot).passed
    assert hk.with_tool(robot, [0, 0, 150], trust_units=True).n == robot.n


def test_most_hinges_of_many_turns_are_doubted_and_one_or_a_few_are_not(planar_3r: hk.Robot) -> None:
    assert hk.with_limits(planar_3r, lower={"q1": -170.0}, upper={"q1": 170.0}).upper[0] == 170.0
    with pytest.raises(HolokinError, match="looks like degrees"):
        hk.with_limits(planar_3r, lower=-170.0, upper=170.0)
    with pytest.raises(HolokinError, match="looks like degrees"):  # a joint that hardly turns does not hide the others
        hk.with_limits(planar_3r, lower=[-170.0, -5.0, -170.0], upper=[170.0, 5.0, 170.0])
    assert hk.with_limits(planar_3r, lower=-170.0, upper=170.0, trust_units=True).upper[0] == 170.0
    assert hk.with_limits(planar_3r, max_velocity=100.0, trust_units=True).max_velocity[0] == 100.0
    fast = hk.with_limits(planar_3r, max_velocity=100.0, trust_units=True)  # as models write where they know none
    assert hk.with_limits(fast, max_velocity={"q1": 2.0}).max_velocity.tolist() == [2.0, 100.0, 100.0]
    assert np.isinf(hk.with_limits(planar_3r, lower=-np.inf, upper=np.inf).upper).all()


def test_the_command_line_and_a_job_ask_and_are_overruled(holokin: Command, tmp_path: Path) -> None:
    rows = [{"a": 1000.0, "lower": -3.0, "upper": 3.0} for _ in range(3)]
    (tmp_path / "mm.urdf").write_text(hk.robot.to_urdf(hk.from_dh(rows, trust_units=True)))
    asked = ("robots", tmp_path / "mm.urdf", "--tip", "tool")
    assert_refused(holokin(*asked), "mm.urdf", "looks like millimetres: give metres", "--trust-units")
    assert holokin(*asked, "--trust-units").code == 0
    log = tmp_path / "log.csv"
    log.write_text("time,q1,q2,q3\n" + "".join(f"{0.1 * i},{0.01 * i},0,1\n" for i in range(9)))
    for command in ("check", "audit"):
        words = (command, log, "--robot", tmp_path / "mm.urdf", "--position")
        assert "millimetres" in holokin(*words).err
        assert "millimetres" not in holokin(*words, "--trust-units").err
    robot = '[robot]\nname = "mm.urdf"\n'
    assert_refused(holokin("robots", write_job(tmp_path, robot=robot)), "millimetres")
    assert holokin("robots", write_job(tmp_path, robot=f"{robot}trust_units = true\n")).code == 0


def test_angles_of_frames_in_a_robot_file_are_doubted_and_may_be_believed(tmp_path: Path) -> None:
    file = tmp_path / "arm.toml"
    head, joints = 'source = "a test"\n', "[[joints]]\na = 0.4\n[[joints]]\na = 0.3\n"
    urdf_joints = "[[joints]]\nxyz = [0, 0, 0.4]\n[[joints]]\nxyz = [0.3, 0, 0]\nrpy = [0, 90, 0]\n"
    for text in (f"{head}base = {{ rpy = [0, 0, 90] }}\n{joints}", f'{head}convention = "urdf"\n{urdf_joints}'):
        file.write_text(text)
        with pytest.raises(HolokinError, match=r"rpy of .* looks like degrees"):
            hk.load(file)
        assert hk.load(file, trust_units=True).n == 2
        file.write_text(f"trust_units = true\n{text}")
        assert hk.load(file).n == 2
        file.write_text(text.replace("rpy", "rpy_deg"))
        assert hk.load(file).n == 2
    file.write_text(f"trust_units = 1\n{head}{joints}")
    with pytest.raises(HolokinError, match="trust_units is 1"):
        hk.load(file)
