"""Advice for a job, or for what is typed beside a robot: its tool, task, path, obstacles, limits; laws that are one."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused, fails
from holokin.analysis.coverage.pose_coordinates import chart_of
from holokin.analysis.coverage.starts import candidates, kinds_that_fit, postures_at, task_of_kind
from holokin.analysis.design.trials import PROVABLE, Poses, Trial, distinct, tried
from holokin.app.job import open_job, run_job
from holokin.app.job.advice_job import question, write_over
from holokin.base.errors import ArgumentError, JobError
from holokin.motion.checks import Clearances
from holokin.robot import Capsule

TORCH = """
title = "A bead"
[robot]
name = "ur5e"
tool = { xyz = [0.08, 0, 0.25], rpy_deg = [0, 35, 0] }
upper = { wrist_3_joint = 3.0 }
[task]
kind = "pose"
orientation = "axis"
[start]
q = [10, -100, 110, -95, -80, 20]
degrees = true
[path]
kind = "polyline"
points = [[0, 0, 0], [0.1, 0, 0], [0.1, 0.15, 0], [0, 0.15, 0]]
relative = true
closed = true
samples = 50
[checks]
obstacles = [{ name = "post", kind = "sphere", radius = 0.1, xyz = [-0.25, -0.1, 0.15] }]
[strategies.mine]
kind = "lock"
joints = ["wrist_3_joint"]
"""

PLANAR = """
title = "Round a square"
about = "The tool goes round; a post stands aside."
[robot]
name = "planar-3r"
[start]
q = [0.3, 0.8, 0.5]
[path]
kind = "polyline"
points = [[0, 0], [-0.2, 0], [-0.2, 0.2], [0, 0.2]]
relative = true
closed = true
samples = 40
[checks]
self_collision = false
radius = 0.05
obstacles = [{ name = "post", kind = "sphere", radius = 0.1, xyz = [2.0, 2.0, 0] }]
[strategies.mine]
kind = "lock"
joints = [2]
[expect.mine]
holonomic = true
"""
UR5E = np.deg2rad([10.0, -100.0, 110.0, -95.0, -80.0, 20.0])


@pytest.fixture
def torch(tmp_path: Path) -> str:
    file = tmp_path / "torch.toml"
    file.write_text(TORCH)
    return str(file)


def test_the_tool_that_the_checks_give_a_robot_is_in_the_picture_of_advice(tmp_path: Path) -> None:
    file = tmp_path / "gripper.toml"
    given = '{ name = "gripper", on = "tool", kind = "box", sides = [0.1, 0.1, 0.2], xyz = [0, 0, 0.1] }'
    file.write_text(TORCH.replace('{ name = "post"', f'{given}, {{ name = "post"'))
    asked = question(str(file))
    assert [part.link for part in asked.shown.shapes] == ["gripper"], "the arm is drawn as before"
    assert {"gripper", "elbow_joint"} < {part.link for part in asked.task.robot.shapes}


def test_a_job_is_heard_with_its_torch_its_task_its_path_its_limits_and_its_degrees(torch: str) -> None:
    """Referee: the robot put together by hand, and the corners of the path about its tool."""
    asked = question(torch)
    arm = hk.with_tool(hk.load("ur5e"), [0.08, 0, 0.25], rpy=[0, np.deg2rad(35), 0])
    assert asked.task.orientation == "axis" and asked.task.m == 5
    assert asked.q0 is not None and asked.workspace is not None
    assert np.abs(asked.q0 - UR5E).max() < 1e-15
    assert np.abs(asked.task.robot.pose(asked.q0) - arm.pose(UR5E)).max() < 1e-12
    assert asked.task.robot.upper[5] == 3.0 and asked.task.robot.lower[5] == arm.lower[5]
    T = asked.workspace.poses(256)
    tool = arm.pose(UR5E)
    assert np.abs(T[:, :3, :3] - tool[:3, :3]).max() < 1e-12
    away = T[:, :3, 3] - tool[:3, 3]
    assert np.allclose([away.min(axis=0), away.max(axis=0)], [[0, 0, 0], [0.1, 0.15, 0]], atol=2e-3)
    on_edge = np.abs(away[:, :2, None] - [[0, 0.1], [0, 0.15]]).min(axis=(1, 2))
    assert on_edge.max() < 1e-12
    assert not asked.chosen
    assert asked.scene is not None and [one.link for one in asked.scene.obstacles] == ["post"]
    apart = Clearances.of(asked.task.robot, asked.scene)
    assert not apart.clear(asked.q0[None])[0]  # the post stands where the torch is


def test_checks_without_two_shapes_that_could_meet_ask_nothing_of_shapes(tmp_path: Path) -> None:
    file = tmp_path / "square.toml"
    file.write_text(PLANAR.replace("obstacles = [", "# obstacles = ["))
    asked = question(str(file))
    assert asked.scene is None
    file.write_text(PLANAR.replace("obstacles = [", "floor = -0.5\nclearance = 0.03\n# obstacles = ["))
    asked = question(str(file))
    assert asked.scene is not None and asked.scene.clearance == 0.03 and asked.scene.floor == -0.5
    assert asked.keys["checks"]["clearance"] == 0.03


def test_a_six_axis_arm_is_offered_axis_and_position_and_refused_the_whole_pose() -> None:
    six, seven = hk.load("ur5e"), hk.load("panda")
    assert kinds_that_fit(six) == ("axis", "position")
    assert kinds_that_fit(seven) == ("pose", "axis", "position")
    assert task_of_kind(six, None, "axis").m == 5
    fails(ArgumentError, "take the task 'axis' if the tool may spin", lambda: task_of_kind(six, None, "pose"))


def test_the_free_axis_of_a_job_is_the_one_that_it_names(tmp_path: Path) -> None:
    """A turn about it is a self-motion: the tool's point stays, and so does the direction."""
    file = tmp_path / "torch.toml"
    file.write_text(TORCH.replace('orientation = "axis"', 'orientation = "axis"\naxis = [0, 1, 1]'))
    asked = question(str(file))
    J, robot = asked.task.jacobian(UR5E), asked.task.robot
    R = robot.pose(UR5E)[:3, :3]
    spin = np.concatenate([np.zeros(3), R @ np.array([0, 1, 1]) / np.sqrt(2)])
    dq = np.linalg.solve(robot.jacobian(UR5E), spin)
    assert np.abs(J @ dq).max() < 1e-12
    assert np.linalg.matrix_rank(J) == 5


