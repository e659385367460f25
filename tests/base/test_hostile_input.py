"""Files too long, too deep, too large or odd get a refusal that names file, key and cure; odd names are shown."""

from __future__ import annotations

import os
import re
import time
from pathlib import Path
from xml.dom import minidom

import numpy as np
import pytest

import holokin as hk
from conftest import PANDA_START, SOUND, Command, assert_refused, assert_untouched, sampled, write_job
from holokin.analysis.curvature import MOST_JOINTS
from holokin.app.job import open_job, read_job
from holokin.base.errors import ArgumentError, BranchError, ExpressionError, FileError, JobError, RobotFileError
from holokin.motion.ik.plan import make_plan
from holokin.motion.ik.pose_paths import out_of_reach
from holokin.symbolic import parse, symbol

POINTS = ", ".join(["[0, 0]"] * 10_001)
CUSTOM = '[strategies.mine]\nkind = "custom"\ng = [{!r}]\n'


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        ({"start": f"[start]\nq = [{'9' * 5000}]\n"}, ("not TOML", "1e300")),
        ({"start": f"[start]\nq = [0, 1{'0' * 400}, 0]\n"}, ("[start.q.1]", "64 bits")),
        ({"start": f"[start]\nq = {'[' * 3000}{']' * 3000}\n"}, ("deeper than 16 levels",)),
        ({"start": f"[start]\nq = {'[' * 40}1{']' * 40}\n"}, ("[start.q.0.0", "deeper than 16 levels")),
        ({"start": ".".join(["a"] * 3000) + " = 1\n"}, ("dotted key",)),
        ({"start": "[start]\nq = [0, 1e200, 0]\n"}, ("[start.q.1] is 1e+200", "at most 1000000")),
        ({"path": '[path]\nkind = "polyline"\npoints = [[0, 0], [1e200, 0]]\n'}, ("[path.points.1.0]", "at most 1000")),
        ({"path": f'[path]\nkind = "polyline"\npoints = [{POINTS}]\n'}, ("[path.points]", "at most 10000 of them")),
        ({"path": SOUND["path"].replace("= 20", "= 10_000_000")}, ("[path.samples]", "at most 100000")),
        ({"path": SOUND["path"] + "cycles = 1_000_000\n"}, ("[path.cycles]", "at most 10000")),
        ({"path": SOUND["path"].replace("= 20", "= 50_000") + "cycles = 100\n"}, ("[path]", "400,000 steps")),
        ({"expect": "[verdict]\nsamples = 100_000\n"}, ("[verdict.samples]", "at most 65536")),
        ({"strategies": '[strategies."."]\nkind = "lock"\nx = 1\n'}, ('[strategies."."', "unknown key", "joints")),
        ({"strategies": f'[strategies.{"x" * 300}]\nkind = "moore-penrose"\n'}, ("300 characters", "1 to 100")),
        ({"strategies": '[strategies."\\u0007"]\nkind = "moore-penrose"\n'}, ("control character",)),
        ({"strategies": CUSTOM.format("(-8)**0.5")}, ("job.toml: [strategies.mine]", "finite real number")),
        ({"strategies": CUSTOM.format("q1 +" * 3000 + "1")}, ("[strategies.mine]", "12,001 characters", "10,000")),
        ({"robot": f'[robot]\nname = "{"x" * 300}.urdf"\n'}, ("cannot be read",)),
        ({"robot": '[robot]\nname = "\\u0000.toml"\n'}, ("without a NUL character",)),
    ],
)  # fmt: skip
def test_what_is_too_much_is_refused_by_file_key_and_cure(
    holokin: Command, tmp_path: Path, out: Path, spoilt: dict[str, str], words: tuple[str, ...]
) -> None:
    if '"."' in str(spoilt):
        spoilt = {key: text.replace('"."', "'.'") for key, text in spoilt.items()}
        words = tuple(word.replace('"."', "'.'") for word in words)
    outcome = holokin("run", write_job(tmp_path, **spoilt), "--out", out)
    assert_refused(outcome, *words)
    assert len(outcome.err) < 2000
    assert_untouched(out)


