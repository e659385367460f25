"""How the error of a drift forecast falls with the size of the loop: measured, against closed form and integration."""

from __future__ import annotations

import numpy as np
import pytest

import holokin as hk
from conftest import IIWA_START, PANDA_START, PPR_CENTER, sampled

SIZES = (0.08, 0.04, 0.02, 0.01)


def shares(given: hk.Strategy, start: np.ndarray, loops: list[hk.Path]) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors (k,) of the forecast, and of area times curvature at the centre, not carried to the start."""
    out = []
    for loop in loops:
        drift = hk.drift(given, loop, start, samples=300).since_start[0]
        told = hk.analysis.curvature.predicted_drift(given, loop, start)
        plain = np.einsum("ij,aij->a", told.area, told.curvature) / 2
        out.append([np.abs(one - drift).max() / np.abs(drift).max() for one in (told.drift, plain)])
    return np.array(out).T


@sampled(1, ("name", "start", "largest"), [("panda", PANDA_START, 0.02), ("iiwa14", IIWA_START, 0.04)])
def test_the_error_of_a_forecast_falls_with_the_second_power_of_the_circle(
    name: str, start: np.ndarray, largest: float
) -> None:
    """On the Panda 1.4, 0.33, 0.08, 0.02 %; area times curvature at the centre alone 16, 7.9, 3.9, 1.9 %, the first."""
    robot = hk.load(name)
    point = robot.pose(start)[:3, 3]
    loops = [hk.circle(point, point - [size, 0, 0]) for size in SIZES]
    carried, plain = shares(hk.moore_penrose(hk.pose(robot)), start, loops)
    assert carried[0] < largest
    assert carried[:-1] / carried[1:] == pytest.approx(4 * np.ones(3), rel=0.25)
    assert plain[:-1] / plain[1:] == pytest.approx(2 * np.ones(3), rel=0.25)


def test_the_error_falls_with_the_second_power_whatever_the_plane_loop(panda: hk.Robot) -> None:
    """A triangle, whose centre of area is neither its mean in time nor the middle of its box; and it is tilted."""
    point = panda.pose(PANDA_START)[:3, 3]
    corners = np.array([[0, 0, 0], [2, 0, 0.5], [0.3, 0.8, 0], [0, 0, 0]])
    given = hk.moore_penrose(hk.pose(panda))
    carried, plain = shares(given, PANDA_START, [hk.polyline(point + size * corners) for size in SIZES[:3]])
    assert carried[:-1] / carried[1:] == pytest.approx(4 * np.ones(2), rel=0.4)
    assert plain[:-1] / plain[1:] == pytest.approx(2 * np.ones(2), rel=0.3)
    told = hk.analysis.curvature.predicted_drift(given, hk.polyline(point + 0.01 * corners), PANDA_START)
    middle = panda.pose(told.center)[:3, 3] - point
    assert middle == pytest.approx(0.01 * corners[:3].mean(axis=0), abs=1e-8)


def test_loops_out_of_one_plane_fall_with_the_first_power_at_least(panda: hk.Robot) -> None:
    """Two squares in planes at right angles, apart: no one centre is that of both."""
    point = panda.pose(PANDA_START)[:3, 3]
    flat = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]])
    away = np.array([2.0, 0, 0])
    upright = away + flat[:, [2, 0, 1]]
    corners = np.vstack([flat, upright, [[0, 0, 0]]])
    given = hk.moore_penrose(hk.pose(panda))
    carried, _ = shares(given, PANDA_START, [hk.polyline(point + size * corners) for size in SIZES[1:]])
    assert (carried[:-1] / carried[1:] > 1.8).all()


def turned_on_ppr(radius: float, phase: float, q3: float) -> float:
    """Drift of q3 [rad] over one counter-clockwise circle: psi' = k cos psi - 1, k = r/2, in closed form (theory 4)."""
    k = radius / 2
    a, w = np.sqrt((1 - k) / (1 + k)), np.sqrt(1 - k**2)
    C = np.arctan(-np.tan((q3 - phase) / 2) / a)  # tan(psi/2) = -a tan(w theta/2 + C)
    turned = w * np.pi + C
    folded = np.arctan2(a * np.sin(turned), np.cos(turned))
    after = -2 * (folded + 2 * np.pi * np.round((turned - folded) / (2 * np.pi)))
    return after + 2 * np.pi + 2 * np.arctan2(a * np.sin(C), np.cos(C))


def test_the_forecast_on_ppr_nears_the_planimeters_closed_form() -> None:
    """The worst of twelve starts round the circle falls with the second power of the radius."""
    given, errors = hk.moore_penrose(hk.position(hk.load("ppr"))), []
    for radius in (0.1, 0.05, 0.025):
        worst = 0.0
        for phase in np.arange(12) * np.pi / 6:
            point = PPR_CENTER + radius * np.array([np.cos(phase), np.sin(phase), 0])
            start = np.array([point[0] - np.cos(0.5), point[1] - np.sin(0.5), 0.5])
            told = hk.analysis.curvature.predicted_drift(given, hk.circle(point, PPR_CENTER), start).drift[2]
            worst = max(worst, abs(told / turned_on_ppr(radius, phase, 0.5) - 1))
        errors.append(worst)
    assert errors[0] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.1)
