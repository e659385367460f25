"""Writing a job's folder: report.html (self-contained), figures, trajectories, result.json; whole or not at all."""

from __future__ import annotations

import base64
from collections.abc import Callable
from html import escape
from pathlib import Path as FilePath
from typing import Any, Literal, NamedTuple

import numpy as np

from ...analysis.sheets import write_sheets
from ...base.errors import brief, posture_text
from ...base.files import write_text, writing
from ...base.units import PrintedUnits
from ...motion import TimedTrajectory
from ...motion.checks import CheckReport, Finding
from ...motion.trajectory import Status
from ...robot import without_speed_limit
from .html_page import html_table, page, svg_figure
from .job_figures import figures
from .job_result import JobResult, SheetsResult, StrategyResult, renewed, write_facts
from .plots import ALIKE, BAD, GOOD, HOLONOMIC_TEXT, WARNING, check_words, paths_words, speed_warning, stopped

# --------------------------------------------------------------------------------------------------
# What the checks of a job found, as a section of its report.
# --------------------------------------------------------------------------------------------------

MOST_ROWS = 200
"""Findings in a report; result.json has them all."""

_HEAD = ["finding", "of", "from [s]", "to [s]", "worst at [s]", "value", "wanted"]


def _check_section(result: JobResult, table: Callable[[list[str], list[list[str]]], str]) -> list[str]:
    """Findings, distances and what was not looked at, by strategy; nothing in a job without [checks]."""
    parts = []
    for strategy in result.strategies:
        if strategy.motion_check is not None:
            parts += [f"<h3>{escape(strategy.name)}</h3>", *_told(result, strategy, strategy.motion_check, table)]
    return ["<h2>Checks of the motion</h2>", *parts] if parts else []


def _told(
    result: JobResult, strategy: StrategyResult, report: CheckReport,
    table: Callable[[list[str], list[list[str]]], str],
) -> list[str]:  # fmt: skip
    """The findings as a table, and the other lines of the report as a list."""
    lines = "".join(f"<li>{escape(line)}</li>" for line in report.notes(result.units))
    found = table(_HEAD, [_row(one.printed(result.units)) for one in report.findings[:MOST_ROWS]])
    mark = "yes" if strategy.followed == 1.0 else "no"
    said = [f"<p class='{mark}'>{escape(text)}</p>" for text in [check_words(strategy)] if text]
    said += [f"<p class='no'>{escape(report.unread)}</p>"] if report.unread else []
    return [*([found] if report.findings else []), *said, f"<ul class='small'>{lines}</ul>"]


def _row(one: Finding) -> list[str]:
    unit = f" {one.unit}" if one.unit else ""
    sign = "at least" if one.is_least else "limit"
    return [
        f"<span class='no'>{escape(one.kind.value)}</span>", escape(" and ".join(one.what)), f"{one.start:.3f}",
        f"{one.stop:.3f}", f"{one.time:.3f}", f"{one.value:.4g}{unit}", f"{sign} {one.limit:.4g}{unit}",
    ]  # fmt: skip


# --------------------------------------------------------------------------------------------------
# What a job found of its [sheets], as a section of its report.
# --------------------------------------------------------------------------------------------------


def _sheets_section(result: SheetsResult | None) -> list[str]:
    """What the sheets serve, and what became of the job's path; nothing in a job without [sheets]."""
    if result is None:
        return []
    mark = "yes" if result.passed else "no"
    first, *lines = [line for line in result.map_lines() if line != result.verdict]
    parts = [
        "<h2>Sheets</h2>",
        f"<p>{escape(first)}.</p>",
        _listed(lines),
        f"<p class='{mark}'>{escape(result.verdict)}</p>",
        f"<p class='small'>{escape(str(result.found.workspace))}; {len(result.found.poses)} poses sampled.</p>",
    ]
    path = result.path_lines()
    return parts + ([f"<p>{escape(path[0])}.</p>", _listed(path[1:])] if path else [])


def _listed(lines: list[str]) -> str:
    """Lines as a list; nothing of none."""
    items = "".join(f"<li>{escape(line.strip())}</li>" for line in lines)
    return f"<ul class='small'>{items}</ul>" if items else ""


# --------------------------------------------------------------------------------------------------
# The table of a job, for the terminal and the report.
# --------------------------------------------------------------------------------------------------

NOTHING = 1e-18
"""Size [any unit] below which a figure is 0: differences of doubles over 0.01 are at least that."""


