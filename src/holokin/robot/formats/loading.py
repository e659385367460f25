"""The catalogue: one TOML file a robot, each number with its source; and `load`, which takes a name or a path."""

from __future__ import annotations

import importlib
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import PackageNotFoundError
from importlib.metadata import files as package_files
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, cast
from weakref import WeakValueDictionary

import numpy as np

from ...base.arguments import check, typed
from ...base.errors import (
    ArgumentError,
    HolokinError,
    MissingExtraError,
    RobotFileError,
    UnknownNameError,
    brief,
    shown,
)
from ...base.types import Vector
from ..chains import TRUST, Part, check_radians, compose, ordered, pose_matrix, robot_of, with_base_pose, with_tool
from ..model import Robot
from ..tree import MOVING, Branch, Tree, above_of, checked, links_of, root_of, tips_of
from .dh import Convention, from_dh
from .mjcf import mjcf_tree
from .urdf import read_model, read_toml, urdf_text_tree, urdf_tree
from .xacro import xacro_tree

# --- Robots by the names of other packages: robot_descriptions, which fetches files, and example-robot-data.

PREFIX = "robot_descriptions:"
"""What its names begin with, as in "robot_descriptions:panda_description"."""

EXAMPLES = "example-robot-data:"
"""What names of that package begin with, as in "example-robot-data:talos_full_v2"."""


def _is_packaged(name: str) -> bool:
    """Whether the name of a robot is one of another package."""
    return name.startswith((PREFIX, EXAMPLES))


def _example_file(name: str) -> Path:
    """The URDF of a robot of the installed package example-robot-data, by its file's name without ".urdf".

    Of two files of one name that of the first folder counts.

    Raises:
        MissingExtraError: the package is not installed. UnknownNameError: it has no such robot.
    """
    try:
        listed = package_files("example-robot-data") or []
    except PackageNotFoundError:
        raise MissingExtraError("example-robot-data", "descriptions") from None
    known = {file.name.removesuffix(".urdf"): file for file in sorted(listed, reverse=True) if file.suffix == ".urdf"}
    word = name.removeprefix(EXAMPLES).removesuffix(".urdf")
    if word not in known:
        raise UnknownNameError("robot of example-robot-data", word, sorted(known))
    return Path(str(known[word].locate()))


def _description_file(name: str) -> Path:
    """The file (URDF, MJCF or xacro) of a robot by its name there, after `PREFIX`; "_description" may be left out.

    Raises:
        MissingExtraError: the package is not installed. UnknownNameError: it has no such robot.
        RobotFileError: its files cannot be fetched.
    """
    if find_spec("robot_descriptions") is None:
        raise MissingExtraError("robot_descriptions", "descriptions")
    package = importlib.import_module("robot_descriptions")
    word = name.removeprefix(PREFIX)
    known = sorted(m.name for m in iter_modules(package.__path__) if m.name.endswith("_description"))
    full_name = next((full for full in (word, f"{word}_description") if full in known), None)
    if full_name is None:
        raise UnknownNameError("robot of robot_descriptions", word, known)
    try:
        module = importlib.import_module(f"robot_descriptions.{full_name}")
    except Exception as problem:
        message = str(problem).strip() or type(problem).__name__
        cure = "check the network: robot_descriptions clones the files of a robot when it is asked for the first time"
        raise RobotFileError(name, f"its files could not be fetched ({brief(message, 200)})", cure) from problem
    for kind in ("URDF_PATH", "MJCF_PATH", "XACRO_PATH"):
        if hasattr(module, kind):
            return Path(getattr(module, kind))
    raise RobotFileError(name, "has no URDF, xacro or MJCF file", "choose another description")


# --- Models by name: URDF, xacro and MJCF files, told apart by their endings and contents; of other packages.

MODELS = (".urdf", ".xacro", ".xml", ".mjcf")
"""Endings of files that hold a tree of links and joints."""

