"""What all libraries get: two robots as URDF and MJCF files, and the poses, twists and times of the samples of each run."""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import numpy as np

import holokin as hk
from benchmarks import drift
from holokin.errors import MissingExtraError
from holokin.motion.simulation import step_targets
from holokin.path.plan import make_plan
from holokin.robot import to_mjcf, to_urdf

DT = 0.01
CYCLES = 5
ARMS = ("panda", "iiwa14")


def robot_of(name: str) -> hk.Robot:
    """The Panda of the file that example-robot-data ships; the iiwa14 of holokin's catalogue."""
    if name != "panda":
        return hk.load(name)
    try:
        listed = files("example-robot-data") or []
    except PackageNotFoundError as problem:
        raise MissingExtraError("the league", "example-robot-data", "test") from problem
    (file,) = (f.locate() for f in listed if f.name == "panda.urdf")
    return hk.from_urdf(Path(str(file)), tip="panda_hand_tcp")


def paths_of_league(robot: hk.Robot, start: np.ndarray, cycles: int) -> dict[str, tuple[hk.Path, int]]:
    """The paths of the drift benchmark with their cycles, and half its circle by both ways at each speed."""
    point = robot.pose(start)[:3, 3]
    whole = drift.paths(point)
    found = {name: (path, cycles) for name, path in whole.items()}
    for speed in drift.SPEEDS:
        for way, half in zip(("there", "round"), whole["circle"].at_speed(speed).halves(), strict=True):
            found[f"{way} at {speed}"] = (half, 1)
    return found


def write_course(folder: Path, arms: tuple[str, ...] = ARMS, cycles: int = CYCLES, dt: float = DT) -> None:
    """Write course.json, and of each arm its URDF, its MJCF and the arrays of its runs."""
    folder.mkdir(parents=True, exist_ok=True)
    told = []
    for name in arms:
        robot, start = robot_of(name), drift.STARTS[name]
        (folder / f"{name}.urdf").write_text(to_urdf(robot), "utf-8")
        (folder / f"{name}.xml").write_text(to_mjcf(robot), "utf-8")
        task, arrays = hk.pose(robot), {}
        for run, (path, rounds) in paths_of_league(robot, start, cycles).items():
            plan = make_plan(task, path, int(np.ceil(path.duration / dt - 1e-9)), task.place(start)[1])
            poses, twists = step_targets(plan)
            for what, values in (("poses", poses), ("twists", twists), ("h", plan.h)):
                arrays[f"{run}/{what}"] = np.concatenate([values] * rounds)
        np.savez(folder / f"{name}.npz", **arrays)
        told.append(
            {
                "name": name, "urdf": f"{name}.urdf", "mjcf": f"{name}.xml", "base": "base",
                "frame": robot.tips[0].name, "joints": list(robot.joint_names), "lower": robot.lower.tolist(),
                "upper": robot.upper.tolist(), "speed": robot.max_velocity.tolist(), "start": start.tolist(),
            }
        )  # fmt: skip
    (folder / "course.json").write_text(json.dumps(told, indent=1), "utf-8")
