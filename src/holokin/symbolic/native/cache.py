"""The cache of built libraries: a folder that nobody else can write, read once, and loaded as read.

A file holds a library and, in its last 64 bytes, a checksum of its name and the library. The checksum tells a whole
file from a half-written, spoilt or renamed one. It is no secret: whoever can write to the folder can make a file that
passes. What keeps other people's code out is that the folder and the file belong to this user or to root and that
nobody else may write to them (access lists beyond the mode bits are not looked at). A file is opened once, without
following links; what was checked and summed is what is loaded, from memory, so that nothing can be swapped meanwhile.

Windows has no such modes: there the folder is trusted as the user's own, and a library is loaded by its path.
"""

from __future__ import annotations

import ctypes
import hashlib
import itertools
import os
import stat
import struct
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from ...base.errors import NativeError
from .toolchain import plain

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
        found = folder.stat()
        if not _is_ours(found):
            raise NativeError(f"the cache folder {name} belongs to somebody else; {_CURE}", "cache")
        if os.name == "posix" and found.st_mode & _OTHERS_WRITE:
            if given or found.st_uid != os.geteuid():
                fact = f"others can write to the cache folder {name}, and put code there"
                raise NativeError(f"{fact}; take that permission away (chmod go-w), or {_CURE}", "cache")
            folder.chmod(stat.S_IMODE(found.st_mode) & ~_OTHERS_WRITE)
    except OSError as problem:
        raise NativeError(f"the cache folder {name} cannot be made ({problem.strerror}); {_CURE}", "cache") from problem
    return folder


_CURE = "set HOLOKIN_CACHE to a folder of your own"


def kept(path: Path) -> bytes | None:
    """The library that is kept under a path, if the file is whole and nobody else could write it; else None."""
    try:
        data, found = read_regular(path)
    except OSError:
        return None
    if os.name == "posix" and found.st_mode & _OTHERS_WRITE:
        return None
    library, seal = data[:-_SEAL], data[-_SEAL:]
    return library if seal == _checksum(path, library) else None


def keep(path: Path, library: bytes) -> None:
    """Put a library into the cache, whole or not at all.

    Raises:
        NativeError: the folder cannot be written.
    """
    _sweep(path.parent)
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
    found = _loads.get(key)
    return _loads.setdefault(key, _load(library, path)) if found is None else found


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


def read_regular(path: Path) -> tuple[bytes, os.stat_result]:
    """The bytes of a regular file of this user's or root's, and what it is. It is opened once; a pipe does not hang.

    Raises:
        OSError: it is missing, a link, no regular file, too large, or somebody else's.
    """
    careful = ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY")
    handle = os.open(path, os.O_RDONLY | sum(getattr(os, flag, 0) for flag in careful))
    try:
        found = os.fstat(handle)
        if not (stat.S_ISREG(found.st_mode) and found.st_size <= MOST and _is_ours(found)):
            raise OSError(f"{path} is no file of ours")
        with open(handle, "rb", closefd=False) as file:
            return file.read(MOST), found
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


def _is_ours(found: os.stat_result) -> bool:
    return os.name != "posix" or found.st_uid in (os.geteuid(), 0)


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


def _sweep(folder: Path) -> None:
    """Remove what killed processes were writing."""
    with suppress(OSError):
        for aside in folder.glob("building-*"):
            if aside.is_file() and time.time() - aside.stat().st_mtime > STALE:
                aside.unlink()
