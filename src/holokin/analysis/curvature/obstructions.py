"""`obstruction`: why no repeatable strategy serves all tool poses of a sphere of directions, or a disc with a given
rim."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, OpenPathError, SingularityError, SingularityKind
from ...base.tolerances import TOLERANCES
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, NoTruthValue, Value, Vector, positive, whole
from ...motion.follow_path import follow
from ...motion.ik.leaf import DONE, NEWTONS, leaf_step, leaf_value
from ...motion.ik.posture_search import newton, to_poses
from ...path import Path
from ...path.path import straight
from ...strategies import HolonomicStrategy, SelfMotions, Strategy, moore_penrose
from ...strategies.constraints import Arm, find_arm
from ...strategies.radial_strategy import correction, joint_gap
from ...strategies.tasks.frame_task import completing, leaves_free
from ...strategies.tasks.task import Task, of_one_tool
from ...symbolic import runge_kutta
from .sphere_index import TURN, Pole, TangentField, angle_between, poles, spread, turn

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

LONGEST = 40.0
"""Arc length [joint units] after which a self-motion counts as open; a Panda's closes after 13 or less."""

PIECE = 0.05
"""Way of the tool [m or rad] between two postures of the reference."""

LAST_CORRECTION = 1e-6
"""Last correction [joint units] of a posture that counts as found: what is left is of the order of its square."""

CORRECTIONS = 4
"""Newton corrections of a posture: of a step of 0.1 the first leaves 1e-3, the second 1e-6, the third 1e-12."""

LARGE = 0.5
"""Largest correction of a joint [joint units]: what wants more is close to a singular posture."""


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
    p, R = task._poses(Q)
    middle, reference = _references(task, Q[0], p, R)
    if reference is None or middle is None:
        return Turns(np.zeros(0), "a straight path from its start to one of its points meets a singular posture")
    fibres = self_motions(task, reference)
    if any(fibre is None for fibre in [*fibres, *self_motions(task, middle)]):
        return Turns(np.zeros(0), "a self-motion over the disc of straight paths from its start is no closed curve")
    found = [_share(task, fibre, q) for fibre, q in zip(fibres, Q, strict=True) if fibre is not None]
    known = [share for share in found if share is not None]
    if len(known) < len(found):
        missing = "the strategy is on another self-motion than the disc of straight paths from its start"
        return Turns(np.zeros(0), missing)
    return Turns(np.unwrap(known, period=1.0))


def _references(task: Task, q0: Vector, p: Matrix, R: Array) -> tuple[Matrix | None, Matrix | None]:
    """The postures (k, n) that least joint motion leads to on straight paths from q0, halfway and at their ends."""
    if leaves_free(task):
        p, R = completing(task).batch(p[0], R[0], p, R)
    lines = straight(p[0], R[0], p, R)
    size = float(np.linalg.norm([lines.move, lines.turn], axis=2).max())
    pieces = 2 * int(np.ceil(size / PIECE / 2)) or 2
    Q, middle = np.tile(q0, (len(p), 1)), None
    for k in range(1, pieces + 1):
        share = k / pieces
        Q, good = newton(to_poses(task, *lines.at(share)), Q, steps=CORRECTIONS, exact=LAST_CORRECTION, longest=LARGE)
        if not good.all():
            return middle, None
        middle = Q if 2 * k == pieces else middle
    return middle, Q


def self_motions(task: Task, Q: Matrix) -> list[Matrix | None]:
    """The self-motions (points, n) through postures (k, n), all at once, each round once; None for those left open."""
    lines = SelfMotions.through(task, Q).traced(Q, step=STEP, length=LONGEST, limits=False)
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

LARGEST_STEP = 0.3
"""Largest joint motion [joint units] of one step: what lies farther is gone to in several."""

CONTRACTION = 0.25
"""Largest ratio of two successive Newton corrections of one step; a larger one means that the step is too long."""

SMALL = 2e-4
"""Way [rad] on the sphere that Newton's method goes without a prediction."""

State = tuple[Vector, Vector]
"""A posture (n,) and the direction (3,) where it is."""

ON_LINE = 1e-6
"""Distance [m] of the elbow from the line shoulder-wrist at which it has no direction."""

FIXED = 1e-9
"""Motion [m] up to which a point counts as fixed."""


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
        found = np.array(self.pose)
        found[:3, 3] = self.position(u)
        return found


