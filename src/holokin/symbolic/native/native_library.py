"""C to shared library, and what runs. Without a compiler, or a cache to write, all runs on CasADi's virtual machine.

A library is built once for its source, compiler, flags and processor, and kept in the user's cache folder under the
hash of all these (see `cache`). Whether that works here is tried once in a process, with a library of one line; what
fails is said once. `HOLOKIN_NATIVE=0` turns native code off; `HOLOKIN_CACHE` moves the folder.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from ...base.errors import NativeError
from .cache import FORMAT, SUFFIX, cache_folder, keep, kept, load, read_regular
from .toolchain import Compiler, call, compiler, plain, stopped

PROBE = "double holokin_probe(double x) { return 2 * x; }"
"""What is built first: the smallest library that shows that all of it works."""

PATIENCE = 300.0
"""Seconds that a compiler may take for one source."""

PROBING = 60.0
"""Seconds that a compiler may take for PROBE: some build a library of their own at their first call."""

_troubles: dict[tuple[Compiler, Path], NativeError | None] = {}
_told: set[str] = set()
_telling = threading.Lock()


def allowed() -> bool:
    """Whether HOLOKIN_NATIVE is not 0: what is loaded already needs no more."""
    return os.environ.get("HOLOKIN_NATIVE", "1") != "0"


def enabled() -> bool:
    """True when native code may be used: HOLOKIN_NATIVE is not 0, and a compiler and a cache are there that work."""
    if not allowed() or compiler() is None:
        return False
    problem = trouble()
    if problem is not None:
        tell(problem)
    return problem is None


def engine() -> str:
    """One line that says what runs: native code and by which compiler, or the virtual machine and why."""
    if not allowed():
        return "CasADi's virtual machine (HOLOKIN_NATIVE=0)"
    found = compiler()
    if found is None:
        return "CasADi's virtual machine (no C compiler found; pip install 'holokin[native]' brings one)"
    problem = trouble()
    return f"native code ({found})" if problem is None else f"CasADi's virtual machine ({problem.fact})"


def trouble() -> NativeError | None:
    """Why no library can be built here, or None; found out once for a compiler and a folder."""
    chosen = compiler()
    if chosen is None:
        return NativeError("no C compiler was found")
    try:
        key = chosen, cache_folder()
        if key not in _troubles:
            probe = library(PROBE, needs=("holokin_probe",), patience=PROBING).holokin_probe
            probe.argtypes, probe.restype = [ctypes.c_double], ctypes.c_double
            wrong = probe(21.0) != 42.0
            _troubles[key] = NativeError(f"what {chosen} builds gives wrong numbers", "numbers") if wrong else None
    except NativeError as problem:
        with suppress(NativeError):
            return _troubles.setdefault((chosen, cache_folder()), problem)
        return problem
    return _troubles[key]


def tell(problem: NativeError) -> None:
    """Warn of what keeps native code from running: once in a process for each cause, and not while it ends."""
    if stopped():
        return
    with _telling:
        known = problem.cause in _told
        _told.add(problem.cause)
    if not known:
        logging.getLogger("holokin").warning("%s; CasADi's virtual machine runs instead", problem.fact)


def library(
    source: str,
    *,
    fast: bool = False,
    long: bool = False,
    interleaved: bool = False,
    includes: tuple[str, ...] = (),
    needs: tuple[str, ...] = (),
    patience: float | None = None,
    build: bool = True,
) -> ctypes.CDLL:
    """The shared library of a C source, from the cache or built now.

    Args:
        fast: let products and sums be fused, for vector code; scalar code keeps to the C standard's rounding.
        long: thousands of lines without a branch, on which compilers' cleverest passes take minutes.
        interleaved: let gcc on x86 order operations by when they can begin, as it does elsewhere: code for several
            results becomes up to a third faster, with the same rounding, for half as long again to compile.
        needs: the functions that it must have.
        patience: how long the compiler may take [s], PATIENCE by default.
        build: False for one that is in the cache, or none.

    Raises:
        NativeError: no compiler, or it refuses the source, or the result cannot be kept or loaded; or it is not in the
            cache and none is to be built.
    """
    chosen = compiler()
    if chosen is None:
        raise NativeError("no C compiler was found")
    flags, folder = _flags(chosen, fast, long, interleaved, includes), cache_folder()
    parts = [FORMAT, source, chosen.version, *chosen.command, *flags, _processor()]
    path = folder / f"{hashlib.sha256(os.fsencode(chr(0).join(parts))).hexdigest()[:40]}{SUFFIX}"
    found = kept(path)
    if found is not None:
        with suppress(NativeError):  # such as a C library other than the one it was built for
            return _loaded(found, path, chosen, needs)
    if not build:
        raise NativeError("the library was not built before", "absent")
    known = _troubles.get((chosen, folder))
    if known is not None:
        raise NativeError(known.fact, known.cause)
    try:
        built = _built(chosen, source, flags, PATIENCE if patience is None else patience)
        keep(path, built)
    except NativeError as problem:
        if problem.cause in ("cache", "patience"):  # it would fail again, after as long a time
            _troubles[chosen, folder] = problem
        raise
    try:
        return _loaded(built, path, chosen, needs)
    except NativeError:
        with suppress(OSError):
            path.unlink()
        raise


def extension(built: ctypes.CDLL, name: str) -> Any:
    """The Python module of a library that has PyInit_NAME, which is loaded already, from memory: it has no path.

    Raises:
        ImportError: as the module does.
    """
    start: Any = getattr(ctypes.PyDLL(name, handle=built._handle), f"PyInit_{name}")
    start.restype = ctypes.py_object
    return start()


def _loaded(found: bytes, path: Path, chosen: Compiler, needs: tuple[str, ...]) -> ctypes.CDLL:
    try:
        loaded = load(found, path)
    except (OSError, ValueError) as problem:
        raise NativeError(f"what {chosen} built cannot be loaded ({plain(str(problem))})", "loading") from problem
    for name in needs:
        if not hasattr(loaded, name):
            raise NativeError(f"what {chosen} built lacks the function {name}", "lacking")
    return loaded


def _flags(chosen: Compiler, fast: bool, long: bool, interleaved: bool, includes: tuple[str, ...]) -> tuple[str, ...]:
    flags = [
        "-std=gnu99",
        "-O1" if long else "-O2",
        "-shared",
        "-fno-math-errno",
        "-fno-trapping-math",
        "-fopenmp-simd",
        f"-ffp-contract={'fast' if fast else 'off'}",
    ]
    if "clang" not in chosen.version.lower():
        if long:  # two passes that take time with the square of the length
            flags += ["-fno-tree-dse", "-fno-tree-fre"]
        elif interleaved:
            flags += ["-fschedule-insns", "-fsched-pressure"]
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


def _built(chosen: Compiler, source: str, flags: tuple[str, ...], patience: float) -> bytes:
    """The library of a source. It is built in a private folder, so that nobody can change source or result meanwhile.

    Raises:
        NativeError: the compiler refuses, fails or does not end, or there is no temporary folder to work in.
    """
    private: Path | None = None
    try:
        # No TemporaryDirectory: its finalizer would also run at the exit of a child that was forked meanwhile.
        private = Path(tempfile.mkdtemp(prefix="holokin-"))
        file, made = private / "source.c", private / f"library{SUFFIX}"
        file.write_text(source, "utf-8")
        command = (*chosen.command, *flags, str(file), "-o", str(made), "-lm")
        status, said = call(command, patience, "stderr")
        if status == 0:
            return read_regular(made)[0]
    except subprocess.TimeoutExpired:
        raise NativeError(f"{chosen} took more than {patience:g} s and was stopped", "patience") from None
    except OSError as problem:
        reason = plain(problem.strerror or "no library was made")
        raise NativeError(f"{chosen} could not build the generated code ({reason})", "building") from problem
    finally:
        if private is not None:
            shutil.rmtree(private, ignore_errors=True)
    lines = said.splitlines()
    complaint = next((line for line in lines if "error" in line), lines[0] if lines else "no reason given")
    if status < 0:
        ends = {s.value: s.name for s in signal.Signals}
        raise NativeError(f"{chosen} was killed ({ends.get(-status, -status)})", "killed")
    complaint = plain(complaint.replace(str(file), "source.c"))
    raise NativeError(f"{chosen} refused the generated code ({complaint})", "refused")
