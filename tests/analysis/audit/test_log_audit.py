"""Audits of logs: drifting, repeatable and settling arms, through noise, pauses, speeds and both directions."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import holokin as hk
from conftest import PANDA_START, PPR_CENTER, PPR_START, sampled
from holokin.analysis.audit import LogVerdict
from holokin.analysis.audit.arcs import noise_level
from holokin.analysis.audit.cycles import crossings, find_cycles
from holokin.analysis.audit.logs import Recording
from holokin.analysis.audit.questions import first_limit, to_pose
from holokin.analysis.audit.trend import Trend
from holokin.app.cli import main as cli
from holokin.base.errors import ArgumentError, FileError

PANDA = hk.load("panda")
POSE = hk.pose(PANDA)
START = PANDA.pose(PANDA_START)[:3, 3]
CIRCLE = hk.circle(START, START - [0.1, 0, 0])
DRIFTING = hk.moore_penrose(POSE)
HOME = hk.holonomic(POSE, hk.lock("panda_joint3"))
ENCODER = 1e-4  # rad


def walk(strategy: hk.Strategy, paths: Sequence[hk.Path], q0: np.ndarray = PANDA_START, samples: int = 300) -> list:
    """Postures along paths run one after the other, one array each."""
    pieces = []
    for path in paths:
        pieces.append(hk.follow(strategy, path, q0, samples=samples).q)
        q0 = pieces[-1][-1]
    return pieces


def stretched(q: np.ndarray, factor: float) -> np.ndarray:
    """The same motion with `factor` as many samples: slower, for a factor over 1."""
    k = np.arange(len(q))
    return CubicSpline(k, q)(np.linspace(0, k[-1], round(len(q) * factor)))


def paused(q: np.ndarray, at: float, samples: int) -> np.ndarray:
    """The same motion, at rest for some samples on the way."""
    i = round(at * (len(q) - 1))
    return np.vstack([q[:i], np.repeat(q[i][None], samples, axis=0), q[i:]])


def recorded(pieces: Sequence[np.ndarray], noise: float = 0.0, robot: hk.Robot = PANDA) -> Recording:
    q = np.vstack([pieces[0], *(p[1:] for p in pieces[1:])])
    q = q + noise * np.random.default_rng(3).normal(size=q.shape)
    return Recording(robot.joint_names, 0.01 * np.arange(len(q)), q, "memory")


def settling(cycles: Sequence[float], rest: float = 0.8, samples: int = 400) -> tuple[Recording, np.ndarray]:
    """Pseudo-inverse with a posture task in the null space, by Euler steps; a cycle takes cycles[i] times as long.

    Returns the log and the postures at the cycles' ends.
    """
    q, log, ends = PANDA_START.copy(), [], [PANDA_START.copy()]
    posture = PANDA_START + [0, 0, 0.4, 0, 0, 0, 0]
    for slowness in cycles:
        steps = round(samples * slowness)
        for k in range(steps):
            log.append(q.copy())
            angle = 2 * np.pi * (k + 1) / steps
            T, J = PANDA.pose(q), PANDA.jacobian(q)
            turn = T[:3, :3].T @ PANDA.pose(PANDA_START)[:3, :3]
            spin = T[:3, :3] @ [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]] / 2
            goal = START + 0.1 * np.array([np.cos(angle) - 1, np.sin(angle), 0])
            inverse = np.linalg.pinv(J)
            q = q + inverse @ np.concatenate([goal - T[:3, 3], spin])
            q = q + (np.eye(7) - inverse @ J) @ (posture - q) * rest / samples
        ends.append(q.copy())
    log.append(q.copy())
    return recorded([np.array(log)]), np.array(ends)


# --- cycles ---------------------------------------------------------------------------------------------------


@sampled(1, "noise", [0.0, ENCODER])
def test_cycles_are_found_through_way_in_pauses_speeds_and_way_out(noise: float) -> None:
    way_in = walk(DRIFTING, [hk.line(START, START + [0.1, 0.05, 0.1])])[0][::-1]
    rounds = walk(DRIFTING, [CIRCLE] * 4)
    way_out = walk(DRIFTING, [hk.line(START, START + [-0.1, 0.2, 0.1])], rounds[-1][-1])[0]
    pieces = [way_in]
    for i, (q, factor) in enumerate(zip(rounds, (1, 2.5, 0.6, 1.3), strict=True)):
        pieces += [paused(stretched(q, factor), 0.2 + 0.15 * i, 90), np.repeat(q[-1][None], 120, axis=0)]
    log = recorded([*pieces, way_out], noise)
    audit = hk.audit_recording(log, PANDA)
    assert len(audit.cycles) == 4
    assert (audit.cycles.direction == 1).all()
    assert audit.cycles.length == pytest.approx(0.2 * np.pi, rel=5e-3)
    assert audit.cycles.moving == pytest.approx([3, 7.5, 1.8, 3.9], rel=0.1)
    exact = np.array([q[-1] - rounds[0][0] for q in rounds])
    assert np.abs(audit.since_start - exact).max() < 0.01 * np.abs(exact[0]).max()
    assert audit.verdict is LogVerdict.DIFFERS


def test_crossing_ones_own_path_is_no_cycle() -> None:
    """A figure eight passes its middle twice a round, in two directions."""
    eight = hk.path.join(hk.circle(START, START - [0.08, 0, 0]), hk.circle(START, START + [0.08, 0, 0], clockwise=True))
    cycles = find_cycles(recorded(walk(HOME, [eight] * 3), ENCODER), PANDA)
    assert len(cycles) == 3
    assert cycles.length == pytest.approx(eight.length, rel=5e-3)


@sampled(1, "noise", [0.0, ENCODER])
def test_at_the_crossing_of_an_eight_only_a_holonomic_arm_has_the_same_joints_twice(noise: float) -> None:
    """The loops of an eight undo most of each other's drift; half-way through it shows in full."""
    loops = [hk.circle(START, START - [0.08, 0, 0]), hk.circle(START, START + [0.08, 0, 0], clockwise=True)]
    for strategy in (DRIFTING, HOME):
        pieces = walk(strategy, loops * 3)
        log = recorded(pieces, noise)
        audit = hk.audit_recording(Recording(log.joint_names, log.t[37:], log.q[37:], "begun on the way"), PANDA)
        exact = np.abs(pieces[3][-1] - pieces[3][0]).max()
        assert audit.at_crossings.value == pytest.approx(exact, abs=1e-3 if noise else 1e-4)
        assert audit.at_crossings.beyond == (strategy is DRIFTING)
    assert hk.audit_recording(recorded(walk(HOME, [CIRCLE] * 2)), PANDA).at_crossings is None
    bow = hk.polyline(START + 0.1 * np.array([[0, 0, 0], [-1, 1, 0], [-1, 0, 0], [0, 1, 0]]), closed=True)
    cycles = find_cycles(recorded(walk(HOME, [bow] * 2, samples=333), noise), PANDA)
    (one,), (other,) = cycles.path.point(np.array(crossings(cycles)))
    assert np.abs(one - other).max() < (1e-3 if noise else 1e-6)


