"""Logs whose columns somebody else named: UR's RTDE client, spreadsheets, loggers of users."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command, assert_refused
from holokin.analysis.audit import LogVerdict
from holokin.analysis.audit.logs import Recording, read_recording, read_runs
from holokin.base.errors import ArgumentError, FileError, UnknownNameError

UR = hk.load("ur5e")
T = 0.008 * np.arange(401)
Q = np.deg2rad([10, -80, 100, -110, -90, 20]) + 0.2 * np.sin(2 * np.pi * T[:, None] / 0.8 + np.arange(6))
"""Four cycles."""


def rtde(file: Path, delimiter: str = " ", first: int = 0) -> Path:
    """A log in the form of the CSVWriter of UR's RTDE_Python_Client_Library: vectors numbered, blanks between."""
    names = ["target_q", "actual_q", "actual_current"]
    header = ["timestamp", *(f"{name}_{first + i}" for name in names for i in range(6)), "output_int_register_0"]
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, delimiter=delimiter)
        writer.writerow(header)
        writer.writerows([12_345.0 + t, *(q + 0.01), *q, *np.ones(6), 7] for t, q in zip(T, Q, strict=True))
    return file


def same(log: Recording) -> bool:
    return np.array_equal(log.q, Q) and np.allclose(log.t - log.t[0], T, atol=1e-9)


@pytest.mark.parametrize("delimiter", list(" ,;\t"))
def test_a_log_of_the_rtde_client_is_read_by_a_pattern(tmp_path: Path, delimiter: str) -> None:
    for first in (0, 1):
        file = rtde(tmp_path / "ur.csv", delimiter, first)
        assert same(read_recording(file, UR, columns="actual_q_%d"))


def test_columns_by_order_by_joint_and_as_text_are_the_same(tmp_path: Path) -> None:
    file = rtde(tmp_path / "ur.csv")
    names = [f"actual_q_{i}" for i in range(6)]
    pairs = dict(reversed([*zip(UR.joint_names, names, strict=True)]))
    text = ", ".join(f"{joint} = {name}" for joint, name in pairs.items())
    for columns in (names, tuple(names), ",".join(names), pairs, text):
        assert same(read_recording(file, UR, columns=columns, time="timestamp"))
    turned = read_recording(file, UR, columns=names[::-1])
    assert np.array_equal(turned.q, Q[:, ::-1])


def test_joints_that_a_mapping_leaves_out_have_their_own_names(tmp_path: Path) -> None:
    header = ["zeit", "timestamp", *UR.joint_names[:5], "wrist = 3"]
    rows = np.column_stack([T, T[::-1], Q])
    np.savetxt(tmp_path / "log.csv", rows, "%.17g", ",", header=",".join(header), comments="")
    for columns in ({"wrist_3_joint": "wrist = 3"}, "wrist_3_joint=wrist = 3"):
        assert same(read_recording(tmp_path / "log.csv", UR, columns=columns, time="zeit"))
    with pytest.raises(FileError, match="backward"):
        read_recording(tmp_path / "log.csv", UR, columns=columns)


@pytest.mark.parametrize(
    ("columns", "time", "fault"),
    [
        ("actual_Q_%d", None, "no column 'actual_Q_1' for joint 'shoulder_pan_joint'; did you mean 'actual_q_1'"),
        ("actual_q_%d", "timestmp", "no column 'timestmp' for the time; did you mean 'timestamp'"),
        ({"elbow_joint": "q"}, None, "no column 'q' for joint 'elbow_joint'"),
        ({"elbow_joint": "actual_q_2"}, None, "joints shoulder_pan_joint, shoulder_lift_joint, wrist_1_joint"),
    ],
)
def test_a_column_that_is_not_there_is_named_with_the_nearest(
    tmp_path: Path, columns: str | dict[str, str], time: str | None, fault: str
) -> None:
    with pytest.raises(FileError, match=fault):
        read_recording(rtde(tmp_path / "ur.csv"), UR, columns=columns, time=time)


