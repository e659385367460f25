"""`Sheets`: the leaves that together serve a workspace, asked as one function of the tool pose."""

from __future__ import annotations

import hashlib
import json
import math
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.arguments import typed
from ...base.errors import ArgumentError, BranchError, FileError, HolokinError, OutOfReachError, brief, posture_text
from ...base.files import replacing
from ...base.poses import PoseLike, given_pose, pose_from, pose_numbers, tool_poses
from ...base.types import Array, ArrayLike, Flags, Indices, Matrix, NoTruthValue, Value, Vector, finite
from ...motion.checks import Clear, Clearances, PairDistance, Scene
from ...motion.ik.inverse_function import leads_to
from ...motion.self_motions.pose_reach import Reach
from ...path import Path
from ...path.workspaces import Box, Cylinder, PoseCloud, PoseRange, Solid, Sphere, Workspace, pose_cloud, workspace
from ...proof.checker_file import need, numbers, parsed
from ...robot import Robot
from ...strategies import HolonomicStrategy
from ...strategies.tasks.task import Task
from ..coverage.starts import postures_within_limits, reached
from .follow_sheets import Stops, follow_sheets
from .seams import Seams, SheetMotion, Where, seams_of
from .sheet import PosePoints, Sheet, known, postures_of_sheets, seen_features

BLOCKED_LOOKS = 200  # poses for which clear postures are searched for at most, to tell why they are not served


class PoseRest(NoTruthValue, IntEnum, ask="`is PoseRest.SERVED`"):
    """What becomes of a pose of the workspace; `text` says it in words."""

    SERVED = 0
    NOT_COVERED = 1
    BLOCKED = 2
    LIMITS = 3
    OUT_OF_REACH = 4

    @property
    def text(self) -> str:
        """The cause in words."""
        return (
            "served by a sheet",
            "the arm reaches it, but with the joints of no sheet",
            "every posture found is too near to an obstacle, the floor or another link",
            "every posture found is beyond the joint limits",
            "out of reach: no posture was found",
        )[self]


def rests_of(task: Task, T: Array, clear: Clear | None) -> tuple[Indices, Reach]:
    """A `PoseRest` for each pose (k,), NOT_COVERED where a posture reaches it, and which are reached."""
    reach = reached(task, T, None)
    rest = np.full(len(T), int(PoseRest.NOT_COVERED))
    rest[~reach.within] = PoseRest.LIMITS
    rest[~reach.anyhow] = PoseRest.OUT_OF_REACH
    if clear is not None and reach.within.any():
        blocked = np.flatnonzero(reach.within)
        rest[blocked[~clear(reach.q[blocked])]] = PoseRest.BLOCKED
        for i in np.flatnonzero(rest == PoseRest.BLOCKED)[:BLOCKED_LOOKS]:
            postures = postures_within_limits(task, T[i])
            if len(postures) and clear(postures).any():
                rest[i] = PoseRest.NOT_COVERED
    return rest, reach


def in_the_way(task: Task, pose: Matrix, apart: Clearances | None) -> PairDistance | None:
    """The pair that is too near at a tool pose (4, 4), at that posture of those found that has the most room."""
    Q = np.zeros((0, task.n)) if apart is None else postures_within_limits(task, pose)
    return None if apart is None or not len(Q) else apart.roomiest(task, Q)


ON_LEAF = 1e-6  # difference from the level of a sheet [units of g] below which a posture lies on its leaf


