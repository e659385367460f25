"""Jobs with a [workspace] table: what they find, show, write, and refuse."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused, write_job
from holokin.analysis.coverage import PoseStatus, coverage_slices
from holokin.app.job import open_job, run_job
from holokin.app.report.job_report import columns, rows
from holokin.app.report.job_result import JobResult
from holokin.app.report.sheets_plots import CAUSES, coverage_cloud, coverage_figure, slice_map

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
    law, space = hk.holonomic(task, hk.lock(2)), hk.workspace(box=([1.2, 1.6], [1.1, 0.9]))
    alone = hk.coverage(law, space, [0.3, 0.9, 0.7], samples=200)
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

    law = hk.holonomic(hk.position(hk.load("planar-3r")), hk.lock(2))
    space = hk.workspace(box=([1.2, 1.6], [1.1, 0.9]))
    covers = hk.coverage(law, space, [0.3, 0.9, 0.7], samples=100)
    slices = coverage_slices(law, space, [0.3, 0.9, 0.7], steps=12)
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
