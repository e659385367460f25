"""Proofs along paths and over boxes: against closed forms and Newton's method; what must be refused is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import holokin as hk
from conftest import PANDA_START, PPR_START, R3_START, sampled
from holokin.base.errors import ArgumentError
from holokin.motion.ik.plan import make_plan
from holokin.proof import cell_search, certify, equation
from holokin.proof.box_proof import PoseRegion
from holokin.proof.cell_search import Covered, Demands, Extent, covered, overlapping
from holokin.proof.certificate import Certificate
from holokin.proof.certify_leaf import Pathway, walked
from holokin.proof.tube import matrix_norm, norm, product
from holokin.robot import link_jacobian
from holokin.strategies import constraints as C
from holokin.symbolic import SX, Function, symbol
from holokin.symbolic.intervals import Interval
from holokin.symbolic.linear import every_minor, minors_expression
from holokin.symbolic.rotations import log_s2, log_so3, one_formula
from roots import near_panda, roots_are_where_they_should_be, start


def test_norms_are_upper_bounds_that_are_nearly_reached() -> None:
    """Of random matrices, of zero, of tiny and huge ones; of intervals the norms of all matrices inside."""
    rng = np.random.default_rng(0)
    for scale in (1e-140, 1e-3, 1.0, 1e140):
        for j in (1, 7, 49):
            M = rng.normal(size=(20, 7, j)) * scale
            true = np.linalg.norm(M, 2, axis=(1, 2))
            assert (matrix_norm(M) >= true * (1 - 1e-14)).all()
            assert (matrix_norm(M) <= true * 7**0.125 * (1 + 1e-9)).all()
            half = rng.uniform(0, 0.1, M.shape) * scale
            assert (norm(Interval(M - half, M + half)) >= np.linalg.norm(M - half, 2, axis=(1, 2)) * (1 - 1e-14)).all()
    assert matrix_norm(np.zeros((1, 3, 3)))[0] < 1e-140
    for broken in (np.nan, np.inf, 1e200):
        assert matrix_norm(np.full((1, 3, 3), broken))[0] >= 1e200
    unbounded = Interval(np.full((1, 3, 3), -np.inf), np.full((1, 3, 3), np.inf))
    assert norm(product(np.eye(3)[None], unbounded))[0] == np.inf


def test_products_of_intervals_hold_all_products_and_little_more() -> None:
    """Of matrices inside, at their ends, too; with matrices that are exact the product is the same as of points."""
    rng = np.random.default_rng(0)
    for scale in (1e-130, 1.0, 1e120):
        A, B = rng.normal(size=(20, 6, 4)) * scale, rng.normal(size=(20, 4, 3))
        a, b = (rng.uniform(0, 0.1, M.shape) * np.abs(M) for M in (A, B))
        found = product(Interval(A - a, A + a), Interval(B - b, B + b))
        for _ in range(200):
            inside = (A + a * rng.choice([-1, 0.3, 1], A.shape)) @ (B + b * rng.choice([-1, 0.3, 1], B.shape))
            slack = 1e-14 * scale
            assert ((found.low <= inside + slack) & (inside - slack <= found.high)).all()
        reached = np.abs(A) @ b + a @ (np.abs(B) + b)
        assert (found.high - found.low <= 2.01 * reached).all()
        for got, same in zip(product(Interval(A, A), Interval(B, B)), product(A, Interval(B, B)), strict=True):
            assert got == pytest.approx(same, rel=1e-13, abs=1e-290)


@sampled(1, "turning", [False, True], ids=["path", "box that turns"])
def test_e_bounds_the_change_of_the_derivative_along_the_predictor(turning: bool) -> None:
    """|1 - Y D_q E(q(y), y)| at points of all cells; somewhere it is a fair part of e, or the bound were of no use."""
    robot = hk.load("panda")
    G, x = hk.holonomic(hk.pose(robot), hk.lock(2) if turning else hk.arm_angle()), start(robot, PANDA_START)
    where: hk.Path | hk.Workspace = hk.circle(x, center=x - [0.05, 0, 0])
    if turning:
        rotation = robot.pose(PANDA_START)[:3, :3]
        where = hk.workspace(box=(x, (0.004, 0.004, 0.004)), rotation=rotation, tilt=0.004, spin=0.004)
    proof = certify(G, where, PANDA_START)
    assert proof.whole and proof.equation.family.turning == turning
    cells, f, k = proof.cells, proof.findings, len(proof)
    rng, ratio = np.random.default_rng(0), np.zeros(k)
    level = np.repeat(proof.c[:, None], k, axis=1)
    for _ in range(30):
        y = rng.choice([-1, 1, 0.4, -0.7], (k, proof.equation.d))
        at = np.vstack([cells.predicted(y).T, y.T, cells.numbers.T, level])
        A = proof.equation.value(at, at).middle[7:].T.reshape(k, 7, 7).swapaxes(1, 2)
        ratio = np.maximum(ratio, np.linalg.norm(np.eye(7) - f.Y @ A, 2, axis=(1, 2)) / f.e)
    assert (0.08 if turning else 0.3) < ratio.max() <= 1.0


def test_the_leaf_of_the_ppr_arm_is_its_closed_form_E13() -> None:
    """h = e^x tan(q3 / 2) is constant: q3 = 2 atan(tan(Theta / 2) e^-x), q1 = x - cos q3, q2 = y - sin q3."""
    from casadi import cos, exp, tan

    robot = hk.load("ppr")
    leaf = hk.custom(lambda q: [exp(q[0] + cos(q[2])) * tan(q[2] / 2)])
    G = hk.holonomic(hk.position(robot), leaf)
    at = start(robot, PPR_START)
    proof = certify(G, hk.workspace(box=(at, (0.1, 0.1, 0.0))), PPR_START, limits=False)
    assert proof.whole
    rng = np.random.default_rng(1)
    f, boxes = proof.findings, proof.proven.boxes
    h = float(np.exp(PPR_START[0] + np.cos(PPR_START[2])) * np.tan(PPR_START[2] / 2))
    for i in range(len(proof)):
        y = rng.uniform(-1, 1, (30, 3))
        u = (boxes.low[i] + boxes.high[i]) / 2 + (boxes.high[i] - boxes.low[i]) / 2 * y
        x = at + u * [0.1, 0.1, 0.0]
        q3 = 2 * np.arctan(h * np.exp(-x[:, 0]))
        true = np.column_stack([x[:, 0] - np.cos(q3), x[:, 1] - np.sin(q3), q3])
        predicted = np.array([proof.cells.predicted(np.tile(s, (len(proof), 1)))[i] for s in y])
        assert (np.linalg.norm(true - predicted, axis=1) <= f.r[i] + 1e-14).all()


@pytest.fixture(scope="module")
def panda() -> hk.Robot:
    return hk.load("panda")


CASES = {
    "lock": (hk.pose, hk.lock(2)),
    "linear": (hk.pose, hk.linear([[1, 0, -1, 0, 0, 0, 0]])),
    "stereographic": (hk.pose, hk.arm_angle()),
    "conventional": (hk.pose, hk.arm_angle(definition="conventional")),
    "height": (hk.pose, C.height(3)),
    "tilted": (hk.pose, C.tilted(hk.lock(2), lambda x: 0.3 * x[0] * x[1])),
    "total": (hk.pose, C.total(hk.lock(2), hk.lock(4))),
    "one over the other": (hk.position, C.stack(hk.lock(2), hk.lock(4, 5, 6))),
    "coupled orientation": (hk.position, C.stack(hk.coupled(0.1, "rpy"), hk.lock(2))),
    "Euler angles": (lambda robot: hk.pose(robot, orientation="zyz"), hk.lock(2)),
    "axis": (lambda robot: hk.pose(robot, orientation="axis"), C.stack(hk.lock(2), hk.lock(6))),
}


@sampled(2, "name", CASES)
def test_every_constraint_and_task_is_certified_along_a_small_path_on_which_the_tool_turns(
    name: str, panda: hk.Robot
) -> None:
    """And roots lie in the tubes."""
    task, constraint = CASES[name]
    proof = certify(hk.holonomic(task(panda), constraint), near_panda(panda, (0.03, 0.02, -0.01)), PANDA_START)
    assert proof.whole, proof.theorem
    roots_are_where_they_should_be(proof, np.random.default_rng(2), 1)


@pytest.mark.campaign
def test_a_planar_tool_is_certified_while_it_turns_by_more_than_a_whole_turn() -> None:
    """Along a spline with 2.9 rad to its second pose and 3.5 rad on: half a turn, where a logarithm jumps, is nothing.

    The arm is too: the joints add up to the turn of the tool.
    """
    arm = hk.from_dh([{"a": 0.5}, {"a": 0.4}, {"a": 0.3}, {"a": 0.05}])
    q = np.array([0.2, 0.4, 1.6, -0.5])
    poses = np.tile(arm.pose(q), (4, 1, 1))
    poses[1:, :2, 3] += [[0.02, 0.0], [0.02, 0.03], [0.0, 0.02]]
    for pose, turn in zip(poses[1:], (2.9, 5.4, 6.4), strict=True):
        c, s = np.cos(turn), np.sin(turn)
        pose[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ pose[:3, :3]
    path = hk.spline(poses, times=[0, 1, 2.2, 3])
    walk = hk.follow(hk.holonomic(hk.pose(arm), hk.lock(0)), path, q, limits=False)
    proof = hk.certify(hk.holonomic(hk.pose(arm), hk.lock(0)), path, q, limits=False)
    assert proof.whole and len(proof) < 150
    assert walk.q[-1].sum() - q.sum() == pytest.approx(6.4, abs=1e-12)
    roots_are_where_they_should_be(proof, np.random.default_rng(5), 1)


def test_stationary_postures_are_certified() -> None:
    """By the unit null vector and by Chang's, of a planar arm."""
    robot = hk.load("planar-3r")
    x = start(robot, R3_START)
    for free in (None, (2,)):
        G = hk.holonomic(hk.position(robot), hk.stationary(C.posture_cost(np.zeros(3)), free=free))
        proof = certify(G, hk.line(x, x - [0.1, 0.1, 0.0]), R3_START)
        assert proof.whole
        for said in (proof.theorem, proof.table()):  # the determinant is not that of J and J_g alone
            assert "|det D_q E|" in said and "[J; J_g]" not in said


