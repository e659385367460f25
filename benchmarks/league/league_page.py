"""The league: which libraries give the same joints at the same pose? Its section of docs/measured.md, and league.png.

Every library is installed into an environment of its own (venv and pip), gets the robots and the paths as files, and
gives its joints back. The same measure is taken of all. What cannot be installed or run is named with the reason.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.league.courses import CORNERS, CYCLES, DT, REACH, TOURS, TURN, write_course
from benchmarks.league.played import ENTRIES, OURS, Played, play
from benchmarks.league.scores import AGAIN, NEAR_MM, NEAR_RAD, RETURNED, Score, best_of
from benchmarks.page import Given, table, versions, wrapped
from holokin.app.report.plots import BLUE, GREY, INK, VERMILLION, write_figure

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


def section(given: Given) -> tuple[list[str], str]:
    """Ask every library, one after the other; the blocks of docs/measured.md, and the versions."""
    cycles, dt, tours = (2, 0.05, 1) if given.quick else (CYCLES, DT, TOURS)
    with tempfile.TemporaryDirectory() as folder:
        home, found = given.answers or Path(folder), []
        if not (home / "course" / "course.json").exists():
            write_course(home / "course", cycles=cycles, dt=dt, tours=tours)
        for entry in [OURS] if given.quick else ENTRIES:
            print(f"{entry.name} ...", flush=True)
            found.append(play(entry, home / "course", given.environments, home / entry.name))
            print(f"  {found[-1].left_out or f'{len(found[-1].scores)} answers'}", flush=True)
    write_figure(lambda: league_figure(found), given.out / "league.png")
    return league_text(found, cycles, dt), f"{versions()}, and those named below"


# --- The words, and the table.


def league_text(played: Sequence[Played], cycles: int = CYCLES, dt: float = DT) -> list[str]:
    """The blocks of the page."""
    box, turn = " x ".join(f"{2 * reach:g}" for reach in REACH), f"{np.degrees(TURN):.0f}"
    arms = arms_of(played)
    head = ("library", "as its example: apart", "tool", "a call", *(f"best: {TITLES[a]}" for a in arms))
    blocks = [
        "## League",
        wrapped(
            f"""Which libraries give the same joints at the same tool pose, and what does a call take? Each library
            runs in an environment of its own, in a script without holokin. Every {dt} s it is given the next pose of
            the tool, and the twist if it takes one, and gives joints back; the robot is where its last answer put it.
            The paths are those of [drift](#drift), {cycles} cycles each. Then come {TOURS} tours of two rounds:
            straight legs through {CORNERS} poses and back, drawn at random in a box of {box} m about the start and
            turned by up to {turn} degrees. One measure, from the joints alone, is taken of all."""
        ),
        *(wrapped(words) for words in reading(played)),
        "![How far apart the joints are at one tool pose that was reached by two paths](league.png)",
        wrapped(
            f"""*As its example*: with the tasks, gains, seeds and solvers of an example of the library itself, our
            start as the posture of a posture task. *At its best*: of all settings that were tried, the fastest whose
            joints return within {RETURNED:g} rad on this arm, or else the one that is least apart. It must answer
            every call, keep the tool within {NEAR_MM:g} mm and {NEAR_RAD:g} rad of the path, and the joints within
            their limits of place and speed. *Apart*: the difference of the joints [rad] opposite the start, reached by
            two paths, or after the last cycle, whichever is larger; the worst of the arms. *Tours*: in how many the
            second round has the joints of the first, within {AGAIN:g} rad, of those that are whole, on all arms. *A
            call*: from Python [us], of the slowest arm."""
        ),
        table((*head, "tours", "a call", "settings"), map(_cells, played, [arms] * len(played))),
        wrapped(
            f"""Versions, and the best settings: {"; ".join(_settings(played, arms))}. Where the examples come from,
            and all settings, stands in `benchmarks/league/workers/libraries.py`."""
        ),
    ]
    left = [f"{p.entry.name} ({p.left_out})" for p in played if p.left_out]
    return [*blocks, wrapped(f"Not played, or not to the end: {', '.join(left)}.")] if left else blocks


def _cells(p: Played, arms: Sequence[str]) -> list[str]:
    example, best = chosen(p, EXAMPLE, arms), chosen(p, BEST, arms)
    by_arm = {s.arm: s for s in best}
    faults = dict.fromkeys(s.unfair for s in example if s.unfair not in ("", "off the path"))
    tool = f"{max((s.tracking for s in example), default=np.nan):.2g} mm"
    counts = [sum(getattr(s, what) for s in best) for what in ("again", "whole")]
    cells = [p.entry.name, f"{max((s.apart for s in example), default=np.nan):.0e}", ", ".join([tool, *faults])]
    cells += [_us(max((s.call_us for s in example), default=np.nan))]
    cells += [f"{by_arm[arm].apart:.0e}" if arm in by_arm else "-" for arm in arms]
    return [*cells, f"{counts[0]} of {counts[1]}", _us(max((s.call_us for s in best), default=np.nan)),
            str(len({s.name for s in p.scores}))]  # fmt: skip


def _settings(played: Sequence[Played], arms: Sequence[str]) -> Iterator[str]:
    for p in (p for p in played if p.scores):
        best = " or ".join(dict.fromkeys(s.name for s in chosen(p, BEST, arms)))
        yield f"{', '.join(f'{n} {v}' for n, v in p.versions.items())} ({best or 'none'})"


def _us(value: float) -> str:
    return f"{value:.3g}" if value < 100 else f"{value:,.0f}" if np.isfinite(value) else "-"


def reading(played: Sequence[Played]) -> Iterator[str]:
    """Paragraphs of what the numbers say."""
    arms = arms_of(played)
    others = [p for p in played if p.entry != OURS and p.scores]
    shown_rows = {p.entry.name: rows for p in others if (rows := chosen(p, EXAMPLE, arms))}
    apart = {name: max(s.apart for s in rows) for name, rows in shown_rows.items()}
    unlike = [value for value in apart.values() if value >= RETURNED]
    if unlike:
        yield f"""As their examples run them, {len(unlike)} of {len(apart)} libraries have other joints at one pose
            after another path or another cycle, by {min(unlike):.0e} to {max(unlike):.0e} rad."""
    best = {p.entry.name: rows for p in others if (rows := chosen(p, BEST, arms))}
    alike = [n for n, rows in best.items() if len(rows) == len(arms) and max(s.apart for s in rows) < RETURNED]
    times = {name: max(s.call_us for s in rows) for name, rows in best.items()}
    if alike:
        told = ", ".join(f"{name} ({_us(times[name])} us)" for name in sorted(alike, key=lambda name: times[name]))
        yield f"""At their best these return as holokin does, within {RETURNED:g} rad on all arms: {told}. So a library
            that you use already may do, if it is asked for it: a posture task of full gain takes the whole error of its
            posture out of the null space in each step, and several steps a sample bring it up to date. That is the rule
            of our strategy *stationary posture*. A solver that starts from one seed each time remembers nothing, and
            returns too; it jumps where its search ends elsewhere."""
    for p in (p for p in played if p.entry == OURS and p.scores):
        least = max(s.call_us for s in chosen(p, BEST, arms))
        step = max(s.call_us for s in chosen(p, EXAMPLE, arms))
        faster = ", ".join(f"{name} ({_us(t)} us)" for name, t in times.items() if t < least)
        told = f"""A call of holokin takes {_us(step)} us as a control step and {_us(least)} us from pose to joints;
            faster at their best: {faster or "none"}."""
        if rows := [s for s in p.scores if s.name == SAME_RULE and not s.unfair]:
            same = max(s.call_us for s in rows)
            those = {n: t for n, t in times.items() if max(s.resting for s in best[n]) < NEAR and t < same}
            faster = ", ".join(f"{name} ({_us(t)} us)" for name, t in those.items())
            told += f""" With the rule of those posture tasks it takes {_us(same)} us; faster with that rule:
                {faster or "none"}."""
        yield told


# --- league.png: how far apart the joints are at one pose after two paths, and what a call takes.


LEAST = 1e-16
"""Differences are drawn no farther to the left [rad]: it is round-off."""

TITLES = {"panda": "Panda", "iiwa14": "iiwa 14", "xarm7": "xArm 7"}


def league_figure(played: Sequence[Played]) -> Any:
    """A row a library, the one that returns best on top: its example as a circle, its best setting as a diamond."""
    from matplotlib.figure import Figure

    arms = arms_of(played)
    rows = sorted((p for p in played if any(shown(p, arm) for arm in arms)), key=lambda p: -_nearest(p, arms))
    figure = Figure(figsize=(9.0, 1.75 + 0.36 * len(rows)), layout="constrained")
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
    panels[-1].set_xlabel(f"{TITLES.get(arms[0], arms[0])} [us]")
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