@dataclass(frozen=True, eq=False)
class SheetAnswers(NoTruthValue, Value, ask="`.served`"):
    """For each of k tool poses the sheet that serves it (k,), -1 for none, and its joints (k, n), NaN for none."""

    sheet: Indices
    q: Matrix

    def __len__(self) -> int:
        return len(self.sheet)

    def __str__(self) -> str:
        counts = [(s, int((self.sheet == s).sum())) for s in np.unique(self.sheet[self.served]).tolist()]
        by_sheet = "".join(f"; {count} by sheet {s}" for s, count in counts)
        return f"{int(self.served.sum())} of {len(self)} poses are served{by_sheet}"

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
    were. length: what a turn of 1 rad counts where poses are compared [m]. scene: what postures keep clear of, None
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
    scene: Scene | None = None
    stopped: bool = False

    def __len__(self) -> int:
        return len(self.sheets)

    def __call__(self, pose: PoseLike) -> tuple[int, Vector]:
        """(index of the sheet, its joints (n,)) at a tool pose (4, 4): the same pose gives the same answer.

        Of a task of positions a point (3,) or (2,) will do.

        Raises:
            OutOfReachError: no sheet serves the pose. ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        T = self._pose(pose)
        answer = self._answer(T, ())
        if answer is None:
            raise _unserved(T[:3, 3], len(self))
        return answer

    def near(self, pose: PoseLike, q: ArrayLike) -> tuple[int, Vector]:
        """The same, but on the sheet that a posture q (n,) lies on, such as the last answer, while that serves.

        So a loop changes its sheet only where it must, and it sees a change in the index. The joints of the new sheet
        are elsewhere: `s.seams()` has the motions that lead there.

        Raises:
            OutOfReachError: no sheet serves the pose. BranchError: only sheets of the posture's own leaf do, with other
            joints than those to which the leaf leads from it. ShapeError, NotFiniteError, ArgumentError: a bad pose or
            posture.
        """
        T, begin = self._pose(pose), self.task.robot.checked(q, "the posture")
        own = self.of(begin)
        for s in own:
            answer = self.sheets[s].posture(T, self.clear)
            if answer is not None and leads_to(self.sheets[s].ik, T, begin, answer):
                return s, answer
        other = self._answer(T, own)
        if other is None:
            if self._answer(T, ()) is None:
                raise _unserved(T[:3, 3], len(self))
            fact = "the pose is served on the leaf of this posture alone, and with joints to which it does not lead"
            raise BranchError(fact, "go back by the path that was come, or stop and move the joints to s(pose)")
        return other

    def _answer(self, T: Matrix, but: Sequence[int]) -> tuple[int, Vector] | None:
        """The first sheet that serves a pose (4, 4), but for some, and its joints: first that of the nearest pose."""
        places, known_at = self._known
        first = [int(self.labels[known_at[places.nearest(T[None])[0]]])] if len(known_at) else []
        for s in dict.fromkeys([*first, *range(len(self))]):
            q = self.sheets[s].posture(T, self.clear) if s not in but else None
            if q is not None:
                return s, q
        return None

    def of(self, q: ArrayLike) -> tuple[int, ...]:
        """The sheets on whose leaves, and branches, a posture (n,) lies, to 1e-6 [units of g], within the limits.

        Raises: ShapeError, NotFiniteError.
        """
        begin = self.task.robot.checked(q, "the posture")
        T = pose_from(*self.task._place(begin))
        return tuple(
            s
            for s, sheet in enumerate(self.sheets)
            if sheet.off(begin) < ON_LEAF and leads_to(sheet.ik, T, begin, begin)
        )

    def batch(self, poses: PoseLike) -> SheetAnswers:
        """The answers of many tool poses (k, 4, 4), each as `s(pose)`. A pose that no sheet serves does not raise.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: bad poses.
        """
        T = tool_poses("of the batch", poses)
        places, known_rows = self._known
        every, k = self.postures(T), np.arange(len(T))
        first = self.labels[known_rows[places.nearest(T)]] if len(known_rows) else np.full(len(T), -1)
        served = known(every)
        chosen = np.where(served.any(axis=0), np.argmax(served, axis=0), -1)
        chosen = np.where((first >= 0) & served[first, k], first, chosen)
        return SheetAnswers(chosen, np.where((chosen >= 0)[:, None], every[chosen, k], np.nan))

    def postures(self, poses: PoseLike) -> Array:
        """The joints of every sheet (S, k, n) at tool poses (k, 4, 4), NaN where it does not serve.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: bad poses.
        """
        T = tool_poses("to be asked", poses)
        return postures_of_sheets(self.sheets, T, self.clear, self.task.n)

    @typed
    def why(self, pose: PoseLike) -> PoseRest:
        """Why a tool pose (4, 4) is served or not, by the postures of the arm there. `.text` says it in words.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        T = self._pose(pose)
        if any(sheet.posture(T, self.clear) is not None for sheet in self.sheets):
            return PoseRest.SERVED
        rests, _ = rests_of(self.task, T[None], self.clear)
        return PoseRest(int(rests[0]))

    @typed
    def reason(self, pose: PoseLike) -> str:
        """The text of `why`; where something is in the way, with the pair, its distance and where the tool is.

        Raises:
            ShapeError, NotFiniteError, ArgumentError: a bad pose.
        """
        rest = self.why(pose)
        pair = in_the_way(self.task, self._pose(pose), self.clearances) if rest is PoseRest.BLOCKED else None
        return rest.text if pair is None else f"{rest.text}: at the best one, {pair}"

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
        return seams_of(self.task, self.sheets, self.poses, self.q, self.clearances, at, self.workspace.center)

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
        return follow_sheets(self.task, self.sheets, self.clearances, path, q0, stops, samples, self.workspace.center)

    @cached_property
    def clear(self) -> Clear | None:
        """Which postures (k, n) keep clear of what was named; None where nothing was."""
        return None if self.clearances is None else self.clearances.clear

    @cached_property
    def clearances(self) -> Clearances | None:
        """How far apart the arm and what was named are; None where nothing was."""
        return None if self.scene is None else Clearances.of(self.task.robot, self.scene)

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
        of_leaves = f"of the {self.candidates} leaves compared would"
        fewer = f"no fewer {of_leaves} do" if self.least == len(self) else f"fewer than {self.least} {of_leaves} not do"
        sentence = (
            f"{many} serve{'s' if len(self) == 1 else ''} {self.served.sum()} of the {self.reachable.sum()} sampled "
        )
        sentence += f"poses that the arm reaches ({self.share:.2%}); {fewer}"
        return f"{sentence}; the search was stopped early" if self.stopped else sentence

    def __str__(self) -> str:
        lines = [self.sentence]
        for s, sheet in enumerate(self.sheets):
            count = f"taken at {(self.labels == s).sum()} poses, serves {known(self.q[s]).sum()}"
            lines.append(f"  sheet {s}: {sheet}; {count}")
        for rest in list(PoseRest)[1:]:
            if (self.rest == rest).any():
                example = "" if rest is not PoseRest.BLOCKED else self._in_the_way
                lines.append(f"  {(self.rest == rest).sum()} of {len(self.poses)} poses: {rest.text}{example}")
        fewest = "the fewest possible" if self.least_cuts == len(self.cuts) else f"at least {self.least_cuts}"
        jumps = f"at {len(self.cuts)} of {len(self.pairs)} pairs of neighbouring poses the joints jump"
        lines.append(f"  {jumps} ({fewest} with these sheets)")
        return "\n".join(lines)

    @cached_property
    def _in_the_way(self) -> str:
        """What is in the way at a pose, of those that are not served for that."""
        blocked = self.poses[self.rest == PoseRest.BLOCKED]
        pair = in_the_way(self.task, blocked[0], self.clearances)
        return "" if pair is None else f"; for instance, at the best posture of one, {pair}"

    def _pose(self, pose: PoseLike) -> Matrix:
        given = pose_numbers("a tool pose", pose)
        if given.shape in ((2,), (3,)) and self.task.orientation is None:
            T = self.workspace.center.copy()
            T[: len(given), 3] = finite("a tool position", given)
            return T
        return given_pose("a tool pose", given)

    @cached_property
    def _known(self) -> tuple[PosePoints, Indices]:
        """The sampled poses that have a sheet, and their indices."""
        points = PosePoints(self.poses[self.served], self.length, seen_features(self.task))
        return points, np.flatnonzero(self.served)


