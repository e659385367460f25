"""The job file: strategies of physics, leaves to begin on, and the reference that has every key."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from pydantic import BaseModel
from scipy.spatial.transform import Rotation

import holokin as hk
from conftest import (
    PANDA_START,
    PPR_START,
    Command,
    assert_refused,
    assert_untouched,
    campaign,
    sampled,
    urdf,
    write_job,
)
from holokin.app.job import KINDS, is_job, job_strategy, keys_of, open_job, robot_of_file, run_job
from holokin.app.job.advice_job import question
from holokin.app.job.metrics import METRICS
from holokin.app.job.schema import Job, job_of, keys_beside
from holokin.app.job.strategy_tables import leaf_of_words
from holokin.app.report.job_result import JobResult
from holokin.app.studio import open_session
from holokin.base.errors import HolokinError, JobError

REFERENCE = (Path(__file__).parents[3] / "docs" / "job-keys.md").read_text("utf-8")

# --- strategies of physics, and leaves ------------------------------------------------------------------------

CIRCLE = '[path]\nkind = "circle"\ncenter = [-0.05, 0, 0]\nrelative = true\nsamples = 60\n'


def panda_job(folder: Path, strategy: str, robot: str = 'name = "panda"') -> tuple[str, Job, Path]:
    """A job of one strategy "s" of a Panda that draws a small circle."""
    parts = {
        "robot": f"[robot]\n{robot}\n",
        "task": '[task]\nkind = "pose"\norientation = "rotation-vector"\n',
        "start": f"[start]\nq = {PANDA_START.tolist()}\n",
        "strategies": f"[strategies.s]\n{strategy}\n",
    }
    return open_job(str(write_job(folder, path=CIRCLE, **parts)))


def weighed() -> str:
    return f'name = "{urdf("panda.urdf").as_posix()}"\ntip = "panda_hand_tcp"'


@pytest.mark.campaign
def test_least_kinetic_energy_does_not_come_home(tmp_path: Path) -> None:
    result = run_job(*panda_job(tmp_path, 'kind = "inertia-weighted"', weighed())).strategies[0]
    assert not result.verdict.holonomic
    assert result.metrics["drift"] > 1e-2
    assert result.metrics["speed"] > 1
    with pytest.raises(JobError):
        run_job(*panda_job(tmp_path, 'kind = "inertia-weighted"'))


@pytest.mark.campaign
@sampled(1, "extra", ["", "stiffness = 2\n", 'stiffness = [4, 4, 1, 1, 1, 1, 1]\nforce = "stiffness"\n'])
def test_an_arm_on_springs_with_one_redundant_joint_comes_home(tmp_path: Path, extra: str) -> None:
    springs = f'kind = "impedance"\npreferred = {[0.0, *PANDA_START[1:].tolist()]}\n{extra}'
    result = run_job(*panda_job(tmp_path, springs)).strategies[0]
    assert result.verdict.holonomic
    assert result.metrics["drift_total"] < 1e-7


@pytest.mark.campaign
def test_springs_of_one_strength_pull_alike_whatever_it_is(tmp_path: Path) -> None:
    """U and 3 U have the same stationary postures; springs of unequal strength have others."""

    def home(extra: str) -> np.ndarray:
        text = f'kind = "stationary"\ncost = "posture"\nlevel = 0\npreferred = [0, 0, 0, -2, 0, 2, 0]\n{extra}'
        return run_job(*panda_job(tmp_path, text)).strategies[0].cycles.q[0]

    even = home("")
    assert home("stiffness = 3") == pytest.approx(even, abs=1e-9)
    assert np.abs(home("stiffness = [9, 1, 1, 1, 1, 1, 1]") - even).max() > 1e-2


@pytest.mark.campaign
def test_a_strategy_on_the_leaf_of_no_weight_begins_where_the_self_motion_lifts_nothing(tmp_path: Path) -> None:
    gravity = 'kind = "stationary"\ncost = "gravity"\nlevel = 0'
    name, job, file = panda_job(tmp_path, gravity, weighed())
    result = run_job(name, job, file)
    walk, robot = result.strategies[0].cycles, result.robot
    n = hk.pose(robot).null_space(walk.q[0])[:, 0]
    h = 1e-5 * n / np.linalg.norm(n)
    up, down = (height_of_mass(robot, walk.q[0] + step) for step in (h, -h))
    elsewhere = [height_of_mass(robot, PANDA_START + step) for step in (h, -h)]
    assert abs(up - down) < 1e-3 * abs(elsewhere[0] - elsewhere[1])
    assert robot.pose(walk.q[0]) == pytest.approx(robot.pose(PANDA_START), abs=1e-9)
    assert result.strategies[0].metrics["drift_total"] < 1e-9
    assert "s begins on the leaf of level 0, moved to from the start posture, at panda_joint1 0." in result.about


def height_of_mass(robot: hk.Robot, q: np.ndarray) -> float:
    """Sum of m z over the bodies, from the joints' frames by the URDF's own inertials."""
    frames: list[np.ndarray] = []
    for joint in robot.joints:
        before = np.eye(4) if joint.parent < 0 else frames[joint.parent]
        value, motion = joint.multiplier * q[joint.coordinate] + joint.offset, np.eye(4)
        if joint.kind == "prismatic":
            motion[:3, 3] = value * joint.axis
        else:
            motion[:3, :3] = Rotation.from_rotvec(value * joint.axis).as_matrix()
        frames.append(before @ joint.placement @ motion)
    return sum(b.mass * float((frames[b.joint] @ [*b.center, 1.0])[2]) for b in robot.bodies if b.joint >= 0)


@sampled(1, "level", ["0.3", "[0.3]"])
def test_a_locked_joint_is_held_at_its_level(tmp_path: Path, level: str) -> None:
    result = run_job(*panda_job(tmp_path, f'kind = "lock"\njoints = ["panda_joint3"]\nlevel = {level}'))
    for walk in result.strategies[0].trajectories().values():
        assert walk.q[:, 2] == pytest.approx(0.3, abs=1e-10)
    assert "on the leaf of level 0.3" in result.about
    assert result.q0[2] == PANDA_START[2]


def test_a_joint_follows_formulas_of_the_tools_pose(tmp_path: Path) -> None:
    keys = 'kind = "lock"\njoints = ["panda_joint3"]\nfollows = ["0.5 * y + 0.2 * r12"]'
    result = run_job(*panda_job(tmp_path, keys))
    robot = hk.load("panda")
    for walk in result.strategies[0].trajectories().values():
        poses = robot.pose(walk.q)
        away = walk.q[:, 2] - 0.5 * poses[:, 1, 3] - 0.2 * poses[:, 0, 1]
        assert np.ptp(walk.q[:, 2]) > 1e-3 > 1e-9 > np.ptp(away)


@pytest.mark.parametrize(
    ("strategy", "words"),
    [
        ('kind = "lock"\njoints = ["q3"]\nfollows = ["x", "y"]\n', "what 'lock' follows has shape (2, 1)"),
        ('kind = "lock"\njoints = ["q3"]\nfollows = ["q1"]\n', "q1"),
        ('kind = "moore-penrose"\nlevel = 0\n', "does not use level; leave it out"),
        ('kind = "lock"\njoints = ["q3"]\nleaf = 0.1\n', "did you mean 'level'? known"),
        ('kind = "impedance"\n', "needs preferred"),
        ('kind = "impedance"\npreferred = [0]\nstiffness = 0\n', "[strategies.s.stiffness] is 0; give a number above"),
        ('kind = "stationary"\ncost = "gravity"\nstiffness = 2\n', "'gravity' has no stiffness; leave it out"),
        ('kind = "stationary"\ncost = "gravity"\npreferred = [1]\n', "go together"),
        ('kind = "lock"\njoints = ["q3"]\nlevel = [0.1, 0.2]\n', "the level has shape (2,), expected (1,)"),
        ('kind = "lock"\njoints = ["q2"]\nlevel = 50\n', "is more than two turns beyond the joint limits"),
    ],
)
def test_a_leaf_or_a_spring_that_does_not_fit_is_refused(
    holokin: Command, tmp_path: Path, out: Path, strategy: str, words: str
) -> None:
    assert_refused(holokin("run", write_job(tmp_path, strategies="[strategies.s]\n" + strategy), "--out", out), words)
    assert_untouched(out)


def test_a_joint_that_weighs_more_moves_less_in_jobs_and_in_python(tmp_path: Path, ppr: hk.Robot) -> None:
    """Of all rates that do the task, G dx has the least dq^T weight dq; a job's formulas mean what Python's do."""
    laws = (
        '[strategies.even]\nkind = "weighted"\nweight = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n'
        '[strategies.heavy]\nkind = "weighted"\nweight = [[1, 0, 0], [0, 1, 0], [0, 0, "4 + 0 * q1"]]\n'
        '[strategies.written]\nkind = "right-inverse"\nG = [[1, 0], [0, 1], [0, 0]]\n'
    )
    _, job, file = open_job(str(write_job(tmp_path, strategies=laws)))
    even, heavy, written = (job_strategy(job, file, name)[1](PPR_START) for name in ("even", "heavy", "written"))
    weight = np.diag([1.0, 1.0, 4.0])
    for axis in (0, 1):
        assert abs(heavy[2, axis]) < 0.5 * abs(even[2, axis])
        for other in (even, written):
            assert heavy[:, axis] @ weight @ heavy[:, axis] < other[:, axis] @ weight @ other[:, axis]
    assert heavy == pytest.approx(hk.weighted(hk.position(ppr), weight)(PPR_START), abs=1e-14)
    assert written.tolist() == [[1, 0], [0, 1], [0, 0]]


BUMP = "exp(-((q1 - 1.03)**2 + (q2 + 0.41)**2 + (q3 - 0.65)**2) / 0.005**2)"


def test_a_thorough_verdict_finds_a_place_that_a_few_postures_miss(tmp_path: Path) -> None:
    """A lock of q3 that gives way in a ball of 5 mm: 64 postures pass it by, 65,536 do not."""
    strategy = f'[strategies.s]\nkind = "pfaffian"\nA = [["{BUMP}", 0, 1]]\n'
    found = {}
    for thorough in ("false", "true"):
        job = write_job(tmp_path, strategies=strategy, expect=f"[verdict]\nthorough = {thorough}\n")
        found[thorough] = run_job(*open_job(str(job))).strategies[0].verdict
    assert (found["false"].holonomic, found["true"].holonomic) == (True, False)
    assert np.linalg.norm(found["true"].witness - [1.03, -0.41, 0.65]) < 0.03


@pytest.mark.parametrize(
    ("verdict", "words"),
    [
        ("thorough = true\nsamples = 64\n", "[verdict] samples and thorough both say how many"),
        ("thorough = 0\n", "[verdict.thorough] is 0; give true or false or at least 1"),
    ],
)
def test_a_thorough_verdict_has_a_number_of_its_own(
    holokin: Command, tmp_path: Path, out: Path, verdict: str, words: str
) -> None:
    assert_refused(holokin("run", write_job(tmp_path, expect="[verdict]\n" + verdict), "--out", out), words)


# --- the reference of the job file ----------------------------------------------------------------------------


@pytest.mark.campaign
def test_the_references_example_runs_and_shows_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOLOKIN_NATIVE", "0")
    (name,) = re.findall(
        r'--8<-- "(examples/.+)"', (Path(__file__).parents[3] / "docs" / "paths.md").read_text("utf-8")
    )
    example = (Path(__file__).parents[3] / name).read_text("utf-8")
    result = run_job(*open_job(str(Path(__file__).parents[3] / name)))
    assert result.passed, [c for s in result.strategies for c in s.checks if not c.passed]
    assert {s.name: s.verdict.holonomic for s in result.strategies} == {
        "moore-penrose": False, "level-joint": True, "arm-angle": True, "near-start": True, "springs": True,
    }  # fmt: skip
    several = {"air", "frames"}  # of jobs of several paths
    assert set(Job.model_fields) - several <= set(re.findall(r"^\[?(\w+)", example, re.MULTILINE))


def section(heading: str) -> dict[str, list[str]]:
    """First cell of each row of a section's tables -> the other cells; quotes and brackets off."""
    text = REFERENCE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("| `")]
    return {re.sub(r"\.NAME|[`\[\]]", "", first): rest for first, *rest in rows}


