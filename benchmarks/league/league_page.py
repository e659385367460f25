"""docs/league.md: what is measured, the tables, what was run."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence

import numpy as np

from benchmarks import drift
from benchmarks.league import courses
from benchmarks.league.league_reading import arms_of, reading, shown, wrapped
from benchmarks.league.played import Played
from benchmarks.league.scores import AGAIN, NEAR_MM, NEAR_RAD, RETURNED, Score


def league_text(played: Sequence[Played], cycles: int = courses.CYCLES, dt: float = courses.DT) -> str:
    """The page of what was played."""
    parts = ["# The league of libraries\n", *_head(played, cycles, dt)]
    for arm in arms_of(played):
        start = np.array2string(drift.STARTS[arm], separator=", ")
        parts += [f"## {arm}\n", f"Start q = {start}.\n", *_table(played, arm), ""]
    parts += ["## Reading it\n", *reading(played), "", "## What was run\n", *_settings(played)]
    left = [f"- **{p.entry.name}**: {p.left_out}." for p in played if p.left_out]
    parts += ["", "## Left out\n", *left] if left else []
    return "\n".join(parts) + "\n"


def _head(played: Sequence[Played], cycles: int, dt: float) -> list[str]:
    speeds = ", ".join(map(str, drift.SPEEDS))
    box = " x ".join(f"{2 * reach:g}" for reach in courses.REACH)
    turn = f"{np.degrees(courses.TURN):.0f}"
    of_tours = f"{courses.TOURS} tours: straight legs through {courses.CORNERS} poses and back"
    paragraphs = [
        """Written by `python -m benchmarks.league`; do not edit. Which libraries give the same joints at the same tool
        pose, and what does a call take? [The drift benchmark](drift.md) compares laws in one process. Here each library
        runs in an environment of its own (`venv` and pip), in a script without holokin. It gets the robot as a URDF or
        MJCF file and the poses of the tool, one after the other, and gives joints back. One measure, from the joints
        alone, is taken of all, also of holokin.""",
        "![How far apart the joints are at one tool pose that was reached by two paths](league.png)",
        f"""Every {dt} s a library is given the pose for the end of this step, and the twist if it takes one. The robot
        is where the last answer put it. The paths are those of the drift benchmark at constant orientation: a circle
        of 0.1 m radius, a figure eight of two circles of 0.07 m, a square of 0.14 m, {cycles} cycles each at 0.1 m/s;
        then half the circle by both ways at {speeds} m/s. A library that takes poses alone gets the same poses. Then
        come {of_tours}, two rounds. These poses are drawn at random in a box of {box} m about the start, turned by up
        to {turn} degrees. Nothing says that the arm can follow them.""",
        """**As its example**: with the tasks, gains, seeds and solvers of an example of the library itself, with our
        start as the posture of a posture task.""",
        f"""**At its best**: of all [settings that were tried](#what-was-run), also the example's, the fastest one on
        this arm whose two paths and whose last cycle differ by less than {RETURNED:g} rad. If there is none, it is the
        one that differs least. It must answer every call, keep the tool within {NEAR_MM:g} mm and {NEAR_RAD:g} rad of
        the path, and keep the joints within their limits of place and speed.""",
        """**First cycle**, **a later cycle** (the last): drift of that cycle. **Two paths**: joints at the pose
        opposite the start, reached clockwise and counter-clockwise. **Slow, fast**: the same pose reached at another
        speed. Angles are of the largest joint [rad], worst of the paths. **Tool**: its worst distance from the
        path.""",
        f"""**Tours**: how many are whole: an answer everywhere, on the path, within the joint limits and speeds.
        **Again**: in how many of these the second round has the joints of the first, all along, within {AGAIN:g} rad.
        **A call**: from Python, the median of each run, the least of the runs.""",
        _machine(played),
    ]
    return [f"{wrapped(words)}\n" for words in paragraphs]


def _machine(played: Sequence[Played]) -> str:
    said = f"""{platform.system()} {platform.machine()}, Python {platform.python_version()}, {os.cpu_count()} cores that
        other processes used, too."""
    if pinv := [p.pinv_us for p in played if np.isfinite(p.pinv_us)]:
        said += f""" To compare: in these environments NumPy's pinv of a 6x7 matrix took {min(pinv):.1f} to
            {max(pinv):.1f} us."""
    return said


def _table(played: Sequence[Played], arm: str) -> list[str]:
    lines = [
        "| library | how | first cycle | a later cycle | two paths | slow, fast | tool | tours | again | a call |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for p in played:
        for how, s in shown(p, arm):
            lines.append(f"| {p.entry.name} | {how}: {s.name} | {_cells(s)} |")
    return lines


def _cells(s: Score) -> str:
    if s.fault:
        return f"stopped: {s.fault}" + " |" * 7
    figures = [f"{v:.1e}" for v in (s.first, s.later, s.ways, s.speeds)]
    told = "" if s.unfair in ("", "off the path") else f", **{s.unfair}**"
    call = f"{s.call_us:.3g} us" if s.call_us < 1000 else f"{s.call_us:,.0f} us"
    figures += [f"{s.tracking:.2g} mm{told}", f"{s.whole} of {s.tours}", str(s.again), call]
    return " | ".join(figures)


def _settings(played: Sequence[Played]) -> list[str]:
    lines = [
        "After each setting: by how much two paths or a later cycle differ, the worst of both and of the arms [rad],",
        "and what keeps it from being the best one.\n",
        "| library | versions | its example | settings |",
        "|---|---|---|---|",
    ]
    for p in (p for p in played if p.scores):
        versions = ", ".join(f"{name} {number}" for name, number in p.versions.items())
        examples = "; ".join(dict.fromkeys(s.source for s in p.scores if s.example))
        tried = []
        for name in dict.fromkeys(s.name for s in p.scores):
            rows = [s for s in p.scores if s.name == name]
            why = "; ".join(dict.fromkeys(s.unfair for s in rows if s.unfair))
            tried.append(f"{name}: {max(s.apart for s in rows):.0e}" + (f" ({why})" if why else ""))
        lines.append(f"| {p.entry.name} | {versions} | {examples} | {'<br>'.join(tried)} |")
    return lines
