"""Ramps are as short as limits allow, whatever the samples; a limit that is blamed binds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_START, sampled
from holokin.motion import TimedTrajectory
from holokin.motion.trajectory import Trajectory

SEEDS = range(6)
PROFILES = ("trapezoidal", "time-optimal")
STARTS = {"panda": PANDA_START, "iiwa14": [0.3, 0.6, 0.2, -1.5, 0.4, 1.1, 0.2]}


def slide(ppr: hk.Robot, length: float, samples: int) -> Trajectory:
    """The first joint of a PPR arm moves at 1 m/s; the others stand still."""
    G = hk.holonomic(hk.position(ppr), hk.lock(2))
    start = ppr.pose(PPR_START)[:3, 3]
    line = hk.line(start, start + ppr.jacobian(PPR_START)[:3, 0] * length, speed=1.0)
    return hk.follow(G, line, PPR_START, samples=samples)


def seconds_below(timed: TimedTrajectory, speed: float) -> float:
    """Seconds that a path takes beyond those at its set speed: half of the ramps' times, together."""
    return timed.duration - float(timed.untimed.t[-1]) / speed


@sampled(1, "profile", PROFILES)
@sampled(1, "seed", SEEDS)
def test_a_ramp_on_a_straight_curve_takes_the_time_of_the_closed_form(ppr: hk.Robot, seed: int, profile: str) -> None:
    """v/a; under a limit of jerk v/a + a/j, or 2 sqrt(v/j) where the acceleration is not reached."""
    draw = np.random.default_rng(seed)
    speed, acceleration, jerk = 10.0 ** draw.uniform([-3, -1, 1], [0, 2, 4])
    walk = slide(ppr, 0.5, int(draw.integers(5, 200)))
    dt = 5e-5 * 0.5 / speed  # steps so short that rounding up to a whole one counts for nothing
    bare = hk.retime(walk, velocity=10.0, acceleration=acceleration, speed=speed, profile=profile, dt=dt)
    assert max(bare.excess().values()) < 1e-9
    if speed**2 / acceleration > 0.4:  # no phase at the set speed is left
        return
    assert seconds_below(bare, speed) == pytest.approx(speed / acceleration, rel=0.02, abs=2 * dt)
    soft = hk.retime(walk, velocity=10.0, acceleration=acceleration, jerk=jerk, speed=speed, profile=profile, dt=dt)
    assert max(soft.excess().values()) < 1e-9
    reached = speed > acceleration**2 / jerk
    wanted = speed / acceleration + acceleration / jerk if reached else 2 * np.sqrt(speed / jerk)
    if wanted * speed > 0.4:
        return
    assert seconds_below(soft, speed) == pytest.approx(wanted, rel=0.06, abs=2 * dt)


@pytest.mark.campaign
@pytest.mark.parametrize("profile", PROFILES)
@sampled(1, "name", STARTS)
@sampled(1, "seed", range(3))
def test_ramps_do_not_depend_on_the_samples_and_a_limit_binds_in_each(seed: int, name: str, profile: str) -> None:
    robot, q0 = hk.load(name), STARTS[name]
    draw = np.random.default_rng(seed)
    G = hk.holonomic(hk.pose(robot), hk.lock(2))
    start = robot.pose(q0)[:3, 3]
    way = draw.normal(size=3)
    path = hk.line(start, start + 0.05 * way / np.linalg.norm(way), speed=float(10.0 ** draw.uniform(-1.7, -1)))
    acceleration = 10.0 ** draw.uniform(0, 2, robot.n)
    extra = []
    for samples in (15, 60, 400):
        walk = hk.follow(G, path, q0, samples=samples)
        timed = hk.retime(walk, acceleration=acceleration, speed=1.0, profile=profile, dt=1e-4)
        assert max(timed.excess().values()) < 1e-9
        assert timed.excess("difference")["acceleration"] < 1e-9
        extra.append(seconds_below(timed, 1.0))
        slow = np.any([(s.start <= timed.t) & (timed.t <= s.stop) for s in timed.slowdowns], axis=0)
        np.testing.assert_allclose(timed.path_speed[~slow], 1.0, rtol=2e-3)
        for s in timed.slowdowns:
            inside = (s.start <= timed.t) & (timed.t <= s.stop)
            rates = {"velocity": timed.dq, "acceleration": timed.ddq, "jerk": timed.dddq}
            joint = robot.joint_names.index(s.joint)
            share = np.abs(rates[s.limit][inside, joint]) / getattr(timed.limits, s.limit)[joint]
            assert share.max() > 0.9, str(s)
    d1 = (walk.q[1] - walk.q[0]) / walk.t[1], (walk.q[-1] - walk.q[-2]) / walk.t[1]
    closed = sum(float(np.max(np.abs(d) / acceleration)) for d in d1) / 2  # of a curve that hardly bends in the ramps
    assert extra == pytest.approx([closed] * 3, rel=0.05, abs=2e-4)


def test_where_the_shape_of_a_profile_takes_the_time_no_limit_is_blamed(ppr: hk.Robot) -> None:
    timed = hk.retime(slide(ppr, 0.5, 20), velocity=10.0, acceleration=1e4, speed=1.0, profile="quintic")
    assert [(s.joint, s.limit) for s in timed.slowdowns] == [("", "quintic profile")] * 2
    assert "the reason is the shape of the quintic profile" in timed.table()


def test_ramps_and_the_even_part_between_have_their_own_reasons(ppr: hk.Robot) -> None:
    timed = hk.retime(slide(ppr, 2.0, 20), velocity=0.5, acceleration=1.0, speed=1.0, profile="trapezoidal")
    assert [s.limit for s in timed.slowdowns] == ["acceleration", "velocity", "acceleration"]
    assert timed.slowdowns[1].least == pytest.approx(0.5, rel=1e-3)
    said = [str(s).split("slower than wanted, ")[1] for s in timed.slowdowns]
    assert [one.split(";")[0] for one in said] == [
        "down to a stop",
        "down to 50 % of the wanted speed",
        "down to a stop",
    ]
    almost = replace(timed.slowdowns[1], least=0.997)
    assert "down to 99.7 % of the wanted speed" in str(almost), "100 % is not slower"
