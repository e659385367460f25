"""`ik.nearest`: the nearest pose at the edge of reach; by closed forms, by its neighbours, on moving hands."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import IIWA_START, PANDA_START, PPR_START, R3_START, campaign, sampled
from holokin.base.errors import ArgumentError, JointLimitError, NotFiniteError, ShapeError
from holokin.motion.ik import InverseStatus, Nearest
from holokin.motion.ik.inverse_function import LEAST

REACHED, CLAMPED = InverseStatus.REACHED, InverseStatus.CLAMPED
LENGTH, MARGIN = 0.3, 0.1
BETWEEN = np.array([0.3, 0.9, 0.0])
"""A planar arm whose last joint is locked at 0: two links, of 1 and 2 m."""


@pytest.fixture
def two_links(monkeypatch: pytest.MonkeyPatch, planar_3r: hk.Robot) -> hk.motion.ik.InverseKinematics:
    """An arm of links 1 and 2 m long, the last two of a planar 3R in line, on the virtual machine."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    return hk.ik(hk.holonomic(hk.position(planar_3r), hk.lock(2)), BETWEEN, limits=False)


@pytest.fixture(scope="module")
def ik(panda: hk.Robot) -> hk.motion.ik.InverseKinematics:
    return hk.ik(hk.holonomic(hk.pose(panda), hk.lock(2)), PANDA_START, limits=False)


def shifted(robot: hk.Robot, start: np.ndarray, by: list[float], turn: float = 0.0) -> np.ndarray:
    """The tool pose at a start, moved, and turned about its own x axis."""
    pose = robot.pose(start)
    pose[:3, 3] += by
    c, s = np.cos(turn), np.sin(turn)
    pose[:3, :3] = pose[:3, :3] @ [[1, 0, 0], [0, c, -s], [0, s, c]]
    return pose


def rcond_of(G: hk.Strategy, q: np.ndarray) -> float:
    """m / (|J| |G|), with angles in units of LENGTH, from the public functions."""
    scale = np.array([1.0 if unit == "m" else LENGTH for unit in G.task.units])
    return G.task.m / np.linalg.norm(scale[:, None] * G.task.jacobian(q)) / np.linalg.norm(G(q) / scale)


def missing(robot: hk.Robot, q: np.ndarray, pose: np.ndarray) -> float:
    """The distance [m] of the tool at q from a pose, by the angle of the rotation between them."""
    T = robot.pose(q)
    angle = np.arccos(np.clip((np.trace(T[:3, :3].T @ pose[:3, :3]) - 1) / 2, -1, 1))
    return float(np.hypot(np.linalg.norm(T[:3, 3] - pose[:3, 3]), LENGTH * angle))


def edge_of_two_links(nearly: float) -> float:
    """The distance from the base at which an arm of 1 and 2 m has rcond = 2 / |J| |G| = MARGIN, near an elbow angle."""

    def excess(elbow: float) -> float:
        square = 1 + 2 * 2**2 + 4 * np.cos(elbow)  # |J|^2 of the two joints that move; the third one adds 1
        return 2 * 2 * np.sin(elbow) / np.sqrt(square * (square + 1)) - MARGIN

    elbow = brentq(excess, *((1e-3, 1.0) if nearly < 1 else (2.5, np.pi - 1e-3)))
    return float(np.sqrt(1 + 4 + 4 * np.cos(elbow)))


@pytest.mark.parametrize(("far", "elbow"), [(3.5, 0.0), (30.0, 0.0), (0.9, 3.0), (0.3, 3.0)])
def test_two_links_reach_for_a_point_along_its_radius_and_stop_at_the_margin(
    two_links, far: float, elbow: float
) -> None:
    for angle in (0.4, 1.3, 2.2):
        toward = np.array([np.cos(angle), np.sin(angle)])
        found = two_links.nearest(far * toward)
        assert found.status is CLAMPED
        assert found.held == ("rcond",)
        assert found.pose[:2, 3] == pytest.approx(edge_of_two_links(elbow) * toward, abs=1e-8)
        assert found.distance == found.position == pytest.approx(abs(far - edge_of_two_links(elbow)), abs=1e-8)
        assert found.rcond == pytest.approx(MARGIN, abs=1e-8)
        assert found.q[2] == pytest.approx(0.0, abs=1e-12)


