"""The page of the public survey: `python docs/survey_page.py [RESULTS]` writes docs/survey.md and its pictures.

The results come from `holokin survey benchmarks/survey.toml`; the text around the numbers is survey_page.txt.
"""

from __future__ import annotations

import argparse
import json
import sqlite3
from collections import Counter
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import numpy as np
from PIL import Image

from holokin.app.report.plots import legible, style
from holokin.app.survey import Findings, Store, SurveyTable
from holokin.app.survey.cases import Cases
from holokin.app.survey.findings import ON_PATH, RETURNS, boxes_figure, coverage_figure, drift_figure, survival_figure

HERE = Path(__file__).parent
SPOKEN_OF = {
    "plain": "pseudo-inverse",
    "fed": "pseudo-inverse, feedback",
    "lock": "lock",
    "held": "lock, feedback",
    "posture": "posture in the null space",
    "pink": "pink",
}
"""Laws of the survey that the text speaks of."""


def main(arguments: list[str] | None = None) -> None:
    """Read the results, write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, nargs="?", default=Path("out/survey.sqlite"))
    parser.add_argument("--docs", type=Path, default=HERE, help="where the page goes")
    given = parser.parse_args(arguments)
    with Store.opened(given.results, None) as store:
        table, found = store.content(), Findings.of(store.rows())
        cases = Cases(table, store.folder())
    version = sqlite3.connect(given.results).execute("SELECT version FROM survey").fetchone()[0]
    pictures = given.docs / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    figures = {"drift": drift_figure, "limits": survival_figure, "coverage": coverage_figure, "cost": boxes_figure}
    for name, draw in figures.items():
        save(lambda draw=draw: draw(found), pictures / f"survey-{name}.png")
    page = given.docs / "survey.md"
    page.write_text(text(table, cases, found, version), "utf-8")
    print(f"{page}: {len(found):,} of {len(cases):,} cases")


def save(draw: Callable[[], Any], file: Path) -> None:
    """A figure as a PNG, small enough for a repository."""
    with matplotlib.rc_context(style()):
        legible(draw()).savefig(file, dpi=130, facecolor="white")
    with Image.open(file) as picture:
        small = picture.convert("RGB")
    small.save(file, optimize=True)


def text(table: SurveyTable, cases: Cases, found: Findings, version: str) -> str:
    """The page; every number in it is of the results."""
    facts = asked(table, cases, found) | answers(table, found) | {"version": version}
    once = found.where(same_loops(cases, found))
    facts |= {"by_law": laws_table(found), "by_law_once": laws_table(once), "once": f"{len(once) // len(found.laws):,}"}
    return TEMPLATE.format_map(facts | ends(found))


def asked(table: SurveyTable, cases: Cases, found: Findings) -> dict[str, str]:
    """What the survey asked."""
    loop = next(iter(table.loops.values()))
    low, high = loop.share if isinstance(loop.share, tuple) else (loop.share, loop.share)
    took = timedelta(seconds=round(float(np.nansum(found.columns["seconds"]))))
    names = [label.partition(" ")[0].rpartition(":")[2] for label in cases.labels]
    return {
        "title": table.title, "about": " ".join(table.about.split()), "arms": str(len(cases.robots)),
        "names": ", ".join(dict.fromkeys(names)), "cases": f"{len(cases):,}",
        "part": f" Only {len(found):,} are done: the numbers are preliminary." if len(found) < len(cases) else "",
        "regular": str(table.starts.regular), "random": str(table.starts.random), "edge": f"{table.starts.margin:.0%}",
        "loops": ", ".join(table.loops), "low": f"{low:.0%}", "high": f"{high:.0%}", "speed": f"{loop.speed}",
        "cycles": str(table.cycles), "samples": str(table.samples), "took": str(took),
        "path_mm": f"{1e3 * ON_PATH:g}", "returns_at": f"{RETURNS:g}",
    }  # fmt: skip


def answers(table: SurveyTable, found: Findings) -> dict[str, str]:
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
            f"{key}_limit_5": f"{of.met_a_limit(5):.1%}",
            f"{key}_limit": f"{of.met_a_limit(table.cycles):.1%}",
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
    after = [k for k in (5, 10, 20) if k <= most] or [most]
    titles = ["law", "cases", "covered", "returns", "first cycle", "last cycle", "95 %"]
    titles += [f"limit by {k}" for k in after] + ["stops later", "cost", "margin"]
    lines = ["| " + " | ".join(titles) + " |", "|---|" + "---:|" * (len(titles) - 1)]
    for law in found.laws:
        of = found.of_law(law)
        first, last, cost, margin = (of.known(m) for m in ("drift", "drift_last", "cost", "margin"))
        cells = [law, f"{len(of):,}", cover(of), returned(of), middle(first), middle(last), middle(last, 0.95)]
        cells += [f"{of.met_a_limit(k):.1%}" for k in after]
        cells += [stops(of), middle(cost, form=".3f"), middle(margin, form=".1%")]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


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


def ends(found: Findings) -> dict[str, str]:
    """How cases ended; faults by their cause."""
    statuses = Counter(found.columns["status"].tolist())
    lines = [f"| {status} | {count:,} | {count / len(found):.1%} |" for status, count in statuses.most_common()]
    faults = found.where(found.columns["status"] == "fault")
    pairs = zip(faults.columns["law"].tolist(), faults.columns["reason"].tolist(), strict=True)
    causes = Counter(f"{law}: {reason[:140]}" for law, reason in pairs)
    said = "".join(f"\n- {cause} ({count:,})" for cause, count in causes.most_common(8))
    return {"ended": "\n".join(lines), "faults": f"{len(faults):,} of {len(found):,}.{said}"}


TEMPLATE = (HERE / "survey_page.txt").read_text("utf-8")
"""The text around the numbers."""

if __name__ == "__main__":
    main()
