"""Who takes part in the league, an environment for each library, and the scores of what it answers there."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import venv
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.league.courses import STARTS, robot_of
from benchmarks.league.scores import Score, rested, score

WORKERS = Path(__file__).parent / "workers"


@dataclass(frozen=True)
class Entry:
    """A library: its name in `workers/libraries.py`, what pip installs into its environment.

    packages: none for the environment of the league itself.
    seconds: how long all its runs may take; on a free machine they take some minutes at most.
    """

    name: str
    packages: tuple[str, ...]
    script: Path = WORKERS / "libraries.py"
    seconds: float = 1800.0


OURS = Entry("holokin", ())
ENTRIES = (
    OURS,
    Entry("pink", ("pin-pink", "daqp")),
    Entry("mink", ("mink", "daqp")),
    Entry("mink-warp", ("mink-warp",)),
    Entry("placo", ("placo",)),
    Entry("OInK", ("roboplan-oink", "pin")),
    Entry("embodik", ("embodik",)),
    Entry("Drake", ("drake",)),
    Entry("pyroboplan", ("pyroboplan",)),
    Entry("PyRoki", ("almond-pyroki",)),
    Entry("newton", ("newton",)),
    Entry("ssik", ("ssik[urdf]",)),
    Entry("frankik", ("frankik",)),
    Entry("TRAC-IK", ("pytracik",)),
    Entry("roboticstoolbox", ("roboticstoolbox-python",)),
)


# --- An environment for each library: made once with `venv` and pip, kept until its packages change.


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


# --- Running one library: its environment, its script, and the scores of its answers.


@dataclass(frozen=True)
class Played:
    """What one library did, or why it did not."""

    entry: Entry
    versions: dict[str, str] = field(default_factory=dict)
    scores: tuple[Score, ...] = ()
    left_out: str = ""


def play(entry: Entry, course: Path, environments: Path, answers: Path) -> Played:
    """Run a library's script in its environment, unless its answers are there, and measure them."""
    done = answers / "done.txt"
    if not done.exists():
        answers.mkdir(parents=True, exist_ok=True)
        try:
            late = _asked(entry, course, python_of(entry, environments), answers)
        except NoEnvironment as problem:
            late = f"it cannot be installed: {problem}"
        done.write_text(late, "utf-8")
    return measured(entry, course, answers, done.read_text("utf-8"))


def _asked(entry: Entry, course: Path, python: Path, answers: Path) -> str:
    """Run a script. Returns: why it did not come to its end, or nothing."""
    command = [str(python), str(entry.script), str(course), str(answers), entry.name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=entry.seconds, check=False)
    except subprocess.TimeoutExpired:
        return f"its runs took more than {entry.seconds:g} s together, and were stopped there"
    return reason_of(done.stderr) if done.returncode else ""


def measured(entry: Entry, course: Path, answers: Path, late: str = "") -> Played:
    """The scores of what a worker left in its folder."""
    if not (answers / "answer.json").exists():
        return Played(entry, left_out=late or "it gave no answer")
    said = json.loads((answers / "answer.json").read_text("utf-8"))
    arms = {
        arm["name"]: runs_of(course, arm["name"]) for arm in json.loads((course / "course.json").read_text("utf-8"))
    }
    robots, found = {name: robot_of(name) for name in arms}, []
    rest = {name: rested(robots[name], STARTS[name], arms[name]["circle"]["poses"]) for name in arms}
    for told in said["settings"]:
        with np.load(answers / told["file"]) as joints:
            of = told["arm"]
            found.append(score(told, entry.name, robots[of], arms[of], dict(joints), rest[of]))
    return Played(entry, said["versions"], tuple(found), late)


def runs_of(course: Path, arm: str) -> dict[str, dict[str, Any]]:
    """Of each run of an arm the poses, twists and times."""
    runs: dict[str, dict[str, Any]] = {}
    with np.load(course / f"{arm}.npz") as arrays:
        for key in arrays.files:
            run, _, what = key.rpartition("/")
            runs.setdefault(run, {})[what] = arrays[key]
    del runs["check"]
    return runs
