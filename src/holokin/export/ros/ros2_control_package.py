"""`export_ros2_control`: the control step of a strategy as a controller of ros2_control, in a package of ROS 2."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from ...base.arguments import typed
from ...base.errors import ExportError
from ...base.types import Array, ArrayLike, Vector
from ...motion.control_step import LEAST_RCOND, fastest_rate
from ...motion.ik import leaf_value
from ...strategies import HolonomicStrategy, Strategy
from ..c.c_folder import c_texts
from ..c.c_text import Source, line
from .ros_package import (
    RosPackage,
    cpp_literal,
    leaf_strategy,
    package_names,
    package_words,
    python_header,
    tip_name,
    write_package,
)

STEPS = 200
"""Of the test in the package, of 1 ms each."""

SWING = 0.02
"""How far the joints swing in that test [rad, m]: at most 0.3 rad/s, which every arm of the catalogue can do."""

_PLUGIN = {
    "plugin_class": "ToolController",
    "base_class": "controller_interface::ControllerInterface",
    "plugin_of": "controller_interface",
    "about": "Leads a tool to targets and the joints along the leaf of a start posture",
    "depends": "controller_interface diagnostic_msgs geometry_msgs hardware_interface pluginlib rclcpp "
    "rclcpp_lifecycle urdf",
    "test_depends": "ament_cmake_gtest class_loader",
    "sources": "src/tool_controller.cpp src/tool_parameters.cpp",
    "includes": "PUBLIC c src",
    "libraries": """controller_interface::controller_interface
  hardware_interface::hardware_interface
  ${diagnostic_msgs_TARGETS}
  ${geometry_msgs_TARGETS}
  pluginlib::pluginlib
  rclcpp::rclcpp
  rclcpp_lifecycle::rclcpp_lifecycle
  urdf::urdf""",
    "test": "test_controller",
    "test_robot": "robot.urdf",
    "link_test": "  target_link_libraries(test_controller ${PROJECT_NAME} class_loader::class_loader)",
}


@dataclass(frozen=True)
class Ros2ControlPackage(RosPackage):
    """What was written: the folder, the package, its C name, its files, the operations of each C function."""

    @property
    def plugin(self) -> str:
        """The `type` of the controller in the parameters of a controller manager."""
        return f"{self.package}/ToolController"


@typed
def export_ros2_control(
    strategy: Strategy,
    folder: str | Path,
    *,
    q0: ArrayLike,
    package: str | None = None,
    name: str | None = None,
    vectors_count: int = 64,
    origin: str = "Python",
) -> Ros2ControlPackage:
    """Write a package of ROS 2: a controller of ros2_control over the exported C, with tests and README.

    At each update it takes the step of `controller` towards the pose or twist that it was last given. Where it cannot
    go on it stands still, and publishes why. The C lies in the folder c, as `export_c` writes it.

    Args:
        folder: made if need be; files there that holokin did not write are left alone, or refused if in the way.
        q0: posture (n,) whose leaf is held by default; the arm stands near this leaf when the controller is activated.
        package: name of the package; by default the C name and "_controller".
        name: C name, the prefix of all symbols; by default robot and strategy.
        vectors_count: postures of the self-test of the C.
        origin: what it was exported from, for the readme.

    Raises:
        ArgumentError: a name that is none of a package or of C++, a joint name that no URDF holds.
        ExportError: no joint to spare, several tips, a task of other coordinates.
        As of `export_c`.
    """
    holonomic = leaf_strategy(strategy, "take one of the controllers of ros2_controllers for this arm")
    short, chosen = package_names(strategy, name, package, "controller")
    source, c = c_texts(strategy, q0, 0.001, short, True, vectors_count, origin)
    robot = strategy.task.robot
    words = package_words(source, chosen, _PLUGIN) | {
        "origin": line(origin),
        "robot_string": cpp_literal(robot.name),
        "lower": _limits(joint.lower for joint in robot.coordinates),
        "upper": _limits(joint.upper for joint in robot.coordinates),
        "fastest": _limits(fastest_rate(joint) for joint in robot.coordinates),
        "angular_flags": ", ".join("true" if flag else "false" for flag in holonomic.constraint.angular),
        "level": ", ".join(repr(float(c)) for c in source.leaf),
        "rows_count": len(source.leaf),
    }
    files, operations = write_package(source, Path(folder), c, "control", words, _python_steps(source, holonomic))
    return Ros2ControlPackage(Path(folder), chosen, source.name, files, operations)


def _limits(values: Iterable[float]) -> str:
    """Numbers of C++; HUGE_VAL for none."""
    return ", ".join(repr(float(x)) if np.isfinite(x) else ("HUGE_VAL" if x > 0 else "-HUGE_VAL") for x in values)


def _python_steps(source: Source, strategy: HolonomicStrategy) -> str:
    """Targets of a loop of 1 kHz and the joints of Python after each, as a header of C++."""
    robot, rng = strategy.task.robot, np.random.default_rng(0)
    for size in (SWING, SWING, SWING, SWING / 10, SWING / 100):
        poses, joints = _swing(source, strategy, size * rng.uniform(-1.0, 1.0, robot.n))
        if len(joints):
            break
    else:
        raise ExportError("no motion near the start keeps the joint limits", "choose another start posture")
    away, off = _off_the_leaf(source, strategy, rng)
    tip = line(tip_name(strategy.task))
    sentence = f" of the tip {tip}, one\n   each millisecond, and the joints of Python after each."
    more = [
        f"const double START[{robot.n}] = {{{', '.join(repr(float(x)) for x in source.q0)}}};",
        f"/* So far from the leaf [its units]: {off!r}. */",
        f"constexpr double OFF_BY = {off!r};",
        f"const double OFF_THE_LEAF[{robot.n}] = {{{', '.join(repr(float(x)) for x in away)}}};",
    ]
    return python_header(strategy.task, sentence, poses, joints, more)


def _swing(source: Source, strategy: HolonomicStrategy, swing: Vector) -> tuple[Array, Array]:
    """Poses (k, 4, 4) of a motion from the start, and the joints (k, n) by control steps; none if a step is slowed."""
    from scipy.spatial.transform import Rotation

    task, dt, q, joints = strategy.task, source.dt, source.q0, []
    shares = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, STEPS + 1))
    poses = np.array([task.robot.pose(source.q0 + share * swing, tip_name(task)) for share in shares])
    for T, then in pairwise(poses):
        turn = Rotation.from_matrix(then[:3, :3] @ T[:3, :3].T).as_rotvec()
        twist = np.concatenate([then[:3, 3] - T[:3, 3], turn]) / dt
        given = (then[:3, 3], twist[:3]) if task.orientation is None else (then, twist)
        dq, scale, rcond, *_ = source.functions["step"](q, *given, source.parameters)
        if not (scale >= 1.0 and rcond > LEAST_RCOND):
            return poses[1:], np.zeros((0, task.n))
        q = q + dt * dq
        joints.append(q)
    return poses[1:], np.array(joints)


def _off_the_leaf(source: Source, strategy: HolonomicStrategy, rng: np.random.Generator) -> tuple[Vector, float]:
    """A posture (n,) away from the leaf of the start, within the limits, and by how much."""
    robot = strategy.task.robot
    lower, upper = np.nextafter([(j.lower, j.upper) for j in robot.coordinates], source.q0[:, None]).T
    best, most = source.q0, 0.0
    for q in source.q0 + rng.uniform(-0.5, 0.5, (64, robot.n)):
        inside = np.clip(q, lower, upper)
        by = float(np.abs(strategy.constraint.nearest(leaf_value(strategy, inside) - source.leaf)).max())
        if by > most:
            best, most = inside, by
    return best, most
