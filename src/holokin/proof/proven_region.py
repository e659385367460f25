"""`unique_region`: tool poses over which the joints on a leaf are proven to be one function of the pose.

Where a leaf folds back, or round a cusp, one tool pose has several postures of it. Cells of poses, each with one root
of the leaf's equation, which neighbours share, are one function of the pose however they lie: no loop of the tool
inside them leads to other joints. Theory 7.2, 7.3
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path as FilePath
from typing import Any, Literal

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.poses import PoseLike, tool_poses
from ..base.sure_digits import at_least, percentages
from ..base.types import Array, ArrayLike, Flags, Indices, Matrix, NoTruthValue, Value, Vector, kept, some, whole
from ..motion.ik import InverseKinematics, inverse
from ..motion.ik.quiet_answers import leads_to
from ..path.workspaces import PoseRange
from ..robot import LinkShape, Robot
from ..strategies import HolonomicStrategy, Strategy
from ..strategies.tasks.task import of_one_tool
from .box_proof import PoseRegion
from .certificate import Certificate
from .certify_leaf import certificate, demands, provable, question, start_of
from .kept_apart import CLEARANCE, kept_apart
from .kept_cells import KeptCells
from .largest_box import largest_box, proven_box
from .open_parts import ANOTHER, CAUSES, END, LIMIT, NEAR, UNPROVEN, OpenParts, asked_about, open_parts
from .partition import clear_cuts

ROOM = 1e-3
"""Distance from the joint limits [joint units] that is worth saying: a part may end where a joint is at its limit."""

SAMPLED = 1000
"""Poses of the rest of a workspace that are asked what they are."""


@dataclass(frozen=True, eq=False)
class UniqueRegion(NoTruthValue, Value, ask="`.whole`"):
    """Tool poses over which the joints on the leaf through q0 (n,) are proven to be one function of the pose.

    They are the cells of `certificate`, which fill the box `workspace`, or a part of it that hangs together.
    """

    strategy: HolonomicStrategy
    q0: Vector
    workspace: PoseRange
    certificate: Certificate
    cells: PoseRegion

    @property
    def whole(self) -> bool:
        """True where all of the workspace belongs to it."""
        return self.certificate.whole

    @property
    def share(self) -> float:
        """The certified share of the workspace, 0 to 1: of positions by volume, of turns by the Haar measure."""
        boxes = self.certificate.proven.boxes
        return 1.0 if self.whole else min(1.0, float(self.cells.shares(boxes.low, boxes.high).sum()))

    @property
    def holds_start(self) -> bool:
        """True where the pose of q0 belongs to it, with the posture q0."""
        p, R = self.strategy.task.place(self.q0)
        near, alone = self.near(p[None], R[None])
        return bool(np.linalg.norm(near[0] - self.q0) <= alone[0])

    @typed
    def contains(self, poses: PoseLike) -> Flags:
        """(k,) True for the tool poses (k, 4, 4) that belong to it, whatever the task leaves free of them.

        Raises: ShapeError, ArgumentError.
        """
        given = tool_poses("asked about", poses)
        return self._cell_of(given[:, :3, 3], given[:, :3, :3])[0] >= 0

    def near(self, p: Matrix, R: Array) -> tuple[Matrix, Vector]:
        """Of tool poses, positions (k, 3) and rotations (k, 3, 3): (postures (k, n) near the one that is proven, NaN
        outside; how far about them it is the only one (k,))."""
        cell, u = self._cell_of(p, R)
        n, inside = self.strategy.task.n, cell >= 0
        q, alone = np.full((len(p), n), np.nan), np.zeros(len(p))
        if inside.any():
            those, boxes = cell[inside], some(self.certificate.proven.boxes, cell[inside])
            half = (boxes.high - boxes.low) / 2
            y = (u[inside] - (boxes.low + boxes.high) / 2) / np.where(half > 0, half, 1.0)
            q[inside] = some(self.certificate.cells, those).predicted(y)[:, :n]
            alone[inside] = self.certificate.findings.alone[those]
        return q, alone

    @cached_property
    def rest(self) -> dict[str, float]:
        """Of the workspace the shares that do not belong to it, by cause: `CAUSES`.

        Together they are what is left of `share`, which is exact; what each of them has of it tell `SAMPLED` poses.
        """
        found = self.causes(self.workspace.poses(SAMPLED))
        names = CAUSES if self.certificate.demands.clear is not None else CAUSES[:NEAR]
        counts = np.bincount(found[found >= 0], minlength=len(names))[: len(names)]
        counts[UNPROVEN] += not counts.any()
        return {name: (1 - self.share) * count / float(counts.sum()) for name, count in zip(names, counts, strict=True)}

    def causes(self, poses: Array) -> Indices:
        """(k,) of tool poses (k, 4, 4): -1 where they belong to it, else which of `CAUSES`.

        The postures of the others are those of `ik(pose)`, from q0 straight to the pose: "another posture" where one
        from the nearest pose of the region is another one; "too near" where things are nearer there than was asked.
        """
        out, others = np.full(len(poses), -1), np.flatnonzero(~self.contains(poses))
        asked = asked_about(self.certificate.demands.clear, poses[others], self._ik)
        for i, k in enumerate(others):
            there = asked.cause[i] in (LIMIT, END) or not self._elsewhere(poses[k], asked.q[i])
            out[k] = asked.cause[i] if there else ANOTHER
        return out

    def parts_at(self, poses: Array) -> Indices:
        """(k,) of tool poses (k, 4, 4): -1 where they belong to it, else which of `CAUSES` their part has."""
        cell, u = self._cell_of(poses[:, :3, 3], poses[:, :3, :3])
        out = self.parts.cause_at(u)
        return np.where(cell >= 0, -1, np.where(out >= 0, out, UNPROVEN))

    @cached_property
    def parts(self) -> OpenParts:
        """The parts of the workspace that do not belong to it, and why: with the postures that are too near."""
        return open_parts(self.certificate, self.cells, self._ik, self._elsewhere)

    @cached_property
    def _ik(self) -> InverseKinematics:
        return inverse(self.strategy, self.q0, limits=self.certificate.limits is not None)

    def _elsewhere(self, pose: Matrix, q: Vector) -> bool:
        """Whether the leaf, followed from the nearest cell to a pose, has another posture there than q."""
        boxes, cells = self.certificate.proven.boxes, self.certificate.cells
        u = self.cells.places(pose[None, :3, 3], pose[None, :3, :3])[0]
        if not (len(boxes) and np.isfinite(u).all()):
            return False
        begin = cells.q0[int(self._middles.query(u)[1]), : self.strategy.task.n]
        return not leads_to(inverse(self.strategy, self.q0, limits=False), pose, begin, q)

    @property
    def sentence(self) -> str:
        """What is proven, and of a part of a workspace what the rest is."""
        found = self.certificate
        one, leaf = "the joints are one function of the tool pose", f"on the leaf of {self.strategy.name!r} through q0"
        limits = ""
        if found.limits is not None and np.isfinite(found.to_limit).any():
            room = float(found.to_limit.min())
            limits = (
                f", at least {at_least(room, 2)} within the joint limits"
                if room >= ROOM
                else ", within the joint limits"
            )
        if self.whole:
            return (
                f"over {self.workspace} {one}, {leaf}{limits}: every closed path of the tool inside returns them "
                f"(proven by {len(found):,} cells)"
            )
        causes = {name: share for name, share in self.rest.items() if share}
        proven, *others = percentages([self.share, *causes.values()])
        rest = ", ".join(f"{part} {name}" for part, name in zip(others, causes, strict=True))
        asked = f"the rest, by {SAMPLED:,} poses of the box: {rest or 'none of them'}"
        begun = "; the pose of q0 is not proven" if self._begun and not self.holds_start else ""
        if not len(found):
            return f"nothing is proven over {self.workspace}, {leaf}; {asked}{begun}"
        return (
            f"over {proven} of {self.workspace} {one}, {leaf}{limits} (proven by {len(found):,} cells); {asked}{begun}"
        )

    @property
    def _begun(self) -> bool:
        """Whether the pose of q0 is one of the workspace."""
        return bool((np.abs(self.cells.place_of(self.q0)) <= 1).all())

    def __str__(self) -> str:
        return self.sentence

    def _cell_of(self, p: Matrix, R: Array) -> tuple[Indices, Matrix]:
        """(cell of each pose (k,), -1 for none; its parameters (k, d))."""
        u, boxes = self.cells.places(p, R), self.certificate.proven.boxes
        out = np.full(len(p), -1)
        inside = np.flatnonzero((np.abs(u) <= 1).all(axis=1))
        keys, order = self._bins
        below, above = (self._bins_of(u[inside], side) for side in ("left", "right"))
        tied = (below != above).any(axis=0)
        for upper in product((True, False), repeat=int(tied.sum())):  # a pose between two bins is in both
            chosen = above.copy()
            chosen[:, tied] = np.where(upper, above[:, tied], below[:, tied])
            place = self._keys_of(chosen)
            first, end = np.searchsorted(keys, place, "left"), np.searchsorted(keys, place, "right")
            for j in range(int((end - first).max(initial=0))):
                open_ = np.flatnonzero((first + j < end) & (out[inside] < 0))
                cell = order[first[open_] + j]
                holds = ((boxes.low[cell] <= u[inside[open_]]) & (u[inside[open_]] <= boxes.high[cell])).all(axis=1)
                out[inside[open_[holds]]] = cell[holds]
        return out, u

    @cached_property
    def _middles(self) -> Any:
        """A KDTree of the cells' middles."""
        from scipy.spatial import KDTree

        boxes = self.certificate.proven.boxes
        return KDTree((boxes.low + boxes.high) / 2)

    @cached_property
    def _cuts(self) -> list[Vector]:
        """Along each axis where no cell is cut."""
        boxes = self.certificate.proven.boxes
        return [clear_cuts(boxes.low[:, a], boxes.high[:, a]) for a in range(boxes.low.shape[1])]

    @cached_property
    def _bins(self) -> tuple[Indices, Indices]:
        """(sorted bins between the cuts, of all cells; the cells in that order)."""
        boxes = self.certificate.proven.boxes
        keys = self._keys_of(self._bins_of((boxes.low + boxes.high) / 2, "right"))
        order = np.argsort(keys, kind="stable")
        return keys[order], order

    def _bins_of(self, u: Matrix, side: Literal["left", "right"]) -> Indices:
        """(k, d) between which cuts places are."""
        found = [np.searchsorted(cuts, u[:, axis], side=side) for axis, cuts in enumerate(self._cuts)]
        return np.column_stack(found).reshape(u.shape)

    def _keys_of(self, bins: Indices) -> Indices:
        """(k,) one number each."""
        keys = np.zeros(len(bins), dtype=int)
        for axis, cuts in enumerate(self._cuts):
            keys = keys * (len(cuts) + 1) + bins[:, axis]
        return keys