Arguments = Mapping[str, str | float | bool]
"""Names and values of a xacro file's arguments."""


def is_model(name: str | Path) -> bool:
    """Whether a robot's name is that of a tree of links and joints, of which `tip`, `base` and `locked` choose."""
    return _is_packaged(str(name)) or Path(name).suffix.lower() in MODELS


def _read_tree(name: str | Path, args: Arguments | None = None) -> Tree:
    """The tree of a model. Raises: RobotFileError, MissingExtraError; ArgumentError: args for what is no xacro file."""
    path = Path(name)
    if _is_packaged(str(name)):
        path = _example_file(str(name)) if str(name).startswith(EXAMPLES) else _description_file(str(name))
    suffix = path.suffix.lower()
    if suffix == ".xacro":
        return xacro_tree(path, args)
    if args:
        raise ArgumentError(f"args of {str(path)!r}", dict(args), "only xacro files take them")
    if suffix in (".xml", ".mjcf"):
        text = read_model(path)
        return urdf_text_tree(text, path) if re.search(rb"<robot[\s>]", text) else mjcf_tree(path)
    return urdf_tree(path)


@typed
def model_tips(path: str | Path, base: str | None = None) -> dict[str, tuple[str, ...]]:
    """Every link (of MJCF: body or site) at which the tree of a file ends -> the moving joints from the base to it.

    Mimic joints are included. Raises: RobotFileError, MissingExtraError, UnknownNameError.
    """
    return tips_of(_read_tree(path), base)


@typed
def model_links(path: str | Path, base: str | None = None) -> dict[str, tuple[str, ...]]:
    """Every link that hangs on the base -> the moving joints from the base to it, as of `model_tips`."""
    return links_of(_read_tree(path), base)


def model_root(path: str | Path) -> str:
    """The link that the tree of a file hangs on. Raises: RobotFileError: there are several, or none."""
    tree = _read_tree(path)
    return root_of(tree, above_of(tree))


# --- From the TOML table of a robot to the robot: a DH table, joints as in a URDF, or parts put together.

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


def _robot_of_table(path: Any, table: Mapping[str, Any], load: Loader) -> Robot:
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
    frame = {part: _three(path, f"{key}.{part}", table.get(part, [0.0, 0.0, 0.0])) for part in _FRAME}
    return frame["xyz"], frame["rpy"] + np.deg2rad(frame["rpy_deg"])


def _robot(path: Any, table: Mapping[str, Any], load: Loader) -> Robot:
    name, source = str(table.get("name", Path(str(path)).stem)), table["source"]
    if "parts" in table:
        own_keys = ("parts", "tool", "tools", "order", TRUST_UNITS)
        given = {"name": name} | {key: table[key] for key in own_keys if key in table}
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


_DEEPEST = 8
"""Files within files of robots put together; more are a file that holds itself."""

_in_use: WeakValueDictionary[str, Robot] = WeakValueDictionary()
"""Robots of the catalogue that somebody holds: they are frozen, and share what is built of their kinematics."""

_KINDS = {
    "tip": str | Sequence[str] | None,
    "base": str | None,
    "locked": Mapping[str, float] | None,
    "args": Arguments | None,
    TRUST_UNITS: bool | None,
}
"""What the keys of `CHAIN`, and that of its units, may be."""


@typed
def catalogue() -> dict[str, str]:
    """Names of the robots that come with the library -> where their numbers are from."""
    sources = {}
    for entry in sorted(files("holokin.robot").joinpath("data").iterdir(), key=lambda e: e.name):
        if entry.name.endswith(".toml"):
            sources[entry.name.removesuffix(".toml")] = tomllib.loads(entry.read_text("utf-8"))["source"]
    return sources


