"""`obstruction`: why no repeatable law serves all tool poses of a sphere of directions, or a disc with a given rim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, OpenPathError
from ...base.types import ArrayLike, Matrix, NoTruthValue, Value, Vector, positive, whole
from ...motion.follow_path import follow
from ...path import Path
from ...strategies import HolonomicStrategy
from ...strategies.constraints import find_arm
from ...strategies.tasks.task import Task, of_one_tool
from .elbow_field import ElbowField, FreeField, LeafField, ToolSphere, sphere_of
from .fibre_winding import QUARTER, self_motions, turns
from .sphere_index import TURN, Pole, poles, spread, turn

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

    Round it the elbow turns `index` times more than a law does that goes on without a jump. hole: the law is not found
    in a region of that radius, as where its leaf ends; else it is a point, as far as one can tell.
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
    law: HolonomicStrategy | Task, over: Directions | Path, q0: ArrayLike, *, samples: int = 60
) -> Obstruction:
    """Whether a law can go on without a jump over a sphere of directions, or over a disc of which it knows the rim.

    Over `Directions` of an arm with shoulder, elbow and wrist: the elbow's direction, seen from the line from shoulder
    to wrist, is a field of tangent directions on a sphere. By Poincare and Hopf the indices of its poles add up to 2:
    it has some, whatever the law (theory 5.8). Found are those of the leaf of a strategy through q0, by how far the
    elbow turns round triangles of directions, joined where the leaf cannot be followed. For a `Task` it is tested that
    every law of the arm makes such a field: the elbow stays off the line on the self-motions at the sampled directions
    and goes round it once on each.

    Over a closed `Path` of a task that leaves one joint redundant: by how many turns of the self-motion the leaf
    through q0 is ahead of a section over the disc of straight paths from the path's start to its points, after one
    round; positive on the side of det [J; N^T] > 0. If it is not 0, no law that is this one on the path goes on over
    the disc.

    Args:
        law: a strategy, or, over directions, a task, for any law.
        samples: of a path; more are taken while the redundant joint turns too far from one to the next.

    Raises:
        NoArmError: no shoulder, elbow and wrist. ArgumentError: the shoulder moves; a path with a task instead of a
            strategy; several redundant joints. OpenPathError; on a path, what `follow` raises.
    """
    if isinstance(over, Directions):
        task = law if isinstance(law, Task) else law.task
        of_one_tool(task, "obstruction")
        if not task.turns:
            raise ArgumentError("the task", task.name, "give one with the tool's orientation, hk.pose(robot)")
        start, arm = task.robot.checked(q0, "the start posture"), find_arm(task, over.joints)
        sphere = sphere_of(task, start, arm)
        if isinstance(law, Task):
            return _of_any_law(FreeField(task, start, sphere, arm), over)
        law(start)
        return _of_leaf(law, LeafField(law, start, sphere, arm), over)
    if isinstance(law, Task):
        raise ArgumentError("the law on a path", law.name, HolonomicStrategy.cure)
    return _round(law, over, q0, whole("samples", samples, 8))


def _of_leaf(strategy: HolonomicStrategy, field: ElbowField, over: Directions) -> Obstruction:
    """The indices of one law over a sphere."""
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
        said = f"{about}: undecided, since the leaf was followed to too few of them; take another start, or another law"
    else:
        places = " and ".join(map(_told, witnesses))
        said = f"{about} has the indices {places}: it cannot go on there without a jump{_why(field, found.least)}"
    return Obstruction(total, witnesses, found.directions, found.reached, found.largest, found.least, said, details)


def _witness(sphere: ToolSphere, pole: Pole, accuracy: float) -> Witness:
    u = np.array(pole.direction)
    return Witness(u, sphere.pose_at(u), pole.index, pole.radius, pole.radius > HOLE * accuracy)


def _why(field: ElbowField, clearance: float) -> str:
    """Why every other law over this sphere has a place like that."""
    if field.sphere.fixed:
        return (
            "; every law of this arm has indices that add up to 2, since its bent elbow is never on the line from "
            "shoulder to wrist, so none covers all directions"
        )
    return (
        f", unless the elbow gets onto the line from shoulder to wrist (it kept {clearance:.2g} m from it here); "
        "every law that keeps it off has indices that add up to 2"
    )


def _told(witness: Witness) -> str:
    x, y, z = (witness.direction.round(2) + 0.0).tolist()
    where = f"in a hole of {witness.radius:.2g} rad round" if witness.hole else "at"
    return f"{witness.index:+d} {where} ({x:g}, {y:g}, {z:g})"


def _directions(sphere: ToolSphere) -> str:
    return f"directions from the shoulder to the wrist (wrist {sphere.radius:.3g} m away, tool turned as at the start)"


def _of_any_law(field: FreeField, over: Directions) -> Obstruction:
    """Whether every law over a sphere makes a field of tangent directions: by the self-motions over it."""
    sphere, task = field.sphere, field.task
    known, directions, clearance = spread(field, field.start, sphere.direction, over.fineness)
    where = _directions(sphere)
    about = f"any law of {task.robot.name} over all {where}"
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
                f"{which}no law of {task.robot.name} covers all {where} without a jump. On each self-motion the elbow "
                f"goes once round the line from shoulder to wrist, {clearance:.2g} m from it or more. So a law is a "
                "field of tangent directions on a sphere, and the indices of such a field add up to 2"
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
            "So any law with the same postures on the path has a jump somewhere on the disc of straight lines from the "
            "start of the path to its points"
            if total
            else "So nothing on the path forbids a law without a jump on the disc of straight lines from the start of "
            "the path to its points"
        )
        often = f"{total:+d} turn{'' if abs(total) == 1 else 's'}" if total else "no turn"
        said = (
            f"While the tool goes round the path once, the arm with {strategy.name!r} makes {often} along the "
            f"self-motion. {means}"
        )
    return Obstruction(total, (), count, len(found.ahead), largest, np.nan, said, details)
