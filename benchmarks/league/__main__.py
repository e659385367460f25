"""Which libraries give the same joints at the same pose? The league: writes docs/league.md and docs/league.png.

    python -m benchmarks.league --only pink placo --out /somewhere
    python -m benchmarks.league --environments /a/folder

Every library is installed into an environment of its own (venv and pip), gets the robots and the paths as files, and
gives its joints back. The same measure is taken of all. What cannot be installed or run is named with the reason.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.league.courses import CYCLES, DT, robot_of, write_course
from benchmarks.league.environments import NoEnvironment, default_folder, python_of, reason_of
from benchmarks.league.league_entries import ENTRIES, OURS, Entry
from benchmarks.league.scores import Score, score

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Played:
    """What one library did, or why it did not."""

    entry: Entry
    versions: dict[str, str] = field(default_factory=dict)
    scores: tuple[Score, ...] = ()
    pinv_us: float = float("nan")
    left_out: str = ""


def play(entry: Entry, course: Path, environments: Path) -> Played:
    """Run a library's script in its environment, and measure its answers."""
    try:
        python = python_of(entry, environments)
    except NoEnvironment as problem:
        return Played(entry, left_out=f"it cannot be installed: {problem}")
    with tempfile.TemporaryDirectory() as folder:
        command, late = [str(python), str(entry.script), str(course), folder], ""
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=entry.seconds, check=False)
            late = "" if done.returncode == 0 else reason_of(done.stderr)
        except subprocess.TimeoutExpired:
            late = f"it took more than {entry.seconds:g} s"
        return measured(entry, course, Path(folder), late)


def measured(entry: Entry, course: Path, answers: Path, late: str = "") -> Played:
    """The scores of what a worker left in its folder."""
    if not (answers / "answer.json").exists():
        return Played(entry, left_out=late or "it gave no answer")
    said = json.loads((answers / "answer.json").read_text("utf-8"))
    robots, runs = {}, {}
    for arm in json.loads((course / "course.json").read_text("utf-8")):
        robots[arm["name"]], runs[arm["name"]] = robot_of(arm["name"]), {}
        with np.load(course / f"{arm['name']}.npz") as arrays:
            for key in arrays.files:
                run, _, what = key.rpartition("/")
                runs[arm["name"]].setdefault(run, {})[what] = arrays[key]
    found = []
    for told in said["settings"]:
        with np.load(answers / told["file"]) as joints:
            found.append(score(told, entry.name, robots[told["arm"]], runs[told["arm"]], dict(joints)))
    pinv = min((told.get("pinv_us", np.inf) for told in said["settings"]), default=np.nan)
    return Played(entry, said["versions"], tuple(found), pinv, late)


def main(arguments: list[str] | None = None) -> int:
    """Run, write, and say where."""
    from benchmarks.league.league_page import league_text

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="holokin alone, two cycles, steps of 0.05 s")
    parser.add_argument("--only", nargs="+", metavar="LIBRARY", help="of " + ", ".join(e.name for e in ENTRIES))
    parser.add_argument("--environments", type=Path, default=default_folder(), help="folder of the environments")
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="folder of league.md and league.png")
    given = parser.parse_args(arguments)
    wanted = {OURS.name} if given.quick else set(given.only or [e.name for e in ENTRIES])
    unknown = wanted - {e.name for e in ENTRIES}
    if unknown:
        parser.error(f"no library is called {', '.join(sorted(unknown))}: choose of {', '.join(e.name for e in ENTRIES)}")
    with tempfile.TemporaryDirectory() as folder:
        course = Path(folder)
        write_course(course, cycles=2 if given.quick else CYCLES, dt=0.05 if given.quick else DT)
        found = []
        for entry in ENTRIES:
            if entry.name in wanted:
                print(f"{entry.name} ...", flush=True)
                found.append(play(entry, course, given.environments))
                print(f"  {found[-1].left_out or f'{len(found[-1].scores)} answers'}", flush=True)
    given.out.mkdir(parents=True, exist_ok=True)
    (given.out / "league.md").write_text(league_text(found), "utf-8")
    print(f"wrote {given.out / 'league.md'}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