@typed
def load(
    name: str | Path,
    *,
    tip: str | Sequence[str] | None = None,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    args: Arguments | None = None,
    trust_units: bool = False,
) -> Robot:
    """A robot by catalogue name, by path, or by a name of the packages robot_descriptions and example-robot-data.

    Robot files are data: nothing in a URDF, xacro, MJCF or TOML file is run. The expressions of a xacro file are
    evaluated by an interpreter of holokin, in a process with limits, which knows numbers, texts, lists and the
    functions of xacro. A xacro file can read other files of this machine and its environment variables. A name of
    robot_descriptions runs that package, which fetches files.

    Args:
        name: a name of the `catalogue`; a file that ends in `.urdf`, `.xacro`, `.xml` (MJCF or URDF) or `.toml` (DH
            table, joints as in a URDF, or parts put together); or "robot_descriptions:panda_description",
            "example-robot-data:talos_full_v2".
        tip, base, locked: the chain of a model, see `from_urdf`; robots of the catalogue and `.toml` files are chains
            already.
        args: names and values of a xacro file's arguments.
        trust_units: take the numbers for rad and m, whatever they look like. Without, a file is refused whose links
            are over 20 m long on average, as in millimetres, or that lets most hinges turn by more than two turns, as
            in degrees.

    Raises:
        UnknownNameError: no such robot. RobotFileError: the file is missing or malformed, or cannot be fetched.
        ArgumentError: tip, base, locked or args for a robot that does not take them.
        MissingExtraError: the extra that reads the file (mujoco, xacro, descriptions) is not installed.
    """
    chain = {"tip": tip, "base": base, "locked": locked, "args": args, TRUST_UNITS: trust_units}
    return _loaded(name, chain, 0)


def _loaded(name: str | Path, chain: Mapping[str, Any], depth: int) -> Robot:
    for key, kind in _KINDS.items():  # those of a part come from a file
        check(key, kind, chain.get(key))
    # A model: a tree of links and joints, of which the keys choose chains.
    path = Path(name)
    suffix = path.suffix.lower()
    if is_model(name):
        tree = _read_tree(name, chain.get("args"))
        trusted = bool(chain.get(TRUST_UNITS))
        return robot_of(tree, chain.get("tip"), chain.get("base"), chain.get("locked"), trusted)
    for key in CHAIN:
        if chain.get(key):
            raise ArgumentError(f"{key} of {str(name)!r}", chain[key], f"only models ({', '.join(MODELS)}) take it")
    if suffix and suffix != ".toml":
        cure = f"give a model ({', '.join(MODELS)}) or a .toml table of a robot"
        raise RobotFileError(path, f"files of type {suffix!r} are not supported", cure)
    # A robot of the catalogue, or a table: what somebody holds already, or what its file says.
    if str(name) in _in_use:
        return _in_use[str(name)]
    if not suffix and str(name) not in catalogue():
        raise UnknownNameError("robot", str(name), catalogue())
    if depth > _DEEPEST:
        raise RobotFileError(path, f"holds parts within parts, {_DEEPEST} deep", "take out the part that is itself")
    entry: Any = path if suffix else files("holokin.robot").joinpath("data", f"{name}.toml")

    def refuse(key: str, fact: str, cure: str) -> RobotFileError:
        return RobotFileError(path, f"[{key}] {fact}" if key else fact, cure)

    table = read_toml(path, refuse) if suffix else tomllib.loads(entry.read_text("utf-8"))

    def part(given: Mapping[str, Any]) -> Robot:
        return _loaded(beside(given["name"], path.parent), given, depth + 1)

    robot = _robot_of_table(entry, table | ({TRUST_UNITS: True} if chain.get(TRUST_UNITS) else {}), part)
    return robot if suffix else _in_use.setdefault(str(name), robot)


def beside(name: str, folder: Path) -> str | Path:
    """The name of a robot as a file in a folder says it: a path counts from there."""
    path = Path(name)
    return folder / path if path.suffix and not path.is_absolute() and not _is_packaged(name) else name
