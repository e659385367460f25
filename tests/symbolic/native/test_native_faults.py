"""Compilers that are broken: another one is taken, or the virtual machine runs, with the same numbers."""

from __future__ import annotations

import shutil
import sys
import time
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from conftest import Command, sampled
from faults import MACHINE, NATIVE, X, built, check, fresh, needs_compiler
from holokin.symbolic import Function, symbol
from holokin.symbolic.native import toolchain
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
