"""The strategies of a session, their sliders, and two paths to one pose."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...analysis.coverage import locked_joints
from ...base.errors import ArgumentError, HolokinError, NoArmError
from ...base.types import Matrix, Value, Vector
from ...motion.control import ControlLaw
from ...motion.ik.leaf import REGULAR, PathEnd, leaf_follower, leaf_value, leaf_walk, straight_path
from ...path import Path, polyline
from ...strategies import HolonomicStrategy, SelfMotionCurve, Strategy, holonomic, moore_penrose, radial
from ...strategies.constraints import arm_angle, find_arm, lock
from ...strategies.self_motion_curves import CurveTracer
from ...strategies.tasks.task import Task, of_one_tool

# --- The strategies of a session: a strategy or a control law, with a name, and what a job file says of it.


@dataclass(frozen=True, eq=False)
class NamedStrategy(Value):
    """One strategy of a session.

    Attributes:
        name: as it is shown.
        rule: a strategy, or a control law (q, pose, twist, dt) -> dq.
        task: what it serves.
        level: the leaf g(q) = c (r,) that a holonomic strategy holds; None is that of the session's start posture.
        keys: what a job file says of it, kind and its keys; None of a strategy that a job cannot say.
        label: its name in a job, where one strategy is run for several tasks; else empty.
    """

    name: str
    rule: Strategy | ControlLaw
    task: Task
    level: Vector | None = None
    keys: Mapping[str, Any] | None = None
    label: str = ""

    @property
    def holonomic(self) -> bool:
        """True where it has leaves, so that the tool pose tells its joints."""
        return isinstance(self.rule, HolonomicStrategy)

    @property
    def G(self) -> Strategy | None:
        """The strategy G(q); None of a control law."""
        return self.rule if isinstance(self.rule, Strategy) else None

    def level_at(self, q: Vector) -> Vector:
        """g(q) (r,) of a holonomic strategy; empty for others."""
        return leaf_value(self.rule, q) if isinstance(self.rule, HolonomicStrategy) else np.zeros(0)


def default_strategies(task: Task, q0: Vector) -> tuple[NamedStrategy, ...]:
    """Strategies to begin with, all defined at a posture (n,).

    The pseudo-inverse; the joints locked that fix the self-motion best; the arm angle, where the task leaves one joint
    of an arm with shoulder, elbow and wrist; the radial strategy of the pseudo-inverse.

    Raises:
        ArgumentError: the robot has no joint to spare.
    """
    redundant(task)
    pinv = moore_penrose(task, name="pseudo-inverse")
    joints = [task.robot.joint_names[i] for i in locked_joints(task, q0)]
    locked = holonomic(task, lock(*joints), name=f"lock {', '.join(joints)}")
    candidates: list[tuple[Strategy, dict[str, Any]]] = [(pinv, {"kind": "moore-penrose"})]
    candidates.append((locked, {"kind": "lock", "joints": joints}))
    if task.n - task.m == 1:
        with suppress(NoArmError):
            find_arm(task)
            candidates.append((holonomic(task, arm_angle(), name="arm angle"), {"kind": "arm-angle"}))
    candidates.append((radial(pinv, q0, name="radial"), {"kind": "radial"}))
    defined = []
    for G, keys in candidates:
        with suppress(HolokinError):
            G(q0)
            defined.append(NamedStrategy(G.name, G, task, None, keys))
    return tuple(defined)


def redundant(task: Task) -> None:
    """Raises: ArgumentError: a task that leaves no joint free, so that there is nothing to see."""
    if task.n <= task.m:
        cure = "the studio shows redundant joints: give a task with fewer rows, or a robot with more joints"
        raise ArgumentError(f"the number of joints to spare of the {task.name}", task.n - task.m, cure)


# --- Sliders: along a self-motion, with the tool still; and across the leaves of a holonomic strategy.

STEP = 0.02  # arc length between the postures of a curve [joint units]
LENGTH = 4 * np.pi  # longest self-motion that is traced each way [joint units]
MOVE = 0.05  # joint motion of one step across the leaves [joint units]
STEPS = 400  # steps across the leaves each way: 20 rad of joint motion
DEGREES = "deg"

ENDINGS = {
    "closed": "it comes back to itself",
    "limit": "a joint meets its limit",
    "singular": "the arm or the strategy is singular",
    "length": "it is followed no farther",
}
"""Why a slider ends."""


@dataclass(frozen=True, eq=False)
class Slider:
    """What a slider shows: its value now, from `low` to `high`, and why it ends there.

    unit: "rad" or "m" of joints (of both: joint units), "deg" of an angle of the arm, "" of another level.
    label: what it moves, in a word or two.
    """

    name: str
    label: str
    value: float
    low: float
    high: float
    unit: str
    why_low: str
    why_high: str


def self_motion_curve(task: Task, q: Vector, limits: bool) -> SelfMotionCurve:
    """The postures with the tool where it is at q (n,), on either side of it.

    With several joints to spare it begins in the direction in which one of them moves alone, the first of
    `locked_joints`, the others following as little as they can.
    """
    pulled = None if task.n - task.m == 1 else np.eye(task.n)[[locked_joints(task, q)[0]]]
    motions = CurveTracer.through(task, q[None])
    return motions.traced(q[None], step=STEP, length=LENGTH, limits=limits, directions=pulled)[0]


def along(curve: SelfMotionCurve, s: float) -> Vector:
    """The posture (n,) at an arc length s of a curve, with the tool exactly still.

    Raises:
        ArgumentError: the curve does not reach so far.
    """
    low, high = float(curve.s[0]), float(curve.s[-1])
    slack = 1e-9 * max(1.0, high - low)
    if not low - slack <= s <= high + slack:
        raise ArgumentError("the place on the self-motion", s, f"give a number from {low:.4g} to {high:.4g}")
    return curve.at(s)


def self_slider(strategy: NamedStrategy, curve: SelfMotionCurve, s: float) -> Slider:
    """The slider along a curve, at the place s."""
    units = {c.unit for c in strategy.task.robot.coordinates}
    why_low, why_high = (ENDINGS[ending] for ending in curve.endings)
    unit, low, high = units.pop() if len(units) == 1 else "joint units", float(curve.s[0]), float(curve.s[-1])
    return Slider(strategy.name, "Self-motion", s, low, high, unit, why_low, why_high)


def level_slider(strategy: NamedStrategy, q: Vector, limits: bool) -> Slider:
    """The slider of the level g(q) of a strategy, of its first row, from a posture (n,), the tool and other rows still.

    Raises:
        ArgumentError: a strategy without leaves.
    """
    G = leaves_of(strategy)
    level, angular = leaf_value(G, q), bool(G.constraint.angular[0])
    # How far it goes each way, and in which unit.
    (down, why_low), (up, why_high) = (_across(G, q, sign, limits) for sign in (-1.0, 1.0))
    scale, unit = (180 / np.pi, DEGREES) if angular else (1.0, _unit(strategy))
    value, low, high = (float(scale * number) for number in (level[0], level[0] - down, level[0] + up))
    label = "Elbow angle" if angular else "Level"
    return Slider(strategy.name, label, value, low, high, unit, ENDINGS[why_low], ENDINGS[why_high])


def across(strategy: NamedStrategy, q: Vector, slider: Slider, value: float) -> Vector:
    """The posture (n,) at a value of a slider whose value at q (n,) it knows, gone to through all between.

    Raises:
        ArgumentError: the slider does not go so far. SingularityError, BranchError: the leaves end before.
    """
    G = leaves_of(strategy)
    slack = 1e-9 * max(1.0, abs(slider.high - slider.low))
    if not slider.low - slack <= value <= slider.high + slack:
        raise ArgumentError("the level", value, f"give a number from {slider.low:.4g} to {slider.high:.4g}")
    moved = value - slider.value
    change = np.zeros(strategy.task.n - strategy.task.m)
    change[0] = np.deg2rad(moved) if slider.unit == DEGREES else moved
    place, level = strategy.task._place(q), leaf_value(G, q)
    return leaf_follower(G, q)(q, straight_path(strategy.task, place, place, (level, level + change)))


def leaves_of(strategy: NamedStrategy) -> HolonomicStrategy:
    """The strategy of a strategy with leaves. Raises: ArgumentError: it has none."""
    if not isinstance(strategy.rule, HolonomicStrategy):
        raise ArgumentError("the strategy", strategy.name, HolonomicStrategy.cure)
    return strategy.rule


def _across(strategy: HolonomicStrategy, q: Vector, sign: float, limits: bool) -> tuple[float, str]:
    """How far the first row of the level goes one way with the tool still, and why no farther."""
    task, robot = strategy.task, strategy.task.robot
    walk = leaf_walk(strategy, q)
    place, unit = task._place(q), np.eye(task.n - task.m)[0]
    posture, c, distance = q, leaf_value(strategy, q), 0.0
    wide, full = MOVE, 2 * np.pi if strategy.constraint.angular[0] else np.inf
    for _ in range(STEPS):
        # A step of the level by which no joint moves farther than `wide`, along the self-motion.
        rate = _null_rate(strategy, posture, sign * unit)
        if rate is None:
            return distance, "singular"
        size = min(wide / max(float(np.abs(rate).max()), 1e-12), full - distance)
        new, ended = walk(posture, straight_path(task, place, place, (c, c + sign * size * unit)))
        # Where it fails, smaller ones, until the end is known.
        beyond = ended is PathEnd.REACHED and limits and not robot.within(new)
        if ended is not PathEnd.REACHED or beyond:
            if wide < MOVE / 100:
                return distance, "limit" if beyond else "singular"
            wide /= 4
            continue
        posture, c, distance = new, c + sign * size * unit, distance + size
        if distance >= full - 1e-12:
            return distance, "closed"
    return distance, "length"


def _null_rate(strategy: HolonomicStrategy, q: Vector, wanted: Vector) -> Vector | None:
    """dq (n,) with J dq = 0 and J_g dq as wanted; None where [J; J_g] is near singular."""
    if not strategy.gain(q)[1] > REGULAR:
        return None
    try:
        stacked = np.vstack([strategy.task.jacobian(q), strategy.rows(q)])
        rate = np.linalg.solve(stacked, np.concatenate([np.zeros(strategy.task.m), wanted]))
    except (HolokinError, np.linalg.LinAlgError):
        return None
    return np.asarray(rate, dtype=float) if np.isfinite(rate).all() else None


def _unit(strategy: NamedStrategy) -> str:
    """The unit of a level that is no angle of the arm, where the kind of its strategy tells."""
    keys, robot = strategy.keys or {}, strategy.task.robot
    if keys.get("kind") == "lock":
        return robot.coordinates[robot.joint_index(keys["joints"][0])].unit
    return "m" if keys.get("kind") == "height" else ""


# --- Two paths to one pose.

WIDTH = 0.1  # how far the two paths go apart in their middle, each from the straight line [m]


def paths_to(task: Task, q: Vector, pose: Matrix, width: float = WIDTH) -> tuple[Path, Path]:
    """Two paths of the tool from where it is at q (n,) to a pose (4, 4): by a corner to the left, and to the right.

    width: of each corner from the straight line [m].

    Raises:
        ArgumentError: a task of several tools; the pose is where the tool is.
    """
    of_one_tool(task, "two paths to one pose")
    begin, corner = task.pose(q), pose.copy()
    line = pose[:3, 3] - begin[:3, 3]
    # To the sides of the straight line, upright where the line is not.
    up = np.array([0.0, 0.0, 1.0]) if abs(line[2]) < 0.9 * np.linalg.norm(line) else np.array([1.0, 0.0, 0.0])
    side = np.cross(up, line) if np.linalg.norm(line) > 1e-6 else np.array([1.0, 0.0, 0.0])
    paths = []
    for sign in (1.0, -1.0):
        corner[:3, 3] = (begin[:3, 3] + pose[:3, 3]) / 2 + sign * width * side / np.linalg.norm(side)
        paths.append(polyline(np.array([begin, corner, pose])))
    return paths[0], paths[1]
