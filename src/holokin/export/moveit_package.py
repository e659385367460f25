"""`export_moveit`: the exported C of a strategy as a kinematics plugin of MoveIt 2, in a package of ROS 2."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.shown import Shown
from ..base.types import ArrayLike
from ..errors import ArgumentError, ExportError
from ..inverse_kinematics import InverseStatus, inverse
from ..motion import has_leaf
from ..robot import to_urdf
from ..robot.model_texts import link_names
from ..strategies import HolonomicStrategy, Strategy
from ..tasks.frames import TipFrame
from ..tasks.task import Task
from ..version import __version__
from .c_folder import c_name, c_texts, operations_of, write_texts
from .c_text import RESERVED, Source, line, text

_ROS_WORDS = """
angles boost class_loader eigen geometry_msgs kinematics moveit moveit_core moveit_msgs pluginlib rcl rcl_interfaces
rclcpp rcpputils rcutils rosidl srdf srdfdom std_msgs testing urdf urdfdom
"""

ROS_NAMES = frozenset(_ROS_WORDS.split())
"""Packages and namespaces that the plugin uses itself."""

PACKAGE = re.compile(r"[a-z](_?[a-z0-9])+")
"""Names of packages, as REP 144 has them: no underscore at the end, no two in a row."""

MOST = 1000
"""Pieces of the way to a pose that the plugin tries at most, by default: 781 of 786 poses that 20,000 reach anywhere
within the joint ranges of a Panda."""

POSES = 16
"""Of the test in the package."""

_FILES = {
    "src/kinematics_plugin.hpp": "kinematics_plugin.hpp",
    "src/kinematics_plugin.cpp": "kinematics_plugin.cpp",
    "src/pose_conversions.hpp": "pose_conversions.hpp",
    "test/test_plugin.cpp": "test_plugin.cpp",
    "test/robot.srdf": "robot.srdf",
    "config/kinematics.yaml": "kinematics.yaml",
    "plugin_description.xml": "plugin_description.xml",
    "package.xml": "package.xml",
    "README.md": "README.md",
    "CMakeLists.txt": "CMakeLists.txt",
}


@dataclass(frozen=True)
class MoveItPackage(Shown):
    """What was written: the folder, the package, its C name, its files, the operations of each C function."""

    folder: Path
    package: str
    name: str
    files: tuple[str, ...]
    operations: dict[str, int]

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

    The plugin answers as `inverse(strategy, q0, limits=True)`: the same pose gives the same joints, whatever the seed.
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
    law = _with_leaf(strategy)
    robot = strategy.task.robot
    short = c_name(f"{robot.name}_{strategy.name}") if name is None else str(name)
    chosen = _package_name(short, package)
    for joint in robot.joints:
        _check_word("the name of a joint", joint.name)
    _check_word("the name of the tip", _tip(strategy.task))
    _check_word("the group", group)
    if "." in group:
        raise ArgumentError("the group", group, "the names of ROS parameters have no dots within: choose another")
    source, c = c_texts(strategy, q0, 0.001, short, limits, vectors_count, origin)
    words = source.words | _words(source, chosen, group) | {"version": __version__, "origin": line(origin)}
    texts = {f"c/{file}": content for file, content in c.items()}
    texts |= {file: text(f"moveit/{template}", words) for file, template in _FILES.items()}
    texts["test/robot.urdf"] = _marked(to_urdf(robot))
    texts["test/python_joints.h"] = _python_joints(source, law)
    write_texts(Path(folder), texts, f"project({chosen} LANGUAGES C CXX)")
    return MoveItPackage(Path(folder), chosen, source.name, tuple(texts), operations_of(source))


def _with_leaf(strategy: Strategy) -> HolonomicStrategy:
    """The strategy. Raises: ExportError where MoveIt has no words for the task, or C no inverse."""
    task = strategy.task
    if task.frames != 1 or not isinstance(getattr(task, "frame", None), TipFrame):
        cure = "export hk.pose or hk.position of one tip, each for a group of its own"
        raise ExportError(f"{task.name} is not about one tip in the base frame", cure)
    if task.n <= task.m:
        fact = f"{task.robot.name!r} has no joint to spare, so there is no leaf and the C has no inverse kinematics"
        raise ExportError(fact, "take one of MoveIt's own solvers for this arm")
    if not has_leaf(strategy):
        fact = f"{strategy.name!r} has no constraint, so there is no leaf on which a pose has its joints"
        raise ExportError(fact, "take a holonomic strategy, as hk.holonomic(task, hk.lock(2))")
    return strategy


def _package_name(short: str, package: str | None) -> str:
    name = f"{short}_moveit_plugin" if package is None else package
    for what, word in (("the name", short), ("the package", name)):
        if word in RESERVED | ROS_NAMES:
            raise ArgumentError(what, word, "ROS, MoveIt or C++ uses this name: give one of your own")
    if not PACKAGE.fullmatch(name):
        cure = "a package of ROS has lower-case letters, digits and single underscores, and begins with a letter"
        raise ArgumentError("the package", name, cure)
    return name


def _check_word(what: str, word: str) -> None:
    """Raises: ArgumentError for a name that XML, YAML or a log cannot show as it is."""
    if not word.strip() or not word.isprintable():
        raise ArgumentError(what, word, "give a name of printable characters")


def _tip(task: Task) -> str:
    """The name of the tip that the task is about: by default the robot's first one."""
    return task.tip or task.robot.tips[0].name


