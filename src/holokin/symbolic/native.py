"""C to shared library: the compiler, the cache, the loading. Without a compiler all runs on CasADi's virtual machine.

A library is built once for its source, compiler, flags and processor, and kept in the user's cache folder under
the hash of all these. It is written aside and renamed, with a seal (the hash of its bytes) beside it, so that
processes may build at once and a half-written or foreign file is never loaded. `HOLOKIN_NATIVE=0` turns all off;
`HOLOKIN_CACHE` moves the folder.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ..errors import NativeError

SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
PATIENCE = 300.0
"""Seconds that a compiler may take."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler: the words that call it, and what it says it is."""

    command: tuple[str, ...]
    version: str

    def __str__(self) -> str:
        return self.version


@cache
def compiler() -> Compiler | None:
    """The C compiler: CC of the environment, else cc, gcc, clang, else ziglang of Python; None without any."""
    wanted = [tuple(shlex.split(os.environ["CC"]))] if os.environ.get("CC", "").strip() else []
    wanted += [(name,) for name in ("cc", "gcc", "clang")]
    if importlib.util.find_spec("ziglang") is not None:
        wanted.append((sys.executable, "-m", "ziglang", "cc"))
    for command in wanted:
        if shutil.which(command[0]) is None:
            continue
        try:
            said = subprocess.run([*command, "--version"], capture_output=True, text=True, timeout=30, check=False)
        except (OSError, subprocess.TimeoutExpired):
            continue
        if said.returncode == 0 and said.stdout.strip():
            return Compiler(command, said.stdout.splitlines()[0].strip())
    return None


def enabled() -> bool:
    """True when native code may be used: a compiler is there and HOLOKIN_NATIVE is not 0."""
    return os.environ.get("HOLOKIN_NATIVE", "1") != "0" and compiler() is not None


def engine() -> str:
    """One line that says what runs: native code and by which compiler, or the virtual machine and why."""
    if os.environ.get("HOLOKIN_NATIVE", "1") == "0":
        return "CasADi's virtual machine (HOLOKIN_NATIVE=0)"
    found = compiler()
    if found is None:
        return "CasADi's virtual machine (no C compiler found; pip install 'holokin[native]' brings one)"
    return f"native code ({found})"


def cache_folder() -> Path:
    """Where libraries are kept: HOLOKIN_CACHE, or the user's cache folder; made, and nobody else's to write."""
    if os.environ.get("HOLOKIN_CACHE"):
        folder = Path(os.environ["HOLOKIN_CACHE"])
    elif sys.platform == "win32":
        folder = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "holokin"
    elif sys.platform == "darwin":
        folder = Path.home() / "Library" / "Caches" / "holokin"
    else:
        folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "holokin"
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as problem:
        raise NativeError(f"the cache folder {folder} cannot be made ({problem.strerror})") from problem
    if hasattr(os, "getuid") and folder.stat().st_uid not in (os.getuid(), 0):
        raise NativeError(f"the cache folder {folder} belongs to somebody else")
    return folder


def library(source: str, *, fast: bool = False, long: bool = False, includes: tuple[str, ...] = ()) -> ctypes.CDLL:
    """The shared library of a C source, from the cache or built now.

    Args:
        fast: let products and sums be fused, for vector code; scalar code keeps to the C standard's rounding.
        long: thousands of lines without a branch, on which compilers' cleverest passes take minutes.

    Raises:
        NativeError: no compiler, or it refuses the source, or the result cannot be loaded.
    """
    chosen = compiler()
    if chosen is None:
        raise NativeError("no C compiler was found")
    flags = _flags(chosen, fast, long, includes)
    key = hashlib.sha256(
        "\0".join([source, chosen.version, *chosen.command, *flags, _processor()]).encode()
    ).hexdigest()
    path = cache_folder() / f"{key[:40]}{SUFFIX}"
    loaded = _sound(path)
    if loaded is None:
        _build(chosen, source, flags, path)
        loaded = _sound(path)
    if loaded is None:
        raise NativeError(f"the library {path} was built but cannot be loaded")
    return loaded


def path_of(loaded: ctypes.CDLL) -> Path:
    """The file of a loaded library."""
    return Path(loaded._name)


def _flags(chosen: Compiler, fast: bool, long: bool, includes: tuple[str, ...]) -> tuple[str, ...]:
    flags = [
        "-std=gnu99",
        "-O1" if long else "-O2",
        "-shared",
        "-fno-math-errno",
        "-fno-trapping-math",
        "-fopenmp-simd",
        f"-ffp-contract={'fast' if fast else 'off'}",
    ]
    if long and "clang" not in chosen.version.lower():  # two passes that take time with the square of the length
        flags += ["-fno-tree-dse", "-fno-tree-fre"]
    flags += [] if sys.platform == "win32" else ["-fPIC"]
    flags += ["-undefined", "dynamic_lookup"] if sys.platform == "darwin" else []
    if platform.machine().lower() in ("x86_64", "amd64"):
        flags.append("-march=native")
    return (*flags, *(f"-I{folder}" for folder in includes))


@cache
def _processor() -> str:
    """What -march=native depends on."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    except OSError:
        return platform.processor() + platform.machine()
    return platform.machine() + next((line for line in lines if line.startswith(("flags", "Features"))), "")


def _build(chosen: Compiler, source: str, flags: tuple[str, ...], path: Path) -> None:
    with tempfile.TemporaryDirectory(dir=path.parent, prefix="building-") as folder:
        file, made = Path(folder) / "source.c", Path(folder) / path.name
        file.write_text(source, "utf-8")
        command = [*chosen.command, *flags, str(file), "-o", str(made), "-lm"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        except (OSError, subprocess.TimeoutExpired) as problem:
            raise NativeError(f"{chosen.version} did not finish ({problem})") from problem
        if done.returncode != 0 or not made.is_file():
            complaint = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr[:200])
            raise NativeError(f"{chosen.version} refused the generated code ({complaint.strip()})")
        seal = Path(folder) / "seal"
        seal.write_text(_digest(made), "utf-8")
        made.replace(path)  # whole files under their final names: whoever comes second replaces equal by equal
        seal.replace(_seal(path))


def _seal(path: Path) -> Path:
    return path.with_suffix(".sha256")


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _sound(path: Path) -> ctypes.CDLL | None:
    """The library, if its file is whole, ours, and what its seal says; else None."""
    try:
        if hasattr(os, "getuid") and path.stat().st_uid not in (os.getuid(), 0):
            return None
        if _seal(path).read_text("utf-8").strip() != _digest(path):
            return None
        return ctypes.CDLL(str(path))
    except OSError:
        return None