# --- A map of sheets as a file: arrays of numbers, and a text that says what they are of. Nothing in it is code.

FORMAT = 2  # changed when files of before cannot be read any more

# Size of a file's arrays, unpacked, from which on they are not read: 400,000 poses of ten sheets of seven joints.
MOST_BYTES = 1 << 28

# The arrays of a file: whole numbers without and with a sign, or others, and the shape; equal names, equal lengths.
ARRAYS = {
    "about": ("u", ("bytes",)),
    "q0": ("f", ("sheets", "joints")),
    "poses": ("f", ("poses", 4, 4)),
    "q": ("f", ("sheets", "poses", "joints")),
    "labels": ("i", ("poses",)),
    "rest": ("i", ("poses",)),
    "pairs": ("i", ("pairs", 2)),
    "cuts": ("i", ("cuts", 2)),
    "cloud": ("f", ("cloud", 4, 4)),
}

# The cure where a file is read, and says what cannot be.
CHANGED = "it is of another model of the robot, or was changed: make the map again"

OFF = 1e-6  # by how much [m, rad, units of g] the postures of a file may be off their poses and leaves

SOLIDS: dict[str, tuple[type[Solid], tuple[str, ...]]] = {
    "box": (Box, ("center", "sides")),
    "cylinder": (Cylinder, ("center", "radius", "height")),
    "sphere": (Sphere, ("center", "radius")),
}

