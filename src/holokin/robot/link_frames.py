"""The geometric Jacobian as a link in the middle of the chain sees it: of few operations, for proofs.

Seen from the base each column holds all joints before it; seen from a middle link only those in between. The rows are
turned together, and the linear ones are the velocities of another point of the tool: a factor A with det A = 1, which
keeps null vectors and det J J^T.
"""

from __future__ import annotations

from ..symbolic import SX, cross, horzcat, n_nodes, sparsify, vertcat
from ..symbolic.rotations import rotation_about
from .joints import Joint, Tip
from .model import Robot

Frames = dict[int, tuple[SX, SX]]


def link_jacobian(robot: Robot, q: SX, tip: str | None = None, *, turned: bool = True) -> SX:
    """A(q) J (6, n), det A = 1, of the link and the point that leave most zeros in it.

    A turns with the fixed rotations of the model, whose inverses are their transposes: of right angles exactly, else
    to the rounding of their doubles.

    Args:
        turned: all six rows are to count. Else the linear ones (3, n) of the tool's own point.
    """
    end = robot.tip(tip)
    chain = [end.joint]
    while robot.joints[chain[-1]].parent >= 0:
        chain.append(robot.joints[chain[-1]].parent)
    found = []
    for middle in range(len(chain)):
        frames = _seen_from(robot, q, chain[::-1], middle, end)
        points = chain if turned else [-1]
        found += [_columns(robot, frames, chain, frames[point][0], turned) for point in points]
    return min(found, key=lambda J: (sparsify(J).nnz(), n_nodes(J)))


def _seen_from(robot: Robot, q: SX, chain: list[int], middle: int, end: Tip) -> Frames:
    """(origin, rotation) of every joint's moving frame, seen from that of one of them; of the tool's point at -1."""
    frames: Frames = {chain[middle]: (SX.zeros(3, 1), SX.eye(3))}
    for before, at in zip(chain[middle:], chain[middle + 1 :], strict=False):
        joint, (p, R) = robot.joints[at], frames[before]
        shift, turn = _moved(joint, q, 1.0)
        R_placed = R @ SX(joint.placement[:3, :3])
        frames[at] = p + R @ SX(joint.placement[:3, 3]) + R_placed @ shift, R_placed @ turn
    for before, at in zip(chain[:middle][::-1], chain[1 : middle + 1][::-1], strict=True):
        joint, (p, R) = robot.joints[at], frames[at]
        shift, turn = _moved(joint, q, -1.0)
        R_placed = R @ turn
        R_before = R_placed @ SX(joint.placement[:3, :3].T)
        frames[before] = p + R_placed @ shift - R_before @ SX(joint.placement[:3, 3]), R_before
    p, R = frames[end.joint]
    frames[-1] = p + R @ SX(end.placement[:3, 3]), R
    return frames


def _moved(joint: Joint, q: SX, way: float) -> tuple[SX, SX]:
    """(shift (3,), turn (3, 3)) of a joint, or back again."""
    value = way * (joint.multiplier * q[joint.coordinate] + joint.offset)
    if joint.kind == "prismatic":
        return SX(joint.axis) * value, SX.eye(3)
    return SX.zeros(3, 1), rotation_about(joint.axis, value)


def _columns(robot: Robot, frames: Frames, chain: list[int], point: SX, turned: bool) -> SX:
    columns = [SX.zeros(6, 1)] * robot.n
    for at in chain:
        joint, (p, R) = robot.joints[at], frames[at]
        axis = R @ SX(joint.axis)
        still = joint.kind == "prismatic"
        moved = vertcat(axis, SX.zeros(3, 1)) if still else vertcat(cross(axis, point - p), axis)
        columns[joint.coordinate] = columns[joint.coordinate] + joint.multiplier * moved
    return horzcat(*columns)[: 6 if turned else 3, :]