def test_sliders_with_limits_stop_at_the_corner_and_the_sides_of_their_box(
    monkeypatch: pytest.MonkeyPatch, ppr: hk.Robot
) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    box = [replace(c, lower=a, upper=b) for c, a, b in zip(ppr.coordinates, (-1, -0.5, -9), (1, 0.5, 9), strict=True)]
    robot = replace(ppr, coordinates=tuple(box))
    ik = hk.ik(hk.holonomic(hk.position(robot), hk.lock(2)), [0.2, 0.1, PPR_START[2]], limits=True)
    shift = robot.pose([0.0, 0.0, PPR_START[2]])[:2, 3]
    for wanted in ([3.0, 4.0], [0.3, -2.0], [-7.0, 0.2], [0.5, 0.4]):
        found = ik.nearest(shift + wanted)
        assert found.q[:2] == pytest.approx(np.clip(wanted, [-1, -0.5], [1, 0.5]), abs=1e-10)
        outside = np.abs(wanted) > [1, 0.5]
        assert found.held == tuple(np.array(robot.joint_names[:2])[outside])
        assert found.status is (CLAMPED if outside.any() else REACHED)


@pytest.mark.campaign
@sampled(1, "limits", [False, True])
def test_no_allowed_pose_nearby_is_nearer(ik, panda: hk.Robot, limits: bool) -> None:
    rng = np.random.default_rng(0)
    for by, turn in (
        ([0.4, 0.3, 0.1], 0.0),
        ([0.2, -0.7, 0.3], 0.8),
        ([-0.3, 0.2, 0.9], -0.5),
        ([0.1, 0.0, -1.6], 0.3),
    ):
        pose = shifted(panda, PANDA_START, by, turn)
        found = ik.nearest(pose, limits=limits)
        assert found.status is CLAMPED
        assert found.distance == pytest.approx(missing(panda, found.q, pose), abs=1e-7)
        assert rcond_of(ik.strategy, found.q) == pytest.approx(found.rcond, rel=1e-9)
        assert found.rcond > MARGIN - 1e-8
        if limits:
            assert (found.q > panda.lower - 1e-9).all()
            assert (found.q < panda.upper + 1e-9).all()
        for _ in range(60):
            near = found.q + ik.strategy(found.q) @ (1e-4 * rng.normal(size=6))
            allowed = rcond_of(ik.strategy, near) >= MARGIN
            if limits:
                allowed = allowed and ((near >= panda.lower) & (near <= panda.upper)).all()
            assert not allowed or missing(panda, near, pose) > found.distance - 1e-6 * np.sqrt(found.distance)


def test_a_pose_within_reach_has_the_joints_of_inverse_kinematics_whatever_came_before(ik, panda: hk.Robot) -> None:
    rng = np.random.default_rng(1)
    q, seen = PANDA_START, 0
    for _ in range(20):
        pose = shifted(panda, PANDA_START, list(rng.uniform(-0.5, 0.5, 3)), rng.uniform(-0.5, 0.5))
        cold, warm = ik.nearest(pose), ik.nearest(pose, q)
        if cold.status is REACHED:
            seen += 1
            assert cold.q == pytest.approx(ik(pose), abs=1e-12)
            assert warm.status is REACHED
            assert warm.q == pytest.approx(cold.q, abs=1e-12)
            assert warm.held == ()
        q = warm.q
    assert 5 < seen < 20


def test_poses_have_the_same_answers_in_every_order(ik, panda: hk.Robot) -> None:
    shifts = np.random.default_rng(2).uniform(-0.8, 0.8, (30, 3))
    poses = [shifted(panda, PANDA_START, list(by)) for by in shifts]
    answers = [ik.nearest(pose).q for pose in poses]
    for i in np.random.default_rng(3).permutation(30):
        assert np.array_equal(ik.nearest(poses[i]).q, answers[i])


