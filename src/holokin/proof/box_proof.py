"""The proof over a box of poses: cells that fill it, glued across their faces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.errors import ArgumentError, BranchError, HolokinError, SingularityError, TrackingError
from ..base.poses import pose_from
from ..base.types import Array, Flags, Indices, Matrix, Value, Vector, kept, some
from ..motion.ik import ik
from ..motion.ik.leaf import LeafPath, leaf_follower, leaf_step, leaf_value, newton_on_leaf, straight_path
from ..motion.ik.plan import Plan, check_start, make_plan
from ..path.editing import AnyPath
from ..path.workspaces import Box, PoseRange, Workspace
from ..strategies import HolonomicStrategy
from ..strategies.tasks.frame_task import completed, completing, free_directions, leaves_free
from ..strategies.tasks.task import Task
from .cell_search import TUBE, Domain, on_grid, proven
from .certificate import Boxes, Covered, Extent, overlapping
from .equation import Equation, PoseBox, deepest, spins_freely
from .tube import UP, centred, examined

PIECES = 100
"""Pieces of a sample's step that are tried at most. `follow` may take 20,000 of them beside a singularity, to go as
near to it as it can; a proof ends long before, where its cells would be too small."""


def walked(strategy: HolonomicStrategy, path: AnyPath, q0: Vector, samples: int) -> tuple[Matrix, Extent, str]:
    """(postures (k, n) at the start and the samples, why they end, where) along a path, limits ignored.

    Raises:
        StartError: the tool at the start is not where the path begins. ArgumentError: paths that do not fit the task.
        SingularityError, BranchError, TrackingError: not even a first step is possible.
    """
    task = strategy.task
    strategy(q0)
    plan = make_plan(task, path, samples, task._place(q0)[1])
    check_start(task, q0, *plan.first)
    go, c = leaf_follower(strategy, q0, PIECES), leaf_value(strategy, q0)
    correct = leaf_step(strategy)
    side = float(correct(q0, *plan.first, c)[3])
    found = [q0]
    for step in range(plan.steps):
        try:  # a posture on another branch would leave cells that do not join
            near = newton_on_leaf(correct, found[-1], *plan.target(step, 1.0), c, side)
            found.append(go(found[-1], _way(plan, step, c)) if near is None else near[0])
        except (SingularityError, BranchError, TrackingError) as problem:
            if not step:
                raise
            why = Extent.SINGULAR if isinstance(problem, SingularityError) else Extent.END
            return np.array(found), why, plan.where(step).removeprefix("in cycle 1, ")
    return np.array(found), Extent.WHOLE, ""


def _way(plan: Plan, step: int, c: Vector) -> LeafPath:
    return LeafPath(lambda share: (*plan.target(step, share), c), *plan.bends(step))


# --- How much of the turns of a workspace boxes of Cayley parameters are, by the Haar measure: all orientations alike.
#
# With c = tan(angle / 2) times the axis, a turn leans the tool by a, tan(a / 2) = |b|, b = (c_1, c_2) / sqrt(1 +
# c_3^2), and spins it by s = 2 atan(c_3). The Haar measure dc / (1 + |c|^2)^2 is db / (1 + |b|^2)^2 ds / 2: leans are
# even on the sphere, spins by the angle. A tilt is a disc of b, a spin a range of c_3.

NODES = 12
"""Of a quadrature over a piece in which the integrand is smooth: right to 1e-9 where the tool leans by 0.5 rad."""


def shares_of_turns(low: Matrix, high: Matrix, tilt: float, spin: float) -> Vector:
    """(k,) what boxes low <= c <= high (k, 3) have of a tilt and a spin, 0 to 1.

    tilt, spin: tan of half of each; 0 where the boxes have no extent in these directions.
    """
    t, weights = np.polynomial.legendre.leggauss(NODES)
    if not tilt:
        return (np.arctan(high[:, 2]) - np.arctan(low[:, 2])) / (2 * np.arctan(spin)) if spin else np.ones(len(low))
    disc = np.pi * tilt**2 / (1 + tilt**2)
    if not spin:
        return _leans(low[:, :2], high[:, :2], tilt) / disc
    # over the spin s by its angle; the leans of a box are wider where c_3 is nearer to 0
    start, end = np.arctan(low[:, 2]), np.arctan(high[:, 2])
    total = np.zeros(len(low))
    for node, weight in zip(t, weights, strict=True):
        shrink = np.cos((start + end) / 2 + (end - start) / 2 * node)[:, None]
        total += weight / 2 * _leans(low[:, :2] * shrink, high[:, :2] * shrink, tilt)
    return total * (end - start) / (2 * np.arctan(spin)) / disc


def _leans(low: Matrix, high: Matrix, radius: float) -> Vector:
    """The integral (k,) of db / (1 + |b|^2)^2 over rectangles low <= b <= high (k, 2), as far as |b| <= radius."""
    t, weights = np.polynomial.legendre.leggauss(NODES)
    # b_1 = radius sin(phi), in pieces between the places where the circle goes through the sides
    ends = np.arcsin(np.clip(np.column_stack([low[:, 0], high[:, 0]]) / radius, -1, 1))
    across = np.arccos(np.clip(np.abs(np.column_stack([low[:, 1], high[:, 1]])) / radius, 0, 1))
    inside = np.tile(np.arcsin(np.minimum(1.0, np.array([0.0, 1.0, -1.0]) / radius).clip(-1)), (len(low), 1))
    places = np.sort(np.clip(np.column_stack([across, -across, inside]), ends[:, :1], ends[:, 1:]), axis=1)
    places = np.column_stack([ends[:, 0], places, ends[:, 1]])
    total = np.zeros(len(low))
    for start, end in zip(places.T[:-1], places.T[1:], strict=True):
        for node, weight in zip(t, weights, strict=True):
            phi = (start + end) / 2 + (end - start) / 2 * node
            x, edge = radius * np.sin(phi), radius * np.cos(phi)
            below, above = (np.clip(side[:, 1], -edge, edge) for side in (low, high))
            total += weight * (end - start) / 2 * edge * (_column(x, above) - _column(x, below))
    return total


def _column(x: Vector, y: Vector) -> Vector:
    """The integral from 0 to y of dy / (1 + x^2 + y^2)^2."""
    a = 1 + x**2
    return y / (2 * a * (a + y**2)) + np.arctan(y / np.sqrt(a)) / (2 * a * np.sqrt(a))


NEAR = 1e-9
"""A pose is in a box without extent if it is as near [m, 1]."""

HALF_TURN = 1e-9
"""The cosine of half a turn's half, below which it has no Cayley parameters."""

