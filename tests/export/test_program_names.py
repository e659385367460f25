"""Names that a controller has already: a program of such a name would not load, or would call itself."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import cKDTree

import controllers
import grammars
import grammars_more
import holokin as hk
from conftest import IRB_START, sampled
from holokin.base.errors import ArgumentError, ExportError, HolokinError
from holokin.export import (
    ProcessLines,
    ToolTolerance,
    Wiring,
    to_fanuc,
    to_gcode,
    to_inform,
    to_krl,
    to_rapid,
    to_urscript,
    to_val3,
)
from holokin.motion import TimedTrajectory
from holokin.robot import DHRow

WRITERS: dict[str, Any] = {
    "rapid": to_rapid, "krl": to_krl, "urscript": partial(to_urscript, tolerance=2e-3), "val3": to_val3,
    "ls": to_fanuc, "inform": partial(to_inform, pulses=[1000.0] * 6),
    "gcode": partial(to_gcode, letters=list("XYZABC")),
}  # fmt: skip
COMMENT = {"rapid": "!", "krl": ";", "urscript": "#", "val3": "//"}
OWN = {
    "rapid": {"hk", "hk_M", "T", "V", "NoEOffs", "box1"}, "krl": {"hk", "RVP"}, "urscript": {"hk", "a", "t", "v", "r"},
    "val3": set[str](),
}  # fmt: skip
"""Words of the programs that may be names beside them: of arguments and files, and those that were given."""


@pytest.fixture(scope="module")
def move(irb140: hk.Robot) -> TimedTrajectory:
    """A line of 5 cm."""
    at = irb140.pose(IRB_START)[:3, 3]
    corner = at + [0.05, 0, 0]
    walk = hk.follow(hk.holonomic(hk.position(irb140), hk.lock(3, 4, 5)), hk.line(at, corner), IRB_START, samples=60)
    return hk.retime(walk, velocity=1.0, acceleration=5.0, dt=0.008)


@pytest.mark.parametrize(
    ("language", "names"),
    [
        ("rapid", ["MoveL", "movel", "PROC", "EndProc", "TryNext", "p1", "c7", "v1000", "fine", "tool0", "CalcRobT"]),
        ("krl", ["END", "def", "SPTP", "LIN", "xp1", "XERR", "E6AXIS", "Loop", "BAS", "Step", "CHANNEL", "tool_data"]),
        ("urscript", ["end", "def", "thread", "movej", "True", "sleep"]),
        ("val3", ["end", "begin", "elseIf", "movej", "l_jA", "jointRx", "world"]),
        ("ls", ["con", "NUL", "Com1"]),
        ("inform", ["AUX"]),
        ("gcode", ["prn"]),
    ],
)
def test_a_word_of_the_language_is_no_name_of_a_program(language: str, names: list[str], move: TimedTrajectory) -> None:
    for name in names:
        with pytest.raises(ArgumentError, match=f"name is '{name}'; .*give another one, such as hk_{name}"):
            WRITERS[language](move, name=name)
        assert WRITERS[language](move, name=f"hk_{name}").text


@pytest.mark.parametrize("language", COMMENT)
def test_no_word_that_a_written_program_uses_is_taken_as_its_name(
    language: str, move: TimedTrajectory, irb140: hk.Robot
) -> None:
    lines = ProcessLines(before=["output 3 on", "wait 0.5"], after=["output 3 off"])
    given: dict[str, Any] = {"lines": lines, "name": "hk", "tolerance": ToolTolerance(hk.position(irb140), linear=True)}
    given |= {"payload": "box1"} if language == "rapid" else {}
    program = WRITERS[language](move, **given)
    words: set[str] = set()
    for line in program.text.splitlines():
        words |= set(re.findall(r"(?<![\w$#.&])[A-Za-z_]\w*", line.split(COMMENT[language])[0].split("<")[0]))
    words -= OWN[language]
    assert len(words) > 5
    for word in sorted(words):
        with pytest.raises(ArgumentError, match=r"has this word already|takes a letter"):
            WRITERS[language](move, name=word)


def test_a_tool_or_frame_may_be_one_that_the_controller_has_but_no_word_of_it(move: TimedTrajectory) -> None:
    for given in ({"tool": "tool0"}, {"base": "wobj0"}, {"payload": "load0"}, {"zone": "z5"}):
        assert to_rapid(move, **given).text
    assert to_val3(move, tool="flange", base="world").text
    for given in ({"tool": "MoveL"}, {"base": "PROC"}, {"payload": "p1"}, {"zone": "while"}):
        with pytest.raises(ArgumentError, match="has this word already"):
            to_rapid(move, **given)
    with pytest.raises(ArgumentError, match="has this word already"):
        to_val3(move, tool="l_jA")


CALLING = {
    "rapid": "ArcLStart p9,v10,seam1,weld1,fine,tTorch;", "krl": "gluegun_on(1)", "urscript": "glue(True)",
    "val3": "call weld()", "ls": "CALL WELD(1)", "inform": "CALL JOB:WELD",
}  # fmt: skip
FREE = {"rapid": "weld", "ls": "DO", "inform": "DOUT"}
"""Names that stand in no line, or are words that a program may have for its name."""


@pytest.mark.parametrize("language", CALLING)
def test_a_program_has_no_name_that_its_own_lines_use(language: str, move: TimedTrajectory) -> None:
    """It would call itself, or one name would stand for a program and for data."""
    lines = ProcessLines(before=["output 3 on"], on=[CALLING[language]])
    used = {"rapid": ["arclstart", "seam1", "tTorch"], "krl": ["gluegun_on"], "urscript": ["glue"]}
    for name in used.get(language, ["weld"]):
        with pytest.raises(ArgumentError, match=f"has this name for something else.*such as hk_{name}"):
            WRITERS[language](move, name=name, lines=lines)
        assert f"hk_{name}".lower() in " ".join(WRITERS[language](move, about=name, lines=lines).files).lower()
    free = FREE.get(language, "output")
    assert WRITERS[language](move, name=free, lines=lines).text
    if language == "rapid":
        assert to_rapid(move, name="weld", lines=ProcessLines(on=['TPWrite "weld";'])).text
        with pytest.raises(ArgumentError, match="'tTorch' has this name"):
            to_rapid(move, name="ttorch", tool="tTorch")
    if language == "urscript":
        assert to_urscript(move, name="Glue", tolerance=2e-3, lines=lines).text  # it tells capitals apart


def test_a_name_that_is_made_of_a_title_is_no_word_either(move: TimedTrajectory) -> None:
    assert "hk_end.script" in WRITERS["urscript"](move, about="end").files
    assert "hk_MoveL_M.mod" in to_rapid(move, about="MoveL").files
    assert "End.script" in WRITERS["urscript"](move, about="End").files  # URScript tells capitals apart


NASTY = (
    *(")", "(", "; ", "]]>", "%", "*/", "MSG,", "py,import os", "FOLD", "//", "M2", "//INST", "/POS", "END", "'", '"'),
    *("LOG,", "joint 1", "\\", "G0 X0", "!", "#", "]", "\u00fc", "\u4e2d"),
)
CONTROLS = ("\n", "\r\n", "\t", "\x00", "\x85", "\u2028", "\u202e")
"""Those that no joint's name may have."""

