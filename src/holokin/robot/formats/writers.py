"""A robot written down for other libraries: URDF and MJCF texts with its kinematics, limits, masses and servos."""

from __future__ import annotations

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError
from ...base.poses import pose_from
from ...base.types import ArrayLike, Matrix, numbers, positive
from ..joints import FARTHEST, Body, Coordinate, Joint
from ..links import DENSITY, Servo, drawn_links, knows_masses, merged, rest, size, weighed
from ..model import Robot
from ..shapes.link_shapes import LinkShape

LEAST_MASS, LEAST_INERTIA = 1e-9, 1e-12
"""What a moving link without mass, or with one at a point, gets in MJCF [kg, kg m^2]: MuJoCo wants some, and so little
changes nothing."""

EFFORT = 1000.0
"""Largest torque or force of a joint in a URDF [N m, N], which must name one: more than arms of the catalogue have."""

COLOR = "0.90 0.45 0.13 1"
"""Of the links [rgba]."""


@typed
def to_urdf(robot: Robot, *, density: float = DENSITY, effort: ArrayLike = EFFORT) -> str:
    """The URDF of a robot: links named after their joints, one fixed link for each tip, named as the tip.

    A mounting is a fixed joint from the base to a link "JOINT_foot", on which the first joint hangs.
    Joints that follow others are written as <mimic>, with their own limits. No limit of position, speed or both is
    written as 1e6, which `from_urdf` reads as none. The visuals are capsules along the links.

    Args:
        density: of the solid capsules whose masses stand in for those of a robot that does not know its own
            [kg/m^3]; a comment in the file says so.
        effort: largest torque or force of each joint [N m, N], which a URDF must name: a number, or (n,).

    Raises:
        ArgumentError: a joint that follows one which the robot does not have; a density or an effort that is not
            positive. ShapeError.
    """
    # Links with their masses and drawings, then the tips and the feet.
    efforts = _efforts(robot, effort)
    heavy, names = weighed(robot, density), link_names(robot)
    masses, shapes = merged(heavy.bodies), drawn_links(robot)
    lines = ['<?xml version="1.0"?>', *_remarks(robot, density), f"<robot name={_quoteattr(robot.name)}>"]
    for k, link in enumerate(names, -1):
        mass = masses.get(k)
        inner = [_urdf_inertial(mass)] if mass is not None else []
        inner += [_urdf_visual(shape) for shape in shapes if shape.joint == k]
        lines += [f"  <link name={_quoteattr(link)}>", *inner, "  </link>"]
    feet = {k: f"{joint.name}_foot" for k, joint in enumerate(robot.joints) if joint.start.any()}
    lines += [f"  <link name={_quoteattr(name)}/>" for name in [*(tip.name for tip in robot.tips), *feet.values()]]
    for k, name in feet.items():
        place = _origin(pose_from(robot.joints[k].start))
        ends = f"<parent link={_quoteattr(names[0])}/><child link={_quoteattr(name)}/>"
        lines += [f'  <joint name={_quoteattr(f"{name}_fixed")} type="fixed">{place}{ends}</joint>']
    # Joints with their limits, and the laws by which they follow others.
    for k, joint in enumerate(robot.joints):
        c, follows = _law(robot, joint)
        kind, span = _urdf_range(joint, c if follows is None else joint)
        mimic = ""
        if follows is not None:
            mimic = f'<mimic joint={_quoteattr(c.name)} multiplier="{follows[0]!r}" offset="{follows[1]!r}"/>'
        speed = min(c.max_velocity if follows is None else joint.max_velocity, FARTHEST)
        lines += [
            f'  <joint name={_quoteattr(joint.name)} type="{kind}">',
            f"    {_origin(_from_foot(joint, _zero(joint, follows)))}",
            f"    <parent link={_quoteattr(feet.get(k, names[joint.parent + 1]))}/>"
            f"<child link={_quoteattr(names[k + 1])}/>",
            f'    <axis xyz="{_numbers(joint.axis)}"/>{mimic}',
            f'    <limit {span}effort="{efforts[joint.coordinate]!r}" velocity="{float(speed)!r}"/>',
            "  </joint>",
        ]
    for tip in robot.tips:
        lines += [
            f'  <joint name={_quoteattr(tip.name + "_fixed")} type="fixed">{_origin(tip.placement)}',
            f"    <parent link={_quoteattr(names[tip.joint + 1])}/><child link={_quoteattr(tip.name)}/></joint>",
        ]
    return "\n".join([*lines, "</robot>", ""])


