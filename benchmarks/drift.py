"""Which laws repeat? The drift benchmark: writes docs/drift.md and docs/drift.png.

    python -m benchmarks.drift            # needs: pip install -e ".[rivals]"
    python -m benchmarks.drift --quick --out /somewhere

Every law runs in the same loop (dq once a step of 0.01 s, q <- q + dt dq), on the same kinematics, from the same
start, round the same paths. Libraries that are not installed are left out and named.
"""

from __future__ import annotations

import argparse
import platform
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, files, version
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from holokin.app.report.plots import BLUE, GREEN, ORANGE, PURPLE, VERMILLION, beside, write_figure
from holokin.base.errors import ControllerError, MissingExtraError, PathError
from holokin.motion import control
from holokin.motion.control import PostureTask, mink_law, pink_law, placo_law
from holokin.strategies import constraints, impedance, inertia_weighted

COLORS = {"no rule": VERMILLION, "posture": ORANGE, "to a leaf": PURPLE, "no feedback": GREEN, "holonomic": BLUE}
MEANINGS = {
    "no rule": "no rule",
    "posture": "posture task",
    "to a leaf": "nears a leaf",
    "no feedback": "holonomic, no feedback",
    "holonomic": "holonomic",
}
LEAST = 1e-7
"""What is smaller is drawn there."""


def drift_picture(every: Sequence[Row]) -> Any:
    """The rows of one arm: above their drift since the start, below each law with its two differences."""
    from matplotlib.figure import Figure

    rows = [r for r in every if not r.fault]
    figure = Figure(figsize=(7.3, 9.6), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=(1, 1.5))
    _histories(above, rows)
    _differences(below, rows)
    handles = [*above.get_legend_handles_labels()[0], *below.get_legend_handles_labels()[0]]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, columnspacing=1.2)
    return figure


def _histories(axes: Any, rows: Sequence[Row]) -> None:
    for r in rows:
        cycles = np.arange(1, len(r.history) + 1)
        axes.plot(cycles, np.maximum(r.history, LEAST), color=COLORS[r.kind], lw=1.5, alpha=0.75)
    for kind, color in COLORS.items():
        axes.plot([], [], color=color, lw=3, label=MEANINGS[kind])
    axes.set_yscale("log")
    worst = {r.kind: r for r in sorted(rows, key=lambda r: r.history[-1])}.values()
    beside(axes, [(max(r.history[-1], LEAST), r.law, COLORS[r.kind]) for r in worst])
    axes.set_xlabel("cycles of the circle")
    axes.set_ylabel("largest joint's drift since the start [rad]")
    axes.set_title("Does it repeat? The worst of each kind is named", loc="left", fontweight="bold")


def _differences(axes: Any, rows: Sequence[Row]) -> None:
    names = [r.law for r in rows][::-1]
    y, shades = np.arange(len(names)), [COLORS[r.kind] for r in rows[::-1]]
    for figure_name, marker, label in (("ways", "o", "two paths to it"), ("speeds", "D", "slow or fast")):
        values = np.maximum([getattr(r, figure_name) for r in rows[::-1]], LEAST)
        axes.scatter(values, y, marker=marker, s=42, c=shades, edgecolors="white", lw=0.6, zorder=3)
        axes.scatter([], [], marker=marker, c="0.4", label=label)
    axes.set_yticks(y, names)
    axes.set_xscale("log")
    axes.set_xlabel("difference of the joints at one tool pose [rad]")
    axes.set_title("Do the joints belong to the pose?", loc="left", fontweight="bold")
    axes.grid(axis="x", visible=False)


# --- the laws, what is measured of them, the page


DT = 0.01
GAIN = 50.0
SPEEDS = (0.05, 0.1, 0.3)
STARTS = {
    "panda": np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]),
    "iiwa14": np.array([0.1, 0.6, 0.2, -1.4, 0.1, 1.1, 0.0]),
}
QUICK = ("Moore-Penrose", "gradient projection, 1/s", "locked joint 3")
ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Row:
    """What one law did on one arm; angles in rad, worst of the paths, tracking in mm."""

    law: str
    kind: str
    first: float
    later: float
    ways: float
    speeds: float
    tracking: float
    effort: float
    within: bool
    history: np.ndarray
    fault: str = ""