@pytest.mark.parametrize("pitch", [0.01, 0.002])
def test_a_raster_is_one_cycle_however_alike_its_rows(pitch: float) -> None:
    rows = [[-pitch * i, 0.1 * ((i + k) % 2), 0] for i in range(8) for k in (0, 1)]
    raster = hk.polyline(START + np.array(rows), closed=True)
    pieces = walk(HOME, [raster] * 2, samples=900)
    cycles = find_cycles(recorded(pieces), PANDA)
    assert len(cycles) == 2
    assert cycles.length == pytest.approx(raster.length, rel=5e-3)
    with pytest.raises(FileError, match="repeats no path"):
        find_cycles(recorded(pieces[:1]), PANDA)


def test_a_log_that_begins_and_ends_in_mid_cycle_gives_its_whole_cycles() -> None:
    square = hk.polyline(START + np.array([[0, 0, 0], [-0.1, 0, 0], [-0.1, 0.1, 0], [0, 0.1, 0]]), closed=True)
    q = np.vstack(walk(HOME, [square] * 4))
    audit = hk.audit_recording(recorded([q[130:-60]], ENCODER), PANDA)
    assert len(audit.cycles) == 3
    assert audit.verdict is LogVerdict.REPEATS


def test_one_cycle_a_resting_arm_and_an_open_way_are_refused() -> None:
    once = walk(HOME, [CIRCLE])[0]
    corners = START + 0.1 * np.array([[0, 0, 0], [-1, 0, 0], [-1, 1, 0], [0, 0, 0], [-1, 0, 0], [-2, 0, 0.5]])
    for q, words in (
        (once, "fewer than two cycles"),
        (np.repeat(once[:1], 500, axis=0), "the tool moves by"),
        (walk(HOME, [hk.line(START, START - [0.2, 0, 0])])[0], "fewer than two cycles"),
        (walk(HOME, [hk.polyline(corners)])[0], "fewer than two cycles"),  # one edge of three is run again
    ):
        with pytest.raises(FileError, match=words):
            find_cycles(recorded([q], 1e-5), PANDA)


