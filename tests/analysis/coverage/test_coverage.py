"""Coverage of a workspace by one leaf: a planar arm whose reach, leaf and limits are circles, and a Panda."""

from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import IIWA_START, PANDA_START, fails
from holokin.analysis.coverage import Coverage, PoseStatus, coverage_slices, posture_reach
from holokin.analysis.design import advice_case
from holokin.base.errors import ArgumentError, JointLimitError, NotFiniteError, OutOfReachError, ShapeError
from holokin.motion.self_motions.least_squares import nearest_postures
from holokin.strategies import HolonomicStrategy

LINKS = (0.5, 0.4, 0.3)
LOCKED, UPPER, LEAST = 0.9, 1.6, 0.6
"""Joint 3 on the leaf; the upper limit of joint 2; the lower one of joint 3."""
CENTER, RADIUS = np.array([0.75, 0.2]), 0.45
DISC = hk.workspace(cylinder=(CENTER, RADIUS, 0))
START = np.array([-0.4, 1.0, LOCKED])


@pytest.fixture(scope="module")
def law() -> HolonomicStrategy:
    rows = [
        {"a": LINKS[0]},
        {"a": LINKS[1], "lower": -2.0, "upper": UPPER},
        {"a": LINKS[2], "lower": LEAST, "upper": 2.5},
    ]
    return hk.holonomic(hk.position(hk.from_dh(rows)), hk.lock(2))


def forearm(q3: float) -> tuple[float, float]:
    """(length, angle) of the two outer links with joint 3 at q3."""
    vector = LINKS[1] + LINKS[2] * np.exp(1j * q3)
    return abs(vector), float(np.angle(vector))


def circles() -> tuple[float, float, float, float]:
    """Distances from the base: where joint 2 meets its limit on the leaf, where the leaf ends, the arm within limits
    (joint 3 as straight as it may be, joint 2 free to straighten the rest), the arm."""
    length, angle = forearm(LOCKED)
    limit = abs(LINKS[0] + length * np.exp(1j * (UPPER + angle)))
    return limit, LINKS[0] + length, LINKS[0] + forearm(LEAST)[0], sum(LINKS)


def lens(reach: float) -> float:
    """Area of the disc that lies within a distance of the base."""
    d, r, R = float(np.linalg.norm(CENTER)), RADIUS, reach
    a = np.arccos((d * d + r * r - R * R) / (2 * d * r))
    b = np.arccos((d * d + R * R - r * r) / (2 * d * R))
    return r * r * (a - np.sin(2 * a) / 2) + R * R * (b - np.sin(2 * b) / 2)


def expected(distance: np.ndarray, limits: bool = True) -> np.ndarray:
    limit, leaf, within, arm = circles()
    status = np.full(distance.shape, int(PoseStatus.OUT_OF_REACH))
    status[distance < arm] = PoseStatus.BEYOND_LIMITS if limits else PoseStatus.ALGORITHMIC
    status[distance < within] = PoseStatus.ALGORITHMIC
    status[distance < leaf] = PoseStatus.REACHED
    if limits:
        status[distance < limit] = PoseStatus.LIMIT
    return status


@pytest.fixture(scope="module")
def covered(law: HolonomicStrategy) -> Coverage:
    return hk.coverage(law, DISC, START, samples=1024)


def test_each_pose_of_a_planar_arm_has_the_cause_that_its_distance_from_the_base_says(covered: Coverage) -> None:
    distance = np.linalg.norm(covered.poses[:, :2, 3], axis=1)
    assert np.array_equal(covered.status, expected(distance))
    assert {int(s) for s in covered.status} == {0, 1, 2, 6, 7}


def test_the_share_of_a_disc_that_a_locked_arm_reaches_is_an_area_between_two_circles(covered: Coverage) -> None:
    limit, leaf, within, _ = circles()
    area = np.pi * RADIUS**2
    assert covered.share == pytest.approx((lens(leaf) - lens(limit)) / area, abs=4e-3)
    assert covered.reachable == pytest.approx(lens(within) / area, abs=4e-3)


