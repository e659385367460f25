"""Is anything lost, or said in a raw error? Wrong files and calls, kills at any moment: a section of the page."""

from __future__ import annotations

import signal
from collections.abc import Iterator

from benchmarks import certificates, selftests
from benchmarks.campaigns import campaign, summary
from benchmarks.fuzz.harness import MEGABYTES, SECONDS, Tally
from benchmarks.fuzz.harness import run as fuzzed
from benchmarks.kills import run as killed
from benchmarks.page import Given, table, versions, wrapped
from benchmarks.speed import environment

FUZZED = {
    "jobs": ("job files: wrong, huge, nested and broken, done with few samples", 300),
    "urdfs": ("URDF files", 1000),
    "mjcf_files": ("MJCF files", 500),
    "xacro_files": ("xacro files with the files that they name, a process each", 30),
    "dh": ("DH tables, as TOML and in Python", 2000),
    "drawings": ("SVG drawings", 100),
    "csv_logs": ("CSV logs, read and audited", 500),
    "bags": ("bags (rosbag2, MCAP, ROS 1), read", 1000),
    "datasets": ("LeRobot datasets, v2.1 and v3.0, audited and retargeted", 200),
    "survey_files": ("survey files", 1000),
    "survey_results": ("results of surveys, read as report, case and `--resume` do", 50),
    "sheets_files": ("maps of sheets, read again and asked", 1000),
    "certificate_files": ("certificates, checked again", 100),
    "calls": ("calls of public functions and methods with wrong arguments", 2000),
}
"""Kind -> (what it is, how many are tried)."""

SIGNALS = ((signal.SIGKILL, 30), (signal.SIGINT, 20), (signal.SIGTERM, 20))
SELFTESTS, ROBOTS = 20, 10


def tried(quick: bool) -> Iterator[list[str]]:
    """Rows: what was tried, how often, how many were refused in a sentence, the faults, the slowest, the memory."""
    for kind, (what, count) in FUZZED.items():
        found: Tally = fuzzed(kind, 3 if quick else count, workers=1 if quick else 2)
        print(found, *found.faults[:5], sep="\n", flush=True)
        seconds, memory = f"{found.slowest:.1f} s", f"{found.memory:.0f} MB"
        yield [what, f"{found.done:,}", f"{found.refused:,}", str(len(found.faults)), seconds, memory]
    for number, count in SIGNALS[:1] if quick else SIGNALS:
        ends, faults = killed(1 if quick else count, number, 0)
        print(number.name, dict(ends), *faults, sep="\n", flush=True)
        what = f"{number.name} at a random moment of `holokin run`, then the next run"
        yield [what, str(ends.total()), "-", str(len(faults)), "-", "-"]
    with environment(HOLOKIN_NATIVE="0"):  # no robot comes again: compilers would not pay
        rows = campaign(certificates.tried, range(2, 3 if quick else 2 + ROBOTS), 1, None)
    total = summary(rows)[0]
    refused = sum(many for key, many in total.items() if key.startswith("refused"))
    faults = sum(len(row["faults"]) for row in rows)
    what = f"certificates on {len(rows)} random robots, {total['cells']:,} cells examined by another method"
    yield [what, f"{total['certificates']:,}", f"{refused:,}", str(faults), "-", "-"]
    passed, failed, refused = selftests.run(1 if quick else SELFTESTS, selftests.SMALL if quick else 0)
    what = "exported C of random arms and laws, compiled and run against its vectors"
    yield [what, str(passed + failed + refused), str(refused), str(failed), "-", "-"]


def section(given: Given) -> tuple[list[str], str]:
    """Try; the blocks of docs/measured.md, and the versions."""
    rows = list(tried(given.quick))
    faults = sum(int(row[3]) for row in rows)
    return [
        "## Reliability",
        wrapped(
            f"""What may a faulty file, a wrong call or a killed process cost? {
                sum(int(r[1].replace(",", "")) for r in rows):,} were tried for this page, with {
                faults or "no"
            } faults; `python -m benchmarks.fuzz` and
            `python -m benchmarks.kills` try any number. A mutant is at fault when it ends in anything but a result or
            one sentence, takes more than {SECONDS} s, or brings its process above {MEGABYTES / 1000:g} GB. A kill is
            at fault when a result is lost, mixed or half-written, a file of the user is gone, or litter stays after
            the next run."""
        ),
        table(("tried", "times", "refused", "faults", "slowest", "memory"), rows),
        wrapped(
            """What holds: results are written beside their place and moved there when they are complete; the old ones
            stand until then. A full disk or a missing permission is one sentence with exit code 2, and the other jobs
            of the command are done. Ctrl-C ends a command with one line and exit code 130, SIGTERM with 143; a signal
            that meets Python while it ends may leave another code behind the line. What a killed process left is
            cleared up by the next run with the same `--out`, and nothing else is touched. Two runs of one job at once
            do not mix."""
        ),
        wrapped(
            """What does not: nothing is flushed to the disk, so after a power failure the file system decides what is
            left. On Windows and on file systems without flock, killed runs leave their hidden folders, and two runs at
            once are not kept apart. Between the two renames of a killed run there is no folder of that name until the
            next run. A killed `export c` may leave files of two exports; the C files then do not compile together.
            Signals in the first half second, before Python has loaded holokin, are answered by Python."""
        ),
    ], versions("casadi", "numpy", "scipy", "pydantic", "rosbags", "mujoco")
