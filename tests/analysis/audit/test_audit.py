"""The audit of black boxes: laws written here, in plain NumPy, that it has not seen."""

from __future__ import annotations

import time

import numpy as np
import pytest

import holokin as hk
from black_boxes import locked, pull
from conftest import PANDA_START, R3_START, sampled
from holokin.base.errors import ArgumentError, OpenPathError, StartError

COARSE = {"q0": PANDA_START, "dt": 0.05, "cycles": 3}
FINER = {"q0": PANDA_START, "dt": 0.02, "cycles": 3}


def pseudo_inverse(robot: hk.Robot):
    def law(q, pose, twist, dt):
        return np.linalg.pinv(robot.jacobian(q)) @ pull(robot, q, pose, dt)

    return law


def posture_task(robot: hk.Robot, preferred: np.ndarray, weight: float):
    def law(q, pose, twist, dt):
        J = robot.jacobian(q)
        P = np.linalg.pinv(J)
        return P @ pull(robot, q, pose, dt) + weight * (np.eye(7) - P @ J) @ (preferred - q)

    return law


def sluggish(robot: hk.Robot):
    """The pseudo-inverse with a null-space velocity that remembers: a law with a state."""
    state = np.zeros(7)

    def law(q, pose, twist, dt):
        J = robot.jacobian(q)
        P = np.linalg.pinv(J)
        least = P @ pull(robot, q, pose, dt)
        state[:] = 0.99 * state + 0.01 * least
        return least + (np.eye(7) - P @ J) @ state * 0.5 + 0.2 * (np.eye(7) - P @ J) @ (PANDA_START - q)

    return law


def test_a_pseudo_inverse_drifts_and_is_seen_to_be_a_local_strategy(panda: hk.Robot) -> None:
    found = hk.audit(pseudo_inverse(panda), hk.pose(panda), **COARSE)
    assert found.verdict is hk.analysis.audit.Repeatability.DRIFTS
    assert found.exit_code == 1
    assert found["cycles, loop 1"].metrics["first"] == pytest.approx(0.1635, abs=2e-3)
    assert found["paths"].metrics["apart"] > 0.1
    assert "do not depend" in found["speed"].sentence
    assert "no memory" in found["history"].sentence
    assert "keeps" in found["start"].sentence
    assert "obey the area law" in found["small loops"].sentence
    assert found["small loops"].metrics["ratio"] == pytest.approx(4, abs=0.4)
    F = hk.curvature(hk.moore_penrose(hk.pose(panda)), PANDA_START)[:, 0, 1]
    assert "in x-y" in found["planes"].sentence
    assert found["small loops"].metrics["drift_per_area"] == pytest.approx(np.abs(F).max(), rel=0.15)


def test_a_posture_task_settles_but_its_joints_depend_on_way_and_speed(panda: hk.Robot) -> None:
    found = hk.audit(posture_task(panda, PANDA_START + 0.1, 1.0), hk.pose(panda), **COARSE)
    assert found.verdict is hk.analysis.audit.Repeatability.CONVERGES
    assert "the joints depend on the speed" in found["speed"].sentence
    assert "forgets" in found["start"].sentence
    assert "the drifts do not fit it" in found["small loops"].sentence
    assert found["paths"].metrics["apart"] > 1e-2


@pytest.mark.campaign
def test_a_locked_joint_comes_home(panda: hk.Robot) -> None:
    found = hk.audit(locked(panda, 2), hk.pose(panda), **FINER)
    assert found.verdict is hk.analysis.audit.Repeatability.REPEATS
    assert found.exit_code == 0
    assert "none drifts" in found["small loops"].sentence
    assert found["cycles, loop 1"].metrics["tracking_m"] < 1e-3


@pytest.mark.campaign
def test_a_law_with_a_state_is_seen_to_remember(panda: hk.Robot) -> None:
    found = hk.audit(sluggish(panda), hk.pose(panda), **COARSE)
    assert "remembers" in found["history"].sentence
    assert found.verdict is not hk.analysis.audit.Repeatability.REPEATS