def test_what_names_no_columns_is_refused_with_the_joints(tmp_path: Path) -> None:
    file = rtde(tmp_path / "ur.csv")
    for columns, error, words in (
        ("actual_q_0,actual_q_1", ArgumentError, "name 6 columns in the order shoulder_pan_joint"),
        (["actual_q_0"], ArgumentError, "name 6 columns"),
        ("", ArgumentError, "name 6 columns"),
        (["actual_q_0"] * 6, ArgumentError, "both shoulder_pan_joint and shoulder_lift_joint"),
        ("elbow=actual_q_2", UnknownNameError, "'elbow'"),
        ({"elbow_joint": 2}, ArgumentError, "column of joint 'elbow_joint'"),
        (None, FileError, r"--columns \(columns=\.\.\.\)"),
    ):
        with pytest.raises(error, match=words):
            read_recording(file, UR, columns=columns)
    (tmp_path / "bag.mcap").write_bytes(b"")
    with pytest.raises(ArgumentError, match="only CSV files have rows"):
        read_recording(tmp_path / "bag.mcap", UR, time="t")


def test_the_command_line_judges_such_a_log(tmp_path: Path, holokin: Command) -> None:
    file = rtde(tmp_path / "ur.csv")
    read = holokin("audit", str(file), "--robot", "ur5e", "--columns", "actual_q_%d", "--time", "timestamp")
    assert "4 forward, 0 backward" in read.out and read.code == 0
    wrong = holokin("audit", str(file), "--robot", "ur5e", "--columns", "actual_q%d")
    assert wrong.code == 2 and "did you mean 'actual_q_1'" in wrong.err


# --- what a CSV must not have ---------------------------------------------------------------------------------


def table(file: Path, header: list[str], rows: list[str]) -> Path:
    file.write_text("\n".join([",".join(header), *rows]) + "\n", "utf-8")
    return file


def lines(numbers: np.ndarray) -> list[str]:
    return [",".join(f"{v:.17g}" for v in row) for row in numbers]


@pytest.mark.parametrize("quoted", [False, True])
def test_a_line_with_a_cell_too_many_is_refused_by_its_number(tmp_path: Path, quoted: bool) -> None:
    """A decimal comma makes two cells of one, and every column after it the wrong one."""
    rows = lines(np.column_stack([T, Q]))
    if quoted:
        rows[1] = rows[1].replace(",", ',"', 1).replace(",", '",', 2).replace('",', ",", 1)
    rows[20] = rows[20].replace(".", ",", 1)
    file = table(tmp_path / "log.csv", ["t", *UR.joint_names], rows)
    with pytest.raises(FileError, match="line 22 has 8 cells, the header 7"):
        read_recording(file, UR)


def test_commas_at_the_ends_of_lines_are_no_cells(tmp_path: Path) -> None:
    rows = [f"{line},, " for line in lines(np.column_stack([T, Q]))]
    assert same(read_recording(table(tmp_path / "log.csv", ["t", *UR.joint_names], rows), UR))


def test_two_columns_of_one_name_are_refused_where_one_is_read(tmp_path: Path) -> None:
    rows = lines(np.column_stack([T, Q, Q[:, 0], Q[:, 0]]))
    for twice, fault in (("elbow_joint", "'elbow_joint', 'elbow_joint'; keep or name one"), ("t", "2 columns 't'")):
        file = table(tmp_path / "log.csv", ["t", *UR.joint_names, twice, "x"], rows)
        with pytest.raises(FileError, match=fault):
            read_recording(file, UR)
    with pytest.raises(FileError, match="2 columns 'x'"):
        read_recording(table(tmp_path / "log.csv", ["t", *UR.joint_names, "x", "x"], rows), UR, columns="elbow_joint=x")
    assert same(read_recording(table(tmp_path / "log.csv", ["t", *UR.joint_names, "x", "x"], rows), UR))


