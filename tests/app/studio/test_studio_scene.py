"""What the studio draws: meshes where they belong, ghosts, colours; and how a page is opened. No browser."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

import holokin as hk
from conftest import urdf
from holokin.app.report.robot_view import pieces_of
from holokin.base.errors import ArgumentError, CallError, MissingExtraError, UnknownNameError
from holokin.robot import Box, Capsule, Cylinder, Surface, chain_length
from sessions import served, until

pytest.importorskip("viser", reason="the extra `studio` is not installed")
from holokin.app.studio import Motion, record
from holokin.app.studio.page_scene import (
    GHOST,
    OPACITY,
    Scene,
    elbow_joint,
    frames_of,
    linear,
    looks_of,
    pose_of,
    quaternions,
    rotations_of,
    seen,
    wxyz_of,
)

PANDA = "panda.urdf"


@pytest.fixture(scope="module", autouse=True)
def uncompiled() -> Iterator[None]:
    """What is drawn is the same on the virtual machine, which needs no compiler."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOLOKIN_NATIVE", "0")
        yield


ARM = """<robot name="arm"><link name="base"/>
<link name="a"><visual><origin xyz="0 0 0.2"/><geometry>{0}</geometry></visual></link>
<link name="b"><visual><geometry><box size="0.1 0.2 0.3"/></geometry>
<material name="red"><color rgba="1 0 0 1"/></material></visual></link><link name="tip"/>
<joint name="j1" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="j2" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
<joint name="j3" type="fixed"><parent link="b"/><child link="tip"/><origin xyz="0 0 0.4"/></joint></robot>"""


@pytest.fixture(scope="module")
def panda() -> Any:
    file = urdf(PANDA)
    return hk.load(file, tip="panda_hand_tcp", locked={"panda_finger_joint1": 0.03}), file


def test_each_mesh_of_a_urdf_is_drawn_where_pinocchio_puts_it(panda: Any) -> None:
    pin = pytest.importorskip("pinocchio")
    robot, file = panda
    q = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    roots = [str(folder) for folder in file.parents]
    model = pin.buildModelFromUrdf(str(file))
    geometry = pin.buildGeomFromUrdf(model, str(file), pin.GeometryType.VISUAL, roots)
    data, placed = model.createData(), pin.GeometryData(geometry)
    pin.forwardKinematics(model, data, np.concatenate([q, [0.03, 0.03]]))
    pin.updateGeometryPlacements(model, data, geometry, placed)
    wanted = {
        geometry.geometryObjects[i].name.rpartition("_")[0]: placed.oMg[i].homogeneous for i in range(geometry.ngeoms)
    }
    positions, turns = frames_of(robot, q[None])
    assert len(robot.visuals) == len(wanted) == 11
    for visual in robot.visuals:
        frame = pose_of(positions[visual.joint + 1, 0], turns[visual.joint + 1, 0])
        assert frame @ visual.placement == pytest.approx(wanted[visual.link], abs=1e-9), visual.link


@pytest.mark.campaign
def test_a_ghost_is_coarse_and_still_the_robot(panda: Any) -> None:
    fine, coarse = looks_of(panda[0])[0], looks_of(panda[0], GHOST)[0]
    assert sum(len(look.triangles) for look in fine) > 100_000
    assert 0.5 * GHOST < sum(len(look.triangles) for look in coarse) <= GHOST
    for one, other in zip(fine, coarse, strict=True):
        assert one.joint == other.joint
        ends = [np.array([look.points.min(axis=0), look.points.max(axis=0)]) for look in (one, other)]
        assert ends[0] == pytest.approx(ends[1], abs=0.012)


def test_a_geom_of_mjcf_is_drawn_where_mujoco_puts_it() -> None:
    mujoco = pytest.importorskip("mujoco")
    text = """<mujoco><asset><mesh name="tet" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"/></asset><worldbody>
    <geom type="plane" size="1 1 1"/><body name="a" pos="0 0 0.1"><joint name="j1" axis="0 0 1"/>
    <geom type="mesh" mesh="tet" pos="0.1 0 0" euler="20 0 0" rgba="0 1 0 1" contype="0" conaffinity="0"/>
    <geom type="box" size="0.1 0.2 0.3" group="3"/>
    <body name="b" pos="0 0 0.5" euler="0 30 0"><joint name="j2" axis="0 1 0"/><geom type="capsule" size="0.05 0.2"/>
    <site name="tip" pos="0 0 0.3"/></body></body></worldbody></mujoco>"""
    robot = hk.robot.from_mjcf(text, tip="tip")
    model = mujoco.MjModel.from_xml_string(text)
    data, q = mujoco.MjData(model), np.array([0.4, -0.7])
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    positions, turns = frames_of(robot, q[None])
    assert [type(visual.shape) for visual in robot.visuals] == [Surface, Capsule]  # no floor, and nothing of group 3
    for visual, geom in zip(robot.visuals, (1, 3), strict=True):
        found = pose_of(positions[visual.joint + 1, 0], turns[visual.joint + 1, 0]) @ visual.placement
        assert found[:3, 3] == pytest.approx(data.geom_xpos[geom], abs=1e-9)
        assert found[:3, :3] == pytest.approx(data.geom_xmat[geom].reshape(3, 3), abs=1e-9)
    colors = {look.joint: look.colors for look in looks_of(robot)[0]}
    assert (colors[0] == [0, 255, 0]).all()


