"""`hand_follower`: joints that follow a hand within limits of speed, acceleration and jerk, and rest at its nearest
pose.

Each call asks `ik.nearest` for the posture that belongs to the hand, and moves the joints towards it by the
time-optimal profile of Ruckig [BK21], computed anew from where they are and how fast they go.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.extra_module import extra_module
from ..base.poses import PoseLike
from ..base.types import ArrayLike, NoTruthValue, Value, Vector, frozen, number, one_or_each
from ..robot import speed_limits
from .ik.inverse_function import InverseKinematics, Nearest

LONGEST = 1.0
"""Longest period of a loop [s]: a longer one is in milliseconds."""

AT_REST = 1e-9
"""Distance and speed [joint units, and per second] at which the joints have come to rest."""


@dataclass(frozen=True, eq=False)
class Followed(NoTruthValue, Value, ask="`.resting`"):
    """What a call commands: joints q (n,), their rates dq and accelerations ddq, one period after the last call.

    nearest: the answer of `ik.nearest`, whose posture the joints go to; its status says what is wrong with a pose.
    behind: largest distance of a joint from there [joint units]. While it is not zero the joints go straight, and their
    posture is near the leaf, not on it. resting: the joints rest where they belong.
    """

    q: Vector
    dq: Vector
    ddq: Vector
    nearest: Nearest
    behind: float
    resting: bool


@dataclass(frozen=True, eq=False)
class HandFollower(Value):
    """Limits of a loop that follows a hand; make one with `hand_follower`, and a run of it with `begin`.

    dt: its period [s]. max_velocity, max_acceleration, max_jerk: (n,), per s, s^2 and s^3; a jerk may be infinite.
    """

    ik: InverseKinematics
    dt: float
    max_velocity: Vector
    max_acceleration: Vector
    max_jerk: Vector

    def begin(self, q0: ArrayLike) -> Callable[[PoseLike], Followed]:
        """A run that begins at rest at q0 (n,): a function of the hand's pose, called once each period.

        Raises (when called): ShapeError: what is no pose. A pose that is not finite, or no rotation, keeps the last
        target, and `.nearest.status` says so.

        Raises:
            ShapeError, NotFiniteError, JointLimitError: q0. MissingExtraError: ruckig is not installed.
        """
        ruckig, robot = extra_module("ruckig", "teleoperation"), self.ik.strategy.task.robot
        q = robot.checked(q0, "the posture to begin from")
        robot.check_limits(q)
        profile, state = ruckig.Ruckig(robot.n, self.dt), ruckig.InputParameter(robot.n)
        out = ruckig.OutputParameter(robot.n)
        state.current_position, zero = q.tolist(), [0.0] * robot.n
        state.current_velocity, state.current_acceleration = zero, zero
        state.target_velocity, state.target_acceleration = zero, zero
        state.max_velocity, state.max_acceleration = self.max_velocity.tolist(), self.max_acceleration.tolist()
        state.max_jerk = self.max_jerk.tolist()
        target, step = q.copy(), self.max_velocity * self.dt

        def follow(pose: PoseLike) -> Followed:
            nonlocal target
            answer = self.ik.nearest(pose, target, step=step)
            target = np.asarray(answer.q)
            state.target_position = target.tolist()
            profile.update(state, out)
            out.pass_to_input(state)
            position, speed = np.array(out.new_position), np.array(out.new_velocity)
            behind = float(np.abs(target - position).max())
            resting = not answer.moving and behind <= AT_REST and float(np.abs(speed).max()) <= AT_REST
            return Followed(
                frozen(position), frozen(speed), frozen(np.array(out.new_acceleration)), answer, behind, resting
            )

        return follow


@typed
def hand_follower(
    ik: InverseKinematics,
    *,
    dt: float,
    max_acceleration: ArrayLike,
    max_jerk: ArrayLike = np.inf,
    max_velocity: ArrayLike | None = None,
) -> HandFollower:
    """A loop that follows a hand within limits of joint speed, acceleration and jerk. Extra `teleoperation`.

    Args:
        ik: as of `hk.ik`.
        dt: period of the loop [s].
        max_acceleration: of each joint [rad/s^2, m/s^2], one number for all or (n,).
        max_jerk: likewise [rad/s^3, m/s^3]; infinite for none.
        max_velocity: likewise [rad/s, m/s]; by default the robot's.

    Raises:
        ArgumentError: a limit that is not positive, a joint without a speed limit, or a period in milliseconds.
        ShapeError: not one number for each joint.
    """
    robot = ik.strategy.task.robot
    dt = number("dt", dt)
    if not 0 < dt <= LONGEST:
        raise ArgumentError("dt", dt, f"give the period in seconds, positive and at most {LONGEST:g}: 2 ms is 0.002")
    speed = _each("max_velocity", speed_limits(robot) if max_velocity is None else max_velocity, robot.n)
    acceleration = _each("max_acceleration", max_acceleration, robot.n)
    for what, values in (("max_velocity", speed), ("max_acceleration", acceleration)):
        if not np.isfinite(values).all():
            raise ArgumentError(what, values.tolist(), "give finite numbers")
    return HandFollower(ik, dt, speed, acceleration, _each("max_jerk", max_jerk, robot.n))


def _each(what: str, value: Any, n: int) -> Vector:
    """(n,) of one positive number or of n. Raises: ArgumentError, ShapeError."""
    given = one_or_each(what, value, n)
    if not (given > 0).all():
        raise ArgumentError(what, np.asarray(value, dtype=float).tolist(), "give positive numbers")
    return frozen(given.copy())
