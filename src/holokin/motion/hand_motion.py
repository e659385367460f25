"""`hand_follower`: joints that follow a hand within limits of speed, acceleration and jerk, and rest at its nearest
pose.

Each call asks `ik.nearest` for the posture that belongs to the hand, and moves the joints towards it by the
time-optimal profile of Ruckig [BK21], computed anew from where they are and how fast they go.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.arguments import typed
from ..base.errors import ArgumentError
from ..base.extra_module import extra_module
from ..base.poses import PoseLike
from ..base.types import ArrayLike, NoTruthValue, Value, Vector, frozen, number
from ..robot import speed_limits
from .ik.inverse_function import InverseKinematics, Nearest, steps_of

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

    def __str__(self) -> str:
        return f"{'at rest' if self.resting else f'moving, {self.behind:.3g} behind'}; {self.nearest}"


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

    def __str__(self) -> str:
        fastest = ", ".join(f"{v:.4g}" for v in self.max_velocity)
        return f"follows a hand every {1e3 * self.dt:g} ms, joints at most {fastest} per s; {self.ik}"

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
        # The profile starts at rest, with the limits of the loop.
        profile, state = ruckig.Ruckig(robot.n, self.dt), ruckig.InputParameter(robot.n)
        out = ruckig.OutputParameter(robot.n)
        state.current_position, zero = q.tolist(), [0.0] * robot.n
        state.current_velocity, state.current_acceleration = zero, zero
        state.target_velocity, state.target_acceleration = zero, zero
        state.max_velocity, state.max_acceleration = self.max_velocity.tolist(), self.max_acceleration.tolist()
        state.max_jerk = self.max_jerk.tolist()
        target, step = q.copy(), self.max_velocity * self.dt

        def follow(pose: PoseLike) -> Followed:
            # The posture that belongs to the hand, and one period of the profile towards it.
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
    if not 0 < dt <= 1.0:
        raise ArgumentError("dt", dt, "give the period in seconds, positive and at most 1: 2 ms is 0.002")
    limits = []
    for what, given in (
        ("max_velocity", speed_limits(robot) if max_velocity is None else max_velocity),
        ("max_acceleration", max_acceleration),
        ("max_jerk", max_jerk),
    ):
        values = steps_of(what, given, robot.n)
        if what != "max_jerk" and not np.isfinite(values).all():
            raise ArgumentError(what, values.tolist(), "give finite numbers")
        limits.append(frozen(values.copy()))
    return HandFollower(ik, dt, *limits)
