"""Whoever says that two bodies are too near names them, their distance, the posture and where the tool is: all true.

The referee has its own frames, by Pinocchio, and its own distances: of balls from boxes, balls and planes in closed
form, from meshes by trimesh.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import sampled
from holokin.base.errors import ArgumentError
from holokin.motion.checks import Clearances, PairDistance
from holokin.proof import Extent
from holokin.robot import Box, Capsule, Mesh

pin, trimesh = pytest.importorskip("pinocchio"), pytest.importorskip("trimesh")

KINDS = ("box", "ball", "mesh", "ring", "floor", "links", "padding")
WANTED, ROOM = 0.02, 0.004
"""What is asked of the bodies, and what they have more at the start [m]."""


class Arm:
    """A random arm of four hinges that bears a ball at the middle of each of its links, and at its tool."""

    def __init__(self, seed: int, folder: Path) -> None:
        rng = np.random.default_rng(seed)
        self.radii, self.q0 = rng.uniform(0.03, 0.06, 4), rng.uniform(0.3, 0.9, 4) * [1, 1, 1, -1]
        self.middles = [(0.0, 0.0, float(z)) for z in rng.uniform(0.12, 0.2, 4)]
        joints, links = "", "<link name='base'/>"
        for k, axis in enumerate(("0 0 1", "0 1 0", "0 1 0", "1 0 0")):
            ball = f"<origin xyz='{' '.join(map(str, self.middles[k]))}'/><geometry><sphere radius='{self.radii[k]}'/>"
            links += f"<link name='link{k}'><collision>{ball}</geometry></collision></link>"
            joints += (
                f"<joint name='j{k}' type='revolute'><parent link='{f'link{k - 1}' if k else 'base'}'/>"
                f"<child link='link{k}'/><origin xyz='0 0 {0.35 if k else 0.1}'/><axis xyz='{axis}'/>"
                "<limit lower='-2.5' upper='2.5' velocity='2' effort='9'/></joint>"
            )
        tool = "<link name='tool'/><joint name='t' type='fixed'><parent link='link3'/><child link='tool'/>"
        text = f"<robot name='arm'>{links}{joints}{tool}<origin xyz='0.1 0.05 0.3'/></joint></robot>"
        (folder / "arm.urdf").write_text(text)
        self.robot = hk.load(folder / "arm.urdf", tip="tool")
        self.model = pin.buildModelFromXML(text)
        self.data = self.model.createData()

    def frame(self, name: str, q: np.ndarray) -> np.ndarray:
        pin.framesForwardKinematics(self.model, self.data, np.asarray(q))
        return self.data.oMf[self.model.getFrameId(name)].homogeneous

    def ball(self, name: str, q: np.ndarray) -> tuple[np.ndarray, float]:
        k = int(name[-1])
        return (self.frame(name, q) @ [*self.middles[k], 1.0])[:3], float(self.radii[k])

    def distance(self, names: tuple[str, str], q: np.ndarray, scene: hk.Scene) -> float:
        """Of two bodies at a posture, the first a ball."""
        center, radius = self.ball(names[0], q)
        if names[1] == "floor":
            return float(center[2] - radius - scene.floor)
        if names[1].startswith("link"):
            other, size = self.ball(names[1], q)
            return float(np.linalg.norm(center - other) - radius - size)
        (thing,) = [shape for shape in scene.obstacles if shape.link == names[1]]
        at = thing.placement[:3, :3].T @ (center - thing.placement[:3, 3])
        if isinstance(thing.shape, Box):
            out = np.abs(at) - thing.shape.sides / 2
            return float(np.linalg.norm(np.maximum(out, 0)) + min(out.max(), 0.0) - radius)
        if isinstance(thing.shape, Capsule):
            return float(np.linalg.norm(at) - thing.shape.radius - radius)
        own = trimesh.load(thing.shape.file)
        away = [-float(trimesh.proximity.signed_distance(one, [at])[0]) for one in (own, own.convex_hull)]
        limit = scene.asked(*names)
        return away[1] - radius if away[1] - radius >= limit else max(away[0] - radius, 0.0)

    def referee(self, pair: PairDistance, scene: hk.Scene) -> None:
        names = pair.names if pair.names[0].startswith("link") else pair.names[::-1]
        assert pair.distance == pytest.approx(self.distance(names, pair.q, scene), abs=2e-6), pair
        assert np.abs(pair.pose - self.frame("tool", pair.q)).max() < 1e-9
        assert pair.wanted == pytest.approx(scene.asked(*pair.names))
        bodies = r"(\w+) and (\w+) (?:are (\S+) m apart|overlap by (\S+) m|touch)"
        place = r"with the tool at \[(.*)\] m"
        one, other, *sizes, place = re.fullmatch(f"{bodies}(?:, where .*)?, {place}", str(pair)).groups()
        assert (one, other) == pair.names and (sizes[0] is not None) == (pair.distance > 0)
        assert float(next(filter(None, sizes), 0.0)) == pytest.approx(abs(pair.distance), rel=0.011)  # rounded down
        assert np.allclose([float(x) for x in place.split(",")], pair.pose[:3, 3], atol=1e-4)


def scene_of(arm: Arm, kind: str, folder: Path) -> hk.Scene:
    """A scene in which, at the start, one pair has `ROOM` more than is asked of it; in a ring it has less."""
    q, padding = arm.q0, {"link3": 0.03} if kind == "padding" else {}
    wanted = WANTED + sum(padding.values())
    if kind == "floor":
        low = min(arm.ball(f"link{k}", q)[0][2] - arm.radii[k] for k in range(1, 4))
        return hk.Scene(floor=low - WANTED - ROOM, clearance=WANTED, self_collision=False, allowed=[("link0", "floor")])
    if kind == "links":
        far = min(arm.distance((f"link{a}", f"link{b}"), q, hk.Scene()) for a, b in ((2, 0), (3, 0), (3, 1)))
        return hk.Scene(clearance=far - ROOM)
    # A body beside the ball of the last link, on the side of the tool.
    (center, radius), tool = arm.ball("link3", q), arm.frame("tool", q)[:3, 3]
    away, size = (tool - center) / np.linalg.norm(tool - center), 0.05
    place = center + (radius + size + wanted + ROOM) * away
    turn = Rotation.align_vectors([away], [[1.0, 0.0, 0.0]])[0]
    if kind == "box":
        thing = hk.obstacle("thing", Box((2 * size, 4 * size, 4 * size)), place, turn.as_euler("xyz"))
    elif kind in ("mesh", "ring"):
        solid = trimesh.creation.icosphere(1, size)
        if kind == "ring":
            solid, place = trimesh.creation.annulus(radius + WANTED / 2, radius + 0.05, 0.02, sections=64), center
        solid.export(folder / "thing.stl")
        thing = hk.obstacle("thing", Mesh(folder / "thing.stl"), place, turn.as_euler("xyz"))
    else:
        thing = hk.obstacle("thing", Capsule(size), place)
    if kind == "padding":  # of another body, not padded, that is nearer, and has more room
        (at, near), aside = arm.ball("link2", q), np.cross(away, [0.0, 0.0, 1.0])
        other = hk.obstacle(
            "other", Capsule(0.02), at + (near + 0.02 + WANTED + 3 * ROOM) * aside / np.linalg.norm(aside)
        )
        return hk.Scene([thing, other], clearance=WANTED, padding=padding, self_collision=False)
    return hk.Scene([thing], clearance=WANTED, padding=padding, self_collision=False)


@pytest.mark.parametrize("kind", KINDS)
@sampled(1, "seed", range(20))
def test_the_closest_pair_of_random_postures_is_as_far_apart_as_is_said(kind: str, seed: int, tmp_path: Path) -> None:
    arm = Arm(seed, tmp_path)
    scene = scene_of(arm, kind, tmp_path)
    task, apart = hk.position(arm.robot), Clearances.of(arm.robot, scene)
    Q = arm.q0 + np.random.default_rng(seed).uniform(-0.05, 0.05, (30, 4))
    closest, roomiest = apart.closest(task, Q), apart.roomiest(task, Q)
    rooms = apart.distances(Q, apart.limits) - apart.limits
    for pair, room in ((closest, rooms.min()), (roomiest, rooms.min(axis=1).max())):
        arm.referee(pair, scene)
        assert pair.distance - pair.wanted == pytest.approx(room, abs=1e-9)
    assert closest.too_near == (not apart.clear(Q).all()) and roomiest.too_near == (not apart.clear(Q).any())


@sampled(2, "of", [(kind, seed) for kind in KINDS if kind != "ring" for seed in range(8)])  # no proof of a ring
def test_a_proof_that_shapes_end_and_a_region_name_a_pair_that_is_there(of: tuple[str, int], tmp_path: Path) -> None:
    kind, seed = of
    arm = Arm(seed, tmp_path)
    scene = scene_of(arm, kind, tmp_path)
    G, T = hk.holonomic(hk.position(arm.robot), hk.lock("j3")), arm.robot.pose(arm.q0)
    box = hk.workspace(box=(T[:3, 3], [0.02] * 3), rotation=T[:3, :3])
    corners = T[:3, 3] + 0.02 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    ways = hk.polyline([T[:3, 3], *corners])
    for proof in (hk.certify(G, box, arm.q0, scene=scene, budget=4000), hk.certify(G, ways, arm.q0, scene=scene)):
        assert proof.extent is Extent.NEAR and proof.near is not None and str(proof.near) in str(proof)
        arm.referee(proof.near, scene)
        assert proof.near.q[3] == pytest.approx(arm.q0[3], abs=1e-9) and proof.near.distance < proof.near.wanted + 2e-3
    region = hk.unique_region(G, arm.q0, box, scene=scene, budget=500)
    arm.referee(region.nearest, scene)
    assert f"the least room: {region.nearest}" in str(region) and region.nearest.too_near
    if len(region.certificate):
        names, bound = region.certificate.nearest_pair
        assert scene.asked(*names) <= bound and " and ".join(names) in str(region)


def test_a_start_at_which_bodies_are_too_near_is_refused_with_pair_distance_and_place(tmp_path: Path) -> None:
    arm = Arm(3, tmp_path)
    scene = scene_of(arm, "ball", tmp_path)
    q, G = arm.q0 + [0.1, 0.1, 0.1, 0.0], hk.holonomic(hk.position(arm.robot), hk.lock("j3"))
    pair = Clearances.of(arm.robot, scene).closest(G.task, q[None])
    arm.referee(pair, scene)
    tool = arm.robot.pose(q)[:3, 3]
    for ask in (
        lambda: hk.certify(G, hk.line(tool, tool + 0.01), q, scene=scene),
        lambda: hk.advise(G.task, q0=q, scene=scene),
    ):
        with pytest.raises(ArgumentError, match="q0 is") as told:
            ask()
        assert str(pair) in str(told.value)