def laws(robot: hk.Robot, start: np.ndarray) -> list[tuple[str, str, Callable[[], object]]]:
    """(name, kind, maker) of everything that is compared."""
    task = hk.pose(robot)
    given = hk.moore_penrose(task)

    def held(g: hk.Constraint) -> Callable[[], object]:
        leaf = hk.holonomic(task, g).constraint_value(start)  # feedback to the leaf, as to the path
        return lambda: control.asymptotically_cyclic(task, g, leaf, GAIN, GAIN)

    twin = hk.radial(given, start).constraint
    turned = hk.pose(robot, "rpy")  # impedance needs coordinates
    bent = constraints.posture_cost(start + 0.3)
    weights = np.diag([1.0, 0.5, 1.0, 0.5, 1.0, 1.0, 2.0])
    names = robot.joint_names
    apart, swivel = hk.linear([1, 0, -1, 0, 0, 0, 0]), hk.arm_angle(pole=(0, -1, 0))
    rest = constraints.posture_cost(start)
    return [
        ("Moore-Penrose", "no rule", lambda: control.closed_loop(given, GAIN)),
        ("damped, 0.05", "no rule", lambda: control.damped(task, 0.05, GAIN)),
        ("weighted", "no rule", lambda: control.closed_loop(hk.weighted(task, weights), GAIN)),
        ("pink", "no rule", lambda: pink_law(robot)),
        ("mink", "no rule", lambda: mink_law(robot)),
        ("placo", "no rule", lambda: placo_law(robot)),
        ("gradient projection, 1/s", "posture", lambda: control.gradient_projection(task, rest, 1.0, GAIN)),
        ("gradient projection, 10/s", "posture", lambda: control.gradient_projection(task, rest, 10.0, GAIN)),
        ("cyclic in the end, 1/s", "to a leaf", lambda: to_the_leaf(task, start)),
        ("repetitive motion, 4/s", "posture", lambda: control.repetitive_motion(task, 4.0, GAIN)),
        ("pink, cost 1e-3, gain 0.05", "posture", lambda: pink_law(robot, PostureTask(1e-3, 0.05))),
        ("pink, cost 1e-3, gain 1", "posture", lambda: pink_law(robot, PostureTask(1e-3))),
        ("pink, cost 0.1, gain 1", "posture", lambda: pink_law(robot, PostureTask(0.1))),
        ("mink, cost 1e-3, gain 1", "posture", lambda: mink_law(robot, PostureTask(1e-3))),
        ("mink, cost 1e-2, gain 1", "posture", lambda: mink_law(robot, PostureTask(1e-2))),
        ("placo, weight 1e-4", "posture", lambda: placo_law(robot, PostureTask(1e-4))),
        ("pink, leaf of q1 - q3", "holonomic", lambda: pink_law(robot, leaf=hk.holonomic(task, apart))),
        ("mink, leaf of q1 - q3", "holonomic", lambda: mink_law(robot, leaf=hk.holonomic(task, apart))),
        ("locked joint 3", "holonomic", held(hk.lock(2))),
        ("linear, q1 - q3", "holonomic", held(apart)),
        ("height of joint 4 + q1 - q3", "holonomic", held(constraints.total(apart, constraints.height(names[3])))),
        ("tilted arm angle", "holonomic", held(constraints.tilted(swivel, lambda x: 0.2 * (x[0] - x[1])))),
        ("arm angle", "holonomic", held(swivel)),
        ("stationary posture", "holonomic", held(hk.stationary(rest))),
        ("stationary centring", "holonomic", held(hk.stationary(constraints.centring_cost(), free=(names[2],)))),
        ("impedance", "no feedback", lambda: control.closed_loop(impedance(turned, bent), GAIN)),
        ("impedance with memory", "no feedback", lambda: control.impedance_with_memory(turned, bent)),
        ("radial strategy", "holonomic", held(twin)),
        *with_masses(robot),
    ]


