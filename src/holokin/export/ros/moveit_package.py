"""`export_moveit`: the exported C of a strategy as a kinematics plugin of MoveIt 2, in a package of ROS 2."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, ExportError
from ...base.types import ArrayLike
from ...motion.ik import InverseStatus, ik
from ...strategies import HolonomicStrategy, Strategy
from ..c.c_folder import c_texts
from ..c.c_text import Source, line
from .ros_package import (
    RosPackage,
    check_word,
    leaf_strategy,
    markdown_cell,
    package_names,
    package_words,
    python_header,
    tip_name,
    write_package,
)

MOST = 1000
"""Pieces of the way to a pose that the plugin tries at most, by default: 781 of 786 poses that 20,000 reach anywhere
within the joint ranges of a Panda."""

POSES = 16
"""Of the test in the package."""

_PLUGIN = {
    "plugin_class": "KinematicsPlugin",
    "base_class": "kinematics::KinematicsBase",
    "plugin_of": "moveit_core",
    "about": "Inverse kinematics on the leaf of a start posture",
    "depends": "geometry_msgs moveit_core moveit_msgs pluginlib rcl_interfaces rclcpp",
    "test_depends": "ament_cmake_gtest class_loader srdfdom urdf",
    "sources": "src/kinematics_plugin.cpp",
    "includes": "PRIVATE c",
    "libraries": """moveit_core::moveit_kinematics_base
  moveit_core::moveit_robot_model
  moveit_core::moveit_robot_state
  pluginlib::pluginlib
  rclcpp::rclcpp""",
    "test": "test_plugin",
    "test_robot": "robot",
    "link_test": """  target_link_libraries(test_plugin
    class_loader::class_loader
    moveit_core::moveit_kinematics_base
    moveit_core::moveit_robot_model
    moveit_core::moveit_robot_state)
  add_dependencies(test_plugin ${PROJECT_NAME})""",
}


@dataclass(frozen=True)
class MoveItPackage(RosPackage):
    """What was written: the folder, the package, its C name, its files, the operations of each C function."""

    @property
    def plugin(self) -> str:
        """What `kinematics_solver` of a kinematics.yaml is set to."""
        return f"{self.package}/KinematicsPlugin"


@typed
def export_moveit(
    strategy: Strategy,
    folder: str | Path,
    *,
    q0: ArrayLike,
    package: str | None = None,
    group: str = "arm",
    name: str | None = None,
    limits: bool = True,
    vectors_count: int = 64,
    origin: str = "Python",
) -> MoveItPackage:
    """Write a package of ROS 2: a kinematics plugin of MoveIt 2 over the exported C, with tests and README.

    The plugin answers as `ik(strategy, q0)`: the same pose gives the same joints, whatever the seed.
    The C lies in the folder c, as `export_c` writes it.

    Args:
        folder: made if need be; files there that holokin did not write are left alone, or refused if in the way.
        q0: posture (n,) from which the plugin solves, on its leaf.
        package: name of the package; by default the C name and "_moveit_plugin".
        group: the planning group, for the file config/kinematics.yaml.
        name: C name, the prefix of all symbols; by default robot and strategy.
        limits: keep the position limits of the joints; those of MoveIt's model are kept besides.
        vectors_count: postures of the self-test of the C.
        origin: what it was exported from, for the readme.

    Raises:
        ArgumentError: a name that is none of a package or of C++, a joint name that no URDF holds.
        ExportError: no joint to spare, several tips, a task of other coordinates.
        As of `export_c`.
    """
    holonomic = leaf_strategy(strategy, "take one of MoveIt's own solvers for this arm")
    short, chosen = package_names(strategy, name, package, "moveit_plugin")
    check_word("the group", group)
    if "." in group:
        raise ArgumentError("the group", group, "the names of ROS parameters have no dots within: choose another")
    source, c = c_texts(strategy, q0, 0.001, short, limits, vectors_count, origin)
    words = package_words(source, chosen, _PLUGIN) | {
        "origin": line(origin),
        "most": MOST,
        "yaml_group": json.dumps(group, ensure_ascii=False),
        "group_line": markdown_cell(group),
    }
    files, operations = write_package(source, Path(folder), c, "moveit", words, _python_joints(source, holonomic))
    return MoveItPackage(Path(folder), chosen, source.name, files, operations)


def _python_joints(source: Source, strategy: HolonomicStrategy) -> str:
    """Poses, and the joints that Python finds for them, as a header of C++."""
    robot, tip = strategy.task.robot, tip_name(strategy.task)
    solver, rng = ik(strategy, source.q0, limits=source.limits), np.random.default_rng(0)
    near = source.q0 + rng.uniform(-0.3, 0.3, (4 * POSES, robot.n))
    poses = np.array([robot.pose(q, tip) for q in near])
    solutions = solver.batch(poses if strategy.task.orientation is not None else poses[:, :3, 3])
    reached = np.flatnonzero(solutions.status == InverseStatus.REACHED)[:POSES]
    if not len(reached):
        raise ExportError("no pose near the start is reached within the joint limits", "choose another start posture")
    return python_header(strategy.task, " and the joints of Python.", poses[reached], solutions.q[reached])
