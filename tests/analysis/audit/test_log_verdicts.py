"""What a log decides and what it does not: noise, small drifts, creeping tools, walks in mid-cycle, alternation."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, campaign, sampled
from holokin.analysis.audit import LogAudit, LogVerdict, Repeatability
from holokin.analysis.audit.logs import Recording
from holokin.analysis.audit.trend import DriftTrend, Trend, Visits, encoder_noise, judge, spare_axes
from holokin.app.cli import main as cli

PANDA = hk.load("panda")
POSE = hk.pose(PANDA)
START = PANDA.pose(PANDA_START)[:3, 3]
HOME = hk.holonomic(POSE, hk.lock("panda_joint3"))
CIRCLE = hk.circle(START, START - [0.1, 0, 0])
SAMPLES = 100


@cache
def once() -> np.ndarray:
    return hk.follow(HOME, CIRCLE, PANDA_START, samples=SAMPLES).q[:-1]


@cache
def motion(shift: Callable[[np.ndarray], np.ndarray], cycles: int, creep: float) -> np.ndarray:
    """Postures round the circle with joint 3 moved by shift(cycles done), and the circle by `creep` [m] a cycle: the
    other six joints solve for the tool pose, by Newton's method."""
    at = np.arange(cycles * SAMPLES + 1)
    q = once()[at % SAMPLES].copy()
    place, turn = PANDA.pose_batch(q)
    place = place + np.outer(creep * at / SAMPLES, [0, 0, 1.0])
    q[:, 2] += shift(at / SAMPLES)
    others = [0, 1, 3, 4, 5, 6]
    for _ in range(8):
        jacobian, _ = POSE.jacobian_batch(q)
        q[:, others] += np.linalg.solve(jacobian[:, :, others], POSE.error(q, place, turn)[:, :, None])[:, :, 0]
    return q


def logged(q: np.ndarray, noise: float = 0.0, seed: int = 0) -> Recording:
    q = q + noise * np.random.default_rng(seed).normal(size=q.shape)
    return Recording(PANDA.joint_names, 0.01 * np.arange(len(q)), q, "memory")


@cache
def audited(shift: Callable, cycles: int, noise: float, creep: float = 0.0, seed: int = 0) -> LogAudit:
    return hk.audit_recording(logged(motion(shift, cycles, creep), noise, seed), PANDA)


def verdicts(shift: Callable, cycles: int, noise: float, seeds: int, creep: float = 0.0) -> Counter[str]:
    """How often each pair of answers is given."""
    found = [audited(shift, cycles, noise, creep, seed) for seed in range(seeds)]
    return Counter(f"{audit.verdict.name} {audit.trend.name}" for audit in found)


def still(t: np.ndarray) -> np.ndarray:
    return 0 * t


def slow(t: np.ndarray) -> np.ndarray:
    return 1e-4 * t


def steady(t: np.ndarray) -> np.ndarray:
    return 0.02 * t


def walking(t: np.ndarray) -> np.ndarray:
    """0.03 rad further each cycle half-way round, nothing where cycles begin and end."""
    return 0.03 * np.floor(t) * np.exp(-(((t % 1) - 0.5) ** 2) / 0.01)


def alternating(t: np.ndarray) -> np.ndarray:
    return 0.02 * np.sin(np.pi * t)


def settling(t: np.ndarray) -> np.ndarray:
    return 0.05 * 0.6**t


def period_three(t: np.ndarray) -> np.ndarray:
    return 0.02 * np.sin(2 * np.pi * t / 3)


# --- whole logs -------------------------------------------------------------------------------------------------


@pytest.mark.campaign
def test_noise_alone_is_neither_drift_nor_settling() -> None:
    """At most one false alarm in a hundred logs is promised."""
    found = verdicts(still, 20, 1e-3, 8)
    assert set(found) <= {"REPEATS NONE", "UNDECIDED CANNOT_TELL"}
    assert found["REPEATS NONE"] >= 7