@sampled(1, "limits", [False, True])
def test_joints_move_at_most_as_fast_as_the_margin_allows_when_a_hand_leaves_and_comes_back(
    ik, panda: hk.Robot, limits: bool
) -> None:
    """A line and a circle through the edge at 500 Hz, 0.5 m/s; the posture at each end is where it belongs."""
    line = np.concatenate([np.linspace(0, 0.5, 500), np.linspace(0.5, 0, 500)])[:, None] * [1.0, 0.2, 0.4]
    angle = np.linspace(0, 2 * np.pi, 1500)[:, None]
    circle = 0.25 * np.hstack([np.sin(angle), np.cos(angle) - 1, 0.5 * np.sin(angle)]) + [0.0, 0.25, 0.0]
    for hand in (line, circle):
        q, before, stays = ik.nearest(shifted(panda, PANDA_START, list(hand[0]))).q, hand[0], []
        begin = q
        for here in hand:
            found = ik.nearest(shifted(panda, PANDA_START, list(here)), q, limits=limits)
            J = np.array([1, 1, 1, LENGTH, LENGTH, LENGTH])[:, None] * panda.jacobian(found.q)
            fastest = 6 / (MARGIN * np.linalg.norm(J))
            assert np.linalg.norm(found.q - q) <= 1.02 * fastest * np.linalg.norm(here - before) + 1e-8
            q, before = found.q, here
            stays.append(found.status)
        assert 0.1 < np.mean(stays) < 0.9
        assert q == pytest.approx(begin, abs=1e-9)


@pytest.mark.campaign
def test_a_hand_that_crosses_a_hole_of_the_workspace_is_met_on_the_other_side(two_links) -> None:
    """The tool slides round the hole, on the side where it is, and never moves faster than its step."""
    step, q = 0.04, two_links.nearest([1.6, 0.2]).q
    path = np.linspace([1.6, 0.2], [-1.6, 0.2], 120)
    statuses = []
    for hand in [*path, *60 * [path[-1]]]:
        found = two_links.nearest(hand, q, step=step)
        assert np.abs(found.q - q).max() <= step + 1e-12
        assert np.linalg.norm(found.pose[:2, 3]) > edge_of_two_links(3.0) - 1e-8
        q = found.q
        statuses.append(found.status)
    assert statuses[0] == statuses[-1] == REACHED
    assert CLAMPED in statuses
    assert q == pytest.approx(two_links.nearest(path[-1]).q, abs=1e-12)


@pytest.mark.campaign
def test_a_robot_that_is_stuck_leaves_for_a_pose_that_its_start_reaches(planar_3r: hk.Robot) -> None:
    """Joint 1 at its limit, the hand has gone round behind it: only the path back leads there."""
    robot = replace(
        planar_3r, coordinates=(replace(planar_3r.coordinates[0], lower=-2.9, upper=2.9), *planar_3r.coordinates[1:])
    )
    ik = hk.ik(hk.holonomic(hk.position(robot), hk.lock(2)), BETWEEN, limits=True)
    behind, beyond = (
        np.array([2.0 * np.cos(2.6), 2.0 * np.sin(2.6)]),
        np.array([2.0 * np.cos(-0.9), 2.0 * np.sin(-0.9)]),
    )
    stuck = ik.nearest(beyond, ik.nearest(behind).q, step=0.1)
    assert stuck.moving
    q = stuck.q
    for _ in range(400):
        found = ik.nearest(beyond, q, step=0.1)
        assert np.abs(found.q - q).max() <= 0.1 + 1e-12
        q = found.q
        if not found.moving:
            break
    assert found.status is REACHED
    assert q == pytest.approx(ik(beyond), abs=1e-12)


