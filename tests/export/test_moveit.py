"""The kinematics plugin for MoveIt: the joints of Python, whatever the seed, the group's order and the thread."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import PANDA_START
from holokin.export import MoveItPackage, export_moveit
from holokin.motion.ik import InverseStatus
from moveit_plugins import NO_SOLUTION, SUCCESS, TIMED_OUT, Answers, Plugin, ask
from ros_plugins import STUBS, driver, found_by_pluginlib, includes, library, run

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(not (shutil.which("g++") and shutil.which("cc")), reason="no C++ compiler here"),
]

TIP = "panda_hand_tcp"
LAW = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))
ROBOT = LAW.task.robot
LOWER, UPPER = ROBOT.ranges(1.0)


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> MoveItPackage:
    folder = tmp_path_factory.mktemp("package")
    return export_moveit(LAW, folder, q0=PANDA_START, name="panda_law", vectors_count=1)


@pytest.fixture(scope="module")
def plugin(package: MoveItPackage, tmp_path_factory: pytest.TempPathFactory) -> Plugin:
    folder = tmp_path_factory.mktemp("built")
    return Plugin(library(package, folder), driver("moveit_driver.cpp", folder), package.folder / "test" / "robot")


def near(count: int, seed: int = 0, size: float = 0.3) -> np.ndarray:
    """Postures round the start, within the limits."""
    offsets = np.random.default_rng(seed).uniform(-size, size, (count, 7))
    return np.clip(PANDA_START + offsets, LOWER, UPPER)


def anywhere(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(LOWER, UPPER, (count, 7))


def poses(Q: np.ndarray) -> np.ndarray:
    return np.array([ROBOT.pose(q) for q in Q])


def test_the_same_pose_has_the_joints_of_python_whatever_the_seed(plugin: Plugin) -> None:
    """1,000 poses, 100 of them anywhere within the joint ranges, where many are out of reach on this leaf."""
    T = poses(np.vstack([near(900), anywhere(100)]))
    found = ask(plugin, T, anywhere(1000, seed=1), tip=TIP)
    expected = hk.ik(LAW, PANDA_START, limits=True).batch(T)
    reached = expected.reached
    assert found.exit == 0 and reached[:900].all() and 20 < reached[900:].sum() < 90
    np.testing.assert_array_equal(found.codes == SUCCESS, reached)
    assert (found.codes[~reached] == NO_SOLUTION).all() and np.isnan(found.joints[~reached]).all()
    assert {InverseStatus.LIMIT, InverseStatus.LEAF_ENDS} <= set(expected.status.tolist())
    np.testing.assert_allclose(found.joints[reached], expected.q[reached], atol=1e-9)


def package_test(test: Path, robot: Path, plugin: Plugin, folder: Path) -> subprocess.CompletedProcess[str]:
    """The test of a package, with the stand-ins of GoogleTest and class_loader, as it ends."""
    words = [f'-DPLUGIN="{plugin.library}"', f'-DROBOT="{robot}"', *includes("ros", "robot", "loader")]
    made = folder / "test_plugin"
    run("g++", "-std=c++17", "-O0", "-Wall", "-Wextra", *words, test, "-o", made, "-ldl", "-lpthread")
    return subprocess.run([str(made)], capture_output=True, text=True, timeout=200, check=False)


def test_the_test_in_the_package_passes(package: MoveItPackage, plugin: Plugin, tmp_path: Path) -> None:
    test = package.folder / "test" / "test_plugin.cpp"
    assert "8 tests, 0 failures" in package_test(test, plugin.robot, plugin, tmp_path).stdout


def test_the_test_in_the_package_fails_for_other_joints(package: MoveItPackage, plugin: Plugin, tmp_path: Path) -> None:
    """The joints that it expects are moved by 1e-8 rad."""
    source = package.folder / "test"
    joints = (source / "python_joints.h").read_text("utf-8")
    first = joints.split("JOINTS[")[1].split("{", 2)[2].split(",")[0]
    (tmp_path / "python_joints.h").write_text(joints.replace(first, repr(float(first) + 1e-8)), "utf-8")
    shutil.copy(source / "test_plugin.cpp", tmp_path)
    found = package_test(tmp_path / "test_plugin.cpp", plugin.robot, plugin, tmp_path)
    assert found.returncode == 1 and "1e-9" in found.stderr


def test_threads_share_a_plugin(plugin: Plugin) -> None:
    """Four threads at once: the driver compares their answers bit by bit."""
    for begun in ("from_seed=bool:false", "from_seed=bool:true"):
        assert ask(plugin, poses(near(60)), near(60, seed=1), begun, tip=TIP, threads=4).exit == 0


def test_no_thread_writes_what_another_reads(package: MoveItPackage, tmp_path: Path) -> None:
    flags = ("-fsanitize=thread", "-g")
    watched = Plugin(
        library(package, tmp_path, *flags),
        driver("moveit_driver.cpp", tmp_path, *flags),
        package.folder / "test" / "robot",
    )
    found = ask(watched, poses(near(60)), near(60, seed=1), "from_seed=bool:true", tip=TIP, threads=4)
    assert found.exit == 0 and "WARNING" not in found.words, found.words


def changed(plugin: Plugin, folder: Path, urdf: Callable[[str], str], srdf: Callable[[str], str] = str) -> Path:
    """The robot of the package with other texts."""
    for kind, change in (("urdf", urdf), ("srdf", srdf)):
        text = plugin.robot.with_suffix(f".{kind}").read_text("utf-8")
        (folder / f"other.{kind}").write_text(change(text), "utf-8")
    return folder / "other"


def joint_blocks(urdf: str) -> list[str]:
    return [f"  <joint{rest.split('</joint>')[0]}</joint>\n" for rest in urdf.split("  <joint")[1:]]


def test_joints_are_told_apart_by_their_names(plugin: Plugin, tmp_path: Path) -> None:
    """A group in the opposite order has the same joints in the opposite order."""

    def opposite(urdf: str) -> str:
        blocks = joint_blocks(urdf)
        return urdf[: urdf.index("  <joint")] + "".join(reversed(blocks)) + "</robot>\n"

    T, seeds = poses(near(20)), near(20, seed=2)
    other = changed(plugin, tmp_path, opposite)
    found = ask(plugin, T, seeds[:, ::-1], tip=TIP, robot=other)
    assert found.words.splitlines()[1].split()[1:] == list(reversed(ROBOT.joint_names))
    np.testing.assert_array_equal(found.joints[:, ::-1], ask(plugin, T, seeds, tip=TIP).joints)
    begun = "from_seed=bool:true"
    ours = ask(plugin, T, seeds, begun, tip=TIP)
    theirs = ask(plugin, T, seeds[:, ::-1], begun, tip=TIP, robot=other)
    np.testing.assert_array_equal(ours.joints, theirs.joints[:, ::-1])
    q = 0.1 * np.arange(7, 0, -1)
    np.testing.assert_allclose(links(found)[TIP], ROBOT.pose(q), atol=1e-12)


def links(found: Answers) -> dict[str, np.ndarray]:
    """The poses (4, 4) that the plugin gives for its links, with its joints at 0.1, 0.2, ..."""
    poses = {}
    for line in found.words.splitlines():
        if line.startswith("link "):
            name, *numbers = line.split()[1:]
            poses[name] = np.eye(4)
            poses[name][:3, 3] = np.array(numbers[:3], dtype=float)
            poses[name][:3, :3] = Rotation.from_quat(np.array(numbers[3:], dtype=float)).as_matrix()
    return poses


def test_forward_kinematics_has_every_link_of_the_group(plugin: Plugin) -> None:
    """The referee is the loader of URDF files, one link as the tip after another."""
    found = ask(plugin, poses(near(1)), near(1), tip=TIP)
    assert "unknown link: 0" in found.words and "redundant: 01" in found.words
    given, q = links(found), 0.1 * np.arange(1, 8)
    assert len(given) == 8
    for name, pose in given.items():
        chain = hk.from_urdf(plugin.robot.with_suffix(".urdf"), tip=name)
        np.testing.assert_allclose(pose, chain.pose(q[: chain.n]), atol=1e-12)


def test_where_the_robot_stands_in_the_world_makes_no_difference(plugin: Plugin, tmp_path: Path) -> None:
    """Poses are in the base frame, and the base is turned and moved in MoveIt's model."""
    world = (
        '  <link name="world"/><joint name="stand" type="fixed"><origin xyz="1 2 3" rpy="0.3 -0.4 2.0"/>'
        '<parent link="world"/><child link="base"/></joint>\n  <link name="base">'
    )
    other = changed(plugin, tmp_path, lambda text: text.replace('  <link name="base">', world))
    T, seeds = poses(near(20)), near(20)
    moved, still = ask(plugin, T, seeds, tip=TIP, robot=other), ask(plugin, T, seeds, tip=TIP)
    np.testing.assert_array_equal(moved.joints, still.joints)
    for name, pose in links(still).items():
        np.testing.assert_allclose(links(moved)[name], pose, atol=1e-12)
    assert ask(plugin, T, seeds, tip=TIP, base="world", robot=other).exit == 2


