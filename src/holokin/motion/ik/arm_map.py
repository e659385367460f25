"""The map of an arm: few sheets in a fixed order, each a rule for the joint that is held, and signs of a closed form.

    q_k = atan2(a . f(pose), b . f(pose)),   f the monomials of the pose as seen from the hand

Any smooth rule has the determinant of a held joint, so a pose has at most one posture of a sheet, on the whole arm.
What is seen from the hand is the shoulder's place and the first axis: neither the turn about that axis changes them,
nor where the arm stands, nor what it carries. So a map is one of joints and limits alone.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from importlib.resources import files
from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from ...base.errors import ArgumentError
from ...base.types import Array, Matrix, Value, Vector, kept
from ...robot.closed_form import ArmClass, ClosedInverse, NoClass, arm_class
from ...robot.closed_form.arm_classes import links_of, miss_of_point, screws
from ...robot.closed_form.six_hinges import answer
from ...strategies.tasks import pose
from ...strategies.tasks.frame_task import asks_whole_pose
from ...strategies.tasks.task import Task, poses_expression
from ...symbolic import SX, Function, atan2, densify, dot, floor, fmin, sqrt, symbol, vertcat
from ...symbolic.native import SheetsKernel, allowed, sheets_kernel
from .closed_leaf import BOUNDLESS, DOUBT

FORMAT = 1
"""Of a map's file: changed when those of before cannot be read."""

VALUES = 64
"""Values of the held joint at which the arcs of a pose off the map are looked at: steps of at most 0.1 rad."""

CLOSER = 9
"""Steps towards the largest margin of an arc, each to two ninths of the one before: from 0.1 rad to 1e-7."""

TRIES, HOPE, LAST_HOPE = 128, -1.0, -0.1
"""Places of the arcs that are looked at more closely where none of them serves: peaks of the margin from HOPE on, then
others from LAST_HOPE on."""


ON_SHEET = 0.01
"""Distance [joint units] of a posture from that of a sheet up to which it is on it: measured joints are not exact."""

LEAST = 0.1
"""Length of the vector (b . f, a . f) from which on a rule serves: it is fitted to 1, and at 0 its angle jumps."""

TIE = 1e-6
"""Difference of margins up to which the first of two is taken: round-off is not to choose."""


