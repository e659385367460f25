"""The map of an arm: few sheets in a fixed order, each a rule for what is held, and signs of a closed form.

Any smooth rule has the determinant of a held joint, so a pose has at most one posture of a sheet, on the whole arm.
What a rule sees of a pose is told in `held_coordinate.py`. A map is one of joints and limits alone, and of the line
about which the tool may spin where that is free.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from typing import Any

import numpy as np

from ...base.errors import ArgumentError
from ...base.types import Matrix, Value, Vector, kept
from ...robot import Robot
from ...robot.closed_form import ArmClass, NoClass, arm_class
from ...robot.closed_form.arm_classes import links_of
from ...strategies.tasks import pose
from ...strategies.tasks.frame_task import FrameTask, asks_whole_pose, free_directions
from ...strategies.tasks.task import Task, TipFrame, poses_expression
from ...symbolic import Function, densify, symbol
from ...symbolic.native import SheetsKernel, allowed, sheets_kernel
from .closed_leaf import DOUBT
from .held_coordinate import HeldCoordinate, Spin

FORMAT = 2
"""Of a map's file: changed when those of before cannot be read."""

VALUES = 64
"""Values of what is held at which the arcs of a pose off the map are looked at: steps of at most 0.1 rad."""

CLOSER = 9
"""Steps towards the largest margin of an arc, each to two ninths of the one before: from 0.1 rad to 1e-7."""

TRIES, HOPE, LAST_HOPE = 128, -1.0, -0.1
"""Places of the arcs that are looked at more closely where none of them serves: peaks of the margin from HOPE on, then
others from LAST_HOPE on."""

ON_SHEET = 0.01
"""Distance [joint units] of a posture from that of a sheet up to which it is on it: measured joints are not exact."""

NARROW = 1e-3
"""Range [joint units] up to which a joint is as if it were fixed."""

TIE = 1e-6
"""Difference of margins up to which the first of two is taken: round-off is not to choose."""


@dataclass(frozen=True, eq=False)
class ArmMap(Value):
    """Sheets in the order in which they are asked, the first of them that serves a pose does.

    held: what their rules give a value to. rules: one of each sheet (S, w), w = 0 where nothing is held. branches: what
    chooses one posture at that value (S, b), the signs of three slopes, or a row of the map below. choices: of these,
    those that some posture within the limits has (K, b). share: of the poses of postures, evenly drawn within the
    limits, that the sheets serve. complete: False where making it was stopped early. below: the arm's map for whole
    poses, where the spin of its tool is held.
    """

    held: HeldCoordinate
    rules: Matrix
    branches: Matrix
    choices: Matrix
    share: float
    complete: bool = True
    below: ArmMap | None = None

    def __len__(self) -> int:
        return len(self.branches)

    @property
    def arm(self) -> ArmClass:
        """The six hinges that are left."""
        return self.held.arm

    @cached_property
    def values(self) -> Vector:
        """Values of what is held (C,) all over its range, or over a turn."""
        return self.held.values(VALUES)

    @property
    def rows(self) -> Matrix:
        """Rule and branch of each sheet (S, w + b)."""
        return np.hstack([self.rules, self.branches])

    @property
    def grid(self) -> Matrix:
        """Those of all arcs at all values (K C, w + b), one arc after another."""
        count = len(self.values)
        rules = np.tile(self.held.constant(self.values), (len(self.choices), 1))
        return np.hstack([rules, np.repeat(self.choices, count, axis=0)])

    def postures(self, limits: bool) -> Function:
        """(pose (4, 4), rule (w,), branch (b,)) -> (posture (n,), how real it is, how far within the limits, fault).

        As of `solver`.
        """
        return _postures(self, limits)

    def kernel(self, limits: bool) -> SheetsKernel | None:
        """Native code; None where there can be none, and where HOLOKIN_NATIVE is 0 now."""
        return _kernel(self, limits) if allowed() else None


