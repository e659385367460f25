"""What a job found: values for reports and plots to read."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, count
from pathlib import Path as FilePath
from typing import Any

from ...analysis.coverage import Coverage, Slice
from ...analysis.curvature import Verdict
from ...analysis.sheets import SheetMotion, Sheets
from ...base.errors import ArgumentError, WriteError
from ...base.files import alone, aside, clear, put, restore, uninterrupted, write_json, writing
from ...base.types import NoTruthValue, Value, Vector, number_or_none
from ...base.units import SI, PrintedUnits
from ...motion import TimedTrajectory
from ...motion.checks import CheckReport
from ...motion.trajectory import Status, Trajectory
from ...path.editing import AnyPath
from ...proof.cell_search import count_kept, remove_kept
from ...robot import LinkShape, Robot

# --- What a job found of its [sheets]: the map, the share that was wanted, and the motion along the job's path.


@dataclass(frozen=True, eq=False)
class SheetsResult(NoTruthValue, Value, ask="`.passed`"):
    """A map of sheets with the share that was wanted of it, and what became of the job's path on it.

    along: the motion along the path; None where there is none, then `unfollowed` says why. file: the file from which
    the map was read; empty where it was searched for. remark: what else is to be known of the map.
    """

    found: Sheets
    wanted: float
    along: SheetMotion | None = None
    unfollowed: str = ""
    file: str = ""
    remark: str = ""

    @property
    def passed(self) -> bool:
        """Whether the share that was wanted is served."""
        return self.found.share >= self.wanted

    @property
    def verdict(self) -> str:
        """The share that is served, beside the one that was wanted."""
        verb = "is reached" if self.passed else "is not reached"
        return f"a share of {self.wanted:.2%} was wanted: it {verb} ({self.found.share:.2%})"

    @property
    def seconds(self) -> float:
        """How long all changes along the path take at the joints' speed limits, the tool at rest."""
        return 0.0 if self.along is None else sum(seam.seconds for seam in self.along.seams)

    @property
    def motions(self) -> dict[str, Trajectory]:
        """The motions along the path by the names of their files: one, or one for each part between divisions."""
        parts: Sequence[Trajectory] = () if self.along is None else self.along.parts
        if len(parts) == 1:
            return {"sheets-motion": parts[0]}
        return {f"sheets-motion-{i}": part for i, part in enumerate(parts, 1)}

    def map_lines(self) -> list[str]:
        """What is served, by which sheets, and why the rest is not."""
        of = [f"the map was read from {self.file}"] if self.file else []
        return [*of, *filter(None, [self.remark]), *str(self.found).splitlines(), self.verdict]

    def path_lines(self) -> list[str]:
        """What became of the job's path."""
        if self.along is None:
            return [f"the job's path: {self.unfollowed}"] if self.unfollowed else []
        lines = f"the job's path: {self.along}".splitlines()
        if self.along.changes:
            lines.append(f"  with the tool at rest: {self.seconds:.2f} s at the joints' speed limits")
        return lines

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready facts."""
        s, m = self.found, self.along
        facts: dict[str, Any] = {"sheets": list(map(str, s.sheets)), "share": s.share, "wanted": self.wanted}
        facts |= {"passed": self.passed, "poses": len(s.poses), "reachable": int(s.reachable.sum())}
        facts |= {"served": int(s.served.sum()), "least": s.least, "candidates": s.candidates, "stopped": s.stopped}
        facts |= {"file": self.file or None, "remark": self.remark, "unfollowed": self.unfollowed, "path": None}
        if m is not None:
            path: dict[str, Any] = {"complete": m.complete, "changes": m.changes, "seconds_of_changes": self.seconds}
            for kind, keys in _PARTS.items():
                path[kind] = [{key: getattr(part, key) for key in keys} for part in getattr(m, kind)]
            facts["path"] = path
        return facts


_PARTS = {
    "pieces": ("sheet", "start", "stop"),
    "divisions": ("at", "first", "second", "reason"),
    "left_out": ("start", "stop", "reason"),
}
"""What is told of the parts of a motion over sheets."""


@dataclass(frozen=True)
class Check(NoTruthValue, ask="`.passed`"):
    """One expectation: what was wanted, what was found."""

    metric: str
    wanted: str
    found: str
    passed: bool

    @property
    def unmet(self) -> str:
        """What is not as expected; unless the job says otherwise, a path must be followed to its end."""
        if self.metric == "completes" and self.wanted == "true":
            return f"the path was not followed to its end ({self.found})"
        if self.metric == "completes":
            return "the path was followed to its end, but the job says completes = false"
        return f"expected {self.metric} {self.wanted}, found {self.found}"


@dataclass(frozen=True, eq=False)
class StrategyResult:
    """One strategy in a job: its verdict, its two paths (clockwise, counter-clockwise), its cycles, metrics, checks.

    coverage, slices: of the job's workspace, where it has one and the strategy has leaves. timed: the cycles as the
    job's [timing] has them, where it has one and they were followed to their end. motion_check: what [checks] found,
    which look at the share `followed` of the path, all of it unless the strategy stopped.

    `group` is its name in the job; results of one group differ in the orientation representation only.
    """

    name: str
    group: str
    verdict: Verdict
    two_paths: tuple[Trajectory, Trajectory] | None
    cycles: Trajectory
    status: Status
    trouble: str
    metrics: dict[str, float]
    checks: tuple[Check, ...] = field(default=())
    coverage: Coverage | None = None
    slices: tuple[Slice, ...] = ()
    timed: TimedTrajectory | None = None
    motion_check: CheckReport | None = None
    followed: float = 1.0

    @property
    def passed(self) -> bool:
        """True when every expectation holds, and the checks of its motion found nothing."""
        looked_at = self.motion_check is None or self.motion_check.passed
        return looked_at and all(check.passed for check in self.checks)

    def trajectories(self) -> dict[str, Trajectory]:
        """All trajectories by a short name."""
        named = {"cycles": self.cycles}
        if self.two_paths is not None:
            named |= {"clockwise": self.two_paths[0], "counter-clockwise": self.two_paths[1]}
        return named

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready facts."""
        v = self.verdict
        return {
            "name": self.name,
            "status": self.status.name.lower(),
            "trouble": self.trouble,
            "holonomic": v.holonomic,
            "defect": v.defect,
            "defect_unit": v.unit,
            "relative_defect": v.relative,
            "witness": v.witness.tolist(),
            "plane": list(v.plane),
            "metrics": {key: number_or_none(value) for key, value in self.metrics.items()},
            "drift_each_cycle": self.cycles.drift().tolist(),
            "coverage": self.coverage.to_dict() if self.coverage is not None else None,
            "timing": self.timed.to_dict() if self.timed is not None else None,
            "motion_check": self.motion_check.to_dict() if self.motion_check is not None else None,
            "followed": self.followed,
            "checks": [vars(check) for check in self.checks],
            "passed": self.passed,
        }


