"""Regions of tool poses over which a leaf is proven to be one function of the pose, and inverse kinematics in them."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import campaign, sampled, urdf
from holokin.app.report.plots import region_figure
from holokin.base.errors import ArgumentError, BranchError, HolokinError, NoProofError, OutOfReachError
from holokin.base.units import percentages
from holokin.motion.ik import InverseStatus
from holokin.motion.trajectory import Status
from holokin.proof import UniqueRegion, checker
from holokin.proof.box_proof import shares_of_turns

PANDA = np.array([0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8])
LAWS = {
    "lock 3": hk.lock(2), "q1 - q3": hk.linear([1, 0, -1, 0, 0, 0, 0]), "arm angle": hk.arm_angle(),
    "tilted": hk.strategies.constraints.tilted(hk.lock(2), lambda x: 0.3 * x[0] * x[1]),
}  # fmt: skip
FEW, SOME = 100, 800
"""Cells that a proof may examine: of a box, and of a square about the base."""


@cache
def of_panda(name: str, budget: int) -> UniqueRegion:
    """A box about the start, for a few cells: given, or found."""
    G = hk.holonomic(hk.pose(hk.load("panda")), LAWS[name])
    T = G.task.pose(PANDA)
    space = hk.workspace(box=(T[:3, 3], [0.015, 0.03, 0.015]), rotation=T[:3, :3]) if budget == FEW else None
    return hk.unique_region(G, PANDA, space, budget=budget)


@cache
def plane_arm() -> hk.strategies.HolonomicStrategy:
    return hk.holonomic(hk.position(hk.load("planar-3r")), hk.linear([[0.3, 0, 1]]))


R3 = np.array([0.3, 0.9, 0.7])


@cache
def around(budget: int) -> UniqueRegion:
    """What of a square of 5 m about the base hangs together with the start."""
    return hk.unique_region(plane_arm(), R3, hk.workspace(box=([0, 0], [2.5, 2.5])), limits=False, budget=budget)


of_cells = pytest.mark.parametrize("budget", [SOME, campaign("budget", 2_000)])


def walks(region: UniqueRegion, count: int, seed: int) -> np.ndarray:
    """Tool poses of a random walk in a box."""
    rng, space = np.random.default_rng(seed), region.workspace
    steps = np.cumsum(0.2 * space.solid.half * rng.normal(size=(count, 3)), axis=0)
    folded = np.abs((steps / space.solid.half + 1) % 4 - 2) - 1  # reflected at the sides
    return space.at(space.solid.center + 0.999 * folded * space.solid.half)


@pytest.mark.campaign
@sampled(1, "name", LAWS)
def test_a_box_is_found_and_random_loops_in_it_bring_the_joints_back(name: str) -> None:
    """Splines through ten poses of it, followed; Pinocchio says that the tool is where it should be."""
    region = of_panda(name, 600)
    assert region.whole and region.share == 1.0 and region.workspace.solid.half.min() > 0.01
    assert region.contains(region.strategy.task.pose(PANDA)[None]).all()
    model = pin.buildModelFromUrdf(str(urdf("panda.urdf")))
    model = pin.buildReducedModel(
        model, [model.getJointId(f"panda_finger_joint{i}") for i in (1, 2)], pin.neutral(model)
    )
    data, hand = model.createData(), model.getFrameId("panda_hand")
    offset = None
    for seed in range(2):
        tool = region.strategy.task.pose(PANDA)
        loop = hk.spline([tool, *walks(region, 10, seed)], closed=True)
        walk = hk.follow(region.strategy, loop, PANDA, samples=400)
        assert walk.status is Status.COMPLETE and np.abs(walk.q[-1] - PANDA).max() < 1e-10
        for q in walk.q[::80]:
            pin.framesForwardKinematics(model, data, q)
            off = np.linalg.inv(data.oMf[hand].homogeneous) @ region.strategy.task.pose(q)
            offset = off if offset is None else offset
            assert np.abs(off - offset).max() < 1e-10  # from the hand to our tip it is one transform


@pytest.mark.parametrize(("steps", "seed"), [(100, 7), *(campaign(("steps", "seed"), (100_000, k)) for k in range(10))])
def test_inside_ik_and_near_agree_whatever_the_tool_did_before(steps: int, seed: int) -> None:
    region = of_panda("lock 3", FEW if steps < 1000 else 600)
    ik, plain = hk.ik(region.strategy, PANDA, region=region), hk.ik(region.strategy, PANDA)
    q, poses = PANDA, walks(region, steps, seed)
    assert region.contains(poses).all()
    for i, pose in enumerate(poses):
        q = ik.near(pose, q)
        if i % (steps // 50) == 0:
            assert np.abs(ik(pose) - q).max() < 1e-10 and ik.agrees(q)
    found = ik.batch(poses[-100:])
    assert found.reached.all() and np.abs(found.q[-1] - q).max() < 1e-10
    assert np.abs(plain.batch(poses[-100:]).q - found.q).max() < 1e-10  # the box is convex: straight lines stay in it


def test_a_pose_outside_is_refused_and_another_orientation_is_outside() -> None:
    region = of_panda("lock 3", FEW)
    ik, poses = hk.ik(region.strategy, PANDA, region=region), walks(region, 3, 1)
    poses[1, :3, 3] += [0.4, 0, 0]
    poses[2, :3, :3] = poses[2, :3, :3] @ np.diag([-1.0, -1.0, 1.0])
    assert region.contains(poses).tolist() == [True, False, False]
    assert ik.batch(poses).status.tolist() == [InverseStatus.REACHED, InverseStatus.OUTSIDE, InverseStatus.OUTSIDE]
    for pose in poses[1:]:
        with pytest.raises(OutOfReachError, match="larger region"):
            ik(pose)
        with pytest.raises(OutOfReachError):
            ik.near(pose, PANDA)


def test_from_a_posture_a_turn_further_near_says_that_it_is_another_one() -> None:
    region = of_panda("lock 3", FEW)
    turned = PANDA + 2 * np.pi * np.eye(7)[0]
    ik = hk.ik(region.strategy, PANDA, region=region, limits=False)
    plain = hk.ik(region.strategy, PANDA, limits=False)
    pose = walks(region, 1, 3)[0]
    there = plain.near(pose, turned)
    assert there[0] - plain(pose)[0] == pytest.approx(2 * np.pi) and not plain.agrees(there)
    with pytest.raises(BranchError, match=r"other joints than those of ik\(pose\)"):
        ik.near(pose, turned)


@of_cells
def test_of_a_plane_round_the_base_the_part_is_found_on_which_a_closed_form_is_one_function(budget: int) -> None:
    """A planar arm with q3 + 0.3 q1 tied: its cells' postures are on the leaf, at the pose, and one for each pose."""
    region = around(budget)
    assert not region.whole and 0.05 < region.share < 1
    poses = region.workspace.poses(3_000, seed=3)
    inside = region.contains(poses)
    assert inside.mean() == pytest.approx(region.share, abs=4 * np.sqrt(0.25 / len(poses)))
    ik = hk.ik(region.strategy, R3, region=region)
    found = ik.batch(poses)
    assert (found.reached == inside).all()
    q = found.q[inside]
    a, (x, y) = np.cumsum(q, axis=1), poses[inside, :2, 3].T
    assert np.abs(np.cos(a).sum(axis=1) - x).max() < 1e-10 and np.abs(np.sin(a).sum(axis=1) - y).max() < 1e-10
    assert np.abs(q[:, 2] + 0.3 * q[:, 0] - R3[2] - 0.3 * R3[0]).max() < 1e-12
    points = poses[inside][:, :2, 3]
    near = np.linalg.norm(points[:, None] - points[None], axis=2)
    i, j = np.nonzero((near > 0) & (near < 0.08))
    assert len(i) > 100 and np.abs(q[i] - q[j]).max() < 0.5  # no jump between poses beside each other
    shares = region.rest
    assert sum(shares.values()) == pytest.approx(1 - region.share, abs=4 * np.sqrt(0.25 / 1000))
    assert shares["beyond a joint limit"] == 0.0 and "by 1,000 poses" in region.sentence