@kept
def _kernel(found: ArmMap, limits: bool) -> SheetsKernel | None:
    function = found.postures(limits)
    shapes = list(function.input_shapes.values()), list(function.output_shapes.values())
    robot, q = found.arm.robot, symbol("q", found.arm.robot.n)
    k = pose(robot, tip=found.arm.tip).kinematics(q)
    tool = Function("tool", {"q": q}, {"pose": poses_expression(k)}).program
    free = np.full(robot.n, np.inf)
    joints = (robot.lower, robot.upper, robot.hinges) if limits else (-free, free, robot.hinges)
    constants = {
        "ON": ON_SHEET,
        "DOUBT": DOUBT,
        "TRIES": TRIES,
        "HOPE": HOPE,
        "LAST_HOPE": LAST_HOPE,
        "TIE": TIE,
        "STEPS": CLOSER,
    }
    arcs = found.choices, found.values, found.held.slides, found.held.turning
    return sheets_kernel(function.program, *shapes, tool, joints, found.rows, *arcs, constants)


@kept
def _postures(found: ArmMap, limits: bool) -> Function:
    held = found.held
    T, rule, branch = symbol("pose", 4, 4), symbol("rule", held.width), symbol("branch", held.branch)
    q, share, within, fault = held.answer(T, rule, branch, limits)
    outputs = {"q": densify(q), "share": share, "within": within, "fault": fault}
    return Function("sheet", {"pose": T, "rule": rule, "branch": branch}, outputs)


# --- Which arm: what a map can be made of, and what tells the arms of two maps apart.


def spin_axis(task: Task) -> Vector | None:
    """The axis (3,), fixed in the tool, about which a task of the rest of the pose leaves it free to turn, or None."""
    if not (isinstance(task, FrameTask) and isinstance(task.frame, TipFrame)) or task.m != 5:
        return None
    direction = free_directions(task)[0] if {0, 1, 2} <= set(task.rows) else None
    return None if direction is None or direction[1] else direction[0]


INSTEAD = "give a strategy and a start: hk.ik(strategy, q0), or a workspace: hk.sheets(task, workspace)"


def check_task(task: Task) -> None:
    """Raises: ArgumentError: a task or a number of joints of which there is no map."""
    robot = task.robot
    if not asks_whole_pose(task) and spin_axis(task) is None:
        kinds = "whole poses of one tip, hk.pose(robot), or of an axis of it, hk.pose(robot, 'axis')"
        raise ArgumentError("the task", task.name, f"a map is of {kinds}; or {INSTEAD}")
    if robot.n not in (6, 7):
        raise ArgumentError("the number of joints of a map", robot.n, f"give an arm of six or seven; or {INSTEAD}")


def classes(task: Task) -> list[ArmClass]:
    """The arms that one held joint leaves, of those whose signs tell postures apart; of six joints the arm itself.

    Raises: ArgumentError: there are none, with the reason, or joints have no limits, or no range.
    """
    robot = task.robot
    tries = [arm_class(robot, held, task.tip) for held in ([()] if robot.n == 6 else [(k,) for k in range(7)])]
    found = [c for c in tries if isinstance(c, ArmClass) and c.proven]
    if not found:
        reasons = [c.reason for c in tries if isinstance(c, NoClass)]
        why = reasons[0] if reasons else "its inverse has steps of degree four"
        fact = f"{robot.name!r}, which has no closed form with signs, whatever joint is held ({why})"
        raise ArgumentError("the arm of a map", fact, INSTEAD)
    room = robot.upper - robot.lower
    widen = "hk.with_limits(robot, lower=..., upper=...)"
    if not np.isfinite(room).all():
        free = robot.joint_names[int(np.flatnonzero(~np.isfinite(room))[0])]
        cure = f"give some: {widen}, such as +-pi; or {INSTEAD}"
        raise ArgumentError(f"the limits of joint {free!r}", None, cure)
    if not (room > NARROW).all():
        k = int(np.argmin(room))
        cure = f"widen its limits: {widen}; or {INSTEAD}"
        raise ArgumentError(f"the range of joint {robot.joint_names[k]!r}", float(room[k]), cure)
    return found


