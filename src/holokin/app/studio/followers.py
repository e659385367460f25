"""How a strategy of a session follows: dragged, or round a loop; and what is known of it now."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, HolokinError, JointLimitError
from ...base.poses import PoseLike, given_pose, pose_from, pose_numbers
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Matrix, Value, Vector, finite, frozen, positive, tool_pose
from ...motion import StepStatus, approach, controller
from ...motion.control import ControlLaw
from ...motion.follow_path import Stepper, build_native, by_leaf, stepper
from ...motion.ik import InverseStatus, ik, move_to_leaf
from ...motion.ik.inverse_function import how_far, is_native
from ...motion.ik.leaf import PathEnd, leaf_value, leaf_walk, straight_path
from ...motion.ik.plan import Plan, check_start, make_plan
from ...motion.simulation import control_step
from ...path import Path, arc, figure_eight, polyline
from ...path.editing import AnyPath, synchronized
from ...path.path import StraightPath, straight
from ...robot import start_posture
from ...strategies import HolonomicStrategy, SelfMotionCurve, Strategy, moore_penrose
from ...strategies.tasks.frame_task import completed
from ...strategies.tasks.task import Task
from .states import History, Judgement, StrategyState, StrategyStatus
from .strategies import NamedStrategy, Slider

# --- The loop that all strategies of a session run round: a path, and the [path] table of a job that says it.

SAMPLES = 500  # steps a cycle, as of `hk.drift`
SPEED = 0.1  # of the tool [m/s]


@dataclass(frozen=True, eq=False)
class Loop(Value):
    """A path of the tool in the base frame, and how a job says it.

    Make one with `circle_loop`, `polygon_loop`, `eight_loop`; those of jobs come with their session.

    Attributes:
        kind: as of [path] in a job. path: what is run round. samples: steps a cycle.
        keys: the table [path] without samples and cycles. clockwise: whether it runs the other way round than drawn.
    """

    kind: str
    path: AnyPath
    keys: Mapping[str, Any]
    samples: int = SAMPLES
    clockwise: bool = False

    def points(self, count: int = 200) -> Matrix:
        """Points (F, count, 3) of the curves of the F frames, to draw them."""
        positions = self.path.at(np.linspace(0.0, self.path.duration, count)).position
        return np.ascontiguousarray(positions.reshape(count, -1, 3).swapaxes(0, 1))


def circle_loop(
    center: ArrayLike, radius: float, normal: ArrayLike = (0.0, 0.0, 1.0), *, near: ArrayLike | None = None,
    clockwise: bool = False, speed: float = SPEED, samples: int = SAMPLES,
) -> Loop:  # fmt: skip
    """A circle about a center (3,) [m]; it begins at its point nearest to `near` (3,), such as the tool's place.

    Raises:
        ArgumentError: no radius or no normal.
    """
    c, n, r = finite("center", center, (3,)), _unit(normal), positive("radius", radius)
    towards = np.zeros(3) if near is None else finite("near", near, (3,)) - c
    flat = towards - (towards @ n) * n
    if np.linalg.norm(flat) < 1e-9 * max(1.0, r):
        flat = np.cross(n, [0.0, 1.0, 0.0] if abs(n[1]) < 0.9 else [1.0, 0.0, 0.0])
    start = c + r * flat / np.linalg.norm(flat)
    path = arc(start, c, -2 * np.pi if clockwise else 2 * np.pi, n, speed=positive("speed", speed))
    keys = {"kind": "circle", "center": c.tolist(), "normal": n.tolist(), "clockwise": clockwise, "speed": float(speed)}
    return Loop("circle", path, keys | {"at": start.tolist()}, samples, clockwise)


def polygon_loop(points: ArrayLike, *, speed: float = SPEED, samples: int = SAMPLES) -> Loop:
    """A closed polyline through points (k, 3), such as those of clicks; it begins at the first one.

    Raises:
        ArgumentError, ShapeError: fewer than three points, or points that repeat.
    """
    given = finite("the points of a polygon", points, ("k", 3), "give points in space")
    if len(given) < 3:
        raise ArgumentError("the number of points of a polygon", len(given), "give at least three")
    path = polyline(given, closed=True, speed=positive("speed", speed))
    keys = {"kind": "polyline", "points": given.tolist(), "closed": True, "speed": float(speed)}
    return Loop("polyline", path, keys, samples)


def eight_loop(
    crossing: ArrayLike, width: float, height: float | None = None, normal: ArrayLike = (0.0, 0.0, 1.0), *,
    along: ArrayLike | None = None, speed: float = SPEED, samples: int = SAMPLES,
) -> Loop:  # fmt: skip
    """A figure eight that begins where it crosses itself, as `hk.path.figure_eight`."""
    start, n = finite("crossing", crossing, (3,)), _unit(normal)
    flat = np.array([1.0, 0.0, 0.0] if abs(n[0]) < 0.9 else [0.0, 1.0, 0.0]) if along is None else _unit(along)
    flat = flat - (flat @ n) * n
    wide = flat / np.linalg.norm(flat)
    path = figure_eight(start, width, height, n, along=wide, speed=speed)
    keys: dict[str, Any] = {"kind": "figure-eight", "at": start.tolist(), "width": float(width)}
    keys |= {"normal": n.tolist(), "along": wide.tolist(), "speed": float(speed)}
    keys |= {} if height is None else {"height": float(height)}
    return Loop("figure-eight", path, keys, samples)


def reversed_loop(loop: Loop) -> Loop:
    """The same curve the other way round, begun at the same place.

    Raises:
        ArgumentError: a job's path of another kind, which no job file says the other way round.
    """
    first, *others = (_reversed(loop.kind, keys) for keys in (loop.keys, *(loop.keys.get("others") or ())))
    keys = {**first, "others": others} if others else first
    return Loop(loop.kind, loop.path.reversed(), keys, loop.samples, not loop.clockwise)


def _reversed(kind: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """[path] of one tool the other way round. Raises: ArgumentError: as `reversed_loop`."""
    keys, kind = dict(given), given.get("kind", kind)
    if kind in ("circle", "spiral"):
        keys["clockwise"] = not keys.get("clockwise", False)
    elif kind == "polyline" and keys.get("closed") and not {"turns_deg", "blend"} & keys.keys():
        keys["points"] = [keys["points"][0], *keys["points"][:0:-1]]
    elif kind == "figure-eight" and keys.get("along"):
        keys["along"] = [-v for v in keys["along"]]
    else:
        cure = "it has one direction only: circles, polygons and figure eights have two"
        raise ArgumentError("the way round of the path", kind, cure)
    return keys


def _unit(direction: ArrayLike) -> Vector:
    """A direction (3,) of length 1. Raises: ArgumentError: it is zero."""
    vector = finite("direction", direction, (3,))
    size = float(np.linalg.norm(vector))
    if not size > 0:
        raise ArgumentError("direction", vector.tolist(), "it may not vanish")
    return vector / size


def _shifted(keys: Mapping[str, Any], by: Vector) -> dict[str, Any]:
    """[path] of the curve moved by a vector (3,) [m]."""
    moved = dict(keys)
    for key in ("center", "at", "points"):
        if moved.get(key) is not None:
            moved[key] = (np.asarray(moved[key], dtype=float) + by).tolist()
    return moved


def entered(loop: Loop, task: Task, home: Vector) -> Loop:
    """The loop as strategies begin it at a posture (n,): with the entry of a job where it begins away from the tool.

    A task of several tools has no entry: the curve begins where each of them is.
    """
    if task.frames > 1 and isinstance(loop.path, Path):
        # The same curve for several tools at once, each from its own place (F, 3) [m], as hands that carry a tray do.
        places = task.pose(home).reshape(-1, 4, 4)[:, :3, 3]
        first = loop.points(2)[0, 0]
        tables = [_shifted(loop.keys, place - first) for place in places]
        paths = [loop.path.starting_at(place) for place in places]  # type: ignore[union-attr]  of one tool, so a Path
        return replace(loop, path=synchronized(*paths), keys={**tables[0], "others": tables[1:]})
    if task.frames > 1 or not isinstance(loop.path, Path):
        return loop
    R = task.pose(home)[:3, :3] if loop.path.rotation is None else loop.path.rotation
    away = bool(np.abs(task.error(home, loop.path.start, R)).max() > TOLERANCES.start)
    if away == (loop.keys.get("entry") is not None):
        return loop
    return replace(loop, keys={**loop.keys, "entry": "joints" if away else None})


# --- One strategy after a dragged tool: from a posture to the joints of a tool pose, or where it stays and why.

# step of a strategy that follows by velocity [s]: no joint goes farther in a step than at its full speed in this
# time
PERIOD = 0.1
# longest step of the target [m], [rad]: a Panda's joints then move by 0.02 rad, and errors stay below 1e-4
LONG, TURN = 0.01, 0.05
CORRECTIONS = 12  # steps at the end of the way that take the tool to its target: Newton's method needs three
MOST = 400  # steps of one way at most: four metres
PIECES = 60  # pieces of one path along a leaf where there is no native code: 0.1 s of a Panda's joint locked, at most
# smallest over largest singular value of J, in m and rad as they come, below which an arm that stops is stretched or
# folded, and its strategy no reason: on ways out of a Panda's workspace it was at most 0.02, where it is ready it is
# 0.1
STRETCHED = 0.03
EXACT = 1e-9  # error [m or rad] at which a tool is at its target
DOUBTFUL = 1e-4  # the same of a control law, which may have no feedback


@dataclass(frozen=True, eq=False)
class Move(Value):
    """Where a strategy stands after a target: joints (n,), its status, and a sentence where it does not follow."""

    q: Vector
    status: StrategyStatus
    sentence: str = ""


# (posture, poses (F, 4, 4), whether to wait for the compiler) -> the move to them
Follower = Callable[[Vector, Array, bool], Move]


def poses_of(task: Task, pose: PoseLike) -> Array:
    """(F, 4, 4) of a pose (4, 4), or of one for each of the F frames of a task.

    Raises:
        ShapeError, NotFiniteError, ArgumentError: what is no pose.
    """
    given = pose_numbers("a tool pose", pose)
    shaped = given[None] if task.frames == 1 and given.ndim == 2 else given
    poses = given_pose("a tool pose", shaped, (task.frames, 4, 4))
    for tool in poses:
        tool_pose("a tool pose", tool)
    return poses


def follower(strategy: NamedStrategy, q0: Vector, limits: bool) -> Follower:
    """What takes a strategy from a posture to a tool pose; a holonomic one on the leaf through `q0` (n,).

    Raises:
        HolokinError: the strategy is not defined there.
    """
    if isinstance(strategy.rule, HolonomicStrategy):
        return _by_leaf(strategy.rule, q0, limits)
    if isinstance(strategy.rule, Strategy):
        return _by_velocity(strategy.rule, limits)
    return _by_steps(strategy.rule, strategy.task, limits)


def _by_leaf(strategy: HolonomicStrategy, q0: Vector, limits: bool) -> Follower:
    """In a region round the start the same pose has the same joints, whatever the path of the tool."""
    solver, task = ik(strategy, q0, limits), strategy.task
    level = leaf_value(strategy, q0)

    def follow(q: Vector, poses: Array, wait: bool) -> Move:
        # By the compiled solver; without a compiler, or until it is done, along the straight path in pieces.
        pose = poses[0] if task.frames == 1 else poses
        if wait and is_native(solver):
            try:
                last, status = solver.near(pose, q), InverseStatus.REACHED
            except HolokinError:
                last, status = how_far(solver, pose, q)
        else:
            walk, begin = leaf_walk(strategy, q, PIECES), leaf_value(strategy, q)
            levels = begin, begin + strategy.constraint.nearest(level - begin)
            last, ended = walk(q, straight_path(task, task._place(q), task.target(poses), levels))
            status = InverseStatus.REACHED if ended is PathEnd.REACHED else InverseStatus.LEAF_ENDS
        # What became of it.
        if status is InverseStatus.LIMIT or (limits and status is InverseStatus.REACHED and _beyond(task, last)):
            return Move(q, StrategyStatus.LIMIT, _limit_sentence(task, last))
        if status is InverseStatus.REACHED:
            return Move(last, StrategyStatus.FOLLOWING)
        return Move(q, *stopped(task, strategy.name, last))

    return follow


def _beyond(task: Task, q: Vector) -> bool:
    """Whether a posture (n,) is beyond the joint limits."""
    return bool((task.robot.beyond(q) > TOLERANCES.limit).any())


def _by_velocity(strategy: Strategy, limits: bool) -> Follower:
    """Small steps along the straight path, each slowed where a joint would be too fast, then Newton's method."""
    task = strategy.task
    control = controller(strategy, dt=PERIOD, gain=1 / PERIOD, limits=limits)
    still = np.zeros(6) if task.frames == 1 else np.zeros((task.frames, 6))
    error = task._error_function

    def follow(q: Vector, poses: Array, _wait: bool) -> Move:
        path, steps = _straight_way(task, q, poses)
        postures, status = [q], StepStatus.OK
        for k in range(1, steps + CORRECTIONS + 1):
            target = path.at(k / steps) if k < steps else task.target(poses)
            postures.append(postures[-1] + PERIOD * control.step(postures[-1], _pose(task, target), still))
            status = control.status
            if status >= StepStatus.LIMIT:
                break
            if k >= steps and np.abs(error(postures[-1], *target)).max() < EXACT:
                return Move(postures[-1], StrategyStatus.FOLLOWING)
        if status is StepStatus.LIMIT:
            return Move(q, StrategyStatus.LIMIT, _limit_sentence(task, postures[-1]))
        return Move(q, *stopped(task, strategy.name, *postures))

    return follow


