"""Inverse kinematics of a whole arm without a start: the sheets of its map, and where none serves the widest arc."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np

from ...base.errors import BranchError, HolokinError, JointLimitError, OutOfReachError, posture_text
from ...base.poses import PoseLike, given_pose, pose_numbers, tool_poses
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, NoTruthValue, Value, Vector, tool_pose
from ...robot import Robot, nearer_or_other
from ...strategies.tasks.task import Task
from ...symbolic.native import engine, weak
from .arm_map import CLOSER, HOPE, LAST_HOPE, ON_SHEET, TIE, TRIES, ArmMap
from .closed_leaf import DOUBT
from .inverse_function import AGREE
from .stations import StationMap

BLOCKED = 16
"""Places of the arcs that are looked at more closely where all that serve touch something."""

LOOKED = 4
"""Spins of a tool, the best of some, at which it is looked why no posture serves."""

Obstructed = Callable[[Matrix], Sequence[str]]
"""Of postures (k, n): what each of them touches, "" for nothing."""


class NearAnswer(NamedTuple):
    """What `ik.near(pose, q)` gives: the joints (n,), their sheet, None off the map, and whether they changed it.

    Where `changed` is True the joints are not those to which the sheet of the last posture leads, or are a full turn
    away because a joint is at its limit: a motion has to bring the arm there.
    """

    q: Vector
    sheet: int | None
    changed: bool


class SheetPostures(NamedTuple):
    """All sheets at a pose: the posture of each q (S, n), NaN where it does not serve, and its margin (S,).

    The margin is how far the posture is from the next joint limit [joint units], or from where the closed form or the
    rule ends, if that is less: on the way to where a sheet ends it falls to 0, and beyond it is negative.
    """

    q: Matrix
    margin: Vector


@dataclass(frozen=True, eq=False)
class ArmAnswers(NoTruthValue, Value, ask="`.reached`"):
    """The answers of many poses: joints q (k, n), NaN where there are none; the sheet of each (k,), -1 off the map."""

    q: Matrix
    sheet: Indices

    def __len__(self) -> int:
        return len(self.sheet)

    def __str__(self) -> str:
        off = int((self.reached & (self.sheet < 0)).sum())
        return f"{int(self.reached.sum()):,} of {len(self):,} poses reached, {off:,} of them off the map"

    @property
    def reached(self) -> Flags:
        """True where q is found (k,)."""
        return np.asarray(np.isfinite(self.q).all(axis=1))


def _margin(share: Vector, within: Vector) -> Vector:
    """The lesser of how real postures are and how far within the limits; of others the latter says nothing."""
    return np.where((share < 0) | (share < within), share, within)


def _largest(values: Vector) -> int:
    """The index of the largest value, of those that are equal but for TIE the first."""
    best = 0
    for i, value in enumerate(values.tolist()):
        best = i if value > values[best] + TIE else best
    return best


@dataclass(frozen=True, eq=False)
class ArmInverse(Value):
    """pose -> q of a whole arm, without a strategy and a start. Make one with `hk.ik(robot)`.

    `ik(pose)` asks the sheets of the arm's map in their order. On a sheet one joint follows the pose, q_k = h(pose),
    and signs choose one of the postures that are left: so it has at most one of a pose, wherever the tool was before.
    Where no sheet has one within the limits, that of all its postures is given which is farthest from the limits and
    from the ends of its arc: it is a function of the pose, too, but next to it the joints may jump.

    `ik.near(pose, q)` stays on the sheet of q while that serves; `ik.batch(poses)` answers for many poses.

    touches: what keeps clear of obstacles; None where nothing is looked at.
    """

    task: Task
    map: ArmMap | StationMap
    limits: bool = True
    touches: Obstructed | None = None

    def __call__(self, pose: PoseLike) -> Vector:
        """q (n,) of a tool pose (4, 4): a function of the pose alone, the same to the last bit at every call.

        Of joints with several turns within their limits that nearest to the middle of these is taken.

        Raises:
            OutOfReachError: no posture has the pose. JointLimitError: each is beyond the limits. BranchError: with a
            scene, each touches something. ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        return self._calls[0](pose)

    def near(self, pose: PoseLike, q: ArrayLike) -> NearAnswer:
        """The same on the sheet of a posture q (n,), such as the last answer, while that serves, at the turns of q.

        q may be off its sheet by 0.01 [joint units], as measured joints are. Where its sheet does not serve, the
        nearest posture of another one that does is given; where none does, that of `ik(pose)`.

        Raises: as `ik(pose)`; ShapeError, NotFiniteError: q.
        """
        row = self._calls[1](pose, q)
        sheet = int(row[-2])
        return NearAnswer(row[:-2], sheet if sheet >= 0 else None, bool(row[-1]))

    def batch(self, poses: PoseLike, threads: int | None = None) -> ArmAnswers:
        """The answers of many tool poses (k, 4, 4), each as `ik(pose)`; a pose without an answer does not raise.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: bad poses.
        """
        rows = self._places(tool_poses("of the batch", poses), threads)
        reached, q = rows[:, -2] >= 0, rows[:, :-2].copy()
        q[~reached] = np.nan
        return ArmAnswers(q, np.where(reached & (rows[:, -1] < len(self.map)), rows[:, -1], -1).astype(np.intp))

    def sheet(self, pose: PoseLike) -> int | None:
        """The index of the sheet that answers for a tool pose (4, 4); None off the map, or where there is no answer.

        Raises: ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        serves = self._served(self._pose(pose))[1]
        return int(serves.argmax()) if serves.any() else None

    def sheets(self, pose: PoseLike) -> SheetPostures:
        """The postures of all sheets at a tool pose (4, 4), and how far each is from where it ends.

        Two of them are joined while the tool stands still where `hk.motion.ik.self_motion(task, pose)` has an arc
        with both.

        Raises: ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        rows, serves = self._served(self._pose(pose))
        return SheetPostures(np.where(serves[:, None], rows[:, :-1], np.nan), rows[:, -1].copy())

    def why(self, pose: PoseLike) -> str:
        """What becomes of a tool pose (4, 4), in words: its sheet, or "off the map", or why it has no answer.

        Raises: ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        T = self._pose(pose)
        sheet = self.sheet(T)
        if sheet is not None:
            return f"served by sheet {sheet}"
        off = "off the map: no sheet serves it, but the arm reaches it"
        return off if self._place(T)[-2] >= 0 else self._reason(T)[0]

    @property
    def engine(self) -> str:
        """One line that says what runs; it is built, or loaded, if it is not yet there: ask before a loop begins."""
        return engine() if self.map.kernel(self.limits) is not None else "CasADi's virtual machine"

    @property
    def theorem(self) -> str:
        """What is proven of each sheet, and how to have the proof."""
        if isinstance(self.map, StationMap):
            return "Nothing is proven: no closed form tells the postures of this arm apart."
        robot, arm = self._robot, self.map.arm
        name, held = robot.joint_names[arm.held[0]] if arm.held else "", self.map.held
        followers = [f"joint {name!r}"] * bool(name) + ["the spin of the tool"] * (held.spin is not None)
        rule = f"with {' and '.join(followers)} a function of the tool's pose, " if followers else ""
        strategy = f"hk.holonomic(task, hk.lock({name!r}))" if name else "hk.moore_penrose(task)"
        exact = f"an exact model, {arm.angle:.1e} rad and {arm.distance:.1e} m from the robot"
        return (
            f"On the whole arm, {rule}two postures of one sheet that have the same tool pose are the same but for "
            f"whole turns of joints. It is about {'the robot as it is' if arm.exact else exact}. The rule does not "
            f"matter: hk.certify({strategy}) writes the proof, task = hk.pose(robot)."
        )

    def __str__(self) -> str:
        robot, found = self._robot, self.map
        spins = isinstance(found, ArmMap) and found.held.spin is not None
        joint = found.joint if isinstance(found, StationMap) else found.held.joint
        what = f"joint {robot.joint_names[joint]!r}" if joint is not None else "the spin of the tool" if spins else None
        rule = "" if what is None else f", on each of which {what} follows the tool's pose"
        limits = "within its joint limits" if self.limits else "whatever its joint limits"
        share = f"they serve {self.map.share:.1%} of what it reaches within its limits"
        early = (
            ""
            if isinstance(found, StationMap) or found.complete
            else "; its map is not complete, since making it was stopped: ask hk.ik again"
        )
        return f"inverse kinematics of {robot.name!r} {limits}: {len(self.map)} sheets{rule}; {share}{early}"

    # --- What is beneath: native code, or the same by CasADi.

    @property
    def _robot(self) -> Robot:
        return self.task.robot

    @property
    def _closed(self) -> ArmMap:
        """The map, of an arm with closed forms."""
        return cast(ArmMap, self.map)

    def _pose(self, pose: PoseLike) -> Matrix:
        return tool_pose("a tool pose", given_pose("a tool pose", pose_numbers("a tool pose", pose)))

    @cached_property
    def _calls(
        self,
    ) -> tuple[Callable[..., Array], ...]:
        """What `SheetsKernel.calls` gives, with a scene in Python."""
        others = weak(self._slow), weak(self._slow_near), weak(self._slow_place), weak(self._slow_sheets)
        kernel = self.map.kernel(self.limits)
        bound = None if kernel is None else kernel.calls(*others)
        calls = others if bound is None else bound
        return calls if self.touches is None else (*others[:2], *calls[2:])

    def _slow(self, pose: PoseLike) -> Vector:
        """`ik(pose)` of any pose: the joints, or an error."""
        T = self._pose(pose)
        row = self._place(T)
        if not row[-2] >= 0:
            raise self._reason(T)[1]
        return row[:-2].copy()

    def _slow_near(self, pose: PoseLike, q: ArrayLike) -> Vector:
        """`ik.near(pose, q)` of any pose: posture, sheet, -1 for none, and whether the joints jump."""
        T, begin = self._pose(pose), self._robot.checked(q, "the posture")
        own, (rows, serves) = self._sheet_of(begin), self._served(T)
        if not serves.any():
            return np.append(self._turned(self(T), begin), [-1, 1])
        postures = self._turned(rows[:, :-1], begin)
        away = np.where(serves, np.abs(postures - begin).max(axis=1), np.inf)
        if own is not None and away[own] <= np.pi:
            away[own] = -1.0
        sheet = int(away.argmin())
        stays = sheet == own and away[sheet] < 0
        if stays and isinstance(self.map, StationMap):
            stays = self.map.kernel(self.limits).leads(T, begin, sheet, postures[sheet])
        return np.append(postures[sheet], [sheet, not stays])

    def _place(self, T: Matrix) -> Vector:
        """Posture, margin and sheet (n + 2,) of a pose (4, 4); a margin below 0 where there is none."""
        row = self._calls[2](T) if self.touches is None else self._slow_place(T)
        return row if row[-2] >= 0 or self._whole is None else self._best_spin(T, self._whole)

    @cached_property
    def _whole(self) -> ArmInverse | None:
        """The arm's own answers to whole poses, where it has a redundant joint beside a free spin."""
        below = None if isinstance(self.map, StationMap) else self.map.below
        return None if below is None or below.held.none else ArmInverse(self.task, below, self.limits, self.touches)

    def _spins(self, T: Matrix) -> Array:
        """The pose with the tool at some spins (C, 4, 4)."""
        return np.asarray(self._closed.held.turned.batch(T, self._closed.values[:, None]))

    def _best_spin(self, T: Matrix, whole: ArmInverse) -> Vector:
        """What the arm answers to the pose turned about its axis by some spins: the largest margin."""
        rows = whole._places(self._spins(T), 1)
        best = rows[_largest(rows[:, -2])]
        best[-1] = len(self.map)
        return best

    def _places(self, T: Array, threads: int | None) -> Matrix:
        """Those (k, n + 2) of poses (k, 4, 4)."""
        kernel = self.map.kernel(self.limits)
        if kernel is None:
            return np.array([self._place(pose) for pose in T]).reshape(len(T), self._robot.n + 2)
        rows = kernel(T, threads)
        if self.touches is not None:
            off = rows[:, -1] == len(self.map)
            for i in np.flatnonzero((rows[:, -2] >= 0) & (off | ~self._free(rows[:, :-2]))):
                rows[i] = self._slow_place(T[i])
        for i in np.flatnonzero(~(rows[:, -2] >= 0) if self._whole is not None else []):
            rows[i] = self._place(T[i])
        return rows

    def _slow_place(self, T: Matrix) -> Vector:
        rows, serves = self._served(T)
        if serves.any():
            return np.append(rows[serves.argmax()], serves.argmax())
        # With a scene the arcs at all values, and what lies between only where none of them keeps clear.
        q, margin = self._clear(self._looks(T))
        if self.touches is not None and not margin.max() >= 0:
            q, margin = self._clear(self._arcs(T))
        best = _largest(margin)
        return np.append(q[best], [margin[best], len(self.map)])

    def _slow_sheets(self, T: Matrix) -> Matrix:
        q, share, within = self._answers(T, self._closed.rows)
        return np.column_stack([q, _margin(share, within)])

    def _served(self, T: Matrix) -> tuple[Matrix, Flags]:
        """The postures and margins of the sheets (S, n + 1) at a pose, and which of them serve it (S,)."""
        rows = self._calls[3](T)
        serves = rows[:, -1] > DOUBT
        if self.touches is not None and serves.any():
            serves[serves] = self._free(rows[serves, :-1])
        return rows, serves

    def _answers(self, T: Matrix, rules: Matrix) -> tuple[Matrix, Vector, Vector]:
        """Of rules and branches (j, w + b) at a pose: postures (j, n), how real, and how far within the limits (j,)."""
        w, poses = self._closed.held.width, np.repeat(T[None], len(rules), axis=0)
        given = poses, np.ascontiguousarray(rules[:, :w]), np.ascontiguousarray(rules[:, w:])
        q, share, within, _ = self._closed.postures(self.limits).batch(*given)
        return q, np.ravel(share), np.ravel(within)

    def _looks(self, T: Matrix) -> tuple[Matrix, Vector, Vector]:
        """The same of the arcs of a pose, with a scene only as it is told by values of what is held."""
        by_values = self.touches is not None and isinstance(self.map, ArmMap)
        return self._answers(T, self._closed.grid) if by_values else self._arcs(T)

    def _arcs(self, T: Matrix) -> tuple[Matrix, Vector, Vector]:
        """The same of the arcs of a pose at all values, and closer to the largest margins, as sheets.c has it."""
        if isinstance(self.map, StationMap):
            return self.map.arcs(T)
        found, rules = self.map, self.map.grid
        rows = self._answers(T, rules)
        if found.held.none:
            return rows
        # Closer to the largest margin if it serves, else to many: at first to peaks.
        count = len(found.values)
        margin = _margin(rows[1], rows[2]).reshape(-1, count)
        before, after = np.roll(margin, 1, axis=1), np.roll(margin, -1, axis=1)
        if not found.held.turning:
            before[:, 0], after[:, -1] = margin[:, 0], margin[:, -1]
        peak, margin = ((margin + TIE >= before) & (margin + TIE >= after)).ravel(), margin.ravel()
        most = TRIES if not (margin > 0).any() else 1 if self.touches is None else BLOCKED
        for places in (peak & (margin > HOPE), ~peak & (margin > LAST_HOPE)):
            left, tops = np.flatnonzero(places).tolist(), list[int]()
            while left and len(tops) < most:
                tops.append(left.pop(_largest(margin[left])))
            if tops:
                more = self._closer(T, rules[tops], found.values[np.array(tops) % count], margin[tops])
                q, share, within = (np.concatenate(parts) for parts in zip(more, rows, strict=True))
                rows = q, share, within
            if (_margin(*rows[1:]) > 0).any():
                break
        return rows

    def _arcs_of(self, poses: Array) -> tuple[Matrix, Vector, Vector]:
        """The same of some poses (k, 4, 4), of those with the largest margins."""
        margins = self._places(poses, 1)[:, -2]
        parts = [self._arcs(poses[i]) for i in np.argsort(-margins, kind="stable")[:LOOKED]]
        q, share, within = (np.concatenate(part) for part in zip(*parts, strict=True))
        return q, share, within

    def _closer(self, T: Matrix, rules: Matrix, c: Vector, best: Vector) -> tuple[Matrix, Vector, Vector]:
        """The same near values c (t,) of what is held on arcs, ever closer to the largest margins; arc after arc."""
        held, values, every = self._closed.held, self._closed.values, list[tuple[Matrix, Vector, Vector]]()
        step, places = values[1] - values[0], np.delete(np.arange(-4, 5), 4)
        reach = step if held.turning else 0.0
        for _ in range(CLOSER):
            step /= 4.5
            near = np.clip(c[:, None] + places * step, values[0] - reach, values[-1] + reach)
            closer = np.repeat(rules, len(places), axis=0)
            closer[:, : held.width] = held.constant(near.ravel())
            every.append(self._answers(T, closer))
            margins = _margin(*every[-1][1:]).reshape(near.shape)
            for i, row in enumerate(margins.tolist()):
                top = _largest(np.array([best[i], *row]))
                if top:
                    best[i], c[i] = row[top - 1], near[i, top - 1]
        order = np.argsort(np.tile(np.repeat(np.arange(len(rules)), len(places)), len(every)), kind="stable")
        q, share, within = (np.concatenate(parts)[order] for parts in zip(*every, strict=True))
        return q, share, within

    def _clear(self, rows: tuple[Matrix, Vector, Vector]) -> tuple[Matrix, Vector]:
        """Postures and their margins, of those that serve but touch something -inf."""
        q, margin = rows[0], _margin(*rows[1:])
        serves = np.flatnonzero(margin >= 0)
        margin[serves[~self._free(q[serves])]] = -np.inf
        return q, margin

    def _free(self, Q: Matrix) -> Flags:
        """Which postures (k, n) keep clear (k,)."""
        words = ["" for _ in Q] if self.touches is None else self.touches(Q)
        return np.array([not word for word in words], dtype=bool)

    def _sheet_of(self, q: Vector) -> int | None:
        """The sheet on which a posture (n,) lies; None where it lies on none."""
        rows = self._calls[3](self._robot.pose(q, self.task.tip))
        gaps = np.abs(self._turned(rows[:, :-1], q) - q).max(axis=1)
        gaps[~((rows[:, -1] > -ON_SHEET) & np.isfinite(gaps))] = np.inf
        return int(gaps.argmin()) if gaps.min() < ON_SHEET else None

    def _turned(self, q: Array, near: Vector) -> Array:
        """Postures (..., n) with hinges at the turns nearest to a posture (n,), within the limits."""
        turns, robot = np.round((near - q) / (2 * np.pi)), self._robot
        if self.limits:
            turns = np.clip(
                turns,
                np.ceil((robot.lower - q) / (2 * np.pi) - AGREE),
                np.floor((robot.upper - q) / (2 * np.pi) + AGREE),
            )
        return q + 2 * np.pi * robot.hinges * turns

    def _reason(self, T: Matrix) -> tuple[str, HolokinError]:
        """Why a pose has no answer, in short, and as an error."""
        robot, p = self._robot, T[:3, 3]
        where = f"the pose at {posture_text(p)} m"
        q, share, within = self._arcs(T) if self._whole is None else self._whole._arcs_of(self._spins(T))
        if not (share > 0).any():
            fact = f"{where} is out of reach of {robot.name!r}: no posture has it"
            return "out of reach", OutOfReachError(fact, nearer_or_other(robot, p, self.task.tip), position=p)
        kept = q[(share > 0) & (within >= 0)]
        if not len(kept):
            best = q[int(np.where(share > 0, within, -np.inf).argmax())]
            i = int(np.argmax(robot.beyond(best)))
            facts = robot.joint_names[i], float(best[i]), float(robot.lower[i]), float(robot.upper[i])
            unit = "rad" if robot.hinges[i] else "m"
            cure = "of all postures of the pose this is the nearest to the limits: give another pose, or widen them"
            past = f"{robot.beyond(best)[i]:.2g} {unit}"
            return f"limits: joint {facts[0]!r} by {past} at best", JointLimitError(*facts, unit, cure)
        words = [] if self.touches is None else [word for word in self.touches(kept) if word]
        most = max(sorted(set(words)), key=words.count, default="something")
        fact = f"{where} has no posture that keeps clear: of {len(kept)} that were looked at most touch {most}"
        return f"collides: {most}", BranchError(fact, "give another pose, or move the obstacle")