def test_a_joint_that_follows_goes_with_its_leader(plugin: Plugin, tmp_path: Path) -> None:
    finger = (
        '  <link name="finger"/><joint name="finger" type="revolute"><parent link="base"/><child link="finger"/>'
        '<axis xyz="0 0 1"/><mimic joint="panda_joint4" multiplier="-2.0" offset="0.5"/>'
        '<limit lower="-9" upper="9" effort="1" velocity="1"/></joint>\n</robot>'
    )
    other = changed(
        plugin, tmp_path, lambda text: text.replace("</robot>", finger),
        lambda text: text.replace("</group>", '<joint name="finger"/></group>'),
    )  # fmt: skip
    T, seeds = poses(near(20)), np.hstack([near(20), np.zeros((20, 1))])
    found = ask(plugin, T, seeds, tip=TIP, robot=other)
    np.testing.assert_allclose(found.joints[:, 7], -2.0 * found.joints[:, 3] + 0.5, rtol=0, atol=1e-15)
    begun = "from_seed=bool:true"
    seeded = ask(plugin, T, np.hstack([near(20), np.full((20, 1), 9.0)]), begun, tip=TIP, robot=other)
    np.testing.assert_array_equal(seeded.joints[:, :7], ask(plugin, T, near(20), begun, tip=TIP).joints)
    leaderless = changed(
        plugin, tmp_path, lambda text: text.replace("</robot>", finger.replace('<mimic joint="panda_joint4"', "<none")),
        lambda text: text.replace("</group>", '<joint name="finger"/></group>'),
    )  # fmt: skip
    refused = ask(plugin, T, seeds, tip=TIP, robot=leaderless)
    assert refused.exit == 2 and "does not move the joints 'finger' of the group" in refused.words


