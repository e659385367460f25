"""The same arm by several roads: xacro, Pinocchio, yourdfpy, roboticstoolbox and robot_descriptions against URDF."""

from __future__ import annotations

import io
import re
import sys
from dataclasses import fields, is_dataclass
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, sampled, urdf, urdf_files
from holokin.base.errors import ArgumentError, MissingExtraError, RobotFileError, UnknownNameError

TOLERANCE = 1e-12


def assert_same(one: hk.Robot, other: hk.Robot, *, limits: bool = True) -> None:
    assert one.joint_names == other.joint_names
    if limits:
        for what in ("lower", "upper", "max_velocity"):
            assert getattr(one, what) == pytest.approx(getattr(other, what), abs=1e-12), what
    for q in np.random.default_rng(11).uniform(-2, 2, (5, one.n)):
        for mine, yours in zip(one.tips, other.tips, strict=True):
            assert np.abs(one.pose(q, mine.name) - other.pose(q, yours.name)).max() < TOLERANCE
            assert np.abs(one.jacobian(q, mine.name) - other.jacobian(q, yours.name)).max() < TOLERANCE


# --- Pinocchio ---

CHAINS = [
    ("panda.urdf", ["panda_hand_tcp", "panda_rightfinger"], "panda_link0"),
    ("baxter.urdf", ["left_gripper", "r_gripper_r_finger"], "base"),
    ("tiago.urdf", ["arm_7_link"], "base_footprint"),
    ("xarm7.urdf", ["link_eef"], "world"),
    ("g1_29dof_rev_1_0.urdf", ["left_rubber_hand"], "torso_link"),
]


@pytest.mark.campaign
@sampled(2, ("file", "tips", "base"), CHAINS, ids=[c[0] for c in CHAINS])
def test_a_pinocchio_model_is_the_urdf_it_was_built_from(file: str, tips: list[str], base: str) -> None:
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(urdf(file)), mimic=True)
    one, other = hk.robot.from_pinocchio(model, tips, base=base), hk.from_urdf(urdf(file), tips, base=base)
    assert_same(one, other)
    q = np.full(one.n, 0.3)
    symbol, evaluated = hk.symbolic.symbol("q", one.n), []
    for robot in (one, other):
        M = hk.robot.mass_matrix_expression(robot, symbol)
        evaluated.append(hk.symbolic.Function("M", {"q": symbol}, {"M": M})(q))
    assert np.abs(evaluated[0] - evaluated[1]).max() < 1e-9


def test_a_pinocchio_model_made_by_hand_moves_as_pinocchio_says() -> None:
    pin = pytest.importorskip("pinocchio")
    model, parent = pin.Model(), 0
    rng = np.random.default_rng(5)
    kinds = [
        pin.JointModelRX(),
        pin.JointModelPZ(),
        pin.JointModelRUBY(),
        pin.JointModelRevoluteUnaligned(np.array([0.6, 0.0, 0.8])),
        pin.JointModelPrismaticUnaligned(np.array([0.0, 0.6, 0.8])),
    ]
    for i, kind in enumerate(kinds):
        parent = model.addJoint(parent, kind, pin.SE3.Random(), f"j{i}")
    model.addFrame(pin.Frame("tip", parent, 0, pin.SE3.Random(), pin.OP_FRAME))
    robot, data = hk.robot.from_pinocchio(model, tip="tip"), model.createData()
    assert (robot.hinges.tolist(), np.isinf(robot.max_velocity).all()) == ([True, False, True, True, False], True)
    for q in rng.uniform(-2, 2, (5, 5)):
        pin.framesForwardKinematics(model, data, np.array([q[0], q[1], np.cos(q[2]), np.sin(q[2]), q[3], q[4]]))
        assert np.abs(robot.pose(q) - data.oMf[model.getFrameId("tip")].homogeneous).max() < TOLERANCE


