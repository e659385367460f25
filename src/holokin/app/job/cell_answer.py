"""What became of a cell, in six sentences: verdict, what was read, clearance, proof, program, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.design import Advice
from ...base.types import Value
from ...base.units import PrintedUnits
from ...export import LANGUAGES, Program
from ...motion import TimedTrajectory
from ...motion.checks import CheckReport
from ...proof import Certificate, WholeArm
from ...proof.recheck import CheckerWord, Outcome
from ...strategies.tasks.task import Task
from ..report.job_result import JobResult
from ..report.paths_report import PathsResult
from .cell_job import CellJob

SAMPLES = 400
"""Samples of a motion at which the speed of its tool is looked at."""

STOP, NEARLY = 5e-3, 0.99
"""Shares of the wanted speed below which the tool stands still, and above which nobody sees that it is slower."""


@dataclass(frozen=True, eq=False)
class Outcomes(Value):
    """The motion of a cell: timed, None where it does not come to its end; what checks find on its parts, by name.

    own: the motions along the paths alone, without the ways between them. left: path -> why it is not gone along.
    count: of all paths.
    """

    timed: TimedTrajectory | None
    own: tuple[TimedTrajectory, ...]
    reports: tuple[tuple[str, CheckReport], ...]
    left: Mapping[str, str]
    count: int

    @classmethod
    def of(cls, result: JobResult | PathsResult) -> Outcomes:
        """Those of the first rule of a job."""
        if isinstance(result, PathsResult):
            rule = result.rules[0]
            reports = [(row.name, report) for row in rule.rows for report in row.reports]
            count = sum(row.own is not None for row in rule.rows) + len(rule.left_out)
            own = tuple(row.own for row in rule.rows if row.own is not None)
            return cls(rule.motion, own, tuple(reports), rule.left_out, count)
        (one, *_) = result.strategies
        checked = () if one.motion_check is None else (("", one.motion_check),)
        left = {} if one.timed is not None else {"the path": one.trouble or one.status.value}
        return cls(one.timed, () if one.timed is None else (one.timed,), checked, left, 1)

    @property
    def clear(self) -> bool:
        """Whether checks find nothing."""
        return all(report.passed for _, report in self.reports)

    def speed(self, task: Task) -> float:
        """The greatest speed of the tool on the paths [m/s]."""
        greatest = 0.0
        for timed in self.own:
            some = np.unique(np.linspace(0, len(timed) - 1, SAMPLES).astype(int))
            moves = [i for i, row in enumerate(task.rows) if row < 3]
            J = task.jacobian_batch(timed.q[some])[0][:, moves]
            greatest = max(greatest, float(np.linalg.norm(np.einsum("kmn,kn->km", J, timed.dq[some]), axis=1).max()))
        return greatest


def verdict(cell: CellJob, advice: Advice | None, outcomes: Outcomes) -> str:
    """Whether the arm does it, by which rule, and why by this one."""
    done, arm = outcomes.count - len(outcomes.left), cell.robot.name
    if advice is None:
        joints = cell.task.n
        why = f"with {joints} joints for {joints} numbers no joint is to spare, so that no rule is needed"
    else:
        best, count = advice.best, len(advice.strategies)
        why = f"{_rule(best.keys)} (rule {best.name!r}), since of {count} rules it does best: "
        why += best.sentence.replace("the workspace", "the poses on the way")
    paths = "the path" if outcomes.count == 1 else f"all {outcomes.count} paths"
    if not outcomes.left:
        return f"{'Yes' if outcomes.clear else 'Not yet'}: {arm} goes along {paths}; {why}."
    reasons = "; ".join(f"{name}: {reason}" for name, reason in outcomes.left.items())
    if done == 0:
        return f"No: {arm} does not go along {paths} ({reasons}); {why}."
    return f"In part: {arm} goes along {done} of {outcomes.count} paths, without {reasons}; {why}."


def _rule(keys: Mapping[str, Any]) -> str:
    """What a rule does with the joints that the task leaves free, as one would tell the operator."""
    kind, base = keys["kind"], keys.get("base", keys)
    joints = list(map(str, base.get("joints", [])))
    held, plural = " and ".join(joints), len(joints) != 1
    if kind == "lock":
        return f"{held} {'stay where they are' if plural else 'stays where it is'}"
    if kind == "designed":
        return f"{held or 'the free joints'} follow{'' if plural else 's'} the tool by a formula"
    if kind == "height":
        return f"{held} keep{'' if plural else 's'} the height"
    if kind == "arm-angle":
        return "the elbow keeps its angle about the line from shoulder to wrist"
    return "the free joints follow the tool"


def what_was_read(cell: CellJob, units: PrintedUnits) -> str:
    """The file, and what was noted of it or assumed."""
    read = cell.read
    points = sum(len(path) for path in read.paths)
    paths = "1 path" if len(read) == 1 else f"{len(read)} paths"
    notes = dict.fromkeys([*read.notes, *(note for path in read.paths for note in path.notes), *cell.assumed])
    above = f"the tool comes and goes {units.factor('m') * cell.retract:g} {units.name('m')} above it"
    told = "; ".join([*notes, *([above] if cell.retract else [])])
    return f"Read: {FilePath(read.file).name} as {read.kind}, {paths} of {points} points; {told}."


def clearance(outcomes: Outcomes, units: PrintedUnits) -> str:
    """What is nearest, where and when; or what is not clear."""
    for name, report in outcomes.reports:
        if not report.passed:
            on = f" on {name}" if name else ""
            return f"Not clear{on}: {report.told(units)[0]}."
    far = "" if outcomes.timed is not None else " up to where it stops"
    every = [report.remarks for _, report in outcomes.reports]
    remarks = [remark for remark in (every[0] if every else ()) if all(remark in own for own in every)]
    unseen = dict.fromkeys(link.link for _, report in outcomes.reports for link in report.unseen)
    more = [*remarks, *([f"without a shape: {', '.join(unseen)}"] if unseen else [])]
    told = "".join(f"; {words}" for words in more)
    seen = [(name, report) for name, report in outcomes.reports if np.isfinite(report.clearance)]
    if not seen:
        kept = "within limits, on the paths away from singular postures"
        return f"Clear{far}: {kept}, but no two shapes were held apart{told}."
    name, report = min(seen, key=lambda pair: pair[1].clearance)
    if (near := report.nearest) is None:  # its clearance is finite, so there is one
        return ""
    least = f"{units.factor('m') * near.least:.4g} {units.name('m')}"
    on = f" on {name}" if name else ""
    return (
        f"Clear{far}: within limits, on the paths away from singular postures, and nothing comes nearer than {least} "
        f"({' and '.join(near.pair)}, at {near.time:.3g} s{on}){told}."
    )


def proof(
    certificates: Mapping[str, Certificate | WholeArm | str], words: Mapping[str, CheckerWord]
) -> tuple[bool, str]:
    """Whether the joints are shown to return with the tool, and why not."""
    missing = {label: one for label, one in certificates.items() if isinstance(one, str) or not one.whole}
    rejected = [label for label, word in words.items() if word.outcome is Outcome.REJECTED]
    if rejected:
        return False, f"Not proven: the checker rejects the certificate of {', '.join(rejected)}."
    if missing or not certificates:
        reasons = [one.returning if isinstance(one, Certificate) else str(one) for one in missing.values()]
        return False, f"Not proven: {'; '.join(dict.fromkeys(reasons)) or 'there is no certificate'}."
    # What the certificates are about: some ask for less.
    cells = [one for one in certificates.values() if isinstance(one, Certificate)]
    limits = ["within the limits"] * all(one.limits is not None for one in cells)
    kept = " and ".join([*limits, *["clear"] * all(one.demands.clear is not None for one in cells)])
    places = "the path" if len(certificates) == 1 else "each path"
    between = "" if len(certificates) == 1 else " (the ways between them are checked at their samples)"
    verified = all(word.outcome is Outcome.VERIFIED for word in words.values())
    checked = "a second program has verified it" if verified else "the checker has not verified it"
    return True, (
        f"Proven: at every place of {places}, not at samples alone, there is one posture{kept and f', {kept}'}, and "
        f"wherever the tool comes back on it, so do the joints{between}; {checked}."
    )


def program_words(
    language: str, guessed: bool, file: FilePath, program: Program, outcomes: Outcomes, task: Task, units: PrintedUnits
) -> str:
    """Which program was written for which controller, its cycle time and its speed."""
    controller = LANGUAGES[language].controller
    chosen = " (the name of the arm tells no controller: --language takes another)" if guessed else ""
    seconds = sum(timed.duration for timed in (outcomes.timed,) if timed is not None)
    speed = f"{units.factor('m') * outcomes.speed(task):.3g} {units.name('m')}/s"
    return (
        f"Program: {file} for {controller}{chosen}: {seconds:.1f} s, the tool at up to {speed}{_slower(outcomes)}; "
        f"{program.targets} targets."
    )


def _slower(outcomes: Outcomes) -> str:
    """Where the tool is slower than asked for between its ends, and why; "" where it is not."""
    corners = sum(len(timed.stops) for timed in outcomes.own)
    inside = [slow for timed in outcomes.own for slow in timed.slowdowns if slow.least > STOP]
    words = f", with {corners} stop{'s' * (corners > 1)} at corners (blend in [path] rounds them)" if corners else ""
    if not inside or (worst := min(inside, key=lambda slow: slow.least)).least > NEARLY:
        return words
    reason = f"the {worst.limit} of {worst.joint}" if worst.joint else f"the shape of the {worst.limit}"
    return f"{words}, down to {worst.least:.0%} of what is asked at {worst.start:.1f} s for {reason}"


def next_step(
    cell: CellJob, file: FilePath, outcomes: Outcomes, written: bool, proven: bool, units: PrintedUnits
) -> str:
    """What to do next: about what is missing, else at the robot; and what limits the motion."""
    if outcomes.left:
        where = cell.beyond or "move the part"
        return f"Next: {where}, or change [task], [start] or the tool in {file}, and run it again."
    if not outcomes.clear:
        return f"Next: move the part or what stands there, or allow the pair, in [checks] of {file}; then run it again."
    if not written:
        return f"Next: give [program] of {file} what is missing, or another --language, and export it again."
    load = min((timed.nearest_limit for timed in outcomes.own), key=lambda load: load.distance).printed(units)
    near = (
        f"{load.joint} comes within {load.distance:.3g} {load.unit} of its limit" if np.isfinite(load.distance) else ""
    )
    first = "" if proven else "what is not proven was checked at the samples of the motion alone; "
    return (
        f"Next: {first}compare the first target with the pendant, then run slowly with the process off"
        f"{f'; {near}, the nearest' if near else ''}."
    )
