"""From the TOML table of a robot to the robot: a DH table, joints as in a URDF, or parts put together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from ...base.errors import ArgumentError, HolokinError, RobotFileError, shown
from ...base.types import Vector
from ..chains import robot_of
from ..composition import Part, compose, ordered, pose_matrix, with_base_pose, with_tool
from ..model import Robot
from ..tree import MOVING, Branch, Tree, checked
from ..units import TRUST, check_radians
from .dh import Convention, from_dh
from .models_by_name import is_model

Loader = Callable[[Mapping[str, Any]], Robot]
"""From the keys of a part, "name" and those of `load`, to its robot."""

URDF = "urdf"
"""The convention of joints that are given by xyz, rpy and axis."""

CHAIN = ("tip", "base", "locked", "args")
"""Keys of a part that choose from a file, as in `load`."""

TRUST_UNITS = "trust_units"
"""Key of a robot or a part whose numbers are in rad and m, whatever they look like."""

_FRAME = ("xyz", "rpy", "rpy_deg")
_TOP = ("name", "source", "convention", "base", "tool", "tools", "tip", "joints", "parts", "order", TRUST_UNITS)
_LIMITS = ("lower", "upper", "max_velocity", "degrees")
_DH_ROW = ("joint", "kind", "a", "d", "alpha_deg", "theta_deg", *_LIMITS)
_URDF_ROW = ("joint", "kind", *_FRAME, "axis", *_LIMITS)
_PART = ("name", *CHAIN, TRUST_UNITS, "tool", "tools", "on", *_FRAME, "prefix")
_FORM = "see the packaged robots for the form"


def robot_of_table(path: Any, table: Mapping[str, Any], load: Loader) -> Robot:
    """The robot of a file's table. Raises: RobotFileError."""
    _known(path, "top level", table, _TOP)
    body = "parts" if "parts" in table else "joints"
    for key, kind in ((body, list), ("source", str)):
        if not isinstance(table.get(key), kind):
            raise RobotFileError(path, f"lacks {key!r}", _FORM)
    for key in ("name", "convention", "tip"):
        _text(path, key, table)
    if "parts" in table:
        for key in ("joints", "convention", "tip"):
            if key in table:
                raise RobotFileError(path, f"has {key!r} beside 'parts'", "leave one of them out")
    try:
        return _robot(path, table, load)
    except RobotFileError:
        raise
    except ArgumentError as problem:
        raise RobotFileError(path, f"{problem.what} is {shown(problem.value)}", problem.cure) from None
    except HolokinError as problem:
        raise RobotFileError(path, str(problem), "correct the file") from None


def assembled(path: Any, table: Mapping[str, Any], load: Loader) -> Robot:
    """The robot that the keys of [robot] describe: one by name or parts, with tool, tools, base_pose and order.

    Raises: RobotFileError, and what `load`, `compose`, `ordered` raise.
    """
    if "parts" in table:
        _one_robot_once(path, table["parts"])
        parts = [_part_of_table(path, part, load, _trusted(path, table)) for part in table["parts"]]
        robot = compose(*parts, name=table.get("name", Path(str(path)).stem))
        robot = _tooled(path, table, robot)
    else:
        own = ("name", *CHAIN, TRUST_UNITS, "tool", "tools")
        robot = _part_of_table(path, {key: table[key] for key in own if key in table}, load).robot
    if "base_pose" in table:
        robot = with_base_pose(robot, *frame_of(path, "base_pose", table["base_pose"]))
    return ordered(robot, table["order"]) if "order" in table else robot


def _part_of_table(path: Any, table: Mapping[str, Any], load: Loader, trusted: bool = False) -> Part:
    """A part: what to load, its tool, and where it is mounted. Raises: RobotFileError, and what `load` raises."""
    _known(path, "parts", table, _PART)
    table = {**table, TRUST_UNITS: True} if trusted else table
    for key in ("name", "on", "prefix"):
        _text(path, f"parts.{key}", {f"parts.{key}": table[key]} if key in table else {})
    _trusted(path, table)
    if "name" not in table:
        raise RobotFileError(path, "a part lacks 'name'", "name a robot of the catalogue, or a file")
    robot = _tooled(path, table, load({key: table[key] for key in ("name", *CHAIN, TRUST_UNITS) if key in table}))
    mount = {key: table[key] for key in _FRAME if key in table}
    return Part(robot, table.get("on"), *frame_of(path, "parts", mount), table.get("prefix", ""))


