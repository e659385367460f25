"""Programs of arms of seven axes: played by the rules of each language, they make the timed motion."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial import cKDTree

import controllers
import grammars_more
import grammars_seven
import holokin as hk
from conftest import sampled
from holokin.base.errors import ArgumentError, ExportError, HolokinError
from holokin.export import (
    ProcessLines,
    ToolTolerance,
    Wiring,
    to_franka,
    to_inform,
    to_kinova,
    to_sunrise,
    to_urscript,
    to_xarm,
)
from holokin.motion import TimedTrajectory
from holokin.robot import DHRow

SIA20 = zip(
    "SLEURBT", (0.41, 0, 0.49, 0, 0.42, 0, 0.18), (-90, 90, 90, -90, -90, 90, 0), (180, 110, 170, 130, 180, 110, 180),
    (130, 130, 170, 170, 200, 200, 400), strict=True,
)  # fmt: skip
"""Name, d [m], alpha, limit and speed [degrees] of each joint from the base, of the data sheet."""

PULSES = np.array([3000.0, 3000.0, 2500.0, 2000.0, 2000.0, 1500.0, 3000.0])
ORDER = [0, 1, 3, 4, 5, 6, 2]
"""Yaskawa's S, L, U, R, B, T, E of joints S, L, E, U, R, B, T."""

HUNDREDTH = np.deg2rad(0.01)


@pytest.fixture(scope="module")
def sia() -> hk.Robot:
    rows = [
        DHRow(0.0, np.deg2rad(alpha), d, 0.0, joint=name, lower=-np.deg2rad(most), upper=np.deg2rad(most),
              max_velocity=np.deg2rad(speed))
        for name, d, alpha, most, speed in SIA20
    ]  # fmt: skip
    return hk.from_dh(rows)


def motion(robot: hk.Robot, q0: np.ndarray, path: hk.Path, held: int, jerk: float | None = None) -> TimedTrajectory:
    walk = hk.follow(hk.holonomic(hk.pose(robot), hk.lock(held)), path, q0, samples=200)
    return hk.retime(walk, acceleration=4.0, jerk=jerk, speed=1.0, dt=0.008)


START = np.deg2rad([20.0, 40.0, -30.0, -80.0, 15.0, 60.0, 10.0])


@pytest.fixture(scope="module")
def corner(sia: hk.Robot) -> TimedTrajectory:
    at = sia.pose(START)[:3, 3]
    path = hk.polyline(at + np.array([[0, 0, 0], [0.06, 0, 0], [0.06, 0.05, 0.02]])).at_speed(0.05)
    return motion(sia, START, path, 2, jerk=100.0)


def test_the_seventh_axis_of_yaskawa_is_the_third_joint(corner: TimedTrajectory) -> None:
    """S, L, U, R, B, T, E as ros-industrial/motoman orders them, in one position, and no base axis."""
    program = to_inform(corner, PULSES.tolist(), group=2)
    read = grammars_more.inform(program.text, PULSES, np.rad2deg(corner.limits.velocity)[ORDER])
    np.testing.assert_allclose(read.axes[0], np.rad2deg(START)[ORDER], atol=1e-3)
    assert "///GROUP1 RB2\n" in program.text and "BC" not in program.text and "///NPOS" in program.text
    assert "axes S = S, L = L, U = U, R = R, B = B, T = T, E = E" in program.facts
    given = to_inform(corner, PULSES.tolist(), wiring=Wiring(axes=tuple("SLEURBT")))
    np.testing.assert_allclose(
        grammars_more.inform(given.text, PULSES, np.ones(7)).axes[0], np.rad2deg(START), atol=1e-3
    )
    with pytest.raises(ExportError, match=r"E lies between joints of the arm.*seven axes"):
        to_inform(corner, PULSES.tolist(), wiring=Wiring(external=("E",)))
    with pytest.raises(ArgumentError, match="at least 1"):
        to_inform(corner, PULSES.tolist(), group=0)


