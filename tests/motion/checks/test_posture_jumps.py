"""Jumps of posture inside a motion: found where they are, by as much as Pinocchio says, and nowhere else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, Command
from holokin.analysis.audit.logs import Recording
from holokin.motion.checks import CheckReport, Finding, FindingKind
from holokin.motion.trajectory import Trajectory

pin = pytest.importorskip("pinocchio")

ARMS = ("panda", "iiwa14", "gen3", "sawyer", "xarm7", "rail-ur10e", "yumi-arm")


class Referee:
    """Tool poses by Pinocchio, and how far off its straight way the tool is in the middle of a joint step."""

    def __init__(self, robot: hk.Robot) -> None:
        self.model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
        self.data, self.tip = self.model.createData(), self.model.getFrameId(robot.tips[0].name)

    def pose(self, q: np.ndarray) -> pin.SE3:
        values = pin.neutral(self.model)
        for joint, value in zip(list(self.model.joints)[1:], q, strict=True):
            endless = joint.nq == 2
            values[joint.idx_q : joint.idx_q + joint.nq] = [np.cos(value), np.sin(value)] if endless else [value]
        pin.framesForwardKinematics(self.model, self.data, values)
        return self.data.oMf[self.tip].copy()

    def off(self, a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
        """(metres, rad)."""
        A, M, B = (self.pose(q) for q in (a, (a + b) / 2, b))
        halfway = A.rotation @ pin.exp3(pin.log3(A.rotation.T @ B.rotation) / 2)
        far = np.linalg.norm(M.translation - (A.translation + B.translation) / 2)
        return float(far), float(np.linalg.norm(pin.log3(halfway.T @ M.rotation)))


def self_motion(task: hk.Task, q: np.ndarray, size: float) -> np.ndarray:
    """Postures (k, n) of one tool pose, 0.01 rad apart, until a joint has moved by a size."""
    p, R = task._place(q)
    found = [q]
    while np.abs(found[-1] - q).max() < size and len(found) < 500:
        N = np.linalg.svd(task.jacobian(found[-1]))[2][-1]
        N *= np.sign(N @ (found[-1] - q)) or 1.0
        new = found[-1] + min(0.01, size) * N / np.abs(N).max()
        for _ in range(3):
            new = new + np.linalg.pinv(task.jacobian(new)) @ task.error(new, p, R)
        found.append(new)
    return np.array(found)


def walk_of(robot: hk.Robot, task: hk.Task, rng: np.random.Generator, samples: int) -> Trajectory | None:
    """Round a random circle, or along a line, from a random posture away from singular ones."""
    lower, upper = robot.ranges(np.pi)
    q0 = rng.uniform(0.7 * lower, 0.7 * upper)
    values = np.linalg.svd(task.jacobian(q0), compute_uv=False)
    if values[-1] < 0.05 * values[0]:
        return None
    at, size = robot.pose(q0)[:3, 3], rng.uniform(0.02, 0.2)
    path = hk.circle(at, at + [size, 0, 0]) if rng.random() < 0.5 else hk.line(at, at + size * rng.normal(size=3))
    try:
        return hk.follow(hk.moore_penrose(task), path, q0, samples=samples)
    except hk.base.errors.HolokinError:
        return None


def jumps(report: CheckReport) -> list[Finding]:
    return [one for one in report.findings if one.kind is FindingKind.JUMP]


def looked(motion: object, robot: hk.Robot, task: hk.Task | None) -> CheckReport:
    return hk.check(motion, None, robot=robot, task=task, limits=False)


def drawn(seed: int, count: int) -> None:
    """Walks of random arms: without a jump none is found; with one it is found where it is, as large as it is."""
    rng, seen = np.random.default_rng(seed), 0
    while seen < count:
        robot = hk.load(str(rng.choice(ARMS)))
        task = hk.pose(robot)
        walk = walk_of(robot, task, rng, int(rng.choice([8, 20, 100])))
        if walk is None or FindingKind.SINGULARITY in {one.kind for one in looked(walk, robot, task).findings}:
            continue
        assert not jumps(looked(walk, robot, task)), "an ordinary path, also of few samples"
        k = int(rng.integers(1, len(walk.q) - 1))
        other = self_motion(task, walk.q[k], rng.uniform(0.65, 1.2))[-1]
        shifted = np.vstack([walk.q[:k], other + (walk.q[k:] - walk.q[k])])
        far, turn = Referee(robot).off(shifted[k - 1], shifted[k])
        chord = np.linalg.norm(robot.pose(shifted[k])[:3, 3] - robot.pose(shifted[k - 1])[:3, 3])
        if not np.abs(other - walk.q[k]).max() > 0.6 or max(far, turn) < 0.002 + 0.25 * chord:
            continue
        report = looked(shifted[: k + 1], robot, task)
        (found,) = jumps(report)
        assert not report.passed and (found.start, found.stop, found.index) == (k - 1, k, k - 1)
        assert found.value == pytest.approx(far if found.unit == "m" else turn, rel=1e-6) and found.value > found.limit
        assert "jump of posture" in report.table()
        seen += 1


def test_a_jump_is_found_where_it_is_and_by_as_much_as_pinocchio_says() -> None:
    drawn(1, 6)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(2, 7))
def test_the_same_of_many_more_walks(seed: int) -> None:
    drawn(seed, 12)


def circle(panda: hk.Robot, q0: np.ndarray) -> Trajectory:
    at = panda.pose(PANDA_START)[:3, 3]
    return hk.follow(hk.moore_penrose(hk.pose(panda)), hk.circle(at, at - [0.1, 0, 0]), q0, samples=100)


@pytest.fixture(scope="module")
def walk(panda: hk.Robot) -> Trajectory:
    return circle(panda, PANDA_START)


@pytest.fixture(scope="module")
def jumped(panda: hk.Robot, walk: Trajectory) -> Trajectory:
    """The same path, with other postures from sample 50 on: about 0.65 rad away, at the same tool poses."""
    other = circle(panda, self_motion(hk.pose(panda), PANDA_START, 0.65)[-1])
    return replace(walk, q=np.vstack([walk.q[:50], other.q[50:]]))


def test_a_jump_is_found_in_postures_trajectories_logs_and_slow_timed_motions(
    panda: hk.Robot, jumped: Trajectory
) -> None:
    """All speeds are within their limits, so that nothing else tells it."""
    task, q = hk.pose(panda), jumped.q
    log = Recording(panda.joint_names, 2.0 * np.arange(len(q)), q, "made here")
    timed = hk.retime(jumped, acceleration=1.0, profile="trapezoidal", dt=0.02, speed=0.5)
    for motion in (q, jumped, log, timed):
        report = hk.check(motion, robot=panda, task=task)
        (found,) = report.findings
        assert found.kind is FindingKind.JUMP and 0.005 < found.value < 0.02, type(motion)
        assert found.start <= found.time <= found.stop
    inside = np.abs(timed.t - jumps(hk.check(timed, robot=panda, task=task))[0].time).argmin()
    assert np.abs(timed.q[inside] - (q[49] + q[50]) / 2).max() < 0.2
    clean = hk.retime(circle(panda, PANDA_START), acceleration=1.0, profile="trapezoidal", dt=0.02)
    assert hk.check(clean, robot=panda, task=task).passed


def test_without_a_task_a_jump_is_a_note(panda: hk.Robot, walk: Trajectory, jumped: Trajectory) -> None:
    report = hk.check(jumped.q, robot=panda)
    (told,) = report.observations
    step = np.abs(jumped.q[50] - jumped.q[49]).max()
    assert (
        report.passed and f"{step:.3g} rad" in told and "cannot be told without the task" in told and "49.000 s" in told
    )
    assert told in report.table() and report.to_dict()["observations"] == [told]
    assert not hk.check(walk.q, robot=panda).observations
    assert not hk.check(np.array([walk.q[0], walk.q[0] + 1.0]), robot=panda).observations, "a single step has no others"


def test_a_self_motion_with_the_tool_at_rest_is_said_as_one(panda: hk.Robot, walk: Trajectory) -> None:
    """The path, a change of posture at rest at its end, and the path again."""
    task = hk.pose(panda)
    between = self_motion(task, walk.q[-1], 0.65)
    report = hk.check(np.vstack([walk.q[:-1], between[:-1], circle(panda, between[-1]).q]), robot=panda, task=task)
    (told,) = report.observations
    assert report.passed and told.startswith("a self-motion: from 100.000 to ") and "the tool rests" in told
    assert f"{np.abs(between[-1] - between[0]).max():.2f}" in told
    assert not hk.check(walk, robot=panda, task=task).observations


def test_whole_turns_of_a_joint_without_limits_are_none_and_of_one_with_limits_are_jumps(tmp_path: Path) -> None:
    """An arm whose first joint is endless in one case: its angle may be written from -pi to pi."""
    rows = [{"joint": f"q{i}", "a": 0.3, "alpha": np.pi / 2, "d": 0.1} for i in range(4)]
    bounds = {"lower": -7.0, "upper": 7.0}
    t = np.linspace(0, 1, 200)
    turned = np.column_stack([2.9 + t, 0.3 + 0.1 * t, 0.5 - 0.1 * t, 0 * t])
    wrapped = np.column_stack([(turned[:, 0] + np.pi) % (2 * np.pi) - np.pi, turned[:, 1:]])
    for robot, some in ((hk.from_dh(rows), 0), (hk.from_dh([row | bounds for row in rows]), 1)):
        task = hk.position(robot)
        assert not jumps(looked(turned, robot, task))
        assert len(jumps(looked(wrapped, robot, task))) == some
        assert len(looked(wrapped, robot, None).observations) == some


def test_sliders_go_straight_however_far_they_go() -> None:
    """A rail of 3 m in three steps leads the tool straight on; on one with a self-motion of its arm it does not."""
    robot = hk.load("rail-ur10e")
    task, q = hk.pose(robot), np.tile([0.0, 0.2, -1.2, 1.4, -1.0, -1.5, 0.2], (4, 1))
    q[:, 0] = [0.0, 0.9, 1.7, 2.5]
    assert not jumps(looked(q, robot, task))
    other = self_motion(task, np.array([1.0, 0.2, -1.2, 1.4, -1.0, -1.5, 0.2]), 0.65)[-1]
    q[:, 0] = 1.0 + 0.001 * np.arange(4)
    q[2:] = other + q[2:] - q[0]
    assert [one.start for one in jumps(looked(q, robot, task))] == [1.0]


def test_a_joint_that_moves_no_tool_may_jump_and_is_noted(panda: hk.Robot, walk: Trajectory) -> None:
    """The last joint turns the tool about its own axis, through a point that stays."""
    q = walk.q.copy()
    q[60:, 6] += 1.5
    report = looked(q, panda, hk.position(panda))
    assert report.passed and "panda_joint7 goes 1.4" in report.observations[0]
    assert "the tool stays near its straight line" in report.observations[0]
    assert jumps(looked(q, panda, hk.pose(panda))) == [], "its turn is straight, too"


def test_a_table_that_turns_beside_an_arm_is_part_of_the_way() -> None:
    """Of a relative pose the way counts from one tool to the other: both arms may go far, as long as they go along."""
    robot = hk.load("yumi")
    task = hk.strategies.tasks.relative_pose(robot, robot.tips[0].name, robot.tips[1].name)
    middle = robot.ranges(1.0)[0] * 0.4 + robot.ranges(1.0)[1] * 0.6
    steps = middle + 0.005 * np.arange(30)[:, None] * np.linspace(-1, 1, robot.n)
    assert not jumps(looked(steps, robot, task))
    steps[15:] += self_motion(task, steps[15], 0.65)[-1] - steps[15]
    (found,) = jumps(looked(steps, robot, task))
    assert found.index == 14


def test_a_log_with_a_jump_fails_the_command(holokin: Command, tmp_path: Path, jumped: Trajectory) -> None:
    log = tmp_path / "log.csv"
    header = ",".join(["t", *jumped.joint_names])
    np.savetxt(
        log, np.column_stack([2.0 * np.arange(len(jumped.q)), jumped.q]), delimiter=",", header=header, comments=""
    )
    ran = holokin("check", log, "--robot", "panda")
    assert ran.code == 1 and "jump of posture: panda_joint" in ran.out and "98.000 to 100.000 s" in ran.out