@typed
def to_mjcf(
    robot: Robot, *, servo: Servo | None = None, density: float = DENSITY, effort: ArrayLike | None = None
) -> str:
    """The MJCF of a robot for MuJoCo: a body for each joint, a site for each tip, named as the tip.

    A mounting is a body "JOINT_foot" without a joint, which carries that of the first joint.
    Joints that follow others are tied by <equality>. MuJoCo has no speed limits. The geoms are capsules along the links
    that touch nothing. With a servo each coordinate has an actuator, named as its joint, in the order of q.

    Args:
        servo: what drives the joints, see `servo`; None for no actuators.
        density: of the solid capsules whose masses stand in for those of a robot that does not know its own
            [kg/m^3]; a comment in the file says so.
        effort: largest torque or force of each actuator [N m, N], a number, or (n,); None for no limit.

    Raises:
        ArgumentError: as of `to_urdf`; a servo of another number of joints. ShapeError.
    """
    if servo is not None and len(servo.damping) != robot.n:
        raise ArgumentError("the servo's joints", len(servo.damping), f"make one for the {robot.n} of {robot.name!r}")
    heavy, names = weighed(robot, density), link_names(robot)
    masses, shapes, compensated = merged(heavy.bodies), drawn_links(robot), servo is not None and servo.compensated
    children: dict[int, list[int]] = {}
    for k, joint in enumerate(robot.joints):
        children.setdefault(joint.parent, []).append(k)
    ties: list[str] = []

    # The bodies, each inside the one that carries it.
    def inside(index: int, depth: int) -> list[str]:
        pad = "  " * depth
        lines = [f"{pad}{_mjcf_geom(shape)}" for shape in shapes if shape.joint == index]
        sites = [tip for tip in robot.tips if tip.joint == index]
        lines += [f'{pad}<site name={_quoteattr(tip.name)} {_pose(tip.placement)} size="0.005"/>' for tip in sites]
        for k in children.get(index, []):
            joint = robot.joints[k]
            c, follows = _law(robot, joint)
            kind = "slide" if joint.kind == "prismatic" else "hinge"
            span, carried = _mjcf_range(c if follows is None else joint), ' gravcomp="1"' if compensated else ""
            if follows is not None:
                law = f'polycoef="{follows[1]!r} {follows[0]!r} 0 0 0"'
                ties.append(f"    <joint joint1={_quoteattr(joint.name)} joint2={_quoteattr(c.name)} {law}/>")
            # A body with its joint, and all that hangs on it.
            place = _pose(_from_foot(joint, _zero(joint, follows)))
            body = [
                f"{pad}<body name={_quoteattr(names[k + 1])} {place}{carried}>",
                f"{pad}  {_mjcf_inertial(masses.get(k))}",
                f'{pad}  <joint name={_quoteattr(joint.name)} type="{kind}" axis="{_numbers(joint.axis)}" {span}/>',
                *inside(k, depth + 1),
                f"{pad}</body>",
            ]
            if joint.start.any():
                foot = f"<body name={_quoteattr(f'{joint.name}_foot')} {_pose(pose_from(joint.start))}>"
                body = [f"{pad}{foot}", *body, f"{pad}</body>"]
            lines += body
        return lines

    # The whole file: the base with all bodies, ties of followers, actuators.
    body = [f"    <body name={_quoteattr(names[0])}>", *inside(-1, 3), "    </body>"]
    if -1 in masses:
        body.insert(1, f"      {_mjcf_inertial(masses[-1])}")
    lines = [*_remarks(robot, density), f"<mujoco model={_quoteattr(robot.name)}>"]
    lines += ['  <compiler angle="radian" autolimits="false"/>', "  <worldbody>", *body, "  </worldbody>"]
    lines += ["  <equality>", *ties, "  </equality>"] if ties else []
    lines += ["  <actuator>", *_actuators(robot, servo, effort), "  </actuator>"] if servo is not None else []
    return "\n".join([*lines, "</mujoco>", ""])