def test_floating_and_spherical_joints_of_pinocchio_are_refused() -> None:
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromUrdf(str(urdf("talos_left_arm.urdf")), pin.JointModelFreeFlyer())
    with pytest.raises(RobotFileError, match="'root_joint' is of type 'JointModelFreeFlyer'; choose base= below it"):
        hk.robot.from_pinocchio(model, tip="arm_left_7_link")
    assert hk.robot.from_pinocchio(model, tip="arm_left_7_link", base="arm_left_1_link").n == 6
    with pytest.raises(UnknownNameError, match="unknown frame"):
        hk.robot.from_pinocchio(model, tip="arm")
    with pytest.raises(ArgumentError, match=r"give a pinocchio\.Model"):
        hk.robot.from_pinocchio("panda.urdf")


# --- yourdfpy ---


def test_a_yourdfpy_model_is_the_urdf() -> None:
    import yourdfpy

    path = urdf("panda.urdf")
    model = yourdfpy.URDF.load(path, load_meshes=False, build_scene_graph=False)
    one, other = hk.robot.from_yourdfpy(model, tip="panda_hand_tcp"), hk.from_urdf(path, tip="panda_hand_tcp")
    assert_same(one, other)
    assert [body.mass for body in one.bodies] == [body.mass for body in other.bodies]
    with pytest.raises(ArgumentError, match=r"give a yourdfpy\.URDF"):
        hk.robot.from_yourdfpy(path)


def assert_read_alike(mine: Any, yours: Any, where: str) -> None:
    """Every value that holokin reads is the one that yourdfpy reads; yourdfpy's default of an axis is written out."""
    if is_dataclass(mine):
        for part in fields(mine):
            value = getattr(mine, part.name)
            if value is not None or getattr(yours, part.name, None) is not None:
                assert_read_alike(value, getattr(yours, part.name), f"{where} {part.name}")
    elif isinstance(mine, tuple):
        assert len(mine) == len(yours), where
        for k, (one, other) in enumerate(zip(mine, yours, strict=True)):
            assert_read_alike(one, other, f"{where} {k}")
    elif mine is None and where.endswith("axis"):
        assert yours.tolist() == [1, 0, 0], where
    else:
        assert np.array_equal(mine, np.broadcast_to(yours, np.shape(mine))), where  # to the last bit


def read_both(content: bytes, name: str) -> tuple[Any, Any]:
    """What holokin and yourdfpy read."""
    import yourdfpy

    from holokin.robot.formats.urdf import essentials, model_of

    theirs = yourdfpy.URDF.load(io.BytesIO(content), load_meshes=False, build_scene_graph=False)
    return model_of(essentials(content, name)), theirs.robot


def test_every_urdf_is_read_as_yourdfpy_reads_it() -> None:
    read = 0
    for path in urdf_files():
        if path.name != "ur3.urdf":  # whose robot has no name
            assert_read_alike(*read_both(path.read_bytes(), path.name), where=path.name)
            read += 1
    assert read > 60


@pytest.mark.parametrize("seed", range(10))
def test_a_random_urdf_is_read_as_yourdfpy_reads_it(seed: int) -> None:
    """Each attribute and each element that may be left out is there or not, at random."""
    rng = np.random.default_rng(seed)

    def numbers(count: int = 1) -> str:
        return " ".join(f"{value:.{rng.integers(1, 17)}g}" for value in rng.normal(0, 2, count))

    def maybe(text: str) -> str:
        return text if rng.random() < 0.6 else ""

    def element(tag: str, sizes: dict[str, int], inside: str = "") -> str:
        written = [maybe(f'{name}="{numbers(count)}"') for name, count in sizes.items()]
        return f"<{tag} {' '.join(written)} {inside}/>"

    def origin() -> str:
        return maybe(element("origin", {"xyz": 3, "rpy": 3}))

    def drawn(tag: str, inside: str = "") -> str:
        scale = rng.choice(["", 'scale="0.001"', 'scale="1 -1 2"', 'scale="1, 2, 3"'])
        solids = f'<mesh filename="a.stl" {scale}/>', f'<box size="{numbers(3)}"/>', f'<sphere radius="{numbers()}"/>'
        solid = rng.choice([*solids, f'<cylinder length="{numbers()}" radius="{numbers()}"/>'])
        return maybe(f"<{tag}>{origin()}<geometry>{solid}</geometry>{inside}</{tag}>")

    moments = dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1)
    material = f'<material name="m">{maybe(element("color", {"rgba": 4}))}</material>'
    text = f'<robot name="r">{material}'
    for k in range(4):
        inertial = maybe(element("mass", {"value": 1})) + maybe(element("inertia", moments)) + origin()
        looks = "".join(drawn("visual", maybe(material)) + drawn("collision") for _ in range(3))
        text += f'<link name="l{k}">{maybe(f"<inertial>{inertial}</inertial>")}{looks}</link>'
    for k in range(3):
        inside = maybe(element("axis", {"xyz": 3})) + origin()
        inside += maybe(element("limit", dict.fromkeys(("lower", "upper", "velocity", "effort"), 1)))
        inside += maybe(element("mimic", {"multiplier": 1, "offset": 1}, 'joint="j0"'))
        inside += maybe(element("safety_controller", {"soft_lower_limit": 1, "soft_upper_limit": 1}))
        ends, kind = f'<parent link="l{k}"/><child link="l{k + 1}"/>', maybe('type="revolute"')
        text += f'<joint name="j{k}" {kind}>{ends}{inside}</joint>'
    assert_read_alike(*read_both(f"{text}</robot>".encode(), "random"), where="random")


