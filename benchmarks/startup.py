"""What it costs to start: `import holokin`, a first robot, the help of the command, beside an empty Python and CasADi.

Whole processes, alternating, medians of processor time.

python -m benchmarks.startup
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys

STARTS = {
    "nothing": ["-c", "pass"],
    "import casadi": ["-c", "import casadi"],
    "import holokin": ["-c", "import holokin"],
    "import holokin, load a Panda": ["-c", "import holokin; holokin.load('panda')"],
    "holokin --help": ["-m", "holokin", "--help"],
}


def seconds(words: list[str]) -> float:
    """Processor time of one fresh interpreter with these arguments."""
    before = os.times()
    subprocess.run([sys.executable, *words], check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def main(arguments: list[str] | None = None) -> int:
    """Print the medians."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.startup", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="one round")
    rounds = 1 if parser.parse_args(arguments).quick else 15
    for words in STARTS.values():
        seconds(words)  # fill the file cache
    found = [{name: seconds(words) for name, words in STARTS.items()} for _ in range(rounds)]
    for name in STARTS:
        print(f"{name:30} {statistics.median(row[name] for row in found):.2f} s (median of {rounds})")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
