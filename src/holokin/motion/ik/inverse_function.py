"""Inverse kinematics as a function: the joints that the straight path from the start reaches on its leaf g(q) = c."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...base.arguments import check, typed
from ...base.errors import ArgumentError, BranchError, HolokinError, NativeError, OutOfReachError, posture_text
from ...base.poses import PoseLike, pose_numbers
from ...base.types import (
    Array,
    ArrayLike,
    Flags,
    Indices,
    Matrix,
    NoTruthValue,
    Value,
    Vector,
    frozen,
    kept,
    one_or_each,
    positive,
    whole,
)
from ...robot import start_posture
from ...strategies import HolonomicStrategy, Strategy, may_jump
from ...symbolic.native import LARGEST, EdgeKernel, enabled, engine, tell, weak
from .closed_leaf import held_joints
from .descent import CONSTANTS, WITHIN, descend, inside, least_ratio, part
from .edge import SAME, Edge, Goal, Look, edge_function, inverse_code, stretch_code
from .leaf import TRIES, leaf_step, leaf_value, level_towards, with_leaves
from .pose_paths import PosePaths
from .postures_of_pose import Postures, all_postures
from .solutions import GivenPoses, InverseStatus, PoseSet, Solutions

# --- The pose of a leaf that is nearest to a wanted one: what a robot does whose operator's hand leaves its reach.

LENGTH = 0.3
"""Length [m] that weighs angles against positions: 0.1 rad count as 3 cm. Arms of a metre have their best rcond at it
(Panda and iiwa at their ready postures, measured)."""

MARGIN = 0.1
"""rcond up to which the tool goes. Measured on a Panda, stretched: 2 to 5 mm of reach are left out, and its joints move
at most five times as fast as at its ready posture. Half of it leaves out a quarter and lets them move twice as fast."""

HELD = 1e-7
"""Distance to a constraint [m] at which it stops the tool."""

REACHED = 1e-9
"""Distance [m] that counts as none."""


ALONG = 0.1
"""Share of what is missing by which a step along the edge must lead on, where it is to be known whether a slide from
the start comes to a pose: below, the edge is square to the path there, and the slide as good as ended."""

LEAST = 0.5
"""Steps by which a call must bring the joints nearer to where they belong, or they go straight: it takes twice as many
calls as the joints' way has steps, at most."""

_REFUSED = {2: InverseStatus.NOT_FINITE, 3: InverseStatus.NOT_A_ROTATION}
"""What native code says of a goal that is no pose."""


@dataclass(frozen=True, eq=False)
class Nearest(NoTruthValue, Value, ask="`.status`"):
    """The posture q (n,) of a leaf whose tool pose (4, 4) is nearest to a wanted one.

    status: REACHED where nothing is missing, else CLAMPED, or what is wrong with the wanted pose: then q is as it was.
    distance [m] = sqrt(position^2 + (length angle)^2): what is missing, with its parts position [m] and angle [rad]; of
    a task that knows no whole orientation the angle is that of its rows.
    rcond: m / (|J| |G|), of Frobenius norms, angles in units of length; 1 at best, 0 at a singular posture.
    held: what stops the tool, "rcond" and the names of joints at their limits.
    moving: True where `step` was too short to get there in this call; then a joint has moved by half of it or more.
    """

    q: Vector
    pose: Matrix
    status: InverseStatus
    distance: float
    position: float
    angle: float
    rcond: float
    held: tuple[str, ...] = ()
    moving: bool = False

    def __str__(self) -> str:
        verdict = self.status.name.lower().replace("_", " ")
        if self.status is InverseStatus.CLAMPED:
            missing = f"{self.position:.3g} m and {self.angle:.3g} rad are missing"
            verdict = f"{verdict}: {missing}, {'held by ' + ', '.join(self.held) if self.held else 'held by nothing'}"
        return f"{verdict}, rcond {self.rcond:.2g}{', still moving' if self.moving else ''}"


@kept
def _edge_kernel(strategy: HolonomicStrategy) -> EdgeKernel | None:
    """All this as native code; None where there can be none."""
    step, look = leaf_step(strategy), edge_function(strategy)
    operations = max(step.program.instructions, look.program.instructions)
    if operations > LARGEST or not enabled():
        return None
    code = inverse_code(strategy) + step.c("hk_leaf_body") + look.c("hk_edge_body")
    constants = {**CONSTANTS, "REACHED": REACHED, "LEAST": LEAST, "ALONG": ALONG}
    task = strategy.task
    try:
        return EdgeKernel(task.n, task.m, code, stretch_code(strategy), constants, operations)
    except NativeError as problem:
        tell(problem)
        return None


