"""Moves of a controller: linear, circular, of the joints; and the lines of a process between them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from ...base.arguments import check
from ...base.errors import ArgumentError
from ...base.types import Array, Flags, Indices, Matrix, Result, Value, Vector, positive
from ...base.units import PrintedUnits
from ...motion import TimedTrajectory
from ...path.path import rotation_matrix, rotation_vector, straight
from ...strategies.tasks.task import RelativeFrame, Task, of_one_tool
from ...strategies.tasks.task_kinds import pose, relative_pose

FINER = 4
"""Instants a step at which a program is held against the motion. Between two of them it is a sixteenth as far off as
between two samples: the largest distance of a curve from its chord goes with the square of the step."""


def finer(timed: TimedTrajectory, each: int = FINER) -> tuple[Vector, Matrix, Matrix]:
    """Times (k,), joints and their rates (k, n) at `each` instants a step; sample i of the motion is instant each * i.

    Between two samples by the polynomial of degree five that has the motion's joints, rates and accelerations at both.
    Where an acceleration jumps by a within a step of h seconds it is off by 0.018 a h^2 at most.
    """
    h = np.diff(timed.t)[:, None, None]
    q, dq, ddq = timed.q[:, None], timed.dq[:, None], timed.ddq[:, None]
    gone, v0, v1, a0, a1 = q[1:] - q[:-1], h * dq[:-1], h * dq[1:], h**2 * ddq[:-1], h**2 * ddq[1:]
    c3 = 10 * gone - 6 * v0 - 4 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15 * gone + 8 * v0 + 7 * v1 + 1.5 * a0 - a1
    c5 = 6 * gone - 3 * v0 - 3 * v1 - 0.5 * a0 + 0.5 * a1
    s = (np.arange(each) / each)[:, None]
    between = q[:-1] + s * (v0 + s * (a0 / 2 + s * (c3 + s * (c4 + s * c5))))
    rates = (v0 + s * (a0 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))) / h
    n = timed.q.shape[1]
    t = timed.t[:-1, None] + s[:, 0] * h[:, 0]
    return (
        np.append(t.ravel(), timed.t[-1]),
        np.vstack([between.reshape(-1, n), timed.q[-1:]]),
        np.vstack([rates.reshape(-1, n), timed.dq[-1:]]),
    )


# --- How a controller moves between two targets, and how far its tool then is from that of a timed motion.

Kind = Literal["joint", "linear", "circular"]
KINDS: tuple[Kind, ...] = ("joint", "linear", "circular")

STILL = 1e-3
"""Share of the tool's largest speed below which the tool turns in place, and has no speed to keep."""

STEPPED = 0.01
"""Share by which a motion that takes whole steps of dt is slower than its path."""

NO_WAY, SLOWEST = 1e-6, 1e-5
"""Way [m or rad] of a tool that is none, and speed [m/s] that is none: round-off."""

ARRIVED, STEPS = 1e-9, 8
"""Error [m, rad] at which a controller's inverse has arrived at a pose, and the steps of Newton's method to it."""


TOLERATED = ("position", "rotation", "speed", "joints")
"""Of a program, over the timed motion."""


@dataclass(frozen=True, eq=False)
class ToolTolerance(Value):
    """How near a program keeps the tool to a timed motion between its targets, as the controller moves there.

    Attributes:
        task: whose tool it is: a task of one tool.
        position: [m], rotation: [rad], largest distance and turn from the timed motion at the same place of the path.
        speed: largest difference from the tool's speed, as a share of it; ramps from and to rest are the controller's.
        joints: [rad or m], largest difference of the joints.
        linear: linear and circular moves where the joints, which the controller then chooses by its own inverse, stay
            within `joints`; joint moves elsewhere. Else joint moves alone.
    """

    task: Task
    position: float = 5e-4
    rotation: float = 0.01
    speed: float = 0.05
    joints: float = 0.02
    linear: bool = False

    @property
    def part(self) -> RelativeFrame | None:
        """The frame of a part that moves, as on a turntable, on which the tool has its place and speed; else None."""
        frame = getattr(self.task, "frame", None)
        return frame if isinstance(frame, RelativeFrame) else None

    def __post_init__(self) -> None:
        super().__post_init__()
        check("task", Task, self.task)
        check("linear", bool, self.linear)
        of_one_tool(self.task, "a tolerance of the tool")
        for what in TOLERATED:
            positive(f"the tolerance of {what}", getattr(self, what))
        if not self.speed < 1.0:
            raise ArgumentError("the tolerance of speed", self.speed, "give a share below 1, as 0.02 for 2 %")


