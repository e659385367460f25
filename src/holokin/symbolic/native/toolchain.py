"""The C compiler, its calls, what it built and keeps, and work that goes on in the background."""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import importlib.util
import itertools
import logging
import os
import platform
import shlex
import shutil
import signal
import stat
import struct
import subprocess
import sys
import tempfile
import threading
import time
import weakref
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from ...base.errors import NativeError

ASKING = 10.0
"""Seconds that a compiler may take to say its version."""

HEARD = 65_536
"""Bytes of what a compiler says that are kept: enough for the first error. The rest is read and dropped."""


_calls: set[subprocess.Popen[bytes]] = set()
_stopped = threading.Event()


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
    given = os.environ.get("CC", "").strip()
    if given:
        why = "it is no program that says its version"
        try:
            words = tuple(shlex.split(given))
            if words and (chosen := _compiler_of(words)) is not None:
                return chosen
        except ValueError as problem:
            why = str(problem).lower()
        logging.getLogger("holokin").warning("CC is %r, which is left out (%s)", given, why)
    commands: list[tuple[str, ...]] = [(name,) for name in ("cc", "gcc", "clang")]
    if importlib.util.find_spec("ziglang") is not None:
        commands.append((sys.executable, "-m", "ziglang", "cc"))
    return next((chosen for chosen in map(_compiler_of, commands) if chosen is not None), None)


def call(command: tuple[str, ...], patience: float, stream: str) -> tuple[int, str]:
    """Run a command: (exit status, the beginning of what it says on `stream`, "stdout" or "stderr").

    Raises:
        OSError: it cannot be started. subprocess.TimeoutExpired: it took longer than `patience` [s] and was killed,
        with all that it had started.
    """
    if _stopped.is_set():
        raise OSError("the interpreter is ending")
    out, err = (subprocess.PIPE if stream == name else subprocess.DEVNULL for name in ("stdout", "stderr"))
    child = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=out, stderr=err, bufsize=0, start_new_session=os.name == "posix"
    )
    _calls.add(child)
    pipe, heard = getattr(child, stream), bytearray()

    def listen() -> None:
        with pipe, suppress(OSError):
            while piece := pipe.read(HEARD):
                heard.extend(piece[: HEARD - len(heard)])

    listener = threading.Thread(target=listen, daemon=True)
    try:
        listener.start()
        status = child.wait(patience)
    except BaseException:  # Ctrl-C included: a session of its own does not hear the terminal
        _signal(child)
        with suppress(subprocess.TimeoutExpired):
            child.wait(5.0)
        raise
    finally:
        _calls.discard(child)
    listener.join(1.0)  # not for ever: something that the compiler left running may hold the pipe
    return status, bytes(heard).decode("utf-8", "replace")


def _stop_all() -> None:
    """End the calls that run, and refuse others: for the end of the interpreter."""
    _stopped.set()
    for child in _calls.copy():
        _signal(child)


def stopped() -> bool:
    """True after `_stop_all`."""
    return _stopped.is_set()


def plain(text: str, most: int = 200) -> str:
    """Text that every terminal and log takes: printable ASCII on one line, no more than `most` characters."""
    line = "".join(letter if letter.isprintable() else " " for letter in text)
    return " ".join(line.split()).encode("ascii", "backslashreplace").decode()[:most]


def _compiler_of(command: tuple[str, ...]) -> Compiler | None:
    """The compiler of a command, if it is there and says its version."""
    if shutil.which(command[0]) is None:
        return None
    try:
        status, output = call((*command, "--version"), ASKING, "stdout")
    except (OSError, subprocess.TimeoutExpired):
        return None
    version = plain(output.strip().partition("\n")[0])
    return Compiler(command, version) if status == 0 and version else None


def _signal(child: subprocess.Popen[bytes]) -> None:
    """End a process and, where there are process groups, what it started."""
    with suppress(OSError):
        if os.name == "posix":
            os.killpg(child.pid, signal.SIGKILL)
        child.kill()


