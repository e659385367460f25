"""The best section of a workspace: known figures, exact derivatives, limits that hold, laws like any other."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import R3_START, campaign, sampled, urdf
from exported import rates
from holokin.analysis.coverage.pose_postures import chart_of, coordinates_of
from holokin.analysis.design.objectives import Objective, costs_of
from holokin.analysis.design.section import Limits, Search, SectionSamples, TiltedLeaves, descend
from holokin.base.errors import ArgumentError, OutOfReachError, UnknownNameError
from holokin.path.workspaces import PoseCloud
from holokin.strategies import HolonomicStrategy
from holokin.strategies.constraints import centring_cost
from holokin.strategies.right_inverses import monomials_up_to

READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
CENTER, HALF = np.array([0.5, 0.1, 0.35]), np.array([0.15, 0.25, 0.15])
SMALL = hk.workspace(box=([0.5, 0.05, 0.35], [0.12, 0.2, 0.12]))
TURNING = hk.workspace(box=([0.5, 0.05, 0.4], [0.05, 0.1, 0.05]), tilt=0.3, spin=0.5)


@pytest.fixture(scope="module")
def task(panda: hk.Robot) -> hk.Task:
    return hk.pose(panda)


@pytest.fixture(scope="module")
def oracle() -> PoseCloud:
    """150 random tool poses of a box, tool down."""
    poses = np.tile(np.eye(4), (150, 1, 1))
    poses[:, :3, :3] = np.diag([1.0, -1.0, -1.0])
    poses[:, :3, 3] = CENTER + np.random.default_rng(0).uniform(-1, 1, (150, 3)) * HALF
    return PoseCloud(poses)


@pytest.fixture(scope="module")
def found(task: hk.Task, oracle: PoseCloud) -> hk.analysis.design.Design:
    return hk.design(task, oracle, READY, base=hk.lock("panda_joint3"), degree=3)


@pytest.fixture(scope="module")
def swift(task: hk.Task) -> hk.analysis.design.Design:
    """One at few poses."""
    return hk.design(task, SMALL, READY, objective="worst_speed", degree=1, samples=16)


def squared_speed(law: HolonomicStrategy, start: np.ndarray, cloud: PoseCloud) -> np.ndarray:
    """|G|_F^2 over the position columns at each pose, by the library's public doors alone."""
    return np.sum(law.batch(hk.ik(law, start).batch(cloud.given).q)[:, :, :3] ** 2, axis=(1, 2))


def test_a_panda_over_a_box_has_the_known_least_squared_speeds(
    found: hk.analysis.design.Design, oracle: PoseCloud
) -> None:
    """Theory 7.1: 49.20 with joint 3 held, 47.83, 47.585, 47.578 with degree 1, 2, 3; radial has 55.5."""
    assert found.costs == pytest.approx((49.200, 49.200, 47.833, 47.585, 47.578), abs=1e-3)
    energies = squared_speed(found.strategy, found.q0, oracle)
    assert energies.mean() == pytest.approx(found.costs[-1], rel=1e-9)
    assert found.after.squared_speed == pytest.approx(found.costs[-1], rel=1e-9)
    assert found.holds


@pytest.mark.campaign
def test_the_bound_is_the_mean_of_the_least_along_whole_self_motions(
    found: hk.analysis.design.Design, oracle: PoseCloud, task: hk.Task
) -> None:
    """At some poses |J^+|^2 is compared with that along a self-motion traced one by one in steps of 0.02."""
    assert found.bound_traced
    assert found.bound == pytest.approx(46.840, abs=1e-3)
    assert found.bound_here == pytest.approx(found.bound, rel=1e-6)
    few = PoseCloud(oracle.given[:4])
    least = []
    for q in hk.ik(found.strategy, found.q0).batch(few.given).q:
        postures = hk.strategies.self_motion(task, q, limits=False).q
        inside = ((postures >= task.robot.lower) & (postures <= task.robot.upper)).all(axis=1)
        pseudo = np.linalg.pinv(task.jacobian_batch(postures[inside])[0])[:, :, :3]
        least.append(np.sum(pseudo**2, axis=(1, 2)).min())
    design = hk.design(task, few, READY, base=hk.lock("panda_joint3"), degree=0)
    assert design.bound_here == pytest.approx(np.mean(least), rel=1e-4)


