"""What a page is told: the state of each law, and of the whole session, as frozen values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from ...base.types import Array, Flags, Indices, Matrix, Value, Vector


@dataclass(frozen=True, eq=False)
class Origin(Value):
    """What a job says of the robot and the task of a session, and the folder from which files are named."""

    robot: Mapping[str, Any]
    task: Mapping[str, Any]
    folder: FilePath


class LawStatus(Enum):
    """How a law stands to its target; the text says it in a few words."""

    FOLLOWING = "following"
    OUT_OF_REACH = "out of reach"
    SINGULAR = "singular"
    LIMIT = "joint limit"
    STOPPED = "stopped"


class CloudStatus(Enum):
    """How far a coverage has got."""

    RUNNING = "running"
    DONE = "done"
    CANCELLED = "cancelled"
    FAILED = "failed"


class Phase(Enum):
    """What a session is doing."""

    IDLE = "idle"
    GATHERING = "gathering"
    RUNNING = "running"
    PAUSED = "paused"
    DONE = "done"


@dataclass(frozen=True, eq=False)
class Judgement(Value):
    """What is known of a law at a posture, found in the background.

    holonomic, defect and sentence as of `hk.involutivity` about the start; `curvature`: the largest |F_ij| of
    `hk.curvature` at the posture q (n,), drift over the area of a small loop [joint unit / task unit^2].
    """

    holonomic: bool
    defect: float
    sentence: str
    curvature: float
    q: Vector


@dataclass(frozen=True, eq=False)
class LawState:
    """One law at one instant.

    Attributes:
        name, colour, holonomic: as of `Law`.
        q: joints (n,) [rad, m].
        status, sentence: whether it follows, and else why not and what helps, in one sentence; empty while it follows.
        rcond: how near it is to singular, 1 good, 0 singular; NaN of a control law.
        level: g(q) (r,) of a holonomic law; empty for others.
        drift: largest joint's distance from the loop's start posture after 1, 2, ... cycles (cycles,), as of
            `hk.drift(...).largest`; NaN from a cycle on in which the law had stopped.
        drift_joints: the same joint by joint (cycles, n), signed.
        t, history: instants (k,) [s] and joints (k, n) of the loop since it began, the latest ones.
        judgement: None until it is known, and of control laws.
    """

    name: str
    colour: int
    holonomic: bool
    q: Vector
    status: LawStatus
    sentence: str
    rcond: float
    level: Vector
    drift: Vector
    drift_joints: Matrix
    t: Vector
    history: Matrix
    judgement: Judgement | None = None

    @property
    def following(self) -> bool:
        """True while its tool is at the target."""
        return self.status is LawStatus.FOLLOWING


@dataclass(frozen=True, eq=False)
class Cloud:
    """How far a coverage has got, and what it found, ready to be drawn.

    Attributes:
        law: its name. done, total: poses looked at, of how many.
        status: whether it goes on; `sentence` says why it failed, else empty.
        points: positions (k, 3) [m] of the poses looked at. reached: (k,).
        margin: (k,) least distance to a joint limit over half the joint's range, 1 in the middle, 0 at a limit; NaN
            where it is not reached. rcond: (k,), NaN where it is not reached.
        why: (k,) the status of each pose, `PoseStatus`.
    """

    law: str
    done: int
    total: int
    status: CloudStatus
    sentence: str
    points: Matrix
    reached: Flags
    margin: Vector
    rcond: Vector
    why: Indices


@dataclass(frozen=True, eq=False)
class LeafCusps:
    """Cusps of the leaf on which a law stood when they were asked for, ready to be drawn.

    Attributes:
        law: its name. level: g(q) = c (r,) of the leaf. running: whether they are still looked for.
        sentence: what was found, or why none were looked for.
        place: position (3,) [m] of the tool at the nearest one, None where there is none.
        loop: points (k, 3) [m] of the smallest tool loop found that does not bring the joints back; none where k is 0.
    """

    law: str
    level: Vector
    running: bool
    sentence: str
    place: Vector | None
    loop: Matrix


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A session at one instant: all that a page draws. It never changes, and any thread may read it.

    Attributes:
        number: counts the changes of the session; two snapshots with one number are equal.
        phase: idle, gathering (the joints move to where the loop begins), running, paused, done.
        laws: the state of each, in order.
        target: where the tool is wanted, (F, 4, 4), a pose of each frame of the task; F is 1 but for tasks of several.
        loop: how many times `Session.set_loop` was called; the curve is to be drawn again when it changes.
        progress: share of the cycle that is done, 0 to 1. cycle: complete cycles. time: of the loop [s].
        factor: of the speed. cycles: after which the loop ends, None for never. clockwise: the other way round.
        message: one sentence on the session as a whole, such as why a loop cannot begin; empty if all is well.
        cloud: the coverage, if one was asked for. cusps: those of a leaf, if they were asked for.
        loop_fault: the first law that does not get round the loop, and why; empty until it is known, and if all do.
        fault: what failed in the background; empty if nothing did.
    """

    number: int
    phase: Phase
    laws: tuple[LawState, ...]
    target: Array
    loop: int
    progress: float
    cycle: int
    time: float
    factor: float
    cycles: int | None
    clockwise: bool
    message: str
    cloud: Cloud | None = None
    cusps: LeafCusps | None = None
    loop_fault: str = ""
    fault: str = ""

    def law(self, name: str) -> LawState:
        """The state of a law by name."""
        return next(state for state in self.laws if state.name == name)

    @property
    def following(self) -> bool:
        """True where every law follows."""
        return all(state.following for state in self.laws)

    @property
    def spread(self) -> float:
        """Largest joint difference between any two laws [joint units]."""
        q = np.array([state.q for state in self.laws])
        return float((q.max(axis=0) - q.min(axis=0)).max(initial=0.0)) if len(q) else 0.0