def _tooled(path: Any, table: Mapping[str, Any], robot: Robot) -> Robot:
    """A robot with the `tool` of its first tip, or with `tools`: those of tips by name, which keep their names.

    Raises: RobotFileError, UnknownNameError, and what `with_tool` raises.
    """
    if "tool" in table and "tools" in table:
        raise RobotFileError(path, "has 'tool' and 'tools'", "give one of them")
    if "tool" in table:
        return with_tool(robot, *frame_of(path, "tool", table["tool"]), trust_units=_trusted(path, table))
    tools = table.get("tools", {})
    if not isinstance(tools, Mapping):
        raise RobotFileError(path, f"tools is {shown(tools, 100)}", "give a table, tip = { xyz = [x, y, z] }")
    for tip, frame in tools.items():
        given = frame_of(path, f"tools.{tip}", frame)
        robot = with_tool(robot, *given, tip=tip, name=tip, trust_units=_trusted(path, table))
    return robot


def _one_robot_once(path: Any, parts: Sequence[Any]) -> None:
    """Raises: RobotFileError where two parts are one model at one place: each brings all links of the file."""
    seen: list[tuple[object, ...]] = []
    for part in parts:
        if not isinstance(part, Mapping) or not is_model(str(part.get("name", ""))) or "on" not in part:
            continue
        place = (part["name"], part.get("base"), part["on"], *(part.get(key) for key in _FRAME))
        if place in seen:
            fact = f"two parts are {shown(part['name'], 100)} at one place, so each link stands there twice"
            cure = "make it one robot with several tips: name = FILE and tip = ['left_tip', 'right_tip']"
            raise RobotFileError(path, fact, cure)
        seen.append(place)


def frame_of(path: Any, key: str, table: Mapping[str, Any]) -> tuple[Vector, Vector]:
    """(xyz [m], rpy [rad]) of a frame, written as xyz and rpy, or rpy_deg. Raises: RobotFileError."""
    _known(path, key, table, _FRAME)
    if "rpy" in table and "rpy_deg" in table:
        raise RobotFileError(path, f"{key} has rpy and rpy_deg", "give one of them")
    found = {part: _three(path, f"{key}.{part}", table.get(part, [0.0, 0.0, 0.0])) for part in _FRAME}
    return found["xyz"], found["rpy"] + np.deg2rad(found["rpy_deg"])


def _robot(path: Any, table: Mapping[str, Any], load: Loader) -> Robot:
    name, source = str(table.get("name", Path(str(path)).stem)), table["source"]
    if "parts" in table:
        kept = ("parts", "tool", "tools", "order", TRUST_UNITS)
        given = {"name": name} | {key: table[key] for key in kept if key in table}
        given |= {"base_pose": table["base"]} if "base" in table else {}
        return replace(assembled(path, given, load), source=source)
    frames = {key: frame_of(path, key, table[key]) for key in ("base", "tool") if key in table}
    convention, tip = str(table.get("convention", "standard")), str(table.get("tip", "tool"))
    matrices = {key: pose_matrix(*value) for key, value in frames.items()}
    rows: list[Any] = []
    for row in table["joints"]:
        _known(path, "joints", row, _URDF_ROW if convention == URDF else _DH_ROW)
        try:
            rows.append(_branch(path, row, len(rows)) if convention == URDF else _dh_row(row))
        except (TypeError, ValueError) as problem:
            raise RobotFileError(path, f"joint {len(rows) + 1}: {problem}", "give plain numbers") from None
    trusted = _trusted(path, table)
    turned = {key: table[key] for key in frames} | {f"joint {i}": row for i, row in enumerate(table["joints"], 1)}
    for what, frame in turned.items():
        if not trusted and "rpy" in frame:
            check_radians(f"rpy of {what}", np.array(frame["rpy"], dtype=float), TRUST)
    if convention != URDF:
        return from_dh(
            rows, cast(Convention, convention), name=name, tip=tip, source=source, trust_units=trusted, **matrices
        )
    ends = Branch("to the first joint", "fixed", "base", "0", matrices.get("base", np.eye(4)))
    tool = Branch("to the tip", "fixed", str(len(rows)), tip, matrices.get("tool", np.eye(4)))
    links = dict.fromkeys(["base", *map(str, range(len(rows) + 1)), tip])
    tree = checked(Tree(str(path), name, links, (ends, *rows, tool)))
    return replace(robot_of(tree, tip, None, None, trusted), source=source)


