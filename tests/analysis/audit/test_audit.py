"""The audit of black boxes: laws written here, in plain NumPy, that it has not seen."""

from __future__ import annotations

import json
import time
from itertools import combinations

import numpy as np
import pytest

import holokin as hk
from black_boxes import locked, pull, turn
from conftest import PANDA_START, R3_START, sampled
from holokin.analysis.audit import Audit, Repeatability
from holokin.analysis.audit.questions import AuditSetup, ask_plane, ask_small_loops, enclosed, plane_loop, worst_plane
from holokin.base.errors import ArgumentError, OpenPathError, StartError
from holokin.motion.control import as_control_law
from holokin.motion.control.control_law import Step

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
    assert found.verdict is Repeatability.DRIFTS
    assert found.exit_code == 1
    assert found["cycles, loop 1"].metrics["first"] == pytest.approx(0.1635, abs=2e-3)
    assert found["paths"].metrics["apart"] > 0.1
    assert "do not depend" in found["speed"].sentence
    assert "no memory" in found["history"].sentence
    assert "keeps" in found["start"].sentence
    assert "drift by the area of the loop" in found["small loops"].sentence
    assert found["small loops"].metrics["ratio"] == pytest.approx(4, abs=0.4)
    F = hk.curvature(hk.moore_penrose(hk.pose(panda)), PANDA_START)[:, 0, 1]
    assert "in x-y" in found["planes"].sentence
    assert found["small loops"].metrics["drift_per_area"] == pytest.approx(np.abs(F).max(), rel=0.15)


def test_a_posture_task_settles_but_its_joints_depend_on_way_and_speed(panda: hk.Robot) -> None:
    found = hk.audit(posture_task(panda, PANDA_START + 0.1, 1.0), hk.pose(panda), **COARSE)
    assert found.verdict is Repeatability.CONVERGES
    assert "the joints depend on the speed" in found["speed"].sentence
    assert "forgets" in found["start"].sentence
    assert "the drifts do not fit it" in found["small loops"].sentence
    assert found["paths"].metrics["apart"] > 1e-2


@pytest.mark.campaign
def test_a_locked_joint_comes_home(panda: hk.Robot) -> None:
    found = hk.audit(locked(panda, 2), hk.pose(panda), **FINER)
    assert found.verdict is Repeatability.REPEATS
    assert found.exit_code == 0
    assert "none drifts" in found["small loops"].sentence
    assert found["cycles, loop 1"].metrics["tracking_m"] < 1e-3


@pytest.mark.campaign
def test_a_law_with_a_state_is_seen_to_remember(panda: hk.Robot) -> None:
    found = hk.audit(sluggish(panda), hk.pose(panda), **COARSE)
    assert "remembers" in found["history"].sentence
    assert found.verdict is not Repeatability.REPEATS


@pytest.mark.campaign
def test_a_holonomic_law_in_coarse_steps_is_told_from_one_that_drifts(panda: hk.Robot) -> None:
    law = hk.motion.control.closed_loop(hk.holonomic(hk.pose(panda), hk.arm_angle()))
    coarse = hk.audit(law, hk.pose(panda), **FINER)
    assert coarse.verdict is Repeatability.BUT_FOR_THE_STEP
    assert coarse.exit_code == 1
    fine = hk.audit(law, hk.pose(panda), q0=PANDA_START, dt=0.002, cycles=3)
    assert fine.verdict is Repeatability.REPEATS


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
    assert free.verdict is Repeatability.DRIFTS


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
    assert found.verdict is Repeatability.UNKNOWN
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
    assert isinstance(hk.audit(same, hk.pose(panda), path=loops, q0=PANDA_START, dt=0.08, cycles=3), Audit)


@sampled(1, "name", ["planar-3r", "gen3", "irb140"])
def test_a_strategy_is_audited_from_a_start_of_its_own_where_none_is_given(name: str) -> None:
    """The strategy has its task; the start is within the joint limits, and the loops return there or do not."""
    robot = hk.load(name)
    task = hk.position(robot)
    drifts = hk.audit(hk.moore_penrose(task), dt=0.05, cycles=3)
    assert drifts.verdict is Repeatability.DRIFTS
    locks = hk.lock(*robot.joint_names[task.m :])
    repeats = hk.audit(hk.holonomic(task, locks), dt=0.02, cycles=3, tolerance=0.02)
    assert repeats.exit_code == 0 or repeats.verdict is Repeatability.BUT_FOR_THE_STEP


