"""Kinematics plugins of MoveIt, built against the stand-ins of tests/export/ros_stubs and asked as MoveIt asks."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from holokin.base.types import Array
from holokin.export import MoveItPackage

STUBS = Path(__file__).parent / "export" / "ros_stubs"
STRICT = ("-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror")
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


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    """A program that must end well."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stderr + done.stdout
    return done


def library(written: MoveItPackage, folder: Path, *flags: str) -> Path:
    """The plugin as a library, with the strictest warnings."""
    code, made = folder / "law.o", folder / "libplugin.so"
    c = written.folder / "c"
    run("cc", "-std=c99", "-O1", "-fPIC", "-fvisibility=hidden", *flags, "-c", c / f"{written.name}.c", "-o", code)
    includes = [f"-I{place}" for place in (STUBS / "ros", STUBS / "loader", c)]
    source = written.folder / "src" / "kinematics_plugin.cpp"
    run("g++", "-std=c++17", "-O0", *STRICT, "-fPIC", "-shared", *flags, *includes, source, code, "-o", made)
    return made


def driver(folder: Path, *flags: str) -> Path:
    """The driver of the stand-ins."""
    made = folder / "driver"
    run("g++", "-std=c++17", "-O0", *flags, f"-I{STUBS / 'ros'}", STUBS / "driver.cpp", "-o", made, "-ldl", "-lpthread")
    return made


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
