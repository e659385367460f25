"""Robots: DH tables against the textbook product, Jacobians against differences, the catalogue against its sources."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, urdf
from holokin.errors import (
    ArgumentError,
    JointLimitError,
    NotFiniteError,
    RobotFileError,
    ShapeError,
    TaskTooLargeError,
    UnknownNameError,
)

NAMES = tuple(hk.catalogue())


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


@settings(max_examples=60, deadline=None)
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
    for figure in (robot.lower, robot.upper, robot.max_velocity):
        assert np.isfinite(figure).all()
    q = (robot.lower + robot.upper) / 2
    (line,) = robot.skeleton(q)
    assert line.shape == (robot.n + 2, 3)
    assert line[-1] == pytest.approx(robot.pose(q)[:3, 3])
    assert robot.planar is (name in ("ppr", "planar-3r"))


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
    with pytest.raises(TaskTooLargeError, match=r"m = 3.*n = 2.*rows="):
        hk.pose(robot)
    assert hk.pose(robot, rows=[0, 2]).units == ("m", "rad")
    with pytest.raises(TaskTooLargeError, match=r"m = 6.*n = 5"):
        hk.pose(hk.from_dh([{"a": 0.3, "alpha": 1.0}] * 5))


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda r: r.pose([0.0, 0.0]), ShapeError),
        (lambda r: r.pose([0, 0, np.inf]), NotFiniteError),
        (lambda r: r.jacobian(np.full(3, np.nan)), NotFiniteError),
        (lambda r: r.check_limits([0, 9.0, 0]), JointLimitError),
        (lambda r: r.pose([0, 0, 0], "hand"), UnknownNameError),
        (lambda r: hk.position(r, tip="hand"), UnknownNameError),
        (lambda r: hk.position(r)[2], UnknownNameError),
        (lambda r: hk.position(r)[[0, 0]], ArgumentError),
        (lambda r: hk.position(r)[[]], ArgumentError),
        (lambda r: hk.pose(hk.load("panda"), "quaternion"), UnknownNameError),
        (lambda r: hk.pose(hk.load("panda"), "rotation-vector", reference=np.ones((3, 3))), ArgumentError),
        (lambda r: hk.load("pandaa"), UnknownNameError),
        (lambda r: hk.load("robot.xml"), RobotFileError),
        (lambda r: hk.load("panda", tip="x"), ArgumentError),
        (lambda r: hk.load("nowhere.toml"), RobotFileError),
        (lambda r: hk.from_dh([{"a": 1.0}], convention="classic"), UnknownNameError),
        (lambda r: hk.from_dh([{"length": 1.0}]), UnknownNameError),
        (lambda r: hk.from_dh([{"a": np.nan}]), NotFiniteError),
        (lambda r: hk.from_dh([{"kind": "spherical"}]), ArgumentError),
        (lambda r: hk.from_dh([]), ArgumentError),
        (lambda r: hk.from_dh([{"a": 1.0}], base=np.zeros((4, 4))), ArgumentError),
    ],
)
def test_what_makes_no_sense_is_refused(planar_3r: hk.Robot, call, error: type[Exception]) -> None:
    with pytest.raises(error):
        call(planar_3r)


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
        ("source = 'y'\n[base]\nxyz = [1, 2]\n[[joints]]\na = 1\n", "xyz"),
    ],
)
def test_a_malformed_robot_file_is_named_with_its_fault(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(hk.HolokinError, match=said) as caught:
        hk.load(file)
    assert "mine.toml" in str(caught.value) or said == "odd"


def test_a_single_joint_can_follow_a_path() -> None:
    robot = hk.from_dh([{"a": 0.5}])
    strategy = hk.moore_penrose(hk.position(robot, rows=[1]))
    start = robot.pose([0.1])[:3, 3]
    walk = hk.follow(strategy, hk.line(start, [start[0], 0.4, 0.0]), [0.1], samples=200)
    assert 0.5 * np.sin(walk.q[-1, 0]) == pytest.approx(0.4, abs=1e-9)
