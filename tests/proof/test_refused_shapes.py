"""Shapes that no proof can be about: told at once, with what is the matter and what to do."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from holokin.base.errors import ArgumentError, HolokinError
from holokin.robot import Box, Capsule, Hull, LinkShape, Mesh

pytest.importorskip("coal")
trimesh = pytest.importorskip("trimesh")

Q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])


@cache
def leaf(panda: hk.Robot) -> hk.HolonomicStrategy:
    return hk.holonomic(hk.pose(panda), hk.lock(2))


def asked(panda: hk.Robot, *things: LinkShape, **more: object) -> hk.proof.Certificate:
    T = panda.pose(Q0)
    space = hk.workspace(box=(T[:3, 3], [0.004] * 3), rotation=T[:3, :3])
    return hk.certify(leaf(panda), space, Q0, scene=hk.Scene(things, **more))


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
    with pytest.raises(ArgumentError, match=r"panda_joint7 and ball overlap by 0\.\d+ m there") as told:
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
    ],
    ids=["table", "ball", "place", "clearance", "floor"],
)
def test_lengths_in_millimetres_are_told_as_such(panda: hk.Robot, things: list, more: dict, words: str) -> None:
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