@typed
def region_of(certificate: Certificate) -> UniqueRegion:
    """The tool poses that the certificate of a box proves: with their `parts`, why it does not prove the others.

    Raises:
        ArgumentError: it is of a path.
    """
    return _region_of(certificate)


@kept
def _region_of(certificate: Certificate) -> UniqueRegion:
    space, anchors, equation = certificate.asked, certificate.anchors, certificate.equation
    if not isinstance(space, PoseRange):
        raise ArgumentError("the certificate", certificate.title, "give one of a box of poses")
    n, d = equation.strategy.task.n, equation.d
    p0, R0, half = np.split(certificate.pieces[0], [3, 12])
    q = anchors.q[0]
    cells = PoseRegion(
        equation, certificate.c, p0, R0.reshape(3, 3), half[:d], q[:n], anchors.u[0], partial=True
    )  # fmt: skip
    return UniqueRegion(equation.strategy, q[:n], space, certificate, cells)


@typed
def unique_region(
    strategy: Strategy,
    q0: ArrayLike,
    workspace: PoseRange | None = None,
    *,
    tilt: float = 0.0,
    spin: float = 0.0,
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
) -> UniqueRegion:
    """Tool poses about q0 over which the joints on its leaf are proven to be one function of the pose.

    Of a workspace, a box, it is the part that can be proven, cell by cell, as far as it hangs together with the pose of
    q0 (or, where the box does not hold that, with its middle): the cells about that pose first, then the largest that
    can be joined to it, until the budget is spent or none is left. Where that pose itself cannot be proven,
    `holds_start` is False and the sentence says so. Without a workspace it is a large box about the pose of q0,
    whole: where samples find the leaf regular and within the limits the box grows, one side after the other, and it is
    made smaller until it is proven. A larger one may exist.

    Args:
        q0: posture (n,) on the leaf.
        workspace: `workspace(box=...)`, with its tilt and spin.
        tilt, spin: of the box that is sought [rad], as of `workspace`; the tool's orientation at q0 is its middle.
        limits: prove, too, that the joints stay within their limits.
        clear_of, floor, clearance, self_collision, ignore, shapes_of: prove, too, that shapes keep apart, as `certify`.
        budget: cells that may be examined; more give a larger box, and never prove less of one.
        keep_in: of a workspace, a file that keeps the cells, as of `certify`.
        say: hears of the progress.

    Raises:
        NoProofError: a strategy without leaves, or whose leaves a differential equation carries. ArgumentError: no box,
            tilt or spin beside a workspace, a task of several frames. SingularityError: it is singular at q0.
        ExpressionError: an operation without a rule for intervals. JointLimitError: with limits, q0 is beyond them.
    """
    of_one_tool(strategy.task, "a region of poses")
    strategy, start, budget = provable(strategy), start_of(strategy, q0, limits), whole("budget", budget)
    strategy(start)
    asked = demands(
        strategy, limits, kept_apart(strategy, start, clear_of, floor, clearance, self_collision, ignore, shapes_of)
    )
    if workspace is None:
        if keep_in is not None:
            cure = "it is of one box: give the workspace, too"
            raise ArgumentError("keep_in", str(keep_in), cure)
        box = largest_box(strategy, start, tilt, spin, asked)
        found, cells, box = proven_box(strategy, start, box, asked, budget, say)
        return UniqueRegion(strategy, start, box, found, cells)
    if tilt or spin:
        raise ArgumentError("tilt and spin", (tilt, spin), "a workspace has its own: hk.workspace(..., tilt=, spin=)")
    began = time.perf_counter()
    cells = PoseRegion.of(strategy, workspace, start, partial=True)
    with KeptCells.opened(keep_in, lambda: question(cells, start, asked)) as kept_cells:
        found = certificate(workspace, cells, start, asked, budget, say, began, kept_cells=kept_cells)
    return UniqueRegion(strategy, start, workspace, found, cells)
