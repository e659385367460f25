"""The findings of a log's audit in words: what was measured, how sure it is, and what the log does not test."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..types import Vector
from .judge import Homecoming
from .trend import CONFIDENCE, DriftTrend, Trend

if TYPE_CHECKING:
    from .log_audit import Distance, LogAudit

_SURE = f"{100 * CONFIDENCE:.0f} %"


def not_tested(audit: LogAudit) -> list[str]:
    """What the log leaves open, in words."""
    open_ = []
    if audit.by_way is None:
        open_.append("the way back (all cycles run one way)")
    if audit.by_speed is None:
        open_.append("other speeds (all cycles at one speed)")
    if audit.at_crossings is None and audit.cycles.mirror is None:
        open_.append("other ways to a pose within a cycle (the path does not cross itself)")
    return [*open_, "other paths"]


def audit_sentence(audit: LogAudit) -> str:
    """The verdict, what it rests on, and what was not tested."""
    said = {
        Homecoming.COMES_HOME: _same,
        Homecoming.DRIFTS: _drifts,
        Homecoming.ALTERNATES: _alternates,
        Homecoming.CONVERGES: _settles,
        Homecoming.UNDECIDED: _undecided,
    }[audit.verdict](audit)
    return f"{said}. Not tested: {'; '.join(not_tested(audit))}"


def _same(audit: LogAudit) -> str:
    values = [d.value for d in (audit.between, audit.by_way, audit.by_speed, audit.at_crossings) if d is not None]
    count = len(audit.cycles)
    tested = [word for word, d in (("both ways", audit.by_way), ("at all logged speeds", audit.by_speed)) if d]
    tested += ["where the path crosses itself"] if audit.at_crossings is not None else []
    among = f", {' and '.join(tested)}" if tested else ""
    return (
        f"comes home: the joints are the same at equal tool poses in all {count} cycles{among}, within "
        f"{max(values):.2g} rad or m; a drift of {_rate(audit.detectable)} would have shown ({_SURE} confidence)"
    )


def _drifts(audit: LogAudit) -> str:
    trend = audit.leading
    if trend.trend is not Trend.CONSTANT:
        size = f"{audit.largest.max():.3g} in a cycle ({audit.worst_joint})"
        return f"drifts: cycles of one direction leave the joints elsewhere, by {size}, and those back undo it"
    joint = int(np.argmax(np.abs(trend.rate)))
    rate, error = abs(float(trend.rate[joint])), float(trend.rate_error[joint])
    where = f"{audit.robot.joint_names[joint]}, at {100 * audit.cycles.phase[trend.phase]:.0f} % of the cycle"
    text = (
        f"drifts: the joints at equal tool poses move on from cycle to cycle, of late by {rate:.3g} +- {error:.1g} "
        f"a cycle ({where}; {_SURE} confidence)"
    )
    if trend.change <= audit.tolerance:
        text += f"; that is within the tolerance in this log, and beyond it after {audit.tolerance / rate:.0f} cycles"
    if audit.limit is not None and audit.limit_range is not None:
        few, most = audit.limit_range
        text += f"; at this rate {audit.limit[0]} is at its limit after {audit.limit[1]:.0f} more ({few:.0f} to {most:.0f})"
    return text


def _alternates(audit: LogAudit) -> str:
    trend = audit.leading
    where = f"at {100 * audit.cycles.phase[trend.phase]:.0f} % of the cycle"
    return (
        f"alternates: the joints at a tool pose come back every second cycle only, {trend.change:.2g} rad or m apart "
        f"from one cycle to the next ({where}; {_SURE} confidence)"
    )


def _settles(audit: LogAudit) -> str:
    trend = audit.leading
    asked = {"way": audit.by_way, "speed": audit.by_speed, "pass of a crossing": audit.at_crossings}
    differ = [f"the {word} (by up to {d.value:.2g}, {d.joint})" for word, d in asked.items() if d and d.beyond]
    parts = []
    if trend.trend is Trend.DECAYS:
        low, high = trend.ratio_range
        parts.append(
            f"each cycle drifts {trend.ratio:.2g} times ({low:.2g} to {high:.2g}) as far as the one before ({_SURE} "
            "confidence), so the joints at a pose depend on the past until then"
        )
    elif audit.closing is Trend.DECAYS:
        parts.append("the first cycles drift, the last do not")
    else:
        parts.append("cycles of one kind repeat")
    if differ:
        parts.append(f"the joints at a pose depend on {' and '.join(differ)}")
    return f"settles: {'; '.join(parts)}"


def _undecided(audit: LogAudit) -> str:
    trend = audit.leading
    if audit.scatters:
        return (
            f"cannot tell: the joints at equal tool poses differ between cycles by up to {audit.between.value:.2g} "
            f"({audit.between.joint}), more than encoder noise explains, with no trend over the {len(audit.cycles)} cycles"
        )
    if not np.isnan(trend.ratio):
        low, high = trend.ratio_range
        return (
            f"cannot tell: the joints at equal tool poses change by {trend.change:.2g} rad or m over the log, but each "
            f"cycle by {low:.2g} to {high:.2g} times as much as the one before, which may fade, go on or alternate; "
            f"log about {trend.cycles_needed} cycles"
        )
    hidden = f"a drift of up to {_rate(audit.detectable)} may hide"
    if trend.creep > 0.5 * trend.detectable:
        return f"cannot tell: the tool's own path shifts, and {hidden} in the joint motion that goes with it"
    return (
        f"cannot tell: {hidden} in the noise of this log, and {_rate(audit.tolerance)} counts ({_SURE} confidence); "
        f"log about {trend.cycles_needed} cycles, or with less noise"
    )


def _rate(value: float) -> str:
    return f"{value:.2g} rad or m a cycle"


def audit_rows(audit: LogAudit) -> list[tuple[str, str]]:
    """(what, finding) of every question, for people."""
    c, last = audit.cycles, audit.since_start[-1]
    forward = int((c.direction > 0).sum())
    joint = int(np.argmax(np.abs(last)))
    rows = [
        ("log", f"{audit.recording.source}, {len(audit.recording)} samples in {audit.recording.duration:.4g} s"),
        ("task", audit.task.name),
        ("cycles", f"{forward} forward, {len(c) - forward} backward, {c.length:.3g} m each"
         + (f", {c.left_out} that span gaps left out" if c.left_out else "")),
        ("duration of a cycle", f"{_range(c.duration)} s, {_range(c.moving)} s of it moving"),
        ("tool path repeats to", f"{c.residual.max():.2g} m"),
        ("drift of each cycle", f"{_listed(audit.largest)} ({audit.worst_joint})"),
        (f"drift after {len(c)} cycles", f"{abs(last[joint]):.4g} ({audit.robot.joint_names[joint]})"),
        ("noise floor", f"{audit.noise_floor:.2g}, tolerance {audit.tolerance:g} on top"),
        ("drift that would show", f"{_rate(audit.detectable)} ({_SURE} confidence)"),
    ]  # fmt: skip
    for group, trend in audit.trends.items():
        rows.append(("trend" if len(audit.trends) == 1 else f"trend {group}", _trend(trend, c.phase)))
    rows += [
        ("equal poses, between cycles", _said(audit.between, "")),
        ("equal poses, forward and back", _said(audit.by_way, "not tested: all cycles run one way")),
        ("equal poses, fast and slow", _said(audit.by_speed, "not tested: all cycles at one speed")),
        ("equal poses, at crossings", _said(audit.at_crossings, "not tested: the path does not cross itself")),
    ]
    return rows + [("note", note) for note in audit.recording.notes]


def _trend(trend: DriftTrend, phase: Vector) -> str:
    if np.isnan(trend.ratio):
        return trend.trend.value
    low, high = trend.ratio_range
    return (
        f"{trend.trend.value}, from cycle to cycle by the factor {trend.ratio:.3g} ({low:.3g} to {high:.3g}), most at "
        f"{100 * phase[trend.phase]:.0f} % of the cycle"
    )


def _range(values: Vector) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:.3g}" if high - low < 5e-3 * high else f"{low:.3g} to {high:.3g}"


def _listed(values: Vector, most: int = 4) -> str:
    shown = [f"{v:.3g}" for v in values]
    return ", ".join(shown if len(shown) <= 2 * most else [*shown[:most], "...", *shown[-most:]])


def _said(distance: Distance | None, otherwise: str) -> str:
    if distance is None:
        return otherwise
    word = "differ" if distance.beyond else "agree"
    return f"{word}: {distance.value:.2g} ({distance.joint}, at {100 * distance.phase:.0f} % of the cycle)"
