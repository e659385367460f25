"""docs/league.md and docs/league.png: what is measured, the tables, sentences made of their numbers, what was run."""

from __future__ import annotations

import os
import platform
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from benchmarks import drift
from benchmarks.league import courses
from benchmarks.league.played import OURS, Played
from benchmarks.league.scores import AGAIN, NEAR_MM, NEAR_RAD, RETURNED, Score, best_of
from holokin.app.report.plots import BLUE, GREY, INK, VERMILLION

WIDTH = 118
"""Letters of a line of the page."""

NEAR = 1e-3
"""Joints [rad] nearer than this to a leaf, where other laws are 0.1 away, follow it."""

SAME_RULE = "stationary posture, pose to joints"
"""Our setting with the rule that posture tasks lead to."""

EXAMPLE, BEST, BOTH = "as its example", "at its best", "as its example, and its best"


def arms_of(played: Sequence[Played]) -> list[str]:
    """The names of the arms."""
    return list(dict.fromkeys(s.arm for p in played for s in p.scores))


def shown(p: Played, arm: str) -> list[tuple[str, Score]]:
    """Rows of a library on one arm: its example's settings, and its best one, which may be the same."""
    of_arm = [s for s in p.scores if s.arm == arm]
    best = best_of(of_arm)
    rows = [(BOTH if s is best else EXAMPLE, s) for s in of_arm if s.example]
    return rows + ([(BEST, best)] if best is not None and not best.example else [])


def chosen(p: Played, how: str, arms: Sequence[str]) -> list[Score]:
    """Of each arm the example's, or the best, setting; fewer where there is none."""
    return [s for arm in arms for told, s in shown(p, arm) if told in (how, BOTH) and not s.fault]


def reading(played: Sequence[Played]) -> list[str]:
    """Lines of a list."""
    arms = arms_of(played)
    others = [p for p in played if p.entry != OURS and p.scores]
    ours = [p for p in played if p.entry == OURS and p.scores]
    lines = [*_as_examples(others, arms), *_at_best(others, arms), *_why(others, arms), *_tours(played, arms)]
    for p in ours:
        lines += [*_times(p, others, arms), *_same_rule(p, others, arms)]
    lines += _first_calls(played)
    return [wrapped(f"- {line}", "  ") for line in lines]


def wrapped(words: str, indent: str = "") -> str:
    """Words in lines of one length; the later ones are indented."""
    how = {"subsequent_indent": indent, "break_long_words": False, "break_on_hyphens": False}
    return textwrap.fill(" ".join(words.split()), WIDTH, **how)


def _as_examples(others: Sequence[Played], arms: Sequence[str]) -> Iterable[str]:
    rows = {p.entry.name: found for p in others if (found := chosen(p, EXAMPLE, arms))}
    apart = {name: max(s.apart for s in found) for name, found in rows.items()}
    unlike = [value for value in apart.values() if value >= RETURNED]
    if unlike:
        yield f"""**As their examples run them**, {len(unlike)} of {len(rows)} libraries have other joints at one pose
            after another path or another cycle, by {min(unlike):.1e} to {max(unlike):.1e} rad on the worst arm."""
    alike = [f"{name} ({s.arm})" for name, found in rows.items() for s in found if s.apart < RETURNED and not s.unfair]
    if alike:
        yield f"As their examples run them, these have the same joints, within {RETURNED:g} rad: {', '.join(alike)}."
    stopped = [f"{name} ({s.arm}: {s.unfair})" for name, found in rows.items() for s in found if s.unfair]
    if stopped:
        yield f"Examples that did not keep to the paths: {', '.join(stopped)}."


def _at_best(others: Sequence[Played], arms: Sequence[str]) -> Iterable[str]:
    best = {p.entry.name: rows for p in others if (rows := chosen(p, BEST, arms))}
    alike = [n for n, rows in best.items() if len(rows) == len(arms) and max(s.apart for s in rows) < RETURNED]
    if alike:
        times = {name: max(s.call_us for s in best[name]) for name in alike}
        told = ", ".join(f"{name} ({_us(times[name])} us)" for name in sorted(alike, key=lambda name: times[name]))
        yield f"""**At their best these have the same joints at one pose, as holokin has**, within {RETURNED:g} rad on
            all arms: {told}."""
    unlike = {name: max(s.apart for s in rows) for name, rows in best.items() if name not in alike}
    if unlike:
        told = [f"{n} {apart:.0e}{_alone(best[n], arms)}" for n, apart in sorted(unlike.items(), key=lambda n: n[1])]
        yield f"The others at their best, on the worst arm [rad]: {', '.join(told)}."
    none = [p.entry.name for p in others if p.entry.name not in best]
    if none:
        yield f"Without a setting that kept to all paths: {', '.join(none)}."
    for p in others:
        asked = {s.arm for s in p.scores}
        if lacking := [arm for arm in arms if arm not in asked]:
            yield f"{p.entry.name} has no {' and no '.join(lacking)}."


