"""Controllers: laws with feedback, damping, postures and memory, against the oracles of theory 2c, 2d, 2g."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

import holokin as hk
from conftest import PANDA_START
from conftest import R3_START as START
from holokin.base.errors import (
    ArgumentError,
    ControllerError,
    OpenPathError,
    ShapeError,
    SingularityError,
    StartError,
    UnknownNameError,
)
from holokin.motion import LoopWatch
from holokin.motion.control import as_control_law
from holokin.motion.trajectory import Status


@pytest.fixture(scope="module")
def task(planar_3r: hk.Robot) -> hk.Task:
    return hk.position(planar_3r)


@pytest.fixture(scope="module")
def loop(planar_3r: hk.Robot) -> hk.Path:
    """A circle of 0.1 m in one second."""
    point = planar_3r.pose(START)[:3, 3]
    return hk.circle(point, point - [0.1, 0, 0], speed=2 * np.pi * 0.1)


def closure(controller: object, task: hk.Task, path: hk.Path, dt: float, cycles: int = 1) -> float:
    return float(np.abs(hk.simulate(controller, task, path, START, dt=dt, cycles=cycles).drift_since_start()[-1]).max())


def test_a_strategy_driven_by_small_steps_does_what_following_does(task: hk.Task, loop: hk.Path) -> None:
    given = hk.moore_penrose(task)
    exact = hk.follow(given, loop, START, samples=400).q[-1]
    errors = [np.abs(hk.simulate(given, task, loop, START, dt=dt).q[-1] - exact).max() for dt in (1 / 500, 1 / 1000)]
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(2, abs=0.1)  # Euler's order


def test_feedback_brings_the_tool_back_at_its_gain(task: hk.Task, planar_3r: hk.Robot) -> None:
    """A resting target 1 cm beside the tool: the error falls as (1 - K dt)^k."""
    law = hk.motion.control.closed_loop(hk.moore_penrose(task), gain=8.0).begin(START)
    pose = planar_3r.pose(START)
    pose[0, 3] += 0.01
    q, dt = START.copy(), 1e-3
    for _ in range(250):
        q = q + dt * law(q, pose, np.zeros(6), dt)
    left = np.linalg.norm((pose - planar_3r.pose(q))[:2, 3])
    assert left == pytest.approx(0.01 * np.exp(-8.0 * 0.25), rel=2e-2)


def test_repetitive_motion_closes_with_the_inverse_square_of_its_rate_T9(task: hk.Task, loop: hk.Path) -> None:
    a, b = (
        closure(hk.motion.control.repetitive_motion(task, rate, gain=100), task, loop, 1 / 8000)
        for rate in (80.0, 240.0)
    )
    assert a / b == pytest.approx(9, rel=0.1)
    assert closure(hk.moore_penrose(task), task, loop, 1 / 2000) > 50 * a


def test_repetitive_motion_is_gradient_projection_on_the_first_posture(task: hk.Task, loop: hk.Path) -> None:
    a = hk.simulate(hk.motion.control.repetitive_motion(task, 5.0), task, loop, START, dt=0.01).q
    b = hk.simulate(
        hk.motion.control.gradient_projection(task, hk.strategies.constraints.posture_cost(START), 5.0),
        task,
        loop,
        START,
        dt=0.01,
    ).q
    assert np.abs(a - b).max() < 1e-12


def test_repetitive_motion_within_limits_is_the_same_until_a_limit_binds(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    point = panda.pose(PANDA_START)[:3, 3]
    loop = hk.circle(point, point - [0.1, 0, 0], speed=0.3)
    free, held = (
        hk.simulate(hk.motion.control.repetitive_motion(task, 2.0, limits=limits), task, loop, PANDA_START, dt=0.02)
        for limits in (False, True)
    )
    assert np.abs(free.q - held.q).max() < 1e-6
    wrist = np.abs(free.dq[:, 4]).max()
    speeds = np.where(np.arange(7) == 4, 0.9 * wrist, 2.0)
    slow = replace(
        panda,
        coordinates=tuple(replace(c, max_velocity=v) for c, v in zip(panda.coordinates, speeds, strict=True)),
    )
    bound = hk.simulate(
        hk.motion.control.repetitive_motion(hk.pose(slow), 2.0, limits=True), hk.pose(slow), loop, PANDA_START, dt=0.02
    )
    assert np.abs(bound.dq[:, 4]).max() == pytest.approx(0.9 * wrist, rel=1e-6)
    assert bound.tracking_error() < 2e-3
    slower = replace(panda, coordinates=tuple(replace(c, max_velocity=0.05) for c in panda.coordinates))
    with pytest.raises(ControllerError, match="no joint rates within the limits"):
        hk.simulate(
            hk.motion.control.repetitive_motion(hk.pose(slower), 2.0, limits=True),
            hk.pose(slower),
            loop,
            PANDA_START,
            dt=0.02,
        )


def test_gradient_projection_in_plain_numpy(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    preferred = PANDA_START + 0.2
    law = hk.motion.control.gradient_projection(
        task, hk.strategies.constraints.posture_cost(preferred), 3.0, gain=4.0
    ).begin(PANDA_START)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q, twist = PANDA_START + rng.uniform(-0.2, 0.2, 7), rng.uniform(-1, 1, 6)
        J = panda.jacobian(q)
        P = np.linalg.pinv(J)
        expected = P @ twist + (np.eye(7) - P @ J) @ (3.0 * (preferred - q))
        pose = panda.pose(q)
        here = law(q, pose, twist, 1e-9)  # the pose wanted now is the pose that is
        assert np.abs(here - expected).max() < 1e-7


def test_a_posture_task_repeats_but_joints_depend_on_the_way_and_the_speed(task: hk.Task, loop: hk.Path) -> None:
    """What the audit is for: after some cycles it comes home, yet a pose has no joints of its own."""
    law = hk.motion.control.gradient_projection(
        task, hk.strategies.constraints.posture_cost(START + [0.4, -0.3, 0.2]), 1.0, gain=50
    )
    walk = hk.simulate(law, task, loop, START, dt=1 / 400, cycles=12)
    each = np.abs(walk.drift()).max(axis=1)
    assert each[-1] < 1e-3 * each[0]
    settled = walk.q[-1]
    here = loop.starting_at(task.robot.pose(settled)[:3, 3])
    a, b = (hk.simulate(law, task, way, settled, dt=1 / 400).q[-1] for way in here.halves())
    assert np.abs(a - b).max() > 2e-4
    slow = hk.simulate(law, task, here.at_speed(loop.speed / 4).halves()[0], settled, dt=1 / 400).q[-1]
    assert np.abs(a - slow).max() > 1e-4


def test_damping_bounds_the_joints_where_the_pseudo_inverse_has_none(task: hk.Task, planar_3r: hk.Robot) -> None:
    stretched = np.array([0.3, 0.0, 0.0])
    outward = np.append(planar_3r.pose(stretched)[:2, 3], np.zeros(4))
    pose = planar_3r.pose(stretched)
    dq = hk.motion.control.damped(task, 0.1).begin(stretched)(stretched, pose, outward, 1e-9)
    J = task.jacobian(stretched)
    assert np.abs(dq - J.T @ np.linalg.solve(J @ J.T + 0.01 * np.eye(2), outward[:2])).max() < 1e-7
    with pytest.raises(SingularityError):
        hk.motion.control.closed_loop(hk.moore_penrose(task)).begin(stretched)(stretched, pose, outward, 1e-9)


def test_asymptotic_cyclicity_nears_its_leaf_at_its_gain_and_then_comes_home(task: hk.Task, loop: hk.Path) -> None:
    g = hk.linear([0.0, 1.0, -1.0])
    value = hk.holonomic(task, g).constraint_value
    leaf = value(START) + 0.2
    walk = hk.simulate(
        hk.motion.control.asymptotically_cyclic(task, g, leaf, 2.0), task, loop, START, dt=1 / 2000, cycles=4
    )
    gaps = [value(walk.q[k]) - leaf for k in walk.marks]
    assert gaps == pytest.approx([-0.2 * np.exp(-2.0 * t) for t in range(5)], rel=2e-2)
    each = np.abs(walk.drift()).max(axis=1)
    assert each[1:] / each[:-1] == pytest.approx(np.exp(-2.0), rel=0.1)


def test_the_projected_form_of_asymptotic_cyclicity_is_cyclic_to_first_order_only(task: hk.Task, loop: hk.Path) -> None:
    """J^+ x' - mu N (J_g N)^-1 (g - c): |g - c| settles at O(1/mu) and not at zero (theory 2c)."""
    g = hk.linear([0.0, 1.0, -1.0])
    leaf = START[1] - START[2]
    off = []
    for mu in (20.0, 40.0):
        law = hk.motion.control.asymptotically_cyclic(task, g, leaf, mu, exact=False)
        walk = hk.simulate(law, task, loop, START, dt=1 / 2000, cycles=2)
        off.append(np.abs(walk.q[walk.marks[1] :] @ [0.0, 1.0, -1.0] - leaf).max())
    assert off[0] > 1e-4
    assert off[0] / off[1] == pytest.approx(2, abs=0.3)


