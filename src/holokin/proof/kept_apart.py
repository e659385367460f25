"""Which shapes are to keep apart in a proof: the pairs of `check`, and obstacles that stand still."""

from __future__ import annotations

import numpy as np

from ..base.errors import ArgumentError
from ..base.types import Matrix, Vector
from ..motion import follow
from ..motion.checks.clearance import FLOOR
from ..motion.checks.motion_checks import SURE, Clearances, PairDistance
from ..motion.checks.scene import Scene
from ..path import Path
from ..robot import Mesh, Robot, chain_length, foot_of
from ..strategies import HolonomicStrategy
from ..strategies.tasks.task import Task
from .certificate import Certificate
from .clear_cells import ClearCells, shape_pairs

# --- A posture on a leaf at which two shapes are nearer than a proof was to show: there none can succeed.
#
# The distances are those of `check`, at postures that are found in doubles: of meshes their own, not of their hulls.


def looked_at(clear: ClearCells) -> Clearances:
    """The distances of `check`, of the pairs that a proof is about."""
    return Clearances(clear.robot, clear.looked_at)


def gap_distances(clear: ClearCells, Q: Matrix) -> Matrix:
    """(k, gaps) how far apart things are at postures Q (k, n), as `check` has it: `clear.looked_at.gaps`."""
    clearances = looked_at(clear)
    return clearances.distances(Q, clearances.limits + SURE)


def short_of(clear: ClearCells, distances: Matrix) -> Matrix:
    """(k, gaps) by how much distances [m] are less than is asked: positive where something is too near."""
    return np.array(clear.looked_at.limits) - SURE - distances


def least_room(clear: ClearCells, task: Task, q: Vector) -> PairDistance:
    """The pair that a proof cannot show to be as far apart as is asked at a posture (n,): the one that is too near by
    most; where none is, the one whose convex shapes, which the proof is about, have the least room."""
    distances = gap_distances(clear, q[None])[0]
    gap = int(np.argmax(short_of(clear, distances)))
    if not short_of(clear, distances)[gap] > 0:
        names = clear.pairs[int(np.argmin(clear.distances(q[None])[0] - clear.wanted))].names
        gaps = [g for g, other in enumerate(clear.looked_at.gaps) if other.names == names]
        gap = min(gaps, key=lambda g: float(distances[g]))
    return looked_at(clear).pair_at(task, q, gap, float(distances[gap]))


def too_near_along(certificate: Certificate) -> PairDistance | None:
    """A posture along the path of a certificate at which something is too near; None where samples show none."""
    clear, path = certificate.demands.clear, certificate.asked
    if clear is None or not isinstance(path, Path):
        return None
    strategy = certificate.equation.strategy
    q0 = certificate.anchors.q[0][: strategy.task.n]
    walk = follow(strategy, path, q0, samples=1000, limits=certificate.limits is not None)
    Q = walk.q[np.isfinite(walk.q).all(axis=1)]
    worst = Q[int(np.argmax(short_of(clear, gap_distances(clear, Q)).max(axis=1)))]
    pair = least_room(clear, strategy.task, worst)
    return pair if pair.too_near else None


EVEN = 1e-11
"""By how much a rotation may be none, and the square of an axis not 1; those of the catalogue are off by 4e-16."""


def kept_apart(strategy: HolonomicStrategy, q0: Vector, scene: Scene) -> ClearCells:
    """What tells of the distances of the things in a scene.

    Raises:
        ArgumentError: an obstacle that moves, that is a mesh and not convex, in millimetres, or of a link's name; a
            frame that is no rotation; shapes that are nearer at q0 than is asked; a robot without links; nothing to
            look at. UnknownNameError: no such link. RobotFileError: an unreadable mesh.
    """
    asked = _clearances(strategy.task.robot, scene)
    robot, names = asked.robot, [shape.link for shape in scene.obstacles]
    links = {shape.link for shape in robot.shapes if not shape.obstacle}
    # Obstacles that are convex, and told from links by their names, as a certificate tells them.
    for obstacle in scene.obstacles:
        if isinstance(obstacle.shape, Mesh) and not obstacle.shape.fault and not obstacle.shape.convex:
            cure = (
                "a plane between two things proves that they keep apart, so give the convex parts of the mesh one by "
                "one, or its convex hull, mesh.hull, in which all hollows are filled"
            )
            raise ArgumentError("an obstacle that is a mesh and not convex", obstacle.link, cure)
    for name in names if scene.floor is None else [*names, FLOOR]:
        if name in links:
            raise ArgumentError(f"the obstacle {name!r}", name, "give it a name that no link of the robot has")
    # Frames that are turned by a rotation, about an axis of length 1.
    for joint in robot.joints:
        if not (_is_rotation(joint.placement) and abs(float(joint.axis @ joint.axis) - 1) < EVEN):
            fact = joint.placement[:3, :3].tolist(), joint.axis.tolist()
            raise ArgumentError(f"the frame of joint {joint.name!r}", fact, "give a rotation and a unit axis")
    for shape in (*robot.shapes, *scene.obstacles):
        if not _is_rotation(shape.placement):
            fact = shape.placement[:3, :3].tolist()
            raise ArgumentError(f"the frame of a shape of {shape.link!r}", fact, "give a rotation")
    clear = ClearCells(robot, shape_pairs(asked.pairs.gaps, asked.pairs.limits), asked.pairs)
    _check_start(clear, strategy, q0)
    return clear


