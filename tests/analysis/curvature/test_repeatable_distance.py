"""The price of repeatability: a bound that no regular holonomic law beats, and what it does not say (T11)."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import holokin as hk
from conftest import IIWA_START, PANDA_START, PPR_CENTER, PPR_RADIUS, PPR_START, campaign, fails
from holokin.analysis import curvature
from holokin.base.errors import ArgumentError
from papers_arm import paper_frame

Z0 = 0.8
CENTER_START = np.array([PPR_CENTER[0] - np.cos(Z0), PPR_CENTER[1] - np.sin(Z0), Z0])
UNIT = np.sqrt(1.5) / np.sqrt(2)
"""|G| / |N| of the pseudo-inverse on the PPR arm: from shares of |G| to changes of the slope dq3/dx [rad/m]."""


@pytest.fixture(scope="module")
def ppr_given() -> hk.Strategy:
    return hk.moore_penrose(hk.position(hk.load("ppr")))


@pytest.fixture(scope="module")
def panda_given() -> hk.Strategy:
    return hk.moore_penrose(hk.pose(hk.load("panda")))


def test_the_bound_on_ppr_has_its_closed_form_T11(ppr_given: hk.Strategy) -> None:
    """Leaf of theory 5.3: the least of |dz/(rho dtheta) - cos(z - theta)/2| is 1/2 - (1 - e^{-R/2}) / R = 0.0471.

    First order: kappa R / (2 sqrt 2) = 0.035567; the twin's rms over all angles 0.035674 (rad/m).
    """
    found = curvature.distance_to_repeatable(
        ppr_given, curvature.ball(CENTER_START, PPR_RADIUS, along=np.pi * np.sqrt(2)), samples=600
    )
    assert found.bound * UNIT == pytest.approx(0.5 - (1 - np.exp(-PPR_RADIUS / 2)) / PPR_RADIUS, rel=1e-4)
    assert found.bound * UNIT == pytest.approx(0.0471, abs=1e-4)
    assert found.first_order * UNIT == pytest.approx(0.035567, rel=1e-4)
    assert found.radial.rms * UNIT == pytest.approx(0.035674, rel=0.05)  # a sample of the disc
    most = (np.exp(PPR_RADIUS / 2) - 1) / PPR_RADIUS - 0.5
    assert found.radial.largest * UNIT == pytest.approx(most, rel=1e-3)  # met on the circle, not inside it


def near_radial_laws(given: hk.Strategy, start: np.ndarray, times: int) -> list[hk.Strategy]:
    """Holonomic laws as near to the given one as we can make them: twins about other starts, tilted ones, others."""
    rng = np.random.default_rng(2)
    twin = hk.radial(given, start)
    out = [twin]
    for _ in range(times):
        out.append(hk.radial(given, start + 0.05 * rng.uniform(-1, 1, given.task.n)))
        a, B = 0.02 * rng.normal(size=2), 0.1 * rng.normal(size=(2, 2))
        center = given.task.robot.pose(start)[:2, 3]

        def rho(x: ca.SX, a=a, B=B, center=center) -> ca.SX:
            v = x[:2] - ca.DM(center)
            return ca.dot(ca.DM(a), v) + v.T @ ca.DM(B) @ v

        out.append(hk.holonomic(given.task, hk.strategies.constraints.tilted(twin.constraint, rho)))
    return out


@pytest.mark.parametrize(
    ("name", "times"), [("ppr", 1), *(campaign(("name", "times"), (name, 3)) for name in ("ppr", "panda"))]
)
def test_no_regular_law_beats_the_bound_and_the_twin_is_within_a_third_of_it(name: str, times: int) -> None:
    robot = hk.load(name)
    start, radius = (CENTER_START, PPR_RADIUS) if name == "ppr" else (PANDA_START, 0.1)
    given = hk.moore_penrose(hk.position(robot) if name == "ppr" else hk.pose(robot))
    found = curvature.distance_to_repeatable(given, curvature.ball(start, radius), samples=40)
    assert found.circle.shape == (found.points, robot.n)
    assert found.bound < found.radial.largest < 4 / 3 * found.bound
    for law in near_radial_laws(given, start, times):
        d = min(3, given.task.m)
        G, other = (strategy.batch(found.circle)[:, :, :d] for strategy in (given, law))
        away, size = (np.linalg.norm(A, axis=(1, 2)) for A in (other - G, G))
        assert (away / size).max() >= found.bound


def cut_law(given: hk.Strategy, sharpness: float) -> hk.Strategy:
    """A holonomic law on PPR as near to the pseudo-inverse on the leaf z(rho, theta) through the start as it likes, but
    in a thin sector: g = u(theta) + lambda (q3 - z), grad u = lambda (grad z - A) outside of it, u back to 0 inside.
    """

    def g(q: ca.SX) -> ca.SX:
        x, y = q[0] + ca.cos(q[2]) - PPR_CENTER[0], q[1] + ca.sin(q[2]) - PPR_CENTER[1]
        rho, phi = ca.sqrt(x**2 + y**2 + 1e-8), ca.atan2(y, x)
        half, t = (Z0 - phi) / 2, ca.exp(-rho / 2)
        z = phi + 2 * ca.atan2(ca.sin(half) * t, ca.cos(half))
        c, s = ca.cosh(rho / 2), ca.sinh(rho / 2)
        cos_a = ca.cos(Z0 - phi)
        tangential = ((c + s * cos_a - 1) / rho - (c * cos_a + s) / 2) / (c + s * cos_a)  # z_theta / rho - A_theta
        u = 2 * ca.atan2((1 + sharpness) * ca.sin(phi / 2), (1 - sharpness) * ca.cos(phi / 2)) - phi
        back = (1 - sharpness**2) / (1 + sharpness**2 - 2 * sharpness * ca.cos(phi))  # du/dphi + 1
        gap = ca.sin(q[2] - z)  # z as an angle
        return u + (1 + back**2) / (rho * ca.fabs(tangential)) * gap

    return hk.holonomic(given.task, hk.custom(g, name="law with a cut"))


@pytest.mark.campaign
def test_a_law_with_a_cut_has_less_rms_than_the_twin_but_not_less_at_most(ppr_given: hk.Strategy) -> None:
    """On one leaf no rms deviation but 0 is the least; what must fall back once on every loop is the maximum."""
    before = np.inf
    for sharpness in (0.9, 0.99, 0.999):
        law = cut_law(ppr_given, sharpness)
        found = curvature.distance_to_repeatable(ppr_given, curvature.ball(CENTER_START, PPR_RADIUS), law, samples=300)
        assert found.ours is not None
        assert found.ours.rms < before
        assert found.bound <= found.ours.largest
        before = found.ours.rms
    assert before < 0.5 * found.first_order
    assert hk.involutivity(law, hk.around(CENTER_START + 0.1, 0.02), samples=4).holonomic


def test_the_bound_is_what_a_direct_search_along_the_circle_finds() -> None:
    """iiwa14: the curve by an adaptive integrator, its tangent by finite differences, min |Gamma' - G e| / |G|."""
    from scipy.integrate import solve_ivp

    robot = hk.load("iiwa14")
    given = hk.moore_penrose(hk.pose(robot))
    found = curvature.distance_to_repeatable(given, curvature.ball(IIWA_START, 0.1), samples=10)
    center = robot.pose(IIWA_START)[:3, 3]
    spokes = np.array([robot.pose(q)[:3, 3] - center for q in found.circle])
    assert np.linalg.norm(spokes, axis=1) == pytest.approx(0.1, abs=1e-7)
    assert np.linalg.svd(spokes)[1][2] < 1e-6  # in one plane
    u, v = spokes[0] / 0.1, spokes[found.points // 4] / 0.1

    def at(angle: float) -> np.ndarray:
        out = np.pad(0.1 * (np.cos(angle) * u + np.sin(angle) * v), (0, 3))
        return solve_ivp(lambda _t, q: given(q) @ out, (0, 1), IIWA_START, "DOP853", rtol=1e-9, atol=1e-11).y[:, -1]

    shares = []
    for angle in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        h, q = 1e-3, at(angle)
        tangent = (at(angle + h) - at(angle - h)) / (2 * h * 0.1)
        e = np.pad(-np.sin(angle) * u + np.cos(angle) * v, (0, 3))
        shares.append(np.linalg.norm(tangent - given(q) @ e) / np.linalg.norm(given(q)[:, :3]))
    assert found.bound == pytest.approx(min(shares), rel=0.01)


def test_a_price_says_of_what_set_and_norm_it_speaks(panda_given: hk.Strategy) -> None:
    lock = hk.holonomic(panda_given.task, hk.lock(2))
    text = str(curvature.distance_to_repeatable(panda_given, curvature.ball(PANDA_START, 0.1), lock, samples=20))
    for said in (
        "at least 3.9",
        "one or more postures",
        "by a theorem",
        "120 sampled points",
        "20 sampled postures",
        "at most",
        "rms",
    ):
        assert said in text
    assert "best" not in text


def test_what_costs_nothing_is_free_and_what_has_no_price_is_refused(ppr: hk.Robot, panda: hk.Robot) -> None:
    task = hk.position(ppr)
    free = curvature.distance_to_repeatable(
        hk.null_basis(task, paper_frame), curvature.ball(CENTER_START, 0.2), samples=30
    )
    assert free.bound < 1e-6
    assert free.first_order < 1e-9
    for strategy, region in (
        (hk.moore_penrose(hk.position(panda)), curvature.ball(PANDA_START, 0.1)),
        (hk.moore_penrose(hk.position(ppr, rows=[0])), curvature.ball(PPR_START, 0.1)),
    ):
        fails(ArgumentError, "redundant joints", lambda: curvature.distance_to_repeatable(strategy, region))
    for radius in (0.0, np.inf):
        fails(ArgumentError, "radius", lambda: curvature.ball(PPR_START, radius))