@pytest.mark.parametrize("name", ["..toml", "...toml", "x" * 300 + ".toml"])
def test_a_job_without_a_name_of_its_own_is_refused(holokin: Command, tmp_path: Path, out: Path, name: str) -> None:
    if len(name) < 100:
        write_job(tmp_path, name)
    assert_refused(holokin("run", tmp_path / name, "--out", out), "rename it" if len(name) < 100 else "cannot be read")
    assert_untouched(out)


@pytest.mark.parametrize(
    "formula",
    ["(-8)**0.5", "q1/0", "log(-1)", "9**9**9", "10**400", "1e999", "9" * 5000, "(" * 500 + "1" + ")" * 500,
     "-" * 5000 + "1", "+".join(["q1"] * 5000), "+".join(["q1"] * 3000), "x" * 20_000, "\x00", "1j"],
)  # fmt: skip
def test_a_formula_without_a_finite_real_value_or_an_end_is_refused_briefly(formula: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        parse(formula, {"q1": symbol("q", 1)[0]})
    assert len(str(caught.value)) < 1700
    assert str(caught.value).isprintable()


def test_a_long_sum_needs_no_recursion() -> None:
    q = symbol("q", 1)
    function = hk.custom(lambda q: parse("+".join(["q1"] * 900), {"q1": q[0]}), 1)
    assert function is not None
    from holokin.symbolic import Function

    total = Function("sum", {"q": q}, {"s": parse("+".join(["q1"] * 900), {"q1": q[0]})})
    assert total(np.array([0.5])) == 450.0


def test_a_long_value_is_cut_in_the_middle_of_its_message(tmp_path: Path) -> None:
    with pytest.raises(JobError) as caught:
        read_job(write_job(tmp_path, path='[path]\nkind = "' + "x" * 100_000 + '"\n'))
    text = str(caught.value)
    assert len(text) < 1700
    assert "[path.kind]" in text and "characters left out" in text
    assert text.endswith("raster, spiral")
    with pytest.raises(ArgumentError, match="too long to show"):
        hk.from_dh([{"a": 10**5000}])


# --- URDF -----------------------------------------------------------------------------------------------------

TINY = (
    '<robot name="r"><link name="a"/><link name="b"/><link name="c"/>{}'
    '<joint name="j1" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>{}'
    '<joint name="j2" type="continuous"><parent link="b"/><child link="c"/><origin xyz="1 0 0"/></joint></robot>'
)


@pytest.mark.parametrize("between", ["<x>" * 400 + "</x>" * 400, "<x>" + "y" * 11_000_000 + "</x>", "<a:b/><!-- x -->"])
def test_joints_after_deep_or_long_xml_are_found(tmp_path: Path, between: str) -> None:
    file = tmp_path / "arm.urdf"
    for text in (TINY.format(between, ""), TINY.format("", between)):
        file.write_text(text)
        assert hk.from_urdf(file).joint_names == ("j1", "j2")


@pytest.mark.parametrize("code", ["GB2312", "Shift_JIS", "no-such", "idna", "undefined", "rot13"])
def test_an_encoding_that_is_not_read_is_named_with_the_cure(tmp_path: Path, code: str) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(f'<?xml version="1.0" encoding="{code}"?>' + TINY.format("", ""))
    with pytest.raises(RobotFileError, match=r"arm\.urdf: (declares an encoding|is not XML)"):
        hk.from_urdf(file)


@pytest.mark.parametrize("code", ["utf-8", "utf-16", "latin-1", "cp1252"])
def test_a_declared_encoding_is_obeyed(tmp_path: Path, code: str) -> None:
    text = f'<?xml version="1.0" encoding="{code}"?>' + TINY.format("", "").replace("j1", "größe")
    (tmp_path / "arm.urdf").write_bytes(text.encode(code))
    assert hk.from_urdf(tmp_path / "arm.urdf").joint_names == ("größe", "j2")


@pytest.mark.parametrize("name", ["pipe.toml", "pipe.urdf"])
def test_a_pipe_is_not_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(RobotFileError, match="no regular file"):
        hk.load(tmp_path / name)
    if name.endswith("toml"):
        with pytest.raises(JobError, match="no regular file"):
            open_job(str(tmp_path / name))


# --- robots ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "row", [{"a": "0.3"}, {"a": True}, {"a": 1e200}, {"joint": 3}, {"kind": []}, {"lower": np.inf}, {"joint": "\x1b"}]
)  # fmt: skip
def test_a_dh_row_is_made_of_plain_numbers_and_names(row: object) -> None:
    with pytest.raises(ArgumentError):
        hk.from_dh([{"a": 0.1}, row])  # type: ignore[list-item]


