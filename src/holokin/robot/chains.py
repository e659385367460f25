"""The robot of chains of a tree: its span, whether its numbers can be rad and m, limits, tools, compositions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from ..base.arguments import check, typed
from ..base.errors import ArgumentError, RobotFileError, UnknownNameError, shown
from ..base.poses import PoseLike, given_pose, pose_from, pose_numbers
from ..base.tolerances import TOLERANCES
from ..base.types import Array, ArrayLike, Flags, Matrix, Value, Vector, finite, kept, one_or_each, tool_pose
from ..symbolic.rotations import rotation_from_rpy
from .joints import Body, Coordinate, Joint, Tip, foot_of, joints_above
from .model import Robot
from .shapes.link_shapes import LinkShape
from .shapes.visuals import Visual
from .tree import MOVING, Branch, Tree, above_of, chain_of, leaves_of, motion, rerooted, root_of

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
    links = _Links.of(robot, robot._find_tip(tip), turned)
    points = links.drawn_in()
    return Span(links.first(points), links.last(points), links.length(points)[0] + links.slides)


@kept
def longest_reach(robot: Robot, tip: str | None = None) -> float:
    """A distance [m] from its foot beyond which no posture brings a tip: links in a line, slides at their ends.

    Infinite with a slide without limits.
    """
    chosen = next((t for t in robot.tips if t.name == tip), robot.tips[0])
    links = _Links.of(robot, chosen, turned=False)
    origins = np.zeros(len(links.free))
    foot = foot_of(robot.joints, chosen.joint)
    return float(np.linalg.norm(links.first(origins) - foot)) + links.length(origins)[0] + links.slides


def _with_near_frames(robot: Robot) -> Robot:
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
        for joint in (j for j in joints if j.kind == "prismatic"):
            slide = robot.coordinates[joint.coordinate]
            slides += abs(joint.multiplier) * max(-slide.lower, slide.upper) + abs(joint.offset)
        free = np.array([joint.kind != "prismatic" for joint in joints], dtype=bool)
        return _Links(
            np.array([frame.placement[:3, 3] for frame in (*joints, tip)]),
            np.array([joint.axis for joint in joints]).reshape(-1, 3),
            np.array([joint.placement[:3, :3] @ joint.axis for joint in joints]).reshape(-1, 3),
            free,
            slides,
            tip.placement,
            bool(turned and len(free) and free[-1]),
        )

    def drawn_in(self) -> Vector:
        """The points (k,) between which the links in a line are shortest."""
        from scipy.optimize import minimize

        points = np.zeros(len(self.free))
        for corner in CORNERS:
            points = minimize(self.length, points, (corner,), "BFGS", jac=True).x * self.free
        return points

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


# --- Are joints in rad, and places in metres? What is far beyond all limits and all reach is in other units.

FAR = 100.0
"""Reaches of an arm from its base at which a place is not in metres: millimetres make a thousand of one."""

TURN = 2 * np.pi * 1.001
"""Angles [rad] of a frame beyond which radians are doubted: a full turn more changes nothing."""

WIDEST = 4 * np.pi
"""Limits [rad] of most hinges at which radians are doubted: single joints turn further, no whole arm does."""

TRUST = ", or trust_units=True (--trust-units, trust_units = true of a robot in a file) if they are"
"""How to overrule a doubt, behind the cure."""

SHARE = 10.0
"""Reaches of an arm at which a tool on it is not in metres."""


def doubtful_unit(robot: Robot, places: Matrix, tip: str | None = None) -> str:
    """What to say of places (k, 3) that are all too far from the base to be in metres; empty of others."""
    away = places - foot_of(robot.joints, robot._find_tip(tip).joint)
    nearest, reach = float(np.linalg.norm(away, axis=-1).min()), longest_reach(robot, tip)
    if not FAR * reach < nearest < np.inf:
        return ""
    return f"at least {nearest:.4g} m from the base, where {robot.name} reaches {reach:.3g} m: give metres"


def nearer_or_other(robot: Robot, place: Vector, tip: str | None = None) -> str:
    """What to do about a place (3,) of a tip that no posture of the arm has: where it is too far, by how much."""
    away = float(np.linalg.norm(place - foot_of(robot.joints, robot._find_tip(tip).joint)))
    reach = longest_reach(robot, tip)
    if doubt := doubtful_unit(robot, place[None], tip):
        return doubt
    if away > reach:
        return f"it is {away:.3g} m from the base, and the arm reaches {reach:.3g} m: give a pose nearer to the base"
    within = f"it is {away:.3g} m from the base, within the arm's length of {reach:.3g} m"
    return f"{within}: turn the tool another way there, or move it nearer or farther away"


def check_metres(robot: Robot, poses: Array, tip: str | None = None) -> None:
    """Raises: ArgumentError where the poses (k, 4, 4) of a workspace are too far away to be in metres."""
    if doubt := doubtful_unit(robot, poses[:, :3, 3], tip):
        first = f"at [{', '.join(f'{x:.6g}' for x in poses[0, :3, 3])}] m"
        raise ArgumentError("the first pose of the workspace", first, f"all are {doubt}")


def check_radians(what: str, angles: Vector, overruled: str = "") -> None:
    """Raises: ArgumentError where an angle of a frame is over a turn, as degrees are; `overruled`: how to say so."""
    if (np.abs(angles) > TURN).any():
        cure = f"this looks like degrees: give radians, np.deg2rad(...){overruled}"
        raise ArgumentError(what, np.asarray(angles).tolist(), cure)


def plausible(robot: Robot) -> Robot:
    """The robot, as every reader finishes it, with its frames near its links.

    Raises:
        ArgumentError: it seems to be in millimetres, or its limits in degrees. What is asked are the links of each arm,
        wherever a file puts its frames on the axes, and the limits of its hinges.
    """
    lengths = np.abs([frame.placement[:3, 3] for frame in (*robot.joints, *robot.tips)])
    if lengths.max(initial=0.0) > LONGEST / 2:  # else the average is no longer
        for tip in robot.tips:
            links = _Links.of(robot, tip, turned=False)  # along the axes, without what slides travel
            length = links.length(links.drawn_in())[0] / max(len(links.free), 1)
            if length > LONGEST:
                cure = f"this looks like millimetres: give metres{TRUST}"
                raise ArgumentError(f"the average link up to {tip.name!r} [m]", float(f"{length:.3g}"), cure)
        robot = _with_near_frames(robot)
    _check_limits_of_hinges(robot)
    return robot


def _check_limits_of_hinges(robot: Robot) -> None:
    """Raises: ArgumentError where the limits of most hinges that have some are many turns, as degrees are."""
    hinges = [(abs(c.lower), abs(c.upper)) for c in robot.coordinates if c.unit == "rad"]
    widest = [max(ends) for pair in hinges if (ends := [v for v in pair if 0 < v < np.inf])]
    wide = sum(most > WIDEST for most in widest)
    if wide > 1 and 2 * wide > len(widest):
        fact = f"{wide} of {len(widest)} hinges turn by over two turns, which looks like degrees"
        cure = f"{fact}: give radians, np.deg2rad(...){TRUST}"
        raise ArgumentError(f"the widest limit of {robot.name!r} [rad]", max(widest), cure)


FASTEST = 50.0
"""Speed [rad/s, m/s] beyond which a limit is doubted: eight turns a second; limits in deg/s are beyond it."""

GIVE_SPEEDS = "give the robot its limits: hk.with_limits(robot, max_velocity=...), or max_velocity in [robot] of a job"
"""What to do about a joint without a speed limit."""

JointValues = ArrayLike | Mapping[str, float]
"""One number for all joints, one for each (n,), or those of some joints by name."""


@typed
def with_limits(
    robot: Robot,
    *,
    lower: JointValues | None = None,
    upper: JointValues | None = None,
    max_velocity: JointValues | None = None,
    trust_units: bool = False,
) -> Robot:
    """The robot with other limits of its joints; those that are not given stay. `math.inf` is no limit.

    MJCF has no speed limits, and DH tables and URDFs of users often lack them; whatever times a motion needs them. The
    limits that a follower has of its own are not looked at again.

    Args:
        lower, upper: positions [rad; m of a prismatic joint]: one number for all joints, one for each (n,), or a
            mapping from the names of some.
        max_velocity: speeds [rad/s; m/s], likewise.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        ArgumentError: lower above upper, a speed that is not positive, or limits that seem to be in degrees:
        a hinge of more than 50 rad/s, or most hinges of more than two turns.
        UnknownNameError: a joint that there is not. ShapeError: not one number for each joint.
    """
    given = {"lower": lower, "upper": upper, "max_velocity": max_velocity}
    known = {what: _each(robot, what, value) for what, value in given.items() if value is not None}
    rows = [{what: float(values[i]) for what, values in known.items()} for i in range(robot.n)]
    limited = tuple(replace(c, **row) for c, row in zip(robot.coordinates, rows, strict=True))
    limited_robot = replace(robot, coordinates=limited)
    for c, before in zip(limited, robot.coordinates, strict=True):
        doubted = FASTEST < c.max_velocity < np.inf and c.max_velocity != before.max_velocity
        if doubted and c.unit == "rad" and not trust_units:
            cure = f"give rad/s, as np.deg2rad({c.max_velocity:g}), math.inf for none{TRUST}"
            raise ArgumentError(f"max_velocity of joint {c.name!r}", f"{c.max_velocity:g} rad/s", cure)
    if not trust_units and (lower is not None or upper is not None):
        _check_limits_of_hinges(limited_robot)
    return limited_robot


def without_speed_limit(robot: Robot) -> str:
    """The joints that have no speed limit, in words; empty where all have one. With one of them no time is known."""
    names = [name for name, most in zip(robot.joint_names, robot.max_velocity, strict=True) if not np.isfinite(most)]
    return ", ".join(names)


def speed_limits(robot: Robot, cure: str = GIVE_SPEEDS) -> Vector:
    """The speed limits (n,) of all joints. Raises: ArgumentError: a joint has none; `cure` says what else may be given.

    Whatever turns a motion into time asks here: without the limit of one joint, no time of the motion is known.
    """
    if missing := without_speed_limit(robot):
        raise ArgumentError(f"the speed limit of {missing} of {robot.name!r}", None, cure)
    return robot.max_velocity


def _each(robot: Robot, what: str, value: JointValues) -> Vector:
    """(n,) of a number, of n numbers, or of those of some joints, where the others stay."""
    if isinstance(value, Mapping):
        values = getattr(robot, what).copy()
        for name, number in value.items():
            values[robot.joint_index(name)] = one_or_each(f"{what} of joint {name!r}", number, 1)[0]
        return values
    return one_or_each(what, value, robot.n).copy()


def robot_of(
    tree: Tree,
    tip: str | Sequence[str] | None,
    base: str | None,
    locked: Mapping[str, float] | None,
    trust_units: bool = False,
) -> Robot:
    """The robot of the chains from a base to its tips, as `from_urdf` says.

    Raises:
        RobotFileError, UnknownNameError, ArgumentError.
    """
    above = above_of(tree)
    root = root_of(tree, above) if base is None else base
    held = dict(locked or {})
    by_name = {joint.name: joint for joint in tree.joints}
    for kind, wanted, known in ((tree.word, [root], tree.links), ("joint", held, by_name)):
        for word in wanted:
            if word not in known:
                raise UnknownNameError(f"{kind} of {tree.source}", word, tuple(known))
    tips = _wanted_tips(tree, tip, above, root)
    if any(chain_of(link, root, above) is None for link in tips):
        tree = rerooted(tree, root)
    builder = _Builder(tree, root, held)
    for joint, value in held.items():
        builder.check_locked(by_name[joint], value)
    robot = builder.build(tips)
    if trust_units:
        return robot
    try:
        for joint, rpy in tree.turned.items():
            check_radians(f"rpy of joint {joint!r}", np.array(rpy), TRUST)
        return plausible(robot)
    except ArgumentError as problem:
        raise tree.problem(f"{problem.what} is {shown(problem.value)}", problem.cure) from None


Law = tuple[str, float, float]
"""(joint that leads, multiplier, offset): motion = multiplier * (its coordinate) + offset."""


class _Builder:
    """Walks the chains and collects joints and coordinates, each once."""

    def __init__(self, tree: Tree, root: str, held: dict[str, float]):
        self.tree, self.root, self.held = tree, root, held
        self.by_name = {joint.name: joint for joint in tree.joints}
        self.above = above_of(tree)
        # Every joint that leads -> those that follow it in the end, each with its multiplier and offset.
        self.followers: dict[str, list[tuple[Branch, float, float]]] = {}
        for joint in self.by_name.values():
            if joint.follows is not None and joint.name not in held and joint.kind in MOVING:
                with suppress(RobotFileError):  # told where a chain needs it
                    master, multiplier, offset = self._master(joint)
                    self.followers.setdefault(master.name, []).append((joint, multiplier, offset))
        self.joints: list[Joint] = []
        self.index: dict[str, int] = {}
        self.coordinates: dict[str, Coordinate] = {}

    def build(self, tips: Sequence[str]) -> Robot:
        """The robot of the chains from the root to each tip, with the masses of everything that they carry."""
        ends = []
        for tip in tips:
            chain = chain_of(tip, self.root, self.above)
            if chain is None:
                fact = f"{self.tree.word} {tip!r} does not hang together with base {self.root!r}"
                raise self.tree.problem(fact, "choose another base")
            try:
                ends.append(self._add(tip, chain))
            except ArgumentError as problem:  # of a joint's limits
                raise self.tree.problem(f"{problem.what} is {problem.value}", problem.cure) from None
        bodies, shapes, visuals = self._carried_things()
        tree, coordinates = self.tree, tuple(self.coordinates.values())
        return Robot(tree.name, coordinates, tuple(self.joints), tuple(ends), tree.source, bodies, shapes, visuals)

    def _add(self, tip: str, chain: Sequence[Branch]) -> Tip:
        parent, placement, foot, begun = -1, np.eye(4), None, False
        for joint in chain:
            before, placement = placement, placement @ joint.origin
            if joint.kind == "fixed":
                continue
            foot = foot if begun else before[:3, 3]  # it stands where the link does on which its first joint hangs
            begun = True
            if joint.kind not in MOVING:
                cure = "choose base= below it: revolute, continuous, prismatic, fixed and mimic joints are supported"
                if (plain := str(joint.kind).strip().lower()) in (*MOVING, "continuous", "fixed"):
                    cure = f"write {plain!r}: types are in lower case"
                raise self.tree.problem(f"joint {joint.name!r} is of type {joint.kind!r}", cure)
            axis = _axis(self.tree, joint)
            for loop in self.tree.loops:
                if joint.name in loop.joints and joint.name not in self.held:
                    fact = f"joint {joint.name!r} is part of a closed loop of joints ({loop.closed_by})"
                    cure = "choose base= and tip= so that the chain leaves it out, or lock its joints at their values"
                    raise self.tree.problem(fact, cure)
            master, multiplier, offset = self._master(joint)
            if master.name in self.held:
                placement = placement @ motion(joint.kind, axis, multiplier * self.held[master.name] + offset)
                continue
            if joint.name not in self.index:
                if master.name not in self.coordinates:
                    self.coordinates[master.name] = self._coordinate(master)
                self._move(joint, parent, placement, axis, (master.name, multiplier, offset), foot)
            parent, placement, foot = self.index[joint.name], np.eye(4), None
        return Tip(tip, parent, placement)

    def _move(self, joint: Branch, parent: int, T: Matrix, axis: Vector, law: Law, foot: Vector | None) -> None:
        """Add a joint at T (4, 4) behind another one."""
        master, multiplier, offset = law
        coordinate = list(self.coordinates).index(master)
        self.index[joint.name] = len(self.joints)
        limits = _own_limits(joint) if joint.name != master else ()
        motion_law = (coordinate, multiplier, offset)
        self.joints.append(Joint(joint.name, joint.kind, parent, T, axis, *motion_law, *limits, foot=foot))

    def _carried_things(self) -> tuple[tuple[Body, ...], tuple[LinkShape, ...], tuple[Visual, ...]]:
        """What is below the root. A joint beside the chains stays at zero, unless it mimics one of theirs.

        Each shape knows the nearest link above its own that has shapes: the two are neighbours.
        """
        bodies: list[Body] = []
        shapes: list[LinkShape] = []
        visuals: list[Visual] = []
        waiting = [(self.root, -1, np.eye(4), "")]
        below: dict[str, list[Branch]] = {}
        for joint in self.by_name.values():
            below.setdefault(joint.parent, []).append(joint)
        while waiting:
            name, index, placement, above = waiting.pop()
            weight = self.tree.links[name]
            if weight is not None and weight.mass:
                R = placement[:3, :3]
                with np.errstate(all="ignore"):  # senseless masses are told by what needs them
                    center, inertia = R @ weight.center + placement[:3, 3], R @ weight.inertia @ R.T
                bodies.append(Body(index, weight.mass, center, inertia))
            carrier = above
            for shape in self.tree.shapes.get(name, ()):
                shapes.append(replace(shape, joint=index, placement=placement @ shape.placement, parent=above))
                carrier = above if shape.obstacle else name
            for visual in self.tree.visuals.get(name, ()):
                visuals.append(replace(visual, joint=index, placement=placement @ visual.placement))
            for joint in below.get(name, []):
                waiting.append((joint.child, *self._carried(joint, index, placement), carrier))
        return tuple(bodies), tuple(shapes), tuple(visuals)

    def _carried(self, joint: Branch, parent: int, placement: Matrix) -> tuple[int, Matrix]:
        """(index of the joint that moves a joint's child link, placement there)."""
        if joint.name in self.index:
            return self.index[joint.name], np.eye(4)
        foot = placement[:3, 3] if parent < 0 else None
        placement = placement @ joint.origin
        if joint.kind not in MOVING:
            return parent, placement
        try:
            axis = _axis(self.tree, joint)
            master, multiplier, offset = self._master(joint)
        except RobotFileError:
            return parent, placement  # beside the chains, so it must not hinder them
        if master.name in self.coordinates and master.name not in self.held:
            self._move(joint, parent, placement, axis, (master.name, multiplier, offset), foot)
            return self.index[joint.name], np.eye(4)
        value = self.held.get(master.name, master.zero)
        return parent, placement @ motion(joint.kind, axis, multiplier * value + offset)

    def _master(self, joint: Branch) -> tuple[Branch, float, float]:
        """The joint that a chain of mimics follows, and motion = multiplier * (its coordinate) + offset."""
        multiplier, offset, seen = 1.0, 0.0, {joint.name}
        while joint.follows is not None and joint.name not in self.held:
            law = joint.follows
            offset += multiplier * law.offset
            multiplier *= law.multiplier
            master = self.by_name.get(law.master)
            flaw = ""
            if master is None:
                flaw = "which the file does not have"
            elif master.name in seen:
                flaw = "which leads back to it"
            elif master.kind not in MOVING:
                flaw = f"which is of type {master.kind!r}"
            elif not np.isfinite([multiplier, offset]).all():
                flaw = f"with multiplier {law.multiplier} and offset {law.offset}"
            if flaw or master is None:
                fact = f"joint {joint.name!r} mimics {law.master!r}, {flaw}"
                cure = f"correct its <mimic>, or hold it still: locked={{{joint.name!r}: value}}"
                raise self.tree.problem(fact, cure)
            joint = master
            seen.add(joint.name)
        return joint, multiplier, offset - multiplier * joint.zero

    def _coordinate(self, master: Branch) -> Coordinate:
        """A joint's name, kind and limits, such that all joints that follow it are within theirs, too.

        low <= multiplier q + offset <= high of a follower is a range of q, and its largest speed over |multiplier| one
        of q'. Raises: ArgumentError, RobotFileError: limits make no sense, or the ranges have nothing in common.
        """
        coordinate = master.coordinate
        lower, upper, speed = coordinate.lower, coordinate.upper, coordinate.max_velocity
        for joint, multiplier, offset in self.followers.get(master.name, ()):
            low, high, most = _own_limits(joint)
            if multiplier:
                low, high = sorted(((low - offset) / multiplier, (high - offset) / multiplier))
                speed = min(speed, most / abs(multiplier))
            elif low - TOLERANCES.limit <= offset <= high + TOLERANCES.limit:
                continue  # it stands still, where it may
            else:
                low, high = np.inf, -np.inf
            lower, upper = max(lower, low), min(upper, high)
            if lower > upper + TOLERANCES.limit:
                fact = f"joint {joint.name!r} follows {master.name!r} and is never within its own limits"
                cure = f"correct the limits of both, or hold it still: locked={{{joint.name!r}: value}}"
                raise self.tree.problem(fact, cure)
        return replace(coordinate, lower=min(lower, upper), upper=max(lower, upper), max_velocity=speed)

    def check_locked(self, joint: Branch, value: object) -> None:
        """Raises: ArgumentError, RobotFileError: a joint that cannot be held at a value."""
        tree = self.tree
        what = f"locked joint {joint.name!r} of {tree.source}"
        if joint.kind not in MOVING:
            raise ArgumentError(f"the type of {what}", joint.kind, "it needs no lock; name joints that move")
        if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
            raise ArgumentError(what, value, "give a finite value in m or rad")
        free = replace(joint, lower=-np.inf, upper=np.inf, max_velocity=np.inf)
        try:
            limits = self._coordinate(free if joint.blank else joint)
        except ArgumentError as problem:
            raise tree.problem(f"{problem.what} is {problem.value}", problem.cure) from None
        if not limits.lower - TOLERANCES.limit <= value <= limits.upper + TOLERANCES.limit:
            raise ArgumentError(what, value, f"give a value within its limits [{limits.lower:.6g}, {limits.upper:.6g}]")


def _wanted_tips(tree: Tree, tip: str | Sequence[str] | None, above: Mapping[str, Branch], root: str) -> list[str]:
    if tip is None:
        below = [leaf for leaf in leaves_of(tree) if chain_of(leaf, root, above)]
        if not below:
            others = ", ".join(leaf for leaf in leaves_of(tree) if leaf != root)
            raise tree.problem(f"ends at base {root!r}", f"give tip=, the {tree.word} to reach from there: {others}")
        if len(below) != 1:
            fact = f"branches into {len(below)} tips"
            raise tree.problem(fact, f"give tip=, one or more of {', '.join(below)}")
        return below
    wanted = [tip] if isinstance(tip, str) else list(tip)
    for link in wanted:
        if link not in tree.links:
            raise UnknownNameError(f"{tree.word} of {tree.source}", link, tuple(tree.links))
    return wanted


def _own_limits(joint: Branch) -> tuple[float, float, float]:
    """(least, greatest, fastest) motion from its zero that a follower's own limits allow; none were filled in: any.

    Raises: ArgumentError: they make no sense.
    """
    if joint.blank:
        return -np.inf, np.inf, np.inf
    own = joint.coordinate
    return own.lower - joint.zero, own.upper - joint.zero, own.max_velocity


def _axis(tree: Tree, joint: Branch) -> Vector:
    """Unit axis (3,) of a joint."""
    length = np.linalg.norm(joint.axis)
    if joint.axis.shape != (3,) or not np.isfinite(length) or length == 0.0:
        raise tree.problem(f"joint {joint.name!r} has axis {joint.axis}", "give it a direction, three numbers")
    return joint.axis / length


# --- Robots put together: an arm on a rail or a mobile base, two arms side by side, a tool on a flange.

BASE = "base"
"""The name of what stands still: of a robot without names of links, and of the ground in `Part.on`."""


@dataclass(frozen=True, eq=False)
class Part(Value):
    """A robot and where it is mounted: the pose (4, 4) of its base in the frame of a tip, or of the base.

    Instead of the pose a position (3,) [m] may be given, with rpy (3,) [rad] as of `with_tool`; they become the pose.

    `on` names a tip of the parts before it, or "base" for the ground. By default it is the first tip of the part before
    it; the first part stands on the ground. `prefix` goes before the names of its joints and tips.
    """

    robot: Robot
    on: str | None = None
    pose: Matrix = field(default_factory=lambda: np.zeros(3))
    rpy: Vector = field(default_factory=lambda: np.zeros(3))
    prefix: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.robot, Robot):
            raise ArgumentError("the robot of a part", self.robot, "give a Robot, as hk.load makes it")
        check("on of a part", str | None, self.on)
        check("prefix of a part", str, self.prefix)
        object.__setattr__(self, "pose", _placed("a part", self.pose, self.rpy, ""))
        object.__setattr__(self, "rpy", np.zeros(3))
        super().__post_init__()


