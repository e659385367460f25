"""Robot programs: each is read back by a parser of its grammar, and does what the timed motion does."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import controllers
import grammars
import grammars_more
import holokin as hk
import referees
from conftest import IRB_START, PANDA_START, Command, sampled
from grammars import facts
from holokin.analysis.audit.logs import read_recording
from holokin.app.job import open_job, program_of_job, run_job
from holokin.app.job.job_parts import build_entry, build_paths, entry_report
from holokin.app.job.uses import default_strategy, job_strategy
from holokin.base.errors import ArgumentError, ExportError, HolokinError, MissingExtraError, UnknownNameError
from holokin.export import (
    ProcessLines,
    Program,
    Wiring,
    to_fanuc,
    to_gcode,
    to_krl,
    to_rapid,
    to_ros,
    to_urscript,
    write_mcap,
)
from holokin.motion import TimedTrajectory

ABOUT = "wrist held: q4, q5, q6 stay \u00fc"
TOLERANCE = 2e-3


def timed(robot: hk.Robot, task: hk.Task, law: hk.Constraint, start: np.ndarray, dt: float) -> TimedTrajectory:
    """A triangle, or in [x y] of the base of a robot on a rail, trapezoidally timed."""
    at = robot.pose(start)[:3, 3]
    corners = at + np.array([[0, 0, 0], [0.05, 0, 0], [0.05, 0.05, 0]])
    walk = hk.follow(hk.holonomic(task, law), hk.polyline(corners, closed=True), start, samples=60)
    return hk.retime(walk, velocity=3.0, acceleration=10.0, profile="trapezoidal", dt=dt)


@pytest.fixture(scope="module")
def six(irb140: hk.Robot) -> TimedTrajectory:
    return timed(irb140, hk.position(irb140), hk.lock(3, 4, 5), IRB_START, 0.002)


@pytest.fixture(scope="module")
def seven() -> TimedTrajectory:
    panda = hk.load("panda")
    return timed(panda, hk.pose(panda), hk.lock(2), PANDA_START, 0.004)


def read(program: Program, language: str) -> grammars.Parsed:
    texts = list(program.files.values())
    parse = {"rapid": grammars.rapid, "krl": grammars.krl, "urscript": grammars.urscript, "ls": grammars.listing}
    return parse[language](*texts)


WRITERS = {"rapid": to_rapid, "krl": to_krl, "urscript": to_urscript, "ls": to_fanuc}
EXACT = {"rapid": 1e-6, "krl": 1e-6, "urscript": 1e-9, "ls": 1e-3}
"""Half of the last digit, doubled: degrees, radians in URScript."""


@pytest.mark.parametrize("language", WRITERS)
def test_a_program_read_back_moves_the_joints_as_timed(language: str, six: TimedTrajectory) -> None:
    """At the times of its targets the joints are the trajectory's; between them they are within the tolerance."""
    program = WRITERS[language](six, about=ABOUT, tolerance=TOLERANCE)
    found = read(program, language)
    q = found.axes if language == "urscript" else np.deg2rad(found.axes)
    t = np.concatenate([[0.0], np.cumsum(found.seconds)])
    assert t[-1] == pytest.approx(six.duration, abs=1e-3)
    assert len(q) == program.targets
    at = np.rint(t / six.dt).astype(int)
    close = EXACT[language] if language == "urscript" else np.deg2rad(EXACT[language])
    np.testing.assert_allclose(q, six.q[at], atol=close)
    between = np.column_stack([np.interp(six.t, six.t[at], q[:, i]) for i in range(6)])
    assert np.abs(between - six.q).max() <= TOLERANCE + close
    assert program.deviation <= TOLERANCE
    stops = [0, *six.stops, len(six) - 1]
    assert at[found.stops].tolist() == stops


def test_urscript_streams_every_sample(six: TimedTrajectory) -> None:
    found = read(to_urscript(six), "urscript")
    np.testing.assert_allclose(found.axes, six.q, atol=1e-9)
    assert set(found.seconds) == {0.002}


@pytest.mark.parametrize("language", WRITERS)
def test_the_header_tells_the_law_limits_tolerance_and_units(language: str, six: TimedTrajectory) -> None:
    soft = replace(six, limits=replace(six.limits, jerk=np.full(6, 300.0)))
    program = WRITERS[language](soft, about=ABOUT)
    said, header = facts(program), read(program, language).comments
    assert len(header) == 5 and "targets" in header[2] and "way to" in header[4]
    assert "wrist held: q4, q5, q6 stay ue" in said
    plain = "q3: -0.872665 to 4.01426 rad, speed 3 rad/s, acc 10 rad/s^2, jerk 300 rad/s^3"
    turned = "q3: -50 to 230 deg, speed 171.887 deg/s, acc 572.958 deg/s^2, jerk 17188.7 deg/s^3"
    assert (plain if language == "urscript" else turned) in said
    assert ("radians" if language == "urscript" else "degrees") in said
    assert "joint targets" in said