@pytest.mark.parametrize("line", ['a = "0.3"', "a = true", "joint = 3", "a = 1e200", "base = 1"])
def test_a_dh_file_names_itself(tmp_path: Path, line: str) -> None:
    (tmp_path / "arm.toml").write_text(f'source = "x"\n[[joints]]\na = 1\n[[joints]]\n{line}\n')
    with pytest.raises(RobotFileError, match=r"arm\.toml:"):
        hk.load(tmp_path / "arm.toml")
    (tmp_path / "base.toml").write_text('source = "x"\nbase = { xyz = [1] }\n[[joints]]\na = 1\n')
    with pytest.raises(RobotFileError, match=r"base\.xyz is \[1\]"):
        hk.load(tmp_path / "base.toml")


def test_a_chain_too_long_to_judge_is_refused_at_once_and_still_moves(
    holokin: Command, tmp_path: Path, out: Path
) -> None:
    n = MOST_JOINTS + 1
    chain = hk.from_dh([{"a": 1.0 / n}] * n)
    q = np.full(n, np.pi / (2 * n))
    turned = q[0] * np.arange(1, n + 1)  # a closed form: links of 1/n at these angles
    assert chain.pose(q)[:2, 3] == pytest.approx([np.cos(turned).sum() / n, np.sin(turned).sum() / n], abs=1e-13)
    begin = time.perf_counter()
    with pytest.raises(ArgumentError, match=f"is {n}; its curvature is written out for at most {MOST_JOINTS}"):
        hk.involutivity(hk.moore_penrose(hk.position(chain)), hk.around(q, 0.1))
    assert time.perf_counter() - begin < 5
    (tmp_path / "chain.toml").write_text('source = "x"\n' + "[[joints]]\na = 0.01\n" * 500)
    file = write_job(tmp_path, robot='[robot]\nname = "chain.toml"\n')
    assert_refused(holokin("run", file, "--out", out), "job.toml: [robot] moves 500 joints", "at most 100")
    assert_untouched(out)


# --- the search for reach -------------------------------------------------------------------------------------


def test_the_search_for_reach_takes_a_second_and_finds_what_can_be_reached(panda: hk.Robot) -> None:
    """The circle is followed by the pseudo-inverse, so every pose of it can be reached."""
    task = hk.pose(panda)
    T = panda.pose(PANDA_START)
    circle = hk.circle(T[:3, 3], center=T[:3, 3] - [0.1, 0, 0])
    walk = hk.follow(hk.moore_penrose(task), circle, PANDA_START, samples=30)
    assert walk.status is hk.motion.Status.COMPLETE
    begin = time.perf_counter()
    assert out_of_reach(make_plan(task, circle, 30, T[:3, :3]), PANDA_START, 0, True) is None
    assert time.perf_counter() - begin < 2


@pytest.mark.campaign
def test_a_leaf_that_ends_is_not_told_to_be_the_end_of_reach(panda: hk.Robot) -> None:
    """A least-squares search of another make finds a posture for the pose that is farthest along."""
    from scipy.optimize import least_squares

    task, T = hk.pose(panda), panda.pose(PANDA_START)
    circle = hk.circle(T[:3, 3], center=T[:3, 3] - [0.35, 0, 0])
    target = make_plan(task, circle, 30, T[:3, :3]).target(24, 1.0)
    rng = np.random.default_rng(5)
    starts = rng.uniform(panda.lower, panda.upper, (30, 7))
    bounds = (panda.lower, panda.upper)
    gaps = (np.abs(least_squares(lambda q: task.error(q, *target), q, bounds=bounds).fun).max() for q in starts)
    assert any(gap < 1e-6 for gap in gaps)
    with pytest.raises(BranchError):
        hk.follow(hk.holonomic(task, hk.strategies.constraints.height("panda_joint4")), circle, PANDA_START, samples=30)