@dataclass(frozen=True)
class ToolDeviation(Result):
    """How far moves are from a timed motion: of the tool [m, rad], of its speed (share), of the joints [rad or m].

    `slowest` and `fastest` [m/s] are the speeds of the tool where it has one to keep; NaN where it never has.
    `compared` is that share of the motion's time; `kept`, whether all is within what was asked for.
    """

    position: float = 0.0
    rotation: float = 0.0
    speed: float = 0.0
    joints: float = 0.0
    slowest: float = float("nan")
    fastest: float = float("nan")
    compared: float = 0.0
    kept: bool = True

    def within(self, tolerance: ToolTolerance) -> bool:
        """Whether all is kept; a NaN is not."""
        return all(getattr(self, what) <= getattr(tolerance, what) for what in TOLERATED)

    def sentences(self, unit: str = "rad or m", factor: float = 1.0) -> list[str]:
        """What is kept, of the tool in mm and degrees, of the joints in `unit`, by its factor."""
        place = f"between them the tool is within {1e3 * self.position:.2g} mm"
        sentences = [f"{place} and {np.rad2deg(self.rotation):.2g} deg of the timed motion"]
        sentences[0] += f", and the joints within {factor * self.joints:.2g} {unit}"
        if np.isfinite(self.slowest):
            least, most = f"{1e3 * self.slowest:.4g}", f"{1e3 * self.fastest:.4g}"
            speeds = f"{least} mm/s" if least == most else f"{least} to {most} mm/s"
            compared = f"{100 * self.compared:.3g} % of the time"
            sentences.append(f"its speed is {speeds}, within {100 * self.speed:.2g} % of the timed speed")
            rest = "at other times the tool starts or stops, turns in place, or is on the way to the path"
            sentences.append(f"the speed was compared for {compared}; {rest}")
        else:
            sentences.append("its speed was not compared: it only gathers speed and loses it, or turns in place")
        if not self.kept:
            sentences.append("NOT within what was asked for, from one sample to the next: time it with a smaller dt")
        sentences.append("at a target with a zone the controller rounds the corner; this deviation comes in addition")
        return sentences

    def __str__(self) -> str:
        return "; ".join([f"{'' if self.kept else 'NOT '}within what was asked for", *self.sentences()])

    def __or__(self, other: ToolDeviation) -> ToolDeviation:
        """The larger of each of the two; kept if both are."""
        names = (*TOLERATED, "fastest", "compared")
        larger = [float(np.fmax(getattr(self, name), getattr(other, name))) for name in names]
        position, rotation, speed, joints, fastest, compared = larger
        slowest, kept = float(np.fmin(self.slowest, other.slowest)), self.kept and other.kept
        return ToolDeviation(position, rotation, speed, joints, slowest, fastest, compared, kept)


