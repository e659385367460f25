"""Which laws repeat? The drift benchmark of docs/measured.md, and drift.png.

Every law runs in the same loop (dq once a step of 0.01 s, q <- q + dt dq), on the same kinematics, from the same
start, round the same paths. Libraries that are not installed are left out and named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.page import Given, table, versions, wrapped
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
SHOWN = (
    "Moore-Penrose", "damped, 0.05", "pink", "mink", "placo", "inertia-weighted", "gradient projection, 1/s",
    "gradient projection, 10/s", "repetitive motion, 4/s", "cyclic in the end, 1/s", "pink, cost 1e-3, gain 1",
    "pink, cost 0.1, gain 1", "mink, cost 1e-3, gain 1", "placo, weight 1e-4", "pink, leaf of q1 - q3",
    "mink, leaf of q1 - q3", "locked joint 3", "linear, q1 - q3", "arm angle", "stationary posture",
    "impedance with memory", "radial strategy",
)  # fmt: skip
"""Those of the table; the picture has all."""


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


def run(cycles: int, only: tuple[str, ...] | None) -> tuple[dict[str, list[Row]], float, list[str]]:
    """Every law on every arm, or those that are named; what round-off alone makes; what is not installed."""
    found: dict[str, list[Row]] = {}
    missing: dict[str, None] = {}
    round_off = 0.0
    for name, start in STARTS.items():
        robot = hk.load(name)
        found[name] = []
        for label, kind, make in laws(robot, start):
            if only is None or label in only:
                print(f"{name}: {label}", flush=True)
                try:
                    found[name].append(measure(label, kind, make, robot, start, cycles))
                except MissingExtraError as problem:
                    missing[f"{label} ({problem})"] = None
        round_off = max(round_off, exact(robot, start))
    return found, round_off, [*missing]


def rows_of(found: dict[str, list[Row]]) -> Iterator[list[str]]:
    """Cells of the table: of each law that is shown the worst of the arms."""
    for law in SHOWN:
        if rows := [r for each in found.values() for r in each if r.law == law]:
            if fault := next((r.fault for r in rows if r.fault), ""):
                yield [law, rows[0].kind, f"stopped: {fault}", *[""] * 5]
                continue
            worst = [max(getattr(r, figure) for r in rows) for figure in ("first", "later", "ways", "speeds")]
            limits = "" if all(r.within for r in rows) else ", past a limit"
            tracking, effort = max(r.tracking for r in rows), max(r.effort for r in rows)
            yield [law, rows[0].kind, *(f"{v:.1e}" for v in worst), f"{tracking:.2g} mm{limits}", f"{effort:.3f}"]


def span(rows: list[Row], figure: str, form: str = ".0e") -> str:
    """The least and the greatest of a figure."""
    values = [getattr(r, figure) for r in rows] or [np.nan]
    return f"{min(values):{form}} to {max(values):{form}}"


def text(found: dict[str, list[Row]], round_off: float, missing: list[str], cycles: int) -> list[str]:
    """The blocks of the page."""
    every = [r for rows in found.values() for r in rows if not r.fault]
    free, posture, held = ([r for r in every if r.kind == kind] for kind in ("no rule", "posture", "holonomic"))
    mp = next(r for r in found["panda"] if r.law == "Moore-Penrose")
    speeds = ", ".join(map(str, SPEEDS))
    return [
        "## Drift",
        wrapped(
            f"""Which laws return the joints, and do the joints at a tool pose depend on the path or the speed? Every
            law is called once a step of {DT} s on the same kinematics of a Panda and an iiwa 14, at constant
            orientation: round a circle of 0.1 m radius, a figure eight and a square, {cycles} cycles each at 0.1 m/s;
            then half the circle by both ways at {speeds} m/s. Feedback to the path, and to a leaf where there is one,
            has the gain {GAIN:g}/s. With a leaf, pink and mink have `pink_task` or `mink_task` as an equality
            constraint."""
        ),
        wrapped(
            f"""Without a rule for the redundant joint every law drifts, by {span(free, "first")} in the first cycle,
            and goes on: the pseudo-inverse of the Panda is {mp.history[-1]:.2f} rad away after {cycles} circles. A
            posture task, which is what most users have, does repeat: a later cycle drifts {span(posture, "later")}.
            But which joints belong to a pose still depends on the way to it ({span(posture, "ways")}) and on the speed
            ({span(posture, "speeds")}); a stronger pull makes that less, and bends the path. It costs next to no joint
            speed ({span(posture, "effort", ".3f")} times the least), and is the better choice where only the return
            matters. On these paths, a holonomic law's joints are a function of the pose: two ways agree to {
                span(held, "ways")
            }, which is the error of the steps; by `hk.follow` a cycle ends {round_off:.0e} rad from
            its beginning. That costs {span(held, "effort", ".3f")} times the least joint speed."""
        ),
        "![Drift on the Panda circle, and what the joints at a pose depend on, of all laws](drift.png)",
        wrapped(
            """*First* and *later cycle* (the last): the drift of that cycle. *Two ways*: the difference of the joints
            opposite the start, reached clockwise and counter-clockwise. *Slow, fast*: the same at another speed.
            *Tool*: its largest distance from the path. *Speed*: joint speed over the least that moves the tool so.
            Each is the worst of the paths and of both arms."""
        ),
        table(
            ("law", "rule", "first cycle", "later cycle", "two ways", "slow, fast", "tool", "speed"), rows_of(found), 2
        ),
        *(["Not installed, so left out: " + "; ".join(missing) + "."] if missing else []),
    ]


def section(given: Given) -> tuple[list[str], str]:
    """Measure, draw; the blocks of docs/measured.md, and the versions."""
    with _coarse() if given.quick else nullcontext():
        cycles, only = (2, QUICK) if given.quick else (10, None)
        found, round_off, missing = run(cycles, only)
        write_figure(lambda: drift_picture(found["panda"]), given.out / "drift.png")
        return text(found, round_off, missing, cycles), versions(*PACKAGES)


HEAD = ("law", "rule", "first cycle", "later cycle", "two ways", "slow, fast", "tool", "speed")
PACKAGES = ("casadi", "numpy", "pin", "pin-pink", "mink", "mujoco", "placo")


@contextmanager
def _coarse() -> Iterator[None]:
    """Larger steps, and gains that suit them, for a while."""
    global DT, GAIN
    before, (DT, GAIN) = (DT, GAIN), (0.05, 10.0)
    try:
        yield
    finally:
        DT, GAIN = before