# --- Is a black box dq = G(q) x'? Reversed and slower loops and stairs tell, not the curvature at the start.


def rowed(robot: hk.Robot, joint: int, row) -> Step:
    """dq with J dq = x' and dq_joint = row(x, x'), in plain NumPy."""

    def law(q, pose, twist, dt):
        e = np.eye(robot.n)[joint]
        at = robot.pose(q)[:3, 3]
        return np.linalg.solve(np.vstack([robot.jacobian(q), e]), np.append(twist, row(at, twist)))

    return law


def asked(robot: hk.Robot, law: Step, q0: np.ndarray, plane: tuple[int, int]) -> tuple[str, dict[str, float]]:
    return ask_small_loops(AuditSetup(as_control_law(law), hk.pose(robot), q0, 0.02, 3, 2.0, 1e-3), plane)


@sampled(2, "seed", range(6))
def test_a_law_whose_curvature_is_zero_at_the_start_is_of_the_form_g_of_q(
    panda: hk.Robot, iiwa14: hk.Robot, seed: int
) -> None:
    """dq_j = k (x_a - x0_a)^p dx_b: curvature k p (x_a - x0_a)^(p - 1), which is 0 at the start for p > 1."""
    rng = np.random.default_rng(seed)
    robot = (panda, iiwa14)[seed % 2]
    q0 = PANDA_START + rng.uniform(-0.2, 0.2, 7)
    a, b = rng.choice(3, 2, replace=False)
    power, k = int(rng.integers(1, 5)), rng.uniform(0.3, 1.0)
    start = robot.pose(q0)[:3, 3].copy()

    def row(x, twist):
        return k * ((x[a] - start[a]) / 0.05) ** power * twist[b] / 0.5

    said, metrics = asked(robot, rowed(robot, int(rng.choice((0, 2, 4))), row), q0, (min(a, b), max(a, b)))
    assert "as every law dq = G(q) x' does" in said and "not of the form" not in said, said
    assert metrics["ratio"] == pytest.approx(2.0 ** (power + 1), rel=0.15)
    assert metrics["turned"] < 0.1 and metrics["hurried"] < 0.01


@sampled(
    4,
    ("kind", "changed"),
    [("length", "turned"), ("time", "hurried"), ("odd", "stairs"), ("curved", "stairs"), ("square", "turned")],
)
@sampled(1, "seed", range(2))
def test_a_law_that_is_not_linear_in_the_twist_is_not_of_that_form(
    panda: hk.Robot, kind: str, changed: str, seed: int
) -> None:
    """Each has dq_j = h(x'), the odd ones linear along the axes, so that loops of four sides look like a strategy's."""
    k = np.random.default_rng(seed).uniform(0.5, 1.5)
    x0 = panda.pose(PANDA_START)[0, 3]
    rows = {
        "length": lambda x, v: k * np.linalg.norm(v[:3]),
        "time": lambda x, v: 0.02 * k,
        "odd": lambda x, v: 10 * k * (x[0] - x0) * v[1] ** 3 / max(v[:2] @ v[:2], 1e-12),
        "curved": lambda x, v: 200 * k * (x[0] - x0) ** 2 * v[1] * abs(v[1]) / max(np.linalg.norm(v[:2]), 1e-9),
        "square": lambda x, v: 20 * k * (v[:3] @ v[:3]),
    }
    said, metrics = asked(panda, rowed(panda, 2, rows[kind]), PANDA_START, (0, 1))
    assert "not of the form dq = G(q) x'" in said, said
    assert metrics[changed] > {"turned": 0.5, "hurried": 0.05, "stairs": 0.05}[changed]


@sampled(1, "width", [0.02, 0.018, 0.03])
def test_a_curvature_that_changes_its_sign_within_the_loop_is_no_other_form(panda: hk.Robot, width: float) -> None:
    x0 = panda.pose(PANDA_START)[0, 3]
    law = rowed(panda, 2, lambda x, v: np.sin((x[0] - x0) / width) * v[1])
    said, metrics = asked(panda, law, PANDA_START, (0, 1))
    assert "as every law dq = G(q) x' does" in said, said
    assert metrics["ratio"] < 2.8 and "changes within the loops" in said


# --- The audit of laws that are curved in one plane of two task rows alone, and of laws that alternate between leaves.


QUICK = {"q0": PANDA_START, "dt": 0.06, "cycles": 3}
ROWS = ("x", "y", "z", "wx", "wy", "wz")


