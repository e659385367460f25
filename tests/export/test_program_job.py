"""A welding job, from the robot's torch to the last line of each program."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import controllers
import grammars
import grammars_more
import holokin as hk
import referees
from conftest import Command, sampled
from holokin.analysis.audit.logs import read_recording
from holokin.app.job import open_job, program_of_job, run_job
from holokin.app.job.job_parts import build_entry, build_paths, entry_report
from holokin.app.job.uses import job_strategy
from holokin.base.errors import HolokinError

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


def test_an_entry_is_timed_and_checked_and_the_report_says_so(weld: Path) -> None:
    """A ball beside the start posture is found on the way to the seam, and not on the seam."""
    quick = WELD.replace("dt = 0.02", "dt = 0.05") + "[verdict]\nsamples = 4\n"
    weld.write_text(quick, "utf-8")
    assert "find nothing on the way there" in run_job(*open_job(str(weld))).about
    weld.write_text(
        quick.replace("q = [0.0, 115.0, -35.0, 20.0, 40.0, 5.0]", "q = [60.0, 75.0, -20.0, 20.0, 60.0, 10.0]") + BALL,
        "utf-8",
    )
    result = run_job(*open_job(str(weld)))
    (found,) = result.strategies
    assert found.motion_check is not None and found.motion_check.passed
    assert "find on the way there: collision" in result.about and found.trouble.startswith("the entry: collision")


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


@pytest.mark.parametrize(
    ("language", "old", "new", "words"),
    [
        ("rapid", '"tTorch"', '"my torch"', "a letter, then letters"),
        ("krl", "tool = 3", 'tool = "tTorch"', "tool"),
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