@pytest.mark.parametrize(("beyond", "missing"), [(0.2, 0.2), (0.01, 0.01), (-0.01, None)])
def test_a_stretched_arm_misses_by_what_the_target_is_beyond_its_length(
    planar_3r: hk.Robot, beyond: float, missing: float | None
) -> None:
    length = float(np.linalg.norm(planar_3r.pose(np.zeros(3))[:3, 3]))
    q = np.array([-0.4, 0.8, 0.3])
    tool = planar_3r.pose(q)[:3, 3]
    plan = make_plan(hk.position(planar_3r), hk.line(tool, [length + beyond, 0, 0]), 20, np.eye(3))
    found = out_of_reach(plan, q, 19, True)
    if missing is None:
        assert found is None
    else:
        assert found is not None
        assert found.share == 1.0
        told = re.search(r"no search came closer to it than ([\d.e-]+) \(m or rad\)", found.why)
        assert told is not None
        assert float(told[1]) == pytest.approx(missing, rel=0.02)


# --- what is shown --------------------------------------------------------------------------------------------


@pytest.mark.campaign
def test_odd_names_are_shown_as_they_are_and_break_no_figure(holokin: Command, tmp_path: Path, out: Path) -> None:
    name = r"_[/red] $\frac$ a$b [x]"
    file = write_job(
        tmp_path, "[b].toml", title='title = "[/red] [tool A] of [b] \\u0007"\n',
        strategies=f"[strategies.'{name}']\nkind = 'moore-penrose'\n[strategies.{'é' * 100}]\nkind = 'moore-penrose'\n"
        .replace("é" * 100, f"'{'é' * 100}'"),
    )  # fmt: skip
    outcome = holokin("run", file, "--out", out)
    assert outcome.code == 0
    assert "[/red] [tool A] of [b] \\x07" in outcome.out
    assert "_[/red]" in outcome.out
    folder = out / "[b]"
    pictures = list(folder.glob("*.svg"))
    assert len(pictures) == 4  # the robot, the ranges, and the ways of each strategy
    for picture in pictures:
        minidom.parse(str(picture))
        assert len(picture.name.encode()) < 255
    assert "\x07" not in (folder / "report.html").read_text("utf-8")


# --- Tables of numbers as programs of all countries write them: comments, decimal commas, semicolons and tabs.


ARM = hk.load("planar-3r")
COMMENTS = ("# exported by CAM", "# units: mm", "#", "# 12.5.2026, 10:30; part 7, rev. 2.1", "")


def _text(
    draw: np.random.Generator, header: list[str], rows: np.ndarray, mark: str, point: str
) -> tuple[str, list[int]]:
    """A table with comments at random places, and the line of each row."""
    lines = [str(c) for c in draw.choice(COMMENTS, draw.integers(0, 4))]
    lines.append(draw.choice(["", "#"]) + mark.join(header) if lines and rows.size else mark.join(header))
    places = []
    for row in rows:
        if draw.random() < 0.2:
            lines.append(str(draw.choice(COMMENTS)))
        lines.append(mark.join(f"{v:.{draw.integers(3, 7)}f}".replace(".", point) for v in row))
        places.append(len(lines))
    return "\n".join(lines) + "\n", places


def _case(seed: int) -> tuple[np.random.Generator, str, str]:
    draw = np.random.default_rng(seed)
    mark = str(draw.choice([",", ";", "\t"]))
    return draw, mark, "." if mark == "," else str(draw.choice([",", "."]))