@dataclass(frozen=True, eq=False)
class ToolMotion(Value):
    """A timed motion as its tool makes it, at k instants: `FINER` a step of the motion.

    Attributes:
        task: the pose of its tool; where the task is relative, that on the part.
        own: the joints (a,) that the controller moves to a pose by its inverse; the others it moves evenly.
        t, q, dq: times (k,), joints and their rates (k, n). limits: of these (n,).
        p, R: of the tool, (k, 3) and (k, 3, 3).
        way: how far the tool is along the path (k,) [m]; how far it has turned [rad] where the path has no length.
        speed: of the tool (k,) [m/s].
        asked: the speed that the path asks for (k,) [m/s], where the timed motion is as fast but for its steps of dt;
            else the speed of the tool.
        ramp: where the tool gathers speed from rest, or loses it, and before the path begins: it has no speed to keep.
    """

    task: Task
    own: Indices
    t: Vector
    q: Matrix
    dq: Matrix
    limits: Vector
    p: Matrix
    R: Array
    way: Vector
    speed: Vector
    asked: Vector
    ramp: Flags

    @staticmethod
    def of(timed: TimedTrajectory, tolerance: ToolTolerance, own: Indices) -> ToolMotion:
        """The motion of a tolerance's tool. Raises: ArgumentError: it is of another robot."""
        robot = tolerance.task.robot
        if robot.joint_names != timed.joint_names:
            raise ArgumentError("the task of the tolerance", robot.name, "give a task of the robot that moves")
        frame = tolerance.part
        task = pose(robot, tip=tolerance.task.tip) if frame is None else relative_pose(robot, frame.name, frame.other)
        t, q, dq = finer(timed)
        p, R = task._poses(q)
        J, _ = task.jacobian_batch(q)
        speed = np.linalg.norm(np.einsum("kij,kj->ki", J[:, :3], dq), axis=1)
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
        if not np.ptp(p, axis=0).max() > NO_WAY:
            turns = rotation_vector(R[1:] @ np.swapaxes(R[:-1], 1, 2))
            way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(turns, axis=1))])
        steps = _ramps(speed[::FINER], [0, *timed.stops, len(timed) - 1], tolerance.speed)
        steps[: timed.begin] = True
        ramp = np.append(np.repeat(steps[:-1] & steps[1:], FINER), steps[-1])
        ramp[::FINER] = steps
        share = np.interp(t, timed.t, timed.path_speed)
        near = np.abs(share - 1.0) < min(STEPPED, tolerance.speed / 2)
        asked = np.where(near, speed / np.where(near, share, 1.0), speed)
        return ToolMotion(task, own, t, q, dq, timed.limits.velocity, p, R, way, speed, asked, ramp)

    def share(self, a: int, b: int, rows: Indices) -> Vector:
        """How far along the move from instant a to instant b some are, by the tool's way, else by time."""
        along = self.way if self.way[b] - self.way[a] > NO_WAY else self.t
        return (along[rows] - along[a]) / (along[b] - along[a])

    def deviation(self, kind: Kind, a: int, b: int, rows: Indices) -> ToolDeviation:
        """Of one move from instant a to instant b, looked at at some instants between."""
        share, seconds = self.share(a, b, rows), self.t[b] - self.t[a]
        if kind == "joint":
            share = self._chord(a, b, rows)
            q = self.q[a] + share[:, None] * (self.q[b] - self.q[a])
            p, R = self.task._poses(q)
            J, _ = self.task.jacobian_batch(q)
            speed = np.linalg.norm(J[:, :3] @ (self.q[b] - self.q[a]), axis=1) / seconds
        else:
            p, R = self._line(a, b, share) if kind == "linear" else self._arc(a, b, share)
            speed, q = np.full(len(rows), self.steady(a, b)), self.q[rows]
        turned = rotation_vector(R @ np.swapaxes(self.R[rows], 1, 2))
        with_speed = self.has_speed[rows]
        slowest, fastest = (speed[with_speed].min(), speed[with_speed].max()) if with_speed.any() else (np.nan, np.nan)
        distance, angle = np.linalg.norm(p - self.p[rows], axis=1).max(), np.linalg.norm(turned, axis=1).max()
        faster = np.abs(speed[with_speed] / self.speed[rows][with_speed] - 1.0).max(initial=0.0)
        joints = float(np.abs(q - self.q[rows]).max())
        return ToolDeviation(float(distance), float(angle), float(faster), joints, float(slowest), float(fastest))

    @cached_property
    def has_speed(self) -> Flags:
        """Where the tool has a speed to keep (k,)."""
        return ~self.ramp & (self.speed > max(STILL * self.speed.max(), SLOWEST))

    def steady(self, a: int, b: int) -> float:
        """The speed of a linear or circular move [m/s]: the mean where there is one to keep, else the largest."""
        part = self.asked[a : b + 1]
        with_speed = part[self.has_speed[a : b + 1]]
        return float(with_speed.mean() if len(with_speed) else part.max())

    def _chord(self, a: int, b: int, rows: Indices) -> Vector:
        """How far along the line of the joints the instants are, each at its nearest point."""
        line = self.q[b] - self.q[a]
        if not line.any():
            return np.zeros(len(rows))
        return np.clip((self.q[rows] - self.q[a]) @ line / (line @ line), 0.0, 1.0)

    def joint_deviation(self, kind: Kind, a: int, b: int, rows: Indices) -> float:
        """How far the joints that the controller's inverse gives on a linear or circular move are from ours.

        Infinite where Newton's method does not arrive, and where a posture on the way is singular, or nearly so: there
        another posture at the same pose is near, and nobody knows which of them the controller takes.
        """
        if kind == "joint":
            return 0.0
        share = self.share(a, b, rows)
        p, R = self._line(a, b, share) if kind == "linear" else self._arc(a, b, share)
        q = self.q[a] + share[:, None] * (self.q[b] - self.q[a])
        q[:, self.own] = self.q[rows][:, self.own]
        for _ in range(STEPS):
            error = self.task.error(q, p, R)
            J = self.task.jacobian_batch(q)[0][:, :, self.own]
            if np.abs(error).max() <= ARRIVED:
                return float(np.abs(q - self.q[rows]).max()) if _regular(J) else float("inf")
            try:
                q[:, self.own] += np.linalg.solve(J, error[..., None])[..., 0]
            except np.linalg.LinAlgError:
                break
        return float("inf")

    def _line(self, a: int, b: int, share: Vector) -> tuple[Matrix, Array]:
        return straight(self.p[a], self.R[a], self.p[b], self.R[b]).at(share)

    def _arc(self, a: int, b: int, share: Vector) -> tuple[Matrix, Array]:
        """On the circle through the start, the sample half way along the path and the end; a line where that is flat.

        NaN where the arc is longer than a controller takes.
        """
        p, R = self._line(a, b, share)
        circle = _circle(self.p[a], self.p[self.middle(a, b)], self.p[b])
        if circle is not None:
            center, axis, angle = circle
            p = center + rotation_matrix(share[:, None] * angle * axis) @ (self.p[a] - center)
            p[:] = p if angle <= np.deg2rad(170.0) else np.nan  # controllers refuse or misread half a turn and more
        return p, R

    def load(self, kind: Kind, a: int, b: int, rows: Indices) -> float:
        """The largest share of a joint's speed limit that a move takes, ramps and all.

        A joint move takes no more than the timed motion does. A linear or circular one has one speed from end to end,
        where the timed motion may be slower, since a joint is at its limit there.
        """
        moving = rows[self.speed[rows] > STILL * self.speed.max()]
        if kind == "joint" or not len(moving):
            return 0.0
        faster = self.steady(a, b) / self.speed[moving]
        return float((np.abs(self.dq[moving]) * faster[:, None] / self.limits).max())

    def middle(self, a: int, b: int) -> int:
        """The sample half way along the path between two samples, all as instants."""
        along = self.way if self.way[b] - self.way[a] > NO_WAY else self.t
        return a + FINER * int(np.searchsorted(along[a:b:FINER], (along[a] + along[b]) / 2))