def test_joints_margins_and_rcond_are_those_of_the_elbow_in_closed_form(covered: Coverage, law) -> None:
    """The law of cosines gives the elbow; [J; J_g] has the determinant l1 L sin(elbow), zero where the leaf ends."""
    length, angle = forearm(LOCKED)
    known = np.isfinite(covered.q).all(axis=1)
    r = np.linalg.norm(covered.poses[known, :2, 3], axis=1)
    elbow = np.arccos((r**2 - LINKS[0] ** 2 - length**2) / (2 * LINKS[0] * length))
    q2 = elbow - angle
    assert np.allclose(covered.q[known, 1], q2, atol=1e-9)
    assert np.allclose(covered.margins[known, 1], np.minimum(q2 + 2, UPPER - q2), atol=1e-9)
    assert np.allclose(covered.margins[known, 2], LOCKED - LEAST, atol=1e-12)
    assert np.isinf(covered.margins[known, 0]).all()
    sine = np.sin(elbow)
    assert covered.rcond[known][np.argsort(sine)][:5].max() < np.quantile(covered.rcond[known], 0.05)
    for q, rcond in zip(covered.q[known][:20], covered.rcond[known], strict=False):
        stacked = np.vstack([law.task.jacobian(q), [0, 0, 1]])
        assert abs(np.linalg.det(stacked)) == pytest.approx(LINKS[0] * length * np.sin(q[1] + angle), rel=1e-9)
        assert 1 / np.linalg.cond(stacked) < 3 * rcond < 30 / np.linalg.cond(stacked)
    assert np.isnan(covered.rcond[~known]).all()


def test_poses_beyond_a_limit_are_counted_with_the_joint_and_the_side(covered: Coverage) -> None:
    assert covered.at_limits() == {("q2", "upper"): covered.count(PoseStatus.LIMIT)}
    assert sum(k for _, k in covered.causes()) == len(covered) == 1024
    text = str(covered)
    assert f"({covered.share:5.1%})  reached" in text
    assert "q2 is beyond its upper limit" in text


def test_without_limits_the_leaf_ends_only_where_it_is_singular(law: HolonomicStrategy) -> None:
    free = hk.coverage(law, DISC, START, samples=256, limits=False)
    assert np.array_equal(free.status, expected(np.linalg.norm(free.poses[:, :2, 3], axis=1), limits=False))


def test_without_a_search_no_pose_is_called_out_of_reach_and_the_share_is_the_same(law, covered) -> None:
    quick = hk.coverage(law, DISC, START, samples=1024, explain=False)
    assert quick.share == covered.share
    assert quick.status.max() <= PoseStatus.STOPPED
    assert "any posture" not in quick.sentence
    assert quick.turn == 0 and not quick.remark  # the task leaves the orientation free


def test_a_reach_found_before_gives_the_same_causes(law: HolonomicStrategy, covered: Coverage) -> None:
    reach = posture_reach(law.task, DISC, START, samples=1024)
    assert np.array_equal(hk.coverage(law, DISC, START, samples=1024, reach=reach).status, covered.status)
    fails(ShapeError, "that of the same poses", lambda: hk.coverage(law, DISC, START, samples=64, reach=reach))


def test_a_slice_has_the_same_circles_and_is_empty_outside_the_disc(law: HolonomicStrategy) -> None:
    (part,) = coverage_slices(law, DISC, START, steps=20)
    x, y = np.meshgrid(part.u, part.v)
    inside = np.hypot(x - CENTER[0], y - CENTER[1]) <= RADIUS
    assert np.array_equal(part.inside, inside)
    cells = part.grid(part.coverage.status)
    assert np.array_equal(cells[inside], expected(np.hypot(x, y)[inside]))
    assert np.isnan(cells[~inside]).all()


@pytest.mark.campaign
def test_a_slice_shows_where_inverse_kinematics_jumps() -> None:
    """A Panda with its arm angle kept. Referee: small Newton steps from a posture to the next cell."""
    robot, q0 = hk.load("panda"), np.array([0.0, 0.4, 0.2, -1.8, 0.1, 2.2, 0.8])
    law, tool = hk.holonomic(hk.pose(robot), hk.arm_angle()), robot.pose(q0)
    space = hk.workspace(box=([0.3, 0.2, 0.5], [0.4, 0.4, 0.0]), rotation=tool[:3, :3])
    (part,) = coverage_slices(law, space, q0, steps=16, limits=False)
    cuts, found = {tuple(pair) for pair in part.cuts.tolist()}, part.coverage
    place, level = part.grid(np.arange(len(found))), law.constraint_value(q0)
    sides = (place[:, :-1], place[:, 1:]), (place[:-1], place[1:])
    pairs = np.concatenate([np.column_stack([a.ravel(), b.ravel()]) for a, b in sides]).astype(int)
    far = [(i, j) for i, j in pairs.tolist() if np.abs(found.q[i] - found.q[j]).max() > 0.3]
    assert len(cuts) > 5 and len(set(far) - cuts) > 5
    for i, j in [*sorted(cuts)[::3], *sorted(set(far) - cuts)[::5]]:
        q = found.q[i].copy()
        for s in np.linspace(0, 1, 201)[1:]:
            p = (1 - s) * found.poses[i, :3, 3] + s * found.poses[j, :3, 3]
            off = law.constraint.nearest(level - law.constraint_value(q))
            gap = np.append(law.task.error(q, p, tool[:3, :3]), off)
            q = q + np.linalg.solve(np.vstack([law.task.jacobian(q), law.rows(q)]), gap)
        assert ((i, j) in cuts) is not bool(np.abs(q - found.q[j]).max() < 1e-2)


