"""The audit of laws that are curved in one plane of two task rows alone, and of laws that alternate between leaves."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

import holokin as hk
from black_boxes import locked, pull, turn
from conftest import PANDA_START, sampled
from holokin.analysis.audit.questions import AuditSetup, ask_plane, enclosed, plane_loop, worst_plane
from holokin.motion.control import as_control_law

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
    assert found.verdict is hk.analysis.audit.Repeatability.DRIFTS
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


def test_a_law_without_curvature_comes_home_and_the_planes_are_counted(panda: hk.Robot) -> None:
    found = hk.audit(locked(panda, 2), hk.pose(panda), **QUICK)
    assert found.verdict is hk.analysis.audit.Repeatability.REPEATS
    assert found.untested == ()
    assert [p.name for p in found.planes] == [f"{a}-{b}" for a, b in combinations(ROWS, 2)]
    assert found["planes"].sentence.startswith("15 of 15 tested")
    assert "whatever" not in str(found)


@pytest.mark.campaign
def test_of_loops_that_are_given_the_planes_without_area_are_named(panda: hk.Robot) -> None:
    """A circle in x-y that also nods about y in quadrature: x-y, x-wy and y-wy, with x-wy in phase, so without area."""
    point = panda.pose(PANDA_START)[:3, 3]
    law = curved(panda, 1, 2, 1.5)
    flat = hk.audit(law, hk.pose(panda), path=[hk.circle(point, point - [0.1, 0, 0])], **QUICK)
    assert flat.verdict is hk.analysis.audit.Repeatability.REPEATS
    assert len(flat.untested) == 14
    assert "y-z" in flat.sentence
    assert flat.to_dict()["untested"] == list(flat.untested)
    around = hk.circle(point, point - [0, 0.1, 0], normal=[1, 0, 0])
    both = hk.audit(law, hk.pose(panda), path=[hk.circle(point, point - [0.1, 0, 0]), around], **QUICK)
    assert both.verdict is hk.analysis.audit.Repeatability.DRIFTS
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
    assert found.verdict is hk.analysis.audit.Repeatability.UNKNOWN
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
            hk.analysis.audit.Repeatability.REPEATS,
            hk.analysis.audit.Repeatability.BUT_FOR_THE_STEP,
        )
        assert "has none" in found["planes"].sentence
    elif task.n > task.m:
        assert found.verdict is hk.analysis.audit.Repeatability.DRIFTS
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
    assert found.verdict is not hk.analysis.audit.Repeatability.REPEATS


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
    assert found.verdict is hk.analysis.audit.Repeatability.UNKNOWN
    assert "representation" in found["planes"].fault
    assert len(found.untested) == 15


def test_no_memory_is_said_of_the_calls_that_were_asked(panda: hk.Robot) -> None:
    calls = 0

    def law(q, pose, twist, dt):
        nonlocal calls
        calls += 1
        return locked(panda, 2)(q, pose, twist, dt)

    point = panda.pose(PANDA_START)[:3, 3]
    found = hk.audit(
        law, hk.pose(panda), path=[hk.circle(point, point - [0.05, 0, 0])], q0=PANDA_START, dt=0.05, cycles=3
    )
    asked = found["history"].metrics["calls"]
    assert found["history"].sentence.startswith(f"no memory found: {asked:.0f} calls were repeated")
    assert 100 < asked < calls