def test_a_closed_loop_comes_home_and_one_round_the_base_ends_a_turn_further(panda: hk.Robot) -> None:
    """Bounds of what is missing are those of round-off."""
    x = start(panda, PANDA_START)
    G = hk.holonomic(hk.pose(panda), hk.lock(2))
    proof = certify(G, hk.circle(x, center=x - [0.05, 0, 0]), PANDA_START)
    assert proof.whole and proof.gap < 1e-12 and not proof.turns.any() and len(proof) <= 60
    roots_are_where_they_should_be(proof, np.random.default_rng(4), 1)
    robot = hk.load("planar-3r")
    q = np.array([0.3, 0.9, 0.9])
    strategy = hk.holonomic(hk.position(robot), hk.linear([[0, 1, -1]]))
    round_base = certify(strategy, hk.circle(start(robot, q), center=(0.0, 0.0, 0.0)), q, limits=False)
    assert round_base.whole and np.abs(round_base.turns).tolist() == [1, 0, 0] and round_base.gap < 1e-12
    assert not round_base.equation.periodic((0.0, 1.0, 0.0))


def refused(proof: Certificate, *reasons: Extent) -> None:
    assert not proof.whole and proof.extent in reasons, proof.theorem


def stretched(share: float) -> tuple[hk.strategies.HolonomicStrategy, np.ndarray, hk.Path]:
    """A planar arm, and a line out from a bent posture: the share of its reach at the end."""
    robot, q = hk.load("planar-3r"), np.array([0.3, 0.3, 0.3])
    x = start(robot, q)
    out = share * float(np.linalg.norm(start(robot, np.zeros(3)))) * x / np.linalg.norm(x)
    return hk.holonomic(hk.position(robot), hk.linear([[0, 1, -1]])), q, hk.line(x, out)


