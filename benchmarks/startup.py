"""What `import holokin` costs beyond `import casadi`: whole processes, alternating, medians.

python -m benchmarks.startup
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys


def seconds(statement: str) -> float:
    """Processor time of one fresh interpreter that runs a statement."""
    before = os.times()
    subprocess.run([sys.executable, "-c", statement], check=True)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def main(arguments: list[str] | None = None) -> int:
    """Print the two medians and their difference."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.startup", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one round")
    rounds = 1 if parser.parse_args(arguments).quick else 15
    for statement in ("import casadi", "import holokin"):
        seconds(statement)  # fill the file cache
    pairs = [(seconds("import casadi"), seconds("import holokin")) for _ in range(rounds)]
    casadi, holokin = (statistics.median(column) for column in zip(*pairs, strict=True))
    extra = statistics.median(b - a for a, b in pairs)
    print(
        f"import casadi {casadi:.3f} s, import holokin {holokin:.3f} s, difference {extra:.3f} s (median of {rounds})"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