def _edge_at(strategy: HolonomicStrategy, start: ArrayLike, length: float, rcond: float, limits: bool) -> Edge:
    """The edge of the leaf through a start (n,). Raises: ArgumentError: the start lies beyond it. JointLimitError."""
    robot = strategy.task.robot
    q0 = start_posture(robot, start, limits)
    free = np.full(robot.n, np.inf)
    edge = Edge(strategy, q0, length, rcond, *((robot.lower, robot.upper) if limits else (-free, free)))
    look = edge.look(q0, edge.tool(q0))
    if not look.rcond >= rcond:
        cure = f"give a smaller one, or a start farther from singular postures: this one has {look.rcond:.3g}"
        raise ArgumentError("rcond, below which the tool is not to go", rcond, cure)
    return edge


_edge_of = kept(_edge_at)
"""The same, remembered with the strategy; the start is a tuple."""


def down(
    edge: Edge, look: Look, goal: Goal, careful: bool, begin: Goal, q: Vector, step: Vector | None = None
) -> tuple[Look, Look | None] | None:
    """The end of the path down from a look, which may be outside; and how far a step leads, where that is not its end.

    None where it is not shown to be on the branch of a posture q, whose tool is at `begin`. careful: each piece is
    shown to keep to the branch; else Newton steps alone lead down, and the straight path from q to the end is.
    """
    within = inside(edge, look, goal, careful)
    if within is None:
        return None
    end, cut = descend(edge, within, goal, careful, q, step)
    return (end, cut) if careful or edge.joined(q, begin, cut or end) else None


def _from_start(edge: Edge, goal: Goal, careful: bool) -> tuple[Look, bool]:
    """The look where the straight path from the start ends; True where at the goal, within the constraints.

    careful: the look at the start where the path is not shown to lead there; a ray is always gone as far as it goes.
    """
    way = edge.straight(edge.tool(edge.q0), goal)
    q, reached = edge.walk(edge.q0, way, TRIES) if careful else edge.glance(edge.q0, way)
    look = edge.look(q if reached or not careful or edge.ray else edge.q0, goal)
    return look, reached and look.excess <= WITHIN


def _reached_from_start(edge: Edge, goal: Goal, near: Vector | None = None) -> tuple[Look, bool]:
    """The same: what a glance does not reach is not reached; what it does reach is shown.

    But where it comes to a posture that is known to be `near`: then two paths agree, and a way that passes close by a
    singular posture takes milliseconds to show. Of 7,200 poses that were reached, a glance missed one, and came to
    another posture never. Rays are gone in Newton steps anyway.
    """
    if edge.ray:
        return _from_start(edge, goal, True)
    look, reached = _from_start(edge, goal, False)
    agrees = near is not None and float(np.abs(look.q - near).max()) <= SAME
    return _from_start(edge, goal, True) if reached and not agrees else (look, reached)


def _slid_from_start(edge: Edge, goal: Goal, look: Look) -> Look | None:
    """The look at a goal, where the path down leads to it from where the straight path from the start ends."""
    within = inside(edge, look, goal, False)
    end = look if within is None else descend(edge, within, goal, False, edge.q0, None, ALONG)[0]
    reached = end.distance <= REACHED and end.excess <= WITHIN
    return end if reached and edge.joined(edge.q0, edge.tool(edge.q0), end) else None


def cold(edge: Edge, goal: Goal) -> Look:
    """The look at the posture nearest to a goal, found from the start alone."""
    look, reached = _reached_from_start(edge, goal)
    if reached:
        return look
    end = down(edge, look, goal, False, edge.tool(edge.q0), edge.q0)
    return end[0] if end is not None else descend(edge, edge.look(edge.q0, goal), goal, True, edge.q0)[0]


def warm(edge: Edge, goal: Goal, q: Vector, step: Vector | None) -> tuple[Look, bool]:
    """The same from a posture nearby, each joint moving by at most a step (n,), and True where that cut it short.

    The joints belong to a pose that the start reaches; to one that it does not, the tool slides. Where they belong, the
    tool goes straight on the leaf, if that brings the joints nearer, else they go straight: so they arrive, from any q.
    """
    begin = edge.onto(q, goal)
    end, cut, belongs = _destination(edge, goal, q, begin, step)
    if step is None or least_ratio(end.q, q, step) >= 1.0:
        return end, False
    if belongs and begin is not None:
        share = min(1.0, least_ratio(begin.q + begin.S @ begin.e, begin.q, step))
        cut = part(edge, begin, None, share, goal, True, begin.q, step)
    straight = edge.look(limited(q, end.q, step), goal)
    if cut is None:
        return straight, True
    along = edge.look(limited(q, cut.q, step), goal)
    gone = steps(q, end.q, step) - steps(along.q, end.q, step) if belongs else steps(q, along.q, step)
    if gone < LEAST and not belongs and straight.distance + straight.excess >= along.distance:
        return along, False  # the straight path there leads by worse places
    return (along if gone >= LEAST else straight), True