def test_a_stretched_arm_is_refused_as_singular_and_the_walk_there_ends_after_few_steps() -> None:
    """As far as the leaf goes, to within what a proof can use."""
    G, q, path = stretched(1.02)
    refused(certify(G, path, q, limits=False), Extent.END, Extent.SINGULAR)
    robot = G.task.robot
    postures, (_, where, _) = walked(G, make_plan(G.task, path, 256, robot.pose(q)[:3, :3]), q)
    end, reach = (float(np.linalg.norm(start(robot, p))) for p in (postures[-1], np.zeros(3)))
    assert where and len(postures) < 257 and end <= reach and reach - end < path.length / 128


@pytest.mark.campaign
def test_a_box_that_holds_a_singular_posture_is_refused_and_no_grid_is_too_fine() -> None:
    """A stretched planar arm; g = q1 of a PPR arm, where sin q3 = 0; an arm that is nearly stretched in the middle."""
    G, q, _ = stretched(1.0)
    panda, bent = hk.load("panda"), np.array([0.0, 0.4, 0.0, -1e-5, 0.0, 1.6, 0.8])
    cases = [
        (G, (0.2, 0.2, 0.0), q),
        (hk.holonomic(hk.position(hk.load("ppr")), hk.lock(0)), (0.1, 0.1, 0.0), np.array([0.0, 0.0, 0.2])),
        (hk.holonomic(hk.position(panda), hk.lock(2, 4, 5, 6)), (0.3, 0.3, 0.3), bent),
    ]
    for strategy, half, q0 in cases:
        box = hk.workspace(box=(start(strategy.task.robot, q0), half))
        refused(certify(strategy, box, q0, limits=False), Extent.SINGULAR, Extent.APART)


