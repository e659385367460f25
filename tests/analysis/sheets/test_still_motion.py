"""Motions between two postures with the tool still, held against Pinocchio, closed forms and a search of a grid."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import holokin as hk
from conftest import PANDA_START, sampled
from holokin.analysis.sheets import Hindrance, self_motion_between
from holokin.analysis.sheets.still_motion import held, still_trajectory
from holokin.base.errors import ArgumentError, JointLimitError, NotFiniteError
from holokin.motion.checks import Clearances
from holokin.motion.ik import self_motion

STILL = 1e-9
"""What the tool may move [m, rad]."""

GRID = 2001
"""Angles of the first joint."""


def at_each_millisecond(task: hk.Task, motion: hk.analysis.sheets.StillMotion) -> np.ndarray:
    """The joints (k, n) of the motion, timed from rest to rest at 1 kHz."""
    pose = task.robot.pose(motion.q[0])
    timed = hk.retime(still_trajectory(task, pose, motion), profile="quintic", dt=0.001)
    assert (np.abs(timed.dq) <= task.robot.max_velocity * (1 + 1e-9)).all()
    assert ((timed.q >= task.robot.lower - 1e-9) & (timed.q <= task.robot.upper + 1e-9)).all()
    return timed.q


def planar(limit: float | tuple = np.inf, upper: tuple | None = None) -> hk.Task:
    low = -np.asarray(limit) if upper is None else limit
    return hk.position(hk.with_limits(hk.load("planar-3r"), lower=low, upper=limit if upper is None else upper))


def two_links(tool: np.ndarray, q1: np.ndarray, sign: float) -> np.ndarray:
    """q (k, 3) of three links of 1 m with their tool at a point, from q1 and the elbow's side; NaN if none."""
    x, y = tool[0] - np.cos(q1), tool[1] - np.sin(q1)
    with np.errstate(invalid="ignore"):
        q3 = sign * np.arccos((x**2 + y**2) / 2 - 1)
    q2 = np.arctan2(y, x) - np.arctan2(np.sin(q3), 1 + np.cos(q3)) - q1
    return np.column_stack([q1, (q2 + np.pi) % (2 * np.pi) - np.pi, q3])


@pytest.mark.parametrize("seed", range(3))
def test_the_tool_of_a_panda_is_still_at_each_millisecond_and_the_joints_keep_their_limits(seed: int) -> None:
    task = hk.pose(hk.load("panda"))
    model = pin.buildModelFromXML(hk.robot.to_urdf(task.robot))
    data, rng = model.createData(), np.random.default_rng(seed)
    q0 = PANDA_START + 0.2 * rng.standard_normal(7)
    curve = hk.strategies.self_motion_curve(task, q0)
    one, other = (curve.at(s) for s in rng.uniform(curve.s[0], curve.s[-1], 2))
    motion = self_motion_between(task, one, other)
    assert motion.hindrance is None
    Q = at_each_millisecond(task, motion)
    np.testing.assert_allclose(Q[[0, -1]], [one, other], atol=1e-12)
    assert len(Q) >= 1000 * motion.seconds
    frame, poses = model.nframes - 1, []
    for q in Q:
        pin.framesForwardKinematics(model, data, q)
        poses.append(data.oMf[frame].homogeneous)
    assert np.abs(np.array(poses) - poses[0]).max() < STILL


def test_a_posture_whose_tool_is_on_the_first_axis_turns_about_it() -> None:
    """Tool on the base: q1 is free, so a turn of it is a self-motion of 2 pi at pi rad/s, and one of q2 is none."""
    task, q = planar(), np.array([0.4, 2 * np.pi / 3, 2 * np.pi / 3])
    for turns in (1, -1, 3):
        motion = self_motion_between(task, q, q + [2 * np.pi * turns, 0, 0])
        assert motion.hindrance is None
        assert motion.seconds == pytest.approx(2 * abs(turns), rel=1e-9)
        np.testing.assert_allclose(motion.q[:, 1:], np.tile(q[1:], (len(motion.q), 1)), atol=1e-12)
    assert self_motion_between(task, q, q + [0, 2 * np.pi, 0]).hindrance is Hindrance.TURNS
    near = self_motion_between(task, q, q + [0.3, 0, 0])
    assert near.seconds == pytest.approx(0.3 / np.pi, rel=1e-9)
    tight = planar((2 * np.pi + 0.3, 3.0, 3.0))
    assert self_motion_between(tight, q, q - [2 * np.pi, 0, 0]).hindrance is None
    assert self_motion_between(planar(5.0), q, q - [4.5, 0, 0]).hindrance is None
    assert self_motion_between(planar((1.0, 3.0, 3.0)), q, q).seconds == 0


