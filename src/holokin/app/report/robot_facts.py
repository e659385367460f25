"""A robot in words: its joints with their limits, its tool frames, where its numbers are from."""

from __future__ import annotations

import numpy as np

from ...robot import Coordinate, Robot, Tip, knows_masses, reach


def robot_facts(robot: Robot) -> list[str]:
    """Lines on a robot: its name, source and reach, a table of its joints, its tool frames, its shapes and masses."""
    count = f"{robot.n} joint{'s' * (robot.n > 1)}"
    lines = [f"{robot.name}: {count}, reach {reach(robot):.3f} m" if robot.tips else f"{robot.name}: {count}"]
    lines += [f"source: {robot.source}"] if robot.source else []
    rows = [("joint", "range", "largest speed"), *((c.name, _range(c), _speed(c)) for c in robot.coordinates)]
    widths = [max(len(row[k]) for row in rows) for k in range(3)]
    lines += ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines += [f"tool frame {_tip(robot, tip)}" for tip in robot.tips]
    kinds = sorted({type(shape.shape).__name__.lower() for shape in robot.shapes})
    shapes = f"{len(robot.shapes)}, {', '.join(kinds)}" if kinds else "none; capsules stand for the links"
    return [*lines, f"shapes: {shapes}", f"masses: {'known' if knows_masses(robot) else 'not known'}"]


def _range(c: Coordinate) -> str:
    """The limits of a joint; of a hinge in degrees, too."""
    if not np.isfinite([c.lower, c.upper]).any():
        return f"no limits [{c.unit}]"
    plain = f"{c.lower:.4f} to {c.upper:.4f} {c.unit}"
    return plain if c.unit != "rad" else f"{plain} ({np.degrees(c.lower):.1f} to {np.degrees(c.upper):.1f} deg)"


def _speed(c: Coordinate) -> str:
    """The largest speed of a joint; of a hinge in degrees, too."""
    if not np.isfinite(c.max_velocity):
        return "not known"
    plain = f"{c.max_velocity:.4f} {c.unit}/s"
    return plain if c.unit != "rad" else f"{plain} ({np.degrees(c.max_velocity):.1f} deg/s)"


def _tip(robot: Robot, tip: Tip) -> str:
    """A tool frame, in the frame of the joint that carries it."""
    from scipy.spatial.transform import Rotation

    where = "the base" if tip.joint < 0 else robot.joints[tip.joint].name
    angles = Rotation.from_matrix(tip.placement[:3, :3]).as_euler("xyz", degrees=True)
    xyz, rpy = (", ".join(f"{v + 0.0:.6g}" for v in np.round(three, 6)) for three in (tip.placement[:3, 3], angles))
    return f"{tip.name}: on {where}, xyz [{xyz}] m, rpy [{rpy}] deg"
