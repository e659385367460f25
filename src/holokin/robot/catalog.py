"""The catalogue: one TOML file a robot, each number with its source; and `load`, which takes a name or a path."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError, HolokinError, RobotFileError, UnknownNameError, shown
from ..symbolic.geometry import rotation_from_rpy
from ..types import Matrix
from .dh import from_dh
from .files import Refuse, read_toml
from .model import Robot
from .urdf import from_urdf

_TOP = ("name", "source", "convention", "base", "tool", "tip", "joints")
_ROW = ("joint", "kind", "a", "d", "alpha_deg", "theta_deg", "lower", "upper", "max_velocity", "degrees")
_FRAME = ("xyz", "rpy_deg")


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
        return _from_table(path, read_toml(path, _refusal(path)))
    if suffix:
        raise RobotFileError(path, f"files of type {suffix!r} are not supported", "give a .urdf or a .toml DH table")
    if str(name) not in catalogue():
        raise UnknownNameError("robot", str(name), catalogue())
    entry = files("holokin.robot").joinpath("data", f"{name}.toml")
    return _from_table(entry, tomllib.loads(entry.read_text("utf-8")))


def _refusal(path: Any) -> Refuse:
    return lambda key, fact, cure: RobotFileError(path, f"[{key}] {fact}" if key else fact, cure)


def _from_table(path: Any, table: Mapping[str, Any]) -> Robot:
    _known(path, "top level", table, _TOP)
    for key, kind in (("joints", list), ("source", str)):
        if not isinstance(table.get(key), kind):
            raise RobotFileError(path, f"lacks {key!r}", "see the packaged robots for the form")
    for key in ("name", "convention", "tip"):
        if not isinstance(table.get(key, ""), str):
            raise RobotFileError(path, f"{key} is {shown(table[key], 100)}", "give a text in quotes")
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
        raise RobotFileError(path, str(problem), "correct the file") from problem


def _dh_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """Angles of a revolute joint's limits and speed are in degrees when `degrees = true`."""
    kind = row.get("kind", "revolute")
    for key in ("joint", "kind"):
        if not isinstance(row.get(key, ""), str):
            raise TypeError(f"{key} is {shown(row[key], 100)}, no text in quotes")
    if not isinstance(row.get("degrees", False), bool):
        raise TypeError("degrees must be true or false")
    scale = np.pi / 180 if row.get("degrees", False) and kind == "revolute" else 1.0
    out: dict[str, Any] = {
        "joint": row.get("joint", ""),
        "kind": kind,
        "a": _plain(row, "a"),
        "d": _plain(row, "d"),
        "alpha": np.deg2rad(_plain(row, "alpha_deg")),
        "theta": np.deg2rad(_plain(row, "theta_deg")),
    }
    for key in ("lower", "upper", "max_velocity"):
        if key in row:
            out[key] = _plain(row, key) * scale
    return out


def _plain(row: Mapping[str, Any], key: str) -> float:
    value = row.get(key, 0.0)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"{key} is {shown(value, 100)}, no number")
    return float(value)


def _frame(path: Any, key: str, table: Mapping[str, Any]) -> Matrix:
    _known(path, key, table, _FRAME)
    T, rows = np.eye(4), []
    for part in _FRAME:
        value = table.get(part, [0.0, 0.0, 0.0])
        plain = isinstance(value, list) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
        if not plain or len(value) != 3 or not np.isfinite(value).all():
            raise RobotFileError(path, f"{key}.{part} is {shown(value, 100)}", "give three numbers, [x, y, z]")
        rows.append([float(v) for v in value])
    T[:3, 3] = rows[0]
    T[:3, :3] = rotation_from_rpy(np.deg2rad(rows[1]).tolist())
    return T


def _known(path: Any, where: str, table: Mapping[str, Any], known: Sequence[str]) -> None:
    if not isinstance(table, Mapping):
        raise RobotFileError(
            path, f"{where}: {shown(table, 100)} is not a table", "see the packaged robots for the form"
        )
    for key in table:
        if key not in known:
            raise RobotFileError(path, f"{where}: unknown key {shown(key, 100)}", f"known: {', '.join(known)}")
