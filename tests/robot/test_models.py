"""The same arm by several roads: xacro, Pinocchio, yourdfpy, roboticstoolbox and robot_descriptions against URDF."""

from __future__ import annotations

import io
import os
import re
import struct
import sys
import time
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, Command, campaign, sampled, urdf, urdf_files
from holokin.base.errors import ArgumentError, MissingExtraError, RobotFileError, UnknownNameError
from holokin.robot import reach
from holokin.robot.formats.mjcf import sizes_of
from holokin.robot.formats.urdf import Part, essentials, model_of
from referees import PUBLISHED, Referee, referees

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


READ = (
    "name links joints materials inertial collisions visuals origin mass inertia geometry box cylinder sphere "
    "mesh size radius length filename scale material color rgba type parent child axis limit safety_controller "
    "mimic lower upper velocity effort soft_lower_limit soft_upper_limit joint multiplier offset"
)
"""What holokin reads of a URDF."""


def assert_read_alike(mine: Any, yours: Any, where: str) -> None:
    """Every value that holokin reads is the one that yourdfpy reads; yourdfpy's default of an axis is written out."""
    if isinstance(mine, Part):
        for name in READ.split():
            value = getattr(mine, name)
            unnamed = name == "name" and value is None  # of shapes, which nobody asks for
            if not unnamed and (value is not None or getattr(yours, name, None) is not None):
                assert_read_alike(value, getattr(yours, name), f"{where} {name}")
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

    theirs = yourdfpy.URDF.load(io.BytesIO(content), load_meshes=False, build_scene_graph=False)
    return model_of(essentials(content, name)), theirs.robot


@pytest.mark.parametrize(("every", "least"), [(5, 12), campaign(("every", "least"), (1, 61))])
def test_every_urdf_is_read_as_yourdfpy_reads_it(every: int, least: int) -> None:
    read = 0
    for path in urdf_files()[::every]:
        if path.name != "ur3.urdf":  # whose robot has no name
            assert_read_alike(*read_both(path.read_bytes(), path.name), where=path.name)
            read += 1
    assert read >= least


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
    with pytest.raises(RobotFileError, match="'K' is not defined") as caught:
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
    with pytest.raises(RobotFileError, match=r"could not be fetched \(no way to github.com\)"):
        hk.load("robot_descriptions:broken")


def test_without_network_robot_descriptions_fails_clearly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("robot_descriptions")
    for name, value in {
        "ROBOT_DESCRIPTIONS_CACHE": str(tmp_path), "https_proxy": "http://127.0.0.1:9",
        "http_proxy": "http://127.0.0.1:9", "GIT_TERMINAL_PROMPT": "0",
    }.items():  # fmt: skip
        monkeypatch.setenv(name, value)
    with pytest.raises(RobotFileError, match="its files could not be fetched"):
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

    monkeypatch.setattr("holokin.robot.formats.loading.package_files", absent)
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


# --- The catalogue against others' numbers: every robot's poses, its limits, and the table of docs/robots.md.


PAGE = Path(__file__).parents[2] / "docs" / "robots.md"


@pytest.mark.parametrize("referee", referees(), ids=lambda r: f"{r.robot}-{r.tip}")
def test_the_pose_is_the_referees(referee: Referee) -> None:
    """To 1e-12, or to the rounding of the source where that is coarser."""
    position, rotation = referee.differences()
    assert position < referee.within
    assert rotation < referee.turned


def test_every_robot_of_the_catalogue_has_a_referee() -> None:
    assert {r.robot for r in referees()} == set(hk.robot.catalogue())


@pytest.mark.campaign
def test_the_page_says_joints_and_reach_of_every_robot_and_whose_poses_differ() -> None:
    """Rewritten on request only: HOLOKIN_GOLDEN=write pytest tests/robot/test_models.py"""
    arms: dict[int, list[str]] = {}
    apart = {}
    for name in hk.robot.catalogue():
        robot = hk.load(name)
        arms.setdefault(robot.n, []).append(f"`{name}` {reach(robot):.3f}")
        apart[name] = max(r.differences()[0] for r in referees() if r.robot == name)
    head = "| Joints | Robots, with their reach [m] |\n|---|---|\n"
    table = head + "\n".join(f"| {n} | {', '.join(arms[n])} |" for n in sorted(arms))
    text = PAGE.read_text("utf-8")
    begin = text.index(head)
    end = text.index("\n\n", begin)
    if os.environ.get("HOLOKIN_GOLDEN") == "write":
        text = text[:begin] + table + text[end:]
        PAGE.write_text(text, "utf-8")
    assert table in text
    exceptions = re.findall(r"`([\w-]+)` (\S+) m\b", text.split("They agree to 1e-10 m, except ")[1].split("\n")[0])
    assert dict(exceptions) == {name: f"{far:.0e}" for name, far in apart.items() if far > 1e-10}


