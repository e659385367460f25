"""How does a step grow with the joints? Part of `python -m benchmarks.speed`, or by itself:

    python -m benchmarks.growth

Planar arms of n equal links with n - 2 dense linear constraint rows, and two Pandas from hand to hand, 14 joints. Below
`linear.DENSE_FROM` the linear system is written out, from there on it is left to a dense factorisation.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import holokin as hk
from holokin.robot import to_urdf
from holokin.symbolic import linear

START = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
SIZES = (3, 5, 7, 10, 14, 20, 30, 40, 50, 60)
CROSSING = (5, 7, 9, 10, 12, 14)

Clock = Callable[[Callable[[], object], int, int], tuple[float, float]]
"""(call, rounds, calls a round) -> median and 99th percentile [s]."""


@dataclass(frozen=True)
class Growth:
    """One row: how the system is solved, operations, seconds to build, and of a step from Python (native, not)."""

    name: str
    joints: int
    way: str
    operations: int
    build: float
    native: float
    machine: float


@contextmanager
def environment(**values: str) -> Iterator[None]:
    """Environment variables for a while."""
    before = {key: os.environ.get(key) for key in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for key, value in before.items():
            os.environ.pop(key, None) if value is None else os.environ.__setitem__(key, value)


def planar(n: int) -> hk.Robot:
    """An arm of n links, 1 m long in all."""
    return hk.from_dh([{"a": 1.0 / n} for _ in range(n)], name=f"planar {n}R")


def two_pandas() -> hk.Robot:
    """Two Pandas side by side, 0.8 m apart, as one chain of 14 joints from the left hand to the right one."""
    panda = hk.load("panda")
    both = ET.Element("robot", name="two Pandas, hand to hand")
    ET.SubElement(both, "link", name="table")
    for side, y in (("left", 0.4), ("right", -0.4)):
        mount = ET.SubElement(both, "joint", name=f"{side}_mount", type="fixed")
        ET.SubElement(mount, "parent", link="table")
        ET.SubElement(mount, "child", link=f"{side}_base")
        ET.SubElement(mount, "origin", xyz=f"0 {y} 0", rpy="0 0 0")
        for element in ET.fromstring(to_urdf(panda)):
            element.set("name", f"{side}_{element.get('name')}")
            for end in (*element.findall("parent"), *element.findall("child")):
                end.set("link", f"{side}_{end.get('link')}")
            both.append(element)
    tip = panda.tips[0].name
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "two-pandas.urdf"
        file.write_bytes(ET.tostring(both))
        return hk.from_urdf(file, base=f"left_{tip}", tip=f"right_{tip}")


def grown(task: hk.Task, q0: np.ndarray, clock: Clock) -> Growth:
    """The row of a task whose redundant joints are held by dense rows."""
    rows = np.random.default_rng(0).normal(size=(task.n - task.m, task.n))
    pose = task.robot.pose(q0)
    target = pose if task.orientation else pose[:3, 3].copy()
    twist = np.full(6 if task.orientation else 3, 0.01)
    build, times, operations = [], [], 0
    with tempfile.TemporaryDirectory() as folder:
        for flag in ("1", "0"):
            with environment(HOLOKIN_CACHE=folder, HOLOKIN_NATIVE=flag):
                hk.controller(hk.moore_penrose(hk.position(planar(2))), dt=1e-3)  # builds what all steps share
                begin = time.perf_counter()
                servo = hk.controller(hk.holonomic(task, hk.linear(rows)), dt=1e-3, q0=q0)
                build.append(time.perf_counter() - begin)
                operations = servo.generated[0].instructions
                times.append(clock(lambda servo=servo: servo.step(q0, target, twist), 60, 100)[0])
    way = "numbers" if task.n >= linear.DENSE_FROM else "written out"
    return Growth(task.robot.name, task.n, way, operations, build[0], *times)


def growth(clock: Clock, quick: bool) -> tuple[list[Growth], list[Growth]]:
    """(rows as they are, rows of sizes around the crossing both ways)."""

    def row(n: int) -> Growth:
        q0 = np.random.default_rng(n).uniform(-1, 1, n) * 3 / np.sqrt(n)
        return grown(hk.position(planar(n)), q0, clock)

    rows = [row(n) for n in (SIZES[:1] if quick else SIZES)]
    if not quick:
        rows.append(grown(hk.pose(two_pandas()), np.concatenate([START[::-1], START]), clock))
    both, usual = [], linear.DENSE_FROM
    try:
        for n in CROSSING[:1] if quick else CROSSING:
            for linear.DENSE_FROM in (n + 1, 0):
                both.append(row(n))
    finally:
        linear.DENSE_FROM = usual
    return rows, both


def growth_page(rows: list[Growth], both: list[Growth]) -> list[str]:
    """Lines of docs/speed.md."""
    head = ["| robot | joints | system | operations | build | step, native | step, virtual machine |"]
    head.append("|---|---:|---|---:|---:|---:|---:|")

    def lines(some: list[Growth]) -> list[str]:
        return [
            f"| {g.name} | {g.joints} | {g.way} | {g.operations:,} | {g.build:.2f} s | {1e6 * g.native:.3g} us | "
            f"{1e6 * g.machine:.3g} us |"
            for g in some
        ]

    return [
        "\n## Growth\n",
        "Planar arms hold n - 2 dense linear rows, the two Pandas eight. Build: expressions, C, compiler and loading",
        "of a new strategy. A step is called from Python, with feedback and limits.\n",
        *head, *lines(rows),
        f"\nFrom {linear.DENSE_FROM} joints on the linear system is left to a dense factorisation in C, or to LAPACK",
        "without a compiler. Both ways, around the crossing:\n",
        *head, *lines(both),
    ]  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    """Print its part of docs/speed.md."""
    from benchmarks.speed import median_and_p99

    parser = argparse.ArgumentParser(prog="python -m benchmarks.growth", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the smallest arms")
    print("\n".join(growth_page(*growth(median_and_p99, parser.parse_args(arguments).quick))))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
