"""An environment for each library: made once with `venv` and pip, kept until its packages change."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

from benchmarks.league.league_entries import Entry

SECONDS = 600.0
"""How long pip may take."""

MARK = "packages-of-the-league.txt"


class NoEnvironment(Exception):
    """A library cannot be installed: the message says why in one line."""


def default_folder() -> Path:
    """Where environments are kept if the user names no folder."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "holokin" / "league"


def python_of(entry: Entry, folder: Path) -> Path:
    """The interpreter that runs an entry; its environment is made if there is none with these packages.

    Raises:
        NoEnvironment: pip could not install them.
    """
    if not entry.packages:
        return Path(sys.executable)
    home = folder / entry.name.replace(" ", "-").lower()
    python = home / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    mark, wanted = home / MARK, "\n".join(entry.packages)
    if mark.exists() and mark.read_text("utf-8") == wanted:
        return python
    if home.exists() and not mark.exists() and any(home.iterdir()) and not (home / "pyvenv.cfg").exists():
        raise NoEnvironment(f"{home} is there and is no environment: name another folder with --environments")
    shutil.rmtree(home, ignore_errors=True)
    venv.create(home, with_pip=True)
    command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *entry.packages]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired as problem:
        raise NoEnvironment(f"pip took more than {SECONDS:g} s") from problem
    if done.returncode:
        raise NoEnvironment(reason_of(done.stderr))
    mark.write_text(wanted, "utf-8")
    return python


def reason_of(said: str) -> str:
    """The line of an error message that says what went wrong."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    wrong = [line for line in lines if line.lower().startswith("error")]
    return (wrong or lines or ["it said nothing"])[-1].removeprefix("ERROR: ")[:200]