def _quoteattr(text: str) -> str:
    """A value as it stands in XML, in quotation marks."""
    from xml.sax.saxutils import quoteattr as quoted  # it imports a client of the web: 30 ms

    return quoted(text)


def _remarks(robot: Robot, density: float) -> list[str]:
    """Comments: whether the masses are the robot's own."""
    if knows_masses(robot):
        return ["<!-- Masses and inertias are those of the robot's description. The shapes are drawings. -->"]
    return [
        f"<!-- Placeholders: this robot's description has no masses. Those here are of solid capsules of "
        f"{density:g} kg/m^3 along its links. -->"
    ]


def _law(robot: Robot, joint: Joint) -> tuple[Coordinate, tuple[float, float] | None]:
    """The coordinate of a joint, and (multiplier, offset) if it follows another one's joint. Raises: ArgumentError."""
    c = robot.coordinates[joint.coordinate]
    if joint.name == c.name and joint.multiplier == 1.0:
        return c, None
    for leader in robot.joints:
        if leader.name == c.name and leader.multiplier == 1.0:
            return c, (joint.multiplier, joint.offset)
    cure = "choose base and tip so that the chain has that joint, or lock it"
    raise ArgumentError(f"joint {joint.name!r}", f"a follower of {c.name!r}, which the robot does not have", cure)


def _zero(joint: Joint, follows: tuple[float, float] | None) -> Matrix:
    """Where a joint is at 0: a leader's offset goes into its placement, a follower's into its law."""
    return rest(joint) if follows is None else joint.placement


def _from_foot(joint: Joint, T: Matrix) -> Matrix:
    """The placement (4, 4) of a joint as seen from its foot."""
    return pose_from(T[:3, 3] - joint.start, T[:3, :3])


def _range(of: Coordinate | Joint) -> tuple[float, float]:
    return float(np.clip(of.lower, -FARTHEST, FARTHEST)), float(np.clip(of.upper, -FARTHEST, FARTHEST))


def _urdf_range(joint: Joint, of: Coordinate | Joint) -> tuple[str, str]:
    """(type, limits) of a joint."""
    if joint.kind != "prismatic" and not np.isfinite([of.lower, of.upper]).any():
        return "continuous", ""
    low, high = _range(of)
    return "prismatic" if joint.kind == "prismatic" else "revolute", f'lower="{low!r}" upper="{high!r}" '


def _mjcf_range(of: Coordinate | Joint) -> str:
    if not np.isfinite([of.lower, of.upper]).any():
        return 'limited="false"'
    low, high = _range(of)
    return f'limited="true" range="{low!r} {high!r}"'


def _actuators(robot: Robot, servo: Servo, effort: ArrayLike | None) -> list[str]:
    lines = []
    efforts = None if effort is None else _efforts(robot, effort)
    gains = zip(servo.stiffness.tolist(), servo.damping.tolist(), strict=True)
    for i, (c, (stiffness, damping)) in enumerate(zip(robot.coordinates, gains, strict=True)):
        drive = f"joint={_quoteattr(c.name)} name={_quoteattr(c.name)}"
        drive += f' kp="{stiffness!r}"' if servo.kind == "position" else ""
        drive += f' kv="{damping!r}"' if servo.kind != "torque" else ""
        drive += "" if efforts is None else f' forcelimited="true" forcerange="{-efforts[i]!r} {efforts[i]!r}"'
        lines.append(f"    <{'motor' if servo.kind == 'torque' else servo.kind} {drive}/>")
    return lines


