"""All holonomic strategies: transports (T14), fitted twins."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import holokin as hk
from conftest import PANDA_START
from holokin.analysis.curvature.leaf_functions import ball_postures
from holokin.base.errors import ArgumentError, ShapeError
from papers_arm import de_luca_frame, paper_frame


@pytest.fixture(scope="module")
def panda_given(panda: hk.Robot) -> hk.Strategy:
    return hk.moore_penrose(hk.pose(panda))


# --- the complete family ---


def ppr_inverse(x: ca.SX, z: ca.SX) -> list:
    return [x[0] - ca.cos(z), x[1] - ca.sin(z), z]


@given(st.lists(st.floats(-1, 1), min_size=6, max_size=6))
def test_every_transport_is_holonomic_and_is_its_own_closed_form_T14(c: list[float]) -> None:
    """G = K_x + K_z dPhi/dx at z0, by finite differences of q = K(x, Phi(x, z0))."""
    task = hk.position(hk.load("ppr"))

    def phi(x, z):
        return (
            z
            + (c[0] * x[0] + c[1] * x[1] + c[2] * x[0] * x[1]) * (1 + 0.3 * c[3] * ca.sin(z))
            + 0.2 * c[4] * (ca.cos(c[5] * x[0]) - 1)
        )

    strategy = hk.strategies.from_transport(task, ppr_inverse, phi, lambda q: q[2], around=[0.1, 0.2, 0.3], steps=6)
    assert hk.involutivity(strategy, hk.around([0.1, 0.2, 0.3], 0.2), samples=8).relative < 1e-11
    q, h = np.array([0.15, 0.1, 0.35]), 1e-6
    z0 = strategy.constraint_value(q)

    def leaf(x: np.ndarray) -> np.ndarray:
        z = float(phi(x, z0))
        return np.array([x[0] - np.cos(z), x[1] - np.sin(z), z])

    x = task(q)
    assert np.abs(leaf(x) - q).max() < 1e-9
    slopes = np.column_stack([(leaf(x + e) - leaf(x - e)) / (2 * h) for e in np.eye(2) * h])
    assert np.abs(strategy(q) - slopes).max() < 1e-7


def test_the_papers_two_strategies_are_members_of_the_family(ppr: hk.Robot) -> None:
    """Phi = 2 atan(tan(z0/2) e^-x) gives (22), Phi = z0 + x + y gives (23); with and without its inverse given."""
    task = hk.position(ppr)
    members = [
        (
            paper_frame,
            lambda x, z: 2 * ca.atan(ca.tan(z / 2) * ca.exp(-x[0])),
            lambda x, z: 2 * ca.atan(ca.tan(z / 2) * ca.exp(x[0])),
        ),
        (de_luca_frame, lambda x, z: z + x[0] + x[1], lambda x, z: z - x[0] - x[1]),
    ]
    near = np.array([-0.7, -0.6, 0.8])
    for frame, phi, inverse in members:
        paper = hk.null_basis(task, frame)
        for closed in (inverse, None):
            member = hk.strategies.from_transport(task, ppr_inverse, phi, lambda q: q[2], around=near, inverse=closed)
            for q in near + np.random.default_rng(5).uniform(-0.2, 0.2, (5, 3)):
                assert np.abs(member(q) - paper(q)).max() < 1e-8


def test_a_transport_that_does_not_fit_is_refused_with_what_fails(ppr: hk.Robot) -> None:
    task = hk.position(ppr)
    near = [0.1, 0.2, 0.3]
    wrong = [
        (lambda x, z: [x[0], x[1], z], lambda x, z: z, {}, "f(K"),
        (ppr_inverse, lambda x, z: z + 1, {}, "Phi(x0"),
        (ppr_inverse, lambda x, z: z + x[0], {"inverse": lambda x, z: z + x[0]}, "label"),
        (ppr_inverse, lambda x, z: z + x[0], {"z": lambda q: q[2] / 2}, "z(K"),
    ]
    for K, phi, more, said in wrong:
        arguments = {"z": lambda q: q[2]} | more
        with pytest.raises(ArgumentError) as caught:
            hk.strategies.from_transport(task, K, phi, **arguments, around=near)
        assert said in str(caught.value)
    with pytest.raises(ShapeError):
        hk.strategies.from_transport(task, lambda x, z: [x[0], x[1]], lambda x, z: z, lambda q: q[2], around=near)


# --- fit ---


@pytest.mark.campaign
def test_a_fitted_twin_is_exactly_holonomic_and_nears_the_twin_with_its_degree(panda_given: hk.Strategy) -> None:
    twin = hk.radial(panda_given, PANDA_START)
    Q = ball_postures(panda_given, hk.analysis.curvature.ball(PANDA_START, 0.1, along=0.2), 120)
    other = ball_postures(panda_given, hk.analysis.curvature.ball(PANDA_START, 0.09, along=0.15), 60, seed=5)
    away = []
    for degree in (2, 4):
        fit = hk.strategies.fitted(twin, Q, degree=degree, rows=(0, 1, 2))
        away.append(hk.analysis.curvature.deviation(twin, fit, other, columns=3).rms)
        assert hk.involutivity(fit, hk.around(PANDA_START, 0.1), samples=8).relative < 1e-11
    assert away[0] < 0.03
    assert away[1] < 0.002
    point = panda_given.task.robot.pose(PANDA_START)[:3, 3]
    loop = hk.circle(point, point - [0.05, 0, 0])
    assert hk.drift(fit, loop, PANDA_START, cycles=3, samples=40).largest.max() < 1e-12
    assert fit.rate.program.operations * 20 < twin.rate.program.operations


def test_a_twin_is_fitted_also_where_its_label_wraps() -> None:
    """Half way round the self-motion the label, an angle, jumps from pi to -pi; its leaves do not."""
    given = hk.moore_penrose(hk.position(hk.load("ppr")))
    start = np.array([0.5, -0.3, 0.8])
    twin = hk.radial(given, start)
    z = start[2] + np.pi
    half_way = np.array([start[0] + np.cos(0.8) - np.cos(z), start[1] + np.sin(0.8) - np.sin(z), z])
    Q = half_way + np.random.default_rng(4).uniform(-0.2, 0.2, (80, 3))
    labels = twin.constraint_value.batch(Q)
    assert labels.min() < -3
    assert labels.max() > 3
    fit = hk.strategies.fitted(twin, Q)
    assert hk.analysis.curvature.deviation(twin, fit, Q).largest < 1e-3


def test_a_fit_is_refused_what_cannot_determine_it(panda_given: hk.Strategy) -> None:
    twin = hk.holonomic(panda_given.task, hk.arm_angle())
    Q = PANDA_START + np.random.default_rng(0).uniform(-0.1, 0.1, (8, 7))
    for arguments, error in (
        ((panda_given, Q), ArgumentError),
        ((twin, Q), ArgumentError),
        ((twin, Q[:, :3]), ShapeError),
    ):
        with pytest.raises(error):
            hk.strategies.fitted(*arguments)
    with pytest.raises(ArgumentError, match="degree"):
        hk.strategies.fitted(twin, Q, degree=0)