@typed
def compose(*parts: Robot | Part, name: str = "", order: Sequence[str] | None = None) -> Robot:
    """One robot of several, each on the tool of the one before: `hk.compose(rail, arm)`.

    The coordinates are those of all parts, in the order of the parts. The tips are those that carry no other part.

    Args:
        parts: robots, or `Part`s, which say where they are mounted and on what.
        name: by default the names of the parts, joined by "+".
        order: names of all joints in the order they shall have in q.

    Raises:
        ArgumentError: no part; a joint or tip name that two parts have (give one a prefix); an order that is none.
        UnknownNameError: a tip to mount on that no part before has.
    """
    given = [part if isinstance(part, Part) else Part(part) for part in parts]
    if not given:
        raise ArgumentError("the parts of a robot", (), "give at least one")
    coordinates: list[Coordinate] = []
    joints: list[Joint] = []
    bodies: list[Body] = []
    shapes: list[LinkShape] = []
    visuals: list[Visual] = []
    tips: list[Tip] = []
    carrying: set[str] = set()
    on = BASE
    for part in given:
        part.robot._check_links()
        on = on if part.on is None else part.on
        mount = _mount(on, tips)
        carrying.add(mount.name)
        origin = mount.placement @ part.pose
        first, number = len(joints), len(coordinates)

        def placed(
            index: int, T: Matrix, mount: Tip = mount, origin: Matrix = origin, first: int = first
        ) -> tuple[int, Matrix]:
            """(joint, placement there) of what the part fixes to one of its joints, or (joint -1) to its base."""
            return (mount.joint, origin @ T) if index < 0 else (first + index, T)

        # The part's joints, masses, shapes and looks, each moved to where the part is mounted.
        for c in part.robot.coordinates:
            coordinates.append(replace(c, name=part.prefix + c.name))
        for joint in part.robot.joints:
            parent, placement = placed(joint.parent, joint.placement)
            label, coordinate = part.prefix + joint.name, number + joint.coordinate
            foot = origin[:3, :3] @ joint.start + origin[:3, 3] if parent < 0 else None  # what moves carries it
            moved = replace(joint, name=label, parent=parent, placement=placement, coordinate=coordinate, foot=foot)
            joints.append(moved)
        for body in part.robot.bodies:
            index, T = placed(body.joint, pose_from(body.center))
            R = T[:3, :3]
            bodies.append(Body(index, body.mass, T[:3, 3], R @ body.inertia @ R.T))
        for shape in part.robot.shapes:
            index, T = placed(shape.joint, shape.placement)
            stands = shape.obstacle and index < 0  # what was round a robot is carried, where that rides on another
            label = part.prefix + shape.link
            on_link = part.prefix + shape.parent if shape.parent else shape.parent
            shapes.append(replace(shape, link=label, joint=index, placement=T, obstacle=stands, parent=on_link))
        for visual in part.robot.visuals:
            index, T = placed(visual.joint, visual.placement)
            visuals.append(replace(visual, link=part.prefix + visual.link, joint=index, placement=T))
        # Its tips, on the first of which the next part stands.
        ends = []
        for tip in part.robot.tips:
            index, T = placed(tip.joint, tip.placement)
            flange = None if tip.flange is None else placed(tip.joint, pose_from(tip.flange))[1][:3, 3]
            ends.append(Tip(part.prefix + tip.name, index, T, flange))
        _unlike("joint", joints)
        _unlike("tip", [*tips, *ends])
        tips += ends
        on = ends[0].name
    robot = Robot(
        name or "+".join(part.robot.name for part in given),
        tuple(coordinates),
        tuple(joints),
        tuple(tip for tip in tips if tip.name not in carrying),
        "; ".join(dict.fromkeys(part.robot.source for part in given if part.robot.source)),
        tuple(bodies),
        tuple(shapes),
        tuple(visuals),
    )
    return robot if order is None else ordered(robot, order)


