"""How fast? One control step, calls from Python, loops in C, growth with the joints.

All of a table is called at the same posture, in turns, round by round, and in processor time, so that what else the
machine does counts little. The C floor is one control step called from C.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import pickle
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.page import Given, table, us, versions, wrapped
from holokin.analysis.curvature.curvature_of_planes import curvature_function
from holokin.symbolic import linear
from holokin.symbolic.native.emit import step_source
from holokin.symbolic.native.kernel import HEAVY
from holokin.symbolic.native.toolchain import engine, idle, library

DT = 0.001
START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
SIZES = (3, 5, 7, 10, 14, 20, 30, 60)


@contextlib.contextmanager
def environment(**values: str) -> Iterator[None]:
    """Environment variables for a while."""
    before = {key: os.environ.get(key) for key in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for key, value in before.items():
            os.environ.pop(key, None) if value is None else os.environ.__setitem__(key, value)


def planar(n: int) -> hk.Robot:
    """An arm of n links, 1 m long in all."""
    return hk.from_dh([{"a": 1.0 / n} for _ in range(n)], name=f"planar {n}R")


def grown(n: int) -> list[str]:
    """A row of the table: a planar arm whose redundant joints are held by dense rows."""
    task, q0 = hk.position(planar(n)), np.random.default_rng(n).uniform(-1, 1, n) * 3 / np.sqrt(n)
    rows = np.random.default_rng(0).normal(size=(n - task.m, n))
    target, twist = task.robot.pose(q0)[:3, 3].copy(), np.full(3, 0.01)
    build, times, operations = [], [], 0
    with tempfile.TemporaryDirectory() as folder:
        for flag in ("1", "0"):
            with environment(HOLOKIN_CACHE=folder, HOLOKIN_NATIVE=flag):
                hk.controller(hk.moore_penrose(hk.position(planar(2))), dt=1e-3)  # builds what all steps share
                begin = time.perf_counter()
                servo = hk.controller(hk.holonomic(task, hk.linear(rows)), dt=1e-3, q0=q0)
                build.append(time.perf_counter() - begin)
                operations = servo.generated[0].instructions
                step = repeated(lambda servo=servo: servo.step(q0, target, twist))
                times.append(us(in_turns({"step": step}, 60, 2e-3)["step"].median))
    way = "numbers" if n >= linear.DENSE_FROM else "written out"
    return [str(n), way, f"{operations:,}", f"{build[0]:.2f} s", *times]


PLACES = 256
"""Places in memory from which the loop in C reads the posture, so that no compiler takes the step out of the loop."""

LOOP = """
HK_API int floor_loop(long long count, const double *Q, const double *pose, const double *twist,
                      const double *parameters, double *first) {
  double out[HK_N + 3];
  int status = 0;
  for (long long i = 0; i < count; i++) {
    status |= hk_step(Q + HK_N * (i % 256), pose, twist, out, parameters);
    if (!i)
      for (int k = 0; k < HK_N; k++) first[k] = out[k];
  }
  return status;
}
"""


class Floor:
    """One step of a controller in C, at START. The sizes of what it reads are those of the step that was generated."""

    def __init__(self, controller: Any, pose: np.ndarray, twist: np.ndarray) -> None:
        _, shapes, _, _ = controller.generated
        self.first = np.empty(shapes[0])
        self._arrays = [
            np.tile(START, (PLACES, 1)),
            np.array(pose, dtype=float),
            np.array(twist, dtype=float),
            np.array(controller.parameters),
            self.first,
        ]
        found = [array.shape for array in (*self._arrays[0][:1], *self._arrays[1:4])]
        if found != [tuple(shape) for shape in shapes]:
            raise ValueError(f"the step reads arrays of shapes {shapes}, not {found}")
        self._library = library(step_source(*controller.generated) + LOOP)
        self._run: Any = self._library.floor_loop
        self._run.restype, self._run.argtypes = ctypes.c_int, [ctypes.c_longlong] + [ctypes.c_void_p] * 5

    def __call__(self, count: int) -> int:
        """So many steps; returns their status, 0 where each is as wanted. dq is in `first`."""
        return self._run(count, *(array.ctypes.data for array in self._arrays))


@dataclass(frozen=True)
class Timed:
    """Seconds of the processor for one call: the median, and the 99th percentile over the rounds."""

    median: float
    p99: float


def in_turns(calls: dict[str, Callable[[int], object]], rounds: int, each: float) -> dict[str, Timed]:
    """Processor times of loops, round by round in turns, each after a few calls that are not timed.

    Args:
        calls: name -> a function that calls so many times.
        each: seconds that a turn should take.
    """
    counts = {}
    for name, run in calls.items():
        run(3)
        begin = time.process_time()
        run(10)
        counts[name] = max(10, int(each / ((time.process_time() - begin) / 10)))
    times = np.empty((rounds, len(calls)))
    for k in range(rounds):
        for i, (name, run) in enumerate(calls.items()):
            run(counts[name] // 5)
            begin = time.process_time()
            run(counts[name])
            times[k, i] = (time.process_time() - begin) / counts[name]
    return {
        name: Timed(float(np.median(t)), float(np.percentile(t, 99))) for name, t in zip(calls, times.T, strict=True)
    }


def repeated(call: Callable[[], object]) -> Callable[[int], object]:
    """A function of no arguments, called so many times."""

    def run(count: int) -> None:
        for _ in range(count):
            call()

    return run


def functions(robot: hk.Robot) -> dict[str, Callable[[np.ndarray], object]]:
    """What users call in loops, made anew: of a copy, since a robot that is in use is not loaded again."""
    robot = pickle.loads(pickle.dumps(robot))
    task = hk.pose(robot)
    held = hk.holonomic(task, hk.arm_angle())
    return {
        "`G(q)`, arm angle": held,
        "`G(q)`, Moore-Penrose": hk.moore_penrose(task),
        "`g(q)`": held.g,
        "`task(q)`": task,
        "`task.jacobian(q)`": task.jacobian,
        "`robot.pose(q)`": robot.pose,
        "`robot.jacobian(q)`": robot.jacobian,
    }


def machine_and_native(q: np.ndarray, most: int | None = None) -> dict[str, Callable[[int], object]]:
    """`functions` of a Panda, the first `most`: on the virtual machine, and as native code."""
    out: dict[str, Callable[[int], object]] = {}
    with environment(HOLOKIN_NATIVE="0"):
        for name, call in [*functions(hk.load("panda")).items()][:most]:
            _worn_in(call, q)
            out[f"{name}, virtual machine"] = repeated(lambda call=call: call(q))
    for name, call in [*functions(hk.load("panda")).items()][:most]:
        _worn_in(call, q)
        out[f"{name}, native"] = repeated(lambda call=call: call(q))
    return out


def _worn_in(call: Callable[[np.ndarray], object], q: np.ndarray) -> None:
    """Call it as often as it takes to ask for native code, and wait for that."""
    repeated(lambda: call(q))(HEAVY + 1)
    idle(120.0)


def without_compiler(make: Callable[[], hk.motion.Controller]) -> hk.motion.Controller:
    """A controller on the virtual machine."""
    with environment(HOLOKIN_NATIVE="0"):
        return make()


def first_use(make: Callable[[], hk.motion.Controller]) -> tuple[float, float]:
    """Seconds to build, compile and load a new strategy, and again from the cache."""
    with tempfile.TemporaryDirectory() as folder, environment(HOLOKIN_CACHE=folder):
        begin = time.perf_counter()  # not the processor's time here: the compiler is a process of its own
        make()
        middle = time.perf_counter()
        make()
        return middle - begin, time.perf_counter() - middle


def _seconds(call: Callable[[], object]) -> float:
    begin = time.process_time()
    call()
    return time.process_time() - begin


def section(given: Given) -> tuple[list[str], str]:
    """Measure; the blocks of docs/measured.md, and the versions."""
    scale, rounds = (0.01, 5) if given.quick else (1.0, 400)
    robot = hk.load("panda")
    pose, twist = robot.pose(START), np.array([0.1, 0.0, 0.05, 0.0, 0.0, 0.0])
    pose[0, 3] += 1e-4

    def make() -> hk.motion.Controller:
        return hk.controller(hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle()), dt=DT, q0=START)

    def make_radial() -> hk.motion.Controller:
        task = hk.pose(hk.load("panda"))
        return hk.controller(hk.radial(hk.moore_penrose(task), START), dt=DT, q0=START)

    servo, machine, carried, slowly = make(), without_compiler(make), make_radial(), without_compiler(make_radial)
    steps = {
        "C floor": Floor(servo, pose, twist),
        "holokin": repeated(lambda: servo.step(START, pose, twist)),
        "holokin, without a compiler": repeated(lambda: machine.step(START, pose, twist)),
        "`radial`, called from C": Floor(carried, pose, twist),
        "`radial`": repeated(lambda: carried.step(START, pose, twist)),
        "`radial`, without a compiler": repeated(lambda: slowly.step(START, pose, twist)),
    }
    times = in_turns(steps | machine_and_native(START, 3 if given.quick else None), rounds, 5e-4)
    floor = times["C floor"].median
    rows = [
        (name, us(t.median), us(t.p99), f"{t.median / floor:.3g}")
        for name, t in ((name, times[name]) for name in steps)
    ]
    calls = [(name, us(native), f"{native / floor:.2g}", us(slow)) for name, native, slow in _calls(times)]
    calls += [(name, us(t), f"{t / floor:.2g}", "-") for name, t in loops(robot, scale)]
    sizes = SIZES[:1] if given.quick else SIZES
    first, again = (f"{a:.2g} s and {b:.2g} s" for a, b in zip(first_use(make), first_use(make_radial), strict=True))
    names = "median [us]", "99 % under [us]", "in C floors"
    blocks = [
        "## Speed",
        wrapped(
            """What does one control step of a Panda take, called from Python? It holds the arm angle, with feedback
            to the path and to the leaf and with joint limits. *C floor* is the same step called from C. `radial`
            carries the posture back to its centre in four Runge-Kutta steps at each step. All are called in turns, in
            processor time. Calls of other libraries are timed in the [league](#league) and among the
            [rivals](#rivals)."""
        ),
        table(("one control step", *names), rows),
        wrapped(
            f"""The functions that programs call in loops return new arrays and check shapes, finite numbers and
            singularity. They are compiled after {HEAVY:,} calls; until then, or where there is no C compiler, CasADi's
            virtual machine computes them. The last rows are loops in C: a sample of `hk.follow`, a posture of a batch,
            on one core."""
        ),
        table(("one call", "native [us]", "in C floors", "without a compiler [us]"), calls),
        wrapped(
            f"""Building, compiling and loading a strategy and its `radial` takes {first} the first time, and {again}
            from the cache. With more joints a step grows as follows, for planar arms whose redundant joints are held
            by dense linear rows. From {linear.DENSE_FROM} joints on, the linear system is left to a factorisation
            instead of being written out as formulas."""
        ),
        table(("joints", "system", "operations", "build", "step [us]", "no compiler"), map(grown, sizes), 2),
    ]
    return blocks, f"{versions('casadi', 'numpy')}, {engine()}"


