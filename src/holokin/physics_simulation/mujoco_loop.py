"""`play`: runs a strategy round a path on physics, a control step at a time, as the loop of a real robot would."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, get_args

import numpy as np

from ..base.arguments import typed
from ..base.progress import progress
from ..base.types import MOST, Array, ArrayLike, Matrix, Value, Vector, finite, not_negative, positive, whole
from ..errors import ArgumentError, OpenPathError
from ..inverse_kinematics.plan import check_start
from ..motion import Controller, LoopWatch, StepStatus, controller
from ..motion.simulation import steps_between
from ..path import Path
from ..robot import DENSITY, Servo, weighed
from ..robot import servo as servo_of
from ..robot.drives import ServoKind
from ..robot.mjcf import mujoco_module
from ..strategies import Strategy
from ..tasks.task import of_one_tool
from .physical_run import Feedback, PhysicalRun
from .plant import Plant, make_plant

FITTING: dict[ServoKind, Feedback] = {"position": "commanded", "velocity": "measured", "torque": "measured"}
"""The feedback that fits each kind of servo."""

RAMP = 0.5
"""Seconds in which the tool gets to the path's speed, and comes to rest, in each cycle."""

REST = 0.5
"""Seconds of rest at the end of each cycle, in which the arm calms down: a dozen periods of a servo of 25 Hz."""

SAG = 2.0
"""Seconds before the run, in which the arm sags into its servos."""

LOGGED = 0.01
"""Step of the record [s]."""

PATIENCE = 3.0
"""Seconds in which the path must go on by a hundredth of that, or the run is given up: it stands at a limit."""

LONGEST = 30.0
"""Times its nominal duration that a run may take."""


@dataclass(frozen=True, eq=False)
class Push(Value):
    """A force (3,) [N] in the world on the link of a joint, at its center of mass, from `start` for `duration` [s].

    `joint` names it; None is the joint halfway along the arm, as at an elbow.
    """

    force: Vector
    start: float
    duration: float = 0.2
    joint: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", finite("the force of a push", self.force, (3,)))
        not_negative("the start of a push", self.start)
        positive("the duration of a push", self.duration)
        super().__post_init__()


@typed
def play(
    strategy: Strategy,
    path: Path,
    q0: ArrayLike,
    *,
    servo: ServoKind | Servo = "position",
    feedback: Feedback | None = None,
    cycles: int = 1,
    dt: float = 1e-3,
    gain: float | None = None,
    noise: float = 0.0,
    push: Push | None = None,
    density: float = DENSITY,
    seed: int = 0,
) -> PhysicalRun:
    """Run a strategy round a path on MuJoCo's physics: one control step, one step of the physics, and again.

    The law is a compiled `controller`. In each cycle the tool goes from rest to rest, at the speed of the path between,
    and rests for half a second. Where the law is slowed, by limits or by what it is told, the path waits.

    Args:
        path: of the tool.
        q0: start posture (n,), with the tool at the start of the path.
        servo: "position", "velocity" or "torque", with the gains that `servo` of `holokin.robot` finds at q0; or a
            `Servo`. Under "torque" the law's rates are followed by computed torques.
        feedback: the joints that the law is told: "commanded", where they were sent, or "measured". By default what
            fits: commanded with position servos, measured with the others.
        cycles: runs of a closed path.
        dt: step of law and physics [s].
        gain: of the law, K and K_g [1/s], see `controller`; 10 by default.
        noise: standard deviation of each measurement of a joint [rad, m]. Servos of position read it, too.
        push: a force in mid-motion.
        density: of the capsules whose masses stand in for those of a robot that does not know its own [kg/m^3].
        seed: of the noise.

    Raises:
        MissingExtraError: mujoco is not installed. StartError: the tool at q0 is not at the start of the path.
        OpenPathError: several cycles of an open path. ArgumentError, ShapeError, NotFiniteError, UnknownNameError.
        SingularityError: the strategy is singular at q0.
    """
    task = strategy.task
    of_one_tool(task, "play")
    start = task.robot.checked(q0, "the start posture")
    dt, noise = positive("dt", dt, "give a positive step in seconds"), not_negative("noise", noise)
    rng = np.random.default_rng(whole("seed", seed, 0))
    if whole("cycles", cycles) > 1 and not path.closed:
        raise OpenPathError(f"playing {cycles} cycles", path.gap)
    drive = servo_of(weighed(task.robot, density), servo, start) if isinstance(servo, str) else servo
    told = FITTING[drive.kind] if feedback is None else feedback
    if told not in get_args(Feedback):
        raise ArgumentError("feedback", told, f"use one of {', '.join(get_args(Feedback))}")
    begun = task.pose(start)[:3, :3] if path.rotation is None else path.rotation
    plan = _Plan.of(path, begun, dt, cycles)
    check_start(task, start, plan.position[0], plan.rotation[0])
    K = 10.0 if gain is None else gain
    law = controller(strategy, dt=dt, q0=start, gain=K, constraint_gain=K)
    plant = make_plant(task.robot, drive, dt=dt, density=density)
    pushed = -1 if push is None else _pushed(plant, push)
    return _Loop(strategy, law, plant, plan, told, noise, push, pushed, rng).go(start, cycles)


