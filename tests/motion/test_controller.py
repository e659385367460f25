"""A controller is a control law: in a loop of one's own, in `simulate` and in `audit`, on both engines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.analysis.audit.questions import Repeatability
from holokin.base.errors import ArgumentError, ControllerError, NotFiniteError, ShapeError, SingularityError
from holokin.motion.control_step import StepStatus

START = np.array([0.3, 0.9, 0.7])
DT = 1e-3


@pytest.fixture(params=["1", "0"], ids=["native", "virtual machine"], autouse=True)
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, shared: Path) -> str:
    monkeypatch.setenv("HOLOKIN_NATIVE", request.param)
    monkeypatch.setenv("HOLOKIN_CACHE", str(shared))
    return request.param


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def planar(planar_3r: hk.Robot) -> hk.Strategy:
    return hk.holonomic(hk.position(planar_3r), hk.linear([0.0, 1.0, -1.0]))


@pytest.fixture(scope="module")
def arm(panda: hk.Robot) -> hk.Strategy:
    return hk.holonomic(hk.pose(panda, "zyz"), hk.arm_angle())


def circle(robot: hk.Robot, q: np.ndarray, radius: float = 0.1) -> hk.Path:
    point = robot.pose(q)[:3, 3]
    return hk.circle(point, point - [radius, 0, 0], speed=2 * np.pi * radius)  # in one second


def wanted(robot: hk.Robot, q: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A posture near q, a pose and a twist."""
    rng = np.random.default_rng(seed)
    near, there = (q + rng.uniform(-0.1, 0.1, len(q)) for _ in range(2))
    return near, robot.pose(there), rng.uniform(-0.2, 0.2, 6)


@pytest.mark.campaign
def test_a_controller_is_simulated_and_audited_as_it_is(planar: hk.Strategy, planar_3r: hk.Robot) -> None:
    """No lambda, no copies: the tool follows the path, and the joints close with it."""
    c = hk.controller(planar, dt=DT, q0=START)
    assert isinstance(c, hk.motion.control.ControlLaw)
    walk = hk.simulate(c, planar.task, circle(planar_3r, START), START, dt=DT, cycles=2)
    assert walk.tracking_error() < 5e-6
    assert np.abs(walk.drift()[1]).max() < 1e-9  # the first cycle begins without the loop's own error
    found = hk.audit(c, planar.task, [circle(planar_3r, START)], q0=START, dt=0.01, cycles=3)
    assert found.verdict is Repeatability.REPEATS
    free = hk.controller(hk.moore_penrose(planar.task), dt=DT)
    found = hk.audit(free, planar.task, [circle(planar_3r, START)], q0=START, dt=0.01, cycles=3)
    assert found.verdict is Repeatability.DRIFTS


def test_an_own_loop_of_steps_is_what_simulate_does(planar: hk.Strategy, planar_3r: hk.Robot) -> None:
    """The target is the pose at the end of the step, the twist the one that leads there."""
    c, path = hk.controller(planar, dt=DT, q0=START), circle(planar_3r, START)
    walk = hk.simulate(c, planar.task, path, START, dt=DT)
    q, points, h = START.copy(), path.at(walk.t).position, np.diff(walk.t)
    for k in range(len(h)):
        q = q + h[k] * c.step(q, points[k + 1], (points[k + 1] - points[k]) / h[k])
    assert np.abs(q - walk.q[-1]).max() < 1e-9


def test_each_step_returns_an_array_of_its_own(arm: hk.Strategy, panda: hk.Robot) -> None:
    c = hk.controller(arm, dt=DT, q0=PANDA_START)
    found = [c.step(*wanted(panda, PANDA_START, k)) for k in range(20)]
    again = [c.step(*wanted(panda, PANDA_START, k)) for k in range(20)]
    assert all(np.array_equal(a, b) for a, b in zip(found, again, strict=True))
    assert len({dq.ctypes.data for dq in found}) == 20
    assert all(dq.shape == (7,) and dq.flags.owndata and dq.flags.writeable for dq in found)
    q, pose, twist = wanted(panda, PANDA_START, 0)
    assert np.array_equal(c.step(twist=twist, q=q, pose=pose), found[0])


