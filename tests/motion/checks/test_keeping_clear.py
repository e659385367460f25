"""How far apart shapes are at single postures, and how that changes: MuJoCo's distances, Pinocchio's frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import holokin as hk
from holokin.motion.checks import Clearances
from holokin.robot import Box, Capsule, Cylinder, Ellipsoid, Hull, LinkShape, Shape, with_capsules

mujoco, pin = pytest.importorskip("mujoco"), pytest.importorskip("pinocchio")
pytest.importorskip("coal")

TABLE = hk.obstacle("table", Box(np.array([1.0, 1.0, 0.05])), (0.6, 0.0, -0.1))
POST = hk.obstacle("post", Capsule(0.02, 1.0), (0.45, -0.25, 0.5))
CORNERS = [
    [0.09, 0.02, -0.03], [-0.06, 0.05, 0.02], [0.01, -0.08, 0.04], [-0.03, -0.04, -0.07], [0.04, 0.06, 0.08],
    [-0.07, 0.0, 0.05],
]  # fmt: skip
WEDGE = hk.obstacle("wedge", Hull(np.array(CORNERS)), (0.2, -0.6, 0.5))
DRUM = hk.obstacle("drum", Cylinder(0.1, 0.3), (-0.3, 0.5, 0.6), (0.3, 0.2, 0.1))
EGG = hk.obstacle("egg", Ellipsoid(np.array([0.05, 0.08, 0.12])), (0.6, -0.5, 0.6))
FLOOR = -0.3


def geom(shape: Shape) -> tuple[str, str]:
    """(attributes of its geom, of its asset)."""
    kinds = {
        Box: lambda s: ("box", s.sides / 2), Capsule: lambda s: ("capsule", [s.radius, s.length / 2]),
        Cylinder: lambda s: ("cylinder", [s.radius, s.length / 2]), Ellipsoid: lambda s: ("ellipsoid", s.radii),
    }  # fmt: skip
    if isinstance(shape, Hull):
        return 'type="mesh" mesh="hull"', " ".join(map(str, shape.corners.ravel()))
    if isinstance(shape, Capsule) and not shape.length:
        return f'type="sphere" size="{shape.radius}"', ""
    kind, sizes = kinds[type(shape)](shape)
    return f'type="{kind}" size="{" ".join(map(str, sizes))}"', ""


class Referee:
    """Distances of link shapes in MuJoCo, each on a body of its own, which is put where Pinocchio says."""

    def __init__(self, robot: hk.Robot, things: Sequence[LinkShape]) -> None:
        ground = hk.obstacle("floor", Box(np.array([20.0, 20.0, 2.0])), (0.0, 0.0, FLOOR - 1.0))
        self.robot, self.shapes = robot, [*robot.shapes, *things, ground]
        texts = [geom(one.shape) for one in self.shapes]
        bodies = "".join(f'<body mocap="true"><geom {text}/></body>' for text, _ in texts)
        assets = "".join(f'<mesh name="hull" vertex="{corners}"/>' for _, corners in texts if corners)
        text = f"<mujoco><asset>{assets}</asset><worldbody>{bodies}</worldbody></mujoco>"
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        self.arm = pin.buildModelFromXML(hk.robot.to_urdf(robot))
        self.frames = self.arm.createData()

    def __call__(self, names: Sequence[tuple[str, str]], q: np.ndarray) -> np.ndarray:
        """(P,) of pairs of links at a posture."""
        pin.forwardKinematics(self.arm, self.frames, q)
        for i, s in enumerate(self.shapes):
            M = pin.SE3(s.placement)
            if s.joint >= 0:
                M = self.frames.oMi[self.arm.getJointId(self.robot.joints[s.joint].name)] * M
            self.data.mocap_pos[i] = M.translation
            mujoco.mju_mat2Quat(self.data.mocap_quat[i], M.rotation.ravel())
        mujoco.mj_kinematics(self.model, self.data)
        links = [one.link for one in self.shapes]
        sides = [[links.index(name) for name in pair] for pair in names]
        return np.array([mujoco.mj_geomDistance(self.model, self.data, a, b, 5.0, None) for a, b in sides])


def made(robot: hk.Robot, things: Sequence[LinkShape]) -> Clearances:
    return Clearances.of(robot, hk.Scene(things, FLOOR, 0.02))


@pytest.mark.parametrize(
    ("things", "exact"), [([TABLE, POST, WEDGE], 1e-3), ([DRUM, EGG], 5e-3)], ids=["flat", "round"]
)
def test_distances_and_their_slopes_are_those_of_mujoco(panda: hk.Robot, things: list[LinkShape], exact: float) -> None:
    """Central differences of MuJoCo's distances by each joint: no code of ours, but the pairs."""
    robot, near, h = with_capsules(panda), 0.4, 1e-3
    clearances, referee = made(robot, things), Referee(robot, things)
    Q = np.random.default_rng(1).uniform(robot.lower, robot.upper, (8, 7))
    found, slopes = clearances.slopes(Q, near)
    compared = 0
    for k, q in enumerate(Q):
        seen = referee(clearances.names, q)
        apart = np.abs(seen - near) > 1e-3
        assert ((found[k] < near) == (seen < near))[apart].all()
        which = np.isfinite(found[k]) & (seen > 0.01)
        assert found[k, which] == pytest.approx(seen[which], abs=1e-5)
        steps = h * np.eye(7)
        wanted = [(referee(clearances.names, q + s) - referee(clearances.names, q - s)) / (2 * h) for s in steps]
        assert np.abs(slopes[k] - np.transpose(wanted))[which].max() < exact
        assert not slopes[k, ~np.isfinite(found[k])].any()
        compared += int(which.sum())
    assert compared > 40


def test_of_shapes_that_overlap_the_slope_says_how_they_come_apart() -> None:
    """Two balls on a slider and a hinge, one deep in the other; in closed form."""
    rows = [{"joint": "slide", "kind": "prismatic"}, {"joint": "turn", "a": 1.0}]
    robot = hk.robot.with_shape(hk.from_dh(rows), "ball", Capsule(0.2))
    ball = hk.obstacle("other", Capsule(0.2), (1.0, 0.3, 0.5))
    clearances = Clearances.of(robot, hk.Scene([ball], clearance=0.0, self_collision=False))
    q = np.array([[0.4, 0.2]])
    step = np.array([np.cos(0.2), np.sin(0.2), 0.4]) - [1.0, 0.3, 0.5]
    size = float(np.linalg.norm(step))
    found, slopes = clearances.slopes(q, 1.0)
    assert found[0, -1] == pytest.approx(size - 0.4) and size < 0.4
    turned = step @ np.array([-np.sin(0.2), np.cos(0.2), 0.0]) / size
    assert slopes[0, -1] == pytest.approx([step[2] / size, turned])


def test_a_pair_that_is_always_near_counts_only_where_it_touches(panda: hk.Robot) -> None:
    robot = with_capsules(panda)
    clearances = Clearances.of(robot, hk.Scene(clearance=3.0))
    assert not clearances.limits.any(), "nothing of a Panda is three metres apart"
    Q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (50, 7))
    distances, least = clearances.distances(Q), clearances.least(Q)
    touching = (distances < 0).any(axis=1)
    assert touching.any() and not touching.all()
    assert np.isinf(least[~touching]).all() and least[touching] == pytest.approx(distances[touching].min(axis=1))
    assert not clearances.free.names
    assert clearances.clear(Q).tolist() == (~touching).tolist()