def test_a_rail_stays_a_base_axis_of_yaskawa() -> None:
    robot = hk.load("rail-ur10e")
    q0 = np.array([0.2, 0.1, -1.2, 1.5, -0.4, 1.2, 0.3])
    timed = motion(robot, q0, hk.polyline(robot.pose(q0)[:3, 3] + np.array([[0, 0, 0], [0, 0.05, 0]])), 0)
    with pytest.raises(ExportError, match="behind the arm, as a turntable"):
        to_inform(timed, PULSES.tolist(), wiring=Wiring(external=robot.joint_names[-1:]))
    text = to_inform(timed, PULSES.tolist(), wiring=Wiring(external=robot.joint_names[:1])).text
    assert "///GROUP1 RB1,BS1\n" in text and "BC00000=600000" in text


def test_sunrise_stops_where_the_motion_does_and_waits_in_java(corner: TimedTrajectory, sia: hk.Robot) -> None:
    lines = ProcessLines(on=["io.setOutput3(true);", "wait 0.25"], off=["io.setOutput3(false);"])
    program = to_sunrise(corner, name="Seam", lines=lines)
    read = grammars_seven.sunrise(program.text, np.rad2deg(sia.max_velocity))
    on = [(1, "io.setOutput3(true);"), (1, "ThreadUtil.milliSleep(250);")]
    assert read.lines == [*on, (len(read.axes), "io.setOutput3(false);")]
    assert sum(read.stops) == 3 and len(read.comments) == 5
    assert sum(read.seconds) == pytest.approx(corner.duration, rel=1e-5)
    with pytest.raises(ArgumentError, match="I/O group of your project"):
        to_sunrise(corner, lines=ProcessLines(on=["output 3 on"]))
    with pytest.raises(ExportError, match="a class of Java holds 1000"):
        to_sunrise(hk.retime(corner.untimed, acceleration=4.0, speed=1.0, dt=0.002), tolerance=1e-12)
    with pytest.raises(ExportError, match="% of the greatest speed"):
        to_sunrise(corner, speeds=[0.01] * 7)


@pytest.mark.campaign
@pytest.mark.skipif(shutil.which("javac") is None, reason="needs a JDK")
def test_java_compiles_the_class_and_runs_through_its_targets(sia: hk.Robot, tmp_path: Path) -> None:
    """With classes of KUKA's names that print what they are asked: the most targets that a class may have."""
    slow = hk.path.arc(at := sia.pose(START)[:3, 3], at - [0.06, 0, 0], 2.0).at_speed(0.03)
    timed = motion(sia, START, slow, 2, jerk=100.0)
    some = hk.retime(timed.untimed, acceleration=4.0, speed=1.0, dt=timed.duration / 998)  # nearly the most
    program = to_sunrise(some, name="Seam", tolerance=1e-12, lines=ProcessLines(off=["wait 0.5"]))
    assert program.targets > 980
    (tmp_path / "Seam.java").write_text(program.text, "utf-8")
    stubs = Path(__file__).with_name("sunrise_stubs")
    sources = [str(tmp_path / "Seam.java"), *map(str, stubs.rglob("*.java"))]
    subprocess.run(["javac", "-Xlint:all", "-Werror", "-d", str(tmp_path), *sources], check=True)
    done = subprocess.run(["java", "-cp", str(tmp_path), "Play", "Seam"], check=True, capture_output=True, text=True)
    lines = done.stdout.splitlines()
    rows = np.array([[float(x) for x in line.split()] for line in lines if line[0] in "-.0123456789"])
    read = grammars_seven.sunrise(program.text, np.rad2deg(sia.max_velocity))
    np.testing.assert_allclose(np.rad2deg(rows[:, :7]), read.axes, atol=1e-9)
    ends = [i for i, line in enumerate(lines) if line == "end"]
    assert len(ends) == sum(read.stops) and lines[-1] == "sleep 500"


def test_an_xarm_program_ends_at_the_first_call_that_is_refused(corner: TimedTrajectory) -> None:
    lines = ProcessLines(on=["output 3 on"], off=["output 3 off", "wait 0.5"])
    program = to_xarm(corner, lines=lines)
    read = grammars_seven.xarm(program)
    last = len(read.axes)
    assert read.lines == [(1, "output 3 1"), (last, "output 3 0"), (last, "pause 0.5")]
    assert sum(read.stops) == 3 and len(read.comments) == 5
    stopped = grammars_seven.xarm(program, refuses=6)
    assert len(stopped.axes) < last and "code 9" in stopped.lines[-1][1]