@pytest.mark.campaign
def test_a_small_steady_drift_under_ten_times_its_noise_has_not_repeated() -> None:
    """1e-4 rad a cycle under 1e-3 of noise: forty cycles add up 4e-3. It is less than the tolerance a cycle, and its
    last third does not show whether it fades."""
    assert verdicts(slow, 40, 1e-3, 4) == {"DIFFERS CANNOT_TELL": 4}
    audit = audited(slow, 40, 1e-3)
    exact = hk.audit_recording(logged(motion(slow, 40, 0.0)), PANDA).visits
    phase = audit.leading.phase
    truth = (exact[-1, phase] - exact[0, phase]) / 39
    assert (np.abs(audit.leading.rate - truth) <= audit.leading.rate_error).all()
    assert np.abs(truth).max() < 1e-3


def test_too_few_noisy_cycles_cannot_tell_and_say_how_many_would() -> None:
    audit = hk.audit_recording(logged(motion(still, 4, 0.0), 1e-3), PANDA)
    assert audit.verdict is LogVerdict.UNDECIDED
    assert audit.detectable > audit.tolerance
    needed = audit.leading.cycles_needed
    assert f"log about {needed} cycles" in audit.sentence() and 5 <= needed <= 30
    assert hk.audit_recording(logged(motion(still, needed + 4, 0.0), 1e-3), PANDA).verdict is LogVerdict.REPEATS


@pytest.mark.campaign
def test_a_drift_beside_a_creeping_tool_is_a_drift_and_creep_alone_cannot_tell() -> None:
    """The circle rises by 1 mm a cycle. A repeating arm moves its spare joint with it, by no more than so much."""
    assert verdicts(steady, 8, 1e-4, 4, 1e-3) == {"DIFFERS GOES_ON": 4}
    assert verdicts(still, 8, 1e-4, 4, 1e-3) == {"UNDECIDED CANNOT_TELL": 4}
    audit = audited(still, 8, 1e-4, 1e-3)
    assert "the tool's own path shifts" in audit.sentence()
    assert audit.leading.creep > 0.5 * audit.detectable


@pytest.mark.parametrize("seeds", [1, campaign("seeds", 4)])
def test_a_posture_that_walks_in_mid_cycle_drifts_though_the_ends_agree(seeds: int) -> None:
    assert verdicts(walking, 10, 1e-4, seeds) == {"DIFFERS GOES_ON": seeds}
    audit = audited(walking, 10, 1e-4)
    assert np.abs(audit.since_start).max() < 2e-3
    assert 0.4 < audit.cycles.phase[audit.leading.phase] < 0.6


@pytest.mark.parametrize("seeds", [1, campaign("seeds", 4)])
def test_an_alternation_is_named_and_its_limit_not_foretold(seeds: int) -> None:
    assert verdicts(alternating, 7, 1e-4, seeds) == {"DIFFERS ALTERNATES": seeds}
    audit = audited(alternating, 7, 1e-4)
    assert audit.limit is None and "limit" not in audit.sentence()
    low, high = audit.leading.ratio_range
    assert low == pytest.approx(-1, abs=0.02) and high < -0.95


@pytest.mark.parametrize("seeds", [1, campaign("seeds", 4)])
def test_a_motion_of_period_three_is_no_drift_and_does_not_settle(seeds: int) -> None:
    assert verdicts(period_three, 9, 1e-4, seeds) == {"DIFFERS CANNOT_TELL": seeds}


@pytest.mark.campaign
def test_true_settling_and_true_drift_are_found_with_their_figures() -> None:
    assert verdicts(settling, 16, 2e-5, 4) == {"DIFFERS FADES": 4}
    for noise in (0.0, 1e-4):
        low, high = hk.audit_recording(logged(motion(settling, 10, 0.0), noise), PANDA).leading.ratio_range
        assert low - 5e-3 < 0.6 < high + 5e-3  # the spare direction turns a little on the way
        assert high - low < 0.2
    assert verdicts(steady, 8, 1e-3, 4) == {"DIFFERS GOES_ON": 4}