@dataclass(frozen=True)
class NotRun:
    """A strategy that could not be run, and why."""

    name: str
    reason: str


@dataclass(frozen=True, eq=False)
class JobResult:
    """A whole job's findings.

    obstacles: those of [checks] that stand still. one_way: why its path has no two paths to a pose, at which joints
    could be compared, or empty. meanings: of the metrics of its strategies; [joint] there stands for the joints' unit.
    units: in which it is printed; all values here are in rad and m. sheets: what was found of [sheets], None in a job
    without.
    """

    name: str
    title: str
    about: str
    robot: Robot
    task: str
    q0: Vector
    path: AnyPath
    cycles: int
    strategies: tuple[StrategyResult, ...]
    seconds: float
    not_run: tuple[NotRun, ...] = ()
    workspace: str = ""
    obstacles: tuple[LinkShape, ...] = ()
    one_way: str = ""
    meanings: Mapping[str, str] = field(default_factory=dict)
    units: PrintedUnits = SI
    sheets: SheetsResult | None = None

    @property
    def joint_unit(self) -> tuple[str, float]:
        """The unit in which figures of all joints are printed, and by what they are multiplied for that."""
        return self.units.together(c.unit for c in self.robot.coordinates)

    @property
    def row_unit(self) -> tuple[str, float]:
        """The same of figures of all rows of the task."""
        return self.units.together(unit for s in self.strategies for unit in s.cycles.row_units)

    def factor(self, metric: str) -> float:
        """By what a metric is multiplied to be printed: its meaning says its unit."""
        unit = re.search(r"\[([^\]]+)\]$", self.meanings.get(metric, ""))
        known = {"joint": self.joint_unit[1], "m or rad": self.row_unit[1], "m": self.units.factor("m")}
        return known.get(unit[1], 1.0) if unit else 1.0

    def meaning(self, metric: str) -> str:
        """What a metric is, with its unit as it is printed."""
        text = self.meanings[metric].replace("[joint]", f"[{self.joint_unit[0]}]")
        return text.replace("[m or rad]", f"[{self.row_unit[0]}]").replace("[m]", f"[{self.units.length}]")

    def reworded(self, text: str) -> str:
        """A text of these results in the units in which they are printed."""
        return self.units.reworded(text, [(c.name, c.unit) for c in self.robot.coordinates])

    @cached_property
    def printed(self) -> JobResult:
        """The same with the motions of its strategies in the units in which it is printed: for figures of them."""
        if self.units.plain:
            return self
        strategies = []
        for s in self.strategies:
            pair = s.two_paths and (s.two_paths[0].printed(self.units), s.two_paths[1].printed(self.units))
            strategies.append(replace(s, two_paths=pair, cycles=s.cycles.printed(self.units)))
        return replace(self, strategies=tuple(strategies))

    @property
    def drawn(self) -> tuple[StrategyResult, ...]:
        """The first result of each group: further representations would draw the same picture."""
        return tuple({result.group: result for result in reversed(self.strategies)}.values())[::-1]

    @property
    def passed(self) -> bool:
        """True when every strategy could be run, every expectation of each holds, and sheets serve what they should."""
        served = self.sheets is None or self.sheets.passed
        return not self.not_run and served and all(result.passed for result in self.strategies)

    @property
    def exit_code(self) -> int:
        """0: as expected; 1: an expectation fails; 2: a strategy could not be run, whatever the others do."""
        return 2 if self.not_run else 0 if self.passed else 1

    @cached_property
    def stems(self) -> dict[str, str]:
        """What the files of each strategy begin with: its name without what file names do not hold.

        Numbered where two strategies would write one file, also on disks that do not tell A from a.
        """
        # Name -> the STEM of its files STEM-KEY, unlike those of the others; for names with the keys of their files.
        named = {strategy.name: strategy.trajectories() for strategy in self.strategies}
        stems: dict[str, str] = {}
        used: set[str] = set()
        for name, keys in named.items():
            word = re.sub(r"[\W_]+", "-", name).strip("-")
            base = word.encode()[:80].decode(errors="ignore") or "strategy"  # a file's name may have 255 bytes
            stem, number = base, 1
            while used & (files := {f"{stem}-{key}".casefold() for key in keys}):
                number += 1
                stem = f"{base}-{number}"
            stems[name] = stem
            used |= files
        return stems