@of_cells
def test_the_independent_checker_verifies_a_part_of_a_workspace(tmp_path: Path, budget: int) -> None:
    """And the share that it computes itself."""
    file = around(budget).certificate.save(tmp_path / "part.json")
    lines = checker.check(str(file)).lines
    assert any(f"{100 * around(budget).share:.3g} % of a box of poses" in line for line in lines)


@pytest.mark.campaign
def test_a_path_round_a_cusp_has_the_certificate_that_it_does_not_return(tmp_path: Path) -> None:
    """Its joints are proven to be others at the end; the independent checker finds the same difference."""
    strategy = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
    witness = hk.cusps(strategy, [0.0, 0.4, 0.2, -1.8, 0.1, 2.2, 0.8], starts=200).most_regular
    assert witness is not None
    proof = hk.certify(strategy, witness.path, witness.first)
    assert proof.covered and not proof.whole and proof.extent.name == "ELSEWHERE"
    moved = witness.second - witness.first
    assert (proof.revisit.low <= moved + 1e-9).all() and (moved - 1e-9 <= proof.revisit.high).all()
    lines = checker.check(str(proof.save(tmp_path / "round.json"))).lines
    assert any("the joints do NOT return" in line for line in lines)


@pytest.mark.campaign
def test_a_workspace_that_holds_a_path_round_a_cusp_is_never_whole() -> None:
    """Whatever the budget: on the path the leaf is no function of the pose."""
    strategy = hk.holonomic(hk.position(hk.load("planar-3r")), hk.linear([[0.02, 0, 1]]))
    q0 = np.array([-3.0, 0.9, 0.9])
    tool = strategy.task.pose(q0)[:3, 3]
    side = 1.1 * np.linalg.norm(tool[:2])
    region = hk.unique_region(strategy, q0, hk.workspace(box=([0, 0], [side, side])), limits=False, budget=4_000)
    loop = hk.circle(tool, center=[0, 0, tool[2]])
    assert hk.certify(strategy, loop, q0, limits=False).extent.name == "ELSEWHERE"
    walk = hk.follow(strategy, loop, q0, samples=200, limits=False)
    assert not region.contains([strategy.task.pose(q) for q in walk.q]).all()


