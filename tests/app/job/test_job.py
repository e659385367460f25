"""Jobs: the packaged ones show what the paper shows, a report is whole, and a copied job with a URDF works."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused, campaign, urdf, write_job
from holokin.analysis.coverage import PoseStatus, coverage_slices
from holokin.app.job import PAPER, expand, new_job, open_job, packaged_jobs, run_job
from holokin.app.job.metrics import METRICS
from holokin.app.job.schema import Bound, Job
from holokin.app.report import animation as films
from holokin.app.report.animation import animate
from holokin.app.report.job_figures import figures
from holokin.app.report.job_report import columns, number, print_result, rows, write_report
from holokin.app.report.job_result import JobResult
from holokin.app.report.sheets_plots import CAUSES, coverage_cloud, coverage_figure, slice_map
from sketches import sketches

RESULTS = (Path(__file__).parents[3] / "docs" / "paper.md").read_text("utf-8")


@cache
def done(job: str) -> JobResult:
    """A packaged job, run once for all statements about it."""
    return run_job(*open_job(job))


@pytest.mark.parametrize("job", [campaign("job", job) if job == "orientation" else job for job in packaged_jobs()])
def test_every_packaged_job_shows_what_it_expects(job: str) -> None:
    result = done(job)
    assert result.passed, [c for s in result.strategies for c in s.checks if not c.passed]
    assert all(s.checks for s in result.strategies)
    assert {s.verdict.holonomic for s in result.strategies} == {True, False}
    for strategy in result.strategies:
        assert set(strategy.metrics) == set(METRICS)
        home = strategy.metrics["drift_total"] < 1e-9
        assert home is strategy.verdict.holonomic


@pytest.mark.parametrize("job", [job for job in PAPER if f"out/{job}/report.html" in RESULTS])
def test_the_tables_shown_are_what_the_jobs_print_today(job: str) -> None:
    """Every printed cell that is not round-off."""
    printed = [{cell.strip() for cell in line.split("│")} for line in RESULTS.splitlines() if "│" in line]
    for shown in rows(done(job)):
        wanted = [cell for cell in shown[1:] if not ("e-" in cell and float(cell) < 1e-9)]
        assert any(set(wanted) <= cells for cells in printed), wanted


def test_the_page_of_the_paper_shows_the_tables_of_both_arms() -> None:
    assert re.findall(r"report: out/(.+)/report.html", RESULTS) == ["ppr-half-circle", "irb140-half-square"]


def test_paper_is_the_name_of_four_jobs() -> None:
    assert expand(["paper", "panda-circle"]) == [*PAPER, "panda-circle"]
    assert set(PAPER) | {"panda-circle"} == set(packaged_jobs())


def test_an_expectation_that_is_wrong_fails(tmp_path: Path) -> None:
    name, job, file = open_job("irb140-half-square")
    wrong = job.expect | {
        "coupled": job.expect["coupled"].model_copy(update={"holonomic": False, "drift": Bound(above=1)})
    }
    wrong, chosen = {"coupled": wrong["coupled"]}, {"coupled": job.strategies["coupled"]}
    result = run_job(name, job.model_copy(update={"expect": wrong, "strategies": chosen}), file)
    failed = [c.metric for s in result.strategies for c in s.checks if not c.passed]
    assert failed == ["holonomic", "drift"]
    assert not result.passed


def test_a_report_is_one_folder_written_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = done("ppr-half-circle")
    result = replace(whole, strategies=whole.strategies[:2])
    folder = write_report(result, tmp_path / "out", "0")
    names = {p.name for p in folder.iterdir()}
    assert {"report.html", "result.json", "robot.png", "robot.svg", "paths-paper.png", "paper-clockwise.csv"} <= names
    facts = json.loads((folder / "result.json").read_text())
    assert facts["passed"] is True
    assert facts["strategies"][0]["metrics"]["spread"] == pytest.approx(0.1428034, abs=1e-6)
    assert facts["strategies"][0]["metrics"]["residual"] is None
    page = (folder / "report.html").read_text()
    assert not re.findall(r"(?:src|href)=['\"](?!data:)", page)  # self-contained
    assert page.count("<img") == len(list(folder.glob("*.png")))
    for strategy in result.strategies:
        assert strategy.name in page
    monkeypatch.setattr("holokin.app.report.job_report.figures", sketches)
    again = write_report(result, tmp_path / "out", "0")  # its own folder may be written again
    assert again == folder
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["ppr-half-circle"]


def test_figures_show_the_data_they_are_of() -> None:
    whole = done("ppr-cycle")
    result = replace(whole, strategies=whole.strategies[:2])
    made = {stem: figure for stem, _, figure in figures(result)}
    assert set(made) == {"robot", "cycles", "drift", "ranges", *(f"paths-{s.name}" for s in result.strategies)}
    pseudo = result.strategies[0]
    for joint, axes in enumerate(made["paths-moore-penrose"].axes[: pseudo.two_paths[0].q.shape[1]]):
        ends = [line.get_ydata()[-1] for line in axes.lines if "clockwise" in str(line.get_label())]
        assert ends == [walk.q[-1, joint] for walk in pseudo.two_paths]
        styles = [line.get_linestyle() for line in axes.lines if "clockwise" in str(line.get_label())]
        assert styles == ["-", "--"]  # clockwise solid, counter-clockwise dashed
    drift = made["drift"].axes[0].lines[0].get_ydata()
    assert drift == pytest.approx(np.abs(pseudo.cycles.drift_since_start()).max(axis=1))


def test_clockwise_is_clockwise() -> None:
    """From the circle's rightmost point, clockwise (seen against z) goes down first."""
    result = done("ppr-half-circle")
    clockwise, counter = result.strategies[0].two_paths
    assert clockwise.x[10, 1] < clockwise.x[0, 1]
    assert counter.x[10, 1] > counter.x[0, 1]


