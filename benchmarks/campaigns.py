"""A campaign: something is tried for many seeds, in any number of processes; what is done is not done again."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

Row = dict[str, Any]
"""What became of a seed: `seed`, `counts`, `faults`, `seconds`."""


def options(name: str, about: str | None, count: str) -> argparse.ArgumentParser:
    """The options that every campaign takes; `count` says what is counted."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.{name}", description=about)
    parser.add_argument("--count", type=int, default=1000, help=count)
    parser.add_argument("--seed", type=int, default=0, help="The first one.")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, help="A line of JSON for each seed; those that it has are not done again.")
    parser.add_argument("--quick", action="store_true", help="One robot.")
    return parser


def campaign(tried: Callable[[int], Row], seeds: Sequence[int], workers: int, out: Path | None) -> list[Row]:
    """The rows of all seeds; faults are printed as they are found."""
    os.environ.setdefault("HOLOKIN_NATIVE", "0")  # no robot comes again: compilers would not pay
    rows: list[Row] = []
    if out is not None and out.exists():
        rows = [row for line in out.read_text("utf-8").splitlines() if (row := json.loads(line))["seed"] in seeds]
    done = {row["seed"] for row in rows}
    left = [seed for seed in seeds if seed not in done]
    with ProcessPoolExecutor(workers) as pool:
        for row in map(tried, left) if workers == 1 else pool.map(tried, left):
            rows.append(row)
            for fault in row["faults"]:
                print(fault, flush=True)
            if out is not None:
                with out.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(row) + "\n")
            if len(rows) % 50 == 0:
                print(f"{len(rows)} of {len(seeds)} robots", file=sys.stderr, flush=True)
    return rows


def summary(rows: Sequence[Row]) -> tuple[Counter[str], str]:
    """(all counts, the lines that say them)."""
    total = Counter[str]()
    for row in rows:
        total.update(row["counts"])
    return total, "\n".join(f"{total[key]:9,} {key}" for key in sorted(total))
