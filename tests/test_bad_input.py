"""What bad input gets, on the command line and in the API: exit code 2, one sentence, and nothing half-written."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_CENTER, PPR_RADIUS, PPR_START, urdf
from holokin import cli
from holokin.errors import (
    ArgumentError,
    ConstraintRowsError,
    JobError,
    JointLimitError,
    NotFiniteError,
    OutOfReachError,
    ShapeError,
    SingularityError,
    SingularityKind,
    TaskTooLargeError,
    UnknownNameError,
)
from holokin.job import read_job

SOUND = {
    "title": 'title = "a circle"\n',
    "robot": '[robot]\nname = "ppr"\n',
    "task": "",
    "start": f"[start]\nq = {PPR_START.tolist()}\n",
    "path": '[path]\nkind = "circle"\ncenter = [1.2070, 0.4036]\nsamples = 20\n',
    "strategies": '[strategies.moore-penrose]\nkind = "moore-penrose"\n',
    "expect": "",
}
"""A job that runs; the tests spoil one table of it."""

PLANAR = {
    "robot": '[robot]\nname = "planar-3r"\n',
    "path": '[path]\nkind = "circle"\ncenter = [-0.1, 0]\nrelative = true\nsamples = 20\n',
}


@dataclass(frozen=True)
class Outcome:
    """What a command left behind: exit code and the two streams."""

    code: object
    out: str
    err: str


Command = Callable[..., Outcome]


@pytest.fixture
def holokin(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    """The command line, in this process."""

    def run(*arguments: object) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["holokin", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        streams = capsys.readouterr()
        return Outcome(0 if end.value.code is None else end.value.code, streams.out, streams.err)

    return run


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A folder for results in which somebody keeps something already."""
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "mine.txt").write_text("keep me")
    return folder