@typed
def ordered(robot: Robot, order: Sequence[str]) -> Robot:
    """The same robot with its joints in another order in q. Raises: ArgumentError: not each of its joints once."""
    if sorted(order) != sorted(robot.joint_names):
        raise ArgumentError("the order of the joints", list(order), f"name each once: {', '.join(robot.joint_names)}")
    places = [list(order).index(name) for name in robot.joint_names]
    return replace(
        robot,
        coordinates=tuple(robot.coordinates[robot.joint_names.index(name)] for name in order),
        joints=tuple(replace(joint, coordinate=places[joint.coordinate]) for joint in robot.joints),
    )


@typed
def with_tool(
    robot: Robot,
    pose: PoseLike = (0, 0, 0),
    rpy: ArrayLike = (0, 0, 0),
    *,
    tip: str | None = None,
    name: str = "tool",
    trust_units: bool = False,
) -> Robot:
    """The robot with a tool: a tip at a pose in the frame of one of its tips, which it replaces.

    Args:
        pose: (4, 4), as `pose_of` makes it or a pose of another library; or a position (3,) [m].
        rpy: of a position, the turn (3,) [rad]: R = Rz(yaw) Ry(pitch) Rx(roll), as in a URDF.
        tip: the tip that carries the tool, by default the first.
        name: of the new tip.
        trust_units: take the numbers for rad and m, whatever they look like.

    Raises:
        UnknownNameError: no such tip. ArgumentError: another tip has that name; angles over a turn, which look like
        degrees, or a tool ten times as long as the arm, which looks like millimetres. ShapeError, NotFiniteError.
    """
    T = _placed("a tool", pose, rpy, None if trust_units else TRUST)
    carrier = robot._find_tip(tip)
    if not trust_units:
        reach, size = longest_reach(robot, carrier.name), float(np.linalg.norm(T[:3, 3]))
        if size > (max(SHARE * reach, 1.0) if np.isfinite(reach) else LONGEST):
            cure = f"this looks like millimetres, {robot.name} reaches {reach:.3g} m: give metres"
            raise ArgumentError("xyz of a tool", T[:3, 3].tolist(), cure)
    tips = [Tip(name, t.joint, t.placement @ T, t.arm_end) if t is carrier else t for t in robot.tips]
    _unlike("tip", tips)
    return replace(robot, tips=tuple(tips))


