"""Writing a job's folder: report.html (self-contained), figures, trajectories, result.json; whole or not at all."""

from __future__ import annotations

import base64
import json
import re
from collections.abc import Callable
from html import escape
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..errors import posture_text
from ..files import writing
from .check_section import check_section
from .figures import figures
from .folder import FACTS, renewed
from .result import METRICS, JobResult
from .table import NOTHING, columns, remarks, rows
from .words import joint_unit

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>
body {{ font: 16px/1.5 system-ui, sans-serif; color: #22262e; max-width: 68rem; margin: 2rem auto; padding: 0 1.2rem; }}
h1 {{ font-size: 1.7rem; margin-bottom: .2rem; }} h2 {{ margin-top: 2.2rem; font-size: 1.25rem; }}
table {{ border-collapse: collapse; width: 100%; font-size: .92rem; font-variant-numeric: tabular-nums; }}
th, td {{ text-align: left; padding: .4rem .6rem; border-bottom: 1px solid #e5e7eb; vertical-align: top; }}
th {{ color: #4b5563; font-weight: 600; }} .yes {{ color: #1c7c43; font-weight: 600; }}
.no {{ color: #b3261e; font-weight: 600; }} figure {{ margin: 1.2rem 0; }} img {{ max-width: 100%; }}
figcaption, .small {{ color: #4b5563; font-size: .9rem; }} .wide {{ overflow-x: auto; }}
</style></head><body>
{body}
</body></html>
"""


_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f]")
"""Control characters, which HTML has no use for."""

_TERMS = (
    "Defect: the curvature F of a strategy, how far a small loop of the tool carries the joints, per area of the "
    "loop; zero everywhere means holonomic. Leaf: all the postures that a holonomic strategy can bring the robot to "
    "from its start; on it the tool pose alone says where the joints are. Drift: how far the joints are, at the end "
    "of a cycle, from where it began. Sigma min: the smallest singular value of the task Jacobian, zero where the "
    "tool cannot move in some direction. Speed / MP: joint speed over that of the pseudo-inverse, which is the "
    "least. Peak speed: the greatest joint speed over that joint's limit."
)
"""Terms of the table and the verdicts."""


def write_report(
    result: JobResult, out: FilePath, version: str, extra: Callable[[FilePath], None] | None = None
) -> FilePath:
    """Write `out/<job>/` and return it; `extra` may add files before it is put in place.

    A folder of an earlier run is replaced whole; what others have put into it stays, see `renewed`.

    Raises:
        ArgumentError: the folder exists and was not written by holokin, or cannot be made.
        WriteError: the system refuses a file, which it names; an earlier run's folder stands as it was.
    """
    with renewed(out, result.name) as work:
        _fill(result, work, version)
        if extra is not None:
            extra(work)
        _write_facts(result, work, version)
    return out / result.name


def _fill(result: JobResult, folder: FilePath, version: str) -> None:
    shown: list[tuple[str, str]] = []
    for stem, caption, figure in figures(result):
        with writing(folder / f"{stem}.png"):
            figure.savefig(folder / f"{stem}.png", dpi=130, facecolor="white")
        with writing(folder / f"{stem}.svg"):
            figure.savefig(folder / f"{stem}.svg", facecolor="white", metadata={"Date": None})
        shown.append((stem, caption))
    for strategy in result.strategies:
        for key, walk in strategy.trajectories().items():
            walk.save(folder / f"{result.stems[strategy.name]}-{key}.csv")
        if strategy.timed is not None:
            strategy.timed.save(folder / f"{result.stems[strategy.name]}-timed.csv")
        if strategy.coverage is not None:
            strategy.coverage.save(folder / f"{result.stems[strategy.name]}-workspace.csv")
    with writing(folder / "report.html"):
        (folder / "report.html").write_text(_page(result, folder, shown, version), "utf-8")


def _write_facts(result: JobResult, folder: FilePath, version: str) -> None:
    """result.json, with the names of all files that a later run may replace: written last."""
    facts = {
        "job": result.name, "title": result.title, "passed": result.passed, "robot": result.robot.name,
        "robot_source": result.robot.source, "task": result.task, "start": result.start.tolist(),
        "joint_names": list(result.robot.joint_names), "workspace": result.workspace or None,
        "path_length_m": result.path.length,
        "path_duration_s": result.path.duration, "cycles": result.cycles, "seconds": result.seconds,
        "holokin": version, "strategies": [s.summary() for s in result.strategies],
        "not_run": [vars(one) for one in result.not_run],
        "files": sorted({FACTS, *(entry.name for entry in folder.iterdir())}),
    }  # fmt: skip
    with writing(folder / FACTS):
        (folder / FACTS).write_text(json.dumps(facts, indent=2, allow_nan=False) + "\n", "utf-8")


def _page(result: JobResult, folder: FilePath, shown: list[tuple[str, str]], version: str) -> str:
    robot = result.robot
    start = posture_text(result.start, robot.joint_names)
    verdicts = [(escape(s.verdict.sentence), escape(s.verdict.told(robot.joint_names))) for s in result.strategies]
    parts = [
        f"<h1>{escape(result.title)}</h1>",
        f"<p>{escape(' '.join(result.about.split()))}</p>",
        f"<p class='small'>{escape(robot.name)}, {robot.n} joints ({escape(robot.source)}); "
        f"task: {escape(result.task)}; path {result.path.length:.4g} m in {result.path.duration:.4g} s, "
        f"{result.cycles} cycle(s); start: {escape(start)} [{joint_unit(robot)}]. "
        f"holokin {escape(version)}, {result.seconds:.1f} s.</p>",
        "<h2>Verdicts and numbers</h2>",
        _html_table(
            [escape(title) for title, _ in columns(result)], [[_cell(c) for c in cells] for cells in rows(result)]
        ),
        "<ul>",
        *(f"<li>{told}.<br><span class='small'>{shown}</span></li>" for told, shown in verdicts),
        *(f"<li class='no'>{escape(name)}: {escape(text)}</li>" for name, text in remarks(result)),
        "</ul>",
        f"<p class='small'>{escape(_TERMS)}</p>",
        *_coverage(result),
        *_timing(result),
        *check_section(result, _html_table),
        "<h2>Figures</h2>",
        *(_figure(folder, stem, caption) for stem, caption in shown),
        "<h2>Everything measured</h2>",
        _all_figures(result),
        "<h2>Expectations</h2>",
        _expectations(result),
    ]
    page = _PAGE.format(title=escape(result.title), body="\n".join(parts))
    return _CONTROL.sub("\ufffd", page)


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
        _html_table(["", *(escape(name) for name, _ in found)], table),
    ]


def _timing(result: JobResult) -> list[str]:
    """What each joint does of its limits, by strategy; nothing in a job that is not timed."""
    parts = [
        f"<h3>{escape(s.name)}</h3><div class='wide'><pre>{escape(s.timed.table())}</pre></div>"
        for s in result.strategies
        if s.timed is not None
    ]
    return ["<h2>Timing</h2>", *parts] if parts else []


def _cell(text: str) -> str:
    mark = {"holonomic": "yes", "ok": "yes", "NOT holonomic": "no", "NOT run": "no", "FAILED": "no"}.get(text)
    return f"<span class='{mark}'>{escape(text)}</span>" if mark else escape(text)


def _figure(folder: FilePath, stem: str, caption: str) -> str:
    data = base64.b64encode((folder / f"{stem}.svg").read_bytes()).decode("ascii")
    image = f"<img alt='{escape(caption, quote=True)}' src='data:image/svg+xml;base64,{data}'>"
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"


def _all_figures(result: JobResult) -> str:
    rows: list[list[str]] = []
    for key, meaning in METRICS.items():
        values = [s.metrics.get(key, np.nan) for s in result.strategies]
        if any(np.isfinite(values)):
            cells = [_measured(value) for value in values]
            rows.append([escape(meaning.replace("[joint]", f"[{joint_unit(result.robot)}]")), *cells])
    return _html_table(["", *(escape(s.name) for s in result.strategies)], rows)


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
    return _html_table(["strategy", "figure", "wanted", "found", ""], rows)


def _html_table(head: list[str], rows: list[list[Any]]) -> str:
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in r) + "</tr>" for r in rows)
    return f"<div class='wide'><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>"