# --- The cache of built libraries: a folder that nobody else can write, read once, and loaded as read.
#
# A file holds a library and, in its last 64 bytes, a checksum of its name and the library. The checksum tells a whole
# file from a half-written, spoilt or renamed one. It is no secret: whoever can write to the folder can make a file that
# passes. What keeps other people's code out is that the folder and the file belong to this user or to root and that
# nobody else may write to them (access lists beyond the mode bits are not looked at). A file is opened once, without
# following links; what was checked and summed is what is loaded, from memory, so that nothing can be swapped meanwhile.
#
# Windows has no such modes: there the folder is trusted as the user's own, and a library is loaded by its path.

SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
FORMAT = "a library and its checksum"
"""What a file holds; part of its name, so that files of another kind have other names."""

MOST = 1 << 26
"""Bytes of the largest library that is read: those of 50,000 operations have less than a hundredth of it."""

STALE = 3600.0
"""Seconds after which a file that a killed process was writing is removed."""

_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_SEAL = 64
_spellings = itertools.count()
_loads: dict[bytes, ctypes.CDLL] = {}


def cache_folder() -> Path:
    """Where libraries are kept: HOLOKIN_CACHE, or the user's cache folder; made, and nobody else's to write.

    The default folder loses the write permission of others, if it has it and is this user's. A folder that
    HOLOKIN_CACHE names is taken as it is, or refused.

    Raises:
        NativeError: it cannot be made, belongs to somebody else, or others can write to it.
    """
    given = os.environ.get("HOLOKIN_CACHE")
    folder = Path(given) if given else _default_folder()
    name = plain(str(folder))
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        status = folder.stat()
        if not _is_ours(status):
            raise NativeError(f"the cache folder {name} belongs to somebody else; {_CURE}", "cache")
        if os.name == "posix" and status.st_mode & _OTHERS_WRITE:
            if given or status.st_uid != os.geteuid():
                fact = f"others can write to the cache folder {name}, and put code there"
                raise NativeError(f"{fact}; take that permission away (chmod go-w), or {_CURE}", "cache")
            folder.chmod(stat.S_IMODE(status.st_mode) & ~_OTHERS_WRITE)
    except OSError as problem:
        raise NativeError(f"the cache folder {name} cannot be made ({problem.strerror}); {_CURE}", "cache") from problem
    return folder


_CURE = "set HOLOKIN_CACHE to a folder of your own"


def kept(path: Path) -> bytes | None:
    """The library that is kept under a path, if the file is whole and nobody else could write it; else None."""
    try:
        data, status = _read_regular(path)
    except OSError:
        return None
    if os.name == "posix" and status.st_mode & _OTHERS_WRITE:
        return None
    library, seal = data[:-_SEAL], data[-_SEAL:]
    return library if seal == _checksum(path, library) else None


def keep(path: Path, library: bytes) -> None:
    """Put a library into the cache, whole or not at all.

    Raises:
        NativeError: the folder cannot be written.
    """
    with suppress(OSError):  # what killed processes were writing
        for unfinished in path.parent.glob("building-*"):
            if unfinished.is_file() and time.time() - unfinished.stat().st_mtime > STALE:
                unfinished.unlink()
    try:
        handle, aside = tempfile.mkstemp(dir=path.parent, prefix="building-")  # nobody else's to read or write
        try:
            with open(handle, "wb") as file:
                file.write(library + _checksum(path, library))
            os.replace(aside, path)  # whoever comes second replaces equal by equal
        except BaseException:
            with suppress(OSError):
                os.unlink(aside)
            raise
    except OSError as problem:
        if kept(path) is not None:  # another process was faster, and Windows replaces no library that is loaded
            return
        fact = f"the cache folder {plain(str(path.parent))} cannot be written ({problem.strerror}, {path.name})"
        raise NativeError(f"{fact}; make room there, or {_CURE}", "cache") from problem


def load(library: bytes, path: Path) -> ctypes.CDLL:
    """Exactly these bytes as a shared library, not whatever is at `path` by now (but on Windows).

    The same bytes are one library, however often they are asked for: what is loaded stays until the process ends.

    Raises:
        OSError: they end before their headers say, or the loader refuses them.
    """
    key = hashlib.sha256(library).digest()
    loaded = _loads.get(key)
    return _loads.setdefault(key, _load(library, path)) if loaded is None else loaded


