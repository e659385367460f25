"""`python -m benchmarks.fuzz [KIND ...] --count 20000`: fuzz every kind, or some; exit 1 where one has a fault."""

from __future__ import annotations

import argparse
import sys

from benchmarks.fuzz.doors import DOORS
from benchmarks.fuzz.harness import run

KINDS = sorted([*DOORS, "calls"])


def main(arguments: list[str] | None = None) -> int:
    """Print a line a kind, and each fault."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(KINDS)}")
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--workers", type=int, default=None)
    parser.add_argument("--quick", action="store_true", help="three of each kind, in this process")
    args = parser.parse_args(arguments)
    count, workers = (3, 1) if args.quick else (args.count, args.workers)
    faults = 0
    for kind in args.kinds or KINDS:
        tally = run(kind, count, first=args.first, workers=workers)
        print(tally, flush=True)
        for seed, what in tally.faults[:20]:
            print(f"  seed {seed}: {what}", flush=True)
        faults += len(tally.faults)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
