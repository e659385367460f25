"""The package for MoveIt: what is refused, names that stand in C++, XML and YAML, and a leaf with several postures."""

from __future__ import annotations

import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from typer.testing import CliRunner

import holokin as hk
from conftest import PANDA_START
from holokin.app.cli.main import app
from holokin.base.errors import ArgumentError, ExportError
from holokin.export import MoveItPackage, export_moveit
from moveit_plugins import SUCCESS, Plugin, ask
from ros_plugins import driver, library

START = [0.4, 0.7, 0.5, -0.3]


def arm(names: list[str], tip: str = "tool") -> hk.Robot:
    """Four hinges in space, without limits."""
    rows = [{"a": 0.3, "alpha": alpha, "joint": name} for name, alpha in zip(names, (1.2, -0.9, 0.8, 0.3), strict=True)]
    return hk.from_dh(rows, name="arm", tip=tip)


def written(robot: hk.Robot, folder: Path, **more: str) -> MoveItPackage:
    law = hk.holonomic(hk.position(robot), hk.lock(3))
    return export_moveit(law, folder, q0=START, vectors_count=1, **more)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> MoveItPackage:
    return written(arm(list("abcd")), tmp_path_factory.mktemp("plain"), name="four")


@pytest.mark.parametrize(
    "package", ["Arm", "1arm", "my-arm", "my__arm", "arm_", "arm plugin", "", "\u00e4rm", "a", "arm\n"]
)
def test_what_is_no_name_of_a_package_is_refused(tmp_path: Path, package: str) -> None:
    with pytest.raises(ArgumentError, match="a package of ROS has lower-case letters"):
        written(arm(list("abcd")), tmp_path, package=package)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("word", ["rclcpp", "moveit", "kinematics", "namespace", "std", "geometry_msgs"])
def test_names_that_cpp_or_ros_uses_are_refused(tmp_path: Path, word: str) -> None:
    for given in ({"package": word}, {"name": word}):
        with pytest.raises(ArgumentError, match=r"uses this name|no word or header of C"):
            written(arm(list("abcd")), tmp_path, **given)


@pytest.mark.parametrize("name", ["a\nb", "\x07", "\u202e", " ", "\u2028"])
def test_names_that_no_file_can_show_are_refused(tmp_path: Path, name: str) -> None:
    for robot, group in ((["a", name, "c", "d"], "arm"), (list("abcd"), name)):
        with pytest.raises(ArgumentError, match=r"control characters|printable characters"):
            written(arm(robot), tmp_path, group=group)
    with pytest.raises(ArgumentError, match="printable characters"):
        written(arm(list("abcd"), tip=name), tmp_path)
    with pytest.raises(ArgumentError, match="no dots"):
        written(arm(list("abcd")), tmp_path, group="arm.left")
    assert list(tmp_path.iterdir()) == []


def test_what_has_no_leaf_or_several_tips_is_refused(tmp_path: Path) -> None:
    panda, arms = hk.pose(hk.load("panda")), hk.load("yumi")
    six = hk.load("ur5e")
    both = hk.stacked(hk.position(arms, arms.tips[0].name), hk.position(arms, arms.tips[1].name))
    locked = hk.strategies.constraints.stack(*(hk.lock(i) for i in range(arms.n - both.m)))
    refusals = [
        (hk.moore_penrose(panda), PANDA_START, "has no constraint"),
        (hk.holonomic(both, locked), np.full(arms.n, 0.3), "is not about one tip"),
        (hk.moore_penrose(hk.pose(six)), np.full(6, 0.5), "no joint to spare"),
    ]
    for law, start, words in refusals:
        with pytest.raises(ExportError, match=words):
            export_moveit(law, tmp_path, q0=start)
    assert list(tmp_path.iterdir()) == []


def test_the_texts_are_what_ros_reads(plain: MoveItPackage) -> None:
    """package.xml names the plugin description, which names library and class; the yaml is one."""
    yaml = pytest.importorskip("yaml")
    package = ElementTree.parse(plain.folder / "package.xml").getroot()
    library = ElementTree.parse(plain.folder / "plugin_description.xml").getroot()
    assert package.findtext("name") == plain.package == library.get("path") == "four_moveit_plugin"
    export = package.find("export/moveit_core")
    assert export is not None and export.get("plugin") == "${prefix}/plugin_description.xml"
    one = library.find("class")
    assert (
        one is not None
        and one.get("name") == plain.plugin
        and one.get("type") == "four_moveit_plugin::KinematicsPlugin"
    )
    config = yaml.safe_load((plain.folder / "config" / "kinematics.yaml").read_text("utf-8"))
    assert config["arm"]["kinematics_solver"] == plain.plugin and config["arm"]["from_seed"] is False
    assert set(plain.files) == {str(f.relative_to(plain.folder)) for f in plain.folder.rglob("*") if f.is_file()}


