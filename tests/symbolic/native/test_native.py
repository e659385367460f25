"""Native code and the virtual machine: the same numbers, and a cache that survives what happens to caches."""

from __future__ import annotations

import multiprocessing
import os
import stat
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, Command
from holokin.base.errors import ArgumentError, NativeError, ShapeError
from holokin.motion.control_step import StepStatus
from holokin.symbolic import Function, sumsqr, symbol
from holokin.symbolic import function as function_module
from holokin.symbolic.native import engine
from holokin.symbolic.native import toolchain as native
from holokin.symbolic.native.kernel import BatchKernel
from holokin.version import build

Patch = pytest.MonkeyPatch
compiled = pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: Patch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("HOLOKIN_CACHE", str(folder))
    return folder


@pytest.fixture(scope="module")
def strategy() -> hk.Strategy:
    return hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle())


# --- the same numbers ---


@compiled
def test_every_operation_is_the_virtual_machines(cache: Path) -> None:
    """Over arguments small and large, both signs, and where a function has its kink."""
    x, y = symbol("x", 1), symbol("y", 1)
    plain = (
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan",
        "exp",
        "sinh",
        "cosh",
        "tanh",
        "fabs",
        "floor",
        "ceil",
        "sign",
    )
    unary = {name: getattr(ca, name)(x) for name in plain}
    outputs = unary | {
        "sqrt": ca.sqrt(ca.fabs(x)), "log": ca.log(ca.fabs(x)), "add": x + y, "sub": x - y, "mul": x * y, "div": x / y,
        "neg": -x, "sq": x * x, "inv": 1 / y, "atan2": ca.atan2(x, y), "pow": ca.fabs(x) ** y, "cube": x**3,
        "fmin": ca.fmin(x, y), "fmax": ca.fmax(x, y), "copysign": ca.copysign(x, y), "lt": x < y, "le": x <= y,
        "eq": x == y, "ne": x != y, "not": ca.logic_not(x < y), "and": ca.logic_and(x < 0, y < 0),
        "or": ca.logic_or(x < 0, y < 0), "if": ca.if_else(x < y, x, y), "hypot": ca.hypot(x, y), "fmod": ca.fmod(x, y),
    }  # fmt: skip
    f = Function("every", {"x": x, "y": y}, outputs)
    rng = np.random.default_rng(0)
    X = np.concatenate([rng.uniform(-1, 1, 400), rng.uniform(-700, 700, 100), [0.0, 0.5, -0.5, 1e5, -3e5, 1e9]])
    Y = np.concatenate([rng.uniform(0.1, 3, 250), rng.uniform(-3, -0.1, 250), [0.5, 0.5, 0.5, 2.0, -2.0, 3.0]])
    kernel = BatchKernel(f.program, list(f.input_shapes.values()), list(f.output_shapes.values()))
    results = [np.empty((len(X), 1)) for _ in outputs]
    kernel([X[:, None], Y[:, None]], results)
    for name, ours, theirs in zip(outputs, results, f.batch(X[:, None], Y[:, None]), strict=True):
        finite = np.isfinite(theirs)
        assert np.array_equal(np.isnan(ours[:, 0]), np.isnan(theirs)), name
        error = np.abs(ours[finite, 0] - theirs[finite]) / np.maximum(1, np.abs(theirs[finite]))
        assert error.max() < 1e-13, name


@compiled
def test_vector_sines_are_right_to_the_last_bits(cache: Path) -> None:
    x = symbol("x", 1)
    f = Function("sines", {"x": x}, {"s": ca.sin(x), "c": ca.cos(x)})
    kernel = BatchKernel(f.program, [(1,)], [(1,), (1,)])
    X = np.concatenate(
        [np.linspace(-50, 50, 20_001), np.arange(-40, 41) * np.pi / 4, [9.9e4, -9.9e4, 1.1e5, 1e300, np.inf]]
    )
    s, c = np.empty((len(X), 1)), np.empty((len(X), 1))
    kernel([X[:, None]], [s, c])
    with np.errstate(invalid="ignore"):
        assert np.nanmax(np.abs(s[:, 0] - np.sin(X))) < 3e-16
        assert np.nanmax(np.abs(c[:, 0] - np.cos(X))) < 3e-16
    assert np.isnan(s[-1, 0])


@compiled
@pytest.mark.parametrize("threads", [1, 2])
def test_a_large_batch_is_the_small_batches(
    cache: Path, strategy: hk.Strategy, monkeypatch: Patch, threads: int
) -> None:
    """Well-conditioned postures to 1e-12; odd counts; a repeated argument."""
    Q = PANDA_START + np.random.default_rng(2).uniform(-0.2, 0.2, (9001, 7))
    machine = strategy.rate.batch(Q, np.arange(6.0))
    monkeypatch.setattr(function_module, "NATIVE_FROM", 1)
    ours = strategy.rate.batch(Q, np.arange(6.0), threads=threads)
    assert strategy.rate._natives["batch"] is not None
    for a, b in zip(ours, machine, strict=True):
        assert a.shape == b.shape
        assert np.abs(a - b).max() < 1e-12 * max(1, np.abs(b).max())
    G = strategy.batch(Q)
    assert np.abs(G[17] - strategy(Q[17])).max() < 1e-12 * np.abs(G[17]).max()