@pytest.mark.parametrize("native", [False, True])
def test_a_robot_stays_where_it_is_while_what_is_asked_is_no_pose(monkeypatch, ik, two_links, native: bool) -> None:
    if native:
        monkeypatch.setenv("HOLOKIN_NATIVE", "1")
    one, q = (ik, PANDA_START) if native else (two_links, BETWEEN)
    spoilt = {
        InverseStatus.NOT_FINITE: [np.eye(4) + np.diag([bad, 0, 0], 1) for bad in (np.nan, np.inf)],
        InverseStatus.NOT_A_ROTATION: [1.01 * np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0])],
    }  # fmt: skip
    for status, poses in spoilt.items():
        for pose in poses:
            found = one.nearest(pose, q, step=0.01)
            assert (found.status, found.held, found.moving) == (status, (), False)
            assert np.array_equal(found.q, q)
            assert np.isnan([found.distance, found.rcond]).all()
            assert np.isnan(found.pose).all()
            with pytest.raises((NotFiniteError, ArgumentError), match="a tool pose"):
                one.nearest(pose)  # nobody knows where the robot is


def test_bad_arguments_of_nearest_are_refused(two_links) -> None:
    with pytest.raises(ShapeError, match="a tool pose"):
        two_links.nearest(np.zeros(5))
    with pytest.raises(NotFiniteError, match="the posture to begin from"):
        two_links.nearest([1.0, 1.0], [np.nan, 0, 0])
    for name, bad in (("length", 0.0), ("rcond", -1.0), ("step", 0.0), ("step", [0.1, -1, 0.1]), ("step", np.nan)):
        with pytest.raises(ArgumentError, match=name):
            two_links.nearest([1.0, 1.0], BETWEEN, **{name: bad})
    with pytest.raises(ArgumentError, match="rcond, below which the tool is not to go"):
        two_links.nearest([1.0, 1.0], rcond=0.99)


def test_a_start_beyond_its_limits_has_no_edge_within_them(
    monkeypatch: pytest.MonkeyPatch, planar_3r: hk.Robot
) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    robot = replace(
        planar_3r, coordinates=(replace(planar_3r.coordinates[0], lower=1.0, upper=2.0), *planar_3r.coordinates[1:])
    )
    with pytest.raises(JointLimitError):
        hk.ik(hk.holonomic(hk.position(robot), hk.lock(2)), R3_START).nearest([1.0, 1.0], limits=True)


def test_a_longer_length_trades_position_for_angle(ik, panda: hk.Robot) -> None:
    pose = shifted(panda, PANDA_START, [0.4, 0.3, 0.1], 0.5)
    found: list[Nearest] = [ik.nearest(pose, length=length) for length in (0.1, 0.3, 1.0)]
    assert [f.status for f in found] == 3 * [CLAMPED]
    assert found[0].position < found[1].position < found[2].position
    assert found[0].angle > found[1].angle > found[2].angle


# --- `ik.nearest` in a loop: where joints end after a hand has gone through and out of reach, and how long they take.


@dataclass(frozen=True)
class Case:
    """An arm, its law, and how far the hand goes [m]."""

    ik: hk.motion.ik.InverseKinematics
    far: np.ndarray

    @property
    def robot(self) -> hk.Robot:
        return self.ik.strategy.task.robot

    @property
    def step(self) -> np.ndarray:
        """What the joints move in 20 ms."""
        fastest = self.robot.max_velocity
        return 0.02 * np.where(np.isfinite(fastest), fastest, 2.0)

    def pose(self, shift: np.ndarray, turn: np.ndarray) -> np.ndarray:
        """The tool pose at the start, moved and turned; a point of a planar arm."""
        pose = self.robot.pose(self.ik.q0)
        pose[:3, 3] += shift
        pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(turn).as_matrix()
        return pose if self.ik.strategy.task._turns else pose[:2, 3]

    def tours(self, seed: int, legs: int, samples: int = 60):
        """Ways of a hand, each along straight legs between random poses: lists of poses, the last where it rests."""
        rng = np.random.default_rng(seed)
        here, turned = np.zeros(3), np.zeros(3)
        for leg in range(legs):
            there = self.far * (0.4 if leg % 2 else 1.0) * rng.uniform(-1, 1, 3)
            turn = 0.4 * rng.normal(size=3)
            shares = np.linspace(0, 1, samples)
            yield [self.pose((1 - s) * here + s * there, (1 - s) * turned + s * turn) for s in shares]
            here, turned = there, turn