def sphere_of(task: Task, q0: Vector, arm: Arm) -> ToolSphere:
    """The sphere of tool poses about the shoulder, through that of q0.

    Raises:
        ArgumentError: the shoulder moves, or the wrist is in it.
    """
    places = arm.places(task)
    some = np.random.default_rng(0).uniform(-1.5, 1.5, (4, task.n))
    points = places.batch(some).reshape(-1, 3, 3)
    if np.ptp(points[:, 0], axis=0).max() > FIXED:
        raise ArgumentError("the shoulder", arm.shoulder.place, "name joints=(...) with one that no joint moves")
    p, R = task._poses(some)
    held = np.einsum("kji,kj->ki", R, points[:, 2] - p)
    pose, (S, _, W) = task.pose(q0), places(q0)
    radius = float(np.linalg.norm(W - S))
    if not radius > ON_LINE:
        raise ArgumentError("the distance from shoulder to wrist", radius, "choose another start posture")
    return ToolSphere(S, (W - S) / radius, radius, pose, bool(np.ptp(held, axis=0).max() <= FIXED))


class ElbowField(TangentField):
    """u -> the part of the elbow's place, seen from the shoulder, that is perpendicular to u [m].

    The state is (q, u), the posture (n,) and where it is. It is carried by a strategy, dq = G dx, and corrected.
    """

    def __init__(self, strategy: Strategy, q0: Vector, sphere: ToolSphere, arm: Arm) -> None:
        self.task, self.sphere = strategy.task, sphere
        self.start = q0, sphere.direction
        self._rate, self._places, self._rotation = strategy.rate, arm.places(strategy.task), sphere.pose[:3, :3]

    def step(self, state: State, u: Vector) -> tuple[State, Vector] | None:
        """((q, u), the elbow off the line) at u, from a state nearby."""
        q = self.solve(*state, u)
        e = None if q is None else self.elbow(q, u)
        return None if q is None or e is None else ((q, u), e)

    def elbow(self, q: Vector, u: Vector) -> Vector | None:
        """Where it is at a posture, off the line along u (3,) [m]; None on the line."""
        S, E, _ = self._places(q)
        off = E - S - (u @ (E - S)) * u
        return off if float(np.linalg.norm(off)) > ON_LINE else None

    def solve(self, q: Vector, u: Vector, v: Vector) -> Vector | None:
        """The posture at v, near the one at u; None where Newton's method does not find one."""
        start = q
        try:
            q = self._predicted(q, u, v) if float(np.linalg.norm(v - u)) > SMALL else q
        except SingularityError:
            return None

        def correct(at: Matrix, _: Indices) -> tuple[Matrix, Flags]:
            dq = self.correction(at[0], v)
            found = np.full(at.shape, np.nan) if dq is None else dq[None]
            return found, np.abs(at + found - start).max(axis=1) < LARGEST_STEP  # NaN is not

        found, arrived = newton(correct, q[None], steps=NEWTONS, exact=DONE, contraction=CONTRACTION)
        return found[0] if arrived[0] else None

    def _predicted(self, q: Vector, u: Vector, v: Vector) -> Vector:
        """Carried by the strategy from u to v, to the fourth order: near a pole the elbow swings far on a short way."""
        ahead = [v - u @ v * u, v - u, u @ v * v - u]  # along the great circle at its start, middle and end
        length = self.sphere.radius * angle_between(u, v)
        rows = [row for row in self.task.rows if row < 3]
        rates = [
            np.append((length / float(np.linalg.norm(x)) * x)[rows], np.zeros(self.task.m - len(rows))) for x in ahead
        ]
        return runge_kutta(self._checked, q, 1.0, *rates)

    def _checked(self, q: Vector, dx: Vector) -> Vector:
        dq, rcond, margin = self._rate(q, dx)
        if not (rcond > TOLERANCES.singular and margin > TOLERANCES.representation):
            raise SingularityError(SingularityKind.ALGORITHMIC, q, "a strategy on the sphere", float(rcond))
        return dq

    @abstractmethod
    def correction(self, q: Vector, u: Vector) -> Vector | None:
        """Newton's correction (n,) towards u; None where it is singular."""