# --- The folder of a job's results: replaced whole or not at all, without the loss of what others have put there.

FACTS = "result.json"
"""The file by which a folder is known as holokin's; it names the files that holokin wrote."""


def check_folder(out: FilePath, name: str) -> FilePath:
    """`out/<name>`, where a job's results go, after what killed runs have left in `out` is repaired.

    Raises:
        ArgumentError: they cannot go there.
    """
    clear(out, _repair)
    return _checked(out, name)


def _checked(out: FilePath, name: str) -> FilePath:
    target = out / name
    if target.is_symlink() or (target.exists() and written(target) is None):
        raise ArgumentError("the output folder", str(target), "it is not one of holokin's; choose another --out")
    above = next(p for p in (out, *out.absolute().parents) if p.exists())
    fault = "" if above.is_dir() else f"{above} is not a folder"
    if above.is_dir() and not os.access(above, os.W_OK):
        fault = f"{above} may not be written"
    if fault:
        raise ArgumentError("the output folder", str(out), f"cannot be made: {fault}; choose another --out")
    return target


@contextmanager
def renewed(out: FilePath, name: str) -> Iterator[FilePath]:
    """A folder to fill, which becomes `out/<name>` when the block ends well.

    Until then the folder of an earlier run stands there, whole. It is replaced whole; what others have put into it
    moves to the new one, without being read. A file of theirs under a name that holokin needs gets ".kept" at its end.

    Raises:
        ArgumentError: the folder exists and was not written by holokin, or cannot be made.
        WriteError: the system refuses a file; the old folder stands as it was.
    """
    target = check_folder(out, name)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise ArgumentError("the output folder", str(out), f"cannot be made: {problem.strerror}") from None
    with writing(target), aside(out, _repair) as place:
        work = place / "new" / name
        work.mkdir(parents=True)
        try:
            yield work
        except WriteError as problem:  # by the name that the user knows
            if FilePath(str(problem.file)).parent != work:
                raise
            raise WriteError(target / FilePath(str(problem.file)).name, problem.problem) from problem
        with alone(out), uninterrupted():
            _checked(out, name)
            put(work, target, written(target) or set())