def curved(robot: hk.Robot, i: int, j: int, kappa: float):
    """Joint 3 moves by kappa (x_i dx_j - x_j dx_i) / 2, x the tool's way from its start: curved in that plane alone."""
    home = robot.pose(PANDA_START)

    def law(q, pose, twist, dt):
        here = robot.pose(q)
        x = np.append(here[:3, 3] - home[:3, 3], turn(here[:3, :3] @ home[:3, :3].T))
        v = pull(robot, q, pose, dt)
        return np.linalg.solve(
            np.vstack([robot.jacobian(q), np.eye(7)[2]]), np.append(v, kappa * (x[i] * v[j] - x[j] * v[i]) / 2)
        )

    return law


@pytest.mark.campaign
def test_a_law_curved_in_the_yz_plane_is_found(panda: hk.Robot) -> None:
    """A circle of 0.1 m there turns joint 3 by 1.5 times its area, 0.047 rad; no other plane turns it."""
    found = hk.audit(curved(panda, 1, 2, 1.5), hk.pose(panda), **QUICK)
    assert found.verdict is Repeatability.DRIFTS
    assert found.exit_code == 1
    assert "in y-z" in found["planes"].sentence
    assert found["cycles in y-z"].metrics["first"] > 0.015
    assert found["cycles, loop 1"].metrics["first"] < 1e-3
    assert found["cycles, loop 2"].metrics["first"] < 1e-3


@pytest.mark.campaign
@sampled(2, ("i", "j"), [(0, 2), (1, 2), (0, 5), (2, 3), (3, 4), (3, 5)])
def test_curvature_in_any_one_plane_is_found_and_named(panda: hk.Robot, i: int, j: int) -> None:
    """Joint 3 then drifts by kappa times area, so that is the least that the largest joint does."""
    task = hk.pose(panda)
    bench = AuditSetup(as_control_law(curved(panda, i, j, 1.5)), task, PANDA_START, 0.04, 3, 2.0, 1e-3)
    planes = [ask_plane(bench, plane) for plane in combinations(range(6), 2)]
    worst = worst_plane(planes)
    assert worst is not None
    assert worst.name == f"{ROWS[i]}-{ROWS[j]}"
    assert worst.drift > 1e-3
    assert worst.per_area > 0.9 * 1.5
    moved = bench.run(bench.loop(worst.plane)).drift()[0, 2]
    a, b = (0.1 if k < 3 else 0.2 for k in worst.plane)
    assert abs(moved) == pytest.approx(1.5 * a * b, rel=0.05)


def test_a_law_without_curvature_comes_home_and_the_planes_and_repeated_calls_are_counted(panda: hk.Robot) -> None:
    calls, sound = 0, locked(panda, 2)

    def law(q, pose, twist, dt):
        nonlocal calls
        calls += 1
        return sound(q, pose, twist, dt)

    found = hk.audit(law, hk.pose(panda), **QUICK)
    assert (found.verdict, found.untested) == (Repeatability.REPEATS, ())
    assert [p.name for p in found.planes] == [f"{a}-{b}" for a, b in combinations(ROWS, 2)]
    assert found["planes"].sentence.startswith("15 of 15 tested")
    assert "whatever" not in str(found)
    repeated = found["history"].metrics["calls"]
    assert found["history"].sentence.startswith(f"no memory found: {repeated:.0f} calls were repeated")
    assert 100 < repeated < calls
    facts = json.loads(json.dumps(found.to_dict()))
    assert facts["verdict"] == "repeats"
    assert [f["question"] for f in facts["findings"]][:2] == ["cycles, loop 1", "cycles, loop 2"]
    with pytest.raises(ArgumentError):
        found["weather"]


@pytest.mark.campaign
def test_of_loops_that_are_given_the_planes_without_area_are_named(panda: hk.Robot) -> None:
    """A circle in x-y that also nods about y in quadrature: x-y, x-wy and y-wy, with x-wy in phase, so without area."""
    point = panda.pose(PANDA_START)[:3, 3]
    law = curved(panda, 1, 2, 1.5)
    flat = hk.audit(law, hk.pose(panda), path=[hk.circle(point, point - [0.1, 0, 0])], **QUICK)
    assert flat.verdict is Repeatability.REPEATS
    assert len(flat.untested) == 14
    assert "y-z" in flat.sentence
    assert flat.to_dict()["untested"] == list(flat.untested)
    around = hk.circle(point, point - [0, 0.1, 0], normal=[1, 0, 0])
    both = hk.audit(law, hk.pose(panda), path=[hk.circle(point, point - [0.1, 0, 0]), around], **QUICK)
    assert both.verdict is Repeatability.DRIFTS
    assert "y-z" not in both.untested and "x-z" in both.untested
    eight = hk.path.join(hk.circle(point, point - [0.07, 0, 0]), hk.circle(point, point + [0.07, 0, 0], clockwise=True))
    nothing = hk.audit(law, hk.pose(panda), path=[eight], **QUICK)
    assert len(nothing.untested) == 15, "the two halves of an eight undo each other"


