"""Many postures in one call are the postures one by one: the rule of (n,) or (k, n), its errors, its native code."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.robot.formats.loading import catalogue
from holokin.symbolic import Function, symbol
from holokin.symbolic import function as function_module
from holokin.symbolic.native import toolchain as native

Patch = pytest.MonkeyPatch
PANDA = hk.load("panda")
ARM = hk.pose(PANDA)
HELD = hk.holonomic(ARM, hk.arm_angle())
compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")


def doors_of(robot: hk.Robot, task: hk.Task, held: hk.Strategy) -> dict[str, Callable]:
    """All that takes one posture or many."""
    weighted = hk.moore_penrose(task)
    return {
        "robot.pose": robot.pose,
        "robot.jacobian": robot.jacobian,
        "task": task,
        "task.jacobian": task.jacobian,
        "task.pose": task.pose,
        "G": held,
        "g": held.g,
        "rows": held.rows,
        "curvature": lambda q: hk.curvature(weighted, q),
    }


DOORS = doors_of(PANDA, ARM, HELD)
every = pytest.mark.parametrize("door", DOORS.values(), ids=DOORS)


def around(q0: np.ndarray, count: int, seed: int = 0) -> np.ndarray:
    return q0 + np.random.default_rng(seed).uniform(-0.2, 0.2, (count, len(q0)))


@pytest.mark.parametrize("count", [1, 11, 12, 33, 127, 128, 255, 257, 304, 390])
def test_a_batch_of_any_size_is_each_posture_alone(count: int) -> None:
    """On the virtual machine: in large chunks, in small ones, and one by one, to the last bit."""
    Q = around(PANDA_START, count)
    for door in (ARM.jacobian, HELD):
        assert np.array_equal(door(Q), [door(q) for q in Q])


def test_equal_functions_share_their_code_and_others_do_not() -> None:
    """Common operations are sought once: 5 us for each of thousands."""

    def code(factor: float) -> object:
        x = symbol("x", 2)
        return Function("f", {"x": x}, {"y": factor * x * x[0] + x[0]}).program.before

    assert code(2.0) is code(2.0) and code(3.0) is not code(2.0)


@sampled(6, "name", sorted(catalogue()))
def test_a_robot_at_many_postures_is_the_robot_at_each(name: str) -> None:
    robot = hk.load(name)
    Q = around(np.zeros(robot.n), 70)
    for tip in robot.tips:
        poses, slopes = robot.pose(Q, tip.name), robot.jacobian(Q, tip.name)
        assert poses.shape == (70, 4, 4)
        assert slopes.shape == (70, 6, robot.n)
        for k in (0, 63, 64, 69):
            assert np.array_equal(poses[k], robot.pose(Q[k], tip.name))
            assert np.array_equal(slopes[k], robot.jacobian(Q[k], tip.name))
        h = 1e-6 * np.eye(robot.n)[0]
        moved = (robot.pose(Q + h, tip.name) - robot.pose(Q - h, tip.name))[:, :3, 3] / 2e-6
        assert np.abs(moved - slopes[:, :3, 0]).max() < 1e-8  # the column of the first joint is how the tool moves


@compiled
@every
def test_native_code_agrees_with_the_virtual_machine(door: Callable, monkeypatch: Patch) -> None:
    Q = around(PANDA_START, 500)
    machine = door(Q)
    monkeypatch.setattr(function_module, "NATIVE_FROM", 1)
    assert np.abs(door(Q) - machine).max() < 1e-13 * max(1.0, np.abs(machine).max())


def test_the_poses_of_postures_are_what_inverse_kinematics_takes(monkeypatch: Patch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # twenty poses are no compiler's work
    ik = hk.ik(HELD, PANDA_START)
    wanted = PANDA.pose(PANDA_START) + np.zeros((20, 1, 1))
    wanted[:, :3, 3] += np.random.default_rng(1).uniform(-0.05, 0.05, (20, 3))
    found = ik.batch(wanted)
    assert found.reached.all()
    assert np.abs(PANDA.pose(found.q) - wanted).max() < 1e-10
    assert np.abs(HELD.g(found.q) - HELD.g(PANDA_START)).max() < 1e-10


@every
def test_no_posture_gives_no_result_and_lists_are_arrays(door: Callable) -> None:
    one, Q = door(PANDA_START), around(PANDA_START, 3)
    assert door(np.empty((0, 7))).shape == (0, *one.shape)
    assert np.array_equal(door(Q.tolist()), door(Q))
    assert np.array_equal(door(np.asfortranarray(Q)[::-1]), door(Q)[::-1])
    assert np.array_equal(door(PANDA_START[None]), one[None])


@every
def test_a_wrong_shape_or_number_is_told(door: Callable) -> None:
    Q = around(PANDA_START, 5)
    with pytest.raises(hk.HolokinError, match=r"q has shape \(5, 6\), expected \(7,\) or \(k, 7\)"):
        door(Q[:, :6])
    with pytest.raises(hk.HolokinError, match=r"q has shape \(1, 5, 7\)"):
        door(Q[None])
    Q[3, 2] = np.nan
    with pytest.raises(hk.HolokinError, match="posture 3: NaN or infinite numbers, panda_joint3 nan"):
        door(Q)


@pytest.mark.parametrize("door", [HELD, DOORS["curvature"]], ids=["G", "curvature"])
def test_the_first_singular_posture_is_told(door: Callable) -> None:
    Q = around(PANDA_START, 9)
    Q[4:6] = 0.0
    with pytest.raises(hk.HolokinError, match=r"q = \[0, 0, 0, 0, 0, 0, 0\]"):
        door(Q)


def test_an_arm_of_one_joint_knows_one_posture_from_many() -> None:
    robot = hk.from_dh([{"a": 0.4}])
    assert robot.pose([0.3]).shape == (4, 4)
    assert robot.pose([[0.3]]).shape == (1, 4, 4)
    assert robot.pose([[0.3], [0.4]]).shape == (2, 4, 4)


def test_what_has_one_posture_alone_says_so() -> None:
    for single in (ARM.null_space, ARM._place, HELD.distribution, HELD.H):
        with pytest.raises(hk.HolokinError, match=r"q has shape \(2, 7\), expected \(7,\)"):
            single(around(PANDA_START, 2))


@pytest.mark.usefixtures("optimized")
@compiled
@pytest.mark.campaign
def test_other_threads_run_while_a_batch_does() -> None:
    Q = around(PANDA_START, 400_000)
    HELD(Q)
    ticks, done = [], threading.Event()

    def tick() -> None:
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    other = threading.Thread(target=tick)
    other.start()
    latest = time.perf_counter()
    PANDA.jacobian(Q)
    HELD.batch(Q, threads=1)
    lasted = time.perf_counter() - latest
    done.set()
    other.join()
    assert len(ticks) > 20 * lasted  # a lock that is kept lets it tick twice


@pytest.mark.campaign
@pytest.mark.usefixtures("optimized")
@compiled
def test_a_posture_of_many_costs_at_most_one_and_a_half_of_one_of_the_gain() -> None:
    """Processor time, the least of five: the other doors are of shorter expressions."""
    Q = around(PANDA_START, 60_000)

    def cost(door: Callable) -> float:
        door(Q)
        times = []
        for _ in range(5):
            begin = time.process_time()
            door(Q)
            times.append(time.process_time() - begin)
        return min(times)

    robot = replace(PANDA)  # without the native code that this process has
    task = hk.pose(robot)
    held = hk.holonomic(task, hk.arm_angle())
    limit = 1.5 * cost(held.batch)
    for name, door in doors_of(robot, task, held).items():
        if name != "curvature":  # of 252 numbers where G has 42
            assert cost(door) < limit, name
