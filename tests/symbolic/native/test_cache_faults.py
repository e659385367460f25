"""Caches that are refused, full or poisoned: nothing foreign is loaded, and the numbers are the same."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from conftest import Command, sampled
from faults import MACHINE, NATIVE, built, check, forget, fresh, needs_compiler, sines
from holokin.symbolic.native import engine
from holokin.symbolic.native import toolchain as cache_module
from holokin.symbolic.native import toolchain as native

__all__ = ["built", "fresh"]
Patch = pytest.MonkeyPatch
Logs = pytest.LogCaptureFixture
REAL = shutil.which("gcc") or shutil.which("cc") or "cc"
pytestmark = [needs_compiler, pytest.mark.usefixtures("fresh")]


def _somebody_else(folder: Path) -> None:
    folder.mkdir()
    if os.geteuid() != 0:
        pytest.skip("only root gives a folder away")
    os.chown(folder, 12345, 12345)


FOLDERS: dict[str, Callable[[Path], object]] = {
    "a file": lambda f: f.write_text("mine"),
    "below a file": lambda f: (f.parent / "cache").write_text("mine"),
    "a dangling link": lambda f: f.symlink_to("no-where"),
    "a link to itself": lambda f: f.symlink_to(f),
    "somebody else's": _somebody_else,
    "everybody's": lambda f: (f.mkdir(), f.chmod(0o777)),
    "everybody's, sticky": lambda f: (f.mkdir(), f.chmod(0o1777)),
    "a group's": lambda f: (f.mkdir(), f.chmod(0o770)),
    "a link to everybody's": lambda f: (f.symlink_to("far"), (f.parent / "far").mkdir(), f.chmod(0o777)),
    "a name too long": lambda f: None,
}  # fmt: skip


@pytest.mark.parametrize("kind", FOLDERS)
def test_a_cache_folder_that_will_not_do_is_refused_once(
    kind: str, tmp_path: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    folder = tmp_path / "cache"
    FOLDERS[kind](folder)
    place = {"below a file": folder / "below", "a name too long": tmp_path / ("x" * 300)}.get(kind, folder)
    monkeypatch.setenv("HOLOKIN_CACHE", str(place))
    mode = folder.stat().st_mode if folder.is_dir() else None
    (message,) = check(MACHINE, 1, caplog, holokin)
    assert "HOLOKIN_CACHE" in message
    assert mode is None or (folder.stat().st_mode == mode and not list(folder.iterdir()))  # left as it was


def test_the_default_folder_is_closed_to_others(
    tmp_path: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    monkeypatch.delenv("HOLOKIN_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    folder = native.cache_folder()
    assert tmp_path in folder.parents
    folder.chmod(0o777)
    check(NATIVE, 0, caplog, holokin)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o755


def test_without_home_and_without_an_entry_in_passwd(monkeypatch: Patch, caplog: Logs, holokin: Command) -> None:
    import pwd

    def nobody(_: int) -> None:
        raise KeyError("uid not found")

    for name in ("HOLOKIN_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    (message,) = check(MACHINE, 1, caplog, holokin)
    assert "no home folder" in message


@pytest.mark.usefixtures("optimized")  # the suite's own compiler may stand where that user cannot read
def test_a_folder_that_is_truly_read_only(caplog: Logs, monkeypatch: Patch, holokin: Command) -> None:
    """By a user who is not root: what is not kept yet runs on the virtual machine, what is kept as native code."""
    place = Path(tempfile.mkdtemp(dir="/tmp"))
    monkeypatch.setenv("HOLOKIN_CACHE", str(place))
    root = os.geteuid() == 0
    try:
        assert engine().startswith(NATIVE)  # the probe is kept, and all modules are loaded
        for file in place.iterdir():
            file.chmod(0o644)
        place.chmod(0o555)
        forget()
        if root:
            os.seteuid(65534)
        (message,) = check_after_a_first_function(caplog)
        assert "cannot be written (Permission denied" in message
    finally:
        if root:
            os.seteuid(0)
        place.chmod(0o755)
        shutil.rmtree(place)


def check_after_a_first_function(logs: Logs) -> list[str]:
    assert engine().startswith(NATIVE)
    sines()
    sines()
    assert engine().startswith(MACHINE)
    return [record.getMessage() for record in logs.records]


@sampled(3, "number", [errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EXDEV, errno.EPERM])
@pytest.mark.parametrize("call", ["replace", "mkstemp"])
def test_a_cache_that_takes_no_file(
    number: int, call: str, tmp_path: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr({"replace": os, "mkstemp": tempfile}[call], call, refused)
    (message,) = check(MACHINE, 1, caplog, holokin)
    assert os.strerror(number) in message
    assert list((tmp_path / "cache").iterdir()) == []


FULL = """
import numpy as np, casadi as ca
from holokin.symbolic.native import engine
from holokin.symbolic import Function, function, symbol
function.NATIVE_FROM, x, X = 1, symbol("x", 1), np.linspace(-3, 3, 64)
for k in (1, 2):
    assert abs(Function("sine", {"x": x}, {"y": ca.sin(k * x)}).batch(X[:, None]) - np.sin(k * X)).max() < 1e-15
