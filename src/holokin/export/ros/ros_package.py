"""What packages of ROS 2 over the exported C have in common: what is refused, names, and the words of their texts."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, ExportError
from ...base.types import Array, Result
from ...motion import has_leaf
from ...robot import to_urdf
from ...robot.formats.writers import link_names
from ...strategies import HolonomicStrategy, Strategy
from ...strategies.tasks.task import Task, TipFrame
from ...version import __version__
from ..c.c_folder import c_name, operations_of, write_export
from ..c.c_text import RESERVED, Source, line, text

_ROS_WORDS = """
angles boost builtin_interfaces class_loader controller_interface controller_manager diagnostic_msgs eigen
geometry_msgs hardware_interface kinematics lifecycle_msgs moveit moveit_core moveit_msgs pluginlib rcl rcl_interfaces
rclcpp rclcpp_lifecycle rcpputils rcutils realtime_tools rosidl srdf srdfdom std_msgs testing urdf urdfdom
"""

_ROS_NAMES = frozenset(_ROS_WORDS.split())
"""Packages and namespaces that the plugins use themselves."""

_PACKAGE = re.compile(r"[a-z](_?[a-z0-9])+")
"""Names of packages, as REP 144 has them: no underscore at the end, no two in a row."""

PLACES = {".hpp": "src/", ".cpp": "src/", ".yaml": "config/", ".srdf": "test/"}
"""Where templates go in a package; tests of C++ to test, others to the top."""


@dataclass(frozen=True)
class RosPackage(Result, ABC):
    """What was written: the folder, the package, its C name, its files, the operations of each C function. Abstract."""

    folder: Path
    package: str
    name: str
    files: tuple[str, ...]
    operations: dict[str, int]

    def __str__(self) -> str:
        return (
            f"written: package {self.package} with the plugin {self.plugin}, {len(self.files)} files in {self.folder}"
        )

    @property
    @abstractmethod
    def plugin(self) -> str:
        """The name by which ROS finds the plugin."""


def leaf_strategy(strategy: Strategy, cure: str) -> HolonomicStrategy:
    """The strategy. Raises: ExportError where ROS has no words for the task, or where there is no leaf.

    Args:
        cure: what to take for an arm without a joint to spare.
    """
    task = strategy.task
    if task.frames != 1 or not isinstance(getattr(task, "frame", None), TipFrame):
        cure_of_task = "export hk.pose or hk.position of one tip, each for a group of its own"
        raise ExportError(f"{task.name} is not about one tip in the base frame", cure_of_task)
    if task.n <= task.m:
        raise ExportError(f"{task.robot.name!r} has no joint to spare, so there is no leaf", cure)
    if not has_leaf(strategy):
        fact = f"{strategy.name!r} has no constraint, so there is no leaf on which a pose has its joints"
        raise ExportError(fact, "take a holonomic strategy, as hk.holonomic(task, hk.lock(2))")
    return strategy


def package_names(strategy: Strategy, name: str | None, package: str | None, kind: str) -> tuple[str, str]:
    """(C name, name of the package): those given, or by robot, strategy and the kind of the package.

    Raises:
        ArgumentError: a name that ROS, C++, XML or a log does not take.
    """
    short = c_name(f"{strategy.task.robot.name}_{strategy.name}") if name is None else str(name)
    package = f"{short}_{kind}" if package is None else package
    for what, word in (("the name", short), ("the package", package)):
        if word in RESERVED | _ROS_NAMES:
            raise ArgumentError(what, word, "ROS, MoveIt or C++ uses this name: give one of your own")
    if not _PACKAGE.fullmatch(package):
        cure = "a package of ROS has lower-case letters, digits and single underscores, and begins with a letter"
        raise ArgumentError("the package", package, cure)
    for joint in strategy.task.robot.joints:
        check_word("the name of a joint", joint.name)
    check_word("the name of the tip", tip_name(strategy.task))
    return short, package


def check_word(what: str, word: str) -> None:
    """Raises: ArgumentError for a name that XML, YAML or a log cannot show as it is."""
    if not word.strip() or not word.isprintable():
        raise ArgumentError(what, word, "give a name of printable characters")


def tip_name(task: Task) -> str:
    """The name of the tip that the task is about: by default the robot's first one."""
    return task.tip or task.robot.tips[0].name


def cpp_literal(word: str) -> str:
    """A string of C++: UTF-8, with octal numbers for all but plain characters."""
    plain = [chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in word.encode()]
    return '"' + "".join(plain) + '"'


def markdown_cell(word: str) -> str:
    """A name in a table or a line of Markdown."""
    return line(word).replace("|", "/").replace("`", "'")