@pytest.mark.parametrize("entry", PUBLISHED["limits"], ids=lambda e: e["robot"])
def test_the_ranges_and_speeds_are_the_published_ones(entry: dict) -> None:
    robot, unit = hk.load(entry["robot"]), np.pi / 180 if entry.get("degrees") else 1
    for mine, key in ((robot.lower, "lower"), (robot.upper, "upper"), (robot.max_velocity, "max_velocity")):
        published = unit * np.array(entry[key])
        assert mine == pytest.approx(published, abs=entry.get("within", 1e-9), rel=0), (key, entry["source"])


def test_every_arm_that_a_maker_sells_has_published_limits() -> None:
    elsewhere = {"panda", "irb140"}  # tests/robot/test_robot.py
    made_of = {
        "rail-ur10e",
        "mobile-ur5e",
        "yumi-arm",
        "openarm-left",
        "openarm-right",
        "rail",
        "planar-base",
        "ppr",
        "planar-3r",
    }  # parts; chosen
    assert {e["robot"] for e in PUBLISHED["limits"]} | elsewhere | made_of == set(hk.robot.catalogue())


def test_the_xarm7_is_the_urdf_of_example_robot_data() -> None:
    ours, theirs = hk.load("xarm7"), hk.from_urdf(urdf("xarm7.urdf"))
    assert ours.joint_names == theirs.joint_names
    for q in np.random.default_rng(0).uniform(-2, 2, (10, 7)):
        assert np.abs(ours.pose(q) - theirs.pose(q)).max() < 2e-5  # the URDF's right angles are 1.5708
    assert ours.lower == pytest.approx(theirs.lower, abs=1e-5)  # the URDF rounds them to five digits
    assert ours.upper == pytest.approx(theirs.upper, abs=1e-5)
    assert ours.max_velocity == pytest.approx(theirs.max_velocity, abs=1e-12)


@pytest.mark.parametrize("name", ["ur5e", "ur10e"])
def test_the_ur_arms_are_those_of_their_analytic_kinematics(name: str) -> None:
    arm = getattr(pytest.importorskip("ur_analytic_ik"), name)
    robot = hk.load(name)
    for q in np.random.default_rng(1).uniform(-3, 3, (20, 6)):
        assert np.abs(robot.pose(q) - arm.forward_kinematics(*q)).max() < 1e-12


def test_the_rizon4_has_the_jacobian_that_its_maker_computed_in_matlab() -> None:
    """flexiv_rdk dca9a15, test/test_dynamics_engine.cpp: the flange at "PLAN-Home", with another wrist.

    It has joint 7 elsewhere, 3 mm and 40 mm away, as src/holokin/robot/data/rizon4.toml says, and with it the flange.
    """
    published = [
        [0.110000000000000, 0.078420538028673, 0.034471999940354, -0.368152340866938, -0.064278760968654, 0.136],
        [0.687004857483100, 0.0, 0.576684003660457, 0.0, 0.033475407198662, 0.0],
        [0.0, 0.687004857483100, -0.028925442435894, -0.417782862794537, -0.076604444311898, 0.11],
        [0.0, 0.0, 0.642787609686539, 0.0, 0.766044443118978, 0.0],
        [0.0, -1.0, 0.0, 1.0, 0.0, -1.0],
        [1.0, 0.0, 0.766044443118978, 0.0, -0.642787609686539, 0.0],
    ]
    robot = hk.load("rizon4")
    home = np.deg2rad([0, -40, 0, 90, 0, 40, 0])
    earlier = hk.with_tool(robot, [0, 0.003, 0.040])  # in the flange's own frame, at q7 = 0
    assert np.abs(earlier.jacobian(home)[:, :6] - published).max() < 1e-12
    assert np.abs(robot.jacobian(home)[3:, 6] - [0, 0, -1]).max() < 1e-12