@typed
def cycle_time(path: Path) -> float:
    """How long a cycle of a path takes in `play` [s]: the path's own time, the ramps at its ends, and the rest."""
    return path.duration + min(RAMP, path.duration) + REST


def _pushed(plant: Plant, push: Push) -> int:
    """The body that is pushed. Raises: UnknownNameError."""
    half = (plant.robot.n - 1) // 2
    return int(plant.bodies[half if push.joint is None else plant.robot.joint_index(push.joint)])


@dataclass(frozen=True, eq=False)
class _Plan:
    """One cycle, from rest to rest and a rest: wanted poses at every step, and the twists that lead to the next."""

    dt: float
    position: Matrix
    rotation: Array
    poses: Array
    twists: Matrix

    @staticmethod
    def of(path: Path, start_rotation: Matrix, dt: float, cycles: int) -> _Plan:
        """Raises: ArgumentError: too many steps."""
        ramp = min(RAMP, path.duration)
        moving = path.duration + ramp
        steps = int(np.ceil((moving + REST) / dt))
        if not steps * cycles <= MOST:
            raise ArgumentError("the number of steps", float(steps * cycles), f"give a larger dt, for at most {MOST:g}")
        t = np.minimum(dt * np.arange(steps + 1), moving)
        s = np.where(t < ramp, _ramped(t, ramp), t - ramp / 2)
        s = np.where(t > moving - ramp, path.duration - _ramped(moving - t, ramp), s)
        at = path.at(np.clip(s, 0.0, path.duration))
        p, R = at.position, at.rotation @ start_rotation
        poses, twists = steps_between(p[:, None], R[:, None], np.full(steps, dt))
        return _Plan(dt, p, R, poses[:, 0], np.vstack([twists[:, 0], np.zeros((1, 6))]))

    @property
    def steps(self) -> int:
        """Steps a cycle."""
        return len(self.twists) - 1

    def wanted(self, clock: float) -> tuple[Matrix, Vector]:
        """(pose at the end of a step that begins at a clock counted in steps, the twist that leads there)."""
        i = int(clock) % self.steps
        share = clock - int(clock)
        if share == 0.0:
            return self.poses[i + 1], self.twists[i]
        k = min(i + 1, self.steps - 1)
        twist = (1 - share) * self.twists[i] + share * self.twists[k]
        return _moved(self.poses[i + 1], share * self.dt * self.twists[k]), twist

    def now(self, clock: float) -> Matrix:
        """The wanted pose at a clock counted in steps."""
        i = int(clock) % self.steps
        share = clock - int(clock)
        return self.poses[i] if share == 0.0 else _moved(self.poses[i], share * self.dt * self.twists[i])


def _ramped(t: Vector, ramp: float) -> Vector:
    """The way after t while the speed rises as sin^2 from 0 to 1 in `ramp`."""
    return t / 2 - ramp / (2 * np.pi) * np.sin(np.pi * t / ramp)


def _moved(pose: Matrix, step: Vector) -> Matrix:
    """A pose moved by a small step (6,), in the base frame."""
    from scipy.spatial.transform import Rotation

    T = pose.copy()
    T[:3, 3] += step[:3]
    if step[3:].any():
        T[:3, :3] = Rotation.from_rotvec(step[3:]).as_matrix() @ T[:3, :3]
    return T