@pytest.mark.campaign
def test_a_design_says_how_many_metres_a_turn_counted_as(task: hk.Task) -> None:
    """The spread of positions over that of rotation vectors; what was given stays as it was."""
    given = Objective(1.0, length=0.5)
    poses = TURNING.poses(16, 0)
    turns = Rotation.from_matrix(TURNING.center[:3, :3].T @ poses[:, :3, :3]).as_rotvec()
    own, again = (
        hk.design(
            task, TURNING, READY, objective=goal, base=hk.lock("panda_joint3"), degree=0, limits=False, samples=16
        )
        for goal in ("squared_speed", given)
    )
    assert own.objective.length == pytest.approx(np.sqrt(poses[:, :3, 3].var(axis=0).sum() / turns.var(axis=0).sum()))
    assert again.objective.length == 0.5


def test_a_designed_law_is_holonomic_and_as_regular_as_its_base(found: hk.analysis.design.Design) -> None:
    """det [J; J_g] = det [J; J_phi]: zeta adds no singularity (theory 2e)."""
    assert hk.involutivity(found.strategy, hk.around(found.q0, 0.2)).holonomic
    for q in hk.around(found.q0, 0.3).sample(5):
        J = found.strategy.task.jacobian(q)
        ours, base = (np.linalg.det(np.vstack([J, law.rows(q)])) for law in (found.strategy, found.base))
        assert ours == pytest.approx(base, rel=1e-9)
        assert np.abs(found.strategy.rows(q) - found.base.rows(q)).max() > 1e-3


@pytest.mark.campaign
def test_a_design_survives_pickling(swift: hk.analysis.design.Design) -> None:
    again = pickle.loads(pickle.dumps(swift))
    assert np.array_equal(again.strategy(swift.q0), swift.strategy(swift.q0))
    assert again.costs == swift.costs and again.bound == swift.bound


@pytest.mark.campaign
def test_a_design_says_the_same_after_pickling(swift: hk.analysis.design.Design) -> None:
    """Each text looks for the least of other postures anew."""
    assert str(pickle.loads(pickle.dumps(swift))) == str(swift)
    assert swift.broken == 0 and "beyond hard limits" not in str(swift)


@pytest.mark.campaign
def test_exported_c_of_a_designed_law_is_python(found: hk.analysis.design.Design, tmp_path: Path) -> None:
    Q = hk.around(found.q0, 0.2).sample(20)
    dx = np.random.default_rng(1).normal(size=(20, 6))
    dq, _ = rates(
        hk.export.export_c(found.strategy, tmp_path / "c", q0=found.q0, name="designed"), tmp_path, Q, dx, "-O0"
    )
    assert dq == pytest.approx(np.einsum("kij,kj->ki", found.strategy.batch(Q), dx), abs=1e-12)


def search_of(task: hk.Task, space: hk.Workspace, base: hk.Constraint, goal: Objective, limits: Limits) -> Search:
    """A search at eight poses."""
    law = hk.holonomic(task, base)
    center = hk.ik(law, READY)(space.center)
    poses = space.poses(8)
    Q = hk.ik(law, center).batch(poses).q
    c = coordinates_of(chart_of(task, space.center[:3, :3]), Q)
    terms = monomials_up_to(c.d, 2)
    section = SectionSamples(TiltedLeaves(law, c), terms, poses[:, :3, 3], poses[:, :3, :3], c.at(Q))
    near = section.through(Q, law.g(center)[:, None])
    return Search(section, costs_of(task.robot, goal, c.turns, c.spread), goal.weights, limits, near)