def _calls(times: dict[str, Timed]) -> Iterator[tuple[str, float, float]]:
    """(name, seconds natively, by the virtual machine) of the functions."""
    for name in [name.removesuffix(", native") for name in times if name.endswith(", native")]:
        yield name, times[f"{name}, native"].median, times[f"{name}, virtual machine"].median


def loops(robot: hk.Robot, scale: float) -> Iterator[tuple[str, float]]:
    """(what, seconds of one sample) of loops in C, the least of three."""
    point = robot.pose(START)[:3, 3]
    loop, strategy = hk.circle(point, point - [0.1, 0, 0]), hk.holonomic(hk.pose(robot), hk.arm_angle())
    samples, count = int(100_000 * scale), int(1_000_000 * scale)
    Q = START + np.random.default_rng(1).uniform(-0.3, 0.3, (count, 7))
    planes = curvature_function(strategy)
    runs: dict[str, tuple[int, Callable[[], object]]] = {
        "`follow` by leaf": (samples, lambda: hk.follow(strategy, loop, START, samples=samples)),
        "`follow` by velocity": (
            samples, lambda: hk.follow(strategy, loop, START, samples=samples, method="velocity")
        ),
        "`G.batch`": (count, lambda: strategy.batch(Q, threads=1)),
        "curvature of all 15 planes": (count // 10, lambda: planes.batch(Q[: count // 10], threads=1)),
    }  # fmt: skip
    for name, (many, run) in runs.items():
        run()
        yield name, min(_seconds(run) for _ in range(3)) / many
