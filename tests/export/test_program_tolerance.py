"""Programs written to a tolerance of the tool: played by the rules of each language, they keep it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import controllers
import grammars
import grammars_more
import holokin as hk
import referees
from conftest import campaign, sampled
from grammars import facts
from holokin.base.errors import ArgumentError, ExportError
from holokin.export import (
    ProcessLines,
    Program,
    ToolTolerance,
    to_fanuc,
    to_inform,
    to_krl,
    to_rapid,
    to_ros,
    to_urscript,
    to_val3,
)
from holokin.export.programs.moves import ToolMotion
from holokin.export.programs.targets import measured, tool_moves
from holokin.motion import TimedTrajectory

TORCH = np.array([[0.0, 0.0, 1.0, 0.05], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.3], [0.0, 0.0, 0.0, 1.0]])
Q0 = np.deg2rad([10.0, 70.0, -20.0, 30.0, 60.0, 20.0])
PULSES = np.array([1000.0, -1200.0, 900.0, 800.0, 800.0, 500.0])
"""Of a robot's axes, per degree: a negative one counts the other way round."""

WRITERS = {
    "rapid": to_rapid, "krl": to_krl, "urscript": to_urscript, "ls": to_fanuc,
    "val3": to_val3, "inform": partial(to_inform, pulses=PULSES.tolist()),
}  # fmt: skip


def torch_pose(q: np.ndarray) -> np.ndarray:
    """Of an IRB 140 with a torch, by P. Corke's table."""
    return referees.irb140(q) @ TORCH


@pytest.fixture(scope="module")
def welder(irb140: hk.Robot) -> hk.Task:
    robot = hk.with_tool(irb140, TORCH[:3, 3], (0.0, np.pi / 2, 0.0))
    return hk.pose(robot, "axis", reference=robot.pose(Q0)[:3, :3])


def seam(task: hk.Task, path: hk.Path, speed: float, dt: float = 0.008) -> TimedTrajectory:
    walk = hk.follow(hk.holonomic(task, hk.lock(3)), path.at_speed(speed), Q0, samples=300)
    return hk.retime(walk, acceleration=5.0, speed=1.0, dt=dt)


@pytest.fixture(scope="module")
def corner(welder: hk.Task) -> TimedTrajectory:
    """Two lines of a weld at 8 mm/s."""
    at = welder.robot.pose(Q0)[:3, 3]
    return seam(welder, hk.polyline(at + np.array([[0, 0, 0], [0, 0.04, 0], [0.015, 0.06, 0.01]])), 0.008)


@pytest.fixture(scope="module")
def bow(welder: hk.Task) -> TimedTrajectory:
    """A third of a turn, radius 60 mm, at 50 mm/s."""
    at = welder.robot.pose(Q0)[:3, 3]
    return seam(welder, hk.path.arc(at, at - [0.06, 0, 0], 2.0), 0.05)


def read(program: Program, language: str) -> grammars.Parsed:
    speeds = np.rad2deg(hk.load("irb140").max_velocity)
    parse = {
        "rapid": grammars.rapid, "krl": grammars.krl, "urscript": grammars.urscript, "ls": grammars.listing,
        "val3": partial(grammars_more.val3, speeds=speeds),
        "inform": partial(grammars_more.inform, pulses=PULSES, speeds=speeds),
    }  # fmt: skip
    return parse[language](*program.files.values())


def written(language: str, timed: TimedTrajectory, tolerance: ToolTolerance) -> tuple[Program, grammars.Parsed]:
    program = WRITERS[language](timed, tolerance=tolerance)
    return program, read(program, language)