def _efforts(robot: Robot, effort: ArrayLike) -> list[float]:
    given = numbers("effort", effort)
    if given.ndim:
        robot.checked(given, "effort")
    return [positive("effort", float(v)) for v in np.broadcast_to(given, (robot.n,))]


def link_names(robot: Robot) -> list[str]:
    """Names of the base and of each joint's link, all of them unlike the tips'."""
    used = {tip.name for tip in robot.tips}
    names = []
    for name in ("base", *(f"{joint.name}_link" for joint in robot.joints)):
        while name in used:
            name += "_"
        used.add(name)
        names.append(name)
    return names


def _urdf_inertial(body: Body) -> str:
    entries = zip(("xx", "xy", "xz", "yy", "yz", "zz"), body.inertia[np.triu_indices(3)], strict=True)
    inertia = " ".join(f'i{name}="{float(value)!r}"' for name, value in entries)
    origin = f'<origin xyz="{_numbers(body.center)}" rpy="0 0 0"/>'
    return f'    <inertial>{origin}<mass value="{float(body.mass)!r}"/><inertia {inertia}/></inertial>'


def _urdf_visual(part: LinkShape) -> str:
    """A cylinder and two balls: a URDF has no capsules."""
    radius, length = size(part)
    half = length / 2
    parts = []
    for z in (-half, half) if half else (0.0,):
        center = part.placement[:3, :3] @ [0, 0, z] + part.placement[:3, 3]
        place = f'<origin xyz="{_numbers(center)}" rpy="0 0 0"/>'
        parts.append(f'{place}<geometry><sphere radius="{radius!r}"/></geometry>')
    if half:
        cylinder = f'<cylinder radius="{radius!r}" length="{2 * half!r}"/>'
        parts.append(f"{_origin(part.placement)}<geometry>{cylinder}</geometry>")
    return "\n".join(f"    <visual>{text}</visual>" for text in parts)


def _mjcf_geom(part: LinkShape) -> str:
    radius, length = size(part)
    half = length / 2
    form = f'type="capsule" {_pose(part.placement)} size="{radius!r} {half!r}"'
    form = form if half else f'type="sphere" {_pose(part.placement)} size="{radius!r}"'
    return f'<geom {form} mass="0" contype="0" conaffinity="0" rgba="{COLOR}"/>'


def _mjcf_inertial(body: Body | None) -> str:
    if body is None or not body.mass:
        return f'<inertial pos="0 0 0" mass="{LEAST_MASS!r}" diaginertia="{_numbers([LEAST_INERTIA] * 3)}"/>'
    moments, axes = np.linalg.eigh(body.inertia)
    T, moments = np.eye(4), np.maximum(moments, LEAST_INERTIA)
    T[:3, :3], T[:3, 3] = axes * np.linalg.det(axes), body.center
    return f'<inertial {_pose(T)} mass="{float(body.mass)!r}" diaginertia="{_numbers(moments)}"/>'


def _numbers(values: object) -> str:
    return " ".join(repr(float(v)) for v in np.asarray(values, dtype=float))


def _origin(T: Matrix) -> str:
    """R = Rz(yaw) Ry(pitch) Rx(roll). Near pitch = 90 degrees the yaw is poorly known, and the roll makes up for it."""
    R = T[:3, :3]
    yaw = np.arctan2(R[1, 0], R[0, 0])
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    side = np.cos(yaw) * R[1] - np.sin(yaw) * R[0]  # (0, cos roll, -sin roll)
    return f'<origin xyz="{_numbers(T[:3, 3])}" rpy="{_numbers([np.arctan2(-side[2], side[1]), pitch, yaw])}"/>'


def _pose(T: Matrix) -> str:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
    return f'pos="{_numbers(T[:3, 3])}" quat="{_numbers([w, x, y, z])}"'