@pytest.mark.parametrize("language", WRITERS)
def test_names_keep_the_rules_of_the_vendor(language: str, six: TimedTrajectory) -> None:
    longest = {"rapid": 30, "krl": 24, "urscript": 64, "ls": 36}[language]
    found = read(WRITERS[language](six, about="9 lives of a very long title " * 5), language)
    assert len(found.name) <= (8 if language == "ls" else longest)
    assert read(WRITERS[language](six, name="A" * longest), language).name == "A" * longest
    for bad in ("A" * (longest + 1), "1up", "a-b", ""):
        with pytest.raises(ArgumentError, match="a letter, then letters"):
            WRITERS[language](six, name=bad)


@pytest.mark.parametrize("language", WRITERS)
def test_a_robot_that_a_language_cannot_hold_is_refused(language: str, seven: TimedTrajectory) -> None:
    with pytest.raises(ExportError, match=r"holds 6 axes of a robot.*7 are given"):
        WRITERS[language](seven)


@pytest.mark.parametrize("language", ["rapid", "krl", "ls"])
def test_the_seventh_joint_goes_to_an_external_axis(language: str, seven: TimedTrajectory) -> None:
    names = seven.joint_names
    wiring = Wiring(external=(names[2],), signs={names[0]: -1}, offsets={names[1]: 0.5})
    q = np.deg2rad(read(WRITERS[language](seven, wiring=wiring), language).axes)
    start = PANDA_START[[0, 1, 3, 4, 5, 6, 2]] * [-1, 1, 1, 1, 1, 1, 1] + [0, 0.5, 0, 0, 0, 0, 0]
    np.testing.assert_allclose(q[0], start, atol=1e-5)


def test_a_sliding_joint_is_in_millimetres_and_an_axis_may_stand_still(ppr: hk.Robot) -> None:
    start = np.array([0.5, -0.2, 0.3])
    moved = timed(ppr, hk.position(ppr), hk.lock(2), start, 0.01)
    one, two, three = moved.joint_names
    wiring = Wiring(axes=(three, 0.1, 0.2, 0.3, 0.4, 0.5), external=(one, two))
    for language in ("rapid", "krl", "ls"):
        row = read(WRITERS[language](moved, wiring=wiring), language).axes[0]
        np.testing.assert_allclose(row[:6], np.rad2deg([0.3, 0.1, 0.2, 0.3, 0.4, 0.5]), atol=1e-3)
        np.testing.assert_allclose(row[6:], [500.0, -200.0], atol=1e-3)
    with pytest.raises(ExportError, match="slides"):
        to_rapid(moved, wiring=Wiring(axes=(one, two, three, 0.0, 0.0, 0.0)))


def test_a_machine_of_linear_axes_is_moved_by_g_code(ppr: hk.Robot) -> None:
    """Sliding joints are X and Y in mm, the turning one is A in degrees; inverse times sum to the motion's."""
    moved = timed(ppr, hk.position(ppr), hk.lock(2), np.array([0.5, -0.2, 0.3]), 0.01)
    lines = ProcessLines(on=("output 2 on",), after=("wait 0.5",))
    with pytest.raises(ArgumentError, match="a process line") as refused:
        to_gcode(moved, lines=ProcessLines(on=("%",)))
    assert "G-code" in str(refused.value)
    program = to_gcode(moved, tolerance=1e-4, lines=replace(lines, off=("output 2 off",)))
    found = grammars_more.gcode(program.text)
    t = np.concatenate([[0.0], np.cumsum(found.seconds)])
    assert t[-1] == pytest.approx(moved.duration, rel=1e-5)
    between = np.column_stack([np.interp(moved.t, t, column) for column in (found.axes * [1e-3, 1e-3, np.pi / 180]).T])
    assert np.abs(between - moved.q).max() <= 1e-4 + 1e-6
    assert found.lines == [(1, "M64 P2"), (len(found.axes), "M65 P2"), (len(found.axes), "G4 P0.5")]
    assert " X" in program.text and " Y" in program.text and " A" in program.text
    assert "G1 U" in to_gcode(moved, letters=("U", "V", "C")).text
    for bad in (("X", "Y"), ("X", "X", "A"), ("X", "Y", "Q")):
        with pytest.raises(ArgumentError, match="letters"):
            to_gcode(moved, letters=bad)


def test_a_remark_of_a_fanuc_program_ends_no_statement(six: TimedTrajectory) -> None:
    """A semicolon ends a statement: of a remark that held one, the rest would be an instruction."""
    (text,) = to_fanuc(six, about="law; R[1]=0 ;CALL EVIL;x").files.values()
    body = text[text.index("/MN") : text.index("/POS")].splitlines()[1:]
    assert all(line.endswith(" ;") and line.count(";") == 1 for line in body)
    assert any("CALL EVIL" in line and line.split(":", 1)[1].lstrip().startswith("!") for line in body)


