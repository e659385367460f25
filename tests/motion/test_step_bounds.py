"""A control step has a bound wherever its leaf ends, and says so: in Python, on both engines, and in exported C."""

import math
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from holokin.base.errors import ArgumentError, ShapeError, SingularityError, TrackingError, UnknownNameError
from holokin.motion import Controller, StepStatus
from holokin.motion.control_step import LEAST_RCOND, MOST_ERROR, UNLIMITED

DT = 1e-3
PANDA_START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])


def drawn_arm(rng: np.random.Generator) -> hk.Robot:
    """Four hinges with random links and twists and no limits, as MJCF and as it comes back: what many users load."""
    rows = [
        {"a": rng.uniform(0.1, 0.5), "d": rng.uniform(-0.2, 0.2), "alpha": rng.choice([-1, 1]) * rng.uniform(0.5, 1.6)}
        for _ in range(4)
    ]
    return hk.robot.from_mjcf(hk.robot.to_mjcf(hk.from_dh(rows, name="drawn")))


def run_outwards(c: Controller, robot: hk.Robot, q0: np.ndarray, speed: float) -> list[tuple[StepStatus, float, float]]:
    """(status, largest joint speed, how far the tool is off) while the point it is to follow is drawn out of reach."""
    q, p = q0.copy(), robot.pose(q0)[:3, 3].copy()
    way = speed * p / np.linalg.norm(p)
    found, side = [], _side(c, q0)
    for _ in range(int(2.5 / speed / DT / 2)):
        off = float(np.linalg.norm(robot.pose(q)[:3, 3] - p))
        p = p + way * DT
        dq = c.step(q, p, way)
        found.append((c.status, float(np.abs(dq).max()), off))
        q = q + dq * DT
        assert _side(c, q) == side, "a step led past a singular posture"
    return found


def _side(c: Controller, q: np.ndarray) -> float:
    """The sign of det [J; J_g]: it changes where a leaf ends."""
    strategy = c.strategy
    return float(np.sign(np.linalg.det(np.vstack([strategy.task.jacobian(q), strategy.rows(q)]))))