@pytest.mark.campaign
def test_a_holonomic_law_in_coarse_steps_is_told_from_one_that_drifts(panda: hk.Robot) -> None:
    law = hk.motion.control.closed_loop(hk.holonomic(hk.pose(panda), hk.arm_angle()))
    coarse = hk.audit(law, hk.pose(panda), **FINER)
    assert coarse.verdict is hk.analysis.audit.Repeatability.BUT_FOR_THE_STEP
    assert coarse.exit_code == 1
    fine = hk.audit(law, hk.pose(panda), q0=PANDA_START, dt=0.002, cycles=3)
    assert fine.verdict is hk.analysis.audit.Repeatability.REPEATS


@pytest.mark.campaign
def test_a_position_task_of_many_redundant_joints_can_be_audited(planar_3r: hk.Robot, panda: hk.Robot) -> None:
    task = hk.position(planar_3r)
    point = planar_3r.pose(R3_START)[:3, 3]
    loop = hk.circle(point, point - [0.1, 0, 0])
    found = hk.audit(hk.motion.control.closed_loop(hk.moore_penrose(task)), task, [loop], q0=R3_START)
    assert found["cycles"].metrics["first"] > 1e-4
    free = hk.audit(
        hk.motion.control.closed_loop(hk.moore_penrose(hk.position(panda))), hk.position(panda), q0=PANDA_START
    )
    assert "not asked" in free["start"].sentence
    assert free.verdict is hk.analysis.audit.Repeatability.DRIFTS


@sampled(1, "kind", ["throws", "nan", "shape", "blocks", "at once"])
def test_a_law_that_fails_is_reported_and_the_rest_goes_on(panda: hk.Robot, kind: str) -> None:
    """It fails only where the tool is low: the square and some planes reach there, the circle does not."""
    sound, height = locked(panda, 2), panda.pose(PANDA_START)[2, 3]

    def law(q, pose, twist, dt):
        if kind == "at once" or pose[2, 3] < height - 0.05:
            if kind in ("throws", "at once"):
                raise ZeroDivisionError("no solution here")
            if kind == "blocks":
                time.sleep(20)
            return np.full(7, np.nan) if kind == "nan" else np.zeros(3)
        return sound(q, pose, twist, dt)

    began = time.monotonic()
    found = hk.audit(law, hk.pose(panda), q0=PANDA_START, patience=0.3, cycles=3, dt=0.06)
    assert time.monotonic() - began < 60
    assert found.verdict is hk.analysis.audit.Repeatability.UNKNOWN
    assert found.exit_code == 2
    words = {"throws": "ZeroDivision", "nan": "NaN", "shape": "shape", "blocks": "did not return", "at once": "Zero"}
    said = words[kind]
    if kind == "at once":
        assert all(said in f.fault for f in found.findings if f.question != "start")
        return
    assert said in found["cycles, loop 2"].fault
    assert found["cycles, loop 1"].fault == ""
    assert said in found["planes"].fault
    assert found["planes"].metrics["x-y"] < 1e-3
    assert said in str(found)


def test_an_audit_can_be_written_down(panda: hk.Robot) -> None:
    import json

    found = hk.audit(locked(panda, 2), hk.pose(panda), q0=PANDA_START, cycles=3, dt=0.08)
    told = json.loads(json.dumps(found.to_dict()))
    assert told["verdict"] == "repeats"
    assert [f["question"] for f in told["findings"]][:2] == ["cycles, loop 1", "cycles, loop 2"]
    with pytest.raises(ArgumentError, match="asked"):
        found["weather"]


