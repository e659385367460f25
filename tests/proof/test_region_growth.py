"""How the region about a start grows: never less than a box that is proven whole, and its shares are of even poses."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import campaign
from holokin.base.errors import ArgumentError
from holokin.base.units import percentages
from holokin.proof.box_proof import shares_of_turns

SOME = [0, *(campaign("seed", k) for k in range(1, 30))]


def turned(T: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """The pose, spun about the tool's z axis by angles (k,)."""
    out = np.tile(T, (len(angles), 1, 1))
    out[:, :3, :3] = T[:3, :3] @ Rotation.from_rotvec(angles[:, None] * [0, 0, 1]).as_matrix()
    return out


def said(sentence: str) -> list[float]:
    """The percentages of a sentence."""
    return [float(text) for text in re.findall(r"([\d.]+) %", sentence)]


@pytest.mark.parametrize("seed", SOME)
def test_near_a_fold_the_pose_of_the_start_is_in_and_a_larger_budget_never_proves_less(seed: int) -> None:
    """A planar arm with its last joint locked is one of two links: on a leaf the elbow stays on its side."""
    rng = np.random.default_rng(seed)
    a, q3, near = rng.uniform(0.4, 1.2, 3), rng.uniform(-0.8, 0.8), 10 ** rng.uniform(-3, -1)
    rows = [{"a": float(x), "lower": -3.0, "upper": 3.0, "max_velocity": 2.0} for x in a]
    strategy = hk.holonomic(hk.position(hk.from_dh(rows, name="plane")), hk.lock(2))
    stretched = -np.arctan2(a[2] * np.sin(q3), a[1] + a[2] * np.cos(q3))  # link 1 in line with the tool
    q0 = np.array([0.3, stretched + rng.choice([-1, 1]) * near, q3])
    T = strategy.task.pose(q0)
    space = hk.workspace(box=(T[:2, 3], rng.uniform(0.01, 0.05, 2)))
    poses, before = space.poses(500, seed=seed), (0.0, np.zeros(500, dtype=bool))
    for budget in (200, 600):
        region = hk.unique_region(strategy, q0, space, limits=False, budget=budget)
        inside = region.contains(poses)
        assert region.holds_start and region.contains([T]).all()
        assert region.share >= before[0] - 1e-12 and inside[before[1]].all()
        before = region.share, inside
    ik = hk.ik(strategy, q0, region=region)
    found = ik.batch(poses)
    assert (found.reached == inside).all() and np.abs(ik(T) - q0).max() < 1e-9
    elbows = np.sin(found.q[inside][:, 1] - stretched)
    assert (np.sign(elbows) == np.sign(q0[1] - stretched)).all()
    assert inside.mean() == pytest.approx(region.share, abs=4 * np.sqrt(0.25 / len(poses)))


def test_a_start_whose_cell_is_not_proven_is_said_and_inverse_refuses_the_region_with_it() -> None:
    strategy = hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(2))
    q0 = np.array([0.3, -0.349, 0.7])
    space = hk.workspace(box=(strategy.task.pose(q0)[:2, 3], [0.05, 0.05]))
    region = hk.unique_region(strategy, q0, space, limits=False, budget=8)
    assert not region.holds_start and "the pose of q0 is not proven" in region.sentence
    assert "the pose of the start is not proven" in region.certificate.theorem or not len(region.certificate)
    with pytest.raises(ArgumentError, match="the pose of q0 is not proven"):
        hk.ik(strategy, q0, region=region)


@pytest.mark.parametrize("seed", SOME)
def test_a_box_that_certify_proves_is_proven_whole_however_wide_the_spin(seed: int) -> None:
    """In a plane, with a spin, from a start that is not in the middle; one in three with the spin of the case."""
    rng = np.random.default_rng(seed)
    rows = [{"a": a, "lower": -x, "upper": x, "max_velocity": 2.0} for a, x in ((1, 3), (1, 3), (1, 3), (0.05, 2.9))]
    strategy = hk.holonomic(hk.pose(hk.from_dh(rows, name="plane")), hk.lock(0))
    q0 = np.array([0.0, 0.4, 1.3, 0.0]) + rng.uniform(-0.05, 0.05, 4)
    T, spin = strategy.task.pose(q0), 2.5 if seed % 3 == 0 else rng.uniform(0.2, 2.6)
    half = np.append(rng.uniform(0.005, 0.03, 2), 0.0)
    space = hk.workspace(box=(T[:3, 3] + half * rng.uniform(-0.5, 0.5, 3), half), rotation=T[:3, :3], spin=spin)
    whole, region = hk.certify(strategy, space, q0).whole, hk.unique_region(strategy, q0, space)
    assert whole and region.whole and region.share == 1.0 and region.holds_start
    assert region.contains(turned(T, np.linspace(-spin, spin, 7))).all()


