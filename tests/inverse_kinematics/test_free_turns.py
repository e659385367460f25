"""A motion that the task leaves free is no demand: poses that the task cannot tell apart have the same answers.

What is free is written down anew here, by SciPy's rotations: a turn about the axis that an axis task or two Euler
angles keep, any rotation of a tool whose position alone counts, a way along a coordinate without a row.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import sampled
from holokin.base.types import Array, Matrix, Vector
from holokin.errors import HolokinError

STARTS = {
    "irb140": [0.2, 1.0, 0.2, 0.3, 0.9, 0.5],
    "ur5e": [0.2, -1.2, 1.4, -1.3, -1.4, 0.5],
    "panda": [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5],
}
AXIS = np.array([0.6, 0.0, 0.8])

Change = Callable[[Matrix, float], Matrix]
"""(pose (4, 4), amount) -> a pose that the task cannot tell from it."""


def turned(axis: str | Vector, of_base: bool = False) -> Change:
    """Turns about an axis of the tool or of the base, the tool's point at rest."""
    along = np.eye(3)["xyz".index(axis)] if isinstance(axis, str) else axis

    def change(X: Matrix, amount: float) -> Matrix:
        R, Y = Rotation.from_rotvec(amount * along).as_matrix(), X.copy()
        Y[:3, :3] = R @ X[:3, :3] if of_base else X[:3, :3] @ R
        return Y

    return change


def moved(*axes: int) -> Change:
    """Ways along coordinates of the position."""

    def change(X: Matrix, amount: float) -> Matrix:
        Y = X.copy()
        Y[list(axes), 3] += 0.3 * amount
        return Y

    return change


def in_turn(*changes: Change) -> Change:
    """One after the other."""

    def change(X: Matrix, amount: float) -> Matrix:
        for one in changes:
            X = one(X, amount)
        return X

    return change


def middle_angle(X: Matrix, amount: float) -> Matrix:
    """Another theta of the ZYZ angles, from 0 to pi."""
    phi, theta, psi = Rotation.from_matrix(X[:3, :3]).as_euler("ZYZ")
    Y = X.copy()
    Y[:3, :3] = Rotation.from_euler("ZYZ", [phi, np.clip(theta + 0.2 * np.sin(amount), 0.3, 2.8), psi]).as_matrix()
    return Y


KINDS: dict[str, tuple[Callable[[hk.Robot], hk.Task], Change]] = {
    "axis": (lambda robot: hk.pose(robot, "axis"), turned("z")),
    "oblique axis": (lambda robot: hk.pose(robot, "axis", axis=AXIS), turned(AXIS)),
    "without psi": (lambda robot: hk.pose(robot, "zyz")[[0, 1, 2, 3, 4]], turned("z")),
    "without phi": (lambda robot: hk.pose(robot, "zyz")[[0, 1, 2, 4, 5]], turned("z", of_base=True)),
    "without theta": (lambda robot: hk.pose(robot, "zyz")[[0, 1, 2, 3, 5]], middle_angle),
    "without roll": (lambda robot: hk.pose(robot, "rpy")[[0, 1, 2, 4, 5]], turned("x")),
    "without yaw": (lambda robot: hk.pose(robot, "rpy")[[0, 1, 2, 3, 4]], turned("z", of_base=True)),
    "position": (hk.position, in_turn(turned("x"), turned(AXIS, of_base=True))),
    "x and z": (lambda robot: hk.position(robot, rows=(0, 2)), in_turn(moved(1), turned("y"))),
    "no height": (lambda robot: hk.pose(robot, rows=(0, 1, 3, 4, 5)), moved(2)),
    "axis over a plane": (lambda robot: hk.pose(robot, "axis", rows=(1, 2, 3, 4)), in_turn(moved(0), turned("z"))),
}


