"""Swivel angles against Elias and Wen's own formulas, and all postures of an arm at one of them."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import holokin as hk
from conftest import IIWA_START, PANDA_START, sampled, urdf
from holokin.analysis.coverage import PoseStatus
from holokin.base.errors import (
    ArgumentError,
    CallError,
    ShapeError,
    SingularityError,
    SingularityKind,
    UnknownNameError,
)
from holokin.strategies.constraints import find_arm
from holokin.symbolic import Function, jacobian, symbol

X, Y, Z = np.eye(3)
BASE, UPPER, FORE, HAND = 0.36, 0.42, 0.40, 0.126  # of an iiwa 14 [m]


def rot(axis: np.ndarray, angle: float) -> np.ndarray:
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def iiwa_pose(q: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """(pose, [shoulder, elbow, wrist]) of an iiwa 14 by the product of its rotations, from its data sheet."""
    first, second = rot(Z, q[0]) @ rot(Y, q[1]), rot(Z, q[2]) @ rot(-Y, q[3])
    S = BASE * Z
    E = S + UPPER * first @ Z
    W = E + FORE * first @ second @ Z
    R = first @ second @ rot(Z, q[4]) @ rot(Y, q[5]) @ rot(Z, q[6])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, W + HAND * R @ Z
    return T, [S, E, W]


def iiwa_postures(T: np.ndarray, psi: float, e_t: np.ndarray, e_r: np.ndarray) -> list[np.ndarray]:
    """The eight postures of an iiwa 14 at a pose and a stereographic angle in closed form, signs of q2, q4, q6."""
    R, W = T[:3, :3], T[:3, 3] - HAND * T[:3, 2] - BASE * Z
    d = np.linalg.norm(W)
    w = W / d
    k_x = np.cross(np.cross(w - e_t, e_r), w)
    e = rot(w, psi) @ (k_x / np.linalg.norm(k_x))
    alpha = np.arccos((UPPER**2 + d**2 - FORE**2) / (2 * UPPER * d))
    E = np.cos(alpha) * w + np.sin(alpha) * e
    bend = np.arccos((d**2 - UPPER**2 - FORE**2) / (2 * UPPER * FORE))
    found = []
    for a, b, c in product((1, -1), repeat=3):
        q1, q2 = np.arctan2(a * E[1], a * E[0]), a * np.arccos(E[2])
        first = rot(Z, q1) @ rot(Y, q2)
        v, q4 = first.T @ (W - UPPER * E) / FORE, b * bend
        q3 = np.arctan2(-v[1] / np.sin(q4), -v[0] / np.sin(q4))
        H = (first @ rot(Z, q3) @ rot(-Y, q4)).T @ R
        q6 = c * np.arccos(H[2, 2])
        q5, q7 = np.arctan2(c * H[1, 2], c * H[0, 2]), np.arctan2(c * H[2, 1], -c * H[2, 0])
        found.append(np.array([q1, q2, q3, q4, q5, q6, q7]))
    return found


def stereo_sew(S: np.ndarray, E: np.ndarray, W: np.ndarray, e_t: np.ndarray, e_r: np.ndarray) -> float:
    """psi by the other formula of [EW23], through the plane's normal seen from the pole."""
    w = (W - S) / np.linalg.norm(W - S)
    n_phi = -np.cross(w - e_t, np.cross(W - S, E - S))
    return float(np.arctan2(n_phi @ np.cross(-e_t, e_r), n_phi @ e_r))


