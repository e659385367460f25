"""How exact? The tests that compare numbers with what others say, run again, and what it costs to start."""

from __future__ import annotations

import os
import re
import statistics
import subprocess
import sys

from benchmarks.page import ROOT, Given, table, versions, wrapped

TESTS = (
    ("pose and Jacobian, every moving chain of the URDFs of example-robot-data", "Pinocchio", "1e-12",
     "tests/robot/test_pinocchio.py", "every_moving_chain"),
    ("mimic joints, limits, speeds", "Pinocchio", "1e-12, the same",
     "tests/robot/test_pinocchio.py", "mimic_joints or limits_and_speeds"),
    ("what is read of these URDFs, and of random ones", "yourdfpy", "the last bit",
     "tests/robot/test_models.py", "as_yourdfpy_reads_it"),
    ("the pseudo-inverse on the paper's arm", "its closed form, the Prytz planimeter", "1e-9",
     "tests/motion/test_numbers.py", "prytz_planimeter"),
    ("both holonomic strategies of the paper", "their leaves in closed form", "1e-12",
     "tests/motion/test_numbers.py", "closed_form_leaf"),
    ("the pseudo-inverse on a Panda's circle, three cycles", "Pinocchio, an adaptive integrator", "1e-7",
     "tests/motion/test_numbers.py", "as_pinocchio_says"),
    ("a Panda followed by leaf, after 1,000 cycles", "its start", "1e-12 rad",
     "tests/motion/test_numbers.py", "home_after_a_thousand"),
    ("curvature, and the Jacobians of every law", "finite differences", "the error of these",
     "tests/strategies/test_laws.py", "finite_differences"),
    ("brackets and formulas of the paper", "SymPy, closed forms", "exactly, or 1e-12",
     "tests/strategies/test_paper.py", ""),
    ("exp and log of rotations, with derivatives", "SciPy, finite differences", "1e-14",
     "tests/symbolic/test_symbolic.py", "exp_and_log or quaternions or scipys"),
    ("exported C, 250,000 postures of a Panda", "CasADi's virtual machine", "1e-12, single precision 1e-4",
     "tests/export/test_export.py", "250000_postures"),
)  # fmt: skip
"""What is compared, with what, to what it agrees, and the tests that say so: a file, and words of their names."""

STARTS = {
    "an empty Python": ["-c", "pass"],
    "`import casadi`": ["-c", "import casadi"],
    "`import holokin`": ["-c", "import holokin"],
    "`import holokin`, and a Panda": ["-c", "import holokin; holokin.load('panda')"],
    "`holokin --help`": ["-m", "holokin", "--help"],
}


def tested(file: str, words: str) -> str:
    """How many tests of a file, whose names have these words, pass, in the suite and the campaign."""
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-m", "", "-p", "no:cacheprovider", file]
    done = subprocess.run([*command, "-k", words] if words else command, cwd=ROOT, capture_output=True, text=True)
    print(f"{file} {words}: {done.stdout.splitlines()[-1]}", flush=True)
    counts = {kind: int(many) for many, kind in re.findall(r"(\d+) (passed|failed|error|skipped)", done.stdout)}
    bad = counts.get("failed", 0) + counts.get("error", 0)
    return f"{counts.get('passed', 0)} pass" + (f", {bad} FAIL" if bad else "")


def seconds(words: list[str]) -> float:
    """Processor time of one fresh interpreter with these arguments."""
    before = os.times()
    subprocess.run([sys.executable, *words], check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def section(given: Given) -> tuple[list[str], str]:
    """Run the tests, start Python; the blocks of docs/measured.md, and the versions."""
    tests, rounds = (TESTS[9:10], 1) if given.quick else (TESTS, 15)
    rows = [(what, other, bound, f"`{file}`", tested(file, words)) for what, other, bound, file, words in tests]
    for words in STARTS.values():
        seconds(words)  # fill the file cache
    found = [{name: seconds(words) for name, words in STARTS.items()} for _ in range(rounds)]
    starts = ", ".join(f"{name} {statistics.median(row[name] for row in found):.2f} s" for name in STARTS)
    return [
        "## Accuracy",
        wrapped(
            """How exact are the numbers? Each line is a comparison with something that shares no code with holokin,
            and a test that fails where the difference is larger than stated; the last column says how many cases of it
            were run for this page, and what became of them."""
        ),
        table(("what", "compared with", "agrees to", "test", "cases"), rows, 4),
        wrapped(f"What it costs to start, in processor time, medians of {rounds} fresh processes: {starts}."),
    ], versions("casadi", "numpy", "scipy", "pin", "yourdfpy", "sympy")