def test_the_picture_shows_proven_poses_and_what_the_others_are() -> None:
    """Each cell has the colour of its pose, asked again; the legend names what is there."""
    region = around(SOME)
    figure = region_figure(region, 12)
    (image,) = figure.axes[0].images
    shown = image.get_array()
    side = 2.5 * (2 * (np.arange(12) + 0.5) / 12 - 1)
    x, y = np.meshgrid(side, side)
    poses = region.workspace.at(np.column_stack([x.ravel(), y.ravel(), np.zeros(144)]))
    assert np.array_equal(shown.ravel() == 0, region.contains(poses)) and (shown == 0).any() and (shown > 0).any()
    assert {text.get_text() for text in figure.legends[0].get_texts()} >= {"proven", "the leaf ends"}


def test_bad_input_is_refused_with_a_cure() -> None:
    strategy = plane_arm()
    square = hk.workspace(box=([1, 1], [0.1, 0.1]))
    with pytest.raises(NoProofError, match="it has no leaves"):
        hk.unique_region(hk.moore_penrose(strategy.task), R3)
    with pytest.raises(ArgumentError, match="give a box"):
        hk.unique_region(strategy, R3, hk.workspace(sphere=([1, 1], 0.1)))
    with pytest.raises(ArgumentError, match="give a box that holds the tool pose of q0"):
        hk.unique_region(strategy, R3, hk.workspace(box=([0, 0], [1.5, 1.5])), limits=False)
    for poses in (np.eye(4), [[1, 2, 3]], [np.eye(4) + np.eye(4)[3]], [np.nan * np.eye(4)]):
        with pytest.raises(HolokinError, match=r"poses? .*asked about"):
            around(SOME).contains(poses)
    assert around(SOME).contains([]).shape == (0,)
    with pytest.raises(ArgumentError, match="a workspace has its own"):
        hk.unique_region(strategy, R3, square, tilt=0.1)
    with pytest.raises(ArgumentError, match=r"hk\.unique_region\(strategy, q0\)"):
        hk.ik(strategy, R3, region=of_panda("lock 3", FEW))
    other = hk.holonomic(strategy.task, hk.lock(2))
    with pytest.raises(ArgumentError, match="of the same strategy"):
        hk.ik(other, R3, region=around(SOME))
    with pytest.raises(ArgumentError, match="of the same strategy"):
        hk.ik(strategy, R3 + 0.1, region=around(SOME))  # another leaf


# --- How the region about a start grows: never less than a box that is proven whole, and its shares are of even poses.

SEEDS = [0, *(campaign("seed", k) for k in range(1, 30))]


def turned(T: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """The pose, spun about the tool's z axis by angles (k,)."""
    out = np.tile(T, (len(angles), 1, 1))
    out[:, :3, :3] = T[:3, :3] @ Rotation.from_rotvec(angles[:, None] * [0, 0, 1]).as_matrix()
    return out


def said(sentence: str) -> list[float]:
    """The percentages of a sentence."""
    return [float(text) for text in re.findall(r"([\d.]+) %", sentence)]


@pytest.mark.campaign
@pytest.mark.parametrize("seed", SEEDS)
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


@pytest.mark.parametrize("seed", SEEDS)
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


@pytest.mark.campaign
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


@pytest.mark.parametrize("seed", SEEDS)
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