def test_a_box_that_is_typed_is_the_one_in_python_and_the_one_of_a_job(tmp_path: Path) -> None:
    """In a job with or without `kind`; in a plane with two numbers for three."""
    meant = hk.workspace(box=([0.5, 0, 0.3], [0.25, 0.4, 0.3]), tilt=np.deg2rad(40))
    asked = question("panda", box="0.5 0 0.3, 0.25 0.4 0.3", tilt=40.0)
    assert asked.workspace is not None and np.array_equal(asked.workspace.poses(8), meant.poses(8))
    assert asked.chosen == ("task", "q0")
    flat = hk.workspace(box=([1.2, 0.4], [0.25, 0.2]), rotation=np.eye(3))
    asked = question("planar-3r", box="1.2 0.4 0.25 0.2")
    assert asked.workspace is not None and np.array_equal(asked.workspace.poses(8), flat.poses(8))
    file, keys = tmp_path / "space.toml", "box = [0.5, 0, 0.3, 0.25, 0.4, 0.3]"
    for table in (keys, f'kind = "box"\n{keys}', "center = [0.5, 0, 0.3]\nhalf = [0.25, 0.4, 0.3]"):
        file.write_text(f"{TORCH}\n[workspace]\n{table}\ntilt_deg = 40\n")
        space = question(str(file)).workspace
        assert space is not None and np.array_equal(space.poses(8), meant.poses(8))


@pytest.mark.parametrize(
    "table", ["box = [0.5, 0, 0.3, 0.2, 0.2]", "half = [1, 1]", "box = [0, 0, 1, 1]\nhalf = [1, 1]", "tilt_deg = 3"]
)
def test_a_workspace_of_a_job_without_one_whole_box_is_refused(tmp_path: Path, table: str) -> None:
    file = tmp_path / "space.toml"
    file.write_text(f"{TORCH}\n[workspace]\n{table}\n")
    fails(JobError, "or center and half", lambda: question(str(file)))


def test_a_job_whose_pose_leaves_no_joint_free_is_refused_with_the_two_tasks_that_do(tmp_path: Path) -> None:
    file = tmp_path / "rigid.toml"
    file.write_text(TORCH.replace('orientation = "axis"', 'orientation = "twist"'))
    fails(ArgumentError, r"orientation = \"axis\" into \[task\]", lambda: question(str(file)))


def _trials(robot: hk.Robot, names: set[str]) -> list[Trial]:
    task = hk.pose(robot, "axis")
    space = hk.workspace(box=([0.45, 0.1, 0.1], [0.1, 0.1, 0.05]), tilt=0.2)
    starts = postures_at(task, space.center)[:1]
    twists = np.tile(np.eye(5), (16, 1, 1))
    poses = Poses(space.poses(16), twists, np.ones(6))
    laws = [law for law in candidates(task, starts) if law.name in names]
    return [trial for law in laws for trial in tried(law, starts, poses)]


