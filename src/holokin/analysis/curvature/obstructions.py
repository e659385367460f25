"""`obstruction`: why no repeatable strategy serves all tool poses of a sphere of directions, or a disc with a given
rim."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, OpenPathError, SingularityError
from ...base.poses import pose_from
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, NoTruthValue, Result, Value, Vector, positive, whole
from ...motion.follow_path import follow
from ...motion.ik.leaf import DONE, NEWTONS, leaf_step, leaf_value
from ...motion.self_motions.posture_search import newton, to_poses
from ...path import Path
from ...path.path import straight
from ...strategies import CurveTracer, HolonomicStrategy, Strategy, checked_rate, moore_penrose
from ...strategies.constraints import Arm, find_arm
from ...strategies.self_motion_curves import correction, joint_gap
from ...strategies.tasks.frame_task import completing, leaves_free
from ...strategies.tasks.task import Task, of_one_tool
from ...symbolic import runge_kutta
from .sphere_index import TURN, TangentField, angle_between, poles, spread, turn

# --- How often the redundant joint goes round along a closed path: in turns of the self-motion, against a disc.
#
# Over the disc of straight lines from the path's start to its points a reference section is known: the postures that
# least joint motion leads to along them. At each point of the path the strategy's posture and the reference lie on one
# self-motion. Where that is a closed curve, the strategy is so many turns of it ahead of the reference. Both agree at
# the start, so the turns after the path are a whole number. If it is not 0, no strategy that agrees with this one on
# the path goes on continuously over the disc, as long as the self-motions over it are such curves.

QUARTER = 0.25
"""Turns of the self-motion from one sample to the next: half a turn could be either way."""

STEP = 0.1
"""Arc length between the postures that a self-motion is traced by [joint units]."""


@dataclass(frozen=True, eq=False)
class Turns:
    """How far the strategy is ahead of the reference at the samples (k,) [turns of the self-motion]; why not, if
    not."""

    ahead: Vector
    missing: str = ""

    @property
    def largest(self) -> float:
        """From one sample to the next [turns]."""
        return float(np.abs(np.diff(self.ahead)).max()) if len(self.ahead) > 1 else np.inf


def turns(task: Task, Q: Matrix) -> Turns:
    """Of a strategy's postures (k, n) on a closed path of the tool, which begins at the first.

    Args:
        task: leaves one joint redundant.
    """
    none = np.zeros(0)
    reference, middle = _references(task, Q[0], *task._poses(Q))
    if reference is None or middle is None:
        return Turns(none, "a straight path from its start to one of its points meets a singular posture")
    fibres = self_motions(task, reference)
    if any(fibre is None for fibre in [*fibres, *self_motions(task, middle)]):
        return Turns(none, "a self-motion over the disc of straight paths from its start is no closed curve")
    shares = [_share(task, fibre, q) for fibre, q in zip(fibres, Q, strict=True) if fibre is not None]
    if any(share is None for share in shares):
        missing = "the strategy is on another self-motion than the disc of straight paths from its start"
        return Turns(none, missing)
    return Turns(np.unwrap(np.array(shares, dtype=float), period=1.0))


def _references(task: Task, q0: Vector, p: Matrix, R: Array) -> tuple[Matrix | None, Matrix | None]:
    """The postures (k, n) that least joint motion leads to on straight paths from q0, at their ends and halfway."""
    if leaves_free(task):
        p, R = completing(task).batch(p[0], R[0], p, R)
    lines = straight(p[0], R[0], p, R)
    # In pieces of 5 cm or 0.05 rad at most. Of a step of 0.1 a correction leaves 1e-3, the second 1e-6, the third
    # 1e-12; what wants more than 0.5 joint units is close to a singular posture
    size = float(np.linalg.norm([lines.move, lines.turn], axis=2).max())
    pieces = 2 * int(np.ceil(size / 0.05 / 2)) or 2
    Q, middle = np.tile(q0, (len(p), 1)), None
    for k in range(1, pieces + 1):
        Q, arrived = newton(to_poses(task, *lines.at(k / pieces)), Q, steps=4, exact=1e-6, longest=0.5)
        if not arrived.all():
            return None, middle
        middle = Q if 2 * k == pieces else middle
    return Q, middle


def self_motions(task: Task, Q: Matrix) -> list[Matrix | None]:
    """The self-motions (points, n) through postures (k, n), all at once, each round once; None for those left open.

    One counts as open after 40 joint units; a Panda's closes after 13 or less.
    """
    lines = CurveTracer.through(task, Q).traced(Q, step=STEP, length=40.0, limits=False)
    return [line.q if line.closed else None for line in lines]


def _share(task: Task, fibre: Matrix, q: Vector) -> float | None:
    """At which share of its length, from 0 to 1, a self-motion comes by a posture; None where it does not."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fibre, axis=0), axis=1))])
    gap = joint_gap(task.robot, q, fibre)
    i = min(int(np.argmin(np.linalg.norm(gap, axis=1))), len(fibre) - 2)
    step = fibre[i + 1] - fibre[i]
    along = float(gap[i] @ step / (step @ step))
    if not np.linalg.norm(gap[i] - along * step) < STEP / 2:
        return None
    return float((lengths[i] + along * (lengths[i + 1] - lengths[i])) / lengths[-1])