def _load(library: bytes, path: Path) -> ctypes.CDLL:
    if _is_cut(library):
        raise OSError("the file is cut short")
    if sys.platform == "win32":
        return ctypes.CDLL(str(path))
    if hasattr(os, "memfd_create"):
        with suppress(OSError):  # no /proc, or a system that runs nothing from memory
            return _load_from_memory(library)
    with tempfile.TemporaryDirectory(prefix="holokin-") as private:
        copy = Path(private) / path.name
        copy.write_bytes(library)
        return ctypes.CDLL(str(copy))


def _read_regular(path: Path) -> tuple[bytes, os.stat_result]:
    """The bytes of a regular file of this user's or root's, and what it is. It is opened once; a pipe does not hang.

    Raises:
        OSError: it is missing, a link, no regular file, too large, or somebody else's.
    """
    careful = ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY")
    handle = os.open(path, os.O_RDONLY | sum(getattr(os, flag, 0) for flag in careful))
    try:
        status = os.fstat(handle)
        if not (stat.S_ISREG(status.st_mode) and status.st_size <= MOST and _is_ours(status)):
            raise OSError(f"{path} is no file of ours")
        with open(handle, "rb", closefd=False) as file:
            return file.read(MOST), status
    finally:
        os.close(handle)


def _default_folder() -> Path:
    place = os.environ.get({"win32": "LOCALAPPDATA", "darwin": ""}.get(sys.platform, "XDG_CACHE_HOME"), "")
    if os.path.isabs(place):
        return Path(place) / "holokin"
    try:
        home = Path.home()
    except RuntimeError:
        raise NativeError(f"there is no home folder to keep libraries in; {_CURE}", "cache") from None
    usual = {"win32": ("AppData", "Local"), "darwin": ("Library", "Caches")}.get(sys.platform, (".cache",))
    return home.joinpath(*usual, "holokin")


def _is_ours(status: os.stat_result) -> bool:
    return os.name != "posix" or status.st_uid in (os.geteuid(), 0)


def _checksum(path: Path, library: bytes) -> bytes:
    return hashlib.sha256(path.name.encode() + b"\0" + library).hexdigest().encode()


def _load_from_memory(library: bytes) -> ctypes.CDLL:
    handle = os.memfd_create("holokin")
    try:
        with open(handle, "wb", closefd=False) as file:
            file.write(library)
        # The loader takes a name that it has seen for the library that it has, and numbers of files come again:
        # each library gets a spelling of its own.
        return ctypes.CDLL(f"/proc/self/fd/{'./' * next(_spellings)}{handle}")
    finally:
        os.close(handle)


def _is_cut(library: bytes) -> bool:
    """True for an ELF file that lacks its end: the loader maps it all the same, and the process dies of SIGBUS."""
    if library[:4] != b"\x7fELF":
        return False
    header, start, segment = ("=QQIHHHHH", 32, "=8xQ16xQ") if library[4:5] == b"\2" else ("=IIIHHHHH", 28, "=4xI8xI")
    try:
        segments, sections, _, _, width, count, breadth, number = struct.unpack_from(header, library, start)
        parts = [struct.unpack_from(segment, library, segments + k * width) for k in range(count)]
    except struct.error:
        return True
    return max([sections + number * breadth, *(offset + size for offset, size in parts)]) > len(library)


# --- C to shared library, and what runs. Without a compiler, or a cache to write, all runs on CasADi's virtual machine.
#
# A library is built once for its source, compiler, flags and processor, and kept in the user's cache folder under the
# hash of all these (see `cache`). Whether that works here is tried once in a process, with a library of one line; what
# fails is said once. `HOLOKIN_NATIVE=0` turns native code off; `HOLOKIN_CACHE` moves the folder.

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
    chosen = compiler()
    if chosen is None:
        return "CasADi's virtual machine (no C compiler found; pip install 'holokin[native]' brings one)"
    problem = trouble()
    return f"native code ({chosen})" if problem is None else f"CasADi's virtual machine ({problem.fact})"


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
    data = kept(path)
    if data is not None:
        with suppress(NativeError):  # such as a C library other than the one it was built for
            return _loaded(data, path, chosen, needs)
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


