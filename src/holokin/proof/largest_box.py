"""A large box of tool poses about a start: grown where samples are regular, made smaller until it is proven."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ..base.poses import pose_from
from ..base.tolerances import TOLERANCES
from ..base.types import Array, Flags, Matrix, Vector
from ..motion.ik import inverse
from ..path.workspaces import PoseRange, workspace
from ..robot import reach
from ..strategies import HolonomicStrategy
from .box_proof import PoseRegion
from .certificate import Certificate, Extent
from .certify_leaf import certificate
from .demands import Demands

STEPS = 8
"""Samples from the start to each side of what is looked at."""

REGULAR = 0.15
"""Of the rcond at the start, what samples must have: cells are many where it is small."""

AWAY = 0.02
"""How much farther [m] than asked shapes must be apart at samples: in between they come nearer."""

ROOM = 0.02
"""How far [joint units] samples must be from joint limits: in between the joints go farther. But of a joint that is
nearer to its limit at the start, half as far as there."""

TRIES = 16
"""Boxes that are tried, each smaller than the one before."""

FAR, LOOKED = 4.0, 60
"""How far [m] a side is looked for, at most, and at how many places."""

NEARER, LEAST = 0.9, 0.3
"""Of its distance from the start, where a box ends before a place at which the proof failed; and of the box, what must
be left then: else all of it is made smaller."""

FILLED = 0.4
"""Of the budget, what the first cells may take: some are halved."""


def largest_box(strategy: HolonomicStrategy, q0: Vector, tilt: float, spin: float, asked: Demands) -> PoseRange:
    """A box that looks regular: from the start's pose, side by side, as long as all samples of a new layer do."""
    task = strategy.task
    T = task.pose(q0)
    lines = _spans(strategy, q0, asked)
    cuts = [T[axis, 3] + np.concatenate([-low * np.arange(STEPS, 0, -1), high * np.arange(STEPS + 1)]) / STEPS
            for axis, (low, high) in enumerate(lines)]  # fmt: skip
    points = np.stack(np.meshgrid(*cuts, indexing="ij"), axis=-1).reshape(-1, 3)
    good = np.ones(len(points), dtype=bool)
    for R in _turned(T[:3, :3], tilt, spin):
        good[good] = _sound(strategy, q0, pose_from(points[good], R), asked)
    solid = good.reshape([len(c) for c in cuts])
    low, high = np.full(3, STEPS), np.full(3, STEPS)
    while True:
        grown = []
        for axis in range(3):
            for side, end in ((low, -1), (high, 1)):
                at = side[axis] + end
                layer = [slice(a, b + 1) for a, b in zip(low, high, strict=True)]
                layer[axis] = slice(at, at + 1)
                if 0 <= at < solid.shape[axis] and solid[tuple(layer)].all():
                    sides = [cuts[k][high[k]] - cuts[k][low[k]] for k in range(3)]
                    grown.append((sides[axis], axis, end))
        if not grown:
            break
        _, axis, end = min(grown)  # the shortest side first
        (low if end < 0 else high)[axis] += end
    ends = np.array([(cuts[k][low[k]], cuts[k][high[k]]) for k in range(3)])
    return _box(ends, T[:3, :3], tilt, spin)


def proven_box(
    strategy: HolonomicStrategy, q0: Vector, box: PoseRange, asked: Demands, budget: int, say: Callable[[str], None]
) -> tuple[Certificate, PoseRegion, PoseRange]:
    """The certificate of a box, or of a smaller one about the start, the first that is proven whole; or the last."""
    tool, began = strategy.task.pose(q0)[:3, 3], time.perf_counter()
    left = TRIES
    while True:
        left -= 1
        cells = PoseRegion.of(strategy, box, q0)
        count = int(np.prod([len(cuts) - 1 for cuts in cells.grid]))
        if count > FILLED * budget and left:
            box = _about(box, tool, max(0.5, (FILLED * budget / count) ** (1 / 3)))
            continue
        found = certificate(box, cells, q0, asked, budget, say, began)
        if found.whole or not left:
            return found, cells, box
        say(f"{box}: {found.extent.cause}")
        box = _about(box, tool, 0.8) if found.extent is Extent.BUDGET else _cut(box, tool, cells.stop(found.proven))