def _by_steps(rule: ControlLaw, task: Task, limits: bool) -> Follower:
    """A control law along the straight path, as `simulate` runs it."""

    def follow(q: Vector, poses: Array, _wait: bool) -> Move:
        # Along the path at an even speed; then the tool rests at its target.
        path, steps = _straight_way(task, q, poses)
        F, posture = task.frames, q
        twist = np.hstack([path.move.reshape(F, 3), path.turn.reshape(F, 3)]) / (steps * PERIOD)
        try:
            step = rule.begin(q.copy())
            for k in range(1, steps + CORRECTIONS + 1):
                target = _pose(task, path.at(min(1.0, k / steps)))
                twists = twist if k <= steps else np.zeros((F, 6))
                dq = step(posture.copy(), target, twists[0] if F == 1 else twists, PERIOD)
                posture = posture + PERIOD * np.asarray(dq)
        except HolokinError as problem:
            return Move(q, StrategyStatus.STOPPED, str(problem))
        except Exception as problem:  # noqa: BLE001  a control law of somebody's own may throw anything
            fact = f"{rule.name} threw {type(problem).__name__}: {problem}; correct it"
            return Move(q, StrategyStatus.STOPPED, fact)
        # What became of it.
        if posture.shape != q.shape or not np.isfinite(posture).all():
            return Move(q, StrategyStatus.STOPPED, f"{rule.name} returned no {len(q)} finite joint rates; correct it")
        if limits and _beyond(task, posture):
            return Move(q, StrategyStatus.LIMIT, _limit_sentence(task, posture))
        if float(np.abs(task._error_function(posture, *task.target(poses))).max()) < DOUBTFUL:
            return Move(posture, StrategyStatus.FOLLOWING)
        return Move(q, *stopped(task, rule.name, posture))

    return follow


