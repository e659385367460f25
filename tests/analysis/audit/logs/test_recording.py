"""Logs of joint motion: what is read from CSV, rosbag2 and MCAP, and what is refused with which sentence."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.fuzz.harness import run

import holokin as hk
from bags import JOINTS, Q, T, write_bag
from conftest import PANDA_START, campaign
from holokin.analysis.audit.logs import Recording
from holokin.base.errors import ArgumentError, FileError


def write_csv(file: Path, header: Sequence[str], rows: Any, delimiter: str = ",") -> Path:
    lines = [delimiter.join(header), *(delimiter.join(str(cell) for cell in row) for row in rows)]
    file.write_text("\n".join(lines) + "\n", "utf-8")
    return file


@pytest.fixture
def log(tmp_path: Path) -> Callable[..., Path]:
    """Writes a log of the Panda; a change may spoil its header or rows first."""

    def make(change: Callable[[list[str], list[list[Any]]], None] | None = None) -> Path:
        header, rows = ["t", *JOINTS], np.column_stack([T, Q]).tolist()
        if change is not None:
            change(header, rows)
        return write_csv(tmp_path / "log.csv", header, rows)

    return make


def refused(file: Path, *words: str, **options: Any) -> str:
    with pytest.raises(FileError) as problem:
        hk.read_recording(file, hk.load("panda"), **options)
    sentence = str(problem.value)
    assert "\n" not in sentence
    for word in (str(file), *words):
        assert word in sentence
    return sentence


def test_a_saved_trajectory_is_read_back_to_the_last_bit(panda: hk.Robot, tmp_path: Path) -> None:
    start = panda.pose(PANDA_START)[:3, 3]
    walk = hk.follow(hk.moore_penrose(hk.pose(panda)), hk.circle(start, start - [0.1, 0, 0]), PANDA_START, samples=50)
    walk.save(tmp_path / "walk.csv")
    back = hk.read_recording(tmp_path / "walk.csv", panda)
    assert np.array_equal(back.q, walk.q) and np.array_equal(back.t, walk.t)
    assert back.joint_names == panda.joint_names and back.notes == ()


@pytest.mark.parametrize("form", ["robot/{}", "position.{}", "/joint_states/{}/position", "arm:{}", "{}"])
@pytest.mark.parametrize("time", ["time", "Stamp", "secs", "timestamp", "header.stamp", "__time"])
def test_columns_in_any_order_with_prefixes_and_strangers(
    panda: hk.Robot, tmp_path: Path, form: str, time: str
) -> None:
    order = np.random.default_rng(1).permutation(7)
    header = ["mode", *(form.format(JOINTS[i]) for i in order), time, *(f"velocity.{name}" for name in JOINTS)]
    rows = [["auto", *Q[k, order], T[k], *np.zeros(7)] for k in range(len(T))]
    for delimiter in ",;\t":
        back = hk.read_recording(write_csv(tmp_path / "log.csv", header, rows, delimiter), panda)
        assert np.array_equal(back.q, Q) and np.array_equal(back.t, T)


def test_a_prefix_that_fits_two_columns_is_refused(tmp_path: Path) -> None:
    header = ["t", *(f"left/{j}" for j in JOINTS), *(f"right/{j}" for j in JOINTS)]
    file = write_csv(tmp_path / "two.csv", header, np.column_stack([T, Q, Q]))
    refused(file, "panda_joint1", "'left/panda_joint1'", "'right/panda_joint1'", "keep or name one")


def test_whole_nanoseconds_keep_their_steps(panda: hk.Robot, log: Callable[..., Path]) -> None:
    """Unix stamps in ns have 19 digits, more than a float holds: differences are taken first."""

    def stamps(_header: list[str], rows: list[list[Any]]) -> None:
        for k, row in enumerate(rows):
            row[0] = 1_763_700_000_123_456_789 + 10_000_001 * k

    back = hk.read_recording(log(stamps), panda)
    assert back.t == pytest.approx(0.010000001 * np.arange(40), abs=1e-15)
    assert any("nanoseconds" in note for note in back.notes)


def test_split_stamps_are_joined(panda: hk.Robot, tmp_path: Path) -> None:
    header = ["secs", "nsecs", *JOINTS]
    rows = [[1_700_000_000 + k // 100, 10_000_000 * (k % 100), *q] for k, q in enumerate(np.vstack([Q] * 4))]
    back = hk.read_recording(write_csv(tmp_path / "log.csv", header, rows), panda)
    assert back.t == pytest.approx(0.01 * np.arange(160), abs=1e-12)


def test_degrees_are_told_from_radians_by_the_limits(panda: hk.Robot, log: Callable[..., Path]) -> None:
    def to_degrees(_header: list[str], rows: list[list[Any]]) -> None:
        for row in rows:
            row[1:] = np.rad2deg(row[1:]).tolist()

    file = log(to_degrees)
    refused(file, "panda_joint", "far outside its limits", "fits in degrees", "pass --degrees")
    assert hk.read_recording(file, panda, degrees=True).q == pytest.approx(Q, abs=1e-14)
    kept = hk.read_recording(file, panda, degrees=False)
    assert kept.q.max() > 90 and any("outside its limits" in note for note in kept.notes)


def test_slides_stay_metres_when_hinges_are_in_degrees(ppr: hk.Robot, tmp_path: Path) -> None:
    q = np.column_stack([np.linspace(0, 1, 9), np.linspace(1, 0, 9), np.linspace(0, 1.5, 9)])
    rows = np.column_stack([np.arange(9.0), q[:, :2], np.rad2deg(q[:, 2])])
    file = write_csv(tmp_path / "ppr.csv", ["t", *ppr.joint_names], rows)
    assert hk.read_recording(file, ppr, degrees=True).q == pytest.approx(q, abs=1e-14)


def test_an_endless_joint_logged_modulo_a_turn_runs_on(tmp_path: Path) -> None:
    urdf = "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>{}</robot>"
    joint = "<joint name='j{0}' type='continuous'><parent link='{1}'/><child link='{2}'/><axis xyz='0 0 1'/></joint>"
    joints = "".join(joint.format(i, "abc"[i], "bcd"[i]) for i in range(3))
    (tmp_path / "r.urdf").write_text(urdf.format(joints))
    robot = hk.from_urdf(tmp_path / "r.urdf", tip="d")
    q = np.column_stack([np.linspace(0, 9, 50), np.full(50, 0.4), np.full(50, 0.3)])
    wrapped = np.column_stack([np.arange(50.0), np.angle(np.exp(1j * q))])
    file = write_csv(tmp_path / "log.csv", ["t", *robot.joint_names], wrapped)
    assert np.isinf(robot.upper).all()
    back = hk.read_recording(file, robot)
    assert back.q == pytest.approx(q, abs=1e-12)
    assert robot.joint_names[0] in back.notes[0]


# --- faults ---------------------------------------------------------------------------------------------------


def test_a_missing_file_and_one_that_is_no_text_are_refused(tmp_path: Path) -> None:
    refused(tmp_path / "none.csv", "there is no such file")
    (tmp_path / "noise.csv").write_bytes(bytes(range(256)))
    refused(tmp_path / "noise.csv", "cannot be read as text")


def test_empty_logs_are_refused(tmp_path: Path, log: Callable[..., Path]) -> None:
    (tmp_path / "empty.csv").write_text("")
    refused(tmp_path / "empty.csv", "is empty")
    refused(log(lambda _header, rows: rows.clear()), "no samples")
    refused(log(lambda _header, rows: rows.__delitem__(slice(1, None))), "single sample", "two cycles")


def test_a_log_without_header_or_time_is_refused(log: Callable[..., Path]) -> None:
    refused(log(lambda header, _rows: header.__setitem__(0, "counter")), "no time column", "timestamp", "counter")

    def numbers(header: list[str], rows: list[list[Any]]) -> None:
        for row in rows:
            row.append(0.0)
        header[:] = map(str, rows[0])

    refused(log(numbers), "line 1 holds numbers", "--columns")


def test_missing_joints_are_named_with_the_columns_there_are(log: Callable[..., Path]) -> None:
    def rename(header: list[str], _rows: list[list[Any]]) -> None:
        header[3], header[5] = "q3", "q5"

    refused(log(rename), "panda_joint3, panda_joint5", "panda_joint1", "q3", "q5", "rename")


@pytest.mark.parametrize("cell", ["nan", "inf", "n/a", ""])
def test_a_bad_cell_is_named_by_line_and_column(log: Callable[..., Path], cell: str) -> None:
    refused(log(lambda _h, rows: rows[17].__setitem__(4, cell)), "line 19", "'panda_joint4'", repr(cell), "correct")
    refused(log(lambda _h, rows: rows[17].__delitem__(slice(3, None))), "line 19 has 3 cells")


def test_repeated_rows_are_dropped_and_conflicts_refused_with_their_line(
    panda: hk.Robot, log: Callable[..., Path]
) -> None:
    back = hk.read_recording(log(lambda _h, rows: rows.insert(5, list(rows[5]))), panda)
    assert np.array_equal(back.q, Q) and back.notes == ("1 repeated rows dropped",)
    refused(log(lambda _h, rows: rows[8].__setitem__(0, rows[7][0])), "line 10", "with other joints")
    refused(log(lambda _h, rows: rows[8].__setitem__(0, -1.0)), "backward at line 10")
    with pytest.raises(ArgumentError, match="rising times"):
        Recording(JOINTS, T[::-1].copy(), Q, "memory")


def test_gaps_are_noted_not_refused(panda: hk.Robot, log: Callable[..., Path]) -> None:
    back = hk.read_recording(log(lambda _h, rows: rows.__delitem__(slice(10, 25))), panda)
    assert back.gaps.tolist() == [9]
    assert back.notes[0].startswith("1 gaps in time, the longest 0.16 s")


def test_a_topic_for_a_csv_file_is_refused(panda: hk.Robot, log: Callable[..., Path]) -> None:
    with pytest.raises(ArgumentError, match="only bags have topics"):
        hk.read_recording(log(), panda, topic="/joint_states")


# --- bags -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_a_rosbag2_gives_the_arms_states_whatever_their_order(panda: hk.Robot, tmp_path: Path, kind: str) -> None:
    folder = write_bag(tmp_path / "bag", kind)
    single = next(f for f in folder.iterdir() if f.suffix in (".mcap", ".db3"))
    for file in (folder, single):
        back = hk.read_recording(file, panda)
        assert np.array_equal(back.q, Q)
        assert back.t == pytest.approx(T, abs=1e-12)
        assert "10 messages without all of the robot's joints left out" in back.notes


def test_messages_without_stamps_take_their_time_of_reception(panda: hk.Robot, tmp_path: Path) -> None:
    back = hk.read_recording(write_bag(tmp_path / "bag", "mcap", stamped=False), panda)
    assert back.t == pytest.approx(T, abs=1e-12)
    assert any("reception" in note for note in back.notes)


def test_a_single_other_topic_is_taken_and_a_wrong_one_refused_by_name(panda: hk.Robot, tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "bag", "mcap", topic="/franka/states")
    assert "topic /franka/states" in hk.read_recording(folder, panda).notes
    refused(folder, "no JointState messages on /joint_states", "--topic", "/franka/states", topic="/joint_states")
    refused(folder, "no JointState messages on /rosout", "/franka/states", topic="/rosout")


def test_bags_without_the_robots_joints_and_broken_ones_are_refused(tmp_path: Path) -> None:
    names = [f"fr3_joint{i}" for i in range(1, 8)]
    refused(write_bag(tmp_path / "bag", "mcap", names=names), "panda_joint1", "fr3_joint1", "panda_finger_joint1")
    whole = next((tmp_path / "bag").glob("*.mcap"))
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:700])
    refused(tmp_path / "cut.mcap", "cannot be read as a bag")
    (tmp_path / "folder").mkdir()
    refused(tmp_path / "folder", "metadata.yaml")
    spoilt = Q.copy()
    spoilt[3, 2] = np.nan
    refused(write_bag(tmp_path / "nan", "sqlite3", positions=spoilt), "panda_joint3 is not finite")


def test_without_rosbags_the_extra_is_named(panda: hk.Robot, tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "a.mcap").write_bytes(b"")
    monkeypatch.setitem(__import__("sys").modules, "rosbags.rosbag2", None)
    with pytest.raises(hk.HolokinError, match=r"holokin\[log\]"):
        hk.read_recording(tmp_path / "a.mcap", panda)


def test_small_drifts_there_and_back_are_a_way_dependence_and_no_drift() -> None:
    """A law with a posture task, round and back again: each cycle strays by less than counts, and none adds up."""
    robot = hk.load("panda")
    start = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    task, point = hk.pose(robot), robot.pose(start)[:3, 3]
    loop = hk.circle(point, point - [0.1, 0, 0])
    law = hk.motion.control.gradient_projection(task, hk.strategies.constraints.posture_cost(start), 5.0, 40.0)
    walk = hk.simulate(law, task, loop + loop.reversed(), start, dt=0.02, cycles=4)
    found = hk.audit_recording(Recording(robot.joint_names, walk.t, walk.q, "a loop"), robot)
    assert found.verdict is hk.analysis.audit.LogVerdict.DIFFERS and found.trend is hk.analysis.audit.Trend.NONE
    assert np.abs(found.drift).max() < 1e-3
    assert found.by_way is not None
    assert found.by_way.beyond


@pytest.mark.parametrize("kind", ["csv_logs", "bags"])
@pytest.mark.parametrize("count", [20, campaign("count", 150)])
def test_no_mutant_of_a_log_ends_in_a_traceback(kind: str, count: int) -> None:
    if kind == "bags":
        pytest.importorskip("rosbags")
    tally = run(kind, count, workers=1)
    assert tally.done == count
    assert count / 10 < tally.refused < count
    assert [fault for fault in tally.faults if fault[0] >= 0] == []  # the process holds other tests' memory, too
    assert tally.slowest < 20