def test_laws_with_the_same_joint_rates_everywhere_are_one_and_others_are_not() -> None:
    """A straight torch on the axis of the last joint: only this joint moves where the tool stands still, so a law that
    fixes it at all is "lock wrist_3_joint". With a bent torch the same two laws differ.
    """
    names = {"lock wrist_3_joint", "stationary centring", "wrist_1_joint - wrist_3_joint"}
    straight = _trials(hk.with_tool(hk.load("ur5e"), [0, 0, 0.2]), names)
    found = distinct(straight)
    assert [trial.candidate.name for trial in straight] == [
        "lock wrist_3_joint", "wrist_1_joint - wrist_3_joint", "stationary centring"
    ]  # fmt: skip
    assert {trial.candidate.name: trial.same for trial in found} == {
        "lock wrist_3_joint": ("stationary centring",), "wrist_1_joint - wrist_3_joint": (),
    }  # fmt: skip
    bent = _trials(hk.with_tool(hk.load("ur5e"), [0.08, 0, 0.25], rpy=[0, 0.6, 0]), names)
    assert len(distinct(bent)) == len(bent) >= 2
    other = replace(bent[1], speed=bent[0].speed, served=bent[0].served)  # as fast by chance
    assert len(distinct([bent[0], other])) == 2


def test_the_direction_of_a_designed_strategy_counts_from_the_middle_of_the_workspace() -> None:
    """In a job the reference of the axis is the tool at the start, in Python straight down: the law must not change."""
    robot = hk.load("ur5e")
    at = robot.pose(UR5E)[:3, :3]
    here, down = hk.pose(robot, "axis", reference=at), hk.pose(robot, "axis")
    q = UR5E[None] + 0.05
    assert np.abs(here.value_batch(q) - down.value_batch(q)).max() > 0.1
    assert np.abs(chart_of(here, at).value_batch(q) - chart_of(down, at).value_batch(q)).max() < 1e-12


def test_clear_postures_are_those_whose_links_keep_the_distance() -> None:
    """Referee: the distance of a point from three segments of a planar arm, less both radii."""
    arm = hk.robot.with_capsules(hk.load("planar-3r"), 0.05)
    post = hk.obstacle("post", Capsule(0.1, 0.0), [1.2, 0.9, 0.0])
    clear = Clearances.of(arm, hk.Scene([post], clearance=0.02, self_collision=False)).clear
    Q = np.random.default_rng(2).uniform(-2.0, 2.0, (300, 3))
    wanted = []
    for q in Q:
        turns = np.cumsum(q)
        links = np.stack([np.cos(turns), np.sin(turns)], axis=1)
        at = np.vstack([np.zeros(2), np.cumsum(links, axis=0)])
        spans = arm.pose(np.zeros(3))[0, 3] / 3
        gaps = []
        for a, u in zip(spans * at[:3], spans * links, strict=True):
            s = np.clip((np.array([1.2, 0.9]) - a) @ u / (u @ u), 0, 1)
            gaps.append(np.linalg.norm(a + s * u - [1.2, 0.9]) - 0.15)
        wanted.append(min(gaps[:]) >= 0.02)
    assert 20 < np.sum(wanted) < 290
    assert clear(Q).tolist() == wanted


def _written(holokin: Command, out: Path) -> None:
    """The path, the obstacles and the user's own strategy stay; the law runs, and begins with the tool where it was."""
    before, after = tomllib.loads(PLANAR), tomllib.loads(out.read_text())
    for key in ("title", "about", "robot", "path", "checks"):
        assert after[key] == before[key], key
    assert after["strategies"]["mine"] == before["strategies"]["mine"]
    assert after["expect"] == {"advised": {"holonomic": True}, "mine": {"holonomic": True}}
    arm = hk.load("planar-3r")
    assert np.abs((arm.pose(after["start"]["q"]) - arm.pose(before["start"]["q"]))[:2, 3]).max() < 1e-9
    name, job, path = open_job(str(out))
    result = run_job(name, job.model_copy(update={"verdict": job.verdict.model_copy(update={"samples": 4})}), path)
    assert result.passed
    assert [s.name for s in result.strategies] == ["advised", "mine"]


def test_a_job_is_written_again_with_the_law_on_its_leaf(holokin: Command, tmp_path: Path) -> None:
    """Made-up advice: joint 1 locked, on a leaf through another posture at another tool pose."""
    task, q0 = hk.position(hk.load("planar-3r")), np.array([0.5, 0.6, 0.4])
    law = SimpleNamespace(q0=q0, keys={"kind": "lock", "joints": ["q1"]}, strategy=hk.holonomic(task, hk.lock(0)))
    file, out = tmp_path / "square.toml", tmp_path / "advised.toml"
    advice: Any = SimpleNamespace(best=law, task=task)
    said = write_over(out, advice, tomllib.loads(PLANAR), file)
    assert said == "the job begins on the leaf of the strategy, its tool where it was"
    assert tomllib.loads(out.read_text())["start"]["q"][0] == pytest.approx(0.5, abs=1e-12)
    _written(holokin, out)
    near = PLANAR.replace("xyz = [2.0, 2.0, 0]", "xyz = [0.4, 0.2, 0]")
    said = write_over(tmp_path / "near.toml", advice, tomllib.loads(near), file)
    assert "does not do all that is asked: " in said and "post" in said