@pytest.mark.campaign
def test_films_without_ffmpeg_are_moving_gifs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from PIL import Image

    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(films, "WIDTH", 140)
    monkeypatch.setattr(films, "FRAMES", 10)
    name, job, file = open_job("ppr-cycle")
    path = job.path.model_copy(update={"cycles": 2, "samples": 60})
    chosen = {"moore-penrose": job.strategies["moore-penrose"]}
    result = run_job(name, job.model_copy(update={"path": path, "strategies": chosen, "expect": {}}), file)
    assert [file for file, _ in animate(result, tmp_path)] == ["cycles.gif", "paths.gif"]
    assert {p.name for p in tmp_path.iterdir()} == {"cycles.gif", "paths.gif"}
    with Image.open(tmp_path / "cycles.gif") as picture:
        assert picture.n_frames > 50
        first = np.asarray(picture.convert("RGB"), dtype=int)
        picture.seek(30)
        assert np.abs(np.asarray(picture.convert("RGB"), dtype=int) - first).max() > 50


@pytest.mark.campaign
def test_a_copied_job_pointed_at_a_urdf_gives_the_same_numbers(tmp_path: Path) -> None:
    file = tmp_path / "my-job.toml"
    new_job(file, "panda-circle")
    text = file.read_text().replace(
        'name = "panda"\n', f'name = "{urdf("panda.urdf").as_posix()}"\ntip = "panda_hand_tcp"\n', 1
    )
    file.write_text(text)
    name, job, path = open_job(str(file))
    result = run_job(name, job, path)
    assert name == "my-job"
    assert result.passed
    assert result.strategies[0].metrics["drift"] == pytest.approx(0.16348, abs=1e-5)


def test_a_robot_path_counts_from_the_job_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = Path(hk.__file__).parent / "robot" / "data" / "ppr.toml"
    (tmp_path / "mine.toml").write_text(robot.read_text())
    job = tmp_path / "job.toml"
    new_job(job, "ppr-half-circle")
    job.write_text(job.read_text().replace('name = "ppr"', 'name = "mine.toml"'))
    monkeypatch.chdir("/")
    assert run_job(*open_job(str(job))).passed


def test_a_strategy_that_hits_a_limit_is_a_result_and_fails_unless_expected() -> None:
    name, job, file = open_job("panda-circle")
    path = job.path.model_copy(update={"cycles": 60, "samples": 40})
    strategies = {"moore-penrose": job.strategies["moore-penrose"]}
    long = job.model_copy(update={"path": path, "strategies": strategies, "expect": {}})
    result = run_job(name, long, file)
    assert result.strategies[0].status is hk.motion.Status.LIMIT
    assert "outside its limits" in result.strategies[0].trouble
    assert not result.passed
    table = job.expect["moore-penrose"].model_copy(update={"completes": False, "drift": None, "drift_total": None})
    assert run_job(name, long.model_copy(update={"expect": {"moore-penrose": table}}), file).passed


def test_an_open_path_has_no_ways_and_no_drift() -> None:
    name, job, file = open_job("ppr-half-circle")
    arc = {"kind": "arc", "center": [1.2070, 0.4036], "angle_deg": 90, "samples": 50}
    table = job.model_dump(exclude_defaults=True) | {"path": arc, "expect": {}}
    result = run_job(name, Job.model_validate(table), file)
    assert result.strategies[0].two_paths is None
    assert np.isnan(result.strategies[0].metrics["spread"])
    assert {stem for stem, _, _ in figures(result)} == {"robot", "ranges"}