@pytest.mark.parametrize(
    ("tip", "base", "group", "words"),
    [
        ("panda_joint5_link", "base", "arm", "m and .* rad from where the export has its tip 'panda_hand_tcp'"),
        (TIP, "panda_joint1_link", "arm", "Choose base and tip as they were exported"),
        (TIP, "base", "leg", "has no such group"),
        ("nowhere", "base", "arm", "no link 'nowhere'"),
        (f"{TIP},panda_joint5_link", "base", "arm", "the group has 2 tips"),
    ],
)
def test_another_frame_or_group_is_refused(plugin: Plugin, tip: str, base: str, group: str, words: str) -> None:
    found = ask(plugin, poses(near(1)), near(1), tip=tip, base=base, group=group)
    assert found.exit == 2
    assert re.search(words, found.words), found.words


def test_a_group_without_a_joint_of_the_export_is_refused(plugin: Plugin, tmp_path: Path) -> None:
    def renamed(text: str) -> str:
        return text.replace('"panda_joint3"', '"elbow"')

    other = changed(plugin, tmp_path, renamed, renamed)
    found = ask(plugin, poses(near(1)), near(1), tip=TIP, robot=other)
    assert found.exit == 2 and "'elbow'" in found.words and "lacks the joints 'panda_joint3'" in found.words


def test_a_robot_of_another_size_is_refused(plugin: Plugin, tmp_path: Path) -> None:
    """A millimetre in one link of MoveIt's model."""
    other = changed(plugin, tmp_path, lambda text: text.replace("0.333", "0.334"))
    found = ask(plugin, poses(near(1)), near(1), tip=TIP, robot=other)
    assert found.exit == 2 and "is 0.001 m" in found.words
    assert ask(plugin, poses(near(1)), near(1), "model_tolerance=double:0.002", tip=TIP, robot=other).exit == 0


def test_narrower_limits_of_moveit_are_kept(plugin: Plugin, tmp_path: Path) -> None:
    T = poses(near(100))
    free = ask(plugin, T, near(100), tip=TIP)
    middle = float(np.median(free.joints[:, 0]))
    block = next(
        text for text in joint_blocks(plugin.robot.with_suffix(".urdf").read_text("utf-8")) if "joint1" in text
    )
    narrow = re.sub(r'upper="[^"]*"', f'upper="{middle!r}"', block)
    other = changed(plugin, tmp_path, lambda text: text.replace(block, narrow))
    held = ask(plugin, T, near(100), tip=TIP, robot=other)
    np.testing.assert_array_equal(held.codes == SUCCESS, free.joints[:, 0] <= middle)


