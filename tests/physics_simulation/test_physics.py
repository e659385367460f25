"""Strategies on MuJoCo's physics: what repeats, what drifts, what a push does, and which joints to feed back."""

from __future__ import annotations

import logging
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, Command, sampled, urdf
from holokin.errors import ArgumentError, OpenPathError, StartError, UnknownNameError
from holokin.motion import LoopWatch
from holokin.physics_simulation import PhysicalRun, Push, cycle_time, make_plant, play
from holokin.reports import physics_figures
from holokin.robot import servo

mujoco = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def arm() -> hk.Robot:
    """A Panda with the masses of its URDF."""
    return hk.from_urdf(urdf("panda.urdf"), tip="panda_hand_tcp")


def circle(robot: hk.Robot, radius: float = 0.05) -> hk.Path:
    start = robot.pose(PANDA_START)[:3, 3]
    return hk.circle(start, start - [radius, 0, 0])


def tied(robot: hk.Robot) -> hk.Strategy:
    return hk.holonomic(hk.pose(robot), hk.linear([1, 0, -1, 0, 0, 0, 0]))


@pytest.mark.campaign
def test_after_20_cycles_the_holonomic_law_rests_at_servo_accuracy_and_the_pseudo_inverse_drifts_as_predicted(
    arm: hk.Robot,
) -> None:
    """With noise and a push. Once measured: 4e-5 rad apart, and 0.660 rad against 0.660 predicted."""
    start = arm.pose(PANDA_START)[:3, 3]
    loop = hk.circle(start, start - [0.05, 0, 0], speed=0.2)
    push = Push(np.array([0.0, 200.0, 0.0]), 10.4 * cycle_time(loop))
    common = {"cycles": 20, "dt": 2e-3, "noise": 5e-5, "push": push}
    held = play(tied(arm), loop, PANDA_START, **common)
    assert held.cycles == 20
    assert held.apart.max() < 1e-4
    assert held.deflection > 3e-4  # the push was felt
    least = hk.moore_penrose(hk.pose(arm))
    lost = play(least, loop, PANDA_START, **common)
    predicted = hk.drift(least, loop, PANDA_START, cycles=20).largest
    assert predicted[-1] == pytest.approx(0.660, abs=1e-3)
    assert np.abs(lost.apart / predicted - 1).max() < 0.05
    for run in (held, lost):
        assert run.tracking_error() < 6e-3
        assert not run.remark


def pushed(strategy: hk.Strategy) -> PhysicalRun:
    loop = circle(strategy.task.robot)
    push = Push(np.array([0.0, 150.0, 0.0]), 0.3 * cycle_time(loop), joint="panda_joint4")
    return play(strategy, loop, PANDA_START, servo="velocity", push=push, dt=2e-3)


@pytest.mark.campaign
def test_a_push_reaches_a_law_that_measures_and_the_holonomic_one_returns_to_its_leaf(arm: hk.Robot) -> None:
    """A velocity servo yields to a push; the pseudo-inverse keeps what it did to the self-motion."""
    run = pushed(tied(arm))
    assert run.feedback == "measured"
    away = np.abs(run.leaf).max(axis=1)  # type: ignore[arg-type]
    during = (run.t >= run.push[0]) & (run.t <= run.push[1] + 0.1)  # type: ignore[index]
    assert away[during].max() > 0.01
    assert away[-1] < 1e-5
    free = play(tied(arm), circle(arm), PANDA_START, servo="velocity", dt=2e-3)
    assert np.abs(run.rests[-1] - free.rests[-1]).max() < 1e-5
    least = hk.moore_penrose(hk.pose(arm))
    undisturbed = play(least, circle(arm), PANDA_START, servo="velocity", dt=2e-3)
    assert np.abs(pushed(least).rests[-1] - undisturbed.rests[-1]).max() > 0.01


@pytest.mark.campaign
def test_measured_joints_starve_a_loop_of_position_servos_and_it_says_so(
    arm: hk.Robot, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, "holokin"):
        starved = play(tied(arm), circle(arm), PANDA_START, feedback="measured", dt=2e-3)
    assert "with position servos feed back the commanded joints" in caplog.text
    assert "measured joints and position servos" in starved.remark
    assert starved.followed < 0.2
    assert starved.tracking_error() > 0.02
    fed = play(tied(arm), circle(arm), PANDA_START, dt=2e-3)
    assert fed.feedback == "commanded"
    assert fed.followed == pytest.approx(1.0, abs=0.02)
    assert fed.tracking_error() < 3e-3
    assert not fed.remark


@sampled(1, "kind", ["velocity", "torque"])
def test_measured_joints_suit_the_other_servos(arm: hk.Robot, kind: str) -> None:
    run = play(tied(arm), circle(arm), PANDA_START, servo=kind, dt=2e-3)
    assert run.feedback == "measured"
    assert run.followed == pytest.approx(1.0, abs=0.02)
    assert run.tracking_error() < 2e-3
    assert run.apart.max() < 1e-4


