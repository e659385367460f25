"""The control step and odd arrays; controllers and functions that threads share."""

from __future__ import annotations

import gc
import os
import sys
import sysconfig
import threading
import weakref
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, campaign, sampled
from holokin.base.errors import ArgumentError, HolokinError, ShapeError
from holokin.motion.control_step import StepStatus
from holokin.symbolic import Function, symbol
from holokin.symbolic.native import kernel
from holokin.symbolic.native import toolchain as native

Patch = pytest.MonkeyPatch
POSE = hk.load("panda").pose(PANDA_START)
TWIST = np.array([0.01, -0.02, 0.03, 0.0, 0.01, 0.0])
THREADS, STEPS = 4, 1000


@pytest.fixture(scope="module")
def strategy() -> hk.Strategy:
    return hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(params=["native", campaign("servo", "native without Python's headers"), "virtual machine"])
def servo(
    request: pytest.FixtureRequest, cache: Path, strategy: hk.Strategy, monkeypatch: Patch
) -> hk.motion.Controller:
    """The same controller by each of the three ways of running it."""
    monkeypatch.setenv("HOLOKIN_CACHE", str(cache))
    monkeypatch.setenv("HOLOKIN_NATIVE", str(int(request.param != "virtual machine")))
    if request.param != "virtual machine" and native.compiler() is None:
        pytest.skip("no C compiler here")
    if request.param == "native without Python's headers":
        monkeypatch.setattr(kernel, "_glue", lambda: None)
    made = hk.controller(strategy, dt=1e-3, q0=PANDA_START)
    assert request.param.split()[0] in made.engine
    return made


# --- odd arrays ---


def misaligned(array: np.ndarray, by: int) -> np.ndarray:
    """The same numbers, contiguous, at an address that is no multiple of eight."""
    out = np.zeros(array.nbytes + 16, np.uint8)[by : by + array.nbytes].view(float).reshape(array.shape)
    out[...] = array
    assert out.flags.c_contiguous and not out.flags.aligned
    return out


