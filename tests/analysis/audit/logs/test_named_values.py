"""Files that name their joints in each row or message, or count them in their own way; the units of their times."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import holokin as hk
import small_datasets
from bags import JOINTS, Q, T, write_bag
from conftest import Command, sampled
from holokin.analysis.audit.logs import joint_feature, read_dataset
from holokin.analysis.audit.logs.datasets import postures_of
from holokin.base.errors import ArgumentError, FileError, UnknownNameError

PANDA = hk.load("panda")
ORDERS = [np.roll(np.arange(7), k)[:: (-1) ** k] for k in range(len(Q))]


def rostopic(folder: Path, prefix: str = "", same: bool = False) -> Path:
    """As `rostopic echo -p` writes it: the names of each message beside its positions, in any order."""
    head = ["%time", *(f"field.name{i}" for i in range(7)), *(f"field.position{i}" for i in range(7))]
    lines = [",".join(head)]
    for t, q, order in zip(T, Q, ORDERS, strict=True):
        order = ORDERS[0] if same else order
        names, values = [f"{prefix}{JOINTS[i]}" for i in order], [f"{q[i]:.12g}" for i in order]
        lines.append(",".join([str(1_700_000_000_000_000_000 + round(1e9 * t)), *names, *values]))
    file = folder / "rostopic.csv"
    file.write_text("\n".join(lines) + "\n")
    return file


def ros2_topic(folder: Path) -> Path:
    """As `ros2 topic echo --csv` writes it, without a header."""
    lines = []
    for t, q, order in zip(T, Q, ORDERS, strict=True):
        cells = ["7", str(round(1e9 * t)), "base", *(JOINTS[i] for i in order), *(f"{q[i]:.12g}" for i in order)]
        lines.append(",".join([*cells, *["0.0"] * 14]))
    file = folder / "ros2.csv"
    file.write_text("\n".join(lines) + "\n")
    return file


@pytest.mark.parametrize("write", [rostopic, ros2_topic, lambda folder: rostopic(folder, "arm/")])
def test_each_row_is_read_by_the_names_in_it(tmp_path: Path, write: Callable[[Path], Path]) -> None:
    log = hk.read_recording(write(tmp_path), PANDA)
    np.testing.assert_allclose(log.q, Q, atol=1e-11)
    assert any("names" in note for note in log.notes)


def test_names_in_the_file_say_more_than_a_pattern_and_contradict_a_list(tmp_path: Path) -> None:
    file = rostopic(tmp_path, same=True)
    log = hk.read_recording(file, PANDA, columns="field.position%d")
    np.testing.assert_allclose(log.q, Q, atol=1e-11)
    given = [f"field.position{int(np.argwhere(ORDERS[0] == i)[0, 0])}" for i in range(7)]
    np.testing.assert_allclose(hk.read_recording(file, PANDA, columns=given).q, Q, atol=1e-11)
    with pytest.raises(FileError, match=r"line 2 names 'panda_joint\d' where --columns says 'panda_joint"):
        hk.read_recording(file, PANDA, columns=given[::-1])
    other = hk.load("iiwa14")  # whose joints the file does not name: the columns are as they are given
    plain = hk.read_recording(file, other, columns="field.position%d", degrees=False, counts_turns=True)
    np.testing.assert_allclose(plain.q, Q[:, ORDERS[0]], atol=1e-11)


def test_bags_take_prefixes_and_columns(tmp_path: Path) -> None:
    prefixed = write_bag(tmp_path / "prefixed", "mcap", names=[f"left_{joint}" for joint in JOINTS])
    assert hk.read_recording(prefixed, PANDA).q == pytest.approx(Q)
    named = write_bag(tmp_path / "named", "mcap", names=[f"A{i}" for i in range(1, 8)])
    assert hk.read_recording(named, PANDA, columns="A%d").q == pytest.approx(Q)
    swapped = {"panda_joint1": "A2", "panda_joint2": "A1"} | {f"panda_joint{i}": f"A{i}" for i in range(3, 8)}
    assert hk.read_recording(named, PANDA, columns=swapped).q == pytest.approx(Q[:, [1, 0, 2, 3, 4, 5, 6]])
    with pytest.raises(FileError, match="there is no name 'B1' for joint 'panda_joint1'"):
        hk.read_recording(named, PANDA, columns="B%d")


def test_a_bag_of_two_arms_is_not_read_as_either(tmp_path: Path) -> None:
    both = [f"{side}_{joint}" for side in ("left", "right") for joint in JOINTS]
    bag = write_bag(tmp_path / "both", "mcap", names=both, positions=np.hstack([Q, Q + 0.01]))
    with pytest.raises(FileError, match="'panda_joint1' could be any of the joints"):
        hk.read_recording(bag, PANDA)
    columns = [f"right_{joint}" for joint in JOINTS]
    assert hk.read_recording(bag, PANDA, columns=columns).q == pytest.approx(Q + 0.01)


COUNTS = {
    "signs": {"panda_joint2": -1, "panda_joint4": -1}, "offsets": {"panda_joint1": 0.5, "panda_joint4": -np.pi / 2},
    "scales": {"panda_joint6": 2 * np.pi / 4096},
}  # fmt: skip


def as_counted(q: np.ndarray, degrees: bool) -> np.ndarray:
    """By the formula of robot programs: axis = sign * joint + offset, in the unit of the axis."""
    values = q.copy()
    values[:, [1, 3]] *= -1
    values[:, 0] += 0.5
    values[:, 3] -= np.pi / 2
    return values * np.where(np.arange(7) == 5, 4096 / (2 * np.pi), 180 / np.pi if degrees else 1.0)


@pytest.mark.parametrize("degrees", [None, True])
def test_signs_offsets_and_scales_are_those_of_programs(tmp_path: Path, degrees: bool | None) -> None:
    header, values = ",".join(["t", *JOINTS]), as_counted(Q, bool(degrees))
    np.savetxt(tmp_path / "log.csv", np.column_stack([T, values]), delimiter=",", header=header, comments="")
    log = hk.read_recording(tmp_path / "log.csv", PANDA, degrees=degrees, **COUNTS)
    np.testing.assert_allclose(log.q, Q, atol=1e-12)
    column = {"observation.state": values}
    folder = small_datasets.write_dataset(
        tmp_path / "d", [column], {"observation.state": list(JOINTS)}, dtype="float64"
    )  # fmt: skip
    data = read_dataset(folder)
    joints = joint_feature(data, PANDA, "observation.state", degrees=degrees, **COUNTS)
    np.testing.assert_allclose(postures_of(data, PANDA, joints, values), Q, atol=1e-12)
    np.testing.assert_allclose(joints.values(PANDA, Q), values, atol=1e-9)


def test_what_counts_no_joint_is_refused(tmp_path: Path) -> None:
    file = rostopic(tmp_path)
    with pytest.raises(UnknownNameError, match="joint of signs, offsets or scales"):
        hk.read_recording(file, PANDA, signs={"panda_joint9": -1})
    for wrong in ({"signs": {"panda_joint1": 2}}, {"scales": {"panda_joint1": 0.0}}):
        with pytest.raises(ArgumentError, match="give"):
            hk.read_recording(file, PANDA, **wrong)


def test_the_command_takes_them(tmp_path: Path, holokin: Command) -> None:
    u = np.linspace(0, 6 * np.pi, 240)
    loops = Q[0] + 0.1 * np.sin(u[:, None] + np.arange(7))
    rows = np.column_stack([u, as_counted(loops, False)])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=",".join(["t", *JOINTS]), comments="")
    words = ["--signs", "panda_joint2=-1, panda_joint4=-1", "--offsets", "panda_joint1=0.5, panda_joint4=-90deg"]
    words += ["--scales", f"panda_joint6={2 * np.pi / 4096}"]
    log = str(tmp_path / "log.csv")
    assert holokin("audit", log, "--robot", "panda", *words).code == 0
    assert "give pairs like" in holokin("audit", log, "--robot", "panda", "--signs", "panda_joint2").err


@sampled(6, "seed", list(range(60)))
def test_encoder_ticks_are_told_from_angles_and_read_with_scales_and_zeros(seed: int, tmp_path: Path) -> None:
    """Of random encoders; whole degrees within the limits, and a log of zeros, are no ticks."""
    draw = np.random.default_rng(seed)
    names = PANDA.joint_names
    per_turn = 2.0 ** draw.integers(12, 20, 7)
    zeros = np.round(per_turn * draw.uniform(0.3, 0.7, 7))
    t = np.linspace(0, 4, 201)
    size = 0.3 * (PANDA.upper - PANDA.lower)
    q = (PANDA.lower + PANDA.upper) / 2 + size * np.sin(np.pi * t[:, None] + draw.uniform(0, 6, 7))
    ticks = np.round(zeros + q * per_turn / (2 * np.pi))
    file = tmp_path / "log.csv"

    def read(values: np.ndarray, **said: Any) -> hk.motion.Recording:
        np.savetxt(file, np.c_[t, values], delimiter=",", header=",".join(["t", *names]), comments="", fmt="%.10g")
        return hk.read_recording(file, PANDA, **said)

    for degrees in (None, True):
        with pytest.raises(FileError, match="all values are whole numbers"):
            read(ticks, degrees=degrees)
    scales = dict(zip(names, 2 * np.pi / per_turn, strict=True))
    offsets = dict(zip(names, zeros * 2 * np.pi / per_turn, strict=True))
    assert np.abs(read(ticks, scales=scales, offsets=offsets).q - q).max() < np.pi / per_turn.min() + 1e-9
    assert np.abs(read(np.round(np.rad2deg(q)), degrees=True).q - q).max() < np.pi / 360 + 1e-9
    assert not read(np.zeros_like(q), degrees=False).q.any()


# --- Times of logs and of way-points: the header says their unit, or the size of the stamps does, in one way for both.


SINCE = np.arange(len(Q)) * 0.008
UNITS = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
HEADERS = {
    "s": ("t_s", "Time (s)", "time [s]", "seconds", "timestamp_sec"), "ms": ("t_ms", "t [ms]", "Time (ms)", "stamp_ms"),
    "us": ("t_us", "stamp_us", "timestamp [us]", "Time (µs)"), "ns": ("t_ns", "time [ns]", "stamp_nanosec"),
}  # fmt: skip


def log_times(folder: Path, header: str, stamps: list[str]) -> hk.analysis.audit.logs.Recording:
    file = folder / "log.csv"
    lines = [",".join([stamp, *(f"{v:.9f}" for v in q)]) for stamp, q in zip(stamps, Q, strict=True)]
    file.write_text("\n".join([",".join([header, *JOINTS]), *lines]) + "\n", "utf-8")
    return hk.read_recording(file, hk.load("panda"))


def path_times(folder: Path, header: str, stamps: list[str]) -> np.ndarray | None:
    file = folder / "path.csv"
    file.write_text("\n".join([f"{header},x,y,z", *(f"{s},{k},0,0" for k, s in enumerate(stamps))]) + "\n", "utf-8")
    return hk.read_paths(file, units="mm").paths[0].times


def whole(unit: str, first: int) -> list[str]:
    """Stamps that begin `first` seconds after zero, in whole units but for seconds."""
    size = UNITS[unit]
    return [f"{first + t:.3f}" if unit == "s" else str(first * size + round(t * size)) for t in SINCE]


@pytest.mark.parametrize(("unit", "header"), [(unit, name) for unit, names in HEADERS.items() for name in names])
@pytest.mark.parametrize("first", [0, 1_700_000_000])
def test_the_header_says_the_unit_of_logs_and_way_points(tmp_path: Path, unit: str, header: str, first: int) -> None:
    for times in (log_times(tmp_path, header, whole(unit, first)).t, path_times(tmp_path, header, whole(unit, first))):
        assert times is not None
        np.testing.assert_allclose(times - times[0], SINCE, atol=1e-6)


@pytest.mark.parametrize("unit", UNITS)
def test_unix_time_says_its_unit_by_its_size(tmp_path: Path, unit: str) -> None:
    stamps = whole(unit, 1_700_000_000)
    for times in (log_times(tmp_path, "time", stamps).t, path_times(tmp_path, "time", stamps)):
        assert times is not None
        np.testing.assert_allclose(times - times[0], SINCE, atol=1e-6)


def test_a_clock_that_counts_from_zero_says_it_by_its_step(tmp_path: Path) -> None:
    for unit in ("ms", "us", "ns"):
        log = log_times(tmp_path, "t", whole(unit, 0))
        np.testing.assert_allclose(log.t, SINCE, atol=1e-9)
        assert any("stamps read as" in note for note in log.notes)
    with pytest.raises(FileError, match="could be two units"):
        log_times(tmp_path, "t", [str(300 * k) for k in range(len(Q))])


@pytest.mark.parametrize("header", ["sec,nanosec", "secs,nsecs", "seconds,nanoseconds"])
def test_seconds_and_nanoseconds_are_one_time(tmp_path: Path, header: str) -> None:
    stamps = [f"{1_700_000_000 + round(8e6 * k) // 10**9},{round(8e6 * k) % 10**9}" for k in range(len(Q))]
    for times in (log_times(tmp_path, header, stamps).t, path_times(tmp_path, header, stamps)):
        assert times is not None
        np.testing.assert_allclose(times - times[0], SINCE, atol=1e-9)


def test_a_way_point_that_rests_says_no_time(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="its column 'dwell_time' is neither"):
        path_times(tmp_path, "dwell_time", whole("s", 0))
