"""The advice on five arms that it has not seen before: time, the best law, and how near it is to the least joint speed.

python -m benchmarks.advice [--quick] [--only NAME]: prints the table of docs/workspaces.md. Each arm gets the workspace
that is proposed for it, a box round the tool with moderate turns.
"""

from __future__ import annotations

import argparse
import time
from importlib.metadata import files
from pathlib import Path

import holokin as hk
from holokin.analysis.coverage.pose_postures import chain_to_tool
from holokin.analysis.coverage.starts import fitting_task

ARMS = {
    "panda": ("panda.urdf", {}),
    "iiwa14": ("iiwa14", {}),
    "xarm7": ("xarm7.urdf", {}),
    "tiago, torso and arm": ("tiago.urdf", {}),
    "talos, left arm": ("talos_full_v2.urdf", {"base": "torso_2_link"}),
}
"""Name -> (file of example-robot-data, or name of the catalogue; what is said besides)."""

QUICK = {"planar-3r": ("planar-3r", {})}
"""What --quick looks at."""


def located(name: str) -> str:
    """The path of a URDF of example-robot-data; a name of the catalogue as it is."""
    if not name.endswith(".urdf"):
        return name
    listed = files("example-robot-data") or []
    return next(str(Path(str(f.locate())).resolve()) for f in listed if f.name == name)


def row(name: str, file: str, more: dict[str, str]) -> str:
    """A line of the table."""
    wall, processor = time.perf_counter(), time.process_time()
    advice = hk.advise(fitting_task(chain_to_tool(located(file), **more).robot))
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    best, task = advice.best, advice.task
    cells = [
        name, f"{task.n} - {task.m}", best.name, f"{best.coverage:.1%}", f"{best.speed - 1:.1%}",
        " ".join(advice.reasons[2:]),
        f"{processor:.0f}", f"{wall:.0f}",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a planar arm alone")
    parser.add_argument("--only", help="one of the arms")
    asked = parser.parse_args()
    arms = QUICK if asked.quick else {k: v for k, v in ARMS.items() if asked.only in (None, k)}
    print("| arm | n - m | best law | reached | above the least | why | processor [s] | wall [s] |")
    print("|---|---|---|---|---|---|---|---|")
    for name, (file, more) in arms.items():
        print(row(name, file, more), flush=True)


if __name__ == "__main__":
    main()
