"""Models and programs that users have and that cannot be taken as they are, from Python and from the command line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused, write_job
from holokin.app import studio
from holokin.base.errors import ArgumentError, ExportError, HolokinError, RobotFileError

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
    job = tmp_path / "app.job.toml"
    assert holokin("new", job, "--robot", file).code == 0


def test_a_floating_base_is_refused_and_a_chain_above_it_is_taken(holokin: Command, tmp_path: Path) -> None:
    file = model(tmp_path, ("fly", "floating", "a", "b"), *CHAIN)
    words = "joint 'fly' is of type 'floating'", "base"
    with pytest.raises(RobotFileError) as caught:
        hk.load(file)
    assert all(word in str(caught.value) for word in words)
    job = tmp_path / "app.job.toml"
    assert_refused(holokin("new", job, "--robot", file), *words)
    assert not job.exists()
    assert hk.load(file, base="b").joint_names == ("j2", "j3")


def test_a_job_begins_at_the_base_that_is_asked_for(holokin: Command, tmp_path: Path) -> None:
    links, fly = LINKS.replace('<link name="d"/>', '<link name="d"/><link name="e"/>'), ("fly", "floating", "a", "b")
    joints = [JOINT.format(*joint) for joint in (fly, *CHAIN, ("j4", "revolute", "d", "e"))]
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm">{links}{"".join(joints)}</robot>')
    job = tmp_path / "app.job.toml"
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
    outcome = holokin("new", tmp_path / "app.job.toml", "--robot", file, "--tip", "d")
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
    assert_refused(holokin("new", tmp_path / "app.job.toml", "--robot", file), *words)
    for ask in (lambda: studio.open_session(str(file)), lambda: hk.advise(hk.position(hk.load(str(file)), rows=[0]))):
        with pytest.raises(ArgumentError) as caught:
            ask()
        assert all(word in str(caught.value) for word in words)
    assert hk.load(file, locked={"j2": 0}).joint_names == ("j1", "j3")
