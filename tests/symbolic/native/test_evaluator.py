"""Functions called in loops: native code and the virtual machine agree, in numbers, in errors and in what they take."""

from __future__ import annotations

import gc
import os
import pickle
import subprocess
import sys
import threading
import time
import tracemalloc
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.base.errors import ArgumentError, NotFiniteError, ShapeError, SingularityError
from holokin.symbolic import Evaluator, Function, symbol
from holokin.symbolic.native import kernel, toolchain
from holokin.symbolic.native import toolchain as later
from holokin.symbolic.native import toolchain as native

Patch = pytest.MonkeyPatch
compiled = pytest.mark.skipif(native.compiler() is None or kernel._module() is None, reason="no C compiler here")


@pytest.fixture(autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: Patch) -> None:
    """One cache for all tests here, in which libraries are built once."""
    monkeypatch.setenv("HOLOKIN_CACHE", str(tmp_path_factory.getbasetemp() / "evaluators"))


@pytest.fixture(scope="module")
def strategy() -> hk.Strategy:
    return hk.holonomic(hk.pose(hk.load("panda"), "rpy"), hk.arm_angle())


Calls = dict[str, tuple[Callable[[object], object], Evaluator]]


def calls(strategy: hk.Strategy) -> Calls:
    """What users call in loops, with the evaluator of each."""
    task, robot = strategy.task, strategy.task.robot
    robot.pose(PANDA_START), robot.jacobian(PANDA_START)
    return {
        "G": (strategy, strategy._gain_at),
        "g": (strategy.g, strategy._constraint_at),
        "task": (task, task._value_at),
        "jacobian": (task.jacobian, task._jacobian_at),
        "pose": (robot.pose, robot._poses[None]),
        "geometric jacobian": (robot.jacobian, robot._jacobians[None]),
    }


@pytest.fixture(scope="module")
def both(strategy: hk.Strategy, tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Calls]]:
    """The same calls on the virtual machine, and as native code."""
    with pytest.MonkeyPatch.context() as within:
        within.setenv("HOLOKIN_CACHE", str(tmp_path_factory.getbasetemp() / "evaluators"))
        fast = calls(hk.holonomic(hk.pose(hk.load("panda"), "rpy"), hk.arm_angle()))
        for _, found in fast.values():
            found.work()
            assert found.native
    yield [calls(strategy), fast]


NAMES = ("G", "g", "task", "jacobian", "pose", "geometric jacobian")


# --- the same numbers ---


@compiled
@sampled(3, "name", NAMES)
def test_native_code_gives_the_numbers_of_the_virtual_machine(both: list[Calls], name: str) -> None:
    machine, fast = (calls[name] for calls in both)
    for q in PANDA_START + np.random.default_rng(5).uniform(-0.4, 0.4, (50, 7)):
        slow, quick = np.asarray(machine[1].machine(q)), np.asarray(fast[0](q))
        assert slow.shape == quick.shape
        assert np.abs(slow - quick).max() <= 1e-13 * np.abs(slow).max()


@pytest.mark.parametrize("name", NAMES)
def test_numbers_are_those_of_a_batch(both: list[Calls], strategy: hk.Strategy, name: str) -> None:
    """The batch is another way through: columns of many samples, on CasADi's own maps."""
    Q = PANDA_START + np.random.default_rng(6).uniform(-0.3, 0.3, (5, 7))
    task, robot = strategy.task, strategy.task.robot
    p, R = robot.pose_batch(Q)
    wanted = {
        "G": lambda: strategy.batch(Q),
        "g": lambda: strategy.constraint_value.batch(Q).reshape(-1, 1),
        "task": lambda: task.value_batch(Q),
        "jacobian": lambda: task.jacobian_batch(Q)[0],
        "pose": lambda: np.concatenate([np.dstack([R, p]), np.tile([[[0, 0, 0, 1]]], (5, 1, 1))], axis=1),
        "geometric jacobian": lambda: hk.pose(robot).jacobian_batch(Q)[0],
    }[name]()
    for found in both:
        assert np.abs([found[name][0](q) for q in Q] - wanted).max() < 1e-13 * np.abs(wanted).max()


class Kind(np.ndarray):
    """An array of somebody's own."""


