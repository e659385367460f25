"""The catalogue: one TOML file a robot, each number with its source; and `load`, which takes a name or a path."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from ...base.arguments import check, typed
from ...base.errors import ArgumentError, RobotFileError, UnknownNameError
from ..chains import robot_of
from ..model import Robot
from .models_by_name import MODELS, Arguments, is_model, read_tree
from .packaged_models import is_packaged
from .robot_table import CHAIN, TRUST_UNITS, robot_of_table
from .text_files import Refuse, read_toml

_DEEPEST = 8
"""Files within files of robots put together; more are a file that holds itself."""

_in_use: WeakValueDictionary[str, Robot] = WeakValueDictionary()
"""Robots of the catalogue that somebody holds: they are frozen, and share what is built of their kinematics."""

_KINDS = {
    "tip": str | Sequence[str] | None, "base": str | None, "locked": Mapping[str, float] | None,
    "args": Arguments | None, TRUST_UNITS: bool | None,
}  # fmt: skip
"""What the keys of `CHAIN`, and that of its units, may be."""


@typed
def catalogue() -> dict[str, str]:
    """Names of the robots that come with the library -> where their numbers are from."""
    found = {}
    for entry in sorted(files("holokin.robot").joinpath("data").iterdir(), key=lambda e: e.name):
        if entry.name.endswith(".toml"):
            found[entry.name.removesuffix(".toml")] = tomllib.loads(entry.read_text("utf-8"))["source"]
    return found


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
    path = Path(name)
    suffix = path.suffix.lower()
    if is_model(name):
        tree = read_tree(name, chain.get("args"))
        trusted = bool(chain.get(TRUST_UNITS))
        return robot_of(tree, chain.get("tip"), chain.get("base"), chain.get("locked"), trusted)
    for key in CHAIN:
        if chain.get(key):
            raise ArgumentError(f"{key} of {str(name)!r}", chain[key], f"only models ({', '.join(MODELS)}) take it")
    if suffix and suffix != ".toml":
        cure = f"give a model ({', '.join(MODELS)}) or a .toml table of a robot"
        raise RobotFileError(path, f"files of type {suffix!r} are not supported", cure)
    if str(name) in _in_use:
        return _in_use[str(name)]
    if not suffix and str(name) not in catalogue():
        raise UnknownNameError("robot", str(name), catalogue())
    if depth > _DEEPEST:
        raise RobotFileError(path, f"holds parts within parts, {_DEEPEST} deep", "take out the part that is itself")
    entry: Any = path if suffix else files("holokin.robot").joinpath("data", f"{name}.toml")
    table = read_toml(path, _refusal(path)) if suffix else tomllib.loads(entry.read_text("utf-8"))

    def part(given: Mapping[str, Any]) -> Robot:
        return _loaded(beside(given["name"], path.parent), given, depth + 1)

    robot = robot_of_table(entry, table | ({TRUST_UNITS: True} if chain.get(TRUST_UNITS) else {}), part)
    return robot if suffix else _in_use.setdefault(str(name), robot)


def beside(name: str, folder: Path) -> str | Path:
    """The name of a robot as a file in a folder says it: a path counts from there."""
    path = Path(name)
    return folder / path if path.suffix and not path.is_absolute() and not is_packaged(name) else name


def _refusal(path: Any) -> Refuse:
    return lambda key, fact, cure: RobotFileError(path, f"[{key}] {fact}" if key else fact, cure)