class LeafField(ElbowField):
    """The elbow's direction as the leaf of a strategy makes it."""

    def __init__(self, strategy: HolonomicStrategy, q0: Vector, sphere: ToolSphere, arm: Arm) -> None:
        super().__init__(strategy, q0, sphere, arm)
        self._newton, self._leaf = leaf_step(strategy), leaf_value(strategy, q0)
        self._side = self._newton(q0, sphere.pose[:3, 3], self._rotation, self._leaf)[3]

    def correction(self, q: Vector, u: Vector) -> Vector | None:
        """On [f(q) - x; g(q) - c]."""
        dq, rcond, margin, side = self._newton(q, self.sphere.position(u), self._rotation, self._leaf)
        sound = rcond > TOLERANCES.singular and margin > TOLERANCES.representation and side == self._side
        return dq if sound else None


class FreeField(ElbowField):
    """The elbow's direction with the least joint motion: a strategy along a way, not one over the sphere."""

    def __init__(self, task: Task, q0: Vector, sphere: ToolSphere, arm: Arm) -> None:
        super().__init__(moore_penrose(task), q0, sphere, arm)

    def correction(self, q: Vector, u: Vector) -> Vector | None:
        """The least joint motion, on f(q) - x."""
        return correction(self.task, q, self.sphere.position(u), self._rotation)


FINEST = 4
"""Largest fineness: 5,120 triangles, a minute or two."""

MOST_SAMPLES = 1_000
"""Samples of a path up to which they are doubled until the redundant joint turns little from one to the next."""

WHOLE = 1e-3
"""How far the turns round a closed path may be from a whole number: the traced self-motions are polygons."""

HOLE = 5
"""Radius of a hole in accuracies, at least: close to a pole singular postures of the arm may be in the way."""

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
        if whole("the fineness of directions", self.fineness, 0) > FINEST:
            raise ArgumentError("the fineness of directions", self.fineness, f"give at most {FINEST}")
        positive("the accuracy of directions", self.accuracy, "give an angle in radians, such as 0.01")
        super().__post_init__()


@dataclass(frozen=True, eq=False)
class Witness(Value):
    """A direction (3,) with an index, known within `radius` [rad], and the tool pose (4, 4) there.

    Round it the elbow turns `index` times more than a strategy does that goes on without a jump. hole: the strategy is
    not found in a region of that radius, as where its leaf ends; else it is a point, as far as one can tell.
    """

    direction: Vector
    pose: Matrix
    index: int
    radius: float
    hole: bool


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
    if isinstance(over, Directions):
        task = strategy if isinstance(strategy, Task) else strategy.task
        of_one_tool(task, "obstruction")
        if not task._turns:
            raise ArgumentError("the task", task.name, "give one with the tool's orientation, hk.pose(robot)")
        start, arm = task.robot.checked(q0, "the start posture"), find_arm(task, over.joints)
        sphere = sphere_of(task, start, arm)
        if isinstance(strategy, Task):
            return _of_any_strategy(FreeField(task, start, sphere, arm), over)
        strategy(start)
        return _of_leaf(strategy, LeafField(strategy, start, sphere, arm), over)
    if isinstance(strategy, Task):
        raise ArgumentError("the strategy on a path", strategy.name, HolonomicStrategy.cure)
    return _round(strategy, over, q0, whole("samples", samples, 8))


def _of_leaf(strategy: HolonomicStrategy, field: ElbowField, over: Directions) -> Obstruction:
    """The indices of one strategy over a sphere."""
    sphere = field.sphere
    found = poles(field, field.start, sphere.direction, over.fineness, over.accuracy)
    witnesses = tuple(_witness(sphere, pole, over.accuracy) for pole in found.found)
    total = 2 if found.total == 2 else None  # all indices there are add up to 2, or one was missed
    about = f"{strategy.name!r} over all {_directions(sphere)}"
    details = (
        f"{found.reached} of {found.directions} directions were reached; from one sample to the next the elbow turned "
        f"{found.largest:.2f} rad at most, below pi/2; {LIMITS}"
    )
    if total is None:
        cure = "take another start, or another strategy"
        said = f"{about}: undecided, since the leaf was followed to too few of them; {cure}"
    else:
        places = " and ".join(map(_told, witnesses))
        said = f"{about} has the indices {places}: it cannot go on there without a jump{_why(field, found.least)}"
    return Obstruction(total, witnesses, found.directions, found.reached, found.largest, found.least, said, details)


def _witness(sphere: ToolSphere, pole: Pole, accuracy: float) -> Witness:
    u = np.array(pole.direction)
    return Witness(u, sphere.pose_at(u), pole.index, pole.radius, pole.radius > HOLE * accuracy)


