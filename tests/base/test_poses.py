"""Poses of other libraries and quaternions, wherever a pose is given: mink, Pinocchio, SciPy and MuJoCo as referees."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START
from holokin.base.errors import ArgumentError, HolokinError, NotFiniteError, ShapeError
from holokin.robot import DHRow

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
    "all_postures": lambda pose: hk.motion.ik.all_postures(LAW, pose, -0.1, starts=16, near=PANDA_START).q,
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
        with pytest.raises(ArgumentError, match=r"its length is .*: give one of length 1"):
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