@pytest.mark.campaign
def test_a_limit_is_foretold_while_the_drift_goes_on_and_no_more_when_it_falls() -> None:
    """The Panda's drift rises to 0.175 rad in its 8th cycle and falls to 0.10 in its 15th; it ends after 18.7."""
    with pytest.raises(hk.base.errors.LimitReachedError) as stop:
        hk.follow(hk.moore_penrose(POSE), CIRCLE, PANDA_START, samples=100, cycles=60)
    done = stop.value.trajectory
    for cycles in (7, 9, 11, 14):
        audit = hk.audit_recording(logged(done.q[: int(done.marks[cycles]) + 1], 1e-4), PANDA)
        assert audit.verdict is LogVerdict.DIFFERS
        assert (audit.limit is None) == (cycles == 14) == (audit.trend is Trend.CANNOT_TELL)
        if audit.limit is not None and audit.limit_range is not None:
            few, most = audit.limit_range
            left = (len(done) - 1) / 100 - cycles
            assert few <= audit.limit[1] <= most and 0.75 * left < audit.limit[1] < 1.1 * left
            assert f"({few:.0f} to {most:.0f})" in audit.sentence()


# --- what the sentence claims --------------------------------------------------------------------------------------


def test_a_law_logged_one_way_is_not_called_independent_of_the_way() -> None:
    """A posture task that has settled repeats; the path back has other joints (the log there and back shows it)."""
    law = hk.motion.control.gradient_projection(POSE, hk.strategies.constraints.posture_cost(PANDA_START), 5.0, 40.0)
    one = hk.simulate(law, POSE, CIRCLE, PANDA_START, dt=0.02, cycles=6)
    audit = hk.audit_recording(logged(one.q[len(one.q) // 3 :]), PANDA)
    both = hk.simulate(law, POSE, CIRCLE + CIRCLE.reversed(), PANDA_START, dt=0.02, cycles=4)
    assert hk.audit_recording(logged(both.q), PANDA).by_way.beyond
    assert audit.verdict is LogVerdict.REPEATS
    for text in (audit.sentence(), audit.verdict.value):
        assert "whatever" not in text and "way, speed" not in text
    assert "Not tested: the path back" in audit.sentence()


def test_a_line_to_and_fro_at_one_speed_does_not_claim_other_speeds() -> None:
    line = hk.line(START, START - [0.2, 0, 0])
    q = hk.follow(HOME, line + line.reversed(), PANDA_START, samples=200, cycles=4).q
    audit = hk.audit_recording(logged(q, 1e-4), PANDA)
    assert audit.verdict is LogVerdict.REPEATS and audit.by_way is not None
    assert "other speeds" in audit.sentence() and "the path back" not in audit.sentence()
    assert any("other speeds" in words for words in audit.to_dict()["not_tested"])


def test_confidence_and_the_detectable_drift_are_stated() -> None:
    audit = hk.audit_recording(logged(motion(still, 12, 0.0), 1e-4), PANDA)
    assert "99 % confidence" in dict(audit.rows())["smallest detectable drift"]
    facts = audit.to_dict()
    assert facts["confidence"] == 0.99
    assert facts["detectable_drift_per_cycle"] == pytest.approx(audit.detectable)
    assert 1e-5 < audit.detectable < 1e-3


@pytest.mark.parametrize(
    ("share", "among"),
    [(0.1, {Trend.NONE}), (2.0, {Trend.CANNOT_TELL, Trend.GOES_ON}), (1000.0, {Trend.GOES_ON})],
)
def test_a_drift_called_detectable_at_a_single_phase_is_not_called_equal(share: float, among: set[Trend]) -> None:
    """To tell that it goes on, and does not fade within the last third, takes many times as much."""
    trends = Counter()
    for seed in range(20):
        y = 1e-3 * np.random.default_rng(seed).normal(size=(16, 64, 1))
        size = judge(_visits(y, 1e-3), 1e-3).detectable
        y[:, 20, 0] += share * size * np.arange(16)
        trends[judge(_visits(y, 1e-3), 1e-3).trend] += 1
    assert sum(trends[t] for t in among) >= 19


# --- the judging function -------------------------------------------------------------------------------------------


def _visits(y: np.ndarray, noise: float) -> Visits:
    k, phases, _ = y.shape
    axes = np.tile([[0.0], [1.0], [0.0]], (phases, 1, 1))
    q = y @ np.array([[0.0, 1.0, 0.0]])
    return Visits(q, axes, np.arange(float(k)), 0 * q, np.full((phases, 1), noise), np.zeros(phases))


@sampled(1, "cycles", [8, 20, 40])
def test_noise_of_known_size_is_no_trend(cycles: int) -> None:
    """Of 120 logs without any change, 1.2 may show one; four or more have the probability 0.03."""
    rng = np.random.default_rng(11)
    trends = Counter(judge(_visits(1e-3 * rng.normal(size=(cycles, 64, 1)), 1e-3), 1e-3).trend for _ in range(120))
    assert trends[Trend.GOES_ON] + trends[Trend.FADES] + trends[Trend.ALTERNATES] <= 3


@sampled(1, "common", [0.0, 0.7, 1.0])
@sampled(2, "cycles", [4, 5, 8, 20])
def test_scatter_of_unknown_size_is_no_trend(common: float, cycles: int) -> None:
    """Repeatability errors that the encoder noise does not show, alike at all phases or not."""
    rng = np.random.default_rng(7)
    false = 0
    for _ in range(100):
        y = common * rng.normal(size=(cycles, 1, 1)) + np.sqrt(1 - common**2) * rng.normal(size=(cycles, 64, 1))
        trend = judge(_visits(1e-3 * y, 1e-7 if cycles >= 5 else 1e-3), 1e-3, floor=6e-3 if cycles < 5 else 0.0).trend
        false += trend in (Trend.GOES_ON, Trend.FADES, Trend.ALTERNATES)
    assert false <= 4  # more has the probability 0.003 at a rate of 1 %


def test_a_random_walk_is_seldom_called_settled_or_drifting() -> None:
    """Its sums look like trends; its steps do not."""
    rng = np.random.default_rng(3)
    trends = Counter()
    for _ in range(60):
        walk = 1e-3 * np.cumsum(rng.normal(size=(40, 1, 1)), 0) * np.ones((1, 64, 1))
        trends[judge(_visits(walk, 1e-6), 1e-3).trend] += 1
    assert trends[Trend.GOES_ON] + trends[Trend.FADES] + trends[Trend.ALTERNATES] <= 6


def test_a_drift_below_the_tolerance_counts_when_it_adds_up() -> None:
    """5e-5 a cycle over ten quiet cycles stays within 1e-3; 1e-8 a cycle would need a hundred thousand."""
    rng = np.random.default_rng(1)
    line = np.arange(10.0)[:, None, None] * np.ones((1, 64, 1))
    found = judge(_visits(5e-5 * line + 1e-6 * rng.normal(size=line.shape), 1e-6), 1e-3)
    assert found.trend is Trend.GOES_ON and found.change < 1e-3
    assert abs(found.rate[1] - 5e-5) < found.rate_error[1] < 2e-5
    assert judge(_visits(1e-8 * line, 0.0), 1e-3).trend is Trend.NONE


def test_the_noise_foretold_along_the_spare_joint_is_the_noise_found() -> None:
    """Encoder noise on many visits of each pose, looked for along the path and moved there, against its formula."""
    q = motion(still, 30, 0.0)
    audit = hk.audit_recording(logged(q, 1e-4), PANDA)
    mean = audit.visits.mean(axis=0)
    axes = spare_axes(POSE.jacobian_batch(mean)[0])
    weights = np.array([1, 1, 1, 0.01, 0.01, 0.01])
    rate = np.gradient(audit.cycles.q.mean(axis=0), axis=0)
    foretold, joints, _ = encoder_noise(POSE.jacobian_batch(mean)[0], axes, rate, weights, np.full(7, 1e-4))
    found = np.einsum("kpn,pnd->kpd", audit.visits - mean, axes).std(axis=0, ddof=1)
    ratio = found[:-1] / foretold[:-1]
    assert np.median(ratio) == pytest.approx(0.95, abs=0.12) and ratio.max() < 1.7
    assert np.einsum("pnd,pmn->pmd", axes, POSE.jacobian_batch(mean)[0]) == pytest.approx(0, abs=1e-9)
    assert (joints.max(axis=1) <= foretold[:, 0] + 1e-12).all()


def drift_trend(drift: np.ndarray) -> DriftTrend:
    """The trend of postures at one pose that add up these drifts of successive cycles (c, n)."""
    q = np.vstack([np.zeros(drift.shape[1]), np.cumsum(drift, axis=0)])[:, None]
    n = q.shape[2]
    return judge(Visits(q, np.eye(n)[None], np.arange(len(q)), 0 * q, np.zeros((1, n)), np.zeros(1)), 1e-3)


def test_trends_of_made_up_drifts() -> None:
    axis = np.array([0.6, 0.0, -0.8])
    jitter = np.diff(1e-4 * np.random.default_rng(5).normal(size=(31, 3)), axis=0)
    cycle = np.arange(30)[:, None]
    fading = drift_trend(0.1 * 0.7**cycle * axis + jitter)
    assert fading.trend is Trend.FADES and np.isnan(fading.ratio)  # the last third is at rest
    swinging = drift_trend(0.1 * (-0.7) ** cycle * axis + jitter)
    assert swinging.trend is Trend.FADES
    steady = drift_trend(2e-4 * axis + jitter)  # no cycle shows it, all together do
    assert steady.beyond and steady.trend is Trend.CANNOT_TELL
    assert (np.abs(steady.rate - 2e-4 * axis) < steady.rate_error).all()
    beneath = drift_trend((0.1 * 0.5**cycle + 0.01) * axis + jitter)
    assert beneath.trend is Trend.GOES_ON and beneath.rate == pytest.approx(0.01 * axis, abs=1e-4)
    assert drift_trend(jitter).trend is Trend.NONE
    three, eight = (drift_trend(0.4 * 0.5 ** np.arange(k)[:, None]) for k in (3, 8))
    assert three.trend is Trend.CANNOT_TELL and np.isnan(three.ratio)
    assert eight.trend is Trend.FADES and eight.ratio == pytest.approx(0.5, abs=1e-6)


# --- intervals of a change, and what whole numbers hide ------------------------------------------------------------


TOLERANCE = 1e-3
SHAPES: dict[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "step": lambda c, rng: (c >= rng.integers(1, len(c))) * 1.0,
    "drift": lambda c, _: c / c[-1],
    "decay": lambda c, rng: 1 - rng.uniform(0.4, 0.9) ** c,
    "alternation": lambda c, _: c % 2,
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_change_over_the_tolerance_is_never_below_it_and_one_below_never_over(shape: str) -> None:
    """Changes of a fifth of the tolerance to five times as much, at one phase or all, in noise known or not."""
    rng, wrong, seen = np.random.default_rng(5), 0, 0
    for _ in range(60):
        k, size = int(rng.integers(5, 24)), TOLERANCE * 5 ** rng.uniform(-1, 1)
        noise = size * 10 ** rng.uniform(-2.5, -0.3)
        where = np.ones(64) if rng.uniform() < 0.5 else (np.arange(64) == rng.integers(64)) * 1.0
        change = size * SHAPES[shape](np.arange(float(k)), rng)
        size, y = np.ptp(change), change[:, None] * where + noise * rng.normal(size=(k, 64))
        found = judge(_visits(y[:, :, None], noise if rng.uniform() < 0.5 else 0.0), TOLERANCE)
        if found.change > 0:
            seen += 1
            wrong += found.change_range[1] < TOLERANCE < 0.99 * size or (found.beyond and size < TOLERANCE)
            assert found.change_range[0] <= found.change <= found.change_range[1]
    assert seen >= 30 and wrong <= 1  # with 99 % confidence


def test_a_step_after_any_cycle_is_seen() -> None:
    rng = np.random.default_rng(2)
    for cycle in range(1, 12):
        y = 0.01 * (np.arange(12) >= cycle)[:, None] + 1e-3 * rng.normal(size=(12, 64))
        found = judge(_visits(y[:, :, None], 0.0), TOLERANCE)
        assert found.beyond and found.trend is not Trend.NONE


@pytest.mark.parametrize("decimals", [4, 6, None])
def test_the_least_drift_that_a_log_shows_is_that_of_its_digits(decimals: int | None) -> None:
    """Cycles that are the same to the last digit: what these digits hide is not excluded."""
    robot, t = hk.load("planar-3r"), np.arange(601) / 30
    q = np.array([0.3, 0.9, 0.7]) + 0.2 * np.sin(np.pi * t[:, None] + np.arange(3))
    log = Recording(robot.joint_names, t, q if decimals is None else q.round(decimals), "log")
    found = hk.audit_recording(log, robot)
    assert found.verdict is LogVerdict.REPEATS
    assert found.detectable >= (1e-12 if decimals is None else 10.0**-decimals)


# --- the command line -----------------------------------------------------------------------------------------------


def test_the_command_exits_two_where_the_log_does_not_decide(tmp_path: Path, monkeypatch, capsys) -> None:
    log, facts = tmp_path / "noisy.csv", tmp_path / "noisy.json"
    recording = logged(motion(still, 4, 0.0), 1e-3)
    table = np.column_stack([recording.t, recording.q])
    np.savetxt(log, table, delimiter=",", header=",".join(["t", *PANDA.joint_names]), comments="")
    monkeypatch.setattr(sys, "argv", ["holokin", "audit", str(log), "--robot", "panda", "--json", str(facts)])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == 2
    streams = capsys.readouterr()
    assert "cannot tell" in streams.out and streams.err == ""
    found = json.loads(facts.read_text())
    assert (found["verdict"], found["trend"]) == ("UNDECIDED", "CANNOT_TELL")


def test_a_posture_task_logged_one_way_at_one_speed_is_cleared_of_nothing_else() -> None:
    """Its cycles repeat once it has settled; by way and by speed the joints differ, which this log does not show."""
    law = hk.motion.control.gradient_projection(
        POSE, hk.strategies.constraints.posture_cost(PANDA_START + 0.4 * np.eye(7)[2]), 1.0
    )
    run = hk.simulate(law, POSE, CIRCLE, PANDA_START, dt=0.02, cycles=7)
    q = run.q[run.marks[-5] :]
    found = hk.audit_recording(logged(q), PANDA)
    assert (found.verdict, found.exit_code) == (LogVerdict.REPEATS, 0)
    claim, _, untested = found.sentence().partition(". Not tested: ")
    assert "in all 4 cycles, in one direction and at one speed, within" in claim
    for word in ("whatever", "any way", "any speed", "both ways", "all logged speeds"):
        assert word not in claim
    assert [part.partition(" (")[0] for part in untested.split("; ")] == [
        "the path back", "other speeds", "other paths to a pose within a cycle", "paths that are not in the log",
    ]  # fmt: skip
    loop = CIRCLE.starting_at(PANDA.pose(q[0])[:3, 3])
    asked = hk.audit(law, POSE, [loop], q0=q[0], dt=0.02, cycles=3)
    assert asked.verdict is Repeatability.CONVERGES
    assert asked["paths"].metrics["apart"] > 0.02
    assert asked["speed"].metrics["apart"] > 1e-3