@compiled
@pytest.mark.parametrize("count", [1, 1301])
def test_calls_in_a_row_are_single_calls_one_after_another(cache: Path, monkeypatch: Patch, count: int) -> None:
    """Springs of their own stiffness, whose place and speed go round; native code is taken once it pays."""
    x, v, k = symbol("x", 2), symbol("v", 2), symbol("k", 1)
    faster = v - k * x / 10
    spring = Function("spring", {"x": x, "v": v, "k": k}, {"x": x + faster / 10, "v": faster, "e": sumsqr(x)})
    monkeypatch.setattr(function_module, "LOADED_FROM", 1)
    monkeypatch.setattr(function_module, "NATIVE_FROM", 1)
    rng = np.random.default_rng(0)
    X, V, K = rng.normal(size=(count, 2)), rng.normal(size=(count, 2)), rng.uniform(1, 2, (count, 1))
    results = [spring.repeated(7, 2, X, V, K) for _ in range(2)]
    assert spring._natives["2 fed"] is not None
    places, speeds, energies = results[0]
    assert [a.shape for a in results[0]] == [(count, 7, 2), (count, 7, 2), (count, 7, 1)]
    for t in range(7):
        before = (X, V) if t == 0 else (places[:, t - 1], speeds[:, t - 1])
        once = spring.batch(*before, K, native_from=10**9)  # on the virtual machine
        assert np.array_equal(places[:, t], once[0]) and np.array_equal(speeds[:, t], once[1])
        assert np.array_equal(energies[:, t, 0], once[2])
    assert all(np.abs(a - b).max() < 1e-13 for a, b in zip(*results, strict=True))
    assert spring.repeated(7, 2, X[:0], V[:0], K[:0])[0].shape == (0, 7, 2)


# --- the control step ---


def servos(strategy: hk.Strategy, monkeypatch: Patch, **more) -> list[hk.motion.Controller]:
    """The same step as native code, where there is a compiler, and on the virtual machine."""
    out = []
    for flag in ("1", "0"):
        monkeypatch.setenv("HOLOKIN_NATIVE", flag)
        out.append(hk.controller(strategy, q0=PANDA_START, **{"dt": 1e-3} | more))
    monkeypatch.setenv("HOLOKIN_NATIVE", "1")
    return out


def test_both_engines_give_the_textbook_step(cache: Path, strategy: hk.Strategy, monkeypatch: Patch) -> None:
    """[J; J_g]^-1 [x' + K e; -K_g (g - c)], written again in NumPy."""
    robot, task = strategy.task.robot, strategy.task
    rng = np.random.default_rng(3)
    leaf = strategy.constraint_value(PANDA_START)
    for servo in servos(strategy, monkeypatch, gain=20.0, constraint_gain=30.0, limits=False, most_error=np.inf):
        for _ in range(5):
            q = PANDA_START + rng.uniform(-0.1, 0.1, 7)
            pose, dx = robot.pose(PANDA_START + rng.uniform(-0.1, 0.1, 7)), rng.uniform(-0.2, 0.2, 6)
            e = task.error(q, pose[:3, 3], pose[:3, :3]) - 1e-3 * dx  # to the pose wanted now, a step earlier
            gap = strategy.constraint_value(q) - leaf
            u = np.append(dx + 20.0 * e, -30.0 * np.arctan2(np.sin(gap), np.cos(gap)))
            expected = np.linalg.solve(np.vstack([task.jacobian(q), strategy.rows(q)]), u)
            assert np.abs(servo.step(q, pose, dx) - expected).max() < 1e-10 * max(1, np.abs(expected).max())
            assert servo.status is StepStatus.OK
            assert servo.scale == 1.0


def test_a_loop_with_feedback_to_the_leaf_comes_home_and_tracks(
    cache: Path, strategy: hk.Strategy, monkeypatch: Patch
) -> None:
    robot = strategy.task.robot
    point = robot.pose(PANDA_START)[:3, 3]
    loop = hk.circle(point, point - [0.1, 0, 0])
    ends = []
    for servo in servos(strategy, monkeypatch, dt=0.01):
        walk = hk.simulate(servo, strategy.task, loop, PANDA_START, dt=0.01, cycles=4)
        assert np.abs(walk.drift()[-1]).max() < 1e-9
        assert walk.tracking_error() < 2e-4
        ends.append(walk.q[-1])
    assert np.abs(ends[0] - ends[1]).max() < 1e-12


