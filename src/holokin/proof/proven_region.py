"""`unique_region`: tool poses over which the joints on a leaf are proven to be one function of the pose.

Where a leaf folds back, or round a cusp, one tool pose has several postures of it. Cells of poses, each with one root
of the leaf's equation, which neighbours share, are one function of the pose however they lie: no loop of the tool
inside them leads to other joints. Theory 7.2, 7.3
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path as FilePath
from typing import Any, Literal

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.poses import PoseLike, pose_from, tool_poses
from ..base.tolerances import TOLERANCES
from ..base.types import Array, ArrayLike, Flags, Indices, Matrix, NoTruthValue, Value, Vector, kept, whole
from ..base.units import at_least, percentages
from ..motion.checks import PairDistance, Scene
from ..motion.ik import InverseKinematics, InverseStatus, ik
from ..motion.ik.closed_leaf import ClosedBranch
from ..motion.ik.inverse_function import leads_to
from ..path.workspaces import PoseRange, workspace
from ..robot import reach, start_posture
from ..strategies import HolonomicStrategy, Strategy
from ..strategies.tasks.task import of_one_tool
from .box_proof import PoseRegion
from .cell_search import Demands, Extent, KeptCells
from .certificate import Certificate, clear_cuts, left_open, partition
from .certify_leaf import certificate, demands, provable, question
from .clear_cells import ClearCells
from .kept_apart import gap_distances, looked_at, short_of
from .signed_box import SignedBox, signed_box, signed_branch

# --- A large box of tool poses about a start: grown where samples are regular, made smaller until it is proven.

STEPS = 8
"""Samples from the start to each side of what is looked at."""


def _largest_box(strategy: HolonomicStrategy, q0: Vector, tilt: float, spin: float, asked: Demands) -> PoseRange:
    """A box that looks regular: from the start's pose, side by side, as long as all samples of a new layer do."""
    from scipy.spatial.transform import Rotation

    # Samples in the largest box of regular lines, in the middle orientation and at the ends of tilt and spin.
    T = strategy.task.pose(q0)
    cuts = [
        T[axis, 3] + np.concatenate([-low * np.arange(STEPS, 0, -1), high * np.arange(STEPS + 1)]) / STEPS
        for axis, (low, high) in enumerate(_spans(strategy, q0, asked))
    ]
    points = np.stack(np.meshgrid(*cuts, indexing="ij"), axis=-1).reshape(-1, 3)
    turns = np.vstack([np.zeros(3), *(sign * np.diag([tilt, tilt, spin]) for sign in (1, -1))])
    good = np.ones(len(points), dtype=bool)
    for R in T[:3, :3] @ Rotation.from_rotvec(turns[np.r_[True, turns[1:].any(axis=1)]]).as_matrix():
        good[good] = _sound(strategy, q0, pose_from(points[good], R), asked)
    solid = good.reshape([len(c) for c in cuts])
    # Layer by layer, each on the shortest side that can grow.
    low, high = np.full(3, STEPS), np.full(3, STEPS)
    while True:
        grown = []
        for axis, (side, end) in product(range(3), ((low, -1), (high, 1))):
            place = side[axis] + end
            layer = [slice(a, b + 1) for a, b in zip(low, high, strict=True)]
            layer[axis] = slice(place, place + 1)
            if 0 <= place < solid.shape[axis] and solid[tuple(layer)].all():
                grown.append((cuts[axis][high[axis]] - cuts[axis][low[axis]], axis, end))
        if not grown:
            break
        _, axis, end = min(grown)
        (low if end < 0 else high)[axis] += end
    ends = np.array([(cuts[k][low[k]], cuts[k][high[k]]) for k in range(3)])
    return _box(ends, T[:3, :3], tilt, spin)