def tables(of: Any, seen: frozenset[type[BaseModel]] = frozenset()) -> frozenset[type[BaseModel]]:
    """All tables that a value of a type may hold, at any depth."""
    if isinstance(of, type) and issubclass(of, BaseModel):
        if of in seen:
            return seen
        within: Any = [field.annotation for field in of.model_fields.values()]
        seen |= {of}
    else:
        within = get_args(of)
    for one in within:
        seen = tables(one, seen)
    return seen


@pytest.mark.parametrize(
    ("key", "nearest"),
    [
        ("task.parts.0.kidn", "kind"), ("path.others.0.sampels", "samples"), ("path.frame.xzy", "xyz"),
        ("robot.parts.0.tool.ryp", "rpy"), ("robot.coordinates.naems", "names"), ("expect.s.drift.abvoe", "above"),
        ("checks.obstacles.0.sdies", "sides"), ("timing.acceleratoin", "acceleration"), ("tmiing", "timing"),
        ("strategies.s.methdo", "method"),
    ],
)  # fmt: skip
def test_a_misspelt_key_at_any_depth_is_told_the_keys_of_its_own_table(key: str, nearest: str, tmp_path: Path) -> None:
    content: Any = {key.rpartition(".")[2]: 1}
    for part in reversed(key.split(".")[:-1]):
        content = [content] if part == "0" else {part: content}
    if "strategies" in content:
        content["strategies"]["s"]["kind"] = "moore-penrose"
    with pytest.raises(JobError) as told:
        job_of(tmp_path / "job.toml", content)
    assert f"[{key}] is an unknown key" in str(told.value)
    assert f"did you mean {nearest!r}?" in str(told.value)


