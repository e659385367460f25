"""How fast? The speed benchmark: writes docs/speed.md.

    python -m benchmarks.speed            # needs: pip install -e ".[rivals]" and a C compiler

All in one run on one machine, Panda, pose task, the same circle: one control step called from Python, ours with
feedback to the path and to the leaf, native and by the virtual machine, beside pink, mink, placo, Pinocchio and
roboticstoolbox with NumPy's pinv. The C floor is one such step called from C. Then the functions that users call in
loops, loops in C, memory, and growth with the joints. Calls are timed at the same posture, in turns, round by round,
and in processor time, so that what else the machine does counts little.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import importlib
import os
import pickle
import platform
import tempfile
import time
import tracemalloc
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

import holokin as hk
from benchmarks.drift import versions
from holokin.analysis.curvature.curvature_of_planes import curvature_function
from holokin.motion import simulate
from holokin.robot import to_mjcf, to_urdf
from holokin.symbolic import linear
from holokin.symbolic.native.emit import step_source
from holokin.symbolic.native.kernel import HEAVY
from holokin.symbolic.native.toolchain import engine, idle, library

DT = 0.001
ROOT = Path(__file__).resolve().parents[1]
START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
SIZES = (3, 5, 7, 10, 14, 20, 30, 40, 50, 60)
CROSSING = (5, 7, 9, 10, 12, 14)


@dataclass(frozen=True)
class Growth:
    """One row: how the system is solved, operations, seconds to build, and of a step from Python (native, not)."""

    name: str
    joints: int
    way: str
    operations: int
    build: float
    native: float
    machine: float


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


def two_pandas() -> hk.Robot:
    """Two Pandas side by side, 0.8 m apart, as one chain of 14 joints from the left hand to the right one."""
    panda = hk.load("panda")
    both = ET.Element("robot", name="two Pandas, hand to hand")
    ET.SubElement(both, "link", name="table")
    for side, y in (("left", 0.4), ("right", -0.4)):
        mount = ET.SubElement(both, "joint", name=f"{side}_mount", type="fixed")
        ET.SubElement(mount, "parent", link="table")
        ET.SubElement(mount, "child", link=f"{side}_base")
        ET.SubElement(mount, "origin", xyz=f"0 {y} 0", rpy="0 0 0")
        for element in ET.fromstring(to_urdf(panda)):
            element.set("name", f"{side}_{element.get('name')}")
            for end in (*element.findall("parent"), *element.findall("child")):
                end.set("link", f"{side}_{end.get('link')}")
            both.append(element)
    tip = panda.tips[0].name
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "two-pandas.urdf"
        file.write_bytes(ET.tostring(both))
        return hk.from_urdf(file, base=f"left_{tip}", tip=f"right_{tip}")


def grown(task: hk.Task, q0: np.ndarray) -> Growth:
    """The row of a task whose redundant joints are held by dense rows."""
    rows = np.random.default_rng(0).normal(size=(task.n - task.m, task.n))
    pose = task.robot.pose(q0)
    target = pose if task.orientation else pose[:3, 3].copy()
    twist = np.full(6 if task.orientation else 3, 0.01)
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
                times.append(in_turns({"step": step}, 60, 2e-3)["step"].median)
    way = "numbers" if task.n >= linear.DENSE_FROM else "written out"
    return Growth(task.robot.name, task.n, way, operations, build[0], *times)


def growth(quick: bool) -> tuple[list[Growth], list[Growth]]:
    """(rows as they are, rows of sizes around the crossing both ways)."""

    def row(n: int) -> Growth:
        q0 = np.random.default_rng(n).uniform(-1, 1, n) * 3 / np.sqrt(n)
        return grown(hk.position(planar(n)), q0)

    rows = [row(n) for n in (SIZES[:1] if quick else SIZES)]
    if not quick:
        rows.append(grown(hk.pose(two_pandas()), np.concatenate([START[::-1], START])))
    both, usual = [], linear.DENSE_FROM
    try:
        for n in CROSSING[:1] if quick else CROSSING:
            for linear.DENSE_FROM in (n + 1, 0):
                both.append(row(n))
    finally:
        linear.DENSE_FROM = usual
    return rows, both


def growth_page(rows: list[Growth], both: list[Growth]) -> list[str]:
    """Lines of docs/speed.md."""
    head = ["| robot | joints | system | operations | build | step, native | step, virtual machine |"]
    head.append("|---|---:|---|---:|---:|---:|---:|")

    def lines(some: list[Growth]) -> list[str]:
        return [
            f"| {g.name} | {g.joints} | {g.way} | {g.operations:,} | {g.build:.2f} s | {1e6 * g.native:.3g} us | "
            f"{1e6 * g.machine:.3g} us |"
            for g in some
        ]

    return [
        "\n## Growth\n",
        "Planar arms hold n - 2 dense linear rows, the two Pandas eight. Build: expressions, C, compiler and loading",
        "of a new strategy. A step is called from Python, with feedback and limits.\n",
        *head,
        *lines(rows),
        f"\nFrom {linear.DENSE_FROM} joints on the linear system is left to a dense factorisation in C, or to LAPACK",
        "without a compiler. Both ways, around the crossing:\n",
        *head,
        *lines(both),
    ]


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


def processor() -> str:
    """The machine's name: the model of its processor, where the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def load() -> str:
    """How busy the machine is."""
    return f"load {os.getloadavg()[0]:.1f} at the end" if hasattr(os, "getloadavg") else "load unknown"


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


