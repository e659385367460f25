"""Stretches of self-motions: what is least along them, beside postures close together on them; roots; whole turns."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import sampled
from holokin.base.types import Matrix, Vector
from holokin.motion.self_motions.self_motions import self_motions_at
from holokin.motion.self_motions.stretches import Stretches
from holokin.motion.self_motions.whole_turns import turns_of

WEIGHTS = np.array([1.0, -0.7, 0.4, 0.9, -0.3, 0.6, -0.8])


def stretches_of(name: str) -> Stretches:
    """Every ninth of the stretches between neighbours on the self-motions of two poses."""
    task = hk.pose(hk.load(name))
    p, R = task._poses(np.random.default_rng(3).uniform(-2, 2, (2, task.n)))
    motions = self_motions_at(task, p, R)
    first = np.flatnonzero(np.diff(motions.curve) == 0)[::9]
    pose = motions.pose[first]
    return Stretches.between(task, p[pose], R[pose], motions.q[first], motions.q[first + 1])


def smooth(q: Matrix) -> Vector:
    return np.sin(q @ WEIGHTS) + 0.1 * np.cos(3 * q).sum(axis=1)


def kinked(q: Matrix) -> Vector:
    """As the excess over joint limits: the largest of several functions."""
    return np.abs(np.sin(q + WEIGHTS)).max(axis=1)


@sampled(1, "name", ["panda", "xarm7", "gen3"])
@pytest.mark.parametrize("function", [smooth, kinked])
def test_no_posture_of_a_stretch_is_less_than_the_least(name: str, function) -> None:
    """Referee: 50 postures of each stretch, moved onto the self-motion one by one, and those beside the least."""
    stretches = stretches_of(name)
    task, count = stretches.task, len(stretches)
    q, value = stretches.least(lambda Q, _: function(Q))
    assert np.abs(task.error(q, stretches.p, stretches.R)).max() < 1e-10
    assert value == pytest.approx(function(q), abs=1e-12)
    dense = np.array([function(stretches.postures(np.full(count, u))) for u in np.linspace(0, 1, 50)])
    inner = dense.argmin(axis=0)
    # Where there are two hollows between neighbours either may be told: on no stretch here but for a few.
    worse = value > dense.min(axis=0) + 1e-9
    assert worse.sum() <= 0.02 * count
    assert (value > dense.min(axis=0) - 1e-3).all()
    assert ((inner > 0) & (inner < 49)).sum() > 2


@sampled(1, "name", ["panda", "xarm7", "gen3"])
def test_a_joint_has_the_value_that_it_passes(name: str) -> None:
    stretches = stretches_of(name)
    joint = np.abs(stretches.move).argmax(axis=1)
    every = np.arange(len(stretches))
    value = stretches.a[every, joint] + 0.37 * stretches.move[every, joint]
    q = stretches.at_values(joint, value)
    assert np.array_equal(q[every, joint], value)
    assert np.abs(stretches.task.error(q, stretches.p, stretches.R)).max() < 1e-10
    beside = np.linalg.norm(q - stretches.a - 0.37 * stretches.move, axis=1)
    assert (beside < 0.5 * np.linalg.norm(stretches.move, axis=1)).all()
    # One that it does not pass leaves the beginning.
    beyond = stretches.at_values(joint, stretches.a[every, joint] - 0.1 * stretches.move[every, joint])
    assert np.array_equal(beyond, stretches.a)


def test_the_last_posture_of_which_something_is_true_is_found_to_round_off() -> None:
    stretches = stretches_of("panda")
    height = lambda q: q @ WEIGHTS  # noqa: E731
    begin, end = height(stretches.a), height(stretches.a + stretches.move)
    some = np.abs(end - begin) > 0.01
    stretches, sign, middle = stretches.some(some), np.sign(end - begin)[some], ((begin + end) / 2)[some]
    q = stretches.halved(lambda Q: sign * (height(Q) - middle) < 0)
    assert height(q) == pytest.approx(middle, abs=1e-12)


def test_what_whole_turns_do_to_each_row_of_g(panda: hk.Robot) -> None:
    """A turn of joint 1 and two back of joint 2 keep 2 q1 + q2; one of joint 4 or 5 changes q4 q5 by what varies."""
    rule = hk.custom(lambda q: [2 * q[0] + q[1], q[2] + q[3] * q[4]], rows=2)
    turns = turns_of(hk.holonomic(hk.pose(panda, "axis"), rule), np.zeros((0, 7)))
    assert turns.free.tolist() == [False] * 5 + [True] * 2
    assert turns.change / (2 * np.pi) == pytest.approx(np.eye(7)[:, [0, 2]] * [2, 1] + np.eye(7)[:, [1, 3]] * [1, 0])
    assert np.flatnonzero(turns.varying).tolist() == [3, 4]
    q = np.array([[0.1, 0.2 + 4 * np.pi, 0.3, -1.0, 0.2, 1.0, 9.0]])
    found, fits = turns.nearest(q, np.zeros((1, 2)), np.zeros(7), np.full(7, -7.0), np.full(7, 7.0))
    assert fits[0] and found[0] == pytest.approx([0.1 + 2 * np.pi, 0.2, 0.3, -1.0, 0.2, 1.0, 9.0 - 2 * np.pi])
    assert not turns.nearest(q, np.zeros((1, 2)), np.zeros(7), np.full(7, -6.0), np.full(7, 6.0))[1][0]
