"""An export over an older one: all files or none; killed midway, what is mixed does not compile."""

from __future__ import annotations

import errno
import os
import subprocess
from pathlib import Path

import pytest
from benchmarks.kills import deadly, hidden

import holokin as hk
from conftest import PPR_START, sampled
from holokin.base.errors import WriteError
from holokin.export import Program, export_c
from holokin.symbolic.native import compiler

STRATEGY = hk.moore_penrose(hk.position(hk.load("ppr")))
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


def export(folder: Path, dt: float) -> dict[str, str]:
    export_c(STRATEGY, folder, q0=PPR_START, name="law", vectors_count=2, dt=dt)
    return texts(folder)


def texts(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in folder.iterdir() if file.is_file()}


def refusal(folder: Path) -> str:
    """What the compiler says against the files of a folder; nothing if it takes them."""
    chosen = compiler()
    assert chosen is not None
    files = [str(folder / f"law{part}.c") for part in ("", "_selftest")]
    done = subprocess.run(
        [*chosen.command, "-std=c99", "-fsyntax-only", *files], capture_output=True, text=True, timeout=60
    )
    return done.stderr if done.returncode else ""


@needs_compiler
def test_files_of_two_exports_do_not_compile_together(tmp_path: Path) -> None:
    one, two = export(tmp_path / "a", 0.001), export(tmp_path / "b", 0.002)
    assert refusal(tmp_path / "a") == refusal(tmp_path / "b") == ""
    for name in ("law.h", "law.c", "law_vectors.h", "law_selftest.c"):
        (tmp_path / "a" / name).write_text(two[name])
        assert "of different exports" in refusal(tmp_path / "a")
        (tmp_path / "a" / name).write_text(one[name])


@pytest.mark.campaign
@needs_compiler
@sampled(1, "after", [False, True])
def test_an_export_killed_at_any_rename_is_old_or_new_or_does_not_compile(tmp_path: Path, after: bool) -> None:
    new = export(tmp_path / "new", 0.002)
    folder, mixed = tmp_path / "out", 0
    old = export(folder, 0.001)
    for k in range(1, 30):
        child = os.fork()
        if child == 0:
            deadly(k, after)
            try:
                export(folder, 0.002)
            finally:
                os._exit(0)
        if os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0:
            break
        code = {name: text for name, text in texts(folder).items() if name.endswith((".c", ".h"))}
        if not (code.items() <= old.items() or code.items() <= new.items()):
            mixed += 1
            assert "of different exports" in refusal(folder)
        assert export(folder, 0.001) == old
        assert hidden(folder) == []
    assert k == 8  # seven files
    assert mixed == 4  # of the five of C and C++
    assert texts(folder) == new


def test_an_export_that_is_refused_midway_leaves_the_old_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old, replace = export(tmp_path, 0.001), os.replace

    def refused(source: Path, target: Path) -> None:
        if Path(target).name == "law_selftest.c" and "new" in Path(source).parts:
            raise OSError(errno.ENOSPC, "No space left on device")
        replace(source, target)

    monkeypatch.setattr(os, "replace", refused)
    with pytest.raises(WriteError):
        export(tmp_path, 0.002)
    assert texts(tmp_path) == old
    assert hidden(tmp_path) == []


def test_a_program_of_two_files_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    """KRL has its points in a file beside the program: those of another program move the arm elsewhere."""
    Program({"p.src": "old moves", "p.dat": "old points"}, 1, 0.0).save(tmp_path)
    before, replace = os.replace, []

    def refused(source: Path, target: Path) -> None:
        replace.append(target)
        if len(replace) == 2:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        before(source, target)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", refused)
        with pytest.raises(WriteError):
            Program({"p.src": "new moves", "p.dat": "new points"}, 1, 0.0).save(tmp_path)
    assert texts(tmp_path) == {"p.src": "old moves", "p.dat": "old points"} and hidden(tmp_path) == []