def _destination(
    edge: Edge, goal: Goal, q: Vector, begin: Look | None, step: Vector | None
) -> tuple[Look, Look | None, bool]:
    """Where a posture q, or one of the leaf close to it, is to go: where the joints belong, which the start tells, then
    True; else down to the nearest pose, and how far a step leads on that way, where that is not its end."""
    look, reached = _reached_from_start(edge, goal, edge.solved(q, *goal, edge.leaf))
    if reached:
        return look, None, True
    descent = None
    if begin is not None:
        tool = begin.position, begin.rotation
        tries = (down(edge, begin, goal, careful, tool, begin.q, step) for careful in (False, True))
        descent = next((path_down for path_down in tries if path_down is not None), None)
    if descent is None:
        return cold(edge, goal), None, True
    slid = _slid_from_start(edge, goal, look) if descent[0].distance > REACHED else None
    return (*descent, False) if slid is None else (slid, None, True)


def steps(a: Vector, b: Vector, step: Vector) -> float:
    """How many steps the joints are from a to b."""
    return 1.0 / least_ratio(b, a, step)


def limited(q: Vector, end: Vector, step: Vector) -> Vector:
    """From q straight towards a posture, as far as a step allows."""
    return q + min(1.0, least_ratio(end, q, step)) * (end - q)


def nearest(
    edge: Edge, goal: Goal, refused: Callable[[], InverseStatus], q: Vector | None, step: Vector | None
) -> Nearest:
    """The nearest pose to a goal, from the start or from q; `refused` looks whether the goal is a pose at all."""
    kernel = _edge_kernel(edge.strategy)
    if kernel is not None:
        ended, numbers = kernel(edge.context, np.concatenate([goal[0], goal[1].ravel()]), q, step)
        moving, status = ended == 1, _REFUSED.get(ended, InverseStatus.REACHED)
    elif (status := refused()) is InverseStatus.REACHED:
        look, moving = (cold(edge, goal), False) if q is None else warm(edge, goal, q, step)
        numbers = look.numbers
    else:
        numbers, moving = None, False
    if numbers is None or status is not InverseStatus.REACHED:
        stays = edge.q0 if q is None else q  # without q, what is no pose was refused before
        return Nearest(stays, np.full((4, 4), np.nan), status, np.nan, np.nan, np.nan, np.nan)
    joints, e, rcond, tool, slack = numbers
    pose = np.zeros((4, 4))
    pose[:3, :3], pose[:3, 3], pose[3, 3] = tool[3:].reshape(3, 3), tool[:3], 1.0
    distance, position, angle = (float(part @ part) ** 0.5 for part in (e, e[edge.linear], e[~edge.linear]))
    missing = distance > REACHED
    held = tuple(edge.names[k] for k in np.flatnonzero(slack <= HELD)) if missing else ()
    status = InverseStatus.CLAMPED if missing else InverseStatus.REACHED
    return Nearest(joints, pose, status, distance, position, angle / edge.length, float(rcond[0]), held, moving)


def steps_of(what: str, value: ArrayLike, joints: int) -> Vector:
    """Positive numbers, one of each joint (n,) or one for all. Raises: ShapeError, ArgumentError."""
    given = one_or_each(what, value, joints)
    if not (given > 0).all():  # NaN included
        raise ArgumentError(what, np.asarray(value, dtype=float).tolist(), "give positive numbers")
    return np.ascontiguousarray(given)


AGREE = 1e-6
"""Joints [joint unit] that differ less are one posture."""