@dataclass(frozen=True, eq=False)
class ArmMap(Value):
    """Sheets in the order in which they are asked, the first of them that serves a pose does.

    arm: the arm that the held joint leaves, or, of six joints, with none held. degree: of the monomials (m,). length:
    in which places are measured [m]. rules: a and b of each sheet (S, 2, m). signs: of the three slopes (S, 3).
    choices: of signs that some posture within the limits has (K, 3). share: of the poses of postures, evenly drawn
    within the limits, that the sheets serve.
    """

    arm: ArmClass
    degree: int
    length: float
    rules: Array
    signs: Matrix
    choices: Matrix
    share: float

    def __len__(self) -> int:
        return len(self.signs)

    @property
    def held(self) -> int | None:
        """The coordinate of the held joint; None of six joints."""
        return self.arm.held[0] if self.arm.held else None

    @property
    def turning(self) -> bool:
        """Whether the held joint's limits leave all of a turn."""
        k, robot = self.held, self.arm.robot
        return k is not None and bool(robot.upper[k] - robot.lower[k] >= 2 * np.pi)

    @cached_property
    def values(self) -> Vector:
        """Values of the held joint (C,) all over its range, or over a turn."""
        k, robot = self.held, self.arm.robot
        if k is None:
            return np.zeros(1)
        if self.turning:
            return np.linspace(-np.pi, np.pi, VALUES, endpoint=False)
        return np.linspace(robot.lower[k], robot.upper[k], VALUES)

    @property
    def rows(self) -> Matrix:
        """Rule and signs of each sheet (S, 2 m + 3)."""
        return np.hstack([self.rules.reshape(len(self), -1), self.signs])

    @property
    def grid(self) -> Matrix:
        """Those of all arcs at all values (K C, 2 m + 3), one arc after another."""
        m, count = self.rules.shape[2], len(self.values)
        rows = np.zeros((len(self.choices) * count, 2 * m + 3))
        rows[:, 2 * m :] = np.repeat(self.choices, count, axis=0)
        if m:
            rows[:, 0], rows[:, m] = (np.tile(f(self.values), len(self.choices)) for f in (np.sin, np.cos))
        return rows

    def postures(self, limits: bool) -> Function:
        """(pose (4, 4), rule (2 m,), signs (3,)) -> (posture (n,), how real it is, how far within the limits, fault).

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
    arcs = found.choices, found.values, found.turning
    return sheets_kernel(function.program, *shapes, tool, joints, found.rows, *arcs, constants)


@kept
def _postures(found: ArmMap, limits: bool) -> Function:
    arm, robot, k = found.arm, found.arm.robot, found.held
    inverse, m = ClosedInverse(arm, limits), found.rules.shape[2]
    T, rule, signs = symbol("pose", 4, 4), symbol("rule", 2 * m), symbol("signs", 3)
    value, within, length = SX(0, 1), SX(BOUNDLESS), SX(1)
    if k is not None:
        f = vertcat(*monomials(list(_seen(arm, T, found.length)), found.degree))
        sine, cosine = dot(rule[:m], f), dot(rule[m:], f)
        value, length = atan2(sine, cosine), sqrt(sine * sine + cosine * cosine)
        low, high = robot.lower[k], robot.upper[k]
        if limits and np.isfinite(low + high):
            middle = (low + high) / 2
            value = value + 2 * np.pi * floor((middle - value) / (2 * np.pi) + 0.5)
            within = fmin(value - low, high - value)
    chain, own = inverse.numbers(value)
    joints = SX(np.clip(inverse.joints, -BOUNDLESS, BOUNDLESS))
    x = answer(arm.form, True, chain, T, own, joints, signs)
    q = SX.zeros(robot.n, 1)
    q[inverse.others] = x[:6]
    if k is not None:
        q[k] = value
    inputs = {"pose": T, "rule": rule, "signs": signs}
    outputs = {"q": densify(q), "share": fmin(x[9], length - LEAST), "within": fmin(x[10], within), "fault": x[11]}
    return Function("sheet", inputs, outputs)


def monomials(x: list[Any], degree: int) -> list[Any]:
    """The products of up to so many of some numbers, or arrays of them; first comes 1."""
    products = [x[0] * 0 + 1]
    for count in range(1, degree + 1):
        products += [
            reduce(lambda a, b: a * b, [x[i] for i in which])
            for which in combinations_with_replacement(range(len(x)), count)
        ]
    return products


def _frames(arm: ArmClass) -> tuple[Vector, Vector, Matrix, Vector]:
    """(direction and a point of the first axis; rotation and position of the tool in the frame of the last joint)."""
    links = links_of(arm.robot, arm.tip)
    axes = [(np.asarray(h, dtype=float), np.asarray(p, dtype=float)) for h, p in screws(links, {})[0]]
    meeting = miss_of_point(axes[:3])
    point = axes[0][1] if meeting is None else meeting[1]
    along = axes[0][0]
    return along, axes[0][1] + along * float((point - axes[0][1]) @ along), links[-1].rotation, links[-1].position


def _seen(arm: ArmClass, T: SX, length: float) -> list[SX]:
    """The shoulder's place in lengths and the first axis, as the last joint's frame sees them (6,), of a pose."""
    along, point, R, p = _frames(arm)
    hand = T[:3, :3] @ SX(R.T)
    shoulder = hand.T @ (SX(point) - T[:3, 3]) + SX(p)
    axis = hand.T @ SX(along)
    return [*(shoulder[i] / length for i in range(3)), *(axis[i] for i in range(3))]


def seen(arm: ArmClass, poses: Array, length: float) -> Matrix:
    """The same of poses (k, 4, 4): (k, 6)."""
    along, point, R, p = _frames(arm)
    hand = poses[:, :3, :3] @ R.T
    shoulder = np.einsum("kji,kj->ki", hand, point - poses[:, :3, 3]) + p
    return np.hstack([shoulder / length, np.einsum("kji,j->ki", hand, along)])


# --- Which arm: what a map can be made of, and what tells the arms of two maps apart.


def classes(task: Task) -> list[ArmClass]:
    """The arms that one held joint leaves, of those whose signs tell postures apart; of six joints the arm itself.

    Raises: ArgumentError: there are none, with the reason.
    """
    robot = task.robot
    cure = "give a strategy and a start: hk.ik(strategy, q0), or a workspace: hk.sheets(task, workspace)"
    if not asks_whole_pose(task):
        raise ArgumentError("the task", task.name, f"a map is of whole poses of one tip, hk.pose(robot); or {cure}")
    if robot.n not in (6, 7):
        raise ArgumentError("the number of joints of a map", robot.n, f"give an arm of six or seven; or {cure}")
    tries = [arm_class(robot, held, task.tip) for held in ([()] if robot.n == 6 else [(k,) for k in range(7)])]
    found = [c for c in tries if isinstance(c, ArmClass) and c.proven and robot.hinges[list(c.held)].all()]
    if not found:
        reasons = [c.reason for c in tries if isinstance(c, NoClass)]
        why = reasons[0] if reasons else "its inverse has steps of degree four"
        fact = f"{robot.name!r}, which has no closed form with signs, whatever joint is held ({why})"
        raise ArgumentError("the arm of a map", fact, cure)
    if not np.isfinite(robot.upper - robot.lower).all():
        free = next(i for i in range(robot.n) if not np.isfinite(robot.upper[i] - robot.lower[i]))
        bounds = "hk.with_limits(robot, lower=..., upper=...), such as +-pi"
        raise ArgumentError(f"the limits of joint {robot.joint_names[free]!r}", None, f"give some: {bounds}; or {cure}")
    return found


def digest(arm: ArmClass) -> str:
    """A short text that differs where the joints of two arms differ, or their limits: SHA-256 of all their numbers."""
    links, robot = links_of(arm.robot, arm.tip), arm.robot
    numbers = [np.round([robot.lower, robot.upper], 9) + 0.0]
    for i, link in enumerate(links[:-1]):
        numbers += [
            np.round(link.axis, 9) + 0.0,
            np.array([link.coordinate, link.multiplier, link.offset, link.slides]),
        ]
        numbers += [np.round(x, 9) + 0.0 for x in (link.rotation, link.position) if i > 0]
    flat = np.concatenate([np.ravel(np.asarray(x, dtype=float)) for x in numbers])
    return hashlib.sha256(flat.tobytes()).hexdigest()[:32]


# --- Maps as text: those of the catalogue's arms are data of the package, others are kept where native code is kept.


def map_text(found: ArmMap) -> str:
    """A map as JSON; its numbers have six digits."""
    about = {"format": FORMAT, "robot": found.arm.robot.name, "arm": digest(found.arm), "held": found.held}
    about |= {"degree": found.degree, "length": found.length, "share": found.share}
    about["choices"] = found.choices.astype(int).tolist()
    rows = []
    for rule, signs in zip(found.rules, found.signs, strict=True):
        numbers = [[float(f"{x:.6g}") for x in part] for part in rule]
        rows.append({"signs": signs.astype(int).tolist(), "sine": numbers[0], "cosine": numbers[1]})
    head = ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in about.items())
    return f'{{{head},\n"sheets": [\n' + ",\n".join(map(json.dumps, rows)) + "\n]}\n"


def map_of_text(text: str, arms: list[ArmClass]) -> ArmMap | None:
    """The map of a text, where it is of one of these arms and of this version; else None."""
    try:
        about: Mapping[str, Any] = json.loads(text)
        held = () if about["held"] is None else (int(about["held"]),)
        arm = next((a for a in arms if a.held == held), None)
        if about["format"] != FORMAT or arm is None or about["arm"] != digest(arm):
            return None
        rules = np.array([[row["sine"], row["cosine"]] for row in about["sheets"]], dtype=float)
        signs = np.array([row["signs"] for row in about["sheets"]], dtype=float)
        m = len(monomials([0.0] * 6, int(about["degree"]))) if held else 0
        found = ArmMap(
            arm, int(about["degree"]), float(about["length"]), rules.reshape(len(signs), 2, m), signs,
            np.array(about["choices"], dtype=float), float(about["share"]),
        )  # fmt: skip
        sound = np.isfinite(rules).all() and (np.abs(found.signs) == 1).all() and found.signs.shape[1:] == (3,)
        return found if sound and len(signs) and found.length > 0 and found.choices.shape[1:] == (3,) else None
    except (KeyError, TypeError, ValueError, LookupError):
        return None


def shipped(arms: list[ArmClass]) -> ArmMap | None:
    """The map of an arm of the catalogue; None where there is none of these joints and limits."""
    folder = files("holokin.robot").joinpath("data", "maps")
    entries = sorted(folder.iterdir(), key=lambda entry: entry.name) if folder.is_dir() else []
    first = f"{arms[0].robot.name}.json"
    for entry in sorted(entries, key=lambda entry: entry.name != first):
        text = entry.read_text("utf-8")
        if digest(arms[0]) in text and (found := map_of_text(text, arms)) is not None:
            return found
    return None
