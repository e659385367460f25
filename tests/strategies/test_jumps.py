"""Laws whose formula jumps: the verdict says it, `follow` and `inverse` stop there; what is only a kink passes."""

from __future__ import annotations

import numpy as np
import pytest
from casadi import atan2, ceil, fabs, floor, fmin, fmod, if_else, sign

import holokin as hk
from conftest import PANDA_START, R3_START, campaign, sampled
from holokin.base.errors import BranchError
from holokin.motion.ik import InverseStatus
from holokin.strategies import may_jump, pfaffian

JUMPS = {
    "if_else": lambda s, b: if_else(s > 0, 0.2 + 0.3 * b, 0),
    "floor": lambda s, b: 0.3 * floor(s),
    "ceil": lambda s, b: 0.2 * ceil(s) * (1.5 + b),
    "sign": lambda s, b: 0.1 * sign(s),
    "fmod": lambda s, b: 0.1 * fmod(s + 1, 1.0),
    "a narrow band": lambda s, b: if_else(fabs(s) < 1e-3, 0.2, 0) + if_else(s > 0, 0.1, 0),
}
KINKS = {
    "fabs": lambda s, b: 0.3 * fabs(s),
    "if_else": lambda s, b: if_else(s > 0, 0.3 * s * (1 + b), 0),
    "fmin": lambda s, b: 0.3 * fmin(s, 0.2 * b),
    "floor": lambda s, b: 0.2 * (s - floor(s)) * (s - floor(s) - 1),
    "twice": lambda s, b: 0.1 * s * sign(s),
}


def law(robot: hk.Robot, q0: np.ndarray, part, seed: int) -> tuple[hk.Strategy, np.ndarray]:
    """(g = q_3 + part(s, q_b) with s = 0 on a random plane near q0, q0)."""
    rng = np.random.default_rng(seed)
    task = hk.position(robot) if robot.n == 3 else hk.pose(robot)
    normal, at = rng.normal(size=robot.n), rng.uniform(-0.02, 0.02)
    normal /= np.linalg.norm(normal)
    b = int(rng.integers(robot.n))
    g = hk.custom(lambda q: q[2] + part(sum(float(v) * (q[i] - q0[i]) for i, v in enumerate(normal)) - at, q[b]))
    return hk.holonomic(task, g), q0


ROBOTS = {"planar-3r": R3_START, "panda": PANDA_START}


@sampled(1, ("name", "kind"), [*(("planar-3r", kind) for kind in JUMPS), ("panda", "if_else")])
def test_a_jump_of_g_is_told_by_the_verdict_and_ends_follow_and_inverse(name: str, kind: str) -> None:
    met = 0
    for seed in range(3 if name == "planar-3r" else 1):
        G, q0 = law(hk.load(name), ROBOTS[name], JUMPS[kind], seed)
        verdict = hk.involutivity(G, hk.around(q0, 0.2), samples=16)
        assert verdict.jumps and max(jump.level for jump in verdict.jumps) > 0.05, (seed, verdict)
        assert not verdict.holonomic or "between the jumps of its g" in verdict.sentence
        tool = G.task.robot.pose(q0)
        rng = np.random.default_rng(seed)
        for _ in range(4 if name == "planar-3r" else 2):
            step = 0.08 * rng.choice((-1, 1)) * np.eye(3)[int(rng.integers(2))]
            end = tool.copy()
            end[:3, 3] += step
            line = hk.line(tool[:3, 3], end[:3, 3]) if name == "panda" else hk.line(tool[:2, 3], end[:2, 3])
            goal = end if name == "panda" else end[:2, 3]
            ik = hk.ik(G, q0)
            try:
                walk = hk.follow(G, line, q0, samples=20, limits=False)
            except BranchError as problem:
                met += 1
                walk = problem.trajectory
                assert walk.status is hk.motion.Status.JUMP
                assert problem.level > 0.05 and problem.what and "its g jumps" in str(problem)
                with pytest.raises(BranchError):
                    ik(goal)
                assert ik.batch(goal[None]).status[0] == InverseStatus.JUMP
            else:
                assert ik(goal) == pytest.approx(walk.q[-1], abs=1e-6)
            steps = np.abs(np.diff(walk.q, axis=0)).max(axis=1, initial=0.0)
            assert steps.max(initial=0.0) < 0.05  # no jump of the joints, whether it ended or not
            assert np.abs(np.diff([G.g(q) for q in walk.q], axis=0)).max(initial=0.0) < 1e-8
    assert met >= (2 if name == "planar-3r" else 1)


