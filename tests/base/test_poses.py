"""Poses of other libraries and quaternions, wherever a pose is given: mink, Pinocchio, SciPy and MuJoCo as referees."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, R3_START, Command, assert_refused, urdf, write_job
from holokin.app.job.advice_job import _workspace_keys, question
from holokin.app.job.strategy_tables import Fitted
from holokin.base.errors import (
    ArgumentError,
    BranchError,
    FileError,
    HolokinError,
    JointLimitError,
    NotFiniteError,
    OutOfReachError,
    ShapeError,
    StartError,
)
from holokin.motion.ik import InverseStatus
from holokin.path.workspaces import PoseRange, pose_cloud
from holokin.robot import DHRow, doubtful_unit
from holokin.robot.chains import longest_reach
from holokin.strategies import HolonomicStrategy
from public_nouns import public_classes, rooms

mink = pytest.importorskip("mink")
mujoco = pytest.importorskip("mujoco")

PANDA = hk.load("panda")
TASK = hk.pose(PANDA)
LAW = hk.holonomic(TASK, hk.linear([1, 0, -1, 0, 0, 0, 0]))
IK = hk.ik(LAW, PANDA_START)
STEP = hk.controller(LAW, dt=0.002, q0=PANDA_START).step
GOAL = PANDA.pose(PANDA_START + 0.02)

PLACES: dict[str, Callable[[Any], Any]] = {
    "ik": IK,
    "ik.near": lambda pose: IK.near(pose, PANDA_START),
    "ik.nearest": lambda pose: IK.nearest(pose).q,
    "ik.batch": lambda pose: IK.batch([pose, pose]).q,
    "ik at a level": lambda pose: IK(pose, level=0.0),
    "all_postures": lambda pose: hk.motion.ik.all_postures(LAW, pose, -0.1, near=PANDA_START).q,
    "controller.step": lambda pose: STEP(PANDA_START, pose, np.zeros(6)),
    "task.target": lambda pose: TASK.target(pose)[1],
    "spline": lambda pose: hk.spline([PANDA.pose(PANDA_START), pose]).at([0.1]).rotation,
    "polyline": lambda pose: hk.path.polyline([PANDA.pose(PANDA_START), pose]).at([0.1]).rotation,
    "path_of poses": lambda pose: hk.path.path_of([PANDA.pose(PANDA_START), pose], [0.0, 1.0]).at([0.5]).rotation,
    "path_of a function": lambda pose: hk.path.path_of(lambda _: pose, [0.0, 1.0]).at([0.5]).rotation,
    "in_frame": lambda pose: hk.line([0, 0, 0], [0.1, 0, 0]).in_frame(pose).end,
    "workspace": lambda pose: hk.path.workspaces.pose_cloud([pose]).poses(1),
    "from_dh": lambda pose: hk.from_dh([DHRow(a=0.5)], tool=pose).pose([0.1]),
}
"""Where a pose of a task of one frame is given."""


def wxyz(T: np.ndarray) -> np.ndarray:
    """MuJoCo's quaternion of a pose."""
    four = np.zeros(4)
    mujoco.mju_mat2Quat(four, T[:3, :3].ravel())
    return four


def pinocchio_pose(T: np.ndarray) -> Any:
    return pytest.importorskip("pinocchio").SE3(T)


MADE: dict[str, Callable[[np.ndarray], Any]] = {
    "mink": mink.SE3.from_matrix,
    "pinocchio": pinocchio_pose,
    "rows": lambda T: T.tolist(),
    "MuJoCo's quaternion": lambda T: hk.pose_of(T[:3, 3], wxyz(T), order="wxyz"),
    "SciPy's quaternion": lambda T: hk.pose_of(T[:3, 3], Rotation.from_matrix(T[:3, :3]).as_quat(), order="xyzw"),
}


@pytest.mark.parametrize("place", PLACES)
def test_a_pose_of_any_library_is_that_pose_wherever_one_is_given(place: str) -> None:
    wanted = PLACES[place](GOAL)
    for name, made in MADE.items():
        assert np.abs(np.asarray(PLACES[place](made(GOAL))) - wanted).max() < 1e-9, name


