"""What a bad job file gets, on the command line: exit code 2, one sentence, and nothing half-written."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, PPR_CENTER, SOUND, Command, assert_refused, assert_untouched, sampled, urdf, write_job
from holokin.app.job import read_job
from holokin.base.errors import JobError, JointLimitError, OutOfReachError

pytestmark = pytest.mark.usefixtures("sketched")  # what is written when is the statement, not what is drawn

# --- the command line: files, keys and names ------------------------------------------------------------------


def test_the_job_that_the_tests_spoil_is_sound(holokin: Command, tmp_path: Path, out: Path) -> None:
    outcome = holokin("run", write_job(tmp_path), "--out", out)
    assert (outcome.code, outcome.err) == (0, "")
    assert "NOT holonomic" in outcome.out
    assert sorted(entry.name for entry in out.iterdir()) == ["job", "mine.txt"]


def test_a_job_that_is_missing_malformed_or_unknown_is_refused_in_one_sentence(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    malformed = write_job(tmp_path, title='title = "a circle\n')
    for name, words in {
        tmp_path / "nothing.toml": ("nothing.toml", "no such file", "holokin jobs"),
        malformed: ("job.toml", "is not TOML", "line 1"),
        "ppr-cycles": ("did you mean 'ppr-cycle'", "`holokin jobs`"),
        "nothing-like-it": ("panda-circle", "ppr-half-circle", ".toml"),
    }.items():
        assert_refused(holokin("run", name, "--out", out), *words)
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
        ({"strategies": SOUND["strategies"] + "mass = 2\n"}, "[strategies.moore-penrose.mass]"),
        ({"expect": "[expect.moore-penrose]\ndrfit = { below = 1 }\n"}, "[expect.moore-penrose.drfit]"),
        ({"expect": '[strategy.lock]\nkind = "lock"\n'}, "[strategy]"),
    ],
)
def test_an_unknown_key_is_refused_by_file_key_and_cure(
    holokin: Command, tmp_path: Path, out: Path, spoilt: dict[str, str], key: str
) -> None:
    outcome = holokin("run", write_job(tmp_path, **spoilt), "--out", out)
    assert_refused(outcome, "job.toml", f"{key} is an unknown key", "known: ")
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
        ({"robot": '[robot]\nname = "arm.xml"\n'}, ("arm.xml", "no such file")),
        ({"robot": '[robot]\nname = "arm.stl"\n'}, ("arm.stl", ".xacro", "or a .toml table")),
        ({"robot": "[robot]\nname = 3\n"}, ("job.toml", "[robot.name] is 3")),
        ({"robot": '[robot]\nname = "ppr"\ntip = "hand"\n'}, ("hand", "only models (.urdf")),
        (
            {"strategies": '[strategies.held]\nkind = "lock"\njoints = ["q4"]\n'},
            ("unknown joint 'q4'", "known: q1, q2, q3"),
        ),
        (
            {"strategies": '[strategies.mine]\nkind = "moore"\n'},
            ("job.toml", "[strategies.mine.kind] is 'moore'", "did you mean 'moore-penrose'?", "null-basis"),
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


def test_half_a_urdf_is_not_half_an_arm(holokin: Command, tmp_path: Path, out: Path) -> None:
    text = urdf("panda.urdf").read_text()
    (tmp_path / "half.urdf").write_text(text[: len(text) // 2])
    assert_refused(holokin("robots", tmp_path / "half.urdf"), "half.urdf", "is not XML")
    robot = '[robot]\nname = "half.urdf"\ntip = "panda_link3"\n'
    assert_refused(holokin("run", write_job(tmp_path, robot=robot), "--out", out), "half.urdf", "is not XML")
    assert_untouched(out)


# --- the command line: numbers --------------------------------------------------------------------------------


@sampled(1, "value", ["nan", "inf", "-inf"])
@sampled(
    4,
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


def test_a_path_out_of_reach_says_where_and_what_was_followed_is_written(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    file = write_job(
        tmp_path,
        robot='[robot]\nname = "irb140"\n',
        start="[start]\nq = [10, 70, 10, 20, 50, 30]\ndegrees = true\n",
        path='[path]\nkind = "polyline"\npoints = [[0, 0, 0], [2, 0, 0]]\nrelative = true\nsamples = 50\n',
    )
    outcome = holokin("run", file, "--out", out)
    assert (outcome.code, outcome.err) == (1, "")
    for word in ("out of reach", "% along the path", "move or shrink the path"):
        assert word in " ".join(outcome.out.split())
    (walk,) = (out / "job").glob("*cycles*.csv")
    times = np.loadtxt(walk, delimiter=",", skiprows=1)
    assert 3 < len(times) < 50
    found = json.loads((out / "job" / "result.json").read_text())
    assert found["strategies"][0]["status"] == "out_of_reach"
    assert "out of reach" in (out / "job" / "report.html").read_text()


def test_out_of_reach_keeps_what_was_computed(planar_3r: hk.Robot) -> None:
    strategy = hk.moore_penrose(hk.position(planar_3r))
    q = np.array([0.2, 0.8, 0.9])
    tool = planar_3r.pose(q)[:3, 3]
    with pytest.raises(OutOfReachError) as caught:
        hk.follow(strategy, hk.line(tool, tool / np.linalg.norm(tool) * 3.5), q, samples=100)
    walk = caught.value.trajectory
    assert walk.status is hk.motion.Status.OUT_OF_REACH
    assert 10 < len(walk) < 101
    assert np.linalg.norm(walk.x[-1]) < 3.0


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ('kind = "circle"\n', ("kind = 'circle' needs center",)),
        ('kind = "circle"\ncenter = [0, 0]\nrelative = true\n', ("radius",)),
        ('kind = "circle"\ncenter = [0.1, 0]\nnormal = [1, 0, 0]\nrelative = true\n', ("perpendicular",)),
        ('kind = "arc"\ncenter = [0, 0]\nangle_deg = 90\ncycles = 2\n', ("closed path",)),
        ('kind = "polyline"\npoints = [[0, 0]]\nrelative = true\n', ("at least two",)),
        ('kind = "polyline"\npoints = [[0, 0], [0, 0]]\nrelative = true\n', ("points that differ",)),
        ('kind = "polyline"\npoints = [[0, 0], [1, 0]]\n', ("away from the start of the path", "relative = true")),
        ('kind = "polyline"\npoints = [[0, 0, 0, 0], [1, 0]]\n', ("[path.points.0]",)),
        ('kind = "helix"\ncenter = [0, 0]\n', ("[path.kind] is 'helix'", "circle, arc")),
        ('kind = "circle"\ncenter = [1.2070, 0.4036]\nsamples = 0\n', ("[path.samples] is 0",)),
        ('kind = "circle"\ncenter = [1.2070, 0.4036]\nspeed = -1\n', ("[path.speed] is -1",)),
    ],
)
def test_a_path_that_is_none_is_refused(
    holokin: Command, tmp_path: Path, out: Path, path: str, words: tuple[str, ...]
) -> None:
    assert_refused(holokin("run", write_job(tmp_path, path="[path]\n" + path), "--out", out), *words)
    assert_untouched(out)


def test_a_job_error_names_file_key_and_cure(tmp_path: Path) -> None:
    with pytest.raises(JobError) as caught:
        read_job(write_job(tmp_path, path=SOUND["path"] + "samlpes = 3\n"))
    assert caught.value.path == tmp_path / "job.toml"
    assert caught.value.key == "path.samlpes"
    assert caught.value.cure in str(caught.value)


# --- a strategy that cannot be run costs its own row and the exit code; the others of its job are reported ----

LINE = '[path]\nkind = "polyline"\npoints = [[0, 0, 0], [0.03, 0, 0]]\nrelative = true\nsamples = 20\n'
PANDA = {
    "robot": '[robot]\nname = "panda"\n',
    "task": '[task]\nkind = "pose"\n',
    "start": f"[start]\nq = {PANDA_START.tolist()}\n",
    "path": LINE,
}
PLAIN = '[strategies.moore-penrose]\nkind = "moore-penrose"\n'
UNSETTLED = '[strategies.far]\nkind = "lock"\njoints = ["panda_joint3"]\nlevel = 2.5\n'
SINGULAR = '[strategies.flat]\nkind = "custom"\ng = ["1"]\n'


@sampled(
    1,
    ("strategy", "name", "words"),
    [(UNSETTLED, "far", ("moving to the leaf failed", "level 2.5")), (SINGULAR, "flat", ("algorithmic singularity",))],
)
def test_a_strategy_that_cannot_be_run_leaves_the_others_their_table(
    holokin: Command, tmp_path: Path, out: Path, strategy: str, name: str, words: tuple[str, ...]
) -> None:
    file = write_job(tmp_path, **PANDA, strategies=strategy + PLAIN)
    outcome = holokin("run", file, "--out", out)
    assert (outcome.code, outcome.err) == (2, "")
    rows = {line.split("\u2502")[1].strip(): line for line in outcome.out.splitlines() if line.startswith("\u2502")}
    assert "NOT run" in rows[name] and "FAILED" in rows[name]
    assert "NOT holonomic" in rows["moore-penrose"]
    told = " ".join(outcome.out.split())
    page = (out / "job" / "report.html").read_text("utf-8")
    facts = json.loads((out / "job" / "result.json").read_text("utf-8"))
    for word in (f"{name}: not run: ", *words):
        assert word in told
    for word in words:
        assert word in page
        assert word in facts["not_run"][0]["reason"]
    assert (facts["passed"], [s["name"] for s in facts["strategies"]]) == (False, ["moore-penrose"])
    assert (out / "job" / "moore-penrose-cycles.csv").is_file()


def test_a_job_of_which_no_strategy_can_be_run_is_refused_with_the_reason(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    outcome = holokin("run", write_job(tmp_path, **PANDA, strategies=UNSETTLED + SINGULAR), "--out", out)
    assert_refused(outcome, "moving to the leaf failed", "level 2.5")
    assert_untouched(out)


def test_a_mistake_in_one_strategy_still_stops_its_job_before_it_writes(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    wrong = '[strategies.wrong]\nkind = "lock"\njoints = ["panda_joint9"]\n'
    outcome = holokin("run", write_job(tmp_path, **PANDA, strategies=PLAIN + wrong), "--out", out)
    assert outcome.code == 2
    assert "[strategies.wrong] unknown joint 'panda_joint9'" in outcome.err
    assert not (out / "job").exists()