# --- The direction of the elbow over a sphere of tool places: a field of tangent directions, as a leaf makes it.

ON_LINE = 1e-6
"""Distance [m] of the elbow from the line shoulder-wrist at which it has no direction."""


@dataclass(frozen=True, eq=False)
class ToolSphere:
    """Tool poses that differ by a shift: a point fixed to the tool runs over the sphere about the shoulder (3,).

    That point is where the wrist is at the start, in the `direction` (3,), at the distance `radius` [m].
    `fixed`: whether it is the wrist at all postures, so that shoulder and wrist are given by the pose.
    """

    shoulder: Vector
    direction: Vector
    radius: float
    pose: Matrix
    fixed: bool

    def position(self, u: Vector) -> Vector:
        """The tool's position (3,) in a direction u (3,)."""
        return self.pose[:3, 3] + self.radius * (u - self.direction)

    def pose_at(self, u: Vector) -> Matrix:
        """The tool's pose (4, 4) in a direction u (3,)."""
        return pose_from(self.position(u), self.pose[:3, :3])


def sphere_of(task: Task, q0: Vector, arm: Arm) -> ToolSphere:
    """The sphere of tool poses about the shoulder, through that of q0.

    Raises:
        ArgumentError: the shoulder moves, or the wrist is in it.
    """
    places, still = arm.places(task), 1e-9
    postures = np.random.default_rng(0).uniform(-1.5, 1.5, (4, task.n))
    points, (p, R) = places.batch(postures).reshape(-1, 3, 3), task._poses(postures)
    if np.ptp(points[:, 0], axis=0).max() > still:
        raise ArgumentError("the shoulder", arm.shoulder.place, "name joints=(...) with one that no joint moves")
    wrist = np.einsum("kji,kj->ki", R, points[:, 2] - p)
    S, _, W = places(q0)
    radius = float(np.linalg.norm(W - S))
    if not radius > ON_LINE:
        raise ArgumentError("the distance from shoulder to wrist", radius, "choose another start posture")
    return ToolSphere(S, (W - S) / radius, radius, task.pose(q0), bool(np.ptp(wrist, axis=0).max() <= still))


Correction = Callable[[Vector, Vector], Vector | None]
"""(posture (n,), position of the tool (3,)) -> Newton's correction (n,) towards it; None where it is singular."""


class ElbowField(TangentField):
    """u -> the part of the elbow's place, seen from the shoulder, that is perpendicular to u [m].

    The state is (q, u), the posture (n,) and where it is. It is carried by a strategy, dq = G dx, and corrected.
    """

    def __init__(self, strategy: Strategy, q0: Vector, sphere: ToolSphere, arm: Arm, correction: Correction) -> None:
        self.task, self.sphere, self.correction = strategy.task, sphere, correction
        self.start = q0, sphere.direction
        self._rate, self._places = checked_rate(strategy), arm.places(strategy.task)

    def step(self, state: tuple[Vector, Vector], u: Vector) -> tuple[tuple[Vector, Vector], Vector] | None:
        """((q, u), the elbow off the line) at u, from a state nearby."""
        q = self._solve(*state, u)
        elbow = None if q is None else self.elbow(q, u)
        return None if q is None or elbow is None else ((q, u), elbow)

    def elbow(self, q: Vector, u: Vector) -> Vector | None:
        """Where it is at a posture, off the line along u (3,) [m]; None on the line."""
        S, E, _ = self._places(q)
        off = E - S - (u @ (E - S)) * u
        return off if float(np.linalg.norm(off)) > ON_LINE else None

    def _solve(self, q: Vector, u: Vector, v: Vector) -> Vector | None:
        """The posture at v, near the one at u; None where Newton's method does not find one."""
        start = q
        if float(np.linalg.norm(v - u)) > 2e-4:  # a shorter way needs no prediction
            try:
                q = self._predicted(q, u, v)
            except SingularityError:
                return None

        def correct(Q: Matrix, _: Indices) -> tuple[Matrix, Flags]:
            dq = self.correction(Q[0], self.sphere.position(v))
            step = np.full(Q.shape, np.nan) if dq is None else dq[None]
            # What lies farther than 0.3 joint units from the start is gone to in several steps; NaN is not
            return step, np.abs(Q + step - start).max(axis=1) < 0.3

        # Corrections that shrink by less than four mean that the step is too long
        posture, arrived = newton(correct, q[None], steps=NEWTONS, exact=DONE, contraction=0.25)
        return posture[0] if arrived[0] else None

    def _predicted(self, q: Vector, u: Vector, v: Vector) -> Vector:
        """Carried by the strategy from u to v, to the fourth order: near a pole the elbow swings far on a short way."""
        length, rates = self.sphere.radius * angle_between(u, v), []
        rows = [row for row in self.task.rows if row < 3]
        for ahead in (v - u @ v * u, v - u, u @ v * v - u):  # along the great circle at its start, middle and end
            velocity = length / float(np.linalg.norm(ahead)) * ahead
            rates.append(np.append(velocity[rows], np.zeros(self.task.m - len(rows))))
        return runge_kutta(self._rate, q, 1.0, *rates)