WIDER = 1 + 1e-12
"""Boxes of turns are larger by this than their tilt and spin ask, for the rounding of the tangents."""

FINENESS = np.geomspace(0.5, 500, 48)
"""Cells per joint motion of a side [1 / joint unit] that are tried."""

MOST = 200_000
"""Cells of a grid, at most."""

PORTION = 10_000
"""Pairs of cells that are compared at a time."""


@kept
def _equation_over(strategy: HolonomicStrategy, turning: bool) -> Equation:
    """The equation of a strategy over boxes of poses, made once."""
    return Equation(strategy, PoseBox(turning))


@dataclass(frozen=True, eq=False)
class PoseRegion(Value, Domain):
    """p0 + P u, R0 C(W u), u in [-1, 1]^d, with half sides P (3,) [m] and W (3,) of the Cayley parameters.

    `axes` are the parameters that vary; the others stay 0.
    """

    equation: Equation
    c: Vector
    p0: Vector
    R0: Matrix
    half: Vector
    q: Vector
    """Joints (n,) of the leaf at the place `u0`."""
    u0: Vector
    """Where the cells are continued from, (d,); the middle, unless the proof is `partial`."""
    partial: bool = False
    """Go on where a part cannot be proven."""
    slack: float = 0.0

    @staticmethod
    def of(strategy: HolonomicStrategy, space: Workspace, q0: Vector, partial: bool = False) -> PoseRegion:
        """Raises: ArgumentError: no box; what `ik` raises where the leaf does not reach its middle.

        partial: cells are sought all over it, continued from q0 where the box holds its tool pose.
        """
        if not isinstance(space, PoseRange) or not isinstance(space.solid, Box):
            raise ArgumentError("the workspace to certify", str(space), "give a box: hk.workspace(box=(center, half))")
        if strategy.task.frames > 1:
            cure = "certify it along paths of its frames, hk.path.synchronized(...): a box of poses is of one tool"
            raise ArgumentError("the task to certify over a box", strategy.task.name, cure)
        p0, R = completed(strategy.task, (space.solid.center, space.rotation), strategy.task._place(q0))
        tilt, spin = (space.tilt, space.spin) if _turns(strategy.task) else (0.0, 0.0)
        if spins_freely(strategy.task, R):
            spin = 0.0
        turn = 2 * np.array([np.tan(tilt / 2) / np.cos(spin / 2)] * 2 + [np.tan(spin / 2)]) * WIDER
        turning = bool(turn.any())
        sides = np.where(np.isin((0, 1, 2), strategy.task.rows), space.solid.half, 0.0)
        half = np.concatenate([sides, turn]) if turning else sides
        equation = _equation_over(strategy, turning)
        c, middle = equation.level(q0), np.zeros(equation.d)
        region = PoseRegion(equation, c, p0, R, half, q0, middle, partial)
        if partial and (np.abs(at := region.place_of(q0)) <= 1).all():
            return replace(region, u0=at)
        try:
            return replace(region, q=ik(strategy, q0, limits=False)(space.center))
        except HolokinError as problem:
            if not partial:
                raise
            cure = "give a box that holds the tool pose of q0, or whose middle the leaf reaches"
            raise ArgumentError("the workspace", str(space), f"{cure}: from q0 {problem}") from problem

    def first(self) -> Boxes:
        """A grid of the largest cells that pass the test at `u0`, each side by how much it moves the joints."""
        grid, rho = self.grid, self._rho
        low = np.stack(np.meshgrid(*(g[:-1] for g in grid), indexing="ij"), axis=-1).reshape(-1, len(grid))
        high = np.stack(np.meshgrid(*(g[1:] for g in grid), indexing="ij"), axis=-1).reshape(-1, len(grid))
        k = len(low)
        unknown = np.full((k, self.equation.n), np.nan)
        return Boxes(np.zeros(k, dtype=int), low, high, np.full(k, rho), np.zeros(k, dtype=bool), unknown)

    @cached_property
    def grid(self) -> list[Vector]:
        """Its cuts along each axis, from -1 to 1."""
        return [on_grid(np.linspace(-1, 1, count + 1)) for count in self._counts[0]]

    @property
    def _rho(self) -> float:
        return self._counts[1]

    @cached_property
    def _counts(self) -> tuple[list[int], float]:
        """(cells along each axis, radius of their tubes): by the test in the middle, as of the whole box; at `u0` where
        the leaf does not lead to the middle, or is nearly singular there."""
        here = self._counted(self.u0, self.q)
        if not self.u0.any():
            return here[:2]
        try:
            q = ik(self.equation.strategy, self.q, limits=False)(pose_from(self.p0, self.R0))
        except HolokinError:
            return here[:2]
        middle = self._counted(np.zeros(self.equation.d), q)
        return middle[:2] if middle[2] else here[:2]

    def _counted(self, u: Vector, q: Vector) -> tuple[list[int], float, bool]:
        """(cells along each axis, radius of their tubes, whether one of them passes the test) by the posture q at u."""
        d = self.equation.d
        middle = self.equation.completed(q[None])
        tiny = self._about(u, np.full((1, d), 1e-9), np.full(1, 1e-9))
        cells = centred(self.equation, middle, self.numbers(tiny), self.c, tiny.rho)
        rho = TUBE / float(np.clip(examined(self.equation, cells, self.c).omega[0], 1e-3, 1e6))
        sides = np.nan_to_num(np.linalg.norm(cells.V[0], axis=0) * 1e9, posinf=1e9)
        tried = np.maximum(1.0, np.ceil(np.multiply.outer(FINENESS, np.minimum(sides, 1e3))))
        few = tried.prod(axis=1) <= MOST
        # where the middle is nearly singular any grid is too fine: then one cell, halved as far as the budget goes
        tried = np.minimum(tried[few], 64) if few.any() else np.ones((1, d))
        boxes = self._about(u, 1 / tried, np.full(len(tried), rho))
        found = examined(
            self.equation,
            centred(self.equation, np.tile(middle, (len(tried), 1)), self.numbers(boxes), self.c, boxes.rho),
            self.c,
        )
        good = proven(found)
        return tried[int(np.argmax(good)) if good.any() else 0].astype(int).tolist(), rho, bool(good.any())

    def _about(self, u: Vector, half: Matrix, rho: Vector) -> Boxes:
        """Boxes (k, d) about a place."""
        k = len(half)
        none = np.full((k, self.equation.n), np.nan)
        return Boxes(np.zeros(k, dtype=int), u - half, u + half, rho, np.zeros(k, dtype=bool), none)

    def given(self, piece: Indices) -> Matrix:
        """Of the family `PoseBox`."""
        return np.tile(np.concatenate([self.p0, self.R0.ravel(), self.half]), (len(piece), 1))

    def poses(self, boxes: Boxes) -> Array:
        """(k, 4, 4) at the middles."""
        return self.poses_at((boxes.low + boxes.high) / 2)

    def poses_at(self, u: Matrix) -> Array:
        """(k, 4, 4) at parameters (k, d)."""
        from scipy.spatial.transform import Rotation

        at = u * self.half
        w = at[:, 3:] if self.equation.family.turning else np.zeros((len(u), 3))
        turn = Rotation.from_quat(np.column_stack([w / 2, np.ones(len(w))]))
        return pose_from(self.p0 + at[:, :3], self.R0 @ turn.as_matrix())

    def place_of(self, q: Vector) -> Vector:
        """The parameters (d,) of the tool's pose at q; outside of [-1, 1] where the box does not hold it."""
        T = self.equation.strategy.task.pose(q)
        return self.places(T[None, :3, 3], T[None, :3, :3])[0]

    def places(self, p: Matrix, R: Array) -> Matrix:
        """The parameters (k, d) of tool poses, positions (k, 3) and rotations (k, 3, 3); inf where none are theirs.

        Free motion is left out: of the poses that the task cannot tell from one, they are those of that deepest inside.
        """
        from scipy.spatial.transform import Rotation

        task, w, half = self.equation.strategy.task, np.zeros((len(p), 3)), np.zeros(6)
        half[: self.equation.d] = self.half
        if leaves_free(task):
            p, R = completing(task).batch(self.p0, self.R0, p, R)
        if _turns(task):
            turn = Rotation.from_matrix(self.R0.T @ R).as_quat(canonical=True)
            direction = free_directions(task)[0]
            if direction is not None:
                axis, of_base = direction
                turn = deepest(turn, self.R0.T @ axis if of_base else axis, of_base, half[3:])
            with np.errstate(divide="ignore", invalid="ignore"):
                w = np.where(turn[:, 3:] > HALF_TURN, 2 * turn[:, :3] / turn[:, 3:], np.inf)
        at = np.hstack([p - self.p0, w])
        wide = half > 0
        u = np.where(wide, at / np.where(wide, half, 1.0), np.where(np.abs(at) < NEAR, 0.0, np.inf))
        u[np.isinf(u).any(axis=1)] = np.inf
        return u[:, : self.equation.d]

    def shares(self, low: Matrix, high: Matrix) -> Vector:
        """(k,) how much of the workspace boxes are: of its positions by volume, of its turns by the Haar measure."""
        found = np.prod((high[:, :3] - low[:, :3]) / 2, axis=1)
        if not self.equation.family.turning:
            return found
        half = self.half[3:] / 2
        spin = float(half[2])
        tilt = float(half[0]) / np.hypot(1.0, spin)
        return found * shares_of_turns(low[:, 3:] * half, high[:, 3:] * half, tilt, spin)

    def joints(self, boxes: Boxes) -> Matrix:
        """As the cells that were halved predict them; else continued on the leaf from the nearest that is known."""
        from scipy.spatial import KDTree

        found = boxes.near.copy()
        missing = np.flatnonzero(~np.isfinite(found).all(axis=1))
        if not len(missing):
            return found
        strategy = self.equation.strategy
        task, leaf = strategy.task, self.c
        correct, go = leaf_step(strategy), leaf_follower(strategy, self.q, PIECES)
        middles, T = (boxes.low + boxes.high) / 2, self.poses(boxes)
        side = float(correct(self.q, *task._place(self.q), leaf)[3])
        before = KDTree(np.array([u for u, _ in self._known])).query(middles[missing])[1]
        known, postures = (list(column) for column in zip(*(self._known[i] for i in np.unique(before)), strict=True))
        for i in missing[np.argsort(np.linalg.norm(middles[missing] - self.u0, axis=1), kind="stable")].tolist():
            nearest = int(np.argmin(np.linalg.norm(np.array(known) - middles[i], axis=1)))
            q, pose = postures[nearest], (T[i, :3, 3], T[i, :3, :3])
            near = newton_on_leaf(correct, q, *pose, leaf, side)
            try:
                q = go(q, straight_path(task, task._place(q), pose, (leaf, leaf))) if near is None else near[0]
                known.append(middles[i])
                postures.append(q)
                self._known.append((middles[i], q))
            except HolokinError:
                q = self.q
            found[i] = self.equation.completed(q[None])[0]
        return found

    def led(self, places: Matrix, postures: Matrix, boxes: Boxes) -> Matrix:
        """Joints (k, n) at the middles of boxes, continued on the leaf from postures (k, n) at places (k, d); NaN where
        the leaf ends on the way."""
        strategy, leaf = self.equation.strategy, self.c
        correct, go, task = leaf_step(strategy), leaf_follower(strategy, self.q, PIECES), strategy.task
        side, out = float(correct(self.q, *task._place(self.q), leaf)[3]), np.full(postures.shape, np.nan)
        begun, sought = self.poses_at(places), self.poses(boxes)
        for i, q in enumerate(postures[:, : task.n]):
            (start, end) = ((T[i, :3, 3], T[i, :3, :3]) for T in (begun, sought))
            near = newton_on_leaf(correct, q, *end, leaf, side)
            try:
                found = go(q, straight_path(task, start, end, (leaf, leaf))) if near is None else near[0]
            except HolokinError:
                continue
            out[i] = self.equation.completed(found[None])[0]
        return out

    def learned(self) -> list[tuple[Vector, Vector]]:
        """Places and postures that were found, of which the next ones are continued."""
        return self._known

    @cached_property
    def _known(self) -> list[tuple[Vector, Vector]]:
        """Places and postures that were found, of which the next ones are continued."""
        return [(self.u0, self.q)]

    def beyond(self, boxes: Boxes, stopped: list[tuple[int, tuple[float, ...]]]) -> Flags:
        """All: one place where the proof fails ends it."""
        return np.ones(len(boxes), dtype=bool)

    def goes_on(self, extent: Extent) -> bool:
        """Only where the proof has not ended."""
        return extent is Extent.WHOLE

    def arranged(self, found: Covered) -> Covered:
        """All of them."""
        return found

    def unglued(self, found: Covered) -> Flags:
        """Those that share a part of a face with a neighbour whose root in its middle is not shown to be theirs."""
        out = np.zeros(len(found), dtype=bool)
        for i, j, bad in self.faces(found):
            out[i[bad]] = out[j[bad]] = True
        return out

    def connected(self, found: Covered) -> Covered:
        """Those that can be reached across glued faces from the cell at `u0`, or, where none is, the most."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        faces = list(self.faces(found))
        glued = not any(bad.any() for _, _, bad in faces)
        if not len(found) or (found.extent is Extent.WHOLE and glued):
            return found
        none, k = np.zeros(0, dtype=int), len(found)
        ones, others = (np.concatenate([none, *(face[side][~face[2]] for face in faces)]) for side in (0, 1))
        part = connected_components(coo_matrix((np.ones(len(ones)), (ones, others)), (k, k)), directed=False)[1]
        here = np.flatnonzero((found.boxes.low <= self.u0).all(axis=1) & (found.boxes.high >= self.u0).all(axis=1))
        chosen = part == (part[here[0]] if len(here) else np.argmax(np.bincount(part)))
        torn = [
            i[bad & chosen[i] & chosen[j]] for i, j, bad in faces
        ]  # joined by another way round only: not one function
        if any(len(i) for i in torn):
            left = np.ones(k, dtype=bool)
            left[np.concatenate(torn)] = False
            return self.connected(replace(found.only(left), extent=_not_whole(found), stopped=_torn_at(found, torn)))
        kept = found.only(chosen)
        if found.extent is not Extent.WHOLE:
            return kept
        i = int(np.argmin(chosen)) if not chosen.all() else int(np.argmax(self.unglued(found)))
        stopped = int(found.boxes.piece[i]), tuple(found.boxes.low[i].tolist())
        return Covered(kept.boxes, kept.cells, kept.findings, Extent.APART, stopped)

    def faces(self, found: Covered) -> Iterator[tuple[Indices, Indices, Flags]]:
        """(cells, their neighbours above along an axis, where they are not shown to share a root), in portions."""
        b, findings, slip = found.boxes, found.findings, found.cells.slip
        for axis in range(self.equation.d):
            across = [a for a in range(self.equation.d) if a != axis]
            for at in np.unique(b.high[:, axis]):
                below, above = np.flatnonzero(b.high[:, axis] == at), np.flatnonzero(b.low[:, axis] == at)
                ones, others = overlapping(b.low[:, across], b.high[:, across], below, above)
                for first in range(0, len(ones), PORTION):
                    i, j = ones[first : first + PORTION], others[first : first + PORTION]
                    y = (np.maximum(b.low[i], b.low[j]) + np.minimum(b.high[i], b.high[j])) / 2
                    y[:, axis] = at
                    off = np.linalg.norm(_within(found, i, y) - _within(found, j, y), axis=1)
                    off += slip[i] + slip[j]
                    yield i, j, ~one_root(off, *(x for k in (i, j) for x in (findings.r[k], findings.alone[k])))

    def place(self, found: Covered) -> str:
        """The pose."""
        at = self.stop(found)
        return "" if at is None else f"the pose at {np.round(at, 6).tolist()}"

    def stop(self, found: Covered) -> Vector | None:
        """The position (3,) at which the proof failed first."""
        return None if found.stopped is None else self.p0 + np.array(found.stopped[1])[:3] * self.half[:3]


def one_root(off: Vector, r: Vector, alone: Vector, other_r: Vector, other_alone: Vector) -> Flags:
    """(k,) where two cells surely have one root at a place, their predictors being `off` apart there: the root of the
    one is where that of the other is alone.

    Where they have one, off <= r + r'. For r' <= r then off + r' <= 3 r, which is less than `alone`, `LONE` times r: so
    it is shown of all that have one.
    """
    return (off + r <= other_alone / UP) | (off + other_r <= alone / UP)


def _turns(task: Task) -> bool:
    """Whether a task looks at the tool's orientation."""
    return any(task._angular)


def _not_whole(found: Covered) -> Extent:
    return Extent.APART if found.extent is Extent.WHOLE else found.extent


def _torn_at(found: Covered, torn: list[Indices]) -> tuple[int, tuple[float, ...]]:
    if found.stopped is not None:
        return found.stopped
    i = int(np.concatenate(torn)[0])
    return int(found.boxes.piece[i]), tuple(found.boxes.low[i].tolist())


def _within(found: Covered, chosen: Indices, y: Matrix) -> Matrix:
    """The predicted joints (k, n) of some cells at parameters u (k, d) of the box of poses: y = (u - u0) / h."""
    low, high = found.boxes.low[chosen], found.boxes.high[chosen]
    half = (high - low) / 2
    return some(found.cells, chosen).predicted((y - (low + high) / 2) / np.where(half > 0, half, 1.0))