@sampled(12, "seed", list(range(200)))
def test_waypoints_and_logs_are_read_in_every_dialect(seed: int, tmp_path: Path) -> None:
    draw, mark, point = _case(seed)
    rows = np.round(draw.uniform(-900, 900, (draw.integers(2, 30), 3)), 3)
    file = tmp_path / "table.csv"
    file.write_text(
        _text(draw, ["X [mm]", "Y [mm]", "Z [mm]"], rows, mark, point)[0], draw.choice(["utf-8", "utf-8-sig"])
    )
    assert np.abs(hk.read_paths(file).paths[0].points - rows / 1e3).max() < 1e-12
    q = np.round(draw.uniform(-1, 1, (40, 3)), 3)
    t = np.round(0.01 * np.arange(40), 3)
    file.write_text(_text(draw, ["t", *ARM.joint_names], np.c_[t, q], mark, point)[0])
    log = hk.read_recording(file, ARM)
    assert np.abs(log.q - q).max() < 1e-12 and np.abs(log.t - t).max() < 1e-12


@sampled(8, "seed", list(range(60)))
def test_a_table_with_both_decimal_marks_is_refused_with_both_lines(seed: int, tmp_path: Path) -> None:
    """1,234 beside 0.5 is a thousand and more, or 1.234: nobody can tell."""
    draw, _, _ = _case(seed)
    mark = str(draw.choice([";", "\t"]))
    rows = draw.uniform(100, 900, (12, 3))
    text, places = _text(draw, ["x_mm", "y_mm", "z_mm"], rows, mark, ",")
    i = int(draw.integers(1, 12))
    lines = text.split("\n")
    lines[places[i] - 1] = lines[places[i] - 1].replace(",", ".")
    (tmp_path / "mixed.csv").write_text("\n".join(lines))
    with pytest.raises(FileError, match=f"line {places[0]} has a decimal comma, line {places[i]} a decimal point; "):
        hk.read_paths(tmp_path / "mixed.csv").paths[0]


@sampled(6, "seed", list(range(60)))
def test_a_bad_cell_below_comments_is_named_by_its_line(seed: int, tmp_path: Path) -> None:
    draw, mark, point = _case(seed)
    rows = draw.uniform(100, 900, (12, 3))
    text, places = _text(draw, ["x_mm", "y_mm", "z_mm"], rows, mark, point)
    i = int(draw.integers(0, 12))
    lines = text.split("\n")
    lines[places[i] - 1] = mark.join(["1", "two", "3"])
    (tmp_path / "bad.csv").write_text("\n".join(lines))
    with pytest.raises(FileError, match=f"line {places[i]}, column 'y_mm' holds 'two'"):
        hk.read_paths(tmp_path / "bad.csv").paths[0]


def test_a_row_whose_name_begins_with_a_number_sign_is_a_row(tmp_path: Path) -> None:
    (tmp_path / "named.csv").write_text("point,x_mm,y_mm,z_mm\n#1,1,2,3\n# the second one\n#2,4,5,6\n")
    assert np.allclose(
        hk.read_paths(tmp_path / "named.csv").paths[0].points, [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]]
    )


def test_comments_over_numbers_alone_are_no_header(tmp_path: Path) -> None:
    (tmp_path / "bare.csv").write_text("# exported by CAM\n\n1;2;3\n4;5;6\n")
    with pytest.raises(FileError, match="line 3 holds numbers, no header; name the columns"):
        hk.read_paths(tmp_path / "bare.csv").paths[0]


@pytest.mark.parametrize("point", [",", "."])
def test_a_log_without_a_header_may_have_decimal_commas(point: str, tmp_path: Path) -> None:
    t, q = 0.01 * np.arange(40), np.round(np.random.default_rng(1).uniform(-1, 1, (40, 3)), 3)
    lines = [";".join(f"{v:.3f}".replace(".", point) for v in row) for row in np.c_[t, q]]
    (tmp_path / "bare.csv").write_text("\n".join(lines) + "\n")
    assert np.abs(hk.read_recording(tmp_path / "bare.csv", ARM).q - q).max() < 1e-12


def test_a_semicolon_in_a_name_ends_no_cell(tmp_path: Path) -> None:
    (tmp_path / "named.csv").write_text("x_mm,y_mm,z_mm,note;s\n1,2,3,a;b\n4.5,5,6,c\n")
    assert np.allclose(
        hk.read_paths(tmp_path / "named.csv", ignore=["note*"]).paths[0].points[1], [0.0045, 0.005, 0.006]
    )
