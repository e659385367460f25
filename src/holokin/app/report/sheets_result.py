"""What a job found of its [sheets]: the map, the share that was wanted, and the motion along the job's path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...analysis.sheets import SheetMotion, Sheets
from ...base.types import NoTruthValue, Value
from ...motion.trajectory import Trajectory


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
        said = "is reached" if self.passed else "is not reached"
        return f"a share of {self.wanted:.2%} was wanted: it {said} ({self.found.share:.2%})"

    @property
    def seconds(self) -> float:
        """How long all changes along the path take at the joints' speed limits, the tool at rest."""
        return 0.0 if self.along is None else sum(one.seconds for one in self.along.seams)

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

    def summary(self) -> dict[str, Any]:
        """JSON-ready facts."""
        s, m = self.found, self.along
        return {
            "sheets": [str(one) for one in s.sheets], "share": s.share, "wanted": self.wanted, "passed": self.passed,
            "poses": len(s.poses), "reachable": int(s.reachable.sum()), "served": int(s.served.sum()),
            "least": s.least, "candidates": s.candidates, "stopped": s.stopped, "file": self.file or None,
            "remark": self.remark, "unfollowed": self.unfollowed,
            "path": None if m is None else {
                "complete": m.complete, "changes": m.changes, "seconds_of_changes": self.seconds,
                "pieces": [{"sheet": one.sheet, "start": one.start, "stop": one.stop} for one in m.pieces],
                "divisions": [
                    {"at": one.at, "first": one.first, "second": one.second, "reason": one.reason}
                    for one in m.divisions
                ],
                "left_out": [{"start": one.start, "stop": one.stop, "reason": one.reason} for one in m.left_out],
            },
        }  # fmt: skip