def test_a_wrist_through_its_singularity_is_proven_up_to_there() -> None:
    """IRB 140, six joints, no constraint: joint 5 from 0.3 to -0.3 along an arc about its own axis."""
    robot, q = hk.load("irb140"), np.array([0.2, 0.3, 0.1, 0.4, 0.3, -0.2])
    straight = q * [1, 1, 1, 1, 0, 1]
    J, x = robot.jacobian(straight), start(robot, q)
    axis = J[3:, 4]
    center = robot.pose(straight)[:3, 3] + np.cross(axis, J[:3, 4])
    center += axis * (axis @ (x - center))
    G = hk.holonomic(hk.pose(robot), hk.custom(lambda _q: [], rows=0))
    proof = certify(G, hk.path.arc(x, center, -0.6, normal=axis, turn=-0.6 * axis), q, limits=False)
    refused(proof, Extent.END, Extent.SINGULAR)
    assert 0.45 < proof.proven.boxes.high[-1, 0] < 0.5


def test_a_loop_across_a_fold_is_not_said_to_close() -> None:
    """A PPR arm, q1 locked: x = q1 + cos q3 reaches q1 + 1 and no farther."""
    robot, q = hk.load("ppr"), np.array([0.0, 0.0, 0.5])
    x = start(robot, q)
    G = hk.holonomic(hk.position(robot), hk.lock(0))
    proof = certify(G, hk.circle(x, center=x + [0.1, 0, 0]), q, limits=False)
    refused(proof, Extent.END, Extent.SINGULAR)
    assert proof.gap == np.inf and (proof.high[2] < 0.6).all()


def strangers(found: Covered, chosen: np.ndarray) -> Covered:
    """Some cells of whose roots it is not known where they are, nor that they are alone."""
    f = found.findings
    r, alone = np.where(chosen, np.inf, f.r), np.where(chosen, 0.0, f.alone)
    return replace(found, findings=replace(f, r=r, alone=alone))