def test_a_speed_far_beyond_the_limits_is_slowed_and_no_joint_is_at_its_limit(
    cache: Path, strategy: hk.Strategy, monkeypatch: Patch
) -> None:
    pose = strategy.task.robot.pose(PANDA_START)
    for servo in servos(strategy, monkeypatch):
        dq = servo.step(PANDA_START, pose, np.array([50.0, 0, 0, 0, 0, 0]))
        assert servo.status is StepStatus.SLOWED
        assert np.abs(dq).max() > 0.5
        assert not servo.step(PANDA_START, pose, np.array([1e8, 0, 0, 0, 0, 0])).any()
        assert servo.status is StepStatus.LOST  # it would have come from 100 km away


def test_limits_slow_the_step_and_never_bend_it(cache: Path, strategy: hk.Strategy, monkeypatch: Patch) -> None:
    robot = strategy.task.robot
    pose = robot.pose(PANDA_START)
    fast = np.array([3.0, 0, 0, 0, 0, 0])
    for servo, free in zip(servos(strategy, monkeypatch), servos(strategy, monkeypatch, limits=False), strict=True):
        wish = free.step(PANDA_START, pose, fast)
        dq = servo.step(PANDA_START, pose, fast)
        assert servo.status is StepStatus.SLOWED
        assert dq == pytest.approx(servo.scale * wish, rel=1e-12)
        assert (np.abs(dq) / robot.max_velocity).max() == pytest.approx(1.0, rel=1e-9)


def test_a_joint_at_its_limit_is_held_there_and_free_to_leave_it(
    cache: Path, strategy: hk.Strategy, monkeypatch: Patch
) -> None:
    robot = strategy.task.robot
    slow = np.array([0.1, 0, 0, 0, 0, 0])
    engines, without = (servos(strategy, monkeypatch, limits=limits) for limits in (True, False))
    for servo, free in zip(engines, without, strict=True):
        for joint in (4, 5, 6):
            for bound, outward in ((robot.upper, 1.0), (robot.lower, -1.0)):
                at = PANDA_START.copy()
                at[joint] = bound[joint]
                for dx in (slow, -slow):
                    wish = free.step(at, robot.pose(at), dx).copy()
                    dq = servo.step(at, robot.pose(at), dx)
                    further = outward * wish[joint]  # [rad/s] into the limit
                    assert abs(further) > 0.01
                    assert servo.status is (StepStatus.LIMIT if further > 0 else StepStatus.OK)
                    assert dq == pytest.approx(np.zeros(7) if further > 0 else wish, abs=1e-12)


def test_bad_numbers_give_a_status_and_no_motion(cache: Path, strategy: hk.Strategy, monkeypatch: Patch) -> None:
    robot = strategy.task.robot
    pose, dx = robot.pose(PANDA_START), np.zeros(6)
    for servo in servos(strategy, monkeypatch):
        for bad in (np.nan, np.inf):
            for k in range(3):
                arguments = [PANDA_START.copy(), pose.copy(), dx.copy()]
                arguments[k].flat[3] = bad
                assert np.array_equal(servo.step(*arguments), np.zeros(7))
                assert servo.status is StepStatus.NOT_FINITE
        upright = np.zeros(7)
        assert np.array_equal(servo.step(upright, robot.pose(upright), dx), np.zeros(7))
        assert servo.status is StepStatus.SINGULAR
        servo.step(PANDA_START, pose, dx)
        assert servo.status is StepStatus.OK
        assert np.array_equal(
            servo.step(PANDA_START.tolist(), pose.tolist(), dx.tolist()), servo.step(PANDA_START, pose, dx)
        )
        for arguments, error in (
            ((PANDA_START[:3], pose, dx), ShapeError),
            ((PANDA_START, pose[:3], dx), ShapeError),
            ((PANDA_START, "there", dx), ArgumentError),
            ((PANDA_START[:, None], pose, dx), ShapeError),
            ((PANDA_START, pose.ravel(), dx), ShapeError),
            ((PANDA_START, pose.reshape(2, 8), dx), ShapeError),
            ((np.array(["a"] * 7), pose, dx), ArgumentError),
            ((PANDA_START, pose, dx[:3]), ShapeError),
            ((PANDA_START, pose), TypeError),  # as of every method
            ((PANDA_START, pose, dx, dx), ShapeError),  # a level of another size
        ):
            with pytest.raises(error):
                servo.step(*arguments)