# --- Mussa-Ivaldi and Hogan, T8 ---


def stiff(n: int) -> hk.strategies.constraints.Cost:
    return hk.strategies.constraints.posture_cost(np.linspace(0.1, 0.6, n), np.linspace(1.0, 2.0, n))


def planar(n: int) -> hk.Robot:
    return hk.from_dh([{"a": 1.0}] * n, name=f"planar-{n}r")


def test_the_impedance_strategy_is_its_weighted_pseudo_inverse(task: hk.Task) -> None:
    """W = (K - sum F_k H_k)^-1 with H_k by finite differences of J, F by NumPy's pinv."""
    U = stiff(3)
    K, target = np.diag(np.linspace(1.0, 2.0, 3)), np.linspace(0.1, 0.6, 3)
    for force in ("pseudo-inverse", "stiffness"):
        G = hk.strategies.impedance(task, U, force=force)
        for q in START + np.random.default_rng(3).uniform(-0.3, 0.3, (5, 3)):
            J, h = task.jacobian(q), 1e-6
            slope, Ki = K @ (q - target), np.linalg.inv(K)
            F = (
                np.linalg.pinv(J).T @ slope
                if force == "pseudo-inverse"
                else np.linalg.solve(J @ Ki @ J.T, J @ Ki @ slope)
            )
            dJ = np.stack([(task.jacobian(q + e) - task.jacobian(q - e)) / (2 * h) for e in np.eye(3) * h], axis=2)
            W = np.linalg.inv(K - np.einsum("k,kij->ij", F, dJ))
            assert np.abs(W @ J.T @ np.linalg.inv(J @ W @ J.T) - G(q)).max() < 1e-8