TABLES = [
    "robot",
    "task",
    "start",
    "path",
    "air",
    "timing",
    "program",
    "checks",
    "workspace",
    "strategies",
    "expect",
    "verdict",
]


@pytest.mark.parametrize("name", TABLES)
def test_the_reference_has_every_key_and_no_other(name: str) -> None:
    heading = f"`[{name}.NAME]`" if name in ("strategies", "expect") else f"`[{name}]`"
    if name == "strategies":
        keys = {key for model in KINDS.values() for key in model.model_fields}
        assert set(section(heading)) == (keys - {"kind"}) | set(KINDS)
    else:
        assert set(section(heading)) == set(keys_beside(Job, (name, *(["NAME"] if name == "expect" else []), "")))


def test_the_reference_has_every_table_and_says_what_each_kind_and_figure_is() -> None:
    assert set(section("Top level")) == set(Job.model_fields)
    kinds, figures = section("`[strategies.NAME]`"), section("`[expect.NAME]`")
    for kind, model in KINDS.items():
        needed, optional = keys_of(model)
        needs, may, about = kinds[kind]
        assert tuple(re.findall(r"`(\w+)`", needs)) == needed, kind
        assert tuple(re.findall(r"`(\w+)`", may)) == optional, kind
        assert len(about) > 10
    assert {key for key in figures if key not in ("holonomic", "completes")} == set(METRICS)
    for table in tables(Job):
        for field, info in table.model_fields.items():
            words = " ".join(re.findall(r"Literal\[(.*?)\]", str(info.annotation)))
            for word in re.findall(r"'([a-z-]+)'", words):
                assert f'"{word}"' in REFERENCE or f"`{word}`" in REFERENCE, (field, word)


