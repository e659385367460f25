"""`longest_span`: a distance beyond which no posture brings a tool, by the lengths of the links alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..base.poses import pose_from
from ..base.types import Array, Flags, Matrix, Value, Vector
from .joints import Tip, foot_of, joints_above
from .model import Robot

CORNERS = (0.1, 0.01, 1e-3)
"""The length of a link is sqrt(d^2 + corner^2) while the points are looked for [m]: where axes meet, d has a kink."""

LONGEST = 20.0
"""Average link of an arm [m] at which metres are doubted: no robot has it, and in millimetres every one does."""

ROUND = 1e-9
"""What round-off of lengths and poses may come to [m]."""


@dataclass(frozen=True, eq=False)
class Span(Value):
    """No posture, within the joint limits of slides, brings a point of the tool further than `length` [m] from a place.

    start (3,): the place, in the base frame. end (3,): the point, in the frame of the tip.
    """

    start: Vector
    end: Vector
    length: float

    def beyond(self, position: Matrix, rotation: Array) -> Flags:
        """Which tool poses (k, 3), (k, 3, 3) no posture reaches, by this bound; of others nothing is said."""
        away = position + rotation @ self.end - self.start
        return np.asarray(np.linalg.norm(away, axis=1) > self.length + ROUND)


def longest_span(robot: Robot, tip: str | None = None, *, turned: bool) -> Span:
    """The bound sum |x_i+1 - x_i| with x_i the best point on the axis of hinge i, as of slides their origin.

    Both axes of a link are fixed in it, and so are points on them. The first point is fixed in the base; the last one
    is fixed in the tool.

    Args:
        turned: whether the tool's rotation is known: then the span ends on the last hinge's axis; else at the tip.
    """
    links = _Links.of(robot, robot.tip(tip), turned)
    at = links.drawn_in()
    return Span(links.first(at), links.last(at), links.length(at)[0] + links.slides)


def longest_reach(robot: Robot, tip: str | None = None) -> float:
    """A distance [m] from its foot beyond which no posture brings a tip: links in a line, slides at their ends.

    Infinite with a slide without limits.
    """
    chosen = next((t for t in robot.tips if t.name == tip), robot.tips[0])
    links = _Links.of(robot, chosen, turned=False)
    origins = np.zeros(len(links.free))
    foot = foot_of(robot.joints, chosen.joint)
    return float(np.linalg.norm(links.first(origins) - foot)) + links.length(origins)[0] + links.slides


def mean_link(robot: Robot, tip: Tip) -> float:
    """Average length [m] of the links from the first joint to a tip, of the shortest way along the axes.

    What slides travel does not count.
    """
    links = _Links.of(robot, tip, turned=False)
    return links.length(links.drawn_in())[0] / max(len(links.free), 1)


def with_near_frames(robot: Robot) -> Robot:
    """The robot with the frames of joints that stand far away on their axes moved along these to the links.

    A DH table puts them there where two axes are nearly parallel, as a calibration finds them. All else is as it was.
    """
    steps = {-1: np.zeros(3)} | dict.fromkeys(range(len(robot.joints)), np.zeros(3))
    for tip in robot.tips:
        chain = joints_above(robot.joints, tip.joint)[::-1]
        for index, t in zip(chain, _Links.of(robot, tip, turned=False).drawn_in(), strict=True):
            steps[index] = robot.joints[index].axis * (t if abs(t) > LONGEST / 2 else 0.0)

    def seen(joint: int, T: Matrix) -> Matrix:
        return pose_from(-steps[joint]) @ T

    joints = [
        replace(j, placement=seen(j.parent, j.placement) @ pose_from(steps[i])) for i, j in enumerate(robot.joints)
    ]
    tips = [
        replace(t, placement=seen(t.joint, t.placement), flange=None if t.flange is None else t.flange - steps[t.joint])
        for t in robot.tips
    ]
    return replace(
        robot,
        joints=tuple(joints),
        tips=tuple(tips),
        bodies=tuple(replace(body, center=body.center - steps[body.joint]) for body in robot.bodies),
        shapes=tuple(replace(shape, placement=seen(shape.joint, shape.placement)) for shape in robot.shapes),
        visuals=tuple(replace(visual, placement=seen(visual.joint, visual.placement)) for visual in robot.visuals),
    )


@dataclass(frozen=True, eq=False)
class _Links:
    """The links of a chain of k joints from the base to a tip, and points t_i along the axes of its joints.

    offset (k + 1, 3): the origin of joint i in the frame of joint i - 1, at last that of the tip. axis (k, 3), each in
    its own frame; there (k, 3): each in the frame before. free (k,): of hinges; a slide's point stays. slides [m].
    """

    offset: Matrix
    axis: Matrix
    there: Matrix
    free: Flags
    slides: float
    tip: Matrix
    turned: bool

    @staticmethod
    def of(robot: Robot, tip: Tip, turned: bool) -> _Links:
        """Those of a robot. The span of a tool on the base, or on a slide, ends at the tip."""
        joints = [robot.joints[i] for i in reversed(joints_above(robot.joints, tip.joint))]
        slides = 0.0
        for joint in (one for one in joints if one.kind == "prismatic"):
            slide = robot.coordinates[joint.coordinate]
            slides += abs(joint.multiplier) * max(-slide.lower, slide.upper) + abs(joint.offset)
        free = np.array([joint.kind != "prismatic" for joint in joints], dtype=bool)
        return _Links(
            np.array([one.placement[:3, 3] for one in (*joints, tip)]),
            np.array([joint.axis for joint in joints]).reshape(-1, 3),
            np.array([joint.placement[:3, :3] @ joint.axis for joint in joints]).reshape(-1, 3),
            free, slides, tip.placement, bool(turned and len(free) and free[-1]),
        )  # fmt: skip

    def drawn_in(self) -> Vector:
        """The points (k,) between which the links in a line are shortest."""
        from scipy.optimize import minimize

        at = np.zeros(len(self.free))
        for corner in CORNERS:
            at = minimize(self.length, at, (corner,), "BFGS", jac=True).x * self.free
        return at

    def length(self, t: Vector, corner: float = 0.0) -> tuple[float, Vector]:
        """The length of the links in a line [m] and its derivative (k,): without the link before the first point and,
        if turned, without the one behind the last."""
        t = t * self.free
        link = self.offset[1:] - t[:, None] * self.axis
        link[:-1] += t[1:, None] * self.there[1:]
        along = link[:-1] if self.turned else link
        size = np.hypot(np.linalg.norm(along, axis=1), corner)
        unit = along / np.where(size > 0, size, 1.0)[:, None]
        slope = np.zeros(len(t))
        slope[: len(unit)] -= np.sum(unit * self.axis[: len(unit)], axis=1)
        slope[1:] += np.sum(unit[: len(t) - 1] * self.there[1:], axis=1)
        return float(size.sum()), slope * self.free

    def first(self, t: Vector) -> Vector:
        """The first point (3,), in the base frame."""
        return np.asarray(self.offset[0] + (t[0] * self.there[0] if len(t) else 0.0))

    def last(self, t: Vector) -> Vector:
        """The last point (3,), in the frame of the tip."""
        if not self.turned:
            return np.zeros(3)
        return np.asarray(self.tip[:3, :3].T @ (t[-1] * self.axis[-1] - self.tip[:3, 3]))