def _regular(J: Array) -> bool:
    """Whether square Jacobians (k, n, n) are all of one sign, and none is nearly singular: there controllers slow down
    or stop. 0.3 m count as much as a radian."""
    scaled = J / np.array([0.3] * 3 + [1.0] * 3)[:, None]
    sigma = np.linalg.svd(scaled, compute_uv=False)
    signs = np.sign(np.linalg.det(scaled))
    return bool((sigma[:, -1] > 0.01 * sigma[:, 0]).all() and (signs == signs[0]).all())


def _circle(start: Vector, via: Vector, end: Vector) -> tuple[Vector, Vector, float] | None:
    """Center (3,), axis (3,) and angle [rad] of the arc from start through via to end; None on a line."""
    u, v = via - start, end - start
    normal = np.cross(u, v)
    chord = float(np.linalg.norm(v))
    if not np.linalg.norm(normal) > 1e-6 * chord**2:  # as flat as a millionth of its chord
        return None
    square = float(normal @ normal)
    center = start + (np.cross(normal, u) * (v @ v) - np.cross(normal, v) * (u @ u)) / (2.0 * square)
    axis = normal / np.sqrt(square)
    x, y = start - center, end - center
    angle = float(np.arctan2(axis @ np.cross(x, y), x @ y)) % (2.0 * np.pi)
    return center, axis, angle


