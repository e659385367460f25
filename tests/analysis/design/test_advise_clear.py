"""Advice where shapes are to keep apart: what is advised keeps clear, and can be proven to."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import holokin as hk
from holokin.analysis.design import Advice
from holokin.analysis.design.trials import alike, ranked
from holokin.base.errors import ArgumentError, OutOfReachError
from holokin.robot import Box, Capsule

PLANE = hk.workspace(box=([1.2, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3))
BAR, BALL, PLACE = 0.05, 0.1, np.array([0.9, -0.5])
SCENE = hk.Scene([hk.obstacle("post", Capsule(BALL), (*PLACE, 0.0))], clearance=0.05)


def arm() -> hk.Robot:
    """A planar arm of three bars of a metre, 0.1 m thick."""
    row = {"a": 1.0, "lower": -2.6, "upper": 2.6, "max_velocity": 2.0}
    return hk.robot.with_capsules(hk.from_dh([dict(row) for _ in range(3)], name="planar"), BAR)


def from_post(Q: np.ndarray) -> np.ndarray:
    """Distance of the bars of postures (k, 3) from the post (k,), in closed form."""
    turns = np.cumsum(Q, axis=1)
    bars = np.stack([np.cos(turns), np.sin(turns)], axis=2)
    roots = np.cumsum(bars, axis=1) - bars
    share = np.clip(np.einsum("kbi,kbi->kb", bars, PLACE - roots), 0.0, 1.0)
    return np.linalg.norm(PLACE - roots - share[:, :, None] * bars, axis=2).min(axis=1) - BAR - BALL


@pytest.fixture(scope="module")
def plain() -> Advice:
    return hk.advise(hk.position(arm()), PLANE)


@pytest.fixture(scope="module")
def clear() -> Advice:
    return hk.advise(hk.position(arm()), PLANE, scene=SCENE)


@pytest.mark.campaign
def test_what_is_advised_keeps_clear_where_the_law_without_the_post_does_not(plain: Advice, clear: Advice) -> None:
    poses = PLANE.poses(500, seed=3)
    near, far = (hk.ik(one.best.strategy, one.q0).batch(poses) for one in (plain, clear))
    assert near.reached.all() and far.reached.all()
    assert from_post(near.q).min() < 0.03
    assert from_post(far.q).min() > 0.05
    assert clear.best.coverage == clear.best.clear == 1.0
    found = hk.coverage(clear.best.strategy, PLANE, clear.q0, samples=256)
    assert 0.05 <= clear.best.clearance <= from_post(found.q).min() + 1e-9
    assert np.isinf(plain.best.clearance) and plain.best.clear == 1.0
    closest = clear.best.closest
    assert closest is not None and str(closest) in str(clear) and closest.distance == clear.best.clearance
    assert from_post(closest.q[None])[0] == pytest.approx(closest.distance, abs=1e-9) and "post" in closest.names
    assert clear.to_dict()["strategies"][0]["clearance"] == clear.best.clearance


@pytest.mark.campaign
def test_the_call_that_is_named_proves_it_and_refuses_the_law_without_the_post(plain: Advice, clear: Advice) -> None:
    said = clear.certify_by
    assert said.startswith("Certify it by: hk.certify(")
    proof = eval(said.removeprefix("Certify it by: "), {"hk": hk, "advice": clear})
    assert proof.whole
    least = proof.findings.apart.min()
    assert 0.05 <= least <= clear.best.clearance + 1e-9
    with pytest.raises(ArgumentError, match=r"post are 0\.0.* m apart, where 0.05 m is asked"):
        hk.certify(plain.best.strategy, PLANE, plain.q0, scene=SCENE)
    said = plain.certify_by.removeprefix("Certify it by: ")
    assert eval(said, {"hk": hk, "advice": plain}).whole


def test_other_things_equal_a_law_that_is_well_clear_everywhere_comes_first() -> None:
    def law(coverage: float, clear: float, speed: float) -> Any:
        candidate = SimpleNamespace(strategy=None)
        return SimpleNamespace(coverage=coverage, clear=clear, easy=1.0, squared_speed=speed, candidate=candidate)

    fast, slow, wide, blocked = law(1.0, 0.995, 1.0), law(1.0, 1.0, 2.0), law(1.0, 0.9, 0.5), law(0.9, 0.9, 0.1)
    assert ranked([blocked, wide, fast, slow]) == [slow, fast, wide, blocked]
    assert not alike(fast, slow) and alike(fast, law(1.0, 0.99, 3.0))


def test_what_cannot_be_kept_clear_of_is_refused() -> None:
    with pytest.raises(ArgumentError, match="nothing in it can be touched"):
        hk.advise(hk.position(arm()), PLANE, scene=hk.Scene(self_collision=False))


def test_where_no_posture_keeps_clear_the_cause_is_named_at_once() -> None:
    """The tank swallows the arm, wherever its joints are: that is found before any strategy is tried."""
    tank, heard = hk.obstacle("tank", Capsule(1.0), (0.5, 0.2, 0.0)), []
    with pytest.raises(
        OutOfReachError, match=r"no strategy can serve .*tank is in the way .* and tank overlap by 0\.\d+ m"
    ):
        hk.advise(hk.position(arm()), PLANE, scene=hk.Scene(obstacles=[tank]), progress=heard.append)
    assert heard[-1] == "what is in the way"


@pytest.mark.campaign
def test_on_a_panda_beside_a_post_the_advised_law_is_proven_and_the_one_without_the_post_is_not() -> None:
    """A cube of 6 cm above a table, a post behind the elbow; without the criterion the elbow is beside the post."""
    table = hk.obstacle("table", Box(np.array([1.0, 1.0, 0.05])), (0.6, 0.0, -0.05))
    scene = hk.Scene([table, hk.obstacle("post", Capsule(0.02, 1.0), (-0.19, 0.0, 0.5))], clearance=0.02)
    panda, cube = hk.load("panda"), hk.workspace(box=([0.5, 0.05, 0.35], [0.03] * 3))
    advice, plain = hk.advise(hk.pose(panda), cube, scene=scene), hk.advise(hk.pose(panda), cube)
    proof = eval(advice.certify_by.removeprefix("Certify it by: "), {"hk": hk, "advice": advice})
    assert proof.whole and proof.findings.apart.min() > 0.08
    assert not hk.certify(plain.best.strategy, cube, plain.q0, scene=scene).whole