# --- xacro ---

XACRO = """<?xml version="1.0"?>
<robot name="bench" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="length" default="0.5"/>
  <xacro:arg name="wrist" default="false"/>
  <xacro:include filename="parts.xacro"/>
  <xacro:include filename="$(find bench_description)/urdf/wrist.xacro"/>
  <xacro:property name="L" value="$(arg length)"/>
  <link name="base"/>
  <xacro:arm name="j1" parent="base" child="upper" z="0.1"/>
  <xacro:arm name="j2" parent="upper" child="lower" z="${2 * L}"/>
  <xacro:if value="$(arg wrist)"><xacro:arm name="j3" parent="lower" child="${wrist_name}" z="0.2"/></xacro:if>
</robot>
"""
PARTS = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:macro name="arm" params="name parent child z">
    <link name="${child}"><visual><geometry><mesh filename="package://nowhere/${child}.stl"/></geometry></visual></link>
    <joint name="${name}" type="revolute"><parent link="${parent}"/><child link="${child}"/>
      <origin xyz="0 0 ${z}" rpy="${pi/2} 0 0"/><axis xyz="0 1 0"/>
      <limit lower="${-pi}" upper="${pi}" velocity="2" effort="1"/></joint>
  </xacro:macro>
</robot>
"""


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    """A xacro file in a ROS package, which includes one beside it and one by the package's name."""
    folder = tmp_path / "bench_description" / "urdf"
    folder.mkdir(parents=True)
    (folder.parent / "package.xml").write_text("<package><name>bench_description</name></package>")
    (folder / "parts.xacro").write_text(PARTS)
    wrist = '<xacro:property name="wrist_name" value="hand"/>'
    (folder / "wrist.xacro").write_text(f'<robot xmlns:xacro="http://www.ros.org/wiki/xacro">{wrist}</robot>')
    (folder / "bench.urdf.xacro").write_text(XACRO)
    return folder / "bench.urdf.xacro"


def test_a_xacro_file_is_expanded_with_its_arguments(bench: Path) -> None:
    pytest.importorskip("xacrodoc")
    short, long = hk.load(bench), hk.load(bench, args={"length": 0.75, "wrist": True})
    assert (short.joint_names, long.joint_names) == (("j1", "j2"), ("j1", "j2", "j3"))
    assert short.pose([0, 0])[:3, 3] == pytest.approx([0, -1.0, 0.1])
    assert hk.load(bench, tip="lower", args={"length": 0.75}).pose([0, 0])[:3, 3] == pytest.approx([0, -1.5, 0.1])
    assert long.tips[0].name == "hand"
    assert long.upper == pytest.approx([np.pi] * 3)
    assert hk.robot.model_tips(bench) == {"lower": ("j1", "j2")}