def _straight_way(task: Task, q: Vector, poses: Array) -> tuple[StraightPath, int]:
    """The straight path of the tools from a posture to poses, and its number of steps."""
    place = task._place(q)
    path = straight(*place, *completed(task, task.target(poses), place))
    far = float(np.linalg.norm(path.move.reshape(-1, 3), axis=1).max())
    turned = float(np.linalg.norm(path.turn.reshape(-1, 3), axis=1).max())
    return path, int(np.clip(np.ceil(max(far / LONG, turned / TURN)), 1, MOST))


def _pose(task: Task, target: tuple[Vector, Array]) -> Array:
    """(4, 4), or (F, 4, 4), of positions (3F,) and rotations (3F, 3)."""
    poses = pose_from(target[0].reshape(-1, 3), target[1].reshape(-1, 3, 3))
    return poses[0] if task.frames == 1 else poses


def stopped(task: Task, name: str, *postures: Vector) -> tuple[StrategyStatus, str]:
    """Why a strategy got no farther: on its way (k, n) the arm is stretched, or the strategy alone is singular."""
    J, margin = task.jacobian_batch(np.array(postures))
    if margin.min() < 2 * TOLERANCES.representation:
        cure = "turn the tool less, or choose a task with another orientation"
        return StrategyStatus.SINGULAR, f"The angles of the {task.name} are singular on the way; {cure}."
    s = np.linalg.svd(J[np.isfinite(J).all(axis=(1, 2))], compute_uv=False)
    if (s[:, -1] / s[:, 0]).min(initial=1.0) < STRETCHED:
        fact = "The arm is stretched or folded, and reaches no farther this way"
        return StrategyStatus.OUT_OF_REACH, f"{fact}; drag it back."
    cure = "drag it back, or choose another strategy or leaf"
    return StrategyStatus.SINGULAR, f"{name} is singular on the way, the arm itself is not; {cure}."