@sampled(1, "linear", [False, True])
@sampled(1, "language", WRITERS)
def test_a_seam_of_8_mm_per_s_is_welded_within_0_2_mm_and_2_percent(
    language: str, linear: bool, welder: hk.Task, corner: TimedTrajectory, bow: TimedTrajectory
) -> None:
    """Played by the language's own rules: tool, speed and joints are within what was asked for."""
    for timed, speed in ((corner, 0.008), (bow, 0.05)):
        tolerance = ToolTolerance(welder, 2e-4, np.deg2rad(1.0), 0.02, 0.02, linear)
        program, found = written(language, timed, tolerance)
        made = controllers.play(found, torch_pose, 20, degrees=language != "urscript")
        wanted = cKDTree(np.array([torch_pose(q)[:3, 3] for q in timed.q[::2]]))
        points = np.concatenate([move.p for move in made])
        spacing = speed * timed.dt  # the samples that the points are held against are so far apart, halved
        assert wanted.query(points)[0].max() <= np.hypot(2e-4, spacing) + 1e-7
        joints = cKDTree(timed.q)
        assert joints.query(np.concatenate([move.q for move in made]), p=np.inf)[0].max() <= 0.02 + 1e-4
        rests = [a or b for a, b in pairwise(found.stops)]  # joint moves that begin or end at rest hold ramps
        even = [move for move, rest in zip(made, rests, strict=True) if not rest or move.kind != "joint"]
        speeds = np.concatenate([move.speed for move in even if len(move.speed)])
        rounding = 5e-4 / min(move.seconds for move in even) if language == "ls" else 0.0  # of a millisecond
        if language == "inform":  # of a hundredth of a per cent of the axes' speeds: the program says how much
            rounding = float(re.search(r"up to (.*?) %", program.notes[0])[1]) / 100  # type: ignore[index]
        assert np.abs(speeds / speed - 1.0).max() <= 0.02 + rounding + 1e-3
        assert program.tool is not None
        assert program.tool.position <= 2e-4 and program.tool.joints <= 0.02
        bent = "linear" if language == "inform" else "circular"
        wanted_kind = "joint" if not linear else "linear" if timed is corner else bent
        assert wanted_kind in found.kinds and (linear or set(found.kinds) == {"joint"}), found.kinds
        assert found.kinds.count("joint") <= 3 or not linear, found.kinds


def test_an_operator_tunes_whole_millimetres_and_no_arc_burns_on_a_joint_move(
    welder: hk.Task, corner: TimedTrajectory
) -> None:
    """The motion takes whole steps of 8 ms, so its tool makes 7.99 mm/s; FANUC and ABB have the 8 mm/s of the path."""
    tolerance = ToolTolerance(welder, 2e-4, 0.02, 0.02, 0.02, True)
    burning = ProcessLines(on=["Arc Start[1]"], off=["Arc End[1]"])
    listing = to_fanuc(corner, tolerance=tolerance, lines=burning)
    tuned = grammars.listing(listing.text, own=r"Arc (Start|End)\[1\]")
    assert set(tuned.speeds) == {0.008} and " 8mm/sec " in listing.text
    assert tuned.lines == [(1, "Arc Start[1]"), (len(tuned.axes), "Arc End[1]")]
    welded = read(to_rapid(corner, tolerance=tolerance, arc=["seam1", "weld1"]), "rapid")
    arcs = [line for _, line in welded.lines]
    assert arcs[0] == "ArcLStart seam1 weld1" and arcs[-1] == "ArcLEnd seam1 weld1"
    assert set(arcs[1:-1]) == {"ArcL seam1 weld1"} and set(welded.kinds) == {"linear"}
    with pytest.raises(ExportError, match="no arc burns on one"):
        to_rapid(corner, tolerance=2e-3, arc=["seam1", "weld1"])
    for bad in (["weld1"], ["seam 1", "weld1"], ["seam1", "MoveL"]):
        with pytest.raises(ArgumentError, match=r"arc|a letter|already"):
            to_rapid(corner, tolerance=tolerance, arc=bad)
    with pytest.raises(ArgumentError, match="a zone by its name"):
        to_rapid(corner, tolerance=tolerance, arc=["seam1", "weld1"], zone=0.001)
    with pytest.raises(ArgumentError, match="has this name for something else"):
        to_rapid(corner, name="arcl", arc=["seam1", "weld1"])


CASE = ("linear", "every")


@pytest.mark.parametrize(CASE, [(False, 5), campaign(CASE, (True, 3)), campaign(CASE, (False, 2))])
def test_there_are_nearly_as_few_targets_as_can_be(
    linear: bool, every: int, welder: hk.Task, bow: TimedTrajectory
) -> None:
    """Dynamic programming finds the least number of moves between some samples; ours are at most 1.3 times it."""
    tolerance = ToolTolerance(welder, 1e-4, 0.02, 0.02, 0.02, linear)
    moves, _ = tool_moves(bow, tolerance, np.arange(6))
    motion = ToolMotion.of(bow, tolerance, np.arange(6))
    grid = [*range(0, len(bow) - 1, every), len(bow) - 1]
    longest = 2 * max(move.b - move.a for move in moves)
    kinds = ("linear", "circular", "joint") if linear else ("joint",)
    least = {0: 0}
    for b in grid[1:]:
        before = [a for a in grid if a < b <= a + longest]
        least[b] = min(
            least[a] + 1
            for a in before
            if b - a <= every or any(measured(motion, kind, a, b, 17).within(tolerance) for kind in kinds)
        )
    assert len(moves) <= 1.3 * least[len(bow) - 1]