def field_on_leaf(strategy: HolonomicStrategy, q0: Vector, sphere: ToolSphere, arm: Arm) -> ElbowField:
    """The elbow's direction as the leaf of a strategy makes it: on [f(q) - x; g(q) - c]."""
    newton_step, level, R = leaf_step(strategy), leaf_value(strategy, q0), sphere.pose[:3, :3]
    start_side = newton_step(q0, sphere.pose[:3, 3], R, level)[3]

    def correction(q: Vector, p: Vector) -> Vector | None:
        dq, rcond, margin, side = newton_step(q, p, R, level)
        sound = rcond > TOLERANCES.singular and margin > TOLERANCES.representation and side == start_side
        return dq if sound else None

    return ElbowField(strategy, q0, sphere, arm, correction)


LIMITS = "joint limits were not looked at"


@dataclass(frozen=True, eq=False)
class Directions(Value):
    """All directions from the shoulder to the wrist, at the start's distance, with its orientation of the tool.

    Args:
        joints: shoulder, elbow and wrist named, as `find_arm` has them.
        fineness: the sphere is cut into 20 4^fineness triangles.
        accuracy: angle [rad] to which a place that has an index is found.
    """

    joints: Sequence[Any] | None = None
    fineness: int = 1
    accuracy: float = 0.01

    def __post_init__(self) -> None:
        # The finest sphere has 5,120 triangles, which take a minute or two
        if whole("the fineness of directions", self.fineness, 0) > 4:
            raise ArgumentError("the fineness of directions", self.fineness, "give at most 4")
        positive("the accuracy of directions", self.accuracy, "give an angle in radians, such as 0.01")
        super().__post_init__()


@dataclass(frozen=True, eq=False)
class Witness(Result, Value):
    """A direction (3,) with an index, known within `radius` [rad], and the tool pose (4, 4) there.

    Round it the elbow turns `index` times more than a strategy does that goes on without a jump. hole: the strategy is
    not found in a region of that radius, as where its leaf ends; else it is a point, as far as one can tell.
    """

    direction: Vector
    pose: Matrix
    index: int
    radius: float
    hole: bool

    def __str__(self) -> str:
        x, y, z = (self.direction.round(2) + 0.0).tolist()
        where = f"in a hole of {self.radius:.2g} rad round" if self.hole else "at"
        return f"{self.index:+d} {where} ({x:g}, {y:g}, {z:g})"


@dataclass(frozen=True, eq=False)
class Obstruction(NoTruthValue, Value, ask="`.total`, which is None where it could not be decided"):
    """What `obstruction` found: the total index or number of turns, None where it could not be decided.

    Over a sphere: witnesses, whose indices add up to the total; clearance [m], how near the elbow came to the line from
    shoulder to wrist. `samples`: directions or poses looked at, of which `reached` were reached. largest [rad]: the
    largest turn from one sample to the next, always below pi/2 where there is a total.
    """

    total: int | None
    witnesses: tuple[Witness, ...]
    samples: int
    reached: int
    largest: float
    clearance: float
    sentence: str
    details: str

    def __str__(self) -> str:
        return f"{self.sentence}\n  {self.details}"