@sampled(2, "name", Objective.NAMES)
@sampled(2, "case", ["position", "pose", "cost"])
def test_derivatives_are_those_of_differences(panda: hk.Robot, name: str, case: str) -> None:
    """The objective and the violated limits by the coefficients, also with r = 4, with turns, with a curved base."""
    whole = hk.pose(panda)
    task, space, base = {
        "position": (hk.position(panda), SMALL, hk.lock(2, 4, 5, 6)),
        "pose": (whole, TURNING, hk.lock(2)),
        "cost": (whole, SMALL, hk.stationary(centring_cost())),
    }[case]
    limits = Limits(np.full(7, 0.3), 0.5)  # violated at most of the poses
    search = search_of(task, space, base, Objective(**{name: 1.0}), limits)
    r, t = base.rows, len(search.section.terms)
    cost = search._augmented(r, t, np.zeros((8, 8)), 2.0)
    rng = np.random.default_rng(0)
    x, way = np.pad(search.near.levels[:1].T, ((0, 0), (0, t - 1))).ravel(), rng.normal(size=r * t)
    x = (x.reshape(r, t) @ np.linalg.inv(search._whitening)).ravel() + 0.01 * rng.normal(size=r * t)
    here = cost(x, search.near)
    assert here is not None
    h = 1e-6
    ahead, behind = (cost(x + s * h * way, here[2]) for s in (1, -1))
    assert ahead is not None and behind is not None
    assert here[1] @ way == pytest.approx((ahead[0] - behind[0]) / (2 * h), rel=2e-5)


@pytest.mark.campaign
@pytest.mark.parametrize("goal", ["one", "all"])
def test_no_objective_is_below_its_bound_and_each_is_made_less(
    task: hk.Task, swift: hk.analysis.design.Design, goal: str
) -> None:
    every = Objective(1.0, 1.0, 1.0, 1.0, 1.0)
    found = swift if goal == "one" else hk.design(task, SMALL, READY, objective=every, degree=1, samples=16)
    assert 0 < found.bound <= found.costs[-1] < found.costs[0]
    assert found.costs[1] >= found.costs[2]
    assert found.checked.reached == found.checked.poses == 64