def test_what_is_left_of_a_result_stays_whatever_was_done_to_it(arm: hk.Strategy, panda: hk.Robot) -> None:
    """Views of it, and results of another shape, type or access, that nobody has any more."""
    c, expected, kept = hk.controller(arm, dt=DT, q0=PANDA_START), [], []
    uses = (
        lambda dq: dq[2:5],
        lambda dq: memoryview(dq),
        lambda dq: setattr(dq, "shape", (7, 1)),
        lambda dq: setattr(dq, "dtype", np.int64),
        lambda dq: dq.setflags(write=False),
        lambda dq: dq.resize(3, refcheck=False),
    )
    for k in range(60):
        dq = c.step(*wanted(panda, PANDA_START, k))
        assert dq.shape == (7,) and dq.dtype == float and dq.flags.writeable
        values, use = dq.copy(), uses[k % len(uses)]
        expected.append(values[2:5] if k % len(uses) == 0 else values)
        kept.append(use(dq))
        del dq
        c.step(*wanted(panda, PANDA_START, k + 1))
    for k, (view, values) in enumerate(zip(kept, expected, strict=True)):
        assert view is None or np.array_equal(np.asarray(view), values), k


def test_a_position_task_takes_points_and_poses_velocities_and_twists(planar: hk.Strategy, planar_3r: hk.Robot) -> None:
    c = hk.controller(planar, dt=DT, q0=START)
    q, pose, twist = wanted(planar_3r, START, 1)
    expected = c.step(q, pose, twist)
    assert np.abs(expected).max() > 1e-2
    for p in (pose, pose[:3, 3], pose.tolist(), pose[:3, 3].tolist()):
        for v in (twist, twist[:3], twist.tolist()):
            assert np.array_equal(c.step(q, p, v), expected)
    turned = pose.copy()
    turned[:3, :3] = Rotation.from_rotvec([0.0, 0.0, 1.0]).as_matrix()
    assert np.array_equal(c.step(q, turned, twist), expected)
    for p, v in ((pose[:3], twist), (pose, twist[:2]), (pose[0], twist), (np.zeros(16), twist)):
        with pytest.raises(ShapeError, match="or"):
            c.step(q, p, v)


def test_a_task_of_poses_takes_nothing_less(arm: hk.Strategy, panda: hk.Robot) -> None:
    c = hk.controller(arm, dt=DT, q0=PANDA_START)
    q, pose, twist = wanted(panda, PANDA_START, 1)
    for p, v in ((pose[:3, 3], twist), (pose, twist[:3])):
        with pytest.raises(ShapeError):
            c.step(q, p, v)


def test_the_twist_becomes_rates_of_the_tasks_own_coordinates(arm: hk.Strategy, panda: hk.Robot) -> None:
    """x' by central differences of Euler angles along the motion; the tool is where it is wanted."""
    pose, twist, h, short = panda.pose(PANDA_START), np.array([0.1, -0.2, 0.05, 0.3, 0.2, -0.1]), 1e-5, 1e-9
    c = hk.controller(arm, dt=short, q0=PANDA_START, gain=0.0, constraint_gain=0.0, limits=False)
    angles = [
        (Rotation.from_rotvec(s * h * twist[3:]) * Rotation.from_matrix(pose[:3, :3])).as_euler("ZYZ") for s in (1, -1)
    ]
    turning = np.angle(np.exp(1j * (angles[0] - angles[1]))) / (2 * h)
    expected = arm(PANDA_START) @ np.concatenate([twist[:3], turning])
    assert c.step(PANDA_START, pose, twist) == pytest.approx(expected, abs=1e-7)


@sampled(1, "orientation", ["twist", "zyz", "rotation-vector"])
def test_without_limits_it_is_the_textbooks_law(panda: hk.Robot, orientation: str) -> None:
    """Asymptotically cyclic on its own leaf; without a constraint, the closed loop."""
    task = hk.pose(panda, orientation)
    g = hk.arm_angle()
    strategy, free = hk.holonomic(task, g), hk.moore_penrose(task)
    far = {"limits": False, "most_error": np.inf}
    c = hk.controller(strategy, dt=DT, q0=PANDA_START, gain=20.0, constraint_gain=30.0, **far)
    cyclic = hk.motion.control.asymptotically_cyclic(task, g, c.leaf, 30.0, 20.0)
    plain = hk.controller(free, dt=DT, gain=20.0, **far)
    for ours, law in ((c, cyclic), (plain, hk.motion.control.closed_loop(free, 20.0))):
        a, b = ours.begin(PANDA_START), law.begin(PANDA_START)
        for k in range(4):
            q, pose, twist = wanted(panda, PANDA_START, k)
            assert np.abs(a(q, pose, twist, 0.01) - b(q, pose, twist, 0.01)).max() < 1e-11
            assert np.abs(ours.step(q, pose, twist) - b(q, pose, twist, DT)).max() < 1e-11


