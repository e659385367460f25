"""What the audit of a dataset found: pairs of equal tool poses, and words that say how sure they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.types import Flags, Indices, NoTruthValue, Value, Vector
from ...robot import Robot
from ...strategies.tasks.task import Task
from .arcs import ToolMotion
from .equal_poses import LogVerdict
from .logs import Dataset

Numbers = NDArray[np.floating[Any]]
"""Joints and tool points in single precision, which takes half the memory."""

BLOCK = 50_000
"""Pairs that are looked at in one go: a megabyte."""

Whole = NDArray[np.integer[Any]]
"""Rows, cells and joints; 32 bits take half the memory."""

MOST_ROWS = 8
"""Episodes that are named, the worst first; `summary` has all."""


@dataclass(frozen=True, eq=False)
class ToolColumn(Value):
    """Tool points z (k, d) that were read, as `tool_points` makes them."""

    z: Numbers

    def at(self, rows: Whole) -> Numbers:
        """Those of some rows."""
        return self.z[rows]


@dataclass(frozen=True, eq=False)
class EqualPoses(Value):
    """Pairs of frames with equal tool poses: `first` and `second` (p,) are rows of the frames that were looked at;
    distance (p,) of the joints of the second, moved to the pose of the first, from those of the first; allowed (p,):
    up to which they are equal; joint (p,): the one that is farthest; unknown (p,): a joint that may be whole turns
    farther apart, which the dataset does not show, or -1."""

    first: Whole
    second: Whole
    distance: Vector
    allowed: Vector
    joint: Whole
    unknown: Whole

    @property
    def beyond(self) -> Flags:
        """Pairs whose joints differ (p,)."""
        return self.distance > self.allowed


@dataclass(frozen=True, eq=False)
class DatasetAudit(NoTruthValue, Value, ask="`.verdict`"):
    """Findings of `audit_dataset`; `str` prints them, `summary` gives them as plain data.

    episodes (e,): those that were looked at; begins (e + 1,): where each begins among the rows of `q` (k, n), joints
    [rad or m] in single precision as they are stored; tool: `tool.at(rows)` are their tool poses, as `tool_points`;
    pairs: equal poses.
    """

    robot: Robot
    dataset: Dataset
    task: Task
    feature: str
    episodes: Indices
    begins: Indices
    q: Numbers
    tool: ToolMotion | ToolColumn
    pairs: EqualPoses
    near: float
    tolerance: float
    notes: tuple[str, ...] = ()

    @property
    def decided(self) -> Flags:
        """Pairs so near that a difference of twice the tolerance would show (p,)."""
        return self.pairs.allowed <= 2 * self.tolerance

    @property
    def verdict(self) -> LogVerdict:
        """Whether equal tool poses have equal joints."""
        if self.pairs.beyond.any():
            return LogVerdict.DIFFERS
        sure = self.decided.any() and self.open_turn is None
        return LogVerdict.REPEATS if sure else LogVerdict.UNDECIDED

    @property
    def open_turn(self) -> int | None:
        """The first decided pair in which a joint may be whole turns farther apart; None where there is none."""
        found = np.flatnonzero(self.decided & (self.pairs.unknown >= 0))
        return int(found[0]) if len(found) else None

    @property
    def exit_code(self) -> int:
        """0: equal joints in all that the dataset tests; 1: not; 2: it does not show it."""
        return {LogVerdict.REPEATS: 0, LogVerdict.DIFFERS: 1, LogVerdict.UNDECIDED: 2}[self.verdict]

    def frame(self, row: int) -> tuple[int, int]:
        """(episode, frame in it) of a row."""
        at = int(np.searchsorted(self.begins, row, side="right")) - 1
        return int(self.episodes[at]), int(row - self.begins[at])

    def worst(self) -> int | None:
        """The pair that is farthest over what is allowed, or else farthest apart; None where there is none."""
        pairs = self.pairs
        if not len(pairs.first):
            return None
        if not pairs.beyond.any():
            return int(np.argmax(pairs.distance))
        return int(np.argmax(pairs.distance - pairs.allowed))

    def by_episode(self) -> list[dict[str, Any]]:
        """Of each episode with equal poses: how many, how many differ, and the worst, with its frames and place."""
        count, differ, worst = _of_episodes(self)
        return [
            {
                "episode": int(self.episodes[at]), "equal poses": int(count[at]), "differ": int(differ[at]),
                "worst": self.place(int(worst[at])),
            }
            for at in np.flatnonzero(count)
        ]  # fmt: skip

    def place(self, pair: int) -> dict[str, Any]:
        """A pair as plain data: its frames, where the tool is, and how far the joints are apart."""
        pairs = self.pairs
        (e, i), (f, j) = self.frame(int(pairs.first[pair])), self.frame(int(pairs.second[pair]))
        xyz = self.tool.at(pairs.first[pair : pair + 1])[0, :3].astype(np.float32).tolist()
        return {
            "first": {"episode": e, "frame": i}, "second": {"episode": f, "frame": j}, "tool": xyz,
            "joint": self.robot.joint_names[pairs.joint[pair]], "distance": float(pairs.distance[pair]),
            "allowed": float(pairs.allowed[pair]),
        }  # fmt: skip

    def sentence(self) -> str:
        """The verdict, what it rests on, and what the dataset does not test."""
        pairs, worst = self.pairs, self.worst()
        if worst is None:
            return (
                f"cannot tell: in {len(self.q)} frames no tool pose comes again within {1e3 * self.near:g} mm; "
                "a greater --near compares poses that are farther apart"
            )
        tests = f"{len(pairs.first)} pairs of equal tool poses"
        if self.verdict is LogVerdict.DIFFERS:
            count = int(pairs.beyond.sum())
            return f"differs: at {count} of {tests} the joints are not equal. Worst: {_place_words(self, worst)}"
        if self.verdict is LogVerdict.REPEATS:
            return (
                f"repeats: the joints are equal at all {int(self.decided.sum())} equal tool poses that are near enough "
                f"to tell (of {tests}); poses that come only once say nothing"
            )
        if self.open_turn is not None:
            return f"cannot tell: at {tests} {_turn_words(self, self.open_turn)}"
        least = float(pairs.allowed.min())
        return (
            f"cannot tell: of {tests} none is so near that a difference of {2 * self.tolerance:g} rad or m shows; the "
            f"nearest shows {least:.2g}. Give a greater --tolerance, or record poses that come again"
        )

    def rows(self) -> list[tuple[str, str]]:
        """(what, finding) of every question, for people."""
        pairs = self.pairs
        found = [
            ("equal poses, equal joints", self.verdict.value.partition(":")[0]),
            ("dataset", f"{self.dataset.folder}, format {self.dataset.version}"),
            ("looked at", f"{len(self.q)} frames of {len(self.episodes)} episodes, column {self.feature}"),
            ("task", self.task.name),
            ("equal", f"tool poses within {1e3 * self.near:g} mm, joints within {self.tolerance:g} rad or m"),
            ("pairs of equal poses", f"{len(pairs.first)}, {int(self.decided.sum())} of them near enough to decide"),
            ("of them the joints differ", str(int(pairs.beyond.sum()))),
        ]
        if len(pairs.first):
            median, most = (_size(float(v)) for v in (np.median(pairs.distance), pairs.distance.max()))
            found.append(("distance of the joints", f"median {median}, largest {most} rad or m"))
        episodes = sorted(self.by_episode(), key=lambda e: e["worst"]["allowed"] - e["worst"]["distance"])
        differ = [e for e in episodes if e["differ"]]
        if differ:
            found.append(("episodes that differ", f"{len(differ)} of {len(self.episodes)}"))
        for e in differ[:MOST_ROWS]:
            w = e["worst"]
            other = next(w[k] for k in ("second", "first") if w[k]["episode"] != e["episode"] or k == "first")
            at = f"{w['distance']:.3g} ({w['joint']}) from frame {other['frame']} of episode {other['episode']}"
            said = f"{e['differ']} of {e['equal poses']} equal poses differ, by up to {at}"
            found.append((f"episode {e['episode']}", said))
        return found + [("note", note) for note in self.notes]

    def summary(self) -> dict[str, Any]:
        """All findings as plain data."""
        worst, pairs = self.worst(), self.pairs
        return {
            "dataset": str(self.dataset.folder), "format": self.dataset.version, "robot": self.robot.name,
            "task": self.task.name, "column": self.feature, "verdict": self.verdict.name, "sentence": self.sentence(),
            "frames": len(self.q), "episodes": len(self.episodes), "equal poses": len(pairs.first),
            "of them decided": int(self.decided.sum()), "of them differ": int(pairs.beyond.sum()),
            "near": self.near, "tolerance": self.tolerance, "worst": None if worst is None else self.place(worst),
            "by episode": self.by_episode(), "notes": list(self.notes),
        }  # fmt: skip

    def __str__(self) -> str:
        return "\n".join([*(f"{what}: {found}" for what, found in self.rows()), self.sentence()])


def _of_episodes(audit: DatasetAudit) -> tuple[Indices, Indices, Indices]:
    """Of each episode (e,): its pairs, those of them that differ, and the one that is farthest over what is allowed."""
    pairs, size = audit.pairs, len(audit.episodes)
    count, differ, worst = (np.zeros(size, np.intp) for _ in range(3))
    most = np.full(size, -np.inf)

    def block(i: int) -> tuple[list[Indices], Vector]:
        rows = [column[i : i + BLOCK] for column in (pairs.first, pairs.second)]
        over = pairs.distance[i : i + BLOCK] - pairs.allowed[i : i + BLOCK]
        return [np.searchsorted(audit.begins, part, side="right") - 1 for part in rows], over

    starts = range(0, len(pairs.first), BLOCK)
    for i in starts:
        of, over = block(i)
        for mine, counts in zip(of, (np.ones(len(over), bool), of[0] != of[1]), strict=True):
            np.add.at(count, mine[counts], 1)
            np.add.at(differ, mine[counts & (over > 0)], 1)
            np.maximum.at(most, mine, over)
    for which in (1, 0):  # of equal ones the first counts, which is written last
        for i in reversed(starts):
            of, over = block(i)
            best = np.flatnonzero(over == most[of[which]])[::-1]
            worst[of[which][best]] = i + best
    return count, differ, worst


def _place_words(audit: DatasetAudit, pair: int) -> str:
    """A pair of frames, where the tool is, and how far which joint is apart."""
    p = audit.place(pair)
    (e, i), (f, j) = [(p[which]["episode"], p[which]["frame"]) for which in ("first", "second")]
    x, y, z = p["tool"]
    return (
        f"{p['distance']:.3g} ({p['joint']}) between frame {i} of episode {e} and frame {j} of episode {f}, tool at "
        f"({x:.3f}, {y:.3f}, {z:.3f}) m"
    )


def _turn_words(audit: DatasetAudit, pair: int) -> str:
    """Where a joint may be a whole turn apart, and what would tell."""
    p, joint = audit.place(pair), audit.robot.joint_names[audit.pairs.unknown[pair]]
    (e, i), (f, j) = [(p[which]["episode"], p[which]["frame"]) for which in ("first", "second")]
    return (
        f"the joints are equal but for whole turns, which the dataset does not show: {joint} may be a turn farther in "
        f"frame {j} of episode {f} than in frame {i} of episode {e}, within its limits. Say --counts-turns "
        "(counts_turns=True) if the values of the joints count whole turns"
    )


def _size(distance: float) -> str:
    """A distance of joints; what single precision rounds is not shown."""
    return f"{distance:.3g}" if distance > 1e-6 else "under 1e-6"
