"""docs/league.md: the tables, what they say, and what was run."""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks import drift
from benchmarks.league import courses
from benchmarks.league.league_entries import OURS
from benchmarks.league.played import Played
from benchmarks.league.scores import AGAIN, NEAR_MM, NEAR_RAD, Score, best_of

RETURNED = 1e-6
"""Two paths that end nearer than this [rad] have the same joints: no servo of these arms resolves less."""


def league_text(played: Sequence[Played], cycles: int = courses.CYCLES, dt: float = courses.DT) -> str:
    """The page of what was played."""
    arms = list(dict.fromkeys(s.arm for p in played for s in p.scores))
    parts = [*_head(played, cycles, dt)]
    for arm in arms:
        parts += [
            f"## {arm}\n",
            f"Start q = {np.array2string(drift.STARTS[arm], separator=', ')}.\n",
            *_table(played, arm),
            "",
        ]
    parts += ["## Reading it\n", *_reading(played), "", "## What was run\n", *_settings(played)]
    left = [f"- **{p.entry.name}**: {p.left_out}." for p in played if p.left_out]
    parts += ["", "## Left out\n", *left] if left else []
    return "\n".join(parts) + "\n"


def shown(p: Played) -> list[tuple[str, str]]:
    """(how, name of the setting) of a library's rows: its example's, and its best, which may be the same."""
    examples = list(dict.fromkeys(s.name for s in p.scores if s.example))
    best = best_of(p.scores)
    rows = [("as its example, and its best" if name == best else "as its example", name) for name in examples]
    return rows + ([("at its best", best)] if best and best not in examples else [])


def worst(p: Played, name: str, figure: Callable[[Score], float]) -> float:
    """A figure of one setting, the worst of the arms."""
    return max((figure(s) for s in p.scores if s.name == name and not s.fault), default=np.nan)


def _head(played: Sequence[Played], cycles: int, dt: float) -> list[str]:
    speeds = ", ".join(map(str, drift.SPEEDS))
    box = " x ".join(f"{2 * reach:g}" for reach in courses.REACH)
    pinv = [p.pinv_us for p in played if np.isfinite(p.pinv_us)]
    return [
        "# The league of libraries\n",
        "Written by `python -m benchmarks.league`; do not edit. Which libraries give the same joints at the same tool",
        "pose, and what does a call take? [The drift benchmark](drift.md) compares laws in one process. Here each",
        "library runs in an environment of its own (`venv` and pip), in a script without holokin. It gets the robot as",
        "a URDF or MJCF file and the poses of the tool, one after the other, and gives joints back. One measure, from",
        "the joints alone, is taken of all, also of holokin.\n",
        "![How far apart the joints are at one tool pose that was reached by two paths](league.png)\n",
        f"Every {dt} s a library is given the pose for the end of this step, and the twist if it takes one. The robot is",
        "where the last answer put it. The paths are those of the drift benchmark at constant orientation: a circle of",
        f"0.1 m radius, a figure eight of two circles of 0.07 m, a square of 0.14 m, {cycles} cycles each at 0.1 m/s; then",
        f"half the circle by both ways at {speeds} m/s. A library that takes poses alone gets the same poses.",
        f"Then come {courses.TOURS} tours: straight legs through {courses.CORNERS} poses and back, two rounds. These poses are drawn at",
        f"random in a box of {box} m about the start, turned by up to {np.degrees(courses.TURN):.0f} degrees. Nobody asked whether",
        "the arm can follow them.\n",
        "**As its example**: with the tasks, gains, seeds and solvers of an example of the library itself. A posture",
        "task has the start as its target. **At its best**: of the settings that were tried",
        "([below](#what-was-run)), the one whose two paths and whose later cycles differ least on the worse of the arms,",
        f"among those that keep the tool within {NEAR_MM:g} mm and {NEAR_RAD:g} rad and the joints within their limits and",
        "speeds. Angles are of the largest joint [rad], worst of the paths.\n",
        "**First cycle**, **a later cycle** (the last): drift of that cycle. **Two paths**: joints at the pose opposite",
        "the start, reached clockwise and counter-clockwise. **Slow, fast**: the same pose reached at another speed.",
        "**Tool**: its worst distance from the path. **Tours**: how many are whole, that is, with an answer everywhere, on",
        f"the path, within joint limits and speeds. **Again**: in how many of these the second round has the joints of the",
        f"first, all along, within {AGAIN:g} rad. **A call**: median of each run, least of the runs, called from Python.\n",
        f"{platform.system()} {platform.machine()}, Python {platform.python_version()}, {os.cpu_count()} cores that others used, too. "
        f"In all environments NumPy's pinv of a 6x7 matrix took {min(pinv):.1f} to {max(pinv):.1f} us: compare times in that unit.\n"
        if pinv
        else "",
    ]


