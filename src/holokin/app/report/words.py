"""What figures, tables and reports say of a result, in sentences."""

from __future__ import annotations

import numpy as np

from ...base.errors import brief
from ...base.types import Vector
from ...motion.trajectory import Status, Trajectory
from ...robot import Robot
from .job_result import JobResult, StrategyResult

ALIKE = 1e-8
"""Joint difference [rad or m] that is called none in captions: nobody could measure it."""


def on_figure(name: str, most: int = 60) -> str:
    """A name as matplotlib shows it: short, without control characters, which SVG forbids, and never a formula.

    Names that begin with _ are left out of legends, so they get a blank before.
    """
    text = brief(name, most).replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text


def joint_unit(robot: Robot) -> str:
    """The unit of a robot's joints: "rad", "m", or "m or rad" where it has both."""
    return " or ".join(dict.fromkeys(c.unit for c in robot.coordinates))


def alike(shift: Vector, units: tuple[str, ...]) -> bool:
    """Whether a joint difference (n,) in these units, also printed ones, is none that anybody could measure."""
    each = {"deg": ALIKE * 180 / np.pi, "mm": 1000 * ALIKE}
    return bool((np.abs(shift) < [each.get(unit, ALIKE) for unit in units]).all())


def largest(shift: Vector, units: tuple[str, ...]) -> str:
    """The largest entry of a joint difference (n,), with the unit of the joint that it is of."""
    i = int(np.argmax(np.abs(shift)))
    return f"{abs(shift[i]):.3g} {units[i]}"


def stopped(walk: Trajectory) -> str:
    """When and why a trajectory stopped; empty for a complete one."""
    if walk.status is Status.COMPLETE:
        return ""
    return f"stopped at {walk.t[-1]:.3g} s, {walk.status.cause.removeprefix('stopped').lstrip(': ')}"


def paths_end(pair: tuple[Trajectory, Trajectory]) -> str:
    """How the clockwise and the counter-clockwise path end: alike, apart, or before the end."""
    clockwise, counter = pair
    if clockwise.status is counter.status is Status.COMPLETE:
        gap = clockwise.q[-1] - counter.q[-1]
        apart = f"the two paths end {largest(gap, clockwise.joint_units)} apart"
        return "both paths end at the same joints" if alike(gap, clockwise.joint_units) else apart
    named = [("clockwise", clockwise), ("counter-clockwise", counter)]
    return "\n".join(f"{name} {stopped(walk)}" for name, walk in named if walk.status is not Status.COMPLETE)


def away(walk: Trajectory, cycles: int) -> str:
    """Where the joints stand after some cycles."""
    count = "1 cycle" if cycles == 1 else f"{cycles} cycles"
    shift = walk.q[walk.marks[cycles]] - walk.q[0]
    same = alike(shift, walk.joint_units)
    return f"after {count}: " + ("back at the start" if same else f"{largest(shift, walk.joint_units)} away")


def check_words(strategy: StrategyResult) -> str:
    """What the checks of a motion say besides their findings: that there are none, and of which share of the path."""
    clear = strategy.motion_check is not None and strategy.motion_check.passed
    if strategy.followed == 1.0:
        return "nothing found" if clear else ""
    seen = f"the first {strategy.followed:.1%} of the path" if strategy.followed > 0 else "the start posture"
    return f"{'nothing found, but ' if clear else ''}only {seen} was looked at: there the law stopped"


def paths_words(result: JobResult) -> str:
    """That no two paths were compared, and why; empty where the path has them."""
    return f"Two paths were not compared: {result.one_way}" if result.one_way else ""


def speed_warning(result: JobResult, strategy: StrategyResult) -> str:
    """A sentence about the first joint that would have to be faster than it can; empty if none."""
    limits = result.robot.max_velocity
    shares = np.max([np.abs(w.dq).max(axis=0) / limits for w in strategy.trajectories().values()], axis=0)
    i = int(np.argmax(shares))
    if not shares[i] > 1.0:
        return ""
    slower = 0.99 * result.path.speed / shares[i]
    return (
        f"joint {result.robot.joint_names[i]!r} would have to run at {shares[i]:.3g} times its speed limit of "
        f"{result.units.said(limits[i], result.robot.coordinates[i].unit + '/s', 3)}; run the path at "
        f"{result.units.said(slower, 'm/s', 2)} or slower"
    )