@typed
def with_base_pose(robot: Robot, pose: PoseLike = (0, 0, 0), rpy: ArrayLike = (0, 0, 0)) -> Robot:
    """The robot mounted at a pose (4, 4), or at a position (3,) [m] with rpy (3,) [rad], as of `with_tool`.

    Poses then count from the frame in which this one is given.

    Raises:
        ShapeError, NotFiniteError, ArgumentError.
    """
    return compose(Part(robot, pose=_placed("a robot", pose, rpy, "")), name=robot.name)


def _placed(what: str, pose: PoseLike, rpy: ArrayLike, overruled: str | None) -> Matrix:
    """The pose (4, 4) of one, or of a position (3,) and rpy (3,); overruled None: angles are in rad, however large.

    Raises:
        ShapeError, NotFiniteError, ArgumentError.
    """
    given, turn = pose_numbers(f"the pose of {what}", pose), finite(f"rpy of {what}", rpy, (3,))
    if overruled is not None:
        check_radians(f"rpy of {what}", turn, overruled)
    if given.shape == (3,):
        return pose_matrix(finite(f"the position of {what}", given), turn)
    if turn.any():
        raise ArgumentError(f"rpy of {what}", turn.tolist(), "give it with a position (3,): a pose (4, 4) has its turn")
    cure = "give a pose (4, 4), or a position (3,)"
    return tool_pose(f"the pose of {what}", given_pose(f"the pose of {what}", given, cure=cure))


def _mount(on: str, tips: Sequence[Tip]) -> Tip:
    if on == BASE and BASE not in [tip.name for tip in tips]:
        return Tip("", -1, np.eye(4))
    for tip in tips:
        if tip.name == on:
            return tip
    raise UnknownNameError("tip to mount a part on", on, [BASE, *(tip.name for tip in tips)])


def _unlike(kind: str, named: Sequence[Joint | Tip]) -> None:
    """Raises: ArgumentError where two have one name."""
    names = [thing.name for thing in named]
    for name in names:
        if names.count(name) > 1:
            cure = f"give a part a prefix, as in hk.robot.Part(arm, prefix='left_'), or the {kind} another name"
            raise ArgumentError(f"the name of two {kind}s", name, cure)


def pose_matrix(xyz: Vector, rpy: Vector) -> Matrix:
    """The pose (4, 4) at xyz (3,) [m], turned by rpy (3,) [rad]: R = Rz(yaw) Ry(pitch) Rx(roll), as in a URDF."""
    return pose_from(xyz, rotation_from_rpy(rpy.tolist()))
