"""Plugins of ROS 2 in exported packages, built against the stand-ins of tests/export/ros_stubs."""

from __future__ import annotations

import subprocess
from pathlib import Path

from holokin.export import MoveItPackage, Ros2ControlPackage

STUBS = Path(__file__).parent / "export" / "ros_stubs"
STRICT = ("-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror")
SOURCES = {MoveItPackage: "kinematics_plugin.cpp", Ros2ControlPackage: "tool_controller.cpp"}


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    """A program that must end well."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stderr + done.stdout
    return done


def includes(*places: str) -> list[str]:
    """Folders of stand-ins."""
    return [f"-I{STUBS / place}" for place in places]


def library(
    written: MoveItPackage | Ros2ControlPackage, folder: Path, *flags: str,
    places: tuple[str, ...] = ("ros", "robot", "control", "loader"),
) -> Path:  # fmt: skip
    """The plugin as a library, with the strictest warnings."""
    code, made = folder / "law.o", folder / "libplugin.so"
    c, source = written.folder / "c", written.folder / "src" / SOURCES[type(written)]
    run("cc", "-std=c99", "-O1", "-fPIC", "-fvisibility=hidden", *flags, "-c", c / f"{written.name}.c", "-o", code)
    build = ("g++", "-std=c++17", "-O0", *STRICT, "-fPIC", "-shared", *flags, *includes(*places), f"-I{c}")
    run(*build, source, code, "-o", made)
    return made


def driver(name: str, folder: Path, *flags: str) -> Path:
    """A driver of the stand-ins."""
    made = folder / "driver"
    build = ("g++", "-std=c++17", "-O0", "-rdynamic", *flags, *includes("ros", "robot", "control"))
    run(*build, STUBS / name, "-o", made, "-ldl", "-lpthread")
    return made
