"""The public survey, survey.toml: which laws return? A section of docs/measured.md, with pictures."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from PIL import Image

from benchmarks.page import Given, table, versions, wrapped
from holokin.app.report.plots import legible, style
from holokin.app.survey import Findings, Store, SurveyTable, run_survey
from holokin.app.survey.cases import Cases
from holokin.app.survey.findings import ON_PATH, RETURNS, drift_figure, survival_figure
from holokin.app.survey.survey_file import read_survey

FILE = Path(__file__).parent / "survey.toml"
SPOKEN_OF = {
    "plain": "pseudo-inverse",
    "fed": "pseudo-inverse, feedback",
    "lock": "lock",
    "held": "lock, feedback",
    "posture": "posture in the null space",
}
"""Laws of the survey that the text speaks of."""


def section(given: Given) -> tuple[list[str], str]:
    """Run the survey; the blocks of docs/measured.md, and the versions."""
    mpl.use("Agg")
    asked = read_survey(FILE)
    asked = asked.model_copy(update={"cases": 200, "cycles": 2}) if given.quick else asked
    with tempfile.TemporaryDirectory() as folder:
        results = Path(folder) / "survey.sqlite"
        run_survey(asked, FILE.parent, results, workers=0)
        with Store.opened(results, None) as store:
            found, cases = Findings.of(store.rows()), Cases(asked, FILE.parent)
    pictures = given.out / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    for name, draw in (("drift", drift_figure), ("limits", survival_figure)):
        save(lambda draw=draw: draw(found), pictures / f"survey-{name}.png")
    return text(asked, cases, found), versions("casadi", "numpy", "pin", "pin-pink", "mink", "example-robot-data")


def save(draw: Callable[[], Any], file: Path) -> None:
    """A figure as a PNG, small enough for a repository."""
    with mpl.rc_context(style()):
        legible(draw()).savefig(file, dpi=130, facecolor="white")
    with Image.open(file) as picture:
        small = picture.convert("RGB")
    small.save(file, optimize=True)


def text(asked: SurveyTable, cases: Cases, found: Findings) -> list[str]:
    """The blocks; every number in them is of the results."""
    facts = answers(asked, found)
    loop = next(iter(asked.loops.values()))
    low, high = loop.share if isinstance(loop.share, tuple) else (loop.share, loop.share)
    once = found.where(same_loops(cases, found))
    faults = int((found.columns["status"] == "fault").sum())
    return [
        "## Survey",
        wrapped(
            f"""Users report that an arm runs well for some loops and then stops at a joint limit. How often does that
            happen, with which law, and what does it cost to prevent it? {len(cases.robots)} arms of the catalogue and
            of the package example-robot-data that have more joints than the task needs go round closed loops
            {asked.cycles} times: circles, squares, figures of eight, rasters and smooth random loops of {low:.0%} to
            {high:.0%} of the arm's length, at {loop.speed} m/s, the tool not turning. The task is the tool's position
            or its whole pose. A third of the starts is well inside the limits, the others are drawn evenly but for
            {asked.starts.margin:.0%} of each range at both ends. All laws of a loop have the same start. These are
            ideal kinematics: collisions, speeds and torques stop no case, and a law that is tuned for an arm does
            better."""
        ),
        wrapped(
            """The pseudo-inverse drifts: {plain_returns} of its cases close the last cycle, and {plain_far} miss by
            more than 0.01; feedback of the tool's pose does not change it. So it stops later: of the arms that
            complete the first cycle, {plain_stops} do not complete all ({fed_stops} with feedback). A law with leaves
            stops in the first cycle, while somebody looks on, or hardly ever: {lock_stops} with the best joints locked
            ({held_stops} with feedback). A posture in the null space converges: its first cycle misses by
            {posture_first}, its last by {posture_last}, and it covers {posture_covers} of the loops, against
            {lock_covers} with joints locked and {plain_covers} of the pseudo-inverse. Locked joints move {lock_cost}
            times as fast as the least in the median, and {lock_dear} times in the 95 percent.""".format_map(facts)
        ),
        laws_table(found),
        wrapped(
            f"""*Covered*: all cycles, with the tool within {1e3 * ON_PATH:g} mm of the path. *Returns*: the last cycle
            closes to {RETURNS:g} rad or m. *First* and *last cycle*: the largest joint error at its end, the median.
            *Limit by k*: the share of the arms that meet a joint limit within k cycles, by Kaplan and Meier. *Stops
            later*: of the arms that complete a cycle, those that do not complete all. *Cost*: joint speed over the
            least, *margin*: the smallest distance to a joint limit, as a share of its range, both medians. Strategies
            without feedback stop at a limit; laws with it go on, and end where they first leave the limits. Of
            {len(found):,} cases {faults} have no answer. pink, mink, the arm angle and centring were asked of some
            loops only. Of the {len(once) // max(1, len(found.laws))} loops that every law was asked these shares are
            covered: {once_told(once)}."""
        ),
        "![Of each law the share of the cases whose last cycle misses by less](pictures/survey-drift.png)",
        "![Share of the arms that have met no joint limit after so many cycles](pictures/survey-limits.png)",
    ]


def once_told(once: Findings) -> str:
    """Of each law the share of the loops of all that it covers."""
    return "; ".join(f"{law} {cover(once.of_law(law))}" for law in once.laws)


def answers(asked: SurveyTable, found: Findings) -> dict[str, str]:
    """What the sentences say, law by law."""
    facts: dict[str, str] = {}
    for key, law in SPOKEN_OF.items():
        of = found.of_law(law)
        drift, cost = of.known("drift_last"), of.known("cost")
        facts |= {
            f"{key}_returns": returned(of),
            f"{key}_stops": stops(of),
            f"{key}_covers": cover(of),
            f"{key}_first": middle(of.known("drift"), form=".2g"),
            f"{key}_last": middle(drift, form=".2g"),
            f"{key}_far": f"{np.mean(drift > 0.01):.0%}" if drift.size else "none",
            f"{key}_cost": middle(cost, form=".3g"),
            f"{key}_dear": middle(cost, 0.95, ".3g"),
        }
    return facts


def returned(law: Findings) -> str:
    """The share of the cases that close their last cycle."""
    drift = law.known("drift_last")
    return f"{np.mean(drift < RETURNS):.1%}" if drift.size else "none"


def stops(law: Findings) -> str:
    """The share of cases which completed a cycle that did not complete all."""
    begun = law.where(law.columns["cycles"] >= 1)
    return f"{np.mean(begun.columns['status'] != 'complete'):.1%}" if len(begun) else "none"


def cover(law: Findings) -> str:
    """The share of the cases that it covers."""
    return f"{np.mean(law.covered):.1%}" if len(law) else "none"


def laws_table(found: Findings) -> str:
    """A row for each law."""
    most = int(np.nanmax(found.columns["cycles"], initial=0.0)) if len(found) else 0
    after = [k for k in (5, 20) if k <= most] or [most]
    head = ["law", "cases", "covered", "returns", "first cycle", "last cycle"]
    head += [*(f"limit by {k}" for k in after), "stops later", "cost", "margin"]
    rows = []
    for law in found.laws:
        of = found.of_law(law)
        first, last, cost, margin = (of.known(m) for m in ("drift", "drift_last", "cost", "margin"))
        cells = [law, f"{len(of):,}", cover(of), returned(of), middle(first), middle(last)]
        cells += [f"{of.met_a_limit(k):.1%}" for k in after]
        rows.append([*cells, stops(of), middle(cost, form=".3f"), middle(margin, form=".1%")])
    return table(head, rows)


def middle(values: np.ndarray, share: float = 0.5, form: str = ".1e") -> str:
    """A quantile."""
    if not values.size:
        return "-"
    value = float(np.quantile(values, share))
    return "0" if value < 1e-12 else format(value, form)


def same_loops(cases: Cases, found: Findings) -> np.ndarray:
    """Of each row whether its loop was asked of every law."""
    keys = []
    for row in found.rows():
        case = cases.of_row(row)
        if case is None:
            raise SystemExit(f"row {row['number']} is of another survey")
        keys.append(json.dumps([case.robot, case.task, case.start, case.loop], sort_keys=True))
    many = Counter(keys)
    return np.array([many[key] >= len(found.laws) for key in keys], dtype=bool)