def test_impedance_of_one_redundant_joint_is_baillieuls_extended_jacobian(task: hk.Task) -> None:
    """Variants (i) and (ii) agree everywhere for r = 1, where g = n^T grad U / |n|: springs, not gradients, say so."""
    G, leaf = hk.strategies.impedance(task, stiff(3)), hk.holonomic(task, hk.stationary(stiff(3)))
    for q in START + np.random.default_rng(4).uniform(-0.3, 0.3, (10, 3)):
        assert np.abs(G(q) - leaf(q)).max() < 1e-12


def test_impedance_of_two_redundant_joints_is_baillieuls_at_equilibrium_only() -> None:
    """Where N^T grad U = 0, and nowhere else."""
    task, U, target = hk.position(planar(4)), stiff(4), np.linspace(0.1, 0.6, 4)
    G, leaf = hk.strategies.impedance(task, U), hk.holonomic(task, hk.stationary(U, free=("q3", "q4")))
    q = np.linspace(0.3, 0.8, 4)
    x = task(q)
    held = {"type": "eq", "fun": lambda p: task(p) - x}
    energy = lambda p: 0.5 * np.linspace(1.0, 2.0, 4) @ (p - target) ** 2  # noqa: E731
    found = minimize(energy, q, constraints=held, method="SLSQP", options={"ftol": 1e-16, "maxiter": 500}).x
    assert np.abs(leaf.constraint_value(found)).max() < 1e-6
    assert np.abs(G(found) - leaf(found)).max() < 1e-5
    assert np.abs(G(q) - leaf(q)).max() > 1e-3


@pytest.mark.parametrize(("n", "holonomic"), [(3, True), (4, False), (5, False)])
def test_impedance_with_the_force_from_the_posture_is_holonomic_for_one_redundant_joint_only(
    n: int, holonomic: bool
) -> None:
    """Variant (ii), theory 2d."""
    task = hk.position(planar(n))
    region = hk.around(np.linspace(0.3, 0.8, n), 0.2)
    verdict = hk.involutivity(hk.strategies.impedance(task, stiff(n)), region)
    assert verdict.holonomic is holonomic
    assert verdict.relative < 1e-12 or verdict.relative > 1e-3


def test_impedance_with_memory_comes_home_from_any_start(task: hk.Task, loop: hk.Path) -> None:
    """Variant (iii): repeatable, whatever force the run begins with; but the leaf depends on it."""
    ends = []
    for force in (None, [0.3, -0.2]):
        law = hk.motion.control.impedance_with_memory(task, stiff(3), force)
        assert closure(law, task, loop, 1 / 200, cycles=2) < 1e-9
        ends.append(hk.simulate(law, task, loop.part(0, 0.5), START, dt=1 / 200).q[-1])
    assert np.abs(ends[0] - ends[1]).max() > 1e-4


