"""What figures, tables and reports say of a result, in sentences."""

from __future__ import annotations

import numpy as np

from ..robot import Robot
from ..trajectory import Status, Trajectory
from ..types import Vector
from .result import JobResult, StrategyResult

ALIKE = 1e-8
"""Joint difference [rad or m] that is called none in captions: nobody could measure it."""


def joint_unit(robot: Robot) -> str:
    """The unit of a robot's joints: "rad", "m", or "m or rad" where it has both."""
    return " or ".join(dict.fromkeys(c.unit for c in robot.coordinates))


def largest(shift: Vector, units: tuple[str, ...]) -> str:
    """The largest entry of a joint difference (n,), with the unit of the joint that it is of."""
    i = int(np.argmax(np.abs(shift)))
    return f"{abs(shift[i]):.3g} {units[i]}"


def stopped(walk: Trajectory) -> str:
    """When and why a trajectory stopped; empty for a complete one."""
    if walk.status is Status.COMPLETE:
        return ""
    return f"stopped at {walk.t[-1]:.3g} s, {walk.status.cause.removeprefix('stopped').lstrip(': ')}"


def ways_end(ways: tuple[Trajectory, Trajectory]) -> str:
    """How the clockwise and the counter-clockwise way end: alike, apart, or before the end."""
    clockwise, counter = ways
    if clockwise.status is counter.status is Status.COMPLETE:
        gap = clockwise.q[-1] - counter.q[-1]
        apart = f"the two ways end {largest(gap, clockwise.joint_units)} apart"
        return "both ways end alike" if np.abs(gap).max() < ALIKE else apart
    named = [("clockwise", clockwise), ("counter-clockwise", counter)]
    return "\n".join(f"{name} {stopped(walk)}" for name, walk in named if walk.status is not Status.COMPLETE)


def away(walk: Trajectory, cycles: int) -> str:
    """Where the joints stand after some cycles."""
    count = "1 cycle" if cycles == 1 else f"{cycles} cycles"
    shift = walk.q[walk.marks[cycles]] - walk.q[0]
    home = np.abs(shift).max() < ALIKE
    return f"after {count}: " + ("back home" if home else f"{largest(shift, walk.joint_units)} away")


def verdict_lines(strategy: StrategyResult) -> tuple[str, str]:
    """A verdict as a sentence for everybody, and the figures behind it."""
    v = strategy.verdict
    rows, units = strategy.cycles.row_names, strategy.cycles.row_units
    i, j = v.plane
    plane = f"{rows[i]}-{rows[j]}" if i != j else rows[i]
    if v.holonomic:
        told = f"{strategy.name} is holonomic: whatever closed path the tool runs, its joints come back to their start."
    else:
        sides = f"0.1 {units[i]} by 0.1 {units[j]}"
        told = (
            f"{strategy.name} is NOT holonomic: a small loop of the tool in the {plane} plane, of {sides}, leaves the "
            f"joints about {0.01 * v.defect:.2g} {v.unit.partition('/')[0]} away from where they began, and each "
            "further round adds to it."
        )
    at = ", ".join(f"{value:.4g}" for value in v.witness)
    skipped = f", {v.singular} more were singular" if v.singular else ""
    shown = (
        f"Largest defect found: {v.defect:.3g} {v.unit}, in the {plane} plane at q = [{at}]; per rad of joint motion "
        f"{v.relative:.2g}/rad, where up to {v.tolerance:.0e} counts as zero; {v.samples} postures judged{skipped}."
    )
    return told, shown


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
        f"{limits[i]:.3g} {result.robot.coordinates[i].unit}/s; run the path at {slower:.2g} m/s "
        "or slower"
    )