def _proven_box(
    strategy: HolonomicStrategy,
    q0: Vector,
    box: PoseRange,
    asked: Demands,
    signed: ClosedBranch | None,
    budget: int,
    progress: Callable[[str], None],
) -> tuple[Certificate | SignedBox, PoseRegion, PoseRange]:
    """The certificate of a box, or of a smaller one about the start: the first of 16 that is proven, or the last."""
    tool, began, left = strategy.task.pose(q0)[:3, 3], time.perf_counter(), 16
    while True:
        # The first cells may take 0.4 of the budget, since some are halved.
        left -= 1
        if signed is not None:
            proof = signed_box(strategy, box, q0, signed, asked.limits, budget, progress)
            cells, stop = proof.region, proof.stop
        else:
            cells = PoseRegion.of(strategy, box, q0)
            count = int(np.prod([len(cuts) - 1 for cuts in cells.grid]))
            if count > 0.4 * budget and left:
                box = _about(box, tool, max(0.5, (0.4 * budget / count) ** (1 / 3)))
                continue
            proof = certificate(box, cells, q0, asked, budget, progress, began)
            stop = cells.stop(proof.proven)
        if proof.whole or not left:
            return proof, cells, box
        progress(f"{box}: {proof.cause}")
        box = _about(box, tool, 0.8) if proof.extent is Extent.BUDGET else _cut(box, tool, stop)


def _spans(strategy: HolonomicStrategy, q0: Vector, asked: Demands) -> Matrix:
    """How far [m] the tool goes along each axis of the base, (3, 2): to either side, while all looks regular."""
    T, far = strategy.task.pose(q0), min(2 * reach(strategy.task.robot), 4.0)
    t = np.linspace(0.0, far, 60)[1:]
    spans = np.zeros((3, 2))
    for axis, side in product(range(3), range(2)):
        points = np.tile(T[:3, 3], (len(t), 1))
        points[:, axis] += (-t, t)[side]
        good = _sound(strategy, q0, pose_from(points, T[:3, :3]), asked)
        last = int(np.argmin(good)) if not good.all() else len(t)
        spans[axis, side] = t[last - 1] if last else t[0] / 4
    return spans


def _sound(strategy: HolonomicStrategy, q0: Vector, poses: Array, asked: Demands) -> Flags:
    """(k,) True for poses that are reached, regular, and as asked with some room."""
    if not len(poses):
        return np.zeros(0, dtype=bool)
    solutions, robot = ik(strategy, q0, limits=False).batch(poses), strategy.task.robot
    good = solutions.reached.copy()
    q = solutions.q[good]
    # Cells are many where rcond is small.
    sound = np.array([strategy.gain(posture)[1] for posture in q]) >= 0.15 * strategy.gain(q0)[1]
    # Between samples the joints go farther, and shapes come nearer: 0.02 rad, m; a joint that is nearer to its limit at
    # the start keeps half as far from it as there.
    if asked.limits is not None:
        room = np.minimum(0.02, np.minimum(q0 - robot.lower, robot.upper - q0) / 2) - TOLERANCES.limit
        sound &= ((q >= robot.lower + room) & (q <= robot.upper - room)).all(axis=1)
    if asked.clear is not None and len(q):
        sound &= (asked.clear.distances(q) >= asked.clear.wanted + 0.02).all(axis=1)
    good[good] = sound
    return good


def _ends(box: PoseRange) -> Matrix:
    return np.column_stack([box.solid.center - box.solid.half, box.solid.center + box.solid.half])


def _box(ends: Matrix, R: Matrix, tilt: float, spin: float) -> PoseRange:
    low, high = ends.T
    return workspace(box=((low + high) / 2, (high - low) / 2), rotation=R, tilt=tilt, spin=spin)


def _about(box: PoseRange, tool: Vector, share: float) -> PoseRange:
    """The box, smaller by a share about the start."""
    return _box(tool[:, None] + share * (_ends(box) - tool[:, None]), box.rotation, box.tilt, box.spin)


