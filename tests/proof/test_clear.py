"""Shapes that are proven to keep apart: no posture on the leaf inside brings them nearer than is said."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from benchmarks.random_arms import random_motion, random_posture, random_problem

import holokin as hk
from conftest import campaign, sampled
from holokin.base.errors import ArgumentError, HolokinError, UnknownNameError
from holokin.proof.cell_search import Extent
from holokin.proof.certificate import Certificate, digest
from holokin.proof.kept_apart import kept_apart
from holokin.proof.recheck import recheck
from holokin.robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, with_capsules

coal, pin = pytest.importorskip("coal"), pytest.importorskip("pinocchio")

Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
TABLE = hk.obstacle("table", Box(np.array([1.0, 1.0, 0.05])), (0.6, 0.0, -0.1))
POST = hk.obstacle("post", Capsule(0.02, 1.0), (0.45, -0.25, 0.5))


RULES = {"lock": hk.lock(2), "q1 - q3": hk.linear([1, 0, -1, 0, 0, 0, 0])}


@cache
def leaf(panda: hk.Robot, rule: str = "lock") -> hk.HolonomicStrategy:
    return hk.holonomic(hk.pose(panda), RULES[rule])


def box(panda: hk.Robot, half: float, **more: float) -> hk.Workspace:
    T = panda.pose(Q0)
    return hk.workspace(box=(T[:3, 3], [half] * 3), rotation=T[:3, :3], **more)


def postures(strategy: hk.HolonomicStrategy, space: hk.Workspace, count: int) -> np.ndarray:
    found = hk.ik(strategy, Q0).batch(space.poses(count))
    assert found.reached.all()
    return found.q


def _distance(*of: object) -> float:
    asked = coal.DistanceRequest()
    asked.enable_signed_distance = True
    return float(coal.distance(*of, asked, coal.DistanceResult()))


def coal_distances(robot: hk.Robot, pairs: object, things: list[LinkShape], Q: np.ndarray) -> np.ndarray:
    """(k, P) by coal, the frames of the joints by Pinocchio."""
    model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    data, shapes = model.createData(), {}
    for s in (*with_capsules(robot).shapes, *things):
        shapes.setdefault((s.link, s.joint), []).append(s)
    by_name = {link: of for (link, _), of in shapes.items()}
    out = np.empty((len(Q), len(pairs)))
    for i, q in enumerate(Q):
        pin.forwardKinematics(model, data, q)

        def placed(s: LinkShape) -> object:
            M = pin.SE3(s.placement)
            if s.joint >= 0:
                M = data.oMi[model.getJointId(robot.joints[s.joint].name)] * M
            return coal.Transform3s(M.rotation, M.translation)

        for p, pair in enumerate(pairs):
            one, other = (by_name[name] for name in pair.names)
            out[i, p] = min(_distance(a.shape.solid, placed(a), b.shape.solid, placed(b)) for a in one for b in other)
    return out


@sampled(1, "rule", RULES)
def test_no_posture_inside_is_nearer_than_is_proven(panda: hk.Robot, rule: str) -> None:
    strategy, space = leaf(panda, rule), box(panda, 0.02, tilt=0.0)
    found = hk.certify(strategy, space, Q0, scene=hk.Scene(obstacles=[TABLE, POST], clearance=0.02))
    assert found.whole
    pairs = found.demands.clear.pairs
    seen = coal_distances(panda, pairs, [TABLE, POST], postures(strategy, space, 60))
    least = found.findings.apart.min(axis=0)
    assert (seen.min(axis=0) >= least).all()
    nearest = int(np.argmin(seen.min(axis=0)))
    assert seen[:, nearest].min() - least.min() < 0.02, "a bound that says little is of no use"


@pytest.mark.parametrize("seed", [seed if seed in (4, 34) else campaign("seed", seed) for seed in range(40)])
def test_no_posture_of_a_random_arm_is_nearer_than_is_proven(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 3 to 8 joints with capsules about its links, among random obstacles; roots by Newton's method in NumPy."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    rng = np.random.default_rng([seed, 31])
    problem = random_problem(rng)
    limits = {"lower": np.maximum(problem.arm.lower, -9.0), "upper": np.minimum(problem.arm.upper, 9.0)}
    problem = replace(problem, arm=replace(problem.arm, **limits))  # Pinocchio has other numbers for turns without end
    start = random_posture(problem, rng, near=False)
    motion = random_motion("box", problem, start, rng)
    robot = with_capsules(problem.arm.robot, 0.01)
    strategy = hk.holonomic(hk.pose(robot) if problem.arm.turned else hk.position(robot), problem.law[1])
    kinds = [Capsule(0.05, 0.2), Cylinder(0.1, 0.3), Ellipsoid(np.array([0.05, 0.08, 0.12])), Box(np.full(3, 0.1))]
    tool = robot.pose(start)[:3, 3]
    things = [
        hk.obstacle(f"thing{k}", kind, tool + rng.normal(size=3), rng.uniform(-1, 1, 3))
        for k, kind in enumerate(rng.permutation(np.array(kinds, dtype=object)))
    ]
    try:
        proof = hk.certify(strategy, motion.where, start, scene=hk.Scene(things, clearance=0.0), budget=60)
    except HolokinError:  # singular, or touching at the start
        return
    if not len(proof):
        return
    boxes, pairs = proof.proven.boxes, proof.demands.clear.pairs
    cell = rng.integers(0, len(boxes), 40)
    u = (boxes.low[cell] + boxes.high[cell]) / 2 + (boxes.high - boxes.low)[cell] / 2 * rng.uniform(-1, 1, (40, 3))
    p, R = motion.poses(boxes.piece[cell], u)
    Q, _, converged = problem.roots(proof.cells.q0[cell], p, R, problem.level(start))
    seen = coal_distances(robot, pairs, things, Q)
    assert converged.all() and (seen >= proof.findings.apart[cell] - 1e-9).all()


def test_distances_at_postures_are_those_of_coal(panda: hk.Robot) -> None:
    rng, strategy = np.random.default_rng(1), leaf(panda)
    things = [
        hk.obstacle("ball", Capsule(0.05), (0.3, 0.4, 0.4)),
        hk.obstacle("drum", Cylinder(0.1, 0.3), (-0.3, 0.5, 0.6), (0.3, 0.2, 0.1)),
        hk.obstacle("egg", Ellipsoid(np.array([0.05, 0.08, 0.12])), (0.6, -0.5, 0.6)),
        hk.obstacle("wedge", Hull(rng.normal(size=(9, 3)) * 0.05), (0.2, -0.6, 0.5)),
        hk.obstacle("stone", Hull(rng.normal(size=(300, 3)) * 0.03), (-0.4, -0.5, 0.8)),
    ]
    clear = kept_apart(strategy, Q0, hk.Scene(things, clearance=0.0))
    assert clear is not None
    Q = rng.uniform(panda.lower, panda.upper, (60, 7))
    close = np.full(len(clear.pairs), np.inf)
    seen = coal_distances(panda, clear.pairs, things, Q)
    found = clear.distances(Q, close)
    apart = seen > 0.01
    assert (found[apart] <= seen[apart] + 1e-9).all()
    exact = np.array([not {"drum", "egg", "stone"} & {*pair.names} for pair in clear.pairs])
    assert exact.any() and not exact.all()
    np.testing.assert_allclose(found[:, exact][apart[:, exact]], seen[:, exact][apart[:, exact]], atol=2e-6)


def test_an_obstacle_that_is_one_millimetre_too_near_is_never_proven_away(panda: hk.Robot) -> None:
    strategy, space = leaf(panda), box(panda, 0.01)
    found = hk.certify(strategy, space, Q0, scene=hk.Scene(obstacles=[POST], clearance=0.0, self_collision=False))
    corners = np.array([np.ravel(c) for c in np.meshgrid(*[[-1.0, 1.0]] * 3)]).T
    T = np.tile(panda.pose(Q0), (8, 1, 1))
    T[:, :3, 3] += 0.01 * corners
    seen = coal_distances(panda, found.demands.clear.pairs, [POST], hk.ik(strategy, Q0).batch(T).q)
    nearest = float(seen.min())
    asked = hk.certify(
        strategy, space, Q0, scene=hk.Scene(obstacles=[POST], clearance=nearest + 0.001, self_collision=False)
    )
    assert not asked.whole and asked.extent is Extent.NEAR
    assert hk.certify(
        strategy, space, Q0, scene=hk.Scene(obstacles=[POST], clearance=nearest - 0.01, self_collision=False)
    ).whole


def test_a_corner_that_an_obstacle_takes_is_left_out_and_the_rest_is_proven(panda: hk.Robot) -> None:
    strategy, space = leaf(panda), box(panda, 0.02)
    T = panda.pose(Q0)
    corner = T[:3, 3] + 0.02
    ball = hk.obstacle("ball", Capsule(0.02), tuple(corner + [0.06, 0.06, 0.0]))
    found = hk.unique_region(
        strategy, Q0, space, scene=hk.Scene(obstacles=[ball], clearance=0.0, self_collision=False), budget=4000
    )
    poses = space.poses(300)
    inside = found.contains(poses)
    Q = hk.ik(strategy, Q0).batch(poses).q
    seen = coal_distances(panda, found.certificate.demands.clear.pairs, [ball], Q).min(axis=1)
    assert (seen < 0).any() and (seen[inside] > 0).all()
    assert 0.5 < found.share < 1.0


def test_along_a_path_with_a_floor(panda: hk.Robot) -> None:
    T = panda.pose(Q0)
    circle = hk.circle(T[:3, 3], center=T[:3, 3] - [0.1, 0.0, 0.0])
    found = hk.certify(leaf(panda), circle, Q0, scene=hk.Scene(floor=-0.2))
    assert found.whole and "floor" in {name for pair in found.demands.clear.pairs for name in pair.names}
    with pytest.raises(ArgumentError, match=r"panda_joint\d and floor overlap by 0\.\d+ m there"):
        hk.certify(leaf(panda), circle, Q0, scene=hk.Scene(floor=float(T[2, 3]) - 0.2, clearance=0.0))


@pytest.fixture(scope="module")
def certified(panda: hk.Robot) -> Certificate:
    return hk.certify(leaf(panda), box(panda, 0.01), Q0, scene=hk.Scene(obstacles=[TABLE], clearance=0.05))


@pytest.fixture(scope="module")
def good(certified: Certificate, tmp_path_factory: pytest.TempPathFactory) -> tuple[bool, str]:
    """What is said of the certificate that nobody changed."""
    return spoilt(certified, tmp_path_factory.mktemp("clear") / "good.json", lambda data: None)


def spoilt(certificate: Certificate, file: Path, change: object) -> tuple[bool, str]:
    data = json.loads(json.dumps(certificate.data))
    change(data)
    file.write_text(json.dumps(data | {"sha256": digest(data)}) + "\n", "utf-8")
    return recheck(file, robot=certificate.equation.strategy.task.robot)


def _cells(tree: object) -> list[dict]:
    return [tree] if isinstance(tree, dict) else [c for part in tree[2:] for c in _cells(part)] if tree else []


def _turn_planes(data: dict) -> None:
    for cell in _cells(data["pieces"][0]["cells"]):
        cell["planes"] = [[-x for x in plane] for plane in cell["planes"]]


def _no_planes(data: dict) -> None:
    for cell in _cells(data["pieces"][0]["cells"]):
        cell["planes"] = [[0.0, 0.0, 0.0] for _ in cell["planes"]]


def _claim_more(data: dict) -> None:
    for pair in data["clear"]["pairs"]:
        pair["apart"] += 0.5


def _grow(data: dict) -> None:
    data["clear"]["shapes"][0]["radius"] += 1.0


def _thinner(data: dict) -> None:
    for shape in data["clear"]["shapes"]:
        shape["radius"] *= 0.5


def _longer(data: dict) -> None:
    data["clear"]["joints"][3]["origin"][0] += 0.01


@pytest.mark.parametrize("change", [_turn_planes, _no_planes, _claim_more, _grow, _thinner, _longer])
def test_the_checker_verifies_it_and_rejects_what_was_changed(
    certified: Certificate, good: tuple[bool, str], tmp_path: Path, change: object
) -> None:
    assert certified.whole
    rejected, text = good
    assert not rejected and "m apart or more, 0.05 claimed" in text
    rejected, text = spoilt(certified, tmp_path / "bad.json", change)
    assert rejected, text


@pytest.mark.parametrize("tilt", [0.0, 0.03])
def test_no_joint_is_faster_than_is_proven(panda: hk.Robot, tilt: float) -> None:
    strategy, space = leaf(panda), box(panda, 0.004, tilt=tilt)
    rates = hk.proof.joint_rates(hk.certify(strategy, space, Q0))
    G = strategy.batch(postures(strategy, space, 300))
    linear, turning = (np.linalg.norm(G[:, :, part], axis=2).max(axis=0) for part in (slice(3), slice(3, 6)))
    assert (rates.per_speed >= linear - 1e-12).all() and (rates.per_speed <= 1.6 * linear + 1.7).all()
    if tilt:
        assert (rates.per_turn >= turning - 1e-12)[[0, 1, 3, 4, 5]].all()
    assert rates.per_speed[2] < 1e-12, "a locked joint stands still"
    assert rates.tool_speed <= (panda.max_velocity[[0, 1, 3, 4, 5, 6]] / linear[[0, 1, 3, 4, 5, 6]]).min()


def test_along_a_path_no_joint_is_faster_than_is_proven(panda: hk.Robot) -> None:
    T = panda.pose(Q0)
    circle = hk.circle(T[:3, 3], center=T[:3, 3] - [0.1, 0.0, 0.0])
    rates = hk.proof.joint_rates(hk.certify(leaf(panda), circle, Q0))
    t = hk.follow(leaf(panda), circle, Q0, samples=500)
    speeds = np.abs(np.diff(t.q, axis=0)) / np.linalg.norm(np.diff(t.x[:, :3], axis=0), axis=1)[:, None]
    assert (rates.per_speed >= speeds.max(axis=0) * (1 - 1e-3) - 1e-9).all()
    assert (rates.per_speed <= 2 * speeds.max(axis=0) + 0.1).all()


def test_of_two_tools_the_speed_is_that_of_the_fastest() -> None:
    """Both at the same speed: no joint is faster, over the speed of one, than is proven."""
    arm = hk.load("planar-3r")
    both = hk.compose(hk.robot.Part(arm, prefix="a_"), hk.robot.Part(arm, prefix="b_", on="base", pose=(0.0, 5.0, 0.0)))
    task = hk.stacked(*(hk.position(both, tip=tip.name) for tip in both.tips))
    G = hk.holonomic(task, hk.linear([[0, 1, -1, 0, 0, 0], [0, 0, 0, 0, 1, -1]]))
    q0 = np.array([0.3, 0.9, 0.9] * 2)
    x = [both.pose(q0, tip.name)[:3, 3] for tip in both.tips]
    paths = hk.path.synchronized(*(hk.line(p, p + [0.05, 0.0, 0.0]) for p in x))
    rates = hk.proof.joint_rates(hk.certify(G, paths, q0))
    t = hk.follow(G, paths, q0, samples=100)
    one = np.linalg.norm(np.diff([both.pose(q, both.tips[0].name)[:3, 3] for q in t.q], axis=0), axis=1)
    speeds = (np.abs(np.diff(t.q, axis=0)) / one[:, None]).max(axis=0)
    assert (rates.per_speed >= speeds * (1 - 1e-3)).all() and (rates.per_speed <= 1.5 * speeds).all()


@pytest.mark.parametrize(
    ("more", "word"),
    [
        ({"obstacles": [hk.obstacle("ball", Capsule(0.3), (0.3, 0.0, 0.5))]}, "ball"),
        ({"obstacles": [LinkShape("moving", 2, np.eye(4), Capsule(0.1), obstacle=True)]}, "still"),
        ({"obstacles": [hk.obstacle("table", Box(np.array([1000.0, 1000.0, 50.0])), (600.0, 0.0, -100.0))]}, "metres"),
        ({"floor": -800.0}, "metres"),
        ({"clearance": 200.0}, "metres"),
        ({"self_collision": False}, "obstacles"),
    ],
)
def test_what_cannot_be_asked_is_refused(panda: hk.Robot, more: dict, word: str) -> None:
    with pytest.raises(ArgumentError, match=word):
        hk.certify(leaf(panda), box(panda, 0.01), Q0, scene=hk.Scene(**more))


def test_an_unknown_link_is_refused(panda: hk.Robot) -> None:
    with pytest.raises(UnknownNameError):
        hk.certify(leaf(panda), box(panda, 0.01), Q0, scene=hk.Scene(obstacles=[TABLE], allowed=[("elbow", "table")]))
