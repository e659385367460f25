"""Distances of `check`: closed forms, coal, MuJoCo and Pinocchio on the same models; bounds between samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import holokin as hk
from conftest import PANDA_START, campaign, urdf
from holokin.motion.checks.clearance import ACCURACY, LinkGap, floor_gap, link_gap, links_of, segment_distance, sweep
from holokin.robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Shape
from holokin.robot.tree import joint_frames

coal = pytest.importorskip("coal")

FRAME = np.eye(4)


def turned(seed: int, size: float = 0.6) -> np.ndarray:
    """A random pose (4, 4)."""
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T[:3, 0] *= np.linalg.det(T[:3, :3])
    T[:3, 3] = rng.uniform(-size, size, 3)
    return T


def gap_of(one: Shape, T: np.ndarray, other: Shape, S: np.ndarray) -> LinkGap:
    """The gap of two shapes, of which the first moves along z with a slider."""
    robot = hk.from_dh([{"joint": "slide", "kind": "prismatic", "lower": -1, "upper": 1}])
    links = links_of([LinkShape("one", 0, T, one), LinkShape("other", -1, S, other)])
    return link_gap(robot, links[0], links[1], np.ones(1))


def distance(one: Shape, T: np.ndarray, other: Shape, S: np.ndarray) -> float:
    robot = hk.from_dh([{"joint": "slide", "kind": "prismatic"}])
    return float(gap_of(one, T, other, S).distances(joint_frames(robot, np.zeros((1, 1))), np.arange(1), 0.0)[0])


def at(x: float, y: float, z: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


@pytest.mark.parametrize(
    ("one", "T", "other", "S", "wanted"),
    [
        (Capsule(0.1), FRAME, Capsule(0.2), at(0.3, 0.4, 0), 0.5 - 0.3),
        (Capsule(0.1, 1.0), FRAME, Capsule(0.1, 1.0), at(0.3, 0, 0.8), 0.3 - 0.2),
        (Capsule(0.1, 1.0), FRAME, Capsule(0.1, 1.0), at(0, 0, 1.5), 0.5 - 0.2),
        (Capsule(0.1), FRAME, Box([0.2, 0.2, 0.2]), at(0.5, 0, 0), 0.5 - 0.1 - 0.1),
        (Box([0.2, 0.4, 0.6]), FRAME, Box([0.2, 0.2, 0.2]), at(0.4, 0.5, 0), np.hypot(0.2, 0.2)),
        (Cylinder(0.1, 0.4), FRAME, Cylinder(0.2, 0.4), at(0, 0.5, 0), 0.2),
        (Ellipsoid([0.1, 0.2, 0.3]), FRAME, Capsule(0.05), at(0, 0, 0.5), 0.15),
        (Hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), FRAME, Capsule(0.1), at(1, 1, 1), 2 / np.sqrt(3) - 0.1),
        (Hull([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), FRAME, Capsule(0.1), at(0.5, 0.5, 0.4), 0.3 - 5e-5),
        (Capsule(0.1, 1.0), FRAME, Capsule(0.2, 1.0), at(0.2, 0, 0), 0.2 - 0.3),
    ],
)
def test_a_distance_is_that_of_the_closed_form(
    one: Shape, T: np.ndarray, other: Shape, S: np.ndarray, wanted: float
) -> None:
    assert distance(one, T, other, S) == pytest.approx(wanted, abs=2e-6)


@given(seed=st.integers(0, 10**6), lengths=st.tuples(*[st.sampled_from([0.0, 0.3, 1.0])] * 2))
def test_capsules_are_as_far_apart_as_coal_finds(seed: int, lengths: tuple[float, float]) -> None:
    one, other = Capsule(0.05, lengths[0]), Capsule(0.07, lengths[1])
    T, S = turned(seed), turned(seed + 1)
    ends = [coal.Transform3s(P[:3, :3], P[:3, 3]) for P in (T, S)]
    result = coal.DistanceResult()
    found = coal.distance(one.solid, ends[0], other.solid, ends[1], coal.DistanceRequest(), result)
    assert distance(one, T, other, S) == pytest.approx(found, abs=2e-6)


@pytest.mark.parametrize("v", [[0, 0, 1.0], [0, 0, 0.0], [0, 1e-9, 1.0], [0, 0, -0.5]])
def test_parallel_and_vanishing_segments_have_a_distance(v: list[float]) -> None:
    p, u, x = np.zeros((1, 3)), np.array([[0, 0, 0.5]]), np.array([[0.3, 0, 0.2]])
    assert segment_distance(p, u, x, np.array([v])) == pytest.approx(0.3, abs=1e-9)


@given(seed=st.integers(0, 10**6))
def test_a_support_is_that_of_the_points_of_the_shape(seed: int) -> None:
    """Of points on the surface none is farther along a direction, and some are nearly so far."""
    rng = np.random.default_rng(seed)
    ball = rng.normal(size=(4000, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    sides = rng.uniform(0.1, 1, 3)
    disc = ball[:, :2] / np.linalg.norm(ball[:, :2], axis=1)[:, None]
    rims = np.column_stack([0.3 * disc, 0.25 * np.sign(ball[:, 2])])
    clouds = {
        Box(sides): np.sign(ball) * sides / 2, Ellipsoid(sides): ball * sides, Cylinder(0.3, 0.5): rims,
        Capsule(0.2, 0.6): 0.2 * ball + np.outer(np.sign(ball[:, 2]), [0, 0, 0.3]), Hull(ball[:50]): ball[:50],
    }  # fmt: skip
    d = ball[:1]
    for shape, points in clouds.items():
        most = float((points @ d[0]).max())
        assert most - 1e-12 <= shape.support(d)[0] <= most + 2e-2
        center, radius = shape.ball
        assert np.linalg.norm(points - center, axis=1).max() <= radius + 1e-12


MJCF = """<mujoco><worldbody><geom name="post" type="box" size=".1 .1 .3" pos=".6 0 .3"/>
<body name="a" pos="0 0 .2"><joint name="j1" axis="0 0 1"/><geom type="capsule" fromto="0 0 0 .3 0 .1" size=".05"/>
 <body name="b" pos=".4 0 .1"><joint name="j2" axis="0 1 0"/><geom type="cylinder" fromto="0 0 0 .2 0 0" size=".04"/>
  <geom type="box" size=".03 .06 .02" pos=".25 0 0"/><geom contype="0" conaffinity="0" type="sphere" size="1"/>
  <body name="c" pos=".35 0 0"><joint name="j3" axis="0 1 0"/>
   <geom type="mesh" mesh="m" pos=".1 0 0" euler="10 20 30"/><geom type="ellipsoid" size=".03 .04 .08" pos=".2 0 0"/>
  </body></body></body></worldbody>