@dataclass(frozen=True, eq=False)
class InverseKinematics(Value):
    """pose -> q on one leaf of a strategy, on the branch of its start. Make one with `ik`.

    `ik(pose)` begins at the start, `ik.near(pose, q)` at a posture nearby, such as the last answer; `ik.batch(poses)`
    does the first for many poses.

    A pose is an array, or a pose of another library (`mink.SE3`, `pinocchio.SE3`); `pose_of` makes one of a quaternion.

    Where nothing is redundant, r = n - m = 0, there is no leaf to choose: the branch of the start is followed.

    Where single joints are held on an arm whose other six have a closed inverse, `ik(pose)` and `ik.batch(poses)` go no
    path: of all postures of the pose they give the one that has the start's signs of the three factors of the
    determinant. `ik.all(pose)` gives all of them.

    What the task leaves free of a pose, as the spin of an "axis" task, is no demand: it is taken from the posture at
    which a path begins, so that poses which the task cannot tell apart have the same joints.

    With `level=c` a call answers on the leaf g(q) = c (r,) in place of that of the start: `ik(pose, level=c)` is a
    function of the pose and of c, as of the hand and of the elbow of an operator. Rows that are angles go to theirs by
    the shorter way from the start.

    With a `region`, over which the joints are proven to be one function of the pose, poses outside are refused.
    Inside, `ik(pose)`, `ik.near(pose, q)` and `ik.batch(poses)` have the same joints for ever.
    """

    strategy: HolonomicStrategy
    q0: Vector
    limits: bool = True
    region: PoseSet | None = None

    def __call__(self, pose: PoseLike, level: ArrayLike | None = None) -> Vector:
        """q (n,) of a tool pose (4, 4), or of a position (3,) or (2,) with the orientation of the start.

        Of a task of several frames poses are (F, 4, 4), or points (F, 3), or the numbers of a `custom_task` (d,).

        Reached from the start along the straight line to it (turning evenly about one axis), so it is a
        function of the pose: the same pose gives the same joints to the last bit. The posture of the pose keeps the
        joint limits, unless `ik` was told not to look at them; those on the way to it need not. Where the held joints
        leave a closed inverse it is the posture with the signs of the start, which is the same wherever the line leads
        there, and no line is gone.

        Args:
            level: c (r,), or one number for all rows; by default that of the start. The path leads straight from level
                to level, too.

        The joints are an array, without a status: a refusal is an exception, and `batch` has a status for each pose.

        Raises:
            SingularityError, BranchError: the leaf does not reach so far on a straight line, or g jumps on it.
            OutOfReachError: no posture of the arm at all reaches it, or none within the limits: milliseconds to find
                out, and up to a second where only a search can tell.
            JointLimitError: the posture is beyond the joint limits.
            OutOfReachError: only with a region: the pose does not belong to it.
            ShapeError, NotFiniteError, ArgumentError: a bad pose or level; a level beside a region.
        """
        if level is None:
            return self._cold_call(pose)
        return self._cold_at(*self._given_poses.one(pose), self._at_level(level))

    def all(self, pose: PoseLike, level: ArrayLike | None = None, *, near: ArrayLike | None = None) -> Postures:
        """All postures of a tool pose (4, 4) on the leaf, whatever their branch; see `all_postures`.

        By an inverse of six hinges, along the self-motion, or, with several redundant joints, as far as a search finds
        them: the answer says which.

        Args:
            level: c (r,), or one number for all rows; by default that of the start.
            near: of whole turns those nearest to this posture (n,) are given; by default to the start.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: as `all_postures`.
        """
        c = self._paths.level if level is None else level
        return all_postures(self.strategy, pose, c, limits=self.limits, near=self.q0 if near is None else near)

    def agrees(self, q: ArrayLike, level: ArrayLike | None = None) -> bool:
        """Whether a posture q (n,) is the one that `ik(pose, level)` gives for its tool pose, to 1e-6 [joint units].

        A loop of `near` may be on another posture of the leaf: round a hole of the workspace or a cusp, or a full turn
        of a joint further. This asks once, by one cold call, as between two tasks or in the background of a loop.

        Raises: as `ik(pose)`; ShapeError, NotFiniteError: q.
        """
        posture = self.strategy.task.robot.checked(q, "the posture")
        p, R = self.strategy.task._place(posture)
        paths = self._paths if level is None else self._at_level(level)
        return bool(np.abs(self._cold_at(p, R, paths) - posture).max() < AGREE)

    def near(self, pose: PoseLike, q: ArrayLike, level: ArrayLike | None = None) -> Vector:
        """The same, reached from a posture q (n,) on the same branch: the faster, the nearer q is.

        The path leads straight from the tool pose at q, and from the level g(q) to that of the leaf: q need not lie
        exactly on it, as measured joints do not. The answer does. It is that of `ik(pose, level)` wherever the two
        paths to the pose, from the start by q and straight from the start, can be drawn into one another without
        passing a place where the leaf ends. They differ only where such a place lies between them: round a hole of the
        workspace, or by a full turn of a joint.

        What a call encloses about its posture serves the next ones of its thread, so that threads may share `near`.

        Raises:
            BranchError: q lies on another branch than the start; with a region, from q another posture is reached than
                that of `ik(pose)`.
            As `ik(pose)`, but for OutOfReachError, for which a loop would wait.
        """
        if level is None:
            return self._path_calls[1](pose, q)
        return self._warm(pose, q, self._at_level(level))

    def batch(self, poses: PoseLike, threads: int | None = None, level: ArrayLike | None = None) -> Solutions:
        """q of many poses (k, 4, 4), or positions (k, 3) or (k, 2), each as `ik(pose, level)` finds it.

        No pose raises: `status` tells what became of each. `threads`: all processors by default. `level`: one (r,) for
        all poses, or a row for each (k, r).

        Raises:
            ShapeError, ArgumentError: poses that are no array of poses, or levels that are none.
        """
        if threads is not None:
            whole("threads", threads)
        given = self._given_poses.shaped("each of the tool poses", pose_numbers("tool poses", poses))
        p, R = self._given_poses.places(given)
        last, status = np.full((len(given), len(self.q0)), np.nan), self._given_poses.refused(p, R)
        paths, sound = self._paths_of(level, len(given)), np.flatnonzero(status == InverseStatus.REACHED)
        if self.region is not None:
            begin = self.region.near(p[sound], R[sound])[0]
            inside = np.isfinite(begin).all(axis=1)
            status[sound[~inside]] = InverseStatus.OUTSIDE
            for i, q in zip(sound[inside], begin[inside], strict=True):
                last[i], status[i] = paths[i].go(p[i], R[i], q)
        elif len(set(map(id, paths))) == 1:
            last[sound], status[sound] = paths[0].go_all(p[sound], R[sound], threads)
        else:
            for i in sound:
                last[i], status[i] = paths[i].go(p[i], R[i], self.q0)
        if may_jump(self.strategy):
            for i in np.flatnonzero(np.isfinite(last).all(axis=1)):
                jump = paths[i].jump(p[i], R[i], self.q0, last[i], InverseStatus(int(status[i])))
                status[i] = status[i] if jump is None else InverseStatus.JUMP
        q = last.copy()
        q[status != InverseStatus.REACHED] = np.nan
        return Solutions(q, status, last)

    def nearest(
        self,
        pose: PoseLike,
        q: ArrayLike | None = None,
        *,
        length: float = LENGTH,
        rcond: float = MARGIN,
        limits: bool | None = None,
        step: ArrayLike | None = None,
        level: ArrayLike | None = None,
    ) -> Nearest:
        """The posture of the leaf whose tool pose is nearest to one that may be out of reach.

            min |p - p_d|^2 + length^2 angle^2   over the leaf, with rcond(q) >= rcond, within the joint limits

        A pose that `ik(pose)` reaches within these bounds has its joints, but for rare misses. Towards another the tool
        goes as far as it can: from the start, `ik.nearest(pose)`, a function of the pose alone; or from the last
        answer, `ik.nearest(pose, q)`, for a loop, in which it slides along the edge of what it reaches.

        The answer moves continuously with the pose wherever one place of the edge is nearest. Midway between two that
        are equally near, as in the middle of a hole of the workspace, no function of the pose can be continuous, and
        `ik.nearest(pose)` jumps. From the last answer the tool stays on its side while there is a nearest place; where
        that ceases, it slides along the edge to the next. A hand that comes back from round a hole finds the joints a
        full turn away from those of `ik(pose)`, or on another branch. They go there, in one call without `step`, which
        is a jump. With it they go in small steps, while the tool leaves the hand: the hand at rest has it again after
        the joints' way over the step, at most two times.

        Args:
            pose: (4, 4), or a position (3,) or (2,) with the orientation of the start.
            q: the last answer (n,), or where the joints are, to begin from; by default the start.
            length: what a radian counts in metres [m].
            rcond: how near to singular postures the tool goes, from 0 to 1; see `Nearest`.
            limits: whether to keep to the joint limits; by default as `ik` was told.
            step: how far each joint may move in this call, a number or (n,) [joint units]: its speed limit times the
                period of the loop. Only with q.
            level: c (r,), or one number for all rows; by default that of the start. The search then begins at the
                posture of that level with the tool pose of the start, to which the arm goes by self-motion. With q and
                `step` the level may change from call to call, as an operator's elbow does.

        Returns:
            Nearest: joints, the tool's pose, a status, what is missing. With q, a pose that is not finite, or whose
            rotation is none, gives its status and nothing else: q stays as it was given, so that the robot rests.

        Raises:
            ShapeError: what is no pose. ArgumentError: numbers that are not positive; a start beyond the edge itself; a
                step without q; a level beside a region. JointLimitError: with limits, the start is beyond them.
            SingularityError, BranchError: at the tool pose of the start the level is not reached. NotFiniteError: q.
            NotFiniteError, ArgumentError: only without q: a bad pose, as of `ik(pose)`.
        """
        # The pose, where to begin, and how far to go.
        given = self._given_poses.shaped("a tool pose", pose_numbers("a tool pose", pose)[None])[0]
        if self.strategy.task.frames > 1:
            raise ArgumentError("the frames of the task", self.strategy.task.frames, "the nearest pose is asked of one")
        begin, (p, R) = None, self._given_poses.places(given[None])
        if q is None:
            self._given_poses.one(given)
        else:
            begin = np.ascontiguousarray(self.strategy.task.robot.checked(q, "the posture to begin from"))
        if step is not None and q is None:
            raise ArgumentError("q", None, "step limits the motion from the last answer: give that as q, or no step")
        most = None if step is None else steps_of("step", step, len(self.q0))
        check("limits", bool | None, limits)
        asked = self.limits if limits is None else bool(limits)
        if positive("rcond", rcond) > 1:
            raise ArgumentError("rcond", rcond, "give a number from 0 to 1")
        edge, goal = self._edge(level, positive("length", length), float(rcond), asked), (p[0], R[0])
        return nearest(edge, goal, lambda: InverseStatus(int(self._given_poses.refused(p, R)[0])), begin, most)

    @property
    def sentence(self) -> str:
        """What it answers for, and in which region it is proven to be one function of the pose."""
        limits = "postures beyond the joint limits are refused" if self.limits else "joint limits are not looked at"
        sentence = f"inverse kinematics of {self.strategy.name} of {self.strategy.task.robot.name} through q0; {limits}"
        if self.region is None:
            cure = "hk.unique_region(strategy, q0) proves one, hk.cusps(ik) looks for loops that do not return"
            return f"{sentence}; no region was asked for where the joints are one function of the pose: {cure}"
        return f"{sentence}; its region: {self.region}"

    def __str__(self) -> str:
        return self.sentence

    @property
    def engine(self) -> str:
        """One line that says what runs. It is built, or loaded, if it is not yet there: ask before a loop begins.

        `nearest` has native code of its own, which its first call builds or loads: call it once before a loop begins.
        """
        _ = self._cold_call, self._path_calls, self._paths.nowhere
        return engine() if self._paths.kernel is not None else "CasADi's virtual machine"

    def _cold(self, pose: PoseLike) -> Vector:
        """`ik(pose)` of any pose: the joints, or an error."""
        if self.region is None and self._paths.closed is None and self._paths.nowhere(pose):
            raise self._paths.out_of_reach(np.asarray(pose)[:3, 3])
        return self._cold_at(*self._given_poses.one(pose), self._paths)

    def _cold_at(self, p: Vector, R: Matrix, paths: PosePaths) -> Vector:
        """The same of a position and a rotation."""
        return paths.reach(p, R, self.q0 if self.region is None else self._inside(p, R)[0], search=True)

    def _warm(self, pose: PoseLike, q: ArrayLike, paths: PosePaths | None = None) -> Vector:
        """`ik.near(pose, q)` of any pose, on any leaf."""
        p, R = self._given_poses.one(pose)
        begin = self.strategy.task.robot.checked(q, "the posture to begin from")
        of_region = None if self.region is None else self._inside(p, R)
        posture = (paths or self._paths).reach(p, R, begin)
        if of_region is not None and not np.linalg.norm(posture - of_region[0]) <= of_region[1]:
            fact = "from this posture the pose is reached with other joints than those of ik(pose)"
            raise BranchError(fact, "go back by the path that was come, or stop and move the joints to ik(pose)")
        return posture

    def _edge(self, level: ArrayLike | None, *more: Any) -> Edge:
        """The edge of the leaf of the start; or of another level, of which the last one is kept."""
        if level is None:
            return _edge_of(self.strategy, tuple(self.q0.tolist()), *more)
        paths = self._at_level(level)
        if not self._last_edge or self._last_edge[0] != (paths, more):
            q0 = paths.reach(*self._place, self.q0)
            self._last_edge[:] = (paths, more), _edge_at(self.strategy, q0, *more)
        return self._last_edge[1]

    def _paths_of(self, level: ArrayLike | None, count: int) -> list[PosePaths]:
        """Those of each of many poses, the same for all or not."""
        if level is None:
            return [self._paths] * count
        given = np.asarray(level)
        rows = given if given.ndim == 2 and len(given) == count else [level] * min(count, 1)
        paths = [self._at_level(row) for row in rows]
        return paths if len(paths) == count else paths * count

    def _inside(self, p: Vector, R: Matrix) -> tuple[Vector, float]:
        """(a posture near that of the region's function at a pose, how far about it there is none but that)."""
        near, alone = self.region.near(p[None], R[None])  # type: ignore[union-attr]
        if not np.isfinite(near).all():
            raise OutOfReachError(
                f"the pose at {posture_text(p)} m does not belong to the region",
                "give a pose in it, ask for a larger region, or none",
                position=p,
            )
        return near[0], float(alone[0])

    @cached_property
    def _given_poses(self) -> GivenPoses:
        return GivenPoses(self.strategy.task, *self._place)

    @cached_property
    def _cold_call(self) -> Callable[[PoseLike], Vector]:
        """What serves `ik(pose)`."""
        return self._closed_call(self._cold) or self._path_calls[0]

    @cached_property
    def _path_calls(self) -> tuple[Callable[[PoseLike], Vector], Callable[[PoseLike, ArrayLike], Vector]]:
        """What serves `ik(pose)` and `ik.near(pose, q)` by paths."""
        return self._natively(self._cold, self._warm, self.region is None)

    def _closed_call(self, other: Callable[[PoseLike], Any]) -> Callable[[PoseLike], Any] | None:
        """What answers by the closed form, for which no native code is built, and asks `other` where that is not
        enough; None where there is no closed form."""
        branch, other = self._paths.closed, weak(other)
        if branch is None or not branch.single or self.region is not None:
            return None

        def call(pose: PoseLike) -> Any:
            if type(pose) is np.ndarray and pose.shape == (4, 4):
                q = branch.one(pose)
                if q is not None:
                    return q
            return other(pose)

        return call

    def _silent(self, pose: PoseLike, q: Vector | None = None) -> Vector | None:
        """`ik.near(pose, q)`, or without q `ik(pose)`; None where there is none."""
        (p, R), begin = self._given_poses.one(pose), self.q0 if q is None else q
        posture, status = self._paths.go(p, R, begin)
        reached = status is InverseStatus.REACHED and self._paths.jump(p, R, begin, posture, status) is None
        return posture if reached else None

    @cached_property
    def _quiet_call(self) -> Callable[[PoseLike], Vector | None]:
        """What serves `answer` from the start."""
        return self._closed_call(self._silent) or self._quiet_paths[0]

    @cached_property
    def _quiet_paths(self) -> tuple[Callable[[PoseLike], Vector | None], Callable[[PoseLike, Vector], Vector | None]]:
        """What serves `answer` by paths."""
        return self._natively(self._silent, self._silent)

    def _natively(self, cold: Callable[..., Any], warm: Callable[..., Any], native: bool = True) -> tuple[Any, Any]:
        """Two calls by native code, where there is any: `cold` and `warm` serve what it does not answer."""
        cold, warm = weak(cold), weak(warm)
        kernel = None if may_jump(self.strategy) or not native else self._paths.kernel
        bound = None if kernel is None else kernel.calls(self._paths.context, cold, warm)
        return (cold, warm) if bound is None else bound

    @cached_property
    def _place(self) -> tuple[Vector, Matrix]:
        p, R = self.strategy.task._place(self.q0)
        return frozen(p), frozen(R)

    @cached_property
    def _paths(self) -> PosePaths:
        return PosePaths(self.strategy, self.q0, frozen(leaf_value(self.strategy, self.q0)), self.limits)

    def _at_level(self, level: ArrayLike) -> PosePaths:
        """The paths that lead to another level. Raises: ArgumentError, ShapeError, NotFiniteError: a bad one."""
        if self.region is not None:
            raise ArgumentError("level", level, "a region is of one level: ask hk.ik(strategy, q0) without it")
        goal = level_towards(self.strategy, self.q0, level)
        last = self._last_level[:]
        if not last or not np.array_equal(last[0].level, goal):
            self._last_level[:] = last = [self._paths.at(goal)]
        return last[0]

    @cached_property
    def _last_edge(self) -> list[Any]:
        """The paths to the level that `nearest` was asked for last, with its numbers; and the edge of that leaf."""
        return []

    @cached_property
    def _last_level(self) -> list[PosePaths]:
        """The paths to the level that was asked for last."""
        return []