@sampled(1, "native", ["1", "0"])
def test_no_step_under_ok_is_faster_than_a_turn_a_second_or_leaves_the_tool_far_off(
    native: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Robots, leaves and starts drawn at random, none with a speed limit; each is led to the end of its leaf."""
    monkeypatch.setenv("HOLOKIN_NATIVE", native)
    rng = np.random.default_rng(11)
    ended = 0
    for _ in range(3 if native == "1" else 2):
        robot = drawn_arm(rng)
        assert not np.isfinite(robot.max_velocity).any()
        strategy = hk.holonomic(hk.position(robot), hk.lock(int(rng.integers(4))))
        q0 = rng.uniform(-1.5, 1.5, 4)
        try:
            c = hk.controller(strategy, dt=DT, q0=q0)
        except SingularityError:
            continue
        seen = run_outwards(c, robot, q0, 0.5)
        for status, speed, off in seen:
            assert speed <= UNLIMITED["rad"] * (1 + 1e-12)
            assert status is not StepStatus.OK or off <= math.sqrt(3) * MOST_ERROR
            assert status < StepStatus.SINGULAR or speed == 0.0
        ended += seen[-1][0] is not StepStatus.OK
        assert all(off < 1e-3 for status, _, off in seen[:50] if status is StepStatus.OK)
    assert ended >= 2, "the tool was led out of reach, and hardly any arm said so"


def test_a_pose_far_away_or_in_millimetres_moves_nothing(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    c = hk.controller(hk.holonomic(task, hk.lock(2)), dt=DT, q0=PANDA_START)
    pose, still = panda.pose(PANDA_START), np.zeros(6)
    for place in (pose[:3, 3] + [1.0, 0, 0], pose[:3, 3] * 1000):
        far = pose.copy()
        far[:3, 3] = place
        assert not c.step(PANDA_START, far, still).any()
        assert c.status is StepStatus.LOST
        with pytest.raises(TrackingError, match="metres"):
            c.begin(PANDA_START)(PANDA_START, far, still, DT)
    turned = pose.copy()
    turned[:3, :3] = pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    assert not c.step(PANDA_START, turned, still).any()
    near = pose.copy()
    near[0, 3] += 0.5 * MOST_ERROR
    assert c.step(PANDA_START, near, still).any()
    free = hk.controller(c.strategy, dt=DT, q0=PANDA_START, most_error=math.inf)
    far = pose.copy()
    far[0, 3] += 1.0
    assert free.step(PANDA_START, far, still).any()
    assert free.status is StepStatus.SLOWED


def test_a_nearly_singular_posture_stands_still_and_says_of_which_kind() -> None:
    """A planar arm almost straight: rcond falls with its bend, and the bound is met where it is said to be."""
    robot = hk.load("planar-3r")
    strategy = hk.holonomic(hk.position(robot), hk.linear([0, 1, -1]))
    c = hk.controller(strategy, dt=DT, q0=[0.3, 0.9, 0.7], limits=False)
    seen = {}
    for bend in np.geomspace(1e-6, 0.5, 60):
        q = np.array([0.3, bend, bend])
        c.step(q, robot.pose(q), np.array([0, 1e-3, 0, 0, 0, 0]))
        rcond = float(strategy.gain(q)[1])
        seen[c.status] = True
        assert (c.status is StepStatus.SINGULAR) == (rcond <= LEAST_RCOND)
    assert {StepStatus.SINGULAR, StepStatus.OK} <= set(seen)
    q = np.array([0.3, 1e-5, 1e-5])
    with pytest.raises(SingularityError):
        c.begin(q)(q, robot.pose(q), np.zeros(6), DT)
    bold = hk.controller(strategy, dt=DT, q0=[0.3, 0.9, 0.7], limits=False, least_rcond=0.0)
    bold.step(q, robot.pose(q), np.zeros(6))
    assert bold.status is StepStatus.OK


@pytest.mark.parametrize(
    ("name", "value"), [("most_error", 0.0), ("most_error", -1), ("most_error", math.nan), ("least_rcond", 1.0),
                        ("least_rcond", -1e-3), ("least_rcond", math.nan), ("most_error", "near")],
)  # fmt: skip
def test_bounds_that_are_none_are_refused(panda: hk.Robot, name: str, value: object) -> None:
    with pytest.raises(ArgumentError, match=name):
        hk.controller(hk.moore_penrose(hk.pose(panda)), dt=DT, **{name: value})


def test_limits_that_a_model_lacks_are_given_by_number_by_row_or_by_name(panda: hk.Robot, tmp_path: Path) -> None:
    text = hk.robot.to_mjcf(panda)
    bare = hk.robot.from_mjcf(text)
    assert np.isinf(bare.max_velocity).all()
    names, rows = bare.joint_names, np.linspace(1.0, 2.0, 7)
    assert hk.robot.from_mjcf(text, max_velocity=2.0).max_velocity == pytest.approx(2.0)
    assert hk.robot.from_mjcf(text, max_velocity=rows).max_velocity == pytest.approx(rows)
    some = hk.with_limits(bare, max_velocity={names[3]: 1.5}, lower={names[0]: -1.0}, upper={names[0]: 1.0})
    assert some.max_velocity[3] == 1.5
    assert np.isinf(some.max_velocity[[0, 1, 2, 4, 5, 6]]).all()
    assert (some.lower[0], some.upper[0]) == (-1.0, 1.0)
    assert np.array_equal(some.lower[1:], bare.lower[1:])
    assert np.isinf(bare.max_velocity).all(), "the robot that was given has changed"
    assert np.array_equal(some.pose(PANDA_START), bare.pose(PANDA_START))
    assert np.isinf(hk.with_limits(panda, max_velocity=math.inf).max_velocity).all()


def test_limits_in_degrees_or_of_joints_that_there_are_not_are_refused(panda: hk.Robot) -> None:
    with pytest.raises(ArgumentError, match="deg2rad"):
        hk.with_limits(panda, max_velocity=150.0)
    with pytest.raises(ArgumentError, match="range of joint"):
        hk.with_limits(panda, lower=1.0, upper=-1.0)
    with pytest.raises(ArgumentError, match="speed limit"):
        hk.with_limits(panda, max_velocity=0.0)
    with pytest.raises(UnknownNameError, match="panda_joint"):
        hk.with_limits(panda, max_velocity={"panda_joint9": 1.0})
    with pytest.raises(ShapeError):
        hk.with_limits(panda, max_velocity=[1.0, 2.0])
    with pytest.raises(ArgumentError):
        hk.with_limits(panda, max_velocity={"panda_joint1": "fast"})


def test_with_limits_a_step_keeps_to_them(panda: hk.Robot) -> None:
    slow = hk.with_limits(panda, max_velocity=0.05)
    task = hk.pose(slow)
    c = hk.controller(hk.holonomic(task, hk.lock(2)), dt=DT, q0=PANDA_START)
    dq = c.step(PANDA_START, slow.pose(PANDA_START), np.array([0.3, 0, 0, 0, 0, 0]))
    assert c.status is StepStatus.SLOWED
    assert np.abs(dq).max() == pytest.approx(0.05)