SPATIAL = {
    "panda": (0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5),
    "iiwa14": (0.1, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0),
    "ur5e": (0.2, -1.2, 1.4, -1.3, -1.4, 0.5),
}


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("name", SPATIAL)
def test_so_is_a_box_of_a_spatial_arm(name: str, seed: int) -> None:
    """Round a start that is not in the middle, with a tilt, a spin or neither; a UR5e has its spin free."""
    rng, robot = np.random.default_rng([seed, len(name)]), hk.load(name)
    q0 = np.array(SPATIAL[name]) + rng.uniform(-0.2, 0.2, robot.n)
    task = hk.pose(robot, "axis" if robot.n == 6 else "twist")
    strategy = hk.holonomic(task, hk.lock(5 if robot.n == 6 else int(rng.choice([0, 2, 6]))))
    T, half = robot.pose(q0), rng.uniform(0.003, 0.008, 3)
    turns = ({}, {"tilt": rng.uniform(0.0, 0.02)}, {"spin": rng.uniform(0.0, 0.2)})[seed % 3]
    space = hk.workspace(box=(T[:3, 3] + half * rng.uniform(-0.5, 0.5, 3), half), rotation=T[:3, :3], **turns)
    if hk.certify(strategy, space, q0, budget=3_000).whole:
        region = hk.unique_region(strategy, q0, space, budget=3_000)
        assert region.whole and region.share == 1.0 and region.holds_start


def test_a_share_of_spins_is_that_of_even_spins_and_shares_of_a_sentence_add_up_to_all() -> None:
    """A joint that ends at 1.2 rad; no share of Cayley parameters, which would be 40 % for 58 %."""
    rows = [{"a": a, "lower": -x, "upper": x, "max_velocity": 2.0} for a, x in ((1, 3), (1, 3), (1, 3), (0.05, 1.2))]
    strategy = hk.holonomic(hk.pose(hk.from_dh(rows, name="plane")), hk.lock(0))
    q0 = np.array([0.0, 0.4, 1.3, 0.0])
    T = strategy.task.pose(q0)
    space = hk.workspace(box=(T[:3, 3], [0.03, 0.03, 0]), rotation=T[:3, :3], spin=2.0)
    region = hk.unique_region(strategy, q0, space, budget=600)
    inside = region.contains(space.poses(4_000))
    assert 0.5 < region.share == pytest.approx(inside.mean(), abs=4 * np.sqrt(0.25 / 4_000))
    assert region.share + sum(region.parts.shares.values()) == pytest.approx(1.0, abs=1e-9)
    assert sum(region.rest.values()) == pytest.approx(1 - region.share, abs=1e-12)
    assert sum(said(region.sentence)) == pytest.approx(100, abs=0.05) and "e+" not in region.sentence


@pytest.mark.parametrize("seed", SOME)
def test_boxes_of_turns_are_weighed_as_even_poses_are_spread(seed: int) -> None:
    """Random tilts and spins, cut into 27 boxes of Cayley parameters, against poses of the workspace."""
    rng = np.random.default_rng(seed)
    tilt, spin = rng.uniform(0.05, 2.9), rng.uniform(0.05, 3.0)
    poses = hk.workspace(box=([0, 0, 0], [1, 1, 1]), rotation=np.eye(3), tilt=tilt, spin=spin).poses(2**14, seed=seed)
    quaternion = Rotation.from_matrix(poses[:, :3, :3]).as_quat(canonical=True)
    c, t = quaternion[:, :3] / quaternion[:, 3:], np.tan(np.array([tilt, spin]) / 2)
    far = np.array([t[0] * np.hypot(1, t[1])] * 2 + [t[1]])
    cuts = np.sort(np.tanh(rng.normal(size=(3, 2))), axis=1) * np.minimum(far, 2.0)[:, None]
    edges = np.column_stack([-far, cuts, far])
    index = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    low, high = (np.take_along_axis(edges.T, index + k, axis=0) for k in (0, 1))
    shares = shares_of_turns(low, high, *t)
    counted = np.array([((a <= c) & (c <= b)).all(axis=1).mean() for a, b in zip(low, high, strict=True)])
    assert shares.sum() == pytest.approx(1, abs=1e-5) and (shares >= 0).all()
    assert np.abs(shares - counted).max() < 4 * np.sqrt(0.25 / len(c))


@pytest.mark.parametrize("seed", range(20))
def test_percentages_add_up_and_nothing_that_is_there_is_called_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shares = rng.dirichlet(10 ** rng.uniform(-3, 0, int(rng.integers(2, 6))))
    shares /= shares.sum()
    texts = percentages(shares)
    numbers = [float(text.removeprefix("under ").removeprefix("over ").removesuffix(" %")) for text in texts]
    exact = [n for n, text in zip(numbers, texts, strict=True) if text[0].isdigit()]
    assert "e" not in " ".join(texts).replace("under", "").replace("over", "")
    assert numbers[0] <= max(100 * shares[0], 0.1) and np.abs(np.array(numbers) - 100 * shares).max() <= 0.4
    assert len(exact) < len(texts) or sum(exact) == pytest.approx(100)
    assert all(share == 0 or text != "0 %" for share, text in zip(shares, texts, strict=True))
