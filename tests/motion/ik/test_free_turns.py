"""A motion that the task leaves free is no demand: poses that the task cannot tell apart have the same answers.

What is free is written down anew here, by SciPy's rotations: a turn about the axis that an axis task or two Euler
angles keep, any rotation of a tool whose position alone counts, a way along a coordinate without a row.
"""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from pathlib import Path
from shutil import which

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import sampled
from holokin.analysis.sheets.sheet import Sheet
from holokin.base.errors import HolokinError
from holokin.base.types import Array, Matrix, Vector
from holokin.export import export_c
from holokin.motion.ik import InverseKinematics

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


def case(kind: str, seed: int) -> tuple[InverseKinematics, Change]:
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
                return hk.ik(law, q0, False), change
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
    """What is found, or the name of the error."""
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
        one, other = (task.error(ik.q0, T[:3, 3], T[:3, :3]) for T in (x, y))
        assert same(one, other), "this is no free motion"
    a, b = ik.batch(X), ik.batch(Y)
    np.testing.assert_array_equal(a.status, b.status)
    assert same(a.q, b.q) and a.reached[0] and same(b.q[0], ik.q0)
    last = ik.q0
    for x, y, q in zip(X, Y, a.q, strict=True):
        if not np.isfinite(q).all():
            continue
        assert same(ik(y), q) and same(ik.near(y, q), q), "the answer is led to itself"
        one, other = told(lambda x=x: ik.near(x, last)), told(lambda y=y: ik.near(y, last))
        assert one == other if isinstance(one, str) else same(one, other)  # type: ignore[arg-type]
        last = q
    for x, y in zip(X[::3], Y[::3], strict=True):
        one, other = ik.nearest(x, rcond=0.01), ik.nearest(y, rcond=0.01)
        assert one.status is other.status and same(one.q, other.q, 1e-7)
    return int(a.reached.sum())


@sampled(1, "kind", KINDS)
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


def check_paths(kind: str, seed: int) -> bool:
    """Whether both lead to their ends: a path of a few centimetres, and the same with a growing free part; and that one
    of free motion alone rests."""
    (ik, change), rng = case(kind, seed), np.random.default_rng(seed)
    law, T = ik.strategy, ik.strategy.task.pose(ik.q0)
    turns = Rotation.from_rotvec(np.linspace(0, 0.1, 5)[:, None] * rng.normal(size=3)).as_matrix()
    X = np.tile(T, (5, 1, 1))
    X[:, :3, :3] = turns @ X[:, :3, :3]
    X[:, :3, 3] += np.linspace(0, 0.03, 5)[:, None] * rng.normal(size=3)
    t = np.linspace(0, 1, 5)
    Y, Z = (np.array([change(x, a) for x, a in zip(poses, t, strict=True)]) for poses in (X, [T] * 5))
    plain, spun, still = (hk.spline(poses, times=t) for poses in (X, Y, Z))
    rest = hk.follow(law, still, ik.q0, samples=8, limits=False)
    assert np.abs(rest.q - ik.q0).max() < 1e-9 and rest.t[-1] == 1.0
    a, b = (told(lambda path=path: hk.follow(law, path, ik.q0, samples=8, limits=False).q) for path in (plain, spun))
    if isinstance(a, str) or isinstance(b, str):
        assert isinstance(a, str) and a == b
        return False
    answers = ik.batch(Y)
    assert same(b[::2], answers.q) and same(a[::2], answers.q), "at its waypoints a path has the joints of their poses"
    assert all(hk.certify(law, path, ik.q0, limits=False).whole for path in (plain, spun, still))
    return True