def digest(robot: Robot, tip: str | None, spin: Spin | None = None) -> str:
    """A short text that differs where the joints of two arms differ, or their limits, or the line about which the tool
    may spin: SHA-256 of all their numbers."""
    numbers = [np.round([robot.lower, robot.upper], 9) + 0.0]
    for i, link in enumerate(links_of(robot, tip)[:-1]):
        numbers += [
            np.round(link.axis, 9) + 0.0,
            np.array([link.coordinate, link.multiplier, link.offset, link.slides]),
        ]
        numbers += [np.round(x, 9) + 0.0 for x in (link.rotation, link.position) if i > 0]
    numbers += [] if spin is None else [np.array(spin)]
    flat = np.concatenate([np.ravel(np.asarray(x, dtype=float)) for x in numbers])
    return hashlib.sha256(flat.tobytes()).hexdigest()[:32]


# --- Maps as text: those of the catalogue's arms are data of the package, others are kept where native code is kept.


def map_text(found: ArmMap) -> str:
    """A map as JSON; its numbers have six digits."""
    held = found.held
    joint = held.arm.held[0] if held.arm.held else None
    about: dict[str, Any] = {
        "format": FORMAT,
        "robot": held.robot.name,
        "arm": digest(held.robot, held.arm.tip, held.spin),
    }
    about |= {"held": joint, "spin": held.spin, "length": held.length, "share": found.share}
    about |= {"complete": found.complete, "choices": [_short(row) for row in found.choices]}
    about["below"] = None if found.below is None else json.loads(map_text(found.below))
    rows = [
        {"branch": _short(branch), "rule": _short(rule)}
        for rule, branch in zip(found.rules, found.branches, strict=True)
    ]
    head = ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in about.items())
    return f'{{{head},\n"sheets": [\n' + ",\n".join(map(json.dumps, rows)) + "\n]}\n"


def _short(row: Vector) -> list[float]:
    """The numbers of a row of six digits, whole ones as such."""
    return [int(x) if x.is_integer() else x for x in (float(f"{x:.6g}") for x in row)]


def map_of_text(text: str, robot: Robot, tip: str | None, spin: Spin | None = None) -> ArmMap | None:
    """The map of a text, where it is of a robot's arm to a tip and of this version; else None."""
    try:
        return _map_of(json.loads(text), robot, tip, spin)
    except (KeyError, TypeError, ValueError, LookupError):
        return None


def _map_of(about: Mapping[str, Any], robot: Robot, tip: str | None, spin: Spin | None) -> ArmMap | None:
    if about["format"] != FORMAT or about["arm"] != digest(robot, tip, spin):
        return None
    joints = () if about["held"] is None else (int(about["held"]),)
    arm, length = arm_class(robot, joints, tip), float(about["length"])
    below = None if spin is None else _map_of(about["below"], robot, tip, None)
    if not (isinstance(arm, ArmClass) and arm.proven) or (
        spin is not None and (below is None or below.arm.held != joints)
    ):
        return None
    held = HeldCoordinate(arm, length, spin, None if below is None else below.held)
    rules, branches = (np.array([row[key] for row in about["sheets"]], dtype=float) for key in ("rule", "branch"))
    choices = np.array(about["choices"], dtype=float)
    shapes = {branches.shape[1:], choices.shape[1:]} == {(held.branch,)} and rules.shape[1:] == (held.width,)
    if not (len(branches) and shapes and np.isfinite(rules).all() and 0 < length < np.inf):
        return None
    every = np.vstack([branches, choices])
    if not (np.isfinite(every).all() and (np.abs(every[:, -3:]) == 1).all()):
        return None
    return ArmMap(held, rules, branches, choices, float(about["share"]), bool(about["complete"]), below)


def shipped(robot: Robot, tip: str | None) -> ArmMap | None:
    """The map of an arm of the catalogue; None where there is none of these joints and limits."""
    folder, own = files("holokin.robot").joinpath("data", "maps"), digest(robot, tip)
    entries = sorted(folder.iterdir(), key=lambda entry: entry.name) if folder.is_dir() else []
    first = f"{robot.name}.json"
    for entry in sorted(entries, key=lambda entry: entry.name != first):
        text = entry.read_text("utf-8")
        if own in text and (found := map_of_text(text, robot, tip)) is not None:
            return found
    return None