def _limit_sentence(task: Task, q: Vector) -> str:
    """Which joint is at or beyond its limit at a posture (n,), with the cure."""
    robot = task.robot
    i = int(np.argmax(robot.beyond(q)))
    bound = robot.lower[i] if robot.lower[i] - q[i] >= q[i] - robot.upper[i] else robot.upper[i]
    fact = f"{robot.joint_names[i]} would pass its limit of {bound:.4g} {robot.coordinates[i].unit}"
    return f"{fact}; drag it back, or choose another strategy."


# --- One strategy round the loop of a session: the steps of `hk.follow`, as many at a time as a picture asks for.

# pieces of one step in Python. A step takes one or two; where a leaf ends, native code has tried them all before
LOOP_PIECES = 200
LOOK = 60  # steps of a cycle with which it is tried whether a strategy gets round a loop: 30 ms in Python


@dataclass(frozen=True, eq=False)
class Walk:
    """A strategy on its way round a loop: its plan, and what makes its steps."""

    strategy: NamedStrategy
    plan: Plan
    limits: bool
    stepper: Stepper

    def run(self, q: Vector, first: int, last: int) -> tuple[Matrix, tuple[StrategyStatus, str]]:
        """Steps [first, last) of a cycle from a posture: the postures (k, n) after each, fewer where it stops; why."""
        rows, strategy = np.empty((last - first, len(q))), self.strategy
        native = self.stepper.native
        done = native.run(q, first, last, rows) if native is not None else 0
        posture = rows[done - 1] if done else q
        try:  # what native code refuses is tried in Python, which says why
            for i in range(first + done, last):
                posture = self.stepper.step(posture, i)
                if self.limits:
                    strategy.task.robot.check_limits(posture)
                rows[done] = posture
                done += 1
        except JointLimitError:
            return rows[:done], (StrategyStatus.LIMIT, _limit_sentence(strategy.task, posture))
        except HolokinError as problem:
            if strategy.G is None:
                return rows[:done], (StrategyStatus.STOPPED, str(problem))
            return rows[:done], stopped(strategy.task, strategy.name, rows[done - 1] if done else q)
        return rows, (StrategyStatus.FOLLOWING, "")


