"""Tasks of several frames at once: both hands of a two-armed robot, each with a pose and a path of its own."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import sampled
from exported import STRICT
from holokin.app.job import open_job, run_job
from holokin.motion.ik import InverseStatus
from holokin.path.editing import SynchronizedPaths
from holokin.robot import Robot, to_urdf

LEFT, RIGHT = "left_flange", "right_flange"
Q0 = np.array([0.1, -1.2, -0.9, 0.4, 0.3, 0.8, 0.2, -0.1, -1.2, 0.9, 0.4, -0.3, 0.8, -0.2])
PLANE_Q0 = np.array([0.3, 0.9, 0.7, 0.5, -0.3, 0.9, 0.7, 0.5])
THIRDS = (2, 9)
"""The joint of each arm that is held: the third from the base."""


@pytest.fixture(scope="module")
def yumi() -> Robot:
    return hk.load("yumi")


@pytest.fixture(scope="module")
def hands(yumi: Robot) -> hk.Task:
    return hk.stacked(hk.pose(yumi, tip=LEFT), hk.pose(yumi, tip=RIGHT))


@pytest.fixture(scope="module")
def held(hands: hk.Task) -> hk.Strategy:
    return hk.holonomic(hands, hk.lock(*THIRDS))


def circles(task: hk.Task, radius: float = 0.04) -> SynchronizedPaths:
    left, right = task.pose(Q0)[:, :3, 3]
    away = hk.circle(left, left - [radius, 0, 0])
    return hk.path.synchronized(away, hk.circle(right, right - [radius, 0, 0], clockwise=True, speed=0.07))


def test_the_jacobian_of_both_hands_is_that_of_pinocchio(yumi: Robot, hands: hk.Task, tmp_path: Path) -> None:
    model = pin.buildModelFromXML(to_urdf(yumi))
    data, order = model.createData(), [model.joints[model.getJointId(name)].idx_v for name in yumi.joint_names]
    for dq in np.random.default_rng(0).uniform(-0.4, 0.4, (5, 14)):
        q, theirs = Q0 + dq, np.zeros(14)
        theirs[order] = q
        pin.computeJointJacobians(model, data, theirs)
        pin.updateFramePlacements(model, data)
        rows = []
        for f, tip in enumerate((LEFT, RIGHT)):
            frame = model.getFrameId(tip)
            rows.append(pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)[:, order])
            assert np.abs(hands.pose(q)[f] - data.oMf[frame].homogeneous).max() < 1e-9
        assert np.abs(hands.jacobian(q) - np.vstack(rows)).max() < 1e-9


@pytest.mark.parametrize(
    "kinds",
    [("twist", "zyz"), ("axis", None), (None, None), ("rotation-vector", "axis"), ("axis", "axis")],
)
def test_value_error_and_jacobian_of_any_two_tasks_belong_together(yumi: Robot, kinds: tuple[str | None, ...]) -> None:
    def one(kind: str | None, tip: str) -> hk.Task:
        at = yumi.pose(Q0, tip)[:3, :3]
        return hk.position(yumi, tip) if kind is None else hk.pose(yumi, kind, tip=tip, reference=at)

    parts = [one(kind, tip) for kind, tip in zip(kinds, (LEFT, RIGHT), strict=True)]
    task = hk.stacked(*parts)
    assert task.m == sum(part.m for part in parts)
    assert task.units == parts[0].units + parts[1].units
    rng, h = np.random.default_rng(1), 1e-6
    for q in Q0 + rng.uniform(-0.2, 0.2, (4, 14)):
        J = task.jacobian(q)
        assert np.abs(J - np.vstack([part.jacobian(q) for part in parts])).max() < 1e-12
        assert np.abs(task(q) - np.concatenate([part(q) for part in parts])).max() < 1e-12
        dq = rng.uniform(-1, 1, 14)  # the error to a pose a little on is what J says of the path there
        moved = task.error(q - h * dq, *task._place(q + h * dq)) / (2 * h)
        assert np.abs(moved - J @ dq).max() < 1e-6
    several = task.error(Q0 + np.zeros((3, 14)), *task._place(Q0 + 0.1))
    assert np.abs(several - task.error(Q0, *task._place(Q0 + 0.1))).max() == 0.0


def test_rows_of_a_stacked_task_are_those_of_its_parts(hands: hk.Task) -> None:
    some = hands[[7, 0, 3, 4, 5]]
    assert some.row_names == (f"{RIGHT}.y", f"{LEFT}.x", f"{LEFT}.wx", f"{LEFT}.wy", f"{LEFT}.wz")
    assert np.abs(some.jacobian(Q0) - hands.jacobian(Q0)[[7, 0, 3, 4, 5]]).max() == 0.0
    with pytest.raises(hk.HolokinError, match="angular rows"):
        hands[[0, 3]]


def test_both_hands_drift_by_the_pseudo_inverse_and_return_on_a_leaf(hands: hk.Task, held: hk.Strategy) -> None:
    loop = circles(hands)
    lost = hk.drift(hk.moore_penrose(hands), loop, Q0, samples=200)
    kept = hk.drift(held, loop, Q0, samples=100, cycles=2)
    assert lost.largest[0] > 0.01
    assert kept.largest.max() < 1e-12
    for walk in (lost.trajectory, kept.trajectory):
        assert walk.tracking_error() < 1e-8
        assert walk.tracking_error("rad") < 1e-8


def test_the_verdict_and_the_curvature_are_of_all_rows_together(hands: hk.Task, held: hk.Strategy) -> None:
    """r = 2: a plane of one row of each hand can be as crooked as one of a single hand's rows."""
    assert hk.involutivity(held, hk.around(Q0, 0.1), samples=4).holonomic
    assert not hk.involutivity(hk.moore_penrose(hands), hk.around(Q0, 0.1), samples=4).holonomic
    F = hk.curvature(hk.moore_penrose(hands), Q0)
    single = [hk.curvature(hk.moore_penrose(part), Q0) for part in hands.parts]
    for f, part in enumerate(single):  # the arms have no joint in common, nor has what one's motion does to the other
        block = slice(6 * f, 6 * f + 6)
        assert np.abs(F[:, block, block] - part).max() < 1e-9
    assert np.abs(F[:, :6, 6:]).max() < 1e-12
    assert np.abs(F).max() > 0.1