# The strategy of the keys of a job, and of its name.
Build = Callable[[Mapping[str, Any], Task, Vector, str], HolonomicStrategy]


@typed
def write_sheets(found: Sheets, path: str | FilePath) -> None:
    """Write a map of sheets, complete or not at all.

    Raises:
        ArgumentError: strategies that were given as values, which no file can hold. WriteError.
    """
    # What cannot be written as numbers is text.
    for sheet in found.sheets:
        if not sheet.keys and found.task.n > found.task.m:
            cure = "a file holds strategies that hk.sheets chose itself, or pickle the map: pickle.dump(sheets, file)"
            raise ArgumentError("the strategy of a sheet", sheet.name, cure)
    robot, facts = found.task.robot, ("length", "stopped", "least", "least_cuts", "candidates")
    about: dict[str, Any] = {"format": FORMAT, "robot": robot.name, "joints": robot.joint_names}
    about |= {"task": found.task.name, "workspace": _workspace_keys(found.workspace)}
    about |= {"leaves": [{"name": s.name, "keys": dict(s.keys), "rcond": s.rcond} for s in found.sheets]}
    about |= {name: getattr(found, name) for name in facts} | {"around": _digest(robot, found.scene)}
    # The given poses of the workspace, where these are not the sampled ones.
    space, cloud = found.workspace, found.poses[:0]
    if isinstance(space, PoseCloud) and len(space.given) != len(found.poses):
        cloud = space.given
    arrays = {name: getattr(found, name) for name in ("poses", "q", "labels", "rest", "pairs", "cuts")}
    arrays |= {"about": np.frombuffer(json.dumps(about).encode(), dtype=np.uint8), "cloud": cloud}
    arrays["q0"] = np.array([sheet.q0 for sheet in found.sheets]).reshape(-1, found.task.n)
    with replacing(path) as part, part.open("wb") as stream:
        np.savez_compressed(stream, **arrays)


def _digest(robot: Robot, scene: Scene | None) -> str | None:
    """A short text that differs where shapes or a scene differ: SHA-256 of all numbers and names."""
    if scene is None:
        return None
    shapes = [
        [
            link_shape.link,
            link_shape.joint,
            link_shape.placement.tolist(),
            repr(link_shape.shape),
            *([] if fault else np.hstack(link_shape.shape.ball)),
        ]
        for link_shape in (*scene.obstacles, *robot.shapes)
        for fault in [link_shape.shape.fault]
    ]
    rest = [scene.floor, scene.clearance, scene.self_collision, sorted(map(list, scene.allowed))]
    if scene.padding or scene.disabled is not None:
        rest += [sorted(scene.padding.items()), [] if scene.disabled is None else sorted(scene.disabled.pairs)]
    return hashlib.sha256(json.dumps([shapes, rest]).encode()).hexdigest()[:16]