def free_name(label: str, ending: str, used: Container[str], *, prefix: str = "") -> str:
    """A file name for a strategy: the letters of its label, and a number where that name is taken."""
    word = "".join(c if c.isalnum() or c in "-_" else "-" for c in label).strip("-") or "strategy"
    stems = chain([word], (f"{word}-{i}" for i in count(2)))
    return next(name for stem in stems if (name := f"{prefix}{stem}{ending}") not in used)


def write_facts(folder: FilePath, facts: dict[str, Any]) -> None:
    """result.json, with the names of all files of a folder, which a later run may replace: written last."""
    write_json(folder / FACTS, facts | {"files": sorted({FACTS, *(entry.name for entry in folder.iterdir())})})


def written(folder: FilePath) -> set[str] | None:
    """Names that holokin wrote into a folder, as its result.json says; None if the folder is not holokin's."""
    facts = folder / FACTS
    try:
        names = json.loads(facts.read_text("utf-8"))["files"] if facts.is_file() else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return {str(name) for name in names} if isinstance(names, list) else None


def _repair(place: FilePath) -> None:
    """After a run that was killed while it put its folder in place; only one process does it."""
    with alone(place.parent), uninterrupted():
        restore(place, lambda held: written(held) or set())


class CellsFiles:
    """The files `<stem>-<strategy>.cells`, beside the folder of the certificates."""

    def __init__(self, stem: FilePath, resume: bool) -> None:
        self._stem, self._resume, self._files = stem, resume, dict[str, FilePath]()

    def of(self, title: str) -> FilePath:
        """That of a strategy. Raises: ArgumentError: it is there, and the run is not to go on with it."""
        used = {file.name for file in self._files.values()}
        file = self._stem.with_name(free_name(title, ".cells", used, prefix=f"{self._stem.name}-"))
        if file.exists() and not self._resume:
            cure = "a run that was stopped left it: say --resume to go on with its cells, or delete it"
            raise ArgumentError("the file of cells", str(file), cure)
        self._files[title] = file
        return file

    @property
    def count(self) -> int:
        """Cells that are kept in all of them."""
        return sum(count_kept(file) for file in self._files.values() if file.is_file())

    def remove(self) -> None:
        """Delete them: the certificates are written. Raises: WriteError."""
        for file in self._files.values():
            with writing(file):
                remove_kept(file)