def test_files_of_others_are_left_alone(tmp_path: Path) -> None:
    robot = arm(list("abcd"))
    (tmp_path / "package.xml").write_text("<package/>", "utf-8")
    with pytest.raises(ArgumentError, match="not holokin's"):
        written(robot, tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["package.xml"]
    (tmp_path / "package.xml").unlink()
    written(robot, tmp_path, name="one")
    written(robot, tmp_path, name="one")
    with pytest.raises(ArgumentError, match="another export"):
        written(robot, tmp_path, name="two")


NAMES = ["\"a' & <b>", "c\\n ??/ %s", "$name ${NAME} */ //", "Gelenk \u00e4 \u5173\u8282 `x|y`"]
"""Quotes, angle brackets, backslashes, dollars and letters of other scripts."""

TIP = "Spitze \"'<&>"
ROBOT = arm(NAMES, TIP)
LAW = hk.holonomic(hk.position(ROBOT), hk.lock(3))
needs_cpp = pytest.mark.skipif(not (shutil.which("g++") and shutil.which("cc")), reason="no C++ compiler here")


@pytest.fixture(scope="module")
def named(tmp_path_factory: pytest.TempPathFactory) -> Plugin:
    """The plugin of a robot without limits and with any names, for a task of positions."""
    folder = tmp_path_factory.mktemp("named")
    done = written(ROBOT, folder / "package", name="four", group='my "arm" & #1: x')
    ElementTree.parse(done.folder / "package.xml")
    return Plugin(library(done, folder), driver("moveit_driver.cpp", folder), done.folder / "test" / "robot")


def around(count: int, size: float) -> np.ndarray:
    return START + np.random.default_rng(0).uniform(-size, size, (count, 4))


def poses(Q: np.ndarray) -> np.ndarray:
    return np.array([ROBOT.pose(q) for q in Q])


@needs_cpp
@pytest.mark.campaign
def test_a_robot_without_limits_and_with_any_names_is_solved(named: Plugin) -> None:
    T = poses(around(50, 0.2))
    found = ask(named, T, around(50, 0.2), tip=TIP)
    assert found.exit == 0, found.words
    expected = hk.ik(LAW, START).batch(T[:, :3, 3])
    assert expected.reached.all() and (found.codes == SUCCESS).all()
    np.testing.assert_allclose(found.joints, expected.q, atol=1e-9)


@needs_cpp
@pytest.mark.campaign
def test_from_the_seed_the_posture_may_be_another_one_of_the_leaf(named: Plugin) -> None:
    """Seeds anywhere: each answer is on the leaf and reaches the pose, but not all are the answer from the start."""
    T, seeds = poses(around(100, 0.2)), np.random.default_rng(1).uniform(-np.pi, np.pi, (100, 4))
    start = ask(named, T, seeds, tip=TIP)
    found = ask(named, T, seeds, "from_seed=bool:true", tip=TIP)
    reached = found.codes == SUCCESS
    apart = np.abs(np.sin((found.joints - start.joints) / 2)).max(axis=1)[reached] > 0.1
    assert 10 < apart.sum() < reached.sum()
    np.testing.assert_allclose(found.joints[reached, 3], START[3], atol=1e-9)
    np.testing.assert_allclose(poses(found.joints[reached])[:, :3, 3], T[reached][:, :3, 3], atol=1e-9)


def test_the_command_writes_the_package_of_a_job(tmp_path: Path) -> None:
    """And says in a sentence what it refuses."""
    out = tmp_path / "out"
    words = ["export", "moveit", "panda-circle", "--strategy", "lock-3", "--group", "panda_arm", "--out", str(out)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "kinematics_solver: panda_lock_3_moveit_plugin/KinematicsPlugin" in done.output
    assert '"panda_arm":' in (out / "config" / "kinematics.yaml").read_text("utf-8")
    assert "from the job panda-circle, strategy lock-3" in " ".join((out / "README.md").read_text("utf-8").split())