@pytest.mark.parametrize(
    ("name", "kind"), [*(("planar-3r", kind) for kind in KINKS), campaign(("name", "kind"), ("panda", "if_else"))]
)
def test_a_kink_of_g_stops_nothing_and_the_joints_return(name: str, kind: str) -> None:
    G, q0 = law(hk.load(name), ROBOTS[name], KINKS[kind], 1)
    verdict = hk.involutivity(G, hk.around(q0, 0.2), samples=16)
    assert verdict.holonomic and not verdict.jumps
    point = G.task.robot.pose(q0)[:3, 3]
    walk = hk.follow(G, hk.circle(point, point - [0.06, 0, 0]), q0, samples=60, limits=False)
    assert np.abs(walk.drift()).max() < 1e-8


@pytest.mark.parametrize("seed", range(4))
def test_planes_that_jump_apart_are_not_holonomic_and_a_circle_drifts(planar_3r: hk.Robot, seed: int) -> None:
    """Each side is holonomic by itself, dq_3 = a dq_j: at random postures there is no curvature."""
    rng = np.random.default_rng(seed)
    a, at = rng.uniform(0.3, 0.8), R3_START[0] + rng.uniform(-0.05, 0.05)
    task = hk.position(planar_3r)
    G = pfaffian(task, lambda q: [[0, if_else(q[0] > at, a, 0), 1]])
    point = task(R3_START)
    walk = hk.follow(G, hk.circle(point, point - [0.25, 0.1]), R3_START, samples=1000, limits=False)
    assert np.abs(walk.drift()).max() > 0.01
    verdict = hk.involutivity(G, hk.around(R3_START, 0.3))
    assert not verdict.holonomic and not verdict.curved
    assert "its planes jump" in verdict.sentence and "if_else" in verdict.sentence


def test_planes_that_jump_across_their_own_seam_alone_bring_the_joints_back(planar_3r: hk.Robot) -> None:
    """dq_3 = a dq_1 beyond q_1 = c: the slopes of a continuous g."""
    task = hk.position(planar_3r)
    G = pfaffian(task, lambda q: [[if_else(q[0] > 0.32, 0.5, 0), 0, 1]])
    assert hk.involutivity(G, hk.around(R3_START, 0.3)).holonomic
    point = task(R3_START)
    walk = hk.follow(G, hk.circle(point, point - [0.25, 0.1]), R3_START, samples=4000, limits=False)
    assert np.abs(walk.drift()).max() < 1e-3


def test_the_cut_of_an_angle_is_no_jump_where_rows_are_angles(planar_3r: hk.Robot) -> None:
    task = hk.position(planar_3r)
    for angular in (True, False):
        g = hk.custom(lambda q: q[2] + atan2(q[0] - 0.3, q[1] - 2.0), angular=angular)
        G = hk.holonomic(task, g)
        assert bool(may_jump(G)) is not angular
        verdict = hk.involutivity(G, hk.around(R3_START, 0.3))
        assert bool(verdict.jumps) is not angular
        assert "atan2" in verdict.sentence or angular


@pytest.mark.parametrize(
    "g", [hk.lock(2), hk.arm_angle(), hk.linear(np.arange(1.0, 8.0)), hk.strategies.constraints.height(3)]
)
def test_the_library_s_own_constraints_have_no_switches(panda: hk.Robot, g: hk.Constraint) -> None:
    G = hk.holonomic(hk.pose(panda), g)
    assert may_jump(G) == ()
    assert hk.involutivity(G, hk.around(PANDA_START, 0.1), samples=4).may_jump == ()