@pytest.mark.campaign
def test_the_command_takes_a_job_and_writes_it_again_with_the_law(holokin: Command, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    file, out = tmp_path / "mine" / "square.toml", tmp_path / "advised.toml"
    file.write_text(PLANAR)
    outcome = holokin("advise", file, "--out", out)
    assert (outcome.code, outcome.err) == (0, "")
    assert "256 poses of the path of square.toml" in " ".join(outcome.out.split())
    assert "Not given" not in outcome.out
    _written(holokin, out)
    assert out.with_suffix(".png").stat().st_size > 20_000


def test_a_law_on_trial_serves_only_where_its_postures_are_clear() -> None:
    """Clear is what has the first joint below its median: of the poses served without this, those are left."""
    task, q0 = hk.position(hk.load("planar-3r")), np.array([0.3, 0.8, 0.5])
    T = hk.workspace(box=([1.2, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3)).poses(32)
    law = next(law for law in candidates(task, q0[None]) if law.keys["kind"] == "lock")
    plain = Poses(T, np.tile(np.eye(2), (32, 1, 1)), np.ones(3))
    (free,) = tried(law, q0[None], plain)
    middle = float(np.median(free.q[:, 0]))
    apart: Any = SimpleNamespace(wanted=0.1, least=lambda Q, near: 0.1 + middle - Q[:, 0])
    (kept,) = tried(law, q0[None], replace(plain, apart=apart))
    assert kept.served.tolist() == (free.served & (free.q[:, 0] <= middle)).tolist()
    assert kept.clear == pytest.approx(np.mean(free.served & (free.q[:, 0] <= middle - PROVABLE)))
    assert kept.clear < kept.coverage and free.clear == 1.0
    assert 0 < kept.coverage < free.coverage


def test_a_pose_at_which_a_link_is_too_near_is_not_served() -> None:
    """The least that can fail: a post on the way of the arm. The coverage names it, and its share falls."""
    arm = hk.robot.with_capsules(hk.load("planar-3r"), 0.05)
    space = hk.workspace(box=([1.2, 0.4, 0.0], [0.25, 0.25, 0.0]), rotation=np.eye(3))
    law = hk.holonomic(hk.position(arm), hk.lock(2))
    whole = hk.coverage(law, space, [0.3, 0.8, 0.5], samples=64)
    turn = float(np.median(whole.q[whole.reached][:, 0]))
    post = hk.obstacle("post", Capsule(0.1, 0.0), [0.6 * np.cos(turn), 0.6 * np.sin(turn), 0.0])
    clear = Clearances.of(arm, hk.Scene([post], self_collision=False)).clear
    less = whole.blocked(clear)
    lost = whole.reached & ~less.reached
    assert less.share < whole.share
    assert lost[whole.reached].tolist() == (~clear(whole.q[whole.reached])).tolist()
    assert less.causes()[1][0].startswith("a link would be too near") or less.causes()[0][0].startswith(
        "a link would be too near"
    )
    assert replace(less, status=whole.status).share == whole.share


def test_the_command_refuses_before_the_work(holokin: Command, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("# mine\n", "utf-8")
    assert_refused(holokin("advise", "planar-3r", "--out", file), "exists already")
    assert_refused(holokin("advise", "planar-3r", "--out", tmp_path / "x.txt"), ".toml")
    assert_refused(holokin("advise", "planar-3r", "--out", tmp_path / "none" / "x.toml"), "none", "No such file")
    out = ("--out", tmp_path / "x.toml")
    for box in ("cube 1", "1 2 3", "0 0 0 1 1 nan"):
        assert_refused(holokin("advise", "planar-3r", "--box", box, *out), "X Y Z HX HY HZ")
    assert_refused(holokin("advise", "planar-3r", "--box", "0 0 0 0 0 0", *out), "half sides")
    assert_refused(holokin("advise", "planar-3r", "--tilt", "3", *out), "--box")
    assert_refused(holokin("advise", "irb140", "--task", "pose", *out), "redundant")
    job = tmp_path / "square.toml"
    job.write_text(PLANAR)
    assert_refused(holokin("advise", job, "--task", "pose", *out), "--task beside a job")