def test_a_xacro_file_with_a_fault_says_what_it_is(bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("xacrodoc")
    bench.write_text(XACRO.replace("2 * L", "2 * K"))
    with pytest.raises(RobotFileError, match=r"bench.urdf.xacro: cannot be expanded \(.*'K' is not defined") as caught:
        hk.load(bench)
    assert "\n" not in str(caught.value)
    bench.write_text(XACRO.replace("bench_description)", "elsewhere)"))
    with pytest.raises(RobotFileError, match="elsewhere"):
        hk.load(bench)
    with pytest.raises(ArgumentError, match="only xacro files take them"):
        hk.load(urdf("panda.urdf"), tip="panda_link7", args={"hand": True})
    monkeypatch.setitem(sys.modules, "xacrodoc", None)
    with pytest.raises(MissingExtraError, match=r"holokin\[xacro\]"):
        hk.load(bench)


# --- robot_descriptions ---


def test_a_name_of_robot_descriptions_is_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = pytest.importorskip("robot_descriptions")
    (tmp_path / "stool_description.py").write_text(f"URDF_PATH = {str(urdf('panda.urdf'))!r}\n")
    (tmp_path / "broken_description.py").write_text("raise OSError('no way to github.com')\n")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
    for name in ("stool", "stool_description"):
        robot = hk.load(f"robot_descriptions:{name}", tip="panda_hand_tcp")
        assert_same(robot, hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp"))
    with pytest.raises(UnknownNameError, match="unknown robot of robot_descriptions 'pandda'"):
        hk.load("robot_descriptions:pandda")
    with pytest.raises(RobotFileError, match=r"could not be fetched \(no way to github.com\); check the network"):
        hk.load("robot_descriptions:broken")


def test_without_network_robot_descriptions_fails_clearly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("robot_descriptions")
    for name, value in {
        "ROBOT_DESCRIPTIONS_CACHE": str(tmp_path), "https_proxy": "http://127.0.0.1:9",
        "http_proxy": "http://127.0.0.1:9", "GIT_TERMINAL_PROMPT": "0",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    with pytest.raises(RobotFileError, match=r"its files could not be fetched.*check the network"):
        hk.load("robot_descriptions:ur5e_mj")
    monkeypatch.setattr("holokin.robot.formats.loading.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"holokin\[descriptions\]"):
        hk.load("robot_descriptions:panda")


def test_a_name_of_example_robot_data_is_its_file(monkeypatch: pytest.MonkeyPatch) -> None:
    named = hk.load("example-robot-data:panda", tip="panda_hand_tcp")
    assert_same(named, hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp"))
    with pytest.raises(UnknownNameError, match="unknown robot of example-robot-data 'pandda'"):
        hk.load("example-robot-data:pandda")

    def absent(_name: str) -> None:
        raise PackageNotFoundError

    monkeypatch.setattr("holokin.robot.formats.loading.files", absent)
    with pytest.raises(MissingExtraError, match=r"holokin\[descriptions\]"):
        hk.load("example-robot-data:panda")


# --- roboticstoolbox ---


@pytest.mark.filterwarnings("ignore")
def test_robots_of_the_toolbox_are_at_its_own_poses() -> None:
    rtb = pytest.importorskip("roboticstoolbox")
    from roboticstoolbox import ET, DHRobot, Link, PrismaticDH, RevoluteDH, Robot
    from spatialmath import SE3

    scara = DHRobot(
        [
            RevoluteDH(d=0.3, a=0.2, offset=0.4, qlim=[-1, 1]),
            RevoluteDH(a=0.25, alpha=np.pi, flip=True),
            PrismaticDH(theta=0.1, qlim=[0, 0.2]),
        ],
        base=SE3(0.1, 0.2, 0.3) * SE3.Rx(0.4),
        tool=SE3(0, 0, 0.1) * SE3.Ry(0.2),
    )
    links = [
        Link(ET.tz(0.3) * ET.Rz(), name="a", qlim=[-2, 2]),
        Link(ET.tx(0.2) * ET.Ry(flip=True), name="b", parent="a"),
        Link(ET.Rx(0.3) * ET.tz(), name="c", parent="b", qlim=[-1, 3]),
    ]
    tree = Robot(links, base=SE3(1, 0, 0))
    for given in (rtb.models.DH.Panda(), rtb.models.DH.Puma560(), rtb.models.ETS.Panda(), scara, tree):
        robot = hk.robot.from_roboticstoolbox(given)
        for q in np.random.default_rng(2).uniform(-1, 1, (5, robot.n)):
            assert np.abs(robot.pose(q) - given.fkine(q).A).max() < TOLERANCE, given.name
    assert hk.robot.from_roboticstoolbox(scara).lower.tolist() == [-1, -np.inf, 0]
    assert (hk.robot.from_roboticstoolbox(tree).joint_names, hk.robot.from_roboticstoolbox(tree).upper[2]) == (
        ("a", "b", "c"),
        3,
    )
    with pytest.raises(ArgumentError, match="give a robot of roboticstoolbox"):
        hk.robot.from_roboticstoolbox(PANDA_START)


def test_a_panda_by_five_roads_is_one_robot() -> None:
    """The catalogue, its URDF, Pinocchio, yourdfpy and MuJoCo: pairwise to 1e-12 with names and limits."""
    pin, mujoco = pytest.importorskip("pinocchio"), pytest.importorskip("mujoco")
    import yourdfpy

    path, tip = urdf("panda.urdf"), "panda_hand_tcp"
    text = re.sub("<(visual|collision)>.*?</\\1>", "", path.read_text(), flags=re.DOTALL)
    compiler = '<mujoco><compiler fusestatic="false" boundmass="1e-3" boundinertia="1e-6"/></mujoco></robot>'
    roads = [
        hk.load("panda"),
        hk.from_urdf(path, tip),
        hk.robot.from_yourdfpy(yourdfpy.URDF.load(path, load_meshes=False, build_scene_graph=False), tip),
        hk.robot.from_pinocchio(pin.buildModelFromUrdf(str(path)), tip),
        hk.robot.from_mjcf(mujoco.MjModel.from_xml_string(text.replace("</robot>", compiler)), tip),
    ]
    for one in roads:
        for other in roads:
            assert_same(one, other, limits=np.isfinite([*one.max_velocity, *other.max_velocity]).all())


HEAD = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
LINKS = """<link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/><child link="b"/>
<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint>"""


@pytest.mark.parametrize(
    ("inside", "args", "error", "said"),
    [
        (f'<xacro:macro name="arm" params="p">{LINKS}</xacro:macro>', {}, RobotFileError, "only defines macros, arm; "),
        (LINKS, {"prefix": "l_"}, UnknownNameError, "argument of .*'prefix'; known: none"),
        (f'<xacro:arg name="prefix" default=""/>{LINKS}', {"prefx": "l_"}, UnknownNameError, "did you mean 'prefix'"),
        ('<xacro:include filename="$(find nib)/a.xacro"/>', {}, RobotFileError, "ROS package 'nib', which is not fo"),
    ],
)  # fmt: skip
def test_a_xacro_file_without_robot_argument_or_package_says_which(
    inside: str, args: dict[str, str], error: type[Exception], said: str, tmp_path: Path
) -> None:
    (tmp_path / "r.urdf.xacro").write_text(f"{HEAD}{inside}</robot>")
    with pytest.raises(error, match=said) as caught:
        hk.load(tmp_path / "r.urdf.xacro", args=args)
    assert "class" not in str(caught.value)


def test_an_argument_that_only_an_expression_asks_for_is_one(tmp_path: Path) -> None:
    for use in ("$(eval top > 1)", "${xacro.arg('top') > '1'}", "$(arg top)"):
        (tmp_path / "r.urdf.xacro").write_text(
            f'{HEAD}<xacro:property name="x" value="{use}"/><link name="l${{x}}"/>{LINKS}</robot>'
        )
        assert hk.load(tmp_path / "r.urdf.xacro", args={"top": 2}, base="a", tip="b").n == 1
    (tmp_path / "r.urdf.xacro").write_text(f"\n<?xml version='1.0'?>{HEAD}{LINKS}</robot>")
    with pytest.raises(RobotFileError, match="delete what stands before"):
        hk.load(tmp_path / "r.urdf.xacro")