<asset><mesh name="m" vertex="0 0 0 .1 0 0 0 .08 0 0 0 .06 .05 .05 .05"/></asset></mujoco>"""


def test_links_of_mjcf_are_as_far_apart_as_mujoco_finds() -> None:
    mujoco = pytest.importorskip("mujoco")
    robot = hk.robot.from_mjcf(MJCF, tip="c")
    model = mujoco.MjModel.from_xml_string(MJCF)
    data = mujoco.MjData(model)
    links = {link.name: link for link in links_of(robot.shapes)}
    assert sorted(links) == ["a", "b", "c", "post"]  # and not the geom that touches nothing
    Q = np.random.default_rng(0).uniform(-2.5, 2.5, (60, 3))
    frames, rows = joint_frames(robot, Q), np.arange(len(Q))
    bodies = {name: model.body(name if name != "post" else "world").id for name in links}
    for one, other in (("c", "post"), ("b", "post"), ("a", "c")):
        found = link_gap(robot, links[one], links[other], np.zeros(3)).distances(frames, rows, 0.0)
        geoms = [[g for g in range(model.ngeom) if model.geom_bodyid[g] == bodies[n]] for n in (one, other)]
        wanted = []
        for q in Q:
            data.qpos[:] = q
            mujoco.mj_forward(model, data)
            pairs = [(g, h) for g in geoms[0] for h in geoms[1] if model.geom_contype[g]]
            wanted.append(min(mujoco.mj_geomDistance(model, data, g, h, 10.0, None) for g, h in pairs))
        apart = np.array(wanted) > 0
        np.testing.assert_allclose(found[apart], np.array(wanted)[apart], atol=1e-5)
        np.testing.assert_allclose(found[~apart], np.array(wanted)[~apart], atol=1e-3)  # two paths to find a depth
        assert min(wanted) < 0.1  # some are near


def pinocchio_least(file: str, q: np.ndarray, names: tuple[str, ...], pairs: list[tuple[str, str]]) -> list[float]:
    """Distances of the meshes themselves, of pairs of links, at a posture of named joints; others at zero."""
    pin = pytest.importorskip("pinocchio")
    path = urdf(file)
    root = str(next(p for p in path.parents if p.name == "share"))
    model = pin.buildModelFromUrdf(str(path))
    geometry = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=[root])
    values = pin.neutral(model)
    for name, value in zip(names, q, strict=True):
        values[model.joints[model.getJointId(name)].idx_q] = value
    of = {link: [i for i, g in enumerate(geometry.geometryObjects) if g.name.rsplit("_", 1)[0] == link]
          for pair in pairs for link in pair}  # fmt: skip
    for one, other in pairs:
        for i in of[one]:
            for j in of[other]:
                geometry.addCollisionPair(pin.CollisionPair(i, j))
    data, seen = model.createData(), geometry.createData()
    pin.computeDistances(model, data, geometry, seen, values)
    found, k = [], 0
    for one, other in pairs:
        count = len(of[one]) * len(of[other])
        found.append(min(seen.distanceResults[k + i].min_distance for i in range(count)))
        k += count
    return found


ARMS = {"panda.urdf": ("panda_hand", {"panda_finger_joint1": 0.0}), "ur5_robot.urdf": ("ee_link", {})}


@pytest.fixture(scope="module", params=["panda.urdf", campaign("arm", "ur5_robot.urdf")])
def arm(request: pytest.FixtureRequest) -> tuple[str, hk.Robot]:
    tip, locked = ARMS[request.param]
    return request.param, hk.load(urdf(request.param), tip=tip, locked=locked)


def test_a_pair_is_as_near_as_pinocchio_finds_or_its_hulls_are_nearer(arm: tuple[str, hk.Robot]) -> None:
    """Below the clearance the distance is that of the meshes; above, that of the hulls, never larger."""
    file, robot = arm
    rng = np.random.default_rng(3)
    near = 0
    for _ in range(3):
        q = rng.uniform(np.maximum(robot.lower, -2.5), np.minimum(robot.upper, 2.5))
        report = hk.check(q[None], hk.Scene(clearance=0.05), robot=robot, limits=False)
        wanted = pinocchio_least(file, q, robot.joint_names, [one.pair for one in report.pairs])
        for one, exact in zip(report.pairs, wanted, strict=True):
            assert one.least <= max(exact, 0.0) + 1e-6
            if one.least < 0.05:
                near += 1
                assert one.least == pytest.approx(max(exact, 0.0), abs=1e-6)
    assert near > 2


def test_a_folded_panda_touches_itself_where_pinocchio_says_so() -> None:
    robot = hk.load(urdf("panda.urdf"), tip="panda_hand", locked={"panda_finger_joint1": 0.0})
    q = np.array([0.0, 1.2, 0.0, -3.05, 0.0, 0.2, 0.8])
    report = hk.check(q[None], robot=robot, limits=False)
    told = {one.what: one.value for one in report.findings if one.value <= 0}
    pairs = [one.pair for one in report.pairs]
    exact = dict(zip(pairs, pinocchio_least("panda.urdf", q, robot.joint_names, pairs), strict=True))
    assert told
    assert {pair for pair, value in exact.items() if value <= 0} == set(told)
    clear = hk.check(PANDA_START[None], robot=robot, limits=False)
    assert clear.passed and clear.clearance > 0.01


@pytest.mark.parametrize("name", ["panda", "irb140", "rail-ur10e", "yumi", "ppr"])
def test_a_distance_changes_no_faster_than_its_weights_say(name: str) -> None:
    """|d(q) - d(q')| <= weights . |q - q'|, of links from each other, of two arms, from a ball and from the floor."""
    robot = hk.robot.with_capsules(hk.load(name), 0.05)
    rng = np.random.default_rng(1)
    lower, upper = np.maximum(robot.lower, -3), np.minimum(robot.upper, 3)
    Q = rng.uniform(lower, upper, (400, robot.n))
    steps = 0.02 * rng.normal(size=Q.shape) * (rng.random(Q.shape) < 0.4)
    travel = np.full(len(robot.joints), 3.5)
    ball = links_of([hk.obstacle("ball", Capsule(0.05), [0.4, 0.3, 0.2])])[0]
    links = links_of(robot.shapes)
    gaps = [link_gap(robot, one, other, travel) for i, one in enumerate(links) for other in (*links[:i], ball)]
    gaps += [floor_gap(robot, link, 0.0, travel) for link in links]
    frames, others, rows = joint_frames(robot, Q), joint_frames(robot, Q + steps), np.arange(len(Q))
    used = []
    for gap in gaps:
        change = np.abs(gap.distances(others, rows, 0.0) - gap.distances(frames, rows, 0.0))
        most = np.abs(steps) @ gap.weights
        assert (change <= most + 1e-9).all(), gap.names
        used.append(np.max(change[most > 0] / most[most > 0], initial=0.0))
    assert max(used) > 0.7  # weights much smaller would not do


@pytest.mark.campaign
@given(seed=st.integers(0, 10**6), few=st.integers(2, 9))
def test_nowhere_on_a_motion_are_links_nearer_than_the_bound(seed: int, few: int) -> None:
    """Coarse samples, looked at 400 times as closely: never below the bound; the least found is nearly the least."""
    robot = hk.robot.with_capsules(hk.load("panda"))
    rng = np.random.default_rng(seed)
    q = rng.uniform(robot.lower, robot.upper, (few, robot.n))
    links = links_of(robot.shapes)
    gaps = [link_gap(robot, one, other, np.zeros(7)) for i, one in enumerate(links) for other in links[: max(0, i - 2)]]
    fine = np.linspace(0, few - 1, 400 * (few - 1) + 1)
    Q = np.column_stack([np.interp(fine, np.arange(few), column) for column in q.T])
    frames = joint_frames(robot, Q)
    least = np.inf
    for one in sweep(robot, gaps, q, [0.05] * len(gaps), 0.05):
        dense = one.gap.distances(frames, np.arange(len(Q)), 0.0)
        assert one.bound <= dense.min() + 1e-9
        least = min(least, float(dense.min()))
        if dense.min() < 0.05 - 1e-3:
            assert one.least <= 0.05  # found, though no sample need show it
    found = min(one.least for one in sweep(robot, gaps, q, [0.05] * len(gaps), 0.05))
    assert found <= least + ACCURACY
