"""Proofs of leaves that depend on rotation vectors, and of stationary manipulability: without switches and kinks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, R3_START, sampled
from holokin.proof import certify
from holokin.proof.certificate import Extent
from holokin.robot import link_jacobian
from holokin.strategies import constraints as C
from holokin.symbolic import SX, Function, symbol
from holokin.symbolic.linear import every_minor, minors_expression
from holokin.symbolic.rotations import log_s2, log_so3, one_formula
from roots import near_panda, roots_are_where_they_should_be, start


def test_the_formula_without_a_switch_is_the_logarithm_to_round_off() -> None:
    """Against SciPy's rotation vectors, across the 0.02 rad at which the formulas are switched and up to 3 rad."""
    from scipy.spatial.transform import Rotation

    R, d = symbol("R", 9), symbol("d", 3)
    with one_formula():
        log = Function("log", {"R": R, "d": d}, {"w": log_so3(R.reshape((3, 3)).T), "a": log_s2(d)})
    switched = Function("switched", {"R": R, "d": d}, {"w": log_so3(R.reshape((3, 3)).T), "a": log_s2(d)})
    rng = np.random.default_rng(0)
    for angle in (0.0, 1e-9, 1e-3, 0.0199, 0.0201, 0.5, 2.0, 3.0):
        w = rng.normal(size=3)
        w *= angle / np.linalg.norm(w)
        M = Rotation.from_rotvec(w).as_matrix()
        turn, direction = log(M.ravel(), M[:, 2])
        assert np.abs(np.ravel(turn) - w).max() < 1e-15 * max(1.0, angle)
        assert np.abs(np.ravel(direction) - np.ravel(switched(M.ravel(), M[:, 2])[1])).max() < 1e-15


def test_minors_are_determinants_and_their_squares_the_volume_of_the_jacobian() -> None:
    """Of a matrix (3, 5) with zeros, and the signed ones of (3, 4)."""
    rng = np.random.default_rng(0)
    J = rng.normal(size=(3, 5)) * (rng.random((3, 5)) < 0.7)
    found = {columns: float(value) for columns, value in every_minor(SX(J)).items()}
    assert all(np.isclose(value, np.linalg.det(J[:, list(columns)])) for columns, value in found.items())
    assert np.isclose(sum(value**2 for value in found.values()), np.linalg.det(J @ J.T))
    J, w = rng.normal(size=(3, 4)), rng.normal(size=4)
    signed = minors_expression(SX(J))
    assert np.isclose(sum(float(signed[i]) * w[i] for i in range(4)), np.linalg.det(np.vstack([J, w])))


@sampled(2, "name", ["panda", "iiwa14", "rail-ur10e", "sawyer"])
def test_the_jacobian_of_a_middle_link_has_the_null_vectors_and_the_volume_of_the_tool_s(name: str) -> None:
    """Joints that slide and fixed rotations of any angle included."""
    robot, rng = hk.load(name), np.random.default_rng(0)
    q = symbol("q", robot.n)
    seen = Function("J", {"q": q}, {"all": link_jacobian(robot, q), "linear": link_jacobian(robot, q, turned=False)})
    for _ in range(3):
        posture = rng.normal(size=robot.n)
        J = robot.jacobian(posture)
        for M, true in zip(seen(posture), (J, J[:3]), strict=True):
            M = np.reshape(M, true.shape)
            assert np.isclose(np.linalg.det(M @ M.T), np.linalg.det(true @ true.T), rtol=1e-12)
            assert np.abs(M @ np.linalg.svd(true)[2][len(true) :].T).max() < 1e-12


def volume_along_the_self_motion(robot: hk.Robot, q: np.ndarray) -> float:
    """d log sqrt(det J J^T) along the null vector, by differences of the robot's own Jacobian."""
    J = robot.jacobian(q)
    n = np.linalg.svd(J)[2][-1]
    n *= np.sign(np.linalg.det(np.vstack([J, n])))
    values = [np.linalg.slogdet((A := robot.jacobian(q + h * n)) @ A.T)[1] / 2 for h in (-1e-4, 1e-4)]
    return float(values[1] - values[0]) / 2e-4


