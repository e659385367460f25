"""Compilers that are broken: another one is taken, or the virtual machine runs, with the same numbers."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from conftest import Command, sampled
from faults import MACHINE, NATIVE, X, built, check, forget, fresh, needs_compiler, sines
from holokin.symbolic import Function, symbol
from holokin.symbolic.native import engine, toolchain
from holokin.symbolic.native import toolchain as cache_module
from holokin.symbolic.native import toolchain as native

__all__ = ["built", "fresh"]
Patch = pytest.MonkeyPatch
Logs = pytest.LogCaptureFixture
pytestmark = [needs_compiler, pytest.mark.usefixtures("fresh")]


SAYS = 'case "$*" in *--version*) echo "gcc 1.0"; exit;; esac\n'
LAST = 'for word; do [ "$before" = -o ] && out=$word; before=$word; done\n'
REAL = shutil.which("gcc") or shutil.which("cc") or "cc"
MADE = f'{REAL} "$@" || exit\n'


def made(source: str) -> str:
    """Shell that makes a library of this source, whatever was wanted."""
    return f"echo '{source}' | {REAL} -fPIC -shared -x c - -o \"$out\""


NO_COMPILERS = {
    "an open quote": "gcc '",
    "a lone backslash": "gcc \\",
    "no word": "''",
    "a missing program": "no-such-compiler-here",
    "a folder": "/",
    "a file that is not executable": "/etc/passwd",
}
SILENT = {
    "an empty file": "",
    "not a program": "\x7fELF no program",
    "a missing interpreter": "#!/no/such/shell\n",
    "no version, exit 1": "#!/bin/sh\nexit 1\n",
    "no version, exit 0": "#!/bin/sh\nexit 0\n",
    "a version of blanks": "#!/bin/sh\nprintf ' \\n\\t\\r\\033'\n",
    "killed when asked": "#!/bin/sh\nkill -9 $$\n",
}
WORKING = {
    "a version that is no UTF-8": "printf 'gcc \\377\\376\\n'",
    "a version of a megabyte": "head -c 1000000 /dev/zero | tr '\\0' v",
    "a version with colours": "printf '\\033[31mgcc\\033[0m\\n'",
    "a child that holds the pipe": "(sleep 3 &) ; echo gcc",
}
BROKEN = {
    "refuses": "echo error: no >&2; exit 1",
    "refuses without a word": "exit 1",
    "a complaint that is no UTF-8": "printf 'error: \\377\\376\\n' >&2; exit 1",
    "a complaint of a megabyte": "head -c 1000000 /dev/zero | tr '\\0' e >&2; exit 1",
    "much to say, and nothing done": "head -c 1000000 /dev/zero",
    "a status beyond all": "exit 255",
    "killed": "kill -9 $$",
    "crashes": "kill -SEGV $$",
    "makes nothing": "exit 0",
    "makes an empty file": ': > "$out"',
    "makes text": 'echo hello > "$out"',
    "makes a folder": 'mkdir "$out"',
    "makes a pipe": 'mkfifo "$out"',
    "makes a dangling link": 'ln -s /no/where "$out"',
    "makes a link to endless zeros": 'ln -s /dev/zero "$out"',
    "makes a terabyte": 'truncate -s 1T "$out"',
    "makes half a library": MADE + 'head -c 900 "$out" > "$out.2"; mv "$out.2" "$out"',
    "makes an object, no library": f'{REAL} -c -x c /dev/null -o "$out"',
    "makes a library for another processor": MADE
    + 'printf "\\263" | dd of="$out" bs=1 seek=18 conv=notrunc 2> /dev/null',
    "makes a library without the function": f'{REAL} -shared -x c /dev/null -o "$out"',
    "makes a library that needs what is not there": made("int none(void); int holokin_probe(void) { return none(); }"),
    "makes wrong numbers": made("double holokin_probe(double x) { return 3 * x; }"),
    "removes the folder": 'rm -r "$(dirname "$out")"',
}  # fmt: skip


def script(folder: Path, text: str) -> str:
    file = folder / "a compiler"
    file.write_text(text)
    file.chmod(0o755)
    return f"'{file}'"


@sampled(6, "given", NO_COMPILERS.values(), ids=NO_COMPILERS)
def test_a_cc_that_is_no_compiler_is_left_out(
    given: str, built: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    monkeypatch.setenv("HOLOKIN_CACHE", str(built))
    monkeypatch.setenv("CC", given)
    (message,) = check(NATIVE, 1, caplog, holokin)
    assert "CC is" in message


@pytest.mark.parametrize("text", SILENT.values(), ids=SILENT)
def test_a_program_that_says_no_version_is_left_out(
    text: str, built: Path, tmp_path: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    monkeypatch.setenv("HOLOKIN_CACHE", str(built))
    monkeypatch.setenv("CC", script(tmp_path, text))
    check(NATIVE, 1, caplog, holokin)


@sampled(1, "says", WORKING.values(), ids=WORKING)
def test_a_compiler_that_only_says_odd_things_is_used(
    says: str, tmp_path: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    text = f'#!/bin/sh\ncase "$*" in *--version*) {says}; exit;; esac\nexec {REAL} "$@"\n'
    monkeypatch.setenv("CC", script(tmp_path, text))
    check(NATIVE, 0, caplog, holokin)


@pytest.mark.campaign
@sampled(8, "does", BROKEN.values(), ids=BROKEN)
def test_after_a_broken_compiler_the_virtual_machine_runs(
    does: str, tmp_path: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    monkeypatch.setenv("CC", script(tmp_path, f"#!/bin/sh\n{SAYS}{LAST}{does}\n"))
    (message,) = check(MACHINE, 1, caplog, holokin)
    assert "gcc 1.0" in message and "virtual machine runs" in message


BUSY = "while :; do echo busy >> busy; sleep 0.02; done"


@sampled(1, "does", [BUSY, f"({BUSY}) & wait", f"({BUSY}) & yes error >&2"])
def test_a_compiler_that_does_not_end_is_stopped_once(
    does: str, tmp_path: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    monkeypatch.setattr(native, "PROBING", 0.5)
    monkeypatch.setenv("CC", script(tmp_path, f"#!/bin/sh\n{SAYS}cd '{tmp_path}'; echo >> calls\n{does}\n"))
    (message,) = check(MACHINE, 1, caplog, holokin)
    assert "0.5 s" in message
    assert (tmp_path / "calls").read_text() == "\n"
    before = (tmp_path / "busy").stat().st_size
    time.sleep(0.2)
    assert (tmp_path / "busy").stat().st_size == before  # what it had started is stopped, too


@pytest.mark.campaign
@sampled(1, "does", ["sleep 50", "yes"])
def test_a_program_that_talks_for_ever_or_never_is_left_out(
    does: str, built: Path, tmp_path: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    monkeypatch.setenv("HOLOKIN_CACHE", str(built))
    monkeypatch.setattr(toolchain, "ASKING", 1.5)
    monkeypatch.setenv("CC", script(tmp_path, f"#!/bin/sh\n{does}\n"))
    check(NATIVE, 1, caplog, holokin)


def test_a_compiler_that_is_gone_when_it_is_needed_is_no_fault(
    tmp_path: Path, monkeypatch: Patch, caplog: Logs, holokin: Command
) -> None:
    monkeypatch.setenv("CC", script(tmp_path, f'#!/bin/sh\nrm "$0"\n{SAYS}'))
    check(MACHINE, 1, caplog, holokin)


def test_a_source_that_alone_is_refused_leaves_the_others_native(caplog: Logs, monkeypatch: Patch) -> None:
    """An operation that the compiler does not know, as after an upgrade of CasADi: that function alone is slow."""
    x = symbol("x", 1)
    odd, sound = (Function("odd", {"x": x}, {"y": ca.sin(x) + k}) for k in (0.0, 1.0))
    with monkeypatch.context() as within:
        within.setitem(sys.modules["holokin.symbolic.native.emit"]._UNARY, ca.OP_SIN, "no_such_function_({})")
        assert np.abs(odd.batch(X[:, None]) - np.sin(X)).max() < 1e-15
    assert np.abs(sound.batch(X[:, None]) - np.sin(X) - 1).max() < 1e-15
    assert odd._natives["batch"] is None and sound._natives["batch"] is not None
    assert len(caplog.records) == 1


# --- Caches that are refused, full or poisoned: nothing foreign is loaded, and the numbers are the same.


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