@typed
def ik(strategy: Strategy, q0: ArrayLike, limits: bool = True, *, region: PoseSet | None = None) -> InverseKinematics:
    """Inverse kinematics q(x) of a strategy with leaves, on the one through `q0`.

    With `radial(G, start)` this is the straight-line transport of G from `q0`, free of drift by construction:
    theory 5.3's inverse-kinematics form. Where nothing is redundant, n = m, any strategy will do, as
    `moore_penrose(task)`: the pose tells the joints, on the branch of the start.

    Args:
        limits: False answers beyond the joint limits, too; by default such postures are refused.
        region: of `unique_region(strategy, q0)`: poses outside are refused, with the status OUTSIDE.

    Raises:
        ArgumentError: a strategy without leaves; a region of another strategy or leaf.
        SingularityError: it is singular at the start. JointLimitError: with limits, the start is beyond them.
    """
    strategy = with_leaves(strategy)
    q0 = start_posture(strategy.task.robot, q0, limits)
    strategy(q0)
    if region is not None:
        p, R = strategy.task._place(q0)
        near, alone = region.near(p[None], R[None])
        if region.strategy != strategy or not np.linalg.norm(near[0] - q0) <= alone[0]:
            cure = "give one of the same strategy whose function holds q0: hk.unique_region(strategy, q0)"
            raise ArgumentError("the region", str(region), cure)
    return InverseKinematics(strategy, q0, limits, region)


