"""The cases of a survey, each told by a hash of what it is, and found by its number without listing the others."""

from __future__ import annotations

import fnmatch
import hashlib
import heapq
import json
import math
from bisect import bisect_right
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, count, islice
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.errors import ArgumentError, UnknownNameError
from ...base.types import Flags, Indices, Value
from ...robot import catalogue
from ..job.tables import RobotTable
from .survey_file import Own, SurveyTable, source_of

SUFFIXES = (".urdf", ".xacro", ".xml", ".toml")

HASH = "sha256"
"""The key of a file's hash in the table of a robot or of a strategy."""


@dataclass(frozen=True)
class Case:
    """What is asked once: a strategy, on a robot with a task, from a start, round a loop.

    All of it is plain data; `loop` and `start` say how they are drawn, `id` is a hash of everything.
    """

    number: int
    robot: dict[str, Any]
    task: dict[str, Any]
    start: dict[str, Any]
    loop: dict[str, Any]
    law: str
    names: dict[str, str]
    rest: dict[str, Any]

    @cached_property
    def id(self) -> str:
        """16 hex digits: the beginning of the SHA-256 of what the case is, whatever it is called."""
        content = [self.robot, self.task, self.start, self.loop, self.rest]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Stratum:
    """A robot with a task, a start and a kind of loop, and its strategies: cases are spread over all of them evenly."""

    robot: int
    task: str
    start: tuple[str, int]
    loop: str
    laws: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Cases(Value):
    """All cases of a survey in a fixed order: those of one robot and task beside each other, all strategies of a loop.

    With `cases` in the survey about so many are taken, always all strategies of a loop, as even as can be over the
    robots, then over tasks, loops and starts; else all `count` loops of each kind. No case is there twice: a loop that
    is given as a path, or as a function of the tool pose, is one loop.
    """

    table: SurveyTable
    folder: FilePath

    @cached_property
    def robots(self) -> list[dict[str, Any]]:
        """[robot] tables, with a hash of each file. Raises: UnknownNameError: what fits none."""
        tables: list[dict[str, Any]] = []
        for entry in self.table.robots:
            if isinstance(entry, RobotTable):
                tables.append(_with_hashes(entry.model_dump(exclude_unset=True), self.folder))
                continue
            if entry.lower().endswith(SUFFIXES):
                names = _files(entry, self.folder)
                if not names and not any(c in entry for c in "*?["):
                    names = [entry]  # its cases say that there is no such file
            elif any(c in entry for c in "*?["):
                names = fnmatch.filter(catalogue(), entry)
            else:
                names = [entry]
            if not names and entry.lower().endswith(SUFFIXES):
                raise ArgumentError("robots", entry, f"no file fits in {self.folder.absolute()}")
            if not names:
                raise UnknownNameError("robot", entry, list(catalogue()))
            tables += [_with_hashes({"name": name}, self.folder) for name in names]
        known = set(catalogue())
        for name in (str(robot.get("name", "")) for robot in tables):
            if name and name not in known and not FilePath(name).suffix and ":" not in name:  # as `load` reads it
                raise UnknownNameError("robot", name, list(catalogue()))
        unique = {json.dumps(robot, sort_keys=True): robot for robot in tables}
        return list(unique.values())

    @cached_property
    def strata(self) -> list[Stratum]:
        """All of them, those of one robot and task beside each other."""
        starts = self._starts
        strata = [
            Stratum(r, task, start, loop, laws)
            for r, robot in enumerate(self.labels)
            for task in self.table.tasks
            for start in starts
            for loop in self.table.loops
            if (laws := self._laws(robot, task, loop))
        ]
        if not strata:
            raise ArgumentError("without", "every case", "leave some of them in")
        return strata

    @property
    def _starts(self) -> list[tuple[str, int]]:
        s = self.table.starts
        return [("regular", i) for i in range(s.regular)] + [("random", i) for i in range(s.random)]

    @cached_property
    def labels(self) -> list[str]:
        """What each robot is called in its rows."""
        return [_label(robot) for robot in self.robots]

    def _laws(self, robot: str, task: str, loop: str) -> tuple[str, ...]:
        """Those that are not left out."""
        rules = [rule for rule in self.table.without if rule.fits(robot=robot, task=task, loop=loop)]
        return tuple(law for law in self.table.laws if not any(rule.fits(law=law) for rule in rules))

    @cached_property
    def _ends(self) -> list[int]:
        """For each stratum the number of the first case beyond it."""
        laws = np.array([len(s.laws) for s in self.strata])
        fixed = np.array([self.table.loops[s.loop].kind == "given" for s in self.strata])
        if self.table.cases is None:
            counts = np.where(fixed, 1, [self.table.loops[s.loop].count for s in self.strata])
        else:
            counts = self._spread(self.table.cases, laws, fixed)
        return list(accumulate((counts * laws).tolist()))

    def _spread(self, left: int, laws: Indices, fixed: Flags) -> Indices:
        """How many loops of each stratum: as even as can be, and of a loop that is always the same, one."""
        counts, free = np.zeros(len(laws), dtype=int), np.ones(len(laws), dtype=bool)
        while free.any() and (rounds := left // int(laws[free].sum())):
            rounds = min(rounds, 1) if (fixed & free).any() else rounds
            counts[free] += rounds
            left -= rounds * int(laws[free].sum())
            free &= ~fixed
        some = np.flatnonzero(free)
        starts = {start: i for i, start in enumerate(self._starts)}
        order = evenly([self.strata[i] for i in some], starts) if left else iter(())
        for stratum in order:
            if left <= 0:
                break
            counts[some[stratum]] += 1
            left -= int(laws[some[stratum]])
        return counts

    @property
    def fewer(self) -> str:
        """Why there are fewer cases than were asked for; empty where there are as many."""
        asked = self.table.cases
        if asked is None:
            asked = sum(self.table.loops[s.loop].count * len(s.laws) for s in self.strata)
        if len(self) >= asked:
            return ""
        return (
            f"only {len(self):,} of {asked:,} cases differ: the path of a loop that is given is always the same; "
            'more random starts make more of them, as starts = {"random": 50}, or loops that are drawn'
        )

    def __len__(self) -> int:
        return self._ends[-1]

    def case(self, number: int) -> Case:
        """The case of a number, from 0."""
        k = bisect_right(self._ends, number)
        laws = self.strata[k].laws
        repetition, law = divmod(number - (self._ends[k - 1] if k else 0), len(laws))
        return self._of(k, repetition, laws[law], number)

    def _of(self, k: int, repetition: int, name: str, number: int) -> Case:
        """The case of a stratum, of one of its loops and of a strategy."""
        stratum, t = self.strata[k], self.table
        kind, index = stratum.start
        start: dict[str, Any] = {"kind": kind, "index": index}
        if kind == "random":
            start |= {"seed": t.seed, "margin": t.starts.margin}
        drawn = {"table": t.loops[stratum.loop].model_dump(exclude={"count"}), "seed": t.seed, "index": repetition}
        robot = self.robots[stratum.robot]
        rest = {"law": self._law_contents[name], "cycles": t.cycles, "samples": t.samples, "limits": t.limits}
        rest |= {"metrics": self._metric_contents} if t.metrics else {}
        names = {"robot": self.labels[stratum.robot], "task": stratum.task, "loop": stratum.loop, "law": name}
        task = t.tasks[stratum.task].model_dump(exclude_unset=True)
        return Case(number, robot, task, start, drawn, name, names, rest)

    @cached_property
    def _law_contents(self) -> dict[str, list[dict[str, Any]]]:
        return {name: self._law(name) for name in self.table.laws}

    @cached_property
    def _metric_contents(self) -> dict[str, Any]:
        """What metrics of the user's own are: as given, with hashes of the files that they are imported from."""
        metrics: dict[str, Any] = {}
        for name, metric in self.table.metrics.items():
            file = source_of(metric, self.folder) if isinstance(metric, str) else None
            metrics[name] = [str(metric), *([] if file is None else [_hashed(file)])]
        return metrics

    def _law(self, name: str) -> list[dict[str, Any]]:
        """What a strategy is: its table, with a hash of the file that it is imported from, and that of the one it is
        of."""
        table = self.table.laws[name]
        own = table.model_dump(exclude_unset=True)
        if isinstance(table, Own) and (file := source_of(table.function, self.folder)) is not None:
            own |= _hashed(file)
        of = own.pop("of", None)
        return [own] if of is None else [own, *self._law(of)]

    def of_row(self, row: Mapping[str, Any]) -> Case | None:
        """The case of a row by its id, if there is one: its number may be of a run with more cases, or fewer."""
        number = int(row["number"])
        if number < len(self) and (case := self.case(number)).id == row["id"]:
            return case
        same = [
            k
            for k, s in enumerate(self.strata)
            if (self.labels[s.robot], s.task, s.loop) == (row["robot"], row["task"], row["loop"])
            and row["law"] in s.laws
        ]
        near = ((k, repetition) for repetition in count() for k in same) if same else iter(())
        # Cases among which that of a row is looked for whose number is of another run: less than a second.
        for k, repetition in islice(near, 20_000):
            case_of_row = self._of(k, repetition, str(row["law"]), number)
            if case_of_row.id == row["id"]:
                return case_of_row
        return None

    @property
    def ids(self) -> list[str]:
        """The ids of all, which take some 20 us each."""
        return [case.id for case in self]

    def __iter__(self) -> Iterator[Case]:
        return (self.case(k) for k in range(len(self)))


def evenly(strata: list[Stratum], starts: dict[tuple[str, int], int]) -> Iterator[int]:
    """The places of all strata in an order of which any beginning is even.

    The robot with the fewest cases so far is next; of its tasks and loops those which it, and then which all robots,
    had least; and the starts take turns.

    Args:
        starts: each start posture -> its place among them.
    """
    groups: dict[int, dict[tuple[str, str], dict[int, int]]] = {}
    for i, s in enumerate(strata):
        groups.setdefault(s.robot, {}).setdefault((s.task, s.loop), {})[starts[s.start]] = i
    turns, many = [(0, robot) for robot in groups], len(starts)
    own, of_all, period = Counter[Hashable](), Counter[str](), math.lcm(len(groups), many)

    def in_all(task: str, loop: str) -> tuple[int, int]:
        return of_all[f"task {task}"], of_all[f"loop {loop}"]

    for turn in range(len(strata)):
        # The robot with the fewest cases, its rarest task and loop, and the next start of those that are left.
        cases, robot = heapq.heappop(turns)
        left = groups[robot]
        task, loop = min(
            left,
            key=lambda of: (*(own[robot, *what] for what in (("task", of[0]), ("loop", of[1]), of)), *in_all(*of)),
        )
        free, first = left[task, loop], turn + turn // period
        # Starts of which the least used one is next: to look at all of a survey with many would take too long.
        next_ones = islice((k % many for k in range(first, first + many) if k % many in free), 16)
        start = min(next_ones, key=lambda k: (of_all[f"start {k}"], own[robot, k]))
        place = free.pop(start)
        if not free:
            del left[task, loop]
        # One more loop, with all strategies.
        size = len(strata[place].laws)
        for what in ((robot, "task", task), (robot, "loop", loop), (robot, task, loop), (robot, start)):
            own[what] += size
        for what in (f"task {task}", f"loop {loop}", f"start {start}"):
            of_all[what] += size
        if left:
            heapq.heappush(turns, (cases + size, robot))
        yield place


def _with_hashes(robot: dict[str, Any], folder: FilePath) -> dict[str, Any]:
    """With a hash of its file, and of those of its parts: they may change between two runs."""
    if robot.get("parts"):
        robot = robot | {"parts": [_with_hashes(part, folder) for part in robot["parts"]]}
    name = str(robot.get("name", ""))
    file = folder / name
    if not name.lower().endswith(SUFFIXES) or not file.is_file():
        return robot
    return robot | _hashed(file)


def _hashed(file: FilePath) -> dict[str, str]:
    """The hash of a file by its key; nothing of one that cannot be read, of which its cases say so."""
    try:
        return {HASH: hashlib.sha256(file.read_bytes()).hexdigest()[:16]}
    except OSError:
        return {}


def robot_table(robot: dict[str, Any]) -> dict[str, Any]:
    """The [robot] table of a case as a job has it, without hashes of files."""
    table = {key: value for key, value in robot.items() if key != HASH}
    if table.get("parts"):
        table["parts"] = [robot_table(part) for part in table["parts"]]
    return table


def _label(robot: dict[str, Any]) -> str:
    """Its name, and the ends of its chain where they are given."""
    ends = "-".join(robot[end] for end in ("base", "tip") if robot.get(end))
    return " ".join(word for word in (robot.get("name") or "parts", ends) if word)


def _files(pattern: str, folder: FilePath) -> list[str]:
    """The files of a pattern, sorted; names that count from the folder stay so, wherever the survey is run."""
    given = FilePath(pattern)
    if given.is_absolute():
        return [f.as_posix() for f in sorted(FilePath(given.anchor).glob(str(given.relative_to(given.anchor))))]
    return [f.relative_to(folder).as_posix() for f in sorted(folder.glob(pattern))]
