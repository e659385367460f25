"""Drift over the cycles of a closed path, and the spread between two paths to one tool pose."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError, OpenPathError, PathError, SingularityError
from ..base.types import Array, ArrayLike, Indices, Matrix, NoTruthValue, Value, Vector
from ..path import Path, Segment
from ..path.editing import AnyPath, paths_of
from ..strategies import Strategy
from .follow_path import Following, by_leaf, follow
from .trajectory import Trajectory, whole_turns


@dataclass(frozen=True, eq=False)
class Drift(NoTruthValue, Value, ask="`.largest`"):
    """Joint drift over the cycles of a closed path."""

    trajectory: Trajectory

    def __repr__(self) -> str:
        return f"Drift({self})"

    @property
    def since_start(self) -> Matrix:
        """Drift after 1, 2, ... cycles (cycles, n) [joint units]."""
        return self.trajectory.drift_since_start()

    @property
    def largest(self) -> Vector:
        """Largest joint's drift after 1, 2, ... cycles (cycles,) [joint units]."""
        return np.abs(self.since_start).max(axis=1)

    @property
    def turns(self) -> Indices:
        """Whole turns of each hinge after 1, 2, ... cycles (cycles, n): drifts of 2 pi k to 1e-6 rad; 0 for others.

        A loop that ends whole turns further winds: it cannot be contracted to a point along the leaf. A loop
        may wind with any other drift too; `winding` tells.
        """
        return self.trajectory.turns()

    @property
    def sentence(self) -> str:
        """How far the joints end from their start after the last cycle, with whole turns by joint."""
        last, units = self.since_start[-1], self.trajectory.joint_units
        k = int(np.abs(last).argmax())
        count = f"{len(self.since_start)} cycle{'s' * (len(self.since_start) > 1)}"
        names = self.trajectory.joint_names
        whole = [f"{name} by {turns:+d}" for name, turns in zip(names, self.turns[-1], strict=True) if turns]
        sentence = f"after {count} {names[k]} is {last[k]:.4g} {units[k]} from its start"
        return f"{sentence}; whole turns: {', '.join(whole)}" if whole else sentence

    def __str__(self) -> str:
        return ", ".join(f"{value:.4g}" for value in self.largest)


@dataclass(frozen=True, eq=False)
class Spread(NoTruthValue, Value, ask="`.largest`"):
    """Joints reached by two paths to the same tool pose."""

    a: Trajectory
    b: Trajectory

    @property
    def difference(self) -> Vector:
        """q at the end of a minus q at the end of b (n,) [joint units]."""
        return self.a.q[-1] - self.b.q[-1]

    @property
    def largest(self) -> float:
        """Largest joint's difference [joint units]."""
        return float(np.abs(self.difference).max())

    def __str__(self) -> str:
        k, names = int(np.abs(self.difference).argmax()), self.a.joint_names
        return f"{self.difference[k]:.4g} {self.a.joint_units[k]} apart at {names[k]}, where both paths end"


@typed
def drift(
    strategy: Strategy,
    path: AnyPath,
    q0: ArrayLike,
    *,
    cycles: int = 1,
    samples: int = 500,
    method: Following | None = None,
    limits: bool = True,
) -> Drift:
    """Follow a closed path for some cycles and say where the joints stand after each.

    Raises:
        OpenPathError, and what `follow` raises.
    """
    if not path.closed:
        raise OpenPathError("drift", path.gap)
    return Drift(follow(strategy, path, q0, samples=samples, cycles=cycles, method=method, limits=limits))


@typed
def path_spread(
    strategy: Strategy,
    path_a: AnyPath,
    path_b: AnyPath,
    q0: ArrayLike,
    *,
    samples: int = 500,
    method: Following | None = None,
    limits: bool = True,
) -> Spread:
    """Follow two paths from the same start posture to the same tool pose and compare the joints.

    Raises:
        ArgumentError when the paths end apart, and what `follow` raises.
    """
    if path_a.end.shape != path_b.end.shape:
        frames = len(paths_of(path_a)), len(paths_of(path_b))
        raise ArgumentError("the frames of the two paths", frames, "give equal numbers")
    apart = float(np.linalg.norm(path_a.end - path_b.end))
    turned = float(np.abs(path_a.turned - path_b.turned).max())
    if max(apart, turned) > 1e-9:
        raise ArgumentError("the distance between the ends of the two paths", max(apart, turned), "let both end alike")
    a = follow(strategy, path_a, q0, samples=samples, method=method, limits=limits)
    return Spread(a, follow(strategy, path_b, q0, samples=samples, method=method, limits=limits))