def test_a_plane_that_the_tool_does_not_follow_is_not_tested(panda: hk.Robot) -> None:
    """A law for the position alone, audited as one for the pose, does not turn the tool."""

    def law(q, pose, twist, dt):
        J, v = panda.jacobian(q)[:3], pull(panda, q, pose, dt)[:3]
        return np.linalg.solve(np.vstack([J, np.eye(7)[[2, 4, 5, 6]]]), np.append(v, np.zeros(4)))

    found = hk.audit(law, hk.pose(panda), **QUICK)
    assert {"wx-wy", "wx-wz", "wy-wz", "x-wx"} <= set(found.untested)
    assert "did not follow" in found["planes"].sentence


def test_a_law_that_stands_still_is_not_said_to_come_home(panda: hk.Robot) -> None:
    found = hk.audit(lambda q, pose, twist, dt: np.zeros(7), hk.pose(panda), **QUICK)
    assert found.verdict is Repeatability.UNKNOWN
    assert found.exit_code == 2
    assert "did not follow" in found["cycles, loop 1"].fault


@pytest.mark.campaign
@sampled(
    3,
    ("robot", "make", "start"),
    [
        ("panda", hk.position, PANDA_START),
        ("panda", lambda r: hk.position(r, rows=[1, 2]), PANDA_START),
        ("panda", lambda r: hk.pose(r, "zyz"), [0.1, -0.4, 0.2, -2.0, 0.3, 0.9, 0.5]),
        ("panda", lambda r: hk.pose(r, "rpy", rows=[0, 2, 4]), PANDA_START),
        ("panda", lambda r: hk.pose(r, "rotation-vector"), PANDA_START),
        ("panda", lambda r: hk.pose(r, rows=[3, 4, 5]), PANDA_START),
        ("panda", lambda r: hk.pose(r, "rpy", rows=[2]), PANDA_START),
        ("planar-3r", hk.position, [0.3, 0.8, 0.5]),
        ("planar-3r", hk.pose, [0.3, 0.8, 0.5]),  # not redundant, and some loops lead into a singularity
    ],
)
def test_every_plane_of_every_task_is_gone_round(robot: str, make, start) -> None:
    """Each loop encloses a side by a side in its own plane, and elsewhere a part of it of the size of the loop."""
    task = make(hk.load(robot))
    tool = task.robot.pose(start)
    for i, j in combinations(range(task.m), 2):
        loop = plane_loop(task, tool[:3, 3], tool[:3, :3], i, j)
        assert loop.closed
        areas = np.abs(enclosed(task, loop, tool[:3, :3]))
        assert areas[i, j] == pytest.approx(1, abs=0.2)
        areas[i, j] = areas[j, i] = 0.0
        assert areas.max() < 0.4
    pseudo_inverse = hk.moore_penrose(task)
    law = hk.motion.control.closed_loop(pseudo_inverse)
    found = hk.audit(law, task, q0=start, dt=0.06, cycles=3)
    assert found.untested == ()
    assert len(found.planes) == task.m * (task.m - 1) // 2
    if task.m == 1:
        assert found.verdict in (
            Repeatability.REPEATS,
            Repeatability.BUT_FOR_THE_STEP,
        )
        assert "has none" in found["planes"].sentence
    elif task.n > task.m:
        assert found.verdict is Repeatability.DRIFTS
        for p in found.planes:
            loop = plane_loop(task, tool[:3, 3], tool[:3, :3], *p.plane, p.size)
            followed = hk.drift(pseudo_inverse, loop, start, limits=False).largest[0]
            assert p.drift == pytest.approx(followed, rel=0.05, abs=1e-4), p.name