def shell(*arguments: object) -> Outcome:
    """The command line, in a process of its own."""
    command = [sys.executable, "-m", "holokin.cli", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    return Outcome(done.returncode, done.stdout, done.stderr)


def write_job(folder: Path, name: str = "job.toml", **spoilt: str) -> Path:
    file = folder / name
    file.write_text("".join((SOUND | spoilt).values()), "utf-8")
    return file


def assert_refused(outcome: Outcome, *words: str) -> None:
    """Exit code 2 and one sentence on stderr that says all the words, and nothing else anywhere."""
    assert "Traceback" not in outcome.err + outcome.out
    assert outcome.err.startswith("error: ")
    assert outcome.err.count("\n") == 1 and outcome.err.endswith("\n")
    for word in words:
        assert word in outcome.err
    assert outcome.out == ""
    assert outcome.code == 2


def assert_untouched(out: Path) -> None:
    """No new entries, hidden ones included, and the old one as it was."""
    assert [entry.name for entry in out.iterdir()] == ["mine.txt"]
    assert (out / "mine.txt").read_text() == "keep me"


# --- the command line: files, keys and names ------------------------------------------------------------------


def test_the_job_that_the_tests_spoil_is_sound(holokin: Command, tmp_path: Path, out: Path) -> None:
    outcome = holokin("run", write_job(tmp_path), "--out", out)
    assert (outcome.code, outcome.err) == (0, "")
    assert "NOT holonomic" in outcome.out
    assert sorted(entry.name for entry in out.iterdir()) == ["job", "mine.txt"]


def test_a_missing_job_file_is_named_in_one_sentence(tmp_path: Path, out: Path) -> None:
    assert_refused(
        shell("run", tmp_path / "nothing.toml", "--out", out), "nothing.toml", "no such file", "holokin jobs"
    )
    assert_untouched(out)


def test_a_malformed_job_file_is_refused_with_its_line(tmp_path: Path, out: Path) -> None:
    file = write_job(tmp_path, title='title = "a circle\n')
    assert_refused(shell("run", file, "--out", out), "job.toml", "is not TOML", "line 1")
    assert_untouched(out)


def test_an_unknown_job_is_answered_with_the_jobs_there_are(holokin: Command, out: Path) -> None:
    assert_refused(holokin("run", "ppr-cycles", "--out", out), "did you mean 'ppr-cycle'", "`holokin jobs`")
    assert_refused(holokin("run", "nothing-like-it", "--out", out), "panda-circle", "ppr-half-circle", ".toml")
    assert_untouched(out)


@pytest.mark.parametrize("content", [b"title = \xff\xfe", b"\x00\x01\x02", b"{}", b"title = [1,"])
def test_a_file_of_another_kind_is_no_job(holokin: Command, tmp_path: Path, out: Path, content: bytes) -> None:
    file = tmp_path / "job.toml"
    file.write_bytes(content)
    assert_refused(holokin("run", file, "--out", out), "job.toml")
    (tmp_path / "folder.toml").mkdir()
    assert_refused(holokin("run", tmp_path / "folder.toml", "--out", out), "folder.toml", "cannot be read")
    assert_untouched(out)


@pytest.mark.parametrize(
    ("spoilt", "key"),
    [
        ({"title": 'title = "x"\nspeed = 1\n'}, "[speed]"),
        ({"path": SOUND["path"] + "sample = 3\n"}, "[path.sample]"),
        ({"path": SOUND["path"] + "sample = nan\n"}, "[path.sample]"),
        ({"start": SOUND["start"] + "degree = true\n"}, "[start.degree]"),
        ({"strategies": SOUND["strategies"] + "weight = 2\n"}, "[strategies.moore-penrose.weight]"),
        ({"expect": "[expect.moore-penrose]\ndrfit = { below = 1 }\n"}, "[expect.moore-penrose.drfit]"),
        ({"expect": '[strategy.lock]\nkind = "lock"\n'}, "[strategy]"),
    ],
)
def test_an_unknown_key_is_refused_by_file_key_and_cure(
    holokin: Command, tmp_path: Path, out: Path, spoilt: dict[str, str], key: str
) -> None:
    outcome = holokin("run", write_job(tmp_path, **spoilt), "--out", out)
    assert_refused(outcome, "job.toml", f"{key} is an unknown key", "check its spelling", "`holokin new`")
    assert_untouched(out)


@pytest.mark.parametrize("table", ["title", "robot", "start", "path", "strategies"])
def test_a_job_without_a_table_it_needs_is_told_which(holokin: Command, tmp_path: Path, out: Path, table: str) -> None:
    outcome = holokin("run", write_job(tmp_path, **{table: ""}), "--out", out)
    assert_refused(outcome, "job.toml", f"[{table}] is missing", "add it")
    assert_untouched(out)


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        ({"robot": '[robot]\nname = "pandaa"\n'}, ("'pandaa'", "did you mean 'panda'", "`holokin robots`")),
        ({"robot": '[robot]\nname = "gone.urdf"\n'}, ("gone.urdf", "no such file")),
        ({"robot": '[robot]\nname = "gone.toml"\n'}, ("gone.toml", "no such file")),
        ({"robot": '[robot]\nname = "arm.xml"\n'}, ("arm.xml", ".urdf or a .toml")),
        ({"robot": "[robot]\nname = 3\n"}, ("job.toml", "[robot.name] is 3")),
        ({"robot": '[robot]\nname = "ppr"\ntip = "hand"\n'}, ("hand", "only URDF files")),
        (
            {"strategies": '[strategies.held]\nkind = "lock"\njoints = ["q4"]\n'},
            ("unknown joint 'q4'", "known: q1, q2, q3"),
        ),
        (
            {"strategies": '[strategies.mine]\nkind = "moore"\n'},
            ("job.toml", "[strategies.mine.kind] is 'moore'", "'moore-penrose'", "'null-basis'"),
        ),
        ({"strategies": "[strategies]\n"}, ("job.toml", "[strategies]")),
        (
            {"strategies": '[strategies.mine]\nkind = "custom"\n'},
            ("job.toml", "[strategies.mine] kind = 'custom' needs g", "add it"),
        ),
        (
            {"strategies": SOUND["strategies"] + "gain = 1\n"},
            ("job.toml", "[strategies.moore-penrose]", "does not use gain", "leave it out"),
        ),
        ({"strategies": SOUND["strategies"] + 'method = "leaf"\n'}, ("'leaf'", "'moore-penrose' has no constraint")),
        (
            {"expect": "[expect.lock]\nholonomic = true\n"},
            ("job.toml", "[expect.lock] is for no strategy", "known: moore-penrose"),
        ),
        ({"expect": "[expect.moore-penrose]\ndrift = {}\n"}, ("[expect.moore-penrose.drift]", "below, above")),
        ({"task": "[task]\nrows = [5]\n"}, ("task row '5'", "known: 0, 1")),
        ({"task": '[task]\nkind = "pose"\norientation = []\n'}, ("job.toml", "[task.orientation] is []")),
        ({"task": '[task]\nkind = "pose"\norientation = "zyz"\n'}, ("'zyz'", "use 'twist'")),
    ],
)
def test_a_name_that_does_not_exist_is_answered_with_those_that_do(
    holokin: Command, tmp_path: Path, out: Path, spoilt: dict[str, str], words: tuple[str, ...]
) -> None:
    assert_refused(holokin("run", write_job(tmp_path, **spoilt), "--out", out), *words)
    assert_untouched(out)