def test_positions_alone_are_a_workspace_of_a_position_task(tmp_path: Path, planar_3r: hk.Robot) -> None:
    points = np.array([[1.2, 0.6, 0.0], [1.3, 0.5, 0.0], [1.1, 0.7, 0.0]])
    file = table(tmp_path / "points.csv", ["X", "Y", "Z", "note"], [f"{line},7" for line in lines(points)])
    cloud = hk.path.read_workspace(file)
    assert np.array_equal(cloud.given[:, :3, 3], points) and "tool down" in str(cloud)
    assert np.array_equal(cloud.given[0, :3, :3], np.diag([1, -1, -1]))
    assert np.array_equal(hk.path.read_workspace(file, rotation=np.eye(3)).given[2, :3, :3], np.eye(3))
    law, q0 = hk.holonomic(hk.position(planar_3r), hk.lock(0)), [0.3, 0.9, 0.7]
    tools = [planar_3r.pose(q)[:2, 3] for q in hk.ik(law, q0).batch(points[:, :2]).q]
    assert np.allclose(tools, points[:, :2], atol=1e-12) and hk.coverage(law, cloud, q0).share == 1.0
    with pytest.raises(ArgumentError, match="rotation"):
        hk.path.read_workspace(file, rotation=2 * np.eye(3))
    full = table(tmp_path / "full.csv", ["x", "y", "z", "roll", "pitch", "yaw"], ["1,0,0,0,0,0"])
    with pytest.raises(ArgumentError, match="leave it out"):
        hk.path.read_workspace(full, rotation=np.eye(3))


# --- Logs as they come: bad rows, no header, several files, clock resets, idle phases; a tool free to spin.


ARM = hk.load("planar-3r")
NAMES = ARM.joint_names
UR5E = hk.with_tool(hk.load("ur5e"), [0.08, 0, 0.25], rpy=[0, np.deg2rad(35), 0])
UR5E_START = np.deg2rad([10.0, -100.0, 110.0, -95.0, -80.0, 20.0])


