"""Robots: DH tables against the textbook product, Jacobians against differences, the catalogue against its sources."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, Command, assert_refused, sampled, urdf, write_job
from holokin.base.errors import (
    ArgumentError,
    HolokinError,
    JointLimitError,
    NotFiniteError,
    RobotFileError,
    RowsError,
    ShapeError,
    UnknownNameError,
)
from holokin.base.poses import pose_from
from holokin.robot import mass_matrix_expression, potential_expression
from holokin.robot.chains import longest_reach
from holokin.robot.joints import Tip
from holokin.symbolic import Function, symbol

NAMES = tuple(hk.robot.catalogue())


def Rz(a: float) -> np.ndarray:
    return np.array([[np.cos(a), -np.sin(a), 0, 0], [np.sin(a), np.cos(a), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


def Rx(a: float) -> np.ndarray:
    return np.array([[1, 0, 0, 0], [0, np.cos(a), -np.sin(a), 0], [0, np.sin(a), np.cos(a), 0], [0, 0, 0, 1.0]])


def T(x: float, z: float) -> np.ndarray:
    out = np.eye(4)
    out[0, 3], out[2, 3] = x, z
    return out


figures = st.floats(-2, 2)
rows = st.lists(st.tuples(figures, figures, figures, figures, st.booleans(), figures), min_size=1, max_size=7)


@given(rows, st.sampled_from(["standard", "modified"]), figures)
def test_a_dh_robot_is_the_textbook_product(table: list, convention: str, angle: float) -> None:
    base, tool = Rx(angle) @ T(0.1, 0.2), Rz(angle) @ T(0.3, -0.1)
    robot = hk.from_dh(
        [
            {"a": a, "alpha": alpha, "d": d, "theta": theta, "kind": "prismatic" if slides else "revolute"}
            for a, alpha, d, theta, slides, _ in table
        ],
        convention=convention,
        base=base,
        tool=tool,
    )
    expected = base.copy()
    for a, alpha, d, theta, slides, q in table:
        turn, slide = (theta, d + q) if slides else (theta + q, d)
        link, motion = Rx(alpha) @ T(a, 0), Rz(turn) @ T(0, slide)
        expected = expected @ (motion @ T(a, 0) @ Rx(alpha) if convention == "standard" else link @ motion)
    q = np.array([row[-1] for row in table])
    assert np.abs(robot.pose(q) - expected @ tool).max() < 1e-13
    assert robot.jacobian(q).shape == (6, len(table))


@pytest.mark.parametrize("name", NAMES)
def test_the_geometric_jacobian_is_the_derivative_of_the_pose(name: str) -> None:
    robot = hk.load(name)
    h = 1e-6
    for q in np.random.default_rng(0).uniform(-1.2, 1.2, (5, robot.n)):
        J = robot.jacobian(q)
        for i, e in enumerate(np.eye(robot.n) * h):
            plus, minus = robot.pose(q + e), robot.pose(q - e)
            assert np.abs((plus - minus)[:3, 3] / (2 * h) - J[:3, i]).max() < 1e-9
            turn = Rotation.from_matrix(plus[:3, :3] @ minus[:3, :3].T).as_rotvec() / (2 * h)
            assert np.abs(turn - J[3:, i]).max() < 1e-9


@pytest.mark.parametrize("name", NAMES)
def test_every_robot_of_the_catalogue_has_a_source_limits_and_a_skeleton(name: str) -> None:
    robot = hk.load(name)
    assert len(robot.source) > 20
    assert (robot.lower < robot.upper).all()
    assert np.isfinite(robot.max_velocity).all()
    endless = {c.name for c in robot.coordinates if not np.isfinite([c.lower, c.upper]).all()}
    assert endless == {"gen3": {"joint_1", "joint_3", "joint_5", "joint_7"}}.get(name, endless & {"base_turn"})
    q = np.where(np.isfinite(robot.lower), (np.maximum(robot.lower, -9) + np.minimum(robot.upper, 9)) / 2, 0.3)
    lines = robot.skeleton(q)
    assert sum(len(line) - 2 for line in lines) == robot.n
    for line, tip in zip(lines, robot.tips, strict=True):
        assert line[-1] == pytest.approx(robot.pose(q, tip.name)[:3, 3])
    assert robot.planar is (name in ("ppr", "planar-3r", "planar-base", "rail"))


def test_the_catalogue_panda_is_the_urdfs() -> None:
    ours, theirs = hk.load("panda"), hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp")
    assert ours.joint_names == theirs.joint_names
    for q in PANDA_START + np.random.default_rng(1).uniform(-0.5, 0.5, (5, 7)):
        assert np.abs(ours.pose(q) - theirs.pose(q)).max() < 1e-12
        assert np.abs(ours.jacobian(q) - theirs.jacobian(q)).max() < 1e-12
    assert ours.lower == pytest.approx(theirs.lower, abs=1e-12)
    assert ours.upper == pytest.approx(theirs.upper, abs=1e-12)
    assert ours.max_velocity == pytest.approx(theirs.max_velocity, abs=1e-12)


def test_the_irb140_is_table_I() -> None:
    table = ((0.07, 0, 90), (0.36, 0, 0), (0, 0, 90), (0, 0.38, -90), (0, 0, 90), (0, 0.065, 0))
    robot = hk.load("irb140")
    q = np.array([0.3, 1.1, -0.4, 0.8, 0.6, -1.2])
    expected = np.eye(4)
    for (a, d, alpha), angle in zip(table, q, strict=True):
        expected = expected @ Rz(angle) @ T(0, d) @ T(a, 0) @ Rx(np.deg2rad(alpha))
    assert np.abs(robot.pose(q) - expected).max() < 1e-14
    # ABB's zero posture: upper arm upright, forearm and tool level
    assert robot.pose(np.deg2rad([0, 90, 0, 0, 0, 0]))[:3, 3] == pytest.approx([0.07 + 0.38 + 0.065, 0, 0.36])


def test_the_ppr_jacobian_has_exact_zeros_and_ones(ppr: hk.Robot) -> None:
    J = hk.position(ppr).jacobian([0.3, -0.2, 0.9])
    assert np.array_equal(J, [[1, 0, -np.sin(0.9)], [0, 1, np.cos(0.9)]])


def test_the_ppr_is_equation_18_and_its_arm_is_one_metre(ppr: hk.Robot) -> None:
    for q in np.random.default_rng(18).uniform(-3, 3, (20, 3)):
        c, s = np.cos(q[2]), np.sin(q[2])
        assert np.array_equal(hk.position(ppr).jacobian(q), [[1, 0, -s], [0, 1, c]])
        assert np.array_equal(ppr.jacobian(q), [[1, 0, -s], [0, 1, c], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 1]])
        assert ppr.pose(q)[:3, 3] == pytest.approx([q[0] + c, q[1] + s, 0], abs=1e-15)
        assert hk.position(ppr).null_space(q)[:, 0] == pytest.approx([s, -c, 1], abs=1e-15)  # (19)


def test_the_planar_3rs_self_motion_is_the_theorys(planar_3r: hk.Robot) -> None:
    """Theory 2a: n = J_1 x J_2 = (s3, -(s23 + s3), s2 + s23) for unit links."""
    task = hk.position(planar_3r)
    for q in np.random.default_rng(3).uniform(-2.5, 2.5, (20, 3)):
        s2, s3, s23 = np.sin(q[1]), np.sin(q[2]), np.sin(q[1] + q[2])
        n = np.array([s3, -(s23 + s3), s2 + s23])
        J = task.jacobian(q)
        assert np.abs(np.cross(J[0], J[1]) - n).max() < 1e-14
        assert np.abs(task.null_space(q)[:, 0] - n).max() < 1e-13
        turns = np.cumsum(q)
        assert task(q) == pytest.approx([np.cos(turns).sum(), np.sin(turns).sum()], abs=1e-14)


def test_the_irb140_turns_as_far_as_the_data_sheet_says(irb140: hk.Robot) -> None:
    assert np.rad2deg(irb140.lower) == pytest.approx([-180, -20, -50, -200, -115, -400])
    assert np.rad2deg(irb140.upper) == pytest.approx([180, 180, 230, 200, 115, 400])
    assert np.rad2deg(irb140.max_velocity) == pytest.approx([200, 200, 260, 360, 360, 450])


def test_the_iiwa14_has_kukas_lengths() -> None:
    robot = hk.load("iiwa14")
    assert robot.pose(np.zeros(7))[:3, 3] == pytest.approx([0, 0, 1.306])
    (line,) = robot.skeleton([0.3, 0.5, -0.4, 1.0, 0.2, 0.8, 0.1])
    shoulder, elbow, wrist = line[2], line[4], line[6]
    assert np.linalg.norm(elbow - shoulder) == pytest.approx(0.42)
    assert np.linalg.norm(wrist - elbow) == pytest.approx(0.40)
    assert line[-1] - wrist == pytest.approx(0.126 * robot.pose([0.3, 0.5, -0.4, 1.0, 0.2, 0.8, 0.1])[:3, 2])


def test_a_planar_robots_tasks_are_planar(planar_3r: hk.Robot) -> None:
    assert hk.position(planar_3r).m == 2
    task = hk.pose(planar_3r)
    assert (task.m, task.row_names) == (3, ("x", "y", "wz"))
    assert task([0.1, 0.2, 0.3])[2] == pytest.approx(0.6)
    with pytest.raises(ArgumentError):
        hk.pose(planar_3r, "zyz")


def test_a_robot_with_one_joint_has_matrices_too() -> None:
    robot = hk.from_dh([{"a": 0.5}])
    assert robot.jacobian([0.1]).shape == (6, 1)
    task = hk.position(robot, rows=[0])
    assert task.jacobian([0.1]).shape == (1, 1)
    assert hk.moore_penrose(task)([0.1]).shape == (1, 1)
    assert hk.involutivity(hk.moore_penrose(task), hk.around([0.5], 0.1)).holonomic


def test_more_rows_than_joints_are_refused() -> None:
    robot = hk.from_dh([{"a": 1.0}, {"a": 1.0, "alpha": 1.0}])
    with pytest.raises(RowsError):
        hk.pose(robot)
    assert hk.pose(robot, rows=[0, 2]).units == ("m", "rad")
    with pytest.raises(RowsError):
        hk.pose(hk.from_dh([{"a": 0.3, "alpha": 1.0}] * 5))


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda r: r.pose([0.0, 0.0]), ShapeError),
        (lambda r: r.joint_index("q4"), UnknownNameError),
        (lambda r: r.jacobian(np.full(3, np.nan)), NotFiniteError),
        (lambda r: r.check_limits([0, 9.0, 0]), JointLimitError),
        (lambda r: r.pose([0, 0, 0], "hand"), UnknownNameError),
        (lambda r: hk.position(r, tip="hand"), UnknownNameError),
        (lambda r: hk.position(r)[2], UnknownNameError),
        (lambda r: hk.position(r)[[0, 0]], ArgumentError),
        (lambda r: hk.pose(hk.load("panda"), "quaternion"), UnknownNameError),
        (lambda r: hk.pose(hk.load("panda"), "rotation-vector", reference=np.ones((3, 3))), ArgumentError),
        (lambda r: hk.load("pandaa"), UnknownNameError),
        (lambda r: hk.load("panda", tip="x"), ArgumentError),
        (lambda r: hk.load("nowhere.toml"), RobotFileError),
        (lambda r: hk.from_dh([{"a": 1.0}], convention="classic"), UnknownNameError),
        (lambda r: hk.from_dh([{"length": 1.0}]), UnknownNameError),
        (lambda r: hk.from_dh([{"a": np.nan}]), NotFiniteError),
        (lambda r: hk.from_dh([{"kind": "spherical"}]), ArgumentError),
        (lambda r: hk.from_dh([]), ArgumentError),
        (lambda r: hk.from_dh([{"lower": 1.0, "upper": -1.0}]), ArgumentError),
        (lambda r: hk.from_dh([{"max_velocity": 0.0}]), ArgumentError),
        (lambda r: hk.from_dh([{"joint": "elbow"}, {"joint": "elbow"}]), ArgumentError),
        (lambda r: hk.from_dh([{"a": 1.0}], tool=np.diag([1.0, 1.0, -1.0, 1.0])), ArgumentError),
        (lambda r: hk.from_dh([{"a": 1.0}], base=np.zeros((4, 4))), ArgumentError),
    ],
)
def test_what_makes_no_sense_is_refused(planar_3r: hk.Robot, call, error: type[Exception]) -> None:
    with pytest.raises(error) as caught:
        call(planar_3r)
    assert "\n" not in str(caught.value)


def test_a_posture_outside_the_limits_is_named_with_joint_and_range(panda: hk.Robot) -> None:
    panda.check_limits(PANDA_START)
    panda.check_limits(panda.lower)
    panda.check_limits(panda.upper)
    panda.check_limits(panda.upper + 1e-10)  # round-off
    for i, name in enumerate(panda.joint_names):
        for bound, beyond in ((panda.lower[i], -1e-6), (panda.upper[i], 1e-6)):
            q = PANDA_START.copy()
            q[i] = bound + beyond
            with pytest.raises(JointLimitError, match=f"joint '{name}' is at") as caught:
                panda.check_limits(q)
            error = caught.value
            assert (error.joint, error.value, error.lower, error.upper) == (name, q[i], panda.lower[i], panda.upper[i])


def test_a_joint_without_limits_ranges_about_zero_and_one_with_one_limit_from_there() -> None:
    rows = [{"a": 1.0}, {"lower": 2.0}, {"upper": -5.0}, {"lower": -3.0}, {"lower": -1.0, "upper": 0.5}]
    lower, upper = hk.from_dh(rows).ranges(1.2)
    assert lower == pytest.approx([-1.2, 2.0, -7.4, -3.0, -1.0])
    assert upper == pytest.approx([1.2, 4.4, -5.0, 1.2, 0.5])


def test_a_posture_is_within_the_limits_where_no_joint_is_beyond_its_own(panda: hk.Robot) -> None:
    outside = np.where(np.eye(7, dtype=bool), panda.upper + 1e-9, panda.lower)
    assert panda.within(PANDA_START) and panda.within([panda.lower, panda.upper]).all()
    assert not panda.within(outside).any()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name = 'x'\nsource = 'y'\nsauce = 1\n[[joints]]\na = 1\n", "unknown key 'sauce'"),
        ("name = 'x'\nsource = 'y'\n", "lacks 'joints'"),
        ("name = 'x'\n[[joints]]\na = 1\n", "lacks 'source'"),
        ("source = 'y'\nconvention = 'odd'\n[[joints]]\na = 1\n", "odd"),
        ("source = 'y'\n[[joints]]\nlength = 1\n", "unknown key 'length'"),
        ("source = 'y'\n[[joints]]\na = 'one'\n", "one"),
        ("source = 'y'\n[[joints]]\na = nan\n", "NaN"),
        ("source = [", "not TOML"),
        ("source = 'y'\njoints = [1]\n", "table"),
        ("source = 'y'\n[joints]\na = 1\n", "lacks 'joints'"),
        ("source = 'y'\njoints = []\n", "number of moving joints"),
        ("source = 'y'\n[[joints]]\nkind = 'helical'\n", "'helical'"),
        ("source = 'y'\n[[joints]]\na = 1\n[[joints]]\na = [1]\n", "joint 2"),
        ("source = 'y'\n[[joints]]\nlower = nan\n", "range"),
        ("source = 'y'\n[[joints]]\nlower = 2\nupper = 1\n", "range"),
        ("source = 'y'\n[[joints]]\nmax_velocity = -1\n", "speed limit"),
        ("source = 'y'\n[[joints]]\ndegrees = 'no'\n", "degrees must be true or false"),
        ("source = 'y'\n[[joints]]\njoint = 'j'\n[[joints]]\njoint = 'j'\n", "'j'"),
        ("source = 'y'\nbase = 3\n[[joints]]\na = 1\n", "table"),
        ("source = 'y'\n[base]\nrpy_deg = ['a', 0, 0]\n[[joints]]\na = 1\n", "three numbers"),
        ("source = 'y'\n[tool]\nxyz = [nan, 0, 0]\n[[joints]]\na = 1\n", "tool"),
        ("source = 'y'\n[tool]\npose = 1\n[[joints]]\na = 1\n", "tool: unknown key 'pose'"),
        ("source = '\xe9'\n[[joints]]\na = 1\n", "cannot be read"),
        ("source = 'y'\n[base]\nxyz = [1, 2]\n[[joints]]\na = 1\n", "xyz"),
    ],
)
def test_a_malformed_robot_file_is_named_with_its_fault(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text, "latin-1")
    with pytest.raises(RobotFileError, match=said) as caught:
        hk.load(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)


def test_a_robot_of_ones_own_is_a_file(tmp_path: Path) -> None:
    """A frame of the file is Rz(yaw) Ry(pitch) Rx(roll) in degrees, limits in degrees only where it says so."""
    file = tmp_path / "mine.toml"
    file.write_text(
        "source = 'y'\nconvention = 'modified'\ntip = 'pen'\n[base]\nxyz = [1, 2, 3]\nrpy_deg = [10, 20, 30]\n"
        "[[joints]]\na = 0.5\nalpha_deg = 90\ntheta_deg = 30\nlower = -90\nupper = 90\ndegrees = true\n"
        "[[joints]]\nkind = 'prismatic'\nd = 0.2\nlower = -1\nupper = 2\ndegrees = true\nmax_velocity = 3\n"
    )
    robot = hk.load(file)
    assert (robot.name, robot.tips[0].name, robot.joint_names) == ("mine", "pen", ("q1", "q2"))
    assert robot.lower.tolist() == [-np.pi / 2, -1.0]
    assert robot.upper.tolist() == [np.pi / 2, 2.0]
    assert robot.max_velocity.tolist() == [np.inf, 3.0]
    base = np.eye(4)
    base[:3, :3] = Rotation.from_euler("xyz", [10, 20, 30], degrees=True).as_matrix()
    base[:3, 3] = [1, 2, 3]
    expected = base @ Rx(np.pi / 2) @ T(0.5, 0) @ Rz(np.deg2rad(30) + 0.4) @ T(0, 0.2 + 0.7)
    assert np.abs(robot.pose([0.4, 0.7]) - expected).max() < 1e-15


def test_a_single_joint_can_follow_a_path() -> None:
    robot = hk.from_dh([{"a": 0.5}])
    strategy = hk.moore_penrose(hk.position(robot, rows=[1]))
    start = robot.pose([0.1])[:3, 3]
    walk = hk.follow(strategy, hk.line(start, [start[0], 0.4, 0.0]), [0.1], samples=200)
    assert 0.5 * np.sin(walk.q[-1, 0]) == pytest.approx(0.4, abs=1e-9)


# --- A robot in millimetres or degrees: every reader has the same verdict, and brings it where it is overruled.


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


def test_a_job_is_taken_where_a_robot_is_and_a_base_where_a_tip_is(holokin: Command, tmp_path: Path) -> None:
    """A command judges a log by the robot of a job as by that robot, and by a chain between two links of a model."""
    arm = hk.from_dh([{"a": 0.4, "lower": -3.0, "upper": 3.0}] * 4)
    (tmp_path / "arm.urdf").write_text(hk.robot.to_urdf(arm))
    job = write_job(tmp_path, robot='[robot]\nname = "arm.urdf"\n')
    log = tmp_path / "log.csv"
    log.write_text("time,q1,q2,q3,q4\n" + "".join(f"{0.1 * i},0,{0.1 * i},0.5,{2.5 + 0.1 * i}\n" for i in range(9)))
    links = [link for link in hk.robot.model_links(tmp_path / "arm.urdf") if link != "tool"]
    for command in ("check", "audit"):
        said = [holokin(command, log, "--robot", name, "--position") for name in (tmp_path / "arm.urdf", job)]
        assert said[0].code == said[1].code and said[0].out == said[1].out
        assert said[1].code == 2 or "joint limit: q4" in said[1].out  # one cycle is not enough for an audit
        assert_refused(holokin(command, log, "--robot", job, "--position", "--base", links[0]), "a job says it itself")
    whole, short = (holokin("robots", tmp_path / "arm.urdf", "--base", link).out for link in links[:2])
    assert "4 moving joints: q1, q2, q3, q4" in whole and "3 moving joints: q2, q3, q4" in short
    assert_refused(holokin("robots", "--base", links[1]), "give the file of a model")
    assert_refused(holokin("check", log, "--robot", "panda", "--base", "hand"), "only models")
    assert_refused(holokin("check", log, "--robot", job, "--position", "--tip", "nose"), "--tip beside a job")


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


# --- Mass matrices and gravity, against Pinocchio.


ARMS = [
    ("panda.urdf", "panda_hand_tcp"),
    ("xarm7.urdf", None),
    ("talos_left_arm.urdf", None),
    ("tiago.urdf", "wrist_ft_tool_link"),
    ("baxter.urdf", "left_gripper"),
]


def reduced(path, robot: hk.Robot) -> pin.Model:
    """Pinocchio's model with every other joint held at zero."""
    model = pin.buildModelFromUrdf(str(path))
    others = [i for i, name in enumerate(model.names) if name != "universe" and name not in robot.joint_names]
    return pin.buildReducedModel(model, others, pin.neutral(model))