def test_bad_questions_are_refused(panda: hk.Robot) -> None:
    law = locked(panda, 2)
    point = panda.pose(PANDA_START)[:3, 3]
    with pytest.raises(OpenPathError):
        hk.audit(law, hk.pose(panda), path=[hk.line(point, point + 0.1)], q0=PANDA_START)
    with pytest.raises(StartError):
        hk.audit(law, hk.pose(panda), path=[hk.circle(point + 0.1, point + [0.1, 0, 0.1])], q0=PANDA_START)
    for arguments in ({"cycles": 1}, {"tolerance": 0.0}, {"patience": -1.0}, {"dt": 0.0}):
        with pytest.raises(ArgumentError):
            hk.audit(law, hk.pose(panda), q0=PANDA_START, **arguments)


@sampled(1, "seed", range(3))
def test_a_law_that_answers_otherwise_when_asked_again_does_not_pass(panda: hk.Robot, seed: int) -> None:
    """Its noise is so quick that the loops end within the tolerance: no run alone shows it."""
    rng = np.random.default_rng(seed)
    spin = rng.uniform(0.01, 0.05)

    def law(q, pose, twist, dt):
        rows = np.vstack([panda.jacobian(q), np.eye(7)[2]])
        return np.linalg.solve(rows, np.append(pull(panda, q, pose, dt), spin * rng.choice((-1.0, 1.0))))

    point = panda.pose(PANDA_START)[:3, 3]
    loops = [hk.circle(point, point - [0.05, 0, 0])]
    found = hk.audit(law, hk.pose(panda), path=loops, q0=PANDA_START, dt=0.04, cycles=3, tolerance=0.05)
    assert max(found["cycles"].metrics["first"], found["paths"].metrics["apart"]) < 0.05
    assert found["history"].metrics["otherwise"] > 0
    assert found.exit_code == 1
    assert "asked the same again it answered otherwise" in found.sentence


def test_noise_below_the_tolerance_is_told_and_passes(panda: hk.Robot) -> None:
    rng, sound = np.random.default_rng(0), locked(panda, 2)
    point = panda.pose(PANDA_START)[:3, 3]
    circle = hk.circle(point, point - [0.05, 0, 0])
    noisy = hk.motion.control.as_control_law(lambda *call: sound(*call) * (1 + 1e-5 * rng.normal()))
    found = hk.audit(noisy, hk.pose(panda), circle, PANDA_START, dt=0.04, cycles=3)
    assert found.exit_code == 0
    assert "asked the same again it answered otherwise" in found.sentence


def test_a_strategy_of_another_robot_is_refused(panda: hk.Robot, iiwa14: hk.Robot) -> None:
    law = hk.holonomic(hk.pose(iiwa14), hk.lock(2))
    tool = hk.with_tool(panda, [0.0, 0.0, 0.1])
    longer = hk.moore_penrose(hk.pose(tool))
    for other in (law, hk.controller(law, dt=0.01, q0=np.full(7, 0.3)), longer):
        with pytest.raises(ArgumentError, match="it is of another robot"):
            hk.audit(other, hk.pose(panda), **COARSE)
    same = hk.holonomic(hk.pose(hk.load("panda")), hk.lock(2))  # made anew, yet the same arm
    point = panda.pose(PANDA_START)[:3, 3]
    loops = [hk.circle(point, point - [0.05, 0, 0])]
    assert isinstance(
        hk.audit(same, hk.pose(panda), path=loops, q0=PANDA_START, dt=0.08, cycles=3), hk.analysis.audit.Audit
    )


@sampled(1, "name", ["planar-3r", "gen3", "irb140"])
def test_a_strategy_is_audited_from_a_start_of_its_own_where_none_is_given(name: str) -> None:
    """The strategy has its task; the start is within the joint limits, and the loops return there or do not."""
    robot = hk.load(name)
    task = hk.position(robot)
    drifts = hk.audit(hk.moore_penrose(task), dt=0.05, cycles=3)
    assert drifts.verdict is hk.analysis.audit.Repeatability.DRIFTS
    locks = hk.lock(*robot.joint_names[task.m :])
    repeats = hk.audit(hk.holonomic(task, locks), dt=0.02, cycles=3, tolerance=0.02)
    assert repeats.exit_code == 0 or repeats.verdict is hk.analysis.audit.Repeatability.BUT_FOR_THE_STEP
