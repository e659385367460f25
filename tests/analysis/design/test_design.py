"""The best section of a workspace: known figures, exact derivatives, limits that hold, laws like any other."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import R3_START, campaign, fails, sampled, urdf
from exported import rates
from holokin.analysis.coverage.pose_coordinates import chart_of, coordinates_of
from holokin.analysis.design import Design, level_range, nearby_cusps
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
def found(task: hk.Task, oracle: PoseCloud) -> Design:
    return hk.design(task, oracle, READY, base=hk.lock("panda_joint3"), degree=3)


@pytest.fixture(scope="module")
def swift(task: hk.Task) -> Design:
    """One at few poses."""
    return hk.design(task, SMALL, READY, objective="joint_limits", degree=1, samples=16)


def squared_speed(law: HolonomicStrategy, start: np.ndarray, cloud: PoseCloud) -> np.ndarray:
    """|G|_F^2 over the position columns at each pose, by the library's public doors alone."""
    return np.sum(law.batch(hk.ik(law, start).batch(cloud.given).q)[:, :, :3] ** 2, axis=(1, 2))


def test_a_panda_over_a_box_has_the_known_least_squared_speeds(found: Design, oracle: PoseCloud) -> None:
    """Theory 7.1: 49.20 with joint 3 held, 47.83, 47.585, 47.578 with degree 1, 2, 3; radial has 55.5."""
    assert found.costs == pytest.approx((49.200, 49.200, 47.833, 47.585, 47.578), abs=1e-3)
    energies = squared_speed(found.strategy, found.q0, oracle)
    assert energies.mean() == pytest.approx(found.costs[-1], rel=1e-9)
    assert found.after.squared_speed == pytest.approx(found.costs[-1], rel=1e-9)
    assert found.holds


@pytest.mark.campaign
def test_the_bound_is_the_mean_of_the_least_along_whole_self_motions(
    found: Design, oracle: PoseCloud, task: hk.Task
) -> None:
    """At some poses |J^+|^2 is compared with that along a self-motion traced one by one in steps of 0.02."""
    assert found.bound_traced
    assert found.bound == pytest.approx(46.840, abs=1e-3)
    assert found.bound_here == pytest.approx(found.bound, rel=1e-6)
    few = PoseCloud(oracle.given[:4])
    least = []
    for q in hk.ik(found.strategy, found.q0).batch(few.given).q:
        postures = hk.strategies.self_motion_curve(task, q, limits=False).q
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


def test_a_designed_strategy_is_holonomic_and_as_regular_as_its_base(found: Design) -> None:
    """det [J; J_g] = det [J; J_phi]: zeta adds no singularity (theory 2e)."""
    assert hk.involutivity(found.strategy, hk.around(found.q0, 0.2)).holonomic
    for q in hk.around(found.q0, 0.3).sample(5):
        J = found.strategy.task.jacobian(q)
        ours, base = (np.linalg.det(np.vstack([J, law.rows(q)])) for law in (found.strategy, found.base))
        assert ours == pytest.approx(base, rel=1e-9)
        assert np.abs(found.strategy.rows(q) - found.base.rows(q)).max() > 1e-3


@pytest.mark.campaign
def test_a_design_survives_pickling(swift: Design) -> None:
    again = pickle.loads(pickle.dumps(swift))
    assert np.array_equal(again.strategy(swift.q0), swift.strategy(swift.q0))
    assert again.costs == swift.costs and again.bound == swift.bound


@pytest.mark.campaign
def test_a_design_says_the_same_after_pickling(swift: Design) -> None:
    """Each text looks for the least of other postures anew."""
    assert str(pickle.loads(pickle.dumps(swift))) == str(swift)
    assert swift.broken == 0 and "beyond hard limits" not in str(swift)


