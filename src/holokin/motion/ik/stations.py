"""Inverse kinematics of a whole arm without a closed form: sheets of rules, each with postures from which it is gone.

On a sheet one joint follows the tool's pose, q_k = h(pose), h a polynomial of what is seen from the hand: the first axis
and a point of it. A turn of the arm about its first axis changes neither h nor the other joints. So the stations of a
sheet, postures at sampled poses, are turned about that axis to where the tool is wanted, and from the nearest one the
posture is led straight to the pose, while joint k goes to its value, by the checked steps of `continuation`.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...base.poses import pose_from
from ...base.types import Array, Flags, Matrix, Value, Vector, kept
from ...robot import Robot
from ...robot.closed_form import GeneralInverse, general_inverse
from ...robot.closed_form.arm_classes import links_of, screws
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import lock
from ...strategies.tasks import pose
from ...strategies.tasks.frame_task import asks_whole_pose
from ...strategies.tasks.task import Task
from ...symbolic.native import allowed
from .arm_map import monomials
from .closed_leaf import BOUNDLESS, DOUBT
from .pose_paths import PosePaths
from ..self_motions.pose_reach import at_best_turns, reach_of
from ..self_motions.self_motions import self_motions_at

TURN = 0.3
"""What a turn of the hand of 1 rad counts where poses are compared [m]."""

NEAREST, TRIES = 16, 3
"""Of the sampled poses those that are nearest to a pose, and the stations among them from which a sheet is tried."""


def takes_stations(task: Task) -> bool:
    """Whether an arm is one of seven hinges that a held one leaves without a closed form, but with an inverse."""
    robot = task.robot
    if not asks_whole_pose(task) or robot.n != 7 or not robot.hinges.all():
        return False
    return any(isinstance(general_inverse(robot, (k,), task.tip), GeneralInverse) for k in range(1, robot.n))


@dataclass(frozen=True, eq=False)
class StationMap(Value):
    """Sheets in the order in which they are asked.

    joint: k, which follows the pose. degree: of the monomials (m,). rules: of each sheet (S, m). sides: signs (S,) of
    det [J; e_k]. stations: postures of each sheet at sampled poses (S, P, n), NaN where it has none; each pose one at
    least. share: of the poses of postures, evenly drawn within the limits, that the sheets serve.
    """

    task: Task
    joint: int
    degree: int
    rules: Matrix
    sides: Vector
    stations: Array
    share: float

    def __len__(self) -> int:
        return len(self.rules)

    @property
    def held(self) -> int:
        """The coordinate of the joint that follows the pose."""
        return self.joint

    def kernel(self, limits: bool) -> StationCalls:
        """What answers by the stations."""
        return _calls(self, limits)

    def arcs(self, T: Matrix) -> tuple[Matrix, Vector, Vector]:
        """Of all postures of a pose (4, 4), those of its self-motions: they (k, n), ones, and how far each is within
        the limits (k,). The first is the one that is farthest."""
        p, R, robot = T[None, :3, 3], T[None, :3, :3], self.task.robot
        every = self_motions_at(self.task, p, R)
        best = reach_of(self.task, p, R, np.zeros((1, robot.n)), every=every).q
        q = np.vstack([best, at_best_turns(robot, every.q)])
        q = q[np.isfinite(q).all(axis=1)]
        return q, np.full(len(q), 1.0 if len(q) else 0.0), margins(robot, q)


def margins(robot: Robot, q: Matrix) -> Vector:
    """How far postures (k, n) are within the limits (k,) [joint units]."""
    return np.minimum(BOUNDLESS, -robot.beyond(q).max(axis=1, initial=-BOUNDLESS))


class Hand:
    """Poses as a hand has them about the first axis of an arm."""

    def __init__(self, task: Task) -> None:
        links = links_of(task.robot, task.tip)
        axis, point = screws(links, {})[0][0]
        self.axis, self.point = np.asarray(axis, dtype=float), np.asarray(point, dtype=float)
        self._tool, self._joint = links[-1].rotation.T, links[-1].position

    def arrows(self, T: Array) -> Array:
        """Of poses (k, 4, 4): from the point to the hand [m], and its axes, as long as a turn of it counts (k, 4, 3)."""
        R = T[:, :3, :3] @ self._tool
        place = T[:, :3, 3] - R @ self._joint - self.point
        return np.concatenate([place[:, None], TURN / np.sqrt(2) * R.swapaxes(1, 2)], axis=1)

    def seen(self, arrows: Array) -> Matrix:
        """The point [m] and the direction of the first axis, as the hand sees them (k, 6)."""
        R = arrows[:, 1:] * (np.sqrt(2) / TURN)
        return np.concatenate([-(R @ arrows[:, 0, :, None])[..., 0], R @ self.axis], axis=1)


class StationCalls:
    """What answers by the stations of a map; the doors of `SheetsKernel`."""

    def __init__(self, found: StationMap, limits: bool) -> None:
        self.map, self.limits, self.robot = found, limits, found.task.robot
        self.strategy = strategy_of(found.task, found.joint)
        self.hand = Hand(found.task)
        # The postures at one sampled pose are turned so that the hand is where that of the first of them is.
        there = np.isfinite(found.stations).all(axis=2)
        first = found.stations[there.argmax(axis=0), np.arange(there.shape[1])]
        arrows = self.hand.arrows(self.robot.pose(first, found.task.tip))
        along = arrows @ self.hand.axis
        self.there, self._flat, self._along = there, arrows.reshape(len(arrows), 12), along
        self._half = 0.5 * (arrows**2).sum(axis=(1, 2))
        self._lead = leader(self.strategy, found.task)

    def ranked(self, arrows: Array) -> tuple[list[int], list[float]]:
        """(the sampled poses nearest to one whose arrows (4, 3) are given, how far each is turned to be so near)."""
        axis = self.hand.axis
        along = arrows @ axis
        both = np.stack([(arrows - along[:, None] * axis).ravel(), np.cross(arrows, axis).ravel()], axis=1)
        turned = self._flat @ both
        near = self._along @ along + np.hypot(turned[:, 0], turned[:, 1]) - self._half
        count = min(NEAREST, len(near))
        some = np.argpartition(-near, count - 1)[:count]
        some = some[np.argsort(-near[some], kind="stable")]
        return some.tolist(), np.arctan2(turned[some, 1], turned[some, 0]).tolist()

    def levels(self, arrows: Array) -> Vector:
        """Where joint k belongs on each sheet (S,)."""
        x = self.hand.seen(arrows[None])[0].tolist()
        return self.map.rules @ np.array(monomials(x, self.map.degree))

    def answers(self, T: Matrix) -> Iterator[tuple[int, Vector]]:
        """(sheet, posture (n,)) of those that have one at a pose (4, 4), in their order."""
        arrows = self.hand.arrows(T[None])[0]
        some, turns = self.ranked(arrows)
        levels = self.levels(arrows).tolist()
        for s, has in enumerate(self.there[:, some].tolist()):
            q = self._led(s, T, levels[s], [(i, turn) for i, turn, there in zip(some, turns, has, strict=True) if there])
            if q is not None:
                yield s, q

    def _led(self, s: int, T: Matrix, level: float, stations: list[tuple[int, float]]) -> Vector | None:
        side = float(self.map.sides[s])
        for i, turn in stations[:TRIES]:
            begin = self.map.stations[s, i].copy()
            begin[0] += turn
            q = self._lead(T, begin, np.array([level, side]))
            if q is not None:
                return at_best_turns(self.robot, q)
        return None

    def place(self, T: Matrix) -> Vector:
        """Posture, margin and sheet (n + 2,) of a pose (4, 4); the map's length off the map, a margin below 0 where
        there is none."""
        for s, q in self.answers(T):
            margin = self.margin(q)
            if margin > DOUBT:
                return np.concatenate([q, [margin, s]])
        q, _, within = self.map.arcs(T)
        if not len(q):
            return np.concatenate([np.full(self.robot.n, np.nan), [-np.inf, len(self.map)]])
        return np.concatenate([q[0], [within[0] if self.limits else 1.0, len(self.map)]])

    def margin(self, q: Vector) -> float:
        """How far a posture (n,) is within the limits, where these count."""
        return float(margins(self.robot, q[None])[0]) if self.limits else 1.0

    def sheets(self, T: Matrix) -> Matrix:
        """The posture and the margin of each sheet (S, n + 1) at a pose (4, 4); NaN and below 0 where it has none."""
        rows = np.full((len(self.map), self.robot.n + 1), np.nan)
        rows[:, -1] = -np.inf
        for s, q in self.answers(T):
            rows[s] = np.append(q, self.margin(q))
        return rows

    def calls(self, posture: Any, near: Any, _place: Any, _sheets: Any) -> tuple[Any, Any, Any, Any]:
        """As of `SheetsKernel`."""
        return posture, near, self.place, self.sheets

    def __call__(self, poses: Array, threads: int | None = None) -> Matrix:
        """The posture, the margin and the sheet (k, n + 2) of poses (k, 4, 4)."""
        return np.array([self.place(T) for T in poses]).reshape(len(poses), self.robot.n + 2)


@kept
def _calls(found: StationMap, limits: bool) -> StationCalls:
    return StationCalls(found, limits)


@kept
def strategy_of(task: Task, joint: int) -> HolonomicStrategy:
    """That holds a joint."""
    return holonomic(pose(task.robot, tip=task.tip), lock(joint))


def leader(strategy: HolonomicStrategy, task: Task) -> Callable[[Matrix, Vector, Vector], Vector | None]:
    """(pose (4, 4), posture (n,), level and sign of det [J; J_g]) -> the posture to which the posture is led straight."""
    q0 = np.where(np.isfinite(task.robot.middle), task.robot.middle, 0.0) + 0.3
    paths = PosePaths(strategy, q0, np.asarray(strategy.g(q0)), False)
    kernel = paths.kernel if allowed() else None
    if kernel is not None and (call := kernel.led(paths.context, 1)) is not None:
        return call

    def led(T: Matrix, begin: Vector, leaf: Vector) -> Vector | None:
        q, status = paths.at(leaf[:1]).go(T[:3, 3], T[:3, :3], begin)
        return q if status == 0 else None

    return led
