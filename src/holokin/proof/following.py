"""`hk.follow`: a path followed by a strategy, with a proof or without."""

from __future__ import annotations

from typing import Literal, overload

from .. import motion
from ..base.arguments import typed
from ..base.types import ArrayLike
from ..errors import ArgumentError
from ..motion.follow_path import Following
from ..motion.trajectory import Trajectory
from ..path.synchronized_paths import AnyPath
from ..strategies import Strategy
from .certificate import Certificate
from .certified_following import follow_certified


@overload
def follow(
    strategy: Strategy, path: AnyPath, q0: ArrayLike, *, samples: int = 500, cycles: int = 1,
    method: Following | None = None, limits: bool = True, native: bool = False, certified: Literal[False] = False,
) -> Trajectory: ...  # fmt: skip


@overload
def follow(
    strategy: Strategy, path: AnyPath, q0: ArrayLike, *, samples: int = 500, cycles: int = 1,
    method: Following | None = None, limits: bool = True, native: bool = False, certified: Literal[True],
) -> tuple[Trajectory, Certificate]: ...  # fmt: skip


@typed
def follow(
    strategy: Strategy, path: AnyPath, q0: ArrayLike, *, samples: int = 500, cycles: int = 1,
    method: Following | None = None, limits: bool = True, native: bool = False, certified: bool = False,
) -> Trajectory | tuple[Trajectory, Certificate]:  # fmt: skip
    """Follow a path from a start posture.

    Args:
        samples: steps a cycle, at least; corners of the path are always hit.
        cycles: runs of a closed path.
        method: "velocity" integrates dq = G x' by fixed-step RK4, as the paper does; "leaf" solves
            [f(q) - x; g(q) - c] = 0 at every sample, for a `HolonomicStrategy`. By default "leaf" for those,
            else "velocity".
        limits: stop at joint limits; False ignores them.
        native: build native code at once, a second's work, for a strategy that will follow many short paths; else it
            is built where a path has many steps.
        certified: prove first that on the leaf the joints are one smooth function along the path, and follow it within
            the proven cells: no step can go to another branch. For a `HolonomicStrategy`.

    The orientation targets are the path's turns applied to its own rotation at the start, or, where it has none, to the
    tool's orientation at q0; positions are the path's. What the task leaves free of them moves no joint.

    Returns:
        A trajectory; with certified=True (trajectory, certificate).

    Raises:
        StartError: the tool at q0 is not at the start of the path; `approach` goes there.
        JointLimitError: q0 is outside the limits.
        OpenPathError: several cycles of an open path, or, with certified=True, of one that is not shown to bring the
            joints back. ArgumentError, ShapeError, NotFiniteError: bad arguments.
        PathError (LimitReachedError, OutOfReachError, PathSingularityError, BranchError, TrackingError): could not
            be followed to its end; `.trajectory` holds what was computed.
        NotCertifiedError: not all of the path is proven; `.trajectory` and `.certificate` hold what is.
    """
    if not certified:
        return motion.follow(
            strategy, path, q0, samples=samples, cycles=cycles, method=method, limits=limits, native=native
        )
    if method not in (None, "leaf"):
        raise ArgumentError("method", method, "a proof is about a leaf: leave it out")
    return follow_certified(strategy, path, q0, samples=samples, cycles=cycles, limits=limits)
