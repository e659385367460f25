"""The page of cusps over the catalogue: `python docs/cusps_page.py [ROWS]` writes docs/cusps.md.

The rows come from `python -m benchmarks.cusps`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path
from string import Template
from typing import Any

import holokin as hk
from holokin.robot.closed_form import ArmClass, arm_class

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent))
from benchmarks.cusps import rows  # noqa: E402  from beside this folder

NAMES = {
    "fr3": "Franka FR3", "gen3": "Kinova Gen3", "iiwa14": "KUKA iiwa 14", "iiwa7": "KUKA iiwa 7", "panda": "Panda",
    "rail-ur10e": "UR10e on a rail", "sawyer": "Sawyer", "xarm7": "xArm 7", "yumi-arm": "YuMi, one arm",
    "mobile-ur5e": "UR5e on a mobile base", "ur5e": "UR5e", "ur10e": "UR10e", "irb140": "ABB IRB 140",
}  # fmt: skip

Row = dict[str, Any]


def cell(row: Row) -> str:
    """What was found of one law."""
    if "problem" in row:
        return "-"
    if "smallest" in row:
        one = row["smallest"]
        return f"**{100 * one['length']:.1f} cm**, {one['apart']:.2f}"
    if row["cusps"]:
        return f"{row['cusps']} cusps"
    locked = row["law"] in ("lock", "none")
    found = arm_class(hk.load(row["arm"]), tuple(row["joints"])) if locked else None
    proven = isinstance(found, ArmClass) and found.proven
    return "proven none" if proven else "none"


def of_arm(found: list[Row], arm: str, law: str) -> dict[tuple[int, ...], Row]:
    """The rows of an arm and a kind of law, by their joints."""
    return {tuple(row["joints"]): row for row in found if row["arm"] == arm and row["law"] == law}


def locks(found: list[Row], arms: list[str]) -> Iterator[str]:
    """A line of the table of locks for each arm."""
    for arm in arms:
        known = of_arm(found, arm, "lock")
        yield " | ".join(
            [NAMES.get(arm, arm), *(cell(known[(i,)]) for i in range(7)), cell(of_arm(found, arm, "arm angle")[()])]
        )


def pairs(found: list[Row], arms: list[str]) -> Iterator[str]:
    """A line for each arm about the sums and differences of two joints."""
    for arm in arms:
        known = {(law, p): row for law in ("sum", "difference") for p, row in of_arm(found, arm, law).items()}
        asked = [row for row in known.values() if "problem" not in row]
        sign = {"sum": "+", "difference": "-"}
        free = [
            f"q{i + 1}{sign[law]}q{j + 1}"
            for i, j in combinations(range(7), 2)
            for law in ("sum", "difference")
            if "problem" not in known[law, (i, j)] and not known[law, (i, j)]["cusps"]
        ]
        loops = sum("smallest" in row for row in asked)
        only = len(asked) - loops - len(free)
        yield f"{NAMES.get(arm, arm)} | {loops} | {only} | {len(free)} | {', '.join(free) or '-'}"


def page(found: list[Row]) -> str:
    """The text, with all numbers."""
    arms = sorted({row["arm"] for row in found if row["law"] == "arm angle"}, key=lambda a: NAMES.get(a, a).lower())
    six = [row for row in found if row["law"] == "none"]
    base = list(of_arm(found, "mobile-ur5e", "lock").values())
    sound = [row for row in base if "problem" not in row]
    seven = [row for row in found if row["arm"] in arms and "problem" not in row]
    loops = [row for row in seven if "smallest" in row]
    free = [
        arm
        for arm in arms
        if not any(row.get("cusps") for law in ("lock", "arm angle") for row in of_arm(found, arm, law).values())
    ]
    lengths = sorted(row["smallest"]["length"] for row in loops)
    values = {
        "version": seven[0]["version"],
        "asked": len(found),
        "minutes": round(sum(r.get("seconds", 0) for r in found) / 60),
        "seven": len(seven),
        "loops": len(loops),
        "share": round(100 * len(loops) / len(seven)),
        "without": sum(not row["cusps"] for row in seven),
        "only": sum(bool(row["cusps"]) and "smallest" not in row for row in seven),
        "shortest": f"{100 * lengths[0]:.1f}",
        "median": f"{100 * lengths[len(lengths) // 2]:.1f}",
        "free": ", ".join(NAMES.get(arm, arm) for arm in free) or "none of them",
        "locks": "\n".join(f"| {line} |" for line in locks(found, arms)),
        "pairs": "\n".join(f"| {line} |" for line in pairs(found, arms)),
        "six": "\n".join(f"| {NAMES.get(row['arm'], row['arm'])} | {cell(row)} |" for row in six),
        "triples": len(base),
        "sound": len(sound),
        "triple_loops": sum("smallest" in row for row in sound),
        "triple_none": sum(not row["cusps"] for row in sound),
    }
    return Template((HERE / "cusps_page.txt").read_text("utf-8")).substitute(values)


def main(arguments: list[str] | None = None) -> None:
    """Read the rows, write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", type=Path, nargs="?", default=Path("out/cusps.jsonl"))
    parser.add_argument("--docs", type=Path, default=HERE, help="where the page goes")
    given = parser.parse_args(arguments)
    found = rows(given.rows)
    (given.docs / "cusps.md").write_text(page(found), "utf-8")
    print(f"{given.docs / 'cusps.md'}: {len(found)} rows")


if __name__ == "__main__":
    main()