def test_cells_behind_one_that_is_not_glued_do_not_count(panda: hk.Robot) -> None:
    """Roots of some cells made strangers: the path is proven up to there, of a box the rest."""
    G = hk.holonomic(hk.pose(panda), hk.lock(2))
    x = start(panda, PANDA_START)
    path = hk.line(x, x - [0.2, 0.0, 0.0])
    plan = make_plan(G.task, path, 64, G.task.pose(PANDA_START)[:3, :3])
    domain = Pathway.of(G, plan, hk.follow(G, path, PANDA_START, samples=64, method="leaf").q)
    found = domain.arranged(covered(domain, domain.first(), Demands(None), 200, lambda *_progress: None))
    assert domain.connected(found) is found and len(found) > 5
    part = domain.connected(strangers(found, np.arange(len(found)) == 4))
    assert len(part) == 4 and part.extent is Extent.APART
    assert part.stopped == (0, (found.boxes.low[4, 0],)) and part.boxes.high[-1, 0] == found.boxes.low[4, 0]
    robot, q = hk.load("planar-3r"), np.array([0.3, 0.9, 0.9])
    strategy = hk.holonomic(hk.position(robot), hk.linear([[0, 1, -1]]))
    region = PoseRegion.of(strategy, hk.workspace(box=(start(robot, q), (0.15, 0.15, 0.0))), q)
    found = covered(region, region.first(), Demands(None), 500, lambda *_progress: None)
    behind = found.boxes.low[:, 0] >= 0
    assert region.connected(found) is found and 3 < behind.sum() < len(found) - 3
    part = region.connected(strangers(found, behind))
    assert part.extent is Extent.APART and len(part) == (~behind).sum() and (part.boxes.high[:, 0] <= 0).all()
    lost = replace(found.only(found.boxes.high[:, 0] != 0.0), extent=Extent.SINGULAR, stopped=(0, (-1.0, -1.0, -1.0)))
    assert len(region.connected(lost)) == len(lost) == behind.sum()


# --- Proofs of stationary postures, two hands, boxes that turn: against the library's own kinematics and constraints.


HANDS = ("left_flange", "right_flange")
YUMI = np.array([0.1, -1.2, -0.9, 0.4, 0.3, 0.8, 0.2, -0.1, -1.2, 0.9, 0.4, -0.3, 0.8, -0.2])


@pytest.fixture(scope="module")
def yumi() -> hk.Robot:
    return hk.load("yumi")


STATIONARY = {
    "centring": hk.stationary(C.centring_cost()),
    "posture, by Chang's null vector": hk.stationary(C.posture_cost(PANDA_START + 0.1), free=(2,)),
    "tilted": C.tilted(hk.stationary(C.centring_cost()), lambda x: 0.1 * x[0]),
}


@sampled(1, "name", STATIONARY)
def test_stationary_postures_of_a_panda_are_those_of_the_constraint_itself(panda: hk.Robot, name: str) -> None:
    """The null vector is an unknown of the proof; the constraint, by reflections, is the same along all of it."""
    G = hk.holonomic(hk.pose(panda), STATIONARY[name])
    walk = hk.follow(G, near_panda(panda), PANDA_START, samples=20)
    proof = hk.certify(G, near_panda(panda), PANDA_START)
    assert proof.whole and proof.equation.n > proof.equation.joints == 7 and proof.low.shape == (7,)
    assert max(float(np.abs(G.g(q) - G.g(PANDA_START)).max()) for q in walk.q) < 1e-12
    assert (proof.low <= walk.q + 1e-12).all() and (walk.q - 1e-12 <= proof.high).all()


@pytest.mark.campaign
def test_one_hand_in_the_frame_of_the_other_is_certified_with_all_fourteen_joints(yumi: hk.Robot) -> None:
    """A closed path of the left hand as the right one sees it; the least-motion rows of the start are held."""
    task = hk.strategies.tasks.relative_pose(yumi, *HANDS)
    held = np.linalg.svd(task.jacobian(YUMI))[2][6:]
    G = hk.holonomic(task, hk.linear(held))
    x = task.pose(YUMI)[:3, 3]
    walk = hk.follow(G, hk.circle(x, center=x - [0.03, 0, 0]), YUMI, samples=16, limits=False)
    proof = hk.certify(G, hk.circle(x, center=x - [0.03, 0, 0]), YUMI, limits=False)
    assert proof.whole and proof.gap < 1e-11
    for q, u in zip(walk.q, np.arange(len(walk.q)) / (len(walk.q) - 1), strict=True):
        left, right = (yumi.pose(q, hand) for hand in HANDS)
        seen = np.linalg.inv(right) @ left
        away = np.linalg.norm(seen[:3, 3] - (x - [0.03, 0, 0]))
        assert abs(away - 0.03) < 1e-10 and np.abs(held @ (q - YUMI)).max() < 1e-10, u
    roots_are_where_they_should_be(proof, np.random.default_rng(0), 1)