def leaf_start(strategy: NamedStrategy, home: Vector) -> Vector:
    """The posture (n,) with the tool of `home`, on the leaf that a strategy asks for; `home` where it asks for none.

    Raises:
        SingularityError, BranchError: the self-motion does not lead there.
    """
    if strategy.level is None or not isinstance(strategy.rule, HolonomicStrategy):
        return home
    return move_to_leaf(strategy.rule, home, strategy.level, limits=False)


def loop_start(strategy: NamedStrategy, loop: Loop, home: Vector) -> Vector:
    """The posture (n,) at which a strategy begins a loop: on its leaf, led to the loop's start as by a job's entry.

    Raises:
        HolokinError: the strategy does not lead there.
    """
    begin = leaf_start(strategy, home)
    if not isinstance(loop.path, Path) or loop.keys.get("entry") is None:
        return begin
    leading = strategy.G or moore_penrose(strategy.task)
    return approach(leading, loop.path, begin, by=loop.keys["entry"]).q[-1]


def walk(strategy: NamedStrategy, loop: Loop, q0: Vector, limits: bool, *, build: bool = False) -> Walk:
    """A strategy that begins a loop at a posture (n,) with the tool at its start.

    Args:
        build: compile native steps if there are none yet, which takes a second; else they are made in Python.

    Raises:
        HolokinError: the tool is elsewhere, the strategy is not defined there, or the posture is beyond the limits.
    """
    task = strategy.task
    start_posture(task.robot, q0, limits)
    if strategy.G is not None:
        strategy.G(q0)
    plan = make_plan(task, loop.path, loop.samples, task._place(q0)[1])
    check_start(task, q0, *plan.first)
    if isinstance(strategy.rule, Strategy):
        leaf = by_leaf(strategy.rule)
        return Walk(
            strategy, plan, limits, stepper(strategy.rule, leaf, plan, q0, limits, LOOP_PIECES, load=True, build=build)
        )
    rates = control_step(strategy.rule, plan, q0)
    return Walk(strategy, plan, limits, Stepper(lambda q, i: q + plan.h[i] * np.asarray(rates(q, i), dtype=float)))


def poses_at(plan: Plan, step: int) -> Array:
    """Where the tools are wanted after some steps of a cycle (F, 4, 4)."""
    p, R = plan.first if step == 0 else plan.target(step - 1, 1.0)
    return pose_from(p.reshape(-1, 3), R.reshape(-1, 3, 3))


