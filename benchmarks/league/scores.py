"""What the joints of an answer did, measured alike for all: by holokin's kinematics, from the joints alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import holokin as hk
from benchmarks import drift

NEAR_MM, NEAR_RAD = 1.0, 0.01
"""A setting that leaves the path by more is not taken as the best one; a tour that does is not whole."""

RETURNED = 1e-6
"""Joints [rad] that differ by less have returned: a drive of these arms resolves no less."""

AGAIN = 1e-3
"""Joints [rad] that differ by less from one round to the next are the same."""


@dataclass(frozen=True)
class Score:
    """One setting on one arm: angles in rad, the worst of the paths; tool errors in mm and rad.

    later: drift of the largest joint in the last cycle. ways: the largest joint's difference at one tool pose, reached
    by two paths. hurry: the fastest joint over its limit; above 1 it is a jump that no arm can follow.
    resting: how far the joints are from those of the leaf of the stationary posture, all round the circle.
    tours, whole, again: how many there are, how many have an answer everywhere, with the tool near, within the limits
    and without a jump, and of how many of these the second round has the joints of the first, all along.
    """

    library: str
    name: str
    example: bool
    arm: str
    later: float = np.nan
    ways: float = np.nan
    tracking: float = np.nan
    turn: float = np.nan
    hurry: float = np.nan
    resting: float = np.nan
    tours: int = 0
    whole: int = 0
    again: int = 0
    within: bool = False
    missing: int = 0
    call_us: float = np.nan
    source: str = ""
    fault: str = field(default="")

    @property
    def apart(self) -> float:
        """The worse of two paths and a later cycle [rad]."""
        return max(self.ways, self.later)

    @property
    def unfair(self) -> str:
        """What keeps it from being the best of its library; empty if nothing does."""
        if self.fault:
            return "stopped"
        if self.missing:
            return f"{self.missing} calls without answer"
        if not (self.tracking <= NEAR_MM and self.turn <= NEAR_RAD):
            return "off the path"
        if not self.within:
            return "past a joint limit"
        return "jumps" if self.hurry > 1 else ""


def score(
    told: dict[str, Any],
    library: str,
    robot: hk.Robot,
    runs: dict[str, dict[str, np.ndarray]],
    joints: dict[str, np.ndarray],
    rest: np.ndarray | None = None,
) -> Score:
    """Measure one answer.

    Args:
        told: what the worker said of the setting. runs: targets of each run. joints (k + 1, n) of each run.
        rest (k, n): the joints of the stationary posture at the targets of the circle.
    """
    named = (library, told["name"], told["example"], told["arm"])
    if told["fault"]:
        return Score(*named, source=told["source"], fault=told["fault"])
    toured = [_toured(robot, joints[name], run) for name, run in runs.items() if name.startswith("tour")]
    runs = {name: run for name, run in runs.items() if not name.startswith("tour")}
    cycles = [name for name in runs if not name.startswith(("there", "round"))]
    each = [np.abs(np.diff(_ends(joints[name], runs[name]["poses"]), axis=0)).max(axis=1) for name in cycles]
    errors = [[e.max() for e in tool_errors(robot, joints[name][1:], run["poses"])] for name, run in runs.items()]
    reached = {name: joints[name][-1] for name in runs if name not in cycles}
    apart = [np.abs(reached[f"there at {v}"] - reached[f"round at {v}"]).max() for v in drift.SPEEDS]
    speeds = [_speeds(robot, joints[name], run) for name, run in runs.items()]
    every = np.concatenate([joints[name] for name in runs])
    return Score(
        *named, later=max(d[-1] for d in each), ways=max(apart),
        tracking=1e3 * max(e[0] for e in errors), turn=max(e[1] for e in errors),
        hurry=max(float(v.max()) for v in speeds),
        within=bool(robot.within(every).all()), missing=told["missing"], call_us=told["call_us"],
        resting=np.nan if rest is None else float(np.abs(joints["circle"][1:] - rest).max()),
        source=told["source"], tours=len(toured), whole=sum(whole for whole, _ in toured),
        again=sum(whole and again for whole, again in toured),
    )  # fmt: skip


def rested(robot: hk.Robot, start: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Joints (k, n) at poses on the leaf through the start whose posture is nearest to it: what posture tasks seek."""
    ik, walk = (
        hk.ik(hk.holonomic(hk.pose(robot), hk.stationary(hk.strategies.constraints.posture_cost(start))), start),
        [start],
    )
    for pose in poses:
        walk.append(ik.near(pose, walk[-1]))
    return np.array(walk[1:])


def best_of(scores: Sequence[Score]) -> Score | None:
    """Of one library on one arm, the fastest setting that returns, or the least apart; None if all are unfair."""
    return min((s for s in scores if not s.unfair), key=lambda s: (max(s.apart, RETURNED), s.call_us), default=None)


def _ends(q: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Joints (cycles + 1, n) at the start and at the end of each cycle of a run that comes back to its first pose."""
    last = poses[-1]
    cycle = next(k for k in range(1, len(poses) + 1) if len(poses) % k == 0 and _same(poses, k, last))
    return q[::cycle]


def _same(poses: np.ndarray, cycle: int, last: np.ndarray) -> bool:
    return bool(
        np.abs(poses[cycle - 1 :: cycle] - last).max() < 1e-12 and np.array_equal(poses[:cycle], poses[-cycle:])
    )


def tool_errors(robot: hk.Robot, q: np.ndarray, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances [m] and turns [rad] (k,) of the tool from its targets (k, 4, 4), at postures (k, n)."""
    here = robot.pose(q)
    skew = poses[:, :3, :3] - here[:, :3, :3]
    chord = np.linalg.norm(skew, axis=(1, 2)) / np.sqrt(8)  # |R1 - R2| = sqrt(8) sin(angle / 2)
    return np.linalg.norm(here[:, :3, 3] - poses[:, :3, 3], axis=1), 2 * np.arcsin(np.minimum(chord, 1))


def _toured(robot: hk.Robot, q: np.ndarray, run: dict[str, np.ndarray]) -> tuple[bool, bool]:
    """Whether a tour is whole, and whether its second round has the joints of its first."""
    apart, turned = tool_errors(robot, q[1:], run["poses"])
    near = 1e3 * apart.max() <= NEAR_MM and turned.max() <= NEAR_RAD
    once = len(run["h"]) // 2
    again = np.abs(q[once + 1 :] - q[1 : once + 1]).max() < AGAIN
    return bool(near and robot.within(q).all() and _speeds(robot, q, run).max() <= 1), bool(again)


def _speeds(robot: hk.Robot, q: np.ndarray, run: dict[str, np.ndarray]) -> np.ndarray:
    """Joint speeds over their limits."""
    return np.abs(np.diff(q, axis=0)) / run["h"][:, None] / robot.max_velocity