@pytest.mark.campaign
def test_exported_c_of_a_designed_strategy_is_python(found: Design, tmp_path: Path) -> None:
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
    limits = Limits(np.full(7, 0.3))  # violated at most of the poses
    search = search_of(task, space, base, Objective(**{name: 1.0}), limits)
    r, t = base.rows, len(search.section.terms)
    cost = search._augmented(r, t, np.zeros((8, 7)), 2.0)
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
def test_no_objective_is_below_its_bound_and_each_is_made_less(task: hk.Task, swift: Design, goal: str) -> None:
    every = Objective(1.0, 1.0)
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
        task, q0, margin = hk.pose(robot), READY, 0.5
        space = hk.workspace(box=([0.5, 0.05, 0.4], [0.05, 0.1, 0.05]), spin=1.5)
    else:
        task, q0, margin = hk.position(robot), np.array([0.3, 0.9, 0.7]), 1.9
        space = hk.workspace(box=(robot.pose(q0)[:3, 3], [0.3, 0.3, 0.0]))
    words = {"base": hk.lock(2), "degree": 1, "samples": 16 if arm == "planar-3r" else 48}
    free = hk.design(task, space, q0, **words)
    held = hk.design(task, space, q0, **words, margin=margin)

    def least_margin(d: Design, poses: np.ndarray) -> float:
        q = hk.ik(d.strategy, d.q0).batch(poses).q
        return float(np.minimum(q - task.robot.lower, task.robot.upper - q).min())

    checked = space.poses(192, seed=1)
    assert least_margin(free, checked) < margin <= least_margin(held, checked)
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
    fails(ArgumentError, "redundant joints is 0", lambda: hk.design(hk.pose(irb140), SMALL, np.full(6, 0.3)))
    fails(OutOfReachError, "", lambda: hk.design(task, hk.workspace(box=([2.0, 0, 0.3], [0.1, 0.1, 0.1])), READY))
    fails(UnknownNameError, "objective 'speed'", lambda: hk.design(task, SMALL, READY, objective="speed"))
    fails(ArgumentError, "give 0 to 4", lambda: hk.design(task, SMALL, READY, degree=5))
    fails(ArgumentError, "not all alike", lambda: hk.design(task, PoseCloud(SMALL.center[None]), READY))
    fails(ArgumentError, "positive weight", lambda: Objective())
    assert replace(Objective(1.0), joint_limits=2.0).weights == {"squared_speed": 1.0, "joint_limits": 2.0}


# --- Levels that serve a workspace: closed forms of a planar arm, inverse kinematics of a Panda.


def test_the_last_links_of_a_planar_arm_must_reach_the_farthest_corner(monkeypatch: pytest.MonkeyPatch) -> None:
    """Links of a metre, q3 = c: the last two are one of 2 cos(c / 2), so the tool reaches to 1 + 2 cos(c / 2)."""
    monkeypatch.setattr(nearby_cusps, "LEVEL_POSES", 32)
    law = hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(2))
    q0, space = np.array([0.3, 0.9, 0.7]), hk.workspace(box=([1.0, 2.0], [0.2, 0.2]))
    found = level_range(law, space, q0, limits=False, step=0.4)
    far = np.linalg.norm(space.poses(32)[:, :2, 3], axis=1).max()
    (interval,) = [ends for ends in found.intervals if ends[0] < 0.7 < ends[1]]
    assert interval[1] == pytest.approx(2 * np.arccos((far - 1) / 2), abs=4e-4)
    assert found.shares[np.abs(found.levels - 0.7).argmin()] == 1.0 and found.shares.min() < 1.0
    assert hk.coverage(law, space, found.q0, samples=32, limits=False).share == 1.0
    assert found.best == pytest.approx(law.constraint_value(found.q0)) and "serve all" in found.sentence


@pytest.mark.campaign
def test_a_panda_s_elbow_may_go_so_far_while_its_tool_works_in_a_box() -> None:
    """Referee: the leaf's own inverse kinematics, begun at postures that self-motion leads to."""
    robot, q0 = hk.load("panda"), np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    tool, law = robot.pose(q0), hk.holonomic(hk.pose(robot), hk.lock(2))
    space = hk.workspace(box=(tool[:3, 3], [0.1, 0.1, 0.1]), rotation=tool[:3, :3], tilt=0.1)
    found = level_range(law, space, q0, step=0.1)
    ((low, high),) = found.intervals
    assert low < found.level < high and found.cusps is not None
    for level, all_of_it in ((low + 0.02, True), (found.best, True), (high - 0.02, True), (high + 0.1, False)):
        moved = hk.motion.ik.move_to_leaf(law, q0, level)
        reached = hk.ik(law, moved, limits=True).batch(space.poses(256)).reached
        assert reached.all() == all_of_it