def number(value: float) -> str:
    """Three digits; a dash where there is none, 0 for what is below all round-off."""
    if not np.isfinite(value):
        return "-"
    if abs(value) < NOTHING:
        value = 0.0
    return f"{value:.3f}" if 1e-2 <= abs(value) < 100 else f"{value:.1e}"


Column = tuple[str, Literal["left", "right"]]
"""Heading and alignment."""


class _Column(NamedTuple):
    heading: str
    cell: Callable[[StrategyResult], str]
    side: Literal["left", "right"] = "right"


def _columns(result: JobResult) -> list[_Column]:
    """The columns; clearance and share of the workspace in a job that has them."""

    def figure(key: str, form: Callable[[float], str] = number) -> Callable[[StrategyResult], str]:
        by = result.factor(key)
        return lambda s: form(by * s.metrics[key]) if np.isfinite(s.metrics[key]) else "-"

    joints, task = result.joint_unit[0], result.row_unit[0]
    looked_at = any(np.isfinite(s.metrics["clearance"]) for s in result.strategies)
    narrow = result.workspace or looked_at
    found = [
        _Column("strategy", lambda s: s.name, "left"),
        _Column("verdict", lambda s: "holonomic" if s.verdict.holonomic else "NOT holonomic", "left"),
        _Column(f"drift / cycle\n[{joints}]", figure("drift_mean")),
        _Column(f"two paths\napart [{joints}]" if narrow else f"two paths apart\n[{joints}]", figure("spread")),
        _Column(f"tracking\n[{task}]", figure("tracking")),
        _Column("sigma\nmin", figure("sigma")),
        _Column("speed\n/ MP", figure("speed", "{:.3f}".format)),
        _Column("peak\nspeed", figure("peak_speed")),
    ]
    unit = result.units.length
    clear = figure("clearance", number if unit == "m" else "{:.1f}".format)
    found += [_Column(f"clear.\n[{unit}]", clear)] if looked_at else []
    found += [_Column("work-\nspace", figure("coverage", "{:.1%}".format))] if result.workspace else []
    return [*found, _Column("expected", _expected, "left")]


def _expected(s: StrategyResult) -> str:
    return "FAILED" if not s.passed else "ok" if s.checks or s.motion_check is not None else "-"


def columns(result: JobResult) -> list[Column]:
    """Heading, with its unit, and alignment of each column."""
    return [(column.heading, column.side) for column in _columns(result)]


def rows(result: JobResult) -> list[list[str]]:
    """The cells of every strategy: those that could not be run last."""
    shown = _columns(result)
    failed = [[one.name, "NOT run", *["-"] * (len(shown) - 3), "FAILED"] for one in result.not_run]
    return [*([column.cell(s) for column in shown] for s in result.strategies), *failed]


def remarks(result: JobResult) -> list[tuple[str, str]]:
    """(strategy, sentence) of all that the table does not tell: what was not run, what stopped, what is too fast."""
    found = [(one.name, f"not run: {one.reason}") for one in result.not_run]
    found += [(s.name, text) for s in result.strategies for text in (s.trouble, speed_warning(result, s))]
    return [(name, text) for name, text in found if text]


