"""Broken, hostile and long logs: each is refused in one sentence, or read and judged right, in little memory."""

from __future__ import annotations

import os
import resource
import sqlite3
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from bags import JOINTS, write_bag
from conftest import sampled
from holokin.analysis import audit
from holokin.analysis.audit import logs
from holokin.analysis.audit.arcs import FREE
from holokin.analysis.audit.cycles import find_cycles
from holokin.base.errors import ArgumentError, FileError

PANDA, PPR = hk.load("panda"), hk.load("ppr")


def refused(path: Path | str, *words: str, robot: hk.Robot = PANDA) -> None:
    with pytest.raises(FileError) as problem:
        hk.read_recording(path, robot)
    sentence = str(problem.value)
    assert str(path) in sentence
    assert "\n" not in sentence
    assert len(sentence) < 1000
    for word in words:
        assert word in sentence


# --- what is no file, or no log -------------------------------------------------------------------------------


@sampled(1, "suffix", ["csv", "mcap", "db3", "bag"])
def test_pipes_and_devices_are_refused_at_once(tmp_path: Path, suffix: str) -> None:
    pipe = tmp_path / f"log.{suffix}"
    os.mkfifo(pipe)
    code = f"import holokin as hk; hk.read_recording({str(pipe)!r}, hk.load('ppr'))"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=20, check=False)
    assert "is a pipe" in ran.stderr
    assert "save it as a file" in ran.stderr
    (tmp_path / f"endless.{suffix}").symlink_to("/dev/zero")
    refused(tmp_path / f"endless.{suffix}", "a device")


def test_a_folder_with_a_pipe_in_it_and_a_loop_of_links_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "metadata.yaml")
    refused(tmp_path, "'metadata.yaml' in it is no regular file")
    (tmp_path / "a.csv").symlink_to(tmp_path / "b.csv")
    (tmp_path / "b.csv").symlink_to(tmp_path / "a.csv")
    refused(tmp_path / "a.csv", "cannot be looked at")
    with pytest.raises(FileError, match="name too long"):
        hk.read_recording("a" * 5000 + ".csv", PANDA)
    with pytest.raises(ArgumentError, match="without a NUL character"):
        hk.read_recording("a\0b.csv", PANDA)


def csv_log(tmp_path: Path, *, header: str = "t,q1,q2,q3", rows: list[str] | None = None) -> Path:
    file = tmp_path / "log.csv"
    lines = rows if rows is not None else [f"{0.1 * k},0.{k},0.{k},0.{k}" for k in range(9)]
    file.write_text("\n".join([header.replace("q1,q2,q3", ",".join(PPR.joint_names)), *lines]) + "\n", "utf-8")
    return file


@pytest.mark.parametrize(
    ("stamps", "words"),
    [
        ([0, 10**308, 2 * 10**308], "not a finite number"),
        ([-(10**308), 0, 10**308], "over three centuries"),
        ([-9 * 10**18, 0, 9 * 10**18], "over three centuries"),
        ([0, 10**25, 2 * 10**25], "over three centuries"),
        ([0.0, 1e-300, 2e-300], "less than stamps can tell"),
    ],
)
def test_times_that_no_clock_gives_are_refused(tmp_path: Path, stamps: list[float], words: str) -> None:
    refused(csv_log(tmp_path, rows=[f"{t},0,0,{k}" for k, t in enumerate(stamps)]), words, robot=PPR)


def test_joints_beyond_belief_and_cells_without_end_are_refused(tmp_path: Path) -> None:
    refused(csv_log(tmp_path, rows=["0,0,0,0", "1,1e300,0,0"]), "1e+300 m", robot=PPR)
    refused(csv_log(tmp_path, rows=["0,0,0,0", "1," + "x" * 90_000 + ",0,0"]), "line 3", "...", robot=PPR)
    refused(csv_log(tmp_path, rows=["0,0,0,0", "1," + "9" * 2_000_000]), "a line has over 1000000", robot=PPR)
    refused(
        csv_log(tmp_path, header="t," + ",".join(f"\x1b[{i}mcolumn" for i in range(9000))), "9001 in all", robot=PPR
    )


def test_a_quoted_cell_over_several_lines_keeps_the_line_numbers(tmp_path: Path) -> None:
    rows = [f'{k},0,0,{k},"note\nover\nlines"' for k in range(5)]
    log = csv_log(tmp_path, header="t,q1,q2,q3,note", rows=rows)
    assert hk.read_recording(log, PPR).t.tolist() == [0, 1, 2, 3, 4]
    refused(csv_log(tmp_path, header="t,q1,q2,q3,note", rows=[*rows, "", "9,0,bad,0,x"]), "line 18", robot=PPR)