def python_header(task: Task, sentence: str, poses: Array, joints: Array, more: Sequence[str] = ()) -> str:
    """A header of C++ for the test of a package: poses (k, 4, 4), and the joints (k, n) that Python finds for them.

    Args:
        sentence: the end of the one on the poses. more: lines that come last.
    """
    from scipy.spatial.transform import Rotation

    quaternions, robot = Rotation.from_matrix(poses[:, :3, :3]).as_quat(), task.robot
    return "\n".join(
        [
            f"/* Written by holokin {__version__}. Poses (x, y, z, quaternion x, y, z, w){sentence} */",
            "#pragma once",
            "#include <cstddef>",
            "#include <string>",
            f"constexpr std::size_t COUNT = {len(joints)}, N = {task.robot.n};",
            f"const std::string BASE = {cpp_literal(link_names(robot)[0])}, TIP = {cpp_literal(tip_name(task))};",
            f"const std::string NAMES[{robot.n}] = {{{', '.join(map(cpp_literal, robot.joint_names))}}};",
            *_numbers_of_cpp(f"POSES[{len(poses)}][7]", np.hstack([poses[:, :3, 3], quaternions])),
            *_numbers_of_cpp(f"JOINTS[{len(joints)}][{task.robot.n}]", joints),
            *more,
            "",
        ]
    )


def _numbers_of_cpp(declared: str, rows: Iterable[Iterable[float]]) -> list[str]:
    """The lines of a table of C++ with all digits."""
    body = ",\n".join("  {" + ", ".join(repr(float(x)) for x in row) + "}" for row in rows)
    return [f"const double {declared} = {{", body, "};"]


def _task_note(task: Task) -> str:
    """What the task leaves free, for the readme."""
    if task.m == 6:
        return ""
    rows = ", ".join(task.row_names)
    free = "The rest of the pose is left free: the plugin does not lead the tip there."
    return f"- **The task has the rows {rows}.** {free}\n"


def _depends(kind: str, names: str) -> str:
    return "\n".join(f"  <{kind}>{name}</{kind}>" for name in names.split())


def package_words(source: Source, package: str, plugin: Mapping[str, str]) -> dict[str, Any]:
    """What the texts need besides the words of the C.

    Args:
        plugin: `plugin_class`, `base_class`, `plugin_of` (the package whose plugin it is), `about` (a sentence), and
            what the package depends on, `depends` and `test_depends`; for CMake its `sources`, `includes` and
            `libraries`, and of the `test` its name, the file of its robot (`test_robot`), and how it is linked.
    """
    from xml.sax.saxutils import escape, quoteattr  # it imports a client of the web: 30 ms

    task, robot = source.strategy.task, source.strategy.task.robot
    tip, base, rows = tip_name(task), link_names(robot)[0], []
    for joint, value in zip(robot.coordinates, source.q0, strict=True):
        bounds = " | ".join(f"{b:.6g}" if np.isfinite(b) else "none" for b in (joint.lower, joint.upper))
        rows.append(f"| {markdown_cell(joint.name)} | {joint.unit} | {bounds} | {value:.6g} |")
    return source.words | {
        **plugin,
        "version": __version__,
        "package": package,
        "joint_strings": ",\n".join(f"    {cpp_literal(joint)}" for joint in robot.joint_names),
        "tip_string": cpp_literal(tip),
        "base_string": cpp_literal(base),
        "tip_line": f"`{markdown_cell(tip)}`",
        "base_line": f"`{markdown_cell(base)}`",
        "set_target": "  target = {T[3], T[7], T[11]};" if task.orientation is None else "  target = T;",
        "task_note": _task_note(task),
        "xml_description": escape(f"{plugin['about']}: {source.words['title']}"),
        "xml_robot": quoteattr(robot.name),
        "xml_base": quoteattr(base),
        "xml_tip": quoteattr(tip),
        "xml_joints": "\n".join(f"    <joint name={quoteattr(joint.name)}/>" for joint in robot.joints),
        "joint_rows": "\n".join(rows),
        "find_packages": "\n".join(f"find_package({name} REQUIRED)" for name in plugin["depends"].split()),
        "depends": _depends("depend", plugin["depends"]),
        "test_depends": _depends("test_depend", plugin["test_depends"]),
    }


def write_package(
    source: Source, folder: Path, c: Mapping[str, str], kind: str, words: Mapping[str, Any], test: str
) -> tuple[tuple[str, ...], dict[str, int]]:
    """Write a package: its files, and the operations of each C function.

    Args:
        c: the texts of `export_c`. kind: the folder of its templates, besides those that all packages share, in ros.
        test: the header of C++ `test/python_joints.h`.

    Raises:
        ArgumentError, WriteError.
    """
    texts = {f"c/{file}": content for file, content in c.items()}
    templates = files("holokin.export.c").joinpath("text")
    for home in (kind, "ros"):
        for name in sorted(template.name for template in templates.joinpath(home).iterdir()):
            place = "test/" if name.startswith("test_") else PLACES.get(Path(name).suffix, "")
            texts[f"{place}{name}"] = text(f"{home}/{name}", words)
    # With a word of who wrote it, behind the line that XML wants first.
    first, rest = to_urdf(source.strategy.task.robot).split("\n", 1)
    texts["test/robot.urdf"] = f"{first}\n<!-- Written by holokin {__version__}. -->\n{rest}"
    texts["test/python_joints.h"] = test
    write_export(folder, texts, f"project({words['package']} LANGUAGES C CXX)")
    return tuple(texts), operations_of(source)