def _cut(box: PoseRange, tool: Vector, stop: Vector | None) -> PoseRange:
    """The box less what is beyond 0.9 of the way to where the proof failed: the side is cut that costs least of it.

    All of it is made smaller where less than 0.3 would be left.
    """
    ends, away = _ends(box), np.zeros(3) if stop is None else stop - tool
    side = (away > 0).astype(int)
    lengths = np.abs(0.9 * away) + np.abs(ends[np.arange(3), 1 - side] - tool)
    shares = np.where(away != 0, lengths / (ends[:, 1] - ends[:, 0]), 0.0)
    axis = int(np.argmax(shares))
    if not 0.3 < shares[axis] < 1:
        return _about(box, tool, 0.8)
    ends[axis, side[axis]] = tool[axis] + 0.9 * away[axis]
    return _box(ends, box.rotation, box.tilt, box.spin)


# --- The parts of a box that are not proven, and why.

CAUSES = ("not proven", "another posture", "beyond a joint limit", "the leaf ends", "too near")
"""What the poses of a workspace are that are not in its region."""

SAID = ("not proven", "reached with other joints", "beyond a joint limit", "not reached", "too near to something")
"""The same in a sentence."""

UNPROVEN, ANOTHER, LIMIT, END, NEAR = range(len(CAUSES))


@dataclass(frozen=True, eq=False)
class Asked(Value):
    """Of tool poses (k, 4, 4): why each is not proven (k,), of `CAUSES`; the postures (k, n) of the leaf there; the gap
    that is short of what is asked by most (k,), its distance [m], and by how much [m]: negative where it is not."""

    poses: Array
    cause: Indices
    q: Matrix
    gap: Indices
    distance: Vector
    short: Vector


def _asked_about(clear: ClearCells | None, poses: Array, ik: InverseKinematics) -> Asked:
    """What the posture of the leaf is like at tool poses that are not proven."""
    solutions, k = ik.batch(poses), len(poses)
    cause = np.select([solutions.reached, solutions.status == InverseStatus.LIMIT], [UNPROVEN, LIMIT], END)
    gap, distance, short = np.zeros(k, dtype=int), np.full(k, np.inf), np.full(k, -np.inf)
    rows = np.flatnonzero(solutions.reached)
    if clear is not None and len(rows):
        distances = gap_distances(clear, solutions.q[rows])
        lacks = short_of(clear, distances)
        worst = lacks.argmax(axis=1)
        each = np.arange(len(rows)), worst
        gap[rows], distance[rows], short[rows] = worst, distances[each], lacks[each]
        cause[short > 0] = NEAR
    return Asked(poses, cause, solutions.q, gap, distance, short)


@dataclass(frozen=True, eq=False)
class OpenParts(Value):
    """The parts of a box that are not proven, as boxes low <= u <= high (k, d) of its parameters, -1 to 1 across it.

    A part is "too near", and so refuted, where a posture of the leaf was found in it at which things are nearer than
    was asked: `found` holds it. Another part is called after the pose in its middle.
    """

    low: Matrix
    high: Matrix
    cause: Indices
    """(k,) of `CAUSES`."""
    found: tuple[PairDistance | None, ...]
    volumes: Vector
    """(k,) shares of the workspace: of its positions by volume, of its turns by the Haar measure."""

    def __len__(self) -> int:
        return len(self.low)

    @property
    def shares(self) -> dict[str, float]:
        """Of the box the shares that are not proven, by cause."""
        return {name: float(self.volumes[self.cause == i].sum()) for i, name in enumerate(CAUSES)}

    def cause_at(self, u: Matrix) -> Indices:
        """(k,) the cause of the part that holds a place u (k, d), -1 where none does."""
        cause = np.full(len(u), -1)
        near = ((self.low <= u.max(axis=0)) & (self.high >= u.min(axis=0))).all(axis=1) if len(u) else []
        for i in np.flatnonzero(near):
            cause[((self.low[i] <= u) & (u <= self.high[i])).all(axis=1)] = self.cause[i]
        return cause

    @property
    def worst(self) -> PairDistance | None:
        """The posture that is short of what was asked by most; None where none was found."""
        postures = (posture for posture in self.found if posture is not None)
        return max(postures, key=lambda posture: posture.wanted - posture.distance, default=None)