def test_a_bad_job_among_several_stops_all_before_the_first(holokin: Command, tmp_path: Path, out: Path) -> None:
    good, bad = write_job(tmp_path, "good.toml"), write_job(tmp_path, "bad.toml", title="")
    assert_refused(holokin("run", good, bad, "--out", out), "bad.toml", "[title]")
    assert_untouched(out)


def test_half_a_urdf_is_not_half_an_arm(tmp_path: Path, out: Path) -> None:
    text = urdf("panda.urdf").read_text()
    (tmp_path / "half.urdf").write_text(text[: len(text) // 2])
    assert_refused(shell("robots", tmp_path / "half.urdf"), "half.urdf", "is not XML")
    robot = '[robot]\nname = "half.urdf"\ntip = "panda_link3"\n'
    assert_refused(shell("run", write_job(tmp_path, robot=robot), "--out", out), "half.urdf", "is not XML")
    assert_untouched(out)


# --- the command line: numbers --------------------------------------------------------------------------------


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
@pytest.mark.parametrize(
    ("table", "text", "key"),
    [
        ("start", "[start]\nq = [0.1, {}, 0.2]\n", "[start.q.1]"),
        ("path", '[path]\nkind = "circle"\ncenter = [{}, 0]\n', "[path.center.0]"),
        ("path", '[path]\nkind = "polyline"\npoints = [[0, 0], [0.1, {}]]\n', "[path.points.1.1]"),
        ("path", SOUND["path"] + "speed = {}\n", "[path.speed]"),
        ("strategies", '[strategies.s]\nkind = "linear"\nmatrix = [[1, {}, 0]]\n', "[strategies.s.matrix.0.1]"),
        ("strategies", '[strategies.s]\nkind = "coupled"\ngain = {}\n', "[strategies.s.gain]"),
        ("strategies", '[strategies.s]\nkind = "custom"\ng = [{}]\n', "[strategies.s.g.0]"),
        ("expect", "[expect.moore-penrose]\ndrift = {{ below = {} }}\n", "[expect.moore-penrose.drift.below]"),
        ("expect", "[verdict]\nradius = {}\n", "[verdict.radius]"),
    ],
)
def test_nan_and_infinity_are_refused_by_file_and_key(
    holokin: Command, tmp_path: Path, out: Path, value: str, table: str, text: str, key: str
) -> None:
    outcome = holokin("run", write_job(tmp_path, **{table: text.format(value)}), "--out", out)
    assert_refused(outcome, "job.toml", f"{key} is {value}", "give a finite number")
    assert_untouched(out)


def test_a_start_outside_its_limits_is_refused_by_name(holokin: Command, tmp_path: Path, out: Path) -> None:
    file = write_job(tmp_path, start="[start]\nq = [0.0, -9.0, 0.0]\n")
    assert_refused(holokin("run", file, "--out", out), "joint 'q2' is at -9", "[-5, 5]", "choose another start")
    assert_untouched(out)
    with pytest.raises(JointLimitError) as caught:
        hk.follow(hk.moore_penrose(hk.position(hk.load("ppr"))), hk.circle(PPR_CENTER, [0, 0]), [0.0, -9.0, 0.0])
    assert (caught.value.joint, caught.value.value) == ("q2", -9.0)


@pytest.mark.parametrize("q", ["[0.1, 0.2]", "[0.1, 0.2, 0.3, 0.4]", "[]"])
def test_a_start_of_another_number_of_joints_is_refused_with_their_names(
    holokin: Command, tmp_path: Path, out: Path, q: str
) -> None:
    outcome = holokin("run", write_job(tmp_path, start=f"[start]\nq = {q}\n"), "--out", out)
    assert_refused(outcome, "job.toml", f"[start.q] has {len(json.loads(q))} numbers", "give 3, for q1, q2, q3")
    assert_untouched(out)


def test_a_path_out_of_reach_is_refused_with_the_place(tmp_path: Path, out: Path) -> None:
    file = write_job(
        tmp_path,
        robot='[robot]\nname = "irb140"\n',
        start="[start]\nq = [10, 70, 10, 20, 50, 30]\ndegrees = true\n",
        path='[path]\nkind = "polyline"\npoints = [[0, 0, 0], [2, 0, 0]]\nrelative = true\nsamples = 50\n',
    )
    outcome = shell("run", file, "--out", out)
    assert_refused(outcome, "out of reach", "% along the path", "move or shrink the path")
    assert_untouched(out)


def test_out_of_reach_keeps_what_was_computed(planar_3r: hk.Robot) -> None:
    strategy = hk.moore_penrose(hk.position(planar_3r))
    q = np.array([0.2, 0.8, 0.9])
    tool = planar_3r.pose(q)[:3, 3]
    with pytest.raises(OutOfReachError) as caught:
        hk.follow(strategy, hk.line(tool, tool / np.linalg.norm(tool) * 3.5), q, samples=100)
    walk = caught.value.trajectory
    assert walk.status is hk.Status.OUT_OF_REACH
    assert 10 < len(walk) < 101
    assert np.linalg.norm(walk.x[-1]) < 3.0


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ('kind = "circle"\n', ("a circle needs center",)),
        ('kind = "circle"\ncenter = [0, 0]\nrelative = true\n', ("radius",)),
        ('kind = "circle"\ncenter = [0.1, 0]\nnormal = [1, 0, 0]\nrelative = true\n', ("perpendicular",)),
        ('kind = "arc"\ncenter = [0, 0]\nangle_deg = 90\ncycles = 2\n', ("closed path",)),
        ('kind = "polyline"\npoints = [[0, 0]]\nrelative = true\n', ("at least two",)),
        ('kind = "polyline"\npoints = [[0, 0], [0, 0]]\nrelative = true\n', ("repeated points",)),
        ('kind = "polyline"\npoints = [[0, 0], [1, 0]]\n', ("away from the start of the path",)),
        ('kind = "polyline"\npoints = [[0, 0, 0, 0], [1, 0]]\n', ("[path.points.0]",)),
        ('kind = "spiral"\ncenter = [0, 0]\n', ("[path.kind] is 'spiral'", "'circle'")),
        ('kind = "circle"\ncenter = [1.2070, 0.4036]\nsamples = 0\n', ("[path.samples] is 0",)),
        ('kind = "circle"\ncenter = [1.2070, 0.4036]\nspeed = -1\n', ("[path.speed] is -1",)),
    ],
)
def test_a_path_that_is_none_is_refused(
    holokin: Command, tmp_path: Path, out: Path, path: str, words: tuple[str, ...]
) -> None:
    assert_refused(holokin("run", write_job(tmp_path, path="[path]\n" + path), "--out", out), *words)
    assert_untouched(out)


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
        ('kind = "weighted"\nW = [[1, 0], [0, 1]]\n', ("W", "(3, 3)")),
        ('kind = "weighted"\nW = []\n', ("[strategies.s.W]",)),
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
        (panda, hk.position(panda), hk.stack(hk.lock(0, 1), hk.linear(np.eye(7)[:1]), hk.lock(2, 3))),
    ):
        with pytest.raises(ConstraintRowsError) as caught:
            hk.holonomic(task, g)
        assert (caught.value.rows, caught.value.n, caught.value.m) == (g.rows, robot.n, task.m)
        assert f"exactly r = n - m = {robot.n - task.m}" in str(caught.value)
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
        hk.holonomic(hk.position(panda), hk.stack(hk.coupled(1.0, "zyz"), hk.lock(2))),
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
    assert_refused(outcome, f"error: {kind} singularity of", "at q = [")
    assert_untouched(out)