@sampled(2, ("name", "tip"), ARMS)
def test_the_mass_matrix_and_the_potential_are_pinocchios(name: str, tip: str | None) -> None:
    path = urdf(name)
    chains = hk.robot.model_tips(path)
    tip = tip or max(chains, key=lambda link: len(chains[link]))
    robot = hk.from_urdf(path, tip=tip)
    model = reduced(path, robot)
    data = model.createData()
    s = symbol("q", robot.n)
    mass_matrix = Function("M", {"q": s}, {"M": mass_matrix_expression(robot, s)})
    potential = Function("U", {"q": s}, {"U": potential_expression(robot, s, np.array([0, 0, -9.81]))})
    offsets = []
    for seed in range(3):
        q = np.random.default_rng(seed).uniform(-1, 1, robot.n)
        posture, order = pin.neutral(model), []
        for i, joint in enumerate(robot.joint_names):
            theirs = model.joints[model.getJointId(joint)]
            posture[theirs.idx_q : theirs.idx_q + theirs.nq] = (
                [q[i]] if theirs.nq == 1 else [np.cos(q[i]), np.sin(q[i])]
            )
            order.append(theirs.idx_v)
        M = pin.crba(model, data, posture)
        M = np.triu(M) + np.triu(M, 1).T
        assert np.abs(mass_matrix(q) - M[np.ix_(order, order)]).max() < 1e-12 * np.abs(M).max()
        offsets.append(potential(q) - pin.computePotentialEnergy(model, data, posture))
    assert np.ptp(offsets) < 1e-10  # the base's own weight is a constant


def test_a_table_of_lengths_has_no_masses(irb140: hk.Robot) -> None:
    with pytest.raises(RobotFileError, match="has no masses"):
        mass_matrix_expression(irb140, symbol("q", 6))