def _table(played: Sequence[Played], arm: str) -> list[str]:
    lines = [
        "| library | how | first cycle | a later cycle | two paths | slow, fast | tool | tours | again | a call |",
        "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for p in played:
        for how, name in shown(p):
            for s in (s for s in p.scores if s.arm == arm and s.name == name):
                lines.append(f"| {p.entry.name} | {how}: {name} | {_cells(s)} |")
    return lines


def _cells(s: Score) -> str:
    if s.fault:
        return f"stopped: {s.fault}" + " |" * 7
    drifts = [f"{v:.1e}" for v in (s.first, s.later, s.ways, s.speeds)]
    past = ("" if s.within else ", past a limit") + ("" if s.hurry <= 1 else ", jumps")
    none = f", {s.missing} calls without answer" if s.missing else ""
    return " | ".join([*drifts, f"{s.tracking:.2g} mm{past}{none}", f"{s.whole} of {s.tours}", f"{s.again}", _call(s)])


def _call(s: Score) -> str:
    return f"{s.call_us:.3g} us"


def _reading(played: Sequence[Played]) -> list[str]:
    others = [p for p in played if p.entry != OURS and p.scores]
    ours = next((p for p in played if p.entry == OURS and p.scores), None)
    lines: list[str] = []
    as_shown = {p.entry.name: min(worst(p, n, _apart) for how, n in shown(p) if "example" in how) for p in others}
    drifting = {name: value for name, value in as_shown.items() if not value < RETURNED}
    if drifting:
        span = f"{min(drifting.values()):.1e} to {max(drifting.values()):.1e}"
        lines.append(
            f"- **As their examples run them**, {len(drifting)} of {len(others)} end up with other joints after another path, by {span} rad."
        )
    good = [name for name, value in as_shown.items() if value < RETURNED]
    if good:
        lines.append(f"  {', '.join(good)} have the same joints, within {RETURNED:g} rad.")
    tuned = {
        p.entry.name: (worst(p, n, _apart), worst(p, n, lambda s: s.call_us))
        for p in others
        if (n := best_of(p.scores))
    }
    equal = {name: us for name, (apart, us) in tuned.items() if apart < RETURNED}
    if equal:
        told = ", ".join(f"{name} ({us:.3g} us)" for name, us in sorted(equal.items(), key=lambda pair: pair[1]))
        lines.append(f"- **At their best, these return as well as holokin**, within {RETURNED:g} rad: {told}.")
    near = {name: apart for name, (apart, _) in tuned.items() if not apart < RETURNED}
    if near:
        told = ", ".join(f"{name} {apart:.1e}" for name, apart in sorted(near.items(), key=lambda pair: pair[1]))
        lines.append(f"- The others are nearer at their best than in their examples, and not equal [rad]: {told}.")
    lines += [
        "- Why: a posture task of full gain takes the whole error of its posture out of the null space in each step. That is",
        "  the rule of our strategy *stationary posture*, one step late. Several steps a sample bring it up to date. A",
        "  solver that is asked from one seed each time has no memory, so that it is a function of the pose, too.",
        "- What the best settings cost is time, and that they hold where the search ends in the same place: see the tours,",
        "  and [the jumps of solvers from one seed](speed.md#inverse-kinematics-on-two-paths-to-each-pose).",
    ]
    if ours:
        best = best_of(ours.scores) or ""
        lines += _tours(played)
        us = worst(ours, best, lambda s: s.call_us)
        faster = [name for name, (_, time) in tuned.items() if time < us]
        lines.append(
            f"- holokin's best setting takes {us:.3g} us a call. "
            + (f"Faster: {', '.join(faster)}." if faster else "No other library's best is faster.")
        )
        slower = sorted(
            (worst(p, n, lambda s: s.call_us), p.entry.name) for p in others for how, n in shown(p) if "example" in how
        )
        if slower:
            lines.append(
                f"  As their examples run them, they take {slower[0][0]:.3g} us ({slower[0][1]}) to {slower[-1][0]:,.0f} us ({slower[-1][1]})."
            )
    compiled = [
        (p.entry.name, max(s.first_seconds for s in p.scores if not s.fault))
        for p in played
        if any(not s.fault for s in p.scores)
    ]
    slow = [f"{name} {seconds:.1f} s" for name, seconds in compiled if seconds > 0.5]
    if slow:
        lines.append(
            f"- The first call, with what is compiled for it, is not in these times: at most {', '.join(slow)}; others less than 0.5 s."
        )
    return lines


def _apart(s: Score) -> float:
    return max(s.ways, s.later)


def _tours(played: Sequence[Played]) -> list[str]:
    """How many tours each library's best setting does, over the arms."""
    told = []
    for p in played:
        if best := best_of(p.scores):
            rows = [s for s in p.scores if s.name == best]
            told.append(
                (sum(s.again for s in rows), sum(s.whole for s in rows), sum(s.tours for s in rows), p.entry.name)
            )
    told.sort(key=lambda row: (-row[0], -row[1], row[3]))
    text = ", ".join(
        f"{name} {again} ({whole})" if whole != again else f"{name} {again}" for again, whole, _, name in told
    )
    return [
        f"- Tours with the same joints again, of {max(row[2] for row in told)} at best settings (in brackets: whole): {text}."
    ]


def _settings(played: Sequence[Played]) -> list[str]:
    lines = [
        "| library | versions | its example | settings tried, with two paths apart on the worse arm [rad] |",
        "|---|---|---|---|",
    ]
    for p in played:
        if not p.scores:
            continue
        versions = ", ".join(f"{name} {number}" for name, number in p.versions.items())
        examples = "; ".join(dict.fromkeys(s.source for s in p.scores if s.example))
        names = dict.fromkeys(s.name for s in p.scores)
        tried = "; ".join(f"{name} {worst(p, name, _apart):.0e}{_why_not(p, name)}" for name in names)
        lines.append(f"| {p.entry.name} | {versions} | {examples} | {tried} |")
    return lines


def _why_not(p: Played, name: str) -> str:
    rows = [s for s in p.scores if s.name == name]
    if any(s.fault for s in rows):
        return " (stopped)"
    if any(s.missing for s in rows):
        return " (calls without answer)"
    if any(s.tracking > NEAR_MM or s.turn > NEAR_RAD for s in rows):
        return " (off the path)"
    if any(not s.within for s in rows):
        return " (past a limit)"
    return " (jumps)" if any(s.hurry > 1 for s in rows) else ""