def test_the_nearest_posture_to_a_target_beyond_the_limits_is_as_straight_as_they_let_it_be(
    law: HolonomicStrategy,
) -> None:
    """Straight out from the base the distance that is left is that to the circle of the arm, or of its limits."""
    _, _, within, arm = circles()
    targets = np.array([[1.25, 0, 0], [1.5, 0, 0], [3.0, 0, 0]])
    begin = np.tile(START, (3, 1))
    for limits, reach in ((True, within), (False, arm)):
        found = nearest_postures(law.task, targets, np.tile(np.eye(3), (3, 1, 1)), begin, limits=limits)
        assert found.missing == pytest.approx(targets[:, 0] - reach, rel=2e-3)
        assert found.ended.all()
        assert not found.reached.any()


def test_a_workspace_out_of_reach_altogether_has_the_share_0_and_says_so(law: HolonomicStrategy) -> None:
    far = hk.coverage(law, hk.workspace(box=([5, 5], [1, 1])), START, samples=32)
    assert far.share == far.reachable == 0
    assert far.causes() == [(PoseStatus.OUT_OF_REACH.text, 32)]
    assert "none of the 0 for which a posture was found" in far.sentence


def test_the_elbow_of_an_iiwa_is_in_the_way_by_what_the_law_of_cosines_says(iiwa14: hk.Robot, monkeypatch) -> None:
    """Near the base the elbow has to bend more than its limit: by how much, the distance from shoulder to wrist tells.

    Coverage, advice and sheets all name it.
    """
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # for so few poses no compiler
    monkeypatch.setattr(advice_case, "POSES", 32)
    wide = [replace(c, lower=-3.2, upper=3.2) for c in iiwa14.coordinates]
    wide[3] = replace(wide[3], lower=-1.45, upper=1.45)
    robot = replace(iiwa14, coordinates=tuple(wide))
    tool, task = robot.pose(IIWA_START), hk.pose(robot)
    space = hk.workspace(sphere=(tool[:3, 3] - [0.2, 0.0, 0.0], 0.05), rotation=tool[:3, :3])
    found = hk.coverage(hk.holonomic(task, hk.lock(2)), space, IIWA_START, samples=16)
    wrist = found.poses[:, :3, 3] - 0.126 * found.poses[:, :3, 2]
    away = np.linalg.norm(wrist - [0, 0, 0.36], axis=1)
    bend = np.arccos((away**2 - 0.42**2 - 0.4**2) / (2 * 0.42 * 0.4)) - 1.45
    assert found.count(PoseStatus.BEYOND_LIMITS) == len(found) and found.reach is not None
    assert found.reach.beyond == pytest.approx(bend, abs=1e-6)
    told = (
        f"every posture is beyond the joint limits: {robot.joint_names[3]} by {bend.min():.2g} to {bend.max():.2g} rad"
    )
    assert found.causes() == [(f"{told} at best", 16)]
    assert "none of the 0 that the arm reaches" in found.sentence
    near = f"every posture is beyond the joint limits: {robot.joint_names[3]} by "
    fails(OutOfReachError, near, lambda: hk.advise(task, space, q0=IIWA_START))
    fails(OutOfReachError, near, lambda: hk.sheets(task, space, samples=16))


def test_a_position_task_does_not_look_at_the_rotations(law: HolonomicStrategy, covered: Coverage) -> None:
    turned = hk.workspace(cylinder=(CENTER, RADIUS, 0), rotation=np.eye(3), tilt=1.0, spin=1.0)
    other = hk.coverage(law, turned, START, samples=1024)
    assert np.array_equal(other.status, covered.status)
    assert np.allclose(other.q, covered.q, atol=1e-12, equal_nan=True)


def test_the_pose_task_of_a_planar_arm_asks_for_rotations_in_its_plane() -> None:
    robot = hk.from_dh([{"a": a} for a in (0.5, 0.4, 0.3, 0.2)])
    law, start = hk.holonomic(hk.pose(robot), hk.linear([1, -1, 0, 0])), [0.4, 0.5, -0.9, 0.6]
    place = robot.pose(start)[:2, 3]
    with pytest.raises(ArgumentError, match=r"give rotation=np.eye\(3\)"):
        hk.coverage(law, hk.workspace(box=(place, [0.05, 0.05])), start, samples=8)
    R = robot.pose(start)[:3, :3]
    turning = hk.workspace(box=(place, [0.02, 0.02]), rotation=R, spin=0.2)
    found = hk.coverage(law, turning, start, samples=64)
    assert found.share == 1.0
    for q, pose in zip(found.q, found.poses, strict=True):
        assert np.allclose(robot.pose(q), pose, atol=1e-8)


