"""Angles modulo a turn: so written, a log or dataset gets the verdict of the motion as it ran, or "cannot tell"."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import campaign, sampled
from holokin.analysis.audit import DatasetAudit, LogAudit, LogVerdict, audit_dataset
from holokin.analysis.audit.logs import STATE, Recording, joined_turns, joint_feature, read_dataset
from holokin.base.errors import FileError
from small_datasets import write_dataset

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
    except FileError as problem:
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


SEEDS = [*range(2), *(campaign("seed", seed) for seed in range(2, 200))]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_log_modulo_a_turn_has_the_verdict_of_the_motion_or_says_where_it_cannot_tell(seed: int) -> None:
    assert not wrong(seed)


@sampled(4, ("arm", "begin"), [(arm, begin) for arm in ARMS for begin in WRAPS.values()])
def test_a_log_of_usual_rate_without_gaps_is_always_told(arm: str, begin: float) -> None:
    """Joints near the end of the turn that is logged, 30 samples a second."""
    robot = hk.load(arm)
    middle = np.clip(begin + 0.05, robot.lower + 0.4, robot.upper - 0.4)
    t = np.arange(300) / 30
    q = middle + 0.3 * np.sin(0.6 * np.pi * t[:, None] + np.arange(robot.n))
    motion = Motion(robot, "repeats", t, q)
    found = hk.audit_recording(motion.wrapped(begin), robot)
    assert found.verdict is hk.audit_recording(motion.counted(), robot).verdict and not len(found.unknown_turns)
    assert np.abs(found.recording.q - q - (found.recording.q - q)[0]).max() < 1e-9


def test_a_joint_that_winds_up_by_a_turn_in_each_cycle_is_named() -> None:
    robot = hk.load("gen3")
    t = np.arange(0, 40, 1 / 30)
    q = np.array([0.1, 0.5, 3.0, -1.5, 0.2, -1.0, 0.0]) + 0.2 * np.sin(2 * np.pi * t[:, None] / 10 + np.arange(7))
    q[:, 6] += 2 * np.pi * t / 10
    found = hk.audit_recording(Motion(robot, "winds", t, q).wrapped(-np.pi), robot)
    assert found.verdict is LogVerdict.DIFFERS
    assert "joint_7 winds up: it has made 4 turns in 4 cycles" in found.sentence()
    still = hk.audit_recording(
        Motion(robot, "repeats", t, q - np.eye(7)[6] * 2 * np.pi * t[:, None] / 10).wrapped(0.0), robot
    )
    assert still.verdict is LogVerdict.REPEATS


def test_the_place_where_a_turn_is_not_known_is_said_and_the_user_may_say_it() -> None:
    """A UR5e waits for 10 s between two cycles; its limits leave joints that stay on one side of zero two turns."""
    robot, motion = hk.load("ur5e"), random_gap()
    found = hk.audit_recording(motion.wrapped(-np.pi), robot)
    assert found.verdict is LogVerdict.UNDECIDED and found.exit_code == 2
    joints = ", ".join(np.delete(robot.joint_names, [0, 5]))
    assert f"from 10 to 20 s (samples 300 and 301) {joints} may have made a whole turn" in found.sentence()
    assert "--counts-turns" in found.sentence()
    assert found.to_dict()["unknown_turns"][0] == {"sample": 300, "time_s": 10.0, "joint": "shoulder_lift_joint"}
    assert hk.audit_recording(motion.counted(), robot).verdict is LogVerdict.REPEATS


def random_gap() -> Motion:
    t = np.arange(601) / 30
    q = np.array([0.2, -1.2, 1.3, -1.6, -1.5, 0.3])
    q = q + np.array([0.3, 0.3, 0.1, 0.3, 0.3, 0.4]) * np.sin(2 * np.pi * t[:, None] / 5 + np.array([0, 0, 1, 0, 0, 0]))
    return Motion(hk.load("ur5e"), "repeats", np.where(np.arange(601) > 300, t + 10 - 1 / 30, t), q)


@pytest.mark.parametrize("seed", [*range(6), *(campaign("seed", seed) for seed in range(6, 100))])
def test_degrees_and_radians_modulo_a_turn_are_told_apart(tmp_path: Path, seed: int) -> None:
    motion = random_motion(seed)
    names, file = motion.robot.joint_names, tmp_path / "log.csv"
    if (motion.q < motion.robot.lower - 0.4).any() or (motion.q > motion.robot.upper + 0.4).any():
        return  # it has drifted beyond its limits, where no unit fits
    for begin in WRAPS.values():
        log = motion.wrapped(begin)
        for scale in (1.0, 180 / np.pi):
            rows = np.column_stack([log.t, log.q * scale])
            np.savetxt(file, rows, delimiter=",", header=",".join(["t", *names]), comments="", fmt="%.9f")
            if scale == 1.0:
                hk.read_recording(file, motion.robot)  # and is not told to be in degrees
            elif np.abs(log.q).max() * scale > 13:  # rad, two turns: no endless joint is logged so
                with pytest.raises(FileError, match="but every joint fits in degrees"):
                    hk.read_recording(file, motion.robot)


# --- datasets -------------------------------------------------------------------------------------------------


def dataset_audit(
    folder: Path, robot: hk.Robot, episodes: list[np.ndarray], counts_turns: bool = False
) -> DatasetAudit:
    names = {STATE: list(robot.joint_names)}
    data = read_dataset(write_dataset(folder, [{STATE: q} for q in episodes], names, dtype="float64"))
    joints = joint_feature(data, robot, STATE, degrees=False, counts_turns=counts_turns)
    return audit_dataset(data, robot, joints)


@pytest.mark.parametrize("seed", [*range(2), *(campaign("seed", seed) for seed in range(2, 80))])
def test_a_dataset_modulo_a_turn_has_the_verdict_of_the_motion_or_cannot_tell(tmp_path: Path, seed: int) -> None:
    """Three episodes of one motion; in some another posture, or a joint that has made a turn between episodes."""
    rng = np.random.default_rng(seed)
    robot = random_arm(rng)
    low, high = np.maximum(robot.lower, -8.0), np.minimum(robot.upper, 8.0)
    amplitude = np.minimum(0.3, 0.3 * (high - low))
    middle = np.clip(
        rng.choice([np.pi, -np.pi, 0.0], robot.n) + rng.normal(0, 0.2, robot.n), low + amplitude, high - amplitude
    )
    u = np.linspace(0, 2 * np.pi, 40)[:, None]
    episodes = [middle + amplitude * np.sin(u + np.arange(robot.n)) for _ in range(3)]
    turned = np.flatnonzero((episodes[0] + 2 * np.pi < high).all(axis=0))
    endless = False
    if len(turned) and rng.uniform() < 0.5:
        joint = rng.choice(turned)
        episodes[1][:, joint] += 2 * np.pi
        endless = bool(np.isinf(robot.upper[joint]))
    counted = dataset_audit(tmp_path / "counted", robot, episodes, counts_turns=True).verdict
    plain = dataset_audit(tmp_path / "plain", robot, episodes).verdict
    assert plain in (counted, LogVerdict.UNDECIDED) or endless
    for name, begin in WRAPS.items():
        wrapped = [q - 2 * np.pi * np.floor((q - begin) / (2 * np.pi)) * robot.hinges for q in episodes]
        found = dataset_audit(tmp_path / name.replace(" ", ""), robot, wrapped)
        assert found.verdict in (plain, LogVerdict.UNDECIDED), (robot.name, name)
        if found.verdict is LogVerdict.UNDECIDED and plain is not found.verdict:
            assert "may be a turn farther in frame" in found.sentence()


def test_a_panda_and_a_gen3_modulo_a_turn_are_told_and_an_endless_joint_has_no_turns_between_episodes(
    tmp_path: Path,
) -> None:
    for arm, middle in (("panda", [0, 0.2, 0, -1.5, 0, 3.1, 0]), ("gen3", [3.1, 0.3, -3.1, -1.2, 0, -0.9, 3.0])):
        robot, u = hk.load(arm), np.linspace(0, 2 * np.pi, 40)[:, None]
        q = np.array(middle) + 0.2 * np.sin(u + np.arange(7))
        wrapped = q - 2 * np.pi * np.floor((q + np.pi) / (2 * np.pi))
        episodes = [wrapped, wrapped, np.roll(wrapped, 20, axis=0)]
        found = dataset_audit(tmp_path / arm, robot, episodes)
        assert found.verdict is LogVerdict.REPEATS and any("joined" in note for note in found.notes)