def _alone(rows: Sequence[Score], arms: Sequence[str]) -> str:
    return "" if len(rows) == len(arms) else f" (on the {' and the '.join(s.arm for s in rows)} alone)"


def _us(value: float) -> str:
    return f"{value:.2g}" if value < 10 else f"{value:,.0f}"


def _why(others: Sequence[Played], arms: Sequence[str]) -> Iterable[str]:
    near = {p.entry.name: max(s.resting for s in found) for p in others if (found := chosen(p, BEST, arms))}
    told = ", ".join(
        f"{name} {value:.0e}" for name, value in sorted(near.items(), key=lambda pair: pair[1]) if value < NEAR
    )
    yield """Why: a posture task of full gain takes the whole error of its posture out of the null space in each step.
        That is the rule of our strategy *stationary posture*, one step late. Several steps a sample bring it up to
        date."""
    if told:
        yield f"""At their best these have the joints of that strategy all round the circle [rad]: {told}."""
    yield """A solver that is asked from one seed each time, and draws nothing at random, remembers nothing. It is a
        function of the pose, and returns. What it costs are jumps, where its search ends elsewhere:
        [measured on straight legs](rivals.md#legs)."""


def _tours(played: Sequence[Played], arms: Sequence[str]) -> Iterable[str]:
    told = []
    for p in played:
        if rows := chosen(p, BEST, arms):
            counts = [sum(getattr(s, what) for s in rows) for what in ("again", "whole", "tours")]
            told.append((*counts, p.entry.name))
    told.sort(key=lambda row: (-row[0], -row[1], row[3]))
    text = ", ".join(f"{name} {again} of {whole}" for again, whole, _, name in told)
    if told:
        yield f"""Tours at best settings, of {max(row[2] for row in told)} on all arms: as many as have the same joints
            again, of those that are whole: {text}."""


def _times(ours: Played, others: Sequence[Played], arms: Sequence[str]) -> Iterable[str]:
    example = chosen(ours, EXAMPLE, arms)
    apart, least = max(s.apart for s in example), max(s.call_us for s in chosen(ours, BEST, arms))
    yield f"""A call of holokin takes {_us(max(s.call_us for s in example))} us as its example, a control step, and
        {_us(least)} us at its best. After the control step, two paths are {apart:.0e} rad apart."""
    for how, text in ((EXAMPLE, "as their examples run them"), (BEST, "at their best")):
        times = {p.entry.name: max(s.call_us for s in rows) for p in others if (rows := chosen(p, how, arms))}
        faster = [f"{name} ({_us(us)} us)" for name, us in times.items() if us < least]
        if times:
            yield f"""The others take {_us(min(times.values()))} to {_us(max(times.values()))} us {text}. Faster than
                holokin at its best: {", ".join(faster) or "none"}."""


def _same_rule(ours: Played, others: Sequence[Played], arms: Sequence[str]) -> Iterable[str]:
    rows = [s for s in ours.scores if s.name == SAME_RULE and not s.unfair]
    if not rows:
        return
    least = max(s.call_us for s in rows)
    times = {
        p.entry.name: max(s.call_us for s in found)
        for p in others
        if (found := chosen(p, BEST, arms)) and max(s.resting for s in found) < NEAR
    }
    faster = [f"{name} ({_us(us)} us)" for name, us in times.items() if us < least]
    yield f"""With the rule of those posture tasks, *stationary posture*, holokin takes {_us(least)} us a call. Of the
        libraries that follow it at their best, faster: {", ".join(faster) or "none"}."""


def _first_calls(played: Sequence[Played]) -> Iterable[str]:
    first = {p.entry.name: max(s.first_seconds for s in p.scores if not s.fault) for p in played if p.scores}
    slow = [f"{name} {seconds:.1f} s" for name, seconds in first.items() if seconds > 0.5]
    if slow:
        yield f"""The first call, with what is compiled for it, is not in these times. It takes up to:
            {", ".join(slow)}; of the others less than 0.5 s."""