def sheets_of_file(path: str | FilePath, task: Task, scene: Scene | None, build: Build) -> Sheets:
    """The map of a file, for the task that it was made for. Raises: FileError: it cannot be read, or is of
    another robot, task or scene."""
    # The numbers, and the text that says what they are of: is it this task, and this scene?
    file = FilePath(path)
    try:
        arrays = _arrays(file)
        about = parsed(arrays.pop("about").tobytes().decode())
        if not isinstance(about, dict) or about.get("format") != FORMAT:
            raise FileError(file, "it is of another version", "write it again with this one")
        _check_about(about)
    except FileError:
        raise
    except Exception as problem:  # noqa: BLE001  ZIP, its packers, NumPy and JSON have errors of their own
        fact = f"it cannot be read: {brief(problem) or type(problem).__name__}"
        raise FileError(file, fact, "give a file that a map of sheets saved") from None
    wanted = (task.robot.name, list(task.robot.joint_names), task.name)
    given = (about["robot"], about["joints"], about["task"])
    if given != wanted:
        raise FileError(file, f"it is of {given}", f"give that robot and task, not {wanted}")
    if about["around"] != _digest(task.robot, scene):
        raise FileError(file, "it is of another scene", "give the scene that was given to hk.sheets")
    # The map, whose postures must lie at their poses and on their leaves.
    try:
        sheets: list[Sheet] = []
        for leaf, q0, q in zip(about["leaves"], arrays["q0"], arrays["q"], strict=True):
            strategy, there = build(leaf["keys"], task, q0, leaf["name"]), known(q)
            stations = q[there], arrays["poses"][there]
            sheets.append(Sheet(strategy, q0, float(leaf["rcond"]), leaf["keys"], *stations))
        cloud = arrays["cloud"] if len(arrays["cloud"]) else arrays["poses"]
        sheets_map = Sheets(
            task, _workspace_of(about["workspace"], cloud), tuple(sheets), tool_poses("of the map", arrays["poses"]),
            arrays["q"], arrays["labels"], arrays["rest"], arrays["pairs"], arrays["cuts"], about["least_cuts"],
            about["least"], about["candidates"], float(about["length"]), scene, about["stopped"],
        )  # fmt: skip
        bad = _fault(sheets_map)
    except (HolokinError, LookupError, TypeError, ValueError) as problem:
        raise FileError(file, brief(problem), CHANGED) from None
    if bad:
        raise FileError(file, bad, CHANGED)
    return sheets_map


def _arrays(file: FilePath) -> dict[str, Any]:
    """The arrays of a file, each of its kind and shape: what a header says is looked at before memory is taken.

    Raises: RejectedError, and what ZIP files, NumPy and the system raise.
    """
    if file.exists():
        need(file.is_file() and file.stat().st_size <= MOST_BYTES, f"it is no file of at most {MOST_BYTES:,} bytes")
    arrays, lengths, total = {}, dict[str, int](), 0
    with zipfile.ZipFile(file) as packed:
        for name, (kind, shape) in ARRAYS.items():
            member = packed.getinfo(f"{name}.npy")
            plain = member.compress_type in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) and not member.flag_bits & 1
            need(plain, "it is packed in another way than holokin packs it")
            with packed.open(member) as stream:
                need(np.lib.format.read_magic(stream) == (1, 0), f"{name} is no array of NumPy")
                given, by_columns, dtype = np.lib.format.read_array_header_1_0(stream)
                need(dtype.kind == kind and len(given) == len(shape), f"{name} is of another kind")
                for length, word in zip(given, shape, strict=True):
                    wanted = lengths.setdefault(word, length) if isinstance(word, str) else word
                    need(length == wanted, "its arrays do not fit each other")
                size = math.prod(given) * dtype.itemsize
                total += size
                need(total <= MOST_BYTES, f"its arrays take more than {MOST_BYTES:,} bytes: make it with fewer samples")
                data = np.frombuffer(stream.read(size), dtype).reshape(given, order="F" if by_columns else "C")
                need(not stream.read(1), f"{name} is longer than it says")  # at the end ZIP looks at the check sum
                arrays[name] = data.astype({"u": "u1", "f": "f8", "i": "i8"}[kind])
    return arrays


