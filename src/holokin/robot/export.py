"""A robot written down for other libraries: URDF and MJCF texts with the same kinematics, and no meshes."""

from __future__ import annotations

import warnings

import numpy as np

from ..errors import ArgumentError
from ..types import Matrix
from .model import Joint, Robot
from .tree import motion

LINK_MASS, LINK_INERTIA = 1.0, 0.01
"""Of every link [kg, kg m^2]: placeholders, since some readers refuse links without; never used for dynamics."""


def to_urdf(robot: Robot) -> str:
    """The URDF of a robot: links named after their joints, one fixed link for each tip, named as the tip.

    Raises:
        ArgumentError: joints that move together (mimics), which this does not write.
    """
    inertia = " ".join(f'{axis}="{LINK_INERTIA}"' for axis in ("ixx", "iyy", "izz")) + ' ixy="0" ixz="0" iyz="0"'
    links = ["base", *(f"{joint.name}_link" for joint in robot.joints), *(tip.name for tip in robot.tips)]
    lines = [f'<robot name="{robot.name}">']
    for link in links:
        lines.append(
            f'  <link name="{link}"><inertial><mass value="{LINK_MASS}"/><inertia {inertia}/></inertial></link>'
        )
    for joint in robot.joints:
        c = _coordinate(robot, joint)
        bounded = np.isfinite([c.lower, c.upper]).all()
        kind = "prismatic" if joint.kind == "prismatic" else "revolute" if bounded else "continuous"
        speed = c.max_velocity if np.isfinite(c.max_velocity) else 100.0
        span = f'lower="{c.lower!r}" upper="{c.upper!r}" ' if bounded else ""
        span = span or ('lower="-100" upper="100" ' if kind == "prismatic" else "")
        lines += [
            f'  <joint name="{joint.name}" type="{kind}">',
            f"    {_origin(_rest(joint))}",
            f'    <parent link="{links[joint.parent + 1]}"/><child link="{joint.name}_link"/>',
            f'    <axis xyz="{_numbers(joint.axis)}"/><limit {span}effort="1000" velocity="{speed!r}"/>',
            "  </joint>",
        ]
    for tip in robot.tips:
        lines += [
            f'  <joint name="{tip.name}_fixed" type="fixed">{_origin(tip.placement)}',
            f'    <parent link="{links[tip.joint + 1]}"/><child link="{tip.name}"/></joint>',
        ]
    return "\n".join([*lines, "</robot>", ""])


def to_mjcf(robot: Robot) -> str:
    """The MJCF of a robot for MuJoCo: a body for each joint, a site for each tip, named as the tip.

    Raises:
        ArgumentError: joints that move together (mimics), which this does not write.
    """
    children: dict[int, list[int]] = {}
    for k, joint in enumerate(robot.joints):
        children.setdefault(joint.parent, []).append(k)

    def inside(index: int, depth: int) -> list[str]:
        pad = "  " * depth
        lines = [f'{pad}<site name="{tip.name}" {_pose(tip.placement)}/>' for tip in robot.tips if tip.joint == index]
        for k in children.get(index, []):
            joint = robot.joints[k]
            c = _coordinate(robot, joint)
            kind = "slide" if joint.kind == "prismatic" else "hinge"
            bounded = np.isfinite([c.lower, c.upper]).all()
            span = f'limited="true" range="{c.lower!r} {c.upper!r}"' if bounded else 'limited="false"'
            diagonal = _numbers([LINK_INERTIA] * 3)
            lines += [
                f'{pad}<body name="{joint.name}_link" {_pose(_rest(joint))}>',
                f'{pad}  <inertial pos="0 0 0" mass="{LINK_MASS}" diaginertia="{diagonal}"/>',
                f'{pad}  <joint name="{joint.name}" type="{kind}" axis="{_numbers(joint.axis)}" {span}/>',
                *inside(k, depth + 1),
                f"{pad}</body>",
            ]
        return lines

    head = [f'<mujoco model="{robot.name}">', '  <compiler angle="radian" autolimits="false"/>', "  <worldbody>"]
    return "\n".join([*head, *inside(-1, 2), "  </worldbody>", "</mujoco>", ""])


def _coordinate(robot: Robot, joint: Joint):
    c = robot.coordinates[joint.coordinate]
    if joint.multiplier != 1.0 or c.name != joint.name:
        raise ArgumentError(f"joint {joint.name!r}", f"a mimic of {c.name!r}", "lock it, or use the robot's own file")
    return c


def _rest(joint: Joint) -> Matrix:
    """The placement with the joint's offset in it."""
    return joint.placement @ motion(joint.kind, joint.axis, joint.offset)


def _numbers(values: object) -> str:
    return " ".join(repr(float(v)) for v in np.asarray(values, dtype=float))


def _origin(T: Matrix) -> str:
    from scipy.spatial.transform import Rotation

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of gimbal lock: any of the equal triples serves
        rpy = Rotation.from_matrix(T[:3, :3]).as_euler("xyz")
    return f'<origin xyz="{_numbers(T[:3, 3])}" rpy="{_numbers(rpy)}"/>'


def _pose(T: Matrix) -> str:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat()
    return f'pos="{_numbers(T[:3, 3])}" quat="{_numbers([w, x, y, z])}"'