START = {
    "ls": r"\s*\d+:\s*!",
    "inform": "'",
    "gcode": ";",
    **{language: rf"\s*{mark}" for language, mark in COMMENT.items()},
}
"""How the lines of comments begin."""


@sampled(3, "seed", list(range(40)))
def test_names_of_a_file_are_words_of_comments_in_every_language(seed: int, irb140: hk.Robot) -> None:
    """Whatever they hold, the other lines of the program are those of the robot whose joints have plain names."""
    draw = np.random.default_rng(seed)

    def nasty(words: tuple[str, ...]) -> str:
        return "".join(draw.choice(words, draw.integers(1, 9)))

    names = dict.fromkeys([nasty(NASTY) for _ in range(20)])
    robot = replace(
        irb140, coordinates=tuple(replace(c, name=n) for c, n in zip(irb140.coordinates, names, strict=False))
    )
    about = nasty(NASTY + CONTROLS)
    kept = {}
    for arm, said in ((irb140, "law"), (robot, about)):
        at = arm.pose(IRB_START)[:3, 3]
        law = hk.holonomic(hk.position(arm), hk.lock(3, 4, 5))
        walk = hk.follow(law, hk.line(at, at + [0.05, 0, 0]), IRB_START, samples=20)
        timed = hk.retime(walk, velocity=1.0, acceleration=5.0, dt=0.008)
        for language, write in WRITERS.items():
            files = write(timed, about=said, name="PROG").files
            lines = [line for text in files.values() for line in text.split("\n")]
            assert all(line.isascii() and line.replace("\t", " ").isprintable() for line in lines), (language, lines)
            comments = [line for line in lines if re.match(START[language], line)]
            assert len(comments) == 5, language
            others = [
                re.sub(r"^ *\d+:|LINE_COUNT.*|(DATE|CREATE|MODIFIED).*", "", line)
                for line in lines
                if line not in comments
            ]
            assert kept.setdefault(language, others) == others, language
            if language == "gcode":
                assert not any(
                    re.match(r";\s*(py|msg|log|debug|print|probe)", line, re.IGNORECASE) for line in comments
                )
                assert not any(set("()%") & set(line.partition("(G93)")[0]) for line in comments)
            if language == "ls":
                assert all(line.count(";") == 1 and line.endswith(" ;") for line in comments)
            if language == "val3":
                assert not any("]]>" in line for line in comments)