def test_an_iiwa_has_eight_postures_at_the_pose_and_angle_of_stereo_sews_tutorial(iiwa14: hk.Robot) -> None:
    """R = rot(x, pi/4), p = (0.2, 0.3, 0.4), e_t = -z, e_r = y, psi = pi/6: 8 solutions, and which these are."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rot(X, np.pi / 4), [0.2, 0.3, 0.4]
    strategy = hk.holonomic(hk.pose(iiwa14), hk.arm_angle(pole=-Z, reference=Y))
    found = hk.motion.ik.all_postures(strategy, T, np.pi / 6, limits=False)
    assert len(found) == 8
    closed = iiwa_postures(T, np.pi / 6, -Z, Y)
    for q in found.q:
        pose, points = iiwa_pose(q)
        assert pose == pytest.approx(T, abs=1e-10)
        assert iiwa14.pose(q) == pytest.approx(pose, abs=1e-12)
        assert stereo_sew(*points, -Z, Y) == pytest.approx(np.pi / 6, abs=1e-10)
        assert sum(np.abs((q - p + np.pi) % (2 * np.pi) - np.pi).max() < 1e-9 for p in closed) == 1
    assert found.curves and found.step < 0.6 and not (found.doubt or found.starts or found.closed or found.searched)
    assert f"{found.curves} curves of its self-motion" in found.sentence


@sampled(1, "seed", range(3))
def test_the_postures_of_an_iiwa_at_other_poses_are_those_of_the_closed_form(iiwa14: hk.Robot, seed: int) -> None:
    q0 = IIWA_START + np.random.default_rng(seed).uniform(-0.4, 0.4, 7)
    T, points = iiwa_pose(q0)
    strategy = hk.holonomic(hk.pose(iiwa14), hk.arm_angle(pole=-Z, reference=Y))
    psi = stereo_sew(*points, -Z, Y)
    assert strategy.g(q0) == pytest.approx([psi], abs=1e-12)
    found = hk.motion.ik.all_postures(strategy, T, psi, limits=False)
    closed = iiwa_postures(T, psi, -Z, Y)
    assert len(found) == len(closed) == 8
    for p in closed:
        assert np.abs((found.q - p + np.pi) % (2 * np.pi) - np.pi).max(axis=1).min() < 1e-9


def test_within_the_limits_the_postures_are_those_of_the_closed_form_that_the_robot_can_take(iiwa14: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(iiwa14), hk.arm_angle(pole=-Z, reference=Y))
    T, points = iiwa_pose(IIWA_START + [0, 0, 0.3, 0, 0.3, 0, 0])
    psi = stereo_sew(*points, -Z, Y)
    inside = [q for q in iiwa_postures(T, psi, -Z, Y) if (np.abs(q) <= iiwa14.upper).all()]
    found = hk.motion.ik.all_postures(strategy, T, psi)
    assert 0 < len(inside) < 8
    assert (len(found), found.outside) == (len(inside), 8 - len(inside))
    for q in found.q:
        iiwa14.check_limits(q)


def test_all_postures_of_a_pandas_locked_joint_reach_the_pose_and_are_different(panda: hk.Robot) -> None:
    strategy, T = hk.holonomic(hk.pose(panda), hk.lock(2)), panda.pose(PANDA_START)
    found = hk.motion.ik.all_postures(strategy, T, PANDA_START[2], limits=False)
    assert len(found) == 10 and min(np.abs(found.q - PANDA_START).max(axis=1)) < 1e-9
    for i, q in enumerate(found.q):
        assert panda.pose(q) == pytest.approx(T, abs=1e-9)
        assert q[2] == pytest.approx(PANDA_START[2], abs=1e-9)
        assert all(np.abs(q - other).max() > 0.01 for other in found.q[:i])
    with pytest.raises(CallError, match=r"all_postures\(strategy, pose, level=0.0, limits=True, near=None\)"):
        hk.motion.ik.all_postures(strategy, T, PANDA_START[2], starts=2048)


def test_a_pose_out_of_reach_has_no_posture_and_a_bad_one_is_refused(panda: hk.Robot) -> None:
    strategy = hk.holonomic(hk.pose(panda), hk.arm_angle())
    T = panda.pose(PANDA_START).copy()
    T[0, 3] = 5.0
    assert len(hk.motion.ik.all_postures(strategy, T, 0.0)) == 0
    with pytest.raises(ArgumentError, match="right-handed"):
        hk.motion.ik.all_postures(strategy, np.diag([2.0, 2.0, 2.0, 1.0]), 0.0)
    with pytest.raises(ShapeError):
        hk.motion.ik.all_postures(strategy, T, [0.0, 1.0])


# --- the angle itself, its slopes and its singular directions ---


def closed_form(points: np.ndarray, kind: str, R: np.ndarray, V: np.ndarray) -> tuple[float, np.ndarray]:
    """(psi, its derivative by elbow and wrist seen from the shoulder, (6,)), of [EW23] (theory 2i)."""
    S, E, W = points[0], points[1] - points[0], points[2] - points[0]
    w = W / np.linalg.norm(W)
    n_ref = np.cross(w, V) if kind == "conventional" else np.cross(w - R, V)
    k_x = np.cross(n_ref, W)
    a, x = np.linalg.norm(k_x), k_x / np.linalg.norm(k_x)
    y = np.cross(w, x)
    P = E - w * (w @ E)
    aside = np.cross(w, P / np.linalg.norm(P)) / np.linalg.norm(P)
    by_wrist = (w @ V) / a * y - (w @ E) / np.linalg.norm(W) * aside
    if kind == "stereographic":
        by_wrist += (w @ np.cross(R, V)) / a * x
    psi = np.arctan2(np.cross(w, x) @ P, x @ P)
    assert S.shape == (3,)
    return psi, np.concatenate([aside, by_wrist])


@pytest.mark.parametrize("kind", ["stereographic", "conventional"])
@pytest.mark.parametrize("arm", ["iiwa14", "panda", "xarm7", "named"])
def test_the_slopes_of_both_angles_are_elias_and_wens_on_arms_with_offsets_too_T13(arm: str, kind: str) -> None:
    """d psi = J_e d(E - S) + J_w d(W - S); how the points move is by central differences."""
    robot = hk.load(urdf("xarm7.urdf")) if arm == "xarm7" else hk.load("iiwa14" if arm == "iiwa14" else "panda")
    named = (0, (3, (0.03, -0.02, 0.05)), "panda_joint7") if arm == "named" else None
    R, V = np.array([0.6, 0.0, -0.8]), np.array([0.8, 0.0, 0.6])
    task = hk.pose(robot)
    constraint = hk.arm_angle(definition=kind, joints=named, reference=V, pole=R if kind == "stereographic" else None)
    q = symbol("q", 7)
    g = constraint.bind(task, robot.kinematics(q), q)
    f, places = Function("g", {"q": q}, {"g": g, "J": jacobian(g, q)}), find_arm(task, named).places(task)
    for at in np.random.default_rng(1).uniform(-1.2, 1.2, (4, 7)) + [0, 0, 0, -1.5 if arm == "panda" else 0.8, 0, 0, 0]:
        psi, slopes = closed_form(places(at), kind, R, V)
        h, moves = 1e-6, np.empty((6, 7))
        for i, step in enumerate(h * np.eye(7)):
            apart = (places(at + step) - places(at - step)) / (2 * h)
            moves[:, i] = np.concatenate([apart[1] - apart[0], apart[2] - apart[0]])
        value, gradient = f(at)
        assert value == pytest.approx(psi, abs=1e-12)
        assert gradient[0] == pytest.approx(slopes @ moves, abs=1e-7 * np.abs(gradient).max())


def wrist_in(u: np.ndarray, swing: float = 0.4) -> np.ndarray:
    """A posture of an iiwa 14 with its wrist in the direction u of the shoulder."""
    T = np.eye(4)
    T[:3, :3] = rot(X, 2.5)
    T[:3, 3] = BASE * Z + 0.6 * u / np.linalg.norm(u) + HAND * T[:3, 2]
    return iiwa_postures(T, swing, np.array([0.48, -0.6, 0.64]), np.array([0.8, 0.6, -0.0375]))[0]


@pytest.mark.parametrize(
    ("given", "u", "said"),
    [
        ({"definition": "conventional"}, Z, r"on the line through the shoulder along the reference \[0.0, 0.0, 1.0\]"),
        ({"definition": "conventional"}, -Z, "on the line through the shoulder"),
        ({}, -X, r"on the half-line from the shoulder along the pole \[-1.0, 0.0, 0.0\]"),
        ({"pole": Y}, Y, r"on the half-line from the shoulder along the pole \[0.0, 1.0, 0.0\]"),
    ],
)
def test_the_error_says_in_which_direction_an_arm_angle_is_singular(
    iiwa14: hk.Robot, given: dict[str, object], u: np.ndarray, said: str
) -> None:
    strategy = hk.holonomic(hk.pose(iiwa14), hk.arm_angle(**given))  # type: ignore[arg-type]
    with pytest.raises(SingularityError, match=said) as caught:
        strategy(wrist_in(u))
    assert caught.value.kind is SingularityKind.REPRESENTATION
    if "definition" not in given:
        strategy(wrist_in(-u))  # half a line only


def test_the_error_says_that_the_arm_is_stretched(iiwa14: hk.Robot) -> None:
    with pytest.raises(SingularityError):
        hk.holonomic(hk.pose(iiwa14), hk.arm_angle())(np.array([0.1, 0.6, 0.2, 0.0, 0.3, 0.9, 0.2]))


@pytest.mark.parametrize("kind", ["stereographic", "conventional"])
@pytest.mark.parametrize("towards", [Y, Z, (Y + Z) / 2**0.5])
def test_the_margin_is_the_angle_to_the_singular_direction_on_every_side(
    iiwa14: hk.Robot, kind: str, towards: np.ndarray
) -> None:
    """Also where w - R is along V, where n_ref = (w - R) x V vanishes as the square: 1e-5 rad is no singularity."""
    pole = -X if kind == "stereographic" else Z
    side = towards - (towards @ pole) * pole
    strategy = hk.holonomic(hk.pose(iiwa14), hk.arm_angle(definition=kind))
    for angle in (1e-5, 1e-3):
        side = side if np.linalg.norm(side) > 0.1 else X
        u = np.cos(angle) * pole + np.sin(angle) * side / np.linalg.norm(side)
        assert strategy.gain(wrist_in(u))[2] == pytest.approx(angle, rel=1e-3)


def test_a_pole_of_the_conventional_angle_is_refused_and_not_ignored() -> None:
    with pytest.raises(ArgumentError, match="the conventional angle has none"):
        hk.arm_angle(definition="conventional", pole=X)


@pytest.mark.parametrize("kind", ["stereographic", "conventional"])
def test_once_round_the_self_motion_the_angle_makes_one_turn(iiwa14: hk.Robot, kind: str) -> None:
    """So there is one posture for each value: the angle names the postures of a self-motion."""
    psi = angles_round(iiwa14, IIWA_START + 0.1, kind)
    assert abs(psi[-1] - psi[0]) == pytest.approx(2 * np.pi, abs=0.05)
    assert (np.diff(psi) * (psi[-1] - psi[0]) > 0).all()


def test_on_an_arm_whose_wrist_is_not_fixed_to_the_tool_the_angle_may_turn_back(panda: hk.Robot) -> None:
    """There it is singular (ALGORITHMIC); one of a point on the last axis, which the tool carries, did not, here."""
    back = angles_round(panda, PANDA_START, "conventional")
    forth = angles_round(panda, PANDA_START, "conventional", joints=(1, 3, 6))
    for psi in (back, forth):
        assert abs(psi[-1] - psi[0]) == pytest.approx(2 * np.pi, abs=0.05)
    assert 0 < (np.diff(back) < 0).sum() < len(back) / 4
    assert (np.diff(forth) * (forth[-1] - forth[0]) > 0).all()


def angles_round(robot: hk.Robot, q0: np.ndarray, kind: str, **named: object) -> np.ndarray:
    """The angle round a closed self-motion, counted on."""
    strategy = hk.holonomic(hk.pose(robot), hk.arm_angle(definition=kind, **named))  # type: ignore[arg-type]
    motion = hk.strategies.self_motion_curve(strategy.task, q0, step=0.04, length=20.0, limits=False)
    assert motion.closed
    return np.unwrap([strategy.g(q)[0] for q in motion.q])


def test_points_are_named_by_joint_or_by_joint_and_offset(panda: hk.Robot) -> None:
    task = hk.pose(panda)
    arm = find_arm(task, ("panda_joint1", (3, (0.0, 0.1, 0.0)), 5))
    S, E, W = arm.places(task)(PANDA_START)
    (line,) = panda.skeleton(PANDA_START)
    assert (pytest.approx(line[1]), pytest.approx(line[6])) == (S, W)
    assert np.linalg.norm(E - line[4]) == pytest.approx(0.1)
    assert arm.sentence == (
        "shoulder at the origin of panda_joint1; elbow at (0, 0.1, 0) in the frame of panda_joint4; "
        "wrist at the origin of panda_joint6"
    )
    for wrong, kind in ((("a", 3, 5), UnknownNameError), ((1, 3), ArgumentError), ((1, None, 5), ArgumentError)):
        with pytest.raises(kind):
            find_arm(task, wrong)
    with pytest.raises(ShapeError):
        find_arm(task, (1, (3, (0.0, 0.1)), 5))


# --- the wrist that is found, and where the elbow stands at the start ---

READY = np.array([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4])
BOX = hk.workspace(box=([0.5, 0.0, 0.3], [0.25, 0.4, 0.3]), tilt=np.radians(40), spin=np.radians(90))


@pytest.mark.campaign
def test_an_elbow_kept_above_its_arm_ends_its_leaf_where_it_passes_over_the_shoulder(panda: hk.Robot) -> None:
    """There joints 1 and 3 turn about one line, and the self-motion turns them against each other."""
    law = hk.holonomic(hk.pose(panda), hk.arm_angle(definition="conventional"))
    found = hk.coverage(law, BOX, READY, samples=64, explain=False)
    ended = found.last[found.status == PoseStatus.ALGORITHMIC]
    assert len(ended) > 32
    assert np.abs(ended[:, 1:3]).max() < 1e-3
    N = law.task.null_space(ended[0])[:, 0]
    assert np.abs(N / np.linalg.norm(N)) == pytest.approx(np.array([1, 0, 1, 0, 0, 0, 0]) / 2**0.5, abs=1e-3)


@pytest.mark.campaign
def test_where_the_elbow_stands_at_the_start_counts_for_more_than_the_wrist(panda: hk.Robot) -> None:
    shares = {}
    for wrist, joints in (("found", None), ("last", (1, 3, 6))):
        law = hk.holonomic(hk.pose(panda), hk.arm_angle(definition="conventional", joints=joints))
        aside = hk.motion.ik.move_to_leaf(law, READY, law.g(READY) - np.pi / 3)
        for name, start in (("above", READY), ("aside", aside)):
            shares[wrist, name] = hk.coverage(law, BOX, start, samples=64, explain=False).share
    for name in ("above", "aside"):
        assert abs(shares["found", name] - shares["last", name]) < 0.06
    for wrist in ("found", "last"):
        assert shares[wrist, "aside"] > shares[wrist, "above"] + 0.3
