"""Logs of random arms, starts, planes and radii: two answers, neither wrong, and noise decides nothing."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import holokin as hk
import random_logs as logs
from conftest import sampled
from holokin.analysis.audit import LogVerdict, Trend

NOISES = (0.0, 1e-4, 1e-3)


@pytest.mark.campaign
@sampled(2, "law", logs.LAWS)
def test_a_random_log_gets_two_answers_that_are_not_wrong_and_noise_decides_none(law: str) -> None:
    """Motions of six to nine cycles. "Cannot tell" is no wrong answer of the trend; of whether the joints repeated,
    it is one unless the log has much noise."""
    for i in range(2 if law in ("pseudo-inverse", "two times") else 1):
        motion = logs.random_motion(law, np.random.default_rng([4, logs.LAWS.index(law), i]), (6, 9))
        audits = logs.judged(motion, 24.0, i, NOISES)
        verdicts = [logs.repeated(audit.verdict, motion.truth) for audit in audits]
        trends = [logs.told(audit.trend, motion.truth) for audit in audits]
        assert verdicts[:2] == ["right", "right"] and "wrong" not in verdicts
        assert "wrong" not in trends
        widths = [np.ptp(audit.leading.ratio_range) for audit in audits]
        for less, more in pairwise(range(len(audits))):
            assert verdicts[more] in (verdicts[less], "cannot tell")
            if trends[more] not in (trends[less], "cannot tell"):  # at the edge, and not by a narrower interval
                assert 0.9 * widths[less] < widths[more] < 1.1 * widths[less]
        for audit in audits:
            assert audit.limit is None or audit.trend is Trend.GOES_ON
            if motion.truth is not Trend.GOES_ON:
                assert "at its limit after" not in audit.sentence()
            assert audit.exit_code == {"REPEATS": 0, "DIFFERS": 1, "UNDECIDED": 2}[audit.verdict.name]


def moved(shift, cycles: int, seed: int) -> logs.Motion:
    """A log on a random arm whose spare joints move by shift(cycles done)."""
    rng = np.random.default_rng(seed)
    while True:
        setup = logs.random_setup(rng)
        q = logs.shifted(setup, cycles, shift)
        if q is not None:
            return logs.Motion(setup, "drawn", q, cycles, Trend.CANNOT_TELL)


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(2))
def test_a_steady_drift_goes_on_and_what_turns_or_scatters_cannot_be_told(seed: int) -> None:
    rng = np.random.default_rng(seed)
    size = float(rng.uniform(0.005, 0.02))
    steady, period = moved(lambda c: size * c, 10, seed), float(rng.uniform(14, 20))
    found = logs.judged(steady, 30.0, seed, (1e-4,))[0]
    assert (found.verdict, found.trend) == (LogVerdict.DIFFERS, Trend.GOES_ON)
    turning = moved(lambda c: 10 * size * np.sin(2 * np.pi * c / period), 10, seed)  # it comes back later
    scatter = size * rng.normal(size=12)
    scattering = moved(lambda c: np.interp(c, np.arange(12), scatter), 10, seed)
    for motion in (turning, scattering):
        audit = logs.judged(motion, 30.0, seed, (1e-4,))[0]
        assert (audit.verdict, audit.trend) == (LogVerdict.DIFFERS, Trend.CANNOT_TELL)
        assert "Trend: cannot tell" in audit.sentence() and audit.limit is None


@pytest.mark.campaign
@sampled(1, "corners", [False, True])
def test_the_tool_path_repeats_to_what_its_samples_leave_open(corners: bool) -> None:
    """A log ends up to one sample before its last cycle does, 2 mm here: the tool is followed on. At a corner between
    two samples it cannot be, and that is said."""
    rng = np.random.default_rng(11)
    for _ in range(2):
        setup = logs.random_setup(rng)
        law = hk.holonomic(setup.task, hk.linear(np.linalg.svd(setup.task.jacobian(setup.start))[2][setup.task.m :]))
        first, side = setup.robot.pose(setup.start)[:3, 3] - setup.center, setup.side
        start = setup.center + first
        path = (
            hk.polyline([start, start - first, start - first + side, start + side], closed=True)
            if corners
            else (hk.circle(start, setup.center, normal=np.cross(first, side)))
        )
        try:
            q = hk.follow(law, path, setup.start, samples=3000).q
        except hk.base.errors.HolokinError:
            continue
        count = path.length / 0.002 * (1 + 0.3 / 50)  # samples a cycle, no whole number
        share = np.arange(int(3 * count) + 1) / count % 1.0
        at = share * (len(q) - 1)
        log = np.array([np.interp(at, np.arange(len(q)), column) for column in q.T])
        whole = setup.task.orientation is not None
        names = setup.robot.joint_names
        recording = hk.analysis.audit.logs.Recording(
            names, np.asarray(0.008 * np.arange(len(share)), dtype=float), log.T, "log"
        )
        cycles = hk.audit_recording(recording, setup.robot, orientation=whole).cycles
        assert cycles.residual.max() < max(1e-5, 2 * cycles.sampling)
        assert cycles.sampling == pytest.approx(0.002 * np.sqrt(2) / 4, rel=0.3) if corners else cycles.sampling < 2e-4
