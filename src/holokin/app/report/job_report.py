"""Writing a job's folder: report.html (self-contained), figures, trajectories, result.json; whole or not at all."""

from __future__ import annotations

import base64
from collections.abc import Callable
from html import escape
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...analysis.sheets import write_sheets
from ...base.errors import posture_text
from ...base.files import write_text, writing
from ...base.printed_units import PrintedUnits
from ...motion import TimedTrajectory
from .check_section import check_section
from .html_page import html_table, page, svg_figure
from .job_figures import figures
from .job_result import JobResult
from .job_table import NOTHING, columns, remarks, rows
from .job_verdict import verdict_section
from .result_folder import renewed, write_facts
from .sheets_section import sheets_section
from .words import ALIKE, paths_words

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
        "sheets": result.sheets.summary() if result.sheets is not None else None,
        "two_paths": paths_words(result) or "compared",
        "path_duration_s": result.path.duration, "cycles": result.cycles, "seconds": result.seconds,
        "holokin": version, "strategies": [s.summary() for s in result.strategies],
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
        *verdict_section(result),
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
        *check_section(result, html_table),
        *sheets_section(result.sheets),
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
