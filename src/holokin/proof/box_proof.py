"""The proof over a box of poses: cells that fill it, glued across their faces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..base.errors import ArgumentError, HolokinError
from ..base.poses import pose_from
from ..base.types import Array, Flags, Indices, Matrix, Value, Vector, some
from ..motion.ik import ik
from ..motion.ik.leaf import leaf_follower, leaf_step, newton_on_leaf, straight_path
from ..path.workspaces import Box, PoseRange, Workspace
from ..strategies import HolonomicStrategy
from ..strategies.tasks.frame_task import completed, completing, free_directions, leaves_free
from .cell_search import TUBE, Boxes, Covered, Domain, Extent, joinable, on_grid, one_root, overlapping
from .equation import Equation, PoseBox, deepest, equation_of, spins_freely
from .tube import centred, examined

PIECES = 100
"""Pieces of a sample's step that are tried at most. `follow` may take 20,000 of them beside a singularity, to go as
near to it as it can; a proof ends long before, where its cells would be too small."""


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


PORTION = 10_000
"""Pairs of cells that are compared at a time."""


def faces(low: Matrix, high: Matrix) -> Iterator[tuple[int, float, Indices, Indices]]:
    """(axis, its value there, boxes, their neighbours above) of boxes (k, d) that have a part of a face in common."""
    for axis in range(low.shape[1]):
        across = [a for a in range(low.shape[1]) if a != axis]
        for cut in np.unique(high[:, axis]).tolist():
            below, above = np.flatnonzero(high[:, axis] == cut), np.flatnonzero(low[:, axis] == cut)
            yield axis, cut, *overlapping(low[:, across], high[:, across], below, above)


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
    def over(strategy: HolonomicStrategy, space: Workspace, q0: Vector, partial: bool = False) -> PoseRegion:
        """The box, with q0 as the joints in its middle. Raises: ArgumentError: no box."""
        if not isinstance(space, PoseRange) or not isinstance(space.solid, Box):
            raise ArgumentError("the workspace to certify", str(space), "give a box: hk.workspace(box=(center, half))")
        if strategy.task.frames > 1:
            cure = "certify it along paths of its frames, hk.path.synchronized(...): a box of poses is of one tool"
            raise ArgumentError("the task to certify over a box", strategy.task.name, cure)
        p0, R = completed(strategy.task, (space.solid.center, space.rotation), strategy.task._place(q0))
        tilt, spin = (space.tilt, space.spin) if any(strategy.task._angular) else (0.0, 0.0)
        if spins_freely(strategy.task, R):
            spin = 0.0
        # The half sides, a little larger for the rounding of the tangents.
        turn = 2 * np.array([np.tan(tilt / 2) / np.cos(spin / 2)] * 2 + [np.tan(spin / 2)]) * (1 + 1e-12)
        turning = bool(turn.any())
        sides = np.where(np.isin((0, 1, 2), strategy.task.rows), space.solid.half, 0.0)
        half = np.concatenate([sides, turn]) if turning else sides
        equation = equation_of(strategy, PoseBox(turning))
        c, middle = np.atleast_1d(strategy.g(q0)), np.zeros(equation.d)
        return PoseRegion(equation, c, p0, R, half, q0, middle, partial)

    @staticmethod
    def of(strategy: HolonomicStrategy, space: Workspace, q0: Vector, partial: bool = False) -> PoseRegion:
        """Raises: ArgumentError: no box; what `ik` raises where the leaf does not reach its middle.

        partial: cells are sought all over it, continued from q0 where the box holds its tool pose.
        """
        region = PoseRegion.over(strategy, space, q0, partial)
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
        sides = [cuts[:-1] for cuts in self.grid], [cuts[1:] for cuts in self.grid]
        low, high = (np.stack(np.meshgrid(*ends, indexing="ij"), axis=-1).reshape(-1, len(ends)) for ends in sides)
        return self._boxes(low, high, np.full(len(low), self._first_cells[1]))

    @cached_property
    def grid(self) -> list[Vector]:
        """Its cuts along each axis, from -1 to 1."""
        return [on_grid(np.linspace(-1, 1, count + 1)) for count in self._first_cells[0]]

    @cached_property
    def _first_cells(self) -> tuple[list[int], float]:
        """(cells along each axis, radius of their tubes): by the test in the middle, as of the whole box; at `u0` where
        the leaf does not lead to the middle, or is nearly singular there."""
        counts, rho, _ = self._counted(self.u0, self.q)
        if not self.u0.any():
            return counts, rho
        try:
            q = ik(self.equation.strategy, self.q, limits=False)(pose_from(self.p0, self.R0))
        except HolokinError:
            return counts, rho
        middle = self._counted(np.zeros(self.equation.d), q)
        return middle[:2] if middle[2] else (counts, rho)

    def _counted(self, u: Vector, q: Vector) -> tuple[list[int], float, bool]:
        """(cells along each axis, radius of their tubes, whether one of them passes the test) by the posture q at u."""
        # The radius by omega, and how much each side moves the joints, from a tiny cell.
        d = self.equation.d
        middle = self.equation.completed(q[None])
        tiny = self._boxes(u - np.full((1, d), 1e-9), u + np.full((1, d), 1e-9), np.full(1, 1e-9))
        cells = centred(self.equation, middle, self.numbers(tiny), self.c, tiny.rho)
        rho = TUBE / float(np.clip(examined(self.equation, cells, self.c).omega[0], 1e-3, 1e6))
        sides = np.nan_to_num(np.linalg.norm(cells.V[0], axis=0) * 1e9, posinf=1e9)
        # Grids, from coarse to fine by cells per joint motion; where the posture is nearly singular all have too many
        # cells: then one cell, which is halved as far as the budget goes.
        counts = np.maximum(1.0, np.ceil(np.multiply.outer(np.geomspace(0.5, 500, 48), np.minimum(sides, 1e3))))
        few = counts.prod(axis=1) <= 200_000
        counts = np.minimum(counts[few], 64) if few.any() else np.ones((1, d))
        # The coarsest one of which a cell at u passes the test.
        boxes = self._boxes(u - 1 / counts, u + 1 / counts, np.full(len(counts), rho))
        postures = np.tile(middle, (len(counts), 1))
        cells = centred(self.equation, postures, self.numbers(boxes), self.c, boxes.rho)
        good = joinable(examined(self.equation, cells, self.c))
        return counts[int(np.argmax(good)) if good.any() else 0].astype(int).tolist(), rho, bool(good.any())

    def _boxes(self, low: Matrix, high: Matrix, rho: Vector) -> Boxes:
        """Boxes (k, d) that were not tried yet."""
        k = len(low)
        unknown = np.full((k, self.equation.n), np.nan)
        return Boxes(np.zeros(k, dtype=int), low, high, rho, np.zeros(k, dtype=bool), unknown)

    def given(self, piece: Indices) -> Matrix:
        """Of the family `PoseBox`."""
        return np.tile(np.concatenate([self.p0, self.R0.ravel(), self.half]), (len(piece), 1))

    def poses_at(self, u: Matrix) -> Array:
        """(k, 4, 4) at parameters (k, d)."""
        from scipy.spatial.transform import Rotation

        sides = u * self.half
        w = sides[:, 3:] if self.equation.family.turning else np.zeros((len(u), 3))
        turn = Rotation.from_quat(np.column_stack([w / 2, np.ones(len(w))]))
        return pose_from(self.p0 + sides[:, :3], self.R0 @ turn.as_matrix())

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
        # The Cayley parameters of the turn; half a turn has none.
        if any(task._angular):
            turn = Rotation.from_matrix(self.R0.T @ R).as_quat(canonical=True)
            direction = free_directions(task)[0]
            if direction is not None:
                axis, of_base = direction
                turn = deepest(turn, self.R0.T @ axis if of_base else axis, of_base, half[3:])
            with np.errstate(divide="ignore", invalid="ignore"):
                w = np.where(turn[:, 3:] > 1e-9, 2 * turn[:, :3] / turn[:, 3:], np.inf)
        # Shares of the half sides; where the box is flat the pose must lie in it, to round-off [m, 1].
        sides, wide = np.hstack([p - self.p0, w]), half > 0
        u = np.where(wide, sides / np.where(wide, half, 1.0), np.where(np.abs(sides) < 1e-9, 0.0, np.inf))
        u[np.isinf(u).any(axis=1)] = np.inf
        return u[:, : self.equation.d]

    def shares(self, low: Matrix, high: Matrix) -> Vector:
        """(k,) how much of the workspace boxes are: of its positions by volume, of its turns by the Haar measure."""
        volumes = np.prod((high[:, :3] - low[:, :3]) / 2, axis=1)
        if not self.equation.family.turning:
            return volumes
        half = self.half[3:] / 2
        spin = float(half[2])
        tilt = float(half[0]) / np.hypot(1.0, spin)
        return volumes * shares_of_turns(low[:, 3:] * half, high[:, 3:] * half, tilt, spin)

    def joints(self, boxes: Boxes) -> Matrix:
        """As the cells that were halved predict them; else continued on the leaf from the nearest that is known."""
        from scipy.spatial import KDTree

        q = boxes.near.copy()
        missing = np.flatnonzero(~np.isfinite(q).all(axis=1))
        if not len(missing):
            return q
        # The places that are known and near, and the boxes in order from `u0`.
        middles = (boxes.low + boxes.high) / 2
        nearest = KDTree(np.array([u for u, _ in self._known])).query(middles[missing])[1]
        places, postures = (list(column) for column in zip(*(self._known[i] for i in np.unique(nearest)), strict=True))
        order = missing[np.argsort(np.linalg.norm(middles[missing] - self.u0, axis=1), kind="stable")]
        go, T = self._continued(), self.poses_at(middles)
        for i in order.tolist():
            start = postures[int(np.argmin(np.linalg.norm(np.array(places) - middles[i], axis=1)))]
            posture = go(start, None, T[i])
            if posture is None:
                posture = self.q
            else:
                places.append(middles[i])
                postures.append(posture)
                self._known.append((middles[i], posture))
            q[i] = self.equation.completed(posture[None])[0]
        return q

    def led(self, places: Matrix, postures: Matrix, boxes: Boxes) -> Matrix:
        """Joints (k, n) in the middles of boxes, on the leaf from those (k, n) at places (k, d); NaN where it ends."""
        q, go = np.full(postures.shape, np.nan), self._continued()
        begun, ends = self.poses_at(places), self.poses_at((boxes.low + boxes.high) / 2)
        for i, start in enumerate(postures[:, : self.equation.joints]):
            posture = go(start, begun[i], ends[i])
            if posture is not None:
                q[i] = self.equation.completed(posture[None])[0]
        return q

    def _continued(self) -> Callable[[Vector, Matrix | None, Matrix], Vector | None]:
        """(q, its tool pose (4, 4) or None, another) -> the posture there, on the leaf from q; None where it ends."""
        strategy, leaf = self.equation.strategy, self.c
        correct, go, task = leaf_step(strategy), leaf_follower(strategy, self.q, PIECES), strategy.task
        side = float(correct(self.q, *task._place(self.q), leaf)[3])

        def continued(q: Vector, begin: Matrix | None, end: Matrix) -> Vector | None:
            goal = end[:3, 3], end[:3, :3]
            solution = newton_on_leaf(correct, q, *goal, leaf, side)
            if solution is not None:
                return solution[0]
            start = task._place(q) if begin is None else (begin[:3, 3], begin[:3, :3])
            try:
                return go(q, straight_path(task, start, goal, (leaf, leaf)))
            except HolokinError:
                return None

        return continued

    def learned(self) -> list[tuple[Vector, Vector]]:
        """Places and postures that were found, of which the next ones are continued."""
        return self._known

    @cached_property
    def _known(self) -> list[tuple[Vector, Vector]]:
        return [(self.u0, self.q)]

    def unglued(self, proven: Covered) -> Flags:
        """Those that share a part of a face with a neighbour whose root in its middle is not shown to be theirs."""
        unglued = np.zeros(len(proven), dtype=bool)
        for i, j, apart in self._faces(proven):
            unglued[i[apart]] = unglued[j[apart]] = True
        return unglued

    def connected(self, proven: Covered) -> Covered:
        """Those that can be reached across glued faces from the cell at `u0`, or, where none is, the most."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        faces, boxes, k = list(self._faces(proven)), proven.boxes, len(proven)
        glued = not any(apart.any() for _, _, apart in faces)
        if not k or (proven.extent is Extent.WHOLE and glued):
            return proven
        # The component of the cell at `u0`.
        none = np.zeros(0, dtype=int)
        ones, others = (np.concatenate([none, *(face[side][~face[2]] for face in faces)]) for side in (0, 1))
        part = connected_components(coo_matrix((np.ones(len(ones)), (ones, others)), (k, k)), directed=False)[1]
        start = np.flatnonzero((boxes.low <= self.u0).all(axis=1) & (boxes.high >= self.u0).all(axis=1))
        chosen = part == (part[start[0]] if len(start) else np.argmax(np.bincount(part)))
        # Two of its cells that differ where they meet are joined by another way round only: not one function.
        torn = np.concatenate([none, *(i[apart & chosen[i] & chosen[j]] for i, j, apart in faces)])
        if len(torn):
            left = np.ones(k, dtype=bool)
            left[torn] = False
            extent = Extent.APART if proven.extent is Extent.WHOLE else proven.extent
            stopped = proven.stopped or boxes.places()[int(torn[0])]
            return self.connected(replace(proven.only(left), extent=extent, stopped=stopped))
        connected = proven.only(chosen)
        if proven.extent is not Extent.WHOLE:
            return connected
        i = int(np.argmin(chosen)) if not chosen.all() else int(np.argmax(self.unglued(proven)))
        return replace(connected, extent=Extent.APART, stopped=boxes.places()[i])

    def _faces(self, proven: Covered) -> Iterator[tuple[Indices, Indices, Flags]]:
        """(cells, their neighbours above along an axis, where they are not shown to share a root), in portions."""
        boxes, cells, findings = proven.boxes, proven.cells, proven.findings
        for axis, cut, ones, others in faces(boxes.low, boxes.high):
            for first in range(0, len(ones), PORTION):
                # The predictors in the middles of the faces.
                i, j = ones[first : first + PORTION], others[first : first + PORTION]
                u = (np.maximum(boxes.low[i], boxes.low[j]) + np.minimum(boxes.high[i], boxes.high[j])) / 2
                u[:, axis] = cut
                q, q_other = (some(boxes, rows).predicted(some(cells, rows), u) for rows in (i, j))
                off = np.linalg.norm(q - q_other, axis=1) + cells.slip[i] + cells.slip[j]
                yield i, j, ~one_root(off, *(x for k in (i, j) for x in (findings.r[k], findings.alone[k])))

    def place(self, proven: Covered) -> str:
        """The pose."""
        p = self.stop(proven)
        return "" if p is None else f"the pose at {np.round(p, 6).tolist()}"

    def stop(self, proven: Covered) -> Vector | None:
        """The position (3,) at which the proof failed first."""
        return None if proven.stopped is None else self.p0 + np.array(proven.stopped[1])[:3] * self.half[:3]
