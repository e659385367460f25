"""The findings of a survey: its rows as columns, shares and quantiles by strategy and robot, the worst cases."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, wraps
from html import escape
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from ...base.errors import FileError, HolokinError, brief
from ...base.extra_module import extra_module
from ...base.files import write_text
from ...base.types import Array, Flags, Indices, Value, Vector, one_line
from ...version import build
from ..job.templates import table, toml
from ..report import plots
from ..report.html_page import page
from ..report.section import Note, Section, drawn, right
from .cases import Case, Cases
from .one_case import METRICS, CaseStatus, repeating_job
from .survey_file import SurveyTable

STATUS_ORDER = tuple(CaseStatus)
FAULT = CaseStatus.FAULT
RETURNS = 1e-6
"""Drift of the last cycle [rad, m] below which a strategy is said to return: far below what any joint's encoder
tells."""

ON_PATH = 5e-3
"""Error of the tool [m] up to which a loop counts as covered: of a welding seam or a bead of glue it is the width."""


@dataclass(frozen=True, eq=False)
class Findings(Value):
    """Rows of a survey, column by column; NaN where there is no number."""

    columns: dict[str, Array]

    @classmethod
    def of(cls, rows: Iterable[dict[str, Any]]) -> Findings:
        """Those of a results file, or of a run."""
        listed = list(rows)
        names = list(listed[0]) if listed else ["law", "status", *METRICS]
        texts = {"id", "number", "robot", "task", "loop", "law", "status", "reason"}
        columns = {
            name: np.array([row[name] for row in listed], dtype=object)
            if name in texts
            else np.array([np.nan if row[name] is None else row[name] for row in listed], dtype=float)
            for name in names
        }
        return cls(columns)

    def __len__(self) -> int:
        return len(self.columns["status"])

    def section(self) -> Section:
        """The table by strategy, and below it how many cases are faults."""
        (law, *numbers), rows = self.table()
        return Section("By strategy", head=[law, *right(*numbers)], rows=rows, remarks=self._fault_sentences())

    def __str__(self) -> str:
        return str(replace(self.section(), title=""))

    def __repr__(self) -> str:
        return one_line(f"Findings({len(self):,} rows, laws {', '.join(map(str, self.laws))})")

    def _repr_html_(self) -> str:
        """The table by strategy, as notebooks show it."""
        return replace(self.section(), title="").html()

    def _fault_sentences(self) -> list[str]:
        """How many cases are faults, and the reason of the first."""
        failed = np.flatnonzero(self.columns["status"] == FAULT)
        if not failed.size or "reason" not in self.columns:
            return []
        first = failed[0]
        law, robot, reason = (self.columns[name][first] for name in ("law", "robot", "reason"))
        return [f"{failed.size:,} of {len(self):,} cases are faults; the first, {law} on {robot}: {reason}"]

    @cached_property
    def laws(self) -> list[str]:
        """In the order of the cases."""
        return list(dict.fromkeys(self.columns["law"].tolist()))

    def of_law(self, law: str) -> Findings:
        """The rows of a strategy."""
        return self.where(self.columns["law"] == law)

    def where(self, chosen: Flags) -> Findings:
        """Some of the rows."""
        return Findings({name: values[chosen] for name, values in self.columns.items()})

    def known(self, metric: str) -> Vector:
        """The values of a metric, where there are."""
        values = self.columns[metric]
        return values[np.isfinite(values)]

    def shares(self) -> dict[str, float]:
        """Status -> share of the rows."""
        count = max(len(self), 1)
        return {s: float(np.sum(self.columns["status"] == s)) / count for s in STATUS_ORDER}

    def survival(self) -> tuple[Indices, Vector, int]:
        """(k, share of cases that met no joint limit within k cycles, cases): the estimate of Kaplan and Meier.

        A case that ends complete, or for another reason, counts as one without a limit up to its last cycle, and as
        none of the arms beyond it. [KM58]
        """
        cycles, status = self.columns["cycles"], self.columns["status"]
        known = np.isfinite(cycles)
        cycles, hit = cycles[known], status[known] == "limit"
        k = np.arange(int(cycles.max(initial=0.0)) + 1)
        at_risk = (cycles >= k[:, None]).sum(axis=1)
        stopped = (hit & (cycles == k[:, None])).sum(axis=1)
        share = np.cumprod(1 - stopped / np.maximum(at_risk, 1))
        return k, np.concatenate([[1.0], share[:-1]]), int(known.sum())

    def met_a_limit(self, cycles: int) -> float:
        """The share of the arms that have met a joint limit within so many cycles, by `survival`."""
        k, share, _ = self.survival()
        return 1.0 - float(share[np.searchsorted(k, cycles, side="right") - 1]) if k.size else float("nan")

    @property
    def covered(self) -> Flags:
        """Of each row whether the strategy went round all cycles with the tool no further than `ON_PATH` from the
        path."""
        with np.errstate(invalid="ignore"):
            return (self.columns["status"] == STATUS_ORDER[0]) & (self.columns["tracking"] <= ON_PATH)

    def coverage(self) -> tuple[list[str], list[str], Array]:
        """(robots, strategies, share of the loops asked that the strategy covers (robots, strategies)); NaN where none
        was asked.

        It is NaN, too, where all are faults: nothing is known of such a strategy.
        """
        if not len(self):
            return [], [], np.zeros((0, 0))
        robots = list(dict.fromkeys(self.columns["robot"].tolist()))
        rows = np.array([robots.index(robot) for robot in self.columns["robot"]], dtype=int)
        columns = np.array([self.laws.index(law) for law in self.columns["law"]], dtype=int)
        answered, asked, done = np.zeros((3, len(robots), len(self.laws)))
        np.add.at(asked, (rows, columns), 1.0)
        np.add.at(answered, (rows, columns), (self.columns["status"] != FAULT).astype(float))
        np.add.at(done, (rows, columns), self.covered.astype(float))
        return robots, self.laws, np.divide(done, asked, out=np.full(asked.shape, np.nan), where=answered > 0)

    def faults(self) -> dict[tuple[str, str], int]:
        """(robot, strategy) -> its cases that are faults, where there are."""
        failed = self.columns["status"] == FAULT
        pairs = zip(self.columns["robot"][failed].tolist(), self.columns["law"][failed].tolist(), strict=True)
        return dict(Counter(pairs))

    def frame(self) -> Any:
        """The rows as a pandas DataFrame. Raises: MissingExtraError: pandas is not installed."""
        return extra_module("pandas", "survey").DataFrame(self.columns)

    def drifting(self, count: int = 10) -> list[dict[str, Any]]:
        """The rows with the largest drift in all."""
        drift = np.nan_to_num(self.columns["drift_total"], nan=0.0)
        return self._rows(np.argsort(-drift, kind="stable")[:count])

    def stopped(self, count: int = 30) -> list[tuple[int, dict[str, Any]]]:
        """(how many there are, the one with the fewest cycles) of rows that stopped, for each strategy, status and
        reason.

        Reasons that differ in names and numbers alone are the same; the rarest are first.
        """
        columns = self.columns
        kinds: dict[tuple[str, str, str], list[int]] = {}
        for i in np.flatnonzero(columns["status"] != STATUS_ORDER[0]):
            reason = _plain_reason(columns["reason"][i], columns["robot"][i])
            kinds.setdefault((columns["law"][i], columns["status"][i], reason), []).append(int(i))
        cycles = np.nan_to_num(columns["cycles"], nan=-1.0)
        first = [(len(rows), min(rows, key=lambda i: cycles[i])) for rows in kinds.values()]
        first.sort(key=lambda pair: (pair[0], cycles[pair[1]]))
        return [(many, self._rows(np.array([i]))[0]) for many, i in first[:count]]

    def rows(self) -> list[dict[str, Any]]:
        """All rows, column -> value."""
        return self._rows(np.arange(len(self)))

    def _rows(self, which: Indices) -> list[dict[str, Any]]:
        return [{name: values[i] for name, values in self.columns.items()} for i in which]

    def table(self) -> tuple[list[str], list[list[str]]]:
        """(titles, a row for each strategy): how often, how far, what it costs."""
        head = ["law", "cases", "complete", "covered", "limit", "other"]
        head += ["returns", "first cycle", "last cycle", "95 %", "cost", "margin"]
        rows = []
        for law in self.laws:
            findings = self.of_law(law)
            shares, first, drift = findings.shares(), findings.known("drift"), findings.known("drift_last")
            cost, margin = findings.known("cost"), findings.known("margin")
            ended = [shares["complete"], float(np.mean(findings.covered)), shares["limit"]]
            ended.append(max(0.0, 1 - shares["complete"] - shares["limit"]))
            # A quantile of 95 % of fewer cases is no more than the largest.
            figures = [
                (drift, lambda values: f"{np.mean(values < RETURNS):.1%}", 1),
                (first, lambda values: _digits(np.median(values)), 1),
                (drift, lambda values: _digits(np.median(values)), 1),
                (drift, lambda values: _digits(np.quantile(values, 0.95)), 20),
                (cost, lambda values: f"{np.median(values):.2f}", 1),
                (margin, lambda values: f"{np.median(values):.1%}", 1),
            ]
            known = [form(values) if values.size >= fewest else "" for values, form, fewest in figures]
            rows.append([law, f"{len(findings):,}", *(f"{share:.1%}" for share in ended), *known])
        return head, rows


def _plain_reason(reason: str, robot: str) -> str:
    """A reason without what is quoted, without numbers, and without the names of the robot and of its parts."""
    own = set(re.findall(r"\w+", robot.lower()))
    words = re.sub(r"'[^']*'|\"[^\"]*\"", " ", reason).split()
    return " ".join(
        word
        for word in words
        if not re.search(r"[\d_/:]", word.rstrip(":")) and not own & set(re.findall(r"\w+", word.lower()))
    )


def robot_labels(robots: list[str]) -> list[str]:
    """Names of robots for figures: without the package, and without the ends of a chain where the name tells."""
    plain = [robot.rpartition("/")[2].partition(":")[2] or robot.rpartition("/")[2] for robot in robots]
    names = [name.partition(" ")[0] for name in plain]
    return [name if names.count(name) == 1 else full for name, full in zip(names, plain, strict=True)]


def _digits(value: Any) -> str:
    return "0" if value < 1e-12 else f"{value:.2g}"


# --- Figures of a survey: distributions by strategy, never means alone.

LEAST = 1e-12
"""Drift [rad, m] that is drawn for less, which is round-off."""

DASHES = ("-", "--", ":", "-.")

NAME = 30
"""Letters of a robot's name in a line: the map of the strategies needs the room beside it."""