@compiled
@sampled(1, "n", [2, 5, 12])
def test_planar_arms_of_any_size_agree(n: int) -> None:
    """Without redundancy there is no constraint row; twelve joints are solved by a dense factorisation."""
    arm = hk.from_dh([{"a": 1.0 / n} for _ in range(n)], name=f"{n}R")
    task = hk.position(arm)
    rows = np.random.default_rng(0).normal(size=(n - 2, n))
    strategy = hk.holonomic(task, hk.linear(rows) if n > 2 else hk.custom(lambda q: [], rows=0))
    q = np.linspace(0.2, 0.9, n)
    for call, found in ((strategy, strategy._gain_at), (strategy.g, strategy._constraint_at), (task, task._value_at)):
        slow = call(q)
        found.work()
        assert found.native
        fast = call(q)
        assert slow.shape == fast.shape
        assert np.abs(slow - fast).max(initial=0) <= 1e-12 * np.abs(slow).max(initial=0)
    assert strategy.g(q).shape == (n - 2,)
    assert np.abs(task.jacobian(q) @ strategy(q) - np.eye(2)).max() < 1e-12
    single = hk.moore_penrose(task[[0]])
    assert single(q).shape == (n, 1)
    assert single.task(q).shape == (1,)
    assert single.task.jacobian(q).shape == (1, n)


def layouts(q: np.ndarray) -> dict[str, object]:
    """The same seven numbers as everything that a caller may have."""
    wide, bytes_ = np.zeros((7, 3)), bytearray(8 * 7 + 1)
    wide[:, 1] = q
    odd = np.frombuffer(bytes_, dtype=float, count=7, offset=1)
    odd[:] = q
    frozen = q.copy()
    frozen.flags.writeable = False
    return {
        "list": q.tolist(), "tuple": tuple(q.tolist()), "strided": wide[:, 1], "backwards": q[::-1].copy()[::-1],
        "misaligned": odd, "read-only": frozen, "big-endian": q.astype(">f8"), "of a kind": q.view(Kind),
        "NumPy numbers": list(q), "float32": q.astype(np.float32), "objects": q.astype(object),
    }  # fmt: skip


@compiled
@pytest.mark.parametrize("name", NAMES)
def test_every_layout_of_the_same_numbers_gives_the_same(both: list[Calls], name: str) -> None:
    q = PANDA_START.astype(np.float32).astype(float)
    for found in both:
        call = found[name][0]
        wanted = np.asarray(call(q))
        for layout, given in layouts(q).items():
            assert np.abs(call(given) - wanted).max() <= 1e-13 * np.abs(wanted).max(), layout
        whole = np.asarray(call([1, -1, 0, -2, 1, 2, 1]))
        assert np.abs(whole - call(np.array([1, -1, 0, -2, 1, 2, 1.0]))).max() <= 1e-13 * np.abs(whole).max()


@compiled
def test_matrices_of_any_layout_are_arguments_too() -> None:
    """Several arguments and results: a vector, a matrix, a number; floats for single numbers."""
    x, A = symbol("x", 3), symbol("A", 2, 3)
    f = Function("affine", {"x": x, "A": A}, {"y": A @ x, "A": 2 * A.T, "s": x.T @ x})
    v, M = np.array([0.1, -2.0, 3.0]), np.arange(6.0).reshape(2, 3)
    f._one.work()
    assert f._one.native
    for call in (f, f._one.machine):
        for matrix in (M, np.asfortranarray(M), np.vstack([M, M])[::2][:, ::1] * 1.0, M.tolist(), M.astype(">f8")):
            y, doubled, s = call(v, matrix)
            assert np.allclose(y, np.asarray(matrix, dtype=float) @ v, rtol=1e-15)
            assert np.array_equal(doubled, 2 * np.asarray(matrix, dtype=float).T)
            assert doubled.flags.c_contiguous
            assert isinstance(s, float)
            assert s == pytest.approx(v @ v, rel=1e-15)
        assert np.array_equal(call(v, A=M)[0], call(v, M)[0])
        for wrong in ((v,), (v, M, M), (M, v), (v, M.T), (v[:2], M)):
            with pytest.raises(ShapeError):
                call(*wrong)