@pytest.mark.parametrize("arm", ["planar-3r", campaign("arm", "panda")])
def test_limits_that_bind_are_kept_at_other_poses(arm: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without limits the design comes nearer; with them the squared speed is higher, and they hold at the check."""
    robot = hk.load(arm)
    if arm == "panda":
        monkeypatch.setenv("HOLOKIN_NATIVE", "1")  # it is long enough for a compiler
        task, q0, margin, rcond = hk.pose(robot), READY, 0.5, 0.12
        space = hk.workspace(box=([0.5, 0.05, 0.4], [0.05, 0.1, 0.05]), spin=1.5)
    else:
        task, q0, margin, rcond = hk.position(robot), np.array([0.3, 0.9, 0.7]), 1.9, 0.12
        space = hk.workspace(box=(robot.pose(q0)[:3, 3], [0.3, 0.3, 0.0]))
    words = {"base": hk.lock(2), "degree": 1, "samples": 16 if arm == "planar-3r" else 48}
    free = hk.design(task, space, q0, **words)
    held = hk.design(task, space, q0, **words, margin=margin, rcond=rcond)

    def least_margin(d: hk.analysis.design.Design, poses: np.ndarray) -> float:
        q = hk.ik(d.strategy, d.q0).batch(poses).q
        return float(np.minimum(q - task.robot.lower, task.robot.upper - q).min())

    checked = space.poses(192, seed=1)
    assert least_margin(free, checked) < margin <= least_margin(held, checked)
    assert held.checked.rcond >= rcond
    assert held.holds and held.impossible == 0
    assert held.costs[-1] > free.costs[-1] + 0.01
    assert held.costs[1] > held.costs[0]  # the base law breaks them, and the answer says so
    assert f"alone (beyond hard limits at {held.broken} of the samples)" in str(held)
    assert free.broken == 0
    assert least_margin(held, space.poses(192, seed=9)) > margin - 0.02  # poses that nobody looked at


@pytest.mark.campaign
def test_limits_that_no_posture_keeps_are_told(task: hk.Task) -> None:
    found = hk.design(task, SMALL, READY, degree=0, samples=16, margin=1.4)
    assert not found.holds
    assert found.impossible >= 15
    assert f"at {found.impossible} of the samples no posture" in str(found)
    assert np.isfinite(found.bound)


@pytest.mark.campaign
def test_four_redundant_joints_come_near_the_least_that_a_search_finds(panda: hk.Robot) -> None:
    found = hk.design(hk.position(panda), SMALL, READY, degree=1, samples=12)
    assert not found.bound_traced
    assert found.bound <= found.costs[-1] < min(1.03 * found.bound, 0.9 * found.costs[0])
    assert hk.involutivity(found.strategy, hk.around(found.q0, 0.1)).holonomic


def test_a_sliding_joint_counts_as_a_hinge_that_uses_the_same_share_of_its_speed() -> None:
    robot = hk.from_urdf(str(urdf("tiago.urdf")), tip="arm_tool_link")
    weights = costs_of(robot, Objective(1.0), np.zeros(3, dtype=bool), np.ones(3)).joints
    assert robot.joint_names[0] == "torso_lift_joint"
    assert weights[0] == pytest.approx((robot.max_velocity[1:].mean() / robot.max_velocity[0]) ** 2)
    assert (weights[1:] == 1).all()


@pytest.mark.parametrize("arm", ["planar-3r", campaign("arm", "panda")])
def test_radials_own_coordinate_can_be_tilted(task: hk.Task, arm: str) -> None:
    if arm == "panda":
        center = hk.ik(hk.holonomic(task, hk.lock(2)), READY)(SMALL.center)
    else:
        task, center = hk.position(hk.load(arm)), R3_START
    radial = hk.radial(hk.moore_penrose(task), center, steps=1)
    tilted = hk.strategies.constraints.tilted(radial.constraint, lambda x: 0.3 * x[0])
    law = hk.holonomic(task, tilted)
    assert law.looped is not law
    for q in hk.around(center, 0.1).sample(3):
        J = task.jacobian(q)
        assert law.rows(q) == pytest.approx(radial.rows(q) - 0.3 * J[:1], abs=1e-10)
        assert law.g(q) == pytest.approx(radial.g(q) - 0.3 * task(q)[0], abs=1e-12)


def test_descent_finds_the_bottom_of_a_curved_valley_that_ends() -> None:
    """Rosenbrock's function, not defined left of -1.3, from beside the end."""

    def cost(x: np.ndarray, _: None) -> tuple[float, np.ndarray, None] | None:
        if x[0] < -1.3:
            return None
        a, b = 1 - x[0], x[1] - x[0] ** 2
        return a * a + 100 * b * b, np.array([-2 * a - 400 * b * x[0], 200 * b]), None

    x, value, _ = descend(cost, np.array([-1.2, 1.0]), None)
    assert x == pytest.approx([1.0, 1.0], abs=1e-4)
    assert value < 1e-9


def test_bad_input_is_told_with_its_cure(task: hk.Task, irb140: hk.Robot) -> None:
    with pytest.raises(ArgumentError, match=r"redundant joints is 0; each tool pose has its joints already: hk.ik"):
        hk.design(hk.pose(irb140), SMALL, np.full(6, 0.3))
    with pytest.raises(OutOfReachError, match=r"middle of the workspace.*another workspace"):
        hk.design(task, hk.workspace(box=([2.0, 0, 0.3], [0.1, 0.1, 0.1])), READY)
    with pytest.raises(UnknownNameError, match="objective 'speed'"):
        hk.design(task, SMALL, READY, objective="speed")
    with pytest.raises(ArgumentError, match="give 0 to 4"):
        hk.design(task, SMALL, READY, degree=5)
    with pytest.raises(ArgumentError, match="not all alike"):
        hk.design(task, PoseCloud(SMALL.center[None]), READY)
    with pytest.raises(ArgumentError, match="from 0 to 1"):
        hk.design(task, SMALL, READY, rcond=2.0)
    with pytest.raises(ArgumentError, match="positive weight"):
        Objective()
    with pytest.raises(ArgumentError, match="positive numbers"):
        Objective(1.0, joint_weights=[-1.0] * 7)
    assert replace(Objective(1.0), travel=2.0).weights == {"squared_speed": 1.0, "travel": 2.0}