def test_the_header_says_how_far_the_tool_and_its_speed_are_off(welder: hk.Task, corner: TimedTrajectory) -> None:
    program = to_rapid(corner, tolerance=ToolTolerance(welder, 2e-4, 0.02, 0.02, 0.02, True))
    said = facts(program)
    assert "linear moves" in said and "mm/s" in said and "no other joint moves" in said
    assert "deviations are measured every 2 ms; in this time the tool moves at most 0.016 mm along the path" in said
    assert "the lines that switch the process on and off are at multiples of 8 ms" in said


def test_acc_and_jerk_are_told_of_joint_moves_alone(welder: hk.Task, corner: TimedTrajectory) -> None:
    """A controller makes a linear move with ramps of its own: the limits of the timed motion are not those."""
    for linear in (False, True):
        said = facts(to_krl(corner, tolerance=ToolTolerance(welder, linear=linear)))
        assert ("acc 286.479 deg/s^2" in said) is not linear
        assert ("the controller chooses acc and jerk of the joints: none are stated" in said) is linear
        assert "speed 200 deg/s" in said


def test_a_tool_that_turns_in_place_makes_joint_moves_and_the_header_says_where(welder: hk.Task) -> None:
    poses = np.tile(welder.robot.pose(Q0), (3, 1, 1))
    poses[1:, :3, :3] = Rotation.from_euler("x", 0.3).as_matrix() @ poses[0, :3, :3]
    poses[2, :3, 3] += [0.0, 0.05, 0.0]
    timed = seam(welder, hk.polyline(poses), 0.02)
    program = to_rapid(timed, tolerance=ToolTolerance(welder, 2e-4, 0.02, 0.02, 0.02, True))
    found = read(program, "rapid")
    turning = found.kinds.index("linear")
    assert turning > 0 and set(found.kinds[:turning]) == {"joint"} and set(found.kinds[turning:]) == {"linear"}
    assert f"joint moves to targets {', '.join(str(i + 2) for i in range(min(turning, 6)))}" in facts(program)


def test_no_linear_move_leads_along_a_singular_posture(irb140: hk.Robot) -> None:
    """With the wrist held straight a pose has many postures: a controller's own inverse gives none of them for sure."""
    q0 = np.deg2rad([10.0, 70.0, -20.0, 30.0, 0.0, 20.0])
    at = irb140.pose(q0)[:3, 3]
    task = hk.position(irb140)
    walk = hk.follow(hk.holonomic(task, hk.lock(3, 4, 5)), hk.polyline(at + np.array([[0, 0, 0], [0, 0.05, 0]])), q0)
    timed = hk.retime(walk, acceleration=5.0, dt=0.02)
    program = to_rapid(timed, tolerance=ToolTolerance(task, 1e-3, 0.05, 0.05, 0.05, True))
    found = read(program, "rapid")
    assert set(found.kinds) == {"joint"}
    assert "or the arm is nearly singular" in facts(program)


def test_linear_moves_of_a_seven_axis_arm_are_refused(panda: hk.Robot) -> None:
    """A pose does not say where seven joints are; an arm with six axes on a rail is served."""
    q0 = np.array([0.0, -0.4, 0.1, -2.0, 0.0, 1.7, 0.5])
    task = hk.pose(panda)
    at = panda.pose(q0)[:3, 3]
    line = hk.polyline(at + np.array([[0, 0, 0], [0.05, 0, 0]]))
    walk = hk.follow(hk.holonomic(task, hk.lock(2)), line, q0, samples=50)
    timed = hk.retime(walk, acceleration=5.0, dt=0.01)
    wiring = hk.export.Wiring(external=("panda_joint3",))
    assert to_rapid(timed, wiring=wiring, tolerance=ToolTolerance(task)).tool is not None
    with pytest.raises(ExportError, match="leave out linear"):
        to_rapid(timed, wiring=wiring, tolerance=ToolTolerance(task, linear=True))


def test_a_tolerance_of_nothing_or_of_another_robot_is_refused(welder: hk.Task, corner: TimedTrajectory) -> None:
    for bad in ({"position": 0.0}, {"speed": 1.0}, {"rotation": -1.0}, {"joints": float("nan")}):
        with pytest.raises(ArgumentError):
            ToolTolerance(welder, **bad)
    with pytest.raises(ArgumentError, match="the robot that moves"):
        to_krl(corner, tolerance=ToolTolerance(hk.pose(hk.load("panda"))))
    with pytest.raises(ArgumentError):
        ToolTolerance(welder.robot)


