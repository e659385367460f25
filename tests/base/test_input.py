"""What odd input gets: counts, points, times, locked joints, names in formulas; keys, values and kinds of a job."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
from conftest import (
    PANDA_START,
    PPR_CENTER,
    PPR_RADIUS,
    PPR_START,
    SOUND,
    Command,
    assert_refused,
    assert_untouched,
    sampled,
    urdf,
    write_job,
)
from holokin.app.job import open_job, read_job
from holokin.app.job.strategy_tables import MoorePenrose
from holokin.base.errors import (
    ArgumentError,
    ExpressionError,
    NotFiniteError,
    OutOfReachError,
    RowsError,
    ShapeError,
    SingularityError,
    SingularityKind,
)
from holokin.path.workspaces import Box, Cylinder, Sphere
from holokin.symbolic import SX

# --- in Python ------------------------------------------------------------------------------------------------


def three_bars(name: str = "q3", lower: float = -np.pi, upper: float = np.pi) -> hk.Robot:
    """A planar arm of three bars of 1 m, of whose last joint the name and the limits are given."""
    rows = [{"a": 1.0, "lower": -3.0, "upper": 3.0, "joint": joint} for joint in ("q1", "q2")]
    return hk.from_dh([*rows, {"a": 1.0, "lower": lower, "upper": upper, "joint": name}])


def test_a_joint_with_equal_limits_stays_out_of_the_search_for_a_way() -> None:
    """Bars of 1 m and 1 + 1 m, the last joint held straight: nothing beyond 3 m is reached."""
    robot, q = three_bars(lower=0.0, upper=0.0), np.array([0.2, 0.8, 0.0])
    held = hk.holonomic(hk.position(robot, rows=[0, 1]), hk.lock("q3"))
    tool = robot.pose(q)[:3, 3]
    with pytest.raises(OutOfReachError) as caught:
        hk.follow(held, hk.line(tool, tool / np.linalg.norm(tool) * 3.5), q, samples=60)
    assert np.linalg.norm(caught.value.trajectory.x[-1]) == pytest.approx(3.0, abs=0.05)
    assert "no search came closer" in str(caught.value)
    assert (caught.value.trajectory.q[:, 2] == 0).all()


@pytest.mark.parametrize("count", [0, -3, 50.5, "50", None, True])
def test_a_count_is_a_whole_number_of_at_least_one(ppr: hk.Robot, count: object) -> None:
    strategy = hk.moore_penrose(hk.position(ppr))
    path = hk.circle(strategy.task(PPR_START), [1.2, 0.4])
    for call in (
        lambda: hk.involutivity(strategy, hk.around(PPR_START, 0.1), samples=count),
        lambda: hk.analysis.curvature.involutivity_of(lambda q: [[1], [0], [q[1]]], 3, samples=count),
        lambda: hk.follow(strategy, path, PPR_START, samples=count),
        lambda: hk.follow(strategy, path, PPR_START, cycles=count),
    ):
        with pytest.raises(ArgumentError, match="whole number"):
            call()


def test_a_count_may_be_numpys(ppr: hk.Robot) -> None:
    strategy = hk.moore_penrose(hk.position(ppr))
    path = hk.circle(strategy.task(PPR_START), [1.2, 0.4])
    assert len(hk.follow(strategy, path, PPR_START, samples=np.int64(7), cycles=np.int64(2))) == 15


def test_a_path_is_asked_within_its_time() -> None:
    path = hk.line([0, 0, 0], [1, 0, 0], speed=0.1)
    for t in (20.0, -0.1, [0.0, 5.0, 10.001]):
        with pytest.raises(ArgumentError, match="the path lasts from 0 to 10 s"):
            path.at(t)
    with pytest.raises(NotFiniteError):
        path.at([0.0, np.nan])
    ends = path.at([-1e-13, 10.0 + 1e-12])
    assert ends.position == pytest.approx(np.array([[0, 0, 0], [1, 0, 0]]), abs=0)
    assert len(path.at([]).t) == 0


def test_iterating_a_task_gives_its_rows(panda: hk.Robot) -> None:
    task = hk.pose(panda, "rpy")
    rows = list(task)
    assert [row.row_names for row in rows] == [(name,) for name in task.row_names]
    J = np.vstack([row.jacobian(PANDA_START) for row in rows])
    assert pytest.approx(task.jacobian(PANDA_START), abs=1e-15) == J
    with pytest.raises(ArgumentError, match="angular rows"):
        list(hk.pose(panda))


@pytest.mark.parametrize(
    ("locked", "words"),
    [
        ({"panda_joint8": 0.0}, "'fixed'; it needs no lock"),
        ({"panda_joint4": 1.0}, r"give a value within its limits \[-3.07"),
        ({"panda_joint1": -9}, r"within its limits \[-2.89"),
        ({"panda_joint1": "0"}, "finite value"),
        ({"panda_joint1": None}, "finite value"),
        ({"panda_joint1": float("nan")}, "finite value"),
    ],
)
def test_a_lock_holds_a_joint_that_moves_at_a_value_it_can_have(locked: dict[str, float], words: str) -> None:
    with pytest.raises(ArgumentError, match=words):
        hk.from_urdf(urdf("panda.urdf"), tip="panda_link8", locked=locked)


def test_a_lock_may_stand_at_a_limit() -> None:
    free = hk.from_urdf(urdf("panda.urdf"), tip="panda_link8")
    assert hk.from_urdf(urdf("panda.urdf"), tip="panda_link8", locked={"panda_joint4": free.lower[3]}).n == 6


def test_a_formula_names_joints_by_number_only_where_no_joint_is_called_so() -> None:
    def value(formula: str, joints: str) -> float:
        robot = hk.from_dh([{"a": 1.0, "joint": joint} for joint in joints.split()])
        function = MoorePenrose(kind="moore-penrose", invariant=[formula]).invariants(hk.position(robot))
        assert function is not None
        return float(function([10.0, 20.0, 30.0]))

    assert value("q1", "a b c") == 10.0  # by number
    assert value("q3 + 0 * b", "a b c") == 30.0
    assert value("q1", "q0 q1 q2") == 20.0  # the joint of that name
    assert value("q3", "q3 q2 q1") == 10.0
    for number in ("q3", "q4"):
        with pytest.raises(ExpressionError, match=r"known: q0, q1, q2, pi"):
            value(number, "q0 q1 q2")


# --- in a job -------------------------------------------------------------------------------------------------


def path_table(text: str) -> str:
    return f"[path]\nsamples = 20\n{text}\n"


@pytest.mark.campaign
def test_a_polyline_beside_the_tool_is_told_the_jobs_cure_and_it_works(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    line = 'kind = "polyline"\npoints = [[0.4, 0.4], [0.5, 0.4]]'
    outcome = holokin("run", write_job(tmp_path, path=path_table(line)), "--out", out)
    assert_refused(outcome, "[path.points.0]", "away from the start of the path", "set relative = true", "first one")
    assert "starting_at" not in outcome.err
    assert_untouched(out)
    point = outcome.err.split("at the start posture, ")[1].split("]")[0] + "]"
    line = f'kind = "polyline"\npoints = [{point}, [0.9, 0.5]]'
    assert holokin("run", write_job(tmp_path, path=path_table(line)), "--out", out).code == 0


def test_a_relative_polyline_begins_at_the_tool(holokin: Command, tmp_path: Path, out: Path) -> None:
    line = 'kind = "polyline"\nrelative = true\npoints = [[0.1, 0], [0.2, 0]]'
    assert_refused(holokin("run", write_job(tmp_path, path=path_table(line)), "--out", out), "begin with [0, 0, 0]")


def test_a_row_that_the_task_leaves_free_may_begin_anywhere(holokin: Command, tmp_path: Path, out: Path) -> None:
    x = float(hk.load("ppr").pose(PPR_START)[0, 3])
    line = path_table(f'kind = "polyline"\npoints = [[{x}, 7], [{x + 0.1}, 7]]')
    assert holokin("run", write_job(tmp_path, task="[task]\nrows = [0]\n", path=line), "--out", out).code == 0


@pytest.mark.campaign
def test_a_centre_beside_the_circles_plane_is_told_how_far_and_what_to_do(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    job = {
        "robot": '[robot]\nname = "panda"\n',
        "task": '[task]\nkind = "pose"\n',
        "start": f"[start]\nq = {PANDA_START.tolist()}\n",
    }
    tool = hk.load("panda").pose(PANDA_START)[:3, 3]
    center = [*np.round(tool[:2] - [0.1, 0], 4), round(tool[2] - 0.002, 9)]
    circle = path_table(f'kind = "circle"\ncenter = {[float(c) for c in center]}')
    outcome = holokin("run", write_job(tmp_path, path=circle, **job), "--out", out)
    assert_refused(outcome, "[path.normal]", "perpendicular", "0.002 m along", "relative = true", f"{tool[2]:.6f}"[:-1])
    assert_untouched(out)
    circle = path_table('kind = "circle"\nrelative = true\ncenter = [-0.05, 0]')
    assert holokin("run", write_job(tmp_path, path=circle, **job), "--out", out).code == 0


@pytest.mark.campaign
def test_a_start_in_degrees_is_recognised(holokin: Command, tmp_path: Path, out: Path) -> None:
    robot, path = '[robot]\nname = "irb140"\n', path_table('kind = "circle"\nrelative = true\ncenter = [0.02, 0]')
    start = "[start]\nq = [10, 70, 10, 20, 50, 30]\n"
    file = write_job(tmp_path, robot=robot, path=path, start=start)
    outcome = holokin("run", file, "--out", out)
    assert_refused(outcome, "job.toml", "[start.q]", "joint 'q2' at 70 rad", "degrees = true")
    assert_untouched(out)
    turned = write_job(tmp_path, robot=robot, path=path, start=start + "degrees = true\n")
    assert holokin("run", turned, "--out", out).code == 0
    far = write_job(tmp_path, robot=robot, path=path, start="[start]\nq = [900, 70, 10, 20, 50, 30]\n")
    assert "degrees = true" not in holokin("run", far, "--out", out).err


@pytest.mark.campaign
@sampled(1, "ending", [".toml", ".TOML"])
def test_a_job_file_named_without_its_ending_is_recognised(
    holokin: Command, tmp_path: Path, out: Path, ending: str
) -> None:
    file = write_job(tmp_path, "my-job" + ending)
    assert_refused(holokin("run", tmp_path / "my-job", "--out", out), f"did you mean '{file}'")
    assert_untouched(out)
    assert holokin("run", file, "--out", out).code == 0
    assert (out / "my-job" / "report.html").is_file()


def test_a_new_job_may_end_in_capitals_and_says_what_its_expectations_are_of(holokin: Command, tmp_path: Path) -> None:
    file = tmp_path / "MINE.TOML"
    assert holokin("new", file).code == 0
    text = file.read_text()
    assert text.count("as copied") == 1
    assert text.index("as copied") < text.index("[expect.")
    assert read_job(file) == open_job("panda-circle")[1]


@pytest.mark.parametrize(
    ("name", "words"), [("poly.toml", "known: name, source, convention, base"), ("poly.txt", "give a model (.urdf")]
)
def test_what_is_no_robot_is_told_what_is_wanted(holokin: Command, tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / name).write_text(SOUND["title"])
    outcome = holokin("robots", tmp_path / name)
    assert_refused(outcome, name, words)
    assert "mend the line" not in outcome.err


MINE = "[strategies.mine]\n"


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        ({"path": SOUND["path"] + "speed = -1\n"}, "[path.speed] is -1; give a number above 0\n"),
        ({"path": SOUND["path"].replace("= 20", "= 2.5")}, "[path.samples] is 2.5; give a whole number\n"),
        ({"path": SOUND["path"].replace("samples", "sample")}, "did you mean 'samples'? known: kind, center"),
        ({"strategies": MINE + 'kind = "moore-penros"\n'}, "did you mean 'moore-penrose'? known: moore-penrose, weig"),
        ({"path": SOUND["path"] + "angle_deg = 90\n"}, "[path] kind = 'circle' does not use angle_deg; leave it out\n"),
        ({"strategies": MINE + 'kind = "coupled"\ngain = "x"\n'}, "is 'x'; give a number or a list, in [ ]\n"),
        ({"strategies": MINE + 'kind = "custom"\ng = [true]\n'}, "g.0] is True; give a text in quotes or a number"),
        ({"task": '[task]\norientation = ["zyz", "rp"]\n'}, "[task.orientation.1] is 'rp'; did you mean 'rpy'?"),
        ({"expect": "[verdicts]\n"}, "did you mean 'verdict'?"),
    ],
)
def test_a_value_that_does_not_fit_is_told_in_plain_words_what_does(
    holokin: Command, tmp_path: Path, out: Path, spoilt: dict[str, str], words: str
) -> None:
    outcome = holokin("run", write_job(tmp_path, **spoilt), "--out", out)
    assert_refused(outcome, "job.toml", words)
    assert not any(word in outcome.err for word in ("Input", "valid", "change it"))
    assert_untouched(out)


# --- What strategies that do not fit, arguments that are no numbers and singular postures get, job or API.


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
        ('kind = "linear"\nmatrix = [[1, 2]]\n', ("(1, 2)", "(1, 3)", "q1, q2, q3")),
        ('kind = "null-basis"\nN_G = [[1, 0], [0, 1]]\n', ("N_G of 's'", "(2, 2)", "(3, 2)")),
        ('kind = "weighted"\nweight = [[1, 0], [0, 1]]\n', ("weight", "(3, 3)")),
        ('kind = "pfaffian"\nA = [["q1", "q2"]]\n', ("'s'", "(1, 2)", "(1, 3)")),
        ('kind = "custom"\ng = ["q1 + q9"]\n', ("'q1 + q9'", "the name 'q9' is unknown")),
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
    with pytest.raises(RowsError):
        hk.position(hk.load(tmp_path / "two.toml"))
    assert hk.position(hk.load(tmp_path / "two.toml"), rows=[0, 2]).m == 2  # the cure that the message names


def test_constraint_rows_must_make_up_for_the_missing_task_rows(panda: hk.Robot, ppr: hk.Robot) -> None:
    for robot, task, g in (
        (ppr, hk.position(ppr), hk.linear(np.eye(3)[:2])),
        (panda, hk.pose(panda), hk.lock(0, 1)),
        (panda, hk.position(panda), hk.lock("panda_joint1")),
        (
            panda,
            hk.position(panda),
            hk.strategies.constraints.stack(hk.lock(0, 1), hk.linear(np.eye(7)[:1]), hk.lock(2, 3)),
        ),
    ):
        with pytest.raises(RowsError) as caught:
            hk.holonomic(task, g)
        assert (caught.value.rows, caught.value.n, caught.value.m) == (g.rows, robot.n, task.m)
        assert f"exactly r = n - m = {robot.n - task.m}" in str(caught.value)
    with pytest.raises(RowsError, match="no joint is left for it"):
        hk.holonomic(hk.pose(hk.load("irb140")), hk.lock(2))
    with pytest.raises(ShapeError, match="rows= must match"):
        hk.holonomic(hk.position(ppr), hk.custom(lambda q: [q[0], q[1]], rows=1))


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
    askew = "with q1 held, the other joints cannot move the tool in the direction 0.54 x, 0.84 y"
    assert askew in str(caught.value)
    for angle, axis in ((0.0, "x"), (np.pi / 2, "y")):  # two links in line along an axis move only across it
        with pytest.raises(
            SingularityError, match=f"with q1 held, the other joints cannot move the tool along {axis};"
        ):
            hk.holonomic(task, hk.lock(0))(np.array([angle - 0.7, 0.7, 0.0]))


def test_a_tool_pointing_straight_down_is_a_representation_singularity_of_zyz(panda: hk.Robot) -> None:
    q = np.array([0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0])
    assert abs(panda.pose(q)[2, 2] + 1) < 1e-15  # theta = pi
    twist = hk.pose(panda)
    assert np.linalg.cond(twist.jacobian(q)) < 100
    hk.moore_penrose(twist)(q)  # neither the arm nor the strategy is singular
    for strategy in (
        hk.moore_penrose(hk.pose(panda, "zyz")),
        hk.holonomic(hk.position(panda), hk.strategies.constraints.stack(hk.coupled(1.0, "zyz"), hk.lock(2))),
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


# --- methods ----------------------------------------------------------------------------------------------------

NO_NUMBERS = [None, "x", object(), {"a": 1}, [[[0.0]]], np.full(3, np.nan), np.zeros(1), -1]
"""No argument of any of the methods below."""

METHODS: dict[str, Callable[[hk.HolonomicStrategy, Any], object]] = {
    "path.on(index, u)": lambda _s, bad: LOOP.on(bad, np.zeros(2)),
    "path.on(index, u) again": lambda _s, bad: LOOP.on(np.zeros(2, dtype=int), bad),
    "path.table(rotation)": lambda _s, bad: LOOP.table(bad),
    "synchronized.on(index, u)": lambda _s, bad: hk.path.synchronized(LOOP, LOOP).on(bad, np.zeros(2)),
    "synchronized.table(rotations)": lambda _s, bad: hk.path.synchronized(LOOP, LOOP).table(bad),
    "task.target(pose)": lambda s, bad: s.task.target(bad),
    "strategy.leaf_gap(c)": lambda s, bad: s.leaf_gap(bad),
    "robot.origins(q)": lambda s, bad: s.task.robot.origins(bad),
    "workspace.at(positions)": lambda _s, bad: hk.workspace(box=([0, 0, 0], [1, 1, 1])).at(bad),
    "watch.see(q, dq)": lambda _s, bad: hk.motion.LoopWatch(0.1).see(np.zeros(3), bad),
    "watch.see(q, dq) again": lambda _s, bad: hk.motion.LoopWatch(0.1).see(bad, np.zeros(3)),
    **{
        f"{type(shape).__name__.lower()}.support(directions)": lambda _s, bad, shape=shape: shape.support(bad)
        for shape in (
            hk.robot.Box(np.ones(3)), hk.robot.Capsule(0.1, 0.2), hk.robot.Cylinder(0.1, 0.2),
            hk.robot.Ellipsoid(np.ones(3)), hk.robot.Hull(np.eye(3)),
        )
    },
}  # fmt: skip
"""A call with one argument that is none, of a strategy that holds the first of three joints."""

LOOP = hk.polyline([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1]], closed=True)


@pytest.mark.parametrize("name", METHODS)
def test_a_method_answers_what_is_no_argument_of_it_by_one_sentence(planar_3r: hk.Robot, name: str) -> None:
    strategy = hk.holonomic(hk.position(planar_3r), hk.lock(0))
    for bad in NO_NUMBERS:
        with pytest.raises(hk.HolokinError) as caught:
            METHODS[name](strategy, bad)
        assert "\n" not in str(caught.value)


def test_a_place_on_a_path_is_a_segment_that_it_has_and_a_share_of_it() -> None:
    index = np.array([0, 2, 1])
    found = LOOP.on(index, np.array([0.0, 1.0, 0.5]))
    np.testing.assert_allclose(found.position, [[0, 0, 0], [0, 0, 0], [0.1, 0.05, 0]], atol=1e-12)
    np.testing.assert_array_equal(LOOP.on([0, 2, 1], [0.0, 1.0, 0.5]).position, found.position)
    for wrong, u in (([3], [0.5]), ([-1], [0.5]), ([0.5], [0.5]), ([0], [1.1]), ([0], [-0.1]), ([0, 1], [0.5])):
        with pytest.raises((ArgumentError, ShapeError)):
            LOOP.on(wrong, u)


def test_a_watch_of_a_loop_wants_as_many_joints_at_each_step() -> None:
    watch = hk.motion.LoopWatch(0.1)
    watch.see(np.zeros(3), np.ones(3))
    with pytest.raises(ShapeError):
        watch.see(np.zeros(4), np.ones(4))
    watch.see(np.full(3, 0.1), np.ones(3))
    assert watch.share == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: hk.custom_task(s.task.robot, lambda: 0, units=("m",)), "give a function of one argument"),
        (lambda s: hk.null_basis(s.task, lambda a, b: a), "give a function of one argument"),
        (lambda s: hk.custom(lambda a, b: [a]), "give a function of one argument"),
        (lambda s: hk.strategies.from_transport(s.task, s.task, s.task, s.task, around=np.zeros(3)), "of 2 arguments"),
    ],
)
def test_a_function_of_the_users_takes_as_many_arguments_as_it_gets(
    planar_3r: hk.Robot, call: Callable[[hk.HolonomicStrategy], object], words: str
) -> None:
    with pytest.raises(ArgumentError, match=words):
        call(hk.holonomic(hk.position(planar_3r), hk.lock(0)))


def test_a_function_may_take_more_than_it_gets_where_that_has_defaults(planar_3r: hk.Robot) -> None:
    task = hk.custom_task(planar_3r, lambda q, gain=2.0: gain * q[:2], units=("rad", "rad"))
    assert task([0.1, 0.2, 0.3]) == pytest.approx([0.2, 0.4])


def test_numbers_that_no_float_or_no_thing_can_have_are_refused(planar_3r: hk.Robot) -> None:
    strategy, q = hk.holonomic(hk.position(planar_3r), hk.lock(0)), np.array([0.3, 0.7, -0.5])
    task, points = strategy.task, [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]]
    calls: list[tuple[str, Callable[[], object]]] = [
        ("from 0 to 1", lambda: hk.ik(strategy, q).nearest(planar_3r.pose(q), rcond=2.0)),
        ("kg/m", lambda: hk.robot.to_mjcf(planar_3r, density=1e9)),
        ("yourdfpy", lambda: hk.robot.from_yourdfpy(task)),
        ("at most 1e", lambda: hk.spline(points, speed=1e308)),
        ("at most 1e", lambda: hk.path.figure_eight([0.4, 0, 0.2], 0.2, 0.1, [0, 0, 1], speed=1e308)),
        ("radius is -1", lambda: hk.analysis.curvature.leaf_function(strategy, q, radius=-1)),
        ("joints is", lambda: hk.strategies.constraints.height(10**5000)),
    ]
    for words, call in calls:
        with pytest.raises(ArgumentError, match=words):
            call()


def test_expressions_of_other_shapes_or_symbols_are_refused_in_holokins_words(planar_3r: hk.Robot) -> None:
    task, stranger, short = hk.position(planar_3r), SX.sym("stranger", 3), SX.sym("q", 1)
    for call in (planar_3r.kinematics, planar_3r.origins, task.kinematics):
        with pytest.raises(ShapeError):
            call(short)
    for strategy in (
        hk.null_basis(task, lambda q: [[stranger[0], 0], [0, 1], [0, 0]]),
        hk.holonomic(task, hk.custom(lambda q: [q[0] * stranger[1]])),
    ):
        with pytest.raises(ExpressionError, match=r"stranger_[01]"):
            strategy(np.array([0.3, 0.7, -0.5]))


def test_parts_of_a_workspace_are_asked_about_positions(planar_3r: hk.Robot) -> None:
    for solid in (Box(np.zeros(3), np.ones(3)), Cylinder(np.zeros(3), 0.1, 0.2), Sphere(np.zeros(3), 0.1)):
        inside = solid.points(np.random.default_rng(0).random((50, 3)))
        assert solid.contains(inside).all()
        for bad in (*NO_NUMBERS, [[0.0, 0.0, 2.0]]):
            with pytest.raises(hk.HolokinError):
                solid.points(bad)
        for bad in NO_NUMBERS:
            with pytest.raises(hk.HolokinError):
                solid.contains(bad)


def test_a_number_that_is_none_is_refused_where_a_method_takes_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last three raw errors that 13,078 bad calls met."""
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    robot = hk.load("planar-3r")
    task, q = hk.position(robot), np.array([0.3, 0.7, -0.5])
    with pytest.raises(ShapeError):
        robot.ranges(np.zeros(2))
    curve = hk.strategies.self_motion_curve(task, q, step=0.2, length=1.0)
    for bad in ("x", {"a": 1}, [0.0, 1.0]):
        with pytest.raises((ArgumentError, ShapeError)):
            curve.at(bad)  # type: ignore[arg-type]
    s = hk.sheets(task, hk.workspace(box=([1.5, 0.5], [0.2, 0.1])), q0=[q], samples=8, share=0.5, search=False)
    with pytest.raises((ArgumentError, ShapeError)):
        s.seams(at=-1)  # type: ignore[arg-type]
