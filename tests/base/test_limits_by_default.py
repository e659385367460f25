"""Joint limits are kept unless somebody says limits=False: every argument, every start posture, every answer."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import holokin as hk
from holokin.base.errors import HolokinError, JointLimitError
from holokin.motion.ik import InverseStatus
from holokin.strategies import HolonomicStrategy
from public_nouns import public_classes, rooms

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
    "self_motion": lambda law, q: hk.strategies.self_motion(law.task, q),
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


@given(st.integers(0, 10**6))
def test_no_answer_is_beyond_the_limits(seed: int) -> None:
    """Poses of random postures, within the limits and beyond, and poses out of reach."""
    law, q0, rng = narrow(seed)
    robot = law.task.robot
    postures = q0 + rng.uniform(-0.8, 0.8, (40, 3))
    points = np.vstack([robot.pose_batch(postures)[0][:, :2], rng.uniform(-4, 4, (5, 2))])
    ik, free = hk.ik(law, q0), hk.ik(law, q0, limits=False)
    found, all_ = ik.batch(points), free.batch(points)
    assert robot.within(found.q[found.reached]).all()
    beyond = all_.reached & ~np.array([robot.within(q) for q in all_.q])
    assert (found.status[beyond] == InverseStatus.LIMIT).all() and np.array_equal(found.reached, all_.reached & ~beyond)
    for point in points[::9]:
        assert robot.beyond(ik.nearest(point, rcond=1e-3).q).max() < 1e-8
    for q, pose in ((q0, robot.pose(q0)), (postures[0], robot.pose(postures[0]))):
        postures_there = hk.motion.ik.all_postures(law, pose, law.g(q), starts=32)
        assert robot.within(postures_there.q).all()
    level = law.g(q0) + rng.uniform(-0.5, 0.5)
    try:
        assert robot.beyond(hk.motion.ik.move_to_leaf(law, q0, level)).max() < 1e-9
    except HolokinError:
        return
