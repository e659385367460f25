"""The report of a job: its sections for the page and the terminal, and the folder of its files, whole or not at all."""

from __future__ import annotations

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
from ...motion.trajectory import Status
from ...robot import without_speed_limit
from .html_page import page
from .job_figures import figures
from .job_result import JobResult, SheetsResult, StrategyResult, renewed, write_facts
from .plots import ALIKE, check_words, paths_words, speed_warning, stopped
from .section import Column, Image, Note, Section, Tone, right

# --- The table of a job, for the terminal and the report.

NOTHING = 1e-18
"""Size [any unit] below which a figure is 0: differences of doubles over 0.01 are at least that."""


def number(value: float) -> str:
    """Three digits; a dash where there is none, 0 for what is below all round-off."""
    if not np.isfinite(value):
        return "-"
    if abs(value) < NOTHING:
        value = 0.0
    return f"{value:.3f}" if 1e-2 <= abs(value) < 100 else f"{value:.1e}"


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
    listed = [
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
    listed += [_Column(f"clear.\n[{unit}]", clear)] if looked_at else []
    listed += [_Column("work-\nspace", figure("coverage", "{:.1%}".format))] if result.workspace else []
    return [*listed, _Column("expected", _expected, "left")]


def _expected(s: StrategyResult) -> str:
    return "FAILED" if not s.passed else "ok" if s.checks or s.motion_check is not None else "-"


def columns(result: JobResult) -> list[Column]:
    """Heading, with its unit, and alignment of each column."""
    return [(column.heading, column.side) for column in _columns(result)]


def rows(result: JobResult) -> list[list[str]]:
    """The cells of every strategy: those that could not be run last."""
    shown = _columns(result)
    failed = [[strategy.name, "NOT run", *["-"] * (len(shown) - 3), "FAILED"] for strategy in result.not_run]
    return [*([column.cell(s) for column in shown] for s in result.strategies), *failed]


_TONES: dict[str, Tone] = {
    "holonomic": "holonomic",
    "NOT holonomic": "bad",
    "ok": "good",
    "NOT run": "failed",
    "FAILED": "failed",
}


def _cell(text: str) -> Note:
    return Note(text, _TONES.get(text, ""))


def remarks(result: JobResult) -> list[Note]:
    """Sentences on all that the table does not tell: what was not run, what stopped, what is too fast."""
    sentences = [(strategy.name, f"not run: {strategy.reason}") for strategy in result.not_run]
    sentences += [(s.name, text) for s in result.strategies for text in (s.trouble, speed_warning(result, s))]
    return [Note(f"{brief(name)}: {text}", "warning") for name, text in sentences if text]


def print_result(result: JobResult, console: Any) -> None:
    """Print a job's table, and below it what failed."""
    parts = []
    if result.sheets is not None:
        bad = "" if result.sheets.passed else result.sheets.verdict
        lines = [*result.sheets.map_lines(), *result.sheets.path_lines()]
        parts.append(Section("sheets:", [Note(brief(line, 300), "bad" if line == bad else "") for line in lines]))
    for s in result.strategies:
        name = brief(s.name)
        if s.timed is not None:
            parts.append(Section(f"{name}, timed:", [brief(line) for line in s.timed.table(result.units).splitlines()]))
        if s.motion_check is not None:
            lines = s.motion_check.table(result.units).splitlines()[s.motion_check.passed :]
            parts.append(Section(f"{name}, checked:", [brief(line) for line in [check_words(s), *lines] if line]))
        parts.append(Section(notes=[Note(f"{name}: {check.unmet}", "bad") for check in s.checks if not check.passed]))
    notes = [text for text in [paths_words(result)] if text]
    table = [[_cell(text) for text in row] for row in rows(result)]
    whole = Section(brief(result.title), notes, None, columns(result), table, remarks(result), parts=parts)
    whole.reworded(result.reworded).rich(console)


# --- The verdict of a job in words, for somebody who signs it: what was run, what holds, what was not tested.

MOST_FINDINGS = 3
"""Findings of a strategy that are told in the verdict; the section on checks has all."""


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
        failed = [s.name for s in result.strategies if not s.passed] + [strategy.name for strategy in result.not_run]
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
    verdicts = []
    for s in result.strategies:
        does, _, reach = _returns(result, s).partition(": ")
        parts = [reach[:1].upper() + reach[1:], _limits(result, s), _speeds(result, s), _clearance(result, s)]
        well = s.passed and s.status is Status.COMPLETE and (not result.path.closed or returns(s))
        verdicts.append((s.name, f"{does.rstrip('.')}.", " ".join(filter(None, [*parts, _failed(s)])), well))
    return verdicts + [(strategy.name, "was not run.", f"{strategy.reason}.", False) for strategy in result.not_run]


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
    sentence = ""
    peak = s.metrics["peak_speed"]
    if np.isfinite(peak):
        verb = "are kept" if peak <= 1 else "are exceeded"
        sentence = f"Speed limits {verb} at the speed of the path: {peak:.0%} of one at most."
    elif unknown := without_speed_limit(result.robot):
        sentence = f"Cannot tell whether speed limits are kept: the robot's description has none of {unknown}."
    if s.timed is not None:
        bare = np.isinf(s.timed.limits.velocity)
        names = ", ".join(name for name, none in zip(result.robot.joint_names, bare, strict=True) if none)
        less = f", which has no speed limit of {names}," if names else ""
        sentence += f" Timed within the limits of [timing]{less} the motion takes {s.timed.duration:.4g} s."
    return sentence.strip()


def _clearance(result: JobResult, s: StrategyResult) -> str:
    """What the checks of its motion found."""
    report = s.motion_check
    if report is None:
        return ""
    unread = f"Of the distances the checks {report.unread}." if report.unread else ""
    if report.findings:
        some = "; ".join(str(pair.printed(result.units)) for pair in report.findings[:MOST_FINDINGS])
        more = len(report.findings) - MOST_FINDINGS
        return f"The checks of the motion found: {some}{f'; and {more} more' if more > 0 else ''}. {unread}".strip()
    if unread:
        return unread
    if not report.pairs:
        return "The checks of the motion found nothing; distances were not among them."
    wanted, near = result.units.said(report.wanted, "m", 3), report.nearest
    close = sum(pair.wanted < report.wanted for pair in report.pairs)
    touch = f"{close} pairs that are always nearer do not touch"
    touch = "1 pair that is always nearer does not touch" if close == 1 else touch
    if near is None:
        return f"No pair was held against the clearance of {wanted}: {touch}."
    smallest = f"the least distance is {result.units.said(near.least, 'm', 3)}, between {' and '.join(near.pair)}"
    return f"Clearances are kept: {smallest} ({wanted} wanted){f'; {touch}' if close else ''}."


def _failed(s: StrategyResult) -> str:
    """The expectations that do not hold."""
    failed = [c for c in s.checks if not c.passed]
    units = " (in the units of the job file)" if any(c.metric not in ("completes", "holonomic") for c in failed) else ""
    return f"This fails the job: {'; '.join(c.unmet for c in failed)}{units}." if failed else ""


def not_tested(result: JobResult) -> list[str]:
    """What this run does not say."""
    sentences = ["other paths, other starts and other speeds than these"]
    if not result.path.closed:
        sentences.append("whether the joints return: the path is open")
    elif result.one_way:
        sentences.append(f"whether two ways to one pose end with the same joints: {result.one_way}")
    if all(s.motion_check is None for s in result.strategies):
        sentences.append("collisions, obstacles, floor, singular postures of the motion: the job has no [checks]")
    elif any(s.followed < 1.0 for s in result.strategies):
        sentences.append("the rest of the path of a strategy that stopped")
    reports = [s.motion_check for s in result.strategies if s.motion_check is not None]
    left_out = {pair.pair for report in reports for pair in report.left_out}
    if left_out:
        sentences.append(f"{len(left_out)} pairs of links whose distances were left out: see the checks of the motion")
    sentences += dict.fromkeys(remark for report in reports for remark in report.remarks)
    if all(s.timed is None for s in result.strategies):
        sentences.append("accelerations and jerks: the job has no [timing]")
    if result.sheets is not None and result.sheets.along is not None:
        sentences.append("the motion over the sheets: [timing] and [checks] are of strategies, and of `holokin export`")
    return [*sentences, "the controller and the robot: servos, weight, backlash, its own planning"]


RETURNS = ", returns"
"""Beside a drift that is none."""

NOTHING_MOVES = 1e-9
"""Peak of a rate [joint units / s, s^2, s^3] that is shown as 0."""

_TERMS = {
    "Holonomic": (
        "small closed paths of the tool bring the joints back to their start. In a region of tool poses around the "
        "start the same pose then has the same joints; holokin certify tells whether a box is such a region."
    ),
    "Leaf": "all postures where the rule of a holonomic strategy has one value. Several may have the same tool pose.",
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
    robot, path = result.robot, result.path
    facts: dict[str, Any] = {"job": result.name, "title": result.title, "passed": result.passed, "robot": robot.name}
    facts |= {"robot_source": robot.source, "task": result.task, "start": result.q0.tolist()}
    facts |= {"joint_names": list(robot.joint_names), "workspace": result.workspace or None}
    facts |= {"path_length_m": path.length, "path_duration_s": path.duration, "cycles": result.cycles}
    facts |= {"sheets": None if result.sheets is None else result.sheets.to_dict()}
    facts |= {"two_paths": paths_words(result) or "compared", "seconds": result.seconds, "holokin": version}
    facts |= {"strategies": [s.to_dict() for s in result.strategies]}
    return facts | {"not_run": [vars(strategy) for strategy in result.not_run]}


def _page(
    result: JobResult, folder: FilePath, shown: list[tuple[str, str]], films: list[tuple[str, str]], version: str
) -> str:
    # What was run.
    robot, units = result.robot, " or ".join(dict.fromkeys(c.unit for c in result.robot.coordinates))
    start = posture_text(result.q0, robot.joint_names)
    cycles = "1 cycle" if result.cycles == 1 else f"{result.cycles} cycles"
    facts = (
        f"{robot.name}, {robot.n} joints ({robot.source}); task: {result.task}; path "
        f"{result.units.said(result.path.length, 'm')} in {result.path.duration:.4g} s, {cycles}; "
        f"start: {start} {units}. "
        f"holokin {version}, {result.seconds:.1f} s."
    )
    # The figures, the films, the terms.
    wide = ("paths", "cycles", "coverage", "sheets")
    images = [
        Image((folder / f"{stem}.svg").read_bytes(), caption, wide=stem.startswith(wide)) for stem, caption in shown
    ]
    mimes = {".mp4": "video/mp4", ".gif": "image/gif"}
    moving = [Image((folder / name).read_bytes(), caption, mimes[FilePath(name).suffix]) for name, caption in films]
    terms = "".join(f"<dt>{escape(term)}:</dt><dd>{escape(text)}</dd>" for term, text in _TERMS.items())
    # The sections, the verdict first.
    parts = [
        f"<h1>{escape(result.title)}</h1>",
        _verdict_section(result),
        Section(notes=[" ".join(result.about.split()), Note(facts, "small")]),
        _table_section(result),
        f"<details class='small' open><summary>What the words mean</summary><dl>{terms}</dl></details>",
        *_workspace_sections(result),
        *_timing_sections(result),
        *_check_sections(result),
        *([] if result.sheets is None else [_sheets_section(result.sheets)]),
        Section("Figures", parts=[Section(figure=image) for image in [*moving, *images]]),
        _measured_section(result),
        _expectations_section(result),
    ]
    told = [part.reworded(result.reworded) if isinstance(part, Section) else part for part in parts]
    return page(result.title, told)


def _verdict_section(result: JobResult) -> Section:
    """What was run, the verdict on all of it and on each strategy, and what was not tested."""
    points = [
        Note(f"{name} {text}", "good" if well else "bad", f" {more}")
        for name, text, more, well in strategy_verdicts(result)
    ]
    notes = [what_was_run(result), Note(whole_verdict(result), "strong")]
    return Section("Verdict", notes, points=points, parts=[Section(notes=["Not tested:"], points=not_tested(result))])


def _table_section(result: JobResult) -> Section:
    """The table; where the joints come back it says so, and below it what is meant by that."""
    place = next(k for k, (title, _) in enumerate(columns(result)) if title.startswith("drift"))
    table = [[_cell(text) for text in row] for row in rows(result)]
    for row, strategy in zip(table, result.strategies, strict=False):
        if strategy.metrics["drift_most"] <= ALIKE:
            row[place] = Note(row[place].text + RETURNS)
    unit, factor = result.joint_unit
    back = f"returns: every joint is back at its start within {factor * ALIKE:.1g} {unit}, too little to measure."
    verdicts = [
        Note(f"{s.verdict.sentence}.", detail=s.verdict.told(result.robot.joint_names)) for s in result.strategies
    ]
    below = [Note(back, "small"), *(text for text in [paths_words(result)] if text)]
    points = [*verdicts, *remarks(result)]
    return Section("Verdicts and numbers", head=columns(result), rows=table, remarks=below, points=points)


def _workspace_sections(result: JobResult) -> list[Section]:
    """What becomes of the poses of the workspace, by strategy; nothing in a job without one."""
    coverages = {s.name: s.coverage for s in result.strategies if s.coverage is not None}
    if not coverages:
        return []
    shares = [{cause: count / len(c) for cause, count in c.causes()} for c in coverages.values()]
    table = [
        [cause, *(f"{share[cause]:.1%}" if cause in share else "" for share in shares)]
        for cause in dict.fromkeys(cause for share in shares for cause in share)
    ]
    poses = len(next(iter(coverages.values())))
    about = f"{result.workspace}; {poses} poses, each gone to straight from the start."
    return [Section("Workspace", [Note(about, "small")], head=["", *coverages], rows=table)]


def _timing_sections(result: JobResult) -> list[Section]:
    """What each joint does of its limits, by strategy; nothing in a job that is not timed."""
    head = right("speed", "of limit", "acceleration", "of limit", "jerk", "of limit", "nearest limit at", "time")
    parts = []
    for s in result.strategies:
        if s.timed is not None:
            slow = [Note(str(slowdown), "small") for slowdown in s.timed.slowdowns]
            notes = [Note(s.timed.sentence, "small")]
            parts.append(Section(s.name, notes, None, ["joint", *head], _loads(s.timed, result.units), points=slow))
    caption = "The greatest speed, acceleration and jerk of each joint, and what share of its limit that is."
    return [Section("Timing", [Note(caption, "small")], parts=parts)] if parts else []


def _loads(timed: TimedTrajectory, units: PrintedUnits) -> list[list[str]]:
    """The peaks of each joint."""
    table = []
    for load in (load_of_joint.printed(units) for load_of_joint in timed.loads):
        row = [load.joint]
        for power, peak, share in zip(("", "\u00b2", "\u00b3"), load.peaks, load.shares, strict=True):
            row.append(f"{peak if peak > NOTHING_MOVES else 0.0:.4g} {load.unit}/s{power}")
            row.append(f"{share:.0%}" if np.isfinite(share) else "-")
        far = f"{load.distance:.4g} {load.unit}" if np.isfinite(load.distance) else "-"
        table.append([*row, far, f"{load.distance_at:.3f} s"])
    return table


def _check_sections(result: JobResult) -> list[Section]:
    """Findings, distances and what was not looked at, by strategy; nothing in a job without [checks]."""
    head = ["finding", "of", *right("from [s]", "to [s]", "worst at [s]", "value"), "wanted"]
    parts = []
    for s in result.strategies:
        report = s.motion_check
        if report is None:
            continue
        table = []
        # Findings in a report; result.json has them all.
        for finding in (finding.printed(result.units) for finding in report.findings[:200]):
            unit, sign = f" {finding.unit}" if finding.unit else "", "at least" if finding.is_least else "limit"
            times = [f"{time:.3f}" for time in (finding.start, finding.stop, finding.time)]
            values = [f"{finding.value:.4g}{unit}", f"{sign} {finding.limit:.4g}{unit}"]
            table.append([Note(finding.kind.value, "bad"), " and ".join(finding.what), *times, *values])
        sentences = [Note(check_words(s), "good" if s.followed == 1.0 else "bad"), Note(report.unread, "bad")]
        lines = [Note(line, "small") for line in report.notes(result.units)]
        remarks = [note for note in sentences if note.text]
        parts.append(Section(s.name, head=head if table else (), rows=table, remarks=remarks, points=lines))
    return [Section("Checks of the motion", parts=parts)] if parts else []


def _sheets_section(result: SheetsResult) -> Section:
    """What the sheets serve, and what became of the job's path."""
    first, *lines = [line for line in result.map_lines() if line != result.verdict]
    about = f"{result.found.workspace}; {len(result.found.poses)} poses sampled."
    notes = [f"{first}.", Note(result.verdict, "good" if result.passed else "bad"), Note(about, "small")]
    path = result.path_lines()
    parts = [Section(notes=[f"{path[0]}."], points=[Note(line.strip(), "small") for line in path[1:]])] if path else []
    return Section("Sheets", notes, points=[Note(line.strip(), "small") for line in lines], parts=parts)


def _measured_section(result: JobResult) -> Section:
    """Every metric that a strategy has, six digits of each: two of what is near round-off."""
    table: list[list[str]] = []
    for key in result.meanings:
        values = [s.metrics.get(key, np.nan) for s in result.strategies]
        if any(np.isfinite(values)):
            drift = key in ("drift", "drift_mean", "drift_total", "drift_least", "drift_most")
            factor, words = result.factor(key), RETURNS if drift else ""
            cells = [_measured(factor * value) + (words if abs(value) <= ALIKE else "") for value in values]
            table.append([result.meaning(key), *cells])
    return Section("Everything measured", head=["", *(s.name for s in result.strategies)], rows=table)


def _measured(value: float) -> str:
    if not np.isfinite(value):
        return ""
    if abs(value) < NOTHING:
        return "0"
    return f"{value:.6g}" if abs(value) >= 1e-9 else f"{value:.1e}"


def _expectations_section(result: JobResult) -> Section:
    """What the job expected of each strategy."""
    table = [
        [s.name, check.metric, check.wanted, check.found, _cell("ok" if check.passed else "FAILED")]
        for s in result.strategies
        for check in s.checks
    ]
    if not table:
        return Section("Expectations", ["The job file holds no [expect] table."])
    notes = [] if result.units.plain else [Note("In rad and m, the units of the job file.", "small")]
    return Section("Expectations", notes, head=["strategy", "figure", "wanted", "found", ""], rows=table)