def test_a_franka_gets_a_row_a_millisecond_within_its_limits(corner: TimedTrajectory, tmp_path: Path) -> None:
    program = to_franka(corner, name="seam")
    rest = START + 0.3 * np.array([1, -1, 1, 0.5, 0, -1, 1])
    way, rows = grammars_seven.franka(program, tmp_path, rest)
    np.testing.assert_allclose(way[0], rest, atol=1e-12)
    np.testing.assert_allclose(rows[::8], corner.q, atol=1e-11)
    for played in (way, rows):
        still = np.vstack([played[:1]] * 3 + [played] + [played[-1:]] * 3)
        assert np.abs(np.diff(still, 2, axis=0)).max() / 1e-6 <= 10.0
        assert np.abs(np.diff(still, 3, axis=0)).max() / 1e-9 <= 5000.0
    assert np.abs(np.diff(way, axis=0)).max() / 1e-3 <= 0.2 + 1e-6
    *_, late = grammars_seven.franka(program, tmp_path, rest, lost=100)
    np.testing.assert_allclose(late[100:], rows[101:], atol=0)  # the row of the lost message is left out
    with pytest.raises(ArgumentError, match="whole milliseconds"):
        to_franka(replace(corner, dt=0.0005))


def test_a_kinova_gets_one_trajectory_from_its_first_millisecond_on(corner: TimedTrajectory, tmp_path: Path) -> None:
    program = to_kinova(corner, name="seam")
    start, t, rows = grammars_seven.kinova(program, tmp_path)
    np.testing.assert_allclose(start, np.rad2deg(START) % 360, atol=1e-6)
    np.testing.assert_allclose(t, 1e-3 * np.arange(len(rows)), atol=1e-12)
    angles, rates, accelerations = rows[:, :7], rows[:, 7:14], rows[:, 14:]
    np.testing.assert_allclose(angles[::8], np.rad2deg(corner.q), atol=1e-6)
    np.testing.assert_allclose(rates[::8], np.rad2deg(corner.dq), atol=0.1)
    assert np.abs(accelerations).max() <= np.rad2deg(4.0) * 1.02
    with pytest.raises(SystemExit, match="no trajectory for this arm"):
        grammars_seven.kinova(program, tmp_path, aborts=True)
    slow = hk.retime(corner.untimed, acceleration=4.0, speed=0.05, dt=0.01)
    with pytest.raises(ExportError, match="trajectories of 30 s"):
        to_kinova(slow)


def test_a_jerk_that_a_franka_refuses_is_refused_here(sia: hk.Robot) -> None:
    at = sia.pose(START)[:3, 3]
    walk = hk.follow(hk.holonomic(hk.pose(sia), hk.lock(2)), hk.circle(at, at - [0.03, 0, 0]), START, samples=100)
    with pytest.raises(ExportError, match=r"jerk of .* limit of jerk|acceleration of .* limit of acceleration"):
        to_franka(hk.retime(walk, acceleration=25.0, dt=0.001))


BAD_NAMES = [(to_sunrise, "lbr"), (to_sunrise, "class"), (to_xarm, "xarm"), (to_franka, "NumPy"), (to_kinova, "csv")]


@pytest.mark.parametrize(("write", "bad"), [*BAD_NAMES, (to_franka, "joints")])
def test_no_program_has_the_name_of_what_it_imports(write, bad: str, corner: TimedTrajectory) -> None:
    with pytest.raises(ArgumentError, match="has this word already"):
        write(corner, name=bad)


def test_six_axes_are_refused_by_sunrise_and_seven_by_urscript(corner: TimedTrajectory) -> None:
    robot = hk.load("ur5e")
    q0 = np.array([0.1, -1.2, 1.5, -0.4, 1.2, 0.3])
    line = hk.polyline(robot.pose(q0)[:3, 3] + np.array([[0, 0, 0], [0, 0.05, 0]]))
    walk = hk.follow(hk.holonomic(hk.position(robot), hk.lock(3, 4, 5)), line, q0)
    timed = hk.retime(walk, acceleration=4.0, dt=0.008)
    for write in (to_sunrise, to_franka):
        with pytest.raises(ExportError, match="holds 7 axes of a robot, but 6"):
            write(timed)
    with pytest.raises(ExportError, match="holds 6 axes of a robot, but 7"):
        to_urscript(corner)


NASTY = ('"""', "\\", "\\u000a", "*/", "\n", "\r", "{0}", "%s", "import os", "//", "'", "\u2028", "\u00fc")