def test_a_cycle_that_spans_a_gap_is_left_out() -> None:
    whole = recorded(walk(DRIFTING, [CIRCLE] * 5))
    keep = np.r_[0:380, 430 : len(whole)]
    log = Recording(whole.joint_names, whole.t[keep], whole.q[keep], "memory")
    audit = hk.audit_recording(log, PANDA)
    assert len(audit.cycles) + audit.cycles.left_out == 5
    assert audit.cycles.left_out == 1
    exact = [whole.q[300 * (i + 1)] - whole.q[300 * i] for i in (0, 2, 3, 4)]
    assert np.abs(audit.drift - exact).max() < 1e-4


@pytest.mark.campaign
def test_a_hundred_cycles_of_few_samples_are_all_found() -> None:
    audit = hk.audit_recording(recorded(walk(HOME, [CIRCLE], samples=40) * 100, ENCODER), PANDA)
    assert len(audit.cycles) == 100
    assert audit.verdict is LogVerdict.REPEATS


# --- verdicts -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("noise", [0.0, ENCODER])
def test_the_pseudo_inverses_drift_is_found_to_one_percent(noise: float) -> None:
    """0.1635, 0.1572, 0.1549 rad (tests/motion/test_numbers.py holds them against Pinocchio)."""
    audit = hk.audit_recording(recorded(walk(DRIFTING, [CIRCLE] * 3, samples=499), noise), PANDA)
    assert audit.cycles.stop[-1] == pytest.approx(1497, abs=3 if noise else 0.1)
    assert np.abs(audit.since_start).max(axis=1) == pytest.approx([0.1635, 0.3207, 0.4756], rel=5e-3)
    assert audit.verdict is LogVerdict.DIFFERS
    assert audit.worst_joint == "panda_joint1"
    assert audit.trend is Trend.CANNOT_TELL  # three differences, each smaller than the one before
    assert audit.between.beyond
    assert "0.163" in str(audit) and "the joints did not repeat" in audit.sentence()


def test_a_holonomic_arm_comes_home_both_ways_at_every_speed() -> None:
    c = walk(HOME, [CIRCLE], samples=500)[0]
    pieces = [c, stretched(c, 2.2), c[::-1], stretched(c, 0.6)[::-1], c]
    for noise in (0.0, ENCODER):
        audit = hk.audit_recording(recorded(pieces, noise), PANDA)
        assert abs(audit.cycles.direction.sum()) == 1
        assert audit.verdict is LogVerdict.REPEATS
        assert not audit.by_way.beyond and not audit.by_speed.beyond
        assert audit.sentence().startswith("repeats: ")


def test_what_a_log_does_not_test_is_said() -> None:
    text = str(hk.audit_recording(recorded(walk(HOME, [CIRCLE] * 2)), PANDA))
    assert "not tested: all cycles at one speed" in text
    assert "not tested: all cycles run one way" in text


def test_turning_back_undoes_the_drift_of_the_pseudo_inverse_but_every_loop_has_it() -> None:
    for paths in ([CIRCLE] * 3 + [CIRCLE.reversed()] * 3, [CIRCLE, CIRCLE.reversed()] * 3):
        audit = hk.audit_recording(recorded(walk(DRIFTING, paths), ENCODER), PANDA)
        expected = [1 if path is CIRCLE else -1 for path in paths]
        assert (audit.cycles.direction * audit.cycles.direction[0]).tolist() == expected
        assert np.abs(audit.since_start[-1]).max() < 2e-3
        assert np.cumsum(audit.drift, axis=0) == pytest.approx(audit.since_start, abs=2e-3)
        assert audit.largest.min() > 0.15
        assert audit.verdict is LogVerdict.DIFFERS