@pytest.mark.campaign
def test_two_hands_each_on_a_path_of_its_own_are_certified(yumi: hk.Robot) -> None:
    """One turns while the other goes round a circle; the poses are those of the paths."""
    task = hk.stacked(*(hk.pose(yumi, tip=hand) for hand in HANDS))
    G = hk.holonomic(task, hk.lock(2, 9))
    left, right = task.pose(YUMI)[:, :3, 3]
    away = hk.line(right, right + [0.02, 0, 0], turn=(0, 0, 0.1))
    back = hk.line(away.end, right, turn=(0, 0, -0.1))
    paths = hk.path.synchronized(hk.circle(left, left - [0.02, 0, 0]), away + back)
    walk = hk.follow(G, paths, YUMI, samples=20, limits=False)
    proof = hk.certify(G, paths, YUMI, limits=False)
    assert proof.whole and proof.gap < 1e-11 and proof.equation.positive == 2
    assert (
        "wherever the path comes back to the tools' poses, the joints are the same" in proof.theorem
        and "|det [J; J_g]|" in proof.theorem
    )
    at = paths.at(walk.t)
    assert np.abs(task.value_batch(walk.q)[:, [0, 1, 2, 6, 7, 8]] - at.position).max() < 1e-10
    roots_are_where_they_should_be(proof, np.random.default_rng(0), 1)
    box = hk.workspace(box=(left, (0.01, 0.01, 0.01)))
    with pytest.raises(ArgumentError, match="one tool"):
        certify(G, box, YUMI)


@pytest.mark.campaign
def test_a_box_of_poses_that_turn_is_certified_and_verified(panda: hk.Robot, tmp_path: Path) -> None:
    """Six parameters: at its corners the joints are those of inverse kinematics on the leaf."""
    pose = panda.pose(PANDA_START)
    box = hk.workspace(box=(pose[:3, 3], (0.003, 0.003, 0.003)), rotation=pose[:3, :3], tilt=0.008, spin=0.008)
    G = hk.holonomic(hk.pose(panda), hk.lock(2))
    proof = certify(G, box, PANDA_START)
    assert proof.whole and proof.equation.d == 6 and len(proof) <= 16
    roots_are_where_they_should_be(proof, np.random.default_rng(0), 1)
    file = proof.save(tmp_path / "turned.json")
    assert pytest.importorskip("holokin.proof.checker").check(str(file)).whole


@pytest.mark.campaign
def test_cells_examined_one_by_one_are_those_examined_together(
    panda: hk.Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Memory is bounded by portions, which change no number."""
    x = panda.pose(PANDA_START)[:3, 3]
    path = hk.line(x, x - [0.1, 0, 0])
    together = certify(hk.holonomic(hk.pose(panda), hk.lock(2)), path, PANDA_START)
    monkeypatch.setattr(equation, "ROOM", 1)
    alone = certify(hk.holonomic(hk.pose(panda), hk.lock(2)), path, PANDA_START)
    assert together.equation.at_once > 1 == alone.equation.at_once
    assert np.array_equal(together.findings.omega, alone.findings.omega) and len(together) > 1


# --- Proofs of leaves that depend on rotation vectors, and of stationary manipulability: without switches and kinks.


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


# --- Boxes that touch.


@given(st.integers(0, 2**32 - 1), st.integers(0, 120), st.integers(0, 4), st.booleans())
def test_cuts_find_the_pairs_that_comparing_all_with_all_finds(seed: int, k: int, d: int, halved: bool) -> None:
    """Boxes of halved sides, as the search makes them, share faces exactly; others lie anywhere."""
    rng = np.random.default_rng(seed)
    parts = 2.0 ** rng.integers(0, 4, (k, d)) if halved else rng.uniform(1, 9, (k, d))
    low = np.floor(rng.uniform(0, 1, (k, d)) * parts) / parts if halved else rng.uniform(0, 1, (k, d))
    high = low + 1 / parts
    ones, others = np.flatnonzero(rng.random(k) < 0.5), np.flatnonzero(rng.random(k) < 0.5)
    at_once, cell_search.COMPARED = cell_search.COMPARED, 4
    try:
        i, j = overlapping(low, high, ones, others)
    finally:
        cell_search.COMPARED = at_once
    expected = [
        (a, b) for a in ones for b in others if (np.maximum(low[a], low[b]) < np.minimum(high[a], high[b])).all()
    ]
    assert list(zip(i.tolist(), j.tolist(), strict=True)) == sorted(expected)
