"""The cases of a survey, each told by a hash of what it is, and found by its number without listing the others."""

from __future__ import annotations

import fnmatch
import hashlib
import json
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ..errors import ArgumentError, UnknownNameError
from ..job.robot_tables import RobotTable
from ..robot import catalogue
from ..types import Value
from .tables import SurveyTable

SUFFIXES = (".urdf", ".xacro", ".xml", ".toml")


@dataclass(frozen=True)
class Case:
    """What is asked once: a law, on a robot with a task, from a start, round a loop.

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
    """A robot with a task, a start and a kind of loop, and its laws: cases are spread over all of them evenly."""

    robot: int
    task: str
    start: tuple[str, int]
    loop: str
    laws: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Cases(Value):
    """All cases of a survey in a fixed order: those of one robot and task beside each other, all laws of a loop, too.

    With `cases` in the survey about so many are taken, always all laws of a loop; else all `count` loops of each kind.
    """

    table: SurveyTable
    folder: FilePath

    @cached_property
    def robots(self) -> list[dict[str, Any]]:
        """[robot] tables, with a hash of each file. Raises: UnknownNameError: what fits none."""
        found: list[dict[str, Any]] = []
        for entry in self.table.robots:
            if isinstance(entry, RobotTable):
                found.append(_told(entry.model_dump(exclude_unset=True), self.folder))
                continue
            if entry.lower().endswith(SUFFIXES):
                names = _files(entry, self.folder)
                if not names and not any(c in entry for c in "*?["):
                    names = [entry]  # its cases say that there is no such file
            elif any(c in entry for c in "*?["):
                names = fnmatch.filter(catalogue(), entry)
            else:
                names = [entry]
            if not names:
                raise UnknownNameError("robot", entry, list(catalogue()))
            found += [_told({"name": name}, self.folder) for name in names]
        known = set(catalogue())
        for name in (str(robot.get("name", "")) for robot in found):
            if name and name not in known and not FilePath(name).suffix and ":" not in name:  # as `load` reads it
                raise UnknownNameError("robot", name, list(catalogue()))
        unique = {json.dumps(robot, sort_keys=True): robot for robot in found}
        return list(unique.values())

    @cached_property
    def strata(self) -> list[Stratum]:
        """All of them, those of one robot and task beside each other."""
        s = self.table.starts
        starts = [("regular", i) for i in range(s.regular)] + [("random", i) for i in range(s.random)]
        found = [
            Stratum(r, task, start, loop, laws)
            for r, robot in enumerate(self.labels)
            for task in self.table.tasks
            for start in starts
            for loop in self.table.loops
            if (laws := self._laws(robot, task, loop))
        ]
        if not found:
            raise ArgumentError("without", "every case", "leave some of them in")
        return found

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
        if self.table.cases is None:
            counts = np.array([self.table.loops[s.loop].count for s in self.strata])
        else:
            counts = np.full(len(laws), self.table.cases // int(laws.sum()))
            order = np.random.default_rng(self.table.seed).permutation(len(laws))
            left = self.table.cases - int(counts @ laws)
            before = np.concatenate([[0], np.cumsum(laws[order])[:-1]])
            counts[order[before < left]] += 1
        return list(accumulate((counts * laws).tolist()))

    def __len__(self) -> int:
        return self._ends[-1]

    def case(self, number: int) -> Case:
        """The case of a number, from 0."""
        k = bisect_right(self._ends, number)
        stratum, t = self.strata[k], self.table
        repetition, law = divmod(number - (self._ends[k - 1] if k else 0), len(stratum.laws))
        name = stratum.laws[law]
        kind, index = stratum.start
        start: dict[str, Any] = {"kind": kind, "index": index}
        if kind == "random":
            start |= {"seed": t.seed, "margin": t.starts.margin}
        drawn = {"table": t.loops[stratum.loop].model_dump(exclude={"count"}), "seed": t.seed, "index": repetition}
        robot = self.robots[stratum.robot]
        rest = {
            "law": self._law(name), "cycles": t.cycles, "samples": t.samples, "limits": t.limits,
        }  # fmt: skip
        names = {"robot": self.labels[stratum.robot], "task": stratum.task, "loop": stratum.loop, "law": name}
        task = t.tasks[stratum.task].model_dump(exclude_unset=True)
        return Case(number, robot, task, start, drawn, name, names, rest)

    def _law(self, name: str) -> list[dict[str, Any]]:
        """What a law is: its table, and that of the one which it is of."""
        table = self.table.laws[name]
        own = table.model_dump(exclude_unset=True)
        of = own.pop("of", None)
        return [own] if of is None else [own, *self._law(of)]

    def __iter__(self) -> Iterator[Case]:
        return (self.case(k) for k in range(len(self)))


def _told(robot: dict[str, Any], folder: FilePath) -> dict[str, Any]:
    """With a hash of its file, which may change between two runs."""
    name = str(robot.get("name", ""))
    file = folder / name
    if not name.lower().endswith(SUFFIXES) or not file.is_file():
        return robot
    return robot | {"sha256": hashlib.sha256(file.read_bytes()).hexdigest()[:16]}


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
