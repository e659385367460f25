"""One call from Python, in C floors: the functions that users call in loops. Part of `python -m benchmarks.speed`.

The C floor is one control step called from C. Everything is timed at the same posture, in turns, round by round, and in
processor time, so that what else the machine does counts little.
"""

from __future__ import annotations

import ctypes
import pickle
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.growth import START, environment
from holokin.symbolic.native.emit import step_source
from holokin.symbolic.native.kernel import HEAVY
from holokin.symbolic.native.toolchain import idle, library

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
    """`functions` of a Panda, the first `most`: on the virtual machine, as native code, and as that of a list."""
    out: dict[str, Callable[[int], object]] = {}
    with environment(HOLOKIN_NATIVE="0"):
        for name, call in [*functions(hk.load("panda")).items()][:most]:
            _worn_in(call, q)
            out[f"{name}, virtual machine"] = repeated(lambda call=call: call(q))
    given = q.tolist()
    for name, call in [*functions(hk.load("panda")).items()][:most]:
        _worn_in(call, q)
        out[f"{name}, native"] = repeated(lambda call=call: call(q))
        out[f"{name}, native, of a list"] = repeated(lambda call=call: call(given))
    return out


def _worn_in(call: Callable[[np.ndarray], object], q: np.ndarray) -> None:
    """Call it as often as it takes to ask for native code, and wait for that."""
    repeated(lambda: call(q))(HEAVY + 1)
    idle(120.0)


def calls_page(times: dict[str, Timed], floor: float) -> list[str]:
    """Lines of docs/speed.md."""
    names = [name.removesuffix(", native") for name in times if name.endswith(", native") and name.startswith("`")]
    lines = [
        "\n## One call from Python\n",
        f"New arrays, checks of shape, of finite numbers and of singularity included, after the first {HEAVY:,} calls.",
        "In C floors, timed in turns; in us on the virtual machine.\n",
        "| one call | native, in C floors | of a list | virtual machine, in C floors | virtual machine |",
        "|---|---:|---:|---:|---:|",
    ]
    for name in names:
        native, listed, machine = (
            times[f"{name}, {way}"].median for way in ("native", "native, of a list", "virtual machine")
        )
        lines.append(
            f"| {name} | {native / floor:.2f} | {listed / floor:.2f} | {machine / floor:.1f} | {1e6 * machine:.1f} us |"
        )
    return lines