@pytest.mark.parametrize("place", PLACES)
def test_seven_numbers_are_refused_with_the_cure_wherever_a_pose_is_given(place: str) -> None:
    four = wxyz(GOAL)
    for bare in (np.r_[GOAL[:3, 3], four], [*GOAL[:3, 3], *four], (GOAL[:3, 3], four), [GOAL[:3, 3].tolist(), [*four]]):
        with pytest.raises(HolokinError, match=r'hk\.pose_of\(position, quaternion, order="wxyz"\)'):
            PLACES[place](bare)


def test_seven_joints_that_are_too_many_are_no_pose() -> None:
    """Seven numbers are spoken of as a pose where a pose stands, and nowhere else."""
    step = hk.controller(hk.moore_penrose(hk.pose(hk.load("ur5e"))), dt=0.01).step
    for arguments in ((np.zeros(7), GOAL, np.zeros(6)), (np.zeros(6), GOAL, np.zeros(7))):
        with pytest.raises(ShapeError) as told:
            step(*arguments)
        assert "pose_of" not in str(told.value)


def test_poses_of_two_hands_may_be_of_another_library() -> None:
    yumi = hk.load("yumi")
    q = np.full(yumi.n, 0.3)
    task = hk.stacked(*(hk.pose(yumi, tip=tip.name) for tip in yumi.tips))
    poses = task.pose(q)
    law = hk.moore_penrose(task)
    step = hk.controller(law, dt=0.01).step
    hands = [mink.SE3.from_matrix(T) for T in task.pose(q + 1e-3)]
    assert np.abs(step(q, hands, np.zeros((2, 6))) - step(q, task.pose(q + 1e-3), np.zeros((2, 6)))).max() < 1e-9
    assert np.abs(task.target(hands)[0] - task.target(poses)[0]).max() < 0.02


def test_many_poses_of_another_library_are_a_batch() -> None:
    poses = [PANDA.pose(PANDA_START + 0.01 * i) for i in range(4)]
    wanted = IK.batch(np.array(poses)).q
    assert np.abs(IK.batch([mink.SE3.from_matrix(T) for T in poses]).q - wanted).max() < 1e-9
    p, four = np.array([T[:3, 3] for T in poses]), np.array([wxyz(T) for T in poses])
    assert np.abs(IK.batch(hk.pose_of(p, four, order="wxyz")).q - wanted).max() < 1e-9
    assert hk.pose_of(p, -four, order="wxyz") == pytest.approx(np.array(poses), abs=1e-12)  # the same rotations


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_a_pose_of_a_quaternion_is_scipys_rotation(order: str) -> None:
    rng = np.random.default_rng(3)
    four = rng.normal(size=(50, 4))
    four /= np.linalg.norm(four, axis=1, keepdims=True)
    p = rng.normal(size=(50, 3))
    T = hk.pose_of(p, four, order=order)
    last = four if order == "xyzw" else four[:, [1, 2, 3, 0]]
    assert np.abs(T[:, :3, :3] - Rotation.from_quat(last).as_matrix()).max() < 1e-14
    assert np.array_equal(T[:, :3, 3], p)
    assert (T[:, 3] == [0, 0, 0, 1]).all()
    assert np.array_equal(T[7], hk.pose_of(p[7], four[7], order=order))


def test_the_other_order_is_another_rotation_that_nothing_else_tells() -> None:
    """Both are right-handed rotations: only the name of the order says which is meant."""
    four = wxyz(GOAL)
    one, other = (hk.pose_of(GOAL[:3, 3], four, order=order) for order in ("wxyz", "xyzw"))
    for T in (one, other):
        assert np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() < 1e-12
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1)
    assert np.abs(one - other).max() > 0.1


def test_rounded_quaternions_are_made_unit_and_other_lengths_refused() -> None:
    four = wxyz(GOAL)
    R = hk.pose_of([0, 0, 0], four.round(4), order="wxyz")[:3, :3]
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-14
    assert np.abs(R - GOAL[:3, :3]).max() < 2e-4
    for wrong in (np.zeros(4), 1.1 * four, [1.0, 1.0, 1.0, 1.0], [180.0, 0, 0, 1]):
        with pytest.raises(ArgumentError, match="its length is"):
            hk.pose_of([0, 0, 0], wrong, order="wxyz")
    with pytest.raises(ArgumentError, match="its length is 0:"):
        hk.pose_of(np.zeros((2, 3)), [four, np.zeros(4)], order="wxyz")