def test_the_reach_is_never_exceeded_and_is_the_known_one_of_straight_arms() -> None:
    assert reach(hk.load("planar-3r")) == pytest.approx(3.0, abs=1e-9)
    assert reach(hk.load("iiwa7")) == pytest.approx(0.34 + 0.4 + 0.4 + 0.126, abs=1e-9)  # upright and straight
    assert reach(hk.load("rail")) == 3.0
    assert reach(hk.from_dh([{"a": 1.0}, {"kind": "prismatic"}])) == np.inf
    ur5e = hk.load("ur5e")
    far = reach(ur5e)
    points = ur5e.pose_batch(np.random.default_rng(5).uniform(ur5e.lower, ur5e.upper, (20_000, 6)))[0]
    assert far - 0.05 < np.linalg.norm(points, axis=1).max() <= far
    yumi = hk.load("yumi")
    assert reach(yumi, "left_flange") == pytest.approx(reach(yumi, "right_flange"), abs=1e-4)


@pytest.mark.campaign
def test_the_list_of_robots_has_joints_reach_and_source(holokin: Command) -> None:
    lines = holokin("robots").out.splitlines()
    assert [line.split()[0] for line in lines] == list(hk.robot.catalogue())
    (ur5e,) = [line for line in lines if line.startswith("ur5e")]
    assert ur5e.split()[1:6] == ["6", "joints", "reach", "1.130", "m"]
    assert "Universal Robots" in ur5e


# --- Models made to fill time or memory are refused by counts, before anything is built; MuJoCo confirms the counts.


mujoco = pytest.importorskip("mujoco")

ARM = '<body name="arm"><joint/><geom size=".1"/></body>'


def model(inside: str = "", before: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{ARM}{inside}</worldbody></mujoco>"


BOMBS = {
    "replicas": (model(f'<replicate count="3000000">{ARM}</replicate>'), r"e\+06 bodies"),
    "nested replicas": (
        model('<replicate count="200"><replicate count="200"><replicate count="200"><geom size=".1"/></replicate>'
              "</replicate></replicate>"), r"e\+06 elements"),
    "a flexible body": (model('<flexcomp name="f" type="grid" count="400 400 400" spacing="1 1 1"/>'), r"e\+07 bodies"),
    "flexible bodies of ten": (model('<replicate count="100"><flexcomp name="f" type="grid"/></replicate>'), "bodies"),
    "keyframes": (model(before='<size nkey="1000000000"/>'), "<size nkey="),
    "user data": (model(before='<size nuser_body="1000000000"/>'), "<size nuser_body="),
    "a texture": (model(before='<asset><texture name="t" type="cube" builtin="flat" width="20000" height="20000"/>'
                        "</asset>"), "pixels"),
    "a field": (model(before='<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset>'), "cells"),
    "a mesh": (
        model(before='<asset><mesh name="m" builtin="supersphere" params="20000 1 1"/></asset>'), "<mesh params="),
    "in a comment that is none": (
        model(f'<site name="<!--"/><replicate count="3000000">{ARM}</replicate><site name="-->"/>'),
        "bodies|is not XML"),
    "in another encoding": (
        '<?xml version="1.0" encoding="cp037"?>' + model(f'<replicate count="3000000">{ARM}</replicate>'), "bodies"),
}  # fmt: skip


@pytest.mark.parametrize("name", BOMBS)
def test_a_short_text_that_makes_a_giant_is_refused_at_once(name: str, tmp_path: Path) -> None:
    text, words = BOMBS[name]
    (tmp_path / "giant.xml").write_text(text)
    begun = time.process_time()
    with pytest.raises(RobotFileError, match=words):
        hk.load(tmp_path / "giant.xml", tip="arm")
    with pytest.raises(RobotFileError, match=words):
        hk.robot.from_mjcf(text[text.index("<mujoco") :], tip="arm")
    assert time.process_time() - begun < 2  # what is refused by hand takes minutes


def test_giants_of_several_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(model(f"{ARM.replace('arm', 'a')}" * 40).replace('name="a"', ""))
    for one, other in ("ba", "cb"):
        names = [f'<model name="{other}" file="{other}.xml"/>', f'<attach model="{other}" body="arm" prefix="']
        text = model("".join(f'{names[1]}{one}{i}"/>' for i in range(40)), f"<asset>{names[0]}</asset>")
        (tmp_path / f"{one}.xml").write_text(text)
    with pytest.raises(RobotFileError, match="bodies"):
        hk.load(tmp_path / "c.xml", tip="arm")
    declared = "<mujoco><asset><model name='b' file='b.xml'/></asset></mujoco>"
    (tmp_path / "assets.xml").write_text(declared)
    attached = "".join(f'<attach model="b" body="arm" prefix="{i}"/>' for i in range(60))
    (tmp_path / "d.xml").write_text(model(attached, '<include file="assets.xml"/>'))
    with pytest.raises(RobotFileError, match="bodies"):
        hk.load(tmp_path / "d.xml", tip="arm")
    itself = '<asset><model name="e" file="e.xml"/></asset>'
    (tmp_path / "e.xml").write_text(model('<attach model="e" body="arm" prefix="x"/>' * 3, itself))
    with pytest.raises(RobotFileError, match=r"attaches e\.xml to itself"):
        hk.load(tmp_path / "e.xml", tip="arm")
    (tmp_path / "f.xml").write_text(f'<mujoco><worldbody>{ARM}</worldbody><include file="f.xml"/></mujoco>')
    with pytest.raises(RobotFileError):
        hk.load(tmp_path / "f.xml", tip="arm")


def test_a_picture_of_few_bytes_and_many_pixels_is_refused(tmp_path: Path) -> None:
    head = b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 60_000, 60_000)
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / "t.png").write_bytes(head + bytes(100))
    text = '<compiler texturedir="pictures"/><asset><texture name="t" type="2d" file="t.png"/></asset>'
    (tmp_path / "arm.xml").write_text(model(before=text))
    with pytest.raises(RobotFileError, match=r"3.6e\+09 pixels"):
        hk.load(tmp_path / "arm.xml", tip="arm")