def print_result(result: JobResult, console: Any) -> None:
    """Print a job's table, and below it what failed."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(brief(result.title)), title_justify="left", title_style="bold", header_style="dim")
    for heading, justify in columns(result):
        table.add_column(Text(heading), justify=justify, no_wrap=heading != "strategy")
    colors = {"holonomic": HOLONOMIC_TEXT, "NOT holonomic": BAD, "ok": GOOD}
    colors |= dict.fromkeys(("NOT run", "FAILED"), f"bold {BAD}")
    for cells in rows(result):
        table.add_row(*(Text(brief(cell), style=colors.get(cell, "")) for cell in cells))
    console.print(table)
    if paths_words(result):
        console.print(f"  {paths_words(result)}", markup=False, highlight=False)
    for name, text in remarks(result):
        console.print(f"  {brief(name)}: {text}", style=WARNING, markup=False, highlight=False)
    if result.sheets is not None:
        console.print("  sheets:", markup=False, highlight=False)
        for line in [*result.sheets.map_lines(), *result.sheets.path_lines()]:
            wrong = line == result.sheets.verdict and not result.sheets.passed
            console.print(f"    {brief(line, 300)}", style=BAD if wrong else None, markup=False, highlight=False)
    for strategy in result.strategies:
        if strategy.timed is not None:
            console.print(f"  {brief(strategy.name)}, timed:", markup=False, highlight=False)
            for line in strategy.timed.table(result.units).splitlines():
                console.print(f"    {brief(line)}", markup=False, highlight=False)
        if strategy.motion_check is not None:
            console.print(f"  {brief(strategy.name)}, checked:", markup=False, highlight=False)
            told = strategy.motion_check.table(result.units).splitlines()
            said = [text for text in [check_words(strategy)] if text]
            for line in [*said, *told[strategy.motion_check.passed :]]:
                console.print(f"    {brief(line)}", markup=False, highlight=False)
        for check in strategy.checks:
            if not check.passed:
                text = f"  {brief(strategy.name)}: {check.unmet}"
                console.print(text, style=BAD, markup=False, highlight=False)


# --------------------------------------------------------------------------------------------------
# The verdict of a job in words, for somebody who signs it: what was run, what holds, what was not
# tested.
# --------------------------------------------------------------------------------------------------

MOST_FINDINGS = 3
"""Findings of a strategy that are told in the verdict; the section on checks has all."""


def _verdict_section(result: JobResult) -> list[str]:
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


RETURNS = ", returns"
"""Beside a drift that is none."""

_DRIFTS = ("drift", "drift_mean", "drift_total", "drift_least", "drift_most")
"""Metrics that say whether the joints return."""

NOTHING_MOVES = 1e-9
"""Peak of a rate [joint units / s, s^2, s^3] that is shown as 0."""

_TERMS = {
    "Holonomic": (
        "small closed paths of the tool bring the joints back to their start. In a region of tool poses around the "
        "start the same pose then has the same joints; holokin certify tells whether a box is such a region."
    ),
    "Leaf": "all the postures at which the rule of a holonomic law has one value. Several may have the same tool pose.",
    "Drift": "how far the joints are, at the end of a cycle, from where they were at its beginning.",
    "Two paths apart": (
        "how much the joints differ when the tool comes to the same pose by half a loop clockwise, and by half a loop "
        "counter-clockwise; a dash where the path has no two paths, or a path was not gone to its end."
    ),
    "Tracking": "the largest distance of the tool from its path.",
    "Sigma min": "the least singular value of the task Jacobian: at zero the tool cannot move in some direction.",
    "Speed / MP": "joint speed over that of the pseudo-inverse (Moore-Penrose), which is the least.",
    "Peak speed": "the greatest joint speed over that joint's limit.",
    "Curvature (in the details: defect)": (
        "how far a small loop of the tool takes the joints from their start, for the area of the loop. Zero: holonomic."
    ),
    "Witness": "the posture, of those that were tested, where the curvature is largest.",
}
"""Terms of the table and the verdicts, each with what it means."""


def write_report(
    result: JobResult, out: FilePath, version: str, extra: Callable[[FilePath], list[tuple[str, str]]] | None = None
) -> FilePath:
    """Write `out/<job>/` and return it; `extra` may add films, and returns their names and captions.

    A folder of an earlier run is replaced whole; what others have put into it stays, see `renewed`.

    Raises:
        ArgumentError: the folder exists and was not written by holokin, or cannot be made.
        WriteError: the system refuses a file, which it names; an earlier run's folder stands as it was.
    """
    with renewed(out, result.name) as work:
        _fill(result, work, version, extra(work) if extra is not None else [])
        write_facts(work, _facts(result, version))
    return out / result.name


def _fill(result: JobResult, folder: FilePath, version: str, films: list[tuple[str, str]]) -> None:
    shown: list[tuple[str, str]] = []
    for stem, caption, figure in figures(result):
        with writing(folder / f"{stem}.png"):
            figure.savefig(folder / f"{stem}.png", dpi=130, facecolor="white")
        with writing(folder / f"{stem}.svg"):
            figure.savefig(folder / f"{stem}.svg", dpi=130, facecolor="white", metadata={"Date": None})
        shown.append((stem, caption))
    for strategy in result.strategies:
        for key, walk in strategy.trajectories().items():
            walk.save(folder / f"{result.stems[strategy.name]}-{key}.csv", result.units)
        if strategy.timed is not None:
            strategy.timed.save(folder / f"{result.stems[strategy.name]}-timed.csv", result.units)
        if strategy.coverage is not None:
            strategy.coverage.save(folder / f"{result.stems[strategy.name]}-workspace.csv")
    if result.sheets is not None:
        write_sheets(result.sheets.found, folder / "sheets.npz")
        for name, walk in result.sheets.motions.items():
            walk.save(folder / f"{name}.csv", result.units)
    write_text(folder / "report.html", _page(result, folder, shown, films, version))


def _facts(result: JobResult, version: str) -> dict[str, Any]:
    """What result.json says."""
    return {
        "job": result.name, "title": result.title, "passed": result.passed, "robot": result.robot.name,
        "robot_source": result.robot.source, "task": result.task, "start": result.q0.tolist(),
        "joint_names": list(result.robot.joint_names), "workspace": result.workspace or None,
        "path_length_m": result.path.length,
        "sheets": result.sheets.to_dict() if result.sheets is not None else None,
        "two_paths": paths_words(result) or "compared",
        "path_duration_s": result.path.duration, "cycles": result.cycles, "seconds": result.seconds,
        "holokin": version, "strategies": [s.to_dict() for s in result.strategies],
        "not_run": [vars(one) for one in result.not_run],
    }  # fmt: skip


def _page(
    result: JobResult, folder: FilePath, shown: list[tuple[str, str]], films: list[tuple[str, str]], version: str
) -> str:  # fmt: skip
    robot = result.robot
    units = [c.unit for c in robot.coordinates]
    start = posture_text(result.q0 * result.units.factors(units), robot.joint_names)
    verdicts = [(escape(s.verdict.sentence), escape(s.verdict.told(robot.joint_names))) for s in result.strategies]
    parts = [
        f"<h1>{escape(result.title)}</h1>",
        *_verdict_section(result),
        f"<p>{escape(' '.join(result.about.split()))}</p>",
        f"<p class='small'>{escape(robot.name)}, {robot.n} joints ({escape(robot.source)}); "
        f"task: {escape(result.task)}; path {result.units.said(result.path.length, 'm')} in "
        f"{result.path.duration:.4g} s, "
        f"{result.cycles} cycle(s); start: {escape(start)} "
        f"[{' or '.join(map(result.units.name, dict.fromkeys(units)))}]. "
        f"holokin {escape(version)}, {result.seconds:.1f} s.</p>",
        "<h2>Verdicts and numbers</h2>",
        html_table(
            [escape(title) for title, _ in columns(result)], [[_cell(c) for c in cells] for cells in _rows(result)]
        ),
        f"<p class='small'>{escape(_tolerance(result))}</p>",
        "<ul>",
        *(
            f"<li>{told}.<details class='small'><summary>Details</summary>{shown}</details></li>"
            for told, shown in verdicts
        ),
        *(f"<li class='no'>{escape(name)}: {escape(text)}</li>" for name, text in remarks(result)),
        "</ul>",
        *([f"<p>{escape(paths_words(result))}</p>"] if paths_words(result) else []),
        *_terms(),
        *_coverage(result),
        *_timing(result),
        *_check_section(result, html_table),
        *_sheets_section(result.sheets),
        "<h2>Figures</h2>",
        *(_film(folder / name, caption) for name, caption in films),
        *(_figure(folder, stem, caption) for stem, caption in shown),
        "<h2>Everything measured</h2>",
        _all_figures(result),
        "<h2>Expectations</h2>",
        _expectations(result),
    ]
    return page(result.title, parts)


def _rows(result: JobResult) -> list[list[str]]:
    """The cells of the table; where the joints come back it says so."""
    place = next(k for k, (title, _) in enumerate(columns(result)) if title.startswith("drift"))
    found = rows(result)
    for cells, strategy in zip(found, result.strategies, strict=False):
        if strategy.metrics["drift_most"] <= ALIKE:
            cells[place] += RETURNS
    return found


def _tolerance(result: JobResult) -> str:
    """What is meant by "returns"."""
    unit, factor = result.joint_unit
    return f"returns: every joint is back at its start within {factor * ALIKE:.1g} {unit}, too little to measure."


def _terms() -> list[str]:
    """The glossary."""
    entries = "".join(f"<dt>{escape(term)}:</dt><dd>{escape(text)}</dd>" for term, text in _TERMS.items())
    return [f"<details class='small' open><summary>What the words mean</summary><dl>{entries}</dl></details>"]


def _coverage(result: JobResult) -> list[str]:
    """What becomes of the poses of the workspace, by strategy; nothing in a job without one."""
    found = [(s.name, s.coverage) for s in result.strategies if s.coverage is not None]
    if not found:
        return []
    causes = list(dict.fromkeys(cause for _, c in found for cause, _ in c.causes()))
    shares = [{cause: k / len(c) for cause, k in c.causes()} for _, c in found]
    table = [
        [escape(cause), *(f"{share[cause]:.1%}" if cause in share else "" for share in shares)] for cause in causes
    ]
    return [
        "<h2>Workspace</h2>",
        f"<p class='small'>{escape(result.workspace)}; {len(found[0][1])} poses, each gone to straight from the start."
        "</p>",
        html_table(["", *(escape(name) for name, _ in found)], table),
    ]


def _timing(result: JobResult) -> list[str]:
    """What each joint does of its limits, by strategy; nothing in a job that is not timed."""
    parts: list[str] = []
    for s in result.strategies:
        if s.timed is not None:
            slow = "".join(f"<li>{escape(str(one))}</li>" for one in s.timed.slowdowns)
            parts += [
                f"<h3>{escape(s.name)}</h3><p class='small'>{escape(s.timed.sentence)}</p>",
                _loads(s.timed, result.units),
            ]
            parts += [f"<ul class='small'>{slow}</ul>"] if slow else []
    said = "The greatest speed, acceleration and jerk of each joint, and what share of its limit that is."
    return ["<h2>Timing</h2>", f"<p class='small'>{said}</p>", *parts] if parts else []


def _loads(timed: TimedTrajectory, units: PrintedUnits) -> str:
    """The peaks of each joint as a table, numbers under their headings."""
    head = ["joint", "speed", "of limit", "acceleration", "of limit", "jerk", "of limit", "nearest limit at", "time"]
    table = []
    for load in (one.printed(units) for one in timed.loads):
        cells = [escape(load.joint)]
        for order, (peak, share) in enumerate(zip(load.peaks, load.shares, strict=True), 1):
            unit = f"{load.unit}/s" + (f"<sup>{order}</sup>" if order > 1 else "")
            cells += [
                f"{peak if peak > NOTHING_MOVES else 0.0:.4g} {unit}",
                f"{share:.0%}" if np.isfinite(share) else "-",
            ]
        far = f"{load.distance:.4g} {load.unit}" if np.isfinite(load.distance) else "-"
        table.append([*cells, far, f"{load.distance_at:.3f} s"])
    return html_table(head, table, numbers=True)


def _cell(text: str) -> str:
    mark = {"holonomic": "yes", "ok": "yes", "NOT holonomic": "no", "NOT run": "no", "FAILED": "no"}.get(text)
    return f"<span class='{mark}'>{escape(text)}</span>" if mark else escape(text)


def _figure(folder: FilePath, stem: str, caption: str) -> str:
    wide = stem.startswith(("paths", "cycles", "coverage", "sheets"))  # for a telephone
    return svg_figure((folder / f"{stem}.svg").read_bytes(), caption, wide)


def _film(file: FilePath, caption: str) -> str:
    data, text = base64.b64encode(file.read_bytes()).decode("ascii"), escape(caption, quote=True)
    if file.suffix == ".mp4":
        how = "autoplay loop muted playsinline controls"
        shown = f"<video {how} aria-label='{text}' src='data:video/mp4;base64,{data}'></video>"
    else:
        shown = f"<img alt='{text}' src='data:image/gif;base64,{data}'>"
    return f"<figure>{shown}<figcaption>{escape(caption)}</figcaption></figure>"


def _all_figures(result: JobResult) -> str:
    rows: list[list[str]] = []
    for key in result.meanings:
        values = [s.metrics.get(key, np.nan) for s in result.strategies]
        if any(np.isfinite(values)):
            by, words = result.factor(key), RETURNS if key in _DRIFTS else ""
            cells = [_measured(by * value) + (words if abs(value) <= ALIKE else "") for value in values]
            rows.append([escape(result.meaning(key)), *cells])
    return html_table(["", *(escape(s.name) for s in result.strategies)], rows)


def _measured(value: float) -> str:
    """Six digits; two of what is near round-off, and 0 for what is below all of it."""
    if not np.isfinite(value):
        return ""
    if abs(value) < NOTHING:
        return "0"
    return f"{value:.6g}" if abs(value) >= 1e-9 else f"{value:.1e}"


def _expectations(result: JobResult) -> str:
    rows = [
        [escape(s.name), escape(c.metric), escape(c.wanted), escape(c.found), _cell("ok" if c.passed else "FAILED")]
        for s in result.strategies
        for c in s.checks
    ]
    if not rows:
        return "<p>The job file holds no [expect] table.</p>"
    said = "" if result.units.plain else "<p class='small'>In rad and m, the units of the job file.</p>"
    return said + html_table(["strategy", "figure", "wanted", "found", ""], rows)