@pytest.mark.parametrize("name", NAMES)
def test_results_are_new_arrays_of_the_caller(both: list[Calls], name: str) -> None:
    for found in both:
        first, second = found[name][0](PANDA_START), found[name][0](PANDA_START)
        kept = first.copy()
        assert first.flags.owndata and first.flags.writeable and first.flags.c_contiguous
        second[...] = np.nan
        found[name][0](PANDA_START + 0.1)
        assert np.array_equal(first, kept)


# --- the same errors ---


@compiled
@pytest.mark.parametrize("name", NAMES)
def test_what_is_no_posture_is_refused_in_the_same_words(both: list[Calls], name: str) -> None:
    bad = PANDA_START.copy()
    bad[6] = np.nan
    far = PANDA_START.copy()
    far[2] = np.inf
    for given, error in (
        (bad, NotFiniteError), (far, NotFiniteError), (bad.tolist(), NotFiniteError), (PANDA_START[:6], ShapeError),
        (PANDA_START[:, None], ShapeError), (PANDA_START[:6].tolist(), ShapeError), (0.3, ShapeError),
        ("q", ArgumentError), (["0"] * 7, ArgumentError), (None, ArgumentError), ([True] * 7, ArgumentError),
        ([10**400] * 7, ArgumentError), ([[0.0], [0.0, 1.0]], ArgumentError), (PANDA_START * 1j, ArgumentError),
    ):  # fmt: skip
        said = []
        for found in both:
            with pytest.raises(error) as caught:
                found[name][0](given)
            said.append((type(caught.value), str(caught.value)))
        assert said[0] == said[1]


@compiled
def test_a_singular_posture_is_named_by_its_kind(both: list[Calls]) -> None:
    upright = np.zeros(7)
    for name, q in (("G", upright), ("jacobian", _pitched(both)), ("G", _pitched(both))):
        said = []
        for found in both:
            with pytest.raises(SingularityError) as caught:
                found[name][0](q)
            said.append((caught.value.kind, str(caught.value)[:60]))
        assert said[0] == said[1]


def _pitched(both: list[Calls]) -> np.ndarray:
    """A posture at which the roll-pitch-yaw angles of the hand are singular, by bisection along joint 6."""
    pose, q = both[0]["pose"][0], PANDA_START.copy()
    q[[0, 2, 4, 6]] = 0.0, 0.0, 0.0, np.pi / 4  # the hand turns about y alone

    def tilt(value: float) -> float:
        q[5] = value
        return pose(q)[2, 2]  # type: ignore[index]

    low, high = 1.0, 3.5
    assert tilt(low) * tilt(high) < 0
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if tilt(middle) * tilt(low) > 0 else (low, middle)
    q[5] = low
    return q


def test_huge_postures_have_poses(both: list[Calls]) -> None:
    """1e200 rad is a finite angle, though its square is not."""
    for found in both:
        T = found["pose"][0](np.full(7, 1e200))
        assert np.allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3))


def test_a_tip_is_a_name(panda: hk.Robot) -> None:
    for call in (panda.pose, panda.jacobian):
        assert np.array_equal(call(PANDA_START, panda.tips[0].name), call(PANDA_START, tip=None))
        for wrong in (["a"], 3, b"x"):
            with pytest.raises(ArgumentError, match="tip"):
                call(PANDA_START, wrong)
        with pytest.raises(hk.base.errors.UnknownNameError):
            call(PANDA_START, "nowhere")