def test_velocity_servos_creep_away_from_commanded_joints(arm: hk.Robot) -> None:
    run = play(tied(arm), circle(arm), PANDA_START, servo="velocity", feedback="commanded", cycles=2, dt=2e-3)
    assert run.apart[1] > 1.5 * run.apart[0] > 1e-4


def test_a_watch_knows_a_share_of_the_motion_from_all_of_it() -> None:
    for share in (1.0, 0.3):
        watch, q, rng = LoopWatch(0.01), np.zeros(3), np.random.default_rng(0)
        for _ in range(500):
            dq = rng.uniform(-1, 1, 3)
            watch.see(q + 1e-5 * rng.standard_normal(3), dq)
            q = q + share * 0.01 * dq
        assert watch.share == pytest.approx(share, abs=0.01)
        assert watch.starved == (share < 0.5)
    assert not LoopWatch(0.01).starved
    with pytest.raises(ArgumentError, match="dt"):
        LoopWatch(0.0)


OWN = """
<mujoco model="own"><compiler angle="radian"/>
  <default><joint axis="0 0 1"/><geom type="capsule" fromto="0 0 0 .4 0 0" size=".03"/></default>
  <worldbody><body name="a" pos="0 0 0.3"><joint name="one"/><geom/>
    <body name="b" pos=".4 0 0"><joint name="two"/><geom/>
      <body name="c" pos=".4 0 0"><joint name="three"/><geom fromto="0 0 0 .2 0 0" mass="2"/>
        <site name="tool" pos=".2 0 0"/></body></body></body></worldbody>
  <actuator><motor joint="one" gear="7"/><motor joint="two"/></actuator>
  <keyframe><key ctrl="1 2"/></keyframe>
</mujoco>
"""


def test_a_robot_of_an_mjcf_file_runs_in_its_own_model(tmp_path: Path) -> None:
    file = tmp_path / "own.xml"
    file.write_text(OWN)
    robot = hk.load(file, tip="tool")
    q0 = np.array([0.3, 0.9, 0.7])
    plant = make_plant(robot, servo(robot, "position", q0))
    assert plant.origin == str(file)
    assert plant.model.body("c").mass[0] == 2.0
    assert plant.model.nu == 3  # the servos, in the place of the motors
    strategy = hk.holonomic(hk.position(robot, rows=[0, 1]), hk.lock(2))
    start = robot.pose(q0)[:3, 3]
    run = play(strategy, hk.circle(start, start - [0.1, 0, 0]), q0, cycles=2, dt=2e-3)
    assert run.apart.max() < 1e-6
    moved = hk.with_tool(robot, [0, 0, 0.1])
    assert make_plant(moved, servo(moved, "position", q0)).origin == "the masses of its description"


def test_servos_that_fit_the_masses_sag_as_much_whatever_the_links_are_made_of() -> None:
    """Gains and weight grow together with the density of the capsules that stand for a robot without masses."""
    robot = hk.load("irb140")
    q0 = np.array([0.1, 0.3, -0.2, 0.2, 0.6, 0.1])
    start = robot.pose(q0)[:3, 3]
    law, way = hk.moore_penrose(hk.position(robot)), hk.line(start, start + [0.02, 0, 0])
    light, heavy = (play(law, way, q0, dt=2e-3, density=density) for density in (500.0, 4000.0))
    assert np.abs(light.q[0] - q0).max() > 1e-3
    assert np.abs(light.q - heavy.q).max() < 1e-6


def test_what_cannot_be_played_is_refused(arm: hk.Robot) -> None:
    loop, law = circle(arm), tied(arm)
    for named, words in (
        ({"servo": "hydraulic"}, "use one of position"), ({"feedback": "guessed"}, "use one of commanded, measured"),
        ({"noise": -1.0}, "noise"), ({"dt": 0.0}, "dt"), ({"gain": 1e9}, "unstable"), ({"density": -1.0}, "density"),
    ):  # fmt: skip
        with pytest.raises(ArgumentError, match=words):
            play(law, loop, PANDA_START, **{"density": 1000.0, **named} if "density" not in named else named)  # type: ignore[arg-type]
    with pytest.raises(OpenPathError):
        play(law, hk.line(loop.start, loop.start + [0.05, 0, 0]), PANDA_START, cycles=2)
    with pytest.raises(StartError):
        play(law, loop, PANDA_START + 0.1)
    with pytest.raises(UnknownNameError, match="nose"):
        play(law, loop, PANDA_START, push=Push(np.zeros(3), 1.0, joint="nose"))


def test_a_run_ends_where_the_arm_stands_at_a_limit(arm: hk.Robot) -> None:
    start = arm.pose(PANDA_START)[:3, 3]
    run = play(tied(arm), hk.line(start, start + [0.5, 0, 0.3], speed=0.5), PANDA_START, dt=2e-3)
    assert run.stopped
    assert run.cycles == 0
    assert run.stopped in run.remark


# --- holokin simulate ---

