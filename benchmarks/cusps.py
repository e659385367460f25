"""Cusps over the catalogue: `python -m benchmarks.cusps [ROWS]` asks `hk.cusps` of every arm with joints to spare.

Each row of the file is one arm with one law at the level of one posture, in JSON. A second run asks only what is
missing, so that the run may be stopped at any time. `python docs/cusps_page.py` writes the page of it.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from itertools import combinations
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

import holokin as hk
from holokin.analysis.coverage.starts import regular_starts
from holokin.base.errors import HolokinError

STARTS = 1000
"""Starts of each search."""


@dataclass(frozen=True)
class Question:
    """An arm with a law: `lock`, joints; `sum` or `difference` of two; `arm angle`; or `none`, where n = m."""

    arm: str
    law: str
    joints: tuple[int, ...] = ()

    def strategy(self) -> hk.Strategy:
        """The strategy of a pose task."""
        task = hk.pose(hk.load(self.arm))
        if self.law == "none":
            return hk.moore_penrose(task)
        if self.law == "lock":
            return hk.holonomic(task, hk.lock(*self.joints))
        if self.law == "arm angle":
            return hk.holonomic(task, hk.arm_angle())
        row, (i, j) = np.zeros(task.n), self.joints
        row[i], row[j] = 1.0, 1.0 if self.law == "sum" else -1.0
        return hk.holonomic(task, hk.linear(row))


def questions() -> Iterator[Question]:
    """All of them: with one joint to spare every lock, the arm angle, all sums and differences; else all locks."""
    for arm in hk.robot.catalogue():
        robot = hk.load(arm)
        if robot.n < 6 or robot.planar or robot.n > 10:  # two arms of seven are asked one by one
            continue
        if robot.n == 6:
            yield Question(arm, "none")
        for joints in combinations(range(robot.n), robot.n - 6) if robot.n > 6 else ():
            yield Question(arm, "lock", joints)
        if robot.n == 7:
            yield Question(arm, "arm angle")
            for pair in combinations(range(7), 2):
                yield from (Question(arm, law, pair) for law in ("sum", "difference"))


def asked(question: Question, starts: int = STARTS) -> dict[str, Any]:
    """What `hk.cusps` says, or why it says nothing."""
    began = time.perf_counter()
    row: dict[str, Any] = {**asdict(question), "joints": list(question.joints), "version": hk.__version__}
    try:
        strategy = question.strategy()
        q0 = next((q for q in regular_starts(strategy.task) if _regular(strategy, q)), None)
        if q0 is None:
            return row | {"problem": "no posture is regular"}
        found = hk.cusps(strategy, q0, starts=starts)
        row |= {"q0": q0.tolist(), "cusps": len(found), "outside": found.outside, "double": found.double}
        if len(found):
            row |= {"joints_away": float(found.joints_away.min()), "tool_away": float(found.tool_away.min())}
        for name, one in (("smallest", found.witness), ("most_regular", found.most_regular)):
            if one is not None:
                facts = ("length", "turn", "apart", "rcond", "margin")
                row[name] = {fact: float(getattr(one, fact)) for fact in facts} | {"first": one.first.tolist()}
    except HolokinError as problem:
        row["problem"] = f"{type(problem).__name__}: {problem}"
    return row | {"seconds": round(time.perf_counter() - began, 2)}


def _regular(strategy: hk.Strategy, q: np.ndarray) -> bool:
    """Whether a posture is no singular one of the law."""
    try:
        strategy(q)
    except HolokinError as problem:
        if not isinstance(problem, hk.base.errors.SingularityError):
            raise
        return False
    return True


def rows(file: Path) -> list[dict[str, Any]]:
    """Those of a file."""
    return [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.is_file() else []


def main(arguments: list[str] | None = None) -> None:
    """Ask what is missing."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=Path, nargs="?", default=Path("out/cusps.jsonl"))
    parser.add_argument("--arms", nargs="*", help="only these")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="two questions with few starts, nothing is written")
    given = parser.parse_args(arguments)
    if given.quick:
        for question in (Question("ur5e", "none"), Question("xarm7", "lock", (2,))):
            print(told(asked(question, starts=60)))
        return
    given.rows.parent.mkdir(parents=True, exist_ok=True)
    known = {(row["arm"], row["law"], tuple(row["joints"])) for row in rows(given.rows)}
    left = [q for q in questions() if (q.arm, q.law, q.joints) not in known and q.arm in (given.arms or [q.arm])]
    print(f"{len(known)} are known, {len(left)} to ask", flush=True)
    with (
        ProcessPoolExecutor(given.workers, get_context("spawn")) as pool,
        given.rows.open("a", encoding="utf-8") as out,
    ):
        futures = [pool.submit(asked, question) for question in left]
        try:
            for future in as_completed(futures):
                row = future.result()
                out.write(json.dumps(row) + "\n")
                out.flush()
                print(told(row), flush=True)
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            print("stopped; the same command goes on")


def told(row: dict[str, Any]) -> str:
    """A row in a line."""
    found = row.get("problem") or f"{row['cusps']} cusps, {'a loop' if 'smallest' in row else 'no loop'} found"
    return f"{row['arm']}, {row['law']} {row['joints']}: {found}, {row.get('seconds', 0)} s"


if __name__ == "__main__":
    main()