@pytest.mark.parametrize("seed", range(3))
def test_words_of_a_user_are_words_of_comments(seed: int, corner: TimedTrajectory) -> None:
    """Whatever they hold, the rest of the program is the same, and Python reads it."""
    draw = np.random.default_rng(seed)
    for write in (to_sunrise, to_xarm, to_franka, to_kinova):
        kept = []
        for about in ("plain", "".join(draw.choice(NASTY, 12))):
            text = write(corner, about=about, name="seam").text
            if write is to_sunrise:
                kept.append([line for line in text.split("\n") if not line.startswith("// ")])
                assert "\\" not in text
            else:
                kept.append([ast.dump(part) for part in ast.parse(text).body[1:]])
        assert kept[0] == kept[1]


def test_words_of_another_alphabet_are_written_as_ascii_and_that_is_said(corner: TimedTrajectory) -> None:
    for write in (to_sunrise, to_xarm, to_franka):
        program = write(corner, about="Schweißnaht für Łódź")
        assert all(text.isascii() for text in program.files.values())
        assert any("'Schweissnaht fuer ?odz'" in note for note in program.notes), program.notes
    with pytest.raises(ArgumentError, match="a letter, then letters"):
        to_sunrise(corner, name="Naht_ä")


# --- Random motions of arms of seven axes in every language that holds them, with Pinocchio's kinematics.


ARMS = ("iiwa14", "xarm7", "fr3", "sia20", "gen3")
LANGUAGES = ("inform", "sunrise", "xarm", "franka", "kinova")


STREAMED = ("franka", "kinova")
"""They get a row a millisecond."""


def random_motion(rng: np.random.Generator, sia: hk.Robot) -> tuple[hk.Task, TimedTrajectory, float]:
    name = str(rng.choice(ARMS))
    robot = hk.with_tool(sia if name == "sia20" else hk.load(name), [0.0, 0.0, 0.1], [0.0, 0.3, 0.0])
    lower, upper = np.maximum(robot.lower, -2.5), np.minimum(robot.upper, 2.5)
    q0 = lower + (upper - lower) * rng.uniform(0.25, 0.75, 7)
    at, size = robot.pose(q0)[:3, 3], rng.uniform(0.03, 0.1)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    path = {
        "line": lambda: hk.polyline(at + size * np.array([np.zeros(3), turn[0]])),
        "corner": lambda: hk.polyline(at + size * np.array([np.zeros(3), turn[0], turn[0] + turn[1]])),
        "arc": lambda: hk.path.arc(at, at + size * turn[0], rng.uniform(0.5, 2.5), turn[2]),
    }[rng.choice(["line", "corner", "arc"])]()
    speed = float(rng.uniform(0.02, 0.15))
    task = hk.pose(robot)
    walk = hk.follow(hk.holonomic(task, hk.lock(int(rng.choice([0, 2, 6])))), path.at_speed(speed), q0, samples=200)
    return task, hk.retime(walk, acceleration=4.0, jerk=200.0, speed=1.0, dt=0.004), speed


def played(language: str, task: hk.Task, timed: TimedTrajectory, folder: Path) -> grammars_seven.Parsed:
    """What a controller makes of the program of a language: joints of the robot in rad."""
    tolerance = ToolTolerance(task, 2e-4, 0.01, 0.02, 0.9 * HUNDREDTH)
    speeds = np.rad2deg(task.robot.max_velocity)
    if language in STREAMED:
        program = (to_franka if language == "franka" else to_kinova)(timed, name="seam")
        if language == "franka":
            rows = grammars_seven.franka(program, folder, timed.q[0])[-1]
        else:
            rows = np.deg2rad(grammars_seven.kinova(program, folder)[2][:, :7])
        rows = rows[::4] if len(rows) % 4 == 1 else np.vstack([rows[::4], rows[-1:]])
        n = len(rows) - 1
        made = grammars_seven.Parsed("", rows, [4e-3] * n, [False] * (n + 1), kinds=["joint"] * n)
        return replace(made, speeds=[np.nan] * n)
    if language == "inform":
        program = to_inform(timed, PULSES.tolist(), tolerance=tolerance, speeds=task.robot.max_velocity.tolist())
        read = grammars_more.inform(program.text, PULSES, speeds[ORDER])
        read.axes = read.axes[:, np.argsort(ORDER)]
        read.comments = list(program.notes)
    elif language == "sunrise":
        program = to_sunrise(timed, tolerance=tolerance, speeds=task.robot.max_velocity.tolist())
        read = grammars_seven.sunrise(program.text, speeds)
    else:
        program = to_xarm(timed, tolerance=tolerance)
        read = grammars_seven.xarm(program)
    read.axes = np.deg2rad(read.axes)
    return read


