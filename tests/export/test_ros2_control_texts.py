"""The package for ros2_control: its own tests, what is refused, names, ROS 2 Humble, ament and pluginlib."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from typer.testing import CliRunner

import holokin as hk
from conftest import PANDA_START, campaign
from control_plugins import BuiltController, Outcome, posed, update_all
from holokin.app.cli.main import app
from holokin.base.errors import ArgumentError, ExportError
from holokin.export import Ros2ControlPackage, export_ros2_control
from holokin.robot import to_urdf
from ros_plugins import STUBS, driver, found_by_pluginlib, includes, library, run

needs_cpp = pytest.mark.skipif(not (shutil.which("g++") and shutil.which("cc")), reason="no C++ compiler here")

NAMES = ["\"a' & <b>", "c\\n ??= %s", "$name ${NAME} */ //", "Gelenk \u00e4 \u5173\u8282 `x|y`"]
"""Quotes, angle brackets, backslashes, dollars and letters of other scripts."""

START = [0.4, 0.7, 0.5, -0.3]
LAST = hk.lock(3)


def arm(names: list[str], tip: str = "tool") -> hk.Robot:
    """Four hinges in space, without limits."""
    rows = [{"a": 0.3, "alpha": alpha, "joint": name} for name, alpha in zip(names, (1.2, -0.9, 0.8, 0.3), strict=True)]
    return hk.from_dh(rows, name="arm", tip=tip)


def written(robot: hk.Robot, folder: Path, held: hk.Constraint = LAST, **more: str) -> Ros2ControlPackage:
    law = hk.holonomic(hk.position(robot), held)
    return export_ros2_control(law, folder, q0=START, vectors_count=1, **more)  # type: ignore[arg-type]


FOLLOWER = (
    '  <link name="hand"/><joint name="e" type="revolute"><origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/><parent '
    'link="tool"/><child link="hand"/><axis xyz="0 0.6 0.8"/><mimic joint="b" multiplier="-0.5" offset="0.2"/>'
    '<limit lower="-3" upper="3" effort="1" velocity="9"/></joint>\n</robot>'
)
"""A joint before the tip that follows another one."""


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Ros2ControlPackage:
    folder = tmp_path_factory.mktemp("plain")
    file = folder / "arm.urdf"
    file.write_text(to_urdf(arm(list("abcd"))).replace("</robot>", FOLLOWER), "utf-8")
    return written(hk.from_urdf(file, tip="hand"), folder / "package", name="four")


def test_what_is_no_name_and_what_has_no_leaf_is_refused(tmp_path: Path) -> None:
    for package in ("Arm", "my__arm", "", "controller_interface", "std"):
        with pytest.raises(ArgumentError):
            written(arm(list("abcd")), tmp_path, package=package)
    with pytest.raises(ArgumentError, match=r"control characters|printable characters"):
        written(arm(["a", "b\n", "c", "d"]), tmp_path)
    panda, six = hk.pose(hk.load("panda")), hk.load("ur5e")
    for law, start, words in (
        (hk.moore_penrose(panda), PANDA_START, "has no constraint"),
        (hk.moore_penrose(hk.pose(six)), np.full(6, 0.5), "take one of the controllers of ros2_controllers"),
    ):
        with pytest.raises(ExportError, match=words):
            export_ros2_control(law, tmp_path, q0=start)
    assert list(tmp_path.iterdir()) == []


def test_the_texts_of_the_controller_are_what_ros_reads(plain: Ros2ControlPackage) -> None:
    """package.xml names the plugin description, which names the class; the yaml has the defaults."""
    yaml = pytest.importorskip("yaml")
    package = ElementTree.parse(plain.folder / "package.xml").getroot()
    library = ElementTree.parse(plain.folder / "plugin_description.xml").getroot()
    assert package.findtext("name") == plain.package == library.get("path") == "four_controller"
    export, one = package.find("export/controller_interface"), library.find("class")
    assert export is not None and export.get("plugin") == "${prefix}/plugin_description.xml"
    assert one is not None and one.get("name") == plain.plugin == "four_controller/ToolController"
    assert one.get("base_class_type") == "controller_interface::ControllerInterface"
    config = yaml.safe_load((plain.folder / "config" / "controller.yaml").read_text("utf-8"))
    assert config["controller_manager"]["ros__parameters"]["tool_controller"]["type"] == plain.plugin
    given = config["tool_controller"]["ros__parameters"]
    source = (plain.folder / "src" / "tool_parameters.cpp").read_text("utf-8")
    declared = {line.split('"')[1]: line for line in source.splitlines() if "auto_declare<" in line}
    readme = (plain.folder / "README.md").read_text("utf-8")
    assert set(given) <= set(declared)
    assert all(f"`{name}`" in readme for name in set(declared) - set(given))
    for name, value in given.items():
        if isinstance(value, float):
            assert float(declared[name].split(", ")[1].rstrip(");")) == value
    assert given["level"] == [START[3]]
    assert set(plain.files) == {str(f.relative_to(plain.folder)) for f in plain.folder.rglob("*") if f.is_file()}


def test_the_command_writes_the_controller_of_a_job(tmp_path: Path) -> None:
    out = tmp_path / "out"
    words = ["export", "ros2-control", "panda-circle", "--strategy", "lock-3", "--out", str(out)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "type: panda_lock_3_controller/ToolController" in done.output
    assert "from the job panda-circle, strategy lock-3" in " ".join((out / "README.md").read_text("utf-8").split())


def package_test(
    written: Ros2ControlPackage, folder: Path, test: Path, places: list[str], *sources: Path
) -> subprocess.CompletedProcess[str]:
    """The test of a package with one of the interfaces of ros2_control, as it ends."""
    c, src, code, plugin = written.folder / "c", written.folder / "src", folder / "law.o", folder / "libplugin.so"
    build = ["g++", "-std=c++17", "-O0", "-w", "-DFMT_HEADER_ONLY", *places, f"-I{c}", f"-I{src}"]
    run("cc", "-std=c99", "-O1", "-fPIC", "-fvisibility=hidden", "-c", c / f"{written.name}.c", "-o", code)
    run(*build, "-fPIC", "-shared", *src.glob("*.cpp"), *sources, code, "-o", plugin)
    words = [f'-DPLUGIN="{plugin}"', f'-DROBOT="{written.folder / "test" / "robot.urdf"}"']
    made = folder / "test_controller"
    run(*build, *words, test, plugin, f"-Wl,-rpath,{folder}", "-o", made, "-ldl", "-lpthread")
    return subprocess.run([str(made)], capture_output=True, text=True, timeout=200, check=False)


@needs_cpp
@pytest.mark.parametrize("control", [campaign("control", one) for one in ("control", "control2")])
def test_the_test_of_the_controller_passes(plain: Ros2ControlPackage, tmp_path: Path, control: str) -> None:
    """With the interface of ros2_control 4 to 6, and with that of ros2_control 2; a task of positions."""
    done = package_test(
        plain, tmp_path, plain.folder / "test" / "test_controller.cpp", includes("ros", "robot", control, "loader")
    )
    assert "11 tests, 0 failures" in done.stdout, done.stderr


@needs_cpp
@pytest.mark.campaign
def test_the_test_of_the_controller_fails_for_other_joints(plain: Ros2ControlPackage, tmp_path: Path) -> None:
    """The joints that it expects are moved by 1e-8 rad."""
    source = plain.folder / "test"
    text = (source / "python_joints.h").read_text("utf-8")
    first = text.split("JOINTS[")[1].split("{", 2)[2].split(",")[0]
    (tmp_path / "python_joints.h").write_text(text.replace(first, repr(float(first) + 1e-8)), "utf-8")
    shutil.copy(source / "test_controller.cpp", tmp_path)
    done = package_test(
        plain, tmp_path, tmp_path / "test_controller.cpp", includes("ros", "robot", "control", "loader")
    )
    assert done.returncode == 1 and "1e-9" in done.stderr


@needs_cpp
@pytest.mark.campaign
def test_a_robot_without_limits_and_with_any_names_is_controlled(tmp_path: Path) -> None:
    """A task of positions: the orientation of a target does not count. An angle is a level with a turn more, too."""
    robot = arm(NAMES, "Spitze \"'<&>")
    angle = hk.custom(lambda q: q[3], rows=1, angular=True)
    done = written(robot, tmp_path / "package", angle, name="four", package="four")
    ElementTree.parse(done.folder / "package.xml")
    built = BuiltController(
        library(done, tmp_path), driver("control_driver.cpp", tmp_path), done, robot.joint_names, np.array(START)
    )
    start = robot.pose(START)
    target = start.copy()
    target[:3, 3] += [0.03, -0.02, 0.05]
    target[:3, :3] = target[:3, :3] @ np.diag([-1.0, -1.0, 1.0])
    found = update_all(built, [posed(target)] * 1000, f"level=numbers:{START[3] + 2 * np.pi}")
    assert (found.status == Outcome.OK).all()
    np.testing.assert_allclose(robot.pose(found.states[-1])[:3, 3], target[:3, 3], atol=1e-9)
    np.testing.assert_allclose(found.states[:, 3], START[3], atol=1e-9)


@needs_cpp
@pytest.mark.campaign
def test_the_latest_value_is_whole_and_not_older_than_the_one_before(plain: Ros2ControlPackage, tmp_path: Path) -> None:
    """A writer and a reader at once, watched by ThreadSanitizer."""
    made = tmp_path / "race"
    source = STUBS / "latest_value_race.cpp"
    run(
        "g++",
        "-std=c++17",
        "-O1",
        "-g",
        "-fsanitize=thread",
        f"-I{plain.folder / 'src'}",
        source,
        "-o",
        made,
        "-lpthread",
    )
    assert "whole and in order" in run(made).stdout


@needs_cpp
@pytest.mark.campaign
@pytest.mark.skipif("HOLOKIN_ROS2_CONTROL" not in os.environ, reason="HOLOKIN_ROS2_CONTROL is no checkout")
def test_ros2_controls_own_base_class_and_interfaces_take_the_controller(
    plain: Ros2ControlPackage, tmp_path: Path
) -> None:
    """controller_interface, the handles and the loaned interfaces of a checkout, with stand-ins of what they need."""
    checkout = Path(os.environ["HOLOKIN_ROS2_CONTROL"])
    parts = [checkout / name for name in ("controller_interface", "hardware_interface", "joint_limits")]
    sources = [parts[0] / "src" / f"{name}.cpp" for name in ("controller_interface", "controller_interface_base")]
    if (parts[1] / "include" / "hardware_interface" / "lexical_casts.hpp").exists():
        sources.append(parts[1] / "src" / "lexical_casts.cpp")
    places = [f"-I{STUBS / 'base'}", *(f"-I{part / 'include'}" for part in parts), *includes("ros", "robot", "loader")]
    done = package_test(plain, tmp_path, plain.folder / "test" / "test_controller.cpp", places, *sources)
    assert "11 tests, 0 failures" in done.stdout, done.stderr


REAL = [
    Path("/usr/include/pluginlib"),
    Path("/usr/include/gtest"),
    Path("/usr/include/urdf"),
    Path("/usr/share/ament_cmake"),
]


@needs_cpp
@pytest.mark.campaign
@pytest.mark.skipif(
    not all(map(Path.exists, REAL)), reason="pluginlib, GoogleTest, urdf or ament_cmake is not installed"
)
def test_ament_builds_the_controller_and_pluginlib_finds_it(plain: Ros2ControlPackage, tmp_path: Path) -> None:
    """With Debian's ament_cmake, pluginlib, urdf and GoogleTest; ros2_control and rclcpp are stand-ins."""
    base = ("controller_interface", "controller_interface::ControllerInterface")
    header = "controller_interface/controller_interface.hpp"
    assert found_by_pluginlib(plain, tmp_path, *base, header, "ros", "control") == f"{plain.plugin}\n"
