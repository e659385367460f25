"""The pieces that numbers and expressions share: null spaces, the Runge-Kutta step, the wrapping of angles."""

from __future__ import annotations

import numpy as np
import pytest

from holokin.symbolic import SX, Function, runge_kutta, symbol, vertcat, wrapped
from holokin.symbolic.linear import minors, null_space, null_space_expression, null_vector, null_vector_expression


@pytest.mark.parametrize(("m", "n"), [(2, 3), (6, 7), (3, 6), (2, 2)])
def test_null_spaces_of_numbers_and_expressions_are_one_plane(m: int, n: int) -> None:
    s = symbol("J", m, n)
    written = Function("N", {"J": s}, {"N": null_space_expression(s)}) if n > m else None
    for J in np.random.default_rng(0).normal(size=(5, m, n)):
        N = null_space(J)
        assert N.shape == (n, n - m)
        assert np.abs(J @ N).max(initial=0.0) < 1e-14
        assert pytest.approx(np.eye(n - m), abs=1e-14) == N.T @ N
        if written is not None:
            other = np.reshape(written(J), (n, n - m))
            assert pytest.approx(N @ N.T, abs=1e-14) == other @ other.T
    stacked = np.random.default_rng(0).normal(size=(4, m, n))
    assert np.array_equal(null_space(stacked), np.array([null_space(J) for J in stacked]))


def test_the_null_vector_has_one_side_and_the_minors_vanish_with_the_rank() -> None:
    s = symbol("J", 2, 3)
    written = Function("n", {"J": s}, {"n": null_vector_expression(s)})
    for J in np.random.default_rng(0).normal(size=(5, 2, 3)):
        normal = np.cross(*J)
        assert minors(J) == pytest.approx(normal, abs=1e-14)
        assert null_vector(J) == pytest.approx(normal / np.linalg.norm(normal), abs=1e-14)
        assert written(J) == pytest.approx(normal / np.linalg.norm(normal), abs=1e-14)
        assert null_vector(J, -normal) == pytest.approx(-normal / np.linalg.norm(normal), abs=1e-14)
    assert np.abs(minors(np.array([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]]))).max() < 1e-7


def test_a_runge_kutta_step_is_of_order_four_for_numbers_and_the_same_in_expressions() -> None:
    """y' = (y_2, -y_1) u, u(t) = 1 + t from 0 to h: y turns by h + h^2 / 2."""

    def error(h: float) -> float:
        y = runge_kutta(lambda y, u: np.array([y[1], -y[0]]) * u, np.array([0.3, 0.8]), h, 1.0, 1 + h / 2, 1 + h)
        a = h + h * h / 2
        return float(np.abs(y - [0.3 * np.cos(a) + 0.8 * np.sin(a), 0.8 * np.cos(a) - 0.3 * np.sin(a)]).max())

    assert error(0.02) / error(0.01) == pytest.approx(32, rel=0.1)  # of one step: h^5
    s = symbol("y", 2)
    step = runge_kutta(lambda y, u: vertcat(y[1], -y[0]) * u, s, 0.1, SX(1), SX(1.05), SX(1.1))
    numbers = runge_kutta(lambda y, u: np.array([y[1], -y[0]]) * u, np.array([0.3, 0.8]), 0.1, 1, 1.05, 1.1)
    assert Function("step", {"y": s}, {"y": step})([0.3, 0.8]) == pytest.approx(numbers, abs=1e-16)


def test_angles_are_wrapped_alike_in_numbers_and_expressions() -> None:
    angles = np.array([0.0, 0.3, np.pi - 1e-9, np.pi + 1e-9, -4.0, 7.0, 100.0])
    s = symbol("a", len(angles))
    numbers = wrapped(angles)
    assert numbers[0] == 0.0 and np.abs(numbers).max() <= np.pi
    assert np.abs(np.round((angles - numbers) / (2 * np.pi)) * 2 * np.pi - (angles - numbers)).max() < 1e-13
    assert Function("w", {"a": s}, {"w": wrapped(s)})(angles) == pytest.approx(numbers, abs=1e-15)