def with_masses(robot: hk.Robot) -> list[tuple[str, str, Callable[[], object]]]:
    """Laws that need masses, for the Panda, whose URDF the package example-robot-data holds (the extra `test`)."""
    try:
        listed = files("example-robot-data") or []
    except PackageNotFoundError:
        return []
    found = [Path(str(f.locate())) for f in listed if f.name == f"{robot.name}.urdf"]
    if not found:
        return []
    task = hk.pose(hk.from_urdf(found[0], tip=robot.tips[0].name))
    carried = hk.stationary(constraints.gravity_cost())
    leaf = hk.holonomic(task, carried).constraint_value(STARTS[robot.name])
    return [
        ("inertia-weighted", "no rule", lambda: control.closed_loop(inertia_weighted(task), GAIN)),
        ("stationary gravity", "holonomic", lambda: control.asymptotically_cyclic(task, carried, leaf, GAIN, GAIN)),
    ]


def to_the_leaf(task: hk.Task, start: np.ndarray) -> object:
    """De Luca's law, begun 0.1 rad off its leaf."""
    return control.asymptotically_cyclic(task, hk.lock(2), start[2] + 0.1, 1.0, GAIN)


def paths(point: np.ndarray) -> dict[str, hk.Path]:
    """Circle of 0.1 m, figure eight of two of 0.07 m, square of 0.14 m; horizontal, orientation kept."""
    left, right = (hk.circle(point, point + [sign * 0.07, 0, 0], clockwise=sign > 0) for sign in (-1, 1))
    square = point + 0.14 * np.array([[0, 0, 0], [-1, 0, 0], [-1, -1, 0], [0, -1, 0]])
    return {
        "circle": hk.circle(point, point - [0.1, 0, 0]),
        "figure eight": hk.path.join(left, right),
        "square": hk.polyline(square, closed=True),
    }


def measure(name: str, kind: str, make: Callable[[], object], robot: hk.Robot, start: np.ndarray, cycles: int) -> Row:
    """Run one law round every path and by both paths at every speed."""
    task = hk.pose(robot)
    point = robot.pose(start)[:3, 3]
    law = make()
    first, later, tracking, within = 0.0, 0.0, 0.0, True
    moved, least, history = 0.0, 0.0, np.zeros(cycles)
    fault = ""
    try:
        for label, path in paths(point).items():
            walk = hk.simulate(law, task, path, start, dt=DT, cycles=cycles, patience=5.0)
            each = np.abs(walk.drift()).max(axis=1)
            first, later = max(first, each[0]), max(later, each[-1])
            tracking = max(tracking, 1e3 * walk.tracking_error())
            within &= bool(((walk.q >= robot.lower) & (walk.q <= robot.upper)).all())
            J, _ = task.jacobian_batch(walk.q)
            moved += float(np.sum(walk.dq**2))
            least += float(np.sum(np.einsum("kij,kjl,kl->ki", np.linalg.pinv(J), J, walk.dq) ** 2))
            if label == "circle":
                history = np.abs(walk.drift_since_start()).max(axis=1)
        ends = []
        for speed in SPEEDS:
            a, b = paths(point)["circle"].at_speed(speed).halves()
            ends.append([hk.simulate(law, task, way, start, dt=DT, patience=5.0).q[-1] for way in (a, b)])
        apart = max(float(np.abs(a - b).max()) for a, b in ends)
        hurried = max(float(np.abs(pair[0] - ends[1][0]).max()) for pair in ends)
    except (ControllerError, PathError) as problem:
        return Row(name, kind, *[np.nan] * 6, False, history, str(problem))
    return Row(name, kind, first, later, apart, hurried, tracking, np.sqrt(moved / least), within, history, fault)


def exact(robot: hk.Robot, start: np.ndarray) -> float:
    """Drift of a holonomic strategy followed by leaf instead of by steps: round-off."""
    point = robot.pose(start)[:3, 3]
    strategy = hk.holonomic(hk.pose(robot), hk.lock(2))
    return max(
        float(hk.drift(strategy, path, start, cycles=3, samples=100).largest.max()) for path in paths(point).values()
    )