# --- Inverse kinematics asked without a word: where it has no answer nothing is raised, and no reason is searched for.


def how_far(ik: InverseKinematics, pose: PoseLike, q: ArrayLike) -> tuple[Vector, InverseStatus]:
    """How far `ik.near(pose, q)` gets: (the posture (n,) to which its path was gone, what became of the pose).

    Raises:
        ShapeError, NotFiniteError, ArgumentError: a bad pose or posture.
    """
    p, R = ik._given_poses.one(pose)
    return ik._paths.go(p, R, ik.strategy.task.robot.checked(q, "the posture to begin from"))


def level_margins(ik: InverseKinematics) -> Callable[[Array, Vector], Vector] | None:
    """(poses (k, 4, 4), levels (k,) of one held joint) -> how far the postures are from ceasing to serve, as
    `ClosedBranch.margins`; None where no closed form gives the postures of all poses."""
    branch, held = ik._paths.closed, held_joints(ik.strategy)
    if branch is None or not branch.single or isinstance(held, str) or held.follows is not None:
        return None
    return lambda poses, levels: branch.margins(poses, held.at(levels[:, None], 0.0))


def ends_of_paths(ik: InverseKinematics, poses: Array) -> tuple[Matrix, Indices]:
    """`last` and `status` of `ik.batch(poses)`; where a closed form found no posture `last` is where a path ends."""
    found = ik.batch(poses)
    last = found.last.copy()
    untold = (found.status == InverseStatus.LEAF_ENDS) & np.isnan(last).any(axis=1)
    if untold.any():
        last[untold] = ik._paths.go_paths(*ik._given_poses.places(poses[untold]), None, shown=True)[0]
    return last, found.status