def _why(field: ElbowField, clearance: float) -> str:
    """Why every other strategy over this sphere has a place like that."""
    if field.sphere.fixed:
        return (
            "; every strategy of this arm has indices that add up to 2, since its bent elbow is never on the line from "
            "shoulder to wrist, so none covers all directions"
        )
    return (
        f", unless the elbow gets onto the line from shoulder to wrist (it kept {clearance:.2g} m from it here); "
        "every strategy that keeps it off has indices that add up to 2"
    )


def _told(witness: Witness) -> str:
    x, y, z = (witness.direction.round(2) + 0.0).tolist()
    where = f"in a hole of {witness.radius:.2g} rad round" if witness.hole else "at"
    return f"{witness.index:+d} {where} ({x:g}, {y:g}, {z:g})"


def _directions(sphere: ToolSphere) -> str:
    return f"directions from the shoulder to the wrist (wrist {sphere.radius:.3g} m away, tool turned as at the start)"


def _of_any_strategy(field: FreeField, over: Directions) -> Obstruction:
    """Whether every strategy over a sphere makes a field of tangent directions: by the self-motions over it."""
    sphere, task = field.sphere, field.task
    known, directions, clearance = spread(field, field.start, sphere.direction, over.fineness)
    where = _directions(sphere)
    about = f"any strategy of {task.robot.name} over all {where}"
    total, largest = None, 0.0
    if len(known) < directions:
        said = f"{about}: undecided, since not all could be reached from the start; take another start"
    else:
        laps, largest, nearest = _laps(field, known)
        clearance = min(clearance, nearest)
        if not largest < TURN or set(laps) - {-1, 1}:
            said = f"{about}: undecided, since not every self-motion there is a closed curve with one turn of the elbow"
        else:
            total = 2
            which = "" if sphere.fixed else "on the self-motions traced, "
            said = (
                f"{which}no strategy of {task.robot.name} covers all {where} without a jump. On each self-motion the "
                f"elbow goes once round the line from shoulder to wrist, {clearance:.2g} m from it or more. So a "
                "strategy is a field of tangent directions on a sphere, and the indices of such a field add up to 2"
            )
    details = f"self-motions were traced at {len(known)} of {directions} directions; {LIMITS}"
    return Obstruction(total, (), directions, len(known), largest, clearance, said, details)


def _laps(field: FreeField, known: Sequence[tuple[Vector, Vector]]) -> tuple[list[int], float, float]:
    """How often the elbow goes round the line on the self-motions through (q, u), 0 for open ones; its largest turn;
    its least distance from the line [m]."""
    laps, largest, nearest = [], 0.0, np.inf
    for fibre, (_, u) in zip(self_motions(field.task, np.array([q for q, _ in known])), known, strict=True):
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
    while True:
        walk = follow(strategy, path, q0, samples=samples, limits=False)
        found = turns(task, walk.q)
        if found.missing or found.largest < QUARTER or 2 * samples > MOST_SAMPLES:
            break
        samples *= 2
    about = f"{strategy.name!r} round the path"
    largest, count = 2 * np.pi * found.largest, len(walk.q)
    details = (
        f"{count} poses; from one to the next the redundant joint made {found.largest:.2g} turns at most; "
        f"there and halfway to the start the self-motions are closed; {LIMITS}"
    )
    total, ahead = None, float(found.ahead[-1] - found.ahead[0]) if len(found.ahead) else np.nan
    if found.missing:
        said, details = f"{about}: undecided, since {found.missing}", f"{count} poses; {LIMITS}"
    elif not found.largest < QUARTER:
        said = f"{about}: undecided, since the redundant joint turns too far from one of {count} poses to the next"
    elif abs(ahead - round(ahead)) > WHOLE:
        said = f"{about}: undecided, since it ends {ahead:.3f} turns of the self-motion away from its start"
    else:
        total = round(ahead)
        means = (
            "So any strategy with the same postures on the path has a jump somewhere on the disc of straight lines "
            "from the start of the path to its points"
            if total
            else "So nothing on the path forbids a strategy without a jump on the disc of straight lines from the "
            "start of the path to its points"
        )
        often = f"{total:+d} turn{'' if abs(total) == 1 else 's'}" if total else "no turn"
        said = (
            f"While the tool goes round the path once, the arm with {strategy.name!r} makes {often} along the "
            f"self-motion. {means}"
        )
    return Obstruction(total, (), count, len(found.ahead), largest, np.nan, said, details)