def test_to_and_fro_on_a_line_is_one_cycle_and_retraced() -> None:
    line = hk.line(START, START - [0.2, 0, 0])
    pieces = walk(DRIFTING, [line, line.reversed()] * 4)
    for noise in (0.0, ENCODER):
        audit = hk.audit_recording(recorded(pieces, noise), PANDA)
        assert len(audit.cycles) == 4
        assert audit.cycles.length == pytest.approx(0.4, rel=5e-3)
        assert audit.cycles.mirror is not None and (audit.cycles.direction == 1).all()
        assert audit.by_way is not None and not audit.by_way.beyond
        assert audit.verdict is LogVerdict.REPEATS


def test_a_posture_task_settles_and_its_ratio_is_found() -> None:
    log, ends = settling([1] * 8)
    audit = hk.audit_recording(log, PANDA)
    steps = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    assert (audit.verdict, audit.trend, audit.exit_code) == (LogVerdict.DIFFERS, Trend.FADES, 1)
    assert audit.trends["forward"].ratio == pytest.approx(steps[-1] / steps[-2], rel=0.05)
    assert np.abs(audit.since_start - (ends[1:] - ends[0])).max() < 0.01 * np.abs(ends[1] - ends[0]).max()
    assert audit.limit is None


@pytest.mark.campaign
def test_a_posture_task_depends_on_the_speed_once_settled() -> None:
    """Its null-space motion takes time: slow rounds pull harder. The last of each speed are compared."""
    log, _ = settling([1] * 5 + [4] * 3, rest=2.0)
    audit = hk.audit_recording(log, PANDA)
    assert audit.by_speed is not None and audit.by_speed.beyond
    assert audit.verdict is LogVerdict.DIFFERS and "depend on the speed" in audit.sentence()


def test_positions_repeat_where_poses_do_not() -> None:
    """A three-row task on seven joints leaves the orientation free: said, and cured by orientation=False."""
    log = recorded(walk(hk.moore_penrose(hk.position(PANDA)), [CIRCLE] * 3))
    with pytest.raises(FileError, match=r"position does.*--position"):
        hk.audit_recording(log, PANDA)
    audit = hk.audit_recording(log, PANDA, orientation=False)
    assert np.abs(audit.drift[0] - (log.q[300] - log.q[0])).max() < 1e-5
    assert audit.verdict is LogVerdict.DIFFERS


def test_a_planar_arm_is_judged_by_position(ppr: hk.Robot) -> None:
    """The paper's arm: 0.128 rad a cycle on the average for ever, between 0.105 and 0.158 in one (theory T6)."""
    path = hk.circle([1.6094, 0.4036, 0.0], PPR_CENTER)
    walked = hk.follow(hk.moore_penrose(hk.position(ppr)), path, PPR_START, samples=300, cycles=12)
    audit = hk.audit_recording(recorded([walked.q], robot=ppr), ppr)
    assert audit.task.m == 2
    assert np.abs(audit.drift - walked.drift()).max() < 1e-5
    assert audit.drift[:, 2].mean() == pytest.approx(0.1285, abs=0.003)
    assert audit.verdict is LogVerdict.DIFFERS


def test_the_tolerance_decides_and_must_make_sense() -> None:
    log = recorded(walk(DRIFTING, [CIRCLE] * 2))
    assert hk.audit_recording(log, PANDA, tolerance=0.5).verdict is LogVerdict.REPEATS
    for bad in (0.0, -1.0, float("nan")):
        with pytest.raises(ArgumentError, match="tolerance"):
            hk.audit_recording(log, PANDA, tolerance=bad)
        with pytest.raises(ArgumentError, match="length_scale"):
            hk.audit_recording(log, PANDA, length_scale=bad)


# --- the judging functions --------------------------------------------------------------------------------------


def test_the_first_limit_by_hand() -> None:
    lower, upper = np.array([-1.0, -1.0, -np.inf]), np.array([1.0, 2.0, np.inf])
    q = np.array([[-0.2, -0.5, 0.0], [0.2, 0.5, 1.0]])
    assert first_limit(lower, upper, q, np.array([[0.1, -0.1, 9.0]] * 2)) == (1, pytest.approx(5.0))
    assert first_limit(lower, upper, q, np.array([[0.1, 0, 9.0], [0.5, 0, 9.0]])) == (0, pytest.approx(1.6))
    assert first_limit(lower, upper, q, np.array([[0.0, 0.0, 9.0]] * 2)) is None


