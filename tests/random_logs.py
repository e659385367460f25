"""Logs of random arms on random circles, whose joints drift, fade, alternate or repeat: what the audit says of them.

Arms, starts, planes, radii, gains and numbers of cycles are drawn; nothing is chosen. The same motion is judged without
noise, and with noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

import holokin as hk
from holokin.analysis.audit import LogVerdict, Trend

Array = np.ndarray

STEPS = 160
"""Steps of a cycle when a law is run."""

SECONDS = 4.0
"""A cycle lasts."""

ARMS = ("panda", "fr3", "gen3", "iiwa7", "iiwa14", "sawyer", "xarm7", "yumi-arm", "rail-ur10e", "mobile-ur5e", "ppr")


@dataclass(frozen=True, eq=False)
class Setup:
    """An arm at a posture, and a circle of its tool through the pose there: `centre` and `side` (3,), radius apart."""

    robot: hk.Robot
    task: hk.Task
    start: Array
    center: Array
    side: Array

    def poses(self, share: Array) -> tuple[Array, Array]:
        """Tool poses (k, 3), (k, 3, 3) after shares (k,) of a round."""
        at = self.robot.pose(self.start)
        angle = 2 * np.pi * share[:, None]
        place = self.center + np.cos(angle) * (at[:3, 3] - self.center) + np.sin(angle) * self.side
        return place, np.tile(at[:3, :3], (len(share), 1, 1))


@dataclass(frozen=True, eq=False)
class Motion:
    """Postures q (k, n) of a log that runs `cycles` rounds; the law; how its joints go on in truth, after the log."""

    setup: Setup
    law: str
    q: Array
    cycles: int
    truth: Trend

    def log(self, rate: float, noise: float, seed: int) -> hk.analysis.audit.logs.Recording:
        """As it is logged at a rate [Hz], with noise."""
        count = round(self.cycles * SECONDS * rate) + 1
        at = np.linspace(0, len(self.q) - 1, count)
        q = CubicSpline(np.arange(len(self.q)), self.q)(at)
        q = q + noise * np.random.default_rng(seed).normal(size=q.shape)
        return hk.analysis.audit.logs.Recording(self.setup.robot.joint_names, np.arange(count) / rate, q, self.law)


def random_arm(rng: np.random.Generator) -> hk.Robot:
    """Of the catalogue, or seven turning joints with random rows."""
    pick = int(rng.integers(len(ARMS) + 4))
    if pick < len(ARMS):
        return hk.load(ARMS[pick])
    rows = [
        {
            "a": float(rng.uniform(-0.1, 0.1)),
            "alpha": float(rng.choice([-1, 1]) * rng.uniform(0.6, 1.6)),
            "d": float(rng.uniform(0.05, 0.35)),
            "theta": 0.0,
        }
        for _ in range(7)
    ]
    return hk.from_dh(rows, name="seven random joints")


def random_setup(rng: np.random.Generator) -> Setup:
    """An arm at a regular posture within its limits, and a circle in a random plane."""
    while True:
        robot = random_arm(rng)
        task = hk.position(robot) if robot.planar else hk.pose(robot)
        low, high = np.maximum(robot.lower, -2.5), np.minimum(robot.upper, 2.5)
        start = (low + high) / 2 + 0.35 * (high - low) * rng.uniform(-1, 1, robot.n)
        sizes = np.linalg.svd(task.jacobian(start), compute_uv=False)
        if sizes[-1] < 0.08 * sizes[0]:
            continue
        plane = np.eye(3)[:2] if robot.planar else np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
        turn, radius = rng.uniform(0, 2 * np.pi), rng.uniform(0.03, 0.12)
        first = np.cos(turn) * plane[0] + np.sin(turn) * plane[1]
        second = np.cos(turn) * plane[1] - np.sin(turn) * plane[0]
        return Setup(robot, task, start, robot.pose(start)[:3, 3] - radius * first, radius * second)


def run(setup: Setup, cycles: int, pull: float, rest: Array) -> Array | None:
    """Postures (cycles STEPS + 1, n) of the pseudo-inverse with a pull to a posture in the null space, `pull` a cycle;
    None where a limit or a singularity ends them."""
    task, robot = setup.task, setup.robot
    place, turn = setup.poses(np.arange(STEPS) / STEPS)
    out = np.empty((cycles * STEPS + 1, robot.n))
    q = out[0] = setup.start
    for i in range(1, len(out)):
        jacobian = task.jacobian(q)
        gram = jacobian @ jacobian.T
        error = task.error(q, place[i % STEPS], turn[i % STEPS])
        home = pull / STEPS * (rest - q)
        q = q + home + jacobian.T @ np.linalg.solve(gram, error - jacobian @ home)
        out[i] = q
        if (q < robot.lower).any() or (q > robot.upper).any() or np.abs(q - out[i - 1]).max() > 0.2:
            return None
    ends, _ = task._poses(out[::STEPS])
    return out if np.abs(ends - place[0]).max() < 1e-3 else None


def shifted(setup: Setup, cycles: int, shift: Callable[[Array], Array]) -> Array | None:
    """Postures whose spare coordinates N^T (q - q0), N of the start, are shift(rounds done) (k,) along a random one:
    the rest is solved for, by Newton's method. None where there is no solution near by."""
    done = np.arange(cycles * STEPS + 1) / STEPS
    place, turn = setup.poses(done % 1.0)
    spare = np.linalg.svd(setup.task.jacobian(setup.start))[2][setup.task.m :]
    wanted = shift(done)[:, None] * np.eye(len(spare))[0]
    q: Array = np.tile(setup.start, (len(done), 1))
    step = np.full_like(q, np.inf)
    for _ in range(12):
        jacobian, _ = setup.task.jacobian_batch(q)
        rows = np.concatenate([jacobian, np.tile(spare, (len(q), 1, 1))], axis=1)
        error = np.hstack([setup.task.error(q, place, turn), wanted - (q - setup.start) @ spare.T])
        if not np.isfinite(rows).all() or np.linalg.cond(rows).max() > 1e6:
            return None
        step = np.linalg.solve(rows, error[:, :, None])[:, :, 0]
        q = np.asarray(q + np.clip(step, -0.3, 0.3), dtype=float)
    sound = np.abs(step).max() < 1e-9 and (np.abs(np.diff(q, axis=0)).max() < 0.2)
    return q if sound and (q > setup.robot.lower).all() and (q < setup.robot.upper).all() else None


