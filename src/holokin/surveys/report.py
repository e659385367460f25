"""`holokin survey report`: one self-contained page of a results file."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

from ..errors import HolokinError
from ..files import replacing
from ..job.writing import table, toml
from ..output.page import drawn, page
from ..version import __version__
from .cases import Cases
from .figures import boxes_figure, coverage_figure, drift_figure, status_figure, survival_figure
from .findings import ON_PATH, Findings
from .running import repeating_job
from .tables import SurveyTable

WORST = 10
"""Cases of a kind that are shown, each with a job that repeats it."""


_TERMS = (
    "First and last cycle: the largest joint error at their end, in rad or m, the median, and of the last cycle the 95 "
    "percent. Returns: cases that close their last cycle to 1e-6. Covered: complete, with the tool no further than "
    f"{1e3 * ON_PATH:g} mm from the path. Cost: joint speed over the least there is, that of the pseudo-inverse at the "
    "same postures. Margin: the smallest distance of a joint to a limit, of its range. Cases that did not end a cycle "
    "have no drift."
)


def write_survey_report(survey: SurveyTable, folder: Path, found: Findings, file: Path) -> None:
    """Write the page. Raises: WriteError."""
    cases = Cases(survey, folder)
    parts = [
        f"<h1>{escape(survey.title)}</h1>",
        f"<p>{escape(' '.join(survey.about.split()))}</p>",
        f"<p class='small'>{len(found):,} of {len(cases):,} cases; robots: {len(cases.robots)}, "
        f"tasks: {len(survey.tasks)}, kinds of loop: {len(survey.loops)}, laws: {len(survey.laws)}; "
        f"{survey.cycles} cycles each. holokin {escape(__version__)}.</p>",
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
            "Meier: a case that ends for another reason counts up to there).",
        ),
        drawn(
            lambda: coverage_figure(found),
            "Coverage, in percent: of the loops that a robot was asked to go round with a law those that it went round "
            f"to the end, with the tool within {1e3 * ON_PATH:g} mm of the path. Grey: not asked.",
        ),
        drawn(lambda: status_figure(found), "How the cases of each law ended."),
        drawn(lambda: boxes_figure(found), "Medians, quartiles, and 5 and 95 percent of the cases."),
        "<h2>The cases that drift most</h2>",
        *(_told(row, cases) for row in found.drifting(WORST)),
        "<h2>Cases that stopped: of each law and cause one</h2>",
        *([_told(row, cases) for row in found.stopped(WORST)] or ["<p>All were complete.</p>"]),
    ]
    with replacing(file) as part:
        part.write_text(page(survey.title, parts), "utf-8")


def _told(row: dict[str, Any], cases: Cases) -> str:
    words = {"cycles": "complete cycles", "drift": "drift of the first", "drift_last": "of the last"}
    words |= {"drift_total": "in all", "tracking": "tool error", "margin": "margin"}
    told = [f"{said} {row[name]:.3g}" for name, said in words.items() if row[name] == row[name]]
    words = f"{row['number']}: {row['law']} on {row['robot']}, {row['task']}, {row['loop']}: {row['status']}"
    job = repeated(cases, int(row["number"]))
    return (
        f"<details><summary>{escape(words)}; {escape(', '.join(told))}</summary>"
        f"<p class='small'>{escape(row['reason'])}</p><pre>{escape(job)}</pre></details>"
    )


def repeated(cases: Cases, number: int) -> str:
    """A job file that repeats a case; of a control law one of the pseudo-inverse on its loop, which says so."""
    try:
        job, _ = repeating_job(cases.case(number), cases)
    except HolokinError as problem:
        return f"# no job repeats it: {problem}"
    head = "".join(f"{key} = {toml(job[key])}\n" for key in ("title", "about") if key in job)
    tables = [table(name, job[name]) for name in ("robot", "task", "start", "path") if job[name]]
    laws = [table(f"strategies.{toml(name)}", keys) for name, keys in job["strategies"].items()]
    return "\n".join([head, *tables, *laws])
