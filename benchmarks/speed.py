"""How fast? The speed benchmark: writes docs/speed.md.

    python -m benchmarks.speed            # needs: pip install -e ".[rivals]" and a C compiler

All in one run on one machine, Panda, pose task, the same circle: one control step called from Python, ours with
feedback to the path and to the leaf, native and by the virtual machine, beside pink, mink, placo, Pinocchio and
roboticstoolbox with NumPy's pinv. The C floor is one such step called from C. Then the functions that users call in
loops, loops in C, memory, and growth with the joints.
"""

from __future__ import annotations

import argparse
import os
import platform
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np

import holokin as hk
from benchmarks.calls import Floor, Timed, calls_page, in_turns, machine_and_native, repeated
from benchmarks.drift import versions
from benchmarks.growth import START, Growth, environment, growth, growth_page
from benchmarks.pose_rivals import poses_page
from benchmarks.rivals import rivals
from holokin.analysis.curvature.curvature_of_planes import curvature_function
from holokin.motion import simulate
from holokin.symbolic.native.toolchain import engine

DT = 0.001
ROOT = Path(__file__).resolve().parents[1]


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


def median_and_p99(call: Callable[[], object], rounds: int, inner: int) -> tuple[float, float]:
    """Seconds of the processor for one call: median and 99th percentile over rounds of `inner` calls."""
    times = np.empty(rounds)
    for k in range(rounds):
        begin = time.process_time()
        for _ in range(inner):
            call()
        times[k] = (time.process_time() - begin) / inner
    return float(np.median(times)), float(np.percentile(times, 99))


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

    def follow(method: str) -> Callable[[int], object]:
        return lambda k: hk.follow(strategy, loop, START, samples=k, method=method)

    out = [(f"`follow` by {method}", slope(follow(method), low, high), 8 * 8) for method in ("leaf", "velocity")]
    return [*out, ("`G.batch`", slope(lambda k: strategy.batch(Q[:k]), 2 * low, 2 * high), 8 * 42)]


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
    grown = growth(median_and_p99, given.quick)
    one = calls_page(times, floor)
    ready = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
    with environment(**{"HOLOKIN_NATIVE": "0"} if given.quick else {}):  # no compiler for eight poses
        two_paths = poses_page(robot, ready, floor, given.quick)
    text = page(
        rows,
        floor,
        [*one, *two_paths],
        loops,
        kept,
        (cold, warm, *others_first),
        left_out,
        check.tracking_error(),
        *grown,
    )
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "speed.md").write_text(text, "utf-8")
    print(text)
    return 0


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


if __name__ == "__main__":
    raise SystemExit(main())