def _styled(draw: Callable[[Findings], Any]) -> Callable[[Findings], Any]:
    """With the house's settings of matplotlib, wherever it is called."""

    @wraps(draw)
    def drawn(findings: Findings) -> Any:
        from matplotlib import rc_context

        with rc_context(plots.style()):
            return draw(findings)

    return drawn


def _empty(height: float) -> Any:
    return plots.new_figure(figsize=(plots.PAGE, height), layout="constrained")


def _line_styles(findings: Findings) -> dict[str, dict[str, Any]]:
    """Law -> how its line is drawn: in a cool colour where half of its cases return, in a warm one else."""
    drift = [findings.of_law(law).known("drift_last") for law in findings.laws]
    returns = [bool(d.size) and float(np.median(d)) < RETURNS for d in drift]
    colors = [
        plots.GREY if color == plots.YELLOW else color for color in plots.law_colors(returns)
    ]  # no line is yellow on white
    looks = {}
    for i, law in enumerate(findings.laws):
        before = returns[:i].count(returns[i])
        looks[law] = {"color": colors[i], "linestyle": DASHES[before // 4 % len(DASHES)], "linewidth": 2.0}
    return looks


def _title(axes: Any, text: str) -> None:
    axes.set_title(text, loc="left", color=plots.INK, fontsize=11)


def _named(figure: Any, handles: Sequence[tuple[float, Any]]) -> None:
    """The strategies beside the axes, in the order of the lines from above."""
    lines = [line for _, line in sorted(handles, key=lambda pair: -pair[0])]
    figure.legend(handles=lines, fontsize=9, loc="outside right upper", frameon=False)


@_styled
def drift_figure(findings: Findings) -> Any:
    """Share of the cases of a strategy whose drift of their last cycle is below a value, over that value."""
    figure = _empty(4.4)
    axes = figure.add_subplot()
    looks, handles = _line_styles(findings), []
    for law in findings.laws:
        drift = np.sort(np.maximum(findings.of_law(law).known("drift_last"), LEAST))
        if drift.size:
            share = np.arange(1, drift.size + 1) / drift.size
            ends = np.append(drift, max(drift[-1], 1.0)), np.append(share, 1.0)
            (line,) = axes.step(*ends, where="post", label=plots.on_figure(law), **looks[law])
            handles.append((-float(np.median(drift)), line))
    axes.axvline(RETURNS, color=plots.GREY, linewidth=1.0, linestyle=(0, (1, 3)), zorder=0)
    axes.set_xscale("log")
    axes.set_xlim(0.7 * LEAST, 4.0)
    axes.set_ylim(0, 1.02)
    axes.set_xlabel("largest joint error after the last cycle of a case [rad, m]")
    axes.set_ylabel("share of the cases with less")
    _title(axes, "Drift: lines at the left return, lines at the right drift")
    _named(figure, handles)
    return figure


@_styled
def survival_figure(findings: Findings) -> Any:
    """Share of the arms that have met no limit after k cycles."""
    figure = _empty(4.0)
    axes = figure.add_subplot()
    looks, handles, lowest = _line_styles(findings), [], 1.0
    for law in findings.laws:
        cycles, share, count = findings.of_law(law).survival()
        if count:
            (line,) = axes.step(cycles, share, where="post", label=plots.on_figure(law), **looks[law])
            handles.append((float(share[-1]), line))
            lowest = min(lowest, float(share.min()))
    bottom = max(0.0, 1.0 - 1.15 * max(1.0 - lowest, 0.05))
    axes.set_ylim(bottom, 1.0)
    axes.set_yticks([tick for tick in axes.get_yticks() if bottom <= tick <= 1.0 + 1e-9])
    axes.set_ylim(bottom, 1.0 + 0.02 * (1.0 - bottom))  # a line along the top is seen whole
    axes.set_xlim(left=0)
    axes.xaxis.get_major_locator().set_params(integer=True)
    axes.yaxis.set_major_formatter(_percent)
    axes.set_xlabel("cycles")
    axes.set_ylabel("share without a limit so far")
    _title(axes, "Joint limits: share of the arms that have met none")
    _named(figure, handles)
    return figure


def _percent(value: float, _place: Any) -> str:
    return f"{100 * value:.3g} %"


@_styled
def coverage_figure(findings: Findings) -> Any:
    """Of each robot and strategy the share of the loops asked that the strategy covers, as a map; best robots above.

    What was not asked is empty; where all cases are faults it says so.
    """
    from matplotlib.colors import LinearSegmentedColormap

    # The best robots first.
    robots, laws, share = findings.coverage()
    names = robot_labels(robots)
    known = np.isfinite(share)
    order = np.argsort(-np.nansum(share, axis=1) / np.maximum(known.sum(axis=1), 1), kind="stable")
    faults = findings.faults()
    # The map.
    figure = _empty(2.2 + 0.29 * len(robots))
    axes = figure.add_subplot()
    scale = [plots.VERMILLION, plots.YELLOW, "#FFFFFF", plots.SKY, plots.BLUE]
    colors = LinearSegmentedColormap.from_list("coverage", scale).with_extremes(bad=plots.PALE)
    image = axes.imshow(np.ma.masked_invalid(share[order]), aspect="auto", vmin=0.0, vmax=1.0, cmap=colors)
    for row, robot in enumerate(order):
        for column in range(len(laws)):
            value = share[robot, column]
            if not np.isfinite(value) and (robots[robot], laws[column]) in faults:
                axes.text(column, row, "faults", ha="center", va="center", fontsize=plots.TYPE, color=plots.INK)
            if np.isfinite(value):
                ink = "white" if value > 0.9 or value < 0.1 else plots.INK
                axes.text(column, row, f"{100 * value:.0f}", ha="center", va="center", fontsize=plots.TYPE, color=ink)
    # The names, and the scale.
    axes.set_xticks(range(len(laws)), [plots.on_figure(law, 30) for law in laws], rotation=35, ha="left", fontsize=9)
    axes.xaxis.tick_top()
    shown = [fill(plots.on_figure(names[i]), NAME) for i in order]
    axes.set_yticks(range(len(robots)), shown, fontsize=plots.TYPE, linespacing=1.1)
    axes.tick_params(length=0)
    axes.grid(visible=False)
    for spine in axes.spines.values():
        spine.set_visible(False)
    bar = figure.colorbar(image, ax=axes, location="bottom", fraction=0.02, pad=0.01, aspect=40)
    bar.outline.set_visible(False)
    bar.ax.xaxis.set_major_formatter(_percent)
    bar.set_label(f"loops that were gone round to the end\nwith the tool within {1e3 * ON_PATH:g} mm of the path")
    return figure


@_styled
def boxes_figure(findings: Findings) -> Any:
    """Cost and margin of each law: median, quartiles, 5 and 95 percent."""
    laws, looks = findings.laws, _line_styles(findings)
    figure = _empty(1.5 + 0.34 * len(laws))
    axes = figure.subplots(1, 2, sharey=True)
    panels = (
        ("cost", "joint speed over that\nof the pseudo-inverse"),
        ("margin", "least distance to a limit,\nof its range"),
    )
    for ax, (metric, words) in zip(axes, panels, strict=True):
        values = [findings.of_law(law).known(metric) for law in laws]
        look = {"patch_artist": True, "widths": 0.6, "medianprops": {"color": plots.INK, "linewidth": 1.8}}
        shown = [v if v.size else [np.nan] for v in values]
        boxes = ax.boxplot(shown, orientation="horizontal", whis=(5, 95), showfliers=False, **look)
        for law, box in zip(laws, boxes["boxes"], strict=True):
            box.set_facecolor(looks[law]["color"])
            box.set_alpha(0.6)
        ax.set_xlabel(words)
    right = axes[0].get_xlim()[1]
    # Cost beyond which the boxes end at the edge of the figure: it is rare, and would make all others look alike.
    axes[0].set_xlim(0.95, min(max(right, 1.1), 3.0))
    axes[1].set_xlim(left=min(0.0, axes[1].get_xlim()[0]))
    axes[1].xaxis.set_major_formatter(_percent)
    axes[0].set_yticks(np.arange(1, len(laws) + 1), [plots.on_figure(law) for law in laws])
    axes[0].invert_yaxis()
    _title(axes[0], "What it costs, and how near to the limits")
    return figure


# --- `holokin survey report`: one self-contained page of a results file.

KINDS = 40
"""Strategies with a reason to stop, of each of which a case is shown."""


_TERMS = (
    "First and last cycle: the largest joint error at their end, in rad or m, the median, and of the last cycle the 95 "
    "percent. Returns: cases that close their last cycle to 1e-6. Covered: complete, with the tool no further than "
    f"{1e3 * ON_PATH:g} mm from the path. Cost: joint speed over the least there is, that of the pseudo-inverse at the "
    "same postures. Margin: the smallest distance of a joint to a limit, of its range. Cases that did not end a cycle "
    "have no drift."
)


def write_survey_report(survey: SurveyTable, folder: Path, findings: Findings, file: Path) -> None:
    """Write the page. Raises: WriteError. FileError: there are no rows to report."""
    cases = Cases(survey, folder)
    if not len(findings):
        cure = "run it with `holokin survey FILE.toml`, or go on with --resume, and report then"
        raise FileError(survey.title, f"none of its {len(cases):,} cases has a row yet", cure)
    stopped, within = findings.stopped(len(findings)), f"{1e3 * ON_PATH:g} mm"
    # What was asked, and whether all rows are of it.
    counts = {"robots": cases.robots, "tasks": survey.tasks, "kinds of loop": survey.loops, "strategies": survey.laws}
    facts = ", ".join(f"{name}: {len(listed)}" for name, listed in counts.items())
    about = f"{len(findings):,} of {len(cases):,} cases; {facts}; {survey.cycles} cycles each. holokin {build()}."
    intro: list[Note | str] = [" ".join(survey.about.split()), Note(about, "small")]
    if stale := len(set(findings.columns["id"].tolist()).difference(cases.ids)):
        why = "there were more cases, or the file of a robot or a strategy was another one, or is not to be found here"
        text = f"{stale:,} of the rows are of cases that the survey no longer has"
        intro.append(Note(text, "strong", f": {why}. They count, too."))
    # The figures, with what to see in them.
    figures = {
        "Of each strategy the share of cases whose last cycle ends with a joint error below a value.": drift_figure,
        "Of each strategy the share of cases that met no joint limit within so many cycles (the estimate of Kaplan and "
        "Meier). A case that completes all cycles, or stops for another reason, counts as one without a limit in "
        "the cycles that it did, and is left out of the later ones.": survival_figure,
        "Coverage, in percent: of the loops that a robot was asked to go round with a strategy those that it went "
        f"round to the end, with the tool within {within} of the path. Grey and empty: not asked. "
        + _faults(findings): coverage_figure,
        "Medians, quartiles, and 5 and 95 percent of the cases.": boxes_figure,
    }
    images = [Section(figure=drawn(lambda draw=draw: draw(findings), words)) for words, draw in figures.items()]
    # The cases, each with a job that repeats it.
    rarest = "The rarest first; reasons that differ in names and numbers alone are one."
    more = len(stopped) - KINDS
    rarest += f" {more:,} more frequent kinds are not shown." if more > 0 else ""
    kinds = [_case_note(row, cases, many) for many, row in stopped[:KINDS]] or ["All were complete."]
    table = findings.section()
    # Cases with the largest drift that are shown, each with a job that repeats it.
    parts = [
        f"<h1>{escape(survey.title)}</h1>",
        Section(notes=intro),
        replace(table, remarks=[*table.remarks, Note(_TERMS, "small")]),
        Section("Figures", parts=images),
        Section("The cases that drift most", [_case_note(row, cases) for row in findings.drifting(10)]),
        Section("Cases that stopped: one of each strategy and reason", [Note(rarest, "small"), *kinds]),
    ]
    write_text(file, page(survey.title, parts))


def _faults(findings: Findings) -> str:
    """How many cases of each strategy are faults, and how they count."""
    many: Counter[str] = Counter()
    for (_, law), count in findings.faults().items():
        many[law] += count
    counts = ", ".join(f"{law} {count:,}" for law, count in many.most_common())
    sentence = (
        f"Cases that are faults: {counts}; where all are, the map says so, elsewhere they count as not gone round."
    )
    return sentence if many else "No case was a fault."


def _case_note(row: dict[str, Any], cases: Cases, many: int = 0) -> Note:
    """A case in a line, which unfolds to its reason and a job that repeats it."""
    words = {"cycles": "complete cycles", "drift": "drift of the first", "drift_last": "of the last"}
    words |= {"drift_total": "in all", "tracking": "tool error", "margin": "margin"}
    figures = [f"{word} {row[name]:.3g}" for name, word in words.items() if row[name] == row[name]]
    line = f"{row['number']}: {row['law']} on {row['robot']}, {row['task']}, {row['loop']}: {row['status']}"
    if many:
        # Characters of a reason in the line of a case; the whole one is below it.
        reason = brief(row["reason"], 240)
        line = f"{many:,} {'case' if many == 1 else 'cases'}, as {line}" + (f" ({reason})" if reason else "")
    case = cases.of_row(row)
    job = repeated(cases, case)[0] if case else "# no job repeats it: its survey, or the file of its robot, has changed"
    reason = "".join(f"# {text}\n" for text in row["reason"].splitlines())
    return Note("; ".join([line, ", ".join(figures)] if figures else [line]), detail=f"{reason}\n{job}")


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
