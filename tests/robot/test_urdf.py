"""URDF files: tips, bases, locked and mimic joints, and what malformed files get."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, urdf
from holokin.base.errors import ArgumentError, RobotFileError, UnknownNameError


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