def memory(strategy: hk.Strategy, loop: hk.Path, scale: float) -> list[tuple[str, float, int]]:
    """(what, bytes allocated at the peak for each further sample, bytes of the outputs for each)."""

    def slope(run: Callable[[int], object], low: int, high: int) -> float:
        peaks = []
        run(low)
        for count in (low, high):
            tracemalloc.start()
            run(count)
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        return (peaks[1] - peaks[0]) / (high - low)

    low, high = int(100_000 * scale), int(300_000 * scale)
    Q = START + np.random.default_rng(1).uniform(-0.3, 0.3, (2 * high, 7))

    def follow(method: Literal["leaf", "velocity"]) -> Callable[[int], object]:
        return lambda k: hk.follow(strategy, loop, START, samples=k, method=method)

    methods: tuple[Literal["leaf", "velocity"], ...] = ("leaf", "velocity")
    out = [(f"`follow` by {method}", slope(follow(method), low, high), 8 * 8) for method in methods]
    return [*out, ("`G.batch`", slope(lambda k: strategy.batch(Q[:k]), 2 * low, 2 * high), 8 * 42)]


Step = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""(q, wanted pose (4, 4), wanted twist (6,)) -> dq"""

SOLVERS = ("quadprog", "daqp", "proxqp")
POSTURE = 1e-3
"""Cost of the posture task that their examples put beside the frame task."""


def rivals(robot: hk.Robot, start: np.ndarray, dt: float) -> tuple[list[tuple[str, Step]], list[str]]:
    """(name, step) of all that are installed, and the names of those that are not, or that do not work here."""
    steps: list[tuple[str, Step]] = []
    left_out: list[str] = []
    for name, make in (
        ("pink", _pink),
        ("mink", _mink),
        ("placo", _placo),
        ("roboticstoolbox + pinv", _roboticstoolbox),
        ("Pinocchio + pinv", _pinocchio),
    ):
        try:
            with _silence():
                made = list(make(robot, start, dt))
        except ImportError as problem:
            left_out.append(f"{name} ({problem.name or 'a part of it'} is not installed)")
            continue
        for variant, step in made:
            label = f"{name}{variant}"
            if name in ("pink", "mink", "placo") and not _follows(step, robot, start, dt):
                left_out.append(f"{label} (its step does not reach the target)")
            else:
                steps.append((label, step))
    return steps, left_out


def _follows(step: Step, robot: hk.Robot, start: np.ndarray, dt: float) -> bool:
    """True when the step goes to a pose 0.1 mm away within a twentieth."""
    pose = robot.pose(start)
    pose[0, 3] += 1e-4
    moved = robot.jacobian(start) @ np.asarray(step(start, pose, np.zeros(6))) * dt
    return bool(np.abs(moved - [1e-4, 0, 0, 0, 0, 0]).max() < 5e-6)


Parts = tuple[Any, Any, Any]
"""A configuration at the start, a frame task, a posture task."""


def _programmes(
    library: Any, begin: Callable[[], Parts], pose_of: Callable[[np.ndarray], Any], dt: float
) -> Iterator[tuple[str, Step]]:
    """pink and mink: a quadratic programme each step, with its limits and none, by every solver that is here."""
    there = importlib.import_module("qpsolvers").available_solvers

    def stepping(parts: Parts, solver: str, limits: list[Any] | None) -> Step:
        configuration, tool, rest = parts

        def step(q: np.ndarray, pose: np.ndarray, _twist: np.ndarray) -> np.ndarray:
            configuration.update(q)
            tool.set_target(pose_of(pose))
            return library.solve_ik(configuration, [tool, rest], dt, solver=solver, limits=limits)

        return step

    for solver in [name for name in SOLVERS if name in there]:
        yield f", its limits, {solver}", stepping(begin(), solver, None)
        yield f", no limits, {solver}", stepping(begin(), solver, [])


def _pink(robot: hk.Robot, start: np.ndarray, dt: float) -> Iterator[tuple[str, Step]]:
    pin, pink = map(importlib.import_module, ("pinocchio", "pink"))
    model = pin.buildModelFromXML(to_urdf(robot))

    def begin() -> Parts:
        tool = pink.tasks.FrameTask(robot.tips[0].name, position_cost=1.0, orientation_cost=1.0)
        rest = pink.tasks.PostureTask(cost=POSTURE)
        rest.set_target(start.copy())
        return pink.Configuration(model, model.createData(), start.copy()), tool, rest

    return _programmes(pink, begin, lambda pose: pin.SE3(pose[:3, :3], pose[:3, 3]), dt)


def _mink(robot: hk.Robot, start: np.ndarray, dt: float) -> Iterator[tuple[str, Step]]:
    mink, mujoco = map(importlib.import_module, ("mink", "mujoco"))
    model = mujoco.MjModel.from_xml_string(to_mjcf(robot))

    def begin() -> Parts:
        tool = mink.FrameTask(robot.tips[0].name, "site", position_cost=1.0, orientation_cost=1.0)
        rest = mink.PostureTask(model, cost=POSTURE)
        rest.set_target(start.copy())
        return mink.Configuration(model), tool, rest

    return _programmes(mink, begin, mink.SE3.from_matrix, dt)


def _placo(robot: hk.Robot, start: np.ndarray, dt: float) -> Iterator[tuple[str, Step]]:
    placo = importlib.import_module("placo")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(to_urdf(robot), "utf-8")
        wrapper = placo.RobotWrapper(str(file), placo.Flags.ignore_collisions)
    for limited, label in ((True, "its limits"), (False, "no limits")):
        solver = placo.KinematicsSolver(wrapper)
        solver.mask_fbase(True)
        solver.dt = dt
        solver.enable_joint_limits(limited)
        solver.enable_velocity_limits(limited)
        tool = solver.add_frame_task(robot.tips[0].name, np.eye(4))
        tool.configure("tool", "soft", 1.0, 1.0)
        rest = solver.add_joints_task()
        rest.set_joints(dict(zip(robot.joint_names, start.tolist(), strict=True)))
        rest.configure("posture", "soft", POSTURE**2)

        def step(
            q: np.ndarray, pose: np.ndarray, _twist: np.ndarray, solver: Any = solver, tool: Any = tool
        ) -> np.ndarray:
            wrapper.state.q[7:] = q  # behind the pose of its free base
            wrapper.update_kinematics()
            tool.T_world_frame = pose
            return solver.solve(False)[6:] / dt

        yield f", {label}", step


def _pinocchio(robot: hk.Robot, _start: np.ndarray, _dt: float) -> Iterator[tuple[str, Step]]:
    pin = importlib.import_module("pinocchio")
    model = pin.buildModelFromXML(to_urdf(robot))
    data, frame = model.createData(), model.getFrameId(robot.tips[0].name)

    def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray) -> np.ndarray:
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        here = data.oMf[frame]
        e = np.concatenate([pose[:3, 3] - here.translation, pin.log3(pose[:3, :3] @ here.rotation.T)])
        return np.linalg.pinv(J) @ (twist + 100.0 * e)

    yield "", step


def _roboticstoolbox(_robot: hk.Robot, _start: np.ndarray, _dt: float) -> Iterator[tuple[str, Step]]:
    """Its own Panda, whose hand is elsewhere: for the time alone."""
    rtb = importlib.import_module("roboticstoolbox")
    arm = rtb.models.Panda()

    def step(q: np.ndarray, pose: np.ndarray, twist: np.ndarray) -> np.ndarray:
        e, _ = rtb.angle_axis(arm.fkine(q).A, pose), None
        return np.linalg.pinv(arm.jacob0(q)) @ (twist + 100.0 * e)

    yield "", step


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Some print when they are imported."""
    with Path(os.devnull).open("w") as nothing, contextlib.redirect_stdout(nothing):
        yield


