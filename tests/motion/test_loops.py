"""Loops along paths: native code and Python take the same steps, halt at the same place, and keep nothing."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, campaign, sampled
from holokin.base.errors import (
    LimitReachedError,
    OutOfReachError,
    PathError,
    PathSingularityError,
    ShapeError,
    SingularityError,
)
from holokin.motion import follow_path as following
from holokin.motion.ik.leaf import leaf_step
from holokin.motion.ik.plan import NativeFollower
from holokin.symbolic import function as function_module
from holokin.symbolic.native import toolchain as native

Patch = pytest.MonkeyPatch
compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")
POINT = hk.load("panda").pose(PANDA_START)[:3, 3]
CORNERS = POINT + np.array([[0, 0, 0], [0, 0.08, 0], [0, 0.08, 0.08], [0, 0, 0]])
TURNS = np.array([[0.3, 0, 0], [0, 0, 0], [-0.3, 0, 0]])
TASKS = {"twist": hk.pose, "rpy": lambda r: hk.pose(r, "rpy"), "position": hk.position}


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Of this file: nothing of an earlier run is loaded, and what two tests use is built once."""
    with Patch.context() as patch:
        patch.setenv("HOLOKIN_CACHE", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture
def natively(monkeypatch: Patch) -> list[int]:
    """Steps that native code did, one entry a call of it."""
    did: list[int] = []
    run = NativeFollower.run

    def counted(self: NativeFollower, *arguments) -> int:
        did.append(run(self, *arguments))
        return did[-1]

    monkeypatch.setattr(NativeFollower, "run", counted)
    return did


def both(run: Callable[[], object], monkeypatch: Patch) -> list:
    """What `run` gives by native code and by Python; an error counts as what it gives."""
    out: list = []
    for native_from in (1, 10**9):
        monkeypatch.setattr(following, "NATIVE_FROM", native_from)
        monkeypatch.setenv("HOLOKIN_NATIVE", str(int(native_from == 1)))
        try:
            out.append(run())
        except PathError as problem:
            out.append(problem)
    return out


@compiled
def test_following_by_native_code_is_the_same_to_1e_14(monkeypatch: Patch, natively: list[int]) -> None:
    """A circle and a polygon with turns, several cycles, and a start in the middle of nothing special."""
    robot = hk.load("panda")
    point = robot.pose(PANDA_START)[:3, 3]
    corners = point + np.array([[0, 0, 0], [0, 0.08, 0], [0, 0.08, 0.08], [0, 0, 0]])
    turns = np.array([[0.3, 0, 0], [0, 0, 0], [-0.3, 0, 0]])
    for path in (hk.circle(point, point - [0.1, 0, 0]), hk.polyline(corners, turns=turns)):
        walks = []
        for native_from in (1, 10**9):
            natively.clear()
            monkeypatch.setattr(following, "NATIVE_FROM", native_from)
            monkeypatch.setenv("HOLOKIN_NATIVE", str(int(native_from == 1)))
            strategy = hk.holonomic(hk.pose(robot), hk.arm_angle())
            walks.append(hk.follow(strategy, path, PANDA_START, samples=150, cycles=3))
            assert sum(natively) == (len(walks[0]) - 1 if native_from == 1 else 0)
        assert np.abs(walks[0].q - walks[1].q).max() < 1e-14
        assert walks[0].t == pytest.approx(walks[1].t)
        assert np.abs(walks[0].drift()).max() < 1e-13


@compiled
def test_native_following_halts_where_the_machine_does(monkeypatch: Patch, natively: list[int]) -> None:
    robot = hk.load("panda")
    point = robot.pose(PANDA_START)[:3, 3]
    held = hk.holonomic(hk.pose(robot), hk.lock(2))
    for path, error in (
        (hk.line(point, point + [2.0, 0, 0]), OutOfReachError),
        (hk.line(point, point - [0.35, 0, 0.2]), LimitReachedError),
    ):
        ends = []
        for native_from in (1, 10**9):
            natively.clear()
            monkeypatch.setattr(following, "NATIVE_FROM", native_from)
            monkeypatch.setenv("HOLOKIN_NATIVE", str(int(native_from == 1)))
            with pytest.raises(error) as caught:
                hk.follow(held, path, PANDA_START, samples=200)
            ends.append(caught.value.trajectory)
            assert sum(natively) == (len(ends[0]) - 1 if native_from == 1 else 0)
        assert 20 < len(ends[0]) == len(ends[1]) < 200
        assert ends[0].status is ends[1].status
        assert np.abs(ends[0].q - ends[1].q).max() < 1e-12


@compiled
@sampled(1, "name", TASKS)
@pytest.mark.parametrize("path", [hk.circle(POINT, POINT - [0.1, 0, 0]), hk.polyline(CORNERS, turns=TURNS)])
def test_velocity_takes_the_same_steps(name: str, path: hk.Path, monkeypatch: Patch) -> None:
    strategy = hk.moore_penrose(TASKS[name](hk.load("panda")))
    ours, theirs = both(lambda: hk.follow(strategy, path, PANDA_START, samples=150, cycles=2), monkeypatch)
    assert np.abs(ours.q - theirs.q).max() < 1e-14
    assert np.array_equal(ours.t, theirs.t)
    assert np.abs(theirs.drift()).max() > 1e-3


@pytest.mark.campaign
@compiled
@pytest.mark.parametrize(
    ("path", "error"),
    [
        (hk.line(POINT, POINT + [2.0, 0, 0]), OutOfReachError),
        (hk.line(POINT, POINT - [0.35, 0, 0.2]), LimitReachedError),
    ],
)
def test_velocity_halts_where_python_does(path: hk.Path, error: type[Exception], monkeypatch: Patch) -> None:
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    ours, theirs = both(lambda: hk.follow(strategy, path, PANDA_START, samples=300, method="velocity"), monkeypatch)
    assert type(ours) is type(theirs) is error
    assert str(ours) == str(theirs)
    assert np.abs(ours.trajectory.q - theirs.trajectory.q).max() < 1e-12
    assert len(ours.trajectory) > 20


@pytest.mark.campaign
@compiled
@sampled(1, "method", ["leaf", "velocity"])
def test_a_short_path_takes_native_code_that_is_there_and_builds_none(
    method: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    """What a long path built serves every later one; what an earlier process built, those that are worth a look."""
    monkeypatch.setenv("HOLOKIN_CACHE", str(tmp_path))
    loop, built, steps = hk.circle(POINT, POINT - [0.1, 0, 0]), [], []
    compile_it = native._built
    monkeypatch.setattr(native, "_built", lambda *arguments: built.append(1) or compile_it(*arguments))
    make = getattr(following, f"{method}_stepper")

    def counted(*of: object) -> Callable[[np.ndarray, int], np.ndarray]:
        step = make(*of)
        return lambda q, i: steps.append(1) or step(q, i)

    monkeypatch.setattr(following, f"{method}_stepper", counted)
    monkeypatch.setattr(following, "NATIVE_FROM", 100)
    monkeypatch.setattr(following, "CACHED_FROM", 50)

    def follow(strategy: hk.Strategy, samples: int) -> tuple[np.ndarray, int, int]:
        built.clear(), steps.clear()
        q = hk.follow(strategy, loop, PANDA_START, samples=samples, method=method).q
        return q, len(built), len(steps)

    first, later = (hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2)) for _ in range(2))
    assert native.enabled()  # which builds a library of its own
    assert follow(first, 20)[1:] == (0, 20)
    assert follow(first, 60)[1:] == (0, 60)
    assert follow(first, 100)[1:] == (1, 0)
    short, long = follow(first, 20), follow(first, 60)
    assert short[1:] == long[1:] == (0, 0)
    by_steps, loaded = follow(later, 20), follow(later, 60)
    assert by_steps[1:] == (0, 20)
    assert loaded[1:] == (0, 0)
    assert np.abs(by_steps[0] - short[0]).max() < 1e-13
    assert np.array_equal(loaded[0], long[0])
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    assert follow(first, 60)[1:] == (0, 60)