# --- TOML as people write it: every door that takes a file reads it with one reader, which names what is wrong.


DOORS: dict[str, Callable[[str], object]] = {
    "load": hk.load,
    "robots": robot_of_file,
    "run": open_job,
    "studio": open_session,
    "advise": question,
}


def _nested(depth: int, draw: np.random.Generator) -> str:
    if draw.random() < 0.5:
        return f"a = {'[' * depth}{']' * depth}\n"
    return f"a = {'{b = ' * depth}1{'}' * depth}\n"


@pytest.mark.parametrize("door", DOORS)
def test_tables_nested_however_deep_are_refused_in_a_sentence(door: str, tmp_path: Path) -> None:
    draw = np.random.default_rng(3)
    file = tmp_path / "deep.toml"
    for depth in (17, *np.exp(draw.uniform(np.log(18), np.log(20_000), 3)).astype(int)):
        for head in ("", '[robot]\nname = "panda"\n'):
            file.write_text(head + _nested(int(depth), draw))
            with pytest.raises(HolokinError, match="deeper than 16 levels"):
                DOORS[door](str(file))


@pytest.mark.parametrize("door", DOORS)
def test_a_windows_path_in_double_quotes_is_told_how_to_write_it(door: str, tmp_path: Path) -> None:
    """TOML takes some of its backslashes for other characters, the rest for mistakes."""
    draw = np.random.default_rng(5)
    file = tmp_path / "windows.toml"
    for _ in range(6):
        parts = draw.choice(["Users", "arm", "data", "me", "home", "xarm", "Ulm", "u2", "dir"], 3)
        file.write_text('[robot]\nname = "' + "\\".join(["C:", *parts, "m.urdf"]) + '"\n')
        with pytest.raises(HolokinError, match=r"write paths in single quotes, 'C:\\Users\\me', or with /"):
            DOORS[door](str(file))


def test_a_path_of_which_toml_made_control_characters_is_told_so(tmp_path: Path) -> None:
    for name in (r"C:\robots.urdf", r"C:\tools.toml", r"D:\new.xml", r"D:\fanuc.urdf"):
        (tmp_path / "job.toml").write_text(
            open_job("panda-circle")[2].read_text("utf-8").replace('"panda"', f'"{name}"')
        )
        with pytest.raises(HolokinError, match="control characters"):
            robot_of_file(str(tmp_path / "job.toml"))


