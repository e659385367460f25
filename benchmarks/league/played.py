"""Running one library: its environment, its script, and the scores of its answers."""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import drift
from benchmarks.league.courses import robot_of
from benchmarks.league.environments import NoEnvironment, python_of, reason_of
from benchmarks.league.league_entries import Entry
from benchmarks.league.scores import Score, rested, score


@dataclass(frozen=True)
class Played:
    """What one library did, or why it did not. pinv_us: what NumPy's pinv took in its environment."""

    entry: Entry
    versions: dict[str, str] = field(default_factory=dict)
    scores: tuple[Score, ...] = ()
    pinv_us: float = float("nan")
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
    rest = {name: rested(robots[name], drift.STARTS[name], arms[name]["circle"]["poses"]) for name in arms}
    for told in said["settings"]:
        with np.load(answers / told["file"]) as joints:
            of = told["arm"]
            found.append(score(told, entry.name, robots[of], arms[of], dict(joints), rest[of]))
    pinv = min((told["pinv_us"] for told in said["settings"] if not told["fault"]), default=np.nan)
    return Played(entry, said["versions"], tuple(found), pinv, late)


def runs_of(course: Path, arm: str) -> dict[str, dict[str, Any]]:
    """Of each run of an arm the poses, twists and times."""
    runs: dict[str, dict[str, Any]] = {}
    with np.load(course / f"{arm}.npz") as arrays:
        for key in arrays.files:
            run, _, what = key.rpartition("/")
            runs.setdefault(run, {})[what] = arrays[key]
    del runs["check"]
    return runs