# --- Programs of random robots, tools, paths and laws in every language, played with Pinocchio's kinematics.


LANGUAGES = ("rapid", "krl", "urscript", "ls", "inform", "val3")
PULSES = 3000.0
CASES = 200


def random_robot(rng: np.random.Generator) -> tuple[hk.Robot, np.ndarray]:
    """A six-axis arm, perhaps on a rail, with a torch, and a posture of it."""
    name = rng.choice(["irb140", "ur5e", "ur10e", "rail-ur10e", "of DH"])
    if name == "of DH":
        a2, d4 = rng.uniform(0.3, 0.7, 2)
        table = [
            (rng.uniform(0, 0.2), np.pi / 2, 0.4, 0.0), (a2, 0.0, 0.0, np.pi / 2),
            (rng.uniform(0, 0.1), np.pi / 2, 0.0, 0.0),
            (0.0, -np.pi / 2, d4, 0.0), (0.0, np.pi / 2, 0.0, 0.0), (0.0, 0.0, 0.1, 0.0),
        ]  # fmt: skip
        speeds = rng.uniform(2.0, 6.0, 6)
        robot = hk.from_dh(
            [
                DHRow(*row, joint=f"q{i}", lower=-3.0, upper=3.0, max_velocity=float(speeds[i]))
                for i, row in enumerate(table)
            ]
        )
    else:
        robot = hk.load(name)
    robot = hk.with_tool(robot, rng.uniform(-0.1, 0.1, 3) + [0, 0, 0.15], rng.uniform(-1.0, 1.0, 3))
    q0 = rng.uniform(-1.2, 1.2, robot.n)
    q0[-2] += np.sign(q0[-2]) * 0.4  # away from the wrist's singular posture
    return robot, np.clip(q0, robot.lower + 0.3, robot.upper - 0.3)


def random_motion(rng: np.random.Generator) -> tuple[hk.Task, hk.motion.TimedTrajectory, float]:
    robot, q0 = random_robot(rng)
    start = robot.pose(q0)
    if robot.n == 7:
        task, law = hk.pose(robot), hk.lock(0) if rng.random() < 0.5 else hk.linear(rng.uniform(-1, 1, (1, 7)))
    else:
        task = hk.pose(robot, "axis", reference=start[:3, :3])
        law = hk.lock(int(rng.integers(6)))
    size = rng.uniform(0.03, 0.12)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    at = start[:3, 3]
    path = {
        "line": lambda: hk.polyline(at + size * np.array([np.zeros(3), turn[0]])),
        "corner": lambda: hk.polyline(at + size * np.array([np.zeros(3), turn[0], turn[0] + turn[1]])),
        "arc": lambda: hk.path.arc(at, at + size * turn[0], rng.uniform(0.5, 4.0), turn[2]),
        "spline": lambda: hk.spline(at + size * np.array([np.zeros(3), turn[0], turn[0] + turn[1], 2 * turn[0]])),
    }[rng.choice(["line", "corner", "arc", "spline"])]()
    speed = float(rng.choice([0.005, 0.008, 0.02, 0.1]))
    walk = hk.follow(hk.holonomic(task, law), path.at_speed(speed), q0, samples=300)
    dt = 0.008 if speed > 0.05 else 0.04
    return task, hk.retime(walk, acceleration=8.0, speed=1.0, dt=dt), speed