def test_bad_positions_quaternions_and_orders_are_refused() -> None:
    four = wxyz(GOAL)
    for order in ("", "WXYZ", "xyz", "wxzy", None, 4, ["wxyz"]):
        with pytest.raises(ArgumentError, match="order"):
            hk.pose_of([0, 0, 0], four, order=order)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="say where the scalar w stands"):  # no default
        hk.pose_of([0, 0, 0], four)
    for p, q in (([0, 0], four), ([0, 0, 0], four[:3]), (np.zeros((2, 3)), four), ([0, 0, 0], [four]), (0.0, four),
                 (np.zeros((1, 1, 3)), np.zeros((1, 1, 4)))):  # fmt: skip
        with pytest.raises(ShapeError):
            hk.pose_of(p, q, order="wxyz")
    with pytest.raises(NotFiniteError):
        hk.pose_of([0, 0, np.nan], four, order="wxyz")
    with pytest.raises(NotFiniteError):
        hk.pose_of([0, 0, 0], [np.nan, 0, 0, 1], order="wxyz")


class Other:
    """A thing with the names of a pose, and other numbers in it."""

    def __init__(self, matrix: Any) -> None:
        self.homogeneous = matrix


@pytest.mark.parametrize(
    "wrong",
    [mink.SO3.identity(), Rotation.identity(), mink.SE3, Other("text"), Other(None), Other(np.zeros((4, 4))),
     Other(np.full((4, 4), np.nan)), Other(np.diag([1.0, 1, -1, 1])), Other(Other(np.eye(4)))],
    ids=lambda wrong: type(wrong).__name__,
)  # fmt: skip
def test_what_is_no_pose_is_refused_as_arrays_are(wrong: Any) -> None:
    for place in ("ik", "ik.near", "all_postures", "spline", "in_frame", "workspace", "from_dh"):
        with pytest.raises(HolokinError):
            PLACES[place](wrong)


@pytest.mark.parametrize("seed", range(6))
def test_a_rotation_needs_no_order_and_a_pair_is_told_how_to_become_a_pose(seed: int) -> None:
    draw = np.random.default_rng(seed)
    turns = Rotation.random(3, random_state=seed)
    points = draw.normal(size=(3, 3))
    poses = hk.pose_of(points, turns.as_quat(), order="xyzw")
    assert np.abs(hk.pose_of(points, turns) - poses).max() < 1e-15
    assert np.abs(hk.pose_of(points, turns.as_matrix()) - poses).max() < 1e-15
    assert np.abs(hk.pose_of(points[0], turns[0].as_matrix().tolist()) - poses[0]).max() < 1e-15
    with pytest.raises(ArgumentError, match="left-handed"):
        hk.pose_of(points, -turns.as_matrix())
    ik = hk.ik(hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2)), PANDA_START)
    for one in (turns[0], turns[0].as_matrix(), turns[0].as_matrix().tolist()):
        for pair in ((points[0], one), [points[0].tolist(), one]):
            with pytest.raises(ArgumentError, match=r"give hk.pose_of\(position, rotation\)"):
                ik(pair)  # type: ignore[arg-type]


def test_a_pose_of_spatialmath_is_its_matrix() -> None:
    """Which it has as `A`."""
    T = hk.load("panda").pose(PANDA_START)
    ik = hk.ik(hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2)), PANDA_START)
    assert np.array_equal(ik(SimpleNamespace(A=T)), ik(T))  # type: ignore[arg-type]


# --- Postures in degrees, poses in millimetres, steps in milliseconds, q that is no answer: said, and with the cure.


BETWEEN = np.array([0.3, 0.9, 0.0])


