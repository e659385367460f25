"""DH tables, as TOML files and as Python's lists."""

from __future__ import annotations

import random
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.fuzz.jobs import broken, hostile, mutated, toml

SOUND = tomllib.loads("""name = "arm"
source = "made up"
convention = "standard"
tip = "tool"
base = { xyz = [0, 0, 0.1], rpy_deg = [0, 0, 90] }
tool = { xyz = [0.1, 0, 0], rpy_deg = [0, 10, 0] }
[[joints]]
joint = "one"
a = 0.3
alpha_deg = 90
lower = -170
upper = 170
max_velocity = 100
degrees = true
[[joints]]
kind = "prismatic"
d = 0.2
theta_deg = 30
lower = -1
upper = 1.5
[[joints]]
a = 0.25
alpha_deg = -90
theta_deg = 10
[[joints]]
a = 0.1
d = 0.05
""")
_ROWS = [
    {"a": 0.3, "alpha": 1.5, "lower": -2.0, "upper": 2.0, "joint": "one"},
    {"d": 0.2, "kind": "prismatic", "max_velocity": 1.0},
    {"a": 0.2, "theta": 0.3},
]
_FIELDS = tuple(hk.robot.DHRow.__dataclass_fields__)
_MORE: tuple[Any, ...] = (None, 1j, object(), np.nan, np.ones(3), np.float64(0.2), b"x", {1: 2}, 10**400, (), range(3))


def _odd(chance: random.Random) -> Any:
    return chance.choice(_MORE) if chance.random() < 0.5 else hostile(chance)


def _in_python(chance: random.Random) -> hk.Robot:
    table: Any = {"rows": _ROWS, "base": np.eye(4).tolist(), "tool": np.eye(4).tolist(), "convention": "modified"}
    table = mutated(table, chance)
    spots = [key for key in ("rows", "base", "tool", "convention", "name", "tip") if chance.random() < 0.05]
    for key in spots:
        table[key] = _odd(chance)
    rows = table.pop("rows", [])
    if isinstance(rows, list) and rows and chance.random() < 0.4:
        row = rows[chance.randrange(len(rows))]
        if isinstance(row, dict):
            row[chance.choice(("a", "d", "alpha", "theta", "lower", "upper", "joint", "kind", "max_velocity"))] = _odd(
                chance
            )
    known = {key: value for key, value in table.items() if key in ("base", "tool", "convention", "name", "tip")}
    return hk.from_dh(rows, **known)


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed, made a robot and moved a little."""
    chance = random.Random(seed)
    kind = chance.random()
    if kind < 0.4:
        robot = _in_python(chance)
    else:
        data = toml(mutated(SOUND, chance) if kind < 0.8 else SOUND).encode("utf-8", "replace")
        file = folder / "arm.toml"
        file.write_bytes(broken(data, chance) if kind > 0.75 else data)
        robot = hk.load(file)
    q = np.clip(0.1, robot.lower, robot.upper)
    if not (np.isfinite(robot.jacobian(q)).all() and np.isfinite(robot.pose(q)).all()):
        raise ValueError("kinematics that are not finite")
    hk.position(robot)