def test_lines_that_are_read_fast_or_slowly_give_the_same_numbers(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = [",".join(map(repr, [0.5 * k, *rng.normal(size=3).tolist()])) for k in range(500)]
    plain = hk.read_recording(csv_log(tmp_path, rows=rows), PPR)
    quoted = hk.read_recording(csv_log(tmp_path, rows=['"0.0"' + rows[0][3:], *rows[1:]]), PPR)
    assert np.array_equal(plain.q, quoted.q)
    assert np.array_equal(plain.t, quoted.t)
    assert plain.q[7].tolist() == [float(v) for v in rows[7].split(",")[1:]]


# --- bags -----------------------------------------------------------------------------------------------------


@pytest.mark.campaign
@sampled(1, "kind", ["sqlite3", "mcap"])
def test_a_bag_cut_or_overwritten_anywhere_is_read_or_refused(tmp_path: Path, kind: str) -> None:
    folder = write_bag(tmp_path / "bag", kind)
    whole = next(f for f in folder.iterdir() if f.suffix in (".mcap", ".db3"))
    data = whole.read_bytes()
    rng = np.random.default_rng(5)
    refusals = 0
    for i in range(60):
        broken = bytearray(data)
        if i % 3 == 0:
            del broken[int(rng.integers(len(data))) :]
        else:
            at = int(rng.integers(len(data) - 8))
            broken[at : at + 8] = (2 ** int(rng.integers(20, 64)) - 1).to_bytes(8, "little")
        whole.write_bytes(broken)
        try:
            hk.read_recording(whole, PANDA)
        except FileError as problem:
            refusals += 1
            assert "\n" not in str(problem)
    assert refusals > 10


def test_aliases_in_metadata_and_views_in_a_database_are_refused(tmp_path: Path) -> None:
    folder = write_bag(tmp_path / "bag", "sqlite3")
    metadata = folder / "metadata.yaml"
    text = metadata.read_text()
    bomb = "a: &a [x, x]\n" + "".join(
        f"{b}: &{b} [*{a}, *{a}]\n" for a, b in zip("abcdefghi", "bcdefghij", strict=True)
    )
    metadata.write_text(bomb + text.replace("compression_format: ''", "compression_format: *j"))
    refused(folder, "aliases")
    metadata.write_text(text + "x: " + "[" * 100_000)
    refused(folder, "brackets over 50 deep")
    metadata.write_text(text + "#" * 3_000_000)
    refused(folder, "metadata.yaml has over")
    base = sqlite3.connect(tmp_path / "view.db3")
    base.execute(
        "CREATE VIEW messages AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x FROM c"
    )
    base.close()
    refused(tmp_path / "view.db3", "computed")


def test_a_chunk_that_unpacks_to_more_than_it_says_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    zstd = pytest.importorskip("backports.zstd")
    packed = zstd.compress(bytes(3 * 10**8))
    head = b"\x89MCAP0\r\n"

    def record(kind: int, body: bytes) -> bytes:
        return bytes([kind]) + len(body).to_bytes(8, "little") + body

    for says, words in ((1000, "over 1000 bytes"), (2 * 10**9, "unpacks to over")):
        chunk = (
            bytes(16) + says.to_bytes(8, "little") + bytes(4) + b"\x04\0\0\0zstd" + len(packed).to_bytes(8, "little")
        )
        file = tmp_path / "bomb.mcap"
        file.write_bytes(head + record(1, b"\x04\0\0\0ros2\0\0\0\0") + record(6, chunk + packed))
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        refused(file, words)
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # KB


# --- long logs ------------------------------------------------------------------------------------------------


def joined(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Postures of the arm PPR at the tool places (x, y), its third joint a function of the place."""
    z = 0.5 + 0.4 * x * y
    return np.column_stack([x - np.cos(z), y - np.sin(z), z])


def phase(rows: int, loops: int, kind: str) -> np.ndarray:
    """Angles that rise over `loops` turns, steadily, at varying speed, or with pauses."""
    speed = 1 + 0.7 * np.sin(np.linspace(0, 17, rows)) if kind == "speeds" else np.ones(rows)
    if kind == "pauses":
        for at in (0.1, 0.33, 0.8):
            speed[int(at * rows) : int((at + 0.08) * rows)] = 0
    angle = np.cumsum(speed)
    return (angle - angle[0]) / (angle[-1] - angle[0]) * 2 * np.pi * loops


def recorded(q: np.ndarray, robot: hk.Robot = PPR) -> logs.Recording:
    return logs.Recording(robot.joint_names, 0.001 * np.arange(len(q)), q, "memory")


@pytest.mark.campaign
@sampled(1, "kind", ["even", "speeds", "pauses"])
@sampled(3, ("rows", "loops"), [(1000, 2), (1000, 10), (60_000, 2), (30_000, 300)])
def test_the_loops_of_a_circle_are_counted(rows: int, loops: int, kind: str) -> None:
    angle = phase(rows, loops, kind)
    q = joined(0.3 * np.cos(angle), 0.3 * np.sin(angle))
    assert len(find_cycles(recorded(q), PPR, axes=FREE)) == loops


@pytest.mark.campaign
def test_loops_of_few_samples_are_counted_in_a_log_of_thousands() -> None:
    """On one grid over the whole log a loop would have eight points: seven were one cycle."""
    angle = phase(30_000, 2100, "even")
    q = joined(0.3 * np.cos(angle), 0.3 * np.sin(angle))
    cycles = find_cycles(recorded(q), PPR, axes=FREE)
    assert len(cycles) == 2100
    assert cycles.length == pytest.approx(0.6 * np.pi, rel=0.05)


@pytest.mark.campaign
def test_the_drift_of_a_pseudo_inverse_does_not_hide_its_loops() -> None:
    """z' = (cos z y' - sin z x') / 2 is the pseudo-inverse of PPR."""
    start = 0.5
    angle = phase(10_000, 100, "even")
    x, y = 0.1 * np.cos(angle), 0.1 * np.sin(angle)
    z = np.empty(len(angle))
    z[0] = start
    for k in range(1, len(z)):
        middle = z[k - 1] + (np.cos(z[k - 1]) * (y[k] - y[k - 1]) - np.sin(z[k - 1]) * (x[k] - x[k - 1])) / 4
        z[k] = z[k - 1] + (np.cos(middle) * (y[k] - y[k - 1]) - np.sin(middle) * (x[k] - x[k - 1])) / 2
    q = np.column_stack([x - np.cos(z), y - np.sin(z), z])
    assert len(find_cycles(recorded(q), PPR, axes=FREE)) == 100
    assert hk.audit_recording(recorded(q), PPR).verdict is not audit.LogVerdict.REPEATS


@pytest.mark.campaign
@sampled(1, ("lines", "loops"), [(20, 2), (50, 3), (100, 3)])
def test_the_loops_of_a_fine_raster_are_counted(lines: int, loops: int) -> None:
    rows = [(-0.3 * i / (lines - 1), 0.3 * ((i + k) % 2)) for i in range(lines) for k in (0, 1)]
    corners = np.array([*rows, rows[0]])
    s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
    share = phase(60_000, loops, "even") / (2 * np.pi)
    at = np.minimum(share, loops - 1e-9) % 1 * s[-1]
    q = joined(np.interp(at, s, corners[:, 0]), np.interp(at, s, corners[:, 1]))
    cycles = find_cycles(recorded(q), PPR, axes=FREE)
    assert len(cycles) == loops
    assert cycles.length == pytest.approx(s[-1], rel=0.01)


@pytest.mark.campaign
def test_a_long_way_in_and_out_does_not_count() -> None:
    """The rounds begin in the second third of the log, where no stretch begins that is looked at."""
    t = np.linspace(0, 1, 50_000)
    x, y = 0.3 + t * (1 - t) * np.cos(40 * np.pi * t), 0.6 * (1 - t) * np.sin(7 * t)
    angle = phase(50_000, 300, "even")
    cycles = find_cycles(
        recorded(joined(np.r_[x, 0.3 * np.cos(angle), x[::-1]], np.r_[y, 0.3 * np.sin(angle), y[::-1]])),
        PPR,
        axes=FREE,
    )
    assert len(cycles) == 300
    assert cycles.start[0] == pytest.approx(50_000, abs=100)  # the path in ends at rest


@pytest.mark.campaign
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is measured by Linux")
def test_a_long_csv_is_read_and_judged_in_little_memory(tmp_path: Path) -> None:
    """100,000 rows, 6 MB as numbers: their text as Python strings would take 100 MB."""
    code = textwrap.dedent(f"""
        import numpy as np, holokin as hk
        def peak():  # not getrusage: a new process begins with what its parent had
            return next(int(line.split()[1]) / 1024 for line in open("/proc/self/status") if line.startswith("VmHWM"))
        def make(n):
            a = np.linspace(0, 2 * np.pi * 100, n)[:, None]
            q = [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5] + 0.1 * np.sin(a) * np.arange(1, 8) / 4
            with open({str(tmp_path / "log.csv")!r}, "w") as f:
                f.write("t,{",".join(JOINTS)}\\n")
                for i in range(0, n, 5000):
                    np.savetxt(f, np.column_stack([0.01 * np.arange(i, i + 5000), q[i:i + 5000]]), delimiter=",")
            del q, a
        robot = hk.load("panda")
        make(100_000)
        sines = 0.1 * np.sin(np.arange(300.))[:, None] * np.ones(7) + [0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5]
        hk.audit_recording(hk.analysis.audit.logs.Recording(robot.joint_names, np.arange(300.), sines, "warm"), robot)
        base = peak()
        log = hk.read_recording({str(tmp_path / "log.csv")!r}, robot)
        read = peak()
        found = hk.audit_recording(log, robot)
        print(len(found.cycles), read - base, peak() - base)
    """)
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    count, reading, all_ = ran.stdout.split()
    assert int(count) == 100
    assert float(reading) < 40
    assert float(all_) < 100
