"""Kills the processes of a survey at random moments and compares its rows with those of an undisturbed run.

    python tests/survey_kills.py 50 FOLDER

A survey with a law that cannot be sent to other processes, so that coordinators and workers are forked from this
process, which has all that they need: a life costs milliseconds. Prints what was killed, and what was wrong.
"""

from __future__ import annotations

import json
import math
import os
import random
import signal
import sys
import time
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any

import holokin as hk
from holokin.app.survey import Store, run_survey, survey_of
from holokin.base.errors import FileError

LONGEST = 0.25
"""Seconds of a coordinator's life, at most."""

OBJECTS = {"law:pinv": lambda task: hk.moore_penrose(task)}

TABLE = survey_of(
    {
        "title": "planar arms", "robots": ["planar-3r"], "cycles": 2, "samples": 40,
        "loops": {"circle": {"kind": "circle", "size": (0.05, 0.3), "count": 60}},
        "laws": {"pinv": {"kind": "given", "key": "law:pinv"}, "lock": {"kind": "best-lock"}},
    },
    "planar.toml",
)  # fmt: skip


def rows_of(file: Path) -> list[dict[str, Any]]:
    """All rows but for the seconds they took."""
    with Store.opened(file, None) as store:
        return [{k: v for k, v in row.items() if k != "seconds"} for row in store.rows()]


def same(found: list[dict[str, Any]], expected: list[dict[str, Any]]) -> bool:
    """Row for row; numbers but for rounding: 1e-16 rad once, in a copy whose kills were not survived."""
    return len(found) == len(expected) and all(
        math.isclose(a[k], b[k], rel_tol=1e-9, abs_tol=1e-12) if isinstance(b[k], float) else a[k] == b[k]
        for a, b in zip(found, expected, strict=True)
        for k in b
    )


def count_of(file: Path) -> int:
    """Rows that were kept; none in a file that was not begun, or killed before its first write."""
    with suppress(FileError), Store.opened(file, None) as store:
        return len(store)
    return 0


def alive(pid: int) -> bool:
    """Whether a process is there, and is no zombie."""
    with suppress(OSError):
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def children(pid: int) -> list[int]:
    """The processes that the threads of a process began."""
    found: list[int] = []
    with suppress(OSError):
        for thread in Path(f"/proc/{pid}/task").iterdir():
            found += map(int, (thread / "children").read_text().split())
    return [child for child in found if alive(child)]


def begun(folder: Path, out: Path) -> int:
    """A coordinator with two workers; the id of its process."""
    pid = os.fork()
    if pid == 0:
        try:
            run_survey(TABLE, folder, out, workers=2, resume=True, objects=OBJECTS)
        except BaseException:  # noqa: BLE001  said, not raised into the process that was forked
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    return pid


def life(folder: Path, out: Path, chance: random.Random, killed: dict[str, int], wrong: list[str]) -> None:
    """A coordinator from its start to its end: one of its workers is killed, or it is, or both."""
    pid, kept = begun(folder, out), count_of(out)
    for who in chance.choice((["worker", "coordinator"], ["coordinator"], ["worker", "worker", "coordinator"])):
        while who == "worker" and alive(pid) and not children(pid):
            time.sleep(0.005)
        time.sleep(chance.uniform(0.0, LONGEST))
        there = children(pid)
        ended, status = os.waitpid(pid, os.WNOHANG)
        if ended:
            if status:
                wrong.append(f"the coordinator ended with {status}")
            return
        if who == "worker" and there:
            os.kill(chance.choice(there), signal.SIGKILL)
            killed["worker"] += 1
        elif who == "coordinator":
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            killed["coordinator"] += 1
            until = time.monotonic() + 10.0
            while any(map(alive, there)) and time.monotonic() < until:
                time.sleep(0.005)
            if any(map(alive, there)):
                wrong.append("a worker outlives its coordinator")
            if count_of(out) < kept:
                wrong.append(f"{kept} rows became {count_of(out)}")


def main(kills: int, folder: Path, seed: int = 3) -> int:
    """Surveys one after the other, until so many processes were killed, and the last one is done."""
    whole, out = folder / "whole.sqlite", folder / "killed.sqlite"
    run_survey(TABLE, folder, whole, workers=0, objects=OBJECTS)
    expected, chance = rows_of(whole), random.Random(seed)
    killed, wrong, compared = {"coordinator": 0, "worker": 0}, [], 0
    while sum(killed.values()) < kills:
        life(folder, out, chance, killed, wrong)
        if count_of(out) == len(expected) or sum(killed.values()) >= kills:
            run_survey(TABLE, folder, out, workers=2, resume=True, objects=OBJECTS)
            compared += 1
            found = rows_of(out)
            if not same(found, expected):
                wrong.append(f"rows differ: {len(found)}, {[row for row in found if row not in expected][:3]}")
            for file in folder.glob("killed.sqlite*"):
                file.unlink()
    print(json.dumps({"killed": killed, "wrong": wrong, "rows": len(expected), "compared": compared}))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:])))