def between_runs(robot: hk.Robot, every: int) -> hk.motion.control.ControlLaw:
    """Joint 3 stands in so many runs, and joint 1 in the next."""
    begun = 0

    def begin(q0):
        nonlocal begun
        begun += 1
        return locked(robot, 0 if begun // every % 2 else 2)

    return hk.motion.control.ControlLaw("alternates between runs", begin)


def between_calls(robot: hk.Robot, every: int) -> hk.motion.control.ControlLaw:
    """The joint that stands changes every so many calls, and runs do not matter."""
    calls = 0
    laws = (locked(robot, 2), locked(robot, 0))

    def law(q, pose, twist, dt):
        nonlocal calls
        calls += 1
        return laws[calls // every % 2](q, pose, twist, dt)

    return hk.motion.control.ControlLaw("alternates between calls", lambda q0: law)


@pytest.mark.campaign
@sampled(
    2,
    ("make", "every"),
    [(between_runs, 1), (between_runs, 8), (between_calls, 1), (between_calls, 7), (between_calls, 400)],
)
def test_a_law_that_alternates_between_leaves_is_seen_to(panda: hk.Robot, make, every: int) -> None:
    """A period longer than what is asked again cannot be told from memory, but is seen."""
    found = hk.audit(make(panda, every), hk.pose(panda), **QUICK)
    said = found["history"].sentence
    assert said.startswith("alternates") or (every == 400 and said.startswith("remembers"))
    assert found["history"].metrics["otherwise"] > 0
    assert found.verdict is not Repeatability.REPEATS


def test_a_law_tied_to_the_start_of_its_run_is_told_from_one_that_remembers(panda: hk.Robot) -> None:
    found = hk.audit(hk.motion.control.repetitive_motion(hk.pose(panda), 4.0), hk.pose(panda), **QUICK)
    assert found["history"].sentence.startswith("remembers where its run began")
    assert found["history"].metrics["apart"] == 0


@pytest.mark.parametrize("given", [True, False])
def test_a_start_at_which_the_angles_are_singular_is_told(irb140: hk.Robot, given: bool) -> None:
    """The tool points down: theta of ZYZ is pi, while the Jacobian itself is sound."""
    q0 = np.deg2rad([0.0, 20.0, 0.0, 0.0, -20.0, 0.0])
    task = hk.pose(irb140, "zyz")
    point = irb140.pose(q0)[:3, 3]
    loops = [hk.circle(point, point - [0.1, 0, 0])] if given else None
    found = hk.audit(hk.moore_penrose(task), task, loops, q0=q0, cycles=3, dt=0.04)
    assert found.verdict is Repeatability.UNKNOWN
    assert "representation" in found["planes"].fault
    assert len(found.untested) == 15


def test_a_law_that_is_too_slow_is_refused_with_the_time_of_its_step(planar_3r: hk.Robot) -> None:
    def slow(q, pose, twist, dt):
        time.sleep(0.02)
        return np.zeros(3)

    with pytest.raises(ArgumentError, match=r"takes about .* min: build tasks, .* once") as told:
        hk.audit(slow, hk.position(planar_3r), q0=R3_START)
    each = float(str(told.value).split("a step of the law takes ")[1].split(" ms")[0])
    assert 19 <= each <= 200


def test_an_audit_ends_when_it_should_also_where_a_law_turns_slow(planar_3r: hk.Robot) -> None:
    """The law is fast while it is timed. What is not asked any more is said, and nothing is concluded from the rest."""
    law, calls, heard = pseudo_inverse_of_position(planar_3r), 0, []

    def tiring(q, pose, twist, dt):
        nonlocal calls
        calls += 1
        time.sleep(0.1 if calls > 60 else 0.0)
        return law(q, pose, twist, dt)

    task = hk.position(planar_3r)
    loop = hk.circle(task.pose(R3_START)[:3, 3], task.pose(R3_START)[:3, 3] - [0.02, 0, 0])
    began = time.monotonic()
    found = hk.audit(tiring, task, loop, R3_START, dt=0.2, cycles=3, tolerance=1.0, seconds=3.0, progress=heard.append)
    assert time.monotonic() - began < 20
    assert found.verdict is Repeatability.UNKNOWN and "not asked within the 3 s" in str(found)
    assert "a step of the law takes" in heard[0] and {"cycles", "history", "small loops"} <= {*heard}


def pseudo_inverse_of_position(robot: hk.Robot):
    """dq = J^+ x' of the point in the plane."""

    def law(q, pose, twist, dt):
        return np.linalg.pinv(robot.jacobian(q)[:2]) @ twist[:2]

    return law
