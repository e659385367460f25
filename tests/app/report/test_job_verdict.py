"""The verdict of a report in words, and results in degrees and mm."""

from __future__ import annotations

import csv
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused
from holokin.analysis.audit.logs import read_recording
from holokin.app.job import open_job
from holokin.app.job.schema import job_of
from holokin.app.report.job_figures import figures
from holokin.app.report.job_report import (
    columns,
    not_tested,
    rows,
    strategy_verdicts,
    what_was_run,
    whole_verdict,
    write_report,
)
from holokin.app.report.job_result import Check, JobResult
from holokin.app.report.plots import alike, away
from holokin.app.report.section import Note, Section
from holokin.base.errors import ArgumentError, JobError
from holokin.base.units import SI, PrintedUnits, printed_units
from short_jobs import shortened
from sketches import Sketch

DEGREES = PrintedUnits("deg", "mm")


@pytest.fixture(scope="module")
def circle() -> JobResult:
    return shortened("panda-circle", cycles=2, samples=40)


def captions(result: JobResult) -> list[tuple[str, str, Sketch]]:
    """The figures of a job with a sketch for each."""
    return [(stem, caption, Sketch()) for stem, caption, _ in figures(result)]


@pytest.fixture(scope="module")
def report(circle: JobResult, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The page of two strategies in degrees and mm, without its pictures."""
    two = replace(circle, units=DEGREES, strategies=circle.strategies[:2])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("holokin.app.report.job_report.figures", captions)
        text = (write_report(two, tmp_path_factory.mktemp("out"), "0") / "report.html").read_text("utf-8")
    return re.sub(r"data:image/svg[^']*", "", text)


def test_units_are_named_and_scaled_also_where_they_are_parts_of_others() -> None:
    assert [DEGREES.name(unit) for unit in ("rad", "m", "m/s^2", "rad/s", "m or rad", "1", "")] == [
        "deg", "mm", "mm/s^2", "deg/s", "mm or deg", "1", ""
    ]  # fmt: skip
    assert DEGREES.factor("rad/s") * np.pi == pytest.approx(180) and DEGREES.factor("m/s^2") == 1000
    assert DEGREES.factor("N") == 1 and DEGREES.factor("") == 1
    assert DEGREES.said(np.pi / 2, "rad") == "90 deg" and SI.said(0.5, "m") == "0.5 m"
    assert DEGREES.together(["rad", "rad"])[0] == "deg"
    assert DEGREES.together(["rad", "m"]) == ("rad or m", 1.0)  # which joint it is of is not known
    assert printed_units("degrees,mm") == DEGREES == printed_units(["deg", "mm"])
    assert printed_units("mm") == PrintedUnits("rad", "mm") and printed_units("rad, m").plain


def test_a_sentence_is_printed_in_the_units_or_left_alone() -> None:
    """Each quantity is the same in both texts; a list, an area and "m or rad" stay, since their unit is not sure."""
    joints = [("q1", "rad"), ("slide 2", "m")]
    for text, expected in (
        ("least distance -0.3438 m at 0.5 s (required: 0.05 m)", "least distance -343.8 mm at 0.5 s (required: 50 mm)"),
        ("q5 by 0.001 to 0.59 rad at best", "q5 by 0.0573 to 33.8 deg at best"),
        ("at q = [0.1, -0.349066] (rcond 0)", "at q = [5.73, -349.066] deg or mm (rcond 0)"),
        ("at q1 0.1, slide 2 0.2, where", "at q1 5.73, slide 2 200 deg or mm, where"),
        ("start: q1 0.1, slide 2 0.2 rad or m.", "start: q1 5.73, slide 2 200 deg or mm."),
        ("0.1 rad/s, 2 m/s^2, 10 m", "5.73 deg/s, 2000 mm/s^2, 10000 mm"),
        ("box [0.4, 0, 0.4] +- [0.1, 0, 0.05] m, tool down", "box [400, 0, 400] +- [100, 0, 50] mm, tool down"),
        ("0.1 to 0.2 x -0.1 to 0.3 m", "100 to 200 x -100 to 300 mm"),
        ("between 0.1 and 0.2 m", "between 100 and 200 mm"),
        ("-2.8973 to 2.8973 rad (-166.0 to 166.0 deg)", "-166.0 to 166.0 deg"),
        ("the distance [m] is -0.338; 0.2 m are asked for", "the distance [mm] is -338; 200 mm are asked for"),
        (
            "at least 0.10 rad, 0.10 rad or more, at most 0.11 rad",
            "at least 5.72 deg, 5.72 deg or more, at most 6.31 deg",
        ),
        *(
            (same, same)
            for same in ("0.3, 0.2 and 0.1 m", "0.3 rad/m^2", "5e-09 m or rad", "1,024 m", "wrote a 5 m.toml")
        ),
        *((same, same) for same in ("64 samples of 1 ms", "at q1 0.1 alone", "q = [1, 2, 3]", "2-3 m", "1-m")),
    ):
        assert DEGREES.reworded(text, joints) == expected
        assert SI.reworded(text, joints) == text
    hinges = [("q1", "rad"), ("q2", "rad")]
    assert (
        DEGREES.reworded("stays 1 or more (rad or m) from, 0.1 rad or m", hinges)
        == "stays 57.2 deg or more from, 5.73 deg"
    )
    assert DEGREES.reworded("stays 1 or more (rad or m) from", joints) == "stays 1 or more (rad or m) from"
    row = Section("0.1 m", ["0.1 m"], head=["[0.1 m]"], rows=[[Note("0.1 rad", detail="0.1 m")]], parts=[Section()])
    seen = row.reworded(DEGREES.reworded)
    assert (seen.title, seen.notes, seen.head) == ("0.1 m", ["100 mm"], ["[0.1 m]"])
    assert seen.rows == [[Note("5.73 deg", detail="100 mm")]]
    column = Section(head=["pair", "least [m]"], rows=[["a", "0.12"], ["b", "-"]]).reworded(DEGREES.reworded)
    assert (list(column.head), column.rows) == (["pair", "least [mm]"], [["a", "120"], ["b", "-"]])


@pytest.mark.parametrize("words", ["gradians", "degrees, inch", "", "deg rad", ["mm", "m"]])
def test_other_units_are_refused_by_name(words: str | list[str]) -> None:
    with pytest.raises(ArgumentError, match=r"degrees or rad, and in mm or m|give one of them"):
        printed_units(words)


def test_a_job_with_gradians_is_refused_with_the_units_that_there_are(holokin: Command, tmp_path: Path) -> None:
    _, _, file = open_job("ppr-cycle")
    table = {"units": "gradians", "title": "x", "robot": {"name": "ppr"}, "start": {"q": [0.1, 0.2, 0.3]}}
    table |= {"path": {"kind": "circle", "center": [0.1, 0]}, "strategies": {"a": {"kind": "moore-penrose"}}}
    with pytest.raises(JobError, match=r"units.*'gradians'.*degrees or rad, and in mm or m"):
        job_of(file, table)
    assert job_of(file, table | {"units": ["degrees", "mm"]}).printed_units == DEGREES
    assert job_of(file, {key: value for key, value in table.items() if key != "units"}).printed_units is SI
    assert_refused(holokin("run", "ppr-cycle", "--units", "gradians", "--out", tmp_path), "gradians", "degrees or rad")


def test_the_table_in_degrees_is_that_in_rad_times_180_over_pi(circle: JobResult) -> None:
    plain, seen = columns(circle), columns(replace(circle, units=DEGREES))
    assert plain[2][0] == "drift / cycle\n[rad]" and seen[2][0] == "drift / cycle\n[deg]"
    drifts = [circle.strategies[0].metrics["drift_mean"], circle.strategies[0].metrics["spread"]]
    cells = rows(replace(circle, units=DEGREES))[0]
    assert [float(cell) for cell in cells[2:4]] == pytest.approx(np.degrees(drifts), rel=1e-3)
    assert rows(replace(circle, units=DEGREES))[0][5:] == rows(circle)[0][5:]  # what has no unit stays


def test_figures_and_words_of_a_motion_follow_the_units(circle: JobResult) -> None:
    seen = replace(circle, units=DEGREES).printed
    walk, plain = seen.strategies[0].cycles, circle.strategies[0].cycles
    assert np.abs(walk.q - np.degrees(plain.q)).max() < 1e-12
    assert set(walk.joint_units) == {"deg"} and walk.row_units[:3] == ("mm",) * 3
    assert np.allclose(walk.x[:, :3], 1000 * plain.x[:, :3]) and np.allclose(walk.dq, np.degrees(plain.dq))
    assert away(walk, 2).endswith(" deg away")
    assert alike(np.array([5e-7]), ("deg",)) and not alike(np.array([6e-7]), ("deg",))
    assert alike(np.array([0.9e-8]), ("rad",)) and not alike(np.array([2e-8]), ("rad",))
    assert circle.printed is circle


def test_a_csv_in_degrees_names_its_units_and_is_read_back_as_it_was(circle: JobResult, tmp_path: Path) -> None:
    walk, file, robot = circle.strategies[0].cycles, tmp_path / "walk.csv", hk.load("panda")
    walk.save(file, DEGREES)
    with file.open() as stream:
        header, first = list(csv.reader(stream))[:2]
    assert header[:2] == ["t [s]", "panda_joint1 [deg]"] and "d_panda_joint1 [deg/s]" in header
    assert header[-6] == "x_x [mm]"
    assert float(first[1]) == pytest.approx(np.degrees(walk.q[0, 0]))
    assert np.abs(read_recording(file, robot).q - walk.q).max() < 1e-12
    assert np.abs(read_recording(file, robot, degrees=True).q - walk.q).max() < 1e-12  # not a second time
    walk.save(file)
    assert file.read_text().startswith("t,panda_joint1,")


def test_the_report_begins_with_the_verdict_in_words(circle: JobResult, report: str) -> None:
    """Before any table: what was run, whether it returns, which limits are kept, and what was not tested."""
    verdict = report[report.index("<h2>Verdict</h2>") : report.index("<h2>Verdicts and numbers</h2>")]
    assert report.index("<h2>") == report.index("<h2>Verdict</h2>")
    assert "moore-penrose does not return." in verdict and " deg from its limit" in verdict
    assert "no robot moved" in verdict and "Not tested" in verdict
    names = {name: (does, more, well) for name, does, more, well in strategy_verdicts(circle)}
    drifting = names["moore-penrose"]
    assert drifting[0] == "does not return." and not drifting[2]
    repeating = [entry for name, entry in names.items() if name != "moore-penrose"]
    assert all(does == "returns." and well for does, _, well in repeating)
    assert all("within 1e-08 rad" in more and "Position limits are kept" in more for _, more, _ in repeating)
    joint = int(np.argmax(np.abs(circle.strategies[0].cycles.drift_since_start()[-1])))
    assert circle.robot.joint_names[joint] in drifting[1]
    assert "collisions, obstacles, floor" in " ".join(not_tested(circle))
    assert "Run: panda (7 joints)" in what_was_run(circle) and "2 cycles" in what_was_run(circle)
    assert whole_verdict(circle).startswith("The job expects nothing")
    kept = replace(circle.strategies[0], checks=(Check("holonomic", "false", "false", True),))
    assert whole_verdict(replace(circle, strategies=(kept,))) == "All that the job asks for holds: 1 expectation."


def test_beside_a_closing_error_it_says_that_the_joints_return(circle: JobResult, report: str) -> None:
    text = report
    returned = re.findall(r"<td>([^<]*), returns</td>", text)
    assert len(returned) >= 2 and all(float(value) < 1e-6 for value in returned)
    assert "returns: every joint is back at its start within 6e-07 deg" in text
    drift = np.degrees(circle.strategies[0].metrics["drift_mean"])
    assert f"{drift:.3f}</td>" in text and "[deg]" in text and "[rad]" not in text


def test_an_open_path_and_a_failed_expectation_are_told(circle: JobResult) -> None:
    one = circle.strategies[0]
    failed = replace(one, checks=(Check("drift_total", "< 1e-09", "0.5", False),))
    result = replace(circle, strategies=(failed, *circle.strategies[1:]))
    assert whole_verdict(result) == "Not all that the job asks for holds: see moore-penrose."
    said = "This fails the job: expected drift_total < 1e-09, found 0.5 (in the units of the job file)."
    assert said in strategy_verdicts(result)[0][2]
    stopped = replace(one, checks=(Check("completes", "true", "stopped at a joint limit", False),))
    said = "This fails the job: the path was not followed to its end (stopped at a joint limit)."
    assert said in strategy_verdicts(replace(circle, strategies=(stopped,)))[0][2]
    through = replace(one, checks=(Check("completes", "false", "followed to the end", False),))
    said = "This fails the job: the path was followed to its end, but the job says completes = false."
    assert said in strategy_verdicts(replace(circle, strategies=(through,)))[0][2]
    start = circle.robot.pose(circle.q0)[:3, 3]
    line = hk.line(start, start + [0, 0.05, 0])
    opened = replace(circle, path=line)
    assert all("follows the path to its end" in does for _, does, _, _ in strategy_verdicts(opened))
    assert "whether the joints return: the path is open" in not_tested(opened)


def test_pairs_that_were_left_out_and_capsules_for_links_are_named_as_not_tested(circle: JobResult) -> None:
    report = hk.check(circle.strategies[0].cycles.q, robot=circle.robot)
    said = " ".join(not_tested(replace(circle, strategies=(replace(circle.strategies[0], motion_check=report),))))
    assert f"{len({one.pair for one in report.left_out})} pairs of links" in said and report.left_out
    assert "capsules of radius" in said and "has no [checks]" not in said
