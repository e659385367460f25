"""Designs that keep shapes apart: exact derivatives, distances that hold at other poses, a proof of the result."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import holokin as hk
from holokin.analysis.coverage.pose_coordinates import chart_of, coordinates_of
from holokin.analysis.design import Design
from holokin.analysis.design.objectives import Objective, costs_of
from holokin.analysis.design.section import Limits, Search, SectionSamples, TiltedLeaves
from holokin.base.errors import ArgumentError
from holokin.motion.checks import Clearances
from holokin.robot import Box, Capsule, with_capsules
from holokin.strategies.right_inverses import monomials_up_to

coal, pin = pytest.importorskip("coal"), pytest.importorskip("pinocchio")

READY = np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4])
SPACE = hk.workspace(box=([0.5, 0.05, 0.35], [0.06, 0.1, 0.06]))
TABLE = hk.obstacle("table", Box(np.array([1.0, 1.0, 0.05])), (0.6, 0.0, -0.05))
POST = hk.obstacle("post", Capsule(0.02, 1.0), (0.2, 0.22, 0.6))
WORDS: dict[str, Any] = {"degree": 1, "samples": 24}


@pytest.fixture(scope="module")
def task(panda: hk.Robot) -> hk.Task:
    return hk.pose(panda)


def search_of(task: hk.Task, wanted: float) -> Search:
    """A search at eight poses, shapes to be kept a distance apart."""
    law = hk.holonomic(task, hk.lock(2))
    center = hk.ik(law, READY)(SPACE.center)
    poses = SPACE.poses(8)
    Q = hk.ik(law, center).batch(poses).q
    c = coordinates_of(chart_of(task, SPACE.center[:3, :3]), Q)
    apart, goal = Clearances.of(task.robot, hk.Scene([TABLE, POST], -0.3, wanted)), Objective(1.0)
    section = SectionSamples(TiltedLeaves(law, c), monomials_up_to(c.d, 2), poses[:, :3, 3], poses[:, :3, :3], c.at(Q))
    limits = Limits(np.full(7, np.inf), apart)
    costs = costs_of(task.robot, goal, c.turns, c.spread)
    return Search(section, costs, goal.weights, limits, section.through(Q, law.g(center)[:, None]))


def test_derivatives_of_clearance_are_those_of_differences(task: hk.Task) -> None:
    """By the coefficients, with distances that are too small at most of the poses."""
    search = search_of(task, 0.3)
    assert (search.violations(search.near)[0][:, 7:] > 0).any()
    t = len(search.section.terms)
    cost = search._augmented(1, t, np.zeros_like(search.violations(search.near)[0]), 2.0)
    rng = np.random.default_rng(0)
    x, way = np.pad(search.near.levels[:1], ((0, 0), (0, t - 1))).ravel(), rng.normal(size=t)
    x = (x[None] @ np.linalg.inv(search._whitening)).ravel() + 0.01 * rng.normal(size=t)
    here, h = cost(x, search.near), 1e-6
    assert here is not None
    ahead, behind = (cost(x + s * h * way, here[2]) for s in (1, -1))
    assert ahead is not None and behind is not None
    assert here[1] @ way == pytest.approx((ahead[0] - behind[0]) / (2 * h), rel=1e-5)


def least_by_coal(found: Design, poses: np.ndarray) -> float:
    """The least distance of any link from the table and the post: coal at Pinocchio's frames."""
    robot = with_capsules(found.strategy.task.robot)
    model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    data, least = model.createData(), np.inf
    solved = hk.ik(found.strategy, found.q0).batch(poses)
    assert solved.reached.all()
    for q in solved.q:
        pin.forwardKinematics(model, data, q)
        for s in robot.shapes:
            if s.joint < 0:
                continue
            M = data.oMi[model.getJointId(robot.joints[s.joint].name)] * pin.SE3(s.placement)
            for thing in (TABLE, POST):
                at = pin.SE3(thing.placement)
                ends = coal.Transform3s(M.rotation, M.translation), coal.Transform3s(at.rotation, at.translation)
                asked = coal.DistanceRequest(), coal.DistanceResult()
                least = min(least, coal.distance(s.shape.solid, ends[0], thing.shape.solid, ends[1], *asked))
    return float(least)


@pytest.fixture(scope="module")
def pair(task: hk.Task) -> tuple[Design, Design]:
    """Designed without the post, and to keep 0.06 m from it."""
    return hk.design(task, SPACE, READY, **WORDS), hk.design(
        task, SPACE, READY, scene=hk.Scene(obstacles=[TABLE, POST], clearance=0.06), **WORDS
    )


@pytest.mark.campaign
def test_a_distance_that_binds_is_kept_at_other_poses(pair: tuple[Design, Design]) -> None:
    free, held = pair
    poses = SPACE.poses(96, seed=1)  # those of the check
    assert least_by_coal(free, poses) < 0.055
    seen = least_by_coal(held, poses)
    assert seen >= 0.06 - 1e-5 and held.holds
    assert held.checked.clearance == pytest.approx(seen, abs=1e-5) and held.checked.closest is not None
    assert "post" in held.checked.closest.names and held.checked.closest.distance == held.checked.clearance
    assert f"the least distance is {held.checked.clearance:.3g} m, between" in str(held.checked)
    assert held.costs[-1] > free.costs[-1] and held.broken > 0
    assert free.checked.closest is None and np.isinf(free.checked.clearance)
    assert "least distance" not in str(free.checked)


@pytest.mark.campaign
def test_what_was_designed_to_keep_clear_is_proven_to(pair: tuple[Design, Design]) -> None:
    scene = hk.Scene([TABLE, POST], clearance=0.05)
    free, held = pair
    proof = hk.certify(held.strategy, SPACE, held.q0, scene=scene)
    assert proof.whole and 0.05 <= proof.findings.apart.min() <= held.checked.clearance + 0.001
    assert not hk.certify(free.strategy, SPACE, free.q0, scene=scene).whole


def test_a_clearance_that_cannot_be_asked_is_refused(task: hk.Task) -> None:
    with pytest.raises(ArgumentError, match="metres"):
        hk.design(task, SPACE, READY, scene=hk.Scene(obstacles=[hk.obstacle("far", Capsule(1.0), (900.0, 0.0, 0.0))]))