def test_a_file_of_coverage_is_a_workspace_again(law: HolonomicStrategy, covered: Coverage, tmp_path: Path) -> None:
    covered.save(tmp_path / "covered.csv")
    again = hk.coverage(law, hk.path.read_workspace(tmp_path / "covered.csv"), START)
    assert np.array_equal(again.status, covered.status)
    lines = (tmp_path / "covered.csv").read_text("utf-8").splitlines()
    assert lines[0] == "x,y,z,qx,qy,qz,qw,status,q1,q2,q3,rcond,margin"
    assert [line.split(",")[7] for line in lines[1:]] == [PoseStatus(s).name.lower() for s in covered.status]


def test_coverage_can_be_pickled(covered: Coverage) -> None:
    again = pickle.loads(pickle.dumps(covered))
    assert str(again) == str(covered)


def test_a_start_or_strategy_that_is_none_is_refused(law: HolonomicStrategy) -> None:
    fails(JointLimitError, "q2", lambda: hk.coverage(law, DISC, [0, 2.0, LOCKED], samples=8))
    fails(NotFiniteError, "", lambda: hk.coverage(law, DISC, [0, np.nan, LOCKED], samples=8))
    with pytest.raises(ArgumentError, match="a strategy with leaves"):
        hk.coverage(hk.moore_penrose(law.task), DISC, START, samples=8)
    fails(ArgumentError, "whole number", lambda: hk.coverage(law, DISC, START, samples=0))


@pytest.mark.campaign
def test_a_leaf_of_a_panda_reaches_nearly_all_that_the_arm_does(panda: hk.Robot) -> None:
    """The box of docs/choose.md: of 400 random poses 343 within limits, of 358 that any posture reached."""
    box = hk.workspace(box=([0.5, 0, 0.3], [0.25, 0.4, 0.3]), tilt=np.radians(40), spin=np.radians(90))
    ready = [0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4]
    found = hk.coverage(hk.holonomic(hk.pose(panda), hk.lock(2)), box, ready, samples=128)
    assert found.share == pytest.approx(343 / 400, abs=0.03)
    assert found.reachable == pytest.approx(358 / 400, abs=0.03)
    for q, pose in zip(found.q[found.reached], found.poses[found.reached], strict=True):
        assert np.allclose(panda.pose(q), pose, atol=1e-8)
        panda.check_limits(q)


def test_a_middle_orientation_far_from_the_tool_at_the_start_is_told(panda: hk.Robot, monkeypatch) -> None:
    """A box round the tool at the start, its middle orientation turned by 2.5 rad: the wrist cannot follow."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # for four poses no compiler
    law, at = hk.holonomic(hk.pose(panda), hk.lock(2)), panda.pose(PANDA_START)
    R = at[:3, :3] @ Rotation.from_rotvec([0, 2.5, 0]).as_matrix()
    turned = hk.workspace(sphere=(at[:3, 3], 0.02), rotation=R)
    found = hk.coverage(law, turned, PANDA_START, samples=4, explain=False)
    assert found.turn == pytest.approx(2.5)
    assert not found.reached.all()
    assert str(found).endswith(found.remark) and "is 143 degrees from the tool at the start" in found.remark
    like = hk.workspace(sphere=(at[:3, 3], 0.02), rotation=panda.pose(PANDA_START)[:3, :3])  # as it advises
    near = hk.coverage(law, like, PANDA_START, samples=4, explain=False)
    assert near.share == 1 and near.turn == pytest.approx(0, abs=1e-7) and not near.remark


@pytest.mark.campaign
def test_an_arm_angle_at_zero_cannot_pass_where_its_upper_arm_is_upright(panda: hk.Robot, monkeypatch) -> None:
    """With joint 2 at 0 the axes of joints 1 and 3 are one: turning them against each other moves neither tool nor
    elbow. Beside that place [J; J_g] is regular on this leaf, since two sheets of it cross there."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")  # for four poses no compiler
    law = hk.holonomic(hk.pose(panda), hk.arm_angle(definition="conventional"))
    ready = np.array([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
    behind = panda.pose([0, 0.3, 0, -1.6, 0, 1.9, np.pi / 4])
    cloud = hk.workspace(sphere=(behind[:3, 3], 1e-3), rotation=behind[:3, :3])
    found = hk.coverage(law, cloud, ready, samples=4)
    assert found.count(PoseStatus.ALGORITHMIC) == 4
    assert np.abs(found.last[:, 1]).max() < 1e-6
