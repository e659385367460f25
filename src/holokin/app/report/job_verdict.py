"""The verdict of a job in words, for somebody who signs it: what was run, what holds, what was not tested."""

from __future__ import annotations

from html import escape

import numpy as np

from ...motion.trajectory import Status
from ...robot import without_speed_limit
from .job_result import JobResult, StrategyResult
from .words import ALIKE, stopped

MOST_FINDINGS = 3
"""Findings of a strategy that are told in the verdict; the section on checks has all."""


def verdict_section(result: JobResult) -> list[str]:
    """The verdict as a section of the report."""
    told = "".join(
        f"<li><span class='{'yes' if well else 'no'}'>{escape(f'{name} {text}')}</span> {escape(more)}</li>"
        for name, text, more, well in strategy_verdicts(result)
    )
    untested = "".join(f"<li>{escape(text)}</li>" for text in not_tested(result))
    return [
        "<h2>Verdict</h2>", f"<p>{escape(what_was_run(result))}</p>", f"<ul>{told}</ul>",
        f"<p><b>{escape(whole_verdict(result))}</b></p>", "<p>Not tested:</p>", f"<ul>{untested}</ul>",
    ]  # fmt: skip


def what_was_run(result: JobResult) -> str:
    """Robot, task, path and cycles in a sentence; and that it was computed."""
    length = result.units.said(result.path.length, "m")
    each = "1 cycle" if result.cycles == 1 else f"{result.cycles} cycles"
    way = f"a closed path of {length}, {each}" if result.path.closed else f"an open path of {length}"
    return (
        f"Run: {result.robot.name} ({result.robot.n} joints), {result.task}, along {way}, {result.path.duration:.4g} s "
        "each. All of this was computed; no robot moved."
    )


def whole_verdict(result: JobResult) -> str:
    """Whether all that the job asks for holds."""
    asked = sum(len(s.checks) for s in result.strategies)
    checked = [s for s in result.strategies if s.motion_check is not None]
    if not result.passed:
        failed = [s.name for s in result.strategies if not s.passed] + [one.name for one in result.not_run]
        failed += ["[sheets]"] if result.sheets is not None and not result.sheets.passed else []
        return f"Not all that the job asks for holds: see {', '.join(failed)}."
    if not asked and not checked and result.sheets is None:
        return "The job expects nothing and checks nothing: this is a measurement, no test."
    parts = [f"{asked} expectation{'s' * (asked != 1)}"] if asked else []
    parts += ["the checks of the motion"] if checked else []
    parts += ["the share that sheets are to serve"] if result.sheets is not None else []
    return f"All that the job asks for holds: {' and '.join(parts)}."


def strategy_verdicts(result: JobResult) -> list[tuple[str, str, str, bool]]:
    """(strategy, what it does, more sentences, whether it is well) of each strategy, those that were not run last."""
    found = []
    for s in result.strategies:
        does, _, reach = _returns(result, s).partition(": ")
        parts = [reach[:1].upper() + reach[1:], _limits(result, s), _speeds(result, s), _clearance(result, s)]
        well = s.passed and s.status is Status.COMPLETE and (not result.path.closed or returns(s))
        found.append((s.name, f"{does.rstrip('.')}.", " ".join(filter(None, [*parts, _failed(s)])), well))
    return found + [(one.name, "was not run.", f"{one.reason}.", False) for one in result.not_run]


def returns(strategy: StrategyResult) -> bool:
    """Whether the joints are back at their start after every cycle, within `ALIKE`."""
    each = strategy.cycles.drift_since_start()
    return bool(len(each)) and float(np.abs(each).max()) <= ALIKE


def _returns(result: JobResult, s: StrategyResult) -> str:
    """Whether its joints come back."""
    if s.status is not Status.COMPLETE and s.cycles.status is not Status.COMPLETE:
        return f"did not follow the path to its end: it {stopped(s.cycles)}."
    if not result.path.closed:
        return "follows the path to its end: the path is open, so whether the joints return was not tested."
    unit, factor = result.joint_unit
    end = f"{factor * float(np.abs(s.cycles.drift_since_start()[-1]).max()):.2g} {unit}"
    after = "after the cycle" if result.cycles == 1 else f"after each of {result.cycles} cycles"
    if returns(s):
        back = f"every joint is back at its start, within {factor * ALIKE:.1g} {unit}"
        return f"returns: {after} {back} ({end} at the end)."
    joint = result.robot.joint_names[int(np.argmax(np.abs(s.cycles.drift_since_start()[-1])))]
    return f"does not return: at the end {joint} is {end} from its start."