def compiled(strategy: NamedStrategy, q0: Vector) -> None:
    """Build, or load, the native code with which a strategy follows; without a compiler nothing happens."""
    try:
        if isinstance(strategy.rule, HolonomicStrategy):
            _ = ik(strategy.rule, q0, limits=False).engine
        if strategy.G is not None:
            build_native(strategy.G)
    except HolokinError:  # told when the strategy is asked to follow
        return


def loop_fault(strategy: NamedStrategy, loop: Loop, home: Vector, limits: bool) -> str:
    """Why a strategy does not get round a loop that begins at a posture (n,), and where; empty where it does.

    A few coarse steps; of control laws, which have memory, nothing is known.
    """
    if strategy.G is None:
        return ""
    try:
        begin = loop_start(strategy, loop, home)
        walked = walk(strategy, replace(loop, samples=LOOK), begin, limits)
    except HolokinError as problem:
        return f"{strategy.name} cannot begin this loop: {problem}."
    steps = len(walked.plan.h)
    rows, (status, sentence) = walked.run(begin, 0, steps)
    if status is StrategyStatus.FOLLOWING:
        return ""
    return f"{strategy.name} gets round {100 * len(rows) / steps:.0f} % of this loop only. {sentence}"


MOVED = 0.02  # joint motion [joint units] from which the curvature at a posture is asked for again


@dataclass(eq=False)
class Run:
    """One strategy of a session: where it stands, what moves it, and what was recorded. Only its session changes it."""

    strategy: NamedStrategy
    q: Vector
    follow: Follower
    level: Vector
    history: History
    drifts: Matrix  # (cycles, n)
    status: StrategyStatus = StrategyStatus.FOLLOWING
    sentence: str = ""
    q0: Vector | None = None  # of the loop
    walk: Walk | None = None
    complete: bool = True  # it has made every step of the loop
    judgement: Judgement | None = None
    curve: tuple[SelfMotionCurve, float] | None = None  # of the slider along it, with the place
    level_slider: Slider | None = None  # across the leaves
    ready: bool = False  # native code was built, or tried
    state: StrategyState | None = None

    @property
    def due(self) -> bool:
        """Whether its judgement is missing, or of a posture that it has left."""
        known = self.judgement
        return self.strategy.G is not None and (known is None or bool(np.abs(self.q - known.q).max() > MOVED))

    def put(self, move: Move) -> None:
        """Where it stands from now on."""
        self.q, self.status, self.sentence = frozen(move.q), move.status, move.sentence
        self.curve, self.level_slider, self.state = None, None, None

    def forget(self) -> None:
        """What was recorded of the loop."""
        self.q0, self.walk, self.complete, self.state = None, None, True, None
        self.history, self.drifts = History(len(self.q)), frozen(np.zeros((0, len(self.q))))


def new_run(strategy: NamedStrategy, q: Vector, limits: bool) -> Run:
    """A strategy that stands at a posture (n,), on the leaf through it. Raises: HolokinError: not defined there."""
    if strategy.G is not None:
        strategy.G(q)
    follow, drifts = follower(strategy, q, limits), frozen(np.zeros((0, len(q))))
    return Run(strategy, frozen(q), follow, strategy.level_at(q), History(len(q)), drifts)


def state_of(run: Run) -> StrategyState:
    """What a page is told of it."""
    if run.state is None:
        strategy, (t, history) = run.strategy, run.history.view()
        run.state = StrategyState(
            name=strategy.name,
            holonomic=strategy.holonomic,
            q=run.q,
            status=run.status,
            sentence=run.sentence,
            rcond=np.nan if strategy.G is None else float(strategy.G.gain(run.q)[1]),
            level=frozen(run.level),
            drift=frozen(np.abs(run.drifts).max(axis=1, initial=0.0)),
            drift_joints=run.drifts,
            t=t,
            history=history,
            judgement=run.judgement,
        )
    return run.state


def put_on_leaf(run: Run, q: Vector, limits: bool) -> None:
    """A strategy at another posture (n,) with its tool pose; a holonomic one on the leaf through it from now on.

    Raises:
        HolokinError: the strategy is not defined there; nothing changes then.
    """
    if run.strategy.holonomic:
        level = run.strategy.level_at(q)
        strategy = replace(run.strategy, level=level)
        run.follow = follower(strategy, q, limits)
        run.strategy, run.level = strategy, level
    run.put(Move(q, run.status, run.sentence))