def pinocchio_pose(robot: hk.Robot) -> controllers.Pose:
    model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    data, frame = model.createData(), model.getFrameId(robot.tips[0].name)
    order = [model.joints[model.getJointId(name)] for name in robot.joint_names]

    def pose(axes: np.ndarray) -> np.ndarray:
        q = np.zeros(model.nq)
        for joint, x in zip(order, axes, strict=True):
            q[joint.idx_q : joint.idx_q + joint.nq] = x if joint.nq == 1 else [np.cos(x), np.sin(x)]
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[frame].homogeneous

    return pose


def check_motion(seed: int, sia: hk.Robot, folder: Path) -> dict[str, tuple[float, float, float, float]]:
    """Of each language: how far joints are from ours [degrees], the shares by which the tool's speed and the joints'
    rates are beyond ours and the limits, and that by which its roundings change a speed, as it says. Empty where there
    is no motion: out of reach, or singular."""
    rng = np.random.default_rng(seed)
    try:
        task, timed, speed = random_motion(rng, sia)
    except HolokinError:
        return {}
    robot, pose = task.robot, pinocchio_pose(task.robot)
    t = np.linspace(0.0, timed.duration, 20 * len(timed))
    ours = CubicHermiteSpline(timed.t, timed.q, timed.dq)(t)
    near, asked = cKDTree(ours), speed * np.interp(t, timed.t, timed.path_speed)
    measured = {}
    for language in LANGUAGES:
        read = played(language, task, timed, folder)
        steps = 1 if language in STREAMED else 8
        made = controllers.play(read, pose, steps, degrees=False)
        # Joints, by their distances from our way, a line between two of its points.
        q = np.concatenate([move.q for move in made])
        i = np.clip(near.query(q)[1], 1, len(ours) - 2)
        apart = np.min([_off(q, ours[i - 1], ours[i]), _off(q, ours[i], ours[i + 1])], axis=0)
        assert ((q >= robot.lower - 1e-6) & (q <= robot.upper + 1e-6)).all(), (seed, language)
        # The tool's speed against ours at the same place, where it neither starts nor stops.
        faster = [0.0]
        for move, (begin, end) in zip(made, pairwise(read.stops), strict=True):
            here = asked[near.query(move.q)[1]]
            if not (begin or end) and np.isfinite(move.speed).all() and here.min() > 0.995 * asked.max():
                faster += np.abs(move.speed / ((here[1:] + here[:-1]) / 2) - 1.0).tolist()
        rates = [np.abs(np.diff(move.q, axis=0)).max(axis=0) * steps / move.seconds for move in made]
        beyond = (np.array(rates) / robot.max_velocity).max() - 1.0
        said = re.search(r"up to (.*?) %", " ".join(read.comments)) if language == "inform" else None
        rounding = 0.0 if said is None else float(said[1]) / 100
        measured[language] = float(np.rad2deg(apart.max())), max(faster), float(beyond), rounding
    return measured


def _off(q: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The largest difference of each posture from the nearest one between two others (k,)."""
    line = b - a
    share = np.clip(((q - a) * line).sum(axis=1) / np.maximum((line * line).sum(axis=1), 1e-30), 0.0, 1.0)
    return np.abs(q - a - share[:, None] * line).max(axis=1)


@sampled(1, "seed", list(range(120)))
def test_random_motions_of_seven_axes_are_played_as_timed(seed: int, sia: hk.Robot, tmp_path: Path) -> None:
    """Joints within 0.01 degrees, limits kept, the tool's speed within 2 %: of INFORM, which rounds, as it says."""
    for language, (joints, faster, beyond, rounding) in check_motion(seed, sia, tmp_path).items():
        assert joints <= 0.01, (seed, language, joints)
        most = 0.021 if language != "inform" else 0.024 + rounding  # whole pulses, near a singular posture
        assert faster <= most, (seed, language, faster, rounding)
        assert beyond <= 0.01, (seed, language, beyond)