def test_where_a_closed_form_gives_the_postures_a_range_of_levels_ends_where_a_joint_is_at_its_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Joint 7 of a Panda held. Referee: the limits themselves, and the share of poses to both sides of each end."""
    monkeypatch.setattr(nearby_cusps, "LEVEL_POSES", 64)
    monkeypatch.setattr(nearby_cusps, "STARTS", 10)
    robot = hk.load("panda")
    law, tool = hk.holonomic(hk.pose(robot), hk.lock(6)), robot.pose(READY)
    space = hk.workspace(box=(tool[:3, 3], [0.05, 0.05, 0.05]), rotation=tool[:3, :3], tilt=0.3)
    found, ik = level_range(law, space, READY, step=0.2), hk.ik(law, READY)
    ((low, high),) = found.intervals
    for end, out in ((low, -1e-6), (high, 1e-6)):
        inside = ik.batch(space.poses(64), level=end)
        assert inside.reached.all() and not ik.batch(space.poses(64), level=end + out).reached.all()
        to_limit = np.minimum(inside.q - robot.lower, robot.upper - inside.q)
        assert np.abs(to_limit).min() < 1e-5


def test_a_range_of_levels_with_a_gap_narrower_than_a_step_is_two_ranges(monkeypatch: pytest.MonkeyPatch) -> None:
    """A joint of a Panda turns back on the self-motion of one pose; its limit is set 1e-5 rad before it does."""
    monkeypatch.setattr(nearby_cusps, "LEVEL_POSES", 4)
    monkeypatch.setattr(nearby_cusps, "STARTS", 10)
    robot = hk.load("panda")
    tool, levels = robot.pose(READY), np.linspace(0.3, 1.3, 4001)
    ik = hk.ik(hk.holonomic(hk.pose(robot), hk.lock(6)), READY)
    Q = np.array([ik(tool, level=c) for c in levels[::40]])
    joint, i = next((j, i) for j in range(6) for i in [int(Q[:, j].argmax())] if 5 < i < len(Q) - 5)
    fine = np.array([ik(tool, level=c)[joint] for c in levels[40 * i - 40 : 40 * i + 41]])
    turns_back, top = levels[40 * i - 40 + fine.argmax()], fine.max() - 1e-5
    limits = [replace(c, upper=top) if j == joint else c for j, c in enumerate(robot.coordinates)]
    narrow = replace(robot, coordinates=tuple(limits))
    law = hk.holonomic(hk.pose(narrow), hk.lock(6))
    q0 = ik(tool, level=turns_back + 0.27)
    space = hk.workspace(box=(tool[:3, 3], [1e-9, 1e-9, 1e-9]), rotation=tool[:3, :3])
    found = level_range(law, space, q0, step=0.2)
    assert (found.shares[np.abs(found.levels - turns_back) < 0.25] == 1.0).all()  # the levels tried do not see it
    before, after = sorted(found.intervals)[-2:]
    assert turns_back - 0.05 < before[1] < turns_back < after[0] < turns_back + 0.05
    for end in (before[1], after[0]):
        assert abs(ik(tool, level=end)[joint] - top) < 1e-6


@pytest.mark.campaign
def test_an_advice_tells_the_levels_of_its_best_law_if_it_is_asked() -> None:
    """Referee: inverse kinematics of that law, within the limits, begun on leaves inside and outside the interval."""
    bars = [{"a": 1.0, "lower": -2.6, "upper": 2.6, "max_velocity": 2.0} for _ in range(3)]
    space = hk.workspace(box=([1.2, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3))
    advice = hk.advise(hk.position(hk.from_dh(bars, name="planar")), space, levels=True)
    found, law = advice.levels, advice.best
    assert found is not None and f"{found.served}." in advice.reasons[-1]
    assert advice.to_dict()["levels"] == [list(ends) for ends in found.intervals]
    low, high = next(ends for ends in found.intervals if ends[0] <= found.best <= ends[1])
    for level, all_of_it in ((low + 0.02, True), (found.best, True), (high - 0.02, True), (high + 0.05, False)):
        moved = hk.motion.ik.move_to_leaf(law.strategy, law.q0, level)
        assert hk.ik(law.strategy, moved, limits=True).batch(space.poses(256)).reached.all() == all_of_it


def test_a_law_of_several_rows_is_refused_and_where_no_level_serves_all_the_best_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(nearby_cusps, "LEVEL_POSES", 32)
    arm = hk.load("planar-3r")
    with pytest.raises(ArgumentError, match="rows of the constraint"):
        level_range(hk.holonomic(hk.position(arm, rows=[0]), hk.lock(1, 2)), hk.workspace(box=([1, 1], [0.1, 0.1])),
                    [0.3, 0.9, 0.7])  # fmt: skip
    law = hk.holonomic(hk.position(arm), hk.lock(2))
    found = level_range(law, hk.workspace(box=([2.5, 2.5], [1.5, 1.5])), [0.3, 0.9, 0.7], limits=False, step=1.2)
    assert found.intervals == () and "no level serves all" in found.sentence and 0 < found.shares.max() < 1
