"""Plugins of ROS 2 in exported packages, built against the stand-ins of tests/export/ros_stubs."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

from holokin.export import MoveItPackage, Ros2ControlPackage

STUBS = Path(__file__).parent / "export" / "ros_stubs"
STRICT = ("-Wall", "-Wextra", "-Wconversion", "-Wpedantic", "-Werror")


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    """A program that must end well."""
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stderr + done.stdout
    return done


def built_once(made: Path, sources: Iterable[Path], *command: str | Path) -> None:
    """The file `made` that the command writes, which takes seconds: kept, for all files of tests with the same sources.

    Args:
        made: what `-o` is to write. sources: what is read. command: the compiler with its flags, without `-o`.
    """
    import fcntl  # which Windows has not

    files = (file for place in (*sources, STUBS) for file in ([place] if place.is_file() else sorted(place.rglob("*"))))
    texts = [f"{file.name}\n".encode() + file.read_bytes() for file in files if file.is_file()]
    flags = [str(word).replace(str(made.parent), "") for word in command]
    flags.append(str(Path(shutil.which(flags[0]) or flags[0]).resolve()))  # g++-13 is not g++-14
    key = hashlib.sha256(b"\0".join([*texts, *map(str.encode, flags)])).hexdigest()[:24]
    folder = Path(os.environ.get("HOLOKIN_CACHE", made.parent)) / "ros"
    folder.mkdir(parents=True, exist_ok=True)
    kept = folder / key
    with (folder / f"{key}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not kept.exists():
            run(*command, "-o", folder / f"{key}.new")
            (folder / f"{key}.new").replace(kept)
    shutil.copy(kept, made)


def includes(*places: str) -> list[str]:
    """Folders of stand-ins."""
    return [f"-I{STUBS / place}" for place in places]


def library(
    written: MoveItPackage | Ros2ControlPackage, folder: Path, *flags: str,
    places: tuple[str, ...] = ("ros", "robot", "control", "loader"),
) -> Path:  # fmt: skip
    """The plugin as a library, with the strictest warnings."""
    code, made = folder / "law.o", folder / "libplugin.so"
    c, sources = written.folder / "c", sorted((written.folder / "src").glob("*.cpp"))
    compiled = ("cc", "-std=c99", "-O1", "-fPIC", "-fvisibility=hidden", *flags, "-c", c / f"{written.name}.c")
    built_once(code, [c], *compiled)
    build = ("g++", "-std=c++17", "-O0", *STRICT, "-fPIC", "-shared", *flags, *includes(*places), f"-I{c}")
    built_once(made, [c, *sources, code], *build, *sources, code)
    return made


def driver(name: str, folder: Path, *flags: str) -> Path:
    """A driver of the stand-ins."""
    made = folder / "driver"
    build = ("g++", "-std=c++17", "-O0", "-rdynamic", *flags, *includes("ros", "robot", "control"))
    built_once(made, [STUBS / name], *build, STUBS / name, "-ldl", "-lpthread")
    return made


def found_by_pluginlib(
    written: MoveItPackage | Ros2ControlPackage, folder: Path, of: str, base: str, header: str, *places: str
) -> str:
    """Build and test a package with Debian's ament_cmake, and let pluginlib load its plugin: the plugins it knows.

    Args:
        of: the package whose plugins they are. base: their class, of the header `header`. places: stand-ins.
    """
    build, installed = folder / "build", folder / "installed"
    options = [f"-DCMAKE_PREFIX_PATH={STUBS / 'cmake'}", f"-DCMAKE_INSTALL_PREFIX={installed}"]
    run("cmake", "-S", written.folder, "-B", build, "-DPython3_EXECUTABLE=/usr/bin/python3", *options)
    run("cmake", "--build", build)
    assert "100% tests passed" in run("ctest", "--test-dir", build).stdout
    run("cmake", "--install", build)
    (installed / "share" / "ament_index" / "resource_index" / "packages" / of).touch()
    needed = ("pluginlib", "class_loader", "rcpputils", "rcutils", "ament_index_cpp")
    real = [f"-I/usr/include/{name}" for name in needed]
    more = ("class_loader", "ament_index_cpp", "rcpputils", "rcutils", "tinyxml2", "console_bridge", "roslib")
    words = [f"-DHEADER=<{header}>", f"-DBASE={base}", f"-DOF={of}"]
    source, load = STUBS / "pluginlib_load.cpp", folder / "load"
    build_load = ("g++", "-std=c++17", "-w", *words, *includes(*places), *real)
    run(*build_load, source, "-o", load, *(f"-l{name}" for name in more))
    return run("env", f"AMENT_PREFIX_PATH={installed}", load, written.plugin).stdout