def test_a_byte_order_mark_changes_nothing(tmp_path: Path) -> None:
    with_mark = tmp_path / "marked.toml"
    _, job, file = open_job("panda-circle")
    with_mark.write_text(file.read_text("utf-8"), "utf-8-sig")
    assert with_mark.read_bytes()[:3] == b"\xef\xbb\xbf"
    assert is_job(str(with_mark)) and open_job(str(with_mark))[1] == job
    for door in ("robots", "studio", "advise"):
        assert DOORS[door](str(with_mark))


def test_a_strategy_that_is_typed_with_nested_lists_is_refused(planar_3r: hk.Robot) -> None:
    for depth in (20, 3000):
        with pytest.raises(HolokinError, match="deeper than 16 levels"):
            leaf_of_words(f"lock joints={'[' * depth}{']' * depth}", hk.position(planar_3r), np.zeros(3))


# --- `holokin new --robot`: a job for another robot than the packaged ones', that runs as it is written.


def done(file: Path) -> JobResult:
    """The job, with its verdicts shortened."""
    name, job, path = open_job(str(file))
    return run_job(name, job.model_copy(update={"verdict": job.verdict.model_copy(update={"samples": 4})}), path)


def assert_fits(result: JobResult, robot: hk.Robot) -> None:
    assert result.passed
    assert result.title.startswith(robot.name)
    named = {s.name: s for s in result.strategies}
    assert {name: s.verdict.holonomic for name, s in named.items()} == {
        "moore-penrose": False, "lock": True, "radial": True,
    }  # fmt: skip
    assert all(not s.checks for s in named.values())  # nothing is expected that nobody measured
    assert all(s.status is hk.motion.Status.COMPLETE for s in named.values())
    assert named["lock"].metrics["drift_total"] < 1e-9 < named["moore-penrose"].metrics["drift_total"]
    walls = np.minimum(result.q0 - robot.lower, robot.upper - result.q0)
    ranges = robot.upper - robot.lower
    assert (walls[np.isfinite(ranges)] > 0.2 * ranges[np.isfinite(ranges)]).all()
    assert min(s.metrics["sigma"] for s in named.values()) > 0.05


MORE = ("planar-3r", "irb140", "so101", "openarm", "openarm-right", "rizon4s")


@pytest.mark.parametrize("name", ["ppr", *(campaign("name", name) for name in MORE)])
def test_a_new_job_for_a_robot_of_the_catalogue_runs_as_it_is(holokin: Command, tmp_path: Path, name: str) -> None:
    file = tmp_path / "mine.toml"
    outcome = holokin("new", file, "--robot", name)
    assert (outcome.code, outcome.err) == (0, "")
    assert "panda" not in file.read_text("utf-8").lower()
    assert_fits(done(file), hk.load(name))


@pytest.mark.campaign
def test_a_new_job_for_a_urdf_beside_it_can_be_moved_with_it(
    holokin: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "old").mkdir()
    shutil.copy(urdf("panda.urdf"), tmp_path / "old" / "arm.urdf")
    monkeypatch.chdir(tmp_path / "old")
    assert holokin("new", "mine.toml", "--robot", "arm.urdf", "--tip", "panda_hand_tcp").code == 0
    monkeypatch.chdir("/")
    (tmp_path / "old").rename(tmp_path / "new")
    file = tmp_path / "new" / "mine.toml"
    assert_fits(done(file), hk.from_urdf(tmp_path / "new" / "arm.urdf", tip="panda_hand_tcp"))


def test_a_new_job_says_what_it_needs(holokin: Command, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    assert_refused(holokin("new", file, "--robot", "pandaa"), "unknown robot 'pandaa'", "did you mean 'panda'")
    assert_refused(holokin("new", file, "--robot", "ppr", "--from", "orientation"), "give one of them")
    assert_refused(holokin("new", file, "--tip", "hand"), "give the robot, too")
    assert_refused(holokin("new", file, "--robot", str(urdf("g1_29dof_rev_1_0.urdf"))), "tip")
    bar = tmp_path / "bar.toml"
    bar.write_text('name = "bar"\nsource = "a test"\njoints = [{ a = 1.0 }]\n')
    assert_refused(holokin("new", file, "--robot", bar), "'bar' is 1", "two")
    assert not file.exists()
    file.write_text("mine")
    assert_refused(holokin("new", file, "--robot", "ppr"), "exists already")
    assert file.read_text() == "mine"
