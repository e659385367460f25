"""Equal tool poses over the episodes of a dataset: what differs is found where it was put, and nothing else."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import holokin as hk
from conftest import Command
from holokin.analysis.audit import DatasetAudit, LogVerdict, audit_dataset
from holokin.analysis.audit.logs import joint_feature, pose_feature, read_dataset
from holokin.app.report.log_report import dataset_figure
from small_datasets import write_dataset

ARM = hk.load("planar-3r")
NAMES = [f"{joint}.pos" for joint in ARM.joint_names]
Q0 = np.array([0.3, 0.8, 0.5])
POINT = {"orientation": False}


def circles(law: hk.Strategy, count: int, samples: int = 40) -> list[np.ndarray]:
    """Joints of a planar arm on a circle, an episode a cycle, closed at both ends."""
    start = ARM.pose(Q0)[:3, 3]
    walk = hk.follow(law, hk.circle(start, start - [0.6, 0, 0]), Q0, samples=samples, cycles=count)
    return [walk.q[e * samples : (e + 1) * samples + 1] for e in range(count)]


HELD = circles(hk.holonomic(hk.position(ARM), hk.lock(2)), 4)
DRIFTING = circles(hk.moore_penrose(hk.position(ARM)), 4)


def write(folder: Path, episodes: list[np.ndarray], **more: object) -> Path:
    columns = [{"observation.state": q, "action": q} for q in episodes]
    return write_dataset(folder, columns, {"observation.state": NAMES, "action": NAMES}, **more)


def audited(folder: Path, robot: hk.Robot = ARM, **options: object) -> DatasetAudit:
    data = read_dataset(folder)
    return audit_dataset(data, robot, joint_feature(data, robot, "observation.state"), **(POINT | options))


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_a_holonomic_strategy_has_equal_joints_in_all_episodes_and_the_pseudo_inverse_has_not(
    tmp_path: Path, version: str
) -> None:
    held = audited(write(tmp_path / "held", HELD, version=version))
    assert held.verdict is LogVerdict.REPEATS
    assert held.decided.sum() >= 100 and held.pairs.distance.max() < 1e-6
    drifting = audited(write(tmp_path / "drifting", DRIFTING, version=version))
    assert drifting.verdict is LogVerdict.DIFFERS
    most = np.abs(DRIFTING[3][-1] - DRIFTING[0][0]).max()  # the last frame has the pose of the first
    worst = drifting.worst()
    assert worst is not None
    assert drifting.pairs.distance[worst] == pytest.approx(most, rel=1e-3)
    place = drifting.place(worst)
    assert {place["first"]["episode"], place["second"]["episode"]} == {0, 3}
    np.testing.assert_allclose(place["tool"], ARM.pose(Q0)[:3, 3], atol=1e-6)


def test_the_one_episode_with_another_posture_is_named_with_its_joint(tmp_path: Path) -> None:
    """One episode runs with the elbow on the other side: the mirror image of the arm about the line to its tool."""
    episodes = [q.copy() for q in HELD]
    other = hk.ik(hk.holonomic(hk.position(ARM), hk.lock(2)), [1.4, -1.2, 0.5])
    episodes[2] = other.batch(ARM.pose_batch(HELD[2])[0]).q
    assert np.isfinite(episodes[2]).all()
    found = audited(write(tmp_path / "d", episodes))
    assert found.verdict is LogVerdict.DIFFERS
    touched = {e["episode"]: e["differ"] for e in found.by_episode()}
    assert touched[2] >= 40
    assert all(found.place(i)["second"]["episode"] == 2 for i in np.flatnonzero(found.pairs.beyond))
    assert audited(tmp_path / "d", episodes=[0, 1, 3]).verdict is LogVerdict.REPEATS


def test_a_difference_below_the_tolerance_is_equal_and_above_it_is_not(tmp_path: Path) -> None:
    """The spare joint is moved by a known amount at the same tool pose."""
    task = hk.position(ARM)
    for size, verdict in ((0.004, LogVerdict.REPEATS), (0.03, LogVerdict.DIFFERS)):
        ik = hk.ik(hk.holonomic(task, hk.lock(2)), Q0)
        moved = ik.batch(ARM.pose_batch(HELD[1])[0], level=float(Q0[2] + size)).q
        found = audited(write(tmp_path / f"{size}", [HELD[0], moved]))
        assert found.verdict is verdict, size
        assert found.pairs.distance.max() == pytest.approx(np.abs(moved - HELD[1]).max(), rel=0.05)


def test_a_pose_that_is_never_left_is_not_visited_again(tmp_path: Path) -> None:
    """An arm at rest whose encoders are noisy, at any place of the grid of poses: it says nothing."""
    rng = np.random.default_rng(5)
    for k in range(4):
        rest = np.repeat(Q0[None] + 0.1 * k, 300, axis=0) + 1e-3 * rng.standard_normal((300, 3))
        found = audited(write(tmp_path / f"rest-{k}", [rest]))
        assert found.verdict is LogVerdict.UNDECIDED
        assert len(found.pairs.first) == 0
        assert "no tool pose comes again" in found.sentence()


def test_a_pose_that_comes_again_in_one_episode_counts(tmp_path: Path) -> None:
    found = audited(write(tmp_path / "d", [np.vstack(DRIFTING)]))
    assert found.verdict is LogVerdict.DIFFERS
    assert found.begins.tolist() == [0, 4 * 41]


def test_episodes_of_one_frame_are_compared(tmp_path: Path) -> None:
    found = audited(write(tmp_path / "d", [HELD[0][:1], HELD[0][:1], DRIFTING[3][-1:]]))
    assert found.verdict is LogVerdict.DIFFERS
    assert sorted(found.pairs.beyond) == [False, True]


def test_poses_that_are_near_but_not_equal_leave_it_open(tmp_path: Path) -> None:
    """Poses up to 4 mm apart do not show whether joints are equal to 1e-5 rad; they do show that they are to 0.02."""
    ik = hk.ik(hk.holonomic(hk.position(ARM), hk.lock(2)), Q0)
    place = ARM.pose_batch(HELD[0])[0] + [0.0028, 0.0028, 0.0]
    found = audited(write(tmp_path / "d", [HELD[0][:-1], ik.batch(place).q[:-1]]), tolerance=1e-5)
    assert len(found.pairs.first) > 10 and not found.decided.any()
    assert found.verdict is LogVerdict.UNDECIDED
    assert audited(tmp_path / "d", tolerance=2e-2).verdict is LogVerdict.REPEATS


def test_poses_a_millimetre_apart_are_compared_wherever_they_lie(tmp_path: Path) -> None:
    """Two of them may lie on two sides of a cell of one grid; then they are in one cell of the other."""
    ik = hk.ik(hk.holonomic(hk.position(ARM), hk.lock(2)), Q0)
    across = np.mgrid[-3:4, -3:4].reshape(2, -1).T * 0.03 + np.random.default_rng(4).uniform(0, 5e-3, (49, 2))
    places = ARM.pose(Q0)[:3, 3] + np.pad(across, ((0, 0), (0, 1)))
    for axis, step in enumerate(1e-3 * np.eye(3)[:2]):
        episodes = [ik.batch(places).q, ik.batch(places + step).q]
        found = audited(write(tmp_path / f"{axis}", episodes))
        assert sorted(zip(found.pairs.first % 49, found.pairs.second % 49, strict=True)) == [(i, i) for i in range(49)]


def test_equal_places_with_other_orientations_are_no_equal_poses(tmp_path: Path) -> None:
    """By default the whole pose counts: this arm turns its tool from episode to episode, at the same place."""
    folder = write(tmp_path / "d", DRIFTING)
    data = read_dataset(folder)
    found = audit_dataset(data, ARM, joint_feature(data, ARM, "observation.state"))
    assert found.task.m == 3
    assert not found.pairs.beyond.any()


def test_tool_poses_of_a_column_may_be_compared_and_their_gap_to_the_joints_is_said(tmp_path: Path) -> None:
    names = {
        "observation.state": NAMES,
        "action": ["ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz", "ee.gripper_pos"],
    }
    columns = []
    for q in DRIFTING:
        p, _ = ARM.pose_batch(q)
        columns.append({"observation.state": q, "action": np.hstack([p + [0.0, 0.0, 0.05], np.zeros((len(q), 4))])})
    folder = write_dataset(tmp_path / "d", columns, names)
    found = audited(folder, poses=pose_feature(read_dataset(folder), "action"))
    assert found.verdict is LogVerdict.DIFFERS
    assert found.notes == ("action and the tool of the joints are up to 0.05 m apart",)


def test_the_command_says_it_writes_it_and_draws_it(tmp_path: Path, holokin: Command) -> None:
    folder = write(tmp_path / "d", DRIFTING)
    json_file, figure = tmp_path / "found.json", tmp_path / "found.png"
    arguments = ("audit", str(folder), "--robot", "planar-3r", "--position", "--json", str(json_file))
    done = holokin(*arguments, "--plot", str(figure))
    assert done.code == 1
    assert "differs: at" in done.out and "episode 3" in done.out
    facts = json.loads(json_file.read_text())
    assert facts["verdict"] == "DIFFERS" and [e["episode"] for e in facts["by episode"]] == [0, 1, 2, 3]
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert holokin(*arguments, "--episodes", "0").code == 1  # its circle closes, its joints do not
    one = write(tmp_path / "one", [HELD[0][:1]])
    assert holokin("audit", str(one), "--robot", "planar-3r").code == 2
    assert holokin("audit", str(write(tmp_path / "h", HELD)), "--robot", "planar-3r", "--position").code == 0


def test_a_figure_without_a_pair_is_drawn(tmp_path: Path) -> None:
    assert len(dataset_figure(audited(write(tmp_path / "d", [HELD[0][:1]]))).axes) == 2


PEAK = """
import atexit, re
from pathlib import Path
from holokin.app.cli.main import main
atexit.register(lambda: print(re.search(r"VmHWM:\\s+(\\d+)", Path("/proc/self/status").read_text())[1], flush=True))
main()
"""
"""The command in a process of its own, and the most memory that the process had [kB], in its last line."""


@pytest.mark.campaign
@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="the peak of the memory is read from /proc")
def test_the_audit_of_a_million_frames_holds_less_than_200_megabytes(tmp_path: Path) -> None:
    """A thousand episodes of seven joints, in one row group; every second one has the poses of the one before it."""
    robot, rng, t = hk.load("panda"), np.random.default_rng(1), np.linspace(0, 1, 1000)
    q0 = np.array([0.1, -0.4, 0.2, -2.0, 0.3, 1.7, 0.5])
    episodes = []
    for _ in range(500):
        size, rate, phase = rng.normal(size=(7, 4)) * 0.25, rng.uniform(0.5, 3, 4), rng.uniform(0, 2 * np.pi, 4)
        waves = np.sin(2 * np.pi * rate[:, None] * t + phase[:, None]) - np.sin(phase)[:, None]
        q = q0 + ((size / np.arange(1, 5)) @ waves).T
        episodes += [{"observation.state": part.astype(np.float32)} for part in (q, q + 1e-4)]
    names = {"observation.state": [f"{joint}.pos" for joint in robot.joint_names]}
    folder = write_dataset(tmp_path / "d", episodes, names, per_file=len(episodes))
    command = [sys.executable, "-c", PEAK, "audit", str(folder), "--robot", "panda", "--radians"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode in (0, 1), done.stderr
    assert "1000000 frames of 1000 episodes" in done.stdout
    assert int(done.stdout.split()[-1]) * 1024 < 200e6, done.stdout.splitlines()[-1]