def cycles(count: int = 3, drift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """(t, q) of a planar arm that goes round a circle; with a drift by self-motion-free joints it moves on."""
    strategy = hk.holonomic(hk.position(ARM), hk.lock(2)) if not drift else hk.moore_penrose(hk.position(ARM))
    start = ARM.pose([0.3, 0.8, 0.5])[:3, 3]
    walk = hk.follow(strategy, hk.circle(start, start - [0.2, 0, 0]), [0.3, 0.8, 0.5], samples=200, cycles=count)
    return walk.t, walk.q


def write(file: Path, t: np.ndarray, q: np.ndarray, header: str | None = None, names: bool = False) -> Path:
    """A CSV file; with `names` as `ros2 topic echo --csv` writes a JointState."""
    lines = [] if header is None else [header]
    for time, row in zip(t, q, strict=True):
        values = ",".join(f"{v:.12f}" for v in row)
        if names:
            stamp = f"{1700000000 + int(time)},{round((time % 1) * 1e9)}"
            lines.append(f"{stamp},base,{','.join(NAMES[::-1])},{','.join(values.split(',')[::-1])},0,0,0,1,1,1")
        else:
            lines.append(f"{time:.9f},{values}")
    file.write_text("\n".join(lines) + "\n")
    return file


HEADER = "t," + ",".join(NAMES)


# --- bad rows ---


def test_bad_rows_are_refused_with_the_first_line_and_left_out_and_counted_if_asked(tmp_path: Path) -> None:
    t, q = cycles()
    file = write(tmp_path / "log.csv", t, q, HEADER)
    lines = file.read_text().splitlines()
    lines[7] = lines[7].replace(lines[7].split(",")[2], "nan")
    lines[9] = "garbage"
    lines[11] += ",1,2,3"
    file.write_text("\n".join(lines) + "\n")
    with pytest.raises(FileError, match="line 8, column 'q2' holds 'nan'"):
        read_recording(file, ARM)
    log = read_recording(file, ARM, skip_bad=True)
    keep = np.delete(np.arange(len(t)), [6, 8, 10])
    assert np.abs(log.q - q[keep]).max() < 1e-11 and np.abs(log.t - t[keep]).max() < 1e-8
    assert any(note.startswith("3 rows were left out that could not be read; the first: line 8") for note in log.notes)
    quoted = file.read_text().splitlines()
    quoted[5] = '"0.1","a","b","c"'
    file.write_text("\n".join(quoted) + "\n")
    assert len(read_recording(file, ARM, skip_bad=True)) == len(t) - 4
    with pytest.raises(FileError, match="no samples"):
        read_recording(write(tmp_path / "bad.csv", t[:2], np.full((2, 3), np.nan), HEADER), ARM, skip_bad=True)
    with pytest.raises(ArgumentError, match="only CSV files have rows"):
        read_recording(tmp_path, ARM, skip_bad=True)  # a folder is a bag


# --- no header ---


def test_a_joint_state_of_ros2_topic_echo_is_read_by_the_names_in_its_rows(tmp_path: Path) -> None:
    """The joints stand in the reverse order there, with rates and efforts behind; the note says what was taken."""
    t, q = cycles()
    log = read_recording(write(tmp_path / "echo.csv", t, q, names=True), ARM)
    assert np.abs(log.q - q).max() < 1e-11
    assert np.abs(log.t - t).max() < 1e-6
    (note,) = [note for note in log.notes if "no header" in note]
    assert "JointState" in note and "9, 8, 7 were taken for q1, q2, q3" in note


def test_cycles_that_are_the_same_to_the_last_digit_repeat(holokin: Command, tmp_path: Path) -> None:
    """Nothing is left over for noise to be: four cycles, written with twelve digits."""
    outcome = holokin("audit", write(tmp_path / "echo.csv", *cycles(4), names=True), "--robot", "planar-3r")
    assert (outcome.code, outcome.err) == (0, "")
    assert "JointState" in outcome.out


def test_without_a_header_the_number_of_columns_tells_and_the_note_says_so(tmp_path: Path) -> None:
    t, q = cycles()
    log = read_recording(write(tmp_path / "bare.csv", t, q), ARM)
    assert np.abs(log.q - q).max() < 1e-11
    assert any("guessed from the count: a time, the joints; columns 2 to 4 were taken" in note for note in log.notes)
    rates = read_recording(write(tmp_path / "rates.csv", t, np.hstack([q, 9 * q])), ARM)
    assert np.abs(rates.q - q).max() < 1e-11 and "their rates" in rates.notes[0]
    assert len(log) == len(t)  # the first line is a sample
    with pytest.raises(FileError, match="5 columns are none"):  # no stamp in two parts: these are whole numbers
        read_recording(write(tmp_path / "more.csv", t, np.hstack([q, q[:, :1]])), ARM)


def test_without_a_header_columns_are_named_by_their_numbers(tmp_path: Path) -> None:
    t, q = cycles()
    file = write(tmp_path / "odd.csv", t, np.hstack([9 * q, q, np.ones((len(t), 3))]))
    log = read_recording(file, ARM, columns="5, 6, 7")
    assert np.abs(log.q - q).max() < 1e-11 and "column 1 was taken for the time" in log.notes[0]
    assert np.abs(read_recording(file, ARM, columns="q3=7, q1=5, q2=6", time="1").q - q).max() < 1e-11


def test_columns_that_nobody_knows_are_refused_with_the_counts_that_are_known(tmp_path: Path) -> None:
    t, q = cycles(1)
    file = write(tmp_path / "many.csv", t, np.hstack([q, q[:, :1], q[:, :1], q, q]))
    with pytest.raises(FileError, match=r"12 columns are none.*4, 5, 7, 8, 10, 11 are known"):
        read_recording(file, ARM)
    one = hk.from_dh([{"a": 1.0}])  # of one joint, three columns may be a time in two parts or a rate
    both = tmp_path / "one.csv"
    both.write_text("1,100,0.1\n2,200,0.2\n3,300,0.3\n")
    with pytest.raises(FileError, match="3 columns are none"):
        read_recording(both, one)


# --- several files, several runs ---


def test_several_files_with_stamps_that_go_on_are_one_log(tmp_path: Path) -> None:
    t, q = cycles()
    half = len(t) // 2
    paths = [
        write(tmp_path / "a.csv", t[:half] + 1.7e9, q[:half], HEADER),
        write(tmp_path / "b.csv", t[half:] + 1.7e9, q[half:], HEADER),
    ]
    (log,) = read_runs(paths, ARM)
    assert np.abs(log.q - q).max() < 1e-11 and np.abs(log.t - t).max() < 1e-6
    assert len(log.gaps) == 0 and "2 files, a.csv to b.csv" in log.source
    (same,) = read_runs(paths, ARM, split=True)
    assert np.array_equal(same.t, log.t)


def test_a_clock_that_begins_anew_is_put_behind_with_a_gap(tmp_path: Path) -> None:
    t, q = cycles(2)
    paths = [write(tmp_path / f"{name}.csv", t, q, HEADER) for name in "ab"]
    (log,) = read_runs(paths, ARM)
    assert len(log) == 2 * len(t) and len(log.gaps) == 1 and (np.diff(log.t) > 0).all()
    assert "the clock of b.csv begins anew: put behind, with a gap" in log.notes
    found = hk.audit_recording(log, ARM)
    assert found.verdict is LogVerdict.REPEATS
    assert len(found.cycles) + found.cycles.left_out >= 4 and found.cycles.left_out <= 1
    first, second = read_runs(paths, ARM, split=True)
    assert np.array_equal(first.t, second.t) and second.source.endswith("run 2 of 2")


def test_one_file_is_cut_where_its_clock_is_set_back_and_refused_without_split(tmp_path: Path) -> None:
    t, q = cycles(2)
    file = write(tmp_path / "log.csv", np.concatenate([t, t]), np.vstack([q, q]), HEADER)
    with pytest.raises(FileError, match=r"time runs backward at line .*--split"):
        read_runs([file], ARM)
    runs = read_runs([file], ARM, split=True)
    assert [len(run) for run in runs] == [len(t), len(t)]
    assert np.abs(runs[1].q - q).max() < 1e-11


def test_a_log_is_cut_at_rests_and_not_at_dwells(tmp_path: Path) -> None:
    """Six seconds of rest with noise between two runs; a dwell of two seconds within the second one."""
    t, q = cycles(2)
    rng, step = np.random.default_rng(0), float(t[1])
    rest, dwell = np.arange(step, 8.0, step), np.arange(step, 2.0, step)
    half = len(t) // 2
    Q = [q, np.tile(q[-1], (len(rest), 1)), q[:half], np.tile(q[half - 1], (len(dwell), 1)), q[half:]]
    log = np.vstack(Q) + 1e-5 * rng.normal(size=(sum(map(len, Q)), 3))
    file = write(tmp_path / "log.csv", step * np.arange(len(log)), log, HEADER)
    runs = read_runs([file], ARM, split=True)
    assert len(runs) == 2
    assert abs(len(runs[0]) - len(t)) * step < 2.6 and abs(len(runs[1]) - len(t) - len(dwell)) * step < 2.6
    assert len(read_runs([file], ARM, split=True, idle=1.0)) == 3
    assert len(read_runs([file], ARM, split=True, idle=20.0)) == 1
    assert len(read_runs([file], ARM)) == 1
    still = write(tmp_path / "still.csv", step * np.arange(900), np.tile(q[0], (900, 1)), HEADER)
    with pytest.raises(FileError, match="all joints rest"):
        read_runs([still], ARM, split=True)
    with pytest.raises(ArgumentError, match="positive number of seconds"):
        read_runs([file], ARM, split=True, idle=0.0)
    with pytest.raises(ArgumentError, match="at least one"):
        read_runs([], ARM)


def test_the_command_audits_each_run_and_the_gravest_counts(holokin: Command, tmp_path: Path) -> None:
    t, q = cycles(3)
    _, drifting = cycles(3, drift=1.0)
    good, bad = write(tmp_path / "good.csv", t, q, HEADER), write(tmp_path / "bad.csv", t, drifting, HEADER)
    facts = tmp_path / "runs.json"
    outcome = holokin("audit", good, bad, "--robot", "planar-3r", "--split", "--json", facts)
    assert outcome.code == 1
    assert [run["verdict"] for run in json.loads(facts.read_text())["runs"]] == ["REPEATS", "DIFFERS"]
    assert holokin("audit", good, good, "--robot", "planar-3r", "--split").code == 0
    short = write(tmp_path / "short.csv", t[:80], q[:80], HEADER)
    told = holokin("audit", good, short, "--robot", "planar-3r", "--split")
    assert told.code == 0 and "not audited" in told.out
    assert_refused(holokin("audit", short, "--robot", "planar-3r"), "fewer than two cycles")
    assert_refused(holokin("audit", good, "--robot", "planar-3r", "--position", "--axis", "z"), "give one of them")
    lines = good.read_text().splitlines()
    good.write_text("\n".join([*lines[:5], "x,y,z,w", *lines[5:]]) + "\n")
    assert_refused(holokin("audit", good, "--robot", "planar-3r"), "line 6")
    assert "1 row was left out" in " ".join(holokin("audit", good, "--robot", "planar-3r", "--skip-bad").out.split())


# --- a tool free to spin ---


def _torch_log(strategy: hk.Strategy, count: int = 3) -> Recording:
    start = UR5E.pose(UR5E_START)[:3, 3]
    loop = hk.circle(start, start + [0.08, 0, 0])
    walk = hk.follow(strategy, loop, UR5E_START, samples=150, cycles=count)
    return Recording(UR5E.joint_names, walk.t, walk.q, "torch")


@pytest.mark.campaign
def test_a_torch_that_spins_is_judged_by_its_point_and_its_axis() -> None:
    """The pseudo-inverse of the free axis spins the torch on from cycle to cycle: the pose repeats no path, the
    position leaves three joints free; by the axis the drift is that of the simulation. A rule repeats.
    """
    task = hk.pose(UR5E, "axis", reference=UR5E.pose(UR5E_START)[:3, :3])
    drifting = hk.audit_recording(_torch_log(hk.moore_penrose(task)), UR5E, axis="z", tolerance=1e-4)
    assert drifting.verdict is LogVerdict.DIFFERS and drifting.task.orientation == "axis"
    start = UR5E.pose(UR5E_START)[:3, 3]
    known = hk.drift(hk.moore_penrose(task), hk.circle(start, start + [0.08, 0, 0]), UR5E_START, samples=150, cycles=3)
    assert len(drifting.cycles) == 3
    since_start = np.abs(drifting.since_start).max(axis=1)
    assert since_start == pytest.approx(known.largest, rel=0.02)
    held = hk.audit_recording(_torch_log(hk.holonomic(task, hk.lock(5))), UR5E, axis=[0, 0, 1])
    assert held.verdict is LogVerdict.REPEATS
    with pytest.raises(ArgumentError, match="give one of them"):
        hk.audit_recording(_torch_log(hk.holonomic(task, hk.lock(5))), UR5E, axis="z", orientation=True)


def test_a_torch_whose_axis_tilts_on_repeats_no_path_by_its_axis() -> None:
    """A circle of the tool's point, the axis leaning a little more each time: by the position alone it repeats."""
    task, q, rows = hk.pose(UR5E), UR5E_START.copy(), []
    start, angles = UR5E.pose(q), np.linspace(0, 6 * np.pi, 301)
    for angle in angles:
        T = start.copy()
        T[:3, 3] += [0.05 * (1 - np.cos(angle)), 0.05 * np.sin(angle), 0]
        lean = 0.05 * angle / (2 * np.pi)
        c, s = np.cos(lean), np.sin(lean)
        T[:3, :3] = np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ T[:3, :3]
        for _ in range(4):
            q = q + np.linalg.solve(task.jacobian(q), task.error(q, T[:3, 3], T[:3, :3]))
        rows.append(q)
    log = Recording(UR5E.joint_names, np.linspace(0, 30, 301), np.array(rows), "leaning")
    with pytest.raises(FileError, match="--axis z if the tool may spin"):
        hk.audit_recording(log, UR5E, axis="z")
    assert len(hk.audit_recording(log, UR5E, orientation=False).cycles) >= 2