def test_fanuc_counts_joint_three_from_the_floor_when_asked(six: TimedTrajectory) -> None:
    """J3 = joint 3 - joint 2, as ROS-Industrial's driver has it; the header says which of the two it is."""
    programs = [to_fanuc(six, coupled=c) for c in (False, True)]
    plain, coupled = (read(program, "ls") for program in programs)
    np.testing.assert_allclose(coupled.axes[:, 2], plain.axes[:, 2] - plain.axes[:, 1], atol=2e-3)
    assert "J3 = joint 3 - joint 2" in facts(programs[1])
    assert "no coupling" in facts(programs[0])


@pytest.mark.parametrize("format", ["json", "yaml"])
def test_a_joint_trajectory_of_ros_holds_every_sample_with_its_rates(format: str, six: TimedTrajectory) -> None:
    ddq = six.ddq.copy()
    ddq[0, 0] = 1e-9  # to YAML 1.1 this is text, and 1.0e-9 a number
    six = replace(six, ddq=ddq)
    text = to_ros(six, about=ABOUT, format=format).text
    if format == "yaml":
        message = pytest.importorskip("yaml").safe_load(text)
        assert "# wrist held" in text
    else:
        message = json.loads(text)
        assert any("wrist held" in line for line in message.pop("comments"))
    assert set(message) == {"header", "joint_names", "points"}
    assert message["joint_names"] == list(six.joint_names)
    for key, wanted in (("positions", six.q), ("velocities", six.dq), ("accelerations", six.ddq)):
        found = np.array([point[key] for point in message["points"]])
        assert found.dtype == float, key
        assert (found == wanted).all(), key
    stamps = [p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in message["points"]]
    np.testing.assert_allclose(stamps, six.t, atol=1e-9)
    few = to_ros(six, tolerance=TOLERANCE, format=format)
    assert few.targets < 100 < len(six)
    assert few.deviation <= TOLERANCE