def test_the_table_says_it_all() -> None:
    from io import StringIO

    from rich.console import Console

    result = done("ppr-half-circle")
    text = StringIO()
    print_result(result, Console(file=text, width=120))
    words = "NOT holonomic|holonomic|drift / cycle|[m or rad]|two paths apart|tracking|sigma|speed|peak|0.143"
    for word in words.split("|"):
        assert word in text.getvalue()
    assert number(float("nan")) == "-"


@pytest.mark.parametrize(
    ("bound", "number", "holds"),
    [
        ({"above": 1, "below": 2}, 1.5, True), ({"above": 1, "below": 2}, 2.5, False), ({"below": 2}, np.nan, False),
        ({"value": 1, "within": 0.1}, 1.05, True), ({"value": 1, "within": 0.1}, 1.2, False),
    ],
)  # fmt: skip
def test_bounds(bound: dict[str, float], number: float, holds: bool) -> None:
    assert Bound(**bound).holds(number) is holds
    assert ("+-" in str(Bound(**bound))) == ("value" in bound)


# --- Jobs with a [workspace] table: what they find, show, write, and refuse.


PARTS = {
    "robot": '[robot]\nname = "planar-3r"\n',
    "start": "[start]\nq = [0.3, 0.9, 0.7]\n",
    "path": '[path]\nkind = "circle"\ncenter = [-0.1, 0]\nrelative = true\nsamples = 20\n',
    "workspace": '[workspace]\nkind = "box"\ncenter = [1.2, 1.6]\nhalf = [1.1, 0.9]\nsamples = 200\n',
    "strategies": '[strategies.pseudo]\nkind = "moore-penrose"\n[strategies.lock]\nkind = "lock"\njoints = [2]\n',
}


def job(folder: Path, **changed: str) -> Path:
    return write_job(folder, **(PARTS | changed))


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> JobResult:
    return run_job(*open_job(str(job(tmp_path_factory.mktemp("job")))))


def test_a_job_tells_the_share_of_every_strategy_with_leaves(result: JobResult) -> None:
    pseudo, lock = result.strategies
    assert pseudo.coverage is None
    assert np.isnan(pseudo.metrics["coverage"])
    assert lock.coverage is not None
    task = hk.position(hk.load("planar-3r"))
    locked, space = hk.holonomic(task, hk.lock(2)), hk.workspace(box=([1.2, 1.6], [1.1, 0.9]))
    alone = hk.coverage(locked, space, [0.3, 0.9, 0.7], samples=200)
    assert lock.metrics["coverage"] == lock.coverage.share == alone.share
    assert 0.3 < alone.share < 0.95
    assert lock.metrics["coverage_rcond"] == alone.rcond[alone.reached].min()


def test_the_table_has_a_column_only_in_a_job_with_a_workspace(result: JobResult, tmp_path: Path) -> None:
    heads = [head for head, _ in columns(result)]
    assert "work-\nspace" in heads
    cells = [row[heads.index("work-\nspace")] for row in rows(result)]
    assert cells == ["-", f"{result.strategies[1].metrics['coverage']:.1%}"]
    plain = run_job(*open_job(str(job(tmp_path, workspace=""))))
    assert "work-\nspace" not in [head for head, _ in columns(plain)]
    assert {len(row) for row in rows(plain)} == {len(columns(plain))}


@pytest.mark.campaign
def test_the_report_shows_shares_causes_and_pictures_and_keeps_every_pose(
    tmp_path: Path, out: Path, holokin: Command
) -> None:
    assert holokin("run", job(tmp_path), "--out", out).code == 0
    page = (out / "job" / "report.html").read_text("utf-8")
    assert "<h2>Workspace</h2>" in page
    assert "box [1.2, 1.6, 0] +- [1.1, 0.9, 0] m" in page
    assert PoseStatus.OUT_OF_REACH.text in page
    assert (out / "job" / "coverage-lock.png").stat().st_size > 10_000
    facts = json.loads((out / "job" / "result.json").read_text("utf-8"))
    (lock,) = [s for s in facts["strategies"] if s["name"] == "lock"]
    assert sum(lock["coverage"]["causes"].values()) == lock["coverage"]["poses"] == 200
    again = hk.path.read_workspace(out / "job" / "lock-workspace.csv")
    assert len(again.poses(1000)) == 200


@pytest.mark.usefixtures("sketched")
def test_a_share_that_was_expected_and_is_not_reached_fails_the_job(
    tmp_path: Path, out: Path, holokin: Command
) -> None:
    file = job(tmp_path, expect="[expect.lock]\ncoverage = { above = 0.99 }\ncoverage_rcond = { below = 1 }\n")
    outcome = holokin("run", file, "--out", out)
    assert outcome.code == 1
    assert "expected coverage > 0.99, found 0." in outcome.out
    assert "expected coverage_rcond" not in outcome.out