def run(cycles: int, only: tuple[str, ...] | None) -> tuple[dict[str, list[Row]], dict[str, float], list[str]]:
    """Every law on every arm, with a progress bar. `only` limits the kinds."""
    from rich.progress import Progress

    found: dict[str, list[Row]] = {}
    missing: list[str] = []
    round_off: dict[str, float] = {}
    with Progress() as bar:
        for name, start in STARTS.items():
            robot = hk.load(name)
            entries = [e for e in laws(robot, start) if only is None or e[0] in only]
            ticker = bar.add_task(name, total=len(entries))
            found[name] = []
            for label, kind, make in entries:
                try:
                    found[name].append(measure(label, kind, make, robot, start, cycles))
                except MissingExtraError as problem:
                    missing.append(f"{label} ({problem})")
                bar.advance(ticker)
            round_off[name] = exact(robot, start)
    return found, round_off, sorted(set(missing))


def table(rows: list[Row]) -> str:
    """A Markdown table."""
    head = (
        "| law | rule | first cycle | a later cycle | two paths apart | slow against fast | tracking | speed / MP |\n"
        "|---|---|---:|---:|---:|---:|---:|---:|\n"
    )
    lines = []
    for r in rows:
        if r.fault:
            lines.append(f"| {r.law} | {r.kind} | stopped: {r.fault} | | | | | |")
            continue
        limits = "" if r.within else ", past a limit"
        cells = [f"{v:.1e}" for v in (r.first, r.later, r.ways, r.speeds)]
        lines.append(f"| {r.law} | {r.kind} | {' | '.join(cells)} | {r.tracking:.2g} mm{limits} | {r.effort:.3f} |")
    return head + "\n".join(lines) + "\n"


def versions() -> str:
    """What was run, and on what."""
    out = [f"holokin {hk.__version__}"]
    for package in ("casadi", "numpy", "pin-pink", "pin", "mink", "mujoco", "placo"):
        try:
            out.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            continue
    return f"{', '.join(out)}; Python {platform.python_version()}, {platform.system()} {platform.machine()}"


def span(rows: list[Row], figure: str, form: str = ".1e") -> str:
    """The least and the greatest of a figure."""
    values = [getattr(r, figure) for r in rows] or [np.nan]
    return f"{min(values):{form}} to {max(values):{form}}"