def _check_about(about: Mapping[str, Any]) -> None:
    """That what a file says of its arrays has the types it should. Raises: RejectedError, LookupError, TypeError."""
    leaves, counts = about["leaves"], (about["least"], about["least_cuts"], about["candidates"])
    need(isinstance(leaves, list) and isinstance(about["workspace"], dict), "its sheets or its workspace are none")
    names = [about["robot"], about["task"], *about["joints"], *(leaf["name"] for leaf in leaves)]
    need(all(isinstance(name, str) for name in names), "a name in it is none")
    need(all(isinstance(leaf["keys"], dict) for leaf in leaves), "a sheet has no strategy")
    need(all(numbers(leaf["rcond"]) and leaf["rcond"] >= 0 for leaf in leaves), "the rcond of a sheet is none")
    need(all(type(count) is int and 0 <= count < 2**31 for count in counts), "a count in it is none")
    need(numbers(about["length"]) and about["length"] >= 0, "its length of a turn is none")
    need(isinstance(about["stopped"], bool), "stopped is neither true nor false")
    need(about["around"] is None or isinstance(about["around"], str), "its scene is none")


def _fault(sheets_map: Sheets) -> str:
    """What is wrong with a map: arrays that do not fit, postures off their leaves, poses or limits; "" for nothing."""
    S, k, task = len(sheets_map), len(sheets_map.poses), sheets_map.task
    there = known(sheets_map.q)
    indices = (
        (sheets_map.labels, -1, S),
        (sheets_map.rest, 0, len(PoseRest)),
        (sheets_map.pairs, 0, k),
        (sheets_map.cuts, 0, k),
    )
    fits = all(((low <= rows) & (rows < high)).all() for rows, low, high in indices)
    if not (fits and (there | np.isnan(sheets_map.q).all(axis=-1)).all()):
        return "its arrays do not fit each other"
    if not there[sheets_map.labels[sheets_map.served], np.flatnonzero(sheets_map.served)].all():
        return "a pose is served by a sheet without a posture there"
    for s, sheet in enumerate(sheets_map.sheets):
        T, q = sheet.places, sheet.stations
        off = task.error(q, T[:, :3, 3], T[:, :3, :3]).ravel() if len(q) else np.zeros(0)
        if task.n > task.m:
            levels = sheet.strategy.constraint_value.batch(sheet.begin).reshape(len(sheet.begin), -1)
            off = np.concatenate([off, sheet.strategy.constraint.nearest(levels - sheet.level).ravel()])
        if not (np.abs(off) <= OFF).all() or not task.robot.within(sheet.begin).all():
            return f"postures of sheet {s} do not lie at their poses, on their leaf, within the limits"
    return ""


def _workspace_keys(space: Workspace) -> dict[str, Any]:
    if not isinstance(space, PoseRange):
        return {"kind": "poses", "source": space.source if isinstance(space, PoseCloud) else str(space)}
    kind = next(word for word, (solid, _) in SOLIDS.items() if type(space.solid) is solid)
    sizes = {name: np.asarray(getattr(space.solid, name)).tolist() for name in SOLIDS[kind][1]}
    return {"kind": kind, "solid": sizes, "rotation": space.rotation.tolist(), "tilt": space.tilt, "spin": space.spin}


def _workspace_of(keys: Mapping[str, Any], poses: Array) -> Workspace:
    """Raises: LookupError, TypeError and what `workspace` and `pose_cloud` raise: the keys are of none."""
    kind = keys["kind"]
    if kind == "poses":
        return pose_cloud(poses, str(keys["source"]))
    sizes = {kind: [keys["solid"][name] for name in SOLIDS[kind][1]]}
    return workspace(**sizes, rotation=keys["rotation"], tilt=keys["tilt"], spin=keys["spin"])


def _unserved(position: Vector, sheets: int) -> OutOfReachError:
    fact = f"none of the {sheets} sheets serves" if sheets != 1 else "the only sheet does not serve"
    cure = "ask s.why(pose), keep to the workspace, or ask for more of it: hk.sheets(..., share=1)"
    return OutOfReachError(f"{fact} the pose at {posture_text(position)} m", cure, position=position)
