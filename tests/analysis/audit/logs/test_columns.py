"""Logs whose columns somebody else named: UR's RTDE client, spreadsheets, loggers of users."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command
from holokin.base.errors import ArgumentError, RecordingError, UnknownNameError

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


def same(log: hk.analysis.audit.logs.Recording) -> bool:
    return np.array_equal(log.q, Q) and np.allclose(log.t - log.t[0], T, atol=1e-9)


@pytest.mark.parametrize("delimiter", list(" ,;\t"))
def test_a_log_of_the_rtde_client_is_read_by_a_pattern(tmp_path: Path, delimiter: str) -> None:
    for first in (0, 1):
        file = rtde(tmp_path / "ur.csv", delimiter, first)
        assert same(hk.read_recording(file, UR, columns="actual_q_%d"))


def test_columns_by_order_by_joint_and_as_text_are_the_same(tmp_path: Path) -> None:
    file = rtde(tmp_path / "ur.csv")
    names = [f"actual_q_{i}" for i in range(6)]
    pairs = dict(reversed([*zip(UR.joint_names, names, strict=True)]))
    text = ", ".join(f"{joint} = {name}" for joint, name in pairs.items())
    for columns in (names, tuple(names), ",".join(names), pairs, text):
        assert same(hk.read_recording(file, UR, columns=columns, time="timestamp"))
    turned = hk.read_recording(file, UR, columns=names[::-1])
    assert np.array_equal(turned.q, Q[:, ::-1])


def test_joints_that_a_mapping_leaves_out_have_their_own_names(tmp_path: Path) -> None:
    header = ["zeit", "timestamp", *UR.joint_names[:5], "wrist = 3"]
    rows = np.column_stack([T, T[::-1], Q])
    np.savetxt(tmp_path / "log.csv", rows, "%.17g", ",", header=",".join(header), comments="")
    for columns in ({"wrist_3_joint": "wrist = 3"}, "wrist_3_joint=wrist = 3"):
        assert same(hk.read_recording(tmp_path / "log.csv", UR, columns=columns, time="zeit"))
    with pytest.raises(RecordingError, match="backward"):
        hk.read_recording(tmp_path / "log.csv", UR, columns=columns)


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
    with pytest.raises(RecordingError, match=fault):
        hk.read_recording(rtde(tmp_path / "ur.csv"), UR, columns=columns, time=time)


def test_what_names_no_columns_is_refused_with_the_joints(tmp_path: Path) -> None:
    file = rtde(tmp_path / "ur.csv")
    for few in ("actual_q_0,actual_q_1", ["actual_q_0"], ""):
        with pytest.raises(ArgumentError, match=r"name 6 columns in the order shoulder_pan_joint, .*q_%d"):
            hk.read_recording(file, UR, columns=few)
    with pytest.raises(ArgumentError, match="both shoulder_pan_joint and shoulder_lift_joint"):
        hk.read_recording(file, UR, columns=["actual_q_0"] * 6)
    with pytest.raises(UnknownNameError, match="'elbow'; did you mean 'elbow_joint'"):
        hk.read_recording(file, UR, columns="elbow=actual_q_2")
    with pytest.raises(ArgumentError, match="column of joint 'elbow_joint'"):
        hk.read_recording(file, UR, columns={"elbow_joint": 2})  # type: ignore[dict-item]
    (tmp_path / "bag.mcap").write_bytes(b"")
    with pytest.raises(ArgumentError, match="only CSV files have rows"):
        hk.read_recording(tmp_path / "bag.mcap", UR, time="t")


def test_missing_joints_say_how_columns_are_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"--columns \(columns=\.\.\.\)"):
        hk.read_recording(rtde(tmp_path / "ur.csv"), UR)


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
    with pytest.raises(RecordingError, match=r"line 22 has 8 cells, the header 7; .*decimals with a point"):
        hk.read_recording(file, UR)


def test_commas_at_the_ends_of_lines_are_no_cells(tmp_path: Path) -> None:
    rows = [f"{line},, " for line in lines(np.column_stack([T, Q]))]
    assert same(hk.read_recording(table(tmp_path / "log.csv", ["t", *UR.joint_names], rows), UR))


def test_two_columns_of_one_name_are_refused_where_one_is_read(tmp_path: Path) -> None:
    rows = lines(np.column_stack([T, Q, Q[:, 0], Q[:, 0]]))
    for twice, fault in (("elbow_joint", "'elbow_joint', 'elbow_joint'; keep or name one"), ("t", "2 columns 't'")):
        file = table(tmp_path / "log.csv", ["t", *UR.joint_names, twice, "x"], rows)
        with pytest.raises(RecordingError, match=fault):
            hk.read_recording(file, UR)
    with pytest.raises(RecordingError, match="2 columns 'x'"):
        hk.read_recording(
            table(tmp_path / "log.csv", ["t", *UR.joint_names, "x", "x"], rows), UR, columns="elbow_joint=x"
        )
    assert same(hk.read_recording(table(tmp_path / "log.csv", ["t", *UR.joint_names, "x", "x"], rows), UR))


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
