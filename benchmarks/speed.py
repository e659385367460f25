"""How fast? The speed benchmark: writes docs/speed.md.

    python -m benchmarks.speed            # needs: pip install -e ".[rivals]" and a C compiler

All in one run on one machine, Panda, pose task, the same circle: one control step called from Python, ours with
feedback to the path and to the leaf, native and by the virtual machine, beside pink, mink, placo, Pinocchio and
roboticstoolbox with NumPy's pinv. The C floor is a bare scalar C loop over our generated step. Then loops in C,
memory, and growth with the joints.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import platform
import tempfile
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np

import holokin as hk
from benchmarks.drift import versions
from benchmarks.growth import START, Growth, environment, growth, growth_page
from holokin.analysis.brackets import curvature_function
from holokin.codegen.native import engine, library
from holokin.codegen.source import step_source
from holokin.errors import MissingExtraError
from holokin.laws import PostureTask, mink_law, pink_law, placo_law
from holokin.motion import ControlLaw, simulate

DT = 0.001
ROOT = Path(__file__).resolve().parents[1]
LOOP = """
double floor_loop(long long count, const double *q, const double *pose, const double *twist, const double *parameters) {
  double out[HK_N + 1], sum = 0.0;
  for (long long i = 0; i < count; i++) {
    hk_step(q + HK_N * (i % 256), pose, twist, out, parameters);
    sum += out[0];
  }
  return sum;
}
"""


def processor() -> str:
    """The machine's name: the model of its processor, where the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def median_and_p99(call: Callable[[], object], rounds: int, inner: int) -> tuple[float, float]:
    """Seconds of one call: median and 99th percentile over rounds of `inner` calls."""
    times = np.empty(rounds)
    for k in range(rounds):
        begin = time.perf_counter()
        for _ in range(inner):
            call()
        times[k] = (time.perf_counter() - begin) / inner
    return float(np.median(times)), float(np.percentile(times, 99))


def c_floor(servo: hk.motion.Controller, pose: np.ndarray, twist: np.ndarray) -> tuple[float, float]:
    """Seconds of one step in a bare C loop."""
    lib = library(step_source(*servo.generated) + LOOP)
    run = lib.floor_loop
    run.restype, run.argtypes = ctypes.c_double, [ctypes.c_longlong] + [ctypes.c_void_p] * 4
    Q = START + np.random.default_rng(0).uniform(-0.05, 0.05, (256, 7))
    arguments = (1_000, *(array.ctypes.data for array in (Q, pose, twist, servo.parameters)))
    median, p99 = median_and_p99(lambda: run(*arguments), 1_000, 1)  # rounds as long as those of the steps
    return median / 1_000, p99 / 1_000


def without_compiler(make: Callable[[], hk.motion.Controller]) -> hk.motion.Controller:
    """A controller on the virtual machine."""
    with environment(HOLOKIN_NATIVE="0"):
        return make()


def first_use(make: Callable[[], hk.motion.Controller]) -> tuple[float, float]:
    """Seconds to build, compile and load a new strategy, and again from the cache."""
    with tempfile.TemporaryDirectory() as folder, environment(HOLOKIN_CACHE=folder):
        return _seconds(make), _seconds(make)


def rivals(robot: hk.Robot) -> list[tuple[str, ControlLaw | str]]:
    """The libraries, or why one is left out."""
    import numpy.linalg as la

    out: list[tuple[str, ControlLaw | str]] = []
    for name, make in (("pink", pink_law), ("mink", mink_law), ("placo", placo_law)):
        try:
            out += [(law.name, law) for law in (make(robot, PostureTask(1e-3), limits=on) for on in (True, False))]
        except MissingExtraError as problem:
            out.append((name, str(problem)))
    out.append(("roboticstoolbox + pinv", _roboticstoolbox()))
    try:
        import pinocchio as pin
    except ImportError:
        return [*out, ("Pinocchio + pinv", "not installed")]
    from holokin.robot import to_urdf

    model = pin.buildModelFromXML(to_urdf(robot))
    data, frame = model.createData(), model.getFrameId(robot.tips[0].name)

    def law(q, pose, twist, dt):
        J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        here = data.oMf[frame]
        e = np.concatenate([pose[:3, 3] - here.translation, pin.log3(pose[:3, :3] @ here.rotation.T)])
        return la.pinv(J) @ (twist + 100.0 * e)

    return [*out, ("Pinocchio + pinv", ControlLaw("Pinocchio + pinv", lambda _q0: law))]


def _roboticstoolbox() -> ControlLaw | str:
    """Its own Panda, whose hand is elsewhere: for the time alone."""
    try:
        import roboticstoolbox as rtb
    except ImportError:
        return "not installed"
    arm = rtb.models.Panda()

    def law(q, pose, twist, dt):
        e, _ = rtb.angle_axis(arm.fkine(q).A, pose), dt
        return np.linalg.pinv(arm.jacob0(q)) @ (twist + 100.0 * e)

    return ControlLaw("roboticstoolbox + pinv", lambda _q0: law)


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

    low, high = 100_000, int(100_000 + 200_000 * max(scale, 0.5))
    Q = START + np.random.default_rng(1).uniform(-0.3, 0.3, (2 * high, 7))

    def follow(method: str) -> Callable[[int], object]:
        return lambda k: hk.follow(strategy, loop, START, samples=k, method=method)

    out = [(f"`follow` by {method}", slope(follow(method), low, high), 8 * 8) for method in ("leaf", "velocity")]
    return [*out, ("`G.batch`", slope(lambda k: strategy.batch(Q[:k]), 2 * low, 2 * high), 8 * 42)]