def test_each_run_has_memory_and_a_dt_of_its_own(arm: hk.Strategy, panda: hk.Robot) -> None:
    c = hk.controller(arm, dt=DT, q0=PANDA_START, most_error=np.inf)
    q, pose, twist = wanted(panda, PANDA_START, 2)
    expected = {dt: c.begin(PANDA_START)(q, pose, twist, dt) for dt in (DT, 5e-3, 0.015)}
    assert np.abs(expected[DT] - expected[0.015]).max() > 1e-6
    c.step(q, pose, np.full(6, np.nan))
    one, other = c.begin(PANDA_START), c.begin(q)
    for _ in range(3):
        for dt in expected:
            assert np.array_equal(one(q, pose, twist, dt), expected[dt])
            assert np.array_equal(other(q, pose, twist, DT), expected[DT])
    assert c.status is StepStatus.NOT_FINITE  # of the last call of `step`, which no run touches
    assert np.array_equal(c.step(q, pose, twist), expected[DT])


def test_a_run_that_begins_elsewhere_is_led_to_the_leaf_of_the_start(planar: hk.Strategy) -> None:
    task, elsewhere = planar.task, START + [0.1, -0.2, 0.15]
    c = hk.controller(planar, dt=0.01, q0=START, limits=False)
    walk = hk.simulate(c, task, circle(task.robot, elsewhere), elsewhere, dt=0.01, cycles=2)
    gap = [planar.constraint_value(q) - c.leaf[0] for q in walk.q]
    assert abs(gap[0]) > 0.3
    assert np.asarray(gap[:40]) == pytest.approx(gap[0] * 0.9 ** np.arange(40), rel=1e-6)  # a tenth a step
    assert abs(gap[-1]) < 1e-9


def test_a_run_says_what_a_step_tells_by_its_status(arm: hk.Strategy, panda: hk.Robot) -> None:
    """Where `step` would stop the arm in silence, a simulation ends with the reason."""
    c = hk.controller(arm, dt=DT, q0=PANDA_START)
    run, pose, upright = c.begin(PANDA_START), panda.pose(PANDA_START), np.zeros(7)
    with pytest.raises(SingularityError):
        run(upright, panda.pose(upright), np.zeros(6), DT)
    with pytest.raises(NotFiniteError):
        run(PANDA_START, pose, np.full(6, np.nan), DT)
    with pytest.raises(ArgumentError, match=r"step below 0\.02 s"):
        run(PANDA_START, pose, np.zeros(6), 0.03)
    for dt in (-DT, 0.0, np.inf, np.nan):
        with pytest.raises(ArgumentError, match="positive step"):
            run(PANDA_START, pose, np.zeros(6), dt)
    with pytest.raises(ArgumentError, match=r"1 ms is 0\.001"):
        hk.controller(arm, dt=1000, q0=PANDA_START)
    assert np.abs(run(PANDA_START, pose, np.zeros(6), DT)).max() < 1e-9
    with pytest.raises(ControllerError, match="unstable"):
        hk.simulate(c, arm.task, circle(panda, PANDA_START), PANDA_START, dt=0.03)
    with pytest.raises(SingularityError):
        hk.controller(arm, dt=DT, q0=upright, limits=False)


def test_a_strategy_without_leaves_needs_no_start(planar_3r: hk.Robot) -> None:
    free = hk.moore_penrose(hk.position(planar_3r))
    a, b = (hk.controller(free, dt=DT, q0=start) for start in (None, START))
    q, pose, twist = wanted(planar_3r, START, 3)
    assert np.array_equal(a.step(q, pose, twist), b.step(q, pose, twist))
    assert len(a.leaf) == 0


# --- the level as an input ---


def both(robot: hk.Robot, q0: np.ndarray, s: float) -> tuple[np.ndarray, np.ndarray, float, float]:
    """(pose, twist, level beyond the start's, its rate) of a hand and an elbow that come back at s = 1."""
    a = 2 * np.pi
    pose = robot.pose(q0)
    pose[0, 3] += 0.05 * np.sin(a * s)
    pose[1, 3] += 0.05 * (1 - np.cos(a * s))
    twist = np.zeros(6)
    twist[:2] = 0.05 * a * np.cos(a * s), 0.05 * a * np.sin(a * s)
    return pose, twist, 0.3 * np.sin(2 * a * s), 0.6 * a * np.cos(2 * a * s)


