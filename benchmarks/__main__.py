"""Measures, and writes docs/measured.md: `python -m benchmarks [PART ...]`, without a part all of them (about an hour).

Needs pip install -e ".[rivals,test]" and a C compiler. The other sections of the page stay as they are.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.league.played import default_folder
from benchmarks.page import PARTS, ROOT, Given, run


def main(arguments: list[str] | None = None) -> int:
    """Run the parts, one after the other; each writes its section when it is done."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", choices=[*PARTS, []], help="of " + ", ".join(PARTS))
    parser.add_argument("--quick", action="store_true", help="little of all, to try it; only with --out")
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="folder of the page and its pictures")
    parser.add_argument("--answers", type=Path, help="of the league: kept here; what is here is not asked for again")
    parser.add_argument("--environments", type=Path, default=default_folder(), help="of libraries, made where missing")
    args = parser.parse_args(arguments)
    if args.quick and args.out == ROOT / "docs":
        parser.error("--quick is no measurement: give --out")
    given = Given(args.out, args.quick, args.answers, args.environments)
    try:
        for part in args.parts or PARTS:
            run(part, given)
    except KeyboardInterrupt:
        print("stopped; the sections that are done are written")
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
