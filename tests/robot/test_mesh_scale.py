"""Meshes that a model scales or mirrors: where they are, how far from others, and their outside outside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from holokin.robot import Capsule, Mesh, Shape

trimesh = pytest.importorskip("trimesh")

SIDES, CENTER = np.array([0.2, 0.4, 0.6]), np.array([0.5, 0.3, 0.4])
"""Of a box whose mesh is not about its origin, so that a mirrored one is elsewhere."""

POST = 0.1
"""Radius of a ball at the origin of the base."""

SCALES = [(-1, 1, 1), (1, -1, 1), (-1, -1, 1), (-1, -1, -1), (2, 2, 2), (-2, 1, 0.5), (1, 1, 1)]

ARM = """<robot name="arm"><link name="base"/><link name="a">
<collision><geometry>{0}</geometry></collision><visual><geometry>{0}</geometry></visual></link><link name="tip"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="j2" type="prismatic"><parent link="a"/><child link="tip"/><axis xyz="1 0 0"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""

MUJOCO = """<mujoco><compiler meshdir="{1}"/><asset><mesh name="m" file="box.stl" scale="{0}"/></asset><worldbody>
<body name="a"><joint name="j1" axis="0 0 1"/><geom type="mesh" mesh="m" mass="1"/>
<body name="b"><joint name="j2" type="slide" axis="1 0 0"/><geom type="sphere" size=".01" pos="9 0 0"/></body></body>
</worldbody></mujoco>"""


def model(kind: str, scale: tuple[float, ...], folder: Path, unit: float = 1.0) -> hk.Robot:
    """A robot whose first link is the box, from a mesh in a file with its own unit of length."""
    box = trimesh.creation.box(extents=SIDES / unit)
    box.apply_translation(CENTER / unit)
    box.export(folder / "box.stl")
    text = " ".join(str(unit * one) for one in scale)
    if kind == "urdf":
        file = folder / "arm.urdf"
        file.write_text(ARM.format(f'<mesh filename="box.stl" scale="{text}"/>'))
        return hk.load(file)
    file = folder / "arm.xml"
    file.write_text(MUJOCO.format(text, folder))
    return hk.load(file, tip="b")


def triangles(shape: Shape, placement: np.ndarray) -> np.ndarray:
    """Corners (f, 3, 3) of the triangles of what is drawn, in its link."""
    points, faces = shape.triangles if isinstance(shape, Mesh) else (shape.points, shape.triangles)  # type: ignore[attr-defined]
    return (points @ placement[:3, :3].T + placement[:3, 3])[faces]


def volume(corners: np.ndarray) -> float:
    """Of the inside, by the divergence theorem: negative where the triangles face inwards."""
    return float(np.einsum("ki,ki->k", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6)


@pytest.mark.parametrize("kind", ["urdf", "mjcf"])
@pytest.mark.parametrize("scale", SCALES, ids=str)
def test_a_scaled_or_mirrored_mesh_is_the_box_that_it_is(kind: str, scale: tuple[float, ...], tmp_path: Path) -> None:
    if kind == "mjcf":
        pytest.importorskip("mujoco")
    robot = model(kind, scale, tmp_path)
    sides, center = np.abs(scale) * SIDES, scale * CENTER
    (part,) = (one for one in robot.shapes if one.link == "a")
    for axis in np.eye(3):
        for sign in (1.0, -1.0):
            ahead = sign * axis @ part.placement[:3, :3]
            found = part.shape.support(ahead[None])[0] + sign * axis @ part.placement[:3, 3]
            assert found == pytest.approx(sign * axis @ center + axis @ sides / 2, abs=1e-6)
    (visual,) = (one for one in robot.visuals if one.link == "a")
    assert volume(triangles(visual.shape, visual.placement)) == pytest.approx(float(sides.prod()), rel=1e-5)


@pytest.mark.parametrize("kind", ["urdf", "mjcf"])
@pytest.mark.parametrize(("scale", "unit"), [((-1, 1, 1), 1.0), ((2, 2, 2), 1.0), ((1, -1, 1), 1e-3)], ids=str)
def test_a_check_finds_such_a_mesh_as_far_from_a_ball_as_its_box_is(
    kind: str, scale: tuple[float, ...], unit: float, tmp_path: Path
) -> None:
    """By the hull where it is far, by the triangles where it is near; the same as a box that is written as one."""
    pytest.importorskip("coal")
    if kind == "mjcf":
        pytest.importorskip("mujoco")
    robot = model(kind, scale, tmp_path, unit)
    half, center = np.abs(scale) * SIDES / 2, np.array(scale * CENTER)
    nearest = np.maximum(np.abs(center) - half, 0.0)
    for clearance in (0.0, 2.0):
        scene = hk.Scene([hk.obstacle("ball", Capsule(POST))], clearance=clearance)
        report = hk.check([[0.0, 0.0]], scene, robot=robot, limits=False)
        (pair,) = (one for one in report.pairs if set(one.pair) == {"a", "ball"})
        assert pair.least == pytest.approx(np.linalg.norm(nearest) - POST, abs=1e-5)


def test_a_scale_of_nothing_is_said_and_the_shape_is_not_looked_at(tmp_path: Path) -> None:
    for scale in ((0, 1, 1), (1, float("nan"), 1)):
        (part,) = model("urdf", scale, tmp_path).shapes
        assert part.shape.fault.startswith("the scale of the mesh 'box.stl' is [")


def test_what_the_studio_draws_of_a_mirrored_mesh_faces_outwards(tmp_path: Path) -> None:
    pytest.importorskip("viser")
    from holokin.app.studio.page_scene import looks_of

    look = next(look for look in looks_of(model("urdf", (-1, 1, 1), tmp_path))[0] if look.joint == 0)
    assert volume(look.points[look.triangles]) == pytest.approx(float(SIDES.prod()), rel=1e-5)
