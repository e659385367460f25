"""How many laws the studio moves at 30 frames a second, and how soon a dragged tool is answered: a Panda, in memory.

python -m benchmarks.studio [--quick]

A session of the studio without its page: on a loop every law makes its steps, and a snapshot of all that is drawn is
made, for each frame; on a drag every law follows the tool by 2 mm, and out of reach none can. Processor time of the
thread, so that what else the machine does counts little; medians, and the worst.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

import holokin as hk
from holokin.studios import Law, Phase, Session, circle_loop, default_laws

START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
RATE = 30.0
"""Frames a second."""

STEP = 0.002
"""The tool's way from one drag to the next [m]: 0.12 m/s with a mouse that tells 60 times a second."""


def session(count: int) -> Session:
    """So many laws of a Panda, the default ones again and again, on a circle of 0.1 m."""
    robot = hk.load("panda")
    task, tool = hk.pose(robot), robot.pose(START)[:3, 3]
    kinds = default_laws(task, START)
    laws = [Law(f"{kinds[i % len(kinds)].name} {i}", i, kinds[i % len(kinds)].rule, task) for i in range(count)]
    return Session(laws, START, circle_loop(tool - [0.1, 0, 0], 0.1, near=tool))


def milliseconds(call: Callable[[], object]) -> float:
    """Processor time of a call."""
    began = time.thread_time()
    call()
    return 1e3 * (time.thread_time() - began)


def frames(subject: Session, count: int) -> list[float]:
    """Milliseconds of each frame of a loop that runs, once all laws are compiled."""
    while subject.play().phase is Phase.GATHERING:
        subject.advance(1 / RATE)
    return [milliseconds(lambda: subject.advance(1 / RATE)) for _ in range(count)]


def drags(subject: Session, count: int, *, out: bool = False) -> list[float]:
    """Milliseconds of drags round a circle of the tool; or out of reach, each a little farther than the last."""
    pose = subject.reset().target[0].copy()
    found = []
    for k in range(count):
        if out:
            pose[0, 3] += 0.5 if k == 0 else STEP
        else:
            pose[:2, 3] += STEP * np.array([np.cos(k / 20), np.sin(k / 20)])
        found.append(milliseconds(lambda: subject.drag(pose)))
    return found


def main(arguments: list[str] | None = None) -> int:
    """Print a table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studio", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few laws, frames and drags")
    quick = parser.parse_args(arguments).quick
    sizes, count = ((4,), 4) if quick else ((1, 4, 8, 60), 300)
    print(f"{'':6}{'a frame of the loop [ms]':>28}{'updates':>10}{'a drag [ms]':>18}{'out of reach [ms]':>20}")
    print(f"{'laws':6}{'median':>14}{'worst':>14}{'a second':>10}{'median':>9}{'worst':>9}{'median':>10}{'worst':>10}")
    for size in sizes:
        subject = session(size)
        subject.start_work()
        while not quick and not all(state.judgement for state in subject.snapshot().laws):
            time.sleep(0.1)  # all are compiled
        subject.close()
        loop, drag = frames(subject, count), drags(subject, count)
        away = drags(subject, 2 if quick else 30, out=True)
        numbers = f"{np.median(loop):14.2f}{max(loop):14.2f}{1e3 / np.median(loop):10.0f}"
        print(f"{size:<6}{numbers}{np.median(drag):9.2f}{max(drag):9.2f}{np.median(away):10.1f}{max(away):10.1f}")
    print("\nprocessor time of one thread; a drag moves the tool by 2 mm")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
