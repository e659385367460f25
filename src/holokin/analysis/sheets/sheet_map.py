"""`Sheets`: the leaves that together serve a workspace, asked as one function of the tool pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, BranchError, NoSheetError
from ...base.poses import PoseLike, given_pose, pose_from, pose_numbers, tool_poses
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, NoTruthValue, Value, Vector, finite
from ...motion.checks import Clear
from ...motion.ik.quiet_answers import leads_to
from ...path import Path
from ...path.workspaces import PoseRange, Workspace
from ...proof import UniqueRegion, unique_region
from ...strategies.tasks.task import Task
from .follow_sheets import Stops, follow_sheets
from .pose_features import PosePoints, seen_features
from .pose_rest import PoseRest, rests_of
from .seams import Seams, Where, seams_of
from .sheet import Sheet, known
from .sheet_motion import SheetMotion
from .surroundings import Surroundings

ON_LEAF = 1e-6
"""Difference from the level of a sheet [units of g] below which a posture lies on its leaf."""

CELLS = 20_000
"""Cells of a proof that may be examined."""


@dataclass(frozen=True, eq=False)
class SheetAnswers(NoTruthValue, Value, ask="`.served`"):
    """For each of k tool poses the sheet that serves it (k,), -1 for none, and its joints (k, n), NaN for none."""

    sheet: Indices
    q: Matrix

    def __len__(self) -> int:
        return len(self.sheet)

    @property
    def served(self) -> Flags:
        """True where a sheet serves the pose (k,)."""
        return self.sheet >= 0


@dataclass(frozen=True, eq=False)
class Sheets(NoTruthValue, Value, ask="`.share`"):
    """The sheets that serve a workspace, and for each pose the one that is taken. Make one with `hk.sheets`.

    `s(pose)` is a function of the pose alone: it takes the sheet of the nearest sampled pose; if that does not serve
    the pose, the first one that does. `s.near(pose, q)` stays on the sheet of q while that serves.

    poses: sampled ones (k, 4, 4). q: joints of each sheet at each (S, k, n), NaN where it does not serve. labels: the
    sheet that is taken (k,), -1 for none. rest: a `PoseRest` for each (k,). pairs: neighbours among the poses (e, 2);
    cuts: those between which the joints do not continue (c, 2); least_cuts: no choice among these sheets has fewer.
    least: no fewer of the candidates serve as much, by the poses that the search looked at; candidates: how many there
    were. length: what a turn of 1 rad counts where poses are compared [m]. around: what postures keep clear of, None
    for nothing. stopped: whether the search was stopped early.
    """

    task: Task
    workspace: Workspace
    sheets: tuple[Sheet, ...]
    poses: Array
    q: Array
    labels: Indices
    rest: Indices
    pairs: Indices
    cuts: Indices
    least_cuts: int
    least: int
    candidates: int
    length: float
    around: Surroundings | None = None
    stopped: bool = False

    def __len__(self) -> int:
        return len(self.sheets)

    def __call__(self, pose: PoseLike) -> tuple[int, Vector]:
        """(index of the sheet, its joints (n,)) at a tool pose (4, 4): the same pose gives the same answer.

        Of a task of positions a point (3,) or (2,) will do.

        Raises:
            NoSheetError: no sheet serves the pose. ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        at = self._pose(pose)
        found = self._answer(at, ())
        if found is None:
            raise NoSheetError(at[:3, 3], len(self))
        return found

    def near(self, pose: PoseLike, q: ArrayLike) -> tuple[int, Vector]:
        """The same, but on the sheet that a posture q (n,) lies on, such as the last answer, while that serves.

        So a loop changes its sheet only where it must, and it sees a change in the index. The joints of the new sheet
        are elsewhere: `s.seams()` has the motions that lead there.

        Raises:
            NoSheetError: no sheet serves the pose. BranchError: only sheets of the posture's own leaf do, with other
            joints than those to which the leaf leads from it. ShapeError, NotFiniteError, ArgumentError: a bad pose or
            posture.
        """
        at, begin = self._pose(pose), self.task.robot.checked(q, "the posture")
        own = self.of(begin)
        for s in own:
            found = self.sheets[s].posture(at, self.clear)
            if found is not None and leads_to(self.sheets[s].ik, at, begin, found):
                return s, found
        other = self._answer(at, own)
        if other is None:
            if self._answer(at, ()) is None:
                raise NoSheetError(at[:3, 3], len(self))
            fact = "the pose is served on the leaf of this posture alone, and with joints to which it does not lead"
            raise BranchError(fact, "go back by the path that was come, or stop and move the joints to s(pose)")
        return other

    def _answer(self, at: Matrix, but: Sequence[int]) -> tuple[int, Vector] | None:
        """The first sheet that serves a pose (4, 4), but for some, and its joints: first that of the nearest pose."""
        places, known_at = self._known
        first = [int(self.labels[known_at[places.nearest(at[None])[0]]])] if len(known_at) else []
        for s in dict.fromkeys([*first, *range(len(self))]):
            q = self.sheets[s].posture(at, self.clear) if s not in but else None
            if q is not None:
                return s, q
        return None

    def of(self, q: ArrayLike) -> tuple[int, ...]:
        """The sheets on whose leaves, and branches, a posture (n,) lies, to 1e-6 [units of g], within the limits.

        Raises: ShapeError, NotFiniteError.
        """
        begin = self.task.robot.checked(q, "the posture")
        at = pose_from(*self.task.place(begin))
        return tuple(
            s for s, sheet in enumerate(self.sheets)
            if sheet.off(begin) < ON_LEAF and leads_to(sheet.ik, at, begin, begin)
        )  # fmt: skip

    def batch(self, poses: PoseLike) -> SheetAnswers:
        """The answers of many tool poses (k, 4, 4), each as `s(pose)`. A pose that no sheet serves does not raise.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: bad poses.
        """
        T = tool_poses("of the batch", poses)
        places, at = self._known
        every, k = self.postures(T), np.arange(len(T))
        first = self.labels[at[places.nearest(T)]] if len(at) else np.full(len(T), -1)
        served = known(every)
        taken = np.where(served.any(axis=0), np.argmax(served, axis=0), -1)
        taken = np.where((first >= 0) & served[first, k], first, taken)
        return SheetAnswers(taken, np.where((taken >= 0)[:, None], every[taken, k], np.nan))

    def postures(self, poses: PoseLike) -> Array:
        """The joints of every sheet (S, k, n) at tool poses (k, 4, 4), NaN where it does not serve.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: bad poses.
        """
        T = tool_poses("to be asked", poses)
        found = [sheet.postures(T, self.clear)[0] for sheet in self.sheets]
        return np.array(found).reshape(len(self), len(T), self.task.n)

    @typed
    def why(self, pose: PoseLike) -> PoseRest:
        """Why a tool pose (4, 4) is served or not: a search for postures there. `.text` says it in words.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        at = self._pose(pose)
        if any(sheet.posture(at, self.clear) is not None for sheet in self.sheets):
            return PoseRest.SERVED
        return PoseRest(int(rests_of(self.task, at[None], self.clear)[0]))

    @typed
    def seams(self, at: Where = None) -> Seams:
        """Where the arm changes from one sheet to another with its tool still: the fastest change for each pair.

        The motion is a self-motion, within the joint limits and clear of what was named. A pair without one is in
        `.missing`, with the reason.

        Args:
            at: where the arm may change: a tool pose (4, 4) such as a fixture, or several; a workspace, which may be as
                thin as a plane; or a function of a tool pose that is true where it may, asked at the sampled poses. By
                default anywhere at the sampled poses.

        Returns:
            The seams; `.between(first, second)` has that of a pair.

        Raises:
            ArgumentError, ShapeError, NotFiniteError: bad poses.
        """
        return seams_of(self.task, self.sheets, self.poses, self.q, self.clear, at, self.workspace.center)

    @typed
    def follow(
        self, path: Path, q0: ArrayLike | None = None, *, stops: Stops = None, samples: int = 500
    ) -> SheetMotion:
        """Follow a path over the sheets: with the fewest divisions, of these the fewest changes.

        Dynamic programming over the samples of the path finds the best of all choices of sheets, and of equal ones
        that with the least joint motion. A change is a self-motion with the tool at rest; where there is none the path
        is divided: the arm must leave it to go on. What no sheet serves is left out, and named. Joint motion is
        measured in seconds at the joints' speed limits.

        Args:
            path: of the tool. Where it says no rotation, the tool starts with that at q0, or else with that in the
                middle of the workspace.
            q0: start posture (n,), one of a sheet at the start of the path; by default the best.
            stops: where the sheet may change: shares of the path's duration from 0 to 1, or a function of a tool pose
                (4, 4) that is true where it may; by default at all samples, [] for nowhere.
            samples: steps of the path, at least.

        Returns:
            The motion; `.trajectory` is that of the whole path, with its changes.

        Raises:
            ArgumentError: q0 is a posture of no sheet there, bad stops or samples. StartError: its tool is not at the
            start of the path. ShapeError, NotFiniteError.
        """
        return follow_sheets(self.task, self.sheets, self.clear, path, q0, stops, samples, self.workspace.center)

    @typed
    def certified(
        self, sheet: int, workspace: PoseRange | None = None, *, budget: int = CELLS,
        say: Callable[[str], None] = lambda _text: None,
    ) -> UniqueRegion:  # fmt: skip
        """The part of a box of tool poses over which a sheet is proven to be one function, as of `hk.unique_region`.

        Within the joint limits, and clear of what was named. It hangs together with the pose of the sheet's station
        that is nearest to the middle of the box. A box with tilt and spin has up to six dimensions: many cells.

        Args:
            sheet: its index.
            workspace: `workspace(box=...)`; by default that of the map.
            budget: cells that may be examined; more prove more.
            say: hears of the progress.

        Returns:
            The region: its share, its certificate, and what is not proven and why.

        Raises:
            ArgumentError: no such sheet; a workspace that is no box. NoProofError, SingularityError, ExpressionError.
        """
        if not 0 <= sheet < len(self):
            raise ArgumentError("the sheet", sheet, f"give an index from 0 to {len(self) - 1}")
        space = self.workspace if workspace is None else workspace
        if not isinstance(space, PoseRange):
            raise ArgumentError("workspace", str(space), "give a box: hk.workspace(box=...)")
        one = self.sheets[sheet]
        q = one.nearest_station(space.center)
        a = self.around
        kept: dict[str, Any] = {} if a is None else {
            "clear_of": a.obstacles, "floor": a.floor, "clearance": a.clearance, "self_collision": a.self_collision,
            "ignore": a.ignore, "shapes_of": a.shapes_of,
        }  # fmt: skip
        return unique_region(one.strategy, q, space, budget=budget, say=say, **kept)

    @cached_property
    def clear(self) -> Clear | None:
        """Which postures (k, n) keep clear of what was named; None where nothing was."""
        return None if self.around is None else self.around.clear(self.task.robot)

    @property
    def served(self) -> Flags:
        """Which of the sampled poses have a sheet (k,)."""
        return self.labels >= 0

    @property
    def reachable(self) -> Flags:
        """Which of them some posture reaches, within the limits and clear of what was named (k,)."""
        return self.rest <= PoseRest.NOT_COVERED

    @property
    def share(self) -> float:
        """Share of the poses served, of those that some posture reaches."""
        return float(self.served.sum() / max(1, self.reachable.sum()))

    @property
    def sentence(self) -> str:
        """How many sheets serve how much."""
        many = f"{len(self)} sheet{'' if len(self) == 1 else 's'}"
        proven = "no fewer" if self.least == len(self) else f"at least {self.least}"
        said = f"{many} serve{'s' if len(self) == 1 else ''} {self.served.sum()} of the {self.reachable.sum()} sampled "
        said += (
            f"poses that the arm reaches ({self.share:.2%}); of the {self.candidates} leaves compared, {proven} will do"
        )
        return f"{said}; the search was stopped early" if self.stopped else said

    def __str__(self) -> str:
        lines = [self.sentence]
        for s, sheet in enumerate(self.sheets):
            lines.append(f"  sheet {s}: {sheet}; taken at {(self.labels == s).sum()} poses, serves {self._served(s)}")
        for rest in list(PoseRest)[1:]:
            if (self.rest == rest).any():
                lines.append(f"  {(self.rest == rest).sum()} of {len(self.poses)} poses: {rest.text}")
        fewest = "the fewest possible" if self.least_cuts == len(self.cuts) else f"at least {self.least_cuts}"
        jumps = f"at {len(self.cuts)} of {len(self.pairs)} pairs of neighbouring poses the joints jump"
        lines.append(f"  {jumps} ({fewest} with these sheets)")
        return "\n".join(lines)

    def _served(self, s: int) -> int:
        return int(known(self.q[s]).sum())

    def _pose(self, pose: PoseLike) -> Matrix:
        given = pose_numbers("a tool pose", pose)
        if given.shape in ((2,), (3,)) and self.task.orientation is None:
            at = self.workspace.center.copy()
            at[: len(given), 3] = finite("a tool position", given)
            return at
        return given_pose("a tool pose", given)

    @cached_property
    def _known(self) -> tuple[PosePoints, Indices]:
        """The sampled poses that have a sheet, and their indices."""
        points = PosePoints(self.poses[self.served], self.length, seen_features(self.task))
        return points, np.flatnonzero(self.served)