def text(found: dict[str, list[Row]], round_off: dict[str, float], missing: list[str], cycles: int) -> str:
    """docs/drift.md."""
    every = {name: {r.law: r for r in rows} for name, rows in found.items()}
    mp = every["panda"]["Moore-Penrose"]
    holonomic = [r for rows in found.values() for r in rows if r.kind == "holonomic" and not r.fault]
    posture = [r for rows in found.values() for r in rows if r.kind == "posture" and not r.fault]
    free = [r for rows in found.values() for r in rows if r.kind == "no rule" and not r.fault]

    speeds = ", ".join(map(str, SPEEDS))
    parts = [
        "# The drift benchmark\n",
        "Written by `python -m benchmarks.drift`; do not edit. Which laws return the joints, and do the joints at",
        "a tool pose depend on the path or the speed? [The league](league.md) compares libraries, each in an",
        "environment of its own and at its best settings; here are laws, in one process.\n",
        f"Run with {versions()}.\n",
        f"Every law is called once a step of {DT} s, q <- q + dt dq, on the same kinematics, from the same start, at",
        "constant orientation: a circle of 0.1 m radius, a figure eight of two circles of 0.07 m, a square of 0.14 m,",
        f"{cycles} cycles each at 0.1 m/s; then half the circle by both ways at {speeds} m/s.",
        f"Where a law has feedback it has the gain {GAIN:g}/s, to the path and to the leaf alike. With a leaf pink",
        "and mink have `pink_task` or `mink_task` as an equality constraint, gain 1, and no posture task.\n",
        "Numbers are the largest joint's [rad], worst of the paths: **first cycle** and **a later cycle** (the last):",
        "drift of that cycle; **two paths apart**: joints at the pose opposite the start, reached clockwise and",
        "counter-clockwise; **slow against fast**: the same pose reached at another speed; **tracking**: worst",
        "distance of the tool; **speed / MP**: joint speed over the least that does the same tool motion.\n",
        "![drift on the Panda circle, and what a pose's joints depend on](drift.png)\n",
    ]
    for name, rows in found.items():
        parts += [f"## {name}\n", f"Start q = {np.array2string(STARTS[name], separator=', ')}.\n", table(rows)]
    cheap = [rows["radial strategy"].effort for rows in every.values() if "radial strategy" in rows]
    bent = max((r.tracking for r in posture), default=np.nan)
    parts += [
        "## Reading it\n",
        f"- Without a rule for the redundant joint every law drifts, {span(free, 'first')} rad in the first cycle,",
        f"  and goes on: on the Panda the pseudo-inverse is {mp.history[-1]:.2f} rad away after {cycles} circles.",
        "  pink, mink and placo without a posture task are it: that is what they compute.",
        "- **A posture task is what users have, and it does repeat**: a later cycle drifts",
        f"  {span(posture, 'later')} rad. Which joints belong to a pose still depends on the way",
        f"  ({span(posture, 'ways')} rad) and on the speed ({span(posture, 'speeds')} rad):",
        "  the stronger the pull, the less; and the more a soft task bends the path,",
        f"  up to {bent:.2g} mm here with the highest cost.",
        "- It is good where that does not matter: nothing to choose but a posture, joint speed",
        f"  {span(posture, 'effort', '.3f')} times the least, no singularities of its own,",
        "  any number of redundant joints.",
        "- On these paths a holonomic law's joints are a function of the pose: two paths agree to",
        f"  {span(holonomic, 'ways')} rad, a later cycle drifts {span(holonomic, 'later')} rad.",
        "  What is left is the step of the loop: by `hk.follow`, which solves for the leaf at every sample,",
        f"  a cycle ends {max(round_off.values()):.0e} rad from where it began.",
        *held_by_libraries(every),
        "- Impedance has no constraint to feed back: it is holonomic, and drifts by the error of the step alone.",
        f"- Repeatability costs joint speed, {span(holonomic, 'effort', '.3f')} times the least; the radial strategy",
        f"  of the pseudo-inverse {' and '.join(f'{v:.3f}' for v in cheap)} times.",
    ]
    parts += ["\nNot installed, so left out: " + "; ".join(missing) + "."] if missing else []
    return "\n".join(parts) + "\n"


def held_by_libraries(every: dict[str, dict[str, Row]]) -> list[str]:
    """How much nearer two paths are when a library holds a leaf than with its posture task, where both were run."""
    lines = []
    for library in ("pink", "mink"):
        soft, hard = f"{library}, cost 1e-3, gain 1", f"{library}, leaf of q1 - q3"
        pairs = [(rows[soft], rows[hard]) for rows in every.values() if {soft, hard} <= set(rows)]
        if pairs:
            times = " and ".join(f"{a.ways / b.ways:,.0f}" for a, b in pairs)
            tracking = max(b.tracking / a.tracking for a, b in pairs)
            lines.append(f"- {library}, our leaf instead of its posture task: two paths {times} times nearer,")
            lines.append(f"  at {tracking:.2f} times the tracking error or less.")
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Run, write, and say where."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="three laws, two cycles, steps of 0.05 s")
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="folder of drift.md and drift.png")
    given = parser.parse_args(arguments)
    if given.quick:
        with _coarse():
            return _written(given.out, 2, QUICK)
    return _written(given.out, 10, None)


@contextmanager
def _coarse() -> Iterator[None]:
    """Larger steps, and gains that suit them, for a while."""
    global DT, GAIN
    before, (DT, GAIN) = (DT, GAIN), (0.05, 10.0)
    try:
        yield
    finally:
        DT, GAIN = before


def _written(out: Path, cycles: int, only: tuple[str, ...] | None) -> int:
    try:
        found, round_off, missing = run(cycles, only)
    except KeyboardInterrupt:
        print("stopped; nothing was written")
        return 130
    out.mkdir(parents=True, exist_ok=True)
    write_figure(lambda: drift_picture(found["panda"]), out / "drift.png")
    (out / "drift.md").write_text(text(found, round_off, missing, cycles), "utf-8")
    print(f"wrote {out / 'drift.md'} and drift.png")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
