"""`retime`: the joint curve of a trajectory, run through as fast as the limits of the joints allow."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.types import HUGE, ArrayLike, Matrix, Vector, numbers, positive, whole
from ..robot import GIVE_SPEEDS, Robot, speed_limits
from .joint_curve import Stretch, joint_curve
from .time_law import FINEST, TimeLaw, quintic, smoothed, time_optimal
from .timed_trajectory import RATES, Limits, Slowdown, TimedTrajectory
from .trajectory import Trajectory
from .trapezoid import fastest_trapezoid

Profile = Literal["time-optimal", "trapezoidal", "quintic"]
"""The kinds of speed profiles."""

WINDOWS, FINER = 12, 2
"""Windows of smoothing between a step and half of the time, of which the fastest is taken; and how often as many more
are tried about it: 3 % lie between the last ones."""

ROUGHLY = 500
"""Instants at which laws are compared; at those of `FINEST` and more the chosen one is looked at."""

TRIES = 20
"""Times that a motion is slowed by a step or more because a sample exceeds a limit; none or one is needed. What is left
then is the round-off of differences, 2e-9 rad/s^2 at 1 kHz, which no slower motion has less of."""

STEADY = 1e-6
"""Relative difference of the path speeds at both ends of a cycle up to which it may be repeated;
that of accelerations may be a thousand times as large, for they are its differences on the grid."""

BETWEEN = 17
"""Instants within a step at which it is asked which limit binds."""

BINDS = 0.9
"""Share of a limit from which on it is said to bind; below it is the shape of the profile that takes the time."""

ALMOST = 0.99
"""Share of the largest share from which on a sample counts when it is asked which limit binds in most of a part."""

EVEN = 1e-6
"""Relative change of the path speed from sample to sample up to which it is constant."""

SLOW = 2e-3
"""Share by which the path speed is below the one asked for before it is called slower: rounding up to whole steps of a
controller takes a thousandth of it."""

MOST_STEPS = 4_000_000
"""Samples of a timed trajectory: an hour at 1 kHz, and a gigabyte for seven joints."""


GIVE_VELOCITY = f"{GIVE_SPEEDS}, or give the motion its own: velocity= here or in [timing], where inf is no limit"
"""What to do about a joint without a speed limit in a motion that is to be timed."""


@typed
def retime(
    trajectory: Trajectory,
    robot: Robot,
    *,
    acceleration: ArrayLike | None = None,
    jerk: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    profile: Profile = "time-optimal",
    speed: float | None = None,
    cycles: int | None = None,
    endless: bool = False,
    dt: float = 0.001,
) -> TimedTrajectory:
    """Time a trajectory under limits of joint speed, acceleration and jerk, from rest to rest, at a controller's step.

    The joints take the curve through the samples of the trajectory, quintic splines between the corners of the
    path; at a corner they rest. Where all cycles are alike, as those of a holonomic strategy, one is timed for all.
    The start and the end of every cycle, and every corner, are samples: the trajectory's own, to the last bit.

    s(t) runs through the curve q(s) by one of three profiles, within every limit at every sample, by exact derivatives
    and by differences of samples:

    - "time-optimal": the fastest law under speed and acceleration, by reachability, TOPP-RA [PP18].
    - "trapezoidal": a ramp up, a constant rate of s, a ramp down; each ramp is as short as its own place allows.
    - "quintic": s = 10 x^3 - 15 x^4 + 6 x^5 of the time's share x, slowed until the limits hold.

    A limit of the jerk gives trapezoids ramps whose acceleration rises and falls evenly. Time-optimal laws keep it by
    a moving average of s(t), over the window that is the fastest in the end: the curve stays the same, since only the
    time along it is smoothed. That is not the least time under a limit of jerk.

    Args:
        robot: whose limits of position, and of speed, hold.
        acceleration: largest accelerations [rad/s^2 or m/s^2], one for all joints or (n,); needed for "time-optimal"
            and "trapezoidal".
        jerk: the same of the jerks; None for no limit.
        velocity: the same of the speeds; by default the robot's `max_velocity`, of which no joint may lack one.
            `math.inf` is no limit.
        speed: a bound of the tool's speed, as a share of the speed with which the trajectory was followed: 1 keeps
            the path's constant speed wherever the limits allow it. None for as fast as the limits allow.
        cycles: runs of the cycle; by default as many as the trajectory has.
        endless: three cycles of which the middle one may be repeated without end; see `TimedTrajectory.loop`. With a
            corner in the path the joints rest in every cycle, and any cycle can be repeated.
        dt: the controller's step [s].

    Returns:
        The motion at every step.

    Raises:
        ArgumentError: bad limits, or a joint without a speed limit; a trajectory that did not reach its end; cycles of
        one that does not repeat.
        ShapeError: limits that are not n numbers.
    """
    n = trajectory.q.shape[1]
    if trajectory.joint_names != robot.joint_names:
        raise ArgumentError("the robot", robot.name, "give the one that the trajectory is of")
    if profile not in get_args(Profile):
        raise ArgumentError("profile", profile, f"use one of {', '.join(get_args(Profile))}")
    speeds = speed_limits(robot, GIVE_VELOCITY) if velocity is None else velocity
    limits = Limits(
        robot.lower, robot.upper, _limit("velocity", speeds, n),
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
    """Samples of a stretch: [q, dq, ddq, dddq] (k, n), path speed (k,), indices of the laps' ends, seconds smoothed.

    `taken` (k, 2): the largest share of a limit taken within half a step of a sample, and which one, counted through
    rates and joints. It is known where the path speed is below that asked for.
    """

    rows: list[Matrix]
    speed: Vector
    taken: Matrix
    ends: list[int]
    window: float


@dataclass(frozen=True)
class _Plan:
    limits: Limits
    profile: Profile
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
        if self.profile == "quintic":
            return quintic(laps * stretch.length), 0.0
        if self.profile == "trapezoidal":
            return fastest_trapezoid(stretch, laps, self._bounds, self.speed), 0.0
        bare = time_optimal(stretch, laps, *self._bounds, self.speed)
        if not np.isfinite(self.limits.jerk).any():
            return bare, 0.0
        gentle = time_optimal(stretch, laps, *self._bounds, self.speed, bare)
        law, w = bare, 0.5
        least = min(0.1, self.dt / bare.duration)
        tried = [
            (law, w) for law in (bare, gentle) for w in np.geomspace(least, 0.5, WINDOWS).tolist()
        ]  # a share of the time
        step = (0.5 / least) ** (1 / (WINDOWS - 1))
        for _ in range(1 + FINER):
            taken = [
                self._slowing(stretch, smoothed(law, w * law.duration), ROUGHLY) * law.duration * (1 + w)
                for law, w in tried
            ]
            law, w = tried[int(np.argmin(taken))]
            tried = [(law, w), *((law, x) for x in (w * np.geomspace(1 / step, step, WINDOWS)).tolist() if x <= 0.5)]
            step **= 2 / (WINDOWS - 1)
        return smoothed(law, w * law.duration), w * law.duration

    def _slowing(self, stretch: Stretch, law: TimeLaw, count: int = 2 * FINEST) -> float:
        """The factor of time by which every limit just holds, looked at at all pieces of the law and between."""
        _, (s, *rates) = law.within(count)
        found = stretch.motion(s, rates)[1:]
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
        when = np.concatenate(times)
        s, *rates = law.at(when)
        taken = self._taken(stretch, law, when, rates[0])
        rates[0][[0, -1]] = 0.0
        rows = stretch.motion(s, rates)
        rows[0][0], rows[0][ends] = stretch.q[0], stretch.q[-1]
        return _Part(rows, rates[0], taken, [int(i) for i in ends], factor * window)

    def _taken(self, stretch: Stretch, law: TimeLaw, t: Vector, rate: Vector) -> Matrix:
        """See `_Part`: looked at between the samples too, for a ramp may be shorter than a step."""
        found = np.zeros((len(t), 2))
        slow = np.flatnonzero(rate < (1.0 - SLOW) * self.speed) if np.isfinite(self.speed) else np.zeros(0, dtype=int)
        for part in np.split(slow, range(10_000, len(slow), 10_000)):
            if not len(part):
                continue
            near = np.clip(t[part, None] + self.dt * np.linspace(-0.5, 0.5, BETWEEN), 0.0, law.duration)
            s, *rates = law.at(near.ravel())
            moved = stretch.motion(s, rates)[1:]
            shares = np.stack([np.abs(x / b) for x, b in zip(moved, self._bounds, strict=True)], axis=1)
            shares = shares.reshape(len(part), BETWEEN, -1).max(axis=1)
            found[part] = np.column_stack([shares.max(axis=1), shares.argmax(axis=1)])
        return found


def _open(stretch: Stretch) -> Stretch:
    return Stretch(stretch.s, stretch.q)


def _limit(what: str, given: ArrayLike | None, n: int) -> Vector:
    """Limits (n,), infinite where there are none. Raises: ArgumentError, ShapeError."""
    if given is None:
        return np.full(n, np.inf)
    found = numbers(what, given)
    if found.shape not in ((), (n,)) or not ((found > 0) & ((found <= HUGE) | (found == np.inf))).all():
        raise ArgumentError(what, given, f"give one positive number, or {n} of them, at most {HUGE:g}")
    return np.broadcast_to(found, (n,))


def _lap_ends(law: TimeLaw, length: float, laps: int) -> list[float]:
    """Times at which all laps but the last end."""
    from scipy.optimize import brentq

    def past(t: float, lap: int) -> float:
        return float(law.at(np.array([t]))[0][0]) - lap * length

    found = [brentq(past, 0.0, law.duration, args=(lap,), xtol=1e-15) for lap in range(1, laps)]
    return [float(t) for t in found]  # type: ignore[arg-type]  no RootResults, which are given when asked for


def _differences(q: Matrix, dt: float) -> list[Matrix]:
    """First and second differences of samples that begin and end at rest; the third drown in round-off."""
    held = np.vstack([q[:1], q[:1], q, q[-1:], q[-1:]])
    return [np.diff(held, order, axis=0) / dt**order for order in (1, 2)]


def _joined(trajectory: Trajectory, plan: _Plan, parts: list[_Part], times: int, endless: bool) -> TimedTrajectory:
    """One stretch after the other, the whole `times` times; the end of one is the start of the next."""
    columns: list[list[Matrix]] = [[] for _ in range(6)]
    stops: list[int] = []
    marks = [0]
    count = 1
    for _ in range(times):
        for part in parts:
            skip = int(count > 1)
            for column, rows in zip(columns, [*part.rows, part.speed, part.taken], strict=True):
                column.append(rows[skip:])
            laps = [count - 1 + end for end in part.ends]
            count += part.ends[-1]
            stops.append(count - 1)
            if part is parts[-1]:
                marks += laps
    q, dq, ddq, dddq, speed, taken = (np.concatenate(column) for column in columns)
    if len(marks) == max(2, len(trajectory.marks)):
        q[marks[-1]] = trajectory.q[-1]
    t = np.asarray(np.arange(len(q)) * plan.dt, dtype=float)
    loop = (marks[1], marks[2]) if endless else None
    if loop is not None:
        jumps = [float(np.abs(x[loop[1]] - x[loop[0]]).max() / np.abs(x).max()) for x in (speed, ddq)]
        if jumps[0] > STEADY or jumps[1] > 1e3 * STEADY:
            cure = f"the second of three {plan.profile} cycles is not steady: give larger accelerations, or cycles="
            raise ArgumentError("the jump of an endless cycle", max(jumps), cure)
    slow = _slowdowns(trajectory, plan, t, speed, taken)
    return TimedTrajectory(
        trajectory, plan.limits, plan.profile, plan.dt, t, q, dq, ddq, dddq, speed, tuple(marks),
        tuple(k for k in stops if k < len(q) - 1), loop, slow, max(part.window for part in parts),
    )  # fmt: skip


def _slowdowns(trajectory: Trajectory, plan: _Plan, t: Vector, speed: Vector, taken: Matrix) -> tuple[Slowdown, ...]:
    """Where the path speed is below that asked for; a constant speed has a reason of its own, its ramps have theirs."""
    if not np.isfinite(plan.speed):
        return ()
    slow = speed < (1.0 - SLOW) * plan.speed
    still = np.concatenate([[False], np.abs(np.diff(speed)) <= EVEN * plan.speed])
    even = still & np.concatenate([still[1:], [False]]) & (speed > SLOW * plan.speed)
    kind = np.where(slow, 1 + even, 0)
    edges = np.flatnonzero(np.diff(kind)) + 1
    found = []
    for part in np.split(np.arange(len(t)), edges):
        if not kind[part[0]]:
            continue
        share = taken[part, 0].max()
        among = taken[part[taken[part, 0] >= ALMOST * share], 1].astype(
            int
        )  # the last half step is also the next part's
        rate, joint = divmod(int(np.bincount(among).argmax()), len(trajectory.joint_names))
        least = float(speed[part].min() / plan.speed)
        binds = share >= BINDS
        name, limit = (trajectory.joint_names[joint], RATES[rate]) if binds else ("", f"{plan.profile} profile")
        found.append(Slowdown(float(t[part[0]]), float(t[part[-1]]), least, name, limit))
    return tuple(found)