@typed
def obstruction(
    strategy: HolonomicStrategy | Task, over: Directions | Path, q0: ArrayLike, *, samples: int = 60
) -> Obstruction:
    """Whether a strategy can go on without a jump over a sphere of directions, or over a disc whose rim it knows.

    Over `Directions` of an arm with shoulder, elbow and wrist: the elbow's direction, seen from the line from shoulder
    to wrist, is a field of tangent directions on a sphere. By Poincare and Hopf the indices of its poles add up to 2:
    it has some, whatever the strategy (theory 5.8). Found are those of the leaf of a strategy through q0, by how far
    the elbow turns round triangles of directions, joined where the leaf cannot be followed. For a `Task` it is tested
    that every strategy of the arm makes such a field: the elbow stays off the line on the self-motions at the sampled
    directions and goes round it once on each.

    Over a closed `Path` of a task that leaves one joint redundant: by how many turns of the self-motion the leaf
    through q0 is ahead of a section over the disc of straight paths from the path's start to its points, after one
    round; positive on the side of det [J; N^T] > 0. If it is not 0, no strategy that is this one on the path goes on
    over the disc.

    Args:
        strategy: a strategy, or, over directions, a task, for any strategy.
        samples: of a path; more are taken while the redundant joint turns too far from one to the next.

    Raises:
        NoArmError: no shoulder, elbow and wrist. ArgumentError: the shoulder moves; a path with a task instead of a
            strategy; several redundant joints. OpenPathError; on a path, what `follow` raises.
    """
    # Over a sphere of directions, of the leaf of a strategy or of any strategy
    if isinstance(over, Directions):
        task = strategy if isinstance(strategy, Task) else strategy.task
        of_one_tool(task, "obstruction")
        if not task._turns:
            raise ArgumentError("the task", task.name, "give one with the tool's orientation, hk.pose(robot)")
        start, arm = task.robot.checked(q0, "the start posture"), find_arm(task, over.joints)
        sphere = sphere_of(task, start, arm)
        if isinstance(strategy, Task):
            R = sphere.pose[:3, :3]
            least = ElbowField(moore_penrose(task), start, sphere, arm, lambda q, p: correction(task, q, p, R))
            return _of_any_strategy(least, over)
        strategy(start)
        return _of_leaf(strategy, field_on_leaf(strategy, start, sphere, arm), over)
    # Over a disc whose rim is a path
    if isinstance(strategy, Task):
        raise ArgumentError("the strategy on a path", strategy.name, HolonomicStrategy.cure)
    return _round(strategy, over, q0, whole("samples", samples, 8))


def _of_leaf(strategy: HolonomicStrategy, field: ElbowField, over: Directions) -> Obstruction:
    """The indices of one strategy over a sphere."""
    sphere = field.sphere
    result = poles(field, field.start, sphere.direction, over.fineness, over.accuracy)
    # Close to a pole singular postures of the arm may be in the way: a hole has a radius of 5 accuracies at least
    witnesses = []
    for pole in result.found:
        u, hole = np.array(pole.direction), pole.radius > 5 * over.accuracy
        witnesses.append(Witness(u, sphere.pose_at(u), pole.index, pole.radius, hole))
    about = f"{strategy.name!r} over all {_directions(sphere)}"
    details = (
        f"{result.reached} of {result.directions} directions were reached; from one sample to the next the elbow "
        f"turned {result.largest:.2f} rad at most, below pi/2; {LIMITS}"
    )
    # All indices there are add up to 2, or one was missed
    total, cure = None, "take another start, or another strategy"
    sentence = f"{about}: undecided, since the leaf was followed to too few of them; {cure}"
    if result.total == 2:
        total, places = 2, " and ".join(map(str, witnesses))
        why = (
            f", unless the elbow gets onto the line from shoulder to wrist (it kept {result.least:.2g} m from it "
            "here); every strategy that keeps it off has indices that add up to 2"
        )
        if sphere.fixed:
            why = (
                "; every strategy of this arm has indices that add up to 2, since its bent elbow is never on the line "
                "from shoulder to wrist, so none covers all directions"
            )
        sentence = f"{about} has the indices {places}: it cannot go on there without a jump{why}"
    return Obstruction(
        total, tuple(witnesses), result.directions, result.reached, result.largest, result.least, sentence, details
    )


def _directions(sphere: ToolSphere) -> str:
    return f"directions from the shoulder to the wrist (wrist {sphere.radius:.3g} m away, tool turned as at the start)"