def written(language: str, timed: hk.motion.TimedTrajectory, robot: hk.Robot, tolerance: ToolTolerance) -> tuple:
    """The program, and what its parser reads, in rad and m, the axes of the robot first."""
    rail = robot.n == 7
    given = {"tolerance": tolerance, "wiring": Wiring(external=robot.joint_names[:1]) if rail else None}
    speeds = np.rad2deg(np.roll(robot.max_velocity, -1) if rail else robot.max_velocity)
    units = np.array([np.pi / 180] * 6 + [1e-3] * rail)
    if rail:
        speeds[6] = 1e3 * robot.max_velocity[0]
    if language == "inform":
        program = to_inform(timed, [PULSES] * robot.n, **given, speeds=robot.max_velocity.tolist())
        read = grammars_more.inform(program.text, np.full(robot.n, PULSES), speeds)
    elif language == "val3":
        program = to_val3(timed, **given, speeds=robot.max_velocity.tolist())
        read = grammars_more.val3(program.text, speeds)
    else:
        write = {"rapid": to_rapid, "krl": to_krl, "urscript": to_urscript, "ls": to_fanuc}[language]
        program = write(timed, **given)
        parse = {"rapid": grammars.rapid, "krl": grammars.krl, "urscript": grammars.urscript, "ls": grammars.listing}
        read = parse[language](*program.files.values())
        units = np.ones(6) if language == "urscript" else units
    read.axes = read.axes * units
    read.via = {i: list(np.array(row) * units) for i, row in read.via.items()}
    return program, read


def pinocchio_pose(robot: hk.Robot) -> controllers.Pose:
    """Pinocchio's pose of the tool, of axes with the rail last."""
    model = pin.buildModelFromXML(hk.robot.to_urdf(robot))
    data, frame = model.createData(), model.getFrameId(robot.tips[0].name)
    order = [model.joints[model.getJointId(name)].idx_q for name in robot.joint_names]

    def pose(axes: np.ndarray) -> np.ndarray:
        q = np.zeros(model.nq)
        q[order] = np.roll(axes, 1) if robot.n == 7 else axes
        pin.framesForwardKinematics(model, data, q)
        return data.oMf[frame].homogeneous

    return pose


def check_program(seed: int) -> str:
    """What became of a case: "played", or why there is no motion or no program."""
    rng = np.random.default_rng(seed)
    try:
        task, timed, speed = random_motion(rng)
    except HolokinError as problem:
        return type(problem).__name__
    robot = task.robot
    linear = bool(rng.random() < 0.6)
    tolerance = ToolTolerance(
        task,
        float(rng.uniform(1e-4, 1e-3)),
        float(rng.uniform(0.005, 0.03)),
        float(rng.uniform(0.01, 0.05)),
        0.02,
        linear,
    )
    pose = pinocchio_pose(robot)
    order = np.roll(np.arange(robot.n), -1) if robot.n == 7 else np.arange(robot.n)
    points = cKDTree(np.array([pose(q[order])[:3, 3] for q in timed.q]))
    joints = cKDTree(timed.q[:, order])
    spacing = np.abs(np.diff(timed.q, axis=0)).max()
    done = []
    for language in LANGUAGES:
        try:
            program, read = written(language, timed, robot, tolerance)
        except ExportError:
            assert language == "inform" or (language in ("urscript", "val3") and robot.n == 7), language
            continue
        made = controllers.play(read, pose, count=12, degrees=False)
        off = points.query(np.concatenate([move.p for move in made]))[0].max()
        assert off <= np.hypot(program.tool.position, speed * timed.dt) + 2e-6, (seed, language)
        q = np.concatenate([move.q for move in made])
        assert joints.query(q, p=np.inf)[0].max() <= program.tool.joints + spacing + 1e-4, (seed, language)
        assert program.tool.joints <= tolerance.joints and program.tool.rotation <= tolerance.rotation
        lower, upper = robot.lower[order], robot.upper[order]
        assert ((q >= lower - 0.02) & (q <= upper + 0.02)).all(), (seed, language)
        rounded = (
            1.0 if language == "inform" else tolerance.speed + 0.01
        )  # INFORM's hundredth of a per cent is coarse; it says so
        for move in made:
            rates = np.abs(np.diff(move.q, axis=0)).max(axis=0) * 12 / max(move.seconds, 1e-3)
            assert (rates <= robot.max_velocity[order] * (1.0 + rounded)).all(), (seed, language)
        done.append(language)
    assert len(done) >= (3 if robot.n == 7 else 5), (seed, done)
    return "played"


@pytest.mark.campaign
@pytest.mark.parametrize("first", range(0, 2 * CASES, 10))
def test_programs_of_random_robots_keep_what_they_state(first: int) -> None:
    """Ten seeds, of which some have no motion: a singular posture, a limit, a path out of reach."""
    outcomes = [check_program(seed) for seed in range(first, first + 10)]
    assert outcomes.count("played") >= 1, outcomes
