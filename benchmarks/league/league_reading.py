"""What the league found, in sentences that are made of its numbers."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

from benchmarks.league.league_entries import OURS
from benchmarks.league.played import Played
from benchmarks.league.scores import RETURNED, Score, best_of

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
            after another path or another cycle, by {min(unlike):.1e} to {max(unlike):.1e} rad on the worse arm."""
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
            both arms: {told}."""
    unlike = {name: max(s.apart for s in rows) for name, rows in best.items() if name not in alike}
    if unlike:
        told = [f"{n} {apart:.0e}{_alone(best[n], arms)}" for n, apart in sorted(unlike.items(), key=lambda n: n[1])]
        yield f"The others at their best, on the worse arm [rad]: {', '.join(told)}."
    none = [p.entry.name for p in others if p.entry.name not in best]
    if none:
        yield f"Without a setting that kept to all paths: {', '.join(none)}."
    for p in others:
        asked = {s.arm for s in p.scores}
        if lacking := [arm for arm in arms if arm not in asked]:
            yield f"{p.entry.name} has no {' and no '.join(lacking)}."


def _alone(rows: Sequence[Score], arms: Sequence[str]) -> str:
    return "" if len(rows) == len(arms) else f" (on the {rows[0].arm} alone)"


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
        [measured over a whole box](inverse.md#other-libraries-on-two-paths-to-each-pose)."""


def _tours(played: Sequence[Played], arms: Sequence[str]) -> Iterable[str]:
    told = []
    for p in played:
        if rows := chosen(p, BEST, arms):
            counts = [sum(getattr(s, what) for s in rows) for what in ("again", "whole", "tours")]
            told.append((*counts, p.entry.name))
    told.sort(key=lambda row: (-row[0], -row[1], row[3]))
    text = ", ".join(f"{name} {again} of {whole}" for again, whole, _, name in told)
    if told:
        yield f"""Tours at best settings, of {max(row[2] for row in told)} on both arms: as many as have the same joints
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
