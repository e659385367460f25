"""Which arms and rules have loops that do not return the joints? `hk.cusps` over the catalogue: a section of
docs/measured.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import holokin as hk
from benchmarks.page import Given, table, versions, wrapped
from holokin.analysis.coverage.starts import regular_starts
from holokin.base.errors import HolokinError
from holokin.robot.closed_form import ArmClass, arm_class

STARTS = 1000
"""Starts of each search."""


NAMES = {
    "fr3": "Franka FR3", "gen3": "Kinova Gen3", "iiwa14": "KUKA iiwa 14", "iiwa7": "KUKA iiwa 7", "panda": "Panda",
    "rail-ur10e": "UR10e on a rail", "sawyer": "Sawyer", "xarm7": "xArm 7", "yumi-arm": "YuMi, one arm",
    "rizon4": "Rizon 4", "openarm-left": "OpenArm", "ur5e": "UR5e", "ur10e": "UR10e", "irb140": "ABB IRB 140",
}  # fmt: skip


@dataclass(frozen=True)
class Question:
    """An arm with a joint locked, with the arm angle, or with nothing, where it has six joints."""

    arm: str
    law: str
    joint: int = 0

    def strategy(self) -> hk.Strategy:
        """The strategy of a pose task."""
        task = hk.pose(hk.load(self.arm))
        if self.law == "none":
            return hk.moore_penrose(task)
        return hk.holonomic(task, hk.lock(self.joint) if self.law == "lock" else hk.arm_angle())


def questions() -> Iterator[Question]:
    """Those of the arms of six and seven joints of the catalogue; of mirrored arms the left one."""
    for arm in hk.robot.catalogue():
        robot = hk.load(arm)
        if robot.n not in (6, 7) or robot.planar or arm.endswith(("-right", "4s")):
            continue
        if robot.n == 6:
            yield Question(arm, "none")
            continue
        yield from (Question(arm, "lock", joint) for joint in range(7))
        yield Question(arm, "arm angle")


def asked(question: Question, starts: int = STARTS) -> dict[str, Any]:
    """What `hk.cusps` says, or why it says nothing."""
    row: dict[str, Any] = {"arm": question.arm, "law": question.law, "joint": question.joint}
    try:
        strategy = question.strategy()
        q0 = next((q for q in regular_starts(strategy.task) if _regular(strategy, q)), None)
        if q0 is None:
            return row | {"problem": "no posture is regular"}
        found = hk.cusps(strategy, q0, starts=starts)
        row["cusps"] = len(found)
        if found.witness is not None:
            row |= {"length": float(found.witness.length), "apart": float(found.witness.apart)}
    except HolokinError as problem:
        row["problem"] = f"{type(problem).__name__}: {problem}"
    return row


def _regular(strategy: hk.Strategy, q: np.ndarray) -> bool:
    """Whether a posture is no singular one of the law."""
    try:
        strategy(q)
    except HolokinError as problem:
        if not isinstance(problem, hk.base.errors.SingularityError):
            raise
        return False
    return True


def cell(row: dict[str, Any]) -> str:
    """What was found of one law."""
    if "problem" in row:
        return "-"
    if "length" in row:
        return f"**{100 * row['length']:.1f} cm**, {row['apart']:.2f}"
    if row["cusps"]:
        return f"{row['cusps']} cusps"
    held = {"lock": (row["joint"],), "none": ()}.get(row["law"])
    found = None if held is None else arm_class(hk.load(row["arm"]), held)
    return "proven none" if isinstance(found, ArmClass) and found.proven else "none"


def section(given: Given) -> tuple[list[str], str]:
    """Ask; the blocks of docs/measured.md, and the versions."""
    chosen, starts = list(questions()), STARTS
    if given.quick:
        chosen, starts = [Question("ur5e", "none"), Question("xarm7", "lock", 2)], 60
    found = []
    for question in chosen:
        found.append(asked(question, starts))
        print(f"{question.arm}, {question.law} {question.joint + 1}: {cell(found[-1])}", flush=True)
    return text(found, starts), versions("casadi", "numpy")


def text(found: list[dict[str, Any]], starts: int) -> list[str]:
    """The blocks, with all numbers."""
    seven = [row for row in found if row["law"] != "none"]
    arms = sorted({row["arm"] for row in seven}, key=lambda arm: NAMES.get(arm, arm).lower())
    sound = [row for row in seven if "problem" not in row]
    lengths = sorted(row["length"] for row in sound if "length" in row)
    cells = {(row["arm"], row["law"], row["joint"]): cell(row) for row in found}
    columns = [*(("lock", joint) for joint in range(7)), ("arm angle", 0)]
    rows = [[NAMES.get(arm, arm), *(cells.get((arm, *column), "-") for column in columns)] for arm in arms]
    six = ", ".join(f"{NAMES.get(r['arm'], r['arm'])} ({cell(r)})" for r in found if r["law"] == "none")
    without = sum(not row["cusps"] for row in sound)
    told = f"""The shortest loop is {100 * lengths[0]:.1f} cm long, the median of the shortest loops
        {100 * lengths[len(lengths) // 2]:.1f} cm.""" if lengths else ""  # fmt: skip
    return [
        "## Cusps",
        wrapped(
            f"""Which arms and rules have loops that do not return the joints, although no posture on them is singular?
            Around a [cusp](concepts.md#cusp) there are such loops, however small. `hk.cusps` was asked of every arm of
            the catalogue with seven joints, with each joint locked and with the arm angle, for the whole pose of the
            tool and the leaf of one posture well inside the limits; it begins from {starts:,} postures. A loop counts
            if `hk.follow` goes it to the other posture."""
        ),
        wrapped(
            f"""Of {len(sound)} rules {len(lengths)} have such a loop; for {without} no cusp was found. {told} A rule
            with cusps still returns the joints in a region around the start, [which can be proven](proof.md). "Proven
            none": with this joint held no leaf has a cusp, and every loop without a singular posture [returns the
            joints](proof.md#on-the-whole-arm). "None" alone is a search and no proof: rarer cusps may exist, other
            levels may have some, and a loop around a hole needs none. Sums of joints, `radial` strategies and
            stationary costs were not asked."""
        ),
        table(("arm", *(f"lock {joint + 1}" for joint in range(7)), "arm angle"), rows),
        wrapped(
            f"""Bold: the length of the shortest loop that was found, and how far a joint ends from where it began [rad
            or m]. A number of cusps: postures at cusps that were met, and no loop around them. "-": no such rule, or
            singular everywhere. Joint 1 of the UR10e on a rail is the rail. Arms of six joints, without any rule: {
                six or "none asked"
            }."""
        ),
    ]