# --- where results go -----------------------------------------------------------------------------------------


def test_results_are_not_written_into_a_file(holokin: Command, tmp_path: Path) -> None:
    file = tmp_path / "out"
    file.write_text("keep me")
    assert_refused(holokin("run", write_job(tmp_path), "--out", file), "the output folder", "cannot be made")
    assert file.read_text() == "keep me"


def test_a_folder_of_somebody_else_is_left_alone(holokin: Command, tmp_path: Path, out: Path) -> None:
    foreign = out / "job"
    foreign.mkdir()
    (foreign / "thesis.tex").write_text("years of work")
    assert_refused(holokin("run", write_job(tmp_path), "--out", out), str(foreign), "not one of holokin's", "--out")
    assert sorted(entry.name for entry in out.iterdir()) == ["job", "mine.txt"]
    assert [entry.name for entry in foreign.iterdir()] == ["thesis.tex"]


def test_a_new_job_never_overwrites_a_file(holokin: Command, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("keep me")
    assert_refused(holokin("new", file), "mine.toml", "exists already")
    assert file.read_text() == "keep me"
    assert_refused(holokin("new", tmp_path / "job.txt"), "job.txt", ".toml")
    assert_refused(holokin("new", tmp_path / "no" / "job.toml"), "job.toml", "cannot be written")
    assert_refused(holokin("new", tmp_path / "job.toml", "--from", "panda-circel"), "did you mean 'panda-circle'")
    assert [entry.name for entry in tmp_path.iterdir()] == ["mine.toml"]
    outcome = holokin("new", tmp_path / "job.toml")
    assert (outcome.code, outcome.err) == (0, "")
    assert read_job(tmp_path / "job.toml").robot.name == "panda"


def test_an_expectation_that_fails_exits_1_with_the_report_whole(tmp_path: Path, out: Path) -> None:
    expect = "[expect.moore-penrose]\nholonomic = true\ntracking = { below = 1e-3 }\n"
    outcome = shell("run", write_job(tmp_path, expect=expect), "--out", out)
    assert (outcome.code, outcome.err) == (1, "")
    assert "FAILED" in outcome.out
    assert "expected holonomic true, found false" in outcome.out
    assert sorted(entry.name for entry in out.iterdir()) == ["job", "mine.txt"]
    facts = json.loads((out / "job" / "result.json").read_text())
    assert facts["passed"] is False
    checks = {check["figure"]: check["passed"] for check in facts["strategies"][0]["checks"]}
    assert checks == {"completes": True, "holonomic": False, "tracking": True}
    assert "FAILED" in (out / "job" / "report.html").read_text().rpartition("</html>")[0]
    assert len(list((out / "job").glob("*.csv"))) == 3


@pytest.mark.parametrize(
    "moment", ["holokin.job.runner.involutivity", "holokin.job.runner.follow", "holokin.output.report._page"]
)
def test_ctrl_c_exits_130_and_leaves_nothing_half_written(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch, moment: str
) -> None:
    def interrupted(*_arguments: object, **_named: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(moment, interrupted)
    outcome = holokin("run", write_job(tmp_path), "--out", out)
    assert outcome.code == 130
    assert "Traceback" not in outcome.err + outcome.out
    assert outcome.err.startswith("stopped") and outcome.err.count("\n") == 1
    assert_untouched(out)


def test_ctrl_c_in_the_second_job_leaves_the_first_report_whole(
    holokin: Command, tmp_path: Path, out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import holokin.output.report as report

    write_page, pages = report._page, []

    def interrupted(*arguments: object) -> str:
        pages.append(arguments)
        if len(pages) > 1:
            raise KeyboardInterrupt
        return write_page(*arguments)

    monkeypatch.setattr(report, "_page", interrupted)
    files = [write_job(tmp_path, f"{name}.toml") for name in ("first", "second")]
    outcome = holokin("run", *files, "--out", out)
    assert outcome.code == 130
    assert str(out / "first") in outcome.out.replace("\n", "")
    assert sorted(entry.name for entry in out.iterdir()) == ["first", "mine.txt"]
    before = {entry.name: entry.read_bytes() for entry in (out / "first").iterdir()}
    assert {"report.html", "result.json"} <= set(before)
    assert holokin("run", files[0], "--out", out).code == 130  # the old report outlives a new one that is stopped
    assert {entry.name: entry.read_bytes() for entry in (out / "first").iterdir()} == before


def test_a_job_error_names_file_key_and_cure(tmp_path: Path) -> None:
    with pytest.raises(JobError) as caught:
        read_job(write_job(tmp_path, path=SOUND["path"] + "samlpes = 3\n"))
    assert caught.value.path == tmp_path / "job.toml"
    assert caught.value.key == "path.samlpes"
    assert caught.value.cure in str(caught.value)