@pytest.mark.parametrize("seed", range(8))
def test_the_counts_are_those_of_mujoco(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)

    def grown(depth: int) -> str:
        parts = [f'<body pos="0 0 {rng.random():.2f}"><geom size=".1"/>{grown(depth - 1) if depth else ""}</body>']
        if depth and rng.random() < 0.7:
            parts.append(f'<replicate count="{rng.integers(1, 6)}">{grown(depth - 1)}</replicate>')
        if rng.random() < 0.3:
            parts.append("<!-- -- a comment -- with hyphens -->")
        return "".join(parts)

    (tmp_path / "part.xml").write_text(f"<mujoco><worldbody><body name='p'>{grown(2)}</body></worldbody></mujoco>")
    attached = "".join(f"<attach model='part' body='p' prefix='{i}'/>" for i in range(rng.integers(1, 4)))
    asset = "<asset><model name='part' file='part.xml'/></asset>"
    (tmp_path / "whole.xml").write_text(f"<mujoco>{asset}<worldbody>{grown(3)}{attached}</worldbody></mujoco>")
    made = mujoco.MjSpec.from_file(str(tmp_path / "whole.xml")).compile()
    counted = sizes_of((tmp_path / "whole.xml").read_bytes(), "whole.xml", tmp_path)
    assert counted.bodies == made.nbody - 1  # but for the world
    count = " ".join(map(str, rng.integers(2, 5, 3)))
    grid = f'type="grid" count="{count}" spacing="1 1 1" dim="3" radius=".01"'
    flexible = model(f'<flexcomp name="f" {grid}><pin id="0"/></flexcomp>')
    assert sizes_of(flexible.encode(), "", tmp_path).bodies >= mujoco.MjModel.from_xml_string(flexible).nbody - 1


def test_a_urdf_of_entities_or_of_a_million_links_is_refused(tmp_path: Path) -> None:
    entities = "".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(12))
    laughs = f'<!DOCTYPE r [<!ENTITY a "ha">{entities}]><robot name="r">&m;</robot>'
    many = f'<robot name="r">{"".join(f"""<link name="l{i}"/>""" for i in range(100_000))}</robot>'
    begun = time.process_time()
    for text, words in ((laughs, "amplification"), (many, "more than 20,000 links")):
        (tmp_path / "giant.urdf").write_text(text)
        with pytest.raises(RobotFileError, match=words):
            hk.load(tmp_path / "giant.urdf")
    assert time.process_time() - begun < 2