def test_a_mesh_that_cannot_be_read_is_drawn_as_a_capsule_and_said(tmp_path: Path) -> None:
    (tmp_path / "odd.step").write_text("ISO-10303-21;")
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.format('<mesh filename="odd.step"/>'))
    robot = hk.load(file)
    looks, said = looks_of(robot)
    assert len(said) == 1
    assert said[0].startswith("a is drawn as a capsule: ")
    assert "odd.step" in said[0]
    by_joint = {look.joint: look for look in looks}
    assert set(by_joint) == {0, 1}
    assert by_joint[0].points[:, 2].max() > 0.39  # along the link, up to the next joint
    assert (by_joint[1].colors == [255, 0, 0]).all()
    assert np.ptp(by_joint[1].points, axis=0) == pytest.approx([0.1, 0.2, 0.3])


@pytest.mark.parametrize("name", ["panda", "irb140", "yumi", "rail-ur10e"])
def test_a_robot_without_meshes_has_the_body_in_the_studio_that_it_has_in_pictures(name: str) -> None:
    robot = hk.load(name)
    pieces = pieces_of(robot, np.stack([robot.lower, robot.upper]))
    looks = {look.joint: look.points for look in looks_of(robot)[0]}
    assert set(looks) == {piece.joint for piece in pieces}
    for joint, points in looks.items():
        boxes = np.array([piece.solid.box() for piece in pieces if piece.joint == joint])
        wanted = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
        drawn = np.array([points.min(axis=0), points.max(axis=0)])
        assert drawn == pytest.approx(wanted, abs=0.03 * float(np.ptp(wanted, axis=0).max())), joint


def test_a_tool_is_drawn_as_it_is_and_the_arm_keeps_its_links() -> None:
    """A torch of 0.2 m before the tip of an arm without meshes: the link before it ends in the torch."""
    bare = hk.with_tool(hk.load("irb140"), [0, 0, 0.3])
    torch = hk.robot.with_shape(bare, "torch", Cylinder(0.01, 0.2), xyz=[0, 0, -0.1])
    before, after = ({look.joint: look.points for look in looks_of(robot)[0]} for robot in (bare, torch))
    last, tip = bare.tips[0].joint, bare.tips[0].placement
    for joint in set(before) - {last}:
        assert after[joint] == pytest.approx(before[joint])
    local = (after[last] - tip[:3, 3]) @ tip[:3, :3]
    near = local[local[:, 2] > -0.05]  # towards the tip is nothing but the torch
    assert near[:, 2].max() == pytest.approx(0.0, abs=1e-6)
    assert np.hypot(*near[:, :2].T).max() == pytest.approx(0.01)
    assert local[:, 2].min() < -0.29  # the link begins where it began


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_recording_is_seen_from_where_a_wall_does_not_hide_the_robot(side: float) -> None:
    robot, q = hk.load("rail-ur10e"), np.array([0.4, *np.deg2rad([-90, -70, 100, -120, -90, 0])])
    ahead = Motion(np.array([0.0, 1.0]), np.array([q, q + [1.0, 0, 0, 0, 0, 0, 0]]))
    wall = hk.obstacle("wall", Box([8.0, 0.02, 3.0]), xyz=[1.0, 1.5 * side, 1.5])
    seen_from: list[np.ndarray] = []
    look = Scene.look_from
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Scene, "look_from", lambda self, place, at: (seen_from.append(place), look(self, place, at)))
        scene = record(robot, {"a": ahead}, obstacles=[wall], seconds=0.2).scene
    assert seen_from[-1][1] * side < 0
    assert len(scene) > len(record(robot, {"a": ahead}, seconds=0.2).scene)


def test_a_base_that_drives_far_has_no_rails_in_the_studio() -> None:
    """Beams of 20 m would make the arm small in the page."""
    robot = hk.load("mobile-ur5e")
    sizes = [float(np.ptp(look.points, axis=0).max()) for look in looks_of(robot)[0]]
    assert max(sizes) < chain_length(robot)


