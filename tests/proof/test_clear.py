"""Shapes that are proven to keep apart: no posture on the leaf inside brings them nearer than is said.

Shapes that no proof can be about are refused; where a box is not proven, a posture shows it.
"""

from __future__ import annotations

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
from holokin.proof.kept_apart import kept_apart, too_near_along
from holokin.proof.proven_region import CAUSES, NEAR, region_of
from holokin.proof.recheck import recheck
from holokin.robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Mesh, with_capsules

coal, pin = pytest.importorskip("coal"), pytest.importorskip("pinocchio")
trimesh = pytest.importorskip("trimesh")

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

    def asked_for(clearance: float) -> hk.proof.Certificate:
        return hk.certify(strategy, space, Q0, scene=hk.Scene([POST], clearance=clearance, self_collision=False))

    found = asked_for(0.0)
    corners = np.array([np.ravel(c) for c in np.meshgrid(*[[-1.0, 1.0]] * 3)]).T
    T = np.tile(panda.pose(Q0), (8, 1, 1))
    T[:, :3, 3] += 0.01 * corners
    seen = coal_distances(panda, found.demands.clear.pairs, [POST], hk.ik(strategy, Q0).batch(T).q)
    nearest = float(seen.min())
    asked = asked_for(nearest + 0.001)
    assert not asked.whole and asked.extent is Extent.NEAR
    assert asked_for(nearest - 0.01).whole


def test_along_a_path_with_a_floor(panda: hk.Robot) -> None:
    T = panda.pose(Q0)
    circle = hk.circle(T[:3, 3], center=T[:3, 3] - [0.1, 0.0, 0.0])
    found = hk.certify(leaf(panda), circle, Q0, scene=hk.Scene(floor=-0.2))
    assert found.whole and "floor" in {name for pair in found.demands.clear.pairs for name in pair.names}
    with pytest.raises(ArgumentError, match=r"panda_joint\d and floor overlap by 0\.\d+ m, with the tool at \["):
        hk.certify(leaf(panda), circle, Q0, scene=hk.Scene(floor=float(T[2, 3]) - 0.2, clearance=0.0))


def test_the_checker_verifies_the_distances(panda: hk.Robot, tmp_path: Path) -> None:
    proof = hk.certify(leaf(panda), box(panda, 0.01), Q0, scene=hk.Scene(obstacles=[TABLE], clearance=0.05))
    rejected, text = recheck(proof.save(tmp_path / "clear.json"), robot=panda)
    assert proof.whole and not rejected and "m apart or more, 0.05 claimed" in text


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


# --- Shapes that no proof can be about: told at once, with what is the matter and what to do.


def asked(panda: hk.Robot, *things: LinkShape, **more: object) -> hk.proof.Certificate:
    return hk.certify(leaf(panda), box(panda, 0.004), Q0, scene=hk.Scene(things, **more))


def meshed(file: Path, mesh: trimesh.Trimesh) -> Mesh:
    mesh.export(file)
    return Mesh(file)


def corner_of(file: Path) -> Mesh:
    """Two plates that meet at a right angle, as one mesh."""
    plates = [trimesh.creation.box((0.3, 0.3, 0.02)), trimesh.creation.box((0.02, 0.3, 0.3))]
    plates[1].apply_translation((0.15, 0, 0.15))
    return meshed(file, trimesh.util.concatenate(plates))


def test_a_ball_that_the_arm_is_in_at_the_start_is_told_with_its_pair_and_depth(panda: hk.Robot) -> None:
    """The ball is about the tool, so that it is in the last link's capsule by its radius and that of the capsule."""
    tip = panda.pose(Q0)[:3, 3]
    with pytest.raises(
        ArgumentError, match=r"panda_joint7 and ball overlap by 0\.\d+ m, where 0.\d+ m is asked"
    ) as told:
        asked(panda, hk.obstacle("ball", Capsule(0.05), tuple(tip)))
    (capsule,) = [s for s in hk.robot.with_capsules(panda).shapes if s.joint == 6]
    depth = float(str(told.value).partition("overlap by ")[2].partition(" m")[0])
    assert depth == pytest.approx(0.05 + capsule.shape.radius, abs=2e-3)


def test_a_mesh_that_is_not_convex_is_refused_and_its_hull_and_its_parts_are_taken(
    panda: hk.Robot, tmp_path: Path
) -> None:
    mesh, at = corner_of(tmp_path / "corner.stl"), (0.9, 0.3, 0.3)
    assert not mesh.convex
    with pytest.raises(ArgumentError, match="convex parts"):
        asked(panda, hk.obstacle("corner", mesh, at))
    assert asked(panda, hk.obstacle("corner", mesh.hull, at)).whole
    block = meshed(tmp_path / "block.stl", trimesh.creation.box((0.1, 0.2, 0.3)))
    assert block.convex and asked(panda, hk.obstacle("block", block, at)).whole