@pytest.fixture(scope="module")
def plane_hands() -> hk.Task:
    """The poses of two plane arms of four joints, side by side: short code for a compiler."""
    arm = hk.from_dh([{"a": 0.3}] * 4, name="arm")
    both = hk.compose(
        hk.robot.Part(arm, prefix="left_"), hk.robot.Part(arm, on="base", pose=[0, -0.5, 0], prefix="right_")
    )
    return hk.stacked(*(hk.pose(both, tip=tip.name) for tip in both.tips))


@sampled(1, "native", [True, False])
def test_inverse_kinematics_takes_a_pose_for_each_hand(
    native: bool, plane_hands: hk.Task, hands: hk.Task, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", str(int(native)))
    task, start, thirds = (plane_hands, PLANE_Q0, (2, 6)) if native else (hands, Q0, THIRDS)
    law = hk.holonomic(task, hk.lock(*thirds))
    ik, rng = hk.ik(law, start), np.random.default_rng(2)
    there = start + rng.uniform(-0.15, 0.15, (6, task.n))
    there[:, thirds] = start[list(thirds)]
    poses = np.array([task.pose(q) for q in there])
    for q, pose in zip(there, poses, strict=True):
        assert np.abs(ik(pose) - q).max() < 1e-9
        assert np.abs(ik.near(pose, start) - q).max() < 1e-9
    found = ik.batch(poses)
    assert np.abs(found.q - there).max() < 1e-9
    poses[1, 1, :3, :3] *= 1.1
    poses[2, 0, 0, 3] = np.nan
    poses[3, 1] = poses[3, 1].T
    status = ik.batch(poses).status
    wanted = [InverseStatus.REACHED, InverseStatus.NOT_A_ROTATION, InverseStatus.NOT_FINITE]
    assert status.tolist() == [*wanted, InverseStatus.NOT_A_ROTATION, InverseStatus.REACHED, InverseStatus.REACHED]
    with pytest.raises(hk.HolokinError, match=r"\(2, 4, 4\)"):
        ik(poses[0, 0])
    with pytest.raises(hk.HolokinError, match="nearest pose is asked of one"):
        ik.nearest(poses[0])
    assert ("virtual machine" in ik.engine) is not native


@pytest.mark.campaign
def test_native_steps_along_paths_are_those_of_the_virtual_machine(
    hands: hk.Task, monkeypatch: pytest.MonkeyPatch
) -> None:
    loop = circles(hands, 0.02)
    points = hands.pose(Q0)[:, :3, 3]
    turned = hk.path.synchronized(*(hk.line(p, p + [0.01, 0.01, 0.0], turn=[0.1, 0.0, 0.2]) for p in points))
    for path in (loop, turned):
        ends = []
        for native in ("0", "1"):
            monkeypatch.setenv("HOLOKIN_NATIVE", native)
            for law in (hk.holonomic(hands, hk.lock(*THIRDS)), hk.moore_penrose(hands)):
                with monkeypatch.context() as patch:
                    patch.setattr("holokin.motion.follow_path.NATIVE_FROM", 1)
                    patch.setattr("holokin.motion.follow_path.CACHED_FROM", 1)
                    ends.append(hk.follow(law, path, Q0, samples=40).q)
        for a, b in zip(ends[:2], ends[2:], strict=True):
            assert np.abs(a - b).max() < 1e-12


def test_a_controller_takes_a_pose_and_a_twist_for_each_hand(
    yumi: Robot, hands: hk.Task, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers, rng = [], np.random.default_rng(3)
    pose, twist = hands.pose(Q0 + 0.001), rng.uniform(-0.05, 0.05, (2, 6))
    for native in ("1", "0"):
        monkeypatch.setenv("HOLOKIN_NATIVE", native)
        c = hk.controller(hk.holonomic(hands, hk.lock(*THIRDS)), dt=0.01, q0=Q0, limits=False)
        dq = c.step(Q0, pose, twist)
        answers.append(dq)
        error = hands.error(Q0, *hands.target(pose)) - 0.01 * twist.ravel()
        assert np.abs(hands.jacobian(Q0) @ dq - (twist.ravel() + 10 * error)).max() < 1e-9
        assert np.abs(dq[list(THIRDS)]).max() < 1e-12
        spoilt = pose.copy()
        spoilt[1] = spoilt[1].T
        with pytest.raises(hk.HolokinError, match="last row"):
            c.step(Q0, spoilt, twist)
        with pytest.raises(hk.HolokinError, match=r"\(2, 6\)"):
            c.step(Q0, pose, twist[0])
    assert np.abs(answers[0] - answers[1]).max() < 1e-12
    loop = circles(hands, 0.02)
    walk = hk.simulate(hk.controller(hk.moore_penrose(hands), dt=0.02), hands, loop, Q0, dt=0.02)
    assert walk.tracking_error() < 1e-4
    points = hk.controller(hk.moore_penrose(hk.stacked(hk.position(yumi, LEFT), hk.position(yumi, RIGHT))), dt=0.01)
    assert np.abs(points.step(Q0, pose, twist) - points.step(Q0, pose[:, :3, 3], twist[:, :3])).max() < 1e-15


def test_a_tray_between_two_hands_does_not_bend(yumi: Robot, hands: hk.Task, held: hk.Strategy) -> None:
    """Both hands turn about the middle of the tray; the pose of one in the other stays what it is."""
    points, up = hands.pose(Q0)[:, :3, 3], np.array([0.0, 0.0, 1.0])
    middle = points.mean(axis=0)
    ways = [hk.path.arc(p, [*middle[:2], p[2]], 0.15, up, turn=0.15 * up) for p in points]
    walk = hk.follow(held, hk.path.synchronized(*ways), Q0, samples=40)
    between = hk.strategies.tasks.relative_pose(yumi, LEFT, RIGHT)
    start = between.pose(Q0)
    assert max(np.abs(between.pose(q) - start).max() for q in walk.q) < 1e-9
    turned = hands.pose(walk.q[-1])[0, :3, :3] @ hands.pose(Q0)[0, :3, :3].T
    assert np.abs(Rotation.from_matrix(turned).as_rotvec() - 0.15 * up).max() < 1e-9


def test_each_arm_can_be_held_by_its_own_arm_angle(hands: hk.Task) -> None:
    angles = hk.strategies.constraints.stack(hk.arm_angle(tip=LEFT), hk.arm_angle(tip=RIGHT))
    both = hk.holonomic(hands, angles)
    moved = Q0 + np.r_[np.full(7, 0.02), np.zeros(7)]
    change = both.constraint_value(moved) - both.constraint_value(Q0)
    assert abs(change[0]) > 1e-3
    assert change[1] == 0.0
    assert np.abs(hands.jacobian(Q0) @ both(Q0) - np.eye(12)).max() < 1e-9
    with pytest.raises(hk.HolokinError, match="tip"):
        hk.holonomic(hands, hk.strategies.constraints.stack(hk.arm_angle(tip="middle"), hk.lock(0)))(Q0)


@given(speeds=st.tuples(st.floats(0.05, 1.0), st.floats(0.05, 1.0)), corners=st.integers(2, 5))
def test_synchronized_paths_are_the_paths_at_equal_shares_of_their_times(
    speeds: tuple[float, float], corners: int
) -> None:
    rng = np.random.default_rng(corners)
    a = hk.polyline(rng.uniform(-1, 1, (corners, 3)), turns=rng.uniform(-1, 1, (corners - 1, 3)), speed=speeds[0])
    b = hk.circle([1.0, 0, 0], [0.5, 0, 0], speed=speeds[1])
    both = hk.path.synchronized(a, b, [0.1, 0.2, 0.3])
    assert both.duration == pytest.approx(max(a.duration, b.duration), rel=1e-12)
    shares = rng.uniform(0, 1, 30)
    at = both.at(shares * both.duration)
    alone = [path.at(shares * path.duration) for path in (a, b)]
    for f, one in enumerate(alone):
        rows, pace = slice(3 * f, 3 * f + 3), (a, b)[f].duration / both.duration
        assert np.abs(at.position[:, rows] - one.position).max() < 1e-9
        assert np.abs(at.rotation[:, rows] - one.rotation).max() < 1e-9
        assert np.abs(at.velocity[:, rows] - pace * one.velocity).max() < 1e-9
        assert np.abs(at.angular[:, rows] - pace * one.angular).max() < 1e-9
    assert np.abs(at.position[:, 6:] - [0.1, 0.2, 0.3]).max() == 0.0
    assert not both.closed
    back = both.reversed().at(shares * both.duration)
    assert np.abs(back.position - both.at((1 - shares) * both.duration).position).max() < 1e-9
    piece = both.part(0.25, 0.75)
    there = both.at((0.25 + shares / 2) * both.duration)
    assert np.abs(piece.at(shares * piece.duration).position - there.position).max() < 1e-9


def test_the_two_paths_of_synchronized_loops_meet_half_way(hands: hk.Task, held: hk.Strategy) -> None:
    loop = circles(hands, 0.02)
    assert loop.closed
    there, back = loop.halves()
    assert np.abs(there.end - back.end).max() < 1e-12
    assert hk.motion.path_spread(held, there, back, Q0, samples=40).largest < 1e-9
    assert hk.motion.path_spread(hk.moore_penrose(hands), there, back, Q0, samples=40).largest > 1e-4


def test_bad_stacks_and_paths_are_refused_with_their_cure(yumi: Robot, hands: hk.Task, held: hk.Strategy) -> None:
    panda = hk.load("panda")
    with pytest.raises(hk.HolokinError, match="of one robot"):
        hk.stacked(hands, hk.pose(panda))
    with pytest.raises(hk.HolokinError, match="18"):
        hk.stacked(hands, hk.pose(yumi))
    with pytest.raises(hk.HolokinError, match="at least one"):
        hk.stacked()
    with pytest.raises(hk.HolokinError, match=r"give 2 of them, one a frame .* hk\.path\.synchronized"):
        hk.follow(held, hk.line([0, 0, 0], [0.1, 0, 0]), Q0)
    with pytest.raises(hk.HolokinError, match="at least one path"):
        hk.path.synchronized([0, 0, 0], [1, 0, 0])
    with pytest.raises(hk.HolokinError, match="start of the path"):
        hk.follow(held, hk.path.synchronized(hk.line([0, 0, 0], [0.1, 0, 0]), [0, 0, 0]), Q0)
    assert hk.stacked(hands) is hands


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")
def test_exported_c_of_two_arms_does_what_python_does(tmp_path: Path) -> None:
    """Two plane arms side by side: a pose of one and a point of the other, and two points."""
    arm = hk.load("planar-3r")
    both = hk.compose(
        hk.robot.Part(arm, prefix="left_"), hk.robot.Part(arm, on="base", pose=[0, -0.5, 0], prefix="right_")
    )
    (left, right), q0 = (tip.name for tip in both.tips), np.array([0.3, 0.9, 0.7, -0.3, 0.9, 0.7])
    points = hk.stacked(hk.position(both, left), hk.position(both, right))
    laws = {
        "poses": hk.holonomic(hk.stacked(hk.pose(both, tip=left), hk.position(both, right)), hk.lock(4)),
        "points": hk.holonomic(points, hk.lock(1, 4)),
    }
    for name, law in laws.items():
        written = hk.export.export_c(law, tmp_path / name, q0=q0, name="arms", vectors_count=4)
        if name == "poses":  # the other one's numbers are those of an allocation, which is looked at as well
            assert all(line.endswith("passed") for line in hk.export.check(written))
        size = {"poses": (32, 12), "points": (6, 6)}[name]
        header = (tmp_path / name / "arms.h").read_text("utf-8")
        assert f"ARMS_TARGET = {size[0]}," in header
        assert f"ARMS_TWIST = {size[1]} " in header
        subprocess.run(["cc", *STRICT, "-c", "arms.c", "-o", "arms.o"], cwd=tmp_path / name, check=True)


@pytest.mark.campaign
def test_a_law_carried_along_straight_ways_of_both_hands_is_holonomic(hands: hk.Task) -> None:
    law, loop = hk.radial(hk.moore_penrose(hands), Q0, steps=1), circles(hands, 0.02)
    q = Q0 + np.random.default_rng(4).uniform(-0.05, 0.05, 14)
    assert np.abs(hands.jacobian(q) @ law(q) - np.eye(12)).max() < 1e-9
    assert hk.drift(law, loop, Q0, samples=20).largest[0] < 1e-12


JOB = """title = "Two hands"
[robot]
name = "yumi"
[task]
kind = "stacked"
parts = [{ kind = "pose", tip = "left_flange" }, { kind = "position", tip = "right_flange" }]
[start]
q = [0.1, -1.2, -0.9, 0.4, 0.3, 0.8, 0.2, -0.1, -1.2, 0.9, 0.4, -0.3, 0.8, -0.2]
[path]
kind = "circle"
center = [-0.02, 0, 0]
relative = true
samples = 40
OTHERS
[strategies.locked]
kind = "lock"
joints = ["left_joint_7", "right_joint_7", "right_joint_4", "right_joint_5", "right_joint_6"]
[expect.locked]
holonomic = true
drift = { below = 1e-12 }
tracking = { below = 1e-9 }
[verdict]
samples = 2
"""
MOVING = 'others = [{ kind = "circle", center = [0, 0.02, 0], relative = true }]'

LINE = 'others = [{ kind = "polyline", points = [[0, 0, 0], [0, 0.02, 0]], relative = true }]'


@sampled(1, "others", [MOVING, ""])
def test_a_job_leads_each_hand_along_its_own_path(others: str, hands: hk.Task, tmp_path: Path) -> None:
    """A hand without a path stays where it is."""
    file = tmp_path / "hands.toml"
    file.write_text(JOB.replace("OTHERS", others), "utf-8")
    result = run_job(*open_job(str(file)))
    assert result.passed
    q = result.strategies[0].cycles.q
    moved = [np.ptp([hands.pose(one)[f, :3, 3] for one in q], axis=0).max() for f in (0, 1)]
    assert moved[0] == pytest.approx(0.04, rel=0.01)
    assert moved[1] == pytest.approx(0.04 if others else 0.0, rel=0.01, abs=1e-9)


def test_a_job_with_paths_or_parts_that_its_hands_do_not_have_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "hands.toml"
    many = MOVING.replace("}]", "}, " + MOVING.split("[", 1)[1].split("}")[0] + "}]")
    for text, fault in (
        (JOB.replace("OTHERS", many), "number of frames with a path is 3"),
        (JOB.replace("OTHERS", "").replace('kind = "position",', 'kind = "stacked",'), "stacked. needs parts"),
        (JOB.replace("OTHERS", MOVING.replace("center", "cycles = 2, center")), "others hold cycles"),
        (JOB.replace("OTHERS", 'entry = "joints"'), "leads one tool to its path"),
        (JOB.replace("OTHERS", "cycles = 2\n" + LINE), "2 cycles of a path that ends 0.02"),
    ):
        file.write_text(text, "utf-8")
        with pytest.raises(hk.HolokinError, match=fault):
            run_job(*open_job(str(file)))
