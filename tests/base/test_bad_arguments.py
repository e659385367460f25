"""What strategies that do not fit, arguments that are no numbers and singular postures get, job or API."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import (
    PANDA_START,
    PPR_CENTER,
    PPR_RADIUS,
    PPR_START,
    Command,
    assert_refused,
    assert_untouched,
    write_job,
)
from holokin.errors import (
    ArgumentError,
    ConstraintRowsError,
    NotFiniteError,
    ShapeError,
    SingularityError,
    SingularityKind,
    TaskTooLargeError,
    UnknownNameError,
)
from holokin.tasks.task_kinds import FrameTask

PLANAR = {
    "robot": '[robot]\nname = "planar-3r"\n',
    "path": '[path]\nkind = "circle"\ncenter = [-0.1, 0]\nrelative = true\nsamples = 20\n',
}


# --- strategies that do not fit -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("strategy", "words"),
    [
        ('kind = "lock"\njoints = ["q1", "q2"]\n', ("2 rows", "n = 3", "m = 2", "exactly r = n - m = 1")),
        ('kind = "custom"\ng = ["q1", "q2"]\n', ("2 rows", "exactly r = n - m = 1")),
        ('kind = "coupled"\ngain = 1\n', ("3 rows", "exactly r = n - m = 1")),
        ('kind = "linear"\nmatrix = [[1, 2]]\n', ("(1, 2)", "(1, 3)", "q1, q2, q3")),
        ('kind = "linear"\nmatrix = [[1, 2, 3], [1, 2]]\n', ("[strategies.s.matrix]", "one length")),
        ('kind = "null-basis"\nN_G = [[1, 0], [0, 1]]\n', ("N_G of 's'", "(2, 2)", "(3, 2)")),
        ('kind = "null-basis"\nN_G = [[1, 0], [0], [0, 1]]\n', ("[strategies.s.N_G]", "one length")),
        ('kind = "weighted"\nweight = [[1, 0], [0, 1]]\n', ("weight", "(3, 3)")),
        ('kind = "weighted"\nweight = []\n', ("[strategies.s.weight]",)),
        ('kind = "pfaffian"\nA = [["q1", "q2"]]\n', ("'s'", "(1, 2)", "(1, 3)")),
        ('kind = "custom"\ng = ["q1 + q9"]\n', ("'q1 + q9'", "the name 'q9' is unknown")),
        ('kind = "custom"\ng = ["q1 +"]\n', ("'q1 +'", "invalid syntax")),
        ('kind = "custom"\ng = ["open(1)"]\n', ("'open(1)'", "not arithmetic")),
        ('kind = "custom"\ng = ["1"]\n', ("singular",)),
    ],
)
def test_a_strategy_that_does_not_fit_the_robot_is_refused(
    holokin: Command, tmp_path: Path, out: Path, strategy: str, words: tuple[str, ...]
) -> None:
    file = write_job(tmp_path, strategies=f"[strategies.s]\n{strategy}")
    assert_refused(holokin("run", file, "--out", out), *words)
    assert_untouched(out)


def test_a_task_with_more_rows_than_joints_is_refused_with_both_numbers(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    arm = 'source = "made up"\n[[joints]]\na = 1\nalpha_deg = 90\n[[joints]]\na = 1\n'
    (tmp_path / "two.toml").write_text(arm)
    job = {"robot": '[robot]\nname = "two.toml"\n', "start": "[start]\nq = [0.1, 0.2]\n"}
    line = '[path]\nkind = "polyline"\npoints = [[0, 0, 0], [0.05, 0, 0]]\nrelative = true\nsamples = 20\n'
    outcome = holokin("run", write_job(tmp_path, path=line, **job), "--out", out)
    assert_refused(outcome, "m = 3 rows", "n = 2 joints", "at most 2 rows")
    assert_untouched(out)
    with pytest.raises(TaskTooLargeError):
        hk.position(hk.load(tmp_path / "two.toml"))
    assert hk.position(hk.load(tmp_path / "two.toml"), rows=[0, 2]).m == 2  # the cure that the message names


def test_constraint_rows_must_make_up_for_the_missing_task_rows(panda: hk.Robot, ppr: hk.Robot) -> None:
    for robot, task, g in (
        (ppr, hk.position(ppr), hk.linear(np.eye(3)[:2])),
        (panda, hk.pose(panda), hk.lock(0, 1)),
        (panda, hk.position(panda), hk.lock("panda_joint1")),
        (panda, hk.position(panda), hk.constraints.stack(hk.lock(0, 1), hk.linear(np.eye(7)[:1]), hk.lock(2, 3))),
    ):
        with pytest.raises(ConstraintRowsError) as caught:
            hk.holonomic(task, g)
        assert (caught.value.rows, caught.value.n, caught.value.m) == (g.rows, robot.n, task.m)
        assert f"exactly r = n - m = {robot.n - task.m}" in str(caught.value)
    with pytest.raises(ConstraintRowsError, match="no joint is left for it: keep fewer rows"):
        hk.holonomic(hk.pose(hk.load("irb140")), hk.lock(2))
    with pytest.raises(ShapeError, match="rows= must match"):
        hk.holonomic(hk.position(ppr), hk.custom(lambda q: [q[0], q[1]], rows=1))


@pytest.mark.parametrize(
    ("call", "error"),
    [
        (lambda task: hk.moore_penrose(task)([np.nan, 0, 0]), NotFiniteError),
        (lambda task: hk.moore_penrose(task)([0.0, 0.0]), ShapeError),
        (lambda task: hk.moore_penrose(task).batch(np.zeros(3)), ShapeError),
        (lambda task: hk.moore_penrose(task).batch(np.full((2, 3), np.inf)), NotFiniteError),
        (lambda task: task([0.0, np.inf, 0.0]), NotFiniteError),
        (lambda task: task.jacobian(["a", "b", "c"]), ArgumentError),
        (lambda task: hk.linear([[1.0, np.nan, 0.0]]), NotFiniteError),
        (lambda task: hk.coupled(np.nan), NotFiniteError),
        (lambda task: hk.coupled(np.eye(2)), ShapeError),
        (lambda task: hk.weighted(task, np.diag([1.0, 1.0, -1.0])), ArgumentError),
        (lambda task: hk.weighted(task, np.diag([1.0, np.inf, 1.0])), NotFiniteError),
        (lambda task: hk.circle([0, np.nan], [0, 1]), NotFiniteError),
        (lambda task: hk.line([0, 0], [np.inf, 1]), NotFiniteError),
        (lambda task: hk.polyline([[0, 0], [1, 1]], speed=np.nan), ArgumentError),
        (lambda task: hk.holonomic(task, hk.lock("q7")), UnknownNameError),
    ],
)
def test_the_api_refuses_what_is_no_number_or_of_the_wrong_shape(
    ppr: hk.Robot, call: Callable[[hk.Task], object], error: type[Exception]
) -> None:
    with pytest.raises(error) as caught:
        call(hk.position(ppr))
    assert "\n" not in str(caught.value)


def test_following_refuses_bad_numbers_before_it_moves(ppr: hk.Robot) -> None:
    strategy = hk.moore_penrose(hk.position(ppr))
    round_trip = hk.circle(PPR_CENTER + [PPR_RADIUS, 0, 0], PPR_CENTER)
    with pytest.raises(NotFiniteError, match="the start posture"):
        hk.follow(strategy, round_trip, [np.nan, 0.0, 0.0])
    with pytest.raises(ShapeError, match="the start posture"):
        hk.follow(strategy, round_trip, [0.0, 0.0])
    for arguments in ({"samples": 0}, {"cycles": 0}, {"cycles": 1.5}, {"method": "magic"}, {"method": "leaf"}):
        with pytest.raises(ArgumentError):
            hk.follow(strategy, round_trip, PPR_START, **arguments)


# --- singular postures ----------------------------------------------------------------------------------------


def test_a_stretched_arm_is_a_kinematic_singularity(planar_3r: hk.Robot) -> None:
    task = hk.position(planar_3r)
    stretched = np.array([0.3, 0.0, 0.0])
    assert np.linalg.matrix_rank(task.jacobian(stretched)) == 1
    for strategy in (
        hk.moore_penrose(task),
        hk.weighted(task, np.diag([1.0, 2.0, 3.0])),
        hk.holonomic(task, hk.lock(0)),
    ):
        with pytest.raises(SingularityError) as caught:
            strategy(stretched)
        assert caught.value.kind is SingularityKind.KINEMATIC
        assert caught.value.q == tuple(stretched)
        assert "the task Jacobian J loses rank" in str(caught.value)


def test_a_locked_joint_that_the_self_motion_leaves_still_is_an_algorithmic_singularity(planar_3r: hk.Robot) -> None:
    task = hk.position(planar_3r)
    q = np.array([0.3, 0.7, 0.0])  # the last two links in line: turning them does not need joint 1
    J = task.jacobian(q)
    assert np.linalg.cond(J) < 10
    assert abs(task.null_space(q)[0, 0]) < 1e-15
    hk.moore_penrose(task)(q)  # the posture itself is sound
    with pytest.raises(SingularityError) as caught:
        hk.holonomic(task, hk.lock(0))(q)
    assert caught.value.kind is SingularityKind.ALGORITHMIC
    assert "J has full rank" in str(caught.value)


def test_a_tool_pointing_straight_down_is_a_representation_singularity_of_zyz(panda: hk.Robot) -> None:
    q = np.array([0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0])
    assert abs(panda.pose(q)[2, 2] + 1) < 1e-15  # theta = pi
    twist = hk.pose(panda)
    assert np.linalg.cond(twist.jacobian(q)) < 100
    hk.moore_penrose(twist)(q)  # neither the arm nor the strategy is singular
    for strategy in (
        hk.moore_penrose(hk.pose(panda, "zyz")),
        hk.holonomic(hk.position(panda), hk.constraints.stack(hk.coupled(1.0, "zyz"), hk.lock(2))),
    ):
        with pytest.raises(SingularityError) as caught:
            strategy(q)
        assert caught.value.kind is SingularityKind.REPRESENTATION
        strategy(PANDA_START + [0, 0, 0, 0, 0, -0.5, 0])  # elsewhere it is sound


@pytest.mark.parametrize(
    ("spoilt", "kind"),
    [
        (PLANAR | {"start": "[start]\nq = [0.3, 0.0, 0.0]\n"}, "kinematic"),
        (
            PLANAR
            | {
                "start": "[start]\nq = [0.3, 0.7, 0.0]\n",
                "strategies": '[strategies.held]\nkind = "lock"\njoints = ["q1"]\n',
            },
            "algorithmic",
        ),
        (
            {
                "robot": '[robot]\nname = "panda"\n',
                "task": '[task]\nkind = "pose"\norientation = "zyz"\n',
                "start": "[start]\nq = [0, 0, 0, -1.5, 0, 1.5, 0]\n",
                "path": '[path]\nkind = "circle"\ncenter = [-0.1, 0, 0]\nrelative = true\nsamples = 20\n',
            },
            "representation",
        ),
    ],
)
def test_a_singular_start_is_refused_with_its_kind(
    holokin: Command, tmp_path: Path, out: Path, spoilt: dict[str, str], kind: str
) -> None:
    outcome = holokin("run", write_job(tmp_path, **spoilt), "--out", out)
    assert_refused(outcome, "job.toml: [strategies.", f"] {kind} singularity of", "at q = [")
    assert_untouched(out)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda _r, _t: hk.moore_penrose("panda"), "task is 'panda'; give a Task"),
        (lambda r, _t: hk.pose(r, tip=["hand"]), r"tip is \['hand'\]; give text or None"),
        (lambda _r, t: hk.constraints.stack(t, t), "give a Constraint"),
        (lambda r, _t: FrameTask(r, "twist", ("x",), np.eye(3)), "rows of a task"),
        (lambda r, _t: FrameTask(r, None, (0, 9), np.eye(3)), "each of 0 to 5 at most once"),
        (lambda r, _t: FrameTask(r, "quaternion", (0, 1), np.eye(3)), "unknown orientation"),
        (lambda r, _t: FrameTask(r, "rpy", (0, 1), np.eye(2)), "reference of a task"),
        (lambda _r, _t: FrameTask("panda", None, (0, 1), np.eye(3)), "robot of a task is 'panda'; give a Robot"),
        (lambda _r, _t: type("Mine", (hk.Task,), {}), "tasks are final"),
    ],
)
def test_what_is_no_task_and_no_constraint_is_told_in_one_sentence(
    panda: hk.Robot, call: Callable[[hk.Robot, hk.Task], object], words: str
) -> None:
    with pytest.raises(hk.HolokinError, match=words):
        call(panda, hk.pose(panda))
