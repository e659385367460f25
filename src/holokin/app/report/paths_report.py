"""The report of a job of several paths: its table, for the terminal and the page, and the folder of its files."""

from __future__ import annotations

from functools import partial
from html import escape
from pathlib import Path as FilePath
from typing import Any

from ...base.errors import brief, posture_text
from ...base.files import write_text
from ...base.types import number_or_none
from ...motion import TimedTrajectory
from .html_page import page
from .job_result import free_name, renewed, write_facts
from .paths_figures import PLAN, ROBOT, motion_figure, motion_words, plan_figure, robot_figure
from .paths_result import PathsResult, RuleResult
from .section import Column, Note, Section, drawn, right


def _columns(result: PathsResult) -> list[Column]:
    unit = result.units.length
    columns: list[Column] = [("path", "left"), ("way there", "left")]
    return [*columns, *right("sheet", "way\n[s]", "path\n[s]", f"length\n[{unit}]", f"clear.\n[{unit}]")]


def _section(result: PathsResult, rule: RuleResult) -> Section:
    """The table of a rule, its sentence, and what was left out."""
    by, table = result.units.factor("m"), []
    digits = 3 if result.units.length == "m" else 1
    for row in rule.rows:
        times = [f"{motion.duration:.2f}" if motion is not None else "-" for motion in (row.air, row.own)]
        sheet, length = (str(row.sheet), f"{by * row.length:.{digits}f}") if row.own is not None else ("-", "-")
        clear = f"{by * row.clearance:.{digits}f}" if row.clearance == row.clearance else "-"
        table.append([brief(row.name), row.way, sheet, *times, length, clear])
    table += [[brief(name), Note("left out", "failed"), *["-"] * 5] for name in rule.left_out]
    tone = "good" if rule.passed else "bad"
    count = len(rule.rows) - any(row.own is None for row in rule.rows)
    done = f"{count} of {count + len(rule.left_out)} paths in {rule.motion.duration:.4g} s. "
    points = [Note(done, tone, f"{rule.sentence}."), *(Note(f"{n}: {why}", "bad") for n, why in rule.left_out.items())]
    points += [] if result.scene is not None else [Note("Nothing was checked: the job has no [checks].", "warning")]
    return Section(rule.name, head=_columns(result), rows=table, points=points)


def print_paths(result: PathsResult, console: Any) -> None:
    """Print the tables of a job of several paths."""
    whole = Section(brief(result.title), parts=[_section(result, rule) for rule in result.rules])
    whole.reworded(result.reworded).rich(console)
    notes = [Note(f"{each.name}: not run: {each.reason}", "bad") for each in result.not_run]
    Section(notes=[*notes, *result.notes]).reworded(result.reworded).rich(console)


def write_paths_report(result: PathsResult, out: FilePath, version: str) -> FilePath:
    """Write `out/<job>/`: report.html, a CSV of the whole motion of each rule, result.json. Raises: as `renewed`."""
    with renewed(out, result.name) as work:
        used: set[str] = set()
        for rule in result.rules:
            name = free_name(rule.name, "-timed.csv", used)
            used.add(name)
            rule.motion.save(work / name, result.units)
        write_text(work / "report.html", _page(result, version))
        write_facts(work, _facts(result, version))
    return out / result.name


def _page(result: PathsResult, version: str) -> str:
    robot, units = result.robot, [c.unit for c in result.robot.coordinates]
    start = posture_text(result.q0 * result.units.factors(units), robot.joint_names)
    whole = "All paths are gone along" if result.passed else "Not all paths are gone along"
    clear = ", and the checks of the motion find nothing." if result.passed and result.scene is not None else "."
    facts = f"{robot.name}, {robot.n} joints ({robot.source}); task: {result.task}; start: {start}. "
    facts += f"holokin {version}, {result.seconds:.1f} s. All of this was computed; no robot moved."
    parts: list[Section | str] = [
        f"<h1>{escape(result.title)}</h1>",
        Section("Verdict", [Note(whole + clear, "strong"), result.about, *result.notes, Note(facts, "small")]),
        *(_section(result, rule) for rule in result.rules),
    ]
    # The robot among the paths, where the model has a tool in space, and the motion over time.
    figures = (
        [] if not result.robot.tips else [(robot_figure, ROBOT)] + [(plan_figure, PLAN)] * (not result.robot.planar)
    )
    for rule in result.rules:
        for draw, caption in (*figures, (motion_figure, motion_words(result))):
            told = caption if len(result.rules) == 1 else f"{rule.name}: {caption}"
            parts.append(Section(figure=drawn(partial(draw, result, rule), told)))
    for rule in result.rules:
        # Of a row the last report is that of the path, the one before it that of the way there.
        checks = []
        for row in rule.rows:
            names = [row.name] if row.own is None else [f"to {row.name}", row.name]
            checks += zip(names[-len(row.reports) :], row.reports, strict=False) if row.reports else []
        points = [
            f"{name}: {'; '.join(report.told(result.units)[:1] + report.notes(result.units)[:1])}"
            for name, report in checks
        ]
        last = [line for row in rule.rows[:1] for line in row.reports[-1].notes(result.units)[1:]] if checks else []
        parts += [Section(f"{rule.name}: checks of the motion", points=[*points, *last])] if checks else []
        parts.append(
            f"<h2>{escape(rule.name)}: the whole motion</h2><pre>{escape(rule.motion.table(result.units))}</pre>"
        )
    if result.not_run:
        parts.append(Section("Not run", points=[f"{each.name}: {each.reason}" for each in result.not_run]))
    told = [part.reworded(result.reworded) if isinstance(part, Section) else part for part in parts]
    return page(result.title, told)


def _facts(result: PathsResult, version: str) -> dict[str, Any]:
    """What result.json says."""
    rules = []
    for rule in result.rules:
        rows = [
            {"name": row.name, "sheet": row.sheet or None, "level": row.level.tolist(), "way": row.way}
            | {"way_s": _seconds(row.air), "path_s": _seconds(row.own), "length_m": row.length}
            | {"clearance": number_or_none(row.clearance), "checks": [report.to_dict() for report in row.reports]}
            for row in rule.rows
        ]
        facts = {"name": rule.name, "passed": rule.passed, "changes": rule.changes, "exact": rule.exact}
        facts |= {"sentence": rule.sentence, "seconds": rule.motion.duration, "left_out": dict(rule.left_out)}
        rules.append(facts | {"paths": rows})
    facts = {"job": result.name, "title": result.title, "passed": result.passed, "robot": result.robot.name}
    facts |= {"task": result.task, "start": result.q0.tolist(), "rules": rules, "notes": list(result.notes)}
    return facts | {"not_run": [vars(each) for each in result.not_run], "seconds": result.seconds, "holokin": version}


def _seconds(motion: TimedTrajectory | None) -> float | None:
    return None if motion is None else motion.duration