def _open_parts(
    certificate: Certificate | SignedBox,
    region: PoseRegion,
    ik: InverseKinematics,
    elsewhere: Callable[[Matrix, Vector], bool],
) -> OpenParts:
    """Cut the rest of a box into parts that are no larger than the first cells, and ask what is in each.

    elsewhere: whether a posture (n,) at a tool pose (4, 4) is not the one that continues what is proven.
    """
    boxes, d, clear = certificate.boxes, region.equation.d, certificate.demands.clear
    tree = partition(boxes.low, boxes.high, [(-1.0, 1.0)] * d, lambda i: i + 1)
    low, high = _cut_up(*left_open(tree, [(-1.0, 1.0)] * d), region.grid)
    # The postures in the middle of each part, and at corners of it: at most 9, and about 24,000 of all parts.
    k, corners = len(low), np.array(list(product((-1.0, 1.0), repeat=d)))
    most = max(1, min(9, 24_000 // max(k, 1)))
    chosen = np.random.default_rng(0).permutation(len(corners))[: most - 1]
    ends = np.vstack([np.zeros((1, d)), corners[np.sort(chosen)]])
    places, count = ((low + high) / 2)[:, None] + ends * ((high - low) / 2)[:, None], len(ends)
    asked = _asked_about(clear, region.poses_at(places.reshape(k * count, d)), ik)
    # A part is too near by the worst of them that continues what is proven; else it is as its middle.
    cause = asked.cause[::count].copy()
    cause[cause == NEAR] = UNPROVEN
    too_near: list[PairDistance | None] = [None] * k
    for i in range(k):
        rows = np.arange(i * count, (i + 1) * count)
        near = rows[asked.cause[rows] == NEAR]
        for j in near[np.argsort(-asked.short[near])].tolist():
            if clear is not None and not elsewhere(asked.poses[j], asked.q[j]):
                gap, distance = int(asked.gap[j]), float(asked.distance[j])
                too_near[i] = looked_at(clear).pair_at(region.equation.strategy.task, asked.q[j], gap, distance)
                cause[i] = NEAR
                break
        if cause[i] == UNPROVEN and elsewhere(asked.poses[rows[0]], asked.q[rows[0]]):
            cause[i] = ANOTHER
    return OpenParts(low, high, cause, tuple(too_near), region.shares(low, high))


def _cut_up(low: Matrix, high: Matrix, grid: list[Vector]) -> tuple[Matrix, Matrix]:
    """Boxes (k, d), cut where a grid has its cuts; by fewer cuts of it where all of it would have over 8,000 parts."""
    stride = 1
    while np.prod([np.ceil((len(cuts) - 1) / stride) for cuts in grid]) > 8_000:
        stride += 1
    for axis, cuts in enumerate(grid):
        for cut in cuts[1:-1:stride]:
            across = (low[:, axis] < cut) & (cut < high[:, axis])
            below, above = high[across], low[across]
            below[:, axis] = above[:, axis] = cut
            low, high = np.vstack([low[~across], low[across], above]), np.vstack([high[~across], below, high[across]])
    return low, high


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
    certificate: Certificate | SignedBox
    cells: PoseRegion

    @property
    def whole(self) -> bool:
        """True where all of the workspace belongs to it."""
        return self.certificate.whole

    @property
    def share(self) -> float:
        """The certified share of the workspace, 0 to 1: of positions by volume, of turns by the Haar measure."""
        return 1.0 if self.whole else min(1.0, self.certificate.share)

    @property
    def holds_start(self) -> bool:
        """True where the pose of q0 belongs to it, with the posture q0."""
        p, R = self.strategy.task._place(self.q0)
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
            q[inside], alone[inside] = self.certificate._near(cell[inside], u[inside])
        return q, alone

    @cached_property
    def rest(self) -> dict[str, float]:
        """Of the workspace the shares that do not belong to it, by cause: `CAUSES`.

        Together they are what is left of `share`, which is exact; what each of them has of it tell `SAMPLED` poses.
        """
        causes = self._sampled[0]
        names = CAUSES if self.certificate.demands.clear is not None else CAUSES[:NEAR]
        counts = np.bincount(causes[causes >= 0], minlength=len(names))[: len(names)]
        counts[UNPROVEN] += not counts.any()
        return {name: (1 - self.share) * count / float(counts.sum()) for name, count in zip(names, counts, strict=True)}

    def causes(self, poses: Array) -> Indices:
        """(k,) of tool poses (k, 4, 4): -1 where they belong to it, else which of `CAUSES`.

        The postures of the others are those of `ik(pose)`, from q0 straight to the pose: "another posture" where one
        from the nearest pose of the region is another one; "too near" where things are nearer there than was asked.
        """
        return self._causes(poses)[0]

    def _causes(self, poses: Array) -> tuple[Indices, PairDistance | None]:
        """The same, and the pair that has the least room at the poses that are too near or not proven."""
        causes, others = np.full(len(poses), -1), np.flatnonzero(~self.contains(poses))
        clear = self.certificate.demands.clear
        asked = _asked_about(clear, poses[others], self._ik)
        for i, k in enumerate(others):
            same = asked.cause[i] in (LIMIT, END) or not self._elsewhere(poses[k], asked.q[i])
            causes[k] = asked.cause[i] if same else ANOTHER
        of_leaf = np.flatnonzero(np.isin(causes[others], (NEAR, UNPROVEN)) & np.isfinite(asked.distance))
        if clear is None or not len(of_leaf):
            return causes, None
        i = of_leaf[int(np.argmax(asked.short[of_leaf]))]
        gap, distance = int(asked.gap[i]), float(asked.distance[i])
        return causes, looked_at(clear).pair_at(self.strategy.task, asked.q[i], gap, distance)

    @cached_property
    def _sampled(self) -> tuple[Indices, PairDistance | None]:
        return self._causes(self.workspace.poses(SAMPLED))

    @property
    def nearest(self) -> PairDistance | None:
        """What comes nearest in the rest, of `SAMPLED` poses: of the postures that are too near, or else not proven."""
        return self._sampled[1]

    def parts_at(self, poses: Array) -> Indices:
        """(k,) of tool poses (k, 4, 4): -1 where they belong to it, else which of `CAUSES` their part has."""
        cell, u = self._cell_of(poses[:, :3, 3], poses[:, :3, :3])
        cause = self.parts.cause_at(u)
        return np.where(cell >= 0, -1, np.where(cause >= 0, cause, UNPROVEN))

    @cached_property
    def parts(self) -> OpenParts:
        """The parts of the workspace that do not belong to it, and why: with the postures that are too near."""
        return _open_parts(self.certificate, self.cells, self._ik, self._elsewhere)

    @cached_property
    def _ik(self) -> InverseKinematics:
        return ik(self.strategy, self.q0, limits=self.certificate.limits is not None)

    def _elsewhere(self, pose: Matrix, q: Vector) -> bool:
        """Whether the leaf, followed from the nearest cell to a pose, has another posture there than q."""
        u = self.cells.places(pose[None, :3, 3], pose[None, :3, :3])[0]
        if not (len(self.certificate) and np.isfinite(u).all()):
            return False
        cell = np.array([self._middles.query(u)[1]])
        begin = self.certificate._near(cell, self._middles.data[cell])[0][0]
        return not leads_to(ik(self.strategy, self.q0, limits=False), pose, begin, q)

    @property
    def sentence(self) -> str:
        """What is proven, and of a part of a workspace what the rest is."""
        # What holds where it is proven.
        proof, function, limits = self.certificate, "the tool's pose alone decides the joints", ""
        leaf, cells = f"moved by {self.strategy.name!r} from q0", f"proven by {len(proof):,} cells"
        if proof.limits is not None and np.isfinite(proof.to_limit).any():
            room = float(proof.to_limit.min())  # a part may end where a joint is at its limit
            limits = f", at least {at_least(room, 2)}" if room >= 1e-3 else ","
            limits += " within the joint limits"
        clear = proof.demands.clear
        if isinstance(proof, Certificate) and clear is not None and proof.nearest_pair is not None:
            names, bound = proof.nearest_pair
            limits += f", {' and '.join(names)} {clear.as_nearest} at least {at_least(bound)} m apart"
        if self.whole:
            return (
                f"over {self.workspace} {function}, {leaf}{limits}: every closed path of the tool inside returns them "
                f"({cells})"
            )
        # What the rest is.
        causes = {name: share for name, share in self.rest.items() if share}
        proven, *others = percentages([self.share, *causes.values()])
        rest = ", ".join(f"{part} {SAID[CAUSES.index(name)]}" for part, name in zip(others, causes, strict=True))
        rest = f"the rest, by {SAMPLED:,} poses of the box: {rest or 'none of them'}"
        inside = (np.abs(self.cells.place_of(self.q0)) <= 1).all()
        rest += f"; the least room: {self.nearest}" if self.nearest is not None else ""
        rest += "; the pose of q0 is not proven" if inside and not self.holds_start else ""
        if not len(proof):
            return f"nothing is proven over {self.workspace}, {leaf}; {rest}"
        return f"over {proven} of {self.workspace} {function}, {leaf}{limits} ({cells}); {rest}"

    def __str__(self) -> str:
        return self.sentence

    def _cell_of(self, p: Matrix, R: Array) -> tuple[Indices, Matrix]:
        """(cell of each pose (k,), -1 for none; its parameters (k, d))."""
        # The bins of the poses in the box; a pose between two bins is in both.
        u, boxes = self.cells.places(p, R), self.certificate.boxes
        cells = np.full(len(p), -1)
        inside = np.flatnonzero((np.abs(u) <= 1).all(axis=1))
        keys, order = self._bins
        below, above = (self._bins_of(u[inside], side) for side in ("left", "right"))
        tied = (below != above).any(axis=0)
        for upper in product((True, False), repeat=int(tied.sum())):
            chosen = above.copy()
            chosen[:, tied] = np.where(upper, above[:, tied], below[:, tied])
            place = self._keys_of(chosen)
            first, end = np.searchsorted(keys, place, "left"), np.searchsorted(keys, place, "right")
            # One cell of the bin after the other.
            for j in range(int((end - first).max(initial=0))):
                left = np.flatnonzero((first + j < end) & (cells[inside] < 0))
                cell = order[first[left] + j]
                holds = ((boxes.low[cell] <= u[inside[left]]) & (u[inside[left]] <= boxes.high[cell])).all(axis=1)
                cells[inside[left[holds]]] = cell[holds]
        return cells, u

    @cached_property
    def _middles(self) -> Any:
        """A KDTree of the cells' middles."""
        from scipy.spatial import KDTree

        boxes = self.certificate.boxes
        return KDTree((boxes.low + boxes.high) / 2)

    @cached_property
    def _cuts(self) -> list[Vector]:
        """Along each axis where no cell is cut."""
        boxes = self.certificate.boxes
        return [clear_cuts(boxes.low[:, a], boxes.high[:, a]) for a in range(boxes.low.shape[1])]

    @cached_property
    def _bins(self) -> tuple[Indices, Indices]:
        """(sorted bins between the cuts, of all cells; the cells in that order)."""
        boxes = self.certificate.boxes
        keys = self._keys_of(self._bins_of((boxes.low + boxes.high) / 2, "right"))
        order = np.argsort(keys, kind="stable")
        return keys[order], order

    def _bins_of(self, u: Matrix, side: Literal["left", "right"]) -> Indices:
        """(k, d) between which cuts places are."""
        bins = [np.searchsorted(cuts, u[:, axis], side=side) for axis, cuts in enumerate(self._cuts)]
        return np.column_stack(bins).reshape(u.shape)

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
    p0, R0, half = np.split(certificate.pieces[0], [3, 12])
    half, q0 = half[: equation.d], anchors.q[0][: equation.joints]
    cells = PoseRegion(equation, certificate.c, p0, R0.reshape(3, 3), half, q0, anchors.u[0], partial=True)
    return UniqueRegion(equation.strategy, q0, space, certificate, cells)


@typed
def unique_region(
    strategy: Strategy,
    q0: ArrayLike,
    workspace: PoseRange | None = None,
    *,
    tilt: float = 0.0,
    spin: float = 0.0,
    limits: bool = True,
    scene: Scene | None = None,
    budget: int = 20_000,
    keep_in: str | FilePath | None = None,
    progress: Callable[[str], None] = lambda _text: None,
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
        scene: prove, too, that the links keep clear of it, as `certify`.
        budget: cells that may be examined; more give a larger box, and never prove less of one.
        keep_in: of a workspace, a file that keeps the cells, as of `certify`.
        progress: hears how far it is.

    As of `certify`, a strategy whose held joints leave a closed inverse is proven by signs: its region has a
    `SignedBox` for a certificate.

    Raises:
        NoProofError: a strategy without leaves, or whose leaves a differential equation carries. ArgumentError: no box,
            tilt or spin beside a workspace, a task of several frames. SingularityError: it is singular at q0.
        ExpressionError: an operation without a rule for intervals. JointLimitError: with limits, q0 is beyond them.
    """
    of_one_tool(strategy.task, "a region of poses")
    strategy, budget = provable(strategy), whole("budget", budget)
    start = start_posture(strategy.task.robot, q0, limits)
    strategy(start)
    asked = demands(strategy, start, limits, scene)
    signed = signed_branch(strategy, start, limits) if scene is None and keep_in is None else None
    if workspace is None:
        if keep_in is not None:
            raise ArgumentError("keep_in", str(keep_in), "it is of one box: give the workspace, too")
        box = _largest_box(strategy, start, tilt, spin, asked)
        proof, cells, box = _proven_box(strategy, start, box, asked, signed, budget, progress)
        return UniqueRegion(strategy, start, box, proof, cells)
    if tilt or spin:
        raise ArgumentError("tilt and spin", (tilt, spin), "a workspace has its own: hk.workspace(..., tilt=, spin=)")
    if signed is not None:
        proof = signed_box(strategy, workspace, start, signed, asked.limits, budget, progress)
        return UniqueRegion(strategy, start, workspace, proof, proof.region)
    proof, cells = region_by_cells(strategy, start, workspace, limits, scene, budget, keep_in, progress)
    return UniqueRegion(strategy, start, workspace, proof, cells)


def region_by_cells(
    strategy: Strategy, q0: ArrayLike, workspace: PoseRange, limits: bool = True, scene: Scene | None = None,
    budget: int = 20_000, keep_in: str | FilePath | None = None, progress: Callable[[str], None] = lambda _text: None,
) -> tuple[Certificate, PoseRegion]:  # fmt: skip
    """The part of a workspace by cells of joints, whatever the strategy: its certificate can be saved, and verified."""
    began, strategy = time.perf_counter(), provable(strategy)
    start = start_posture(strategy.task.robot, q0, limits)
    asked = demands(strategy, start, limits, scene)
    cells = PoseRegion.of(strategy, workspace, start, partial=True)
    with KeptCells.opened(keep_in, lambda: question(cells, start, asked)) as kept_cells:
        return certificate(workspace, cells, start, asked, budget, progress, began, kept_cells=kept_cells), cells