JOB = f"""
title = "two laws"
[robot]
name = "panda"
[task]
kind = "pose"
orientation = "twist"
[start]
q = {PANDA_START.tolist()}
[path]
kind = "circle"
center = [-0.05, 0, 0]
relative = true
speed = 0.2
[physics]
dt = 0.002
[strategies.moore-penrose]
kind = "moore-penrose"
[strategies.tied]
kind = "linear"
matrix = [[1, 0, -1, 0, 0, 0, 0]]
"""


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("job")
    (folder / "laws.toml").write_text(JOB)
    return folder


@pytest.mark.campaign
def test_a_job_is_simulated_and_its_logs_are_judged(done: Path, holokin: Command) -> None:
    outcome = holokin("simulate", done / "laws.toml", "--cycles", "4", "--push", "0 100 0", "--out", done / "out")
    assert outcome.code == 0, outcome.err
    rows = {line.split("│")[1].strip(): line for line in outcome.out.splitlines() if line.startswith("│")}
    assert "differs" in rows["moore-penrose"]
    assert "repeats" in rows["tied"]
    assert "solid capsules of 1000 kg/m^3" in " ".join(outcome.out.split())
    folder = done / "out" / "laws-physics"
    names = {file.name for file in folder.iterdir()}
    assert names >= {
        "arms.png",
        "cycles.png",
        "push.png",
        "tied-log.csv",
        "moore-penrose-log.csv",
        "model.xml",
        "result.json",
    }
    for stem, code in (("tied", 0), ("moore-penrose", 1)):
        assert holokin("audit", folder / f"{stem}-log.csv", "--robot", "panda").code == code
    model = mujoco.MjModel.from_xml_path(str(folder / "model.xml"))
    assert model.nu == 7


@pytest.mark.campaign
def test_a_law_that_is_fed_the_wrong_joints_fails(
    done: Path, holokin: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("holokin.reports.physics_report.write_figure", lambda *_given: None)  # nobody looks at them
    outcome = holokin(
        "simulate", done / "laws.toml", "--cycles", "2", "--feedback", "measured", "--push", "0", "--noise", "0",
        "--out", done / "wrong",
    )  # fmt: skip
    assert outcome.code == 1
    assert "feed back the commanded joints" in " ".join(outcome.out.split())


def test_simulate_refuses_what_makes_no_sense_and_folders_of_others(done: Path, out: Path, holokin: Command) -> None:
    for options, words in (
        (("--servo", "hydraulic"), "servo"), (("--cycles", "0"), "cycles"), (("--push", "hard"), "newtons"),
        (("--noise", "-1"), "noise"), (("--feedback", "guessed"), "feedback"),
    ):  # fmt: skip
        outcome = holokin("simulate", done / "laws.toml", *options, "--out", done / "bad")
        assert outcome.code == 2
        assert words in outcome.err
    assert holokin("simulate", "paper", "--out", done / "bad").code == 2
    with pytest.MonkeyPatch.context() as without:
        without.setitem(sys.modules, "mujoco", None)
        outcome = holokin("simulate", done / "laws.toml", "--out", done / "bad")
    assert (outcome.code, "[strategies" in outcome.err) == (2, False)
    assert "pip install 'holokin[mujoco]'" in " ".join(outcome.err.split())
    (out / "laws-physics").mkdir()
    (out / "laws-physics" / "mine.txt").write_text("keep me")
    outcome = holokin("simulate", done / "laws.toml", "--out", out)
    assert outcome.code == 2
    assert "not one of holokin's" in outcome.err
    assert (out / "laws-physics" / "mine.txt").read_text() == "keep me"


@pytest.mark.campaign
def test_an_arm_that_rests_where_it_rested_first_hides_its_pale_one_and_another_does_not(arm: hk.Robot) -> None:
    run = play(tied(arm), circle(arm), PANDA_START, dt=4e-3)
    away = replace(run, rests=run.rests + [[0.0] * 7, [0.4, 0, -0.4, 0, 0, 0, 0]])
    for one, seen in ((run, False), (away, True)):
        figure = physics_figures.arms_figure({"arm": one, "again": one})
        figure.canvas.draw()
        assert figure.get_tightbbox().y1 < figure.get_figheight() + 0.01  # no title is cut off
        cover = figure.axes[0].images[0].get_array()[..., 3]
        pale = (cover > 0.3) & (cover < 0.6)  # ghosts cover the paper in part, solids whole
        assert (pale.mean() > 0.01) == seen


@pytest.mark.campaign
def test_in_one_cycle_of_measured_joints_the_deflection_is_not_known(arm: hk.Robot) -> None:
    push = Push(np.array([0.0, 150.0, 0.0]), 1.0)
    alone = play(tied(arm), circle(arm), PANDA_START, servo="velocity", push=push, dt=4e-3)
    assert np.isnan(alone.deflection)
    two = play(tied(arm), circle(arm), PANDA_START, servo="velocity", push=push, dt=4e-3, cycles=2)
    assert 0.003 < two.deflection < 0.03
