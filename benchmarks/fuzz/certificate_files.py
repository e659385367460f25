"""Certificates: broken bytes, odd values anywhere in the JSON, missing and moved parts; checked again."""

from __future__ import annotations

import copy
import json
import random
from functools import cache
from pathlib import Path
from typing import Any

import holokin as hk
from benchmarks.fuzz.jobs import broken
from holokin.proof.recheck import recheck

_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**70, 1e300, -0.5, float("nan"), float("inf"), "", "x", "nan", "1e400", "[0, 1]",
    "0x1p+3", "9" * 5000, [], {}, [0], [[0]], {"a": 1}, [0] * 1000, "\x1b[31m", "日本",
)  # fmt: skip


@cache
def sound() -> bytes:
    """A certificate of a straight line of a planar arm."""
    import tempfile

    q0 = [0.4, 0.6, 0.5]
    task = hk.position(hk.load("planar-3r"))
    start = task.robot.pose(q0)[:3, 3]
    path = hk.polyline([start, start + [-0.01, 0.005, 0.0]])
    found = hk.certify(hk.holonomic(task, hk.linear([0.0, 0.0, 1.0])), path, q0)
    with tempfile.TemporaryDirectory() as folder:
        found.save(Path(folder) / "c.json")
        return (Path(folder) / "c.json").read_bytes()


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed, checked."""
    chance = random.Random(seed)
    file = folder / "c.json"
    if chance.random() < 0.3:
        file.write_bytes(broken(sound(), chance))
    else:
        content = json.loads(sound())
        for _ in range(chance.choice((1, 1, 2))):
            at: Any = content
            while True:
                key = chance.choice(list(at) if isinstance(at, dict) else range(len(at)))
                if not (isinstance(at[key], dict | list) and at[key] and chance.random() < 0.85):
                    break
                at = at[key]
            match chance.randrange(4):
                case 0:
                    del at[key]
                case 1 if isinstance(at, list):
                    at.append(copy.deepcopy(at[key]))
                case _:
                    at[key] = chance.choice(_VALUES)
        file.write_text(json.dumps(content), "utf-8")
    recheck(file)