def _branch(path: Any, row: Mapping[str, Any], index: int) -> Branch:
    """A joint as in a URDF: T(xyz, rpy), then the motion about or along an axis, by default z."""
    name, kind, limits = _common(row)
    if kind not in MOVING:
        raise ArgumentError(f"the kind of joint {name or index + 1!r}", kind, "use 'revolute' or 'prismatic'")
    origin = pose_matrix(*frame_of(path, "joints", {key: row[key] for key in _FRAME if key in row}))
    axis = _three(path, "joints.axis", row.get("axis", [0.0, 0.0, 1.0]))
    return Branch(name or f"q{index + 1}", kind, str(index), str(index + 1), origin, axis, follows=None, **limits)


def _dh_row(row: Mapping[str, Any]) -> dict[str, Any]:
    name, kind, limits = _common(row)
    lengths = {key: _plain(row, key) for key in ("a", "d")}
    angles = {key: np.deg2rad(_plain(row, f"{key}_deg")) for key in ("alpha", "theta")}
    return {"joint": name, "kind": kind, **lengths, **angles, **limits}


def _common(row: Mapping[str, Any]) -> tuple[str, str, dict[str, float]]:
    """Name, kind and limits. Those of a revolute joint are in degrees when `degrees = true`."""
    kind = row.get("kind", "revolute")
    for key in ("joint", "kind"):
        if not isinstance(row.get(key, ""), str):
            raise TypeError(f"{key} is {shown(row[key], 100)}, no text in quotes")
    if not isinstance(row.get("degrees", False), bool):
        raise TypeError("degrees must be true or false")
    scale = np.pi / 180 if row.get("degrees", False) and kind == "revolute" else 1.0
    limits = {key: _plain(row, key) * scale for key in ("lower", "upper", "max_velocity") if key in row}
    return row.get("joint", ""), kind, limits


def _plain(row: Mapping[str, Any], key: str) -> float:
    value = row.get(key, 0.0)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{key} is {shown(value, 100)}, no number")
    return float(value)


def _three(path: Any, key: str, value: Any) -> Vector:
    plain = isinstance(value, list) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
    if not plain or len(value) != 3 or not np.isfinite(value).all():
        raise RobotFileError(path, f"{key} is {shown(value, 100)}", "give three numbers, [x, y, z]")
    return np.array(value, dtype=float)


def _text(path: Any, key: str, table: Mapping[str, Any]) -> None:
    if not isinstance(table.get(key, ""), str):
        raise RobotFileError(path, f"{key} is {shown(table[key], 100)}", "give a text in quotes")


def _trusted(path: Any, table: Mapping[str, Any]) -> bool:
    """What a robot or a part says of its units. Raises: RobotFileError."""
    if not isinstance(table.get(TRUST_UNITS, False), bool):
        raise RobotFileError(path, f"{TRUST_UNITS} is {shown(table[TRUST_UNITS], 100)}", "give true or false")
    return table.get(TRUST_UNITS, False)


def _known(path: Any, where: str, table: Mapping[str, Any], known: Sequence[str]) -> None:
    if not isinstance(table, Mapping):
        raise RobotFileError(path, f"{where}: {shown(table, 100)} is not a table", _FORM)
    for key in table:
        if key not in known:
            raise RobotFileError(path, f"{where}: unknown key {shown(key, 100)}", f"known: {', '.join(known)}")