@pytest.mark.parametrize("native_from", [pytest.param(1, marks=compiled), 10**9])
def test_a_path_that_turns_into_a_gimbal_lock_stops_there_and_keeps_what_was_done(
    native_from: int, monkeypatch: Patch
) -> None:
    """The pitch grows to 90 degrees at nine tenths of the path."""
    monkeypatch.setattr(following, "NATIVE_FROM", native_from)
    monkeypatch.setenv("HOLOKIN_NATIVE", str(int(native_from == 1)))
    robot = hk.load("panda")
    q0 = PANDA_START
    strategy = hk.moore_penrose(hk.pose(robot, "rpy"))
    R = robot.pose(q0)[:3, :3]
    pitch, yaw = np.arcsin(-R[2, 0]), np.arctan2(R[1, 0], R[0, 0])
    axis = np.array([-np.sin(yaw), np.cos(yaw), 0.0])  # about the line of nodes the pitch alone changes
    path = hk.polyline([POINT, POINT + [1e-3, 0, 0]], turns=[axis * (np.pi / 2 - pitch) / 0.9])
    with pytest.raises(PathSingularityError, match="representation") as caught:
        hk.follow(strategy, path, q0, samples=100, limits=False)
    assert len(caught.value.trajectory) == 90


@pytest.mark.parametrize("native_from", [pytest.param(1, marks=compiled), campaign("native_from", 10**9)])
@pytest.mark.parametrize("method", ["leaf", "velocity"])
def test_following_allocates_its_outputs_and_no_more(method: str, native_from: int, monkeypatch: Patch) -> None:
    """q and t: 64 bytes a sample; targets and rates are made in blocks."""
    monkeypatch.setattr(following, "NATIVE_FROM", native_from)
    monkeypatch.setenv("HOLOKIN_NATIVE", str(int(native_from == 1)))
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle())
    loop = hk.circle(POINT, POINT - [0.1, 0, 0])
    short, long = (6_000, 18_000) if native_from == 1 else (3_000, 7_000)
    peaks = []
    hk.follow(strategy, loop, PANDA_START, samples=100, method=method)
    for samples in (short, long):
        tracemalloc.start()
        walk = hk.follow(strategy, loop, PANDA_START, samples=samples, method=method)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert len(walk) == samples + 1
    assert (peaks[1] - peaks[0]) / (long - short) < 1.1 * 8 * 8


