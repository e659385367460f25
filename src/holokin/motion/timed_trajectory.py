"""`TimedTrajectory`: joint motion at a controller's own step, with what it takes of every limit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any, Literal

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.files import write_csv
from ..base.types import Matrix, Result, Shown, Value, Vector, number_or_none
from ..base.units import SI, PrintedUnits
from .trajectory import Trajectory

NOTHING = 1e-6
"""Peak of a rate [joint units / s, s^2, s^3] that a table shows as 0: round-off, up to jerks at 1 kHz."""

RATES = ("velocity", "acceleration", "jerk")

Profile = Literal["time-optimal", "trapezoidal", "quintic"]
"""The kinds of speed profiles."""


@dataclass(frozen=True, eq=False)
class Limits(Value):
    """Of the joints (n,): positions [joint units], and their largest first, second and third derivatives in time."""

    lower: Vector
    upper: Vector
    velocity: Vector
    acceleration: Vector
    jerk: Vector


@dataclass(frozen=True)
class Slowdown(Shown):
    """From `start` to `stop` [s] the tool is slower than asked for, at least `least` of it, and why.

    `joint` and `limit` are those of which the largest share is taken: velocity, acceleration or jerk. Where no
    limit is reached the profile's shape takes the time: then `joint` is empty, and `limit` names the profile.
    """

    start: float
    stop: float
    least: float
    joint: str
    limit: str

    def __str__(self) -> str:
        reason = f"the {self.limit} of {self.joint}" if self.joint else f"the shape of the {self.limit}"
        share = f"{100 * self.least:.{1 if 0.99 < self.least < 1.0 else 0}f} % of the wanted speed"
        slowest = share if self.least >= 5e-3 else "a stop"
        return f"{self.start:.3f} to {self.stop:.3f} s: slower than wanted, down to {slowest}; the reason is {reason}"


@dataclass(frozen=True)
class JointLoad(Shown):
    """What one joint does: its greatest speed, acceleration and jerk, their shares of its limits (NaN without one), and
    its least distance to a position limit [joint units], with the time of that [s]."""

    joint: str
    unit: str
    peaks: tuple[float, ...]
    shares: tuple[float, ...]
    distance: float
    distance_at: float

    @typed
    def printed(self, units: PrintedUnits) -> JointLoad:
        """The same in other units."""
        by = units.factor(self.unit)
        peaks = tuple(by * peak for peak in self.peaks)
        return replace(self, unit=units.name(self.unit), peaks=peaks, distance=by * self.distance)


@dataclass(frozen=True, eq=False)
class TimedTrajectory(Result, Value):
    """Joint motion at k instants, a step `dt` apart, from rest to rest.

    Attributes:
        untimed: the trajectory that was timed.
        limits: of the joints.
        profile: "time-optimal", "trapezoidal" or "quintic".
        dt: the controller's step [s].
        t, q, dq, ddq, dddq: times (k,) [s], joints and their exact derivatives (k, n).
        path_speed: how fast the path is run through (k,), 1 where the tool has the speed of its path.
        marks: indices at which cycles begin, and the last one ends.
        stops: indices between start and end at which the joints rest, since the tool turns a corner.
        loop: (first, last) of the samples that may be repeated without end, at full speed: the joints have the same
            positions, rates and accelerations at both; None where that is no question.
        slowdowns: where the tool is slower than asked for, and why.
        window: seconds over which accelerations are smoothed to keep the jerk; 0 for none.
        begin: index at which the path begins; before it an entry leads there.
    """

    untimed: Trajectory
    limits: Limits
    profile: Profile
    dt: float
    t: Vector
    q: Matrix
    dq: Matrix
    ddq: Matrix
    dddq: Matrix
    path_speed: Vector
    marks: tuple[int, ...]
    stops: tuple[int, ...]
    loop: tuple[int, int] | None
    slowdowns: tuple[Slowdown, ...]
    window: float
    begin: int = 0

    def __len__(self) -> int:
        return len(self.t)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of q."""
        return self.untimed.joint_names

    @property
    def joint_units(self) -> tuple[str, ...]:
        """Units of the joints: "rad" or "m"."""
        return self.untimed.joint_units

    @property
    def duration(self) -> float:
        """Seconds from the start to the end."""
        return float(self.t[-1])

    @cached_property
    def loads(self) -> tuple[JointLoad, ...]:
        """One a joint. Distances to position limits are infinite where there are none."""
        gaps = np.minimum(self.q - self.limits.lower, self.limits.upper - self.q)
        loads = []
        for i, (joint, unit) in enumerate(zip(self.joint_names, self.joint_units, strict=True)):
            peaks = [float(np.abs(x[:, i]).max()) for x in (self.dq, self.ddq, self.dddq)]
            bounds = [float(getattr(self.limits, rate)[i]) for rate in RATES]
            shares = [p / b if np.isfinite(b) else float("nan") for p, b in zip(peaks, bounds, strict=True)]
            nearest = int(np.argmin(gaps[:, i]))
            loads.append(
                JointLoad(joint, unit, tuple(peaks), tuple(shares), float(gaps[nearest, i]), float(self.t[nearest]))
            )
        return tuple(loads)

    @property
    def nearest_limit(self) -> JointLoad:
        """The joint that comes nearest to a limit of its position; compare `.distance` [rad or m]."""
        return min(self.loads, key=lambda load: load.distance)

    @typed
    def excess(self, by: Literal["derivative", "difference"] = "derivative") -> dict[str, float]:
        """The largest share of each limit that is taken, less 1: negative where all is within.

        Args:
            by: "derivative" for the exact derivatives at the samples; "difference" for what a controller sees, the
                first, second and third differences of successive samples over dt, dt^2, dt^3. Those of a loop are
                taken over its seam, too. Round-off of q makes third differences uncertain by 8 eps max|q| / dt^3,
                3e-6 rad/s^3 at 1 kHz.

        Returns:
            velocity, acceleration and jerk, the latter without those that have no limit.
        """
        if by not in ("derivative", "difference"):
            raise ArgumentError("by", by, "use 'derivative' or 'difference'")
        if by == "derivative":
            rates = [self.dq, self.ddq, self.dddq]
        else:
            rates = [np.diff(self.played, order, axis=0) / self.dt**order for order in (1, 2, 3)]
        pairs = {rate: (x, getattr(self.limits, rate)) for rate, x in zip(RATES, rates, strict=True)}
        return {
            rate: float((np.abs(x) / limit).max()) - 1.0
            for rate, (x, limit) in pairs.items()
            if np.isfinite(limit).any()
        }

    @property
    def played(self) -> Matrix:
        """The joints at each step of a controller, a loop run twice, and two steps of rest before and after (k, n)."""
        first, last = self.loop or (0, 0)
        rest = np.repeat([0, len(self) - 1], 2)
        return self.q[np.concatenate([rest[:2], np.arange(last + 1), np.arange(first + 1, len(self)), rest[2:]])]

    @property
    def sentence(self) -> str:
        """Profile, duration, samples, and the greatest speed over that of the path."""
        times = f"{self.path_speed.max():.3g}"
        own = "the path's own speed"
        fastest = f"never faster than {own}" if times == "1" else f"at most {times} times {own}"
        return f"{self.profile}, {self.duration:.3f} s, {len(self)} samples of {1e3 * self.dt:g} ms, {fastest}"

    def __str__(self) -> str:
        return self.table()

    @typed
    def table(self, units: PrintedUnits = SI) -> str:
        """Lines of text: a joint each with its peaks, shares of limits, and least distance to a position limit."""
        lines = [self.sentence + ("" if units.plain else f", in {units.angle} and {units.length}")]
        lines.append(f"{'joint':20} {'speed':>15} {'acceleration':>15} {'jerk':>15} {'to a limit':>12} {'at [s]':>8}")
        for load in (joint_load.printed(units) for joint_load in self.loads):
            cells = [
                f"{peak if peak > NOTHING else 0.0:8.4g} {100 * share:4.0f} %"
                if np.isfinite(share)
                else f"{peak if peak > NOTHING else 0.0:15.4g}"
                for peak, share in zip(load.peaks, load.shares, strict=True)
            ]
            near = f"{load.distance:.4g}" if np.isfinite(load.distance) else "none"
            name = load.joint if len(load.joint) <= 20 else f"{load.joint[:17]}..."
            lines.append(f"{name:20} {cells[0]} {cells[1]} {cells[2]} {near:>12} {load.distance_at:8.3f}")
        lines += [str(slow) for slow in self.slowdowns]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """JSON-ready facts, without the samples."""
        joints = []
        for load in self.loads:
            shares, distance = [number_or_none(share) for share in load.shares], number_or_none(load.distance)
            joints.append(vars(load) | {"peaks": list(load.peaks), "shares": shares, "distance": distance})
        return {what: getattr(self, what) for what in ("profile", "duration", "dt", "window")} | {
            "marks": list(self.marks),
            "stops": list(self.stops),
            "loop": self.loop,
            "joints": joints,
            "slowdowns": [vars(slow) for slow in self.slowdowns],
        }

    @typed
    def save(self, path: str | FilePath, units: PrintedUnits = SI) -> None:
        """Write CSV with a header of names and units: time [s], then position, rate and acceleration of each joint.

        Full precision, one line a sample, complete or not at all.

        Raises:
            WriteError: the system refuses the file.
        """
        pairs = list(zip(self.joint_names, map(units.name, self.joint_units), strict=True))
        header = ["time [s]", *(f"{name} [{unit}]" for name, unit in pairs)]
        header += [f"d_{name} [{unit}/s]" for name, unit in pairs] + [f"dd_{name} [{unit}/s^2]" for name, unit in pairs]
        scaled = [values * units.factors(self.joint_units) for values in (self.q, self.dq, self.ddq)]
        write_csv(path, header, np.column_stack([self.t, *scaled]).tolist())


def with_entry(entry: TimedTrajectory, timed: TimedTrajectory) -> TimedTrajectory:
    """A timed motion after the timed way to its start, with a rest between them."""
    k, later = len(entry) - 1, entry.duration

    def rows(what: str) -> Matrix:
        return np.concatenate([getattr(entry, what)[:-1], getattr(timed, what)])

    slow = (replace(s, start=s.start + later, stop=s.stop + later) for s in timed.slowdowns)
    return replace(
        timed,
        t=np.concatenate([entry.t[:-1], later + timed.t]),
        **{what: rows(what) for what in ("q", "dq", "ddq", "dddq")},
        path_speed=np.concatenate([np.zeros(k), timed.path_speed]),
        marks=tuple(k + mark for mark in timed.marks),
        stops=(*entry.stops, *([k] if k else []), *(k + stop for stop in timed.stops)),
        loop=None if timed.loop is None else (k + timed.loop[0], k + timed.loop[1]),
        slowdowns=tuple(slow),
        begin=k,
    )