@pytest.mark.campaign
def test_stationary_manipulability_of_a_panda_is_certified_without_further_unknowns(tmp_path: Path) -> None:
    """Along the path the derivative of the manipulability stays what it is at the start; the checker agrees."""
    robot = hk.load("panda")
    G = hk.holonomic(hk.pose(robot), hk.stationary(C.manipulability_cost()))
    walk = hk.follow(G, near_panda(robot), PANDA_START, samples=8)
    proof = hk.certify(G, near_panda(robot), PANDA_START)
    assert proof.whole and proof.equation.n == 7 and "[J; J_g]" in proof.theorem and len(proof) < 20
    kept = [volume_along_the_self_motion(robot, q) for q in walk.q]
    assert np.ptp(kept) < 1e-6 and kept[0] == pytest.approx(-float(G.g(PANDA_START)[0]), abs=1e-6)
    roots_are_where_they_should_be(proof, np.random.default_rng(0), 1)
    recheck = pytest.importorskip("holokin.proof.checker").check
    assert recheck(str(proof.save(tmp_path / "proof.json"))).whole


@pytest.mark.campaign
def test_stationary_manipulability_of_a_stretched_arm_is_refused() -> None:
    """Out of the reach of a planar arm; inside it is certified, by Chang's null vector, too."""
    robot, q = hk.load("planar-3r"), R3_START
    x = start(robot, q)
    out = hk.line(x, 4 * x / np.linalg.norm(x))
    for free in (None, (2,)):
        G = hk.holonomic(hk.position(robot), hk.stationary(C.manipulability_cost(), free=free))
        assert certify(G, hk.line(x, x - [0.05, 0.05, 0.0]), q).whole
        proof = certify(G, out, q, limits=False, budget=400)
        assert not proof.whole and proof.extent in (Extent.END, Extent.SINGULAR, Extent.BUDGET)


def turned_loop(robot: hk.Robot) -> hk.Path:
    """There and back, from where the rotation is the reference to 0.08 rad from it."""
    x = start(robot, PANDA_START)
    turn = np.array([0.04, 0.06, -0.03])
    there = hk.line(x, x - [0.03, 0, 0], turn=turn)
    return there + hk.line(x - [0.03, 0, 0], x, turn=-turn)


@pytest.mark.campaign
def test_leaves_that_are_tilted_by_the_orientation_are_certified_across_their_reference(tmp_path: Path) -> None:
    """The logarithm has a switch 0.02 rad from there; the followed joints are on the leaf of the code that runs."""
    robot = hk.load("panda")
    chart = replace(hk.pose(robot), reference=robot.pose(PANDA_START)[:3, :3])
    tilt = C.tilted(hk.lock(2), lambda x: 0.3 * x[3] * x[4] + 0.2 * x[0] * x[5], chart=chart)
    G = hk.holonomic(hk.pose(robot), tilt)
    walk = hk.follow(G, turned_loop(robot), PANDA_START, samples=10)
    proof = hk.certify(G, turned_loop(robot), PANDA_START)
    assert proof.whole and len(proof) < 30
    assert max(float(np.abs(G.g(q) - G.g(PANDA_START)).max()) for q in walk.q) < 1e-14
    recheck = pytest.importorskip("holokin.proof.checker").check
    assert recheck(str(proof.save(tmp_path / "proof.json"))).whole


@pytest.mark.campaign
def test_a_polynomial_in_rotation_vectors_is_certified_where_the_tool_turns() -> None:
    """`fitted` with all six rows, to the leaves of a radial strategy."""
    robot = hk.load("panda")
    path, rng = turned_loop(robot), np.random.default_rng(0)
    Q = hk.follow(hk.moore_penrose(hk.pose(robot)), path, PANDA_START, samples=20).q
    Q = np.vstack([Q, *(Q + rng.normal(scale=0.03, size=Q.shape) for _ in range(2))])
    fit = hk.strategies.fitted(hk.radial(hk.moore_penrose(hk.pose(robot)), PANDA_START), Q, degree=2)
    proof = certify(fit, path, PANDA_START)
    assert proof.whole
    roots_are_where_they_should_be(proof, np.random.default_rng(0), 1)
