"""`certify`: the proof that the joints on a leaf are one function over a path, or over a box of tool poses."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import NoProofError
from ..base.sure_digits import at_least, share_text
from ..base.types import ArrayLike, Vector, joined, whole
from ..path.synchronized_paths import AnyPath
from ..path.workspaces import Workspace
from ..robot import LinkShape, Robot, start_posture
from ..strategies import HolonomicStrategy, Strategy
from ..symbolic.intervals import Interval
from .anchors import anchored, at_start
from .box_proof import PoseRegion
from .cell_search import NOWHERE, Domain, covered, halves
from .certificate import COVERED, Certificate, Covered, Extent, Revisit, least_determinant
from .clear_cells import ClearCells
from .demands import Demands
from .equation import Equation
from .kept_apart import CLEARANCE, kept_apart
from .kept_cells import KeptCells
from .lowering import lowered
from .path_postures import walked
from .path_proof import Pathway
from .region_growth import grown
from .revisits import Revisits

SAMPLES = 256
"""Samples of the path that the predictors start from."""

ROUNDS = 12
"""Times that cells which could not be glued are halved."""


@typed
def certify(
    strategy: Strategy,
    where: AnyPath | Workspace,
    q0: ArrayLike,
    *,
    limits: bool = True,
    clear_of: Sequence[LinkShape] | None = None,
    floor: float | None = None,
    clearance: float = CLEARANCE,
    self_collision: bool = True,
    ignore: Sequence[tuple[str, str]] = (),
    shapes_of: Robot | None = None,
    budget: int = 20_000,
    keep_in: str | FilePath | None = None,
    say: Callable[[str], None] = lambda _text: None,
) -> Certificate:
    """Prove that on the leaf through q0 the joints are one function of the tool pose in a box, or the place on a path.

    It is smooth, on a path between corners. Of a path it is shown, besides, that the joints return with the tool: where
    the path closes, and where it crosses or follows itself. If not, `extent` is ELSEWHERE, with the drift in `revisit`,
    or RETURN; `covered` is True.

    E(q, x) = [f(q) - x; g(q) - c] = 0 has, for every pose x, exactly one root in a tube about predicted joints,
    [J; J_g] is regular there, and no joint leaves its limits: by the theorem of Newton and Kantorovich on cells that
    cover all poses, in interval arithmetic whose bounds hold all rounding. The theorem is about the model: the robot's
    constants as doubles. Of a constraint with auxiliary unknowns, as `stationary`, q holds these, too.

    Args:
        where: a path, which begins at the tool's pose at q0; or a workspace that is a box (`workspace(box=...)`), with
            its tilt and spin: of turns a box is covered that holds them. What the task leaves free of the box, as a
            spin, is taken from q0.
        limits: prove, too, that the joints stay within their limits.
        clear_of: prove, too, that no link comes nearer than `clearance` to these obstacles (`hk.obstacle`), to
            the floor, or to another link; [] for the floor and the links alone. The pairs are those of `check`. Of
            meshes it is said of their convex hulls, and of a robot without shapes of `with_capsules`.
        floor: height of the floor z [m] in the frame of the base; None for no floor.
        clearance: the distance to prove [m].
        self_collision: whether links are held against each other.
        ignore: pairs of names that may touch: of two links, of a link and an obstacle, or of a link and "floor".
        shapes_of: the same robot with other shapes, as of `with_shape` or `with_capsules`; by default the strategy's.
        budget: cells that may be examined.
        keep_in: a file that keeps the cells as they are examined. Where it is there already, of the same question, the
            proof goes on with them, and ends with the same certificate; with another `budget`, as far as they serve.
        say: hears of the progress.

    Returns:
        A certificate; where something could not be proven its `extent` says why, `where` the place, and what it holds
        was proven up to there.

    Raises:
        NoProofError: a strategy without leaves, or whose leaves a differential equation carries. ArgumentError: no box;
            shapes of which no proof can be; `keep_in` is of another question. WriteError: it cannot be written.
        ExpressionError: an operation without a rule for intervals. StartError, JointLimitError; of a leaf on which not
        even a first step is possible SingularityError, BranchError.
    """
    began, ended = time.perf_counter(), (Extent.WHOLE, "")
    strategy, start = provable(strategy), start_of(strategy, q0, limits)
    budget = whole("budget", budget)
    if isinstance(where, Workspace):
        domain: Domain = PoseRegion.of(strategy, where, start)
    else:
        postures, extent, stop = walked(strategy, where, start, SAMPLES)
        ended = extent, stop
        domain = Pathway.of(strategy, where, postures, SAMPLES)
    clear = kept_apart(strategy, start, clear_of, floor, clearance, self_collision, ignore, shapes_of)
    asked = demands(strategy, limits, clear)
    with KeptCells.opened(keep_in, lambda: question(domain, start, asked)) as kept_cells:
        return certificate(where, domain, start, asked, budget, say, began, ended, kept_cells)


def question(domain: Domain, start: Vector, asked: Demands) -> dict[str, Any]:
    """All that decides what is proven, but for the budget: the equation, the start, the poses, limits and shapes."""
    equation, first = domain.equation, domain.first()
    n, d, given = equation.n, equation.d, domain.given(np.unique(first.piece))
    inputs = [*range(n + d + given.shape[1]), *[0.0] * d, *[1.0] * d]
    inputs += range(n + d + given.shape[1], n + d + given.shape[1] + len(domain.c))
    limits, clear = asked.limits, asked.clear
    arrays = (start, domain.c, given, first.low, first.high, first.rho, *(limits or ()))
    return {
        "equation": lowered(equation.operations, inputs, [*equation.angular, *[False] * equation.positive]),
        "hashes": [hashlib.sha256(np.ascontiguousarray(a).tobytes()).hexdigest() for a in arrays],
        "clear": None if clear is None else clear.described(), "partial": domain.partial, "slack": domain.slack,
    }  # fmt: skip


def provable(strategy: Strategy) -> HolonomicStrategy:
    """The strategy, of whose leaves something can be proven. Raises: NoProofError."""
    if not isinstance(strategy, HolonomicStrategy):
        raise NoProofError(strategy.name, f"it has no leaves: {HolonomicStrategy.cure}")
    if strategy.constraint.looped is not None:
        cure = "a differential equation carries its leaves: certify the polynomial hk.strategies.fitted(strategy, Q)"
        raise NoProofError(strategy.name, cure)
    return strategy


def start_of(strategy: Strategy, q0: ArrayLike, limits: bool) -> Vector:
    """A start posture (n,). Raises: StartError; JointLimitError: with limits, it is beyond them."""
    return start_posture(strategy.task.robot, q0, limits)


def demands(strategy: HolonomicStrategy, limits: bool, clear: ClearCells | None) -> Demands:
    """What is asked of the joints, and of shapes."""
    robot = strategy.task.robot
    return Demands(Interval(robot.lower, robot.upper) if limits else None, clear)


def certificate(
    where: AnyPath | Workspace, domain: Domain, start: Vector, asked: Demands, budget: int, say: Callable[[str], None],
    began: float, ended: tuple[Extent, str] = (Extent.WHOLE, ""), kept_cells: KeptCells = NOWHERE,
) -> Certificate:  # fmt: skip
    """What can be proven over a domain. ended: why and where the postures of a path ended early."""
    strategy = domain.equation.strategy
    robot = strategy.task.robot
    found = _glued(domain, asked, budget, say, kept_cells)
    if asked.clear is not None:
        say(f"{len(found):,} cells proven, the least distances")
        found = replace(found, findings=asked.clear.sharpened(found.cells, found.findings))
    extent, place = found.extent, domain.place(found)
    if extent is Extent.WHOLE and ended[0] is not Extent.WHOLE:
        extent, place = ended
    closed = extent is Extent.WHOLE and not isinstance(where, Workspace) and where.closed
    anchors = anchored(domain, found, start, closed)
    begun = at_start(domain, anchors, start)
    if extent is Extent.WHOLE and not begun:
        extent, place = Extent.APART, "the start"
    revisit = None
    if extent is Extent.WHOLE and isinstance(domain, Pathway):
        revisits = Revisits(domain, found)
        extent, revisit = revisits.end() if closed and anchors.turns is None else revisits.anywhere()
    turns, gap = (np.zeros(robot.n), np.inf) if anchors.turns is None else (anchors.turns[: robot.n], anchors.gap)
    low, high = _hull(found, start)
    to_limit = np.minimum(low - robot.lower, robot.upper - high)
    determinant = least_determinant(found.findings)
    title, boxes = f"{strategy.name}, {strategy.task.name}", found.boxes
    share = float(domain.shares(boxes.low, boxes.high).sum()) if isinstance(domain, PoseRegion) else 1.0
    pieces = domain.given(np.arange(1 if found.boxes.piece.size == 0 else int(found.boxes.piece.max()) + 1))
    about = f"{strategy.name!r} for the task {strategy.task.name!r}"
    theorem = _theorem(
        about,
        where,
        domain.equation,
        extent,
        place,
        found,
        determinant,
        asked,
        to_limit,
        turns,
        gap,
        revisit,
        share,
        begun,
    )
    return Certificate(
        title, theorem, extent, place, found, low, high, determinant, to_limit, turns, gap,
        time.perf_counter() - began, domain.equation, domain.c, anchors, asked, pieces, revisit, where,
    )  # fmt: skip


def _theorem(
    title: str, where: AnyPath | Workspace, equation: Equation, extent: Extent, place: str, found: Covered,
    determinant: float, asked: Demands, to_limit: Vector, turns: Vector, gap: float, revisit: Revisit | None,
    proven: float, begun: bool,
) -> str:  # fmt: skip
    if not len(found):
        return f"Nothing is proven: at {place or 'the start'} {extent.cause}."
    with_others, q = "", ""
    if equation.n > equation.joints:
        with_others, q = ", taken with the auxiliary unknowns of the constraint,", ", q the joints and these unknowns"
    all_of_it, one = extent in COVERED, equation.strategy.task.frames == 1
    if isinstance(where, Workspace):
        share = f"the cells that are joined, {share_text(proven)} of {where},"
        function, about = "smooth function of the pose", f"every pose of {where if all_of_it else share}"
    else:
        function = "continuous function of the place, smooth between corners of the path"
        about = f"every place {'on the path' if all_of_it else 'of the path up to there'}"
    parts = [
        f"on the leaf of {title} through the start, {about} has exactly one posture{with_others} in the tube of its "
        f"cell ({len(found)} cells); this posture is a {function}, with |det {equation.derivative}| "
        f">= {at_least(determinant, 2)}{q}"
    ]
    if asked.limits is not None and np.isfinite(to_limit).any():
        parts.append(f"every joint stays {at_least(float(to_limit.min()), 2)} or more (rad or m) from its limits")
    turned = f" but for the whole turns {turns.astype(int).tolist()}" if turns.any() else ""
    if asked.clear is not None:
        parts.append(asked.clear.told(found.findings.apart))
    if np.isfinite(gap):
        parts.append(f"at the end of the closed path the joints are those of its beginning{turned}")
    if extent is Extent.WHOLE and not isinstance(where, Workspace):
        pose, poses = ("a tool pose", "the tool pose") if one else ("the tools' poses", "the tools' poses")
        again = "whole turns apart at most" if turned else "the same"
        parts.append(f"wherever the path comes back to {pose}, the joints are {again}: a function of {poses} on it")
    said = "; ".join(parts)
    if extent is Extent.WHOLE:
        return f"{said[0].upper()}{said[1:]}."
    if revisit is not None:
        return f"The joints are no function of the tool pose here: {revisit.told(equation)}; but {said}."
    said += "" if begun else "; the pose of the start is not proven"
    return f"Not all is proven, since {f'at {place} ' if place else ''}{extent.cause}; but {said}."


def _hull(found: Covered, q0: Vector) -> tuple[Vector, Vector]:
    if not len(found):
        return q0, q0
    return found.findings.low.min(axis=0), found.findings.high.max(axis=0)


def _glued(domain: Domain, asked: Demands, budget: int, say: Callable[[str], None], kept: KeptCells) -> Covered:
    """Cells over all of a domain, halved until neighbours share roots; or those that hang together."""
    before = ""

    def told(count: int, spent: int, share: float) -> None:
        again = f", {kept.resumed:,} of them before" if kept.resumed else ""
        say(f"{before}{share:.0%} proven by {count:,} cells, {spent:,} of at most {budget:,} examined{again}")

    if isinstance(domain, PoseRegion) and domain.partial:
        return grown(domain, asked, budget, told, kept)
    found = domain.arranged(covered(domain, domain.first(), asked, budget, told, kept))
    for i in range(ROUNDS):
        say(f"{len(found):,} cells proven, joining them")
        apart = domain.unglued(found)
        if not (domain.goes_on(found.extent) and apart.any()):
            break
        before = f"round {i + 2}, of the {int(apart.sum()):,} cells that are not joined yet: "
        parts = halves(found.boxes, found.cells, found.cells.rho / 2, apart, np.isfinite(found.findings.eta))
        found = domain.arranged(_both(found.only(~apart), covered(domain, parts, asked, budget, told, kept)))
    return domain.connected(found)


def _both(one: Covered, other: Covered) -> Covered:
    """The cells of both, ended where the first of them is."""
    ends = [(c.stopped, c.extent) for c in (one, other) if c.stopped is not None]
    stopped, extent = min(ends, key=lambda end: end[0], default=(None, Extent.WHOLE))
    boxes, cells, findings = (joined(getattr(one, f), getattr(other, f)) for f in ("boxes", "cells", "findings"))
    return Covered(boxes, cells, findings, extent, stopped)