def test_a_file_of_poses_counts_from_the_job_file(tmp_path: Path) -> None:
    (tmp_path / "poses.csv").write_text("x,y,z,qx,qy,qz,qw\n1.5,1.2,0,0,0,0,1\n9,0,0,0,0,0,1\n", "utf-8")
    found = run_job(*open_job(str(job(tmp_path, workspace='[workspace]\nkind = "poses"\nfile = "poses.csv"\n'))))
    assert found.strategies[1].metrics["coverage"] == 0.5
    assert found.strategies[1].slices == ()


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('kind = "box"\ncenter = [1, 1]\n', ("workspace", "or center and half")),
        ('kind = "cylinder"\ncenter = [1, 1]\n', ("needs radius and half_height",)),
        ('kind = "sphere"\ncenter = [1, 1]\nradius = 1\nhalf = [1, 1]\n', ("does not use half",)),
        ('kind = "sphere"\ncenter = [1, 1]\nradius = 0\n', ("workspace.radius", "above 0")),
        ('kind = "box"\ncenter = [1, 1]\nhalf = [1, -1]\n', ("workspace", "not negative")),
        ('kind = "box"\ncenter = [1, 1]\nhalf = [0, 0]\n', ("workspace", "not all zero")),
        ('kind = "box"\ncenter = [1, 1]\nhalf = [1, 1]\ntilt_deg = 200\n', ("workspace.tilt_deg", "at most 180")),
        ('kind = "ball"\n', ("workspace.kind", "'ball'")),
        ('kind = "box"\ncenter = [1, 1]\nhalf = [1, 1]\nsample = 3\n', ("workspace.sample", "samples")),
        ('kind = "poses"\nfile = "none.csv"\n', ("none.csv", "no such file")),
        (
            'kind = "box"\ncenter = [1, 1]\nhalf = [1, 1]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, 2]]\n',
            ("workspace", "right-handed rotation matrix"),
        ),
    ],
)
def test_a_workspace_table_that_is_wrong_is_refused_with_its_key(
    tmp_path: Path, holokin: Command, out: Path, table: str, words: tuple[str, ...]
) -> None:
    assert_refused(holokin("run", job(tmp_path, workspace=f"[workspace]\n{table}"), "--out", out), *words)


def test_an_expected_share_that_no_job_can_show_says_why(tmp_path: Path, holokin: Command, out: Path) -> None:
    expect = "[expect.lock]\ncoverage = { above = 0.5 }\n"
    assert_refused(holokin("run", job(tmp_path, workspace="", expect=expect), "--out", out), "add a [workspace] table")
    expect = "[expect.pseudo]\ncoverage = { above = 0.5 }\ncoverage_rcond = { above = 0.1 }\n"
    few = PARTS["workspace"].replace("200", "8") + "slices = 0\n"
    result = run_job(*open_job(str(job(tmp_path, expect=expect, workspace=few))))
    checks = {check.metric: check for check in result.strategies[0].checks}
    for key in ("coverage", "coverage_rcond"):
        assert not checks[key].passed
        assert checks[key].found.startswith("not known") and "has no leaves" in checks[key].found


@pytest.mark.campaign
def test_the_example_shows_what_it_says_also_with_fewer_poses(tmp_path: Path) -> None:
    text = (Path(__file__).parents[3] / "examples" / "panda-workspace.toml").read_text("utf-8")
    assert "samples = 256" in text
    (tmp_path / "few.toml").write_text(text.replace("samples = 256", "samples = 128\nslices = 0"), "utf-8")
    assert run_job(*open_job(str(tmp_path / "few.toml"))).passed


def test_pictures_draw_into_the_axes_that_they_are_given_and_name_every_cause() -> None:
    from matplotlib.figure import Figure

    locked = hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(2))
    space = hk.workspace(box=([1.2, 1.6], [1.1, 0.9]))
    covers = hk.coverage(locked, space, [0.3, 0.9, 0.7], samples=100)
    slices = coverage_slices(locked, space, [0.3, 0.9, 0.7], steps=12)
    figure = Figure()
    axes = figure.subplots()
    assert slice_map(axes, slices[0]) is axes
    image = np.asarray(axes.images[0].get_array())
    reached = slices[0].grid(slices[0].coverage.status) == PoseStatus.REACHED
    greys = {tuple(np.round(c, 3)) for c in image[~reached]}
    assert len(greys) == len({int(s) for s in slices[0].coverage.status} - {0})
    assert coverage_cloud(figure.add_subplot(projection="3d"), covers).name == "3d"
    whole = coverage_figure(covers, slices)
    labels = [text.get_text() for legend in whole.legends for text in legend.get_texts()]
    assert labels.pop() == "tool at the start (projected)"
    assert [label.rpartition(":")[0] for label in labels] == [
        name for cause, (_, name) in CAUSES.items() if covers.count(cause) or slices[0].coverage.count(cause)
    ]