def _is_rotation(T: Matrix) -> bool:
    return bool(np.abs(T[:3, :3].T @ T[:3, :3] - np.eye(3)).max() < EVEN)


def clearances_of(robot: Robot, scene: Scene | None) -> Clearances | None:
    """What tells of the distances at single postures; None where nothing is asked about them.

    Raises:
        ArgumentError, UnknownNameError, RobotFileError: as `kept_apart`, but for what is said of q0.
    """
    return None if scene is None else _clearances(robot, scene)


def _clearances(robot: Robot, scene: Scene) -> Clearances:
    robot._check_links()
    _check_metres(robot, scene)
    clearances = Clearances.of(robot, scene)
    if not clearances.names:
        cure = "nothing in it can be touched: give obstacles, a floor or self_collision=True"
        raise ArgumentError("scene", scene, cure)
    return clearances


def _check_start(clear: ClearCells, strategy: HolonomicStrategy, q0: Vector) -> None:
    """Raises: ArgumentError: things are nearer at q0 than is asked, or the shapes that stand for them are."""
    problem = least_room(clear, strategy.task, q0)
    if problem.too_near:
        # A word about units, where what is too near is five times as large as the arm is long.
        shapes = [s for pair in clear.pairs if pair.names == problem.names for s in (pair.one, pair.other)]
        size = max((float(np.ptp(s.points, axis=0).max()) + 2 * s.radius for s in shapes), default=0.0)
        large = size > 5 * max(chain_length(clear.robot), 0.1)
        doubt = f"; one of them is {size:.3g} m large: is it given in mm?" if large else ""
        cure = "move what is in the way, or give another posture or a smaller clearance"
        raise ArgumentError("q0", np.round(q0, 4).tolist(), f"{problem}: {cure}{doubt}")
    if not (clear.distances(q0[None])[0] - clear.wanted).min(initial=np.inf) >= 0:
        fact = f"{problem}, but the convex shapes that stand for them in the proof are nearer"
        cure = "give a mesh by its convex parts, another posture or a smaller clearance"
        raise ArgumentError("q0", np.round(q0, 4).tolist(), f"{fact}: {cure}")


def _check_metres(robot: Robot, scene: Scene) -> None:
    """Raises: ArgumentError: lengths that are not in metres; an obstacle that moves, or that cannot be read."""
    size, foot = max(chain_length(robot), 0.1), foot_of(robot.joints, robot._find_tip().joint)
    most = 50 * size
    # The clearance, the floor, the shapes of the robot.
    lengths = {"clearance": scene.clearance} | ({} if scene.floor is None else {"floor": scene.floor - foot[2]})
    for name, length in lengths.items():
        if abs(length) > most:
            cure = "give metres: it is more than 50 times as far as the arm is long"
            raise ArgumentError(name, getattr(scene, name), cure)
    if scene.clearance > size:
        raise ArgumentError("clearance", scene.clearance, f"give metres: the arm is {size:.3g} m long")
    for shape in robot.shapes:
        if not (shape.obstacle or shape.shape.fault) and shape.shape.ball[1] > most:
            cure = f"it is {2 * shape.shape.ball[1]:.3g} m large, the arm {size:.3g} m long: give metres, or its scale"
            raise ArgumentError("a shape of the robot", shape.link, cure)
    # The obstacles.
    for obstacle in scene.obstacles:
        if obstacle.joint >= 0:
            cure = "a proof is about obstacles that stand still: put what the tool carries on it by hk.robot.with_shape"
            raise ArgumentError("an obstacle that moves", obstacle.link, cure)
        if obstacle.shape.fault:
            cure = "give a shape that can be read"
            raise ArgumentError(f"the obstacle {obstacle.link!r}", obstacle.shape.fault, cure)
        T, (center, radius) = obstacle.placement, obstacle.shape.ball
        if radius + np.linalg.norm(T[:3, 3] + T[:3, :3] @ center - foot) > most:
            cure = "give metres: it is more than 50 times as far or as large as the arm is long"
            raise ArgumentError(f"the obstacle {obstacle.link!r}", f"{radius:.3g}", cure)