def _of_any_strategy(field: ElbowField, over: Directions) -> Obstruction:
    """Whether every strategy over a sphere makes a field of tangent directions: by the self-motions over it."""
    sphere, task = field.sphere, field.task
    states, directions, clearance = spread(field, field.start, sphere.direction, over.fineness)
    where = _directions(sphere)
    about, total, largest = f"any strategy of {task.robot.name} over all {where}: undecided, since", None, 0.0
    if len(states) < directions:
        sentence = f"{about} not all could be reached from the start; take another start"
    else:
        laps, largest, nearest = _laps(field, states)
        clearance = min(clearance, nearest)
        sentence = f"{about} not every self-motion there is a closed curve with one turn of the elbow"
        if largest < TURN and not set(laps) - {-1, 1}:
            total, which = 2, "" if sphere.fixed else "on the self-motions traced, "
            sentence = (
                f"{which}no strategy of {task.robot.name} covers all {where} without a jump. On each self-motion the "
                f"elbow goes once round the line from shoulder to wrist, {clearance:.2g} m from it or more. So a "
                "strategy is a field of tangent directions on a sphere, and the indices of such a field add up to 2"
            )
    details = f"self-motions were traced at {len(states)} of {directions} directions; {LIMITS}"
    return Obstruction(total, (), directions, len(states), largest, clearance, sentence, details)


def _laps(field: ElbowField, states: Sequence[tuple[Vector, Vector]]) -> tuple[list[int], float, float]:
    """How often the elbow goes round the line on the self-motions through (q, u), 0 for open ones; its largest turn;
    its least distance from the line [m]."""
    laps, largest, nearest = [], 0.0, np.inf
    for fibre, (_, u) in zip(self_motions(field.task, np.array([q for q, _ in states])), states, strict=True):
        elbows = [] if fibre is None else [field.elbow(q, u) for q in [*fibre, fibre[0]]]
        steps = [turn(u, e, u, f) for e, f in pairwise(elbows) if e is not None and f is not None]
        closed = bool(steps) and len(steps) == len(elbows) - 1
        laps.append(round(sum(steps) / (2 * np.pi)) if closed else 0)
        largest = max(largest, *map(abs, steps), 0.0)
        nearest = min([nearest, *(float(np.linalg.norm(e)) for e in elbows if e is not None)])
    return laps, largest, nearest


def _round(strategy: HolonomicStrategy, path: Path, q0: ArrayLike, samples: int) -> Obstruction:
    """The turns of the redundant joint round a closed path."""
    if not path.closed:
        raise OpenPathError("obstruction", path.gap)
    task = strategy.task
    if task.n - task.m != 1:
        raise ArgumentError("the number of redundant joints", task.n - task.m, "give a task that leaves one")
    # Samples are doubled, up to 1,000, until the redundant joint turns little from one to the next
    while True:
        walk = follow(strategy, path, q0, samples=samples, limits=False)
        result = turns(task, walk.q)
        if result.missing or result.largest < QUARTER or 2 * samples > 1_000:
            break
        samples *= 2
    count, total = len(walk.q), None
    about, poses = f"{strategy.name!r} round the path: undecided, since", f"{count} poses"
    details = (
        f"{poses}; from one to the next the redundant joint made {result.largest:.2g} turns at most; "
        f"there and halfway to the start the self-motions are closed; {LIMITS}"
    )
    # The traced self-motions are polygons, so that the turns may be 1e-3 from a whole number
    ahead = float(result.ahead[-1] - result.ahead[0]) if len(result.ahead) else np.nan
    if result.missing:
        sentence, details = f"{about} {result.missing}", f"{poses}; {LIMITS}"
    elif not result.largest < QUARTER:
        sentence = f"{about} the redundant joint turns too far from one of {poses} to the next"
    elif abs(ahead - round(ahead)) > 1e-3:
        sentence = f"{about} it ends {ahead:.3f} turns of the self-motion away from its start"
    else:
        total = round(ahead)
        often = f"{total:+d} turn{'' if abs(total) == 1 else 's'}" if total else "no turn"
        disc = "on the disc of straight lines from the start of the path to its points"
        means = f"So nothing on the path forbids a strategy without a jump {disc}"
        if total:
            means = f"So any strategy with the same postures on the path has a jump somewhere {disc}"
        sentence = (
            f"While the tool goes round the path once, the arm with {strategy.name!r} makes {often} along the "
            f"self-motion. {means}"
        )
    largest = 2 * np.pi * result.largest
    return Obstruction(total, (), count, len(result.ahead), largest, np.nan, sentence, details)
