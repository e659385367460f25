"""The rivals: what is measured of joints that are known, the paths that all get, and a library that fails."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from benchmarks import rivals
from benchmarks.league.courses import write_arm
from benchmarks.league.played import WORKERS, Entry
from benchmarks.rivals import Mark, Process, Run, Stopped, Walk, marked, right, rivals_text, turned, walked
from scipy.spatial.transform import Rotation

import holokin as hk

ROBOT = hk.load("iiwa14")
START = np.array([0.1, 0.6, 0.2, -1.4, 0.1, 1.1, 0.0])


def test_an_answer_counts_if_the_tool_is_at_its_pose_and_the_joints_are_within_their_limits() -> None:
    """The axis of joint 7 goes through the tool: its turn is the angle of joint 7."""
    near, far, beyond, none = START.copy(), START.copy(), START.copy(), START * np.nan
    near[6], far[6], beyond[6] = 0.9e-5, 1.1e-5, 2 * np.pi
    q, poses = np.array([near, far, beyond, none]), np.repeat(ROBOT.pose(START)[None], 4, axis=0)
    assert right(ROBOT, q, poses, 1e-5).tolist() == [True, False, False, False]
    assert right(ROBOT, turned(ROBOT, q), poses, 1e-5).tolist() == [True, False, True, False]
    moved = poses.copy()
    moved[:, 2, 3] += 1.1e-5
    assert not right(ROBOT, q, moved, 1e-5).any()


def test_a_walk_is_even_without_a_jump_and_comes_home_where_its_joints_do() -> None:
    """Joint 7 turns back and forth; then it comes back 0.1 rad further each time, at the turn of the tool."""
    angles = np.concatenate([np.linspace(0, 1, 21), np.linspace(1, 0, 21)[1:]])
    there = START + np.concatenate([angles, angles[1:]])[:, None] * np.eye(7)[6]
    found = walked(ROBOT, there, ROBOT.pose(there), 1e-5, 2)
    assert (found.whole, found.even, found.step) == (True, True, pytest.approx(0.05))
    assert max(found.away(1), found.away(2)) == 0
    wound = there + np.linspace(0, 0.2, len(there))[:, None] * np.eye(7)[6]
    found = walked(ROBOT, wound, ROBOT.pose(wound), 1e-5, 2)
    assert (found.away(1), found.away(2)) == pytest.approx((0.1, 0.1))
    jumped = there[::8]
    found = walked(ROBOT, jumped, ROBOT.pose(jumped), 1e-5, 2)
    assert (found.whole, found.even, found.step) == (True, False, pytest.approx(0.4))
    assert not walked(ROBOT, wound, ROBOT.pose(there), 1e-5, 2).whole


def test_legs_and_circles_come_back_in_samples_of_two_millimetres() -> None:
    rng, first = np.random.default_rng(0), ROBOT.pose(START)
    leg, circle = rivals.leg(first, rng), rivals.circle(first, rng)
    for path in (leg, circle):
        steps = np.linalg.norm(np.diff(path[:, :3, 3], axis=0), axis=1)
        assert steps == pytest.approx(0.002, rel=1e-3)
        assert np.array_equal(path[0], path[-1])
        assert np.array_equal(path[0], first)
    assert np.linalg.norm(leg[100, :3, 3] - first[:3, 3]) == pytest.approx(0.2)
    assert Rotation.from_matrix(leg[:, :3, :3] @ first[:3, :3].T).magnitude().argmax() == 100
    assert np.array_equal(circle[314], first)
    assert np.linalg.norm(circle[157, :3, 3] - first[:3, 3]) == pytest.approx(0.2)


@pytest.mark.parametrize("name", ["openarm-left", "gen3"])
def test_the_axes_that_libraries_get_are_the_arm(name: str) -> None:
    """By Rodrigues' formula: from each axis a step to the next."""
    robot, arrays = hk.load(name), rivals.exponentials(hk.load(name))
    q = np.random.default_rng(0).uniform(-1, 1, robot.n)
    pose = np.eye(4)
    for axis, step, angle in zip(arrays["check/axes"], arrays["check/steps"], q, strict=False):
        pose[:3, 3] += pose[:3, :3] @ step
        pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec(angle * axis).as_matrix()
    pose[:3, 3] += pose[:3, :3] @ arrays["check/steps"][-1]
    np.testing.assert_allclose(pose @ arrays["check/turn"], robot.pose(q), atol=1e-12)