def leads_to(ik: InverseKinematics, pose: PoseLike, begin: ArrayLike, q: ArrayLike) -> bool:
    """Whether the leaf, followed straight from one posture (n,) to a tool pose, comes to the posture q (n,) there."""
    try:
        return bool(np.abs(ik.near(pose, begin) - np.asarray(q)).max() < AGREE)
    except HolokinError:
        return False


def answer(ik: InverseKinematics, pose: PoseLike, begin: Vector | None = None) -> Vector | None:
    """`ik(pose)`, or with a posture to begin from (n,) `ik.near(pose, begin)`; None where it has no answer: nothing is
    searched for that would say why. No region is looked at. Raises: a bad pose."""
    return ik._quiet_call(pose) if begin is None else ik._quiet_paths[1](pose, begin)


def answers(ik: InverseKinematics, poses: Array, begin: Matrix, threads: int | None = None) -> tuple[Matrix, Flags]:
    """(postures (k, n), which are reached (k,)): of tool poses (k, 4, 4), each as `ik.near(pose, begin)` from its
    posture (k, n). No region is looked at."""
    p, R = ik._given_poses.places(poses)
    q, reached = ik._paths.go_each(p, R, begin, threads)
    if may_jump(ik.strategy):
        for i in np.flatnonzero(reached):
            reached[i] = ik._paths.jump(p[i], R[i], begin[i], q[i], InverseStatus.REACHED) is None
    return q, reached


def has_one_posture(ik: InverseKinematics) -> bool:
    """Whether the signs of a closed form tell the posture of a pose, so that no path from q0 is asked."""
    branch = ik._paths.closed
    return branch is not None and branch.single


def is_native(ik: InverseKinematics) -> bool:
    """Whether native code answers, which is built if it is not yet there."""
    return ik._paths.kernel is not None
