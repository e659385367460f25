"""`holokin survey report`: one self-contained page of a results file."""

from __future__ import annotations

from collections import Counter
from html import escape
from pathlib import Path
from typing import Any

from ...base.errors import HolokinError, SurveyError, brief
from ...base.files import write_text
from ...version import build
from ..job.toml_text import table, toml
from ..report.html_page import drawn, page
from .cases import Case, Cases
from .findings import ON_PATH, Findings
from .one_case import repeating_job
from .survey_figures import boxes_figure, coverage_figure, drift_figure, status_figure, survival_figure
from .survey_tables import SurveyTable

WORST = 10
"""Cases with the largest drift that are shown, each with a job that repeats it."""

KINDS = 40
"""Laws with a reason to stop, of each of which a case is shown."""

LONGEST_REASON = 240
"""Characters of a reason in the line of a case; the whole one is below it."""


_TERMS = (
    "First and last cycle: the largest joint error at their end, in rad or m, the median, and of the last cycle the 95 "
    "percent. Returns: cases that close their last cycle to 1e-6. Covered: complete, with the tool no further than "
    f"{1e3 * ON_PATH:g} mm from the path. Cost: joint speed over the least there is, that of the pseudo-inverse at the "
    "same postures. Margin: the smallest distance of a joint to a limit, of its range. Cases that did not end a cycle "
    "have no drift."
)


def write_survey_report(survey: SurveyTable, folder: Path, found: Findings, file: Path) -> None:
    """Write the page. Raises: WriteError. SurveyError: there are no rows to report."""
    cases = Cases(survey, folder)
    if not len(found):
        cure = "run it with `holokin survey FILE.toml`, or go on with --resume, and report then"
        raise SurveyError(survey.title, f"none of its {len(cases):,} cases has a row yet", cure)
    stopped = found.stopped(len(found))
    parts = [
        f"<h1>{escape(survey.title)}</h1>",
        f"<p>{escape(' '.join(survey.about.split()))}</p>",
        f"<p class='small'>{len(found):,} of {len(cases):,} cases; robots: {len(cases.robots)}, "
        f"tasks: {len(survey.tasks)}, kinds of loop: {len(survey.loops)}, laws: {len(survey.laws)}; "
        f"{survey.cycles} cycles each. holokin {escape(build())}.</p>",
        *_stale(cases, found),
        "<h2>By law</h2>",
        found._repr_html_(),
        f"<p class='small'>{escape(_TERMS)}</p>",
        "<h2>Figures</h2>",
        drawn(
            lambda: drift_figure(found),
            "Of each law the share of cases whose last cycle ends with a joint error below a value.",
        ),
        drawn(
            lambda: survival_figure(found),
            "Of each law the share of cases that met no joint limit within so many cycles (the estimate of Kaplan and "
            "Meier). A case that completes all cycles, or stops for another reason, counts as one without a limit in "
            "the cycles that it did, and is left out of the later ones.",
        ),
        drawn(
            lambda: coverage_figure(found),
            "Coverage, in percent: of the loops that a robot was asked to go round with a law those that it went round "
            f"to the end, with the tool within {1e3 * ON_PATH:g} mm of the path. Grey and empty: not asked. "
            + _faults(found),
        ),
        drawn(lambda: status_figure(found), "How the cases of each law ended."),
        drawn(lambda: boxes_figure(found), "Medians, quartiles, and 5 and 95 percent of the cases."),
        "<h2>The cases that drift most</h2>",
        *(_told(row, cases) for row in found.drifting(WORST)),
        "<h2>Cases that stopped: one of each law and reason</h2>",
        "<p class='small'>The rarest first; reasons that differ in names and numbers alone are one."
        + (f" {len(stopped) - KINDS:,} more frequent kinds are not shown.</p>" if len(stopped) > KINDS else "</p>"),
        *([_told(row, cases, many) for many, row in stopped[:KINDS]] or ["<p>All were complete.</p>"]),
    ]
    write_text(file, page(survey.title, parts))


def _stale(cases: Cases, found: Findings) -> list[str]:
    """A sentence about rows of cases that the survey no longer has, where there are."""
    many = len(set(found.columns["id"].tolist()).difference(cases.ids))
    if not many:
        return []
    why = "there were more cases, or the file of a robot or a law was another one, or is not to be found here"
    return [f"<p><b>{many:,} of the rows are of cases that the survey no longer has</b>: {why}. They count, too.</p>"]


def _faults(found: Findings) -> str:
    """How many cases of each law are faults, and how they count."""
    many: Counter[str] = Counter()
    for (_, law), count in found.faults().items():
        many[law] += count
    if not many:
        return "No case was a fault."
    told = ", ".join(f"{law} {count:,}" for law, count in many.most_common())
    return f"Cases that are faults: {told}; where all are, the map says so, elsewhere they count as not gone round."


def _told(row: dict[str, Any], cases: Cases, many: int = 0) -> str:
    words = {"cycles": "complete cycles", "drift": "drift of the first", "drift_last": "of the last"}
    words |= {"drift_total": "in all", "tracking": "tool error", "margin": "margin"}
    told = [f"{said} {row[name]:.3g}" for name, said in words.items() if row[name] == row[name]]
    line = f"{row['number']}: {row['law']} on {row['robot']}, {row['task']}, {row['loop']}: {row['status']}"
    if many:
        reason = brief(row["reason"], LONGEST_REASON)
        line = f"{many:,} {'case' if many == 1 else 'cases'}, as {line}" + (f" ({reason})" if reason else "")
    case = cases.of_row(row)
    job = repeated(cases, case)[0] if case else "# no job repeats it: its survey, or the file of its robot, has changed"
    return (
        f"<details><summary>{escape('; '.join([line, ', '.join(told)] if told else [line]))}</summary>"
        f"<p class='small'>{escape(row['reason'])}</p><pre>{escape(job)}</pre></details>"
    )


def repeated(cases: Cases, case: Case) -> tuple[str, str]:
    """(a job file that repeats a case, why it does not); of a control law one of the pseudo-inverse on its loop."""
    try:
        job, why = repeating_job(case, cases)
    except HolokinError as problem:
        return f"# no job repeats it: {problem}", ""
    head = "".join(f"{key} = {toml(job[key])}\n" for key in ("title", "about") if key in job)
    tables = [table(name, job[name]) for name in ("robot", "task", "start", "path") if job[name]]
    laws = [table(f"strategies.{toml(name)}", keys) for name, keys in job["strategies"].items()]
    return "\n".join([head, *tables, *laws]), why