@pytest.mark.campaign
@sampled(1, "constraint", [hk.arm_angle(), hk.lock(2)], ids=["arm angle", "lock 3"])
def test_hand_and_elbow_are_led_at_once_and_the_joints_come_back(constraint: hk.Constraint, panda: hk.Robot) -> None:
    """At each instant the joints are those of inverse kinematics at the pose and the level that are wanted then."""
    strategy = hk.holonomic(hk.pose(panda), constraint)
    dt, seconds = 4e-3, 8.0
    c, c0, q = hk.controller(strategy, dt=dt, q0=PANDA_START), strategy.constraint_value(PANDA_START), PANDA_START
    ik, far, off = hk.ik(strategy, PANDA_START), 0.0, 0.0
    for i in range(1, round(seconds / dt) + 1):
        pose, _, level, _ = both(panda, PANDA_START, i * dt / seconds)
        _, twist, _, rate = both(panda, PANDA_START, (i - 0.5) * dt / seconds)
        q = q + dt * c.step(q, pose, twist / seconds, level=c0 + level, level_rate=rate / seconds)
        assert c.status is StepStatus.OK
        if i % 100 == 0:
            off = max(off, np.abs(q - ik(pose, level=c0 + level)).max())
        far = max(far, np.abs(q - PANDA_START).max())
    assert far > 0.2 and off < 3e-4
    assert np.abs(q - PANDA_START).max() < 1e-4


def test_a_level_that_jumps_is_gone_to_without_a_motion_of_the_tool(arm: hk.Strategy, panda: hk.Robot) -> None:
    """Self-motion: dq = [J; J_g]^-1 [0; K_g (c - g)]. Without a level the step holds that of the start again."""
    c, c0, q = hk.controller(arm, dt=DT, q0=PANDA_START), arm.constraint_value(PANDA_START), PANDA_START
    pose, still = panda.pose(PANDA_START), np.zeros(6)
    for _ in range(500):
        q = q + DT * c.step(q, pose, still, level=c0 + 0.2)
        assert np.abs(arm.task.error(q, pose[:3, 3], pose[:3, :3])).max() < 2e-4
    assert np.abs(arm.constraint_value(q) - c0 - 0.2) < 1e-4 and np.abs(q - PANDA_START).max() > 0.02
    for _ in range(500):
        q = q + DT * c.step(q, pose, still)
    assert np.abs(q - PANDA_START).max() < 1e-4


def test_a_bad_level_has_a_status_or_is_refused(arm: hk.Strategy, panda: hk.Robot) -> None:
    c, pose, still = hk.controller(arm, dt=DT, q0=PANDA_START), panda.pose(PANDA_START), np.zeros(6)
    assert not c.step(PANDA_START, pose, still, level=np.nan).any() and c.status is StepStatus.NOT_FINITE
    assert not c.step(PANDA_START, pose, still, level=0.0, level_rate=np.inf).any()
    for level, error in (("up", ArgumentError), ([0.1, 0.2], ShapeError)):
        with pytest.raises(error, match="level"):
            c.step(PANDA_START, pose, still, level=level)
    free = hk.controller(hk.moore_penrose(arm.task), dt=DT)
    with pytest.raises(ArgumentError, match="holds no leaf"):
        free.step(PANDA_START, pose, still, level=0.1)


def test_a_step_at_a_limit_names_the_joints_that_hold_it() -> None:
    """A slide led against its stop, then two at once, then away from both, where nothing holds it."""
    robot = hk.with_limits(hk.load("ppr"), lower=[-1.0, -1.0, -3.0], upper=[1.0, 1.0, 3.0], max_velocity=2.0)
    q0 = np.array([0.2, 0.1, 1.0])
    c = hk.controller(hk.holonomic(hk.position(robot), hk.lock(2)), dt=0.01, q0=q0)
    first, second, _ = robot.joint_names

    def step(q: list[float], twist: list[float]) -> tuple[str, tuple[str, ...]]:
        pose = robot.pose(np.array(q))
        pose[:2, 3] += 0.01 * np.array(twist)
        c.step(np.array(q), pose, np.array([*twist, 0.0, 0.0, 0.0, 0.0]))
        return c.status.name, c.holding

    assert step([1.0, 0.1, 1.0], [0.3, 0.0]) == ("LIMIT", (first,)) and c.scale == 0.0 and first in repr(c)
    assert step([1.0, -1.0, 1.0], [0.3, -0.3]) == ("LIMIT", (first, second))
    assert step([1.0, -1.0, 1.0], [-0.3, 0.3]) == ("OK", ()) and "held" not in repr(c)
    assert step([1.0, 0.1, 1.0], [-0.3, 0.2]) == ("OK", ())
