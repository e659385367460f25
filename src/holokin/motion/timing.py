"""`retime`: the joint curve of a trajectory, run through as fast as the limits of the joints allow."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..arguments import typed
from ..errors import ArgumentError
from ..robot import Robot
from ..trajectory import Trajectory
from ..types import ArrayLike, Matrix, Vector, numbers, positive, whole
from .joint_curve import Stretch, joint_curve
from .time_law import FINEST, TimeLaw, quintic, smoothed, time_optimal, trapezoidal
from .timed import RATES, Limits, Slowdown, TimedTrajectory

PROFILES = ("time-optimal", "trapezoidal", "quintic")

SHARES = np.linspace(0.02, 0.5, 17)
"""Shares of the time in which a trapezoidal law accelerates; the fastest is taken."""

WINDOWS = np.geomspace(2e-3, 0.5, 18)
"""Windows of smoothing, as shares of the time, of which the fastest is taken: a third lies between two."""

ROUGHLY = 500
"""Instants at which laws are compared; at those of `FINEST` and more the chosen one is looked at."""

TRIES = 20
"""Times that a motion is slowed by a step or more because a sample exceeds a limit; none or one is needed. What is left
then is the round-off of differences, 2e-9 rad/s^2 at 1 kHz, which no slower motion has less of."""

STEADY = 1e-6
"""Relative difference of the path speeds at both ends of a cycle up to which it may be repeated, toppra's own accuracy;
that of accelerations may be a thousand times as large, for they are its differences on the grid."""

SLOW = 2e-3
"""Share by which the path speed is below the one asked for before it is called slower: rounding up to whole steps of a
controller takes a thousandth of it."""

MOST_STEPS = 4_000_000
"""Samples of a timed trajectory: an hour at 1 kHz, and a gigabyte for seven joints."""


@typed
def retime(
    trajectory: Trajectory,
    robot: Robot,
    *,
    acceleration: ArrayLike | None = None,
    jerk: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    profile: str = "time-optimal",
    speed: float | None = None,
    cycles: int | None = None,
    endless: bool = False,
    dt: float = 0.001,
) -> TimedTrajectory:
    """Time a trajectory under limits of joint speed, acceleration and jerk, from rest to rest, at a controller's step.

    The joints take the curve through the samples of the trajectory, quintic splines between the corners of the
    path; at a corner they rest. Where all cycles are alike, as those of a holonomic strategy, one is timed for all.
    The start and the end of every cycle, and every corner, are samples: the trajectory's own, to the last bit.

    s(t) runs through the curve q(s) by one of three profiles, each slowed until every limit holds at every sample, by
    exact derivatives and by differences of samples:

    - "time-optimal": the fastest law under speed and acceleration, by TOPP-RA [PP18] (extra `timing`).
    - "trapezoidal": even acceleration of s, constant rate, even braking; the fastest share of acceleration is taken.
    - "quintic": s = 10 x^3 - 15 x^4 + 6 x^5 of the time's share x.

    A limit of the jerk is kept by a moving average of s(t), over the window that is the fastest in the end: the curve
    stays the same, since only the time along it is smoothed. That is not the least time under a limit of jerk.

    Args:
        robot: whose limits of position, and of speed, hold.
        acceleration: largest accelerations [rad/s^2 or m/s^2], one for all joints or (n,); needed for "time-optimal"
            and "trapezoidal".
        jerk: the same of the jerks; None for no limit.
        velocity: the same of the speeds; by default the robot's `max_velocity`.
        speed: a bound of the tool's speed, as a share of the speed with which the trajectory was followed: 1 keeps
            the path's constant speed wherever the limits allow it. None for as fast as the limits allow.
        cycles: runs of the cycle; by default as many as the trajectory has.
        endless: three cycles of which the middle one may be repeated without end; see `TimedTrajectory.loop`. With a
            corner in the path the joints rest in every cycle, and any cycle can be repeated.
        dt: the controller's step [s].

    Returns:
        The motion at every step.

    Raises:
        ArgumentError: bad limits; a trajectory that did not reach its end; cycles of one that does not repeat.
        ShapeError: limits that are not n numbers. MissingExtraError: toppra is not installed.
    """
    n = trajectory.q.shape[1]
    if trajectory.joint_names != robot.joint_names:
        raise ArgumentError("the robot", robot.name, "give the one that the trajectory is of")
    if profile not in PROFILES:
        raise ArgumentError("profile", profile, f"use one of {', '.join(PROFILES)}")
    limits = Limits(
        robot.lower, robot.upper, _limit("velocity", robot.max_velocity if velocity is None else velocity, n),
        _limit("acceleration", acceleration, n), _limit("jerk", jerk, n),
    )  # fmt: skip
    if profile != "quintic" and not np.isfinite(limits.acceleration).all():
        raise ArgumentError("acceleration", acceleration, f"a {profile} profile needs that of every joint")
    if not any(np.isfinite(getattr(limits, rate)).any() for rate in RATES) and speed is None:
        raise ArgumentError("the limits", None, "give at least one of velocity, acceleration, jerk and speed")
    most = np.inf if speed is None else positive("speed", speed)
    curve = joint_curve(trajectory)
    had = max(1, trajectory.cycles) if curve.repeats else 1
    count = 3 if endless else had if cycles is None else whole("cycles", cycles)
    if (endless or count > 1) and not curve.repeats:
        raise ArgumentError("cycles", count, "the trajectory does not end where it started; retime it as a whole")
    laps = count if curve.smooth else 1
    plan = _Plan(limits, profile, most, positive("dt", dt))
    parts = [plan.timed(_open(stretch) if laps == 1 else stretch, laps) for stretch in curve.stretches]
    return _joined(trajectory, plan, parts, count // laps, endless)


@dataclass(frozen=True, eq=False)
class _Part:
    """Samples of a stretch: [q, dq, ddq, dddq] (k, n), path speed (k,), indices of the laps' ends, seconds smoothed."""

    rows: list[Matrix]
    speed: Vector
    ends: list[int]
    window: float