def _literal(word: str) -> str:
    """A string of C++: UTF-8, with octal numbers for all but plain characters."""
    plain = [chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in word.encode()]
    return '"' + "".join(plain) + '"'


def _cell(word: str) -> str:
    """A name in a table or a line of Markdown."""
    return line(word).replace("|", "/").replace("`", "'")


def _words(source: Source, package: str, group: str) -> dict[str, Any]:
    """What the texts need besides the words of the C."""
    from xml.sax.saxutils import escape, quoteattr  # it imports a client of the web: 30 ms

    task, robot = source.strategy.task, source.strategy.task.robot
    tip, rows = _tip(task), []
    for joint, value in zip(robot.coordinates, source.q0, strict=True):
        bounds = " | ".join(f"{b:.6g}" if np.isfinite(b) else "none" for b in (joint.lower, joint.upper))
        rows.append(f"| {_cell(joint.name)} | {joint.unit} | {bounds} | {value:.6g} |")
    return {
        "package": package,
        "most": MOST,
        "joint_strings": ",\n".join(f"    {_literal(joint)}" for joint in robot.joint_names),
        "tip_string": _literal(tip),
        "tip_line": f"`{_cell(tip)}`",
        "set_target": "  target = {T[3], T[7], T[11]};" if task.orientation is None else "  target = T;",
        "task_note": _task_note(task),
        "xml_description": escape(f"Inverse kinematics on the leaf of a start posture: {source.words['title']}"),
        "xml_robot": quoteattr(robot.name),
        "xml_base": quoteattr(link_names(robot)[0]),
        "xml_tip": quoteattr(tip),
        "xml_joints": "\n".join(f"    <joint name={quoteattr(joint.name)}/>" for joint in robot.joints),
        "yaml_group": json.dumps(group, ensure_ascii=False),
        "group_line": _cell(group),
        "joint_rows": "\n".join(rows),
    }


def _task_note(task: Task) -> str:
    """What the task leaves free, for the readme."""
    if task.m == 6:
        return ""
    rows = ", ".join(task.row_names)
    free = "The rest of the pose is left free: the plugin does not lead the tip there."
    return f"- **The task has the rows {rows}.** {free}\n"


def _python_joints(source: Source, strategy: HolonomicStrategy) -> str:
    """Poses, and the joints that Python finds for them, as a header of C++."""
    from scipy.spatial.transform import Rotation

    robot, tip = strategy.task.robot, _tip(strategy.task)
    ik, rng = inverse(strategy, source.q0, limits=source.limits), np.random.default_rng(0)
    near = source.q0 + rng.uniform(-0.3, 0.3, (4 * POSES, robot.n))
    poses = np.array([robot.pose(q, tip) for q in near])
    found = ik.batch(poses if strategy.task.orientation is not None else poses[:, :3, 3])
    kept = np.flatnonzero(found.status == InverseStatus.REACHED)[:POSES]
    if not len(kept):
        raise ExportError("no pose near the start is reached within the joint limits", "choose another start posture")
    quaternions = Rotation.from_matrix(poses[kept, :3, :3]).as_quat()
    tables = {
        f"POSES[{len(kept)}][7]": [[*T[:3, 3], *o] for T, o in zip(poses[kept], quaternions, strict=True)],
        f"JOINTS[{len(kept)}][{robot.n}]": found.q[kept].tolist(),
    }
    lines = [
        f"/* Written by holokin {__version__}. Poses (x, y, z, quaternion x, y, z, w) and the joints of Python. */",
        "#pragma once",
        "#include <cstddef>",
        "#include <string>",
        f"constexpr std::size_t COUNT = {len(kept)}, N = {robot.n};",
        f"const std::string BASE = {_literal(link_names(robot)[0])}, TIP = {_literal(tip)};",
        f"const std::string NAMES[{robot.n}] = {{{', '.join(_literal(joint) for joint in robot.joint_names)}}};",
    ]
    for declared, rows in tables.items():
        body = ",\n".join("  {" + ", ".join(repr(float(x)) for x in row) + "}" for row in rows)
        lines += [f"const double {declared} = {{", body, "};"]
    return "\n".join([*lines, ""])


def _marked(urdf: str) -> str:
    """With a word of who wrote it, behind the line that XML wants first."""
    first, rest = urdf.split("\n", 1)
    return f"{first}\n<!-- Written by holokin {__version__}. -->\n{rest}"
