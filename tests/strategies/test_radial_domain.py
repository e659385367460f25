"""Where a `radial` twin is defined: all round the self-motion, and no further than its transport can be trusted."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import holokin as hk
from conftest import IIWA_START, PANDA_START, PPR_CENTER, PPR_RADIUS, sampled
from holokin.base.errors import SingularityError, SingularityKind

CENTER_START = np.array([PPR_CENTER[0] - np.cos(0.8), PPR_CENTER[1] - np.sin(0.8), 0.8])
R3_START = np.array([0.3, 0.9, 0.7])


def carried(given: hk.Strategy, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Where the given strategy leads from q while the tool moves straight by v: an adaptive integrator's answer."""
    G = lambda q: np.reshape(given.gain(q)[0], (given.task.n, given.task.m))  # noqa: E731  unchecked
    return solve_ivp(lambda _t, q: G(q) @ v, (0, 1), q, "DOP853", rtol=1e-9, atol=1e-11).y[:, -1]


def round_the_self_motion(task: hk.Task, q0: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Postures with the tool pose of q0 at arc lengths along the self-motion; the null vector by an SVD."""
    before = [np.linalg.svd(task.jacobian(q0))[2][-1]]

    def tangent(_s: float, q: np.ndarray) -> np.ndarray:
        n = np.linalg.svd(task.jacobian(q))[2][-1]
        before[0] = n if n @ before[0] > 0 else -n
        return before[0]

    return solve_ivp(tangent, (0, lengths[-1]), q0, t_eval=lengths, max_step=0.1, rtol=1e-9, atol=1e-11).y.T


@sampled(
    2,
    ("name", "start", "round_trip"),
    [
        ("ppr", CENTER_START, 8.88),
        ("planar-3r", R3_START, 10.8),
        ("panda", PANDA_START, 12.8),
        ("iiwa14", IIWA_START, 11.06),
    ],
)
def test_the_twin_is_the_given_strategy_at_every_posture_over_the_centre(
    name: str, start: np.ndarray, round_trip: float
) -> None:
    """All round the self-motion: also at q3 + pi (PPR) and 2.56 rad on (planar arm), where a projection Z^T q turns."""
    robot = hk.load(name)
    given = hk.moore_penrose(hk.position(robot) if robot.n == 3 else hk.pose(robot))
    twin = hk.radial(given, start, steps=1)
    Q = round_the_self_motion(given.task, start, np.linspace(0, round_trip, 60))
    assert np.abs(np.exp(1j * Q[-1]) - np.exp(1j * start)).max() < 0.1  # once round
    for q in Q:
        assert np.abs(twin(q) - given(q)).max() < 1e-5 * max(1.0, np.abs(given(q)).max())
    labels = np.unwrap([float(twin.constraint_value(q)) for q in Q])
    even = np.diff(labels) * np.sign(labels[-1]) / (2 * np.pi / 59)
    assert (even > 0.85).all()
    assert (even < 1.15).all()


@sampled(1, "z0", [0.8 + np.pi, 0.8 + 2.6, -1.9])
def test_the_leaf_across_the_turn_of_the_projection_has_its_closed_form(z0: float) -> None:
    """tan((q3 - theta)/2) = tan((z0 - theta)/2) e^{-rho/2}, from every posture over the centre."""
    given = hk.moore_penrose(hk.position(hk.load("ppr")))
    twin = hk.radial(given, CENTER_START, steps=8)
    start = np.array([PPR_CENTER[0] - np.cos(z0), PPR_CENTER[1] - np.sin(z0), z0])
    for theta in (0.3, 2.0, -1.1):
        end = PPR_CENTER + PPR_RADIUS * np.array([np.cos(theta), np.sin(theta), 0])
        q3 = hk.follow(twin, hk.line(PPR_CENTER, end), start, samples=20).q[-1, 2]
        closed = np.tan((z0 - theta) / 2) * np.exp(-PPR_RADIUS / 2)
        assert np.tan((q3 - theta) / 2) == pytest.approx(closed, rel=1e-8)


def test_a_planar_arm_is_carried_along_straight_segments_from_any_posture_over_the_centre(
    planar_3r: hk.Robot,
) -> None:
    given = hk.moore_penrose(hk.position(planar_3r))
    twin = hk.radial(given, R3_START, steps=8)
    center = planar_3r.pose(R3_START)[:3, 3]
    for start in round_the_self_motion(given.task, R3_START, np.array([1.3, 2.56, 4.1, 7.0])):
        for v in ([0.15, 0.05], [-0.1, 0.12]):
            walk = hk.follow(twin, hk.line(center, center + np.append(v, 0)), start, samples=30)
            assert np.abs(walk.q[-1] - carried(given, start, np.array(v))).max() < 1e-6


@sampled(1, "name", ["planar-3r", "panda"])
def test_a_twin_answers_only_where_its_transport_is_right(name: str) -> None:
    """Postures all over the joint range: each is refused, or its label is that of an adaptive integrator's way."""
    robot = hk.load(name)
    start, reach = (R3_START, 2.5) if robot.n == 3 else (PANDA_START, 1.5)
    turned = robot.pose(start)[:3, :3]
    given = hk.moore_penrose(hk.position(robot) if robot.n == 3 else hk.pose(robot, "twist", reference=turned))
    task, twin = given.task, hk.radial(given, start)
    answered = refused = 0
    for q in start + np.random.default_rng(3).uniform(-reach, reach, (60, robot.n)):
        try:
            twin(q)
        except SingularityError as problem:
            assert problem.kind is SingularityKind.REPRESENTATION
            refused += 1
            continue
        label = float(twin.constraint_value(q))
        back = carried(given, q, task(start) - task(q))
        gap = label - float(twin.constraint_value(back))
        assert abs(np.arctan2(np.sin(gap), np.cos(gap))) < 0.05 * np.linalg.norm(q - back)
        answered += 1
    assert answered > 10
    assert refused > 5


def test_a_posture_of_another_branch_is_refused(planar_3r: hk.Robot) -> None:
    """Within 1 m of the base the self-motions are two curves: elbows one way and the other."""
    start = np.array([0.3, 2.2, 1.2])
    given = hk.moore_penrose(hk.position(planar_3r))
    assert np.linalg.norm(given.task(start)) < 0.95
    twin = hk.radial(given, start)
    mirrored = start * [1, -1, -1]
    mirrored[0] += np.subtract(*(np.arctan2(*given.task(q)[::-1]) for q in (start, mirrored)))  # same direction again
    assert given.task(mirrored) == pytest.approx(given.task(start), abs=1e-12)
    with pytest.raises(SingularityError) as caught:
        twin(mirrored)
    assert caught.value.kind is SingularityKind.REPRESENTATION
    assert hk.radial(given, mirrored)(mirrored) == pytest.approx(given(mirrored), abs=1e-8)


def test_with_several_redundant_joints_the_twin_ends_where_its_projection_turns() -> None:
    """One row, two redundant joints: Z^T N is singular for q3 = pi/2 and -pi/2, where Z = (1, 0, 1), N = (-1, 0, 1)."""
    robot = hk.load("ppr")
    given = hk.moore_penrose(hk.position(robot, rows=[0]))
    start = np.array([0.2, 0.0, np.pi / 2])
    twin = hk.radial(given, start)
    assert twin(start) == pytest.approx(given(start))
    turned = np.array([0.2, 0.0, -np.pi / 2])
    with pytest.raises(SingularityError) as caught:
        twin(turned)
    assert caught.value.kind is SingularityKind.REPRESENTATION
    near = turned + [0, 0, 0.3]
    assert robot.pose(near)[0, 3] != pytest.approx(0.2)
    assert np.isfinite(twin(near)).all()


def test_a_singular_arm_is_called_singular_not_out_of_the_twins_domain(planar_3r: hk.Robot) -> None:
    twin = hk.radial(hk.moore_penrose(hk.position(planar_3r)), R3_START)
    for q in (np.zeros(3), np.array([0.4, np.pi, 0.0])):
        with pytest.raises(SingularityError) as caught:
            twin(q)
        assert caught.value.kind is SingularityKind.KINEMATIC


def test_near_the_centre_half_the_curvature_bounds_the_deviation_and_far_from_it_no_more() -> None:
    """PPR: |F| = 1/4 |N|. The greatest deviation over 1/2 |x - x0| |F| is 1 + O(|x - x0|): 12 % more at 0.7 m."""
    given = hk.moore_penrose(hk.position(hk.load("ppr")))
    twin = hk.radial(given, CENTER_START, steps=8)
    shares = []
    for rho in (0.05, 0.7):
        most = 0.0
        for z in np.linspace(0, 2 * np.pi, 60):
            q = np.array([PPR_CENTER[0] + rho - np.cos(z), PPR_CENTER[1] - np.sin(z), z])
            most = max(most, np.linalg.norm(twin(q) - given(q), 2) / (rho / 2 * 0.25 * np.sqrt(2)))
        shares.append(most)
    assert shares[0] == pytest.approx(1.0, abs=0.02)
    assert 1.11 < shares[1] < 1.13


def test_a_start_close_to_a_singular_posture_has_a_twin_too(panda: hk.Robot) -> None:
    """The elbow is all but stretched: sigma_min(J) = 0.003, and the self-motion turns about within 0.1 rad."""
    start = np.array([1.92753978, 1.01219379, -1.51024983, -0.43172591, -2.55792167, 0.99673323, -2.0264906])
    given = hk.moore_penrose(hk.pose(panda))
    twin = hk.radial(given, start)
    assert np.abs(twin(start) - given(start)).max() < 1e-6 * np.abs(given(start)).max()
    near = start + 1e-3
    assert np.abs(panda.jacobian(near) @ twin(near) - np.eye(6)).max() < 1e-9


def test_a_long_way_of_the_slides_does_not_hide_the_error_of_the_label() -> None:
    """PPR from 1 to 15 m, 4 steps: q_b is within 0.02 rad of its closed form, or refused; at 11 m most are refused."""
    start = np.array([-np.cos(0.8), -np.sin(0.8), 0.8])
    twin = hk.radial(hk.moore_penrose(hk.position(hk.load("ppr"))), start)
    draw, refused = np.random.default_rng(0), {}
    for rho in (1, 3, 5, 8, 11, 15):
        refused[rho] = 0
        for z, theta in draw.uniform(-np.pi, np.pi, (60, 2)):
            q = np.array([rho * np.cos(theta) - np.cos(z), rho * np.sin(theta) - np.sin(z), z])
            try:
                twin(q)
            except SingularityError as problem:
                assert problem.kind is SingularityKind.REPRESENTATION
                refused[rho] += 1
                continue
            back = theta + 2 * np.arctan(np.tan((z - theta) / 2) * np.exp(rho / 2))
            gap = abs(float(twin.constraint_value(q))) - abs(np.angle(np.exp(1j * (back - 0.8))))
            assert abs(gap) < 0.02
    assert refused[1] == refused[3] == 0
    assert refused[11] > 40