@dataclass(frozen=True)
class _Plan:
    limits: Limits
    profile: str
    speed: float
    dt: float

    def timed(self, stretch: Stretch, laps: int) -> _Part:
        """A stretch, run through from rest to rest some laps long: with as few steps as keep the limits."""
        run = min(laps, 3)
        law, window = self._law(stretch, run)
        ends = _lap_ends(law, stretch.length, run)
        base = law.duration if run < 3 else ends[1] - ends[0]
        wanted = self._slowing(stretch, law) * base / self.dt
        if not wanted * laps <= MOST_STEPS:  # NaN and infinity included
            cure = f"it takes {wanted * laps:.3g} steps: give a longer one, or larger limits"
            raise ArgumentError("dt", self.dt, cure)
        steps = max(2, int(np.ceil(wanted * (1 - 1e-12))))
        part = self._sampled(stretch, law, steps * self.dt / base, laps, window)
        for _ in range(TRIES):
            worst = max(self.worst(part.rows[1:]), self.worst(_differences(part.rows[0], self.dt)))
            if worst <= 1.0:
                break
            steps += 1 + int(steps * (worst - 1.0) / 4)
            part = self._sampled(stretch, law, steps * self.dt / base, laps, window)
        return part

    def _law(self, stretch: Stretch, laps: int) -> tuple[TimeLaw, float]:
        length = laps * stretch.length
        if self.profile == "quintic":
            return quintic(length), 0.0
        if self.profile == "time-optimal":
            limits = self.limits
            bounds = limits.velocity, limits.acceleration, limits.jerk
            laws = [time_optimal(stretch, laps, *bounds, self.speed)]
        else:
            laws = [trapezoidal(length, float(share)) for share in SHARES]
            if not np.isfinite(self.limits.jerk).any():
                return min(laws, key=lambda law: self._slowing(stretch, law, ROUGHLY) * law.duration), 0.0
        if not np.isfinite(self.limits.jerk).any():
            return laws[0], 0.0
        tried = [(smoothed(law, w), w) for law in laws for w in (WINDOWS * law.duration).tolist()]
        return min(tried, key=lambda pair: self._slowing(stretch, pair[0], ROUGHLY) * pair[0].duration)

    def _slowing(self, stretch: Stretch, law: TimeLaw, count: int = 2 * FINEST) -> float:
        """The factor of time by which every limit just holds, looked at at all pieces of the law and between."""
        _, (s, *rates) = law.within(count)
        found = _motion(stretch, s, rates)[1:]
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            ratios = [
                float(np.abs(x / limit).max()) ** (1.0 / order)
                for order, (x, limit) in enumerate(zip(found, self._bounds, strict=True), 1)
            ]
        return max(*ratios, float(rates[0].max()) / self.speed)

    @property
    def _bounds(self) -> tuple[Vector, Vector, Vector]:
        return self.limits.velocity, self.limits.acceleration, self.limits.jerk

    def worst(self, rates: list[Matrix]) -> float:
        """The largest share of a limit taken."""
        pairs = zip(rates, self._bounds, strict=False)
        return max(float(np.abs(x / limit).max()) for x, limit in pairs if len(x))

    def _sampled(self, stretch: Stretch, law: TimeLaw, factor: float, laps: int, window: float) -> _Part:
        """Samples at every step and at the end of every lap; the first and the last step may rest for a while."""
        law = law.slower(factor)
        run = min(laps, 3)
        inner = _lap_ends(law, stretch.length, run)
        if not inner:
            count = round(law.duration / self.dt)
            times = [np.append(np.arange(count) * self.dt, law.duration)]
        else:
            before, after = (int(np.ceil(x / self.dt - 1e-9)) for x in (inner[0], law.duration - inner[-1]))
            middle = [a + self.dt * np.arange(1, 1 + round((b - a) / self.dt)) for a, b in pairwise(inner)]
            first = np.append(inner[0] - self.dt * np.arange(before, 0, -1), inner[0])
            times = [first, *middle * (laps - 2), np.append(inner[-1] + self.dt * np.arange(1, after), law.duration)]
        ends = np.cumsum([len(part) for part in times]) - 1
        s, *rates = law.at(np.concatenate(times))
        rates[0][[0, -1]] = 0.0
        rows = _motion(stretch, s, rates)
        rows[0][0], rows[0][ends] = stretch.q[0], stretch.q[-1]
        return _Part(rows, rates[0], [int(i) for i in ends], factor * window)