def main(arguments: list[str] | None = None) -> int:
    """Measure, write, and say where."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few rounds")
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="folder of speed.md")
    given = parser.parse_args(arguments)
    scale = 0.05 if given.quick else 1.0
    robot = hk.load("panda")
    task = hk.pose(robot)
    pose, twist = robot.pose(START), np.array([0.1, 0.0, 0.05, 0.0, 0.0, 0.0])
    pose[0, 3] += 1e-4

    def make() -> hk.motion.Controller:
        return hk.controller(hk.holonomic(hk.pose(hk.load("panda")), hk.arm_angle()), dt=DT, start=START)

    servo, machine = make(), without_compiler(make)
    floor, floor99 = c_floor(servo, pose, twist)
    rounds = max(20, int(200 * scale))
    rows = [("C floor", floor, floor99)]
    rows.append(("holokin, native", *median_and_p99(lambda: servo.step(START, pose, twist), rounds, 1000)))
    rows.append(("holokin, virtual machine", *median_and_p99(lambda: machine.step(START, pose, twist), rounds, 200)))
    left_out = []
    for name, law in rivals(robot):
        if isinstance(law, str):
            left_out.append(f"{name} ({law})")
            continue
        step = law.begin(START.copy())
        rows.append((name, *median_and_p99(lambda step=step: step(START, pose, twist, DT), rounds, 20)))
    point = robot.pose(START)[:3, 3]
    loop = hk.circle(point, point - [0.1, 0, 0])
    strategy = hk.holonomic(task, hk.arm_angle())
    samples = int(100_000 * max(scale, 0.06))
    hk.follow(strategy, loop, START, samples=samples)
    follow = min(_seconds(lambda: hk.follow(strategy, loop, START, samples=samples)) for _ in range(3)) / samples

    def integrate() -> object:
        return hk.follow(strategy, loop, START, samples=samples, method="velocity")

    integrate()
    velocity = min(_seconds(integrate) for _ in range(3)) / samples
    count = int(1_000_000 * max(scale, 0.06))
    Q = START + np.random.default_rng(1).uniform(-0.3, 0.3, (count, 7))
    planes = curvature_function(strategy)
    strategy.batch(Q, threads=1), planes.batch(Q[: count // 10], threads=1)
    batch = min(_seconds(lambda: strategy.batch(Q, threads=1)) for _ in range(3)) / count
    curved = min(_seconds(lambda: planes.batch(Q[: count // 10], threads=1)) for _ in range(3)) / (count // 10)
    cold, warm = first_use(make)
    check = simulate(servo, task, loop, START, dt=0.01)
    loops = [
        (f"`follow` by leaf, circle of {samples:,} samples", follow),
        (f"`follow` by velocity (five evaluations), {samples:,} samples", velocity),
        (f"`G.batch`, {count:,} postures", batch),
        ("curvature of all 15 planes", curved),
    ]
    kept = memory(strategy, loop, scale)
    grown = growth(median_and_p99, given.quick)
    text = page(rows, floor, loops, kept, (cold, warm), left_out, check.tracking_error(), *grown)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "speed.md").write_text(text, "utf-8")
    print(text)
    return 0


def _seconds(call: Callable[[], object]) -> float:
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def page(
    rows: list[tuple[str, float, float]], floor: float, loops: list[tuple[str, float]],
    kept: list[tuple[str, float, int]], first: tuple[float, float], left_out: list[str], tracking: float,
    grown: list[Growth], both: list[Growth],
) -> str:  # fmt: skip
    """docs/speed.md."""
    ours = next(t for name, t, _ in rows if name == "holokin, native")
    lines = [
        "# The speed benchmark\n",
        "Written by `python -m benchmarks.speed`; do not edit. Everything in one run, medians; machines differ, ratios",
        "less so.\n",
        f"Run with {versions()}; {engine()}; {processor()}, {os.cpu_count()} cores.\n",
        "One control step of a Panda (pose task), called from Python. Ours holds the arm angle, with feedback to the",
        "path and to the leaf and with joint limits; the C floor is a bare C loop over the same generated step.\n",
        "| one control step | median | p99 | in C floors | against holokin, native |",
        "|---|---:|---:|---:|---:|",
    ]
    lines += [
        f"| {name} | {1e6 * t:.3g} us | {1e6 * p:.3g} us | {t / floor:.3g} | {t / ours:.3g} |" for name, t, p in rows
    ]
    lines += [
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
        f"The step followed the circle in a loop of 0.01 s to {1e3 * tracking:.2g} mm.",
        *growth_page(grown, both),
    ]
    if left_out:
        lines += ["\nLeft out: " + "; ".join(left_out) + "."]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    raise SystemExit(main())