@dataclass(eq=False)
class _Loop:
    """One run: the physics, what the law is told, and the record."""

    strategy: Strategy
    law: Controller
    plant: Plant
    plan: _Plan
    feedback: Feedback
    noise: float
    push: Push | None
    pushed: int
    rng: np.random.Generator
    record: dict[str, list[Any]] = field(default_factory=lambda: {k: [] for k in ("t", "clock", "q", "m", "c", "T")})

    def __post_init__(self) -> None:
        self.mujoco = mujoco_module()
        self.data = self.mujoco.MjData(self.plant.model)
        self.torque = np.zeros(self.plant.model.nv)

    def go(self, q0: Vector, cycles: int) -> PhysicalRun:
        """Let the arm sag into its servos, then run the cycles."""
        self._rest(q0)
        plan, dt, total = self.plan, self.plan.dt, cycles * self.plan.steps
        command, clock, seen, k, done = q0.copy(), 0.0, (0.0, 0), 0, 0
        every = max(1, round(LOGGED / dt))
        rests, stopped, slowed = [self.q], "", 1.0
        watch = LoopWatch(dt, log=self.feedback == "measured")
        with progress(f"playing {self.strategy.name}", total) as report:
            while clock < total:
                q = self.q
                measured = q + self.noise * self.rng.standard_normal(len(q)) if self.noise else q
                if k % every == 0:
                    self._log(k * dt, clock, q, measured, command)
                told = command if self.feedback == "commanded" else measured
                pose, twist = plan.wanted(clock)
                dq = self.law.step(told, pose, twist)
                if self.law.status >= StepStatus.SINGULAR:
                    lost = self.law.status is StepStatus.LOST
                    stopped = "stopped: the tool was lost" if lost else "stopped at a singularity of the strategy"
                    break
                scale = self.law.scale
                slowed = min(slowed, scale)
                command = told + dt * dq
                self._drive(command, dq, measured - q, k * dt)
                watch.see(q, dq)
                before, clock, k = int(clock) // plan.steps, min(clock + scale, total), k + 1
                clock = round(clock) if abs(clock - round(clock)) < 1e-9 else clock
                if int(clock) // plan.steps > before:
                    rests.append(self.q)
                done = int(clock)
                report(done)
                if (k - seen[1]) * dt >= PATIENCE:
                    if clock - seen[0] < 0.01 * (k - seen[1]):
                        at_limit = self.law.status is StepStatus.LIMIT
                        held = f"stopped at the joint limit of {', '.join(self.law.holding)}"
                        stopped = held if at_limit else "stopped: the path did not go on"
                        break
                    seen = (clock, k)
                if k > LONGEST * total:
                    stopped = f"was given up after {LONGEST:g} times the path's time"
                    break
        self._log(k * dt, clock, self.q, self.q, command)
        r = {key: np.array(values) for key, values in self.record.items()}
        window = None if self.push is None else (self.push.start, self.push.start + self.push.duration)
        drive, poses = self.plant.servo, r["T"]
        warning = watch.sentence if watch.starved and self.feedback == "measured" else ""
        return PhysicalRun(
            self.strategy, drive.kind, drive.compensated, self.feedback, r["t"], r["clock"] / plan.steps, r["q"],
            r["m"], r["c"], poses[:, :3, 3], poses[:, :3, :3], np.array(rests), cycles * plan.steps * dt,
            watch.share, warning, window, slowed, stopped,
        )  # fmt: skip

    @property
    def q(self) -> Vector:
        """Where the joints are."""
        return self.data.qpos[self.plant.places]

    def _rest(self, q0: Vector) -> None:
        self.data.qpos[self.plant.places] = q0
        for joint in self.plant.robot.joints:  # followers too
            value = joint.multiplier * q0[joint.coordinate] + joint.offset
            if joint.name not in self.plant.robot.joint_names:
                self.data.joint(joint.name).qpos[0] = value
        none = np.zeros(len(q0))
        for _ in range(round(SAG / self.plan.dt)):
            rates = none if self.plant.servo.kind == "position" else 5.0 * (q0 - self.q)
            self._drive(q0, rates, none, -1.0)

    def _drive(self, command: Vector, dq: Vector, noise: Vector, t: float) -> None:
        """One step of the physics. A position servo reads the noise: it is told command - noise, which is the same."""
        plant, data, kind = self.plant, self.data, self.plant.servo.kind
        if kind == "position":
            data.ctrl[plant.actuators] = command - noise
        elif kind == "velocity":
            data.ctrl[plant.actuators] = dq
        else:
            data.ctrl[plant.actuators] = self._computed(command, dq, noise)
        if self.push is not None:
            acts = self.push.start <= t < self.push.start + self.push.duration
            data.xfrc_applied[self.pushed, :3] = self.push.force if acts else 0.0
        self.mujoco.mj_step(plant.model, data)

    def _computed(self, command: Vector, dq: Vector, noise: Vector) -> Vector:
        """tau = M a + h, a = 2 w (dq - q') [+ w^2 (command - q) of commanded joints], w that of the servo."""
        plant, data = self.plant, self.data
        self.mujoco.mj_forward(plant.model, data)
        a = np.zeros(plant.model.nv)
        a[plant.dofs] = plant.servo.damping * (dq - data.qvel[plant.dofs])
        if self.feedback == "commanded":
            a[plant.dofs] += plant.servo.stiffness * (command - self.q - noise)
        self.mujoco.mj_mulM(plant.model, data, self.torque, a)
        return (self.torque + data.qfrc_bias - data.qfrc_passive)[plant.dofs]

    def _log(self, t: float, clock: float, q: Vector, measured: Vector, command: Vector) -> None:
        values = (t, clock, q, measured, command.copy(), self.plan.now(clock))
        for known, value in zip(self.record.values(), values, strict=True):
            known.append(value)
