"""The catalogue: one TOML file a robot, each figure with its source; and `load`, which takes a name or a path."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, HolokinError, RobotFileError, UnknownNameError
from ..symbolic.geometry import rotation_from_rpy
from ..types import Matrix
from .dh import from_dh
from .model import Robot
from .urdf import from_urdf

_TOP = ("name", "source", "convention", "base", "tool", "tip", "joints")
_ROW = ("joint", "kind", "a", "d", "alpha_deg", "theta_deg", "lower", "upper", "max_velocity", "degrees")
_FRAME = ("xyz", "rpy_deg")


def catalogue() -> dict[str, str]:
    """Names of the robots that come with the library -> where their figures are from."""
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
) -> Robot:
    """A robot by catalogue name, or by path: `.urdf`, or `.toml` (DH table).

    `tip`, `base` and `locked` choose the chain of a URDF, see `from_urdf`.

    Raises:
        UnknownNameError: no such robot. RobotFileError: the file is missing or malformed.
        ArgumentError: tip, base or locked for a robot that is not a URDF.
    """
    path = Path(name)
    suffix = path.suffix.lower()
    if suffix == ".urdf":
        return from_urdf(path, tip, base, locked)
    if tip is not None or base is not None or locked:
        raise ArgumentError(f"tip, base or locked of {str(name)!r}", tip or base or locked, "only URDF files take them")
    if suffix == ".toml":
        if not path.is_file():
            raise RobotFileError(path, "there is no such file", "check the path")
        try:
            text = path.read_text("utf-8")
        except (OSError, UnicodeDecodeError) as problem:
            raise RobotFileError(path, f"cannot be read ({problem})", "give a TOML text file") from None
        return _from_toml(path, text)
    if suffix:
        raise RobotFileError(path, f"files of type {suffix!r} are not supported", "give a .urdf or a .toml DH table")
    if str(name) not in catalogue():
        raise UnknownNameError("robot", str(name), catalogue())
    entry = files("holokin.robot").joinpath("data", f"{name}.toml")
    return _from_toml(entry, entry.read_text("utf-8"))


def _from_toml(path: Any, text: str) -> Robot:
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as problem:
        raise RobotFileError(path, f"is not TOML ({problem})", "mend the line it names") from None
    _known(path, "top level", table, _TOP)
    for key, kind in (("joints", list), ("source", str)):
        if not isinstance(table.get(key), kind):
            raise RobotFileError(path, f"lacks {key!r}", "see the packaged robots for the form")
    rows = []
    for row in table["joints"]:
        _known(path, "joints", row, _ROW)
        try:
            rows.append(_dh_row(row))
        except (TypeError, ValueError) as problem:
            raise RobotFileError(path, f"joint {len(rows) + 1}: {problem}", "give plain numbers") from None
    name = str(table.get("name", Path(str(path)).stem))
    try:
        frames = {key: _frame(path, key, table[key]) for key in ("base", "tool") if key in table}
        convention = str(table.get("convention", "standard"))
        return from_dh(rows, convention, name=name, tip=str(table.get("tip", "tool")), source=table["source"], **frames)
    except RobotFileError:
        raise
    except HolokinError as problem:
        raise RobotFileError(path, str(problem), "mend the file") from problem


def _dh_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """Angles of a revolute joint's limits and speed are in degrees when `degrees = true`."""
    kind = row.get("kind", "revolute")
    if not isinstance(row.get("degrees", False), bool):
        raise TypeError("degrees must be true or false")
    scale = np.pi / 180 if row.get("degrees", False) and kind == "revolute" else 1.0
    out: dict[str, Any] = {
        "joint": str(row.get("joint", "")),
        "kind": kind,
        "a": float(row.get("a", 0.0)),
        "d": float(row.get("d", 0.0)),
        "alpha": np.deg2rad(float(row.get("alpha_deg", 0.0))),
        "theta": np.deg2rad(float(row.get("theta_deg", 0.0))),
    }
    for key in ("lower", "upper", "max_velocity"):
        if key in row:
            out[key] = float(row[key]) * scale
    return out


def _frame(path: Any, key: str, table: Mapping[str, Any]) -> Matrix:
    _known(path, key, table, _FRAME)
    T = np.eye(4)
    try:
        T[:3, 3] = table.get("xyz", [0.0, 0.0, 0.0])
        T[:3, :3] = rotation_from_rpy(np.deg2rad(table.get("rpy_deg", [0.0, 0.0, 0.0])).tolist())
    except (TypeError, ValueError):
        raise RobotFileError(path, f"{key}: {dict(table)}", "give three numbers each for xyz and rpy_deg") from None
    return T


def _known(path: Any, where: str, table: Mapping[str, Any], known: Sequence[str]) -> None:
    if not isinstance(table, Mapping):
        raise RobotFileError(path, f"{where}: {table!r} is not a table", "see the packaged robots for the form")
    for key in table:
        if key not in known:
            raise RobotFileError(path, f"{where}: unknown key {key!r}", f"known: {', '.join(known)}")