def _open(stretch: Stretch) -> Stretch:
    return Stretch(stretch.s, stretch.q)


def _limit(what: str, given: ArrayLike | None, n: int) -> Vector:
    """Limits (n,), infinite where there are none. Raises: ArgumentError, ShapeError."""
    if given is None:
        return np.full(n, np.inf)
    found = numbers(what, given)
    if found.shape not in ((), (n,)) or not (found > 0).all():
        raise ArgumentError(what, given, f"give one positive number, or {n} of them")
    return np.broadcast_to(found, (n,))


def _lap_ends(law: TimeLaw, length: float, laps: int) -> list[float]:
    """Times at which all laps but the last end."""
    from scipy.optimize import brentq

    def past(t: float, lap: int) -> float:
        return float(law.at(np.array([t]))[0][0]) - lap * length

    found = [brentq(past, 0.0, law.duration, args=(lap,), xtol=1e-15) for lap in range(1, laps)]
    return [float(t) for t in found]  # type: ignore[arg-type]  no RootResults, which are given when asked for


def _motion(stretch: Stretch, s: Vector, rates: list[Vector]) -> list[Matrix]:
    """[q, dq, ddq, dddq] of q(s(t)) from s and its three derivatives in time, by the chain rule."""
    q, d1, d2, d3 = stretch.derivatives(s)
    v, a, j = (rate[:, None] for rate in rates)
    return [q, d1 * v, d2 * v**2 + d1 * a, d3 * v**3 + 3 * d2 * v * a + d1 * j]


def _differences(q: Matrix, dt: float) -> list[Matrix]:
    """First and second differences of samples that begin and end at rest; the third drown in round-off."""
    held = np.vstack([q[:1], q[:1], q, q[-1:], q[-1:]])
    return [np.diff(held, order, axis=0) / dt**order for order in (1, 2)]


def _joined(trajectory: Trajectory, plan: _Plan, parts: list[_Part], times: int, endless: bool) -> TimedTrajectory:
    """One stretch after the other, the whole `times` times; the end of one is the start of the next."""
    columns: list[list[Matrix]] = [[] for _ in range(5)]
    stops: list[int] = []
    marks = [0]
    count = 1
    for _ in range(times):
        for part in parts:
            skip = int(count > 1)
            for column, rows in zip(columns, [*part.rows, part.speed], strict=True):
                column.append(rows[skip:])
            laps = [count - 1 + end for end in part.ends]
            count += part.ends[-1]
            stops.append(count - 1)
            if part is parts[-1]:
                marks += laps
    q, dq, ddq, dddq, speed = (np.concatenate(column) for column in columns)
    if len(marks) == max(2, len(trajectory.marks)):
        q[marks[-1]] = trajectory.q[-1]
    t = np.asarray(np.arange(len(q)) * plan.dt, dtype=float)
    loop = (marks[1], marks[2]) if endless else None
    if loop is not None:
        jumps = [float(np.abs(x[loop[1]] - x[loop[0]]).max() / np.abs(x).max()) for x in (speed, ddq)]
        if jumps[0] > STEADY or jumps[1] > 1e3 * STEADY:
            cure = f"the second of three {plan.profile} cycles is not steady: give larger accelerations, or cycles="
            raise ArgumentError("the jump of an endless cycle", max(jumps), cure)
    slow = _slowdowns(trajectory, plan, t, [dq, ddq, dddq], speed)
    return TimedTrajectory(
        trajectory, plan.limits, plan.profile, plan.dt, t, q, dq, ddq, dddq, speed, tuple(marks),
        tuple(k for k in stops if k < len(q) - 1), loop, slow, max(part.window for part in parts),
    )  # fmt: skip


def _slowdowns(
    trajectory: Trajectory, plan: _Plan, t: Vector, rates: list[Matrix], speed: Vector
) -> tuple[Slowdown, ...]:
    if not np.isfinite(plan.speed):
        return ()
    edges = np.diff(np.concatenate([[0], speed < (1.0 - SLOW) * plan.speed, [0]]).astype(int))
    found = []
    for first, last in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1, strict=True):
        bounds = (plan.limits.velocity, plan.limits.acceleration, plan.limits.jerk)
        shares = np.array([np.abs(x[first : last + 1] / b).max(axis=0) for x, b in zip(rates, bounds, strict=True)])
        rate, joint = np.unravel_index(int(shares.argmax()), shares.shape)
        least = float(speed[first : last + 1].min() / plan.speed)
        name = trajectory.joint_names[int(joint)]
        found.append(Slowdown(float(t[first]), float(t[last]), least, name, RATES[int(rate)]))
    return tuple(found)