def case(kind: str, seed: int) -> tuple[hk.InverseKinematics, Change]:
    """A random arm of three, with a random tool and base, a random law and a start at which both are regular."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    of, change = KINDS[kind]
    while True:
        name = str(rng.choice(list(STARTS)))
        tool = hk.with_tool(hk.load(name), rng.uniform(-0.1, 0.2, 3), rng.uniform(-0.8, 0.8, 3))
        robot = hk.with_base_pose(tool, rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3))
        task, q0 = of(robot), np.array(STARTS[name]) + rng.uniform(-0.2, 0.2, robot.n)
        law = hk.holonomic(task, hk.linear(rng.normal(size=(robot.n - task.m, robot.n))))
        try:
            if law.gain(q0)[1] > 0.02 and law.gain(q0)[2] > 0.2:
                return hk.inverse(law, q0, False), change
        except HolokinError:
            continue


def near_and_far(T: Matrix, rng: np.random.Generator, count: int) -> Array:
    """Poses 0.1 mm to 20 cm from one, turned by as many radians, and itself."""
    X = np.tile(T, (count, 1, 1))
    sizes = np.geomspace(1e-4, 0.2, count)[:, None]
    X[:, :3, 3] += sizes * rng.normal(size=(count, 3))
    X[:, :3, :3] = Rotation.from_rotvec(2 * sizes * rng.normal(size=(count, 3))).as_matrix() @ X[:, :3, :3]
    X[0] = T
    return X


def amounts(rng: np.random.Generator, count: int) -> Vector:
    """From 1e-6 to 3 rad, either way."""
    return np.geomspace(1e-6, 3.0, count)[rng.permutation(count)] * rng.choice([-1.0, 1.0], count)


def same(a: Array, b: Array, off: float = 1e-9) -> bool:
    return a.shape == b.shape and bool(np.all((np.abs(a - b) <= off) | (np.isnan(a) & np.isnan(b))))


def told(call: Callable[[], Vector]) -> Vector | str:
    try:
        return call()
    except HolokinError as problem:
        return type(problem).__name__


def check_answers(kind: str, seed: int, count: int) -> int:
    """How many poses were reached; each, and what is said of the others, whatever the free part of the pose is."""
    (ik, change), rng = case(kind, seed), np.random.default_rng(seed)
    task, T = ik.strategy.task, ik.strategy.task.pose(ik.q0)
    X = near_and_far(T, rng, count)
    Y = np.array([change(x, a) for x, a in zip(X, amounts(rng, count), strict=True)])
    for x, y in zip(X, Y, strict=True):
        assert same(*(task.error(ik.q0, one[:3, 3], one[:3, :3]) for one in (x, y))), "these are no free motions"
    a, b = ik.batch(X), ik.batch(Y)
    np.testing.assert_array_equal(a.status, b.status)
    assert same(a.q, b.q) and a.reached[0] and same(b.q[0], ik.q0)
    last = ik.q0
    for x, y, q in zip(X, Y, a.q, strict=True):
        if not np.isfinite(q).all():
            continue
        assert same(ik(y), q) and same(ik.near(y, q), q), "the answer is led to itself"
        one, other = told(lambda x=x: ik.near(x, last)), told(lambda y=y: ik.near(y, last))  # noqa: B023
        assert one == other if isinstance(one, str) else same(one, other)  # type: ignore[arg-type]
        last = q
    for x, y in zip(X[::3], Y[::3], strict=True):
        one, other = ik.nearest(x, rcond=0.01), ik.nearest(y, rcond=0.01)
        assert one.status is other.status and same(one.q, other.q, 1e-7)
    return int(a.reached.sum())


@sampled(2, "kind", KINDS)
def test_what_a_task_leaves_free_changes_no_answer(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the virtual machine; `ik(pose)`, `near`, `nearest` and `batch`."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    assert check_answers(kind, 0, 5) > 2


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("native", ["1", "0"])
def test_it_changes_none_of_many_arms(kind: str, native: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By native code, too."""
    monkeypatch.setenv("HOLOKIN_NATIVE", native)
    assert sum(check_answers(kind, seed, 13) for seed in range(3)) > 12