def test_a_broken_visual_does_no_harm_to_the_robot(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.format('<box size="nonsense"/>'))
    robot = hk.load(file)
    assert robot.n == 2
    assert looks_of(robot)[0]


def test_visuals_go_where_the_robot_is_mounted(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.format('<sphere radius="0.1"/>'))
    arm = hk.load(file)
    cell = hk.compose(hk.load("rail"), hk.robot.Part(arm, pose=[0, 0, 0.5], prefix="left_"))
    assert [visual.link for visual in cell.visuals] == ["left_a", "left_b"]
    q = np.array([0.3, 0.2, -0.4])
    alone, mounted = frames_of(arm, q[None, 1:])[0], frames_of(cell, q[None])[0]
    for one, other in zip(arm.visuals, cell.visuals, strict=True):
        shift = mounted[other.joint + 1, 0] - alone[one.joint + 1, 0]
        assert shift == pytest.approx(hk.load("rail").pose(q[:1])[:3, 3] + [0, 0, 0.5])


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda v: np.linalg.norm(v) > 1e-3))
def test_a_quaternion_is_the_rotation_that_it_was_made_of(values: list[float]) -> None:
    from scipy.spatial.transform import Rotation

    R = Rotation.from_quat(values).as_matrix()
    T = np.eye(4)
    T[:3, :3] = R
    assert rotations_of(quaternions(R[None]))[0] == pytest.approx(R, abs=1e-12)
    assert pose_of([1, 2, 3], wxyz_of(T))[:3, :3] == pytest.approx(R, abs=1e-12)


def test_a_ghosts_link_is_seen_where_it_leaves_the_robots_link_and_of_two_in_one_place_the_first() -> None:
    turns = np.array([[1.0, 0, 0, 0], [1, 0, 0, 0], [np.cos(0.05), 0, 0, np.sin(0.05)], [1, 0, 0, 0]])
    positions = np.array([[0.0, 0, 0], [0.001, 0, 0], [0, 0, 0], [0.2, 0, 0]])
    assert seen(positions, turns, 0, 0.3) == pytest.approx([0, 0, OPACITY, OPACITY], rel=1e-3)
    turns, positions = np.tile([1.0, 0.0, 0.0, 0.0], (4, 1)), np.zeros((4, 3))
    positions[1:] = [[0.2, 0, 0], [0.2, 0.0005, 0], [0.2, 0.05, 0]]
    assert seen(positions, turns, 0, 0.3) == pytest.approx([0.0, OPACITY, 0.0, OPACITY])
    assert seen(positions[[1, 2, 0, 3]], turns, 2, 0.3) == pytest.approx([OPACITY, 0.0, 0.0, OPACITY])
    assert seen(positions[:2], turns[:2], 0, 0.3) == pytest.approx([0.0, OPACITY])


def test_colours_are_sent_as_light() -> None:
    """Of sRGB, IEC 61966-2-1: 188 is half the light of 255."""
    assert linear([[0, 188, 255]]).tolist() == [[0, 128, 255]]


def test_the_elbow_is_what_moves_while_the_tool_stands() -> None:
    robot, q = hk.load("panda"), np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    joint = elbow_joint(robot, q)
    assert robot.joints[joint].name in ("panda_joint3", "panda_joint4", "panda_joint5")


def test_a_port_in_use_gives_way_to_the_next_one_and_both_hosts_and_ports_are_said() -> None:
    said: list[str] = []
    with socket.socket() as blocked:
        blocked.bind(("127.0.0.1", 0))
        blocked.listen()
        port = blocked.getsockname()[1]
        with served(port=port, progress=said.append) as studio:
            assert (studio.server.get_port() != port) and studio.server.get_host() == "127.0.0.1"
            assert said[0] == f"port {port} is in use: the page is at port {studio.server.get_port()}"
            assert said[1] == f"the studio is at http://localhost:{studio.server.get_port()}/{studio.door.token}/"


@pytest.mark.campaign
def test_a_page_shows_another_job_when_it_is_asked_to_and_stays_when_there_is_none() -> None:
    with served() as studio:
        with pytest.raises(UnknownNameError):
            studio.open("no-such-job")
        assert studio.session.robot.name == "ppr"
        studio.open("orientation")
        assert studio.session.source == "orientation"
        assert len(studio.page.scene.names) == len(studio.session.strategies)


def test_without_the_extra_the_error_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "viser", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'holokin\[studio\]'"):
        hk.studio("ppr-cycle", browser=False, wait=False)