def _ramps(speed: Vector, rests: list[int], tolerance: float) -> Flags:
    """Where the speed (k,) rises from a rest to its first peak, but for the tolerance, or falls so to the next rest."""
    on_ramp = np.zeros(len(speed), dtype=bool)
    for first, last in pairwise(rests):
        part = speed[first : last + 1]
        on_ramp[first : first + _rise(part, tolerance)] = True
        on_ramp[last + 1 - _rise(part[::-1], tolerance) : last + 1] = True
    return on_ramp


def _rise(speed: Vector, tolerance: float) -> int:
    """How many samples there are until a speed (k,) comes near to its first peak: a step to it began on the ramp."""
    falls = np.flatnonzero(np.diff(speed) < 0.0)
    peak = speed[falls[0] if len(falls) else -1]
    return 1 + int(np.argmax(speed >= (1.0 - tolerance / 2) * peak))


PLACES = ("before", "on", "off", "after")

OUTPUT = re.compile(r"output (\d+) (on|off)")
WAIT = re.compile(r"wait (\d+(?:\.\d+)?)")

DEGREES = PrintedUnits("deg", "mm")
"""Units of the axes in most languages."""


def common(line: str) -> bool:
    """Whether a line is written in every language."""
    return bool(OUTPUT.fullmatch(line) or WAIT.fullmatch(line))


@dataclass(frozen=True, eq=False)
class ProcessLines(Value):
    """Lines of a program, in the order in which they are done.

    "output 3 on", "output 3 off" and "wait 0.5" [s] are written in every language; any other line is written as it is,
    in the controller's own language.

    Attributes:
        before: before the first move. after: after the last one.
        on, off: where the process begins and ends: when the target at its start, or its end, is reached.
        window: the path's times [s] at which it begins and ends; by default the start and the end of the path.
    """

    before: Sequence[str] = ()
    on: Sequence[str] = ()
    off: Sequence[str] = ()
    after: Sequence[str] = ()
    window: tuple[float, float] | None = field(default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        for place in PLACES:
            lines = getattr(self, place)
            check(place, Sequence[str], lines)
            for line in (lines,) if isinstance(lines, str) else lines:
                if isinstance(lines, str) or not re.fullmatch(r"[ -~]+", line) or line != line.strip():
                    cure = "give a list of lines of printable ASCII characters, without line breaks"
                    raise ArgumentError(f"the process lines of {place!r}", line, cure)


@dataclass(frozen=True)
class Dialect:
    """A controller's language.

    Attributes:
        language: its name in messages.
        output, wait, states: how an output is set, with its words for off and on, and how the program waits; no output
            where every project has its own way.
        own: how many axes its robots have; none for any number. external: how many external ones besides.
        sliding: whether axes of the robot may slide.
        kinds: the moves that it has.
        halt: what waits for the end of a move, where the program runs on before that.
        forbidden: pattern of lines that it cannot hold; `longest` characters of a line. end: what ends one.
        units: of the axes, in which the header speaks.
    """

    language: str
    output: str
    wait: str
    states: tuple[str, str]
    own: tuple[int, ...] = (6,)
    external: int = 0
    sliding: bool = False
    kinds: tuple[Kind, ...] = KINDS
    halt: str = ""
    forbidden: str = r"(?!)"
    longest: int = 200
    end: str = ""
    units: PrintedUnits = DEGREES

    def written(self, lines: Sequence[str]) -> list[str]:
        """Lines in this language. Raises: ArgumentError: one that it cannot hold."""
        return [self.halt] * bool(lines and self.halt) + [self._line(line) for line in lines]

    def _line(self, line: str) -> str:
        if match := OUTPUT.fullmatch(line):
            if not self.output:
                cure = "the outputs are those of an I/O group of your project: write its own line"
                raise ArgumentError(f"a process line of {self.language}", line, cure)
            return self.output.format(number=int(match[1]), state=self.states[match[2] == "on"]) + self.end
        if match := WAIT.fullmatch(line):
            return self.wait.format(seconds=float(match[1]), milliseconds=1e3 * float(match[1])) + self.end
        if re.match(r"(?:output|wait)\b(?=[ .\d]|$)", line):
            raise ArgumentError("a process line", line, "write 'output 3 on', 'output 3 off' or 'wait 0.5'")
        if re.search(self.forbidden, line) or len(line) > self.longest:
            most = f"{self.language} takes at most {self.longest} characters"
            raise ArgumentError("a process line", line, f"{most}, without what ends a line or starts a section")
        return line