def test_a_tool_that_only_turns_has_no_speed_and_few_targets(welder: hk.Task) -> None:
    """Round-off of the tool's place is no way, and no speed."""
    poses = np.tile(welder.robot.pose(Q0), (2, 1, 1))
    poses[1, :3, :3] = Rotation.from_euler("x", 0.3).as_matrix() @ poses[0, :3, :3]
    timed = seam(welder, hk.polyline(poses), 0.02)
    program = to_rapid(timed, tolerance=ToolTolerance(welder, 2e-4, 0.02, 0.02, 0.02))
    assert program.targets < 12 and np.isnan(program.tool.slowest)
    assert "its speed was not compared" in facts(program)


def test_a_tolerance_that_the_samples_cannot_keep_is_said_to_be_missed(welder: hk.Task) -> None:
    at = welder.robot.pose(Q0)[:3, 3]
    timed = seam(welder, hk.path.arc(at, at - [0.06, 0, 0], 2.0), 0.2, dt=0.1)
    program = to_rapid(timed, tolerance=ToolTolerance(welder, 1e-6, 0.02, 1e-6, 0.02))
    assert not program.tool.kept and "NOT within what was asked for" in facts(program)


def test_the_tool_is_as_near_between_the_steps_as_the_header_says(welder: hk.Task) -> None:
    """Of a motion at 1 kHz a program gets every 64th sample: the others are the referee."""
    at, every = welder.robot.pose(Q0)[:3, 3], 64
    whole = seam(welder, hk.path.arc(at, at - [0.06, 0, 0], 2.0), 0.2, dt=0.001)
    rows = np.minimum(np.arange(0, len(whole) + every - 1, every), len(whole) - 1)  # it rests at its end
    parts = {what: getattr(whole, what)[rows] for what in ("q", "dq", "ddq", "dddq", "path_speed")}
    t = every * whole.dt * np.arange(len(rows))
    few = replace(whole, dt=every * whole.dt, t=t, marks=(0, len(rows) - 1), stops=(), **parts)
    program = to_rapid(few, tolerance=ToolTolerance(welder, 2e-4, 0.02, 0.02, 0.02))
    axes = np.deg2rad(read(program, "rapid").axes)
    share = np.linspace(0, 1, 100)[:, None]
    line = np.array([torch_pose(q)[:3, 3] for a, b in pairwise(axes) for q in a + share * (b - a)])
    apart = cKDTree(line).query(np.array([torch_pose(q)[:3, 3] for q in whole.q[::4]]))[0]
    grain = np.linalg.norm(np.diff(line, axis=0), axis=1).max() / 2
    assert program.tool.position == pytest.approx(apart.max(), rel=0.05, abs=grain)
    assert apart.max() > 2e-4 and not program.tool.kept


def test_the_joints_are_as_near_between_the_steps_as_said(bow: TimedTrajectory) -> None:
    """Even motion is compared with a spline through all samples; of one step with the height of a parabola's arc."""
    program = to_ros(bow, tolerance=1e-3, format="json")
    points = json.loads(program.text)["points"]
    t = [p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points]
    fine = np.linspace(0, bow.t[-1], 20 * len(bow))
    even = np.stack([np.interp(fine, t, column) for column in zip(*[p["positions"] for p in points], strict=True)])
    apart = np.abs(CubicSpline(bow.t, bow.q)(fine) - even.T).max()
    assert program.deviation == pytest.approx(apart, rel=0.02) and program.deviation <= 1e-3
    largest = np.abs(bow.ddq).max()
    assert to_ros(bow).deviation == pytest.approx(largest * bow.dt**2 / 8, rel=0.05)  # the least that can be


def test_a_slow_line_takes_as_many_seconds_as_fanuc_allows(welder: hk.Task) -> None:
    """48 s do not fit into the 32,000 ms of an instruction: they are written in seconds."""
    at = welder.robot.pose(Q0)[:3, 3]
    timed = seam(welder, hk.polyline(at + np.array([[0, 0, 0], [0, 0.1, 0]])), 0.0021, dt=0.04)
    found = read(to_fanuc(timed, tolerance=ToolTolerance(welder, 1e-3, 0.1, 0.05, 0.05, True)), "ls")
    assert max(found.seconds) > 32.0 and sum(found.seconds) == pytest.approx(0.1 / 0.0021, abs=0.2)