def test_moving_a_posture_to_a_pose_close_by_lands_there_to_second_order() -> None:
    """And moves along J^+ alone: what lies in the null space stays."""
    rng = np.random.default_rng(8)
    errors = []
    for size in (1e-2, 1e-3):
        q = PANDA_START + size * rng.normal(size=(20, 7))
        T = PANDA.pose(PANDA_START)
        moved, most = to_pose(POSE, q, np.tile(T[:3, 3], (20, 1)), np.tile(T[:3, :3], (20, 1, 1)))
        errors.append(max(np.abs(PANDA.pose(m) - T).max() for m in moved))
        assert most == pytest.approx(np.abs(moved - q).max(axis=1))
        null = np.linalg.svd(PANDA.jacobian(q[0]))[2][6]
        assert abs(null @ (moved[0] - q[0])) < 1e-8
    assert errors[1] < 0.02 * errors[0] < 1e-4


def test_the_noise_of_an_encoder_is_measured_through_the_motion() -> None:
    smooth = np.sin(np.linspace(0, 20, 4000))[:, None]
    noise = 1e-4 * np.random.default_rng(2).normal(size=smooth.shape)
    assert noise_level(smooth) < 1e-12
    assert 0.5e-4 < noise_level(smooth + noise) < 1.5e-4


# --- the command line -------------------------------------------------------------------------------------------


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr(sys, "argv", ["holokin", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        cli.main()
    return int(end.value.code or 0)


def test_the_command_says_the_verdict_and_writes_its_files(tmp_path: Path, monkeypatch, capsys) -> None:
    for strategy, code, word in ((DRIFTING, 1, "differs"), (HOME, 0, "repeats")):
        log = tmp_path / f"{word.replace(' ', '-')}.csv"
        hk.follow(strategy, CIRCLE, PANDA_START, samples=100, cycles=3).save(log)
        plot, facts = log.with_suffix(".png"), log.with_suffix(".json")
        drawn = ["--plot", plot] if code else []  # once is enough
        assert run(monkeypatch, "audit", log, "--robot", "panda", "--json", facts, *drawn) == code
        streams = capsys.readouterr()
        assert word in streams.out and "3 forward" in streams.out and streams.err == ""
        found = json.loads(facts.read_text())
        assert found["sentence"].startswith(word) and len(found["cycles"]) == 3
        assert plot.is_file() is bool(code)
        assert not code or plot.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of two cycles, and one of a single one."""
    folder = tmp_path_factory.mktemp("logs")
    hk.follow(HOME, CIRCLE, PANDA_START, samples=100, cycles=2).save(folder / "log.csv")
    hk.follow(HOME, CIRCLE, PANDA_START, samples=100).save(folder / "one.csv")
    return folder


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nothing.csv", "--robot", "panda"], "there is no such file"),
        (["log.csv", "--robot", "pandora"], "did you mean 'panda'"),
        (["log.csv", "--robot", "iiwa14"], "or choose another robot"),
        (["log.csv", "--robot", "panda", "--tip", "elbow"], "unknown tip"),
        (["log.csv", "--robot", "panda", "--topic", "/x"], "only bags have topics"),
        (["log.csv", "--robot", "panda", "--tolerance", "0"], "tolerance"),
        (["log.csv", "--robot", "panda", "--plot", "no/such/folder.png"], "cannot be written"),
        (["log.csv", "--robot", "panda", "--plot", "log.xyz"], "cannot be written"),
        (["log.csv", "--robot", "panda", "--json", "no/such/folder.json"], "cannot be written"),
        (["one.csv", "--robot", "panda"], "fewer than two cycles"),
    ],
)
def test_bad_input_gets_one_sentence_and_exit_code_two(
    arguments: list[str], words: str, logs: Path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(logs)
    assert run(monkeypatch, "audit", *arguments) == 2
    streams = capsys.readouterr()
    assert streams.out == ""
    assert streams.err.startswith("error: ") and streams.err.count("\n") == 1
    assert words in streams.err
