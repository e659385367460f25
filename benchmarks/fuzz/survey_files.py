"""Survey files: broken bytes, odd keys and values, and the case list that they make; nothing is run but few cases."""

from __future__ import annotations

import random
import tomllib
from pathlib import Path
from typing import Any

from benchmarks.fuzz.jobs import broken
from holokin.app.job.templates import toml
from holokin.app.survey.survey_file import read_survey

SOUND = """title = "Arms"
robots = ["planar-3r", {name = "panda", tool = {xyz = [0, 0, 0.1]}}]
cycles = 2
samples = 20
cases = 30
[tasks.position]
kind = "position"
[starts]
regular = 1
random = 2
margin = 0.1
[loops.circles]
kind = "circle"
size = [0.05, 0.2]
plane = "random"
direction = "random"
speed = 0.1
[loops.raster]
kind = "raster"
share = [0.02, 0.1]
[laws.p]
kind = "moore-penrose"
[laws.l]
kind = "best-lock"
[laws.w]
kind = "weighted"
weight = [[2, 0, 0], [0, 1, 0], [0, 0, 1]]
"""

_VALUES: tuple[Any, ...] = (
    "", "x", "panda", "circle", "random", "*", "[", "no.urdf", "a\0b", "x" * 5000, 0, -1, 1, 10**12, 2**62, 0.5, -0.5,
    1e300, float("nan"), float("inf"), True, [], [0, 0], [1, 0], ["a"], [[1]], {}, {"kind": "circle"}, {"kind": "x"},
    {"name": "panda"}, {"kind": "import", "function": "no:no"}, {"kind": "lock"}, [0.2, 0.1], "日本",
)  # fmt: skip


def attempt(seed: int, folder: Path) -> None:
    """The mutant of a seed, read."""
    chance = random.Random(seed)
    file = folder / "arms.toml"
    if chance.random() < 0.35:
        file.write_bytes(broken(SOUND.encode(), chance))
    else:
        content = tomllib.loads(SOUND)
        for _ in range(chance.choice((1, 1, 2))):
            at: Any = content
            while True:
                key = chance.choice(list(at))
                if not (isinstance(at[key], dict) and at[key] and chance.random() < 0.8):
                    break
                at = at[key]
            if chance.random() < 0.2:
                del at[key]
            else:
                at[key if chance.random() < 0.8 else "extra"] = chance.choice(_VALUES)
        lines = [f"{key} = {toml(value)}" for key, value in content.items()]
        file.write_text("\n".join(lines), "utf-8")
    read_survey(file)
