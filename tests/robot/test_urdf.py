"""URDF files: tips, bases, locked and mimic joints, and what malformed files get."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import holokin as hk
from conftest import PANDA_START, Command, assert_refused, sampled, urdf, write_job
from holokin.app import studio
from holokin.base.errors import ArgumentError, ExportError, HolokinError, RobotFileError, ShapeError, UnknownNameError
from holokin.robot import LinkShape, servo, weighed
from holokin.robot.links import between, drawn_links, merged, solid


def test_a_robot_may_have_several_tips() -> None:
    path = urdf("panda.urdf")
    both = hk.from_urdf(path, tip=["panda_leftfinger", "panda_rightfinger"])
    assert both.n == 8  # the right finger mimics the left
    q = np.concatenate([PANDA_START, np.full(both.n - 7, 0.01)])
    for tip in ("panda_leftfinger", "panda_rightfinger"):
        alone = hk.from_urdf(path, tip=tip)
        index = [both.joint_names.index(name) for name in alone.joint_names]
        assert both.pose(q, tip) == pytest.approx(alone.pose(q[index]), abs=1e-15)
        J = np.zeros((6, both.n))
        J[:, index] = alone.jacobian(q[index])
        assert both.jacobian(q, tip) == pytest.approx(J, abs=1e-15)
    assert hk.position(both, tip="panda_rightfinger")(q) == pytest.approx(both.pose(q, "panda_rightfinger")[:3, 3])
    assert len(both.skeleton(q)) == 2


def test_a_locked_joint_is_a_fixed_posture() -> None:
    path = urdf("panda.urdf")
    free = hk.from_urdf(path, tip="panda_hand_tcp")
    held = hk.from_urdf(path, tip="panda_hand_tcp", locked={"panda_joint3": 0.2, "panda_finger_joint1": 0.01})
    assert held.n == 6
    keep = [0, 1, 3, 4, 5, 6]
    assert held.pose(PANDA_START[keep]) == pytest.approx(free.pose(PANDA_START), abs=1e-14)
    assert held.jacobian(PANDA_START[keep]) == pytest.approx(free.jacobian(PANDA_START)[:, keep], abs=1e-14)


def test_a_base_inside_the_tree_is_where_poses_count_from() -> None:
    path = urdf("panda.urdf")
    whole, part = hk.from_urdf(path, tip="panda_link7"), hk.from_urdf(path, tip="panda_link7", base="panda_link3")
    stem = hk.from_urdf(path, tip="panda_link3")
    assert whole.pose(PANDA_START) == pytest.approx(stem.pose(PANDA_START[:3]) @ part.pose(PANDA_START[3:]), abs=1e-14)


def write(folder: Path, joints: str, links: str = "abcd") -> Path:
    file = folder / "robot.urdf"
    body = "".join(f'<link name="{name}"/>' for name in links)
    file.write_text(f'<robot name="tiny">{body}{joints}</robot>')
    return file


def joint(name: str, kind: str, parent: str, child: str, inside: str = "") -> str:
    limit = '<limit lower="-1" upper="2" velocity="3" effort="1"/>' if kind in ("revolute", "prismatic") else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 0 2"/>{limit}{inside}</joint>'
    )


def test_mimic_prismatic_continuous_and_limits(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        joint("slide", "prismatic", "a", "b")
        + joint("turn", "continuous", "b", "c")
        + joint("follow", "revolute", "c", "d", '<mimic joint="turn" multiplier="-2" offset="0.5"/>'),
    )
    robot = hk.from_urdf(file)
    assert robot.joint_names == ("slide", "turn")
    assert (robot.lower.tolist(), robot.upper.tolist()) == ([-1.0, -0.75], [2.0, 0.75])  # -1 <= 0.5 - 2 turn <= 2
    assert robot.max_velocity.tolist() == [3.0, 1.5]
    T = robot.pose([0.25, 0.3])
    assert T[:3, 3] == pytest.approx([0, 0, 3.25])
    assert np.arctan2(T[1, 0], T[0, 0]) == pytest.approx(0.3 - 2 * 0.3 + 0.5)
    assert robot.jacobian([0.25, 0.3])[5] == pytest.approx([0.0, -1.0])


def test_a_mimic_whose_master_is_elsewhere_brings_the_master_along(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        joint("master", "revolute", "a", "b")
        + joint("other", "revolute", "a", "c", '<mimic joint="master" multiplier="3"/>')
        + joint("last", "revolute", "c", "d"),
    )
    robot = hk.from_urdf(file, tip="d")
    assert robot.joint_names == ("master", "last")
    T = robot.pose([0.1, 0.2])
    assert np.arctan2(T[1, 0], T[0, 0]) == pytest.approx(0.5)
    held = hk.from_urdf(file, tip="d", locked={"master": 0.1})
    assert held.pose([0.2]) == pytest.approx(T)


def test_every_locked_posture_of_a_chain_is_the_free_chains(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        joint("slide", "prismatic", "a", "b")
        + joint("turn", "continuous", "b", "c")
        + joint("follow", "revolute", "c", "d", '<mimic joint="turn" multiplier="-2" offset="0.5"/>'),
    )
    free = hk.from_urdf(file)
    slid, turned = hk.from_urdf(file, locked={"slide": 0.7}), hk.from_urdf(file, locked={"turn": -0.4})
    assert (slid.joint_names, turned.joint_names) == (("turn",), ("slide",))
    assert slid.pose([0.3]) == pytest.approx(free.pose([0.7, 0.3]), abs=1e-15)
    assert turned.pose([0.3]) == pytest.approx(free.pose([0.3, -0.4]), abs=1e-15)
    assert slid.jacobian([0.3]) == pytest.approx(free.jacobian([0.7, 0.3])[:, 1:], abs=1e-15)
    assert turned.jacobian([0.3])[:, 0].tolist() == [0, 0, 1, 0, 0, 0]
    loosed = hk.from_urdf(file, locked={"follow": 0.2})  # a held mimic follows no more
    assert loosed.jacobian([0.7, 0.3])[5].tolist() == [0, 1]
    assert np.arctan2(*loosed.pose([0.7, 0.3])[1::-1, 0]) == pytest.approx(0.5)
    with pytest.raises(ArgumentError, match="moving joints"):
        hk.from_urdf(file, locked={"slide": 0, "turn": 0})


def test_a_joint_without_limit_or_axis_is_unlimited_and_about_x(tmp_path: Path) -> None:
    bare = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint>'
    robot = hk.from_urdf(write(tmp_path, bare, "ab"))
    assert (robot.lower[0], robot.upper[0], robot.max_velocity[0]) == (-np.inf, np.inf, np.inf)
    assert robot.jacobian([0.4])[:, 0].tolist() == [0, 0, 0, 1, 0, 0]


def test_a_branching_tree_without_tip_is_refused_with_its_tips() -> None:
    with pytest.raises(RobotFileError, match="branches into 3 tips") as caught:
        hk.from_urdf(urdf("panda.urdf"))
    tips = hk.robot.model_tips(urdf("panda.urdf"))
    assert set(tips) == {"panda_leftfinger", "panda_rightfinger", "panda_hand_tcp"}
    assert all(tip in str(caught.value) for tip in (*tips, "tip=", "panda.urdf"))


X = joint("x", "revolute", "a", "b")
Y = joint("y", "revolute", "b", "c")


@pytest.mark.parametrize(
    ("joints", "links", "said"),
    [
        (X + joint("y", "revolute", "a", "c"), "abc", "give tip=, one or more of b, c"),
        (joint("x", "floating", "a", "b"), "ab", "joint 'x' is of type 'floating'"),
        (joint("x", "planar", "a", "b"), "ab", "joint 'x' is of type 'planar'"),
        (joint("x", "hinge", "a", "b"), "ab", "joint 'x' is of type 'hinge'"),
        (joint("x", "Revolute", "a", "b"), "ab", "joint 'x' is of type 'Revolute'; write 'revolute'"),
        (joint("x", " FIXED", "a", "b"), "ab", "joint 'x' is of type ' FIXED'; write 'fixed'"),
        (X.replace('xyz="0 0 1"', 'xyz="0 0 0.3 1"'), "ab", "<origin xyz='0 0 0.3 1'>, 4 numbers where 3 must stand"),
        (X.replace('rpy="0 0 0"', 'rpy="${pi/2} 0 0"'), "ab", "an expression of xacro; .* a name that ends in .xacro"),
        (X.replace('xyz="0 0 1"', 'xyz="0 0 0,3"'), "ab", "with a comma; write a decimal point"),
        (X.replace('lower="-1"', 'lower=""'), "ab", "joint 'x' has <limit lower=''>, without a number"),
        (X.replace('rpy="0 0 0"', 'rpy="90 0 0"'), "ab", "rpy of joint 'x' .* looks like degrees"),
        (X.replace(' type="revolute"', ""), "ab", "joint 'x' is of type None"),
        (X.replace("0 0 2", "0 0 0"), "ab", "joint 'x' has axis"),
        (X.replace("0 0 2", "nan 0 1"), "ab", "joint 'x' has axis"),
        (X.replace("0 0 2", "0 1"), "ab", "joint 'x' has <axis xyz='0 1'>, 2 numbers where 3 must stand"),
        (X.replace('xyz="0 0 1"', 'xyz="0 nan 1"'), "ab", "joint 'x' has an origin that is not finite"),
        (X.replace('xyz="0 0 1"', 'xyz="0 one 1"'), "ab", "joint 'x' has <origin xyz='0 one 1'>, which are no numbers"),
        (X.replace('lower="-1"', 'lower="nan"'), "ab", r"range of joint 'x' is \(nan, 2.0\)"),
        (X.replace('lower="-1"', 'lower="3"'), "ab", r"range of joint 'x' is \(3.0, 2.0\)"),
        (X.replace('velocity="3"', 'velocity="-3"'), "ab", "speed limit of joint 'x'"),
        (X.replace("<parent", "<parents"), "ab", "joint .x. lacks its <parent>"),
        (joint("x", "revolute", "a", "b", '<mimic joint="x"/>'), "ab", "mimics 'x', which leads back"),
        (joint("x", "revolute", "a", "b", '<mimic joint="no"/>'), "ab", "mimics 'no', which the file does not have"),
        (joint("x", "revolute", "a", "b", '<mimic joint="y"/>') + Y.replace("revolute", "fixed"), "abc", "'fixed'"),
        (X + joint("y", "revolute", "b", "c", '<mimic joint="x" multiplier="nan"/>'), "abc", "multiplier nan"),
        (X + joint("y", "revolute", "b", "c", '<mimic joint="x"/>') + X, "abc", "two joints named 'x'"),
        (X + Y + joint("z", "revolute", "a", "c"), "abc", "link 'c' hangs on two joints"),
        (X + joint("y", "revolute", "b", "a"), "ab", "loop"),
        (X + Y, "abcc", "two links named 'c'"),
        (X + Y, "ab", "joint 'y' joins link 'c', which is not there"),
        (X, "abc", "2 roots: a, c"),
        ("", "a", "no joints"),
    ],
)
def test_a_file_that_cannot_be_used_says_why(tmp_path: Path, joints: str, links: str, said: str) -> None:
    file = write(tmp_path, joints, links)
    with pytest.raises(RobotFileError, match=said) as caught:
        hk.from_urdf(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is not XML"),
        (b"not xml <", "is not XML"),
        (b"\x00\x01\xff", "is not XML"),
        (b"<robot name='r'><link name='a'>", "is not XML"),
        (b"<html></html>", "root is <html>"),
        (b"<robot></robot>", "lacks its 'name'"),
        (b"<robot name='r'><link/></robot>", "lacks its 'name'"),
        (
            b"<robot name='r'><xacro:include filename='x'/></robot>",
            "a xacro file is expanded when its name ends in .xacro",
        ),
    ],
)
def test_what_is_not_a_urdf_is_named(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], content: bytes, said: str
) -> None:
    file = tmp_path / "wrong.urdf"
    file.write_bytes(content)
    for read in (hk.from_urdf, hk.load, hk.robot.model_tips):
        with pytest.raises(RobotFileError, match=said) as caught:
            read(file)
        assert str(caught.value).startswith(f"{file}: ")
    assert capfd.readouterr() == ("", "")  # the reader below does not talk over it
    for missing in (tmp_path / "missing.urdf", tmp_path):
        with pytest.raises(RobotFileError, match="no such file"):
            hk.from_urdf(missing, tip="x")


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9, 0.999])
def test_half_a_file_is_not_half_an_arm(tmp_path: Path, share: float) -> None:
    text = urdf("panda.urdf").read_text()
    (tmp_path / "half.urdf").write_text(text[: int(share * len(text.rstrip()))])
    with pytest.raises(RobotFileError, match=r"half\.urdf: is not XML"):
        hk.from_urdf(tmp_path / "half.urdf", tip="panda_link2")


def test_an_undeclared_prefix_such_as_gazebos_does_no_harm(tmp_path: Path) -> None:
    file = write(tmp_path, X + "<sensor:camera/>", "ab")
    assert hk.from_urdf(file).n == 1


def test_unknown_links_and_joints_are_named_with_what_there_is() -> None:
    path = urdf("panda.urdf")
    for arguments in (
        {"tip": "panda_hand_tpc"},
        {"tip": "panda_link7", "base": "x"},
        {"tip": "panda_link7", "locked": {"x": 0}},
        {"tip": ["panda_link7", "y"]},
    ):
        with pytest.raises(UnknownNameError, match="known:"):
            hk.from_urdf(path, **arguments)
    with pytest.raises(UnknownNameError, match="did you mean 'panda_hand_tcp'"):
        hk.from_urdf(path, tip="panda_hand_tpc")
    with pytest.raises(ArgumentError, match="panda_joint3"):
        hk.from_urdf(path, tip="panda_link7", locked={"panda_joint3": np.nan})
    with pytest.raises(UnknownNameError):
        hk.from_urdf(path, tip="panda_link7").pose(np.zeros(7), "elsewhere")
    with pytest.raises(UnknownNameError, match="unknown link"):
        hk.robot.model_tips(path, base="x")


@pytest.mark.parametrize(
    "before", ["\n", " \n\t", "\ufeff", "\n\ufeff", "\ufeff\n", "<!-- of\nNib -->\n", "<!-- a --> <!-- <b> -->", ""]
)
def test_blank_lines_and_comments_before_the_declaration_do_no_harm_and_lines_keep_their_numbers(
    before: str, tmp_path: Path
) -> None:
    file = write(tmp_path, X, "ab")
    text = '<?xml version="1.0" encoding="utf-8"?>\n' + file.read_text()
    file.write_text(before + text, "utf-8")
    assert hk.load(file).joint_names == ("x",)
    broken = (before + text).replace("<parent", "</parent", 1)
    file.write_text(broken, "utf-8")
    line = broken[: broken.index("</parent")].count("\n") + 1
    with pytest.raises(RobotFileError, match=f"line {line}, .*correct the line"):
        hk.load(file)
    file.write_text(f"Nib\n{before}{text}", "utf-8")
    with pytest.raises(RobotFileError, match=r"is not XML.*Nib"):
        hk.load(file)


def test_a_declaration_in_a_comment_is_none(tmp_path: Path) -> None:
    file = write(tmp_path, X, "ab")
    file.write_text("<!-- <?xml ?> -->" + file.read_text())
    assert hk.load(file).n == 1


ELEMENTS = {
    "origin": {"xyz": 3, "rpy": 3}, "axis": {"xyz": 3}, "limit": {"lower": 1, "upper": 1, "velocity": 1, "effort": 1},
    "mimic": {"multiplier": 1, "offset": 1}, "safety_controller": {"soft_lower_limit": 1, "soft_upper_limit": 1},
}  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_of_numbers_in_a_file_that_are_too_many_too_few_or_none_joint_and_element_are_named(
    seed: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    tag = str(rng.choice(list(ELEMENTS)))
    name = str(rng.choice(list(ELEMENTS[tag])))
    right = [f"{v:.3g}" for v in rng.uniform(0.1, 0.9, ELEMENTS[tag][name])]
    spoilt = [*right, "0.5"], right[:-1], [*right[:-1], "0,5"], [*right[:-1], "${2*pi}"], [*right[:-1], "x"]
    other = '<limit lower="-1" upper="1" velocity="1" effort="1"/>' if tag == "safety_controller" else ""
    for words, fine in ((right, True), *((words, False) for words in spoilt)):
        element = f'{other}<{tag} {name}="{" ".join(words)}"' + (' joint="a"/>' if tag == "mimic" else "/>")
        file = write(tmp_path, joint_with("a") + joint_with("b", "b", "c", element), "abc")
        if fine:
            assert "b" in hk.robot.model_links(file)
        else:
            with pytest.raises(RobotFileError, match=rf"joint 'b' has <{tag} {name}=.*; (write|expand)"):
                hk.load(file)


def joint_with(name: str, parent: str = "a", child: str = "b", inside: str = "") -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="revolute">{ends}{inside}</joint>'


def test_a_shape_with_too_many_numbers_is_not_read_and_hinders_no_arm(tmp_path: Path) -> None:
    shape = '<collision><origin xyz="0 0 0.3 1"/><geometry><sphere radius="0.1"/></geometry></collision>'
    file = write(tmp_path, X, "ab")
    file.write_text(file.read_text().replace('<link name="b"/>', f'<link name="b">{shape}</link>'))
    (found,) = hk.load(file).shapes
    assert isinstance(found.shape, hk.robot.Unread)


# --- Robots written as URDF and MJCF: the same robot again, to us, to Pinocchio and to MuJoCo.


mujoco = pytest.importorskip("mujoco")


def same_masses(one: hk.Robot, other: hk.Robot) -> None:
    """Each joint carries the same mass with the same inertia; links without mass may have gained a millionth gram."""
    wanted, found = (
        {r.joints[k].name if k >= 0 else "": body for k, body in merged(r.bodies).items()} for r in (one, other)
    )
    assert set(wanted) <= set(found)
    for joint, body in found.items():
        if joint not in wanted:
            assert body.mass < 1e-8
            continue
        assert body.mass == pytest.approx(wanted[joint].mass, rel=1e-12)
        assert np.abs(body.center - wanted[joint].center).max() < 1e-12
        assert np.abs(body.inertia - wanted[joint].inertia).max() < 1e-12 * np.abs(body.inertia).max()


def again(robot: hk.Robot, form: str, folder: Path) -> hk.Robot:
    """The robot, written and read."""
    tips = [tip.name for tip in robot.tips]
    if form == "mjcf":
        return hk.robot.from_mjcf(hk.robot.to_mjcf(robot), tip=tips)
    (folder / "robot.urdf").write_text(hk.robot.to_urdf(robot))
    return hk.from_urdf(folder / "robot.urdf", tip=tips)


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
@sampled(4, "name", hk.robot.catalogue())
def test_a_robot_of_the_catalogue_is_itself_after_it_was_written(name: str, form: str, tmp_path: Path) -> None:
    robot = hk.load(name)
    back = again(robot, form, tmp_path)
    order = [back.joint_names.index(joint) for joint in robot.joint_names]
    q = np.random.default_rng(1).uniform(-1, 1, robot.n)
    theirs = np.empty(robot.n)
    theirs[order] = q
    for tip in robot.tips:
        assert np.abs(back.pose(theirs, tip.name) - robot.pose(q, tip.name)).max() < 1e-12
        assert np.abs(back.jacobian(theirs, tip.name)[:, order] - robot.jacobian(q, tip.name)).max() < 1e-12
    assert np.array_equal(back.lower[order], robot.lower)  # no limit stays none
    assert np.array_equal(back.upper[order], robot.upper)
    if form == "urdf":
        assert np.array_equal(back.max_velocity[order], robot.max_velocity)
    same_masses(weighed(robot), back)


ARMS = [
    ("panda.urdf", ["panda_leftfinger", "panda_rightfinger"]),  # of which one follows the other
    ("tiago.urdf", ["arm_7_link"]),  # with its head and fingers, and rotations a hair from pitch = 90 degrees
]


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
@pytest.mark.parametrize(("file", "tips"), ARMS)
def test_masses_and_followers_survive(file: str, tips: list[str], form: str, tmp_path: Path) -> None:
    robot = hk.from_urdf(urdf(file), tip=tips)
    back = again(robot, form, tmp_path)
    assert back.joint_names == robot.joint_names
    rng = np.random.default_rng(2)
    for q in rng.uniform(-1, 1, (3, robot.n)):
        for tip in tips:
            assert np.abs(back.pose(q, tip) - robot.pose(q, tip)).max() < 1e-12
            assert np.abs(back.jacobian(q, tip) - robot.jacobian(q, tip)).max() < 1e-12
    same_masses(robot, back)


def test_pinocchio_and_mujoco_find_the_source_s_mass_matrix_and_gravity_torque(tmp_path: Path) -> None:
    source = pin.buildModelFromUrdf(str(urdf("panda.urdf")))
    fingers = [i for i, name in enumerate(source.names) if "finger" in name]
    source = pin.buildReducedModel(source, fingers, pin.neutral(source))
    robot = hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp")
    written = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot))
    data, extra = mujoco.MjData(model), written.createData()
    for q in (PANDA_START, np.zeros(7), -PANDA_START):
        M, g = pin.crba(source, source.createData(), q), pin.computeGeneralizedGravity(source, source.createData(), q)
        M = np.triu(M) + np.triu(M, 1).T
        N, h = (pin.crba(written, extra, q), pin.computeGeneralizedGravity(written, extra, q))
        assert np.abs(np.triu(N) - np.triu(M)).max() < 1e-12
        assert np.abs(h - g).max() < 1e-11
        data.qpos[:], data.qvel[:] = q, 0
        mujoco.mj_forward(model, data)
        columns = np.zeros((7, 7))
        for i in range(7):
            mujoco.mj_mulM(model, data, columns[i], np.eye(7)[i])
        assert np.abs(columns - M).max() < 1e-12
        assert np.abs(data.qfrc_bias - g).max() < 1e-11


def test_mujoco_takes_a_mass_at_a_point(tmp_path: Path) -> None:
    """As the wrist of an iCub has it: 0.1 kg without any moment of inertia."""
    mujoco = pytest.importorskip("mujoco")
    iner = '<inertial><mass value="0.1"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>'
    (tmp_path / "r.urdf").write_text(f'<robot name="r"><link name="a"/><link name="b">{iner}</link>{joint}</robot>')
    robot = hk.load(tmp_path / "r.urdf")
    model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot))
    assert model.body_mass[-1] == 0.1 and 0 < model.body_inertia[-1].max() < 1e-9


def test_a_follower_follows_in_mujoco() -> None:
    robot = hk.from_urdf(urdf("panda.urdf"), tip=["panda_leftfinger", "panda_rightfinger"])
    model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot))
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0
    data.joint("panda_finger_joint1").qpos[0] = 0.03  # the other one is at 0
    mujoco.mj_step(model, data, 500)
    first, second = (float(data.joint(f"panda_finger_joint{k}").qpos[0]) for k in (1, 2))
    assert abs(first - second) < 1e-4 < 0.01 < first


def test_placeholders_are_said_and_weigh_what_their_density_says(panda: hk.Robot) -> None:
    for write in (hk.robot.to_urdf, hk.robot.to_mjcf):
        assert "Placeholders: this robot's description has no masses" in write(panda)
        assert "1000 kg/m^3" in write(panda)
        assert "500 kg/m^3" in write(panda, density=500.0)
    whole, half = (sum(b.mass for b in weighed(panda, density).bodies) for density in (1000.0, 500.0))
    assert whole == pytest.approx(2 * half)
    arm = hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp")
    assert "Placeholders" not in hk.robot.to_urdf(arm)
    assert weighed(arm) is arm


@pytest.mark.parametrize(("start", "end"), [([0, 0, 0], [0.3, 0.1, -0.2]), ([0, 0, 0.1], [0, 0, 0.5])])
def test_a_capsule_weighs_what_mujoco_says(start: list[float], end: list[float]) -> None:
    capsule = LinkShape("link", 0, *between(np.array(start), np.array(end), 0.07))
    ends = " ".join(map(str, start + end))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><freejoint/><geom type="capsule" fromto="{ends}" '
        'size="0.07" density="850"/></body></worldbody></mujoco>'
    )
    body = solid(capsule, 850.0)
    assert body.mass == pytest.approx(model.body_mass[1], rel=1e-12)
    assert np.abs(np.linalg.eigvalsh(body.inertia) - np.sort(model.body_inertia[1])).max() < 1e-12
    assert np.abs(body.center - model.body_ipos[1]).max() < 1e-12
    axis = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
    assert axis @ body.inertia @ axis == pytest.approx(np.linalg.eigvalsh(body.inertia)[0])


def test_the_arm_is_drawn_from_joint_to_joint(panda: hk.Robot) -> None:
    drawn = [link.shape for link in drawn_links(panda) if link.shape.length]
    line = panda.skeleton(PANDA_START)[0]
    assert sum(shape.length for shape in drawn) == pytest.approx(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    assert hk.robot.to_mjcf(panda).count('type="capsule"') == len(drawn) == hk.robot.to_urdf(panda).count("<cylinder")


def test_a_servo_alone_settles_as_a_critically_damped_oscillator() -> None:
    """x(t) = x0 (1 + w t) exp(-w t) of one joint with its weight compensated, w = 2 pi f."""
    upright = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    robot = hk.from_dh([{"a": 0.6, "joint": "q"}], base=upright)
    drive = servo(robot, "position", [0.0], frequency=2.0, compensated=True)
    model = mujoco.MjModel.from_xml_string(hk.robot.to_mjcf(robot, servo=drive))
    model.opt.timestep, data = 1e-4, mujoco.MjData(model)
    data.qpos[0], w = 0.4, 2 * np.pi * 2.0
    for t in np.arange(1, 5001) * 1e-4:
        mujoco.mj_step(model, data)
        assert abs(data.qpos[0] - 0.4 * (1 + w * t) * np.exp(-w * t)) < 2e-3
    loose = mujoco.MjModel.from_xml_string(
        hk.robot.to_mjcf(robot, servo=servo(robot, "position", [0.0], frequency=2.0))
    )
    data = mujoco.MjData(loose)
    mujoco.mj_step(loose, data, 3000)
    body = weighed(robot).bodies[0]
    sag = body.mass * 9.81 * (0.3 * np.cos(data.qpos[0])) / servo(robot, "position", [0.0], frequency=2.0).stiffness[0]
    assert abs(data.qpos[0]) == pytest.approx(sag, rel=1e-3)


@pytest.mark.campaign
def test_servos_and_efforts_are_written(panda: hk.Robot) -> None:
    for kind, tag in (("position", "position"), ("velocity", "velocity"), ("torque", "motor")):
        model = mujoco.MjModel.from_xml_string(
            hk.robot.to_mjcf(panda, servo=servo(panda, kind, PANDA_START), effort=87.0)
        )
        assert model.nu == 7
        assert [model.actuator(i).name for i in range(7)] == list(panda.joint_names)
        assert model.actuator_forcerange.tolist() == [[-87.0, 87.0]] * 7
        assert hk.robot.to_mjcf(panda, servo=servo(panda, kind, PANDA_START)).count(f"<{tag} ") == 7
    efforts = [87.0] * 4 + [12.0] * 3
    assert [float(x) for x in re.findall('effort="(.*?)"', hk.robot.to_urdf(panda, effort=efforts))] == efforts


def test_names_that_xml_does_not_hold_are_escaped(tmp_path: Path) -> None:
    robot = hk.from_dh([{"a": 0.5, "joint": 'a"<&b'}, {"a": 0.5, "joint": "base"}], name="r&d", tip="base")
    for form in ("urdf", "mjcf"):
        back = again(robot, form, tmp_path)
        assert back.joint_names == robot.joint_names
        assert np.abs(back.pose([0.3, 0.4]) - robot.pose([0.3, 0.4])).max() < 1e-12


def test_what_makes_no_sense_is_refused(panda: hk.Robot) -> None:
    with pytest.raises(ArgumentError, match="density"):
        hk.robot.to_mjcf(panda, density=0.0)
    with pytest.raises(ArgumentError, match="effort"):
        hk.robot.to_urdf(panda, effort=-1.0)
    with pytest.raises(ShapeError, match="effort"):
        hk.robot.to_urdf(panda, effort=[1.0, 2.0])
    with pytest.raises(ArgumentError, match="use one of position, velocity, torque"):
        servo(panda, "hydraulic", PANDA_START)
    with pytest.raises(ArgumentError, match="servo"):
        hk.robot.to_mjcf(panda, servo=servo(hk.load("ppr"), "position", [1, 1, 1]))


# --- Models and programs that users have and that cannot be taken as they are, from Python and from the command line.


JOINT = (
    '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><origin xyz="1 0 0"/><axis xyz="0 0 1"/>'
    '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
)
MESH = '<visual><geometry><mesh filename="package://nowhere/part.stl"/></geometry></visual>'
LINKS = f'<link name="a"/><link name="b">{MESH}</link><link name="c">{MESH}</link><link name="d"/>'


def model(tmp_path: Path, *joints: tuple[str, str, str, str]) -> Path:
    """A URDF of links a, b, c, d whose meshes are not there."""
    file = tmp_path / "arm.urdf"
    file.write_text(f'<robot name="arm">{LINKS}{"".join(JOINT.format(*joint) for joint in joints)}</robot>')
    return file


CHAIN = (("j2", "revolute", "b", "c"), ("j3", "revolute", "c", "d"))


@pytest.mark.campaign
def test_a_model_without_its_meshes_has_its_kinematics_and_a_job(holokin: Command, tmp_path: Path) -> None:
    file = model(tmp_path, ("j1", "revolute", "a", "b"), *CHAIN)
    q = np.array([0.3, -0.5, 0.7])
    turns = np.cumsum([0, *q[:2]])
    expected = [np.cos(turns).sum(), np.sin(turns).sum(), 0]
    assert hk.load(file).pose(q)[:3, 3] == pytest.approx(expected, abs=1e-15)
    job = tmp_path / "job.toml"
    assert holokin("new", job, "--robot", file).code == 0


def test_a_floating_base_is_refused_and_a_chain_above_it_is_taken(holokin: Command, tmp_path: Path) -> None:
    file = model(tmp_path, ("fly", "floating", "a", "b"), *CHAIN)
    words = "joint 'fly' is of type 'floating'", "base"
    with pytest.raises(RobotFileError) as caught:
        hk.load(file)
    assert all(word in str(caught.value) for word in words)
    job = tmp_path / "job.toml"
    assert_refused(holokin("new", job, "--robot", file), *words)
    assert not job.exists()
    assert hk.load(file, base="b").joint_names == ("j2", "j3")


def test_a_job_begins_at_the_base_that_is_asked_for(holokin: Command, tmp_path: Path) -> None:
    links, fly = LINKS.replace('<link name="d"/>', '<link name="d"/><link name="e"/>'), ("fly", "floating", "a", "b")
    joints = [JOINT.format(*joint) for joint in (fly, *CHAIN, ("j4", "revolute", "d", "e"))]
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{links}{"".join(joints)}</robot>')
    job = tmp_path / "job.toml"
    assert holokin("new", job, "--robot", tmp_path / "arm.urdf", "--base", "b").code == 0
    assert 'base = "b"' in job.read_text()
    assert_refused(holokin("new", tmp_path / "other.toml", "--base", "b"), "--base without --robot")


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        ((("j1", "revolute", "a", "b"), *CHAIN, ("j4", "revolute", "a", "d")), ("'d' hangs on two joints", "tree")),
        ((("j1", "revolute", "d", "b"), *CHAIN), ("does not hang together with base 'a'", "choose another base")),
    ],
)
def test_links_in_a_ring_are_refused(
    holokin: Command, tmp_path: Path, joints: tuple[tuple[str, str, str, str], ...], words: tuple[str, ...]
) -> None:
    file = model(tmp_path, *joints)
    with pytest.raises(RobotFileError, match=words[-1]):
        hk.load(file, tip="d")
    outcome = holokin("new", tmp_path / "job.toml", "--robot", file, "--tip", "d")
    assert_refused(outcome, words[0])


RAIL = {
    "robot": '[[robot.parts]]\nname = "rail"\n[[robot.parts]]\nname = "iiwa14"\n',
    "start": "[start]\nq = [1.0, 0.1, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0]\n",
    "path": '[path]\nkind = "circle"\ncenter = [0.1, 0, 0]\nrelative = true\nsamples = 20\n',
}
"""Eight axes."""


@pytest.mark.parametrize(
    ("language", "said"),
    [
        ("krl", "KRL holds 6 axes of a robot and 6 external ones, but 8 are given"),
        ("rapid", "RAPID holds 6 axes of a robot and 6 external ones, but 8 are given"),
        ("ls", "holds 6 axes of a robot and 3 external ones, but 8 are given"),
        ("urscript", "URScript holds 6 axes of a robot, but 8 are given"),
    ],
)
def test_a_language_that_cannot_hold_eight_axes_says_so(
    holokin: Command, tmp_path: Path, language: str, said: str
) -> None:
    file = write_job(tmp_path, **RAIL)
    outcome = holokin("export", language, file, "--out", tmp_path / "program", "--acceleration", "5")
    assert_refused(outcome, "job.toml: [program]", said, "rail_joint", "axes")
    assert not (tmp_path / "program").exists()


def test_eight_axes_are_held_where_two_are_external(holokin: Command, tmp_path: Path) -> None:
    arm = ", ".join(f'"iiwa_joint_{i}"' for i in (1, 2, 4, 5, 6, 7))
    program = f'[program]\naxes = [{arm}]\nexternal = ["rail_joint", "iiwa_joint_3"]\n'
    file = write_job(tmp_path, **RAIL, expect=program)
    assert holokin("export", "krl", file, "--out", tmp_path / "program", "--acceleration", "5").code == 0
    assert "E2" in next((tmp_path / "program").glob("*.dat")).read_text()


def test_from_python_the_axes_are_counted_too() -> None:
    robot = hk.compose(hk.load("rail"), hk.load("iiwa14"))
    q = [1.0, 0.1, 0.6, 0.0, -1.4, 0.0, 1.1, 0.0]
    point = robot.pose(q)[:3, 3]
    walk = hk.follow(hk.moore_penrose(hk.pose(robot)), hk.line(point, point + [0.05, 0, 0]), q, samples=20)
    timed = hk.retime(walk, acceleration=5.0)
    with pytest.raises(ExportError, match="KRL holds 6 axes"):
        hk.export.to_krl(timed)
    assert issubclass(ExportError, HolokinError)


def test_a_joint_that_cannot_move_is_named_by_all_that_look_for_a_start(holokin: Command, tmp_path: Path) -> None:
    file = model(tmp_path, ("j1", "revolute", "a", "b"), *CHAIN)
    before, after = file.read_text().split('name="j2"')
    still = after.replace('lower="-3" upper="3"', 'lower="0" upper="0"', 1)
    file.write_text(f'{before}name="j2"{still}')
    words = "the range of joint 'j2' is [0.0, 0.0]", "or hold it: locked={'j2': 0}"
    assert_refused(holokin("new", tmp_path / "job.toml", "--robot", file), *words)
    for ask in (lambda: studio.open_session(str(file)), lambda: hk.advise(hk.position(hk.load(str(file)), rows=[0]))):
        with pytest.raises(ArgumentError) as caught:
            ask()
        assert all(word in str(caught.value) for word in words)
    assert hk.load(file, locked={"j2": 0}).joint_names == ("j1", "j3")