@pytest.mark.parametrize(
    ("shape", "convex"),
    [
        (trimesh.creation.icosphere(subdivisions=3, radius=0.2), True),
        (trimesh.creation.cylinder(0.1, 0.4), True),
        (trimesh.creation.annulus(0.1, 0.2, 0.3), False),
        (
            trimesh.Trimesh(*(lambda b: (b.vertices, b.faces[2:]))(trimesh.creation.box((1, 1, 1))), process=False),
            False,
        ),
    ],
    ids=["ball", "cylinder", "pipe", "a box without its lid"],
)
def test_a_mesh_is_convex_as_its_volume_over_that_of_its_hull_says(
    tmp_path: Path, shape: trimesh.Trimesh, convex: bool
) -> None:
    mesh = meshed(tmp_path / "shape.stl", shape)
    assert mesh.convex is convex
    if shape.is_watertight:
        assert bool(shape.volume / shape.convex_hull.volume > 0.999) is convex


def _box(*sides: float) -> Box:
    return Box(np.array(sides))


@pytest.mark.parametrize(
    ("things", "more", "words"),
    [
        ([hk.obstacle("table", _box(1000, 1000, 50), (600, 0, -100))], {}, "give metres"),
        ([hk.obstacle("ball", Capsule(60.0), (0.3, 0, 0.4))], {}, "given in mm"),
        ([hk.obstacle("ball", Capsule(0.02), (0.6, 300, 0.5))], {}, "give metres"),
        ([], {"clearance": 20.0}, "give metres"),
        ([], {"floor": -200.0}, "metres"),
        ([], {"self_collision": False}, "obstacles"),
    ],
    ids=["table", "ball", "place", "clearance", "floor", "nothing"],
)
def test_lengths_in_millimetres_and_empty_scenes_are_told_as_such(
    panda: hk.Robot, things: list, more: dict, words: str
) -> None:
    with pytest.raises(ArgumentError, match=words):
        asked(panda, *things, **more)


def test_a_robot_whose_own_shape_is_in_millimetres_is_told(panda: hk.Robot) -> None:
    large = hk.robot.with_shape(panda, "gripper", _box(80, 80, 120))
    with pytest.raises(ArgumentError, match="its scale"):
        asked(large, hk.obstacle("post", Capsule(0.02, 1.0), (0.45, -0.25, 0.5)))


def test_shapes_without_points_or_sides_cannot_be_made(tmp_path: Path) -> None:
    for make in (
        lambda: Hull(np.zeros((0, 3))),
        lambda: _box(0, 1, 1),
        lambda: Capsule(0.0),
        lambda: _box(1, 1, np.nan),
    ):
        with pytest.raises(HolokinError):
            make()


def test_a_mesh_without_triangles_is_refused(panda: hk.Robot, tmp_path: Path) -> None:
    file = tmp_path / "empty.stl"
    file.write_text("solid none\nendsolid none\n")
    with pytest.raises(ArgumentError, match="no triangles"):
        asked(panda, hk.obstacle("nothing", Mesh(file), (0.9, 0.3, 0.3)))


def test_what_moves_is_refused(panda: hk.Robot) -> None:
    moving = LinkShape("cart", 2, np.eye(4), Capsule(0.1), obstacle=True)
    with pytest.raises(ArgumentError, match=r"stand still.*with_shape"):
        asked(panda, moving)


def test_an_unknown_link_is_refused(panda: hk.Robot) -> None:
    with pytest.raises(UnknownNameError):
        asked(panda, TABLE, allowed=[("elbow", "table")])


# --- Where a box is not proven: a part is refuted by a posture alone that touches.


RADIUS, WANTED, HALF = 0.02, 0.002, 0.02
ARM = hk.load("panda")
TOOL = ARM.pose(Q0)
CORNER = TOOL[:3, 3] + HALF
BALL = CORNER + [0.06, 0.06, 0.0]
NEAR_BALL = hk.Scene([hk.obstacle("ball", Capsule(RADIUS), tuple(BALL))], clearance=WANTED, self_collision=False)


@cache
def region() -> hk.proof.UniqueRegion:
    """A cube of 4 cm, of which one corner alone comes near a ball."""
    return hk.unique_region(leaf(ARM), Q0, box(ARM, HALF), scene=NEAR_BALL, budget=4000)


def to_ball(Q: np.ndarray) -> np.ndarray:
    """(k,) the distance of the arm from the ball, by coal."""
    pairs = region().certificate.demands.clear.pairs
    return coal_distances(ARM, pairs, list(NEAR_BALL.obstacles), np.atleast_2d(Q)).min(axis=1)


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
    assert "and ball overlap by" in str(parts.worst) and "is asked" in str(parts.worst)


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
    proof = hk.certify(region().strategy, region().workspace, Q0, scene=NEAR_BALL)
    worst = region_of(proof).parts.worst
    assert not proof.whole and to_ball(worst.q)[0] < WANTED


def test_along_a_path_the_posture_is_found_that_is_nearest() -> None:
    path, strategy = hk.polyline([TOOL[:3, 3], CORNER]), region().strategy
    proof = hk.certify(strategy, path, Q0, scene=NEAR_BALL)
    one = too_near_along(proof)
    walk = to_ball(hk.follow(strategy, path, Q0, samples=200).q)
    assert not proof.whole and one.distance == pytest.approx(walk.min(), abs=1e-6) and one.distance < 0
