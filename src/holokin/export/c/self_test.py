"""The self-test of exported C, built and run here."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from ...base.errors import ExportError
from ...symbolic.native import compiler
from .c_folder import Exported

WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
PATIENCE = 300.0
"""Seconds for each of compiler and test."""


def check(exported: Exported) -> list[str]:
    """Build and run the self-test in double and in single precision; returns what each says.

    Flags for the compiler in CFLAGS of the environment come last, as with make.

    Raises:
        ExportError: no compiler, it refuses the code, or a test fails.
    """
    chosen = compiler()
    if chosen is None:
        raise ExportError("no C compiler was found, so the self-test was not run", "build it where there is one")
    said = []
    sources = [str(exported.folder / f"{exported.name}.c"), str(exported.folder / f"{exported.name}_selftest.c")]
    with tempfile.TemporaryDirectory() as folder:
        for precision, defined in (("double", ()), ("float", (f"-D{exported.name.upper()}_FLOAT",))):
            test = str(Path(folder) / f"selftest-{precision}{'.exe' if sys.platform == 'win32' else ''}")
            flags = ["-std=c99", "-O1", *WARNINGS, *os.environ.get("CFLAGS", "").split()]
            command = [*chosen.command, *flags, *defined, *sources, "-o", test, "-lm"]
            _run(command, f"{chosen.version} refused the exported code in {precision}")
            said.append(_run([test], f"the self-test in {precision} failed").strip())
    return said


def _run(command: list[str], fault: str) -> str:
    try:
        done = subprocess.run(
            command, capture_output=True, encoding="utf-8", errors="replace", timeout=PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise ExportError(f"{fault} ({problem})", "please report it") from problem
    if done.returncode != 0:
        lines = (done.stderr + done.stdout).strip().splitlines()
        complaint = next((line for line in lines if "error" in line), lines[0] if lines else f"code {done.returncode}")
        raise ExportError(f"{fault} ({complaint.strip()})", "do not use it; please report it, with the job")
    return done.stdout
