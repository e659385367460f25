"""What a survey found: its rows as columns, shares and quantiles by law and by robot, the worst cases."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import Any

import numpy as np

from ...base.extra_module import extra_module
from ...base.shown import one_line
from ...base.types import Array, Flags, Indices, Value, Vector
from ..report.html_page import html_table
from .one_case import METRICS, CaseStatus

STATUS_ORDER = tuple(CaseStatus)
FAULT = CaseStatus.FAULT
RETURNS = 1e-6
"""Drift of the last cycle [rad, m] below which a law is said to return: far below what any joint's encoder tells."""

FOR_A_QUANTILE = 20
"""Cases of which a quantile of 95 % is more than the largest."""

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
        found = {
            name: np.array([row[name] for row in listed], dtype=object)
            if name in texts
            else np.array([np.nan if row[name] is None else row[name] for row in listed], dtype=float)
            for name in names
        }
        return cls(found)

    def __len__(self) -> int:
        return len(self.columns["status"])

    def __str__(self) -> str:
        head, rows = self.table()
        widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
        lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in (head, *rows)]
        return "\n".join([*lines, *self._told_of_faults()])

    def __repr__(self) -> str:
        return one_line(f"Findings({len(self):,} rows, laws {', '.join(map(str, self.laws))})")

    def _repr_html_(self) -> str:
        """The table by law, as notebooks show it."""
        head, rows = self.table()
        table = html_table([escape(title) for title in head], [[escape(cell) for cell in row] for row in rows], True)
        return table + "".join(f"<p>{escape(line)}</p>" for line in self._told_of_faults())

    def _told_of_faults(self) -> list[str]:
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
        """The rows of a law."""
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

    def survival(self) -> tuple[Vector, Vector, int]:
        """(k, share of cases that met no joint limit within k cycles, cases): the estimate of Kaplan and Meier.

        A case that ends complete, or for another reason, counts as one without a limit up to its last cycle, and as
        none of the arms beyond it. [KM58]
        """
        cycles, status = self.columns["cycles"], self.columns["status"]
        known = np.isfinite(cycles)
        cycles, hit = cycles[known], status[known] == "limit"
        most = int(cycles.max(initial=0.0))
        k, share, alive = [0], [1.0], 1.0
        for cycle in range(most + 1):
            at_risk = int(np.sum(cycles >= cycle))
            stopped = int(np.sum(hit & (cycles == cycle)))
            if at_risk and stopped:
                alive *= 1 - stopped / at_risk
            k.append(cycle + 1)
            share.append(alive)
        return np.array(k[: most + 1]), np.array(share[: most + 1]), int(known.sum())

    def met_a_limit(self, cycles: int) -> float:
        """The share of the arms that have met a joint limit within so many cycles, by `survival`."""
        k, share, _ = self.survival()
        return 1.0 - float(share[np.searchsorted(k, cycles, side="right") - 1]) if k.size else float("nan")

    @property
    def covered(self) -> Flags:
        """Of each row whether the law went round all cycles with the tool no further than `ON_PATH` from the path."""
        with np.errstate(invalid="ignore"):
            return (self.columns["status"] == STATUS_ORDER[0]) & (self.columns["tracking"] <= ON_PATH)

    def coverage(self) -> tuple[list[str], list[str], Array]:
        """(robots, laws, share of the loops asked that the law covers (robots, laws)); NaN where none was asked.

        It is NaN, too, where all are faults: nothing is known of such a law.
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
        """(robot, law) -> its cases that are faults, where there are."""
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
        """(how many there are, the one with the fewest cycles) of rows that stopped, for each law, status and reason.

        Reasons that differ in names and numbers alone are the same; the rarest are first.
        """
        columns = self.columns
        kinds: dict[tuple[str, str, str], list[int]] = {}
        for i in np.flatnonzero(columns["status"] != STATUS_ORDER[0]):
            said = _plain_reason(columns["reason"][i], columns["robot"][i])
            kinds.setdefault((columns["law"][i], columns["status"][i], said), []).append(int(i))
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
        """(titles, a row for each law): how often, how far, what it costs."""
        head = ["law", "cases", "complete", "covered", "limit", "other"]
        head += ["returns", "first cycle", "last cycle", "95 %", "cost", "margin"]
        rows = []
        for law in self.laws:
            found = self.of_law(law)
            shares, first, drift = found.shares(), found.known("drift"), found.known("drift_last")
            cost, margin = found.known("cost"), found.known("margin")
            ended = [shares["complete"], float(np.mean(found.covered)), shares["limit"]]
            ended.append(max(0.0, 1 - shares["complete"] - shares["limit"]))
            rows.append([
                law, f"{len(found):,}", *(f"{share:.1%}" for share in ended),
                f"{np.mean(drift < RETURNS):.1%}" if drift.size else "",
                _digits(np.median(first)) if first.size else "",
                _digits(np.median(drift)) if drift.size else "",
                _digits(np.quantile(drift, 0.95)) if drift.size >= FOR_A_QUANTILE else "",
                f"{np.median(cost):.2f}" if cost.size else "",
                f"{np.median(margin):.1%}" if margin.size else "",
            ])  # fmt: skip
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