def frozen(array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array.flags.writeable = False
    return array


class Sub(np.ndarray):
    pass


def spaced(array: np.ndarray) -> np.ndarray:
    out = np.zeros((*array.shape, 3))
    out[..., 1] = array
    return out[..., 1]


SAME: dict[str, Callable[[np.ndarray], object]] = {
    **{f"misaligned by {by}": (lambda a, by=by: misaligned(a, by)) for by in (1, 3, 4, 7)},
    "of the other byte order": lambda a: a.astype(a.dtype.newbyteorder()),
    "of the other byte order, misaligned": lambda a: misaligned(a, 1).byteswap().view(a.dtype.newbyteorder()),
    "not writable": frozen,
    "of a subclass": lambda a: a.view(Sub),
    "spaced": spaced,
    "backwards": lambda a: np.ascontiguousarray(a[::-1])[::-1],
    "in columns": np.asfortranarray,
    "of objects": lambda a: a.astype(object),
    "of long doubles": lambda a: a.astype(np.longdouble),
    "a list": lambda a: a.tolist(),
    "a memory view": lambda a: memoryview(a.copy()),
    "fractions": lambda a: np.array([Fraction(v) for v in a.ravel()], object).reshape(a.shape),
}


@sampled(4, "kind", SAME)
def test_the_same_numbers_in_another_memory_give_the_same_rates(kind: str, servo: hk.motion.Controller) -> None:
    """Each argument alone, and all three."""
    plain = [PANDA_START + 0.01, POSE, TWIST]
    expected = servo.step(*plain)
    assert np.abs(expected).max() > 1e-3
    for which in ([0], [1], [2], [0, 1, 2]):
        arguments = [SAME[kind](value) if k in which else value for k, value in enumerate(plain)]
        assert np.array_equal(servo.step(*arguments), expected)


@pytest.mark.parametrize("kind", [np.float32, np.float16, np.int64, np.uint8, np.bool_])
def test_numbers_of_other_types_are_taken_at_their_value(kind: type, servo: hk.motion.Controller) -> None:
    q = np.array([0, 1, 0, -1, 0, 1, 0]).astype(kind)
    pose = servo.strategy.task.robot.pose(q.astype(float))
    expected = servo.step(q.astype(float), pose, TWIST)
    assert np.abs(expected).max() > 1e-3
    assert np.array_equal(servo.step(q, pose, TWIST), expected)


@pytest.mark.parametrize(
    ("value", "error"),
    [
        (0.5, ShapeError), (np.array(0.5), ShapeError), (np.zeros(0), ShapeError), (np.zeros((7, 1)), ShapeError),
        (np.broadcast_to(0.0, 10**9), ShapeError), (np.zeros(10**6), ShapeError), (None, ShapeError),
        (PANDA_START.astype(complex), ArgumentError), (PANDA_START.astype(str), ArgumentError),
        (np.zeros(7, "M8[s]"), ArgumentError), (np.zeros(7, "V8"), ArgumentError), ([10**400] * 7, ArgumentError),
        ([[0.0], [0.0, 1.0]], HolokinError), ("0123456", ArgumentError),
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_what_is_no_posture_is_refused_in_words(
    value: object, error: type[HolokinError], servo: hk.motion.Controller
) -> None:
    with pytest.raises(error):
        servo.step(value, POSE, TWIST)  # type: ignore[arg-type]
    assert servo.step(PANDA_START, POSE, TWIST).shape == (7,)


def test_numbers_beyond_all_floats_stop_the_arm(servo: hk.motion.Controller) -> None:
    huge = np.full(7, np.longdouble("1e400")) if np.finfo(np.longdouble).maxexp > 2000 else np.full(7, np.inf)
    assert np.array_equal(servo.step(huge, POSE, TWIST), np.zeros(7))
    assert servo.status is StepStatus.NOT_FINITE


# --- threads ---


@pytest.fixture
def busy() -> Iterator[None]:
    """Threads that take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


def at_once(*jobs: Callable[[], None]) -> None:
    """All jobs, each in a thread of its own, begun together; their first error is raised."""
    gate, errors = threading.Barrier(len(jobs)), []

    def work(job: Callable[[], None]) -> None:
        try:
            gate.wait()
            job()
        except BaseException as problem:  # noqa: BLE001 the test shows it
            errors.append(problem)

    threads = [threading.Thread(target=work, args=(job,)) for job in jobs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]


def test_no_thread_gets_the_rates_of_another(servo: hk.motion.Controller, busy: None) -> None:
    """Four threads on four wishes, a thousand steps each: rates, scale and status are those of their own wish."""
    wishes = [TWIST * factor for factor in (1.0, 30.0, 300.0, np.nan)]
    expected = []
    for wish in wishes:
        expected.append((servo.step(PANDA_START, POSE, wish), servo.scale, servo.status))
    assert len({status for _, _, status in expected}) >= 2
    foreign = [0] * THREADS

    def loop(k: int) -> None:
        rates, scale, status = expected[k]
        before = servo.step(PANDA_START, POSE, wishes[k])
        for _ in range(STEPS):
            dq = servo.step(PANDA_START, POSE, wishes[k])
            same = dq is not before and np.array_equal(dq, rates)
            foreign[k] += not (same and servo.scale == scale and servo.status is status)

    at_once(*(lambda k=k: loop(k) for k in range(THREADS)))
    assert foreign == [0] * THREADS


def test_a_thread_that_only_watches_sees_the_last_step_of_the_one_that_steps(servo: hk.motion.Controller) -> None:
    at_once(lambda: servo.step(PANDA_START, POSE, np.full(6, np.nan)))
    assert servo.status is StepStatus.NOT_FINITE
    at_once(lambda: servo.step(PANDA_START, POSE, TWIST))
    assert servo.status is StepStatus.OK
    assert servo.scale == 1.0


def test_what_a_thread_returned_stays_when_the_next_thread_steps(servo: hk.motion.Controller) -> None:
    """One thread after the other; systems give a new thread the number of one that has ended."""
    results: list[np.ndarray] = []
    expected = [servo.step(PANDA_START, POSE, k * 0.01 * TWIST) for k in range(1, 6)]
    for k in range(1, 6):
        at_once(lambda k=k: results.append(servo.step(PANDA_START, POSE, k * 0.01 * TWIST)))
    assert np.array_equal(results, expected)


@pytest.mark.campaign
def test_a_step_needs_nothing_but_itself_and_a_dropped_controller_is_freed(servo: hk.motion.Controller) -> None:
    expected = servo.step(PANDA_START, POSE, TWIST)
    made = hk.controller(servo.strategy, dt=1e-3, q0=PANDA_START)
    step, run, watch = made.step, made.begin(PANDA_START), weakref.ref(made)
    del made
    gc.collect()
    assert watch() is not None  # its step is left
    filler = [np.full(10, 7.0) for _ in range(1000)]  # takes memory that was freed too soon
    assert np.array_equal(step(PANDA_START, POSE, TWIST), expected)
    del step
    gc.collect()
    assert watch() is None
    assert np.array_equal(run(PANDA_START, POSE, TWIST, 1e-3), expected)  # a run needs no controller
    assert np.array_equal(run(PANDA_START.tolist(), POSE, TWIST, 1e-3), expected)
    assert len(filler) == 1000


@pytest.mark.parametrize("flag", ["0", "1"])
def test_a_function_may_be_shared_by_threads_from_its_first_call_on(
    flag: str, cache: Path, monkeypatch: Patch, busy: None
) -> None:
    """Single calls, and batches with and without a remainder, of a function with a linear system and of one without."""
    monkeypatch.setenv("HOLOKIN_CACHE", str(cache))
    monkeypatch.setenv("HOLOKIN_NATIVE", flag)
    monkeypatch.setattr(sys.modules["holokin.symbolic.function"], "NATIVE_FROM", 600)
    x = symbol("x", 3)
    for attempt in range(3):
        f = Function(f"f{attempt}", {"x": x}, {"y": ca.sin(x) * attempt + x, "z": ca.sumsqr(x)})
        rate = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2)).rate

        def loop(k: int, f: Function = f, rate: Function = rate, attempt: int = attempt) -> None:
            rng = np.random.default_rng(k)
            for count in (1, 256, 300, 700):
                X = rng.uniform(-1, 1, (count, 3))
                y, z = f.batch(X)
                assert np.abs(y - np.sin(X) * attempt - X).max() < 1e-14
                assert np.abs(z - (X**2).sum(1)).max() < 1e-14
                one, size = f(X[0])
                assert np.abs(one - np.sin(X[0]) * attempt - X[0]).max() < 1e-14
                assert abs(size - X[0] @ X[0]) < 1e-14
            Q = PANDA_START + rng.uniform(-0.2, 0.2, (280, 7))
            dq = rate.batch(Q, TWIST)[0]
            assert np.abs(dq - [rate(q, TWIST)[0] for q in Q]).max() < 1e-12

        at_once(*(lambda k=k, loop=loop: loop(k) for k in range(4 + (os.cpu_count() or 1) // 4)))


@pytest.mark.skipif(native.compiler() is None, reason="no C compiler here")
def test_where_there_are_pythons_headers_steps_are_bound_in_c(cache: Path, monkeypatch: Patch) -> None:
    """And a NumPy whose arrays are laid out otherwise is told from ours."""
    monkeypatch.setenv("HOLOKIN_CACHE", str(cache))
    if not (Path(sysconfig.get_paths()["include"]) / "Python.h").is_file():
        pytest.skip("no headers here")
    glue = kernel._glue()
    assert glue is not None
    one, odd = np.zeros((3, 5)), np.zeros(17, np.uint8)[1:].view(float)
    one.flags.writeable = False
    known = [np.ndarray, np.ndarray.__basicsize__, one.dtype, np.empty, one, one.T, odd, one.ctypes.data]
    assert glue.know(*known)
    wrong = {1: 16, 2: np.dtype(np.int64), 4: np.zeros((3, 5)), 5: one, 6: np.zeros(2), 7: one.ctypes.data + 8}
    for k, value in wrong.items():
        assert not glue.know(*known[:k], value, *known[k + 1 :]), k
    assert glue.know(*known)
