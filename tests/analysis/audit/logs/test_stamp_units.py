"""Times of logs and of way-points: the header says their unit, or the size of the stamps does, in one way for both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from bags import JOINTS, Q
from holokin.base.errors import RecordingError

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
    return hk.path.read_waypoints(file, units="mm").times


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
    with pytest.raises(RecordingError, match="could be two units; name the unit in the header, as in t_ms"):
        log_times(tmp_path, "t", [str(300 * k) for k in range(len(Q))])


@pytest.mark.parametrize("header", ["sec,nanosec", "secs,nsecs", "seconds,nanoseconds"])
def test_seconds_and_nanoseconds_are_one_time(tmp_path: Path, header: str) -> None:
    stamps = [f"{1_700_000_000 + round(8e6 * k) // 10**9},{round(8e6 * k) % 10**9}" for k in range(len(Q))]
    for times in (log_times(tmp_path, header, stamps).t, path_times(tmp_path, header, stamps)):
        assert times is not None
        np.testing.assert_allclose(times - times[0], SINCE, atol=1e-9)


def test_a_way_point_that_rests_says_no_time(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="its column 'dwell_time' is neither"):
        path_times(tmp_path, "dwell_time", whole("s", 0))
