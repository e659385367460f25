"""Where a box is not proven: a part is refuted by a posture alone that touches, as Pinocchio and a closed form say."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from holokin.proof.kept_apart import too_near_along
from holokin.proof.proven_region import CAUSES, NEAR, region_of
from holokin.robot import Capsule, with_capsules

pytest.importorskip("coal")

Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
RADIUS, WANTED, HALF = 0.02, 0.002, 0.02
ARM = hk.load("panda")
TOOL = ARM.pose(Q0)
CORNER = TOOL[:3, 3] + HALF
BALL = CORNER + [0.06, 0.06, 0.0]


@cache
def region() -> hk.proof.UniqueRegion:
    """A cube of 4 cm, of which one corner alone comes near a ball."""
    space = hk.workspace(box=(TOOL[:3, 3], [HALF] * 3), rotation=TOOL[:3, :3])
    ball = hk.obstacle("ball", Capsule(RADIUS), tuple(BALL))
    strategy = hk.holonomic(hk.pose(ARM), hk.lock(2))
    return hk.unique_region(
        strategy, Q0, space, scene=hk.Scene(obstacles=[ball], clearance=WANTED, self_collision=False), budget=4000
    )  # fmt: skip


def to_ball(Q: np.ndarray) -> np.ndarray:
    """(k,) the distance of the arm from the ball: frames by Pinocchio, a point and segments in closed form."""
    model = pin.buildModelFromXML(hk.robot.to_urdf(ARM))
    data, out = model.createData(), []
    capsules = [s for s in with_capsules(ARM).shapes if s.joint >= 0]
    for q in np.atleast_2d(Q):
        pin.forwardKinematics(model, data, q)
        least = np.inf
        for s in capsules:
            T = data.oMi[model.getJointId(ARM.joints[s.joint].name)].homogeneous @ s.placement
            a, b = (T[:3, 3] + sign * T[:3, 2] * s.shape.length / 2 for sign in (-1, 1))
            along = (b - a) @ (b - a)
            t = np.clip((BALL - a) @ (b - a) / along, 0, 1) if along else 0.0
            least = min(least, np.linalg.norm(BALL - a - t * (b - a)) - s.shape.radius - RADIUS)
        out.append(least)
    return np.array(out)


def test_a_refuted_part_holds_a_posture_of_the_leaf_that_is_too_near() -> None:
    parts, strategy = region().parts, region().strategy
    refuted = np.flatnonzero(parts.cause == NEAR)
    assert len(refuted) and all((parts.found[i] is not None) == (i in refuted) for i in range(len(parts)))
    for i in refuted:
        one = parts.found[i]
        assert to_ball(one.q)[0] == pytest.approx(one.distance, abs=1e-9) and one.distance < one.wanted == WANTED
        assert one.q[2] == pytest.approx(Q0[2], abs=1e-12) and set(one.names) >= {"ball"}
        assert np.abs(strategy.task.pose(one.q) - one.pose).max() < 1e-9
        u = (one.pose[:3, 3] - TOOL[:3, 3]) / HALF
        assert (parts.low[i] - 1e-9 <= u).all() and (u <= parts.high[i] + 1e-9).all()
    assert parts.worst.distance == min(parts.found[i].distance for i in refuted)
    assert "and ball overlap by" in str(parts.worst) and "was asked" in str(parts.worst)


def test_the_corner_that_the_ball_takes_is_open_and_all_that_touches_is_there() -> None:
    found, parts = region(), region().parts
    poses = found.workspace.poses(1500)
    apart, inside = to_ball(hk.ik(found.strategy, Q0).batch(poses).q), found.contains(poses)
    assert (apart[inside] >= WANTED).all() and (apart < WANTED).any() and 0.5 < inside.mean() < 1
    causes = found.causes(poses)
    assert ((causes == NEAR) == (apart < WANTED)).all()
    assert found.share + sum(parts.shares.values()) == pytest.approx(1.0, abs=1e-12)
    assert parts.shares[CAUSES[NEAR]] >= (apart < WANTED).mean(), "parts are refuted as wholes"
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    far = found.workspace.at(TOOL[:3, 3] + 0.999 * HALF * corners[np.any(corners[:, :2] < 0, axis=1)])
    assert found.contains(far).all() and not found.contains(found.workspace.at([CORNER - 1e-6])).any()
    assert "too near" in str(found)


def test_a_box_that_is_not_proven_whole_has_the_posture_that_refutes_it() -> None:
    """`certify` ends at the first place where it fails; what is too near is found all the same."""
    found = region()
    proof = hk.certify(
        found.strategy, found.workspace, Q0,
        scene=hk.Scene([hk.obstacle("ball", Capsule(RADIUS), tuple(BALL))], clearance=WANTED, self_collision=False),
    )  # fmt: skip
    worst = region_of(proof).parts.worst
    assert not proof.whole and to_ball(worst.q)[0] < WANTED


def test_along_a_path_the_posture_is_found_that_is_nearest() -> None:
    ball, path = hk.obstacle("ball", Capsule(RADIUS), tuple(BALL)), hk.polyline([TOOL[:3, 3], CORNER])
    strategy = region().strategy
    proof = hk.certify(strategy, path, Q0, scene=hk.Scene(obstacles=[ball], clearance=WANTED, self_collision=False))
    one = too_near_along(proof)
    walk = to_ball(hk.follow(strategy, path, Q0, samples=200).q)
    assert not proof.whole and one.distance == pytest.approx(walk.min(), abs=1e-6) and one.distance < 0