def test_a_pose_is_reached_if_a_posture_of_it_is_within_the_limits() -> None:
    """A joint is turned past its limit: the elbow of an iiwa cannot come as near to the shoulder."""
    folded = START.copy()
    folded[3] = ROBOT.lower[3] - 0.1
    assert rivals.reached(ROBOT, ROBOT.pose(START)[None])
    assert not rivals.reached(ROBOT, ROBOT.pose(np.array([START, folded])))


def test_the_page_says_where_others_are_better_and_what_is_not_measured() -> None:
    home, far = (Walk(True, 0.01, np.array([[0.0], [away], [away]])) for away in (0.0, 0.3))
    broken = replace(home, whole=False)
    ours = Mark("holokin", "a", "panda", "s", 3, np.full(4, 2e-6), (home, broken), (home,), np.full(9, 1e-6))
    other = Mark("ssik", "b", "panda", "t", None, np.zeros(0), (home, far), (far,), np.full(9, 3e-6))
    text = "\n".join(rivals_text(Run([ours, other], {"ssik": "8"}, ["EAIK on the Gen3 (none)"])))
    for line in (
        "|holokin, a|3: 2 (2)|",
        "|holokin, a|1 of 2|0|1 (0e+00)|1 of 1|0e+00, 0e+00|1 to 1|",
        "|ssik, b|2 of 2|0|1 (3e-01)|1 of 1|3e-01, 0e+00|3 to 3|",
        "Not measured: EAIK on the Gen3 (none).",
    ):
        assert line in text.splitlines()
    assert [*rivals.better([ours, other])] == [
        "None find more poses without a start than holokin.",
        "None take less time for it than holokin.",
        "None take less time for a step than holokin.",
        "More legs are whole with ssik 2, against 1.",
        "None has more whole circles.",
    ]


LIBRARY = """
import numpy as np
from worker_loop import Way, agrees, answer_in_turns

def ways(arm):
    q = arm.check["q"][0]
    if arm.name == "other":
        agrees(arm, lambda q: np.eye(4))
    yield Way("one", "s", lambda pose: q)
    yield Way("next", "s", follow=lambda start: lambda pose, q: None if pose[0, 3] < 0 else q + 1e-7)

answer_in_turns(ways, ("numpy",))
"""


def test_a_library_answers_in_turns_and_its_faults_and_its_end_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script, course = tmp_path / "a_library.py", tmp_path / "course"
    script.write_text(LIBRARY, "utf-8")
    course.mkdir()
    poses = np.repeat(ROBOT.pose(START)[None], 20, axis=0)
    leg = {f"leg {k}/start": START for k in (0, 1)} | {f"leg {k}/poses": poses[:3].copy() for k in (0, 1)}
    leg["leg 1/poses"][1, 0, 3] = -1.0
    poses[1:, 2, 3] += 1
    told = [write_arm(course, name, ROBOT, START, {"poses/poses": poses} | leg) for name in ("iiwa14", "other")]
    (course / "course.json").write_text(json.dumps(told), "utf-8")
    monkeypatch.setenv("PYTHONPATH", str(WORKERS))
    process = Process(Entry("mine", (), script), Path(sys.executable), course, tmp_path / "answers", None)
    reply = process.tell("arm iiwa14")
    assert [way[0] for way in reply["ways"]] == ["one", "next"]
    for turn in range(10):
        process.tell(f"turn {turn} 10")
    process.tell("keep")
    one, following = marked("mine", "iiwa14", reply["ways"], course, tmp_path / "answers")
    assert (one.found, len(one.seconds), following.found) == (1, 20, None)
    assert [walk.whole for walk in (*one.legs, *following.legs)] == [True, False] * 2
    assert len(following.step_seconds) == 4  # three of the first leg, one until there is no answer
    assert "differ from ours" in process.tell("arm other")["fault"]
    with pytest.raises(Stopped, match="KeyError: 'nobody'"):
        process.tell("arm nobody")
    process.close()