def test_impedance_with_memory_solves_its_own_equations(task: hk.Task, loop: hk.Path) -> None:
    """q' = W J^T M x', F' = M x', M = (J W J^T)^-1, by another integrator and finite-difference Hessians."""
    K, h = np.diag(np.linspace(1.0, 2.0, 3)), 1e-6

    def flow(t: float, y: np.ndarray) -> np.ndarray:
        q, F = y[:3], y[3:]
        J = task.jacobian(q)
        dJ = np.stack([(task.jacobian(q + e) - task.jacobian(q - e)) / (2 * h) for e in np.eye(3) * h], axis=2)
        W = np.linalg.inv(K - np.einsum("k,kij->ij", F, dJ))
        dF = np.linalg.solve(J @ W @ J.T, loop.at(t).velocity[0, :2])
        return np.concatenate([W @ J.T @ dF, dF])

    half = loop.duration / 2
    theirs = solve_ivp(flow, (0, half), np.concatenate([START, [0, 0]]), rtol=1e-10, atol=1e-12).y[:3, -1]
    ours = hk.simulate(
        hk.motion.control.impedance_with_memory(task, stiff(3)), task, loop.part(0, 0.5), START, dt=1 / 400
    ).q[-1]
    assert np.abs(ours - theirs).max() < 1e-5


# --- bad laws ---


def test_a_law_that_fails_is_told_from_and_nothing_is_lost(task: hk.Task, loop: hk.Path) -> None:
    calls = []

    def after(count: int, what):
        calls.clear()

        def law(q, pose, twist, dt):
            calls.append(1)
            return what() if len(calls) > count else np.zeros(3)

        return law

    def throws():
        raise RuntimeError("no solution")

    for what, said in (
        (throws, "threw RuntimeError: no solution"),
        (lambda: np.full(3, np.nan), "NaN"),
        (lambda: np.zeros(2), "shape"),
        (lambda: "fast", "str"),
        (lambda: None, "shape"),
    ):
        with pytest.raises(ControllerError, match=said) as caught:
            hk.simulate(after(7, what), task, loop, START, dt=0.02)
        assert caught.value.trajectory.status is Status.FAULT
        assert len(caught.value.trajectory) == 8


def test_a_law_that_blocks_is_left_behind(task: hk.Task, loop: hk.Path) -> None:
    def sleeper(q, pose, twist, dt):
        time.sleep(30 if pose[1, 3] < 2.1 else 0)
        return np.zeros(3)

    began = time.monotonic()
    with pytest.raises(ControllerError, match="did not return within"):
        hk.simulate(sleeper, task, loop, START, dt=0.02, patience=0.3)
    assert time.monotonic() - began < 10


def test_what_is_no_law_or_run_is_refused(task: hk.Task, loop: hk.Path, planar_3r: hk.Robot) -> None:
    with pytest.raises(ArgumentError, match="the control law"):
        as_control_law(3)
    law = hk.motion.control.closed_loop(hk.moore_penrose(task))
    for arguments, error in (
        ({"dt": 0.0}, ArgumentError),
        ({"dt": np.nan}, ArgumentError),
        ({"cycles": 0}, ArgumentError),
        ({"cycles": 2.0}, ArgumentError),
        ({"cycles": True}, ArgumentError),
        ({"dt": 1e-300}, ArgumentError),
        ({"control_law": None}, ArgumentError),
        ({"q0": START + 0.1}, StartError),
        ({"q0": START[:2]}, ShapeError),
        ({"path": loop.part(0, 0.3), "cycles": 2}, OpenPathError),
    ):
        with pytest.raises(error):
            hk.simulate(**({"control_law": law, "task": task, "path": loop, "q0": START} | arguments))
    twist, springs = hk.pose(hk.load("panda")), hk.strategies.constraints.posture_cost(PANDA_START)
    for make, error, said in (
        (lambda: hk.motion.control.damped(task, -1.0), ArgumentError, "-1.0"),
        (lambda: hk.motion.control.closed_loop(hk.moore_penrose(task), np.nan), ArgumentError, "nan"),
        (lambda: hk.motion.control.asymptotically_cyclic(task, hk.lock(0), [1.0, 2.0]), ShapeError, r"\(1,\)"),
        (lambda: hk.motion.control.impedance_with_memory(twist, springs), ArgumentError, "coordinates"),
        (lambda: hk.strategies.impedance(twist, springs), ArgumentError, "coordinates"),
        (lambda: hk.motion.control.impedance_with_memory(task, stiff(3), [1.0]), ShapeError, r"\(2,\)"),
        (lambda: hk.strategies.impedance(task, stiff(3), force="brute"), UnknownNameError, "brute"),
    ):
        with pytest.raises(error, match=said):
            make()


def test_a_watch_knows_a_share_of_the_motion_from_all_of_it() -> None:
    for share in (1.0, 0.3):
        watch, q, rng = LoopWatch(0.01), np.zeros(3), np.random.default_rng(0)
        for _ in range(500):
            dq = rng.uniform(-1, 1, 3)
            watch.see(q + 1e-5 * rng.standard_normal(3), dq)
            q = q + share * 0.01 * dq
        assert watch.share == pytest.approx(share, abs=0.01)
        assert watch.starved == (share < 0.5)
    assert not LoopWatch(0.01).starved
    with pytest.raises(ArgumentError, match="dt"):
        LoopWatch(0.0)
