"""What is drawn and said of a result: units, ends, stops, speeds, verdicts; one file a strategy."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from rich.console import Console

import holokin as hk
from conftest import campaign, sampled
from holokin.analysis.curvature import curvature
from holokin.app.job import open_job, run_job
from holokin.app.job.schema import ExpectTable, Job
from holokin.app.job.strategy_tables import MoorePenrose
from holokin.app.report.animation import two_path_frames
from holokin.app.report.job_figures import figures, robot_figure
from holokin.app.report.job_report import columns, remarks, rows, write_report
from holokin.app.report.job_result import JobResult
from holokin.app.report.plots import away, largest, paths_end, speed_warning, stopped
from holokin.app.report.section import Section
from holokin.motion.trajectory import Status
from short_jobs import shortened


@pytest.fixture(scope="module")
def ppr_cycle() -> JobResult:
    return shortened()


@pytest.fixture(scope="module")
def panda_circle() -> JobResult:
    return shortened("panda-circle", cycles=2, samples=40)


@pytest.fixture(scope="module")
def half_lost() -> JobResult:
    """A Panda whose leaf ends on the clockwise path only."""
    file = Path(__file__).parents[3] / "examples" / "panda-strategies.toml"
    name, job, path = open_job(str(file))
    lock = {key: job.strategies[key] for key in ("lock-3",)}
    return run_job(name, job.model_copy(update={"strategies": lock, "expect": {}}), path)


def test_a_wide_table_is_cut_on_a_terminal_alone() -> None:
    """In a pipe every heading and cell is whole, and the width of what is printed next is as it was."""
    names = [f"heading {i}" for i in range(12)]
    section = Section("Wide", head=names, rows=[[f"cell {i} of the row" for i in range(12)]])
    for terminal in (False, True):
        console = Console(file=io.StringIO(), width=60, force_terminal=terminal)
        section.rich(console)
        text = console.file.getvalue()  # type: ignore[attr-defined]
        assert all(name in text for name in names) is not terminal
        assert ("\u2026" in text) is terminal and console.width == 60


# --- files ---


@pytest.mark.campaign
def test_strategies_whose_names_are_alike_write_a_file_each(tmp_path: Path) -> None:
    names = ["my strat", "my-strat", "My_Strat", "!!!", "a", "a counter", "ü/ß"]
    table = MoorePenrose(kind="moore-penrose")
    result = shortened(strategies=dict.fromkeys(names, table), cycles=1, samples=8)
    stems = result.stems
    assert stems["my strat"] == "my-strat"
    assert stems["!!!"] == "strategy"
    assert stems["ü/ß"] == "ü-ß"
    named = {f"{stems[s.name]}-{key}".casefold() for s in result.strategies for key in s.trajectories()}
    assert len(named) == 3 * len(names)  # a-counter-clockwise.csv would be of two strategies
    few = replace(result, strategies=tuple(s for s in result.strategies if s.name[0] in "a!"))
    folder = write_report(few, tmp_path, "0")
    written = [entry.name for entry in folder.glob("*.csv")]
    assert len(written) == 3 * 3
    assert len(list(folder.glob("paths-*.png"))) == 3
    assert not [name for name in written if name.startswith("-")]


# --- units ---


@pytest.mark.campaign
def test_a_gap_has_the_unit_of_the_joint_that_it_is_of(ppr_cycle: JobResult, panda_circle: JobResult) -> None:
    assert largest(np.array([0.1, -0.3, 0.2]), ("m", "m", "rad")) == "0.3 m"
    assert largest(np.array([0.1, -0.3, 0.4]), ("m", "m", "rad")) == "0.4 rad"
    walk = ppr_cycle.strategies[0].cycles
    assert away(walk, 1).startswith("after 1 cycle: 0.")
    assert away(walk, 2).startswith("after 2 cycles: 0.")
    slid = replace(walk, q=walk.q * [10.0, 1.0, 1.0])  # now a slider moves most
    assert away(slid, 1).endswith(" m away")
    assert away(walk, 1).endswith(" rad away")
    made = {stem: figure for stem, _, figure in figures(ppr_cycle)}
    assert "[m or rad]" in made["drift"].axes[0].get_ylabel()
    assert "[m or rad]" in made["cycles"].axes[0].get_ylabel()
    assert "[m or rad]" in columns(ppr_cycle)[2][0]
    one = replace(panda_circle, strategies=panda_circle.strategies[:1])
    panda = {stem: figure for stem, _, figure in figures(one)}
    assert "[rad]" in panda["drift"].axes[0].get_ylabel()


# --- ends ---


@pytest.mark.campaign
def test_ways_that_stop_are_not_compared(half_lost: JobResult, tmp_path: Path) -> None:
    strategy = half_lost.strategies[0]
    clockwise, counter = strategy.two_paths
    assert (clockwise.status, counter.status) == (Status.BRANCH, Status.COMPLETE)
    said = paths_end(strategy.two_paths)
    assert said == f"clockwise stopped at {clockwise.t[-1]:.3g} s, where the leaf folds back"
    made = {stem: figure for stem, _, figure in figures(half_lost)}
    ways = made["paths-lock-3"]
    assert said in ways.get_suptitle()
    titles = [axes.get_title(loc="left") for axes in ways.axes if axes.get_visible()]
    assert len(titles) == 7
    assert all(f"stopped at {clockwise.t[-1]:.3g} s" in title for title in titles)
    assert said in made["robot"].axes[0].get_title(loc="left")
    assert "stopped at" in made["cycles"].axes[0].get_title(loc="left")
    assert not [f for f in made.values() if "apart" in f.get_suptitle()]


@pytest.mark.campaign
def test_a_film_of_a_way_that_stops_says_so(half_lost: JobResult) -> None:
    said: list[str] = []
    write = Text.set_text
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Text, "set_text", lambda text, s: (said.append(str(s)), write(text, s))[1])
        *_, last = two_path_frames(half_lost, half_lost.drawn)
    assert last.shape[2] == 3
    assert any("clockwise stopped at" in s and "counter-clockwise followed to the end" in s for s in said)
    assert not any("apart" in s or "1 cycles" in s for s in said)


def test_what_is_complete_has_not_stopped(ppr_cycle: JobResult) -> None:
    assert stopped(ppr_cycle.strategies[0].cycles) == ""
    assert paths_end(ppr_cycle.strategies[1].two_paths) == "both paths end at the same joints"
    assert paths_end(ppr_cycle.strategies[0].two_paths).startswith("the two paths end 0.143 rad")


# --- figures ---


@pytest.mark.campaign
@sampled(2, "count", [1, 2, 3, 4, 5, 7])
def test_no_figure_is_wider_than_three_panels(ppr_cycle: JobResult, count: int) -> None:
    strategies = [replace(ppr_cycle.strategies[0], name=f"s{i}", group=f"s{i}") for i in range(count)]
    made = {stem: figure for stem, _, figure in figures(replace(ppr_cycle, strategies=tuple(strategies)))}
    assert len(made) == count + 4
    for stem, figure in made.items():
        assert figure.get_size_inches()[0] < 14, stem
    panels = [axes for axes in made["cycles"].axes if axes.get_visible()]
    assert len(panels) == count
    lowest = {}
    for axes in panels:
        column = round(axes.get_position().x0, 3)
        lowest[column] = min(lowest.get(column, axes), axes, key=lambda a: a.get_position().y0)
    assert [a.get_xlabel() == "time [s]" for a in panels] == [a in lowest.values() for a in panels]


# --- numbers ---


def test_drift_a_cycle_is_the_mean_of_the_cycles_largest_drifts() -> None:
    """The arm is a planimeter: q3 creeps by 2 pi (1 - sqrt(1 - k^2)) a cycle in the long run, k = r/2 (theory 4)."""
    result = shortened(cycles=49, samples=40, strategies={"mp": MoorePenrose(kind="moore-penrose")})
    f = result.strategies[0].metrics
    each = np.abs(result.strategies[0].cycles.drift()).max(axis=1)
    assert each.std() > 1e-3
    assert f["drift_mean"] == pytest.approx(np.mean(each), rel=1e-12)
    assert f["drift_least"] < f["drift_mean"] < f["drift_most"]
    creep = result.strategies[0].cycles.drift_since_start()[-1, 2]
    assert creep / 49 == pytest.approx(2 * np.pi * (1 - np.sqrt(1 - 0.2012**2)), abs=1e-3)


def test_the_mean_drift_is_not_the_total_over_the_cycles() -> None:
    """After eleven circles of a Panda another joint drifts most, and the total is of no single joint."""
    long = shortened("panda-circle", cycles=14, samples=30, strategies={"mp": MoorePenrose(kind="moore-penrose")})
    f, each = long.strategies[0].metrics, np.abs(long.strategies[0].cycles.drift())
    assert len(set(each.argmax(axis=1))) == 2
    assert f["drift_mean"] == pytest.approx(each.max(axis=1).mean(), rel=1e-12)
    assert f["drift_mean"] > 1.003 * f["drift_total"] / 14


def test_peak_speed_is_the_share_of_the_joints_limit(panda_circle: JobResult) -> None:
    """One hinge locked to the tool's speed: twice the path's speed is twice the share, and the worst joint is named."""
    slow = panda_circle
    strategy = slow.strategies[0]
    limits = slow.robot.max_velocity
    shares = np.max([np.abs(w.dq).max(axis=0) for w in strategy.trajectories().values()], axis=0) / limits
    assert strategy.metrics["peak_speed"] == pytest.approx(shares.max())
    assert remarks(slow) == []
    factor = 1.5 / shares.max()
    fast = shortened(
        "panda-circle", cycles=2, samples=40, speed=0.1 * factor, strategies={"mp": MoorePenrose(kind="moore-penrose")}
    )
    assert fast.strategies[0].metrics["peak_speed"] == pytest.approx(1.5)
    said = speed_warning(fast, fast.strategies[0])
    assert slow.robot.joint_names[int(np.argmax(shares))] in said
    assert "1.5 times its speed limit" in said
    assert [note.text for note in remarks(fast)] == [f"mp: {said}"]
    advice = float(said.split("run the path at ")[1].split(" m/s")[0])
    assert 0.9 * 0.1 / shares.max() < advice < 0.1 / shares.max()


def test_a_robot_without_speed_limits_has_no_peak_speed(tmp_path: Path) -> None:
    (tmp_path / "arm.toml").write_text('source = "here"\n' + 3 * "[[joints]]\na = 0.5\n")
    job = Job.model_validate(
        {
            "title": "x",
            "robot": {"name": "arm.toml"},
            "start": {"q": [0.1, 0.9, 0.9]},
            "path": {"kind": "circle", "center": [-0.1, 0], "relative": True, "samples": 20},
            "strategies": {"mp": {"kind": "moore-penrose"}},
        }
    )
    result = run_job("job", job, tmp_path / "job.toml")
    assert np.isnan(result.strategies[0].metrics["peak_speed"])
    assert rows(result)[0][-2:] == ["-", "-"]
    assert speed_warning(result, result.strategies[0]) == ""


def test_nothing_expected_is_not_ok(ppr_cycle: JobResult, half_lost: JobResult) -> None:
    assert [cells[-1] for cells in rows(ppr_cycle)] == ["-"] * 3
    assert [cells[-1] for cells in rows(half_lost)] == ["FAILED"]  # of every strategy its path's end is expected
    name, job, file = open_job("ppr-half-circle")
    path = job.path.model_copy(update={"samples": 20})
    some = job.model_copy(update={"path": path, "expect": {"paper": ExpectTable(holonomic=True)}})
    assert [cells[-1] for cells in rows(run_job(name, some, file))] == ["-", "ok", "-"]


# --- verdicts ---


def test_a_verdict_is_a_sentence_that_a_small_loop_confirms(panda_circle: JobResult) -> None:
    """0.1 m by 0.1 m: the joints end 0.01 |F| away to first order in the area, here at a tenth of the size."""
    pseudo, held = panda_circle.strategies[:2]
    v = pseudo.verdict
    told, shown = v.sentence, v.details
    assert str(v).splitlines() == [told, f"  {shown}"]
    names = [pseudo.cycles.row_names[i] for i in v.plane]
    assert "-".join(names) in told and "-".join(names) in shown
    assert "is NOT holonomic" in told
    assert f"{0.01 * v.defect:.2g} rad" in told
    assert f"{v.relative:.2g} per rad" in shown
    assert "comes" not in told and held.verdict.sentence.startswith("'lock-3', pose (twist) of panda, is holonomic")
    ppr = shortened(cycles=1)
    strategy = hk.moore_penrose(hk.position(ppr.robot))
    q = ppr.q0
    corner = ppr.robot.pose(q)[:3, 3]
    side = 0.01
    loop = hk.polyline([corner, corner + [side, 0, 0], corner + [side, side, 0], corner + [0, side, 0]], closed=True)
    moved = np.linalg.norm(hk.drift(strategy, loop, q, samples=40).since_start[-1])
    assert moved == pytest.approx(side**2 * np.linalg.norm(curvature(strategy, q)[:, 0, 1]), rel=0.02)


def test_the_report_explains_its_terms(ppr_cycle: JobResult, sketched: None, tmp_path: Path) -> None:
    page = (write_report(ppr_cycle, tmp_path, "0") / "report.html").read_text("utf-8")
    verdicts = page.index("is NOT holonomic")
    for term in ("Holonomic:", "Leaf:", "Drift:", "Witness:"):
        assert verdicts < page.index(term) < page.index("<h2>Figures</h2>")
    assert "x-y plane" in page
    assert "[joint]" not in page


@pytest.mark.parametrize("several", [1, campaign("several", 2), campaign("several", 4)])
def test_no_text_of_the_robots_picture_is_cut_off(ppr_cycle: JobResult, half_lost: JobResult, several: int) -> None:
    """Titles of three lines, ticks, and names of axes lie in the figure, for robots in the plane and in space."""
    for result in (ppr_cycle, half_lost):
        drawn = replace(result, strategies=tuple(replace(result.strategies[0], group=str(k)) for k in range(several)))
        figure = robot_figure(drawn)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        box, whole = figure.get_tightbbox(canvas.get_renderer()), figure.bbox_inches
        assert box.x0 >= -0.02 and box.y0 >= -0.02 and box.x1 <= whole.x1 + 0.02 and box.y1 <= whole.y1 + 0.02


def test_the_report_names_joints_and_prints_no_round_off(sketched: None, tmp_path: Path) -> None:
    """Postures stand with the names of their joints; 2e-30 rad is 0, as a posture and as a figure."""
    name, job, file = open_job("panda-circle")
    laws = {"moore-penrose": job.strategies["moore-penrose"]}
    start = job.start.model_copy(update={"q": [2.2195e-30, *job.start.q[1:]]})
    update = {"start": start, "path": job.path.model_copy(update={"samples": 20, "cycles": 1}), "strategies": laws}
    result = run_job(name, job.model_copy(update=update | {"expect": {}}), file)
    tiny = replace(result.strategies[0], metrics=result.strategies[0].metrics | {"spread": 2.2195e-30})
    page = (write_report(replace(result, strategies=(tiny,)), tmp_path, "0") / "report.html").read_text("utf-8")
    assert "e-30" not in re.sub(r"src='data[^']*'", "", page)
    details = re.search(r"defect [^<]*", page).group()
    for joint in result.robot.joint_names:
        assert details.count(f"{joint} ") == 2  # at the witness, and in the middle of the region
    assert "within panda_joint1 0, panda_joint2 -0.4, " in details


def test_the_end_of_a_leaf_is_told_with_the_joints_names(half_lost: JobResult) -> None:
    trouble = half_lost.strategies[0].trouble
    assert "'lock-3' leads no farther than panda_joint1 " in trouble
    assert ", panda_joint7 " in trouble
