"""What all libraries get: robots as URDF and MJCF files, and poses, twists and times of the samples of each run."""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import holokin as hk
from benchmarks import drift
from holokin.base.errors import MissingExtraError
from holokin.motion.ik.plan import make_plan
from holokin.motion.simulation import step_targets, steps_between
from holokin.robot import to_mjcf, to_urdf

DT = 0.01
CYCLES = 4
STARTS = drift.STARTS | {"xarm7": np.array([0.1, -0.3, 0.2, 1.2, 0.1, 1.3, 0.1])}
ARMS = tuple(STARTS)

TOURS = 4
CORNERS = 3
"""A tour leads from the start to this many poses, drawn at random, and back, two rounds."""
REACH, TURN = np.array([0.15, 0.25, 0.15]), np.radians(30)
"""The poses of tours lie in this box [m] about the start, turned by up to this about any axis."""
TOUR_SPEED, TOUR_RATE = 0.15, 0.4
"""Of a tour: no faster than this [m/s], and turns no faster than this [rad/s]."""


def robot_of(name: str) -> hk.Robot:
    """The Panda of the file that example-robot-data ships; others of holokin's catalogue."""
    return hk.from_urdf(panda_file(), tip="panda_hand_tcp") if name == "panda" else hk.load(name)


def panda_file() -> Path:
    """The URDF of the package example-robot-data. Raises: MissingExtraError."""
    try:
        listed = files("example-robot-data") or []
    except PackageNotFoundError as problem:
        raise MissingExtraError("the league", "example-robot-data", "test") from problem
    (file,) = (f.locate() for f in listed if f.name == "panda.urdf")
    return Path(str(file))


def paths_of_league(robot: hk.Robot, start: np.ndarray, cycles: int) -> dict[str, tuple[hk.Path, int]]:
    """The paths of the drift benchmark with their cycles, and half its circle by both ways at each speed."""
    point = robot.pose(start)[:3, 3]
    whole = drift.paths(point)
    found = {name: (path, cycles) for name, path in whole.items()}
    for speed in drift.SPEEDS:
        for way, half in zip(("there", "round"), whole["circle"].at_speed(speed).halves(), strict=True):
            found[f"{way} at {speed}"] = (half, 1)
    return found


def tour_of(first: np.ndarray, seed: int, dt: float) -> dict[str, np.ndarray]:
    """Poses, twists and times of two rounds of straight legs from a pose through others, drawn at random, and back."""
    rng, corners = np.random.default_rng(seed), [first]
    for _ in range(CORNERS):
        pose, axis = first.copy(), rng.normal(size=3)
        pose[:3, 3] += rng.uniform(-REACH, REACH)
        turn = Rotation.from_rotvec(rng.uniform(0, TURN) * axis / np.linalg.norm(axis))
        pose[:3, :3] = turn.as_matrix() @ first[:3, :3]
        corners.append(pose)
    legs = [first[None]]
    for a, b in pairwise([*corners, first]):
        turn = Rotation.from_matrix(b[:3, :3] @ a[:3, :3].T).magnitude()
        seconds = max(np.linalg.norm(b[:3, 3] - a[:3, 3]) / TOUR_SPEED, turn / TOUR_RATE)
        legs.append(straight(a, b, int(np.ceil(seconds / dt))))
    every = np.concatenate(legs)
    h = np.full(len(every) - 1, dt)
    _, twists = steps_between(every[:, None, :3, 3], every[:, None, :3, :3], h)
    return {name: np.concatenate([one] * 2) for name, one in (("poses", every[1:]), ("twists", twists[:, 0]), ("h", h))}


def straight(a: np.ndarray, b: np.ndarray, count: int) -> np.ndarray:
    """Poses (count, 4, 4) at even steps after a, straight to b, which is the last; turned about one axis."""
    turn, share = Rotation.from_matrix(b[:3, :3] @ a[:3, :3].T).as_rotvec(), np.linspace(0, 1, count + 1)[1:, None]
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(share * turn).as_matrix() @ a[:3, :3]
    poses[:, :3, 3] = a[:3, 3] + share * (b[:3, 3] - a[:3, 3])
    return poses


def write_arm(folder: Path, name: str, robot: hk.Robot, start: np.ndarray, arrays: dict[str, Any]) -> dict[str, Any]:
    """Write the URDF, the MJCF and the arrays of an arm's runs. Returns: what course.json says of it."""
    (folder / f"{name}.urdf").write_text(to_urdf(robot), "utf-8")
    (folder / f"{name}.xml").write_text(to_mjcf(robot), "utf-8")
    low, high = ranges_of(robot)
    q = np.vstack([start, np.random.default_rng(0).uniform(low, high, (8, robot.n))])
    arrays = arrays | {"check/q": q, "check/poses": robot.pose(q)}
    np.savez(folder / f"{name}.npz", **arrays)
    return {
        "name": name, "urdf": f"{name}.urdf", "mjcf": f"{name}.xml", "base": "base", "frame": robot.tips[0].name,
        "joints": list(robot.joint_names), "lower": robot.lower.tolist(), "upper": robot.upper.tolist(),
        "speed": robot.max_velocity.tolist(), "start": start.tolist(),
    }  # fmt: skip


def ranges_of(robot: hk.Robot) -> tuple[np.ndarray, np.ndarray]:
    """The joint limits, half a turn both ways where there is none."""
    low, high = robot.lower, robot.upper
    return np.where(np.isfinite(low), low, -np.pi), np.where(np.isfinite(high), high, np.pi)


def write_course(
    folder: Path, arms: tuple[str, ...] = ARMS, cycles: int = CYCLES, dt: float = DT, tours: int = TOURS
) -> None:
    """Write course.json, and of each arm its URDF, its MJCF and the arrays of its runs."""
    folder.mkdir(parents=True, exist_ok=True)
    told = []
    for name in arms:
        robot, start = robot_of(name), STARTS[name]
        task, arrays = hk.pose(robot), {}
        for run, (path, rounds) in paths_of_league(robot, start, cycles).items():
            plan = make_plan(task, path, int(np.ceil(path.duration / dt - 1e-9)), task._place(start)[1])
            poses, twists = step_targets(plan)
            for what, values in (("poses", poses), ("twists", twists), ("h", plan.h)):
                arrays[f"{run}/{what}"] = np.concatenate([values] * rounds)
        for k in range(tours):
            arrays |= {f"tour {k}/{what}": values for what, values in tour_of(robot.pose(start), k, dt).items()}
        told.append(write_arm(folder, name, robot, start, arrays))
    (folder / "course.json").write_text(json.dumps(told, indent=1), "utf-8")