print(engine())
"""


@sampled(1, "kind", ["a full disk", "a limit of file size"])
def test_a_truly_full_cache(kind: str, tmp_path: Path) -> None:
    """A file system of 4 kB, mounted for one process alone, and a process that may write no file over 8 kB."""
    folder = tmp_path / "small"
    folder.mkdir()
    full = f"mount -t tmpfs -o size=4k,mode=700 none '{folder}' && exec \"$@\""
    limit = 'ulimit -f 16; exec "$@"'
    command = ["unshare", "-m", "sh", "-c", full, "-"] if kind == "a full disk" else ["sh", "-c", limit, "-"]
    if shutil.which(command[0]) is None or subprocess.run([*command, "true"], capture_output=True).returncode:
        pytest.skip("file systems cannot be mounted here")
    done = subprocess.run(
        [*command, sys.executable, "-B", "-c", FULL],
        env=os.environ | {"HOLOKIN_CACHE": str(folder)}, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(MACHINE)
    assert done.stderr.count("\n") == 1 and "virtual machine runs instead" in done.stderr


# --- caches: the files ---


def _resealed(file: Path, library: bytes) -> None:
    file.write_bytes(library + cache_module._checksum(file, library))


def _sparse(file: Path) -> None:
    with file.open("r+b") as open_file:
        open_file.truncate(1 << 40)


def _given_away(file: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root gives a file away")
    os.chown(file, 12345, 12345)


def _swapped(file: Path) -> None:
    """Its name goes to another whole library of the cache, as somebody who may only rename could do it."""
    other = next((f for f in file.parent.iterdir() if f != file and f.suffix == native.SUFFIX), file)
    file.write_bytes(other.read_bytes() if other != file else b"")


def _instead(make: Callable[[Path], object]) -> Callable[[Path], object]:
    return lambda file: (file.unlink(), make(file))


FILES: dict[str, tuple[str, Callable[[Path], object]]] = {
    "empty": (NATIVE, lambda f: f.write_bytes(b"")),
    "text": (NATIVE, lambda f: f.write_text("no library" * 100)),
    "cut": (NATIVE, lambda f: f.write_bytes(f.read_bytes()[:-500])),
    "one bit turned": (NATIVE, lambda f: f.write_bytes(f.read_bytes()[:700] + b"?" + f.read_bytes()[701:])),
    "a checksum that is no UTF-8": (NATIVE, lambda f: f.write_bytes(f.read_bytes()[:-64] + b"\xff" * 64)),
    "a pipe": (NATIVE, _instead(os.mkfifo)),
    "a dangling link": (NATIVE, _instead(lambda f: f.symlink_to("no-where"))),
    "a link to itself": (NATIVE, _instead(lambda f: f.symlink_to(f))),
    "a link to a whole library": (NATIVE, lambda f: f.symlink_to(f.rename(f.with_suffix(".moved")))),
    "a terabyte": (NATIVE, _sparse),
    "everybody's to write": (NATIVE, lambda f: f.chmod(0o666)),
    "somebody else's": (NATIVE, _given_away),
    "another function's": (NATIVE, _swapped),
    "no library, and sealed": (NATIVE, lambda f: _resealed(f, b"no library")),
    "a library without the function, and sealed": (NATIVE, lambda f: _resealed(f, _empty_library(f.parent))),
    "an old seal that is a folder": (NATIVE, lambda f: f.with_suffix(".sha256").mkdir()),
    "a folder": (MACHINE, _instead(lambda f: f.mkdir())),
    "a folder that is not empty": (MACHINE, _instead(lambda f: (f / "mine").mkdir(parents=True))),
}


def _empty_library(folder: Path) -> bytes:
    made = folder / "empty.made"
    subprocess.run([REAL, "-shared", "-x", "c", os.devnull, "-o", made], check=True)
    try:
        return made.read_bytes()
    finally:
        made.unlink()


@sampled(2, "kind", FILES)
def test_a_poisoned_file_is_never_loaded(
    kind: str, built: Path, tmp_path: Path, caplog: Logs, holokin: Command
) -> None:
    expected, spoil = FILES[kind]
    shutil.copytree(built, tmp_path / "cache")
    for file in sorted((tmp_path / "cache").iterdir()):
        spoil(file)
    forget()
    check(expected, int(expected == MACHINE), caplog, holokin)
    if expected == NATIVE:  # and now it is whole again
        files = list((tmp_path / "cache").glob(f"*{native.SUFFIX}"))
        assert len(files) == 3 and all(native.kept(file) is not None for file in files)


def test_no_mutant_of_a_file_passes(built: Path, tmp_path: Path) -> None:
    """500 of them: bytes changed, cut, inserted, doubled, taken from another library of the cache."""
    first, second = sorted(built.iterdir())[:2]
    data, other, rng = first.read_bytes(), second.read_bytes(), np.random.default_rng(0)
    mutant = tmp_path / first.name
    mutant.write_bytes(data)
    mutant.chmod(0o600)
    assert native.kept(mutant) == data[:-64]
    for _ in range(500):
        a, b = sorted(rng.integers(0, len(data), 2))
        piece = [rng.bytes(int(rng.integers(1, 9))), b"", other[a:b], data[a:b] * 2][rng.integers(4)]
        changed = data[:a] + piece + data[[a, b, len(data)][rng.integers(3)] :]
        mutant.write_bytes(changed)
        assert native.kept(mutant) is None or changed == data
    mutant.write_bytes(other)  # whole, under another's name
    assert native.kept(mutant) is None


def test_a_file_swapped_after_the_check_is_not_loaded(tmp_path: Path, monkeypatch: Patch) -> None:
    """At the very moment at which the loader is called, a foreign library takes the file's place."""
    source = "double answer(void) { return 42.0; }"
    native.library(source)
    (file,) = (tmp_path / "cache").glob(f"*{native.SUFFIX}")
    foreign, true = tmp_path / "foreign.so", ctypes.CDLL
    text = "double answer(void) { return 666.0; }"
    subprocess.run([REAL, "-shared", "-fPIC", "-x", "c", "-", "-o", foreign], input=text, text=True, check=True)

    def swap(path: str, *rest: object) -> ctypes.CDLL:
        foreign.replace(file)
        return true(path, *rest)

    monkeypatch.setattr(cache_module, "_loads", {})  # as in a process that has not loaded it yet
    monkeypatch.setattr(ctypes, "CDLL", swap)
    loaded = native.library(source)
    loaded.answer.restype = ctypes.c_double
    assert loaded.answer() == 42.0
    assert not foreign.exists()
    monkeypatch.setattr(ctypes, "CDLL", true)
    monkeypatch.setattr(cache_module, "_loads", {})
    again = native.library(source)  # nor by the next
    again.answer.restype = ctypes.c_double
    assert again.answer() == 42.0


def test_many_libraries_are_each_their_own(monkeypatch: Patch) -> None:
    """The loader knows libraries by name, and numbers of open files come again: no library is taken for another."""
    for memory in (True, False):
        if not memory:
            monkeypatch.delattr(os, "memfd_create", raising=False)
        for k in range(8):
            loaded = native.library(f"double answer(void) {{ return {k}.0; }}")
            loaded.answer.restype = ctypes.c_double
            assert loaded.answer() == k


def test_a_process_killed_while_it_wrote_leaves_no_litter(tmp_path: Path) -> None:
    folder = native.cache_folder()
    old, new = folder / "building-1", folder / "building-2"
    for file in (old, new):
        file.write_text("half")
    os.utime(old, (0, 0))
    native.library("double answer(void) { return 1.0; }")
    assert not old.exists() and new.exists()  # the other one may be at work