@compiled
@sampled(3, ("joint", "end"), zip(range(7), cycle(["upper", "lower"]), strict=False))
def test_velocity_stops_at_either_limit_of_any_joint(joint: int, end: str, monkeypatch: Patch) -> None:
    """A robot whose one limit lies where the middle of an unlimited way is."""
    free = hk.load("panda")
    walk = hk.follow(hk.moore_penrose(hk.pose(free)), hk.circle(POINT, POINT - [0.1, 0, 0]), PANDA_START, samples=40)
    here = walk.q[:, joint]
    value = float((here.min() + PANDA_START[joint]) / 2 if end == "lower" else (here.max() + PANDA_START[joint]) / 2)
    assert abs(value - PANDA_START[joint]) > 1e-3
    joints = list(free.coordinates)
    joints[joint] = replace(joints[joint], **{end: value})
    strategy = hk.moore_penrose(hk.pose(replace(free, coordinates=tuple(joints))))
    loop = hk.circle(POINT, POINT - [0.1, 0, 0])
    ours, theirs = both(lambda: hk.follow(strategy, loop, PANDA_START, samples=40), monkeypatch)
    assert type(ours) is type(theirs) is LimitReachedError
    assert np.array_equal(ours.trajectory.q, theirs.trajectory.q)


@compiled
def test_batches_of_nothing_and_into_what_is_given(monkeypatch: Patch) -> None:
    """A constraint of no rows, and results written where the caller wants them, which must be fit for it."""
    monkeypatch.setattr(function_module, "NATIVE_FROM", 100)
    square = hk.holonomic(hk.position(hk.from_dh([{"a": 0.2}] * 2)), hk.custom(lambda q: [], rows=0))
    Q = np.random.default_rng(0).uniform(0.5, 1.0, (5000, 2))
    assert square.constraint_value.batch(Q).shape == (5000, 0)
    p, R = square.task.robot.pose_batch(Q)
    assert np.abs(leaf_step(square).batch(Q, p, R, np.zeros(0))[0]).max() < 1e-12
    gain = square.gain
    G, figures = np.empty((5000, 2, 2)), [np.empty(5000), np.empty(5000)]
    gain.batch(Q, out=[G, *figures])
    assert np.array_equal(G, gain.batch(Q)[0])
    for bad in (np.asfortranarray(G), G[::-1], G.astype(np.float32), G[:-1], G.tolist()):
        with pytest.raises(ShapeError, match="out"):
            gain.batch(Q, out=[bad, *figures])
    with pytest.raises(ShapeError, match="3 arrays"):
        gain.batch(Q, out=[G])


@compiled
def test_a_kernel_that_cannot_be_made_is_tried_once(monkeypatch: Patch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(function_module, "NATIVE_FROM", 100)
    monkeypatch.setattr(native, "PATIENCE", 1e-6)
    monkeypatch.setattr(native, "_told", set())  # what this process has warned of already
    strategy = hk.holonomic(hk.position(hk.from_dh([{"a": 0.2}] * 3)), hk.linear([1, 1, 0.3]))
    Q = np.random.default_rng(0).uniform(0.5, 1.0, (500, 3))
    for _ in range(3):
        assert strategy.batch(Q).shape == (500, 3, 2)
    assert len(caplog.records) == 1


def test_a_singular_posture_of_a_later_piece_is_named(monkeypatch: Patch) -> None:
    monkeypatch.setattr("holokin.symbolic.function.PIECE", 10)
    strategy = hk.moore_penrose(hk.pose(hk.load("panda")))
    Q = np.tile(PANDA_START, (45, 1))
    Q[37] = 0.0
    with pytest.raises(SingularityError, match=r"q = \[0, 0, 0, 0, 0, 0, 0\]"):
        strategy.batch(Q)


@pytest.mark.campaign
@pytest.mark.parametrize("native_from", [pytest.param(1, marks=compiled), 10**9])
def test_a_batch_allocates_its_outputs_and_no_more(native_from: int, monkeypatch: Patch) -> None:
    monkeypatch.setattr(function_module, "NATIVE_FROM", native_from)
    monkeypatch.setattr("holokin.symbolic.function.PIECE", 2_000)
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle())
    strategy.batch(np.tile(PANDA_START, (300, 1)))
    peaks = []
    for count in (10_000, 30_000):
        Q = PANDA_START + np.random.default_rng(0).uniform(-0.1, 0.1, (count, 7))
        tracemalloc.start()
        G = strategy.batch(Q)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert G[count // 2] == pytest.approx(strategy(Q[count // 2]), rel=1e-11)
    assert (peaks[1] - peaks[0]) / 20_000 < 1.02 * 8 * 42