def _seconds(call: Callable[[], object]) -> float:
    begin = time.process_time()
    call()
    return time.process_time() - begin


def page(
    rows: list[tuple[str, Timed]], floor: float, one: list[str], loops: list[tuple[str, float]],
    kept: list[tuple[str, float, int]], first: tuple[float, float, float, float], left_out: list[str], tracking: float,
    grown: list[Growth], both: list[Growth],
) -> str:  # fmt: skip
    """docs/speed.md."""
    ours = next(t.median for name, t in rows if name == "holokin, native")
    lines = [
        "# The speed benchmark\n",
        "Written by `python -m benchmarks.speed`; do not edit. Each table in one run: processor time, in turns,",
        "medians. Machines differ, ratios less so. Building and first use are by the clock on the wall.\n",
        f"Run with {versions()}; {engine()}; {processor()}, {os.cpu_count()} cores, {load()}.\n",
        "One control step of a Panda (pose task), called from Python. Ours holds the arm angle, with feedback to the",
        "path and to the leaf and with joint limits; the C floor is one call of the same step from C. `radial`",
        "carries the posture back to the centre in 4 Runge-Kutta steps at each of its steps. The libraries run as",
        "their own examples run them, pink and mink with one `Configuration` that is updated, a frame task and a",
        "posture task; of each, the limits that it takes by default and none, and every solver it has here.\n",
        "| one control step | median | p99 | in C floors | against holokin, native |",
        "|---|---:|---:|---:|---:|",
    ]
    lines += [
        f"| {name} | {1e6 * t.median:.3g} us | {1e6 * t.p99:.3g} us | {t.median / floor:.3g} | {t.median / ours:.3g} |"
        for name, t in rows
    ]
    lines += [
        *one,
        "",
        "| loops in C | a sample, one core | in C floors |",
        "|---|---:|---:|",
        *(f"| {what} | {1e6 * t:.3g} us | {t / floor:.3g} |" for what, t in loops),
        "",
        "| memory | bytes allocated for each further sample, at the peak | bytes of its outputs |",
        "|---|---:|---:|",
        *(f"| {what} | {found:.4g} | {wanted} |" for what, found, wanted in kept),
        "",
        f"First use of a strategy (build, compile, load) {first[0]:.2f} s; later, from the cache, {first[1]:.3f} s.",
        f"The same of `radial` {first[2]:.2f} s and {first[3]:.3f} s.",
        f"The step followed the circle in a loop of 0.01 s to {1e3 * tracking:.2g} mm.",
        *growth_page(grown, both),
    ]
    if left_out:
        lines += ["\nLeft out: " + "; ".join(left_out) + "."]
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Measure, write, and say where."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few rounds, and the smallest sizes")
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="folder of speed.md")
    given = parser.parse_args(arguments)
    scale = 0.01 if given.quick else 1.0
    robot = hk.load("panda")
    task = hk.pose(robot)
    pose, twist = robot.pose(START), np.array([0.1, 0.0, 0.05, 0.0, 0.0, 0.0])
    pose[0, 3] += 1e-4

    def make() -> hk.motion.Controller:
        return hk.controller(hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle()), dt=DT, q0=START)

    def make_radial() -> hk.motion.Controller:
        task = hk.pose(hk.load("panda"))
        return hk.controller(hk.radial(hk.moore_penrose(task), START), dt=DT, q0=START)

    servo, machine = make(), without_compiler(make)
    carried, slowly = make_radial(), without_compiler(make_radial)
    floor_loop = Floor(servo, pose, twist)
    others, left_out = rivals(robot, START, DT)
    steps = {
        "C floor": floor_loop,
        "holokin, native": repeated(lambda: servo.step(START, pose, twist)),
        "holokin, virtual machine": repeated(lambda: machine.step(START, pose, twist)),
        "radial of the pseudo-inverse, called from C": Floor(carried, pose, twist),
        "radial, native": repeated(lambda: carried.step(START, pose, twist)),
        "radial, virtual machine": repeated(lambda: slowly.step(START, pose, twist)),
    } | {name: repeated(lambda step=step: step(START, pose, twist)) for name, step in others}
    rounds, each = (5 if given.quick else 400), 5e-4
    times = in_turns(steps | machine_and_native(START, 3 if given.quick else None), rounds, each)
    rows, floor = [(name, times[name]) for name in steps], times["C floor"].median
    point = robot.pose(START)[:3, 3]
    loop = hk.circle(point, point - [0.1, 0, 0])
    strategy = hk.holonomic(task, hk.arm_angle())
    samples = int(100_000 * scale)
    hk.follow(strategy, loop, START, samples=samples)
    follow = min(_seconds(lambda: hk.follow(strategy, loop, START, samples=samples)) for _ in range(3)) / samples

    def integrate() -> object:
        return hk.follow(strategy, loop, START, samples=samples, method="velocity")

    integrate()
    velocity = min(_seconds(integrate) for _ in range(3)) / samples
    count = int(1_000_000 * scale)
    Q = START + np.random.default_rng(1).uniform(-0.3, 0.3, (count, 7))
    planes = curvature_function(strategy)
    strategy.batch(Q, threads=1), planes.batch(Q[: count // 10], threads=1)
    batch = min(_seconds(lambda: strategy.batch(Q, threads=1)) for _ in range(3)) / count
    curved = min(_seconds(lambda: planes.batch(Q[: count // 10], threads=1)) for _ in range(3)) / (count // 10)
    cold, warm = first_use(make)
    others_first = first_use(make_radial)
    check = simulate(servo, task, loop, START, dt=0.01)
    loops = [
        (f"`follow` by leaf, circle of {samples:,} samples", follow),
        (f"`follow` by velocity (five evaluations), {samples:,} samples", velocity),
        (f"`G.batch`, {count:,} postures", batch),
        ("curvature of all 15 planes", curved),
    ]
    kept = memory(strategy, loop, 0.2 * scale if given.quick else scale)
    grown = growth(given.quick)
    one = calls_page(times, floor)
    first = (cold, warm, *others_first)
    text = page(rows, floor, one, loops, kept, first, left_out, check.tracking_error(), *grown)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "speed.md").write_text(text, "utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
