"""Laws that are Python functions are judged as the same laws given by formulas, to the accuracy that is said."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import holokin as hk
from conftest import PANDA_START, fails
from holokin.analysis.curvature import Evidence, measured_curvature
from holokin.analysis.curvature.curvature_of_planes import noise_of, slope
from holokin.analysis.curvature.involutive import SURE
from holokin.base.errors import (
    ArgumentError,
    HolokinError,
    NotFiniteError,
    OwnFunctionError,
    ShapeError,
    SingularityError,
    UndecidedError,
)
from holokin.strategies import NumericStrategy, numeric

PLANAR_START = np.array([0.3, 0.8, -0.4])
ROBOTS = {
    "planar-3r": PLANAR_START, "panda": np.array(PANDA_START), "ppr": np.array([0.4, 0.3, 0.7]),
    "irb140": np.array([0.2, 0.3, -0.2, 0.4, 0.7, 0.3]),
}  # fmt: skip
ROUNDINGS: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "double": lambda G, q: G,
    "single": lambda G, q: G.astype(np.float32),
    "noisy": lambda G, q: G + 1e-8 * np.sin(1e9 * q.sum() + np.arange(G.size).reshape(G.shape)),
}


@cache
def laws(name: str) -> dict[str, tuple[hk.Strategy, Callable[[np.ndarray], np.ndarray]]]:
    """Laws of a robot by holokin's formula, and by NumPy's own algebra."""
    robot = hk.load(name)
    task = hk.pose(robot) if name == "panda" else hk.position(robot)
    n, m = task.n, task.m
    weight = np.diag(1.0 + np.arange(n) / n)
    rows = np.eye(n)[m:] + 0.3 * np.eye(n)[: n - m]
    still = hk.strategies.constraints.stack(*(hk.linear(row) for row in rows))

    def weighted(q: np.ndarray) -> np.ndarray:
        J, W = task.jacobian(q), np.linalg.inv(weight)
        return W @ J.T @ np.linalg.inv(J @ W @ J.T)

    def held(q: np.ndarray) -> np.ndarray:
        return np.linalg.inv(np.vstack([task.jacobian(q), rows]))[:, :m]

    return {
        "pseudo-inverse": (hk.moore_penrose(task), lambda q: np.linalg.pinv(task.jacobian(q))),
        "weighted": (hk.weighted(task, weight), weighted),
        "holonomic": (hk.holonomic(task, still), held),
    }


@given(
    st.sampled_from(sorted(ROBOTS)), st.sampled_from(["pseudo-inverse", "weighted", "holonomic"]),
    st.sampled_from(sorted(ROUNDINGS)), st.integers(0, 10_000),
)  # fmt: skip
def test_the_curvature_of_a_function_is_that_of_its_formula_to_the_error_that_is_said(
    robot: str, law: str, rounding: str, seed: int
) -> None:
    by_formula, by_numpy = laws(robot)[law]
    q = ROBOTS[robot] + 0.2 * np.random.default_rng(seed).uniform(-1, 1, len(ROBOTS[robot]))
    given = numeric(by_formula.task, lambda q: ROUNDINGS[rounding](by_numpy(q), q), q0=q, accuracy=1e-4)
    found, known = measured_curvature(given, q), hk.curvature(by_formula, q)
    assert (np.linalg.norm(found.F - known, axis=0) <= SURE * found.error + 1e-15).all()
    assert found.error.max() < {"double": 1e-7, "single": 0.1, "noisy": 0.01}[rounding]  # so that it says something
    np.testing.assert_array_equal(hk.curvature(given, q), found.F)


@pytest.mark.parametrize("rounding", ROUNDINGS)
@pytest.mark.parametrize("law", ["pseudo-inverse", "holonomic"])
def test_the_verdict_of_a_function_is_that_of_its_formula(law: str, rounding: str) -> None:
    by_formula, by_numpy = laws("planar-3r")[law]
    region = hk.around(PLANAR_START, 0.2)
    known = hk.involutivity(by_formula, region, samples=16)
    given = numeric(by_formula.task, lambda q: ROUNDINGS[rounding](by_numpy(q), q), q0=PLANAR_START, accuracy=1e-4)
    found = hk.involutivity(given, region, samples=16)
    assert found.holonomic is known.holonomic and found.evidence is Evidence.DIFFERENCES
    assert found.accuracy is not None and known.accuracy is None
    assert found.relative == pytest.approx(known.relative, abs=found.accuracy.error)
    assert ("known to" in found.details) and (found.samples, found.singular, found.undecided) == (16, 0, 0)
    if rounding == "double":
        assert found.accuracy.error < 1e-9 and found.tolerance < 1e-8


def test_position_and_turn_coupled_by_lambda_has_the_curvature_of_theory_e3() -> None:
    """(J_w + lambda J_p)[G_i, G_j] = -lambda^2 eps_ijk e_k, whatever the arm."""
    robot, gain = hk.load("irb140"), 0.7
    task = hk.position(robot)

    def G(q: np.ndarray) -> np.ndarray:
        J = robot.jacobian(q)
        return np.linalg.inv(np.vstack([J[:3], J[3:] + gain * J[:3]]))[:, :3]

    q = ROBOTS["irb140"]
    given = numeric(task, G, q0=q)
    found = measured_curvature(given, q)
    J = robot.jacobian(q)
    eps = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        eps[k, i, j], eps[k, j, i] = 1.0, -1.0
    np.testing.assert_allclose(np.tensordot(J[3:] + gain * J[:3], found.F, 1), -(gain**2) * eps, atol=1e-8)
    assert not hk.involutivity(given, hk.around(q, 0.1), samples=4).holonomic


@given(st.floats(0.2, 8.0), st.floats(-3, 3), st.sampled_from([0.0, 1e-12, 1e-8, 1e-5]), st.integers(0, 10_000))
def test_the_slope_of_a_wave_is_within_its_error_whatever_its_length_and_noise(
    rate: float, place: float, noise: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    f = lambda q: np.array([[np.sin(rate * q[0]), np.exp(q[0])]]) + noise * rng.standard_normal((1, 2))  # noqa: E731
    q, direction = np.array([place]), np.array([1.0])
    found = slope(f, q, direction, noise_of(f, q, direction))
    true = np.array([rate * np.cos(rate * place), np.exp(place)])
    assert (np.abs(found.value[0] - true) <= 3.0 * found.error).all()
    assert found.error.max() < 1e-9 + 1e3 * noise * (1 + rate)


def test_a_curvature_below_what_the_noise_hides_is_not_called_zero() -> None:
    """Either the posture is undecided, or what counts as zero is said to be larger."""
    robot = hk.load("planar-3r")
    task, region = hk.position(robot), hk.around(PLANAR_START, 0.2)
    weak = hk.strategies.pfaffian(task, lambda q: [[1e-4 * q[1], 0, 1]])
    strength = hk.involutivity(weak, region, samples=8).relative
    for noise in (1e-12, 1e-8, 1e-6, 1e-4):
        rng = np.random.default_rng(0)
        noisy = lambda q, noise=noise, rng=rng: weak(q) + noise * rng.standard_normal((3, 2))  # noqa: E731
        try:
            verdict = hk.involutivity(NumericStrategy("noisy", task, noisy, 0.1), region, samples=8)
        except UndecidedError as problem:
            assert noise >= 1e-6 and "could hide" in str(problem)
            continue
        assert not verdict.holonomic or (noise > 1e-11 and verdict.tolerance > strength / 10)


def test_follow_and_drift_take_a_function_and_find_what_they_find_of_its_formula() -> None:
    by_formula, by_numpy = laws("planar-3r")["pseudo-inverse"]
    robot, task = by_formula.task.robot, by_formula.task
    given = numeric(task, by_numpy)
    tool = robot.pose(PLANAR_START)[:3, 3]
    loop = hk.circle(tool, tool - [0.1, 0, 0])
    for verb in (
        lambda G: hk.drift(G, loop, PLANAR_START, cycles=2, samples=60).since_start,
        lambda G: hk.follow(G, loop, PLANAR_START, samples=60).dq,
        lambda G: hk.motion.path_spread(G, *loop.halves(), PLANAR_START, samples=40).difference,
        lambda G: hk.simulate(G, task, loop, PLANAR_START, dt=0.05).q,
        lambda G: G.batch(np.array([PLANAR_START, PLANAR_START + 0.1])),
    ):
        np.testing.assert_allclose(verb(given), verb(by_formula), atol=1e-9)


@pytest.mark.campaign
def test_an_audit_of_a_function_finds_what_it_finds_of_its_formula() -> None:
    by_formula, by_numpy = laws("planar-3r")["pseudo-inverse"]
    task = by_formula.task
    given = numeric(task, by_numpy)
    known, found = (hk.audit(G, task, q0=PLANAR_START, dt=0.1, cycles=3) for G in (by_formula, given))
    assert found.verdict is known.verdict
    assert found["cycles, loop 1"].metrics == pytest.approx(known["cycles, loop 1"].metrics, abs=1e-6)


def test_what_is_no_right_inverse_or_no_function_of_q_is_refused_with_the_number() -> None:
    task = hk.position(hk.load("planar-3r"))
    J = task.jacobian
    rng, calls = np.random.default_rng(0), []

    def damped(q: np.ndarray) -> np.ndarray:
        return J(q).T @ np.linalg.inv(J(q) @ J(q).T + 0.01 * np.eye(2))

    def random(q: np.ndarray) -> np.ndarray:
        return np.linalg.pinv(J(q)) + task.null_space(q) @ rng.standard_normal((1, 2))

    def remembers(q: np.ndarray) -> np.ndarray:
        calls.append(q)
        return np.linalg.pinv(J(q)) + 1e-3 * len(calls) * task.null_space(q) @ np.ones((1, 2))

    with pytest.raises(ArgumentError, match=r"\|J G - 1\| .* is 0\.\d+; give a right inverse, without damping"):
        numeric(task, damped)
    for law in (random, remembers):
        fails(ArgumentError, r"called at one posture again is \d", lambda: numeric(task, law))
    fails(OwnFunctionError, "raised ZeroDivisionError: division by zero at q =", lambda: numeric(task, lambda q: 1 / 0))
    fails(NotFiniteError, "", lambda: numeric(task, lambda q: np.full((3, 2), np.nan)))
    for bad in (np.ones(3), np.ones((2, 3)), 1.0, []):
        fails(ShapeError, r"expected \(3, 2\)", lambda: numeric(task, lambda q, bad=bad: bad))
    for bad in (None, "G", [[1, 2], [3]], object()):
        fails(ArgumentError, "give numbers", lambda: numeric(task, lambda q, bad=bad: bad))
    for more in ({"accuracy": 0}, {"accuracy": "x"}, {"q0": [1]}, {"q0": [np.nan] * 3}, {"name": 3}):
        with pytest.raises(HolokinError):
            numeric(task, lambda q: np.linalg.pinv(J(q)), **more)  # type: ignore[arg-type]


def test_a_function_cannot_spoil_the_posture_and_its_array_may_be_used_again() -> None:
    task = hk.position(hk.load("planar-3r"))
    place = np.empty((3, 2))

    def law(q: np.ndarray) -> np.ndarray:
        place[...] = np.linalg.pinv(task.jacobian(q))
        q[:] = 7.0
        return place

    given, q = numeric(task, law), PLANAR_START.copy()
    first = given(q)
    given(q + 0.3)
    np.testing.assert_allclose(first, np.linalg.pinv(task.jacobian(PLANAR_START)), atol=1e-14)
    np.testing.assert_array_equal(q, PLANAR_START)


def test_postures_where_a_function_is_not_defined_are_left_out_and_counted() -> None:
    task = hk.position(hk.load("planar-3r"))

    def law(q: np.ndarray) -> np.ndarray:
        if q[0] > 0.35:
            raise RuntimeError("no solution here")
        return np.linalg.pinv(task.jacobian(q))

    given = numeric(task, law)
    verdict = hk.involutivity(given, hk.around(PLANAR_START, 0.2), samples=24)
    assert not verdict.holonomic and 0 < verdict.singular < 24
    with pytest.raises(UndecidedError, match="no solution here"):
        hk.involutivity(given, hk.around(PLANAR_START + [0.5, 0, 0], 0.1), samples=4)
    fails(OwnFunctionError, "", lambda: hk.curvature(given, PLANAR_START + 0.5))
    with pytest.raises(SingularityError):  # of the user's own call of holokin: it passes as it is
        inner = hk.moore_penrose(task)
        numeric(task, lambda q: inner(q))([0.0, 0.0, 0.0])


def test_what_needs_a_formula_says_so() -> None:
    task = hk.position(hk.load("planar-3r"))
    given = numeric(task, lambda q: np.linalg.pinv(task.jacobian(q)))
    for asked in (
        lambda: hk.controller(given, dt=0.01, q0=PLANAR_START), lambda: hk.radial(given, PLANAR_START),
        lambda: hk.curvature(given, PLANAR_START, method="ad"), lambda: given.expressions,
        lambda: hk.analysis.curvature.filtration(given, PLANAR_START),
        lambda: hk.export.export_c(given, "folder", q0=PLANAR_START),
    ):  # fmt: skip
        fails(ArgumentError, "a Python function", lambda: asked())
    fails(ArgumentError, "say how many", lambda: hk.involutivity(given, hk.around(PLANAR_START, 0.1), thorough=True))
    fails(ArgumentError, "a strategy with leaves", lambda: hk.ik(given, PLANAR_START))
