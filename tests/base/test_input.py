"""What odd input gets: counts, points, times, locked joints, names in formulas; keys, values and kinds of a job."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_START, SOUND, Command, assert_refused, assert_untouched, sampled, urdf, write_job
from holokin.app.job import open_job, read_job
from holokin.app.job.strategy_tables import MoorePenrose
from holokin.base.errors import ArgumentError, ExpressionError, NotFiniteError, OutOfReachError

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


@pytest.mark.parametrize(
    "make",
    [
        lambda: hk.polyline([[0, 0, 0], [1, 0]]),
        lambda: hk.polyline([[0, 0, 0], ["a", 0, 0]]),
        lambda: hk.polyline([[0, 0], [1, 0]], turns=[[0, 0], [1]]),
        lambda: hk.circle("a", "b"),
        lambda: hk.circle([1, 0], {}),
        lambda: hk.line([0, 0], [1, 0], turn="x"),
        lambda: hk.line([0, 0], [1, 0]).at("now"),
    ],
)
def test_a_point_is_made_of_numbers(make: Callable[[], object]) -> None:
    with pytest.raises(ArgumentError, match="give numbers, in rows of one length"):
        make()


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
    ("name", "words"),
    [("poly.toml", "known: name, source, convention, base"), ("poly.txt", "give a model (.urdf")],
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
        ({"path": SOUND["path"].replace("= 20", "= 0")}, "[path.samples] is 0; give at least 1\n"),
        ({"path": SOUND["path"].replace("= 20", "= 2.5")}, "[path.samples] is 2.5; give a whole number\n"),
        ({"path": SOUND["path"] + 'speed = "1"\n'}, "[path.speed] is '1'; give a number\n"),
        ({"path": SOUND["path"].replace("samples", "sample")}, "did you mean 'samples'? known: kind, center"),
        ({"path": '[path]\nkind = "circel"\n'}, "did you mean 'circle'? known: circle, arc, polyline"),
        ({"path": '[path]\nkind = "circle"\ncenter = [1]\n'}, "[path.center] is [1]; give at least 2 of them\n"),
        ({"strategies": MINE + 'kind = "moore-penros"\n'}, "did you mean 'moore-penrose'? known: moore-penrose, weig"),
        ({"path": SOUND["path"] + "angle_deg = 90\n"}, "[path] kind = 'circle' does not use angle_deg; leave it out\n"),
        ({"path": SOUND["path"] + "closed = true\n"}, "[path] kind = 'circle' does not use closed; leave it out\n"),
        ({"strategies": MINE + 'kind = "weighted"\nwieght = 3\n'}, "did you mean 'weight'? known: method, inv"),
        ({"strategies": MINE + 'kind = "coupled"\ngain = "x"\n'}, "is 'x'; give a number or a list, in [ ]\n"),
        ({"strategies": MINE + 'kind = "coupled"\ngain = [[1, "x"]]\n'}, "gain.0.1] is 'x'; give a number\n"),
        ({"strategies": MINE + 'kind = "custom"\ng = [true]\n'}, "g.0] is True; give a text in quotes or a number"),
        ({"task": '[task]\norientation = ["zyz", "rp"]\n'}, "[task.orientation.1] is 'rp'; did you mean 'rpy'?"),
        ({"start": SOUND["start"] + "degrees = 1\n"}, "[start.degrees] is 1; give true or false\n"),
        ({"expect": "[expect.moore-penrose]\ndrift = 3\n"}, "[expect.moore-penrose.drift] is 3; give a table\n"),
        ({"expect": "[expect.moore-penrose]\ndrift = { belo = 3 }\n"}, "did you mean 'below'? known: below, above"),
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