def _spans(strategy: HolonomicStrategy, q0: Vector, asked: Demands) -> Matrix:
    """How far [m] the tool goes along each axis of the base, (3, 2): to either side, while all looks regular."""
    T, far = strategy.task.pose(q0), min(2 * reach(strategy.task.robot), FAR)
    t = np.linspace(0.0, far, LOOKED)[1:]
    spans = np.zeros((3, 2))
    for axis in range(3):
        for side, sign in enumerate((-1.0, 1.0)):
            points = np.tile(T[:3, 3], (len(t), 1))
            points[:, axis] += sign * t
            good = _sound(strategy, q0, pose_from(points, T[:3, :3]), asked)
            last = int(np.argmin(good)) if not good.all() else len(t)
            spans[axis, side] = t[last - 1] if last else t[0] / 4
    return spans


def _sound(strategy: HolonomicStrategy, q0: Vector, poses: Array, asked: Demands) -> Flags:
    """(k,) True for poses that are reached, regular, and as asked with some room."""
    if not len(poses):
        return np.zeros(0, dtype=bool)
    found, robot = inverse(strategy, q0, limits=False).batch(poses), strategy.task.robot
    good = found.reached.copy()
    q = found.q[good]
    rcond = np.array([strategy.gain(one)[1] for one in q]) if len(q) else np.zeros(0)
    fine = rcond >= REGULAR * strategy.gain(q0)[1]
    if asked.limits is not None:
        room = np.minimum(ROOM, np.minimum(q0 - robot.lower, robot.upper - q0) / 2) - TOLERANCES.limit
        fine &= ((q >= robot.lower + room) & (q <= robot.upper - room)).all(axis=1)
    if asked.clear is not None and len(q):
        fine &= (asked.clear.distances(q) >= asked.clear.wanted + AWAY).all(axis=1)
    good[good] = fine
    return good


def _turned(R: Matrix, tilt: float, spin: float) -> list[Matrix]:
    """Orientations at the ends of a tilt and a spin, and the middle one."""
    from scipy.spatial.transform import Rotation

    most = np.diag([tilt, tilt, spin])
    vectors = [v for v in (*most, *-most) if v.any()]
    return [R, *(R @ Rotation.from_rotvec(v).as_matrix() for v in vectors)]


def _ends(box: PoseRange) -> Matrix:
    return np.column_stack([box.solid.center - box.solid.half, box.solid.center + box.solid.half])


def _box(ends: Matrix, R: Matrix, tilt: float, spin: float) -> PoseRange:
    low, high = ends.T
    return workspace(box=((low + high) / 2, (high - low) / 2), rotation=R, tilt=tilt, spin=spin)


def _about(box: PoseRange, tool: Vector, share: float) -> PoseRange:
    """The box, smaller by a share about the start."""
    return _box(tool[:, None] + share * (_ends(box) - tool[:, None]), box.rotation, box.tilt, box.spin)


def _cut(box: PoseRange, tool: Vector, at: Vector | None) -> PoseRange:
    """The box less what is beyond a place where the proof failed: the side is cut that costs least of it."""
    ends, away = _ends(box), np.zeros(3) if at is None else at - tool
    side = (away > 0).astype(int)
    kept = np.abs(NEARER * away) + np.abs(ends[np.arange(3), 1 - side] - tool)
    left = np.where(away != 0, kept / (ends[:, 1] - ends[:, 0]), 0.0)
    axis = int(np.argmax(left))
    if not LEAST < left[axis] < 1:
        return _about(box, tool, 0.8)
    ends[axis, side[axis]] = tool[axis] + NEARER * away[axis]
    return _box(ends, box.rotation, box.tilt, box.spin)
