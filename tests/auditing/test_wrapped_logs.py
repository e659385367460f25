"""Angles modulo a turn: a log or dataset so written gets the verdict of the same motion written out, or "cannot tell"."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import holokin as hk
from holokin.auditing import LogAudit, LogVerdict
from holokin.errors import RecordingError
from holokin.robot_logs import Recording, joined_turns

ARMS = ("ur5e", "xarm7", "gen3", "panda", "iiwa14")
WRAPS = {"(-pi, pi]": -np.pi, "[0, 2 pi)": 0.0, "from -4 on": -4.0}


@dataclass(frozen=True)
class Motion:
    """Joints q (k, n) at times t (k,), as they run."""

    robot: hk.Robot
    kind: str
    t: np.ndarray
    q: np.ndarray

    def wrapped(self, begin: float) -> Recording:
        """As it is logged modulo a turn, in [begin, begin + 2 pi)."""
        turns = np.floor((self.q - begin) / (2 * np.pi)) * self.robot.hinges
        return Recording(self.robot.joint_names, self.t, self.q - 2 * np.pi * turns, "log")

    def counted(self) -> Recording:
        """As a log of encoders of many turns."""
        return joined_turns(Recording(self.robot.joint_names, self.t, self.q, "log"), self.robot, counted=True)


def random_arm(rng: np.random.Generator) -> hk.Robot:
    """Of the catalogue, or with limits at random: under a turn, over a turn, none."""
    if rng.uniform() < 0.6:
        return hk.load(str(rng.choice(ARMS)))
    rows = []
    for _ in range(int(rng.integers(6, 8))):
        wide = rng.choice([1.0, 2.0, 3.1, np.pi, 3.3, 5.0, 6.3, np.inf])
        middle = rng.uniform(-1, 1) if np.isfinite(wide) else 0.0
        rows.append({
            "a": float(rng.uniform(-0.3, 0.3)), "alpha": float(rng.choice([-1, 1]) * rng.uniform(0.6, 1.6)),
            "d": float(rng.uniform(0.05, 0.35)), "lower": middle - wide, "upper": middle + wide,
            "max_velocity": float(rng.choice([1.0, 3.0, 6.0, np.inf])),
        })  # fmt: skip
    return hk.from_dh(rows, name="random joints")


def random_motion(seed: int) -> Motion:
    """Cycles of smooth joints within limits and speeds, with noise and gaps; all joints repeat, or some wind up by a
    turn in each cycle or in a gap, or they change a little."""
    rng = np.random.default_rng(seed)
    robot = random_arm(rng)
    n, cycles = robot.n, int(rng.integers(3, 7))
    low, high = np.maximum(robot.lower, -8.0), np.minimum(robot.upper, 8.0)
    speed = np.where(np.isfinite(robot.max_velocity), robot.max_velocity, 6.0)
    amplitude = np.minimum(rng.uniform(0.02, 0.6, n), 0.4 * (high - low))
    # often near pi, 0 and a limit, where values are cut
    places = np.stack([np.full(n, np.pi), np.full(n, -np.pi), np.zeros(n), low, high, rng.uniform(low, high)])
    middle = places[rng.integers(len(places), size=n), np.arange(n)]
    middle = np.clip(middle + rng.normal(0, 0.3, n), low + amplitude, high - amplitude)
    harmonics = rng.integers(1, 3, n)
    kind = str(rng.choice(["repeats", "winds", "turns in a gap", "drifts"]))
    period = float((2 * np.pi * amplitude * harmonics / speed).max() * rng.uniform(1.1, 6)) + 0.5
    free = np.flatnonzero(np.isinf(robot.lower))
    if kind == "winds" and len(free):
        period = max(period, float((2 * np.pi / speed[free]).max() * 1.3 + period))
    samples = float(rng.choice([25, 60, 200])) if rng.uniform() < 0.6 else float(rng.uniform(20, 40))
    samples += rng.uniform(0, 0.9)
    u = np.arange(int(cycles * samples) + 1) / samples
    phase = rng.uniform(0, 2 * np.pi, n)
    q = middle + amplitude * np.sin(2 * np.pi * harmonics * u[:, None] + phase)
    t = u * period
    if kind == "winds" and len(free):
        q[:, rng.choice(free)] += 2 * np.pi * u
    if kind in ("turns in a gap", "repeats") and rng.uniform() < 0.6:
        k = int(len(t) * rng.uniform(0.35, 0.6))
        wait = rng.choice([0.3, 3.0, 10.0])
        t[k:] += wait
        turn = 2 * np.pi * rng.choice([-1, 1])
        able = np.flatnonzero(
            (q[k:] + turn < high).all(axis=0) & (q[k:] + turn > low).all(axis=0) & (wait * speed > 6.4)
        )
        if kind == "turns in a gap" and len(able):
            q[k:, rng.choice(able)] += turn
    if kind == "drifts":
        q[:, int(rng.integers(n))] += rng.choice([1e-4, 3e-3, 0.02, 0.2]) * u
    q = q + rng.choice([0.0, 1e-5, 1e-4]) * rng.normal(size=q.shape)
    return Motion(robot, kind, t, q)


def audited(log: Recording, robot: hk.Robot) -> LogAudit | str:
    try:
        return hk.audit_recording(log, robot)
    except RecordingError as problem:
        return problem.fact


def wrong(seed: int) -> str:
    """What is wrong with the answers about one motion; "" where nothing is."""
    motion = random_motion(seed)
    truth = audited(motion.counted(), motion.robot)
    plain = Recording(motion.robot.joint_names, motion.t, motion.q, "log")
    for name, log in [("as it runs", plain), *((k, motion.wrapped(b)) for k, b in WRAPS.items())]:
        found = audited(log, motion.robot)
        if isinstance(truth, str) or isinstance(found, str):
            if isinstance(truth, str) != isinstance(found, str):
                return f"{name}: {found} for {truth}"
            continue
        if found.verdict is truth.verdict:
            continue
        if found.verdict is not LogVerdict.UNDECIDED or "whole turn" not in found.sentence():
            return f"{name}: {found.verdict.name} for {truth.verdict.name}: {found.sentence()[:200]}"
    return ""
