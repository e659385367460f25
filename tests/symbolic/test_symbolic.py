"""Expressions: rotations where they are 0/0, orthogonal solves, derivatives, and `Function`."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.base.errors import ArgumentError, ExpressionError, ShapeError
from holokin.robot.formats.loading import catalogue
from holokin.symbolic import Function, factorise, hessian, jacobian, parse, solve, symbol
from holokin.symbolic import function as function_module
from holokin.symbolic.native import toolchain as native
from holokin.symbolic.rotations import log_so3, quaternion_wxyz, rotation_about, rpy_angles, wrapped, zyz_angles


def exp_so3(w: ca.SX) -> ca.SX:
    """exp([w]x), (3,) -> (3, 3): I + a [w]x + b [w]x^2, a = sin t / t, b = (1 - cos t) / t^2."""
    t2 = ca.dot(w, w)
    small = t2 < 1e-4
    safe = ca.if_else(small, 1, t2)
    t = ca.sqrt(safe)
    a = ca.if_else(small, 1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42)), ca.sin(t) / t)
    half = ca.sin(t / 2)  # 2 sin^2(t/2) = 1 - cos t without cancellation
    b = ca.if_else(small, 0.5 - t2 / 24 * (1 - t2 / 30 * (1 - t2 / 56)), 2 * half * half / safe)
    K = ca.skew(w)
    return ca.SX.eye(3) + a * K + b * (K @ K)


w, R = symbol("w", 3), symbol("R", 3, 3)
EXP = Function("exp", {"w": w}, {"R": exp_so3(w), "dR": jacobian(exp_so3(w), w)})
LOG = Function("log", {"R": R}, {"w": log_so3(R), "dw": jacobian(log_so3(R), R)})
QUATERNION = Function("quaternion", {"R": R}, {"q": quaternion_wxyz(R)})
ROUND = Function("round", {"w": w}, {"w": log_so3(exp_so3(w)), "d": jacobian(log_so3(exp_so3(w)), w)})

directions = st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 0.1)
angles = st.sampled_from(
    [0.0, 1e-12, 1e-8, 1e-5, 0.009, 0.0101, 0.02, 0.5, 2.0, 3.0, 3.14159, np.pi - 1e-6, np.pi - 1e-9]
)


@given(directions, angles)
def test_exp_and_log_are_right_in_value_and_derivative_at_the_identity_and_near_a_half_turn(v, angle: float) -> None:
    vector = angle * np.array(v) / np.linalg.norm(v)
    rotation, slope = EXP(vector)
    assert np.abs(rotation - Rotation.from_rotvec(vector).as_matrix()).max() < 1e-15
    assert np.abs(rotation.T @ rotation - np.eye(3)).max() < 1e-15
    h = 1e-6
    for i, e in enumerate(np.eye(3) * h):
        numeric = (Rotation.from_rotvec(vector + e).as_matrix() - Rotation.from_rotvec(vector - e).as_matrix()) / (
            2 * h
        )
        assert np.abs(slope[:, i].reshape(3, 3, order="F") - numeric).max() < 1e-9
    back, d = ROUND(vector)
    assert np.abs(back - vector).max() < 1e-14
    assert np.abs(d - np.eye(3)).max() < 1e-8


@given(directions, st.sampled_from([0.0, 1e-6, 1.0, 2.5, np.pi, np.pi - 1e-12]))
def test_quaternions_agree_with_scipy_also_at_a_half_turn(v, angle: float) -> None:
    rotation = Rotation.from_rotvec(angle * np.array(v) / np.linalg.norm(v))
    q = QUATERNION(rotation.as_matrix())
    expected = np.roll(rotation.as_quat(), 1)
    assert min(np.abs(q - expected).max(), np.abs(q + expected).max()) < 1e-15
    assert q[0] >= 0
    assert np.isfinite(LOG(rotation.as_matrix())[1]).all()


def test_euler_angles_agree_with_scipy() -> None:
    f = Function("angles", {"R": R}, {"zyz": zyz_angles(R), "rpy": rpy_angles(R)})
    for rotation in Rotation.random(50, rng=np.random.default_rng(0)):
        zyz, rpy = f(rotation.as_matrix())
        phi, theta, psi = zyz
        rebuilt = Rotation.from_euler("ZYZ", [phi, theta, psi])
        assert (rebuilt.inv() * rotation).magnitude() < 1e-14
        assert 0 <= theta <= np.pi
        assert (Rotation.from_euler("xyz", rpy).inv() * rotation).magnitude() < 1e-14


def test_rotation_about_an_axis_is_scipys() -> None:
    a = symbol("a", 1)
    for axis in (np.array([0, 0, 1.0]), np.array([0, -1.0, 0]), np.array([0.6, 0.0, 0.8])):
        f = Function("r", {"a": a}, {"R": rotation_about(axis, a)})
        for value in (0.0, 1e-9, 1.0, np.pi, -2.0):
            assert np.abs(f([value]) - Rotation.from_rotvec(value * axis).as_matrix()).max() < 1e-15


def test_wrapped_angles_lie_in_a_turn_and_keep_their_derivative() -> None:
    a = symbol("a", 1)
    f = Function("w", {"a": a}, {"a": wrapped(a), "d": jacobian(wrapped(a), a)})
    for value in (0.0, 3.0, 4.0, -4.0, 100.0):
        angle, slope = f([value])
        assert angle == pytest.approx((value + np.pi) % (2 * np.pi) - np.pi, abs=1e-13)
        assert slope == pytest.approx(1.0, abs=1e-15)


A, B = symbol("A", 4, 4), symbol("B", 4, 2)
FACTORS = factorise(A)
SOLVE = Function(
    "solve",
    {"A": A, "B": B},
    {"X": solve(A, B), "side": FACTORS.orientation(), "cond": FACTORS.rcond(), "dX": jacobian(solve(A, B), A)},
)


def _hard_matrices() -> list[np.ndarray]:
    rng = np.random.default_rng(3)
    zero_first = rng.normal(size=(4, 4))
    zero_first[0, 0] = 0.0
    negative_zero = zero_first.copy()
    negative_zero[0, 0] = -0.0
    return [zero_first, negative_zero, np.eye(4)[[1, 2, 3, 0]], np.triu(rng.normal(size=(4, 4)) + 2), -np.eye(4)]


@pytest.mark.parametrize(
    "matrix", _hard_matrices(), ids=["zero", "minus zero", "permutation", "triangular", "minus one"]
)
def test_a_zero_first_entry_is_an_ordinary_posture_in_value_and_derivative(matrix: np.ndarray) -> None:
    b = np.random.default_rng(4).normal(size=(4, 2))
    X, side, cond, dX = SOLVE(matrix, b)
    assert np.abs(X - np.linalg.solve(matrix, b)).max() < 1e-13
    assert side == np.sign(np.linalg.det(matrix))
    assert 0 < cond <= 1
    for k in range(16):  # dX = -A^-1 dA X, the implicit function theorem
        dA = np.zeros(16)
        dA[k] = 1
        expected = -np.linalg.solve(matrix, dA.reshape(4, 4, order="F") @ X)
        assert np.abs(dX[:, k].reshape(4, 2, order="F") - expected).max() < 1e-11


def test_a_singular_matrix_has_no_conditioning() -> None:
    f = Function("c", {"A": A}, {"c": factorise(A).rcond()})
    assert f(np.zeros((4, 4))) != f(np.zeros((4, 4))) or f(np.zeros((4, 4))) == 0.0
    assert f(np.diag([1, 1, 1, 0.0])) == 0.0
    assert f(np.ones((4, 4))) < 1e-15


def test_the_thin_q_of_a_tall_matrix_is_an_orthonormal_basis_of_its_range() -> None:
    tall = symbol("T", 5, 3)
    f = Function("q", {"T": tall}, {"Q": factorise(tall).thin_q()})
    M = np.random.default_rng(5).normal(size=(5, 3))
    Q = f(M)
    assert np.abs(Q.T @ Q - np.eye(3)).max() < 1e-15
    assert np.abs(M - Q @ (Q.T @ M)).max() < 1e-14


def test_hessians_meet_finite_differences() -> None:
    q = symbol("q", 3)
    y = ca.sin(q[0] * q[1]) + q[2] ** 3 * q[0]
    f = Function("h", {"q": q}, {"g": jacobian(y, q).T, "H": hessian(y, q)})
    x, h = np.array([0.3, -0.7, 1.1]), 1e-6
    numeric = np.column_stack([(f(x + e)[0] - f(x - e)[0]) / (2 * h) for e in np.eye(3) * h])
    assert np.abs(f(x)[1] - numeric).max() < 1e-9


def test_a_function_checks_shapes_takes_names_and_returns_its_own_memory() -> None:
    q, M = symbol("q", 3), symbol("M", 2, 3)
    f = Function("f", {"q": q, "M": M}, {"y": M @ q, "s": ca.dot(q, q), "T": M.T})
    matrix = np.arange(6.0).reshape(2, 3)
    y, s, T = f([1, 2, 3], matrix)
    assert y == pytest.approx([8, 26])
    assert (s, type(s)) == (14.0, float)
    assert pytest.approx(matrix.T) == T
    again = f(q=[0, 0, 1], M=matrix)
    assert y == pytest.approx([8, 26])  # the second call has not overwritten the first result
    assert again[0] == pytest.approx([2, 5])
    for arguments in (([1, 2], matrix), ([1, 2, 3], matrix.T), ([1, 2, 3],), ([1, 2, 3], matrix, 1.0)):
        with pytest.raises(ShapeError):
            f(*arguments)
    with pytest.raises(ShapeError):
        f.batch(np.zeros((4, 3)), np.zeros((5, 2, 3)))
    with pytest.raises(ShapeError):
        f.batch(np.zeros((4, 2)), matrix)


@pytest.mark.parametrize("count", [0, 1, 63, 64, 255, 256, 257, 1000])
def test_a_batch_of_any_length_equals_single_calls(count: int) -> None:
    q, M = symbol("q", 3), symbol("M", 2, 3)
    f = Function("f", {"q": q, "M": M}, {"y": M @ ca.sin(q), "s": ca.dot(q, q), "T": M.T * q[0]})
    rng = np.random.default_rng(count)
    Q, Ms = rng.normal(size=(count, 3)), rng.normal(size=(count, 2, 3))
    for matrices in (Ms, Ms[0] if count else np.zeros((2, 3))):
        y, s, T = f.batch(Q, matrices)
        assert (y.shape, s.shape, T.shape) == ((count, 2), (count,), (count, 3, 2))
        for k in range(0, count, 50):
            single = f(Q[k], matrices[k] if matrices.ndim == 3 else matrices)
            assert np.array_equal(y[k], single[0])
            assert s[k] == single[1]
            assert np.array_equal(T[k], single[2])


def test_one_function_serves_several_threads() -> None:
    q = symbol("q", 50)
    f = Function("f", {"q": q}, {"y": ca.sin(q) * 2})
    wrong = []

    def work(seed: int) -> None:
        rng = np.random.default_rng(seed)
        for _ in range(500):
            x = rng.normal(size=50)
            if np.abs(f(x) - 2 * np.sin(x)).max() > 1e-14:
                wrong.append(seed)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_formulas_are_arithmetic_and_nothing_else() -> None:
    q = symbol("q", 2)
    names = {"q1": q[0], "elbow": q[1]}
    f = Function("f", {"q": q}, {"y": parse("-q1**2 + 2*sin(elbow)/pi - atan2(q1, 1) + 1e-3", names)})
    x = np.array([0.4, 1.2])
    assert f(x) == pytest.approx(-0.16 + 2 * np.sin(1.2) / np.pi - np.arctan2(0.4, 1) + 1e-3)
    for text in (
        "__import__('os')",
        "q1.real",
        "q3",
        "q1 if q1 else 2",
        "[1]",
        "sin(q1, q1)",
        "q1 +",
        "open('x')",
        "True",
        "1/0",
        "9.0**9**9",
    ):
        with pytest.raises(ExpressionError):
            parse(text, names)


WRONG = {
    "a truth value": (lambda q: q[0] if q[0] > 0 else q[1], "if_else"),
    "max": (lambda q: max(q[0], q[1]), "fmax"),
    "a matrix product": (lambda q: q @ q, "matrix product"),
    "an entry that is not there": (lambda q: q[7], "indices"),
    "NumPy": (lambda q: np.asarray(q)[0], "casadi's functions"),
    "iteration": (lambda q: sum(x for x in q), r"q\[0\]"),
    "two arguments": (lambda a, b: a, "one argument"),
    "a slip": (lambda q: q.foo, "AttributeError"),
    "division by zero": (lambda q: 1 / 0, "ZeroDivisionError"),
}


@pytest.mark.parametrize("kind", WRONG)
def test_a_function_that_was_not_written_for_symbols_is_told_with_its_cure(planar_3r: hk.Robot, kind: str) -> None:
    write, words = WRONG[kind]
    task, q = hk.position(planar_3r), [0.3, 0.9, 0.7]
    doors = (
        lambda: hk.holonomic(task, hk.custom(write)),
        lambda: hk.holonomic(task, hk.stationary(write)),
        lambda: hk.null_basis(task, write)(q),
        lambda: hk.weighted(task, write)(q),
        lambda: hk.strategies.pfaffian(task, write)(q),
        lambda: hk.strategies.right_inverse(task, write),
        lambda: hk.custom_task(planar_3r, write, units=("rad",)),
        lambda: hk.analysis.curvature.involutivity_of(write, 3),
    )
    for door in doors:
        with pytest.raises(ArgumentError if kind == "two arguments" else ExpressionError, match=words):
            door()


# --- Many postures in one call are the postures one by one: the rule of (n,) or (k, n), its errors, its native code.


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