# --- Why a closed path drifts: curvature, or a place that it winds round. The path is contracted and followed again.
#
# Leaves are local. Where a strategy is holonomic and defined, drift does not change while a loop is contracted to a
# point, at which it is zero (theory 1.1). So a drift that stays while the loop shrinks, and is gone at a point, has
# jumped on the way: there the loop passed a place where the strategy is not defined. Curvature lets it fade instead.

NO_DRIFT = 1e-6
"""Drift [joint units] that needs no reason: well over the integration error of 500 samples."""

PIECE = 0.1
"""Turn [rad] of the pieces in which a path that turns the tool is contracted."""


class Cause(NoTruthValue, Enum, ask="`is Cause.NONE`"):
    """Why a closed path drifts; the text says what was seen."""

    NONE = "the joints are back at their start"
    CURVATURE = "the drift fades while the loop is contracted, without a jump: the drift comes from curvature"
    WINDING = "the drift jumps while the loop is contracted: it winds round a place where the strategy is not defined"
    TOOL_TURNS = "the tool itself makes a whole turn, so the loop cannot be contracted to a point"
    UNDECIDED = "cannot tell: smaller loops could not be made or followed, and those next in size do not tell"


@dataclass(frozen=True, eq=False)
class Winding(NoTruthValue, Value, ask="`.cause`"):
    """What became of the drift of a loop while it was contracted to its start.

    sizes (k,): the loops that could be followed, 1 the whole one, 0 the point; drifts (k, n) [joint units] of them.
    between: the two neighbouring sizes with the largest change of drift.
    """

    cause: Cause
    sizes: Vector
    drifts: Matrix
    between: tuple[float, float]
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]

    @property
    def drift(self) -> Vector:
        """Drift of the whole loop (n,) [joint units]."""
        return self.drifts[0]

    @property
    def jump(self) -> Vector:
        """Drift that goes at once (n,) [joint units], between the two sizes `between`."""
        sizes = self.sizes.tolist()
        return self.drifts[sizes.index(self.between[0])] - self.drifts[sizes.index(self.between[1])]

    @property
    def sentence(self) -> str:
        """The cause, with its metrics."""
        if self.cause is Cause.NONE:
            return self.cause.value
        sentence = f"{self.cause.value}; drift {_words(self.drift, self)}"
        if self.cause is not Cause.WINDING:
            return sentence
        sizes = "from {:.3g} to {:.3g} times its size".format(*self.between)
        return f"{sentence}; {sizes} the drift changes by {_words(self.jump, self)}"

    def __str__(self) -> str:
        return self.sentence


@typed
def winding(
    strategy: Strategy,
    path: Path,
    q0: ArrayLike,
    *,
    samples: int = 500,
    method: Following | None = None,
    limits: bool = True,
) -> Winding:
    """Whether a closed path drifts because it winds round a place where the strategy is not defined.

    The path is contracted to its start, x -> x_0 + s (x - x_0), s from 1 to 0, and followed at each size; where
    the drift changes most the sizes are halved. What is found is true of these loops, at this resolution.

    Args:
        samples, method, limits: as `follow` has them, for each loop. An integrated loop is followed again with
            twice the samples.

    Raises:
        OpenPathError, and what `follow` raises on the path itself.
    """
    if not path.closed:
        raise OpenPathError("winding", path.gap)
    task = strategy.task
    walk = follow(strategy, path, q0, samples=samples, method=method, limits=limits)
    full = walk.drift()[0]
    names, units = walk.joint_names, walk.joint_units

    def verdict(cause: Cause, known: dict[float, Vector], between: tuple[float, float] = (1.0, 0.0)) -> Winding:
        sizes = sorted(known, reverse=True)
        return Winding(cause, np.array(sizes), np.array([known[s] for s in sizes]), between, names, units)

    # No drift, or a tool that turns round: nothing to contract.
    known = {1.0: full, 0.0: np.zeros(len(full))}
    if np.abs(full).max() <= NO_DRIFT:
        return verdict(Cause.NONE, known)
    turning = any(task._angular) and any(s.turn > 0 for s in path.segments)
    lifts = _lifts(path) if turning else None
    if lifts is not None and np.linalg.norm(lifts[-1]) > np.pi:
        return verdict(Cause.TOOL_TURNS, known)
    if lifts is not None and np.linalg.norm(lifts, axis=1).max() > 2 * np.pi - PIECE:  # where their axes may flip
        return verdict(Cause.UNDECIDED, known)
    # The drift of a smaller loop; that of an integrated one must agree to 1 % with that of twice the samples.
    exact = by_leaf(strategy, method) is not None

    def drift(size: float) -> Vector | None:
        loop = _shrunk(path, size, lifts)
        try:
            once = follow(strategy, loop, q0, samples=samples, method=method, limits=limits).drift()[0]
            if exact:
                return once
            twice = follow(strategy, loop, q0, samples=2 * samples, method=method, limits=limits).drift()[0]
        except (PathError, SingularityError):
            return None
        return twice if np.abs(twice - once).max() <= 1e-2 * np.abs(full).max() else None

    def add(size: float) -> bool:
        value = drift(size)
        if value is not None:
            known[size] = value
        return value is not None

    # Contract the loop in even steps, then halve where the drift changes most, down to a thousandth of its size.
    for k in range(7, 0, -1):
        add(k / 8)
    above, below = _steepest(known)
    blocked = False
    while above - below > 1e-3:
        width = above - below
        if not any(add(below + share * width) for share in (0.5, 0.25, 0.75)):
            blocked = True
            break
        above, below = _steepest(known, above, below)
    # A jump is ten times steeper than the steepest change elsewhere.
    change = _change(known, above, below)
    elsewhere = max((_change(known, a, b) / (a - b) for a, b in _pairs(known) if (a, b) != (above, below)), default=0.0)
    if change > max(NO_DRIFT, 10.0 * elsewhere * (above - below)):
        return verdict(Cause.WINDING, known, (above, below))
    return verdict(Cause.UNDECIDED if blocked else Cause.CURVATURE, known, (above, below))