WIDE, FLAT = np.array([0.9, 0.9, 0.5]), np.array([2.5, 2.5, 0.0])


def case(name: str, seven: dict[str, tuple[hk.Robot, np.ndarray]], planar: hk.Robot) -> Case:
    """A case by the name of its robot and its law."""
    robot, law = name.split()
    constraints = {"lock": lambda: hk.lock(2), "arm": hk.arm_angle}
    if robot == "planar":
        return Case(hk.ik(hk.holonomic(hk.position(planar), constraints[law]()), R3_START), FLAT)
    arm, start = seven[robot]
    return Case(hk.ik(hk.holonomic(hk.pose(arm), constraints[law]()), start), WIDE)


@pytest.fixture(scope="module")
def seven(panda: hk.Robot, iiwa14: hk.Robot) -> dict[str, tuple[hk.Robot, np.ndarray]]:
    return {"panda": (panda, PANDA_START), "iiwa": (iiwa14, IIWA_START)}


def rested(case: Case, pose: np.ndarray, q: np.ndarray, limits: bool, most: int) -> tuple[np.ndarray, int]:
    """The joints at which a resting hand leaves the robot, and after how many calls; each keeps to its step."""
    robot, step = case.robot, case.step
    for call in range(1, most + 1):
        found = case.ik.nearest(pose, q, limits=limits, step=step)
        assert (np.abs(found.q - q) <= step * (1 + 1e-9)).all()
        assert not limits or ((found.q >= robot.lower - 1e-8) & (found.q <= robot.upper + 1e-8)).all()
        assert not found.moving or (np.abs(found.q - q) >= 0.49 * step).any()
        q = found.q
        if not found.moving:
            return q, call
    raise AssertionError(f"still moving after {most} calls, at {q.tolist()}")


@pytest.mark.parametrize(
    ("name", "limits", "seed"),
    [
        ("panda lock", True, 11), ("planar lock", False, 7),
        campaign(("name", "limits", "seed"), ("iiwa arm", False, 7)),
        campaign(("name", "limits", "seed"), ("iiwa arm", True, 11)),
    ],
)  # fmt: skip
def test_a_hand_that_rests_within_reach_is_reached_in_a_known_number_of_calls(
    seven, planar_3r: hk.Robot, name: str, limits: bool, seed: int
) -> None:
    one = case(name, seven, planar_3r)
    q, seen = one.ik.q0, 0
    for tour in one.tours(seed, 12):
        for pose in tour:
            q = one.ik.nearest(pose, q, limits=limits, step=one.step).q
        pose = tour[-1]
        cold = one.ik.nearest(pose, limits=limits)
        way = (np.abs(cold.q - q) / one.step).max()
        if cold.status is REACHED and one.ik.batch(pose[None]).reached[0]:
            seen += 1
            q, _ = rested(one, pose, q, limits, int(way / LEAST) + 3)
            assert q == pytest.approx(one.ik(pose), abs=1e-9)
        else:
            q, _ = rested(one, pose, q, limits, 5000)  # wherever that is, it ends
        again = one.ik.nearest(pose, q, limits=limits, step=one.step)
        assert not again.moving
        assert again.q == pytest.approx(q, abs=1e-7)
    assert 2 < seen < 12


@pytest.mark.campaign
@sampled(1, "start", [[0, 0.5, 0, -1.4, 0, 1.2, 0], [0.3, 0.7, 0.2, -1.5, 0.1, 1.0, 0.4]])
def test_a_hand_once_round_the_base_ends_at_the_joints_that_it_began_with(iiwa14: hk.Robot, start: list[float]) -> None:
    """Joint 1 has made a full turn by then, or the tool is held on the far side: the joints go back."""
    one = Case(hk.ik(hk.holonomic(hk.pose(iiwa14), hk.arm_angle()), start), WIDE)
    pose, q = iiwa14.pose(start), np.array(start)
    x, y = pose[:2, 3]
    for angle in np.linspace(0, 2 * np.pi, 300):
        pose[:2, 3] = np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y
        q = one.ik.nearest(pose, q, step=one.step).q
    q, _ = rested(one, pose, q, False, 800)
    assert q == pytest.approx(start, abs=1e-9)