def _loaded(data: bytes, path: Path, chosen: Compiler, needs: tuple[str, ...]) -> ctypes.CDLL:
    try:
        loaded = load(data, path)
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
        status, output = call(command, patience, "stderr")
        if status == 0:
            return _read_regular(made)[0]
    except subprocess.TimeoutExpired:
        raise NativeError(f"{chosen} took more than {patience:g} s and was stopped", "patience") from None
    except OSError as problem:
        reason = plain(problem.strerror or "no library was made")
        raise NativeError(f"{chosen} could not build the generated code ({reason})", "building") from problem
    finally:
        if private is not None:
            shutil.rmtree(private, ignore_errors=True)
    lines = output.splitlines()
    complaint = next((line for line in lines if "error" in line), lines[0] if lines else "no reason given")
    if status < 0:
        ends = {s.value: s.name for s in signal.Signals}
        raise NativeError(f"{chosen} was killed ({ends.get(-status, -status)})", "killed")
    complaint = plain(complaint.replace(str(file), "source.c"))
    raise NativeError(f"{chosen} refused the generated code ({complaint})", "refused")


# --- Work in the background: one thread does one piece after another, and no exit of the interpreter waits for it.
#
# The thread ends when nothing is left to do. At exit, compilers that still run are stopped, and their files removed. A
# process that forks leaves the thread behind: its child begins again what was not done.

ENDING = 2.0
"""Seconds at exit that the thread may take to remove its files: it takes milliseconds."""


class Worker(Protocol):
    """Who has work to do in the background: `work` does it, `again` sees to it that it is asked for again."""

    def work(self) -> None:
        """Do it; it raises nothing."""
        ...

    def again(self) -> None:
        """It was not done."""
        ...


class _Queue:
    """What is left to do; workers that nobody else keeps are dropped."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.waiting: deque[weakref.ref[Worker]] = deque()
        self.thread: threading.Thread | None = None

    def put(self, worker: Worker) -> None:
        """One more; the thread is started if none runs."""
        with self.lock:
            self.waiting.append(weakref.ref(worker))
            if self.thread is None:
                self.thread = threading.Thread(target=self.run, name="holokin-later", daemon=True)
                try:
                    self.thread.start()
                except RuntimeError:  # the interpreter is ending, or there are too many threads
                    self.thread = None

    def run(self) -> None:
        """The thread."""
        try:
            while (worker := self.first()) is not None:
                try:
                    worker.work()
                finally:
                    del worker
                    self.waiting.popleft()
        except BaseException as problem:
            self.thread = None
            if not (isinstance(problem, RuntimeError) and stopped()):  # Python that ends starts no threads
                raise

    def first(self) -> Worker | None:
        """Whose turn it is; it stays the first until it is done. None, and no thread, where nothing is left."""
        with self.lock:
            while self.waiting and not stopped():
                worker = self.waiting[0]()
                if worker is not None:
                    return worker
                self.waiting.popleft()
            self.thread = None  # under the lock, so that whoever puts more starts another
            return None

    def end(self) -> None:
        """Stop the compilers, and see the thread end."""
        thread, until = self.thread, time.monotonic() + ENDING
        _stop_all()
        while thread is not None and thread.is_alive() and time.monotonic() < until:
            thread.join(0.02)
            _stop_all()  # also a call that was about to start


_queue = _Queue()


def later(worker: Worker) -> None:
    """Have `worker.work()` done in the background, unless nobody else keeps it until then."""
    _queue.put(worker)


def idle(patience: float) -> bool:
    """Wait until nothing is left to do, at most some seconds; True when that is so."""
    until = time.monotonic() + patience
    while _queue.waiting and time.monotonic() < until:
        time.sleep(0.002)
    return not _queue.waiting


def _begin_again() -> None:
    """In a child: the thread and its locks were the parent's."""
    global _queue
    undone, _queue = [worker() for worker in _queue.waiting], _Queue()
    _calls.clear()  # the calls of its parent are not its own
    for worker in undone:
        if worker is not None:
            worker.again()


atexit.register(lambda: _queue.end())
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_begin_again)