# --- docs/league.md: what is measured, the tables, what was run.


def league_text(played: Sequence[Played], cycles: int = courses.CYCLES, dt: float = courses.DT) -> str:
    """The page of what was played."""
    parts = ["# The league of libraries\n", *_head(played, cycles, dt)]
    for arm in arms_of(played):
        start = np.array2string(courses.STARTS[arm], separator=", ")
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


# --- docs/league.png: how far apart the joints are at one pose after two paths, and what a call takes.


LEAST = 1e-16
"""Differences are drawn no farther to the left [rad]: it is round-off."""

TITLES = {"panda": "Panda", "iiwa14": "iiwa 14", "xarm7": "xArm 7"}


def league_figure(played: Sequence[Played]) -> Any:
    """A row a library, the one that returns best on top: its example as a circle, its best setting as a diamond."""
    from matplotlib.figure import Figure

    arms = arms_of(played)
    rows = sorted((p for p in played if any(shown(p, arm) for arm in arms)), key=lambda p: -_nearest(p, arms))
    figure = Figure(figsize=(7.3, 1.75 + 0.36 * len(rows)), layout="constrained")
    panels = figure.subplots(1, len(arms) + 1, sharey=True)
    for axes, arm in zip(panels, [*arms, arms[0]], strict=True):
        for y, p in enumerate(rows):
            points = [(how, s) for how, s in shown(p, arm) if not s.fault]
            _dots(axes, y, p, [(how, s, s.call_us if axes is panels[-1] else max(s.apart, LEAST)) for how, s in points])
        axes.set_xscale("log")
        axes.spines[["top", "right", "left"]].set_visible(False)
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="y", visible=False)
        axes.set_title(TITLES.get(arm, arm), loc="left", fontweight="bold", color=INK)
        axes.set_xlabel("joints apart [rad]")
    for axes in panels[:-1]:
        axes.set_xlim(LEAST / 8, 20)
        axes.set_xticks([1e-15, 1e-10, 1e-5, 1])
    panels[-1].set_title("A call", loc="left", fontweight="bold", color=INK)
    panels[-1].set_xlabel(f"from Python, {TITLES.get(arms[0], arms[0])} [us]")
    panels[0].set_yticks(range(len(rows)), [p.entry.name for p in rows])
    for label in panels[0].get_yticklabels():
        if label.get_text() == OURS.name:
            label.set(fontweight="bold", color=BLUE)
    figure.suptitle("The same tool pose, reached by two paths: the same joints?", x=0.01, ha="left", fontweight="bold")
    _legend(figure, panels[0])
    return figure


def _nearest(p: Played, arms: Sequence[str]) -> float:
    """By what the rows are sorted: the best of a library on the worst of the arms, those with a fair setting first."""
    best = [min((s.apart + 10 * bool(s.unfair) for _, s in shown(p, arm)), default=100.0) for arm in arms]
    return float(np.log10(max(max(best), LEAST)))


def _dots(axes: Any, y: int, p: Played, points: list[tuple[str, Any, float]]) -> None:
    """The settings of one library in one panel, joined by a line."""
    color = BLUE if p.entry == OURS else VERMILLION
    axes.plot([value for *_, value in points], [y] * len(points), color=GREY, lw=1.4, zorder=1)
    for how, s, value in points:
        look = {"facecolors": "white", "edgecolors": color, "linewidths": 1.7} if how == EXAMPLE else {"color": color}
        marker = "X" if s.unfair else "o" if how == EXAMPLE else "D"
        axes.scatter(value, y, marker=marker, s=62 if how == EXAMPLE else 46, zorder=3, **look)
        if how == BOTH:
            axes.scatter(value, y, marker="o", s=150, facecolors="none", edgecolors=color, linewidths=1.4, zorder=2)


def _legend(figure: Any, axes: Any) -> None:
    """What the signs mean."""
    hollow = {"facecolors": "white", "edgecolors": VERMILLION, "linewidths": 1.7}
    axes.scatter([], [], marker="o", s=62, label="as its own example", **hollow)
    axes.scatter([], [], marker="X", s=62, label="so, but not along all paths", **hollow)
    axes.scatter([], [], marker="D", s=46, label="at its best", color=VERMILLION)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, columnspacing=1.2, handletextpad=0.3)