def test_bad_parameters_are_said_and_few_pieces_reach_nothing_far(plugin: Plugin) -> None:
    T, seeds = poses(anywhere(5)), anywhere(5)
    for text, words in (("max_pieces=text:many", "is not of its type"), ("max_pieces=int:0", "give 1 to 20000"),
                        ("model_tolerance=double:-1", "not above 0")):  # fmt: skip
        found = ask(plugin, T, seeds, text, tip=TIP)
        assert found.exit == 2 and words in found.words, found.words
    assert (ask(plugin, T, seeds, "max_pieces=int:1", tip=TIP).codes == NO_SOLUTION).all()


def test_the_time_is_over_between_two_tries(plugin: Plugin) -> None:
    """A pose that takes more than the first 256 pieces, and no time for more."""
    T = poses(anywhere(40))
    late: Answers = ask(plugin, T, anywhere(40), tip=TIP, timeout=1e-9)
    slow = ask(plugin, T, anywhere(40), tip=TIP)
    assert set(late.codes.tolist()) <= {TIMED_OUT, NO_SOLUTION, SUCCESS} and (late.codes == TIMED_OUT).sum() > 10
    both = (late.codes == SUCCESS) & (slow.codes == SUCCESS)
    np.testing.assert_array_equal(late.joints[both], slow.joints[both])


def test_a_pose_that_is_none_is_refused(plugin: Plugin) -> None:
    T = poses(near(2))
    T[0, 0, 3] = np.nan
    found = ask(plugin, T, near(2), tip=TIP)
    assert found.codes.tolist() == [NO_SOLUTION, SUCCESS] and "the pose is not finite" in found.words


def test_from_seeds_near_the_start_come_the_same_joints(plugin: Plugin) -> None:
    T, ik = poses(near(60)), hk.ik(LAW, PANDA_START, limits=True)
    close = near(60, seed=3, size=0.05)
    found = ask(plugin, T, close, "from_seed=bool:true", tip=TIP)
    assert (found.codes == SUCCESS).all()
    np.testing.assert_allclose(found.joints, ik.batch(T).q, atol=1e-9)


@pytest.mark.campaign
@pytest.mark.skipif("HOLOKIN_MOVEIT" not in os.environ, reason="HOLOKIN_MOVEIT is no checkout of moveit2")
def test_moveits_own_base_class_takes_the_plugin(package: MoveItPackage, tmp_path: Path) -> None:
    """kinematics_base.hpp and .cpp of MoveIt, 2.12 or later, with stand-ins of what they need."""
    core = Path(os.environ["HOLOKIN_MOVEIT"]) / "moveit_core"
    base, macros = (core / name / "include" for name in ("kinematics_base", "macros"))
    places = (base, macros, STUBS / "base", STUBS / "ros", STUBS / "robot", STUBS / "loader", package.folder / "c")
    build = ["g++", "-std=c++17", "-O0", "-Wall", "-fPIC", *(f"-I{place}" for place in places)]
    source, code, made = core / "kinematics_base" / "src" / "kinematics_base.cpp", tmp_path / "law.o", tmp_path / "a.so"
    run("cc", "-std=c99", "-O1", "-fPIC", "-c", package.folder / "c" / f"{package.name}.c", "-o", code)
    run(*build, "-shared", package.folder / "src" / "kinematics_plugin.cpp", source, code, "-o", made)
    words = [f'-DPLUGIN="{made}"', f'-DROBOT="{package.folder / "test" / "robot"}"']
    test, program = package.folder / "test" / "test_plugin.cpp", tmp_path / "test_plugin"
    run(*build, *words, test, source, "-o", program, "-ldl", "-lpthread")
    assert "8 tests, 0 failures" in run(program).stdout


REAL = [Path("/usr/include/pluginlib"), Path("/usr/include/gtest"), Path("/usr/share/ament_cmake")]


@pytest.mark.campaign
@pytest.mark.skipif(not all(map(Path.exists, REAL)), reason="pluginlib, GoogleTest or ament_cmake is not installed")
def test_ament_builds_the_package_and_pluginlib_finds_it(package: MoveItPackage, tmp_path: Path) -> None:
    """With Debian's ament_cmake, class_loader, pluginlib and GoogleTest; MoveIt and rclcpp are stand-ins."""
    base = ("moveit_core", "kinematics::KinematicsBase", "moveit/kinematics_base/kinematics_base.hpp")
    assert found_by_pluginlib(package, tmp_path, *base, "ros", "robot") == f"{package.plugin}\n"