def test_g_is_of_strategies_from_a_constraint(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    held = hk.holonomic(task, hk.lock(2))
    assert held.g(PANDA_START) == pytest.approx(PANDA_START[[2]], abs=1e-15)
    assert not hasattr(hk.moore_penrose(task), "g")


# --- what is kept ---


@pytest.mark.campaign
@compiled
def test_memory_does_not_grow_with_calls(both: list[Calls]) -> None:
    """Hundreds of calls of some as native code, some of them converted, some refused."""
    bad = PANDA_START * np.nan
    for name in NAMES[::3]:
        call = both[1][name][0]
        given = PANDA_START.tolist()

        def some(call: Callable[[object], object] = call, given: object = given) -> None:
            for k in range(200):
                call(PANDA_START if k % 2 else given)
                if k % 13 == 0:
                    with pytest.raises(NotFiniteError):
                        call(bad)
                    call(PANDA_START.astype(np.float32))

        some()
        gc.collect()
        tracemalloc.start()
        some()
        gc.collect()
        kept = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        assert kept < 8_000, name


# --- Native code takes over while calls go on: no call waits, no exit hangs, threads and forked processes have theirs.


@pytest.fixture
def builds(monkeypatch: Patch) -> list[str]:
    """The libraries that are asked for: (thread) each."""
    asked: list[str] = []
    real = kernel.library

    def library(*arguments: object, **named: object) -> object:
        asked.append(threading.current_thread().name)
        return real(*arguments, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(kernel, "library", library)
    return asked


@compiled
def test_the_first_calls_ask_no_compiler_and_later_ones_do_not_wait_for_it(builds: list[str]) -> None:
    x = symbol("x", 3)
    f = Function("first", {"x": x}, {"y": 3 * x})
    v = np.array([1.0, 2.0, 3.0])
    for _ in range(kernel.HEAVY - 1):
        f(v)
    assert later.idle(0.0)
    assert builds == []
    f(v)
    assert later.idle(60.0)
    assert set(builds) == {"holokin-later"}, "a compiler ran in the thread of the caller"
    assert f._one.native
    assert np.array_equal(f(v), 3 * v)


@compiled
def test_calls_go_on_while_a_compiler_runs(tmp_path: Path, monkeypatch: Patch) -> None:
    """A compiler that takes its time: the virtual machine answers meanwhile, and the numbers stay."""
    go = threading.Event()
    real = kernel.library
    monkeypatch.setattr(kernel, "library", lambda *a, **k: (go.wait(60), real(*a, **k))[1])
    monkeypatch.setattr(kernel, "HEAVY", 5)
    x = symbol("x", 3)
    f = Function("meanwhile", {"x": x}, {"y": 5 * x})
    v = np.array([1.0, 2.0, 3.0])
    for _ in range(1000):
        assert np.array_equal(f(v), 5 * v)
    assert not f._one.native
    go.set()
    assert later.idle(60.0)
    assert f._one.native
    assert np.array_equal(f(v), 5 * v)


def test_without_native_code_the_virtual_machine_goes_on(monkeypatch: Patch, builds: list[str]) -> None:
    monkeypatch.setattr(kernel, "HEAVY", 5)
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    x = symbol("x", 3)
    f = Function("machine", {"x": x}, {"y": 7 * x})
    v = np.array([1.0, 2.0, 3.0])
    for _ in range(100):
        assert np.array_equal(f(v), 7 * v)
    assert later.idle(60.0)
    assert builds == []
    assert not f._one.native


@compiled
def test_threads_share_a_strategy_while_native_code_takes_over(panda: hk.Robot, monkeypatch: Patch) -> None:
    monkeypatch.setattr(kernel, "HEAVY", 200)
    shared = hk.holonomic(hk.pose(panda), hk.arm_angle())
    Q = PANDA_START + np.random.default_rng(7).uniform(-0.3, 0.3, (8, 7))
    wanted = shared.batch(Q)
    wrong: list[int] = []

    def run(k: int) -> None:
        until = time.monotonic() + 20.0
        for i in range(4000):
            if np.abs(shared(Q[k]) - wanted[k]).max() > 1e-12 * np.abs(wanted[k]).max() or time.monotonic() > until:
                wrong.append(i)

    threads = [threading.Thread(target=run, args=(k,)) for k in range(len(Q))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []
    assert later.idle(60.0)
    assert shared._gain_at.native


@pytest.mark.campaign
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@compiled
def test_a_forked_process_asks_again_for_what_its_parent_was_building(tmp_path: Path) -> None:
    code = (
        "import os, sys, threading, numpy as np\n"
        "from holokin.symbolic.native import background as later, evaluator\n"
        "from holokin.symbolic import Function, symbol\n"
        "evaluator.HEAVY = 5\n"
        "x = symbol('x', 3); f = Function('forked', {'x': x}, {'y': 11 * x}); v = np.ones(3)\n"
        "go, real = threading.Event(), evaluator.library\n"
        "evaluator.library = lambda *a, **k: (go.wait(60), real(*a, **k))[1]\n"
        "for _ in range(9): f(v)\n"
        "child = os.fork()\n"
        "go.set()\n"
        "if not child: go = threading.Event(); go.set()\n"
        "for _ in range(9): f(v)\n"
        "done = later.idle(60) and f._one.native and np.array_equal(f(v), 11 * v)\n"
        "if not child: sys.exit(0 if done else 3)\n"
        "sys.exit(0 if done and os.waitpid(child, 0)[1] == 0 else 4)\n"
    )
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.campaign
@compiled
def test_processes_share_the_cache(tmp_path: Path) -> None:
    code = (
        "import numpy as np; from holokin.symbolic.native import background as later, evaluator\n"
        "from holokin.symbolic import Function, symbol\n"
        "x = symbol('x', 3); f = Function('shared', {'x': x}, {'y': 13 * x})\n"
        "for _ in range(evaluator.HEAVY): f(np.ones(3))\n"
        "print(later.idle(60.0), f._one.native, f(np.ones(3))[0])\n"
    )
    environment = os.environ | {"HOLOKIN_CACHE": str(tmp_path / "cache")}
    command = [sys.executable, "-c", code]
    both = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    assert [process.communicate(timeout=60)[0] for process in both] == ["True True 13.0\n"] * 2
    assert len(list((tmp_path / "cache").iterdir())) == 3  # the probe, the binding, the function


@pytest.mark.skipif(os.name != "posix", reason="needs a POSIX shell")
def test_the_interpreter_ends_at_once_while_a_compiler_runs(tmp_path: Path) -> None:
    """No waiting, no message, no process and no file left."""
    compiler, pid = tmp_path / "cc", tmp_path / "pid"
    compiler.write_text(
        f'#!/bin/sh\ncase "$*" in *--version*) echo "cc 1.0"; exit;; esac\necho $$ > {pid}.new\n'
        f"mv {pid}.new {pid}\nsleep 60\n"
    )
    compiler.chmod(0o755)
    (tmp_path / "tmp").mkdir()
    code = (
        "import pathlib, time, numpy as np; from holokin.symbolic.native import kernel; kernel.HEAVY = 5\n"
        "from holokin.symbolic import Function, symbol\n"
        "x = symbol('x', 3); f = Function('ends', {'x': x}, {'y': 17 * x})\n"
        "for _ in range(9): f(np.ones(3))\n"
        f"while not pathlib.Path({str(pid)!r}).exists(): time.sleep(0.01)\n"
        "print(time.time())\n"
    )
    more = {"CC": str(compiler), "HOLOKIN_CACHE": str(tmp_path / "cache"), "TMPDIR": str(tmp_path / "tmp")}
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | more, capture_output=True, text=True, timeout=50, check=True
    )
    assert time.time() - float(done.stdout) < 5.0
    assert done.stderr == ""
    assert list((tmp_path / "tmp").iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


@compiled
def test_what_is_dropped_is_freed(panda: hk.Robot) -> None:
    """A strategy at once, without the garbage collector; a function also after native code has taken over."""
    strategy = hk.holonomic(hk.pose(panda), hk.lock(2))
    strategy(PANDA_START)
    gone = weakref.ref(strategy)
    gc.disable()
    try:
        del strategy
        assert gone() is None, "a cycle keeps it"
    finally:
        gc.enable()
    x = symbol("x", 3)
    f = Function("freed", {"x": x}, {"y": 19 * x})
    f._one.work()
    assert f._one.native
    references = [weakref.ref(f._one), weakref.ref(f)]
    del f
    gc.collect()
    assert [r() for r in references] == [None, None]


def test_what_was_called_often_can_be_pickled_and_copied(panda: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(panda), hk.lock(2))
    G = strategy(PANDA_START)
    again = pickle.loads(pickle.dumps(strategy))
    assert np.array_equal(again(PANDA_START), G)
    task = pickle.loads(pickle.dumps(strategy.task))
    assert np.array_equal(task(PANDA_START), strategy.task(PANDA_START))


def test_compilers_are_not_started_while_the_interpreter_ends(monkeypatch: Patch) -> None:
    stopped = threading.Event()
    stopped.set()
    monkeypatch.setattr(toolchain, "_stopped", stopped)
    with pytest.raises(OSError, match="ending"):
        toolchain.call(("true",), 1.0, "stdout")