def _pairs(known: dict[float, Vector], top: float = 1.0, bottom: float = 0.0) -> list[tuple[float, float]]:
    """Neighbouring sizes, larger first, within limits."""
    sizes = [s for s in sorted(known, reverse=True) if bottom <= s <= top]
    return list(pairwise(sizes))


def _change(known: dict[float, Vector], a: float, b: float) -> float:
    return float(np.abs(known[a] - known[b]).max())


def _steepest(known: dict[float, Vector], top: float = 1.0, bottom: float = 0.0) -> tuple[float, float]:
    """The neighbouring sizes between which the drift changes most."""
    return max(_pairs(known, top, bottom), key=lambda pair: _change(known, *pair))


def _words(difference: Vector, of: Winding) -> str:
    """A joint difference in words: the largest joint's, and whole turns by name."""
    k = int(np.abs(difference).argmax())
    turns = whole_turns(difference, of.joint_units)
    turned = ((of.joint_names[i], int(turns[i])) for i in np.flatnonzero(turns))
    whole = ", ".join(f"{name} by {count:+d} turn{'s' if abs(count) > 1 else ''}" for name, count in turned)
    return f"{difference[k]:.4g} {of.joint_units[k]} ({whole or of.joint_names[k]})"


def _pieces(path: Path) -> list[Segment]:
    """The path in pieces that turn the tool by no more than `PIECE`."""
    out = []
    for segment in path.segments:
        count = max(1, int(np.ceil(segment.turn / PIECE)))
        out += [segment.part(i / count, (i + 1) / count) for i in range(count)]
    return out


def _lifts(path: Path) -> Matrix:
    """Rotation vectors (k + 1, 3) at the ends of the pieces, the path from the start counted: up to 2 pi long."""
    from scipy.spatial.transform import Rotation

    now, out = np.array([0.0, 0.0, 0.0, 1.0]), [np.zeros(3)]
    for piece in _pieces(path):
        following = (Rotation.from_matrix(piece.rotation) * Rotation.from_quat(now)).as_quat()
        now = following if following @ now > 0 else -following  # a small turn is a small step of the quaternion
        size = float(np.linalg.norm(now[:3]))
        out.append(2 * np.arctan2(size, now[3]) / max(size, 1e-300) * now[:3])
    return np.array(out)


def _shrunk(path: Path, size: float, lifts: Array | None) -> Path:
    """The path contracted to its start by a factor, its turns from the start by the same."""
    from scipy.spatial.transform import Rotation

    start = path.start
    pieces = list(path.segments) if lifts is None else _pieces(path)
    smaller = [piece.mapped(size * np.eye(3), (1 - size) * start) for piece in pieces]
    if lifts is not None:
        R = Rotation.from_rotvec(size * lifts)
        turns = (R[1:] * R[:-1].inv()).as_rotvec()
        smaller = [piece.evenly(turn) for piece, turn in zip(smaller, turns, strict=True)]
    return replace(path, segments=tuple(smaller))
