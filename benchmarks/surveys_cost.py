"""What does one case of a survey cost, and where does the time go?

    python -m benchmarks.surveys_cost

Ten laws on three robots round many circles, in this process, so that the processor's time can be told apart: the first
case of each robot and law (all that is built, compilers included), and the stages of the others.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import holokin as hk
from holokin.analysis.coverage import locked_joints
from holokin.app.survey import survey_of
from holokin.app.survey.cases import Case, Cases
from holokin.app.survey.one_case import prepare, run_case
from holokin.app.survey.survey_file import keep

ROBOTS = ("panda", "iiwa14", "ur5e")
CIRCLES = {"circle": {"kind": "circle", "size": [0.05, 0.3], "count": 100}}
STAGES = {"start_of": "draw", "_path": "draw", "_set_up": "law", "_run": "follow", "_metrics": "metrics"}
"""Functions of `holokin.app.survey.one_case`, and the stages that they are."""


def weighted(task: hk.Task) -> hk.Strategy:
    """Joints near the base are dear."""
    return hk.weighted(task, np.diag(np.linspace(3, 1, task.n)))


def linear(task: hk.Task, start: np.ndarray) -> hk.Strategy:
    """Each joint that the best lock would hold goes with the next one."""
    A = np.zeros((task.n - task.m, task.n))
    for row, joint in zip(A, locked_joints(task, start), strict=True):
        row[joint], row[(joint + 1) % task.n] = 1.0, 0.3
    return hk.holonomic(task, hk.linear(A))


def arm_angle(task: hk.Task) -> hk.Strategy:
    """The arm angle, and the wrist locked; a UR5e has none, which its rows say."""
    wrist = range(task.m + 1, task.n)
    return hk.holonomic(task, hk.strategies.constraints.stack(hk.arm_angle(), hk.lock(*wrist)))


def centring(task: hk.Task, start: np.ndarray) -> hk.Strategy:
    """Stationary distance of the joints from their middles."""
    cost = hk.strategies.constraints.centring_cost()
    return hk.holonomic(task, hk.stationary(cost, free=tuple(locked_joints(task, start))))


LAWS: dict[str, Any] = {
    "pseudo-inverse": {"kind": "moore-penrose"}, "weighted": weighted, "best lock": {"kind": "best-lock"},
    "linear": linear, "arm angle": arm_angle, "centring": centring, "radial": {"kind": "radial"},
    "damped": {"kind": "damped"}, "gradient projection": {"kind": "gradient-projection"},
    "closed loop": {"kind": "closed-loop", "of": "pseudo-inverse"},
}  # fmt: skip


def processor() -> float:
    """Seconds of the processor, those of compilers that have ended included."""
    used = os.times()
    return time.process_time() + used.children_user + used.children_system


@contextmanager
def staged(spent: dict[str, float]) -> Iterator[None]:
    """Adds up the processor's seconds of each stage; building a law is no part of what is drawn for it."""

    def timed(function: Callable[..., Any], stage: str) -> Callable[..., Any]:
        def called(*arguments: Any, **named: Any) -> Any:
            began, inside = processor(), sum(spent.values())
            try:
                return function(*arguments, **named)
            finally:
                spent[stage] += processor() - began - (sum(spent.values()) - inside)

        return called

    import holokin.app.survey.one_case as running

    names = {name: timed(getattr(running, name), stage) for name, stage in STAGES.items()}
    with patch.multiple(running, **names):
        yield


def costs(circles: int, robots: tuple[str, ...]) -> tuple[dict[tuple[str, str], list[float]], dict[str, float]]:
    """((robot, law) -> seconds of the set-up, then of each case), (stage -> seconds of all cases)."""
    own = {f"law:{name}": law for name, law in LAWS.items() if callable(law)}
    laws = {name: {"kind": "given", "key": f"law:{name}"} if callable(law) else law for name, law in LAWS.items()}
    loops = {"circle": CIRCLES["circle"] | {"count": circles}}
    asked = {"title": "cost of a case", "robots": list(robots), "laws": laws, "loops": loops}
    cases = Cases(survey_of(asked, "survey"), Path())
    keep(own)
    spent: dict[str, float] = defaultdict(float)
    found: dict[tuple[str, str], list[float]] = {}

    def seconds(of: Callable[[Case, Cases], object], case: Case) -> float:
        began = processor()
        of(case, cases)
        return processor() - began

    for case in cases:
        key = case.names["robot"], case.law
        if key not in found:
            found[key] = [seconds(prepare, case)]
        with staged(spent):
            found[key].append(seconds(run_case, case))
    return found, spent


def survey(circles: int, workers: int) -> tuple[int, float]:
    """(cases, seconds by the clock) of all of it by `hk.survey`."""
    began = time.perf_counter()
    found = hk.survey(ROBOTS, LAWS, {"circle": CIRCLES["circle"] | {"count": circles}}, workers=workers)
    return len(found), time.perf_counter() - began


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one robot, one circle")
    parser.add_argument("--circles", type=int, default=10, help="of each robot and law in the tables (%(default)s)")
    parser.add_argument("--survey", type=int, default=0, help="then a survey of so many circles, by the clock")
    given = parser.parse_args()
    robots = ("ur5e",) if given.quick else ROBOTS
    found, spent = costs(1 if given.quick else given.circles, robots)
    print("seconds of the processor: set-up [s], then a case [ms]")
    print(f"{'':20}" + "".join(f"{robot:>18}" for robot in robots))
    for law in LAWS:
        cells = ((found[robot, law][0], 1e3 * float(np.mean(found[robot, law][1:]))) for robot in robots)
        print(f"{law:20}" + "".join(f"{first:9.2f} {mean:8.1f}" for first, mean in cells))
    each = [seconds for row in found.values() for seconds in row[1:]]
    print(f"all: {sum(row[0] for row in found.values()):.1f} s of set-up, {1e3 * float(np.mean(each)):.1f} ms a case")
    total = sum(spent.values())
    print("stages: " + ", ".join(f"{stage} {spent[stage] / total:.0%}" for stage in dict.fromkeys(STAGES.values())))
    if given.survey:
        workers = os.cpu_count() or 1
        count, seconds = survey(given.survey, workers)
        print(f"hk.survey with {workers} workers: {count:,} cases in {seconds:.0f} s by the clock")


if __name__ == "__main__":
    main()
