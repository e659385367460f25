"""Inverse kinematics of a whole arm without a closed form: sheets of rules, each with postures from which it is gone.

On a sheet one joint follows the tool's pose, q_k = h(pose), h a polynomial of what is seen from the hand: the first
axis and a point of it. A turn of the arm about its first axis changes neither h nor the other joints. So the stations
of a sheet, postures at sampled poses, are turned about that axis to where the tool is wanted, and from the nearest one
the arm is led straight to the pose, while joint k goes to its value, by the checked steps of `continuation`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...base.types import Array, Flags, Matrix, Value, Vector, frozen, kept
from ...robot.closed_form import ArmClass, GeneralInverse, arm_class, general_inverse
from ...robot.closed_form.arm_classes import links_of, screws
from ...strategies import HolonomicStrategy, holonomic
from ...strategies.constraints import lock
from ...strategies.tasks import pose
from ...strategies.tasks.frame_task import asks_whole_pose
from ...strategies.tasks.task import Task
from ...symbolic import wrapped
from ...symbolic.native import allowed, weak
from ..self_motions.pose_reach import at_best_turns, reach_of, turns_of
from ..self_motions.self_motions import self_motions_at
from .closed_leaf import BOUNDLESS, DOUBT
from .pose_paths import PosePaths
from .solutions import InverseStatus

LENGTH = 0.3 / 2**0.5
"""What each axis of a hand counts where poses are compared [m]: a turn of 1 rad then counts 0.3 m."""

NEAREST, TRIES = 16, 3
"""Of the sampled poses those that are nearest to a pose, and the stations among them from which a sheet is tried."""

FIRST = frozen(np.append(-1.0, np.full(7, np.nan)))
"""Asks for the first sheet that serves, from its stations."""

AGREE = 1e-6
"""Joints [rad] that differ less are one posture."""

Call = Callable[..., Any]


def takes_stations(task: Task) -> bool:
    """Whether an arm is one of seven hinges of which a held one leaves no closed form with signs, but an inverse."""
    robot, tip, first = task.robot, task.tip, links_of(task.robot, task.tip)[0]
    if not asks_whole_pose(task) or robot.n != 7 or not robot.hinges.all():
        return False
    classes = [arm_class(robot, (k,), tip) for k in range(robot.n)]
    if (first.coordinate, first.multiplier) != (0, 1.0) or any(isinstance(c, ArmClass) and c.proven for c in classes):
        return False
    return any(isinstance(general_inverse(robot, (k,), tip), GeneralInverse) for k in range(1, robot.n))


@dataclass(frozen=True, eq=False)
class StationMap(Value):
    """Sheets in the order in which they are asked.

    joint: k, which follows the pose. rules: of each sheet (S, 28), the numbers of `Hand.terms`. sides: signs (S,) of
    det [J; e_k]. stations: postures of each sheet at sampled poses (S, P, n), NaN where it has none; each pose has one
    at least. share: of the poses of postures, evenly drawn within the limits, that the sheets serve.
    """

    task: Task
    joint: int
    rules: Matrix
    sides: Vector
    stations: Array
    share: float

    def __len__(self) -> int:
        return len(self.rules)

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
        return q, np.ones(len(q)), np.minimum(BOUNDLESS, -robot.beyond(q).max(axis=1))


class Hand:
    """Poses as a hand has them about the first axis of an arm: a direction, a point of it, and the hand in the tool."""

    def __init__(self, task: Task) -> None:
        links = links_of(task.robot, task.tip)
        axis, point = screws(links, {})[0][0]
        self.axis, self.point = np.array(axis, dtype=float), np.array(point, dtype=float)
        self.tool, self.joint = np.array(links[-1].rotation.T), np.array(links[-1].position)

    def arrows(self, T: Array) -> Array:
        """Of poses (k, 4, 4): from the point to the hand [m], and its axes, as long as a turn counts (k, 4, 3)."""
        R = T[:, :3, :3] @ self.tool
        place = T[:, :3, 3] - R @ self.joint - self.point
        return np.concatenate([place[:, None], LENGTH * R.swapaxes(1, 2)], axis=1)

    def terms(self, arrows: Array) -> Matrix:
        """The products of up to two of (k, 28): where the point is [m], and the direction, as the hand sees them."""
        R, one = arrows[:, 1:] / LENGTH, np.ones((len(arrows), 1))
        u = np.concatenate([one, -(R @ arrows[:, 0, :, None])[..., 0], R @ self.axis], axis=1)
        a, b = np.triu_indices(7)
        return u[:, a] * u[:, b]


class StationCalls:
    """What answers by the stations of a map; the doors of `SheetsKernel`."""

    def __init__(self, found: StationMap, limits: bool) -> None:
        self.map, self.limits, self.robot, self.hand = found, limits, found.task.robot, Hand(found.task)
        self.strategy = strategy_of(found.task, found.joint)
        # Of the postures at one sampled pose the first stands for all: they differ by a turn about the axis.
        there: Flags = np.asarray(np.isfinite(found.stations).all(axis=2))
        first = found.stations[there.argmax(axis=0), np.arange(len(there[0]))]
        arrows = self.hand.arrows(self.robot.pose(first, found.task.tip))
        half = 0.5 * (arrows**2).sum(axis=(1, 2))
        self.there, self.places = there, np.column_stack([arrows.reshape(-1, 12), arrows @ self.hand.axis, half])
        free = np.full(self.robot.n, np.inf)
        self._bounds = (self.robot.lower, self.robot.upper) if limits else (-free, free)

    @cached_property
    def _call(self) -> Callable[[Matrix, Vector], Vector | None]:
        """(pose (4, 4), a sheet, -1 for the first that serves, and the posture from which it is gone, NaN for that of a
        station) -> posture, margin, sheet; None where there is none."""
        found, turns, hand = self.map, turns_of(self.robot), self.hand
        paths = PosePaths(self.strategy, found.stations[0][self.there[0]][0], np.zeros(1), False)
        numbers = {"NEAREST": NEAREST, "STATION_TRIES": TRIES, "STATION_FREE": BOUNDLESS, "SERVES": DOUBT}
        head = "".join(f"#define HK_{key} {value!r}\n" for key, value in numbers.items())
        kernel = paths.kernel_with("stations.c", constants=head) if allowed() else None
        table = [paths.context, [len(found), len(self.places)], hand.axis, hand.point, hand.tool.ravel(), hand.joint]
        table += [[LENGTH], *self._bounds, turns.middle, turns.period, self.places.ravel()]
        table += [np.column_stack([found.rules, found.sides]).ravel(), found.stations.ravel()]
        call = None if kernel is None else kernel.station(frozen(np.concatenate(table)), lambda *_: None)
        return weak(self._slow) if call is None else call

    def _slow(self, T: Matrix, which: Vector) -> Vector | None:
        """The same without native code."""
        found, axis, wanted, given = self.map, self.hand.axis, int(which[0]), which[1:]
        arrows = self.hand.arrows(T[None])[0]
        along = arrows @ axis
        both = np.stack([(arrows - along[:, None] * axis).ravel(), np.cross(arrows, axis).ravel()], axis=1)
        turned = self.places[:, :12] @ both
        near = self.places[:, 12:16] @ along + np.hypot(turned[:, 0], turned[:, 1]) - self.places[:, 16]
        some = np.argsort(-near, kind="stable")[:NEAREST]
        levels = found.rules @ self.hand.terms(arrows[None])[0]
        for s in range(len(found)) if wanted < 0 else (wanted,):
            begins = [] if np.isnan(given).any() else [given.copy()]
            for i in some[self.there[s, some]][:TRIES] if not begins else []:
                begins.append(found.stations[s, i].copy())
                begins[-1][0] += np.arctan2(turned[i, 1], turned[i, 0])
            for begin in begins:
                q, status = PosePaths(self.strategy, begin, levels[s : s + 1], False).go(T[:3, 3], T[:3, :3], begin)
                if status is InverseStatus.REACHED:
                    q = at_best_turns(self.robot, q)
                    margin = float(np.minimum(q - self._bounds[0], self._bounds[1] - q).min(initial=BOUNDLESS))
                    if wanted >= 0 or margin > DOUBT:
                        return np.concatenate([q, [margin, s]])
                    break
        return None

    def place(self, T: Matrix) -> Vector:
        """Posture, margin and sheet (n + 2,) of a pose (4, 4); the map's length off the map, a margin below 0 where
        there is none."""
        row = self._call(T, FIRST)
        if row is not None:
            return row
        q, _, within = self.map.arcs(T)
        if not len(q):
            return np.concatenate([np.full(self.robot.n, np.nan), [-np.inf, len(self.map)]])
        return np.concatenate([q[0], [within[0] if self.limits else BOUNDLESS, len(self.map)]])

    def sheets(self, T: Matrix) -> Matrix:
        """The posture and the margin of each sheet (S, n + 1) at a pose (4, 4); NaN and below 0 where it has none."""
        rows = np.full((len(self.map), self.robot.n + 1), np.nan)
        rows[:, -1] = -np.inf
        for s in range(len(rows)):
            if (row := self._call(T, np.append(float(s), FIRST[1:]))) is not None:
                rows[s] = row[:-1]
        return rows

    def leads(self, T: Matrix, begin: Vector, sheet: int, q: Vector) -> bool:
        """Whether a sheet, gone straight from a posture (n,) to a pose (4, 4), comes to the posture q (n,)."""
        row = self._call(T, np.append(float(sheet), begin))
        return row is not None and bool(np.abs(wrapped(row[:-2] - q)).max() < AGREE)

    def calls(self, posture: Call, near: Call, _place: Call, _sheets: Call) -> tuple[Call, Call, Call, Call]:
        """As of `SheetsKernel`."""

        def first(pose: Any) -> Vector:
            row = self._call(pose, FIRST)
            return posture(pose) if row is None else row[:-2]

        return first, near, self.place, self.sheets

    def __call__(self, poses: Array, threads: int | None = None) -> Matrix:
        """The posture, the margin and the sheet (k, n + 2) of poses (k, 4, 4), in one thread."""
        return np.array([self.place(T) for T in poses]).reshape(len(poses), self.robot.n + 2)


@kept
def _calls(found: StationMap, limits: bool) -> StationCalls:
    return StationCalls(found, limits)


@kept
def strategy_of(task: Task, joint: int) -> HolonomicStrategy:
    """The strategy that holds a joint."""
    return holonomic(pose(task.robot, tip=task.tip), lock(joint))
