"""Kinematics plugins of MoveIt, asked as MoveIt asks."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from holokin.base.types import Array

SUCCESS, NO_SOLUTION, TIMED_OUT = 1, -31, -6


@dataclass(frozen=True)
class Plugin:
    """A built plugin with its driver, and the robot of its package."""

    library: Path
    driver: Path
    robot: Path


@dataclass(frozen=True)
class Answers:
    """What the driver says: its exit code, its words, and for each pose the code, the joints, the seconds."""

    exit: int
    words: str
    codes: Array
    joints: Array
    seconds: Array


def ask(
    plugin: Plugin, poses: Array, seeds: Array, *parameters: str, base: str = "base", tip: str, group: str = "arm",
    robot: Path | None = None, threads: int = 1, timeout: float = 100.0,
) -> Answers:  # fmt: skip
    """The answers for poses (k, 4, 4) with seeds (k, n) in the order of the group. `parameters`: NAME=KIND:VALUE."""
    given, found = plugin.driver.with_name("in.bin"), plugin.driver.with_name("out.bin")
    quaternions = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    np.hstack([poses[:, :3, 3], quaternions, seeds]).tofile(given)
    found.unlink(missing_ok=True)
    place = robot or plugin.robot
    words = [plugin.driver, plugin.library, place, group, base, tip, given, found, threads, timeout, *parameters]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=400, check=False)
    rows = np.fromfile(found).reshape(len(poses), -1) if found.exists() else np.zeros((0, 3))
    return Answers(done.returncode, done.stdout + done.stderr, rows[:, 0], rows[:, 1:-1], rows[:, -1] * 1e-9)