def test_a_wound_up_arm_has_the_joints_of_its_start_in_one_call_or_a_step_at_a_time(planar_3r: hk.Robot) -> None:
    one = Case(hk.ik(hk.holonomic(hk.position(planar_3r), hk.lock(2)), R3_START), FLAT)
    x, y = planar_3r.pose(R3_START)[:2, 3]
    wound = R3_START + [2 * np.pi, 0, 0]
    assert one.ik.nearest([x, y], wound).q == pytest.approx(R3_START, abs=1e-12)
    q, calls = rested(one, np.array([x, y]), wound, False, 700)
    assert q == pytest.approx(R3_START, abs=1e-12)
    assert calls <= 2 * np.pi / one.step[0] / LEAST + 1


@pytest.mark.campaign
@sampled(1, "name", ["iiwa arm", "panda lock"])
def test_what_inverse_kinematics_reaches_within_the_bounds_is_reached_from_anywhere(
    seven, planar_3r: hk.Robot, name: str
) -> None:
    one = case(name, seven, planar_3r)
    rng, q, seen = np.random.default_rng(5), one.ik.q0, 0
    poses = np.array([one.pose(WIDE * rng.uniform(-1, 1, 3), 0.5 * rng.normal(size=3)) for _ in range(300)])
    known = one.ik.batch(poses)
    for pose, wanted, reached in zip(poses, known.q, known.reached, strict=True):
        found = one.ik.nearest(pose, q)
        if reached and rcond(one, wanted) > 0.1:
            seen += 1
            assert found.status is REACHED
            assert found.q == pytest.approx(wanted, abs=1e-9)
        q = found.q
    assert seen > 50


def rcond(one: Case, q: np.ndarray) -> float:
    """m / (|J| |G|), with angles in units of 0.3 m, from the public functions."""
    task = one.ik.strategy.task
    scale = np.array([1.0 if unit == "m" else 0.3 for unit in task.units])
    return float(
        task.m / np.linalg.norm(scale[:, None] * task.jacobian(q)) / np.linalg.norm(one.ik.strategy(q) / scale)
    )


@sampled(1, "name", ["panda lock", "planar lock", "ppr radial"])
def test_native_code_and_the_virtual_machine_lead_a_robot_alike(
    monkeypatch: pytest.MonkeyPatch, seven, planar_3r: hk.Robot, ppr: hk.Robot, name: str
) -> None:
    """In and out of reach, wound up, on no leaf, and on another branch."""

    def made() -> Case:
        if name != "ppr radial":
            return case(name, seven, planar_3r)
        law = hk.radial(hk.moore_penrose(hk.position(ppr)), PPR_START, steps=1)
        return Case(hk.ik(law, PPR_START), 0.2 * FLAT)

    one = made()
    start, rng = one.ik.q0, np.random.default_rng(2)
    begun = [start, start + 2 * np.pi * np.eye(len(start))[0], start + 0.3 * rng.normal(size=len(start)), -start]
    tour = [pose for tour in one.tours(4, 4, 4) for pose in tour]
    asked = [(pose, begun[i % 4], step) for i, pose in enumerate(tour) for step in (None, 10 * one.step)]
    native = [one.ik.nearest(pose, q, step=step) for pose, q, step in asked]
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    other = made()
    for a, (pose, q, step) in zip(native, asked, strict=True):
        b = other.ik.nearest(pose, q, step=step)
        assert (a.status, a.moving, a.held) == (b.status, b.moving, b.held)
        assert a.q == pytest.approx(b.q, abs=1e-8)
    assert {a.status for a in native} == {REACHED, CLAMPED}
    assert {a.moving for a in native} == {True, False}