def test_a_position_task_and_a_strategy_without_constraint_have_steps_too(cache: Path, monkeypatch: Patch) -> None:
    arm = hk.load("irb140")
    q = np.deg2rad([10.0, 70.0, 10.0, 20.0, 50.0, 30.0])
    given = hk.moore_penrose(hk.position(arm))
    for flag in ("1", "0"):
        monkeypatch.setenv("HOLOKIN_NATIVE", flag)
        servo = hk.controller(given, dt=1e-3, gain=0.0)
        dx = np.array([0.01, -0.02, 0.03])
        assert servo.step(q, arm.pose(q)[:3, 3].copy(), dx) == pytest.approx(given(q) @ dx, abs=1e-12)


def test_a_controller_is_refused_what_makes_no_sense(strategy: hk.Strategy) -> None:
    for more, said in (
        ({"dt": 0.0}, "dt"),
        ({"dt": "a"}, "dt"),
        ({"dt": 1e-3, "gain": [1]}, "gain"),
        ({"dt": 1e-3}, "q0"),
        ({"dt": 1e-3, "q0": PANDA_START, "gain": 5e3}, "unstable"),
        ({"dt": 1e-3, "q0": PANDA_START, "constraint_gain": np.nan}, "constraint_gain"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError, match=said):
            hk.controller(strategy, **more)


# --- the cache ---


@compiled
def test_a_library_is_built_once_and_a_spoilt_one_again(cache: Path) -> None:
    source = "double answer(void) { return 42.0; }"
    native.library(source)
    (first,) = cache.iterdir()
    stamp, whole = first.stat().st_mtime_ns, first.read_bytes()
    native.library(source)
    assert first.stat().st_mtime_ns == stamp
    for spoil in (b"", b"not a library", whole[:500], whole[:-64], whole[:-1], whole + b"0"):
        first.write_bytes(spoil)
        native.library(source)
        assert native.kept(first) == whole[:-64]
    assert list(cache.iterdir()) == [first]


def _build(folder: str, k: int) -> float:
    import ctypes

    os.environ["HOLOKIN_CACHE"] = folder
    loaded = native.library("double answer(void) { return 7.0; }")
    loaded.answer.restype = ctypes.c_double
    return loaded.answer() + 0 * k


@pytest.mark.campaign
@compiled
def test_several_processes_may_build_at_once(cache: Path) -> None:
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        assert pool.starmap(_build, [(str(cache), k) for k in range(4)]) == [7.0] * 4
    assert len(list(cache.glob(f"*{native.SUFFIX}"))) == 1


@compiled
def test_what_a_compiler_refuses_is_one_sentence(cache: Path) -> None:
    with pytest.raises(NativeError, match="refused the generated code"):
        native.library("double answer(void) { return nothing; }")


@pytest.mark.campaign
def test_without_a_compiler_everything_works_and_says_so(tmp_path: Path) -> None:
    """A process that finds no compiler: the same numbers, and one line on what ran."""
    code = (
        "import sys; sys.modules['ziglang'] = None;"  # a compiler, too, where it is installed
        "import numpy as np, holokin as hk; from holokin.symbolic.native import engine; print(engine());"
        "p = hk.load('panda'); q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5];"
        "s = hk.controller(hk.holonomic(hk.pose(p), hk.lock(2)), dt=1e-3, q0=q);"
        "print(s.engine); print(s.step(np.array(q), p.pose(q), np.ones(6) * 0.01)[0].hex())"
    )
    outputs = []
    for environment in ({"PATH": str(tmp_path), "CC": ""}, {"HOLOKIN_NATIVE": "0"}, {}):
        more = {"HOLOKIN_CACHE": str(tmp_path / "cache")}
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | environment | more,
            capture_output=True,
            text=True,
            check=True,
        )
        outputs.append(done.stdout.splitlines())
    assert "no C compiler found" in outputs[0][0]
    assert "HOLOKIN_NATIVE=0" in outputs[1][0]
    assert "virtual machine" in outputs[1][1]
    values = [float.fromhex(lines[2]) for lines in outputs]
    assert values[1] == pytest.approx(values[2], rel=1e-12)
    assert values[0] == pytest.approx(values[2], rel=1e-12)


@pytest.mark.skipif(not hasattr(os, "getuid") or os.getuid() == 0, reason="needs a user that is not root")
def test_a_cache_that_cannot_be_made_is_named(tmp_path: Path, monkeypatch: Patch) -> None:
    tmp_path.chmod(stat.S_IREAD | stat.S_IEXEC)
    monkeypatch.setenv("HOLOKIN_CACHE", str(tmp_path / "cache"))
    with pytest.raises(NativeError):
        native.cache_folder()


def test_the_engine_is_one_line() -> None:
    assert "\n" not in engine()


def test_the_command_says_what_runs(holokin: Command, monkeypatch: Patch) -> None:
    assert holokin("--version").out == f"holokin {build()}, {engine()}\n"
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    assert "virtual machine (HOLOKIN_NATIVE=0)" in holokin("--version").out