@pytest.fixture
def two_links(monkeypatch: pytest.MonkeyPatch, planar_3r: hk.Robot) -> hk.motion.ik.InverseKinematics:
    """Two links in a plane, joint 1 from 0 to 2 rad, whose third joint is locked."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    first, *others = planar_3r.coordinates
    robot = replace(planar_3r, coordinates=(replace(first, lower=0.0, upper=2.0), *others))
    return hk.ik(hk.holonomic(hk.position(robot), hk.lock(2)), BETWEEN)


def test_a_posture_that_is_not_finite_is_told_by_its_joints(two_links) -> None:
    with pytest.raises(NotFiniteError, match="the posture to begin from: NaN or infinite numbers, q1 nan, q3 -inf;"):
        two_links.nearest([1.0, 1.0], [np.nan, 0.2, -np.inf])


def test_a_step_limits_the_motion_from_a_posture_and_without_one_it_is_refused(two_links) -> None:
    with pytest.raises(ArgumentError, match="step limits the motion from the last answer"):
        two_links.nearest([1.0, 1.0], step=0.01)


# --- degrees --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "begin",
    [hk.ik, hk.motion.ik.move_to_leaf, lambda G, q: hk.radial(G, q), lambda G, q: hk.controller(G, dt=0.001, q0=q)],
)
def test_a_start_in_degrees_is_refused_where_limits_are_not_looked_at(
    panda: hk.Robot, begin: Callable[[hk.Strategy, np.ndarray], object]
) -> None:
    G = hk.holonomic(hk.pose(panda), hk.lock(2))
    with pytest.raises(JointLimitError, match=r"'panda_joint4' is at -114.592 rad, 112 rad outside"):
        begin(G, np.degrees(PANDA_START))


def test_a_start_beyond_its_limits_or_wound_by_a_turn_is_one_to_begin_from(panda: hk.Robot) -> None:
    """The same tool pose: a simulation without limits gets there."""
    G = hk.holonomic(hk.pose(panda), hk.lock(2))
    wound = PANDA_START + 2 * np.pi * np.eye(7)[0]
    assert hk.ik(G, wound, limits=False)(panda.pose(PANDA_START)) == pytest.approx(wound, abs=1e-9)


def test_joints_without_limits_may_have_wound_up_as_far_as_they_like(planar_3r: hk.Robot) -> None:
    free = replace(planar_3r, coordinates=tuple(hk.robot.Coordinate(f"q{i}", "revolute") for i in (1, 2, 3)))
    G = hk.holonomic(hk.position(free), hk.lock(2))
    assert hk.ik(G, np.degrees(R3_START)).q0 == pytest.approx(np.degrees(R3_START))


# --- millimetres ----------------------------------------------------------------------------------------------


def test_no_posture_brings_the_tool_beyond_the_longest_reach() -> None:
    """Of hinges, of a slide that carries an arm, and of one tip of several."""
    for robot in (hk.load("panda"), hk.load("ppr"), hk.from_urdf(urdf("tiago.urdf"), tip="arm_7_link")):
        low, high = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
        places = robot.pose_batch(np.random.default_rng(0).uniform(low, high, (500, robot.n)))[0]
        reached, most = np.linalg.norm(places, axis=1).max(), longest_reach(robot)
        assert reached <= most < 4 * reached


def test_millimetres_are_told_from_what_is_only_out_of_reach(panda: hk.Robot) -> None:
    G, pose = hk.holonomic(hk.pose(panda), hk.lock(2)), panda.pose(PANDA_START)
    box = [400.0, 100.0, 300.0], [50.0, 50.0, 50.0]
    with pytest.raises(ArgumentError, match=r"at least 4\d\d.* m from the base, where panda reaches"):
        hk.coverage(G, hk.workspace(box=box), PANDA_START, samples=16)
    for distance, said in ((300.0, "give metres"), (3.0, "nearer to the base")):
        far = pose.copy()
        far[:3, 3] *= distance / np.linalg.norm(far[:3, 3])
        with pytest.raises(OutOfReachError, match=said):
            hk.ik(G, PANDA_START)(far)
    too_near = pose.copy()  # within the base, where "nearer" is no cure
    too_near[:3, 3] = [0.02, 0.0, 0.1]
    with pytest.raises(OutOfReachError, match="nearer or farther away"):
        hk.ik(G, PANDA_START)(too_near)
    round_trip = hk.circle(1000 * pose[:3, 3], 1000 * pose[:3, 3] - [100, 0, 0])
    with pytest.raises(StartError, match="give metres"):
        hk.follow(G, round_trip, PANDA_START)


def test_an_arm_on_a_slide_without_end_reaches_everywhere(ppr: hk.Robot) -> None:
    endless = replace(ppr, coordinates=(hk.robot.Coordinate("q1", "prismatic"), *ppr.coordinates[1:]))
    assert doubtful_unit(endless, np.array([[1e6, 0.0, 0.0]])) == ""
    assert "give metres" in doubtful_unit(ppr, np.array([[1e6, 0.0, 0.0]]))


# --- other units ----------------------------------------------------------------------------------------------


def test_a_step_in_which_a_joint_moves_far_is_warned_of_and_taken(
    panda: hk.Robot, caplog: pytest.LogCaptureFixture
) -> None:
    G = hk.moore_penrose(hk.pose(panda))
    with caplog.at_level(logging.WARNING, "holokin"):
        hk.controller(G, dt=0.1)
        assert not caplog.records
        assert hk.controller(G, dt=1.0).dt == 1.0
    assert "at its full speed panda_joint5 moves by 2.6 rad in it; dt is in seconds" in caplog.text


def test_degrees_are_only_of_angles(tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    for header, row in (
        ("x,y,z,qx,qy,qz,qw", "0.5,0,0.3,1,0,0,0"),
        (",".join(f"T{i}{j}" for i in range(3) for j in range(4)), "1,0,0,0,0,1,0,0,0,0,1,0"),
    ):
        file.write_text(f"{header}\n{row}\n")
        with pytest.raises(FileError, match="has no angles; leave out angles="):
            hk.path.read_workspace(file, angles="deg")
        assert len(hk.path.read_workspace(file).given) == 1


def test_an_angle_beyond_a_turn_is_believed_where_somebody_says_radians(tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    file.write_text("x,y,z,roll,pitch,yaw\n0.5,0,0.3,0,0,7\n")
    with pytest.raises(FileError, match="it looks like degrees"):
        hk.path.read_workspace(file)
    assert hk.path.read_workspace(file, angles="rad").given[0, 0, 0] == pytest.approx(np.cos(7))


def test_both_readers_of_poses_know_the_same_columns(tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    turned = Rotation.from_rotvec([[0.1, 0.2, 0.3], [0.3, 0.2, 0.1]])
    rows = {
        "x [m],y [m],z [m],qx,qy,qz,qw": np.hstack([[[0.5, 0, 0.3], [0.5, 0.1, 0.3]], turned.as_quat()]),
        "x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg": np.hstack(
            [[[500, 0, 300], [500, 100, 300]], np.rad2deg(turned.as_rotvec())]
        ),
        ",".join(f"T{i}{j}" + "_m" * (j == 3) for i in range(3) for j in range(4)): np.concatenate(
            [turned.as_matrix(), [[[0.5], [0], [0.3]], [[0.5], [0.1], [0.3]]]], axis=2
        ).reshape(2, 12),
    }
    for header, table in rows.items():
        file.write_text("\n".join([header, *(",".join(f"{v:.17g}" for v in row) for row in table)]))
        cloud, waypoints = hk.path.read_workspace(file), hk.read_paths(file).paths[0]
        assert waypoints.rotations is not None
        assert np.abs(cloud.given[:, :3, 3] - [[0.5, 0, 0.3], [0.5, 0.1, 0.3]]).max() < 1e-15
        assert np.array_equal(cloud.given[:, :3, 3], waypoints.points)
        assert np.abs(waypoints.rotations - turned.as_matrix()).max() < 1e-14
        assert np.array_equal(cloud.given[:, :3, :3], waypoints.rotations)


def test_coverage_says_which_poses_of_a_cloud_it_looked_at(panda: hk.Robot) -> None:
    G = hk.holonomic(hk.pose(panda), hk.lock(2))
    cloud = pose_cloud(np.tile(panda.pose(PANDA_START), (5, 1, 1)))
    for samples, said in ((100, "5 of 5 poses (100.0%), all of the cloud,"), (3, "3 of 3 poses (100.0%), drawn")):
        assert said in hk.coverage(G, cloud, PANDA_START, samples=samples, explain=False).sentence


def test_a_rounded_rotation_is_refused_with_the_cure_and_the_cure_helps(panda: hk.Robot) -> None:
    ik, pose = hk.ik(hk.holonomic(hk.pose(panda), hk.lock(2)), PANDA_START), panda.pose(PANDA_START)
    pose[:3, :3] = pose[:3, :3].round(4)
    with pytest.raises(ArgumentError, match="away from 1"):
        ik(pose)
    pose[:3, :3] = Rotation.from_matrix(pose[:3, :3]).as_matrix()
    assert ik(pose) == pytest.approx(PANDA_START, abs=1e-3)
    pose[:3, :3] *= 2
    with pytest.raises(ArgumentError, match=r"give a right-handed rotation matrix$"):
        ik(pose)


@pytest.mark.parametrize("degrees", [15.0, 40.0, 7.3])
def test_the_degrees_of_an_advised_job_are_those_that_were_typed(degrees: float) -> None:
    space = question("panda", box="0.5 0 0.3 0.2 0.2 0.2", tilt=degrees).workspace
    assert isinstance(space, PoseRange)
    keys = _workspace_keys(space)
    assert keys["tilt_deg"] == degrees
    assert np.degrees(np.radians(15.0)) != 15.0


# --- what a job says is said in its own words -----------------------------------------------------------------


def test_a_job_that_fits_a_law_without_leaves_is_told_which_kinds_have_them(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    laws = '[strategies.mp]\nkind = "moore-penrose"\n[strategies.f]\nkind = "fitted"\nof = "mp"\n'
    outcome = holokin("run", write_job(tmp_path, strategies=laws), "--out", out)
    assert_refused(outcome, "[strategies.f] of is 'mp'", 'name one that has, as of kind = "lock", "arm-angle"')
    assert "hk." not in outcome.err and "Strategy(" not in outcome.err


def test_a_law_that_is_singular_in_the_ball_it_is_fitted_in_asks_for_a_smaller_one(planar_3r: hk.Robot) -> None:
    law = hk.radial(hk.moore_penrose(hk.position(planar_3r)), R3_START)
    with pytest.raises(BranchError, match=r"'r' is singular within 1.5 m of the start: at q1"):
        Fitted(kind="fitted", of="r", radius=1.5).fit(law, R3_START, "f")


# --- tables of links, and tools ---

SCARA = [{"a": 0.4, "lower": -2.9, "upper": 2.9}, {"a": 0.3, "alpha": np.pi, "lower": -2.5, "upper": 2.5}]


@pytest.mark.parametrize("seed", range(5))
def test_a_dh_table_in_degrees_or_millimetres_is_refused_and_the_same_in_si_is_read(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 8))
    rows = [
        {
            "a": rng.uniform(0.02, 0.8), "d": rng.uniform(-0.5, 0.5), "alpha": rng.choice([-1, 0, 1]) * np.pi / 2,
            "theta": rng.uniform(-np.pi, np.pi), "lower": -rng.uniform(1, 3), "upper": rng.uniform(1, 3),
        }
        for _ in range(n)
    ]  # fmt: skip
    assert hk.from_dh(rows).n == n
    for keys, words in ((("alpha",), "degrees"), (("theta",), "degrees"), (("lower", "upper"), "degrees")):
        spoilt = [row | {key: float(np.rad2deg(row[key])) for key in keys} for row in rows]
        if any(abs(row[key]) > 7 for row in spoilt for key in keys):
            with pytest.raises(ArgumentError, match=words):
                hk.from_dh(spoilt)
    with pytest.raises(ArgumentError, match="millimetres"):
        hk.from_dh([row | {"a": 1e3 * row["a"], "d": 1e3 * row["d"]} for row in rows])


def test_one_hinge_of_many_turns_is_no_doubt() -> None:
    spindle = {"lower": -500.0, "upper": 500.0}
    assert hk.from_dh([*SCARA, spindle]).upper[-1] == 500
    assert hk.from_dh([spindle]).n == 1
    assert hk.from_dh([{"a": 1.0}, {"a": 1.0}]).n == 2  # without limits
    assert hk.from_dh([*SCARA, {"kind": "prismatic", "lower": -30.0, "upper": 30.0}]).n == 3


@pytest.mark.parametrize("name", ["panda", "ur5e", "irb140", "rail", "planar-3r", "yumi-arm", "ppr"])
def test_a_tool_in_millimetres_or_degrees_is_refused(name: str) -> None:
    robot = hk.load(name)
    assert hk.with_tool(robot, [0, 0, 0.15], [0, np.pi / 2, -np.pi]).n == robot.n
    with pytest.raises(ArgumentError, match=r"xyz of a tool .*looks like millimetres"):
        hk.with_tool(robot, [0, 0, 150])
    for turned in (lambda rpy: hk.with_tool(robot, rpy=rpy), lambda rpy: hk.with_base_pose(robot, rpy=rpy)):
        with pytest.raises(ArgumentError, match=r"rpy of a .*looks like degrees"):
            turned([0, 90, 0])
    with pytest.raises(ArgumentError, match="looks like degrees"):
        hk.robot.Part(robot, rpy=[0, 0, 180])


def test_a_wrist_of_no_reach_carries_a_tool() -> None:
    assert hk.with_tool(hk.from_dh([{"alpha": 1.5}, {"alpha": -1.5}, {}]), [0, 0, 0.4]).n == 3


def test_a_level_in_degrees_is_told(panda: hk.Robot) -> None:
    """30 rad of an arm angle are 279 degrees, and of a locked joint four turns."""
    q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    angle, joint = hk.holonomic(hk.pose(panda), hk.arm_angle()), hk.holonomic(hk.pose(panda), hk.lock(6))
    for law, level in ((angle, 30), (angle, -95.0), (joint, 30), (joint, -60.0)):
        with pytest.raises(ArgumentError, match="in rad"):
            hk.motion.ik.move_to_leaf(law, q0, level)
    with pytest.raises(ArgumentError, match=r"30 degrees are 0\.5236"):
        hk.motion.ik.all_postures(angle, panda.pose(q0), 30)
    assert angle.g(hk.motion.ik.move_to_leaf(angle, q0, angle.g(q0) + 0.1)) == pytest.approx(
        angle.g(q0) + 0.1, abs=1e-9
    )


# --- Joint limits are kept unless somebody says limits=False: every argument, every start posture, every answer.


SPACE = hk.workspace(box=([1.2, 0.8], [0.05, 0.05]))
FORMULAS = {"motion.control.repetitive_motion"}
"""Published with limits and without: two laws, whose motions are judged by who runs them."""

DOORS: dict[str, Callable[[HolonomicStrategy, np.ndarray], object]] = {
    "inverse": hk.ik,
    "move_to_leaf": hk.motion.ik.move_to_leaf,
    "follow": lambda law, q: hk.follow(law, around(law, q), q, samples=4),
    "drift": lambda law, q: hk.drift(law, around(law, q), q, samples=4),
    "path_spread": lambda law, q: hk.motion.path_spread(law, around(law, q), around(law, q), q, samples=4),
    "controller": lambda law, q: hk.controller(law, dt=0.01, q0=q),
    "export_c": lambda law, q: hk.export.export_c(law, Path("nowhere"), q0=q),
    "coverage": lambda law, q: hk.coverage(law, SPACE, q, samples=4),
    "design": lambda law, q: hk.design(law.task, SPACE, q),
    "certify": lambda law, q: hk.certify(law, around(law, q), q),
    "unique_region": lambda law, q: hk.unique_region(law, q, SPACE),
    "cusps": hk.cusps,
    "serving_levels": lambda law, q: hk.analysis.design.level_range(law, SPACE, q),
    "self_motion": lambda law, q: hk.strategies.self_motion_curve(law.task, q),
    "witness_between": lambda law, q: hk.analysis.curvature.witness_between(law, q, q),
    "nearest": lambda law, q: hk.ik(law, q, limits=False).nearest([1.0, 1.0], limits=True),
}


def around(law: hk.Strategy, q: np.ndarray) -> hk.Path:
    """A circle of 2 cm that begins where the tool is."""
    at = law.task.robot.pose(q)[:3, 3]
    return hk.circle(at, center=at - [0.02, 0.0, 0.0])


def narrow(seed: int) -> tuple[HolonomicStrategy, np.ndarray, np.random.Generator]:
    """A planar arm with random limits, a strategy that ties its joints, and a posture within."""
    rng = np.random.default_rng(seed)
    q0 = np.array([rng.uniform(-0.5, 0.5), rng.uniform(0.6, 1.2), rng.uniform(-1.2, -0.4)])
    low, high = q0 - rng.uniform(0.05, 0.6, 3), q0 + rng.uniform(0.05, 0.6, 3)
    robot = hk.with_limits(hk.load("planar-3r"), lower=low, upper=high)
    return hk.holonomic(hk.position(robot), hk.linear([0.2, -0.1, 1.0])), q0, rng


def test_every_argument_and_field_that_is_called_limits_is_true_by_default() -> None:
    found = {}
    for room in rooms():
        for name in room.__all__:
            one, where = getattr(room, name), f"{room.__name__.partition('.')[2]}.{name}".lstrip(".")
            if inspect.isfunction(one):
                found[where] = one
    for name, one in public_classes().items():
        found[name] = one
        found |= {f"{name}.{key}": f for key, f in vars(one).items() if inspect.isfunction(f) and key[0] != "_"}
    told = {}
    for name, one in found.items():
        try:
            parameter = inspect.signature(one).parameters.get("limits")
        except ValueError:
            continue
        if parameter is not None and parameter.annotation in ("bool", "bool | None"):
            told[name] = parameter.default
    empty = inspect.Parameter.empty
    wrong = {name: value for name, value in told.items() if value not in (True, empty) and name not in FORMULAS}
    assert wrong == {"motion.ik.InverseKinematics.nearest": None}  # as `inverse` was told
    assert len(told) > 30


@pytest.mark.parametrize("door", DOORS)
def test_a_start_beyond_the_limits_is_refused_with_one_cure(door: str) -> None:
    law, q0, rng = narrow(list(DOORS).index(door))
    joint = int(rng.integers(3))
    beyond = q0.copy()
    beyond[joint] = law.task.robot.upper[joint] + rng.uniform(1e-6, 0.1)
    with pytest.raises(
        JointLimitError, match=f"'q{joint + 1}' .* widen the limits by hk.with_limits, or ask with limi"
    ):
        DOORS[door](law, beyond)


def test_without_limits_such_a_start_is_one_to_begin_from() -> None:
    law, *_ = narrow(0)
    beyond = law.task.robot.upper + 0.05
    pose = law.task.robot.pose(beyond)[:2, 3]
    assert np.abs(hk.ik(law, beyond, limits=False)(pose) - beyond).max() < 1e-9
    assert np.abs(hk.motion.ik.move_to_leaf(law, beyond, law.g(beyond), limits=False) - beyond).max() < 1e-9
    assert hk.follow(law, around(law, beyond), beyond, samples=4, limits=False).status is hk.motion.Status.COMPLETE
    assert hk.controller(law, dt=0.01, q0=beyond, limits=False).leaf == pytest.approx(law.g(beyond))


@settings(max_examples=settings.default.max_examples // 4)
@given(st.integers(0, 10**6))
def test_no_answer_is_beyond_the_limits(seed: int) -> None:
    """Poses of random postures, within the limits and beyond, and poses out of reach."""
    law, q0, rng = narrow(seed)
    robot = law.task.robot
    postures = q0 + rng.uniform(-0.8, 0.8, (12, 3))
    points = np.vstack([robot.pose_batch(postures)[0][:, :2], rng.uniform(-4, 4, (2, 2))])
    ik, free = hk.ik(law, q0), hk.ik(law, q0, limits=False)
    found, all_ = ik.batch(points), free.batch(points)
    assert robot.within(found.q[found.reached]).all()
    beyond = all_.reached & ~np.array([robot.within(q) for q in all_.q])
    assert (found.status[beyond] == InverseStatus.LIMIT).all() and np.array_equal(found.reached, all_.reached & ~beyond)
    for point in points[::13]:
        assert robot.beyond(ik.nearest(point, rcond=1e-3).q).max() < 1e-8
    for q, pose in ((q0, robot.pose(q0)), (postures[0], robot.pose(postures[0]))):
        postures_there = hk.motion.ik.all_postures(law, pose, law.g(q))
        assert robot.within(postures_there.q).all()
    level = law.g(q0) + rng.uniform(-0.5, 0.5)
    try:
        assert robot.beyond(hk.motion.ik.move_to_leaf(law, q0, level)).max() < 1e-9
    except HolokinError:
        return