def test_an_mcap_is_read_by_foxgloves_own_library(six: TimedTrajectory, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    reader = pytest.importorskip("mcap.reader")
    file = write_mcap(six, tmp_path / "bag")
    with file.open("rb") as stream:
        found = list(reader.make_reader(stream).iter_messages())
        stream.seek(0)
        summary = reader.make_reader(stream).get_summary()
    schemas = {schema.name: schema for schema in summary.schemas.values()}
    assert set(schemas) == {"sensor_msgs/msg/JointState", "trajectory_msgs/msg/JointTrajectory"}
    assert all(s.encoding == "ros2msg" and s.data for s in schemas.values())  # by which Foxglove decodes them
    states = [m for _, channel, m in found if channel.topic == "/joint_states"]
    assert len(states) == len(six)
    np.testing.assert_allclose([m.log_time * 1e-9 for m in states], six.t, atol=1e-9)
    back = hk.read_recording(file, hk.load("irb140"))
    assert (back.q == six.q).all()


def test_without_rosbags_the_error_names_the_extra(six: TimedTrajectory, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "rosbags.rosbag2", None)
    with pytest.raises(MissingExtraError, match=r"holokin\[log\]"):
        write_mcap(six, tmp_path / "bag")


@pytest.mark.parametrize(
    "wiring, says",
    [
        (Wiring(axes=("q1", "q2", "q3", "q4", "q5", "q5")), "each of"), (Wiring(external=("q9",)), "each of"),
        (Wiring(offsets={"q9": 0.0}), "unknown joint"), (Wiring(external=(0.0,) * 7), "7 external"),
        (Wiring(external=(np.nan,)), "within"),
    ],
    ids=str,
)  # fmt: skip
def test_bad_wiring_is_refused(wiring: Wiring, says: str, six: TimedTrajectory) -> None:
    with pytest.raises((ArgumentError, ExportError, UnknownNameError), match=says):
        to_krl(six, wiring=wiring)
    with pytest.raises(ArgumentError, match="1 or -1"):
        Wiring(signs={"q1": 2})


def test_a_step_that_is_not_the_controllers_is_refused_by_servoj(six: TimedTrajectory) -> None:
    with pytest.raises(ArgumentError, match="e-Series"):
        to_urscript(replace(six, dt=0.004))


JOB = """
title = "a circle"
[robot]
name = "irb140"
[start]
q = [10.0, 70.0, 10.0, 20.0, 50.0, 30.0]
degrees = true
[path]
kind = "circle"
relative = true
center = [-0.05, 0.0]
samples = 60
[timing]
speed = "fastest"
profile = "trapezoidal"
velocity = 3.0
acceleration = 10.0
[program]
coupled = true
[strategies.wrist]
kind = "lock"
joints = [3, 4, 5]
[expect.wrist]
time = {below = 2.0}
limit_distance = {above = 0.5}
"""


@pytest.mark.usefixtures("sketched")
def test_a_job_is_timed_and_leaves_as_each_program(holokin: Command, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("weld.toml").write_text(JOB, "utf-8")
    done = holokin("run", "weld.toml", "--out", "out")
    assert done.code == 0, done.err
    assert re.search(r"trapezoidal, [01]\.\d+ s", done.out), done.out
    result = json.loads(Path("out/weld/result.json").read_text("utf-8"))["strategies"][0]
    assert result["timing"]["duration"] == result["metrics"]["time"]
    header = Path("out/weld/wrist-timed.csv").read_text("utf-8").partition("\n")[0]
    assert header.startswith("time [s],q1 [rad]")
    assert "Timing" in Path("out/weld/report.html").read_text("utf-8")
    done = holokin("export", "krl", "weld.toml", "--out", "krl")
    assert done.code == 0, done.err
    texts = [Path("krl", name).read_text("utf-8") for name in ("irb140_wrist.src", "irb140_wrist.dat")]
    found = grammars.krl(*texts)
    assert sum(found.seconds) == pytest.approx(result["timing"]["duration"], abs=1e-3)
    assert "Job weld: wrist on irb140" in Path("krl", "irb140_wrist.txt").read_text("utf-8")
    assert holokin("export", "ros", "weld.toml", "--out", "ros", "--dt", "0.01").code == 0
    assert len(Path("ros/joints.csv").read_text("utf-8").splitlines()) < 200
    done = holokin("export", "ls", "weld.toml", "--out", "x", "--jerk", "-1")
    assert done.code == 2
    assert "jerk is -1.0" in done.err


def test_the_speed_of_the_path_is_kept_unless_the_job_says_fastest(tmp_path: Path) -> None:
    """A circle of 0.05 m at 0.1 m/s takes 3.14 s; the joints could go round it in half of that."""
    file = tmp_path / "weld.toml"
    kept = JOB.replace('speed = "fastest"\n', "").replace("samples = 60", "samples = 60\nspeed = 0.1")
    for text, low, high in ((kept, 3.14, 3.6), (JOB, 0.2, 1.6)):
        file.write_text(text, "utf-8")
        _, motion, _ = program_of_job(*open_job(str(file)), "krl")
        assert low < motion.duration < high


def test_what_fails_the_jobs_own_checks_is_not_written_but_anyway(
    holokin: Command, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    short = JOB.replace("samples = 60", "samples = 20")
    for floor, code in ((-1.0, 0), (2.0, 1)):
        Path("weld.toml").write_text(
            f"{short}[checks]\nself_collision = false\nradius = 0.05\nfloor = {floor}\n", "utf-8"
        )
        done = holokin("export", "krl", "weld.toml", "--out", f"out{code}")
        assert (done.code, Path(f"out{code}").exists()) == (code, code == 0), done.out + done.err
    assert "nothing was written" in done.out and "floor" in done.out
    done = holokin("export", "krl", "weld.toml", "--out", "out1", "--anyway")
    assert done.code == 0 and Path("out1/joints.csv").is_file() and "floor" in done.out
    assert holokin("export", "krl", "weld.toml", "--out", "x", "--speed", "quick").code == 2


def test_a_law_that_drifts_is_not_endless_in_a_job_and_that_is_said(tmp_path: Path) -> None:
    file = tmp_path / "weld.toml"
    drifting = '[strategies.free]\nkind = "moore-penrose"\n'
    file.write_text(JOB.replace("[program]", f"endless = true\n{drifting}[program]"), "utf-8")
    held, free = sorted(run_job(*open_job(str(file))).strategies, key=lambda found: found.name == "free")
    assert held.timed.loop is not None
    assert held.trouble == ""
    assert free.timed.loop is None
    assert "do not end where they started" in free.trouble


@sampled(1, "language", WRITERS)
def test_a_job_becomes_a_program_of_each_language(language: str, tmp_path: Path) -> None:
    file = tmp_path / "weld.toml"
    file.write_text(JOB, "utf-8")
    program, motion, _ = program_of_job(*open_job(str(file)), language)
    found = read(program, language)
    assert sum(found.seconds) == pytest.approx(motion.duration, abs=1e-3)
    if language == "ls":
        assert found.axes[0, 2] == pytest.approx(10.0 - 70.0, abs=1e-3)  # coupled, as [program] says


# --- A welding job, from the robot's torch to the last line of each program.


TORCH = np.array([[0.0, 0.0, 1.0, 0.05], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.3], [0.0, 0.0, 0.0, 1.0]])

WELD = """
title = "a seam"
[robot]
name = "irb140"
tool = {xyz = [0.05, 0.0, 0.3], rpy_deg = [0, 90, 0]}
[start]
q = [0.0, 115.0, -35.0, 20.0, 40.0, 5.0]
degrees = true
[task]
kind = "pose"
orientation = "axis"
[path]
kind = "polyline"
points = [[0.56, -0.05, 0.45], [0.56, -0.01, 0.45]]
speed = 0.008
lead_in = 0.01
lead_out = 0.01
retract = 0.02
entry = "joints"
samples = 60
[timing]
acceleration = 5.0
dt = 0.02
[checks]
radius = 0.04
self_collision = false
[program]
pulses = [1000, 1000, 1000, 1000, 1000, 1000]
tool_tolerance = {mm = 0.2, degrees = 1.0, percent = 2}
linear = true
tool = "tTorch"
before = ["wait 0.25"]
on = ["output 3 on"]
off = ["output 3 off", "wait 1"]
[strategies.wrist]
kind = "lock"
joints = [3]
"""

BALL = """
[[checks.obstacles]]
name = "ball"
kind = "sphere"
radius = 0.05
xyz = [0.237, 0.411, 0.13]
"""

PULSES, SPEEDS = np.full(6, 1000.0), np.rad2deg(hk.load("irb140").max_velocity)
READ = {
    "rapid": grammars.rapid, "krl": grammars.krl, "urscript": grammars.urscript, "ls": grammars.listing,
    "val3": partial(grammars_more.val3, speeds=SPEEDS),
    "inform": partial(grammars_more.inform, pulses=PULSES, speeds=SPEEDS),
}  # fmt: skip
SAID = {
    "rapid": ("WaitTime 0.25", "SetDO do3,1", "SetDO do3,0", "WaitTime 1"),
    "krl": ("WAIT SEC 0.25", "$OUT[3]=TRUE", "$OUT[3]=FALSE", "WAIT SEC 1"),
    "urscript": ("sleep(0.25)", "set_digital_out(3, True)", "set_digital_out(3, False)", "sleep(1)"),
    "ls": ("WAIT 0.25(sec)", "DO[3]=ON", "DO[3]=OFF", "WAIT 1.00(sec)"),
    "val3": ("delay(0.25)", "diOut3=true", "diOut3=false", "delay(1)"),
    "inform": ("TIMER T=0.25", "DOUT OT#(3) ON", "DOUT OT#(3) OFF", "TIMER T=1.00"),
}


def torch_at(q: np.ndarray) -> np.ndarray:
    return (referees.irb140(q) @ TORCH)[:3, 3]


TOOL = {"urscript": "[0, 0, 0.3, 0, 0, 0]", "krl": "3", "ls": "3", "inform": "3"}


def of(language: str, text: str = WELD) -> str:
    """A job with the tool as a language has it: by name, by number or by its pose."""
    return text.replace('"tTorch"', TOOL.get(language, '"tTorch"'))


def from_start(job: str) -> str:
    """The job with a short seam that begins at the start posture: no way there, which takes longest, is sought."""
    found = job.replace('entry = "joints"', "relative = true").replace("samples = 60", "samples = 12")
    found = found.replace("lead_in = 0.01\n", "").replace("retract = 0.02\n", "")
    return found.replace("[[0.56, -0.05, 0.45], [0.56, -0.01, 0.45]]", "[[0.0, 0.0, 0.0], [0.0, 0.02, 0.0]]")


@pytest.fixture
def weld(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("weld.toml").write_text(WELD, "utf-8")
    return tmp_path / "weld.toml"


@sampled(1, "language", READ)
def test_the_process_begins_and_ends_where_the_seam_does(language: str, weld: Path) -> None:
    """The torch is on from one end of the seam to the other, and off on leads, retracts and on the way there."""
    weld.write_text(of(language), "utf-8")
    program, timed, found = program_of_job(*open_job(str(weld)), language)
    read = READ[language](*program.files.values())
    assert [line for _, line in read.lines] == list(SAID[language])
    before, on, off, _ = (place for place, _ in read.lines)
    axes = read.axes if language == "urscript" else np.deg2rad(read.axes)
    assert before == 0
    np.testing.assert_allclose(torch_at(axes[on - 1]), [0.56, -0.05, 0.45], atol=1e-4)
    np.testing.assert_allclose(torch_at(axes[off - 1]), [0.56, -0.01, 0.45], atol=1e-4)
    assert found is not None and found.passed and found.samples == len(timed)
    np.testing.assert_allclose(axes[0], np.deg2rad([0.0, 115.0, -35.0, 20.0, 40.0, 5.0]), atol=1e-5)
    assert timed.begin > 0 and timed.begin in timed.stops


@pytest.mark.campaign
def test_the_seam_is_straight_and_even_from_its_start_to_its_end(weld: Path) -> None:
    weld.write_text(of("krl"), "utf-8")
    program, _, _ = program_of_job(*open_job(str(weld)), "krl")
    read = grammars.krl(*program.files.values())
    made = controllers.play(read, lambda q: referees.irb140(q) @ TORCH, 12)
    on, off = (place for place, line in read.lines if "OUT" in line)
    for move in made[on - 1 : off - 1]:
        assert move.kind == "linear"
        np.testing.assert_allclose(move.p[:, [0, 2]], np.tile([0.56, 0.45], (len(move.p), 1)), atol=2e-4)
        np.testing.assert_allclose(move.speed, 0.008, rtol=0.02)


def test_an_abb_welds_by_moves_of_its_arc_welder_and_at_the_speed_of_the_path(weld: Path) -> None:
    """The arc burns from one end of the seam to the other; approach and retract are one linear move each."""
    weld.write_text(of("rapid").replace("[program]", '[program]\narc = ["seam1", "weld1"]'), "utf-8")
    program, _, _ = program_of_job(*open_job(str(weld)), "rapid")
    read = grammars.rapid(program.text)
    (start, first), (end, last) = [(place, line) for place, line in read.lines if line.startswith("Arc")]
    assert (first, last) == ("ArcLStart seam1 weld1", "ArcLEnd seam1 weld1")
    axes = np.deg2rad(read.axes)
    np.testing.assert_allclose(torch_at(axes[start]), [0.56, -0.05, 0.45], atol=1e-4)
    np.testing.assert_allclose(torch_at(axes[end]), [0.56, -0.01, 0.45], atol=1e-4)
    assert read.kinds == ["joint", *["linear"] * 5] and read.speeds[1:] == [0.008] * 5
    assert any("set weld_speed to 8 mm/s" in note for note in program.notes)


def rewritten(file: Path, text: str) -> str:
    file.write_text(text, "utf-8")
    return str(file)


TABLE = """
name = "t"
source = "a shop"
convention = "urdf"
tip = "plate"
[[joints]]
joint = "c1"
xyz = [0, 0, 0.3]
axis = [0, 0, 1]
lower = -6
upper = 6
max_velocity = 2
"""

TURNED = """
title = "a seam on a turntable"
[robot]
name = "cell"
parts = [{name = "irb140"}, {name = "table.toml", on = "base", xyz = [0.55, 0, 0]}]
[task]
kind = "relative-pose"
orientation = "axis"
tip = "tcp"
other = "plate"
[start]
q = [0, 20, -10, 10, 60, 0, 0]
degrees = true
[path]
kind = "circle"
center = [-0.05, 0, 0]
relative = true
speed = 0.02
samples = 80
[timing]
profile = "trapezoidal"
acceleration = 5
dt = 0.012
[program]
external = ["c1"]
[strategies.still]
kind = "lock"
joints = ["q1", "q6"]
"""


@pytest.mark.campaign
def test_on_a_turntable_the_speed_is_that_on_the_part(weld: Path) -> None:
    """In the room the torch makes 6.9 to 21.4 mm/s, on the plate 20: by P. Corke's table and a turn about z."""
    Path("table.toml").write_text(TABLE, "utf-8")
    program, _, _ = program_of_job(*open_job(rewritten(weld, TURNED)), "rapid")
    read = grammars.rapid(program.text)
    axes, seconds = np.deg2rad(read.axes), np.array([10.0, *read.seconds])
    share = np.linspace(0, 1, 20)[:, None]
    speeds = []
    for i in range(2, len(axes) - 1):
        q = axes[i - 1] + share * (axes[i] - axes[i - 1])
        turned = Rotation.from_euler("z", -q[:, 6:])
        points = turned.apply([referees.irb140(x[:6])[:3, 3] - [0.55, 0, 0.3] for x in q])
        speeds.append(np.linalg.norm(np.diff(points, axis=0), axis=1) * 19 / seconds[i])
    slowest, fastest = np.min(speeds), np.max(speeds)
    assert program.tool is not None and slowest > 0.0185 and fastest < 0.0215
    assert program.tool.slowest == pytest.approx(slowest, abs=5e-4)
    assert program.tool.fastest == pytest.approx(fastest, abs=5e-4)


def test_no_linear_move_is_one_on_a_turntable(weld: Path) -> None:
    Path("table.toml").write_text(TABLE, "utf-8")
    with pytest.raises(HolokinError, match="a line in the room, and not on plate"):
        linear = TURNED.replace("samples = 80", "samples = 12").replace(
            "[program]", '[program]\nlinear = true\ntool = "t1"'
        )
        program_of_job(*open_job(rewritten(weld, linear)), "rapid")


def test_an_entry_is_timed_and_checked_and_the_report_says_so(weld: Path) -> None:
    """A ball beside the start posture is found on the way to the seam, and not on the seam."""
    quick = WELD.replace("dt = 0.02", "dt = 0.05") + "[verdict]\nsamples = 4\n"
    weld.write_text(
        quick.replace("q = [0.0, 115.0, -35.0, 20.0, 40.0, 5.0]", "q = [60.0, 75.0, -20.0, 20.0, 60.0, 10.0]") + BALL,
        "utf-8",
    )
    result = run_job(*open_job(str(weld)))
    (found,) = result.strategies
    assert found.motion_check is not None and found.motion_check.passed
    assert "find on the way there: collision" in result.about and found.trouble.startswith("the entry: collision")


@pytest.mark.campaign
def test_nothing_is_found_on_a_way_that_is_clear(weld: Path) -> None:
    weld.write_text(WELD.replace("dt = 0.02", "dt = 0.05") + "[verdict]\nsamples = 4\n", "utf-8")
    assert "find nothing on the way there" in run_job(*open_job(str(weld))).about


@pytest.mark.campaign
def test_entry_program_and_table_speak_the_units_of_the_job(holokin: Command, tmp_path: Path) -> None:
    """The same job in rad and in degrees: the same posture, deviation and peaks, and joints.csv is read back alike."""
    seen = {}
    for name, units in (("plain", "rad, m"), ("turned", "degrees, mm")):
        file = tmp_path / f"{name}.toml"
        text = (
            WELD.replace("samples = 60", "samples = 12")
            .replace("linear = true\n", "")
            .replace('"a seam"', f'"a seam"\nunits = "{units}"')
        )
        text = text.replace("[checks]\nradius = 0.04\nself_collision = false\n", "")
        file.write_text(re.sub("tool_tolerance = .*", "tolerance = 0.01", text), "utf-8")
        _, job, _ = open_job(str(file))
        _, strategy, q0 = job_strategy(job, file, None)
        path = build_paths(job.path, strategy.task, q0, file)
        said, _ = entry_report(job, file, strategy, build_entry(job, strategy, path, q0))
        said = job.printed_units.reworded(said, [(c.name, c.unit) for c in strategy.task.robot.coordinates])
        written = holokin("export", "rapid", file, "--out", tmp_path / name)
        rows = [line.split() for line in written.out.splitlines() if re.match(r"q\d ", line)]
        seen[name] = (
            [float(x) for x in re.findall(r"q\d (-?[\d.e-]+)", said.partition(";")[0])],
            float(re.search(r"within (\S+) (?:rad|deg)$", written.out, re.MULTILINE).expand(r"\1")),
            [float(row[1]) for row in rows],
        )
    for plain, turned in zip(seen["plain"], seen["turned"], strict=True):
        np.testing.assert_allclose(np.degrees(plain), turned, rtol=0.05)
    read = [read_recording(tmp_path / name / "joints.csv", hk.load("irb140")).q for name in seen]
    np.testing.assert_allclose(*read, atol=1e-9)


def test_a_first_export_needs_no_option(holokin: Command, tmp_path: Path, monkeypatch) -> None:
    """No folder, strategy or acceleration is given: what was chosen is said, and the joints keep to their speeds."""
    monkeypatch.chdir(tmp_path)
    done = holokin("export", "rapid", "irb140-half-square")
    assert done.code == 0, done.err
    assert "strategy coupled: the first with leaves; --strategy takes another: moore-penrose" in done.out
    assert "no acceleration is given: a quintic profile" in done.out
    folder = tmp_path / "out" / "irb140-half-square-rapid"
    assert "quintic motion" in next(folder.glob("*.txt")).read_text()
    log, robot = read_recording(folder / "joints.csv", hk.load("irb140")), hk.load("irb140")
    speeds = np.abs(np.gradient(log.q, log.t, axis=0)) / robot.max_velocity
    assert 0.001 < speeds.max() <= 1.0 + 1e-6
    np.testing.assert_allclose(speeds[[0, -1]], 0.0, atol=1e-3)  # it starts and ends at rest
    done = holokin("export", "rapid", "irb140-half-square", "--strategy", "moore-penrose", "--acceleration", "5")
    assert done.code == 0 and "the first with leaves" not in done.out and "no acceleration" not in done.out
    assert "moore_penrose" in "".join(file.name for file in folder.glob("*.mod"))


def test_the_advised_strategy_is_exported_before_others(tmp_path: Path) -> None:
    """Wherever it stands; a radial one, and one without leaves, only where there is no other."""
    rules = {
        "advised": 'kind = "lock"\njoints = ["q4"]',
        "radial": 'kind = "radial"',
        "lock": 'kind = "lock"\njoints = ["q6"]',
        "plain": 'kind = "moore-penrose"',
    }
    head = WELD[: WELD.index("[strategies")]
    for order, expected in (
        (("plain", "radial", "lock", "advised"), "advised"),
        (("plain", "radial", "lock"), "lock"),
        (("plain", "radial"), "radial"),
        (("plain",), "plain"),
    ):
        file = tmp_path / "weld.toml"
        file.write_text(head + "\n".join(f"[strategies.{name}]\n{rules[name]}" for name in order), "utf-8")
        _, job, _ = open_job(str(file))
        label, sentence = default_strategy(job, file)
        assert label == expected
        assert job_strategy(job, file)[0] == expected
        assert all(name in sentence for name in order) or len(order) == 1


@sampled(
    5,
    ("language", "old", "new", "words"),
    [
        ("rapid", '"tTorch"', '"my torch"', "a letter, then letters"),
        ("krl", "tool = 3", 'tool = "tTorch"', "krl knows it by its number"),
        ("rapid", '"tTorch"', "3", "rapid knows it by its name"),
        ("krl", "tool = 3", "tool = 99", "0 to 16"),
        ("krl", "tool = 3\n", "", "the tool that the controller has"),
        ("krl", "tool_tolerance = {mm = 0.2, degrees = 1.0, percent = 2}", "tolerance = 0.01", "tolerance of the tool"),
        ("rapid", '"output 3 on"', '"output 3 ON"', "output 3 on"),
        ("rapid", "linear = true", "linear = true\nzone = -1.0", "zone"),
        ("ls", '"output 3 on"', '"DO[1]=ON;CALL X"', "a process line"),
        ("rapid", '"output 3 on"', '"SetDO x,1;\\n END"', "line breaks"),
        ("urscript", '"output 3 on"', '"end"', "a process line"),
        ("krl", "percent = 2}", "percent = 200}", "percent"),
        ("krl", "linear = true", "linear = 3", "linear"),
    ],
)
def test_what_a_language_cannot_hold_is_refused_and_named(
    language: str, old: str, new: str, words: str, weld: Path
) -> None:
    assert old in of(language)
    weld.write_text(from_start(of(language)).replace(old, new, 1), "utf-8")
    with pytest.raises(HolokinError, match=words):
        program_of_job(*open_job(str(weld)), language)


def test_the_command_says_what_is_kept_and_what_was_left_out(holokin: Command, weld: Path) -> None:
    weld.write_text(from_start(of("urscript")).replace("linear = true", "linear = true\nbase = 2"), "utf-8")
    done = holokin("export", "urscript", "weld.toml", "--out", "ur")
    assert done.code == 0, done.err
    assert "mm/s" in done.out and "urscript takes no base and no pulses of [program]: left out" in done.out
    (tolerance,) = [line for line in done.out.splitlines() if line.startswith("between them")]
    assert ", and the joints within" in tolerance and "at other times the tool starts or stops" in done.out
    few = from_start(of("urscript"))
    few = few.replace("tool_tolerance = {mm = 0.2, degrees = 1.0, percent = 2}\nlinear = true\n", "")
    weld.write_text(few, "utf-8")
    done = holokin("export", "urscript", "weld.toml", "--out", "ur")
    assert "20 ms is no step of servoj" in done.out
    text = Path("ur/irb140_wrist.script").read_text("utf-8")
    assert text.endswith("end\nirb140_wrist()\n") and "movej" in text and "servoj(" not in text


def test_inform_asks_for_the_pulses_of_the_axes(weld: Path) -> None:
    short = from_start(of("inform"))
    weld.write_text(short.replace("pulses = [1000, 1000, 1000, 1000, 1000, 1000]\n", ""), "utf-8")
    with pytest.raises(HolokinError, match="pulses of \\[program\\]"):
        program_of_job(*open_job(str(weld)), "inform")
    weld.write_text(short.replace("1000, 1000]", "1000]"), "utf-8")
    with pytest.raises(HolokinError, match="pulses of the axes"):
        program_of_job(*open_job(str(weld)), "inform")


def test_linear_is_kept_at_a_step_of_the_controller(weld: Path) -> None:
    """At 8 ms URScript would send every sample; a job that asks for linear moves gets them."""
    few = (
        from_start(of("urscript"))
        .replace("dt = 0.02", "dt = 0.008")
        .replace("tool_tolerance = {mm = 0.2, degrees = 1.0, percent = 2}\n", "")
    )
    weld.write_text(few, "utf-8")
    program, _, _ = program_of_job(*open_job(str(weld)), "urscript")
    assert "movel(" in program.text and "servoj(" not in program.text


def test_ros_says_which_keys_of_the_program_it_leaves_out(holokin: Command, weld: Path) -> None:
    weld.write_text(from_start(WELD), "utf-8")
    done = holokin("export", "ros", "weld.toml", "--out", "ros")
    assert done.code == 0, done.err
    left = next(line for line in done.out.splitlines() if "left out" in line)
    assert all(f" {key}" in left for key in ("tool_tolerance", "linear", "tool", "before", "on", "off", "pulses")), left