def after(q: Array, cycles: int) -> Trend:
    """How the joints go on after the log, from a run of twice as many cycles: over the second half they move on by more
    than half of what the last cycle of the log did, each; come to rest; or neither."""
    ends = q[::STEPS]
    last = ends[cycles] - ends[cycles - 1]
    on = (ends[2 * cycles] - ends[cycles]) @ last / (last @ last) / cycles
    late = np.linalg.norm(ends[-1] - ends[-2]) / np.linalg.norm(last)
    return Trend.GOES_ON if on > 0.5 else Trend.FADES if late < 0.1 else Trend.CANNOT_TELL


LAWS = ("pseudo-inverse", "pull", "one time", "two times", "1/k", "1/k^2", "alternates", "repeats")


def random_motion(law: str, rng: np.random.Generator, cycles: tuple[int, int] = (6, 40)) -> Motion:
    """A log of a law on a random arm."""
    while True:
        setup = random_setup(rng)
        count = int(rng.integers(cycles[0], cycles[1] + 1))
        size = float(np.exp(rng.uniform(np.log(0.02), np.log(0.3))))
        if law in ("pseudo-inverse", "pull"):
            pull = 0.0 if law == "pseudo-inverse" else float(np.exp(rng.uniform(np.log(1), np.log(12)))) / count
            rest = setup.start + rng.uniform(-0.6, 0.6, setup.robot.n)
            q = run(setup, 2 * count, pull, rest)
            if q is None or np.abs(np.diff(q[::STEPS], axis=0))[:count].max() < 5e-3:
                continue
            return Motion(setup, law, q[: count * STEPS + 1], count, after(q, count) if pull == 0 else Trend.FADES)
        fast = float(np.exp(-1 / (count * rng.uniform(0.03, 0.12))))
        slow = float(np.exp(-1 / (count * rng.uniform(0.15, 1.0))))
        part = float(rng.uniform(0.2, 0.8))
        shift, truth = {
            "one time": (lambda c: size * slow**c, Trend.FADES),
            "two times": (lambda c: size * (part * fast**c + (1 - part) * slow**c), Trend.FADES),
            "1/k": (lambda c: size / (1 + c), Trend.FADES),
            "1/k^2": (lambda c: size / (1 + c) ** 2, Trend.FADES),
            "alternates": (lambda c: 0.5 * size * np.cos(np.pi * c), Trend.ALTERNATES),
            "repeats": (lambda c: 0 * c, Trend.NONE),
        }[law]
        q = shifted(setup, count, shift)
        if q is not None:
            return Motion(setup, law, q, count, truth)


def judged(motion: Motion, rate: float, seed: int, noises: tuple[float, ...]) -> list[hk.analysis.audit.LogAudit]:
    """The audits of a motion, by rising noise: standard deviations of the encoders [rad or m]."""
    whole, robot = motion.setup.task.orientation is not None, motion.setup.robot
    return [hk.audit_recording(motion.log(rate, noise, seed), robot, orientation=whole) for noise in noises]


def repeated(found: LogVerdict, truth: Trend) -> str:
    """Of the first answer: right, wrong, or cannot tell."""
    if found is LogVerdict.UNDECIDED:
        return "cannot tell"
    return "right" if (found is LogVerdict.REPEATS) == (truth is Trend.NONE) else "wrong"


def told(found: Trend, truth: Trend) -> str:
    """Of the trend: right, wrong, or cannot tell. Where the truth is neither, only that is right."""
    if found is truth:
        return "right"
    return "cannot tell" if found is Trend.CANNOT_TELL else "wrong"