@pytest.mark.campaign
@sampled(1, "kind", [kind for kind in KINDS if kind not in ("position", "x and z")])
def test_a_path_of_free_motion_alone_stands_still_and_on_others_it_changes_nothing(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    assert check_paths(kind, 1)


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_it_changes_no_path_of_many_arms(kind: str) -> None:
    assert sum(check_paths(kind, seed) for seed in range(2, 6)) > 2


def check_regions(kind: str, seed: int) -> None:
    """A small box about the start, given with another free part: the same cells, and the same poses belong to it."""
    (ik, change), rng = case(kind, seed), np.random.default_rng(seed)
    law, T = ik.strategy, ik.strategy.task.pose(ik.q0)
    boxes = [
        hk.workspace(box=(X[:3, 3], [0.0005] * 3), rotation=X[:3, :3], tilt=0.001, spin=0.002)
        for X in (T, change(T, 1.0), change(T, -0.3))
    ]
    wholes = [hk.certify(law, box, ik.q0, limits=False).whole for box in boxes]
    assert wholes[0] and wholes[1] == wholes[2] == wholes[0]
    region = hk.unique_region(law, ik.q0, boxes[0], limits=False)
    X = boxes[0].poses(40, seed)
    X[20:, :3, 3] += rng.uniform(-0.001, 0.001, (20, 3))
    Y = np.array([change(x, a) for x, a in zip(X, amounts(rng, 40), strict=True)])
    inside = region.contains(X)
    np.testing.assert_array_equal(region.contains(Y), inside)
    if not region.whole:
        return
    assert inside[:20].all() and region.contains(np.array([change(T, 2.0)])).all()
    within = hk.ik(law, ik.q0, False, region=region)
    free = hk.ik(law, ik.q0, False).batch(X[inside])
    assert same(within.batch(Y[inside]).q, free.q) and same(within(Y[0]), free.q[0])


@sampled(1, "kind", KINDS)
def test_a_region_has_its_own_poses_whatever_their_free_part(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    check_regions(kind, 7)


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_so_do_regions_of_many_arms(kind: str) -> None:
    for seed in range(8, 11):
        check_regions(kind, seed)


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_native_code_follows_as_the_virtual_machine_does(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Free motion and what the task sees, on one path."""
    (ik, change), rng = case(kind, 1), np.random.default_rng(1)
    law, T, t = ik.strategy, ik.strategy.task.pose(ik.q0), np.linspace(0, 1, 4)
    X = near_and_far(T, rng, 2)[[0, 1, 1, 1]]
    X[:, :3, 3] = T[:3, 3] + t[:, None] * 0.01 * rng.normal(size=3)
    X[:, :3, :3] = T[:3, :3]
    path = hk.spline(np.array([change(x, a) for x, a in zip(X, t, strict=True)]), times=t)
    fast = hk.follow(law, path, ik.q0, samples=20, limits=False, native=True)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    slow = hk.follow(hk.holonomic(law.task, law.constraint), path, ik.q0, samples=20, limits=False)
    assert same(fast.q, slow.q) and np.abs(fast.q[-1] - ik.q0).max() > 1e-4


@pytest.mark.campaign
@pytest.mark.skipif(which("cc") is None, reason="no C compiler")
@pytest.mark.parametrize("kind", [kind for kind, (of, _) in KINDS.items() if "pos" not in kind and kind != "x and z"])
def test_exported_c_leaves_free_what_the_task_does(kind: str, tmp_path: Path) -> None:
    """From the start, and from an answer nearby."""
    (ik, change), rng = case(kind, 2), np.random.default_rng(2)
    law = ik.strategy
    export_c(law, tmp_path, q0=ik.q0, name="arm", vectors_count=2)
    flags = ["-std=c99", "-O0", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, "arm.c", "-o", "arm.so", "-lm"], cwd=tmp_path, check=True, timeout=200)
    library = ctypes.CDLL(str(tmp_path / "arm.so"))
    X = near_and_far(law.task.pose(ik.q0), rng, 6)
    leaf, last, reached = np.atleast_1d(law.g(ik.q0)), ik.q0, 0
    for x, amount in zip(X, amounts(rng, 6), strict=True):
        y, answer = np.ascontiguousarray(change(x, amount)), ik.batch(x[None])
        for q, of in ((ik.q0.copy(), "solve"), (last.copy(), "inverse")):
            given = [q, y, leaf] if of == "inverse" else [q, y]
            status = getattr(library, f"arm_{of}")(*(ctypes.c_void_p(a.ctypes.data) for a in given), 10_000)
            if answer.reached[0]:
                assert status in (0, 1, 2) and same(q, answer.q[0])
                reached += 1
        last = answer.q[0] if answer.reached[0] else last
    assert reached > 5


@sampled(1, "kind", ["axis", "without yaw", "no height"])
def test_the_nearest_station_of_a_sheet_is_that_of_the_pose_whatever_its_free_part(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So the sheet takes the same joints for both."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    (ik, change), rng = case(kind, 3), np.random.default_rng(3)
    T = ik.strategy.task.pose(ik.q0)
    found = ik.batch(near_and_far(T, rng, 8))
    stations = found.q[found.reached]
    turns = rng.normal(size=len(stations))
    places = np.array([change(ik.strategy.task.pose(q), a) for q, a in zip(stations, turns, strict=True)])
    sheet = Sheet(ik.strategy, ik.q0, stations=stations, places=places)
    X = near_and_far(T, rng, 8)
    Y = np.array([change(x, a) for x, a in zip(X, amounts(rng, 8), strict=True)])
    for x, y in zip(X, Y, strict=True):
        assert np.array_equal(sheet.nearest_station(x), sheet.nearest_station(y))
    one, other = sheet.postures(X[:2]), sheet.postures(Y[:2])
    assert same(one[0], other[0]) and np.array_equal(one[1], other[1])


def test_each_frame_of_several_has_its_own_free_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """One hand of a two-armed robot may turn as it likes, the other one spin about its axis."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    robot = hk.load("yumi")
    one, other = (tip.name for tip in robot.tips[:2])
    task = hk.stacked(hk.position(robot, one), hk.pose(robot, "axis", tip=other))
    rng, q0 = np.random.default_rng(0), np.clip(np.full(robot.n, 0.4), robot.lower + 0.1, robot.upper - 0.1)
    law = hk.holonomic(task, hk.linear(rng.normal(size=(robot.n - task.m, robot.n))))
    ik, T = hk.ik(law, q0, False), task.pose(q0)
    for amount in (1e-6, 1.0):
        free = np.array([turned("x")(turned("y")(T[0], amount), 2 * amount), turned("z")(T[1], amount)])
        assert same(ik(free), q0) and same(ik.near(free, q0), q0)
        X, Y = T.copy(), free.copy()
        X[:, :3, 3] += 0.01
        Y[:, :3, 3] += 0.01
        assert same(ik(X), ik(Y)) and np.abs(ik(X) - q0).max() > 1e-3