@pytest.mark.parametrize(
    ("arguments", "said"), [({"port": 70_000}, "port"), ({"host": "no such host"}, "host"), ({"what": 3}, "what the")]
)
def test_what_cannot_be_served_is_refused_with_a_cure(arguments: dict[str, Any], said: str) -> None:
    what = arguments.pop("what", "ppr-cycle")
    with pytest.raises(ArgumentError, match=said):
        hk.studio(what, browser=False, wait=False, **arguments)


def test_the_old_word_for_progress_is_answered_with_the_call_that_takes_it() -> None:
    with pytest.raises(CallError, match=r"progress="):
        hk.studio("ppr-cycle", browser=False, wait=False, tell=print)  # type: ignore[call-arg]


def test_a_bad_job_gets_the_same_sentence_as_from_run(tmp_path: Path) -> None:
    from holokin.app.cli.main import app

    file = tmp_path / "bad.toml"
    file.write_text('title = "bad"\n[robot]\nname = "panda"\n[task]\nkind = "pos"\n')
    ends = [CliRunner().invoke(app, [command, str(file)]) for command in ("run", "studio")]
    assert str(ends[0].exception) == str(ends[1].exception)
    assert isinstance(ends[1].exception, hk.HolokinError)


def test_the_handles_of_a_circle_stand_on_it_however_the_job_says_it() -> None:
    from holokin.app.studio import circle_loop, open_session
    from holokin.app.studio.stage import circle_of, frame_of

    session = open_session("panda-circle")  # whose centre is given from the tool
    found = circle_of(session.loop)
    assert found is not None
    tool = session.robot.pose(session.home)[:3, 3]
    assert found[0] == pytest.approx(tool - [0.1, 0, 0], abs=1e-9)
    assert found[1] == pytest.approx([0, 0, 1], abs=1e-9)
    assert found[2] == pytest.approx(0.1)
    tilted = circle_loop([0.4, 0.1, 0.5], 0.07, [1, 2, 3], clockwise=True)
    center, normal, radius = circle_of(tilted) or pytest.fail("it is a circle")
    assert center == pytest.approx([0.4, 0.1, 0.5])
    assert normal == pytest.approx(np.array([1, 2, 3]) / np.sqrt(14))
    frame = frame_of(normal, tilted.path.start[:3] - center)
    assert frame[:3, :3] @ frame[:3, :3].T == pytest.approx(np.eye(3), abs=1e-12)
    assert center - radius * frame[:3, 0] == pytest.approx(tilted.path.start[:3])


@pytest.mark.campaign
def test_two_paths_to_one_pose_end_with_one_posture_for_a_holonomic_strategy_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from holokin.app.studio import side_panels

    monkeypatch.setattr(side_panels, "SHOWN", 0.01)
    with served("panda-circle") as studio:
        session, panel = studio.session, studio.page.panels.loop
        pose = np.array(session.snapshot().target[0])
        pose[:3, 3] += [-0.1, 0.15, 0.05]
        for strategy, answer in (("moore-penrose", "other joints"), ("lock-3", "the same joints")):
            session.drag(pose)
            panel.strategy.value = strategy
            panel._two_paths()
            assert answer in panel.answer.content, strategy
            assert session.snapshot().target[0] == pytest.approx(pose)
        session.reset()
        panel._two_paths()
        assert "drag it somewhere" in studio.page.message


@pytest.mark.campaign
def test_a_page_lets_go_of_what_is_taken_away_and_plots_a_long_run_in_few_points() -> None:
    """A cloud that grows still, the handle in the hand of a browser that went away, the drift of 5,000 cycles."""
    from holokin.app.studio.stage import KEPT

    plotted: list[Any] = []
    with served("panda-circle") as studio:
        page, session, panel = studio.page, studio.session, studio.page.panels.posture
        session.start_cloud("lock-3", samples=4000)
        until(lambda: "poses looked at" in panel.cloud_text.content)
        page.handles._held.add("tool0")
        for gone in page.server._client_disconnect_cb:
            gone(SimpleNamespace(client_id=0))

        def plot() -> None:
            snap = session.snapshot()
            drift = np.tile(np.arange(5000.0)[:, None], (1, 7))
            states = tuple(replace(state, drift=drift[:, 0], drift_joints=drift) for state in snap.strategies)
            page.charts.draw(replace(snap, number=-2, strategies=states))
            plotted.append(np.array(page.charts.drift.data))

        page.ask(panel.take_away)
        page.ask(plot)
        until(lambda: plotted)
        time.sleep(0.5)  # two updates of the texts
        assert session.snapshot().cloud.status.value == "cancelled" and panel.cloud_text.content == ""  # type: ignore[union-attr]
        assert not page.handles._held
    assert plotted[0].shape[1] <= KEPT and plotted[0][:, 0].tolist() == [0.0] * len(plotted[0])
    assert plotted[0][0, -1] == 5000 and plotted[0][1, -1] == 4999