def test_both_ways_round_are_known_and_the_faster_one_is_taken() -> None:
    """On a closed self-motion the short way and, where that is blocked, the long way make up one round."""
    task, tool = planar(), np.array([1.5, 0.0])
    a, b = two_links(tool, np.array([-0.4, 0.3]), 1.0)
    short = self_motion_between(task, a, b)
    there = short.q[len(short.q) // 2]
    long = self_motion_between(task, a, b, lambda Q: np.abs(Q - there).max(axis=1) > 0.02)
    assert long.hindrance is None
    assert long.seconds > short.seconds
    for motion in (short, long):
        angles = np.cumsum(motion.q, axis=1)
        tools = np.stack([np.cos(angles).sum(axis=1), np.sin(angles).sum(axis=1)], axis=1)
        assert np.abs(tools - tool).max() < STILL
    every = np.vstack([two_links(tool, np.linspace(-np.pi, np.pi, 20001), side) for side in (1.0, -1.0)])
    every = every[np.isfinite(every).all(axis=1)]
    nearest = [np.linalg.norm(np.vstack([short.q, long.q]) - q, axis=1).min() for q in every[::50]]
    assert max(nearest) < 0.1  # together they pass every posture of the tool's pose
    blocked = self_motion_between(task, a, b, lambda Q: np.zeros(len(Q), dtype=bool))
    assert blocked.hindrance is Hindrance.BLOCKED


@settings(deadline=None)
@given(
    st.floats(0.3, 2.7), st.floats(-3, 3), st.floats(-3, 3), st.sampled_from([1.0, -1.0]), st.floats(1.0, 3.1),
    st.floats(1.5, 3.1), st.floats(1.5, 3.1),
)  # fmt: skip
def test_there_is_a_motion_exactly_where_a_grid_of_all_postures_is_connected(
    d: float, one: float, other: float, side: float, l1: float, l2: float, l3: float
) -> None:
    """A posture is q1 and the elbow's side: a fine grid within the limits, joined at folds, is the referee."""
    limits, tool = np.array([l1, l2, l3]), np.array([d, 0.0])
    a, b = two_links(tool, np.array([one]), 1.0)[0], two_links(tool, np.array([other]), side)[0]
    if not (np.isfinite([a, b]).all() and (np.abs([a, b]) < limits - 0.02).all()):
        return
    answers = {joined(tool, limits + grow, a, b) for grow in (-0.01, 0.01)}
    if len(answers) > 1 or abs(d - 1) < 0.05:  # on the edge, the grid does not tell
        return
    motion = self_motion_between(planar(tuple(limits)), a, b)
    assert (motion.hindrance is None) == answers.pop(), motion.hindrance
    if len(motion.q) > 1:
        assert (np.abs(at_each_millisecond(planar(tuple(limits)), motion)) <= limits + 1e-9).all()


def joined(tool: np.ndarray, limits: np.ndarray, a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two postures are connected among all of a fine grid, with joints within +-limits."""
    k, grid = GRID, np.linspace(-np.pi, np.pi, GRID)
    Q = np.vstack([two_links(tool, grid, side) for side in (1.0, -1.0)])
    good = (np.abs(np.where(np.isfinite(Q), Q, 9.0)) <= limits).all(axis=1)
    pairs = np.array([*((i, i + 1) for i in range(2 * k - 1) if i != k - 1), *((i, i + k) for i in range(k))])
    gap = np.abs(Q[pairs[:, 0]] - Q[pairs[:, 1]]).max(axis=1)
    edges = pairs[good[pairs].all(axis=1) & (gap < 0.3)]
    matrix = coo_matrix((np.ones(len(edges)), tuple(edges.T)), shape=(2 * k, 2 * k))
    part = connected_components(matrix, directed=False)[1]
    ends = [np.argmin(np.where(good, np.abs(Q - q).max(axis=1), np.inf)) for q in (a, b)]
    return bool(part[ends[0]] == part[ends[1]])


def arcs_of(name: str, count: int, seed: int, clear: object = None) -> list:
    """(task, two arcs of a random pose of an arm, half of the time of one curve, a place on each)."""
    task, rng = hk.pose(hk.load(name)), np.random.default_rng(seed)
    draws = []
    while len(draws) < count:
        found = self_motion(task, task.robot.pose(rng.uniform(task.robot.lower, task.robot.upper)), clear=clear)
        if not found.arcs:
            continue
        one = found.arcs[rng.integers(len(found.arcs))]
        other = rng.choice(np.flatnonzero([arc.curve == one.curve for arc in found.arcs]), 1)[0]
        other = found.arcs[other if rng.random() < 0.5 else rng.integers(len(found.arcs))]
        draws.append((task, one, other, *(float(rng.uniform(0.02, 0.98) * arc.length) for arc in (one, other))))
    return draws


@pytest.mark.parametrize(
    ("name", "count", "scene"),
    [
        *[("panda", 16, False), ("panda", 6, True)],
        *(pytest.param(*case, marks=pytest.mark.campaign) for case in product(("panda", "fr3"), (200,), (False, True))),
    ],
)
def test_there_is_a_motion_where_one_arc_of_the_closed_form_has_both_postures(
    name: str, count: int, scene: bool
) -> None:
    """The arcs are of a closed form that follows no curve; what ends a motion at a limit is an end of its arc."""

    def clear(q: np.ndarray) -> np.ndarray:
        return 0.5 * np.sin(q[:, 3]) + np.cos(q[:, 0] + q[:, 4]) < 0.6

    met = set()
    for task, one, other, s, t in arcs_of(name, count, 1 + scene, clear if scene else None):
        motion = self_motion_between(task, one.at(s), other.at(t), clear if scene else None)
        met.add(motion.hindrance)
        ways = [np.linspace(s, t, 200)] if one is other else []
        if one is other and one.closed:
            ways.append((min(s, t) - np.linspace(0, one.length - abs(s - t), 200)) % one.length)
        free = any(not scene or clear(one.at(way)).all() for way in ways)
        if motion.hindrance is Hindrance.SINGULAR:  # refused: an arc that is nearly so
            sigma = np.linalg.svd(task.jacobian_batch(one.q)[0], compute_uv=False)
            assert (sigma[:, -1] / sigma[:, 0]).min() < 0.005
        elif motion.hindrance is not Hindrance.TURNS:  # of hinges: arcs are of any turn within the limits
            assert (motion.hindrance is None) == free, motion
        if motion.hindrance is Hindrance.LIMITS and not scene:
            assert set(motion.ends) <= {str(end) for end in one.ends}
            assert set(motion.ends) >= {end for end in map(str, one.ends) if one.ends[0] == one.ends[1]}
            assert all(end in str(motion) for end in motion.ends)
    assert met >= {None, Hindrance.BLOCKED if scene else Hindrance.LIMITS}


def test_a_post_that_blocks_both_ways_round_is_named() -> None:
    """The first link has to pass it on either way: at 1 m from the base, where the elbow is half way."""
    task, tool = planar(), np.array([1.5, 0.0])
    a, b = two_links(tool, np.array([-0.4, 0.3]), 1.0)
    elbow = np.cumsum(self_motion_between(task, a, b).q, axis=1)[::-1][0, 0] - 0.35
    pole = hk.obstacle("pole", hk.robot.Box((0.02, 0.02, 0.02)), (np.cos(elbow), np.sin(elbow), 0.0))
    scene = Clearances.of(task.robot, hk.Scene([pole], self_collision=False))
    motion = self_motion_between(task, a, b, scene)
    assert motion.hindrance is Hindrance.BLOCKED
    assert "and pole" in motion.reason
    assert self_motion_between(task, a, b, scene.clear).hindrance is Hindrance.BLOCKED


@sampled(1, "reach", [2.9933, 2.998, 2.999])
def test_next_to_the_edge_of_reach_the_shorter_way_round_a_small_self_motion_is_taken(reach: float) -> None:
    """It bends within a step of 0.2; a grid of all postures gives its length."""
    up, down = (two_links(np.array([reach, 0.0]), np.linspace(-0.3, 0.3, 40001), side) for side in (1.0, -1.0))
    whole = np.vstack([up[np.isfinite(up[:, 1])], down[np.isfinite(down[:, 1])][::-1]])
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(whole, axis=0), axis=1)))
    for i, j in combinations(np.linspace(0, len(whole) - 1, 6).astype(int)[:-1].tolist(), 2):
        motion = self_motion_between(planar(), whole[i], whole[j])
        length = np.linalg.norm(np.diff(motion.q, axis=0), axis=1).sum()
        assert length == pytest.approx(min(s[j] - s[i], s[-1] - s[j] + s[i]), abs=0.02)


def test_where_ik_changes_its_sheet_a_self_motion_leads_to_the_new_one() -> None:
    """A Panda of `hk.ik` moves its tool until `near` changes: there it takes the new sheet, the tool at rest."""
    ik, robot = hk.ik("panda"), hk.load("panda")
    pose = robot.pose([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    q, own, way = ik(pose), ik.sheet(pose), np.array([0.0, 0.01, 0.0])
    while True:
        ahead = pose.copy()
        ahead[:3, 3] += way
        new = ik.near(ahead, q)
        if new.changed:
            break
        pose, q = ahead, new.q
    other = ik.near(pose, new.q)
    assert (other.sheet, other.changed) == (new.sheet, False)
    assert other.sheet != own
    motion = self_motion_between(ik.task, q, other.q)
    np.testing.assert_allclose(motion.q[[0, -1]], [q, other.q], atol=1e-12)
    assert np.abs(at_each_millisecond(ik.task, motion) - q).max() > 0.1


def test_the_mirror_posture_is_on_another_self_motion_near_the_base_and_on_the_same_far_from_it() -> None:
    """Four bars of 1, 1, 1, d: below d = 1 the elbow never crosses over (Grashof), above 1 it does."""
    for d, why in ((0.5, Hindrance.APART), (1.5, None)):
        a = two_links(np.array([d, 0.0]), np.array([1.2]), 1.0)[0]
        assert self_motion_between(planar(), a, -a).hindrance is why
    assert self_motion_between(planar(tuple(np.abs(a) + 0.05)), a, -a).hindrance is Hindrance.LIMITS


def test_postures_at_both_ends_of_a_joint_s_range_are_joined() -> None:
    """From the lower limit of q1 to the upper one: the motion begins and ends at limits, and exceeds neither."""
    a, b = two_links(np.array([1.5, 0.0]), np.array([-0.4, 0.3]), 1.0)
    task = planar((-0.4, -np.pi, -np.pi), (0.3, np.pi, np.pi))
    motion = self_motion_between(task, a, b)
    assert motion.hindrance is None
    Q = at_each_millisecond(task, motion)
    np.testing.assert_allclose([Q[0], Q[-1]], [a, b], atol=1e-12)


def test_a_singular_posture_is_told() -> None:
    """Folded onto the line to its tool at 1 m, the arm can go on in two ways: the self-motion branches."""
    folded = np.array([0.0, np.pi, -np.pi])
    a = two_links(np.array([1.0, 0.0]), np.array([1.0]), 1.0)[0]
    assert self_motion_between(planar(), folded, a).hindrance is Hindrance.SINGULAR
    back = self_motion_between(planar(), a, folded * [1, -1, -1])  # with q2 = -pi it goes straight into it
    assert back.hindrance in (None, Hindrance.SINGULAR)
    for q in back.q:
        assert abs(np.exp(1j * np.cumsum(q)).sum() - 1) < STILL
    assert self_motion_between(planar(), folded, folded).seconds == 0


def test_an_arm_without_a_redundant_joint_has_none() -> None:
    task = hk.pose(hk.load("ur5e"))
    q = np.array([0.3, -1.2, 1.5, -0.8, -1.3, 0.2])
    assert self_motion_between(task, q, q).seconds == 0
    turned = q - [0, 0, 0, 0, 0, 2 * np.pi]
    assert self_motion_between(task, q, turned).hindrance is Hindrance.NOT_REDUNDANT


def test_several_redundant_joints_go_straight_where_they_can() -> None:
    """A Panda that holds a point has four: Pinocchio sees the point still; where all is blocked none is found."""
    task = hk.position(hk.load("panda"))
    model = pin.buildModelFromXML(hk.robot.to_urdf(task.robot))
    data, rng = model.createData(), np.random.default_rng(1)
    other = (PANDA_START + 0.4 * rng.standard_normal(7))[None]
    for _ in range(3):
        other = held(task, other, *task._place(PANDA_START))
    other = other[0]
    motion = self_motion_between(task, PANDA_START, other)
    points = []
    for q in at_each_millisecond(task, motion):
        pin.framesForwardKinematics(model, data, q)
        points.append(data.oMf[model.nframes - 1].translation.copy())
    assert np.abs(np.array(points) - points[0]).max() < STILL
    none = self_motion_between(task, PANDA_START, other, lambda Q: np.zeros(len(Q), dtype=bool))
    assert none.hindrance is Hindrance.NOT_FOUND
    assert "does not prove" in none.hindrance.text


def test_postures_of_two_poses_and_bad_ones_are_refused() -> None:
    task = planar(3.0)
    q = np.array([0.3, 0.9, 0.7])
    with pytest.raises(ArgumentError, match="two postures of one pose"):
        self_motion_between(task, q, q + 0.1)
    with pytest.raises(JointLimitError):
        self_motion_between(task, q, q + [2 * np.pi, 0, 0])
    with pytest.raises(NotFiniteError):
        self_motion_between(task, q, [np.nan, 0, 0])
