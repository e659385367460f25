"""Native code takes over while calls go on: no call waits, no exit hangs, threads and forked processes have theirs."""

from __future__ import annotations

import gc
import os
import pickle
import subprocess
import sys
import threading
import time
import weakref
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START
from holokin.symbolic import Function, symbol
from holokin.symbolic.native import kernel, toolchain
from holokin.symbolic.native import toolchain as later
from holokin.symbolic.native import toolchain as native

Patch = pytest.MonkeyPatch
compiled = pytest.mark.skipif(native.compiler() is None or kernel._module() is None, reason="no C compiler here")


@pytest.fixture(autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: Patch) -> None:
    """One cache for all tests here, in which libraries are built once."""
    monkeypatch.setenv("HOLOKIN_CACHE", str(tmp_path_factory.getbasetemp() / "evaluators"))


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