def _limits(result: JobResult, s: StrategyResult) -> str:
    """Whether the limits of the joints' positions are kept, and which is nearest."""
    robot = result.robot
    Q = np.vstack([walk.q for walk in s.trajectories().values()])
    room = np.minimum(Q - robot.lower, robot.upper - Q).min(axis=0)
    if not np.isfinite(room).any():
        return "The joints have no position limits."
    i = int(np.argmin(room))
    far = result.units.said(abs(float(room[i])), robot.coordinates[i].unit, 3)
    if room[i] < -1e-9:
        return f"{robot.joint_names[i]} is {far} beyond its limit."
    return f"Position limits are kept at all samples; {robot.joint_names[i]} comes nearest, {far} from its limit."


def _speeds(result: JobResult, s: StrategyResult) -> str:
    """Whether the limits of the joints' speeds are kept: of the path as it is asked for, and as it is timed."""
    said = ""
    peak = s.metrics["peak_speed"]
    if np.isfinite(peak):
        kept = "are kept" if peak <= 1 else "are exceeded"
        said = f"Speed limits {kept} at the speed of the path: {peak:.0%} of one at most."
    elif unknown := without_speed_limit(result.robot):
        said = f"Cannot tell whether speed limits are kept: the robot's description has none of {unknown}."
    if s.timed is not None:
        bare = np.isinf(s.timed.limits.velocity)
        names = ", ".join(name for name, none in zip(result.robot.joint_names, bare, strict=True) if none)
        less = f", which has no speed limit of {names}," if names else ""
        said += f" Timed within the limits of [timing]{less} the motion takes {s.timed.duration:.4g} s."
    return said.strip()


def _clearance(result: JobResult, s: StrategyResult) -> str:
    """What the checks of its motion found."""
    report = s.motion_check
    if report is None:
        return ""
    unread = f"Of the distances the checks {report.unread}." if report.unread else ""
    if report.findings:
        some = "; ".join(str(one.printed(result.units)) for one in report.findings[:MOST_FINDINGS])
        more = len(report.findings) - MOST_FINDINGS
        return f"The checks of the motion found: {some}{f'; and {more} more' if more > 0 else ''}. {unread}".strip()
    if unread:
        return unread
    if not report.pairs:
        return "The checks of the motion found nothing; distances were not among them."
    wanted, near = result.units.said(report.wanted, "m", 3), report.nearest
    close = sum(one.wanted < report.wanted for one in report.pairs)
    touch = f"{close} pairs that are always nearer do not touch"
    touch = "1 pair that is always nearer does not touch" if close == 1 else touch
    if near is None:
        return f"No pair was held against the clearance of {wanted}: {touch}."
    least = f"the least distance is {result.units.said(near.least, 'm', 3)}, between {' and '.join(near.pair)}"
    return f"Clearances are kept: {least} ({wanted} wanted){f'; {touch}' if close else ''}."


def _failed(s: StrategyResult) -> str:
    """The expectations that do not hold."""
    failed = [c for c in s.checks if not c.passed]
    units = " (in the units of the job file)" if any(c.metric not in ("completes", "holonomic") for c in failed) else ""
    return f"This fails the job: {'; '.join(c.unmet for c in failed)}{units}." if failed else ""


def not_tested(result: JobResult) -> list[str]:
    """What this run does not say."""
    found = ["other paths, other starts and other speeds than these"]
    if not result.path.closed:
        found.append("whether the joints return: the path is open")
    elif result.one_way:
        found.append(f"whether two ways to one pose end with the same joints: {result.one_way}")
    if all(s.motion_check is None for s in result.strategies):
        found.append("collisions, obstacles, floor, singular postures of the motion: the job has no [checks]")
    elif any(s.followed < 1.0 for s in result.strategies):
        found.append("the rest of the path of a strategy that stopped")
    reports = [s.motion_check for s in result.strategies if s.motion_check is not None]
    left_out = {one.pair for report in reports for one in report.left_out}
    if left_out:
        found.append(f"{len(left_out)} pairs of links whose distances were left out: see the checks of the motion")
    found += dict.fromkeys(remark for report in reports for remark in report.remarks)
    if all(s.timed is None for s in result.strategies):
        found.append("accelerations and jerks: the job has no [timing]")
    if result.sheets is not None and result.sheets.along is not None:
        found.append("the motion over the sheets: [timing] and [checks] are of strategies, and of `holokin export`")
    return [*found, "the controller and the robot: servos, weight, backlash, its own planning"]
